//! Control over the stage picture's WebSocket: authorization, answers, and that no message sent there stops the
//! picture. The user can admit pages of other origins.
//!
//! The publisher and the server are separate processes; `control` reads the state of the publisher.
//! `tests/python/conduct_page.py` tests the page's transport bar in Debian's Chromium. No test asserts a speed.

use crate::{harness, run_scenario};

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::Instant;

use harness::{Process, answering, json_lines, program, scene_file, text};
use nix::sys::signal::Signal;
use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{ClientRequestBuilder, Message, WebSocket};

type Socket = WebSocket<MaybeTlsStream<TcpStream>>;

/// Returns a scene with two cues whose publisher starts at once, even if the program is not optimised.
fn cued_scene(name: &str) -> PathBuf {
    let scene = scene_file(name, &[("accuracy = 1e-9", "solver = \"newton\"")]);
    let cues = "[[cues]]\nname = \"lamps\"\nat = 150.0\n[[cues]]\nname = \"coil\"\nat = 300.0\nthen = \"pause\"\n";
    std::fs::write(&scene, format!("{}\n{cues}", std::fs::read_to_string(&scene).unwrap())).unwrap();
    scene
}

fn publisher(name: &str, arguments: &[&str]) -> Process {
    let scene = cued_scene(name);
    let mut command = program(name);
    command.args(["--scene", scene.to_str().unwrap(), "run", "--quiet", "--json", "--rate", "50"]);
    answering(Process::start(command.args(arguments)), || program(name))
}

/// Returns the state of the show; `None` if no publisher runs.
fn state(name: &str) -> Option<Value> {
    json_lines(&program(name).args(["--json", "control", "state"]).output().unwrap()).pop()
}

/// Returns a server on a free port, and the line that it printed.
fn server(name: &str, arguments: &[&str]) -> (Process, Value) {
    let mut server = Process::start(program(name).args(["view", "--json", "--port", "0"]).args(arguments));
    let ready = serde_json::from_str(&server.first_line()).unwrap();
    (server, ready)
}

/// Returns the address to which a program of this machine connects.
fn address(ready: &Value) -> String {
    let url = ready["url"].as_str().unwrap();
    format!("127.0.0.1:{}", url.trim_end_matches('/').rsplit(':').next().unwrap())
}

fn connect(address: &str, origin: Option<&str>) -> Result<Socket, u16> {
    let request = ClientRequestBuilder::new(format!("ws://{address}/frames?rate=10").parse().unwrap());
    let request = origin.into_iter().fold(request, |request, origin| request.with_header("Origin", origin));
    match tungstenite::connect(request) {
        Ok((socket, _)) => {
            let MaybeTlsStream::Plain(stream) = socket.get_ref() else { panic!("no TLS here") };
            stream.set_read_timeout(Some(harness::patience())).unwrap();
            Ok(socket)
        }
        Err(tungstenite::Error::Http(response)) => Err(response.status().as_u16()),
        Err(error) => panic!("{error}"),
    }
}

/// Returns the next message of a type.
fn message(socket: &mut Socket, of: &str) -> Value {
    // Frames keep coming even if the message does not.
    let deadline = Instant::now() + harness::patience();
    loop {
        assert!(Instant::now() < deadline, "no message {of}");
        if let Message::Text(json) = socket.read().unwrap() {
            let message: Value = serde_json::from_str(&json).unwrap();
            if message["type"] == of {
                return message;
            }
        }
    }
}

fn ask(socket: &mut Socket, text: &str) -> Value {
    socket.send(Message::text(text)).unwrap();
    message(socket, "answer")
}

#[test]
fn a_program_conducts_over_the_socket_and_sees_the_time_line() {
    let name = "socket";
    let _publisher = publisher(name, &["--start", "100"]);
    let (_server, ready) = server(name, &["--control"]);
    let mut socket = connect(&address(&ready), None).unwrap();
    assert_eq!(message(&mut socket, "control"), json!({"type": "control", "allowed": true, "reason": null}));
    let stage = message(&mut socket, "stage");
    assert!((stage["freeze_time"].as_f64().unwrap() - 412.473837682115).abs() < 1e-9);
    let events: Vec<_> = stage["events"].as_array().unwrap().iter().map(|event| event["event"].clone()).collect();
    assert_eq!(events, ["contact", "stall", "lock"]);
    let truth = [412.473837682115, 432.758134083656, 432.917924228383];
    for (event, time) in stage["events"].as_array().unwrap().iter().zip(truth) {
        assert!((event["time"].as_f64().unwrap() - time).abs() < 1e-9, "{event}");
    }
    let cues = json!([{"number": 1, "name": "lamps", "time": 150.0, "pauses": false},
        {"number": 2, "name": "coil", "time": 300.0, "pauses": true}]);
    assert_eq!(stage["cues"], cues);
    let paused = ask(&mut socket, r#"{"command":"toggle","id":"a"}"#);
    assert_eq!((&paused["id"], &paused["command"], &paused["code"]), (&"a".into(), &"pause".into(), &"done".into()));
    assert_eq!((&paused["playback"], &paused["sentence"]), (&"paused".into(), &Value::Null));
    assert_eq!(state(name).unwrap()["sim_time"], paused["sim_time"]);
    assert_eq!(ask(&mut socket, r#"{"command":"seek","value":149.5}"#)["sim_time"], 149.5);
    let refused = ask(&mut socket, r#"{"command":"seek","value":1e9}"#);
    assert_eq!(
        (&refused["code"], refused["sentence"].as_str().unwrap()),
        (
            &"out_of_range".into(),
            "seek is refused: 1000000000 is out of range, expected seconds from 0 to the end of the show"
        )
    );
    // A cue that is passed is sent with its name.
    ask(&mut socket, r#"{"command":"resume"}"#);
    let cue = message(&mut socket, "cue");
    assert_eq!((&cue["number"], &cue["name"], &cue["pauses"]), (&1.into(), &"lamps".into(), &false.into()));
    assert!((150.0..151.0).contains(&cue["sim_time"].as_f64().unwrap()), "{cue}");
    // While the show is held, all other commands are refused with a sentence.
    assert_eq!(ask(&mut socket, r#"{"command":"hold"}"#)["playback"], "held");
    assert_eq!(ask(&mut socket, r#"{"command":"toggle"}"#)["sentence"], "resume is refused: the show is held");
    assert_eq!(ask(&mut socket, r#"{"command":"release"}"#)["playback"], "paused");
}

#[test]
fn nothing_that_is_sent_stops_the_picture() {
    let name = "nonsense";
    let publisher = publisher(name, &["--start", "100"]);
    let (_server, ready) = server(name, &["--control"]);
    let address = address(&ready);
    let mut watching = connect(&address, None).unwrap();
    let mut socket = connect(&address, None).unwrap();
    let nonsense = [
        "",
        "{",
        "null",
        "[]",
        "7",
        "{}",
        r#"{"command":7}"#,
        r#"{"command":"jump"}"#,
        r#"{"command":"seek"}"#,
        r#"{"command":"seek","value":"x"}"#,
        r#"{"command":"step","value":0.5}"#,
        r#"{"command":"pause","more":1}"#,
        r#"{"command":"rate","value":1e999}"#,
    ];
    for text in nonsense {
        let answer = ask(&mut socket, text);
        assert!(answer["code"].is_null() && answer["sentence"].is_string(), "{text}: {answer}");
    }
    assert_eq!(state(name).unwrap()["playback"], "playing");
    // A flood of commands from a client that reads no answer and is killed in the middle: its socket is dropped.
    let mut flood = connect(&address, None).unwrap();
    for number in 0..2000 {
        let sent = flood.send(Message::text(format!(r#"{{"command":"rate","value":{}}}"#, 1 + number % 2)));
        if sent.is_err() {
            break;
        }
    }
    drop(flood);
    // A message that is too long ends only its own connection.
    let mut long = connect(&address, None).unwrap();
    let _ = long.send(Message::text("x".repeat(100_000)));
    // Another client gets an answer to a hold at once, and frames still come.
    let held = ask(&mut socket, r#"{"command":"hold","id":1}"#);
    assert_eq!((&held["id"], &held["playback"]), (&1.into(), &"held".into()));
    for _ in 0..5 {
        while !matches!(watching.read().unwrap(), Message::Binary(_)) {}
    }
    // A publisher that has gone, and the next publisher.
    publisher.signal(Signal::SIGKILL);
    drop(publisher);
    message(&mut watching, "waiting");
    let gone = ask(&mut socket, r#"{"command":"release","id":2}"#);
    assert!(
        gone["code"].is_null() && gone["sentence"].as_str().unwrap().contains("no publisher has the name"),
        "{gone}"
    );
    let _next = self::publisher(name, &["--start", "200", "--paused"]);
    let state = ask(&mut socket, r#"{"command":"state"}"#);
    assert_eq!((&state["playback"], &state["sim_time"]), (&"paused".into(), &200.0.into()));
}

#[test]
fn commands_need_control_and_beyond_this_machine_a_token() {
    let name = "token";
    let _publisher = publisher(name, &["--start", "100"]);
    let (_closed, ready) = server(name, &[]);
    let answer = ask(&mut connect(&address(&ready), None).unwrap(), r#"{"command":"pause","id":9}"#);
    assert!(answer["id"] == 9 && answer["sentence"].as_str().unwrap().contains("--control"), "{answer}");
    for arguments in
        [&["--control", "--listen", "0.0.0.0"][..], &["--control", "--allow-origin", "https://show.example"]]
    {
        let (_open, ready) = server(name, arguments);
        let mut socket = connect(&address(&ready), None).unwrap();
        assert_eq!(message(&mut socket, "control")["allowed"], false);
        let token = ready["token"].as_str().unwrap();
        assert_eq!(token.len(), 32);
        let wrong = format!("{}{}", &token[..31], if token.ends_with('0') { '1' } else { '0' });
        for given in ["", &wrong, &token[..31]] {
            socket.send(Message::text(json!({"token": given}).to_string())).unwrap();
            assert_eq!(message(&mut socket, "control")["allowed"], false, "{given}");
            let answer = ask(&mut socket, r#"{"command":"pause"}"#);
            assert!(answer["code"].is_null() && answer["sentence"].as_str().unwrap().contains("token"), "{answer}");
        }
        assert_eq!(state(name).unwrap()["playback"], "playing");
        socket.send(Message::text(json!({"token": token}).to_string())).unwrap();
        assert_eq!(message(&mut socket, "control")["allowed"], true);
        assert_eq!(ask(&mut socket, r#"{"command":"pause"}"#)["playback"], "paused");
        assert_eq!(ask(&mut socket, r#"{"command":"resume"}"#)["playback"], "playing");
    }
    let mut people = Process::start(program(name).args(["view", "--port", "0", "--listen", "0.0.0.0", "--control"]));
    let lines = people.lines();
    let first = lines.until("localhost");
    let token = first.split("#token=").nth(1).unwrap().split('.').next().unwrap();
    assert_eq!(token.len(), 32, "{first}");
    // The addresses that users of other machines type, as the system lists them.
    let addresses = std::process::Command::new("hostname").arg("-I").output().unwrap();
    let addresses = text(&addresses.stdout);
    for address in addresses.split_whitespace().filter(|address| address.contains('.')) {
        assert!(lines.until(&format!("http://{address}:")).ends_with(&format!("/#token={token}")));
    }
}

#[test]
fn a_page_from_elsewhere_is_let_in_by_its_name_only() {
    let name = "elsewhere";
    let (_server, ready) =
        server(name, &["--allow-origin", "https://show.example", "--allow-origin", "http://localhost:5173/"]);
    let address = address(&ready);
    for origin in ["https://show.example", "http://localhost:5173"] {
        assert!(connect(&address, Some(origin)).is_ok(), "{origin}");
    }
    for origin in
        ["http://show.example", "https://other.example", "https://show.example.other", "http://localhost:5174", "null"]
    {
        assert_eq!(connect(&address, Some(origin)).err(), Some(403), "{origin}");
    }
    let (_server, ready) = server(name, &["--allow-origin", "null"]);
    assert!(connect(&self::address(&ready), Some("null")).is_ok());
    for wrong in ["*", "show.example", "https://show.example/page"] {
        let refused = Process::start(program(name).args(["view", "--port", "0", "--allow-origin", wrong])).output();
        assert_eq!(refused.status.code(), Some(2), "{wrong}");
        assert!(text(&refused.stderr).contains("expected an origin such as https://show.example"), "{wrong}");
    }
}

/// Returns status line, headers and body of the answer to a request whose path is sent unchanged.
fn get(address: &str, path: &str, host: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(harness::patience())).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    text(&bytes)
}

#[test]
fn pages_of_ones_own_are_served_and_nothing_beside_them() {
    let name = "pages";
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("pages");
    std::fs::create_dir_all(pages.join("deep")).unwrap();
    std::fs::write(folder.path().join("secret.txt"), "secret").unwrap();
    for (file, contents) in [("index.html", "<p>own"), ("own.js", "1"), ("deep/own.css", "p {}"), ("own.json", "{}")] {
        std::fs::write(pages.join(file), contents).unwrap();
    }
    let (_server, ready) = server(name, &["--pages", pages.to_str().unwrap()]);
    let address = address(&ready);
    for (path, kind, body) in [
        ("/pages/", "text/html", "<p>own"),
        ("/pages/own.js", "text/javascript", "1"),
        ("/pages/deep/own.css", "text/css", "p {}"),
        ("/pages/own.json", "application/json", "{}"),
    ] {
        let answer = get(&address, path, &address);
        assert!(answer.starts_with("HTTP/1.1 200") && answer.ends_with(&format!("\r\n\r\n{body}")), "{path}: {answer}");
        assert!(answer.contains(&format!("content-type: {kind}")) && answer.contains("nosniff"), "{path}: {answer}");
    }
    for path in [
        "/pages/../secret.txt",
        "/pages/%2e%2e/secret.txt",
        "/pages/..%2fsecret.txt",
        "/pages/deep/../../secret.txt",
        "/pages//etc/passwd",
        "/pages/none",
    ] {
        let answer = get(&address, path, &address);
        assert!(
            !answer.starts_with("HTTP/1.1 200") && !answer.contains("secret\n") && !answer.ends_with("secret"),
            "{path}: {answer}"
        );
    }
    assert!(get(&address, "/pages/", "evil.example").starts_with("HTTP/1.1 403"), "a foreign name for this machine");
    assert!(get(&address, "/frames?rate=abc", &address).ends_with("rate: expected 1 to 1000000 frames a second"));
    let (_plain, ready) = server(name, &[]);
    assert!(get(&self::address(&ready), "/pages/", &self::address(&ready)).starts_with("HTTP/1.1 404"));
    let refused = Process::start(program(name).args(["view", "--port", "0", "--pages", "/nowhere"])).output();
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("--pages /nowhere"), "{}", text(&refused.stderr));
}

fn in_a_browser(scenario: &str) {
    run_scenario("conduct_page.py", scenario, &[cued_scene(scenario).to_str().unwrap()]);
}

#[test]
fn bar_conducts() {
    in_a_browser("bar_conducts");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn token_and_own_pages() {
    in_a_browser("token_and_own_pages");
}

#[test]
fn own_page_draws() {
    in_a_browser("own_page_draws");
}
