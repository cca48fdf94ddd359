//! `chase` with real processes: a publisher, a sender in Python, a subscriber that compares every frame. The figures of
//! the contract are asserted on simulated time in the crate; here a busy machine may delay every process.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::harness::{Lines, Process, json_lines, long, not_run, npm, program, python, text, unique};
use nix::sys::signal::Signal;

/// Returns a port that no other test has.
fn port() -> u16 {
    let socket = std::net::UdpSocket::bind(("127.0.0.1", 0)).unwrap();
    socket.local_addr().unwrap().port()
}

fn result_file(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("{}.json", unique(name)))
}

fn publisher(name: &str, arguments: &[&str]) -> Process {
    Process::start(program(name).arg("run").args(arguments))
}

fn chase(name: &str, arguments: &[&str]) -> (Process, Lines) {
    let mut process = Process::start(program(name).args(["--json", "chase"]).args(arguments));
    let lines = process.lines();
    (process, lines)
}

fn sender(name: &str, arguments: &[&str]) -> Process {
    let file = result_file(name);
    let mut command = python();
    command.args(["tests/python/chase_sender.py", "--name", &unique(name), "--result"]).arg(file).args(arguments);
    Process::start(&mut command)
}

/// Returns the result of a sender, whose chase prints `lines`.
fn result(name: &str, sender: Process, lines: &Lines) -> Value {
    let output = sender.output();
    let failure = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{failure}the chase printed {:?}", lines.so_far());
    let file = result_file(name);
    let result = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    let _ = std::fs::remove_file(file);
    println!("{name}: {result}");
    result
}

fn state(lines: &Lines, state: &str) -> Value {
    let line = lines.until(&format!("\"state\":\"{state}\""));
    serde_json::from_str(&line).unwrap()
}

fn control(name: &str, arguments: &[&str]) {
    let output = Process::start(program(name).arg("control").args(arguments)).output();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_show_follows_art_net_timecode_with_jitter_loss_and_a_stall() {
    let name = "chase_artnet";
    let port = port().to_string();
    let _publisher = publisher(name, &["--paused"]);
    let (_chase, lines) = chase(name, &["artnet", "--listen", &format!("127.0.0.1:{port}")]);
    let sender = sender(name, &["--port", &port, "--seconds", "12"]);
    let locked = state(&lines, "locked");
    assert_eq!((&locked["source"], &locked["frame_rate"]), (&"artnet".into(), &"25".into()));
    let result = result(name, sender, &lines);
    assert!(result["p99"].as_f64().unwrap() < 0.02 && result["frames"].as_u64().unwrap() > 300, "{result}");
    assert_eq!(result["epochs"], 1, "{result}");
    // The end of timecode: freewheel, then pause.
    state(&lines, "freewheeling");
    state(&lines, "lost");
}

#[test]
fn a_jump_of_timecode_is_followed() {
    let name = "chase_jump";
    let port = port().to_string();
    let _publisher = publisher(name, &[]);
    let (_chase, lines) = chase(name, &["artnet", "--listen", &format!("127.0.0.1:{port}")]);
    let sender = sender(name, &["--port", &port, "--seconds", "10", "--jump", "100"]);
    state(&lines, "locked");
    let result = result(name, sender, &lines);
    assert!(result["frames_to_follow"].as_f64().unwrap() < 12.0, "{result}");
    assert_eq!(result["epochs"], 2, "one jump: {result}");
}

/// Plays bytes of a sender into the standard input of a chase.
fn piped(name: &str, kind: &str, option: &str) {
    let _publisher = publisher(name, &["--paused"]);
    let mut command = python();
    command.args(["tests/python/chase_sender.py", option, "--seconds", "9", "--name", &unique(name), "--result"]);
    let mut sender = command.arg(result_file(name)).stdout(Stdio::piped()).spawn().unwrap();
    let mut command: Command = program(name);
    command.args(["--json", "chase", kind, "-"]).stdin(sender.stdout.take().unwrap()).stdout(Stdio::piped());
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(sender.wait().unwrap().success() && output.status.success(), "{text}");
    assert!(text.contains("\"state\":\"locked\"") && text.contains("\"frame_rate\":\"25\""), "{text}");
    // The chase ends by itself after the end of its source, when the show is paused.
    assert!(text.contains("\"state\":\"lost\"") && text.contains("\"state\":\"ended\""), "{text}");
    let stands = json_lines(&Process::start(program(name).args(["--json", "control", "state"])).output());
    assert_eq!(stands[0]["playback"], "paused", "{stands:?}");
    let file = result_file(name);
    let result: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    let _ = std::fs::remove_file(file);
    println!("{name}: {result}");
    assert!(result["mean"].as_f64().unwrap().abs() < 0.03 && result["frames"].as_u64().unwrap() > 200, "{result}");
    assert_eq!(result["epochs"], 1, "{result}");
}

#[test]
fn a_show_follows_midi_timecode_of_mido() {
    piped("chase_mtc", "mtc", "--mtc");
}

#[test]
fn a_show_follows_the_sound_of_libltc() {
    let has_libltc = python().args(["-c", "import ctypes; ctypes.CDLL('libltc.so.11')"]).output().unwrap();
    if !has_libltc.status.success() {
        return not_run("libltc is not installed (Debian: libltc11)");
    }
    piped("chase_ltc", "ltc", "--ltc");
}

#[test]
fn a_second_chase_is_refused_and_holds_and_deaths_are_told() {
    let name = "chase_manners";
    let port = port().to_string();
    let at = format!("127.0.0.1:{port}");
    let mut first = publisher(name, &["--paused"]);
    let (chased, lines) = chase(name, &["artnet", "--listen", &at]);
    let mut watch = Process::start(program(name).args(["--json", "watch"]));
    let watched = watch.lines();
    let sender = sender(name, &["--port", &port, "--seconds", "600"]);
    state(&lines, "locked");
    let second = Process::start(program(name).args(["chase", "artnet", "--listen", &at])).output();
    assert_eq!(second.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&second.stderr).contains("another chase steers the show"));
    control(name, &["hold"]);
    state(&lines, "held");
    control(name, &["release"]);
    state(&lines, "paused");
    control(name, &["resume"]);
    state(&lines, "locked");
    control(name, &["seek", "100"]);
    state(&lines, "sought");
    watched.until("\"state\":\"sought\"");
    control(name, &["pause"]);
    state(&lines, "paused");
    control(name, &["resume"]);
    state(&lines, "locked");
    // The publisher dies and comes back: the same chase follows the next run.
    first.signal(Signal::SIGKILL);
    drop(std::mem::replace(&mut first, publisher(name, &["--paused"])));
    watched.until("\"state\":\"moving\"");
    let is_locked = |line: &str| {
        let line: Value = serde_json::from_str(line).unwrap();
        line["chase"]["state"] == "locked" && line["chase"]["error"].as_f64().is_some_and(|error| error.abs() < 0.1)
    };
    watched.all_until_one(is_locked, "a locked chase");
    // A chase that is killed leaves the show at its last rate, and `watch` reports that.
    chased.signal(Signal::SIGKILL);
    let line: Value = serde_json::from_str(&watched.until("\"has_died\":true")).unwrap();
    assert_eq!(line["chase"]["state"], "locked");
    drop(sender);
}

#[test]
fn a_show_follows_the_tracker_of_another_one() {
    let (leader, follower) = ("chase_leader", "chase_follower");
    let (from, to) = (port().to_string(), port().to_string());
    // Another scene than the built-in one: the chase has its path from the show.
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/config/wide.toml");
    let _leading = publisher(leader, &["--scene", scene, "--paused", "--start", "20"]);
    let _following = publisher(follower, &["--scene", scene, "--paused", "--start", "20"]);
    let address = format!("127.0.0.1:{from}");
    let _sent = Process::start(program(leader).args(["send", "psn", "--trackers", "head", "--to", &address]));
    let (_chase, lines) = chase(follower, &["psn", "--group", &format!("127.0.0.1:{to}")]);
    let mut command = python();
    command.args(["tests/python/chase_tracker.py", "--leader", &unique(leader), "--follower", &unique(follower)]);
    command.args(["--from", &from, "--to", &to, "--seconds", "14", "--result"]).arg(result_file(follower));
    let relay = Process::start(&mut command);
    // The chase looks for the performer near the head of its own show, so the performer stands there until then.
    let locked = state(&lines, "locked");
    control(leader, &["resume"]);
    let result = result(follower, relay, &lines);
    assert_eq!((&locked["source"], &locked["tracker"]), (&"psn".into(), &1.into()));
    assert!(result["p50"].as_f64().unwrap() < 0.1, "{result}");
    assert!(result["p99"].as_f64().unwrap() < 0.5 && result["frames"].as_u64().unwrap() > 200, "{result}");
    state(&lines, "lost");
}

/// The head of jade stands where it is after 100 s of its own, which begin 5 s after the show's.
#[test]
fn a_show_of_two_follows_the_head_of_one() {
    let (leader, follower, to) = ("chase_jade", "chase_coil", port().to_string());
    let coil = include_str!("../../config/coil.toml");
    let (_, jade) = coil.split_once("delay = 5.0\n").unwrap();
    let alone = format!("[placement]\nrotation_turns = 0.5\n{}", jade.replace("[dragons.", "["));
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("jade.toml");
    std::fs::write(&scene, alone).unwrap();
    let _leading = publisher(leader, &["--scene", scene.to_str().unwrap(), "--start", "100", "--paused"]);
    let coil = concat!(env!("CARGO_MANIFEST_DIR"), "/config/coil.toml");
    let _following = publisher(follower, &["--scene", coil, "--start", "104", "--paused"]);
    let address = format!("127.0.0.1:{to}");
    let _sent = Process::start(program(leader).args(["send", "psn", "--trackers", "head", "--to", &address]));
    let (_chase, lines) = chase(follower, &["psn", "--dragon", "jade", "--group", &address]);
    state(&lines, "locked");
    let mut watch = Process::start(program(follower).args(["--json", "watch"]));
    let watched = watch.lines();
    let arrived = |line: &str| {
        let line: Value = serde_json::from_str(line).unwrap();
        line["sim_time"].as_f64().is_some_and(|time| (time - 105.0).abs() < 0.05)
    };
    watched.all_until_one(arrived, "the show at 105 s");
}

#[test]
fn the_log_of_a_chased_show_replays_bit_for_bit() {
    let name = "chase_log";
    let port = port().to_string();
    let log = result_file(name).with_extension("jsonl");
    let run = publisher(name, &["--paused", "--log", log.to_str().unwrap()]);
    let (_chase, lines) = chase(name, &["artnet", "--listen", &format!("127.0.0.1:{port}")]);
    let sender = sender(name, &["--port", &port, "--seconds", "8", "--jump", "100"]);
    state(&lines, "locked");
    result(name, sender, &lines);
    run.signal(Signal::SIGINT);
    let ended = run.output();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let verified = Process::start(program(name).args(["--json", "verify"]).arg(&log)).output();
    let verdict = String::from_utf8_lossy(&verified.stdout).into_owned();
    assert!(verified.status.success(), "{verdict}{}", String::from_utf8_lossy(&verified.stderr));
    println!("{verdict}");
    let text = std::fs::read_to_string(&log).unwrap();
    let count = |command: &str| text.lines().filter(|line| line.contains(command)).count();
    assert!(count("\"command\":\"rate\"") > 3, "a chase commands rates: {text}");
    assert!(count("\"command\":\"seek\"") > 0, "a jump is a seek: {text}");
    let _ = std::fs::remove_file(log);
}

#[test]
fn bad_options_are_refused_with_one_sentence() {
    let name = "chase_options";
    let folder = tempfile::tempdir().unwrap();
    let stereo = folder.path().join("stereo.wav");
    std::fs::write(
        &stereo,
        b"RIFF\0\0\0\0WAVEfmt \x10\0\0\0\x01\0\x02\0\x40\x1f\0\0\x80\x3e\0\0\x02\0\x08\0data\0\0\0\0",
    )
    .unwrap();
    let stereo = stereo.to_str().unwrap();
    for (arguments, expected) in [
        (&["artnet", "--fps", "23"][..], "29.97df"),
        (&["artnet", "--offset", "1:2:3"], "01:00:00:00"),
        (&["artnet", "--offset", "00:01:00:00", "--fps", "29.97df"], "no label"),
        (&["artnet", "--speed", "0"], "0.001 to 1000"),
        (&["artnet", "--freewheel", "never"], "a time above 0"),
        (&["mtc", "/nowhere/midi"], "a raw MIDI device"),
        (&["ltc", "Cargo.toml"], "RIFF WAVE"),
        (&["ltc", stereo, "--channel", "3"], "expected --channel from 1 to 2"),
        (&["psn", "--tracker", "0"], "1..=65535"),
        (&["psn", "--axes", "x,y"], "once each"),
        (&["psn", "--group", "desk.local"], "an IPv4 address"),
        (&["psn", "--scene", "config/paper.toml", "--dragon", "jade"], "has one dragon"),
        (&["psn", "--scene", "config/coil.toml"], "expected --dragon with one of gold, jade"),
        (&["psn", "--scene", "config/coil.toml", "--dragon", "rose"], "one of gold, jade"),
    ] {
        let mut command = program(name);
        command.current_dir(env!("CARGO_MANIFEST_DIR")).arg("chase").args(arguments);
        let output = Process::start(&mut command).output();
        let sentence = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {sentence}");
        assert!(sentence.contains(expected), "{arguments:?}: {sentence}");
    }
}

/// Needs node and npm, which fetches the sender: a library made by others.
#[test]
fn a_show_follows_the_art_net_timecode_of_another_library() {
    if !long() {
        return;
    }
    let (_folder, package) = match npm("@arcanewizards/artnet@0.1.8") {
        Ok(installed) => installed,
        Err(why) => return not_run(&why),
    };
    let (name, port) = ("chase_npm", port().to_string());
    let _publisher = publisher(name, &["--paused"]);
    let (_chase, lines) = chase(name, &["artnet", "--listen", &format!("127.0.0.1:{port}")]);
    let mut sender = Command::new("node");
    sender.arg("tests/python/artnet_npm.mjs").arg(package).args([&port, "8"]);
    let sender = Process::start(&mut sender);
    let locked = state(&lines, "locked");
    assert_eq!((&locked["source"], &locked["frame_rate"]), (&"artnet".into(), &"25".into()));
    let output = sender.output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    // The last label is 00:00:17:24; the show continues for the time of the freewheel.
    state(&lines, "lost");
    let shown = Process::start(program(name).args(["--json", "control", "state"])).output();
    let time = serde_json::from_slice::<Value>(&shown.stdout).unwrap()["sim_time"].as_f64().unwrap();
    assert!((17.9..22.0).contains(&time), "{time}");
}

/// Returns a chunk of PosiStageNet 2.03: the number in 16 bits, the length in 15, then whether it has chunks.
fn chunk(id: u16, has_chunks: bool, body: &[u8]) -> Vec<u8> {
    let header = u32::from(id) | (body.len() as u32) << 16 | u32::from(has_chunks) << 31;
    [&header.to_le_bytes(), body].concat()
}

#[test]
fn a_tracker_whose_sender_calls_it_invalid_is_counted_and_said_so() {
    let name = "chase_invalid";
    let port = port();
    let _publisher = publisher(name, &[]);
    let mut chase = Process::start(program(name).args(["chase", "psn", "--group", &format!("127.0.0.1:{port}")]));
    let said = chase.error_lines();
    chase.first_line();
    let mut watch = Process::start(program(name).args(["watch", "--json"]));
    let seconds = watch.lines();
    let socket = std::net::UdpSocket::bind(("127.0.0.1", 0)).unwrap();
    let position: Vec<u8> = [1.0_f32, 2.0, 0.0].iter().flat_map(|metres| metres.to_le_bytes()).collect();
    let fields = [chunk(0, false, &position), chunk(3, false, &0.0_f32.to_le_bytes())].concat();
    let packet = chunk(0x6755, true, &chunk(1, true, &chunk(1, true, &fields)));
    for _ in 0..5 {
        socket.send_to(&packet, ("127.0.0.1", port)).unwrap();
    }
    assert!(said.until("status 0").contains("tracker 1 comes with status 0"));
    let counted = |line: &str| serde_json::from_str::<Value>(line).unwrap()["chase"]["ignored"] == 5;
    let line = seconds.all_until_one(counted, "five ignored positions").pop().unwrap();
    assert_eq!(serde_json::from_str::<Value>(&line).unwrap()["chase"]["readings"], 0, "{line}");
}

#[test]
fn a_show_that_was_paused_before_gives_a_chase_no_error() {
    let name = "chase_paused";
    let port = port().to_string();
    let _publisher = crate::harness::answering(publisher(name, &["--start", "200"]), || program(name));
    control(name, &["pause"]);
    let (_chase, lines) = chase(name, &["artnet", "--listen", &format!("127.0.0.1:{port}")]);
    let _sender = sender(name, &["--port", &port, "--seconds", "12"]);
    let locked = state(&lines, "locked");
    assert!(locked["error"].is_null(), "{locked}");
    state(&lines, "paused");
}
