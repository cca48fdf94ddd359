//! How near boards can come to those behind them, wherever on the path they are: worked out before the show, so that a
//! frame need only test the few pairs that can be the nearest.
//!
//! Where the second handle stands at T(alpha), the next ones stand at T(alpha + 1), T(alpha + 2) and so on: see
//! [`crate::solve::table::rows`]. So how near a body bench is to those behind it depends on the alpha of its front
//! handle alone. Every row of T is divided into [`CELLS`] equal cells, so that while one handle is in a cell, the next
//! is in the same cell of the next row. Each (row, cell) has a list of the benches that can be near, with a proven
//! lower bound of the signed distance to each (see [`super::moving`]), in ascending order; the last entry stands for
//! all others. Far behind, where boards hardly move against each other while they all go on by a link, one list serves
//! all cells of a row.
//!
//! The rows are grouped into blocks. The least bound of each block is kept once more, cell by cell, where those of a
//! whole chain lie side by side: a frame looks into those blocks only of which that is within its limit.
//!
//! The head's link differs, but while the second handle is in a cell, the head too is near a known quadratic polynomial
//! of the cell's time. Its list holds while it is so near as was taken for granted, which every frame confirms; past a
//! stall it is elsewhere, and nothing is known of it.
//!
//! In: a path and a team. Out: lists for every frame. Called by the clearance only.

use std::time::{Duration, Instant};

use super::cells::{HeadKnot, end_of_near, head_knots, head_track};
use super::lists::{List, ListBuilder};
use super::moving::{MovingBoard, Quadratic};
use crate::model::Vector;
use crate::model::path::Path;
use crate::model::team::Team;
use crate::solve::table::FollowerTable;
use crate::solve::table::rows::Alpha;

/// Cells to a row.
pub(super) const CELLS: usize = 8;

/// Rows of a block.
pub(super) const BLOCK: usize = 64;

/// Rows at the front that always have lists for every cell: the nearest pairs are most often there.
const FINE_ROWS: usize = 1024;

/// Rows for which the head has lists, at most: some 10 MB.
const MOST_HEAD_ROWS: usize = 1 << 14;

/// How far the bounds of a block may be below the distances, in links, where one list serves all cells of a row.
const MOST_SLACK: f64 = 1e-3;

/// The most work to make a table, in nanoseconds as a present processor does it.
const MOST_WORK: usize = 5_000_000_000;

/// Bytes of all lists, at most.
const MOST_BYTES: usize = 128 << 20;

/// Benches that can be near another one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neighbour {
    /// Their signed distance is never less, metres.
    pub bound: f32,
    /// How many benches further behind; [`Neighbour::ALL`] for all that the list does not have.
    pub behind: u32,
}

impl Neighbour {
    pub(super) const ALL: u32 = u32::MAX;
    pub(super) const UNKNOWN: Self = Self { bound: f32::NEG_INFINITY, behind: Self::ALL };
}

/// Where the second handle of a frame is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Located {
    /// Its row, which is also that of the bench it leads.
    pub row: usize,
    cell: usize,
    /// -1 to 1 over the cell.
    time: f64,
}

/// The head while the second handle is in a cell.
#[derive(Debug, Clone, Copy)]
struct HeadCell {
    track: Quadratic,
    /// Where its list begins.
    begin: u32,
}

/// Where a block has its lists.
#[derive(Debug, Clone, Copy)]
struct Block {
    /// The place of its first row in the table's `bounds` and `begins`, in its first cell.
    begin: usize,
    /// How many cells have lists of their own.
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
    /// By block, then by cell, then by row: the first bound of each list, and where the list begins.
    bounds: Vec<f32>,
    begins: Vec<u32>,
    /// By row, then by cell, as far back as the second handle comes.
    heads: Vec<Option<HeadCell>>,
    neighbours: Vec<Neighbour>,
    made_in: Duration,
}

impl BoundTable {
    /// The table for a team on a path with its follower table; `None` where it would be too large or too much work.
    pub(super) fn new(path: &Path, team: &Team, follower: &FollowerTable) -> Option<Self> {
        let began = Instant::now();
        let rows = follower.rows().rows();
        if team.benches < 3 || rows == 0 {
            return None;
        }
        let mut knots = head_knots(path, follower, team.link(1))?;
        knots.truncate(CELLS * MOST_HEAD_ROWS);
        let blocks = rows.div_ceil(BLOCK);
        let mut table = Self {
            follower: follower.without_rows(),
            rows,
            least: vec![f32::INFINITY; CELLS * blocks],
            blocks: vec![Block { begin: 0, cells: CELLS }; blocks],
            bounds: Vec::new(),
            begins: Vec::new(),
            heads: vec![None; knots.len()],
            neighbours: Vec::new(),
            made_in: Duration::ZERO,
        };
        let mut builder = ListBuilder::new(team, rows, follower.accuracy());
        let present = team.benches - 2;
        let mut fine: Vec<usize> = (0..(FINE_ROWS.max(knots.len() / CELLS + 2)).div_ceil(BLOCK).min(blocks)).collect();
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
        // The rear handles, too. One row more has that of the last board.
        let is_near = |row: usize| is_fine[row / BLOCK] || is_fine[row.saturating_sub(1) / BLOCK];
        let end = end_of_near(follower.rows(), is_near, team.link(1), builder.longest_distance()) + 1;
        for cell in 0..CELLS {
            let share = |cell: usize| cell as f64 / CELLS as f64;
            builder.enter(follower.rows(), (share(cell), share(cell + 1)), end.min(rows));
            for block in &fine {
                table.fill(*block, cell, present, &mut builder);
                table.fill_heads(*block, cell, team, &knots, &mut builder);
                within_limits(&builder)?;
            }
        }
        Some(Self { neighbours: builder.neighbours, made_in: began.elapsed(), ..table })
    }

    /// Makes room for so many cells of a block; returns where that is.
    fn extend(&mut self, cells: usize) -> usize {
        let begin = self.bounds.len();
        // What no list fills is never read.
        self.bounds.resize(begin + cells * BLOCK, f32::INFINITY);
        self.begins.resize(begin + cells * BLOCK, 0);
        begin
    }

    /// Makes lists for all cells of a block at once, if they are close enough; `None` where that is too much work.
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

    /// Makes the lists of a cell of a block; returns how far the first bound of one can be below the distance.
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
        knots: &[Option<HeadKnot>],
        builder: &mut ListBuilder,
    ) {
        for row in block * BLOCK..((block + 1) * BLOCK).min(self.rows - 1) {
            let flat = row * CELLS + cell;
            let track = knots.get(flat..flat + 2).and_then(|knots| head_track(knots, self.follower.accuracy()));
            if let (Some(track), Some(second)) = (track, builder.handle(row)) {
                let head = MovingBoard::new(&track, second, team, 0);
                let List { begin, .. } = builder.of_head(&head, row, row + team.benches - 2);
                self.heads[flat] = Some(HeadCell { track, begin });
            }
        }
    }

    /// Where the second handle is when the head has travelled so many metres; `None` where the table does not know.
    pub(super) fn locate(&self, travelled: f64, benches: usize) -> Option<Located> {
        let (Alpha { row, phase }, _) = self.follower.second_handle(travelled)?;
        let cells = phase * CELLS as f64;
        let cell = (cells as usize).min(CELLS - 1);
        (row + benches <= self.rows).then_some(Located { row, cell, time: 2.0 * (cells - cell as f64) - 1.0 })
    }

    /// The least bounds of the blocks that have any of these rows.
    pub(super) fn least_bounds(&self, located: Located, rows: &std::ops::Range<usize>) -> &[f32] {
        &self.least[located.cell * self.blocks.len()..][rows.start / BLOCK..rows.end.div_ceil(BLOCK)]
    }

    /// The first bounds of the lists of a block, by row.
    pub(super) fn bounds(&self, located: Located, block: usize) -> &[f32] {
        &self.bounds[self.place(block, located.cell)..][..BLOCK]
    }

    /// The list of the bench that the handle of a row leads.
    pub(super) fn of_body(&self, located: Located, row: usize) -> &[Neighbour] {
        &self.neighbours[self.begins[self.place(row / BLOCK, located.cell) + row % BLOCK] as usize..]
    }

    /// The list of the head, counted from the second bench, if the head is at `place`.
    pub(super) fn of_head(&self, located: Located, (x, y): (f64, f64)) -> &[Neighbour] {
        let head = self.heads.get(located.row * CELLS + located.cell).and_then(Option::as_ref);
        let confirmed = head.filter(|head| {
            let miss = head.track.at(located.time) - Vector::new(x, y);
            miss.norm_squared() <= head.track.error * head.track.error
        });
        &self.neighbours[confirmed.map_or(0, |head| head.begin) as usize..]
    }

    /// The place of the first row of a block in a cell.
    #[inline]
    fn place(&self, block: usize, cell: usize) -> usize {
        let Block { begin, cells } = self.blocks[block];
        begin + if cells == 1 { 0 } else { cell * BLOCK }
    }

    /// Bytes that it takes.
    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(self.least.as_slice())
            + size_of_val(self.blocks.as_slice())
            + size_of_val(self.bounds.as_slice())
            + size_of_val(self.begins.as_slice())
            + size_of_val(self.heads.as_slice())
            + size_of_val(self.neighbours.as_slice())
    }

    /// How long it took to make.
    pub(super) fn made_in(&self) -> Duration {
        self.made_in
    }
}

/// `None` where the lists are too many or too much work.
fn within_limits(builder: &ListBuilder) -> Option<()> {
    (builder.work <= MOST_WORK && size_of_val(builder.neighbours.as_slice()) <= MOST_BYTES).then_some(())
}
