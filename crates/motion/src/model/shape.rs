//! Shapes that stand on the stage, and the signed distance of a board to each. They are independent of team, path and
//! keep-out.
//!
//! The signed distance is in metres. Where board and shape are apart, it is the Euclidean distance; where they overlap,
//! it is minus the least translation that frees the board (`escape`). The shape of a boundary is the plane outside its
//! polygon.
//!
//! Corners are first taken to the board's frame, so the error is a few units in the last place of the board's size, of
//! the distance, and of the coordinates.

mod escape;
#[cfg(test)]
mod tests;

use super::board::Board;
use super::elementary::hypot;
use super::{Point, Vector};

/// The greatest number of corners of a shape.
pub const MOST_CORNERS: usize = 64;

/// The kinds of shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShapeKind {
    /// A disc.
    Circle,
    /// A simple polygon with its interior; its corners may stand in either direction.
    Polygon,
    /// An open line without an interior.
    Line,
    /// The plane outside a simple polygon.
    Boundary,
}

/// A shape on the stage.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    kind: ShapeKind,
    /// The corners, or the centre of a circle.
    points: Vec<Point>,
    /// The radius, in metres; 0 unless the shape is a circle.
    radius: f64,
    /// The sense of a convex shape: 1 if its corners stand counter-clockwise, -1 if clockwise, 0 for a circle or a
    /// segment.
    convex: Option<f64>,
    /// The free side of each side of a polygon or a boundary: 1 if on the right, -1 if on the left.
    outside: f64,
    /// A circle about the outline.
    bounding_centre: Point,
    bounding_radius: f64,
}

/// A rectangle about the origin, for a board in its own frame: half its length and half its width.
#[derive(Debug, Clone, Copy)]
struct Rectangle {
    half: Vector,
}

impl Shape {
    /// Creates a circle; its radius, metres, must be positive.
    pub fn circle(centre: Point, radius: f64) -> Self {
        let (kind, points) = (ShapeKind::Circle, vec![centre]);
        let convex = Some(0.0);
        Self { kind, points, radius, convex, outside: 0.0, bounding_centre: centre, bounding_radius: radius }
    }

    /// Creates a polygon from three to [`MOST_CORNERS`] corners; its sides must not meet except at their corners.
    pub fn polygon(corners: Vec<Point>) -> Self {
        Self::of_corners(ShapeKind::Polygon, corners)
    }

    /// Creates an open line from two to [`MOST_CORNERS`] corners, no two of them in succession equal.
    pub fn line(corners: Vec<Point>) -> Self {
        Self::of_corners(ShapeKind::Line, corners)
    }

    /// Creates the plane outside a polygon, whose corners are as of [`Shape::polygon`].
    pub fn boundary(corners: Vec<Point>) -> Self {
        Self::of_corners(ShapeKind::Boundary, corners)
    }

    fn of_corners(kind: ShapeKind, points: Vec<Point>) -> Self {
        let extreme = |pick: fn(f64, f64) -> f64, first: f64| {
            points.iter().fold(Vector::repeat(first), |so_far, point| so_far.zip_map(&point.coords, pick))
        };
        let (low, high) = (extreme(f64::min, f64::INFINITY), extreme(f64::max, f64::NEG_INFINITY));
        let bounding_centre = Point::from(0.5 * (low + high));
        let bounding_radius = points.iter().map(|point| (point - bounding_centre).norm()).fold(0.0, f64::max);
        let convex = match kind {
            ShapeKind::Polygon => sense(&points),
            ShapeKind::Line => (points.len() == 2).then_some(0.0),
            ShapeKind::Circle | ShapeKind::Boundary => None,
        };
        let area = doubled_area(&points);
        let outside = if kind == ShapeKind::Boundary { -area } else { area }.signum();
        Self { kind, points, radius: 0.0, convex, outside, bounding_centre, bounding_radius }
    }

    /// Returns the kind.
    pub fn kind(&self) -> ShapeKind {
        self.kind
    }

    /// Returns true if the shape is convex: then the depth of an overlap changes no faster than the board moves.
    pub fn is_convex(&self) -> bool {
        self.convex.is_some()
    }

    /// Returns the corners; of a circle, its centre.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Returns the radius of a circle, in metres; 0 for other kinds.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Returns the same shape with every point mapped by a rigid motion or a reflection.
    pub fn mapped(&self, map: impl Fn(Point) -> Point) -> Self {
        let points: Vec<Point> = self.points.iter().map(|point| map(*point)).collect();
        match self.kind {
            ShapeKind::Circle => Self::circle(points[0], self.radius),
            kind => Self::of_corners(kind, points),
        }
    }

    /// Returns the sides, each as its first and its second corner; of a circle, its centre twice.
    pub fn sides(&self) -> impl Iterator<Item = (Point, Point)> + '_ {
        let closing = match self.kind {
            ShapeKind::Polygon | ShapeKind::Boundary => self.points.last().zip(self.points.first()),
            ShapeKind::Circle => self.points.first().zip(self.points.first()),
            ShapeKind::Line => None,
        };
        let open = self.points.windows(2).map(|pair| (pair[0], pair[1]));
        open.chain(closing.map(|(last, first)| (*last, *first)))
    }

    /// Returns true if a point is inside the polygon of the corners (crossings of a ray; O'Rourke, Computational
    /// Geometry in C, section 7.4).
    fn encloses(&self, point: Point) -> bool {
        self.sides().fold(false, |inside, (from, to)| {
            let crosses = (from.y > point.y) != (to.y > point.y)
                && point.x - from.x < (to.x - from.x) * ((point.y - from.y) / (to.y - from.y));
            inside != crosses
        })
    }

    /// Returns true if a point that is not on a side belongs to the shape.
    fn holds(&self, point: Point) -> bool {
        match self.kind {
            ShapeKind::Polygon => self.encloses(point),
            ShapeKind::Boundary => !self.encloses(point),
            ShapeKind::Circle | ShapeKind::Line => false,
        }
    }

    /// Returns a lower bound of [`signed_distance`](Self::signed_distance) from the circle about the board, in metres.
    pub fn coarse_bound(&self, board: &Board) -> f64 {
        let radius = board.circle_radius();
        if self.kind != ShapeKind::Boundary {
            return (board.centre - self.bounding_centre).norm() - (self.bounding_radius + radius);
        }
        if !self.encloses(board.centre) {
            return f64::NEG_INFINITY;
        }
        let nearest = self.sides().map(|(from, to)| squared_distance(board.centre.coords, from.coords, to.coords));
        let gap = nearest.fold(f64::INFINITY, f64::min).sqrt() - radius;
        if gap > 0.0 { gap } else { f64::NEG_INFINITY }
    }

    /// Returns the signed distance of a board, in metres; negative infinity if no translation frees the board from the
    /// plane outside a boundary.
    pub fn signed_distance(&self, board: &Board) -> f64 {
        self.signed_distance_below(board, f64::INFINITY)
    }

    /// Returns the signed distance of a board if it is below `limit`, else a value that is not, at less cost.
    pub fn signed_distance_below(&self, board: &Board, limit: f64) -> f64 {
        let rectangle = Rectangle::of(board);
        if self.kind == ShapeKind::Circle {
            return rectangle.signed_distance(in_frame(board, self.points[0])) - self.radius;
        }
        let mut least = f64::INFINITY;
        for (from, to) in self.sides() {
            let (from, to) = (in_frame(board, from), in_frame(board, to));
            let separation = rectangle.separation(from, to);
            if separation <= 0.0 {
                return -self.least_escape(board, -limit);
            }
            if separation < least && separation < limit {
                // Rounding must not make the distance less than its lower bound, nor a gap a touch.
                least = least.min(rectangle.distance(from, to).max(separation));
            }
        }
        if self.holds(board.centre) { -self.least_escape(board, -limit) } else { least }
    }

    /// Returns the signed distances of a board to each side, metres, with the nearest points of the board and of the
    /// side. For a circle, the distance is to the circle. A side ignores the interior of its polygon.
    pub fn side_distances<'a>(&'a self, board: &'a Board) -> impl Iterator<Item = (f64, Point, Point)> + 'a {
        let rectangle = Rectangle::of(board);
        self.sides().map(move |(from, to)| {
            let (from, to) = (in_frame(board, from), in_frame(board, to));
            let separation = rectangle.separation(from, to);
            let (distance, on_board, on_side) = rectangle.nearest(from, to);
            let value = if separation > 0.0 { distance.max(separation) } else { separation };
            let (on_board, on_side) = self.on_stage(board, on_board, on_side);
            (value - self.radius, on_board, on_side)
        })
    }

    /// Returns two points on the stage: a point of a board, and the point of the shape for a point of a side. The
    /// arguments `on_board` and `on_side` are in the board's frame.
    fn on_stage(&self, board: &Board, on_board: Vector, on_side: Vector) -> (Point, Point) {
        let on_stage = |local: Vector| board.centre + local.x * board.axis + local.y * board.across();
        let outward = on_board - on_side;
        let length = outward.norm();
        let on_circle = if length > 0.0 { on_side + outward * (self.radius / length) } else { on_side };
        (on_stage(on_board), on_stage(on_circle))
    }

    /// Returns the point of a board and the point of the shape's outline that are nearest to each other. Where the
    /// board and the shape overlap, the two points are near the place at which the outline meets the board.
    pub fn nearest_points(&self, board: &Board) -> (Point, Point) {
        let rectangle = Rectangle::of(board);
        let (mut least, mut nearest) = (f64::INFINITY, (Vector::zeros(), Vector::zeros()));
        for (from, to) in self.sides() {
            let (from, to) = (in_frame(board, from), in_frame(board, to));
            if rectangle.separation_of_box(from, to).max(0.0) < least {
                let (distance, on_board, on_side) = rectangle.nearest(from, to);
                if distance < least {
                    (least, nearest) = (distance, (on_board, on_side));
                }
            }
        }
        self.on_stage(board, nearest.0, nearest.1)
    }
}

/// Returns twice the area of a simple polygon, negative if its corners stand clockwise.
fn doubled_area(corners: &[Point]) -> f64 {
    corners[1..].windows(2).map(|pair| (pair[0] - corners[0]).perp(&(pair[1] - corners[0]))).sum()
}

/// Returns the sense in which the corners of a simple polygon stand: 1 if counter-clockwise, -1 if clockwise. Returns
/// `None` unless the polygon is convex.
fn sense(corners: &[Point]) -> Option<f64> {
    let count = corners.len();
    let turn = |k: usize| {
        let [before, at, after] = [0, 1, 2].map(|by| corners[(k + by) % count]);
        (at - before).perp(&(after - at))
    };
    [1.0, -1.0].into_iter().find(|sense| (0..count).all(|k| sense * turn(k) >= 0.0))
}

/// Returns a point in the frame of a board.
fn in_frame(board: &Board, point: Point) -> Vector {
    let (offset, axis) = (point - board.centre, board.axis);
    Vector::new(axis.x * offset.x + axis.y * offset.y, axis.x * offset.y - axis.y * offset.x)
}

/// Returns the point of a segment nearest to a point.
fn nearest_of_segment(point: Vector, from: Vector, to: Vector) -> Vector {
    let along = to - from;
    let square = along.norm_squared();
    if square == 0.0 {
        return from;
    }
    let share = (point - from).dot(&along) / square;
    // From the nearer end, so that the end itself is exact.
    if share <= 0.5 { from + share.max(0.0) * along } else { to - (1.0 - share).max(0.0) * along }
}

fn squared_distance(point: Vector, from: Vector, to: Vector) -> f64 {
    (nearest_of_segment(point, from, to) - point).norm_squared()
}

impl Rectangle {
    fn of(board: &Board) -> Self {
        Self { half: Vector::new(board.half_length, board.half_width) }
    }

    fn corners(&self) -> [Vector; 4] {
        let (x, y) = (self.half.x, self.half.y);
        [Vector::new(x, y), Vector::new(-x, y), Vector::new(-x, -y), Vector::new(x, -y)]
    }

    /// Returns the signed distance of a point: inside, minus the least translation to the outline.
    fn signed_distance(&self, point: Vector) -> f64 {
        let beyond = point.abs() - self.half;
        if beyond.x <= 0.0 && beyond.y <= 0.0 {
            return beyond.x.max(beyond.y);
        }
        hypot(beyond.x.max(0.0), beyond.y.max(0.0))
    }

    /// Returns the signed separation of the box about a segment, in metres: never more than the separation of the
    /// segment.
    fn separation_of_box(&self, from: Vector, to: Vector) -> f64 {
        let gap = |one: f64, other: f64, half: f64| one.min(other).max(-one.max(other)) - half;
        gap(from.x, to.x, self.half.x).max(gap(from.y, to.y, self.half.y))
    }

    /// Returns the signed separation of a segment by the separating axis theorem, in metres. The separation is never
    /// more than the distance. Where the segment and the rectangle overlap, it is minus the least translation.
    fn separation(&self, from: Vector, to: Vector) -> f64 {
        let sides = self.separation_of_box(from, to);
        let along = to - from;
        let length = along.norm();
        if length == 0.0 {
            return sides;
        }
        let support = self.half.x * along.y.abs() + self.half.y * along.x.abs();
        sides.max((from.perp(&along).abs() - support) / length)
    }

    /// Returns the distance of a segment that does not meet the rectangle: a corner or an end is nearest.
    fn distance(&self, from: Vector, to: Vector) -> f64 {
        let beyond = |end: Vector| (end.abs() - self.half).map(|beyond| beyond.max(0.0)).norm_squared();
        let corners = self.corners().into_iter().map(|corner| squared_distance(corner, from, to));
        corners.fold(beyond(from).min(beyond(to)), f64::min).sqrt()
    }

    /// Returns the least distance between a corner and the segment, or between an end and the rectangle, and these
    /// points, the rectangle's first.
    fn nearest(&self, from: Vector, to: Vector) -> (f64, Vector, Vector) {
        let ends = [from, to].map(|end| {
            let on_board = end.zip_map(&self.half, |coordinate, half| coordinate.clamp(-half, half));
            (on_board, end)
        });
        let corners = self.corners().map(|corner| (corner, nearest_of_segment(corner, from, to)));
        let pairs = corners.into_iter().chain(ends);
        let measured = pairs.map(|(on_board, on_side)| ((on_side - on_board).norm(), on_board, on_side));
        // The list is not empty.
        measured.min_by(|one, other| one.0.total_cmp(&other.0)).unwrap_or((0.0, from, from))
    }
}
