//! The foremost part of a team at one place of the head, solved as far back as the search needs, and its pairs of
//! boards that are near each other.

use crate::event::Budget;
use crate::linkage::{NoFollower, follower, link_pose};
use crate::model::board::Board;
use crate::model::path::{Param, Path};
use crate::model::separation::{circle_bound_board_board, signed_distance_board_board};
use crate::model::team::Team;

/// Two benches without a common handle, the bench nearer the head first.
pub(super) type Pair = (usize, usize);

/// The reason for an early end of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Halt {
    /// The budget is spent.
    Spent,
    /// A configuration inside the motion cannot be solved.
    NoFollower,
}

impl From<NoFollower> for Halt {
    fn from(_: NoFollower) -> Self {
        Self::NoFollower
    }
}

/// The foremost handles and boards of a team.
#[derive(Debug, Clone)]
pub(super) struct Configuration {
    /// Metres that the head has travelled.
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
        let missing = benches.saturating_sub(self.boards.len());
        if !budget.spend(missing as u64) {
            return Err(Halt::Spent);
        }
        self.places.reserve(missing);
        self.boards.reserve(missing);
        for bench in self.boards.len()..benches {
            let (front, link) = (self.places[bench], team.link(bench));
            let rear = follower(path, front, link)?;
            let direction = link_pose(path, front, rear, link).direction;
            self.boards.push(Board::from_front(path.point(front), direction, link, team.hole_inset, team.width));
            self.places.push(rear);
        }
        Ok(())
    }

    /// Returns the signed distance of two boards, metres.
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

    /// Returns all pairs of the foremost boards whose circle bound is at most `motion`, found with a grid whose cells
    /// are as wide as the longest board plus `motion`.
    pub fn near_pairs(&self, benches: usize, motion: f64) -> Vec<Pair> {
        let boards = &self.boards[..benches];
        let cell = boards.iter().map(|board| 2.0 * board.circle_radius()).fold(0.0, f64::max) + motion.max(0.0);
        let key = |board: &Board| ((board.centre.x / cell).floor() as i64, (board.centre.y / cell).floor() as i64);
        let mut cells: Vec<((i64, i64), usize)> = boards.iter().map(key).zip(0..).collect();
        cells.sort_unstable();
        let mut pairs = Vec::new();
        for (a, board) in boards.iter().enumerate() {
            let (column, row) = key(board);
            for neighbour in column - 1..=column + 1 {
                // Three neighbouring cells of a column are adjacent in the sorted list.
                let from = cells.partition_point(|(key, _)| *key < (neighbour, row - 1));
                let others = cells[from..].iter().take_while(|(key, _)| *key <= (neighbour, row + 1));
                let later = others.map(|(_, b)| (a, *b)).filter(|&(a, b)| b >= a + 2);
                pairs.extend(later.filter(|&pair| self.circle_bound(pair) <= motion));
            }
        }
        pairs
    }
}
