//! Reads the pieces of a route: lines, arcs, spirals, and turns from an inward spiral to the outward one about the same
//! centre.

use serde::Deserialize;

use super::curve::{Curve, direction};
use super::elementary;
use super::interval::{Interval, Vector};
use super::path::{Path, PathEnd, Segment};
use super::problem::{Checked, ensure, problem};

/// Limit of the pieces of a route, as in a show: the cost of a step grows with them.
const MOST_PIECES: usize = 4096;
/// The radius of the first arc of a turn over that of the second, unless the scene has another.
const ARC_RATIO: f64 = 2.0;

#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum PieceText {
    Line {
        length: f64,
    },
    Arc {
        radius: f64,
        side: Side,
        turns: Option<f64>,
        length: Option<f64>,
    },
    Spiral {
        pitch: Option<f64>,
        radius: Option<f64>,
        direction: Option<Way>,
        side: Option<Side>,
        turns: Option<f64>,
        length: Option<f64>,
        to_radius: Option<f64>,
    },
    Turn {
        arc_ratio: Option<f64>,
    },
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
pub(super) enum Way {
    In,
    Out,
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
pub(super) enum Side {
    Left,
    Right,
}

impl Side {
    fn opposite(self) -> Self {
        if self == Self::Left { Self::Right } else { Self::Left }
    }

    /// Returns 1 on the left, -1 on the right.
    fn to_left(self) -> Interval {
        Interval::new(if self == Self::Left { 1.0 } else { -1.0 })
    }
}

/// A place on a spiral: the side of its centre, its metres per radian, and the polar angle.
#[derive(Clone, Copy)]
struct OnSpiral {
    side: Side,
    a: Interval,
    angle: Interval,
}

/// The end of a piece, on which the next piece may depend.
#[derive(Clone, Copy)]
enum Ending {
    Inward(OnSpiral),
    /// The beginning of the outward spiral after a turn.
    Turned(OnSpiral),
    Any,
}

/// A route up to some piece.
struct Route {
    segments: Vec<Segment>,
    origin: Vector,
    /// Directions follow from the angle turned so far: the product of thousands of rotations would be too wide.
    heading: Interval,
    length: Interval,
    end: Interval,
    ending: Ending,
}

/// Reads a route, in its own coordinates: no statement of a certificate depends on the place of its start.
pub(super) fn route(start: [f64; 2], heading_turns: f64, pieces: &[PieceText]) -> Checked<Path> {
    if pieces.is_empty() || pieces.len() > MOST_PIECES {
        return Err(problem!("path.pieces has {} pieces, expected from 1 to {MOST_PIECES}", pieces.len()));
    }
    Interval::finite("path.heading_turns", heading_turns)?;
    Interval::finite("path.start", start[0]).and(Interval::finite("path.start", start[1]))?;
    let zero = Interval::new(0.0);
    let (origin, heading) = (Vector { x: zero, y: zero }, elementary::turns(heading_turns));
    let behind = Segment { curve: Curve::line(origin, &heading), begin: None, end: Some(zero) };
    let mut route = Route { segments: vec![behind], origin, heading, length: zero, end: zero, ending: Ending::Any };
    for piece in pieces {
        route.read(piece)?;
    }
    // The last segment continues beyond the path's end.
    if let Some(last) = route.segments.last_mut() {
        last.end = None;
    }
    Ok(Path::new(route.segments, zero, PathEnd::Coordinate(route.end), route.length))
}

impl Route {
    fn read(&mut self, piece: &PieceText) -> Checked {
        let before = std::mem::replace(&mut self.ending, Ending::Any);
        match *piece {
            PieceText::Line { length } => {
                let end = Interval::positive("path.pieces.length", length)?;
                let zero = Interval::new(0.0);
                self.push(Curve::line(self.origin, &self.heading), zero, end, zero);
            }
            PieceText::Arc { radius, side, turns, length } => {
                let radius = Interval::positive("path.pieces.radius", radius)?;
                let angle = match (turns, length) {
                    (Some(turns), None) => {
                        Interval::positive("path.pieces.turns", turns)?;
                        elementary::turns(turns)
                    }
                    (None, Some(length)) => Interval::positive("path.pieces.length", length)? / radius,
                    _ => return Err(problem!("an arc has either turns or a length")),
                };
                self.arc(side, radius, angle);
            }
            PieceText::Spiral { pitch, radius, direction, side, turns, length, to_radius } => {
                let (begin, way) = match (before, pitch, radius, direction, side) {
                    (Ending::Turned(begin), None, None, None | Some(Way::Out), None) => (begin, Way::Out),
                    (Ending::Inward(_) | Ending::Any, Some(pitch), Some(radius), Some(way), Some(side)) => {
                        let a = Interval::positive("path.pieces.pitch", pitch)? / elementary::turns(1.0);
                        let angle = Interval::positive("path.pieces.radius", radius)? / a;
                        (OnSpiral { side, a, angle }, way)
                    }
                    _ => {
                        return Err(problem!(
                            "a spiral has a pitch, a radius, a direction and a side, or follows a turn"
                        ));
                    }
                };
                let last = last_of_spiral(&begin, way, [turns, length, to_radius])?;
                self.spiral(&begin, way, last);
            }
            PieceText::Turn { arc_ratio } => {
                let Ending::Inward(begin) = before else {
                    return Err(problem!("a turn has to follow an inward spiral"));
                };
                self.turn(&begin, Interval::positive("path.pieces.arc_ratio", arc_ratio.unwrap_or(ARC_RATIO))?);
            }
        }
        Ok(())
    }

    /// Adds a curve from one coordinate to another that turns by `turned` radians to the left.
    fn push(&mut self, curve: Curve, begin: Interval, end: Interval, turned: Interval) {
        self.length = self.length + curve.metres(&begin, &end);
        self.origin = curve.at(&end).point;
        self.heading = self.heading + turned;
        self.end = end;
        self.segments.push(Segment { curve, begin: Some(begin), end: Some(end) });
    }

    fn arc(&mut self, side: Side, radius: Interval, angle: Interval) {
        let curve = Curve::arc(self.origin, direction(&self.heading), side.to_left(), radius);
        self.push(curve, Interval::new(0.0), angle, side.to_left() * angle);
    }

    fn spiral(&mut self, begin: &OnSpiral, way: Way, last: Interval) {
        let OnSpiral { side, a, angle: first } = *begin;
        let is_inward = way == Way::In;
        let (inner, outer) = if is_inward { (last, first) } else { (first, last) };
        let turned = (outer - inner) + (elementary::atan(&outer) - elementary::atan(&inner));
        let curve = Curve::spiral_from(&self.origin, &self.heading, is_inward, side == Side::Left, a, &first);
        self.push(curve, first, last, side.to_left() * turned);
        if is_inward {
            self.ending = Ending::Inward(OnSpiral { angle: last, ..*begin });
        }
    }

    /// Adds the two arcs of a turn. With R = a theta their radii sum to sqrt(R^2 + a^2), and each turns by 2 atan
    /// theta, one to each side.
    fn turn(&mut self, begin: &OnSpiral, ratio: Interval) {
        let OnSpiral { side, a, angle: theta } = *begin;
        let one = Interval::new(1.0);
        let second = a * (theta.square() + one).sqrt() / (one + ratio);
        let angle = elementary::atan(&theta) * Interval::new(2.0);
        self.arc(side, second * ratio, angle);
        self.arc(side.opposite(), second, angle);
        self.ending = Ending::Turned(OnSpiral { side: side.opposite(), ..*begin });
    }
}

/// Returns the last polar angle of a spiral, from its turns, its length or its last radius.
fn last_of_spiral(begin: &OnSpiral, way: Way, [turns, length, to_radius]: [Option<f64>; 3]) -> Checked<Interval> {
    let OnSpiral { side: _, a, angle: first } = *begin;
    let is_inward = way == Way::In;
    let last = match (turns, length, to_radius) {
        (Some(turns), None, None) => {
            Interval::positive("path.pieces.turns", turns)?;
            let around = elementary::turns(turns);
            if is_inward { first - around } else { first + around }
        }
        (None, Some(length), None) => {
            let metres = Interval::positive("path.pieces.length", length)?;
            last_angle(&a, &first, &if is_inward { -metres } else { metres })?
        }
        (None, None, Some(radius)) => {
            let last = Interval::positive("path.pieces.to_radius", radius)? / a;
            let (inner, outer) = if is_inward { (last, first) } else { (first, last) };
            ensure!(inner.is_below(&outer), "a spiral leads to the radius from which it begins, or past it");
            last
        }
        _ => return Err(problem!("a spiral has one of turns, a length and a to_radius")),
    };
    if last.is_positive() { Ok(last) } else { Err(problem!("a spiral leads to its centre or past it")) }
}

/// Returns the polar angle `metres` of a spiral further out than `first`, further in if they are negative. The angle
/// comes from a step of Newton's method from a guess. The root is within an interval if the step from its middle leads
/// into the interval with every rate in it.
fn last_angle(a: &Interval, first: &Interval, metres: &Interval) -> Checked<Interval> {
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
    if is_found { Ok(last) } else { Err(problem!("a spiral's length leads to its centre or past it")) }
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
