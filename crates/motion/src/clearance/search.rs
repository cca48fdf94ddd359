//! The search for the nearest pair of one chain: it tests the pairs that known bounds do not exclude.

use std::ops::Range;

use super::bounds::{BLOCK, BoundTable, Located};
use super::grid::Grid;
use super::lists::Neighbour;
use super::{Nearest, board, circle_radius, corner_reach};
use crate::model::board::Board;
use crate::model::separation::{separation_board_board, signed_distance_board_board};
use crate::model::team::Team;
use crate::solve::Positions;

/// Numbers that are compared together, so that vector instructions apply.
const BOUNDS_AT_ONCE: usize = 64;
const DISTANCES_AT_ONCE: usize = 8;

/// Benches that are tested against all others before a grid is cheaper.
const MOST_SCANS: usize = 16;

/// The margin of carried bounds beyond the limit, in lengths of a body board.
const SKIN: f64 = 0.05;

/// The approach, in metres, after which carried bounds are computed again, so that their rounding stays within its
/// allowance.
const MOST_MOVED: f64 = 100.0;

/// For every bench a lower bound of its distance to those behind it, carried from frame to frame.
///
/// If no handle is farther than D from its earlier place, no point of a board is farther than [`corner_reach`] times D,
/// or a little more if links have errors. So no two boards are nearer by more than twice this length, and an earlier
/// bound, less this amount for all movement since, still holds.
#[derive(Debug, Clone)]
pub(super) struct CarriedBounds {
    /// The handles of the previous frame.
    x: Vec<f64>,
    y: Vec<f64>,
    /// The greatest approach of two boards since the beginning, in metres.
    closed: f64,
    /// By bench: a bound plus the value of `closed` when the bound was made.
    sums: Vec<f64>,
    grid: Grid,
}

impl CarriedBounds {
    pub(super) fn new(benches: usize) -> Self {
        Self {
            x: vec![0.0; benches + 1],
            y: vec![0.0; benches + 1],
            closed: 0.0,
            sums: vec![f64::NEG_INFINITY; benches],
            grid: Grid::new(benches),
        }
    }

    /// Updates the bounds to the handles of a chain.
    fn follow(&mut self, chain: Positions, team: &Team, link_error: f64) {
        const LANES: usize = 8;
        let (mut most, mut sum) = ([0.0; LANES], [0.0; LANES]);
        let old = self.x.chunks_mut(LANES).zip(self.y.chunks_mut(LANES));
        for ((old_x, old_y), (x, y)) in old.zip(chain.x.chunks(LANES).zip(chain.y.chunks(LANES))) {
            for k in 0..x.len() {
                let (dx, dy) = (x[k] - old_x[k], y[k] - old_y[k]);
                let squared = dx * dx + dy * dy;
                most[k] = if squared > most[k] { squared } else { most[k] };
                sum[k] += squared;
                (old_x[k], old_y[k]) = (x[k], y[k]);
            }
        }
        let shortened = 1.0 + 2.0 * link_error / team.shortest_link();
        let reach = shortened * corner_reach(team, 0).max(corner_reach(team, 1));
        self.closed += 2.0 * reach * most.into_iter().fold(0.0, f64::max).sqrt();
        // NaN appears in the sum, too.
        if !(sum.iter().sum::<f64>() < f64::INFINITY && self.closed < MOST_MOVED) {
            self.closed = 0.0;
            self.sums.fill(f64::NEG_INFINITY);
        }
    }
}

/// The search for the nearest pair of one chain.
pub(super) struct ClearanceSearch<'a> {
    chain: Positions<'a>,
    team: &'a Team,
    pub nearest: Nearest,
    /// The pair that was tested first, and its clearance.
    first: ((usize, usize), f64),
    /// A body board's length over its link's.
    board_per_link: f64,
    /// The length, in metres, by which a link may be off.
    link_error: f64,
    /// Pairs tested.
    pub tested: u64,
}

impl<'a> ClearanceSearch<'a> {
    /// Creates a search that has tested the pair `likely`, which is probably near.
    #[inline]
    pub(super) fn new(chain: Positions<'a>, team: &'a Team, link_error: f64, likely: Option<(usize, usize)>) -> Self {
        let pair = likely.unwrap_or((0, 2));
        let board_per_link = 1.0 + 2.0 * team.hole_inset / team.link(1);
        let first = (pair, f64::INFINITY);
        let mut search = Self { chain, team, nearest: Nearest::NONE, first, board_per_link, link_error, tested: 0 };
        search.first.1 = search.test(&board(chain, team, pair.0), pair);
        search
    }

    /// Tests the pairs that the table does not exclude. If it excludes too few, returns the first bench whose pairs are
    /// still to be tested.
    pub(super) fn by_table(&mut self, table: &BoundTable, located: Located) -> Option<usize> {
        let mut scans = 0;
        self.by_list(0, 1, table.of_head(located, (self.chain.x[0], self.chain.y[0])), &mut scans);
        // Behind the last two benches there is no pair that counts.
        let rows = located.row..located.row + self.team.benches - 3;
        let first_block = rows.start / BLOCK;
        for (chunk, least) in table.least_bounds(located, &rows).chunks(BOUNDS_AT_ONCE).enumerate() {
            if !any_within(least, (self.nearest.value as f32).next_up()) {
                continue;
            }
            for (k, least) in least.iter().enumerate() {
                if f64::from(*least) <= self.nearest.value {
                    let block = first_block + chunk * BOUNDS_AT_ONCE + k;
                    let rows = rows.start.max(block * BLOCK)..rows.end.min((block + 1) * BLOCK);
                    if let Some(unsettled) = self.by_block(table, located, block, rows, &mut scans) {
                        return Some(unsettled);
                    }
                }
            }
        }
        None
    }

    /// Does the same as [`by_table`](Self::by_table) for rows of one block.
    fn by_block(
        &mut self,
        table: &BoundTable,
        located: Located,
        block: usize,
        rows: Range<usize>,
        scans: &mut usize,
    ) -> Option<usize> {
        let bounds = table.bounds(located, block);
        for row in rows {
            if f64::from(bounds[row % BLOCK]) <= self.nearest.value {
                let a = 1 + row - located.row;
                if *scans == MOST_SCANS {
                    return Some(a);
                }
                self.by_list(a, a, table.of_body(located, row), scans);
            }
        }
        None
    }

    /// Tests `a` against the benches that its list does not exclude, counted from the bench `from`.
    fn by_list(&mut self, a: usize, from: usize, list: &[Neighbour], scans: &mut usize) {
        let mut board_a = None;
        for neighbour in list {
            if f64::from(neighbour.bound) > self.nearest.value {
                return;
            }
            if neighbour.behind == Neighbour::ALL {
                *scans += 1;
                self.against_all(a, 0.0);
                return;
            }
            let pair = (a, from + neighbour.behind as usize);
            if pair.1 < self.team.benches && pair != self.first.0 {
                let board_a = board_a.get_or_insert_with(|| board(self.chain, self.team, a));
                self.test(board_a, pair);
            }
        }
    }

    /// Tests the pairs from bench `from` on that the carried bounds do not exclude, and updates these bounds.
    pub(super) fn by_carried_bounds(&mut self, carried: &mut CarriedBounds, from: usize) {
        carried.follow(self.chain, self.team, self.link_error);
        let skin = SKIN * (self.team.link(1) + 2.0 * self.team.hole_inset);
        let mut scans = 0;
        for start in (from..self.team.benches - 2).step_by(BOUNDS_AT_ONCE) {
            let stop = (start + BOUNDS_AT_ONCE).min(self.team.benches - 2);
            let limit = |value: f64| value + 1e-8 + carried.closed;
            if !carried.sums[start..stop].iter().fold(false, |near, sum| near | (*sum <= limit(self.nearest.value))) {
                continue;
            }
            for a in start..stop {
                if carried.sums[a] > limit(self.nearest.value) {
                    continue;
                }
                if scans == MOST_SCANS {
                    self.fill(&mut carried.grid, a, skin);
                }
                scans += 1;
                let bound =
                    if scans <= MOST_SCANS { self.against_all(a, skin) } else { self.by_grid(&carried.grid, a, skin) };
                carried.sums[a] = bound + carried.closed;
            }
        }
    }

    /// Puts the benches from `from` on into a grid whose squares are as large as the search distance.
    fn fill(&self, grid: &mut Grid, from: usize, skin: f64) {
        let Positions { x, y } = self.chain;
        let diameter = 2.0 * self.body_radius();
        grid.clear((diameter + self.nearest.value).max(0.0) + skin);
        for bench in from..self.team.benches {
            grid.add(bench, 0.5 * (x[bench] + x[bench + 1]), 0.5 * (y[bench] + y[bench + 1]));
        }
    }

    /// Tests `a` against every later bench of a grid that can be within the limit. Returns a lower bound of its
    /// distance to all of them, at most `skin` beyond the limit.
    fn by_grid(&mut self, grid: &Grid, a: usize, skin: f64) -> f64 {
        let board_a = board(self.chain, self.team, a);
        let centre = (board_a.centre.x, board_a.centre.y);
        let radii = board_a.circle_radius() + self.body_radius();
        let mut bound = self.nearest.value + skin;
        let distance = padded(radii + bound, radii, centre.0.abs() + centre.1.abs());
        grid.visit_near(centre, distance, a + 2, |b| bound = bound.min(self.test_unless_culled(&board_a, (a, b))));
        bound
    }

    /// Does the same as [`by_grid`](Self::by_grid) for every later bench of the chain.
    fn against_all(&mut self, a: usize, skin: f64) -> f64 {
        let Positions { x, y } = self.chain;
        let board_a = board(self.chain, self.team, a);
        let centre = board_a.centre;
        let radii = board_a.circle_radius() + self.body_radius();
        let mut bound = self.nearest.value + skin;
        let distance = padded(radii + bound, radii, centre.x.abs() + centre.y.abs());
        let squared = |b: usize| {
            let (dx, dy) = (0.5 * (x[b] + x[b + 1]) - centre.x, 0.5 * (y[b] + y[b + 1]) - centre.y);
            dx * dx + dy * dy
        };
        for start in (a + 2..self.team.benches).step_by(DISTANCES_AT_ONCE) {
            let stop = self.team.benches.min(start + DISTANCES_AT_ONCE);
            if (start..stop).fold(false, |near, b| near | (squared(b) <= distance * distance)) {
                for b in (start..stop).filter(|b| squared(*b) <= distance * distance) {
                    bound = bound.min(self.test_unless_culled(&board_a, (a, b)));
                }
            }
        }
        bound
    }

    /// Returns an upper bound of the radius of the circle about a body board, in metres.
    fn body_radius(&self) -> f64 {
        circle_radius(self.team, 1) + 0.5 * self.link_error
    }

    /// Tests a pair if it can be within the limit. Returns a lower bound of its distance.
    fn test_unless_culled(&mut self, board_a: &Board, pair: (usize, usize)) -> f64 {
        if pair == self.first.0 {
            return self.first.1;
        }
        let bound = self.gap_bound(board_a, pair.1);
        if bound <= self.nearest.value { self.test(board_a, pair) } else { bound }
    }

    /// Tests a pair. Returns a lower bound of its distance.
    #[inline]
    fn test(&mut self, board_a: &Board, pair: (usize, usize)) -> f64 {
        self.tested += 1;
        let board_b = board(self.chain, self.team, pair.1);
        let separation = separation_board_board(board_a, &board_b);
        if separation > self.nearest.value {
            return separation;
        }
        let value = signed_distance_board_board(board_a, &board_b);
        self.nearest.consider(value, pair, board_a, &board_b);
        value
    }

    /// Returns a lower bound of the signed distance of `board_a` and bench `b`, from the gaps along `board_a`'s sides.
    /// The bound needs no square root. Half the link of `b` is scaled to half its board, and half the board's width is
    /// subtracted in any direction.
    fn gap_bound(&self, board_a: &Board, b: usize) -> f64 {
        let Positions { x, y } = self.chain;
        let half_link = (0.5 * (x[b] - x[b + 1]), 0.5 * (y[b] - y[b + 1]));
        let offset = (x[b + 1] + half_link.0 - board_a.centre.x, y[b + 1] + half_link.1 - board_a.centre.y);
        let axis = board_a.axis;
        let along = |v: (f64, f64)| (axis.x * v.0 + axis.y * v.1).abs();
        let across = |v: (f64, f64)| (axis.x * v.1 - axis.y * v.0).abs();
        let gap_along = along(offset) - along(half_link) * self.board_per_link - board_a.half_length;
        let gap_across = across(offset) - across(half_link) * self.board_per_link - board_a.half_width;
        let rounding = 1e-9 * board_a.half_length + 1e-12 * (offset.0.abs() + x[b].abs() + y[b].abs());
        // The board beyond the handles scales with the link.
        let stretched = 0.5 * (self.board_per_link - 1.0) * self.link_error;
        gap_along.max(gap_across) - 0.5 * self.team.width - stretched - rounding
    }
}

/// Returns true if any of these bounds is within a limit.
fn any_within(bounds: &[f32], limit: f32) -> bool {
    bounds.iter().fold(0, |near, bound| near | u32::from(*bound <= limit)) != 0
}

/// Returns a limit plus the errors of solver and rounding for lengths of size `length` and coordinates of size
/// `coordinates`; 0 if negative.
fn padded(limit: f64, length: f64, coordinates: f64) -> f64 {
    (limit + 1e-9 * length + 1e-12 * coordinates).max(0.0)
}
