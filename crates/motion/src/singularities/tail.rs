//! Singular configurations of a tail whose link has a length of its own.
//!
//! In: the traces of the head's link, of a body link and of the tail's link. Out: the first places of the head at which
//! the tail's link stalls and locks.
//!
//! The front handle of the tail is F^(n - 2) of handle 1, with the follower map F of a body link and n benches. Between
//! two turning points of handle 1 its place is monotone in the head's place. F turns round only at the turns of the
//! body's trace, so cuts where a handle stands at one of these leave stretches on which the next handle is monotone,
//! too. A tail that nothing singular is ahead of needs no cuts: a chord is no longer than its arc, so the front handle
//! of the tail is at least n - 2 links behind handle 1.

use super::super::event::Budget;
use super::SingularitySearch;
use super::certificate::Configuration;
use super::trace::TraceEnd;
use crate::model::root::bisect_predicate;

/// The cost of a bisection to the last digit, in places of the handle sought.
const BISECTION_WORK: u64 = 64;

/// The singular places of the tail's link, in metres of travel of the head.
#[derive(Debug, Default)]
pub(super) struct TailSingularities {
    pub stall: Option<f64>,
    /// The first place from which on the tail has no continuous follower, or is not known to have one.
    pub until: Option<f64>,
    /// True if the tail locks there.
    pub locks: bool,
}

impl SingularitySearch<'_> {
    /// Returns true if the front handle of the tail may come further than the tail's link is traced.
    pub(super) fn tail_lags(&self) -> bool {
        self.tail.as_ref().is_some_and(|tail| tail.at().front < self.foremost_of_tail())
    }

    /// Returns an upper bound of the places that the front handle of the tail has come to, in metres of travel.
    fn foremost_of_tail(&self) -> f64 {
        self.head.furthest_rear() - self.team.link(1) * (self.team.benches - 2) as f64
    }

    /// Returns the singular places of the tail while the head travels from 0 to `limit`.
    pub(super) fn of_tail(&self, limit: f64, budget: &mut Budget) -> TailSingularities {
        let mut found = TailSingularities::default();
        let Some(tail) = self.tail.as_ref() else { return found };
        let end = self.tail_lags().then(|| (tail.at().front, tail.end()));
        let turn = tail.turns().first().copied();
        let nearest = end.map(|(place, _)| place).into_iter().chain(turn).fold(f64::INFINITY, f64::min);
        let behind = self.team.link(1) * (self.team.benches - 2) as f64;
        let Some(earliest) = self.handle_1_reaches(nearest + behind, limit) else { return found };
        let front = |head: f64| self.handle(self.team.benches - 1, head);
        let Some(first) = front(0.0) else { return TailSingularities { until: Some(0.0), ..found } };
        let Some(cuts) = self.cuts(limit, budget) else { return TailSingularities { until: Some(earliest), ..found } };
        // The first place of the head at which the front handle comes to a place ahead.
        let comes_to = |place: f64| {
            let reached = |head: f64| front(head).is_none_or(|at| at >= place);
            cuts.windows(2).find(|cut| reached(cut[1])).map(|cut| bisect_predicate(reached, cut[0], cut[1]))
        };
        if tail.configuration(first).is_ok_and(|start: Configuration| start.is_stalled()) {
            found.stall = Some(0.0);
        } else {
            found.stall = tail.turns().iter().copied().find(|turn| *turn > first).and_then(comes_to);
        }
        if let Some((place, end)) = end {
            let until = if first >= place { Some(0.0) } else { comes_to(place) };
            found.until = until.map(|at| at.next_down().max(0.0));
            found.locks = end == Some(TraceEnd::Lock);
        }
        found
    }

    /// Returns the places of the head from 0 to `limit` between which the front handle of the tail is monotone; `None`
    /// if the budget is spent.
    fn cuts(&self, limit: f64, budget: &mut Budget) -> Option<Vec<f64>> {
        let body = self.body.as_ref()?;
        let turns = self.head.turns().iter().copied().filter(|at| 0.0 < *at && *at < limit);
        let mut cuts: Vec<f64> = [0.0].into_iter().chain(turns).chain([limit]).collect();
        let mut places: Vec<f64> = cuts.iter().map(|cut| self.handle(1, *cut)).collect::<Option<_>>()?;
        for handle in 1..self.team.benches - 1 {
            let mut begin = 0;
            while begin + 1 < cuts.len() {
                let (from, to) = (places[begin], places[begin + 1]);
                let is_between = |turn: &f64| from.min(to) < *turn && *turn < from.max(to);
                let mut passed: Vec<f64> = body.turns().iter().copied().filter(is_between).collect();
                if from > to {
                    passed.reverse();
                }
                budget.spend((BISECTION_WORK * handle as u64).saturating_mul(passed.len() as u64)).ok()?;
                for turn in passed {
                    let is_beyond = |head: f64| self.handle(handle, head).is_none_or(|at| (at >= turn) == (from < to));
                    let cut = bisect_predicate(is_beyond, cuts[begin], cuts[begin + 1]);
                    begin += 1;
                    cuts.insert(begin, cut);
                    places.insert(begin, turn);
                }
                begin += 1;
            }
            budget.spend(cuts.len() as u64).ok()?;
            for place in &mut places {
                *place = body.configuration(*place).ok()?.rear;
            }
        }
        Some(cuts)
    }

    /// Returns the metres of travel of a handle from 1 on that only body links lead to.
    pub(super) fn handle(&self, handle: usize, head: f64) -> Option<f64> {
        let body = self.body.as_ref().unwrap_or(&self.head);
        (1..handle).try_fold(self.handle_1(head)?, |front, _| {
            body.configuration(front).ok().map(|configuration| configuration.rear)
        })
    }
}
