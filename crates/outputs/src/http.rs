//! What the web servers of this room have in common: an address, one thread for all requests, an end. Called by `view` and
//! `metrics`.

use std::io;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Router;
use tokio::net::TcpListener;
use tokio::runtime::Runtime;

/// A server that listens and answers nothing yet.
pub(super) struct Listening {
    runtime: Runtime,
    listener: TcpListener,
    /// Where it listens.
    pub(super) address: SocketAddr,
}

impl Listening {
    /// Listens at an address; port 0 takes any free one.
    ///
    /// # Errors
    /// The system's, where the address cannot be listened on.
    pub(super) fn at(address: SocketAddr) -> io::Result<Self> {
        // One thread for all requests: they must not take the cores a publisher on this machine needs.
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let listener = runtime.block_on(TcpListener::bind(address))?;
        let address = listener.local_addr()?;
        Ok(Self { runtime, listener, address })
    }

    /// Answers until `stop` is set, which it is afterwards in any case.
    ///
    /// # Errors
    /// The system's, where nothing can be answered any more.
    pub(super) fn serve(self, router: Router, stop: &AtomicBool) -> io::Result<()> {
        let Self { runtime, listener, .. } = self;
        let served = runtime.block_on(async {
            tokio::select! {
                served = async { axum::serve(listener, router).await } => served,
                () = stopped(stop) => Ok(()),
            }
        });
        stop.store(true, Ordering::Relaxed);
        served
    }
}

async fn stopped(stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}
