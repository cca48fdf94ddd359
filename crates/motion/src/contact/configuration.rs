//! The foremost part of a team at one place of the head, solved as far back as the search needs, and its near pairs.

use crate::event::Budget;
use crate::linkage::{follower, link_pose};
use crate::model::board::Board;
use crate::model::path::{Param, Path};
use crate::model::root::bisect_predicate;
use crate::model::separation::{circle_bound_board_board, signed_distance_board_board};
use crate::model::team::Team;

use super::ConservativeAdvancement;
use super::stepped_search::Halt;

/// Two benches without a common handle, the bench nearer the head first.
pub(super) type Pair = (usize, usize);

/// Links that are paid for at once: a long team is solved in parts, between which a search can be stopped.
const PAID_AT_ONCE: usize = 1_000;

/// The foremost handles and boards of a team.
#[derive(Debug, Clone)]
pub(super) struct Configuration {
    /// The distance that the head has travelled, in metres.
    pub travelled: f64,
    /// The handles solved so far: one more than the boards.
    pub places: Vec<Param>,
    pub boards: Vec<Board>,
}

impl Configuration {
    /// Creates a configuration with the head's handle only.
    pub fn new(path: &Path, travelled: f64) -> Self {
        Self { travelled, places: vec![path.param_at(travelled)], boards: Vec::new() }
    }

    /// Solves followers until there are `benches` boards.
    pub fn solve_to(&mut self, benches: usize, path: &Path, team: &Team, budget: &mut Budget) -> Result<(), Halt> {
        let first = self.boards.len();
        let missing = benches.saturating_sub(first);
        if missing == 0 {
            return Ok(());
        }
        self.places.reserve(missing);
        self.boards.reserve(missing);
        for bench in first..benches {
            if (bench - first).is_multiple_of(PAID_AT_ONCE) {
                budget.spend(PAID_AT_ONCE.min(benches - bench) as u64)?;
            }
            let (front, link) = (self.places[bench], team.link(bench));
            let rear = follower(path, front, link)?;
            self.boards.push(board(path, team, bench, [front, rear]));
            self.places.push(rear);
        }
        Ok(())
    }

    /// Solves the team at a lock. Next to it the rear handle, found by its distance, has half of its digits. So a link
    /// that is all but perpendicular to the path is turned to where it is perpendicular.
    pub fn at_lock(
        path: &Path,
        team: &Team,
        travelled: f64,
        benches: usize,
        budget: &mut Budget,
    ) -> Result<Self, Halt> {
        let mut at = Self::new(path, travelled);
        for bench in 0..benches {
            at.solve_to(bench + 1, path, team, budget)?;
            let (front, link) = (at.places[bench], team.link(bench));
            if let Some(rear) = perpendicular(path, front, at.places[bench + 1], link) {
                at.boards[bench] = board(path, team, bench, [front, rear]);
                at.places[bench + 1] = rear;
            }
        }
        Ok(at)
    }

    /// Returns the signed distance of two boards, in metres.
    pub fn clearance(&self, (a, b): Pair) -> f64 {
        signed_distance_board_board(&self.boards[a], &self.boards[b])
    }

    /// Returns a lower bound of [`clearance`](Self::clearance).
    pub fn circle_bound(&self, (a, b): Pair) -> f64 {
        circle_bound_board_board(&self.boards[a], &self.boards[b])
    }

    /// Returns the nearest or most deeply overlapping of `pairs`, and its clearance.
    pub fn deepest(&self, pairs: &[Pair]) -> Option<(f64, Pair)> {
        pairs.iter().map(|&pair| (self.clearance(pair), pair)).min_by(|one, other| one.0.total_cmp(&other.0))
    }

    /// Returns all pairs of the foremost boards whose circle bound is at most `motion`.
    pub fn near_pairs(&self, benches: usize, motion: f64) -> Vec<Pair> {
        let boards = &self.boards[..benches];
        near_pairs(boards, boards, motion, |(a, b)| b >= a + 2)
    }
}

/// Returns a board with its front and its rear handle at two places of the path.
fn board(path: &Path, team: &Team, bench: usize, [front, rear]: [Param; 2]) -> Board {
    let link = team.link(bench);
    let direction = link_pose(path, front, rear, link).direction;
    Board::from_front(path.point(front), direction, link, team.hole_inset, team.board_width(bench))
}

/// The cosine, in absolute value, below which a link counts as all but perpendicular; and the metres behind its rear
/// handle within which it is perpendicular then, in links.
const PERPENDICULAR: f64 = 1e-7;
const BEHIND: f64 = 1e-5;

/// Returns the place just behind a rear handle at which a link is perpendicular to the path; `None` if there is none.
fn perpendicular(path: &Path, front: Param, rear: Param, link: f64) -> Option<Param> {
    let (point, from) = (path.point(front), path.travelled(rear));
    let product = |back: f64| {
        let at = path.param_at(from - back);
        path.tangent(at).dot(&(point - path.point(at)))
    };
    let passed = |back: f64| product(back) <= 0.0;
    let is_near = !passed(0.0) && product(0.0) < PERPENDICULAR * link && passed(BEHIND * link);
    is_near.then(|| path.param_at(from - bisect_predicate(passed, 0.0, BEHIND * link)))
}

/// Returns the pairs of boards of two lists that pass `counts` and whose circle bound is at most `motion`. A grid finds
/// them. Its cells are as wide as the longest boards plus `motion`.
pub(super) fn near_pairs(
    first: &[Board],
    second: &[Board],
    motion: f64,
    counts: impl Fn((usize, usize)) -> bool,
) -> Vec<(usize, usize)> {
    let widest = |boards: &[Board]| boards.iter().map(|board| board.circle_radius()).fold(0.0, f64::max);
    let cell = widest(first) + widest(second) + motion.max(0.0);
    let key = |board: &Board| ((board.centre.x / cell).floor() as i64, (board.centre.y / cell).floor() as i64);
    let mut cells: Vec<((i64, i64), usize)> = second.iter().map(key).zip(0..).collect();
    cells.sort_unstable();
    let is_near = |(a, b): (usize, usize)| circle_bound_board_board(&first[a], &second[b]) <= motion;
    let mut pairs = Vec::new();
    for (a, board) in first.iter().enumerate() {
        let (column, row) = key(board);
        for neighbour in column - 1..=column + 1 {
            // Three neighbouring cells of a column are adjacent in the sorted list.
            let from = cells.partition_point(|(key, _)| *key < (neighbour, row - 1));
            let others = cells[from..].iter().take_while(|(key, _)| *key <= (neighbour, row + 1));
            pairs.extend(others.map(|(_, b)| (a, *b)).filter(|&pair| counts(pair) && is_near(pair)));
        }
    }
    pairs
}

/// Returns the last place up to `to` at which the whole team can be solved. Returns also the metres of travel from
/// which on rounding may prevent a solution.
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

/// Returns the configuration of a place within a step; `None` if rounding prevents it, from `rounding_from` on.
pub(super) fn within(
    chain: &ConservativeAdvancement,
    budget: &mut Budget,
    travelled: f64,
    benches: usize,
    rounding_from: f64,
) -> Result<Option<Configuration>, Halt> {
    let mut configuration = Configuration::new(chain.path, travelled);
    match configuration.solve_to(benches, chain.path, chain.team, budget) {
        Err(Halt::NoFollower) if travelled >= rounding_from => Ok(None),
        outcome => outcome.map(|()| Some(configuration)),
    }
}
