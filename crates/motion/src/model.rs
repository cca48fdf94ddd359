//! The model of the stage: curves, the path made of them, the board, the separation of two boards, root finding.
//!
//! Pure functions of numbers: no clock, no input or output, no team in motion, no scene file. Every other room calls it.
//! Points and vectors are nalgebra's, in metres, frame `stage` (x right, y up).

pub mod board;
pub mod curve;
pub mod description;
pub mod double_double;
pub mod path;
pub mod root;
pub mod separation;
pub mod spiral;
pub mod team;

/// A place on the stage, metres.
pub type Point = nalgebra::Point2<f64>;
/// A displacement on the stage, metres, or a direction.
pub type Vector = nalgebra::Vector2<f64>;
