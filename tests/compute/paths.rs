//! Turnarounds and routes: events, least clearance and plans against dense sampling of all pairs, and the properties at
//! junctions on which a live subscriber relies.

use bench_dragon::certify::plan::{greatest_speed, least_pitch};
use bench_dragon::messages::state::EventKind;
use bench_dragon::messages::state::FrameState;
use bench_dragon::motion::clearance::least_clearance_all_pairs;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::linkage::follower;
use bench_dragon::motion::model::path::Path;
use bench_dragon::motion::model::team::{Ends, Team};
use bench_dragon::motion::solve::newton::Newton;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::show::scene::Scene;
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
    Scene::parse(include_str!("../../config/turnaround.toml"), "turnaround.toml", "turnaround").unwrap()
}

fn timeline(scene: &Scene) -> Timeline {
    scene.ensemble.timeline(&mut unreported)
}

/// Computes the chain on the stage at `travelled` metres with the safe solver.
fn chain_at(scene: &Scene, travelled: f64, chain: &mut Chain) -> bool {
    let newton = Newton::new(
        scene.ensemble.only().unwrap().path().clone(),
        *scene.ensemble.only().unwrap().team(),
        1.0,
        Velocities::Computed,
    );
    let solved = newton.solve_at(travelled, chain).is_ok();
    scene.ensemble.only().unwrap().placement().chain(&mut chain.all_mut());
    solved
}

#[test]
#[ignore = "tests/run --all"]
fn the_turnaround_is_free_and_its_least_clearance_is_that_of_dense_sampling() {
    let scene = turnaround();
    let timeline = timeline(&scene);
    assert_eq!(timeline.events().iter().map(|timed| timed.event.kind).collect::<Vec<_>>(), [EventKind::PathEnd]);
    assert!((timeline.end().time - 482.7812449068211).abs() < 1e-9);
    let found = scene.ensemble.least_clearances(&timeline, timeline.end(), &mut unreported).own.unwrap();
    let mut chain = Chain::new(scene.ensemble.handles());
    let mut sampled = f64::INFINITY;
    for k in 0..=4828 {
        assert!(chain_at(&scene, f64::from(k) * 0.1, &mut chain));
        sampled = sampled.min(least_clearance_all_pairs(&chain, scene.ensemble.only().unwrap().team()).unwrap().value);
    }
    println!("{found:?}, sampled {sampled}");
    assert!(found.least.value <= sampled && found.least.value > sampled - 0.01);
    assert!(chain_at(&scene, found.least.travelled, &mut chain));
    let there = least_clearance_all_pairs(&chain, scene.ensemble.only().unwrap().team()).unwrap();
    assert!((there.value - found.least.value).abs() < 1e-12);
    assert_eq!((there.bench_a as u32, there.bench_b as u32), (found.least.bench_a, found.least.bench_b));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Time reversal with equal links. A chain in the turn, run backwards and turned by half a turn, is the chain in
    /// the turn whose arcs are exchanged.
    #[test]
    fn the_way_out_is_the_way_in_backwards(ratio in 0.5..2.0f64, head in 40.0..110.0f64) {
        let team = Team { benches: 20, head_length: 2.2, body_length: 2.2, width: 0.3, hole_inset: 0.275, ends: Ends::NONE };
        let path = |ratio: f64| Path::turnaround(1.7, 4.5, ratio, 60.0, 60.0).unwrap();
        let (there, back) = (path(ratio), path(1.0 / ratio));
        let mut front = there.param_at(head);
        let mut places = vec![front];
        for bench in 0..team.benches {
            front = follower(&there, front, team.link(bench)).unwrap();
            places.push(front);
        }
        let mut mirrored = back.param_at(back.length() - there.travelled(front));
        for place in places.iter().rev() {
            let apart = there.point(*place).coords + back.point(mirrored).coords;
            prop_assert!(apart.norm() < 1e-11, "{apart:?} at {place:?}");
            mirrored = follower(&back, mirrored, team.link(1)).unwrap();
        }
    }
}

/// Through the whole turn at 1 kHz, no handle goes further from frame to frame than its speed allows. Velocities are
/// those of the motion, and the alert level does not flicker.
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
        assert_eq!(frame.state, FrameState::Moving);
        if let Some(before) = &before {
            for i in 0..frame.chain.handles() {
                let moved = (frame.chain.x[i] - before.x[i], frame.chain.y[i] - before.y[i]);
                // Half a frame at either velocity; a slope that jumps in between adds a second-order term.
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
    let text = include_str!("../../config/procession.toml");
    let scene = Scene::parse(text, "procession.toml", "procession").unwrap();
    let mut chain = Chain::new(scene.ensemble.handles());
    assert!(chain_at(&scene, 0.0, &mut chain));
    assert!((chain.x[0] + 30.0).abs() < 1e-12 && chain.y.iter().all(|y| (y + 10.0).abs() < 1e-12));
    assert!(chain.speed.iter().all(|speed| (speed - 1.0).abs() < 1e-12));
    let timeline = timeline(&scene);
    assert_eq!(timeline.events().len(), 1);
    let length = 40.0 + 12.0 + 10.0 + 120.0 + std::f64::consts::PI * (3.0 + 5.0 + 5.0);
    assert!((timeline.end().time - length).abs() < 1e-12 * length);
}

/// An arc whose diameter is shorter than the link: the link stalls, and the team is pushed back to the end, although
/// places ahead of the rear handle come to the link's length.
#[test]
fn a_hairpin_that_is_too_tight_pushes_the_team_back() {
    let path = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"line\"\nlength = 10\n\
                [[path.pieces]]\nkind = \"arc\"\nradius = 0.5\nside = \"left\"\nturns = 0.5\n\
                [[path.pieces]]\nkind = \"line\"\nlength = 10";
    let scene = scene(path, 5);
    let timeline = timeline(&scene);
    let stall = timeline.find(EventKind::Stall).expect("a stall");
    let kinds: Vec<_> = timeline.events().iter().map(|timed| timed.event.kind).collect();
    println!("{:?}", timeline.events());
    assert_eq!(kinds, [EventKind::Stall, EventKind::PathEnd]);
    let mut chain = Chain::new(6);
    assert!(chain_at(&scene, timeline.end().time, &mut chain));
    let behind = (2.86f64 * 2.86 - 1.0).sqrt();
    assert!((chain.x[0].abs() + (chain.x[1] + behind).abs()) < 1e-9 && chain.y[1].abs() < 1e-9, "{:?}", chain.x);
    assert!((chain.speed[5] + 1.0).abs() < 1e-9, "{:?}", chain.speed);
    // At the stall the head is still on the arc, and the rear handle on the line before it: t . b = 0 in closed form.
    let (radius, link) = (0.5, 2.86);
    let angle = (stall.time - 10.0) / radius;
    let head = (10.0 + radius * angle.sin(), radius * (1.0 - angle.cos()));
    let rear = head.0 - (link * link - head.1 * head.1).sqrt();
    let along = (head.0 - rear) * angle.cos() + head.1 * angle.sin();
    assert!(along.abs() < 1e-9 && angle < std::f64::consts::PI, "{along:e} at {angle} rad");
}

#[test]
fn the_least_pitch_to_4_5_m_is_where_boards_just_touch() {
    let team = *Scene::paper().ensemble.only().unwrap().team();
    let plan = least_pitch(&team, 4.5, &mut unreported).unwrap();
    println!("{plan:?}");
    let overlap = plan.overlap.unwrap();
    assert_eq!((overlap.bench_a, overlap.bench_b), (0, 19));
    assert!(overlap.head_radius > 4.5 && overlap.head_radius < 4.7);
    // All pairs, sampled about the touch: free at the pitch, overlapping a millionth below.
    let least = |pitch: f64| {
        let path = Path::spiral(pitch, 16.0);
        let at = path.length() - Path::spiral(pitch, overlap.head_radius / pitch).length();
        let newton = Newton::new(path, team, 1.0, Velocities::Omitted);
        let mut chain = Chain::new(team.handles());
        (-400..=400)
            .map(|k| {
                newton.solve_at(at + f64::from(k) * 1e-3, &mut chain).unwrap();
                least_clearance_all_pairs(&chain, &team).unwrap().value
            })
            .fold(f64::INFINITY, f64::min)
    };
    let value = plan.value_hi.unwrap();
    let (at, below) = (least(value), least(value - 1e-6));
    println!("{at:e} {below:e}");
    assert!((0.0..1e-7).contains(&at) && below < 0.0);
}

#[test]
#[ignore = "tests/run --all"]
fn the_greatest_speed_of_the_turnaround_is_that_of_dense_sampling() {
    let scene = turnaround();
    let plan = greatest_speed(&scene, &timeline(&scene), 2.0, &mut unreported).unwrap();
    println!("{plan:?}");
    let mut chain = Chain::new(scene.ensemble.handles());
    assert!(chain_at(&scene, plan.time, &mut chain));
    assert!((chain.speed[plan.handle as usize] - plan.ratio).abs() < 1e-10);
    let mut sampled = 0f64;
    for k in 0..48_000 {
        assert!(chain_at(&scene, f64::from(k) * 0.01, &mut chain));
        sampled = chain.speed.iter().copied().fold(sampled, f64::max);
    }
    let (least, most) = (2.0 / plan.value_hi, 2.0 / plan.value_lo);
    assert!(most >= sampled && least < sampled + 1e-3, "{least} {most} {sampled}");
    assert!((least..=most).contains(&plan.ratio));
    assert!(plan.time.fract() > 1e-3);
}

/// Returns a route of short lines.
fn pieces(count: usize) -> String {
    format!("kind = \"pieces\"\n{}", "[[path.pieces]]\nkind = \"line\"\nlength = 0.5\n".repeat(count))
}

#[test]
fn wrong_paths_are_refused_in_one_sentence() {
    let turn = "kind = \"turnaround\"\npitch = 1.7\nturn_radius = 4.5\narc_ratio = 2";
    let arc = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"arc\"\nradius = 2";
    let spiral = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"spiral\"\npitch = 0.5\nradius = 2\nside = \"left\"\n\
                  direction = \"in\"\nturns = 1";
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
        (spiral.replace("side = \"left\"\n", ""), "a spiral has a pitch, a radius"),
        (format!("{spiral}\nlength = 3"), "a spiral has a pitch, a radius"),
        (spiral.replace("\"in\"", "\"inward\""), "direction"),
        (spiral.replace("0.5", "0"), "path.pieces.pitch is 0"),
        (spiral.replace("radius = 2", "radius = 0"), "path.pieces.radius is 0"),
        (spiral.replace("radius = 2", "radius = -2"), "path.pieces.radius is -2"),
        (spiral.replace("turns = 1", "turns = -1"), "path.pieces.turns is -1"),
        (spiral.replace("turns = 1", "turns = 4"), "path.pieces.turns is 4, which leads to the centre"),
        (spiral.replace("turns = 1", "turns = 5"), "expected less than 4.000 turns"),
        (spiral.replace("turns = 1", "length = 26"), "path.pieces.length is 26, which leads to the centre"),
        (format!("{arc}\nside = \"left\"\nturns = 0.2\npitch = 1"), "an arc has a radius, a side"),
        (pieces(4097), "path.pieces has 4097 pieces, expected from 1 to 4096"),
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
        assert_eq!(timeline(&scene).end().event.kind, EventKind::PathEnd);
        let timeline = timeline(&scene);
        assert_eq!(scene.ensemble.least_clearances(&timeline, timeline.end(), &mut unreported).own, None);
    }
}
