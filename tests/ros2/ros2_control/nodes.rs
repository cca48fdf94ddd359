//! The node, as other nodes see it.

use ros2_client::{Context, ContextOptions, NodeEvent, NodeName, NodeOptions};

use super::*;

/// Returns all nodes of the process that has the node `name`.
fn nodes_beside(name: &str) -> Vec<String> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let deadline = std::time::Instant::now() + harness::patience();
    loop {
        let context = Context::with_options(ContextOptions::new().domain_id(domain())).unwrap();
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let mut node = context.new_node(NodeName::new("/", "watcher").unwrap(), options).unwrap();
        let spinner = node.spinner().unwrap();
        let events = node.status_receiver().unwrap();
        let found = async {
            loop {
                let NodeEvent::ParticipantEntities(of) = events.recv().await.unwrap() else { continue };
                let nodes: Vec<_> = of.nodes().iter().map(|node| node.fully_qualified_name()).collect();
                if nodes.iter().any(|node| node == name) {
                    return nodes;
                }
            }
        };
        let found = runtime.block_on(async {
            tokio::select! {
                ended = spinner.spin() => panic!("the spinner ended: {ended:?}"),
                found = tokio::time::timeout(std::time::Duration::from_secs(10), found) => found,
            }
        });
        node.stop_spinner();
        // ros2-client holds eight events and loses further ones: on a busy machine also the event of this node.
        match found {
            Ok(nodes) => return nodes,
            Err(_) => assert!(std::time::Instant::now() < deadline, "no node {name} within {:?}", harness::patience()),
        }
    }
}

#[test]
fn a_publisher_is_one_node_of_its_name_and_launch_files_choose_the_name() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let plain = publisher("one_node", &["--ros2-control", "--duration", "300"]);
    let name = format!("/{}", unique("one_node"));
    assert_eq!(nodes_beside(&name), [name]);
    ended(plain);
    // As launch_ros starts it, with a name, a namespace, and `parameters=["p.yaml", {"rate": 40, ...}]`.
    let namespace = format!("__ns:=/{}", unique("hall"));
    let folder = tempfile::tempdir().unwrap();
    let [own, launched] = ["p.yaml", "launch_params_1"].map(|name| folder.path().join(name));
    let nested = format!("{}:\n  gold:\n    ros__parameters:\n      rate: 20.0\n", unique("hall"));
    std::fs::write(&own, nested).unwrap();
    std::fs::write(&launched, "/**:\n  ros__parameters:\n    rate: 40\n    use_sim_time: false\n").unwrap();
    let mut run = program("unnamed");
    run.env("ROS_DOMAIN_ID", domain().to_string()).args([
        "run",
        "--json",
        "--ros2",
        "--ros2-control",
        "--duration",
        "300",
    ]);
    run.args(["--ros-args", "-r", "__node:=gold", "-r", &namespace]);
    for file in [own, launched] {
        run.arg("--params-file").arg(file);
    }
    let launched = answering(Process::start(&mut run), || program("hall/gold"));
    let name = format!("/{}", unique("hall/gold"));
    assert_eq!(nodes_beside(&name), [name]);
    // A period is a fortieth of a second.
    let answers = call("hall/gold", &["pause", "seek=100", "step_simulation=20", "list_parameters"]);
    assert_eq!(answers[3], json!({"result": {"names": [], "prefixes": []}}));
    assert_eq!(control("hall/gold", &["state"]).1["sim_time"], 100.5);
    ended(launched);
}

#[test]
fn arguments_of_ros_that_cannot_be_honoured_are_refused_in_a_sentence() {
    for (arguments, expected) in [
        (&["run", "--ros2", "--ros-args", "-p", "use_sim_time:=true"][..], "publish.ros2.topics"),
        (&["run", "--ros2", "--ros-args", "-r", "poses:=/other"], "-r poses:=/other is not understood"),
        (&["run", "--ros2", "--ros-args", "--params-file", "x.yaml"], "expected a file of parameters (YAML)"),
        (&["run", "--ros2", "--ros-args", "-p", "rate:=0"], "--rate is 0"),
        (&["run", "--ros2", "--ros-args", "-r", "__node:=2nd"], "2nd"),
        (&["watch", "--ros-args", "-r", "__node:=gold"], "run and replay"),
    ] {
        let output = Process::start(program("ros_args").args(arguments)).output();
        let printed = text(&output.stderr);
        assert_eq!((output.status.code(), printed.trim().lines().count()), (Some(2), 1), "{printed}");
        assert!(printed.contains(expected), "{printed}");
    }
}
