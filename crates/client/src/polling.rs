//! The loop of a subscriber that is not woken by frames: what `send` and `metrics` stand on. In: the events of a
//! [`Feed`] for each publisher. Out: calls of a [`Handler`].
//!
//! To be woken by each frame would cost the publisher more than it saves here; polling costs it nothing.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::connection::Wake;
use super::feed::{Feed, FeedEvent, FeedOptions, Frames};
use crate::shared_memory::OpenError;

/// How often frames are polled, which is how much later than the publisher a handler can be.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// What is in the way of services that cannot be used at present. It may go: a program of another version ends, a subscriber
/// leaves.
#[derive(Debug, Default)]
pub struct Obstacle(Option<String>);

impl Obstacle {
    /// How long to wait before the next attempt.
    pub const RETRY_INTERVAL: Duration = Duration::from_millis(200);

    /// Takes in how a poll ended: whether there is an obstacle now, of which the log has the sentence once.
    pub fn is_met(&mut self, polled: Result<(), OpenError>) -> bool {
        let now = polled.err().map(|error| error.to_string());
        now.iter().filter(|_| now != self.0).for_each(|sentence| log::warn!("{sentence}"));
        self.0 = now;
        self.0.is_some()
    }
}
/// What is called with all that comes.
pub trait Handler {
    /// Takes in what has come from a publisher, which is known by its place in the list of names, from 0.
    fn handle(&mut self, publisher: usize, event: FeedEvent<'_>);
    /// Takes in whether the clock of a publisher that is there is that of this process, before its first frame comes
    /// and again after each poll. Handlers that compare no moments need not know.
    fn clock(&mut self, _publisher: usize, _shares_clock: bool) {}
    /// Does what is due, whether anything has come or not.
    fn polled(&mut self, now: Instant);
}

/// The feed of one publisher, and what is in its way.
struct Source {
    feed: Feed,
    obstacle: Obstacle,
    next: Instant,
}

/// Feeds a handler from the services of each name, through any number of publishers, until `stop` is set.
///
/// # Errors
/// [`OpenError`] for a name that iceoryx2 cannot take, or where this process may not use the shared memory. Services that
/// cannot be used later on are waited for while the others are polled; the log names the reason once. All are polled by
/// one thread: a service that hangs in its creation, since its publisher was killed at that moment, keeps the others
/// waiting for as long as iceoryx2 waits for it, at each attempt until its files have been removed.
pub fn poll_until(
    stop: &AtomicBool,
    names: &[String],
    frames: Frames,
    handler: &mut impl Handler,
) -> Result<(), OpenError> {
    let source = |name: &String| {
        let feed = Feed::new(name, FeedOptions { wake: Wake::Never, frames })?;
        Ok(Source { feed, obstacle: Obstacle::default(), next: Instant::now() })
    };
    let mut sources = names.iter().map(source).collect::<Result<Vec<_>, OpenError>>()?;
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(POLL_INTERVAL);
        for (publisher, source) in sources.iter_mut().enumerate().filter(|(_, source)| source.next <= Instant::now()) {
            let polled = source.feed.poll(Duration::ZERO, &mut |event| handler.handle(publisher, event));
            if let Some(shares_clock) = source.feed.shares_clock() {
                handler.clock(publisher, shares_clock);
            }
            if source.obstacle.is_met(polled) {
                source.next = Instant::now() + Obstacle::RETRY_INTERVAL;
            }
        }
        handler.polled(Instant::now());
    }
    Ok(())
}
