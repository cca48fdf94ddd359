//! The table, exact and in every format, against the safe solver.

use std::ops::ControlFlow;

use super::*;
use crate::event::unreported;
use crate::model::curve::Side;
use crate::model::path::Route;
use crate::solve::Chain;

const TEAM: Team =
    Team { benches: 60, head_length: 3.41, body_length: 2.2, width: 0.3, hole_inset: 0.275, ends: Ends::NONE };

fn paths() -> [Path; 3] {
    let route = Path::route(0.0).line(40.0).arc(Side::Left, 6.0, 0.25).line(12.0);
    let route = route.arc(Side::Right, 5.0, 0.5).line(10.0).arc(Side::Left, 5.0, 0.5).line(120.0);
    let turnaround = Path::turnaround(1.7, 4.5, 2.0, 100.0, 100.0).unwrap();
    [Path::spiral(0.55, 16.0), turnaround, route.build().unwrap()]
}

fn with_tolerance(path: &Path, team: Team, tolerance: Tolerance) -> FollowerTable {
    let mut ask = unreported;
    let budget = &mut Budget::new(u64::MAX, &mut ask);
    FollowerTable::with_tolerance(path, team, 1.0, Velocities::Computed, tolerance, budget).unwrap()
}

fn packed(table: &FollowerTable, format: Format, allowed: Allowed) -> Option<FollowerTable> {
    table.packed(format, allowed, &mut Budget::new(u64::MAX, &mut unreported))
}

/// Returns the largest differences of place, metres, of heading and of speed, relative to the head's or the handle's
/// own.
fn differences(one: &Chain, other: &Chain) -> [f64; 3] {
    let mut most = [0.0; 3];
    for i in 0..one.handles() {
        let turn = (one.heading[i] - other.heading[i]).abs();
        let rates = (one.vx[i] - other.vx[i]).hypot(one.vy[i] - other.vy[i]).max((one.speed[i] - other.speed[i]).abs());
        let place = (one.x[i] - other.x[i]).hypot(one.y[i] - other.y[i]);
        let turn = turn.min((turn - std::f64::consts::TAU).abs());
        for (most, now) in most.iter_mut().zip([place, turn, rates / other.speed[i].abs().max(1.0)]) {
            *most = now.max(*most);
        }
    }
    most
}

#[test]
fn the_table_agrees_with_the_safe_solver_on_every_code_path_and_across_junctions() {
    for path in paths() {
        let newton = Newton::new(path.clone(), TEAM, 1.0, Velocities::Computed);
        let table = FollowerTable::new(&path, TEAM, 1.0, Velocities::Computed, &mut unreported).unwrap();
        let end = table.valid_until();
        assert!(end > 200.0, "{end}");
        let around = |junction: f64| [-1e-3, -1e-9, 0.0, 1e-9, 1e-3].map(|by| junction + by);
        let regular = (0..=200).map(|k| end * f64::from(k) / 200.0);
        let times: Vec<f64> = path.junctions().flat_map(around).chain(regular).collect();
        for instructions in Instructions::available() {
            let mut table = table.clone().with_instructions(instructions).unwrap();
            let (mut found, mut wanted) = (Chain::new(TEAM.handles()), Chain::new(TEAM.handles()));
            for time in times.iter().copied().filter(|time| (0.0..=end).contains(time)) {
                table.solve(time, &mut found).unwrap();
                newton.solve_at(time, &mut wanted).unwrap();
                let [place, heading, speed] = differences(&found, &wanted);
                // Both solvers may have the error that the travel's rounding causes in the chain.
                let allowed = 2.0 * 1e-13f64.max(8.0 * f64::EPSILON * time);
                let name = instructions.name();
                assert!(
                    place < allowed && heading < 1e-12 && speed < 2e-12,
                    "{name} {time}: {place:e} {heading:e} {speed:e}"
                );
            }
            assert_eq!(table.fallbacks(), 0);
        }
    }
}

#[test]
fn a_frame_does_not_depend_on_the_ones_before_and_past_the_table_the_safe_solver_works() {
    let path = &paths()[0];
    let mut table = FollowerTable::new(path, TEAM, 1.0, Velocities::Omitted, &mut unreported).unwrap();
    let [mut first, mut again] = [Chain::new(TEAM.handles()), Chain::new(TEAM.handles())];
    table.solve(123.4, &mut first).unwrap();
    assert_eq!(table.solve(440.0, &mut again), Err(NoFollower));
    assert_eq!(table.fallbacks(), 1);
    table.solve(123.4, &mut again).unwrap();
    assert_eq!((first.x, first.y, first.heading), (again.x, again.y, again.heading));
}

#[test]
fn a_tail_of_its_own_length_is_as_exact_in_every_format() {
    for tail_length in [0.9, 4.1] {
        let team = Team { ends: Ends { tail_length: Some(tail_length), ..Ends::NONE }, ..TEAM };
        for path in paths() {
            let newton = Newton::new(path.clone(), team, 1.0, Velocities::Computed);
            let exact = FollowerTable::new(&path, team, 1.0, Velocities::Computed, &mut unreported).unwrap();
            let allowed = Allowed { place: 1e-4, heading: 1e-4, speed: 1e-3 };
            let packed =
                FollowerTable::formats().into_iter().find_map(|format| packed(&exact, format, allowed)).unwrap();
            for (mut table, most) in [(exact.for_frames(), 1e-13), (packed.for_frames(), 1e-3)] {
                let (mut found, mut wanted) = (Chain::new(team.handles()), Chain::new(team.handles()));
                for time in (0..=200).map(f64::from) {
                    table.solve(time, &mut found).unwrap();
                    newton.solve_at(time, &mut wanted).unwrap();
                    let [place, heading, speed] = differences(&found, &wanted);
                    let allowed = 2.0 * f64::max(most, 8.0 * f64::EPSILON * time);
                    assert!(place < allowed && heading < 10.0 * allowed && speed < 10.0 * allowed.max(1e-12));
                }
                assert_eq!(table.fallbacks(), 0);
            }
        }
    }
}

#[test]
fn a_coarser_table_and_its_packed_formats_are_as_exact_as_requested() {
    let accuracy = 1e-4;
    let tolerance = Tolerance { place: 1e-6, relative: f64::INFINITY, speed: 1e-5 };
    let allowed = Allowed { place: accuracy, heading: accuracy, speed: 10.0 * accuracy };
    for path in paths() {
        let newton = Newton::new(path.clone(), TEAM, 1.0, Velocities::Computed);
        let table = with_tolerance(&path, TEAM, tolerance);
        assert_eq!(table.relative_cost(), 1.0);
        let packed = FollowerTable::formats().into_iter().map(|format| packed(&table, format, allowed).unwrap());
        let mut cost = 0.0;
        for packed in packed.chain([table.clone()]) {
            assert!(packed.bytes_per_handle() > cost, "the cheapest first");
            cost = packed.bytes_per_handle();
            for instructions in Instructions::available() {
                let mut solver = packed.for_frames().with_instructions(instructions).unwrap();
                let (mut found, mut wanted) = (Chain::new(TEAM.handles()), Chain::new(TEAM.handles()));
                for k in 0..=200 {
                    let time = f64::from(k);
                    solver.solve(time, &mut found).unwrap();
                    newton.solve_at(time, &mut wanted).unwrap();
                    let [place, heading, speed] = differences(&found, &wanted);
                    let most = accuracy + 4.0 * tolerance.place;
                    assert!(
                        place < most && heading < most && speed < 11.0 * accuracy,
                        "{} {time}: {place:e} {heading:e} {speed:e}",
                        solver.format()
                    );
                }
            }
        }
    }
}

#[test]
fn what_cannot_be_packed_is_refused() {
    let table = FollowerTable::new(&paths()[0], TEAM, 1.0, Velocities::Computed, &mut unreported).unwrap();
    let allowed = Allowed { place: 1e-9, heading: 1e-9, speed: 1e-7 };
    assert!(FollowerTable::formats().into_iter().all(|format| packed(&table, format, allowed).is_none()));
}

/// A case so small that miri runs it too (`tests/run`), on each instruction set. The calls of code that needs an
/// instruction set are the library's only unsafe code.
#[test]
fn a_small_table_is_read_as_exactly() {
    let path = Path::route(0.0).line(2.0).arc(Side::Left, 3.0, 0.1).line(2.0).build().unwrap();
    let team = Team { benches: 2, ..TEAM };
    let newton = Newton::new(path.clone(), team, 1.0, Velocities::Computed);
    let tolerance = Tolerance { place: 1e-3, relative: f64::INFINITY, speed: 1e-2 };
    let table = with_tolerance(&path, team, tolerance);
    let allowed = Allowed { place: 1e-2, heading: 1e-2, speed: 1e-1 };
    let packed = FollowerTable::formats().into_iter().filter_map(|format| packed(&table, format, allowed));
    let tables: Vec<FollowerTable> = packed.chain([table.clone()]).collect();
    for instructions in Instructions::available() {
        for (table, velocities) in tables.iter().zip([Velocities::Computed, Velocities::Omitted].into_iter().cycle()) {
            let mut table = FollowerTable { velocities, instructions, ..table.clone() };
            let (mut found, mut wanted) = (Chain::new(team.handles()), Chain::new(team.handles()));
            table.solve(1.5, &mut found).unwrap();
            newton.solve_at(1.5, &mut wanted).unwrap();
            let [place, heading, _] = differences(&found, &wanted);
            assert!(place < 2e-2 && heading < 2e-2, "{}: {place:e} {heading:e}", instructions.name());
        }
    }
    // For miri's log.
    println!("{:?}, {} tables", Instructions::available(), tables.len());
}

#[test]
fn a_route_of_thousands_of_bends_has_a_table_for_its_beginning() {
    let bends = |route: Route, _| route.arc(Side::Left, 6.0, 0.11).arc(Side::Right, 5.0, 0.13);
    let path = (0..2048).fold(Path::route(0.0), bends).build().unwrap();
    let newton = Newton::new(path.clone(), TEAM, 1.0, Velocities::Computed);
    let mut table = FollowerTable::new(&path, TEAM, 1.0, Velocities::Computed, &mut unreported).unwrap();
    let end = table.valid_until();
    assert!(end > 200.0 && end < 0.9 * path.length() && table.memory_bytes() < 200 << 20, "{end}");
    let (mut found, mut wanted) = (Chain::new(TEAM.handles()), Chain::new(TEAM.handles()));
    for k in 0..=100 {
        let time = end * f64::from(k) / 100.0;
        table.solve(time, &mut found).unwrap();
        newton.solve_at(time, &mut wanted).unwrap();
        let [place, heading, _] = differences(&found, &wanted);
        assert!(
            place < 2.0 * 1e-13f64.max(8.0 * f64::EPSILON * time) && heading < 1e-11,
            "{time}: {place:e} {heading:e}"
        );
    }
    assert_eq!(table.fallbacks(), 0);
}

#[test]
fn a_large_table_that_is_given_up_is_none_and_asks_often() {
    let path = Path::spiral(0.55, 16.0);
    let made = |benches: usize, most: usize| {
        let mut calls = 0;
        let mut ask = |_| {
            calls += 1;
            if calls > most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let team = Team { benches, ..TEAM };
        let table = FollowerTable::new(&path, team, 1.0, Velocities::Computed, &mut ask);
        (table, calls)
    };
    let ([small, large], [(one, few), (other, many)]) = ([2_000, 20_000], [2_000, 20_000].map(|n| made(n, usize::MAX)));
    assert!(one.is_some() && other.is_some());
    // A call for every 2,000 links, of which each row has more than 20: less than a millisecond.
    assert!(few > small / 100 && many > large / 100, "{few} and {many} calls");
    assert_eq!(made(large, 0).1, 1, "one answer ends it");
    for most in [1, 20, 50, 100] {
        let (table, calls) = made(large, most);
        assert!(table.is_none() && calls == most + 1, "{calls} of {many}, stopped after {most}");
    }
}
