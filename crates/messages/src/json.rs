//! Messages as JSON: names in place of numbers, null for no value, and text for integers that a double cannot hold.
//!
//! In: a layout. Out: a value that serde writes. Called by `watch --json`, the stage picture's server and the
//! recorder.

use serde::Serialize;

use super::layouts::{ChaseStatus, CollisionAlert, Cue, NO_BENCH, Stage, StageCue, StageEvent, StageSegment};
use crate::chase::{ChaseSource, ChaseState};
use crate::state::EventKind;
use crate::state::Level;

/// A whole number that JavaScript would round, as text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exact(pub u64);

impl Serialize for Exact {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&self.0)
    }
}

/// A [`CollisionAlert`] with the fields of the layout in their order. NaN becomes null.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "type", rename = "alert")]
pub struct AlertObject {
    run_id: Exact,
    tick: u64,
    stamp_ns: Exact,
    sim_time: f64,
    event_time: f64,
    time_to_event: f64,
    clearance: f64,
    x: f64,
    y: f64,
    event_x: f64,
    event_y: f64,
    level: &'static str,
    bench_a: Option<u32>,
    bench_b: Option<u32>,
    event: Option<&'static str>,
    event_bench_a: Option<u32>,
    event_bench_b: Option<u32>,
}

impl From<&CollisionAlert> for AlertObject {
    fn from(alert: &CollisionAlert) -> Self {
        let bench = |bench: u32| (bench != NO_BENCH).then_some(bench);
        Self {
            run_id: Exact(alert.run_id),
            tick: alert.tick,
            stamp_ns: Exact(alert.stamp_ns),
            sim_time: alert.sim_time,
            event_time: alert.event_time,
            time_to_event: alert.time_to_event,
            clearance: alert.clearance,
            x: alert.x,
            y: alert.y,
            event_x: alert.event_x,
            event_y: alert.event_y,
            level: alert.alert_level().map_or("unknown", Level::name),
            bench_a: bench(alert.bench_a),
            bench_b: bench(alert.bench_b),
            event: alert.event_kind().map(EventKind::name),
            event_bench_a: bench(alert.event_bench_a),
            event_bench_b: bench(alert.event_bench_b),
        }
    }
}

/// A [`Cue`] with the fields of the layout in their order.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "type", rename = "cue")]
pub struct CueObject {
    run_id: Exact,
    tick: u64,
    stamp_ns: Exact,
    sim_time: f64,
    cue_time: f64,
    number: u32,
    pauses: bool,
    name: String,
}

impl From<&Cue> for CueObject {
    fn from(cue: &Cue) -> Self {
        let Cue { run_id, tick, stamp_ns, sim_time, cue_time, number, pauses, ref name } = *cue;
        let (run_id, stamp_ns, pauses, name) = (Exact(run_id), Exact(stamp_ns), pauses == 1, name.as_str().to_owned());
        Self { run_id, tick, stamp_ns, sim_time, cue_time, number, pauses, name }
    }
}

/// A [`ChaseStatus`] with names. NaN becomes null.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "type", rename = "chase")]
pub struct ChaseObject {
    run_id: Exact,
    stamp_ns: Exact,
    source: &'static str,
    state: &'static str,
    timecode: Option<String>,
    frame_rate: Option<&'static str>,
    tracker: Option<u32>,
    error: f64,
    rate: f64,
    distance: f64,
    readings: u64,
    ignored: u64,
    jumps: u64,
}

impl From<&ChaseStatus> for ChaseObject {
    fn from(status: &ChaseStatus) -> Self {
        let ChaseStatus { run_id, stamp_ns, readings, ignored, jumps, error, rate, distance, tracker, .. } = *status;
        const RATES: [&str; 5] = ["24", "25", "29.97", "29.97df", "30"];
        Self {
            run_id: Exact(run_id),
            stamp_ns: Exact(stamp_ns),
            source: status.chase_source().map_or("unknown", ChaseSource::name),
            state: status.chase_state().map_or("unknown", ChaseState::name),
            timecode: status.label(),
            frame_rate: RATES.get((status.frame_rate as usize).wrapping_sub(1)).copied(),
            tracker: (tracker > 0).then_some(tracker),
            error,
            rate,
            distance,
            readings,
            ignored,
            jumps,
        }
    }
}

/// A [`Stage`] with the entries that are in use.
#[derive(Debug, Clone, Serialize)]
pub struct StageObject {
    run_id: Exact,
    pitch: f64,
    start_turn: f64,
    hole_inset: f64,
    head_length: f64,
    body_length: f64,
    width: f64,
    benches: u32,
    /// In hexadecimal digits.
    scene_hash: Option<String>,
    path: Vec<SegmentObject>,
    freeze_time: f64,
    events: Vec<EventObject>,
    cues: Vec<StageCueObject>,
}

/// A segment of the path.
#[derive(Debug, Clone, Serialize)]
struct SegmentObject {
    kind: &'static str,
    x: f64,
    y: f64,
    heading: f64,
    length: f64,
    curvature: f64,
    theta_first: f64,
    theta_last: f64,
}

/// An event of the show.
#[derive(Debug, Clone, Serialize)]
struct EventObject {
    event: &'static str,
    time: f64,
}

/// A cue of the show.
#[derive(Debug, Clone, Serialize)]
struct StageCueObject {
    number: u32,
    name: String,
    time: f64,
    pauses: bool,
}

impl From<&Stage> for StageObject {
    fn from(stage: &Stage) -> Self {
        let Stage { run_id, pitch, start_turn, hole_inset, head_length, body_length, width, .. } = *stage;
        let Stage { freeze_time, benches, .. } = *stage;
        let segment = |segment: &StageSegment| {
            let StageSegment { x, y, heading, length, curvature, theta_first, theta_last, .. } = *segment;
            let kind = segment.kind_name();
            SegmentObject { kind, x, y, heading, length, curvature, theta_first, theta_last }
        };
        let event = |event: &StageEvent| EventObject {
            event: event.kind().map_or("unknown", EventKind::name),
            time: event.time,
        };
        let cue = |cue: &StageCue| {
            let StageCue { time, number, pauses, ref name } = *cue;
            StageCueObject { number, name: name.as_str().to_owned(), time, pauses: pauses == 1 }
        };
        Self {
            run_id: Exact(run_id),
            pitch,
            start_turn,
            hole_inset,
            head_length,
            body_length,
            width,
            benches,
            scene_hash: stage.scene_hash_digits(),
            path: stage.path_in_use().iter().map(segment).collect(),
            freeze_time,
            events: stage.events_in_use().iter().map(event).collect(),
            cues: stage.cues_in_use().iter().map(cue).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_alert_about_nothing_has_nulls() {
        let json = serde_json::to_value(AlertObject::from(&CollisionAlert::default())).unwrap();
        assert_eq!((json["type"].as_str(), json["level"].as_str()), (Some("alert"), Some("clear")));
        let nulls = json.as_object().unwrap().iter().filter(|(_, value)| value.is_null()).count();
        // event_time, time_to_event, clearance, two places, two pairs of benches, and the event.
        assert_eq!(nulls, 12, "{json}");
    }

    #[test]
    fn numbers_beyond_a_double_are_text() {
        let alert =
            CollisionAlert { run_id: u64::MAX, stamp_ns: (1 << 60) + 1, level: 2, event: 4, ..Default::default() };
        let json = serde_json::to_value(AlertObject::from(&alert)).unwrap();
        assert_eq!(json["run_id"], "18446744073709551615");
        assert_eq!(json["stamp_ns"], "1152921504606846977");
        assert_eq!((json["level"].as_str(), json["event"].as_str()), (Some("contact"), Some("lock")));
    }
}
