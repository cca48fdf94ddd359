//! A link of one length as its front handle goes along the path: the places where the rear handle turns round, the
//! stretches in which nearer places are at the link's distance, and the lock.
//!
//! In: a link and the start of its front handle. Out: turns, branches and end, in metres of travel of the front handle.
//! The search advances the link step by step. An uncertain step is halved, the earlier half first, down to the
//! resolution.
//!
//! **Branches.** The rear handle begins at the first place at the distance, and continues without a jump. Where a
//! nearer place is proven to come to the distance, a branch begins: from here on the rear handle is the first place back
//! from a place that it cannot pass. That place is replaced from time to time by the place of least distance ahead of
//! the rear handle. The branch ends where the rear handle is the first place at the distance again.
//!
//! **At the resolution.** An unresolved stretch begins where a step of a few units in the last place is uncertain. Near
//! a degenerate configuration the effect of rounding grows in proportion to the distance from it, so each further step
//! in the stretch may be as long as the stretch is already. Over the whole stretch a jump is searched, and the signs of
//! the front cosine at its ends are compared. A lock is a follower that is proven to vanish, found to the last digit;
//! everything else is a graze. Jumps of less than about 1e-8 links, and pairs of turns within one such stretch, are
//! below the resolution of doubles.

use std::f64::consts::FRAC_PI_2;

use crate::linkage::NoFollower;
use crate::model::path::Branch;
use crate::model::root::bisect_predicate;

use super::super::event::Budget;
use super::certificate::{Configuration, Link};
use super::inward::{self, InwardSingularities};

/// The end of a trace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TraceEnd {
    /// The front handle is at the last place at which the link has a follower.
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

/// The rear cosine below which a link on parallel lines is nearly square to them.
const NEARLY_SQUARE: f64 = 0.02;

/// The distances, in links, from a place of least distance within which it is searched for again a little later.
const NARROWEST: f64 = 1e-9;
const WIDEST: f64 = 1e-3;

/// The greatest difference of a rear handle found from two places ahead of it, in links.
const SAME_PLACE: f64 = 1e-6;

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
    /// In order. The last one has no end while it lasts.
    branches: Vec<Branch>,
    /// True if the place that the rear handle cannot pass was chosen here, or no better one was found here.
    is_renewed: bool,
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
        let at = link.configuration(lock.unwrap_or(link.path.end_of(0)), None)?;
        let end = lock.map(|_| TraceEnd::Lock);
        let rears = turns.iter().chain(&start).filter_map(|front| link.configuration(*front, None).ok());
        let furthest_rear = rears.fold(at.rear, |furthest, configuration| furthest.max(configuration.rear));
        let step = LONGEST_STEP * link.length;
        let (ahead, branches) = (Vec::new(), Vec::new());
        let (unresolved, is_renewed, work) = (None, false, 0);
        Ok(Self { link, at, ahead, step, unresolved, turns, branches, is_renewed, furthest_rear, work, end })
    }

    /// Returns the link with its front handle after `front` metres of travel, which the trace has passed.
    ///
    /// # Errors
    /// As [`Link::configuration`].
    pub fn configuration(&self, front: f64) -> Result<Configuration, NoFollower> {
        let next = self.branches.partition_point(|branch| branch.begin <= front);
        let branch = next.checked_sub(1).map(|index| self.branches[index]).filter(|branch| front <= branch.end);
        self.link.configuration(front, branch.map(|branch| self.link.path.place_behind(&branch, front)))
    }

    /// Returns the last traced configuration.
    pub fn at(&self) -> &Configuration {
        &self.at
    }

    /// Returns the metres of travel of the front handle at which the rear one turns round, in order.
    pub fn turns(&self) -> &[f64] {
        &self.turns
    }

    /// Returns the traced stretches in which the rear handle is not the first place at its distance, in order.
    pub fn branches(&self) -> Vec<Branch> {
        let is_whole = matches!(self.end, Some(TraceEnd::Lock | TraceEnd::PathEnd));
        let last = if is_whole { f64::INFINITY } else { self.at.front };
        self.branches.iter().map(|branch| Branch { end: branch.end.min(last), ..*branch }).collect()
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
        let branch = self.branch();
        if branch.is_none()
            && let Some(end) = self.link.steady_until(&self.at)
        {
            self.settle();
            self.ahead.clear();
            let next = self.solve(end)?;
            self.move_to(next);
            return Ok(());
        }
        if let Some(branch) = branch
            && self.goes_parallel(&branch)?
        {
            return Ok(());
        }
        let next = match self.ahead.last() {
            Some(next) => *next,
            None => {
                let front = (self.at.front + self.step).min(self.link.segment_end(&self.at));
                let Some(next) = self.solved_or_shorter(front)? else { return Ok(()) };
                self.ahead.push(next);
                next
            }
        };
        let step = next.front - self.at.front;
        let behind = branch.map(|branch| self.link.path.travelled(branch.behind));
        if self.link.is_certain(&self.at, &next, behind) {
            self.settle();
            self.record_turn(self.at, next);
            self.move_to(next);
        } else if let Some(place) = self.nearer_place(&self.at, &next) {
            self.begin_branch(place);
        } else if self.renews_branch() {
            self.ahead.clear();
        } else if step > self.finest_step() {
            if let Some(middle) = self.solved_or_shorter(self.at.front + 0.5 * step)? {
                self.ahead.push(middle);
                self.step = 0.5 * step;
            }
        } else {
            self.cross_unresolved(next);
        }
        Ok(())
    }

    /// Follows a branch while both handles are on parallel lines and the link is nearly square to them, so that other
    /// steps would be short. There the link keeps its direction. Returns false if this is not the case.
    fn goes_parallel(&mut self, branch: &Branch) -> Result<bool, NoFollower> {
        let parallel =
            self.link.parallel_until(&self.at, branch.behind).filter(|_| self.at.rear_cosine < NEARLY_SQUARE);
        let Some((end, drift)) = parallel else { return Ok(false) };
        self.settle();
        self.begin_branch(self.link.path.travelled(branch.behind));
        if let Some(branch) = self.branches.last_mut() {
            branch.drift = drift;
        }
        let next = self.solve(end)?;
        self.move_to(next);
        if let Some(branch) = self.branch() {
            self.begin_branch(self.link.path.travelled(self.link.path.place_behind(&branch, end)));
        }
        Ok(true)
    }

    fn solve(&mut self, front: f64) -> Result<Configuration, NoFollower> {
        let configuration = self.configuration(front);
        self.work += 1 + configuration.as_ref().map_or(0, |found| self.winding(found));
        configuration
    }

    /// Returns the configuration further on. On a branch without a follower there the next step is shorter, or ends the
    /// trace.
    fn solved_or_shorter(&mut self, front: f64) -> Result<Option<Configuration>, NoFollower> {
        let (solved, branch) = (self.solve(front), self.branch());
        let (Err(none), Some(branch)) = (&solved, branch) else { return solved.map(Some) };
        self.ahead.clear();
        let step = front - self.at.front;
        if self.renews_branch() {
            return Ok(None);
        }
        if step > self.finest_step() {
            self.step = 0.5 * step;
            return Ok(None);
        }
        // The follower meets the nearer place at the distance, where all places between the two are further away. A wider
        // search would come to places that are nearer again.
        let (link, at, valley) = (self.link, self.at, self.link.path.travelled(branch.behind));
        let around = (2.0 * (valley - at.rear).abs()).clamp(NARROWEST * link.length, WIDEST * link.length);
        let excess = |front: f64| link.least_distance(front, valley, around) - link.length;
        if excess(front) < -link.resolution(&at) {
            return Err(*none);
        }
        // Within the rounding of the distances, the places on both sides are at the distance up to here.
        let is_lost = |place: f64| place >= front || excess(place) >= 0.0;
        self.lock(&at, bisect_predicate(is_lost, at.front, front));
        Ok(None)
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
        self.is_renewed = false;
        if let Some(branch) = self.branch() {
            let first = self.link.configuration_at(next.front, next.front_param, None);
            self.work += 1;
            if first.is_ok_and(|first| {
                first.rear <= self.link.path.travelled(self.link.path.place_behind(&branch, next.front))
            }) {
                self.end_branch();
                self.settle();
                self.ahead.clear();
            }
        }
    }

    /// Returns the branch on which the rear handle is.
    fn branch(&self) -> Option<Branch> {
        self.branches.last().copied().filter(|branch| branch.end == f64::INFINITY)
    }

    /// Returns a place that the rear handle cannot pass in a step in which a nearer place comes to the distance.
    fn nearer_place(&self, before: &Configuration, after: &Configuration) -> Option<f64> {
        let is_ahead = self.branch().is_none() && after.rear > before.rear;
        if is_ahead { self.link.jump(before, after) } else { None }
    }

    /// Begins a branch here, with a place that the rear handle cannot pass.
    fn begin_branch(&mut self, place: f64) {
        self.end_branch();
        let (link, begin, behind) = (self.link.length, self.at.front, self.link.path.param_at(place));
        self.branches.push(Branch { link, begin, end: f64::INFINITY, behind, drift: 0.0 });
        self.ahead.clear();
        self.is_renewed = true;
    }

    fn end_branch(&mut self) {
        let here = self.at.front;
        if let Some(branch) = self.branches.last_mut().filter(|branch| branch.end == f64::INFINITY) {
            branch.end = here;
        }
        self.branches.retain(|branch| branch.begin < branch.end);
    }

    /// Chooses again the place that the rear handle cannot pass, once at each configuration. Returns true if there is
    /// another.
    fn renews_branch(&mut self) -> bool {
        let Some(branch) = self.branch().filter(|_| !self.is_renewed) else { return false };
        self.is_renewed = true;
        let (valley, work) = self.link.valley(&self.at);
        self.work += work / 8;
        let Some(valley) = valley else { return false };
        let behind = self.link.path.param_at(valley);
        let same = |found: Configuration| (found.rear - self.at.rear).abs() <= SAME_PLACE * self.link.length;
        let front = (self.at.front, self.at.front_param);
        if behind == branch.behind || !self.link.configuration_at(front.0, front.1, Some(behind)).is_ok_and(same) {
            return false;
        }
        self.begin_branch(valley);
        true
    }

    /// Returns the longest step that may be taken without a proof, in metres.
    fn finest_step(&self) -> f64 {
        let stretch = self.unresolved.map_or(0.0, |start| self.at.front - start.front);
        stretch.min(LONGEST_UNRESOLVED * self.link.length).max(self.link.resolution(&self.at))
    }

    /// Takes a step that is too short to be halved: to a lock, to the beginning of a branch, or further.
    fn cross_unresolved(&mut self, next: Configuration) {
        let at = self.at;
        let start = *self.unresolved.get_or_insert(at);
        for from in [start, at] {
            if let Some(place) = self.nearer_place(&from, &next) {
                (self.at, self.unresolved) = (from, None);
                self.begin_branch(place);
                return;
            }
            if let Some(place) = self.link.jump(&from, &next) {
                let has_jumped = |front: f64| {
                    self.configuration(front).map_or(true, |between| (between.rear > place) != (from.rear > place))
                };
                self.lock(&from, bisect_predicate(has_jumped, from.front, next.front));
                return;
            }
        }
        self.step = 0.0;
        self.move_to(next);
    }

    /// Ends at the last place before `lost`, the first one at which the rear handle is lost.
    fn lock(&mut self, before: &Configuration, lost: f64) {
        self.work += BISECTION_WORK;
        self.at = self.configuration(lost.next_down().max(before.front)).unwrap_or(*before);
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
        let turned =
            |front: f64| self.configuration(front).is_ok_and(|between| between.is_stalled() != before.is_stalled());
        let turn = bisect_predicate(turned, before.front, after.front);
        let rear = self.configuration(turn).map_or(after.rear, |at| at.rear);
        self.furthest_rear = self.furthest_rear.max(rear);
        self.turns.push(turn);
    }
}
