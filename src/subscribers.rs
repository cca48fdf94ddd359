//! Programs that watch a running publisher from another process. They know the messages only, never the solver.

pub mod connection;
pub mod monitor;
pub mod soak;
pub mod view;
