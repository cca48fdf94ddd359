//! A show as the master of timecode, judged by other decoders: Art-Net by the table of its protocol (and by an npm
//! package in the long run), MIDI by mido, sound by libltc. Moments are those of the published frames' deadlines.

use serde_json::Value;

use crate::control::done;
use crate::harness::{
    Lines, Process, can_run, json_lines, long, not_run, npm, program, python, python_modules, text, unique,
    wait_for_bytes,
};
use crate::send::free_port;
use nix::sys::signal::Signal;

/// Labels of a running show that are compared, and the most that are read until all of a comparison are on time.
const RUNNING: usize = 120;
const MOST_RUNNING: usize = 12_000;

/// A publisher, the sender of its timecode, and the decoder of others.
struct Heard {
    name: &'static str,
    publisher: Process,
    sender: Process,
    peer: Process,
    lines: Lines,
}

impl Heard {
    /// Starts all three. The sender's arguments end with `to`; `-` is a pipe to the peer.
    fn start(name: &'static str, send: &[&str], peer: &[&str]) -> Self {
        let publisher = Process::start(program(name).args(["run", "--start", "50", "--duration", "600"]));
        let mut decoder = python();
        decoder.args(["tests/python/timecode_peer.py", "--name", &unique(name), "--offset", "3600"]).args(peer);
        let mut command = program(name);
        command.args(["--json", "send", "timecode"]).args(send).args(["--offset", "01:00:00:00"]);
        let (sender, peer, lines) = if send.contains(&"-") {
            let (sender, mut peer) = Process::start_piped(&mut command, &mut decoder);
            let lines = peer.lines();
            (sender, peer, lines)
        } else {
            let mut peer = Process::start(&mut decoder);
            let lines = peer.lines();
            lines.until("listening");
            (Process::start(&mut command), peer, lines)
        };
        Self { name, publisher, sender, peer, lines }
    }

    fn label(&self, is_it: impl Fn(&Value) -> bool, what: &str) -> Value {
        let lines = self.lines.all_until_one(|line| is_it(&serde_json::from_str(line).unwrap()), what);
        serde_json::from_str(lines.last().unwrap()).unwrap()
    }

    /// Asserts that labels come to have their moments within 1 ms, and to run within 100 ppm of the show. A busy machine
    /// delays messages, and may make the sender leave out sound, so this reads on until a stretch of labels is on time.
    fn runs_on_time(&self) {
        let is_running = |label: &Value| label["kind"] == "running" && label["late"].is_f64();
        let number = |label: &Value, field: &str| label[field].as_f64().unwrap();
        let (mut labels, mut fault) = (Vec::new(), String::new());
        while labels.len() < MOST_RUNNING {
            let label = self.label(is_running, "a running label");
            labels.push((number(&label, "late"), number(&label, "moment")));
            if labels.len() >= RUNNING && labels.len().is_multiple_of(RUNNING / 3) {
                match times_of(&labels[labels.len() - RUNNING..]) {
                    (false, found) => fault = found,
                    (true, found) => return println!("{}: after {} labels {found}", self.name, labels.len()),
                }
            }
        }
        panic!("{}: not on time in {MOST_RUNNING} labels: {fault}", self.name);
    }

    /// Pauses the show; returns its time in seconds.
    fn pause(&self) -> f64 {
        done(self.name, &["pause"])["sim_time"].as_f64().unwrap()
    }

    /// Ends the sender by a signal; asserts its exit code, and returns what it prints.
    fn end(self) -> (Vec<u8>, Vec<u8>) {
        self.sender.signal(Signal::SIGINT);
        let sent = self.sender.output();
        assert!(sent.status.success(), "{}", text(&sent.stderr));
        drop((self.peer, self.publisher));
        (sent.stdout, sent.stderr)
    }
}

/// Returns whether labels, each with its delay and its moment, are on time, and how far they are off. The least delays
/// show the moments of the sender. The median excludes labels that wait for the next frame of the show: that would be
/// 8 ms.
fn times_of(labels: &[(f64, f64)]) -> (bool, String) {
    let least = |labels: &[(f64, f64)]| labels.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    let third = labels.len() / 3;
    let (first, last) = (least(&labels[..third]), least(&labels[2 * third..]));
    let drift = (last.0 - first.0) / (last.1 - first.1);
    let mut late = Vec::from_iter(labels.iter().map(|label| label.0));
    late.sort_by(f64::total_cmp);
    let (least, median) = (late[0], late[labels.len() / 2]);
    let is_on_time = least.abs() < 1e-3 && median < 5e-3 && drift.abs() < 1e-4;
    (is_on_time, format!("{:.3} ms, median {:.3} ms, {:.1} ppm", 1e3 * least, 1e3 * median, 1e6 * drift))
}

/// Returns the label of a simulated time at 25 frames per second, an hour later.
fn label_of(sim_time: f64) -> String {
    let frames = (sim_time * 25.0 + 1e-6).floor() as u32;
    let (seconds, frames) = (frames / 25, frames % 25);
    format!("01:{:02}:{:02}:{frames:02}", seconds / 60, seconds % 60)
}

#[test]
fn art_net_has_each_label_at_its_moment_and_repeats_it_while_the_show_stands() {
    let port = free_port().to_string();
    let to = format!("127.0.0.1:{port}");
    let heard = Heard::start("timecode_artnet", &["artnet", "--to", &to, "--fps", "25"], &["--port", &port]);
    heard.runs_on_time();
    let expected = label_of(heard.pause());
    // Labels that were sent before the frame that pauses came may be heard after it.
    heard.label(|label| label["late"].is_null() && label["label"] == expected.as_str(), &expected);
    let labels = Vec::from_iter((0..9).map(|_| heard.label(|_| true, "a label")["label"].clone()));
    assert!(labels.iter().all(|label| *label == expected), "{labels:?}, expected {expected}");
    done(heard.name, &["seek", "200"]);
    heard.label(|label| label["label"] == "01:03:20:00", "the label of 200 s");
    done(heard.name, &["resume"]);
    heard.runs_on_time();
    let (printed, _) = heard.end();
    let summary: Value = serde_json::from_slice(&printed).unwrap();
    assert_eq!(
        (&summary["jumps"], summary["sent"].as_u64() > Some(2 * RUNNING as u64)),
        (&2.into(), true),
        "{summary}"
    );
}

#[test]
fn mido_hears_quarter_frames_and_full_frames() {
    if !can_run(python_modules(&["mido"])) {
        return;
    }
    let peer = ["--mtc", "--fps", "29.97", "--drop", "--offset", "3599.9964"];
    let heard = Heard::start("timecode_mtc", &["mtc", "-", "--fps", "29.97df"], &peer);
    // 50 s are 1,498.5 frames, or a little later: the first full frame.
    let first = heard.label(|label| label["kind"] == "located", "a full frame");
    assert!(first["label"].as_str() >= Some("01:00:49:28"), "{first}");
    heard.runs_on_time();
    heard.pause();
    heard.label(|label| label["kind"] == "located", "a full frame at the pause");
    done(heard.name, &["seek", "200"]);
    let sought = heard.label(|label| label["kind"] == "located", "a full frame after the seek");
    // 5,994 frames, and six labels that drop frame leaves out.
    assert_eq!(sought["label"], "01:03:20:00");
    done(heard.name, &["resume"]);
    heard.runs_on_time();
    // Standard output has nothing else than timecode, which mido would refuse.
    heard.end();
}

fn libltc() -> Result<(), String> {
    let found = python().args(["-c", "import ctypes; ctypes.CDLL('libltc.so.11')"]).output().unwrap();
    if found.status.success() { Ok(()) } else { Err("libltc is not installed (Debian: libltc11)".to_owned()) }
}

#[test]
fn libltc_hears_the_sound_of_each_label_at_its_moment() {
    if !can_run(libltc()) {
        return;
    }
    let heard = Heard::start("timecode_ltc", &["ltc", "-", "--fps", "25"], &["--ltc"]);
    heard.runs_on_time();
    let expected = label_of(heard.pause());
    // A frame of sound is complete when the next begins, and the one that the pause cuts is none.
    let is_standing = |label: &Value| label["late"].is_null() && label["label"] == expected.as_str();
    (0..10).for_each(|_| drop(heard.label(is_standing, &expected)));
    done(heard.name, &["seek", "200"]);
    heard.label(|label| label["label"] == "01:03:20:00", "the label of 200 s");
    done(heard.name, &["resume"]);
    heard.runs_on_time();
    heard.end();
}

#[test]
fn a_file_of_sound_is_complete_and_has_the_rate_of_film_on_video() {
    if !can_run(libltc()) {
        return;
    }
    let name = "timecode_file";
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("show.wav");
    let _publisher = Process::start(program(name).args(["run", "--start", "50", "--duration", "600"]));
    let mut send = program(name);
    send.args(["--json", "send", "timecode", "ltc", "--fps", "23.976"]).arg(&file);
    let sender = Process::start(&mut send);
    wait_for_bytes(&file, 300_000);
    sender.signal(Signal::SIGTERM);
    let sent = json_lines(&sender.output()).pop().unwrap();
    // Python's own reader of WAV, and the decoder of libltc at the samples that 23.976 frames per second have.
    let script = "import sys, wave; w = wave.open(sys.argv[1]); \
                  print(w.getnchannels(), w.getsampwidth(), w.getframerate(), w.getnframes())";
    let read = python().args(["-c", script]).arg(&file).output().unwrap();
    let samples = (std::fs::metadata(&file).unwrap().len() - 44) / 2;
    assert_eq!(text(&read.stdout).trim(), format!("1 2 48000 {samples}"), "{}", text(&read.stderr));
    let mut decoder = python();
    decoder.args(["tests/python/timecode_peer.py", "--name", &unique(name), "--ltc", "--fps", "23.976"]);
    let decoded = decoder.stdin(std::fs::File::open(&file).unwrap()).output().unwrap();
    let labels = Vec::from_iter(text(&decoded.stdout).lines().map(|line| serde_json::from_str::<Value>(line).unwrap()));
    assert!(labels.len() as u64 + 3 >= sent["sent"].as_u64().unwrap(), "{sent}: {} labels", labels.len());
    let [first, last] = [&labels[1], labels.last().unwrap()].map(|label| label["moment"].as_f64().unwrap());
    let frame = (last - first) / (labels.len() - 2) as f64;
    assert!((frame * 24_000.0 / 1001.0 - 1.0).abs() < 1e-4, "{frame} s a frame");
}

#[test]
fn one_show_follows_the_timecode_of_another() {
    let (leader, follower) = ("timecode_leader", "timecode_follower");
    let to = format!("127.0.0.1:{}", free_port());
    let _leading = Process::start(program(leader).args(["run", "--start", "100", "--duration", "600"]));
    let _following = Process::start(program(follower).args(["run", "--paused", "--duration", "600"]));
    let mut chase = Process::start(program(follower).args(["--json", "chase", "artnet", "--listen", &to]));
    let lines = chase.lines();
    let _sending = Process::start(program(leader).args(["send", "timecode", "artnet", "--to", &to]));
    lines.until("\"state\":\"locked\"");
    done(leader, &["seek", "250.5"]);
    done(leader, &["pause"]);
    // The label stands, so the follower stands at its place without the time of a freewheel.
    lines.until("\"state\":\"standing\"");
    let [led, follows] = [leader, follower].map(|name| done(name, &["state"])["sim_time"].as_f64().unwrap());
    assert!((follows - led).abs() < 0.1, "{follows} s for {led} s");
}

#[test]
fn bad_options_are_refused_with_one_sentence() {
    for (arguments, expected) in [
        (&["artnet", "--to", "127.0.0.1:0"][..], "expected an address"),
        (&["artnet", "--to", "127.0.0.1", "--fps", "auto"], "expected 23.976, 24, 25, 29.97, 29.97df or 30"),
        (&["artnet", "--to", "127.0.0.1", "--offset", "00:01:00:00", "--fps", "29.97df"], "no label"),
        (&["mtc", "/nowhere/midi"], "expected a raw MIDI device"),
        (&["ltc", "/nowhere/show.wav"], "/nowhere/show.wav"),
    ] {
        let output = Process::start(program("timecode_options").args(["send", "timecode"]).args(arguments)).output();
        let sentence = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {sentence}");
        assert!(sentence.contains(expected), "{arguments:?}: {sentence}");
    }
}

/// Needs node and npm, which fetches the receiver: a library made by others.
#[test]
fn another_library_of_art_net_hears_each_label() {
    if !long() {
        return;
    }
    let (_folder, package) = match npm("@arcanewizards/artnet@0.1.8") {
        Ok(installed) => installed,
        Err(why) => return not_run(&why),
    };
    let port = free_port().to_string();
    let to = format!("127.0.0.1:{port}");
    let peer = ["--port", &port, "--npm", package.to_str().unwrap()];
    let heard = Heard::start("timecode_npm", &["artnet", "--to", &to, "--fps", "25"], &peer);
    heard.runs_on_time();
}
