//! Which two boards of a chain are nearest: all pairs as the reference, and the live way that asks few of them.
//!
//! Takes a [`Chain`] and its [`Team`]; the show calls it where a scene has alerts. Pairs that share a handle never
//! count. Both ways evaluate a pair with the same function on the same numbers, so they agree to the last bit.

use crate::chain::{Chain, Team};
use crate::geometry::Point;
use crate::geometry::rectangle::Board;
use crate::geometry::separation::{closest_points_board_board, signed_distance_board_board, signed_distance_within};

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
}

impl Nearest {
    fn none() -> Self {
        Self { value: f64::INFINITY, pair: (usize::MAX, usize::MAX) }
    }

    fn offer(&mut self, value: f64, a: usize, b: usize) {
        if value < self.value || (value == self.value && (a, b) < self.pair) {
            *self = Self { value, pair: (a, b) };
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
    /// All handles are on the spiral of this pitch about the origin, each bench's rear handle the first point outward
    /// at the link's distance from the front one.
    Spiral {
        /// Metres from turn to turn.
        pitch: f64,
    },
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
/// The head is asked against all whose circles are within the limit. On a spiral the rest follows in order, each bench
/// against those beside it on the next turns, up to the first bench beyond which the shape of the spiral itself excludes
/// a nearer pair (often the second). Elsewhere, and close to the centre, the leading benches are asked as the head is,
/// and the others by a tree of boxes about consecutive benches.
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
    /// The handles' distances from the origin, in a frame that is swept.
    radii: Vec<f64>,
    tree: BoxTree,
    counters: ClearanceCounters,
}

/// Benches asked one by one before the tree of boxes is cheaper.
const LEADING_BENCHES: usize = 24;

impl ClearanceMonitor {
    /// A monitor for the chains of `team`.
    pub fn new(team: Team, ground: Ground) -> Self {
        Self {
            team,
            ground,
            latest: None,
            last_pair: None,
            proven: SpiralBound::NONE,
            failed: SpiralBound { radius: 0.0, bound: f64::NEG_INFINITY },
            stretch: 1.0 + 2.0 * team.hole_inset / team.link(1),
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
        self.ask_one_against_all(chain, 0, &mut nearest);
        self.ask_followers(chain, &mut nearest);
        self.last_pair = (nearest.pair.1 < self.team.benches).then_some(nearest.pair);
        self.latest = nearest.finish(chain, &self.team);
        self.latest
    }

    /// Asks all pairs of which the head is not one.
    fn ask_followers(&mut self, chain: &Chain, nearest: &mut Nearest) {
        let mut sweep = None;
        for front in 1..self.team.benches - 2 {
            // Asking whether the rest is excluded costs as much as a bench or two.
            if (front < 4 || front.is_power_of_two()) && self.excluded_from(chain, front, nearest.value) {
                return;
            }
            if let Ground::Spiral { pitch } = self.ground {
                let sweep = sweep.get_or_insert_with(|| Sweep::new(chain, &self.team, pitch, &mut self.radii));
                if let Some(beside) = sweep.beside(&self.radii, front, nearest.value) {
                    self.ask_beside(chain, sweep, front, beside, nearest);
                    continue;
                }
            }
            if front == LEADING_BENCHES {
                self.tree.fit(chain, &self.team);
                self.tree.visit(chain, &self.team, (0, 0), (0, 0), nearest, &mut self.counters.pairs);
                return;
            }
            self.ask_one_against_all(chain, front, nearest);
        }
    }

    /// Asks `a` against the benches beside it on its own turn and the next ones.
    fn ask_beside(&mut self, chain: &Chain, sweep: &mut Sweep, a: usize, beside: Beside, nearest: &mut Nearest) {
        let board_a = board(chain, &self.team, a);
        let mut turn = 0;
        while let Some(window) = sweep.window(&self.radii, a, turn, beside) {
            for b in window {
                if Some((a, b)) != self.last_pair && self.gap_bound(chain, &board_a, b) <= nearest.value {
                    self.ask(chain, &board_a, a, b, nearest);
                }
            }
            turn += 1;
        }
    }

    fn ask(&mut self, chain: &Chain, board_a: &Board, a: usize, b: usize, nearest: &mut Nearest) {
        self.counters.pairs += 1;
        if let Some(value) = signed_distance_within(board_a, &board(chain, &self.team, b), nearest.value) {
            nearest.offer(value, a, b);
        }
    }

    /// Whether no pair of benches from `front` on can be as near as `limit`.
    fn excluded_from(&mut self, chain: &Chain, front: usize, limit: f64) -> bool {
        let Ground::Spiral { pitch } = self.ground else { return false };
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
            let bound = SpiralBound { radius, bound: spiral_bound(radius, pitch, &self.team) };
            if bound.excludes(r, limit) {
                self.proven = bound;
                return true;
            }
            self.failed = bound;
        }
        false
    }

    /// Asks `a` against every later bench whose circle about its board is within the limit of that about `a`'s.
    fn ask_one_against_all(&mut self, chain: &Chain, a: usize, nearest: &mut Nearest) {
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
                    if squared(b) <= limit
                        && Some((a, b)) != self.last_pair
                        && self.gap_bound(chain, &board_a, b) <= nearest.value
                    {
                        self.ask(chain, &board_a, a, b, nearest);
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

/// Which benches are beside a bench on a spiral, by the handles' distances r from the origin, which grow along the chain
/// and tell the polar angles, theta = 2 pi r / pitch. All benches but the head have one link l; inset e, half width W.
///
/// - A board's points are within c = hypot(e, W) of the segment between its handles. That segment's points are within
///   l / 2 of a handle, so at r - l / 2 or further out, and its polar angles are between those of its handles. So the
///   board's points are at rho = r - l / 2 - c or further out, and at most asin(c / (r - l / 2)) beyond these angles.
/// - Two points within s of each other, both at rho or further out, are at most 2 asin(s / 2 rho) <= asin(s / rho) apart
///   in polar angle, give or take whole turns.
/// - asin(q) <= (pi / 3) q for q <= 1/2, since asin is convex and asin(1/2) = pi / 6.
///
/// So benches a < b, both behind the head, can only be within s of each other if for some whole number of turns their
/// handles' angles overlap when widened by w = (pi / 3) (2 c / (r - l / 2) + s / rho), with r that of a's front handle.
/// In distances from the origin: r_b <= r_(a+1) + turns pitch + width and r_(b+1) >= r_a + turns pitch - width, with
/// width = w pitch / 2 pi.
///
/// And b's points are at sqrt(r_b^2 - l^2 / 4) - c or further out (the foot of the origin on the link's line is within
/// l / 2 of the front handle, or not between the handles), a's at r_(a+1) + c or further in.
#[derive(Debug, Clone, Copy)]
struct Sweep {
    pitch: f64,
    link: f64,
    corner: f64,
    /// What solver and rounding can have done to a distance, metres.
    rounding: f64,
    /// Where the window on the next turn began for the bench before.
    next_turn: usize,
}

/// How far beside a bench others matter.
#[derive(Debug, Clone, Copy)]
struct Beside {
    /// Metres by which distances from the origin are widened.
    width: f64,
    /// Metres within which others matter.
    limit: f64,
}

impl Sweep {
    fn new(chain: &Chain, team: &Team, pitch: f64, radii: &mut [f64]) -> Self {
        for ((radius, x), y) in radii.iter_mut().zip(&chain.x).zip(&chain.y) {
            *radius = (x * x + y * y).sqrt();
        }
        let outermost = radii.last().copied().unwrap_or(0.0);
        let rounding = (1e-9 + 64.0 * f64::EPSILON * outermost) * (1.0 + team.link(1));
        let corner = team.hole_inset.hypot(0.5 * team.width);
        Self { pitch, link: team.link(1), corner, rounding, next_turn: 0 }
    }

    /// How far beside `a` others can be within `limit`; `None` where `a` is too near to the origin to tell.
    fn beside(&self, radii: &[f64], a: usize, limit: f64) -> Option<Beside> {
        let limit = limit.max(0.0) + self.rounding;
        let nearest = radii[a] - 0.5 * self.link - self.rounding;
        let rho = nearest - self.corner;
        if !(self.corner <= 0.5 * nearest && limit <= 0.5 * rho) {
            return None;
        }
        let widened = std::f64::consts::FRAC_PI_3 * (2.0 * self.corner / nearest + limit / rho);
        let width = widened * self.pitch / std::f64::consts::TAU + 2.0 * self.rounding;
        Some(Beside { width, limit })
    }

    /// The benches after `a` that can matter, so many turns further out; `None` where none can on any turn beyond.
    fn window(&mut self, radii: &[f64], a: usize, turns: usize, beside: Beside) -> Option<std::ops::Range<usize>> {
        let benches = radii.len() - 1;
        let turned = turns as f64 * self.pitch;
        let (first, last) = (radii[a] + turned - beside.width, radii[a + 1] + turned + beside.width);
        let begins = |from: usize| from + radii[from + 1..].partition_point(|radius| *radius < first);
        let start = match turns {
            0 => a + 2,
            1 => {
                // From bench to bench the window moves on by few.
                self.next_turn = self.next_turn.max(a + 2);
                while self.next_turn < benches && radii[self.next_turn + 1] < first {
                    self.next_turn += 1;
                }
                self.next_turn
            }
            _ => begins(self.next_turn.min(benches - 1)),
        };
        if start >= benches {
            return None;
        }
        let reach = radii[a + 1] + 2.0 * self.corner + beside.limit + 2.0 * self.rounding;
        if turns > 0 && radii[start] * radii[start] - 0.25 * self.link * self.link > reach * reach {
            return None;
        }
        let length = radii[start..benches].iter().take_while(|radius| **radius <= last).count();
        Some(start..start + length)
    }
}

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

/// A value of [`spiral_bound`], which holds from its radius outward.
#[derive(Debug, Clone, Copy)]
struct SpiralBound {
    radius: f64,
    bound: f64,
}

impl SpiralBound {
    const NONE: Self = Self { radius: f64::INFINITY, bound: f64::NEG_INFINITY };

    fn excludes(&self, r: f64, limit: f64) -> bool {
        r >= self.radius && self.bound > limit
    }
}

/// A lower bound of the clearance of every two boards that share no handle, among benches of equal links whose handles
/// are all on the spiral at radius `r` or further out; minus infinity where there is no such bound.
///
/// Write delta = rho - a psi for how far a point (rho, psi) is off the spiral, psi counted on along the turns. With link
/// l, inset e, half width W, increment d from handle to handle and a = pitch / 2 pi:
///
/// - d <= 2 asin(l / 2r), as l^2 = (a d)^2 + 4 r r' sin^2(d/2); and d >= l / (r' + a), as the arc is longer than the
///   chord. r' = r + a d.
/// - The link's line passes the origin at h; its points have |x| <= X = l/2 + e + (r'^2 - r^2) / 2l from the foot, so
///   h^2 >= r^2 - X^2. Along it delta = sqrt(h^2 + x^2) - a atan(x / h) is convex for h > 2a with curvature at most
///   K = (1 + 2a/h) / h, and 0 at the handles. So delta >= -K l^2 / 8 between them and <= K e (l + e) / 2 beyond them.
///   Off the line by w, rho changes by at most W and psi by at most W X / (h (h - W)).
/// - Two points of boards on different turns: along the segment s between them delta's gradient is at most
///   sqrt(1 + (a / rho)^2), and it must make up the pitch at least once:
///   s >= (pitch + least delta - greatest delta) / sqrt(1 + (a / rho)^2), rho^2 >= (h - W)^2 - s^2 / 4.
/// - Two points on the same turn: between the boards is a whole link, of which corners reach over at most asin(q / r)
///   from either end, q = hypot(e, W). That link's front handle is at r', its rear one at r'' <= r' + a d. So the points
///   are gamma = l / (r'' + a) - 2 asin(q / r) < l / r apart about the origin, or more, and
///   s >= (h - W) sin(gamma) >= (h - W) gamma (1 - (l / r)^2 / 6).
///
/// Each piece is monotone in r the favourable way, so the bound at r holds at every greater radius.
fn spiral_bound(r: f64, pitch: f64, team: &Team) -> f64 {
    let link = team.link(1);
    let (inset, half_width) = (team.hole_inset, 0.5 * team.width);
    let a = pitch / std::f64::consts::TAU;
    let corner = inset.hypot(half_width);
    if link > r || corner >= 0.5 * r {
        return f64::NEG_INFINITY;
    }
    let increment = 2.0 * (0.5 * link / r).asin();
    let outer = r + a * increment;
    let most_along = 0.5 * link + inset + a * increment * (outer + r) / (2.0 * link);
    let height_squared = r * r - most_along * most_along;
    let height = height_squared.max(0.0).sqrt();
    let inner = height - half_width;
    let rho_squared = inner * inner - 0.25 * pitch * pitch;
    if height <= 2.0 * a || inner <= 0.0 || rho_squared <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let curvature = (1.0 + 2.0 * a / height) / height;
    let bulge = curvature * (0.125 * link * link + 0.5 * inset * (link + inset));
    let slant = 2.0 * a * half_width * most_along / (height * inner);
    let next_turn = (pitch - team.width - bulge - slant) / (1.0 + a * a / rho_squared).sqrt();
    let ratio = link / r;
    let gap = link * inner / (outer + a * increment + a) - 2.0 * r * (corner / r).asin();
    if next_turn <= 0.0 || gap <= 0.0 {
        return f64::NEG_INFINITY;
    }
    // The handles are on the spiral up to the solver's accuracy and the last digits of their coordinates.
    let rounding = (1e-9 + 64.0 * f64::EPSILON * r) * 2.0 * Board::reach(link, inset, team.width);
    next_turn.min(gap * (1.0 - ratio * ratio / 6.0)) - rounding
}

/// An upright box about the boards of consecutive benches.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: [f64; 2],
    high: [f64; 2],
}

impl Bounds {
    const EMPTY: Self = Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };

    fn union(&self, other: &Self) -> Self {
        let each = |k: usize| (self.low[k].min(other.low[k]), self.high[k].max(other.high[k]));
        let ((left, right), (bottom, top)) = (each(0), each(1));
        Self { low: [left, bottom], high: [right, top] }
    }

    fn of(board: &Board) -> Self {
        let (cosine, sine) = (board.axis.x.abs(), board.axis.y.abs());
        let x = board.half_length * cosine + board.half_width * sine;
        let y = board.half_length * sine + board.half_width * cosine;
        let (cx, cy) = (board.centre.x, board.centre.y);
        let pad = 1e-12 * (cx.abs() + cy.abs() + x + y);
        Self { low: [cx - x - pad, cy - y - pad], high: [cx + x + pad, cy + y + pad] }
    }

    /// The larger gap along x and y: a lower bound of the clearance of any two boards in the boxes, overlapping or
    /// not, since the signed clearance is the largest gap over all directions.
    fn gap(&self, other: &Self) -> f64 {
        let along = |k: usize| (self.low[k] - other.high[k]).max(other.low[k] - self.high[k]);
        along(0).max(along(1))
    }
}

/// A binary tree of boxes over the benches in their order, without pointers: level 0 is the root, node n of a level has
/// the children 2n and 2n + 1 of the next, and the last level's nodes hold [`LEAF`] benches each.
#[derive(Debug, Clone)]
struct BoxTree {
    /// Node n of level k is at 2^k - 1 + n.
    boxes: Vec<Bounds>,
    depth: u32,
}

/// Benches per leaf.
const LEAF: usize = 4;

impl BoxTree {
    fn new(benches: usize) -> Self {
        let leaves = benches.div_ceil(LEAF).next_power_of_two();
        Self { boxes: vec![Bounds::EMPTY; 2 * leaves - 1], depth: leaves.trailing_zeros() }
    }

    fn at(&self, (level, node): (u32, usize)) -> &Bounds {
        &self.boxes[(1 << level) - 1 + node]
    }

    fn fit(&mut self, chain: &Chain, team: &Team) {
        let leaves = 1usize << self.depth;
        for leaf in 0..leaves {
            let benches = (leaf * LEAF).min(team.benches)..((leaf + 1) * LEAF).min(team.benches);
            self.boxes[leaves - 1 + leaf] =
                benches.fold(Bounds::EMPTY, |all, bench| all.union(&Bounds::of(&board(chain, team, bench))));
        }
        for parent in (0..leaves - 1).rev() {
            self.boxes[parent] = self.boxes[2 * parent + 1].union(&self.boxes[2 * parent + 2]);
        }
    }

    /// Asks every pair with one bench in each node that the boxes do not exclude. `a` is never right of `b`, and both
    /// are of one level.
    fn visit(
        &self,
        chain: &Chain,
        team: &Team,
        a: (u32, usize),
        b: (u32, usize),
        nearest: &mut Nearest,
        pairs: &mut u64,
    ) {
        if self.at(a).gap(self.at(b)) > nearest.value {
            return;
        }
        let (level, (left, right)) = (a.0 + 1, (a.1, b.1));
        if a.0 == self.depth {
            ask_leaves(chain, team, left, right, nearest, pairs);
            return;
        }
        let mut children = |x: usize, y: usize| self.visit(chain, team, (level, x), (level, y), nearest, pairs);
        children(2 * left, 2 * right);
        children(2 * left, 2 * right + 1);
        if left != right {
            children(2 * left + 1, 2 * right);
        }
        children(2 * left + 1, 2 * right + 1);
    }
}

fn ask_leaves(chain: &Chain, team: &Team, left: usize, right: usize, nearest: &mut Nearest, pairs: &mut u64) {
    let benches = |leaf: usize| leaf * LEAF..((leaf + 1) * LEAF).min(team.benches);
    for a in benches(left) {
        let board_a = board(chain, team, a);
        for b in benches(right).filter(|&b| b >= a + 2) {
            *pairs += 1;
            if let Some(value) = signed_distance_within(&board_a, &board(chain, team, b), nearest.value) {
                nearest.offer(value, a, b);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::Velocities;
    use crate::chain::newton::Newton;
    use crate::geometry::path::Path;
    use crate::geometry::spiral::Spiral;
    use proptest::prelude::*;

    fn team(benches: usize, width: f64) -> Team {
        Team { benches, head_length: 3.41, body_length: 2.2, width, hole_inset: 0.275 }
    }

    /// Both monitors against all pairs, one after the other over the heads' places, as far as there are chains.
    fn agree(team: Team, pitch: f64, start_turn: f64, travels: &[f64]) -> (usize, ClearanceCounters) {
        let spiral = Spiral::new(pitch, start_turn);
        let solver = Newton::new(spiral, team, 1.0, Velocities::Omitted);
        let mut chain = Chain::new(team.handles());
        let mut monitors =
            [Ground::Spiral { pitch }, Ground::Unknown].map(|ground| ClearanceMonitor::new(team, ground));
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
        let mut monitor = ClearanceMonitor::new(team, Ground::Spiral { pitch: 0.55 });
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
            assert!(counters.pairs < 40 * compared as u64, "{counters:?}");
        }
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
