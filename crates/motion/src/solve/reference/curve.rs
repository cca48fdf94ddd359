//! The curves of the reference, with 38 digits in plain Cartesian coordinates, and in doubles for its first guess.
//!
//! In: a [`RouteStep`] with the end of the path before it. Out: its curve.

use super::real::{Functions, Real, RealVector};
use super::{Piece, ReferenceError, Turn, TurnArcs};
use crate::model::Vector;
use crate::model::curve::Side;
use crate::model::description::RouteStep;
use crate::model::double_double::DoubleDouble;
use crate::model::spiral::Direction;

/// The longest step on a spiral, in radians: short against the half turns over which the growth of a chord changes its
/// sign.
const LONGEST: f64 = 0.05;

/// A curve. Its coordinate is metres on a line, radians turned on an arc, the polar angle on a spiral.
#[derive(Debug, Clone)]
pub(super) enum Curve {
    Line {
        origin: RealVector,
        direction: RealVector,
    },
    /// Its angle from x is `heading` at coordinate 0; `sense` is 1 if it turns left, -1 if right.
    Arc {
        centre: RealVector,
        radius: Real,
        heading: Real,
        sense: Real,
    },
    /// r = `radius_per_radian` theta about `centre`, the angle from x being `phase` + `sense` theta; outward, turned by
    /// half a turn.
    Spiral {
        centre: RealVector,
        radius_per_radian: Real,
        direction: Direction,
        phase: Real,
        sense: Real,
    },
}

/// A place on a curve.
#[derive(Debug, Clone)]
pub(super) struct RealParam {
    /// The curve's coordinate.
    pub at: Real,
    pub point: RealVector,
    /// The derivative of the point by the coordinate.
    pub slope: RealVector,
    /// The unit vector at the angle that belongs to the coordinate: along an arc, from the centre on a spiral.
    unit: RealVector,
}

impl Curve {
    /// Creates the line from a point, `heading` radians from x.
    pub fn line(origin: RealVector, heading: &Real, functions: &mut Functions) -> Self {
        Self::Line { origin, direction: functions.unit_vector(heading) }
    }

    /// Creates the spiral about the origin of coordinates.
    pub fn about_origin(radius_per_radian: Real, direction: Direction) -> Self {
        let (centre, phase, sense) = (origin(), Real::from(0.0), Real::from(1.0));
        Self::Spiral { centre, radius_per_radian, direction, phase, sense }
    }

    pub fn place(&self, at: Real, functions: &mut Functions) -> RealParam {
        let unit = match self {
            Self::Line { direction, .. } => direction.clone(),
            Self::Arc { heading, sense, .. } => functions.unit_vector(&(heading + sense * &at)),
            Self::Spiral { phase, sense, .. } => functions.unit_vector(&(phase + sense * &at)),
        };
        self.place_with(at, unit)
    }

    /// Returns the place `by` further along the coordinate. For a small `by`, no sine and no cosine is computed.
    pub fn moved(&self, place: &RealParam, by: &Real, functions: &mut Functions) -> RealParam {
        let at = &place.at + by;
        if by.rounded().abs() >= 1e-8 {
            return self.place(at, functions);
        }
        let unit = match self {
            Self::Line { direction, .. } => direction.clone(),
            Self::Arc { sense, .. } | Self::Spiral { sense, .. } => place.unit.turned_slightly(&(sense * by)),
        };
        self.place_with(at, unit)
    }

    fn place_with(&self, at: Real, unit: RealVector) -> RealParam {
        let (point, slope) = match self {
            Self::Line { origin, direction } => (origin + &direction.scaled(&at), direction.clone()),
            Self::Arc { centre, radius, sense, .. } => {
                (centre - &unit.left().scaled(&(sense * radius)), unit.scaled(radius))
            }
            Self::Spiral { centre, radius_per_radian, direction, sense, .. } => {
                let radius_per_radian = if *direction == Direction::Inward {
                    radius_per_radian.clone()
                } else {
                    -radius_per_radian.clone()
                };
                let spoke = unit.scaled(&(&radius_per_radian * &at));
                let slope = &unit.scaled(&radius_per_radian) + &spoke.left().scaled(sense);
                (centre + &spoke, slope)
            }
        };
        RealParam { at, point, slope, unit }
    }

    /// Returns 1 if the coordinate grows in the direction of travel, -1 if it falls.
    pub fn forward(&self) -> f64 {
        if matches!(self, Self::Spiral { direction: Direction::Inward, .. }) { -1.0 } else { 1.0 }
    }

    /// Returns the metres per unit of the coordinate.
    pub fn rate(&self, at: &Real) -> Real {
        match self {
            Self::Line { .. } => Real::from(1.0),
            Self::Arc { radius, .. } => radius.clone(),
            Self::Spiral { radius_per_radian, .. } => radius_per_radian * (Real::from(1.0) + at.square()).sqrt(),
        }
    }

    /// Returns the greatest curvature between two places, 1/m.
    pub fn tightest(&self, first: &RealParam, last: &RealParam) -> f64 {
        match self {
            Self::Line { .. } => 0.0,
            Self::Arc { radius, .. } => radius.rounded().recip(),
            Self::Spiral { radius_per_radian, .. } => {
                let theta = first.at.rounded().min(last.at.rounded());
                let square = theta * theta;
                (square + 2.0) / (radius_per_radian.rounded() * (square + 1.0) * (square + 1.0).sqrt())
            }
        }
    }

    /// Returns the coordinate `metres` of travel after another, before it if negative.
    pub fn advanced(&self, from: &Real, metres: &Real, functions: &mut Functions) -> Real {
        match self {
            Self::Line { .. } => from + metres,
            Self::Arc { radius, .. } => from + metres / radius,
            Self::Spiral { radius_per_radian, .. } => {
                let length = spiral_length(radius_per_radian, from, functions) + Real::from(self.forward()) * metres;
                spiral_angle(radius_per_radian, &length, functions)
            }
        }
    }

    /// Returns true if the distance back from a handle, on a path's first curve, can shrink only after a fold.
    pub fn shrinks_after_a_fold(&self) -> bool {
        matches!(self, Self::Spiral { direction: Direction::Inward, .. })
    }

    /// Returns a place of the curve in doubles.
    pub fn rough(&self, place: &RealParam) -> RoughPlace<'_> {
        let radius = match self {
            Self::Line { .. } => f64::INFINITY,
            Self::Arc { radius, sense, .. } => (sense * radius).rounded(),
            Self::Spiral { radius_per_radian, .. } => radius_per_radian.rounded(),
        };
        let sense = if let Self::Spiral { sense, .. } = self { sense.rounded() } else { 1.0 };
        RoughPlace { curve: self, at: place.at.rounded(), slope: place.slope.rounded(), radius, sense }
    }
}

/// A place on a curve in doubles, for steps back from it.
pub(super) struct RoughPlace<'a> {
    curve: &'a Curve,
    at: f64,
    slope: Vector,
    /// The radius of an arc, with the sign of its curvature, or the radius per radian of a spiral.
    radius: f64,
    /// 1 if the polar angle of a spiral grows counter-clockwise, else -1.
    sense: f64,
}

impl RoughPlace<'_> {
    /// Returns a step back along the coordinate from `back` that leads over at most `metres` of path.
    pub fn safe_step(&self, back: f64, metres: f64) -> f64 {
        match self.curve {
            Curve::Line { .. } => metres,
            Curve::Arc { .. } => metres / self.radius.abs(),
            Curve::Spiral { direction, .. } => {
                let step = |theta: f64| (metres / (self.radius * 1f64.hypot(theta))).min(LONGEST);
                match direction {
                    // Further out a radian is longer: first by the rate here, then by the rate at the end of that step.
                    Direction::Inward => step(self.at + back + step(self.at + back)),
                    Direction::Outward => step(self.at - back),
                }
            }
        }
    }

    /// Returns the vector from the place to the point `back` behind it.
    pub fn displacement(&self, back: f64) -> Vector {
        let left = |vector: Vector| Vector::new(-vector.y, vector.x);
        let half_sine = (0.5 * back).sin();
        let versine = 2.0 * half_sine * half_sine;
        match self.curve {
            Curve::Line { .. } => -back * self.slope,
            Curve::Arc { .. } => versine * self.radius.signum() * left(self.slope) - back.sin() * self.slope,
            Curve::Spiral { direction, .. } => {
                let d = if *direction == Direction::Inward { back } else { -back };
                let (a, r) = (self.radius, self.radius * self.at);
                let other = r + a * d;
                // p' = (a + r J) e for p = r e, J the quarter turn in which the polar angle grows.
                let e = (a * self.slope - r * self.sense * left(self.slope)) / (a * a + r * r);
                (a * d - other * versine) * e + other * d.sin() * self.sense * left(e)
            }
        }
    }
}

/// A curve that continues a path.
pub(super) struct RealPiece {
    pub curve: Curve,
    /// Its first coordinate.
    pub first: Real,
    /// The length along it, in metres.
    pub length: Real,
    /// The direction of travel at its end, radians from x.
    pub heading: Real,
}

impl RealPiece {
    /// Creates the piece of a step of a route from a point in a direction, radians from x.
    pub fn of_step(step: &RouteStep, origin: RealVector, heading: &Real, functions: &mut Functions) -> Self {
        match *step {
            RouteStep::Line { length } => {
                let curve = Curve::line(origin, heading, functions);
                Self { curve, first: Real::from(0.0), length: Real::from(length), heading: heading.clone() }
            }
            RouteStep::Arc { side, radius, turns } => {
                let angle = functions.turn() * Real::of_sum(turns);
                Self::arc(origin, heading, side, Real::of_sum(radius), &angle, functions)
            }
            RouteStep::Spiral { side, direction, pitch, radius, turns } => {
                let turn = functions.turn();
                let first = &turn * Real::of_sum(radius) / Real::from(pitch);
                let around = &turn * Real::of_sum(turns);
                let last = if direction == Direction::Inward { &first - around } else { &first + around };
                Self::spiral(origin, heading, side, direction, Real::from(pitch) / turn, (first, &last), functions)
            }
        }
    }

    /// Creates an arc of `angle` radians.
    pub fn arc(
        origin: RealVector,
        heading: &Real,
        side: Side,
        radius: Real,
        angle: &Real,
        functions: &mut Functions,
    ) -> Self {
        let sense = Real::from(if side == Side::Left { 1.0 } else { -1.0 });
        let to_centre = functions.unit_vector(heading).left().scaled(&(&sense * &radius));
        let centre = &origin + &to_centre;
        let (last, length) = (heading + &sense * angle, &radius * angle);
        let curve = Curve::Arc { centre, radius, heading: heading.clone(), sense };
        Self { curve, first: Real::from(0.0), length, heading: last }
    }

    /// Creates the spiral between two polar angles. Its tangent has the angle phase + sense (theta + atan(theta) + pi).
    fn spiral(
        origin: RealVector,
        heading: &Real,
        side: Side,
        direction: Direction,
        radius_per_radian: Real,
        (first, last): (Real, &Real),
        functions: &mut Functions,
    ) -> Self {
        let counter_clockwise = (side == Side::Left) == (direction == Direction::Outward);
        let sense = Real::from(if counter_clockwise { 1.0 } else { -1.0 });
        let half = functions.turn() / Real::from(2.0);
        let [at_first, at_last] = [&first, last].map(|theta| &sense * (theta + functions.atan(theta) + &half));
        let phase = heading - at_first;
        let heading = &phase + at_last;
        let [inner, outer] = if first < *last { [&first, last] } else { [last, &first] };
        let length =
            spiral_length(&radius_per_radian, outer, functions) - spiral_length(&radius_per_radian, inner, functions);
        let mut curve = Curve::Spiral { centre: self::origin(), radius_per_radian, direction, phase, sense };
        let from_centre = curve.place(first.clone(), functions).point;
        if let Curve::Spiral { centre, .. } = &mut curve {
            *centre = &origin - &from_centre;
        }
        Self { curve, first, length, heading }
    }
}

/// Returns the origin of coordinates.
pub(super) fn origin() -> RealVector {
    RealVector { x: Real::from(0.0), y: Real::from(0.0) }
}

/// Returns the metres of the spiral from its centre: s = a/2 (theta sqrt(1 + theta^2) + ln(theta + sqrt(1 + theta^2))).
pub(super) fn spiral_length(radius_per_radian: &Real, theta: &Real, functions: &mut Functions) -> Real {
    let w = (Real::from(1.0) + theta.square()).sqrt();
    let logarithm = functions.ln(&(theta + &w));
    radius_per_radian / Real::from(2.0) * (theta * w + logarithm)
}

/// Returns the turns around the centre of the first `metres` of a spiral that begins `radius` metres from the centre.
/// Two steps of Newton's method lead from `rough` turns to the result.
pub(super) fn turns_of_metres(
    Piece { direction, pitch, radius }: Piece,
    metres: f64,
    rough: f64,
) -> Result<DoubleDouble, ReferenceError> {
    let mut functions = Functions::new()?;
    let turn = functions.turn();
    let radius_per_radian = Real::from(pitch) / &turn;
    let first = &turn * Real::of_sum(radius) / Real::from(pitch);
    let sense = Real::from(if direction == Direction::Inward { -1.0 } else { 1.0 });
    let target = spiral_length(&radius_per_radian, &first, &mut functions) + &sense * Real::from(metres);
    let mut last = &first + &sense * (&turn * Real::from(rough));
    for _ in 0..2 {
        let excess = spiral_length(&radius_per_radian, &last, &mut functions) - &target;
        last = last.clone() - excess / (&radius_per_radian * (Real::from(1.0) + last.square()).sqrt());
    }
    Ok((sense * (last - first) / turn).split())
}

/// Returns the two radii of a turn, and the turns of each of its arcs: see [`Path::turnaround`].
///
/// [`Path::turnaround`]: crate::model::path::Path::turnaround
pub(super) fn arcs_of_turn(Turn { pitch, radius, arc_ratio }: Turn) -> Result<TurnArcs, ReferenceError> {
    let mut functions = Functions::new()?;
    let turn = functions.turn();
    let (one, ratio, a) = (Real::from(1.0), Real::from(arc_ratio), Real::from(pitch) / &turn);
    let radius = Real::of_sum(radius);
    let second = (radius.square() + a.square()).sqrt() / (&one + &ratio);
    let turns = Real::from(2.0) * functions.atan(&(radius / a)) / turn;
    Ok(TurnArcs { radii: [(ratio * &second).split(), second.split()], turns: turns.split() })
}

/// Returns the polar angle at `metres` of the spiral from its centre.
///
/// s is convex and neither below a theta nor below a theta^2 / 2: Newton's method begins outside and cannot overshoot.
fn spiral_angle(radius_per_radian: &Real, length: &Real, functions: &mut Functions) -> Real {
    let ratio = length / radius_per_radian;
    if ratio.rounded() <= 0.0 {
        return Real::from(0.0);
    }
    let root = (Real::from(2.0) * &ratio).sqrt();
    let mut theta = if root < ratio { root } else { ratio };
    for _ in 0..100 {
        let excess = spiral_length(radius_per_radian, &theta, functions) - length;
        let slope = radius_per_radian * (Real::from(1.0) + theta.square()).sqrt();
        let step = excess / slope;
        theta = theta - &step;
        // The next step is the square of this one.
        if step.rounded().abs() <= 1e-20 * theta.rounded() {
            break;
        }
    }
    theta
}
