//! Lower bounds of the distance of boards to the boards behind them, for every place on the path. They are computed
//! before the show, so that a frame tests only the few pairs that can be the nearest.
//!
//! If the second handle stands at T(alpha), the next ones stand at T(alpha + 1), T(alpha + 2) and so on: see
//! [`crate::solve::table::rows`]. So the distances of a body bench to those behind it depend on the alpha of its front
//! handle alone. Every row of T is divided into [`CELLS`] equal cells, and while one handle is in a cell, the next is
//! in the same cell of the next row. Each (row, cell) has a list of the benches that can be near, with a proven lower
//! bound of the signed distance to each (see [`super::moving`]), in ascending order. The last entry stands for all
//! others. Far behind, boards hardly move against each other while all advance by a link, so there one list is valid
//! for all cells of a row.
//!
//! The rows are grouped into blocks, and the least bound of each block is also kept, cell by cell, so that the least
//! bounds of a whole chain are adjacent in memory. A frame reads only the blocks whose least bound is within its limit.
//!
//! The head's link differs from the others. But while the second handle is in a cell, the head too is near a known
//! quadratic polynomial of the cell's time. The head's list is valid while the head is within the assumed error, which
//! every frame checks. Past a stall the head is elsewhere and has no list.
//!
//! In: a path and a team. Out: lists for every frame.

use std::time::{Duration, Instant};

use super::cells::{CELLS, HeadGridPoint, end_of_near, head_grid_points, head_track};
use super::lists::{List, ListBuilder, Neighbour};
use super::moving::{MovingBoard, Quadratic};
use crate::model::Vector;
use crate::model::path::Path;
use crate::model::team::Team;
use crate::solve::table::FollowerTable;
use crate::solve::table::rows::Alpha;

/// Rows of a block.
pub(super) const BLOCK: usize = 64;

/// Rows at the front that always have lists for every cell: the nearest pairs are most often there.
const FINE_ROWS: usize = 1024;

/// The greatest number of rows for which the head has lists: about 10 MB.
const MOST_HEAD_ROWS: usize = 1 << 14;

/// The greatest slack of a block's bounds, in links, if one list is used for all cells of a row.
const MOST_SLACK: f64 = 1e-3;

/// The greatest work to make a table, in nanoseconds on a processor of 2025.
const MOST_WORK: usize = 5_000_000_000;

/// The greatest size of all lists, in bytes.
const MOST_BYTES: usize = 128 << 20;

/// The place of a frame's second handle in the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Located {
    /// Its row, which is also the row of the bench it leads.
    pub row: usize,
    cell: usize,
    /// -1 to 1 over the cell.
    time: f64,
}

/// The head while the second handle is in a cell.
#[derive(Debug, Clone, Copy)]
struct HeadCell {
    track: Quadratic,
    /// The index of the first entry of its list.
    begin: u32,
}

/// The places of the lists of a block.
#[derive(Debug, Clone, Copy)]
struct Block {
    /// The place of its first row in the table's `bounds` and `begins`, in its first cell.
    begin: usize,
    /// The number of cells with separate lists.
    cells: usize,
}

/// The table.
#[derive(Debug, Clone)]
pub(super) struct BoundTable {
    follower: FollowerTable,
    rows: usize,
    /// By cell, then by block: the least bound.
    least: Vec<f32>,
    blocks: Vec<Block>,
    /// By block, then by cell, then by row: the first bound of each list, and the index of its first entry.
    bounds: Vec<f32>,
    begins: Vec<u32>,
    /// By row, then by cell, as far back as the second handle can be.
    heads: Vec<Option<HeadCell>>,
    neighbours: Vec<Neighbour>,
    made_in: Duration,
}

impl BoundTable {
    /// Makes the table for a team on a path with its follower table; `None` if it would be too large or too much work.
    pub(super) fn new(path: &Path, team: &Team, follower: &FollowerTable) -> Option<Self> {
        let began = Instant::now();
        let rows = follower.rows().rows();
        if team.benches < 3 || rows == 0 {
            return None;
        }
        let mut grid_points = head_grid_points(path, follower, team.link(1))?;
        grid_points.truncate(CELLS * MOST_HEAD_ROWS);
        let blocks = rows.div_ceil(BLOCK);
        let mut table = Self {
            follower: follower.without_rows(),
            rows,
            least: vec![f32::INFINITY; CELLS * blocks],
            blocks: vec![Block { begin: 0, cells: CELLS }; blocks],
            bounds: Vec::new(),
            begins: Vec::new(),
            heads: vec![None; grid_points.len()],
            neighbours: Vec::new(),
            made_in: Duration::ZERO,
        };
        let mut builder = ListBuilder::new(team, rows, follower.accuracy());
        let present = team.benches - 2;
        let mut fine: Vec<usize> =
            (0..(FINE_ROWS.max(grid_points.len() / CELLS + 2)).div_ceil(BLOCK).min(blocks)).collect();
        if fine.len() < blocks {
            builder.enter(follower.rows(), (0.0, 1.0), rows);
            for block in (fine.len()..blocks).rev() {
                if !table.fill_with_one_cell(block, present, MOST_SLACK * team.link(1), &mut builder)? {
                    fine.push(block);
                }
            }
        }
        for block in &fine {
            table.blocks[*block].begin = table.extend(CELLS);
        }
        let mut is_fine = vec![false; blocks];
        fine.iter().for_each(|block| is_fine[*block] = true);
        // The rear handles, too: one row more has the rear handle of the last board.
        let is_near = |row: usize| is_fine[row / BLOCK] || is_fine[row.saturating_sub(1) / BLOCK];
        let end = end_of_near(follower.rows(), is_near, team.link(1), builder.longest_distance()) + 1;
        for cell in 0..CELLS {
            let share = |cell: usize| cell as f64 / CELLS as f64;
            builder.enter(follower.rows(), (share(cell), share(cell + 1)), end.min(rows));
            for block in &fine {
                table.fill(*block, cell, present, &mut builder);
                table.fill_heads(*block, cell, team, &grid_points, &mut builder);
                within_limits(&builder)?;
            }
        }
        Some(Self { neighbours: builder.neighbours, made_in: began.elapsed(), ..table })
    }

    /// Reserves space for `cells` cells of a block and returns its index.
    fn extend(&mut self, cells: usize) -> usize {
        let begin = self.bounds.len();
        // Places without a list are never read.
        self.bounds.resize(begin + cells * BLOCK, f32::INFINITY);
        self.begins.resize(begin + cells * BLOCK, 0);
        begin
    }

    /// Makes one list per row for all cells of a block. Returns false if their slack is too large, `None` if the work
    /// is.
    fn fill_with_one_cell(
        &mut self,
        block: usize,
        present: usize,
        most_slack: f64,
        builder: &mut ListBuilder,
    ) -> Option<bool> {
        let (neighbours, begin) = (builder.neighbours.len(), self.extend(1));
        self.blocks[block] = Block { begin, cells: 1 };
        let slack = self.fill(block, 0, present, builder);
        within_limits(builder)?;
        if slack <= most_slack {
            let blocks = self.blocks.len();
            (1..CELLS).for_each(|cell| self.least[cell * blocks + block] = self.least[block]);
            return Some(true);
        }
        builder.neighbours.truncate(neighbours);
        self.bounds.truncate(begin);
        self.begins.truncate(begin);
        self.blocks[block].cells = CELLS;
        Some(false)
    }

    /// Makes the lists of a cell of a block. Returns the greatest slack of a first bound, in metres.
    fn fill(&mut self, block: usize, cell: usize, present: usize, builder: &mut ListBuilder) -> f64 {
        let (mut least, mut slack) = (f32::INFINITY, 0.0f64);
        // The last row has no board.
        for row in (block * BLOCK..((block + 1) * BLOCK).min(self.rows - 1)).rev() {
            let list = builder.of_body(row, present);
            let place = self.place(block, cell) + row % BLOCK;
            (self.bounds[place], self.begins[place]) = (list.bound, list.begin);
            (least, slack) = (least.min(list.bound), slack.max(list.slack));
        }
        let blocks = self.blocks.len();
        self.least[cell * blocks + block] = least;
        slack
    }

    /// Makes the lists of the head while the second handle is in a cell of a block.
    fn fill_heads(
        &mut self,
        block: usize,
        cell: usize,
        team: &Team,
        grid_points: &[Option<HeadGridPoint>],
        builder: &mut ListBuilder,
    ) {
        for row in block * BLOCK..((block + 1) * BLOCK).min(self.rows - 1) {
            let flat = row * CELLS + cell;
            let track = grid_points
                .get(flat..flat + 2)
                .and_then(|grid_points| head_track(grid_points, self.follower.accuracy()));
            if let (Some(track), Some(second)) = (track, builder.handle(row)) {
                let head = MovingBoard::new(&track, second, team, 0);
                let List { begin, .. } = builder.of_head(&head, row, row + team.benches - 2);
                self.heads[flat] = Some(HeadCell { track, begin });
            }
        }
    }

    /// Returns the place of the second handle when the head has travelled `travelled` metres; `None` outside the table.
    pub(super) fn locate(&self, travelled: f64, benches: usize) -> Option<Located> {
        let (Alpha { row, phase }, _) = self.follower.second_handle(travelled)?;
        let cells = phase * CELLS as f64;
        let cell = (cells as usize).min(CELLS - 1);
        (row + benches <= self.rows).then_some(Located { row, cell, time: 2.0 * (cells - cell as f64) - 1.0 })
    }

    /// Returns the least bounds of the blocks that have any of these rows.
    pub(super) fn least_bounds(&self, located: Located, rows: &std::ops::Range<usize>) -> &[f32] {
        &self.least[located.cell * self.blocks.len()..][rows.start / BLOCK..rows.end.div_ceil(BLOCK)]
    }

    /// Returns the first bounds of the lists of a block, by row.
    pub(super) fn bounds(&self, located: Located, block: usize) -> &[f32] {
        &self.bounds[self.place(block, located.cell)..][..BLOCK]
    }

    /// Returns the list of the bench that the handle of a row leads.
    pub(super) fn of_body(&self, located: Located, row: usize) -> &[Neighbour] {
        &self.neighbours[self.begins[self.place(row / BLOCK, located.cell) + row % BLOCK] as usize..]
    }

    /// Returns the list of the head at (x, y), counted from the second bench.
    pub(super) fn of_head(&self, located: Located, (x, y): (f64, f64)) -> &[Neighbour] {
        let head = self.heads.get(located.row * CELLS + located.cell).and_then(Option::as_ref);
        let confirmed = head.filter(|head| {
            let miss = head.track.at(located.time) - Vector::new(x, y);
            miss.norm_squared() <= head.track.error * head.track.error
        });
        &self.neighbours[confirmed.map_or(0, |head| head.begin) as usize..]
    }

    /// Returns the index of the first row of a block in a cell.
    #[inline]
    fn place(&self, block: usize, cell: usize) -> usize {
        let Block { begin, cells } = self.blocks[block];
        begin + if cells == 1 { 0 } else { cell * BLOCK }
    }

    /// Returns the size of the table, in bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(self.least.as_slice())
            + size_of_val(self.blocks.as_slice())
            + size_of_val(self.bounds.as_slice())
            + size_of_val(self.begins.as_slice())
            + size_of_val(self.heads.as_slice())
            + size_of_val(self.neighbours.as_slice())
    }

    /// Returns the time it took to make.
    pub(super) fn made_in(&self) -> Duration {
        self.made_in
    }
}

/// Returns `None` if the lists are too many or too much work.
fn within_limits(builder: &ListBuilder) -> Option<()> {
    (builder.work <= MOST_WORK && size_of_val(builder.neighbours.as_slice()) <= MOST_BYTES).then_some(())
}
