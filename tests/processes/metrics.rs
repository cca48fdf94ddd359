//! The figures for Prometheus, as its own `promtool` and Python's OpenMetrics parser read them: correct for a publisher
//! that plays, pauses and dies.

use crate::harness;

use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::time::Duration;

use bench_dragon::client::connection::Wake;
use bench_dragon::client::feed::{Delivery, Feed, FeedEvent, FeedOptions};
use bench_dragon::messages::LoopStatus;
use harness::{
    Process, can_run, http_get, http_get_as, program, python, python_modules, scene_file, summary, text, unique, wait,
};
use nix::sys::signal::Signal;
use serde_json::Value;

const OPENMETRICS: &str = "application/openmetrics-text;version=1.0.0,text/plain;version=0.0.4;q=0.5,*/*;q=0.1";

/// Returns Prometheus' own checker, from the Debian package `prometheus`. If it is not installed, `tests/run` unpacks
/// it beside the Python peers.
fn promtool() -> Result<PathBuf, String> {
    let beside = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/.venv/prometheus/usr/bin/promtool"));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let mut places = std::env::split_paths(&path).map(|folder| folder.join("promtool")).chain([beside]);
    places.find(|place| place.exists()).ok_or_else(|| "no promtool; tests/run fetches it".to_owned())
}

/// Returns the output of a program for some input.
fn given(command: &mut Command, input: &str) -> String {
    let command = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut process = command.spawn().unwrap();
    process.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = process.wait_with_output().unwrap();
    assert!(output.status.success(), "{}{}of {input}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout) + &text(&output.stderr)
}

/// Returns the samples of an answer, by their names and labels.
fn samples(answer: &str) -> Value {
    let (head, body) = answer.split_once("\r\n\r\n").expect("an answer");
    assert!(head.to_lowercase().contains("content-type: application/openmetrics-text; version=1.0.0; charset=utf-8"));
    serde_json::from_str(&given(python().arg("tests/python/openmetrics_text.py"), body)).unwrap()
}

/// Requests the samples again until they satisfy a condition.
fn until(url: &str, what: &str, holds: impl Fn(&Value) -> bool) -> Value {
    let mut latest = Value::Null;
    for _ in 0..harness::patience().as_secs() * 5 {
        latest = samples(&http_get(url, OPENMETRICS));
        if holds(&latest) {
            return latest;
        }
        wait(0.2);
    }
    panic!("not {what}: {latest:#}");
}

/// Returns every status that a publisher sends, until the receiver is dropped.
fn statuses_of(name: &str) -> Receiver<LoopStatus> {
    let (sender, receiver) = mpsc::channel();
    let name = unique(name);
    std::thread::spawn(move || {
        let mut feed = Feed::new(&name, FeedOptions { wake: Wake::Never, frames: Delivery::Newest }).unwrap();
        let mut received = true;
        while received {
            let mut take = |event: FeedEvent<'_>| {
                if let FeedEvent::Status(status) = event {
                    received = sender.send(*status).is_ok();
                }
            };
            feed.poll(Duration::from_millis(20), &mut take).unwrap();
        }
    });
    receiver
}

#[test]
fn prometheus_reads_what_is_true_of_a_publisher() {
    if !can_run(promtool().map(drop)) || !can_run(python_modules(&["prometheus_client"])) {
        return;
    }
    let name = "metrics";
    let mut metrics = Process::start(program(name).args(["metrics", "--json", "--listen", "127.0.0.1:0"]));
    let ready: Value = serde_json::from_str(&metrics.first_line()).unwrap();
    let url = ready["url"].as_str().unwrap();
    let waiting = samples(&http_get(url, OPENMETRICS));
    assert_eq!((&waiting["bench_dragon_up"], waiting.as_object().unwrap().len()), (&0.0.into(), 4), "{waiting}");

    let scene = scene_file(name, &[("accuracy = 1e-9", "solver = \"newton\"")]);
    let mut run = program(name);
    run.arg("--scene").arg(scene).args(["run", "--json", "--rate", "50", "--start", "405", "--time-scale", "0.01"]);
    let publisher = Process::start(&mut run);
    let statuses = statuses_of(name);
    let playing = until(url, "playing", |samples| {
        samples["bench_dragon_frames_published_total"].as_f64() > Some(100.0)
            && samples["bench_dragon_alert_level"] == 1.0
            && samples["bench_dragon_subscribers"] == 2.0
    });
    let value = |name: &str| playing[name].as_f64().unwrap_or_else(|| panic!("no {name} in {playing:#}"));
    assert_eq!((value("bench_dragon_up"), value("bench_dragon_silent")), (1.0, 0.0));
    assert_eq!((value("bench_dragon_requested_rate_hertz"), value("bench_dragon_time_scale")), (50.0, 0.01));
    assert_eq!((value("bench_dragon_state,state=approaching"), value("bench_dragon_state,state=contact")), (1.0, 0.0));
    assert_eq!((value("bench_dragon_playback,state=playing"), value("bench_dragon_playback,state=paused")), (1.0, 0.0));
    let (time, clearance) = (value("bench_dragon_simulated_time_seconds"), value("bench_dragon_clearance_meters"));
    assert!((405.0..412.47).contains(&time) && clearance > 0.0 && clearance < 1.0, "{time} s, {clearance} m");
    // The values that another subscriber received for the same time.
    let frames = value("bench_dragon_frames_published_total");
    let told = loop {
        let status = statuses.recv_timeout(harness::patience()).unwrap();
        if status.sequence as f64 + 1.0 >= frames {
            break status;
        }
    };
    assert_eq!(told.sequence as f64 + 1.0, frames, "{told:?}");
    assert_eq!(value("bench_dragon_periods_skipped_total"), told.skipped as f64);
    assert_eq!(value("bench_dragon_measured_rate_hertz"), told.measured_rate);
    for (family, window, quantile, ns) in [
        ("wakeup_lateness", "second", "0.5", told.lateness_p50_second),
        ("wakeup_lateness", "second", "0.99", told.lateness_p99_second),
        ("wakeup_lateness", "second", "1", told.lateness_max_second),
        ("wakeup_lateness", "run", "0.5", told.lateness_p50_total),
        ("wakeup_lateness", "run", "0.99", told.lateness_p99_total),
        ("wakeup_lateness", "run", "0.999", told.lateness_p999_total),
        ("wakeup_lateness", "run", "1", told.lateness_max_total),
        ("step", "second", "0.5", told.step_p50_second),
        ("step", "second", "0.99", told.step_p99_second),
        ("step", "second", "1", told.step_max_second),
        ("step", "run", "0.5", told.step_p50_total),
        ("step", "run", "0.99", told.step_p99_total),
        ("step", "run", "0.999", told.step_p999_total),
        ("step", "run", "1", told.step_max_total),
    ] {
        let seconds = value(&format!("bench_dragon_{family}_seconds,quantile={quantile},window={window}"));
        assert!((seconds * 1e9 - ns as f64).abs() < 0.5, "{family} {quantile} of the {window}: {seconds} s, {ns} ns");
    }
    for family in ["bench_dragon_wakeup_lateness_seconds", "bench_dragon_step_seconds"] {
        let at = |window, quantile| value(&format!("{family},quantile={quantile},window={window}"));
        assert!(at("second", "0.5") <= at("second", "0.99") && at("second", "0.99") <= at("second", "1"));
        let run = [at("run", "0.5"), at("run", "0.99"), at("run", "0.999"), at("run", "1")];
        assert!(run.is_sorted() && run[3] >= at("second", "1") && run[0] > 0.0 && run[3] < 60.0, "{family}: {run:?}");
    }
    // The values that the system reports for that process.
    let statm = std::fs::read_to_string(format!("/proc/{}/statm", publisher.id())).unwrap();
    let resident = statm.split(' ').nth(1).unwrap().parse::<f64>().unwrap() * 4096.0;
    let ratio = value("bench_dragon_resident_memory_bytes") / resident;
    assert!((0.5..2.0).contains(&ratio), "{ratio}");
    let info =
        playing.as_object().unwrap().keys().find(|key| key.starts_with("bench_dragon_run_info,run_id=")).unwrap();
    assert!(info.ends_with(",scene=paper"), "{info}");

    // The other format, which promtool reads.
    let plain = http_get(url, "*/*");
    let (head, body) = plain.split_once("\r\n\r\n").unwrap();
    assert!(head.to_lowercase().contains("content-type: text/plain; version=0.0.4; charset=utf-8"), "{head}");
    assert_eq!(given(Command::new(promtool().unwrap()).args(["check", "metrics"]), body), "");

    let control = |command: &str| {
        let output = Process::start(program(name).args(["control", command])).output();
        assert!(output.status.success(), "{}", text(&output.stderr));
    };
    control("pause");
    until(url, "paused", |samples| {
        samples["bench_dragon_playback,state=paused"] == 1.0 && samples["bench_dragon_time_scale"] == 0.0
    });
    publisher.stop();
    until(url, "silent", |samples| samples["bench_dragon_silent"] == 1.0 && samples["bench_dragon_up"] == 1.0);
    publisher.signal(Signal::SIGCONT);
    publisher.signal(Signal::SIGTERM);
    summary(&publisher.output());
    let down = until(url, "down", |samples| samples["bench_dragon_up"] == 0.0);
    assert_eq!(down.as_object().unwrap().len(), 4, "a publisher that is gone has no other samples: {down}");
    assert!(down["bench_dragon_metrics_frames_received_total"].as_f64() > Some(100.0));
    metrics.signal(Signal::SIGTERM);
    assert!(metrics.output().status.success());
}

#[test]
fn an_address_in_use_is_a_sentence() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let output = Process::start(program("metrics_taken").args(["metrics", "--listen", &address])).output();
    assert_eq!(output.status.code(), Some(1));
    let printed = text(&output.stderr);
    assert!(printed.contains(&address) && printed.contains("--listen") && printed.lines().count() == 1, "{printed}");
    assert!(output.stdout.is_empty());
}

#[test]
fn a_foreign_name_for_this_machine_is_answered_nothing() {
    let mut server = Process::start(program("host").args(["metrics", "--json", "--listen", "127.0.0.1:0"]));
    let ready: Value = serde_json::from_str(&server.first_line()).unwrap();
    let url = ready["url"].as_str().unwrap();
    for host in ["evil.example", "evil.example:9464", "127.0.0.1.evil.example"] {
        let answer = http_get_as(url, host, "*/*");
        assert!(answer.starts_with("HTTP/1.1 403") && !answer.contains("bench_dragon_up"), "{host}: {answer}");
    }
    for host in ["localhost:9464", "127.0.0.1", "[::1]:9464"] {
        assert!(http_get_as(url, host, "*/*").contains("bench_dragon_up{"), "{host}");
    }
}

/// The dashboard requests only figures that are served, in the scene of the documents.
#[test]
fn the_dashboard_shows_what_is_served() {
    let dashboard: Value = serde_json::from_str(include_str!("../../docs/grafana/bench-dragon.json")).unwrap();
    let families = include_str!("../../crates/outputs/src/metrics/families.rs");
    let mut expressions = 0;
    for panel in dashboard["panels"].as_array().unwrap() {
        for target in panel["targets"].as_array().into_iter().flatten() {
            let expression = target["expr"].as_str().unwrap();
            let names = expression.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
            for name in names.filter(|name| name.starts_with("bench_dragon_")) {
                let family = name.trim_end_matches("_total").trim_end_matches("_info");
                assert!(families.contains(&format!("\"{family}\"")), "{name}");
                expressions += 1;
            }
        }
    }
    assert!(expressions >= 10, "{expressions}");
}
