//! The figures of running publishers for Prometheus, over HTTP. In: the services of one name or several, as a
//! subscriber. Out: text at `/metrics`, in which the label `name` distinguishes the publishers.
//!
//! A [`Monitor`] of each publisher handles all events, on one thread besides the server's, because ports cannot leave
//! the thread that created them. Each request gets the figures of that moment: `families` has their list, `exposition`
//! the text.

pub mod exposition;
pub mod families;

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{Next, from_fn};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use exposition::{Family, Format, render};
use families::{families, joined};

use super::http::Listening;
use super::view::origin::Admission;
use crate::monitor::Monitor;
use bench_dragon_client::clock::monotonic_ns;
use bench_dragon_client::feed::{Delivery, FeedEvent};
use bench_dragon_client::polling::{Handler, poll_until};
use bench_dragon_client::shared_memory::{OpenError, service_name};

/// The reason why the figures cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum MetricsError {
    /// The publisher's services cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The server cannot listen at the address.
    #[error(
        "cannot serve metrics at {address}: {source}; choose a free port and an address of this machine with --listen"
    )]
    Listen {
        /// The address given.
        address: SocketAddr,
        /// The system's error.
        source: std::io::Error,
    },
}

#[derive(Clone)]
struct Server {
    names: Arc<[String]>,
    /// One for each name.
    monitors: Arc<[Mutex<Monitor>]>,
}

impl Server {
    fn new(names: &[String]) -> Self {
        Self { names: names.into(), monitors: names.iter().map(|_| Mutex::default()).collect() }
    }

    /// Returns every publisher's figures, each family once.
    fn families(&self) -> Vec<Family> {
        // After a panic the monitor still has the latest figures.
        let report = |monitor: &Mutex<Monitor>| monitor.lock().unwrap_or_else(PoisonError::into_inner).report();
        joined(self.names.iter().zip(&*self.monitors).map(|(name, monitor)| families(name, &report(monitor))))
    }
}

impl Handler for Server {
    fn handle(&mut self, publisher: usize, event: FeedEvent<'_>) {
        let received_ns = monotonic_ns();
        if let Some(monitor) = self.monitors.get(publisher) {
            monitor.lock().unwrap_or_else(PoisonError::into_inner).handle(&event, received_ns);
        }
    }

    fn polled(&mut self, _now: Instant) {}
}

/// Serves the figures of the publishers `names` at `address` until `stop` is set; port 0 takes any free one. `ready` is
/// called with the address once requests are answered.
///
/// # Errors
/// [`MetricsError`] for a name or an address that cannot be used.
pub fn serve<Refused: From<MetricsError>>(
    names: &[String],
    address: SocketAddr,
    stop: &Arc<AtomicBool>,
    ready: impl FnOnce(SocketAddr) -> Result<(), Refused>,
) -> Result<(), Refused> {
    names.iter().try_for_each(|name| service_name(name, "poses").map(drop)).map_err(MetricsError::from)?;
    let listen = |source| MetricsError::Listen { address, source };
    let listening = Listening::at(address).map_err(listen)?;
    let admission = Admission { loopback: listening.address.ip().is_loopback(), origins: Vec::new() };
    ready(listening.address)?;
    let server = Server::new(names);
    let reader = std::thread::spawn({
        let (names, mut handler, stop) = (Arc::clone(&server.names), server.clone(), Arc::clone(stop));
        move || {
            // Every frame, so that a gap means a lost frame.
            let read = poll_until(&stop, &names, Delivery::All, &mut handler);
            stop.store(true, Ordering::Relaxed);
            read
        }
    });
    let router = Router::new()
        .route("/", get(|| async { "The metrics of bench-dragon are at /metrics.\n" }))
        .route("/metrics", get(metrics))
        .layer(from_fn(move |request, next| own_host(admission.clone(), request, next)))
        .with_state(server);
    let served = listening.serve(router, stop);
    // A panic of the reader has already been printed.
    let read = reader.join().unwrap_or(Ok(()));
    served.map_err(listen)?;
    Ok(read.map_err(MetricsError::from)?)
}

/// Refuses a foreign name that resolves to this machine: a page of that name could read the figures.
async fn own_host(admission: Admission, request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST).and_then(|host| host.to_str().ok());
    if !admission.allows_host(host) {
        return (StatusCode::FORBIDDEN, "this server has another name").into_response();
    }
    next.run(request).await
}

async fn metrics(State(server): State<Server>, headers: HeaderMap) -> Response {
    let accept = headers.get_all(header::ACCEPT).iter().filter_map(|accept| accept.to_str().ok());
    let format = Format::accepted(&accept.collect::<Vec<_>>().join(","));
    let text = render(&server.families(), format);
    ([(header::CONTENT_TYPE, format.content_type()), (header::CACHE_CONTROL, "no-store")], text).into_response()
}
