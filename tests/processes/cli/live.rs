//! `run` and `watch`: two seconds of every scene, live, and the JSON of both commands.

use std::process::Command;

use nix::sys::signal::Signal::{SIGINT, SIGTERM};
use serde_json::Value;

use crate::cli::scenes::{SceneFile, assert_keys, scene, scenes};
use crate::harness::{Place, Process, can_run, json_lines, summary, text};

const SECOND: [&str; 8] = ["type", "tick", "sim_time", "state", "rate", "received", "missed", "latency_ns"];
const ALERT: [&str; 18] = [
    "type",
    "run_id",
    "tick",
    "stamp_ns",
    "sim_time",
    "event_time",
    "time_to_event",
    "clearance",
    "x",
    "y",
    "event_x",
    "event_y",
    "level",
    "bench_a",
    "bench_b",
    "event",
    "event_bench_a",
    "event_bench_b",
];
const STATES: [&str; 7] = ["moving", "approaching", "contact", "stall", "lock", "path_end", "waiting"];

fn number(object: &Value, key: &str) -> u64 {
    object[key].as_u64().unwrap_or_else(|| panic!("no {key} in {object}"))
}

/// Returns the publisher of a scene; its DDS messages stay on this machine.
fn publisher(place: &Place, scene: &SceneFile) -> Command {
    let mut command = place.program();
    command.env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST").arg("--scene").arg(&scene.path).args(["run", "--json"]);
    command
}

fn assert_summary(summary: &Value, periods: u64, end: &str, ros2: bool) {
    let keys = ["frames", "overruns", "skipped", "wakeup_ns", "step_ns", "end"];
    assert_keys(summary, &keys.into_iter().chain(ros2.then_some("ros2")).collect::<Vec<_>>());
    assert_eq!(summary["end"], end, "{summary}");
    let [frames, skipped, overruns] = ["frames", "skipped", "overruns"].map(|key| number(summary, key));
    assert!(frames > 0 && overruns <= skipped, "{summary}");
    if end == "duration" {
        assert_eq!(frames + skipped, periods, "{summary}");
    }
    for spread in ["wakeup_ns", "step_ns"] {
        let spread = &summary[spread];
        assert_keys(spread, &["p50", "p99", "p999", "max"]);
        let shares = ["p50", "p99", "p999", "max"].map(|key| number(spread, key));
        assert!(shares.is_sorted() && shares[3] > 0, "{summary}");
    }
    // The value is in nanoseconds, since no machine solves, copies and sends a frame in a tenth of a microsecond.
    assert!(number(&summary["step_ns"], "p50") > 100, "{summary}");
    if ros2 {
        assert_keys(&summary["ros2"], &["frames", "skipped", "discarded"]);
    }
}

fn assert_watched(scene: &SceneFile, lines: &[Value]) {
    let of = |kind: &str| lines.iter().filter(|line| line["type"] == kind).collect::<Vec<_>>();
    let (seconds, alerts) = (of("second"), of("alert"));
    assert_eq!(seconds.len() + alerts.len(), lines.len(), "{lines:?}");
    let mut received = 0;
    for second in &seconds {
        assert_keys(second, &SECOND);
        assert!(STATES.contains(&second["state"].as_str().unwrap()), "{second}");
        assert_eq!(second["missed"], 0, "{}: {second}", scene.name);
        let waiting = second["state"] == "waiting";
        assert_eq!((second["tick"].is_null(), second["sim_time"].is_null()), (waiting, waiting), "{second}");
        if !waiting {
            // At the scene's own rate, in seconds of simulated time.
            let expected = number(second, "tick") as f64 / scene.number("publish", "rate");
            assert!((second["sim_time"].as_f64().unwrap() - expected).abs() < 1e-12, "{second}");
        }
        let new = number(second, "received") - received;
        received = number(second, "received");
        assert_eq!(second["rate"].as_f64().unwrap() > 0.0, new > 0, "{second}");
        assert_eq!(second["latency_ns"].is_object(), new > 0, "{second}");
        if new > 0 {
            assert_keys(&second["latency_ns"], &["p50", "p99", "max"]);
            let shares = ["p50", "p99", "max"].map(|key| number(&second["latency_ns"], key));
            assert!(shares.is_sorted() && shares[0] > 0, "{second}");
        }
    }
    assert!(received > 0, "{}: nothing was received: {lines:?}", scene.name);
    for alert in &alerts {
        assert_keys(alert, &ALERT);
        // A number that JavaScript would round is text.
        for key in ["run_id", "stamp_ns"] {
            assert!(alert[key].as_str().unwrap().parse::<u64>().is_ok(), "{alert}");
        }
        assert!(["clear", "approaching", "contact", "stall", "lock"].contains(&alert["level"].as_str().unwrap()));
        let about = alert["event"].is_string();
        for key in ["event_time", "time_to_event", "event_x", "event_y", "event_bench_a"] {
            assert_eq!(alert[key].is_number(), about, "{key}: {alert}");
        }
        assert!(alert["clearance"].is_number() && alert["bench_b"].is_number(), "{alert}");
    }
    // The level at the start is an alert, which a late subscriber gets within a second.
    assert_eq!(alerts.is_empty(), !scene.content.contains_key("alerts"), "{}: {lines:?}", scene.name);
}

#[test]
fn two_seconds_of_every_scene_are_published_and_watched() {
    let speaks_ros2 = |scene: &SceneFile| scene.content["publish"].get("ros2").is_some();
    let with_ros2 = || if cfg!(feature = "ros2") { Ok(()) } else { Err("this build has no ROS 2".to_owned()) };
    let playable: Vec<_> = scenes().into_iter().filter(|scene| !speaks_ros2(scene) || can_run(with_ros2())).collect();
    // A few run at once, since each mostly waits.
    let folder = tempfile::tempdir().unwrap();
    for some in playable.chunks(3) {
        let started = some.iter().map(|scene| {
            let place = Place::new(&format!("cli_{}", scene.name));
            let mut monitor = Process::start(place.program().args(["watch", "--json"]));
            let lines = monitor.lines();
            // A monitor that the machine does not run for a second misses nothing.
            let scene = scene.with(&folder, "publish", "queue", 300).with(&folder, "publish", "subscribers", 3);
            (scene, place, monitor, lines)
        });
        let playing = started.collect::<Vec<_>>().into_iter().map(|(scene, place, monitor, lines)| {
            lines.until("waiting");
            let publisher = Process::start(publisher(&place, &scene).args(["--duration", "2.01"]));
            (scene, place, monitor, lines, publisher)
        });
        for (scene, place, monitor, lines, mut publisher) in playing.collect::<Vec<_>>() {
            let watched = loop {
                let periods = (2.01 * scene.number("publish", "rate")).ceil() as u64;
                assert_summary(&summary(&publisher.output()), periods, "duration", speaks_ros2(&scene));
                // The second in which the publisher ended is complete when the next line does not list it.
                let mut watched = lines.so_far();
                (0..2).for_each(|_| watched.extend(lines.all_until("waiting")));
                if watched.iter().any(|line| line.contains("moving")) {
                    break watched;
                }
                // The monitor did not run while the show did.
                publisher = Process::start(self::publisher(&place, &scene).args(["--duration", "2.01"]));
            };
            monitor.signal(SIGTERM);
            let watched = watched.into_iter().chain(lines.rest());
            let watched: Vec<Value> = watched.map(|line| serde_json::from_str(&line).unwrap()).collect();
            assert_watched(&scene, &watched);
            place.assert_clean();
        }
    }
}

#[test]
fn the_command_line_overrides_the_rate_of_the_file() {
    let scene = scene("school");
    let place = Place::new("cli_rate");
    // D seconds are the ticks from 0 to ceil(D rate) - 1.
    for (arguments, periods) in [
        (&["--duration", "0.51"][..], 31),
        (&["--duration", "0.51", "--rate", "25"], 13),
        (&["--rate", "1000", "--duration", "0.5"], 500),
        (&["--rate", "0.5", "--duration", "0.01s"], 1),
        (&["--rate", "100", "--duration", "0.01m"], 60),
        (&["--rate", "100", "--duration", "0.0001h"], 36),
    ] {
        let output = Process::start(publisher(&place, &scene).args(arguments)).output();
        assert_summary(&summary(&output), periods, "duration", false);
    }
}

/// Two boards that overlap at the start, a cue whose event never happens, and a countdown in wall time.
#[test]
fn a_person_is_told_what_lies_ahead() {
    let folder = tempfile::tempdir().unwrap();
    let place = Place::new("cli_told");
    let printed = |scene: &SceneFile, arguments: &[&str]| {
        let mut command = place.program();
        command.arg("--scene").arg(&scene.path).args(["run", "--duration", "0.3"]).args(arguments);
        let output = Process::start(&mut command).output();
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stderr)
    };
    let crowded = printed(&scene("school").with(&folder, "path", "pitch", 0.28), &[]);
    assert!(crowded.contains("boards overlap at the start"), "{crowded}");

    let school = scene("school");
    let cue = "name = \"never\"\nbefore = \"path_end\"".parse::<toml::Table>().unwrap();
    let school = school.with(&folder, "", "cues", vec![toml::Value::from(cue)]);
    let contact = school.json(&["events"])[0]["time"].as_f64().unwrap();
    let start = (contact - 8.0).to_string();
    let told = printed(&school, &["--start", &start, "--time-scale", "4"]);
    assert!(told.contains("cue \"never\" has no time in this show"), "{told}");
    assert!(!told.contains("overlap at the start") && told.contains("4 simulated seconds per second"), "{told}");
    let line = told.lines().find(|line| line.contains("approaching")).unwrap_or_else(|| panic!("{told}"));
    let before = |mark: &str| line.split(mark).next().unwrap().split_whitespace().last().unwrap().parse::<f64>();
    let (simulated, wall) = (before(" s  approaching").unwrap(), before(" s; nearest").unwrap());
    assert!((wall - (contact - simulated) / 4.0).abs() <= 0.051, "{line}: the contact is at {contact} s");
}

#[test]
fn signals_end_both_ends_with_exit_code_0_and_whole_lines() {
    for (scene, signal) in [(scene("school"), SIGINT), (scene("procession"), SIGTERM)] {
        let place = Place::new("cli_signal");
        let publisher = Process::start(publisher(&place, &scene).args(["--rate", "200"]));
        let mut monitor = Process::start(place.program().args(["--json", "watch"]));
        let lines = monitor.lines();
        lines.until("\"moving\"");
        publisher.signal(signal);
        assert_summary(&summary(&publisher.output()), 0, "signal", false);
        lines.until("\"waiting\"");
        monitor.signal(signal);
        for line in lines.rest() {
            serde_json::from_str::<Value>(&line).unwrap();
        }
        let output = monitor.output();
        assert_eq!((output.status.code(), text(&output.stderr).as_str()), (Some(0), ""));
    }
}

#[test]
fn a_name_before_or_after_the_subcommand_is_the_services_name() {
    let scene = scene("school");
    let place = Place::new("cli_name");
    let mut before = place.program();
    before.args(["--name", "lion", "--scene"]).arg(&scene.path).args(["run", "--json"]);
    let lion = Process::start(&mut before);
    let watch = |arguments: &[&str]| {
        json_lines(&Process::start(place.program().args(["watch", "--json"]).args(arguments)).output())
    };
    let heard = watch(&["--duration", "3", "--name", "lion"]);
    assert!(number(heard.last().unwrap(), "received") > 0, "{heard:?}");
    let heard = watch(&["--duration", "1"]);
    assert!(heard.iter().all(|line| line["state"] == "waiting"), "another name: {heard:?}");
    // A second publisher of that name, named after the subcommand, is refused.
    let mut after = place.program();
    after.args(["run", "--json", "--duration", "1", "--name", "lion", "--scene"]).arg(&scene.path);
    let output = Process::start(&mut after).output();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("lion"), "{}", text(&output.stderr));
    lion.signal(SIGINT);
    assert_eq!(summary(&lion.output())["end"], "signal");
}

#[test]
fn watch_ends_quietly_when_nobody_reads_it() {
    let place = Place::new("cli_unread");
    for arguments in [&["watch"][..], &["watch", "--json"]] {
        for both in [false, true] {
            let mut monitor = Process::start(place.program().args(arguments));
            monitor.close_stdout();
            if both {
                monitor.close_stderr();
            }
            let output = monitor.output();
            assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
        }
    }
}
