//! Boxes about consecutive benches, for chains of which nothing is known. Called by the clearance only.

use super::{Nearest, board};
use crate::chain::{Chain, Team};
use crate::geometry::rectangle::Board;
use crate::geometry::separation::signed_distance_within;

/// An upright box about the boards of consecutive benches.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: [f64; 2],
    high: [f64; 2],
}

impl Bounds {
    const EMPTY: Self = Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };

    fn union(&self, other: &Self) -> Self {
        let each = |k: usize| (self.low[k].min(other.low[k]), self.high[k].max(other.high[k]));
        let ((left, right), (bottom, top)) = (each(0), each(1));
        Self { low: [left, bottom], high: [right, top] }
    }

    fn of(board: &Board) -> Self {
        let (cosine, sine) = (board.axis.x.abs(), board.axis.y.abs());
        let x = board.half_length * cosine + board.half_width * sine;
        let y = board.half_length * sine + board.half_width * cosine;
        let (cx, cy) = (board.centre.x, board.centre.y);
        let pad = 1e-12 * (cx.abs() + cy.abs() + x + y);
        Self { low: [cx - x - pad, cy - y - pad], high: [cx + x + pad, cy + y + pad] }
    }

    /// The larger gap along x and y: a lower bound of the clearance of any two boards in the boxes, overlapping or
    /// not, since the signed clearance is the largest gap over all directions.
    fn gap(&self, other: &Self) -> f64 {
        let along = |k: usize| (self.low[k] - other.high[k]).max(other.low[k] - self.high[k]);
        along(0).max(along(1))
    }
}

/// A binary tree of boxes over the benches in their order, without pointers: level 0 is the root, node n of a level has
/// the children 2n and 2n + 1 of the next, and the last level's nodes hold [`LEAF`] benches each.
#[derive(Debug, Clone)]
pub(super) struct BoxTree {
    /// Node n of level k is at 2^k - 1 + n.
    boxes: Vec<Bounds>,
    depth: u32,
}

/// Benches per leaf.
const LEAF: usize = 4;

impl BoxTree {
    pub(super) fn new(benches: usize) -> Self {
        let leaves = benches.div_ceil(LEAF).next_power_of_two();
        Self { boxes: vec![Bounds::EMPTY; 2 * leaves - 1], depth: leaves.trailing_zeros() }
    }

    fn at(&self, (level, node): (u32, usize)) -> &Bounds {
        &self.boxes[(1 << level) - 1 + node]
    }

    pub(super) fn fit(&mut self, chain: &Chain, team: &Team) {
        let leaves = 1usize << self.depth;
        for leaf in 0..leaves {
            let benches = (leaf * LEAF).min(team.benches)..((leaf + 1) * LEAF).min(team.benches);
            self.boxes[leaves - 1 + leaf] =
                benches.fold(Bounds::EMPTY, |all, bench| all.union(&Bounds::of(&board(chain, team, bench))));
        }
        for parent in (0..leaves - 1).rev() {
            self.boxes[parent] = self.boxes[2 * parent + 1].union(&self.boxes[2 * parent + 2]);
        }
    }

    /// Asks every pair with one bench in each node that the boxes do not exclude. `a` is never right of `b`, and both
    /// are of one level.
    pub(super) fn visit(&self, chain: &Chain, team: &Team, a: (u32, usize), b: (u32, usize), nearest: &mut Nearest) {
        if self.at(a).gap(self.at(b)) > nearest.value {
            return;
        }
        let (level, (left, right)) = (a.0 + 1, (a.1, b.1));
        if a.0 == self.depth {
            ask_leaves(chain, team, left, right, nearest);
            return;
        }
        let mut children = |x: usize, y: usize| self.visit(chain, team, (level, x), (level, y), nearest);
        children(2 * left, 2 * right);
        children(2 * left, 2 * right + 1);
        if left != right {
            children(2 * left + 1, 2 * right);
        }
        children(2 * left + 1, 2 * right + 1);
    }
}

fn ask_leaves(chain: &Chain, team: &Team, left: usize, right: usize, nearest: &mut Nearest) {
    let benches = |leaf: usize| leaf * LEAF..((leaf + 1) * LEAF).min(team.benches);
    for a in benches(left) {
        let board_a = board(chain, team, a);
        for b in benches(right).filter(|&b| b >= a + 2) {
            nearest.asked += 1;
            if let Some(value) = signed_distance_within(&board_a, &board(chain, team, b), nearest.value) {
                nearest.offer(value, a, b);
            }
        }
    }
}
