//! Paths of every kind and their common properties: one suite for all.

use super::*;
use crate::model::description::{PathDescription, RouteStep};
use proptest::prelude::*;

/// Spirals of a route, of at most three turns, that end at least a twentieth of their first radius from the centre.
pub(crate) fn any_spiral() -> impl Strategy<Value = RouteStep> {
    let sides = prop_oneof![Just(Side::Left), Just(Side::Right)];
    let directions = prop_oneof![Just(Direction::Inward), Just(Direction::Outward)];
    (sides, directions, 0.3..2.0f64, 1.0..6.0f64, 0.01..0.95f64).prop_map(|(side, direction, pitch, radius, share)| {
        let turns = (share * radius / pitch).min(3.0);
        RouteStep::Spiral { side, direction, pitch, radius: radius.into(), turns: turns.into() }
    })
}

/// Paths of every kind, their sizes a few metres.
pub(crate) fn any_path() -> impl Strategy<Value = Path> {
    let spiral =
        (0.3..2.0f64, 3.0..9.0f64).prop_map(|(pitch, start_turn)| PathDescription::Spiral { pitch, start_turn });
    let turnaround = (0.4..3.0f64, 1.5..6.0f64, 0.2..5.0f64).prop_map(|(pitch, turns, arc_ratio)| {
        let turn_radius = pitch * turns;
        PathDescription::Turnaround { pitch, turn_radius, arc_ratio, lead_in: 40.0, lead_out: 40.0 }
    });
    let step = (0.5..8.0f64, 0.05..0.7f64, any::<bool>(), any::<bool>()).prop_map(|(size, turns, left, line)| {
        let side = if left { Side::Left } else { Side::Right };
        if line {
            RouteStep::Line { length: size }
        } else {
            RouteStep::Arc { side, radius: (0.5 * size).into(), turns: turns.into() }
        }
    });
    let route = prop::collection::vec(prop_oneof![2 => step, 1 => any_spiral()], 2..8)
        .prop_map(|steps| PathDescription::Route { heading_turns: 0.3, steps });
    prop_oneof![spiral, turnaround, route].prop_map(|description| description.path().unwrap())
}

/// Returns the error bound of a place, in metres: the promise for positions of a path a few metres from its origin.
fn rounding(travelled: f64) -> f64 {
    8.0 * f64::EPSILON * (100.0 + travelled.abs())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Place and travel are inverse functions, and a path is travelled by its arc length.
    #[test]
    fn place_and_travel_are_inverse(path in any_path(), share in -0.5..0.99f64, step in 1e-6..1e-3f64) {
        let travelled = share * path.length();
        let param = path.param_at(travelled);
        prop_assert!((path.travelled(param) - travelled).abs() < 1e-13 * (1.0 + travelled.abs()));
        let ahead = path.param_at(travelled + step);
        let rounding = rounding(travelled);
        prop_assert!((path.arc_length(param, ahead) - step).abs() < rounding);
        prop_assert!((path.arc_length(ahead, param) + path.arc_length(param, ahead)).abs() < 1e-16);
        // A chord is shorter than its arc by k^2 h^3 / 24 at most.
        let chord = (path.point(ahead) - path.point(param)).norm();
        let curvature = path.max_curvature_between(travelled, travelled + step);
        prop_assert!(chord <= step + rounding && chord >= step * (1.0 - (curvature * step).powi(2)) - rounding);
    }

    /// No gap and no corner: everywhere, junctions included, the direction turns by no more than the curvature allows.
    #[test]
    fn tangents_turn_by_the_curvature(
        path in any_path(), share in -0.5..0.99f64, junction in any::<prop::sample::Index>(),
    ) {
        let junctions: Vec<f64> = path.junctions().collect();
        let step = 1e-5;
        let at_junction = (!junctions.is_empty()).then(|| junctions[junction.index(junctions.len())] - 0.5 * step);
        for travelled in [Some(share * path.length()), at_junction].into_iter().flatten() {
            let [before, after] = [travelled, travelled + step].map(|at| path.param_at(at));
            let turned = path.tangent(before).perp(&path.tangent(after)).abs();
            let curvature = path.max_curvature_between(travelled, travelled + step);
            prop_assert!(turned <= curvature * step * (1.0 + 1e-6) + 1e-14, "{turned} {curvature}");
            let along = (path.point(after) - path.point(before)).dot(&path.tangent(before)) / step;
            prop_assert!((along - 1.0).abs() <= (curvature * step).powi(2) + rounding(travelled) / step);
        }
    }
}

/// The length is the same for every ratio of the arcs, to the digits of the 50-digit figure.
#[test]
fn a_turn_is_as_long_whatever_its_ratio() {
    for arc_ratio in [1.0, 2.0, 3.0] {
        let path = Path::turnaround(1.7, 4.5, arc_ratio, 100.0, 369.16).unwrap();
        let begins: Vec<f64> = path.junctions().collect();
        assert!((begins[2] - begins[0] - 13.621_244_906_821_123).abs() < 4e-14, "{begins:?}");
        assert!((path.length() - begins[2] - 369.16).abs() < 1e-12);
    }
}

/// A long approach to a narrow bend costs the join no digits.
#[test]
fn long_lines_join_narrow_arcs() {
    for (length, radius) in [(1000.0, 0.01), (9000.0, 0.5), (777.7, 0.05)] {
        let route = Path::route(0.0).line(length).arc(Side::Left, radius, 0.25).line(1.0);
        assert!(route.build().is_ok(), "{length} m, {radius} m");
    }
}

/// The way out is the way in, turned by half a turn and run backwards.
#[test]
fn the_way_out_mirrors_the_way_in() {
    let path = Path::turnaround(1.7, 4.5, 2.0, 100.0, 100.0).unwrap();
    let begins: Vec<f64> = path.junctions().collect();
    for distance in [0.0, 0.3, 17.0, 90.0] {
        let (inward, outward) = (path.param_at(begins[0] - distance), path.param_at(begins[2] + distance));
        assert!((path.point(inward).coords + path.point(outward).coords).norm() < 1e-13);
        assert!((path.tangent(inward) - path.tangent(outward)).norm() < 1e-13);
    }
}

proptest! {
    /// A disc about a point of a segment can be met, and one farther away than the path is long cannot.
    #[test]
    fn circles_hold_their_segments(path in any_path(), share in 0.0..1.0f64, angle in 0.0..6.3f64, away in 0.0..9.0f64) {
        let at = path.param_at(share * path.length());
        let off = Vector::new(angle.cos(), angle.sin());
        prop_assert!(path.can_meet(at.segment, path.point(at) + away * off, away));
        let far = path.point(at) + (path.length() + away) * 2.0 * off;
        let later = (1..path.segments()).any(|segment| path.can_meet(segment, far, away));
        prop_assert!(!later, "a disc that no segment reaches");
    }
}
