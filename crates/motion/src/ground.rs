//! The ground: the obstacles and the boundary of a stage, each with its keep-out.
//!
//! In: the shapes of a scene, in stage coordinates. Out: the clearance of a board. The scene creates a ground and gives
//! it to [`Motion`](crate::Motion), which maps it once to the path's own coordinates. There the searches and the live
//! clearance run.

use crate::model::board::Board;
use crate::model::shape::{Shape, ShapeKind};
use crate::placement::Placement;

/// The name of the boundary, where obstacles are listed.
pub const BOUNDARY: &str = "boundary";

/// A shape from which every board stays away, or the boundary inside which it stays.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstacle {
    /// The name; the boundary's name is [`BOUNDARY`].
    pub name: String,
    /// The shape.
    pub shape: Shape,
    /// The distance that every board has to keep, in metres.
    pub keep_out: f64,
}

impl Obstacle {
    /// Returns the clearance of a board, in metres: the signed distance to the shape minus the keep-out.
    pub fn clearance(&self, board: &Board) -> f64 {
        self.shape.signed_distance(board) - self.keep_out
    }

    /// Returns the clearance of a board if it is below `limit`, else a value that is not, at less cost.
    pub fn clearance_below(&self, board: &Board, limit: f64) -> f64 {
        self.shape.signed_distance_below(board, limit + self.keep_out) - self.keep_out
    }

    /// Returns a lower bound of [`clearance`](Self::clearance) at less cost.
    pub fn coarse_clearance(&self, board: &Board) -> f64 {
        self.shape.coarse_bound(board) - self.keep_out
    }
}

/// The obstacles of a stage, in the order of the scene; the boundary, if there is one, stands last.
///
/// # Examples
///
/// ```
/// use bench_dragon_motion::ground::{Ground, Obstacle};
/// use bench_dragon_motion::model::Point;
/// use bench_dragon_motion::model::board::Board;
/// use bench_dragon_motion::model::shape::Shape;
///
/// let lamp = Shape::circle(Point::new(3.0, 0.0), 0.5);
/// let ground = Ground::new(vec![Obstacle { name: "lamp".to_owned(), shape: lamp, keep_out: 0.25 }]);
/// // A board 2 m long and 0.4 m wide, with its middle at the origin.
/// let board = Board::from_handles(Point::new(1.0, 0.0), Point::new(-1.0, 0.0), 0.0, 0.4);
/// assert!((ground.obstacles()[0].clearance(&board) - 1.25).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ground {
    obstacles: Vec<Obstacle>,
}

impl Ground {
    /// Creates a ground. Obstacles are numbered in this order; a boundary must stand last.
    pub fn new(obstacles: Vec<Obstacle>) -> Self {
        Self { obstacles }
    }

    /// Returns the obstacles, the boundary last.
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// Returns the names of the obstacles.
    pub fn names(&self) -> Vec<String> {
        self.obstacles.iter().map(|obstacle| obstacle.name.clone()).collect()
    }

    /// Returns true if the ground is empty.
    pub fn is_empty(&self) -> bool {
        self.obstacles.is_empty()
    }

    /// Returns true if the last obstacle is the boundary.
    pub fn has_boundary(&self) -> bool {
        self.obstacles.last().is_some_and(|last| last.shape.kind() == ShapeKind::Boundary)
    }

    /// Returns the ground in the own coordinates of a path with this placement.
    pub fn in_own_frame(&self, placement: &Placement) -> Self {
        let mapped = |obstacle: &Obstacle| Obstacle {
            shape: obstacle.shape.mapped(|point| placement.own_point(point)),
            ..obstacle.clone()
        };
        Self { obstacles: self.obstacles.iter().map(mapped).collect() }
    }
}
