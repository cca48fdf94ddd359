//! [`Segment`]: one of the curves of a path, and its outline for drawings. The path calls it; drawings match on the
//! kind of an outline.

use std::f64::consts::TAU;
use std::fmt;

use super::arc::Arc;
use super::curve::{Coordinate, Curve, Follower, LinkPose, NoFollower};
use super::curve_bounds::{CurveBounds, ReachedDisc};
use super::elementary::atan2;
use super::line::Line;
use super::placed_spiral::PlacedSpiral;
use super::spiral::{Direction, Spiral};
use super::team::Team;
use super::{Point, Vector};

/// One of the curves of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Segment {
    /// Straight on.
    Line(Line),
    /// Along a circle.
    Arc(Arc),
    /// Along an Archimedean spiral about the origin, inward or outward.
    Spiral(Spiral),
    /// Along an Archimedean spiral about another centre.
    PlacedSpiral(PlacedSpiral),
}

/// Forwards every method of a trait to the curve of the segment, by a match: frames call these methods per handle.
macro_rules! forward {
    ($trait:ident: $(fn $name:ident(&self $(, $argument:ident: $type:ty)*) -> $result:ty;)*) => {
        impl $trait for Segment {
            $(
                #[inline]
                fn $name(&self $(, $argument: $type)*) -> $result {
                    match self {
                        Self::Line(line) => $trait::$name(line $(, $argument)*),
                        Self::Arc(arc) => $trait::$name(arc $(, $argument)*),
                        Self::Spiral(spiral) => $trait::$name(spiral $(, $argument)*),
                        Self::PlacedSpiral(spiral) => $trait::$name(spiral $(, $argument)*),
                    }
                }
            )*
        }
    };
}

forward! { Curve:
    fn point(&self, at: Coordinate) -> Point;
    fn tangent(&self, at: Coordinate) -> Vector;
    fn curvature(&self, at: Coordinate) -> f64;
    fn arc_length(&self, from: Coordinate, to: Coordinate) -> f64;
    fn advance(&self, from: Coordinate, metres: f64) -> Coordinate;
    fn sign(&self) -> f64;
    fn rate(&self, at: Coordinate) -> f64;
    fn contains(&self, at: Coordinate) -> bool;
    fn turning(&self) -> f64;
    fn constant_curvature(&self) -> Option<f64>;
    fn arc_over(&self, chord: f64) -> Option<f64>;
    fn displacement(&self, from: Coordinate, to: Coordinate) -> Vector;
    fn link_pose(&self, front: Coordinate, rear: Coordinate, link: f64) -> LinkPose;
    fn follower(&self, front: Coordinate, behind: f64, link: f64) -> Result<Follower, NoFollower>;
    fn ahead(&self, rear: Coordinate, gap: f64, link: f64) -> Option<f64>;
}

forward! { CurveBounds:
    fn tightens(&self) -> bool;
    fn circumference(&self) -> f64;
    fn length_bound(&self, one: Coordinate, other: Coordinate) -> f64;
    fn largest_summand(&self, first: Coordinate, last: Coordinate, length: f64) -> f64;
    fn second_derivative_bound(&self, at: Coordinate, distance: f64) -> f64;
    fn longest_step(&self) -> f64;
    fn distance_grows(&self, front: Coordinate, rear: Coordinate) -> bool;
    fn is_steady(&self, front: Coordinate, rear: Coordinate) -> bool;
    fn stall_free_until(&self, link: f64) -> Option<Coordinate>;
    fn fold(&self, link: f64) -> Option<f64>;
    fn first_within(&self, disc: &ReachedDisc, begin: Option<Coordinate>, last: Coordinate) -> Option<Coordinate>;
    fn quiet_place(&self, team: &Team, limit: f64, last: Coordinate) -> Option<Coordinate>;
    fn seen_from_frame(&self, moved: (Coordinate, Coordinate), turned: f64, behind: Coordinate) -> Option<f64>;
    fn frame_travel(&self, turned: f64) -> f64;
}

/// The outline of a segment, for drawings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentOutline {
    /// The kind of the curve.
    pub kind: OutlineKind,
    /// Its first point.
    pub start: Point,
    /// The direction of travel there, radians counter-clockwise from x.
    pub heading: f64,
    /// The length along it, in metres.
    pub length: f64,
}

/// The curve of a segment's outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum OutlineKind {
    /// Straight on.
    Line,
    /// Part of a circle.
    Arc {
        /// 1/m, positive if it turns left.
        curvature: f64,
    },
    /// Along r = pitch theta / 2 pi; outward, turned by half a turn.
    Spiral {
        /// Towards the centre or away from it.
        direction: Direction,
        /// The pitch, in metres per turn.
        pitch: f64,
        /// Polar angle of its beginning on the unturned spiral, in radians.
        first: f64,
        /// Polar angle of its end on the unturned spiral, in radians.
        last: f64,
        /// The curvature at its beginning, 1/m, positive to the left. It is given for a piece of a route, and for a
        /// spiral that a placement moves, turns or mirrors. It is NaN for a spiral about the origin.
        curvature: f64,
    },
}

impl OutlineKind {
    /// Returns the kind after a placement other than the identity; `side` is -1 for a reflection, else 1.
    pub(crate) fn placed(self, side: f64) -> Self {
        match self {
            Self::Line => self,
            Self::Arc { curvature } => Self::Arc { curvature: side * curvature },
            Self::Spiral { direction, pitch, first, last, curvature } if curvature.is_finite() => {
                Self::Spiral { direction, pitch, first, last, curvature: side * curvature }
            }
            Self::Spiral { direction, pitch, first, last, .. } => {
                let way = match direction {
                    Direction::Inward => -side,
                    Direction::Outward => side,
                };
                let square = 1.0 + first * first;
                let curvature = way * TAU / pitch * (1.0 + square) / (square * square.sqrt());
                Self::Spiral { direction, pitch, first, last, curvature }
            }
        }
    }

    /// Returns the spiral about the origin, and the polar angle and the curvature of its beginning; `None` for other
    /// curves.
    pub fn spiral(&self) -> Option<(Spiral, f64, f64)> {
        let Self::Spiral { direction, pitch, first, curvature, .. } = *self else { return None };
        Some((Spiral::new(pitch, direction), first, curvature))
    }
}

/// Writes the length and the kind for people.
impl fmt::Display for SegmentOutline {
    fn fmt(&self, text: &mut fmt::Formatter) -> fmt::Result {
        write!(text, "{:.3} m ", self.length)?;
        match self.kind {
            OutlineKind::Line => text.write_str("straight on"),
            OutlineKind::Arc { curvature } => {
                let side = if curvature > 0.0 { "left" } else { "right" };
                write!(text, "to the {side} at radius {:.6} m", 1.0 / curvature.abs())
            }
            OutlineKind::Spiral { direction, pitch, .. } => {
                let way = match direction {
                    Direction::Inward => "inward",
                    Direction::Outward => "outward",
                };
                write!(text, "{way} along a spiral of {pitch} m per turn")
            }
        }
    }
}

impl Segment {
    /// Returns the outline of the `length` metres from one place to another.
    pub(super) fn outline(&self, first: Coordinate, last: Coordinate, length: f64) -> SegmentOutline {
        let tangent = self.tangent(first);
        let spiral = |spiral: &Spiral, curvature| OutlineKind::Spiral {
            direction: spiral.direction(),
            pitch: spiral.pitch(),
            first: first.high,
            last: last.high,
            curvature,
        };
        let kind = match self {
            Self::Line(_) => OutlineKind::Line,
            Self::Arc(arc) => OutlineKind::Arc { curvature: arc.signed_curvature() },
            Self::Spiral(about_origin) => spiral(about_origin, f64::NAN),
            Self::PlacedSpiral(placed) => spiral(placed.spiral(), placed.signed_curvature(first)),
        };
        SegmentOutline { kind, start: self.point(first), heading: atan2(tangent.y, tangent.x), length }
    }
}
