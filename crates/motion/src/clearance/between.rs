//! The nearest two boards of different dragons of a frame.
//!
//! In: the chain of all dragons on the stage, and the clearance of the nearest two boards found so far. Out: a nearer
//! pair, if there is one.
//!
//! Where all dragons have tables of their frames, a table lists the pairs that can be the nearest at each time of the
//! show ([`super::between_table`]). Otherwise the pairs are found from frame to frame.
//!
//! The broad phase is the same as in [`super::search`]. Every bench carries from frame to frame a lower bound of its
//! distance to the boards of later dragons, and each frame lowers all bounds by the greatest approach of two boards. A
//! bench is tested again only when its bound comes within the limit. For benches that are far from all later dragons,
//! the box about each dragon gives a wide bound. For the other benches a grid finds the boards nearby.
//!
//! Dragons that go side by side hardly approach each other, however fast they go. So a bench keeps a list of the boards
//! near it. Each entry has a distance and the places of the board's handles at that time, as seen from the bench: the
//! bench's front handle is then the origin and its link an axis. A point of a board is a linear function of the board's
//! two handles, so two boards have approached by no more than [`corner_reach`] times the movement of the handles as
//! seen from the bench. A board of the list is measured again only when this bound comes within the limit.

use super::between_table::{BetweenTable, TabledDragon};
use super::grid::Grid;
use super::{Nearest, PairClearance, board, circle_radius, corner_reach};
use crate::model::board::Board;
use crate::model::separation::{separation_board_board, signed_distance_board_board};
use crate::model::team::Team;
use crate::model::{Point, Vector};
use crate::solve::Chain;

/// The distance beyond the limit up to which boards are listed, in metres.
const SKIN: f64 = 1.0;

/// The most boards in the list of a bench.
const MOST_LISTED: usize = 12;

/// The error of a place in single precision, as a share of it; twice as much, for the sum of the places.
const SINGLE_ROUNDING: f64 = 2.0 * f32::EPSILON as f64;

/// The approach, in metres, after which all bounds are computed again, so that their rounding stays within its
/// allowance.
const MOST_MOVED: f64 = 100.0;

/// The margin for rounding: metres, and as a share of the coordinates.
const ROUNDING: (f64, f64) = (1e-9, 1e-12);

/// The board of no bench.
const NO_BOARD: Board =
    Board { centre: Point::new(0.0, 0.0), axis: Vector::new(1.0, 0.0), half_length: 0.0, half_width: 0.0 };

/// A dragon of the frame.
#[derive(Debug, Clone)]
struct Part {
    team: Team,
    first: usize,
    /// The box about its handles: left, right, low, high.
    bounds: [f64; 4],
}

impl Part {
    fn benches(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.team.benches
    }

    fn board(&self, chain: &Chain, bench: usize) -> Board {
        board(chain, &self.team, bench)
    }

    fn enclose(&mut self, chain: &Chain) {
        let handles = self.first..self.first + self.team.handles();
        let least = |numbers: &[f64]| numbers.iter().fold(f64::INFINITY, |a, b| if *b < a { *b } else { a });
        let most = |numbers: &[f64]| numbers.iter().fold(f64::NEG_INFINITY, |a, b| if *b > a { *b } else { a });
        let (x, y) = (&chain.x[handles.clone()], &chain.y[handles]);
        self.bounds = [least(x), most(x), least(y), most(y)];
    }

    /// Returns the metres from a place to the box; 0 inside.
    fn distance(&self, x: f64, y: f64) -> f64 {
        let [left, right, low, high] = self.bounds;
        let (dx, dy) = ((left - x).max(x - right).max(0.0), (low - y).max(y - high).max(0.0));
        (dx * dx + dy * dy).sqrt()
    }
}

/// A board near a bench.
#[derive(Debug, Clone, Copy, Default)]
struct Listed {
    bench: u32,
    /// A lower bound of the distance of the boards at the time of the places, in metres.
    distance: f32,
    /// The handles of the board as seen from the bench.
    places: [[f32; 2]; 2],
}

/// A bench from which others are seen.
#[derive(Debug, Clone, Copy)]
struct Seat {
    front: Vector,
    axis: Vector,
}

impl Seat {
    fn new(chain: &Chain, bench: usize) -> Self {
        let front = Vector::new(chain.x[bench], chain.y[bench]);
        let link = front - Vector::new(chain.x[bench + 1], chain.y[bench + 1]);
        Self { front, axis: link / link.norm() }
    }

    /// Returns the handles of a bench as seen from here, metres along and across.
    fn handles(&self, chain: &Chain, bench: usize) -> [[f64; 2]; 2] {
        [bench, bench + 1].map(|handle| {
            let from = Vector::new(chain.x[handle], chain.y[handle]) - self.front;
            [self.axis.dot(&from), self.axis.perp(&from)]
        })
    }
}

impl Listed {
    /// `reach` is the greatest approach of a point of a board per metre of its handles.
    fn new(chain: &Chain, seat: &Seat, bench: usize, distance: f64, reach: f64) -> Self {
        let places = seat.handles(chain, bench);
        let rounding = SINGLE_ROUNDING * places.iter().flatten().map(|metres| metres.abs()).sum::<f64>();
        let distance = (distance - (1.0 + reach) * rounding) as f32;
        let places = places.map(|place| place.map(|metres| metres as f32));
        Self { bench: bench as u32, distance: distance.next_down(), places }
    }

    /// Returns a lower bound of the distance now.
    fn bound(&self, chain: &Chain, seat: &Seat, reach: f64) -> f64 {
        let now = seat.handles(chain, self.bench as usize);
        let moved = |k: usize| {
            let [dx, dy] = [0, 1].map(|axis| now[k][axis] - f64::from(self.places[k][axis]));
            dx * dx + dy * dy
        };
        f64::from(self.distance) - reach * moved(0).max(moved(1)).sqrt()
    }
}

/// The moment of a frame.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// The time of the show, in seconds.
    pub time: f64,
    /// By dragon: the metres that its head has travelled.
    pub travelled: &'a [f64],
}

/// Finds the nearest two boards of different dragons. All memory is reserved by the constructor.
#[derive(Debug, Clone)]
pub struct BetweenMonitor {
    parts: Vec<Part>,
    /// The distance, in metres, by which a dragon's points may be outside the box about its handles, and the radius of
    /// the largest board.
    beyond: f64,
    /// The greatest approach of two boards per metre of displacement of their handles.
    reach: f64,
    /// The greatest approach of the points of a board while it is a seat: its link may be off its length, in metres.
    link_slack: f64,
    /// The handles of the previous frame.
    x: Vec<f64>,
    y: Vec<f64>,
    /// The greatest approach of two boards since the beginning, in metres.
    closed: f64,
    /// By bench: a bound plus the value of `closed` when the bound was made; infinite where there is no bench.
    sums: Vec<f64>,
    /// By bench: the same of the boards that are not in its list.
    unlisted: Vec<f64>,
    /// By bench: its list, and the number of boards in it.
    listed: Vec<[Listed; MOST_LISTED]>,
    counts: Vec<u8>,
    grid: Grid,
    /// By bench: its board in this frame, once the grid is filled, and the radius of the circle about it.
    boards: Vec<(Board, f64)>,
    last_pair: Option<(usize, usize)>,
    table: Option<BetweenTable>,
    tested: u64,
}

impl BetweenMonitor {
    /// Creates a monitor for chains of these teams, one behind the other. The error of every link must be at most
    /// `link_error` metres.
    pub fn new(teams: &[Team], link_error: f64) -> Self {
        let mut first = 0;
        let mut part = |team: &Team| {
            let part = Part { team: *team, first, bounds: [0.0; 4] };
            first += team.handles();
            part
        };
        let parts: Vec<Part> = teams.iter().map(&mut part).collect();
        let most =
            |of: fn(&Team, usize) -> f64| teams.iter().map(|team| of(team, 0).max(of(team, 1))).fold(0.0, f64::max);
        let shortest = teams.iter().map(Team::shortest_link).fold(f64::INFINITY, f64::min);
        let reach = 2.0 * most(corner_reach) * (1.0 + 2.0 * link_error / shortest);
        Self {
            beyond: most(circle_radius) + link_error,
            link_slack: reach * link_error,
            reach,
            x: vec![0.0; first],
            y: vec![0.0; first],
            closed: f64::INFINITY,
            sums: vec![f64::INFINITY; first],
            unlisted: vec![f64::NEG_INFINITY; first],
            listed: vec![[Listed::default(); MOST_LISTED]; first],
            counts: vec![0; first],
            grid: Grid::new(first),
            boards: vec![(NO_BOARD, 0.0); first],
            last_pair: None,
            table: None,
            tested: 0,
            parts,
        }
    }

    /// Returns the same monitor with a table of a show of these dragons from its start to `end` seconds. `travelled`
    /// has the metres that the head of a dragon has travelled at a time of the show.
    pub fn with_table(self, dragons: &[TabledDragon<'_>], end: f64, travelled: &dyn Fn(usize, f64) -> f64) -> Self {
        Self { table: BetweenTable::new(dragons, end, travelled), ..self }
    }

    /// Returns the pairs of boards tested so far.
    pub fn pairs_tested(&self) -> u64 {
        self.tested
    }

    /// Returns the nearest two boards of different dragons if they are nearer than `limit` metres.
    pub fn nearest(&mut self, chain: &Chain, limit: f64, moment: Moment<'_>) -> Option<PairClearance> {
        self.nearest_by_table(chain, limit, moment).unwrap_or_else(|| self.search(chain, limit))
    }

    /// Returns the same by the table; `None` if it has no list for this frame.
    fn nearest_by_table(&mut self, chain: &Chain, limit: f64, moment: Moment<'_>) -> Option<Option<PairClearance>> {
        let list = self.table.as_ref()?.list(&moment, (&chain.x, &chain.y))?;
        let mut nearest = Nearest { value: limit, ..Nearest::NONE };
        for entry in list {
            if f64::from(entry.bound) > nearest.value {
                return Some(nearest.finish());
            }
            let (a, b) = entry.pair?;
            test(&self.parts, &mut self.tested, chain, &mut nearest, (a as usize, b as usize));
        }
        None
    }

    /// Returns the same by a search that follows the previous one.
    pub(super) fn search(&mut self, chain: &Chain, limit: f64) -> Option<PairClearance> {
        self.follow(chain);
        let mut nearest = Nearest { value: limit, ..Nearest::NONE };
        if let Some((a, b)) = self.last_pair {
            test(&self.parts, &mut self.tested, chain, &mut nearest, (a, b));
        }
        let mut filled = false;
        for k in 0..self.parts.len().saturating_sub(1) {
            let benches = self.parts[k].benches();
            let within = |sum: f64, nearest: &Nearest, closed: f64| sum <= nearest.value + closed + 1e-8;
            for start in benches.clone().step_by(64) {
                let stop = benches.end.min(start + 64);
                let least = self.sums[start..stop].iter().fold(f64::INFINITY, |a, b| if *b < a { *b } else { a });
                if !within(least, &nearest, self.closed) {
                    continue;
                }
                for a in start..stop {
                    if within(self.sums[a], &nearest, self.closed) {
                        // Lists that would soon be renewed are renewed together, since the grid is filled once for all.
                        let early = if filled { 0.5 * SKIN } else { 1e-8 };
                        if self.unlisted[a] <= nearest.value + self.closed + early {
                            if !filled {
                                self.enclose_and_fill(chain, nearest.value);
                                filled = true;
                            }
                            self.unlisted[a] = self.list_later(chain, &mut nearest, k, a) + self.closed;
                        }
                        let listed = self.against_listed(chain, &mut nearest, k, a) + self.closed;
                        self.sums[a] = listed.min(self.unlisted[a]);
                    }
                }
            }
        }
        let found = nearest.finish();
        if let Some(found) = &found {
            self.last_pair = Some((found.bench_a, found.bench_b));
        }
        found
    }

    /// Lowers the bounds by the displacement of the handles since the previous frame.
    fn follow(&mut self, chain: &Chain) {
        const LANES: usize = 8;
        let (mut most, mut sum) = ([0.0; LANES], [0.0; LANES]);
        let old = self.x.chunks_mut(LANES).zip(self.y.chunks_mut(LANES));
        for ((old_x, old_y), (x, y)) in old.zip(chain.x.chunks(LANES).zip(chain.y.chunks(LANES))) {
            for k in 0..x.len() {
                let (dx, dy) = (x[k] - old_x[k], y[k] - old_y[k]);
                let squared = dx * dx + dy * dy;
                most[k] = if squared > most[k] { squared } else { most[k] };
                sum[k] += squared;
                (old_x[k], old_y[k]) = (x[k], y[k]);
            }
        }
        self.closed += self.reach * most.into_iter().fold(0.0, f64::max).sqrt();
        // NaN appears in the sum, too.
        if !(sum.iter().sum::<f64>() < f64::INFINITY && self.closed < MOST_MOVED) {
            self.closed = 0.0;
            for part in &self.parts[..self.parts.len().saturating_sub(1)] {
                self.sums[part.benches()].fill(f64::NEG_INFINITY);
                self.unlisted[part.benches()].fill(f64::NEG_INFINITY);
            }
        }
    }

    fn enclose_and_fill(&mut self, chain: &Chain, limit: f64) {
        self.parts.iter_mut().for_each(|part| part.enclose(chain));
        let limit = if limit.is_finite() { limit.max(0.0) } else { 2.0 * self.beyond };
        self.grid.clear(2.0 * self.beyond + limit + SKIN);
        for (k, part) in self.parts.iter().enumerate() {
            for bench in part.benches() {
                let board = part.board(chain, bench);
                self.boards[bench] = (board, board.circle_radius());
                // Only later dragons are looked up.
                if k > 0 {
                    self.grid.add(bench, board.centre.x, board.centre.y);
                }
            }
        }
    }

    /// Lists the boards of later dragons near a bench of the dragon `k`, and tests those that can be within the limit.
    /// Returns a lower bound of its distance to all others.
    fn list_later(&mut self, chain: &Chain, nearest: &mut Nearest, k: usize, a: usize) -> f64 {
        self.counts[a] = 0;
        let (board_a, radius_a) = self.boards[a];
        let (x, y) = (board_a.centre.x, board_a.centre.y);
        let margin = ROUNDING.0 + ROUNDING.1 * (x.abs() + y.abs());
        let later = self.parts[k + 1..].iter().map(|part| part.distance(x, y));
        let apart = later.fold(f64::INFINITY, f64::min) - 2.0 * self.beyond - margin;
        if apart > nearest.value + SKIN {
            return apart;
        }
        let limit = if nearest.value.is_finite() { nearest.value.max(0.0) } else { self.sight() };
        let distance = 2.0 * self.beyond + limit + SKIN + margin;
        let mut unlisted = limit + SKIN;
        let first = self.parts[k + 1].first;
        let (reach, seat) = (0.5 * self.reach, Seat::new(chain, a));
        let Self { grid, boards, listed, counts, tested, .. } = self;
        let (listed, count) = (&mut listed[a], &mut counts[a]);
        let mut visit = |b: usize| {
            let (board_b, radius_b) = boards[b];
            let apart = (board_b.centre - board_a.centre).norm() - radius_a - radius_b - margin;
            // The grid may have the same board twice.
            if apart > limit + SKIN || listed[..usize::from(*count)].iter().any(|other| other.bench as usize == b) {
                return;
            }
            let bound = if apart > nearest.value {
                apart
            } else {
                *tested += 1;
                measured(nearest, (a, b), &board_a, &board_b)
            };
            unlisted = unlisted.min(enlist(listed, count, Listed::new(chain, &seat, b, bound, reach)));
        };
        grid.visit_near((x, y), distance, first, &mut visit);
        unlisted
    }

    /// Tests the listed boards that can be within the limit. Returns a lower bound of the distances to all of the list.
    fn against_listed(&mut self, chain: &Chain, nearest: &mut Nearest, k: usize, a: usize) -> f64 {
        let mut least = f64::INFINITY;
        let mut board_a = None;
        let (reach, seat) = (0.5 * self.reach, Seat::new(chain, a));
        let margin = ROUNDING.0 + ROUNDING.1 * (chain.x[a].abs() + chain.y[a].abs());
        for place in 0..usize::from(self.counts[a]) {
            let listed = self.listed[a][place];
            let mut bound = listed.bound(chain, &seat, reach) - self.link_slack - margin;
            if bound <= nearest.value + margin {
                let b = listed.bench as usize;
                let board_a = board_a.get_or_insert_with(|| self.parts[k].board(chain, a));
                let board_b = self.parts[part_of(&self.parts, b)].board(chain, b);
                self.tested += 1;
                bound = measured(nearest, (a, b), board_a, &board_b);
                self.listed[a][place] = Listed::new(chain, &seat, b, bound, reach);
            }
            least = least.min(bound);
        }
        least
    }

    /// Returns the metres across the boxes about all dragons: no two boards are further apart.
    fn sight(&self) -> f64 {
        let edge = |side: usize| self.parts.iter().map(move |part| part.bounds[side]);
        let wide = edge(1).fold(f64::NEG_INFINITY, f64::max) - edge(0).fold(f64::INFINITY, f64::min);
        let high = edge(3).fold(f64::NEG_INFINITY, f64::max) - edge(2).fold(f64::INFINITY, f64::min);
        wide + high
    }
}

/// Tests two boards.
fn test(parts: &[Part], tested: &mut u64, chain: &Chain, nearest: &mut Nearest, (a, b): (usize, usize)) {
    let [board_a, board_b] = [a, b].map(|bench| parts[part_of(parts, bench)].board(chain, bench));
    *tested += 1;
    nearest.consider(signed_distance_board_board(&board_a, &board_b), (a, b), &board_a, &board_b);
}

fn part_of(parts: &[Part], bench: usize) -> usize {
    parts.partition_point(|part| part.first <= bench) - 1
}

/// Tests two boards. Returns their distance if they are within the limit, or else a lower bound of it.
fn measured(nearest: &mut Nearest, pair: (usize, usize), board_a: &Board, board_b: &Board) -> f64 {
    let separation = separation_board_board(board_a, board_b);
    if separation > nearest.value {
        return separation;
    }
    let value = signed_distance_board_board(board_a, board_b);
    nearest.consider(value, pair, board_a, board_b);
    value
}

/// Puts a board in a list. In a full list it takes the place of the farthest board, if that is farther. Returns a lower
/// bound of the distance of the board that is left out.
fn enlist(list: &mut [Listed; MOST_LISTED], count: &mut u8, new: Listed) -> f64 {
    if let Some(free) = list.get_mut(usize::from(*count)) {
        (*free, *count) = (new, *count + 1);
        return f64::INFINITY;
    }
    let farthest = list.iter_mut().max_by(|one, other| one.distance.total_cmp(&other.distance));
    let left_out = match farthest {
        Some(farthest) if farthest.distance > new.distance => std::mem::replace(farthest, new),
        _ => new,
    };
    f64::from(left_out.distance)
}

/// Returns the nearest two boards of different dragons by testing all pairs, as the reference.
pub fn nearest_between_all_pairs(chain: &Chain, teams: &[Team]) -> Option<PairClearance> {
    let parts = BetweenMonitor::new(teams, 0.0).parts;
    let mut nearest = Nearest::NONE;
    for (k, one) in parts.iter().enumerate() {
        for a in one.benches() {
            let board_a = one.board(chain, a);
            for other in &parts[k + 1..] {
                for b in other.benches() {
                    let board_b = other.board(chain, b);
                    nearest.consider(signed_distance_board_board(&board_a, &board_b), (a, b), &board_a, &board_b);
                }
            }
        }
    }
    nearest.finish()
}
