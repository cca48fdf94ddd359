//! The stage's geometry: the path the handles ride, the rectangle of a board, the separation of two boards.
//!
//! Pure functions of numbers: no clock, no input or output, no knowledge of teams or scenes. [`crate::chain`] and
//! [`crate::events`] call it. Points and vectors are nalgebra's, in metres, frame `stage` (x right, y up).

pub mod path;
pub mod pieces;
pub mod rectangle;
pub mod root;
pub mod separation;
pub mod spiral;

/// A place on the stage, metres.
pub type Point = nalgebra::Point2<f64>;
/// A displacement on the stage, metres, or a direction.
pub type Vector = nalgebra::Vector2<f64>;
