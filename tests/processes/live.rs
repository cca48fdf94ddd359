//! The live publisher as users meet it: real processes, the real shared memory, subscribers in Rust and in Python.
//!
//! Every process ends by a deadline, and no test asserts a speed: a subscriber must have received the frames that the
//! publisher's own summary counts.

use crate::harness;

use std::collections::BTreeSet;

use serde_json::Value;

use bench_dragon::client::shared_memory::{node, service_name};
use bench_dragon::messages::{FrameHeader, HandlePose};
use harness::{
    Lines, Place, Process, answering, can_run, example, json_lines, program, python, python_modules, scene_file,
    stopped, summary, text, unique, wait, wait_until,
};
use iceoryx2::prelude::ZeroCopySend;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use nix::sys::signal::Signal::{SIGINT, SIGTERM};

/// The Python modules that the example subscriber needs.
const PEER: [&str; 2] = ["iceoryx2", "numpy"];

/// Returns the JSON lines of a process up to the last one.
fn lines_until(lines: &Lines, is_last: impl Fn(&Value) -> bool) -> Vec<Value> {
    let mut read: Vec<Value> = Vec::new();
    while !read.last().is_some_and(&is_last) {
        read.push(serde_json::from_str(&lines.until("{")).unwrap());
    }
    read
}

/// Subscribers that join in the middle and outlast the publisher: none misses a frame, including the last one.
#[test]
fn every_subscriber_gets_every_frame_at_60_hz() {
    let watching = Process::start(program("sixty").args(["watch", "--json"]));
    // The queue holds all frames by which a subscriber falls behind.
    let scene = scene_file("sixty", &[("[publish]", "[publish]\nqueue = 480")]);
    let publisher =
        Process::start(program("sixty").arg("--scene").arg(&scene).args(["run", "--json", "--start", "300"]));
    let publisher = answering(publisher, || program("sixty"));
    // The example in Rust ends by time: it starts once the slow start of Python is over.
    let arguments = ["examples/python/subscribe.py", "--json", "--seconds", "600", "--name", &unique("sixty")];
    let python = can_run(python_modules(&PEER)).then(|| {
        let mut python = Process::start(python().args(arguments));
        let lines = python.lines();
        let first = lines.until("frame");
        (python, lines, first)
    });
    let rust = [1, 2].map(|_| Process::start(example("subscriber").args([&unique("sixty"), "12"])));
    wait(8.0);
    let summary = stopped(publisher);
    let [published, skipped] = ["frames", "skipped"].map(|key| summary[key].as_u64().unwrap());
    assert_eq!(summary["end"], "signal");
    for subscriber in rust {
        let output = subscriber.output();
        let printed = text(&output.stdout);
        let line = printed.lines().last().unwrap_or_default();
        let words: Vec<_> = line.split([' ', ',']).filter(|word| !word.is_empty()).collect();
        let number = |index: usize| words[index].parse::<u64>().unwrap_or_else(|_| panic!("{line}"));
        let (received, first, last, missed) = (number(1), number(3), number(5), number(7));
        assert_eq!(missed, 0, "{line}");
        assert_eq!(last, published - 1, "{line}");
        assert_eq!(received, last - first + 1, "frames are missing: {line}");
    }
    if let Some((_python, printed, first)) = python {
        let parsed = |line: String| serde_json::from_str::<Value>(&line).unwrap();
        let mut lines = vec![parsed(first)];
        // The publisher has ended: the last frame is the last line.
        let is_last = |line: &str| line.contains(&format!("\"sequence\": {}, ", published - 1));
        lines.extend(printed.all_until_one(is_last, "the last frame").into_iter().map(parsed));
        let frames: Vec<_> = lines.iter().filter(|line| line["type"] == "frame").collect();
        let sequences: Vec<_> = frames.iter().map(|frame| frame["sequence"].as_u64().unwrap()).collect();
        assert_eq!(sequences, (sequences[0]..published).collect::<Vec<_>>());
        for frame in frames {
            assert_eq!(frame["handles"], 224);
            assert!((frame["link"].as_f64().unwrap() - 1.65).abs() < 1e-12, "{frame}");
            let sim_time = 300.0 + frame["tick"].as_f64().unwrap() / 60.0;
            assert_eq!(frame["sim_time"].as_f64(), Some(sim_time));
        }
    }
    watching.signal(SIGINT);
    let seconds = json_lines(&watching.output());
    let connected = |line: &&Value| line["type"] == "second" && line["tick"].is_u64();
    let seconds: Vec<_> = seconds.iter().filter(connected).collect();
    assert!(seconds.iter().all(|second| second["missed"] == 0), "{seconds:?}");
    assert_eq!(seconds.first().unwrap()["state"], "moving");
    // The subscriber may have come after the first frames; from then on it counts every frame: by tick, less the
    // skipped ones.
    let [first, last] = [seconds[0], seconds[seconds.len() - 1]].map(|second| {
        let number = |key: &str| second[key].as_u64().unwrap();
        (number("tick"), number("received"))
    });
    let (ticks, frames) = (last.0 - first.0, last.1 - first.1);
    assert!(frames <= ticks && frames + skipped >= ticks, "{frames} frames in {ticks} ticks, {skipped} skipped");
}

#[test]
fn a_publisher_that_starts_again_is_no_loss_to_the_python_example() {
    if !can_run(python_modules(&PEER)) {
        return;
    }
    let name = unique("starts_again");
    let arguments = ["examples/python/subscribe.py", "--json", "--seconds", "600", "--name", &name];
    let mut subscriber = Process::start(python().args(arguments));
    let printed = subscriber.lines();
    let scene = scene_file("starts_again", &[("[publish]", "[publish]\nqueue = 120")]);
    for run in 0..2 {
        let arguments = ["run", "--json", "--rate", "50"];
        let publisher = Process::start(program("starts_again").arg("--scene").arg(&scene).args(arguments));
        let mut lines = printed.all_until("frame");
        wait(1.0);
        let published = stopped(publisher)["frames"].as_u64().unwrap();
        let is_last = |line: &str| line.contains(&format!("\"sequence\": {}, ", published - 1));
        lines.extend(printed.all_until_one(is_last, "the last frame"));
        let lines = lines.iter().map(|line| serde_json::from_str::<Value>(line).unwrap());
        let sequences = Vec::from_iter(lines.filter_map(|line| line["sequence"].as_u64()));
        // The subscriber may find a publisher after its first frames.
        assert_eq!(sequences, Vec::from_iter(sequences[0]..published), "run {run}");
    }
}

#[test]
fn alerts_come_once_each_and_in_order_in_rust_and_in_python() {
    let scene = scene_file("continue", &[("on_contact = \"stop\"", "on_contact = \"continue\"")]);
    let names = ["clear", "approaching", "contact", "stall", "lock"];
    for rate in [60, 1000] {
        let name = format!("alerts{rate}");
        let mut monitor = Process::start(program(&name).args(["watch", "--json"]));
        let arguments = ["examples/python/subscribe.py", "--json", "--seconds", "600", "--name"];
        let mut listener =
            can_run(python_modules(&PEER)).then(|| Process::start(python().args(arguments).arg(unique(&name))));
        let publisher = Process::start(program(&name).arg("--scene").arg(&scene).args([
            "run",
            "--json",
            "--paused",
            "--start",
            "380",
            "--time-scale",
            "8",
            "--rate",
            &rate.to_string(),
        ]));
        // The show begins once both get its frames, and is complete for each once it has the lock.
        let (watching, listening) = (monitor.lines(), listener.as_mut().map(Process::lines));
        let mut watched = lines_until(&watching, |line| line["state"] == "moving");
        let mut heard =
            listening.as_ref().map_or(Vec::new(), |lines| lines_until(lines, |line| line["type"] == "frame"));
        assert!(Process::start(program(&name).args(["control", "go"])).output().status.success());
        watched.extend(lines_until(&watching, |line| line["level"] == "lock"));
        heard.extend(listening.iter().flat_map(|lines| lines_until(lines, |line| line["level"] == 4)));
        publisher.signal(SIGINT);
        let skipped = summary(&publisher.output())["skipped"].as_u64().unwrap();

        let watched: Vec<_> = watched.iter().filter_map(|line| line["level"].as_str()).collect();
        let mut levels = watched.clone();
        levels.dedup();
        assert_eq!(levels, names, "at {rate} Hz");
        // One for each level, and the countdown: 3.57 s of wall time pass while approaching. A machine that stops for a
        // second has no frame for one of them.
        let most = names.len() + 3;
        assert!(watched.len() == most || (watched.len() < most && skipped >= rate), "at {rate} Hz: {watched:?}");
        if listening.is_some() {
            let level = |line: &Value| Some(names[line["level"].as_u64()? as usize]);
            assert_eq!(heard.iter().filter_map(level).collect::<Vec<_>>(), watched, "at {rate} Hz");
        }
    }
}

#[test]
fn a_late_subscriber_gets_the_contact_that_has_happened() {
    let _publisher = Process::start(program("late").args(["run", "--json", "--start", "412"]));
    Process::start(program("late").args(["watch", "--json"])).lines().until("\"state\":\"contact\"");
    let mut late = Process::start(program("late").args(["watch", "--json"]));
    let printed = late.lines();
    let mut lines = printed.all_until("\"state\":\"contact\"");
    late.signal(SIGINT);
    lines.extend(printed.rest());
    let lines = Vec::from_iter(lines.iter().map(|line| serde_json::from_str::<Value>(line).unwrap()));
    let alerts: Vec<_> = lines.iter().filter(|line| line["type"] == "alert").collect();
    assert_eq!(alerts.len(), 1, "{alerts:?}");
    assert_eq!(alerts[0]["level"], "contact");
    assert_eq!(
        (&alerts[0]["event"], &alerts[0]["event_bench_a"], &alerts[0]["event_bench_b"]),
        (&"contact".into(), &0.into(), &8.into())
    );
    assert!(alerts[0]["run_id"].as_str().unwrap().parse::<u64>().is_ok(), "a number that JavaScript would round");
    assert!((alerts[0]["event_time"].as_f64().unwrap() - 412.473837682115).abs() < 1e-10);
    let second = lines.iter().rfind(|line| line["type"] == "second").unwrap();
    assert_eq!(second["sim_time"], alerts[0]["event_time"], "the show has ended at the contact");
}

#[test]
fn a_scene_without_alerts_has_no_alerts_service() {
    let scene = scene_file("silent", &[("[alerts]", "# [alerts]"), ("approach_", "# approach_")]);
    let mut monitor = Process::start(program("silent").args(["watch", "--json"]));
    let reports = monitor.lines();
    let arguments = ["run", "--json", "--start", "410", "--time-scale", "10"];
    let publisher = Process::start(program("silent").arg("--scene").arg(&scene).args(arguments));
    let lines = lines_until(&reports, |line| line["state"] == "lock");
    publisher.signal(SIGINT);
    summary(&publisher.output());
    assert!(lines.iter().all(|line| line["type"] == "second"));
    let states: Vec<_> = lines.iter().filter_map(|line| line["state"].as_str()).collect();
    assert!(!states.contains(&"contact") && !states.contains(&"stall"), "{states:?}");
}

#[test]
fn signals_end_a_run_cleanly_and_leave_nothing_behind() {
    for (signal, rate) in [(SIGINT, "60"), (SIGTERM, "0.1")] {
        let place = Place::new("signals");
        let publisher = Process::start(place.program().args(["run", "--json", "--rate", rate]));
        wait_until("a publisher in its own place", || place.left_behind().len() > 1);
        publisher.signal(signal);
        let summary = summary(&publisher.output());
        assert_eq!(summary["end"], "signal");
        place.assert_clean();
    }
}

#[test]
fn python_reads_a_frame_and_an_alert_by_the_design_alone() {
    if !can_run(python_modules(&["iceoryx2"])) {
        return;
    }
    let publisher = Process::start(program("design").args(["run", "--json", "--start", "405", "--time-scale", "0.1"]));
    let publisher = answering(publisher, || program("design"));
    let arguments = ["tests/python/by_design.py", "--name", &unique("design")];
    let output = Process::start(python().args(arguments)).output();
    publisher.signal(SIGINT);
    let lines = json_lines(&output);
    let of = |kind: &str| lines.iter().find(|line| line["type"] == kind).unwrap_or_else(|| panic!("{output:?}"));
    let (frame, alert) = (&of("frame")["fields"], &of("alert")["fields"]);
    // run_id, sequence, tick, stamp_ns, sent_ns, deadline_ns; sim_time, time_scale, min_clearance; handles, state,
    // playback, cue, epoch, reserved.
    let tick = frame[2].as_f64().unwrap();
    assert_eq!(frame[6].as_f64(), Some(405.0 + 0.1 * tick / 60.0));
    assert_eq!(frame[7], 0.1);
    assert!((0.0..0.1).contains(&frame[8].as_f64().unwrap()), "{frame}");
    assert_eq!(frame.as_array().unwrap()[9..], [224, 1, 0, 0, 0, 0].map(Value::from));
    let handles = of("frame")["handles"].as_array().unwrap();
    let distance = |axis: usize| handles[1][axis].as_f64().unwrap() - handles[0][axis].as_f64().unwrap();
    assert!((distance(0).hypot(distance(1)) - 2.86).abs() < 1e-12);
    // run_id, tick, stamp_ns; sim_time, event_time, time_to_event, clearance, x, y, event_x, event_y; level, bench_a,
    // bench_b, event, event_bench_a, event_bench_b.
    assert_eq!(alert[0], frame[0]);
    let number = |at: usize| alert[at].as_f64().unwrap();
    assert!((number(4) - 412.473837682115).abs() < 1e-10 && number(5) == number(4) - number(3), "{alert}");
    assert!((0.0..0.1).contains(&number(6)) && (7..11).all(|at| number(at).abs() < 9.0), "{alert}");
    assert_eq!((&alert[11], &alert[14]), (&1.into(), &2.into()));
    assert_eq!((&alert[15], &alert[16]), (&0.into(), &8.into()));
    assert_eq!(alert[12], 0, "the head is one of the nearest two");
}

/// The header of layout 1, as a program of an earlier version has it.
#[derive(Debug, Default, Clone, Copy, ZeroCopySend)]
#[type_name("bench_dragon/FrameHeader/1")]
#[repr(C)]
struct OldHeader {
    stamps: [u64; 6],
    numbers: [f64; 3],
    handles: u32,
    state: u32,
}

#[test]
fn another_layout_is_refused_with_a_sentence() {
    let (name, node) = (unique("layouts"), node().unwrap());
    let service = service_name(&name, "poses").unwrap();
    let old = || node.service_builder(&service).publish_subscribe::<[HandlePose]>().user_header::<OldHeader>();
    let arguments = ["examples/python/subscribe.py", "--seconds", "20", "--name", &name];

    // A publisher of layout 1, and readers and a publisher of the current layout.
    let kept = old().create().unwrap();
    for refused in [&["watch", "--duration", "10"][..], &["run", "--duration", "10"]] {
        let output = Process::start(program("layouts").args(refused)).output();
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{refused:?}: {message}");
        assert!(
            message.contains("another layout of its messages") && message.contains("version"),
            "{refused:?}: {message}"
        );
    }
    if can_run(python_modules(&PEER)) {
        let output = Process::start(python().args(arguments)).output();
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains("FrameHeader/1") && message.contains("this module reads"), "{message}");
    }
    drop(kept);

    // Frames of the current layout and alerts of another layout.
    let [poses, alerts] = ["poses", "alerts"].map(|suffix| service_name(&unique("other"), suffix).unwrap());
    let _poses =
        node.service_builder(&poses).publish_subscribe::<[HandlePose]>().user_header::<FrameHeader>().create().unwrap();
    let _alerts = node.service_builder(&alerts).publish_subscribe::<u64>().create().unwrap();
    let output = Process::start(program("other").args(["watch", "--duration", "10"])).output();
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("/alerts\" exists with another layout of its messages"), "{message}");

    // A publisher of the current layout, and a reader of layout 1.
    let _publisher = Process::start(program("layouts").args(["run", "--json", "--start", "300"]));
    let refused = (0..3000).map(|_| old().open().err()).find(|error| {
        wait(0.1);
        *error != Some(PublishSubscribeOpenError::DoesNotExist)
    });
    assert_eq!(refused, Some(Some(PublishSubscribeOpenError::IncompatibleTypes)));
}

#[test]
fn a_name_that_another_program_takes_between_two_shows_is_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("show.mcap");
    let mut watching = Process::start(program("taken").args(["watch", "--json"]));
    let mut recorder = Process::start(program("taken").args(["record", "--json", "-o"]).arg(&recording));
    let warnings = [&mut watching, &mut recorder].map(Process::error_lines);
    let show = || summary(&Process::start(program("taken").args(["run", "--json", "--duration", "5"])).output());
    show();
    let (node, service) = (node().unwrap(), service_name(&unique("taken"), "poses").unwrap());
    let mut taken = None;
    wait_until("the services' end", || {
        taken = node.service_builder(&service).publish_subscribe::<u64>().create().ok();
        taken.is_some()
    });
    let warning = "another layout of its messages";
    for warnings in &warnings {
        warnings.until(warning);
    }
    drop(taken);
    show();
    for process in [&watching, &recorder] {
        process.signal(SIGTERM);
    }
    let [watched, recorded] = [watching, recorder].map(|process| process.output());
    for (output, warnings) in [&watched, &recorded].into_iter().zip(warnings) {
        let later = warnings.rest();
        assert_eq!(output.status.code(), Some(0), "{later:?}");
        assert!(!later.iter().any(|line| line.contains(warning)), "{later:?}");
    }
    let runs: BTreeSet<_> =
        json_lines(&watched).iter().filter_map(|line| Some(line["run_id"].as_str()?.to_owned())).collect();
    assert_eq!(runs.len(), 2, "{runs:?}");
    assert_eq!(json_lines(&recorded).pop().unwrap()["files"].as_array().unwrap().len(), 2);
}
