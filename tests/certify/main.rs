//! Certificates of events, made by the search and checked by `proof`: those of scenes with every kind of event are
//! accepted and agree with the ordinary search, and what is changed in one is refused, or still true.
//!
//! `BENCH_DRAGON_LONG=1` makes a thousand changes in place of some dozens, and adds larger scenes.

#[path = "../processes/mod.rs"]
mod processes;

mod tampering;

use bench_dragon::certify::{self, Line};
use bench_dragon::motion::event::EventKind as Kind;
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::proof::{EventKind, Outcome, Proved, Refused, Status, verify};
use bench_dragon::scene::Scene;
use serde_json::Value;

/// Seconds by which a time of the ordinary search may be beside the true one.
const ERROR: f64 = 1e-9;

fn scene_text(name: &str) -> String {
    let config = format!("config/{name}.toml");
    std::fs::read_to_string(&config).or_else(|_| std::fs::read_to_string(format!("tests/scenes/{name}.toml"))).unwrap()
}

/// What the ordinary search finds in a scene, of which only that is kept which a certificate is about.
fn timeline(text: &str) -> Option<Timeline> {
    let mut table: toml::Table = text.parse().ok()?;
    table.retain(|key, _| ["team", "path", "motion"].contains(&key));
    table["motion"].as_table_mut()?.retain(|key, _| key == "head_speed");
    let scene = Scene::parse(&toml::to_string(&table).ok()?, "scene.toml", "scene").ok()?;
    Some(scene.motion.timeline(&mut |_| {}))
}

/// The lines of a scene's certificate.
fn certificate(text: &str) -> Vec<Value> {
    let scene = Scene::parse(text, "scene.toml", "scene").unwrap();
    let timeline = scene.motion.timeline(&mut |_| {});
    let mut lines = Vec::new();
    let mut write = |line: &Line| {
        lines.push(serde_json::to_value(line).unwrap());
        Ok::<(), std::io::Error>(())
    };
    certify::certify(&scene.motion, &timeline, text, certify::MOST_STEPS, &mut write, &mut |_| {}).unwrap();
    lines
}

fn check(lines: &[Value]) -> Result<Proved, Refused> {
    let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
    verify(text.as_bytes(), &mut |_| {})
}

/// Whether what is claimed of an event is what the ordinary search found.
fn is_true(outcome: &Outcome, timeline: &Timeline) -> bool {
    let kind = match outcome.event {
        EventKind::Contact => Kind::Contact,
        EventKind::Stall => Kind::Stall,
        EventKind::Lock => Kind::Lock,
        EventKind::PathEnd => Kind::PathEnd,
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

/// Certificates are accepted, decide what they can, and agree with the ordinary search.
#[test]
fn certificates_are_proofs() {
    let mut scenes = vec![("missed_contact", 4), ("tailoff", 4), ("pieces_46", 4), ("alertloop", 4), ("tight_158", 4)];
    if processes::long() {
        scenes.extend([("paper", 4), ("school", 4), ("wide", 4), ("procession", 4), ("tiny_2", 4), ("straight200", 4)]);
    }
    for (name, least) in scenes {
        let text = scene_text(name);
        let proved = check(&certificate(&text)).unwrap_or_else(|refused| panic!("{name}: {refused}"));
        let timeline = timeline(&text).unwrap();
        assert!(proved.results.iter().all(|outcome| is_true(outcome, &timeline)), "{name}: {:?}", proved.results);
        let decided = proved.results.iter().filter(|outcome| outcome.status != Status::Undecided).count();
        assert!(decided >= least, "{name}: {:?}", proved.results);
        assert_eq!(proved.scene, text);
    }
}

/// What the program prints and its exit code.
fn program(arguments: &[&str]) -> (String, String, Option<i32>) {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (text(output.stdout), text(output.stderr), output.status.code())
}

/// The way of a certificate through the program: made, checked, refused where a digit was changed, printed for its own
/// scene and for no other.
#[test]
fn the_program_makes_and_checks_certificates() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("proof.jsonl");
    let (file, scene) = (file.to_str().unwrap(), "tests/scenes/missed_contact.toml");
    let (lines, errors, code) = program(&["--scene", scene, "--json", "events", "--certify", file]);
    assert_eq!((errors.as_str(), code), ("", Some(0)));
    let events: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    for event in &events {
        let [time, lo, hi] = ["time", "time_lo", "time_hi"].map(|key| event[key].as_f64().unwrap());
        assert!(lo <= time && time <= hi && hi - lo < 1e-8, "{event}");
    }
    assert_eq!(events.len(), 3);
    let (said, _, code) = program(&["verify", file]);
    assert!(code == Some(0) && said.contains("contact: proved between 37.145313188"), "{said}");
    let (said, _, code) = program(&["check", "--scene", scene, "--certificate", file]);
    assert!(code == Some(0) && said.contains("lock: proved that there is none"), "{said}");
    let (_, said, code) = program(&["check", "--scene", "config/school.toml", "--certificate", file]);
    assert!(code == Some(2) && said.contains("another text"), "{said}");

    let text = std::fs::read_to_string(file).unwrap();
    std::fs::write(file, text.replace("\"time_hi\":37.1453", "\"time_hi\":37.1452")).unwrap();
    let (_, said, code) = program(&["verify", file]);
    assert!(code == Some(1) && said.contains("does not follow"), "{said}");
    std::fs::write(file, &text[..text.len() / 2]).unwrap();
    let (_, said, code) = program(&["check", "--scene", scene, "--certificate", file]);
    assert!(code == Some(2) || code == Some(1), "{said}");

    let exact = std::fs::read_to_string("config/school.toml").unwrap();
    let paper = folder.path().join("paper.toml");
    std::fs::write(&paper, exact.replace("head_speed = 1.0", "solver = \"paper\"\nhead_speed = 1.0")).unwrap();
    let (_, said, code) = program(&["--scene", paper.to_str().unwrap(), "events", "--certify", file]);
    assert!(code == Some(2) && said.contains("only exact motion can be certified"), "{said}");
}
