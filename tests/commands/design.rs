//! `design`: the page's server over its real WebSocket, its file, and its refusals.

use std::io::{Read, Write};
use std::net::TcpStream;

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

use crate::harness::{Place, Process, http_get, json_lines, patience, text};

type Socket = WebSocket<MaybeTlsStream<TcpStream>>;

/// A server and its address, as 127.0.0.1:40000.
struct Design {
    _process: Process,
    address: String,
    token: Option<String>,
    place: Place,
}

impl Design {
    /// Starts `design` on a copy of a scene, with options.
    fn start(name: &str, scene: &str, options: &[&str]) -> Self {
        let place = Place::new(name);
        let file = place.folder().join("scene.toml");
        std::fs::write(&file, scene).unwrap();
        let mut program = place.program();
        let mut process = Process::start(program.args(["design", "--json", "--port", "0"]).arg(&file).args(options));
        let ready: Value = serde_json::from_str(&process.first_line()).unwrap();
        let address = ready["url"].as_str().unwrap().trim_start_matches("http://").trim_end_matches('/').to_owned();
        let token = ready["token"].as_str().map(str::to_owned);
        Self { _process: process, address, token, place }
    }

    fn connect(&self, origin: Option<&str>) -> Result<Socket, Box<tungstenite::Error>> {
        let mut request = format!("ws://{}/design/session", self.address).into_client_request().unwrap();
        if let Some(origin) = origin {
            request.headers_mut().insert("Origin", origin.parse().unwrap());
        }
        let (socket, _) = tungstenite::connect(request)?;
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(patience())).unwrap();
        }
        Ok(socket)
    }

    /// Posts a text to be saved in place of a base; returns the answer's status.
    fn save(&self, [base, text]: [&str; 2]) -> u16 {
        let own = format!("http://{}", self.address);
        self.post(&json!({"base": base, "text": text}).to_string(), &own, self.token.as_deref())
    }

    /// Posts to the address for saving; returns the answer's status.
    fn post(&self, body: &str, origin: &str, token: Option<&str>) -> u16 {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        let (address, length) = (&self.address, body.len());
        let token = token.map_or_else(String::new, |token| format!("Authorization: Bearer {token}\r\n"));
        let head = format!("POST /design/save HTTP/1.1\r\nHost: {address}\r\nOrigin: {origin}\r\nConnection: close");
        write!(stream, "{head}\r\n{token}Content-Length: {length}\r\n\r\n{body}").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer.split(' ').nth(1).unwrap().parse().unwrap()
    }
}

/// Returns the next JSON message of which something holds.
fn until(socket: &mut Socket, holds: impl Fn(&Value) -> bool) -> Value {
    loop {
        if let Message::Text(json) = socket.read().unwrap() {
            let message: Value = serde_json::from_str(&json).unwrap();
            if holds(&message) {
                return message;
            }
        }
    }
}

fn send(socket: &mut Socket, request: &Value) {
    socket.send(Message::Text(request.to_string().into())).unwrap();
}

/// Returns the answer of a request that has a key, and its state if there is one.
fn answer(socket: &mut Socket, id: u64, key: &str) -> Value {
    let is_it =
        |message: &Value| message["id"] == id && !message[key].is_null() && message[key]["state"] != "computing";
    until(socket, is_it)[key].clone()
}

#[test]
fn events_and_clearances_are_those_of_the_commands() {
    let scene = include_str!("../../config/square.toml");
    let design = Design::start("design-results", scene, &[]);
    let file = design.place.folder().join("scene.toml");
    let [events, facts] = ["events", "check"].map(|command| {
        json_lines(&Process::start(design.place.program().args([command, "--json"]).arg(&file)).output())
    });
    let mut socket = design.connect(None).unwrap();
    let hello = until(&mut socket, |message| message["hello"].is_object());
    assert_eq!((&hello["hello"]["save"], &hello["hello"]["token"]), (&json!(false), &json!(false)));
    let scene = answer(&mut socket, 0, "scene");
    assert_eq!(scene["text"], include_str!("../../config/square.toml"));
    let stage = until(&mut socket, |message| message["type"] == "stage");
    let frame = loop {
        if let Message::Binary(bytes) = socket.read().unwrap() {
            break bytes;
        }
    };
    // The layout of `view`: the number of handles at byte 4, of the run at byte 32.
    assert_eq!(frame[4..8], 21_u32.to_le_bytes());
    assert_eq!(u64::from_le_bytes(frame[32..40].try_into().unwrap()).to_string(), stage["run_id"].as_str().unwrap());
    for (printed, key) in [(events, "events"), (facts, "facts")] {
        let shown = answer(&mut socket, 0, key);
        let shown = shown["list"].as_array().unwrap();
        assert!(!printed.is_empty() && shown.len() == printed.len(), "{shown:?} {printed:?}");
        for (line, shown) in printed.iter().zip(shown) {
            line.as_object().unwrap().iter().for_each(|(key, value)| assert_eq!(shown[key], *value, "{key}"));
        }
    }
    assert!(http_get(&format!("http://{}/design", design.address), "*/*").contains("<html"));
    assert!(http_get(&format!("http://{}/design/page.js", design.address), "*/*").contains("import"));
}

#[test]
fn a_text_is_saved_unless_the_file_has_changed() {
    let paper = include_str!("../../config/paper.toml");
    let design = Design::start("design-save", paper, &["--save"]);
    let own = format!("http://{}", design.address);
    let file = design.place.folder().join("scene.toml");
    let other = paper.replace("pitch = 0.55", "pitch = 0.6");
    assert_eq!(design.save([paper, &other]), 200);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), other);
    assert_eq!(design.post(&json!({"base": other, "text": paper}).to_string(), "http://evil.example", None), 403);
    assert_eq!(design.post(paper, &own, None), 400);
    // A second page that has read the first text.
    assert_eq!(design.save([paper, paper]), 409);
    let foreign = "# by another program";
    std::fs::write(&file, foreign).unwrap();
    // A page that connects again has not read the file, although the server has.
    let mut socket = design.connect(Some(&own)).unwrap();
    let error = answer(&mut socket, 0, "error");
    assert_eq!(error["text"], foreign, "{error}");
    send(&mut socket, &json!({"id": 1, "file": true}));
    answer(&mut socket, 1, "error");
    assert_eq!(design.save([&other, paper]), 409);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), foreign);
    assert_eq!(design.save([foreign, paper]), 200);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), paper);
    let read_only = Design::start("design-read", paper, &[]);
    assert_eq!(read_only.save([paper, &other]), 422);
}

#[test]
fn beyond_loopback_every_request_needs_the_token() {
    let paper = include_str!("../../config/paper.toml");
    let design = Design::start("design-token", paper, &["--listen", "0.0.0.0", "--save"]);
    let token = design.token.clone().expect("a token beyond loopback");
    let mut socket = design.connect(None).unwrap();
    let hello = until(&mut socket, |message| message["hello"].is_object());
    assert_eq!(hello["hello"]["token"], true);
    let refused = [json!({"id": 1, "template": "square"}), json!({"token": "wrong"}), json!({"token": &token[1..]})];
    for request in refused {
        send(&mut socket, &request);
        // The next message, whatever it is.
        assert_eq!(until(&mut socket, |_| true), json!({"id": 0, "allowed": false}), "{request}");
    }
    let own = format!("http://{}", design.address);
    let body = json!({"base": paper, "text": "# other"}).to_string();
    for wrong in [None, Some("wrong"), Some(&token[1..])] {
        assert_eq!(design.post(&body, &own, wrong), 401, "{wrong:?}");
    }
    assert_eq!(std::fs::read_to_string(design.place.folder().join("scene.toml")).unwrap(), paper);
    send(&mut socket, &json!({"token": token}));
    assert_eq!(until(&mut socket, |_| true), json!({"id": 0, "allowed": true}));
    assert_eq!(answer(&mut socket, 0, "scene")["text"], paper);
    assert_eq!(design.post(&body, &own, Some(&token)), 200);
}

#[test]
#[ignore = "computes for long: tests/run --all"]
fn the_least_turn_of_a_route_is_that_of_the_command() {
    let village = include_str!("../../config/village.toml");
    let design = Design::start("design-turn", village, &[]);
    let file = design.place.folder().join("scene.toml");
    let command = ["plan", "turn", "--json", "--arc-ratio", "1"];
    let printed = json_lines(&Process::start(design.place.program().args(command).arg(&file)).output());
    assert_eq!(printed[0]["status"], "proved", "{printed:?}");
    // After the command: the server ends a connection that is not read for half a minute.
    let mut socket = design.connect(None).unwrap();
    answer(&mut socket, 0, "scene");
    send(&mut socket, &json!({"id": 1, "plan": "turn"}));
    let found = until(&mut socket, |message| message["id"] == 1 && !message["plan"].is_null());
    printed[0].as_object().unwrap().iter().for_each(|(key, value)| assert_eq!(found["plan"][key], *value, "{key}"));
    let planned = format!("to_radius = {}", printed[0]["value_hi"]);
    assert_eq!(found["text"], village.replace("to_radius = 2.99", &planned));
    send(&mut socket, &json!({"id": 2, "text": include_str!("../../config/procession.toml")}));
    answer(&mut socket, 2, "scene");
    send(&mut socket, &json!({"id": 3, "plan": "turn"}));
    let refused = answer(&mut socket, 3, "error");
    assert!(refused["sentence"].as_str().unwrap().contains("one piece of kind \"turn\""), "{refused}");
}

#[test]
fn foreign_pages_and_a_fifth_session_are_refused() {
    let design = Design::start("design-refusals", include_str!("../../config/paper.toml"), &[]);
    let refused = design.connect(Some("http://evil.example")).unwrap_err().to_string();
    assert!(refused.contains("403"), "{refused}");
    let mut sockets: Vec<_> = (0..4).map(|_| design.connect(None).unwrap()).collect();
    let refused = design.connect(None).unwrap_err().to_string();
    assert!(refused.contains("503"), "{refused}");
    let mut last = sockets.pop().unwrap();
    last.close(None).unwrap();
    crate::harness::wait_until("the place of the session that was closed", || design.connect(None).is_ok());
    // A text of 256 KiB is answered, and one beyond too.
    let mut socket = sockets.pop().unwrap();
    let large = format!("{}#{}", include_str!("../../config/paper.toml"), "\u{1}".repeat(255 * 1024));
    send(&mut socket, &json!({"id": 7, "text": large}));
    assert!(until(&mut socket, |message| message["id"] == 7)["error"]["sentence"].is_string());
    send(&mut socket, &json!({"id": 8, "text": include_str!("../../config/coil.toml")}));
    assert_eq!(answer(&mut socket, 8, "scene")["dragons"], json!(["gold", "jade"]));
}

#[test]
fn save_needs_a_file() {
    let place = Place::new("design-nothing");
    let output = Process::start(place.program().args(["design", "--save"])).output();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("expected design FILE --save"), "{}", text(&output.stderr));
    let output = Process::start(place.program().args(["design", "missing.toml"])).output();
    assert_eq!(output.status.code(), Some(2));
}
