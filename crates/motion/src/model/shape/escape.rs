//! The least translation that frees a board from a shape with which it overlaps.
//!
//! In the board's frame the board is the rectangle of half sides (h, w) about the origin. Moved by t it meets a side of
//! the shape if and only if t is in the side's Minkowski sum with the rectangle: a hexagon, the set
//! |x - m_x| <= h + |e_x| / 2, |y - m_y| <= w + |e_y| / 2, |n . (t - m)| <= h |n_x| + w |n_y|, with the side's middle m,
//! its vector e and its unit normal n. Moved by t it meets no side but lies within the shape if and only if its centre
//! does. So the places to avoid are the hexagons and the shape's interior, whose outline the hexagons cover. The least
//! translation leads to the nearest point of a hexagon's outline that is inside no other hexagon and not inside the
//! shape.

use super::{MOST_CORNERS, Rectangle, Shape, ShapeKind, in_frame, nearest_of_segment};
use crate::model::Vector;
use crate::model::board::Board;

/// Depth within a hexagon, as a share of the board and the translation, up to which a point counts as outside.
const ROUNDING: f64 = 1e-12;

/// The greatest number of segments of an outline: of a line, two along each side and three round each corner.
const MOST_SEGMENTS: usize = 5 * MOST_CORNERS;

/// As many corners as most shapes have, and their segments.
const FEW_CORNERS: usize = 16;
const FEW_SEGMENTS: usize = 5 * FEW_CORNERS;

/// The places at which the rectangle meets a side.
#[derive(Debug, Clone, Copy, Default)]
struct Hexagon {
    middle: Vector,
    reach: Vector,
    normal: Vector,
    reach_along_normal: f64,
}

impl Hexagon {
    fn new(half: Vector, from: Vector, to: Vector) -> Self {
        let along = to - from;
        let length = along.norm();
        let normal = if length > 0.0 { Vector::new(-along.y, along.x) / length } else { Vector::x() };
        Self {
            middle: 0.5 * (from + to),
            reach: half + 0.5 * along.abs(),
            normal,
            reach_along_normal: half.dot(&normal.abs()),
        }
    }

    /// Returns the part of a segment that is inside by more than `depth`, as shares of it.
    #[inline]
    fn covers(&self, segment: &Segment, depth: f64) -> Option<(f64, f64)> {
        let (offset, along) = (segment.from - self.middle, segment.to - segment.from);
        let reach = self.reach.map(|reach| reach - depth);
        let (mut low, mut high) = (0.0f64, 1.0f64);
        for (at, rate, reach) in [
            (offset.x, along.x, reach.x),
            (offset.y, along.y, reach.y),
            (self.normal.dot(&offset), self.normal.dot(&along), self.reach_along_normal - depth),
        ] {
            if at.min(at + rate) >= reach || at.max(at + rate) <= -reach {
                return None;
            }
            // Most segments pass through a hexagon from end to end, or beside it.
            if at.abs().max((at + rate).abs()) > reach {
                let (one, other) = ((-reach - at) / rate, (reach - at) / rate);
                (low, high) = (low.max(one.min(other)), high.min(one.max(other)));
            }
        }
        (low < high).then_some((low, high))
    }
}

/// A segment of places to which the board can be moved, with the squared distance from the origin to it.
#[derive(Debug, Clone, Copy, Default)]
struct Segment {
    from: Vector,
    to: Vector,
    squared: f64,
}

/// The segments of which the outline of the places to avoid consists.
struct Outline<'s> {
    segments: &'s mut [Segment],
    count: usize,
}

impl Outline<'_> {
    fn add(&mut self, from: Vector, to: Vector) {
        let squared = nearest_of_segment(Vector::zeros(), from, to).norm_squared();
        self.segments[self.count] = Segment { from, to, squared };
        self.count += 1;
    }

    /// Adds the places at which the board slides along a side, on the left of it or on the right.
    fn add_along(&mut self, half: Vector, from: Vector, to: Vector, sense: f64) {
        let outward = sense * Vector::new(to.y - from.y, from.x - to.x);
        let corner = half.zip_map(&outward, f64::copysign);
        self.add(from + corner, to + corner);
    }

    /// Adds the places at which an edge of the board slides over a corner, from which the sides lead to `neighbours`.
    /// Beyond an edge towards which one of the sides leads, the board meets that side.
    fn add_round(&mut self, half: Vector, at: Vector, neighbours: &[Vector]) {
        let (low, high) = (at - half, at + half);
        let leads = |towards: fn(&Vector, &Vector) -> bool| neighbours.iter().any(|next| towards(next, &at));
        let corner = |x, y| Vector::new(x, y);
        if !leads(|next, at| next.x > at.x) {
            self.add(corner(high.x, low.y), high);
        }
        if !leads(|next, at| next.y > at.y) {
            self.add(high, corner(low.x, high.y));
        }
        if !leads(|next, at| next.x < at.x) {
            self.add(corner(low.x, high.y), low);
        }
        if !leads(|next, at| next.y < at.y) {
            self.add(low, corner(high.x, low.y));
        }
    }

    /// Takes out the segment that is nearest to the origin, if the square of its distance is below `limit`.
    fn take_nearest(&mut self, limit: f64) -> Option<Segment> {
        let segments = &self.segments[..self.count];
        let mut nearest = (limit, None);
        for (number, segment) in segments.iter().enumerate() {
            if segment.squared < nearest.0 {
                nearest = (segment.squared, Some(number));
            }
        }
        let number = nearest.1?;
        let taken = segments[number];
        self.count -= 1;
        self.segments[number] = self.segments[self.count];
        Some(taken)
    }
}

impl Shape {
    /// Returns the length of the least translation that frees a board, metres; infinite if there is none. The board and
    /// the shape overlap.
    pub(super) fn least_escape(&self, board: &Board) -> f64 {
        match self.convex {
            Some(sense) => self.convex_escape(board, sense),
            // Smaller arrays take less time to prepare.
            None if self.points.len() <= FEW_CORNERS => self.nearest_free::<FEW_CORNERS, FEW_SEGMENTS>(board),
            None => self.nearest_free::<MOST_CORNERS, MOST_SEGMENTS>(board),
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
    fn nearest_free<const CORNERS: usize, const SEGMENTS: usize>(&self, board: &Board) -> f64 {
        let half = Rectangle::of(board).half;
        let mut corners = [Vector::zeros(); CORNERS];
        for (corner, point) in corners.iter_mut().zip(&self.points) {
            *corner = in_frame(board, *point);
        }
        let corners = &corners[..self.points.len()];
        let mut segments = [Segment::default(); SEGMENTS];
        let mut outline = Outline { segments: &mut segments, count: 0 };
        let sides = self.add_outline(&mut outline, half, corners);
        let mut hexagons = [Hexagon::default(); CORNERS];
        let hexagons = &mut hexagons[..sides];
        for (number, hexagon) in hexagons.iter_mut().enumerate() {
            *hexagon = Hexagon::new(half, corners[number], corners[(number + 1) % corners.len()]);
        }
        let mut covered = [(0.0, 0.0); CORNERS];
        let mut best = f64::INFINITY;
        while let Some(segment) = outline.take_nearest(best * best) {
            best = best.min(self.nearest_free_of(board, hexagons, &segment, &mut covered));
        }
        best
    }

    /// Adds the outline of the places to avoid, and what else of the outlines of the hexagons may be part of it.
    /// Returns the number of sides.
    fn add_outline(&self, outline: &mut Outline, half: Vector, corners: &[Vector]) -> usize {
        let count = corners.len();
        if self.kind == ShapeKind::Line {
            for ends in corners.windows(2) {
                outline.add_along(half, ends[0], ends[1], 1.0);
                outline.add_along(half, ends[0], ends[1], -1.0);
            }
            outline.add_round(half, corners[0], &corners[1..2]);
            for three in corners.windows(3) {
                outline.add_round(half, three[1], &[three[0], three[2]]);
            }
            outline.add_round(half, corners[count - 1], &corners[count - 2..count - 1]);
            return count - 1;
        }
        for k in 0..count {
            let [before, at, after] = [corners[(k + count - 1) % count], corners[k], corners[(k + 1) % count]];
            outline.add_along(half, at, after, self.outside);
            // Round a corner that points inward the board meets a side on all ways.
            if self.outside * (at - before).perp(&(after - at)) >= 0.0 {
                outline.add_round(half, at, &[before, after]);
            }
        }
        count
    }

    /// Returns the distance from the origin to the nearest free translation on a segment; infinite if none is free. A
    /// hexagon that covers the whole segment becomes the first one, because it often covers the next segment too.
    fn nearest_free_of(
        &self,
        board: &Board,
        hexagons: &mut [Hexagon],
        segment: &Segment,
        covered: &mut [(f64, f64)],
    ) -> f64 {
        let Segment { from: begin, to: end, .. } = *segment;
        let size = board.half_length + board.half_width;
        let depth = ROUNDING * (size + begin.abs().sup(&end.abs()).sum());
        let mut count = 0;
        for number in 0..hexagons.len() {
            if let Some(part) = hexagons[number].covers(segment, depth) {
                if part == (0.0, 1.0) {
                    hexagons.swap(0, number);
                    return f64::INFINITY;
                }
                covered[count] = part;
                count += 1;
            }
        }
        let covered = &mut covered[..count];
        covered.sort_unstable_by(|one, other| one.0.total_cmp(&other.0));
        let at = |share: f64| begin + share * (end - begin);
        let mut best = f64::INFINITY;
        let mut from = 0.0f64;
        for (low, high) in covered.iter().copied().chain([(1.0, 1.0)]) {
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
