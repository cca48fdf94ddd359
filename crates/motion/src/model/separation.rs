//! The distance of two boards. Every value is **positive apart, negative overlapping, zero touching**, in metres.
//!
//! - [`separation_board_board`]: the largest gap along an edge normal (the separating axis theorem). If the boards
//!   overlap, this is minus the least translation that parts them. If they are apart, it is at most their distance, and
//!   equal to it unless two corners are the nearest points.
//! - [`signed_distance_board_board`] (its points: [`closest_points_board_board`]): the Euclidean distance if the boards
//!   are apart, and the separation if they overlap.
//!
//! Positions are subtracted first, so the error is a few units in the last place of the boards' size and of their
//! distance, plus the rounding of the centres. Swapping the boards gives the same bits.

use super::board::Board;
use super::{Point, Vector};

/// One board in the other's frame: its centre along and across, and the cosine and sine of its turn.
#[derive(Clone, Copy)]
struct Relative {
    along: f64,
    across: f64,
    cosine: f64,
    sine: f64,
}

impl Relative {
    fn new(of: &Board, seen_from: &Board) -> Self {
        let offset = of.centre - seen_from.centre;
        let (own, other) = (seen_from.axis, of.axis);
        Self {
            along: own.x * offset.x + own.y * offset.y,
            across: own.x * offset.y - own.y * offset.x,
            cosine: own.x * other.x + own.y * other.y,
            sine: own.x * other.y - own.y * other.x,
        }
    }

    /// Returns the gaps along the frame's two axes between the frame's board and the other.
    fn gaps(&self, own: &Board, other: &Board) -> (f64, f64) {
        let (cosine, sine) = (self.cosine.abs(), self.sine.abs());
        let along = other.half_length * cosine + other.half_width * sine;
        let across = other.half_length * sine + other.half_width * cosine;
        (self.along.abs() - (own.half_length + along), self.across.abs() - (own.half_width + across))
    }

    /// Returns the other board's corners in the frame.
    fn corners(&self, other: &Board) -> [(f64, f64); 4] {
        let (lx, ly) = (other.half_length * self.cosine, other.half_length * self.sine);
        let (wx, wy) = (-other.half_width * self.sine, other.half_width * self.cosine);
        let (x, y) = (self.along, self.across);
        [
            (x + (lx + wx), y + (ly + wy)),
            (x - (lx - wx), y - (ly - wy)),
            (x - (lx + wx), y - (ly + wy)),
            (x + (lx - wx), y + (ly - wy)),
        ]
    }

    /// Returns the least squared distance from a corner of the other board to the frame's board.
    fn nearest_corner_squared(&self, own: &Board, other: &Board) -> f64 {
        let squared = |(x, y): (f64, f64)| {
            let dx = (x.abs() - own.half_length).max(0.0);
            let dy = (y.abs() - own.half_width).max(0.0);
            dx * dx + dy * dy
        };
        let [a, b, c, d] = self.corners(other).map(squared);
        a.min(b).min(c.min(d))
    }
}

/// Returns a lower bound of [`signed_distance_board_board`] from the circles about the boards, for callers that can
/// skip a pair.
pub fn circle_bound_board_board(a: &Board, b: &Board) -> f64 {
    (b.centre - a.centre).norm() - (a.circle_radius() + b.circle_radius())
}

/// Returns the signed separation by the separating axis theorem, in metres: never more than the clearance.
///
/// The normals of the Minkowski difference's edges are those of the boards. So the largest of the four gaps is minus
/// the least translation if all are negative (Ericson, Real-Time Collision Detection, section 4.4).
#[inline]
pub fn separation_board_board(a: &Board, b: &Board) -> f64 {
    let (along_a, across_a) = Relative::new(b, a).gaps(a, b);
    let (along_b, across_b) = Relative::new(a, b).gaps(b, a);
    along_a.max(across_a).max(along_b.max(across_b))
}

/// Returns the clearance, in metres: the Euclidean distance apart, minus the least translation that parts the boards
/// overlapping.
///
/// The nearest points of two convex polygons that are apart include a corner of one of them.
#[inline]
pub fn signed_distance_board_board(a: &Board, b: &Board) -> f64 {
    let separation = separation_board_board(a, b);
    if separation <= 0.0 {
        return separation;
    }
    let from_a = Relative::new(b, a).nearest_corner_squared(a, b);
    let from_b = Relative::new(a, b).nearest_corner_squared(b, a);
    // Rounding must not make the distance less than its lower bound, nor a gap a touch.
    from_a.min(from_b).sqrt().max(separation)
}

/// Returns the two closest points, the first on `a`, the second on `b`.
///
/// Overlapping: the deepest pair, a corner inside and the point of the other board's edge through which the least
/// translation takes it out.
pub fn closest_points_board_board(a: &Board, b: &Board) -> (Point, Point) {
    let to_b = Relative::new(b, a);
    let to_a = Relative::new(a, b);
    if separation_board_board(a, b) > 0.0 {
        let (squared_a, of_a, corner_of_b) = nearest_to_corner(&to_b, a, b);
        let (squared_b, of_b, corner_of_a) = nearest_to_corner(&to_a, b, a);
        return if squared_a <= squared_b { (of_a, corner_of_b) } else { (corner_of_a, of_b) };
    }
    let (along_a, across_a) = to_b.gaps(a, b);
    let (along_b, across_b) = to_a.gaps(b, a);
    if along_a.max(across_a) >= along_b.max(across_b) {
        deepest(&to_b, a, b)
    } else {
        let (on_b, on_a) = deepest(&to_a, b, a);
        (on_a, on_b)
    }
}

fn in_stage(board: &Board, along: f64, across: f64) -> Point {
    board.centre + along * board.axis + across * board.across()
}

/// Returns the least squared distance of a corner of `other` to `own`, the point of `own`, and that corner.
fn nearest_to_corner(relative: &Relative, own: &Board, other: &Board) -> (f64, Point, Point) {
    let mut best = (f64::INFINITY, own.centre, other.centre);
    for ((x, y), corner) in relative.corners(other).into_iter().zip(other.corners()) {
        let (dx, dy) = ((x.abs() - own.half_length).max(0.0), (y.abs() - own.half_width).max(0.0));
        let squared = dx * dx + dy * dy;
        if squared < best.0 {
            let on_own =
                in_stage(own, x.clamp(-own.half_length, own.half_length), y.clamp(-own.half_width, own.half_width));
            best = (squared, on_own, corner);
        }
    }
    best
}

/// Returns the point of `own`'s edge and the deepest point of `other` under it, for the smaller overlap along `own`'s
/// axes.
fn deepest(relative: &Relative, own: &Board, other: &Board) -> (Point, Point) {
    let (along, across) = relative.gaps(own, other);
    let corners = relative.corners(other);
    // Where an edge of `other` is parallel to the edge of `own`, the clamped corner slides along it.
    if along >= across {
        let side = 1f64.copysign(relative.along);
        let (_, y) = corners.into_iter().min_by(|p, q| (side * p.0).total_cmp(&(side * q.0))).unwrap_or_default();
        let (x, y) = (side * own.half_length, y.clamp(-own.half_width, own.half_width));
        (in_stage(own, x, y), in_stage(own, x + side * along, y))
    } else {
        let side = 1f64.copysign(relative.across);
        let (x, _) = corners.into_iter().min_by(|p, q| (side * p.1).total_cmp(&(side * q.1))).unwrap_or_default();
        let (x, y) = (x.clamp(-own.half_length, own.half_length), side * own.half_width);
        (in_stage(own, x, y), in_stage(own, x, y + side * across))
    }
}

/// Returns the middle of the [closest points](closest_points_board_board) of two boards.
pub fn middle_between(a: &Board, b: &Board) -> Point {
    let (on_a, on_b) = closest_points_board_board(a, b);
    nalgebra::center(&on_a, &on_b)
}

/// Returns the centre of area of the overlap of two boards; without overlap, the middle of their closest points.
///
/// One board is clipped by the other's four edges (Sutherland and Hodgman, 1974). The result is the centroid of the
/// polygon, or the middle of the touching points if the boards only touch.
pub fn overlap_centre(a: &Board, b: &Board) -> Point {
    if separation_board_board(a, b) > 0.0 {
        return middle_between(a, b);
    }
    // Each of the four half-planes can add one corner.
    let mut polygon = [Vector::zeros(); 8];
    let relative = Relative::new(b, a);
    for (corner, (x, y)) in polygon.iter_mut().zip(relative.corners(b)) {
        *corner = Vector::new(x, y);
    }
    let mut count = 4;
    let planes = [
        (Vector::x(), a.half_length),
        (-Vector::x(), a.half_length),
        (Vector::y(), a.half_width),
        (-Vector::y(), a.half_width),
    ];
    for (normal, offset) in planes {
        count = clip(&mut polygon, count, normal, offset);
    }
    if count == 0 {
        // The boards touch to the last digit, and rounding removed the polygon.
        return middle_between(a, b);
    }
    let centre = centroid(&polygon[..count]);
    in_stage(a, centre.x, centre.y)
}

/// Keeps the part of the polygon of the first `count` corners with `normal` . p <= `offset`. Returns the new count.
fn clip(polygon: &mut [Vector; 8], count: usize, normal: Vector, offset: f64) -> usize {
    let before = *polygon;
    let mut kept = 0;
    let mut push = |corner| {
        // A convex polygon gains at most one corner per half-plane; rounding may give more once it is a sliver.
        if kept < polygon.len() {
            polygon[kept] = corner;
            kept += 1;
        }
    };
    for k in 0..count {
        let (from, to) = (before[k], before[(k + 1) % count]);
        let (out, next_out) = (normal.dot(&from) - offset, normal.dot(&to) - offset);
        if out <= 0.0 {
            push(from);
        }
        if (out < 0.0 && next_out > 0.0) || (out > 0.0 && next_out < 0.0) {
            push(from + (to - from) * (out / (out - next_out)));
        }
    }
    kept
}

fn centroid(polygon: &[Vector]) -> Vector {
    let origin = polygon[0];
    let (mut doubled_area, mut moment) = (0.0, Vector::zeros());
    for pair in polygon[1..].windows(2) {
        let (p, q) = (pair[0] - origin, pair[1] - origin);
        let area = p.x * q.y - p.y * q.x;
        doubled_area += area;
        moment += area * (p + q);
    }
    let centre = origin + moment / (3.0 * doubled_area);
    if centre.x.is_finite() && centre.y.is_finite() && doubled_area > 0.0 {
        centre
    } else {
        polygon.iter().sum::<Vector>() / polygon.len() as f64
    }
}

#[cfg(test)]
mod tests;
