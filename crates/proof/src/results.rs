//! Checks that a result follows from what a section has shown.

use super::interval::Interval;
use super::lines::{About, EventKind, ProvedClearance, ProvedEvent, ProvedObstacleClearance, Status, Until};
use super::problem::{Checked, ensure, problem};
use super::scene::Scene;
use super::shown::Shown;
use super::witness::Witness;

/// The claim of a result.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Claim {
    /// The time of the first such event.
    Event(EventKind),
    /// The least clearance.
    Clearance,
}

/// The claims of the results of a section before those about obstacles, in their order.
const OF_EVENTS: [Claim; 4] = [
    Claim::Event(EventKind::Contact),
    Claim::Event(EventKind::Stall),
    Claim::Event(EventKind::Lock),
    Claim::Event(EventKind::PathEnd),
];
const OF_CLEARANCE: [Claim; 1] = [Claim::Clearance];

/// The subject of a result.
pub(super) struct Subject {
    pub claim: Claim,
    pub obstacle: Option<usize>,
}

impl Subject {
    /// Returns the subject of a result of a section, by the number of results before it and the number of obstacles.
    /// Returns `None` after the last.
    pub fn nth(about: About, earlier: usize, obstacles: usize) -> Option<Self> {
        let (claims, of_obstacle): (&[Claim], _) = match about {
            About::Events => (&OF_EVENTS, Claim::Event(EventKind::Obstacle)),
            _ => (&OF_CLEARANCE, Claim::Clearance),
        };
        match earlier.checked_sub(claims.len()) {
            None => Some(Self { claim: claims[earlier], obstacle: None }),
            number => {
                number.filter(|number| *number < obstacles).map(|_| Self { claim: of_obstacle, obstacle: number })
            }
        }
    }
}

/// The facts that a section has shown about the subject of a result.
pub(super) struct Known<'s> {
    /// The dragon, or one of the two.
    pub scene: &'s Scene,
    /// The steps in which the event does not happen, or in which boards keep a clearance.
    pub shown: Shown,
    /// The event, or the contact that ends the stretch of a least clearance.
    pub event: Option<Witness>,
    /// The upper bound of the least clearance.
    pub near: Option<Witness>,
    /// True if that is shown for the whole motion, which ends without a lock. A path's end does not happen if the
    /// motion ends with one.
    pub is_whole: bool,
    /// For each lock that ends the motion, the first and the last time in seconds up to which a result may state it.
    /// Between the last step and the lock nothing is known.
    pub locks: Vec<[Interval; 2]>,
}

/// The numbers of a result for a least clearance.
pub(super) struct Clearance {
    lo: Option<f64>,
    hi: Option<f64>,
    until: Until,
    time_until: Option<f64>,
    benches: [Option<usize>; 2],
}

impl From<&ProvedClearance> for Clearance {
    fn from(outcome: &ProvedClearance) -> Self {
        let ProvedClearance { lo, hi, until, time_until, bench_a, bench_b, .. } = *outcome;
        Self { lo, hi, until, time_until, benches: [bench_a, bench_b] }
    }
}

impl From<&ProvedObstacleClearance> for Clearance {
    fn from(outcome: &ProvedObstacleClearance) -> Self {
        let ProvedObstacleClearance { lo, hi, until, time_until, bench, .. } = *outcome;
        Self { lo, hi, until, time_until, benches: [bench, None] }
    }
}

impl Known<'_> {
    /// Checks the result for an event.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn check_event(&self, outcome: &ProvedEvent) -> Checked {
        let ProvedEvent { status, time_lo, time_hi, bench_a, bench_b, .. } = *outcome;
        let benches = [bench_a, bench_b];
        let (follows, claim) = match (status, time_lo, time_hi) {
            (Status::None, lo, None) if self.can_be_none() && benches == [None; 2] => {
                (lo.map_or(self.is_whole, |lo| self.begins(lo) && self.is_up_to_lock(lo)), "the time_lo of status none")
            }
            (Status::None, ..) => (false, "the status none"),
            (Status::Undecided, lo, hi) => {
                let begins = lo.is_some_and(|lo| self.begins(lo));
                (begins && hi.is_none() && benches == [None; 2], "the status undecided with this time_lo")
            }
            (Status::Proved, Some(lo), Some(hi)) => {
                let Some(event) = self.event else { return Err(problem!("the status proved does not follow")) };
                ensure!(event.benches == benches, "the benches are not those of the event");
                let is_by = hi.is_finite() && event.at.seconds(self.scene).is_at_most(&Interval::new(hi));
                (self.begins(lo) && is_by, "the interval from time_lo to time_hi")
            }
            (Status::Proved, ..) => return Err(problem!("a time is missing")),
        };
        if follows { Ok(()) } else { Err(problem!("{claim} does not follow")) }
    }

    /// Returns true if the event certainly does not happen before a time.
    fn begins(&self, lo: f64) -> bool {
        let not_before = self.shown.end.map_or_else(|| Interval::new(0.0), |end| end.seconds(self.scene));
        lo.is_finite() && lo >= 0.0 && Interval::new(lo).is_at_most(&not_before)
    }

    /// Returns true if the event may not happen at all.
    fn can_be_none(&self) -> bool {
        self.event.is_none() && (self.is_whole || !self.locks.is_empty())
    }

    /// Returns true if a result may state a time as that up to which it holds before a lock.
    fn is_up_to_lock(&self, time: f64) -> bool {
        let time = Interval::new(time);
        self.locks.iter().any(|[from, to]| from.is_at_most(&time) && time.is_at_most(to))
    }

    /// Checks the result for a least clearance.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn check_clearance(&self, outcome: &Clearance) -> Checked {
        let Clearance { lo, hi, until, time_until, benches } = *outcome;
        let (shown, scene) = (&self.shown, self.scene);
        ensure!(
            lo.is_none_or(|lo| lo.is_finite() && lo <= shown.least && shown.has_come_to(scene, 0.0)),
            "the clearance lo does not follow"
        );
        let near = match until {
            Until::PathEnd if self.is_whole => self.near,
            Until::PathEnd => return Err(problem!("the steps that say how far boards are apart end before the path")),
            Until::Contact => {
                // Boards are apart at the start, and two overlap later.
                let begins = shown.least >= 0.0 && lo.is_none_or(|lo| lo <= 0.0) && shown.has_come_to(scene, 0.0);
                Some(self.event.filter(|_| begins).ok_or_else(|| problem!("a first contact does not follow"))?)
            }
            Until::Time => {
                let is_reached = |time: f64| lo.is_none() || shown.has_come_to(scene, time);
                let Some(time) = time_until.filter(|time| *time >= 0.0 && is_reached(*time)) else {
                    return Err(problem!("time_until does not follow"));
                };
                self.near.filter(|near| near.at.is_by(scene, time))
            }
        };
        ensure!((until == Until::Time) == time_until.is_some(), "time_until is of another end");
        match (hi, near) {
            (None, _) if benches == [None; 2] => Ok(()),
            (Some(hi), Some(near)) if near.benches == benches => {
                if near.most.is_at_most(&Interval::new(hi)) {
                    Ok(())
                } else {
                    Err(problem!("the clearance hi does not follow"))
                }
            }
            _ => Err(problem!("the clearance hi, or its benches, do not follow")),
        }
    }
}
