//! The live method against all pairs, and every bound of the table against the true distance.

use std::cell::Cell;

use super::bounds::{BLOCK, BoundTable};
use super::lists::Neighbour;
use super::*;
use crate::model::Vector;
use crate::model::curve::Side;
use crate::model::description::PathDescription;
use crate::model::path::tests::any_path;
use crate::placement::Placement;
use crate::solve::newton::Newton;
use crate::solve::paper::PaperRules;
use crate::solve::{Solver, Velocities};
use crate::{Method, Motion};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

fn team(benches: usize, width: f64) -> Team {
    Team { benches, head_length: 3.41, body_length: 2.2, width, hole_inset: 0.275 }
}

fn bound_table(path: &Path, team: &Team) -> Option<BoundTable> {
    BoundTable::new(path, team, &FollowerTable::new(path, *team, 1.0, Velocities::Omitted)?)
}

/// Returns a monitor with the table of the motion, if there is one.
fn with_table(path: &Path, team: Team) -> ClearanceMonitor {
    let table = FollowerTable::new(path, team, 1.0, Velocities::Omitted);
    table.map_or_else(|| ClearanceMonitor::without_table(team, 0.0), |table| ClearanceMonitor::new(path, team, &table))
}

/// Compares monitors with and without a table with all pairs, frame by frame, for all chains. Returns the number of
/// frames and the work of the first monitor.
fn agree(team: Team, path: &Path, travels: &[f64]) -> (usize, ClearanceCounters) {
    let solver = Newton::new(path.clone(), team, 1.0, Velocities::Omitted);
    let mut chain = Chain::new(team.handles());
    let mut monitors = [with_table(path, team), ClearanceMonitor::without_table(team, 0.0)];
    let mut compared = 0;
    for &travelled in travels {
        if solver.solve_at(travelled, &mut chain).is_err() {
            continue;
        }
        let truth = least_clearance_all_pairs(&chain, &team);
        for monitor in &mut monitors {
            assert_eq!(monitor.least_clearance(&chain, travelled), truth, "{team:?} {path:?} {travelled}");
        }
        compared += 1;
    }
    (compared, monitors[0].counters())
}

/// Consecutive frames at several places of the show, and the jumps between them.
fn runs(length: f64, frames: usize) -> Vec<f64> {
    let places = [0.0, 0.3, 0.6, 0.93, 0.1, 0.98, 0.0, 0.85];
    let run = |place: f64| (0..frames).map(move |k| place * length + k as f64 / 60.0);
    places.into_iter().flat_map(run).collect()
}

/// In, round a corner and through two bends: `config/procession.toml`.
fn procession() -> Path {
    let corner = Path::route(0.0).line(40.0).arc(Side::Left, 6.0, 0.25).line(12.0);
    let bends = corner.arc(Side::Right, 5.0, 0.5).line(10.0).arc(Side::Left, 5.0, 0.5).line(120.0);
    bends.build().unwrap()
}

#[test]
fn the_same_as_all_pairs_on_the_known_scenes() {
    for (team, path) in [
        (team(223, 0.3), Path::spiral(0.55, 16.0)),
        (team(223, 0.3), Path::spiral(0.45, 16.0)),
        (team(223, 0.3), Path::spiral(1.7, 12.0)),
        (team(20, 0.3), Path::spiral(0.55, 16.0)),
        // Wider than the pitch, and links shorter than the inset.
        (team(60, 0.7), Path::spiral(0.55, 16.0)),
        (Team { head_length: 1.0, body_length: 0.7, ..team(80, 0.3) }, Path::spiral(0.55, 10.0)),
        // Body links longer than the head's.
        (Team { head_length: 2.2, body_length: 3.41, ..team(100, 0.3) }, Path::spiral(0.55, 16.0)),
        (team(223, 0.3), Path::turnaround(1.7, 4.5, 2.0, 100.0, 369.16).unwrap()),
        (team(60, 0.3), procession()),
    ] {
        let (compared, counters) = agree(team, &path, &runs(path.length(), 20));
        assert!(compared >= 60, "{team:?}: {compared}");
        assert_eq!(counters.frames as usize, compared);
    }
}

/// The handle behind the head is pushed out again to its earlier place, while the head is elsewhere.
#[test]
fn the_same_as_all_pairs_past_a_stall() {
    let four = Team { benches: 4, head_length: 9.5, body_length: 6.5, width: 2.7, hole_inset: 1.1 };
    let fourteen = Team { benches: 14, head_length: 8.9, body_length: 7.7, width: 1.4, hole_inset: 0.8 };
    for team in [four, fourteen] {
        let (compared, _) = agree(team, &Path::spiral(8.0, 2.5), &[158.2, 158.22, 158.24, 158.26]);
        assert_eq!(compared, 4);
    }
}

/// A coarse bisection gives links errors of centimetres, and more from handle to handle.
#[test]
fn the_same_as_all_pairs_where_links_are_off() {
    let team = team(223, 0.3);
    let rules = PaperRules { bisection_tolerance: 2e-3, ..PaperRules::default() };
    let path = PathDescription::Spiral { pitch: 0.55, start_turn: 16.0 };
    let motion = Motion::new(path, team, 1.0, Method::Paper(rules)).unwrap();
    let mut choice = motion.solver(Velocities::Omitted);
    let mut monitor = motion.clearance_monitor(&choice);
    let mut chain = Chain::new(team.handles());
    let mut most_off: f64 = 0.0;
    for frame in 0..600 {
        let time = 395.0 + f64::from(frame) / 60.0;
        choice.solver.solve(time, &mut chain).unwrap();
        let lengths = (1..team.benches).map(|i| (chain.x[i] - chain.x[i + 1]).hypot(chain.y[i] - chain.y[i + 1]));
        most_off = lengths.fold(most_off, |most, length| most.max((length - team.link(1)).abs()));
        assert_eq!(monitor.least_clearance(&chain, f64::NAN), least_clearance_all_pairs(&chain, &team), "{time}");
    }
    assert!(most_off > 1e-3 && most_off <= motion.link_error(), "{most_off} m");
}

/// The closest points are on the boards' outlines and as far apart as the clearance.
#[test]
fn the_closest_points_are_the_clearance_apart() {
    let team = team(223, 0.3);
    let mut chain = Chain::new(team.handles());
    let solver = Newton::new(Path::spiral(0.55, 16.0), team, 1.0, Velocities::Omitted);
    for travelled in [0.0, 300.0, 412.0, 412.48] {
        solver.solve_at(travelled, &mut chain).unwrap();
        let least = least_clearance_all_pairs(&chain, &team).unwrap();
        assert!(((least.point_a - least.point_b).norm() - least.value.abs()).abs() < 1e-13);
    }
}

/// The paper scene: the boards of benches 0 and 8 touch when the head has travelled 412.473837682115 m.
#[test]
fn the_paper_scene_touches_where_it_should() {
    let (team, path) = (team(223, 0.3), Path::spiral(0.55, 16.0));
    let mut chain = Chain::new(team.handles());
    let mut monitor = with_table(&path, team);
    let solver = Newton::new(path, team, 1.0, Velocities::Omitted);
    let mut at = |travelled: f64| {
        solver.solve_at(travelled, &mut chain).unwrap();
        monitor.least_clearance(&chain, travelled).unwrap()
    };
    let (before, after) = (at(412.473837682115 - 1e-9), at(412.473837682115 + 1e-9));
    assert!(before.value > 0.0 && after.value < 0.0, "{before:?} {after:?}");
    assert_eq!((after.bench_a, after.bench_b), (0, 8));
}

#[test]
fn few_pairs_are_tested() {
    let everywhere = (0..412).map(f64::from).collect::<Vec<_>>();
    let run = |from: f64| (0..200).map(|k| from + f64::from(k) / 60.0).collect::<Vec<_>>();
    let turnaround = || Path::turnaround(1.7, 4.5, 2.0, 100.0, 369.16).unwrap();
    for (team, path, travels, most) in [
        (team(223, 0.3), Path::spiral(0.55, 16.0), runs(400.0, 20), 3.0),
        // In a fifth of this show every pair of neighbours on two turns is nearly as near as the nearest.
        (team(223, 0.3), Path::spiral(0.55, 16.0), everywhere, 3.0),
        (team(223, 0.3), turnaround(), run(100.0), 3.0),
        (team(223, 0.3), turnaround(), run(400.0), 3.0),
        (team(60, 0.3), procession(), run(60.0), 5.0),
        // On a straight line all neighbours are equally near.
        (team(60, 0.3), procession(), run(10.0), 58.0),
    ] {
        let (compared, counters) = agree(team, &path, &travels);
        assert_eq!(compared, travels.len());
        assert!(counters.pairs as f64 <= most * compared as f64, "{counters:?}");
        assert!(counters.searches == 0, "{counters:?}: the table did not serve");
    }
}

#[test]
fn too_few_benches_have_no_clearance() {
    for benches in [1, 2] {
        let team = team(benches, 0.3);
        for mut monitor in [with_table(&procession(), team), ClearanceMonitor::without_table(team, 0.0)] {
            assert_eq!(monitor.least_clearance(&Chain::new(team.handles()), 0.0), None);
        }
    }
}

/// Returns the chain of dragons on one path, each turned by a share of a turn and at its own travel.
fn chain_of(path: &Path, teams: &[Team], travels: &[f64], turns: &[f64]) -> Option<Chain> {
    let mut all = Chain::new(teams.iter().map(Team::handles).sum());
    let mut first = 0;
    for ((team, travelled), turns) in teams.iter().zip(travels).zip(turns) {
        let mut whole = all.all_mut();
        let mut own = whole.range_mut(first..first + team.handles());
        Newton::new(path.clone(), *team, 1.0, Velocities::Omitted).solve_in(*travelled, &mut own).ok()?;
        Placement::new(Vector::zeros(), *turns, false).chain(&mut own);
        first += team.handles();
    }
    Some(all)
}

/// Dragons that coil side by side at 60 Hz, then one that is faster, then jumps.
#[test]
fn between_dragons_the_same_as_all_pairs() {
    let path = Path::spiral(1.7, 8.0);
    for teams in [vec![team(60, 0.3), team(45, 0.3)], vec![team(20, 0.1), team(30, 1.2), team(25, 0.3)]] {
        let turns: Vec<f64> = (0..teams.len()).map(|k| k as f64 / teams.len() as f64).collect();
        let mut monitor = BetweenMonitor::new(&teams, 1e-9);
        let slow = (0..300).map(|k| (100.0 + f64::from(k) / 60.0, 1.0));
        let fast = (0..200).map(|k| (100.0 + f64::from(k) / 60.0, 1.7));
        let jumps = (0..40).map(|k| (f64::from(k * 37 % 200), 1.0));
        for (travelled, factor) in slow.chain(fast).chain(jumps) {
            let travels: Vec<f64> = (0..teams.len()).map(|k| travelled * if k == 1 { factor } else { 1.0 }).collect();
            let Some(chain) = chain_of(&path, &teams, &travels, &turns) else { continue };
            let truth = nearest_between_all_pairs(&chain, &teams);
            assert_eq!(monitor.search(&chain, f64::INFINITY), truth, "{travelled} {factor}");
        }
    }
}

#[test]
fn of_dragons_side_by_side_few_boards_are_tested() {
    let (path, teams) = (Path::spiral(1.7, 8.0), [team(60, 0.3); 2]);
    let mut monitor = BetweenMonitor::new(&teams, 1e-9);
    let mut tested = 0;
    for k in 0..300 {
        let travelled = 150.0 + f64::from(k) / 60.0;
        let chain = chain_of(&path, &teams, &[travelled; 2], &[0.0, 0.5]).unwrap();
        let before = monitor.pairs_tested();
        monitor.search(&chain, f64::INFINITY).unwrap();
        tested += if k > 0 { monitor.pairs_tested() - before } else { 0 };
    }
    println!("{} a frame", tested / 299);
    // A test of all boards near each of 60 takes some 300.
    assert!(tested < 300 * 60, "{} a frame", tested / 299);
}

/// Checks every bound that the table has for a chain. Returns the difference of the least distance and the least bound,
/// or `None` outside the table.
fn check_bounds(table: &BoundTable, path: &Path, team: &Team, travelled: f64) -> Option<f64> {
    let mut chain = Chain::new(team.handles());
    Newton::new(path.clone(), *team, 1.0, Velocities::Omitted).solve_at(travelled, &mut chain).ok()?;
    let located = table.locate(travelled, team.benches)?;
    let boards: Vec<Board> = (0..team.benches).map(|bench| board(&chain, team, bench)).collect();
    let (mut least_bound, mut least) = (f64::INFINITY, f64::INFINITY);
    for a in 0..team.benches - 2 {
        let (list, from) = match a {
            0 => (table.of_head(located, (chain.x[0], chain.y[0])), 1),
            _ => (table.of_body(located, located.row + a - 1), a),
        };
        if a > 0 {
            let row = located.row + a - 1;
            assert_eq!(table.bounds(located, row / BLOCK)[row % BLOCK], list[0].bound);
            assert!(table.least_bounds(located, &(row..row + 1))[0] <= list[0].bound);
        }
        let end = list.iter().position(|neighbour| neighbour.behind == Neighbour::ALL).unwrap();
        for b in a + 2..team.benches {
            let listed = list[..end].iter().find(|neighbour| from + neighbour.behind as usize == b);
            let bound = f64::from(listed.unwrap_or(&list[end]).bound);
            let distance = signed_distance_board_board(&boards[a], &boards[b]);
            least = least.min(distance);
            least_bound = least_bound.min(if listed.is_some() { bound } else { f64::INFINITY });
            assert!(bound <= distance, "{a} and {b} at {travelled} m: {distance}, {list:?}, {path:?}, {team:?}");
        }
    }
    Some(least - least_bound)
}

#[test]
fn bounds_of_the_paper_scene_are_close() {
    let (team, path) = (team(223, 0.3), Path::spiral(0.55, 16.0));
    let table = bound_table(&path, &team).unwrap();
    for k in 0..390 {
        let slack = check_bounds(&table, &path, &team, 1.001 * f64::from(k) + 0.2).unwrap();
        assert!(slack < 0.01, "{slack} m after {k} m");
    }
}

/// Far behind, where one list serves all cells of a row: on a spiral and on a straight line.
#[test]
fn bounds_far_behind_hold_and_are_close() {
    let scenes = [(Path::spiral(0.55, 16.0), [200.37, 311.9]), (procession(), [60.2, 113.3])];
    for (path, travels) in scenes {
        let team = team(1_400, 0.3);
        let table = bound_table(&path, &team).unwrap();
        for travelled in travels {
            let slack = check_bounds(&table, &path, &team, travelled).unwrap();
            assert!(slack < 0.01, "{slack} m after {travelled} m of {path:?}");
        }
    }
}

/// All pairs of such teams would take long. They are compared with the search without a table, which other tests
/// verify.
#[test]
fn large_teams_have_a_table() {
    let team = team(5_000, 0.3);
    for (path, travels) in [(Path::spiral(0.55, 16.0), [0.0, 156.0, 400.0]), (procession(), [60.0, 100.0, 150.0])] {
        let mut chain = Chain::new(team.handles());
        let solver = Newton::new(path.clone(), team, 1.0, Velocities::Omitted);
        let mut monitors = [with_table(&path, team), ClearanceMonitor::without_table(team, 0.0)];
        for travelled in travels {
            solver.solve_at(travelled, &mut chain).unwrap();
            let [found, searched] = monitors.each_mut().map(|monitor| monitor.least_clearance(&chain, travelled));
            assert_eq!(found, searched, "{travelled} {path:?}");
        }
        let counters = monitors[0].counters();
        assert!(counters.searches == 0 && counters.pairs < 1_000, "{counters:?}");
    }
}

#[test]
fn there_is_no_table_where_no_pair_counts() {
    let path = Path::spiral(0.55, 16.0);
    assert!(bound_table(&path, &team(2, 0.3)).is_none());
    assert!(bound_table(&path, &team(3, 0.3)).is_some());
}

fn any_team() -> impl Strategy<Value = Team> {
    (3..90usize, 0.1..5.0f64, 0.1..5.0f64, any::<bool>(), 0.01..1.5f64, 0.0..1.0f64).prop_map(
        |(benches, head, body, equal, width, hole_inset)| {
            let long = |link: f64| link + 2.0 * hole_inset;
            Team {
                benches,
                head_length: long(if equal { body } else { head }),
                body_length: long(body),
                width,
                hole_inset,
            }
        },
    )
}

/// Paths of every kind, and lanes side by side in opposite directions.
fn any_lanes() -> impl Strategy<Value = Path> {
    let hairpin = (0.2..2.0f64, 0.45..0.55f64, 5.0..40.0f64).prop_map(|(radius, turns, length)| {
        let lane = Path::route(0.3).line(length);
        lane.arc(Side::Left, radius, turns).line(length).arc(Side::Right, radius, turns).line(length).build().unwrap()
    });
    prop_oneof![2 => any_path(), 1 => hairpin]
}

/// Successive frames at several rates, at several places.
fn frames(path: &Path, places: &[f64]) -> Vec<f64> {
    places.iter().flat_map(|place| [0.0, 5e-5, 1e-3, 1.0 / 60.0].map(|by| place * path.length() + by)).collect()
}

/// Returns a quarter of the random cases, all of them with `BENCH_DRAGON_ALL=1`, and ten times as many if the tests that
/// take minutes are requested.
fn count(cases: usize) -> usize {
    let is_set = |variable| std::env::var_os(variable).is_some_and(|value| value == "1");
    match () {
        () if is_set("BENCH_DRAGON_LONG") => 10 * cases,
        () if is_set("BENCH_DRAGON_ALL") => cases,
        () => cases / 4,
    }
}

/// Runs a check on random cases and returns the sum of its counts.
fn sum_over_cases<S: Strategy>(cases: usize, strategy: S, check: impl Fn(S::Value) -> usize) -> usize {
    let checked = Cell::new(0);
    let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(cases as u32) };
    let result = TestRunner::new(config).run(&strategy, |case| {
        checked.set(checked.get() + check(case));
        Ok(())
    });
    result.unwrap_or_else(|failure| panic!("{failure}"));
    checked.get()
}

#[test]
fn the_same_as_all_pairs_on_random_spirals() {
    let (count, cases) = (count(60), (any_team(), 0.05..3.0f64, 2.0..25.0f64, prop::collection::vec(0.0..1.0f64, 6)));
    let compared = sum_over_cases(count, cases, |(team, pitch, turns, places)| {
        let path = Path::spiral(pitch, turns);
        agree(team, &path, &frames(&path, &places)).0
    });
    assert!(compared > count * 24 / 2, "{compared} frames of random spirals");
}

#[test]
fn the_same_as_all_pairs_on_random_paths() {
    let (count, cases) = (count(100), (any_team(), any_lanes(), prop::collection::vec(0.0..1.0f64, 6)));
    let compared = sum_over_cases(count, cases, |(team, path, places)| agree(team, &path, &frames(&path, &places)).0);
    assert!(compared > count * 24 / 2, "{compared} frames on random paths");
}

#[test]
fn no_boards_are_nearer_than_the_bounds() {
    let cases = (any_team(), any_lanes(), prop::collection::vec(0.0..1.0f64, 12));
    let close = Cell::new(0);
    let count = count(100);
    let checked = sum_over_cases(count, cases, |(team, path, places)| {
        let Some(table) = bound_table(&path, &team) else { return 0 };
        let slacks = places.iter().filter_map(|place| check_bounds(&table, &path, &team, place * path.length()));
        slacks.inspect(|slack| close.set(close.get() + usize::from(*slack < 0.02 * team.link(1)))).count()
    });
    assert!(checked > count * 12 / 2, "{checked} frames had a table");
    // Without bounds the test would pass, too.
    assert!(close.get() > checked / 2, "{close:?} of {checked} frames had a close bound");
}
