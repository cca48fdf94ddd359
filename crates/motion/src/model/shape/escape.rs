//! The least translation that frees a board from a shape with which it overlaps.
//!
//! In the board's frame the board is the rectangle of half sides (h, w) about the origin. Moved by t, the board meets a
//! side of the shape if and only if t is in the side's Minkowski sum with the rectangle. This sum is a hexagon: the set
//! |x - m_x| <= h + |e_x| / 2, |y - m_y| <= w + |e_y| / 2, |n . (t - m)| <= h |n_x| + w |n_y|. Here the side has the
//! middle m, the vector e and the unit normal n. Moved by t the board meets no side but lies within the shape if and
//! only if its centre does. So the places to avoid are the hexagons and the shape's interior, whose outline the
//! hexagons cover. The least translation leads to the nearest point of a hexagon's outline that is inside no other
//! hexagon and not inside the shape.

use arrayvec::ArrayVec;

use super::{MOST_CORNERS, Rectangle, Shape, ShapeKind, in_frame};
use crate::model::Vector;
use crate::model::board::Board;

/// The depth within a hexagon, as a share of the board and the translation, up to which a point counts as outside.
const ROUNDING: f64 = 1e-12;

/// The greatest number of segments of an outline: of a line, two along each side and, where rounding joins corners,
/// four round each corner.
const MOST_SEGMENTS: usize = 6 * MOST_CORNERS;

/// The places at which the rectangle meets a side.
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

    /// Returns true if a place is inside by more than `depth`.
    fn covers(&self, place: Vector, depth: f64) -> bool {
        let offset = place - self.middle;
        offset.x.abs() < self.reach.x - depth
            && offset.y.abs() < self.reach.y - depth
            && self.normal.dot(&offset).abs() < self.reach_along_normal - depth
    }

    /// Returns the part of a segment that is inside by more than `depth`, as shares of it.
    fn part(&self, segment: &Segment, depth: f64) -> Option<(f64, f64)> {
        let (offset, along) = (segment.from - self.middle, segment.along);
        let (mut low, mut high) = (0.0f64, 1.0f64);
        for (at, rate, reach) in [
            (offset.x, along.x, self.reach.x - depth),
            (offset.y, along.y, self.reach.y - depth),
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

/// A segment of places to which the board can be moved. All places between the shares `low` and `high` are covered;
/// where both are the same, none has been tested.
struct Segment {
    from: Vector,
    along: Vector,
    low: f64,
    high: f64,
    /// True if the nearest place that is not known to be covered is at `low`, false if it is at `high`.
    is_before: bool,
}

impl Segment {
    fn at(&self, share: f64) -> Vector {
        self.from + share * self.along
    }

    /// Returns the squared distances of the places before `low` and after `high`.
    fn ends(&self) -> [f64; 2] {
        let squared = |share: f64, is_left: bool| if is_left { self.at(share).norm_squared() } else { f64::INFINITY };
        [squared(self.low, self.low > 0.0), squared(self.high, self.high < 1.0)]
    }
}

/// The segments of the outline of the places to avoid: only segments nearer to the origin than a free place.
struct Outline {
    segments: ArrayVec<Segment, MOST_SEGMENTS>,
    /// For each segment the squared distance from the origin to its nearest place that is not known to be covered, and
    /// its number. The entries are a heap whose root is nearest (Cormen et al., Introduction to Algorithms, chapter 6).
    heap: ArrayVec<(f64, u16), MOST_SEGMENTS>,
    /// The square of the distance of the free place.
    limit: f64,
}

impl Outline {
    /// Adds a segment, whose place nearest to the origin is at `share` of it.
    fn add(&mut self, from: Vector, along: Vector, share: f64) {
        let segment = Segment { from, along, low: share, high: share, is_before: share > 0.0 };
        let squared = segment.at(share).norm_squared();
        if squared < self.limit {
            self.heap.push((squared, self.segments.len() as u16));
            self.segments.push(segment);
        }
    }

    /// Moves an entry of the heap down to its place.
    fn sift_down(&mut self, mut place: usize) {
        let entry = self.heap[place];
        loop {
            let mut child = 2 * place + 1;
            if child + 1 < self.heap.len() && self.heap[child + 1].0 < self.heap[child].0 {
                child += 1;
            }
            match self.heap.get(child) {
                Some(nearer) if nearer.0 < entry.0 => self.heap[place] = *nearer,
                _ => break,
            }
            place = child;
        }
        self.heap[place] = entry;
    }

    /// Adds the places at which the board slides along a side, on the left of it or on the right.
    fn add_along(&mut self, half: Vector, from: Vector, to: Vector, sense: f64) {
        let along = to - from;
        let outward = sense * Vector::new(along.y, -along.x);
        let from = from + half.zip_map(&outward, f64::copysign);
        let square = along.norm_squared();
        let share = if square > 0.0 { (-from.dot(&along) / square).clamp(0.0, 1.0) } else { 0.0 };
        self.add(from, along, share);
    }

    /// Adds the places at which an edge of the board slides over a corner, from which the sides lead to `neighbours`.
    /// Beyond an edge towards which one of the sides leads, the board meets that side.
    fn add_round(&mut self, half: Vector, at: Vector, neighbours: &[Vector]) {
        let beyond = (at.abs() - half).map(|beyond| beyond.max(0.0));
        if beyond.norm_squared() >= self.limit {
            return;
        }
        let low = at - half;
        let (width, height) = (Vector::new(2.0 * half.x, 0.0), Vector::new(0.0, 2.0 * half.y));
        let share = low.zip_map(&half, |low, half| (-0.5 * low / half).clamp(0.0, 1.0));
        let leads = |towards: fn(&Vector, &Vector) -> bool| neighbours.iter().any(|next| towards(next, &at));
        if !leads(|next, at| next.x > at.x) {
            self.add(low + width, height, share.y);
        }
        if !leads(|next, at| next.y > at.y) {
            self.add(low + height, width, share.x);
        }
        if !leads(|next, at| next.x < at.x) {
            self.add(low, height, share.y);
        }
        if !leads(|next, at| next.y < at.y) {
            self.add(low, width, share.x);
        }
    }

    /// Returns the distance of the nearest free place, if there is one.
    fn nearest_free(&mut self, avoided: &mut Avoided) -> Option<f64> {
        (0..self.heap.len() / 2).rev().for_each(|place| self.sift_down(place));
        while let Some(&(squared, number)) = self.heap.first()
            && squared < self.limit
        {
            let segment = &mut self.segments[usize::from(number)];
            let is_before = segment.is_before;
            let share = if is_before { segment.low } else { segment.high };
            let place = segment.at(share);
            // Less for the part, so that each step comes further.
            let depth = 0.5 * avoided.rounding(place);
            let part = if avoided.covers(place) {
                avoided.hexagons[0].part(segment, depth)
            } else if avoided.is_within(place) {
                let parts = avoided.hexagons.iter().filter_map(|hexagon| hexagon.part(segment, depth));
                if is_before {
                    parts.filter(|part| part.0 < share).max_by(|one, other| one.1.total_cmp(&other.1))
                } else {
                    parts.filter(|part| part.1 > share).min_by(|one, other| one.0.total_cmp(&other.0))
                }
            } else {
                return Some(squared.sqrt());
            };
            // Nothing between the place and the part is free, and nothing at all without a part.
            match (part, is_before) {
                (Some((low, high)), _) => (segment.low, segment.high) = (segment.low.min(low), segment.high.max(high)),
                (None, true) => segment.low = 0.0,
                (None, false) => segment.high = 1.0,
            }
            let [before, after] = segment.ends();
            segment.is_before = before < after;
            self.heap[0].0 = before.min(after);
            self.sift_down(0);
        }
        None
    }
}

/// The places to avoid: those that a hexagon covers, and those at which the board is within the shape.
struct Avoided<'s> {
    shape: &'s Shape,
    board: &'s Board,
    hexagons: ArrayVec<Hexagon, MOST_CORNERS>,
}

impl Avoided<'_> {
    /// Returns the depth within a hexagon up to which a place counts as outside.
    fn rounding(&self, place: Vector) -> f64 {
        ROUNDING * (self.board.half_length + self.board.half_width + place.abs().sum())
    }

    /// Returns true if a hexagon covers a place, and makes that hexagon the first: it often covers the next place, too.
    fn covers(&mut self, place: Vector) -> bool {
        let depth = self.rounding(place);
        let number = self.hexagons.iter().position(|hexagon| hexagon.covers(place, depth));
        number.inspect(|number| self.hexagons.swap(0, *number)).is_some()
    }

    /// Returns true if the board, moved to a place that no hexagon covers, is within the shape.
    fn is_within(&self, place: Vector) -> bool {
        self.shape.holds(self.board.centre + place.x * self.board.axis + place.y * self.board.across())
    }
}

impl Shape {
    /// Returns the length of the least translation that frees a board, in metres, or infinity if there is none. The
    /// board and the shape overlap. If the least length is at most `limit`, the result is at most `limit`.
    pub(super) fn least_escape(&self, board: &Board, limit: f64) -> f64 {
        match self.convex {
            Some(sense) => self.convex_escape(board, sense),
            None => self.nearest_free(board, limit),
        }
    }

    /// Returns the least escape from a convex shape. The escape is across one of the sides of the shape or of the board
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

    /// Returns the distance from the origin to the nearest free place, or to another one if that is at most `limit`.
    fn nearest_free(&self, board: &Board, limit: f64) -> f64 {
        let half = Rectangle::of(board).half;
        let (mut low, mut high) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
        let mut corners: ArrayVec<Vector, MOST_CORNERS> = ArrayVec::new();
        for point in &self.points {
            let corner = in_frame(board, *point);
            (low, high) = (low.zip_map(&corner, f64::min), high.zip_map(&corner, f64::max));
            corners.push(corner);
        }
        // Beside all corners the board is free, unless the shape is the plane outside them.
        let beside = (half - low).inf(&(half + high)).min();
        let free = if self.kind == ShapeKind::Boundary { f64::INFINITY } else { beside };
        if free <= limit {
            return free;
        }
        let mut avoided = Avoided { shape: self, board, hexagons: ArrayVec::new() };
        for number in 0..self.sides().count() {
            let hexagon = Hexagon::new(half, corners[number], corners[(number + 1) % corners.len()]);
            if (hexagon.middle.abs() - hexagon.reach).max() < free {
                avoided.hexagons.push(hexagon);
            }
        }
        let mut outline = Outline { segments: ArrayVec::new(), heap: ArrayVec::new(), limit: free * free };
        self.add_outline(&mut outline, half, &corners);
        if limit > 0.0 {
            for (segment, (squared, _)) in outline.segments.iter().zip(&outline.heap) {
                let place = segment.at(segment.low);
                if *squared <= limit * limit && !avoided.covers(place) && !avoided.is_within(place) {
                    return squared.sqrt();
                }
            }
        }
        outline.nearest_free(&mut avoided).unwrap_or(free)
    }

    /// Adds the segments of the hexagons' outlines that can be part of the outline of the places to avoid.
    fn add_outline(&self, outline: &mut Outline, half: Vector, corners: &[Vector]) {
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
            return;
        }
        for k in 0..count {
            let [before, at, after] = [corners[(k + count - 1) % count], corners[k], corners[(k + 1) % count]];
            outline.add_along(half, at, after, self.outside);
            // Round a corner that points inward the board meets a side on all ways.
            if self.outside * (at - before).perp(&(after - at)) >= 0.0 {
                outline.add_round(half, at, &[before, after]);
            }
        }
    }
}
