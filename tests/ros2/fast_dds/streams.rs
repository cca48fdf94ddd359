//! Subscriptions of rclpy's default, and the relief of a writer, as Fast DDS sees them.

use std::collections::BTreeSet;
use std::time::Duration;

use super::*;

/// `create_subscription(..., 10)` of rclpy: reliable, volatile, depth 10. All topics but the constant ones, each with a
/// subscriber.
#[test]
fn a_default_subscription_gets_every_topic_and_discovers_its_quality_of_service() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "default_fast";
    let streams = ["handles", "poses", "diagnostics", "markers", "status", "clock", "tf"];
    let topics = [&streams[..], &["alerts", "cues"]].concat();
    let cues: String = (0..32)
        .map(|number| format!("[[cues]]\nname = \"{number}\"\nat = {}\n", 60.0 + 11.0 * f64::from(number)))
        .collect();
    let quoted = topics.iter().map(|topic| format!("{topic:?}")).collect::<Vec<_>>().join(", ");
    let changes = [("benches = 223", "benches = 23"), ("approach_time = 10.0", "approach_time = 1000.0")];
    let scene = scene_file(name, &changes);
    let of_scene = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(&scene, format!("{of_scene}\n[publish.ros2]\ntopics = [{quoted}]\n{cues}")).unwrap();
    let show = ["--scene", scene.to_str().unwrap(), "run", "--json", "--start", "50", "--duration", "600"];
    let publisher = publisher(name, &show);
    // The first message can be lost to discovery: a second proves the subscription.
    let until_second = ["--depth", "10", "--samples", "2", "--linger", "0", "--seconds", "60", "--shared-memory"];
    let start = |topic: &&str| Process::start(&mut subscriber(name, topic, &until_second));
    let subscribers: Vec<Process> = topics.iter().map(start).collect();
    // Until the subscriber ends by itself: a killed one leaves its shared memory.
    let end_of = |subscriber: &mut Process| end(&subscriber.lines().rest());
    for (topic, mut subscriber) in topics.iter().zip(subscribers) {
        let mut end = end_of(&mut subscriber);
        // A participant of Fast DDS that starts beside many others may discover nothing. Cues come until 401 s.
        for _ in 0..4 {
            if end["samples"].as_u64() < Some(2) {
                end = end_of(&mut start(topic));
            }
        }
        let durability = if streams.contains(topic) { "volatile" } else { "transient_local" };
        assert!(end["samples"].as_u64() >= Some(2), "{topic}: {end}");
        assert_eq!(end["offered"], format!("reliable {durability}"), "{topic}");
    }
    stopped(publisher);
}

/// Older messages are acknowledged in the name of a subscriber that is stopped for longer than messages are kept.
#[test]
fn a_subscriber_that_was_stopped_gets_the_messages_of_now() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "stopped_fast";
    let publisher = publisher(name, &["run", "--json", "--ros2", "--start", "50", "--duration", "600"]);
    let mut subscriber = Process::start(&mut subscriber(name, "handles", &["--depth", "10", "--seconds", "300"]));
    let printed = subscriber.lines();
    let sequence = |line: &str| -> Option<u64> {
        let line: Value = serde_json::from_str(line).unwrap();
        (line["type"] == "sample").then(|| line["sequence"].as_u64().unwrap())
    };
    let first = printed.all_until_one(|line| sequence(line).is_some(), "a message");
    let before = first.last().and_then(|line| sequence(line)).unwrap();
    subscriber.signal(Signal::SIGSTOP);
    // RustDDS removes acknowledged messages every six seconds.
    std::thread::sleep(Duration::from_secs(9));
    subscriber.signal(Signal::SIGCONT);
    // 540 messages have been written since, on a busy machine fewer.
    let after = printed.all_until_one(|line| sequence(line).is_some_and(|number| number > before + 480), "one of now");
    let received: Vec<u64> = after.iter().filter_map(|line| sequence(line)).collect();
    assert!(received.is_sorted(), "{received:?}");
    assert!(received.iter().all(|number| *number > before), "{before} {received:?}");
    stopped(publisher);
}

/// The numbers of a writer begin at 1: a number smaller than the one before is from another writer.
#[test]
fn a_subscriber_loses_no_message_and_gets_none_twice_when_another_writer_relieves_the_first() {
    // The test takes two processors for a minute, and other tests then wait for discovery.
    if !long() || !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "relief";
    let scene = scene_file(name, &[("benches = 223", "benches = 5"), ("[alerts]", "#[alerts]")]);
    let of_scene = std::fs::read_to_string(&scene).unwrap();
    let lines: String =
        of_scene.lines().filter(|line| !line.starts_with("approach_")).map(|line| format!("{line}\n")).collect();
    std::fs::write(&scene, format!("{lines}\n[publish.ros2]\nrate = 2500.0\ntopics = [\"handles\"]\n")).unwrap();
    let show = ["--scene", scene.to_str().unwrap(), "run", "--json", "--rate", "2500", "--loop", "--duration", "3000"];
    let publisher = publisher(name, &show);
    let mut subscriber = Process::start(&mut subscriber(name, "handles", &["--seconds", "3000", "--depth", "20000"]));
    let printed = subscriber.lines();
    // The writer's number, and the frame's number, which follows the header of 24 bytes and the number of the run.
    let next = || {
        let sample: Value = serde_json::from_str(&printed.until(SAMPLE)).unwrap();
        let frame = u64::from_str_radix(&sample["hex"].as_str().unwrap()[64..80], 16).unwrap().swap_bytes();
        (sample["sequence"].as_u64().unwrap(), frame)
    };
    let (mut before, first) = next();
    let mut frames = vec![first];
    let mut greatest = 0;
    // Until some time after the relief, since the first writer may still retransmit.
    let mut remaining = 20_000;
    while remaining > 0 {
        let (number, frame) = next();
        frames.push(frame);
        greatest = greatest.max(before);
        remaining -= u32::from(number + 50_000 < greatest);
        before = number;
    }
    let ros2 = &stopped(publisher)["ros2"];
    let received = frames.len();
    let frames: BTreeSet<u64> = frames.into_iter().collect();
    assert_eq!(frames.len(), received, "frames come twice");
    let missing = frames.last().unwrap() - frames.first().unwrap() + 1 - received as u64;
    println!("{missing} of {received} frames are missing: {ros2}; the first writer wrote {greatest}");
    // A busy process of ROS 2 skips frames. Beside a subscriber that is too slow it drops messages, which is another
    // test.
    let is_slow = ros2["discarded"] != 0;
    assert!(is_slow || missing <= ros2["skipped"].as_u64().unwrap(), "{missing} are missing: {ros2}");
}
