//! A show of several dragons, as programs: it runs, is watched, recorded and proved under its one name. What does not know
//! several refuses it with one sentence.

use crate::harness;

use harness::{Process, json_lines, program, text};
use serde_json::Value;

const COIL: &str = "config/coil.toml";

#[test]
fn a_show_of_two_runs_is_recorded_and_proved() {
    let (folder, name) = (tempfile::tempdir().unwrap(), "several_coil");
    let [log, recording] = ["show.jsonl", "show.mcap"].map(|file| folder.path().join(file));
    let mut command = program(name);
    command.args(["--scene", COIL, "run", "--time-scale", "20", "--start", "300", "--paused", "--log"]).arg(&log);
    let run = Process::start(&mut command);
    let mut watch = Process::start(program(name).args(["--json", "watch"]));
    let watched = watch.lines();
    watched.until("\"alert\"", 60);
    let record = Process::start(program(name).args(["record", "-o"]).arg(&recording));
    harness::wait_for_bytes(&recording, 10_000);
    assert!(program(name).args(["control", "go"]).status().unwrap().success());
    let contact = watched.until("\"level\":\"contact\"", 60);
    let contact: Value = serde_json::from_str(&contact).unwrap();
    assert_eq!((&contact["event_bench_a"], &contact["event_bench_b"]), (&0.into(), &61.into()));
    for process in [&record, &watch, &run] {
        process.signal(nix::sys::signal::Signal::SIGINT);
    }
    assert!(record.output_within(60).status.success());
    let told = text(&run.output_within(60).stderr);
    assert!(told.contains("bench 1 (the head) of gold and bench 1 (the head) of jade touched at"), "{told}");
    for (file, verdict) in [(&log, "same"), (&recording, "close")] {
        let proof = program("several_verify").args(["--json", "verify"]).arg(file).output().unwrap();
        assert_eq!(proof.status.code(), Some(0), "{}", text(&proof.stderr));
        assert_eq!(json_lines(&proof).pop().unwrap()["verdict"], verdict);
    }
}

#[test]
fn what_knows_one_dragon_refuses_several_with_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("certificate");
    let file = file.to_str().unwrap();
    for arguments in [
        vec!["events", "--certify", file],
        vec!["check", "--prove"],
        vec!["check", "--swept", file],
        vec!["plan", "pitch", "--reach-radius", "4.5"],
        vec!["plan", "speed", "--max-handle-speed", "2"],
        vec!["trade"],
        vec!["soak", "--duration", "1"],
        vec!["draw", "--look", "lanterns"],
        vec!["draw", "--swept"],
        vec!["chase", "psn"],
    ] {
        let output = program("several_one").args(["--scene", COIL]).args(&arguments).output().unwrap();
        let sentence = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {sentence}");
        assert_eq!(sentence.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{arguments:?}: {sentence}");
        assert!(sentence.contains("several"), "{arguments:?}: {sentence}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
}
