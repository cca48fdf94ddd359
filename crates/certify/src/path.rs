//! The path in intervals: places, points, tangents, and bounds of curvature, length and turning. See the definitions in
//! `docs/proofs.md`.

use serde::Serialize;

use super::elementary::{atan, ln, pi, sin_cos};
use super::interval::{Interval, Vector, cross, plus, scaled};
use bench_dragon_motion::model::curve::Side;
use bench_dragon_motion::model::description::{PathDescription, RouteStep};

/// A place on the path: a segment, counted from 0, and a coordinate on it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Place(pub usize, pub f64);

/// A curve of the path.
#[derive(Debug, Clone, Copy)]
pub(super) enum Curve {
    Inward { a: Interval },
    Outward { a: Interval },
    Line { origin: Vector, direction: Vector },
    Arc { origin: Vector, direction: Vector, inward: Vector, radius: Interval },
}

/// A segment: its curve, and its first and last coordinates in the direction of travel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    pub curve: Curve,
    pub begin: Interval,
    pub end: Interval,
    /// Travel of the head at the segment's start, metres; for the first segment, at its end.
    travelled: Interval,
}

/// The path.
#[derive(Debug, Clone)]
pub(super) struct ExactPath {
    pub segments: Vec<Segment>,
}

const FAR: f64 = f64::INFINITY;

impl Curve {
    /// Returns true if the coordinate grows with travel.
    fn grows(&self) -> bool {
        !matches!(self, Self::Inward { .. })
    }

    pub fn point(&self, at: f64) -> Vector {
        self.point_of(Interval::point(at), sin_cos(at))
    }

    /// Returns the point at a coordinate from the coordinate's sine and cosine.
    fn point_of(&self, at: Interval, (sine, cosine): (Interval, Interval)) -> Vector {
        match *self {
            Self::Inward { a } => scaled([cosine, sine], a * at),
            Self::Outward { a } => scaled([cosine, sine], -(a * at)),
            Self::Line { origin, direction } => plus(origin, scaled(direction, at)),
            Self::Arc { origin, direction, inward, radius } => {
                let versine = Interval::ONE - cosine;
                plus(origin, scaled(plus(scaled(direction, sine), scaled(inward, versine)), radius))
            }
        }
    }

    pub fn tangent(&self, at: f64) -> Vector {
        self.tangent_of(Interval::point(at), sin_cos(at))
    }

    fn tangent_of(&self, at: Interval, (sine, cosine): (Interval, Interval)) -> Vector {
        match *self {
            Self::Inward { .. } | Self::Outward { .. } => {
                let per_metre = -Interval::ONE.over((Interval::ONE + at.square()).sqrt());
                scaled([cosine - at * sine, sine + at * cosine], per_metre)
            }
            Self::Line { direction, .. } => direction,
            Self::Arc { direction, inward, .. } => plus(scaled(direction, cosine), scaled(inward, sine)),
        }
    }

    /// Returns the curvatures between two coordinates, 1/m, positive to the left.
    fn bend(&self, one: f64, other: f64) -> Interval {
        let of_spiral = |a: Interval| {
            let at = |theta: f64| {
                let square = Interval::point(theta).square();
                let w = (Interval::ONE + square).sqrt();
                (square + Interval::point(2.0)).over(a * w * w.square())
            };
            Interval { lo: at(one.max(other)).lo.max(0.0), hi: at(one.min(other)).hi }
        };
        match *self {
            Self::Inward { a } => -of_spiral(a),
            Self::Outward { a } => of_spiral(a),
            Self::Line { .. } => Interval::ZERO,
            Self::Arc { direction, inward, radius, .. } => {
                let bend = Interval::ONE.over(radius);
                if cross(direction, inward).is_positive() { bend } else { -bend }
            }
        }
    }

    /// Returns the rate of the curvature between two coordinates, 1/m per metre of travel: -theta (theta^2 + 4) / (a^2
    /// w^6).
    fn bend_rate(&self, one: f64, other: f64) -> Interval {
        match *self {
            Self::Inward { a } | Self::Outward { a } => {
                let theta = Interval { lo: one.min(other), hi: one.max(other) };
                let (square, w_square) = (theta.square(), Interval::ONE + theta.square());
                -(theta * (square + Interval::point(4.0))).over((a * w_square).square() * w_square)
            }
            Self::Line { .. } | Self::Arc { .. } => Interval::ZERO,
        }
    }

    /// Returns an upper bound of the metres between two coordinates.
    fn length(&self, one: Interval, other: Interval) -> f64 {
        let between = (one - other).abs();
        match *self {
            Self::Inward { a } | Self::Outward { a } => {
                (between * a * (Interval::ONE + one.max(other).square()).sqrt()).hi
            }
            Self::Line { .. } => between.hi,
            Self::Arc { radius, .. } => (between * radius).hi,
        }
    }

    /// Returns an upper bound of the radians by which the path turns between two coordinates.
    fn turning(&self, one: Interval, other: Interval) -> f64 {
        let between = (one - other).abs();
        match *self {
            Self::Inward { .. } | Self::Outward { .. } => {
                let square = one.min(other).max(Interval::ZERO).square();
                (between * (square + Interval::point(2.0)).over(square + Interval::ONE)).hi
            }
            Self::Line { .. } => 0.0,
            Self::Arc { .. } => between.hi,
        }
    }
}

/// Returns the metres of a spiral from its centre to theta: a/2 (theta w + asinh theta), asinh theta = ln(theta + w).
fn spiral_length(a: Interval, theta: Interval) -> Interval {
    let w = (Interval::ONE + theta.square()).sqrt();
    a * (theta * w + ln(theta + w)) * 0.5
}

impl ExactPath {
    /// Creates the path of a scene.
    pub fn new(description: &PathDescription) -> Self {
        match description {
            PathDescription::Spiral { pitch, start_turn } => {
                let a = Interval::point(*pitch).over(pi() * 2.0);
                let length = spiral_length(a, pi() * 2.0 * *start_turn);
                Self::inward(a, length)
            }
            PathDescription::Turnaround { pitch, turn_radius, arc_ratio, lead_in, lead_out: _ } => {
                let a = Interval::point(*pitch).over(pi() * 2.0);
                let theta = Interval::point(*turn_radius).over(a);
                let both = (Interval::point(*turn_radius).square() + a.square()).sqrt();
                let second_radius = both.over(Interval::ONE + Interval::point(*arc_ratio));
                let first_radius = second_radius * *arc_ratio;
                let angle = atan(theta) * 2.0;
                let turn = sin_cos_of(theta);
                let inward = Curve::Inward { a };
                let (start, tangent) = (inward.point_of(theta, turn), inward.tangent_of(theta, turn));
                let right: Vector = [tangent[1], -tangent[0]];
                let first = Curve::Arc { origin: start, direction: tangent, inward: right, radius: first_radius };
                // The end of arc 2 and its tangent are known. Its begin is `angle` radians back.
                let (sine, cosine) = sin_cos_of(angle);
                let middle = first.point_of(angle, (sine, cosine));
                let direction = first.tangent_of(angle, (sine, cosine));
                let left: Vector = [-direction[1], direction[0]];
                let second = Curve::Arc { origin: middle, direction, inward: left, radius: second_radius };
                let lead_in = Interval::point(*lead_in);
                let arc_end = lead_in + first_radius * angle;
                let (zero, far) = (Interval::ZERO, Interval::point(FAR));
                let segments = vec![
                    Segment { curve: inward, begin: far, end: theta, travelled: lead_in },
                    Segment { curve: first, begin: zero, end: angle, travelled: lead_in },
                    Segment { curve: second, begin: zero, end: angle, travelled: arc_end },
                    Segment {
                        curve: Curve::Outward { a },
                        begin: theta,
                        end: far,
                        travelled: arc_end + second_radius * angle,
                    },
                ];
                Self { segments }
            }
            PathDescription::Route { start, heading_turns, steps } => {
                route([start.x, start.y].map(Interval::point), *heading_turns, steps)
            }
        }
    }

    /// Creates an inward spiral alone, of `a` metres per radian. The head reaches its end at the centre after
    /// `travelled` metres.
    pub fn inward(a: Interval, travelled: Interval) -> Self {
        let (curve, begin) = (Curve::Inward { a }, Interval::point(FAR));
        Self { segments: vec![Segment { curve, begin, end: Interval::ZERO, travelled }] }
    }

    /// Returns the curve at a place.
    pub fn curve(&self, place: Place) -> &Curve {
        &self.segments[place.0].curve
    }

    /// Returns true if `x` is before `y` on the path, or equal.
    pub fn in_order(&self, x: Place, y: Place) -> bool {
        x.0 < y.0 || x.0 == y.0 && if self.curve(x).grows() { x.1 <= y.1 } else { x.1 >= y.1 }
    }

    /// Returns true if a place is strictly inside its segment. The last segment continues beyond its end, but not
    /// through a centre.
    pub fn is_inside(&self, Place(segment, at): Place) -> bool {
        let Some(Segment { curve, begin, end, .. }) = self.segments.get(segment) else { return false };
        let last = segment + 1 == self.segments.len();
        if !at.is_finite() {
            return false;
        }
        if curve.grows() {
            at > begin.hi && (last || at < end.lo)
        } else {
            at < begin.lo && if last { at >= 0.0 } else { at > end.hi }
        }
    }

    /// Returns a place `metres` further on, or back if negative, strictly inside its segment. The distance is about
    /// `metres`, and never less.
    pub fn moved(&self, place: Place, metres: f64) -> Place {
        let Place(segment, at) = place;
        let Segment { curve, begin, end, .. } = &self.segments[segment];
        let rate = match curve {
            Curve::Inward { a } | Curve::Outward { a } => a.lo * 1f64.hypot(at),
            Curve::Line { .. } => 1.0,
            Curve::Arc { radius, .. } => radius.lo,
        };
        let by = 1.0001 * metres / rate;
        let moved = if curve.grows() { at + by } else { at - by };
        let moved = if moved != at || metres == 0.0 {
            moved
        } else if (metres > 0.0) == curve.grows() {
            at.next_up()
        } else {
            at.next_down()
        };
        let moved = Place(segment, moved);
        if self.is_inside(moved) {
            return moved;
        }
        let last = segment + 1 == self.segments.len();
        if metres >= 0.0 && last {
            // The centre of a spiral.
            return Place(segment, end.hi);
        }
        let beyond = if metres >= 0.0 { self.after(segment) } else { self.before(segment) };
        // The first segment has no beginning to fall off.
        beyond.unwrap_or(Place(segment, begin.middle()))
    }

    /// Returns the first place that is surely on the segment after this one.
    fn after(&self, segment: usize) -> Option<Place> {
        let Segment { curve, begin, .. } = self.segments.get(segment + 1)?;
        Some(Place(segment + 1, if curve.grows() { begin.hi.next_up() } else { begin.lo.next_down() }))
    }

    /// Returns the last place that is surely on the segment before this one.
    fn before(&self, segment: usize) -> Option<Place> {
        let before = segment.checked_sub(1)?;
        Some(self.last_inside(before))
    }

    fn last_inside(&self, segment: usize) -> Place {
        let Segment { curve, end, .. } = &self.segments[segment];
        Place(segment, if curve.grows() { end.lo.next_down() } else { end.hi.next_up() })
    }

    /// Returns a place between two: the middle on one segment, else the end of the earlier segment or the beginning of
    /// the later one. `None` if there is none.
    pub fn between(&self, x: Place, y: Place) -> Option<Place> {
        if x.0 == y.0 {
            let middle = 0.5 * x.1 + 0.5 * y.1;
            return (middle != x.1 && middle != y.1).then_some(Place(x.0, middle));
        }
        let end = self.last_inside(x.0);
        if x != end && self.in_order(x, end) {
            return Some(end);
        }
        self.after(x.0).filter(|begin| *begin != y && self.in_order(*begin, y))
    }

    /// Returns the sum over the stretches of segments between two places.
    fn sum(&self, x: Place, y: Place, of: impl Fn(&Curve, Interval, Interval) -> f64) -> f64 {
        let mut sum = Interval::ZERO;
        for segment in x.0..=y.0 {
            let Segment { curve, begin, end, .. } = &self.segments[segment];
            let from = if segment == x.0 { Interval::point(x.1) } else { *begin };
            let to = if segment == y.0 { Interval::point(y.1) } else { *end };
            sum = sum + Interval::point(of(curve, from, to));
        }
        sum.hi
    }

    /// Returns an upper bound of the metres between two places.
    pub fn length(&self, x: Place, y: Place) -> f64 {
        self.sum(x, y, Curve::length)
    }

    /// Returns an upper bound of the radians by which the path turns between two places.
    pub fn turning(&self, x: Place, y: Place) -> f64 {
        self.sum(x, y, Curve::turning)
    }

    /// Returns an upper bound of the curvature between two places, 1/m.
    pub fn curvature(&self, x: Place, y: Place) -> f64 {
        self.bend(x, y).magnitude()
    }

    /// Returns the curvatures between two places, 1/m, positive to the left.
    pub fn bend(&self, x: Place, y: Place) -> Interval {
        let bends = (x.0..=y.0).map(|segment| {
            let Segment { curve, begin, end, .. } = &self.segments[segment];
            // A place that is outside the segment by rounding bends more, if anything.
            let from = if segment == x.0 { x.1 } else { begin.lo };
            let to = if segment == y.0 { y.1 } else { end.lo };
            curve.bend(from, to)
        });
        let hull = |a: Interval, b: Interval| Interval { lo: a.lo.min(b.lo), hi: a.hi.max(b.hi) };
        bends.reduce(hull).unwrap_or(Interval::ZERO)
    }

    /// Returns the rate of the curvature between two places of one segment, 1/m per metre; `None` for places of two
    /// segments.
    pub fn bend_rate(&self, x: Place, y: Place) -> Option<Interval> {
        (x.0 == y.0).then(|| self.curve(x).bend_rate(x.1, y.1))
    }

    /// Returns the travel of the head at a place, metres.
    pub fn travelled(&self, Place(segment, at): Place) -> Interval {
        let Segment { curve, begin, end, travelled } = &self.segments[segment];
        let at = Interval::point(at);
        let reference = if begin.lo.is_infinite() { *end } else { *begin };
        match *curve {
            Curve::Inward { a } => *travelled - (spiral_length(a, at) - spiral_length(a, reference)),
            Curve::Outward { a } => *travelled + (spiral_length(a, at) - spiral_length(a, reference)),
            Curve::Line { .. } => *travelled + (at - reference),
            Curve::Arc { radius, .. } => *travelled + radius * (at - reference),
        }
    }
}

/// Creates a route: a line without a beginning up to the start, then the steps.
fn route(start: Vector, heading_turns: f64, steps: &[RouteStep]) -> ExactPath {
    let (zero, mut turns) = (Interval::ZERO, Interval::point(heading_turns));
    let mut origin = start;
    let (mut direction, mut travelled) = (of_turns(turns), zero);
    let curve = Curve::Line { origin, direction };
    let mut segments = vec![Segment { curve, begin: Interval::point(-FAR), end: zero, travelled: zero }];
    for step in steps {
        let (curve, end, length) = match *step {
            RouteStep::Line { length } => {
                let length = Interval::point(length);
                (Curve::Line { origin, direction }, length, length)
            }
            RouteStep::Arc { side, radius, turns: by } => {
                let [x, y] = direction;
                let inward = if side == Side::Left { [-y, x] } else { [y, -x] };
                let radius = Interval::point(radius);
                let angle = pi() * 2.0 * by;
                turns = if side == Side::Left { turns + Interval::point(by) } else { turns - Interval::point(by) };
                (Curve::Arc { origin, direction, inward, radius }, angle, radius * angle)
            }
        };
        segments.push(Segment { curve, begin: zero, end, travelled });
        travelled = travelled + length;
        origin = curve.point_of(end, sin_cos_of(end));
        direction = of_turns(turns);
    }
    ExactPath { segments }
}

/// Returns the direction `turns` turns counter-clockwise from x.
fn of_turns(turns: Interval) -> Vector {
    let (sine, cosine) = sin_cos_of(pi() * 2.0 * turns);
    [cosine, sine]
}

/// Returns sine and cosine of an interval: those of its middle, each off by no more than the interval's radius.
fn sin_cos_of(x: Interval) -> (Interval, Interval) {
    let middle = x.middle();
    let radius = (x - Interval::point(middle)).magnitude();
    let (sine, cosine) = sin_cos(middle);
    (sine + Interval::within(radius), cosine + Interval::within(radius))
}
