//! The part of a plan that is about the keep-outs of the scene's stage.

use bench_dragon::certify::plan::{Outside, Planned, Spaced, is_on_stage, outside_keep_outs};
use bench_dragon::motion::Motion;
use bench_dragon::motion::event::Progress;

/// The answer for a scene with obstacles.
pub(super) enum Stage {
    /// The scene has no obstacles, or its path is not the one that is planned.
    None,
    /// With this number boards stay outside the keep-outs.
    Outside(Outside),
    /// No such number was found, or it was not proved.
    NotFound,
}

impl Stage {
    /// Searches from the answer for the boards alone on.
    pub fn search(
        motion: &Motion,
        asked: Spaced<'_>,
        planned: Planned,
        value: Option<f64>,
        progress: Progress<'_>,
    ) -> Self {
        if motion.ground().is_empty() {
            return Self::None;
        }
        if !is_on_stage(motion, planned) {
            log::warn!("the plan leaves out the obstacles of the scene, whose path is of another kind");
            return Self::None;
        }
        let outside = value.and_then(|value| outside_keep_outs(asked, motion, planned, value, progress));
        outside.map_or(Self::NotFound, Self::Outside)
    }

    /// Returns the number with which boards stay outside, if obstacles may change the answer `value`.
    pub fn value(&self, value: Option<f64>) -> Option<f64> {
        match self {
            Self::None => value,
            Self::Outside(outside) => Some(outside.value),
            Self::NotFound => None,
        }
    }

    /// Returns the name of the obstacle that decides.
    pub fn obstacle(&self, motion: &Motion) -> Option<String> {
        let Self::Outside(Outside { obstacle: Some(number), .. }) = self else { return None };
        Some(motion.ground().obstacles().get(*number)?.name.clone())
    }

    /// Returns the sentence about the stage. `what` is the number that is planned, `value` the answer for the boards.
    pub fn sentence(&self, motion: &Motion, what: &str, value: Option<f64>) -> Option<String> {
        let outside = match self {
            Self::None => return None,
            Self::NotFound => {
                return Some(format!(
                    "No {what} was found with which all boards are proved to stay outside the keep-outs."
                ));
            }
            Self::Outside(outside) => outside,
        };
        Some(if Some(outside.value) == value {
            "On the scene's stage all boards stay outside the keep-outs, which is proved too.".to_owned()
        } else {
            let below = match self.obstacle(motion) {
                Some(name) => format!("with a {what} just below, a board is in the keep-out of the {name}"),
                None => format!("with a {what} just below, boards alone are in the way, or it could not be decided"),
            };
            format!(
                "On the scene's stage {} m is the least {what} found with which all boards stay outside the keep-outs, \
                 which is proved; that no smaller one does is not proved: {below}.",
                outside.value
            )
        })
    }
}
