//! Cost of the least clearance of a frame: all pairs against the live algorithm, and one pair.
//!
//! Every case averages over a run of consecutive frames at one place of the show, which begins with the third frame:
//! for the first two no window was prepared. On the paper's spiral, the place is
//! given in hundredths of the head's way to the contact. For longer teams, it is given in hundredths of the way that
//! leaves the head 4 m from the centre.

use std::cell::RefCell;

use bench_dragon::motion::clearance::{ClearanceMonitor, Pairs, Precision, board, least_clearance_all_pairs};
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::ground::Ground;
use bench_dragon::motion::model::curve::Side;
use bench_dragon::motion::model::path::Path;
use bench_dragon::motion::model::separation::{separation_board_board, signed_distance_board_board};
use bench_dragon::motion::model::team::{Ends, Team};
use bench_dragon::motion::solve::newton::Newton;
use bench_dragon::motion::solve::table::FollowerTable;
use bench_dragon::motion::solve::{Chain, Velocities};
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use parry2d_f64::math::Pose;
use parry2d_f64::query;
use parry2d_f64::shape::Cuboid;

const PITCH: f64 = 0.55;
/// Seconds of a run: longer than a window.
const SECONDS: f64 = 1.0;

fn team(benches: usize) -> Team {
    Team { benches, head_length: 3.41, body_length: 2.2, width: 0.3, hole_inset: 0.275, ends: Ends::NONE }
}

/// Returns the chains of consecutive frames, with the metres the head has travelled: two, and those of a run.
fn chains(path: &Path, team: Team, start: f64, rate: f64) -> Vec<(Chain, f64)> {
    let solver = Newton::new(path.clone(), team, 1.0, Velocities::Omitted);
    let frame = |k: usize| {
        let mut chain = Chain::new(team.handles());
        let travelled = start + k as f64 / rate;
        solver.solve_at(travelled, &mut chain).expect("the head travels this far before any link locks");
        (chain, travelled)
    };
    (0..2 + (SECONDS * rate) as usize).map(frame).collect()
}

/// Returns the paper's spiral.
fn spiral() -> Path {
    Path::spiral(PITCH, 16.0)
}

fn at(percent: usize) -> f64 {
    4.12 * percent as f64
}

/// Returns the path of `config/turnaround.toml`.
fn turnaround() -> Path {
    Path::turnaround(1.7, 4.5, 2.0, 100.0, 369.16).expect("its segments join")
}

/// Returns the path of `config/procession.toml`.
fn procession() -> Path {
    let corner = Path::route(0.0).line(40.0).arc(Side::Left, 6.0, 0.25).line(12.0);
    let bends = corner.arc(Side::Right, 5.0, 0.5).line(10.0).arc(Side::Left, 5.0, 0.5).line(120.0);
    bends.build().expect("its segments join")
}

/// Times a run from `start` metres of travel on, at `rate` frames a second.
fn run(bencher: Bencher, path: &Path, team: Team, start: f64, rate: f64) {
    let mut table =
        FollowerTable::new(path, team, 1.0, Velocities::Omitted, &mut unreported).expect("these paths have a table");
    let precision = Precision { handle_error: 0.0, seconds_per_link: team.shortest_link() };
    let mut monitor = ClearanceMonitor::new(&[team], Pairs::Own, Ground::default(), precision);
    let chains = chains(path, team, start, rate);
    let test = RefCell::new(|frames: &[(Chain, f64)]| {
        for (chain, travelled) in frames {
            black_box(monitor.nearest(black_box(chain), *travelled, f64::INFINITY, &mut table));
        }
    });
    let (first, others) = chains.split_at(2);
    let bencher = bencher.counter(ItemsCount::new(others.len()));
    bencher.with_inputs(|| test.borrow_mut()(first)).bench_local_values(|()| test.borrow_mut()(others));
}

/// Benches, and hundredths of the way to the contact. At 38 nearly every pair on two turns is as near as the nearest.
const CASES: [(usize, usize); 8] =
    [(223, 0), (223, 38), (223, 50), (223, 90), (223, 99), (1_000, 50), (10_000, 38), (10_000, 50)];

#[divan::bench(args = CASES)]
fn live(bencher: Bencher, (benches, percent): (usize, usize)) {
    run(bencher, &spiral(), team(benches), at(percent), 60.0);
}

/// Large teams, halfway to the contact.
#[divan::bench(args = [20_000, 100_000], sample_count = 5, sample_size = 1)]
fn live_large_team(bencher: Bencher, benches: usize) {
    run(bencher, &spiral(), team(benches), at(50), 60.0);
}

/// By frames a second, and benches. At 1 Hz no frame is in the window of the previous one.
#[divan::bench(args = [(1.0, 223), (1_000.0, 223), (20_000.0, 223), (1.0, 5_000), (1.0, 100_000)])]
fn live_by_rate(bencher: Bencher, (rate, benches): (f64, usize)) {
    run(bencher, &spiral(), team(benches), at(50), rate);
}

/// Metres of travel: inward along the spiral, in the turn, and between the lanes that still come in.
#[divan::bench(args = [50.0, 110.0, 200.0, 300.0, 400.0])]
fn live_on_the_turnaround(bencher: Bencher, travelled: f64) {
    run(bencher, &turnaround(), team(223), travelled, 60.0);
}

/// Metres of travel. On the straight lines at the beginning all neighbours are equally near, so all are tested.
#[divan::bench(args = [10.0, 60.0, 90.0, 120.0, 200.0])]
fn live_on_the_procession(bencher: Bencher, travelled: f64) {
    run(bencher, &procession(), team(60), travelled, 60.0);
}

/// A team too short to meet itself on the next turn: every bench is equally near to the next but one.
#[divan::bench]
fn live_on_less_than_a_turn(bencher: Bencher) {
    run(bencher, &Path::spiral(PITCH, 60.0), team(100), 0.0, 60.0);
}

/// A peer: the distances of all pairs by parry2d.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn all_pairs_by_parry2d(bencher: Bencher) {
    let team = team(223);
    let (chain, _) = chains(&spiral(), team, at(50), 60.0).swap_remove(0);
    bencher.counter(ItemsCount::new(1usize)).bench_local(|| {
        let boards: Vec<(Pose, Cuboid)> = (0..223)
            .map(|bench| {
                let board = board(&chain, &team, bench);
                let angle = board.axis.y.atan2(board.axis.x);
                let half_extents = [board.half_length, board.half_width];
                (Pose::new([board.centre.x, board.centre.y].into(), angle), Cuboid::new(half_extents.into()))
            })
            .collect();
        let mut least = f64::INFINITY;
        for (i, (pose, shape)) in boards.iter().enumerate() {
            for (other_pose, other) in boards.iter().skip(i + 2) {
                let found = query::distance(pose, shape, other_pose, other).expect("parry knows two cuboids");
                least = least.min(found.distance);
            }
        }
        least
    });
}

#[divan::bench(args = [(223, 50), (1_000, 50), (10_000, 50)], sample_count = 3, sample_size = 1)]
fn all_pairs(bencher: Bencher, (benches, percent): (usize, usize)) {
    let (chain, _) = chains(&spiral(), team(benches), at(percent), 60.0).swap_remove(0);
    bencher
        .counter(ItemsCount::new(1usize))
        .bench_local(|| least_clearance_all_pairs(black_box(&chain), &team(benches)));
}

#[divan::bench]
fn separation_of_one_pair(bencher: Bencher) {
    let (chain, _) = chains(&spiral(), team(223), at(99), 60.0).swap_remove(0);
    let (a, b) = (board(&chain, &team(223), 0), board(&chain, &team(223), 8));
    bencher.bench_local(|| separation_board_board(black_box(&a), black_box(&b)));
}

#[divan::bench]
fn signed_distance_of_one_pair(bencher: Bencher) {
    let (chain, _) = chains(&spiral(), team(223), at(99), 60.0).swap_remove(0);
    let (a, b) = (board(&chain, &team(223), 0), board(&chain, &team(223), 8));
    bencher.bench_local(|| signed_distance_board_board(black_box(&a), black_box(&b)));
}

fn main() {
    divan::main();
}
