//! The path of a description with 38 digits: curves in plain Cartesian coordinates, one after the other.
//!
//! In: a [`PathDescription`]. Out: a path that gives places by metres of travel and by a curve's own coordinate.

use super::ReferenceError;
use super::curve::{Curve, RealParam, RealPiece, origin, spiral_length};
use super::real::{Functions, Real, RealVector};
use crate::model::curve::Side;
use crate::model::description::PathDescription;
use crate::model::spiral::Direction;

/// A curve on the path.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    pub curve: Curve,
    /// Its first place; on the first segment, which has no beginning, the place from which it is measured.
    pub first: RealParam,
    /// The travel at `first`, in metres.
    pub begin: Real,
    /// Its last place.
    pub last: RealParam,
    /// The travel at `last`, in metres.
    pub end: Real,
}

/// A path that grows at its end.
pub(super) struct RealPath {
    segments: Vec<Segment>,
    /// The direction of travel at its end, radians from x.
    heading: Real,
    pub functions: Functions,
}

impl RealPath {
    /// # Errors
    /// [`ReferenceError::NoMemory`]
    pub fn new(description: &PathDescription) -> Result<Self, ReferenceError> {
        let mut path = Self { segments: Vec::new(), heading: Real::from(0.0), functions: Functions::new()? };
        match *description {
            PathDescription::Spiral { pitch, start_turn } => path.spiral(pitch, start_turn),
            PathDescription::Turnaround { pitch, turn_radius, arc_ratio, lead_in, lead_out } => {
                path.turnaround(pitch, turn_radius, arc_ratio);
                path.between(lead_in, lead_out);
            }
            PathDescription::Route { heading_turns, ref steps } => {
                path.heading = path.functions.turn() * Real::from(heading_turns);
                let line = Curve::line(origin(), &path.heading, &mut path.functions);
                let zero = Real::from(0.0);
                path.push(line, zero.clone(), &zero);
                for step in steps {
                    let piece = RealPiece::of_step(step, path.end_point(), &path.heading, &mut path.functions);
                    path.add(piece);
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
        self.push(Curve::about_origin(radius_per_radian, Direction::Inward), start, &length);
    }

    /// Returns the inward spiral that ends at A, without length, both arcs, and the outward spiral that begins at B,
    /// without length.
    fn turnaround(&mut self, pitch: f64, turn_radius: f64, arc_ratio: f64) {
        let turn = self.functions.turn();
        let (radius_per_radian, radius) = (Real::from(pitch) / &turn, Real::from(turn_radius));
        let (theta, zero) = (&radius / &radius_per_radian, Real::from(0.0));
        self.push(Curve::about_origin(radius_per_radian.clone(), Direction::Inward), theta.clone(), &zero);
        // The tangent there is -(a e_r + R e_phi) / sqrt(a^2 + R^2).
        let to_radius = self.functions.atan(&theta);
        self.heading = &theta + &to_radius + turn / Real::from(2.0);
        let both = (radius_per_radian.square() + radius.square()).sqrt();
        let ratio = Real::from(arc_ratio);
        let second = both / (Real::from(1.0) + &ratio);
        let angle = Real::from(2.0) * to_radius;
        self.arc(Side::Right, &ratio * &second, &angle);
        self.arc(Side::Left, second, &angle);
        self.push(Curve::about_origin(radius_per_radian, Direction::Outward), theta, &zero);
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

    fn arc(&mut self, side: Side, radius: Real, angle: &Real) {
        let piece = RealPiece::arc(self.end_point(), &self.heading, side, radius, angle, &mut self.functions);
        self.add(piece);
    }

    fn add(&mut self, RealPiece { curve, first, length, heading }: RealPiece) {
        self.heading = heading;
        self.push(curve, first, &length);
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
