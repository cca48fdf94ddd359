//! First contact and least clearance of boards of two dragons of a show, by the steps of [`super`].
//!
//! **Why nothing is skipped.** The proof in [`super`] does not use that two boards belong to one chain. It needs only
//! the clearances at both ends of a step, and bounds C of the paths of the boards' points on the stage. Here a step is
//! an interval of time, in which each head goes forward along its path, or stands. So C of each board follows from its
//! own dragon, and B = C_a + C_b; a board that stands has no path. If two boards are on straight lines, and neither
//! begins or ends to move within the step, they move relative to each other by the difference of their two vectors,
//! along a straight line. Then B is the length of this difference, so that two dragons that go side by side, or one
//! behind the other, need few steps.

use crate::event::Budget;
use crate::linkage::NoFollower;
use crate::model::board::Board;
use crate::model::root::golden_section_min;
use crate::model::separation::{circle_bound_board_board, middle_between, overlap_centre, signed_distance_board_board};
use crate::model::{Point, Vector};
use crate::placement::Placement;

use super::configuration::{Configuration, last_solvable, near_pairs};
use super::displacement::{Displacements, Weights};
use super::stepped_search::{GUESS_SHARE, Goal, Halt, MOST_GUESSES, SearchState, SteppedSearch, may_reach};
use super::{ConservativeAdvancement, Found};

/// A dragon on the stage, as a function of the show's time.
pub struct MovingDragon<'a> {
    chain: ConservativeAdvancement<'a>,
    placement: Placement,
    delay: f64,
    head_speed: f64,
    /// The travel, in metres, at which it stands or the motion ends, and from which on rounding may prevent a solution.
    end: f64,
    rounding_from: f64,
}

impl<'a> MovingDragon<'a> {
    /// Creates a dragon whose head begins to move at `delay` seconds with `head_speed` metres per second, and stands
    /// or ends at `end` metres of travel.
    ///
    /// # Errors
    /// [`NoFollower`] if no place near the end can be solved, or the budget is spent.
    pub fn new(
        chain: ConservativeAdvancement<'a>,
        placement: Placement,
        delay: f64,
        head_speed: f64,
        end: f64,
        budget: &mut Budget,
    ) -> Result<Self, NoFollower> {
        let solvable = last_solvable(&chain, budget, 0.0, end);
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
    /// The time of the show, in seconds.
    pub time: f64,
    /// The distance between the boards, in metres; 0 or less at a contact.
    pub value: f64,
    /// The bench of each dragon, counted from 0 within it.
    pub benches: [usize; 2],
    /// The touching point, or the middle between the boards, on the stage.
    pub place: Point,
}

/// Finds the first contact of two dragons between two times. The first contact is at the first time, to the last
/// digits, at which a signed distance is 0 or less. `searched_until` is a time.
///
/// # Errors
/// [`NoFollower`] if a configuration inside the motion cannot be solved.
pub fn first_contact(
    moving: [&MovingDragon; 2],
    span: (f64, f64),
    budget: &mut Budget,
) -> Result<Found<Meeting>, NoFollower> {
    BetweenSearch::new(moving, Goal::Contact, None, budget).found(span)
}

/// Guesses the least clearance of two dragons between two times: the nearest boards at times of a few metres of travel
/// from each other, refined. Other boards may be nearer at a time between.
///
/// # Errors
/// [`NoFollower`] if a configuration inside the motion cannot be solved.
pub fn guess_least_clearance(
    moving: [&MovingDragon; 2],
    (from, to): (f64, f64),
    budget: &mut Budget,
) -> Result<Option<Meeting>, NoFollower> {
    let mut search = BetweenSearch::new(moving, Goal::Least, None, budget);
    match search.begin(from).and_then(|_| search.guess(from, to)) {
        Ok(()) | Err(Halt::Spent) => Ok(search.best),
        Err(Halt::NoFollower) => Err(NoFollower),
    }
}

/// Finds the least clearance of two dragons between two times, if it is below the clearance of `best` by more than
/// rounding.
///
/// # Errors
/// [`NoFollower`] if a configuration inside the motion cannot be solved.
pub fn least_clearance(
    moving: [&MovingDragon; 2],
    span: (f64, f64),
    best: Option<Meeting>,
    budget: &mut Budget,
) -> Result<Found<Meeting>, NoFollower> {
    BetweenSearch::new(moving, Goal::Least, best, budget).found(span)
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

    /// Returns a lower bound of the distance of any two boards.
    fn least_circle_bound(&self) -> f64 {
        let all = (0..self.boards[0].len()).flat_map(|a| (0..self.boards[1].len()).map(move |b| [a, b]));
        all.map(|pair| self.circle_bound(pair)).fold(f64::INFINITY, f64::min)
    }

    /// Returns the pairs whose circle bound is at most `distance`.
    fn near_pairs(&self, distance: f64) -> Vec<Pair> {
        near_pairs(&self.boards[0], &self.boards[1], distance, |_| true).into_iter().map(Pair::from).collect()
    }
}

struct BetweenSearch<'s, 'a, 'b> {
    moving: [&'s MovingDragon<'a>; 2],
    state: SearchState<'s, 'b>,
    /// The clearance from which a pair matters: 0, or the least so far.
    limit: f64,
    best: Option<Meeting>,
}

impl<'s, 'a, 'b> BetweenSearch<'s, 'a, 'b> {
    fn new(moving: [&'s MovingDragon<'a>; 2], goal: Goal, best: Option<Meeting>, budget: &'s mut Budget<'b>) -> Self {
        let limit = if goal == Goal::Contact { 0.0 } else { best.map_or(f64::INFINITY, limit_below) };
        Self { moving, state: SearchState::new(goal, budget), limit, best: None }
    }

    fn found(mut self, (from, to): (f64, f64)) -> Result<Found<Meeting>, NoFollower> {
        let searched_until = self.run(from, to)?;
        Ok(Found { value: self.best, searched_until })
    }

    /// Returns both dragons at the first time, after their nearest boards have been recorded.
    fn begin(&mut self, from: f64) -> Result<Snapshot, Halt> {
        let start = self.solved(from, None)?;
        let pairs = start.near_pairs(self.limit.max(0.0));
        self.state.budget.spend(pairs.len() as u64)?;
        // Boards may overlap deeply at the start.
        self.record_with(&start, &pairs, overlap_centre);
        Ok(start)
    }

    /// Records the deepest pair, if it touches or is below the least clearance so far. Returns true at a contact, whose
    /// place `touching_point` returns.
    fn record_with(&mut self, at: &Snapshot, pairs: &[Pair], touching_point: impl Fn(&Board, &Board) -> Point) -> bool {
        let least = self.state.goal == Goal::Least;
        let matters = |value: f64| if least { value < self.limit } else { value <= self.limit };
        let Some((value, pair)) = at.deepest(pairs).filter(|(value, _)| matters(*value)) else { return false };
        let (a, b) = at.boards_of(pair);
        let meeting = Meeting { time: at.time, value, benches: pair, place: touching_point(a, b) };
        if least {
            self.limit = limit_below(meeting);
        }
        self.best = Some(meeting);
        !least
    }

    /// Returns both dragons at a time, as far back as `benches`, or in full; a dragon that stands is taken from
    /// `before`. `None` if rounding prevents a solution at the motion's end.
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
            match own.solve_to(benches[k], chain.path, chain.team, self.state.budget) {
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

    /// Guesses the least clearance from places in equal distances, and refines it. Places are left out from which the
    /// dragons come no nearer than the least so far, at the speeds of their heads.
    fn guess(&mut self, from: f64, to: f64) -> Result<(), Halt> {
        let spacing = (to - from) / ((to - from) / self.step_unit()).ceil().min(MOST_GUESSES);
        let closing = self.moving.iter().map(|dragon| dragon.head_speed).sum::<f64>();
        let mut time = from;
        while time < to {
            let at = self.solved(time, None)?;
            let pairs = at.near_pairs(self.limit);
            self.state.budget.spend(pairs.len() as u64)?;
            self.record(&at, &pairs)?;
            let far = if pairs.is_empty() { at.least_circle_bound() - self.limit } else { 0.0 };
            time += (far / closing).max(spacing);
            self.state.budget.report(GUESS_SHARE * ((time - from) / (to - from)).min(1.0));
        }
        let last = self.solved(to, None)?;
        let pairs = last.near_pairs(self.limit);
        self.record(&last, &pairs)?;
        let Some(Meeting { time, benches, .. }) = self.best else { return Ok(()) };
        let near = ((time - spacing).max(from), (time + spacing).min(to));
        let (_, time) = golden_section_min(|time| self.clearance_at(time, benches), near.0, near.1);
        if let Some(at) = self.snapshot(time, None, benches.map(|bench| bench + 1))? {
            self.record(&at, &[benches])?;
        }
        Ok(())
    }

    fn clearance_at(&mut self, time: f64, pair: Pair) -> f64 {
        let at = self.snapshot(time, None, pair.map(|bench| bench + 1));
        at.ok().flatten().map_or(f64::INFINITY, |at| at.clearance(pair))
    }

    fn displacements(&mut self, ends: (&Snapshot, &Snapshot), benches: [usize; 2]) -> Result<[Displacements; 2], Halt> {
        let mut steps = [Displacements::default(), Displacements::default()];
        for (k, step) in steps.iter_mut().enumerate() {
            step.extend_to(benches[k] + 1, &self.moving[k].chain, (&ends.0.own[k], &ends.1.own[k]), self.state.budget)?;
        }
        Ok(steps)
    }

    /// Returns an upper bound of the relative motion of any two boards, in metres.
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
    fn retain_uncertain_in(
        &mut self,
        steps: &[Displacements; 2],
        ends: (&Snapshot, &Snapshot),
        pairs: &mut Vec<Pair>,
    ) -> Result<(), Halt> {
        self.state.budget.spend(pairs.len() as u64)?;
        let weights = Weights::for_limit(self.limit);
        let both = [ends.0, ends.1];
        pairs.retain(|&pair| {
            let motion = self.relative_motion_bound(steps, ends, pair, weights);
            may_reach(self.limit, motion, both.map(|at| at.circle_bound(pair)), || both.map(|at| at.clearance(pair)))
        });
        Ok(())
    }
}

impl<'s, 'b: 's> SteppedSearch<'s, 'b> for BetweenSearch<'s, '_, 'b> {
    type Bodies = Snapshot;
    type Pair = Pair;

    fn state(&mut self) -> &mut SearchState<'s, 'b> {
        &mut self.state
    }

    fn coordinate(at: &Snapshot) -> f64 {
        at.time
    }

    /// Returns the seconds in which the faster head travels the shortest link.
    fn step_unit(&self) -> f64 {
        let [a, b] = self.moving;
        let shortest = a.chain.team.shortest_link().min(b.chain.team.shortest_link());
        shortest / a.head_speed.max(b.head_speed)
    }

    fn search(&mut self, from: f64, to: f64) -> Result<(), Halt> {
        let start = self.begin(from)?;
        match self.state.goal {
            Goal::Contact if self.best.is_some() => return Ok(()),
            Goal::Contact => {}
            Goal::Least => self.guess(from, to)?,
        }
        self.advance(start, to)
    }

    /// No step contains a time at which a dragon begins or ends to move.
    fn step(&mut self, before: &mut Snapshot, length: f64, to: f64) -> Result<(Snapshot, Vec<Pair>), Halt> {
        let next = (before.time + length).max(before.time.next_up());
        let breaks = self.moving.map(|dragon| [dragon.delay, dragon.delay + dragon.end / dragon.head_speed]);
        let ahead = breaks.into_iter().flatten().filter(|time| *time > before.time);
        let next = ahead.fold(next, f64::min).min(to);
        let all = self.moving.map(MovingDragon::benches);
        let after = match self.snapshot(next, Some(before), all)? {
            Some(after) => after,
            None => self.solved(to, Some(before))?,
        };
        let steps = self.displacements((before, &after), all)?;
        let mut pairs = before.near_pairs(self.limit + self.most_motion(&steps));
        self.retain_uncertain_in(&steps, (before, &after), &mut pairs)?;
        Ok((after, pairs))
    }

    fn solve_within(&mut self, before: &Snapshot, time: f64, pairs: &[Pair]) -> Result<Option<Snapshot>, Halt> {
        self.snapshot(time, Some(before), benches_of(pairs))
    }

    fn retain_uncertain(&mut self, ends: (&Snapshot, &Snapshot), pairs: &mut Vec<Pair>) -> Result<(), Halt> {
        let steps = self.displacements(ends, benches_of(pairs))?;
        self.retain_uncertain_in(&steps, ends, pairs)
    }

    fn clearance(&self, at: &Snapshot, pair: Pair) -> f64 {
        at.clearance(pair)
    }

    fn record(&mut self, at: &Snapshot, pairs: &[Pair]) -> Result<bool, Halt> {
        Ok(self.record_with(at, pairs, middle_between))
    }
}

/// Returns the clearance from which a pair is nearer than the least so far by more than the rounding of both.
fn limit_below(least: Meeting) -> f64 {
    least.value - 8.0 * f64::EPSILON * (least.place.coords.norm() + 1.0)
}

/// Returns the number of each dragon's foremost benches, up to the last bench of the pairs.
fn benches_of(pairs: &[Pair]) -> [usize; 2] {
    [0, 1].map(|k| pairs.iter().map(|pair| pair[k] + 1).max().unwrap_or(0))
}
