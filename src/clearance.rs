//! Which two boards of a chain are nearest: all pairs as the reference, and the live way that asks few of them.
//!
//! Takes a [`Chain`] and its [`Team`]; the show calls it where a scene has alerts. Pairs that share a handle never
//! count. Both ways evaluate a pair with the same function on the same numbers, so they agree to the last bit.

mod box_tree;
mod cells;
mod spiral;

use crate::chain::{Chain, Team};
use crate::geometry::Point;
use crate::geometry::rectangle::Board;
use crate::geometry::separation::{closest_points_board_board, signed_distance_board_board, signed_distance_within};
use crate::geometry::spiral::Spiral;
use box_tree::BoxTree;
use cells::{Cells, Located, Near};
use spiral::{Beside, SpiralBound, Sweep, spiral_bound};

/// The nearest two boards that share no handle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairClearance {
    /// Metres between them; negative where they overlap.
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

/// The board of one bench of a chain. Panics if there is no such bench.
pub fn board(chain: &Chain, team: &Team, bench: usize) -> Board {
    let handle = |k: usize| Point::new(chain.x[k], chain.y[k]);
    Board::from_handles(handle(bench), handle(bench + 1), team.hole_inset, team.width)
}

/// The nearest two boards, by asking all pairs; of several, the lowest (a, b). `None` under three benches.
pub fn least_clearance_all_pairs(chain: &Chain, team: &Team) -> Option<PairClearance> {
    let mut nearest = Nearest::none();
    for a in 0..team.benches {
        let board_a = board(chain, team, a);
        for b in a + 2..team.benches {
            let value = signed_distance_board_board(&board_a, &board(chain, team, b));
            nearest.offer(value, a, b);
        }
    }
    nearest.finish(chain, team)
}

/// The nearest pair so far.
#[derive(Debug, Clone, Copy)]
struct Nearest {
    value: f64,
    pair: (usize, usize),
    /// Pairs asked for it.
    asked: u64,
}

impl Nearest {
    fn none() -> Self {
        Self { value: f64::INFINITY, pair: (usize::MAX, usize::MAX), asked: 0 }
    }

    fn offer(&mut self, value: f64, a: usize, b: usize) {
        if value < self.value || (value == self.value && (a, b) < self.pair) {
            *self = Self { value, pair: (a, b), asked: self.asked };
        }
    }

    fn finish(self, chain: &Chain, team: &Team) -> Option<PairClearance> {
        let (bench_a, bench_b) = self.pair;
        if bench_b == usize::MAX {
            return None;
        }
        let (point_a, point_b) = closest_points_board_board(&board(chain, team, bench_a), &board(chain, team, bench_b));
        Some(PairClearance { value: self.value, bench_a, bench_b, point_a, point_b })
    }
}

/// What is known of the path beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ground {
    /// All handles are on this spiral, each bench's rear handle the first point outward at the link's distance from the
    /// front one. The head comes from the spiral's start.
    Spiral(Spiral),
    /// Nothing: the handles may be anywhere.
    Unknown,
}

/// How much work a monitor has done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClearanceCounters {
    /// Chains looked at.
    pub frames: u64,
    /// Pairs of boards asked for their separation.
    pub pairs: u64,
}

/// The live way: the same answer as [`least_clearance_all_pairs`], from a few pairs.
///
/// It keeps from frame to frame the last nearest pair, whose clearance now is a first limit, and bounds that hold for
/// every frame alike, so a jump of the show cannot mislead it. All memory is reserved by the constructor.
///
/// On a spiral a table made by the constructor says for every bench below what its clearance cannot be where it stands,
/// and only those are asked that can be within the limit: most often none but the last nearest pair. Where a team or its
/// way is too long for the table, or no boards are as near as turns and benches usually are, the head is asked against
/// all whose circles are within the limit, and the rest follows in order, each bench against those beside it on the next
/// turns, up to the first bench beyond which the shape of the spiral itself excludes a nearer pair. Elsewhere, and within
/// a link of the centre, the leading benches are asked as the head is, and the others by a tree of boxes about
/// consecutive benches.
#[derive(Debug, Clone)]
pub struct ClearanceMonitor {
    team: Team,
    ground: Ground,
    latest: Option<PairClearance>,
    last_pair: Option<(usize, usize)>,
    /// The last bound that excluded benches, and the last that did not.
    proven: SpiralBound,
    failed: SpiralBound,
    /// A body board's length over its link's.
    stretch: f64,
    /// On a spiral short enough, and where in it the handle behind the head was last.
    cells: Option<Cells>,
    located: Option<Located>,
    /// The handles' distances from the origin, in a frame that is swept.
    radii: Vec<f64>,
    tree: BoxTree,
    counters: ClearanceCounters,
}

/// Benches asked one by one before the tree of boxes is cheaper.
const LEADING_BENCHES: usize = 24;

impl ClearanceMonitor {
    /// A monitor for the chains of `team`. On a spiral it takes some 10 ms for a way of 500 links, about half a second at
    /// most.
    pub fn new(team: Team, ground: Ground) -> Self {
        let cells = match &ground {
            Ground::Spiral(spiral) => Cells::new(spiral, &team),
            Ground::Unknown => None,
        };
        Self {
            team,
            ground,
            latest: None,
            last_pair: None,
            proven: SpiralBound::NONE,
            failed: SpiralBound { radius: 0.0, bound: f64::NEG_INFINITY },
            stretch: 1.0 + 2.0 * team.hole_inset / team.link(1),
            cells,
            located: None,
            radii: vec![0.0; team.benches + 1],
            tree: BoxTree::new(team.benches),
            counters: ClearanceCounters::default(),
        }
    }

    /// The clearance of the latest frame.
    pub fn latest(&self) -> Option<PairClearance> {
        self.latest
    }

    /// How much work has been done so far.
    pub fn counters(&self) -> ClearanceCounters {
        self.counters
    }

    /// The nearest two boards of `chain`; of several, the lowest (a, b). `None` under three benches.
    pub fn least_clearance(&mut self, chain: &Chain) -> Option<PairClearance> {
        self.counters.frames += 1;
        self.latest = None;
        if self.team.benches < 3 {
            return None;
        }
        let mut nearest = Nearest::none();
        if let Some((a, b)) = self.last_pair {
            self.ask(chain, &board(chain, &self.team, a), a, b, &mut nearest);
        }
        let squared = chain.x[1] * chain.x[1] + chain.y[1] * chain.y[1];
        self.located = self.cells.as_ref().and_then(|cells| cells.locate(squared, self.team.benches - 1, self.located));
        match (&self.cells, self.located) {
            (Some(cells), Some(located)) if nearest.value < cells.farthest() => {
                self.ask_by_cells(chain, cells, located, &mut nearest);
            }
            _ => {
                self.ask_one_against_all(chain, 0, &mut nearest);
                self.ask_followers(chain, &mut nearest);
            }
        }
        self.counters.pairs += nearest.asked;
        self.last_pair = (nearest.pair.1 < self.team.benches).then_some(nearest.pair);
        self.latest = nearest.finish(chain, &self.team);
        self.latest
    }

    /// Asks the pairs that the table does not exclude.
    fn ask_by_cells(&self, chain: &Chain, cells: &Cells, located: Located, nearest: &mut Nearest) {
        let head_squared = chain.x[0] * chain.x[0] + chain.y[0] * chain.y[0];
        self.ask_near(chain, 0, 1, cells.of_head(head_squared, located), nearest);
        // The last bench and the last but one have none behind that counts.
        let bounds = cells.bounds(located, self.team.benches - 3);
        for (chunk, bounds) in bounds.chunks(BOUNDS_AT_ONCE).enumerate() {
            let limit = (nearest.value as f32).next_up();
            if bounds.iter().fold(false, |near, bound| near | (*bound <= limit)) {
                for (k, bound) in bounds.iter().enumerate() {
                    if f64::from(*bound) <= nearest.value {
                        let behind = chunk * BOUNDS_AT_ONCE + k;
                        self.ask_near(chain, 1 + behind, 1 + behind, cells.of_body(located, behind), nearest);
                    }
                }
            }
        }
    }

    /// Asks `a` against those that can be nearer than the limit, counted from the bench `from`.
    fn ask_near(&self, chain: &Chain, a: usize, from: usize, near: &Near, nearest: &mut Nearest) {
        if f64::from(near.others) <= nearest.value {
            self.ask_one_against_all(chain, a, nearest);
        } else if f64::from(near.bound) <= nearest.value {
            let board_a = board(chain, &self.team, a);
            for b in near.benches(from).take_while(|b| *b < self.team.benches) {
                self.ask_unless_excluded(chain, &board_a, a, b, nearest);
            }
        }
    }

    /// Asks all pairs of which the head is not one.
    fn ask_followers(&mut self, chain: &Chain, nearest: &mut Nearest) {
        let mut sweep = None;
        for front in 1..self.team.benches - 2 {
            // Asking whether the rest is excluded costs as much as a bench or two.
            if (front < 4 || front.is_power_of_two()) && self.excluded_from(chain, front, nearest.value) {
                return;
            }
            if let Ground::Spiral(spiral) = &self.ground {
                let sweep = sweep.get_or_insert_with(|| Sweep::new(chain, &self.team, spiral.pitch(), &mut self.radii));
                if let Some(beside) = sweep.beside(&self.radii, front, nearest.value) {
                    self.ask_beside(chain, sweep, front, beside, nearest);
                    continue;
                }
            }
            if front == LEADING_BENCHES {
                self.tree.fit(chain, &self.team);
                self.tree.visit(chain, &self.team, (0, 0), (0, 0), nearest);
                return;
            }
            self.ask_one_against_all(chain, front, nearest);
        }
    }

    /// Asks `a` against the benches beside it on its own turn and the next ones.
    fn ask_beside(&self, chain: &Chain, sweep: &mut Sweep, a: usize, beside: Beside, nearest: &mut Nearest) {
        let board_a = board(chain, &self.team, a);
        let mut turn = 0;
        while let Some(window) = sweep.window(&self.radii, a, turn, beside) {
            for b in window {
                self.ask_unless_excluded(chain, &board_a, a, b, nearest);
            }
            turn += 1;
        }
    }

    fn ask_unless_excluded(&self, chain: &Chain, board_a: &Board, a: usize, b: usize, nearest: &mut Nearest) {
        if Some((a, b)) != self.last_pair && self.gap_bound(chain, board_a, b) <= nearest.value {
            self.ask(chain, board_a, a, b, nearest);
        }
    }

    fn ask(&self, chain: &Chain, board_a: &Board, a: usize, b: usize, nearest: &mut Nearest) {
        nearest.asked += 1;
        if let Some(value) = signed_distance_within(board_a, &board(chain, &self.team, b), nearest.value) {
            nearest.offer(value, a, b);
        }
    }

    /// Whether no pair of benches from `front` on can be as near as `limit`.
    fn excluded_from(&mut self, chain: &Chain, front: usize, limit: f64) -> bool {
        let Ground::Spiral(spiral) = self.ground else { return false };
        // The bound is for equal links, and only the head's can differ.
        if front == 0 {
            return false;
        }
        let r = (chain.x[front] * chain.x[front] + chain.y[front] * chain.y[front]).sqrt();
        if self.proven.excludes(r, limit) {
            return true;
        }
        // The bound only falls further in.
        if r <= self.failed.radius && self.failed.bound <= limit {
            return false;
        }
        // A little further in than needed, it serves for many frames.
        for radius in [0.98 * r, r] {
            let bound = SpiralBound { radius, bound: spiral_bound(radius, spiral.pitch(), &self.team) };
            if bound.excludes(r, limit) {
                self.proven = bound;
                return true;
            }
            self.failed = bound;
        }
        false
    }

    /// Asks `a` against every later bench whose circle about its board is within the limit of that about `a`'s.
    fn ask_one_against_all(&self, chain: &Chain, a: usize, nearest: &mut Nearest) {
        let board_a = board(chain, &self.team, a);
        let radii = board_a.circle_radius() + circle_radius(&self.team, a + 1);
        let (x, y) = (board_a.centre.x, board_a.centre.y);
        let end = self.end_within(chain, a, x.hypot(y) + radii + nearest.value);
        let mut start = a + 2;
        while start < end {
            let stop = end.min(start + CHUNK);
            let limit = padded_square(radii + nearest.value, radii, x.abs() + y.abs());
            let squared = |b: usize| {
                let dx = 0.5 * (chain.x[b] + chain.x[b + 1]) - x;
                let dy = 0.5 * (chain.y[b] + chain.y[b + 1]) - y;
                dx * dx + dy * dy
            };
            if (start..stop).fold(false, |near, b| near | (squared(b) <= limit)) {
                for b in start..stop {
                    if squared(b) <= limit {
                        self.ask_unless_excluded(chain, &board_a, a, b, nearest);
                    }
                }
            }
            start = stop;
        }
    }

    /// A lower bound of the separation of `board_a` and bench `b`, from the gaps along `board_a`'s sides and without a
    /// square root: the half link of `b` is stretched to its half board, and its width taken as if across.
    fn gap_bound(&self, chain: &Chain, board_a: &Board, b: usize) -> f64 {
        let (rear, front) = ((chain.x[b + 1], chain.y[b + 1]), (chain.x[b], chain.y[b]));
        let half_link = (0.5 * (front.0 - rear.0), 0.5 * (front.1 - rear.1));
        let offset = (rear.0 + half_link.0 - board_a.centre.x, rear.1 + half_link.1 - board_a.centre.y);
        let axis = board_a.axis;
        let along = |v: (f64, f64)| (axis.x * v.0 + axis.y * v.1).abs();
        let across = |v: (f64, f64)| (axis.x * v.1 - axis.y * v.0).abs();
        let stretch = self.stretch;
        let gap_along = along(offset) - along(half_link) * stretch - board_a.half_length;
        let gap_across = across(offset) - across(half_link) * stretch - board_a.half_width;
        let half_width = 0.5 * self.team.width;
        let rounding = 1e-9 * board_a.half_length + 1e-12 * (offset.0.abs() + front.0.abs() + front.1.abs());
        gap_along.max(gap_across) - half_width - rounding
    }

    /// One past the last bench that can be within `distance` of the origin: on a spiral the handles' distances grow.
    fn end_within(&self, chain: &Chain, a: usize, distance: f64) -> usize {
        let benches = self.team.benches;
        if self.ground == Ground::Unknown || !distance.is_finite() {
            return benches;
        }
        // A bench's centre is at most half a link nearer to the origin than its front handle.
        let link = self.team.link(a + 1);
        let far = padded_square(distance + 0.5 * link, link, distance);
        let (mut low, mut high) = (a + 1, benches);
        while low < high {
            let middle = low.midpoint(high);
            if chain.x[middle] * chain.x[middle] + chain.y[middle] * chain.y[middle] <= far {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        low
    }
}

/// Bounds that are compared together.
const BOUNDS_AT_ONCE: usize = 32;

/// Benches whose distances are worked out together, so that the processor does several at once.
const CHUNK: usize = 8;

/// The square of a limit, widened by what solver and rounding can have done to lengths of size `length` and coordinates
/// of size `coordinate`; 0 if negative.
fn padded_square(limit: f64, length: f64, coordinate: f64) -> f64 {
    let padded = (limit + 1e-9 * length + 1e-12 * coordinate).max(0.0);
    padded * padded
}

fn circle_radius(team: &Team, bench: usize) -> f64 {
    (0.5 * team.link(bench) + team.hole_inset).hypot(0.5 * team.width)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::Velocities;
    use crate::chain::newton::Newton;
    use crate::geometry::path::Path;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    fn team(benches: usize, width: f64) -> Team {
        Team { benches, head_length: 3.41, body_length: 2.2, width, hole_inset: 0.275 }
    }

    /// Both monitors against all pairs, one after the other over the heads' places, as far as there are chains.
    fn agree(team: Team, pitch: f64, start_turn: f64, travels: &[f64]) -> (usize, ClearanceCounters) {
        let spiral = Spiral::new(pitch, start_turn);
        let solver = Newton::new(spiral, team, 1.0, Velocities::Omitted);
        let mut chain = Chain::new(team.handles());
        let mut monitors = [Ground::Spiral(spiral), Ground::Unknown].map(|ground| ClearanceMonitor::new(team, ground));
        let mut compared = 0;
        for &travelled in travels {
            if solver.solve_from(Spiral::new(pitch, start_turn).place_at(travelled), &mut chain).is_err() {
                continue;
            }
            let truth = least_clearance_all_pairs(&chain, &team);
            for monitor in &mut monitors {
                assert_eq!(monitor.least_clearance(&chain), truth, "{team:?} {pitch} {start_turn} {travelled}");
            }
            compared += 1;
        }
        (compared, monitors[0].counters())
    }

    /// Consecutive frames at several places of the show, and the jumps between them.
    fn runs(length: f64, frames: usize) -> Vec<f64> {
        let places = [0.0, 0.3, 0.6, 0.93, 0.1, 0.98, 0.0, 0.85];
        let run = |place: f64| (0..frames).map(move |k| place * length + k as f64 / 60.0);
        places.into_iter().flat_map(run).collect()
    }

    #[test]
    fn the_same_as_all_pairs_on_the_known_scenes() {
        for (team, pitch, turns) in [
            (team(223, 0.3), 0.55, 16.0),
            (team(223, 0.3), 0.45, 16.0),
            (team(223, 0.3), 1.7, 12.0),
            (team(20, 0.3), 0.55, 16.0),
            // Wider than the pitch, and links shorter than the inset.
            (team(60, 0.7), 0.55, 16.0),
            (Team { head_length: 1.0, body_length: 0.7, ..team(80, 0.3) }, 0.55, 10.0),
            // Body links longer than the head's.
            (Team { head_length: 2.2, body_length: 3.41, ..team(100, 0.3) }, 0.55, 16.0),
        ] {
            let (compared, counters) = agree(team, pitch, turns, &runs(Spiral::new(pitch, turns).length(), 20));
            assert!(compared >= 60, "{team:?}: {compared}");
            assert_eq!(counters.frames as usize, compared);
        }
    }

    /// The handle behind the head is pushed out again to where it was, while the head is elsewhere.
    #[test]
    fn the_same_as_all_pairs_past_a_stall() {
        let four = Team { benches: 4, head_length: 9.5, body_length: 6.5, width: 2.7, hole_inset: 1.1 };
        let fourteen = Team { benches: 14, head_length: 8.9, body_length: 7.7, width: 1.4, hole_inset: 0.8 };
        for team in [four, fourteen] {
            let (compared, _) = agree(team, 8.0, 2.5, &[158.2, 158.22, 158.24, 158.26]);
            assert_eq!(compared, 4);
        }
    }

    /// The closest points are on the boards' outlines and as far apart as the clearance says.
    #[test]
    fn the_closest_points_are_the_clearance_apart() {
        let team = team(223, 0.3);
        let mut chain = Chain::new(team.handles());
        let spiral = Spiral::new(0.55, 16.0);
        let solver = Newton::new(spiral, team, 1.0, Velocities::Omitted);
        for travelled in [0.0, 300.0, 412.0, 412.48] {
            solver.solve_from(Spiral::new(0.55, 16.0).place_at(travelled), &mut chain).unwrap();
            let least = least_clearance_all_pairs(&chain, &team).unwrap();
            assert!(((least.point_a - least.point_b).norm() - least.value.abs()).abs() < 1e-13);
        }
    }

    /// The paper scene: the boards of benches 0 and 8 touch when the head has travelled 412.473837682115 m.
    #[test]
    fn the_paper_scene_touches_where_it_should() {
        let team = team(223, 0.3);
        let mut chain = Chain::new(team.handles());
        let solver = Newton::new(Spiral::new(0.55, 16.0), team, 1.0, Velocities::Omitted);
        let mut monitor = ClearanceMonitor::new(team, Ground::Spiral(Spiral::new(0.55, 16.0)));
        let mut at = |travelled: f64| {
            solver.solve_from(Spiral::new(0.55, 16.0).place_at(travelled), &mut chain).unwrap();
            monitor.least_clearance(&chain).unwrap()
        };
        let (before, after) = (at(412.473837682115 - 1e-9), at(412.473837682115 + 1e-9));
        assert!(before.value > 0.0 && after.value < 0.0, "{before:?} {after:?}");
        assert_eq!((after.bench_a, after.bench_b), (0, 8));
    }

    #[test]
    fn few_pairs_are_asked() {
        // In a fifth of this show every pair of neighbours on two turns is nearly as near as the nearest.
        let everywhere: Vec<f64> = (0..824).map(|half_second| 0.5 * f64::from(half_second)).collect();
        for travels in [runs(400.0, 20), everywhere] {
            let (compared, counters) = agree(team(223, 0.3), 0.55, 16.0, &travels);
            assert!(counters.pairs < 3 * compared as u64, "{counters:?}");
        }
        // A way too long for the table.
        let (compared, counters) = agree(team(400, 0.3), 0.55, 130.0, &runs(29_000.0, 2));
        assert!(counters.pairs < 40 * compared as u64, "{counters:?}");
    }

    #[test]
    fn too_few_benches_have_no_clearance() {
        for benches in [1, 2] {
            let team = team(benches, 0.3);
            let mut monitor = ClearanceMonitor::new(team, Ground::Unknown);
            assert_eq!(monitor.least_clearance(&Chain::new(team.handles())), None);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn the_same_as_all_pairs_on_random_scenes(
            benches in 3..90usize, pitch in 0.05..3.0f64, turns in 2.0..25.0f64, width in 0.01..1.5f64,
            inset in 0.0..1.0f64, head in 0.1..5.0f64, body in 0.1..5.0f64, equal in any::<bool>(),
            places in prop::collection::vec(0.0..1.0f64, 6),
        ) {
            let long = |link: f64| link + 2.0 * inset;
            let head_length = long(if equal { body } else { head });
            let team = Team { benches, head_length, body_length: long(body), width, hole_inset: inset };
            let length = Spiral::new(pitch, turns).length();
            let travels: Vec<f64> =
                places.iter().flat_map(|place| [place * length, place * length + 1.0 / 60.0]).collect();
            agree(team, pitch, turns, &travels);
        }

        #[test]
        fn the_same_as_all_pairs_next_to_the_centre(
            benches in 3..20usize, turns in 2.0..4.0f64, width in 0.01..0.5f64, inset in 0.0..0.6f64,
            head in 4.0..6.5f64, body in 2.0..6.0f64, places in prop::collection::vec(0.0..3.0f64, 6),
        ) {
            // All in units of pitch / 2 pi.
            let (head_length, body_length) = (head + 2.0 * inset, body + 2.0 * inset);
            let team = Team { benches, head_length, body_length, width: width * TAU, hole_inset: inset };
            let length = Spiral::new(TAU, turns).length();
            let travels: Vec<f64> = places.iter().flat_map(|place| [length - place - 1e-3, length - place]).collect();
            agree(team, TAU, turns, &travels);
        }

        /// The bound that excludes benches is below the truth among the benches it speaks of.
        #[test]
        fn the_spiral_bound_is_below_every_clearance(
            pitch in 0.05..3.0f64, turns in 1.0..25.0f64, width in 0.01..0.9f64,
            inset in 0.0..0.6f64, link in 0.2..3.0f64,
        ) {
            let width = width * pitch;
            let length = link + 2.0 * inset;
            let team = Team { benches: 70, head_length: length, body_length: length, width, hole_inset: inset };
            let spiral = Spiral::new(pitch, turns);
            let mut chain = Chain::new(team.handles());
            let head = spiral.place_at(0.0);
            if Newton::new(spiral, team, 1.0, Velocities::Omitted).solve_from(head, &mut chain).is_ok() {
                let truth = least_clearance_all_pairs(&chain, &team).unwrap().value;
                prop_assert!(spiral_bound(chain.x[0].hypot(chain.y[0]), pitch, &team) <= truth);
            }
        }
    }
}
