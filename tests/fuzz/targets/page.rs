//! What a browser, or anybody, sends to `view` over a connection: HTTP, the WebSocket's frames, the messages in them.
//!
//! A real server answers, with commands behind a token that nobody has, and a folder of pages beside which lies a file that
//! is not to be served.

use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpStream};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock, mpsc};
use std::time::Duration;

use bench_dragon::subscribers::view::{Ready, ViewError, ViewOptions, serve};
use fastrand::Rng;

use super::Target;
use super::bytes::{changed, one, renumbered};

pub const TARGET: Target = Target { name: "page", run, seeds, mutate, cases: 8000 };

const SECRET: &str = "this file is not to be served";
/// Seconds after which a server that neither answers nor hangs up has hung.
const HUNG: Duration = Duration::from_secs(60);

/// The server, for as long as the process lives.
fn address() -> SocketAddr {
    static ADDRESS: OnceLock<SocketAddr> = OnceLock::new();
    *ADDRESS.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder").keep();
        let pages = folder.join("pages");
        std::fs::create_dir(&pages).expect("a folder");
        std::fs::write(folder.join("secret.txt"), SECRET).expect("a file");
        std::fs::write(pages.join("own.html"), "a page of one's own").expect("a file");
        let (sender, ready) = mpsc::channel();
        let name = format!("fuzz_page_{}", std::process::id());
        std::thread::spawn(move || {
            let options = ViewOptions {
                address: (Ipv4Addr::LOCALHOST, 0).into(),
                control: true,
                origins: vec!["https://show.example".parse().expect("an origin")],
                pages: Some(pages),
                proofs: Arc::default(),
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

fn run(data: &[u8]) {
    let mut connection = TcpStream::connect(address()).expect("the server listens");
    connection.set_read_timeout(Some(HUNG)).expect("a timeout");
    // A server that hangs up early takes no more.
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
    // Without the token nobody commands.
    assert!(!text.contains("\"allowed\":true") && !text.contains("\"code\":\"done\""), "{text}");
}

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

const MESSAGES: [&str; 12] = [
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

/// A handshake that is accepted.
fn handshake() -> Vec<u8> {
    request("/frames?rate=30", &["Host: localhost", HEADERS[9], HEADERS[10], HEADERS[11], HEADERS[12]])
}

/// A WebSocket frame of a client, masked with zeros.
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
    match random.u8(..5) {
        0 => changed(data, random),
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
