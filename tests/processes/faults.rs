//! Faults of a real machine, caused to real processes: kills, stops, clocks, full memory, races, other users.
//!
//! Each test ends with no loss that was excluded and no stale file. `BENCH_DRAGON_LONG=1` repeats the kills a thousand
//! and a hundred times. Every wait has a deadline, and no test asserts a speed.

use crate::harness;

use std::collections::BTreeSet;
use std::os::unix::fs::MetadataExt;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use nix::sys::signal::Signal::{self, SIGBUS, SIGCONT, SIGINT, SIGKILL, SIGTERM};
use serde_json::Value;

use harness::{
    LONG_QUEUE, Lines, Place, Process, answering, can_run, is_root, json_lines, long, root, summary, text, wait,
};

/// Returns a publisher whose subscribers lose nothing while the machine is too busy to run them.
fn publisher(place: &Place, arguments: &[&str]) -> Process {
    let scene = place.scene_publishing(LONG_QUEUE);
    Process::start(place.program().args(["run", "--json", "--scene"]).arg(scene).args(arguments))
}

/// Returns a subscriber that checks every frame: its process, and an observation per second.
fn observer(place: &Place) -> (Process, Lines) {
    let mut process = Process::start(place.program().arg("soak-subscriber"));
    let lines = process.lines();
    (process, lines)
}

/// Stops an observer, which must end without an error, and returns its observation.
fn observed((process, lines): (Process, Lines)) -> Value {
    process.signal(SIGTERM);
    let last = lines.rest().pop().unwrap();
    let output = process.output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_str(&last).unwrap()
}

fn number(value: &Value, key: &str) -> u64 {
    value[key].as_u64().unwrap_or_else(|| panic!("no {key} in {value}"))
}

/// Fails unless a run's frames reached an observer up to the last one, in order and correct.
fn assert_nothing_lost(seen: &Value, summary: &Value) {
    assert_nothing_wrong(seen);
    assert_eq!(number(seen, "runs"), 1, "{seen}");
    assert_eq!(number(seen, "last_sequence") + 1, number(summary, "frames"), "{seen} {summary}");
    // Periods that passed between the last frame and the stop are in the summary, and in no frame. If the last status
    // has arrived, it has the skipped periods before the last frame.
    let (frames, in_all) = (number(summary, "frames"), number(summary, "skipped"));
    let status = &seen["status"];
    let skipped = if status["frames"] == frames { number(status, "skipped") } else { in_all };
    assert!(skipped <= in_all, "{seen} {summary}");
    assert_eq!(number(seen, "last_tick") + 1, frames + skipped, "{seen} {summary}");
}

/// Fails unless an observer missed nothing between the frames it received, and found no error in them.
fn assert_nothing_wrong(seen: &Value) {
    assert!(number(seen, "received") > 0, "{seen}");
    for fault in ["missed", "disordered", "wrong_links"] {
        assert_eq!(number(seen, fault), 0, "{fault}: {seen}");
    }
    assert!(seen["phase_error_ns"].as_f64().unwrap() <= 2.0, "{seen}");
}

/// Returns one clear sentence; the exit code must be 1.
fn refusal(output: &Output) -> String {
    let printed = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{:?} {printed}", output.status.signal());
    assert_eq!(printed.lines().count(), 1, "{printed}");
    printed
}

#[test]
fn killed_subscribers_take_nothing_with_them() {
    let place = Place::new("kills");
    let publisher = publisher(&place, &["--rate", "100"]);
    let steady = observer(&place);
    steady.1.until("\"status\":{");
    let kills = if long() { 1000 } else { 20 };
    for kill in 0..kills {
        let victim = Process::start(place.program().args(["watch", "--json"]));
        // From a time before the process has opened anything to a time in full operation.
        wait(0.015 * f64::from(kill % 20));
        victim.signal(SIGKILL);
    }
    let late = Process::start(place.program().args(["watch", "--json", "--duration", "2"])).output();
    assert!(number(json_lines(&late).last().unwrap(), "received") > 0);
    publisher.signal(SIGINT);
    let summary = summary(&publisher.output());
    assert_nothing_lost(&observed(steady), &summary);
    // Files of a process killed halfway stay untouched for two seconds: the process could be alive and slow.
    wait(2.5);
    Process::start(place.program().args(["watch", "--duration", "3"])).output();
    // A file whose maker was killed before listing it remains unknown to every process. The slower the machine, the
    // more kills fall into that time.
    place.assert_clean_but_for(1 + kills as usize / 100);
}

#[test]
fn subscribers_survive_killed_publishers() {
    let place = Place::new("widows");
    let mut monitors = [1, 2].map(|_| Process::start(place.program().arg("watch")));
    let outputs = monitors.each_mut().map(Process::lines);
    let steady = observer(&place);
    let start = || publisher(&place, &["--rate", "100"]);
    let all_print = |what: &str| outputs.each_ref().map(|lines| lines.until(what));
    let rounds = if long() { 100 } else { 5 };
    let mut longest = Duration::ZERO;
    for _ in 0..rounds {
        let publisher = start();
        all_print("is running");
        all_print("missed 0");
        publisher.signal(SIGKILL);
        let killed = Instant::now();
        all_print("has ended");
        longest = longest.max(killed.elapsed());
    }
    println!("{rounds} deaths of a publisher, each noticed within {longest:?}");
    let last = start();
    all_print("is running");
    all_print("missed 0");
    last.signal(SIGINT);
    summary(&last.output());
    all_print("has ended");
    let seen = observed(steady);
    assert_nothing_wrong(&seen);
    assert_eq!(number(&seen, "runs"), rounds + 1, "{seen}");
    for (monitor, lines) in monitors.iter().zip(&outputs) {
        monitor.signal(SIGTERM);
        lines.rest();
    }
    // Two processes that clean up after the same dead node can leave its unlisted folder to the next start.
    wait(2.5);
    Process::start(place.program().args(["watch", "--duration", "1"])).output();
    place.assert_clean();
}

#[test]
fn files_of_dead_runs_are_gone_after_the_next() {
    let place = Place::new("dead");
    let mut first = Process::start(place.program().args(["run", "--rate", "100"]));
    observer(&place).1.until("\"status\":{");
    first.signal(SIGKILL);
    first.lines().rest();
    assert!(place.left_behind().len() > 5, "a killed publisher leaves files");
    for start in 0..20 {
        let killed = Process::start(place.program().args(["run", "--rate", "100"]));
        // From a time before the process has opened anything to the first frames.
        wait(0.01 * f64::from(start));
        killed.signal(SIGKILL);
    }
    // Files of a process killed halfway stay untouched for two seconds: the process could be alive and slow.
    wait(2.5);
    summary(&Process::start(place.program().args(["run", "--json", "--duration", "3"])).output());
    place.assert_clean();
}

/// Returns the library of this name, which changes a process's view of the machine.
fn preloaded(name: &str) -> PathBuf {
    let library = std::env::current_exe().unwrap().ancestors().nth(2).unwrap().join(format!("examples/lib{name}.so"));
    assert!(library.exists(), "cargo build --release --examples makes {}", library.display());
    library
}

#[test]
fn a_show_that_starts_on_a_slow_disk_is_found() {
    let place = Place::new("slow_disk");
    let mut slow = place.program();
    slow.args(["run", "--json", "--rate", "100", "--scene"]).arg(place.scene_publishing(LONG_QUEUE));
    let began = Instant::now();
    // Each process that looks for the publisher looks for stale files of killed processes when it starts.
    let publisher = Process::start(slow.env("LD_PRELOAD", preloaded("slow_disk")));
    let publisher = answering(publisher, || place.program());
    // A node's file and a service's file take longer than an unfinished file may exist: otherwise nothing was slow.
    assert!(began.elapsed() > Duration::from_secs(5), "the disk was not slowed down");
    let steady = observer(&place);
    steady.1.until("\"status\":{");
    publisher.signal(SIGINT);
    let summary = summary(&publisher.output());
    assert_nothing_lost(&observed(steady), &summary);
    place.assert_clean();
}

#[test]
fn a_stepped_wall_clock_moves_the_stamps_and_nothing_else() {
    let place = Place::new("clock");
    let library = preloaded("stepped_clock");
    let stepped = |arguments: &[&str]| Process::start(place.program().env("LD_PRELOAD", &library).args(arguments));
    let alert_every_second = ["--start", "405", "--time-scale", "0.01"];
    let scene = place.scene_publishing(LONG_QUEUE);
    let show = ["run", "--json", "--rate", "100", "--scene", scene.to_str().unwrap()];
    let publisher = stepped(&[&show[..], &alert_every_second].concat());
    let timed = stepped(&[&["--name", "timed"], &show[..], &["--duration", "7"]].concat());
    let mut monitor = stepped(&["watch", "--json"]);
    let watched = monitor.lines();
    let steady = observer(&place);
    steady.1.until("\"status\":{");
    // The steps reach the publisher: its stamps, which are from the wall clock, are an hour ahead and behind.
    let (mut lines, mut hours) = (Vec::new(), BTreeSet::new());
    while !hours.is_superset(&BTreeSet::from([-1, 1])) {
        let line: Value = serde_json::from_str(&watched.until("{")).unwrap();
        if let Some(stamp) = line["stamp_ns"].as_str() {
            let now = std::time::SystemTime::UNIX_EPOCH.elapsed().unwrap().as_secs() as i64;
            let seconds = (stamp.parse::<u64>().unwrap() / 1_000_000_000) as i64;
            hours.insert((seconds - now + 1800).div_euclid(3600));
        }
        lines.push(line);
    }
    publisher.signal(SIGINT);
    let stopped = summary(&publisher.output());
    assert_nothing_lost(&observed(steady), &stopped);
    // A counted hour would be 360,000 periods in one direction, and an endless run in the other.
    let ended = summary(&timed.output());
    assert_eq!(number(&ended, "frames") + number(&ended, "skipped"), 700, "{ended}");
    assert!(number(&ended, "frames") > 1 && number(&stopped, "skipped") < 180_000, "{ended} {stopped}");
    monitor.signal(SIGTERM);
    watched.rest();
    let latencies = lines.iter().filter_map(|line| line["latency_ns"]["max"].as_u64());
    assert!(latencies.max().is_some_and(|longest| longest < 3_000_000_000_000), "{lines:?}");
    place.assert_clean();
}

#[test]
fn a_stopped_publisher_skips_whole_periods_and_catches_nothing_up() {
    let place = Place::new("stopped");
    let publisher = publisher(&place, &["--rate", "100", "--duration", "15"]);
    let steady = observer(&place);
    steady.1.until("\"status\":{");
    publisher.stop();
    wait(5.0);
    publisher.signal(SIGCONT);
    let summary = summary(&publisher.output());
    assert_eq!(number(&summary, "frames") + number(&summary, "skipped"), 1500, "{summary}");
    // One incident of five seconds; the machine itself may add stalls, of at least a period each.
    let [skipped, overruns] = ["skipped", "overruns"].map(|key| number(&summary, key));
    assert!(skipped >= 498 && overruns >= 1 && overruns - 1 <= skipped - 498, "{summary}");
    assert!(number(&summary["wakeup_ns"], "max") > 4_900_000_000, "{summary}");
    let seen = observed(steady);
    assert_nothing_lost(&seen, &summary);
    // Coordinated omission: all of the wait is in the latency since the deadline, though no frame was in flight.
    let waited = number(&seen["total"]["since_deadline"], "max");
    assert!(waited > 4_900_000_000, "{seen}");
    assert!(number(&seen["total"]["since_deadline"], "p50") > number(&seen["total"]["since_sent"], "p50"), "{seen}");
    place.assert_clean();
}

#[test]
fn of_publishers_that_race_for_a_name_one_wins() {
    let place = Place::new("race");
    for round in 0..5 {
        if round == 3 {
            // From here on they also find the stale files of a dead publisher.
            let doomed = Process::start(place.program().args(["run", "--rate", "100"]));
            observer(&place).1.until("\"status\":{");
            doomed.signal(SIGKILL);
        }
        // Each prints a line when its services are open, or when it is refused.
        let mut racers = [(); 3].map(|()| Process::start(place.program().arg("run")));
        let lines = racers.each_mut().map(Process::error_lines);
        let said = lines.each_ref().map(|lines| lines.until(""));
        let has_won = |line: &String| line.starts_with("Scene");
        assert_eq!(said.iter().filter(|line| has_won(line)).count(), 1, "round {round}: {said:?}");
        for ((racer, lines), first) in racers.into_iter().zip(lines).zip(said) {
            if has_won(&first) {
                racer.signal(SIGINT);
                assert!(racer.output().status.success(), "round {round}: {:?}", lines.rest());
            } else {
                assert_eq!((racer.output().status.code(), lines.rest()), (Some(1), Vec::new()), "{first}");
                assert!(first.contains("another publisher") && first.contains("--name"), "{first}");
            }
        }
    }
    place.assert_clean();
}

#[test]
fn one_subscriber_too_many_is_told_the_limit_and_the_setting() {
    for (limit, stated) in [(8, ""), (2, "subscribers = 2")] {
        let place = Place::new("many");
        let scene = place.scene_publishing(&format!("{LONG_QUEUE}\n{stated}"));
        let publisher = Process::start(place.program().args(["run", "--json", "--scene"]).arg(scene));
        let mut admitted: Vec<_> = (0..limit).map(|_| observer(&place)).collect();
        for subscriber in &admitted {
            subscriber.1.until("\"status\":{");
        }
        let watch = || Process::start(place.program().args(["watch", "--json", "--duration", "2"])).output();
        let printed = refusal(&watch());
        assert!(
            printed.contains(&format!("{limit} subscribers")) && printed.contains("publish.subscribers"),
            "{printed}"
        );
        assert_nothing_wrong(&observed(admitted.pop().unwrap()));
        let next = watch();
        assert!(number(json_lines(&next).last().unwrap(), "received") > 0, "{}", text(&next.stderr));
        publisher.signal(SIGINT);
        let summary = summary(&publisher.output());
        for subscriber in admitted {
            assert_nothing_lost(&observed(subscriber), &summary);
        }
        place.assert_clean();
    }
}

/// Returns a shell in which /dev/shm is a separate small file system.
fn in_small_shared_memory(size: &str, script: &str) -> Command {
    let mut command = Command::new("unshare");
    command.args(if is_root() { vec!["--mount"] } else { vec!["--mount", "--map-root-user"] });
    command.args(["sh", "-c", &format!("mount -t tmpfs -o size={size} tmpfs /dev/shm && {script}")]);
    command
}

/// Requires the right to mount a /dev/shm of its own.
fn mounts() -> Result<(), String> {
    let output = in_small_shared_memory("1m", "true").output().map_err(|error| format!("no unshare ({error})"))?;
    let refused = || format!("no private mount may be made here: {}", text(&output.stderr).trim());
    if output.status.success() { Ok(()) } else { Err(refused()) }
}

/// Runs a script to its end in such a shell, with `$PROGRAM` for the program.
fn with_shared_memory(place: &Place, size: &str, script: &str) -> Output {
    let mut command = in_small_shared_memory(size, script);
    command.current_dir(place.folder()).env("PROGRAM", env!("CARGO_BIN_EXE_bench-dragon"));
    Process::start(&mut command).output()
}

#[test]
fn too_little_shared_memory_is_refused_with_figures() {
    if !can_run(mounts()) {
        return;
    }
    let place = Place::new("small");
    for size in ["100k", "1m", "6m"] {
        let printed = refusal(&with_shared_memory(&place, size, "exec \"$PROGRAM\" run --json --duration 1"));
        for part in ["/dev/shm", "7347712 bytes", "publish.queue", "publish.subscribers"] {
            assert!(printed.contains(part), "{printed}");
        }
    }
    let script = "dd if=/dev/zero of=/dev/shm/filler bs=4k 2>/dev/null; exec \"$PROGRAM\" watch --duration 1";
    let printed = refusal(&with_shared_memory(&place, "1m", script));
    assert!(printed.contains("/dev/shm") && printed.contains("too little"), "{printed}");
}

#[test]
fn shared_memory_that_others_fill_does_not_stop_a_publisher() {
    if !can_run(mounts()) {
        return;
    }
    let place = Place::new("filled");
    place.scene_publishing(&format!("subscribers = 3\n{LONG_QUEUE}"));
    // A subscriber is stopped until its queue is full of frames, so that most pages of the pool are written. The other
    // one prints a line a second.
    let output = with_shared_memory(
        &place,
        "24m",
        "further() { lines=$(($(grep -c 'status\":{' $1) + $2))
            until [ $(grep -c 'status\":{' $1) -ge $lines ] || ! kill -0 $publisher $3; do sleep 0.1; done; }
          (\"$PROGRAM\" run --scene scene.toml --json --rate 100 & publisher=$!
          \"$PROGRAM\" soak-subscriber --slow >slow & slow=$!
          \"$PROGRAM\" soak-subscriber >steady & steady=$!
          further steady 1 $steady; further slow 1 $slow; kill -STOP $slow; further steady 6 $steady; kill -CONT $slow
          dd if=/dev/zero of=/dev/shm/filler bs=4k 2>/dev/null
          \"$PROGRAM\" watch --duration 1 2>&1 | grep -q 'too little' || echo no refusal
          further steady 3 $steady; kill $publisher; wait $publisher || echo publisher failed
          kill $slow $steady; wait $slow || echo slow failed; wait $steady || echo steady failed; tail -n 1 steady)",
    );
    let lines = json_lines(&output);
    assert_eq!(lines.len(), 2, "{lines:?} {}", text(&output.stderr));
    assert!(number(&lines[0], "frames") > 500, "{}", lines[0]);
    assert_nothing_lost(&lines[1], &lines[0]);
}

/// Returns true if a process has a handler for a signal.
fn catches(process: &Process, signal: Signal) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).unwrap();
    // proc(5): a mask in hexadecimal; the first signal is its lowest bit.
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap().trim();
    u64::from_str_radix(caught, 16).unwrap() >> (signal as u32 - 1) & 1 == 1
}

#[test]
fn a_page_that_cannot_be_had_is_a_sentence() {
    let place = Place::new("page");
    let monitor = Process::start(place.program().arg("watch").arg("--json"));
    let deadline = Instant::now() + harness::patience();
    // The process catches SIGTERM after it has installed its handler for page errors; Rust itself catches SIGBUS from
    // the beginning.
    while !catches(&monitor, SIGTERM) {
        assert!(Instant::now() < deadline, "no start");
        wait(0.05);
    }
    // The signal that Linux sends if a page of a full /dev/shm is written.
    monitor.signal(SIGBUS);
    assert!(refusal(&monitor.output()).contains("/dev/shm is full"));
}

#[test]
fn without_ros2_there_is_no_network_socket() {
    let place = Place::new("sockets");
    let publisher = Process::start(place.program().args(["run", "--json"]));
    let steady = observer(&place);
    steady.1.until("\"status\":{");
    let protocols = ["tcp", "tcp6", "udp", "udp6", "raw", "raw6", "udplite", "udplite6", "packet"];
    let tables = protocols.iter().filter_map(|protocol| std::fs::read_to_string(format!("/proc/net/{protocol}")).ok());
    let tables: Vec<String> = tables.collect();
    assert!(tables.len() >= 4, "the tables of network sockets cannot be read");
    let network: BTreeSet<&str> = tables.iter().flat_map(|table| table.split_whitespace()).collect();
    let mut sockets = 0;
    for process in [&publisher, &steady.0] {
        for descriptor in std::fs::read_dir(format!("/proc/{}/fd", process.id())).unwrap().flatten() {
            let target = std::fs::read_link(descriptor.path()).unwrap_or_default();
            let target = target.to_string_lossy();
            if let Some(inode) = target.strip_prefix("socket:[").and_then(|rest| rest.strip_suffix(']')) {
                sockets += 1;
                assert!(!network.contains(inode), "{} has a network socket", process.id());
            }
        }
    }
    assert!(sockets > 0, "both wake each other through local sockets, so the tables list some");
}

/// Another user reads nothing, unless the program was built to admit all users.
#[test]
fn another_user_is_kept_out_or_let_in_as_the_build_allows() {
    if !can_run(root("become another user")) {
        return;
    }
    let place = Place::new("users");
    let publisher = Process::start(place.program().args(["run", "--json", "--rate", "100"]));
    observer(&place).1.until("\"status\":{");
    let shared = std::fs::read_dir("/dev/shm").unwrap().flatten();
    let modes: BTreeSet<_> = shared
        .filter(|file| {
            file.file_name().to_string_lossy().contains("users")
                && file.path().extension().is_some_and(|kind| kind == "data")
        })
        .map(|file| file.metadata().unwrap().mode() & 0o777)
        .collect();
    let output = place.as_other_user(&["watch", "--json", "--duration", "2"]);
    if cfg!(feature = "any_user") {
        assert_eq!(modes, BTreeSet::from([0o666]));
        let lines = json_lines(&output);
        assert!(number(lines.last().unwrap(), "received") > 0, "{lines:?} {}", text(&output.stderr));
    } else {
        assert_eq!(modes, BTreeSet::from([0o600]));
        let printed = refusal(&output);
        assert!(printed.contains("another user"), "{printed}");
    }
    publisher.signal(SIGINT);
    summary(&publisher.output());
}
