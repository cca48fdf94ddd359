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
