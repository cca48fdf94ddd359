//! The soak test as users run it: real publisher, real subscribers, a verdict with its exit code, a report.
//!
//! Asserts counts and order, never a speed: every limit on speed is out of reach, or as low as possible.

use crate::harness;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use bench_dragon::client::connection::Wake;
use bench_dragon::client::feed::{Delivery, Feed, FeedEvent, FeedOptions};
use bench_dragon::messages::LoopStatus;
use nix::sys::signal::Signal::{SIGINT, SIGKILL, SIGTERM};
use nix::sys::signal::kill;
use nix::unistd::Pid;
use serde_json::Value;

use harness::{
    LONG_QUEUE, Place, Process, aloud, answering, can_run, json_lines, long, program, python, python_modules, root,
    scene_file, summary, text, unique, wait, wait_until,
};

/// Limits that any machine keeps. A subscriber that does not run for a while leaves frames in its queue, whose memory
/// the publisher then touches for the first time. This is 9 to 13 kB for each of up to 1000 frames.
const ANY_SPEED: [&str; 6] = ["--max-skipped", "100%", "--max-lateness-p999", "3600s", "--max-rss-growth", "20MB"];

fn number(value: &Value, key: &str) -> u64 {
    value[key].as_u64().unwrap_or_else(|| panic!("no {key} in {value}"))
}

/// Returns the checks of limits, by name: true if passed, and the value.
fn checks(report: &Value) -> BTreeMap<&str, (bool, f64)> {
    let all = report["checks"].as_array().unwrap().iter();
    let value = |one: &Value| one["value"].as_f64().unwrap_or(f64::NAN);
    all.map(|one| (one["name"].as_str().unwrap(), (one["passed"] == true, value(one)))).collect()
}

#[test]
fn twenty_seconds_pass_with_nothing_missed() {
    let place = Place::new("soak");
    let mut soak = place.program();
    // A subscriber that keeps up loses nothing, even if the machine does not run it for up to eight seconds.
    soak.arg("--scene").arg(place.scene_publishing("queue = 2000"));
    soak.args(["soak", "--json", "--duration", "20s", "--rate", "250", "--report", "report"]);
    soak.args(["--subscribers", "3", "--slow", "1", "--flaky", "1"]).args(ANY_SPEED);
    let output = Process::start(&mut soak).output();
    assert!(output.status.success(), "{} {}", text(&output.stderr), text(&output.stdout));
    let report = json_lines(&output).pop().unwrap();
    assert_eq!(report["verdict"], "PASS");
    let publisher = &report["publisher"];
    let (frames, skipped) = (number(publisher, "frames"), number(publisher, "skipped"));
    // The publisher starts before the twenty seconds, and ends after them.
    assert!(frames + skipped >= 5000, "{publisher}");
    let subscribers = report["subscribers"].as_array().unwrap();
    let roles: Vec<_> = subscribers.iter().map(|one| one["role"].as_str().unwrap()).collect();
    assert_eq!(roles, ["steady", "steady", "steady", "slow", "flaky"]);
    for subscriber in subscribers {
        let seen = &subscriber["seen"];
        for fault in ["disordered", "wrong_links"] {
            assert_eq!(number(seen, fault), 0, "{subscriber}");
        }
        assert!(number(seen, "links_checked") > 100 && number(seen, "alerts") > 0, "{subscriber}");
        match subscriber["role"].as_str().unwrap() {
            "steady" => {
                assert_eq!((number(seen, "missed"), number(seen, "runs")), (0, 1), "{subscriber}");
                assert_eq!(number(seen, "last_sequence") + 1, frames, "{subscriber}");
                // Periods may have passed between the last frame and the stop.
                assert!((frames..=frames + skipped).contains(&(number(seen, "last_tick") + 1)), "{subscriber}");
                // The subscriber was there from about the first second on.
                assert!(number(seen, "received") > frames / 2, "{subscriber}");
            }
            "slow" => assert!(number(seen, "received") > frames / 2, "{subscriber}"),
            _ => assert!(number(subscriber, "incarnations") >= 3, "{subscriber}"),
        }
    }
    let rows = report["history"]["rows"].as_array().unwrap();
    // One a second, fewer where the machine does not run the test for some seconds.
    assert!((10..=21).contains(&rows.len()), "{} rows", rows.len());
    let columns = report["history"]["columns"].as_array().unwrap().len();
    assert!(rows.iter().all(|row| row["values"].as_array().unwrap().len() == columns));
    assert_is_whole_page(&std::fs::read_to_string(place.folder().join("report.html")).unwrap(), subscribers.len());
    let filed: Value = serde_json::from_slice(&std::fs::read(place.folder().join("report.json")).unwrap()).unwrap();
    assert_eq!(filed, report);
    assert_can_be_sent(&place, &report);
    place.assert_clean();
}

/// A read every 1.5 s, and a queue that lasts half a second: two thirds of all frames are missed. Those that a steady
/// subscriber misses, where the machine does not run it for half a second, are counted alone.
#[test]
fn a_slow_subscriber_may_miss_frames() {
    let place = Place::new("soak_slow");
    let mut soak = place.program();
    soak.arg("--scene").arg(place.scene_publishing("queue = 125")).args(["soak", "--json", "--duration", "8s"]);
    soak.args(["--rate", "250", "--subscribers", "1", "--slow", "1"]).args(ANY_SPEED);
    let report = json_lines(&Process::start(&mut soak).output()).pop().unwrap();
    let [steady, slow] = [0, 1].map(|at| &report["subscribers"][at]);
    assert!(slow["role"] == "slow" && number(&slow["seen"], "missed") > 0, "{report}");
    let (passed, missed) = checks(&report)["frames missed by steady subscribers"];
    assert!(missed >= number(&steady["seen"], "missed") as f64 && passed == (missed == 0.0), "{report}");
}

/// Asserts that the files beside a report agree with it, by independent readers. The JSON fits its schema, the
/// histograms have the percentiles of the JSON, and the show of the log is that of the frames.
fn assert_can_be_sent(place: &Place, report: &Value) {
    let publisher = &report["publisher"];
    let verified = Process::start(place.program().args(["--json", "verify", "report.log.jsonl"])).output();
    let verdict = json_lines(&verified).pop().unwrap_or_else(|| panic!("{}", text(&verified.stderr)));
    assert_eq!((&verdict["verdict"], &verdict["complete"]), (&"same".into(), &true.into()), "{verdict}");
    assert_eq!(number(&verdict, "frames") + number(&verdict, "lost"), number(publisher, "frames"), "{verdict}");
    if !can_run(python_modules(&["jsonschema", "hdrh"])) {
        return;
    }
    let schema = std::path::absolute("docs/soak-report.schema.json").unwrap();
    let script = std::path::absolute("tests/python/soak_report.py").unwrap();
    let mut reader = python();
    reader.current_dir(place.folder()).arg(script).arg("report").arg(schema);
    let output = Process::start(&mut reader).output();
    let line = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
    assert!(number(&line, "left_out") > 60, "{line}");
    let began = line["began_at"].as_f64().unwrap();
    assert!((began - report["began_at"].as_f64().unwrap()).abs() < 60.0, "{line}");
    for (tag, field) in [("lateness", "wakeup_ns"), ("step", "step_ns")] {
        for percentile in ["p50", "p99", "p999", "max"] {
            assert_eq!(line[tag][percentile], publisher[field][percentile], "{tag} {percentile}");
        }
        let intervals: Vec<f64> = line[tag]["intervals"].as_array().unwrap().iter().flat_map(Value::as_f64).collect();
        assert!(intervals.windows(2).all(|pair| pair[1] - pair[0] >= 10.0), "{intervals:?}");
    }
    assert_eq!(line["step"]["count"], publisher["frames"]);
    assert!(!line["step"]["intervals"].as_array().unwrap().is_empty());
}

/// Asserts that a report is one page with every plot drawn inside it, which fetches nothing.
fn assert_is_whole_page(page: &str, subscribers: usize) {
    assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
    // Lateness, step, missed, overruns, memory, shared memory, descriptors, shows; and a latency for each subscriber.
    assert_eq!(page.matches("<h2>").count(), 8 + subscribers);
    // The plots; the keys of their legends are small pictures too.
    assert_eq!(page.matches("<svg width=\"760\"").count(), 8 + subscribers);
    let addresses = page.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    for outside in ["http", "src=", "href=", "@import", "url(", "<script"] {
        assert!(!addresses.contains(outside), "{outside}");
    }
}

#[cfg(feature = "ros2")]
#[test]
fn the_memory_of_the_process_of_ros_2_is_in_the_report() {
    let place = Place::new("soak_ros2");
    let soak = |arguments: &[&str]| {
        let mut soak = place.program();
        soak.args(["soak", "--json", "--ros2", "--duration", "5s"]).args(arguments).args(ANY_SPEED);
        Process::start(&mut soak).output()
    };
    let output = soak(&["--subscribers", "2"]);
    assert!(output.status.success(), "{} {}", text(&output.stderr), text(&output.stdout));
    let report = json_lines(&output).pop().unwrap();
    let publisher = &report["publisher"];
    assert!(number(&publisher["ros2"], "frames") > 100, "{publisher}");
    let columns = report["history"]["columns"].as_array().unwrap();
    let [of_ros2, of_loop] = ["ros2_resident_bytes", "resident_bytes"].map(|name| {
        let at = columns.iter().position(|column| column == name).unwrap();
        let rows = report["history"]["rows"].as_array().unwrap();
        rows.iter().map(|row| row["values"][at].as_f64().unwrap()).collect::<Vec<_>>()
    });
    // The memory of DDS is there, and not in the loop's process.
    assert!(of_ros2.len() >= 4 && of_ros2.iter().all(|bytes| *bytes > 10e6), "{of_ros2:?}");
    assert_ne!(of_ros2, of_loop);
    // ROS 2 is one of the eight subscribers that the publisher admits.
    let refused = soak(&["--subscribers", "8"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("less one for ROS 2"), "{}", text(&refused.stderr));
    place.assert_clean();
}

#[test]
fn a_scene_of_weak_accuracy_passes_with_the_links_it_promises() {
    let place = Place::new("weak");
    let scene = scene_file("weak", &[("accuracy = 1e-9", "accuracy = 1e-5"), ("velocities = true", LONG_QUEUE)]);
    let mut soak = place.program();
    soak.args(["--scene", scene.to_str().unwrap(), "soak", "--json", "--duration", "3s", "--subscribers", "1"]);
    let output = Process::start(soak.args(ANY_SPEED)).output();
    assert!(output.status.success(), "{} {}", text(&output.stderr), text(&output.stdout));
    let seen = &json_lines(&output).pop().unwrap()["subscribers"][0]["seen"];
    assert_eq!(number(seen, "wrong_links"), 0, "{seen}");
    let worst = seen["worst_link_error"].as_f64().unwrap();
    // Less exact than the links are; a subscriber that knows the scene accepts it.
    assert!((1e-9..2e-5).contains(&worst), "{worst:e} m");
}

/// Returns the program with the name of a soak test.
fn named(place: &Place) -> std::process::Command {
    let mut program = place.program();
    program.args(["--name", "soak"]);
    program
}

/// Returns the process of a soak test when its publisher answers and each of its subscribers has then printed
/// observations of frames.
fn observing(soak: Process, place: &Place, subscribers: usize) -> Process {
    let soak = answering(soak, || named(place));
    let written = |child: Pid| {
        let counts = std::fs::read_to_string(format!("/proc/{child}/io")).unwrap();
        counts.lines().find_map(|line| line.strip_prefix("wchar: ")?.parse::<u64>().ok()).unwrap()
    };
    let mut before = Vec::new();
    wait_until("the subscribers", || {
        let all = children(&soak).into_iter().filter(|(_, command)| command.contains("\0soak-subscriber\0"));
        before = all.map(|(child, _)| (child, written(child))).collect();
        before.len() == subscribers
    });
    // The files of a node have some 2,000 bytes, an observation of frames 800.
    wait_until("observations", || before.iter().all(|(child, bytes)| written(*child) > bytes + 6000));
    soak
}

#[test]
fn a_broken_limit_fails_even_when_interrupted() {
    let place = Place::new("broken");
    let mut soak = place.program();
    soak.arg("--scene").arg(place.scene_publishing(LONG_QUEUE));
    soak.args(["soak", "--json", "--duration", "8h", "--rate", "100", "--subscribers", "1"]);
    soak.args(["--max-skipped", "100%", "--max-lateness-p999", "1ns", "--max-rss-growth", "20MB"]);
    let soak = observing(Process::start(&mut soak), &place, 1);
    soak.signal(SIGINT);
    let output = soak.output();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("wake-up lateness"), "{}", text(&output.stderr));
    let report = json_lines(&output).pop().unwrap();
    assert_eq!(report["verdict"], "FAIL");
    let checks = checks(&report);
    let failed: Vec<_> = checks.iter().filter(|(_, (passed, _))| !passed).collect();
    assert_eq!(failed.len(), 1, "{checks:?}");
    assert!(failed[0].0.contains("lateness") && failed[0].1.1 > 1.0, "{failed:?}");
    place.assert_clean();
}

/// Eight seconds, or ten minutes if long tests are requested.
#[test]
fn a_conducted_show_obeys_while_clients_are_killed() {
    let place = Place::new("conducted");
    let (duration, rate, commands) = if long() { ("10m", "1000", 5000) } else { ("8s", "200", 40) };
    let scene = place.scene_publishing("queue = 1000");
    let mut soak = place.program();
    soak.args(["--scene", scene.to_str().unwrap(), "soak", "--json", "--duration", duration, "--rate", rate]);
    soak.args(["--conduct", "7", "--flaky-clients", "2", "--subscribers", "2", "--report", "report"]);
    let output = Process::start(soak.args(ANY_SPEED)).output();
    assert!(output.status.success(), "{} {}", text(&output.stderr), text(&output.stdout));
    if long() {
        aloud(&text(&output.stdout));
    }
    let report = json_lines(&output).pop().unwrap();
    assert_eq!(report["verdict"], "PASS");
    let conducted = &report["conducted"];
    assert!(number(conducted, "sent") >= commands && number(conducted, "jumps") > 0, "{conducted}");
    assert!(number(conducted, "refused_as_expected") > 0 && number(conducted, "compared") > 0, "{conducted}");
    for fault in ["wrong", "lost", "contradicted"] {
        assert_eq!(number(conducted, fault), 0, "{conducted}");
    }
    let answers = conducted["answers"].as_object().unwrap();
    assert!(answers.len() >= 8, "{conducted}");
    // Two clients, each of which was killed at least once.
    assert!(number(&report, "clients_killed") >= 2, "{report}");
    for subscriber in report["subscribers"].as_array().unwrap() {
        let seen = &subscriber["seen"];
        assert_eq!((number(seen, "missed"), number(seen, "disobedient")), (0, 0), "{seen}");
        // From the first status on, a second after the beginning.
        assert!(number(seen, "times_checked") > number(seen, "received") / 2, "{seen}");
        assert!(number(seen, "epoch") >= number(conducted, "jumps"), "{seen}");
    }
    for name in ["frames that disobey the commands", "jumps of simulated time too many or too few"] {
        assert_eq!(checks(&report)[name], (true, 0.0), "{name}");
    }
    let page = std::fs::read_to_string(place.folder().join("report.html")).unwrap();
    assert!(page.contains("<th>command") && page.contains("<td>resume") && page.contains("conducted with seed 7"));
    assert_can_be_sent(&place, &report);
    place.assert_clean();
}

/// Two dragons under one clock: the links of each, and every frame against the commands.
#[test]
fn a_conducted_show_of_two_passes() {
    let place = Place::new("soak_two");
    let scene = place.folder().join("coil.toml");
    let coil = include_str!("../../config/coil.toml").replace("[publish]", "[publish]\nqueue = 1000");
    std::fs::write(&scene, coil).unwrap();
    let mut soak = place.program();
    soak.args(["--scene", scene.to_str().unwrap(), "soak", "--json", "--duration", "8s", "--rate", "200"]);
    soak.args(["--conduct", "7", "--subscribers", "2", "--report", "report"]);
    let output = Process::start(soak.args(ANY_SPEED)).output();
    assert!(output.status.success(), "{} {}", text(&output.stderr), text(&output.stdout));
    let report = json_lines(&output).pop().unwrap();
    assert_eq!(report["verdict"], "PASS");
    assert!(number(&report["conducted"], "sent") >= 20, "{report}");
    let subscribers = report["subscribers"].as_array().unwrap();
    for subscriber in subscribers {
        let seen = &subscriber["seen"];
        assert_eq!(
            (number(seen, "missed"), number(seen, "disobedient"), number(seen, "wrong_links")),
            (0, 0, 0),
            "{seen}"
        );
        assert!(number(seen, "links_checked") > 100 && number(seen, "times_checked") > 100, "{seen}");
        // A link between the dragons would be metres off.
        assert!(seen["worst_link_error"].as_f64().unwrap() < 1e-8, "{seen}");
    }
    assert_is_whole_page(&std::fs::read_to_string(place.folder().join("report.html")).unwrap(), subscribers.len());
    place.assert_clean();
}

/// A second control client sends commands: the test reports effects of commands that its own client did not send.
#[test]
fn a_show_that_somebody_else_conducts_too_fails() {
    let place = Place::new("meddled");
    let scene = place.scene_publishing("queue = 1000");
    let mut soak = place.program();
    soak.args(["--scene", scene.to_str().unwrap(), "soak", "--json", "--duration", "8h", "--rate", "100"]);
    let soak = Process::start(soak.args(["--conduct", "1", "--subscribers", "1"]).args(ANY_SPEED));
    let control = |arguments: &[&str]| {
        let output = Process::start(named(&place).args(["--json", "control"]).args(arguments)).output();
        json_lines(&output).pop().unwrap_or_default()
    };
    let until = |what: &str, arguments: &[&str], wanted: &dyn Fn(&Value) -> bool| {
        let deadline = Instant::now() + harness::patience();
        while !wanted(&control(arguments)) {
            assert!(Instant::now() < deadline, "{what} did not happen");
            wait(0.05);
        }
    };
    // The show waits at its start until the first command.
    until("a first command", &["state"], &|state| state["sim_time"].as_f64().is_some_and(|time| time > 0.0));
    // A jump that is not counted, and a hold that is not expected, unless the show is held at that time.
    until("a seek", &["seek", "5"], &|answer| answer["code"] == "done");
    until("a hold", &["hold"], &|answer| answer["code"] == "done");
    until("a release", &["state"], &|state| state["playback"] != "held");
    soak.signal(SIGINT);
    let output = soak.output();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stdout));
    let report = json_lines(&output).pop().unwrap();
    let checks = checks(&report);
    assert_eq!(checks["jumps of simulated time too many or too few"], (false, 1.0));
    assert!(checks["answers that the command table does not allow"].1 >= 1.0, "{checks:?}");
    // The seek may have arrived in the same period in which a step ended; the frame then contradicts the step's answer.
    let faults = report["conducted"]["faults"].as_array().unwrap();
    assert!(faults.iter().any(|fault| fault.as_str().unwrap().contains("expected")), "{faults:?}");
    // The stream itself is in order: each frame follows from the frame before.
    assert_eq!(checks["frames that disobey the commands"], (true, 0.0));
}

/// Returns the processes that a process has started, and their command lines.
fn children(process: &Process) -> Vec<(Pid, String)> {
    let id = process.id();
    let children = std::fs::read_to_string(format!("/proc/{id}/task/{id}/children")).unwrap();
    let command = |child: &str| std::fs::read_to_string(format!("/proc/{child}/cmdline")).unwrap_or_default();
    children.split_whitespace().map(|child| (Pid::from_raw(child.parse().unwrap()), command(child))).collect()
}

fn exists(process: Pid) -> bool {
    kill(process, None).is_ok()
}

#[test]
fn a_publisher_that_ends_in_good_order_before_its_time_fails_the_test() {
    let place = Place::new("bereft");
    let mut soak = place.program();
    soak.args(["soak", "--json", "--duration", "8h", "--rate", "100", "--subscribers", "2"]).args(ANY_SPEED);
    let soak = observing(Process::start(&mut soak), &place, 2);
    let publisher = children(&soak).into_iter().find(|(_, command)| command.contains("\0run\0")).unwrap().0;
    kill(publisher, SIGTERM).unwrap();
    let output = soak.output();
    assert_eq!(output.status.code(), Some(1));
    let report = json_lines(&output).pop().unwrap();
    assert_eq!(report["verdict"], "FAIL");
    assert_eq!(checks(&report)["processes that ended by themselves or hung"], (false, 1.0));
    let cause = report["causes"][0].as_str().unwrap();
    assert!(cause.starts_with("the publisher ended with exit code 0 after "), "{cause}");
    assert_eq!(report["publisher"]["end"], "signal");
}

/// As in a container whose only program is the soak test.
#[test]
fn a_soak_test_can_be_the_first_process_of_its_system() {
    if !can_run(root("make a namespace of processes")) {
        return;
    }
    let place = Place::new("first");
    let mut soak = std::process::Command::new("unshare");
    soak.args(["--pid", "--fork", "--mount-proc", "--kill-child"]).arg(place.program().get_program());
    soak.arg("--scene").arg(place.scene_publishing(LONG_QUEUE)).args(["soak", "--json", "--duration", "3"]);
    soak.args(["--rate", "100", "--subscribers", "1", "--flaky", "1"]);
    let output = Process::start(soak.args(ANY_SPEED).current_dir(place.folder())).output();
    let report = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
    assert_eq!(checks(&report)["processes that ended by themselves or hung"], (true, 0.0));
    assert_eq!(output.status.code(), Some(0), "{report}");
    place.assert_clean();
}

#[test]
fn nobody_outlives_a_killed_soak_test() {
    let place = Place::new("orphans");
    let mut soak = place.program();
    soak.args(["soak", "--duration", "8h", "--rate", "100", "--slow", "1"]);
    let soak = Process::start(&mut soak);
    wait_until("its five children run", || children(&soak).len() == 5);
    let children = children(&soak);
    soak.signal(SIGKILL);
    drop(soak);
    wait_until("all of them have ended", || !children.iter().any(|(child, _)| exists(*child)));
    place.assert_clean();
}

#[test]
fn what_cannot_be_is_refused_before_it_starts() {
    let cases: [(&[&str], &str); 13] = [
        (&["--subscribers", "0"], "--subscribers"),
        (&["--subscribers", "7", "--flaky", "2"], "publish.subscribers"),
        (&["--rate", "20001"], "--rate"),
        (&["--max-skipped", "2"], "0.01%"),
        (&["--max-lateness-p999", "200"], "200us"),
        (&["--report", "/nonexistent/report"], "--report"),
        (&["--conduct", "x"], "a whole number from 0 to 18446744073709551615"),
        (&["--conduct", "-1"], "a whole number"),
        (&["--conduct", "1.5"], "a whole number"),
        (&["--conduct", "1", "--subscribers", "8"], "less one for --conduct"),
        (&["--conduct", "1", "--flaky-clients", "9"], "expected at most 8"),
        (&["--flaky-clients", "1"], "--conduct"),
        // The publisher's own sentence.
        (&["--cpu", "4096"], "error: --cpu"),
    ];
    for (arguments, named) in cases {
        let output = Process::start(program("refused").arg("soak").args(arguments)).output();
        let printed = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {printed}");
        assert!(printed.contains(named), "{printed}");
    }
}

#[test]
fn the_status_comes_once_a_second_and_adds_up() {
    let publisher = Process::start(program("status").args(["run", "--json", "--rate", "50", "--start", "300"]));
    let mut feed = Feed::new(&unique("status"), FeedOptions { wake: Wake::OnFrame, frames: Delivery::All }).unwrap();
    let mut statuses: Vec<LoopStatus> = Vec::new();
    let mut frames = Vec::new();
    let end = Instant::now() + harness::patience();
    let (mut gone, mut all_missed) = (false, 0);
    while !gone {
        assert!(Instant::now() < end, "{} statuses", statuses.len());
        let before = statuses.len();
        let polled = feed.poll(Duration::from_millis(50), &mut |event| match event {
            FeedEvent::Frame { header, missed, .. } => {
                frames.push((header.sequence, header.tick, header.run_id));
                all_missed += missed;
            }
            FeedEvent::Status(status) => statuses.push(*status),
            FeedEvent::Gone => gone = true,
            _ => (),
        });
        polled.unwrap();
        if before < 6 && statuses.len() >= 6 {
            publisher.signal(SIGINT);
        }
    }
    let summary = summary(&publisher.output());
    // One for every second between the first and the last status, which is sent at the end. A machine that stops for a
    // moment delays some.
    let [first, last] = [&statuses[0], statuses.last().unwrap()];
    let seconds = (last.tick - first.tick) as f64 / 50.0;
    assert!((statuses.len() as f64 - 1.0 - seconds).abs() < 4.0, "{} in {seconds} s", statuses.len());
    for status in &statuses {
        assert_eq!((status.scene.as_str(), status.rate), ("paper", 50.0));
        assert_eq!(status.sequence + 1 + status.skipped, status.tick + 1, "{status:?}");
        let is_of_a_frame = frames.contains(&(status.sequence, status.tick, status.run_id));
        assert!(is_of_a_frame || all_missed > 0, "{status:?}");
        assert_eq!(status.sim_time, 300.0 + status.tick as f64 / 50.0);
        assert!(status.measured_rate > 0.0 && status.overruns <= status.skipped);
        let [late, step] = [
            [
                status.lateness_p50_total,
                status.lateness_p99_total,
                status.lateness_p999_total,
                status.lateness_max_total,
            ],
            [status.step_p50_total, status.step_p99_total, status.step_p999_total, status.step_max_total],
        ];
        assert!(late.is_sorted() && step.is_sorted() && late[0] > 0 && step[0] > 0, "{status:?}");
        assert!(status.lateness_p50_second <= status.lateness_max_second, "{status:?}");
        assert!(status.lateness_max_second <= status.lateness_max_total, "{status:?}");
        assert!(status.resident_bytes > 1_000_000 && status.file_descriptors > 3, "{status:?}");
    }
    assert!(statuses.windows(2).all(|pair| pair[0].tick < pair[1].tick && pair[0].stamp_ns < pair[1].stamp_ns));
    assert!(statuses[1..].iter().all(|status| status.subscribers == 1), "{statuses:?}");
    assert_eq!(last.sequence + 1, number(&summary, "frames"));
    // Periods skipped between the last frame and the signal are in the summary alone.
    assert!(last.skipped <= number(&summary, "skipped"), "{last:?} {summary}");
}
