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

/// Returns a subscriber of each topic that has received a message. `on` places a command on a host.
fn subscribers(name: &str, on: impl Fn(Command) -> Command) -> [Subscriber; 2] {
    TOPICS.map(|topic| {
        let mut process = Process::start(&mut on(subscriber(name, topic, &["--seconds", "3000", "--lease", LEASE])));
        let lines = process.lines();
        lines.until(SAMPLE);
        (process, lines)
    })
}

/// Waits for a message of after `instant`.
fn until_a_message_after(instant: u64, lines: &Lines) {
    let source = |line: &str| serde_json::from_str::<Value>(line).unwrap()["source_ns"].as_u64().unwrap();
    lines.all_until_one(|line| line.contains(SAMPLE) && source(line) > instant, "a message of after the silence");
}

#[test]
fn a_subscriber_that_was_silent_for_longer_than_its_lease_is_served_again() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "silent";
    let (scene, show) = show(name);
    let publisher = publisher(name, &[&["--scene", scene.to_str().unwrap()], &show[..]].concat());
    let subscribers = subscribers(name, |command| command);
    subscribers.iter().for_each(|(process, _)| process.stop());
    std::thread::sleep(SILENCE);
    let resumed = nanoseconds();
    for (process, lines) in &subscribers {
        process.signal(Signal::SIGCONT);
        until_a_message_after(resumed, lines);
    }
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
    let subscribers = subscribers(name, |command| on("right", &command));
    hosts.cut();
    std::thread::sleep(SILENCE);
    hosts.join();
    let joined = nanoseconds();
    subscribers.iter().for_each(|(_, lines)| until_a_message_after(joined, lines));
    stopped(publisher);
}
