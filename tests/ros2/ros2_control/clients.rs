//! Clients that have just started, and clients that use the other mapping.

use super::*;

#[test]
fn a_hundred_new_clients_each_get_the_answer_to_their_first_call() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let (cyclone, fast) = ("fresh_cyclone", "fresh_fast");
    let publishers = [(cyclone, CYCLONE), (fast, FAST)]
        .map(|(name, rmw)| publisher(name, rmw, &["--ros2-control", "--duration", "300"]));
    // One process for each client of Cyclone DDS, as users have them; most of the time is starting them.
    let calls = if long() { 100 } else { 12 };
    std::thread::scope(|threads| {
        for _ in 0..4 {
            threads.spawn(|| {
                for _ in 0..25 {
                    assert_eq!(enhanced::<_, f64>(fast, "get_rate", ("rosbag2_interfaces", "GetRate"), Empty(0)), 1.0);
                }
            });
        }
        for _ in 0..2 {
            threads.spawn(|| {
                for _ in 0..calls / 2 {
                    let peer = Process::start(&mut peer(cyclone, &["--fresh", "1", "--seconds", "10", "get_rate"]));
                    let output = peer.output_within(120);
                    let answers: Vec<_> = json_lines(&output).iter().map(|line| line["response"].clone()).collect();
                    assert_eq!(answers, [json!({"rate": 1.0})], "{}: {}", output.status, text(&output.stderr));
                    println!("Cyclone: {}", text(&output.stdout).trim());
                }
            });
        }
    });
    publishers.into_iter().for_each(|publisher| drop(ended(publisher)));
}

#[test]
fn a_call_in_the_other_mapping_is_refused_and_nothing_happens() {
    if !can_run(python_modules(&["cyclonedds"])) {
        return;
    }
    let (cyclone, fast) = ("other_cyclone", "other_fast");
    let publishers = [(cyclone, CYCLONE), (fast, FAST)]
        .map(|(name, rmw)| publisher(name, rmw, &["--ros2-control", "--paused", "--start", "50", "--duration", "300"]));
    // One and eight bytes, each several times.
    let calls = [
        "hold",
        "go",
        "go",
        "resume",
        "set_simulation_state=1",
        "set_rate=3.5",
        "seek=300",
        "step_simulation=100",
        "reset_simulation=255",
    ];
    let bare = [&["--bare", "--seconds", "0.2"][..], &calls].concat();
    let headed = [&["--seconds", "0.2"][..], &calls].concat();
    for (name, arguments, of_client, publisher) in [(cyclone, bare, FAST, CYCLONE), (fast, headed, CYCLONE, FAST)] {
        assert_eq!(call(name, &arguments), vec![Value::Null; calls.len()], "of a client of {of_client} by {publisher}");
        let (_, here) = control(name, &["state"]);
        assert_eq!((&here["sim_time"], &here["playback"]), (&50.0.into(), &"paused".into()));
    }
    // The publisher is there: clients of the same mapping get answers.
    assert_eq!(call(cyclone, &["get_rate"]), [json!({"rate": 1.0})]);
    assert_eq!(enhanced::<_, f64>(fast, "get_rate", ("rosbag2_interfaces", "GetRate"), Empty(0)), 1.0);
    for (publisher, of_client) in publishers.into_iter().zip([FAST, CYCLONE]) {
        let (_, printed) = ended(publisher);
        let refused = printed.lines().filter(|line| line.contains("refused (reported once)"));
        let refused: Vec<_> =
            refused.filter(|line| line.contains(&format!("a client calls as {of_client} does"))).collect();
        assert_eq!(refused.len(), calls.len() - 1, "once for each service: {printed}");
    }
}
