//! Answers for the choreographer:
//!
//! - the least pitch with which a team still reaches a radius,
//! - the greatest speed at which no handle is too fast,
//! - the least radius with which a team turns round.
//!
//! In: a team or a scene. Out: two numbers that enclose the answer, proved, and the place that decides it.

mod keep_outs;
mod lines;
mod pitch;
mod speed;
mod trial;
mod turn;
mod turn_trial;

pub use crate::spaced::Spaced;
pub use keep_outs::{Outside, Planned, Stage};
pub use lines::{PitchLine, SpeedLine, TurnLine};
pub use pitch::{LeastPitch, Overlap, certify_least_pitch, least_pitch};
pub use speed::{GreatestSpeed, certify_greatest_speed, greatest_speed};
pub use turn::{LeastTurn, TurnLimit, least_turn};

/// The reason, in one sentence, for a question without an answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct PlanError(String);
