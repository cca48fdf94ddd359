use bench_dragon_messages::state::{EventKind, Level};
use bench_dragon_motion::model::Vector;
use bench_dragon_motion::model::curve::Side;
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::placement::Placement;
use bench_dragon_ros2_messages::Pose;
use bench_dragon_ros2_messages::path::Path as PathMessage;

use super::*;

const NEAREST: PairClearance = PairClearance {
    value: 0.25,
    bench_a: 3,
    bench_b: 17,
    point_a: Point::new(1.0, 2.0),
    point_b: Point::new(2.0, 6.0),
};

#[test]
fn a_decimated_frame_has_head_and_tail_and_each_handle_once() {
    for (handles, every, expected) in [
        (224, 100, vec![0, 100, 200, 223]),
        (224, 223, vec![0, 223]),
        (224, 222, vec![0, 222, 223]),
        (224, 1_000_000, vec![0, 223]),
        (15, 7, vec![0, 7, 14]),
        (2, 1, vec![0, 1]),
        (4, 1, vec![0, 1, 2, 3]),
    ] {
        let decimation = Decimation::new([handles], every);
        assert_eq!(decimation.handles(), expected, "{decimation:?}");
    }
    // Both ends of each of two dragons.
    assert_eq!(Decimation::new([15, 4], 7).handles(), [0, 7, 14, 15, 18]);
}

fn timed(kind: EventKind, bench_b: Option<u32>) -> TimedEvent {
    let event = Event { kind, travelled: 412.0, bench_a: Some(0), bench_b, place: Some(Point::new(-1.0, -2.0)) };
    TimedEvent { event, time: 412.5 }
}

#[test]
fn an_alert_has_the_nearest_pair_and_the_event_each_in_its_place() {
    let header = FrameHeader { run_id: 7, tick: 9, stamp_ns: 11, sim_time: 402.5, ..Default::default() };
    let event = Some(timed(EventKind::Contact, Some(8)));
    let message = collision_alert(&header, &Alert { level: Level::Approaching, event, nearest: Some(NEAREST) });
    assert_eq!((message.run_id, message.tick, message.stamp_ns, message.sim_time), (7, 9, 11, 402.5));
    assert_eq!((message.level, message.event), (1, 2));
    assert_eq!((message.event_time, message.time_to_event), (412.5, 10.0));
    assert_eq!((message.bench_a, message.bench_b, message.clearance), (3, 17, 0.25));
    assert_eq!((message.x, message.y), (1.5, 4.0));
    assert_eq!((message.event_bench_a, message.event_bench_b), (0, 8));
    assert_eq!((message.event_x, message.event_y), (-1.0, -2.0));
}

#[test]
fn a_stall_has_one_bench_and_nothing_at_all_has_none() {
    let header = FrameHeader { sim_time: 420.0, ..Default::default() };
    let stall = Some(timed(EventKind::Stall, None));
    let message = collision_alert(&header, &Alert { level: Level::Stall, event: stall, nearest: None });
    assert_eq!((message.level, message.event, message.event_bench_b), (3, 3, NO_BENCH));
    assert_eq!(message.event_benches().collect::<Vec<_>>(), [0]);
    assert!(message.clearance.is_nan() && message.x.is_nan() && message.y.is_nan());
    let message = collision_alert(&header, &Alert { level: Level::Clear, event: None, nearest: None });
    assert_eq!((message.event, message.bench_a, message.event_bench_a), (0, NO_BENCH, NO_BENCH));
    assert!([message.event_time, message.time_to_event, message.event_x, message.event_y].iter().all(|n| n.is_nan()));
    assert_eq!(message.nearest_benches().chain(message.event_benches()).count(), 0);
}

/// Returns the poses of the ROS 2 message of a path.
fn poses(outlines: impl IntoIterator<Item = SegmentOutline>) -> Vec<Pose> {
    let segments: Vec<_> = outlines.into_iter().map(|outline| stage_segment(&outline)).collect();
    let dragon = StageDragon { segments: segments.len() as u32, ..Default::default() };
    let stage = Stage { dragons: List::of([dragon]), ..Default::default() };
    PathMessage::of(&StageMessage { stage, segments }).poses.into_iter().map(|stamped| stamped.pose).collect()
}

/// Every pose lies on the path, and looks along it, by the path's own points and tangents.
fn check(path: &Path) {
    let poses = poses(path.outline());
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
    for path in [Path::spiral(0.55, 16.0), Path::turnaround(1.7, 4.5, 2.0, 100.0, 60.0).unwrap()] {
        for (turns, mirror) in [(0.3, false), (0.0, true), (-0.2, true)] {
            let placement = Placement::new(Vector::new(7.0, -3.0), turns, mirror);
            let home = poses(path.outline());
            let away = poses(path.outline().into_iter().map(|segment| placement.outline(segment)));
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
    check(&Path::spiral(0.55, 16.0));
    check(&Path::turnaround(1.7, 4.5, 2.0, 100.0, 60.0).unwrap());
    let route = Path::route(0.1).line(5.0).arc(Side::Left, 3.0, 0.5);
    check(&route.line(2.0).arc(Side::Right, 1.5, 0.75).build().unwrap());
    let spirals = Path::route(0.1).line(5.0).spiral(Side::Left, Direction::Inward, 1.7, 7.0, 2.5);
    let spirals = spirals.arc(Side::Right, 2.0, 0.3).spiral(Side::Left, Direction::Outward, 0.9, 4.0, 1.2);
    let spirals = spirals.spiral(Side::Right, Direction::Inward, 0.9, 4.0, 2.2);
    check(&spirals.spiral(Side::Right, Direction::Outward, 1.3, 3.0, 2.2).build().unwrap());
}
