//! The examples of ROS 2 in Python, run as typed with stand-ins for ROS 2, without iceoryx2.

use crate::harness;

use bench_dragon::messages::sentence::name_in;
use bench_dragon::messages::state::{EventKind, FrameState, Level};
use bench_dragon::messages::{
    CollisionAlert, List, NO_BENCH, SceneName, Stage, StageDragon, StageMessage, StageObstacle,
};
use harness::{can_run, python, python_modules, text};
use serde_json::{Value, json};
use std::io::Write;
use std::process::Stdio;

/// Returns the lines that an example prints for these messages, each with its topic.
fn printed(example: &str, messages: &[(&str, Value)]) -> Vec<String> {
    let mut command = python();
    let file = format!("examples/python/{example}.py");
    command.args(["tests/python/ros2_examples.py", &file, "hall/show"]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    for (topic, message) in messages {
        writeln!(input, "{}", json!({"topic": topic, "message": message})).unwrap();
    }
    drop(input);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{example}: {}", text(&output.stderr));
    text(&output.stdout).lines().map(str::to_owned).collect()
}

fn stage() -> StageMessage {
    let gold = StageDragon { benches: 4, name: SceneName::new("gold"), ..StageDragon::default() };
    let jade = StageDragon { first_handle: 5, benches: 3, name: SceneName::new("jade"), ..StageDragon::default() };
    let obstacles = ["well", "stone lamp", "boundary"]
        .map(|name| StageObstacle { name: SceneName::new(name), ..StageObstacle::default() });
    let stage =
        Stage { dragons: List::of([gold, jade]), obstacles: List::of(obstacles), run_id: 7, ..Stage::default() };
    StageMessage { stage, segments: Vec::new() }
}

/// Every number of a bench or an obstacle, every level and every event has its name in Rust.
#[test]
fn ros2_alerts_names_benches_obstacles_levels_and_events_as_the_program_does() {
    if !can_run(python_modules(&["numpy"])) {
        return;
    }
    let stage = stage();
    let kinds = [EventKind::Contact, EventKind::Stall, EventKind::Lock, EventKind::Obstacle];
    let alerts = Level::ALL.into_iter().flat_map(|level| kinds.map(|kind| (level, kind)));
    let alerts: Vec<CollisionAlert> = alerts
        .zip((0..12).cycle())
        .map(|((level, kind), number)| CollisionAlert {
            run_id: 7,
            level: level as u32,
            event: FrameState::from(kind) as u32,
            sim_time: 101.867,
            time_to_event: 0.9,
            event_bench_a: number,
            event_bench_b: if kind == EventKind::Stall { NO_BENCH } else { 11 - number },
            bench_a: 0,
            bench_b: number,
            clearance: -0.0033,
            ..CollisionAlert::default()
        })
        .collect();
    // The first alert comes before the stage, as it may for a late subscriber.
    let mut messages: Vec<(&str, Value)> = alerts.iter().map(|alert| ("alerts", json!(alert))).collect();
    messages.insert(1, ("stage", json!(stage.stage)));
    let lines = printed("ros2_alerts", &messages);
    assert_eq!(lines.len(), alerts.len(), "{lines:?}");
    let name = |number| name_in(&stage.stage, number);
    for (line, alert) in lines.iter().zip(&alerts) {
        let (level, kind) = (alert.alert_level().unwrap().name(), alert.event_kind().unwrap().name());
        let second =
            if alert.event_bench_b == NO_BENCH { String::new() } else { format!(" and {}", name(alert.event_bench_b)) };
        let event = format!("{kind}: {}{second} in 0.9 s", name(alert.event_bench_a));
        let nearest = format!("nearest now are {} and {}, overlapping by 3.3 mm", name(0), name(alert.bench_b));
        assert_eq!(*line, format!("t = 101.867 s  {level}  {event}; {nearest}"));
    }
    for expected in ["  obstacle  obstacle: ", "the stone lamp", "the boundary", "bench 3 (the tail) of jade"] {
        assert!(lines.iter().any(|line| line.contains(expected)), "no {expected} in {lines:#?}");
    }
}

#[test]
fn ros2_display_prints_the_head_of_each_dragon() {
    if !can_run(python_modules(&["numpy"])) {
        return;
    }
    let handle = |at: u32| json!({"x": f64::from(at), "y": -0.5, "heading": 0.0, "vx": 0.0, "vy": 0.0});
    let poses: Vec<Value> = (0..9).map(handle).collect();
    let frame = json!({"run_id": 7, "epoch": 0, "playback": 0, "deadline_ns": 1, "sim_time": 50.25, "time_scale": 1.0,
                       "poses": poses});
    let one = printed("ros2_display", &[("handles", frame.clone())]);
    assert_eq!(one, ["t = 50.2500 s  head (0.0000, -0.5000) m"]);
    let two = printed("ros2_display", &[("stage", json!(stage().stage)), ("handles", frame)]);
    assert_eq!(two, ["t = 50.2500 s  head of gold (0.0000, -0.5000) m, head of jade (5.0000, -0.5000) m"]);
}
