//! Messages as JSON: names in place of numbers, null for no value, and text for integers that a double cannot hold.
//!
//! In: a layout. Out: a value that serde writes.

use serde::Serialize;

use super::StageMessage;
use super::layouts::{
    ChaseStatus, CollisionAlert, Cue, NO_BENCH, Stage, StageCue, StageDragon, StageEvent, StageObstacle, StageSegment,
};
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
        let CollisionAlert {
            run_id,
            tick,
            stamp_ns,
            sim_time,
            event_time,
            time_to_event,
            clearance,
            x,
            y,
            event_x,
            event_y,
            level: _,
            bench_a,
            bench_b,
            event: _,
            event_bench_a,
            event_bench_b,
        } = *alert;
        let bench = |bench: u32| (bench != NO_BENCH).then_some(bench);
        Self {
            run_id: Exact(run_id),
            tick,
            stamp_ns: Exact(stamp_ns),
            sim_time,
            event_time,
            time_to_event,
            clearance,
            x,
            y,
            event_x,
            event_y,
            level: alert.alert_level().map_or("unknown", Level::name),
            bench_a: bench(bench_a),
            bench_b: bench(bench_b),
            event: alert.event_kind().map(EventKind::name),
            event_bench_a: bench(event_bench_a),
            event_bench_b: bench(event_bench_b),
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
        let ChaseStatus {
            run_id,
            stamp_ns,
            readings,
            ignored,
            jumps,
            error,
            rate,
            distance,
            source: _,
            state: _,
            hours: _,
            minutes: _,
            seconds: _,
            frames: _,
            frame_rate,
            tracker,
        } = *status;
        const RATES: [&str; 6] = ["24", "25", "29.97", "29.97df", "30", "23.976"];
        Self {
            run_id: Exact(run_id),
            stamp_ns: Exact(stamp_ns),
            source: status.chase_source().map_or("unknown", ChaseSource::name),
            state: status.chase_state().map_or("unknown", ChaseState::name),
            timecode: status.label(),
            frame_rate: RATES.get((frame_rate as usize).wrapping_sub(1)).copied(),
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

/// A [`StageMessage`]: each dragon with its path, each obstacle with its outline.
#[derive(Debug, Clone, Serialize)]
pub struct StageObject {
    run_id: Exact,
    dragons: Vec<DragonObject>,
    obstacles: Vec<ObstacleObject>,
    /// In hexadecimal digits.
    scene_hash: Option<String>,
    freeze_time: f64,
    events: Vec<EventObject>,
    cues: Vec<StageCueObject>,
}

/// A dragon.
#[derive(Debug, Clone, Serialize)]
struct DragonObject {
    name: String,
    first_handle: u32,
    benches: u32,
    pitch: f64,
    start_turn: f64,
    hole_inset: f64,
    head_length: f64,
    body_length: f64,
    tail_length: f64,
    head_width: f64,
    width: f64,
    tail_width: f64,
    path: Vec<SegmentObject>,
}

/// An obstacle, or the boundary.
#[derive(Debug, Clone, Serialize)]
struct ObstacleObject {
    name: String,
    kind: &'static str,
    keep_out: f64,
    outline: Vec<SegmentObject>,
}

/// A segment of a path or of an outline.
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
    pitch: f64,
}

/// An event of the show.
#[derive(Debug, Clone, Serialize)]
struct EventObject {
    event: &'static str,
    time: f64,
    bench_a: Option<u32>,
    bench_b: Option<u32>,
}

/// A cue of the show.
#[derive(Debug, Clone, Serialize)]
struct StageCueObject {
    number: u32,
    name: String,
    time: f64,
    pauses: bool,
}

impl From<&StageSegment> for SegmentObject {
    fn from(segment: &StageSegment) -> Self {
        let StageSegment { x, y, heading, length, curvature, theta_first, theta_last, pitch, kind: _, reserved: _ } =
            *segment;
        Self { kind: segment.kind_name(), x, y, heading, length, curvature, theta_first, theta_last, pitch }
    }
}

impl From<&StageEvent> for EventObject {
    fn from(event: &StageEvent) -> Self {
        let StageEvent { time, state: _, bench_a, bench_b, reserved: _ } = *event;
        let [bench_a, bench_b] = [bench_a, bench_b].map(|bench| (bench != NO_BENCH).then_some(bench));
        Self { event: event.kind().map_or("unknown", EventKind::name), time, bench_a, bench_b }
    }
}

impl From<&StageCue> for StageCueObject {
    fn from(cue: &StageCue) -> Self {
        let StageCue { time, number, pauses, ref name } = *cue;
        Self { number, name: name.as_str().to_owned(), time, pauses: pauses == 1 }
    }
}

impl From<&StageMessage> for StageObject {
    fn from(message: &StageMessage) -> Self {
        let Stage {
            run_id,
            stamp_ns: _,
            freeze_time,
            cues: _,
            reserved: _,
            scene_hash: _,
            ref dragons,
            ref obstacles,
            ref events,
            ref cue_list,
        } = message.stage;
        let dragon = |dragon: &StageDragon| {
            let StageDragon {
                head_length,
                body_length,
                tail_length,
                head_width,
                width,
                tail_width,
                hole_inset,
                pitch,
                start_turn,
                first_handle,
                benches,
                first_segment: _,
                segments: _,
                ref name,
            } = *dragon;
            let (name, path) = (name.as_str().to_owned(), message.path(dragon).iter().map(Into::into).collect());
            DragonObject {
                name,
                first_handle,
                benches,
                pitch,
                start_turn,
                hole_inset,
                head_length,
                body_length,
                tail_length,
                head_width,
                width,
                tail_width,
                path,
            }
        };
        let obstacle = |obstacle: &StageObstacle| {
            let StageObstacle { keep_out, kind: _, first_segment: _, segments: _, reserved: _, ref name } = *obstacle;
            let (name, outline) =
                (name.as_str().to_owned(), message.outline(obstacle).iter().map(Into::into).collect());
            ObstacleObject { name, kind: obstacle.kind_name(), keep_out, outline }
        };
        Self {
            run_id: Exact(run_id),
            dragons: dragons.iter().map(dragon).collect(),
            obstacles: obstacles.iter().map(obstacle).collect(),
            scene_hash: message.stage.scene_hash_digits(),
            freeze_time,
            events: events.iter().map(Into::into).collect(),
            cues: cue_list.iter().map(Into::into).collect(),
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
