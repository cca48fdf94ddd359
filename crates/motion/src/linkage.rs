//! Links on a path: the follower, which is the handle at the rear end of a link, and how the link lies across the path.
//!
//! In: a path, the place of a link's front handle, the link's length. Out: the rear handle's place and the link's pose.
//! Solvers and events call it.

use std::f64::consts::FRAC_PI_2;

use crate::model::curve::{Arc, Coordinate, Curve, Segment};
use crate::model::path::{Param, Path};
use crate::model::root::increasing_root;
pub use crate::model::spiral::NoFollower;
use crate::model::spiral::{Direction, Spiral};
use crate::model::{Point, Vector};

/// How a link lies across the path at its two handles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkPose {
    /// The link's unit direction b, from its rear handle to its front one.
    pub direction: Vector,
    /// t . b at the front handle, t the path's unit tangent: 0 is a stall.
    pub front_cosine: f64,
    /// t . b at the rear handle: 0 is a lock.
    pub rear_cosine: f64,
}

/// The first place behind `front` whose straight-line distance from it is `link` metres.
///
/// # Errors
/// [`NoFollower`] where there is none: on an inward spiral, before the distance begins to shrink again.
pub fn follower(path: &Path, front: Param, link: f64) -> Result<Param, NoFollower> {
    match on_same_segment(path, front, link)? {
        SameSegment::Found(at) => Ok(Param { segment: front.segment, at }),
        SameSegment::AllNearer => {
            let segment = front.segment - 1;
            march(path, Param { segment, at: path.last(segment) }, path.point(front), link)
        }
        SameSegment::Unknown => march(path, front, path.point(front), link),
    }
}

/// How the link of `link` metres from `front` to its follower `rear` lies.
pub fn link_pose(path: &Path, front: Param, rear: Param, link: f64) -> LinkPose {
    match (path.segment(front), front.segment == rear.segment) {
        (Segment::Spiral(spiral), true) => on_spiral(spiral, front.at, rear.at, link),
        (Segment::Arc(arc), true) => on_arc(arc, front.at, rear.at),
        _ => {
            let direction = (path.point(front) - path.point(rear)).normalize();
            LinkPose {
                direction,
                front_cosine: direction.dot(&path.tangent(front)),
                rear_cosine: direction.dot(&path.tangent(rear)),
            }
        }
    }
}

/// The pose of a link with both handles on one spiral, from the polar frame of the inner handle.
fn on_spiral(spiral: &Spiral, front: Coordinate, rear: Coordinate, link: f64) -> LinkPose {
    let (inner, d) = match spiral.direction() {
        Direction::Inward => (front, rear.minus(front)),
        Direction::Outward => (rear, front.minus(rear)),
    };
    let a = spiral.radius_per_radian();
    let r = spiral.radius(inner);
    let outer = r + a * d;
    let (half_sine, half_cosine) = (0.5 * d).sin_cos();
    let (square, sine) = (2.0 * half_sine * half_sine, 2.0 * half_sine * half_cosine);
    // Inner minus outer handle: (r - r' cos d) e_r - r' sin d e_phi.
    let radial = (outer * square - a * d) / link;
    let around = -outer * sine / link;
    let (polar_sine, polar_cosine) = inner.sin_cos();
    let direction =
        Vector::new(radial * polar_cosine - around * polar_sine, radial * polar_sine + around * polar_cosine);
    // Both cosines from t = -(a e_r + r e_phi) / sqrt(a^2 + r^2) in the frame of the handle concerned.
    let common = a * a * d + r * outer * sine;
    let inner_cosine = (common - a * outer * square) / (link * r.hypot(a));
    let outer_cosine = (common + a * r * square) / (link * outer.hypot(a));
    // Turned by half a turn and travelled the other way, the outward spiral has the inward one's links, ends exchanged.
    match spiral.direction() {
        Direction::Inward => LinkPose { direction, front_cosine: inner_cosine, rear_cosine: outer_cosine },
        Direction::Outward => LinkPose { direction, front_cosine: outer_cosine, rear_cosine: inner_cosine },
    }
}

/// The pose of a link with both handles on one arc: the chord is parallel to the tangent half way.
fn on_arc(arc: &Arc, front: Coordinate, rear: Coordinate) -> LinkPose {
    let half = 0.5 * front.minus(rear);
    let cosine = half.cos();
    LinkPose { direction: arc.tangent(rear.plus(half)), front_cosine: cosine, rear_cosine: cosine }
}

/// Where the search for a follower on the front handle's own segment ended.
enum SameSegment {
    Found(Coordinate),
    /// Everything behind the front handle on its segment is nearer than the link.
    AllNearer,
    Unknown,
}

fn on_same_segment(path: &Path, front: Param, link: f64) -> Result<SameSegment, NoFollower> {
    let behind = remaining_behind(path, front);
    let at_distance = |by: f64| {
        if by <= behind { SameSegment::Found(front.at.plus(-by)) } else { SameSegment::AllNearer }
    };
    Ok(match path.segment(front) {
        Segment::Line(_) => at_distance(link),
        // The chord of an angle psi is 2 radius sin(psi/2).
        Segment::Arc(arc) if link <= 2.0 * arc.radius => at_distance(2.0 * (0.5 * link / arc.radius).asin()),
        Segment::Arc(_) => SameSegment::AllNearer,
        Segment::Spiral(spiral) => match spiral.direction() {
            Direction::Inward => {
                SameSegment::Found(front.at.plus(spiral.follower_angle(spiral.radius(front.at), link)?))
            }
            Direction::Outward => inner_follower(spiral, front.at, behind, link),
        },
    })
}

/// The follower of a handle at `front` on an outward spiral, where it is on the same spiral.
///
/// With r' = r - a d at the follower, the square of the chord is (a d)^2 + 4 r r' sin^2(d/2), which grows with d while
/// tan(d/2) <= r'/a: beyond theta = 1 + pi/2 for a quarter of a turn.
fn inner_follower(spiral: &Spiral, front: Coordinate, behind: f64, link: f64) -> SameSegment {
    if front.high < 1.0 + FRAC_PI_2 {
        return SameSegment::Unknown;
    }
    let (a, r) = (spiral.radius_per_radian(), spiral.radius(front));
    let residual = |d: f64| {
        let (sine, cosine) = (0.5 * d).sin_cos();
        let (rise, inner) = (a * d, r - a * d);
        let value = rise.mul_add(rise, (2.0 * r * sine) * (2.0 * inner * sine)) - link * link;
        let slope = 2.0 * a * rise - 4.0 * r * a * sine * sine + 4.0 * r * inner * sine * cosine;
        (value, slope)
    };
    let high = behind.min(FRAC_PI_2);
    if residual(high).0 >= 0.0 {
        SameSegment::Found(front.plus(-increasing_root(residual, 0.0, high, link / r.hypot(a))))
    } else if behind <= FRAC_PI_2 {
        SameSegment::AllNearer
    } else {
        SameSegment::Unknown
    }
}

/// The first place from `from` backward that is `link` metres from `front`, all between the two being nearer.
///
/// The square of the distance from `front` grows from a place by at most 2 slope h + bound h^2 over the next h units back
/// (see [`second_derivative_bound`]), so no place before that reaches the square of the link is at the distance: each
/// step goes there. Steps never pass the first place sought and double its digits once near.
fn march(path: &Path, from: Param, front: Point, link: f64) -> Result<Param, NoFollower> {
    let mut param = from;
    for _ in 0..MOST_STEPS {
        let segment = path.segment(param);
        let offset = segment.point(param.at) - front;
        let lacking = link * link - offset.dot(&offset);
        if lacking <= 0.0 {
            return Ok(param);
        }
        let rate = arclength_rate(segment, param.at);
        let slope = -rate * offset.dot(&segment.tangent(param.at));
        let bound = second_derivative_bound(segment, param.at, link);
        let root = (slope * slope + bound * lacking).sqrt();
        let step = if slope >= 0.0 { lacking / (slope + root) } else { (root - slope) / bound };
        let step = step.min(longest_step(segment));
        if step >= remaining_behind(path, param) {
            let Some(before) = param.segment.checked_sub(1) else { return Err(NoFollower) };
            param = Param { segment: before, at: path.last(before) };
            continue;
        }
        param.at = backward(segment, param.at, step);
        if step * rate <= 0.5 * f64::EPSILON * link {
            return Ok(param);
        }
    }
    Err(NoFollower)
}

/// Steps after which the search for a follower gives up: many more than a path of sensible segments needs.
const MOST_STEPS: usize = 100_000;

/// How far, in radians, one step of the search for a follower may go along a spiral.
const LONGEST_POLAR_STEP: f64 = 0.5;

/// Metres per unit of a segment's coordinate.
fn arclength_rate(segment: &Segment, at: Coordinate) -> f64 {
    match segment {
        Segment::Line(_) => 1.0,
        Segment::Arc(arc) => arc.radius,
        Segment::Spiral(spiral) => spiral.radius_per_radian() * 1f64.hypot(at.high),
    }
}

/// The coordinate `by` units further back.
fn backward(segment: &Segment, at: Coordinate, by: f64) -> Coordinate {
    match segment {
        Segment::Spiral(spiral) if spiral.direction() == Direction::Inward => at.plus(by),
        _ => at.plus(-by),
    }
}

/// Units of the coordinate that a segment has behind a place.
fn remaining_behind(path: &Path, param: Param) -> f64 {
    if param.segment == 0 { f64::INFINITY } else { param.at.minus(path.first(param.segment)) }
}

/// Half the most that the second derivative of the squared distance from a point F can be, by the coordinate, where
/// that distance is at most `distance` and the place at most [`longest_step`] behind `at`:
/// |p'|^2 + (p - F) . p'' <= |p'|^2 + distance |p''|.
fn second_derivative_bound(segment: &Segment, at: Coordinate, distance: f64) -> f64 {
    match segment {
        Segment::Line(_) => 1.0,
        Segment::Arc(arc) => arc.radius * (arc.radius + distance),
        Segment::Spiral(spiral) => {
            let a = spiral.radius_per_radian();
            let theta = match spiral.direction() {
                Direction::Inward => at.high + LONGEST_POLAR_STEP,
                Direction::Outward => at.high,
            };
            a * a * (1.0 + theta * theta) + distance * a * 2f64.hypot(theta)
        }
    }
}

fn longest_step(segment: &Segment) -> f64 {
    match segment {
        Segment::Line(_) | Segment::Arc(_) => f64::INFINITY,
        Segment::Spiral(_) => LONGEST_POLAR_STEP,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::path::tests::any_path;
    use proptest::prelude::*;

    /// Metres back to the first place at the distance, by small steps along the path and bisection; `None` past `most`.
    fn first_by_sampling(path: &Path, front: f64, link: f64, most: f64) -> Option<f64> {
        let origin = path.point(path.param_at(front));
        let distance = |back: f64| (path.point(path.param_at(front - back)) - origin).norm();
        let step = 1e-3 * link;
        let passed = (1..(most / step) as usize).map(|k| k as f64 * step).find(|back| distance(*back) >= link)?;
        let (mut low, mut high) = (passed - step, passed);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if distance(middle) < link { low = middle } else { high = middle }
        }
        Some(high)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]

        #[test]
        fn the_follower_is_the_first_place_at_the_distance(
            path in any_path(), share in 0.0..0.95f64, link in 0.1..6.0f64,
        ) {
            let at = share * path.length();
            let front = path.param_at(at);
            let Ok(rear) = follower(&path, front, link) else {
                // Only near a spiral's centre: there the search ends at the first maximum of the chord.
                prop_assert!(front.segment() == 0 && matches!(path.segment(front), Segment::Spiral(_)));
                return Ok(());
            };
            let found = path.arc_length(rear, front);
            prop_assert!(((path.point(rear) - path.point(front)).norm() - link).abs() < 1e-13 * (1.0 + link));
            let pose = link_pose(&path, front, rear, link);
            // Where the path turns back just short of the link, sampling sees less than it should.
            let sampled = first_by_sampling(&path, at, link, 1.5 * found + link);
            let grazing = pose.rear_cosine.abs() < 0.05;
            prop_assert!(sampled.is_some_and(|sampled| found <= sampled + 1e-6 && (grazing || sampled <= found + 1e-6)),
                "{found} {sampled:?}");
            let direction = (path.point(front) - path.point(rear)) / link;
            prop_assert!((pose.direction - direction).norm() < 1e-13 * (1.0 + 1.0 / link));
            prop_assert!((pose.front_cosine - direction.dot(&path.tangent(front))).abs() < 1e-13 * (1.0 + 1.0 / link));
            prop_assert!((pose.rear_cosine - direction.dot(&path.tangent(rear))).abs() < 1e-13 * (1.0 + 1.0 / link));
        }
    }
}
