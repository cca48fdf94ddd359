//! Reads the shared memory and keeps the newest picture. In: the events of a [`feed`](crate::subscribers::feed). Out:
//! a [`Picture`] in a channel. Called by the server, on a thread of its own.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tokio::sync::watch;

use super::{Picture, wire};
use crate::subscribers::feed::{Feed, FeedEvent};

/// How often frames are polled: some browsers draw 240 times a second, none needs more. To be woken by each frame
/// instead would cost the publisher more than the frame itself.
const POLL_INTERVAL: Duration = Duration::from_millis(4);
/// How long to wait where the services cannot be used, before the next attempt.
const RETRY_INTERVAL: Duration = Duration::from_millis(200);
/// Cues that a browser which takes long to be written to may fall behind.
const KEPT_CUES: usize = 16;

/// Keeps the picture up to date until `stop` is set, through any number of publishers.
pub(super) fn read(mut feed: Feed, sender: &watch::Sender<Picture>, stop: &AtomicBool) {
    let mut reader = Reader { picture: Picture::waiting(None), benches: 0, cues: 0 };
    let mut reason: Option<String> = None;
    sender.send_replace(reader.picture.clone());
    while !stop.load(Ordering::Relaxed) {
        let mut changed = false;
        let polled = feed.poll(POLL_INTERVAL, &mut |event| changed |= reader.handle(event));
        // The services may become usable while this continues: a program of another version ends, a subscriber leaves.
        let now = polled.err().map(|error| error.to_string());
        if now != reason {
            now.iter().for_each(|sentence| log::warn!("{sentence}"));
            if now.is_some() || !changed {
                reader.picture = Picture::waiting(now.as_deref());
            }
            changed = true;
        }
        if changed {
            sender.send_replace(reader.picture.clone());
        }
        if now.is_some() {
            std::thread::sleep(RETRY_INTERVAL);
        }
        reason = now;
    }
}

/// The newest of everything, as far as it has come.
struct Reader {
    picture: Picture,
    /// The size of the team, which an alert's sentence needs.
    benches: u32,
    /// Cues that have come so far.
    cues: u64,
}

impl Reader {
    /// Takes in an event; whether the picture has changed.
    fn handle(&mut self, event: FeedEvent<'_>) -> bool {
        match event {
            FeedEvent::Stage(stage) => {
                self.picture.stage = wire::stage(stage).into();
                self.benches = stage.benches;
            }
            FeedEvent::Alert(alert) => self.picture.alert = wire::alert(alert, self.benches).into(),
            FeedEvent::Cue(cue) => {
                self.cues += 1;
                let kept = self.picture.cues.iter().rev().take(KEPT_CUES - 1).rev().cloned();
                self.picture.cues = kept.chain([(self.cues, wire::cue(cue).into())]).collect();
            }
            FeedEvent::Frame { header, handles, .. } => self.picture.frame = wire::frame(header, handles).into(),
            FeedEvent::Gone => {
                self.picture = Picture::waiting(None);
                return true;
            }
            // The page counts the time since the latest frame by itself.
            FeedEvent::Silent | FeedEvent::Started { .. } | FeedEvent::Status(_) => return false,
        }
        self.picture.waiting = Default::default();
        true
    }
}
