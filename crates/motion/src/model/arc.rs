//! The arc of a circle.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::curve::{Coordinate, Curve, Follower, LinkPose, NoFollower, Side};
use super::curve_bounds::{CurveBounds, ReachedDisc};
use super::double_double::DoubleDouble;
use super::elementary;
use super::{Point, Vector};

/// An arc of a circle. Its coordinate is radians turned since its first point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// The point at 0.
    pub origin: Point,
    /// Unit direction of travel at 0.
    pub direction: Vector,
    /// Unit vector from the point at 0 towards the centre.
    pub inward: Vector,
    /// The radius, in metres.
    pub radius: f64,
}

impl Arc {
    /// Creates the arc from a point in a unit direction, its centre on one side.
    pub fn new(origin: Point, direction: Vector, side: Side, radius: f64) -> Self {
        let left = Vector::new(-direction.y, direction.x);
        let inward = match side {
            Side::Left => left,
            Side::Right => -left,
        };
        Self { origin, direction, inward, radius }
    }

    /// Returns the curvature, 1/m, positive where the arc turns left.
    pub fn signed_curvature(&self) -> f64 {
        self.turning() / self.radius
    }

    /// Returns the angle psi that a chord subtends, radians, from chord = 2 radius sin(psi/2). `None` for a chord
    /// longer than the diameter.
    #[inline]
    fn angle_over(&self, chord: f64) -> Option<f64> {
        (chord <= 2.0 * self.radius).then(|| 2.0 * elementary::asin(0.5 * chord / self.radius))
    }
}

impl Curve for Arc {
    fn point(&self, at: Coordinate) -> Point {
        // With half angles, short distances keep all their digits.
        let (sine, cosine) = half(at).sine_and_cosine();
        let (along, across) = (2.0 * sine * cosine, 2.0 * sine * sine);
        self.origin + self.radius * (along * self.direction + across * self.inward)
    }

    fn tangent(&self, at: Coordinate) -> Vector {
        let (sine, cosine) = half(at).sine_and_cosine();
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

    fn rate(&self, _: Coordinate) -> f64 {
        self.radius
    }

    fn turning(&self) -> f64 {
        self.direction.perp(&self.inward).signum()
    }

    fn constant_curvature(&self) -> Option<f64> {
        Some(self.signed_curvature())
    }

    fn arc_over(&self, chord: f64) -> Option<f64> {
        self.angle_over(chord).map(|angle| self.radius * angle)
    }

    fn displacement(&self, from: Coordinate, to: Coordinate) -> Vector {
        // The chord is parallel to the tangent half way.
        let half = 0.5 * to.minus(from);
        2.0 * self.radius * elementary::sin(half) * self.tangent(from.plus(half))
    }

    fn link_pose(&self, front: Coordinate, rear: Coordinate, _: f64) -> LinkPose {
        // The chord is parallel to the tangent half way.
        let half = 0.5 * front.minus(rear);
        let cosine = elementary::cos(half);
        LinkPose { direction: self.tangent(rear.plus(half)), front_cosine: cosine, rear_cosine: cosine }
    }

    fn follower(&self, _: Coordinate, behind: f64, link: f64) -> Result<Follower, NoFollower> {
        Ok(self.angle_over(link).map_or(Follower::AllNearer, |angle| Follower::within(angle, behind)))
    }

    fn ahead(&self, _: Coordinate, _: f64, link: f64) -> Option<f64> {
        self.angle_over(link)
    }
}

impl CurveBounds for Arc {
    fn tightens(&self) -> bool {
        false
    }

    fn circumference(&self) -> f64 {
        TAU * self.radius
    }

    fn largest_summand(&self, _: Coordinate, _: Coordinate, length: f64) -> f64 {
        self.origin.coords.amax().max(length.min(2.0 * self.radius))
    }

    fn second_derivative_bound(&self, _: Coordinate, distance: f64) -> f64 {
        self.radius * (self.radius + distance)
    }

    fn distance_grows(&self, front: Coordinate, rear: Coordinate) -> bool {
        rear.minus(front).abs() <= FRAC_PI_2
    }

    fn is_steady(&self, _: Coordinate, _: Coordinate) -> bool {
        true
    }

    fn first_within(&self, disc: &ReachedDisc, _: Option<Coordinate>, last: Coordinate) -> Option<Coordinate> {
        let offset: Vector = disc.centre - (self.origin + self.radius * self.inward);
        let distance = offset.norm();
        if (distance - self.radius).abs() > disc.radius {
            return None;
        }
        // Half the angle that the disc covers, by the law of cosines.
        let cosine = (distance * distance + self.radius * self.radius - disc.radius * disc.radius)
            / (2.0 * distance * self.radius);
        let half = if cosine.is_finite() { elementary::acos(cosine.clamp(-1.0, 1.0)) } else { TAU };
        let towards = elementary::atan2(offset.dot(&self.direction), -offset.dot(&self.inward));
        let first = if towards.abs() <= half { 0.0 } else { (towards - half).rem_euclid(TAU) };
        let at = Coordinate { high: first, low: 0.0 };
        (at.minus(last) <= 0.0).then_some(at)
    }
}

fn half(at: Coordinate) -> Coordinate {
    Coordinate { high: 0.5 * at.high, low: 0.5 * at.low }
}
