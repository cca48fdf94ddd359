//! The lists of the table: which boards can be near a board throughout a cell, and how near.

use super::cells::handles;
use super::grid::Grid;
use super::moving::{MovingBoard, Quadratic};
use super::{circle_radius, corner_reach};
use crate::model::separation::{separation_board_board, signed_distance_board_board};
use crate::model::team::Team;
use crate::solve::table::rows::Rows;

/// Entries of a list, at most.
const MOST_ENTRIES: usize = 24;

/// Boards farther than the nearest by more than this, in links, have no entry.
const ALLOWANCE: f64 = 0.02;

/// The work for a row's handle, for its list, for a visited board, and for a bound of its distance, in nanoseconds on a
/// processor of 2025.
const WORK_OF_HANDLE: usize = 400;
const WORK_OF_LIST: usize = 300;
const WORK_OF_VISIT: usize = 15;
const WORK_OF_BOUND: usize = 250;

/// Benches that can be near another one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neighbour {
    /// A lower bound of their signed distance, in metres.
    pub bound: f32,
    /// The number of benches further behind; [`Neighbour::ALL`] for all benches without an entry.
    pub behind: u32,
}

impl Neighbour {
    pub(super) const ALL: u32 = u32::MAX;
    pub(super) const UNKNOWN: Self = Self { bound: f32::NEG_INFINITY, behind: Self::ALL };
}

/// A finished list.
#[derive(Debug, Clone, Copy)]
pub(super) struct List {
    /// The index of its first entry.
    pub begin: u32,
    /// Its first bound, in metres.
    pub bound: f32,
    /// The greatest difference of the distance to the nearest board and that bound, in metres.
    pub slack: f64,
}

impl List {
    /// The list of a board without known bounds.
    pub(super) const UNKNOWN: Self = Self { begin: 0, bound: f32::NEG_INFINITY, slack: f64::INFINITY };
}

/// Makes the lists of all rows, cell by cell.
pub(super) struct ListBuilder<'a> {
    team: &'a Team,
    /// The handles in the cell, from row `first` on.
    handles: Vec<Quadratic>,
    first: usize,
    /// By row from `first` on: greatest travel of its board and of those behind, in metres.
    travel_behind: Vec<f64>,
    grid: Grid,
    /// The displacement of boards, in metres, above which no list is made.
    longest_reach: f64,
    /// The greatest error of a handle of a frame, in metres: twice the errors of T and the frame.
    handle_error: f64,
    /// Upper limit of every bound, in metres. Two benches with one between them are never farther apart than its link,
    /// so that in every frame some pair is nearer.
    farthest: f64,
    /// Rows from a board to its nearest one, in the latest list.
    likely: usize,
    candidates: Vec<(usize, f64)>,
    /// All lists.
    pub neighbours: Vec<Neighbour>,
    /// The work so far, in nanoseconds on a processor of 2025.
    pub work: usize,
}

impl<'a> ListBuilder<'a> {
    pub(super) fn new(team: &'a Team, rows: usize, handle_error: f64) -> Self {
        Self {
            team,
            handles: Vec::new(),
            first: 0,
            travel_behind: Vec::new(),
            grid: Grid::new(rows),
            longest_reach: 0.0,
            handle_error,
            farthest: team.link(1) + 2.0 * handle_error,
            likely: 0,
            candidates: Vec::new(),
            neighbours: vec![Neighbour::UNKNOWN],
            work: 0,
        }
    }

    /// Returns the greatest distance of the front handles of two boards in one list, in metres.
    pub(super) fn longest_distance(&self) -> f64 {
        let from_handle = self.team.longest_link() + self.team.hole_inset + self.team.width;
        self.farthest + 2.0 * from_handle
    }

    /// Enters the next cell: the phases `phases`, rows up to `end_row`.
    pub(super) fn enter(&mut self, rows: &Rows, phases: (f64, f64), end_row: usize) {
        let (first, handles) = handles(rows, phases, end_row);
        self.work += WORK_OF_HANDLE * handles.len();
        self.first = first;
        self.handles = handles;
        let boards = self.handles.len().saturating_sub(1);
        let travel = |index: usize| Some(self.board(index).travel).filter(|travel| !travel.is_nan());
        let mut travel: Vec<f64> = (0..boards).map(|index| travel(index).unwrap_or(f64::INFINITY)).collect();
        let last = travel.last().copied().unwrap_or(0.0);
        for index in (1..boards).rev() {
            travel[index - 1] = travel[index - 1].max(travel[index]);
        }
        self.travel_behind = travel;
        let radii = 2.0 * circle_radius(self.team, 1);
        self.longest_reach = 3.0 * (radii + self.farthest + 4.0 * last);
        self.grid.clear(radii + 2.0 * last);
        for (index, pair) in self.handles.windows(2).enumerate() {
            let centre = 0.5 * (pair[0].terms[0] + pair[1].terms[0]);
            self.grid.add(index, centre.x, centre.y);
        }
    }

    /// Returns the handle of a row, if it is known throughout the cell.
    pub(super) fn handle(&self, row: usize) -> Option<&Quadratic> {
        self.handles.get(row.checked_sub(self.first)?)
    }

    fn board(&self, index: usize) -> MovingBoard {
        MovingBoard::new(&self.handles[index], &self.handles[index + 1], self.team, 1)
    }

    /// Makes the list of the board of a row. Whenever this board exists, so do the boards behind up to row `present`.
    pub(super) fn of_body(&mut self, row: usize, present: usize) -> List {
        if row < self.first || row + 1 >= self.first + self.handles.len() {
            return List::UNKNOWN;
        }
        let board = self.board(row - self.first);
        let list = self.list(&board, row, row + 2, present, self.likely);
        if list.begin > 0 {
            self.likely = self.neighbours[list.begin as usize].behind as usize;
        }
        list
    }

    /// Makes the list of a head's board in front of the handle of a row, as [`ListBuilder::of_body`].
    pub(super) fn of_head(&mut self, head: &MovingBoard, row: usize, present: usize) -> List {
        self.list(head, row, row + 1, present, usize::MAX)
    }

    /// Makes the list of a board against those from row `from` on, with offsets counted from `row`. The board `likely`
    /// rows behind is probably near.
    fn list(&mut self, moving: &MovingBoard, row: usize, from: usize, present: usize, likely: usize) -> List {
        self.work += WORK_OF_LIST;
        let at = moving.middle();
        let radii = at.circle_radius() + circle_radius(self.team, 1);
        let margin_per_error = 2.0 * corner_reach(self.team, 0).max(corner_reach(self.team, 1));
        let allowance = ALLOWANCE * self.team.link(1) + 2.0 * margin_per_error * self.handle_error;
        // Pairs farther apart than another present pair need no entries.
        let mut limit = self.farthest;
        let mut near = f64::INFINITY;
        let likely = row.saturating_add(likely);
        if (from..=present).contains(&likely) && likely - self.first < self.travel_behind.len() {
            let board = self.board(likely - self.first);
            limit = limit.min(moving.distance_bounds(&at, &board, &board.middle()).1 + allowance);
        }
        let most_travel = self.travel_behind.get(from - self.first).copied().unwrap_or(0.0);
        let reach = radii + limit.max(0.0) + moving.travel + most_travel;
        // Next to a singular place the bounds are too weak to help.
        if reach.is_nan() || reach >= self.longest_reach {
            return List::UNKNOWN;
        }
        let Self { team, handles, first, grid, candidates, work, .. } = self;
        candidates.clear();
        grid.visit_near((at.centre.x, at.centre.y), reach, from - *first, |index| {
            *work += WORK_OF_VISIT;
            let offset = moving.centre.to(&handles[index].half_way(&handles[index + 1]));
            if offset.terms[0].norm() - offset.travel() - radii > limit {
                return;
            }
            let board = MovingBoard::new(&handles[index], &handles[index + 1], team, 1);
            let (board_at, travel) = (board.middle(), moving.relative_travel(&board));
            let rough = separation_board_board(&at, &board_at) - travel;
            if rough > limit {
                return;
            }
            let (other, greatest) = (*first + index, signed_distance_board_board(&at, &board_at) + travel);
            near = near.min(greatest);
            if other <= present {
                limit = limit.min(greatest + allowance);
            }
            candidates.push((other, rough));
        });
        let rough_near = near;
        for (other, bound) in candidates.iter_mut().filter(|(_, rough)| *rough <= rough_near) {
            *work += WORK_OF_BOUND;
            let index = *other - *first;
            let board = MovingBoard::new(&handles[index], &handles[index + 1], team, 1);
            let (least, greatest) = moving.distance_bounds(&at, &board, &board.middle());
            *bound = bound.max(least);
            near = near.min(greatest);
            if *other <= present {
                limit = limit.min(greatest + allowance);
            }
        }
        candidates.retain(|(_, bound)| *bound <= limit);
        candidates.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        let coordinates = at.centre.coords.norm() + reach;
        let margin = margin_per_error * (self.handle_error + 64.0 * f64::EPSILON * coordinates);
        let rounded = |bound: f64| ((bound - margin) as f32).next_down();
        let begin = self.neighbours.len() as u32;
        let kept = self.candidates.len().min(MOST_ENTRIES);
        let entry = |(other, bound): &(usize, f64)| Neighbour { bound: rounded(*bound), behind: (other - row) as u32 };
        self.neighbours.extend(self.candidates[..kept].iter().map(entry));
        let others = self.candidates.get(kept).map_or(limit, |(_, bound)| *bound);
        self.neighbours.push(Neighbour { bound: rounded(others), behind: Neighbour::ALL });
        let bound = self.neighbours[begin as usize].bound;
        let slack = self.candidates.first().map_or(0.0, |(_, bound)| near - bound);
        List { begin, bound, slack }
    }
}
