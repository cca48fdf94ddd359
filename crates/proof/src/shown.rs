//! The claims that the steps of a section make one after another.

use std::fmt::Display;

use super::interval::Interval;
use super::path::Place;
use super::problem::{Checked, ensure};
use super::scene::Scene;

/// A moment of a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum At {
    /// The place of the head, in the section of one dragon.
    Head(Place),
    /// The time of the show in seconds, in the section of two.
    Time(f64),
    /// The path's end.
    PathEnd,
}

impl At {
    /// Returns the metres that the head has travelled; the seconds of the show for a time.
    fn measure(self, scene: &Scene) -> Interval {
        match self {
            Self::Head(place) => scene.path.travelled(place),
            Self::Time(seconds) => Interval::new(seconds),
            Self::PathEnd => scene.path.length,
        }
    }

    /// Returns the seconds of the show.
    pub fn seconds(self, scene: &Scene) -> Interval {
        let measure = self.measure(scene);
        if matches!(self, Self::Time(_)) { measure } else { scene.time(&measure) }
    }

    /// Returns a time of the show in the measure of this moment.
    fn measured(self, scene: &Scene, seconds: f64) -> Interval {
        let time = Interval::new(seconds);
        if matches!(self, Self::Time(_)) { time } else { scene.travelled_by(&time) }
    }

    /// Returns true if the moment is certainly not after a time of the show, in seconds.
    pub fn is_by(self, scene: &Scene, seconds: f64) -> bool {
        self.measure(scene).is_at_most(&self.measured(scene, seconds))
    }

    /// Returns true if the moment is certainly not before a time of the show, in seconds.
    pub fn has_come_to(self, scene: &Scene, seconds: f64) -> bool {
        self.measured(scene, seconds).is_at_most(&self.measure(scene))
    }
}

/// One claim of the steps of a section: boards are further apart than some metres, or further from an obstacle, or links
/// move. Steps make a claim only while all steps before have made it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shown {
    /// The end of the last step that makes the claim.
    pub end: Option<At>,
    /// True if all steps make it.
    pub all: bool,
    /// The least of the metres of these steps.
    pub least: f64,
}

impl Shown {
    /// The claim before the first step.
    pub const NOTHING: Self = Self { end: None, all: true, least: f64::INFINITY };

    /// Adds a step, with the metres of its claim, or none if it does not make the claim; `what` names it.
    ///
    /// # Errors
    /// A step before did not make the claim; the metres are no number.
    pub fn add(&mut self, to: At, metres: Option<f64>, what: impl Display) -> Checked {
        let Some(metres) = metres else {
            self.all = false;
            return Ok(());
        };
        ensure!(self.all, "it {what} after a step that does not");
        ensure!(metres.is_finite(), "it {what} of {metres:?} m, expected a number");
        (self.end, self.least) = (Some(to), self.least.min(metres));
        Ok(())
    }

    /// Returns true if steps that make the claim have come to a time of the show, in seconds.
    pub fn has_come_to(&self, scene: &Scene, seconds: f64) -> bool {
        self.end.is_some_and(|end| end.has_come_to(scene, seconds))
    }
}
