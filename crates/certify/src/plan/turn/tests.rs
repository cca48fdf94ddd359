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
    least_with(team, PITCH, arc_ratio)
}

fn least_with(team: &Team, pitch: f64, arc_ratio: Option<f64>) -> LeastTurn {
    let found = least_turn(team, pitch, arc_ratio, &mut unreported).unwrap();
    println!("{found:?}");
    found
}

/// Asserts that a radius is enclosed within a nanometre, and a length. The radius is known to within `digits`.
fn encloses(found: &LeastTurn, radius: f64, digits: f64) {
    encloses_with(found, PITCH, radius, digits);
}

fn encloses_with(found: &LeastTurn, pitch: f64, radius: f64, digits: f64) {
    let (hi, a) = (found.value_hi.unwrap(), pitch / std::f64::consts::TAU);
    assert!(found.value_lo <= radius + digits && hi >= radius - digits, "{found:?}");
    assert!(found.proved && hi - found.value_lo <= 1e-9 && found.value == Some(hi), "{found:?}");
    let length = 2.0 * radius.hypot(a) * (radius / a).atan();
    assert!((found.length.unwrap() - length).abs() < 4e-9 + 4.0 * digits, "{found:?}");
}

/// Returns the least turn radius of a link with equal arcs: link / a = x + atan(1 / x), R = a x, by Newton's method.
fn of_equal_arcs(link: f64) -> f64 {
    let mut x = link / A;
    for _ in 0..60 {
        let slope = 1.0 - 1.0 / (1.0 + x * x);
        x -= (x + (1.0 / x).atan() - link / A) / slope;
    }
    A * x
}

#[test]
fn the_least_turn_of_equal_arcs_is_that_of_the_formula() {
    let radius = of_equal_arcs(2.86);
    assert!((radius - 2.834_249_482_15).abs() < 1e-11);
    let found = least(&TEAM, Some(1.0));
    encloses(&found, radius, 0.0);
    assert!((found.length.unwrap() - 8.402_592_135_74).abs() < 4e-9, "{found:?}");
    assert_eq!(found.limit.unwrap().bench_a, 0);
    // The best ratio is the corner at 1.
    assert_eq!(least(&TEAM, None), found);
}

#[test]
fn a_long_head_has_a_least_turn() {
    let team = Team { benches: 40, head_length: 30.0, ..TEAM };
    let found = least(&team, Some(1.0));
    encloses(&found, of_equal_arcs(29.45), 1e-13);
    assert_eq!(found.limit.unwrap().bench_a, 0);
    assert_eq!(least(&team, None), found);
}

/// The other search is `tests/python/least_turn.py PITCH LINK RATIO [BENCHES BODY_LINK INSET WIDTH]`.
#[test]
fn the_least_turns_of_small_pitches_are_those_of_another_search() {
    let (head_length, body_length) = (2.858_797_812_609_963_4, 1.129_623_834_955_691_3);
    let (width, hole_inset) = (0.709_611_512_447_701_9, 0.100_144_665_101_351_5);
    let team = Team { benches: 3, head_length, body_length, width, hole_inset, ends: Ends::NONE };
    let pitch = 0.118_065_039_656_572_54;
    let found = least_with(&team, pitch, Some(1.765_681_679_243_429_8));
    encloses_with(&found, pitch, 3.676_184_759_284, 2e-12);
    // Nearly all smaller radii are those of one stall on the inward spiral, at one place.
    assert!(found.intervals < 500, "{found:?}");
    let found = least_with(&Team { benches: 10, ..TEAM }, 1e-3, Some(1.0));
    encloses_with(&found, 1e-3, 3.530_197_802_855, 3e-11);
    assert_eq!(found.limit.map(|limit| (limit.bench_a, limit.bench_b)), Some((0, Some(9))));
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
