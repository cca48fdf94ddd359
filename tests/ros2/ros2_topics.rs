//! The ROS 2 topics of standard types, and the cues, as a Cyclone DDS subscriber receives them.
#![cfg(feature = "ros2")]

use crate::harness;

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use bench_dragon::soak::resources::child_of;
use harness::{
    Process, can_run, json_lines, long, program, python, python_modules, scene_file, stopped, summary, text, unique,
};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
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

/// Returns the messages of a topic.
fn messages<'a>(lines: &'a [Value], topic: &str) -> Vec<&'a Value> {
    lines.iter().filter(|line| line["topic"] == topic).map(|line| &line["message"]).collect()
}

#[test]
fn cues_path_clock_and_transforms_are_those_of_the_show() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    // Two frames a second over ROS 2, and three cues within a sixth of a second.
    let scene = scene_file("shown", &[]);
    let of_scene = std::fs::read_to_string(&scene).unwrap();
    let cues = [(50.35, "first"), (50.4, "second"), (50.45, "third")];
    let cues = cues.map(|(at, name)| format!("[[cues]]\nname = \"{name}\"\nat = {at}\n")).concat();
    let topics = "[publish.ros2]\nrate = 2.0\ntopics = [\"handles\", \"cues\", \"path\", \"clock\", \"tf\"]\n";
    std::fs::write(&scene, format!("{of_scene}\n{topics}\n{cues}")).unwrap();
    let mut run = program("shown");
    run.args(["--scene", scene.to_str().unwrap(), "run", "--json", "--paused", "--start", "50.25"]);
    // /clock and /tf belong to the whole domain.
    let publisher = Process::start(run.args(["--duration", "300"]).env("ROS_DOMAIN_ID", "9"));
    let topics = ["handles", "clock", "tf", "path:reliable:transient_local", "cues:reliable:transient_local"];
    let mut subscriber = Process::start(peer("shown", "300", &topics).args(["--domain", "9"]));
    let printed = subscriber.lines();
    let mut lines: Vec<Value> = Vec::new();
    let until = |lines: &mut Vec<Value>, enough: &dyn Fn(&[Value]) -> bool| {
        while !enough(lines) {
            lines.push(serde_json::from_str(&printed.until("")).unwrap());
        }
    };
    // A transform is sent when its stamp changes, so that there is none yet.
    let paused = [topics[0], topics[1], topics[3]];
    until(&mut lines, &|lines| paused.iter().all(|topic| !messages(lines, topic).is_empty()));
    let control = |command: &[&str]| {
        let output = program("shown").arg("control").args(command).output().unwrap();
        assert!(output.status.success(), "{}", text(&output.stderr));
    };
    control(&["go"]);
    let latest = |lines: &[Value]| messages(lines, topics[4]).last().is_some_and(|cue| cue["number"] == 3);
    until(&mut lines, &latest);
    let so_far = ["clock", "tf"].map(|topic| (topic, messages(&lines, topic).len()));
    until(&mut lines, &|lines| so_far.iter().all(|(topic, count)| messages(lines, topic).len() > count + 3));
    // A late subscriber gets the latest cue and the path, once. Just after the cues it gets none of the earlier ones,
    // unless a busy machine is too late: a fault would show every time.
    let is_withheld = (0..5).any(|attempt| {
        if attempt > 0 {
            control(&["seek", "50.25"]);
            until(&mut Vec::new(), &latest);
        }
        let late = Process::start(peer("shown", "300", &topics[3..]).args(["--domain", "9", "--until-each"])).output();
        let late = json_lines(&late);
        assert!(latest(&late) && messages(&late, topics[3]).len() == 1, "{late:?}");
        messages(&late, topics[4]).len() == 1
    });
    assert!(is_withheld);
    publisher.signal(nix::sys::signal::Signal::SIGINT);
    let summary = summary(&publisher.output());
    assert!(summary["ros2"]["frames"].as_u64().unwrap() * 10 < summary["frames"].as_u64().unwrap(), "{summary}");

    let number = |value: &Value| value.as_f64().unwrap();
    let cues = messages(&lines, topics[4]);
    let names: Vec<_> = cues.iter().map(|cue| (cue["number"].clone(), cue["name"].clone())).collect();
    assert_eq!(names, [(1, "first"), (2, "second"), (3, "third")].map(|(number, name)| (number.into(), name.into())));
    for (cue, at) in cues.iter().zip([50.35, 50.4, 50.45]) {
        let late = number(&cue["sim_time"]) - at;
        assert!(number(&cue["cue_time"]) == at && late >= 0.0, "{cue}");
        assert_eq!(cue["pauses"], 0, "{cue}");
    }

    // The whole spiral: r = pitch theta / 2 pi, from 16 turns to the centre, clockwise.
    let [path] = messages(&lines, topics[3])[..] else { panic!("the path comes once") };
    assert_eq!(path["header"]["frame_id"], "stage");
    let poses = path["poses"].as_array().unwrap();
    let position = |pose: &Value| ["x", "y"].map(|axis| number(&pose["pose"]["position"][axis]));
    let (mut theta, mut before) = (16.0 * std::f64::consts::TAU, position(&poses[0]));
    let (centre, spiral) = poses.split_last().unwrap();
    for pose in spiral {
        let [x, y] = position(pose);
        let turned = (before[0] * y - before[1] * x).atan2(before[0] * x + before[1] * y);
        assert!(turned <= 0.0 && turned > -0.1, "{pose}");
        (theta, before) = (theta + turned, [x, y]);
        assert!((x.hypot(y) - 0.55 * theta / std::f64::consts::TAU).abs() < 1e-9, "{pose}");
    }
    assert!(theta > 0.0 && theta < 0.1 && position(centre).iter().all(|x| x.abs() < 1e-12), "{theta} before {centre}");
    let [z, w] = ["z", "w"].map(|part| number(&poses[0]["pose"]["orientation"][part]));
    let slope = -1.0 / (16.0 * std::f64::consts::TAU);
    assert!((2.0 * z.atan2(w) - (slope - std::f64::consts::FRAC_PI_2)).abs() < 1e-4, "{}", poses[0]);

    // Paused, then from tick to tick.
    let clock = messages(&lines, "clock");
    let times: Vec<f64> = clock
        .iter()
        .map(|message| number(&message["clock"]["sec"]) + number(&message["clock"]["nanosec"]) * 1e-9)
        .collect();
    assert!(times[0] == 50.25 && times.is_sorted() && times[times.len() - 1] > 51.0, "{times:?}");
    for time in times {
        let ticks = (time - 50.25) * 60.0;
        assert!((ticks - ticks.round()).abs() < 1e-6, "{time} is between two frames");
    }

    // Head and tail as in the frame of the same stamp.
    let mut compared = 0;
    for message in messages(&lines, "tf") {
        let transforms = message["transforms"].as_array().unwrap();
        let stamp = &transforms[0]["header"]["stamp"];
        let Some(frame) = messages(&lines, "handles").into_iter().find(|frame| frame["header"]["stamp"] == *stamp)
        else {
            continue;
        };
        compared += 1;
        let handles = frame["poses"].as_array().unwrap();
        assert_eq!(transforms.len(), 2);
        for (transform, (end, handle)) in transforms.iter().zip([("head", &handles[0]), ("tail", &handles[3])]) {
            assert_eq!(transform["header"], frame["header"]);
            assert_eq!(transform["child_frame_id"], format!("{}/{end}", unique("shown")));
            let (place, turn) = (&transform["transform"]["translation"], &transform["transform"]["rotation"]);
            assert_eq!((&place["x"], &place["y"], &place["z"]), (&handle["x"], &handle["y"], &0.0.into()));
            let error = 2.0 * number(&turn["z"]).atan2(number(&turn["w"])) - number(&handle["heading"]);
            assert!(error.sin().abs() < 1e-9 && error.cos() > 0.0, "{transform} and {handle}");
        }
    }
    assert!(compared > 2, "{compared} transforms belong to a received frame");
}

/// Returns a stamp in nanoseconds.
fn nanoseconds(stamp: &Value) -> u64 {
    stamp["sec"].as_u64().unwrap() * 1_000_000_000 + stamp["nanosec"].as_u64().unwrap()
}

/// A node with `use_sim_time` takes a frame that comes before its clock for one of its future. To `tf2` a transform with
/// the stamp of the one before is an error.
#[test]
fn the_clock_comes_before_its_frame_and_no_transform_has_the_stamp_of_the_one_before() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "clock_first";
    let mut run = program(name);
    run.args(["--scene", "config/ros2.toml", "run", "--json", "--start", "50", "--duration", "300"]);
    let publisher = Process::start(run.env("ROS_DOMAIN_ID", "21"));
    let mut subscriber = Process::start(peer(name, "300", &["handles", "clock", "tf"]).args(["--domain", "21"]));
    let printed = subscriber.lines();
    let mut lines: Vec<Value> = Vec::new();
    let mut until = |enough: &dyn Fn(&[Value]) -> bool| {
        while !enough(&lines) {
            lines.push(serde_json::from_str(&printed.until("")).unwrap());
        }
        messages(&lines, "tf").len()
    };
    let control = |command: &str| {
        let done = program(name).args(["control", command]).output().unwrap();
        assert!(done.status.success(), "{}", text(&done.stderr));
    };
    until(&|lines| messages(lines, "tf").len() > 60);
    control("pause");
    let is_paused = |message: &&Value| message["playback"] == 1;
    let before = until(&|lines| messages(lines, "handles").into_iter().filter(is_paused).count() > 60);
    control("resume");
    until(&|lines| messages(lines, "tf").len() > before + 60);
    stopped(publisher);

    let of_tf = |message: &Value| nanoseconds(&message["transforms"][0]["header"]["stamp"]);
    let stamps: Vec<u64> = messages(&lines, "tf").into_iter().map(of_tf).collect();
    assert!(stamps.windows(2).all(|pair| pair[0] < pair[1]), "{stamps:?}");
    let sent = |topic: &str, stamp: &dyn Fn(&Value) -> u64| -> BTreeMap<u64, i64> {
        let of_topic = lines.iter().filter(|line| line["topic"] == topic);
        let of_topic = of_topic.filter(|line| !is_paused(&&line["message"]));
        of_topic.map(|line| (stamp(&line["message"]), line["sent_ns"].as_i64().unwrap())).collect()
    };
    let clock = sent("clock", &|message| nanoseconds(&message["clock"]));
    let handles = sent("handles", &|message| nanoseconds(&message["header"]["stamp"]));
    let pairs: Vec<(i64, i64)> = handles.iter().filter_map(|(stamp, sent)| Some((*clock.get(stamp)?, *sent))).collect();
    // A message that comes again counts as sent then.
    let late = pairs.iter().filter(|(clock, frame)| clock > frame).count();
    assert!(pairs.len() > 60 && late * 10 < pairs.len(), "{late} of {} frames come before their clock", pairs.len());
}

/// Returns true if `poses`, `tf` and, where stamps are on it, `clock` have the stamp of a message of `handles`.
fn have_common_stamps(lines: &[Value], is_sim: bool) -> bool {
    let of_header = |message: &Value| nanoseconds(&message["header"]["stamp"]);
    let handles: BTreeSet<u64> = messages(lines, "handles").into_iter().map(of_header).collect();
    let has_one = |topic: &str, of: &dyn Fn(&Value) -> u64| {
        messages(lines, topic).into_iter().any(|message| handles.contains(&of(message)))
    };
    has_one("poses", &of_header)
        && has_one("tf", &|message| nanoseconds(&message["transforms"][0]["header"]["stamp"]))
        && (!is_sim || has_one("clock", &|message| nanoseconds(&message["clock"])))
}

/// Two shows with every topic: the scene of one leaves its stamps on `/clock`, the scene of the other puts them on wall
/// time.
#[test]
fn stamps_are_on_the_clock_or_on_wall_time_as_the_scene_requests() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let latched = ["alerts", "stage", "path", "cues"].map(|topic| format!("{topic}:reliable:transient_local"));
    let volatile = ["handles", "poses", "diagnostics", "markers", "status", "clock", "tf"].map(str::to_owned);
    let topics = [&latched[..], &volatile].concat();
    let shows = [("stamps_sim", "10", ""), ("stamps_wall", "11", "stamps = \"wall\"\n")];
    let started = shows.map(|(name, domain, stamps)| {
        // The subscriber decodes ten topics in Python: a long team is too much for it on a busy machine.
        let scene = scene_file(name, &[("benches = 223", "benches = 23")]);
        let names = topics.iter().map(|topic| format!("{:?}", topic.split(':').next().unwrap())).collect::<Vec<_>>();
        let added = format!("[publish.ros2]\n{stamps}topics = [{}]\n", names.join(", "));
        let cue = "[[cues]]\nname = \"early\"\nat = 50.5\n";
        std::fs::write(&scene, format!("{}\n{added}\n{cue}", std::fs::read_to_string(&scene).unwrap())).unwrap();
        let mut run = program(name);
        run.args(["--scene", scene.to_str().unwrap(), "run", "--json", "--start", "50.25", "--duration", "300"]);
        let publisher = Process::start(run.env("ROS_DOMAIN_ID", domain));
        let wanted: Vec<&str> = topics.iter().map(String::as_str).collect();
        let mut subscriber = Process::start(peer(name, "300", &wanted).args(["--domain", domain]));
        let printed = subscriber.lines();
        (publisher, subscriber, printed)
    });
    for ((_publisher, _subscriber, printed), is_sim) in started.into_iter().zip([true, false]) {
        let mut lines: Vec<Value> = Vec::new();
        let received = |lines: &[Value], topic: &String| messages(lines, topic).len();
        // Poses and transforms of one frame: tf2 finds a transform at the stamp of the poses. On a busy machine a topic
        // may begin late.
        while topics.iter().any(|topic| received(&lines, topic) < if latched.contains(topic) { 1 } else { 2 })
            || !have_common_stamps(&lines, is_sim)
        {
            lines.push(serde_json::from_str(&printed.until("")).unwrap());
        }
        for line in lines.iter().filter(|line| line["type"] == "message") {
            let (topic, message) = (line["topic"].as_str().unwrap(), &line["message"]);
            let parts = message["markers"].as_array().or(message["transforms"].as_array());
            let headers = parts
                .map_or_else(|| vec![&message["header"]], |parts| parts.iter().map(|part| &part["header"]).collect());
            for header in headers.into_iter().filter(|header| !header.is_null()) {
                let stamp = nanoseconds(&header["stamp"]);
                let of_show = message["sim_time"].as_f64().map(|seconds| (seconds * 1e9).round() as u64);
                match (is_sim, topic.split(':').next().unwrap()) {
                    // Stage and path hold at any time.
                    (true, "stage" | "path") => assert_eq!(stamp, 0, "{topic}"),
                    (true, _) => {
                        assert!((50_250_000_000..400_000_000_000).contains(&stamp), "{topic}: {stamp}");
                        assert!(of_show.is_none_or(|of_show| of_show.abs_diff(stamp) <= 1), "{topic}: {message}");
                    }
                    (false, _) => {
                        assert!(stamp > 1_700_000_000_000_000_000, "{topic}: {stamp}");
                        assert!(message["stamp_ns"].as_u64().is_none_or(|wall| wall == stamp), "{topic}: {message}");
                    }
                }
            }
        }
        // Cleared by RViz some periods after the publisher's death; only the first message is without an end.
        let markers = messages(&lines, "markers");
        for marker in markers[markers.len() - 1]["markers"].as_array().unwrap() {
            assert_eq!(marker["lifetime"], serde_json::json!({"sec": 1, "nanosec": 0}), "{marker}");
        }
    }
}

/// `create_subscription(..., 10)` of rclpy: reliable, volatile, depth 10. All topics but the constant ones.
#[test]
fn a_default_subscription_gets_every_topic_and_discovers_its_quality_of_service() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "default_depth";
    let scene = scene_file(name, &[("benches = 223", "benches = 23")]);
    let streams = ["handles", "poses", "diagnostics", "markers", "status", "clock", "tf"];
    let events = ["alerts", "cues"];
    let quoted = streams.iter().chain(&events).map(|topic| format!("{topic:?}")).collect::<Vec<_>>().join(", ");
    let cues: String = (0..32)
        .map(|number| format!("[[cues]]\nname = \"{number}\"\nat = {}\n", 60.0 + 5.0 * f64::from(number)))
        .collect();
    let added = format!("[publish.ros2]\ntopics = [{quoted}]\n{cues}");
    let text_of_scene = std::fs::read_to_string(&scene).unwrap();
    let countdown = text_of_scene.replace("approach_time = 10.0", "approach_time = 1000.0");
    std::fs::write(&scene, format!("{countdown}\n{added}")).unwrap();
    let mut run = program(name);
    run.args(["--scene", scene.to_str().unwrap(), "run", "--json", "--start", "50", "--duration", "600"]);
    let _publisher = Process::start(run.env("ROS_DOMAIN_ID", "13"));
    let topics = [&streams[..], &events].concat();
    let mut subscriber = Process::start(peer(name, "300", &topics).args(["--domain", "13", "--depth", "10"]));
    let printed = subscriber.lines();
    let mut lines: Vec<Value> = Vec::new();
    // The first message can be lost to discovery: a second proves the subscription.
    while topics.iter().any(|topic| messages(&lines, topic).len() < 2) {
        lines.push(serde_json::from_str(&printed.until("")).unwrap());
    }
    for topic in topics {
        let matched = lines.iter().find(|line| line["by"] == topic).unwrap();
        // The topics of a dead publisher are listed for this time.
        assert_eq!(matched["leases_s"], serde_json::json!([50.0]), "{matched}");
        let offered = &matched["offered"];
        let durability = if events.contains(&topic) { "TransientLocal" } else { "Volatile" };
        let offered: Vec<&str> = offered.as_array().unwrap().iter().map(|of| of.as_str().unwrap()).collect();
        let is_expected = |of: &&str| of.contains("Reliable") && of.contains(durability);
        assert!(!offered.is_empty() && offered.iter().all(is_expected), "{topic}: {offered:?}");
    }
}

/// `run` itself logs that the rate is too great, and later that the process of ROS 2 has ended.
#[test]
fn rosout_has_the_log_of_the_show_the_alerts_and_the_cues() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let scene = scene_file("rosout", &[("approach_time = 10.0", "approach_time = 1000.0")]);
    let added = "[publish.ros2]\nrate = 100.0\n[[cues]]\nname = \"early\"\nat = 50.5\n";
    std::fs::write(&scene, format!("{}\n{added}", std::fs::read_to_string(&scene).unwrap())).unwrap();
    let mut run = program("rosout");
    run.args(["--scene", scene.to_str().unwrap(), "run", "--rate", "30", "--start", "50", "--duration", "300"]);
    let publisher = Process::start(run.env("ROS_DOMAIN_ID", "12"));
    let topic = "rosout:reliable:transient_local";
    let mut subscriber = Process::start(peer("rosout", "300", &[topic]).args(["--domain", "12"]));
    let printed = subscriber.lines();
    // The log of the show and its events take different ways to the process of ROS 2.
    let expect = |mut expected: Vec<(&str, u8)>| {
        while !expected.is_empty() {
            let text = printed.until("\"message\"");
            let Some(place) = expected.iter().position(|(words, _)| text.contains(words)) else { continue };
            let (_, level) = expected.remove(place);
            let line: Value = serde_json::from_str(&text).unwrap();
            let message = &line["message"];
            assert_eq!((&message["level"], &message["name"]), (&level.into(), &unique("rosout").into()), "{message}");
            assert!(nanoseconds(&message["stamp"]) > 1_700_000_000_000_000_000, "{message}");
        }
    };
    expect(vec![
        ("publish.ros2.rate is 100, more than the loop's 30", 30),
        ("approaching: contact: bench 1 (the head) and bench 9", 30),
        ("cue 1 \\\"early\\\"", 20),
    ]);
    let process = child_of(publisher.id()).unwrap();
    kill(Pid::from_raw(process as i32), Signal::SIGKILL).unwrap();
    expect(vec![("the process of ROS 2 ended (signal: 9 (SIGKILL)): restarted in", 30)]);
}

/// Returns for `joins` subscribers, one after the other, the time of creation and all alerts.
fn joined(name: &str, joins: u32, further: &[&str]) -> Vec<(u64, Vec<u64>)> {
    let mut command = python();
    command.args(["tests/python/ros2_joins.py", "--name", &unique(name), "--joins", &joins.to_string()]);
    let output = Process::start(command.args(further)).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let joined = json_lines(&output).into_iter().map(|join| {
        let alerts = join["alerts"].as_array().unwrap().iter().map(|alert| alert["stamp_ns"].as_u64().unwrap());
        (join["made_ns"].as_u64().unwrap(), alerts.collect())
    });
    joined.collect()
}

/// A countdown raises an alert each second. A new subscriber gets the alert in effect and no earlier one, whether
/// earlier subscribers have left or there were none. Beside a subscriber that stays, the current alert is the last of
/// those it gets at once.
#[test]
fn a_late_subscriber_gets_the_current_alert_and_none_before_it() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let countdown = ("approach_time = 10.0", "approach_time = 1000.0");
    let scene = scene_file("countdown", &[countdown, ("accuracy = 1e-9", "solver = \"newton\"")]);
    let mut run = program("countdown");
    run.args(["--scene", scene.to_str().unwrap(), "run", "--ros2", "--quiet", "--rate", "30"]);
    let mut watch = Process::start(program("countdown").args(["watch", "--json"]));
    let printed = watch.lines();
    let _publisher = Process::start(&mut run);
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
    // On a busy machine an alert may be in flight for seconds. A fault would show in every join.
    let expect_few = |late: Vec<String>, joins: u32| assert!(late.len() <= joins as usize / 3, "{late:?}");
    let mut late = Vec::new();
    for (made, alerts) in joined("countdown", joins, &[]) {
        let published = publish_until(made.max(alerts[0]));
        let current = published.iter().rfind(|stamp| **stamp + 200_000_000 < made).unwrap();
        if alerts[0] < *current {
            late.push(format!("{} ms old", (current - alerts[0]) / 1_000_000));
        }
    }
    expect_few(late, joins);
    // A subscriber that does not request earlier messages gets none of them.
    let mut late = Vec::new();
    for (made, alerts) in joined("countdown", joins / 4, &["--volatile"]) {
        if alerts.first() <= Some(&made) {
            late.push(format!("{alerts:?} of before {made}"));
        }
    }
    expect_few(late, joins / 4);
    let mut late = Vec::new();
    for (made, alerts) in joined("countdown", joins / 4, &["--beside"]) {
        assert!(alerts.is_sorted(), "{alerts:?}");
        let published = publish_until(made.max(alerts[alerts.len() - 1]));
        let current = published.iter().rfind(|stamp| **stamp + 200_000_000 < made).unwrap();
        if alerts.last() < Some(current) {
            late.push(format!("{alerts:?} end before {current}"));
        }
    }
    expect_few(late, joins / 4);
}
