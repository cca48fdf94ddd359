//! Hand-outs for the people who carry the benches: pages to print, and the same rows as CSV.
//!
//! In: a scene, its events and least clearances. Out: one HTML text and one CSV text. Pure. [`walk`] follows every
//! bench through the show, [`page`] writes what it found.

#![deny(missing_docs)]

mod csv;
mod map;
pub mod page;
mod piece;
mod place;
mod stop;
pub mod walk;
mod words;

use std::ops::Range;

use bench_dragon_motion::event::Progress;
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_show::scene::Scene;

pub use csv::csv;
use walk::{Searched, Walk};
pub use words::Language;

/// Follows all benches of a scene for the pages of `benches`, those of each dragon counted from 0.
///
/// A walk that `progress` stops is of no use.
pub fn followed<'s>(
    scene: &'s Scene,
    timeline: &Timeline,
    searched: &Searched<'_>,
    benches: &[Range<usize>],
    progress: Progress<'_>,
) -> Walk<'s> {
    let is_drawn = |bench| {
        let Some((dragon, bench)) = scene.ensemble.owner(bench) else { return false };
        bench == 0 || page::pages(&benches[dragon]).any(|(middle, _)| middle == bench)
    };
    Walk::new(scene, timeline, searched, is_drawn, progress)
}

/// Writes a time of the show as minutes and seconds.
pub fn minutes_and_seconds(time: f64) -> String {
    let seconds = time.round() as u64;
    format!("{}:{:02}", seconds / 60, seconds % 60)
}
