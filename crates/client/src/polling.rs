//! The loop of a subscriber that polls, for `send`, `metrics` and `chase`. In: the events of a [`Feed`] of each
//! publisher. Out: calls of a [`Handler`].
//!
//! Subscribers poll because waking this process at each frame would cost the publisher more than it saves here, while
//! polling costs the publisher nothing.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::connection::Wake;
use super::feed::{Delivery, Feed, FeedEvent, FeedOptions};
use crate::shared_memory::OpenError;

/// The interval of polls: the greatest delay of a handler after the publisher.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// The reason why services cannot be used at present. The reason may disappear: a program of another version or a
/// subscriber ends.
#[derive(Debug, Default)]
pub struct Obstacle(Option<String>);

impl Obstacle {
    /// The time before the next attempt.
    pub const RETRY_INTERVAL: Duration = Duration::from_millis(200);

    /// Updates the obstacle by the result of a poll, and logs a new one once. Returns true if there is an obstacle.
    pub fn is_met(&mut self, polled: Result<(), OpenError>) -> bool {
        let now = polled.err().map(|error| error.to_string());
        now.iter().filter(|_| now != self.0).for_each(|sentence| log::warn!("{sentence}"));
        self.0 = now;
        self.0.is_some()
    }
}

/// A receiver of all events.
pub trait Handler {
    /// Handles an event of a publisher, given by its place in the list of names, from 0.
    fn handle(&mut self, publisher: usize, event: FeedEvent<'_>);
    /// Handles the clock of a running publisher: `shares_clock` is true if this is also the clock of this process.
    /// Called before the first frame and after each poll. Handlers that compare no moments can ignore it.
    fn clock(&mut self, _publisher: usize, _shares_clock: bool) {}
    /// Handles that the feed [is ready](Feed::is_ready). Called after each poll of a feed that is.
    fn ready(&mut self, _publisher: usize) {}
    /// Does periodic work, after every poll.
    fn polled(&mut self, now: Instant);
}

/// The feed of one publisher, and its obstacle.
struct Source {
    feed: Feed,
    obstacle: Obstacle,
    next: Instant,
}

/// Calls a handler with the events of the services of each name, through any number of publishers, until `stop` is set.
///
/// # Errors
/// [`OpenError`] for a name that iceoryx2 refuses, or if this process may not use the shared memory. Services that
/// become unusable later are tried again while the others are polled; the log names the reason once. One thread polls
/// all: a service whose publisher was killed while creating it delays the others. The delay lasts as long as iceoryx2
/// waits for the service, at each attempt until the service's files have been removed.
pub fn poll_until(
    stop: &AtomicBool,
    names: &[String],
    frames: Delivery,
    handler: &mut impl Handler,
) -> Result<(), OpenError> {
    let source = |name: &String| {
        let feed = Feed::new(name, FeedOptions { wake: Wake::Never, frames })?;
        Ok(Source { feed, obstacle: Obstacle::default(), next: Instant::now() })
    };
    let mut sources = names.iter().map(source).collect::<Result<Vec<_>, OpenError>>()?;
    loop {
        // `stop` is read before the queues are emptied: everything sent before `stop` was set is handled.
        let ending = stop.load(Ordering::Relaxed);
        for (publisher, source) in sources.iter_mut().enumerate().filter(|(_, source)| source.next <= Instant::now()) {
            let polled = source.feed.poll(Duration::ZERO, &mut |event| handler.handle(publisher, event));
            if let Some(shares_clock) = source.feed.shares_clock() {
                handler.clock(publisher, shares_clock);
            }
            if source.feed.is_ready() {
                handler.ready(publisher);
            }
            if source.obstacle.is_met(polled) {
                source.next = Instant::now() + Obstacle::RETRY_INTERVAL;
            }
        }
        handler.polled(Instant::now());
        if ending {
            return Ok(());
        }
        std::thread::sleep(POLL_INTERVAL);
    }
}
