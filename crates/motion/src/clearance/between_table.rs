//! The boards of two dragons that can be the nearest, for every time of a show. They are listed before the show, so
//! that a frame tests only the listed boards.
//!
//! The time is divided into equal cells. Throughout a cell every handle is near a quadratic polynomial of the cell's
//! time, and these polynomials give a lower and an upper bound of the distance of every two boards (see
//! [`super::moving`]). The list of a cell has the pairs whose lower bound is within the least upper bound, in ascending
//! order. Its last entry stands for all other pairs.
//!
//! The polynomials follow from the rows of each dragon's table ([`crate::solve::table::rows`]), because throughout a
//! cell alpha of the second handle is nearly a linear function of the time. They hold while alpha and the head are
//! within assumed errors, which every frame checks.
//!
//! In: the dragons of a show and its end. Out: a list for every frame.

use super::between::Moment;
use super::cells::track;
use super::grid::Grid;
use super::moving::{MovingBoard, Quadratic};
use super::{circle_radius, corner_reach};
use crate::model::board::Board;
use crate::model::path::Path;
use crate::model::separation::{separation_board_board, signed_distance_board_board};
use crate::model::team::Team;
use crate::model::{Point, Vector};
use crate::placement::Placement;
use crate::solve::table::FollowerTable;
use crate::solve::table::rows::Alpha;

/// Cells while the fastest head passes the shortest link.
const CELLS: f64 = 4.0;

/// The greatest work to make a table, in nanoseconds on a processor of 2025: in a cell for each dragon, each handle,
/// and each two boards. That of dragons also limits the memory.
const MOST_WORK: usize = 5_000_000_000;
const WORK_OF_DRAGON: usize = 10_000;
const WORK_OF_HANDLE: usize = 400;
const WORK_OF_PAIR: usize = 60;

/// The greatest number of entries.
const MOST_ENTRIES: usize = 1 << 22;

/// The greatest change of alpha in a cell, and the greatest and the least assumed error of alpha.
const MOST_CHANGE: f64 = 0.5;
const ALPHA_ERRORS: (f64, f64) = (1e-3, 1e-7);

/// The least assumed error of the head, in metres.
const HEAD_ERROR: f64 = 1e-6;

/// A dragon whose frames come from a table.
pub struct TabledDragon<'a> {
    /// Its team.
    pub team: Team,
    /// Its path, in the path's own coordinates.
    pub path: &'a Path,
    /// The mapping of these coordinates to the stage.
    pub placement: Placement,
    /// The table of its frames, in the path's own coordinates.
    pub table: &'a FollowerTable,
    /// The speed of the head, in metres per second.
    pub head_speed: f64,
}

/// Two boards that can be the nearest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    /// A lower bound of their signed distance, in metres.
    pub bound: f32,
    /// The benches, by the numbers of the show; `None` for all pairs without an entry.
    pub pair: Option<(u32, u32)>,
}

/// A dragon in a cell: the assumptions of its polynomials.
#[derive(Debug, Clone, Copy)]
struct State {
    /// Alpha of the second handle at the beginning of the cell, and its change in the cell.
    alpha: f64,
    change: f64,
    /// The greatest difference of alpha and the linear function of the time.
    error: f64,
    /// The head on the stage, with the greatest distance from it.
    head: Quadratic,
}

/// A board throughout a cell, and in the middle of the cell.
type Cell = (MovingBoard, Board);

/// The table.
#[derive(Debug, Clone)]
pub(super) struct BetweenTable {
    cells_per_second: f64,
    /// By cell: the index of its first entry; `None` without a list.
    begins: Vec<Option<u32>>,
    entries: Vec<Entry>,
    /// By cell, then by dragon.
    states: Vec<Option<State>>,
    /// By dragon: the table without its rows, and the number of the first handle.
    dragons: Vec<(FollowerTable, usize)>,
}

impl BetweenTable {
    /// Makes the table of a show from its start to `end`, as far as the greatest work suffices. `travelled` has the
    /// metres that the head of a dragon has travelled at a time. `None` if a frame can have no limit.
    pub(super) fn new(dragons: &[TabledDragon<'_>], end: f64, travelled: &dyn Fn(usize, f64) -> f64) -> Option<Self> {
        let mut builder = Builder::new(dragons)?;
        let shortest = dragons.iter().map(|dragon| dragon.team.shortest_link()).fold(f64::INFINITY, f64::min);
        let fastest = dragons.iter().map(|dragon| dragon.head_speed).fold(0.0, f64::max);
        let cells_per_second = CELLS * fastest / shortest;
        let firsts = builder.firsts.iter().copied();
        let mut table = Self {
            cells_per_second,
            begins: Vec::new(),
            entries: Vec::new(),
            states: Vec::new(),
            dragons: dragons.iter().map(|dragon| dragon.table.without_rows()).zip(firsts).collect(),
        };
        let cells = (end * cells_per_second).ceil();
        for cell in 0..if cells < 1e9 { cells as usize } else { 0 } {
            if builder.work > MOST_WORK || table.entries.len() > MOST_ENTRIES {
                break;
            }
            let time = |share: f64| (cell as f64 + share) / cells_per_second;
            let states = builder.enter(&|dragon, share| travelled(dragon, time(share)));
            table.begins.push(states.is_some().then_some(table.entries.len() as u32));
            table
                .states
                .extend(states.map_or_else(|| vec![None; dragons.len()], |of| of.into_iter().map(Some).collect()));
            if table.begins[cell].is_some() {
                builder.list(&mut table.entries);
            }
        }
        Some(table)
    }

    /// Returns the list of a frame with these handles; `None` where there is none, or if the dragons are elsewhere.
    pub(super) fn list(&self, moment: &Moment<'_>, (x, y): (&[f64], &[f64])) -> Option<&[Entry]> {
        let cells = moment.time * self.cells_per_second;
        let cell = (cells >= 0.0).then_some(cells as usize)?;
        let begin = (*self.begins.get(cell)?)?;
        let share = cells - cell as f64;
        let states = &self.states[cell * self.dragons.len()..][..self.dragons.len()];
        for (((table, first), state), travelled) in self.dragons.iter().zip(states).zip(moment.travelled) {
            let state = state.as_ref()?;
            let (alpha, _) = table.second_handle(*travelled)?;
            let miss = alpha.row as f64 + alpha.phase - (state.alpha + share * state.change);
            let head = state.head.at(2.0 * share - 1.0) - Vector::new(x[*first], y[*first]);
            (miss.abs() <= state.error && head.norm() <= state.head.error).then_some(())?;
        }
        Some(&self.entries[begin as usize..])
    }
}

/// Makes the lists, cell by cell.
struct Builder<'a> {
    dragons: &'a [TabledDragon<'a>],
    /// By dragon: the number of its first handle.
    firsts: Vec<usize>,
    /// The greatest radius of a board, in metres.
    radius: f64,
    /// Upper limit of every bound, in metres: in every frame two boards of one dragon are nearer.
    farthest: f64,
    /// The error of a bound per metre of error of a handle, and the greatest error of a handle of a frame, in metres.
    error_factor: f64,
    handle_error: f64,
    /// By bench; `None` for the last handle of a dragon.
    boards: Vec<Option<Cell>>,
    /// By dragon: left, right, low, high of its boards in the cell, and their greatest travel.
    boxes: Vec<([f64; 4], f64)>,
    grid: Grid,
    /// The first pair of the latest list: probably near in the next cell.
    likely: Option<(u32, u32)>,
    work: usize,
}

impl<'a> Builder<'a> {
    fn new(dragons: &'a [TabledDragon<'a>]) -> Option<Self> {
        let mut handles = 0;
        let mut first = |dragon: &TabledDragon<'_>| {
            handles += dragon.team.handles();
            handles - dragon.team.handles()
        };
        let firsts = dragons.iter().map(&mut first).collect();
        let most = |of: &dyn Fn(&TabledDragon<'_>) -> f64| dragons.iter().map(of).fold(0.0, f64::max);
        let handle_error = most(&|dragon| 2.0 * dragon.table.accuracy());
        // Two benches with one between them are never farther apart than its link.
        let with_pairs = dragons.iter().filter(|dragon| dragon.team.benches > 2);
        let farthest = with_pairs.map(|dragon| dragon.team.link(1)).reduce(f64::min)? + 2.0 * handle_error;
        Some(Self {
            dragons,
            firsts,
            radius: most(&|dragon| circle_radius(&dragon.team, 0).max(circle_radius(&dragon.team, 1))),
            farthest,
            error_factor: 2.0 * most(&|dragon| corner_reach(&dragon.team, 0).max(corner_reach(&dragon.team, 1))),
            handle_error,
            boards: vec![None; handles],
            boxes: Vec::new(),
            grid: Grid::new(handles),
            likely: None,
            work: 0,
        })
    }

    /// Enters the next cell: the boards of all dragons. `travelled` has the metres of a dragon at a share of the cell.
    /// Returns `None` if a dragon is not known throughout the cell.
    fn enter(&mut self, travelled: &dyn Fn(usize, f64) -> f64) -> Option<Vec<State>> {
        self.boxes.clear();
        self.work += WORK_OF_DRAGON * self.dragons.len();
        let mut states = Vec::with_capacity(self.dragons.len());
        for (k, dragon) in self.dragons.iter().enumerate() {
            let (state, handles) = handles(dragon, &|share| travelled(k, share))?;
            self.work += WORK_OF_HANDLE * handles.len();
            let mut bounds = ([f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY], 0.0f64);
            for (bench, pair) in handles.windows(2).enumerate() {
                let board = MovingBoard::new(&pair[0], &pair[1], &dragon.team, bench);
                let middle = board.middle();
                let ([left, right, low, high], travel) = bounds;
                let Point { coords } = middle.centre;
                bounds = (
                    [left.min(coords.x), right.max(coords.x), low.min(coords.y), high.max(coords.y)],
                    // Next to a singular place the bounds are too weak to help.
                    Some(travel.max(board.travel)).filter(|travel| *travel <= self.radius)?,
                );
                board.travel.is_finite().then_some(())?;
                self.boards[self.firsts[k] + bench] = Some((board, middle));
            }
            self.boxes.push(bounds);
            states.push(state);
        }
        Some(states)
    }

    /// Adds the list of the cell.
    fn list(&mut self, entries: &mut Vec<Entry>) {
        let coordinate = |([left, right, low, high], _): &([f64; 4], f64)| {
            [left, right, low, high].into_iter().map(|metres| metres.abs()).fold(0.0, f64::max)
        };
        let coordinates = self.boxes.iter().map(coordinate).fold(0.0, f64::max) + self.radius;
        let margin = self.error_factor * (self.handle_error + 64.0 * f64::EPSILON * coordinates);
        // The last bound must be above the nearest distance of a frame, whose handles have errors.
        let allowance = 2.0 * margin;
        let mut limit = self.farthest + allowance;
        if let Some((_, greatest)) = self.likely.and_then(|pair| self.distance_bounds(pair)) {
            limit = limit.min(greatest + allowance);
        }
        let candidates = self.candidates(&mut limit, allowance);
        let bounded = |((a, b), rough): ((u32, u32), f64)| {
            let (least, greatest) = self.distance_bounds((a, b))?;
            limit = limit.min(greatest + allowance);
            Some((rough.max(least), (a, b)))
        };
        let mut bounded: Vec<(f64, (u32, u32))> = candidates.into_iter().filter_map(bounded).collect();
        bounded.retain(|(bound, _)| *bound <= limit);
        bounded.sort_unstable_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        self.likely = bounded.first().map(|(_, pair)| *pair);
        let rounded = |bound: f64| ((bound - margin) as f32).next_down();
        entries.extend(bounded.into_iter().map(|(bound, pair)| Entry { bound: rounded(bound), pair: Some(pair) }));
        entries.push(Entry { bound: rounded(limit), pair: None });
    }

    /// Returns a lower and an upper bound of the distance of two boards throughout the cell.
    fn distance_bounds(&self, (a, b): (u32, u32)) -> Option<(f64, f64)> {
        let [(one, one_at), (other, other_at)] = [self.boards[a as usize].as_ref()?, self.boards[b as usize].as_ref()?];
        Some(one.distance_bounds(one_at, other, other_at))
    }

    /// Returns the pairs that can be within `limit`, each with a lower bound. Lowers the limit to `allowance` metres
    /// above an upper bound of the least distance.
    fn candidates(&mut self, limit: &mut f64, allowance: f64) -> Vec<((u32, u32), f64)> {
        let mut candidates = Vec::new();
        let travel = self.boxes.iter().map(|(_, travel)| *travel).fold(0.0, f64::max);
        let reach = 2.0 * (self.radius + travel);
        let near = |(one, _): &([f64; 4], f64), (other, _): &([f64; 4], f64), limit: f64| {
            let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[1]).max(b[0] - a[1]);
            apart([one[0], one[1]], [other[0], other[1]]).max(apart([one[2], one[3]], [other[2], other[3]]))
                <= reach + limit.max(0.0)
        };
        let mut is_filled = false;
        for k in 0..self.dragons.len() - 1 {
            if !self.boxes[k + 1..].iter().any(|later| near(&self.boxes[k], later, *limit)) {
                continue;
            }
            if !std::mem::replace(&mut is_filled, true) {
                self.grid.clear(reach + limit.max(0.0));
                for (bench, board) in self.boards.iter().enumerate().skip(self.firsts[1]) {
                    board.iter().for_each(|(_, at)| self.grid.add(bench, at.centre.x, at.centre.y));
                }
            }
            let Self { boards, grid, work, firsts, .. } = self;
            let own = firsts[k]..firsts[k + 1];
            for (a, board) in own.clone().zip(&boards[own]) {
                let Some((board, at)) = board else { continue };
                let distance = reach + limit.max(0.0);
                grid.visit_near((at.centre.x, at.centre.y), distance, firsts[k + 1], |b| {
                    *work += WORK_OF_PAIR;
                    let Some((other, other_at)) = &boards[b] else { return };
                    let separation = separation_board_board(at, other_at);
                    if separation - board.travel - other.travel > *limit {
                        return;
                    }
                    let travel = board.relative_travel(other);
                    let rough = separation - travel;
                    if rough <= *limit {
                        *limit = limit.min(signed_distance_board_board(at, other_at) + travel + allowance);
                        candidates.push(((a as u32, b as u32), rough));
                    }
                });
            }
        }
        candidates.retain(|(_, rough)| *rough <= *limit);
        // The grid may have visited a pair twice.
        candidates.sort_unstable_by_key(|(pair, _)| *pair);
        candidates.dedup_by_key(|(pair, _)| *pair);
        candidates
    }
}

/// Returns a dragon's handles on the stage throughout a cell, head first, and the assumptions of their polynomials.
/// `travelled` has the metres of the head at a share of the cell.
fn handles(dragon: &TabledDragon<'_>, travelled: &dyn Fn(f64) -> f64) -> Option<(State, Vec<Quadratic>)> {
    let TabledDragon { team, path, placement, table, .. } = dragon;
    let alpha = |share: f64| table.second_handle(travelled(share)).map(|(alpha, _)| alpha);
    let (begin, middle, end) = (alpha(0.0)?, alpha(0.5)?, alpha(1.0)?);
    let number = |of: Alpha| of.row as f64 + of.phase;
    let change = number(end) - number(begin);
    let miss = (number(middle) - number(begin) - 0.5 * change).abs();
    let stands = change == 0.0 && miss == 0.0;
    let error = if stands { 0.0 } else { 2.0 * miss + ALPHA_ERRORS.1 };
    // All values of alpha within the error.
    let (low, width) = ((if change < 0.0 { end } else { begin }).plus(-error), change.abs() + 2.0 * error);
    let is_known = number(low) >= table.rows().valid_from
        && error <= ALPHA_ERRORS.0
        && width <= MOST_CHANGE
        && (stands || error <= 0.01 * width);
    is_known.then_some(())?;
    let part = if stands { 1.0 } else { change / width };
    let slip = if stands { 0.0 } else { 2.0 * error / width };
    let placed = |Quadratic { terms: [at, slope, square], error }: Quadratic| {
        let [slope, square] = [slope, square].map(|term| placement.vector(term));
        Quadratic { terms: [placement.point(at.into()).coords, slope, square], error }
    };
    let place = |share: f64| path.point(path.param_at(travelled(share))).coords;
    let mut head = Quadratic::through(place(0.0), place(0.5), place(1.0));
    let miss = [0.25, 0.75].map(|share| (head.at(2.0 * share - 1.0) - place(share)).norm());
    head.error = 2.0 * miss[0].max(miss[1]) + HEAD_ERROR + table.accuracy();
    let head = placed(head);
    let mut all = Vec::with_capacity(team.handles());
    all.push(head);
    for behind in 0..team.benches {
        let mut handle = track(table.rows(), low.row + behind, low.phase, width)?;
        let [_, slope, square] = &mut handle.terms;
        handle.error += slip * (slope.norm() + 2.0 * square.norm());
        *slope *= part;
        *square *= part * part;
        all.push(placed(handle));
    }
    Some((State { alpha: number(begin), change, error, head }, all))
}
