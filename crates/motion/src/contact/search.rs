//! The search: steps of the head, the pairs that matter in each, and halving of uncertain steps.

use nalgebra::center;

use crate::event::{Budget, Event};
use crate::linkage::NoFollower;
use crate::model::Point;
use crate::model::path::Param;
use crate::model::root::bisect_predicate;
use crate::model::separation::{closest_points_board_board, overlap_centre};
use bench_dragon_messages::state::EventKind;

use super::configuration::{Configuration, Halt, Pair};
use super::displacement::{Displacements, progress};
use super::reach::quiet_place;
use super::{ConservativeAdvancement, Found, LeastClearance};

/// Within this share of the shortest link, the clearance of one pair is assumed to have one minimum: the only part of
/// the least clearance without proof.
pub(super) const UNIMODAL_SHARE: f64 = 1e-2;

/// Greatest number of configurations for a first guess of the least clearance.
pub(super) const MOST_GUESSES: f64 = 1000.0;

/// See [`ConservativeAdvancement::first_contact`].
pub(super) fn first_contact(
    chain: &ConservativeAdvancement,
    from: f64,
    to: f64,
    budget: &mut Budget,
) -> Result<Found<Event>, NoFollower> {
    let mut search = AdvancementSearch::new(chain, Goal::Contact, budget);
    let outcome = if chain.team.benches < 3 { Ok(None) } else { search.contact(from, to) };
    let searched_until = search.searched_until(&outcome, to)?;
    Ok(Found { value: outcome.ok().flatten(), searched_until })
}

/// See [`ConservativeAdvancement::least_clearance`].
pub(super) fn least_clearance(
    chain: &ConservativeAdvancement,
    from: f64,
    to: f64,
    budget: &mut Budget,
) -> Result<Found<LeastClearance>, NoFollower> {
    let mut search = AdvancementSearch::new(chain, Goal::Least, budget);
    let outcome = if chain.team.benches < 3 { Ok(()) } else { search.least(from, to) };
    let searched_until = search.searched_until(&outcome, to)?;
    Ok(Found { value: search.best, searched_until })
}

/// The goal of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Goal {
    Contact,
    Least,
}

pub(super) struct AdvancementSearch<'s, 'a, 'b> {
    pub(super) chain: &'s ConservativeAdvancement<'a>,
    goal: Goal,
    pub(super) budget: &'s mut Budget<'b>,
    /// The least clearance so far.
    best: Option<LeastClearance>,
    /// Place of handle 1 at the beginning: S of the proof.
    pub(super) second_handle: Param,
    /// The quiet place, if there is one.
    pub(super) quiet: Option<Param>,
    /// Metres of travel from which on rounding may prevent a solution: the motion's end may be a lock.
    rounding_from: f64,
    searched_until: f64,
}

impl<'s, 'a, 'b> AdvancementSearch<'s, 'a, 'b> {
    fn new(chain: &'s ConservativeAdvancement<'a>, goal: Goal, budget: &'s mut Budget<'b>) -> Self {
        Self {
            chain,
            goal,
            budget,
            best: None,
            second_handle: chain.path.param_at(0.0),
            quiet: None,
            rounding_from: f64::INFINITY,
            searched_until: f64::NEG_INFINITY,
        }
    }

    /// Returns how far the search came with this outcome.
    fn searched_until<T>(&self, outcome: &Result<T, Halt>, to: f64) -> Result<f64, NoFollower> {
        match outcome {
            Ok(_) => Ok(to),
            Err(Halt::Spent) => Ok(self.searched_until),
            Err(Halt::NoFollower) => Err(NoFollower),
        }
    }

    fn contact(&mut self, from: f64, to: f64) -> Result<Option<Event>, Halt> {
        let mut start = self.begin(from)?;
        let pairs = self.candidates(&mut start, None)?;
        if let Some((value, (a, b))) = start.deepest(&pairs)
            && value <= 0.0
        {
            let place = overlap_centre(&start.boards[a], &start.boards[b]);
            return Ok(Some(contact_event(from, (a, b), place)));
        }
        let (to, rounding_from) = last_solvable(self.chain, self.budget, from, to)?;
        self.rounding_from = rounding_from;
        self.sweep(start, to)
    }

    fn least(&mut self, from: f64, to: f64) -> Result<(), Halt> {
        let mut start = self.begin(from)?;
        self.solve(&mut start, 3)?;
        self.consider(&start, &[(0, 2)]);
        self.set_quiet_place(&start);
        let pairs = self.candidates(&mut start, None)?;
        self.consider(&start, &pairs);
        let (to, rounding_from) = last_solvable(self.chain, self.budget, from, to)?;
        self.rounding_from = rounding_from;
        // First a guess, then the proof that no clearance is below it, or a lower clearance.
        self.guess(&start, to)?;
        self.sweep(start, to).map(|_| ())
    }

    /// Returns the configuration with which a search begins.
    fn begin(&mut self, from: f64) -> Result<Configuration, Halt> {
        self.searched_until = from;
        let mut start = Configuration::new(self.chain.path, from);
        self.solve(&mut start, 2)?;
        self.second_handle = start.places[1];
        self.set_quiet_place(&start);
        Ok(start)
    }

    fn set_quiet_place(&mut self, at: &Configuration) {
        self.quiet = quiet_place(self.chain.path, self.chain.team, self.limit(at));
    }

    pub(super) fn solve(&mut self, configuration: &mut Configuration, benches: usize) -> Result<(), Halt> {
        configuration.solve_to(benches, self.chain.path, self.chain.team, self.budget)
    }

    /// Returns the clearance from which a pair matters: 0, or less than the least one by more than the rounding of two
    /// boards there.
    pub(super) fn limit(&self, at: &Configuration) -> f64 {
        let size = self.chain.team.longest_link() + at.boards[0].centre.coords.norm();
        match (self.goal, self.best) {
            (Goal::Contact, _) => 0.0,
            (Goal::Least, Some(best)) => best.value - 8.0 * f64::EPSILON * size,
            (Goal::Least, None) => f64::INFINITY,
        }
    }

    /// Lowers the least clearance to that of the nearest of `pairs`.
    fn consider(&mut self, configuration: &Configuration, pairs: &[Pair]) {
        if self.goal == Goal::Least
            && let Some((value, (a, b))) = configuration.deepest(pairs)
            && self.best.is_none_or(|best| value < best.value)
        {
            let travelled = configuration.travelled;
            self.best = Some(LeastClearance { value, travelled, bench_a: a as u32, bench_b: b as u32 });
        }
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
            self.consider(&configuration, &pairs);
            skipped = self.nothing_new_until(&configuration);
            self.budget.report(0.3 * k as f64 / count);
        }
        if let Some(best) = self.best {
            let near = ((best.travelled - spacing).max(from), (best.travelled + spacing).min(to));
            let (_, travelled) = self.chain.minimum_of((best.bench_a, best.bench_b), near.0, near.1);
            let mut configuration = Configuration::new(self.chain.path, travelled);
            let pair = (best.bench_a as usize, best.bench_b as usize);
            self.solve(&mut configuration, pair.1 + 1)?;
            // A constant clearance is not refined for its last digits.
            if configuration.clearance(pair) < self.limit(&configuration) {
                self.consider(&configuration, &[pair]);
            }
            self.set_quiet_place(&configuration);
        }
        Ok(())
    }

    /// Returns the metres of travel of the head before which no new pair matters: the whole team keeps its shape, or is
    /// behind the quiet place.
    fn nothing_new_until(&self, configuration: &Configuration) -> f64 {
        let path = self.chain.path;
        let quiet = self.quiet.filter(|quiet| progress(path, configuration.places[0], *quiet) > 0.0);
        let rigid = self.chain.rigid_until(configuration.travelled);
        let until = [quiet.map(|quiet| path.travelled(quiet)), rigid].into_iter().flatten();
        until.fold(configuration.travelled, f64::max)
    }

    /// Goes from `start` to `to` in steps. Each has the length that was proved at once before; uncertain steps are
    /// halved.
    fn sweep(&mut self, start: Configuration, to: f64) -> Result<Option<Event>, Halt> {
        let (from, shortest) = (start.travelled, self.chain.team.shortest_link());
        let mut step = 0.25 * shortest;
        let mut before = start;
        while before.travelled < to {
            self.searched_until = before.travelled;
            let share = (before.travelled - from) / (to - from);
            self.budget.report(if self.goal == Goal::Least { 0.3 + 0.7 * share } else { share });
            let skipped = self.nothing_new_until(&before).min(to);
            if skipped > before.travelled {
                before = Configuration::new(self.chain.path, skipped);
                self.solve(&mut before, 2)?;
                continue;
            }
            let most = if self.all_pairs(&[&before], 0.0) { 0.5 * shortest } else { f64::INFINITY };
            let next = (before.travelled + step.min(most)).max(before.travelled.next_up());
            let next = if next >= self.rounding_from { to } else { next.min(to) };
            let mut after = Configuration::new(self.chain.path, next);
            let pairs = self.candidates(&mut before, Some(&mut after))?;
            if pairs.is_empty() {
                step *= 2.0;
            } else {
                self.consider(&after, &pairs);
                if let Some(event) = self.narrow(&before, &after, pairs)? {
                    return Ok(Some(event));
                }
                step = (0.7 * step).max(1e-3 * shortest);
            }
            before = after;
        }
        self.searched_until = to;
        Ok(None)
    }

    /// Halves a step until its uncertain pairs are certain or the doubles are exhausted.
    fn narrow(
        &mut self,
        before: &Configuration,
        after: &Configuration,
        pairs: Vec<Pair>,
    ) -> Result<Option<Event>, Halt> {
        let Some(benches) = pairs.iter().map(|&(_, b)| b + 1).max() else { return Ok(None) };
        let Some(middle) = middle(self.chain, self.budget, (before, after), benches, self.rounding_from)? else {
            self.consider(after, &pairs);
            return Ok(self.touching(after, &pairs));
        };
        self.consider(&middle, &pairs);
        for ends in [(before, &middle), (&middle, after)] {
            self.searched_until = self.searched_until.max(ends.0.travelled);
            let mut uncertain = pairs.clone();
            if self.goal == Goal::Least {
                self.retain_possible_minima(ends, [before, &middle, after], &mut uncertain);
            }
            let mut step = Displacements::default();
            step.extend_to(benches + 1, self.chain, ends, self.budget)?;
            self.retain_uncertain(&step, ends, self.limit(before), &mut uncertain)?;
            if let Some(event) = self.narrow(ends.0, ends.1, uncertain)? {
                return Ok(Some(event));
            }
        }
        Ok(None)
    }

    /// Drops the pairs whose minimum is in the other half, if the step is so short that each pair's clearance has one
    /// minimum.
    fn retain_possible_minima(
        &self,
        half: (&Configuration, &Configuration),
        [before, middle, after]: [&Configuration; 3],
        pairs: &mut Vec<Pair>,
    ) {
        if after.travelled - before.travelled > UNIMODAL_SHARE * self.chain.team.shortest_link() {
            return;
        }
        let first_half = half.0.travelled == before.travelled;
        pairs.retain(|&pair| {
            let [first, least, last] = [before, middle, after].map(|at| at.clearance(pair));
            (least < first && least < last) || first_half == (first <= last)
        });
    }

    fn touching(&self, at: &Configuration, pairs: &[Pair]) -> Option<Event> {
        let (_, (a, b)) = at.deepest(pairs).filter(|(value, _)| self.goal == Goal::Contact && *value <= 0.0)?;
        let (on_a, on_b) = closest_points_board_board(&at.boards[a], &at.boards[b]);
        Some(contact_event(at.travelled, (a, b), center(&on_a, &on_b)))
    }
}

/// Returns the last place up to `to` at which the whole team can be solved, and the metres of travel from which on
/// rounding may prevent a solution.
pub(super) fn last_solvable(
    chain: &ConservativeAdvancement,
    budget: &mut Budget,
    from: f64,
    to: f64,
) -> Result<(f64, f64), Halt> {
    let (path, team) = (chain.path, chain.team);
    let rounding_from = to - 1e-9 * (to.abs() + team.longest_link());
    let mut solve = |travelled| Configuration::new(path, travelled).solve_to(team.benches, path, team, budget);
    match solve(to) {
        Err(Halt::NoFollower) if to > from => {}
        outcome => return outcome.map(|()| (to, rounding_from)),
    }
    let last = bisect_predicate(|travelled| solve(travelled).is_err(), from, to).next_down();
    solve(last)?;
    if last >= rounding_from { Ok((last, rounding_from)) } else { Err(Halt::NoFollower) }
}

/// Returns the configuration half way; `None` if the doubles are exhausted, or rounding prevents it at the motion's end.
pub(super) fn middle(
    chain: &ConservativeAdvancement,
    budget: &mut Budget,
    (before, after): (&Configuration, &Configuration),
    benches: usize,
    rounding_from: f64,
) -> Result<Option<Configuration>, Halt> {
    let travelled = before.travelled + 0.5 * (after.travelled - before.travelled);
    if travelled <= before.travelled || travelled >= after.travelled {
        return Ok(None);
    }
    let mut middle = Configuration::new(chain.path, travelled);
    match middle.solve_to(benches, chain.path, chain.team, budget) {
        Err(Halt::NoFollower) if travelled >= rounding_from => Ok(None),
        outcome => outcome.map(|()| Some(middle)),
    }
}

/// Returns the contact of two boards.
fn contact_event(travelled: f64, (a, b): Pair, place: Point) -> Event {
    let (bench_a, bench_b) = (Some(a as u32), Some(b as u32));
    Event { kind: EventKind::Contact, travelled, bench_a, bench_b, place: Some(place) }
}
