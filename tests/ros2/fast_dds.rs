//! ROS 2 topics and services as Fast DDS, the default of ROS 2, receives and calls them. The peer is a real Fast DDS
//! process (`tests/fastdds/peer.cpp`), built at the first use.
#![cfg(feature = "ros2")]

mod harmless;
mod silent;
mod streams;

use crate::harness;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use bench_dragon::soak::resources::child_of;
use harness::{
    Lines, Process, aloud, answering, can_run, json_lines, long, program, scene_file, stopped, text, unique,
};
use nix::sys::signal::Signal;
use serde_json::Value;

/// Builds the peer. Returns its file, or the reason why there is none.
fn peer_program() -> Result<&'static Path, String> {
    static BUILT: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let built = BUILT.get_or_init(|| {
        if !Path::new("/usr/include/fastdds/dds/domain/DomainParticipant.hpp").exists() {
            return Err("no Fast DDS (libfastrtps-dev, libfastcdr-dev); tests/run installs it".to_owned());
        }
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fastdds_peer_{}", std::process::id()));
        let mut compiler = Command::new("g++");
        compiler.current_dir(env!("CARGO_MANIFEST_DIR"));
        compiler.args(["-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror", "-o"]).arg(&file);
        let output = compiler.args(["tests/fastdds/peer.cpp", "-lfastrtps", "-lfastcdr"]).output();
        let output = output.map_err(|error| format!("no g++ ({error})"))?;
        assert!(output.status.success(), "{}", text(&output.stderr));
        Ok(file)
    });
    built.as_deref().map_err(String::clone)
}

/// Returns a Fast DDS process. Call only after [`can_run`] of [`peer_program`].
fn peer(arguments: &[&str]) -> Command {
    let mut command = Command::new(peer_program().unwrap());
    command.args(arguments).args(["--domain", &domain().to_string()]);
    command
}

/// Returns a subscriber of a topic.
fn subscriber(name: &str, topic: &str, arguments: &[&str]) -> Command {
    let (package, kind) = match topic {
        "alerts" => ("bench_dragon_msgs", "CollisionAlert"),
        "clock" => ("rosgraph_msgs", "Clock"),
        "cues" => ("bench_dragon_msgs", "Cue"),
        "diagnostics" => ("diagnostic_msgs", "DiagnosticArray"),
        "handles" => ("bench_dragon_msgs", "HandlePoses"),
        "markers" => ("visualization_msgs", "MarkerArray"),
        "path" => ("nav_msgs", "Path"),
        "poses" => ("geometry_msgs", "PoseArray"),
        "stage" => ("bench_dragon_msgs", "Stage"),
        "status" => ("bench_dragon_msgs", "LoopStatus"),
        "tf" => ("tf2_msgs", "TFMessage"),
        _ => panic!("no type of {topic}"),
    };
    let path = match topic {
        "clock" | "diagnostics" | "tf" => topic.to_owned(),
        _ => format!("{}/{topic}", unique(name)),
    };
    peer(&[&["subscribe", &path, &format!("{package}::msg::dds_::{kind}_")], arguments].concat())
}

/// Marks the line of a message. The word alone is in the line of the end too, as `samples`.
const SAMPLE: &str = "\"type\":\"sample\"";

/// Returns the line of the end among lines of a subscriber.
fn end(lines: &[String]) -> Value {
    let mut lines = lines.iter().map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines.find(|line| line["type"] == "end").expect("the end of a subscriber")
}

/// Asserts that a subscriber which ended without a match discovered no publisher, and that few do. This happens at times
/// to a participant of Fast DDS that starts beside many others.
fn discovered_nothing(end: &Value) {
    static COUNT: AtomicUsize = AtomicUsize::new(0);
    assert!(end["samples"] == 0 && end["writers"] == 0 && end["offered"] == "", "{end}");
    let count = COUNT.fetch_add(1, Ordering::Relaxed) + 1;
    aloud(&format!("{count} subscribers of Fast DDS discovered nothing"));
    assert!(count <= 4, "{count} subscribers discovered nothing");
}

type Subscriber = (Process, Lines);

/// Returns a subscriber when it is matched with its publisher. `again` starts another in place of one that discovers
/// nothing.
fn matched(mut subscriber: Subscriber, again: impl Fn() -> Subscriber) -> Subscriber {
    loop {
        let is_known = |line: &str| line.contains("\"matched\"") || line.contains("\"end\"");
        let lines = subscriber.1.all_until_one(is_known, "a match");
        if lines.last().is_some_and(|line| line.contains("\"matched\"")) {
            return subscriber;
        }
        discovered_nothing(&end(&lines));
        subscriber = again();
    }
}

/// Returns a ROS 2 domain that the tests of the services do not use. Ports of domains above 101 are those that Linux
/// gives to any socket.
fn domain() -> u16 {
    20 + ((std::process::id() + 40) % 80) as u16
}

/// Starts a show and returns when it answers over shared memory.
fn publisher(name: &str, arguments: &[&str]) -> Process {
    let mut run = program(name);
    answering(Process::start(run.env("ROS_DOMAIN_ID", domain().to_string()).args(arguments)), || program(name))
}

/// A Fast DDS client sends its first request before RustDDS knows it, in half of all cases. Fast DDS repeats the
/// request only after its heartbeat period, here an hour: an answer proves that the publisher requests it again.
#[test]
fn a_hundred_new_clients_each_get_the_answer_to_their_first_call() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "first_calls";
    let publisher =
        publisher(name, &["run", "--json", "--ros2", "--ros2-control", "--rate", "60", "--duration", "6000"]);
    let service = format!("{}/get_rate", unique(name));
    let [request, response] =
        ["Request", "Response"].map(|part| format!("rosbag2_interfaces::srv::dds_::GetRate_{part}_"));
    // A process for each client: Fast DDS at times dies when many participants of one process leave at once. That does
    // not concern the answer, which is printed before.
    let client = || {
        let call = ["call", &service, &request, &response, "00", "--heartbeat", "3600", "--timeout", "60"];
        Process::start(peer(&call).args(["--clients", "1"]))
    };
    let rate_of_one = Value::from(hex(&1.0_f64.to_le_bytes()));
    let mut answers = Vec::new();
    let mut undiscovered = 0;
    while answers.len() < 100 && undiscovered < 10 {
        let side_by_side: Vec<Process> = (0..4.min(100 - answers.len())).map(|_| client()).collect();
        for process in side_by_side {
            let output = process.output();
            let errors = text(&output.stderr);
            // Beside many other participants, discovery at times takes Fast DDS more than a minute, on its own or on
            // our side. Such a client has made no call; another one takes its place.
            let has_called = !errors.contains("no server of") && !errors.contains("no match with");
            undiscovered += u32::from(!has_called);
            let printed = json_lines(&output);
            assert_eq!(printed.len(), usize::from(has_called), "{}: {errors}", output.status);
            answers.extend(printed);
        }
    }
    println!("{undiscovered} clients discovered no service within a minute");
    // Times depend on the machine's load: they are printed.
    let within = |seconds: f64| answers.iter().filter(|line| line["answered_s"].as_f64().unwrap() < seconds).count();
    println!("{} of {} within 0.1 s, {} within 0.5 s", within(0.1), answers.len(), within(0.5));
    assert_eq!(answers.len(), 100);
    assert!(answers.iter().all(|line| line["response"] == rate_of_one), "{answers:?}");
    stopped(publisher);
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the publisher's stamp, in nanoseconds, of a message that begins with a header.
fn stamp(sample: &Value) -> u64 {
    let hex = sample["hex"].as_str().unwrap();
    let word = |at: usize| u64::from(u32::from_str_radix(&hex[8 * at..8 * at + 8], 16).unwrap().swap_bytes());
    1_000_000_000 * word(0) + word(1)
}

/// The subscribers of these topics: the first, which the publisher discovers meanwhile, and one that joins it later.
#[test]
fn stage_path_and_each_cue_come_exactly_once_to_each_subscriber() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "once";
    let scene = scene_file(name, &[]);
    let cues: String = (1..=3)
        .map(|number| format!("[[cues]]\nname = \"cue {number}\"\nat = {}\n", 50.25 + 0.05 * f64::from(number)))
        .collect();
    let topics = "[publish.ros2]\ntopics = [\"cues\", \"path\", \"stage\"]\n";
    fs::write(&scene, format!("{}\n{topics}\n{cues}", fs::read_to_string(&scene).unwrap())).unwrap();
    let scene = scene.to_str().unwrap();
    let publisher =
        publisher(name, &["--scene", scene, "run", "--json", "--paused", "--start", "50.25", "--duration", "6000"]);
    // Longer than any repetition would take.
    let waiting = ["--transient-local", "--seconds", "120", "--linger", "4", "--samples"];
    let start = |topic: &str, samples: &str| {
        let mut process = Process::start(&mut subscriber(name, topic, &[&waiting[..], &[samples]].concat()));
        let lines = process.lines();
        (process, lines)
    };
    let one_each = || ["stage", "path"].map(|topic| (start(topic, "1"), topic));
    let (constant, first) = (one_each(), start("cues", "3"));
    let constant = constant.map(|(subscriber, topic)| matched(subscriber, || start(topic, "1")));
    constant.iter().for_each(|(_, lines)| drop(lines.until(SAMPLE)));
    let late = one_each().map(|(subscriber, topic)| matched(subscriber, || start(topic, "1")));
    for (_, lines) in constant.into_iter().chain(late) {
        let end: Value = serde_json::from_str(&lines.until("\"end\"")).unwrap();
        assert_eq!(end["samples"], 1, "{end}");
    }
    let first = matched(first, || start("cues", "3"));
    let go = program(name).args(["control", "go"]).output().unwrap();
    assert!(go.status.success(), "{}", text(&go.stderr));
    // A late frame can pass two cues, which then have the same stamp: their names distinguish them.
    let names = |printed: Vec<String>| -> Vec<Option<usize>> {
        let samples = printed.iter().map(|line| serde_json::from_str::<Value>(line).unwrap());
        let name = |sample: Value| {
            let hex = sample["hex"].as_str().unwrap().to_owned();
            (1..=3).find(|number| hex.contains(&format!("637565203{number}")))
        };
        samples.filter(|line| line["type"] == "sample").map(name).collect()
    };
    assert_eq!(names(first.1.rest()), [1, 2, 3].map(Some));
    // The latest cue, alone: the first subscriber has left.
    let late = matched(start("cues", "1"), || start("cues", "1"));
    assert_eq!(names(late.1.rest()), [Some(3)]);
    stopped(publisher);
}

/// Returns for subscribers, one after the other, the time of creation and the stamps of their alerts. Each is a
/// process: Fast DDS at times hangs or dies when many participants of one process come and go.
fn joined(name: &str, joins: u32, further: &[&str]) -> Vec<(u64, Vec<u64>)> {
    let arguments = [&["--samples", "1", "--linger", "0.15", "--seconds", "60"], further].concat();
    let lines_of_one = || loop {
        let mut process = Process::start(&mut subscriber(name, "alerts", &arguments));
        let lines = process.lines().rest();
        if lines.iter().any(|line| line.contains("\"matched\"")) {
            return lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
        }
        discovered_nothing(&end(&lines));
    };
    let join = |_| {
        let lines: Vec<Value> = lines_of_one();
        let alerts: Vec<u64> = lines.iter().filter(|line| line["type"] == "sample").map(stamp).collect();
        assert!(!alerts.is_empty(), "no alert within 60 s: {lines:?}");
        (lines[0]["made_ns"].as_u64().unwrap(), alerts)
    };
    (0..joins).map(join).collect()
}

/// A countdown raises an alert each second.
#[test]
fn a_late_subscriber_gets_the_current_alert_and_a_volatile_one_none_before_it() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "joins";
    let countdown = ("approach_time = 10.0", "approach_time = 1000.0");
    let scene = scene_file(name, &[countdown, ("accuracy = 1e-9", "solver = \"newton\"")]);
    let mut watch = Process::start(program(name).args(["watch", "--json"]));
    let printed = watch.lines();
    let show = ["--scene", scene.to_str().unwrap(), "run", "--ros2", "--json", "--rate", "30", "--duration", "6000"];
    let publisher = publisher(name, &show);
    let mut published: Vec<u64> = Vec::new();
    let mut publish_until = |instant: u64| {
        while published.last().is_none_or(|stamp| *stamp < instant) {
            let alert: Value = serde_json::from_str(&printed.until("\"type\":\"alert\"")).unwrap();
            published.push(alert["stamp_ns"].as_str().unwrap().parse().unwrap());
        }
        published.clone()
    };
    // Alerts without a subscriber on ROS 2.
    let first = publish_until(0)[0];
    publish_until(first + 3_000_000_000);
    let joins = if long() { 50 } else { 12 };
    let kept = ["--transient-local", "--depth", "10"];
    // On a busy machine an alert may be in flight for seconds. A fault would show in every join.
    let few = joins as usize / 3;
    let mut late = Vec::new();
    for (made, alerts) in joined(name, joins, &kept) {
        let published = publish_until(made.max(alerts[0]));
        let current = published.iter().rfind(|stamp| **stamp + 1_000_000_000 < made).unwrap();
        if alerts[0] < *current {
            late.push(format!("{} ms old", (current - alerts[0]) / 1_000_000));
        }
        assert!(alerts.is_sorted_by(|a, b| a < b), "one comes twice: {alerts:?}");
    }
    assert!(late.len() <= few, "{late:?}");
    // The age of the current alert is anything up to a second.
    let ages = joined(name, joins, &[]).into_iter().map(|(made, alerts)| made.saturating_sub(alerts[0]) / 1_000_000);
    let ages: Vec<u64> = ages.collect();
    assert!(ages.iter().filter(|age| **age > 300).count() <= few, "ms: {ages:?}");
    // Beside a subscriber that stays, RustDDS keeps some alerts. These alerts are withheld from a new subscriber,
    // unless a busy machine is too late.
    let mut stays = Process::start(&mut subscriber(name, "alerts", &["--transient-local", "--seconds", "900"]));
    let received = stays.lines();
    (0..4).for_each(|_| drop(received.until(SAMPLE)));
    for further in [&[][..], &kept] {
        let before = |(made, alerts): &(u64, Vec<u64>)| alerts.iter().filter(|alert| **alert < *made).count();
        let counts: Vec<usize> = joined(name, joins, further).iter().map(before).collect();
        let with_old = counts.iter().filter(|count| **count > 1).count();
        assert!(with_old <= few, "alerts of before each: {counts:?}");
    }
    drop(watch);
    stopped(publisher);
}

/// Returns the paper's scene for a large team, without alerts.
fn scene_without_alerts(name: &str, benches: usize) -> PathBuf {
    let benches = format!("benches = {benches}");
    let changes = [("benches = 223", &*benches), ("start_turn = 16", "start_turn = 60"), ("[alerts]", "#[alerts]")];
    let scene = scene_file(name, &changes);
    let text = fs::read_to_string(&scene).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with("approach_"));
    fs::write(&scene, lines.map(|line| format!("{line}\n")).collect::<String>()).unwrap();
    scene
}

/// A stopped subscriber acknowledges nothing and is not dead. RustDDS would refuse to write more than the memory of a
/// topic holds: 64 MB, here some 330 messages.
#[test]
fn a_stopped_subscriber_stops_no_other() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "stopped_lease";
    let scene = scene_without_alerts(name, 5000);
    let of_scene = fs::read_to_string(&scene).unwrap();
    fs::write(&scene, format!("{of_scene}\n[publish.ros2]\ntopics = [\"handles\"]\n")).unwrap();
    let scene = scene.to_str().unwrap();
    let publisher = publisher(name, &["--scene", scene, "run", "--json", "--duration", "6000"]);
    let mut slow = Process::start(&mut subscriber(name, "handles", &["--seconds", "600", "--lease", "86400"]));
    slow.lines().until(SAMPLE);
    slow.signal(Signal::SIGSTOP);
    let mut other =
        Process::start(&mut subscriber(name, "handles", &["--seconds", "180", "--linger", "0", "--samples", "500"]));
    let printed = other.lines().rest();
    let end: Value = serde_json::from_str(printed.last().unwrap()).unwrap();
    assert!(end["samples"].as_u64() >= Some(500), "{end}");
    let ros2 = &stopped(publisher)["ros2"];
    assert_eq!(ros2["discarded"], 0, "{ros2}");
}

/// Returns the resident memory of a process, in MB.
fn memory(process: u32) -> f64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<f64>().unwrap() / 1024.0
}

/// The end of one subscriber.
#[derive(PartialEq)]
enum Visit {
    /// The subscriber received its messages, and left or was killed.
    Served,
    /// The subscriber discovered no publisher within a minute, as happens to Fast DDS at times beside many other
    /// participants. This proves nothing about the program.
    Undiscovered,
}

/// A subscriber comes, gets its messages, and leaves; of eight, four are killed at their first message.
fn visit(name: &str, topics: [&str; 4], index: usize) -> Visit {
    let (topic, durability) =
        (topics[index % 4], ["", "--transient-local", "--best-effort", "--transient-local"][index % 4]);
    let samples = if topic == "handles" { "20" } else { "1" };
    let arguments = ["--seconds", "60", "--linger", "0", "--samples", samples, durability];
    let arguments = arguments.iter().copied().filter(|argument| !argument.is_empty()).collect::<Vec<_>>();
    let mut process = Process::start(&mut subscriber(name, topic, &arguments));
    let printed = process.lines();
    let first = printed.all_until_one(|line| line.contains("sample") || line.contains("end"), "sample or end");
    let mut lines: Vec<Value> = first.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    if index / 4 % 2 == 1 && lines.iter().any(|line| line["type"] == "sample") {
        process.signal(Signal::SIGKILL);
        return Visit::Served;
    }
    lines.extend(printed.rest().iter().map(|line| serde_json::from_str::<Value>(line).unwrap()));
    // None if it ended in another way: Fast DDS dies at times when a participant leaves.
    let end = lines.iter().find(|line| line["type"] == "end");
    if end.is_some_and(|end| end["samples"] == 0 && end["writers"] == 0) {
        return Visit::Undiscovered;
    }
    // rclpy would never return from `take` at a message without a payload.
    assert!(
        lines.iter().all(|line| line["type"] != "sample" || line["bytes"].as_u64() > Some(4)),
        "{topic}: {lines:?}"
    );
    let received = lines.iter().filter(|line| line["type"] == "sample").count();
    assert!(received >= samples.parse().unwrap(), "{topic}: {lines:?}");
    Visit::Served
}

/// Messages of 223 benches on a busy machine, each of one datagram; half of the subscribers are killed, the others leave.
/// A subscriber of Fast DDS that is sent an empty change spins, and would never end. `BENCH_DRAGON_SUBSCRIBERS` is their
/// number, 2,000 by default, which take some five minutes.
#[test]
fn subscribers_that_come_and_go_cost_bounded_memory_and_none_is_left_without_messages() {
    come_and_go("come_and_go", &[], ["handles", "alerts", "handles", "stage"]);
}

/// The same with 1,500 benches: a message is divided.
#[test]
fn subscribers_of_divided_messages_that_come_and_go_are_all_served() {
    let scene = scene_without_alerts("come_and_go_divided", 1500);
    let scene = ["--scene", scene.to_str().unwrap()];
    come_and_go("come_and_go_divided", &scene, ["handles", "stage", "handles", "path"]);
}

fn come_and_go(name: &str, scene: &[&str], topics: [&str; 4]) {
    // Beside many other processes a subscriber may discover the publisher later than within its minute.
    if !long() || !can_run(peer_program().map(drop)) {
        return;
    }
    let run = ["run", "--json", "--ros2", "--start", "300", "--loop", "--duration", "100000"];
    let publisher = publisher(name, &[scene, &run].concat());
    let process = child_of(publisher.id()).unwrap();
    let subscribers = std::env::var("BENCH_DRAGON_SUBSCRIBERS").map_or(2000, |number| number.parse().unwrap());
    let busy = || Process::start(Command::new("nice").args(["sh", "-c", "while :; do :; done"]));
    let _load: Vec<Process> = (0..4).map(|_| busy()).collect();
    let (rounds, beside) = (subscribers / 4, 4);
    let undiscovered = AtomicUsize::new(0);
    let mut memories = Vec::new();
    for round in 0..rounds {
        std::thread::scope(|threads| {
            for index in 0..beside {
                let undiscovered = &undiscovered;
                threads.spawn(move || {
                    if visit(name, topics, beside * round + index) == Visit::Undiscovered {
                        undiscovered.fetch_add(1, Ordering::Relaxed);
                    }
                });
            }
        });
        memories.push(memory(process));
    }
    let undiscovered = undiscovered.into_inner();
    println!("{} subscribers, {undiscovered} discovered nothing, MB: {memories:.1?}", rounds * beside);
    assert!(undiscovered <= rounds * beside / 4, "{undiscovered} of {}", rounds * beside);
    // The queues fill first, with the messages of some seconds.
    let highest = |memories: &[f64]| memories.iter().copied().fold(0.0, f64::max);
    let (first, rest) = memories.split_at(100_usize.div_ceil(beside).min(rounds / 2));
    assert!(highest(rest) < highest(first) + 10.0, "{memories:.1?}");
    // The same process still serves, and ends.
    assert_eq!(child_of(publisher.id()), Some(process));
    assert!(visit(name, topics, 0) == Visit::Served || visit(name, topics, 0) == Visit::Served);
    stopped(publisher);
}
