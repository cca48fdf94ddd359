//! A show has one name, and its services admit a second publisher: the end of a tunnel to other machines, here a
//! program in Python. Subscribers of the show count only the show's messages, and notice its death though that
//! publisher stays.
//!
//! Every wait has a deadline, and no test asserts a speed.

use crate::harness;

use harness::{LONG_QUEUE, Lines, Place, Process, can_run, python, python_modules, summary, text};
use nix::sys::signal::Signal::{SIGCONT, SIGINT, SIGKILL, SIGTERM, SIGUSR1};
use serde_json::Value;

fn object(line: &str) -> Value {
    serde_json::from_str(line).unwrap()
}

/// Returns the second publisher, once it has all its ports.
fn second(place: &Place) -> (Process, Lines) {
    let mut command = python();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/second_publisher.py");
    command.args([script, "--name", "bench_dragon"]).current_dir(place.folder());
    let mut process = Process::start(&mut command);
    let lines = process.lines();
    assert_eq!(object(&lines.until("ready"))["third_refused"], true);
    (process, lines)
}

fn show(place: &Place) -> Process {
    let scene = place.scene_publishing(LONG_QUEUE);
    Process::start(place.program().args(["run", "--json", "--rate", "100", "--scene"]).arg(scene))
}

/// Asserts that a show cannot start here because one is running.
fn assert_refused(place: &Place, command: &[&str]) {
    let output = Process::start(place.program().args(command)).output();
    let printed = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{printed}");
    assert!(printed.contains("another publisher is running under the name \"bench_dragon\""), "{printed}");
    assert_eq!(printed.lines().count(), 1, "{printed}");
}

/// Returns the lines of a reader up to the first one that reports a tick after `tick`.
fn beyond(lines: &Lines, tick: u64) -> Vec<String> {
    let mut read = Vec::new();
    loop {
        read.extend(lines.all_until("tick"));
        // The last line is the awaited one.
        let (_, behind) = read.last().unwrap().rsplit_once("tick").unwrap();
        let from_digit = behind.trim_start_matches(|it: char| !it.is_ascii_digit());
        let digits = from_digit.split(|it: char| !it.is_ascii_digit()).next();
        if digits.and_then(|digits| digits.parse().ok()).is_some_and(|reported: u64| reported > tick) {
            return read;
        }
    }
}

/// Returns a tick that the show reaches after this call.
fn tick_to_come(place: &Place) -> u64 {
    let output = Process::start(place.program().args(["watch", "--json", "--duration", "1"])).output();
    let ticks = text(&output.stdout).lines().map(|line| object(line)["tick"].as_u64()).max();
    ticks.flatten().unwrap()
}

#[test]
fn a_second_publisher_is_admitted_and_nothing_of_it_is_taken_for_the_show() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let place = Place::new("second");
    let mut monitor = Process::start(place.program().arg("watch"));
    let monitored = monitor.lines();
    let mut json = Process::start(place.program().args(["watch", "--json"]));
    let json_lines = json.lines();
    let mut observer = Process::start(place.program().arg("soak-subscriber"));
    let observed = observer.lines();
    let first = show(&place);
    monitored.until("is running");
    observed.until("\"status\":{");
    let (peer, told) = second(&place);
    // The stage is sent again while the second publisher exists, and is the same.
    let [one, other] = [(); 2].map(|()| object(&told.until("\"stage\"")));
    assert_eq!(one, other);
    // Frames and alerts of another run do not belong to the show.
    peer.signal(SIGUSR1);
    (0..50).for_each(|_| drop(told.until("sent")));
    monitored.until("missed 0");

    // The name remains the show's, while the show runs and while it is stopped, for every command that publishes.
    assert_refused(&place, &["run"]);
    first.stop();
    assert_refused(&place, &["run", "--duration", "1"]);
    let soaked =
        Process::start(place.program().args(["--name", "bench_dragon", "soak", "--duration", "1", "--rate", "100"]))
            .output();
    assert!(!soaked.status.success(), "{}", text(&soaked.stdout));
    first.signal(SIGCONT);

    // The show is killed; the other publisher stays, silent, and holds no name.
    peer.signal(SIGUSR1);
    told.until("silent");
    // The frames that the second publisher has sent are read before: otherwise it would be selected next.
    let after = tick_to_come(&place);
    let mut printed = beyond(&json_lines, after);
    beyond(&monitored, after);
    beyond(&observed, after);
    first.signal(SIGKILL);
    monitored.until("has ended");
    let last = show(&place);
    monitored.until("is running");
    monitored.until("missed 0");
    // The other readers may connect later.
    printed.extend(json_lines.all_until("\"alert\""));
    observed.until("\"runs\":2");
    last.signal(SIGINT);
    let published = summary(&last.output());
    monitored.until("has ended");
    [&json, &monitor, &observer, &peer].iter().for_each(|process| process.signal(SIGTERM));

    let seen = object(observed.rest().last().unwrap());
    let count = |key: &str| seen[key].as_u64().unwrap_or_else(|| panic!("no {key} in {seen}"));
    assert_eq!([count("runs"), count("missed"), count("disordered"), count("wrong_links")], [2, 0, 0, 0], "{seen}");
    assert_eq!(count("last_sequence") + 1, published["frames"].as_u64().unwrap(), "{seen}");
    printed.extend(json_lines.rest());
    let alerts = printed.iter().map(|line| object(line)).filter(|line| line["type"] == "alert");
    let runs: Vec<Value> = alerts.map(|alert| alert["run_id"].clone()).collect();
    // One for each run: while a second publisher exists the latest is sent repeatedly, and passed on only once.
    assert!(runs.len() == 2 && runs.iter().all(|run| run != "7"), "{runs:?}");
    monitored.rest();
    told.rest();
    place.assert_clean();
}

/// A publisher that was selected while no show was running, and then stopped sending, does not keep readers from the
/// next show.
#[test]
fn the_next_show_is_seen_though_another_publisher_was_followed() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let place = Place::new("next");
    let mut monitor = Process::start(place.program().arg("watch"));
    let monitored = monitor.lines();
    let first = show(&place);
    monitored.until("is running");
    let (peer, told) = second(&place);
    peer.signal(SIGUSR1);
    told.until("sent");
    first.signal(SIGKILL);
    monitored.until("is running (run 0000000000000007)");
    peer.signal(SIGUSR1);
    monitored.until("sends nothing");

    let last = show(&place);
    monitored.until("has ended");
    let started = monitored.until("is running");
    last.signal(SIGINT);
    summary(&last.output());
    assert!(!started.contains("0000000000000007"), "{started}");
    monitored.until("has ended");
    [&monitor, &peer].iter().for_each(|process| process.signal(SIGTERM));
    monitored.rest();
    told.rest();
    place.assert_clean();
}
