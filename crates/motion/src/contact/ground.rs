//! First touches of the obstacles of a ground and the least clearance of each, by the steps of [`super`].
//!
//! **Why nothing is skipped.** An obstacle stands still, so the proof in [`super`] holds with B = C of the board.
//! Suppose that the board's distance d from the shape is at most x >= 0 at some time of a step. Let P of the board and
//! Q of the shape be the nearest points at that time, or a common point. At both ends of the step P is at least as far
//! from Q as the distances d_start and d_end, and P moves along a path no longer than C. It follows that d_start +
//! d_end <= 2 x + C. Where the clearance sought is an overlap, d < 0, the displacements that are additive take C's
//! place.
//!
//! This holds for a convex shape. For another shape it fails where a board leaves a pocket, because the least
//! translation may jump there. So a board that is C longer and wider to each side takes the board's place. In the whole
//! step the board is within this larger board, and therefore the least translation that frees the larger board also
//! frees the board at any time of the step.
//!
//! **Along a straight line** a board only moves by a vector D, so its distance from a side of a shape is a convex
//! function of the way. The slopes at both ends of the step bound this function from below, and along a wall nothing is
//! lost. **Along a circle** the board and the circle's centre keep their distance, so a round obstacle moves past the
//! board by the turn times the distance of the two centres.
//!
//! **Which boards.** A body board is where board 1 is when handle 1 is at the front handle's place. So boards behind
//! board 1 matter only in steps in which handle 2 is somewhere behind the first place of handle 1, as in [`super`]. A
//! tail with a size of its own always matters, and is solved with all boards ahead of it.

use crate::event::Budget;
use crate::ground::{Ground, Obstacle};
use crate::linkage::NoFollower;
use crate::model::board::Board;
use crate::model::curve_bounds::CurveBounds;
use crate::model::path::Param;
use crate::model::root::golden_section_min;
use crate::model::shape::ShapeKind;
use crate::model::{Point, Vector};

use super::ConservativeAdvancement;
use super::configuration::{Configuration, last_solvable, within};
use super::displacement::{Displacements, Weights, progress};
use super::stepped_search::{GUESS_SHARE, Goal, Halt, MOST_GUESSES, SearchState, SteppedSearch};

/// The first touch of an obstacle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// The obstacle's number on its ground.
    pub obstacle: usize,
    /// The distance that the head has travelled, in metres.
    pub travelled: f64,
    /// The bench that touches, counted from 0; of several the one deepest within the keep-out.
    pub bench: u32,
    /// The point of its board that is nearest to the obstacle.
    pub place: Point,
}

/// The least clearance of an obstacle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObstacleClearance {
    /// The clearance, in metres; negative if a board is within the keep-out.
    pub value: f64,
    /// The distance that the head has travelled, in metres.
    pub travelled: f64,
    /// The bench, counted from 0.
    pub bench: u32,
}

/// A bench and an obstacle.
type Meeting = (usize, usize);

/// Rounding of a clearance that no search resolves, as a share of the coordinates.
const RESOLUTION: f64 = 1e-13;

/// Coarse tests that cost as much as one unit of work.
const COARSE_TESTS_PER_UNIT: usize = 16;

struct GroundSearch<'s, 'a, 'b> {
    chain: &'s ConservativeAdvancement<'a>,
    obstacles: &'s [Obstacle],
    state: SearchState<'s, 'b>,
    /// By obstacle: its first touch.
    touches: Vec<Option<Touch>>,
    /// By obstacle: the least clearance so far.
    best: Vec<Option<ObstacleClearance>>,
    /// The place of handle 1 at the beginning.
    second_handle: Param,
    /// The travel, in metres, from which on rounding may prevent a solution.
    rounding_from: f64,
}

/// The results of a search, and the metres of travel up to which the search came.
type Results<T> = Result<(Vec<Option<T>>, f64), NoFollower>;

/// See [`ConservativeAdvancement::first_touches`].
pub(super) fn first_touches(
    chain: &ConservativeAdvancement,
    ground: &Ground,
    (from, to): (f64, f64),
    budget: &mut Budget,
) -> Results<Touch> {
    let mut search = GroundSearch::new(chain, ground, Goal::Contact, budget);
    let until = search.run(from, to)?;
    Ok((search.touches, until))
}

/// See [`ConservativeAdvancement::obstacle_clearances`].
pub(super) fn least_clearances(
    chain: &ConservativeAdvancement,
    ground: &Ground,
    (from, to): (f64, f64),
    budget: &mut Budget,
) -> Results<ObstacleClearance> {
    let mut search = GroundSearch::new(chain, ground, Goal::Least, budget);
    let until = search.run(from, to)?;
    Ok((search.best, until))
}

impl<'s, 'a, 'b> GroundSearch<'s, 'a, 'b> {
    fn new(chain: &'s ConservativeAdvancement<'a>, ground: &'s Ground, goal: Goal, budget: &'s mut Budget<'b>) -> Self {
        let obstacles = ground.obstacles();
        Self {
            chain,
            obstacles,
            state: SearchState::new(goal, budget),
            touches: vec![None; obstacles.len()],
            best: vec![None; obstacles.len()],
            second_handle: chain.path.param_at(0.0),
            rounding_from: f64::INFINITY,
        }
    }

    fn solve(&mut self, configuration: &mut Configuration, benches: usize) -> Result<(), Halt> {
        configuration.solve_to(benches, self.chain.path, self.chain.team, self.state.budget)
    }

    /// Returns the clearance of an obstacle from which a board matters; `None` if none does.
    fn limit(&self, obstacle: usize, at: &Board) -> Option<f64> {
        match (self.state.goal, self.best[obstacle]) {
            (Goal::Contact, _) => self.touches[obstacle].is_none().then_some(0.0),
            (Goal::Least, Some(best)) if best.value == f64::NEG_INFINITY => None,
            (Goal::Least, Some(best)) => {
                let size = self.chain.team.longest_link() + at.centre.coords.norm() + best.value.abs();
                Some(best.value - RESOLUTION * size)
            }
            (Goal::Least, None) => Some(f64::INFINITY),
        }
    }

    /// Returns each of the foremost benches with each obstacle.
    fn all_meetings(&self, benches: usize) -> Vec<Meeting> {
        (0..benches).flat_map(|bench| (0..self.obstacles.len()).map(move |j| (bench, j))).collect()
    }

    /// Guesses the least clearances from places of the head at least the shortest link apart, and refines them.
    fn guess(&mut self, from: f64, to: f64) -> Result<(), Halt> {
        let count = ((to - from) / self.chain.team.shortest_link()).ceil().min(MOST_GUESSES);
        let spacing = (to - from) / count;
        let benches = self.chain.team.benches.min(2);
        for k in 1..=count as usize {
            let mut configuration = Configuration::new(self.chain.path, (from + k as f64 * spacing).min(to));
            self.solve(&mut configuration, benches)?;
            self.record(&configuration, &self.all_meetings(benches))?;
            self.state.budget.report(GUESS_SHARE * k as f64 / count);
        }
        for j in 0..self.obstacles.len() {
            let Some(ObstacleClearance { travelled, bench, .. }) = self.best[j] else { continue };
            let bench = bench as usize;
            let clearance = |travelled: f64| {
                let mut configuration = Configuration::new(self.chain.path, travelled);
                let solved = configuration.solve_to(bench + 1, self.chain.path, self.chain.team, self.state.budget);
                solved.map_or(f64::INFINITY, |()| self.obstacles[j].clearance(&configuration.boards[bench]))
            };
            let near = ((travelled - spacing).max(from), (travelled + spacing).min(to));
            let (_, travelled) = golden_section_min(clearance, near.0, near.1);
            let mut configuration = Configuration::new(self.chain.path, travelled);
            self.solve(&mut configuration, bench + 1)?;
            // A constant clearance is not refined for its last digits.
            let board = &configuration.boards[bench];
            if self.limit(j, board).is_some_and(|limit| self.obstacles[j].clearance(board) < limit) {
                self.record(&configuration, &[(bench, j)])?;
            }
        }
        Ok(())
    }

    /// Returns the boards that may come to the limit of an obstacle in a step.
    fn candidates(&mut self, before: &mut Configuration, after: &mut Configuration) -> Result<Vec<Meeting>, Halt> {
        let all_benches = self.chain.team.benches;
        let mut benches = all_benches.min(2);
        let mut step = Displacements::default();
        self.extend(before, after, &mut step, benches)?;
        if all_benches > 2 {
            let excursion = step.excursion();
            let behind = |at: Param| {
                if excursion == 0.0 {
                    progress(self.chain.path, at, self.second_handle) > 0.0
                } else {
                    self.chain.path.arc_length(at, self.second_handle) > -excursion
                }
            };
            if self.chain.team.own_tail().is_some() || behind(before.places[2]) || behind(after.places[2]) {
                benches = all_benches;
                self.extend(before, after, &mut step, benches)?;
            }
        }
        self.state.budget.spend((benches * self.obstacles.len() / COARSE_TESTS_PER_UNIT) as u64)?;
        let near = |meeting: &Meeting| self.coarse_limit(&step, (before, after), *meeting).is_some();
        let mut meetings: Vec<Meeting> = self.all_meetings(benches).into_iter().filter(near).collect();
        self.retain_uncertain_in(&step, (before, after), &mut meetings)?;
        Ok(meetings)
    }

    fn extend(
        &mut self,
        before: &mut Configuration,
        after: &mut Configuration,
        step: &mut Displacements,
        benches: usize,
    ) -> Result<(), Halt> {
        self.solve(before, benches)?;
        self.solve(after, benches)?;
        step.extend_to(benches + 1, self.chain, (before, after), self.state.budget)
    }

    /// Returns the limit of a meeting. Returns also the greatest sum of the clearances at both ends of a step with
    /// which the limit may be reached. Returns `None` if the circles about the board exclude that.
    fn coarse_limit(
        &self,
        step: &Displacements,
        (before, after): (&Configuration, &Configuration),
        (bench, j): Meeting,
    ) -> Option<(f64, f64)> {
        let (obstacle, first, last) = (&self.obstacles[j], &before.boards[bench], &after.boards[bench]);
        let limit = self.limit(j, first)?;
        let weights = Weights::for_limit(limit + obstacle.keep_out);
        let most = 2.0 * limit + step.on_stage(self.chain, bench, weights);
        let is_near = obstacle.coarse_clearance(first) + obstacle.coarse_clearance(last) <= most;
        is_near.then_some((limit, most))
    }

    /// Keeps the boards that may come to the limit of an obstacle somewhere in a step.
    fn retain_uncertain_in(
        &mut self,
        step: &Displacements,
        ends: (&Configuration, &Configuration),
        meetings: &mut Vec<Meeting>,
    ) -> Result<(), Halt> {
        let mut tested = 0;
        meetings.retain(|&(bench, j)| {
            let (before, after) = (&ends.0.boards[bench], &ends.1.boards[bench]);
            let Some((limit, most)) = self.coarse_limit(step, ends, (bench, j)) else { return false };
            let obstacle = &self.obstacles[j];
            tested += 1;
            let (first, last) = (obstacle.clearance(before), obstacle.clearance(after));
            if first.min(last) <= limit {
                return true;
            }
            if limit + obstacle.keep_out < 0.0 && !obstacle.shape.is_convex() {
                tested += 1;
                let moved = step.on_stage(self.chain, bench, Weights::for_limit(limit + obstacle.keep_out));
                return obstacle.clearance(&before.grown(moved)) <= limit;
            }
            first + last <= most && !self.is_far_on_one_curve(step, ends, (bench, j), limit)
        });
        Ok(self.state.budget.spend(tested)?)
    }

    /// Returns true if a board that stays on one line or circle is proved to stay above the limit. Its clearance must
    /// exceed the limit at both ends.
    fn is_far_on_one_curve(
        &self,
        step: &Displacements,
        ends: (&Configuration, &Configuration),
        (bench, j): Meeting,
        limit: f64,
    ) -> bool {
        let Some(curvature) = step.one_curve(self.chain, ends, bench) else { return false };
        let (before, after) = (&ends.0.boards[bench], &ends.1.boards[bench]);
        let obstacle = &self.obstacles[j];
        if limit + obstacle.keep_out < 0.0 {
            return false;
        }
        if curvature == 0.0 {
            let way = after.centre - before.centre;
            let sides = obstacle.shape.side_distances(before).zip(obstacle.shape.side_distances(after));
            return sides.into_iter().all(|(first, last)| {
                first.0 > 0.0 && last.0 > 0.0 && convex_bound(first, last, way) - obstacle.keep_out > limit
            });
        }
        if obstacle.shape.kind() != ShapeKind::Circle {
            return false;
        }
        let (path, front) = (self.chain.path, ends.0.places[bench]);
        let tangent = path.tangent(front);
        let centre = path.point(front) + Vector::new(-tangent.y, tangent.x) / curvature;
        let turned = path.segment(front).length_bound(front.at, ends.1.places[bench].at);
        let turned =
            if ends.1.places[bench].segment == front.segment { turned * curvature.abs() } else { return false };
        let most = 2.0 * limit + turned * (obstacle.shape.points()[0] - centre).norm();
        obstacle.clearance(before) + obstacle.clearance(after) > most
    }
}

impl<'s, 'b: 's> SteppedSearch<'s, 'b> for GroundSearch<'s, '_, 'b> {
    type Bodies = Configuration;
    type Pair = Meeting;

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
        let mut start = Configuration::new(self.chain.path, from);
        let benches = self.chain.team.benches;
        self.solve(&mut start, benches)?;
        self.second_handle = start.places[1];
        if self.record(&start, &self.all_meetings(benches))? {
            return Ok(());
        }
        let (to, rounding_from) = last_solvable(self.chain, self.state.budget, from, to)?;
        self.rounding_from = rounding_from;
        if self.state.goal == Goal::Least {
            self.guess(from, to)?;
        }
        self.advance(start, to)
    }

    fn step(
        &mut self,
        before: &mut Configuration,
        length: f64,
        to: f64,
    ) -> Result<(Configuration, Vec<Meeting>), Halt> {
        let next = (before.travelled + length).max(before.travelled.next_up());
        let next = if next >= self.rounding_from { to } else { next.min(to) };
        let mut after = Configuration::new(self.chain.path, next);
        let meetings = self.candidates(before, &mut after)?;
        Ok((after, meetings))
    }

    fn solve_within(
        &mut self,
        _: &Configuration,
        travelled: f64,
        meetings: &[Meeting],
    ) -> Result<Option<Configuration>, Halt> {
        within(self.chain, self.state.budget, travelled, benches_of(meetings), self.rounding_from)
    }

    fn retain_uncertain(
        &mut self,
        ends: (&Configuration, &Configuration),
        meetings: &mut Vec<Meeting>,
    ) -> Result<(), Halt> {
        let mut step = Displacements::default();
        step.extend_to(benches_of(meetings) + 1, self.chain, ends, self.state.budget)?;
        self.retain_uncertain_in(&step, ends, meetings)
    }

    fn clearance(&self, at: &Configuration, (bench, j): Meeting) -> f64 {
        self.obstacles[j].clearance(&at.boards[bench])
    }

    fn record(&mut self, at: &Configuration, meetings: &[Meeting]) -> Result<bool, Halt> {
        let contact = self.state.goal == Goal::Contact;
        for &(bench, j) in meetings {
            let (board, obstacle) = (&at.boards[bench], &self.obstacles[j]);
            let least = self.best[j].map_or(f64::INFINITY, |best| best.value);
            let limit = if contact { least.min(0.0) } else { least };
            if obstacle.coarse_clearance(board) > limit {
                continue;
            }
            self.state.budget.spend(1)?;
            let value = obstacle.clearance(board);
            if value < least && (!contact || value <= 0.0) {
                let (travelled, bench) = (at.travelled, bench as u32);
                self.best[j] = Some(ObstacleClearance { value, travelled, bench });
            }
        }
        if contact {
            for (j, best) in self.best.iter_mut().enumerate() {
                if let (Some(ObstacleClearance { travelled, bench, .. }), None) = (best.take(), self.touches[j]) {
                    let place = self.obstacles[j].shape.nearest_points(&at.boards[bench as usize]).0;
                    self.touches[j] = Some(Touch { obstacle: j, travelled, bench, place });
                }
            }
        }
        Ok(contact && self.touches.iter().all(Option::is_some))
    }
}

/// Returns the number of the foremost benches, up to the last bench of the meetings.
fn benches_of(meetings: &[Meeting]) -> usize {
    meetings.iter().map(|&(bench, _)| bench + 1).max().unwrap_or(0)
}

/// Returns a lower bound of a convex function of the share of a way. The distance and the nearest points at both ends
/// are given. The bound follows from the slopes there.
fn convex_bound(first: (f64, Point, Point), last: (f64, Point, Point), way: Vector) -> f64 {
    let slope = |(_, on_board, on_side): (f64, Point, Point)| {
        let outward = on_board - on_side;
        outward.dot(&way) / outward.norm()
    };
    let (falls, rises) = (slope(first), slope(last));
    if falls >= 0.0 {
        first.0
    } else if rises <= 0.0 {
        last.0
    } else {
        // The share at which the two tangents meet.
        let share = (last.0 - rises - first.0) / (falls - rises);
        first.0 + falls * share.clamp(0.0, 1.0)
    }
}
