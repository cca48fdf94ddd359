//! The page on which a scene is made: its files, and a WebSocket for each session.
//!
//! In: requests of browsers, passed to a [`Studio`]. Out: its answers, frames and stages in the layouts of `view`. The
//! studio has the solvers; this module has the sockets, the admission of pages and the token.

mod session;

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize};

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{DefaultBodyLimit, State as Served};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::{get, post};
use serde::Deserialize;

use super::http::Listening;
use super::view::origin::Admission;
use super::view::{HTML, Ready, SCRIPT, STYLE, Token, ViewError, modules, served, text_of};
use bench_dragon_messages::{FrameHeader, HandlePose, StageMessage};
use session::Place;

/// The greatest number of sessions at a time.
const MOST_SESSIONS: usize = 4;
/// The longest message of a browser: a text of 256 KiB, every byte of it escaped in JSON, and what stands around it.
const MAX_MESSAGE_BYTES: usize = 2 * 1024 * 1024;

/// The files of the page below `/design/`: name, kind, content.
const FILES: [(&str, &str, &str); 12] = [
    ("design.css", STYLE, include_str!("design/design.css")),
    ("fields.js", SCRIPT, include_str!("design/fields.js")),
    ("ground_picture.js", SCRIPT, include_str!("design/ground_picture.js")),
    ("handles.js", SCRIPT, include_str!("design/handles.js")),
    ("history.js", SCRIPT, include_str!("design/history.js")),
    ("page.js", SCRIPT, include_str!("design/page.js")),
    ("picture.js", SCRIPT, include_str!("design/picture.js")),
    ("plans.js", SCRIPT, include_str!("design/plans.js")),
    ("results.js", SCRIPT, include_str!("design/results.js")),
    ("session.js", SCRIPT, include_str!("design/session.js")),
    ("text.js", SCRIPT, include_str!("design/text.js")),
    ("time_line.js", SCRIPT, include_str!("design/time_line.js")),
];

/// An answer of a studio to a page.
#[derive(Debug, Clone)]
pub enum Answer {
    /// A JSON text.
    Json(String),
    /// The stage of a scene with this name.
    Stage(Box<StageMessage>, String),
    /// A frame.
    Frame(FrameHeader, Vec<HandlePose>),
}

/// Receives the answers to a page, from any thread. It waits while the page is behind.
pub type Answers = Arc<dyn Fn(Answer) + Send + Sync>;

/// A request that does not fit, since too many are waiting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("too many requests are waiting")]
pub struct Busy;

/// A page's session. It ends when it is dropped.
pub trait DesignSession: Send {
    /// Takes a request; the answers come later.
    ///
    /// # Errors
    /// [`Busy`]
    fn request(&self, json: String) -> Result<(), Busy>;
}

/// The reason why a text is not saved.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SaveError {
    /// The file has another text than the page has read.
    Changed(String),
    /// There is no file, or it cannot be written.
    Failed(String),
}

/// The solvers and the file behind the page.
pub trait Studio: Send + Sync {
    /// Returns the first message to a page, which may need a token.
    fn greeting(&self, needs_token: bool) -> String;

    /// Starts a session.
    ///
    /// # Errors
    /// The system has no thread left.
    fn open(&self, answers: Answers) -> io::Result<Box<dyn DesignSession>>;

    /// Saves a text in the file of the design, whose text has to be `base` still.
    ///
    /// # Errors
    /// [`SaveError`]
    fn save(&self, base: &str, text: &str) -> Result<(), SaveError>;
}

/// The studio, the admission, the token and the sessions that the requests of all browsers share.
#[derive(Clone)]
struct Server {
    studio: Arc<dyn Studio>,
    admission: Arc<Admission>,
    token: Option<Arc<Token>>,
    sessions: Arc<AtomicUsize>,
}

/// Serves the page until `stop` is set. `ready` is called once browsers can connect.
///
/// # Errors
/// [`ViewError`] for an address that cannot be used.
pub fn serve<Refused: From<ViewError>>(
    studio: Arc<dyn Studio>,
    address: SocketAddr,
    stop: &Arc<AtomicBool>,
    ready: impl FnOnce(&Ready) -> Result<(), Refused>,
) -> Result<(), Refused> {
    let listen = |source| ViewError::Listen { address, source };
    let server = Listening::at(address).map_err(listen)?;
    let address = server.address;
    let loopback = address.ip().is_loopback();
    let token = if loopback { None } else { Some(Token::random().map_err(ViewError::from)?) };
    ready(&Ready { address, token: token.clone() })?;
    let admission = Arc::new(Admission { loopback, origins: Vec::new() });
    let shared = Server { studio, admission, token: token.map(Arc::new), sessions: Arc::default() };
    Ok(server.serve(router(shared), stop).map_err(listen)?)
}

fn router(server: Server) -> Router {
    let mut router = modules()
        .route("/", get(|| async { Redirect::temporary("design") }))
        .route("/design", get(|| async { served(HTML, include_str!("design/index.html")) }))
        .route("/design/session", get(sessions))
        .route("/design/save", post(save).layer(DefaultBodyLimit::max(2 * MAX_MESSAGE_BYTES)));
    for (name, kind, text) in FILES {
        router = router.route(&format!("/design/{name}"), get(move || async move { served(kind, text) }));
    }
    router.with_state(server)
}

impl Server {
    /// Refuses pages of other servers.
    #[expect(clippy::result_large_err, reason = "the error is the answer")]
    fn admits(&self, headers: &HeaderMap) -> Result<(), Response> {
        if self.admission.allows(text_of(headers, header::ORIGIN), text_of(headers, header::HOST)) {
            return Ok(());
        }
        Err((StatusCode::FORBIDDEN, "a page from elsewhere may not design with this server").into_response())
    }
}

/// Opens a session.
async fn sessions(
    Served(server): Served<Server>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    if let Err(refused) = server.admits(&headers) {
        return refused;
    }
    let Ok(upgrade) = upgrade else {
        let sentence = "a session is a WebSocket: open ws://.../design/session";
        return (StatusCode::UPGRADE_REQUIRED, sentence).into_response();
    };
    let Some(place) = Place::taken(&server.sessions, MOST_SESSIONS) else {
        let sentence = format!("{MOST_SESSIONS} pages are open already, expected one of them to be closed first");
        return (StatusCode::SERVICE_UNAVAILABLE, sentence).into_response();
    };
    upgrade
        .max_frame_size(MAX_MESSAGE_BYTES)
        .max_message_size(MAX_MESSAGE_BYTES)
        .on_upgrade(move |socket| session::serve(socket, server, place))
}

/// A text that a page wants to save.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Saved {
    /// The text of the file as the page has read or written it.
    base: String,
    /// The new text.
    text: String,
}

/// Saves the text of a page.
async fn save(Served(server): Served<Server>, headers: HeaderMap, body: String) -> Response {
    if let Err(refused) = server.admits(&headers) {
        return refused;
    }
    let given = text_of(&headers, header::AUTHORIZATION).and_then(|value| value.strip_prefix("Bearer "));
    if server.token.as_ref().is_some_and(|token| !given.is_some_and(|given| token.is(given))) {
        return (StatusCode::UNAUTHORIZED, session::NEEDS_TOKEN).into_response();
    }
    let Saved { base, text } = match serde_json::from_str(&body) {
        Ok(saved) => saved,
        Err(error) => {
            let sentence =
                format!("{error}: expected JSON with the text to save, and with the base that it comes from");
            return (StatusCode::BAD_REQUEST, sentence).into_response();
        }
    };
    match server.studio.save(&base, &text) {
        Ok(()) => StatusCode::OK.into_response(),
        Err(SaveError::Changed(sentence)) => (StatusCode::CONFLICT, sentence).into_response(),
        Err(SaveError::Failed(sentence)) => (StatusCode::UNPROCESSABLE_ENTITY, sentence).into_response(),
    }
}
