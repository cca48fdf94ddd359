//! Several dragons at once: two publishers under different names, one page, one lighting desk, one page of metrics.
//! `tests/python/several_page.py` tests the browser; `tests/python/psn_peer.py` tests the desk. No test asserts a
//! speed.

use crate::{harness, run_scenario};

use std::net::UdpSocket;
use std::time::Instant;

use harness::{Process, can_run, http_get, program, python, python_modules, scene_file, summary, text, unique, wait};
use nix::sys::signal::Signal;
use serde_json::{Value, json};
use tungstenite::Message;

/// A solver with which the publisher starts at once, even if the program is not optimised.
const NEWTON: (&str, &str) = ("accuracy = 1e-9", "solver = \"newton\"");
fn publisher(name: &str, arguments: &[&str]) -> Process {
    let scene = scene_file(name, &[NEWTON]);
    let mut run = program(name);
    Process::start(run.arg("--scene").arg(scene).args(["run", "--json", "--duration", "600"]).args(arguments))
}

/// Returns the program with several names.
fn of_several(names: &[&str]) -> std::process::Command {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    command.args(names.iter().flat_map(|name| ["--name".to_owned(), unique(name)]));
    command
}

#[test]
fn a_command_of_one_publisher_refuses_a_second_name() {
    let refused = |arguments: &[&str]| {
        let output = Process::start(of_several(&["one"]).args(arguments)).output();
        let printed = text(&output.stderr);
        assert_eq!((output.status.code(), printed.lines().count()), (Some(2), 1), "{arguments:?}: {printed}");
        printed
    };
    for command in ["run", "watch", "control", "record", "soak", "check"] {
        let further: &[&str] = match command {
            "control" => &["state"],
            "record" => &["-o", "never.mcap"],
            _ => &[],
        };
        let printed = refused(&[&["--name", "two", command], further].concat());
        assert!(printed.contains("--name is given 2 times") && printed.contains("view, send and metrics"), "{printed}");
        // A name before the command and a name after it are also two names.
        let printed = refused(&[&[command], further, &["--name", "two"]].concat());
        assert!(printed.contains("--name is given 2 times"), "{printed}");
    }
    let same = unique("one");
    assert!(refused(&["--name", &same, "view"]).contains("is given twice"));
    assert!(refused(&["view", "--name", "two"]).contains("before and after the command"));
    let desks = ["--to", "127.0.0.1:9"];
    let printed = refused(&[&["--name", "two", "send", "psn", "--first-id", "65000"], &desks[..]].concat());
    assert!(printed.contains("--id-step 1000"), "{printed}");
    let alike = same.replace('_', "#");
    assert!(
        refused(&[&["--name", &alike, "--name", &same.replace('_', "*"), "send", "osc"], &desks[..]].concat())
            .contains("OSC address")
    );
}

/// Returns the stage of a publisher over a server's WebSocket, and the run of its next frame.
fn stage_and_run(address: &str, query: &str) -> (Value, String) {
    let (mut socket, _) = tungstenite::connect(format!("ws://{address}/frames{query}")).unwrap();
    let mut stage = Value::Null;
    loop {
        match socket.read().unwrap() {
            Message::Text(json) => {
                let message: Value = serde_json::from_str(&json).unwrap();
                stage = if message["type"] == "stage" { message } else { stage };
            }
            Message::Binary(frame) if !stage.is_null() => {
                return (stage, u64::from_le_bytes(frame[32..40].try_into().unwrap()).to_string());
            }
            _ => (),
        }
    }
}

#[test]
fn a_program_reads_each_dragon_by_its_name() {
    let names = ["socket_a", "socket_b"];
    let _publishers = names.map(|name| publisher(name, &["--start", "100"]));
    let mut server = Process::start(of_several(&names).args(["view", "--json", "--port", "0"]));
    let ready: Value = serde_json::from_str(&server.first_line()).unwrap();
    let address = ready["url"].as_str().unwrap().trim_start_matches("http://").trim_end_matches('/').to_owned();
    let seen = names.map(|name| stage_and_run(&address, &format!("?rate=10&name={}", unique(name))));
    for (name, (stage, run)) in names.iter().zip(&seen) {
        assert_eq!((&stage["publisher"], &stage["run_id"]), (&json!(unique(name)), &json!(run)));
    }
    assert_ne!(seen[0].1, seen[1].1);
    let (first, _) = stage_and_run(&address, "");
    assert_eq!(first["publisher"], json!(unique(names[0])), "without a name, the first");
    let Err(tungstenite::Error::Http(response)) = tungstenite::connect(format!("ws://{address}/frames?name=other"))
    else {
        panic!("a name that is not served");
    };
    assert_eq!(response.status(), 404);
    let module = http_get(&format!("{}publishers.js", ready["url"].as_str().unwrap()), "*/*");
    assert!(module.ends_with(&format!("export const publishers = {};\n", json!(names.map(unique)))), "{module}");
}

fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// The second dragon starts late, ends and starts again; the first ends before the sender does. The desk receives every
/// tracker of every frame of both, under numbers that never change. Each step waits for messages at the desk, however
/// long that takes.
#[test]
fn one_desk_hears_two_dragons_under_numbers_that_stay() {
    if !can_run(python_modules(&["iceoryx2", "numpy", "pypsn"])) {
        return;
    }
    let names = ["desk_a", "desk_b"];
    let first = publisher(names[0], &["--start", "250", "--rate", "50"]);
    let port = free_port().to_string();
    let mut peer = python();
    peer.args(["tests/python/psn_peer.py", "--progress", "--port", &port, "--first-id", "11", "--id-step", "300"]);
    let mut peer = Process::start(peer.args(names.iter().flat_map(|name| ["--name".to_owned(), unique(name)])));
    let lines = peer.lines();
    lines.until("listening");
    let mut send = of_several(&names);
    send.args(["send", "psn", "--to", &format!("127.0.0.1:{port}"), "--interface", "127.0.0.1"]);
    let mut sender = Process::start(send.args(["--first-id", "11", "--id-step", "300"]));
    let said = sender.lines();
    let team = |name: &str, first: u32| {
        let line = said.until("of 224 handles");
        let (name, last) = (unique(name), first + 223);
        assert!(line.contains(&format!("({first} = {name} head to {last} = {name} tail)")), "{line}");
    };
    let ended = |process: Process| {
        process.signal(Signal::SIGTERM);
        summary(&process.output());
    };
    // Waits until the dragon at this place has stopped `stopped` times, and has then been received in `equal` frames.
    let hears = |place: usize, stopped: u64, equal: u64| {
        let deadline = Instant::now() + harness::patience();
        loop {
            let heard: Value = serde_json::from_str(&lines.until("\"progress\"")).unwrap();
            let [times, frames] = ["stopped", "equal"].map(|what| heard[what][place].as_u64().unwrap());
            if times == stopped && frames >= equal {
                return;
            }
            assert!(Instant::now() < deadline, "{}: {heard}, not {stopped} and {equal}", names[place]);
        }
    };
    team(names[0], 11);
    hears(0, 0, 50);
    let second = publisher(names[1], &["--start", "100", "--rate", "60"]);
    team(names[1], 311);
    hears(1, 0, 60);
    ended(second);
    let stopped = |name: &str| said.until(&format!("No frames come from \"{}\"", unique(name)));
    stopped(names[1]);
    // A publisher that is back before the sender's next message does not stop for the desk.
    hears(1, 1, 0);
    let second = publisher(names[1], &["--start", "300", "--rate", "60"]);
    said.until(&format!("Frames come from \"{}\" again", unique(names[1])));
    hears(1, 1, 60);
    hears(0, 0, 150);
    ended(first);
    stopped(names[0]);
    hears(0, 1, 0);
    sender.signal(Signal::SIGTERM);
    said.rest();
    ended(second);
    UdpSocket::bind("127.0.0.1:0").unwrap().send_to(&[], format!("127.0.0.1:{port}")).unwrap();
    let last = lines.rest().pop();
    let output = peer.output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let heard: Value = serde_json::from_str(&last.unwrap()).unwrap();
    println!("{} frames: {}", heard["frames"], heard["publishers"]);
    let [a, b] = [&heard["publishers"][0], &heard["publishers"][1]];
    assert_eq!(a["changes"], json!(["moving", "stopped"]), "{a}");
    assert_eq!(b["changes"], json!(["absent", "moving", "stopped", "moving", "stopped"]), "{b}");
    for (dragon, least) in [(a, 100), (b, 50)] {
        assert!(dragon["equal"].as_u64().unwrap() > least, "{dragon}");
        // Frames sent before the peer had opened the publisher's memory.
        assert!(dragon["unknown"].as_u64().unwrap() * 4 < dragon["equal"].as_u64().unwrap(), "{dragon}");
    }
    assert_eq!(heard["names"].as_object().unwrap().len(), 448);
    assert_eq!(heard["names"]["311"], json!(format!("{} head", unique(names[1]))));
    assert_eq!(heard["systems"], json!(["bench-dragon"]), "one desk lists one sender");
    assert!(heard["largest"].as_u64().unwrap() <= 1472);
}

#[test]
fn metrics_and_osc_tell_two_dragons_apart() {
    let names = ["figures_a", "figures_b"];
    let publishers = names.map(|name| publisher(name, &["--start", "100"]));
    let mut metrics = Process::start(of_several(&names).args(["metrics", "--json", "--listen", "127.0.0.1:0"]));
    let ready: Value = serde_json::from_str(&metrics.first_line()).unwrap();
    let desk = UdpSocket::bind("127.0.0.1:0").unwrap();
    desk.set_read_timeout(Some(harness::patience())).unwrap();
    let to = desk.local_addr().unwrap().to_string();
    let _osc = Process::start(of_several(&names).args(["send", "osc", "--to", &to]));
    for name in names {
        let address = format!("/{}/head", unique(name));
        let mut packet = [0; 2000];
        let hears = |_| {
            let length = desk.recv(&mut packet).unwrap();
            text(&packet[..length]).contains(&address)
        };
        assert!((0..1000).any(hears), "no {address}");
    }
    let up = |answer: &str, name: &str, value: u8| {
        answer.lines().any(|line| line == format!("bench_dragon_up{{name=\"{}\"}} {value}", unique(name)))
    };
    let until = |expected: [u8; 2]| {
        let answers = (0..harness::patience().as_secs() * 10).map(|_| {
            wait(0.1);
            http_get(ready["url"].as_str().unwrap(), "*/*")
        });
        let mut right =
            answers.filter(|answer| names.iter().zip(expected).all(|(name, value)| up(answer, name, value)));
        right.next().expect("the figures of both")
    };
    let answer = until([1, 1]);
    assert_eq!(answer.matches("# TYPE bench_dragon_up ").count(), 1, "each family stands once: {answer}");
    publishers[1].signal(Signal::SIGKILL);
    until([1, 0]);
}

fn in_a_browser(scenario: &str) {
    run_scenario("several_page.py", scenario, &[]);
}

#[test]
fn two_on_one_stage() {
    in_a_browser("two_on_one_stage");
}

#[test]
#[ignore = "tests/run --all"]
fn one_dies_alone() {
    in_a_browser("one_dies_alone");
}

#[test]
#[ignore = "tests/run --all"]
fn bar_conducts_one_or_all() {
    in_a_browser("bar_conducts_one_or_all");
}
