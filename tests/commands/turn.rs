//! `plan turn`: a ratio that no formula gives and wide boards against another search, and bad input.

use std::io::Write;
use std::process::{Command, Output};

use crate::harness::{all, can_run, json_lines, python, python_modules, text};
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

/// Runs the program with a scene, and returns the lines of its JSON.
fn answers(scene: &str, arguments: &[&str]) -> Vec<Value> {
    json_lines(&output(scene, arguments))
}

fn output(scene: &str, arguments: &[&str]) -> Output {
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(scene.as_bytes()).unwrap();
    let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let output = program.args(["--json", "--scene"]).arg(file.path()).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    output
}

/// A scene of the paper's benches with one spiral piece inward, a turn, and a spiral outward. `inward` has the rest of
/// the first.
fn coil(benches: u32, inward: &str, side: &str, turn: &str) -> String {
    format!(
        "[team]\nbenches = {benches}\n[path]\nkind = \"pieces\"\n[[path.pieces]]\nkind = \"spiral\"\npitch = 1.7\n\
         radius = 14\nside = \"{side}\"\ndirection = \"in\"\n{inward}\n[[path.pieces]]\nkind = \"turn\"\n{turn}\n\
         [[path.pieces]]\nkind = \"spiral\"\nlength = 150\n[motion]\nhead_speed = 1.0\non_contact = \
         \"continue\"\n[alerts]\n"
    )
}

/// The metres of a spiral of pitch 1.7 m from its centre.
fn metres_of_spiral(radius: f64) -> f64 {
    let a = 1.7 / std::f64::consts::TAU;
    let theta = radius / a;
    0.5 * a * (theta * 1f64.hypot(theta) + theta.asinh())
}

/// A route of an inward spiral, a turn and an outward spiral has the events and the least clearance of the turnaround
/// that the paper's solution defines.
#[test]
fn a_turn_in_a_route_is_that_of_a_turnaround() {
    let mut kinds = std::collections::BTreeSet::new();
    for (benches, radius, ratio, side) in [
        (12, 4.5, 2.0, "right"),
        (12, 4.5, 1.0, "left"),
        (12, 2.6, 2.0, "left"),
        (12, 2.0, 2.0, "left"),
        (12, 3.1, 0.7, "right"),
        (40, 3.0, 1.0, "left"),
    ] {
        let turnaround = format!(
            "[team]\nbenches = {benches}\n[path]\nkind = \"turnaround\"\npitch = 1.7\nturn_radius = {radius}\n\
             arc_ratio = {ratio}\nlead_in = 200\nlead_out = 150\n[motion]\nhead_speed = 1.0\non_contact = \
             \"continue\"\n[alerts]\n"
        );
        let turn = if ratio == 2.0 { String::new() } else { format!("arc_ratio = {ratio}") };
        let to_radius = coil(benches, &format!("to_radius = {radius}"), side, &turn);
        let turns = coil(benches, &format!("turns = {}", (14.0 - radius) / 1.7), side, &turn);
        let lead_in = metres_of_spiral(14.0) - metres_of_spiral(radius);
        for route in [to_radius, turns] {
            for command in ["events", "check"] {
                let (expected, found) = (answers(&turnaround, &[command]), answers(&route, &[command]));
                assert_eq!(expected.len(), found.len(), "{expected:?} {found:?}");
                for (expected, found) in expected.iter().zip(&found) {
                    for key in ["event", "check", "bench_a", "bench_b"] {
                        assert_eq!(expected[key], found[key], "{expected} {found}");
                    }
                    kinds.insert(expected["event"].as_str().unwrap_or("clearance").to_owned());
                    if expected["check"] == "clearance" {
                        let clearance = number(expected, "clearance") - number(found, "clearance");
                        assert!(clearance.abs() < 1e-12, "{expected} {found}");
                    } else {
                        let time = number(expected, "time") - 200.0 + lead_in - number(found, "time");
                        assert!(time.abs() < 1e-10, "{expected} {found}");
                    }
                }
            }
        }
    }
    assert_eq!(Vec::from_iter(kinds), ["clearance", "lock", "path_end", "stall"]);
}

#[test]
fn a_turn_of_a_route_is_planned_as_that_of_a_turnaround() {
    let turnaround = include_str!("../../config/turnaround.toml").replace("benches = 223", "benches = 12");
    let arguments = ["plan", "turn", "--arc-ratio", "2"];
    let route = coil(12, "to_radius = 5", "left", "");
    let planned = [&route, &turnaround].map(|scene| output(scene, &arguments));
    assert_eq!(json_lines(&planned[0]), json_lines(&planned[1]));
    // The rest of the route is left out, and the plan says so.
    let warns = planned.map(|of| text(&of.stderr).contains("leaves out the rest of the route: it is about boards on"));
    assert_eq!(warns, [true, false]);
}

#[test]
fn a_turn_or_a_spiral_that_leads_nowhere_is_refused_in_one_sentence() {
    let inward = "kind = \"spiral\"\npitch = 1.7\nradius = 14\nside = \"left\"\ndirection = \"in\"\n";
    let cases: [(&[&str], &str); 9] = [
        (&["kind = \"turn\""], "line 5: a turn has to follow an inward spiral"),
        (&["kind = \"line\"\nlength = 3", "kind = \"turn\""], "line 8: a turn has to follow an inward spiral"),
        (
            &[&format!("{inward}to_radius = 14")],
            "path.pieces.to_radius is 14, expected less than 14 m, where the spiral",
        ),
        (&[&format!("{inward}to_radius = 0")], "path.pieces.to_radius is 0, expected"),
        (&[&format!("{inward}to_radius = 4\nturns = 1")], "one of turns around its centre, a length and a to_radius"),
        (&[&format!("{inward}to_radius = 4"), "kind = \"turn\"\nside = \"left\""], "a turn has an arc_ratio"),
        (
            &[&format!("{inward}to_radius = 4"), "kind = \"turn\"\narc_ratio = 0"],
            "path.pieces.arc_ratio is 0, expected",
        ),
        (
            &[&format!("{inward}to_radius = 4"), "kind = \"turn\"", "kind = \"spiral\"\npitch = 2\nturns = 1"],
            "the spiral after a turn leads outward about the same centre",
        ),
        (
            &[&format!("{inward}to_radius = 4"), "kind = \"turn\"", "kind = \"spiral\"\nto_radius = 3"],
            "path.pieces.to_radius is 3, expected more than 4 m",
        ),
    ];
    for (pieces, sentence) in cases {
        let pieces = pieces.iter().map(|piece| format!("[[path.pieces]]\n{piece}\n")).collect::<String>();
        let scene = format!("[team]\nbenches = 12\n[path]\nkind = \"pieces\"\n{pieces}[motion]\nhead_speed = 1.0\n");
        let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
        file.write_all(scene.as_bytes()).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_bench-dragon")).arg("check").arg(file.path()).output().unwrap();
        let said = text(&output.stderr);
        assert!(output.status.code() == Some(2) && said.lines().count() == 1 && said.contains(sentence), "{said}");
    }
}

#[test]
fn a_wrong_question_is_refused_in_one_sentence() {
    let cases = [
        ("turnaround", "--arc-ratio=0", "--arc-ratio is 0, expected a number from 0.001 to 1000"),
        ("turnaround", "--arc-ratio=-1", "--arc-ratio is -1, expected"),
        ("turnaround", "--arc-ratio=nan", "--arc-ratio is NaN, expected"),
        ("turnaround", "--arc-ratio=1e9", "--arc-ratio is 1000000000, expected"),
        ("procession", "--arc-ratio=1", "the scene's path is a route without a turn, or with several"),
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
