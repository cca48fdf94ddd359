//! The obstacles of a stage, with their shapes in the path's own coordinates. By Lemma 9 of docs/proofs.md boards stay
//! clear of them, or have come within their keep-out; by Lemma 11 their clearances are bounded.

use serde::Deserialize;

use super::boards::{Board, covers};
use super::first_order_board::FirstOrderBoard;
use super::interval::{Interval, Vector};
use super::placement::Mapping;
use super::problem::{Checked, problem};

/// Limit of obstacles and of the corners of one.
const MOST: usize = 64;

/// Directions from a point in which its crossings of a polygon's sides are counted, until one is certain.
const RAYS: [[f64; 2]; 4] = [[1.0, 0.0], [0.3, 1.0], [-1.0, 0.7], [-0.2, -1.0]];

/// A shape from which boards stay away, or the boundary inside which they stay.
pub(super) struct Obstacle {
    kind: Kind,
    /// The corners; of a circle, its centre.
    points: Vec<Vector>,
    radius: Interval,
    keep_out: Interval,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Circle,
    Line,
    Polygon,
    Boundary,
}

impl Obstacle {
    /// Returns the sides, each as its two ends.
    fn sides(&self) -> Vec<[Vector; 2]> {
        let mut sides: Vec<_> = self.points.windows(2).map(|pair| [pair[0], pair[1]]).collect();
        if let (Kind::Polygon | Kind::Boundary, Some(last), Some(first)) =
            (self.kind, self.points.last(), self.points.first())
        {
            sides.push([*last, *first]);
        }
        sides
    }

    /// Returns true if the board is shown to be further away than the keep-out for all positions of its handles.
    pub fn is_avoided_by(&self, board: &Board) -> bool {
        let metres = self.keep_out + self.radius;
        match self.kind {
            Kind::Circle => board.is_clear_of(&self.points, &metres),
            Kind::Boundary => self.is_inside(board.inner_point()) == Some(true) && self.are_sides_avoided_by(board),
            Kind::Line => board.is_roughly_clear_of(&self.points, &metres) || self.are_sides_avoided_by(board),
            Kind::Polygon => {
                board.is_roughly_clear_of(&self.points, &metres)
                    || self.is_inside(board.inner_point()) == Some(false) && self.are_sides_avoided_by(board)
            }
        }
    }

    fn are_sides_avoided_by(&self, board: &Board) -> bool {
        self.sides().iter().all(|side| board.is_clear_of(side, &self.keep_out))
    }

    /// Returns true if a point is shown to be inside the polygon, false if outside; `None` if neither is.
    fn is_inside(&self, point: &Vector) -> Option<bool> {
        let sides = self.sides();
        RAYS.iter().find_map(|[x, y]| {
            let ray = Vector::new(*x, *y);
            let mut inside = false;
            for [from, to] in &sides {
                let (from, to) = (from.minus(point), to.minus(point));
                let (before, after) = (is_left(&ray, &from)?, is_left(&ray, &to)?);
                if before != after {
                    // The side crosses the line of the ray, in front of the point or behind it.
                    inside ^= is_left(&from, &to)? == after;
                }
            }
            Some(inside)
        })
    }

    /// Returns true if the clearance of the board is shown to be more than `metres` throughout the step (Lemma 11).
    pub fn is_further_than(&self, metres: &Interval, board: &Board, first: &FirstOrderBoard) -> bool {
        let far = self.keep_out + self.radius + metres;
        let is_hull_clear = || board.is_roughly_clear_of(&self.points, &far);
        if far.is_not_negative() && self.kind != Kind::Boundary && is_hull_clear() {
            return true;
        }
        let is_clear = |sides: &[[Vector; 2]], far: &Interval| {
            let ends: Vec<Vector> = sides.iter().flatten().copied().collect();
            board.is_roughly_clear_of(&ends, far) || first.is_clear_of(sides, far) || board.is_clear_of(&ends, far)
        };
        if self.kind == Kind::Circle {
            return is_clear(&[[self.points[0]; 2]], &far);
        }
        let size = far.abs();
        let near: Vec<_> = self.sides().into_iter().filter(|side| !is_clear(&[*side], &size)).collect();
        if !(near.is_empty() || far.is_negative() && is_clear(&near, &far)) {
            return false;
        }
        let moved = if far.is_not_negative() { Interval::new(0.0) } else { size };
        let is_outside = || first.inner_point(&moved).and_then(|point| self.is_inside(point));
        self.kind == Kind::Line || is_outside() == Some(self.kind == Kind::Boundary)
    }

    /// Returns an upper bound of the clearance of the board throughout the step (Lemma 11).
    pub fn at_most(&self, board: &FirstOrderBoard) -> Interval {
        let sides = if self.kind == Kind::Circle { vec![[self.points[0]; 2]] } else { self.sides() };
        let distances = sides.iter().map(|side| board.at_most_to(side));
        // Every obstacle has a side.
        let least = distances.reduce(|least, next| least.min(&next)).unwrap_or(self.radius);
        (least - self.radius - self.keep_out).upper()
    }

    /// Returns true if a point of the board is shown to be within the keep-out, or on the wrong side.
    pub fn is_reached_by(&self, board: &Board, point: &Vector) -> bool {
        let is_in_board = covers(board, point);
        if self.kind == Kind::Circle {
            let metres = self.keep_out + self.radius;
            return is_in_board && self.points[0].minus(point).norm().is_at_most(&metres);
        }
        if is_in_board && matches!(self.kind, Kind::Polygon | Kind::Boundary) {
            let is_wrong = self.kind == Kind::Polygon;
            if self.is_inside(point) == Some(is_wrong) {
                return true;
            }
        }
        self.sides().iter().any(|[from, to]| {
            // A point of the side, near its nearest point.
            let (along, offset) = (to.minus(from), point.minus(from));
            let share = (offset.dot(&along).rough() / along.norm_squared().rough()).clamp(0.0, 1.0);
            let on_side = from.plus(&along.scaled(&Interval::new(share)));
            covers(board, &on_side) || is_in_board && on_side.minus(point).norm().is_at_most(&self.keep_out)
        })
    }
}

/// Returns true if `to` is to the left of `from`, false if to the right.
fn is_left(from: &Vector, to: &Vector) -> Option<bool> {
    let cross = from.cross(to);
    if cross.is_positive() {
        Some(true)
    } else if cross.is_negative() {
        Some(false)
    } else {
        None
    }
}

/// The table `[stage]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StageText {
    boundary: Option<BoundaryText>,
    #[serde(default)]
    obstacles: Vec<ObstacleText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoundaryText {
    polygon: Vec<[f64; 2]>,
    #[serde(default)]
    keep_out: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ObstacleText {
    #[serde(rename = "name")]
    _name: String,
    circle: Option<CircleText>,
    polygon: Option<Vec<[f64; 2]>>,
    line: Option<Vec<[f64; 2]>>,
    #[serde(default)]
    keep_out: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CircleText {
    center: [f64; 2],
    radius: f64,
}

impl StageText {
    /// Returns the obstacles in the path's own coordinates, in the order of the scene, the boundary last.
    ///
    /// # Errors
    /// A sentence about the field that is wrong.
    pub fn read(&self, mapping: &Mapping) -> Checked<Vec<Obstacle>> {
        if self.obstacles.len() > MOST {
            return Err(problem!("the number of obstacles is out of range"));
        }
        let of = |text: &ObstacleText| match (&text.circle, &text.polygon, &text.line) {
            (Some(circle), None, None) => {
                obstacle(mapping, Kind::Circle, &[circle.center], circle.radius, text.keep_out)
            }
            (None, Some(corners), None) => obstacle(mapping, Kind::Polygon, corners, 0.0, text.keep_out),
            (None, None, Some(corners)) => obstacle(mapping, Kind::Line, corners, 0.0, text.keep_out),
            _ => Err(problem!("an obstacle has one of circle, polygon and line")),
        };
        let obstacles = self.obstacles.iter().map(of);
        let boundary = self.boundary.iter();
        let boundary = boundary.map(|text| obstacle(mapping, Kind::Boundary, &text.polygon, 0.0, text.keep_out));
        obstacles.chain(boundary).collect()
    }
}

fn obstacle(mapping: &Mapping, kind: Kind, corners: &[[f64; 2]], radius: f64, keep_out: f64) -> Checked<Obstacle> {
    let least = match kind {
        Kind::Circle => 1,
        Kind::Line => 2,
        Kind::Polygon | Kind::Boundary => 3,
    };
    if corners.len() < least || corners.len() > MOST || !corners.iter().flatten().all(|number| number.is_finite()) {
        return Err(problem!("an obstacle has {} corners, or one that is no number", corners.len()));
    }
    let is_length = |metres: f64| metres.is_finite() && metres >= 0.0;
    if !is_length(radius) || !is_length(keep_out) {
        return Err(problem!("a radius or keep_out of an obstacle is {radius:?} or {keep_out:?}"));
    }
    let points = corners.iter().map(|corner| mapping.on_path(*corner)).collect();
    Ok(Obstacle { kind, points, radius: Interval::new(radius), keep_out: Interval::new(keep_out) })
}
