//! Two machines joined by iceoryx2's own tunnel over Zenoh: two network namespaces with an iceoryx2 each and the real
//! `iox2-link-tunnel-zenoh` between them. Tests the data that crosses, its cost, late subscribers, and the detection of
//! a death.
//!
//! Only with `BENCH_DRAGON_LONG=1`; `BENCH_DRAGON_TUNNEL` names the tunnel's program, which `tests/run` installs.
//! `BENCH_DRAGON_LONG=1 cargo test --release --test processes tunnel:: -- --nocapture` prints the figures of
//! docs/more-machines.md: both namespaces have one clock, so that latencies are known here. No test asserts a speed.

use crate::harness;

use std::path::Path;
use std::process::Command;

use harness::hosts::Hosts;
use harness::{Lines, Place, Process, can_run, long, not_run, python, python_modules, root, summary, text, wait};
use nix::sys::signal::Signal::{SIGINT, SIGKILL, SIGTERM};
use serde_json::Value;

/// The settings that the receiving machine needs in its config/iceoryx2.toml.
const MIRROR: &str = "[defaults.publish-subscribe]\nsubscriber-max-buffer-size = 64\nmax-subscribers = 16\n";

fn object(line: &str) -> Value {
    serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))
}

/// The two machines: "left" runs the show, "right" receives it.
struct Machines {
    hosts: Hosts,
    left: Place,
    right: Place,
    tunnel: String,
}

impl Machines {
    fn start(&self, host: &str, command: &Command) -> Process {
        let place = if host == "left" { &self.left } else { &self.right };
        Process::start(&mut self.hosts.on(host, place.folder(), command))
    }

    fn program(&self, host: &str, arguments: &[&str]) -> Process {
        let mut command = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
        self.start(host, command.args(arguments))
    }

    fn tunnel(&self, host: &str, options: &str) -> Process {
        let mut command = real_time(&self.tunnel);
        self.start(host, command.args(["--allow", "bench_dragon/*"]).args(options.split_whitespace()))
    }
}

/// Returns a program that other programs of this machine do not delay: the test measures the way between machines.
fn real_time(program: &str) -> Command {
    let mut command = Command::new("chrt");
    command.args(["--fifo", "50", program]);
    command
}

fn ended(process: &Process, lines: &Lines) -> Vec<String> {
    process.signal(SIGTERM);
    lines.rest()
}

/// Measures the loss, cost and latency of a run of `seconds`; asserts only what must never happen.
fn measure(machines: &Machines, rate: u64, seconds: u64, options: [&str; 2]) {
    let (text_of_rate, duration) = (rate.to_string(), (seconds + 8).to_string());
    let run = ["run", "--json", "--rate", &text_of_rate, "--duration", &duration, "--realtime", "80"];
    let show = machines.program("left", &run);
    wait(1.5);
    let tunnels = [("left", options[0]), ("right", options[1])].map(|(host, it)| machines.tunnel(host, it));
    let mut observer = real_time(env!("CARGO_BIN_EXE_bench-dragon"));
    observer.arg("soak-subscriber");
    let [mut near, mut far] = ["left", "right"].map(|host| machines.start(host, &observer));
    let (near_lines, far_lines) = (near.lines(), far.lines());
    far_lines.until("\"status\":{");
    let measured = seconds.min(20);
    let before = machines.hosts.sent_bytes();
    wait(measured as f64);
    let bytes = machines.hosts.sent_bytes() - before;
    let published = summary(&show.output());
    wait(2.0);
    let [near, far] =
        [(&near, &near_lines), (&far, &far_lines)].map(|(it, lines)| object(ended(it, lines).last().unwrap()));
    let count = |seen: &Value, key: &str| seen[key].as_u64().unwrap_or_else(|| panic!("no {key} in {seen}"));
    for seen in [&near, &far] {
        assert_eq!([count(seen, "runs"), count(seen, "disordered"), count(seen, "wrong_links")], [1, 0, 0], "{seen}");
    }
    assert_eq!(count(&near, "missed"), 0, "{near}");
    let us = |seen: &Value, key: &str| seen["total"]["since_sent"][key].as_u64().unwrap() / 1000;
    println!(
        "{rate} Hz, {} to {}: {} frames published, far side received {} and lost {}; latency us p50/p99/max far {}/{}/{}, near \
         {}/{}/{}; {} bytes a frame on the wire",
        options[0],
        options[1],
        published["frames"],
        count(&far, "received"),
        count(&far, "missed"),
        us(&far, "p50"),
        us(&far, "p99"),
        us(&far, "max"),
        us(&near, "p50"),
        us(&near, "p99"),
        us(&near, "max"),
        bytes / (measured * rate)
    );
    tunnels.iter().for_each(|tunnel| tunnel.signal(SIGINT));
    tunnels.into_iter().for_each(|tunnel| drop(tunnel.output()));
}

/// Returns the messages of a late subscriber on the far side within 5 s.
fn far_peer(machines: &Machines) -> Vec<Value> {
    let mut command = python();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/transport_peer.py");
    command.args([script, "--transport", "iceoryx2", "--name", "bench_dragon", "--seconds", "5"]);
    let output = machines.start("right", &command).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout).lines().map(object).collect()
}

/// Tests that the show crosses whichever machine was first, and a new show too, and that both notice its death.
fn lives_and_deaths(machines: &Machines) {
    // No event is near: there is one alert, at the start.
    let run = ["run", "--json", "--rate", "60", "--start", "100"];
    let start = || machines.program("left", &run);
    let [mut near, mut far] = ["left", "right"].map(|host| machines.program(host, &["watch"]));
    let monitors = [near.lines(), far.lines()];
    let all_print = |what: &str| monitors.each_ref().map(|lines| lines.until(what));
    let right = machines.tunnel("right", "--poll 5");
    let mut show = start();
    let left = machines.tunnel("left", "--poll 5");
    all_print("is running");
    let [_, line] = all_print("missed 0");
    assert!(line.contains("latency unknown: the frames were sent by another machine's clock"), "{line}");

    // A machine that joins late, and a subscriber on it: the stage and the alert arrive within a second, the state in
    // every frame.
    right.signal(SIGINT);
    right.output();
    monitors[1].until("has ended");
    let right = machines.tunnel("right", "--poll 5");
    // The run is the same as before.
    monitors[1].until("rate");
    let got = far_peer(machines);
    let of = |kind: &str| got.iter().filter(|line| line["type"] == kind).collect::<Vec<_>>();
    println!(
        "a late subscriber got {} frames, {} stages, {} alerts, {} statuses in 5 s",
        of("frame").len(),
        of("stage").len(),
        of("alert").len(),
        of("status").len()
    );
    assert!(!of("frame").is_empty() && !of("stage").is_empty() && !of("status").is_empty());
    assert_eq!(of("frame")[0]["state"], 0, "the state is in every frame");
    assert!(!of("alert").is_empty());

    let json = machines.program("right", &["watch", "--json", "--duration", "3"]).output();
    let seconds: Vec<Value> = text(&json.stdout).lines().map(object).filter(|line| line["type"] == "second").collect();
    assert!(seconds.last().unwrap()["received"].as_u64().unwrap() > 60, "{seconds:?}");
    assert!(seconds.iter().all(|second| second["latency_ns"].is_null() && second["missed"] == 0), "{seconds:?}");
    let refused = machines.program("right", &["control", "pause"]).output();
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("send them there"), "{}", text(&refused.stderr));
    for (host, sentence) in
        [("left", "another publisher is running"), ("right", "a tunnel brings it from another machine")]
    {
        let second = machines.program(host, &["run", "--duration", "1"]).output();
        assert_eq!(second.status.code(), Some(1));
        assert!(text(&second.stderr).contains(sentence), "{}", text(&second.stderr));
    }

    for _ in 0..3 {
        show.signal(SIGKILL);
        all_print("has ended");
        all_print("waiting");
        show = start();
        all_print("is running");
        all_print("rate");
    }
    show.signal(SIGINT);
    summary(&show.output());
    all_print("has ended");
    for tunnel in [left, right] {
        tunnel.signal(SIGINT);
        tunnel.output();
    }
    for ((monitor, lines), place) in [&near, &far].into_iter().zip(&monitors).zip([&machines.left, &machines.right]) {
        ended(monitor, lines);
        place.assert_clean();
    }
}

#[test]
fn a_show_crosses_to_another_machine() {
    if !long() {
        return;
    }
    let Some(tunnel) = std::env::var("BENCH_DRAGON_TUNNEL").ok().filter(|tunnel| Path::new(tunnel).exists()) else {
        return not_run("BENCH_DRAGON_TUNNEL names no iox2-link-tunnel-zenoh; tests/run installs it");
    };
    if !can_run(root("make network namespaces")) || !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let hosts = match Hosts::new() {
        Ok(hosts) => hosts,
        Err(why) => return not_run(&format!("two hosts need network namespaces (root and iproute2): {}", why.trim())),
    };
    let [left, right] = ["left", "right"].map(Place::new);
    let config = right.folder().join("config/iceoryx2.toml");
    std::fs::write(&config, std::fs::read_to_string(&config).unwrap() + MIRROR).unwrap();
    let machines = Machines { hosts, left, right, tunnel };
    lives_and_deaths(&machines);
    measure(&machines, 60, 20, ["--poll 5", "--poll 5"]);
    measure(&machines, 60, 20, ["--poll 100 --listener bench_dragon/tick", "--reactive --poll 100"]);
    measure(&machines, 1000, 60, ["--poll 5", "--poll 5"]);
}
