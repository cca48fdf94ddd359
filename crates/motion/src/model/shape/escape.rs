//! The least translation that frees a board from a shape with which it overlaps.
//!
//! In the board's frame the board is the rectangle of half sides (h, w) about the origin. Moved by t it meets a side of
//! the shape if and only if t is in the side's Minkowski sum with the rectangle: a hexagon, the set
//! |x - m_x| <= h + |e_x| / 2, |y - m_y| <= w + |e_y| / 2, |n . (t - m)| <= h |n_x| + w |n_y|, with the side's middle m,
//! its vector e and its unit normal n. Moved by t it meets no side but lies within the shape if and only if its centre
//! does. So the places to avoid are the hexagons and the shape's interior, whose outline the hexagons cover. The least
//! translation leads to the nearest point of a hexagon's outline that is inside no other hexagon and not inside the
//! shape.

use super::{MOST_CORNERS, Rectangle, Shape, in_frame, nearest_of_segment};
use crate::model::Vector;
use crate::model::board::Board;

/// Depth within a hexagon, as a share of the board and the translation, up to which a point counts as outside.
const ROUNDING: f64 = 1e-12;

/// The places at which the rectangle meets a side.
#[derive(Debug, Clone, Copy, Default)]
struct Hexagon {
    middle: Vector,
    reach: Vector,
    normal: Vector,
    reach_along_normal: f64,
}

impl Hexagon {
    fn new(rectangle: &Rectangle, from: Vector, to: Vector) -> Self {
        let along = to - from;
        let length = along.norm();
        let normal = if length > 0.0 { Vector::new(-along.y, along.x) / length } else { Vector::x() };
        let half = rectangle.half;
        Self {
            middle: 0.5 * (from + to),
            reach: half + 0.5 * along.abs(),
            normal,
            reach_along_normal: half.dot(&normal.abs()),
        }
    }

    /// Returns the part of the segment from `from` to `to` that is inside by more than `depth`, as shares of it.
    fn covers(&self, from: Vector, to: Vector, depth: f64) -> Option<(f64, f64)> {
        let (offset, along) = (from - self.middle, to - from);
        let slabs = [
            (offset.x, along.x, self.reach.x),
            (offset.y, along.y, self.reach.y),
            (self.normal.dot(&offset), self.normal.dot(&along), self.reach_along_normal),
        ];
        let (mut low, mut high) = (0.0f64, 1.0f64);
        for (at, rate, reach) in slabs {
            let reach = reach - depth;
            if rate == 0.0 {
                if at.abs() >= reach {
                    return None;
                }
                continue;
            }
            let ends = [(-reach - at) / rate, (reach - at) / rate];
            (low, high) = (low.max(ends[0].min(ends[1])), high.min(ends[0].max(ends[1])));
        }
        (low < high).then_some((low, high))
    }
}

impl Shape {
    /// Returns the length of the least translation that frees a board, metres; infinite if there is none. The board and
    /// the shape overlap.
    pub(super) fn least_escape(&self, board: &Board) -> f64 {
        match self.convex {
            Some(sense) => self.convex_escape(board, sense),
            None => self.nearest_free(board),
        }
    }

    /// Returns the least escape from a convex shape: it is across one of the sides of the shape or of the board
    /// (separating axis theorem).
    fn convex_escape(&self, board: &Board, sense: f64) -> f64 {
        let half = Rectangle::of(board).half;
        let (mut low, mut high) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
        let mut least = f64::INFINITY;
        for (from, to) in self.sides() {
            let (from, to) = (in_frame(board, from), in_frame(board, to));
            for corner in [from, to] {
                (low, high) = (low.zip_map(&corner, f64::min), high.zip_map(&corner, f64::max));
            }
            let along = to - from;
            let reach = half.x * along.y.abs() + half.y * along.x.abs();
            // Positive if the side leads round the board's middle counter-clockwise.
            let offset = from.perp(&along);
            let escape = if sense == 0.0 { reach - offset.abs() } else { reach + sense * offset };
            least = least.min(escape / along.norm());
        }
        let beside = (half - low).zip_map(&(half + high), f64::min);
        least.min(beside.x).min(beside.y)
    }

    /// Returns the distance from the origin to the nearest free translation.
    fn nearest_free(&self, board: &Board) -> f64 {
        let rectangle = Rectangle::of(board);
        let mut hexagons = [Hexagon::default(); MOST_CORNERS];
        let mut count = 0;
        for ((from, to), hexagon) in self.sides().zip(&mut hexagons) {
            *hexagon = Hexagon::new(&rectangle, in_frame(board, from), in_frame(board, to));
            count += 1;
        }
        let mut best = f64::INFINITY;
        for (number, (from, to)) in self.sides().take(count).enumerate() {
            let corners = hexagon_corners(&rectangle, in_frame(board, from), in_frame(board, to));
            for k in 0..6 {
                let (begin, end) = (corners[k], corners[(k + 1) % 6]);
                if nearest_of_segment(Vector::zeros(), begin, end).norm() < best {
                    best = best.min(self.nearest_free_of(board, (&hexagons[..count], number), begin, end));
                }
            }
        }
        best
    }

    /// Returns the distance from the origin to the nearest free translation on one side of the hexagon with this
    /// number; infinite if none is free.
    fn nearest_free_of(&self, board: &Board, (hexagons, own): (&[Hexagon], usize), begin: Vector, end: Vector) -> f64 {
        let rectangle = Rectangle::of(board);
        let depth = ROUNDING * (rectangle.half.norm() + begin.norm().max(end.norm()));
        let mut covered = [(0.0, 0.0); MOST_CORNERS];
        let mut count = 0;
        for (_, hexagon) in hexagons.iter().enumerate().filter(|(number, _)| *number != own) {
            if let Some(part) = hexagon.covers(begin, end, depth) {
                if part == (0.0, 1.0) {
                    return f64::INFINITY;
                }
                covered[count] = part;
                count += 1;
            }
        }
        covered[..count].sort_unstable_by(|one, other| one.0.total_cmp(&other.0));
        let at = |share: f64| begin + share * (end - begin);
        let mut best = f64::INFINITY;
        let mut from = 0.0f64;
        for (low, high) in covered[..count].iter().copied().chain([(1.0, 1.0)]) {
            if low > from {
                let translation = nearest_of_segment(Vector::zeros(), at(from), at(low));
                let place = board.centre + translation.x * board.axis + translation.y * board.across();
                if translation.norm() < best && !self.holds(place) {
                    best = translation.norm();
                }
            }
            from = from.max(high);
        }
        best
    }
}

/// Returns the corners of the Minkowski sum of a segment and the rectangle, in order.
fn hexagon_corners(rectangle: &Rectangle, from: Vector, to: Vector) -> [Vector; 6] {
    let along = to - from;
    let (x, y) = (rectangle.half.x.copysign(along.x), rectangle.half.y.copysign(along.y));
    [
        from + Vector::new(-x, -y),
        from + Vector::new(x, -y),
        to + Vector::new(x, -y),
        to + Vector::new(x, y),
        to + Vector::new(-x, y),
        from + Vector::new(-x, y),
    ]
}
