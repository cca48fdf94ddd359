//! The first place behind a handle at the link's distance, in doubles: the first guess of the reference.
//!
//! The straight-line distance from the handle grows by at most a metre per metre of path. So from a place whose
//! distance is m metres short of the link, a step of m metres back cannot pass the place sought (sphere tracing: Hart,
//! The Visual Computer 12, 1996, for rays). The points are displacements from places that the reference knows exactly,
//! so that they keep their digits far from the origin. Only the reference calls it.

use super::path::{Curve, RealParam, Segment};
use crate::linkage::NoFollower;
use crate::model::Vector;
use crate::model::spiral::Direction;

/// The finest step, in links: a shorter stretch outside the link's reach may be overlooked.
const FINEST: f64 = 1e-9;

/// The longest step on a spiral, radians: short against the half turns over which the growth of a chord changes its
/// sign.
const LONGEST: f64 = 0.05;

/// Least decrease of a distance, in links, that counts as more than rounding.
const NOISE: f64 = 1e-14;

/// Steps after which the search on one segment gives up.
const MOST_STEPS: usize = 10_000_000;

/// The way back along a curve from one of its places, seen from the front handle of a link.
pub(super) struct Walk<'a> {
    curve: &'a Curve,
    /// The coordinate of the place, and the units of the curve behind it.
    at: f64,
    behind: f64,
    /// From the front handle to the place.
    offset: Vector,
    slope: Vector,
    /// Of the arc, with the sign of its curvature; of the spiral, per radian.
    radius: f64,
    /// 1 if the polar angle of a spiral grows counter-clockwise, else -1.
    sense: f64,
    /// True if the handle is on this curve, the path's first, and the distance can shrink only after a fold.
    folds: bool,
}

impl<'a> Walk<'a> {
    /// Starts from `place` on `segment`, for the handle at `front`. `is_first`: the segment is the path's first.
    pub fn new(segment: &'a Segment, is_first: bool, place: &RealParam, front: &RealParam) -> Self {
        let radius = match &segment.curve {
            Curve::Line { .. } => f64::INFINITY,
            Curve::Arc { radius, sense, .. } => (sense * radius).rounded(),
            Curve::Spiral { radius_per_radian, .. } => radius_per_radian.rounded(),
        };
        let sense = if let Curve::Spiral { sense, .. } = &segment.curve { sense.rounded() } else { 1.0 };
        let behind = segment.curve.forward() * (&place.at - &segment.first.at).rounded();
        Self {
            curve: &segment.curve,
            at: place.at.rounded(),
            behind: if is_first { f64::INFINITY } else { behind },
            offset: (&place.point - &front.point).rounded(),
            slope: place.slope.rounded(),
            radius,
            sense,
            folds: is_first && std::ptr::eq(place, front) && is_inward(&segment.curve),
        }
    }

    /// Returns how far back, in units of the coordinate, the first place is that is `link` metres from the front
    /// handle; `None` if the segment has none.
    ///
    /// # Errors
    /// [`NoFollower`] if a handle on the inward spiral comes nearer again first.
    pub fn first_at(&self, link: f64) -> Result<Option<f64>, NoFollower> {
        let (mut back, mut distance) = (0.0, self.offset.norm());
        let mut farthest = distance;
        if distance >= link {
            return Ok(Some(0.0));
        }
        for _ in 0..MOST_STEPS {
            let next = self.behind.min(back + self.safe_step(back, (link - distance).max(FINEST * link)));
            let reached = self.position(next).norm();
            if reached >= link {
                // The step was one of the finest: the path is straight to rounding.
                return Ok(Some(back + (next - back) * (link - distance) / (reached - distance)));
            }
            if next == self.behind {
                return Ok(None);
            }
            farthest = reached.max(farthest);
            if self.folds && reached < farthest - NOISE * link {
                return Err(NoFollower);
            }
            (back, distance) = (next, reached);
        }
        Err(NoFollower)
    }

    /// Returns how far back along the coordinate from `back` at most `metres` of path lead.
    fn safe_step(&self, back: f64, metres: f64) -> f64 {
        match self.curve {
            Curve::Line { .. } => metres,
            Curve::Arc { .. } => metres / self.radius.abs(),
            Curve::Spiral { direction, .. } => {
                let step = |theta: f64| (metres / (self.radius * 1f64.hypot(theta))).min(LONGEST);
                match direction {
                    // Further out a radian is longer: first by the rate here, then by the rate at the end of that step.
                    Direction::Inward => step(self.at + back + step(self.at + back)),
                    Direction::Outward => step(self.at - back),
                }
            }
        }
    }

    /// Returns the vector from the front handle to the point `back` behind the place.
    fn position(&self, back: f64) -> Vector {
        let left = |vector: Vector| Vector::new(-vector.y, vector.x);
        let half_sine = (0.5 * back).sin();
        let versine = 2.0 * half_sine * half_sine;
        let displacement = match self.curve {
            Curve::Line { .. } => -back * self.slope,
            Curve::Arc { .. } => versine * self.radius.signum() * left(self.slope) - back.sin() * self.slope,
            Curve::Spiral { direction, .. } => {
                let d = if *direction == Direction::Inward { back } else { -back };
                let (a, r) = (self.radius, self.radius * self.at);
                let other = r + a * d;
                // p' = (a + r J) e for p = r e, J the quarter turn in which the polar angle grows.
                let e = (a * self.slope - r * self.sense * left(self.slope)) / (a * a + r * r);
                (a * d - other * versine) * e + other * d.sin() * self.sense * left(e)
            }
        };
        self.offset + displacement
    }
}

fn is_inward(curve: &Curve) -> bool {
    matches!(curve, Curve::Spiral { direction: Direction::Inward, .. })
}
