//! What every path is: a curve that the head travels by arc length and on which each handle finds the one before it.
//!
//! The chain, the events and the commands know a path only through [`Path`].

use super::{Point, Vector};

/// A smooth curve on the stage, travelled in one direction from distance 0 to its [`length`](Path::length).
///
/// "Ahead" is in the direction of travel, "behind" against it. A path reaches as far behind its start as a team needs.
pub trait Path {
    /// A place on the path, kept in whatever form loses the fewest digits.
    type Place: Copy + std::fmt::Debug + PartialEq;

    /// Metres from the start to the end of the path.
    fn length(&self) -> f64;

    /// The place that is `travelled` metres of arc length past the start; clamped to the path's end.
    ///
    /// The error is at most 4 eps (r + |travelled|) along the curve, r being the distance from the origin.
    fn place_at(&self, travelled: f64) -> Self::Place;

    /// The point of a place.
    fn point(&self, place: Self::Place) -> Point;

    /// The unit tangent of a place, in the direction of travel.
    fn tangent(&self, place: Self::Place) -> Vector;

    /// Metres of arc length from `behind` to `ahead`; negative when they are the other way round.
    fn distance_between(&self, behind: Self::Place, ahead: Self::Place) -> f64;

    /// The first place behind `front` whose straight-line distance from it is `link` metres.
    ///
    /// # Errors
    /// [`Fold`] where there is none before the distance begins to shrink again: the link is locked.
    fn follower(&self, front: Self::Place, link: f64) -> Result<Self::Place, Fold>;

    /// How far a handle moves at most on its way from one place to another, going one way, seen from a frame that turns
    /// about a fixed centre with another handle of the chain, which meanwhile goes from `companion.0` to `companion.1`.
    /// `None` where the path there has no such centre.
    fn motion_beside(
        &self,
        _from: Self::Place,
        _to: Self::Place,
        _companion: (Self::Place, Self::Place),
    ) -> Option<f64> {
        None
    }

    /// How a link of `link` metres from `front` to its follower `rear` lies across the path.
    fn bench(&self, front: Self::Place, rear: Self::Place, link: f64) -> BenchOnPath;
}

/// How a bench lies across the path at its two handles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BenchOnPath {
    /// The bench's unit direction b, from its rear handle to its front one.
    pub direction: Vector,
    /// t . b at the front handle, t the path's unit tangent: 0 is a stall.
    pub front_cosine: f64,
    /// t . b at the rear handle: 0 is a lock.
    pub rear_cosine: f64,
}

/// No point behind is as far away as the link is long: going on would make the handle jump to another turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("no point behind on the path is one link away")]
pub struct Fold;
