//! Subscribers that are silent for longer than their lease, and come back: a stopped process, a cable that is out.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use harness::hosts::Hosts;
use harness::not_run;

use super::*;

/// The lease of the subscribers, in seconds. Fast DDS announces a participant every three.
const LEASE: &str = "4";
/// The time without an announcement. RustDDS looks for leases that have ended every two seconds.
const SILENCE: Duration = Duration::from_secs(10);
/// A volatile topic, and a latched one with a message each second.
const TOPICS: [&str; 2] = ["handles", "alerts"];

/// Returns a scene whose countdown raises an alert each second, and the arguments of its show.
fn show(name: &str) -> (PathBuf, [&'static str; 6]) {
    let scene = scene_file(name, &[("approach_time = 10.0", "approach_time = 1000.0")]);
    (scene, ["run", "--ros2", "--json", "--loop", "--duration", "6000"])
}

fn nanoseconds() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64
}

/// Waits for a message of after `instant`.
fn until_a_message_after(instant: u64, lines: &Lines) {
    lines.all_until_one(is_after(instant), "a message of after the silence");
}

/// Returns whether a line is a message of after `instant`.
fn is_after(instant: u64) -> impl Fn(&str) -> bool {
    let source = |line: &str| serde_json::from_str::<Value>(line).unwrap()["source_ns"].as_u64().unwrap();
    move |line| line.contains(SAMPLE) && source(line) > instant
}

#[test]
fn a_subscriber_that_was_silent_for_longer_than_its_lease_is_served_again() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "silent";
    let (scene, show) = show(name);
    let publisher = publisher(name, &[&["--scene", scene.to_str().unwrap()], &show[..]].concat());
    let mut subscribers: Vec<Subscriber> = Vec::new();
    for topic in TOPICS {
        let mut process = Process::start(&mut subscriber(name, topic, &["--seconds", "3000", "--lease", LEASE]));
        let lines = process.lines();
        lines.until(SAMPLE);
        subscribers.push((process, lines));
    }
    let mut other = Process::start(&mut subscriber(name, "alerts", &["--seconds", "3000", "--transient-local"]));
    let others = other.lines();
    let mut received = others.all_until(SAMPLE);
    subscribers.iter().for_each(|(process, _)| process.stop());
    std::thread::sleep(SILENCE);
    let resumed = nanoseconds();
    for (process, lines) in &subscribers {
        process.signal(Signal::SIGCONT);
        until_a_message_after(resumed, lines);
    }
    // The other subscriber gets no message twice.
    received.extend(others.all_until_one(is_after(resumed), "a message"));
    let stamps =
        received.iter().filter(|line| line.contains(SAMPLE)).map(|line| stamp(&serde_json::from_str(line).unwrap()));
    assert!(stamps.is_sorted_by(|one, next| one < next), "{received:?}");
    stopped(publisher);
}

#[test]
fn a_subscriber_behind_a_cable_that_was_out_for_longer_than_its_lease_is_served_again() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let hosts = match Hosts::new() {
        Ok(hosts) => hosts,
        Err(why) => return not_run(&format!("two hosts need network namespaces (root and iproute2): {}", why.trim())),
    };
    let name = "cable";
    let (scene, show) = show(name);
    let on = |host: &str, command: &Command| hosts.on(host, Path::new(env!("CARGO_MANIFEST_DIR")), command);
    let mut run = program(name);
    run.arg("--scene").arg(scene).args(show);
    let publisher = Process::start(on("left", &run).env("ROS_DOMAIN_ID", domain().to_string()));
    let subscribers = TOPICS.map(|topic| {
        let subscriber = subscriber(name, topic, &["--seconds", "3000", "--lease", LEASE]);
        let mut process = Process::start(&mut on("right", &subscriber));
        let lines = process.lines();
        lines.until(SAMPLE);
        (process, lines)
    });
    hosts.cut();
    std::thread::sleep(SILENCE);
    hosts.join();
    let joined = nanoseconds();
    subscribers.iter().for_each(|(_, lines)| until_a_message_after(joined, lines));
    stopped(publisher);
}
