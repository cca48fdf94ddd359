//! Links on a path: the follower, which is the handle at the rear end of a link, and the link's pose.
//!
//! In: a path, the place of a link's front handle, the link's length. Out: the rear handle's place and the link's pose.

use crate::model::Point;
use crate::model::curve::{Curve, Follower};
pub use crate::model::curve::{LinkPose, NoFollower};
use crate::model::curve_bounds::CurveBounds;
use crate::model::path::{Param, Path};

/// Returns the place of the rear handle. It is the first place behind `front` whose straight-line distance from it is
/// `link` metres. Where nearer places have come to that distance since the motion began ([`Path::branch`]), it is the
/// place that continues it.
///
/// # Errors
/// [`NoFollower`] if there is none: on an inward spiral, before the distance begins to shrink again.
pub fn follower(path: &Path, front: Param, link: f64) -> Result<Param, NoFollower> {
    match path.branch(front, link) {
        None => first_follower(path, front, link),
        Some(behind) => march(path, behind, path.point(front), link),
    }
}

/// Returns the first place back from `behind` that is `link` metres from `front`.
///
/// # Errors
/// [`NoFollower`] if `behind` is not nearer than that.
pub(crate) fn follower_behind(path: &Path, behind: Param, front: Param, link: f64) -> Result<Param, NoFollower> {
    let point = path.point(front);
    if (path.point(behind) - point).norm_squared() >= link * link {
        return Err(NoFollower);
    }
    march(path, behind, point, link)
}

/// Returns the first place behind `front` at the distance `link`, whatever the motion before.
///
/// # Errors
/// As [`follower`].
pub(crate) fn first_follower(path: &Path, front: Param, link: f64) -> Result<Param, NoFollower> {
    let segment = path.segment(front);
    match segment.follower(front.at, remaining_behind(path, front), link)? {
        Follower::Behind(by) => Ok(Param { segment: front.segment, at: segment.back(front.at, by) }),
        Follower::AllNearer => {
            let segment = front.segment - 1;
            march(path, Param { segment, at: path.last(segment) }, path.point(front), link)
        }
        Follower::Unknown => march(path, front, path.point(front), link),
    }
}

/// Returns the pose of the link of `link` metres from `front` to its follower `rear`.
pub fn link_pose(path: &Path, front: Param, rear: Param, link: f64) -> LinkPose {
    if front.segment == rear.segment {
        return path.segment(front).link_pose(front.at, rear.at, link);
    }
    LinkPose::between(path.point(front), path.tangent(front), path.point(rear), path.tangent(rear))
}

/// Returns the first place from `from` backward that is `link` metres from `front`; all places between are nearer.
///
/// The square of the distance from `front` grows from a place by at most 2 slope h + bound h^2 over the next h units
/// back, where `bound` is [`Curve::second_derivative_bound`]. Each step goes to where the square with this growth
/// reaches the square of the link, so steps never pass the first place sought. Near it they double its digits.
fn march(path: &Path, from: Param, front: Point, link: f64) -> Result<Param, NoFollower> {
    let mut param = from;
    for _ in 0..MOST_STEPS {
        let segment = path.segment(param);
        let offset = segment.point(param.at) - front;
        let lacking = link * link - offset.dot(&offset);
        if lacking <= 0.0 {
            return Ok(param);
        }
        let rate = segment.rate(param.at).abs();
        let slope = -rate * offset.dot(&segment.tangent(param.at));
        let bound = segment.second_derivative_bound(param.at, link);
        let root = (slope * slope + bound * lacking).sqrt();
        let step = if slope >= 0.0 { lacking / (slope + root) } else { (root - slope) / bound };
        let step = step.min(segment.longest_step());
        if step >= remaining_behind(path, param) {
            let Some(before) = param.segment.checked_sub(1) else { return Err(NoFollower) };
            param = Param { segment: before, at: path.last(before) };
            continue;
        }
        param.at = segment.back(param.at, step);
        if step * rate <= 0.5 * f64::EPSILON * link {
            return Ok(param);
        }
    }
    Err(NoFollower)
}

/// The steps after which the search for a follower gives up: many more than a path of sensible segments needs.
const MOST_STEPS: usize = 100_000;

/// Returns the units of the coordinate that a segment has behind a place.
fn remaining_behind(path: &Path, param: Param) -> f64 {
    if param.segment == 0 { f64::INFINITY } else { path.segment(param).progress(path.first(param.segment), param.at) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::path::tests::any_path;
    use proptest::prelude::*;

    /// Returns the metres back to the first place at the distance, by small steps and bisection; `None` past `most`.
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
                prop_assert!(front.segment() == 0 && path.segment(front).tightens());
                return Ok(());
            };
            let found = path.arc_length(rear, front);
            prop_assert!(((path.point(rear) - path.point(front)).norm() - link).abs() < 1e-13 * (1.0 + link));
            let pose = link_pose(&path, front, rear, link);
            // Sampling finds too few places where the path turns back just short of the link.
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
