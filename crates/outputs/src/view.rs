//! The live stage picture: reads the frames of one publisher or several and serves them to browsers, with the page that
//! draws them.
//!
//! `reader` reads a publisher's shared memory on a separate thread, because ports cannot leave the thread that created
//! them, and hands over the newest picture. `browser` sends the picture to one browser at its pace, over one WebSocket
//! for each publisher; `wire` is its layout. `origin` decides which pages may connect, `authorization` which browsers
//! may command; `certificates` has the proofs of scenes, `facts` the facts that take time to compute, and `scrub` the
//! frames at times that a browser requests.

mod authorization;
mod browser;
mod certificates;
mod facts;
pub(crate) mod origin;
mod reader;
mod scrub;
pub(crate) mod wire;

use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Router;
use axum::body::Bytes;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{Utf8Bytes, WebSocketUpgrade};
use axum::extract::{Query, Request, State as Served};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::get;
use tokio::sync::watch;
use tower_http::services::ServeDir;

use super::http::Listening;
use authorization::Authorization;
pub use authorization::Token;
use bench_dragon_client::connection::Wake;
use bench_dragon_client::feed::{Delivery, Feed, FeedOptions};
use bench_dragon_client::shared_memory::{OpenError, service_name};
use bench_dragon_client::shows;
pub use certificates::{Certificate, Proofs, SceneHash};
pub use facts::{ClearanceCurve, Facts, LeastOfShow, SceneFacts};
use origin::Admission;
pub use origin::AllowedOrigin;
pub use scrub::{OpenScene, SceneFrames};
use scrub::{SceneInPlay, Scrubber};

/// The kinds of the page's files.
pub(crate) const HTML: &str = "text/html; charset=utf-8";
pub(crate) const SCRIPT: &str = "text/javascript; charset=utf-8";
pub(crate) const STYLE: &str = "text/css; charset=utf-8";
/// Browsers send requests of a few letters.
const MAX_REQUEST_BYTES: usize = 1024;
/// Waking the server at each frame would cost the publisher more than the frame itself.
const FEED: FeedOptions = FeedOptions { wake: Wake::Never, frames: Delivery::Newest };

/// The newest messages that a browser needs, each in its wire format; empty if there is none.
#[derive(Debug, Clone, Default, PartialEq)]
struct Picture {
    /// Set while there is no publisher.
    waiting: Utf8Bytes,
    stage: Utf8Bytes,
    alert: Utf8Bytes,
    facts: Utf8Bytes,
    chase: Utf8Bytes,
    /// The latest cues, each with its number among all cues of this server, so that none is left out.
    cues: Arc<[(u64, Utf8Bytes)]>,
    frame: Bytes,
    /// The scene that is played, once its text has come.
    scene: Option<Arc<SceneInPlay>>,
    /// True if frames are stamped by the clock of this machine; `None` while there is no publisher.
    shares_clock: Option<bool>,
}

impl Picture {
    /// Returns the picture without a publisher, with the reason if a publisher cannot be used.
    fn waiting(reason: Option<&str>) -> Self {
        Self { waiting: wire::waiting(reason, &shows::running()).into(), ..Self::default() }
    }
}

#[derive(Clone)]
struct Server {
    channels: Arc<[Channel]>,
    scrubber: Arc<Scrubber>,
    admission: Arc<Admission>,
}

/// The data of one publisher that browsers are served.
#[derive(Clone)]
struct Channel {
    name: String,
    pictures: watch::Receiver<Picture>,
    /// `None` if no browser may command.
    authorization: Option<Arc<Authorization>>,
}

/// The options of the server.
#[derive(Debug, Clone)]
pub struct ViewOptions {
    /// The address to listen at; port 0 takes any free port.
    pub address: SocketAddr,
    /// True if browsers may send commands.
    pub control: bool,
    /// The admitted origins of other pages.
    pub origins: Vec<AllowedOrigin>,
    /// A folder that is served below `/pages/`.
    pub pages: Option<PathBuf>,
    /// The proofs of scenes; they may grow while pages are served.
    pub proofs: Arc<Proofs>,
    /// The facts about scenes that are computed while pages are served.
    pub facts: Arc<Facts>,
    /// The function that opens a scene for frames at other times.
    pub open_scene: OpenScene,
}

/// The data that browsers need to connect.
#[derive(Debug, Clone)]
pub struct Ready {
    /// The address of the server.
    pub address: SocketAddr,
    /// The token for commands. The token is needed if more than this machine's own page is admitted.
    pub token: Option<Token>,
}

/// The reason why the stage picture cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The publisher's services cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The server cannot listen at the address.
    #[error(
        "cannot serve the stage picture at {address}: {source}; choose a free port with --port and an address of this \
         machine with --listen"
    )]
    Listen {
        /// The address given.
        address: SocketAddr,
        /// The system's error.
        source: std::io::Error,
    },
    /// The folder of pages cannot be read.
    #[error("--pages {}: {source}, expected a folder", folder.display())]
    Pages {
        /// The folder given.
        folder: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// No token can be created.
    #[error("the system has no random numbers for a token: {0}")]
    Token(#[from] getrandom::Error),
}

/// Serves the picture of the publishers `names` until `stop` is set. `ready` is called once browsers can connect.
///
/// # Errors
/// [`ViewError`] for a name, an address or a folder that cannot be used.
pub fn serve<Refused: From<ViewError>>(
    names: &[String],
    options: ViewOptions,
    stop: &Arc<AtomicBool>,
    ready: impl FnOnce(&Ready) -> Result<(), Refused>,
) -> Result<(), Refused> {
    let ViewOptions { address, control, origins, pages, proofs, facts, open_scene } = options;
    names.iter().try_for_each(|name| service_name(name, "poses").map(drop)).map_err(ViewError::from)?;
    if let Some(folder) = &pages {
        std::fs::read_dir(folder).map_err(|source| ViewError::Pages { folder: folder.clone(), source })?;
    }
    let listen = |source| ViewError::Listen { address, source };
    let server = Listening::at(address).map_err(listen)?;
    let address = server.address;
    let loopback = address.ip().is_loopback();
    let needs_token = control && (!loopback || !origins.is_empty());
    let token = if needs_token { Some(Token::random().map_err(ViewError::from)?) } else { None };
    let authorization = |name: &str| control.then(|| Authorization::new(name, token.clone()).map(Arc::new)).transpose();
    let authorizations = names.iter().map(|name| authorization(name)).collect::<Result<Vec<_>, _>>().map_err(listen)?;
    ready(&Ready { address, token: token.clone() })?;
    let (mut channels, mut readers) = (Vec::new(), Vec::new());
    for (name, authorization) in names.iter().zip(authorizations) {
        let (sender, pictures) = watch::channel(Picture::default());
        channels.push(Channel { name: name.clone(), pictures, authorization });
        let (name, stop) = (name.clone(), Arc::clone(stop));
        let (proofs, facts) = (Arc::clone(&proofs), Arc::clone(&facts));
        readers.push(std::thread::spawn(move || {
            let read = Feed::new(&name, FEED).map(|feed| reader::read(feed, &name, &proofs, &facts, &sender, &stop));
            stop.store(true, Ordering::Relaxed);
            read
        }));
    }
    let admission = Arc::new(Admission { loopback, origins });
    let scrubber = Arc::new(Scrubber::new(open_scene));
    let router = router(Server { channels: channels.into(), scrubber, admission }, pages.as_deref());
    let served = server.serve(router, stop);
    // A panic of a reader has already been printed.
    let read = readers.into_iter().try_for_each(|reader| reader.join().unwrap_or(Ok(())));
    served.map_err(listen)?;
    Ok(read.map_err(ViewError::from)?)
}

/// Returns a file of the user's folder; not found for a name that no file can have.
async fn own_file<B>(found: impl Future<Output = io::Result<Response<B>>>) -> Response
where
    Response<B>: IntoResponse,
{
    match found.await {
        Ok(file) => file.into_response(),
        Err(error) if error.kind() == io::ErrorKind::InvalidFilename => StatusCode::NOT_FOUND.into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

fn router(server: Server, pages: Option<&Path>) -> Router {
    let names = publishers_module(&server.channels);
    let mut router = Router::new();
    if let Some(folder) = pages {
        let mut files = ServeDir::new(folder);
        let own = Router::new().fallback(move |request: Request| own_file(files.try_call(request)));
        let own = own.layer(from_fn_with_state(server.clone(), own_page));
        router = router.nest("/pages/", own).route("/pages", get(|| async { Redirect::permanent("pages/") }));
    }
    router
        .merge(modules())
        .route("/", get(|| async { served(HTML, include_str!("view/index.html")) }))
        .route("/publishers.js", get(move || async move { served(SCRIPT, names) }))
        .route("/frames", get(frames))
        .route("/scrub", get(scrubbed))
        .with_state(server)
}

/// Returns the files of the page besides its document, which the design page loads too.
pub(crate) fn modules<S: Clone + Send + Sync + 'static>() -> Router<S> {
    let file = |kind, text| get(move || async move { served(kind, text) });
    Router::new()
        .route("/address.js", file(SCRIPT, include_str!("view/address.js")))
        .route("/boards.js", file(SCRIPT, include_str!("view/boards.js")))
        .route("/camera.js", file(SCRIPT, include_str!("view/camera.js")))
        .route("/cameras.js", file(SCRIPT, include_str!("view/cameras.js")))
        .route("/curve.js", file(SCRIPT, include_str!("view/curve.js")))
        .route("/dragon.js", file(SCRIPT, include_str!("view/dragon.js")))
        .route("/dragon_figure.js", file(SCRIPT, include_str!("view/dragon_figure.js")))
        .route("/dragon_head.js", file(SCRIPT, include_str!("view/dragon_head.js")))
        .route("/drawing.js", file(SCRIPT, include_str!("view/drawing.js")))
        .route("/hermite.js", file(SCRIPT, include_str!("view/hermite.js")))
        .route("/key_switch.js", file(SCRIPT, include_str!("view/key_switch.js")))
        .route("/label_layout.js", file(SCRIPT, include_str!("view/label_layout.js")))
        .route("/labels.js", file(SCRIPT, include_str!("view/labels.js")))
        .route("/lantern_light.js", file(SCRIPT, include_str!("view/lantern_light.js")))
        .route("/lantern_view.js", file(SCRIPT, include_str!("view/lantern_view.js")))
        .route("/lanterns.js", file(SCRIPT, include_str!("view/lanterns.js")))
        .route("/lock.js", file(SCRIPT, include_str!("view/lock.js")))
        .route("/marks.js", file(SCRIPT, include_str!("view/marks.js")))
        .route("/measure.js", file(SCRIPT, include_str!("view/measure.js")))
        .route("/pace.js", file(SCRIPT, include_str!("view/pace.js")))
        .route("/palette.js", file(SCRIPT, include_str!("view/palette.js")))
        .route("/panel.js", file(SCRIPT, include_str!("view/panel.js")))
        .route("/pointer_input.js", file(SCRIPT, include_str!("view/pointer_input.js")))
        .route("/publisher.js", file(SCRIPT, include_str!("view/publisher.js")))
        .route("/resolution.js", file(SCRIPT, include_str!("view/resolution.js")))
        .route("/roster.js", file(SCRIPT, include_str!("view/roster.js")))
        .route("/scrub.js", file(SCRIPT, include_str!("view/scrub.js")))
        .route("/scrub.css", file(STYLE, include_str!("view/scrub.css")))
        .route("/seat.js", file(SCRIPT, include_str!("view/seat.js")))
        .route("/seat_sprites.js", file(SCRIPT, include_str!("view/seat_sprites.js")))
        .route("/seat_view.js", file(SCRIPT, include_str!("view/seat_view.js")))
        .route("/show.js", file(SCRIPT, include_str!("view/show.js")))
        .route("/signs.js", file(SCRIPT, include_str!("view/signs.js")))
        .route("/sound.js", file(SCRIPT, include_str!("view/sound.js")))
        .route("/sprites.js", file(SCRIPT, include_str!("view/sprites.js")))
        .route("/stage.js", file(SCRIPT, include_str!("view/stage.js")))
        .route("/stream.js", file(SCRIPT, include_str!("view/stream.js")))
        .route("/transport.js", file(SCRIPT, include_str!("view/transport.js")))
        .route("/village.js", file(SCRIPT, include_str!("view/village.js")))
        .route("/words.js", file(SCRIPT, include_str!("view/words.js")))
        .route("/style.css", file(STYLE, include_str!("view/style.css")))
        .route("/conduct.js", file(SCRIPT, include_str!("view/conduct.js")))
        .route("/conduct.css", file(STYLE, include_str!("view/conduct.css")))
}

/// Returns the module with the names of the publishers that the page draws.
fn publishers_module(channels: &[Channel]) -> String {
    let names: Vec<_> = channels.iter().map(|channel| &channel.name).collect();
    // JSON is JavaScript.
    format!("export const publishers = {};\n", serde_json::json!(names))
}

/// Returns a file of the page, which loads nothing from other servers.
pub(crate) fn served(kind: &'static str, text: impl IntoResponse) -> Response {
    let headers = [
        (header::CONTENT_TYPE, kind),
        (header::CACHE_CONTROL, "no-cache"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::CONTENT_SECURITY_POLICY, "default-src 'self'; connect-src 'self' ws:; img-src data:"),
    ];
    (headers, text).into_response()
}

/// Returns a file of the user. A foreign name that resolves to this machine is refused.
async fn own_page(Served(server): Served<Server>, request: Request, next: Next) -> Response {
    if !server.admission.allows_host(text_of(request.headers(), header::HOST)) {
        return (StatusCode::FORBIDDEN, "this server has another name").into_response();
    }
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    response
}

pub(crate) fn text_of(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

/// The fields of a query.
type Fields = Vec<(String, String)>;

fn field<'f>(query: &'f Fields, wanted: &str) -> Option<&'f str> {
    query.iter().find(|(field, _)| field == wanted).map(|(_, value)| value.as_str())
}

impl Server {
    /// Returns the publisher that a page from an admitted origin may watch.
    #[allow(clippy::result_large_err, reason = "the error is the answer")]
    fn watched(&self, headers: &HeaderMap, query: &Fields) -> Result<Channel, Response> {
        if !self.admission.allows(text_of(headers, header::ORIGIN), text_of(headers, header::HOST)) {
            let sentence = "a page from elsewhere may not watch the stage picture; view --allow-origin lets it in";
            return Err((StatusCode::FORBIDDEN, sentence).into_response());
        }
        let mut channels = self.channels.iter();
        let channel = match field(query, "name") {
            None => channels.next(),
            Some(name) => channels.find(|channel| channel.name == name),
        };
        let unknown = "name: expected one of the publishers that this server was started for";
        channel.cloned().ok_or_else(|| (StatusCode::NOT_FOUND, unknown).into_response())
    }
}

type Upgrade = Result<WebSocketUpgrade, WebSocketUpgradeRejection>;

/// Returns the upgrade to a WebSocket with small requests; `instead` answers another request.
#[allow(clippy::result_large_err, reason = "the error is the answer")]
fn upgraded(upgrade: Upgrade, instead: &'static str) -> Result<WebSocketUpgrade, Response> {
    let upgrade = upgrade.map_err(|_| (StatusCode::UPGRADE_REQUIRED, instead).into_response())?;
    Ok(upgrade.max_frame_size(MAX_REQUEST_BYTES).max_message_size(MAX_REQUEST_BYTES))
}

async fn frames(
    Served(server): Served<Server>,
    headers: HeaderMap,
    Query(query): Query<Fields>,
    upgrade: Upgrade,
) -> Result<Response, Response> {
    let channel = server.watched(&headers, &query)?;
    let Some(gap) = gap(field(&query, "rate")) else {
        return Err((StatusCode::BAD_REQUEST, "rate: expected 1 to 1000000 frames a second").into_response());
    };
    let upgrade = upgraded(upgrade, "frames come over a WebSocket: open ws://.../frames")?;
    Ok(upgrade.on_upgrade(move |socket| browser::serve(socket, channel, gap)))
}

async fn scrubbed(
    Served(server): Served<Server>,
    headers: HeaderMap,
    Query(query): Query<Fields>,
    upgrade: Upgrade,
) -> Result<Response, Response> {
    let channel = server.watched(&headers, &query)?;
    let upgrade = upgraded(upgrade, "frames come over a WebSocket: open ws://.../scrub")?;
    Ok(upgrade.on_upgrade(move |socket| scrub::serve(socket, channel.pictures, server.scrubber)))
}

/// Returns the least time between two frames at a requested `rate`, zero without a rate; `None` for an invalid rate.
fn gap(rate: Option<&str>) -> Option<Duration> {
    match rate.map(str::parse::<f64>) {
        None => Some(Duration::ZERO),
        Some(Ok(rate)) if (1.0..=1e6).contains(&rate) => Some(Duration::from_secs_f64(rate.recip())),
        Some(_) => None,
    }
}
