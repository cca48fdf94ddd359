//! The small log as `verify` reads it: a verdict, or the line that is wrong.

use bench_dragon::recording::lines::{Line, Seal};
use bench_dragon::recording::verify::verify;
use fastrand::Rng;

use super::Target;
use super::bytes::{changed, one, renumbered};
use super::scene::is_small;

pub const TARGET: Target = Target { name: "log", run, seeds: Vec::new, mutate, cases: 300 };

/// What stands before a line's check.
const CHECK: &str = ",\"check\":\"";
/// Lines of a log that is played: each can be a second of the show.
const MOST_LINES: usize = 40;

fn run(data: &[u8]) {
    if data.iter().filter(|byte| **byte == b'\n').count() > MOST_LINES || !is_quick(data) {
        return;
    }
    match verify(data, "fuzz.jsonl", &mut |_| ()) {
        Ok(verdict) => {
            assert!(["same", "close", "differs", "nothing"].contains(&verdict.verdict), "{verdict:?}");
            assert_eq!(verdict.difference.is_some(), verdict.verdict == "differs", "{verdict:?}");
            assert!(verdict.same_seconds <= verdict.seconds, "{verdict:?}");
            assert!(!(verdict.complete && verdict.cut), "{verdict:?}");
        }
        Err(error) => {
            let sentence = error.to_string();
            assert!(!sentence.is_empty() && !sentence.contains(char::is_control), "{sentence:?}");
        }
    }
}

/// Whether the show of a log is played within a moment; what is no log is refused in less.
fn is_quick(data: &[u8]) -> bool {
    let first = data.split_inclusive(|byte| *byte == b'\n').next().unwrap_or_default();
    let line = std::str::from_utf8(first).ok().and_then(|line| Seal::default().read(line).ok());
    let Some(Line::Show(show)) = line else { return true };
    show.rate <= 1000.0 && show.scene_text("fuzz").parse().is_ok_and(|scene| is_small(&scene))
}

/// A log of these lines, each with a right check.
fn sealed(bodies: &[String]) -> Vec<u8> {
    let (mut hasher, mut log) = (blake3::Hasher::new(), Vec::new());
    for body in bodies {
        hasher.update(body.as_bytes());
        let end = format!("{CHECK}{}\"}}\n", &hasher.finalize().to_hex()[..16]);
        hasher.update(end.as_bytes());
        log.extend([body.as_bytes(), end.as_bytes()].concat());
    }
    log
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    if random.u8(..8) == 0 {
        return changed(data, random);
    }
    let text = String::from_utf8_lossy(data);
    let mut bodies: Vec<String> = text.lines().filter_map(|line| Some(line.rsplit_once(CHECK)?.0.to_owned())).collect();
    if bodies.is_empty() {
        return changed(data, random);
    }
    for _ in 0..1 + random.usize(..3) {
        let (at, other) = (random.usize(..bodies.len()), random.usize(..bodies.len()));
        match random.u8(..8) {
            0 if at > 0 => drop(bodies.remove(at)),
            1 => bodies.insert(at, bodies[other].clone()),
            2 => bodies.swap(at, other),
            3 => bodies[at] = String::from_utf8_lossy(&changed(bodies[at].as_bytes(), random)).into_owned(),
            4 => {
                let words = ["command", "pause", "second", "skipped", "lost", "stopped", "end", "step", "hold", "stop"];
                let (from, to) = (one(&words, random), one(&words, random));
                bodies[at] = bodies[at].replace(&format!("\"{from}\""), &format!("\"{to}\""));
            }
            _ => bodies[at] = renumbered(&bodies[at], random),
        }
    }
    sealed(&bodies)
}
