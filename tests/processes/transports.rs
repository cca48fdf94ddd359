//! The promises of every transport, tested from another process: one suite, which each transport runs.
//!
//! A transport joins by a reader in tests/python/transport_peer.py and a test at the end that calls [`suite`]. If a
//! scene must request the transport, it also needs its settings in [`publisher`].

use crate::harness;

use std::collections::BTreeMap;
use std::process::Command;

use harness::{Process, can_run, json_lines, program, python, python_modules, scene_file, summary, text, unique};
use nix::sys::signal::Signal::{SIGINT, SIGTERM};
use serde_json::Value;

const RATE: u64 = 50;
const START: f64 = 405.0;
/// Simulated seconds per second: the contact is a minute of wall time away.
const TIME_SCALE: f64 = 0.05;
const CONTACT: f64 = 412.473837682115;

/// Returns a subscriber for at most five minutes.
fn peer(transport: &str, name: &str) -> Command {
    let mut command = python();
    command.args(["tests/python/transport_peer.py", "--transport", transport]);
    command.args(["--name", &unique(name), "--seconds", "300"]);
    command
}

/// Returns a publisher over all transports, for at most `seconds` seconds.
fn publisher(name: &str, seconds: u64) -> Process {
    // The queues hold all frames by which a subscriber falls behind on a loaded machine.
    let scene = scene_file(name, &[("[publish]", "[publish]\nqueue = 480")]);
    if cfg!(feature = "ros2") {
        let topics = format!(
            "[publish.ros2]\nrate = {RATE}\ntopics = [\"handles\", \"alerts\", \"stage\", \"status\"]\n\
             [publish.ros2.qos.handles]\ndepth = 1000\n"
        );
        std::fs::write(&scene, format!("{}\n{topics}", std::fs::read_to_string(&scene).unwrap())).unwrap();
    }
    let mut command = program(name);
    command.args(["--scene", scene.to_str().unwrap(), "--json", "run", "--rate", &RATE.to_string()]);
    command.args(["--start", &START.to_string(), "--time-scale", &TIME_SCALE.to_string()]);
    command.args(["--duration", &seconds.to_string()]);
    Process::start(&mut command)
}

/// Returns the lines of a kind, by run, in the order of arrival.
fn by_run<'a>(lines: &'a [Value], kind: &str) -> BTreeMap<u64, Vec<&'a Value>> {
    let mut runs: BTreeMap<u64, Vec<&Value>> = BTreeMap::new();
    for line in lines.iter().filter(|line| line["type"] == kind) {
        runs.entry(line["run_id"].as_u64().unwrap()).or_default().push(line);
    }
    runs
}

fn number(line: &Value, field: &str) -> u64 {
    line[field].as_u64().unwrap_or_else(|| panic!("{field} of {line}"))
}

/// Frames within which a writer of ROS 2 discovers a reader that receives frames already. Until then the writer repeats
/// nothing for that reader.
const DISCOVERY: u64 = 2 * RATE;

/// Checks the frames of one run. None is lost except `left_out`, which the transport counted itself because it was
/// behind, and over ROS 2 the frames of the discovery. Each frame has the time of its tick and complete content.
fn check_frames(transport: &str, frames: &[&Value], left_out: u64) {
    let sequence = |frame: &Value| number(frame, "sequence");
    let reliable_from = sequence(frames[0]) + if transport == "ros2" { DISCOVERY } else { 0 };
    let gaps = frames.windows(2).map(|pair| (sequence(pair[0]), sequence(pair[1])));
    let gaps = Vec::from_iter(gaps.filter(|(before, after)| *after > reliable_from && after - before > 1));
    let lost: u64 = gaps.iter().map(|(before, after)| after - before - 1).sum();
    assert!(
        lost <= left_out,
        "{lost} frames are lost, {left_out} were left out: {gaps:?} from {}",
        sequence(frames[0])
    );
    for pair in frames.windows(2) {
        assert!(number(pair[1], "sequence") > number(pair[0], "sequence"), "{} after {}", pair[1], pair[0]);
        assert!(number(pair[1], "tick") > number(pair[0], "tick"));
    }
    for frame in frames {
        let expected = START + TIME_SCALE * number(frame, "tick") as f64 / RATE as f64;
        assert_eq!(frame["sim_time"].as_f64(), Some(expected), "{frame}");
        assert_eq!((number(frame, "handles"), number(frame, "count")), (224, 224), "{frame}");
        assert!((frame["link"].as_f64().unwrap() - 2.86).abs() < 1e-12, "{frame}");
        assert_eq!((number(frame, "state"), number(frame, "epoch")), (1, 0), "{frame}");
    }
}

/// Checks the alerts of one run: the level at the start, then its countdown once a second.
fn check_alerts(alerts: &[&Value]) {
    for alert in alerts {
        assert_eq!((number(alert, "level"), number(alert, "event")), (1, 2), "{alert}");
        assert!((alert["event_time"].as_f64().unwrap() - CONTACT).abs() < 1e-9, "{alert}");
        assert_eq!((number(alert, "event_bench_a"), number(alert, "event_bench_b")), (0, 8), "{alert}");
    }
    // The seconds of wall time before the contact. A loop that was late sends an alert late, within its second.
    let seconds = |alert: &&Value| {
        let sim_time = START + TIME_SCALE * number(alert, "tick") as f64 / RATE as f64;
        ((CONTACT - sim_time) / TIME_SCALE).floor() as u64
    };
    let seconds: Vec<u64> = alerts.iter().map(seconds).collect();
    assert!(seconds.windows(2).all(|pair| pair[1] < pair[0]), "one alert a second: {seconds:?}");
    assert!(!seconds.is_empty());
}

/// Checks the stage of one run.
fn check_stages(stages: &[&Value]) {
    assert_eq!(stages.len(), 1, "{stages:?}");
    for stage in stages {
        assert_eq!((number(stage, "benches"), &stage["body_length"]), (223, &2.2.into()), "{stage}");
    }
}

fn suite(transport: &str, modules: &[&str]) {
    let name = format!("suite_{transport}");
    if !can_run(python_modules(modules)) {
        return;
    }
    let mut early = Process::start(&mut peer(transport, &name));
    let ready = early.lines();
    ready.until("ready");
    let first = publisher(&name, 140);
    // The debug build makes its tables for seconds: the late subscriber starts after the early one has received frames.
    let mut beginning = ready.all_until("frame");
    for _ in 0..2 {
        beginning.extend(ready.all_until("\"alert\""));
    }
    let mut late = peer(transport, &name);
    let late = Process::start(late.args(["--until", "frame", "stage", "alert"])).output();
    first.signal(SIGINT);
    let summary_of_first = summary(&first.output());
    let summary_of_second = summary(&publisher(&name, 10).output());
    early.signal(SIGTERM);
    let lines = beginning.into_iter().chain(ready.rest());
    let lines: Vec<Value> = lines.map(|line| serde_json::from_str(&line).unwrap()).collect();

    // Shared memory leaves nothing out; a transport with its own queue reports the frames it left out.
    let summaries = [&summary_of_first, &summary_of_second];
    let left_out = summaries.into_iter().filter_map(|summary| summary.get(transport));
    let left_out = left_out.map(|of| number(of, "skipped") + number(of, "discarded")).sum();

    // A subscriber that started before the publisher, through two publishers.
    let [frames, stages, alerts, statuses] = ["frame", "stage", "alert", "status"].map(|kind| by_run(&lines, kind));
    assert_eq!(frames.len(), 2, "two publishers are two runs");
    for (run, frames) in &frames {
        check_frames(transport, frames, left_out);
        check_stages(&stages[run]);
        check_alerts(&alerts[run]);
        assert!(statuses[run].len() >= 2, "{:?}", statuses[run]);
        assert!(statuses[run].iter().all(|status| status["rate"] == RATE as f64), "{:?}", statuses[run]);
    }
    let mut sent: Vec<u64> = summaries.map(|line| number(line, "frames")).to_vec();
    let mut last: Vec<u64> = frames.values().map(|frames| number(frames.last().unwrap(), "sequence") + 1).collect();
    sent.sort_unstable();
    last.sort_unstable();
    assert_eq!(last, sent, "the last frame arrived too");
    assert_eq!(number(lines.last().unwrap(), "publishers"), 0, "the publisher has left: {:?}", lines.last());

    // A late subscriber: the stage, and the alert in effect.
    assert!(late.status.success(), "{}", text(&late.stderr));
    let lines = json_lines(&late);
    let [frames, stages, alerts] = ["frame", "stage", "alert"].map(|kind| by_run(&lines, kind));
    assert_eq!((frames.len(), stages.len(), alerts.len()), (1, 1, 1), "{lines:?}");
    for (run, frames) in &frames {
        check_frames(transport, frames, left_out);
        check_stages(&stages[run]);
        check_alerts(&alerts[run]);
        assert!(number(frames[0], "tick") > RATE, "it was not late");
        assert!(number(alerts[run][0], "tick") <= number(frames[0], "tick"), "the alert in effect is missing");
    }
}

#[test]
fn iceoryx2_keeps_what_every_transport_promises() {
    suite("iceoryx2", &["iceoryx2", "numpy"]);
}

#[cfg(feature = "ros2")]
#[test]
fn ros2_keeps_what_every_transport_promises() {
    suite("ros2", &["cyclonedds"]);
}
