//! Programs that watch a running publisher from another process. They know the messages only, never the solver.

pub mod connection;
pub mod hermite;
pub mod monitor;
#[cfg(feature = "cli")]
pub mod soak;
#[cfg(feature = "cli")]
pub mod view;
