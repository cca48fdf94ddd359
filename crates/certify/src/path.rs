//! The path in intervals: points, tangents, and bounds of curvature, length and turning. See the definitions in
//! `docs/proofs.md`.

mod curve;

use super::elementary::{atan, pi};
use super::interval::{Interval, Vector, minus, scaled};
use super::place::{Place, Span};
use bench_dragon_motion::model::curve::Side;
use bench_dragon_motion::model::description::{PathDescription, RouteStep};
use bench_dragon_motion::model::double_double::DoubleDouble;
use bench_dragon_motion::model::spiral::Direction;
pub(crate) use curve::Curve;
use curve::{Frame, shifted, sin_cos_at, sin_cos_of, spiral_length};

/// A segment: its curve, and its first and last coordinates in the direction of travel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    pub curve: Curve,
    pub begin: Interval,
    pub end: Interval,
    /// The travel of the head at the segment's start, in metres; for the first segment, at its end.
    travelled: Interval,
}

/// The path.
#[derive(Debug, Clone)]
pub(super) struct ExactPath {
    pub segments: Vec<Segment>,
}

const FAR: f64 = f64::INFINITY;

/// Room for the rounding of the ends of a span: a factor, and units of the coordinate.
const WIDER: f64 = 1.0001;
const LEAST: f64 = 1e-28;

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
                Self::turnaround(*pitch, Interval::point(*turn_radius), *arc_ratio, None, *lead_in)
            }
            PathDescription::Route { heading_turns, steps } => route(*heading_turns, steps),
        }
    }

    /// Creates all turnarounds whose turn radius is in an interval. With `turned`, each is turned about the centre so
    /// that A has this polar angle. Then the spirals too depend on the radius, but all places move little with the
    /// radius.
    pub fn turnaround(pitch: f64, turn_radius: Interval, arc_ratio: f64, turned: Option<f64>, lead_in: f64) -> Self {
        let a = Interval::point(pitch).over(pi() * 2.0);
        let theta = turn_radius.over(a);
        let at_turn = turned.map_or(theta, Interval::point);
        let shift = turned.map_or(Interval::ZERO, |turned| theta - Interval::point(turned));
        let both = (turn_radius.square() + a.square()).sqrt();
        let ratio = Interval::point(arc_ratio);
        let second_radius = both.over(Interval::ONE + ratio);
        let first_radius = second_radius * arc_ratio;
        let angle = atan(theta) * 2.0;
        let inward = Curve::Inward { a, shift, frame: None };
        let (sine, cosine) = sin_cos_of(at_turn);
        let start = scaled([cosine, sine], turn_radius);
        // The tangent of the spiral, with 1 / w and theta / w as functions of theta that occurs once.
        let radial = Interval::ONE.over((Interval::ONE + theta.square()).sqrt());
        let around = Interval::ONE.over((Interval::ONE + Interval::ONE.over(theta.square())).sqrt());
        let tangent = [around * sine - radial * cosine, -(around * cosine + radial * sine)];
        let right: Vector = [tangent[1], -tangent[0]];
        let first = Curve::Arc { origin: start, direction: tangent, inward: right, radius: first_radius };
        // Both arcs turn by the same angle, so that their chords have one direction. The junction is on the line from A
        // to -A, and divides it as the radii.
        let middle = scaled(start, (Interval::ONE - ratio).over(Interval::ONE + ratio));
        let direction = first.tangent_of(angle, sin_cos_of(angle));
        let left: Vector = [-direction[1], direction[0]];
        let second = Curve::Arc { origin: middle, direction, inward: left, radius: second_radius };
        let lead_in = Interval::point(lead_in);
        let arc_end = lead_in + first_radius * angle;
        let (zero, far) = (Interval::ZERO, Interval::point(FAR));
        let segments = vec![
            Segment { curve: inward, begin: far, end: at_turn, travelled: lead_in },
            Segment { curve: first, begin: zero, end: angle, travelled: lead_in },
            Segment { curve: second, begin: zero, end: angle, travelled: arc_end },
            Segment {
                curve: Curve::Outward { a, shift, frame: None },
                begin: at_turn,
                end: far,
                travelled: arc_end + second_radius * angle,
            },
        ];
        Self { segments }
    }

    /// Creates an inward spiral alone, of `a` metres per radian. The head reaches its end at the centre after
    /// `travelled` metres.
    pub fn inward(a: Interval, travelled: Interval) -> Self {
        let (curve, begin) = (Curve::Inward { a, shift: Interval::ZERO, frame: None }, Interval::point(FAR));
        Self { segments: vec![Segment { curve, begin, end: Interval::ZERO, travelled }] }
    }

    /// Returns the point of a place.
    pub fn point(&self, place: Place) -> Vector {
        self.curve(place).point(place)
    }

    /// Returns the point of a place, and the tangent there.
    pub fn at(&self, place: Place) -> (Vector, Vector) {
        self.curve(place).at(place)
    }

    /// Returns a place of the span between two: near the middle on one segment, else the first.
    pub fn middle(&self, first: Place, last: Place) -> Place {
        if first.0 == last.0 { first.middle(last) } else { first }
    }

    /// Returns true if the path begins on a spiral towards its centre.
    pub fn begins_inward(&self) -> bool {
        matches!(self.segments[0].curve, Curve::Inward { .. })
    }

    /// Returns the curve at a place.
    pub fn curve(&self, place: Place) -> &Curve {
        &self.segments[place.0].curve
    }

    /// Returns true if `x` is before `y` on the path, or equal.
    pub fn in_order(&self, x: Place, y: Place) -> bool {
        let (of_x, of_y) = ((x.1, x.2), (y.1, y.2));
        x.0 < y.0 || x.0 == y.0 && if self.curve(x).grows() { of_x <= of_y } else { of_x >= of_y }
    }

    /// Returns true if `x` is before `y` on the path.
    pub fn is_before(&self, x: Place, y: Place) -> bool {
        x != y && self.in_order(x, y)
    }

    /// Returns true if a place is strictly inside its segment. The last segment continues beyond its end, but not
    /// through a centre.
    pub fn is_inside(&self, place: Place) -> bool {
        let Place(segment, at, _) = place;
        let Some(Segment { curve, begin, end, .. }) = self.segments.get(segment) else { return false };
        let last = segment + 1 == self.segments.len();
        if !at.is_finite() {
            return false;
        }
        let at = place.coordinate();
        if curve.grows() {
            at.lo > begin.hi && (last || at.hi < end.lo)
        } else {
            at.hi < begin.lo && if last { at.lo >= 0.0 } else { at.lo > end.hi }
        }
    }

    /// Returns a place `metres` further on, or back if negative, strictly inside its segment. The distance is about
    /// `metres`, and never less. The coordinate is one double unless `fine` is true.
    pub fn moved(&self, place: Place, metres: f64, fine: bool) -> Place {
        let Place(segment, at, _) = place;
        let Segment { curve, begin, end, .. } = &self.segments[segment];
        let rate = match curve {
            Curve::Inward { a, shift, .. } | Curve::Outward { a, shift, .. } => a.lo * 1f64.hypot(at + shift.lo),
            Curve::Line { .. } => 1.0,
            Curve::Arc { radius, .. } => radius.lo,
        };
        let by = 1.0001 * metres / rate;
        let moved = place.plus(if curve.grows() { by } else { -by }, fine);
        let moved = if moved != place || metres == 0.0 {
            moved
        } else if (metres > 0.0) == curve.grows() {
            Place(segment, at.next_up(), 0.0)
        } else {
            Place(segment, at.next_down(), 0.0)
        };
        if self.is_inside(moved) {
            return moved;
        }
        let last = segment + 1 == self.segments.len();
        if metres >= 0.0 && last {
            // The centre of a spiral.
            return Place(segment, if curve.grows() { end.hi } else { 0.0 }, 0.0);
        }
        let beyond = if metres >= 0.0 { self.after(segment) } else { self.before(segment) };
        // The first segment has no beginning to fall off.
        let Some(beyond) = beyond else { return Place(segment, begin.middle(), 0.0) };
        let (first, last) = if metres >= 0.0 { (place, beyond) } else { (beyond, place) };
        let rest = metres.abs() - self.length(first, last);
        if rest > 0.0 { self.moved(beyond, rest.copysign(metres), fine) } else { beyond }
    }

    /// Returns the first place that is surely on the segment after this one.
    fn after(&self, segment: usize) -> Option<Place> {
        let Segment { curve, begin, .. } = self.segments.get(segment + 1)?;
        let at = if curve.grows() { begin.hi.next_up() } else { begin.lo.next_down() };
        Some(Place(segment + 1, at, 0.0))
    }

    /// Returns the last place that is surely on the segment before this one.
    fn before(&self, segment: usize) -> Option<Place> {
        let before = segment.checked_sub(1)?;
        Some(self.last_inside(before))
    }

    fn last_inside(&self, segment: usize) -> Place {
        let Segment { curve, end, .. } = &self.segments[segment];
        Place(segment, if curve.grows() { end.lo.next_down() } else { end.hi.next_up() }, 0.0)
    }

    /// Returns a place between two: the middle if both are on one segment, and otherwise the end of the earlier segment
    /// or the beginning of the later one. Returns `None` if there is none.
    pub fn between(&self, x: Place, y: Place) -> Option<Place> {
        if x.0 == y.0 {
            let middle = x.middle(y);
            return (middle != x && middle != y).then_some(middle);
        }
        let end = self.last_inside(x.0);
        if x != end && self.in_order(x, end) {
            return Some(end);
        }
        self.after(x.0).filter(|begin| *begin != y && self.in_order(*begin, y))
    }

    /// Returns the sum over the stretches of segments between two places.
    fn sum(&self, x: Place, y: Place, of: impl Fn(&Curve, Interval, Interval, Interval) -> f64) -> f64 {
        let mut sum = Interval::ZERO;
        for segment in x.0..=y.0 {
            let Segment { curve, begin, end, .. } = &self.segments[segment];
            let from = if segment == x.0 { x.coordinate() } else { *begin };
            let to = if segment == y.0 { y.coordinate() } else { *end };
            let between = if x.0 == y.0 { x.minus(y) } else { from - to };
            sum = sum + Interval::point(of(curve, between.abs(), from, to));
        }
        sum.hi
    }

    /// Returns an upper bound of the metres between two places.
    pub fn length(&self, x: Place, y: Place) -> f64 {
        self.sum(x, y, |curve, between, from, to| (between * curve.metres_per_unit(from, to)).hi)
    }

    /// Returns the metres of travel per unit of the coordinate, between two places of one segment.
    pub fn travel_per_unit(&self, x: Place, y: Place) -> Interval {
        let curve = self.curve(x);
        let metres = curve.metres_per_unit(x.coordinate(), y.coordinate());
        if curve.grows() { metres } else { -metres }
    }

    /// Returns a span with all places whose coordinates differ from a place's by at most `by`, if they are strictly
    /// inside its segment.
    pub fn around(&self, place: Place, by: f64) -> Option<Span> {
        let by = if by == 0.0 { 0.0 } else { WIDER * by + LEAST };
        let ends = [place.plus(-by, true), place.plus(by, true)];
        let [first, last] = if self.curve(place).grows() { ends } else { [ends[1], ends[0]] };
        (self.is_inside(first) && self.is_inside(last)).then_some(Span(first, last))
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
            let from = if segment == x.0 { x.coordinate() } else { *begin };
            let to = if segment == y.0 { y.coordinate() } else { *end };
            curve.bend(from.min(to).lo, from.max(to).hi)
        });
        let hull = |a: Interval, b: Interval| Interval { lo: a.lo.min(b.lo), hi: a.hi.max(b.hi) };
        bends.reduce(hull).unwrap_or(Interval::ZERO)
    }

    /// Returns the rate of the curvature between two places of one segment, 1/m per metre; `None` for places of two
    /// segments.
    pub fn bend_rate(&self, x: Place, y: Place) -> Option<Interval> {
        (x.0 == y.0).then(|| self.curve(x).bend_rate(x.coordinate(), y.coordinate()))
    }

    /// Returns the travel of the head at a place, in metres.
    pub fn travelled(&self, place: Place) -> Interval {
        let Segment { curve, begin, end, travelled } = &self.segments[place.0];
        let at = place.coordinate();
        let reference = if begin.lo.is_infinite() { *end } else { *begin };
        let between = |a: Interval, shift: Interval| {
            let [at, reference] = [at, reference].map(|at| shifted(at, Interval::ONE, shift));
            spiral_length(a, at) - spiral_length(a, reference)
        };
        match *curve {
            Curve::Inward { a, shift, .. } => *travelled - between(a, shift),
            Curve::Outward { a, shift, .. } => *travelled + between(a, shift),
            Curve::Line { .. } => *travelled + (at - reference),
            Curve::Arc { radius, .. } => *travelled + radius * (at - reference),
        }
    }
}

/// Creates a route: a line without a beginning up to the start at the origin, then the steps.
fn route(heading_turns: f64, steps: &[RouteStep]) -> ExactPath {
    let (zero, mut turns) = (Interval::ZERO, Interval::point(heading_turns));
    let mut origin = [zero; 2];
    let (mut direction, mut travelled) = (of_turns(turns), zero);
    let curve = Curve::Line { origin, direction };
    let mut segments = vec![Segment { curve, begin: Interval::point(-FAR), end: zero, travelled: zero }];
    for step in steps {
        // The last place: its coordinate as a sum, with its sine and cosine.
        let (curve, [begin, end], length, (last, sin_cos)) = match *step {
            RouteStep::Line { length } => {
                let length = Interval::point(length);
                (Curve::Line { origin, direction }, [zero, length], length, (exactly(length), sin_cos_of(length)))
            }
            RouteStep::Arc { side, radius, turns: by } => {
                let [x, y] = direction;
                let inward = if side == Side::Left { [-y, x] } else { [y, -x] };
                let radius = of_sum(radius);
                let around = of_sum(by);
                let angle = pi() * 2.0 * around;
                turns = if side == Side::Left { turns + around } else { turns - around };
                let curve = Curve::Arc { origin, direction, inward, radius };
                (curve, [zero, angle], radius * angle, (exactly(angle), sin_cos_of(angle)))
            }
            RouteStep::Spiral { side, direction: way, pitch, radius, turns: by } => {
                let a = Interval::point(pitch).over(pi() * 2.0);
                let [first, last] = spiral_ends(way, pitch, radius, by);
                let ends = [first, last].map(of_sum);
                let [inner, outer] = if way == Direction::Inward { [ends[1], ends[0]] } else { ends };
                let turned = of_sum(by) + (atan(outer) - atan(inner)).over(pi() * 2.0);
                turns = if side == Side::Left { turns + turned } else { turns - turned };
                let [first, last] = [first, last].map(|end| nearly(end, outer.hi));
                let curve = spiral_from(a, way, side, origin, direction, first.0, first.1);
                (curve, ends, spiral_length(a, outer) - spiral_length(a, inner), last)
            }
        };
        segments.push(Segment { curve, begin, end, travelled });
        travelled = travelled + length;
        origin = curve.point_of(last, sin_cos);
        direction = of_turns(turns);
    }
    ExactPath { segments }
}

/// The relative error of [`spiral_ends`]: some hundred times the error of a few operations of [`DoubleDouble`].
const OF_SUMS: f64 = 1e-28;

/// Returns the polar angles at the ends of a route's spiral, within a part [`OF_SUMS`] of the greater one.
fn spiral_ends(way: Direction, pitch: f64, radius: DoubleDouble, turns: DoubleDouble) -> [DoubleDouble; 2] {
    let DoubleDouble { high, low } = radius.over(pitch);
    let first = DoubleDouble::from_turns(high).plus(std::f64::consts::TAU * low);
    let sign = if way == Direction::Inward { -1.0 } else { 1.0 };
    let around = DoubleDouble::from_turns(turns);
    [first, first.plus(sign * around.high).plus(sign * around.low)]
}

/// Returns an enclosure of a sum of two doubles.
fn of_sum(DoubleDouble { high, low }: DoubleDouble) -> Interval {
    if low == 0.0 { Interval::point(high) } else { Interval::point(high) + Interval::point(low) }
}

/// Returns a polar angle with the error of [`spiral_ends`] as a sum of two numbers, and its sine and cosine.
fn nearly(DoubleDouble { high, low }: DoubleDouble, greatest: f64) -> ([Interval; 2], (Interval, Interval)) {
    let error = Interval::within(OF_SUMS * greatest);
    let (sine, cosine) = sin_cos_at(Place(0, high, low));
    ([Interval::point(high), Interval::point(low) + error], (sine + error, cosine + error))
}

/// Creates the spiral that has a given point and direction at its first polar angle, its centre on one side.
fn spiral_from(
    a: Interval,
    way: Direction,
    side: Side,
    origin: Vector,
    direction: Vector,
    first: [Interval; 2],
    sin_cos: (Interval, Interval),
) -> Curve {
    let of = |frame| match way {
        Direction::Inward => Curve::Inward { a, shift: Interval::ZERO, frame },
        Direction::Outward => Curve::Outward { a, shift: Interval::ZERO, frame },
    };
    let is_mirrored = (way == Direction::Outward) != (side == Side::Left);
    let about_origin = of(None);
    let (point, tangent) =
        (about_origin.point_of(first, sin_cos), about_origin.tangent_of(first[0] + first[1], sin_cos));
    // Direction over tangent, as complex numbers.
    let [x, y] = if is_mirrored { [tangent[0], -tangent[1]] } else { tangent };
    let rotation = [direction[0] * x + direction[1] * y, direction[1] * x - direction[0] * y];
    let turned = Frame { centre: [Interval::ZERO; 2], rotation, is_mirrored };
    of(Some(Frame { centre: minus(origin, turned.vector(point)), ..turned }))
}

/// Returns the direction `turns` turns counter-clockwise from x.
pub(super) fn of_turns(turns: Interval) -> Vector {
    let (sine, cosine) = sin_cos_of(pi() * 2.0 * turns);
    [cosine, sine]
}

/// Returns a coordinate as a sum of two numbers.
fn exactly(at: Interval) -> [Interval; 2] {
    [at, Interval::ZERO]
}
