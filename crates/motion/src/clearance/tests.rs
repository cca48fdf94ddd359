//! The live method against all pairs, and every bound of a window against the true distance.

use std::cell::Cell;

use super::*;
use crate::ground::Obstacle;
use crate::linkage::NoFollower;
use crate::model::Vector;
use crate::model::curve::Side;
use crate::model::description::PathDescription;
use crate::model::path::Path;
use crate::model::shape::Shape;
use crate::model::team::Ends;
use crate::placement::Placement;
use crate::solve::newton::Newton;
use crate::solve::paper::PaperRules;
use crate::solve::{ChainMut, Velocities};
use crate::{Method, Motion};
use proptest::prelude::*;

fn team(benches: usize, width: f64) -> Team {
    Team { benches, head_length: 3.41, body_length: 2.2, width, hole_inset: 0.275, ends: Ends::NONE }
}

/// Exact motion of a metre a second, as it predicts itself.
#[derive(Clone, Copy)]
enum Ahead {
    Exactly,
    Never,
    /// As if the show were that many seconds further.
    Wrongly(f64),
}

/// Dragons on one path, each turned by a share of a turn and faster by a factor.
struct Exact {
    dragons: Vec<(Newton, Placement, f64, usize)>,
    ahead: Ahead,
}

impl Exact {
    fn new(path: &Path, teams: &[(Team, f64, f64)], ahead: Ahead) -> Self {
        let dragon = |(team, turns, factor): &(Team, f64, f64)| {
            let solver = Newton::new(path.clone(), *team, 1.0, Velocities::Omitted);
            (solver, Placement::new(Vector::zeros(), *turns, false), *factor, team.handles())
        };
        Self { dragons: teams.iter().map(dragon).collect(), ahead }
    }

    fn one(path: &Path, team: Team, ahead: Ahead) -> Self {
        Self::new(path, &[(team, 0.0, 1.0)], ahead)
    }
}

impl Solver for Exact {
    fn name(&self) -> &'static str {
        "exact"
    }

    fn solve_in(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        let mut first = 0;
        for (solver, placement, factor, handles) in &mut self.dragons {
            let mut own = chain.range_mut(first..first + *handles);
            solver.solve_in(time * *factor, &mut own)?;
            if !placement.is_identity() {
                placement.chain(&mut own);
            }
            first += *handles;
        }
        Ok(())
    }

    fn solve_ahead(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        match self.ahead {
            Ahead::Exactly => self.solve_in(time, chain),
            Ahead::Never => Err(NoFollower),
            Ahead::Wrongly(by) => self.solve_in(time + by, chain),
        }
    }
}

fn precision(teams: &[Team]) -> Precision {
    let shortest = teams.iter().map(Team::shortest_link).fold(f64::INFINITY, f64::min);
    Precision { handle_error: 0.0, seconds_per_link: shortest }
}

fn monitor(team: Team) -> ClearanceMonitor {
    ClearanceMonitor::new(&[team], Pairs::Own, Ground::default(), precision(&[team]))
}

/// Compares monitors with all pairs, frame by frame, for all chains: with right, without, and with wrong predictions.
/// Returns the number of frames and the work of the first monitor.
fn agree(team: Team, path: &Path, travels: &[f64]) -> (usize, ClearanceCounters) {
    let ways = [Ahead::Exactly, Ahead::Never, Ahead::Wrongly(1e-5), Ahead::Wrongly(0.7)];
    let mut monitors = ways.map(|ahead| (monitor(team), Exact::one(path, team, ahead)));
    let mut chain = Chain::new(team.handles());
    let mut compared = 0;
    for &travelled in travels {
        if monitors[0].1.solve(travelled, &mut chain).is_err() {
            continue;
        }
        let truth = least_clearance_all_pairs(&chain, &team);
        for (monitor, solver) in &mut monitors {
            let FrameClearance { boards, obstacle } = monitor.nearest(&chain, travelled, f64::INFINITY, solver);
            assert_eq!((boards, obstacle), (truth, None), "{team:?} {path:?} {travelled}");
        }
        compared += 1;
    }
    (compared, monitors[0].0.counters())
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
    let four = Team { benches: 4, head_length: 9.5, body_length: 6.5, width: 2.7, hole_inset: 1.1, ends: Ends::NONE };
    let fourteen =
        Team { benches: 14, head_length: 8.9, body_length: 7.7, width: 1.4, hole_inset: 0.8, ends: Ends::NONE };
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
        let found = monitor.nearest(&chain, time, f64::INFINITY, choice.solver.as_mut());
        assert_eq!(found.boards, least_clearance_all_pairs(&chain, &team), "{time}");
    }
    assert!(most_off > 1e-3, "{most_off} m");
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
    let mut monitor = monitor(team);
    let mut solver = Newton::new(path, team, 1.0, Velocities::Omitted);
    let mut at = |travelled: f64| {
        solver.solve(travelled, &mut chain).unwrap();
        monitor.nearest(&chain, travelled, f64::INFINITY, &mut solver).boards.unwrap()
    };
    let (before, after) = (at(412.473837682115 - 1e-9), at(412.473837682115 + 1e-9));
    assert!(before.value > 0.0 && after.value < 0.0, "{before:?} {after:?}");
    assert_eq!((after.bench_a, after.bench_b), (0, 8));
}

#[test]
fn few_pairs_are_tested_and_few_windows_are_not_prepared() {
    let run = |from: f64| (0..200).map(|k| from + f64::from(k) / 60.0).collect::<Vec<_>>();
    let turnaround = || Path::turnaround(1.7, 4.5, 2.0, 100.0, 369.16).unwrap();
    for (team, path, travels, most) in [
        (team(223, 0.3), Path::spiral(0.55, 16.0), run(100.0), 3.0),
        // Every pair of neighbours on two turns is nearly as near as the nearest.
        (team(223, 0.3), Path::spiral(0.55, 16.0), run(156.0), 3.0),
        (team(223, 0.3), Path::spiral(0.55, 16.0), run(408.0), 3.0),
        (team(223, 0.3), turnaround(), run(100.0), 3.0),
        (team(223, 0.3), turnaround(), run(400.0), 15.0),
        (team(60, 0.3), procession(), run(60.0), 12.0),
        // On a straight line all neighbours are equally near.
        (team(60, 0.3), procession(), run(10.0), 58.0),
    ] {
        let (compared, counters) = agree(team, &path, &travels);
        println!("{counters:?}");
        assert_eq!(compared, travels.len());
        assert!(counters.pairs as f64 <= most * compared as f64, "{counters:?}");
        assert!(counters.searches <= 2, "{counters:?}: windows were not prepared");
    }
}

#[test]
fn too_few_benches_have_no_clearance() {
    for benches in [1, 2] {
        let team = team(benches, 0.3);
        let mut solver = Exact::one(&procession(), team, Ahead::Exactly);
        let mut chain = Chain::new(team.handles());
        let mut monitor = monitor(team);
        for frame in 0..60 {
            let time = f64::from(frame) / 60.0;
            solver.solve(time, &mut chain).unwrap();
            let found = monitor.nearest(&chain, time, f64::INFINITY, &mut solver);
            assert_eq!(found, FrameClearance { boards: None, obstacle: None });
        }
    }
}

/// Dragons that coil side by side at 60 Hz, then one that is faster, then jumps; with limits and without.
#[test]
fn between_dragons_the_same_as_all_pairs() {
    let path = Path::spiral(1.7, 8.0);
    for teams in [vec![team(60, 0.3), team(45, 0.3)], vec![team(20, 0.1), team(30, 1.2), team(25, 0.3)]] {
        let dragons = |faster: f64| -> Vec<(Team, f64, f64)> {
            let turns = |k: usize| k as f64 / teams.len() as f64;
            let factor = |k: usize| if k == 1 { faster } else { 1.0 };
            teams.iter().enumerate().map(|(k, team)| (*team, turns(k), factor(k))).collect()
        };
        let mut monitor = ClearanceMonitor::new(&teams, Pairs::Between, Ground::default(), precision(&teams));
        let mut chain = Chain::new(teams.iter().map(Team::handles).sum());
        let slow = (0..300).map(|k| (100.0 + f64::from(k) / 60.0, 1.0));
        let fast = (0..200).map(|k| (100.0 + f64::from(k) / 60.0, 1.7));
        let jumps = (0..40).map(|k| (f64::from(k * 37 % 200), 1.0));
        let mut limits = 0;
        for (number, (time, faster)) in slow.chain(fast).chain(jumps).enumerate() {
            let mut solver = Exact::new(&path, &dragons(faster), Ahead::Exactly);
            if solver.solve(time, &mut chain).is_err() {
                continue;
            }
            let truth = nearest_between_all_pairs(&chain, &teams).unwrap();
            // The limits of other boards, which can be far below the distance or above it.
            let limit = [f64::INFINITY, truth.value - 0.01, truth.value + 0.01, 2.0][number / 7 % 4];
            let found = monitor.nearest(&chain, time, limit, &mut solver).boards;
            assert_eq!(found, Some(truth).filter(|truth| truth.value < limit), "{time} {faster} {limit}");
            limits += usize::from(found.is_none());
        }
        assert!(limits > 50, "{limits}");
    }
}

/// Two dragons far apart that have no pairs of their own.
#[test]
fn boards_far_apart_are_found() {
    let (path, teams) = (Path::spiral(1.7, 500.0), [team(2, 0.3), team(1, 0.3)]);
    let mut solver = Exact::new(&path, &[(teams[0], 0.0, 1.0), (teams[1], 0.5, 1.0)], Ahead::Exactly);
    let mut monitor = ClearanceMonitor::new(&teams, Pairs::Between, Ground::default(), precision(&teams));
    let mut chain = Chain::new(5);
    for frame in 0..120 {
        let time = f64::from(frame) / 60.0;
        solver.solve(time, &mut chain).unwrap();
        let truth = nearest_between_all_pairs(&chain, &teams);
        assert!(truth.unwrap().value > 1_000.0);
        assert_eq!(monitor.nearest(&chain, time, f64::INFINITY, &mut solver).boards, truth);
    }
}

#[test]
fn of_dragons_side_by_side_few_boards_are_tested() {
    let (path, teams) = (Path::spiral(1.7, 8.0), [team(60, 0.3); 2]);
    let mut monitor = ClearanceMonitor::new(&teams, Pairs::Between, Ground::default(), precision(&teams));
    let mut solver = Exact::new(&path, &[(teams[0], 0.0, 1.0), (teams[1], 0.5, 1.0)], Ahead::Exactly);
    let mut chain = Chain::new(122);
    for k in 0..300 {
        let time = 150.0 + f64::from(k) / 60.0;
        solver.solve(time, &mut chain).unwrap();
        monitor.nearest(&chain, time, f64::INFINITY, &mut solver).boards.unwrap();
    }
    let counters = monitor.counters();
    println!("{counters:?}");
    assert!(counters.pairs < 300 * 20 && counters.searches <= 2, "{counters:?}");
}

/// A lamp, a post outside, and a bent line that boards overlap: the depth of an overlap with a shape that is not convex
/// jumps where a board turns.
#[test]
fn obstacles_as_by_testing_all_boards() {
    const RADII: [f64; 12] = [2.615, 1.616, 1.802, 1.221, 0.711, 0.904, 1.775, 2.495, 1.747, 2.667, 0.606, 1.719];
    let corner = |(number, radius): (usize, &f64)| {
        let angle = number as f64 * std::f64::consts::TAU / 12.0;
        Point::new(3.231 + radius * angle.cos(), -0.132 + radius * angle.sin())
    };
    let wall = [(-14.0, -14.0), (14.0, -14.0), (14.0, 14.0), (-14.0, 14.0)].map(|(x, y)| Point::new(x, y));
    let lamp = (Shape::circle(Point::new(0.3, 0.2), 0.5), 0.2);
    let post = (Shape::circle(Point::new(0.0, 12.5), 0.5), 0.0);
    let line = (Shape::line(RADII.iter().enumerate().map(corner).collect()), 0.1);
    let boundary = (Shape::boundary(wall.to_vec()), 0.3);
    let (path, overlaps) = (Path::spiral(0.55, 16.0), Cell::new(0));
    for shapes in [vec![lamp.clone(), post.clone()], vec![line], vec![post, lamp, boundary]] {
        let obstacle = |(shape, keep_out)| Obstacle { name: String::new(), shape, keep_out };
        let ground = Ground::new(shapes.into_iter().map(obstacle).collect());
        for (team, limit) in [(team(223, 0.3), f64::INFINITY), (team(223, 0.3), 0.1), (team(2, 0.3), f64::INFINITY)] {
            let mut monitor = ClearanceMonitor::new(&[team], Pairs::Own, ground.clone(), precision(&[team]));
            let mut solver = Exact::one(&path, team, Ahead::Exactly);
            let mut chain = Chain::new(team.handles());
            for time in runs(411.0, 40) {
                solver.solve(time, &mut chain).unwrap();
                let FrameClearance { boards, obstacle } = monitor.nearest(&chain, time, limit, &mut solver);
                let truth = least_clearance_all_pairs(&chain, &team).filter(|least| least.value < limit);
                assert_eq!(boards, truth);
                let below = truth.map_or(limit, |least| least.value);
                let clearance = |bench| {
                    let board = board(&chain, &team, bench);
                    ground.obstacles().iter().map(move |obstacle| obstacle.clearance(&board))
                };
                let least = (0..team.benches).flat_map(clearance).fold(f64::INFINITY, f64::min);
                let found = obstacle.map(|nearest| nearest.value);
                let expected = Some(least).filter(|least| *least < below);
                assert_eq!(found.is_some(), expected.is_some(), "{found:?} {expected:?} at {time}");
                let off = found.unwrap_or(0.0) - expected.unwrap_or(0.0);
                assert!(off.abs() < 1e-12, "{found:?} {expected:?} at {time}");
                overlaps.set(overlaps.get() + usize::from(least < -0.1));
            }
        }
    }
    assert!(overlaps.get() > 300, "{overlaps:?}");
}

/// Opens a window at a time and checks each of its bounds at several moments of it. Returns the number of moments, and
/// that of moments at which the least bound is close to the least distance.
fn check_bounds(path: &Path, team: &Team, time: f64) -> (usize, usize) {
    let mut solver = Exact::one(path, *team, Ahead::Exactly);
    let stage = Stage { teams: Teams::new(&[*team], Pairs::Own), ground: Ground::default(), least_error: 1e-5 };
    let (mut window, mut work) = (Window::new(&stage), Workspace::new(team.handles()));
    let mut chain = Chain::new(team.handles());
    let end = time + WINDOW * team.shortest_link();
    if !window.open((time, end), &stage, &mut solver, &mut work) {
        return (0, 0);
    }
    window.begin_lists(&stage, &mut work, f64::INFINITY, None);
    window.list_up_to(team.handles(), &stage, &work);
    let (mut checked, mut close) = (0, 0);
    for share in [0.0, 0.13, 0.31, 0.5, 0.77, 0.92, 1.0] {
        let at = time + share * (end - time);
        if solver.solve(at, &mut chain).is_err() || !window.holds((&chain).into(), at) {
            continue;
        }
        let boards: Vec<Board> = (0..team.benches).map(|bench| board(&chain, team, bench)).collect();
        let (mut least, mut least_bound) = (f64::INFINITY, f64::INFINITY);
        for a in 0..team.benches - 2 {
            for b in a + 2..team.benches {
                let distance = signed_distance_board_board(&boards[a], &boards[b]);
                let is = |(_, pair): &(&f32, &(u32, u32))| **pair == (a as u32, b as u32);
                let bounds = || window.pair_bounds.iter().zip(&window.pairs);
                let of_all = |(_, pair): &(&f32, &(u32, u32))| **pair == (a as u32, window::ALL);
                let listed = bounds().find(is).or_else(|| bounds().find(of_all));
                let bound = listed.map_or(window.limit, |(bound, _)| f64::from(*bound));
                assert!(bound <= distance, "{a} and {b} at {at}: {distance}, {bound}, {path:?}, {team:?}");
                least = least.min(distance);
                least_bound = least_bound.min(bound);
            }
        }
        assert!(least <= window.limit, "{least} {} {path:?} {team:?}", window.limit);
        checked += 1;
        close += usize::from(least - least_bound < 0.02 * team.link(1));
    }
    (checked, close)
}

#[test]
fn bounds_of_the_paper_scene_are_close() {
    let (team, path) = (team(223, 0.3), Path::spiral(0.55, 16.0));
    for k in 0..39 {
        let (checked, close) = check_bounds(&path, &team, 10.01 * f64::from(k) + 0.2);
        assert!(checked == 7 && close == 7, "{checked} {close} after {k}0 m");
    }
}

/// All pairs of such teams would take long. They are compared with windows of a single frame, which other tests verify.
#[test]
fn large_teams() {
    let team = team(5_000, 0.3);
    for (path, travels) in [(Path::spiral(0.55, 16.0), [0.0, 156.0, 400.0]), (procession(), [60.0, 100.0, 150.0])] {
        let mut chain = Chain::new(team.handles());
        let mut monitors = [Ahead::Exactly, Ahead::Never].map(|ahead| (monitor(team), Exact::one(&path, team, ahead)));
        for travelled in travels.into_iter().flat_map(|from| (0..5).map(move |k| from + f64::from(k) / 10.0)) {
            monitors[0].1.solve(travelled, &mut chain).unwrap();
            let [found, searched] =
                monitors.each_mut().map(|(monitor, solver)| monitor.nearest(&chain, travelled, f64::INFINITY, solver));
            assert_eq!(found, searched, "{travelled} {path:?}");
        }
    }
}

mod random;
