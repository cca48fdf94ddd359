//! The common part of the web servers of `view` and `metrics`: an address, one thread for all requests, an end.

use std::io;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Router;
use axum::serve::ListenerExt;
use tokio::net::TcpListener;
use tokio::runtime::Runtime;

/// A server that listens and does not answer yet.
pub(super) struct Listening {
    runtime: Runtime,
    listener: TcpListener,
    /// The address it listens at.
    pub(super) address: SocketAddr,
}

impl Listening {
    /// Listens at an address; port 0 takes any free one.
    ///
    /// # Errors
    /// The system's error, if the server cannot listen at the address.
    pub(super) fn at(address: SocketAddr) -> io::Result<Self> {
        // One thread for all requests: they must leave the other cores to a publisher on this machine.
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let listener = runtime.block_on(TcpListener::bind(address))?;
        let address = listener.local_addr()?;
        Ok(Self { runtime, listener, address })
    }

    /// Answers requests until `stop` is set. `stop` is set afterwards in any case.
    ///
    /// # Errors
    /// The system's error, if no request can be answered any more.
    pub(super) fn serve(self, router: Router, stop: &AtomicBool) -> io::Result<()> {
        let Self { runtime, listener, .. } = self;
        // A small message after another one would wait for 40 ms until the first is acknowledged (Nagle's algorithm).
        let listener = listener.tap_io(|stream| {
            let _ = stream.set_nodelay(true);
        });
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
