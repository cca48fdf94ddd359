//! Places along a path relative to each other, to the last digit at any distance from the origin, and the step from a
//! handle to the handle ahead.
//!
//! In: a path and places on it. Out: displacements, places at a link's distance, [`Node`]s. Of frames only those of a
//! team with a tail of its own length use it, besides the making of the table.

use std::sync::Arc;

use crate::linkage;
use crate::model::Vector;
use crate::model::curve::{Coordinate, Curve};
use crate::model::elementary;
use crate::model::path::{Param, Path};

/// A path with the coordinates at which its segments join.
#[derive(Debug)]
pub(super) struct Track<'a> {
    pub path: &'a Path,
    pub ends: Ends,
}

/// The first and the last coordinate of each segment. Shared, so that a frame makes a track without allocation.
pub(super) type Ends = Arc<[[Coordinate; 2]]>;

/// The place of one handle of a chain of equal links, and its change with alpha. Alpha is the number of links, with
/// fraction, behind a fixed place of the chain.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub at: Param,
    pub tangent: Vector,
    /// The length along the path, against the travel, per unit of alpha, in metres.
    pub spacing: f64,
    /// The direction of the link that the handle leads, radians, and its derivative by alpha.
    pub heading: f64,
    pub heading_rate: f64,
}

/// The pose and the turning of a link, from its rear handle to its front one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    pub heading: f64,
    /// The speed of the rear handle over that of the front one.
    pub speed_ratio: f64,
    /// The change of heading per metre of the front handle's travel, in radians.
    pub heading_per_metre: f64,
}

/// A step shorter than this, in links, is the last of a Newton iteration: the next would be below the last digit.
const LAST_STEP: f64 = 1e-9;

impl<'a> Track<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self { path, ends: (0..path.segments()).map(|segment| [path.first(segment), path.last(segment)]).collect() }
    }

    /// Returns the vector from one place to another, with a relative error of a few units in the last place.
    pub(super) fn displacement(&self, from: Param, to: Param) -> Vector {
        if from.segment > to.segment {
            return -self.displacement(to, from);
        }
        if from.segment < to.segment {
            let end = Param { segment: from.segment, at: self.ends[from.segment][1] };
            let next = Param { segment: from.segment + 1, at: self.ends[from.segment + 1][0] };
            return self.displacement(from, end) + self.displacement(next, to);
        }
        self.path.segment(from).displacement(from.at, to.at)
    }

    /// Returns the place about `metres` further along, exact to first order: for a guess, or the last step of an
    /// iteration.
    ///
    /// The last segment continues beyond its end. `None` at the centre of a spiral.
    pub(super) fn moved(&self, from: Param, metres: f64) -> Option<Param> {
        let mut place = from;
        let mut left = metres;
        loop {
            let segment = self.path.segment(place);
            let rate = segment.rate(place.at);
            let by = left / rate;
            let ahead = metres > 0.0;
            let next = if ahead { place.segment + 1 } else { place.segment.wrapping_sub(1) };
            let end = if ahead { self.ends[place.segment][1] } else { self.ends[place.segment][0] };
            let over = (by - end.minus(place.at)) * rate;
            if next < self.ends.len() && over.abs() > 0.0 && (over > 0.0) == ahead {
                let at = if ahead { self.ends[next][0] } else { self.ends[next][1] };
                place = Param { segment: next, at };
                left = over;
                continue;
            }
            place.at = place.at.plus(by);
            return segment.contains(place.at).then_some(place);
        }
    }

    /// Returns the place near `moving` that is `link` metres from `fixed`.
    fn settled(&self, mut moving: Param, fixed: Param, link: f64) -> Option<Param> {
        for _ in 0..20 {
            let offset = self.displacement(fixed, moving);
            let distance = offset.norm();
            let step = (link - distance) * distance / offset.dot(&self.path.tangent(moving));
            if step.is_nan() || step.abs() >= 0.5 * link {
                return None;
            }
            moving = self.moved(moving, step)?;
            if step.abs() < LAST_STEP * link {
                return Some(moving);
            }
        }
        None
    }

    /// Returns the place `link` metres ahead of another, about `gap` metres of travel ahead, if both are on one
    /// segment.
    fn ahead_on_segment(&self, rear: Param, gap: f64, link: f64) -> Option<Param> {
        let segment = self.path.segment(rear);
        let by = segment.ahead(rear.at, gap, link)?;
        let at = Param { at: rear.at.plus(by), ..rear };
        let is_last = rear.segment + 1 == self.ends.len();
        let is_on_segment = is_last || segment.progress(self.ends[rear.segment][1], at.at) <= 0.0;
        (by.is_finite() && segment.contains(at.at) && is_on_segment).then_some(at)
    }

    /// Returns the follower of `front`.
    pub(super) fn follower(&self, front: Param, link: f64) -> Option<Param> {
        let rear = linkage::follower(self.path, front, link).ok()?;
        // On one segment the first place was found in the segment's own coordinate, with all its digits.
        let is_exact = rear.segment == front.segment && self.path.branch(front, link).is_none();
        if is_exact { Some(rear) } else { self.settled(rear, front, link) }
    }

    /// Returns the node one link ahead of `rear`. `gap` is a guess of the travel between them in metres; the guess is
    /// improved.
    pub(super) fn ahead(&self, rear: &Node, gap: &mut f64, link: f64) -> Option<Node> {
        let at = match self.ahead_on_segment(rear.at, *gap, link) {
            Some(at) => at,
            None => self.settled(self.moved(rear.at, *gap)?, rear.at, link)?,
        };
        if at.segment == rear.at.segment {
            *gap = at.at.minus(rear.at.at) * self.path.segment(at).rate(rear.at.at);
        }
        let tangent = self.path.tangent(at);
        let pose = self.pose((at, tangent), (rear.at, rear.tangent), link)?;
        let spacing = rear.spacing / pose.speed_ratio;
        if !(spacing > 0.0 && spacing < f64::INFINITY) {
            return None;
        }
        Some(Node { at, tangent, spacing, heading: pose.heading, heading_rate: -spacing * pose.heading_per_metre })
    }

    /// Returns the pose of the link between two places, given with their tangents; `None` at a stall or a lock.
    pub(super) fn pose(&self, front: (Param, Vector), rear: (Param, Vector), link: f64) -> Option<Pose> {
        let direction = self.displacement(rear.0, front.0) / link;
        let (front_cosine, rear_cosine) = (direction.dot(&front.1), direction.dot(&rear.1));
        let speed_ratio = front_cosine / rear_cosine;
        let turning = direction.perp(&(front.1 - speed_ratio * rear.1));
        let heading = elementary::atan2(direction.y, direction.x);
        (rear_cosine > 0.0).then_some(Pose { heading, speed_ratio, heading_per_metre: turning / link })
    }

    /// Returns the place exactly `metres` of arc length further along its own segment.
    pub(super) fn advanced(&self, from: Param, metres: f64) -> Param {
        Param { segment: from.segment, at: self.path.segment(from).advance(from.at, metres) }
    }
}
