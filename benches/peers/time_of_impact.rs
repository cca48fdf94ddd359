//! parry2d's times of impact beside the exact search: the contact of the paper's scene, by steps between two poses of
//! the live solver. As parry's casts require, every board keeps its velocity and its angular velocity within a step.
//!
//! `cargo bench --bench time_of_impact`

use std::time::{Duration, Instant};

use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::clearance::board;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::solve::{Chain, Solver};
use bench_dragon::show::scene::Scene;
use parry2d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry2d_f64::math::Pose;
use parry2d_f64::query::{NonlinearRigidMotion, ShapeCastOptions, cast_shapes, cast_shapes_nonlinear};
use parry2d_f64::shape::{Cuboid, Shape};

/// Length of a step, and the start of the search, both in simulated seconds: the shortest steps begin late.
const STEPS: [(f64, f64); 4] = [(1.0, 0.0), (0.1, 0.0), (0.01, 400.0), (0.001, 412.0)];
/// Metres by which the box around a board at both ends of a step is widened, for the area that a turn sweeps in
/// between.
const SWEEP: f64 = 0.1;
/// Number of exact searches: the fastest counts.
const SEARCHES: usize = 20;

#[derive(Clone, Copy)]
enum Cast {
    /// Without rotation.
    Linear,
    /// With a constant angular velocity.
    Nonlinear,
}

/// The result of a search, and its cost.
struct Found {
    time: f64,
    pair: (usize, usize),
    steps: u32,
    casts: u64,
    took: Duration,
}

/// A board during a step.
struct Moving {
    shape: Cuboid,
    motion: NonlinearRigidMotion,
    swept: Aabb,
}

/// Returns every board's pose in a chain.
fn poses(chain: &Chain, scene: &Scene) -> Vec<(Pose, Cuboid)> {
    let pose = |bench| {
        let board = board(chain, scene.ensemble.only().unwrap().team(), bench);
        let angle = board.axis.y.atan2(board.axis.x);
        let half_extents = [board.half_length, board.half_width];
        (Pose::new([board.centre.x, board.centre.y].into(), angle), Cuboid::new(half_extents.into()))
    };
    (0..scene.ensemble.benches()).map(pose).collect()
}

/// Returns the boards between two lists of poses.
fn moving(from: &[(Pose, Cuboid)], to: &[(Pose, Cuboid)], step: f64) -> Vec<Moving> {
    let one = |(&(start, shape), (end, _)): (&(Pose, Cuboid), &(Pose, Cuboid))| {
        let velocity = (end.translation - start.translation) / step;
        let turn = start.rotation.inverse() * end.rotation;
        let motion = NonlinearRigidMotion::new(start, [0.0, 0.0].into(), velocity, turn.angle() / step);
        let swept = shape.compute_aabb(&start).merged(&shape.compute_aabb(end)).loosened(SWEEP);
        Moving { shape, motion, swept }
    };
    from.iter().zip(to).map(one).collect()
}

/// Returns the time at which two boards first touch within a step, seconds after its beginning.
fn impact(one: &Moving, other: &Moving, step: f64, cast: Cast) -> Option<f64> {
    let hit = match cast {
        Cast::Linear => {
            let options = ShapeCastOptions::with_max_time_of_impact(step);
            let (a, b) = (&one.motion, &other.motion);
            cast_shapes(&a.start, a.linvel, &one.shape, &b.start, b.linvel, &other.shape, options)
        }
        Cast::Nonlinear => cast_shapes_nonlinear(&one.motion, &one.shape, &other.motion, &other.shape, 0.0, step, true),
    };
    hit.expect("parry knows two cuboids").map(|hit| hit.time_of_impact)
}

/// Finds the first contact by steps.
fn search(scene: &Scene, (step, from): (f64, f64), cast: Cast) -> Found {
    let mut solver: Box<dyn Solver> = scene.ensemble.only().unwrap().solver(scene.velocities).solver;
    let mut chain = Chain::new(scene.ensemble.handles());
    let mut at = |time: f64| {
        solver.solve(time, &mut chain).expect("the motion continues well past the contact");
        poses(&chain, scene)
    };
    let began = Instant::now();
    let (mut steps, mut casts) = (0, 0);
    let mut here = at(from);
    loop {
        let time = from + f64::from(steps) * step;
        let next = at(time + step);
        let boards = moving(&here, &next, step);
        let mut first: Option<(f64, (usize, usize))> = None;
        for (a, one) in boards.iter().enumerate() {
            for (b, other) in boards.iter().enumerate().skip(a + 2) {
                if !one.swept.intersects(&other.swept) {
                    continue;
                }
                casts += 1;
                let earlier = |after: &f64| first.is_none_or(|(earliest, _)| *after < earliest);
                if let Some(after) = impact(one, other, step, cast).filter(earlier) {
                    first = Some((after, (a, b)));
                }
            }
        }
        steps += 1;
        if let Some((after, pair)) = first {
            return Found { time: time + after, pair, steps, casts, took: began.elapsed() };
        }
        here = next;
    }
}

fn main() {
    let scene = Scene::paper();
    let searches = (0..SEARCHES).map(|_| {
        let began = Instant::now();
        let timeline = scene.ensemble.timeline(&mut unreported);
        (began.elapsed(), timeline)
    });
    let (exact, timeline) = searches.min_by_key(|(took, _)| *took).expect("there is at least one");
    let contact = timeline.find(EventKind::Contact).expect("the paper's scene has one").time;
    println!("exact search of contact, stall and lock: {contact:.10} s, in {:.1} ms", 1e3 * exact.as_secs_f64());
    println!(
        "| cast | step | contact | error | benches | casts a step | from the start |\n|---|---|---|---|---|---|---|"
    );
    for (name, cast) in [("cast_shapes", Cast::Linear), ("cast_shapes_nonlinear", Cast::Nonlinear)] {
        for (step, from) in STEPS {
            let found = search(&scene, (step, from), cast);
            let all = found.took / found.steps * (found.time / step).ceil() as u32;
            println!(
                "| `{name}` | {step} s | {:.9} s | {:+.1e} s | {:?} | {} | {:.1} s, {:.0} times the exact search |",
                found.time,
                found.time - contact,
                found.pair,
                found.casts / u64::from(found.steps),
                all.as_secs_f64(),
                all.as_secs_f64() / exact.as_secs_f64(),
            );
        }
    }
}
