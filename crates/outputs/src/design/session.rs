//! The WebSocket of one session: requests to the studio, answers to the browser.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::SplitSink;
use futures_util::{SinkExt, StreamExt};
use serde::Deserialize;
use serde_json::json;
use tokio::sync::mpsc::{Sender, channel};
use tokio::time::{MissedTickBehavior, interval, timeout};

use super::{Answer, DesignSession, Server};
use crate::view::wire;

/// Answers that may wait for a browser.
const MOST_ANSWERS: usize = 64;
/// The interval of pings.
const PING_INTERVAL: Duration = Duration::from_secs(10);
/// The time without messages, or of one write, after which a browser is gone.
const TIMEOUT: Duration = Duration::from_secs(30);

/// The sentence to a page without the token.
pub(super) const NEEDS_TOKEN: &str = "a design needs the token of the address that the command printed";

/// The place of a session among those that are allowed at a time.
pub(super) struct Place(Arc<AtomicUsize>);

impl Place {
    /// Takes a place, if there is one.
    pub(super) fn taken(taken: &Arc<AtomicUsize>, most: usize) -> Option<Self> {
        let place = Self(Arc::clone(taken));
        // The place is given back where there was none.
        (taken.fetch_add(1, Ordering::Relaxed) < most).then_some(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The first message of a page that needs a token.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TokenMessage {
    token: String,
}

/// Serves a browser until it goes. `_place` is held as long.
pub(super) async fn serve(socket: WebSocket, server: Server, _place: Place) {
    let (mut sink, mut stream) = socket.split();
    let (answers, mut answered) = channel(MOST_ANSWERS);
    let mut pings = interval(PING_INTERVAL);
    pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut last_received = tokio::time::Instant::now();
    let mut session = None;
    let greeting = server.studio.greeting(server.token.is_some());
    if !sent(&mut sink, text(greeting)).await {
        return;
    }
    if server.token.is_none() {
        session = open(&server, answers.clone());
    }
    loop {
        let message = tokio::select! {
            message = stream.next() => {
                let Some(Ok(message)) = message else { return };
                last_received = tokio::time::Instant::now();
                match message {
                    Message::Close(_) => return,
                    Message::Text(request) => match &session {
                        Some(open) => match open.request(request.to_string()) {
                            Ok(()) => continue,
                            Err(busy) => refused(&busy.to_string()),
                        },
                        None => {
                            let allowed = is_token(&server, &request);
                            if allowed {
                                session = open(&server, answers.clone());
                            }
                            text(json!({"id": 0, "allowed": allowed}).to_string())
                        }
                    },
                    _ => continue,
                }
            }
            Some(answer) = answered.recv() => answer,
            _ = pings.tick() => {
                if last_received.elapsed() > TIMEOUT {
                    return;
                }
                Message::Ping(Vec::new().into())
            }
        };
        if !sent(&mut sink, message).await {
            return;
        }
    }
}

/// Starts a session with the studio, whose answers go to a channel. The threads of the session wait while it is full.
fn open(server: &Server, answers: Sender<Message>) -> Option<Box<dyn DesignSession>> {
    let opened = server.studio.open(Arc::new(move |answer| {
        // A browser that has gone needs no answer.
        let _ = answers.blocking_send(message(answer));
    }));
    opened.inspect_err(|error| log::error!("no session: {error}")).ok()
}

fn is_token(server: &Server, request: &str) -> bool {
    let given = serde_json::from_str::<TokenMessage>(request);
    given.is_ok_and(|given| server.token.as_ref().is_none_or(|token| token.is(&given.token)))
}

/// Returns an answer in its layout.
fn message(answer: Answer) -> Message {
    match answer {
        Answer::Json(json) => text(json),
        Answer::Stage(stage, name) => text(wire::stage(&stage, "design", Some(&name), None)),
        Answer::Frame(header, poses) => Message::Binary(wire::frame(&header, &poses).into()),
    }
}

fn refused(sentence: &str) -> Message {
    text(json!({"id": 0, "error": {"sentence": sentence, "line": null, "field": null}}).to_string())
}

fn text(json: String) -> Message {
    Message::Text(json.into())
}

async fn sent(sink: &mut SplitSink<WebSocket, Message>, message: Message) -> bool {
    matches!(timeout(TIMEOUT, sink.send(message)).await, Ok(Ok(())))
}
