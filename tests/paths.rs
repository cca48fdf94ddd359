//! Turnarounds and routes: events, least clearance and plans against dense sampling of all pairs, and what a live
//! subscriber relies on at the junctions.

use bench_dragon::chain::newton::Newton;
use bench_dragon::chain::{Chain, Velocities};
use bench_dragon::clearance::least_clearance_all_pairs;
use bench_dragon::geometry::path::Path;
use bench_dragon::geometry::pieces::PiecePath;
use bench_dragon::geometry::spiral::Spiral;
use bench_dragon::messages::State;
use bench_dragon::plan::{greatest_speed, least_pitch};
use bench_dragon::scene::Scene;
use bench_dragon::scene::path::ScenePath;
use bench_dragon::show::timeline::Timeline;
use bench_dragon::show::{Playback, Show};
use proptest::prelude::*;

fn scene(path: &str, benches: usize) -> Scene {
    let text = format!(
        "[team]\nbenches = {benches}\nhead_length = 3.41\nbody_length = 2.20\nwidth = 0.30\nhole_inset = 0.275\n\
         [path]\n{path}\n[motion]\nhead_speed = 1.0\n[alerts]\n"
    );
    Scene::parse(&text, "test", "test").unwrap()
}

fn turnaround() -> Scene {
    Scene::parse(include_str!("../config/turnaround.toml"), "turnaround.toml", "turnaround").unwrap()
}

fn pieces(scene: &Scene) -> &PiecePath {
    match &scene.path {
        ScenePath::Pieces(path) => path,
        ScenePath::Spiral(_) => panic!("a spiral"),
    }
}

fn timeline(scene: &Scene) -> Timeline {
    Timeline::of(scene, &mut |_| ())
}

/// The chain with the head so far along, as the safe solver has it.
fn chain_at(scene: &Scene, travelled: f64, chain: &mut Chain) -> bool {
    let newton = Newton::new(pieces(scene).clone(), scene.team, 1.0, Velocities::Computed);
    newton.solve_from(pieces(scene).place_at(travelled), chain).is_ok()
}

#[test]
fn the_turnaround_is_free_and_its_least_clearance_is_that_of_dense_sampling() {
    let scene = turnaround();
    let timeline = timeline(&scene);
    assert_eq!(timeline.events().iter().map(|timed| timed.event.kind).collect::<Vec<_>>(), [State::PathEnd]);
    assert!((timeline.end().time - 482.7812449068211).abs() < 1e-9);
    let found = timeline.least_clearance(&scene, &mut |_| ()).unwrap();
    let mut chain = Chain::new(scene.team.handles());
    let mut sampled = f64::INFINITY;
    for k in 0..=4828 {
        assert!(chain_at(&scene, f64::from(k) * 0.1, &mut chain));
        sampled = sampled.min(least_clearance_all_pairs(&chain, &scene.team).unwrap().value);
    }
    println!("{found:?}, sampled {sampled}");
    assert!(found.least.value <= sampled && found.least.value > sampled - 0.01);
    assert!(chain_at(&scene, found.least.travelled, &mut chain));
    let there = least_clearance_all_pairs(&chain, &scene.team).unwrap();
    assert!((there.value - found.least.value).abs() < 1e-12);
    assert_eq!((there.bench_a as u32, there.bench_b as u32), (found.least.bench_a, found.least.bench_b));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever ends a turnaround: before it nothing touches and nothing jumps, and at it something does.
    #[test]
    fn events_of_turnarounds_are_those_of_dense_sampling(
        pitch in 0.9..2.5f64, turns in 1.2..4.0f64, ratio in 0.3..4.0f64, benches in 3..60usize,
    ) {
        let path = format!(
            "kind = \"turnaround\"\npitch = {pitch}\nturn_radius = {}\narc_ratio = {ratio}\nlead_in = 40",
            pitch * turns
        );
        let Ok(scene) = std::panic::catch_unwind(|| scene(&path, benches)) else { return Ok(()) };
        let timeline = timeline(&scene);
        let contact = timeline.find(State::Contact).map_or(f64::INFINITY, |contact| contact.time);
        let stall = timeline.find(State::Stall).map_or(f64::INFINITY, |stall| stall.time);
        let end = timeline.end();
        let mut chain = Chain::new(scene.team.handles());
        let mut before: Option<Chain> = None;
        let step = 0.02;
        for k in 0.. {
            let time = f64::from(k) * step;
            if time > end.time - 1e-6 {
                break;
            }
            prop_assert!(chain_at(&scene, time, &mut chain), "no solution at {time} before the end {end:?}");
            let clearance = least_clearance_all_pairs(&chain, &scene.team).unwrap().value;
            prop_assert!(time >= contact || clearance > 0.0, "{clearance} at {time}, contact at {contact}");
            let slowest = chain.speed.iter().copied().fold(f64::INFINITY, f64::min);
            prop_assert!(time >= stall || slowest > -1e-9, "{slowest} at {time}, stall at {stall}");
            if let Some(before) = &before {
                for i in 0..chain.handles() {
                    let moved = (chain.x[i] - before.x[i]).hypot(chain.y[i] - before.y[i]);
                    let fastest = chain.speed[i].abs().max(before.speed[i].abs());
                    // Away from the end, where speeds have no bound, they change little from look to look.
                    prop_assert!(moved <= 2.0 * step * fastest + 0.05 || time > end.time - 0.1, "{moved} at {time}");
                }
            }
            before = Some(chain.clone());
        }
        if contact.is_finite() {
            prop_assert!(chain_at(&scene, contact, &mut chain));
            let clearance = least_clearance_all_pairs(&chain, &scene.team).unwrap().value;
            prop_assert!(contact == 0.0 || clearance.abs() < 1e-9, "{clearance} at the contact");
        }
        if end.event.kind == State::Lock {
            // Just past a lock there is no chain, or a handle has jumped.
            let at = end.event.travelled;
            prop_assert!(chain_at(&scene, at * (1.0 - 1e-14), &mut chain) || chain_at(&scene, at * (1.0 - 1e-13), &mut chain));
            let here = chain.clone();
            let jumped = !chain_at(&scene, at + 1e-6, &mut chain)
                || (0..3).any(|i| (chain.x[i] - here.x[i]).hypot(chain.y[i] - here.y[i]) > 1e-3);
            prop_assert!(jumped, "nothing happens at the lock {at}");
        }
    }
}

/// Through the whole turn at 1 kHz: no handle goes further from frame to frame than its speed allows, velocities are
/// the motion's, and the alert level does not flicker.
#[test]
fn nothing_jumps_at_the_junctions_and_no_alert_flickers() {
    let scene = turnaround();
    let rate = 1000.0;
    let playback = Playback { start: 98.0, rate, ..Playback::of(&scene) };
    let mut show = Show::new(&scene, timeline(&scene), playback).unwrap();
    let mut before: Option<Chain> = None;
    let (mut alerts, mut worst) = (0, 0f64);
    for tick in 0..20_000 {
        let frame = show.frame(tick);
        alerts += frame.alerts.len();
        assert_eq!(frame.state, State::Moving);
        if let Some(before) = &before {
            for i in 0..frame.chain.handles() {
                let moved = (frame.chain.x[i] - before.x[i], frame.chain.y[i] - before.y[i]);
                // Half a frame at either velocity; what a slope that jumps in between can add is second order.
                let expected =
                    (0.5 * (frame.chain.vx[i] + before.vx[i]) / rate, 0.5 * (frame.chain.vy[i] + before.vy[i]) / rate);
                worst = worst.max((moved.0 - expected.0).hypot(moved.1 - expected.1));
            }
        }
        before = Some(frame.chain.clone());
    }
    println!("worst {worst:e} m");
    assert!(worst < 1e-6, "{worst:e}");
    assert_eq!(alerts, 1, "only the level at the start");
}

#[test]
fn a_procession_is_straight_at_first_and_ends_where_its_path_does() {
    let text = include_str!("../config/procession.toml");
    let scene = Scene::parse(text, "procession.toml", "procession").unwrap();
    let mut chain = Chain::new(scene.team.handles());
    assert!(chain_at(&scene, 0.0, &mut chain));
    assert!((chain.x[0] + 30.0).abs() < 1e-12 && chain.y.iter().all(|y| (y + 10.0).abs() < 1e-12));
    assert!(chain.speed.iter().all(|speed| (speed - 1.0).abs() < 1e-12));
    let timeline = timeline(&scene);
    assert_eq!(timeline.events().len(), 1);
    let length = 40.0 + 12.0 + 10.0 + 120.0 + std::f64::consts::PI * (3.0 + 5.0 + 5.0);
    assert!((timeline.end().time - length).abs() < 1e-12 * length);
}

/// An arc whose diameter is shorter than the link: the link stalls and locks, and no handle jumps before.
#[test]
fn a_hairpin_that_is_too_tight_stalls_and_locks() {
    let path = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"line\"\nlength = 10\n\
                [[path.pieces]]\nkind = \"arc\"\nradius = 0.5\nside = \"left\"\nturns = 0.5\n\
                [[path.pieces]]\nkind = \"line\"\nlength = 10";
    let scene = scene(path, 5);
    let timeline = timeline(&scene);
    let stall = timeline.find(State::Stall).expect("a stall");
    // The link of 2.86 m stands square to the path where the head has come round and back along the second line by h:
    // then its rear handle is as far along the first, at the same height h, 1 m across.
    let kinds: Vec<_> = timeline.events().iter().map(|timed| timed.event.kind).collect();
    println!("{:?}", timeline.events());
    assert!(kinds.contains(&State::Stall) && timeline.end().event.kind == State::Lock);
    assert!(stall.time > 10.0 && stall.time < timeline.end().time);
}

#[test]
fn the_least_pitch_to_4_5_m_is_where_boards_just_touch() {
    let team = Scene::paper().team;
    let plan = least_pitch(&team, 4.5, &mut |_| ()).unwrap();
    println!("{plan:?}");
    assert_eq!((plan.bench_a, plan.bench_b), (0, 19));
    assert!(plan.head_radius > 4.5 && plan.head_radius < 4.7);
    // All pairs, sampled about the touch: free at the pitch, overlapping a millionth below.
    let least = |pitch: f64| {
        let spiral = Spiral::new(pitch, 16.0);
        let newton = Newton::new(spiral, team, 1.0, Velocities::Omitted);
        let mut chain = Chain::new(team.handles());
        let at = spiral
            .distance_between(spiral.start(), spiral.place_of_theta(std::f64::consts::TAU * plan.head_radius / pitch));
        (-400..=400)
            .map(|k| {
                newton.solve_from(spiral.place_at(at + f64::from(k) * 1e-3), &mut chain).unwrap();
                least_clearance_all_pairs(&chain, &team).unwrap().value
            })
            .fold(f64::INFINITY, f64::min)
    };
    let (at, below) = (least(plan.value), least(plan.value - 1e-6));
    println!("{at:e} {below:e}");
    assert!((0.0..1e-7).contains(&at) && below < 0.0);
}

#[test]
fn the_greatest_speed_of_the_turnaround_is_that_of_dense_sampling() {
    let scene = turnaround();
    let plan = greatest_speed(&scene, &timeline(&scene), 2.0, &mut |_| ()).unwrap();
    println!("{plan:?}");
    let mut chain = Chain::new(scene.team.handles());
    assert!(chain_at(&scene, plan.time, &mut chain));
    assert!((chain.speed[plan.handle as usize] - plan.ratio).abs() < 1e-12);
    let mut sampled = 0f64;
    for k in 0..48_000 {
        assert!(chain_at(&scene, f64::from(k) * 0.01, &mut chain));
        sampled = chain.speed.iter().copied().fold(sampled, f64::max);
    }
    assert!(plan.ratio >= sampled && plan.ratio < sampled + 1e-3, "{} {sampled}", plan.ratio);
    assert!((plan.value * plan.ratio - 2.0).abs() < 1e-14);
    assert!(plan.time.fract() > 1e-3);
}

#[test]
fn wrong_paths_are_refused_in_one_sentence() {
    let turn = "kind = \"turnaround\"\npitch = 1.7\nturn_radius = 4.5\narc_ratio = 2";
    let arc = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"arc\"\nradius = 2";
    for (path, words) in [
        (turn.to_owned(), "path.lead_in and path.start_turn are both missing"),
        (format!("{turn}\nlead_in = 1\nstart_turn = 5"), "both given"),
        (format!("{turn}\nstart_turn = 2"), "inside the turn"),
        (format!("{turn}\nlead_in = 1\nheading_turns = 0.5"), "path.heading_turns is given"),
        (turn.replace("4.5", "0.5") + "\nlead_in = 0", "folded back"),
        ("kind = \"pieces\"".to_owned(), "path.pieces is missing"),
        ("kind = \"pieces\"\npieces = []".to_owned(), "expected from 1 to"),
        (arc.to_owned(), "an arc has a radius, a side"),
        (format!("{arc}\nside = \"left\"\nturns = 0.2\nlength = 3"), "an arc has a radius, a side"),
        (
            "kind = \"pieces\"\n[[path.pieces]]\nkind = \"line\"\nlength = 3\nradius = 1".to_owned(),
            "a line has a length",
        ),
    ] {
        let text = format!(
            "[team]\nbenches = 9\nhead_length = 3.41\nbody_length = 2.20\nwidth = 0.30\nhole_inset = 0.275\n\
             [motion]\nhead_speed = 1.0\n[path]\n{path}\n"
        );
        let error = Scene::parse(&text, "test.toml", "test").unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("line ") && error.lines().count() == 1, "{path}: {error}");
    }
}

/// A team of one bench and of two, whose second link is the tail.
#[test]
fn the_smallest_teams_turn_round() {
    for benches in [1, 2] {
        let scene = scene("kind = \"turnaround\"\npitch = 1.7\nturn_radius = 4.5\narc_ratio = 2\nlead_in = 9", benches);
        assert_eq!(timeline(&scene).end().event.kind, State::PathEnd);
        assert_eq!(timeline(&scene).least_clearance(&scene, &mut |_| ()), None);
    }
}
