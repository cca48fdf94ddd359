//! `design`: the page's server over its real WebSocket, its file, and its refusals.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

use crate::harness::{Place, Process, http_get, json_lines, text};

type Socket = WebSocket<MaybeTlsStream<TcpStream>>;

/// A server and its address, as 127.0.0.1:40000.
struct Design {
    _process: Process,
    address: String,
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
        Self { _process: process, address, place }
    }

    fn connect(&self, origin: Option<&str>) -> Result<Socket, Box<tungstenite::Error>> {
        let mut request = format!("ws://{}/design/session", self.address).into_client_request().unwrap();
        if let Some(origin) = origin {
            request.headers_mut().insert("Origin", origin.parse().unwrap());
        }
        let (socket, _) = tungstenite::connect(request)?;
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        }
        Ok(socket)
    }

    /// Posts a text to be saved; returns the answer's status.
    fn save(&self, text: &str, origin: &str) -> u16 {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        let (address, length) = (&self.address, text.len());
        let head = format!("POST /design/save HTTP/1.1\r\nHost: {address}\r\nOrigin: {origin}\r\nConnection: close");
        write!(stream, "{head}\r\nContent-Type: text/plain\r\nContent-Length: {length}\r\n\r\n{text}").unwrap();
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
    let file = design.place.folder().join("scene.toml");
    for (command, key) in [("events", "events"), ("check", "facts")] {
        let output = Process::start(design.place.program().args([command, "--json"]).arg(&file)).output();
        let printed = json_lines(&output);
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
    assert_eq!(design.save(&other, &own), 200);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), other);
    assert_eq!(design.save(paper, "http://evil.example"), 403);
    std::fs::write(&file, "# by another program").unwrap();
    assert_eq!(design.save(paper, &own), 409);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "# by another program");
    // The page reads the file again, and may write it then.
    let mut socket = design.connect(Some(&own)).unwrap();
    let error = answer(&mut socket, 0, "error");
    assert_eq!(error["text"], "# by another program", "{error}");
    send(&mut socket, &json!({"id": 1, "file": true}));
    answer(&mut socket, 1, "error");
    assert_eq!(design.save(paper, &own), 200);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), paper);
    let read_only = Design::start("design-read", paper, &[]);
    assert_eq!(read_only.save(&other, &format!("http://{}", read_only.address)), 422);
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
