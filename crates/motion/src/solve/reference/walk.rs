//! The first place behind a handle at the link's distance, in doubles: the first guess of the reference.
//!
//! The straight-line distance from the handle grows by at most a metre per metre of path. So from a place whose
//! distance is m metres short of the link, a step of m metres back cannot pass the place sought. This method is sphere
//! tracing (Hart, The Visual Computer 12, 1996, for rays). The points are displacements from places that the reference
//! knows exactly, so that they keep their digits far from the origin.

use super::curve::{RealParam, RoughPlace};
use super::path::Segment;
use crate::linkage::NoFollower;
use crate::model::Vector;

/// The finest step, in links: a shorter stretch outside the link's reach may be overlooked.
const FINEST: f64 = 1e-9;

/// The least decrease of a distance, in links, that counts as more than rounding.
const NOISE: f64 = 1e-14;

/// The steps after which the search on one segment gives up.
const MOST_STEPS: usize = 10_000_000;

/// The way back along a curve from one of its places, seen from the front handle of a link.
pub(super) struct Walk<'a> {
    place: RoughPlace<'a>,
    /// The units of the curve's coordinate behind the place.
    behind: f64,
    /// The vector from the front handle to the place.
    offset: Vector,
    /// True if the handle is on this curve, the path's first, and the distance can shrink only after a fold.
    folds: bool,
}

impl<'a> Walk<'a> {
    /// Starts from `place` on `segment`, for the handle at `front`. `is_first`: the segment is the path's first.
    pub fn new(segment: &'a Segment, is_first: bool, place: &RealParam, front: &RealParam) -> Self {
        let behind = segment.curve.forward() * (&place.at - &segment.first.at).rounded();
        Self {
            place: segment.curve.rough(place),
            behind: if is_first { f64::INFINITY } else { behind },
            offset: (&place.point - &front.point).rounded(),
            folds: is_first && std::ptr::eq(place, front) && segment.curve.shrinks_after_a_fold(),
        }
    }

    /// Returns the distance back to the first place that is `link` metres from the front handle, in units of the
    /// coordinate. Returns `None` if the segment has no such place.
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
            let next = self.behind.min(back + self.place.safe_step(back, (link - distance).max(FINEST * link)));
            let reached = (self.offset + self.place.displacement(next)).norm();
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
}
