//! nav_msgs/Path: the path of the head.

use serde::Serialize;

use super::{HasStamp, Header, Pose, Time};
use bench_dragon_messages::{StageMessage, StageSegment};

/// The turn between two points, in radians: the chord of a circle of 9 m is 9 mm off.
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
    let turned: f64 = segments.iter().map(StageSegment::turn).sum();
    let turn = TURN.max(turned / MOST_POINTS);
    let along = |segment: &StageSegment| {
        let pieces = (segment.turn() / turn).ceil().max(1.0) as usize;
        let segment = *segment;
        (0..=pieces).map(move |piece| {
            let (x, y, heading) = segment.pose_at(piece as f64 / pieces as f64);
            Pose::flat(x, y, heading)
        })
    };
    segments.iter().flat_map(along).collect()
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
