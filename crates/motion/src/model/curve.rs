//! [`Curve`]: the contract of every curve that a path is made of. Units and formulas of a curve are in its own file.
//!
//! Every curve has a coordinate: metres on a line, radians on an arc, the polar angle on a spiral. The coordinate is
//! kept as two doubles, so that a place far along the curve loses no digits. It may grow or fall in the direction of
//! travel.
//!
//! **A new kind of curve** needs a file beside `line` and `arc` that implements this trait and
//! [`CurveBounds`](super::curve_bounds::CurveBounds), a variant of [`Segment`](super::segment::Segment) with its outline,
//! and a variant of `description` that constructs it. Except for `Path::as_spiral`, no other code of `model` matches on
//! kinds of curves. A default method is valid for every curve whose coordinate grows in the direction of travel.

use super::double_double::DoubleDouble;
use super::{Point, Vector};

/// A place on a curve, in the curve's own coordinate.
pub type Coordinate = DoubleDouble;

/// The side to which a curve turns, seen in the direction of travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Counter-clockwise.
    Left,
    /// Clockwise.
    Right,
}

impl Side {
    /// Returns the other side.
    pub fn opposite(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// No point behind is as far away as the link is long: any further motion would make the handle jump.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("no point behind on the path is one link away")]
pub struct NoFollower;

/// The direction of a link and its angles with the path at its two handles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkPose {
    /// The link's unit direction b, from its rear handle to its front one.
    pub direction: Vector,
    /// t . b at the front handle, t the path's unit tangent: 0 is a stall.
    pub front_cosine: f64,
    /// t . b at the rear handle: 0 is a lock.
    pub rear_cosine: f64,
}

impl LinkPose {
    /// Returns the pose of the link between two handles, each given by its point and the path's unit tangent there.
    pub fn between(front: Point, front_tangent: Vector, rear: Point, rear_tangent: Vector) -> Self {
        let direction = (front - rear).normalize();
        Self { direction, front_cosine: direction.dot(&front_tangent), rear_cosine: direction.dot(&rear_tangent) }
    }
}

/// Result of the search for a follower on the front handle's own curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Follower {
    /// The follower is this many units of the coordinate behind the front handle.
    Behind(f64),
    /// Every place of the curve behind the front handle is nearer than the link.
    AllNearer,
    /// The curve has no closed form for this front handle: the path has to be searched.
    Unknown,
}

impl Follower {
    /// Returns the follower `by` units behind, on a curve that reaches `behind` units back and along which the distance
    /// grows up to there.
    #[inline]
    pub fn within(by: f64, behind: f64) -> Self {
        if by <= behind { Self::Behind(by) } else { Self::AllNearer }
    }
}

/// A smooth curve on the stage, travelled in one direction.
///
/// Places are in the curve's coordinate; "units" are units of that coordinate.
pub trait Curve {
    /// Returns the point of a place.
    fn point(&self, at: Coordinate) -> Point;

    /// Returns the unit tangent at a place, in the direction of travel.
    fn tangent(&self, at: Coordinate) -> Vector;

    /// Returns the curvature at a place, 1/m, not negative.
    fn curvature(&self, at: Coordinate) -> f64;

    /// Returns the metres of arc length from one place to another, negative against the direction of travel.
    fn arc_length(&self, from: Coordinate, to: Coordinate) -> f64;

    /// Returns the place `metres` of arc length after another, before it where negative.
    fn advance(&self, from: Coordinate, metres: f64) -> Coordinate;

    /// Returns 1 if the coordinate grows in the direction of travel, -1 if it falls.
    fn sign(&self) -> f64 {
        1.0
    }

    /// Returns the metres of travel per unit at a place, with the sign of [`sign`](Self::sign).
    fn rate(&self, at: Coordinate) -> f64;

    /// Returns the units from one place to another, positive in the direction of travel.
    fn progress(&self, from: Coordinate, to: Coordinate) -> f64 {
        self.sign() * to.minus(from)
    }

    /// Returns the place `by` units further back.
    fn back(&self, at: Coordinate, by: f64) -> Coordinate {
        at.plus(-self.sign() * by)
    }

    /// Returns true if the curve exists at this coordinate.
    fn contains(&self, _at: Coordinate) -> bool {
        true
    }

    /// Returns 1 if the curve turns left, -1 if it turns right, 0 on a line.
    fn turning(&self) -> f64;

    /// Returns the signed curvature, 1/m, positive to the left, of a curve whose curvature is the same everywhere.
    ///
    /// On such a curve a chain keeps its shape, and two joined curves of equal curvature are one line or circle.
    fn constant_curvature(&self) -> Option<f64> {
        None
    }

    /// Returns the metres of arc length over a chord of `chord` metres, if these are the same everywhere.
    fn arc_over(&self, _chord: f64) -> Option<f64> {
        None
    }

    /// Returns the vector from one place to another, metres, with a relative error of a few units in the last place.
    fn displacement(&self, from: Coordinate, to: Coordinate) -> Vector;

    /// Returns the pose of the link of `link` metres between two places.
    fn link_pose(&self, front: Coordinate, rear: Coordinate, _link: f64) -> LinkPose {
        LinkPose::between(self.point(front), self.tangent(front), self.point(rear), self.tangent(rear))
    }

    /// Finds the first place behind `front` at the distance `link` metres, on a curve that extends `behind` units back.
    ///
    /// # Errors
    /// [`NoFollower`] if no place of the curve, continued backward, is as far away before the distance shrinks again.
    fn follower(&self, _front: Coordinate, _behind: f64, _link: f64) -> Result<Follower, NoFollower> {
        Ok(Follower::Unknown)
    }

    /// Returns the change of the coordinate to the place `link` metres of distance ahead of `rear`; `gap` is a guess of
    /// the metres of travel. `None` if there is no such place, or none is found.
    fn ahead(&self, rear: Coordinate, gap: f64, link: f64) -> Option<f64>;
}
