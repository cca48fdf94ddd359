//! Answers for the choreographer: the least pitch with which a team still reaches a radius, and the greatest speed at
//! which no handle is too fast.
//!
//! In: a team or a scene. Out: two numbers between which the answer is, proved, with where it is decided. The `plan`
//! command prints them.

mod pitch;
mod speed;
mod trial;

pub use pitch::{LeastPitch, Overlap, least_pitch};
pub use speed::{GreatestSpeed, greatest_speed};

/// A question that has no answer, in one sentence.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct PlanError(String);
