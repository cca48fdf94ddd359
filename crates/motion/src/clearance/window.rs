//! A window: a span of the show's time, with the boards that can be the nearest at any moment of it.
//!
//! The solver gives the handles at five moments of the window. Through three of them goes a quadratic polynomial of the
//! time for each handle, and from the others follows an error that the polynomial is assumed to have. No bound relies on
//! this assumption: a window is used only for frames whose handles are all within the errors of their polynomials.
//! Two boards whose handles move in this way have a lower and an upper bound of their distance (see [`super::moving`]).
//! The window lists the pairs whose lower bound is within the least upper bound of any pair, and the benches that an
//! obstacle can be as near to. A window without length holds one frame.
//!
//! In: a solver and a time. Out: the pairs and benches to be tested in a frame.

use super::grid::Grid;
use super::moving::{MovingBoard, Quadratic};
use super::teams::Teams;
use crate::ground::{Ground, Obstacle};
use crate::model::Vector;
use crate::model::board::Board;
use crate::model::separation::separation_board_board;
use crate::solve::{Chain, Positions, Solver};

/// Stands for all partners of a bench.
pub(super) const ALL: u32 = u32::MAX;

/// Pairs in the list: of a bench, and by handle of all. The others of a bench share one entry.
const MOST_LISTED: usize = 32;
const MOST_BY_HANDLE: usize = 4;

/// The distance by which a caller's limit may grow within a window, in links.
const GROWTH: f64 = 0.25;

/// The margin of bounds for rounding, as a share of the coordinates.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The boards, and what is known of their frames.
#[derive(Debug, Clone)]
pub(super) struct Stage {
    pub teams: Teams,
    pub ground: Ground,
    /// The least assumed error of a handle, in metres.
    pub least_error: f64,
}

/// Scratch memory for the window that was opened last, whose lists are being made.
#[derive(Debug)]
pub(super) struct Workspace {
    chain: Chain,
    grid: Grid,
    /// By bench: its board throughout the window, and in the middle; `None` for a last handle.
    boards: Vec<Option<(MovingBoard, Board)>>,
    /// The greatest travel of a board's points from their places in the middle, and the greatest radius of a board, in
    /// metres.
    most_travel: f64,
    most_radius: f64,
}

impl Workspace {
    pub(super) fn new(handles: usize) -> Self {
        let (chain, grid, boards) = (Chain::new(handles), Grid::new(handles), vec![None; handles]);
        Self { chain, grid, boards, most_travel: 0.0, most_radius: 0.0 }
    }
}

/// A window.
#[derive(Debug)]
pub(super) struct Window {
    /// Its begin and end, in seconds.
    begin: f64,
    end: f64,
    /// By axis, power of the time from -1 to 1, and handle: the coefficient, in metres.
    places: [[Vec<f64>; 3]; 2],
    /// By handle: the greatest distance from its polynomial, in metres.
    errors: Vec<f64>,
    /// The numbers up to which benches are listed.
    listed: usize,
    /// Boards that are farther apart throughout the window need not be listed, in metres.
    pub limit: f64,
    /// Obstacles that are farther away throughout the window need not be listed, in metres.
    obstacle_limit: f64,
    /// A lower bound of the distance of each pair. Of a pair with [`ALL`], the bound is of all unlisted partners.
    pub pairs: Vec<(u32, u32)>,
    pub pair_bounds: Vec<f32>,
    /// A lower bound of the clearance of all obstacles, by bench.
    pub benches: Vec<u32>,
    pub bench_bounds: Vec<f32>,
}

impl Window {
    /// Creates a closed window and reserves its memory.
    pub(super) fn new(stage: &Stage) -> Self {
        let handles = stage.teams.handles;
        let numbers = || vec![0.0; handles];
        let powers = || std::array::from_fn(|_| numbers());
        let most_pairs = MOST_BY_HANDLE * handles;
        let most_benches = if stage.ground.is_empty() { 0 } else { handles };
        Self {
            begin: f64::INFINITY,
            end: f64::NEG_INFINITY,
            places: [powers(), powers()],
            errors: numbers(),
            listed: handles,
            limit: f64::NEG_INFINITY,
            obstacle_limit: f64::NEG_INFINITY,
            pairs: Vec::with_capacity(most_pairs),
            pair_bounds: Vec::with_capacity(most_pairs),
            benches: Vec::with_capacity(most_benches),
            bench_bounds: Vec::with_capacity(most_benches),
        }
    }

    /// Closes the window: it holds no frame, although it is said to begin at a time.
    pub(super) fn close_at(&mut self, begin: f64) {
        (self.begin, self.end) = (begin, f64::NEG_INFINITY);
        self.listed = self.errors.len();
    }

    /// Closes the window.
    pub(super) fn close(&mut self) {
        self.close_at(f64::INFINITY);
    }

    pub(super) fn begin(&self) -> f64 {
        self.begin
    }

    pub(super) fn end(&self) -> f64 {
        self.end
    }

    /// Returns true if the handles of a frame are where the window assumes them.
    pub(super) fn holds(&self, chain: Positions, time: f64) -> bool {
        if !(self.begin <= time && time <= self.end) {
            return false;
        }
        let length = self.end - self.begin;
        let t = if length > 0.0 { (2.0 * time - self.begin - self.end) / length } else { 0.0 };
        let [[x0, x1, x2], [y0, y1, y2]] = &self.places;
        let count = self.errors.len();
        let [x0, x1, x2, y0, y1, y2] = [x0, x1, x2, y0, y1, y2].map(|numbers| &numbers[..count]);
        let (x, y) = (&chain.x[..count], &chain.y[..count]);
        let mut holds = 1u64;
        for k in 0..count {
            let (dx, dy) = (x[k] - (x0[k] + t * (x1[k] + t * x2[k])), y[k] - (y0[k] + t * (y1[k] + t * y2[k])));
            // Zero for NaN too.
            holds &= u64::from(dx * dx + dy * dy <= self.errors[k] * self.errors[k]);
        }
        holds == 1
    }

    /// Opens the window for the frame of one moment.
    pub(super) fn open_at(&mut self, chain: Positions, time: f64, stage: &Stage, work: &mut Workspace) {
        let [[x, x1, x2], [y, y1, y2]] = &mut self.places;
        x.copy_from_slice(chain.x);
        y.copy_from_slice(chain.y);
        [x1, x2, y1, y2].into_iter().for_each(|numbers| numbers.fill(0.0));
        self.errors.fill(0.0);
        self.move_boards(stage, work);
        (self.begin, self.end) = (time, time);
    }

    /// Opens the window from one time to another. Returns false, and leaves it closed, where the solver has no
    /// solution, and next to a singular place.
    pub(super) fn open(
        &mut self,
        (begin, end): (f64, f64),
        stage: &Stage,
        solver: &mut dyn Solver,
        work: &mut Workspace,
    ) -> bool {
        self.close();
        let scratch = &mut work.chain;
        let at = |t: f64| 0.5 * ((1.0 - t) * begin + (1.0 + t) * end);
        // The places at -1, 0 and 1 are kept where the coefficients of these powers will be.
        for (t, power) in [(-1.0, 1), (0.0, 0), (1.0, 2)] {
            if solver.solve_ahead(at(t), &mut scratch.all_mut()).is_err() {
                return false;
            }
            self.places[0][power].copy_from_slice(&scratch.x);
            self.places[1][power].copy_from_slice(&scratch.y);
        }
        for [middle, slope, square] in &mut self.places {
            for ((middle, slope), square) in middle.iter().zip(slope).zip(square) {
                let (before, after) = (*slope, *square);
                (*slope, *square) = (0.5 * (after - before), 0.5 * (after + before) - middle);
            }
        }
        self.errors.fill(0.0);
        for t in [-0.5, 0.5] {
            if solver.solve_ahead(at(t), &mut scratch.all_mut()).is_err() {
                return false;
            }
            for handle in 0..self.errors.len() {
                let [x, y] = [0, 1].map(|axis| {
                    let [middle, slope, square] = &self.places[axis];
                    middle[handle] + t * (slope[handle] + t * square[handle])
                });
                let (dx, dy) = (scratch.x[handle] - x, scratch.y[handle] - y);
                self.errors[handle] = self.errors[handle].max((dx * dx + dy * dy).sqrt());
            }
        }
        self.errors.iter_mut().for_each(|error| *error = 2.0 * *error + stage.least_error);
        self.move_boards(stage, work);
        // Next to a singular place the bounds are too weak to help.
        let helps = work.most_travel <= stage.teams.longest_link;
        if helps {
            (self.begin, self.end) = (begin, end);
        }
        helps
    }

    /// Fills the boards of the workspace.
    fn move_boards(&self, stage: &Stage, work: &mut Workspace) {
        let [x, y] = &self.places;
        let handle = |handle: usize| {
            let term = |power: usize| Vector::new(x[power][handle], y[power][handle]);
            Quadratic { terms: [term(0), term(1), term(2)], error: self.errors[handle] }
        };
        (work.most_travel, work.most_radius) = (0.0, 0.0);
        for bench in stage.teams.benches() {
            let (hole_inset, width) = stage.teams.inset_and_width(bench);
            let board = MovingBoard::new(&[handle(bench), handle(bench + 1)], hole_inset, width);
            work.most_travel = work.most_travel.max(board.travel);
            work.most_radius = work.most_radius.max(board.radius());
            work.boards[bench] = Some((board, board.middle()));
        }
    }

    /// Begins the lists. Only pairs nearer than `limit` metres, or not much farther, will be sought; `likely` is a pair
    /// that is probably near.
    pub(super) fn begin_lists(
        &mut self,
        stage: &Stage,
        work: &mut Workspace,
        limit: f64,
        likely: Option<(usize, usize)>,
    ) {
        self.listed = 0;
        self.pairs.clear();
        self.pair_bounds.clear();
        self.benches.clear();
        self.bench_bounds.clear();
        self.obstacle_limit = f64::INFINITY;
        self.limit = limit + GROWTH * stage.teams.longest_link;
        for (a, b) in likely.into_iter().chain(stage.teams.some_pair()) {
            if let [Some((a, a_at)), Some((b, b_at))] = [&work.boards[a], &work.boards[b]] {
                let most = a.greatest_distance(a_at, b, b_at);
                self.limit = self.limit.min(most + margin(stage, a_at, most));
            }
        }
        let side = 2.0 * (work.most_radius + work.most_travel) + self.limit.max(0.0);
        work.grid.clear(if side.is_finite() { 1.01 * side } else { 1.0 });
        for (bench, board) in work.boards.iter().enumerate() {
            board.iter().for_each(|(_, at)| work.grid.add(bench, at.centre.x, at.centre.y));
        }
    }

    /// Lists the benches up to a number, exclusive.
    pub(super) fn list_up_to(&mut self, number: usize, stage: &Stage, work: &Workspace) {
        while self.listed < number.min(stage.teams.handles) {
            let bench = self.listed;
            self.listed += 1;
            if let Some((board, at)) = &work.boards[bench] {
                self.list_partners(bench, board, at, stage, work);
                if !stage.ground.is_empty() {
                    self.list_obstacles(bench, board, at, stage);
                }
            }
        }
    }

    /// Lists the partners of a bench that can be the nearest.
    fn list_partners(&mut self, a: usize, board: &MovingBoard, at: &Board, stage: &Stage, work: &Workspace) {
        let radii = board.radius() + work.most_radius;
        let reach = radii + self.limit.max(0.0) + board.travel + work.most_travel;
        // Each bench behind, and this one, has room for one entry.
        let handles = stage.teams.handles;
        let most = (MOST_BY_HANDLE * handles - (handles - a)).min(self.pairs.len() + MOST_LISTED);
        let mut unlisted = f64::INFINITY;
        if reach.is_finite() {
            let margin = margin(stage, at, reach);
            work.grid.visit_near((at.centre.x, at.centre.y), reach, stage.teams.first_partner(a), |b| {
                let Some((other, other_at)) = &work.boards[b] else { return };
                if !board.may_be_within(radii + self.limit.max(0.0) + margin, other) {
                    return;
                }
                let separation = separation_board_board(at, other_at);
                let rough = separation - board.relative_travel(other);
                if rough - margin > self.limit {
                    return;
                }
                let bound = rough.max(board.least_distance(at, other, other_at)) - margin;
                if bound > self.limit {
                    return;
                }
                if separation < self.limit {
                    self.limit = self.limit.min(board.greatest_distance(at, other, other_at) + margin);
                }
                if self.pairs.len() < most {
                    self.pairs.push((a as u32, b as u32));
                    self.pair_bounds.push((bound as f32).next_down());
                } else {
                    unlisted = unlisted.min(bound);
                }
            });
        } else {
            unlisted = f64::NEG_INFINITY;
        }
        if unlisted < f64::INFINITY {
            self.pairs.push((a as u32, ALL));
            self.pair_bounds.push((unlisted as f32).next_down());
        }
    }

    /// Lists a bench if an obstacle can be nearer than any two boards, and than other obstacles.
    fn list_obstacles(&mut self, bench: usize, board: &MovingBoard, at: &Board, stage: &Stage) {
        let travel = board.travel;
        let margin = margin(stage, at, 0.0);
        let mut bound = f64::INFINITY;
        for obstacle in stage.ground.obstacles() {
            if obstacle.coarse_clearance(&at.grown(travel)) - margin > self.limit.min(self.obstacle_limit) {
                continue;
            }
            let (least, most) = obstacle_bounds(obstacle, at, travel);
            bound = bound.min(least - margin);
            self.obstacle_limit = self.obstacle_limit.min(most + margin);
        }
        // Also true for NaN.
        let is_far = bound > self.limit.min(self.obstacle_limit);
        if !is_far {
            self.benches.push(bench as u32);
            self.bench_bounds.push((bound as f32).next_down());
        }
    }
}

/// Returns the margin for rounding of the distance of a board to things within `reach` metres.
fn margin(stage: &Stage, board: &Board, reach: f64) -> f64 {
    2.0 * stage.teams.reach * ROUNDING * (board.centre.coords.norm() + stage.teams.radius + reach.abs())
}

/// Returns a lower and an upper bound of the clearance of a board whose points move by at most `travel` metres.
fn obstacle_bounds(obstacle: &Obstacle, board: &Board, travel: f64) -> (f64, f64) {
    let clearance = obstacle.clearance(board);
    let is_lipschitz = clearance + obstacle.keep_out >= travel || obstacle.shape.is_convex();
    if is_lipschitz {
        return (clearance - travel, clearance + travel);
    }
    // The depth of an overlap can jump where the board turns. A translation that frees the grown board frees all boards
    // within it. A board that does not overlap is still no farther than by its travel.
    let distance = (clearance + obstacle.keep_out).max(0.0);
    (obstacle.clearance(&board.grown(travel)), distance + travel - obstacle.keep_out)
}
