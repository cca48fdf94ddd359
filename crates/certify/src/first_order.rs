//! First-order enclosures (Taylor models) of handles and boards over a step of the head, and of the clearance of two
//! boards. Lemma 6 of `docs/proofs.md`.

use super::boards::Shape;
use super::capsule::{Capsule, Frame, Spanned};
use super::interval::{Interval, Vector, cross, dot, minus, norm, norm_squared, plus, scaled};
use super::path::ExactPath;
use super::place::Place;
use bench_dragon_motion::model::Point;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::separation::{closest_points_board_board, separation_board_board};

/// A handle as `point + tau velocity` plus an error. `tau` is the head's distance in metres from the middle of the
/// step.
#[derive(Debug, Clone, Copy)]
pub(super) struct FirstOrderHandle {
    /// The point of a place m of the path.
    point: Vector,
    /// The tangent at m.
    tangent: Vector,
    /// Velocity along that tangent, metres per metre of the head.
    velocity: Vector,
    /// The speed of the handle over the step, metres per metre of the head.
    rate: Interval,
    /// An upper bound of the metres of path from m to the handle at the middle of the step.
    offset: f64,
    /// An upper bound of the error at the middle of the step, in metres.
    still: f64,
    /// An upper bound of the error anywhere in the step, in metres.
    error: f64,
    /// An upper bound of the curvature in the handle's span, 1/m.
    curvature: f64,
}

/// The motion of the head over a step. For two dragons, tau is a time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    /// The travel of the head per unit of tau, in metres.
    pub rate: Interval,
    /// An upper bound of the metres of path from the head's place to the head in the middle of the step.
    pub offset: f64,
    /// Greatest |tau|.
    pub half_step: f64,
}

impl Pace {
    /// Returns the motion of a head that is `half_step` metres from its place at most, where tau is these metres.
    pub fn in_metres(half_step: f64) -> Self {
        Self { rate: Interval::ONE, offset: 0.0, half_step }
    }
}

/// The number of times that the products of a link are enclosed again from the last enclosure of its rear handle.
const REFINEMENTS: u32 = 3;

/// The factor of the errors: the checker of certificates has other capsules, and its errors may be a little greater.
const SPARE: f64 = 1.01;

/// Moments of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum When {
    /// The head is at the middle of the step.
    Middle,
    /// The head is anywhere in the step.
    Always,
}

/// A direction fixed to a board: components along the board's axis and a quarter turn to the left of it, not both 0.
pub(super) type Direction = [f64; 2];

/// The normals of a board's sides.
pub(super) const SIDES: [Direction; 4] = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];

/// A first-order enclosure of a board, from its two handles.
#[derive(Debug, Clone, Copy)]
pub(super) struct FirstOrderBoard {
    front: FirstOrderHandle,
    rear: FirstOrderHandle,
    link: Interval,
    half_length: Interval,
    half_width: Interval,
    half_step: f64,
}

/// A vector `at + tau by` plus an error.
struct Linear {
    at: Vector,
    by: Vector,
    error: Interval,
}

impl FirstOrderHandle {
    /// Creates the enclosure of the head, at `middle` in the middle of a step.
    pub fn head(path: &ExactPath, span: &Spanned, middle: Place, Pace { rate, offset, half_step }: Pace) -> Self {
        Self::new(path, span, middle, rate, offset, half_step)
    }

    /// Creates the enclosure of a handle that is in a capsule at tau = 0, with velocities in an interval.
    pub fn moving(capsule: &Capsule, velocity: Vector, half_step: f64) -> Self {
        let Capsule { point, tangent, half: offset, curvature, .. } = *capsule;
        let middle = velocity.map(|part| Interval::point(part.middle()));
        let still = capsule.reach_of_all();
        let error = (still + norm(minus(velocity, middle)) * half_step).hi;
        Self { point, tangent, velocity: middle, rate: norm(velocity), offset, still: still.hi, error, curvature }
    }

    fn new(path: &ExactPath, span: &Spanned, place: Place, rate: Interval, offset: f64, half_step: f64) -> Self {
        let curvature = span.capsule.curvature;
        let (point, tangent) = path.at(place);
        let zero = [Interval::ZERO; 2];
        Self { point, tangent, velocity: zero, rate, offset, still: 0.0, error: 0.0, curvature }
            .with_rate(rate, half_step)
    }

    fn with_rate(self, rate: Interval, half_step: f64) -> Self {
        let middle = rate.middle();
        let uneven = (rate - Interval::point(middle)).magnitude();
        let (far, metres) = (Interval::point(rate.magnitude()), Interval::point(half_step));
        let bend = |reach: Interval| reach.square() * 0.5 * self.curvature;
        let off = Interval::point(self.offset);
        let still = (off + bend(off)).hi * SPARE;
        let error = (off + metres * uneven + bend(off + far * metres)).hi * SPARE;
        Self { velocity: scaled(self.tangent, Interval::point(middle)), rate, still, error, ..self }
    }

    /// Creates the enclosure of the next handle, near `place` in the middle of the step. Returns `None` if a bound is
    /// infinite, or if the place is not in the handle's span.
    pub fn follower(
        &self,
        path: &ExactPath,
        spans: (&Spanned, &Spanned),
        place: Place,
        link: Interval,
        half_step: f64,
    ) -> Option<Self> {
        let (front, rear) = spans;
        let is_in_span = path.in_order(rear.span.0, place) && path.in_order(place, rear.span.1);
        if !(is_in_span && path.is_inside(place)) {
            return None;
        }
        let product = front.capsule.product(&rear.capsule, false);
        let rear_product = front.capsule.product(&rear.capsule, true);
        if !rear_product.is_positive() {
            return None;
        }
        let point = path.point(place);
        let miss = (norm_squared(minus(self.point, point)) - link.square()).abs() * 0.5;
        let moved = Interval::point(product.magnitude()) * self.offset;
        let offset = (miss + moved).over(rear_product).hi;
        let (mut product, mut rear_product) = (product, rear_product);
        let mut follower = Self::new(path, rear, place, self.rate * product.over(rear_product), offset, half_step);
        for _ in 0..REFINEMENTS {
            product = meet(product, self.product(self, &follower, link, half_step))?;
            rear_product = meet(rear_product, follower.product(self, &follower, link, half_step))?;
            follower = follower.with_rate(self.rate * product.over(rear_product), half_step);
        }
        follower.error.is_finite().then_some(follower)
    }

    /// Returns the handle moved back `metres` on its straight line.
    pub fn moved_back(&self, metres: Interval) -> Self {
        Self { point: minus(self.point, scaled(self.tangent, metres)), ..*self }
    }

    /// Returns the handle on the stage.
    fn placed(self, frame: &Frame) -> Self {
        let (tangent, velocity) = (frame.turned(self.tangent), frame.turned(self.velocity));
        Self { point: frame.point(self.point), tangent, velocity, ..self }
    }

    /// Returns the tangent of this handle times the link from `rear` to `front`. This handle is one of the two.
    fn product(&self, front: &Self, rear: &Self, link: Interval, half_step: f64) -> Interval {
        let (at, by) = (minus(front.point, rear.point), minus(front.velocity, rear.velocity));
        let error = Interval::point(front.error) + Interval::point(rear.error);
        let (step, turn) = (Interval::within(half_step), self.turn(half_step));
        let aside = cross(self.tangent, at) + cross(self.tangent, by) * step;
        let bend = turn * (aside.abs() + error) + turn.square() * 0.5 * link;
        dot(self.tangent, at) + dot(self.tangent, by) * step + Interval::within((error + bend).hi)
    }

    /// Returns a bound of the angle between the handle's tangent and the tangent at m.
    fn turn(&self, half_step: f64) -> Interval {
        (Interval::point(self.rate.magnitude()) * half_step + Interval::point(self.offset)) * self.curvature
    }

    fn error(&self, when: When) -> Interval {
        Interval::point(if when == When::Middle { self.still } else { self.error })
    }
}

/// Returns the intersection of two intervals that hold the same number.
fn meet(one: Interval, other: Interval) -> Option<Interval> {
    let (lo, hi) = (one.lo.max(other.lo), one.hi.min(other.hi));
    (lo <= hi).then_some(Interval { lo, hi })
}

impl FirstOrderBoard {
    pub fn new(shape: &Shape, front: FirstOrderHandle, rear: FirstOrderHandle, link: Interval, half_step: f64) -> Self {
        let half_length = link * 0.5 + shape.inset;
        Self { front, rear, link, half_length, half_width: shape.half_width, half_step }
    }

    /// Returns the board on the stage.
    pub fn placed(self, frame: &Frame) -> Self {
        Self { front: self.front.placed(frame), rear: self.rear.placed(frame), ..self }
    }

    /// Returns the board in doubles, in the middle of the step.
    pub fn in_doubles(&self) -> Board {
        let [front, rear] = [self.front.point, self.rear.point].map(|point| {
            let [x, y] = point.map(Interval::middle);
            Point::new(x, y)
        });
        let (length, width) = (self.half_length.middle(), self.half_width.middle());
        let board = Board::from_handles(front, rear, 0.0, 2.0 * width);
        Board { half_length: length, ..board }
    }

    /// Returns the vector from the rear handle to the front handle.
    fn along(&self, when: When) -> Linear {
        let Self { front, rear, .. } = self;
        let error = front.error(when) + rear.error(when);
        Linear { at: minus(front.point, rear.point), by: minus(front.velocity, rear.velocity), error }
    }

    /// Returns an enclosure of the gap between this board and another along a direction fixed to this board.
    pub fn gap(&self, other: &Self, direction: Direction, when: When) -> Interval {
        let corners = [(false, false), (false, true), (true, false), (true, true)];
        self.gap_along(direction, corners.map(|corner| other.corner(self, corner, when)), when)
    }

    /// Returns an enclosure of the gap between this board and the convex hull of some points along a direction fixed to
    /// this board. There is at least one point.
    pub fn gap_to(&self, points: &[Vector], direction: Direction, when: When) -> Interval {
        let Self { front, rear, .. } = self;
        let middle = |one: Vector, other: Vector| plus(one, other).map(|sum| sum * 0.5);
        let (at, by) = (middle(front.point, rear.point), middle(front.velocity, rear.velocity));
        let seen = |point: &Vector| {
            let error = (front.error(when) + rear.error(when)) * 0.5;
            Linear { at: minus(*point, at), by: by.map(std::ops::Neg::neg), error }
        };
        self.gap_along(direction, points.iter().map(seen), when)
    }

    /// Returns the gap between this board and points relative to the middle of its handles.
    fn gap_along(&self, direction: Direction, points: impl IntoIterator<Item = Linear>, when: When) -> Interval {
        let along = self.along(when);
        let normal = Linear { at: turned(along.at, direction), by: turned(along.by, direction), error: along.error };
        let size = norm(direction.map(Interval::point));
        let [ahead, left] = direction.map(f64::abs);
        let support = self.half_length * ahead + self.half_width * left;
        let reaches = points.into_iter().map(|point| self.reach(&normal, size, &point, when));
        let least = reaches.reduce(Interval::min).unwrap_or(Interval::point(f64::NEG_INFINITY));
        (least.over(self.link) - support).over(size)
    }

    /// Returns a lower bound of the gap between this board and the convex hull of some points along a direction that
    /// stands still.
    pub fn least_gap_along(&self, n: Direction, points: &[Vector], when: When) -> f64 {
        let axis = n.map(Interval::point);
        let size = norm(axis);
        let step = if when == When::Middle { Interval::ZERO } else { Interval::within(self.half_step) };
        let corners = [(false, false), (false, true), (true, false), (true, true)];
        let most = corners.into_iter().map(|corner| {
            let Linear { at, by, error } = self.corner_on_stage(corner, when);
            dot(axis, at) + dot(axis, by) * step + size * error
        });
        let most = most.map(|reach| reach.hi).fold(f64::NEG_INFINITY, f64::max);
        let gaps = points.iter().map(|point| (dot(axis, *point) - Interval::point(most)).over(size).lo);
        gaps.fold(f64::INFINITY, f64::min)
    }

    /// Returns a corner of this board, relative to the middle of the handles of another.
    fn corner(&self, seen_from: &Self, corner: (bool, bool), when: When) -> Linear {
        let Linear { at, by, error } = self.corner_on_stage(corner, when);
        let middle = |one: Vector, other: Vector| plus(one, other).map(|sum| sum * 0.5);
        let (own_front, own_rear) = (&seen_from.front, &seen_from.rear);
        let own_error = (own_front.error(when) + own_rear.error(when)) * 0.5;
        Linear {
            at: minus(at, middle(own_front.point, own_rear.point)),
            by: minus(by, middle(own_front.velocity, own_rear.velocity)),
            error: error + own_error,
        }
    }

    /// Returns a corner of this board.
    fn corner_on_stage(&self, (ahead, left): (bool, bool), when: When) -> Linear {
        let Self { front, rear, link, half_length, half_width, .. } = self;
        let along = self.along(when);
        // Multiplied by the link vector, these shares are metres.
        let share = half_length.over(*link);
        let share = if ahead { share } else { -share };
        let aside = half_width.over(*link);
        let side = if left { aside } else { -aside };
        let of = |middle: Vector, along: Vector| {
            let across = [-along[1], along[0]];
            plus(middle, plus(scaled(along, share), scaled(across, side)))
        };
        let middle = |one: Vector, other: Vector| plus(one, other).map(|sum| sum * 0.5);
        // The corner is (1/2 + share) front + (1/2 - share) rear + aside: errors have the same factors.
        let half = Interval::point(0.5);
        let error = (half + share).abs() * front.error(when).hi
            + (half - share).abs() * rear.error(when).hi
            + aside * along.error.hi;
        Linear {
            at: of(middle(front.point, rear.point), along.at),
            by: of(middle(front.velocity, rear.velocity), along.by),
            error,
        }
    }

    /// Returns the product of a corner with a normal of length `size` links.
    fn reach(&self, normal: &Linear, size: Interval, corner: &Linear, when: When) -> Interval {
        let half = if when == When::Middle { 0.0 } else { self.half_step };
        let (step, square) = (Interval::within(half), Interval { lo: 0.0, hi: Interval::point(half).square().hi });
        let far = norm(corner.at) + norm(corner.by) * half + corner.error;
        let error = normal.error * size * far.hi + (self.link * size + normal.error * size) * corner.error.hi;
        dot(normal.at, corner.at)
            + (dot(normal.at, corner.by) + dot(normal.by, corner.at)) * step
            + dot(normal.by, corner.by) * square
            + Interval::within(error.hi)
    }

    /// Returns the position of a point of the board in the middle of the step, and a bound of the point's distance from
    /// there. The point is `along` and `aside` of the board's middle.
    fn point(&self, (along, aside): (f64, f64), when: When) -> (Vector, Interval) {
        let Linear { at, .. } = self.along(when);
        let Self { front, rear, link, half_length, half_width, .. } = self;
        let share = |metres: f64, most: Interval| Interval::point(metres.clamp(-most.lo, most.lo)).over(*link);
        let (along, aside) = (share(along, *half_length), share(aside, *half_width));
        let middle = plus(front.point, rear.point).map(|sum| sum * 0.5);
        let point = plus(middle, plus(scaled(at, along), scaled([-at[1], at[0]], aside)));
        let half = if when == When::Middle { 0.0 } else { self.half_step };
        let off = |handle: &FirstOrderHandle| handle.error(when) + norm(handle.velocity) * half;
        (point, (off(front) + off(rear)) * (Interval::point(0.5) + along.abs() + aside.abs()))
    }

    /// Returns an upper bound of the distance of a fixed point from the nearest point of the board. For a point inside
    /// the board at every moment, the distance is minus the least translation that frees the point.
    pub fn at_most_to(&self, target: [f64; 2], when: When) -> f64 {
        let fixed = target.map(Interval::point);
        let gap = |direction| self.gap_to(&[fixed], direction, when).hi;
        let separation = SIDES.map(gap).into_iter().fold(f64::NEG_INFINITY, f64::max);
        if separation <= 0.0 {
            return separation;
        }
        let board = self.in_doubles();
        let offset = Point::from(target) - board.centre;
        let (own, error) = self.point((board.axis.dot(&offset), board.across().dot(&offset)), when);
        (norm(minus(own, fixed)) + error).hi
    }

    /// Returns true if the point of the front handle's place is in the board in the middle of the step. The point must
    /// also stay in the board if the board is moved by `metres`.
    pub fn holds_front_point(&self, metres: f64) -> bool {
        let inset = self.half_length - self.link * 0.5;
        (Interval::point(self.front.still) + Interval::point(metres)).is_below(inset.min(self.half_width))
    }

    /// Returns the point of the front handle's place in the middle of the step, in doubles.
    pub fn front_point(&self) -> [f64; 2] {
        self.front.point.map(Interval::middle)
    }

    /// Returns an upper bound of the clearance of two boards.
    pub fn at_most(&self, other: &Self, when: When) -> f64 {
        let most = |one: &Self, other: &Self| {
            let gap = |direction| one.gap(other, direction, when).hi;
            SIDES.map(gap).into_iter().fold(f64::NEG_INFINITY, f64::max)
        };
        let separation = most(self, other).max(most(other, self));
        if separation <= 0.0 {
            return separation;
        }
        let boards = [self.in_doubles(), other.in_doubles()];
        let (on_self, on_other) = closest_points_board_board(&boards[0], &boards[1]);
        let seen = |board: &Board, point: Point| {
            let offset = point - board.centre;
            (board.axis.dot(&offset), board.across().dot(&offset))
        };
        let (own, own_error) = self.point(seen(&boards[0], on_self), when);
        let (its, its_error) = other.point(seen(&boards[1], on_other), when);
        (norm(minus(own, its)) + own_error + its_error).hi
    }

    /// Returns true if two boards are proved to stay further apart than `metres`. The proof tries the direction of
    /// greatest distance in the middle of the step, then the directions of the faces.
    pub fn is_further_than(&self, metres: f64, other: &Self, when: When) -> bool {
        let boards = [self.in_doubles(), other.in_doubles()];
        let separated = separation_board_board(&boards[0], &boards[1]);
        if separated > 0.0 {
            let (from, to) = closest_points_board_board(&boards[0], &boards[1]);
            let between = to - from;
            let seen = |board: &Board, way: f64| [way * board.axis.dot(&between), way * board.across().dot(&between)];
            // Along a face, the direction fixed to that board loses nothing when the board turns.
            let (own, its) = (seen(&boards[0], 1.0), seen(&boards[1], -1.0));
            let slant = |direction: Direction| direction[0].abs().min(direction[1].abs());
            let along_own = |metres| self.gap(other, own, when).lo > metres;
            let along_its = |metres| other.gap(self, its, when).lo > metres;
            if slant(own) <= slant(its) && along_own(metres) || along_its(metres) || along_own(metres) {
                return true;
            }
        }
        let faces = |own: &Self, other: &Self, [a, b]: [&Board; 2]| {
            let offset = b.centre - a.centre;
            let along = 1f64.copysign(a.axis.dot(&offset));
            let aside = 1f64.copysign(a.across().dot(&offset));
            [[0.0, aside], [along, 0.0]].into_iter().any(|direction| own.gap(other, direction, when).lo > metres)
        };
        faces(self, other, [&boards[0], &boards[1]]) || faces(other, self, [&boards[1], &boards[0]])
    }
}

/// Returns a vector, turned and stretched by a direction relative to `axis`.
fn turned(axis: Vector, [ahead, left]: Direction) -> Vector {
    plus(scaled(axis, Interval::point(ahead)), scaled([-axis[1], axis[0]], Interval::point(left)))
}
