//! The paper's solver, compared with its printed tables and with its own model's limit computed with 50 digits.

use crate::tables;

use bench_dragon::motion::model::path::Path;
use bench_dragon::motion::model::team::{Ends, Team};
use bench_dragon::motion::solve::paper::{Paper, PaperRules};
use bench_dragon::motion::solve::{Chain, Solver, Velocities};
use tables::{Row, table};

fn paper_team() -> Team {
    Team { benches: 223, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275, ends: Ends::NONE }
}

/// Returns the largest position error in metres and relative speed error of a solver at each time of a table.
fn errors(solver: &mut dyn Solver, rows: &[Row]) -> Vec<(f64, f64, f64)> {
    let mut chain = Chain::new(224);
    rows.chunk_by(|a, b| a.time == b.time)
        .map(|rows| {
            solver.solve(rows[0].time, &mut chain).unwrap();
            assert_eq!(rows.len(), 224);
            let (mut position, mut speed) = (0f64, 0f64);
            for row in rows {
                let i = row.handle;
                let numbers = [chain.x[i], chain.y[i], chain.heading[i], chain.speed[i], chain.vx[i], chain.vy[i]];
                assert!(numbers.into_iter().all(f64::is_finite), "t = {} s, handle {i}: {numbers:?}", row.time);
                position = position.max((chain.x[i] - row.x).hypot(chain.y[i] - row.y));
                speed = speed.max(((chain.speed[i] - row.speed) / row.speed).abs());
            }
            (rows[0].time, position, speed)
        })
        .collect()
}

fn paper_solver() -> Paper {
    let path = Path::spiral(0.55, 16.0);
    let (spiral, start) = path.as_spiral().unwrap();
    Paper::new(*spiral, start.high, paper_team(), 1.0, Velocities::Computed, PaperRules::default())
}

fn solved(solver: &mut dyn Solver, time: f64) -> Chain {
    let mut chain = Chain::new(224);
    solver.solve(time, &mut chain).unwrap();
    chain
}

const TABLE_TIMES: [f64; 5] = [0.0, 120.0, 180.0, 240.0, 300.0];

#[test]
fn paper_reproduces_the_printed_positions() {
    // Table 1 of the paper: x and y of the head, the first body bench and the tail at the times above.
    let printed: [(usize, [f64; 5], [f64; 5]); 3] = [
        (
            0,
            [8.800000, -4.090661, -2.953251, 2.578964, 4.431368],
            [-0.000010, -6.300638, 6.099641, -5.363957, 2.298227],
        ),
        (1, [8.363827, -1.452262, -5.229679, 4.810828, 2.480906], [2.826534, -7.404472, 4.368319, -3.575554, 4.389948]),
        (
            223,
            [-5.305452, 10.974822, 7.391961, 3.257163, 1.809269],
            [-10.676580, 0.836561, 7.484280, 9.463648, 9.296247],
        ),
    ];
    let mut solver = paper_solver();
    for (column, time) in TABLE_TIMES.into_iter().enumerate() {
        let chain = solved(&mut solver, time);
        for (handle, x, y) in printed {
            let error = (chain.x[handle] - x[column]).abs().max((chain.y[handle] - y[column]).abs());
            assert!(error < 5e-6, "handle {handle} at {time} s: {error:e} m");
        }
    }
}

#[test]
fn paper_reproduces_the_printed_speeds() {
    // Table 2 of the paper; its column at t = 0 holds zeros, as a backward difference at the very start does.
    let printed: [(usize, [f64; 5]); 4] = [
        (0, [0.0, 1.000038, 1.000047, 1.000061, 1.000087]),
        (1, [0.0, 0.999984, 0.999964, 0.999921, 0.999797]),
        (101, [0.0, 0.999323, 0.999024, 0.998519, 0.997424]),
        (223, [0.0, 0.998944, 0.998553, 0.997914, 0.996619]),
    ];
    let mut solver = paper_solver();
    for (column, time) in TABLE_TIMES.into_iter().enumerate() {
        let chain = solved(&mut solver, time);
        for (handle, speeds) in printed {
            let error = (chain.speed[handle] - speeds[column]).abs();
            assert!(error < 2e-5, "handle {handle} at {time} s: {error:e} m/s");
        }
    }
}

#[test]
fn paper_reproduces_the_printed_collision_but_for_two_misprints() {
    // Table 3 of the paper, at 412.5 s: (handle, x, y).
    let printed =
        [(0, 1.279543, 1.893730), (1, -1.579164, 1.807741), (51, 1.360257, 0.026773), (223, 1.038376, 0.074969)];
    let chain = solved(&mut paper_solver(), 412.5);
    for (handle, x, y) in printed {
        assert!((chain.x[handle] - x).abs() < 1e-5, "x of handle {handle}");
        let misprinted = handle == 51 || handle == 223;
        assert_eq!((chain.y[handle] - y).abs() > 1e-5, misprinted, "y of handle {handle}");
        if misprinted {
            // With the printed y the point would lie off the spiral: far from r = a theta for its own theta.
            let theta = y.atan2(x).rem_euclid(std::f64::consts::TAU);
            let turns = (x.hypot(y) / 0.55 - theta / std::f64::consts::TAU).rem_euclid(1.0);
            assert!(turns.min(1.0 - turns) > 0.1, "handle {handle} as printed would lie on the spiral");
        }
    }
    // The values of the paper's own model for the same points.
    assert!((chain.y[51] - 4.300697).abs() < 1e-5 && (chain.y[223] - 8.312013).abs() < 1e-5);
}

#[test]
fn paper_tends_to_the_limit_of_its_own_model() {
    let rows = table(include_str!("../truth/paper_scene_as_printed_model.csv"));
    for (time, position, _) in errors(&mut paper_solver(), &rows) {
        assert!(position < 1.5e-5, "t = {time} s: {position:e} m");
    }
}
