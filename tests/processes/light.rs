//! The service of poses in single precision, as a subscriber in Python receives it: each frame is the frame of
//! `<name>/poses` rounded. Without `precision = "f32"` there is no such service.

use crate::harness;

use bench_dragon::client::shared_memory::{node, service_name};
use bench_dragon::messages::{FrameHeader, HandlePose32, LoopStatus};
use harness::{Process, can_run, program, python, python_modules, scene_file, stopped, text, unique, wait_until};
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use nix::sys::signal::Signal::SIGINT;
use serde_json::Value;

/// Returns a scene whose queues hold all frames by which a subscriber falls behind.
fn scene(name: &str, publish: &str) -> std::path::PathBuf {
    scene_file(name, &[("[publish]", &format!("[publish]\nqueue = 1500\n{publish}"))])
}

/// Returns the output of `check` for a scene, or of `run` when it starts.
fn said(name: &str, scene: &std::path::Path, arguments: &[&str]) -> String {
    let output = Process::start(program(name).arg("--scene").arg(scene).args(arguments)).output();
    text(&output.stdout) + &text(&output.stderr)
}

fn every_frame_is_the_whole_one_rounded(every: usize, velocities: bool, expected: &[usize]) {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let name = format!("light{every}");
    let scene = scene(&name, &format!("precision = \"f32\"\nevery = {every}"));
    if !velocities {
        let text = std::fs::read_to_string(&scene).unwrap();
        std::fs::write(&scene, text.replace("velocities = true", "velocities = false")).unwrap();
    }
    let mut peer = Process::start(python().args(["tests/python/light_peer.py", "--name", &unique(&name)]));
    let printed = peer.lines();
    printed.until("ready");
    let mut run = program(&name);
    run.arg("--scene").arg(&scene).args(["run", "--json", "--rate", "50", "--start", "409"]);
    let publisher = Process::start(&mut run);
    printed.until("enough");
    let frames = stopped(publisher)["frames"].as_u64().unwrap();
    let last = printed.rest().pop().unwrap_or_default();
    let output = peer.output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let compared: Value = serde_json::from_str(&last).unwrap();
    assert!(compared["compared"].as_u64().unwrap() > 20, "{compared} of {frames} frames");
    assert_eq!(compared["last"], frames - 1, "the last frame arrived too");
    let handles: Vec<_> = compared["handles"].as_array().unwrap().iter().map(|it| it.as_u64().unwrap()).collect();
    assert_eq!(handles, expected.iter().map(|handle| *handle as u64).collect::<Vec<_>>());
}

#[test]
fn all_handles_are_those_of_the_whole_frame_rounded() {
    every_frame_is_the_whole_one_rounded(1, true, &Vec::from_iter(0..224));
}

#[test]
fn one_handle_in_seven_and_the_tail_are_those_of_the_whole_frame_rounded() {
    let mut handles: Vec<_> = (0..224).step_by(7).collect();
    handles.push(223);
    every_frame_is_the_whole_one_rounded(7, false, &handles);
}

#[test]
fn head_and_tail_remain_where_the_team_is_smaller_than_the_step() {
    every_frame_is_the_whole_one_rounded(1000, true, &[0, 223]);
}

/// Each of several dragons keeps its head and its tail.
#[test]
fn of_two_dragons_both_ends_of_each_remain() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let name = "light_two";
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("two.toml");
    let crossing = include_str!("../../config/crossing.toml");
    let light = "[publish]\nqueue = 1500\nprecision = \"f32\"\nevery = 7";
    std::fs::write(&file, crossing.replace("[publish]", light)).unwrap();
    let mut peer = python();
    peer.args(["tests/python/light_peer.py", "--name", &unique(name), "--teams", "21", "13"]);
    let mut peer = Process::start(&mut peer);
    let printed = peer.lines();
    printed.until("ready");
    let mut run = program(name);
    run.arg("--scene").arg(&file).args(["run", "--json", "--rate", "50", "--start", "52"]);
    let publisher = Process::start(&mut run);
    printed.until("enough");
    let frames = stopped(publisher)["frames"].as_u64().unwrap();
    let last = printed.rest().pop().unwrap_or_default();
    let output = peer.output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let compared: Value = serde_json::from_str(&last).unwrap();
    assert!(compared["compared"].as_u64().unwrap() > 20, "{compared} of {frames} frames");
    assert_eq!(compared["handles"], serde_json::json!([0, 7, 14, 20, 21, 28, 33]));
}

#[test]
fn nothing_is_there_unasked() {
    let name = "light_off";
    let scene = scene(name, "precision = \"f64\"\nevery = 1");
    let mut run = program(name);
    run.arg("--scene").arg(&scene).args(["run", "--json", "--start", "300"]);
    let _publisher = Process::start(&mut run);
    let node = node().unwrap();
    let status = service_name(&unique(name), "status").unwrap();
    let is_there = || node.service_builder(&status).publish_subscribe::<LoopStatus>().open().is_ok();
    // The publisher creates this service last.
    wait_until("a publisher", is_there);
    let poses32 = service_name(&unique(name), "poses32").unwrap();
    let opened =
        node.service_builder(&poses32).publish_subscribe::<[HandlePose32]>().user_header::<FrameHeader>().open();
    assert_eq!(opened.err(), Some(PublishSubscribeOpenError::DoesNotExist));
    assert!(!said(name, &scene, &["check"]).contains("poses32"));
}

#[test]
fn check_and_run_name_the_service_and_the_example_reads_it() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let name = "light_said";
    let scene = scene(name, "precision = \"f32\"\nevery = 7");
    let checked = said(name, &scene, &["check"]);
    assert!(checked.contains("poses32 has one handle in 7 and the tail, in f32"), "{checked}");
    let arguments = ["examples/python/subscribe.py", "--light", "--json", "--seconds", "600", "--name", &unique(name)];
    let mut example = Process::start(python().args(arguments));
    let mut run = program(name);
    let publisher = Process::start(run.arg("--scene").arg(&scene).args(["run", "--rate", "50", "--start", "300"]));
    let line: Value = serde_json::from_str(&example.lines().until("frame")).unwrap();
    publisher.signal(SIGINT);
    let started = publisher.output();
    let started = text(&started.stdout) + &text(&started.stderr);
    assert!(started.contains("/poses32 (one handle in 7 and the tail, in f32)"), "{started}");
    assert_eq!((&line["type"], &line["handles"]), (&"frame".into(), &33.into()), "{line}");
    assert!(line["head"][0].as_f64().unwrap().abs() < 9.0, "{line}");
}
