//! The bench of a frame that is nearest to an obstacle.
//!
//! In: the chain of a frame and the clearance of its nearest two boards. Out: a board that is nearer to an obstacle, if
//! there is one.
//!
//! Obstacles stand still, so the clearance of a body bench depends on the place of its front handle alone. A follower
//! table gives this place as a row and a phase (see [`super::bounds`]). Each row is divided into [`CELLS`] equal cells.
//! For each row and cell a table has a lower bound of the clearance of all obstacles. It is the clearance in the middle
//! of the cell, less the way of the board's points from there ([`lower_bound`]). A frame tests the head, and the
//! benches that the bounds do not exclude.

use super::cells::handles;
use super::moving::MovingBoard;
use super::{PairClearance, board, corner_reach};
use crate::ground::{Ground, Obstacle};
use crate::model::board::Board;
use crate::model::team::Team;
use crate::solve::Positions;
use crate::solve::table::FollowerTable;
use crate::solve::table::rows::Alpha;

/// Cells to a row.
const CELLS: usize = 32;

/// Rows of a block, whose least bound is kept, too.
const BLOCK: usize = 32;

/// The greatest number of rows times obstacles of a table: about a second of work.
const MOST_ROWS: usize = 1 << 17;

/// The margin of the bounds for rounding, metres and as a share of the coordinates.
const ROUNDING: (f64, f64) = (1e-9, 1e-12);

/// Lower bounds of the clearance of every body bench, for every place of the second handle.
#[derive(Debug, Clone)]
struct ObstacleTable {
    follower: FollowerTable,
    rows: usize,
    /// By cell, then by row.
    bounds: Vec<f32>,
    /// By cell, then by block.
    least: Vec<f32>,
}

impl ObstacleTable {
    fn new(team: &Team, ground: &Ground, follower: &FollowerTable) -> Option<Self> {
        let rows = follower.rows().rows();
        if rows == 0 || rows * ground.obstacles().len() > MOST_ROWS {
            return None;
        }
        let blocks = rows.div_ceil(BLOCK);
        let mut bounds = vec![f32::NEG_INFINITY; CELLS * rows];
        let handle_error = corner_reach(team, 1) * 2.0 * follower.accuracy();
        for (cell, bounds) in bounds.chunks_mut(rows).enumerate() {
            let share = |cell: usize| cell as f64 / CELLS as f64;
            let (first, handles) = handles(follower.rows(), (share(cell), share(cell + 1)), rows);
            for (bound, pair) in bounds[first.min(rows)..].iter_mut().zip(handles.windows(2)) {
                let moving = MovingBoard::new(&pair[0], &pair[1], team, 1);
                let at = moving.middle();
                let bounds = ground.obstacles().iter().map(|obstacle| lower_bound(obstacle, &at, moving.travel));
                let margin = handle_error + ROUNDING.0 + ROUNDING.1 * at.centre.coords.norm();
                let value = bounds.fold(f64::INFINITY, f64::min) - margin;
                *bound = if value.is_nan() { f32::NEG_INFINITY } else { (value as f32).next_down() };
            }
        }
        let least = bounds.chunks(rows).flat_map(|bounds| {
            bounds.chunks(BLOCK).map(|block| block.iter().copied().fold(f32::INFINITY, f32::min)).collect::<Vec<_>>()
        });
        let least: Vec<f32> = least.collect();
        debug_assert_eq!(least.len(), CELLS * blocks);
        Some(Self { follower: follower.without_rows(), rows, bounds, least })
    }

    /// Returns the row of the second handle and its cell; `None` outside the table.
    fn locate(&self, travelled: f64, benches: usize) -> Option<(usize, usize)> {
        let (Alpha { row, phase }, _) = self.follower.second_handle(travelled)?;
        let cell = ((phase * CELLS as f64) as usize).min(CELLS - 1);
        (row + benches <= self.rows).then_some((row, cell))
    }
}

/// Returns a lower bound of the clearance of a board whose points move by at most `travel` metres.
fn lower_bound(obstacle: &Obstacle, board: &Board, travel: f64) -> f64 {
    let bound = obstacle.clearance(board) - travel;
    if bound + obstacle.keep_out >= 0.0 || obstacle.shape.is_convex() {
        return bound;
    }
    // The depth of an overlap can jump where the board turns. A translation that frees the grown board frees all boards
    // within it.
    obstacle.clearance(&board.grown(travel))
}

/// Finds the bench of each frame that is nearest to an obstacle. All memory is reserved by the constructor.
#[derive(Debug, Clone)]
pub struct ObstacleMonitor {
    team: Team,
    ground: Ground,
    table: Option<ObstacleTable>,
    last_bench: usize,
}

/// The nearest board so far.
struct NearestObstacle<'a> {
    monitor: &'a ObstacleMonitor,
    chain: Positions<'a>,
    value: f64,
    found: Option<(usize, usize, Board)>,
}

impl NearestObstacle<'_> {
    /// Tests a bench against each obstacle that can be nearer than the nearest board so far.
    fn test(&mut self, bench: usize) {
        let board = board(self.chain, &self.monitor.team, bench);
        for (number, obstacle) in self.monitor.ground.obstacles().iter().enumerate() {
            if obstacle.coarse_clearance(&board) < self.value {
                let value = obstacle.clearance_below(&board, self.value);
                if value < self.value {
                    (self.value, self.found) = (value, Some((bench, number, board)));
                }
            }
        }
    }
}

impl ObstacleMonitor {
    /// Creates a monitor for chains of `team`. The ground is in the coordinates of the chains. With a follower table of
    /// the same path, most benches need no test.
    pub fn new(team: Team, ground: Ground, follower: Option<&FollowerTable>) -> Self {
        let table = follower.and_then(|follower| ObstacleTable::new(&team, &ground, follower));
        Self { team, ground, table, last_bench: 0 }
    }

    /// Returns the bench and the obstacle with the least clearance, if it is below `limit`, in metres. `bench_b` is the
    /// number of handles plus the obstacle's place on the ground, `point_b` a point of the obstacle. `travelled` is as
    /// in [`ClearanceMonitor::least_clearance`](super::ClearanceMonitor::least_clearance).
    pub fn nearest<'a>(
        &mut self,
        chain: impl Into<Positions<'a>>,
        travelled: f64,
        limit: f64,
    ) -> Option<PairClearance> {
        self.nearest_of(chain.into(), travelled, limit)
    }

    // A function of one type is compiled here, where the functions that it calls are inlined.
    fn nearest_of(&mut self, chain: Positions, travelled: f64, limit: f64) -> Option<PairClearance> {
        let benches = self.team.benches;
        let mut nearest = NearestObstacle { monitor: self, chain, value: limit, found: None };
        nearest.test(self.last_bench);
        if self.last_bench != 0 {
            nearest.test(0);
        }
        match self.table.as_ref().and_then(|table| Some((table, table.locate(travelled, benches)?))) {
            Some((table, (row, cell))) => {
                let bounds = &table.bounds[cell * table.rows..][..table.rows];
                let blocks = table.rows.div_ceil(BLOCK);
                let least = &table.least[cell * blocks..][..blocks];
                // The bench behind the handle of `row` is the second one.
                let rows = row..row + benches - 1;
                let first_block = rows.start / BLOCK;
                for (block, least) in (first_block..).zip(&least[first_block..rows.end.div_ceil(BLOCK)]) {
                    if f64::from(*least) >= nearest.value {
                        continue;
                    }
                    let of_block = rows.start.max(block * BLOCK)..rows.end.min((block + 1) * BLOCK);
                    for (bench, bound) in (of_block.start - rows.start + 1..).zip(&bounds[of_block]) {
                        if f64::from(*bound) < nearest.value && bench != self.last_bench {
                            nearest.test(bench);
                        }
                    }
                }
            }
            None => (1..benches).filter(|bench| *bench != self.last_bench).for_each(|bench| nearest.test(bench)),
        }
        let NearestObstacle { value, found, .. } = nearest;
        let (bench, number, board) = found?;
        self.last_bench = bench;
        let (point_a, point_b) = self.ground.obstacles()[number].shape.nearest_points(&board);
        Some(PairClearance { value, bench_a: bench, bench_b: self.team.handles() + number, point_a, point_b })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Point;
    use crate::model::path::Path;
    use crate::model::shape::Shape;
    use crate::solve::Chain;
    use crate::solve::{Solver, Velocities};

    const PAPER: Team = Team { benches: 223, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275 };

    #[test]
    fn the_table_excludes_all_but_a_few_benches() {
        let path = Path::spiral(0.55, 16.0);
        let mut table = FollowerTable::new(&path, PAPER, 1.0, Velocities::Omitted).unwrap();
        let lamp = Obstacle { name: String::new(), shape: Shape::circle(Point::new(0.3, 0.2), 0.5), keep_out: 0.2 };
        let post = Obstacle { name: String::new(), shape: Shape::circle(Point::new(0.0, 12.5), 0.5), keep_out: 0.0 };
        let monitor = ObstacleMonitor::new(PAPER, Ground::new(vec![lamp, post]), Some(&table));
        let bounds = monitor.table.as_ref().unwrap();
        let mut chain = Chain::new(224);
        for tick in 0..400 {
            let time = f64::from(tick) + 0.37;
            table.solve(time, &mut chain).unwrap();
            let (row, cell) = bounds.locate(time, 223).unwrap();
            let mut slack = 0.0f64;
            for bench in 1..223 {
                let board = board(&chain, &PAPER, bench);
                let clearances = monitor.ground.obstacles().iter().map(|obstacle| obstacle.clearance(&board));
                let value = clearances.fold(f64::INFINITY, f64::min);
                let bound = f64::from(bounds.bounds[cell * bounds.rows + row + bench - 1]);
                assert!(bound <= value, "bench {bench} at {time}: {bound} {value}");
                slack = slack.max(value - bound);
            }
            assert!(slack < 0.12, "{slack} at {time}");
        }
    }

    /// The depth of an overlap with a bent line jumps where the board turns.
    #[test]
    fn bounds_hold_for_boards_that_overlap_a_shape_that_is_not_convex() {
        const RADII: [f64; 12] = [2.615, 1.616, 1.802, 1.221, 0.711, 0.904, 1.775, 2.495, 1.747, 2.667, 0.606, 1.719];
        let path = Path::spiral(0.55, 16.0);
        let mut table = FollowerTable::new(&path, PAPER, 1.0, Velocities::Omitted).unwrap();
        let corner = |(number, radius): (usize, &f64)| {
            let angle = number as f64 * std::f64::consts::TAU / 12.0;
            Point::new(3.231 + radius * angle.cos(), -0.132 + radius * angle.sin())
        };
        let line = Shape::line(RADII.iter().enumerate().map(corner).collect());
        let line = Obstacle { name: String::new(), shape: line, keep_out: 0.1 };
        let mut monitor = ObstacleMonitor::new(PAPER, Ground::new(vec![line]), Some(&table));
        let bounds = monitor.table.clone().unwrap();
        let mut chain = Chain::new(224);
        let mut overlaps = 0;
        for tick in 0..1200 {
            let time = f64::from(tick) / 3.0 + 0.37;
            table.solve(time, &mut chain).unwrap();
            let (row, cell) = bounds.locate(time, 223).unwrap();
            let clearance = |bench| monitor.ground.obstacles()[0].clearance(&board(&chain, &PAPER, bench));
            let clearances: Vec<f64> = (0..223).map(clearance).collect();
            for (bench, value) in clearances.iter().enumerate().skip(1) {
                let bound = f64::from(bounds.bounds[cell * bounds.rows + row + bench - 1]);
                assert!(bound <= *value, "bench {bench} at {time}: {bound} {value}");
            }
            overlaps += clearances.iter().filter(|value| **value < -0.1).count();
            let least = clearances.into_iter().fold(f64::INFINITY, f64::min);
            let nearest = monitor.nearest(&chain, time, 10.0).unwrap().value;
            assert!((nearest - least).abs() < 1e-12, "{nearest} {least} at {time}");
        }
        assert!(overlaps > 1000, "{overlaps}");
    }
}
