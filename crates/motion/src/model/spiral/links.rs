//! Links with both handles on one spiral: the follower, the handle ahead, the pose.

use std::f64::consts::{FRAC_PI_2, PI};

use super::{Direction, Spiral};
use crate::model::Vector;
use crate::model::curve::{Coordinate, Follower, LinkPose};
use crate::model::elementary::{hypot, sin_cos};
use crate::model::root::increasing_root;

/// A step shorter than this part of the angle is the last of a Newton iteration: the next is below the last digit.
const LAST_STEP: f64 = 1e-9;

impl Spiral {
    /// Returns the pose of a link, from the polar frame of the inner handle.
    pub(super) fn pose(&self, front: Coordinate, rear: Coordinate, link: f64) -> LinkPose {
        let (inner, d) = match self.direction() {
            Direction::Inward => (front, rear.minus(front)),
            Direction::Outward => (rear, front.minus(rear)),
        };
        let a = self.radius_per_radian();
        let r = self.radius(inner);
        let outer = r + a * d;
        let (half_sine, half_cosine) = sin_cos(0.5 * d);
        let (square, sine) = (2.0 * half_sine * half_sine, 2.0 * half_sine * half_cosine);
        // Inner minus outer handle: (r - r' cos d) e_r - r' sin d e_phi.
        let radial = (outer * square - a * d) / link;
        let around = -outer * sine / link;
        let (polar_sine, polar_cosine) = inner.sine_and_cosine();
        let direction =
            Vector::new(radial * polar_cosine - around * polar_sine, radial * polar_sine + around * polar_cosine);
        // Both cosines from t = -(a e_r + r e_phi) / sqrt(a^2 + r^2) in the frame of the handle concerned.
        let common = a * a * d + r * outer * sine;
        let inner_cosine = (common - a * outer * square) / (link * hypot(r, a));
        let outer_cosine = (common + a * r * square) / (link * hypot(outer, a));
        // Turned by half a turn and travelled the other way, the outward spiral has the inward one's links, ends
        // exchanged.
        match self.direction() {
            Direction::Inward => LinkPose { direction, front_cosine: inner_cosine, rear_cosine: outer_cosine },
            Direction::Outward => LinkPose { direction, front_cosine: outer_cosine, rear_cosine: inner_cosine },
        }
    }

    /// Returns the follower of a handle at `front` on an outward spiral.
    ///
    /// With r' = r - a d at the follower, the square of the chord is (a d)^2 + 4 r r' sin^2(d/2). This square grows
    /// with d while tan(d/2) <= r'/a. Beyond theta = 1 + pi/2 the condition holds for a quarter of a turn.
    pub(in crate::model) fn inner_follower(&self, front: Coordinate, behind: f64, link: f64) -> Follower {
        if front.high < 1.0 + FRAC_PI_2 {
            return Follower::Unknown;
        }
        let (a, r) = (self.radius_per_radian(), self.radius(front));
        let residual = |d: f64| {
            let (sine, cosine) = sin_cos(0.5 * d);
            let (rise, inner) = (a * d, r - a * d);
            let value = rise.mul_add(rise, (2.0 * r * sine) * (2.0 * inner * sine)) - link * link;
            let slope = 2.0 * a * rise - 4.0 * r * a * sine * sine + 4.0 * r * inner * sine * cosine;
            (value, slope)
        };
        let high = behind.min(FRAC_PI_2);
        if residual(high).0 >= 0.0 {
            Follower::Behind(increasing_root(residual, 0.0, high, link / hypot(r, a)))
        } else if behind <= FRAC_PI_2 {
            Follower::AllNearer
        } else {
            Follower::Unknown
        }
    }

    /// Returns the angle from a place to the one `link` metres ahead, about `gap` metres of travel ahead.
    ///
    /// Newton's method for (g d)^2 + 4 r (r + g d) sin^2(d/2) = link^2 (law of cosines), r the radius and g its change
    /// per radian.
    pub(super) fn angle_ahead(&self, from: Coordinate, gap: f64, link: f64) -> Option<f64> {
        let (r, a) = (self.radius(from), self.radius_per_radian());
        let (radius_per_radian, sign) = if self.direction() == Direction::Inward { (-a, -1.0) } else { (a, 1.0) };
        // Along the rows of a table, the rounding of the square would add up.
        let (square, low) = (link * link, link.mul_add(link, -(link * link)));
        let mut d = gap / hypot(r, a);
        for _ in 0..20 {
            let (sine, cosine) = sin_cos(0.5 * d);
            let rise = radius_per_radian * d;
            let other = r + rise;
            let value = (2.0 * r * sine).mul_add(2.0 * other * sine, -square) + rise.mul_add(rise, -low);
            let slope = 2.0 * radius_per_radian * rise + 4.0 * r * sine * (radius_per_radian * sine + other * cosine);
            let step = value / slope;
            d -= step;
            if !(d > 0.0 && d < PI && r + radius_per_radian * d > 0.0) {
                return None;
            }
            if step.abs() < LAST_STEP * d {
                return Some(sign * d);
            }
        }
        None
    }
}
