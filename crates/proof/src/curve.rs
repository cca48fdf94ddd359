//! The curves of a path, in intervals: as functions of their coordinate, and as pieces in the text of a scene
//! (docs/proofs.md, "Definitions"). No other file matches on the kinds of curves.

use serde::Deserialize;

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

#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum PieceText {
    Line { length: f64 },
    Arc { radius: f64, side: Side, turns: Option<f64>, length: Option<f64> },
    Spiral { pitch: f64, radius: f64, direction: Way, side: Side, turns: Option<f64>, length: Option<f64> },
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
pub(super) enum Way {
    In,
    Out,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
pub(super) enum Side {
    Left,
    Right,
}

fn direction(heading: &Interval) -> Vector {
    let (sine, cosine) = elementary::sin_cos(heading);
    Vector { x: cosine, y: sine }
}

/// Returns the curve of a piece that begins at `origin`, its first and last coordinates, and the radians by which it
/// turns to the left.
pub(super) fn read_piece(
    piece: &PieceText,
    origin: Vector,
    heading: &Interval,
) -> Result<(Curve, Interval, Interval, Interval), String> {
    let zero = Interval::new(0.0);
    let to_left = |side: &Side| Interval::new(if matches!(side, Side::Left) { 1.0 } else { -1.0 });
    match piece {
        PieceText::Line { length } => {
            let end = Interval::positive("path.pieces.length", *length)?;
            Ok((Curve::line(origin, heading), zero, end, zero))
        }
        PieceText::Arc { radius, side, turns, length } => {
            let radius = Interval::positive("path.pieces.radius", *radius)?;
            let end = match (turns, length) {
                (Some(turns), None) => {
                    Interval::positive("path.pieces.turns", *turns)?;
                    elementary::turns(*turns)
                }
                (None, Some(length)) => Interval::positive("path.pieces.length", *length)? / radius,
                _ => return Err("an arc has either turns or a length".to_owned()),
            };
            let curve = Curve::arc(origin, direction(heading), to_left(side), radius);
            Ok((curve, zero, end, to_left(side) * end))
        }
        PieceText::Spiral { pitch, radius, direction, side, turns, length } => {
            let a = Interval::positive("path.pieces.pitch", *pitch)? / elementary::turns(1.0);
            let first = Interval::positive("path.pieces.radius", *radius)? / a;
            let is_inward = *direction == Way::In;
            let last = match (turns, length) {
                (Some(turns), None) => {
                    Interval::positive("path.pieces.turns", *turns)?;
                    let around = elementary::turns(*turns);
                    if is_inward { first - around } else { first + around }
                }
                (None, Some(length)) => {
                    let metres = Interval::positive("path.pieces.length", *length)?;
                    last_angle(&a, &first, &if is_inward { -metres } else { metres })?
                }
                _ => return Err("a spiral has either turns or a length".to_owned()),
            };
            if !last.is_positive() {
                return Err("a spiral leads to its centre or past it".to_owned());
            }
            let (inner, outer) = if is_inward { (last, first) } else { (first, last) };
            let turned = (outer - inner) + (elementary::atan(&outer) - elementary::atan(&inner));
            let is_left = matches!(side, Side::Left);
            let curve = Curve::spiral_from(&origin, heading, is_inward, is_left, a, &first);
            Ok((curve, first, last, to_left(side) * turned))
        }
    }
}

/// Returns the polar angle `metres` of a spiral further out than `first`, further in if they are negative. The angle
/// comes from a step of Newton's method from a guess. The root is within an interval if the step from its middle leads
/// into the interval with every rate in it.
fn last_angle(a: &Interval, first: &Interval, metres: &Interval) -> Result<Interval, String> {
    let outward = Curve::outward(*a);
    let step = |from: f64, within: &Interval| {
        let rate = a * (within.square() + Interval::new(1.0)).sqrt();
        (metres - outward.metres(first, &Interval::new(from))) / rate
    };
    let guess = rough_angle(metres.rough() / a.rough(), first.rough());
    // Near the centre the guess lacks digits, as a difference of lengths.
    let guess = (0..4).fold(guess, |guess, _| guess + step(guess, &Interval::new(guess)).rough());
    let within = Interval::new(guess) + Interval::new(1e-9 * guess.abs()).around_zero();
    let last = Interval::new(guess) + step(guess, &within);
    let is_found = guess > 0.0 && (last - Interval::new(guess)).abs().is_below(&Interval::new(1e-9 * guess));
    if is_found { Ok(last) } else { Err("a spiral's length leads to its centre or past it".to_owned()) }
}

/// Returns a double near the polar angle that is `length` further out than `first` on the spiral r = theta.
fn rough_angle(length: f64, first: f64) -> f64 {
    let of = |theta: f64| 0.5 * (theta * theta.hypot(1.0) + theta.asinh());
    let target = of(first) + length;
    // The length is convex: Newton's method comes down from a guess that is too far out.
    let mut theta = (2.0 * target.max(0.0)).sqrt();
    for _ in 0..100 {
        theta -= (of(theta) - target) / theta.hypot(1.0);
    }
    theta
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The metres to the angle found are the requested metres, with more digits than a double has, up to a centimetre
    /// from the centre.
    #[test]
    fn the_angle_after_some_metres_of_a_spiral() {
        let a = Interval::new(1.7) / elementary::turns(1.0);
        let first = Interval::new(12.0) / a;
        let to_centre = Curve::inward(a).metres(&first, &Interval::new(0.0));
        let inward = [1e-3, 40.0, 266.0].map(|metres| Interval::new(-metres));
        let outward = [1e-3, 1.0, 1e5].map(Interval::new);
        let near_the_centre = [Interval::new(0.01) - to_centre];
        for metres in inward.into_iter().chain(outward).chain(near_the_centre) {
            let last = last_angle(&a, &first, &metres).unwrap();
            let found = Curve::outward(a).metres(&first, &last);
            assert!((found - metres).abs().is_below(&Interval::new(1e-19)), "{}", metres.rough());
        }
        assert!(last_angle(&a, &first, &-to_centre).is_err());
        assert!(last_angle(&a, &first, &Interval::new(-300.0)).is_err());
    }
}
