//! First contact and least clearance of boards of two dragons of a show, by the steps of [`super`].
//!
//! **Why nothing is skipped.** The proof in [`super`] does not use that two boards belong to one chain: it needs the
//! clearances at both ends of a step and bounds C of the paths of the boards' points on the stage. Here a step is
//! one of time. Each head goes forward along its path, or stands, so that C of each board is that of its own dragon, and
//! B = C_a + C_b. Boards that stand have no path. Two boards on straight lines, neither of which begins or ends to move
//! within the step, move relative to each other by the difference of their two vectors, along a straight line: B is
//! its length. So two dragons that go side by side, or one behind the other, cost few steps.

use nalgebra::center;

use crate::event::Budget;
use crate::linkage::NoFollower;
use crate::model::board::Board;
use crate::model::root::golden_section_min;
use crate::model::separation::{
    circle_bound_board_board, closest_points_board_board, overlap_centre, signed_distance_board_board,
};
use crate::model::{Point, Vector};
use crate::placement::Placement;

use super::configuration::{Configuration, Halt};
use super::displacement::{Displacements, Weights};
use super::search::{MOST_GUESSES, UNIMODAL_SHARE, last_solvable};
use super::{ConservativeAdvancement, Found};

/// A dragon on the stage, as a function of the show's time.
pub struct MovingDragon<'a> {
    chain: ConservativeAdvancement<'a>,
    placement: Placement,
    delay: f64,
    head_speed: f64,
    /// Metres of travel at which it stands or the motion ends, and from which on rounding may prevent a solution.
    end: f64,
    rounding_from: f64,
}

impl<'a> MovingDragon<'a> {
    /// Creates a dragon whose head begins to move at `delay` seconds with `head_speed` metres per second, and stands
    /// or ends at `end` metres of travel.
    ///
    /// # Errors
    /// [`NoFollower`] if no place near the end can be solved.
    pub fn new(
        chain: ConservativeAdvancement<'a>,
        placement: Placement,
        (delay, head_speed, end): (f64, f64, f64),
    ) -> Result<Self, NoFollower> {
        let mut unreported = |_| {};
        let solvable = last_solvable(&chain, &mut Budget::new(u64::MAX, &mut unreported), 0.0, end);
        let (end, rounding_from) = solvable.map_err(|_| NoFollower)?;
        Ok(Self { chain, placement, delay, head_speed, end, rounding_from })
    }

    fn travelled(&self, time: f64) -> f64 {
        (self.head_speed * (time - self.delay).max(0.0)).min(self.end)
    }

    fn benches(&self) -> usize {
        self.chain.team.benches
    }
}

/// Boards of two dragons at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meeting {
    /// Seconds of the show.
    pub time: f64,
    /// Metres between the boards; 0 or less at a contact.
    pub value: f64,
    /// The bench of each dragon, counted from 0 within it.
    pub benches: [usize; 2],
    /// The touching point, or the middle between the boards, on the stage.
    pub place: Point,
}

/// Finds the first contact of two dragons between two times: the first time, to the last digits, at which a signed
/// distance is 0 or less. `searched_until` is a time.
///
/// # Errors
/// [`NoFollower`] if a configuration inside the motion cannot be solved.
pub fn first_contact(
    moving: [&MovingDragon; 2],
    span: (f64, f64),
    budget: &mut Budget,
) -> Result<Found<Meeting>, NoFollower> {
    Search::new(moving, Goal::Contact, budget).run(span)
}

/// Finds the least clearance of two dragons between two times, below that of `best`, if it is given.
///
/// # Errors
/// [`NoFollower`] if a configuration inside the motion cannot be solved.
pub fn least_clearance(
    moving: [&MovingDragon; 2],
    span: (f64, f64),
    best: Option<f64>,
    budget: &mut Budget,
) -> Result<Found<Meeting>, NoFollower> {
    let mut search = Search::new(moving, Goal::Least, budget);
    search.limit = best.unwrap_or(f64::INFINITY);
    search.run(span)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Goal {
    Contact,
    Least,
}

/// A bench of each dragon.
type Pair = [usize; 2];

/// Both dragons at one time, solved as far back as requested.
struct Snapshot {
    time: f64,
    own: [Configuration; 2],
    /// The boards on the stage.
    boards: [Vec<Board>; 2],
}

impl Snapshot {
    fn boards_of(&self, [a, b]: Pair) -> (&Board, &Board) {
        (&self.boards[0][a], &self.boards[1][b])
    }

    fn clearance(&self, pair: Pair) -> f64 {
        let (a, b) = self.boards_of(pair);
        signed_distance_board_board(a, b)
    }

    fn circle_bound(&self, pair: Pair) -> f64 {
        let (a, b) = self.boards_of(pair);
        circle_bound_board_board(a, b)
    }

    fn deepest(&self, pairs: &[Pair]) -> Option<(f64, Pair)> {
        pairs.iter().map(|&pair| (self.clearance(pair), pair)).min_by(|one, other| one.0.total_cmp(&other.0))
    }

    /// Returns the pairs whose circle bound is at most `distance`. The second dragon's boards are sorted into squares.
    fn near_pairs(&self, distance: f64) -> Vec<Pair> {
        let widest = |boards: &[Board]| boards.iter().map(|board| board.circle_radius()).fold(0.0, f64::max);
        let cell = widest(&self.boards[0]) + widest(&self.boards[1]) + distance.max(0.0);
        let key = |board: &Board| ((board.centre.x / cell).floor() as i64, (board.centre.y / cell).floor() as i64);
        let mut cells: Vec<((i64, i64), usize)> = self.boards[1].iter().map(key).zip(0..).collect();
        cells.sort_unstable();
        let mut pairs = Vec::new();
        for (a, board) in self.boards[0].iter().enumerate() {
            let (column, row) = key(board);
            for neighbour in column - 1..=column + 1 {
                let from = cells.partition_point(|(key, _)| *key < (neighbour, row - 1));
                let others = cells[from..].iter().take_while(|(key, _)| *key <= (neighbour, row + 1));
                pairs.extend(others.map(|(_, b)| [a, *b]).filter(|&pair| self.circle_bound(pair) <= distance));
            }
        }
        pairs
    }
}

struct Search<'s, 'a, 'b> {
    moving: [&'s MovingDragon<'a>; 2],
    goal: Goal,
    budget: &'s mut Budget<'b>,
    /// The clearance from which a pair matters: 0, or the least so far.
    limit: f64,
    best: Option<Meeting>,
    searched_until: f64,
}

impl<'s, 'a, 'b> Search<'s, 'a, 'b> {
    fn new(moving: [&'s MovingDragon<'a>; 2], goal: Goal, budget: &'s mut Budget<'b>) -> Self {
        Self { moving, goal, budget, limit: 0.0, best: None, searched_until: f64::NEG_INFINITY }
    }

    fn run(&mut self, (from, to): (f64, f64)) -> Result<Found<Meeting>, NoFollower> {
        self.searched_until = from;
        let searched_until = match self.search(from, to) {
            Ok(()) => to,
            Err(Halt::Spent) => self.searched_until,
            Err(Halt::NoFollower) => return Err(NoFollower),
        };
        Ok(Found { value: self.best, searched_until })
    }

    fn search(&mut self, from: f64, to: f64) -> Result<(), Halt> {
        let start = self.solved(from, None)?;
        let pairs = start.near_pairs(self.limit.max(0.0));
        self.spend(pairs.len())?;
        if let Some((value, pair)) = start.deepest(&pairs).filter(|(value, _)| *value <= self.limit) {
            let (a, b) = start.boards_of(pair);
            let place = if value <= 0.0 { overlap_centre(a, b) } else { middle_between(a, b) };
            self.record(Meeting { time: from, value, benches: pair, place });
        }
        if self.goal == Goal::Least {
            self.guess(from, to)?;
        }
        self.sweep(start, to)
    }

    fn spend(&mut self, work: usize) -> Result<(), Halt> {
        if self.budget.spend(work as u64) { Ok(()) } else { Err(Halt::Spent) }
    }

    fn record(&mut self, meeting: Meeting) {
        if self.goal == Goal::Least {
            self.limit = meeting.value - 8.0 * f64::EPSILON * (meeting.place.coords.norm() + 1.0);
        }
        self.best = Some(meeting);
    }

    /// Returns both dragons at a time, as far back as `benches`, or in full; what stands is taken from `before`.
    /// `None` if rounding prevents a solution at the motion's end.
    fn snapshot(
        &mut self,
        time: f64,
        before: Option<&Snapshot>,
        benches: [usize; 2],
    ) -> Result<Option<Snapshot>, Halt> {
        let mut own: [Configuration; 2] = [0, 1].map(|k| {
            let travelled = self.moving[k].travelled(time);
            match before {
                Some(before) if before.own[k].travelled == travelled => before.own[k].clone(),
                _ => Configuration::new(self.moving[k].chain.path, travelled),
            }
        });
        for (k, own) in own.iter_mut().enumerate() {
            let MovingDragon { chain, rounding_from, .. } = self.moving[k];
            match own.solve_to(benches[k], chain.path, chain.team, self.budget) {
                Err(Halt::NoFollower) if own.travelled >= *rounding_from => return Ok(None),
                outcome => outcome?,
            }
        }
        let placed = |k: usize| {
            let placement = &self.moving[k].placement;
            let on_stage = |board: &Board| Board {
                centre: placement.point(board.centre),
                axis: placement.vector(board.axis),
                ..*board
            };
            own[k].boards.iter().map(on_stage).collect()
        };
        let boards = [0, 1].map(placed);
        Ok(Some(Snapshot { time, own, boards }))
    }

    fn solved(&mut self, time: f64, before: Option<&Snapshot>) -> Result<Snapshot, Halt> {
        let all = self.moving.map(MovingDragon::benches);
        self.snapshot(time, before, all)?.ok_or(Halt::NoFollower)
    }

    /// Guesses the least clearance from places in equal distances, and refines it.
    fn guess(&mut self, from: f64, to: f64) -> Result<(), Halt> {
        let count = ((to - from) / self.time_per_link()).ceil().min(MOST_GUESSES);
        let spacing = (to - from) / count;
        for k in 1..=count as usize {
            let at = self.solved((from + k as f64 * spacing).min(to), None)?;
            let pairs = at.near_pairs(self.limit);
            self.spend(pairs.len())?;
            self.consider(&at, &pairs);
            self.budget.report(0.3 * k as f64 / count);
        }
        let Some(Meeting { time, benches, .. }) = self.best else { return Ok(()) };
        let near = ((time - spacing).max(from), (time + spacing).min(to));
        let (_, time) = golden_section_min(|time| self.clearance_at(time, benches), near.0, near.1);
        if let Some(at) = self.snapshot(time, None, benches.map(|bench| bench + 1))? {
            self.consider(&at, &[benches]);
        }
        Ok(())
    }

    fn clearance_at(&mut self, time: f64, pair: Pair) -> f64 {
        let at = self.snapshot(time, None, pair.map(|bench| bench + 1));
        at.ok().flatten().map_or(f64::INFINITY, |at| at.clearance(pair))
    }

    /// Returns the seconds in which the faster head travels the shortest link.
    fn time_per_link(&self) -> f64 {
        let [a, b] = self.moving;
        let shortest = a.chain.team.shortest_link().min(b.chain.team.shortest_link());
        shortest / a.head_speed.max(b.head_speed)
    }

    /// Goes from `start` to `to` in steps, as [`super::search`]. No step contains a time at which a dragon begins or
    /// ends to move.
    fn sweep(&mut self, start: Snapshot, to: f64) -> Result<(), Halt> {
        if self.goal == Goal::Contact && self.best.is_some() {
            return Ok(());
        }
        let (from, unit) = (start.time, self.time_per_link());
        let [a, b] = self.moving.map(|dragon| [dragon.delay, dragon.delay + dragon.end / dragon.head_speed]);
        let breaks = [a[0], a[1], b[0], b[1]];
        let mut step = 0.25 * unit;
        let mut before = start;
        while before.time < to {
            self.searched_until = before.time;
            let share = (before.time - from) / (to - from);
            self.budget.report(if self.goal == Goal::Least { 0.3 + 0.7 * share } else { share });
            let next = (before.time + step).max(before.time.next_up());
            let ahead = breaks.into_iter().filter(|time| *time > before.time);
            let next = ahead.fold(next, f64::min).min(to);
            let all = self.moving.map(MovingDragon::benches);
            let after = match self.snapshot(next, Some(&before), all)? {
                Some(after) => after,
                None => self.solved(to, Some(&before))?,
            };
            let steps = self.displacements((&before, &after), all)?;
            let mut pairs = before.near_pairs(self.limit + self.most_motion(&steps));
            self.retain_uncertain(&steps, (&before, &after), &mut pairs)?;
            if pairs.is_empty() {
                step *= 2.0;
            } else {
                self.consider(&after, &pairs);
                if self.narrow(&before, &after, pairs)? {
                    return Ok(());
                }
                step = (0.7 * step).max(1e-3 * unit);
            }
            before = after;
        }
        Ok(())
    }

    /// Halves a step until its uncertain pairs are certain or the doubles are exhausted. Returns true at a contact.
    fn narrow(&mut self, before: &Snapshot, after: &Snapshot, pairs: Vec<Pair>) -> Result<bool, Halt> {
        if pairs.is_empty() {
            return Ok(false);
        }
        let benches = [0, 1].map(|k| pairs.iter().map(|pair| pair[k] + 1).max().unwrap_or(0));
        let time = before.time + 0.5 * (after.time - before.time);
        let has_middle = time > before.time && time < after.time;
        let middle = if has_middle { self.snapshot(time, Some(before), benches)? } else { None };
        let Some(middle) = middle else {
            self.consider(after, &pairs);
            return Ok(self.touching(after, &pairs));
        };
        self.consider(&middle, &pairs);
        for ends in [(before, &middle), (&middle, after)] {
            self.searched_until = self.searched_until.max(ends.0.time);
            let mut uncertain = pairs.clone();
            if self.goal == Goal::Least {
                self.retain_possible_minima(ends, [before, &middle, after], &mut uncertain);
            }
            let steps = self.displacements(ends, benches)?;
            self.retain_uncertain(&steps, ends, &mut uncertain)?;
            if self.narrow(ends.0, ends.1, uncertain)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn displacements(&mut self, ends: (&Snapshot, &Snapshot), benches: [usize; 2]) -> Result<[Displacements; 2], Halt> {
        let mut steps = [Displacements::default(), Displacements::default()];
        for (k, step) in steps.iter_mut().enumerate() {
            step.extend_to(benches[k] + 1, &self.moving[k].chain, (&ends.0.own[k], &ends.1.own[k]), self.budget)?;
        }
        Ok(steps)
    }

    /// Returns an upper bound of the relative motion of any two boards, metres.
    fn most_motion(&self, steps: &[Displacements; 2]) -> f64 {
        let most = |k: usize| {
            let dragon = self.moving[k];
            let of = |bench| steps[k].on_stage(&dragon.chain, bench, Weights::Additive);
            (0..dragon.benches()).map(of).fold(0.0, f64::max)
        };
        most(0) + most(1)
    }

    /// Returns B of the proof for two boards.
    fn relative_motion_bound(
        &self,
        steps: &[Displacements; 2],
        ends: (&Snapshot, &Snapshot),
        pair: Pair,
        weights: Weights,
    ) -> f64 {
        let translation = |k: usize| -> Option<Vector> {
            let (before, after) = (&ends.0.own[k], &ends.1.own[k]);
            if before.travelled == after.travelled {
                return Some(Vector::zeros());
            }
            let curvature = steps[k].one_curve(&self.moving[k].chain, (before, after), pair[k])?;
            (curvature == 0.0).then(|| ends.1.boards[k][pair[k]].centre - ends.0.boards[k][pair[k]].centre)
        };
        match (translation(0), translation(1)) {
            (Some(a), Some(b)) => (a - b).norm(),
            _ => (0..2).map(|k| steps[k].on_stage(&self.moving[k].chain, pair[k], weights)).sum(),
        }
    }

    /// Keeps the pairs that may be at or below the limit somewhere in a step.
    fn retain_uncertain(
        &mut self,
        steps: &[Displacements; 2],
        ends: (&Snapshot, &Snapshot),
        pairs: &mut Vec<Pair>,
    ) -> Result<(), Halt> {
        self.spend(pairs.len())?;
        let (before, after) = ends;
        let limit = self.limit;
        let weights = Weights::for_limit(limit);
        pairs.retain(|&pair| {
            let most = 2.0 * limit + self.relative_motion_bound(steps, ends, pair, weights);
            if before.circle_bound(pair) + after.circle_bound(pair) > most {
                return false;
            }
            let (first, last) = (before.clearance(pair), after.clearance(pair));
            first.min(last) <= limit || first + last <= most
        });
        Ok(())
    }

    /// Drops the pairs whose minimum is in the other half, as in [`super::search`].
    fn retain_possible_minima(
        &self,
        half: (&Snapshot, &Snapshot),
        [before, middle, after]: [&Snapshot; 3],
        pairs: &mut Vec<Pair>,
    ) {
        if after.time - before.time > UNIMODAL_SHARE * self.time_per_link() {
            return;
        }
        let first_half = half.0.time == before.time;
        pairs.retain(|&pair| {
            let [first, least, last] = [before, middle, after].map(|at| at.clearance(pair));
            (least < first && least < last) || first_half == (first <= last)
        });
    }

    /// Lowers the least clearance to that of the nearest of `pairs`.
    fn consider(&mut self, at: &Snapshot, pairs: &[Pair]) {
        if self.goal == Goal::Least
            && let Some((value, pair)) = at.deepest(pairs).filter(|(value, _)| *value < self.limit)
        {
            let (a, b) = at.boards_of(pair);
            self.record(Meeting { time: at.time, value, benches: pair, place: middle_between(a, b) });
        }
    }

    /// Records the contact of the deepest pair, if it touches.
    fn touching(&mut self, at: &Snapshot, pairs: &[Pair]) -> bool {
        let touching = at.deepest(pairs).filter(|(value, _)| self.goal == Goal::Contact && *value <= 0.0);
        if let Some((value, pair)) = touching {
            let (a, b) = at.boards_of(pair);
            self.record(Meeting { time: at.time, value, benches: pair, place: middle_between(a, b) });
        }
        touching.is_some()
    }
}

fn middle_between(a: &Board, b: &Board) -> Point {
    let (on_a, on_b) = closest_points_board_board(a, b);
    center(&on_a, &on_b)
}
