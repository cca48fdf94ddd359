//! The fuzz targets: one function each, from bytes that anyone can write or send to a panic where something is wrong.
//!
//! `tests/fuzz/main.rs` calls them with a fixed number of seeded cases, `fuzz/fuzz_targets/` from libFuzzer. Besides its
//! function a target has the inputs to begin with, and a way to change one that keeps what random bytes would never get
//! right: TOML, checks, lengths, masks.

pub mod bytes;
pub mod certificate;
pub mod command_line;
pub mod control;
pub mod environment;
pub mod log;
mod mcap_records;
pub mod page;
pub mod recording;
pub mod scene;

#[path = "../../commands/certify/changes.rs"]
mod changes;
#[path = "../../commands/certify/truth.rs"]
mod truth;

use std::time::Duration;

use fastrand::Rng;

/// A target.
pub struct Target {
    /// Its name, which is that of its folder in the corpus and of its file in `fuzz/fuzz_targets`.
    pub name: &'static str,
    /// Panics where something is wrong. Whether the input got in: it was not refused at once.
    pub run: fn(&[u8]) -> bool,
    /// What to begin with, besides the corpus.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Another input from one that there is.
    pub mutate: fn(&[u8], &mut Rng) -> Vec<u8>,
    /// Cases that a second has room for, roughly: how many are run.
    pub cases: u64,
    /// After so long a case has hung: some hundred times the slowest, for a machine that is busy.
    pub hung: Duration,
}

/// All targets.
pub const TARGETS: [Target; 8] = [
    scene::TARGET,
    control::TARGET,
    page::TARGET,
    recording::TARGET,
    log::TARGET,
    certificate::TARGET,
    environment::TARGET,
    command_line::TARGET,
];
