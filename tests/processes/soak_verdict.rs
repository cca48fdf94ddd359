//! The words of a soak test for people and test servers: its progress, what ended first, the limits beside the values, and
//! JUnit XML. It runs beside a show of the usual name.

use crate::harness;

use std::path::Path;
use std::time::Duration;

use harness::{Place, Process, answering, json_lines, text, wait_until};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use roxmltree::Document;

/// Limits that a busy machine keeps.
const ANY_SPEED: [&str; 6] = ["--max-skipped", "100%", "--max-lateness-p999", "3600s", "--max-rss-growth", "1GB"];

fn soak(place: &Place, arguments: &[&str]) -> Process {
    let mut command = place.program();
    command.arg("--scene").arg(place.scene_publishing("queue = 1000"));
    Process::start(command.args(["soak", "--rate", "100", "--subscribers", "1"]).args(arguments))
}

/// Returns the child process that runs a subcommand, once there is one.
fn child(of: &Process, subcommand: &str) -> Pid {
    let mut found = None;
    wait_until(subcommand, || {
        let listed = std::fs::read_to_string(format!("/proc/{0}/task/{0}/children", of.id())).unwrap();
        let children = listed.split_whitespace().map(|child| child.parse::<i32>().unwrap());
        found = children.into_iter().find(|child| {
            let command = std::fs::read(format!("/proc/{child}/cmdline")).unwrap_or_default();
            text(&command).contains(&format!("\0{subcommand}\0"))
        });
        found.is_some()
    });
    Pid::from_raw(found.unwrap())
}

/// Returns the message of each test case in a JUnit file, empty for a passed one, by its name.
fn cases(file: &Path) -> Vec<(String, String)> {
    let xml = std::fs::read_to_string(file).unwrap();
    let document = Document::parse(&xml).unwrap();
    let root = document.root_element();
    assert_eq!(root.tag_name().name(), "testsuites");
    let suite = root.children().find(|node| node.has_tag_name("testsuite")).unwrap();
    let of_case = |case: roxmltree::Node| {
        let failure = case.children().find(|node| node.has_tag_name("failure"));
        let message = failure.map_or(String::new(), |failure| failure.attribute("message").unwrap().to_owned());
        (case.attribute("name").unwrap().to_owned(), message)
    };
    let cases: Vec<_> = suite.children().filter(|node| node.has_tag_name("testcase")).map(of_case).collect();
    let count = |name: &str| suite.attribute(name).unwrap().parse::<usize>().unwrap();
    assert_eq!(count("tests"), cases.len());
    assert_eq!(count("failures"), cases.iter().filter(|(_, message)| !message.is_empty()).count());
    cases
}

#[test]
fn the_publisher_that_was_killed_is_named_before_all_figures() {
    let place = Place::new("soak_killed");
    let show = place.scene_publishing("");
    let mut run = place.program();
    run.args(["run", "--rate", "20", "--scene"]).arg(show);
    let _show = answering(Process::start(&mut run), || place.program());
    let mut soak = soak(&place, &[&ANY_SPEED[..], &["--duration", "1h30m", "--junit", "soak.xml"]].concat());
    soak.until_error("Soaking \"soak\" for 01:30:00");
    kill(child(&soak, "run"), Signal::SIGKILL).unwrap();
    let output = soak.output();
    let (printed, sentence) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(1), "{sentence}");
    let lines: Vec<&str> = printed.lines().collect();
    assert!(lines[0].starts_with("FAIL after "), "{printed}");
    assert!(lines[1].starts_with("  the publisher was killed by SIGKILL after "), "{printed}");
    let last = sentence.lines().last().unwrap();
    assert!(last.starts_with("error: the soak test failed: the publisher was killed by SIGKILL after "), "{last}");
    assert!(!last.contains("not known"), "{last}");
    assert!(!printed.contains("hint:") && printed.contains("  load average "), "{printed}");
    let failed: Vec<_> =
        cases(&place.folder().join("soak.xml")).into_iter().filter(|case| !case.1.is_empty()).collect();
    assert!(failed.iter().any(|(name, _)| name == "processes that ended by themselves or hung"), "{failed:?}");
}

#[test]
fn a_subscriber_that_was_killed_is_named_with_what_it_missed() {
    let place = Place::new("soak_orphan");
    let mut soak = soak(&place, &[&ANY_SPEED[..], &["--duration", "8", "--json"]].concat());
    soak.until_error("Soaking");
    kill(child(&soak, "soak-subscriber"), Signal::SIGKILL).unwrap();
    let output = soak.output();
    let report = json_lines(&output).pop().unwrap();
    let cause = report["causes"][0].as_str().unwrap();
    assert!(cause.starts_with("steady 1 was killed by SIGKILL after "), "{cause}");
    // Its frames, those that it missed and those after its end are all frames of the publisher.
    let [seen, subscriber] = [&report["subscribers"][0]["seen"], &report["subscribers"][0]];
    let count = |of: &serde_json::Value, key: &str| of[key].as_u64().unwrap();
    let missed = count(seen, "missed") + count(subscriber, "missed_after_last");
    assert_eq!(
        count(seen, "last_sequence") + 1 + count(subscriber, "missed_after_last"),
        count(&report["publisher"], "frames")
    );
    let check = &report["checks"][0];
    assert_eq!(
        (check["name"].as_str(), check["value"].as_f64()),
        (Some("frames missed by steady subscribers"), Some(missed as f64))
    );
    let sentence = text(&output.stderr);
    assert!(sentence.contains(&format!("frames missed by steady subscribers: {missed} (at most 0)")), "{sentence}");
}

#[test]
fn the_progress_is_printed_and_a_late_test_gets_hints() {
    let place = Place::new("soak_progress");
    // No machine wakes up within a nanosecond.
    let limits = ["--max-skipped", "100%", "--max-lateness-p999", "1ns", "--max-rss-growth", "1GB"];
    let soak = soak(&place, &[&limits[..], &["--duration", "0:14", "--junit", "soak.xml"]].concat());
    let output = soak.output();
    let (printed, told) = (text(&output.stdout), text(&output.stderr));
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines[0], "Soaking \"soak\" for 00:00:14; Ctrl-C ends with a verdict.");
    let progress = lines.iter().find(|line| line.contains(" of 00:00:14, ")).unwrap_or_else(|| panic!("{told}"));
    let left = |text: &str| {
        let seconds = text.rsplit(':').next().unwrap().parse::<u64>().unwrap();
        Duration::from_secs(seconds)
    };
    let (passed, rest) = progress.split_once(" of 00:00:14, ").unwrap();
    let (remaining, so_far) = rest.split_once(" left: ").unwrap();
    assert_eq!(left(passed) + left(remaining), Duration::from_secs(14), "{progress}");
    assert!(so_far.contains(" Hz, ") && so_far.ends_with(" periods skipped, 0 frames missed"), "{progress}");
    let last = lines.last().unwrap();
    assert!(last.starts_with("error: the soak test failed: wake-up lateness, 99.9th percentile: "), "{last}");
    assert!(last.ends_with(" us (at most 0.001 us)"), "{last}");
    assert!(printed.contains("\n  hint: --realtime 80 gives the loop a priority\n"), "{printed}");
    let cases = cases(&place.folder().join("soak.xml"));
    let failed: Vec<_> = cases.iter().filter(|(_, message)| !message.is_empty()).collect();
    assert!(cases.len() >= 8 && failed.len() == 1, "{cases:?}");
    assert!(last.ends_with(&failed[0].1), "{last}: {failed:?}");
}
