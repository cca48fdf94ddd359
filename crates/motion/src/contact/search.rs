//! The search of one chain: the pairs that matter in each step, and the results.

use crate::event::{Budget, Event};
use crate::linkage::NoFollower;
use crate::model::Point;
use crate::model::board::Board;
use crate::model::path::Param;
use crate::model::separation::{middle_between, overlap_centre};
use bench_dragon_messages::state::EventKind;

use super::configuration::{Configuration, Pair, last_solvable, within};
use super::displacement::{Displacements, progress};
use super::reach::quiet_place;
use super::stepped_search::{GUESS_SHARE, Goal, Halt, MOST_GUESSES, SearchState, SteppedSearch};
use super::{ConservativeAdvancement, Found, LeastClearance};

/// See [`ConservativeAdvancement::first_contact`].
pub(super) fn first_contact(
    chain: &ConservativeAdvancement,
    from: f64,
    to: f64,
    budget: &mut Budget,
) -> Result<Found<Event>, NoFollower> {
    let mut search = ChainSearch::new(chain, Goal::Contact, budget);
    let searched_until = search.run(from, to)?;
    Ok(Found { value: search.contact, searched_until })
}

/// See [`ConservativeAdvancement::least_clearance`].
pub(super) fn least_clearance(
    chain: &ConservativeAdvancement,
    from: f64,
    to: f64,
    budget: &mut Budget,
) -> Result<Found<LeastClearance>, NoFollower> {
    let mut search = ChainSearch::new(chain, Goal::Least, budget);
    let searched_until = search.run(from, to)?;
    Ok(Found { value: search.best, searched_until })
}

pub(super) struct ChainSearch<'s, 'a, 'b> {
    pub(super) chain: &'s ConservativeAdvancement<'a>,
    pub(super) state: SearchState<'s, 'b>,
    contact: Option<Event>,
    /// The least clearance so far.
    best: Option<LeastClearance>,
    /// The place of handle 1 at the beginning: S of the proof.
    pub(super) second_handle: Param,
    /// The quiet place, if there is one.
    pub(super) quiet: Option<Param>,
    /// The travel, in metres, from which on rounding may prevent a solution, because the motion's end may be a lock.
    rounding_from: f64,
}

impl<'s, 'a, 'b> ChainSearch<'s, 'a, 'b> {
    fn new(chain: &'s ConservativeAdvancement<'a>, goal: Goal, budget: &'s mut Budget<'b>) -> Self {
        Self {
            chain,
            state: SearchState::new(goal, budget),
            contact: None,
            best: None,
            second_handle: chain.path.param_at(0.0),
            quiet: None,
            rounding_from: f64::INFINITY,
        }
    }

    fn set_quiet_place(&mut self, at: &Configuration) {
        self.quiet = quiet_place(self.chain.path, self.chain.team, self.limit(at));
    }

    pub(super) fn solve(&mut self, configuration: &mut Configuration, benches: usize) -> Result<(), Halt> {
        configuration.solve_to(benches, self.chain.path, self.chain.team, self.state.budget)
    }

    /// Returns the clearance from which a pair matters: 0, or less than the least one by more than the rounding of two
    /// boards there.
    pub(super) fn limit(&self, at: &Configuration) -> f64 {
        let size = self.chain.team.longest_link() + at.boards[0].centre.coords.norm();
        match (self.state.goal, self.best) {
            (Goal::Contact, _) => 0.0,
            (Goal::Least, Some(best)) => best.value - 8.0 * f64::EPSILON * size,
            (Goal::Least, None) => f64::INFINITY,
        }
    }

    /// Records the deepest pair, if it touches or is below the least clearance so far. Returns true at a contact, whose
    /// place `touching_point` returns.
    fn record_with(
        &mut self,
        at: &Configuration,
        pairs: &[Pair],
        touching_point: impl Fn(&Board, &Board) -> Point,
    ) -> bool {
        let Some((value, (a, b))) = at.deepest(pairs) else { return false };
        let (travelled, bench_a, bench_b) = (at.travelled, a as u32, b as u32);
        if self.state.goal == Goal::Least {
            if self.best.is_none_or(|best| value < best.value) {
                self.best = Some(LeastClearance { value, travelled, bench_a, bench_b });
            }
        } else if value <= 0.0 {
            let place = touching_point(&at.boards[a], &at.boards[b]);
            let (bench_a, bench_b) = (Some(bench_a), Some(bench_b));
            let event = Event { kind: EventKind::Contact, travelled, bench_a, bench_b, place: Some(place) };
            self.contact = Some(event);
        }
        self.contact.is_some()
    }

    /// Records the clearance of the nearest two boards at the end of the search, which may be a lock: next to one it
    /// changes with the root of the travel.
    fn record_at_lock(&mut self, end: f64) -> Result<(), Halt> {
        let Some(best) = self.best.filter(|_| self.state.goal == Goal::Least) else { return Ok(()) };
        let pair = (best.bench_a as usize, best.bench_b as usize);
        let (path, team) = (self.chain.path, self.chain.team);
        let at = Configuration::at_lock(path, team, end, pair.1 + 1, self.state.budget)?;
        self.record(&at, &[pair]).map(|_| ())
    }

    /// Guesses the least clearance from places of the head at least the shortest link apart, and refines it.
    fn guess(&mut self, start: &Configuration, to: f64) -> Result<(), Halt> {
        let from = start.travelled;
        let count = ((to - from) / self.chain.team.shortest_link()).ceil().min(MOST_GUESSES);
        let spacing = (to - from) / count;
        let mut skipped = self.nothing_new_until(start);
        for k in 1..=count as usize {
            let travelled = (from + k as f64 * spacing).min(to);
            if travelled <= skipped {
                continue;
            }
            let mut configuration = Configuration::new(self.chain.path, travelled);
            let pairs = self.candidates(&mut configuration, None)?;
            self.record(&configuration, &pairs)?;
            skipped = self.nothing_new_until(&configuration);
            self.state.budget.report(GUESS_SHARE * k as f64 / count);
        }
        if let Some(best) = self.best {
            let near = ((best.travelled - spacing).max(from), (best.travelled + spacing).min(to));
            let (_, travelled) = self.chain.minimum_of((best.bench_a, best.bench_b), near, self.state.budget);
            let mut configuration = Configuration::new(self.chain.path, travelled);
            let pair = (best.bench_a as usize, best.bench_b as usize);
            self.solve(&mut configuration, pair.1 + 1)?;
            // A constant clearance is not refined for its last digits.
            if configuration.clearance(pair) < self.limit(&configuration) {
                self.record(&configuration, &[pair])?;
            }
            self.set_quiet_place(&configuration);
        }
        Ok(())
    }

    /// Returns the metres of travel of the head before which no new pair matters. Until then the whole team keeps its
    /// shape, or is behind the quiet place.
    fn nothing_new_until(&self, configuration: &Configuration) -> f64 {
        let path = self.chain.path;
        let quiet = self.quiet.filter(|quiet| progress(path, configuration.places[0], *quiet) > 0.0);
        let rigid = self.chain.rigid_until(configuration.travelled);
        let until = [quiet.map(|quiet| path.travelled(quiet)), rigid].into_iter().flatten();
        until.fold(configuration.travelled, f64::max)
    }
}

impl<'s, 'b: 's> SteppedSearch<'s, 'b> for ChainSearch<'s, '_, 'b> {
    type Bodies = Configuration;
    type Pair = Pair;

    fn state(&mut self) -> &mut SearchState<'s, 'b> {
        &mut self.state
    }

    fn coordinate(at: &Configuration) -> f64 {
        at.travelled
    }

    fn step_unit(&self) -> f64 {
        self.chain.team.shortest_link()
    }

    fn search(&mut self, from: f64, to: f64) -> Result<(), Halt> {
        let chain = self.chain;
        if chain.team.benches < 3 {
            return Ok(());
        }
        let mut start = Configuration::new(chain.path, from);
        self.solve(&mut start, 2)?;
        self.second_handle = start.places[1];
        if self.state.goal == Goal::Least {
            self.solve(&mut start, 3)?;
            self.record(&start, &[(0, 2)])?;
        }
        self.set_quiet_place(&start);
        let pairs = self.candidates(&mut start, None)?;
        // Boards may overlap deeply at the start.
        if self.record_with(&start, &pairs, overlap_centre) {
            return Ok(());
        }
        let (to, rounding_from) = last_solvable(chain, self.state.budget, from, to)?;
        self.rounding_from = rounding_from;
        if self.state.goal == Goal::Least {
            // First a guess, then the proof that no clearance is below it, or a lower clearance.
            self.guess(&start, to)?;
        }
        self.advance(start, to)?;
        self.record_at_lock(to)
    }

    fn skip(&mut self, before: &Configuration, to: f64) -> Result<Option<Configuration>, Halt> {
        let skipped = self.nothing_new_until(before).min(to);
        if skipped <= before.travelled {
            return Ok(None);
        }
        let mut later = Configuration::new(self.chain.path, skipped);
        self.solve(&mut later, 2)?;
        Ok(Some(later))
    }

    fn step(&mut self, before: &mut Configuration, length: f64, to: f64) -> Result<(Configuration, Vec<Pair>), Halt> {
        let most = if self.all_pairs(&[before], 0.0) { 0.5 * self.step_unit() } else { f64::INFINITY };
        let next = (before.travelled + length.min(most)).max(before.travelled.next_up());
        let next = if next >= self.rounding_from { to } else { next.min(to) };
        let mut after = Configuration::new(self.chain.path, next);
        let pairs = self.candidates(before, Some(&mut after))?;
        Ok((after, pairs))
    }

    fn solve_within(
        &mut self,
        _: &Configuration,
        travelled: f64,
        pairs: &[Pair],
    ) -> Result<Option<Configuration>, Halt> {
        within(self.chain, self.state.budget, travelled, benches_of(pairs), self.rounding_from)
    }

    fn retain_uncertain(&mut self, ends: (&Configuration, &Configuration), pairs: &mut Vec<Pair>) -> Result<(), Halt> {
        let mut step = Displacements::default();
        step.extend_to(benches_of(pairs) + 1, self.chain, ends, self.state.budget)?;
        self.retain_uncertain_in(&step, ends, pairs)
    }

    fn clearance(&self, at: &Configuration, pair: Pair) -> f64 {
        at.clearance(pair)
    }

    fn record(&mut self, at: &Configuration, pairs: &[Pair]) -> Result<bool, Halt> {
        Ok(self.record_with(at, pairs, middle_between))
    }
}

/// Returns the number of the foremost benches, up to the last bench of the pairs.
fn benches_of(pairs: &[Pair]) -> usize {
    pairs.iter().map(|&(_, b)| b + 1).max().unwrap_or(0)
}
