//! Which two boards of a chain are nearest: all pairs as the reference, and the live way that tests few of them.
//!
//! In: a [`Chain`] and its [`Team`]. Out: the nearest pair. The show calls it where a scene has alerts. Pairs that
//! share a handle never count. Both ways evaluate a pair with the same function on the same numbers, so they agree to
//! the last bit.

mod bounds;
mod cells;
mod grid;
mod lists;
mod moving;
mod search;
#[cfg(test)]
mod tests;

use crate::model::Point;
use crate::model::board::Board;
use crate::model::elementary::hypot;
use crate::model::path::Path;
use crate::model::separation::{closest_points_board_board, signed_distance_board_board};
use crate::model::team::Team;
use crate::solve::Chain;
use crate::solve::table::FollowerTable;
use bounds::BoundTable;
use search::{CarriedBounds, Search};

/// The nearest two boards that share no handle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairClearance {
    /// Metres between them; negative where they overlap.
    pub value: f64,
    /// The lower bench, counted from 0.
    pub bench_a: usize,
    /// The higher bench.
    pub bench_b: usize,
    /// The point of `bench_a`'s board nearest to the other.
    pub point_a: Point,
    /// The point of `bench_b`'s board nearest to the other.
    pub point_b: Point,
}

/// The board of one bench of a chain. Panics if there is no such bench.
#[inline]
pub fn board(chain: &Chain, team: &Team, bench: usize) -> Board {
    let handle = |k: usize| Point::new(chain.x[k], chain.y[k]);
    Board::from_handles(handle(bench), handle(bench + 1), team.hole_inset, team.width)
}

/// The nearest two boards, by testing all pairs; of several, the lowest (a, b). `None` under three benches.
pub fn least_clearance_all_pairs(chain: &Chain, team: &Team) -> Option<PairClearance> {
    let mut nearest = Nearest::NONE;
    for a in 0..team.benches {
        let board_a = board(chain, team, a);
        for b in a + 2..team.benches {
            let board_b = board(chain, team, b);
            nearest.consider(signed_distance_board_board(&board_a, &board_b), (a, b), &board_a, &board_b);
        }
    }
    nearest.finish()
}

/// The nearest pair so far.
#[derive(Debug, Clone, Copy)]
struct Nearest {
    value: f64,
    pair: (usize, usize),
    boards: Option<(Board, Board)>,
}

impl Nearest {
    const NONE: Self = Self { value: f64::INFINITY, pair: (usize::MAX, usize::MAX), boards: None };

    #[inline]
    fn consider(&mut self, value: f64, pair: (usize, usize), board_a: &Board, board_b: &Board) {
        if value < self.value || (value == self.value && pair < self.pair) {
            *self = Self { value, pair, boards: Some((*board_a, *board_b)) };
        }
    }

    fn finish(&self) -> Option<PairClearance> {
        let (a, b) = self.boards.as_ref()?;
        let (point_a, point_b) = closest_points_board_board(a, b);
        Some(PairClearance { value: self.value, bench_a: self.pair.0, bench_b: self.pair.1, point_a, point_b })
    }
}

/// How much work a monitor has done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClearanceCounters {
    /// Chains looked at.
    pub frames: u64,
    /// Pairs of boards tested for their distance.
    pub pairs: u64,
    /// Chains that needed a search among all their boards: the table did not serve.
    pub searches: u64,
}

/// The live way: the same answer as [`least_clearance_all_pairs`], from a few pairs.
///
/// The last nearest pair's clearance now is a first limit. Where a table serves, only those pairs are tested whose
/// bound is within it: most often none. Its bounds hold for every frame alike, so that no jump of the show can mislead
/// it. Where no table serves, every bench carries a bound from frame to frame, lowered by how far the handles have
/// moved. All memory is reserved by the constructor.
#[derive(Debug, Clone)]
pub struct ClearanceMonitor {
    team: Team,
    latest: Option<PairClearance>,
    last_pair: Option<(usize, usize)>,
    table: Option<Box<BoundTable>>,
    carried: CarriedBounds,
    /// Metres that a link of a frame may be off its length.
    link_error: f64,
    counters: ClearanceCounters,
}

/// Metres that a link of an exact frame is off at most, and more.
const EXACT_LINK_ERROR: f64 = 1e-9;

impl ClearanceMonitor {
    /// A monitor for chains of `team` whose handles are where motion along `path` has them, as far as `table` promises.
    /// From the table it makes one of its own, of 128 MB of lists and in some five seconds at most: if that is not enough,
    /// the monitor does without.
    pub fn new(path: &Path, team: Team, table: &FollowerTable) -> Self {
        let table_of_bounds = BoundTable::new(path, &team, table).map(Box::new);
        Self { table: table_of_bounds, ..Self::without_table(team, 2.0 * table.accuracy()) }
    }

    /// A monitor for chains of `team` wherever the handles are, if no link is off its length by more than `link_error`
    /// metres or the rounding of exact motion.
    pub fn without_table(team: Team, link_error: f64) -> Self {
        Self {
            team,
            latest: None,
            last_pair: None,
            table: None,
            carried: CarriedBounds::new(team.benches),
            link_error: EXACT_LINK_ERROR.max(link_error),
            counters: ClearanceCounters::default(),
        }
    }

    /// How the nearest pair is found, for people.
    pub fn description(&self) -> String {
        match &self.table {
            Some(table) => format!(
                "by a table of bounds, {} kB, made in {:.0} ms",
                table.memory_bytes().div_ceil(1000),
                1e3 * table.made_in().as_secs_f64()
            ),
            None => "by a search among all boards in every frame, since a table of bounds cannot be had".to_owned(),
        }
    }

    /// The clearance of the latest frame.
    pub fn latest(&self) -> Option<PairClearance> {
        self.latest
    }

    /// How much work has been done so far.
    pub fn counters(&self) -> ClearanceCounters {
        self.counters
    }

    /// The nearest two boards of `chain`, whose head has travelled so many metres of the path (NaN where it does not
    /// follow the path); of several, the lowest (a, b). `None` under three benches.
    pub fn least_clearance(&mut self, chain: &Chain, travelled: f64) -> Option<PairClearance> {
        self.counters.frames += 1;
        self.latest = None;
        if self.team.benches < 3 {
            return None;
        }
        let mut search = Search::new(chain, &self.team, self.link_error, self.last_pair);
        let located = self.table.as_ref().and_then(|table| Some((table, table.locate(travelled, self.team.benches)?)));
        let unsettled = match located {
            Some((table, located)) => search.by_table(table, located),
            None => Some(0),
        };
        if let Some(from) = unsettled {
            search.by_carried_bounds(&mut self.carried, from);
            self.counters.searches += 1;
        }
        self.counters.pairs += search.tested;
        self.latest = search.nearest.finish();
        self.last_pair = self.latest.map(|latest| (latest.bench_a, latest.bench_b));
        self.latest
    }
}

fn circle_radius(team: &Team, bench: usize) -> f64 {
    hypot(0.5 * team.link(bench) + team.hole_inset, 0.5 * team.width)
}

/// How far any point of a board moves at most per metre that its handles move.
fn corner_reach(team: &Team, bench: usize) -> f64 {
    Board::displacement_factor(team.link(bench), team.hole_inset, team.width)
}
