//! The search of [`super`]. Steps of a motion are proved to contain nothing nearer than a limit, and are halved if the
//! proof fails.
//!
//! In: a [`SteppedSearch`], which knows the bodies and the bounds of their motion. The bodies are the boards of one
//! chain (`search`), the boards of two dragons (`between`), or boards and obstacles (`ground`). Out: calls of
//! [`SteppedSearch::record`] for every step that may contain something nearer; no pair is at or below the limit
//! anywhere else.

use crate::event::{Budget, Spent};
use crate::linkage::NoFollower;

/// Within this share of the shortest link, the clearance of one pair is assumed to have one minimum. This assumption is
/// the only part of the least clearance without proof.
const UNIMODAL_SHARE: f64 = 1e-2;

/// The greatest number of configurations for a first guess of the least clearance.
pub(super) const MOST_GUESSES: f64 = 1000.0;

/// The share of a search for the least clearance that its guess takes, for the report of progress.
pub(super) const GUESS_SHARE: f64 = 0.3;

/// The reason for an early end of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Halt {
    /// The budget is spent.
    Spent,
    /// A configuration inside the motion cannot be solved.
    NoFollower,
}

impl From<NoFollower> for Halt {
    fn from(_: NoFollower) -> Self {
        Self::NoFollower
    }
}

impl From<Spent> for Halt {
    fn from(_: Spent) -> Self {
        Self::Spent
    }
}

/// The goal of a search. A search of obstacles has the goal for each of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Goal {
    /// The first contact.
    Contact,
    /// The least clearance.
    Least,
}

/// The state of a search.
pub(super) struct SearchState<'s, 'b> {
    pub goal: Goal,
    pub budget: &'s mut Budget<'b>,
    /// The coordinate up to which the result is proved.
    pub searched_until: f64,
}

impl<'s, 'b> SearchState<'s, 'b> {
    pub fn new(goal: Goal, budget: &'s mut Budget<'b>) -> Self {
        Self { goal, budget, searched_until: f64::NEG_INFINITY }
    }
}

/// Bodies that move, as the search sees them. The coordinate of their motion is the metres that a head has travelled,
/// or the seconds of a show.
pub(super) trait SteppedSearch<'s, 'b: 's> {
    /// The bodies at one coordinate.
    type Bodies;
    /// Two bodies that may come near each other.
    type Pair: Copy;

    /// Returns the state of this search.
    fn state(&mut self) -> &mut SearchState<'s, 'b>;

    /// Returns the coordinate of bodies.
    fn coordinate(at: &Self::Bodies) -> f64;

    /// Returns the growth of the coordinate while a head travels the shortest link.
    fn step_unit(&self) -> f64;

    /// Records the first bodies, guesses the least clearance if that is the goal, and [advances](Self::advance).
    fn search(&mut self, from: f64, to: f64) -> Result<(), Halt>;

    /// Returns the bodies at a later coordinate before which no new pair matters; `None` if there are none.
    fn skip(&mut self, _before: &Self::Bodies, _to: f64) -> Result<Option<Self::Bodies>, Halt> {
        Ok(None)
    }

    /// Returns the bodies at the end of a step of at most `length`. Returns also the pairs that may be at or below the
    /// limit in the step.
    fn step(
        &mut self,
        before: &mut Self::Bodies,
        length: f64,
        to: f64,
    ) -> Result<(Self::Bodies, Vec<Self::Pair>), Halt>;

    /// Returns the bodies of `pairs` at a coordinate within the step from `before`. Bodies that stand may be taken from
    /// `before`. Returns `None` if rounding prevents a solution at the motion's end.
    fn solve_within(
        &mut self,
        before: &Self::Bodies,
        coordinate: f64,
        pairs: &[Self::Pair],
    ) -> Result<Option<Self::Bodies>, Halt>;

    /// Keeps the pairs that may be at or below the limit somewhere in a step.
    fn retain_uncertain(
        &mut self,
        ends: (&Self::Bodies, &Self::Bodies),
        pairs: &mut Vec<Self::Pair>,
    ) -> Result<(), Halt>;

    /// Returns the clearance of a pair, in metres.
    fn clearance(&self, at: &Self::Bodies, pair: Self::Pair) -> f64;

    /// Records the deepest pair if it touches, or the nearest pair if it is below the least clearance so far. With
    /// obstacles, the pair of each obstacle is recorded. Returns true if the search is finished.
    fn record(&mut self, at: &Self::Bodies, pairs: &[Self::Pair]) -> Result<bool, Halt>;

    /// Searches from one coordinate to another. Returns the coordinate up to which the result is proved.
    fn run(&mut self, from: f64, to: f64) -> Result<f64, NoFollower> {
        self.state().searched_until = from;
        match self.search(from, to) {
            Ok(()) => Ok(to),
            Err(Halt::Spent) => Ok(self.state().searched_until),
            Err(Halt::NoFollower) => Err(NoFollower),
        }
    }

    /// Goes from `start` to `to` in steps, until the search is finished. After a step without uncertain pairs the next
    /// is twice as long; other steps are halved, and the next ones are shorter.
    fn advance(&mut self, start: Self::Bodies, to: f64) -> Result<(), Halt> {
        let (from, unit) = (Self::coordinate(&start), self.step_unit());
        let least = self.state().goal == Goal::Least;
        let mut length = 0.25 * unit;
        let mut before = start;
        while Self::coordinate(&before) < to {
            let at = Self::coordinate(&before);
            let share = (at - from) / (to - from);
            let state = self.state();
            state.searched_until = at;
            state.budget.report(if least { GUESS_SHARE + (1.0 - GUESS_SHARE) * share } else { share });
            if let Some(later) = self.skip(&before, to)? {
                before = later;
                continue;
            }
            let (after, pairs) = self.step(&mut before, length, to)?;
            if pairs.is_empty() {
                length *= 2.0;
            } else {
                if least {
                    self.record(&after, &pairs)?;
                }
                if self.narrow(&before, &after, &pairs)? {
                    return Ok(());
                }
                length = (0.7 * length).max(1e-3 * unit);
            }
            before = after;
        }
        Ok(())
    }

    /// Halves a step, the earlier half first, until its pairs are certain or the doubles are exhausted. Returns true if
    /// the search is finished.
    fn narrow(&mut self, before: &Self::Bodies, after: &Self::Bodies, pairs: &[Self::Pair]) -> Result<bool, Halt> {
        if pairs.is_empty() {
            return Ok(false);
        }
        let (first, last) = (Self::coordinate(before), Self::coordinate(after));
        let half = first + 0.5 * (last - first);
        let middle = if half > first && half < last { self.solve_within(before, half, pairs)? } else { None };
        let Some(middle) = middle else { return self.record(after, pairs) };
        let least = self.state().goal == Goal::Least;
        if least {
            self.record(&middle, pairs)?;
        }
        let has_one_minimum = least && last - first <= UNIMODAL_SHARE * self.step_unit();
        for ends in [(before, &middle), (&middle, after)] {
            let state = self.state();
            state.searched_until = state.searched_until.max(Self::coordinate(ends.0));
            let mut uncertain = pairs.to_vec();
            if has_one_minimum {
                let is_first_half = Self::coordinate(ends.0) == first;
                uncertain.retain(|&pair| {
                    let [at_first, at_middle, at_last] = [before, &middle, after].map(|at| self.clearance(at, pair));
                    (at_middle < at_first && at_middle < at_last) || is_first_half == (at_first <= at_last)
                });
            }
            self.retain_uncertain(ends, &mut uncertain)?;
            if self.narrow(ends.0, ends.1, &uncertain)? {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Returns true if two bodies may be at or below `limit` somewhere in a step. Then the sum of their clearances at both
/// ends is at most twice the limit plus `motion` ([`super`]). Lower `bounds` of the clearances are tested first.
pub(super) fn may_reach(limit: f64, motion: f64, bounds: [f64; 2], clearances: impl FnOnce() -> [f64; 2]) -> bool {
    let most = 2.0 * limit + motion;
    if bounds[0] + bounds[1] > most {
        return false;
    }
    let [first, last] = clearances();
    first.min(last) <= limit || first + last <= most
}
