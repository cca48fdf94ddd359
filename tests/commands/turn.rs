//! `plan turn`: a ratio that no formula gives and wide boards against another search, and bad input.

use std::io::Write;
use std::process::Command;

use crate::harness::{all, can_run, python, python_modules, text};
use serde_json::Value;

/// Plans a turn of the turnaround's team with 12 benches of a width in metres.
fn planned(ratio: &str, width: &str) -> Value {
    let scene = include_str!("../../config/turnaround.toml").replace("benches = 223", "benches = 12");
    let scene = scene.replace("width = 0.30", &format!("width = {width}"));
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(scene.as_bytes()).unwrap();
    let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let output = program.arg("--scene").arg(file.path()).args(["--json", "plan", "turn", "--arc-ratio", ratio]);
    let output = output.output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn number(line: &Value, field: &str) -> f64 {
    line[field].as_f64().unwrap_or_else(|| panic!("no {field} in {line}"))
}

#[test]
#[ignore = "tests/run --all"]
fn the_least_turn_of_a_third_ratio_is_that_of_another_search() {
    // By `tests/python/least_turn.py`: the head's link locks at the junction of the arcs.
    const RADIUS: f64 = 3.552348981005;
    let line = planned("1.5", "0.30");
    encloses(&line, RADIUS);
    assert_eq!((&line["limit"], &line["bench_a"]), (&"lock".into(), &0.into()), "{line}");
    if can_run(python_modules(&["math"])) {
        let (radius, printed) = other_search(&["1.5"], 0);
        assert!((radius - RADIUS).abs() < 5e-9, "{printed}");
    }
}

#[test]
fn the_least_turn_of_wide_boards_is_that_of_another_search() {
    // By `tests/python/least_turn.py`: the head meets the tail.
    const RADIUS: f64 = 4.470396276098;
    let line = planned("2", "1.3");
    encloses(&line, RADIUS);
    assert_eq!((&line["limit"], &line["bench_a"], &line["bench_b"]), (&"contact".into(), &0.into(), &11.into()));
    if all() && can_run(python_modules(&["math"])) {
        let (radius, printed) = other_search(&["2", "12", "1.65", "0.275", "1.3"], 1);
        assert!((radius - RADIUS).abs() < 5e-11 && printed.ends_with(" 0 11\n"), "{printed}");
    }
}

/// Asserts that a radius is enclosed within a nanometre with a proof, and the length of its S.
fn encloses(line: &Value, radius: f64) {
    let (lo, hi) = (number(line, "value_lo"), number(line, "value_hi"));
    assert!(lo <= radius + 2e-11 && hi >= radius - 2e-11 && hi - lo <= 1e-9, "{line}");
    assert_eq!((&line["status"], &line["value"]), (&"proved".into(), &line["value_hi"]), "{line}");
    let a = 1.7 / std::f64::consts::TAU;
    let length = 2.0 * radius.hypot(a) * (radius / a).atan();
    assert!((number(line, "length") - length).abs() < 1e-7, "{line}");
}

/// Returns the radius in a line that `least_turn.py` prints, and all that it prints.
fn other_search(ratio_and_team: &[&str], line: usize) -> (f64, String) {
    let mut program = python();
    let peer = program.args(["tests/python/least_turn.py", "1.7", "2.86"]).args(ratio_and_team).output().unwrap();
    let radius = |line: &str| line.split(' ').next().and_then(|radius| radius.parse().ok());
    let found = text(&peer.stdout).lines().nth(line).and_then(radius);
    (found.unwrap_or(f64::NAN), format!("{}{}", text(&peer.stderr), text(&peer.stdout)))
}

#[test]
fn a_wrong_question_is_refused_in_one_sentence() {
    let cases = [
        ("turnaround", "--arc-ratio=0", "--arc-ratio is 0, expected a number from 0.001 to 1000"),
        ("turnaround", "--arc-ratio=-1", "--arc-ratio is -1, expected"),
        ("turnaround", "--arc-ratio=nan", "--arc-ratio is NaN, expected"),
        ("turnaround", "--arc-ratio=1e9", "--arc-ratio is 1000000000, expected"),
        ("procession", "--arc-ratio=1", "the scene's path is a route, which has no pitch"),
        ("crossing", "--arc-ratio=1", "the scene has several dragons"),
    ];
    for (scene, argument, expected) in cases {
        let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
        let file = format!("config/{scene}.toml");
        let output = program.args(["--scene", &file, "plan", "turn", argument]).output().unwrap();
        let printed = text(&output.stderr);
        assert_eq!((output.status.code(), printed.lines().count()), (Some(2), 1), "{scene}: {printed}");
        assert!(output.stdout.is_empty() && printed.contains(expected), "{scene}: {printed}");
    }
}
