//! Control of a running publisher over ROS 2. Cyclone DDS calls as `rmw_cyclonedds_cpp` does, ros2-client's own client
//! as `rmw_fastrtps_cpp` does, both from other processes than the publisher. The effect is read over shared memory.
#![cfg(feature = "ros2")]

mod clients;
mod enhanced;
mod nodes;
use crate::harness;

use std::process::Command;

use enhanced::{Empty, Features, Outcome, State, Time, Trigger, enhanced, first_call};
use harness::{
    Lines, Process, all, answering, can_run, json_lines, long, program, python, python_modules, summary, text, unique,
    wait_until,
};
use serde_json::{Value, json};

/// Returns a ROS 2 domain that other processes of this machine do not use meanwhile.
fn domain() -> u16 {
    20 + (std::process::id() % 80) as u16
}

fn publisher(name: &str, arguments: &[&str]) -> Process {
    let mut run = program(name);
    run.env("ROS_DOMAIN_ID", domain().to_string());
    answering(Process::start(run.args(["run", "--json", "--ros2"]).args(arguments)), || program(name))
}

/// Returns exit code and response of `control`, over shared memory.
fn control(name: &str, arguments: &[&str]) -> (i32, Value) {
    let output = program(name).args(["--json", "control"]).args(arguments).output().unwrap();
    (output.status.code().unwrap(), json_lines(&output).pop().unwrap_or(Value::Null))
}

fn peer(name: &str, arguments: &[&str]) -> Command {
    let mut command = python();
    command.args(["tests/python/ros2_control_peer.py", "--name", &unique(name), "--domain", &domain().to_string()]);
    command.args(arguments);
    command
}

/// Returns the responses to these calls, one after the other, of one Cyclone client.
fn call(name: &str, calls: &[&str]) -> Vec<Value> {
    let output = Process::start(&mut peer(name, calls)).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    json_lines(&output).into_iter().map(|line| line["response"].clone()).collect()
}

fn ended(publisher: Process) -> (Value, String) {
    publisher.signal(nix::sys::signal::Signal::SIGINT);
    let output = publisher.output();
    (summary(&output), text(&output.stderr))
}

/// Returns the answer of step, set or reset: the code, and true if there is a sentence.
fn result(response: &Value) -> (u64, bool) {
    let result = &response["result"];
    (result["result"].as_u64().unwrap_or_else(|| panic!("{response}")), result["error_message"] != "")
}

#[test]
fn a_cyclone_client_conducts_by_every_service() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "services";
    let publisher = publisher(name, &["--ros2-control", "--paused", "--start", "50", "--duration", "6000"]);
    let state = |expected: u64, response: &Value| {
        assert_eq!((response["state"]["state"].as_u64(), result(response)), (Some(expected), (1, false)), "{response}");
    };
    let here = || control(name, &["state"]).1;

    let calls = ["get_simulator_features", "get_simulation_state", "is_paused", "get_rate", "step_simulation=7"];
    let [features, paused, is_paused, rate, stepped] = call(name, &calls).try_into().unwrap();
    assert_eq!(features["features"]["features"], json!([20, 21, 22, 24, 25, 26, 31, 32]));
    assert_eq!(features["features"]["spawn_formats"], json!([]));
    assert!(features["features"]["custom_info"].as_str().unwrap().contains("bench-dragon"));
    state(2, &paused);
    assert_eq!((is_paused, rate), (json!({"paused": true}), json!({"rate": 1.0})));
    // The answer comes once the steps are complete.
    assert_eq!(result(&stepped), (1, false));
    let close = |time: &Value, expected: f64| (time.as_f64().unwrap() - expected).abs() < 1e-9;
    assert!(close(&here()["sim_time"], 50.0 + 7.0 / 60.0), "{}", here());

    let calls = ["play_next", "seek=100.25", "seek=1e6", "seek=-1", "set_rate=0.5", "set_rate=-1", "get_rate"];
    let [played, sought, far, negative, slower, backward, rate] = call(name, &calls).try_into().unwrap();
    let success = |response: &Value| response["success"].as_bool().unwrap();
    assert_eq!([&played, &sought, &far, &negative].map(success), [true, true, false, false]);
    assert_eq!(([&slower, &backward].map(success), rate), ([true, false], json!({"rate": 0.5})));
    assert_eq!((&here()["sim_time"], &here()["playback"]), (&100.25.into(), &"paused".into()));

    let calls = [
        "set_simulation_state=1",
        "set_simulation_state=1",
        "get_simulation_state",
        "is_paused",
        "step_simulation=1",
        "play_next",
    ];
    let [plays, already, playing, is_paused, stepped, played] = call(name, &calls).try_into().unwrap();
    assert_eq!([&plays, &already, &stepped].map(result), [(1, false), (101, true), (4, true)]);
    state(1, &playing);
    assert_eq!((is_paused, success(&played)), (json!({"paused": false}), false));
    assert_eq!((&here()["playback"], &here()["time_scale"]), (&"playing".into(), &0.5.into()));

    // Stopped means paused and reset; paused at the start after a reset is stopped.
    let calls = [
        "set_simulation_state=0",
        "get_simulation_state",
        "set_simulation_state=0",
        "set_simulation_state=2",
        "get_simulation_state",
        "set_simulation_state=2",
    ];
    let [stops, stopped, already, pauses, paused, already_paused] = call(name, &calls).try_into().unwrap();
    assert_eq!(
        [&stops, &already, &pauses, &already_paused].map(result),
        [(1, false), (101, true), (1, false), (101, true)]
    );
    state(0, &stopped);
    state(2, &paused);
    assert_eq!((&here()["sim_time"], &here()["playback"]), (&50.0.into(), &"paused".into()));

    let calls = [
        "set_simulation_state=3",
        "set_simulation_state=4",
        "set_simulation_state=9",
        "reset_simulation=4",
        "reset_simulation=6",
        "reset_simulation=8",
        "step_simulation=0",
    ];
    let refused: Vec<_> = call(name, &calls).iter().map(result).collect();
    assert_eq!(refused, [(0, true), (0, true), (4, true), (0, true), (0, true), (0, true), (4, true)]);
    for scope in ["", "=1", "=2", "=3", "=255"] {
        let calls = ["seek=200".to_owned(), format!("reset_simulation{scope}")];
        let [_, reset] = call(name, &calls.each_ref().map(String::as_str)).try_into().unwrap();
        assert_eq!((result(&reset), &here()["sim_time"]), ((1, false), &50.0.into()), "scope {scope}");
    }

    let empty = json!({"structure_needs_at_least_one_member": 0});
    for (service, playback) in
        [("resume", "playing"), ("pause", "paused"), ("toggle_paused", "playing"), ("toggle_paused", "paused")]
    {
        assert_eq!(call(name, &[service]), std::slice::from_ref(&empty), "{service}");
        assert_eq!(here()["playback"], playback, "{service}");
    }
    // The pause was not a wait for go.
    let [go, release, hold] = call(name, &["go", "release", "hold"]).try_into().unwrap();
    assert_eq!([&go, &release, &hold].map(success), [false, false, true]);
    assert!(go["message"].as_str().unwrap().contains("waits for nothing"), "{go}");
    assert_eq!(here()["playback"], "held");
    ended(publisher);
}

#[test]
fn a_hold_is_latched_against_every_other_call() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "held";
    let publisher = publisher(name, &["--ros2-control", "--start", "50", "--duration", "6000"]);
    let calls = ["hold", "hold", "get_simulation_state", "is_paused", "get_rate", "get_simulator_features"];
    let held = call(name, &calls);
    assert!(held[..2].iter().all(|response| response["success"] == true), "{held:?}");
    assert_eq!(
        (&held[2]["state"]["state"], &held[3]["paused"], &held[4]["rate"]),
        (&2.into(), &true.into(), &1.0.into())
    );
    let before = control(name, &["state"]).1;
    let calls = [
        "set_simulation_state=0",
        "set_simulation_state=1",
        "set_simulation_state=2",
        "step_simulation=1",
        "reset_simulation",
        "set_rate=2",
        "seek=60",
        "play_next",
        "go",
        "pause",
        "resume",
        "toggle_paused",
    ];
    let refused = call(name, &calls);
    assert_eq!(
        refused[..5].iter().map(result).collect::<Vec<_>>(),
        [(103, true), (103, true), (103, true), (3, true), (3, true)]
    );
    assert!(refused[..5].iter().all(|response| response["result"]["error_message"].as_str().unwrap().contains("held")));
    assert!(refused[5..9].iter().all(|response| response["success"] == false), "{refused:?}");
    let after = control(name, &["state"]).1;
    for key in ["sim_time", "playback", "cue"] {
        assert_eq!(before[key], after[key], "{key}");
    }
    assert_eq!(after["playback"], "held");
    // The state before: paused, at the unchanged rate.
    assert_eq!(call(name, &["release", "get_rate"])[1], json!({"rate": 1.0}));
    assert_eq!(control(name, &["state"]).1["playback"], "paused");
    let (_, printed) = ended(publisher);
    assert!(printed.contains("service resume: refused: the show is held"), "{printed}");
}

#[test]
fn without_the_flag_there_is_no_service_and_with_it_those_of_the_standards() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let (without, with) = ("no_services", "all_services");
    let publishers =
        [publisher(without, &["--duration", "6000"]), publisher(with, &["--ros2-control", "--duration", "6000"])];
    let endpoints = |name: &str, topics: &str| {
        let output = Process::start(&mut peer(name, &["--topics", topics])).output();
        let found = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
        ["read", "written"].map(|what| found[what].as_object().unwrap().clone())
    };
    let of_services =
        |topics: &serde_json::Map<String, Value>| topics.keys().filter(|topic| !topic.starts_with("rt/")).count();
    let [read, written] = endpoints(without, "17");
    let topics = ["poses", "handles", "alerts", "stage", "path"].map(|topic| format!("rt/{}/{topic}", unique(without)));
    let mut offered: Vec<&String> = written.keys().filter(|topic| topic.starts_with("rt/")).collect();
    let mut topics: Vec<&String> = topics.iter().collect();
    offered.sort();
    topics.sort();
    assert_eq!(offered, topics, "no other topic is on by default; a scene without cues has none for them");
    // Every node has its parameter services.
    let parameters = (
        "rcl_interfaces",
        &[
            "list_parameters:ListParameters",
            "get_parameters:GetParameters",
            "get_parameter_types:GetParameterTypes",
            "describe_parameters:DescribeParameters",
            "set_parameters:SetParameters",
            "set_parameters_atomically:SetParametersAtomically",
        ][..],
    );
    assert_eq!((of_services(&read), of_services(&written)), (6, 6), "{read:?}");
    let [read, written] = endpoints(with, "49");
    let expected = [
        parameters,
        (
            "simulation_interfaces",
            &[
                "get_simulator_features:GetSimulatorFeatures",
                "get_simulation_state:GetSimulationState",
                "set_simulation_state:SetSimulationState",
                "step_simulation:StepSimulation",
                "reset_simulation:ResetSimulation",
            ][..],
        ),
        (
            "rosbag2_interfaces",
            &[
                "pause:Pause",
                "resume:Resume",
                "toggle_paused:TogglePaused",
                "is_paused:IsPaused",
                "get_rate:GetRate",
                "set_rate:SetRate",
                "seek:Seek",
                "play_next:PlayNext",
            ],
        ),
        ("std_srvs", &["hold:Trigger", "release:Trigger", "go:Trigger"]),
    ];
    let all: Vec<_> = expected
        .iter()
        .flat_map(|(package, services)| services.iter().map(move |service| (package, service.split_once(':').unwrap())))
        .collect();
    assert_eq!((of_services(&read), of_services(&written)), (all.len(), all.len()), "{read:?}, {written:?}");
    for (package, (service, kind)) in all {
        let topic = |prefix: &str, suffix: &str| format!("{prefix}/{}/{service}{suffix}", unique(with));
        assert_eq!(read[&topic("rq", "Request")], format!("{package}::srv::dds_::{kind}_Request_"));
        assert_eq!(written[&topic("rr", "Reply")], format!("{package}::srv::dds_::{kind}_Response_"));
    }
    publishers.into_iter().for_each(|publisher| drop(ended(publisher)));
    // The services require ROS 2.
    let output = Process::start(program("alone").args(["run", "--ros2-control", "--duration", "1"])).output();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("--ros2-control"), "{}", text(&output.stderr));
}

#[test]
fn a_flood_of_calls_is_refused_and_others_are_answered() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "flooded";
    let publisher = publisher(name, &["--ros2-control", "--duration", "6000"]);
    let mut flood = Process::start(&mut peer(name, &["--flood", "5000", "--seconds", "300", "get_rate"]));
    let flooded = flood.lines();
    let others = call(name, &["get_rate", "get_simulation_state", "pause", "get_simulation_state"]);
    assert_eq!(
        (&others[0]["rate"], &others[1]["state"]["state"], &others[3]["state"]["state"]),
        (&1.0.into(), &1.into(), &2.into())
    );
    flooded.until("5000");
    flood.signal(nix::sys::signal::Signal::SIGKILL);
    assert_eq!(call(name, &["get_simulation_state"])[0]["state"]["state"], 2);
    let (summary, printed) = ended(publisher);
    assert_eq!(printed.matches("calls without an answer").count(), 1, "{printed}");
    assert_eq!(summary["end"], "signal");
}

#[test]
fn a_fast_dds_client_conducts_by_every_service() {
    let name = "enhanced";
    let publisher = publisher(name, &["--ros2-control", "--paused", "--start", "50", "--duration", "6000"]);
    let here = || control(name, &["state"]).1;
    let done = || Outcome { result: 1, error_message: String::new() };
    let simulation = |service: &str, kind: &'static str, request: u8| -> Outcome {
        enhanced(name, service, ("simulation_interfaces", kind), request)
    };
    let player = |service: &str, kind: &'static str| -> Empty {
        enhanced(name, service, ("rosbag2_interfaces", kind), Empty(0))
    };
    let trigger = |service: &str| -> Trigger { enhanced(name, service, ("std_srvs", "Trigger"), Empty(0)) };
    let features: Features =
        enhanced(name, "get_simulator_features", ("simulation_interfaces", "GetSimulatorFeatures"), Empty(0));
    assert_eq!((features.features, features.spawn_formats.len()), (vec![20, 21, 22, 24, 25, 26, 31, 32], 0));
    let state = || -> State {
        enhanced(name, "get_simulation_state", ("simulation_interfaces", "GetSimulationState"), Empty(0))
    };
    assert_eq!(state(), State { state: 2, result: done() });
    let stepped: Outcome = enhanced(name, "step_simulation", ("simulation_interfaces", "StepSimulation"), 7_u64);
    assert_eq!(stepped, done());
    assert!((here()["sim_time"].as_f64().unwrap() - (50.0 + 7.0 / 60.0)).abs() < 1e-9, "{}", here());
    assert!(trigger("go").success);
    assert_eq!(simulation("set_simulation_state", "SetSimulationState", 2), done());
    let time = Time { sec: 100, nanosec: 250_000_000 };
    assert!(enhanced::<_, bool>(name, "seek", ("rosbag2_interfaces", "Seek"), time));
    assert!(enhanced::<_, bool>(name, "set_rate", ("rosbag2_interfaces", "SetRate"), 0.5));
    assert_eq!(enhanced::<_, f64>(name, "get_rate", ("rosbag2_interfaces", "GetRate"), Empty(0)), 0.5);
    assert_eq!((&here()["sim_time"], &here()["playback"]), (&100.25.into(), &"paused".into()));
    assert!(enhanced::<_, bool>(name, "play_next", ("rosbag2_interfaces", "PlayNext"), Empty(0)));
    assert!((here()["sim_time"].as_f64().unwrap() - (100.25 + 0.5 / 60.0)).abs() < 1e-9, "{}", here());
    assert_eq!(simulation("reset_simulation", "ResetSimulation", 0), done());
    assert_eq!(state().state, 0);
    assert_eq!(player("resume", "Resume"), Empty(0));
    assert_eq!(here()["playback"], "playing");
    // Resume since Lyrical: with a time.
    player("pause", "Pause");
    assert_eq!(
        enhanced::<_, Empty>(name, "resume", ("rosbag2_interfaces", "Resume"), Time { sec: 0, nanosec: 0 }),
        Empty(0)
    );
    assert_eq!(here()["playback"], "playing");
    player("toggle_paused", "TogglePaused");
    assert!(enhanced::<_, bool>(name, "is_paused", ("rosbag2_interfaces", "IsPaused"), Empty(0)));
    assert!(trigger("hold").success && !trigger("go").success);
    assert_eq!(here()["playback"], "held");
    assert!(trigger("release").success);
    ended(publisher);
}
