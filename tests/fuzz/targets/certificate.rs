//! Certificates of events as `verify` reads them: refused with a sentence, or accepted with claims that agree with the
//! ordinary search.

use std::collections::HashMap;
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

use bench_dragon::motion::timeline::Timeline;
use bench_dragon::proof::verify;
use fastrand::Rng;
use serde_json::{Value, json};

use super::Target;
use super::bytes::{changed, renumbered};
use super::changes::change;
use super::scene::is_quick;
use super::truth::{certificate, is_true, scene, timeline};

pub const TARGET: Target =
    Target { name: "certificate", run, seeds, mutate, cases: 1500, hung: Duration::from_secs(30) };

/// Bytes of the longest certificate that is checked: some hundred steps of a small team.
const MOST_BYTES: usize = 200_000;

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
            assert_eq!(proved.results.len(), 4, "{:?}", proved.results);
            check_steps(data, [proved.steps, proved.links]);
            // Scenes that the program refuses, or would search for long, have no other check.
            let Some(timeline) = timeline_of(&proved.scene) else { return true };
            for outcome in &proved.results {
                assert!(is_true(outcome, &timeline), "accepted, but not true: {outcome:?}");
            }
            true
        }
    }
}

/// Asserts that the number of checked steps and links is that of the file, and that each step begins where the step
/// before ended.
fn check_steps(data: &[u8], proved: [u64; 2]) {
    let (mut steps, mut links, mut end) = (0, 0, None);
    for line in data.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
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

/// Returns the events that the ordinary search finds in a scene, searched once; `None` if the search would take long.
fn timeline_of(text: &str) -> Option<Timeline> {
    static KNOWN: OnceLock<Mutex<HashMap<String, Option<Timeline>>>> = OnceLock::new();
    let mut known = KNOWN.get_or_init(Mutex::default).lock().unwrap_or_else(|error| error.into_inner());
    if known.len() > 1000 {
        known.clear();
    }
    if !known.contains_key(text) {
        let found = if scene(text).is_some_and(|scene| is_quick(&scene)) { timeline(text) } else { None };
        known.insert(text.to_owned(), found);
    }
    known.get(text).cloned().flatten()
}

/// Returns certificates of small scenes of few steps: a line, a line on which boards overlap from the start, a bend,
/// and a stall and a lock on a spiral.
fn seeds() -> Vec<Vec<u8>> {
    let line = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"line\"\nlength = 0.1\n";
    let bend = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"arc\"\nradius = 5.0\nside = \"left\"\nturns = 0.01\n";
    let spiral = "kind = \"spiral\"\npitch = 1.7\nstart_turn = 0.6\n";
    let scenes = [
        (1, 0.275, line),
        (2, 0.275, line),
        (3, 0.275, line),
        (3, 0.8, line),
        (1, 0.275, bend),
        (3, 0.275, bend),
        (1, 0.275, spiral),
        (3, 0.275, spiral),
    ];
    let text = |(benches, inset, path)| {
        format!(
            "[team]\nbenches = {benches}\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = {inset}\n\
             [path]\n{path}[motion]\nhead_speed = 1.0\n"
        )
    };
    let lines = |scene: String| certificate(&scene).iter().map(|line| format!("{line}\n")).collect::<String>();
    scenes.map(|scene| lines(text(scene)).into_bytes()).to_vec()
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    let text = String::from_utf8_lossy(data);
    let parsed: Result<Vec<Value>, _> = text.lines().map(serde_json::from_str).collect();
    let Some(mut lines) = parsed.ok().filter(|lines| lines.len() > 6) else { return changed(data, random) };
    match random.u8(..8) {
        0 => return changed(data, random),
        1 => return renumbered(&text, random).into_bytes(),
        _ => (),
    }
    if random.u8(..3) == 0 {
        // The data of an event, and the claims about it.
        let is_event = |line: &Value| !["step", "certificate"].contains(&line["type"].as_str().unwrap_or_default());
        let events: Vec<usize> = (0..lines.len()).filter(|at| is_event(&lines[*at])).collect();
        let Some(at) = events.get(random.usize(..events.len().max(1))) else { return changed(data, random) };
        let mut texts: Vec<String> = lines.iter().map(Value::to_string).collect();
        texts[*at] = match random.u8(..3) {
            0 => {
                let near = 1.0 + 10f64.powi(-random.i32(1..9)) * (2.0 * random.f64() - 1.0);
                scaled(&lines[*at], near, random).to_string()
            }
            1 => texts[*at].replace("proved", "none").replace("undecided", "proved"),
            _ => renumbered(&texts[*at], random),
        };
        return texts.iter().map(|line| format!("{line}\n")).collect::<String>().into_bytes();
    }
    for _ in 0..1 + random.usize(..3) {
        // Lines that have lost their fields in an earlier change are not changed by name again.
        if lines.len() > 6 && lines[0]["scene"].is_string() {
            change(&mut lines, random);
        }
    }
    lines.iter().map(|line| format!("{line}\n")).collect::<String>().into_bytes()
}

/// Returns a line with one of its numbers that is not whole multiplied by a factor.
fn scaled(line: &Value, factor: f64, random: &mut Rng) -> Value {
    fn count(value: &Value) -> usize {
        match value {
            Value::Array(values) => values.iter().map(count).sum(),
            Value::Object(fields) => fields.values().map(count).sum(),
            value => usize::from(value.is_f64()),
        }
    }
    fn scale(value: &mut Value, left: &mut usize, factor: f64) {
        match value {
            Value::Array(values) => values.iter_mut().for_each(|value| scale(value, left, factor)),
            Value::Object(fields) => fields.values_mut().for_each(|value| scale(value, left, factor)),
            value => {
                if let Some(number) = value.as_f64().filter(|_| value.is_f64()) {
                    if *left == 0 {
                        *value = json!(number * factor);
                    }
                    *left = left.wrapping_sub(1);
                }
            }
        }
    }
    let (mut line, mut left) = (line.clone(), random.usize(..count(line).max(1)));
    scale(&mut line, &mut left, factor);
    line
}
