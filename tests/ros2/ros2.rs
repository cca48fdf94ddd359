//! ROS 2 topics as subscribers in other processes receive them: Cyclone DDS as the wire peer, with types made from
//! `msgs/`.
#![cfg(feature = "ros2")]

use crate::harness;

use std::path::Path;
use std::process::{Command, Output};

use bench_dragon::soak::resources::child_of;
use harness::hosts::Hosts;
use harness::{
    Process, answering, can_run, json_lines, long, not_run, program, python, python_modules, scene_file, stopped,
    summary, text, unique, wait, wait_until,
};
use serde_json::Value;

/// Returns a Cyclone DDS process that prints its messages of these topics.
fn peer(name: &str, seconds: &str, topics: &[&str]) -> Command {
    let mut command = python();
    command.args(["tests/python/ros2_peer.py", "--name", &unique(name), "--seconds", seconds]);
    topics.iter().for_each(|topic| {
        command.args(["--topic", topic]);
    });
    command
}

fn content(name: &str, topic: &str, reliability: &str, seconds: &str) -> Command {
    let mut command = python();
    command.args(["tests/python/ros2_content.py", "--name", &unique(name), "--seconds", seconds]);
    command.args(["--topic", topic, "--reliability", reliability]);
    command
}

/// Returns the messages of a topic.
fn messages<'a>(lines: &'a [Value], topic: &str) -> Vec<&'a Value> {
    lines.iter().filter(|line| line["topic"] == topic).map(|line| &line["message"]).collect()
}

/// Waits until a peer has printed twenty messages.
fn hears_messages(peer: &mut Process) {
    let lines = peer.lines();
    (0..20).for_each(|_| drop(lines.until("\"message\"")));
}

/// Returns the number of messages and of publishers of each topic at the end: the peer's last line.
fn end(output: &Output) -> Value {
    let last = json_lines(output).pop().filter(|line| line["type"] == "end");
    last.unwrap_or_else(|| panic!("the peer ended with {}: {}", output.status, text(&output.stderr)))
}

#[test]
fn both_kinds_of_subscriber_get_the_frames_of_the_shared_memory() {
    if !can_run(python_modules(&["cyclonedds", "iceoryx2", "numpy"])) {
        return;
    }
    let seconds = if long() { 60 } else { 10 };
    // The queues hold all frames by which a subscriber falls behind.
    let scene = scene_file("content", &[("[publish]", "[publish]\nqueue = 3000\nsubscribers = 4")]);
    let mut run = program("content");
    run.arg("--scene").arg(scene).args(["run", "--ros2", "--json", "--start", "300"]);
    let publisher = answering(Process::start(&mut run), || program("content"));
    let length = seconds.to_string();
    let reliable = Process::start(&mut content("content", "handles", "reliable", &length));
    let best_effort = Process::start(&mut content("content", "poses", "best_effort", &length));
    for (subscriber, may_lose) in [(reliable, false), (best_effort, true)] {
        let output = subscriber.output();
        let line = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
        println!("{line}");
        assert_eq!(line["different"], 0, "{line}");
        assert!(line["compared"].as_u64().unwrap() > 20 * seconds, "{line}");
        assert!(may_lose || line["missing"] == 0, "{line}");
    }
    publisher.signal(nix::sys::signal::Signal::SIGINT);
    let output = publisher.output();
    let (summary, number) = (harness::summary(&output), |value: &Value| value.as_u64().unwrap());
    let handled = number(&summary["ros2"]["frames"]) + number(&summary["ros2"]["skipped"]);
    // A show does not wait for the process of ROS 2 for longer than 5 s, which a busy machine can take to start it.
    let is_late = text(&output.stderr).contains("has not connected in 5 s");
    assert!(handled == number(&summary["frames"]) || is_late && handled > 0, "{summary}");
    assert_eq!(summary["ros2"]["discarded"], 0);
}

#[test]
fn late_subscribers_get_the_contact_and_the_stage_and_every_type_is_that_of_msgs() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let scene = scene_file("all_topics", &[]);
    let all = "[publish.ros2]\nrate = 30.0\n\
               topics = [\"handles\", \"poses\", \"alerts\", \"stage\", \"diagnostics\", \"markers\", \"status\"]\n";
    std::fs::write(&scene, format!("{}\n{all}", std::fs::read_to_string(&scene).unwrap())).unwrap();
    let mut run = program("late");
    // In a domain of its own: the diagnostics of other shows would count as those of this one.
    run.env("ROS_DOMAIN_ID", "15").args(["--scene", scene.to_str().unwrap(), "run", "--json", "--start", "412"]);
    let publisher = Process::start(&mut run);
    // The contact is half a second after the start; ten seconds after the end a subscriber joins.
    let state = || text(&program("late").args(["control", "state"]).output().unwrap().stdout);
    wait_until("the show has ended", || state().contains("ended"));
    wait(10.0);
    let topics = [
        "alerts:reliable:transient_local",
        "stage:reliable:transient_local",
        "markers",
        "diagnostics",
        "status",
        "handles",
        "poses",
    ];
    let output = Process::start(peer("late", "300", &topics).args(["--domain", "15", "--until-each"])).output();
    let lines = json_lines(&output);
    assert!(!lines.is_empty(), "{}", text(&output.stderr));

    let alerts = messages(&lines, topics[0]);
    // The alert in effect.
    assert_eq!(alerts.len(), 1, "{alerts:?}");
    let alert = alerts[0];
    assert_eq!((&alert["level"], &alert["event"]), (&2.into(), &2.into()));
    assert_eq!((&alert["event_bench_a"], &alert["event_bench_b"]), (&0.into(), &8.into()));
    assert!((alert["event_time"].as_f64().unwrap() - 412.473837682115).abs() < 1e-9);

    let stages = messages(&lines, topics[1]);
    assert_eq!(stages.len(), 1, "{stages:?}");
    assert_eq!(stages[0]["dragons"][0]["pitch"], 0.55);
    assert_eq!(stages[0]["dragons"][0]["benches"], 223);
    assert_eq!(stages[0]["segments"].as_array().unwrap().len(), 1);
    assert_eq!(stages[0]["segments"][0]["kind"], 2);
    let scene_hash = blake3::hash(&std::fs::read(&scene).unwrap());
    assert_eq!(stages[0]["scene_hash"], serde_json::json!(scene_hash.as_bytes()));
    assert_eq!(stages[0]["header"]["frame_id"], "stage");

    let handles = messages(&lines, "handles");
    let frame = handles.last().unwrap();
    assert_eq!((&frame["handles"], &frame["count"], &frame["state"]), (&224.into(), &224.into(), &2.into()));
    assert_eq!((&frame["playback"], &frame["epoch"], &frame["cue"]), (&3.into(), &0.into(), &0.into()));
    let [sec, nanosec] = ["sec", "nanosec"].map(|part| frame["header"]["stamp"][part].as_u64().unwrap());
    assert_eq!(frame["stamp_ns"].as_u64(), Some(sec * 1_000_000_000 + nanosec));
    let handle = |index: usize| ["x", "y"].map(|coordinate| frame["poses"][index][coordinate].as_f64().unwrap());
    let (head, second) = (handle(0), handle(1));
    assert!(((head[0] - second[0]).hypot(head[1] - second[1]) - 2.86).abs() < 1e-12);

    let markers = messages(&lines, "markers");
    let markers = markers.last().unwrap()["markers"].as_array().unwrap();
    assert_eq!(markers.len(), 223 + 7, "a cube for every bench, and signs");
    // The head's cube lies between its handles, along the line that joins them.
    let bench = &markers[0];
    assert_eq!((&bench["type"], &bench["action"]), (&1.into(), &0.into()));
    let centre = ["x", "y"].map(|coordinate| bench["pose"]["position"][coordinate].as_f64().unwrap());
    assert!((centre[0] - 0.5 * (head[0] + second[0])).abs() < 1e-9);
    assert!((centre[1] - 0.5 * (head[1] + second[1])).abs() < 1e-9);
    let [z, w] = ["z", "w"].map(|part| bench["pose"]["orientation"][part].as_f64().unwrap());
    let direction = (2.0 * w * w - 1.0, 2.0 * w * z);
    assert!((direction.0 - (head[0] - second[0]) / 2.86).abs() < 1e-9, "{direction:?}");
    assert!((direction.1 - (head[1] - second[1]) / 2.86).abs() < 1e-9, "{direction:?}");
    let contact = &markers[223];
    assert_eq!((&contact["ns"], &contact["type"], &contact["action"]), (&"contact".into(), &2.into(), &0.into()));
    assert_eq!(contact["pose"]["position"]["x"], alert["event_x"]);
    assert_eq!((&markers[224]["ns"], &markers[224]["action"]), (&"coming".into(), &2.into()), "it has come");
    let sentence = "bench 1 (the head) and bench 9 touched at (1.474, 2.111) m, t = 412.473838 s (counting from 1)";
    assert_eq!((&markers[225]["action"], &markers[225]["text"]), (&0.into(), &sentence.into()));

    // Every publisher's diagnostics are on one topic.
    let diagnostics = messages(&lines, "diagnostics");
    let of_this = |message: &&Value| message["status"][1]["hardware_id"] == unique("late");
    let dragon = &diagnostics.into_iter().rfind(of_this).unwrap()["status"][1];
    assert_eq!((&dragon["level"], &dragon["message"]), (&2.into(), &"contact".into()));
    let status = messages(&lines, "status");
    assert_eq!(status.last().unwrap()["scene"], "paper");
    assert_eq!(status.last().unwrap()["rate"], 60.0);

    assert!(handles.len() > 1 && end(&output)["counts"]["poses"].as_u64().unwrap() > 1);
    let summary = stopped(publisher);
    // A thirtieth of a second is left out only if both of its periods were skipped, or before stage and scene have
    // come. The process waits for these up to two seconds.
    let number = |value: &Value| value.as_u64().unwrap();
    let [frames, skipped] = ["frames", "skipped"].map(|key| number(&summary[key]));
    let offered = number(&summary["ros2"]["frames"]) + number(&summary["ros2"]["skipped"]);
    assert!((frames / 2 - 60..=(frames + skipped) / 2 + 1).contains(&offered), "{summary}");
}

#[test]
fn markers_show_what_is_coming_and_where() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let scene = scene_file("markers_coming", &[]);
    let topics = "[publish.ros2]\ntopics = [\"markers\", \"alerts\"]\n";
    std::fs::write(&scene, format!("{}\n{topics}", std::fs::read_to_string(&scene).unwrap())).unwrap();
    let arguments = ["--start", "408", "--time-scale", "0.01"];
    let _publisher =
        Process::start(program("coming").args(["--scene", scene.to_str().unwrap(), "run", "--quiet"]).args(arguments));
    let output = Process::start(peer("coming", "300", &["markers"]).arg("--until-each")).output();
    let lines = json_lines(&output);
    let markers = messages(&lines, "markers");
    let markers = markers.last().expect("markers")["markers"].as_array().unwrap();
    let of = |ns: &str| markers.iter().filter(|marker| marker["ns"] == ns && marker["action"] == 0).collect::<Vec<_>>();
    assert!(of("contact").is_empty(), "nothing has touched");
    // A dashed ring of 0.75 m around the place where the paper's contact will be.
    let ring = of("coming")[0];
    let [x, y] = ["x", "y"].map(|part| ring["pose"]["position"][part].as_f64().unwrap());
    assert!((x - 1.474).abs() < 5e-4 && (y - 2.111).abs() < 5e-4, "({x}, {y})");
    let points = ring["points"].as_array().unwrap();
    let radius = |point: &Value| point["x"].as_f64().unwrap().hypot(point["y"].as_f64().unwrap());
    assert!(points.len() == 32 && points.iter().all(|point| (radius(point) - 0.75).abs() < 1e-9), "{points:?}");
    let sentence = of("sentence")[0]["text"].as_str().unwrap();
    let rest = sentence.strip_prefix("contact: bench 1 (the head) and bench 9 at (1.474, 2.111) m in ").unwrap();
    let (seconds, nearest) = rest.split_once(" s; nearest now are bench ").unwrap();
    // 4.47 s at a hundredth of the speed.
    assert!((380.0..448.0).contains(&seconds.parse::<f64>().unwrap()), "{sentence}");
    assert!(nearest.ends_with("(counting from 1)"), "{sentence}");
    let named: Vec<_> = of("numbers").iter().map(|marker| marker["text"].as_str().unwrap()).collect();
    assert!(named.starts_with(&["bench 1 (the head)", "bench 9"]) && named.len() <= 4, "{named:?}");
    // Red boards are those of the coming event, as on the page.
    let red = |bench: usize| {
        markers[bench]["color"]["r"].as_f64().unwrap() > 0.8 && markers[bench]["color"]["g"].as_f64().unwrap() < 0.2
    };
    assert!(red(0) && red(8) && !red(100));
}

#[test]
fn a_clean_end_leaves_the_graph_at_once() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let publisher = Process::start(program("gone").args(["run", "--ros2", "--json"]));
    let mut watcher = Process::start(&mut peer("gone", "40", &["poses"]));
    let lines = watcher.lines();
    lines.until("\"message\"");
    stopped(publisher);
    // The peer still watches, for less time than the lease of the participant that has gone.
    let last: Value = serde_json::from_str(&lines.until("\"end\"")).unwrap();
    assert_eq!(last["publishers"]["poses"], 0, "{last}");
}

#[test]
fn the_domain_is_the_environments() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let mut run = program("domain");
    let publisher = Process::start(run.env("ROS_DOMAIN_ID", "7").args(["run", "--ros2", "--json"]));
    let mut same = Process::start(peer("domain", "300", &["poses"]).args(["--domain", "7"]));
    hears_messages(&mut same);
    let other = Process::start(&mut peer("domain", "4", &["poses"])).output();
    assert_eq!(end(&other)["counts"]["poses"], 0);
    stopped(publisher);
}

#[test]
fn what_ros_2_cannot_do_is_refused_in_a_sentence() {
    for (variable, value, expected) in [
        ("ROS_DOMAIN_ID", "300", "0 to 232"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", "LOCALHOST"),
        ("ROS_LOCALHOST_ONLY", "maybe", "0 or 1"),
    ] {
        let output =
            Process::start(program("refused").env(variable, value).args(["run", "--ros2", "--duration", "1"])).output();
        let printed = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{printed}");
        assert!(printed.contains(variable) && printed.contains(expected), "{printed}");
        assert_eq!(printed.trim().lines().count(), 1, "{printed}");
    }
    let mut run = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let output = Process::start(run.args(["run", "--ros2", "--name", "2nd dragon"])).output();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("2nd dragon"));
}

#[test]
fn what_ros_2_honours_and_rustdds_does_not_is_named_in_a_warning() {
    let variables = [
        ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp"),
        ("ROS_DISCOVERY_SERVER", "10.0.0.1:11811"),
        ("CYCLONEDDS_URI", "file:///nowhere.xml"),
        ("ROS_STATIC_PEERS", "10.0.0.1"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"),
    ];
    // With ROS_LOCALHOST_ONLY, range and peers have no effect (ros2/rcl#1069).
    let mut run = program("warned");
    run.env("ROS_LOCALHOST_ONLY", "1").args(["run", "--ros2", "--duration", "3"]);
    let output = Process::start(run.envs(variables)).output();
    let printed = text(&output.stderr);
    assert!(output.status.success(), "{printed}");
    for (variable, _) in variables {
        let warned = printed.lines().filter(|line| line.contains("WARN") && line.contains(variable)).count();
        assert_eq!(warned, 1, "{variable}: {printed}");
    }
}

#[test]
fn a_reliable_subscriber_that_stops_reading_holds_nobody_up() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    // Unacknowledged, 5,000 benches would fill within six seconds the memory that a topic may use.
    let scene = scene_file(
        "stopped",
        &[("benches = 223", "benches = 5000"), ("start_turn = 16", "start_turn = 60"), ("[alerts]", "#[alerts]")],
    );
    let text_of_scene = std::fs::read_to_string(&scene).unwrap();
    let without_alerts: String =
        text_of_scene.lines().filter(|line| !line.starts_with("approach_")).collect::<Vec<_>>().join("\n");
    std::fs::write(&scene, format!("{without_alerts}\n[publish.ros2]\ntopics = [\"handles\"]\n")).unwrap();
    // The subscriber starts first: a slow start of Python takes nothing from the show.
    let mut stopped = Process::start(&mut peer("stopped", "600", &["handles"]));
    let mut run = program("stopped");
    let publisher = Process::start(run.args(["--scene", scene.to_str().unwrap(), "run", "--json", "--duration", "30"]));
    let lines = stopped.lines();
    // The first message of the subscriber.
    lines.until("handles");
    stopped.stop();
    let output = publisher.output();
    stopped.signal(nix::sys::signal::Signal::SIGKILL);
    let printed = text(&output.stderr);
    let summary = summary(&output);
    let number = |value: &Value| value.as_u64().unwrap();
    assert_eq!(number(&summary["frames"]) + number(&summary["skipped"]), 1800, "{summary}");
    // None, unless the machine is so busy that acknowledgements come seconds late. If the publisher kept what the
    // subscriber has not acknowledged, it would discard more than 1,400 of the 1,800 frames.
    assert!(number(&summary["ros2"]["discarded"]) <= 300, "{summary} {printed}");
    assert!(printed.matches("discarded").count() <= 1, "printed more than once: {printed}");
}

#[test]
fn without_being_asked_there_is_no_dds_thread_and_no_network_socket() {
    let plain = Process::start(program("plain").args(["run"]));
    let requested = Process::start(program("requested").args(["run", "--ros2"]));
    wait_until("both have opened their transports", || {
        let is_open = of_process(plain.id()).0.iter().any(|name| name.trim() == "control");
        is_open && child_of(requested.id()).is_some_and(speaks_dds)
    });
    // The process of a show has none, whether or not ROS 2 is requested.
    for show in [plain.id(), requested.id()] {
        let (threads, sockets) = of_process(show);
        assert_eq!((dds_threads(&threads), sockets), (0, 0), "{threads:?}");
    }
    // Proves that the same test finds threads and sockets if they exist.
    let child = child_of(requested.id()).unwrap();
    let (threads, sockets) = of_process(child);
    assert!(speaks_dds(child), "{threads:?}, {sockets} sockets");
    assert_eq!(child_of(plain.id()), None);
}

/// Returns true if a process has the threads and sockets of DDS.
fn speaks_dds(process: u32) -> bool {
    let (threads, sockets) = of_process(process);
    dds_threads(&threads) >= 2 && sockets >= 2
}

fn dds_threads(threads: &[String]) -> usize {
    threads.iter().filter(|name| name.contains("DDS")).count()
}

/// Returns the names of a process's threads and the number of its network sockets.
fn of_process(process: u32) -> (Vec<String>, usize) {
    // A process can end meanwhile.
    let folder = |name: &str| std::fs::read_dir(format!("/proc/{process}/{name}")).into_iter().flatten().flatten();
    let threads =
        folder("task").map(|task| std::fs::read_to_string(task.path().join("comm")).unwrap_or_default()).collect();
    let tables: String = ["tcp", "tcp6", "udp", "udp6"]
        .map(|table| std::fs::read_to_string(format!("/proc/{process}/net/{table}")).unwrap_or_default())
        .concat();
    let inodes: Vec<&str> = tables.lines().filter_map(|line| line.split_whitespace().nth(9)).collect();
    let sockets = folder("fd")
        .filter_map(|descriptor| std::fs::read_link(descriptor.path()).ok())
        .filter(|link| {
            let link = link.to_string_lossy().into_owned();
            link.strip_prefix("socket:[")
                .and_then(|inode| inode.strip_suffix(']'))
                .is_some_and(|inode| inodes.contains(&inode))
        })
        .count();
    (threads, sockets)
}

/// The configuration that ROS 2 makes of `ROS_STATIC_PEERS=10.77.0.1` for Cyclone DDS.
const STATIC_PEER: &str = "<CycloneDDS><Domain><Discovery><ParticipantIndex>auto</ParticipantIndex>\
    <Peers><Peer Address=\"10.77.0.1\"/></Peers></Discovery></Domain></CycloneDDS>";

#[test]
fn two_hosts_find_each_other_by_multicast_or_where_the_subscriber_names_the_publishers_host() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let hosts = match Hosts::new() {
        Ok(hosts) => hosts,
        Err(why) => return not_run(&format!("two hosts need network namespaces (root and iproute2): {}", why.trim())),
    };
    let on = |host: &str, command: &Command| hosts.on(host, Path::new(env!("CARGO_MANIFEST_DIR")), command);
    for (range, multicast, peers, expected) in [
        ("SUBNET", "on", "", true),
        ("LOCALHOST", "on", "", false),
        ("SUBNET", "off", "", false),
        ("SUBNET", "off", STATIC_PEER, true),
    ] {
        hosts.set_multicast(multicast);
        let mut run = program("hosts");
        run.args(["run", "--ros2", "--json"]);
        let publisher = Process::start(on("left", &run).env("ROS_AUTOMATIC_DISCOVERY_RANGE", range));
        // A subscriber announces itself to its static peers in a burst when it starts: the publisher must hear it.
        wait_until("ROS 2 is up", || child_of(publisher.id()).is_some_and(speaks_dds));
        let subscriber = peer("hosts", if expected { "300" } else { "5" }, &["poses"]);
        let mut reader = Process::start(on("right", &subscriber).env("CYCLONEDDS_URI", peers));
        println!("{range}, multicast {multicast}, peers \"{peers}\"");
        if expected {
            hears_messages(&mut reader);
        } else {
            assert_eq!(end(&reader.output())["counts"]["poses"], 0);
        }
        stopped(publisher);
    }
}

#[test]
fn the_example_that_needs_no_ros_prints_the_frames() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    // A domain each: no listener may hear the publisher of another range.
    for (domain, range) in [("22", None), ("23", Some("LOCALHOST"))] {
        let environment = [Some(("ROS_DOMAIN_ID", domain)), range.map(|of| ("ROS_AUTOMATIC_DISCOVERY_RANGE", of))];
        let environment: Vec<(&str, &str)> = environment.into_iter().flatten().collect();
        let publisher = Process::start(program("example").envs(environment.clone()).args(["run", "--ros2", "--json"]));
        let mut example = python();
        example.args(["examples/python/cyclone_listener.py", "--name", &unique("example"), "--seconds", "300"]);
        let mut example = Process::start(example.envs(environment));
        let printed = example.lines();
        (0..3).for_each(|_| drop(printed.until("224 handles, head (")));
        stopped(publisher);
    }
}
