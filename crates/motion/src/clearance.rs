//! The nearest two boards of a frame, and the nearest board and obstacle: by all pairs as the reference, and by the live
//! method that tests few of them.
//!
//! In: a [`Chain`], its [`Team`]s and the obstacles. Out: the nearest pair. Pairs that share a handle never count. Both
//! methods evaluate a pair with the same function on the same numbers, so they agree to the last bit.

mod grid;
mod moving;
mod teams;
#[cfg(test)]
mod tests;
mod window;

use crate::ground::Ground;
use crate::model::Point;
use crate::model::board::Board;
use crate::model::elementary::hypot;
use crate::model::separation::{closest_points_board_board, separation_board_board, signed_distance_board_board};
use crate::model::team::Team;
use crate::solve::{Chain, Positions, Solver};
pub use teams::Pairs;
use teams::Teams;
use window::{Stage, Window, Workspace};

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
    Board::from_handles(handle(bench), handle(bench + 1), team.hole_inset, team.board_width(bench))
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

/// Returns the nearest two boards of different dragons by testing all pairs. The dragons stand one behind the other in
/// the chain.
pub fn nearest_between_all_pairs(chain: &Chain, teams: &[Team]) -> Option<PairClearance> {
    let teams = Teams::new(teams, Pairs::Between);
    let mut nearest = Nearest::NONE;
    for a in teams.benches() {
        let board_a = teams.board(chain.into(), a);
        for b in teams.partners(a) {
            let board_b = teams.board(chain.into(), b);
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
    /// Windows that were opened and listed within one frame, since no window had been prepared for it.
    pub searches: u64,
}

/// The clearance of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameClearance {
    /// The nearest two boards, of equal ones the lowest (a, b); `None` without a pair that is nearer than the caller's
    /// limit.
    pub boards: Option<PairClearance>,
    /// A board and an obstacle that are nearer than any two boards, and than the caller's limit. `bench_b` is the number
    /// of handles plus the obstacle's place on the ground, `point_b` a point of the obstacle.
    pub obstacle: Option<PairClearance>,
}

/// The frames of a motion. No result depends on these numbers, only the cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Precision {
    /// The error of a handle, in metres, that is not the same from frame to frame.
    pub handle_error: f64,
    /// The time in which the fastest head passes its shortest link, in seconds.
    pub seconds_per_link: f64,
}

/// Finds the nearest boards of each frame: the same result as by testing all pairs, from few tests.
///
/// The time is divided into windows, and each window has a list of the pairs that can be the nearest at any moment of it
/// (see the file `window`). A frame tests the pairs of its list that are not excluded by their bounds, most often one or
/// two. The next window is prepared ahead, some benches a frame. After a jump of the time a window is made within one
/// frame. All memory is reserved by the constructor.
#[derive(Debug)]
pub struct ClearanceMonitor {
    stage: Stage,
    live: Window,
    next: Window,
    work: Workspace,
    /// The length of a window, in seconds.
    length: f64,
    /// The time of the previous frame, in seconds.
    previous: f64,
    last_pair: Option<(usize, usize)>,
    counters: ClearanceCounters,
}

/// The length of a window, in the time in which the fastest head passes its shortest link.
const WINDOW: f64 = 0.25;

/// The share of a window in which the next one is prepared.
const PREPARED_WITHIN: f64 = 0.75;

/// The part of a window's length that is tried next to a singular place.
const SHORT: f64 = 0.125;

/// Bounds that are compared together, so that vector instructions apply.
const BOUNDS_AT_ONCE: usize = 64;

/// The least assumed error of a handle, in links.
const LEAST_ERROR: f64 = 1e-5;

impl ClearanceMonitor {
    /// Creates a monitor for chains of these teams, one behind the other, on a ground in the coordinates of the chains.
    pub fn new(teams: &[Team], pairs: Pairs, ground: Ground, precision: Precision) -> Self {
        let teams = Teams::new(teams, pairs);
        let least_error = LEAST_ERROR * teams.longest_link + 4.0 * precision.handle_error;
        let stage = Stage { teams, ground, least_error };
        Self {
            live: Window::new(&stage),
            next: Window::new(&stage),
            work: Workspace::new(stage.teams.handles),
            stage,
            length: WINDOW * precision.seconds_per_link,
            previous: f64::INFINITY,
            last_pair: None,
            counters: ClearanceCounters::default(),
        }
    }

    /// Returns the work done so far.
    pub fn counters(&self) -> ClearanceCounters {
        self.counters
    }

    /// Returns the nearest boards of a chain, and the nearest board and obstacle, if they are nearer than `limit`
    /// metres. `solver` has made the chain, for `time`.
    pub fn nearest<'a>(
        &mut self,
        chain: impl Into<Positions<'a>>,
        time: f64,
        limit: f64,
        solver: &mut dyn Solver,
    ) -> FrameClearance {
        self.nearest_of(chain.into(), time, limit, solver)
    }

    // A function of one type is compiled here, where the functions that it calls are inlined.
    fn nearest_of(&mut self, chain: Positions, time: f64, limit: f64, solver: &mut dyn Solver) -> FrameClearance {
        self.counters.frames += 1;
        if self.live.holds(chain, time) {
            self.prepare_next(time, limit, solver);
        } else {
            self.enter(chain, time, limit, solver);
        }
        self.previous = time;
        let mut nearest = self.nearest_boards(chain, limit);
        if nearest.value > self.live.limit {
            // The caller's limit has grown.
            self.enter_at(chain, time, limit);
            nearest = self.nearest_boards(chain, limit);
        }
        let boards = nearest.finish();
        self.last_pair = boards.map(|found| (found.bench_a, found.bench_b)).or(self.last_pair);
        FrameClearance { boards, obstacle: self.nearest_obstacle(chain, nearest.value) }
    }

    /// Makes a window for a frame.
    fn enter(&mut self, chain: Positions, time: f64, limit: f64, solver: &mut dyn Solver) {
        if self.next.holds(chain, time) {
            self.next.list_up_to(self.stage.teams.handles, &self.stage, &self.work);
            std::mem::swap(&mut self.live, &mut self.next);
            self.next.close();
            return;
        }
        // A window of a single frame is cheaper if the next frame will not be in it.
        let serves_others = (time - self.previous).abs() <= 0.5 * self.length;
        for length in [1.0, SHORT].map(|part| part * self.length).into_iter().filter(|_| serves_others) {
            let is_open = self.live.open((time, time + length), &self.stage, solver, &mut self.work);
            if is_open && self.live.holds(chain, time) {
                return self.list_all(limit);
            }
        }
        self.enter_at(chain, time, limit);
    }

    /// Makes a window for a single frame.
    fn enter_at(&mut self, chain: Positions, time: f64, limit: f64) {
        self.live.open_at(chain, time, &self.stage, &mut self.work);
        self.list_all(limit);
    }

    fn list_all(&mut self, limit: f64) {
        self.counters.searches += 1;
        self.live.begin_lists(&self.stage, &mut self.work, limit, self.last_pair);
        self.live.list_up_to(self.stage.teams.handles, &self.stage, &self.work);
        self.next.close();
    }

    /// Prepares the next window as far as it should be at a time of the present one.
    fn prepare_next(&mut self, time: f64, limit: f64, solver: &mut dyn Solver) {
        let (begin, end) = (self.live.begin(), self.live.end());
        let share = (time - begin) / (PREPARED_WITHIN * (end - begin));
        // Also false for a window without length.
        if share > 0.0 {
            if self.next.begin() != end {
                if !self.next.open((end, end + self.length), &self.stage, solver, &mut self.work) {
                    return self.next.close_at(end);
                }
                self.next.begin_lists(&self.stage, &mut self.work, limit, self.last_pair);
            }
            let number = share * self.stage.teams.handles as f64;
            self.next.list_up_to(number as usize, &self.stage, &self.work);
        }
    }

    /// Returns the nearest two boards of the list that are nearer than a limit.
    fn nearest_boards(&mut self, chain: Positions, limit: f64) -> Nearest {
        let Self { stage, live, counters, last_pair, .. } = self;
        let mut nearest = Nearest { value: limit, ..Nearest::NONE };
        let mut test = |nearest: &mut Nearest, (a, b): (usize, usize)| {
            counters.pairs += 1;
            let [board_a, board_b] = [a, b].map(|bench| stage.teams.board(chain, bench));
            if separation_board_board(&board_a, &board_b) <= nearest.value {
                nearest.consider(signed_distance_board_board(&board_a, &board_b), (a, b), &board_a, &board_b);
            }
        };
        if let Some(pair) = *last_pair {
            test(&mut nearest, pair);
        }
        for (bounds, pairs) in live.pair_bounds.chunks(BOUNDS_AT_ONCE).zip(live.pairs.chunks(BOUNDS_AT_ONCE)) {
            if !any_within(bounds, (nearest.value as f32).next_up()) {
                continue;
            }
            for (bound, (a, b)) in bounds.iter().zip(pairs) {
                let (a, b) = (*a as usize, *b);
                if f64::from(*bound) > nearest.value {
                    continue;
                }
                if b == window::ALL {
                    stage.teams.partners(a).for_each(|b| test(&mut nearest, (a, b)));
                } else if Some((a, b as usize)) != *last_pair {
                    test(&mut nearest, (a, b as usize));
                }
            }
        }
        nearest
    }

    /// Returns the board and the obstacle of the list that are nearer than a limit.
    fn nearest_obstacle(&self, chain: Positions, limit: f64) -> Option<PairClearance> {
        let Self { stage, live, .. } = self;
        let (mut value, mut found) = (limit, None);
        for (bound, bench) in live.bench_bounds.iter().zip(&live.benches) {
            if f64::from(*bound) >= value {
                continue;
            }
            let bench = *bench as usize;
            let board = stage.teams.board(chain, bench);
            for (number, obstacle) in stage.ground.obstacles().iter().enumerate() {
                if obstacle.coarse_clearance(&board) < value {
                    let clearance = obstacle.clearance_below(&board, value);
                    if clearance < value {
                        (value, found) = (clearance, Some((bench, number, board)));
                    }
                }
            }
        }
        let (bench_a, number, board) = found?;
        let (point_a, point_b) = stage.ground.obstacles()[number].shape.nearest_points(&board);
        Some(PairClearance { value, bench_a, bench_b: stage.teams.handles + number, point_a, point_b })
    }
}

/// Returns true if any of these bounds is within a limit.
fn any_within(bounds: &[f32], limit: f32) -> bool {
    bounds.iter().fold(0, |near, bound| near | u32::from(*bound <= limit)) != 0
}

fn circle_radius(team: &Team, bench: usize) -> f64 {
    hypot(0.5 * team.link(bench) + team.hole_inset, 0.5 * team.board_width(bench))
}

/// Returns the greatest displacement of a board's points per metre of displacement of its handles.
fn corner_reach(team: &Team, bench: usize) -> f64 {
    Board::displacement_factor(team.link(bench), team.hole_inset, team.board_width(bench))
}
