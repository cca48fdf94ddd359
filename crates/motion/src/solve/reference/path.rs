//! The path of a description with 38 digits: curves in plain Cartesian coordinates, one after the other.
//!
//! In: a [`PathDescription`]. Out: a path that gives places by metres of travel and by a curve's own coordinate. Only
//! the reference calls it.

use super::Piece;
use super::real::{Functions, Real, RealVector};
use crate::model::curve::Side;
use crate::model::description::{PathDescription, RouteStep};
use crate::model::double_double::DoubleDouble;
use crate::model::spiral::Direction;

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

    /// Returns the coordinate `metres` of travel after another, before it if negative.
    fn advanced(&self, from: &Real, metres: &Real, functions: &mut Functions) -> Real {
        match self {
            Self::Line { .. } => from + metres,
            Self::Arc { radius, .. } => from + metres / radius,
            Self::Spiral { radius_per_radian, .. } => {
                let length = spiral_length(radius_per_radian, from, functions) + Real::from(self.forward()) * metres;
                spiral_angle(radius_per_radian, &length, functions)
            }
        }
    }
}

fn origin() -> RealVector {
    RealVector { x: Real::from(0.0), y: Real::from(0.0) }
}

fn about_origin(radius_per_radian: Real, direction: Direction) -> Curve {
    Curve::Spiral { centre: origin(), radius_per_radian, direction, phase: Real::from(0.0), sense: Real::from(1.0) }
}

/// Returns the metres of the spiral from its centre: s = a/2 (theta sqrt(1 + theta^2) + ln(theta + sqrt(1 + theta^2))).
fn spiral_length(radius_per_radian: &Real, theta: &Real, functions: &mut Functions) -> Real {
    let w = (Real::from(1.0) + theta.square()).sqrt();
    let logarithm = functions.ln(&(theta + &w));
    radius_per_radian / Real::from(2.0) * (theta * w + logarithm)
}

/// Returns the turns around its centre of the first `metres` of a spiral that begins `radius` metres from it, by two
/// steps of Newton's method from `rough` turns.
pub(super) fn turns_of_metres(
    Piece { direction, pitch, radius }: Piece,
    metres: f64,
    rough: f64,
) -> Result<DoubleDouble, String> {
    let mut functions = Functions::new()?;
    let turn = functions.turn();
    let radius_per_radian = Real::from(pitch) / &turn;
    let first = &turn * Real::from(radius) / Real::from(pitch);
    let sense = Real::from(if direction == Direction::Inward { -1.0 } else { 1.0 });
    let target = spiral_length(&radius_per_radian, &first, &mut functions) + &sense * Real::from(metres);
    let mut last = &first + &sense * (&turn * Real::from(rough));
    for _ in 0..2 {
        let excess = spiral_length(&radius_per_radian, &last, &mut functions) - &target;
        last = last.clone() - excess / (&radius_per_radian * (Real::from(1.0) + last.square()).sqrt());
    }
    Ok((sense * (last - first) / turn).split())
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

/// A curve on the path.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    pub curve: Curve,
    /// Its first place; on the first segment, which has no beginning, the place from which it is measured.
    pub first: RealParam,
    /// Metres of travel at `first`.
    pub begin: Real,
    /// Its last place.
    pub last: RealParam,
    /// Metres of travel at `last`.
    pub end: Real,
}

/// A path that grows at its end.
pub(super) struct RealPath {
    segments: Vec<Segment>,
    /// Direction of travel at its end, radians from x.
    heading: Real,
    pub functions: Functions,
}

impl RealPath {
    /// # Errors
    /// A sentence if there is no memory for the constants.
    pub fn new(description: &PathDescription) -> Result<Self, String> {
        let mut path = Self { segments: Vec::new(), heading: Real::from(0.0), functions: Functions::new()? };
        match *description {
            PathDescription::Spiral { pitch, start_turn } => path.spiral(pitch, start_turn),
            PathDescription::Turnaround { pitch, turn_radius, arc_ratio, lead_in, lead_out } => {
                path.turnaround(pitch, turn_radius, arc_ratio);
                path.between(lead_in, lead_out);
            }
            PathDescription::Route { heading_turns, ref steps } => {
                path.heading = path.functions.turn() * Real::from(heading_turns);
                let direction = path.functions.unit_vector(&path.heading);
                let zero = Real::from(0.0);
                path.push(Curve::Line { origin: origin(), direction }, zero.clone(), &zero);
                for step in steps {
                    path.step(step);
                }
            }
        }
        Ok(path)
    }

    fn spiral(&mut self, pitch: f64, start_turn: f64) {
        let turn = self.functions.turn();
        let radius_per_radian = Real::from(pitch) / &turn;
        let start = turn * Real::from(start_turn);
        let length = spiral_length(&radius_per_radian, &start, &mut self.functions);
        self.push(about_origin(radius_per_radian, Direction::Inward), start, &length);
    }

    /// Returns the inward spiral that ends at A, without length, both arcs, and the outward spiral that begins at B,
    /// without length.
    fn turnaround(&mut self, pitch: f64, turn_radius: f64, arc_ratio: f64) {
        let turn = self.functions.turn();
        let (radius_per_radian, radius) = (Real::from(pitch) / &turn, Real::from(turn_radius));
        let (theta, zero) = (&radius / &radius_per_radian, Real::from(0.0));
        self.push(about_origin(radius_per_radian.clone(), Direction::Inward), theta.clone(), &zero);
        // The tangent there is -(a e_r + R e_phi) / sqrt(a^2 + R^2).
        let to_radius = self.functions.atan(&theta);
        self.heading = &theta + &to_radius + turn / Real::from(2.0);
        let both = (radius_per_radian.square() + radius.square()).sqrt();
        let ratio = Real::from(arc_ratio);
        let second = both / (Real::from(1.0) + &ratio);
        let angle = Real::from(2.0) * to_radius;
        self.arc(Side::Right, &ratio * &second, &angle);
        self.arc(Side::Left, second, &angle);
        self.push(about_origin(radius_per_radian, Direction::Outward), theta, &zero);
    }

    /// Sets the start of travel `lead_in` metres before the end of the first segment and its end `lead_out` metres
    /// after the beginning of the last.
    fn between(&mut self, lead_in: f64, lead_out: f64) {
        let lead_in = Real::from(lead_in);
        for segment in &mut self.segments {
            segment.begin = &segment.begin + &lead_in;
            segment.end = &segment.end + &lead_in;
        }
        let Some(Segment { curve, first, begin, last, end }) = self.segments.last_mut() else { return };
        let lead_out = Real::from(lead_out);
        *last = curve.place(curve.advanced(&first.at, &lead_out, &mut self.functions), &mut self.functions);
        *end = &*begin + lead_out;
    }

    fn step(&mut self, step: &RouteStep) {
        match *step {
            RouteStep::Line { length } => {
                let direction = self.functions.unit_vector(&self.heading);
                let line = Curve::Line { origin: self.end_point(), direction };
                self.push(line, Real::from(0.0), &Real::from(length));
            }
            RouteStep::Arc { side, radius, turns } => {
                let angle = self.functions.turn() * Real::of_sum(turns);
                self.arc(side, Real::from(radius), &angle);
            }
            RouteStep::Spiral { side, direction, pitch, radius, turns } => {
                let turn = self.functions.turn();
                let first = &turn * Real::from(radius) / Real::from(pitch);
                let around = &turn * Real::of_sum(turns);
                let last = if direction == Direction::Inward { &first - around } else { &first + around };
                self.piece_of_spiral(side, direction, Real::from(pitch) / turn, first, &last);
            }
        }
    }

    /// Adds the spiral between two polar angles. Its tangent has the angle phase + sense (theta + atan(theta) + pi).
    fn piece_of_spiral(&mut self, side: Side, direction: Direction, radius_per_radian: Real, first: Real, last: &Real) {
        let counter_clockwise = (side == Side::Left) == (direction == Direction::Outward);
        let sense = Real::from(if counter_clockwise { 1.0 } else { -1.0 });
        let half = self.functions.turn() / Real::from(2.0);
        let [at_first, at_last] = [&first, last].map(|theta| &sense * (theta + self.functions.atan(theta) + &half));
        let phase = &self.heading - at_first;
        self.heading = &phase + at_last;
        let about_origin = Curve::Spiral { centre: origin(), radius_per_radian, direction, phase, sense };
        let from_centre = about_origin.place(first.clone(), &mut self.functions).point;
        let Curve::Spiral { radius_per_radian, direction, phase, sense, .. } = about_origin else { return };
        let [inner, outer] = if first < *last { [&first, last] } else { [last, &first] };
        let length = spiral_length(&radius_per_radian, outer, &mut self.functions)
            - spiral_length(&radius_per_radian, inner, &mut self.functions);
        let centre = &self.end_point() - &from_centre;
        self.push(Curve::Spiral { centre, radius_per_radian, direction, phase, sense }, first, &length);
    }

    fn arc(&mut self, side: Side, radius: Real, angle: &Real) {
        let sense = Real::from(if side == Side::Left { 1.0 } else { -1.0 });
        let heading = self.heading.clone();
        let to_centre = self.functions.unit_vector(&heading).left().scaled(&(&sense * &radius));
        let centre = &self.end_point() + &to_centre;
        self.heading = &heading + &sense * angle;
        let length = &radius * angle;
        self.push(Curve::Arc { centre, radius, heading, sense }, Real::from(0.0), &length);
    }

    fn end_point(&self) -> RealVector {
        self.segments[self.segments.len() - 1].last.point.clone()
    }

    fn push(&mut self, curve: Curve, first: Real, length: &Real) {
        let begin = self.segments.last().map_or(Real::from(0.0), |segment| segment.end.clone());
        let last = curve.advanced(&first, length, &mut self.functions);
        let first = curve.place(first, &mut self.functions);
        let last = curve.place(last, &mut self.functions);
        let end = &begin + length;
        self.segments.push(Segment { curve, first, begin, last, end });
    }

    pub fn segment(&self, index: usize) -> &Segment {
        &self.segments[index]
    }

    pub fn segments(&self) -> usize {
        self.segments.len()
    }

    /// Returns the segment and the place `travelled` metres past the start, at most the path's end.
    pub fn place_at(&mut self, travelled: &Real) -> (usize, RealParam) {
        let index = self.segments.partition_point(|segment| segment.begin <= *travelled).max(1) - 1;
        let Segment { curve, first, begin, end, .. } = &self.segments[index];
        let metres = if travelled > end { end - begin } else { travelled - begin };
        let at = curve.advanced(&first.at, &metres, &mut self.functions);
        (index, curve.place(at, &mut self.functions))
    }

    /// Returns the place `by` further along the coordinate of a segment.
    pub fn moved(&mut self, segment: usize, place: &RealParam, by: &Real) -> RealParam {
        self.segments[segment].curve.moved(place, by, &mut self.functions)
    }
}
