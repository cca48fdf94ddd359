//! The follower of a link by small steps from the start of the motion: which of several places at the link's distance
//! is the one that continues the first.
//!
//! In: the path and a link. Out: for a front handle, a place ahead of its follower, from which the follower is the first
//! place back. The path is taken as points, [`POINTS_IN_LINK`] in the length of a link, and the follower as two
//! neighbours among them, one nearer and one further than the link. As the front handle passes a point, the two move on
//! to neighbours. This shares nothing with the search of `singularities`.

use super::curve::RealParam;
use super::path::RealPath;
use super::real::Real;
use crate::linkage::NoFollower;
use crate::model::Vector;

/// Points of the path in the length of a link.
const POINTS_IN_LINK: f64 = 400.0;

/// The most points that a follower passes while its front passes one: a follower that passes more has vanished.
const MOST_PASSED: usize = 60;

/// The most points of a path with tight bends.
const MOST_POINTS: f64 = 1e7;

/// The turning, in radians, and the length, in links, of a bend behind the front handle that is not tight: its chord is
/// 1.5 cos(0.75) > 1 links long, and grows all the way back.
const TIGHT: f64 = 1.5;

/// A link traced along a path.
pub(super) struct Trace {
    link: f64,
    points: Vec<Vector>,
    /// By point: the units of the coordinate from there to the end of its segment.
    backs: Vec<f64>,
    /// By segment: its first point; then the number of points.
    begins: Vec<usize>,
    /// By point from the second segment on, up to the follower's end: the nearest point behind the follower.
    rears: Vec<usize>,
}

/// Returns true if a path that a link has to be traced along has more than the most points.
pub(super) fn is_too_long(path: &RealPath, link: f64) -> bool {
    let length = path.segment(path.segments() - 1).end.rounded();
    has_tight_bends(path, link) && 2.0 * length * POINTS_IN_LINK / link > MOST_POINTS
}

fn has_tight_bends(path: &RealPath, link: f64) -> bool {
    let segments = (0..path.segments()).map(|index| path.segment(index));
    let tightest = segments.map(|segment| segment.curve.tightest(&segment.first, &segment.last));
    path.segments() > 1 && tightest.fold(0.0, f64::max) * 1.5 * link >= TIGHT
}

impl Trace {
    /// Traces a link. Returns `None` if no bend of the path is so tight that a nearer place could come to the link's
    /// distance.
    pub fn new(path: &RealPath, link: f64) -> Option<Self> {
        let segments = || (0..path.segments()).map(|index| path.segment(index));
        let length = path.segment(path.segments() - 1).end.rounded();
        let step = link / POINTS_IN_LINK;
        if !has_tight_bends(path, link) {
            return None;
        }
        let mut trace = Self { link, points: vec![], backs: vec![], begins: vec![], rears: vec![] };
        for (index, segment) in segments().enumerate() {
            let end = segment.last.point.rounded();
            let rough = segment.curve.rough(&segment.last);
            let behind = segment.curve.forward() * (&segment.last.at - &segment.first.at).rounded();
            let mut backs = vec![0.0];
            let (mut back, mut metres) = (0.0, 0.0);
            let lasts = |back: f64, metres: f64| if index == 0 { metres < length + 4.0 * link } else { back < behind };
            while lasts(back, metres) {
                let next = back + rough.safe_step(back, step);
                back = if index == 0 { next } else { next.min(behind) };
                metres += step;
                backs.push(back);
            }
            trace.begins.push(trace.points.len());
            trace.points.extend(backs.iter().rev().map(|back| end + rough.displacement(*back)));
            trace.backs.extend(backs.into_iter().rev());
        }
        trace.begins.push(trace.points.len());
        trace.follow();
        Some(trace)
    }

    fn is_far(&self, front: usize, place: usize) -> bool {
        (self.points[front] - self.points[place]).norm() >= self.link
    }

    fn follow(&mut self) {
        let first = self.begins[1];
        let Some(mut rear) = (0..first).rev().find(|place| self.is_far(first, *place)) else { return };
        for front in first..self.points.len() {
            let mut passed = 0;
            while passed < MOST_PASSED && rear > 0 && !self.is_far(front, rear) {
                (rear, passed) = (rear - 1, passed + 1);
            }
            while passed < MOST_PASSED && rear + 1 < front && self.is_far(front, rear + 1) {
                (rear, passed) = (rear + 1, passed + 1);
            }
            if passed >= MOST_PASSED || rear == 0 {
                break;
            }
            self.rears.push(rear);
        }
    }

    /// Returns a place ahead of the follower of a front handle from which the follower is the first place back: its
    /// segment, and the units of the coordinate to the end of that. Returns `None` for the front handle itself.
    ///
    /// # Errors
    /// [`NoFollower`] if the follower has vanished.
    pub fn ahead(
        &self,
        path: &RealPath,
        segment: usize,
        front: &RealParam,
    ) -> Result<Option<(usize, f64)>, NoFollower> {
        if segment == 0 {
            return Ok(None);
        }
        let on = path.segment(segment);
        let back = on.curve.forward() * (&on.last.at - &front.at).rounded();
        let (begin, end) = (self.begins[segment], self.begins[segment + 1]);
        let index = begin + self.backs[begin..end].partition_point(|place| *place > back).max(1) - 1;
        let Some(rear) = self.rears.get(index - self.begins[1]) else {
            // The last point before the lock decides beyond it.
            return if index <= self.begins[1] + self.rears.len() { self.last(front) } else { Err(NoFollower) };
        };
        Ok(self.beyond(*rear, index, front))
    }

    /// Returns the place ahead of the last follower.
    fn last(&self, front: &RealParam) -> Result<Option<(usize, f64)>, NoFollower> {
        let rear = self.rears.last().ok_or(NoFollower)?;
        Ok(self.beyond(*rear, self.begins[1] + self.rears.len() - 1, front))
    }

    /// Returns the place of least distance that comes next ahead of `rear`, unless all places from there to the front
    /// handle, past the point `index`, are nearer than the link.
    fn beyond(&self, rear: usize, index: usize, front: &RealParam) -> Option<(usize, f64)> {
        let point = front.point.rounded();
        let distance = |place: usize| (point - self.points[place]).norm();
        let mut ahead = rear + 1;
        while ahead + 1 < index && distance(ahead + 1) < distance(ahead) {
            ahead += 1;
        }
        let is_first = !(ahead..index).any(|place| distance(place) >= self.link);
        let segment = self.begins.partition_point(|begin| *begin <= ahead) - 1;
        (!is_first).then(|| (segment, self.backs[ahead]))
    }
}

/// Returns the place some units behind the end of a segment.
pub(super) fn place_behind(path: &mut RealPath, segment: usize, back: f64) -> RealParam {
    let on = path.segment(segment);
    let (from, by) = (on.last.clone(), Real::from(-on.curve.forward() * back));
    path.moved(segment, &from, &by)
}
