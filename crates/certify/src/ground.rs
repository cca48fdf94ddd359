//! Proofs that over a step a board stays clear of the obstacles of a stage, or further away than a number of metres,
//! and that a board has come to an obstacle. Lemmas 9 and 11 of `docs/proofs.md`.

use super::boards::MovingBoard;
use super::first_order::{FirstOrderBoard, When};
use super::interval::{Interval, Vector, minus, norm};
use bench_dragon_motion::Motion;
use bench_dragon_motion::ground::Obstacle;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::shape::ShapeKind;
use bench_dragon_motion::model::{self, Point};

/// Rounding of a corner in the path's own coordinates, as a share of the coordinates.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The depth, in metres, up to which an overlap with an outline is no more than a touch.
const DEEPEST: f64 = 1e-10;

/// An obstacle in the path's own coordinates.
pub(super) struct Barrier {
    obstacle: Obstacle,
    /// The distance, in metres, by which the rounding of the corners may move them.
    rounding: f64,
}

/// Returns the obstacles of a motion's stage.
pub(super) fn barriers(motion: &Motion) -> Vec<Barrier> {
    let ground = motion.ground().in_own_frame(motion.placement());
    let origin = motion.placement().origin().coords.norm();
    let barrier = |obstacle: &Obstacle| {
        let furthest = obstacle.shape.points().iter().map(|point| point.coords.norm()).fold(0.0, f64::max);
        let rounding = ROUNDING * (1.0 + furthest + origin + obstacle.shape.radius() + obstacle.keep_out);
        Barrier { obstacle: obstacle.clone(), rounding }
    };
    ground.obstacles().iter().map(barrier).collect()
}

impl Barrier {
    /// Returns true if a board is proved to stay further away than the keep-out.
    pub fn is_avoided_by(&self, moving: &MovingBoard) -> bool {
        let Self { obstacle: Obstacle { shape, keep_out, .. }, rounding } = self;
        // The disc that holds the board throughout the step.
        let ([x, y], radius) = moving.disc();
        let axis = model::Vector::new(1.0, 0.0);
        let disc = Board { centre: Point::new(x, y), axis, half_length: radius, half_width: 0.0 };
        if shape.coarse_bound(&disc) > keep_out + rounding {
            return true;
        }
        let board = moving.in_doubles();
        if shape.signed_distance(&board) <= 0.0 {
            return false;
        }
        let metres = keep_out + shape.radius() + rounding;
        let is_round = shape.kind() == ShapeKind::Circle;
        let along_faces = [board.axis, -board.axis, board.across(), -board.across()];
        shape.sides().zip(shape.side_distances(&board)).all(|((from, to), (_, on_board, on_side))| {
            let corners = if is_round { vec![from] } else { vec![from, to] };
            let side = to - from;
            let normal = model::Vector::new(-side.y, side.x);
            let directions = [on_side - on_board, normal, -normal].into_iter().chain(along_faces);
            directions.filter(|n| n.norm() > 0.0).any(|n| moving.is_clear_along([n.x, n.y], &corners, metres))
        })
    }

    /// Returns true if the clearance of a board is proved to be more than `clearance` metres throughout a step.
    pub fn is_further_than(&self, clearance: f64, board: &BoardOverStep) -> bool {
        let Self { obstacle: Obstacle { shape, keep_out, .. }, rounding } = self;
        let ([x, y], radius) = board.moving.disc();
        let axis = model::Vector::new(1.0, 0.0);
        let disc = Board { centre: Point::new(x, y), axis, half_length: radius, half_width: 0.0 };
        let most = keep_out + clearance + rounding;
        if most >= 0.0 && shape.coarse_bound(&disc) > most {
            return true;
        }
        let in_doubles = board.in_doubles();
        let metres = most + shape.radius();
        let found: Vec<_> = shape.sides().zip(shape.side_distances(&in_doubles)).collect();
        let is_clear = |metres: f64, sides: &[Side]| board.is_clear_of(sides, metres, &in_doubles);
        let sides: Vec<Side> = (found.into_iter())
            .map(|((from, to), (_, on_board, on_side))| Side { from, to, towards: on_side - on_board })
            .collect();
        if shape.kind() == ShapeKind::Circle {
            return is_clear(metres, &[Side { to: sides[0].from, ..sides[0] }]);
        }
        let size = metres.abs();
        let near: Vec<Side> = sides.into_iter().filter(|side| !is_clear(size, &[*side])).collect();
        if !(near.is_empty() || metres < 0.0 && is_clear(metres, &near)) {
            return false;
        }
        // Inside or outside: a point that is in the board, also where the board is moved out of the shape.
        let pin = Board { centre: board.inner_point(), half_length: 0.0, half_width: 0.0, ..in_doubles };
        let is_inner = board.first_order.is_none_or(|(first, _)| first.holds_front_point(metres.min(0.0).abs()));
        shape.kind() == ShapeKind::Line || is_inner && shape.signed_distance(&pin) > *rounding
    }

    /// Returns true if a least clearance can be enclosed: of an overlap with a shape other than a circle it cannot.
    pub fn is_decidable(&self, clearance: f64) -> bool {
        let Obstacle { shape, keep_out, .. } = &self.obstacle;
        shape.kind() == ShapeKind::Circle || clearance + keep_out > -DEEPEST
    }

    /// Returns an upper bound of the clearance of a board, in metres.
    pub fn at_most(&self, board: &FirstOrderBoard, when: When) -> f64 {
        let Self { obstacle: Obstacle { shape, keep_out, .. }, rounding } = self;
        let in_doubles = board.in_doubles();
        let on_shape = shape.sides().zip(shape.side_distances(&in_doubles));
        let points = on_shape.map(|((from, _), (_, _, on_side))| match shape.kind() {
            ShapeKind::Circle => from,
            _ => on_side,
        });
        let least = points.map(|point| board.at_most_to([point.x, point.y], when)).fold(f64::INFINITY, f64::min);
        let less = Interval::point(least) - Interval::point(shape.radius()) - Interval::point(*keep_out);
        (less + Interval::point(*rounding)).hi
    }

    /// Returns a point of a board that is proved to be within the keep-out throughout the step.
    pub fn reached_by(&self, moving: &MovingBoard) -> Option<[f64; 2]> {
        let board = moving.in_doubles();
        let of_sides = self.obstacle.shape.sides().flat_map(|side| self.nearest_to_side(&board, side));
        of_sides.chain([board.centre]).map(|point| [point.x, point.y]).find(|point| self.is_reached_at(moving, *point))
    }

    /// Returns points of a board that may be within the keep-out of a side.
    fn nearest_to_side(&self, board: &Board, (from, to): (Point, Point)) -> impl Iterator<Item = Point> + use<> {
        let Obstacle { shape, keep_out, .. } = &self.obstacle;
        let seen = |point: Point| {
            let offset = point - board.centre;
            [(board.axis.dot(&offset), board.half_length), (board.across().dot(&offset), board.half_width)]
        };
        // The share of the side that lies in the board, from its first corner on.
        let mut share = (0.0f64, 1.0f64);
        for ((at, half), (end, _)) in seen(from).into_iter().zip(seen(to)) {
            let by = end - at;
            let (one, other) = ((-half - at) / by, (half - at) / by);
            if by != 0.0 {
                share = (share.0.max(one.min(other)), share.1.min(one.max(other)));
            } else if at.abs() > half {
                share = (1.0, 0.0);
            }
        }
        let inside = (share.0 < share.1).then(|| from + (to - from) * (0.5 * (share.0 + share.1)));
        // The point of the board that is nearest to the side, and half as far into the board as the keep-out allows.
        let sides = shape.side_distances(board).zip(shape.sides());
        let mut nearest = sides.filter(|(_, side)| *side == (from, to)).map(|((_, on_board, on_side), _)| {
            let target = if shape.kind() == ShapeKind::Circle { from } else { on_side };
            let away = on_board - target;
            let (metres, most) = (away.norm(), keep_out + shape.radius());
            if metres > 0.0 { on_board + away * (0.5 * (most - metres).max(0.0) / metres) } else { on_board }
        });
        let nearest = nearest.next();
        inside.into_iter().chain(nearest)
    }

    fn is_reached_at(&self, moving: &MovingBoard, point: [f64; 2]) -> bool {
        let Self { obstacle: Obstacle { shape, keep_out, .. }, rounding } = self;
        let around = |at: f64| Interval::point(at) + Interval::within(*rounding);
        if !moving.holds(point.map(around)) {
            return false;
        }
        let [x, y] = point;
        let pin =
            Board { centre: Point::new(x, y), axis: model::Vector::new(1.0, 0.0), half_length: 0.0, half_width: 0.0 };
        if matches!(shape.kind(), ShapeKind::Polygon | ShapeKind::Boundary) && shape.signed_distance(&pin) < -rounding {
            return true;
        }
        let most = keep_out + shape.radius();
        shape.sides().any(|(from, to)| {
            let along = to - from;
            let share = if along.norm() > 0.0 { (pin.centre - from).dot(&along) / along.norm_squared() } else { 0.0 };
            let on_side = from + along * share.clamp(0.0, 1.0);
            let between: Vector = minus(point.map(Interval::point), [on_side.x, on_side.y].map(Interval::point));
            let metres = norm(between).hi;
            // If no distance has to be kept, the point of the side itself is in the board.
            if most == 0.0 { metres <= *rounding } else { metres + rounding <= most }
        })
    }
}

/// A board over a step, by its capsules and, if they are known, by first-order enclosures.
pub(super) struct BoardOverStep<'b> {
    pub moving: MovingBoard,
    pub first_order: Option<(&'b FirstOrderBoard, When)>,
}

/// A side of a shape, with the vector to it from the nearest point of a board.
#[derive(Clone, Copy)]
struct Side {
    from: Point,
    to: Point,
    towards: model::Vector,
}

impl BoardOverStep<'_> {
    fn in_doubles(&self) -> Board {
        self.first_order.map_or_else(|| self.moving.in_doubles(), |(first, _)| first.in_doubles())
    }

    /// Returns the point of the board that is tested to be outside a shape.
    fn inner_point(&self) -> Point {
        self.first_order.map_or_else(|| self.moving.front_point(), |(first, _)| first.front_point()).into()
    }

    /// Returns true if the board is proved to be further than `metres` from the convex hull of some sides, along one of
    /// some directions. A negative number means an overlap less deep.
    fn is_clear_of(&self, sides: &[Side], metres: f64, board: &Board) -> bool {
        let corners: Vec<Point> = sides.iter().flat_map(|side| [side.from, side.to]).collect();
        let along_faces = [board.axis, -board.axis, board.across(), -board.across()];
        let of_sides = sides.iter().flat_map(|Side { from, to, towards }| {
            let along = to - from;
            let normal = model::Vector::new(-along.y, along.x);
            [*towards, normal, -normal]
        });
        let mut directions = of_sides.chain(along_faces).filter(|n| n.norm() > 0.0);
        let of_first_order = |n: &model::Vector| {
            self.first_order.is_some_and(|(first, when)| {
                let points: Vec<Vector> = corners.iter().map(|at| [at.x, at.y].map(Interval::point)).collect();
                first.least_gap_along([n.x, n.y], &points, when) > metres
                    || first.gap_to(&points, [board.axis.dot(n), board.across().dot(n)], when).lo > metres
            })
        };
        directions.any(|n| self.moving.is_clear_along([n.x, n.y], &corners, metres) || of_first_order(&n))
    }
}
