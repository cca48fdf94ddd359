//! The JSON lines of plans: what `plan --json` prints, and what the page of `design` receives beside a sentence.

use serde::Serialize;

use super::{GreatestSpeed, LeastPitch, LeastTurn, Stage};
use bench_dragon_motion::Motion;

/// The line of the least pitch. Lengths are in metres, benches count from 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PitchLine {
    plan: &'static str,
    status: &'static str,
    value: Option<f64>,
    /// The least pitch examined.
    from: f64,
    value_lo: Option<f64>,
    value_hi: Option<f64>,
    bench_a: Option<u32>,
    bench_b: Option<u32>,
    head_radius: Option<f64>,
    #[serde(flatten)]
    conditions: Conditions,
}

impl PitchLine {
    /// Returns the line of an answer for boards that keep a clearance, in metres, and of the answer on a motion's
    /// stage. `is_stopped` is true if a signal or the user has ended the search.
    pub fn new(found: &LeastPitch, clearance: f64, stage: &Stage, motion: &Motion, is_stopped: bool) -> Self {
        let value = stage.value(found.value_hi);
        Self {
            plan: "pitch",
            status: status(found.proved && value == found.value_hi, is_stopped),
            value,
            from: found.from,
            value_lo: (found.intervals > 0).then_some(found.value_lo),
            value_hi: value.or(found.value_hi),
            bench_a: found.overlap.map(|overlap| overlap.bench_a),
            bench_b: found.overlap.map(|overlap| overlap.bench_b),
            head_radius: found.overlap.map(|overlap| overlap.head_radius),
            conditions: Conditions::new(clearance, stage, motion),
        }
    }
}

/// The line of the least turn. Lengths are in metres, benches count from 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TurnLine {
    plan: &'static str,
    status: &'static str,
    /// The radius of the turn on the scene's stage.
    pub value: Option<f64>,
    value_lo: Option<f64>,
    value_hi: Option<f64>,
    /// The length of the S.
    length: Option<f64>,
    arc_ratio: f64,
    limit: Option<&'static str>,
    bench_a: Option<u32>,
    bench_b: Option<u32>,
    #[serde(flatten)]
    conditions: Conditions,
}

impl TurnLine {
    /// Returns the line of an answer on a pitch, for boards that keep a clearance, both in metres, and of the answer on
    /// a motion's stage. `is_stopped` is true if a signal or the user has ended the search.
    pub fn new(
        found: &LeastTurn,
        pitch: f64,
        clearance: f64,
        stage: &Stage,
        motion: &Motion,
        is_stopped: bool,
    ) -> Self {
        let value = stage.value(found.value_hi);
        let found = if value == found.value_hi { *found } else { found.with_radius(value, pitch) };
        Self {
            plan: "turn",
            status: status(found.proved, is_stopped),
            value: found.value,
            value_lo: (found.intervals > 0).then_some(found.value_lo),
            value_hi: found.value_hi,
            length: found.length,
            arc_ratio: found.arc_ratio,
            limit: found.limit.map(|limit| limit.kind.name()),
            bench_a: found.limit.map(|limit| limit.bench_a),
            bench_b: found.limit.and_then(|limit| limit.bench_b),
            conditions: Conditions::new(clearance, stage, motion),
        }
    }
}

/// The line of the greatest speed. Speeds are in metres per second, the time in simulated seconds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpeedLine {
    plan: &'static str,
    status: &'static str,
    value: f64,
    value_lo: f64,
    value_hi: f64,
    time: f64,
    /// Counted from 0.
    handle: u32,
    ratio: f64,
}

impl SpeedLine {
    /// Returns the line of an answer. `is_stopped` is true if a signal or the user has ended the search.
    pub fn new(found: &GreatestSpeed, is_stopped: bool) -> Self {
        let GreatestSpeed { value_lo, value_hi, time, handle, ratio, proved, .. } = *found;
        let status = status(proved, is_stopped);
        Self { plan: "speed", status, value: value_lo, value_lo, value_hi, time, handle, ratio }
    }
}

/// The conditions that boards of a plan keep, beside the question.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Conditions {
    /// The required clearance, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    clearance: Option<f64>,
    /// The obstacle of the stage that decides, if one does.
    #[serde(skip_serializing_if = "Option::is_none")]
    obstacle: Option<String>,
}

impl Conditions {
    fn new(clearance: f64, stage: &Stage, motion: &Motion) -> Self {
        let obstacle = stage.obstacle(motion).map(str::to_owned);
        Self { clearance: Some(clearance).filter(|clearance| *clearance > 0.0), obstacle }
    }
}

fn status(proved: bool, is_stopped: bool) -> &'static str {
    match (proved, is_stopped) {
        (true, _) => "proved",
        (false, true) => "stopped",
        (false, false) => "given_up",
    }
}
