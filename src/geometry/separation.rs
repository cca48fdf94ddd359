//! How far apart two boards are.
//!
//! **Sign.** Positive when they are apart, negative when they overlap, zero when they touch.
//!
//! Free functions, named by what they compare. The events and the clearance call them.

use super::rectangle::Board;
use super::{Point, Vector};

/// The clearance of two boards, and where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearance {
    /// The Euclidean distance when apart; minus the least translation that parts them when they overlap.
    pub value: f64,
    /// The point of the first board nearest to the second; when they overlap, the point of its edge or its corner by
    /// which they overlap least.
    pub point_a: Point,
    /// The same of the second board.
    pub point_b: Point,
}

/// An axis on which two boards are compared, and the gap between their shadows on it.
struct Axis {
    gap: f64,
    /// Unit, towards the second board.
    direction: Vector,
    /// Whether it is a normal of the first board's edges.
    of_first: bool,
}

/// The axis with the widest gap: separating axis theorem (Gottschalk, Lin, Manocha, OBBTree, 1996, section 5). For
/// rectangles the normals of their edges are enough.
fn widest_axis(a: &Board, b: &Board) -> Axis {
    let between = b.centre - a.centre;
    let (normal_a, normal_b) = (a.normal(), b.normal());
    // |cosine| and |sine| of the angle between the two boards, which all four shadows need.
    let cosine = a.axis.dot(&b.axis).abs();
    let sine = a.axis.dot(&normal_b).abs();
    let candidate = |axis: Vector, own: f64, other: f64, of_first: bool| {
        let offset = between.dot(&axis);
        let direction = if offset < 0.0 { -axis } else { axis };
        Axis { gap: offset.abs() - own - other, direction, of_first }
    };
    let (long_a, wide_a, long_b, wide_b) = (a.half_length, a.half_width, b.half_length, b.half_width);
    let axes = [
        candidate(a.axis, long_a, long_b * cosine + wide_b * sine, true),
        candidate(normal_a, wide_a, long_b * sine + wide_b * cosine, true),
        candidate(b.axis, long_b, long_a * cosine + wide_a * sine, false),
        candidate(normal_b, wide_b, long_a * sine + wide_a * cosine, false),
    ];
    axes.into_iter().reduce(|widest, axis| if axis.gap > widest.gap { axis } else { widest }).unwrap_or_else(|| {
        // Four axes never reduce to nothing.
        unreachable!()
    })
}

/// Signed separation by the separating axis theorem: the widest gap between the shadows of two boards. When they are
/// apart it is at most their distance, when they overlap minus the least translation that parts them.
pub fn separation_board_board(a: &Board, b: &Board) -> f64 {
    widest_axis(a, b).gap
}

/// The true clearance of two boards with the points at which it is taken.
pub fn clearance_board_board(a: &Board, b: &Board) -> Clearance {
    let widest = widest_axis(a, b);
    if widest.gap > 0.0 { distance(a, b) } else { penetration(a, b, &widest) }
}

/// Two convex polygons that are apart are nearest at a corner of one of them.
fn distance(a: &Board, b: &Board) -> Clearance {
    let mut best = Clearance { value: f64::INFINITY, point_a: a.centre, point_b: b.centre };
    for corner in a.corners() {
        let near = nearest_point(b, corner);
        let value = (corner - near).norm();
        if value < best.value {
            best = Clearance { value, point_a: corner, point_b: near };
        }
    }
    for corner in b.corners() {
        let near = nearest_point(a, corner);
        let value = (corner - near).norm();
        if value < best.value {
            best = Clearance { value, point_a: near, point_b: corner };
        }
    }
    best
}

/// The point of a board nearest to a point outside it.
fn nearest_point(board: &Board, point: Point) -> Point {
    let offset = point - board.centre;
    let along = offset.dot(&board.axis).clamp(-board.half_length, board.half_length);
    let across = offset.dot(&board.normal()).clamp(-board.half_width, board.half_width);
    board.centre + board.axis * along + board.normal() * across
}

/// The corner by which the one board reaches deepest into the other, and its place on the edge it came through.
fn penetration(a: &Board, b: &Board, axis: &Axis) -> Clearance {
    let extreme = |board: &Board, direction: Vector| {
        let normal = board.normal();
        board.centre
            + board.axis * board.half_length.copysign(board.axis.dot(&direction))
            + normal * board.half_width.copysign(normal.dot(&direction))
    };
    if axis.of_first {
        let corner = extreme(b, -axis.direction);
        Clearance { value: axis.gap, point_a: corner - axis.direction * axis.gap, point_b: corner }
    } else {
        let corner = extreme(a, axis.direction);
        Clearance { value: axis.gap, point_a: corner, point_b: corner + axis.direction * axis.gap }
    }
}

/// The centre of area of what two boards have in common; where that is nothing, the midpoint of their nearest points.
pub fn overlap_centre(a: &Board, b: &Board) -> Point {
    let mut polygon = a.corners().to_vec();
    for (normal, extent) in
        [(b.axis, b.half_length), (-b.axis, b.half_length), (b.normal(), b.half_width), (-b.normal(), b.half_width)]
    {
        polygon = clipped(&polygon, |point| extent - (point - b.centre).dot(&normal));
    }
    centroid(&polygon).unwrap_or_else(|| {
        let nearest = clearance_board_board(a, b);
        nalgebra::center(&nearest.point_a, &nearest.point_b)
    })
}

/// The part of a convex polygon where `inside` is not negative (Sutherland and Hodgman, 1974).
fn clipped(polygon: &[Point], inside: impl Fn(&Point) -> f64) -> Vec<Point> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (index, point) in polygon.iter().enumerate() {
        let next = &polygon[(index + 1) % polygon.len()];
        let (here, there) = (inside(point), inside(next));
        if here >= 0.0 {
            kept.push(*point);
        }
        if (here < 0.0) != (there < 0.0) {
            kept.push(point + (next - point) * (here / (here - there)));
        }
    }
    kept
}

/// The centre of area of a convex polygon, or `None` where it has no area.
fn centroid(polygon: &[Point]) -> Option<Point> {
    let origin = *polygon.first()?;
    let (mut area, mut moment) = (0.0, Vector::zeros());
    for pair in polygon.windows(2).skip(1) {
        let (one, other) = (pair[0] - origin, pair[1] - origin);
        let twice = one.perp(&other);
        area += twice;
        moment += (one + other) * (twice / 3.0);
    }
    (area > 0.0).then(|| origin + moment / area)
}
