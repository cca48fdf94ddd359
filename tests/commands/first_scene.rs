//! The first steps of a new user: a short scene, times in minutes, numbers that are hardly meant.

use std::io::Write;
use std::process::{Command, Output};

use tempfile::NamedTempFile;

/// A scene of the least that is needed.
const SHORT: &str = "[team]\nbenches = 20\n[path]\nkind = \"spiral\"\npitch = 0.9\nstart_turn = 6\n\
                     [motion]\nhead_speed = 1\n";

fn scene(text: &str) -> NamedTempFile {
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(text.as_bytes()).unwrap();
    file
}

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(arguments).output().unwrap()
}

/// Returns the standard output of a command that succeeds, and its standard error.
fn answer(arguments: &[&str]) -> (String, String) {
    let output = run(arguments);
    let [printed, logged] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(output.status.success(), "{arguments:?}: {logged}");
    (printed, logged)
}

#[test]
fn check_says_which_sizes_it_took_by_default() {
    let file = scene(SHORT);
    let (printed, logged) = answer(&["check", file.path().to_str().unwrap()]);
    let line = "  By default, in metres: head_length = 3.41, body_length = 2.2, width = 0.3, hole_inset = 0.275.";
    assert!(printed.lines().any(|printed| printed == line), "{printed}");
    assert!(printed.contains("is valid.\n") && logged.is_empty(), "{printed}{logged}");
    assert!(!answer(&["check", "config/school.toml"]).0.contains("By default"));
    let coil = include_str!("../../config/coil.toml").replacen("width = 0.30\n", "", 1);
    let (printed, _) = answer(&["check", scene(&coil).path().to_str().unwrap()]);
    assert!(printed.contains("  By default, in metres: gold: width = 0.3.\n"), "{printed}");
}

#[test]
fn times_are_seconds_or_minutes() {
    let rows = |at: &str| answer(&["solve", "config/paper.toml", "--at", at]).0;
    assert_eq!(rows("1:10"), rows("70"));
    assert_eq!(rows("1m10s"), rows("70"));
    let many = |every: &str, from: &str, until: &str| {
        answer(&["solve", "config/school.toml", "--every", every, "--from", from, "--until", until]).0
    };
    assert_eq!(many("0.5s", "0:30", "0m50s"), many("0.5", "30", "50"));
    let [minutes, seconds] = ["1:10", "70"].map(|at| answer(&["draw", "config/paper.toml", "--at", at]).0);
    assert_eq!(minutes, seconds);
}

#[test]
fn numbers_that_are_hardly_meant_are_warnings() {
    let wide = scene(&SHORT.replace("benches = 20", "benches = 20\nwidth = 30"));
    let path = wide.path().to_str().unwrap();
    let (printed, logged) = answer(&["check", path]);
    let doubt = format!("{path}, line 3: team.width is 30 m, which is wide for a bench: metres?");
    assert!(printed.contains(&format!("  Warning: {doubt}\n")), "{printed}");
    assert!(printed.contains("  Warning: boards overlap at the start"), "{printed}");
    assert!(!printed.contains("is valid") && logged.is_empty(), "{printed}{logged}");
    assert!(answer(&["draw", path]).1.contains(&doubt));
    let route = "[team]\nbenches = 3\n[path]\nkind = \"pieces\"\npieces = [{ kind = \"line\", length = 20 }, \
                 { kind = \"arc\", radius = 5, turns = 90, side = \"left\" }]\n[motion]\nhead_speed = 1\n";
    let file = scene(route);
    let (_, logged) = answer(&["draw", file.path().to_str().unwrap()]);
    let doubt = "line 5: path.pieces.turns is 90, an arc of 2827 m: degrees? 90 degrees are 0.25 turns";
    assert!(logged.contains(doubt), "{logged}");
    assert!(answer(&["draw", scene(SHORT).path().to_str().unwrap()]).1.is_empty());
}
