//! Proofs about a step of a link's front handle, from the configurations at its two ends.
//!
//! In: a link and two of its configurations. Out: that the follower map is continuous over the step, or that it jumps,
//! and the number of turns of the rear handle.
//!
//! **Notation.** The front handle is at travel s in [s0, s1], h = s1 - s0, and u is a place behind it. P is the path, T
//! its tangent, L the link, and D(s, u) = |P(s) - P(u)|. In the stretch concerned, the path's greatest curvature is k.
//!
//! **Continuous.** For fixed u, d2(D^2)/ds^2 = 2 (1 + (P(s) - P(u)) . P''(s)) lies within 2 (1 -+ k D). So over the
//! step D^2 <= max(ends) + max(0, k D - 1) h^2 / 4 and D^2 >= min(ends) - (1 + k D) h^2 / 4.
//! 1. By the first bound, every place from the front handle back to a place `near` is nearer than L throughout the
//!    step. D <= s - u proves this as far as s - u is less than L. From there the proof goes back in steps within which
//!    D^2 cannot grow to L^2 ([`Link::nearer_throughout`]). Where nearer places have come to the distance before, the
//!    proof begins at a place `behind` between the follower and these places.
//! 2. By the second bound, a place `far` is further away than L throughout.
//! 3. Between the two the distance grows backward, that is, q(s, u) = T(u) . (P(s) - P(u)) > 0. This follows from its
//!    values at the corners, because |q_u| <= 1 + k D and |q_ss| <= k.
//!
//! Hence there is exactly one root between `far` and `near`, and it is the first one back from `behind`, or from the
//! front handle. This root is the follower, and because of 3 it moves continuously. Its cosine is at least min q / L.
//!
//! **Jump.** Let two places be the first ones at the distance, at the two ends of a step. If a place strictly between
//! them is nearer than L throughout, by the first bound, then no follower passes this place. If the second place is
//! behind, the follower vanishes in the step. If it is ahead, a nearer place comes to the distance, and the follower
//! stays behind the place that it cannot pass.
//!
//! **Turns.** Let f be the front cosine, let the rear cosine be at least c, and let m = max |f| over the step. The rear
//! handle is at most m / c times as fast as the front handle, so the link turns by at most (1 + m / c) / L per metre.
//! Hence |f'| <= k + (1 + m / c) / L, and m is at most max(ends) + |f'| h / 2. So f has no zero where |f0| + |f1| > max
//! |f'| h. Further, f' = K n . b + (1 - f^2 - v t . t') / L, with the signed curvature K and the normal n. Here |v| <= m / c, and t and t' are the parts of the two tangents across the link. Where f' keeps its sign, f has at most one zero.
//!
//! All these bounds tighten in proportion to the step. The quantities that they must not exceed are f, c, and the
//! difference of a nearer point's distance to L. These fall only in proportion to the distance from a singular
//! configuration, even where all of them vanish at once. Therefore the steps shrink in geometric progression towards
//! it.

use crate::linkage::{NoFollower, first_follower, follower_behind, link_pose};
use crate::model::curve::Curve;
use crate::model::curve_bounds::CurveBounds;
use crate::model::path::{Param, Path};
use crate::model::root::{bisect_predicate, golden_section_min};
use crate::model::{Point, Vector};

/// A link of one length, anywhere on the path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Link<'a> {
    pub path: &'a Path,
    /// The distance between its handles, in metres.
    pub length: f64,
}

/// A link with its front handle at one place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Configuration {
    /// The travel of the front handle, in metres.
    pub front: f64,
    /// The travel of the rear handle, in metres.
    pub rear: f64,
    /// t . b at the front handle: 0 is a stall.
    pub front_cosine: f64,
    /// t . b at the rear handle: 0 is a lock.
    pub rear_cosine: f64,
    /// The place of the front handle.
    pub front_param: Param,
    /// The place of the rear handle.
    pub rear_param: Param,
    front_point: Point,
    /// b, from the rear handle to the front one.
    direction: Vector,
}

impl Configuration {
    /// Returns true if the rear handle stands still or goes backward as the front one goes forward.
    pub fn is_stalled(&self) -> bool {
        self.front_cosine <= 0.0
    }
}

/// The curvature of the front handle's segment during a step.
struct FrontCurvature {
    /// 1/m, not negative.
    least: f64,
    most: f64,
    /// 1 if the segment turns left, -1 if it turns right.
    side: f64,
}

/// The distances from the front handle at both ends of a step to one place behind.
struct Distances {
    param: Param,
    /// 1/m, not negative.
    curvature: f64,
    /// The least square of the distance, m^2.
    square: f64,
    /// The least q = T . (P(s) - P(u)), in metres: growth of half the square per metre backward.
    slope: f64,
    /// The greatest |q_u|: half the second derivative of the square by u.
    second_derivative_bound: f64,
}

impl Link<'_> {
    /// Returns the link with its front handle after `front` metres of travel, and its rear handle at the first place
    /// back from `behind`, or from the front handle.
    ///
    /// # Errors
    /// [`NoFollower`] at or inside the fold of an inward spiral, and if `behind` is too far from the front handle.
    pub fn configuration(&self, front: f64, behind: Option<Param>) -> Result<Configuration, NoFollower> {
        self.configuration_at(front, self.path.param_at(front), behind)
    }

    /// Does the same for a front handle whose place is known.
    pub fn configuration_at(
        &self,
        front: f64,
        front_param: Param,
        behind: Option<Param>,
    ) -> Result<Configuration, NoFollower> {
        let rear_param = match behind {
            None => first_follower(self.path, front_param, self.length)?,
            Some(behind) => follower_behind(self.path, behind, front_param, self.length)?,
        };
        let pose = link_pose(self.path, front_param, rear_param, self.length);
        Ok(Configuration {
            front,
            rear: front - self.path.arc_length(rear_param, front_param),
            front_cosine: pose.front_cosine,
            rear_cosine: pose.rear_cosine,
            front_param,
            rear_param,
            front_point: self.path.point(front_param),
            direction: pose.direction,
        })
    }

    /// Returns the rounding of a place of the front handle, in metres.
    pub fn resolution(&self, at: &Configuration) -> f64 {
        8.0 * f64::EPSILON * (at.front.abs() + self.length + at.front_point.coords.norm())
    }

    /// Returns the rounding of the square of a distance of about a link, m^2.
    fn rounding(&self, at: &Configuration) -> f64 {
        16.0 * f64::EPSILON * self.length * (self.length + at.front_point.coords.norm())
    }

    /// Returns the metres of travel of the front handle at the end of its segment.
    pub fn segment_end(&self, at: &Configuration) -> f64 {
        self.path.end_of(at.front_param.segment)
    }

    /// Returns the end of the segment, metres of travel of the front handle, if the link is known not to stall or lock
    /// before it.
    pub fn steady_until(&self, at: &Configuration) -> Option<f64> {
        let (front, rear) = (at.front_param, at.rear_param);
        let is_steady = front.segment == rear.segment && self.path.segment(front).is_steady(front.at, rear.at);
        Some(self.segment_end(at)).filter(|end| is_steady && *end > at.front)
    }

    /// Returns the front handle's travel up to which both handles are on two parallel lines, and the metres that the
    /// rear one goes per metre of the front one. The rear handle's line must reach to `behind`, ahead of it.
    pub fn parallel_until(&self, at: &Configuration, behind: Param) -> Option<(f64, f64)> {
        let (front, rear) = (at.front_param, at.rear_param);
        let is_straight = |param| self.path.segment(param).constant_curvature() == Some(0.0);
        if front.segment == rear.segment || behind.segment != rear.segment || !is_straight(front) || !is_straight(rear)
        {
            return None;
        }
        let along = self.path.tangent(front).dot(&self.path.tangent(rear));
        let room = if along > 0.0 {
            self.path.end_of(rear.segment) - self.path.travelled(behind)
        } else if rear.segment > 0 {
            at.rear - self.path.end_of(rear.segment - 1)
        } else {
            f64::INFINITY
        };
        let end = self.segment_end(at).min(at.front + (1.0 - 1e-9) * room);
        let is_long = end - at.front > LEAST_PARALLEL * self.length;
        (along.abs() > 1.0 - 1e-12 && is_long).then_some((end, along.signum()))
    }

    /// Returns true if a step is proven to be continuous with a known number of turns of the rear handle. The front
    /// handle is on one segment during the step. The rear handle turns round once if the front cosines at the ends
    /// differ in sign, else not at all. During the step it is the first place back from `behind`, metres of travel, or
    /// from the front handle.
    pub fn is_certain(&self, before: &Configuration, after: &Configuration, behind: Option<f64>) -> bool {
        let curvature = self.front_curvature(before, after);
        self.least_rear_cosine(before, after, curvature.most, behind)
            .is_some_and(|rear_cosine| self.turns_are_certain(before, after, &curvature, rear_cosine))
    }

    fn front_curvature(&self, before: &Configuration, after: &Configuration) -> FrontCurvature {
        let Param { segment, at } = before.front_param;
        let last = if after.front_param.segment == segment { after.front_param.at } else { self.path.last(segment) };
        let segment = self.path.segment(before.front_param);
        let (first, last) = (segment.curvature(at), segment.curvature(last));
        FrontCurvature { least: first.min(last), most: first.max(last), side: segment.turning() }
    }

    /// Returns the least rear cosine over a step that is proven to be continuous; `curvature` is that at the front
    /// handle.
    fn least_rear_cosine(
        &self,
        before: &Configuration,
        after: &Configuration,
        curvature: f64,
        behind: Option<f64>,
    ) -> Option<f64> {
        let (link, step) = (self.length, after.front - before.front);
        let (rear_far, rear_near) = (before.rear.min(after.rear), before.rear.max(after.rear));
        let slope = before.rear_cosine.min(after.rear_cosine) * link;
        let second_derivative_bound =
            |reach: f64| 1.0 + link * self.path.max_curvature_between(rear_far - reach, rear_near + reach);
        // With a cosine this small, rounding decides the follower.
        if slope <= 0.0 || slope * slope <= 2.0 * second_derivative_bound(0.0) * self.rounding(before) {
            return None;
        }
        // Distance beyond the two followers: as little as the step needs, if rounding allows.
        let least_slack = 0.25 * slope / second_derivative_bound(0.25 * link);
        let slack = (0.25 * slope / second_derivative_bound(0.0)).min((rear_near - rear_far + step).max(least_slack));
        let reach = link + step + (rear_near - rear_far) + 2.0 * slack;
        let least_change = 0.25 * (1.0 + curvature * reach) * step * step;
        let (far, near) = (rear_far - slack - least_change / slope, rear_near + slack);
        let near = behind.map_or(near, |behind| near.min(behind));
        let reach = reach + least_change / slope;
        let (at_far, at_near) = (self.distances(before, after, far), self.distances(before, after, near));
        if at_far.square - least_change <= link * link {
            return None;
        }
        let bound = self.largest_second_derivative([&at_far, &at_near], near - far, step, reach);
        let slope = 0.5 * (at_far.slope + at_near.slope - bound * (near - far)) - 0.125 * curvature * step * step;
        // No place is further than the path to it is long.
        let from = behind.unwrap_or(after.front - link);
        let is_near = behind.is_none() || {
            let limit = link * link - largest_excess(curvature, link + step, step);
            let point = self.path.point(at_near.param);
            [before, after].iter().all(|end| (end.front_point - point).norm_squared() < limit)
        };
        (slope > 0.0 && is_near && self.nearer_throughout((before, after), curvature, from, near))
            .then_some(slope / link)
    }

    fn distances(&self, before: &Configuration, after: &Configuration, travelled: f64) -> Distances {
        let param = self.path.param_at(travelled);
        let (point, tangent) = (self.path.point(param), self.path.tangent(param));
        let offsets = [before.front_point - point, after.front_point - point];
        let segment = self.path.segment(param);
        let curvature = segment.curvature(param.at);
        let turning = segment.turning() * curvature;
        Distances {
            param,
            curvature,
            square: offsets[0].norm_squared().min(offsets[1].norm_squared()),
            slope: offsets[0].dot(&tangent).min(offsets[1].dot(&tangent)),
            second_derivative_bound: offsets
                .map(|offset| (turning * tangent.perp(&offset) - 1.0).abs())
                .into_iter()
                .fold(0.0, f64::max),
        }
    }

    /// Returns an upper bound of |q_u| = |K n . (P(s) - P(u)) - 1|, the change of q per metre of the rear handle
    /// between two places. The places are `apart` metres from each other, with distances up to `reach`. On one segment
    /// the bound follows from the values at the corners and their rates of change, |K (K q + n . T(s))| at most.
    fn largest_second_derivative(&self, ends: [&Distances; 2], apart: f64, step: f64, reach: f64) -> f64 {
        let [far, near] = ends;
        let curvature = far.curvature.max(near.curvature);
        if far.param.segment == near.param.segment {
            let drift = curvature * (curvature * reach * apart + step) + (far.curvature - near.curvature).abs() * reach;
            return (far.second_derivative_bound.max(near.second_derivative_bound) + drift)
                .min(1.0 + reach * curvature);
        }
        let place = |end: &Distances| self.path.travelled(end.param);
        1.0 + reach * self.path.max_curvature_between(place(far), place(near))
    }

    /// Returns true if every place from `from` back to `to` is nearer than the link throughout a step.
    ///
    /// The square of the distance grows over the next x metres back by at most 2 slope x + bound x^2.
    fn nearer_throughout(
        &self,
        (before, after): (&Configuration, &Configuration),
        curvature: f64,
        from: f64,
        to: f64,
    ) -> bool {
        let step = after.front - before.front;
        let reach = self.length + step;
        let limit = self.length * self.length - largest_excess(curvature, reach, step);
        let mut place = from;
        let mut segment = self.path.param_at(place).segment;
        while place > to {
            let begin = if segment == 0 { f64::NEG_INFINITY } else { self.path.end_of(segment - 1) };
            let circumference = self.path.segment_at(segment).circumference();
            let stop = to.max(begin).max(place - circumference);
            while place > stop {
                let at_end = segment < after.front_param.segment && place >= self.path.end_of(segment);
                let param =
                    if at_end { Param { segment, at: self.path.last(segment) } } else { self.path.param_at(place) };
                let (point, tangent) = (self.path.point(param), self.path.tangent(param));
                let bound = 1.0 + reach * self.max_curvature_back(segment, param);
                let free = [before, after].map(|end| {
                    let offset = end.front_point - point;
                    let (lacking, slope) = (limit - offset.norm_squared(), offset.dot(&tangent));
                    if lacking <= 0.0 {
                        return 0.0;
                    }
                    let root = (slope * slope + bound * lacking).sqrt();
                    if slope >= 0.0 { lacking / (slope + root) } else { (root - slope) / bound }
                });
                let next = place - free[0].min(free[1]);
                if place - next <= f64::EPSILON * self.length {
                    return false;
                }
                place = next;
            }
            place = place.min(to.max(begin));
            segment = segment.saturating_sub(1);
        }
        true
    }

    /// Returns the greatest curvature of a segment from a place back to the segment's beginning.
    fn max_curvature_back(&self, segment: usize, from: Param) -> f64 {
        let curve = self.path.segment_at(segment);
        curve.curvature(if curve.tightens() { from.at } else { self.path.first(segment) })
    }

    /// Returns true if the number of turns in a step is certain: 0 if the front cosines have one sign, else 1.
    fn turns_are_certain(
        &self,
        before: &Configuration,
        after: &Configuration,
        curvature: &FrontCurvature,
        rear_cosine: f64,
    ) -> bool {
        let (link, step) = (self.length, after.front - before.front);
        let (first, last) = (before.front_cosine, after.front_cosine);
        let share = 0.5 * step / (rear_cosine * link);
        if share > 0.5 {
            return false;
        }
        let most = first.abs().max(last.abs()) + 0.5 * step * (curvature.most + link.recip());
        let most = most / (1.0 - share);
        let rear_speed = most / rear_cosine;
        let change = curvature.most + (1.0 + rear_speed) / link;
        if before.is_stalled() == after.is_stalled() && first.abs() + last.abs() > change * step {
            return true;
        }
        let tangent = self.path.tangent(before.front_param);
        let across = curvature.side * tangent.perp(&before.direction).signum();
        let level = (1.0 - most * most).max(0.0);
        let bending = [curvature.least * level.sqrt(), curvature.most].map(|curvature| across * curvature);
        let least = bending[0].min(bending[1]) + (level - rear_speed) / link;
        let largest = bending[0].max(bending[1]) + (1.0 + rear_speed) / link;
        most < 1.0 && (least > 0.0 || largest < 0.0)
    }

    /// Returns the place ahead of the rear handle from which on the distance to the front handle grows again, in metres
    /// of travel, and the number of places tested. `None` if no such place is found.
    pub fn valley(&self, at: &Configuration) -> (Option<f64>, u64) {
        let falls = |travelled: f64| {
            let param = self.path.param_at(travelled);
            self.path.tangent(param).dot(&(at.front_point - self.path.point(param))) > 0.0
        };
        let steps = std::iter::successors(Some(FIRST_VALLEY_STEP * self.length), |step| {
            Some((VALLEY_GROWTH * step).min(VALLEY_STEP * self.length))
        });
        let (mut place, mut tested) = (at.rear, 0);
        for step in steps {
            let next = place + step;
            tested += 1;
            if next >= at.front {
                break;
            }
            if !falls(next) {
                return (Some(bisect_predicate(|place| !falls(place), place, next)), tested);
            }
            place = next;
        }
        (None, tested)
    }

    /// Returns the least distance of the front handle, after `front` metres of travel, from the places around a valley.
    pub fn least_distance(&self, front: f64, valley: f64, around: f64) -> f64 {
        let origin = self.path.point(self.path.param_at(front));
        let distance = |travelled: f64| (self.path.point(self.path.param_at(travelled)) - origin).norm();
        golden_section_min(distance, valley - around, valley + around).0
    }

    /// Returns a place between the rear handles that none passes in a step.
    pub fn jump(&self, before: &Configuration, after: &Configuration) -> Option<f64> {
        let step = after.front - before.front;
        let curvature = self.path.max_curvature_between(before.front, after.front);
        let excess = largest_excess(curvature, self.length + step, step);
        let limit = self.length * self.length - excess - self.rounding(before);
        let share = (after.rear - before.rear) / f64::from(JUMP_SAMPLES);
        (1..JUMP_SAMPLES).map(|sample| before.rear + share * f64::from(sample)).find(|place| {
            let point = self.path.point(self.path.param_at(*place));
            [before, after].iter().all(|end| (end.front_point - point).norm_squared() < limit)
        })
    }
}

/// The places between two followers at which a proof of a jump is tried. Nearly all of them succeed: up to the further
/// follower every place is nearer than the link, in one of the two configurations at least.
const JUMP_SAMPLES: i32 = 32;

/// The least way along parallel lines that is gone in one step, in links.
const LEAST_PARALLEL: f64 = 1e-3;

/// The steps in which the place of least distance ahead of the rear handle is searched for, in links: the first, the
/// longest, and the growth between them.
const FIRST_VALLEY_STEP: f64 = 1e-9;
const VALLEY_STEP: f64 = 1.0 / 64.0;
const VALLEY_GROWTH: f64 = 1.25;

/// Returns the greatest excess of the square of a distance over its values at both ends of a step of the front handle.
/// The distance is at most `reach`.
fn largest_excess(curvature: f64, reach: f64, step: f64) -> f64 {
    0.25 * (curvature * reach - 1.0).max(0.0) * step * step
}
