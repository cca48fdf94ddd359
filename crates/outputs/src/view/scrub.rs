//! Frames of a scene at times that a browser requests, for the second thumb of its time line. No command is sent, and
//! the stream of live frames continues beside it.
//!
//! In: the scenes that publishers play, and times, over the WebSocket `/scrub`. A request is JSON: `{"id": 7, "times":
//! [300, 290]}`, at most [`MOST_TIMES`] times.
//!
//! Out: the message `stage` once for each run, then a frame for each time in the layout of the stream. Its sequence is
//! the request's `id`, its tick the place in the request. Without a scene the answer is `{"type": "unknown", "id": 7}`.
//! One thread computes for all browsers, with a low priority, because publishers may run on this machine. The function
//! that opens a scene is a parameter, so that this crate needs no solver.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{Message, Utf8Bytes, WebSocket};
use serde::Deserialize;
use serde_json::json;
use tokio::sync::{oneshot, watch};
use tokio::time::timeout;

use super::{Picture, SceneHash, wire};
use bench_dragon_messages::{FrameHeader, HandlePose, StageMessage};

/// The most times of one request.
const MOST_TIMES: usize = 8;
/// The time without a request after which a browser is disconnected. A page connects again for its next request.
const IDLE: Duration = Duration::from_secs(60);
/// The time limit of one write.
const TIMEOUT: Duration = Duration::from_secs(30);
/// Scenes that are kept open: those requested last.
const KEPT: usize = 4;

/// The frames of a scene at any time.
pub trait SceneFrames {
    /// Returns the frame at a time, in seconds, at most the end of the motion; `None` without a solution. Of the header,
    /// the fields of the run are not set.
    fn frame(&mut self, time: f64) -> Option<(FrameHeader, Vec<HandlePose>)>;
}

/// Opens the scene with this text on the thread that then computes its frames; `None` for a text that is no scene.
pub type OpenScene = fn(&str) -> Option<Box<dyn SceneFrames>>;

/// The scene that a publisher plays.
#[derive(Debug, PartialEq)]
pub(super) struct SceneInPlay {
    pub(super) run_id: u64,
    hash: SceneHash,
    text: String,
    /// The times and the states of the show's events, in order.
    events: Vec<(f64, u32)>,
}

impl SceneInPlay {
    /// Joins the text of a scene and the stage of the same run.
    pub(super) fn new(hash: SceneHash, text: String, StageMessage { stage, .. }: &StageMessage) -> Self {
        let events = stage.events.iter().map(|event| (event.time, event.state)).collect();
        Self { run_id: stage.run_id, hash, text, events }
    }

    /// Returns the number of the state after the latest event at or before a time.
    fn state_at(&self, time: f64) -> u32 {
        self.events.iter().rev().find(|(event, _)| *event <= time).map_or(0, |(_, state)| *state)
    }
}

/// A request of a browser.
#[derive(Debug, Deserialize)]
struct Request {
    id: u64,
    times: Vec<f64>,
}

/// A request for the thread that computes, and the place for its frames.
struct Order {
    scene: Arc<SceneInPlay>,
    request: Request,
    frames: oneshot::Sender<Vec<Bytes>>,
}

/// The thread that computes, started by the first request.
pub(super) struct Scrubber {
    open: OpenScene,
    orders: OnceLock<Option<Sender<Order>>>,
}

impl Scrubber {
    pub(super) fn new(open: OpenScene) -> Self {
        Self { open, orders: OnceLock::new() }
    }

    /// Computes the frames of a request; `None` if no thread computes.
    async fn frames(&self, scene: Arc<SceneInPlay>, request: Request) -> Option<Vec<Bytes>> {
        let (frames, computed) = oneshot::channel();
        let orders = self.orders.get_or_init(|| started(self.open));
        orders.as_ref()?.send(Order { scene, request, frames }).ok()?;
        computed.await.ok()
    }
}

fn started(open: OpenScene) -> Option<Sender<Order>> {
    let (sender, orders) = channel();
    let thread = std::thread::Builder::new().name("scrub".to_owned()).spawn(move || compute(open, &orders));
    match thread {
        Ok(_) => Some(sender),
        Err(error) => {
            log::warn!("the page shows no other times: no thread can be started: {error}");
            None
        }
    }
}

/// A scene that was opened; `None` for a text that is no scene.
type Opened = Option<Box<dyn SceneFrames>>;

/// Computes frames until the server ends.
fn compute(open: OpenScene, orders: &Receiver<Order>) {
    let mut kept: VecDeque<(SceneHash, Opened)> = VecDeque::new();
    for Order { scene, request, frames } in orders {
        let known = kept.iter().position(|(hash, _)| *hash == scene.hash).and_then(|at| kept.remove(at));
        kept.push_front(known.unwrap_or_else(|| (scene.hash, open(&scene.text))));
        kept.truncate(KEPT);
        let computed = match &mut kept[0].1 {
            Some(of_scene) => answer(of_scene.as_mut(), &scene, &request),
            None => Vec::new(),
        };
        // The browser may have gone.
        let _ = frames.send(computed);
    }
}

/// Returns a frame for each time, or none if one of them has no solution.
fn answer(of_scene: &mut dyn SceneFrames, scene: &SceneInPlay, Request { id, times }: &Request) -> Vec<Bytes> {
    let frame = |(tick, time): (usize, &f64)| {
        let (header, handles) = of_scene.frame(*time)?;
        let state = scene.state_at(header.sim_time);
        let header = FrameHeader { run_id: scene.run_id, sequence: *id, tick: tick as u64, state, ..header };
        Some(wire::frame(&header, &handles).into())
    };
    times.iter().enumerate().map(frame).collect::<Option<_>>().unwrap_or_default()
}

/// Serves the frames of one publisher's scene to a browser until the browser goes.
pub(super) async fn serve(mut socket: WebSocket, pictures: watch::Receiver<Picture>, scrubber: Arc<Scrubber>) {
    let mut stage_sent = Utf8Bytes::default();
    while let Ok(Some(Ok(message))) = timeout(IDLE, socket.recv()).await {
        let Message::Text(text) = message else { continue };
        let Some(request) = request(&text) else { return };
        let (scene, stage) = {
            let picture = pictures.borrow();
            (picture.scene.clone(), picture.stage.clone())
        };
        let id = request.id;
        let frames = match scene {
            Some(scene) => scrubber.frames(scene, request).await.unwrap_or_default(),
            None => Vec::new(),
        };
        let mut messages = Vec::new();
        if frames.is_empty() {
            messages.push(Message::Text(json!({"type": "unknown", "id": id}).to_string().into()));
        } else if stage != stage_sent {
            messages.push(Message::Text(stage.clone()));
            stage_sent = stage;
        }
        messages.extend(frames.into_iter().map(Message::Binary));
        for message in messages {
            if !matches!(timeout(TIMEOUT, socket.send(message)).await, Ok(Ok(()))) {
                return;
            }
        }
    }
}

/// Returns a request; `None` for a text that is none.
fn request(text: &str) -> Option<Request> {
    let request: Request = serde_json::from_str(text).ok()?;
    let are_times = request.times.iter().all(|time| time.is_finite() && *time >= 0.0);
    (are_times && (1..=MOST_TIMES).contains(&request.times.len())).then_some(request)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_messages::{List, Stage, StageEvent};

    struct Times;

    impl SceneFrames for Times {
        fn frame(&mut self, time: f64) -> Option<(FrameHeader, Vec<HandlePose>)> {
            let header = FrameHeader { sim_time: time.min(40.0), ..FrameHeader::default() };
            (time != 13.0).then(|| (header, vec![HandlePose { x: time, ..HandlePose::default() }]))
        }
    }

    fn scene() -> SceneInPlay {
        let events = List::of([StageEvent { time: 20.0, state: 2, ..StageEvent::default() }]);
        let message = StageMessage { stage: Stage { run_id: 5, events, ..Stage::default() }, segments: Vec::new() };
        SceneInPlay::new(SceneHash::from([1; 32]), "scene".to_owned(), &message)
    }

    #[test]
    fn a_frame_has_its_request_its_place_and_the_state_of_the_show() {
        let request = request(r#"{"id": 7, "times": [19.5, 20, 99]}"#).unwrap();
        let frames = answer(&mut Times, &scene(), &request);
        let of = |frame: &Bytes| {
            let number = |at: usize| u64::from_le_bytes(frame[at..at + 8].try_into().unwrap());
            (frame[1], f64::from_bits(number(8)), number(24), number(32), number(48))
        };
        let expected = [(0, 19.5, 7, 5, 0), (2, 20.0, 7, 5, 1), (2, 40.0, 7, 5, 2)];
        assert_eq!(frames.iter().map(of).collect::<Vec<_>>(), expected);
        let unsolved = super::request(r#"{"id": 7, "times": [1, 13]}"#).unwrap();
        assert!(answer(&mut Times, &scene(), &unsolved).is_empty());
    }

    #[test]
    fn what_is_no_request_is_refused() {
        for text in [
            "",
            "7",
            "{\"id\": 7}",
            r#"{"id": 7, "times": []}"#,
            r#"{"id": -1, "times": [1]}"#,
            r#"{"id": 7, "times": [-1]}"#,
            r#"{"id": 7, "times": [1e999]}"#,
            r#"{"id": 7, "times": [1,2,3,4,5,6,7,8,9]}"#,
        ] {
            assert!(request(text).is_none(), "{text}");
        }
    }
}
