//! `record` and `record --recover`, as programs: read by Python's own MCAP libraries, cut, killed, on a full disk, on a
//! disk that accepts nothing.

#[path = "record/mending.rs"]
mod mending;
use crate::control::done;
use crate::harness;
#[path = "record/recorder.rs"]
mod recorder_alone;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

use harness::{
    Process, can_run, json_lines, long, program, python, python_modules, root, stopped, text, unique, wait,
    wait_for_bytes, wait_until,
};
use mcap::{MessageStream, Summary};
use nix::sys::signal::Signal;
use serde_json::Value;

/// Returns a scene of the folder `config` whose subscribers may fall behind by 6,000 frames. It has the safe solver: an
/// unoptimised build makes tables for seconds.
fn scene(folder: &Path, name: &str, added: &str) -> PathBuf {
    let text = std::fs::read_to_string(format!("config/{name}.toml")).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with("accuracy"));
    let text: String = lines.map(|line| format!("{line}\n")).collect();
    let text = text.replace("[motion]\n", "[motion]\nsolver = \"newton\"\n");
    assert_eq!(text.matches("[publish]\n").count(), 1);
    let file = folder.join(format!("{name}.toml"));
    std::fs::write(&file, text.replace("[publish]\n", "[publish]\nsubscribers = 4\nqueue = 6000\n") + added).unwrap();
    file
}

fn publisher(name: &str, scene: &Path, arguments: &[&str]) -> Process {
    let mut command = program(name);
    command.args(["--json", "--scene", scene.to_str().unwrap(), "run"]).args(arguments);
    Process::start(&mut command)
}

/// Returns a recorder that waits for frames.
fn recorder(name: &str, file: &Path, arguments: &[&str]) -> Process {
    let program = program(name);
    // Under nohup the tests ignore SIGHUP, and the recorder would ignore it too.
    let mut command = Command::new("env");
    command.arg("--default-signal=HUP").arg(program.get_program()).args(program.get_args());
    command.args(["--json", "record", "--output", file.to_str().unwrap()]).args(arguments);
    let mut recorder = Process::start(&mut command);
    recorder.until_error("Recording");
    recorder
}

fn files(summary: &Value) -> Vec<PathBuf> {
    summary["files"].as_array().unwrap().iter().map(|file| PathBuf::from(file.as_str().unwrap())).collect()
}

/// A message: topic, sequence, log time, and the hash of its data.
type Entry = (String, u64, u64, String);

/// Returns the messages of a complete file, in the order of the file.
fn entries(file: &[u8]) -> Vec<Entry> {
    assert!(Summary::read(file).unwrap().is_some(), "a file without a summary");
    let entry = |message: mcap::Message<'_>| {
        let hash = blake3::hash(&message.data).to_hex().to_string();
        (message.channel.topic.clone(), message.sequence.into(), message.log_time, hash)
    };
    MessageStream::new(file).unwrap().map(|message| entry(message.unwrap())).collect()
}

/// Returns the log times of the frames in a file.
fn frame_times(file: &Path) -> Vec<u64> {
    let entries = entries(&std::fs::read(file).unwrap());
    entries.into_iter().filter(|entry| entry.0.ends_with("/handles")).map(|entry| entry.2).collect()
}

/// Asserts that a recording has every frame of a publisher, except frames sent before the recorder connected.
fn check_whole(recorded: &Value, published: &Value) {
    let entries = entries(&std::fs::read(&files(recorded)[0]).unwrap());
    let sequences: Vec<_> = entries.iter().filter(|entry| entry.0.ends_with("/handles")).map(|entry| entry.1).collect();
    let numbers = |value: &Value, field: &str| value[field].as_u64().unwrap();
    assert_eq!((sequences.len() as u64, numbers(recorded, "missed")), (numbers(recorded, "frames"), 0), "{recorded}");
    assert_eq!(sequences[0] + sequences.len() as u64, numbers(published, "frames"), "{recorded} {published}");
    assert!(sequences.windows(2).all(|pair| pair[1] == pair[0] + 1), "it begins at {}", sequences[0]);
}

/// Returns the number of finished chunks in a file that a recorder still writes.
fn finished_chunks(file: &Path) -> usize {
    let bytes = std::fs::read(file).unwrap_or_default();
    // The last record may not be whole.
    let starts = mending::record_starts(&bytes);
    starts.iter().rev().skip(1).filter(|at| bytes[**at] == mcap::records::op::CHUNK).count()
}

/// Returns a recording of some seconds of a small team, whose terminal is closed at the end.
fn small_recording(name: &str, folder: &Path) -> PathBuf {
    let file = folder.join("small.mcap");
    let recorder = recorder(name, &file, &[]);
    let publisher = publisher(name, &scene(folder, "school", ""), &["--rate", "40", "--start", "20"]);
    wait_until("finished chunks", || finished_chunks(&file) >= 10);
    stopped(publisher);
    recorder.signal(Signal::SIGHUP);
    assert_eq!(files(&harness::summary(&recorder.output())), std::slice::from_ref(&file));
    file
}

#[test]
fn every_message_of_every_topic_is_what_another_subscriber_got() {
    if !can_run(python_modules(&["blake3", "iceoryx2", "mcap", "mcap_ros2", "rosbags"])) {
        return;
    }
    let (name, folder) = ("record_equal", tempfile::tempdir().unwrap());
    let cues = "[[cues]]\nname = \"soon\"\nat = 409.0\nthen = \"mark\"\n\n\
                [[cues]]\nname = \"the coil closes\"\nbefore = \"contact\"\nseconds = 2.0\n";
    let scene = scene(folder.path(), "paper", cues);
    let (file, kept) = (folder.path().join("show.mcap"), folder.path().join("kept"));
    let peer = |what: &str, more: &[&str]| {
        let mut peer = python();
        peer.args(["tests/python/record_peer.py", what, "--name", &unique(name), "--kept", kept.to_str().unwrap()]);
        Process::start(peer.args(more))
    };
    let mut subscriber = peer("subscribe", &[]);
    let kept_frames = subscriber.lines();
    kept_frames.until("ready");
    let every = "handles,poses,alerts,stage,diagnostics,markers,status,path,cues,clock,tf";
    let recorder = recorder(name, &file, &["--topics", every]);
    // The show moves when both subscribers have frames.
    let publisher = publisher(name, &scene, &["--rate", "50", "--start", "408", "--paused"]);
    kept_frames.until("frame");
    wait_for_bytes(&file, 1);
    done(name, &["resume"]);
    wait_until("the contact", || done(name, &["state"])["playback"] == "ended");
    let summary = stopped(publisher);
    assert!(subscriber.output().status.success());
    let recorded = stopped(recorder);
    check_whole(&recorded, &summary);
    assert_eq!(recorded["bytes"].as_u64(), Some(std::fs::metadata(&file).unwrap().len()));
    let output = peer("compare", &["--recordings", file.to_str().unwrap()]).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let counts = json_lines(&output).pop().unwrap();
    assert_eq!(counts.as_object().unwrap().len(), 11, "{counts}");
    let alerts = counts[format!("/{}/alerts", unique(name))].as_u64().unwrap();
    let cues = counts[format!("/{}/cues", unique(name))].as_u64().unwrap();
    assert!(alerts >= 3 && cues == 2, "{counts}");
}

#[test]
fn a_recorder_whose_disk_takes_nothing_can_be_stopped() {
    let (name, folder) = ("record_stuck", tempfile::tempdir().unwrap());
    let _publisher = publisher(name, &scene(folder.path(), "paper", ""), &["--rate", "1000", "--start", "100"]);
    // An open pipe without a reader.
    let pipe = folder.path().join("pipe.mcap");
    nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).unwrap();
    let _open = std::fs::OpenOptions::new().read(true).write(true).open(&pipe).unwrap();
    let recorder = recorder(name, &pipe, &["--force"]);
    // The memory of a full queue does not grow.
    let status = format!("/proc/{}/status", recorder.id());
    let kilobytes = || {
        let status = std::fs::read_to_string(&status).unwrap();
        let line = status.lines().find(|line| line.starts_with("RssAnon:")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap()
    };
    let (mut before, mut now) = (0, kilobytes());
    for _ in 0..60 {
        if now > 60_000 && now < before + 100 {
            break;
        }
        wait(2.0);
        (before, now) = (now, kilobytes());
    }
    assert!(now > 60_000 && now < before + 100, "{before} kB, then {now} kB");
    recorder.signal(Signal::SIGINT);
    let output = recorder.output();
    let sentence = text(&output.stderr);
    assert!(output.status.code() == Some(1) && sentence.contains("nothing could be written for 30 s"), "{sentence}");
}

#[test]
fn a_recorder_that_is_killed_loses_a_second_and_nobody_notices() {
    let (name, folder) = ("record_killed", tempfile::tempdir().unwrap());
    let publisher = publisher(name, &scene(folder.path(), "school", ""), &["--rate", "100", "--loop"]);
    let mut random = fastrand::Rng::with_seed(19);
    let mut losses = Vec::new();
    let mut last = 0;
    for round in 0..if long() { 100 } else { 5 } {
        let file = folder.path().join(format!("killed{round}.mcap"));
        let recorder = recorder(name, &file, &[]);
        wait_for_bytes(&file, 1000);
        wait(1.0 + random.f64() * 2.0);
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
        recorder.signal(Signal::SIGKILL);
        recorder.output();
        let output = program(name).args(["--json", "record", "--recover", file.to_str().unwrap()]).output().unwrap();
        let counts = harness::summary(&output);
        let mended = folder.path().join(format!("killed{round}-recovered.mcap"));
        assert_eq!((counts["output"].as_str(), &counts["damaged"]), (mended.to_str(), &0.into()), "{counts}");
        let times = frame_times(&mended);
        assert!(times[0] > last && times.windows(2).all(|pair| pair[1] > pair[0]), "frames of round {round}");
        last = *times.last().unwrap();
        losses.push(now.saturating_sub(last) as f64 / 1e9);
    }
    // Under nohup the end of the terminal does not end the recorder.
    let file = folder.path().join("nohup.mcap");
    let mut nohup = Command::new("bash");
    nohup.args(["-c", "trap '' HUP; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_bench-dragon")]);
    nohup.args(["--name", &unique(name), "--json", "record", "--output", file.to_str().unwrap()]);
    let recorder = Process::start(&mut nohup);
    wait_for_bytes(&file, 1);
    recorder.signal(Signal::SIGHUP);
    wait_for_bytes(&file, std::fs::metadata(&file).unwrap().len() + 100_000);
    stopped(recorder);
    publisher.signal(Signal::SIGINT);
    let summary = harness::summary(&publisher.output());
    assert_eq!(summary["end"], "signal", "{summary}");
    losses.sort_by(f64::total_cmp);
    harness::aloud(&format!(
        "lost by {} kills: median {:.2} s, most {:.2} s",
        losses.len(),
        losses[losses.len() / 2],
        losses[losses.len() - 1]
    ));
    // A loaded machine stops a recorder for seconds; a recorder that wrote only at the end would lose two in the
    // middle.
    assert!(losses[losses.len() / 2] < 1.2 && losses[losses.len() - 1] < 5.0, "{losses:?}");
}

/// Checks a recording on a disk that became full: the file is whole up to that point.
fn check_full(recorder: Process, file: &Path) {
    let output = recorder.output();
    let sentence = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{sentence}");
    let error = sentence.lines().find(|line| line.starts_with("error")).unwrap();
    assert!(error.contains(": the recording ends there, the file is whole up to there"), "{sentence}");
    let (summary, times) = (json_lines(&output).pop().unwrap(), frame_times(file));
    assert!(times.len() > 20 && summary["frames"].as_u64() == Some(times.len() as u64), "{summary} {}", times.len());
    assert_eq!(summary["bytes"].as_u64(), Some(std::fs::metadata(file).unwrap().len()));
}

#[test]
fn a_full_disk_leaves_a_whole_file() {
    let (name, folder) = ("record_full", tempfile::tempdir().unwrap());
    let _publisher = publisher(name, &scene(folder.path(), "paper", ""), &["--rate", "100", "--start", "100"]);
    // A file limited to 4 MB.
    let file = folder.path().join("limited.mcap");
    let mut limited = Command::new("bash");
    limited.args(["-c", "ulimit -f 4000; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_bench-dragon")]);
    limited.args(["--name", &unique(name), "--json", "record", "--output", file.to_str().unwrap()]);
    check_full(Process::start(&mut limited), &file);
    // A device that accepts nothing.
    let output = recorder(name, Path::new("/dev/full"), &["--force"]).output();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("/dev/full: No space left on device"), "{}", text(&output.stderr));
    // A disk of 5 MB.
    if !can_run(root("make a small disk")) {
        return;
    }
    let disk = folder.path().join("disk");
    std::fs::create_dir(&disk).unwrap();
    let mount =
        |arguments: &[&str]| assert!(Command::new(arguments[0]).args(&arguments[1..]).status().unwrap().success());
    mount(&["mount", "-t", "tmpfs", "-o", "size=5m", "tmpfs", disk.to_str().unwrap()]);
    let file = disk.join("full.mcap");
    let checked = std::panic::catch_unwind(|| check_full(recorder(name, &file, &[]), &file));
    mount(&["umount", "--lazy", disk.to_str().unwrap()]);
    checked.unwrap();
}

#[test]
fn files_are_split_by_size_by_time_and_by_run() {
    let (name, folder) = ("record_split", tempfile::tempdir().unwrap());
    let scene = scene(folder.path(), "paper", "");
    let (by_size, by_time) = (folder.path().join("size.mcap"), folder.path().join("time.mcap"));
    // A file of another program.
    std::fs::write(folder.path().join("size-2.mcap"), "kept").unwrap();
    let recorders = [
        recorder(name, &by_size, &["--split", "1MB"]),
        recorder(name, &by_time, &["--split", "2s", "--topics", "handles,stage"]),
    ];
    let begun = |name: &str| {
        let files = std::fs::read_dir(folder.path()).unwrap().flatten();
        files.filter(|file| file.file_name().to_str().unwrap().starts_with(name)).count()
    };
    for run in 1..=2 {
        let publisher = publisher(name, &scene, &["--rate", "50", "--start", "100"]);
        // With the file of another program, and after the files of the run before.
        wait_until("files", || begun("size") > 2 * run && begun("time") >= 3 * run);
        stopped(publisher);
    }
    let [size, time] = recorders.map(stopped);
    assert_eq!(std::fs::read(folder.path().join("size-2.mcap")).unwrap(), b"kept");
    let names: Vec<_> =
        files(&size).iter().map(|file| file.file_name().unwrap().to_str().unwrap().to_owned()).collect();
    // Two runs are two files; the number of splits depends on the number of frames that the machine had time for.
    let count = names.len();
    assert!(count >= 3 && names[..2] == ["size.mcap", "size-3.mcap"], "{names:?}");
    assert!(files(&time).len() >= 6, "{time}");
    assert_eq!((&size["missed"], &time["missed"]), (&0.into(), &0.into()), "{size} {time}");
    for (summary, topics) in [(&size, 7), (&time, 2)] {
        let mut sequences = Vec::new();
        for file in files(summary) {
            let bytes = std::fs::read(&file).unwrap();
            assert!(bytes.len() <= 1_000_000 || topics == 2, "{}: {} bytes", file.display(), bytes.len());
            let entries = entries(&bytes);
            let first = entries.iter().find(|entry| entry.0.ends_with("/stage"));
            assert!(first.is_some(), "{} has no stage", file.display());
            let mut frames = entries.iter().filter(|entry| entry.0.ends_with("/handles")).peekable();
            let began = frames.peek().unwrap().2;
            assert!(entries.iter().all(|entry| entry.2 >= began), "{} has a time before its frames", file.display());
            let frames: Vec<_> = frames.collect();
            let lasted = frames.last().unwrap().2 - began;
            assert!(lasted < 2_000_000_000 || topics == 7, "{}: {lasted} ns", file.display());
            sequences.extend(frames.iter().map(|entry| entry.1));
        }
        let restarts = sequences.windows(2).filter(|pair| pair[1] != pair[0] + 1).count();
        assert_eq!((restarts, sequences.len() as u64), (1, summary["frames"].as_u64().unwrap()), "{summary}");
    }
}

/// The recorder waits for a stage that comes after the first frames: without the stage the recording cannot be
/// replayed.
#[test]
fn the_shortest_recording_has_its_stage() {
    let (name, folder) = ("record_short", tempfile::tempdir().unwrap());
    let scene = scene(folder.path(), "school", "");
    let publisher = publisher(name, &scene, &["--rate", "200"]);
    let mut recorded = 0;
    // The shortest duration depends on the machine: until a recorder has begun there is nothing in its file.
    for round in 0.. {
        let file = folder.path().join(format!("{round}.mcap"));
        let seconds = (0.05 + 0.02 * f64::from(round)).to_string();
        let output = recorder(name, &file, &["--duration", &seconds]).output();
        if output.status.success() {
            let entries = entries(&std::fs::read(&file).unwrap());
            assert!(entries.iter().any(|entry| entry.0.ends_with("/stage")), "{seconds} s: {}", entries.len());
            recorded += 1;
        }
        if recorded == 6 {
            break;
        }
        assert!(round < 100, "{recorded} recorders of {round} recorded something: {}", text(&output.stderr));
    }
    publisher.signal(Signal::SIGINT);
    publisher.output();
}

#[test]
fn a_thousand_frames_a_second_are_recorded_without_a_gap() {
    let (name, folder) = ("record_fast", tempfile::tempdir().unwrap());
    let scene = scene(folder.path(), "paper", "");
    let file = folder.path().join("fast.mcap");
    let recorder = recorder(name, &file, &[]);
    let publisher = publisher(name, &scene, &["--rate", "1000", "--start", "100"]);
    wait_for_bytes(&file, if long() { 300_000_000 } else { 25_000_000 });
    let (published, recorded) = (stopped(publisher), stopped(recorder));
    check_whole(&recorded, &published);
}

#[test]
fn what_cannot_be_recorded_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let there = folder.path().join("there.mcap");
    std::fs::write(&there, "no recording").unwrap();
    let there = there.to_str().unwrap();
    let new = folder.path().join("new.mcap");
    let new = new.to_str().unwrap();
    for (arguments, expected) in [
        (&["-o", there][..], "there.mcap exists, expected another file, or --force to replace it"),
        (&["-o", "/no/such/folder/x.mcap"], "/no/such/folder/x.mcap: No such file or directory"),
        (&["-o", new, "--topics", "handles,smoke"], "expected topics of handles, poses, alerts"),
        (&["-o", new, "--split", "10"], "expected a size of at least 1MB"),
        (&["-o", new, "--split", "10KB"], "expected a size of at least 1MB"),
        (&["--recover", there], "there.mcap: it does not begin as MCAP does, expected a recording"),
        (&["--recover", "/no/such/file"], "/no/such/file: No such file or directory"),
        (&[], "--output <FILE>"),
    ] {
        let output = program("record_refused").arg("record").args(arguments).output().unwrap();
        let sentence = text(&output.stderr);
        assert!(output.status.code() == Some(2) && sentence.contains(expected), "{arguments:?}: {sentence}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a refusal leaves no file");
    // No publisher is running.
    let output = program("record_no_publisher").args(["record", "-o", new, "--duration", "0.2"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("nothing came from"), "{}", text(&output.stderr));
    assert!(!Path::new(new).exists());
}

/// The scene of every topic has its stamps on `/clock`. The recorder joins a show that runs, so that frames come before
/// the scene.
#[cfg(feature = "ros2")]
#[test]
fn stamps_are_on_the_clock_that_the_scene_requests_from_the_first_frame_on() {
    let (name, folder) = ("record_stamps", tempfile::tempdir().unwrap());
    let file = folder.path().join("show.mcap");
    let publisher = publisher(name, &scene(folder.path(), "ros2", ""), &["--start", "50"]);
    harness::wait_until("the show runs", || {
        program(name).args(["control", "state"]).output().unwrap().status.success()
    });
    let every = "handles,poses,alerts,stage,diagnostics,status,path,cues,clock";
    let recorded = recorder(name, &file, &["--topics", every, "--duration", "6"]).output();
    let recorded = harness::summary(&recorded);
    stopped(publisher);
    let bytes = std::fs::read(&file).unwrap();
    // All these begin with a stamp: seconds and nanoseconds.
    let part = |data: &[u8], at: usize| u32::from_le_bytes(data[at..at + 4].try_into().unwrap());
    let mut stamps: BTreeMap<String, Vec<(u64, u64)>> = BTreeMap::new();
    for message in MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let stamp = u64::from(part(&message.data, 4)) * 1_000_000_000 + u64::from(part(&message.data, 8));
        let topic = message.channel.topic.rsplit('/').next().unwrap().to_owned();
        stamps.entry(topic).or_default().push((message.log_time, stamp));
    }
    let clock = &stamps["clock"];
    assert!(clock.len() as u64 == recorded["frames"].as_u64().unwrap() && clock.len() > 60, "{recorded}");
    for topic in ["handles", "poses"] {
        let other = stamps[topic].iter().zip(clock).find(|(of_topic, of_clock)| of_topic != of_clock);
        assert!(other.is_none() && stamps[topic].len() == clock.len(), "{topic}: {other:?}");
    }
    assert!(stamps["stage"].iter().chain(&stamps["path"]).all(|(_, stamp)| *stamp == 0), "they hold at any time");
    for topic in ["handles", "status", "diagnostics"] {
        for (log_time, stamp) in &stamps[topic] {
            assert!((50..1000).contains(&(stamp / 1_000_000_000)), "{topic}: {stamp}");
            assert!(*log_time > 1_700_000_000_000_000_000, "{topic}: {log_time}");
        }
    }
    let verified = program(name).arg("verify").arg(&file).output().unwrap();
    assert!(verified.status.success(), "{}", text(&verified.stderr));
    let mut replay = program(name);
    let replayed = Process::start(replay.args(["--json", "replay"]).arg(&file)).output();
    assert_eq!(harness::summary(&replayed)["frames"], recorded["frames"], "{}", text(&replayed.stderr));
}
