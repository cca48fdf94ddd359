//! [`CurveBounds`]: bounds of a curve, with which a search leaves out places or takes longer steps. A frame uses them
//! only where a follower has no closed form.

use super::Point;
use super::curve::{Coordinate, Curve};
use super::team::Team;

/// The reach of a search: a board with its nearer handle outside the disc is farther than the limit from the boards
/// searched.
#[derive(Debug, Clone, Copy)]
pub struct ReachedDisc {
    /// Centre of the disc.
    pub centre: Point,
    /// The radius of the disc, in metres.
    pub radius: f64,
    /// Radius, metres, of the circle about the origin with the same property for boards on an inward spiral about it.
    pub about_origin: f64,
}

/// Bounds of a curve, for searches. A default is valid for every curve, and only makes a search slower. Places and units
/// are those of [`Curve`].
pub trait CurveBounds: Curve {
    /// Returns true if the curvature of every stretch is greatest where the stretch ends, false if where it begins.
    fn tightens(&self) -> bool;

    /// Returns the metres of travel after which every point of the curve has been passed.
    fn circumference(&self) -> f64 {
        f64::INFINITY
    }

    /// Returns an upper bound of the metres of arc length between two places.
    fn length_bound(&self, one: Coordinate, other: Coordinate) -> f64 {
        self.arc_length(one, other).abs()
    }

    /// Returns the largest summand of the points from one place to another, `length` metres later, or a bound of it,
    /// metres. The points of a curve about the origin have none.
    fn largest_summand(&self, first: Coordinate, _last: Coordinate, length: f64) -> f64 {
        self.point(first).coords.amax().max(length)
    }

    /// Returns an upper bound of half the second derivative, by the coordinate, of the squared distance to a point F.
    ///
    /// The bound holds where that distance is at most `distance` metres and the place within
    /// [`longest_step`](Self::longest_step) behind `at`: |p'|^2 + (p - F) . p'' <= |p'|^2 + distance |p''|.
    fn second_derivative_bound(&self, at: Coordinate, distance: f64) -> f64;

    /// Returns the greatest step, in units, for which [`second_derivative_bound`](Self::second_derivative_bound) holds.
    fn longest_step(&self) -> f64 {
        f64::INFINITY
    }

    /// Returns true if the distance from `front` is known to grow everywhere back to `rear`.
    fn distance_grows(&self, _front: Coordinate, _rear: Coordinate) -> bool {
        false
    }

    /// Returns true if a link with these handles is known not to stall or lock while both stay on the curve.
    fn is_steady(&self, _front: Coordinate, _rear: Coordinate) -> bool {
        false
    }

    /// Returns the place up to which no link of `link` metres stalls or locks, on the first curve of a path. Returns
    /// `None` if no link stalls or locks anywhere on the curve.
    fn stall_free_until(&self, _link: f64) -> Option<Coordinate> {
        None
    }

    /// Returns the coordinate of the front handle at which a link of `link` metres locks with both handles on the
    /// curve.
    fn fold(&self, _link: f64) -> Option<f64> {
        None
    }

    /// Returns the first place of the curve from which a board can reach into the disc, or an earlier place. Returns
    /// `None` if no board up to `last` can. `begin` is where the curve begins, `None` for the first curve of a path.
    fn first_within(&self, disc: &ReachedDisc, begin: Option<Coordinate>, last: Coordinate) -> Option<Coordinate>;

    /// Returns the place of a path's first curve, ending at `last`, behind which no two boards without a common handle
    /// ever come within `limit` metres.
    fn quiet_place(&self, _team: &Team, _limit: f64, _last: Coordinate) -> Option<Coordinate> {
        None
    }

    /// Returns an upper bound of the metres that a handle moves from `first` to `last`. The motion is seen from a frame
    /// that moves rigidly with a reference handle.
    ///
    /// The coordinate of the reference handle changes by `turned`; `behind` is where its follower was. `None` if no
    /// bound below the handle's own path length is known.
    fn seen_from_frame(
        &self,
        (_first, _last): (Coordinate, Coordinate),
        _turned: f64,
        _behind: Coordinate,
    ) -> Option<f64> {
        None
    }

    /// Returns the metres that the frame of [`seen_from_frame`](Self::seen_from_frame) moves.
    fn frame_travel(&self, _turned: f64) -> f64 {
        0.0
    }
}
