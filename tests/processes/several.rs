//! A show of several dragons, as programs: it runs, is watched, recorded and proved under its one name. A command or an
//! option for one dragon refuses it with one sentence.

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
    watched.until("\"alert\"");
    let record = Process::start(program(name).args(["record", "-o"]).arg(&recording));
    harness::wait_for_bytes(&recording, 10_000);
    assert!(program(name).args(["control", "go"]).status().unwrap().success());
    let contact = watched.until("\"level\":\"contact\"");
    let contact: Value = serde_json::from_str(&contact).unwrap();
    assert_eq!((&contact["event_bench_a"], &contact["event_bench_b"]), (&0.into(), &61.into()));
    for process in [&record, &watch, &run] {
        process.signal(nix::sys::signal::Signal::SIGINT);
    }
    assert!(record.output().status.success());
    let told = text(&run.output().stderr);
    assert!(told.contains("bench 1 (the head) of gold and bench 1 (the head) of jade touched at"), "{told}");
    for (file, verdict) in [(&log, "same"), (&recording, "close")] {
        let proof = program("several_verify").args(["--json", "verify"]).arg(file).output().unwrap();
        assert_eq!(proof.status.code(), Some(0), "{}", text(&proof.stderr));
        assert_eq!(json_lines(&proof).pop().unwrap()["verdict"], verdict);
    }
}

/// The contact is between the two dragons: the show waits 3 s before the contact.
#[test]
fn a_cue_before_the_contact_of_two_pauses_the_show() {
    let (folder, name) = (tempfile::tempdir().unwrap(), "several_cue");
    let scene = folder.path().join("coil.toml");
    let gold = "[[dragons]]\nname = \"gold\"";
    let cue = "[[cues]]\nname = \"closing\"\nbefore = \"contact\"\nseconds = 3.0\nthen = \"pause\"\n";
    std::fs::write(&scene, include_str!("../../config/coil.toml").replace(gold, &format!("{cue}{gold}"))).unwrap();
    let mut command = program(name);
    command.arg("--scene").arg(&scene).args(["run", "--start", "330", "--paused"]);
    let mut run = Process::start(&mut command);
    let told = run.lines();
    let mut watch = Process::start(program(name).args(["--json", "watch"]));
    let watched = watch.lines();
    watched.until("\"alert\"");
    // An alert that comes before the stage waits for its names.
    let mut people = Process::start(program(name).arg("watch"));
    let read = people.lines().all_until("of gold and bench 1 (the head) of jade at (1.873, 1.043) m");
    assert!(read.iter().filter(|line| line.contains("bench ")).all(|line| line.contains("of jade")), "{read:?}");
    assert!(program(name).args(["control", "go"]).status().unwrap().success());
    let cue: Value = serde_json::from_str(&watched.until("\"closing\"")).unwrap();
    assert!((cue["cue_time"].as_f64().unwrap() - (335.726_813_722_605 - 3.0)).abs() < 1e-9, "{cue}");
    let state = Process::start(program(name).args(["--json", "control", "state"])).output();
    assert_eq!(json_lines(&state)[0]["playback"], "paused");
    drop((run, watch, told));
}

/// Each dragon alone, in its own time.
#[test]
fn the_trade_of_two_has_both_names() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("pair.toml");
    let dragon = |name: &str, benches: u32, placement: &str| {
        format!(
            "[[dragons]]\nname = \"{name}\"\ndelay = 2.0\nplacement = {placement}\n\
             [dragons.team]\nbenches = {benches}\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n[dragons.path]\n\
             kind = \"spiral\"\npitch = 1.7\nstart_turn = 3\n[dragons.motion]\nhead_speed = 1.0\n"
        )
    };
    let jade = dragon("jade", 5, "{ origin = [40.0, 7.0], rotation_turns = 0.3 }");
    std::fs::write(&scene, dragon("gold", 4, "{ origin = [0.0, 0.0] }") + &jade).unwrap();
    let mut command = program("several_trade");
    let output = Process::start(command.arg("--scene").arg(&scene).args(["--json", "trade"])).output();
    let warned = text(&output.stderr);
    assert!(output.status.success(), "{warned}");
    assert!(warned.contains("leaves out the clearance and the contacts between dragons"), "{warned}");
    let lines = json_lines(&output);
    for name in ["gold", "jade"] {
        let own: Vec<_> = lines.iter().filter(|line| line["dragon"] == name).collect();
        assert!(own.iter().any(|line| line["solver"] == "newton"), "{lines:?}");
        for line in own.iter().filter(|line| !line["solver"].as_str().unwrap().starts_with("paper")) {
            let promised = line["accuracy"].as_f64().unwrap_or(0.0).max(1e-9);
            assert!(line["max_position_error"].as_f64().unwrap() < promised, "{line}");
        }
    }
    assert!(lines.iter().all(|line| line["dragon"].is_string()), "{lines:?}");
}

#[test]
fn what_knows_one_dragon_refuses_several_with_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("certificate");
    let file = file.to_str().unwrap();
    for arguments in [
        vec!["plan", "pitch", "--reach-radius", "4.5"],
        vec!["plan", "speed", "--max-handle-speed", "2"],
        vec!["trade", "--plot", file],
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
