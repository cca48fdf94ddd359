//! The capsules that hold the points of spans. See "Capsules" in `docs/proofs.md`.

use super::interval::{Interval, Vector, dot, minus, norm, norm_squared, plus, scaled};
use super::path::{ExactPath, of_turns};
use super::place::{Place, Span};
use bench_dragon_motion::placement::Placement;

/// Points and tangents over a span.
#[derive(Debug, Clone, Copy)]
pub(super) struct Capsule {
    /// A place m of the span.
    pub middle: Place,
    /// The point at m.
    pub point: Vector,
    /// The tangent at m.
    pub tangent: Vector,
    /// An upper bound of the distance from m to either end, in metres.
    pub half: f64,
    /// An upper bound of the radius of the disc that is added to the tangent's stretch, in metres.
    pub radius: f64,
    /// An upper bound of the curvature in the span, 1/m.
    pub curvature: f64,
}

/// A span with its end points and its capsule.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spanned {
    pub span: Span,
    pub first: Vector,
    pub last: Vector,
    pub capsule: Capsule,
}

impl Capsule {
    pub fn new(path: &ExactPath, Span(first, last): Span) -> Self {
        let middle = path.middle(first, last);
        let half = path.length(first, middle).max(path.length(middle, last));
        let curvature = path.curvature(first, last);
        let radius = (Interval::point(curvature) * Interval::point(half).square() * 0.5).hi;
        let (point, tangent) = path.at(middle);
        Self { middle, point, tangent, half, radius, curvature }
    }

    /// Returns a bound of |n . x - n . point| over the capsule.
    pub fn reach(&self, n: Vector, length: f64) -> Interval {
        dot(n, self.tangent).abs() * self.half + Interval::point(length) * self.radius
    }

    /// Returns an upper bound of the distance of a point of this capsule from a point of the other.
    pub fn most_apart(&self, other: &Self) -> f64 {
        (norm(minus(self.point, other.point)) + self.slack(other)).hi
    }

    /// Returns an upper bound of the distance of a point of the capsule from its middle.
    pub fn reach_of_all(&self) -> Interval {
        Interval::point(self.half) + Interval::point(self.radius)
    }

    /// Returns an upper bound of the sum of two distances: of a point of each capsule from its middle.
    pub fn slack(&self, other: &Self) -> Interval {
        self.reach_of_all() + other.reach_of_all()
    }

    /// Returns the squared distances of all places of the span from a point, by Taylor's formula.
    pub fn distance_squared(&self, x: Vector) -> Interval {
        let Self { point, tangent, half, radius, .. } = *self;
        let between = minus(point, x);
        let most = norm(between) + Interval::point(half) + Interval::point(radius);
        norm_squared(between) + self.rest(dot(tangent, between).abs(), most)
    }

    /// Returns the squared distances of all places of the span from all of the other's, by Taylor's formula about the
    /// middles of both.
    pub fn distances_squared(&self, other: &Self) -> Interval {
        let along = dot(other.tangent, minus(self.point, other.point)).abs();
        // A bound of the distance along the tangent at the other's middle, for any place of this span.
        let slope = along + dot(other.tangent, self.tangent).abs() * self.half + Interval::point(self.radius);
        self.distance_squared(other.point) + other.rest(slope, Interval::point(self.most_apart(other)))
    }

    /// Encloses the change of the squared distance from a point between the middle and any place of the span. `slope`
    /// is the distance along the tangent at the middle, `most` an upper bound of the distance.
    fn rest(&self, slope: Interval, most: Interval) -> Interval {
        let half = Interval::point(self.half);
        Interval::within((slope * 2.0 * half + (Interval::ONE + most * self.curvature) * half.square()).hi)
    }

    /// Returns t . (u - x) for all u of this capsule and x of the other. t is the tangent at u, or at x.
    pub fn product(&self, other: &Self, at_other: bool) -> Interval {
        let at = if at_other { other } else { self };
        self.component(other, at.tangent, at.turned())
    }

    /// Returns t . (u - x) for all u of this capsule and x of the other, where t is the tangent at x. The bound is from
    /// Taylor's formula of the second order along the other's span. It is infinite if a junction is in the span.
    pub fn second_order_product(&self, path: &ExactPath, other: &Self, Span(first, last): Span) -> Interval {
        let Some(rate) = path.bend_rate(first, last) else { return Interval::within(f64::INFINITY) };
        let Self { middle, point, tangent: [x, y], half, curvature, .. } = *other;
        let (half, bend, between) = (Interval::point(half), path.bend(middle, middle), minus(self.point, point));
        let off = |n: Vector| dot(n, self.tangent).abs() * self.half + Interval::point(self.radius);
        let slope = (bend * dot([-y, x], between) - Interval::ONE).abs() + bend.abs() * off([-y, x]);
        let second = (rate.abs() + Interval::point(curvature).square()) * self.most_apart(other);
        let within = off(other.tangent) + slope * half + second * half.square() * 0.5;
        dot(other.tangent, between) + Interval::within(within.hi)
    }

    /// Returns n . (u - x) for all u of this capsule and x of the other. The vector n is the unit normal to the left at
    /// u, or at x.
    pub fn across(&self, other: &Self, at_other: bool) -> Interval {
        let at = if at_other { other } else { self };
        let [x, y] = at.tangent;
        self.component(other, [-y, x], at.turned())
    }

    /// Returns an upper bound of the difference between a tangent of the span and the tangent at the middle.
    pub fn turned(&self) -> Interval {
        Interval::point(self.curvature) * self.half
    }

    /// Returns n . (u - x) for all u of this capsule, x of the other, and n within `turned` of a unit vector.
    fn component(&self, other: &Self, unit: Vector, turned: Interval) -> Interval {
        let along = |capsule: &Self| dot(unit, capsule.tangent).abs() * capsule.half;
        let off = along(self)
            + along(other)
            + Interval::point(self.radius)
            + Interval::point(other.radius)
            + turned * self.most_apart(other);
        dot(unit, minus(self.point, other.point)) + Interval::within(off.hi)
    }
}

impl Spanned {
    pub fn new(path: &ExactPath, span: Span) -> Self {
        let Span(first, last) = span;
        Self { span, first: path.point(first), last: path.point(last), capsule: Capsule::new(path, span) }
    }
}

/// Returns a capsule moved back along its own tangent, for handles on one straight line.
pub(super) fn moved_back(capsule: &Capsule, metres: Interval) -> Capsule {
    Capsule { point: minus(capsule.point, scaled(capsule.tangent, metres)), ..*capsule }
}

/// The place of a path on the stage.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    origin: Vector,
    cosine: Interval,
    sine: Interval,
    mirrored: bool,
}

/// Rounding of a placement's origin, as a share of its size.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

impl Frame {
    pub fn new(placement: &Placement) -> Self {
        let origin = placement.origin();
        // The origin may be rounded: it holds the start of a route.
        let slack = Interval::within(ROUNDING * (1.0 + origin.x.abs() + origin.y.abs()));
        let turn = of_turns(Interval::point(placement.rotation_turns()));
        let [cosine, sine] = turn.map(|part| part + Interval::within(ROUNDING));
        let origin = [origin.x, origin.y].map(|part| Interval::point(part) + slack);
        Self { origin, cosine, sine, mirrored: placement.is_mirrored() }
    }

    /// Returns a vector of the path on the stage.
    pub fn turned(&self, [x, y]: Vector) -> Vector {
        let y = if self.mirrored { -y } else { y };
        [self.cosine * x - self.sine * y, self.sine * x + self.cosine * y]
    }

    /// Returns a point of the path on the stage.
    pub fn point(&self, point: Vector) -> Vector {
        plus(self.turned(point), self.origin)
    }

    pub fn capsule(&self, capsule: &Capsule) -> Capsule {
        let (point, tangent) = (self.point(capsule.point), self.turned(capsule.tangent));
        Capsule { point, tangent, ..*capsule }
    }
}
