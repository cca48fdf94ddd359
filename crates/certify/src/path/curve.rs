//! The curves of a path in intervals. See the definitions in `docs/proofs.md`.

use crate::elementary::{ln, sin_cos};
use crate::interval::{Interval, Vector, cross, plus, scaled};
use crate::place::Place;

/// A curve of the path. The coordinate of a spiral is the polar angle. `shift` is the distance from the centre in units
/// of a, minus the polar angle, which is 0 except for turnarounds that are turned: see
/// [`super::ExactPath::turnaround`].
#[derive(Debug, Clone, Copy)]
pub(crate) enum Curve {
    Inward { a: Interval, shift: Interval, frame: Option<Frame> },
    Outward { a: Interval, shift: Interval, frame: Option<Frame> },
    Line { origin: Vector, direction: Vector },
    Arc { origin: Vector, direction: Vector, inward: Vector, radius: Interval },
}

/// The place of a route's spiral: the spiral about the origin is mirrored, rotated and moved.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub(super) centre: Vector,
    /// Cosine and sine of the rotation.
    pub(super) rotation: Vector,
    /// True if y goes to -y first.
    pub(super) is_mirrored: bool,
}

impl Frame {
    pub(super) fn vector(&self, [x, y]: Vector) -> Vector {
        let ([cosine, sine], y) = (self.rotation, if self.is_mirrored { -y } else { y });
        [cosine * x - sine * y, sine * x + cosine * y]
    }
}

/// Returns a curvature to the left, or its rate, in a frame.
fn bend_in(frame: Option<Frame>, bend: Interval) -> Interval {
    if frame.is_some_and(|frame| frame.is_mirrored) { -bend } else { bend }
}

impl Curve {
    /// Returns true if the coordinate grows with travel.
    pub(super) fn grows(&self) -> bool {
        !matches!(self, Self::Inward { .. })
    }

    /// Returns true if the curve has no curvature anywhere.
    pub fn is_straight(&self) -> bool {
        matches!(self, Self::Line { .. })
    }

    /// Returns true if the curvature is the same everywhere, so that two handles on the curve move as a rigid body.
    pub fn has_constant_curvature(&self) -> bool {
        matches!(self, Self::Line { .. } | Self::Arc { .. })
    }

    /// Returns the point at 0 of an arc.
    pub fn arc_origin(&self) -> Option<Vector> {
        if let Self::Arc { origin, .. } = self { Some(*origin) } else { None }
    }

    /// Returns the polar angle at a coordinate of a spiral; 0 for a line or an arc.
    pub fn polar_angle(&self, coordinate: f64) -> f64 {
        if matches!(self, Self::Inward { .. } | Self::Outward { .. }) { coordinate } else { 0.0 }
    }

    /// Returns a lower bound of the distance from the centre, metres, for a coordinate and all places behind it on the
    /// path. Returns minus infinity if unknown.
    pub fn distance_from_centre(&self, coordinate: f64) -> f64 {
        match self {
            Self::Inward { a, shift, .. } => (*a * coordinate + *a * *shift).lo,
            _ => f64::NEG_INFINITY,
        }
    }

    /// Returns true if no handle behind the handle at a coordinate is faster than that handle. Links are at most
    /// `longest` metres. See "Lemma 7" in `docs/proofs.md`. Precondition: the shift is 0.
    pub fn slows_followers(&self, coordinate: f64, longest: Interval) -> bool {
        match self {
            Self::Inward { a, .. } => {
                let square = Interval::point(coordinate).square();
                let turned = longest * (square + Interval::point(2.0));
                turned.is_below(*a * coordinate * 2.0 * (square + Interval::ONE))
            }
            _ => self.is_straight(),
        }
    }

    pub fn point(&self, place: Place) -> Vector {
        self.point_of([Interval::point(place.1), Interval::point(place.2)], sin_cos_at(place))
    }

    /// Returns the point at a coordinate, the sum of two numbers, from the coordinate's sine and cosine.
    pub(super) fn point_of(&self, at: [Interval; 2], (sine, cosine): (Interval, Interval)) -> Vector {
        let times = |factor: Interval| {
            let [high, low] = at;
            if low == Interval::ZERO { factor * high } else { factor * high + factor * low }
        };
        match *self {
            Self::Inward { a, shift, frame } => placed(frame, scaled([cosine, sine], shifted(times(a), a, shift))),
            Self::Outward { a, shift, frame } => placed(frame, scaled([cosine, sine], -shifted(times(a), a, shift))),
            Self::Line { origin, direction } => plus(origin, direction.map(times)),
            Self::Arc { origin, direction, inward, radius } => {
                let versine = Interval::ONE - cosine;
                plus(origin, scaled(plus(scaled(direction, sine), scaled(inward, versine)), radius))
            }
        }
    }

    /// Returns the point of a place, and the tangent there.
    pub fn at(&self, place: Place) -> (Vector, Vector) {
        let sin_cos = sin_cos_at(place);
        let at = [Interval::point(place.1), Interval::point(place.2)];
        (self.point_of(at, sin_cos), self.tangent_of(place.coordinate(), sin_cos))
    }

    pub(super) fn tangent_of(&self, at: Interval, (sine, cosine): (Interval, Interval)) -> Vector {
        match *self {
            Self::Inward { shift, frame, .. } | Self::Outward { shift, frame, .. } => {
                let at = shifted(at, Interval::ONE, shift);
                let per_metre = -Interval::ONE.over((Interval::ONE + at.square()).sqrt());
                let tangent = scaled([cosine - at * sine, sine + at * cosine], per_metre);
                frame.map_or(tangent, |frame| frame.vector(tangent))
            }
            Self::Line { direction, .. } => direction,
            Self::Arc { direction, inward, .. } => plus(scaled(direction, cosine), scaled(inward, sine)),
        }
    }

    /// Returns the curvatures between two coordinates, 1/m, positive to the left.
    pub(super) fn bend(&self, least: f64, greatest: f64) -> Interval {
        let of_spiral = |a: Interval, shift: Interval| {
            let at = |theta: f64| {
                let square = shifted(Interval::point(theta), Interval::ONE, shift).square();
                let w = (Interval::ONE + square).sqrt();
                (square + Interval::point(2.0)).over(a * w * w.square())
            };
            Interval { lo: at(greatest).lo.max(0.0), hi: at(least).hi }
        };
        match *self {
            Self::Inward { a, shift, frame } => bend_in(frame, -of_spiral(a, shift)),
            Self::Outward { a, shift, frame } => bend_in(frame, of_spiral(a, shift)),
            Self::Line { .. } => Interval::ZERO,
            Self::Arc { direction, inward, radius, .. } => {
                let bend = Interval::ONE.over(radius);
                if cross(direction, inward).is_positive() { bend } else { -bend }
            }
        }
    }

    /// Returns the rate of the curvature between two coordinates, 1/m per metre of travel: -theta (theta^2 + 4) / (a^2
    /// w^6).
    pub(super) fn bend_rate(&self, one: Interval, other: Interval) -> Interval {
        match *self {
            Self::Inward { a, shift, frame } | Self::Outward { a, shift, frame } => {
                let theta = Interval { lo: one.min(other).lo, hi: one.max(other).hi };
                let theta = shifted(theta, Interval::ONE, shift);
                let (square, w_square) = (theta.square(), Interval::ONE + theta.square());
                let rate = -(theta * (square + Interval::point(4.0))).over((a * w_square).square() * w_square);
                bend_in(frame, rate)
            }
            Self::Line { .. } | Self::Arc { .. } => Interval::ZERO,
        }
    }

    /// Returns the metres per unit of the coordinate, between two coordinates.
    pub(super) fn metres_per_unit(&self, one: Interval, other: Interval) -> Interval {
        match *self {
            Self::Inward { a, shift, .. } | Self::Outward { a, shift, .. } => {
                let theta = Interval { lo: one.min(other).lo, hi: one.max(other).hi };
                a * (Interval::ONE + shifted(theta, Interval::ONE, shift).square()).sqrt()
            }
            Self::Line { .. } => Interval::ONE,
            Self::Arc { radius, .. } => radius,
        }
    }

    /// Returns an upper bound of the radians by which the path turns between two coordinates that are `between` apart.
    pub(super) fn turning(&self, between: Interval, one: Interval, other: Interval) -> f64 {
        match *self {
            Self::Inward { shift, .. } | Self::Outward { shift, .. } => {
                let square = shifted(one.min(other), Interval::ONE, shift).max(Interval::ZERO).square();
                (between * (square + Interval::point(2.0)).over(square + Interval::ONE)).hi
            }
            Self::Line { .. } => 0.0,
            Self::Arc { .. } => between.hi,
        }
    }
}

/// Returns a number of a spiral, the multiple `unit` of the coordinate, with the coordinate moved by `shift`.
pub(super) fn shifted(number: Interval, unit: Interval, shift: Interval) -> Interval {
    if shift == Interval::ZERO { number } else { number + unit * shift }
}

/// Returns the metres of a spiral from its centre to theta: a/2 (theta w + asinh theta), asinh theta = ln(theta + w).
pub(super) fn spiral_length(a: Interval, theta: Interval) -> Interval {
    let w = (Interval::ONE + theta.square()).sqrt();
    a * (theta * w + ln(theta + w)) * 0.5
}

/// Returns a point in a frame.
fn placed(frame: Option<Frame>, point: Vector) -> Vector {
    frame.map_or(point, |frame| plus(frame.centre, frame.vector(point)))
}

/// Returns sine and cosine of a coordinate: those of its first double, turned by the second one, whose square bounds
/// the error.
pub(super) fn sin_cos_at(Place(_, at, rest): Place) -> (Interval, Interval) {
    let (sine, cosine) = sin_cos(at);
    if rest == 0.0 {
        return (sine, cosine);
    }
    let error = Interval::within((Interval::point(rest).square()).hi);
    (sine + cosine * rest + error, cosine - sine * rest + error)
}

/// Returns sine and cosine of an interval: those of its middle, each off by no more than the interval's radius.
pub(super) fn sin_cos_of(x: Interval) -> (Interval, Interval) {
    let middle = x.middle();
    let radius = (x - Interval::point(middle)).magnitude();
    let (sine, cosine) = sin_cos(middle);
    (sine + Interval::within(radius), cosine + Interval::within(radius))
}
