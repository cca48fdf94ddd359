//! Plans that stay outside the keep-outs of a scene's stage.
//!
//! In: a motion on a stage, and the answer for its boards alone. Out: the least number from there on that the search
//! finds, with which boards are proved to stay outside all keep-outs. The scene's path is used from its start.

use std::cell::RefCell;

use super::trial::obstacle;
use super::turn_trial::Family;
use crate::clearance::stays_outside;
use crate::pitch::reaches;
use crate::spaced::Spaced;
use crate::turn::Passage;
use bench_dragon_motion::Motion;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::path::Path;

/// The number of a scene that is planned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Planned {
    /// The pitch of a spiral, with which the head comes in to a radius in metres.
    Pitch {
        /// The radius, in metres.
        radius: f64,
    },
    /// The turn radius of a turnaround with this ratio of the arcs.
    Turn {
        /// The radius of the first arc over the radius of the second.
        arc_ratio: f64,
    },
}

/// A plan with which all boards stay outside the keep-outs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outside {
    /// The pitch or the turn radius, in metres.
    pub value: f64,
    /// The obstacle's number on the stage, the boundary last, if a board is in its keep-out with numbers just below
    /// `value`. `None` if obstacles do not change the answer, or if boards alone are in the way there.
    pub obstacle: Option<usize>,
}

/// The growth from one number to the next that is tried, and the greatest number as a multiple of the first.
const GROWTH: f64 = 1.005;
const MOST: f64 = 20.0;

/// The metres within which the number is found, and that are kept on its far side.
const BESIDE: f64 = 0.45e-9;
const FURTHER: [f64; 3] = [1.0, 10.0, 1000.0];

/// Limit of steps of the head for the proof of one number.
const MOST_STEPS: u64 = 100_000;

/// The answer on the stage of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stage {
    /// The stage has no obstacles.
    Empty,
    /// The scene's path is not the spiral or turnaround that is planned: obstacles are left out.
    OtherPath,
    /// With this number boards stay outside the keep-outs.
    Outside(Outside),
    /// No such number was found, or it was not proved.
    NotFound,
}

impl Stage {
    /// Searches from `value`, the answer for the boards alone, on.
    pub fn search(
        motion: &Motion,
        asked: Spaced<'_>,
        planned: Planned,
        value: Option<f64>,
        progress: Progress<'_>,
    ) -> Self {
        if motion.ground().is_empty() {
            return Self::Empty;
        }
        match (planned, motion.description()) {
            (Planned::Pitch { .. }, PathDescription::Spiral { .. })
            | (Planned::Turn { .. }, PathDescription::Turnaround { .. }) => {}
            _ => return Self::OtherPath,
        }
        let outside = value.and_then(|value| outside_keep_outs(asked, motion, planned, value, progress));
        outside.map_or(Self::NotFound, Self::Outside)
    }

    /// Returns the number with which boards stay outside, if obstacles may change `value`, the answer for the boards.
    pub fn value(&self, value: Option<f64>) -> Option<f64> {
        match self {
            Self::Empty | Self::OtherPath => value,
            Self::Outside(outside) => Some(outside.value),
            Self::NotFound => None,
        }
    }

    /// Returns the name of the obstacle that decides.
    pub fn obstacle<'a>(&self, motion: &'a Motion) -> Option<&'a str> {
        let Self::Outside(Outside { obstacle: Some(number), .. }) = self else { return None };
        Some(&motion.ground().obstacles().get(*number)?.name)
    }
}

/// Returns the least number from `value` on, found in steps of half a percent, with which boards keep their clearance
/// and stay outside the keep-outs of the stage. Returns `None` if none is found, or if that is not proved.
fn outside_keep_outs(
    asked: Spaced<'_>,
    motion: &Motion,
    planned: Planned,
    value: f64,
    progress: Progress<'_>,
) -> Option<Outside> {
    let on_stage = OnStage { asked, motion, planned };
    // A head that starts inside the radius has no way to it.
    on_stage.with(value)?;
    let (mut blocked, mut free, mut last) = (None, value, None);
    while let Some(why) = on_stage.blocked(free, progress) {
        if progress(0.0).is_break() || free > MOST * value {
            return None;
        }
        (blocked, last) = (Some(free), why);
        free *= GROWTH;
    }
    let Some(mut blocked) = blocked else {
        return on_stage.stays_outside(value, progress).then_some(Outside { value, obstacle: None });
    };
    while free - blocked > BESIDE && progress(0.0).is_continue() {
        let middle = 0.5 * (blocked + free);
        match on_stage.blocked(middle, progress) {
            Some(why) => (blocked, last) = (middle, why),
            None => free = middle,
        }
    }
    // Very near an obstacle doubles may not suffice.
    let mut values = FURTHER.into_iter().map(|further| free + further * BESIDE);
    let is_proved =
        |value: &f64| on_stage.are_boards_free(*value, progress) && on_stage.stays_outside(*value, progress);
    values.find(is_proved).map(|value| Outside { value, obstacle: last })
}

/// A plan on a stage.
struct OnStage<'a> {
    asked: Spaced<'a>,
    motion: &'a Motion,
    planned: Planned,
}

impl OnStage<'_> {
    /// Returns the motion with another number, and the travel of the head up to which it counts.
    fn with(&self, value: f64) -> Option<(Motion, f64)> {
        let description = match (self.planned, self.motion.description()) {
            (Planned::Pitch { .. }, PathDescription::Spiral { start_turn, .. }) => {
                PathDescription::Spiral { pitch: value, start_turn: *start_turn }
            }
            (Planned::Turn { arc_ratio }, PathDescription::Turnaround { pitch, lead_in, lead_out, .. }) => {
                let (pitch, lead_in, lead_out) = (*pitch, *lead_in, *lead_out);
                PathDescription::Turnaround { pitch, turn_radius: value, arc_ratio, lead_in, lead_out }
            }
            _ => return None,
        };
        let Self { motion, planned, .. } = self;
        let moved = Motion::new(description, *motion.team(), motion.head_speed(), motion.method()).ok()?;
        let moved = moved.placed(*motion.placement()).on_ground(motion.ground().clone());
        let length = moved.bare_path().length();
        let to = match *planned {
            Planned::Pitch { radius } => length - Path::spiral(value, radius / value).length(),
            Planned::Turn { .. } => length,
        };
        (to > 0.0).then_some((moved, to))
    }

    /// Returns a reason why a number will not do, if the search finds one: an obstacle, or boards alone.
    fn blocked(&self, value: f64, progress: Progress<'_>) -> Option<Option<usize>> {
        let Some((motion, to)) = self.with(value) else { return Some(None) };
        let (obstacles, until) = motion.obstacle_clearances(to, &mut |_| progress(0.0));
        let found = obstacles.iter().enumerate().filter_map(|(number, found)| Some((number, found.as_ref()?.value)));
        if let Some((number, _)) =
            found.filter(|(_, least)| *least <= 0.0).min_by(|one, other| one.1.total_cmp(&other.1))
        {
            return Some(Some(number));
        }
        let is_complete = until >= to && obstacles.len() == motion.ground().obstacles().len();
        (!is_complete || self.are_boards_in_the_way(value, progress)).then_some(None)
    }

    /// Returns true if the search finds boards that are too near, or a link that stalls or locks.
    fn are_boards_in_the_way(&self, value: f64, progress: Progress<'_>) -> bool {
        match self.planned {
            Planned::Pitch { radius } => obstacle(self.asked, value, radius, &mut |_| progress(0.0)).is_some(),
            Planned::Turn { arc_ratio } => {
                let Some(pitch) = self.motion.description().pitch() else { return true };
                let Spaced { team, clearance } = self.asked;
                let progress = RefCell::new(progress);
                let ask = |_| progress.borrow_mut()(0.0);
                Family { team, clearance, pitch, arc_ratio, ask: &ask }.event(value).is_some()
            }
        }
    }

    /// Returns true if boards are proved to keep their clearance from any distance, and no link to stall or lock.
    fn are_boards_free(&self, value: f64, progress: Progress<'_>) -> bool {
        match self.planned {
            Planned::Pitch { radius } => reaches(self.asked, value, radius, MOST_STEPS, false, progress).is_some(),
            Planned::Turn { arc_ratio } => {
                let pitch = self.motion.description().pitch();
                let passage = pitch.and_then(|pitch| Passage::new(self.asked, pitch, arc_ratio, value));
                passage.is_some_and(|passage| passage.is_free(self.asked, true, progress))
            }
        }
    }

    /// Returns true if boards are proved to stay outside the keep-outs.
    fn stays_outside(&self, value: f64, progress: Progress<'_>) -> bool {
        self.with(value).is_some_and(|(motion, to)| stays_outside(&motion, to, progress))
    }
}
