//! The plans of a page: the least pitch, the least turn, the greatest speed, numbers that fit, the proof of the events,
//! and hand-outs.
//!
//! In: a scene with its text. Out: the answer of `plan --json` with a sentence, and the text with the planned number, or
//! a file.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::{Value, json};

use crate::edit;
use crate::hand_outs::{Form, HandOut, HandOutError, hand_outs};
use crate::request::Setting;
use crate::scene::DesignedScene;
use bench_dragon_certify::plan::{
    self, PitchLine, PlanError, Spaced, SpeedLine, Stage, TurnLine, greatest_speed, least_pitch, least_turn,
};
use bench_dragon_certify::{CertifiedEvent, CertifyError, MOST_STEPS, Status, certify};
use bench_dragon_fit::line::FitLine;
use bench_dragon_fit::search::{FitError, Vary, fit};
use bench_dragon_motion::Motion;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::model::curve::Curve;
use bench_dragon_motion::model::description::{PathDescription, RouteTurn};
use bench_dragon_motion::model::double_double::DoubleDouble;
use bench_dragon_motion::model::spiral::{Direction, Spiral};
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_sheets::Language;
use bench_dragon_show::results::figure;
use bench_dragon_show::scene::{ARC_RATIO, SceneText};

/// The speed that no handle may exceed in the plan of the greatest speed, in metres per second: a brisk walk.
const MOST_SPEED: f64 = 2.0;

/// The greatest number of fields that are fitted.
const MOST_VARIED: usize = 8;
/// The least time between two messages about the progress of a plan.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(100);

/// A plan that is found.
pub struct Planned {
    /// The answer.
    pub answer: Value,
    /// The text with the planned number; `None` where there is none.
    pub text: Option<String>,
    /// The file that was asked for.
    pub file: Option<HandOut>,
}

impl Planned {
    /// A plan that gives numbers to the text, if it has found some.
    fn numbers(answer: Value, text: Option<String>) -> Self {
        Self { answer, text, file: None }
    }
}

/// A plan that runs on a thread of its own until it is found, or until it is dropped.
pub struct RunningPlan(Arc<AtomicBool>);

impl Drop for RunningPlan {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl RunningPlan {
    /// Starts a plan of a kind for the request with the number `id`. It may vary the fields `vary`. `answers` receives
    /// its progress and its result.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(
        id: u64,
        kind: String,
        vary: Vec<String>,
        scene: Arc<DesignedScene>,
        answers: impl Fn(&Value) + Send + 'static,
    ) -> std::io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let of_thread = Arc::clone(&stop);
        std::thread::Builder::new().name("plan".to_owned()).spawn(move || {
            let (mut shown, mut due) = (0.0, Instant::now());
            let mut progress = |share: f64| {
                if of_thread.load(Ordering::Relaxed) {
                    return ControlFlow::Break(());
                }
                if share >= shown + 0.01 && Instant::now() >= due {
                    (shown, due) = (share, Instant::now() + PROGRESS_INTERVAL);
                    answers(&json!({"id": id, "progress": share}));
                }
                ControlFlow::Continue(())
            };
            let planned = plan(&kind, &vary, &scene, &mut progress);
            answers(&match planned {
                _ if of_thread.load(Ordering::Relaxed) => json!({"id": id, "cancelled": true}),
                Ok(Planned { answer, text, file }) => json!({"id": id, "plan": answer, "text": text, "file": file}),
                Err(error) => {
                    json!({"id": id, "error": {"sentence": error.to_string(), "line": null, "field": null}})
                }
            });
        })?;
        Ok(Self(stop))
    }
}

/// The reason for a missing plan.
#[derive(Debug, thiserror::Error)]
enum Unplanned {
    #[error("there is no plan {0:?}, expected pitch, turn, speed, fit, prove, sheets, sheets-zh or csv")]
    Unknown(String),
    #[error("the scene has several dragons, and this plan is for one in [team]")]
    SeveralDragons,
    #[error("a route has several numbers for its coil: the least pitch is for a spiral or a turnaround")]
    PitchOfRoute,
    #[error("the least turn is for a path of kind \"turnaround\", and for a route with one piece of kind \"turn\"")]
    NoTurn,
    #[error("{0} numbers are chosen to be fitted, expected 1 to {MOST_VARIED}")]
    Varied(usize),
    #[error("the scene names the solver \"paper\", whose head is too fast: only exact motion is proved")]
    NotExact,
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error(transparent)]
    Certify(#[from] CertifyError),
    #[error(transparent)]
    HandOut(#[from] HandOutError),
}

/// Makes a plan.
///
/// # Errors
/// The scene cannot have the plan.
fn plan(kind: &str, vary: &[String], scene: &DesignedScene, progress: Progress<'_>) -> Result<Planned, Unplanned> {
    match kind {
        "prove" => return prove(scene, progress),
        "fit" => return fitted(vary, scene, progress),
        "sheets" => return handed_out(scene, Form::Pages(Language::English), progress),
        "sheets-zh" => return handed_out(scene, Form::Pages(Language::Chinese), progress),
        "csv" => return handed_out(scene, Form::Csv, progress),
        _ => {}
    }
    let motion = scene.scene.ensemble.only();
    let motion = motion.ok_or(Unplanned::SeveralDragons)?;
    match kind {
        "pitch" => pitch(scene, motion, progress),
        "turn" => turn(scene, motion, progress),
        "speed" => speed(scene, progress),
        _ => Err(Unplanned::Unknown(kind.to_owned())),
    }
}

fn with(scene: &DesignedScene, field: &str, value: Option<f64>) -> Option<String> {
    let values = BTreeMap::from([(field.to_owned(), Setting::Number(value?))]);
    edit::set(scene, &values).ok()
}

/// The answer of `plan --json` with the sentence that the page shows.
#[derive(Serialize)]
struct Told<L> {
    #[serde(flatten)]
    line: L,
    sentence: String,
}

/// Returns a sentence about the stage. `value` is the answer for the boards alone.
fn of_stage(stage: &Stage, value: Option<f64>) -> String {
    match stage {
        Stage::Empty => String::new(),
        Stage::OtherPath => " Obstacles are left out: the plan is about boards alone.".to_owned(),
        Stage::Outside(outside) if Some(outside.value) == value => " They stay outside the keep-outs, too.".to_owned(),
        Stage::Outside(outside) => {
            let value = figure(outside.value);
            format!(" {value} m is the least found with which they stay outside the keep-outs.")
        }
        Stage::NotFound => " No number was found with which they are proved to stay outside the keep-outs.".to_owned(),
    }
}

/// Returns the clearance that the scene requires of boards, in metres.
fn required(scene: &DesignedScene) -> f64 {
    scene.scene.require.and_then(|require| require.clearance).unwrap_or(0.0)
}

/// Returns the words for boards that keep a clearance.
fn apart(clearance: f64) -> String {
    if clearance > 0.0 { format!("all boards keep more than {clearance} m") } else { "no two boards touch".to_owned() }
}

/// Plans the pitch with which the head comes as near to the centre as it does now.
fn pitch(scene: &DesignedScene, motion: &Motion, progress: Progress<'_>) -> Result<Planned, Unplanned> {
    let radius = match motion.description() {
        PathDescription::Turnaround { turn_radius, .. } => *turn_radius,
        PathDescription::Spiral { .. } => {
            let timeline = scene.scene.ensemble.timeline(&mut |_| progress(0.0));
            let end = timeline.show_end(scene.scene.stops_at_contact());
            motion.path().point(motion.path().param_at(end.event.travelled)).coords.norm()
        }
        PathDescription::Route { .. } => return Err(Unplanned::PitchOfRoute),
    };
    let clearance = required(scene);
    let asked = Spaced { team: motion.team(), clearance };
    let found = least_pitch(asked, radius, progress)?;
    let stage = Stage::search(motion, asked, plan::Planned::Pitch { radius }, found.value_hi, progress);
    let sentence = match found.value_hi {
        Some(pitch) => format!(
            "With a pitch of {} m the head comes to {} m from the centre, and {} before.{}",
            figure(pitch),
            figure(radius),
            apart(clearance),
            of_stage(&stage, found.value_hi)
        ),
        None => "No pitch was found.".to_owned(),
    };
    let value = stage.value(found.value_hi);
    let line = PitchLine::new(&found, clearance, &stage, motion, false);
    Ok(Planned::numbers(json!(Told { line, sentence }), with(scene, "path.pitch", value)))
}

/// The turn of a scene: its pitch, its ratio of arcs, and the number of the text that a radius of the turn gives to a
/// field.
struct TurnInText {
    pitch: f64,
    arc_ratio: f64,
    number: Box<dyn Fn(f64) -> (String, f64)>,
}

impl TurnInText {
    /// Returns the turn of a turnaround, or the only turn of a route.
    fn of(scene: &DesignedScene, description: &PathDescription) -> Option<Self> {
        if let PathDescription::Turnaround { pitch, arc_ratio, .. } = *description {
            let number = Box::new(|radius: f64| ("path.turn_radius".to_owned(), radius));
            return Some(Self { pitch, arc_ratio, number });
        }
        let RouteTurn { spiral, pitch, radius: beginning } = description.turn()?;
        let [spiral, turn] = [spiral, spiral + 1].map(|number| format!("path.pieces[{number}]"));
        // Two arcs of the text that happen to be a turn are not one any longer behind another spiral.
        if scene.values.words(&format!("{turn}.kind")) != Some("turn") {
            return None;
        }
        let arc_ratio = scene.values.number(&format!("{turn}.arc_ratio")).unwrap_or(ARC_RATIO);
        let has = |field: &&str| scene.values.number(&format!("{spiral}.{field}")).is_some();
        let extent = ["to_radius", "turns", "length"].into_iter().find(has)?;
        let at = move |radius: f64| DoubleDouble::from_turns(radius / pitch);
        let number = Box::new(move |radius: f64| {
            let value = match extent {
                "turns" => ((beginning - radius) / pitch).next_down(),
                "length" => Spiral::new(pitch, Direction::Inward).arc_length(at(beginning), at(radius)).next_down(),
                _ => radius,
            };
            (format!("{spiral}.{extent}"), value)
        });
        Some(Self { pitch, arc_ratio, number })
    }
}

/// Plans the turn with its ratio of arcs.
fn turn(scene: &DesignedScene, motion: &Motion, progress: Progress<'_>) -> Result<Planned, Unplanned> {
    let Some(TurnInText { pitch, arc_ratio, number }) = TurnInText::of(scene, motion.description()) else {
        return Err(Unplanned::NoTurn);
    };
    let clearance = required(scene);
    let asked = Spaced { team: motion.team(), clearance };
    let found = least_turn(asked, pitch, Some(arc_ratio), progress)?;
    let stage = Stage::search(motion, asked, plan::Planned::Turn { arc_ratio }, found.value_hi, progress);
    let sentence = match (found.value, found.length) {
        (Some(radius), Some(length)) => format!(
            "With a turn radius of {} m the team turns round on this pitch, and {}: the S is {} m long.{}",
            figure(radius),
            apart(clearance),
            figure(length),
            of_stage(&stage, found.value_hi)
        ),
        _ => "No radius was found.".to_owned(),
    };
    let line = TurnLine::new(&found, pitch, clearance, &stage, motion, false);
    let planned = line.value.map(number);
    let text = planned.and_then(|(field, value)| with(scene, &field, Some(value)));
    Ok(Planned::numbers(json!(Told { line, sentence }), text))
}

fn speed(scene: &DesignedScene, progress: Progress<'_>) -> Result<Planned, Unplanned> {
    let timeline = scene.scene.ensemble.timeline(&mut |_| progress(0.0));
    let found = greatest_speed(&scene.scene, &timeline, MOST_SPEED, progress)?;
    let sentence = format!(
        "No handle is faster than {MOST_SPEED} m/s while the head moves at {} m/s. The fastest is handle {} (counting \
         from 1), at t = {} s.",
        figure(found.value_lo),
        found.handle + 1,
        figure(found.time)
    );
    let line = SpeedLine::new(&found, false);
    let text = with(scene, "motion.head_speed", Some(found.value_lo));
    Ok(Planned::numbers(json!(Told { line, sentence }), text))
}

/// Fits numbers of the scene, as `plan fit` does, so that the show keeps what is required.
fn fitted(vary: &[String], scene: &DesignedScene, progress: Progress<'_>) -> Result<Planned, Unplanned> {
    if vary.is_empty() || vary.len() > MOST_VARIED {
        return Err(Unplanned::Varied(vary.len()));
    }
    let text = SceneText { text: scene.text.clone(), file: "scene".to_owned(), stem: "scene".to_owned() };
    let vary: Vec<Vary> = vary.iter().map(|field| Vary { field: field.clone(), range: None }).collect();
    let clearance = required(scene);
    let found = fit(&text, &vary, clearance, 1, &mut |share, _| progress(share))?;
    let margin = found.judgement.margin();
    let sentence = match found.is_found() {
        true => format!(
            "The show keeps {clearance} m between boards, and every keep-out, with {} m to spare: found, not proved to \
             be the greatest.",
            figure(margin)
        ),
        false => {
            format!("No numbers were found that keep what is required: at best {} m are missing.", figure(-margin))
        }
    };
    let of_rest = found.without_boundary.map(|rest| {
        let spare = if rest >= 0.0 { "to spare" } else { "too little" };
        format!(
            " The team stands outside the boundary at the start; all else has {} m {spare} with these numbers. Draw the \
             boundary round the street in which the team waits.",
            figure(rest.abs())
        )
    });
    let sentence = sentence + of_rest.as_deref().unwrap_or_default();
    let answer = json!(Told { line: FitLine::new(&found, clearance), sentence });
    let has_text = found.is_found() || found.without_boundary.is_some_and(|rest| rest >= 0.0);
    Ok(Planned::numbers(answer, has_text.then_some(found.text)))
}

/// Proves the events, as `events --certify` does, without a certificate.
fn prove(scene: &DesignedScene, progress: Progress<'_>) -> Result<Planned, Unplanned> {
    let ensemble = &scene.scene.ensemble;
    if !ensemble.is_exact() {
        return Err(Unplanned::NotExact);
    }
    let timeline: Timeline = ensemble.timeline(&mut |_| progress(0.0));
    let mut write = |_: &bench_dragon_certify::CertificateLine| Ok(());
    let found = certify(ensemble, &timeline, &scene.text, MOST_STEPS, &mut write, progress);
    let found = found?;
    let undecided = found.iter().filter(|event| matches!(event.status, Status::Undecided { .. })).count();
    let sentence = match undecided {
        0 => "Every event is proved, and that there is no earlier one.".to_owned(),
        _ => format!("{undecided} of {} statements could not be decided.", found.len()),
    };
    let list: Vec<Value> = found.iter().map(proved_line).collect();
    let status = if undecided == 0 { "proved" } else { "given_up" };
    let answer = json!({"plan": "prove", "status": status, "list": list, "sentence": sentence});
    Ok(Planned::numbers(answer, None))
}

/// Makes the hand-outs.
fn handed_out(scene: &DesignedScene, form: Form, progress: Progress<'_>) -> Result<Planned, Unplanned> {
    let file = hand_outs(scene, form, progress)?;
    let sentence = format!("{} is for {} benches.", file.name, scene.scene.ensemble.benches());
    Ok(Planned { answer: json!({"plan": "sheets", "sentence": sentence}), text: None, file: Some(file) })
}

fn proved_line(event: &CertifiedEvent) -> Value {
    let name = event.event.name();
    let (lo, hi, sentence) = match &event.status {
        Status::Proved { time_lo, time_hi, .. } => {
            (Some(*time_lo), Some(*time_hi), format!("The first {name} is between t = {time_lo} s and {time_hi} s."))
        }
        Status::None { time_lo: None } => (None, None, format!("There is no {name}.")),
        Status::None { time_lo: Some(until) } => {
            (Some(*until), None, format!("There is no {name} before t = {until} s."))
        }
        Status::Undecided { time_lo, because } => {
            (Some(*time_lo), None, format!("There is no {name} before t = {time_lo} s; then not decided: {because}."))
        }
    };
    json!({"event": name, "time_lo": lo, "time_hi": hi, "sentence": sentence.replace('_', " ")})
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_motion::event::unreported;
    use bench_dragon_motion::model::description::RouteStep;

    #[test]
    fn the_least_turn_of_a_route_is_a_number_of_its_spiral() {
        for extent in ["to_radius = 5.0", "turns = 3", "length = 120.0"] {
            let way = "direction = \"in\", side = \"left\", pitch = 1.7, radius = 12.0";
            let spiral = format!("{{ kind = \"spiral\", {way}, {extent} }}");
            let back = "{ kind = \"spiral\", to_radius = 12.0 }";
            let text = format!(
                "[team]\nbenches = 10\n[path]\nkind = \"pieces\"\nstart = [0, 0]\n\
                 pieces = [{spiral}, {{ kind = \"turn\" }}, {back}]\n[motion]\nhead_speed = 1.0\n"
            );
            let scene = DesignedScene::read(&text, "scene").unwrap();
            let planned = plan("turn", &[], &scene, &mut unreported).unwrap();
            let radius = planned.answer["value"].as_f64().unwrap();
            let text = planned.text.unwrap();
            let field = extent.split(' ').next().unwrap();
            assert!(text.contains(field), "{text}");
            let scene = DesignedScene::read(&text, "scene").unwrap();
            let PathDescription::Route { steps, .. } = scene.scene.ensemble.only().unwrap().description() else {
                panic!("{text}")
            };
            let Some(RouteStep::Spiral { pitch, radius: begin, turns, .. }) = steps.first() else { panic!("{text}") };
            let end = begin.high - pitch * turns.high;
            assert!((end - radius).abs() < 1e-9, "{extent}: {end} {radius}");
        }
    }

    #[test]
    fn the_least_pitch_keeps_the_clearance_that_is_required() {
        let planned = |rest: &str| {
            let path = "[path]\nkind = \"turnaround\"\npitch = 1.7\nturn_radius = 4.5\narc_ratio = 2.0";
            let text = format!("[team]\nbenches = 40\n{path}\nlead_in = 40\n[motion]\nhead_speed = 1.0\n{rest}");
            let scene = DesignedScene::read(&text, "scene").unwrap();
            plan("pitch", &[], &scene, &mut unreported).unwrap().answer
        };
        // The pitches are those of `tests/commands/margin.rs`.
        for (rest, pitch) in [("", 0.450_337_393), ("[require]\nclearance = 0.2\n", 0.650_013_396_5)] {
            let value = planned(rest)["value"].as_f64().unwrap();
            assert!((value - pitch).abs() < 2e-9, "{value}");
        }
        let sentence = planned("[require]\nclearance = 0.2\n")["sentence"].to_string();
        assert!(sentence.contains("all boards keep more than 0.2 m before"), "{sentence}");
    }
}
