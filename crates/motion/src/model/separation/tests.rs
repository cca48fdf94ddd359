//! The separation of two boards against parry2d and against its own definition.

use std::f64::consts::TAU;

use super::*;
use crate::cases::cases;
use parry2d_f64::math::Pose;
use parry2d_f64::query;
use parry2d_f64::shape::Cuboid;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

fn board(x: f64, y: f64, heading: f64, half_length: f64, half_width: f64) -> Board {
    Board { centre: Point::new(x, y), axis: Vector::new(heading.cos(), heading.sin()), half_length, half_width }
}

/// Returns the distance by parry, 0 if the boards overlap. The distance is computed near the origin and in units of
/// `size`, because parry's thresholds are absolute.
fn parry_distance(a: &Board, b: &Board, size: f64) -> f64 {
    let shape = |board: &Board| Cuboid::new([board.half_length / size, board.half_width / size].into());
    let pose = |board: &Board, at: Vector| Pose::new([at.x, at.y].into(), board.axis.y.atan2(board.axis.x));
    let (pose_a, pose_b) = (pose(a, Vector::zeros()), pose(b, (b.centre - a.centre) / size));
    query::distance(&pose_a, &shape(a), &pose_b, &shape(b)).unwrap().distance * size
}

/// The translation along our deepest pair separates the boards, and no tried direction needs less, by parry. Parry's
/// own depths are wrong if a corner is nearer to another edge than to the edge that it crossed.
fn check_depth(a: &Board, b: &Board, ours: f64, size: f64) {
    let (on_a, on_b) = closest_points_board_board(a, b);
    let out = (on_a - on_b).normalize();
    let moved = |by: Vector| Board { centre: b.centre + by, ..*b };
    let gap = 1e-6 * size;
    let parted = parry_distance(a, &moved(out * (gap - ours)), size);
    assert!((parted - gap).abs() < 1e-9 * size, "{a:?} {b:?} {ours} {parted}");
    for k in 0..16 {
        let (sine, cosine) = (TAU * f64::from(k) / 16.0).sin_cos();
        let less = moved(Vector::new(cosine, sine) * (-ours - gap));
        assert!(-ours < gap || parry_distance(a, &less, size) < 1e-9 * size, "{a:?} {b:?} {ours} {k}");
    }
}

/// Computes one pair with both; `size` is the scale of all lengths. Returns true if the boards overlap.
fn compare(a: &Board, b: &Board, size: f64) -> bool {
    let tolerance = 1e-12 * size;
    // Rounding of the stage's coordinates, far from the origin.
    let lost = tolerance + 8.0 * f64::EPSILON * (a.centre.coords.norm() + b.centre.coords.norm());
    let ours = signed_distance_board_board(a, b);
    let separation = separation_board_board(a, b);
    let distance = parry_distance(a, b, size);
    let message = format!("{a:?} {b:?} ours {ours}, separation {separation}, parry {distance}");
    assert!((ours.max(0.0) - distance).abs() <= tolerance, "{message}");
    assert!(separation <= ours && (separation > 0.0) == (ours > 0.0), "{message}");
    assert!(circle_bound_board_board(a, b) <= ours + tolerance, "{message}");
    if ours < -1e-9 * size && lost < 1e-11 * size {
        check_depth(a, b, ours, size);
    }
    assert_eq!(ours, signed_distance_board_board(b, a), "{message}");
    let (on_a, on_b) = closest_points_board_board(a, b);
    assert!(((on_a - on_b).norm() - ours.abs()).abs() <= lost, "{message} {on_a} {on_b}");
    for (point, board) in [(on_a, a), (on_b, b)] {
        let offset = point - board.centre;
        assert!(offset.dot(&board.axis).abs() <= board.half_length + lost, "{message} {point}");
        assert!(offset.dot(&board.across()).abs() <= board.half_width + lost, "{message} {point}");
    }
    if ours <= 0.0 {
        let centre = overlap_centre(a, b);
        for board in [a, b] {
            let offset = centre - board.centre;
            assert!(offset.dot(&board.axis).abs() <= board.half_length + lost, "{message} {centre}");
            assert!(offset.dot(&board.across()).abs() <= board.half_width + lost, "{message} {centre}");
        }
    }
    ours < 0.0
}

#[test]
fn parry_agrees_on_random_pairs() {
    // A million take seconds optimised.
    let pairs = cases(1_000_000) as usize;
    let mut random = TestRunner::default().new_rng();
    let mut unit = || random.next_u64() as f64 / u64::MAX as f64;
    let (mut overlapping, mut apart) = (0, 0);
    for k in 0..pairs {
        let size = [1.0, 1e-3, 1e4, 1e-9, 1e9][k % 5];
        let from_origin = if k % 3 == 0 { 1e6 * size } else { 0.0 };
        let ratio = if k % 7 == 0 { 30.0 } else { 3.0 };
        let first = board(from_origin * unit(), from_origin * unit(), 6.3 * unit(), size * unit(), size * unit());
        let second = board(
            first.centre.x + ratio * size * (unit() - 0.5),
            first.centre.y + ratio * size * (unit() - 0.5),
            6.3 * unit(),
            size * unit(),
            size * unit(),
        );
        let hit = compare(&first, &second, ratio * size);
        overlapping += usize::from(hit);
        apart += usize::from(!hit);
        // The same pair, moved along the line of its nearest points until it nearly touches, from both sides.
        if k % 4 == 0 && from_origin == 0.0 {
            let (on_a, on_b) = closest_points_board_board(&first, &second);
            let towards = (on_a - on_b) * (1.0 + 1e-13 * (unit() - 0.5)) + Vector::new(1.0, 1.0) * 1e-15 * size;
            compare(&first, &Board { centre: second.centre + towards, ..second }, ratio * size);
        }
        // One within the other.
        if k % 11 == 0 {
            compare(&first, &Board { half_length: 0.01 * size, centre: first.centre, ..second }, ratio * size);
        }
    }
    assert!(overlapping > pairs / 10 && apart > pairs / 10, "{overlapping} {apart}");
}

#[test]
fn known_pairs() {
    let square = board(0.0, 0.0, 0.0, 1.0, 1.0);
    // Corner to corner, 3-4-5.
    let corner = board(5.0, 6.0, 0.0, 1.0, 1.0);
    assert_eq!(signed_distance_board_board(&square, &corner), 5.0);
    assert_eq!(separation_board_board(&square, &corner), 4.0);
    assert_eq!(closest_points_board_board(&square, &corner), (Point::new(1.0, 1.0), Point::new(4.0, 5.0)));
    // Touching, and a hundredth deep.
    assert_eq!(signed_distance_board_board(&square, &board(2.0, 0.0, 0.0, 1.0, 1.0)), 0.0);
    let deep = board(1.75, 1.0, 0.0, 1.0, 1.0);
    assert_eq!(signed_distance_board_board(&square, &deep), -0.25);
    assert_eq!(overlap_centre(&square, &deep), Point::new(0.875, 0.5));
    assert_eq!(overlap_centre(&square, &corner), Point::new(2.5, 3.0));
}

fn any_board() -> impl Strategy<Value = Board> {
    (-2.0..2.0f64, -2.0..2.0f64, 0.0..6.3f64, 0.01..2.0f64, 0.01..1.0f64)
        .prop_map(|(x, y, heading, length, width)| board(x, y, heading, length, width))
}

proptest! {
    #[test]
    fn symmetric_and_blind_to_where_the_stage_is(
        a in any_board(), b in any_board(), turn in 0.0..6.3f64, x in -50.0..50.0f64, y in -50.0..50.0f64,
    ) {
        let rotation = nalgebra::Rotation2::new(turn);
        let moved = |board: Board| Board {
            centre: rotation * board.centre + Vector::new(x, y), axis: rotation * board.axis, ..board
        };
        for query in [separation_board_board, signed_distance_board_board] {
            prop_assert_eq!(query(&a, &b), query(&b, &a));
            prop_assert!((query(&a, &b) - query(&moved(a), &moved(b))).abs() < 1e-13);
        }
    }

    #[test]
    fn the_overlap_centre_is_the_mean_of_what_both_hold(a in any_board(), b in any_board()) {
        let inside = |board: &Board, p: Point| {
            let offset = p - board.centre;
            offset.dot(&board.axis).abs() <= board.half_length && offset.dot(&board.across()).abs() <= board.half_width
        };
        let (mut count, mut sum) = (0.0, Vector::zeros());
        for i in 0..200 {
            for j in 0..200 {
                let p = a.centre
                    + a.axis * a.half_length * ((i as f64 + 0.5) / 100.0 - 1.0)
                    + a.across() * a.half_width * ((j as f64 + 0.5) / 100.0 - 1.0);
                if inside(&b, p) { count += 1.0; sum += p.coords; }
            }
        }
        if count > 200.0 {
            let centre = overlap_centre(&a, &b);
            prop_assert!((centre.coords - sum / count).norm() < 0.05 * a.circle_radius());
        }
    }
}
