//! The requested accuracy selects the solver. On every scene of `config/` and on random paths, each requested accuracy
//! gets a solver that keeps it. The solver is tested at times that the selection did not use, against the safe solver
//! and the reference of 38 digits. A coarser accuracy reads fewer bytes per frame; events do not depend on the
//! accuracy; the live clearance remains the clearance of all pairs.

use crate::harness;

use std::collections::BTreeSet;
use std::path::Path;

use bench_dragon::motion::clearance::least_clearance_all_pairs;
use bench_dragon::motion::ensemble::Ensemble;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::model::curve::Side;
use bench_dragon::motion::model::description::{PathDescription, RouteStep};
use bench_dragon::motion::model::team::{Ends, Team};
use bench_dragon::motion::solve::newton::Newton;
use bench_dragon::motion::solve::reference::Reference;
use bench_dragon::motion::solve::selection::{self, EXACT_LINKS, Selection};
use bench_dragon::motion::solve::table::Instructions;
use bench_dragon::motion::solve::{Chain, Solver, Velocities};
use bench_dragon::motion::{Method, Motion};
use bench_dragon::show::scene::Scene;
use harness::aloud;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

/// Requested accuracies from the finest to the coarsest, metres.
const ACCURACIES: [f64; 7] = [1e-18, 1e-12, 1e-9, 1e-7, 1e-6, 1e-4, 1e-2];

const VELOCITIES: [Velocities; 2] = [Velocities::Computed, Velocities::Omitted];

const SCENES: [&str; 7] = ["paper", "school", "tight", "wide", "turnaround", "procession", "long"];

fn scene(name: &str) -> Scene {
    Scene::load(&Path::new("config").join(format!("{name}.toml"))).unwrap()
}

fn select(motion: &Motion, accuracy: f64, velocities: Velocities) -> Option<Selection> {
    selection::cheapest(motion.path(), *motion.team(), motion.head_speed(), velocities, accuracy, &mut unreported)
}

/// Returns times up to `end` that the selection has not used. The times are `count` multiples of the golden ratio,
/// every third in the last fiftieth, and some times near the junctions.
fn other_times(motion: &Motion, end: f64, count: usize) -> Vec<f64> {
    let share = |k: usize| (k as f64 * 0.618_033_988_749_895 + 0.137).fract();
    let mut times: Vec<f64> =
        (0..count).map(|k| if k % 3 == 2 { end * (1.0 - 0.02 * share(k)) } else { end * share(k) }).collect();
    let junctions = motion.path().junctions().flat_map(|at| [-0.3, 0.011, 1.23, 3.3].map(|by| at + by));
    let junctions = junctions.map(|metres| metres / motion.head_speed()).filter(|time| (0.0..end).contains(time));
    times.extend(junctions.take(count / 2));
    times
}

/// Returns the allowed error of one handle in a frame. Near a lock, where conditioning multiplies roundings, the
/// allowance grows with the handle's speed over the head's.
fn floor(motion: &Motion, time: f64, (x, y): (f64, f64), speed: f64) -> f64 {
    let haste = (speed / motion.head_speed()).abs().max(1.0);
    8.0 * f64::EPSILON * (x.hypot(y) + motion.head_speed() * time) * haste
}

/// Compares the solver for a requested accuracy with the safe one on the stage: places, links, headings, velocities.
fn assert_kept(motion: &Motion, accuracy: f64, solver: &mut dyn Solver, times: &[f64]) {
    let team = motion.team();
    let newton = Newton::new(motion.path().clone(), *team, motion.head_speed(), Velocities::Computed);
    let (mut found, mut truth) = (Chain::new(team.handles()), Chain::new(team.handles()));
    let accuracy = accuracy.min(1e-3 * team.shortest_link());
    for &time in times {
        if newton.solve_at(motion.head_speed() * time, &mut truth).is_err() {
            continue;
        }
        motion.placement().chain(&mut truth.all_mut());
        solver.solve(time, &mut found).unwrap_or_else(|none| panic!("{accuracy:e} at {time} s: {none}"));
        let at =
            |handle: usize| format!("{accuracy:e} m at {time} s, handle {handle}: {:?} {team:?}", motion.description());
        for k in 0..found.handles() {
            let floor = floor(motion, time, (truth.x[k], truth.y[k]), truth.speed[k]);
            let error = (found.x[k] - truth.x[k]).hypot(found.y[k] - truth.y[k]);
            assert!(error <= accuracy.max(floor), "{error:e} m: {}", at(k));
            let link = team.link(k.min(team.benches - 1));
            let turn = (found.heading[k] - truth.heading[k]).abs();
            let turn = turn.min(std::f64::consts::TAU - turn);
            assert!(
                turn <= 2.0 * (accuracy / team.shortest_link()).max(1e-12 + floor / link),
                "{turn:e} rad: {}",
                at(k)
            );
            assert!(found.heading[k].abs() <= std::f64::consts::PI, "{}", at(k));
            let off = (found.vx[k] - truth.vx[k]).hypot(found.vy[k] - truth.vy[k]);
            let off = off.max((found.speed[k] - truth.speed[k]).abs()) / truth.speed[k].abs().max(motion.head_speed());
            let haste = (truth.speed[k] / motion.head_speed()).abs().max(1.0);
            assert!(off <= 10.0 * (accuracy / team.shortest_link()).max(1e-9 * haste), "{off:e} of a speed: {}", at(k));
            if k < team.benches {
                let length = (found.x[k] - found.x[k + 1]).hypot(found.y[k] - found.y[k + 1]);
                let r = truth.x[k].hypot(truth.y[k]).max(truth.x[k + 1].hypot(truth.y[k + 1]));
                let promised = 1e-12 * link + 4.0 * (r.next_up() - r);
                let allowed = if accuracy <= EXACT_LINKS { promised } else { 2.0 * accuracy };
                assert!((length - link).abs() <= allowed, "link {:e}: {}", length - link, at(k));
            }
        }
    }
}

#[test]
#[ignore = "tests/run --all"]
fn every_accuracy_is_kept_on_every_scene_and_a_coarser_one_costs_no_more() {
    for name in SCENES {
        let scene = scene(name);
        let end = scene.ensemble.timeline_without_contact(&mut unreported).end().time;
        let times =
            other_times(scene.ensemble.only().unwrap(), end, if scene.ensemble.benches() > 1000 { 12 } else { 120 });
        let mut cost = (f64::INFINITY, usize::MAX);
        for accuracy in ACCURACIES {
            let motion = scene.ensemble.only().unwrap().with_method(Method::Accuracy(accuracy)).unwrap();
            let mut choice = motion.solver(Velocities::Computed);
            println!("{name}: {}", choice.reason);
            assert_kept(&motion, accuracy, choice.solver.as_mut(), &times);
            let Some(selection) = select(&motion, accuracy, Velocities::Computed) else {
                assert!(accuracy < 1e-12, "{name} has no table for {accuracy:e} m");
                continue;
            };
            // Along thousands of links roundings add up to more than 8 eps (r + distance travelled).
            let met = selection.meets() || accuracy < 1e-12;
            assert!(met, "{name} {accuracy:e}: {:e} of {:e}", selection.error, selection.allowed);
            let bytes = (selection.table.bytes_per_handle(), selection.table.memory_bytes());
            assert!(bytes.0 <= cost.0, "{name}: {accuracy:e} m takes {bytes:?} bytes, a finer accuracy {cost:?}");
            cost = bytes;
        }
    }
}

/// Both instruction sets and the portable path, with and without velocities, from every format of a table. Each has its
/// own machine code, so each is tested.
#[test]
fn every_instruction_set_keeps_every_accuracy_against_the_reference() {
    let mut run = BTreeSet::new();
    // The first has tables of every format.
    for name in &["procession", "paper", "turnaround"][..harness::cases(1, 3, 3)] {
        let scene = scene(name);
        let motion = scene.ensemble.only().unwrap();
        let mut reference = Reference::new(*motion.team(), motion.description(), motion.head_speed()).unwrap();
        let end = scene.ensemble.timeline_without_contact(&mut unreported).end().time;
        let moments = [0.0, 0.291, 0.613, 0.987].map(|share| (share * end, reference.handles(share * end).unwrap()));
        // The other accuracies select no table in mixed precision of order 3.
        let accuracies = ACCURACIES.into_iter().chain([1e-5]);
        for (accuracy, velocities) in
            accuracies.flat_map(|accuracy| VELOCITIES.map(|velocities| (accuracy, velocities)))
        {
            let Some(Selection { table, .. }) = select(motion, accuracy, velocities) else {
                assert!(accuracy < 1e-12, "{name} has no table for {accuracy:e} m");
                continue;
            };
            for instructions in Instructions::available() {
                run.insert((instructions.name(), format!("{velocities:?}"), table.format()));
                let mut solver = table.clone().with_instructions(instructions).unwrap();
                let mut chain = Chain::new(motion.team().handles());
                for (time, truth) in &moments {
                    solver.solve(*time, &mut chain).unwrap();
                    for (k, truth) in truth.iter().enumerate() {
                        let error = truth.x.error_of(chain.x[k]).hypot(truth.y.error_of(chain.y[k]));
                        // On a turnaround the place of the start is itself rounded several times.
                        let floor = floor(motion, *time, (chain.x[k], chain.y[k]), truth.speed).max(1e-13);
                        let at = || {
                            format!("{name} {} {accuracy:e} {velocities:?} at {time}, handle {k}", instructions.name())
                        };
                        assert!(error <= accuracy.max(floor), "{}: {error:e} m", at());
                        if velocities == Velocities::Computed {
                            let off = (chain.speed[k] - truth.speed).abs() / truth.speed.abs().max(motion.head_speed());
                            let haste = (truth.speed / motion.head_speed()).abs().max(1.0);
                            let allowed = 10.0 * (accuracy / motion.team().shortest_link()).max(1e-9 * haste);
                            assert!(off <= allowed, "{}: {off:e} of a speed", at());
                        }
                    }
                }
            }
        }
    }
    let formats = run.iter().map(|(.., format)| format).collect::<BTreeSet<_>>().len();
    assert_eq!((formats, run.len()), (4, formats * VELOCITIES.len() * Instructions::available().len()), "{run:?}");
}

/// Reports the instruction sets on which the tests of the solvers run, from the kernel's list of this processor: no
/// available set is left out.
#[test]
fn every_instruction_set_of_this_processor_is_tested() {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap();
    let flags = text.lines().find(|line| line.starts_with("flags") || line.starts_with("Features")).unwrap_or_default();
    let flags: BTreeSet<&str> = flags.split_whitespace().collect();
    let sets: [(_, &[&str]); 3] = [
        (Instructions::Avx512, &["avx512f", "avx512dq", "avx512vl", "avx2", "fma"]),
        (Instructions::Avx2, &["avx2", "fma"]),
        (Instructions::Portable, &[]),
    ];
    for (set, needed) in sets {
        let missing: Vec<&str> = needed.iter().copied().filter(|flag| !flags.contains(flag)).collect();
        let (name, is_there) = (set.name(), missing.is_empty());
        assert_eq!(Instructions::available().contains(&set), is_there, "{name}: {missing:?} missing");
        let what = if is_there { "tested".to_owned() } else { format!("NOT RUN: no {}", missing.join(", ")) };
        aloud(&format!("instruction set {name}: {what}"));
    }
}

/// The same accuracy gives the same format and the same bits; frames do not depend on earlier frames.
#[test]
fn the_choice_is_the_same_every_time() {
    for name in ["paper", "procession"] {
        let scene = scene(name);
        let motion = scene.ensemble.only().unwrap();
        for accuracy in ACCURACIES {
            let [one, other] = [(), ()].map(|()| select(motion, accuracy, Velocities::Computed));
            assert_eq!(one.is_some(), other.is_some());
            let Some((mut one, mut other)) = one.zip(other) else {
                assert!(accuracy < 1e-12, "{name} has no table for {accuracy:e} m");
                continue;
            };
            assert_eq!(one.table.format(), other.table.format());
            assert_eq!((one.error, one.allowed, one.test_points), (other.error, other.allowed, other.test_points));
            let [mut first, mut second] = [(), ()].map(|()| Chain::new(motion.team().handles()));
            other.table.solve(1.0, &mut second).unwrap();
            for time in [0.0, 33.3, 150.0] {
                one.table.solve(time, &mut first).unwrap();
                other.table.solve(time, &mut second).unwrap();
                assert_eq!(first, second, "{name} {accuracy:e} at {time} s");
            }
        }
    }
}

#[test]
fn events_do_not_depend_on_the_accuracy() {
    for name in ["school", "procession"] {
        let scene = scene(name);
        let timeline = |accuracy| {
            let ensemble = scene.ensemble.try_map(|motion| motion.with_method(Method::Accuracy(accuracy)));
            ensemble.unwrap().timeline(&mut unreported)
        };
        assert_eq!(timeline(1e-2), timeline(1e-18), "{name}");
    }
}

/// The live clearance of a coarse chain is the clearance of all its pairs, to the last bit.
#[test]
#[ignore = "computes for long: tests/run --all"]
fn the_live_clearance_is_that_of_the_frame() {
    for name in ["paper", "turnaround", "procession", "school"] {
        let scene = scene(name);
        let end = scene.ensemble.timeline_without_contact(&mut unreported).end().time;
        for accuracy in [1e-2, 1e-4, 1e-6] {
            let motion = scene.ensemble.only().unwrap().with_method(Method::Accuracy(accuracy)).unwrap();
            let mut choice = motion.solver(Velocities::Omitted);
            let mut monitor = motion.clearance_monitor(&choice);
            let mut chain = Chain::new(motion.team().handles());
            for run in 0..12 {
                for frame in 0..8 {
                    let time = (0.083 * end * f64::from(run) + f64::from(frame) / 60.0).min(0.9999 * end);
                    choice.solver.solve(time, &mut chain).unwrap();
                    let live = monitor.nearest(&chain, time, f64::INFINITY, choice.solver.as_mut()).boards;
                    assert_eq!(
                        live,
                        least_clearance_all_pairs(&chain, motion.team()),
                        "{name} {accuracy:e} at {time} s"
                    );
                }
            }
            let counters = monitor.counters();
            println!("{name} {accuracy:e}: {counters:?}");
        }
    }
}

/// Returns numbers between two others, evenly by magnitude.
fn magnitude(least: f64, most: f64) -> impl Strategy<Value = f64> {
    (least.log10()..most.log10()).prop_map(|exponent| 10f64.powf(exponent))
}

/// Returns spirals, turnarounds and routes with teams of any size of link.
fn motions() -> impl Strategy<Value = Motion> {
    let spiral = (0.2..3.0f64, 1.0..60.0f64).prop_map(|(ratio, turns)| {
        let (pitch, start_turn) = (1.0 / ratio, 1.0 + turns + ratio);
        PathDescription::Spiral { pitch, start_turn }
    });
    let step = (0.6..8.0f64, 0.05..0.6f64, any::<bool>(), any::<bool>());
    let route = prop::collection::vec(step, 1..8).prop_map(|steps| {
        let steps = steps.into_iter().map(|(size, turns, left, line)| {
            let side = if left { Side::Left } else { Side::Right };
            if line {
                RouteStep::Line { length: 2.0 * size }
            } else {
                RouteStep::Arc { side, radius: size.into(), turns: turns.into() }
            }
        });
        PathDescription::Route { heading_turns: 0.17, steps: steps.collect() }
    });
    let turnaround = (0.4..3.0f64, 1.5..6.0f64, 0.2..5.0f64).prop_map(|(pitch, turns, arc_ratio)| {
        let turn_radius = pitch * turns;
        PathDescription::Turnaround { pitch, turn_radius, arc_ratio, lead_in: 30.0, lead_out: 40.0 }
    });
    let size = (2usize..60, 0.3..2.0f64, 0.3..1.0f64, magnitude(1e-3, 1e3));
    (prop_oneof![spiral, route, turnaround], size).prop_map(|(description, (benches, head, body, speed))| {
        let team = Team {
            benches,
            head_length: head + 0.1,
            body_length: body + 0.1,
            width: 0.1,
            hole_inset: 0.05,
            ends: Ends::NONE,
        };
        Motion::new(description, team, speed, Method::Accuracy(1e-9)).unwrap()
    })
}

#[test]
fn random_paths_keep_every_accuracy() {
    let cases = harness::cases(6, 60, 60);
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let tables = std::cell::Cell::new(0);
    TestRunner::new(config)
        .run(&motions(), |motion| {
            let end = Ensemble::alone(motion.clone()).timeline_without_contact(&mut unreported).end().time;
            if end > 0.0 {
                let times = other_times(&motion, end, 30);
                for accuracy in [1e-9, 1e-6, 1e-4, 1e-2] {
                    if let Some(mut selection) = select(&motion, accuracy, Velocities::Computed) {
                        assert_kept(&motion, accuracy, &mut selection.table, &times);
                        tables.set(tables.get() + 1);
                    }
                }
            }
            Ok(())
        })
        .unwrap();
    println!("{} tables", tables.get());
    assert!(tables.get() > 2 * cases, "{} tables", tables.get());
}
