//! The nearest board and the nearest obstacle of each bench.
//!
//! In: the chain at many times. Out: of each bench the least distances, first of the samples, then searched for between
//! them. Where `check` has found a least clearance, that one is taken, so that a sheet never says more.

use std::collections::HashMap;

use bench_dragon_motion::clearance::board;
use bench_dragon_motion::ensemble::Ensemble;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::separation::{circle_bound_board_board, signed_distance_board_board};
use bench_dragon_motion::solve::{Chain, Positions, Solver};
use bench_dragon_show::solve_at_or_just_before;

use super::Searched;

/// The distance within which another board is near, in metres.
const NEAR: f64 = 1.0;
/// The golden sections of a search between two samples: they narrow it to a thousandth.
const SECTIONS: usize = 15;
const GOLDEN: f64 = 0.618_033_988_749_895;

/// A side of a bench, in the direction in which it goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Left of it.
    Left,
    /// Right of it.
    Right,
    /// Ahead of it.
    Ahead,
    /// Behind it.
    Behind,
}

/// The least distance of a bench from another bench or an obstacle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Near {
    /// The number of the other bench in the show, or of the obstacle on its ground.
    pub other: usize,
    /// The distance in metres; of an obstacle it is not less its keep-out.
    pub distance: f64,
    /// The simulated seconds at which it is least.
    pub time: f64,
    /// The side on which the other bench is.
    pub side: Side,
    /// The seconds from which, and until which, the other bench is within a metre without a break; of an obstacle the
    /// time alone.
    pub span: (f64, f64),
}

/// The least distances so far.
pub(super) struct Nearest<'a> {
    ensemble: &'a Ensemble,
    /// The benches by their numbers in the show, each with its dragon.
    benches: Vec<(usize, usize)>,
    boards: Vec<Option<Near>>,
    obstacles: Vec<Option<Near>>,
    /// The side of the squares in which boards are sought, in metres.
    square: f64,
}

impl<'a> Nearest<'a> {
    pub fn new(ensemble: &'a Ensemble) -> Self {
        let of = |k: usize| {
            let handles = ensemble.handles_of(k);
            (handles.start..handles.end - 1).map(move |bench| (bench, k))
        };
        let benches: Vec<(usize, usize)> = (0..ensemble.dragons().len()).flat_map(of).collect();
        let longest = |k: usize| {
            let team = ensemble.dragons()[k].motion.team();
            team.longest_link() + 2.0 * team.hole_inset + team.widest()
        };
        let square = NEAR + (0..ensemble.dragons().len()).map(longest).fold(0.0, f64::max);
        let none = vec![None; ensemble.handles()];
        Self { ensemble, benches, boards: none.clone(), obstacles: none, square }
    }

    /// Returns the board of a bench by its number in the show, given its dragon.
    fn board(&self, chain: &Chain, bench: usize, dragon: usize) -> Board {
        let first = self.ensemble.handles_of(dragon).start;
        let team = self.ensemble.dragons()[dragon].motion.team();
        // The team counts its benches from its own head.
        board(Positions { x: &chain.x[first..], y: &chain.y[first..] }, team, bench - first)
    }

    /// Returns the boards of all benches.
    fn boards_of(&self, chain: &Chain) -> Vec<Board> {
        self.benches.iter().map(|(bench, dragon)| self.board(chain, *bench, *dragon)).collect()
    }

    /// Adds the chain at a time.
    pub fn include(&mut self, chain: &Chain, time: f64) {
        let boards = self.boards_of(chain);
        let square = self.square;
        let cell = |board: &Board| [board.centre.x, board.centre.y].map(|metres| (metres / square).floor() as i64);
        let mut squares: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
        for (index, one) in boards.iter().enumerate() {
            let [column, row] = cell(one);
            for square in (-1..=1).flat_map(|x| (-1..=1).map(move |y| [column + x, row + y])) {
                for other in squares.get(&square).into_iter().flatten() {
                    self.compare((*other, index), &boards, time);
                }
            }
            squares.entry([column, row]).or_default().push(index);
        }
        for (index, board) in boards.iter().enumerate() {
            let bench = self.benches[index].0;
            for (number, obstacle) in self.ensemble.ground().obstacles().iter().enumerate() {
                let least = self.obstacles[bench].map_or(f64::INFINITY, |near| self.beyond(&near));
                if obstacle.coarse_clearance(board) < least {
                    let clearance = obstacle.clearance_below(board, least);
                    if clearance < least {
                        let distance = clearance + obstacle.keep_out;
                        let (side, span) = (Side::Ahead, (time, time));
                        self.obstacles[bench] = Some(Near { other: number, distance, time, side, span });
                    }
                }
            }
        }
    }

    /// Returns an obstacle's distance less its keep-out.
    fn beyond(&self, near: &Near) -> f64 {
        near.distance - self.ensemble.ground().obstacles()[near.other].keep_out
    }

    fn compare(&mut self, (one, other): (usize, usize), boards: &[Board], time: f64) {
        let [(a, of_a), (b, of_b)] = [self.benches[one], self.benches[other]];
        if of_a == of_b && a.abs_diff(b) < 2 {
            return;
        }
        let least = [a, b].map(|bench| self.boards[bench].map_or(NEAR, |near| near.distance));
        if circle_bound_board_board(&boards[one], &boards[other]) >= least[0].max(least[1]) {
            return;
        }
        let distance = signed_distance_board_board(&boards[one], &boards[other]);
        for (k, (own, far)) in [(one, other), (other, one)].into_iter().enumerate() {
            if distance < least[k] {
                let side = side(&boards[own], &boards[far]);
                let (other, span) = (self.benches[far].0, (time, time));
                self.boards[self.benches[own].0] = Some(Near { other, distance, time, side, span });
            }
        }
    }

    /// Searches for the least distances between the samples, which are `step` seconds apart until `end`. Returns the
    /// nearest board and the nearest obstacle of each bench by its number in the show.
    pub fn refined(
        mut self,
        step: f64,
        end: f64,
        solver: &mut dyn Solver,
        searched: &Searched<'_>,
        progress: Progress<'_>,
    ) -> Vec<(Option<Near>, Option<Near>)> {
        let mut chain = Chain::new(self.ensemble.handles());
        let mut known: HashMap<(usize, usize, u64), (f64, f64)> = HashMap::new();
        for (index, (bench, dragon)) in self.benches.clone().into_iter().enumerate() {
            if progress(0.5 * index as f64 / self.benches.len() as f64).is_break() {
                break;
            }
            if let Some(near) = self.boards[bench] {
                let key = (bench.min(near.other), bench.max(near.other), near.time.to_bits());
                let other = self.ensemble.owner(near.other).map_or(dragon, |(dragon, _)| dragon);
                let around = ((near.time - step).max(0.0), (near.time + step).min(end));
                let (distance, time) = *known.entry(key).or_insert_with(|| {
                    least_within(around, (near.distance, near.time), |time| {
                        solver.solve(time, &mut chain).ok()?;
                        let (one, two) = (self.board(&chain, bench, dragon), self.board(&chain, near.other, other));
                        Some(signed_distance_board_board(&one, &two))
                    })
                });
                self.boards[bench] = Some(Near { distance, time, ..near });
            }
            if let Some(near) = self.obstacles[bench] {
                let around = ((near.time - step).max(0.0), (near.time + step).min(end));
                let obstacle = &self.ensemble.ground().obstacles()[near.other];
                let (distance, time) = least_within(around, (near.distance, near.time), |time| {
                    solver.solve(time, &mut chain).ok()?;
                    Some(obstacle.shape.signed_distance(&self.board(&chain, bench, dragon)))
                });
                self.obstacles[bench] = Some(Near { distance, time, ..near });
            }
        }
        self.take(searched, end, solver, &mut chain);
        self.find_spans(step, end, solver, &mut chain, &mut |share| progress(0.5 + 0.5 * share));
        self.boards.into_iter().zip(self.obstacles).collect()
    }

    /// Takes the least clearances of `check`, where they are less than what was found here.
    fn take(&mut self, searched: &Searched<'_>, end: f64, solver: &mut dyn Solver, chain: &mut Chain) {
        if let Some(found) = searched.boards.filter(|found| found.time <= end) {
            let benches = [found.least.bench_a as usize, found.least.bench_b as usize];
            if solver.solve(found.time, chain).is_ok() {
                let dragons = benches.map(|bench| self.ensemble.owner(bench).map_or(0, |(dragon, _)| dragon));
                let boards = [0, 1].map(|k| self.board(chain, benches[k], dragons[k]));
                for k in 0..2 {
                    let is_less = self.boards[benches[k]].is_none_or(|near| found.least.value <= near.distance);
                    if is_less {
                        let side = side(&boards[k], &boards[1 - k]);
                        let (other, distance, time) = (benches[1 - k], found.least.value, found.time);
                        self.boards[benches[k]] = Some(Near { other, distance, time, side, span: (time, time) });
                    }
                }
            }
        }
        for found in searched.obstacles.iter().filter(|found| found.time <= end) {
            let bench = found.least.bench as usize;
            if self.obstacles[bench].is_none_or(|near| found.least.value <= self.beyond(&near)) {
                let distance = found.least.value + self.ensemble.ground().obstacles()[found.obstacle].keep_out;
                let (time, side) = (found.time, Side::Ahead);
                let near = Near { other: found.obstacle, distance, time, side, span: (time, time) };
                self.obstacles[bench] = Some(near);
            }
        }
    }

    /// Finds of each bench the span about its least distance in which the other bench is near, true to a sample.
    fn find_spans(&mut self, step: f64, end: f64, solver: &mut dyn Solver, chain: &mut Chain, progress: Progress<'_>) {
        let mut began: Vec<Option<f64>> = vec![None; self.benches.len()];
        let samples = (end / step).ceil() as usize;
        for sample in 0..=samples {
            let time = (sample as f64 * step).min(end);
            let share = sample as f64 / (samples + 1) as f64;
            if progress(share).is_break() || solve_at_or_just_before(solver, time, chain).is_err() {
                return;
            }
            let boards = self.boards_of(chain);
            for (index, (bench, _)) in self.benches.iter().enumerate() {
                let Some(near) = &mut self.boards[*bench] else { continue };
                // A dragon has one handle more than benches.
                let dragon = self.ensemble.owner(near.other).map_or(0, |(dragon, _)| dragon);
                let (own, other) = (&boards[index], &boards[near.other - dragon]);
                let is_near =
                    circle_bound_board_board(own, other) < NEAR && signed_distance_board_board(own, other) < NEAR;
                began[index] = is_near.then(|| began[index].unwrap_or(time));
                // The last span that has begun by the time of the least distance.
                if let Some(from) = began[index].filter(|from| *from <= near.time + step) {
                    near.span = (from.min(near.time), time.max(near.time));
                }
            }
        }
    }
}

/// Returns the side of a board on which another is.
fn side(own: &Board, other: &Board) -> Side {
    let away = other.centre - own.centre;
    let (along, left) = (away.dot(&own.axis), own.axis.perp(&away));
    match (along.abs() - own.half_length > left.abs() - own.half_width, along > 0.0, left > 0.0) {
        (true, true, _) => Side::Ahead,
        (true, false, _) => Side::Behind,
        (false, _, true) => Side::Left,
        (false, _, false) => Side::Right,
    }
}

/// Returns the least value and its time, by golden sections of a stretch that holds one minimum; at most the value that
/// is known.
fn least_within(
    (mut from, mut to): (f64, f64),
    known: (f64, f64),
    mut value: impl FnMut(f64) -> Option<f64>,
) -> (f64, f64) {
    let mut value = |time: f64| value(time).map_or((f64::INFINITY, time), |value| (value, time));
    let (mut low, mut high) = (value(to - GOLDEN * (to - from)), value(from + GOLDEN * (to - from)));
    for _ in 0..SECTIONS {
        if low.0 < high.0 {
            (to, high) = (high.1, low);
            low = value(to - GOLDEN * (to - from));
        } else {
            (from, low) = (low.1, high);
            high = value(from + GOLDEN * (to - from));
        }
    }
    [low, high].into_iter().fold(known, |least, found| if found.0 < least.0 { found } else { least })
}
