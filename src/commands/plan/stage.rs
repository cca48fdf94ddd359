//! The part of a plan that is about the keep-outs of the scene's stage.

use bench_dragon::certify::plan::{Planned, Spaced, Stage};
use bench_dragon::motion::Motion;
use bench_dragon::motion::event::Progress;

/// Searches from `value`, the answer for the boards alone, on. Warns of obstacles that are left out.
pub(super) fn on_stage(
    motion: &Motion,
    asked: Spaced<'_>,
    planned: Planned,
    value: Option<f64>,
    progress: Progress<'_>,
) -> Stage {
    let stage = Stage::search(motion, asked, planned, value, progress);
    if stage == Stage::OtherPath {
        log::warn!("the plan leaves out the obstacles of the scene, whose path is of another kind");
    }
    stage
}

/// Returns the sentence about the stage. `what` is the number that is planned, `value` the answer for the boards.
pub(super) fn stage_sentence(stage: &Stage, motion: &Motion, what: &str, value: Option<f64>) -> Option<String> {
    let outside = match stage {
        Stage::Empty | Stage::OtherPath => return None,
        Stage::NotFound => {
            return Some(format!(
                "No {what} was found with which all boards are proved to stay outside the keep-outs."
            ));
        }
        Stage::Outside(outside) => outside,
    };
    if Some(outside.value) == value {
        return Some("On the scene's stage all boards stay outside the keep-outs, which is proved too.".to_owned());
    }
    let below = match stage.obstacle(motion) {
        Some(name) => format!("with a {what} just below, a board is in the keep-out of the {name}"),
        None => format!("with a {what} just below, boards alone are in the way, or it could not be decided"),
    };
    Some(format!(
        "On the scene's stage {} m is the least {what} found with which all boards stay outside the keep-outs, which is \
         proved; that no smaller one does is not proved: {below}.",
        outside.value
    ))
}
