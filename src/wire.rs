//! The wire: what publishers and subscribers exchange, and how the program's own types get there and back.
//!
//! [`layouts`] depends on nothing else; [`convert`] is the one place where frames, alerts, motions and states become
//! layouts and back; [`json`] and [`sentence`] are the same messages for programs and for people. In: a frame, an alert,
//! a motion. Out: messages. Called by the loop, the transports, the subscribers and the commands.

pub mod convert;
pub mod json;
pub mod layouts;
pub mod sentence;

pub use layouts::*;
