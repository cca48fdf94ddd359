//! Numbers of a scene changed until the show keeps the distances that it must keep, with the greatest margin found.
//!
//! In: a scene's text, the names of the numbers that may change, their ranges. Out: the numbers, the text with these
//! numbers alone changed, the margin, and what limits it. A margin is exact ([`judge`]); that no greater one exists is
//! not proved ([`search`]).

#![deny(missing_docs)]

pub mod judge;
pub mod line;
pub mod search;
