//! The pairs of boards that a step of the search must test, and the part of the chain that must be solved for them.

use crate::model::path::Param;

use super::configuration::{Configuration, Pair};
use super::displacement::{Displacements, Weights, progress};
use super::search::ChainSearch;
use super::stepped_search::{Halt, may_reach};

impl ChainSearch<'_, '_, '_> {
    /// Returns true if pairs without boards 0 and 1 matter. These pairs matter if handle 2 is behind the start of
    /// handle 1, or may come there within `excursion` metres of these configurations. Even then they do not matter if
    /// handle 2 stays behind the quiet place.
    pub(super) fn all_pairs(&self, ends: &[&Configuration], excursion: f64) -> bool {
        let visited = |at: Param| !self.is_behind(at, self.second_handle, -excursion);
        let quiet = |at: Param| self.quiet.is_some_and(|quiet| self.is_behind(at, quiet, excursion));
        !ends.iter().all(|end| visited(end.places[2])) && !ends.iter().all(|end| quiet(end.places[2]))
    }

    /// Returns true if a place is behind another by more than `margin` metres.
    fn is_behind(&self, place: Param, other: Param, margin: f64) -> bool {
        if margin == 0.0 {
            progress(self.chain.path, place, other) > 0.0
        } else {
            self.chain.path.arc_length(place, other) > margin
        }
    }

    /// Returns the pairs that may be at or below the limit in a step, or without `after` in one configuration. Solves
    /// both as far back as any board can come near one that matters.
    pub(super) fn candidates(
        &mut self,
        before: &mut Configuration,
        mut after: Option<&mut Configuration>,
    ) -> Result<Vec<Pair>, Halt> {
        let mut step = Displacements::default();
        self.extend(before, after.as_deref_mut(), &mut step, 2)?;
        let limit = self.limit(before);
        let all = self.all_pairs(&[before, after.as_deref().unwrap_or(before)], step.excursion());
        let tail = self.chain.team.own_tail();
        let mut benches = 2;
        while (all || tail.is_some()) && benches < self.chain.team.benches {
            let ends = [&*before, after.as_deref().unwrap_or(before)];
            if self.quiet.is_some_and(|quiet| self.all_behind(&ends, benches, quiet, step.excursion())) {
                break;
            }
            benches += 1;
            self.extend(before, after.as_deref_mut(), &mut step, benches)?;
        }
        let ends = (&*before, after.as_deref().unwrap_or(before));
        let rearmost = step.reach(self.chain, ends, benches).rearmost(self.chain.path, self.chain.team, limit.max(0.0));
        while benches < self.chain.team.benches {
            let ends = [&*before, after.as_deref().unwrap_or(before)];
            if rearmost.is_none_or(|rearmost| self.all_behind(&ends, benches, rearmost, step.excursion())) {
                break;
            }
            benches += 1;
            self.extend(before, after.as_deref_mut(), &mut step, benches)?;
        }
        let ends = (&*before, after.as_deref().unwrap_or(before));
        let mut pairs = if all {
            before.near_pairs(benches, limit + step.most_relative_motion(self.chain, benches))
        } else {
            let of_tail = tail.filter(|tail| *tail < benches).map(|tail| (2..tail - 1).map(move |a| (a, tail)));
            let foremost = (0..2).flat_map(|a| (a + 2..benches).map(move |b| (a, b)));
            foremost.chain(of_tail.into_iter().flatten()).collect()
        };
        self.retain_uncertain_in(&step, ends, &mut pairs)?;
        Ok(pairs)
    }

    fn all_behind(&self, ends: &[&Configuration], handle: usize, place: Param, margin: f64) -> bool {
        ends.iter().all(|end| self.is_behind(end.places[handle], place, margin))
    }

    /// Solves both ends of a step to `benches` benches, and their handles' displacements.
    fn extend(
        &mut self,
        before: &mut Configuration,
        mut after: Option<&mut Configuration>,
        step: &mut Displacements,
        benches: usize,
    ) -> Result<(), Halt> {
        self.solve(before, benches)?;
        if let Some(after) = after.as_deref_mut() {
            self.solve(after, benches)?;
        }
        let ends = (&*before, after.as_deref().unwrap_or(before));
        step.extend_to(benches + 1, self.chain, ends, self.state.budget)
    }

    /// Keeps the pairs that may be at or below the limit somewhere in a step.
    pub(super) fn retain_uncertain_in(
        &mut self,
        step: &Displacements,
        ends: (&Configuration, &Configuration),
        pairs: &mut Vec<Pair>,
    ) -> Result<(), Halt> {
        self.state.budget.spend(pairs.len() as u64)?;
        let limit = self.limit(ends.0);
        let weights = Weights::for_limit(limit);
        let both = [ends.0, ends.1];
        pairs.retain(|&pair| {
            let motion = step.relative_motion_bound(self.chain, ends, pair, weights);
            may_reach(limit, motion, both.map(|at| at.circle_bound(pair)), || both.map(|at| at.clearance(pair)))
        });
        Ok(())
    }
}
