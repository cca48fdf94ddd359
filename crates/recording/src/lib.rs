//! Recordings: what a run leaves on disk, how it is played again, and the proof that it can be.
//!
//! In: frames, and the commands that led to them. Out: `run --log`'s file, and the verdict of `verify`. [`lines`] is the
//! file's format, [`hash`] what is computed over frames; [`log`] is the loop's end and the thread that writes; [`verify`]
//! plays the show of a file again; [`histograms`] keeps how punctual a run was. Called by the commands `run`, `soak` and
//! `verify`. [`mcap`](mod@mcap) is apart from that: every message, for `record`, and [`replay`] makes frames of them again.
//! docs/recordings.md describes the files for other programs.

pub mod mcap;
pub mod record;
pub mod replay;
