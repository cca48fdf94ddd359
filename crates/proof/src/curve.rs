//! The curves of a path, in intervals: as functions of their coordinate, and as pieces in the text of a scene
//! (docs/proofs.md, "Definitions"). No other file matches on the kinds of curves.

use super::elementary;
use super::interval::{Interval, Vector};

/// A curve, as a function of its coordinate.
pub(super) enum Curve {
    /// Towards the centre: the coordinate falls with travel. `a` is in metres of radius per radian.
    Inward { a: Interval, frame: Option<Frame> },
    /// Away from the centre, turned by half a turn.
    Outward { a: Interval, frame: Option<Frame> },
    /// Coordinates are metres from `origin`.
    Line { origin: Vector, direction: Vector },
    /// Coordinates are radians from `origin`.
    /// `to_left` is 1 if the centre is on the left, else -1.
    Arc { origin: Vector, direction: Vector, to_centre: Vector, radius: Interval, to_left: Interval },
}

/// The place of a route's spiral: the spiral about the origin is mirrored (y to -y), rotated and moved.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    centre: Vector,
    /// Cosine and sine of the rotation.
    rotation: Vector,
    is_mirrored: bool,
}

impl Frame {
    fn vector(&self, Vector { x, y }: &Vector) -> Vector {
        let Vector { x: cosine, y: sine } = &self.rotation;
        let y = if self.is_mirrored { -*y } else { *y };
        Vector { x: cosine * x - sine * y, y: sine * x + cosine * y }
    }

    fn at(&self, At { point, tangent }: &At) -> At {
        At { point: self.centre.plus(&self.vector(point)), tangent: self.vector(tangent) }
    }

    /// Returns a curvature to the left, or its rate, of the spiral about the origin in this frame.
    fn bend(frame: Option<&Self>, bend: Interval) -> Interval {
        if frame.is_some_and(|frame| frame.is_mirrored) { -bend } else { bend }
    }
}

/// A point of the path with the unit tangent in the direction of travel.
#[derive(Debug, Clone)]
pub(super) struct At {
    pub point: Vector,
    pub tangent: Vector,
}

impl Curve {
    /// Creates the spiral towards the origin, of `a` metres per radian.
    pub fn inward(a: Interval) -> Self {
        Self::Inward { a, frame: None }
    }

    /// Creates the spiral away from the origin, of `a` metres per radian.
    pub fn outward(a: Interval) -> Self {
        Self::Outward { a, frame: None }
    }

    /// Creates the line from `origin`, `heading` radians from x.
    pub fn line(origin: Vector, heading: &Interval) -> Self {
        Self::Line { origin, direction: direction(heading) }
    }

    /// Creates an arc that begins at `origin` with `direction`. `to_left` is 1 if its centre is on the left, else -1.
    pub fn arc(origin: Vector, direction: Vector, to_left: Interval, radius: Interval) -> Self {
        let to_centre = Vector { x: -(direction.y * to_left), y: direction.x * to_left };
        Self::Arc { origin, direction, to_centre, radius, to_left }
    }

    /// Creates a spiral of `a` metres per radian from `origin`, where its polar angle is `first` and the direction of
    /// travel `heading` radians from x. `to_left` is true if its centre is on the left.
    pub fn spiral_from(
        origin: &Vector,
        heading: &Interval,
        is_inward: bool,
        to_left: bool,
        a: Interval,
        first: &Interval,
    ) -> Self {
        let of = |frame| if is_inward { Self::Inward { a, frame } } else { Self::Outward { a, frame } };
        // About the origin an inward spiral turns right, an outward one left, with the tangent at theta + atan theta +
        // pi.
        let is_mirrored = is_inward == to_left;
        let own_heading = first + elementary::atan(first) + elementary::turns(0.5);
        let turned = if is_mirrored { heading + own_heading } else { heading - own_heading };
        let (sine, cosine) = elementary::sin_cos(&turned);
        let frame = Frame { centre: *origin, rotation: Vector { x: cosine, y: sine }, is_mirrored };
        let centre = origin.minus(&frame.vector(&of(None).at(first).point));
        of(Some(Frame { centre, ..frame }))
    }

    /// Returns true if the coordinate falls with travel.
    pub fn falls(&self) -> bool {
        matches!(self, Self::Inward { .. })
    }

    /// Returns true for a line.
    pub fn is_line(&self) -> bool {
        matches!(self, Self::Line { .. })
    }

    /// Returns true for an arc.
    pub fn is_arc(&self) -> bool {
        matches!(self, Self::Arc { .. })
    }

    /// Returns the metres from the centre at a coordinate of an inward spiral.
    pub fn spiral_radius(&self, coordinate: Interval) -> Option<Interval> {
        match self {
            Self::Inward { a, .. } => Some(a * coordinate),
            _ => None,
        }
    }

    /// Returns point and tangent at a coordinate.
    pub fn at(&self, coordinate: &Interval) -> At {
        match self {
            Self::Inward { a, frame } => {
                let at = spiral_at(a, coordinate);
                frame.as_ref().map_or_else(|| at.clone(), |frame| frame.at(&at))
            }
            Self::Outward { a, frame } => {
                let At { point, tangent } = spiral_at(a, coordinate);
                // Turned by half a turn, and travelled the other way.
                let at = At { point: Vector { x: -point.x, y: -point.y }, tangent };
                frame.as_ref().map_or_else(|| at.clone(), |frame| frame.at(&at))
            }
            Self::Line { origin, direction } => {
                At { point: origin.plus(&direction.scaled(coordinate)), tangent: *direction }
            }
            Self::Arc { origin, direction, to_centre, radius, .. } => {
                let (sine, cosine) = elementary::sin_cos(coordinate);
                let across = to_centre.scaled(&(Interval::new(1.0) - cosine));
                let chord = direction.scaled(&sine).plus(&across);
                let tangent = direction.scaled(&cosine).plus(&to_centre.scaled(&sine));
                At { point: origin.plus(&chord.scaled(radius)), tangent }
            }
        }
    }

    /// Returns the metres of travel from one coordinate to another.
    pub fn metres(&self, from: &Interval, to: &Interval) -> Interval {
        match self {
            Self::Inward { a, .. } => spiral_metres(a, from) - spiral_metres(a, to),
            Self::Outward { a, .. } => spiral_metres(a, to) - spiral_metres(a, from),
            Self::Line { .. } => to - from,
            Self::Arc { radius, .. } => radius * (to - from),
        }
    }

    /// Returns an upper bound of the metres from one coordinate to a later one.
    pub fn metres_bound(&self, from: &Interval, to: &Interval) -> Interval {
        match self {
            // The radian at angle theta is a w(theta) metres long, most at the greater angle.
            Self::Inward { a, .. } => a * w(from) * (from - to),
            Self::Outward { a, .. } => a * w(to) * (to - from),
            Self::Line { .. } | Self::Arc { .. } => self.metres(from, to),
        }
    }

    /// Returns an upper bound of the curvature from one coordinate to a later one, 1/m.
    pub fn curvature_bound(&self, from: &Interval, to: &Interval) -> Interval {
        match self {
            Self::Inward { a, .. } => spiral_curvature(a, to),
            Self::Outward { a, .. } => spiral_curvature(a, from),
            Self::Line { .. } => Interval::new(0.0),
            Self::Arc { radius, .. } => Interval::new(1.0) / radius,
        }
    }

    /// Returns an upper bound of the radians by which the path turns from one coordinate to a later one.
    pub fn turning_bound(&self, from: &Interval, to: &Interval) -> Interval {
        let spiral = |outer: &Interval, inner: &Interval| {
            let square = inner.square();
            (outer - inner) * (square + Interval::new(2.0)) / (square + Interval::new(1.0))
        };
        match self {
            Self::Inward { .. } => spiral(from, to),
            Self::Outward { .. } => spiral(to, from),
            Self::Line { .. } => Interval::new(0.0),
            Self::Arc { .. } => to - from,
        }
    }

    /// Returns the curvature from one coordinate to a later one, positive to the left, 1/m.
    pub fn bend(&self, from: &Interval, to: &Interval) -> Interval {
        match self {
            // The curvature falls with the angle.
            Self::Inward { a, frame } => {
                Frame::bend(frame.as_ref(), -spiral_curvature(a, from).hull(&spiral_curvature(a, to)))
            }
            Self::Outward { a, frame } => {
                Frame::bend(frame.as_ref(), spiral_curvature(a, from).hull(&spiral_curvature(a, to)))
            }
            Self::Line { .. } => Interval::new(0.0),
            Self::Arc { radius, to_left, .. } => to_left / radius,
        }
    }

    /// Returns the change of that curvature per metre from one coordinate to a later one, 1/m^2.
    pub fn bend_rate(&self, from: &Interval, to: &Interval) -> Interval {
        match self {
            Self::Inward { a, frame } | Self::Outward { a, frame } => {
                let theta = from.hull(to);
                let square = theta.square();
                let w_squared = square + Interval::new(1.0);
                let rate = -(theta * (square + Interval::new(4.0)) / (a.square() * w_squared * w_squared.square()));
                Frame::bend(frame.as_ref(), rate)
            }
            Self::Line { .. } | Self::Arc { .. } => Interval::new(0.0),
        }
    }

    /// Returns a double near the metres per unit of the coordinate, negative if the coordinate falls with travel.
    pub fn rough_speed(&self, coordinate: f64) -> f64 {
        match self {
            Self::Inward { a, .. } => -a.rough() * coordinate.hypot(1.0),
            Self::Outward { a, .. } => a.rough() * coordinate.hypot(1.0),
            Self::Line { .. } => 1.0,
            Self::Arc { radius, .. } => radius.rough(),
        }
    }
}

fn w(theta: &Interval) -> Interval {
    (theta.square() + Interval::new(1.0)).sqrt()
}

fn spiral_at(a: &Interval, theta: &Interval) -> At {
    let (sine, cosine) = elementary::sin_cos(theta);
    let w = w(theta);
    let radius = a * theta;
    let point = Vector { x: cosine * radius, y: sine * radius };
    let tangent = Vector { x: (theta * sine - cosine) / w, y: -(theta * cosine + sine) / w };
    At { point, tangent }
}

/// Returns the metres from the centre: a / 2 (theta w + asinh theta).
fn spiral_metres(a: &Interval, theta: &Interval) -> Interval {
    let w = w(theta);
    let asinh = elementary::ln(&(theta + w));
    a * Interval::new(0.5) * (theta * w + asinh)
}

fn spiral_curvature(a: &Interval, theta: &Interval) -> Interval {
    let square = theta.square();
    let w_squared = square + Interval::new(1.0);
    (square + Interval::new(2.0)) / (a * w_squared * w_squared.sqrt())
}

/// Returns the unit vector of a heading, in radians from x.
pub(super) fn direction(heading: &Interval) -> Vector {
    let (sine, cosine) = elementary::sin_cos(heading);
    Vector { x: cosine, y: sine }
}
