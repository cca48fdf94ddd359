//! Subscribers that pass a show on: the stage page, lighting desks, sound programs, metrics.
//!
//! Each is a process of its own that handles the events of one feed: none can hurt the loop.

mod http;
pub mod keys;
pub mod metrics;
pub mod monitor;
pub mod send;
pub mod view;
