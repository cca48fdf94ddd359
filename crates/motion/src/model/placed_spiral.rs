//! A spiral piece of a route: a [`Spiral`] mirrored, rotated and moved so that one of its places becomes a given point
//! with a given direction of travel.

use super::curve::{Coordinate, Curve, Follower, LinkPose, NoFollower, Side};
use super::curve_bounds::{CurveBounds, ReachedDisc};
use super::spiral::{Direction, Spiral};
use super::{Point, Vector};

/// A spiral with its centre anywhere. Its coordinate is that of the spiral about the origin.
///
/// Distances, angles and lengths are those of the spiral about the origin. Points are displacements from the place
/// where the piece begins, so that their rounding does not grow with the distance of the centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedSpiral {
    spiral: Spiral,
    /// The place where the piece begins, and its point.
    first: Coordinate,
    origin: Point,
    /// The rotation, after a reflection of y if `mirror` is -1.
    cosine: f64,
    sine: f64,
    mirror: f64,
}

impl PlacedSpiral {
    /// Creates the spiral whose place `first` is the point `origin`, with a unit direction of travel there and its
    /// centre on one side.
    pub fn new(origin: Point, direction: Vector, side: Side, spiral: Spiral, first: Coordinate) -> Self {
        let turns_left = spiral.turning() > 0.0;
        let mirror = if turns_left == (side == Side::Left) { 1.0 } else { -1.0 };
        let tangent = spiral.tangent(first);
        let tangent = Vector::new(tangent.x, mirror * tangent.y);
        Self { spiral, first, origin, cosine: tangent.dot(&direction), sine: tangent.perp(&direction), mirror }
    }

    /// Returns the spiral about the origin.
    pub fn spiral(&self) -> &Spiral {
        &self.spiral
    }

    /// Returns the centre.
    pub fn centre(&self) -> Point {
        self.origin - self.vector(self.spiral.point(self.first).coords)
    }

    /// Returns the curvature at a place, 1/m, positive to the left.
    pub fn signed_curvature(&self, at: Coordinate) -> f64 {
        self.turning() * self.curvature(at)
    }

    /// Returns the vector of one about the origin.
    fn vector(&self, vector: Vector) -> Vector {
        let (x, y) = (vector.x, self.mirror * vector.y);
        Vector::new(self.cosine * x - self.sine * y, self.sine * x + self.cosine * y)
    }
}

impl Curve for PlacedSpiral {
    fn point(&self, at: Coordinate) -> Point {
        self.origin + self.displacement(self.first, at)
    }

    fn tangent(&self, at: Coordinate) -> Vector {
        self.vector(self.spiral.tangent(at))
    }

    fn curvature(&self, at: Coordinate) -> f64 {
        self.spiral.curvature(at)
    }

    fn arc_length(&self, from: Coordinate, to: Coordinate) -> f64 {
        self.spiral.arc_length(from, to)
    }

    fn advance(&self, from: Coordinate, metres: f64) -> Coordinate {
        self.spiral.advance(from, metres)
    }

    fn sign(&self) -> f64 {
        self.spiral.sign()
    }

    fn rate(&self, at: Coordinate) -> f64 {
        self.spiral.rate(at)
    }

    fn contains(&self, at: Coordinate) -> bool {
        self.spiral.contains(at)
    }

    fn turning(&self) -> f64 {
        self.mirror * self.spiral.turning()
    }

    fn displacement(&self, from: Coordinate, to: Coordinate) -> Vector {
        self.vector(self.spiral.displacement(from, to))
    }

    fn link_pose(&self, front: Coordinate, rear: Coordinate, link: f64) -> LinkPose {
        let pose = self.spiral.link_pose(front, rear, link);
        LinkPose { direction: self.vector(pose.direction), ..pose }
    }

    /// On the inward spiral the chord grows back to its first maximum. Behind a fold the path is searched: a later turn
    /// of the spiral, or the curve before it, has the follower.
    fn follower(&self, front: Coordinate, behind: f64, link: f64) -> Result<Follower, NoFollower> {
        Ok(match self.spiral.direction() {
            Direction::Inward => match self.spiral.follower_angle(self.spiral.radius(front), link) {
                Ok(by) => Follower::within(by, behind),
                Err(NoFollower) => Follower::Unknown,
            },
            Direction::Outward => self.spiral.inner_follower(front, behind, link),
        })
    }

    fn ahead(&self, rear: Coordinate, gap: f64, link: f64) -> Option<f64> {
        self.spiral.ahead(rear, gap, link)
    }
}

impl CurveBounds for PlacedSpiral {
    fn tightens(&self) -> bool {
        self.spiral.tightens()
    }

    fn length_bound(&self, one: Coordinate, other: Coordinate) -> f64 {
        self.spiral.length_bound(one, other)
    }

    fn largest_summand(&self, first: Coordinate, last: Coordinate, length: f64) -> f64 {
        let widest = self.spiral.radius(first).max(self.spiral.radius(last));
        self.point(first).coords.amax().max(length.min(2.0 * widest))
    }

    fn second_derivative_bound(&self, at: Coordinate, distance: f64) -> f64 {
        self.spiral.second_derivative_bound(at, distance)
    }

    fn longest_step(&self) -> f64 {
        self.spiral.longest_step()
    }

    fn distance_grows(&self, front: Coordinate, rear: Coordinate) -> bool {
        self.spiral.distance_grows(front, rear)
    }

    fn is_steady(&self, front: Coordinate, rear: Coordinate) -> bool {
        self.spiral.is_steady(front, rear)
    }

    /// The disc lies in the ring about the centre between its least and its greatest distance from there.
    fn first_within(&self, disc: &ReachedDisc, begin: Option<Coordinate>, last: Coordinate) -> Option<Coordinate> {
        let (away, a) = ((disc.centre - self.centre()).norm(), self.spiral.radius_per_radian());
        let [near, far] = [away - disc.radius, away + disc.radius].map(|radius| radius / a);
        let begin = begin.unwrap_or(self.first);
        let met = match self.spiral.direction() {
            Direction::Inward => (far >= last.high && near <= begin.high).then_some(far.min(begin.high)),
            Direction::Outward => (far >= begin.high && near <= last.high).then_some(near.max(begin.high)),
        };
        met.map(|high| if high == begin.high { begin } else { Coordinate { high, low: 0.0 } })
    }

    fn seen_from_frame(&self, moved: (Coordinate, Coordinate), turned: f64, behind: Coordinate) -> Option<f64> {
        self.spiral.seen_from_frame(moved, turned, behind)
    }

    fn frame_travel(&self, turned: f64) -> f64 {
        self.spiral.frame_travel(turned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::double_double::DoubleDouble;

    /// The four kinds of pieces against the definition: r = a theta about the centre, which lies on the given side at
    /// the given distance.
    #[test]
    fn radius_and_polar_angle_about_the_centre_are_those_of_a_spiral() {
        let (pitch, radius) = (0.55, 4.2);
        let first = DoubleDouble::from_turns(radius / pitch);
        let (origin, heading) = (Point::new(7.0, -3.0), 0.7f64);
        let ahead = Vector::new(heading.cos(), heading.sin());
        for direction in [Direction::Inward, Direction::Outward] {
            for (side, left) in [(Side::Left, 1.0), (Side::Right, -1.0)] {
                let spiral = PlacedSpiral::new(origin, ahead, side, Spiral::new(pitch, direction), first);
                assert!(
                    (spiral.point(first) - origin).norm() < 1e-15 && (spiral.tangent(first) - ahead).norm() < 1e-15
                );
                let spoke = origin - spiral.centre();
                assert!((spoke.norm() - radius).abs() < 1e-14 && left * ahead.perp(&spoke) < 0.0);
                let grows = if direction == Direction::Inward { -1.0 } else { 1.0 };
                for turned in [0.1, 0.25, 1.0, 3.3] {
                    let at = first.plus(grows * std::f64::consts::TAU * turned);
                    let here = spiral.point(at) - spiral.centre();
                    assert!((here.norm() - radius - grows * pitch * turned).abs() < 1e-14, "{turned} {here}");
                    // Left means counter-clockwise about the centre.
                    let angle = left * std::f64::consts::TAU * turned;
                    assert!((nalgebra::Rotation2::new(angle) * spoke.normalize() - here.normalize()).norm() < 1e-14);
                    let step = 1e-6;
                    let next = spiral.point(spiral.advance(at, step));
                    assert!(((next - spiral.point(at)) / step - spiral.tangent(at)).norm() < 1e-5);
                    let bend = spiral.tangent(at).perp(&spiral.tangent(spiral.advance(at, step))) / step;
                    assert!((bend - spiral.signed_curvature(at)).abs() < 1e-4, "{bend}");
                }
            }
        }
    }
}
