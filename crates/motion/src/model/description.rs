//! A path by its numbers in a scene. [`Path`] is built from them in doubles, and the reference builds its path from
//! them with more digits.

use std::f64::consts::TAU;

use super::arc::Arc;
use super::curve::{Coordinate, Curve, Side};
use super::double_double::DoubleDouble;
use super::elementary::{atan, hypot};
use super::line::Line;
use super::path::{Disjoint, Path, Route};
use super::placed_spiral::PlacedSpiral;
use super::segment::Segment;
use super::spiral::{Direction, Spiral};

/// The numbers of a path.
#[derive(Debug, Clone, PartialEq)]
pub enum PathDescription {
    /// Inward to the centre: see [`Path::spiral`].
    Spiral {
        /// The pitch, in metres per turn.
        pitch: f64,
        /// The turn on which the head starts.
        start_turn: f64,
    },
    /// Inward, through an S of two arcs, and outward: see [`Path::turnaround`].
    Turnaround {
        /// The pitch, in metres per turn.
        pitch: f64,
        /// The distance from the centre at which the turn begins, in metres.
        turn_radius: f64,
        /// The radius of the first arc over the radius of the second.
        arc_ratio: f64,
        /// The travel before the turn, in metres.
        lead_in: f64,
        /// The travel after it, in metres.
        lead_out: f64,
    },
    /// Lines, arcs and spirals: see [`Path::route`]. The head starts at the origin of the path's own coordinates; a
    /// [`Placement`](crate::placement::Placement) moves the start.
    Route {
        /// The direction at the start, turns counter-clockwise from x.
        heading_turns: f64,
        /// The segments after the start, in order.
        steps: Vec<RouteStep>,
    },
}

/// The turn of a route.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RouteTurn {
    /// The number of the inward spiral among the steps of the route.
    pub spiral: usize,
    /// The pitch of the spirals, in metres per turn.
    pub pitch: f64,
    /// The distance from the centre at which the inward spiral begins, in metres.
    pub radius: f64,
}

/// Pieces of a route up to which its ends are plain sums, as they were when no route had more.
const FEW_PIECES: usize = 31;

/// One segment of a route.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RouteStep {
    /// Straight on.
    Line {
        /// The length, in metres.
        length: f64,
    },
    /// Along a circle.
    Arc {
        /// The side on which the circle's centre is.
        side: Side,
        /// The radius, in metres.
        radius: DoubleDouble,
        /// Change of direction, in turns (90 degrees are a quarter).
        turns: DoubleDouble,
    },
    /// Along an Archimedean spiral.
    Spiral {
        /// The side on which the centre is.
        side: Side,
        /// Towards the centre or away from it.
        direction: Direction,
        /// The pitch, in metres per turn.
        pitch: f64,
        /// The distance from the centre to its beginning, in metres.
        radius: DoubleDouble,
        /// The number of turns around the centre: its end is `pitch` times as many metres nearer to the centre, or
        /// further away.
        turns: DoubleDouble,
    },
}

impl PathDescription {
    /// Returns the pitch of the path's spirals, metres per turn; `None` for a route.
    pub fn pitch(&self) -> Option<f64> {
        match self {
            Self::Spiral { pitch, .. } | Self::Turnaround { pitch, .. } => Some(*pitch),
            Self::Route { .. } => None,
        }
    }

    /// Returns the pitches of the path's spirals, metres per turn.
    pub fn pitches(&self) -> impl Iterator<Item = f64> + '_ {
        let steps = if let Self::Route { steps, .. } = self { steps.as_slice() } else { &[] };
        let of_steps = steps.iter().filter_map(|step| match step {
            RouteStep::Spiral { pitch, .. } => Some(*pitch),
            RouteStep::Line { .. } | RouteStep::Arc { .. } => None,
        });
        self.pitch().into_iter().chain(of_steps)
    }

    /// Returns the only turn of a route: an inward spiral and two arcs that lead to the outward spiral about the same
    /// centre. `None` for another path, and for a route with several turns.
    pub fn turn(&self) -> Option<RouteTurn> {
        let Self::Route { steps, .. } = self else { return None };
        let mut turns = steps.windows(3).enumerate().filter_map(|(step, steps)| match *steps {
            [
                RouteStep::Spiral { side, direction: Direction::Inward, pitch, radius, turns },
                RouteStep::Arc { side: first_side, radius: first, turns: first_turns },
                RouteStep::Arc { side: second_side, radius: second, turns: second_turns },
            ] => {
                let theta = TAU * radius.minus_product(pitch, turns).high / pitch;
                let radii = pitch / TAU * hypot(1.0, theta);
                let is_turn = (side, first_turns) == (first_side, second_turns)
                    && side.opposite() == second_side
                    && (first.high + second.high - radii).abs() <= 1e-12 * radii
                    && (TAU * first_turns.high - 2.0 * atan(theta)).abs() <= 1e-12;
                is_turn.then_some(RouteTurn { spiral: step, pitch, radius: radius.high })
            }
            _ => None,
        });
        turns.next().filter(|_| turns.next().is_none())
    }

    /// Builds the path in doubles.
    ///
    /// # Errors
    /// [`Disjoint`] if the numbers are so extreme that rounding leaves a gap.
    pub fn path(&self) -> Result<Path, Disjoint> {
        match self {
            Self::Spiral { pitch, start_turn } => Ok(Path::spiral(*pitch, *start_turn)),
            Self::Turnaround { pitch, turn_radius, arc_ratio, lead_in, lead_out } => {
                Path::turnaround(*pitch, *turn_radius, *arc_ratio, *lead_in, *lead_out)
            }
            Self::Route { heading_turns, steps } => {
                let start = Path::route(*heading_turns);
                let start = if steps.len() > FEW_PIECES { start.of_many_pieces() } else { start };
                let route = steps.iter().fold(start, |route, step| match *step {
                    RouteStep::Line { length } => route.line(length),
                    RouteStep::Arc { side, radius, turns } => route.arc(side, radius, turns),
                    RouteStep::Spiral { side, direction, pitch, radius, turns } => {
                        route.spiral(side, direction, pitch, radius, turns)
                    }
                });
                route.build()
            }
        }
    }
}

/// The pieces of a route.
impl Route {
    /// Adds a straight line of `length` metres.
    pub fn line(self, length: f64) -> Self {
        let line = Line { origin: self.end, direction: self.direction() };
        self.piece(Segment::Line(line), Coordinate::ZERO, Coordinate { high: length, low: 0.0 }, length, 0.0)
    }

    /// Adds an arc of `radius` metres whose centre is on one side, for `turns` turns (90 degrees are a quarter).
    pub fn arc(self, side: Side, radius: impl Into<DoubleDouble>, turns: impl Into<DoubleDouble>) -> Self {
        let (radius, around) = (radius.into().high, turns.into());
        let turns = around.high;
        let arc = Arc::new(self.end, self.direction(), side, radius);
        let turned = if side == Side::Left { turns } else { -turns };
        let last = DoubleDouble::from_turns(around);
        self.piece(Segment::Arc(arc), Coordinate::ZERO, last, radius * TAU * turns, turned)
    }

    /// Adds an Archimedean spiral of `pitch` metres per turn. The spiral begins `radius` metres from its centre, which
    /// is on one side, and leads `turns` turns around it.
    ///
    /// The tangent has the polar angle theta + atan(theta), but for a constant.
    pub fn spiral(
        self,
        side: Side,
        direction: Direction,
        pitch: f64,
        radius: impl Into<DoubleDouble>,
        turns: impl Into<DoubleDouble>,
    ) -> Self {
        let turns = turns.into();
        let spiral = Spiral::new(pitch, direction);
        let DoubleDouble { high, low } = radius.into().over(pitch);
        let first = DoubleDouble::from_turns(high).plus(TAU * low);
        let around = DoubleDouble::from_turns(turns);
        let last = first.plus(spiral.sign() * around.high).plus(spiral.sign() * around.low);
        let placed = PlacedSpiral::new(self.end, self.direction(), side, spiral, first);
        let inclined = atan(around.high / (1.0 + first.high * last.high)) / TAU;
        let turned = turns.high + inclined;
        let turned = if side == Side::Left { turned } else { -turned };
        self.piece(Segment::PlacedSpiral(placed), first, last, spiral.arc_length(first, last), turned)
    }
}
