//! Programs that follow a running publisher from another process: all that a subscriber in Rust compiles.
//!
//! [`feed`] is the one source of a publisher's messages; [`hermite`] interpolates between frames; [`control`] sends
//! commands. It also has the senders of single messages that a publisher and a chase share. This crate knows the messages
//! and no solver.

pub mod clock;
pub mod connection;
pub mod control;
pub mod feed;
pub mod hermite;
pub mod layouts;
pub mod polling;
pub mod shared_memory;
pub mod shows;
