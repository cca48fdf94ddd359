//! Chasing an outside time: a running show follows timecode, or a performer with a tracker.
//!
//! [`artnet`], [`mtc`], [`ltc`] and [`psn`] decode bytes from outside, [`timecode`] counts labels.
//! [`synchronizer`] and [`filter`] turn readings into a position that runs evenly, [`schedule`] turns that into a
//! simulated time, [`steering`] into commands. All of these are pure. The command `chase` calls this crate.

pub mod artnet;
pub mod filter;
pub mod ltc;
pub mod mtc;
pub mod psn;
pub mod schedule;
pub mod steering;
pub mod synchronizer;
pub mod timecode;

#[cfg(test)]
mod simulation;
