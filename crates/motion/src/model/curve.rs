//! The curves that a path is made of: what every curve can do, the line and the arc. The spiral has a file of its own.
//!
//! A curve has a coordinate of its own (metres on a line, radians on an arc, the polar angle on a spiral), kept as two
//! doubles, so that a place far along has lost no digits. Only [`super::path`] and the linkage call it.

use super::double_double::DoubleDouble;
use super::spiral::Spiral;
use super::{Point, Vector};

/// A place on a curve, in the curve's own coordinate.
pub type Coordinate = DoubleDouble;

/// A smooth curve on the stage, travelled in one direction.
pub trait Curve {
    /// The point of a place.
    fn point(&self, at: Coordinate) -> Point;

    /// The unit tangent at a place, in the direction of travel.
    fn tangent(&self, at: Coordinate) -> Vector;

    /// The curvature at a place, 1/m, not negative.
    fn curvature(&self, at: Coordinate) -> f64;

    /// Metres of arc length from one place to another; negative against the direction of travel.
    fn arc_length(&self, from: Coordinate, to: Coordinate) -> f64;

    /// The place `metres` of arc length after another, before it where negative.
    fn advance(&self, from: Coordinate, metres: f64) -> Coordinate;
}

/// A straight line. Its coordinate is metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// The point at 0.
    pub origin: Point,
    /// Unit direction of travel.
    pub direction: Vector,
}

impl Curve for Line {
    fn point(&self, at: Coordinate) -> Point {
        self.origin + at.high * self.direction + at.low * self.direction
    }

    fn tangent(&self, _: Coordinate) -> Vector {
        self.direction
    }

    fn curvature(&self, _: Coordinate) -> f64 {
        0.0
    }

    fn arc_length(&self, from: Coordinate, to: Coordinate) -> f64 {
        to.minus(from)
    }

    fn advance(&self, from: Coordinate, metres: f64) -> Coordinate {
        from.plus(metres)
    }
}

/// Which way an arc turns, seen in the direction of travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Counter-clockwise.
    Left,
    /// Clockwise.
    Right,
}

/// An arc of a circle. Its coordinate is radians turned since its first point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// The point at 0.
    pub origin: Point,
    /// Unit direction of travel at 0.
    pub direction: Vector,
    /// Unit vector from the point at 0 towards the centre.
    pub inward: Vector,
    /// Metres.
    pub radius: f64,
}

impl Arc {
    /// The arc from a point in a unit direction, its centre on one side.
    pub fn new(origin: Point, direction: Vector, side: Side, radius: f64) -> Self {
        let left = Vector::new(-direction.y, direction.x);
        let inward = match side {
            Side::Left => left,
            Side::Right => -left,
        };
        Self { origin, direction, inward, radius }
    }

    /// 1/m, positive where the arc turns left.
    pub fn signed_curvature(&self) -> f64 {
        self.direction.perp(&self.inward).signum() / self.radius
    }
}

impl Curve for Arc {
    fn point(&self, at: Coordinate) -> Point {
        // With half angles, short ways keep all their digits.
        let (sine, cosine) = half(at).sin_cos();
        let (along, across) = (2.0 * sine * cosine, 2.0 * sine * sine);
        self.origin + self.radius * (along * self.direction + across * self.inward)
    }

    fn tangent(&self, at: Coordinate) -> Vector {
        let (sine, cosine) = half(at).sin_cos();
        let (sine, versine) = (2.0 * sine * cosine, 2.0 * sine * sine);
        self.direction + (sine * self.inward - versine * self.direction)
    }

    fn curvature(&self, _: Coordinate) -> f64 {
        self.radius.recip()
    }

    fn arc_length(&self, from: Coordinate, to: Coordinate) -> f64 {
        self.radius * to.minus(from)
    }

    fn advance(&self, from: Coordinate, metres: f64) -> Coordinate {
        let DoubleDouble { high, low } = DoubleDouble::quotient(metres, self.radius);
        from.plus(high).plus(low)
    }
}

fn half(at: Coordinate) -> Coordinate {
    Coordinate { high: 0.5 * at.high, low: 0.5 * at.low }
}

/// One of the curves of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Segment {
    /// Straight on.
    Line(Line),
    /// Along a circle.
    Arc(Arc),
    /// Along an Archimedean spiral, inward or outward.
    Spiral(Spiral),
}

impl Segment {
    fn curve(&self) -> &dyn Curve {
        match self {
            Self::Line(line) => line,
            Self::Arc(arc) => arc,
            Self::Spiral(spiral) => spiral,
        }
    }
}

impl Curve for Segment {
    fn point(&self, at: Coordinate) -> Point {
        self.curve().point(at)
    }

    fn tangent(&self, at: Coordinate) -> Vector {
        self.curve().tangent(at)
    }

    fn curvature(&self, at: Coordinate) -> f64 {
        self.curve().curvature(at)
    }

    fn arc_length(&self, from: Coordinate, to: Coordinate) -> f64 {
        self.curve().arc_length(from, to)
    }

    fn advance(&self, from: Coordinate, metres: f64) -> Coordinate {
        self.curve().advance(from, metres)
    }
}
