//! Reads the shared memory and keeps the newest picture. Called by the server, on a thread of its own.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::super::connection::{Connection, Subscription};
use super::{Picture, wire};

/// How often frames are looked for: some browsers draw 240 times a second, none needs more. To be woken by each
/// frame instead would cost the publisher more than the frame itself.
const GLANCE: Duration = Duration::from_millis(4);
/// How often a silent publisher is looked for, and missing services are opened.
const LOOK: Duration = Duration::from_millis(200);

/// Keeps the picture up to date until `stop` is set, through any number of publishers.
pub(super) fn read(subscription: &Subscription, sender: &watch::Sender<Picture>, stop: &AtomicBool) {
    let mut told = None;
    while !stop.load(Ordering::Relaxed) {
        let reason = match subscription.connect() {
            Ok(Some(connection)) => {
                follow(subscription, connection, sender, stop);
                None
            }
            Ok(None) => None,
            // It may be mended while this goes on: a program of another version ends, a subscriber leaves.
            Err(error) => Some(error.to_string()),
        };
        if reason.is_some() && reason != told {
            log::warn!("{}", reason.as_deref().unwrap_or_default());
        }
        sender.send_replace(Picture { waiting: wire::waiting(reason.as_deref()).into(), ..Picture::default() });
        told = reason;
        std::thread::sleep(LOOK);
    }
}

/// Hands on what comes until the publisher is gone.
fn follow(subscription: &Subscription, mut connection: Connection, sender: &watch::Sender<Picture>, stop: &AtomicBool) {
    let (mut picture, mut benches) = (Picture::default(), 0);
    let (mut heard, mut looked) = (Instant::now(), Instant::now());
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(GLANCE);
        let mut fresh = false;
        while let Some(stage) = connection.stage() {
            picture.stage = wire::stage(&stage).into();
            benches = stage.benches;
            fresh = true;
        }
        while let Some(alert) = connection.alert() {
            picture.alert = wire::alert(&alert, benches).into();
            fresh = true;
        }
        if let Some(frame) = connection.newest_frame(wire::frame) {
            picture.frame = frame.into();
            heard = Instant::now();
            fresh = true;
        }
        if fresh {
            sender.send_replace(picture.clone());
        }
        if looked.elapsed() > LOOK {
            looked = Instant::now();
            if subscription.complete(&mut connection).is_err() {
                // Connecting anew tells why.
                return;
            }
            if heard.elapsed() > LOOK && !subscription.publisher_is_alive(&connection) {
                return;
            }
        }
    }
}
