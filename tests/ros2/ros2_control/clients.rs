//! Clients that have just started, and clients of both RMW implementations at once.

use std::io::Write as _;
use std::process::ChildStdin;
use std::time::Duration;

use super::*;

#[test]
fn a_hundred_new_clients_of_each_kind_get_the_answer_to_their_first_call() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "fresh";
    let publisher = publisher(name, &["--ros2-control", "--duration", "6000"]);
    // One process for each client of Cyclone DDS, as users have them; most of the time is starting them.
    let calls = if long() { 100 } else { 12 };
    std::thread::scope(|threads| {
        for _ in 0..4 {
            threads.spawn(|| {
                for _ in 0..25 {
                    assert_eq!(enhanced::<_, f64>(name, "get_rate", ("rosbag2_interfaces", "GetRate"), Empty(0)), 1.0);
                }
            });
        }
        for _ in 0..2 {
            threads.spawn(|| {
                for _ in 0..calls / 2 {
                    let peer = Process::start(&mut peer(name, &["--fresh", "1", "--seconds", "60", "get_rate"]));
                    let output = peer.output();
                    let answers: Vec<_> = json_lines(&output).iter().map(|line| line["response"].clone()).collect();
                    assert_eq!(answers, [json!({"rate": 1.0})], "{}: {}", output.status, text(&output.stderr));
                    println!("Cyclone: {}", text(&output.stdout).trim());
                }
            });
        }
    });
    let (_, printed) = ended(publisher);
    assert!(!printed.contains("refused"), "{printed}");
}

/// Answers that are written at once are named by the heartbeat after the first of them. Cyclone DDS takes what its first
/// heartbeat of a writer names for old. It may have seen none before: most of these clients know the publisher later
/// than the publisher knows them.
#[test]
fn all_first_calls_of_a_new_client_are_answered() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "at_once";
    // With services that conduct the show, requests are polled so often that an answer comes before the next heartbeat.
    let publisher = publisher(name, &["--ros2-control", "--duration", "6000"]);
    let output = Process::start(&mut peer(name, &["--in-turn", "20", "--seconds", "20", "list_parameters"])).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(json_lines(&output), vec![json!(4); 20]);
    ended(publisher);
}

/// All participants of a process of Cyclone DDS have one socket. None is taken for the successor of another.
#[test]
fn all_clients_of_one_process_are_answered() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "one_process";
    let publisher = publisher(name, &["--duration", "6000"]);
    for _ in 0..3 {
        let clients = ["--fresh", "4", "--seconds", "60", "list_parameters"];
        let output = Process::start(&mut peer(name, &clients)).output();
        let answers = json_lines(&output).iter().filter(|line| line["response"]["result"].is_object()).count();
        assert_eq!(answers, 4, "{}: {} {}", output.status, text(&output.stdout), text(&output.stderr));
    }
    ended(publisher);
}

/// A client of services, whose calls are asked for by lines.
struct Caller {
    process: Process,
    input: ChildStdin,
    answers: Lines,
}

impl Caller {
    /// Starts a client with this configuration of Cyclone DDS, which waits for an answer for some seconds.
    fn start(name: &str, configuration: &str, seconds: &str) -> Self {
        let mut client = peer(name, &["--calls-of-input", "--seconds", seconds]);
        let (mut process, input) = Process::start_with_input(client.env("CYCLONEDDS_URI", configuration));
        let answers = process.lines();
        Self { process, input, answers }
    }

    /// Returns the answer to a call, null if none came.
    fn call(&mut self, service: &str) -> Value {
        writeln!(self.input, "{service}").unwrap();
        let line: Value = serde_json::from_str(&self.answers.until(service)).unwrap();
        line["response"].clone()
    }
}

/// Both kinds of client conduct one show by the same services, in turn. Cyclone DDS's stays all the time, so each
/// answer to the other passes by its readers.
#[test]
fn clients_of_both_implementations_conduct_one_show_in_turn() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "both";
    let publisher = publisher(name, &["--ros2-control", "--paused", "--start", "50", "--duration", "6000"]);
    let here = || control(name, &["state"]).1;
    let mut cyclone = Caller::start(name, "", "300");
    let set = |service: &str, kind: &'static str, value: f64| -> bool {
        enhanced(name, service, ("rosbag2_interfaces", kind), value)
    };
    let rate = || -> f64 { enhanced(name, "get_rate", ("rosbag2_interfaces", "GetRate"), Empty(0)) };
    for turn in 1..=5 {
        let (of_fast, by_cyclone) = (f64::from(turn) + 0.25, f64::from(turn) + 0.5);
        assert!(set("set_rate", "SetRate", of_fast));
        assert_eq!(cyclone.call("get_rate"), json!({ "rate": of_fast }));
        assert_eq!(cyclone.call(&format!("set_rate={by_cyclone}")), json!({"success": true}));
        assert_eq!(rate(), by_cyclone);
        let time = Time { sec: 100 + turn, nanosec: 0 };
        assert!(enhanced::<_, bool>(name, "seek", ("rosbag2_interfaces", "Seek"), time));
        assert_eq!(here()["sim_time"], 100.0 + f64::from(turn));
        assert_eq!(cyclone.call(&format!("seek={}", 200 + turn)), json!({"success": true}));
        assert_eq!(here()["sim_time"], 200.0 + f64::from(turn));
        let stepped: Outcome = enhanced(name, "step_simulation", ("simulation_interfaces", "StepSimulation"), 1_u64);
        assert_eq!(stepped, Outcome { result: 1, error_message: String::new() });
        assert_eq!(result(&cyclone.call("step_simulation=1")), (1, false));
        assert_eq!(cyclone.call("list_parameters"), json!({"result": {"names": [], "prefixes": []}}));
        let listed: (Vec<String>, Vec<String>) =
            enhanced(name, "list_parameters", ("rcl_interfaces", "ListParameters"), (Vec::<String>::new(), 0_u64));
        assert_eq!(listed, (vec![], vec![]));
    }
    // A hold of one kind is released by the other.
    assert_eq!(cyclone.call("hold")["success"], true);
    assert!(enhanced::<_, Trigger>(name, "release", ("std_srvs", "Trigger"), Empty(0)).success);
    assert_eq!(cyclone.call("release")["success"], false);
    cyclone.process.signal(nix::sys::signal::Signal::SIGKILL);
    let (_, printed) = ended(publisher);
    assert!(!printed.contains("is none of"), "{printed}");
}

/// RustDDS never serves a participant again whose lease has ended.
#[test]
fn a_client_that_was_silent_for_longer_than_its_lease_is_answered_again() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "silent_client";
    let publisher = publisher(name, &["--ros2-control", "--duration", "6000"]);
    let lease = "<CycloneDDS><Domain><Discovery><LeaseDuration>4s</LeaseDuration></Discovery></Domain></CycloneDDS>";
    let mut client = Caller::start(name, lease, "5");
    let rate = json!({"rate": 1.0});
    assert_eq!(client.call("get_rate"), rate);
    client.process.stop();
    std::thread::sleep(Duration::from_secs(10));
    client.process.signal(nix::sys::signal::Signal::SIGCONT);
    wait_until("an answer after the silence", || client.call("get_rate") == rate);
    ended(publisher);
}

/// A stopped client acknowledges no answer. RustDDS would refuse more than 4,096 answers that it has not acknowledged.
#[test]
fn a_stopped_client_stops_no_other() {
    if !all() || !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "stopped_client";
    let publisher = publisher(name, &["--ros2-control", "--duration", "6000"]);
    let [mut stopped, mut other] = [(); 2].map(|()| Caller::start(name, "", "300"));
    let answer = stopped.call("list_parameters");
    assert!(answer["result"].is_object(), "{answer}");
    stopped.process.stop();
    for number in 0..5000 {
        assert_eq!(other.call("list_parameters"), answer, "call {number}");
    }
    let (_, printed) = ended(publisher);
    assert!(!printed.contains("discarded"), "{printed}");
}

/// A request that is none of its service is refused; the next is answered.
#[test]
fn a_request_of_another_length_is_refused_and_nothing_happens() {
    let name = "misfit";
    let mut publisher = publisher(name, &["--ros2-control", "--paused", "--start", "50", "--duration", "6000"]);
    let said = publisher.error_lines();
    let refusals =
        |lines: Vec<String>| lines.iter().filter(|line| line.contains("a request of 12 bytes is none of")).count();
    let kind = ("simulation_interfaces", "StepSimulation");
    let twelve = (7_u64, 7_u32);
    let (mut calls, mut refused) = (0, 0);
    // A client that leaves before the service has discovered it takes its request along.
    wait_until("a refusal", || {
        calls += 1;
        assert_eq!(first_call::<_, Outcome>(name, "step_simulation", kind, twelve, 1), None);
        refused += refusals(said.so_far());
        refused > 0
    });
    let here = control(name, &["state"]).1;
    assert_eq!((&here["sim_time"], &here["playback"]), (&50.0.into(), &"paused".into()));
    assert_eq!(enhanced::<_, Outcome>(name, "step_simulation", kind, 7_u64).result, 1);
    ended(publisher);
    refused += refusals(said.rest());
    assert!(refused <= calls, "{refused} refusals of {calls} requests");
}

#[test]
fn the_parameter_services_of_a_node_without_services_answer_at_once() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let name = "parameters";
    let publisher = publisher(name, &["--duration", "6000"]);
    let calls = [
        "list_parameters",
        "get_parameters=use_sim_time",
        "get_parameter_types=use_sim_time",
        "describe_parameters=use_sim_time",
        "set_parameters=use_sim_time",
        "set_parameters_atomically=use_sim_time",
    ];
    let answers = call(name, &calls);
    assert_eq!(answers[0], json!({"result": {"names": [], "prefixes": []}}));
    assert_eq!(answers[1..4], [json!({"values": []}), json!({"values": []}), json!({"descriptors": []})]);
    let refused = |result: &Value| result["successful"] == false && result["reason"] != "";
    assert!(refused(&answers[4]["results"][0]) && refused(&answers[5]["result"]), "{answers:?}");
    // As rclcpp, rclpy and `ros2 param` of the other implementation call.
    let names = vec!["use_sim_time".to_owned()];
    let values: Vec<u8> = enhanced(name, "get_parameter_types", ("rcl_interfaces", "GetParameterTypes"), names);
    assert!(values.is_empty());
    ended(publisher);
}
