//! A show of several dragons on ROS 2, live and from a recording, as a Cyclone DDS subscriber receives it.
#![cfg(feature = "ros2")]

use crate::harness;

use std::path::{Path, PathBuf};
use std::process::Command;

use harness::{Process, can_run, program, python, python_modules, stopped, text, unique, wait_for_bytes};
use serde_json::Value;

const DOMAIN: &str = "16";
/// The dragons of `config/coil.toml`: names and handles, of which the last one names no bench.
const DRAGONS: [(&str, usize, usize); 2] = [("gold", 0, 60), ("jade", 61, 121)];
/// The start of either spiral, metres from the origin: eight turns of 1.7 m.
const RADIUS: f64 = 13.6;

/// Returns the coil with these further lines and a queue that loses nothing.
fn scene(folder: &Path, added: &str) -> PathBuf {
    let text = include_str!("../../config/coil.toml").replace("[publish]", "[publish]\nqueue = 3000");
    let file = folder.join("coil.toml");
    std::fs::write(&file, format!("{added}\n{text}")).unwrap();
    file
}

/// Returns a Cyclone DDS process that prints its messages of these topics.
fn peer(name: &str, topics: &[&str]) -> Command {
    let mut command = python();
    command.args(["tests/python/ros2_peer.py", "--seconds", "300", "--domain", DOMAIN, "--name", &unique(name)]);
    topics.iter().for_each(|topic| {
        command.args(["--topic", topic]);
    });
    command
}

/// Returns the messages of a topic.
fn messages<'a>(lines: &'a [Value], topic: &str) -> Vec<&'a Value> {
    lines.iter().filter(|line| line["topic"] == topic).map(|line| &line["message"]).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn place(value: &Value) -> [f64; 2] {
    ["x", "y"].map(|axis| number(&value[axis]))
}

/// Returns the texts of the markers that are shown.
fn texts(message: &Value) -> Vec<&str> {
    let shown = message["markers"].as_array().unwrap().iter().filter(|marker| marker["action"] == 0);
    shown.map(|marker| marker["text"].as_str().unwrap()).filter(|text| !text.is_empty()).collect()
}

/// The paths of both dragons, one after the other: each begins 13.6 m from the origin and ends there.
fn assert_paths(path: &Value) {
    let poses = path["poses"].as_array().unwrap();
    let places: Vec<[f64; 2]> = poses.iter().map(|pose| place(&pose["pose"]["position"])).collect();
    let starts: Vec<usize> =
        (0..places.len()).filter(|k| (places[*k][0].hypot(places[*k][1]) - RADIUS).abs() < 1e-9).collect();
    let [0, second] = starts[..] else { panic!("{starts:?}") };
    let [gold, jade] = [places[0], places[second]];
    assert!((gold[0] + jade[0]).abs() < 1e-9 && (gold[1] + jade[1]).abs() < 1e-9, "{gold:?} {jade:?}");
    for end in [places[second - 1], places[places.len() - 1]] {
        assert!(end[0].abs() < 1e-12 && end[1].abs() < 1e-12, "{end:?}");
    }
}

/// Head and tail of each dragon in every transform: the heads where the first cubes have their front handles.
fn assert_transforms(name: &str, message: &Value) {
    let transforms = message["transforms"].as_array().unwrap();
    let frames: Vec<_> = transforms.iter().map(|of| of["child_frame_id"].as_str().unwrap().to_owned()).collect();
    let of =
        |(dragon, ..): (&str, usize, usize)| ["head", "tail"].map(|end| format!("{}/{dragon}/{end}", unique(name)));
    assert_eq!(frames, DRAGONS.map(of).concat());
}

/// A cube for each board, by the numbers of the show.
fn assert_cubes(message: &Value) {
    let cubes = message["markers"].as_array().unwrap().iter().filter(|marker| marker["ns"] == "benches");
    let ids: Vec<u64> = cubes.map(|cube| cube["id"].as_u64().unwrap()).collect();
    let expected: Vec<u64> = DRAGONS.iter().flat_map(|(_, first, last)| *first as u64..*last as u64).collect();
    assert_eq!(ids, expected);
}

#[test]
fn a_show_of_two_is_on_every_topic_with_its_names() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let (folder, name) = (tempfile::tempdir().unwrap(), "ros2_several");
    let topics = ["handles", "markers", "tf", "alerts", "stage", "path", "rosout", "diagnostics"];
    let quoted = topics.iter().filter(|topic| **topic != "rosout").map(|topic| format!("{topic:?}"));
    let quoted = quoted.collect::<Vec<_>>().join(", ");
    let scene = scene(folder.path(), "");
    let text_of_scene = std::fs::read_to_string(&scene).unwrap();
    let settings = format!("[publish.ros2]\nrate = 10.0\ntopics = [{quoted}]\n[[cues]]\nname = \"near\"\nat = 325.5\n");
    std::fs::write(
        &scene,
        text_of_scene.replace("[[dragons]]\nname = \"gold\"", &format!("{settings}[[dragons]]\nname = \"gold\"")),
    )
    .unwrap();
    let recording = folder.path().join("show.mcap");
    let mut record = program(name);
    let record = Process::start(record.args(["--json", "record", "-o"]).arg(&recording));
    let mut run = program(name);
    run.arg("--scene").arg(&scene).args(["run", "--json", "--paused", "--start", "325", "--duration", "300"]);
    let run = Process::start(run.env("ROS_DOMAIN_ID", DOMAIN));
    watch_to_the_contact(name, &topics, || {
        let go = program(name).args(["control", "go"]).output().unwrap();
        assert!(go.status.success(), "{}", text(&go.stderr));
    });
    wait_for_bytes(&recording, 100_000);
    stopped(run);
    stopped(record);

    // The recording of the show, played on ROS 2: the same names.
    let replayed = "ros2_several_again";
    let mut replay = program(replayed);
    replay.arg("--scene").arg(&scene).args(["replay", "--json", "--loop"]).arg(&recording);
    let _replay = Process::start(replay.env("ROS_DOMAIN_ID", DOMAIN));
    watch_to_the_contact(replayed, &topics[..7], || ());
}

/// Subscribes until the contact has been announced, and checks every topic.
fn watch_to_the_contact(name: &str, topics: &[&str], go: impl FnOnce()) {
    let latched = |topic: &&&str| ["alerts", "stage", "path", "rosout"].contains(*topic);
    let wanted: Vec<String> = topics
        .iter()
        .map(|topic| if latched(&topic) { format!("{topic}:reliable:transient_local") } else { (*topic).to_owned() })
        .collect();
    let mut subscriber = Process::start(&mut peer(name, &wanted.iter().map(String::as_str).collect::<Vec<_>>()));
    let printed = subscriber.lines();
    let mut lines: Vec<Value> = Vec::new();
    let topic = |name: &str| wanted.iter().find(|wanted| wanted.split(':').next() == Some(name)).unwrap().as_str();
    let until = |lines: &mut Vec<Value>, what: &str, enough: &dyn Fn(&[Value]) -> bool| {
        while !enough(lines) {
            let line = printed.all_until_one(|_| true, what).pop().unwrap();
            lines.push(serde_json::from_str(&line).unwrap());
        }
    };
    until(&mut lines, "a message of every topic", &|lines| {
        ["handles", "markers", "tf", "stage", "path"].iter().all(|name| !messages(lines, topic(name)).is_empty())
    });
    go();
    let contact = "bench 1 (the head) of gold and bench 1 (the head) of jade touched at (1.873, 1.043) m";
    until(&mut lines, "the contact in /rosout", &|lines| {
        messages(lines, topic("rosout")).iter().any(|line| line["msg"].as_str().unwrap().contains(contact))
    });
    until(&mut lines, "the contact in the alerts", &|lines| {
        messages(lines, topic("alerts")).iter().any(|alert| alert["level"] == 2)
    });
    until(&mut lines, "the contact in the markers", &|lines| {
        messages(lines, topic("markers"))
            .last()
            .is_some_and(|message| texts(message).iter().any(|words| words.contains(contact)))
    });

    let rosout: Vec<&str> =
        messages(&lines, topic("rosout")).iter().map(|line| line["msg"].as_str().unwrap()).collect();
    let coming = "approaching: contact: bench 1 (the head) of gold and bench 1 (the head) of jade at (1.873, 1.043) m";
    assert!(rosout.iter().any(|line| line.contains(coming) && line.contains("; nearest now are ")), "{rosout:?}");
    assert!(rosout.iter().any(|line| line.contains("cue 1 \"near\"")), "{rosout:?}");
    let markers = messages(&lines, topic("markers"));
    assert_cubes(markers[0]);
    let last = texts(markers[markers.len() - 1]);
    for (dragon, ..) in DRAGONS {
        let name = format!("bench 1 (the head) of {dragon}");
        assert!(last.contains(&name.as_str()), "{last:?}");
    }
    messages(&lines, topic("tf")).iter().for_each(|message| assert_transforms(name, message));
    assert_paths(messages(&lines, topic("path"))[0]);
    let alerts = messages(&lines, topic("alerts"));
    let touched = alerts.iter().find(|alert| alert["level"] == 2).unwrap();
    assert_eq!((&touched["event_bench_a"], &touched["event_bench_b"]), (&0.into(), &61.into()));
    assert_eq!(messages(&lines, topic("handles"))[0]["count"], 122);
    let stage = messages(&lines, topic("stage"))[0];
    let dragons: Vec<_> =
        stage["dragons"].as_array().unwrap().iter().map(|of| (&of["first_handle"], &of["benches"])).collect();
    assert_eq!(dragons, [(&0.into(), &60.into()), (&61.into(), &60.into())]);
    let transforms = messages(&lines, topic("tf"));
    let frames = messages(&lines, topic("handles"));
    let compared = transforms.iter().filter(|message| {
        let parts = message["transforms"].as_array().unwrap();
        let frame = frames.iter().find(|frame| frame["header"]["stamp"] == parts[0]["header"]["stamp"]);
        // The peer keeps the first three handles and the last.
        frame.is_some_and(|frame| {
            let (poses, of) =
                (frame["poses"].as_array().unwrap(), |k: usize| place(&parts[k]["transform"]["translation"]));
            assert_eq!((place(&poses[0]), place(&poses[3])), (of(0), of(3)));
            true
        })
    });
    assert!(compared.count() > 2, "no transform belongs to a received frame");
}
