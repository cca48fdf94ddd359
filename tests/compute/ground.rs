//! Obstacles in frames: the least clearance of every frame against all benches and obstacles, alerts, and the end of
//! the show. The results are the same at every rate and placement.

use bench_dragon::messages::state::{EventKind, FrameState, Level};
use bench_dragon::motion::clearance::{board, least_clearance_all_pairs};
use bench_dragon::motion::ensemble::Ensemble;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::ground::{Ground, Obstacle};
use bench_dragon::motion::model::shape::Shape;
use bench_dragon::motion::model::{Point, Vector};
use bench_dragon::motion::placement::Placement;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::show::convert::{Stamps, collision_alert, frame_header, stage};
use bench_dragon::show::scene::{OnContact, Scene};
use bench_dragon::show::{Playback, Show};
use proptest::prelude::*;

const SQUARE: &str = include_str!("ground.toml");

fn scene(text: &str) -> Scene {
    Scene::parse(text, "test.toml", "test").unwrap()
}

/// The square with a lamp that stands in the way.
fn blocked() -> Scene {
    let text = SQUARE.replace("center = [4.0, 3.5]", "center = [4.0, 2.9]");
    assert_ne!(text, SQUARE);
    scene(&text)
}

fn timeline(scene: &Scene) -> Timeline {
    scene.ensemble.timeline(&mut unreported)
}

/// The least of all clearances of a chain: of pairs, and of each bench with each obstacle.
fn least_of_all(scene: &Scene, chain: &Chain) -> (f64, u32, u32) {
    let team = scene.ensemble.only().unwrap().team();
    let pair =
        least_clearance_all_pairs(chain, team).map(|pair| (pair.value, pair.bench_a as u32, pair.bench_b as u32));
    let ground = scene.ensemble.ground().obstacles();
    let meetings = (0..team.benches).flat_map(|bench| (0..ground.len()).map(move |j| (bench, j)));
    let of = |(bench, j): (usize, usize)| {
        (ground[j].clearance(&board(chain, team, bench)), bench as u32, scene.ensemble.obstacle_number(j))
    };
    meetings.map(of).chain(pair).min_by(|one, other| one.0.total_cmp(&other.0)).unwrap()
}

#[test]
fn the_clearance_of_every_frame_is_the_least_of_all() {
    let paper = include_str!("../../config/paper.toml").to_owned()
        + "[stage]\nboundary = { polygon = [[-20, -20], [20, -20], [20, 20], [0, 12], [-20, 20]] }\n\
           [[stage.obstacles]]\nname = \"lamp\"\ncircle = { center = [9.0, 3.0], radius = 0.3 }\n\
           [[stage.obstacles]]\nname = \"house\"\npolygon = [[1, 9.2], [2, 11], [0, 10]]\nkeep_out = 0.1\n";
    let turnaround = include_str!("../../config/turnaround.toml").to_owned()
        + "[placement]\norigin = [10.0, 2.0]\nrotation_turns = 0.2\nmirror = true\n\
           [stage]\n[[stage.obstacles]]\nname = \"well\"\ncircle = { center = [10.0, 2.0], radius = 1.5 }\n";
    let newton = SQUARE.replace("head_speed = 1.0", "head_speed = 1.0\nsolver = \"newton\"");
    for (text, seconds) in [(SQUARE, 60.0), (&newton, 60.0), (&paper, 410.0), (&turnaround, 200.0)] {
        let scene = scene(&text.replace("on_contact = \"stop\"", "on_contact = \"continue\""));
        let timeline = scene.ensemble.timeline_without_contact(&mut unreported);
        let playback = Playback { rate: 3.0, on_contact: OnContact::Continue, ..Playback::of(&scene) };
        let mut show = Show::new(&scene, timeline, playback).unwrap();
        let mut by_obstacle = 0;
        for tick in 0..(3.0 * seconds) as u64 {
            let frame = show.frame(tick);
            let (value, ..) = least_of_all(&scene, &frame.chain);
            assert!((frame.min_clearance - value).abs() < 1e-11, "tick {tick}: {} {value}", frame.min_clearance);
            let pair = least_clearance_all_pairs(&frame.chain, scene.ensemble.only().unwrap().team()).unwrap().value;
            by_obstacle += u64::from(value < pair);
        }
        assert!(by_obstacle > 30, "{by_obstacle} frames");
    }
}

#[test]
fn a_show_stops_at_an_obstacle_at_every_rate_with_the_same_alerts() {
    let scene = blocked();
    let timeline = timeline(&scene);
    let event = *timeline.find(EventKind::Obstacle).unwrap();
    assert_eq!((event.event.bench_a, event.event.bench_b), (Some(0), Some(13)));
    for rate in [7.0, 60.0, 1000.0] {
        let mut show = Show::new(&scene, timeline.clone(), Playback { rate, ..Playback::of(&scene) }).unwrap();
        assert_eq!(show.freeze_time(), event.time);
        let mut alerts = Vec::new();
        for tick in 0..(rate * (event.time + 2.0)) as u64 {
            let frame = show.frame(tick);
            let header = frame_header(frame, Stamps { run_id: 0, sequence: 0, stamp_ns: 0, deadline_ns: 0 });
            alerts.extend(frame.alerts.iter().map(|alert| collision_alert(&header, alert)));
            let happened = frame.sim_time >= event.time;
            assert_eq!(frame.state == FrameState::Obstacle, happened, "{} at {rate}", frame.sim_time);
            assert!(frame.sim_time <= event.time && frame.unforeseen_contacts == 0);
        }
        let frame = show.frame((rate * (event.time + 3.0)) as u64);
        assert!(frame.sim_time == event.time && frame.min_clearance.abs() < 1e-9, "{frame:?}");
        assert!(frame.chain.vx.iter().all(|speed| *speed == 0.0));
        let touch = alerts.last().unwrap();
        assert_eq!((touch.alert_level(), touch.event_kind()), (Some(Level::Obstacle), Some(EventKind::Obstacle)));
        assert_eq!((touch.event_time, touch.event_bench_a, touch.event_bench_b), (event.time, 0, 13));
        assert_eq!((touch.bench_a, touch.bench_b), (0, 13));
        // The team has come near other obstacles before.
        let warned = alerts.iter().rev().skip(1).take_while(|alert| alert.alert_level() == Some(Level::Approaching));
        let warned: Vec<_> = warned.collect();
        assert!(!warned.is_empty() && warned.iter().all(|alert| alert.event_kind() == Some(EventKind::Obstacle)));
        assert!(warned.last().unwrap().time_to_event >= 5.0 - 1.0 / rate);
    }
}

#[test]
fn a_show_that_continues_passes_every_obstacle_and_lists_each_kind_once() {
    let text = SQUARE.replace("on_contact = \"stop\"", "on_contact = \"continue\"");
    let scene = scene(&text.replace("keep_out = 1.5", "keep_out = 3.5"));
    let timeline = timeline(&scene);
    let kinds: Vec<_> = timeline.events().iter().map(|timed| timed.event.kind).collect();
    assert_eq!(kinds.iter().filter(|kind| **kind == EventKind::Obstacle).count(), 2, "{kinds:?}");
    let mut show = Show::new(&scene, timeline.clone(), Playback::of(&scene)).unwrap();
    assert_eq!(show.freeze_time(), timeline.end().time);
    let mut levels = Vec::new();
    for tick in 0..(60.0 * timeline.end().time) as u64 + 2 {
        let frame = show.frame(tick);
        levels.extend(frame.alerts.iter().map(|alert| alert.level));
        assert_eq!(frame.unforeseen_contacts, 0);
    }
    // The first touch is at the start, and the level stays.
    assert_eq!(levels, [Level::Obstacle]);
    let stage = stage(1, 2, [0; 32], &scene.ensemble, &show);
    let listed: Vec<_> = stage.stage.events.iter().map(|event| event.kind().unwrap()).collect();
    // The first event of each obstacle.
    assert_eq!(listed, [EventKind::Obstacle, EventKind::Obstacle, EventKind::PathEnd]);
}

#[test]
fn a_scene_without_alerts_meets_nothing() {
    let scene = blocked();
    let scene = Scene { alerts: None, ..scene };
    let timeline = timeline(&scene);
    let end = timeline.end().time;
    let show = Show::new(&scene, timeline, Playback::of(&scene)).unwrap();
    assert_eq!((show.freeze_time(), show.timeline().events().len()), (end, 1));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(12) })]

    /// The same path and the same obstacles, placed together, have the same events and clearances.
    #[test]
    fn a_placement_moves_path_and_obstacles_together(
        x in -50.0..50.0f64, y in -50.0..50.0f64, turns in -1.0..1.0f64, mirror in any::<bool>(), lamp in 2.0..3.4f64,
    ) {
        let home = scene(&SQUARE.replace("center = [4.0, 3.5]", &format!("center = [4.0, {lamp:?}]")));
        let placement = Placement::new(Vector::new(x, y), turns, mirror);
        let own = home.ensemble.only().unwrap().in_own_frame();
        let placed = |obstacle: &Obstacle| Obstacle {
            shape: obstacle.shape.mapped(|point: Point| placement.point(point)),
            ..obstacle.clone()
        };
        let ground = Ground::new(own.ground().obstacles().iter().map(placed).collect());
        let away = Ensemble::alone(own.clone().placed(placement).on_ground(ground));
        let own = Ensemble::alone(own);
        let timelines = [&own, &away].map(|ensemble| ensemble.timeline(&mut unreported));
        prop_assert_eq!(timelines[0].events().len(), timelines[1].events().len());
        for (one, other) in timelines[0].events().iter().zip(timelines[1].events()) {
            prop_assert!((one.time - other.time).abs() < 1e-11 && one.event.bench_a == other.event.bench_a);
            let places = one.event.place.zip(other.event.place);
            prop_assert!(places.is_none_or(|(one, other)| (placement.point(one) - other).norm() < 1e-11));
        }
        let show_end = |k: usize| timelines[k].show_end(true);
        let least = [own.obstacle_clearances(show_end(0), &mut unreported), away.obstacle_clearances(show_end(1), &mut unreported)];
        for (one, other) in least[0].iter().zip(&least[1]) {
            prop_assert!((one.least.value - other.least.value).abs() < 1e-11, "{one:?} {other:?}");
        }
    }
}

/// A scene with an obstacle far away has the frames of the scene without one, bit by bit.
#[test]
fn an_obstacle_changes_no_pose() {
    let empty =
        scene(&[&SQUARE[..SQUARE.find("[stage]").unwrap()], &SQUARE[SQUARE.find("[motion]").unwrap()..]].concat());
    let full = scene(SQUARE);
    let mut chains = [&empty, &full].map(|scene| {
        let mut chain = Chain::new(scene.ensemble.handles());
        scene.ensemble.only().unwrap().solver(Velocities::Computed).solver.solve(17.25, &mut chain).unwrap();
        chain
    });
    assert_eq!(chains[0], chains[1]);
    chains[0].x[0] += 1.0;
    assert_ne!(chains[0], chains[1]);
    let far = Ground::new(vec![Obstacle {
        name: "far".to_owned(),
        shape: Shape::circle(Point::new(1e4, 0.0), 1.0),
        keep_out: 0.0,
    }]);
    let ensemble = Ensemble::alone(empty.ensemble.only().unwrap().clone().on_ground(far));
    let full = Scene { ensemble, ..empty.clone() };
    let mut shows = [&empty, &full].map(|scene| Show::new(scene, timeline(scene), Playback::of(scene)).unwrap());
    for tick in (0..3000).step_by(50) {
        let [one, other] = shows.each_mut().map(|show| show.frame(tick));
        assert_eq!((&one.chain, one.min_clearance, one.state), (&other.chain, other.min_clearance, other.state));
    }
}
