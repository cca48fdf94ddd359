//! How near boards can come to those behind them, wherever on the path they are: worked out before the show, so that a
//! frame need only test the few pairs that can be the nearest.
//!
//! Where the second handle stands at T(alpha), the next ones stand at T(alpha + 1), T(alpha + 2) and so on: see
//! [`crate::solve::table::rows`]. So how near a body bench is to those behind it depends on the alpha of its front
//! handle alone. Every row of T is divided into [`CELLS`] equal cells, so that while one handle is in a cell, the next
//! is in the same cell of the next row. Each (row, cell) has a list of the benches that can be near, with a proven
//! lower bound of the signed distance to each (see [`super::moving`]), in ascending order; the last entry stands for
//! all others. The lists' first bounds are kept once more cell by cell, where those of a whole chain lie side by side.
//!
//! The head's link differs, but while the second handle is in a cell, the head too is near a known quadratic polynomial
//! of the cell's time. Its list holds while it is so near as was taken for granted, which every frame confirms; past a
//! stall it is elsewhere, and nothing is known of it.
//!
//! In: a path and a team. Out: lists for every frame. Called by the clearance only.

use super::grid::Grid;
use super::moving::{MovingBoard, Quadratic};
use super::{circle_radius, corner_reach};
use crate::model::Vector;
use crate::model::board::Board;
use crate::model::path::Path;
use crate::model::separation::separation_board_board;
use crate::model::team::Team;
use crate::solve::table::FollowerTable;
use crate::solve::table::rows::{Alpha, Band, Rows};

/// Cells to a row.
const CELLS: usize = 8;

/// Rows, at most: some 30 MB.
const MOST_ROWS: usize = 1 << 14;

/// The most work to make a table, in nanoseconds as a present processor does it.
const MOST_WORK: usize = 500_000_000;

/// Nanoseconds for a cell of a row, for bounding a pair roughly, and for bounding it well.
const WORK_OF_CELL: usize = 600;
const WORK_OF_PAIR: usize = 30;
const WORK_OF_BOUND: usize = 150;

/// Entries of a list, at most.
const MOST_ENTRIES: usize = 24;

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
    const UNKNOWN: Self = Self { bound: f32::NEG_INFINITY, behind: Self::ALL };
}

/// Where the second handle of a frame is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Located {
    row: usize,
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

/// The head at the end of a cell.
#[derive(Debug, Clone, Copy)]
struct HeadKnot {
    place: Vector,
    /// Its derivative by the cell's time.
    slope: Vector,
}

/// The table.
#[derive(Debug, Clone)]
pub(super) struct BoundTable {
    follower: FollowerTable,
    rows: usize,
    /// By cell, then by row: the first bound of each list, and where the list begins.
    bounds: Vec<f32>,
    begins: Vec<u32>,
    /// By row, then by cell, as far back as the second handle comes.
    heads: Vec<Option<HeadCell>>,
    neighbours: Vec<Neighbour>,
}

impl BoundTable {
    /// The table for a team on a path with its follower table; `None` where it would be too large or too much work.
    pub(super) fn new(path: &Path, team: &Team, follower: &FollowerTable) -> Option<Self> {
        if team.benches < 3 {
            return None;
        }
        let rows = follower.rows().rows();
        if rows == 0 || rows > MOST_ROWS {
            return None;
        }
        let knots = head_knots(path, follower, team.link(1))?;
        let mut table = Self {
            rows,
            bounds: vec![f32::NEG_INFINITY; CELLS * rows],
            begins: vec![0; CELLS * rows],
            heads: vec![None; knots.len()],
            neighbours: vec![Neighbour::UNKNOWN],
            follower: follower.clone(),
        };
        let mut lists = ListBuilder::new(team, rows, follower.accuracy());
        for cell in 0..CELLS {
            table.fill(cell, team, &knots, &mut lists)?;
        }
        Some(table)
    }

    /// Makes the lists of one cell of every row; `None` where that is too much work.
    fn fill(&mut self, cell: usize, team: &Team, knots: &[Option<HeadKnot>], lists: &mut ListBuilder) -> Option<()> {
        let (first, handles) = handles(self.follower.rows(), cell);
        lists.enter(first, &handles);
        // From the rear forward, so that it is known how far all the boards behind go.
        for row in (first..self.rows - 1).rev() {
            let mover = lists.board(row);
            let begin = lists.list(&mover, row, row + 2, &mut self.neighbours);
            self.begins[cell * self.rows + row] = begin;
            self.bounds[cell * self.rows + row] = self.neighbours[begin as usize].bound;
            lists.most_travel = lists.most_travel.max(mover.0.travel);
            let flat = row * CELLS + cell;
            if let Some(track) = knots.get(flat..flat + 2).and_then(|knots| head_track(knots, lists.handle_error)) {
                let head = MovingBoard::new(&track, &handles[row - first], team, 0);
                let begin = lists.list(&(head, head.middle()), row, row + 1, &mut self.neighbours);
                self.heads[flat] = Some(HeadCell { track, begin });
            }
            if lists.work > MOST_WORK {
                return None;
            }
        }
        Some(())
    }

    /// Where the second handle is when the head has travelled so many metres; `None` where the table does not know.
    pub(super) fn locate(&self, travelled: f64, benches: usize) -> Option<Located> {
        let (Alpha { row, phase }, _) = self.follower.second_handle(travelled)?;
        let cells = phase * CELLS as f64;
        let cell = (cells as usize).min(CELLS - 1);
        (row + benches <= self.rows).then_some(Located { row, cell, time: 2.0 * (cells - cell as f64) - 1.0 })
    }

    /// The first bounds of the lists of so many benches from the second one on.
    pub(super) fn bounds(&self, located: Located, benches: usize) -> &[f32] {
        &self.bounds[located.cell * self.rows + located.row..][..benches]
    }

    /// The list of the bench so many behind the second one.
    pub(super) fn of_body(&self, located: Located, behind: usize) -> &[Neighbour] {
        &self.neighbours[self.begins[located.cell * self.rows + located.row + behind] as usize..]
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
}

/// Makes lists for one cell of all rows after the other.
struct ListBuilder<'a> {
    team: &'a Team,
    /// The boards of the cell, from row `first` on, with where they are in the middle of it.
    boards: Vec<(MovingBoard, Board)>,
    first: usize,
    grid: Grid,
    /// The side of the grid's squares, metres.
    side: f64,
    /// The most that a board behind the row goes, metres.
    most_travel: f64,
    /// How far, in metres, a handle of a frame can be from where it should be: twice what T and the frame are off.
    handle_error: f64,
    /// No bound is greater. Two benches with one between them are never farther apart than its link, so that in every
    /// frame some pair is nearer.
    farthest: f64,
    candidates: Vec<(usize, f64)>,
    work: usize,
}

impl<'a> ListBuilder<'a> {
    fn new(team: &'a Team, rows: usize, handle_error: f64) -> Self {
        Self {
            team,
            boards: Vec::with_capacity(rows),
            first: 0,
            grid: Grid::new(rows),
            most_travel: 0.0,
            side: 0.0,
            handle_error,
            farthest: team.link(1) + 2.0 * handle_error,
            candidates: Vec::new(),
            work: 0,
        }
    }

    fn board(&self, row: usize) -> (MovingBoard, Board) {
        self.boards[row - self.first]
    }

    /// The next cell, with its handles from a row on.
    fn enter(&mut self, first: usize, handles: &[Quadratic]) {
        self.first = first;
        self.boards.clear();
        self.boards.extend(handles.windows(2).map(|pair| {
            let moving = MovingBoard::new(&pair[0], &pair[1], self.team, 1);
            (moving, moving.middle())
        }));
        self.most_travel = self.boards.last().map_or(0.0, |(moving, _)| moving.travel);
        self.side = 2.0 * circle_radius(self.team, 1) + self.farthest + 4.0 * self.most_travel;
        self.grid.clear(self.side);
        for (index, (_, board)) in self.boards.iter().enumerate() {
            self.grid.add(index, board.centre.x, board.centre.y);
        }
    }

    /// Adds the list of a board against those from row `from` on, offsets counted from `row`, and returns where it
    /// begins.
    /// All boards behind must be known to go `most_travel` at most.
    fn list(&mut self, mover: &(MovingBoard, Board), row: usize, from: usize, neighbours: &mut Vec<Neighbour>) -> u32 {
        self.work += WORK_OF_CELL;
        let (moving, board) = mover;
        let reach =
            board.circle_radius() + circle_radius(self.team, 1) + self.farthest + moving.travel + self.most_travel;
        // Next to a singular place, nothing that is true is of use.
        if reach.is_nan() || reach >= 3.0 * self.side {
            return 0;
        }
        let near = self.candidates_within(mover, reach, from);
        for (row, bound) in &mut self.candidates {
            if *bound <= near {
                let (other, other_board) = &self.boards[*row - self.first];
                *bound = bound.max(moving.least_distance(board, other, other_board));
                self.work += WORK_OF_BOUND;
            }
        }
        self.candidates.sort_unstable_by(|a, b| a.1.total_cmp(&b.1));
        let coordinates = board.centre.coords.norm() + reach;
        let handle_error = self.handle_error + 64.0 * f64::EPSILON * coordinates;
        let margin = 2.0 * handle_error * corner_reach(self.team, 0).max(corner_reach(self.team, 1));
        let rounded = |bound: f64| ((bound - margin) as f32).next_down();
        let begin = neighbours.len() as u32;
        let kept = self.candidates.len().min(MOST_ENTRIES);
        let entry = |(other, bound): &(usize, f64)| Neighbour { bound: rounded(*bound), behind: (other - row) as u32 };
        neighbours.extend(self.candidates[..kept].iter().map(entry));
        let others = self.candidates.get(kept).map_or(self.farthest, |(_, bound)| *bound);
        neighbours.push(Neighbour { bound: rounded(others), behind: Neighbour::ALL });
        begin
    }

    /// Finds the rows that can be within `farthest`, with a first bound of each; returns how near the nearest is
    /// throughout the cell.
    fn candidates_within(&mut self, mover: &(MovingBoard, Board), reach: f64, from: usize) -> f64 {
        let Self { boards, grid, candidates, work, first, farthest, .. } = self;
        candidates.clear();
        let centre = mover.1.centre;
        let mut near = f64::INFINITY;
        grid.visit_near((centre.x, centre.y), reach, from - *first, |index| {
            *work += WORK_OF_PAIR;
            let (moving, board) = &boards[index];
            let (separation, travel) = (separation_board_board(&mover.1, board), mover.0.travel + moving.travel);
            if separation - travel <= *farthest {
                candidates.push((*first + index, separation - travel));
                near = near.min(separation + travel);
            }
        });
        near
    }
}

/// The handles of all rows while they are in a cell, and the first row for which T is known there.
fn handles(rows: &Rows, cell: usize) -> (usize, Vec<Quadratic>) {
    let share = |cell: usize| cell as f64 / CELLS as f64;
    let (begin, end) = (share(cell), share(cell + 1));
    let front = rows.bands.first().map_or(0, |band| band.first_row);
    let first = ((rows.valid_from - begin).ceil() as usize).max(front);
    let mut handles = Vec::with_capacity(rows.rows());
    for band in &rows.bands {
        let pieces = band.piece_at(begin)..=band.piece_at(end);
        for row in first.max(band.first_row)..band.first_row + band.rows {
            handles.push(handle(band, pieces.clone(), row, (begin, end)));
        }
    }
    (first, handles)
}

/// A handle while its phase goes from `begin` to `end`, which are in these pieces.
fn handle(band: &Band, pieces: std::ops::RangeInclusive<usize>, row: usize, (begin, end): (f64, f64)) -> Quadratic {
    let middle = 0.5 * (begin + end);
    let at = |piece: usize, phase: f64| {
        let beta = band.pieces[piece].beta(phase);
        let [x, y] = band.coordinates(piece, row);
        let value = |c: [f64; 6]| c.iter().rev().fold(0.0, |value, c| value * beta + c);
        Vector::new(value(x), value(y))
    };
    let mut quadratic =
        Quadratic::through(at(*pieces.start(), begin), at(band.piece_at(middle), middle), at(*pieces.end(), end));
    for piece in pieces {
        let part = (band.pieces[piece].begin.max(begin), band.pieces[piece].end.min(end));
        let time = |phase: f64| (2.0 * phase - begin - end) / (end - begin);
        let local = |low: f64, high: f64| (0.5 * (low + high), 0.5 * (high - low));
        let betas = local(band.pieces[piece].beta(part.0), band.pieces[piece].beta(part.1));
        let times = local(time(part.0), time(part.1));
        let miss: [f64; 2] = std::array::from_fn(|axis| {
            let coefficients = band.coordinates(piece, row)[axis];
            largest_difference(coefficients, betas, quadratic.terms.map(|term| term[axis]), times)
        });
        quadratic.error = quadratic.error.max(miss[0].hypot(miss[1]));
    }
    quadratic
}

/// A bound of the difference of two polynomials, each on its own interval, given by its middle and half its length.
fn largest_difference(a: [f64; 6], (middle, half): (f64, f64), b: [f64; 3], (time, half_time): (f64, f64)) -> f64 {
    let mut shifted = a;
    for low in 0..5 {
        for power in (low..5).rev() {
            shifted[power] += middle * shifted[power + 1];
        }
    }
    let mut scale = 1.0;
    for coefficient in &mut shifted {
        *coefficient *= scale;
        scale *= half;
    }
    shifted[0] -= b[0] + time * (b[1] + time * b[2]);
    shifted[1] -= half_time * (b[1] + 2.0 * time * b[2]);
    shifted[2] -= half_time * half_time * b[2];
    shifted.iter().map(|coefficient| coefficient.abs()).sum()
}

/// The head when alpha of the second handle is at the beginning of a cell, by the number of the cell, counted over all
/// rows; of several places the first. These need not be exact.
fn head_knots(path: &Path, follower: &FollowerTable, link: f64) -> Option<Vec<Option<HeadKnot>>> {
    let cells = |travelled: f64| {
        let (alpha, rate) = follower.second_handle(travelled)?;
        Some(((alpha.row as f64 + alpha.phase) * CELLS as f64, rate * CELLS as f64))
    };
    let (start, _) = cells(0.0)?;
    let mut knots = vec![None; start as usize + 1];
    let longest = link / CELLS as f64;
    let mut travelled = 0.0;
    for wanted in (0..=start as usize).rev() {
        while let Some((reached, rate)) = cells(travelled)
            && reached > wanted as f64 + 1e-9
        {
            let step = (wanted as f64 - reached) / rate;
            travelled += if rate < 0.0 { step.clamp(1e-6 * link, longest) } else { longest };
        }
        let Some((reached, rate)) = cells(travelled) else { break };
        travelled += ((wanted as f64 - reached) / rate).clamp(-longest, longest);
        let param = path.param_at(travelled);
        knots[wanted] = Some(HeadKnot { place: path.point(param).coords, slope: path.tangent(param) * (0.5 / rate) });
    }
    Some(knots)
}

/// How the head goes from one knot to the next: the quadratic next to the cubic of their places and slopes; a frame's
/// head may be `handle_error` metres from the path.
fn head_track(knots: &[Option<HeadKnot>], handle_error: f64) -> Option<Quadratic> {
    let [Some(begin), Some(end)] = knots else { return None };
    let middle = 0.5 * (begin.place + end.place) + 0.25 * (begin.slope - end.slope);
    let mut track = Quadratic::through(begin.place, middle, end.place);
    let cubic = 0.25 * (begin.slope + end.slope - (end.place - begin.place));
    track.error = cubic.norm() + 1e-6 + handle_error;
    Some(track)
}
