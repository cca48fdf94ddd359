//! The straight line.

use super::curve::{Coordinate, Curve, Follower, NoFollower};
use super::curve_bounds::{CurveBounds, ReachedDisc};
use super::team::Team;
use super::{Point, Vector};

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

    fn rate(&self, _: Coordinate) -> f64 {
        1.0
    }

    fn turning(&self) -> f64 {
        0.0
    }

    fn constant_curvature(&self) -> Option<f64> {
        Some(0.0)
    }

    fn arc_over(&self, chord: f64) -> Option<f64> {
        Some(chord)
    }

    fn displacement(&self, from: Coordinate, to: Coordinate) -> Vector {
        to.minus(from) * self.direction
    }

    fn follower(&self, _: Coordinate, behind: f64, link: f64) -> Result<Follower, NoFollower> {
        Ok(Follower::within(link, behind))
    }

    fn ahead(&self, _: Coordinate, _: f64, link: f64) -> Option<f64> {
        Some(link)
    }
}

impl CurveBounds for Line {
    fn tightens(&self) -> bool {
        false
    }

    fn largest_summand(&self, _: Coordinate, _: Coordinate, _: f64) -> f64 {
        self.origin.coords.amax()
    }

    fn second_derivative_bound(&self, _: Coordinate, _: f64) -> f64 {
        1.0
    }

    fn distance_grows(&self, _: Coordinate, _: Coordinate) -> bool {
        true
    }

    fn is_steady(&self, _: Coordinate, _: Coordinate) -> bool {
        true
    }

    fn first_within(&self, disc: &ReachedDisc, begin: Option<Coordinate>, last: Coordinate) -> Option<Coordinate> {
        let offset = disc.centre - self.origin;
        let across = self.direction.perp(&offset);
        let square = disc.radius * disc.radius - across * across;
        let first = (square >= 0.0).then(|| self.direction.dot(&offset) - square.sqrt())?;
        let at = Coordinate { high: begin.map_or(first, |begin| first.max(begin.high)), low: 0.0 };
        (at.minus(last) <= 0.0).then_some(at)
    }

    fn quiet_place(&self, team: &Team, limit: f64, last: Coordinate) -> Option<Coordinate> {
        (team.link(1) - 2.0 * team.hole_inset > limit).then_some(last)
    }
}
