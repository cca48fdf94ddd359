//! A running show whose files another program removes, as a cleaner by age or at the end of a login does.

use crate::harness;

use harness::{Place, Process, answering, http_get, json_lines, summary, text, wait_until};
use nix::sys::signal::Signal::{SIGINT, SIGTERM};

const SENTENCE: &str =
    "of the show's files were removed by another program: no other process can connect until it is restarted";

#[test]
fn a_show_goes_on_without_its_files_says_so_and_keeps_its_name() {
    let place = Place::new("lost_files");
    let scene = place.scene_publishing("queue = 500");
    let run = |arguments: &[&str]| {
        let mut command = place.program();
        command.args(["run", "--json", "--rate", "50", "--scene"]).arg(&scene).args(arguments);
        Process::start(&mut command)
    };
    let mut show = answering(run(&["--loop"]), || place.program());
    let said = show.error_lines();
    let mut json = Process::start(place.program().args(["watch", "--json"]));
    let seconds = json.lines();
    let mut monitor = Process::start(place.program().arg("watch"));
    let monitored = monitor.lines();
    let mut metrics = Process::start(place.program().args(["metrics", "--listen", "127.0.0.1:0", "--json"]));
    let url = metrics.first_line();
    let url = serde_json::from_str::<serde_json::Value>(&url).unwrap()["url"].as_str().unwrap().to_owned();
    seconds.until("\"state\":\"moving\"");
    monitored.until("lateness");
    let lost = |body: &str| {
        let sample = body.lines().find(|line| line.starts_with("bench_dragon_lost_files{"));
        sample.map(|line| line.rsplit_once(' ').unwrap().1.parse::<f64>().unwrap())
    };
    wait_until("no file is missed at first", || lost(&http_get(&url, "*/*")) == Some(0.0));

    for file in place.left_behind() {
        let _ = std::fs::remove_file(file);
    }
    let removed = std::time::Instant::now();
    let line = said.until("ERROR");
    assert!(line.contains(SENTENCE), "{line}");
    // The documented five seconds, with patience for a busy machine.
    assert!(removed.elapsed() < std::time::Duration::from_secs(60));
    let second: serde_json::Value = serde_json::from_str(&seconds.until("\"lost_files\":")).unwrap();
    assert!(second["lost_files"].as_u64() > Some(10) && second["missed"] == 0, "{second}");
    assert!(monitored.until("removed by another program").contains(SENTENCE));
    wait_until("Prometheus reads it", || lost(&http_get(&url, "*/*")) > Some(10.0));
    // Connected processes continue.
    let received = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap()["received"].as_u64().unwrap();
    let before = received(&seconds.until("\"second\""));
    assert!(received(&seconds.until("\"second\"")) > before);

    // The name stays the show's.
    let refused = run(&["--duration", "1"]).output();
    let sentence = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{sentence}");
    assert!(sentence.contains("another publisher is running under the name \"bench_dragon\""), "{sentence}");

    show.signal(SIGINT);
    let ended = show.output();
    assert!(ended.status.success());
    assert_eq!(json_lines(&ended).last().unwrap()["end"], "signal");
    [&json, &monitor, &metrics].iter().for_each(|process| process.signal(SIGTERM));
    seconds.rest();
    monitored.rest();
    assert!(metrics.output().status.success());
    // The next show has its files.
    let next = run(&["--duration", "1"]).output();
    assert_eq!(summary(&next)["end"], "duration", "{}", text(&next.stderr));
}
