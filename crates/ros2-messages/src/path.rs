//! nav_msgs/Path: the path of the head.

use serde::Serialize;

use super::{HasStamp, Header, Pose, Time};
use bench_dragon_messages::{SEGMENT_ARC, SEGMENT_INWARD_SPIRAL, SEGMENT_OUTWARD_SPIRAL, StageMessage, StageSegment};

/// The turn between two points, radians: the chord of a circle of 9 m is 9 mm off.
const TURN: f64 = std::f64::consts::PI / 36.0;
/// The most points of a path. A path with more turns gets fewer points for each.
const MOST_POINTS: f64 = 10_000.0;

/// geometry_msgs/PoseStamped.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseStamped {
    /// The header of the path.
    pub header: Header,
    /// A point, and the direction of travel there.
    pub pose: Pose,
}

/// nav_msgs/Path.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Path {
    /// The stamp of the stage.
    pub header: Header,
    /// The points from start to end.
    pub poses: Vec<PoseStamped>,
}

impl Path {
    /// Creates the path of a stage's dragon, with the stage's stamp; with several the paths one after the other.
    pub fn of(message: &StageMessage) -> Self {
        let header = Header::of(message.stage.stamp_ns);
        let poses = message.stage.dragons.iter().flat_map(|dragon| poses(message.path(dragon)));
        let poses = poses.map(|pose| PoseStamped { header: header.clone(), pose }).collect();
        Self { header, poses }
    }
}

impl HasStamp for Path {
    fn set_stamp(&mut self, stamp: Time) {
        self.header.stamp = stamp;
        self.poses.iter_mut().for_each(|pose| pose.header.stamp = stamp);
    }
}

/// Returns points along segments with the direction of travel: the ends of every segment, and a point for each turn by
/// five degrees.
pub(super) fn poses(segments: &[StageSegment]) -> Vec<Pose> {
    let turned: f64 = segments.iter().map(turn_of).sum();
    let turn = TURN.max(turned / MOST_POINTS);
    let along = |segment: &StageSegment| {
        let pieces = (turn_of(segment) / turn).ceil().max(1.0) as usize;
        let segment = *segment;
        (0..=pieces).map(move |piece| pose_at(&segment, piece as f64 / pieces as f64))
    };
    segments.iter().flat_map(along).collect()
}

/// Returns the radians by which a segment turns.
fn turn_of(segment: &StageSegment) -> f64 {
    match segment.kind {
        SEGMENT_ARC => (segment.curvature * segment.length).abs(),
        SEGMENT_INWARD_SPIRAL | SEGMENT_OUTWARD_SPIRAL => (segment.theta_last - segment.theta_first).abs(),
        _ => 0.0,
    }
}

/// Returns the pose at a share, from 0 to 1, of a segment's length or of a spiral's polar angle.
fn pose_at(segment: &StageSegment, share: f64) -> Pose {
    let StageSegment { x, y, heading, length, curvature, theta_first, theta_last, pitch, kind, .. } = *segment;
    match kind {
        SEGMENT_ARC => {
            let here = heading + share * curvature * length;
            let right = x + (here.sin() - heading.sin()) / curvature;
            Pose::flat(right, y - (here.cos() - heading.cos()) / curvature, here)
        }
        SEGMENT_INWARD_SPIRAL | SEGMENT_OUTWARD_SPIRAL => {
            let theta = theta_first + share * (theta_last - theta_first);
            let per_radian = pitch / std::f64::consts::TAU;
            let (sine, cosine) = theta.sin_cos();
            let radius = per_radian * theta;
            // Opposite to the derivative by theta: inward because theta decreases, outward because of the half turn.
            let (along_x, along_y) = (radius * sine - per_radian * cosine, -radius * cosine - per_radian * sine);
            let side = if kind == SEGMENT_INWARD_SPIRAL { 1.0 } else { -1.0 };
            let own = (side * radius * cosine, side * radius * sine, along_y.atan2(along_x));
            if curvature.is_nan() { Pose::flat(own.0, own.1, own.2) } else { placed(segment, own) }
        }
        _ => {
            let (sine, cosine) = heading.sin_cos();
            Pose::flat(x + share * length * cosine, y + share * length * sine, heading)
        }
    }
}

/// Returns a pose of a spiral that is placed elsewhere, from its place on the spiral about the origin. Beginning and
/// heading say where the spiral lies; an inward one bends to the right unless it is mirrored, an outward one to the
/// left.
fn placed(segment: &StageSegment, (x, y, heading): (f64, f64, f64)) -> Pose {
    let unplaced = StageSegment { curvature: f64::NAN, ..*segment };
    let Pose { position: first, orientation } = pose_at(&unplaced, 0.0);
    let first_heading = 2.0 * orientation.z.atan2(orientation.w);
    let bend = if segment.kind == SEGMENT_INWARD_SPIRAL { -1.0 } else { 1.0 };
    let side = bend * segment.curvature.signum();
    let turned = segment.heading - side * first_heading;
    let (sine, cosine) = turned.sin_cos();
    let (right, up) = (x - first.x, side * (y - first.y));
    let place = (segment.x + cosine * right - sine * up, segment.y + sine * right + cosine * up);
    Pose::flat(place.0, place.1, side * heading + turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_motion::model::curve::Side;
    use bench_dragon_motion::model::path::Path as ModelPath;
    use bench_dragon_motion::model::spiral::Direction;
    use bench_dragon_motion::model::{Point, Vector};
    use bench_dragon_motion::placement::Placement;
    use bench_dragon_show::convert::stage_segment;

    /// Every pose lies on the path, and looks along it, by the path's own points and tangents.
    fn check(path: &ModelPath) {
        let segments: Vec<_> = path.outline().iter().map(stage_segment).collect();
        let poses = poses(&segments);
        assert!(poses.len() > 50 && poses.len() < 2500, "{}", poses.len());
        let mut travelled = 0.0;
        let mut before: Option<Pose> = None;
        for pose in poses {
            let here = Point::new(pose.position.x, pose.position.y);
            // The chord and a little more: the arc between is at most a thousandth longer.
            let chord = before.map_or(0.0, |b| (here.x - b.position.x).hypot(here.y - b.position.y));
            let range = [travelled + chord - 1e-9, travelled + 1.002 * chord + 1e-6];
            let distance = |s: f64| nalgebra::distance(&path.point(path.param_at(s.clamp(0.0, path.length()))), &here);
            let (mut low, mut high) = (range[0], range[1]);
            for _ in 0..200 {
                let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                if distance(a) < distance(b) { high = b } else { low = a }
            }
            travelled = (0.5 * (low + high)).clamp(0.0, path.length());
            assert!(distance(travelled) < 1e-6, "{} m off at {travelled} m", distance(travelled));
            let tangent = path.tangent(path.param_at(travelled));
            let (z, w) = (pose.orientation.z, pose.orientation.w);
            let along = (w * w - z * z) * tangent.x + 2.0 * w * z * tangent.y;
            assert!(along > 1.0 - 1e-6 || travelled > path.length() - 0.01, "{along} at {travelled} m");
            before = Some(pose);
        }
        assert!((travelled - path.length()).abs() < 1e-4, "it ends at {travelled} of {} m", path.length());
    }

    #[test]
    fn the_points_of_a_placed_path_are_the_paths_points_placed() {
        for path in [ModelPath::spiral(0.55, 16.0), ModelPath::turnaround(1.7, 4.5, 2.0, 100.0, 60.0).unwrap()] {
            for (turns, mirror) in [(0.3, false), (0.0, true), (-0.2, true)] {
                let placement = Placement::new(Vector::new(7.0, -3.0), turns, mirror);
                let segments = |placement: &Placement| -> Vec<StageSegment> {
                    path.outline().into_iter().map(|segment| stage_segment(&placement.outline(segment))).collect()
                };
                let (home, away) = (poses(&segments(&Placement::IDENTITY)), poses(&segments(&placement)));
                assert_eq!(home.len(), away.len());
                for (home, away) in home.iter().zip(&away) {
                    let place = placement.point(Point::new(home.position.x, home.position.y));
                    let apart = (place - Point::new(away.position.x, away.position.y)).norm();
                    let [heading, shown] = [home, away].map(|pose| 2.0 * pose.orientation.z.atan2(pose.orientation.w));
                    let turn = (placement.heading(heading) - shown).cos();
                    assert!(apart < 1e-12 * 100.0 && turn > 1.0 - 1e-12, "{turns} {mirror}: {apart:e} m, {turn}");
                }
            }
        }
    }

    #[test]
    fn the_points_lie_on_the_path_and_look_along_it() {
        check(&ModelPath::spiral(0.55, 16.0));
        check(&ModelPath::turnaround(1.7, 4.5, 2.0, 100.0, 60.0).unwrap());
        let route = ModelPath::route(0.1).line(5.0).arc(Side::Left, 3.0, 0.5);
        check(&route.line(2.0).arc(Side::Right, 1.5, 0.75).build().unwrap());
        let spirals = ModelPath::route(0.1).line(5.0).spiral(Side::Left, Direction::Inward, 1.7, 7.0, 2.5);
        let spirals = spirals.arc(Side::Right, 2.0, 0.3).spiral(Side::Left, Direction::Outward, 0.9, 4.0, 1.2);
        let spirals = spirals.spiral(Side::Right, Direction::Inward, 0.9, 4.0, 2.2);
        check(&spirals.spiral(Side::Right, Direction::Outward, 1.3, 3.0, 2.2).build().unwrap());
    }
}
