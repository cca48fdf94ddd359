//! The playback of a recording: gaps, start, speed and loops.

use std::path::{Path, PathBuf};

use nix::sys::signal::Signal;

use crate::control::done;
use crate::harness::{Process, program, stopped, wait_for_bytes, wait_until};
use crate::replay::files::{Bytes, Kept, read};
use crate::replay::{assert_same, recorded_replay, recorder, scene};

/// Frames per second of the recording.
const RATE: f64 = 40.0;

/// Returns a recording of some seconds of a small team.
pub fn small_recording(name: &str, folder: &Path) -> PathBuf {
    recording(name, folder, 3000, |_| wait_for_ticks(name, 100))
}

/// Waits until a show has played a number of further periods.
fn wait_for_ticks(name: &str, further: u64) {
    let tick = || done(name, &["state"])["tick"].as_u64().unwrap();
    let from = tick();
    wait_until("further periods", || tick() >= from + further);
}

/// Returns a recording of a small team, during which `meanwhile` is called with the recorder.
fn recording(name: &str, folder: &Path, queue: u32, meanwhile: impl Fn(&Process)) -> PathBuf {
    let (scene, file) = (scene(folder, "school", queue, ""), folder.join("small.mcap"));
    let recorder = recorder(name, &file);
    let mut run = program(name);
    run.args(["--json", "--scene", scene.to_str().unwrap(), "run", "--start", "20", "--rate", &RATE.to_string()]);
    let publisher = Process::start(&mut run);
    wait_for_bytes(&file, 20_000);
    meanwhile(&recorder);
    stopped(publisher);
    stopped(recorder);
    file
}

/// Asserts that each frame's period began at the time of its tick, at `rate` periods a second.
fn assert_deadlines(kept: &Kept, rate: f64) {
    let first = &kept.frames[0];
    for frame in &kept.frames {
        let expected = 1e9 * (frame.tick() - first.tick()) as f64 / rate;
        let found = frame.deadline_ns() - first.deadline_ns();
        assert!((found as f64 - expected).abs() <= 2.0, "{found} ns after the first, not {expected}");
    }
}

/// Asserts that the frames are those of the recording from `from` on, with another time scale.
fn assert_frames(kept: &[Bytes], recorded: &[Bytes], speed: f64) {
    assert_eq!(kept.len(), recorded.len());
    for (frame, original) in kept.iter().zip(recorded) {
        assert_eq!(frame.sim_time(), original.sim_time());
        assert_eq!(frame.time_scale(), original.time_scale() * speed);
        assert!(frame.standing() == original.standing(), "at {} s", frame.sim_time());
    }
}

#[test]
fn options_change_when_frames_go_out_and_never_what_they_hold() {
    let folder = tempfile::tempdir().unwrap();
    // Frames that overflow a queue of eight while the recorder is stopped are not in the file.
    let file = recording("replay_gap", folder.path(), 8, |recorder| {
        recorder.stop();
        wait_for_ticks("replay_gap", 60);
        recorder.signal(Signal::SIGCONT);
        wait_for_ticks("replay_gap", 60);
    });
    let recorded = read(&file);
    let frames = &recorded.frames;
    let gap = frames.windows(2).position(|pair| pair[1].tick() - pair[0].tick() > 20).expect("no gap");
    let publish = scene(folder.path(), "school", 3000, "");
    let play = |name: &str, arguments: &[&str]| recorded_replay(name, &file, &publish, arguments);

    let (summary, kept) = play("replay_plain", &[]);
    // A gap remains in time, but not in the count of frames.
    assert_same(&kept, &recorded, summary["skipped"].as_u64().unwrap());
    assert!(kept.frames[gap + 1].tick() - kept.frames[gap].tick() > 20);
    assert_deadlines(&kept, RATE);

    let (_, kept) = play("replay_fast", &["--time-scale", "4"]);
    assert_deadlines(&kept, 4.0 * RATE);
    assert_frames(&kept.frames, frames, 4.0);

    let (summary, kept) = play("replay_even", &["--rate", "100"]);
    assert_deadlines(&kept, 100.0);
    assert_frames(&kept.frames, frames, 100.0 / RATE);
    let periods = kept.frames.last().unwrap().tick() + 1;
    assert_eq!(periods, frames.len() as u64 + summary["skipped"].as_u64().unwrap(), "gaps are closed: {summary}");

    // From a frame in the middle: a start between two frames selects the later one.
    let middle = frames.len() / 2;
    let start = 0.5 * (frames[middle - 1].sim_time() + frames[middle].sim_time());
    let start = start.to_string();
    let (_, kept) = play("replay_start", &["--start", &start]);
    assert_frames(&kept.frames, &frames[middle..], 1.0);
    assert_eq!((kept.frames[0].tick(), kept.frames[0].sequence()), (0, 0));
    // The alert in effect at that frame, and the later alerts.
    let ahead = recorded.alerts.iter().filter(|alert| alert.u64(8) > frames[middle].tick()).count();
    let held = recorded.alerts.len() - ahead - 1;
    let content = |alerts: &[Bytes]| alerts.iter().map(|alert| alert.from(24).to_vec()).collect::<Vec<_>>();
    assert_eq!(content(&kept.alerts), content(&recorded.alerts[held..]));

    // In a loop the count of frames and periods continues, and each round is another epoch.
    let arguments = ["--start", &start, "--time-scale", "8", "--loop", "--duration", "2"];
    let (summary, kept) = play("replay_loop", &arguments);
    assert_eq!(summary["end"], "duration");
    assert_deadlines(&kept, 8.0 * RATE);
    let showing = &frames[middle..];
    assert!(kept.frames.len() > 2 * showing.len(), "{} frames", kept.frames.len());
    let epochs = showing.last().unwrap().epoch() - showing[0].epoch() + 1;
    for (number, (pair, frame)) in kept.frames.windows(2).zip(&kept.frames).enumerate() {
        assert_eq!(pair[1].sequence(), pair[0].sequence() + 1);
        assert!(pair[1].tick() > pair[0].tick());
        let original = &showing[number % showing.len()];
        assert_eq!(frame.epoch(), original.epoch() + epochs * (number / showing.len()) as u32);
        assert_frames(std::slice::from_ref(frame), std::slice::from_ref(original), 8.0);
    }
}

/// Two dragons, with the messages of their contact.
#[test]
fn a_show_of_two_is_played_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, file) = (folder.path().join("coil.toml"), folder.path().join("show.mcap"));
    let coil = include_str!("../../../config/coil.toml").replace("[publish]\n", "[publish]\nqueue = 3000\n");
    std::fs::write(&scene, coil).unwrap();
    let name = "replay_two";
    let recorder = recorder(name, &file);
    let mut run = program(name);
    let publisher = Process::start(run.args(["--json", "--scene"]).arg(&scene).args(["run", "--start", "333"]));
    wait_for_bytes(&file, 1_500_000);
    stopped(publisher);
    stopped(recorder);
    let recorded = read(&file);
    assert!(recorded.alerts.len() > 1, "the contact at 335.7 s has come");
    let (summary, kept) = recorded_replay("replay_two_again", &file, &scene, &[]);
    assert_same(&kept, &recorded, summary["skipped"].as_u64().unwrap());
}
