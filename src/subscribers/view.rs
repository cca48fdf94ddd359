//! The live stage picture: reads a publisher's frames and serves them to browsers, with the page that draws them.
//!
//! Called by the `view` command. `reader` reads the shared memory on a thread of its own, since ports cannot leave the
//! thread that made them, and hands the newest picture over; `browser` sends it to one browser at that one's pace;
//! `wire` is its layout on the way.

mod browser;
mod reader;
mod wire;

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Router;
use axum::body::Bytes;
use axum::extract::ws::{Utf8Bytes, WebSocketUpgrade};
use axum::extract::{Query, State as Shared};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde::Deserialize;
use tokio::sync::watch;

use super::connection::Wake;
use super::feed::{Feed, FeedOptions, Frames};
use crate::transports::iceoryx2::{OpenError, service_name};

/// Browsers send requests of a few letters.
const MAX_REQUEST_BYTES: usize = 1024;
/// Each frame that woke the server would cost the publisher more than the frame itself.
const FEED: FeedOptions = FeedOptions { wake: Wake::Never, frames: Frames::Newest };

/// The newest of everything a browser needs, each as it goes over the wire; empty where there is none.
#[derive(Debug, Clone, Default, PartialEq)]
struct Picture {
    /// Set while there is no publisher.
    waiting: Utf8Bytes,
    stage: Utf8Bytes,
    alert: Utf8Bytes,
    frame: Bytes,
}

impl Picture {
    /// No publisher, and the reason where there is one that cannot be used.
    fn waiting(reason: Option<&str>) -> Self {
        Self { waiting: wire::waiting(reason).into(), ..Self::default() }
    }
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
    #[error(
        "cannot serve the stage picture at {address}: {source}; choose a free port with --port and an address of this \
         machine with --listen"
    )]
    Listen {
        /// The address given.
        address: SocketAddr,
        /// What the system reported.
        source: std::io::Error,
    },
}

/// Serves the picture of the publisher `name` at `address` until `stop` is set. `ready` is called with the address
/// once browsers can connect.
///
/// # Errors
/// [`ViewError`] for a name or an address that cannot be used.
pub fn serve<Refused: From<ViewError>>(
    name: &str,
    address: SocketAddr,
    stop: &Arc<AtomicBool>,
    ready: impl FnOnce(SocketAddr) -> Result<(), Refused>,
) -> Result<(), Refused> {
    service_name(name, "poses").map_err(ViewError::from)?;
    let listen = |source| ViewError::Listen { address, source };
    // One thread for all browsers: they must not take the cores a publisher on this machine needs.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(listen)?;
    let listener = runtime.block_on(tokio::net::TcpListener::bind(address)).map_err(listen)?;
    let address = listener.local_addr().map_err(listen)?;
    ready(address)?;
    let (sender, pictures) = watch::channel(Picture::default());
    let reader = std::thread::spawn({
        let (name, stop) = (name.to_owned(), Arc::clone(stop));
        move || {
            let read = Feed::new(&name, FEED).map(|feed| reader::read(feed, &name, &sender, &stop));
            stop.store(true, Ordering::Relaxed);
            read
        }
    });
    let router = router(Server { pictures, loopback: address.ip().is_loopback() });
    let served = runtime.block_on(async {
        tokio::select! {
            served = async { axum::serve(listener, router).await } => served,
            () = stopped(stop) => Ok(()),
        }
    });
    stop.store(true, Ordering::Relaxed);
    // A panic of the reader has already been printed.
    let read = reader.join().unwrap_or(Ok(()));
    served.map_err(listen)?;
    Ok(read.map_err(ViewError::from)?)
}

fn router(server: Server) -> Router {
    let file = |kind, text| get(move || async move { file(kind, text) });
    Router::new()
        .route("/", file("text/html; charset=utf-8", include_str!("view/index.html")))
        .route("/address.js", file("text/javascript; charset=utf-8", include_str!("view/address.js")))
        .route("/boards.js", file("text/javascript; charset=utf-8", include_str!("view/boards.js")))
        .route("/camera.js", file("text/javascript; charset=utf-8", include_str!("view/camera.js")))
        .route("/drawing.js", file("text/javascript; charset=utf-8", include_str!("view/drawing.js")))
        .route("/hands.js", file("text/javascript; charset=utf-8", include_str!("view/hands.js")))
        .route("/hermite.js", file("text/javascript; charset=utf-8", include_str!("view/hermite.js")))
        .route("/marks.js", file("text/javascript; charset=utf-8", include_str!("view/marks.js")))
        .route("/palette.js", file("text/javascript; charset=utf-8", include_str!("view/palette.js")))
        .route("/panel.js", file("text/javascript; charset=utf-8", include_str!("view/panel.js")))
        .route("/show.js", file("text/javascript; charset=utf-8", include_str!("view/show.js")))
        .route("/signs.js", file("text/javascript; charset=utf-8", include_str!("view/signs.js")))
        .route("/sound.js", file("text/javascript; charset=utf-8", include_str!("view/sound.js")))
        .route("/stage.js", file("text/javascript; charset=utf-8", include_str!("view/stage.js")))
        .route("/stream.js", file("text/javascript; charset=utf-8", include_str!("view/stream.js")))
        .route("/words.js", file("text/javascript; charset=utf-8", include_str!("view/words.js")))
        .route("/style.css", file("text/css; charset=utf-8", include_str!("view/style.css")))
        .route("/frames", get(frames))
        .with_state(server)
}

async fn stopped(stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

/// A file of the page, which fetches nothing from anywhere else.
fn file(kind: &'static str, text: &'static str) -> Response {
    let headers = [
        (header::CONTENT_TYPE, kind),
        (header::CACHE_CONTROL, "no-cache"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::CONTENT_SECURITY_POLICY, "default-src 'self'; connect-src 'self' ws:; img-src data:"),
    ];
    (headers, text).into_response()
}

/// The query of `/frames`.
#[derive(Debug, Deserialize)]
struct FrameQuery {
    /// At most so many frames a second; without it, all that the server reads.
    rate: Option<f64>,
}

async fn frames(
    Shared(server): Shared<Server>,
    headers: HeaderMap,
    Query(query): Query<FrameQuery>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    if !origin_allowed(text(header::ORIGIN), text(header::HOST), server.loopback) {
        return (StatusCode::FORBIDDEN, "a page from elsewhere may not watch the stage picture").into_response();
    }
    let gap = match query.rate {
        None => Duration::ZERO,
        Some(rate) if (1.0..=1e6).contains(&rate) => Duration::from_secs_f64(rate.recip()),
        Some(_) => return (StatusCode::BAD_REQUEST, "rate: expected 1 to 1000000 frames a second").into_response(),
    };
    upgrade.max_message_size(MAX_REQUEST_BYTES).on_upgrade(move |socket| browser::serve(socket, server.pictures, gap))
}

/// Whether a WebSocket may be opened: by this server's own page or by a program, which sends no origin. On loopback
/// the host must be a loopback name too, or a foreign name that resolves to this machine would pass as our own.
fn origin_allowed(origin: Option<&str>, host: Option<&str>, loopback: bool) -> bool {
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

#[cfg(test)]
mod tests {
    use super::origin_allowed;

    #[test]
    fn only_our_own_page_and_programs_may_watch() {
        assert!(origin_allowed(Some("http://127.0.0.1:8080"), Some("127.0.0.1:8080"), true));
        assert!(origin_allowed(Some("http://[::1]:8080"), Some("[::1]:8080"), true));
        assert!(origin_allowed(None, Some("localhost:8080"), true));
        assert!(origin_allowed(Some("http://10.1.2.3:8080"), Some("10.1.2.3:8080"), false));
        assert!(!origin_allowed(Some("http://evil.example"), Some("127.0.0.1:8080"), true));
        assert!(!origin_allowed(Some("http://127.0.0.1:9"), Some("127.0.0.1:8080"), true));
        assert!(!origin_allowed(Some("http://evil.example:8080"), Some("evil.example:8080"), true));
        assert!(!origin_allowed(Some("http://evil.example"), Some("10.1.2.3:8080"), false));
        assert!(!origin_allowed(Some("null"), Some("127.0.0.1:8080"), true));
        assert!(!origin_allowed(None, None, true));
    }
}
