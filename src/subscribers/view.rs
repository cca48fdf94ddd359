//! The live stage picture: reads a publisher's frames on a thread of its own and serves them to browsers.
//!
//! Called by the `view` command. Ports cannot leave the thread that made them, so the reader hands the newest picture
//! over through a watch channel: a slow browser skips frames and never gathers a backlog.

mod wire;

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Bytes;
use axum::extract::State as Shared;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::watch;

use super::connection::{Connection, Subscription};
use crate::transports::iceoryx2::OpenError;

/// How often a silent publisher is looked for, and missing services are opened.
const LOOK: Duration = Duration::from_millis(200);

/// The newest of everything a browser needs.
#[derive(Debug, Clone, Default, PartialEq)]
struct Picture {
    frame: Bytes,
    stage: String,
    alert: String,
    present: bool,
}

#[derive(Clone)]
struct Server {
    pictures: watch::Receiver<Picture>,
    loopback: bool,
}

/// Why the stage picture could not be served.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The publisher's services cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The address cannot be listened on.
    #[error("cannot serve the stage picture at {address}: {source}")]
    Listen {
        /// The address asked for.
        address: SocketAddr,
        /// What the system said.
        source: std::io::Error,
    },
}

/// Serves the picture of the publisher `name` at `address` until `stop` is set. `ready` is called with the address
/// once browsers can connect.
///
/// # Errors
/// [`ViewError`] for a name or an address that cannot be used.
pub fn serve(
    name: &str,
    address: SocketAddr,
    stop: &Arc<AtomicBool>,
    ready: impl FnOnce(SocketAddr),
) -> Result<(), ViewError> {
    let listen = |source| ViewError::Listen { address, source };
    let (sender, pictures) = watch::channel(Picture::default());
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(listen)?;
    let listener = runtime.block_on(tokio::net::TcpListener::bind(address)).map_err(listen)?;
    ready(listener.local_addr().map_err(listen)?);
    let reader = std::thread::spawn({
        let (name, stop) = (name.to_owned(), Arc::clone(stop));
        move || {
            let read = read(&name, &sender, &stop);
            stop.store(true, Ordering::Relaxed);
            read
        }
    });
    let server = Server { pictures, loopback: address.ip().is_loopback() };
    let router = Router::new()
        .route("/", get(|| async { file("text/html; charset=utf-8", include_str!("view/index.html")) }))
        .route("/stage.js", get(|| async { file("text/javascript", include_str!("view/stage.js")) }))
        .route("/style.css", get(|| async { file("text/css", include_str!("view/style.css")) }))
        .route("/frames", get(frames))
        .with_state(server);
    let served = runtime.block_on(async {
        tokio::select! {
            served = async { axum::serve(listener, router).await } => served,
            () = stopped(stop) => Ok(()),
        }
    });
    stop.store(true, Ordering::Relaxed);
    served.map_err(listen)?;
    // A panic of the reader has already been printed.
    reader.join().unwrap_or(Ok(())).map_err(ViewError::from)
}

async fn stopped(stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

fn file(kind: &'static str, text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-cache")], text).into_response()
}

fn read(name: &str, sender: &watch::Sender<Picture>, stop: &AtomicBool) -> Result<(), OpenError> {
    let subscription = Subscription::new(name)?;
    while !stop.load(Ordering::Relaxed) {
        match subscription.connect()? {
            Some(connection) => follow(&subscription, connection, sender, stop),
            None => std::thread::sleep(LOOK),
        }
        sender.send_replace(Picture::default());
    }
    Ok(())
}

/// Hands on what comes until the publisher is gone.
fn follow(subscription: &Subscription, mut connection: Connection, sender: &watch::Sender<Picture>, stop: &AtomicBool) {
    let mut picture = Picture { present: true, ..Picture::default() };
    let (mut heard, mut looked) = (Instant::now(), Instant::now());
    while !stop.load(Ordering::Relaxed) {
        connection.wait(LOOK);
        let mut newest = None;
        if connection.frames(|header, handles| newest = Some(wire::frame(header, handles))) > 0 {
            heard = Instant::now();
        }
        while let Some(stage) = connection.stage() {
            picture.stage = wire::stage(&stage);
        }
        while let Some(alert) = connection.alert() {
            picture.alert = wire::alert(&alert);
        }
        if let Some(frame) = newest {
            picture.frame = frame.into();
            sender.send_replace(picture.clone());
        }
        if looked.elapsed() > LOOK {
            looked = Instant::now();
            subscription.complete(&mut connection);
            if heard.elapsed() > LOOK && !subscription.publisher_is_alive(&connection) {
                return;
            }
        }
    }
}

async fn frames(Shared(server): Shared<Server>, headers: HeaderMap, upgrade: WebSocketUpgrade) -> Response {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    if !is_welcome(text(header::ORIGIN), text(header::HOST), server.loopback) {
        return (StatusCode::FORBIDDEN, "this page may not watch the stage picture").into_response();
    }
    upgrade.on_upgrade(move |socket| send(socket, server.pictures))
}

/// Whether a WebSocket may be opened: by this server's own page or by a program, which sends no origin. On loopback
/// the host must be a loopback name too, or a foreign name that resolves to this machine would pass as our own.
fn is_welcome(origin: Option<&str>, host: Option<&str>, loopback: bool) -> bool {
    let Some(host) = host else { return false };
    let own = origin.is_none_or(|origin| origin.strip_prefix("http://").is_some_and(|o| o.eq_ignore_ascii_case(host)));
    own && (!loopback || is_loopback_name(host))
}

fn is_loopback_name(host: &str) -> bool {
    let bare = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let address = bare.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    bare.eq_ignore_ascii_case("localhost") || address.is_ok_and(|address| address.is_loopback())
}

async fn send(mut socket: WebSocket, mut pictures: watch::Receiver<Picture>) {
    pictures.mark_changed();
    let mut known = Picture { present: true, ..Picture::default() };
    loop {
        tokio::select! {
            changed = pictures.changed() => if changed.is_err() { return },
            // A closed socket, or one that talks: nothing is expected of it.
            message = socket.recv() => match message { Some(Ok(_)) => continue, _ => return },
        }
        let picture = pictures.borrow_and_update().clone();
        let mut messages = Vec::new();
        if !picture.present && known.present {
            messages.push(Message::text(r#"{"type":"waiting"}"#));
        }
        for (new, old) in [(&picture.stage, &known.stage), (&picture.alert, &known.alert)] {
            if new != old && !new.is_empty() {
                messages.push(Message::text(new.clone()));
            }
        }
        if !picture.frame.is_empty() {
            messages.push(Message::Binary(picture.frame.clone()));
        }
        for message in messages {
            if socket.send(message).await.is_err() {
                return;
            }
        }
        known = picture;
    }
}

#[cfg(test)]
mod tests {
    use super::is_welcome;

    #[test]
    fn only_our_own_page_and_programs_may_watch() {
        assert!(is_welcome(Some("http://127.0.0.1:8080"), Some("127.0.0.1:8080"), true));
        assert!(is_welcome(Some("http://[::1]:8080"), Some("[::1]:8080"), true));
        assert!(is_welcome(None, Some("localhost:8080"), true));
        assert!(!is_welcome(Some("http://evil.example"), Some("127.0.0.1:8080"), true));
        assert!(!is_welcome(Some("http://127.0.0.1:9"), Some("127.0.0.1:8080"), true));
        assert!(!is_welcome(Some("http://evil.example:8080"), Some("evil.example:8080"), true));
        assert!(!is_welcome(None, None, true));
    }
}
