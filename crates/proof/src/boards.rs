//! Boards that are apart: Lemmas 2 and 3 of docs/proofs.md.
//!
//! Doubles choose the direction in which two boards may be apart; intervals prove it.

use std::cell::OnceCell;
use std::f64::consts::TAU;

use super::capsule::Capsule;
use super::interval::{Interval, Vector};
use super::team::{Size, Team};

/// Limit of directions tried for a pair, the best first.
const MOST_TRIES: usize = 4;
/// The number of directions all around that are tried where none of the best is enough.
const SECTORS: usize = 64;
/// The angle in radians to which the best of these directions is refined.
const LEAST_ANGLE: f64 = 1e-9;
/// The distance by doubles, metres, from which on one of the eight fixed directions is tried first.
const CLEARLY_APART: f64 = 1e-2;

/// A direction, of any length.
struct Axis {
    n: Vector,
    norm: Interval,
}

impl Axis {
    fn new([x, y]: [f64; 2]) -> Self {
        let n = Vector::new(x, y);
        Self { norm: n.norm(), n }
    }
}

/// The eight fixed directions, each opposite to the one four further.
const COMPASS: [[f64; 2]; 8] =
    [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, 0.0], [-1.0, -1.0], [0.0, -1.0], [1.0, -1.0]];

/// A board, or a run of boards on one straight line, over the spans of its two handles.
pub(super) struct Board<'a> {
    front: &'a Capsule,
    rear: &'a Capsule,
    /// P_F - P_R.
    middle: Vector,
    /// l.
    length: Interval,
    /// e.
    overhang: Interval,
    half_width: Interval,
    rough: Rough,
    /// The greatest extent in each of the eight fixed directions, in doubles and exactly.
    rough_compass: [f64; 8],
    compass: [OnceCell<Interval>; 8],
}

impl<'a> Board<'a> {
    /// Creates a board between its handles.
    pub fn new(front: &'a Capsule, rear: &'a Capsule, size: Size) -> Self {
        let middle = front.point.minus(&rear.point);
        let length = size.link;
        let overhang = size.hole_inset / length;
        let half_width = size.width * Interval::new(0.5);
        let rough = Rough::new(front, rear, length.rough(), overhang.rough(), half_width.rough());
        let (rough_compass, compass) = (COMPASS.map(|n| rough.extent(n)), Default::default());
        Self { front, rear, middle, length, overhang, half_width, rough, rough_compass, compass }
    }

    /// Returns H(n): an upper bound of n . x over the board.
    fn extent(&self, axis: &Axis) -> Interval {
        let Axis { n, norm } = axis;
        let projected = |capsule: &Capsule| {
            let slack = n.dot(&capsule.tangent).abs() * capsule.half + norm * capsule.sag;
            (n.dot(&capsule.point), slack)
        };
        let ((f, f_slack), (r, r_slack)) = (projected(self.front), projected(self.rear));
        let slack = f_slack + r_slack;
        // Beyond a handle the board reaches e (F - R) further, which is no longer than e l.
        let longest = norm * self.length;
        let beyond = |towards: Interval| self.overhang * (towards + slack).min(&longest);
        let ahead = f + f_slack + beyond(f - r);
        let behind = r + r_slack + beyond(r - f);
        let across = n.cross(&self.middle).abs()
            + n.cross(&self.front.tangent).abs() * self.front.half
            + n.cross(&self.rear.tangent).abs() * self.rear.half
            + norm * (self.front.sag + self.rear.sag);
        ahead.max(&behind) + self.half_width * norm.min(&(across / self.length))
    }

    fn compass_extent(&self, direction: usize) -> &Interval {
        self.compass[direction].get_or_init(|| self.extent(&Axis::new(COMPASS[direction])))
    }

    /// Returns true if one of the eight fixed directions shows that the gap between two boards is more than `metres`.
    pub fn is_clearly_apart_by(&self, metres: &Interval, other: &Self) -> bool {
        let (direction, rough) = self.best_of_compass(other);
        if rough < metres.rough() {
            return false;
        }
        let gap = -(self.compass_extent(direction) + other.compass_extent((direction + 4) % 8));
        // The diagonals are longer than 1, and shorter than 1.5.
        (metres.max(&Interval::new(0.0)) * Interval::new(1.5)).is_below(&gap)
    }

    /// Returns the best of the eight fixed directions by doubles, and its distance in metres.
    fn best_of_compass(&self, other: &Self) -> (usize, f64) {
        let apart = |n: usize| -self.rough_compass[n] - other.rough_compass[(n + 4) % 8];
        (0..8).map(|n| (n, apart(n))).fold((0, f64::NEG_INFINITY), |best, new| if new.1 > best.1 { new } else { best })
    }

    /// Returns true if Lemma 2 shows the two boards to be apart.
    pub fn is_apart_from(&self, other: &Self) -> bool {
        let (_, rough) = self.best_of_compass(other);
        let zero = Interval::new(0.0);
        rough > CLEARLY_APART && self.is_clearly_apart_by(&zero, other)
            || self.is_apart_by(&zero, other)
            || self.is_apart_somehow(&zero, other)
    }

    /// Returns true if Lemma 2 shows that the gap between two boards is more than `metres`, in a direction of their
    /// sides or between them.
    pub fn is_apart_by(&self, metres: &Interval, other: &Self) -> bool {
        let rough = metres.rough();
        let mut axes: Vec<_> =
            self.rough.axes(&other.rough).into_iter().map(|n| (n, self.rough_gap(other, n))).collect();
        axes.retain(|(_, gap)| *gap >= rough);
        axes.sort_by(|a, b| b.1.total_cmp(&a.1));
        axes.iter().take(MOST_TRIES).any(|(n, _)| self.is_apart_along(*n, metres, other))
    }

    /// Returns true if Lemma 2 shows that the gap between two boards is more than `metres`, in any direction.
    pub fn is_apart_somehow(&self, metres: &Interval, other: &Self) -> bool {
        best_direction(|n| self.rough_gap(other, n)).is_some_and(|n| self.is_apart_along(n, metres, other))
    }

    /// Returns a point that is on the same side of each line of Lemma 2 as the board.
    pub fn inner_point(&self) -> &Vector {
        &self.front.point
    }

    /// Returns true if the board is shown to be further than `metres` from the convex hull of some points.
    pub fn is_clear_of(&self, points: &[Vector], metres: &Interval) -> bool {
        self.is_roughly_clear_of(points, metres) || {
            let (rough, at) = (metres.rough(), rough_points(points));
            best_direction(|n| self.rough.gap_to(&at, n) - rough)
                .is_some_and(|n| self.is_clear_along(n, points, metres))
        }
    }

    /// Returns true if one of a few directions shows the board to be further than `metres` from the convex hull of some
    /// points.
    pub fn is_roughly_clear_of(&self, points: &[Vector], metres: &Interval) -> bool {
        let (rough, at) = (metres.rough(), rough_points(points));
        let best = (self.rough.directions_to(&at).into_iter())
            .map(|n| (n, self.rough.gap_to(&at, n) - rough))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        best.is_some_and(|(n, gap)| gap > 0.0 && self.is_clear_along(n, points, metres))
    }

    fn is_clear_along(&self, n: [f64; 2], points: &[Vector], metres: &Interval) -> bool {
        let axis = Axis::new(n);
        let most = self.extent(&axis) + axis.norm * metres;
        points.iter().all(|point| most.is_below(&axis.n.dot(point)))
    }

    fn rough_gap(&self, other: &Self, n: [f64; 2]) -> f64 {
        -self.rough.extent(n) - other.rough.extent([-n[0], -n[1]])
    }

    fn is_apart_along(&self, n: [f64; 2], metres: &Interval, other: &Self) -> bool {
        let axis = Axis::new(n);
        let opposite = Axis { n: Vector { x: -axis.n.x, y: -axis.n.y }, norm: axis.norm };
        (self.extent(&axis) + other.extent(&opposite) + axis.norm * metres).is_negative()
    }
}

fn rough_points(points: &[Vector]) -> Vec<[f64; 2]> {
    points.iter().map(|point| [point.x.rough(), point.y.rough()]).collect()
}

/// Returns the direction with the greatest distance by doubles, if that distance is positive: the best of directions
/// all around, refined by golden sections.
fn best_direction(apart: impl Fn([f64; 2]) -> f64) -> Option<[f64; 2]> {
    let unit = |angle: f64| [angle.cos(), angle.sin()];
    let at = |angle: f64| apart(unit(angle));
    let sector = TAU / SECTORS as f64;
    // The distance has several peaks: each sector that is higher than its neighbours may hold the highest.
    let samples: Vec<f64> = (0..SECTORS).map(|sample| at(sample as f64 * sector)).collect();
    let is_peak = |sample: &usize| {
        let beside = |step: usize| samples[(sample + step) % SECTORS];
        samples[*sample] >= beside(1) && samples[*sample] >= beside(SECTORS - 1)
    };
    let refined = (0..SECTORS).filter(is_peak).map(|sample| {
        let (mut from, mut to) = ((sample as f64 - 1.0) * sector, (sample as f64 + 1.0) * sector);
        while to - from > LEAST_ANGLE {
            let (one, other) = (from + 0.382 * (to - from), to - 0.382 * (to - from));
            if at(one) > at(other) { to = other } else { from = one }
        }
        (unit(from), at(from))
    });
    let (direction, metres) = refined.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (metres > 0.0).then_some(direction)
}

/// The same board in doubles.
struct Rough {
    front: RoughCapsule,
    rear: RoughCapsule,
    length: f64,
    overhang: f64,
    half_width: f64,
}

struct RoughCapsule {
    point: [f64; 2],
    tangent: [f64; 2],
    half: f64,
    sag: f64,
}

impl RoughCapsule {
    fn new(capsule: &Capsule) -> Self {
        let rough = |vector: &Vector| [vector.x.rough(), vector.y.rough()];
        let (half, sag) = (capsule.half.rough(), capsule.sag.rough());
        Self { point: rough(&capsule.point), tangent: rough(&capsule.tangent), half, sag }
    }

    fn projected(&self, n: [f64; 2], norm: f64) -> (f64, f64) {
        (dot(n, self.point), dot(n, self.tangent).abs() * self.half + norm * self.sag)
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

impl Rough {
    fn new(front: &Capsule, rear: &Capsule, length: f64, overhang: f64, half_width: f64) -> Self {
        Self { front: RoughCapsule::new(front), rear: RoughCapsule::new(rear), length, overhang, half_width }
    }

    fn direction(&self) -> [f64; 2] {
        let (front, rear) = (self.front.point, self.rear.point);
        [(front[0] - rear[0]) / self.length, (front[1] - rear[1]) / self.length]
    }

    /// As [`Board::extent`].
    fn extent(&self, n: [f64; 2]) -> f64 {
        let norm = n[0].hypot(n[1]);
        let ((f, f_slack), (r, r_slack)) = (self.front.projected(n, norm), self.rear.projected(n, norm));
        let beyond = |towards: f64| self.overhang * (towards + f_slack + r_slack).min(norm * self.length);
        let (ahead, behind) = (f + f_slack + beyond(f - r), r + r_slack + beyond(r - f));
        let across = cross(n, self.direction()).abs()
            + (cross(n, self.front.tangent).abs() * self.front.half
                + cross(n, self.rear.tangent).abs() * self.rear.half
                + norm * (self.front.sag + self.rear.sag))
                / self.length;
        ahead.max(behind) + self.half_width * norm.min(across)
    }

    /// Returns the distance from the board to points along a unit vector.
    fn gap_to(&self, points: &[[f64; 2]], n: [f64; 2]) -> f64 {
        points.iter().map(|point| dot(n, *point)).fold(f64::INFINITY, f64::min) - self.extent(n)
    }

    /// Returns directions in which points may be apart from the board. The directions are the normals of its edges and
    /// of a side, and the directions between the nearest corners and between the middles.
    fn directions_to(&self, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let [x, y] = self.direction();
        let mut directions = vec![[x, y], [-y, x], [-x, -y], [y, -x]];
        if let [from, to] = points {
            let side = [to[0] - from[0], to[1] - from[1]];
            directions.extend([[-side[1], side[0]], [side[1], -side[0]]]);
        }
        let between = |from: [f64; 2], to: [f64; 2]| [to[0] - from[0], to[1] - from[1]];
        let pairs = self.corners().into_iter().flat_map(|corner| points.iter().map(move |to| between(corner, *to)));
        directions.extend(pairs.min_by(|a, b| dot(*a, *a).total_cmp(&dot(*b, *b))));
        let count = points.len() as f64;
        let middle = points.iter().fold([0.0; 2], |sum, point| [sum[0] + point[0] / count, sum[1] + point[1] / count]);
        let own = [0, 1].map(|axis| 0.5 * (self.front.point[axis] + self.rear.point[axis]));
        directions.push(between(own, middle));
        let unit = |[x, y]: [f64; 2]| [x / x.hypot(y), y / x.hypot(y)];
        directions.into_iter().map(unit).filter(|n| n[0].is_finite() && n[1].is_finite()).collect()
    }

    fn corners(&self) -> [[f64; 2]; 4] {
        let (direction, rear) = (self.direction(), self.rear.point);
        let at = |along: f64, across: f64| {
            let along = along * self.length;
            [
                rear[0] + along * direction[0] - across * direction[1],
                rear[1] + along * direction[1] + across * direction[0],
            ]
        };
        let (e, v) = (self.overhang, self.half_width);
        [at(-e, -v), at(-e, v), at(1.0 + e, -v), at(1.0 + e, v)]
    }

    /// Returns directions in which another board may be apart: the normals of all edges, and the directions between the
    /// nearest corners and between the middles.
    fn axes(&self, other: &Self) -> [[f64; 2]; 10] {
        let of_edges = |board: &Self| {
            let [x, y] = board.direction();
            [[x, y], [-y, x], [-x, -y], [y, -x]]
        };
        let (own, others) = (of_edges(self), of_edges(other));
        let corners =
            self.corners().into_iter().flat_map(|from| other.corners().map(|to| [to[0] - from[0], to[1] - from[1]]));
        let nearest = corners.min_by(|a, b| dot(*a, *a).total_cmp(&dot(*b, *b))).unwrap_or([1.0, 0.0]);
        let middle = |board: &Self| [0, 1].map(|axis| board.front.point[axis] + board.rear.point[axis]);
        let (from, to) = (middle(self), middle(other));
        let [nearest, between] = [nearest, [to[0] - from[0], to[1] - from[1]]].map(|[x, y]| {
            let norm = x.hypot(y);
            [x / norm, y / norm]
        });
        [own[0], own[1], own[2], own[3], others[0], others[1], others[2], others[3], nearest, between]
    }
}

/// Returns true if Lemma 3, *Ring*, shows some boards to be more than `metres` apart from all body boards further out.
/// The handles of these boards, of `width` metres at most, are at most `reach` metres from the centre of the spiral. The
/// handles of the boards further out are at least `ring` metres from it.
pub(super) fn is_inside_ring(
    team: &Team,
    reach: &Interval,
    width: &Interval,
    ring: &Interval,
    metres: &Interval,
) -> bool {
    let [half_link, half_width] = team.behind_head().map(|size| size * Interval::new(0.5));
    let half_own = width * Interval::new(0.5);
    if !half_link.is_below(ring) {
        return false;
    }
    let inner = (ring.square() - half_link.square()).sqrt().min(&(ring - team.hole_inset)) - half_width;
    let outer = reach + (team.hole_inset.square() + half_own.square()).sqrt();
    (outer + metres).is_below(&inner)
}

/// Returns true if a point is in a board for all positions of its handles in their spans (Lemma 5, *Contact*).
pub(super) fn covers(board: &Board, point: &Vector) -> bool {
    let (front, rear, link) = (board.front, board.rear, board.middle);
    let (from_rear, from_front) = (point.minus(&rear.point), point.minus(&front.point));
    // A handle is at most this far from the middle of its capsule.
    let slack = |capsule: &Capsule| (capsule.half + capsule.sag).upper();
    // Bounds of a product of this distance and a vector.
    let moved =
        |capsule: &Capsule, along: Interval, vector: &Vector| along.abs() * capsule.half + vector.norm() * capsule.sag;
    let both = from_rear.plus(&link);
    let off_along = moved(front, from_rear.dot(&front.tangent), &from_rear)
        + moved(rear, both.dot(&rear.tangent), &both)
        + slack(rear) * (slack(rear) + slack(front));
    let off_across = moved(front, from_rear.cross(&front.tangent), &from_rear)
        + moved(rear, from_front.cross(&rear.tangent), &from_front)
        + slack(rear) * slack(front);
    let along = from_rear.dot(&link) + off_along.around_zero();
    let across = from_rear.cross(&link) + off_across.around_zero();
    let squared = board.length.square();
    let margin = board.overhang * squared;
    (-margin).is_at_most(&along)
        && along.is_at_most(&(squared + margin))
        && across.abs().is_at_most(&(board.length * board.half_width))
}
