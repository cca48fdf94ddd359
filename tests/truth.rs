//! The solvers against figures computed with 50 digits, and against the paper's printed tables.

use bench_dragon::chain::newton::Newton;
use bench_dragon::chain::{Chain, Solver, Team, Velocities};
use bench_dragon::geometry::spiral::Spiral;

/// One row of a 50-digit table.
struct Row {
    time: f64,
    handle: usize,
    x: f64,
    y: f64,
    speed: f64,
}

/// The table of a CSV file with the columns t_s, handle, theta_rad, x_m, y_m, speed_m_s.
fn table(text: &str) -> Vec<Row> {
    text.lines()
        .skip(1)
        .map(|line| {
            let fields: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
            Row { time: fields[0], handle: fields[1] as usize, x: fields[3], y: fields[4], speed: fields[5] }
        })
        .collect()
}

fn paper_team() -> Team {
    Team { benches: 223, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275 }
}

/// The largest position error in metres and relative speed error of a solver at each time of a table.
fn errors(solver: &mut dyn Solver, rows: &[Row]) -> Vec<(f64, f64, f64)> {
    let mut chain = Chain::new(224);
    rows.chunk_by(|a, b| a.time == b.time)
        .map(|rows| {
            solver.solve(rows[0].time, &mut chain).unwrap();
            assert_eq!(rows.len(), 224);
            let (mut position, mut speed) = (0f64, 0f64);
            for row in rows {
                let i = row.handle;
                position = position.max((chain.x[i] - row.x).hypot(chain.y[i] - row.y));
                speed = speed.max(((chain.speed[i] - row.speed) / row.speed).abs());
            }
            (rows[0].time, position, speed)
        })
        .collect()
}

#[test]
fn newton_agrees_with_50_digits() {
    let rows = table(include_str!("truth/paper_scene_exact.csv"));
    let mut newton = Newton::new(Spiral::new(0.55, 16.0), paper_team(), 1.0, Velocities::Computed);
    let errors = errors(&mut newton, &rows);
    assert_eq!(errors.len(), 11);
    for (time, position, speed) in errors {
        println!("t = {time} s: position {position:.1e} m, speed {speed:.1e}");
        let bound = if time < 412.5 { 1e-12 } else { 1e-9 };
        assert!(position < bound && speed < bound, "t = {time} s: position {position:e} m, speed {speed:e}");
    }
}
