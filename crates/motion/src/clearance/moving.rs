//! Boards that move through a span of time, and bounds of the distance of two of them.
//!
//! **The bound.** Time t runs from -1 to 1 over the span. Every handle is a quadratic polynomial of t with an error of
//! at most `error` metres. The middle of a board is such a polynomial, too, and so is its unit axis u (see below). Take
//! any direction w that is fixed to board a, so that w = p u + q n with p^2 + q^2 = 1 and n the unit normal of a. Between
//! a and b there is the gap
//!
//! (c_b - c_a) . w - h_a(w) - L_b |u_b . w| - W_b |n_b . w|,
//!
//! with the middles c, half the length L_b and width W_b of b, and h_a(w) = L_a |p| + W_a |q|, which is constant. The
//! signed distance is the greatest such gap over all w (where the boards overlap, by the separating axis theorem), so
//! each gap is a lower bound. A gap is the least of four functions, one for each corner of b, each of which is a sum of
//! products of two known quadratics. The powers up to t^2 of every product are kept, and the other powers are bounded
//! by their coefficients. If A and B have errors e and f, and B is a unit vector, then A . B has an error of at most
//! |A| f + e. What remains is the least value of a quadratic between -1 and 1. Motion of b along a does not weaken the
//! bound, at any speed.
//!
//! The distance of any two points, one fixed to each board, bounds the distance of the boards from above.
//!
//! **Links.** No length of a link is assumed. Let v be the polynomial of the link's vector, l its length at 0, and e the
//! sum of the errors of both handles. Between -1 and 1, | |v|^2 - l^2 | is at most the sum of the coefficients of |v|^2
//! beyond the constant one, by size. Divided by l, this sum bounds | |v| - l |, because |v| + l is at least l. So the
//! length of a frame's link is off l by at most d, that bound plus e. Its unit axis is off v / l by at most (d + e) / l,
//! and half its board's length is off by d / 2 (`slack`).

use crate::model::board::Board;
use crate::model::elementary::hypot;
use crate::model::separation::closest_points_board_board;
use crate::model::{Point, Vector};

/// A vector as a quadratic polynomial of t from -1 to 1, by power.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quadratic {
    pub terms: [Vector; 3],
    /// An upper bound of the distance to the true vector, in the vector's unit.
    pub error: f64,
}

impl Quadratic {
    /// Returns an upper bound of the distance of the vector from its value at 0.
    pub(super) fn travel(&self) -> f64 {
        self.terms[1].norm() + self.terms[2].norm() + self.error
    }

    /// Returns the vector from this one to another.
    pub(super) fn to(&self, other: &Self) -> Self {
        other.combine(self, |other, own| other - own, other.error + self.error)
    }

    /// Returns an upper bound of the length: the length of a control point of the quadratic Bezier curve.
    fn greatest_norm(&self) -> f64 {
        let [middle, slope, square] = self.terms;
        let ends = (middle + square + slope).norm_squared().max((middle + square - slope).norm_squared());
        ends.max((middle - square).norm_squared()).sqrt() + self.error
    }

    fn combine(&self, other: &Self, each: impl Fn(Vector, Vector) -> Vector, error: f64) -> Self {
        Self { terms: std::array::from_fn(|power| each(self.terms[power], other.terms[power])), error }
    }

    /// Returns the scalar product with a unit vector: its polynomial and an error bound.
    fn dot(&self, unit: &Self) -> ([f64; 3], f64) {
        let (a, b) = (&self.terms, &unit.terms);
        let dropped = (a[1].dot(&b[2]) + a[2].dot(&b[1])).abs() + a[2].dot(&b[2]).abs();
        let size = a[0].norm() + a[1].norm() + a[2].norm();
        let kept =
            [a[0].dot(&b[0]), a[0].dot(&b[1]) + a[1].dot(&b[0]), a[0].dot(&b[2]) + a[1].dot(&b[1]) + a[2].dot(&b[0])];
        (kept, dropped + self.error + size * unit.error)
    }
}

fn normal(vector: Vector) -> Vector {
    Vector::new(-vector.y, vector.x)
}

/// Returns the least value of a quadratic between -1 and 1.
fn least([constant, slope, square]: [f64; 3]) -> f64 {
    let slope = slope.abs();
    if slope < 2.0 * square { constant - 0.25 * slope * slope / square } else { constant - slope + square }
}

/// A board that moves through a span of time.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingBoard {
    pub centre: Quadratic,
    axis: Quadratic,
    half_length: f64,
    half_width: f64,
    /// The greatest error of half its length, in metres.
    slack: f64,
    /// An upper bound of the distance of its points from their places at 0, in metres; and the same about its centre.
    pub travel: f64,
    turn: f64,
}

impl MovingBoard {
    /// Creates the board between two handles, with `hole_inset` metres of board beyond each and `width` metres across.
    pub(super) fn new([front, rear]: &[Quadratic; 2], hole_inset: f64, width: f64) -> Self {
        let vector = rear.to(front);
        let [middle, slope, square] = &vector.terms;
        let link = middle.norm();
        let by_power = [2.0 * middle.dot(slope), slope.dot(slope) + 2.0 * middle.dot(square), 2.0 * slope.dot(square)];
        let others = by_power.iter().map(|of_power| of_power.abs()).sum::<f64>() + square.dot(square);
        let off = others / link + vector.error;
        let axis = Quadratic { terms: vector.terms.map(|term| term / link), error: (off + vector.error) / link };
        let centre = front.combine(rear, |front, rear| 0.5 * (front + rear), 0.5 * vector.error);
        let (half_length, half_width, slack) = (0.5 * link + hole_inset, 0.5 * width, 0.5 * off);
        let turn = hypot(half_length, half_width) * axis.travel() + slack;
        Self { travel: centre.travel() + turn, centre, axis, half_length, half_width, slack, turn }
    }

    /// Returns the board in the middle of the span, for handles without error.
    pub(super) fn middle(&self) -> Board {
        let Self { half_length, half_width, .. } = *self;
        Board { centre: Point::from(self.centre.terms[0]), axis: self.axis.terms[0], half_length, half_width }
    }

    /// Returns an upper bound of the radius of the circle about the board, in metres.
    pub(super) fn radius(&self) -> f64 {
        hypot(self.half_length, self.half_width) + self.slack
    }

    /// Returns the least gap to `other` along the direction (`along`, `across`) of this board's frame.
    fn least_gap(&self, other: &Self, along: f64, across: f64) -> f64 {
        let direction = Quadratic { terms: self.axis.terms.map(|u| along * u + across * normal(u)), ..self.axis };
        let offset = self.centre.to(&other.centre);
        let other_normal = Quadratic { terms: other.axis.terms.map(normal), ..other.axis };
        let (offset, offset_off) = offset.dot(&direction);
        let (length, length_off) = other.axis.dot(&direction);
        let (width, width_off) = other_normal.dot(&direction);
        let corner = |length_sign: f64, width_sign: f64| {
            let (l, w) = (length_sign * other.half_length, width_sign * other.half_width);
            least(std::array::from_fn(|power| offset[power] + l * length[power] + w * width[power]))
        };
        let nearest = corner(1.0, 1.0).min(corner(1.0, -1.0)).min(corner(-1.0, 1.0).min(corner(-1.0, -1.0)));
        let own = self.half_length * along.abs() + self.half_width * across.abs();
        let off = offset_off + other.half_length * length_off + other.half_width * width_off;
        nearest - own - off - self.slack - other.slack
    }

    /// Returns an upper bound of the displacement of a point of `other` from 0, seen from a point of this board,
    /// metres.
    pub(super) fn relative_travel(&self, other: &Self) -> f64 {
        self.centre.to(&other.centre).travel() + self.turn + other.turn
    }

    /// Returns true if the centre of `other` may be within `distance` metres of this board's at some time. This needs no
    /// square root.
    pub(super) fn may_be_within(&self, distance: f64, other: &Self) -> bool {
        let [middle, slope, square] = self.centre.to(&other.centre).terms;
        let travel = slope.x.abs() + slope.y.abs() + square.x.abs() + square.y.abs();
        let most = distance + travel + self.centre.error + other.centre.error;
        middle.norm_squared() <= most * most
    }

    /// Returns a lower bound of the signed distance to `other` throughout the span: the least gap along the direction in
    /// which the boards are nearest in the middle. `at` and `other_at` are the two boards there.
    pub(super) fn least_distance(&self, at: &Board, other: &Self, other_at: &Board) -> f64 {
        let (on_own, on_other) = closest_points_board_board(at, other_at);
        let direction = direction(at, other_at, on_other - on_own);
        let [own, others] = [at, other_at].map(|board| (direction.dot(&board.axis), direction.dot(&board.across())));
        // The bound is tightest if an edge's normal is fixed to the board of that edge.
        if own.0.abs().min(own.1.abs()) <= others.0.abs().min(others.1.abs()) {
            self.least_gap(other, own.0, own.1)
        } else {
            other.least_gap(self, -others.0, -others.1)
        }
    }

    /// Returns an upper bound of the same: the greatest distance of the points that are closest in the middle.
    pub(super) fn greatest_distance(&self, at: &Board, other: &Self, other_at: &Board) -> f64 {
        let (on_own, on_other) = closest_points_board_board(at, other_at);
        self.fixed(at, on_own).to(&other.fixed(other_at, on_other)).greatest_norm()
    }

    /// Returns the point fixed to the board that is at `point` when the board is at `at`.
    fn fixed(&self, at: &Board, point: Point) -> Quadratic {
        let offset = point - at.centre;
        let along = offset.dot(&at.axis).clamp(-self.half_length, self.half_length);
        let across = offset.dot(&at.across()).clamp(-self.half_width, self.half_width);
        let error = self.centre.error + hypot(along, across) * self.axis.error + self.slack;
        self.centre.combine(&self.axis, |centre, axis| centre + along * axis + across * normal(axis), error)
    }
}

/// Returns the direction from `a` to `b` along which the gap between them is greatest, given the vector between their
/// closest points.
fn direction(a: &Board, b: &Board, between: Vector) -> Vector {
    let length = between.norm();
    if length == 0.0 {
        return a.across();
    }
    // Between the deepest points of overlapping boards the vector is reversed.
    let sign = if between.dot(&(b.centre - a.centre)) < 0.0 { -1.0 } else { 1.0 };
    between * (sign / length)
}
