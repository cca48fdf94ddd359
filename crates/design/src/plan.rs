//! The plans of a page: the least pitch, the least turn, the greatest speed, numbers that fit, and the proof of the
//! events.
//!
//! In: a scene with its text. Out: the answer of `plan --json` with a sentence, and the text with the planned number.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::edit;
use crate::request::Setting;
use crate::scene::DesignedScene;
use bench_dragon_certify::plan::{greatest_speed, least_pitch, least_turn};
use bench_dragon_certify::{CertifiedEvent, MOST_STEPS, Status, certify};
use bench_dragon_fit::search::{Vary, fit};
use bench_dragon_motion::Motion;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_show::results::figure;
use bench_dragon_show::scene::SceneText;

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
}

/// A plan that runs on a thread of its own until it is found, or until it is dropped.
pub struct RunningPlan(Arc<AtomicBool>);

impl Drop for RunningPlan {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl RunningPlan {
    /// Starts a plan of a kind for the request of a number. `answers` receives its progress and its result.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(
        (id, kind, vary): (u64, String, Vec<String>),
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
            let planned = plan((&kind, &vary), &scene, &mut progress);
            answers(&match planned {
                _ if of_thread.load(Ordering::Relaxed) => json!({"id": id, "cancelled": true}),
                Ok(Planned { answer, text }) => json!({"id": id, "plan": answer, "text": text}),
                Err(sentence) => json!({"id": id, "error": {"sentence": sentence, "line": null, "field": null}}),
            });
        })?;
        Ok(Self(stop))
    }
}

/// Makes a plan.
///
/// # Errors
/// One sentence for a plan that the scene cannot have.
fn plan((kind, vary): (&str, &[String]), scene: &DesignedScene, progress: Progress<'_>) -> Result<Planned, String> {
    match kind {
        "prove" => return prove(scene, progress),
        "fit" => return fitted(vary, scene, progress),
        _ => {}
    }
    let motion = scene.scene.ensemble.only();
    let motion = motion.ok_or("the scene has several dragons, and this plan is for one in [team]")?;
    match kind {
        "pitch" => pitch(scene, motion, progress),
        "turn" => turn(scene, motion, progress),
        "speed" => speed(scene, progress),
        _ => Err(format!("there is no plan {kind:?}, expected pitch, turn, speed, fit or prove")),
    }
}

fn with(scene: &DesignedScene, field: &str, value: Option<f64>) -> Option<String> {
    let values = BTreeMap::from([(field.to_owned(), Setting::Number(value?))]);
    edit::set(scene, &values).ok()
}

/// Returns a note that obstacles are not part of a plan.
fn without_obstacles(scene: &DesignedScene) -> &'static str {
    let is_empty = scene.scene.ensemble.ground().is_empty();
    if is_empty { "" } else { " Obstacles are left out: the plan is about boards alone." }
}

/// Plans the pitch with which the head comes as near to the centre as it does now.
fn pitch(scene: &DesignedScene, motion: &Motion, progress: Progress<'_>) -> Result<Planned, String> {
    let radius = match motion.description() {
        PathDescription::Turnaround { turn_radius, .. } => *turn_radius,
        PathDescription::Spiral { .. } => {
            let timeline = scene.scene.ensemble.timeline(&mut |_| progress(0.0));
            let end = timeline.show_end(scene.scene.stops_at_contact());
            motion.path().point(motion.path().param_at(end.event.travelled)).coords.norm()
        }
        PathDescription::Route { .. } => {
            return Err(
                "a route has several numbers for its coil: the least pitch is for a spiral or a turnaround".to_owned()
            );
        }
    };
    let found = least_pitch(motion.team(), radius, progress).map_err(|error| error.to_string())?;
    let sentence = match found.value_hi {
        Some(pitch) => format!(
            "With a pitch of {} m the head comes to {} m from the centre, and no two boards touch before.{}",
            figure(pitch),
            figure(radius),
            without_obstacles(scene)
        ),
        None => "No pitch was found.".to_owned(),
    };
    let answer = json!({
        "plan": "pitch",
        "status": status(found.proved),
        "value": found.value_hi,
        "from": found.from,
        "value_lo": (found.intervals > 0).then_some(found.value_lo),
        "value_hi": found.value_hi,
        "bench_a": found.overlap.map(|overlap| overlap.bench_a),
        "bench_b": found.overlap.map(|overlap| overlap.bench_b),
        "head_radius": found.overlap.map(|overlap| overlap.head_radius),
        "sentence": sentence,
    });
    Ok(Planned { answer, text: with(scene, "path.pitch", found.value_hi) })
}

/// Plans the turn of a turnaround with its ratio of arcs.
fn turn(scene: &DesignedScene, motion: &Motion, progress: Progress<'_>) -> Result<Planned, String> {
    let PathDescription::Turnaround { pitch, arc_ratio, .. } = *motion.description() else {
        return Err("the least turn is for a path of kind \"turnaround\"".to_owned());
    };
    let found = least_turn(motion.team(), pitch, Some(arc_ratio), progress).map_err(|error| error.to_string())?;
    let sentence = match (found.value, found.length) {
        (Some(radius), Some(length)) => format!(
            "With a turn radius of {} m the team turns round on this pitch: the S is {} m long.{}",
            figure(radius),
            figure(length),
            without_obstacles(scene)
        ),
        _ => "No radius was found.".to_owned(),
    };
    let answer = json!({
        "plan": "turn",
        "status": status(found.proved),
        "value": found.value,
        "value_lo": (found.intervals > 0).then_some(found.value_lo),
        "value_hi": found.value_hi,
        "length": found.length,
        "arc_ratio": found.arc_ratio,
        "limit": found.limit.map(|limit| limit.kind.name()),
        "bench_a": found.limit.map(|limit| limit.bench_a),
        "bench_b": found.limit.and_then(|limit| limit.bench_b),
        "sentence": sentence,
    });
    Ok(Planned { answer, text: with(scene, "path.turn_radius", found.value_hi.or(found.value)) })
}

fn speed(scene: &DesignedScene, progress: Progress<'_>) -> Result<Planned, String> {
    let timeline = scene.scene.ensemble.timeline(&mut |_| progress(0.0));
    let found = greatest_speed(&scene.scene, &timeline, MOST_SPEED, progress).map_err(|error| error.to_string())?;
    let sentence = format!(
        "No handle is faster than {MOST_SPEED} m/s while the head moves at {} m/s. The fastest is handle {} (counting \
         from 1), at t = {} s.",
        figure(found.value_lo),
        found.handle + 1,
        figure(found.time)
    );
    let answer = json!({
        "plan": "speed",
        "status": status(found.proved),
        "value": found.value_lo,
        "value_lo": found.value_lo,
        "value_hi": found.value_hi,
        "time": found.time,
        "handle": found.handle,
        "ratio": found.ratio,
        "sentence": sentence,
    });
    Ok(Planned { answer, text: with(scene, "motion.head_speed", Some(found.value_lo)) })
}

fn status(proved: bool) -> &'static str {
    if proved { "proved" } else { "given_up" }
}

/// Fits numbers of the scene, as `plan fit` does, so that the show keeps what is required.
fn fitted(vary: &[String], scene: &DesignedScene, progress: Progress<'_>) -> Result<Planned, String> {
    if vary.is_empty() || vary.len() > MOST_VARIED {
        return Err(format!("{} numbers are chosen to be fitted, expected 1 to {MOST_VARIED}", vary.len()));
    }
    let text = SceneText { text: scene.text.clone(), file: "scene".to_owned(), stem: "scene".to_owned() };
    let vary: Vec<Vary> = vary.iter().map(|field| Vary { field: field.clone(), range: None }).collect();
    let clearance = scene.scene.require.and_then(|require| require.clearance).unwrap_or(0.0);
    let found = fit(&text, &vary, clearance, 1, &mut |share, _| progress(share)).map_err(|error| error.to_string())?;
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
    let fields: BTreeMap<&str, f64> = found.fields.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    let answer = json!({
        "plan": "fit",
        "status": if found.is_found() { "found" } else { "not_found" },
        "fields": fields,
        "clearance": clearance,
        "margin": margin,
        "sentence": sentence,
    });
    Ok(Planned { answer, text: found.is_found().then_some(found.text) })
}

/// Proves the events, as `events --certify` does, without a certificate.
fn prove(scene: &DesignedScene, progress: Progress<'_>) -> Result<Planned, String> {
    let ensemble = &scene.scene.ensemble;
    if !ensemble.is_exact() {
        return Err(
            "the scene names the solver \"paper\", whose head is too fast: only exact motion is proved".to_owned()
        );
    }
    let timeline: Timeline = ensemble.timeline(&mut |_| progress(0.0));
    let mut write = |_: &bench_dragon_certify::CertificateLine| Ok(());
    let found = certify(ensemble, &timeline, &scene.text, MOST_STEPS, &mut write, progress);
    let found = found.map_err(|error| error.to_string())?;
    let undecided = found.iter().filter(|event| matches!(event.status, Status::Undecided { .. })).count();
    let sentence = match undecided {
        0 => "Every event is proved, and that there is no earlier one.".to_owned(),
        _ => format!("{undecided} of {} statements could not be decided.", found.len()),
    };
    let list: Vec<Value> = found.iter().map(proved_line).collect();
    let answer = json!({"plan": "prove", "status": status(undecided == 0), "list": list, "sentence": sentence});
    Ok(Planned { answer, text: None })
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
