//! The least turn of the paper's team: against the formula for equal arcs, and against another search for other ratios
//! and for wider boards.

use super::{LeastTurn, least_turn};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::event::unreported;
use bench_dragon_motion::model::team::{Ends, Team};

const TEAM: Team =
    Team { benches: 223, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275, ends: Ends::NONE };
const PITCH: f64 = 1.7;
const A: f64 = PITCH / std::f64::consts::TAU;

fn least(team: &Team, arc_ratio: Option<f64>) -> LeastTurn {
    let found = least_turn(team, PITCH, arc_ratio, &mut unreported).unwrap();
    println!("{found:?}");
    found
}

/// Asserts that a radius is enclosed within a nanometre, and a length. The radius is known to within `digits`.
fn encloses(found: &LeastTurn, radius: f64, digits: f64) {
    let hi = found.value_hi.unwrap();
    assert!(found.value_lo <= radius + digits && hi >= radius - digits, "{found:?}");
    assert!(found.proved && hi - found.value_lo <= 1e-9 && found.value == Some(hi), "{found:?}");
    let length = 2.0 * radius.hypot(A) * (radius / A).atan();
    assert!((found.length.unwrap() - length).abs() < 4e-9 + 4.0 * digits, "{found:?}");
}

#[test]
fn the_least_turn_of_equal_arcs_is_that_of_the_formula() {
    // 2.86 / a = x + atan(1 / x), R = a x, by Newton's method.
    let mut x = 2.86 / A;
    for _ in 0..60 {
        let slope = 1.0 - 1.0 / (1.0 + x * x);
        x -= (x + (1.0 / x).atan() - 2.86 / A) / slope;
    }
    assert!((A * x - 2.834_249_482_15).abs() < 1e-11);
    let found = least(&TEAM, Some(1.0));
    encloses(&found, A * x, 0.0);
    assert!((found.length.unwrap() - 8.402_592_135_74).abs() < 4e-9, "{found:?}");
    assert_eq!(found.limit.unwrap().bench_a, 0);
    // The best ratio is the corner at 1.
    assert_eq!(least(&TEAM, None), found);
}

/// The other search is `tests/python/least_turn.py 1.7 2.86 RATIO`. The path reversed is that of the reciprocal ratio,
/// and swaps stall and lock.
#[test]
fn the_least_turns_with_a_lock_or_a_stall_are_those_of_another_search() {
    let cases = [
        (2.0, 4.269_997_211_336, EventKind::Lock),
        (0.5, 4.269_997_211_336, EventKind::Stall),
        (1.5, 3.552_348_981_005, EventKind::Lock),
    ];
    for (ratio, radius, kind) in cases {
        let found = least(&TEAM, Some(ratio));
        encloses(&found, radius, 2e-11);
        let limit = found.limit.unwrap();
        assert_eq!((limit.kind, limit.bench_a, limit.bench_b), (kind, 0, None));
    }
}

/// The other search is `tests/python/least_turn.py 1.7 2.86 RATIO 12 1.65 0.275 1.3`.
#[test]
fn the_least_turns_with_a_contact_are_those_of_another_search() {
    let team = Team { benches: 12, width: 1.3, ..TEAM };
    for (ratio, radius) in [(2.0, 4.470_396_276_098), (1.0, 4.043_801_529_705)] {
        let found = least(&team, Some(ratio));
        encloses(&found, radius, 2e-11);
        let limit = found.limit.unwrap();
        assert_eq!((limit.kind, limit.bench_a, limit.bench_b), (EventKind::Contact, 0, Some(11)));
    }
}
