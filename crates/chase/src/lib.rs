//! Chasing an outside time: a running show follows timecode, or a performer with a tracker.
//!
//! [`artnet`], [`mtc`], [`ltc`] and [`psn`] decode bytes from outside, and [`timecode`] counts labels. [`synchronizer`]
//! and [`filter`] turn readings into a position that runs evenly, [`schedule`] turns that into a simulated time, and
//! [`steering`] turns it into commands. All of these are pure. [`track`] projects a tracked performer on the path.
//! [`sources`] has the sockets and streams, and [`live`] the chase itself, which publishes its [`status`].
//!
//! In the other direction a show is the [`master`]: its frames become timecode.

pub mod artnet;
pub mod filter;
pub mod live;
pub mod ltc;
pub mod master;
pub mod mtc;
pub mod psn;
pub mod schedule;
pub mod sources;
pub mod status;
pub mod steering;
pub mod synchronizer;
pub mod timecode;
pub mod track;

#[cfg(test)]
mod simulation;
