//! `replay` as a program: the messages of subscribers on either transport, compared with the recording byte by byte.

mod files;
mod played;
use crate::control::{control, done};
use crate::harness;
mod refused;
mod verified;

use std::path::{Path, PathBuf};
use std::process::Command;

use files::{Bytes, Kept, read};
use harness::{
    Process, answering, can_run, program, python, python_modules, stopped, text, unique, wait_for_bytes, wait_until,
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

/// Returns a recorder that waits for frames.
fn recorder(name: &str, file: &Path) -> Process {
    let mut command = program(name);
    command.args(["--json", "record", "--force", "--output", file.to_str().unwrap()]);
    let mut recorder = Process::start(&mut command);
    recorder.until_error("Recording");
    recorder
}

fn replay(name: &str, file: &Path, scene: &Path, arguments: &[&str]) -> Command {
    let mut command = program(name);
    command.args(["--json", "--scene", scene.to_str().unwrap(), "replay", file.to_str().unwrap()]).args(arguments);
    command
}

/// Runs a replay, and returns its summary and the messages that a recorder received, from the frame on at which it
/// connected.
fn recorded_from_somewhere(name: &str, file: &Path, scene: &Path, arguments: &[&str]) -> (Value, Kept) {
    let kept = file.with_file_name(format!("{name}.mcap"));
    let recorder = recorder(name, &kept);
    let summary = harness::summary(&Process::start(&mut replay(name, file, scene, arguments)).output());
    let recorded = stopped(recorder);
    let kept = read(&kept);
    let frames = kept.frames[0].sequence() + kept.frames.len() as u64;
    assert_eq!((Some(frames), &recorded["missed"]), (summary["frames"].as_u64(), &0.into()), "{recorded} {summary}");
    (summary, kept)
}

/// Returns the same from the first frame on. A replay gives its subscribers half a second to connect; a recorder that
/// the machine does not run in that time gets another replay.
fn recorded_replay(name: &str, file: &Path, scene: &Path, arguments: &[&str]) -> (Value, Kept) {
    let mut replays = (0..5).map(|_| recorded_from_somewhere(name, file, scene, arguments));
    replays.find(|(_, kept)| kept.frames[0].sequence() == 0).expect("the first frame, in one of five replays")
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
    let ticks = |name: &str| done(name, &["state"])["tick"].as_u64().unwrap();
    for command in [&["pause"][..], &["seek", "411.5"], &["resume"]] {
        let from = done(name, command)["tick"].as_u64().unwrap();
        wait_until("half a second of the show", || ticks(name) >= from + 25);
    }
    wait_until("the contact", || done(name, &["state"])["playback"] == "ended");
    let ended = ticks(name);
    wait_until("a second after it", || ticks(name) >= ended + 50);
    stopped(publisher);
    let recorded = stopped(recorder);
    assert_eq!(recorded["missed"], 0, "{recorded}");
    file
}

/// Returns the messages that a subscriber gets which connects at a frame: the latest before it, and the later ones.
fn in_force_from<'a>(frame: &Bytes, messages: &'a [Bytes]) -> &'a [Bytes] {
    let before = messages.partition_point(|message| message.u64(8) <= frame.tick());
    &messages[before.saturating_sub(1)..]
}

/// Asserts that frames and messages of a replay are those of the recording, except for the fields of this run. The
/// subscriber of the replay may have connected at a later frame than the first.
fn assert_same(replay: &Kept, recorded: &Kept, skipped: u64) {
    let run = replay.frames[0].run_id();
    assert_ne!(run, recorded.frames[0].run_id());
    let from = replay.frames[0].sequence() as usize;
    let frames = &recorded.frames[from..];
    assert_eq!(replay.frames.len(), frames.len());
    let mut behind = 0;
    let first = recorded.frames[0].tick();
    for (sequence, (frame, original)) in replay.frames.iter().zip(frames).enumerate() {
        assert_eq!((frame.run_id(), frame.sequence()), (run, (from + sequence) as u64));
        assert!(frame.from(48) == original.from(48), "frame {sequence} has other content");
        let later = (frame.tick() + first).checked_sub(original.tick()).unwrap();
        assert!(later >= behind, "frame {sequence} is {later} periods late, the one before {behind}");
        behind = later;
    }
    assert!(behind <= skipped, "{behind} periods late, {skipped} skipped");
    for (kind, ours, theirs) in [("alert", &replay.alerts, &recorded.alerts), ("cue", &replay.cues, &recorded.cues)] {
        let theirs = if from == 0 { theirs } else { in_force_from(&frames[0], theirs) };
        let content = |messages: &[Bytes]| messages.iter().map(|it| it.from(24).to_vec()).collect::<Vec<_>>();
        assert_eq!(content(ours), content(theirs), "{kind}");
        for (message, original) in ours.iter().zip(theirs) {
            // The message goes with the same frame as before, or with the first.
            let at = |frames: &[Bytes], of: &Bytes| frames.iter().position(|frame| frame.tick() >= of.u64(8));
            assert_eq!(at(&replay.frames, message), at(frames, original), "{kind}");
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
    let mut watch = Process::start(program(name).args(["watch", "--json"]));
    let watched = watch.lines();
    watched.until("waiting");
    let (summary, replayed) = recorded_from_somewhere(name, &file, &publish, &[]);
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
        let sequences: Vec<u64> = frames.iter().map(|frame| frame["sequence"].as_u64().unwrap()).collect();
        assert!(sequences.windows(2).all(|pair| pair[0] < pair[1]), "{transport}: {sequences:?}");
        // While ROS 2 nodes discover one another, some messages are not sent.
        let discovery = sequences[0] + if transport == "ros2" { 100 } else { 0 };
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
    let lines: Vec<Value> = watched.rest().iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    let alerts: Vec<_> = lines.iter().filter(|line| line["type"] == "alert").collect();
    let times: Vec<_> = alerts.iter().map(|line| line["sim_time"].as_f64().unwrap()).collect();
    // A late subscriber gets the alert in force, and the later ones.
    let all: Vec<_> = recorded.alerts.iter().map(|alert| alert.f64(24)).collect();
    assert!(!times.is_empty() && all.ends_with(&times), "{times:?} of {all:?}");
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
