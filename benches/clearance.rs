//! What the least clearance of a frame costs: all pairs against the live way, and one pair.
//!
//! Every case averages over a run of consecutive 60 Hz frames at one place of the show, given in hundredths of the
//! head's way to the contact (of the way that leaves it 4 m from the centre, for longer teams).

use bench_dragon::chain::newton::Newton;
use bench_dragon::chain::{Chain, Team, Velocities};
use bench_dragon::clearance::{ClearanceMonitor, Ground, board, least_clearance_all_pairs};
use bench_dragon::geometry::path::Path;
use bench_dragon::geometry::separation::{separation_board_board, signed_distance_board_board};
use bench_dragon::geometry::spiral::Spiral;
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use parry2d_f64::math::Pose;
use parry2d_f64::query;
use parry2d_f64::shape::Cuboid;

const PITCH: f64 = 0.55;
const FRAMES: usize = 60;

fn team(benches: usize) -> Team {
    Team { benches, head_length: 3.41, body_length: 2.2, width: 0.3, hole_inset: 0.275 }
}

fn chains(spiral: Spiral, team: Team, percent: usize) -> Vec<Chain> {
    let solver = Newton::new(spiral, team, 1.0, Velocities::Omitted);
    let start = 4.12 * percent as f64;
    let frame = |k: usize| {
        let mut chain = Chain::new(team.handles());
        let head = spiral.place_at(start + k as f64 / 60.0);
        solver.solve_from(head, &mut chain).expect("the paper's head travels this far before any link locks");
        chain
    };
    (0..FRAMES).map(frame).collect()
}

/// The paper's spiral.
fn spiral() -> Spiral {
    Spiral::new(PITCH, 16.0)
}

fn run(bencher: Bencher, (benches, percent): (usize, usize), spiral: Spiral, ground: Ground) {
    let chains = chains(spiral, team(benches), percent);
    let mut monitor = ClearanceMonitor::new(team(benches), ground);
    bencher.counter(ItemsCount::new(FRAMES)).bench_local(|| {
        for chain in &chains {
            black_box(monitor.least_clearance(black_box(chain)));
        }
    });
}

/// Benches, and hundredths of the way to the contact. At 38 nearly every pair on two turns is as near as the nearest.
const CASES: [(usize, usize); 8] =
    [(223, 0), (223, 38), (223, 50), (223, 90), (223, 99), (1_000, 50), (10_000, 38), (10_000, 50)];

#[divan::bench(args = CASES)]
fn live(bencher: Bencher, (benches, percent): (usize, usize)) {
    run(bencher, (benches, percent), spiral(), Ground::Spiral(spiral()));
}

#[divan::bench(args = CASES)]
fn live_on_unknown_ground(bencher: Bencher, (benches, percent): (usize, usize)) {
    run(bencher, (benches, percent), spiral(), Ground::Unknown);
}

/// A team too short to meet itself on the next turn: every bench is as near as any to the next but one.
#[divan::bench]
fn live_on_less_than_a_turn(bencher: Bencher) {
    let spiral = Spiral::new(PITCH, 121.7);
    run(bencher, (223, 0), spiral, Ground::Spiral(spiral));
}

/// What the table of bounds costs once, before the show.
#[divan::bench(args = [223, 1_000, 5_000, 10_000], sample_count = 5, sample_size = 1)]
fn make_monitor(benches: usize) -> ClearanceMonitor {
    ClearanceMonitor::new(team(benches), Ground::Spiral(spiral()))
}

/// A peer: the distances of all pairs by parry2d.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn all_pairs_by_parry2d(bencher: Bencher) {
    let team = team(223);
    let chain = chains(spiral(), team, 50).swap_remove(0);
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
    let chain = chains(spiral(), team(benches), percent).swap_remove(0);
    bencher
        .counter(ItemsCount::new(1usize))
        .bench_local(|| least_clearance_all_pairs(black_box(&chain), &team(benches)));
}

#[divan::bench]
fn separation_of_one_pair(bencher: Bencher) {
    let chain = chains(spiral(), team(223), 99).swap_remove(0);
    let (a, b) = (board(&chain, &team(223), 0), board(&chain, &team(223), 8));
    bencher.bench_local(|| separation_board_board(black_box(&a), black_box(&b)));
}

#[divan::bench]
fn signed_distance_of_one_pair(bencher: Bencher) {
    let chain = chains(spiral(), team(223), 99).swap_remove(0);
    let (a, b) = (board(&chain, &team(223), 0), board(&chain, &team(223), 8));
    bencher.bench_local(|| signed_distance_board_board(black_box(&a), black_box(&b)));
}

fn main() {
    divan::main();
}
