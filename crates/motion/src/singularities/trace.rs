//! A link of one length as its front handle goes along the path: the places where the rear handle turns round, and its
//! lock.
//!
//! In: a link and the start of its front handle. Out: turns and end, in metres of travel of the front handle. The
//! search advances the link step by step. An uncertain step is halved, the earlier half first, down to the resolution.
//!
//! **At the resolution.** An unresolved stretch begins where a step of a few units in the last place is uncertain. Near
//! a degenerate configuration the effect of rounding grows in proportion to the distance from it, so each further step
//! in the stretch may be as long as the stretch is already. Over the whole stretch a jump is searched, and the signs of
//! the front cosine at its ends are compared. A lock is a proven jump, found to the last digit; everything else is a
//! graze. Jumps of less than about 1e-8 links, and pairs of turns within one such stretch, are below the resolution of
//! doubles.

use std::f64::consts::FRAC_PI_2;

use crate::linkage::NoFollower;
use crate::model::root::bisect_predicate;

use super::super::event::Budget;
use super::certificate::{Configuration, Link};
use super::inward::{self, InwardSingularities};

/// The end of a trace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TraceEnd {
    /// The front handle is at the last place at which the link has a follower without a jump.
    Lock,
    /// The front handle is at the path's end.
    PathEnd,
    /// The follower cannot be computed further on: the trace ends here.
    Undecided,
}

/// The cost of a bisection to the last digit, in links solved.
const BISECTION_WORK: u64 = 64;

/// The cost of each link's length of a winding path, in links solved.
const WINDING_WORK: f64 = 32.0;

/// The longest step that the certificates allow, in links.
const LONGEST_STEP: f64 = 0.5;

/// The longest step, in links, that is taken without a proof in an unresolved stretch.
const LONGEST_UNRESOLVED: f64 = 1e-6;

/// A link traced along the path.
pub(super) struct LinkTrace<'a> {
    link: Link<'a>,
    at: Configuration,
    /// Configurations further on, the nearest last: the ends of uncertain steps.
    ahead: Vec<Configuration>,
    /// The length of the next step, in metres.
    step: f64,
    /// The beginning of the unresolved stretch.
    unresolved: Option<Configuration>,
    turns: Vec<f64>,
    furthest_rear: f64,
    /// Links solved since the budget was last charged.
    work: u64,
    end: Option<TraceEnd>,
}

impl<'a> LinkTrace<'a> {
    /// Traces the path's first segment, where the singular configurations are known in closed form. `start` is the
    /// start of the front handle, in metres of travel: turns before it are left out.
    ///
    /// # Errors
    /// [`NoFollower`] if the follower cannot be computed at the segment's end.
    pub fn new(link: Link<'a>, start: Option<f64>) -> Result<Self, NoFollower> {
        let InwardSingularities { mut turns, lock } = inward::singularities(&link);
        turns.retain(|turn| start.is_none_or(|start| *turn > start));
        let at = link.configuration(lock.unwrap_or(link.path.end_of(0)))?;
        let end = lock.map(|_| TraceEnd::Lock);
        let rears = turns.iter().chain(&start).filter_map(|front| link.configuration(*front).ok());
        let furthest_rear = rears.fold(at.rear, |furthest, configuration| furthest.max(configuration.rear));
        let step = LONGEST_STEP * link.length;
        Ok(Self { link, at, ahead: Vec::new(), step, unresolved: None, turns, furthest_rear, work: 0, end })
    }

    /// Returns the link.
    pub fn link(&self) -> &Link<'a> {
        &self.link
    }

    /// Returns the last traced configuration.
    pub fn at(&self) -> &Configuration {
        &self.at
    }

    /// Returns the metres of travel of the front handle at which the rear one turns round, in order.
    pub fn turns(&self) -> &[f64] {
        &self.turns
    }

    /// Returns the furthest place of the rear handle, metres of travel.
    pub fn furthest_rear(&self) -> f64 {
        self.furthest_rear
    }

    /// Returns the end of the trace; `None` while it can be advanced.
    pub fn end(&self) -> Option<TraceEnd> {
        self.end
    }

    /// Tries one step. Returns false if the budget is spent.
    pub fn advance(&mut self, budget: &mut Budget) -> bool {
        if self.at.front >= self.link.path.length() {
            self.settle();
            self.end = Some(TraceEnd::PathEnd);
        } else if self.try_step().is_err() {
            self.end = Some(TraceEnd::Undecided);
        }
        budget.spend(std::mem::take(&mut self.work)).is_ok()
    }

    fn try_step(&mut self) -> Result<(), NoFollower> {
        if let Some(end) = self.link.steady_until(&self.at) {
            self.settle();
            self.ahead.clear();
            let next = self.configuration(end)?;
            self.move_to(next);
            return Ok(());
        }
        let next = match self.ahead.last() {
            Some(next) => *next,
            None => {
                let front = (self.at.front + self.step).min(self.link.segment_end(&self.at));
                let next = self.configuration(front)?;
                self.ahead.push(next);
                next
            }
        };
        let step = next.front - self.at.front;
        if self.link.is_certain(&self.at, &next) {
            self.settle();
            self.record_turn(self.at, next);
            self.move_to(next);
        } else if step > self.finest_step() {
            let middle = self.configuration(self.at.front + 0.5 * step)?;
            self.ahead.push(middle);
            self.step = 0.5 * step;
        } else {
            self.cross_unresolved(next);
        }
        Ok(())
    }

    fn configuration(&mut self, front: f64) -> Result<Configuration, NoFollower> {
        let configuration = self.link.configuration(front);
        self.work += 1 + configuration.as_ref().map_or(0, |found| self.winding(found));
        configuration
    }

    /// Returns the additional cost of a link, in links solved, if the path between its handles is winding. The search
    /// for the rear handle and the proof that it is the first cover this whole path. Their steps are small where places
    /// are nearly as far as the link.
    fn winding(&self, at: &Configuration) -> u64 {
        let links = (at.front - at.rear) / self.link.length;
        // A path that bends by half a turn at most is at most pi / 2 links long; NaN becomes 0.
        (WINDING_WORK * (links - FRAC_PI_2).max(0.0)) as u64
    }

    /// Goes to a configuration and chooses the next step: twice as long as this one, if this one was not cut short.
    fn move_to(&mut self, next: Configuration) {
        self.step = self.step.max(2.0 * (next.front - self.at.front)).min(LONGEST_STEP * self.link.length);
        self.furthest_rear = self.furthest_rear.max(next.rear);
        self.at = next;
        self.ahead.pop();
    }

    /// Returns the longest step that may be taken without a proof, in metres.
    fn finest_step(&self) -> f64 {
        let stretch = self.unresolved.map_or(0.0, |start| self.at.front - start.front);
        stretch.min(LONGEST_UNRESOLVED * self.link.length).max(self.link.resolution(&self.at))
    }

    /// Takes a step that is too short to be halved: over a proven jump, which is a lock, or further.
    fn cross_unresolved(&mut self, next: Configuration) {
        let at = self.at;
        let start = *self.unresolved.get_or_insert(at);
        for from in [start, at] {
            if let Some(place) = self.link.jump(&from, &next) {
                self.lock(&from, &next, place);
                return;
            }
        }
        self.step = 0.0;
        self.move_to(next);
    }

    /// Ends at the last place before the rear handle jumps over `place`.
    fn lock(&mut self, before: &Configuration, after: &Configuration, place: f64) {
        self.work += BISECTION_WORK;
        let link = self.link;
        let jumped = |front: f64| {
            link.configuration(front).map_or(true, |between| (between.rear > place) != (before.rear > place))
        };
        let last = bisect_predicate(jumped, before.front, after.front).next_down().max(before.front);
        self.at = link.configuration(last).unwrap_or(*before);
        self.settle();
        self.end = Some(TraceEnd::Lock);
    }

    /// Ends the unresolved stretch, if there is one.
    fn settle(&mut self) {
        if let Some(start) = self.unresolved.take() {
            self.record_turn(start, self.at);
        }
    }

    /// Records a turn if the front cosine changes its sign between two configurations.
    fn record_turn(&mut self, before: Configuration, after: Configuration) {
        if before.is_stalled() == after.is_stalled() {
            return;
        }
        self.work += BISECTION_WORK;
        let link = self.link;
        let turned =
            |front: f64| link.configuration(front).is_ok_and(|between| between.is_stalled() != before.is_stalled());
        let turn = bisect_predicate(turned, before.front, after.front);
        let rear = link.configuration(turn).map_or(after.rear, |at| at.rear);
        self.furthest_rear = self.furthest_rear.max(rear);
        self.turns.push(turn);
    }
}
