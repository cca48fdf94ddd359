//! Recordings of a show in MCAP, and their replay.
//!
//! [`mcap`](mod@mcap) reads and writes the files, [`record`] is the subscriber that records, [`replay`] is the frame
//! source of a recording, [`verify`] computes its poses again. docs/recordings.md describes the files for other
//! programs.

pub mod mcap;
pub mod record;
pub mod replay;
pub mod verify;
