//! Velocities keep their promise where handles cross junctions of the path: there they have kinks, which a table must
//! not smooth. The times of the kinks come from the links alone; the table's velocities are compared with newton's.

use std::cell::Cell;

use bench_dragon::motion::ensemble::Ensemble;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::linkage;
use bench_dragon::motion::model::curve::Side;
use bench_dragon::motion::model::description::{PathDescription, RouteStep};
use bench_dragon::motion::model::team::{Ends, Team};
use bench_dragon::motion::solve::newton::Newton;
use bench_dragon::motion::solve::selection;
use bench_dragon::motion::solve::{Chain, Solver, Velocities};
use bench_dragon::motion::{Method, Motion};
use bench_dragon::show::scene::Scene;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

/// Requested accuracies, metres. The second and the third are those at which tables once smoothed most.
const ACCURACIES: [f64; 11] = [1e-9, 3e-9, 1.21e-8, 3e-8, 1e-7, 3e-7, 1e-6, 1e-5, 3e-5, 1e-4, 1e-3];

/// The place of a handle, metres of travel, and its speed over the head's.
type Travel = (f64, f64);

/// Returns all handles when the head has travelled `travelled` metres; `None` past a lock.
fn handles(motion: &Motion, travelled: f64) -> Option<Vec<Travel>> {
    let (path, team) = (motion.path(), motion.team());
    let (mut front, mut speed) = (path.param_at(travelled), 1.0);
    let mut handles = vec![(travelled, speed)];
    for bench in 0..team.benches {
        let rear = linkage::follower(path, front, team.link(bench)).ok()?;
        let pose = linkage::link_pose(path, front, rear, team.link(bench));
        speed *= pose.front_cosine / pose.rear_cosine;
        handles.push((path.travelled(rear), speed));
        front = rear;
    }
    Some(handles)
}

/// Returns the metres of the head's travel at which a handle crosses a junction, at most about `most` of them.
fn kinks(motion: &Motion, end: f64, most: usize) -> Vec<f64> {
    let steps = (end / (0.25 * motion.team().shortest_link())).ceil();
    let travels = (0..=steps as usize).map(|step| end * step as f64 / steps);
    let places: Vec<(f64, Vec<Travel>)> = travels.filter_map(|at| Some((at, handles(motion, at)?))).collect();
    let mut brackets = Vec::new();
    for pair in places.windows(2) {
        let [(from, before), (to, after)] = pair else { continue };
        for junction in motion.path().junctions() {
            let crosses = |handle: &usize| (before[*handle].0 < junction) != (after[*handle].0 < junction);
            brackets.extend((0..before.len()).filter(crosses).map(|handle| (*from, *to, handle, junction)));
        }
    }
    let wanted = brackets.iter().step_by(brackets.len().div_ceil(most).max(1));
    wanted.filter_map(|&(from, to, handle, junction)| crossing(motion, from, to, handle, junction)).collect()
}

/// Returns the metres of the head's travel between two others at which a handle crosses a junction (Newton's
/// method in a bracket).
fn crossing(motion: &Motion, from: f64, to: f64, handle: usize, junction: f64) -> Option<f64> {
    let (mut low, mut high) = (from, to);
    let backward = handles(motion, low)?[handle].0 > junction;
    let mut at = 0.5 * (low + high);
    for _ in 0..60 {
        let (place, speed) = handles(motion, at)?[handle];
        if (place > junction) == backward {
            low = at
        } else {
            high = at
        }
        let newton = at - (place - junction) / speed;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - at).abs() < 1e-13 * (1.0 + at) {
            return Some(next);
        }
        at = next;
    }
    Some(at)
}

/// Tests the velocities of the table for a requested accuracy at and beside each kink. Returns the number of compared
/// handles, and the largest error as a part of the promise.
///
/// The promise: 10 accuracy / link of a handle's speed, where the position's accuracy is at least the rounding of
/// doubles. Near a lock the rounding grows with the handle's speed over the head's.
fn assert_kept(motion: &Motion, accuracy: f64, kinks: &[f64]) -> (usize, f64) {
    let (team, head_speed) = (*motion.team(), motion.head_speed());
    let velocities = Velocities::Computed;
    let Some(selection) = selection::cheapest(motion.path(), team, head_speed, velocities, accuracy, &mut unreported)
    else {
        return (0, 0.0);
    };
    let link = team.shortest_link();
    let (accuracy, mut table) = (selection.accuracy, selection.table);
    let newton = Newton::new(motion.path().clone(), team, head_speed, velocities);
    let (mut found, mut truth) = (Chain::new(team.handles()), Chain::new(team.handles()));
    let beside = [-1e-3, -1e-5, 0.0, 1e-5, 1e-3].map(|share| share * link);
    let (mut compared, mut worst) = (0, 0f64);
    for time in kinks.iter().flat_map(|kink| beside.map(|by| (kink + by) / head_speed)) {
        if !(0.0..table.valid_until()).contains(&time) || newton.solve_at(head_speed * time, &mut truth).is_err() {
            continue;
        }
        table.solve(time, &mut found).unwrap();
        for k in 0..found.handles() {
            let off = (found.vx[k] - truth.vx[k]).hypot(found.vy[k] - truth.vy[k]);
            let speed = truth.speed[k].abs().max(head_speed);
            let off = off.max((found.speed[k] - truth.speed[k]).abs()) / speed;
            let rounding = 8.0 * f64::EPSILON * (truth.x[k].hypot(truth.y[k]) + head_speed * time);
            let promise = 10.0 * accuracy.max(rounding * speed / head_speed) / link;
            let at = || format!("{accuracy:e} m at {time} s, handle {k}: {:?} {team:?}", motion.description());
            assert!(off <= promise, "{off:e} of a speed, {} times the promise: {}", off / promise, at());
            (compared, worst) = (compared + 1, worst.max(off / promise));
        }
    }
    (compared, worst)
}

#[test]
#[ignore = "tests/run --all"]
fn velocities_keep_their_promise_at_the_kinks_of_the_scenes() {
    // With a time, seconds, at which a table was once far beyond its promise.
    for (name, known) in [("turnaround", 432.109_566_744_412_75), ("procession", 105.225_319_949_667_78)] {
        let scene = Scene::load(&std::path::Path::new("config").join(format!("{name}.toml"))).unwrap();
        let motion = scene.ensemble.only().unwrap();
        let end = scene.ensemble.timeline_without_contact(&mut unreported).end().event.travelled;
        let mut kinks = kinks(motion, end, usize::MAX);
        assert!(kinks.len() > 2 * motion.team().handles(), "{name}: {} kinks", kinks.len());
        kinks.push(known * motion.head_speed());
        for accuracy in ACCURACIES {
            let (compared, worst) = assert_kept(motion, accuracy, &kinks);
            println!("{name} at {accuracy:e} m: {worst:.3} of the promise, {compared} velocities");
            assert!(compared > 100_000, "{compared}");
        }
    }
}

/// Returns turnarounds, S-bends, and routes of arcs down to a third of a link.
fn motions() -> impl Strategy<Value = Motion> {
    let team = (50usize..=223, 0.4..3.5f64, 0.4..2.0f64).prop_map(|(benches, head, body)| Team {
        benches,
        head_length: head + 0.1,
        body_length: body + 0.1,
        width: 0.1,
        hole_inset: 0.05,
        ends: Ends::NONE,
    });
    team.prop_flat_map(|team| {
        let turnaround = (0.5..3.0f64, 1.2..5.0f64, 0.2..5.0f64, 5.0..80.0f64, 20.0..200.0f64).prop_map(
            |(pitch, turns, arc_ratio, lead_in, lead_out)| {
                let turn_radius = turns * pitch;
                PathDescription::Turnaround { pitch, turn_radius, arc_ratio, lead_in, lead_out }
            },
        );
        let tight = prop_oneof![(0.35..0.7f64).prop_map(move |share| share * team.longest_link()), Just(1.5)];
        let step = (1.0..4.0f64, 0.02..0.6f64, 0..10u8);
        let route = (tight, prop::collection::vec(step, 1..10), 0.0..1.0f64, any::<bool>()).prop_map(
            |(tight, steps, heading_turns, mut left)| {
                let steps = steps.into_iter().map(|(size, turns, kind)| {
                    // Most arcs turn to the other side than the arc before.
                    left ^= kind > 4;
                    let side = if left { Side::Left } else { Side::Right };
                    match kind {
                        0..3 => RouteStep::Line { length: 4.0 * (size - 1.0) + 0.05 },
                        _ => RouteStep::Arc { side, radius: (tight * size).into(), turns: turns.into() },
                    }
                });
                PathDescription::Route { heading_turns, steps: steps.collect() }
            },
        );
        let speed = (-1.0..1.0f64).prop_map(|exponent| 10f64.powf(exponent));
        (prop_oneof![1 => turnaround, 2 => route], speed).prop_map(move |(description, head_speed)| {
            Motion::new(description, team, head_speed, Method::Accuracy(1e-9)).unwrap()
        })
    })
}

/// `BENCH_DRAGON_LONG=1` takes 1,000 motions.
#[test]
fn velocities_keep_their_promise_at_the_kinks_of_random_routes() {
    let long = crate::harness::long();
    let config = Config { cases: if long { 1000 } else { 24 }, failure_persistence: None, ..Config::default() };
    let (compared, worst) = (Cell::new(0), Cell::new(0f64));
    let accuracy = (-9.0..-3.0f64).prop_map(|exponent| 10f64.powf(exponent));
    TestRunner::new(config)
        .run(&(motions(), accuracy), |(motion, accuracy)| {
            let end = Ensemble::alone(motion.clone()).timeline_without_contact(&mut unreported).end().event.travelled;
            let kinks = kinks(&motion, end, if long { usize::MAX } else { 100 });
            let (handles, part) = assert_kept(&motion, accuracy, &kinks);
            compared.set(compared.get() + handles);
            worst.set(worst.get().max(part));
            Ok(())
        })
        .unwrap();
    println!("{} velocities, at most {:.3} of the promise", compared.get(), worst.get());
    assert!(compared.get() > 100_000, "{}", compared.get());
}
