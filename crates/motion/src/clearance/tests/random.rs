//! The live method against all pairs, and the bounds of windows, on random teams and paths.

use std::cell::Cell;

use super::*;
use crate::cases::cases;
use crate::model::path::tests::any_path;
use crate::model::team::tests::{Factors, any_ends};
use proptest::test_runner::TestRunner;

fn any_team() -> impl Strategy<Value = Team> {
    let ends = prop_oneof![any_ends(), Just(Factors::default())];
    (3..90usize, 0.1..5.0f64, 0.1..5.0f64, any::<bool>(), 0.01..1.5f64, 0.0..1.0f64, ends).prop_map(
        |(benches, head, body, equal, width, hole_inset, ends)| {
            let long = |link: f64| link + 2.0 * hole_inset;
            ends.ends_of(Team {
                benches,
                head_length: long(if equal { body } else { head }),
                body_length: long(body),
                width,
                hole_inset,
                ends: Ends::NONE,
            })
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

/// Runs a check on random cases and returns the sum of its counts.
fn sum_over_cases<S: Strategy>(count: usize, strategy: S, check: impl Fn(S::Value) -> usize) -> usize {
    let checked = Cell::new(0);
    let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(count as u32) };
    let result = TestRunner::new(config).run(&strategy, |case| {
        checked.set(checked.get() + check(case));
        Ok(())
    });
    result.unwrap_or_else(|failure| panic!("{failure}"));
    checked.get()
}

#[test]
fn the_same_as_all_pairs_on_random_spirals() {
    let strategy = (any_team(), 0.05..3.0f64, 2.0..25.0f64, prop::collection::vec(0.0..1.0f64, 6));
    let count = cases(60) as usize;
    let compared = sum_over_cases(count, strategy, |(team, pitch, turns, places)| {
        let path = Path::spiral(pitch, turns);
        agree(team, &path, &frames(&path, &places)).0
    });
    assert!(compared > count * 24 / 2, "{compared} frames of random spirals");
}

#[test]
fn the_same_as_all_pairs_on_random_paths() {
    let strategy = (any_team(), any_lanes(), prop::collection::vec(0.0..1.0f64, 6));
    let count = cases(100) as usize;
    let compared =
        sum_over_cases(count, strategy, |(team, path, places)| agree(team, &path, &frames(&path, &places)).0);
    assert!(compared > count * 24 / 2, "{compared} frames on random paths");
}

#[test]
fn no_boards_are_nearer_than_the_bounds() {
    let strategy = (any_team(), any_lanes(), prop::collection::vec(0.0..1.0f64, 3));
    let close = Cell::new(0);
    let count = cases(100) as usize;
    let checked = sum_over_cases(count, strategy, |(team, path, places)| {
        let moments = places.iter().map(|place| check_bounds(&path, &team, place * path.length()));
        let moments = moments.fold((0, 0), |sum, (checked, close)| (sum.0 + checked, sum.1 + close));
        close.set(close.get() + moments.1);
        moments.0
    });
    assert!(checked > count * 21 / 2, "{checked} moments were in a window");
    // Without bounds the test would pass, too.
    assert!(close.get() > checked / 2, "{close:?} of {checked} moments had a close bound");
}
