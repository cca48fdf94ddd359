//! `replay` as a program: the messages of subscribers on either transport, compared with the recording byte by byte.

mod files;
mod played;
use crate::harness;
mod refused;
mod verified;

use std::path::{Path, PathBuf};
use std::process::Command;

use files::{Bytes, Kept, read};
use harness::{
    Process, answering, can_run, json_lines, program, python, python_modules, stopped, text, unique, wait,
    wait_for_bytes,
};
use nix::sys::signal::Signal;
use serde_json::Value;

/// Returns a scene of the folder `config` with the safe solver: an unoptimised build makes tables for seconds.
fn scene(folder: &Path, name: &str, queue: u32, added: &str) -> PathBuf {
    let text = std::fs::read_to_string(format!("config/{name}.toml")).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with("accuracy"));
    let text: String = lines.map(|line| format!("{line}\n")).collect();
    let text = text.replace("[motion]\n", "[motion]\nsolver = \"newton\"\n");
    assert_eq!(text.matches("[publish]\n").count(), 1);
    let file = folder.join(format!("{name}{queue}{}.toml", added.len()));
    std::fs::write(&file, text.replace("[publish]\n", &format!("[publish]\nqueue = {queue}\n")) + added).unwrap();
    file
}

fn recorder(name: &str, file: &Path) -> Process {
    let mut command = program(name);
    Process::start(command.args(["--json", "record", "--output", file.to_str().unwrap()]))
}

fn replay(name: &str, file: &Path, scene: &Path, arguments: &[&str]) -> Command {
    let mut command = program(name);
    command.args(["--json", "--scene", scene.to_str().unwrap(), "replay", file.to_str().unwrap()]).args(arguments);
    command
}

/// Returns the exit code and the response as printed.
fn control(name: &str, arguments: &[&str]) -> (i32, Value, String) {
    let output = program(name).args(["--json", "control"]).args(arguments).output().unwrap();
    let line = json_lines(&output).pop().unwrap_or(Value::Null);
    (output.status.code().unwrap(), line, text(&output.stderr))
}

/// Runs a replay, and returns its summary and the messages that a recorder received.
fn recorded_replay(name: &str, file: &Path, scene: &Path, arguments: &[&str]) -> (Value, Kept) {
    let kept = file.with_file_name(format!("{name}.mcap"));
    let recorder = recorder(name, &kept);
    let summary = harness::summary(&Process::start(&mut replay(name, file, scene, arguments)).output());
    let recorded = stopped(recorder);
    assert_eq!((&recorded["frames"], &recorded["missed"]), (&summary["frames"], &0.into()), "{recorded} {summary}");
    (summary, read(&kept))
}

/// Records a show that was paused, sought and resumed; each test has its own file.
fn conducted_recording(name: &str, folder: &Path) -> PathBuf {
    let cues = "[[cues]]\nname = \"soon\"\nat = 409.0\nthen = \"mark\"\n\n\
                [[cues]]\nname = \"the coil closes\"\nbefore = \"contact\"\nseconds = 0.5\n";
    let (scene, file) = (scene(folder, "paper", 3000, cues), folder.join("show.mcap"));
    let recorder = recorder(name, &file);
    let mut run = program(name);
    run.args(["--json", "--scene", scene.to_str().unwrap(), "run", "--rate", "50", "--start", "408.5"]);
    let publisher = Process::start(&mut run);
    wait_for_bytes(&file, 200_000);
    for command in [&["pause"][..], &["seek", "411.5"], &["resume"]] {
        let (code, line, sentence) = control(name, command);
        assert_eq!(code, 0, "{command:?}: {line} {sentence}");
        wait(0.5);
    }
    wait(1.5);
    let (summary, recorded) = (stopped(publisher), stopped(recorder));
    assert_eq!((&recorded["frames"], &recorded["missed"]), (&summary["frames"], &0.into()), "{recorded} {summary}");
    file
}

/// Asserts that frames and messages of a replay are those of the recording, except for the fields of this run.
fn assert_same(replay: &Kept, recorded: &Kept, skipped: u64) {
    let run = replay.frames[0].run_id();
    assert_ne!(run, recorded.frames[0].run_id());
    assert_eq!(replay.frames.len(), recorded.frames.len());
    let mut behind = 0;
    let first = recorded.frames[0].tick();
    for (sequence, (frame, original)) in replay.frames.iter().zip(&recorded.frames).enumerate() {
        assert_eq!((frame.run_id(), frame.sequence()), (run, sequence as u64));
        assert!(frame.from(48) == original.from(48), "frame {sequence} has other content");
        let later = (frame.tick() + first).checked_sub(original.tick()).unwrap();
        assert!(later >= behind, "frame {sequence} is {later} periods late, the one before {behind}");
        behind = later;
    }
    assert!(behind <= skipped, "{behind} periods late, {skipped} skipped");
    for (kind, ours, theirs) in [("alert", &replay.alerts, &recorded.alerts), ("cue", &replay.cues, &recorded.cues)] {
        let content = |messages: &[Bytes]| messages.iter().map(|it| it.from(24).to_vec()).collect::<Vec<_>>();
        assert_eq!(content(ours), content(theirs), "{kind}");
        for (message, original) in ours.iter().zip(theirs) {
            // The message goes with the same frame as before, or with the first.
            let at = |kept: &Kept, of: &Bytes| kept.frames.iter().position(|frame| frame.tick() >= of.u64(8));
            assert_eq!(at(replay, message), at(recorded, original), "{kind}");
            assert_eq!(message.run_id(), run);
        }
    }
    assert_eq!((replay.stages.len(), replay.stages[0].run_id()), (1, run));
    assert_eq!(replay.stages[0].from(16), recorded.stages[0].from(16));
}

#[test]
fn subscribers_get_the_show_that_was_recorded() {
    if !can_run(python_modules(&["iceoryx2", "numpy", "cyclonedds"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = conducted_recording("replay_made", folder.path());
    let recorded = read(&file);
    // On a busy machine the second cue comes before the seek too.
    let kept = [&recorded.frames, &recorded.alerts, &recorded.cues].map(Vec::len);
    assert!(kept[0] > 150 && kept[1] >= 3 && kept[2] >= 2, "{kept:?}");
    let epochs: Vec<u32> = recorded.frames.iter().map(Bytes::epoch).collect();
    assert!(epochs[0] == 0 && epochs.last() == Some(&1), "the seek is in it");

    let ros2 = "[publish.ros2]\nrate = 50\ntopics = [\"handles\", \"alerts\", \"stage\", \"status\"]\n\
                [publish.ros2.qos.handles]\ndepth = 1000\n";
    let publish = scene(folder.path(), "paper", 3000, ros2);
    let name = "replay_same";
    let transports = if cfg!(feature = "ros2") { &["iceoryx2", "ros2"][..] } else { &["iceoryx2"] };
    let peers: Vec<_> = transports
        .iter()
        .map(|transport| {
            let mut peer = python();
            peer.args(["tests/python/transport_peer.py", "--transport", transport, "--name", &unique(name)]);
            let mut peer = Process::start(peer.args(["--seconds", "300"]));
            let lines = peer.lines();
            lines.until("ready");
            (*transport, peer, lines)
        })
        .collect();
    let watch = Process::start(program(name).args(["watch", "--json"]));
    let (summary, replayed) = recorded_replay(name, &file, &publish, &[]);
    assert_eq!(summary["end"], "recording", "{summary}");
    assert_same(&replayed, &recorded, summary["skipped"].as_u64().unwrap());
    let scene = b"replay of paper\0";
    let named = |status: &Bytes| status.0.windows(scene.len()).any(|text| text == scene);
    assert!(!replayed.statuses.is_empty() && replayed.statuses.iter().all(named), "the scene's name");

    // From a time in the middle: each alert and cue still goes with its frame, whose number is different.
    let (_, later) = recorded_replay("replay_later", &file, &publish, &["--start", "411.7"]);
    let from = recorded.frames.iter().position(|frame| frame.sim_time() >= 411.7).unwrap();
    assert_eq!(later.frames.len(), recorded.frames.len() - from);
    let contact = |kept: &Kept| {
        let alert = kept.alerts.iter().find(|alert| alert.u32(88) == 2).unwrap();
        kept.frames.iter().position(|frame| frame.tick() == alert.u64(8)).unwrap()
    };
    assert_eq!(contact(&later) + from, contact(&recorded));

    let of = |line: &Value, fields: &[&str]| fields.iter().map(|field| line[*field].clone()).collect::<Vec<_>>();
    for (transport, peer, lines) in peers {
        peer.signal(Signal::SIGTERM);
        let lines: Vec<Value> = lines.rest().iter().map(|line| serde_json::from_str(line).unwrap()).collect();
        let frames: Vec<&Value> = lines.iter().filter(|line| line["type"] == "frame").collect();
        let left_out = ["skipped", "discarded"].map(|of| summary[transport][of].as_u64().unwrap_or(0));
        // While ROS 2 nodes discover one another, some messages are not sent.
        let discovery = if transport == "ros2" { 100 } else { 0 };
        let sequences: Vec<u64> = frames.iter().map(|frame| frame["sequence"].as_u64().unwrap()).collect();
        assert!(sequences.windows(2).all(|pair| pair[0] < pair[1]), "{transport}: {sequences:?}");
        let later = sequences.iter().filter(|sequence| **sequence >= discovery).count() as u64;
        let sent = recorded.frames.len() as u64 - discovery;
        assert!(later + left_out.iter().sum::<u64>() >= sent, "{transport}: {sequences:?} {summary}");
        for line in frames {
            let original = &recorded.frames[line["sequence"].as_u64().unwrap() as usize];
            assert_eq!(line["sim_time"].as_f64(), Some(original.sim_time()), "{transport}");
            let numbers = ["state", "epoch", "count"].map(|field| line[field].as_u64().unwrap() as u32);
            assert_eq!(numbers, [original.u32(76), original.epoch(), 224], "{transport}");
        }
        let last = lines.iter().rfind(|line| line["type"] == "alert").unwrap();
        assert_eq!((&last["level"], &last["event"]), (&2.into(), &2.into()), "{transport}: {last}");
    }
    watch.signal(Signal::SIGINT);
    let lines = json_lines(&watch.output());
    let alerts: Vec<_> = lines.iter().filter(|line| line["type"] == "alert").collect();
    let times: Vec<_> = alerts.iter().map(|line| line["sim_time"].as_f64().unwrap()).collect();
    assert_eq!(times, recorded.alerts.iter().map(|alert| alert.f64(24)).collect::<Vec<_>>());
    assert_eq!(of(alerts.last().unwrap(), &["level", "event"]), ["contact", "contact"]);
    let second = lines.iter().rfind(|line| line["type"] == "second").unwrap();
    assert_eq!(second["missed"], 0, "{second}");
}

#[test]
fn a_replay_can_be_watched_and_not_conducted() {
    let (name, folder) = ("replay_alone", tempfile::tempdir().unwrap());
    let (file, scene) =
        (played::small_recording("replay_small", folder.path()), scene(folder.path(), "school", 64, ""));
    let playing = answering(Process::start(&mut replay(name, &file, &scene, &["--loop"])), || program(name));
    let (code, line, _) = control(name, &["state"]);
    assert_eq!((code, &line["code"], &line["playback"]), (0, &"done".into(), &"playing".into()), "{line}");
    for command in [&["pause"][..], &["hold"], &["seek", "21"]] {
        let (code, line, sentence) = control(name, command);
        assert_eq!((code, &line["code"]), (1, &"refused".into()), "{command:?}: {line} {sentence}");
    }
    // A name has one publisher.
    let second = Process::start(&mut replay(name, &file, &scene, &[])).output();
    assert_eq!(second.status.code(), Some(1), "{}", text(&second.stderr));
    assert!(text(&second.stderr).contains("(--name)"), "{}", text(&second.stderr));
    // The page receives the replay like a show.
    let mut view = Process::start(program(name).args(["view", "--json", "--port", "0"]));
    let ready: Value = serde_json::from_str(&view.first_line()).unwrap();
    let address = ready["url"].as_str().unwrap().replace("http://", "ws://") + "frames";
    let (mut socket, _) = tungstenite::connect(address).unwrap();
    let (mut stages, mut frames) = (0, 0);
    while stages == 0 || frames == 0 {
        match socket.read().unwrap() {
            tungstenite::Message::Binary(bytes) => frames += u64::from(bytes.len() == 72 + 20 * 21),
            tungstenite::Message::Text(json) => {
                let line: Value = serde_json::from_str(&json).unwrap();
                stages += u64::from(line["type"] == "stage" && line["dragons"][0]["benches"] == 20);
            }
            _ => (),
        }
    }
    assert_eq!(stopped(playing)["end"], "signal");
}
