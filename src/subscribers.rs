//! Programs in processes of their own that subscribe to a running publisher. They know the messages only, never the
//! solver.
//!
//! Each is a handler of the events of one [`feed`]: a new one needs a file for itself and its line in the list of
//! commands.

pub mod connection;
pub mod control;
pub mod feed;
pub mod hermite;
#[cfg(feature = "cli")]
mod http;
#[cfg(feature = "cli")]
pub mod keys;
#[cfg(feature = "cli")]
pub mod metrics;
pub mod monitor;
pub mod polling;
#[cfg(feature = "cli")]
pub mod record;
#[cfg(feature = "cli")]
pub mod send;
#[cfg(feature = "cli")]
pub mod soak;
#[cfg(feature = "cli")]
pub mod view;
