//! The loop of a subscriber that is not woken by frames: what `send` and `metrics` stand on. In: the events of a
//! [`Feed`]. Out: calls of a [`Handler`].
//!
//! To be woken by each frame would cost the publisher more than it saves here; polling costs it nothing.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::connection::Wake;
use super::feed::{Feed, FeedEvent, FeedOptions, Frames};
use crate::transports::iceoryx2::OpenError;

/// How often frames are polled, which is how much later than the publisher a handler can be.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
/// How long to wait where the services cannot be used, before the next attempt.
const RETRY_INTERVAL: Duration = Duration::from_millis(200);

/// What is called with all that comes.
pub trait Handler {
    /// Takes in what has come.
    fn handle(&mut self, event: FeedEvent<'_>);
    /// Does what is due, whether anything has come or not.
    fn polled(&mut self, now: Instant);
}

/// Feeds a handler from the services of a name, through any number of publishers, until `stop` is set.
///
/// # Errors
/// [`OpenError`] for a name that iceoryx2 cannot take, or where this process may not use the shared memory. Services that
/// cannot be used later on are waited for; the log names the reason once.
pub fn poll_until(stop: &AtomicBool, name: &str, frames: Frames, handler: &mut impl Handler) -> Result<(), OpenError> {
    let mut feed = Feed::new(name, FeedOptions { wake: Wake::Never, frames })?;
    let mut reason: Option<String> = None;
    while !stop.load(Ordering::Relaxed) {
        let polled = feed.poll(POLL_INTERVAL, &mut |event| handler.handle(event));
        handler.polled(Instant::now());
        // The services may become usable while this continues: a program of another version ends, a subscriber leaves.
        let now = polled.err().map(|error| error.to_string());
        if now.is_some() {
            now.iter().filter(|_| now != reason).for_each(|sentence| log::warn!("{sentence}"));
            std::thread::sleep(RETRY_INTERVAL);
        }
        reason = now;
    }
    Ok(())
}
