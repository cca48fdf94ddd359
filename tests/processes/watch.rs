//! The monitor as people see it: `watch` in a terminal, its text, its colours, and the effects of its keys.
//!
//! The terminal is a pseudo-terminal, and an emulator if its rows matter. The checks in the emulator are in
//! `tests/python/watch_terminal.py` and `watch_keys.py`. No test asserts a speed.

use crate::control::done;
use crate::harness;

use harness::{Process, program, python, scene_file, text, unique};
use serde_json::Value;

/// A solver with which the publisher starts at once, even if the program is not optimised.
const NEWTON: (&str, &str) = ("accuracy = 1e-9", "solver = \"newton\"");

fn in_a_terminal(scenario: &str) {
    run_script("tests/python/watch_terminal.py", scenario, &[]);
}

fn run_script(script: &str, scenario: &str, further: &[&str]) {
    let program = env!("CARGO_BIN_EXE_bench-dragon");
    let name = unique(&format!("w_{}", &scenario[..6]));
    let arguments = [&[script, scenario, program, &name], further].concat();
    let output = Process::start(python().args(arguments)).output();
    println!("{}", text(&output.stdout));
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn figures_are_redrawn_in_place() {
    in_a_terminal("figures_are_redrawn_in_place");
}

#[test]
fn colour_follows_no_color() {
    in_a_terminal("colour_follows_no_color");
}

#[test]
fn keys_conduct() {
    let scene = scene_file("keys_conduct", &[NEWTON]);
    run_script("tests/python/watch_keys.py", "keys_conduct", &[scene.to_str().unwrap()]);
}

#[test]
fn keys_are_read_once_a_shell_brings_it_to_the_front() {
    let scene = scene_file("foreground_later", &[NEWTON]);
    run_script("tests/python/watch_keys.py", "foreground_later", &[scene.to_str().unwrap()]);
}

#[test]
fn terminal_is_restored() {
    run_script("tests/python/watch_keys.py", "terminal_is_restored", &["unused"]);
}

#[test]
fn cues_are_printed_as_they_are_announced() {
    let scene = scene_file("cue_lines", &[NEWTON]);
    let cues = "[[cues]]\nname = \"lamps\"\nat = 0.6\n[[cues]]\nname = \"coil\"\nat = 0.8\nthen = \"pause\"\n";
    std::fs::write(&scene, format!("{}\n{cues}", std::fs::read_to_string(&scene).unwrap())).unwrap();
    let mut publisher = program("cue_lines");
    publisher.args(["--scene", scene.to_str().unwrap(), "run", "--quiet", "--rate", "50", "--time-scale", "0.2"]);
    let _publisher = Process::start(publisher.arg("--paused"));
    let mut json = Process::start(program("cue_lines").args(["watch", "--json"]));
    let mut people = Process::start(program("cue_lines").arg("watch"));
    let (lines, json) = (people.lines(), json.lines());
    // The show moves when both have frames.
    json.until("\"tick\":1");
    lines.until("(paused)");
    done("cue_lines", &["resume"]);
    assert!(lines.until("cue 1").ends_with(" s  cue 1 \"lamps\""));
    assert!(lines.until("cue 2").ends_with(" s  cue 2 \"coil\": waiting for go"));
    let cues = [(); 2].map(|()| serde_json::from_str::<Value>(&json.until("\"type\":\"cue\"")).unwrap());
    let figures = ["number", "cue_time", "pauses", "name"];
    let printed: Vec<_> = cues.iter().map(|cue| figures.map(|key| cue[key].to_string())).collect();
    assert_eq!(printed, [["1", "0.6", "false", "\"lamps\""], ["2", "0.8", "true", "\"coil\""]]);
    // The first frame at or after the cue; a cue that pauses is at the exact time.
    let at = cues[0]["sim_time"].as_f64().unwrap();
    assert!((0.6..0.6 + 0.2).contains(&at), "{at}");
    assert_eq!(cues[1]["sim_time"], 0.8);
    assert!(cues.iter().all(|cue| cue["run_id"].is_string() && cue["stamp_ns"].is_string() && cue["tick"].is_u64()));
}

#[test]
fn lines_in_a_pipe_fit_a_hundred_and_twenty_columns() {
    let mut publisher = program("narrow");
    // Alerts as the contact approaches.
    let mut publisher = Process::start(publisher.args(["run", "--quiet", "--rate", "50", "--start", "405"]));
    let mut people = Process::start(program("narrow").arg("watch"));
    let lines = people.lines();
    let mut read = lines.all_until("approaching");
    // A report after the first status, and the next one.
    read.extend(lines.all_until("lateness p99"));
    read.extend(lines.all_until("lateness p99"));
    people.signal(nix::sys::signal::Signal::SIGTERM);
    publisher.close_stdout();
    let long: Vec<&String> = read.iter().filter(|line| line.chars().count() > 120).collect();
    assert!(long.is_empty(), "{long:#?}");
    // Parts stand beside each other where they fit.
    let parts = ["; rate ", "; latency ", "; head ("];
    assert!(read.iter().any(|line| parts.iter().any(|part| line.contains(part))), "a line has one part: {read:#?}");
}
