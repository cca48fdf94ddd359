//! The nearest two boards of a chain: by all pairs as the reference, and by the live method that tests few of them.
//!
//! In: a [`Chain`] and its [`Team`]. Out: the nearest pair. Pairs that share a handle never count. Both methods
//! evaluate a pair with the same function on the same numbers, so they agree to the last bit.

mod between;
mod between_table;
mod bounds;
mod cells;
mod grid;
mod lists;
mod moving;
mod obstacles;
mod search;
#[cfg(test)]
mod tests;

use crate::model::Point;
use crate::model::board::Board;
use crate::model::elementary::hypot;
use crate::model::path::Path;
use crate::model::separation::{closest_points_board_board, signed_distance_board_board};
use crate::model::team::Team;
use crate::solve::table::FollowerTable;
use crate::solve::{Chain, Positions};
pub use between::{BetweenMonitor, Moment, nearest_between_all_pairs};
pub use between_table::TabledDragon;
use bounds::BoundTable;
pub use obstacles::ObstacleMonitor;
use search::{CarriedBounds, ClearanceSearch};

/// The nearest two boards that share no handle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairClearance {
    /// The distance between them, in metres; negative where they overlap.
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

/// Returns the board of one bench of a chain. Panics if there is no such bench.
#[inline]
pub fn board<'a>(chain: impl Into<Positions<'a>>, team: &Team, bench: usize) -> Board {
    let Positions { x, y } = chain.into();
    let handle = |k: usize| Point::new(x[k], y[k]);
    Board::from_handles(handle(bench), handle(bench + 1), team.hole_inset, team.width)
}

/// Returns the nearest two boards by testing all pairs; of equal ones the lowest (a, b). `None` for fewer than three
/// benches.
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

/// The work done by a monitor.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClearanceCounters {
    /// Chains processed.
    pub frames: u64,
    /// Pairs of boards tested for their distance.
    pub pairs: u64,
    /// Chains that needed a search among all their boards because the table did not apply.
    pub searches: u64,
}

/// The live method: the same result as [`least_clearance_all_pairs`], from a few pairs.
///
/// The present clearance of the previous nearest pair is the first limit. With a table, only pairs whose bound is
/// within the limit are tested, which are most often none. The bounds hold for every frame, so jumps of the show do no
/// harm. Without a table, every bench carries a bound from frame to frame, lowered by the displacement of the handles.
/// All memory is reserved by the constructor.
#[derive(Debug, Clone)]
pub struct ClearanceMonitor {
    team: Team,
    latest: Option<PairClearance>,
    last_pair: Option<(usize, usize)>,
    table: Option<Box<BoundTable>>,
    carried: CarriedBounds,
    /// The length, in metres, by which a link of a frame may be off.
    link_error: f64,
    counters: ClearanceCounters,
}

/// An upper bound of the error of a link of an exact frame, in metres.
const EXACT_LINK_ERROR: f64 = 1e-9;

impl ClearanceMonitor {
    /// Creates a monitor for chains of `team` that follow `path` as exactly as `table` promises.
    ///
    /// The monitor makes a table of bounds from `table`, of at most 128 MB and in at most about five seconds. If these
    /// limits do not suffice, the monitor works without a table of bounds.
    pub fn new(path: &Path, team: Team, table: &FollowerTable) -> Self {
        let table_of_bounds = BoundTable::new(path, &team, table).map(Box::new);
        Self { table: table_of_bounds, ..Self::without_table(team, 2.0 * table.accuracy()) }
    }

    /// Creates a monitor for chains of `team` with any handles. The error of every link must be at most `link_error`
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

    /// Describes how the nearest pair is found, for people.
    pub fn description(&self) -> String {
        match &self.table {
            Some(table) => format!(
                "by a table of bounds, {} kB, made in {:.0} ms",
                table.memory_bytes().div_ceil(1000),
                1e3 * table.made_in().as_secs_f64()
            ),
            None => "by a search among all boards in every frame, since there is no table of bounds".to_owned(),
        }
    }

    /// Returns the clearance of the latest frame.
    pub fn latest(&self) -> Option<PairClearance> {
        self.latest
    }

    /// Returns the work done so far.
    pub fn counters(&self) -> ClearanceCounters {
        self.counters
    }

    /// Returns the nearest two boards of `chain`, of equal ones the lowest (a, b). The head has travelled `travelled`
    /// metres of the path; NaN if it does not follow the path. `None` for fewer than three benches.
    pub fn least_clearance<'a>(&mut self, chain: impl Into<Positions<'a>>, travelled: f64) -> Option<PairClearance> {
        self.least(chain.into(), travelled)
    }

    // A function of one type is compiled here, where the functions that it calls are inlined.
    fn least(&mut self, chain: Positions, travelled: f64) -> Option<PairClearance> {
        self.counters.frames += 1;
        self.latest = None;
        if self.team.benches < 3 {
            return None;
        }
        let mut search = ClearanceSearch::new(chain, &self.team, self.link_error, self.last_pair);
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

/// Returns the greatest displacement of a board's points per metre of displacement of its handles.
fn corner_reach(team: &Team, bench: usize) -> f64 {
    Board::displacement_factor(team.link(bench), team.hole_inset, team.width)
}
