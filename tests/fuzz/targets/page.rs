//! Requests of browsers and other clients to `view` over a connection: HTTP, the WebSocket's frames, the messages in
//! them.
//!
//! A real server answers. Its commands are behind a token that no client has, and beside its folder of pages is a file
//! that must not be served.

use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpStream};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock, mpsc};
use std::time::Duration;

use bench_dragon::outputs::view::{Facts, Ready, ViewError, ViewOptions, serve};
use fastrand::Rng;
use serde_json::Value;

use super::Target;
use super::bytes::{NUMBERS, changed, one, renumbered};

pub const TARGET: Target = Target { name: "page", run, seeds, mutate, cases: 8000 };

const SECRET: &str = "this file is not to be served";
/// Seconds after which a server that neither answers nor hangs up has hung.
const HUNG: Duration = Duration::from_secs(240);

/// Starts the server, which runs until the process ends, and returns its address.
fn address() -> SocketAddr {
    static ADDRESS: OnceLock<SocketAddr> = OnceLock::new();
    *ADDRESS.get_or_init(|| {
        // One for all runs: no process remains that could remove a folder of this run.
        let folder =
            option_env!("CARGO_TARGET_TMPDIR").map_or_else(std::env::temp_dir, PathBuf::from).join("fuzz_page");
        let pages = folder.join("pages");
        std::fs::create_dir_all(&pages).expect("a folder");
        std::fs::write(folder.join("secret.txt"), SECRET).expect("a file");
        std::fs::write(pages.join("own.html"), "a page of one's own").expect("a file");
        let (sender, ready) = mpsc::channel();
        let name = format!("fuzz_page_{}", std::process::id());
        std::thread::spawn(move || {
            let options = ViewOptions {
                open_scene: |_| None,
                address: (Ipv4Addr::LOCALHOST, 0).into(),
                control: true,
                origins: vec!["https://show.example".parse().expect("an origin")],
                pages: Some(pages),
                proofs: Arc::default(),
                facts: Arc::new(Facts::new(|_| None)),
            };
            let stop = Arc::new(AtomicBool::new(false));
            let served: Result<(), ViewError> =
                serve(std::slice::from_ref(&name), options, &stop, |Ready { address, token }| {
                    assert!(token.is_some(), "commands are behind a token");
                    let _ = sender.send(*address);
                    Ok(())
                });
            served.expect("the server runs until the process ends");
        });
        ready.recv().expect("the server starts")
    })
}

fn run(data: &[u8]) -> bool {
    let mut connection = TcpStream::connect(address()).expect("the server listens");
    connection.set_read_timeout(Some(HUNG)).expect("a timeout");
    // A server that hangs up early reads no more.
    let _ = connection.write_all(data);
    let _ = connection.shutdown(Shutdown::Write);
    let mut answer = Vec::new();
    if let Err(error) = connection.read_to_end(&mut answer) {
        assert!(error.kind() == ErrorKind::ConnectionReset, "no answer within {HUNG:?}: {error}");
    }
    let text = String::from_utf8_lossy(&answer);
    assert!(text.is_empty() || text.starts_with("HTTP/1."), "{text}");
    assert!(!text.starts_with("HTTP/1.1 5") && !text.starts_with("HTTP/1.0 5"), "{text}");
    assert!(!text.contains(SECRET), "{text}");
    if text.starts_with("HTTP/1.1 101") {
        check_upgraded(data, &answer);
    }
    // Without the token no client can send commands.
    assert!(!text.contains("\"allowed\":true") && !text.contains("\"code\":\"done\""), "{text}");
    true
}

/// Checks the promises about a connection that became a WebSocket.
fn check_upgraded(data: &[u8], answer: &[u8]) {
    let (head, sent) = data.split_at(head_end(data));
    let head = String::from_utf8_lossy(head).into_owned();
    let origin = head.lines().find(|line| line.starts_with("Origin: "));
    assert!(!origin.is_some_and(|line| FOREIGN.contains(&line)), "let in: {head}");
    // The body of the request itself is no message; requests with other line ends are not checked further.
    let has_own_end = head.lines().count() != head.split("\r\n").count() - 1 || head.replace("\r\n", "").contains('\r');
    let head = head.to_ascii_lowercase();
    if has_own_end || head.contains("transfer-encoding") || head.contains("content-length") {
        return;
    }
    let (received, _) = frames(&answer[head_end(answer)..], false);
    let answers: Vec<Value> = (received.into_iter().filter(|frame| frame.0 == 0x81))
        .map(|(_, text)| serde_json::from_slice(&text).unwrap_or_else(|error| panic!("{error} in {text:?}")))
        .filter(|json: &Value| ["control", "answer", "clock"].contains(&json["type"].as_str().unwrap_or_default()))
        .collect();
    // Input that breaks the rules of WebSockets anywhere is not checked further.
    let (frames, rest) = frames(sent, true);
    let is_regular = |(first, text): &(u8, Vec<u8>)| match first {
        0x81 => text.len() <= 1024 && std::str::from_utf8(text).is_ok(),
        0x89 | 0x8a => text.len() < 126,
        _ => false,
    };
    if !rest.is_empty() || !frames.iter().all(is_regular) {
        return;
    }
    let asked: Vec<Vec<u8>> = frames.into_iter().filter(|frame| frame.0 == 0x81).map(|frame| frame.1).collect();
    // The first message states whether this client may send commands.
    assert_eq!(answers.len(), asked.len() + 1, "{answers:?} to {}", String::from_utf8_lossy(sent));
    for (asked, answer) in asked.iter().zip(&answers[1..]) {
        assert_eq!(asked == b"clock", answer["type"] == "clock", "{answer}");
        let text = String::from_utf8_lossy(asked);
        let Ok(Value::Object(asked)) = serde_json::from_str(&text) else { continue };
        // Messages that repeat a name are not checked further.
        let is_once = |name: &&str| text.matches(&format!("\"{name}\"")).count() <= 1;
        let is_command = ["command", "value", "id"].iter().all(is_once)
            && asked.get("command").is_some_and(Value::is_string)
            && asked.get("value").is_none_or(|value| value.is_null() || value.is_number())
            && asked.keys().all(|key| ["command", "value", "id"].contains(&key.as_str()));
        if is_command {
            let id = asked.get("id").unwrap_or(&Value::Null);
            assert_eq!(&answer["id"], id, "{answer}");
            assert!(answer["sentence"].as_str().is_some_and(|sentence| !sentence.is_empty()), "{answer}");
        }
    }
}

/// Returns the end of the head of a request or an answer: after the first empty line, whose carriage return may be
/// missing.
fn head_end(bytes: &[u8]) -> usize {
    let after =
        |line_end: &[u8]| bytes.windows(line_end.len()).position(|some| some == line_end).map(|at| at + line_end.len());
    [after(b"\n\n"), after(b"\n\r\n")].into_iter().flatten().min().unwrap_or(bytes.len())
}

/// Returns the WebSocket frames at the start of some bytes, masked as a client's or not masked as a server's. A frame
/// is its first byte and its content. Also returns the remaining bytes.
fn frames(mut bytes: &[u8], masked: bool) -> (Vec<(u8, Vec<u8>)>, &[u8]) {
    let mut frames = Vec::new();
    while let Some(([first, length], rest)) = bytes.split_first_chunk() {
        if (length & 0x80 != 0) != masked {
            break;
        }
        let (length, rest) = match length & 0x7f {
            126 => match rest.split_first_chunk() {
                Some((length, rest)) => (usize::from(u16::from_be_bytes(*length)), rest),
                None => break,
            },
            127 => break,
            length => (usize::from(length), rest),
        };
        let Some((key, rest)) = rest.split_at_checked(if masked { 4 } else { 0 }) else { break };
        let Some((content, rest)) = rest.split_at_checked(length) else { break };
        let unmasked = content.iter().zip((0..).map(|at: usize| key.get(at % 4).copied().unwrap_or(0)));
        frames.push((*first, unmasked.map(|(byte, key)| byte ^ key).collect()));
        bytes = rest;
    }
    (frames, bytes)
}

/// Origins that the server refuses.
const FOREIGN: [&str; 2] = ["Origin: null", "Origin: http://evil.example"];

const PATHS: [&str; 16] = [
    "/",
    "/stage.js",
    "/frames",
    "/frames?rate=30",
    "/frames?rate=1e-320",
    "/frames?rate=nan",
    "/frames?rate=1000000",
    "/frames?x&rate=&rate=5",
    "/pages",
    "/pages/",
    "/pages/own.html",
    "/pages/../secret.txt",
    "/pages/%2e%2e/secret.txt",
    "/pages/..%2fsecret.txt",
    "/pages//secret.txt",
    "/%00",
];

const HEADERS: [&str; 18] = [
    "Host: 127.0.0.1:8080",
    "Host: localhost",
    "Host: evil.example",
    "Host: [::1]:",
    "Origin: null",
    "Origin: https://show.example",
    "Origin: http://127.0.0.1:8080",
    "Origin: http://evil.example",
    "Connection: close",
    "Connection: keep-alive, Upgrade",
    "Upgrade: websocket",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Extensions: permessage-deflate",
    "Content-Length: 18446744073709551615",
    "Transfer-Encoding: chunked",
    "Range: bytes=0-99999999999999999999",
    "If-Modified-Since: \u{9f99}",
];

const MESSAGES: [&str; 15] = [
    "{\"command\":\"go\",\"id\":9007199254740993}",
    "{\"command\":\"a\\\"b\\n\",\"id\":1}",
    "{\"command\":\"state\",\"id\":\"\\u2028\\\"\"}",
    "clock",
    "{\"command\":\"pause\"}",
    "{\"command\":\"seek\",\"value\":400,\"id\":7}",
    "{\"command\":\"step\",\"value\":0.5}",
    "{\"command\":\"rate\",\"value\":1e999}",
    "{\"command\":\"toggle\",\"id\":{\"a\":[null]}}",
    "{\"token\":\"00000000000000000000000000000000\"}",
    "{\"token\":\"\"}",
    "{\"token\":\"x\",\"command\":\"hold\"}",
    "[[[[[[[[[[",
    "\u{9f99}",
    "",
];

fn request(path: &str, headers: &[&str]) -> Vec<u8> {
    format!("GET {path} HTTP/1.1\r\n{}\r\n\r\n", headers.join("\r\n")).into_bytes()
}

/// Returns a handshake that is accepted.
fn handshake() -> Vec<u8> {
    handshake_with("/frames?rate=30", "X: y")
}

/// Returns a handshake with another path, and one header that may change the result.
fn handshake_with(path: &str, header: &str) -> Vec<u8> {
    request(path, &[header, "Host: localhost", HEADERS[9], HEADERS[10], HEADERS[11], HEADERS[12]])
}

/// Returns a WebSocket frame of a client, masked with zeros.
fn frame(opcode: u8, payload: &[u8]) -> Vec<u8> {
    let mut frame = vec![0x80 | opcode];
    match payload.len() {
        short @ 0..126 => frame.push(0x80 | short as u8),
        long => frame.extend([&[0x80 | 126][..], &(long.min(65535) as u16).to_be_bytes()].concat()),
    }
    frame.extend([0; 4]);
    frame.extend(payload);
    frame
}

fn seeds() -> Vec<Vec<u8>> {
    let paths = PATHS.iter().map(|path| request(path, &["Host: localhost", "Connection: close"]));
    let headers = HEADERS.iter().map(|header| request("/frames", &["Host: localhost", header]));
    let messages = MESSAGES.iter().map(|message| [handshake(), frame(1, message.as_bytes())].concat());
    let all: Vec<u8> = MESSAGES.iter().flat_map(|message| frame(1, message.as_bytes())).collect();
    let odd =
        [[handshake(), all].concat(), [handshake(), frame(9, b"ping"), frame(10, &[0xff; 8]), frame(8, &[])].concat()];
    paths.chain(headers).chain(messages).chain(odd).collect()
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    match random.u8(..6) {
        0 => changed(data, random),
        5 => {
            let path = format!("/frames?rate={}", one(&NUMBERS, random));
            let path = if random.bool() { &path } else { "/frames" };
            [handshake_with(path, HEADERS[random.usize(..HEADERS.len())]), frame(1, one(&MESSAGES, random).as_bytes())]
                .concat()
        }
        1 => {
            let count = random.usize(..6);
            let headers: Vec<&str> = (0..count).map(|_| *one(&HEADERS, random)).collect();
            let path = one(&PATHS, random);
            request(path, &headers)
        }
        2 => renumbered(&String::from_utf8_lossy(data), random).into_bytes(),
        _ => {
            let mut bytes = handshake();
            for _ in 0..1 + random.usize(..5) {
                let message = one(&MESSAGES, random).as_bytes();
                let message =
                    if random.bool() { changed(message, random) } else { message.repeat(1 + random.usize(..40)) };
                let opcode = *one(&[1, 1, 1, 1, 2, 0, 8, 9, 10, 15], random);
                bytes.extend(frame(opcode, &message));
            }
            bytes
        }
    }
}
