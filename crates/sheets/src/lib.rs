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

pub use csv::csv;
pub use words::Language;
