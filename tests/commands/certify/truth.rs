//! Certificates of scenes, and the ordinary search's results for the same scenes. Shared by the tests of certificates
//! and their fuzz target.

use bench_dragon::certify::{self, CertificateLine};
use bench_dragon::messages::state::EventKind as Kind;
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::proof::{EventKind, ProvedEvent, Status};
use bench_dragon::show::scene::Scene;
use serde_json::Value;

/// Greatest error of a time of the ordinary search, seconds.
const ERROR: f64 = 1e-9;

/// Returns the part of a scene's text that a certificate is about.
pub fn scene(text: &str) -> Option<Scene> {
    let mut table: toml::Table = text.parse().ok()?;
    table.retain(|key, _| ["team", "path", "motion"].contains(&key));
    table["motion"].as_table_mut()?.retain(|key, _| key == "head_speed");
    Scene::parse(&toml::to_string(&table).ok()?, "scene.toml", "scene").ok()
}

/// Returns the events that the ordinary search finds in a scene.
pub fn timeline(text: &str) -> Option<Timeline> {
    Some(scene(text)?.motion.timeline(&mut |_| {}))
}

/// Returns the lines of a scene's certificate.
pub fn certificate(text: &str) -> Vec<Value> {
    let scene = Scene::parse(text, "scene.toml", "scene").unwrap();
    let timeline = scene.motion.timeline(&mut |_| {});
    let mut lines = Vec::new();
    let mut write = |line: &CertificateLine| {
        lines.push(serde_json::to_value(line).unwrap());
        Ok::<(), std::io::Error>(())
    };
    certify::certify(&scene.motion, &timeline, text, certify::MOST_STEPS, &mut write, &mut |_| {}).unwrap();
    lines
}

/// Returns true if the claim about an event agrees with the ordinary search.
pub fn is_true(outcome: &ProvedEvent, timeline: &Timeline) -> bool {
    let kind = match outcome.event {
        EventKind::Contact => Kind::Contact,
        EventKind::Stall => Kind::Stall,
        EventKind::Lock => Kind::Lock,
        EventKind::PathEnd => Kind::PathEnd,
        EventKind::Obstacle => Kind::Obstacle,
    };
    let found = timeline.events().iter().find(|event| event.event.kind == kind).map(|event| event.time);
    match (outcome.status, found, outcome.time_lo, outcome.time_hi) {
        (Status::None, None, ..) => true,
        (Status::Proved, Some(time), Some(lo), Some(hi)) => {
            let error = ERROR * time.max(1.0);
            lo <= time + error && time <= hi + error
        }
        (Status::Undecided, Some(time), Some(lo), _) => lo <= time + ERROR * time.max(1.0),
        (Status::Undecided, None, ..) => true,
        _ => false,
    }
}
