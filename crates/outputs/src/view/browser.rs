//! Sends the newest picture to one browser, at the browser's pace.
//!
//! A socket's buffers hold seconds of frames, so a writable socket does not show that the browser has read. Therefore a
//! ping follows each frame, which every WebSocket answers when it has read that far. At most [`MAX_IN_FLIGHT`] frames
//! stay unanswered, so that a slow browser gets fewer frames, but not later ones.

use std::time::Duration;

use axum::extract::ws::{Message, Utf8Bytes, WebSocket};
use futures_util::{Sink, SinkExt, StreamExt};
use tokio::sync::{mpsc, watch};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep_until, timeout};

use super::authorization::Visitor;
use super::{Channel, Picture, wire};
use bench_dragon_client::clock::monotonic_ns;

/// Frames that may be in flight to a browser: enough for 60 a second over a network that takes 50 ms.
const MAX_IN_FLIGHT: u64 = 3;
/// The interval of pings without frames.
const PING_INTERVAL: Duration = Duration::from_secs(10);
/// The time without messages, or of one write, after which a browser is gone.
const TIMEOUT: Duration = Duration::from_secs(30);

/// Serves one publisher to a browser until the browser goes. `gap` is the least time between two frames.
pub(super) async fn serve(socket: WebSocket, channel: Channel, gap: Duration) {
    let Channel { mut pictures, authorization, .. } = channel;
    let (mut sink, mut stream) = socket.split();
    let (sender, mut answers) = mpsc::unbounded_channel();
    let mut visitor = Visitor::new(authorization.as_deref(), sender);
    let permission = visitor.permission().map(text);
    if !matches!(timeout(TIMEOUT, send(&mut sink, permission.into_iter().collect())).await, Ok(Ok(()))) {
        return;
    }
    let mut pings = interval(PING_INTERVAL);
    pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let (mut sent, mut answered) = (0, 0);
    let (mut due, mut last_received) = (Instant::now(), Instant::now());
    // A late browser gets the latest cue, as over shared memory.
    let past_cues = pictures.borrow().cues.iter().rev().skip(1).cloned().collect();
    let mut known = Picture { cues: past_cues, ..Picture::default() };
    pictures.mark_changed();
    loop {
        let has_credit = sent - answered < MAX_IN_FLIGHT;
        let messages = tokio::select! {
            message = stream.next() => {
                let Some(Ok(message)) = message else { return };
                last_received = Instant::now();
                match message {
                    Message::Close(_) => return,
                    Message::Pong(count) => {
                        // Only the last of several pings needs an answer.
                        let count = count.as_ref().try_into().map_or(0, u64::from_le_bytes);
                        answered = count.clamp(answered, sent);
                        continue;
                    }
                    Message::Text(request) if request == "clock" => {
                        // This clock does not apply to frames of another machine's clock.
                        let shares_clock = pictures.borrow().shares_clock == Some(true);
                        vec![text(wire::clock(shares_clock.then(monotonic_ns)))]
                    }
                    Message::Text(request) => visitor.receive(&request).map(text).into_iter().collect(),
                    _ => continue,
                }
            }
            Some(answer) = answers.recv() => {
                visitor.unanswered -= 1;
                vec![text(answer)]
            }
            changed = wait_for(&mut pictures, due), if has_credit => {
                if changed.is_err() {
                    return;
                }
                let picture = pictures.borrow_and_update().clone();
                let mut messages = changed_messages(&picture, &known);
                if picture.frame != known.frame && !picture.frame.is_empty() {
                    sent += 1;
                    due = (due + gap).max(Instant::now() - gap);
                    messages.extend([Message::Binary(picture.frame.clone()), ping(sent)]);
                }
                known = picture;
                messages
            }
            _ = pings.tick() => {
                if last_received.elapsed() > TIMEOUT {
                    return;
                }
                vec![ping(sent)]
            }
        };
        if !matches!(timeout(TIMEOUT, send(&mut sink, messages)).await, Ok(Ok(()))) {
            return;
        }
    }
}

/// Waits until a new picture may be sent. An error means that the sender has gone.
async fn wait_for(pictures: &mut watch::Receiver<Picture>, due: Instant) -> Result<(), watch::error::RecvError> {
    sleep_until(due).await;
    pictures.changed().await
}

/// Returns the messages about changes besides the frame.
fn changed_messages(picture: &Picture, known: &Picture) -> Vec<Message> {
    let parts = |of: &Picture| [&of.waiting, &of.stage, &of.alert, &of.facts, &of.chase].map(Clone::clone);
    let changed = parts(picture).into_iter().zip(parts(known)).filter(|(new, old)| new != old && !new.is_empty());
    let newest_cue = known.cues.iter().map(|(number, _)| *number).max().unwrap_or(0);
    let cues = picture.cues.iter().filter(|(number, _)| *number > newest_cue);
    changed.map(|(new, _)| new).chain(cues.map(|(_, cue)| cue.clone())).map(Message::Text).collect()
}

fn text(json: String) -> Message {
    Message::Text(Utf8Bytes::from(json))
}

fn ping(count: u64) -> Message {
    Message::Ping(count.to_le_bytes().to_vec().into())
}

async fn send(
    sink: &mut (impl Sink<Message, Error = axum::Error> + Unpin),
    messages: Vec<Message>,
) -> Result<(), axum::Error> {
    for message in messages {
        sink.feed(message).await?;
    }
    sink.flush().await
}
