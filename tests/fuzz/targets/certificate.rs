//! Certificates of all questions as `verify` reads them: refused with a sentence, or accepted with claims that agree
//! with the ordinary search.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock};

use bench_dragon::certify::plan::{certify_greatest_speed, certify_least_pitch};
use bench_dragon::certify::{CertificateLine, ClearanceHints, certify_clearances};
use bench_dragon::motion::event::unreported;
use bench_dragon::proof::{Proved, verify};
use serde_json::Value;

use super::Target;
use super::certificate_changes::mutate;
use super::scene::is_quick;
use super::truth::{Found, certificate, scene};

pub const TARGET: Target = Target { name: "certificate", run, seeds, mutate, cases: 100_000 };

/// Bytes of the longest certificate that is checked: some hundred steps of a small team.
const MOST_BYTES: usize = 200_000;

/// Intervals of pitches before the last in an initial certificate.
const INTERVALS: usize = 10;

fn run(data: &[u8]) -> bool {
    if data.len() > MOST_BYTES {
        return false;
    }
    match verify(data, &mut |_| ()) {
        // The sentence may contain text of the file: the command escapes it.
        Err(refused) => {
            let sentence = refused.to_string();
            let line = sentence.strip_prefix("line ").and_then(|rest| rest.split_once(": "));
            let (line, problem) = line.unwrap_or_else(|| panic!("{sentence:?} names no line"));
            let lines = data.split_inclusive(|byte| *byte == b'\n').count().max(1);
            assert!(line.parse().is_ok_and(|line| (1..=lines).contains(&line)) && !problem.is_empty(), "{sentence:?}");
            false
        }
        Ok(proved) => {
            let Proved { results, least_clearance, greatest_speed, least_pitch, .. } = &proved;
            let others = [least_clearance.is_some(), greatest_speed.is_some(), least_pitch.is_some()].map(u8::from);
            let questions = u8::from(results.len() >= 4) + others.iter().sum::<u8>();
            assert!(questions == 1 && (results.is_empty() || results.len() >= 4), "{proved:?}");
            // The lines of a pitch, and a place at which a handle is fast, are counted in other ways.
            if greatest_speed.is_none() && least_pitch.is_none() {
                check_steps(data, [proved.steps, proved.links]);
            }
            // Scenes that the program refuses, or would search for long, have no other check.
            let contradiction = found(&proved.scene).and_then(|found| found.contradiction(&proved));
            assert_eq!(contradiction, None, "accepted, but not true");
            true
        }
    }
}

/// Asserts that the number of checked steps and links is that of the file, and that each step begins where the step
/// before ended.
fn check_steps(data: &[u8], proved: [u64; 2]) {
    let (mut steps, mut links, mut end) = (0, 0, None);
    for line in text_lines(data) {
        let line: Value = serde_json::from_slice(line).expect("it was read");
        if line["type"] == "step" {
            steps += 1;
            links += line["spans"].as_array().map_or(0, Vec::len) as u64;
            let place = |name: &str| (line[name][0].as_u64(), line[name][1].as_f64());
            assert!(end.is_none_or(|end| end == place("from")), "accepted with a gap before {line}");
            end = Some(place("to"));
        }
    }
    assert_eq!(proved, [steps, links], "steps and links");
}

/// Returns the lines of a file.
fn text_lines(data: &[u8]) -> impl Iterator<Item = &[u8]> {
    data.split(|byte| *byte == b'\n').filter(|line| !line.is_empty())
}

/// Returns the results of the ordinary search for a scene, searched once; `None` if the search would take long.
fn found(text: &str) -> Option<Arc<Found>> {
    static KNOWN: OnceLock<Mutex<HashMap<String, Option<Arc<Found>>>>> = OnceLock::new();
    let mut known = KNOWN.get_or_init(Mutex::default).lock().unwrap_or_else(|error| error.into_inner());
    if known.len() > 1000 {
        known.clear();
    }
    if !known.contains_key(text) {
        let found = if scene(text).is_some_and(|scene| is_quick(&scene)) { Found::new(text) } else { None };
        known.insert(text.to_owned(), found.map(Arc::new));
    }
    known.get(text).cloned().flatten()
}

/// Returns the text of a scene of a team like the paper's.
fn scene_of(benches: u32, hole_inset: f64, path: &str) -> String {
    format!(
        "[team]\nbenches = {benches}\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = {hole_inset}\n\
         [path]\n{path}[motion]\nhead_speed = 1.0\n"
    )
}

/// Returns certificates of few lines of each question. Certificates of events are on a line, on a line on which boards
/// overlap from the start, and on a bend. Others have a stall and a lock on a spiral, or obstacles that are avoided or
/// touched.
fn seeds() -> Vec<Vec<u8>> {
    let line = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"line\"\nlength = 0.1\n";
    let bend = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"arc\"\nradius = 5.0\nside = \"left\"\nturns = 0.01\n";
    let narrow = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"arc\"\nradius = 1.7\nside = \"left\"\nturns = 0.02\n";
    let spiral = "kind = \"spiral\"\npitch = 1.7\nstart_turn = 0.6\n";
    let lamp = "[stage]\n[[stage.obstacles]]\nname = \"lamp\"\ncircle = { center = [0.4, 0.2], radius = 0.05 }\n";
    let wall = "[stage]\nboundary = { polygon = [[-9, -2], [4, -2], [4, 2], [-9, 2]] }\n[[stage.obstacles]]\n\
                name = \"wall\"\nline = [[0.31, -1], [0.31, 0.1]]\n";
    let house = "[placement]\norigin = [1.0, 2.0]\nrotation_turns = 0.2\n[stage]\n[[stage.obstacles]]\nname = \"house\"\n\
                 polygon = [[1.5, 2.2], [2, 2.2], [2, 3]]\nkeep_out = 0.1\n";
    let events = [
        scene_of(1, 0.275, line),
        scene_of(2, 0.275, line),
        scene_of(3, 0.275, line),
        scene_of(3, 0.8, line),
        scene_of(1, 0.275, bend),
        scene_of(3, 0.275, bend),
        scene_of(1, 0.275, spiral),
        scene_of(3, 0.275, spiral),
        scene_of(1, 0.275, line) + lamp,
        scene_of(3, 0.275, line) + wall,
        scene_of(2, 0.275, bend) + house,
    ];
    let events = events.map(|text| lines_of(&certificate(&text)));
    let clearances =
        [scene_of(3, 0.275, line), scene_of(3, 0.8, line), scene_of(3, 0.275, bend), scene_of(4, 0.275, spiral)];
    let speeds = [scene_of(1, 0.275, line), scene_of(1, 0.275, bend), scene_of(3, 0.275, narrow)];
    let pitches = [(3, 1.6, 0.5), (4, 1.6, 0.6), (8, 1.0, 0.7)].map(|(benches, body, radius)| {
        let team = scene_of(benches, 0.1, spiral).replace("body_length = 2.2", &format!("body_length = {body}"));
        (team.replace("head_length = 3.41", "head_length = 2.0"), radius)
    });
    (events.into_iter())
        .chain(clearances.iter().map(|text| clearance(text)))
        .chain(speeds.iter().map(|text| speed(text)))
        .chain(pitches.iter().map(|(text, radius)| pitch(text, *radius)))
        .collect()
}

/// Returns the lines that a search writes.
fn written(search: impl FnOnce(&mut dyn FnMut(&CertificateLine) -> std::io::Result<()>)) -> Vec<u8> {
    let mut lines = Vec::new();
    search(&mut |line| {
        lines.push(serde_json::to_value(line)?);
        Ok(())
    });
    lines_of(&lines)
}

/// Returns the text of a file of these lines.
pub fn lines_of(lines: &[Value]) -> Vec<u8> {
    lines.iter().map(|line| format!("{line}\n")).collect::<String>().into_bytes()
}

fn clearance(text: &str) -> Vec<u8> {
    let scene = scene(text).expect("a scene");
    let timeline = scene.ensemble.timeline(&mut unreported);
    let show_end = timeline.show_end(true);
    let hint = scene.ensemble.least_clearances(&timeline, show_end, &mut unreported).own.expect("three benches").least;
    written(|write| {
        let hints = ClearanceHints { boards: Some(&hint), obstacles: &[] };
        certify_clearances(&scene.ensemble, show_end, hints, text, 1000, write, &mut unreported).expect("lines");
    })
}

fn speed(text: &str) -> Vec<u8> {
    let scene = scene(text).expect("a scene");
    let timeline = scene.ensemble.timeline(&mut unreported);
    written(|write| {
        let found = certify_greatest_speed(&scene, &timeline, 1.5, text, 50_000, write, &mut unreported);
        found.expect("no lock").expect("lines");
    })
}

/// Returns a certificate of the least pitch whose first pitch is not far from the least: with fewer lines.
fn pitch(text: &str, radius: f64) -> Vec<u8> {
    let scene = scene(text).expect("a scene");
    let lines = written(|write| {
        let found = certify_least_pitch(scene.ensemble.only().unwrap().team(), radius, text, write, &mut unreported);
        found.expect("a pitch").expect("lines");
    });
    let mut lines: Vec<Value> = text_lines(&lines).map(|line| serde_json::from_slice(line).expect("JSON")).collect();
    let is_interval = |line: &Value| line["type"] == "overlap" || line["type"] == "head_locks";
    let first = lines.iter().rposition(is_interval).map_or(2, |last| last.saturating_sub(INTERVALS).max(2));
    let from = lines[first]["from"].clone();
    lines.drain(2..first);
    let last = lines.len() - 1;
    (lines[1]["from"], lines[last]["from"]) = (from.clone(), from);
    lines_of(&lines)
}
