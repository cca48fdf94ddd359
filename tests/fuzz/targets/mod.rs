//! The fuzz targets: one function each, from bytes that any user or client can write or send to a panic if there is an
//! error.
//!
//! `tests/fuzz/main.rs` calls them with a fixed number of seeded cases, `fuzz/fuzz_targets/` from libFuzzer. Besides
//! its function a target has initial inputs, and a way to change an input. The change keeps parts which random bytes
//! would never get right: TOML, checks, lengths, masks.

pub mod bytes;
pub mod certificate;
mod certificate_changes;
pub mod command_line;
pub mod control;
pub mod design_page;
pub mod environment;
pub mod log;
mod mcap_records;
pub mod page;
pub mod recording;
pub mod scene;
pub mod timecode;

#[path = "../../commands/certify/changes.rs"]
mod changes;
#[path = "../../commands/certify/truth.rs"]
mod truth;

use fastrand::Rng;

/// A target.
pub struct Target {
    /// Its name, which is also the name of its folder in the corpus and of its file in `fuzz/fuzz_targets`.
    pub name: &'static str,
    /// Panics if there is an error. Returns true if the input was accepted, that is, not refused at once.
    pub run: fn(&[u8]) -> bool,
    /// Returns the initial inputs, besides the corpus.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Returns a changed input.
    pub mutate: fn(&[u8], &mut Rng) -> Vec<u8>,
    /// Number of cases, some seconds of work at most.
    pub cases: u64,
}

/// All targets.
pub const TARGETS: [Target; 10] = [
    scene::TARGET,
    control::TARGET,
    page::TARGET,
    recording::TARGET,
    log::TARGET,
    certificate::TARGET,
    environment::TARGET,
    command_line::TARGET,
    timecode::TARGET,
    design_page::TARGET,
];
