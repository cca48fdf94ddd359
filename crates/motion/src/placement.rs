//! [`Placement`]: where a path stands on the stage.
//!
//! A motion is solved, searched and proved in its path's own coordinates, so that it has the same digits and times
//! anywhere on the stage. The results of the motion are placed: chains by [`Motion::solver`](crate::Motion::solver) or
//! by the show, events and outlines by [`Motion`](crate::Motion).

use std::f64::consts::{PI, TAU};

use crate::linkage::NoFollower;
use crate::model::curve::{Coordinate, Curve};
use crate::model::double_double::DoubleDouble;
use crate::model::elementary;
use crate::model::segment::SegmentOutline;
use crate::model::{Point, Vector};
use crate::solve::{ChainMut, Solver};

/// A rigid mapping of a path's own coordinates to the stage: mirrored (y to -y), then rotated, then moved.
///
/// # Examples
///
/// ```
/// use bench_dragon_motion::model::{Point, Vector};
/// use bench_dragon_motion::placement::Placement;
///
/// let placement = Placement::new(Vector::new(10.0, 0.0), 0.25, true);
/// let placed = placement.point(Point::new(2.0, 1.0));
/// // Mirrored to (2, -1), rotated to (1, 2), moved to (11, 2).
/// assert!((placed - Point::new(11.0, 2.0)).norm() < 1e-15);
/// assert_eq!(Placement::IDENTITY.point(Point::new(2.0, 1.0)), Point::new(2.0, 1.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    turn: Option<Turn>,
    origin: Vector,
}

/// A rotation, after a reflection or without one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Turn {
    sine: f64,
    cosine: f64,
    /// The rotation, radians from -pi to pi.
    angle: f64,
    /// 1, or -1 for a reflection.
    side: f64,
}

impl Turn {
    #[inline(always)]
    fn vector(&self, x: f64, y: f64) -> (f64, f64) {
        let y = self.side * y;
        (self.cosine * x - self.sine * y, self.sine * x + self.cosine * y)
    }

    #[inline(always)]
    fn heading(&self, heading: f64) -> f64 {
        let heading = self.side * heading + self.angle;
        if heading > PI {
            heading - TAU
        } else if heading <= -PI {
            heading + TAU
        } else {
            heading
        }
    }
}

impl Placement {
    /// The placement of a path that stands at its own coordinates.
    pub const IDENTITY: Self = Self { turn: None, origin: Vector::new(0.0, 0.0) };

    /// Creates the placement that puts the origin of the path's coordinates at `origin`, in metres. The placement turns
    /// the path by `rotation_turns` turns counter-clockwise about that point, after a reflection of y if `mirror` is
    /// true.
    pub fn new(origin: Vector, rotation_turns: f64, mirror: bool) -> Self {
        // Whole turns are nothing, and quarters are exact.
        let part = rotation_turns - rotation_turns.round();
        let turned = (part != 0.0 || mirror).then(|| {
            let (sine, cosine) = match part {
                0.25 => (1.0, 0.0),
                -0.25 => (-1.0, 0.0),
                0.5 | -0.5 => (0.0, -1.0),
                _ => DoubleDouble::from_turns(part).sine_and_cosine(),
            };
            Turn { sine, cosine, angle: TAU * part, side: if mirror { -1.0 } else { 1.0 } }
        });
        Self { turn: turned, origin }
    }

    /// Returns the placement that maps the spiral about the origin to a spiral of an outline. The beginning, the
    /// heading and the side of the curvature determine the place of the outline's spiral. Returns `None` for other
    /// curves.
    pub fn of_spiral(outline: &SegmentOutline) -> Option<Self> {
        let (spiral, first, curvature) = outline.kind.spiral()?;
        if curvature.is_nan() {
            return Some(Self::IDENTITY);
        }
        let first = Coordinate { high: first, low: 0.0 };
        let (point, tangent) = (spiral.point(first).coords, spiral.tangent(first));
        let mirror = spiral.turning() * curvature < 0.0;
        let heading = if mirror { -1.0 } else { 1.0 } * elementary::atan2(tangent.y, tangent.x);
        let turned = Self::new(Vector::zeros(), (outline.heading - heading) / TAU, mirror);
        Some(Self { origin: outline.start.coords - turned.vector(point), ..turned })
    }

    /// Returns the placement of a path that is first moved by `start`, metres, in its own coordinates.
    pub fn after_moving_by(self, start: Vector) -> Self {
        if start == Vector::zeros() { self } else { Self { origin: self.point(start.into()).coords, ..self } }
    }

    /// Returns the stage point of the origin of the path's own coordinates.
    pub fn origin(&self) -> Point {
        self.origin.into()
    }

    /// Returns the rotation, turns counter-clockwise, more than -1/2 and at most 1/2.
    pub fn rotation_turns(&self) -> f64 {
        let turns = self.turn.map_or(0.0, |turn| turn.angle / TAU);
        if turns == -0.5 { 0.5 } else { turns }
    }

    /// Returns true if the path is mirrored.
    pub fn is_mirrored(&self) -> bool {
        self.turn.is_some_and(|turn| turn.side < 0.0)
    }

    /// Returns true if nothing is placed elsewhere.
    pub fn is_identity(&self) -> bool {
        *self == Self::IDENTITY
    }

    /// Returns the stage point of a point in the path's own coordinates.
    pub fn point(&self, point: Point) -> Point {
        Point::from(self.vector(point.coords) + self.origin)
    }

    /// Returns the point in the path's own coordinates of a stage point.
    pub fn own_point(&self, point: Point) -> Point {
        let moved = point.coords - self.origin;
        let Some(Turn { sine, cosine, side, .. }) = self.turn else { return moved.into() };
        Point::new(cosine * moved.x + sine * moved.y, side * (cosine * moved.y - sine * moved.x))
    }

    /// Returns the stage vector of a vector in the path's own coordinates.
    pub fn vector(&self, vector: Vector) -> Vector {
        self.turn.map_or(vector, |turn| <[f64; 2]>::from(turn.vector(vector.x, vector.y)).into())
    }

    /// Returns the heading on the stage of a heading in the path's own coordinates, radians in (-pi, pi].
    pub fn heading(&self, heading: f64) -> f64 {
        self.turn.map_or(heading, |turn| turn.heading(heading))
    }

    /// Places all handles of a chain: positions, headings and velocities. Speeds along the path remain.
    pub fn chain(&self, chain: &mut ChainMut) {
        if self.is_identity() {
            return;
        }
        let ChainMut { x, y, heading, speed: _, vx, vy } = chain;
        let Some(turn) = &self.turn else {
            x.iter_mut().for_each(|x| *x += self.origin.x);
            y.iter_mut().for_each(|y| *y += self.origin.y);
            return;
        };
        let origin = self.origin;
        for (x, y) in x.iter_mut().zip(y.iter_mut()) {
            let (turned_x, turned_y) = turn.vector(*x, *y);
            (*x, *y) = (turned_x + origin.x, turned_y + origin.y);
        }
        for (vx, vy) in vx.iter_mut().zip(vy.iter_mut()) {
            (*vx, *vy) = turn.vector(*vx, *vy);
        }
        heading.iter_mut().for_each(|heading| *heading = turn.heading(*heading));
    }

    /// Returns the outline of a segment on the stage.
    pub fn outline(&self, outline: SegmentOutline) -> SegmentOutline {
        let SegmentOutline { kind, start, heading, length } = outline;
        let side = self.turn.map_or(1.0, |turn| turn.side);
        let kind = if self.is_identity() { kind } else { kind.placed(side) };
        SegmentOutline { kind, start: self.point(start), heading: self.heading(heading), length }
    }
}

/// A solver whose chains are placed.
pub(crate) struct Placed {
    pub solver: Box<dyn Solver>,
    pub placement: Placement,
}

impl Solver for Placed {
    fn name(&self) -> &'static str {
        self.solver.name()
    }

    fn solve_in(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        self.solver.solve_in(time, chain)?;
        self.placement.chain(chain);
        Ok(())
    }

    fn solve_ahead(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        self.solver.solve_ahead(time, chain)?;
        self.placement.chain(chain);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::Chain;

    #[test]
    fn mirror_then_rotation_then_move() {
        let angle = 0.3 * TAU;
        let placement = Placement::new(Vector::new(5.0, -7.0), 1.3, true);
        let mut chain = Chain::new(2);
        (chain.x, chain.y, chain.heading) = (vec![1.0, -2.0], vec![3.0, 0.5], vec![0.4, PI]);
        (chain.speed, chain.vx, chain.vy) = (vec![2.0, 1.0], vec![2.0, 0.0], vec![0.0, -1.0]);
        let before = chain.clone();
        placement.chain(&mut chain.all_mut());
        let rotated = |x: f64, y: f64| (angle.cos() * x - angle.sin() * y, angle.sin() * x + angle.cos() * y);
        for k in 0..2 {
            let (x, y) = rotated(before.x[k], -before.y[k]);
            assert!((chain.x[k] - x - 5.0).abs() < 1e-14 && (chain.y[k] - y + 7.0).abs() < 1e-14);
            let (vx, vy) = rotated(before.vx[k], -before.vy[k]);
            assert!((chain.vx[k] - vx).abs() < 1e-15 && (chain.vy[k] - vy).abs() < 1e-15);
            let turned = (chain.heading[k] + before.heading[k] - angle).rem_euclid(TAU);
            assert!(turned.min(TAU - turned) < 1e-15 && chain.heading[k] > -PI && chain.heading[k] <= PI);
            let point = placement.point(Point::new(before.x[k], before.y[k]));
            assert_eq!((point.x, point.y), (chain.x[k], chain.y[k]));
            assert!((placement.own_point(point) - Point::new(before.x[k], before.y[k])).norm() < 1e-14);
        }
        assert_eq!(chain.speed, before.speed);
    }

    #[test]
    fn whole_turns_without_a_move_are_the_identity_and_quarters_are_exact() {
        assert!(Placement::new(Vector::zeros(), -3.0, false).is_identity());
        assert!(!Placement::new(Vector::zeros(), 0.0, true).is_identity());
        let quarter = Placement::new(Vector::zeros(), 5.25, false);
        assert_eq!(quarter.point(Point::new(1.0, 2.0)), Point::new(-2.0, 1.0));
        assert_eq!(quarter.heading(PI), -0.5 * PI);
    }

    #[test]
    fn a_start_is_a_move_in_the_paths_own_coordinates() {
        let placement = Placement::new(Vector::new(5.0, -7.0), 0.1, true);
        let (start, point) = (Vector::new(2.0, 9.0), Point::new(0.3, -4.0));
        let moved = placement.after_moving_by(start).point(point);
        assert!((moved - placement.point(point + start)).norm() < 1e-14);
    }
}
