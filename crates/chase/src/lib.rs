//! Chasing an outside time: a running show follows timecode, or a performer with a tracker.
//!
//! [`artnet`], [`mtc`], [`ltc`] and [`psn`] decode bytes from outside, [`timecode`] counts labels.
//! The command `chase` calls this crate.

pub mod artnet;
pub mod ltc;
pub mod mtc;
pub mod psn;
pub mod timecode;
