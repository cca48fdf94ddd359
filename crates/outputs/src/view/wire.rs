//! The messages to a browser: frames as bytes, and JSON for rare changes.
//!
//! Everything is little-endian. A frame is a header of 72 bytes and 20 bytes for each handle, head first:
//!
//! | byte | type | what |
//! |---|---|---|
//! | 0 | u8 | version of this layout: 3 |
//! | 1 | u8 | state: its place in the list `states` of the message `stage`, from 0 |
//! | 2 | u8 | playback: 0 playing, 1 paused, 2 held, 3 ended |
//! | 3 | u8 | 0 |
//! | 4 | u32 | number of handles |
//! | 8 | f64 | simulated time, s |
//! | 16 | f64 | simulated seconds per second of wall time; 0 while paused or held |
//! | 24 | u64 | sequence: counts the frames published in this run; a browser skips some |
//! | 32 | u64 | run: new for every start of a publisher |
//! | 40 | u64 | CLOCK_MONOTONIC in ns when the publisher sent the frame |
//! | 48 | u64 | tick |
//! | 56 | f32 | least clearance, m; NaN if not computed |
//! | 60 | u32 | epoch: grows by one at every jump of simulated time |
//! | 64 | u32 | the latest cue passed, from 1; 0 before the first cue |
//! | 68 | u32 | 0 |
//! | 72 + 20 k | 5 x f32 | handle k: x, y (m), heading (rad), vx, vy (m per simulated second; NaN if not computed, 0 while the show stands still) |

use serde::Serialize;
use serde_json::{Value, json};

use bench_dragon_messages::json::{AlertObject, ChaseObject, CueObject, Exact, StageObject};
use bench_dragon_messages::sentence::{Figures, alert_sentence, chase_sentence, state_sentence};
use bench_dragon_messages::state::{FrameState, Level, Severity};
use bench_dragon_messages::{ChaseStatus, CollisionAlert, Cue, FrameHeader, HandlePose, Stage, StageMessage};
use bench_dragon_proof::ProvedEvent;

use super::SceneFacts;

const VERSION: u8 = 3;
const HEADER_BYTES: usize = 72;
const HANDLE_BYTES: usize = 20;

pub(crate) fn frame(header: &FrameHeader, handles: &[HandlePose]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER_BYTES + HANDLE_BYTES * handles.len());
    bytes.extend([VERSION, header.state as u8, header.playback as u8, 0]);
    bytes.extend((handles.len() as u32).to_le_bytes());
    bytes.extend(header.sim_time.to_le_bytes());
    bytes.extend(header.time_scale.to_le_bytes());
    for number in [header.sequence, header.run_id, header.sent_ns, header.tick] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend((header.min_clearance as f32).to_le_bytes());
    for number in [header.epoch, header.cue, 0] {
        bytes.extend(number.to_le_bytes());
    }
    for pose in handles {
        for number in [pose.x, pose.y, pose.heading, pose.vx, pose.vy] {
            bytes.extend((number as f32).to_le_bytes());
        }
    }
    bytes
}

/// Returns the stage, the name of its publisher and, when they are known, the scene's name and the proofs of its
/// events.
pub(crate) fn stage(
    stage: &StageMessage,
    publisher: &str,
    scene: Option<&str>,
    proved: Option<&[ProvedEvent]>,
) -> String {
    #[derive(Serialize)]
    struct StageMessage<'a> {
        r#type: &'static str,
        publisher: &'a str,
        scene: Option<&'a str>,
        #[serde(flatten)]
        stage: StageObject,
        proved: Option<&'a [ProvedEvent]>,
        states: [Value; FrameState::ALL.len()],
    }
    let states = FrameState::ALL.map(|of| state(of, &stage.stage));
    let stage = StageObject::from(stage);
    json!(StageMessage { r#type: "stage", publisher, scene, stage, proved, states }).to_string()
}

/// Returns the message about a cue that the show has reached.
pub(super) fn cue(cue: &Cue) -> String {
    json!(CueObject::from(cue)).to_string()
}

/// Returns the facts about the scene of a run that have been computed.
pub(super) fn facts(run_id: u64, facts: &SceneFacts) -> String {
    #[derive(Serialize)]
    struct FactsMessage<'a> {
        r#type: &'static str,
        run_id: Exact,
        #[serde(flatten)]
        facts: &'a SceneFacts,
    }
    json!(FactsMessage { r#type: "facts", run_id: Exact(run_id), facts }).to_string()
}

/// Returns the status of a chase, with its sentence.
pub(super) fn chase(status: &ChaseStatus) -> String {
    #[derive(Serialize)]
    struct ChaseMessage {
        #[serde(flatten)]
        status: ChaseObject,
        sentence: String,
    }
    json!(ChaseMessage { status: status.into(), sentence: chase_sentence(status) }).to_string()
}

/// The facts about a state, so that a page can show states that it does not know.
fn state(state: FrameState, stage: &Stage) -> Value {
    json!({"name": state.name(), "severity": state.severity().name(), "happened": state.event().is_some(),
        "sentence": state_sentence(state, stage)})
}

/// Returns an alert with its severity and its sentence, with the names of `stage`; the page shows the figures
/// beside it.
pub(super) fn alert(alert: &CollisionAlert, stage: &Stage) -> String {
    #[derive(Serialize)]
    struct AlertMessage {
        #[serde(flatten)]
        alert: AlertObject,
        severity: &'static str,
        happened: bool,
        sentence: String,
    }
    let level = alert.alert_level();
    let message = AlertMessage {
        alert: alert.into(),
        severity: level.map_or(Severity::Ok, Level::severity).name(),
        happened: level.is_some_and(Level::has_happened),
        sentence: alert_sentence(alert, stage, Figures::Omitted),
    };
    json!(message).to_string()
}

/// Returns the message that there is no publisher, or a publisher that cannot be used for this `reason`; with the names
/// of the shows that run here instead.
pub(super) fn waiting(reason: Option<&str>, running: &[String]) -> String {
    json!({"type": "waiting", "reason": reason, "running": running}).to_string()
}

/// Returns the response to `clock`: CLOCK_MONOTONIC, the clock of the frames' stamps; `None` if they have another
/// machine's clock, or if no frames come.
pub(super) fn clock(monotonic_ns: Option<u64>) -> String {
    json!({"type": "clock", "monotonic_ns": monotonic_ns.map(Exact)}).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_messages::{List, StageDragon};

    #[test]
    fn a_frame_has_the_documented_layout() {
        let header = FrameHeader {
            run_id: u64::MAX,
            sequence: 7,
            tick: 9,
            sent_ns: 1 << 60,
            sim_time: 405.5,
            time_scale: 2.0,
            min_clearance: 0.25,
            handles: 2,
            state: 2,
            playback: 3,
            cue: 5,
            epoch: 4,
            ..FrameHeader::default()
        };
        let pose = HandlePose { x: 8.75, y: -1.5, heading: 0.5, vx: 3.0, vy: -4.0 };
        let still = HandlePose { vx: f64::NAN, ..pose };
        let bytes = frame(&header, &[pose, still]);
        assert_eq!(bytes.len(), 112);
        assert_eq!(bytes[..8], [3, 2, 3, 0, 2, 0, 0, 0]);
        assert_eq!(bytes[8..16], 405.5_f64.to_le_bytes());
        assert_eq!(bytes[16..24], 2.0_f64.to_le_bytes());
        assert_eq!(bytes[24..32], 7_u64.to_le_bytes());
        assert_eq!(bytes[32..40], [0xff; 8]);
        assert_eq!(bytes[40..48], [0, 0, 0, 0, 0, 0, 0, 0x10]);
        assert_eq!(bytes[48..56], 9_u64.to_le_bytes());
        assert_eq!(bytes[56..72], [0, 0, 0x80, 0x3e, 4, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0]);
        let numbers: Vec<_> = bytes[72..].chunks(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect();
        assert_eq!(numbers[..8], [8.75, -1.5, 0.5, 3.0, -4.0, 8.75, -1.5, 0.5]);
        assert!(numbers[8].is_nan() && numbers[9] == -4.0);
    }

    #[test]
    fn a_clock_that_is_not_the_frames_own_is_null() {
        let known: Value = serde_json::from_str(&clock(Some(u64::MAX))).unwrap();
        let unknown: Value = serde_json::from_str(&clock(None)).unwrap();
        assert_eq!(known, json!({"type": "clock", "monotonic_ns": u64::MAX.to_string()}));
        assert_eq!(unknown, json!({"type": "clock", "monotonic_ns": null}));
    }

    #[test]
    fn the_states_stand_in_the_order_of_their_numbers() {
        let json: Value =
            serde_json::from_str(&stage(&StageMessage::default(), "dragon", Some("paper"), None)).unwrap();
        assert_eq!((&json["publisher"], &json["scene"]), (&"dragon".into(), &"paper".into()));
        assert!(json["scene_hash"].is_null() && json["proved"].is_null(), "{json}");
        let states = json["states"].as_array().unwrap();
        assert_eq!(states.len(), FrameState::ALL.len());
        for (state, number) in FrameState::ALL.into_iter().zip(0..) {
            assert_eq!((state as usize, &states[number]["name"]), (number, &state.name().into()));
        }
        let contact = json!({"name": "contact", "severity": "error", "happened": true, "sentence": null});
        assert_eq!(states[2], contact);
        assert_eq!(states[5]["sentence"], "the head has reached the end of the path");
    }

    #[test]
    fn an_alert_carries_the_sentence_of_its_numbers() {
        let alert_of = CollisionAlert {
            level: 1,
            event: 2,
            event_bench_a: 0,
            event_bench_b: 8,
            event_x: 1.0,
            event_y: 2.0,
            ..Default::default()
        };
        let dragons = List::of([StageDragon { benches: 9, ..StageDragon::default() }]);
        let nine = Stage { dragons, ..Stage::default() };
        let json: Value = serde_json::from_str(&alert(&alert_of, &nine)).unwrap();
        assert_eq!((&json["type"], &json["event"]), (&"alert".into(), &"contact".into()));
        assert_eq!((&json["severity"], &json["happened"]), (&"warning".into(), &false.into()));
        assert_eq!(
            json["sentence"],
            "contact: bench 1 (the head) and bench 9 (the tail) at (1.000, 2.000) m (counting from 1)"
        );
    }
}
