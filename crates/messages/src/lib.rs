//! The messages between a publisher and its subscribers.
//!
//! [`layouts`] are the structs in shared memory. [`state`], [`control`] and [`chase`] have the types of their numbers.
//! [`json`] and [`sentence`] are the same messages for programs and for people. This crate knows no transport and no
//! solver: publisher and subscribers both depend on it.

mod accessors;
pub mod chase;
pub mod control;
pub mod json;
pub mod layouts;
mod list;
mod roster;
pub mod sentence;
mod stage_message;
pub mod state;

pub use layouts::*;
pub use list::List;
pub use roster::Roster;
pub use stage_message::StageMessage;

/// The bytes that one queue of frames, or one topic's history, takes by default at most: 64 MB.
pub const QUEUE_BYTES: usize = 64_000_000;
