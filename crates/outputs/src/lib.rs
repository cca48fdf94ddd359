//! Subscribers that pass a show on: the stage page, lighting desks, sound programs, metrics. [`osc_control`] is the way
//! back.
//!
//! Each is a separate process that handles the events of feeds, so that none can delay the loop.

pub mod design;
mod http;
pub mod metrics;
pub mod monitor;
pub mod osc_control;
pub mod send;
pub mod view;
