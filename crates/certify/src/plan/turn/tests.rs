//! The least turn of the paper's team, against the formula for equal arcs.

use super::{LeastTurn, least_turn};
use bench_dragon_motion::model::team::Team;

const TEAM: Team = Team { benches: 223, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275 };
const PITCH: f64 = 1.7;

fn least(team: &Team, arc_ratio: Option<f64>) -> LeastTurn {
    let found = least_turn(team, PITCH, arc_ratio, &mut |_| ()).unwrap();
    println!("{found:?}");
    found
}

/// Asserts that a radius and a length are enclosed, the radius from below within 1e-8 m.
fn encloses(found: &LeastTurn, radius: f64, digits: f64, length: f64) {
    let hi = found.value_hi.unwrap();
    assert!(found.value_lo <= radius + digits && hi >= radius - digits, "{found:?}");
    assert!(radius - found.value_lo <= 1e-8 + digits && hi - radius <= 1e-5, "{found:?}");
    assert!((found.value.unwrap() - radius).abs() <= 1e-8 + digits, "{found:?}");
    assert!((found.length.unwrap() - length).abs() < 4e-8 + 4.0 * digits, "{found:?}");
}

#[test]
fn the_least_turn_of_equal_arcs_is_that_of_the_formula() {
    // 2.86 / a = x + atan(1 / x), R = a x, by Newton's method.
    let a = PITCH / std::f64::consts::TAU;
    let mut x = 2.86 / a;
    for _ in 0..60 {
        let slope = 1.0 - 1.0 / (1.0 + x * x);
        x -= (x + (1.0 / x).atan() - 2.86 / a) / slope;
    }
    assert!((a * x - 2.834_249_482_15).abs() < 1e-11);
    let found = least(&TEAM, Some(1.0));
    encloses(&found, a * x, 0.0, 8.402_592_135_74);
    assert_eq!(found.limit.unwrap().bench_a, 0);
    // The best ratio is the corner at 1.
    assert_eq!(least(&TEAM, None), found);
}
