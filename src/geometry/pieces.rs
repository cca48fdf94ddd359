//! A path made of pieces: spiral inward, arcs and lines, spiral outward, one after the other without a corner.
//!
//! The chain rides it through [`Path`]; scenes construct it. Every piece keeps a coordinate of its own, so that a place
//! far along the path has lost no digits.

use std::f64::consts::FRAC_PI_2;

use super::path::{BenchOnPath, Fold, Path};
use super::root::increasing_root;
use super::spiral::{Angle, Spiral, two_sum};
use super::{Point, Vector};

/// A place on one of the pieces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PiecePlace {
    piece: usize,
    at: Coordinate,
}

impl PiecePlace {
    /// The piece, counted from 0.
    pub fn piece(&self) -> usize {
        self.piece
    }
}

/// Where on its piece a place is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Coordinate {
    /// The polar angle on a spiral.
    Polar(Angle),
    /// Radians turned since the start of an arc, metres since the start of a line; what the first part has rounded away
    /// is in the second.
    Since(f64, f64),
}

impl Coordinate {
    const START: Self = Self::Since(0.0, 0.0);

    fn plus(self, by: f64) -> Self {
        match self {
            Self::Polar(angle) => Self::Polar(angle.plus(by)),
            Self::Since(high, low) => {
                let (sum, error) = two_sum(high, by);
                let (high, low) = two_sum(sum, error + low);
                Self::Since(high, low)
            }
        }
    }

    fn minus(self, other: Self) -> f64 {
        match (self, other) {
            (Self::Polar(one), Self::Polar(other)) => one.minus(other),
            _ => {
                let ((high, low), (other_high, other_low)) = (self.since(), other.since());
                (high - other_high) + (low - other_low)
            }
        }
    }

    fn angle(self) -> Angle {
        match self {
            Self::Polar(angle) => angle,
            Self::Since(high, _) => Angle::from_radians(high),
        }
    }

    fn since(self) -> (f64, f64) {
        match self {
            Self::Since(high, low) => (high, low),
            Self::Polar(angle) => (angle.radians(), 0.0),
        }
    }
}

/// Which way an arc turns, seen in the direction of travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Counter-clockwise.
    Left,
    /// Clockwise.
    Right,
}

/// One leg of a route.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Leg {
    /// Straight on.
    Line {
        /// Metres.
        length: f64,
    },
    /// Along a circle.
    Arc {
        /// The side on which the circle's centre is.
        side: Side,
        /// How far the direction turns, in turns (90 degrees are a quarter).
        turns: f64,
        /// Metres.
        radius: f64,
    },
}

/// Two pieces that do not join: the path would have a gap or a corner.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("piece {piece} does not join the one before it: a gap of {gap:e} m, a corner of {corner:e} rad")]
pub struct Disjoint {
    /// The later of the two pieces, counted from 0.
    pub piece: usize,
    /// Metres between the end of one and the start of the other.
    pub gap: f64,
    /// Radians between their directions.
    pub corner: f64,
}

/// An arc of a circle, from a point in a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Arc {
    start: Point,
    tangent: Vector,
    /// Unit vector towards the centre.
    inward: Vector,
    radius: f64,
    /// Radians.
    angle: f64,
}

impl Arc {
    fn new(start: Point, tangent: Vector, side: Side, radius: f64, angle: f64) -> Self {
        let left = Vector::new(-tangent.y, tangent.x);
        let inward = match side {
            Side::Left => left,
            Side::Right => -left,
        };
        Self { start, tangent, inward, radius, angle }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Curve {
    /// Inward along a spiral up to its own start, from as far out as a team needs.
    Inward(Spiral),
    /// Outward from that start along the same spiral turned by half a turn, for ever.
    Outward(Spiral),
    Arc(Arc),
    Line {
        start: Point,
        tangent: Vector,
        length: f64,
    },
}

/// How far, in radians, one step of the search for a follower may go along a spiral.
const LONGEST_POLAR_STEP: f64 = 0.5;

impl Curve {
    fn point(&self, at: Coordinate) -> Point {
        match self {
            Self::Inward(spiral) => spiral.point(at.angle()),
            Self::Outward(spiral) => -spiral.point(at.angle()),
            Self::Arc(arc) => {
                let (half_sine, half_cosine) = half_angle(at);
                let (along, inward) = (2.0 * half_sine * half_cosine, 2.0 * half_sine * half_sine);
                arc.start + arc.radius * (along * arc.tangent + inward * arc.inward)
            }
            Self::Line { start, tangent, .. } => {
                let (high, low) = at.since();
                start + high * tangent + low * tangent
            }
        }
    }

    fn tangent(&self, at: Coordinate) -> Vector {
        match self {
            // Turned by half a turn and travelled the other way, the outward spiral has the inward one's tangent.
            Self::Inward(spiral) | Self::Outward(spiral) => spiral.tangent(at.angle()),
            Self::Arc(arc) => {
                let (half_sine, half_cosine) = half_angle(at);
                let (sine, versine) = (2.0 * half_sine * half_cosine, 2.0 * half_sine * half_sine);
                arc.tangent + (sine * arc.inward - versine * arc.tangent)
            }
            Self::Line { tangent, .. } => *tangent,
        }
    }

    fn first(&self) -> Coordinate {
        match self {
            Self::Inward(_) => Coordinate::Polar(Angle::from_turns(f64::INFINITY)),
            Self::Outward(spiral) => Coordinate::Polar(spiral.start()),
            Self::Arc(_) | Self::Line { .. } => Coordinate::START,
        }
    }

    fn last(&self) -> Coordinate {
        match self {
            Self::Inward(spiral) => Coordinate::Polar(spiral.start()),
            Self::Outward(_) => Coordinate::Polar(Angle::from_turns(f64::INFINITY)),
            Self::Arc(arc) => Coordinate::Since(arc.angle, 0.0),
            Self::Line { length, .. } => Coordinate::Since(*length, 0.0),
        }
    }

    /// The place `metres` after the start of the piece, for an inward spiral before its end.
    fn after(&self, metres: f64) -> Coordinate {
        match self {
            Self::Inward(spiral) | Self::Outward(spiral) => Coordinate::Polar(spiral.place_at(-metres)),
            Self::Arc(arc) => {
                let angle = metres / arc.radius;
                Coordinate::Since(angle, (-angle).mul_add(arc.radius, metres) / arc.radius)
            }
            Self::Line { .. } => Coordinate::Since(metres, 0.0),
        }
    }

    /// Metres from one place of this piece to another.
    fn distance(&self, behind: Coordinate, ahead: Coordinate) -> f64 {
        match self {
            Self::Inward(spiral) => spiral.distance_between(behind.angle(), ahead.angle()),
            Self::Outward(spiral) => spiral.distance_between(ahead.angle(), behind.angle()),
            Self::Arc(arc) => arc.radius * ahead.minus(behind),
            Self::Line { .. } => ahead.minus(behind),
        }
    }

    /// Metres per unit of the coordinate.
    fn stretch(&self, at: Coordinate) -> f64 {
        match self {
            Self::Inward(spiral) | Self::Outward(spiral) => spiral.growth() * 1f64.hypot(at.angle().radians()),
            Self::Arc(arc) => arc.radius,
            Self::Line { .. } => 1.0,
        }
    }

    /// The coordinate `by` units further back.
    fn back(&self, at: Coordinate, by: f64) -> Coordinate {
        match self {
            Self::Inward(_) => at.plus(by),
            Self::Outward(_) | Self::Arc(_) | Self::Line { .. } => at.plus(-by),
        }
    }

    /// Units of the coordinate that are left behind a place.
    fn left_behind(&self, at: Coordinate) -> f64 {
        match self {
            Self::Inward(_) => f64::INFINITY,
            Self::Outward(_) | Self::Arc(_) | Self::Line { .. } => at.minus(self.first()),
        }
    }

    /// Half the most that the second derivative of the squared distance from a point can be, by the coordinate, where
    /// that distance is at most `reach` and the place at most [`longest_step`](Self::longest_step) behind `at`:
    /// |p'|^2 + (p - F) . p'' <= |p'|^2 + reach |p''|.
    fn bend(&self, at: Coordinate, reach: f64) -> f64 {
        let polar = |spiral: &Spiral, theta: f64| {
            let a = spiral.growth();
            a * a * (1.0 + theta * theta) + reach * a * 2f64.hypot(theta)
        };
        match self {
            Self::Inward(spiral) => polar(spiral, at.angle().radians() + LONGEST_POLAR_STEP),
            Self::Outward(spiral) => polar(spiral, at.angle().radians()),
            Self::Arc(arc) => arc.radius * (arc.radius + reach),
            Self::Line { .. } => 1.0,
        }
    }

    fn longest_step(&self) -> f64 {
        match self {
            Self::Inward(_) | Self::Outward(_) => LONGEST_POLAR_STEP,
            Self::Arc(_) | Self::Line { .. } => f64::INFINITY,
        }
    }

    /// The curvature at a place, 1/m. A spiral's is (2 + theta^2) / (a (1 + theta^2)^(3/2)), which falls outward.
    fn curvature(&self, at: Coordinate) -> f64 {
        match self {
            Self::Inward(spiral) | Self::Outward(spiral) => {
                let square = at.angle().radians().powi(2);
                (2.0 + square) / (spiral.growth() * (1.0 + square).powf(1.5))
            }
            Self::Arc(arc) => arc.radius.recip(),
            Self::Line { .. } => 0.0,
        }
    }
}

/// Sine and cosine of half the angle turned on an arc.
fn half_angle(at: Coordinate) -> (f64, f64) {
    let (high, low) = at.since();
    let (sine, cosine) = (0.5 * high).sin_cos();
    (cosine.mul_add(0.5 * low, sine), (-sine).mul_add(0.5 * low, cosine))
}

/// Where the search for a follower on the front handle's own piece ended.
enum OnOwnPiece {
    Found(Coordinate),
    /// Everything behind the front handle on its piece is nearer than the link.
    AllNearer,
    Unknown,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Piece {
    curve: Curve,
    /// Metres of travel at which it begins; minus infinity for an inward spiral.
    begin: f64,
    /// Metres of travel at which it ends.
    end: f64,
}

impl Piece {
    /// The place at so many metres of travel of the whole path.
    fn place_at(&self, travelled: f64) -> Coordinate {
        match self.curve {
            Curve::Inward(_) => self.curve.after(self.end - travelled),
            _ => self.curve.after(travelled - self.begin),
        }
    }
}

/// What a drawing needs of a piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Which curve it is.
    pub kind: ShapeKind,
    /// Where it begins.
    pub start: Point,
    /// Direction of travel there, radians counter-clockwise from x.
    pub heading: f64,
    /// Metres along it.
    pub length: f64,
}

/// The curve of a piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ShapeKind {
    /// Straight on.
    Line,
    /// Part of a circle.
    Arc {
        /// 1/m, positive where it turns left.
        curvature: f64,
    },
    /// Inward along r = pitch theta / 2 pi.
    Inward {
        /// Metres per turn.
        pitch: f64,
        /// Polar angle where it begins, radians.
        first: f64,
        /// Polar angle where it ends, radians.
        last: f64,
    },
    /// Outward along the same spiral turned by half a turn.
    Outward {
        /// Metres per turn.
        pitch: f64,
        /// Polar angle on the unturned spiral where it begins, radians.
        first: f64,
        /// Polar angle on the unturned spiral where it ends, radians.
        last: f64,
    },
}

/// A path of pieces, each continuing the one before it in place and direction.
#[derive(Debug, Clone, PartialEq)]
pub struct PiecePath {
    pieces: Vec<Piece>,
}

impl PiecePath {
    /// Inward along the spiral r = a theta (a = `pitch` / 2 pi) up to `turn_radius`, through an S of two arcs to the
    /// opposite point, and outward along the same spiral turned by half a turn. Travel starts `lead_in` metres before
    /// the turn and ends `lead_out` metres after it.
    ///
    /// With R = `turn_radius` the chords of both arcs lie on the diameter through the two ends and make the same angle
    /// atan(R/a) with the tangents there. So both arcs turn by twice that angle, their radii sum to sqrt(R^2 + a^2),
    /// and their lengths to 2 sqrt(R^2 + a^2) atan(R/a), whatever `arc_ratio`, the first radius over the second.
    ///
    /// # Errors
    /// [`Disjoint`] where numbers so extreme are given that rounding leaves a gap.
    pub fn turnaround(
        pitch: f64,
        turn_radius: f64,
        arc_ratio: f64,
        lead_in: f64,
        lead_out: f64,
    ) -> Result<Self, Disjoint> {
        let spiral = Spiral::new(pitch, turn_radius / pitch);
        let both = turn_radius.hypot(spiral.growth());
        let second_radius = both / (1.0 + arc_ratio);
        let first_radius = arc_ratio * second_radius;
        let angle = 2.0 * (turn_radius / spiral.growth()).atan();
        let (start, tangent) = (spiral.point(spiral.start()), spiral.tangent(spiral.start()));
        let first = Arc::new(start, tangent, Side::Right, first_radius, angle);
        let middle = start + (-2.0 * first_radius / both) * start.coords;
        let second =
            Arc::new(middle, Curve::Arc(first).tangent(Curve::Arc(first).last()), Side::Left, second_radius, angle);
        let mut path = Self { pieces: Vec::new() };
        path.pieces.push(Piece { curve: Curve::Inward(spiral), begin: f64::NEG_INFINITY, end: lead_in });
        path.push(Curve::Arc(first), first_radius * angle);
        path.push(Curve::Arc(second), second_radius * angle);
        path.push(Curve::Outward(spiral), lead_out);
        path.joined()
    }

    /// The legs of a route, the first from `start` in the direction `heading_turns` turns counter-clockwise from x.
    /// Travel starts `head_start` metres after the first point of the route.
    ///
    /// # Errors
    /// [`Disjoint`] where numbers so extreme are given that rounding leaves a gap.
    pub fn route(start: Point, heading_turns: f64, legs: &[Leg], head_start: f64) -> Result<Self, Disjoint> {
        let mut path = Self { pieces: Vec::new() };
        let (mut from, mut turns) = (start, heading_turns);
        for leg in legs {
            let (sine, cosine) = Angle::from_turns(turns).sin_cos();
            let tangent = Vector::new(cosine, sine);
            let (curve, length) = match *leg {
                Leg::Line { length } => (Curve::Line { start: from, tangent, length }, length),
                Leg::Arc { side, turns: turned, radius } => {
                    let angle = std::f64::consts::TAU * turned;
                    turns += if side == Side::Left { turned } else { -turned };
                    (Curve::Arc(Arc::new(from, tangent, side, radius, angle)), radius * angle)
                }
            };
            if path.pieces.is_empty() {
                path.pieces.push(Piece { curve, begin: -head_start, end: length - head_start });
            } else {
                path.push(curve, length);
            }
            from = curve.point(curve.last());
        }
        path.joined()
    }

    fn push(&mut self, curve: Curve, length: f64) {
        let begin = self.pieces.last().map_or(0.0, |piece| piece.end);
        self.pieces.push(Piece { curve, begin, end: begin + length });
    }

    /// The path itself where every piece continues the one before it.
    fn joined(self) -> Result<Self, Disjoint> {
        for (index, pair) in self.pieces.windows(2).enumerate() {
            let (before, after) = (&pair[0].curve, &pair[1].curve);
            let (end, start) = (before.point(before.last()), after.point(after.first()));
            let (old, new) = (before.tangent(before.last()), after.tangent(after.first()));
            let gap = (end - start).norm();
            let corner = (old.x * new.y - old.y * new.x).atan2(old.dot(&new)).abs();
            let sharpest = before.curvature(before.last()).max(after.curvature(after.first()));
            let size = end.coords.norm() + 1.0 / sharpest.max(1.0);
            // Not a number is no join either.
            if !(gap <= 1e-12 * size && corner <= 1e-12) {
                return Err(Disjoint { piece: index + 1, gap, corner });
            }
        }
        Ok(self)
    }

    /// The number of pieces.
    pub fn pieces(&self) -> usize {
        self.pieces.len()
    }

    /// Metres of travel at which each piece after the first begins.
    pub fn junctions(&self) -> impl Iterator<Item = f64> + '_ {
        self.pieces[1..].iter().map(|piece| piece.begin)
    }

    /// Metres of travel at the first point of the path; minus infinity where it comes in from a spiral.
    pub fn first_point(&self) -> f64 {
        self.pieces[0].begin
    }

    /// The greatest curvature anywhere, 1/m: the tangent turns by no more than this per metre.
    pub fn sharpest_curvature(&self) -> f64 {
        self.sharpest_between(f64::NEG_INFINITY, f64::INFINITY)
    }

    /// The greatest curvature from one distance of travel to another, 1/m.
    pub fn sharpest_between(&self, from: f64, to: f64) -> f64 {
        let met = self.pieces.iter().filter(|piece| piece.begin <= to && piece.end >= from);
        met.map(|piece| {
            let nearest = match piece.curve {
                Curve::Inward(_) => to.min(piece.end),
                _ => from.max(piece.begin),
            };
            piece.curve.curvature(piece.place_at(nearest))
        })
        .fold(0.0, f64::max)
    }

    /// Metres of travel at a place.
    pub fn travelled(&self, place: PiecePlace) -> f64 {
        let Piece { curve, begin, end } = &self.pieces[place.piece];
        match curve {
            Curve::Inward(_) => end - curve.distance(place.at, curve.last()),
            _ => begin + curve.distance(curve.first(), place.at),
        }
    }

    /// Metres of travel at the end of a place's piece where that is a line or an arc.
    pub fn end_of_even_piece(&self, place: PiecePlace) -> Option<f64> {
        let piece = &self.pieces[place.piece];
        matches!(piece.curve, Curve::Arc(_) | Curve::Line { .. }).then_some(piece.end)
    }

    /// Metres of travel up to which a path that comes in from a spiral is still so far out on it that no link of this
    /// length can stall or lock; minus infinity for other paths.
    ///
    /// On a spiral t . b of a front handle is positive beyond theta = link / a and theta = 1, and a fold is further in.
    pub fn calm_until(&self, link: f64) -> f64 {
        let Piece { curve: Curve::Inward(spiral), end, .. } = self.pieces[0] else { return f64::NEG_INFINITY };
        let calm = (link / spiral.growth()).max(1.0);
        let start = spiral.start();
        if start.radians() >= calm {
            return end;
        }
        end - spiral.distance_between(Angle::from_radians(calm), start)
    }

    /// Whether a link whose rear handle is here is so far out on the outward spiral that it can never stall or lock
    /// again: there its two ends are those of a bench on the inward spiral, exchanged.
    pub fn is_calm_from(&self, rear: PiecePlace, link: f64) -> bool {
        match self.curve(rear) {
            Curve::Outward(spiral) => rear.at.angle().radians() > (link / spiral.growth()).max(1.0),
            _ => false,
        }
    }

    /// The spiral on which the path comes in, from where the head starts, and the metres of travel at its end; `None`
    /// for other paths.
    pub fn approach(&self) -> Option<(Spiral, f64)> {
        let Piece { curve: Curve::Inward(spiral), end, .. } = self.pieces[0] else { return None };
        let start = spiral.place_at(-end).in_turns();
        Some((Spiral::new(spiral.pitch(), start), end))
    }

    /// What a drawing needs of each piece, in order; of a spiral that comes in, the part from where the head starts.
    pub fn shapes(&self) -> impl Iterator<Item = Shape> + '_ {
        self.pieces.iter().map(|piece| {
            let begin = piece.begin.max(0.0_f64.min(piece.end));
            let (first, last) = (piece.place_at(begin), piece.place_at(piece.end));
            let tangent = piece.curve.tangent(first);
            let kind = match piece.curve {
                Curve::Line { .. } => ShapeKind::Line,
                Curve::Arc(arc) => {
                    let left = arc.tangent.x * arc.inward.y - arc.tangent.y * arc.inward.x;
                    ShapeKind::Arc { curvature: left.signum() / arc.radius }
                }
                Curve::Inward(spiral) => ShapeKind::Inward {
                    pitch: spiral.pitch(),
                    first: first.angle().radians(),
                    last: last.angle().radians(),
                },
                Curve::Outward(spiral) => ShapeKind::Outward {
                    pitch: spiral.pitch(),
                    first: first.angle().radians(),
                    last: last.angle().radians(),
                },
            };
            Shape {
                kind,
                start: piece.curve.point(first),
                heading: tangent.y.atan2(tangent.x),
                length: piece.end - begin,
            }
        })
    }

    fn curve(&self, place: PiecePlace) -> &Curve {
        &self.pieces[place.piece].curve
    }

    fn on_own_piece(&self, front: PiecePlace, link: f64) -> OnOwnPiece {
        let curve = self.curve(front);
        let left = curve.left_behind(front.at);
        let at_distance = |by: f64| {
            if by <= left { OnOwnPiece::Found(curve.back(front.at, by)) } else { OnOwnPiece::AllNearer }
        };
        match curve {
            Curve::Inward(_) => OnOwnPiece::Unknown,
            Curve::Line { .. } => at_distance(link),
            // The chord of an angle psi is 2 radius sin(psi/2).
            Curve::Arc(arc) if link <= 2.0 * arc.radius => at_distance(2.0 * (0.5 * link / arc.radius).asin()),
            Curve::Arc(_) => OnOwnPiece::AllNearer,
            Curve::Outward(spiral) => inner_increment(spiral, front.at.angle(), left, link),
        }
    }

    /// The first place from `from` backward that is `link` metres from `front`, all between the two being nearer.
    ///
    /// The square of the distance from `front` grows from a place by at most 2 slope h + bend h^2 over the next h units
    /// back (see [`Curve::bend`]), so no place before that reaches the square of the link is at the distance: each step
    /// goes there. Steps never pass the first place sought and double its digits once near.
    fn march(&self, from: PiecePlace, front: Point, link: f64) -> Result<PiecePlace, Fold> {
        let PiecePlace { mut piece, mut at } = from;
        for _ in 0..MOST_STEPS {
            let curve = &self.pieces[piece].curve;
            let offset = curve.point(at) - front;
            let lacking = link * link - offset.dot(&offset);
            if lacking <= 0.0 {
                return Ok(PiecePlace { piece, at });
            }
            let stretch = curve.stretch(at);
            let slope = -stretch * offset.dot(&curve.tangent(at));
            let bend = curve.bend(at, link);
            let root = (slope * slope + bend * lacking).sqrt();
            let step = if slope >= 0.0 { lacking / (slope + root) } else { (root - slope) / bend };
            let step = step.min(curve.longest_step());
            if step >= curve.left_behind(at) {
                if piece == 0 {
                    return Err(Fold);
                }
                piece -= 1;
                at = self.pieces[piece].curve.last();
                continue;
            }
            at = curve.back(at, step);
            if step * stretch <= 0.5 * f64::EPSILON * link {
                return Ok(PiecePlace { piece, at });
            }
        }
        Err(Fold)
    }
}

/// Steps after which the search for a follower gives up: many more than a path of sensible pieces asks for.
const MOST_STEPS: usize = 100_000;

/// The follower of a handle at `front` on an outward spiral, where it is on the same spiral.
///
/// With r' = r - a d at the follower, the square of the chord is (a d)^2 + 4 r r' sin^2(d/2), which grows with d while
/// tan(d/2) <= r'/a: beyond theta = 1 + pi/2 for a quarter of a turn.
fn inner_increment(spiral: &Spiral, front: Angle, left: f64, link: f64) -> OnOwnPiece {
    if front.radians() < 1.0 + FRAC_PI_2 {
        return OnOwnPiece::Unknown;
    }
    let (a, r) = (spiral.growth(), spiral.radius(front));
    let excess = |d: f64| {
        let (sine, cosine) = (0.5 * d).sin_cos();
        let (rise, inner) = (a * d, r - a * d);
        let value = rise.mul_add(rise, (2.0 * r * sine) * (2.0 * inner * sine)) - link * link;
        let slope = 2.0 * a * rise - 4.0 * r * a * sine * sine + 4.0 * r * inner * sine * cosine;
        (value, slope)
    };
    let high = left.min(FRAC_PI_2);
    if excess(high).0 >= 0.0 {
        let d = increasing_root(excess, 0.0, high, link / r.hypot(a));
        OnOwnPiece::Found(Coordinate::Polar(front.plus(-d)))
    } else if left <= FRAC_PI_2 {
        OnOwnPiece::AllNearer
    } else {
        OnOwnPiece::Unknown
    }
}

impl Path for PiecePath {
    type Place = PiecePlace;

    fn length(&self) -> f64 {
        self.pieces[self.pieces.len() - 1].end
    }

    fn place_at(&self, travelled: f64) -> PiecePlace {
        let travelled = travelled.min(self.length());
        let piece = self.pieces.partition_point(|piece| piece.begin <= travelled).max(1) - 1;
        PiecePlace { piece, at: self.pieces[piece].place_at(travelled) }
    }

    fn point(&self, place: PiecePlace) -> Point {
        self.curve(place).point(place.at)
    }

    fn tangent(&self, place: PiecePlace) -> Vector {
        self.curve(place).tangent(place.at)
    }

    fn distance_between(&self, behind: PiecePlace, ahead: PiecePlace) -> f64 {
        if behind.piece == ahead.piece {
            return self.curve(behind).distance(behind.at, ahead.at);
        }
        if behind.piece > ahead.piece {
            return -self.distance_between(ahead, behind);
        }
        let (rear, front) = (self.curve(behind), self.curve(ahead));
        let between = self.pieces[ahead.piece].begin - self.pieces[behind.piece].end;
        rear.distance(behind.at, rear.last()) + between + front.distance(front.first(), ahead.at)
    }

    fn follower(&self, front: PiecePlace, link: f64) -> Result<PiecePlace, Fold> {
        if let Curve::Inward(spiral) = self.curve(front) {
            let at = Coordinate::Polar(spiral.follower(front.at.angle(), link)?);
            return Ok(PiecePlace { piece: front.piece, at });
        }
        match self.on_own_piece(front, link) {
            OnOwnPiece::Found(at) => Ok(PiecePlace { piece: front.piece, at }),
            OnOwnPiece::AllNearer if front.piece == 0 => Err(Fold),
            OnOwnPiece::AllNearer => {
                let piece = front.piece - 1;
                let from = PiecePlace { piece, at: self.pieces[piece].curve.last() };
                self.march(from, self.point(front), link)
            }
            OnOwnPiece::Unknown => self.march(front, self.point(front), link),
        }
    }

    fn motion_beside(&self, from: PiecePlace, to: PiecePlace, companion: (PiecePlace, PiecePlace)) -> Option<f64> {
        let (Curve::Inward(spiral) | Curve::Outward(spiral)) = self.curve(from) else { return None };
        let together = [to, companion.0, companion.1].iter().all(|place| place.piece == from.piece);
        let [from, to, before, after] = [from, to, companion.0, companion.1].map(|place| place.at.angle());
        if together { spiral.motion_beside(from, to, (before, after)) } else { None }
    }

    fn bench(&self, front: PiecePlace, rear: PiecePlace, link: f64) -> BenchOnPath {
        match (self.curve(front), front.piece == rear.piece) {
            (Curve::Inward(spiral), true) => spiral.bench(front.at.angle(), rear.at.angle(), link),
            (Curve::Outward(spiral), true) => {
                // Turned by half a turn and travelled the other way: the bench of the inward spiral, ends exchanged.
                let mirrored = spiral.bench(rear.at.angle(), front.at.angle(), link);
                let BenchOnPath { direction, front_cosine, rear_cosine } = mirrored;
                BenchOnPath { direction, front_cosine: rear_cosine, rear_cosine: front_cosine }
            }
            _ => {
                let direction = (self.point(front) - self.point(rear)).normalize();
                BenchOnPath {
                    direction,
                    front_cosine: direction.dot(&self.tangent(front)),
                    rear_cosine: direction.dot(&self.tangent(rear)),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn turnaround(arc_ratio: f64) -> PiecePath {
        PiecePath::turnaround(1.7, 4.5, arc_ratio, 100.0, 300.0).unwrap()
    }

    /// The first place at the distance, by small steps along the path and bisection: `None` past `most` metres.
    fn judge(path: &PiecePath, front: f64, link: f64, most: f64) -> Option<f64> {
        let origin = path.point(path.place_at(front));
        let distance = |back: f64| (path.point(path.place_at(front - back)) - origin).norm();
        let step = 1e-3 * link;
        let passed = (1..(most / step) as usize).map(|k| k as f64 * step).find(|back| distance(*back) >= link)?;
        let (mut low, mut high) = (passed - step, passed);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if distance(middle) < link { low = middle } else { high = middle }
        }
        Some(high)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(128))]

        /// No gap and no corner: across every junction place and direction change as little as anywhere else.
        #[test]
        fn a_turnaround_has_no_gap_and_no_corner(
            pitch in 0.2..3.0f64, turns in 1.5..6.0f64, ratio in 0.2..5.0f64,
        ) {
            let radius = pitch * turns;
            let path = PiecePath::turnaround(pitch, radius, ratio, 50.0, 50.0).unwrap();
            let begins: Vec<f64> = path.junctions().collect();
            let step = 1e-7;
            for begin in &begins {
                let (before, after) = (path.place_at(begin - step), path.place_at(begin + step));
                prop_assert!((path.point(after) - path.point(before)).norm() <= 2.0 * step * (1.0 + 1e-6));
                prop_assert!((path.tangent(after) - path.tangent(before)).norm() <= 8.0 * step * path.sharpest_curvature().max(1.0));
            }
            // The same length whatever the ratio.
            let other = PiecePath::turnaround(pitch, radius, 1.0, 50.0, 50.0).unwrap();
            let other: Vec<f64> = other.junctions().collect();
            prop_assert!((begins[2] - other[2]).abs() < 1e-13 * begins[2]);
        }

        /// The way out is the way in, turned by half a turn and run backwards.
        #[test]
        fn the_way_out_mirrors_the_way_in(ratio in 0.3..3.0f64, distance in 0.0..90.0f64) {
            let path = turnaround(ratio);
            let begins: Vec<f64> = path.junctions().collect();
            let (inward, outward) = (path.place_at(begins[0] - distance), path.place_at(begins[2] + distance));
            prop_assert!((path.point(inward).coords + path.point(outward).coords).norm() < 1e-13);
            prop_assert!((path.tangent(inward) - path.tangent(outward)).norm() < 1e-13);
        }

        #[test]
        fn the_follower_is_the_first_place_at_the_distance(
            ratio in 0.3..3.0f64, front in 80.0..160.0f64, link in 0.1..6.0f64,
        ) {
            let path = turnaround(ratio);
            let place = path.place_at(front);
            if let Ok(rear) = path.follower(place, link) {
                let found = path.distance_between(rear, place);
                let judged = judge(&path, front, link, 1.5 * found + link);
                prop_assert!(judged.is_some_and(|judged| (judged - found).abs() < 1e-6), "{found} {judged:?}");
                prop_assert!(((path.point(rear) - path.point(place)).norm() - link).abs() < 1e-14 * (1.0 + link));
                let across = path.bench(place, rear, link);
                let direction = (path.point(place) - path.point(rear)) / link;
                prop_assert!((across.direction - direction).norm() < 1e-13 / link);
                prop_assert!((across.front_cosine - direction.dot(&path.tangent(place))).abs() < 1e-13 / link);
                prop_assert!((across.rear_cosine - direction.dot(&path.tangent(rear))).abs() < 1e-13 / link);
            } else {
                prop_assert_eq!(judge(&path, front, link, 30.0), None);
            }
        }

        #[test]
        fn the_follower_on_a_route_is_the_first_place_at_the_distance(
            legs in prop::collection::vec((0.5..8.0f64, 0.05..0.7f64, any::<bool>(), any::<bool>()), 2..8),
            share in 0.0..1.0f64, link in 0.1..6.0f64,
        ) {
            let legs: Vec<Leg> = legs.into_iter().map(|(size, turns, left, line)| if line {
                Leg::Line { length: size }
            } else {
                Leg::Arc { side: if left { Side::Left } else { Side::Right }, turns, radius: 0.5 * size }
            }).collect();
            let path = PiecePath::route(Point::new(3.0, -2.0), 0.3, &legs, 0.0).unwrap();
            let front = share * path.length();
            let place = path.place_at(front);
            let judged = judge(&path, front, link, front);
            match path.follower(place, link) {
                Ok(rear) => {
                    let found = path.distance_between(rear, place);
                    // Where the path turns back just short of the link, a judge that steps sees less than it should.
                    if let Some(judged) = judged {
                        prop_assert!(found <= judged + 1e-6, "{found} {judged}");
                        let grazing = path.bench(place, rear, link).rear_cosine < 0.05;
                        prop_assert!(grazing || (judged - found).abs() < 1e-6, "{found} {judged}");
                    }
                    prop_assert!(((path.point(rear) - path.point(place)).norm() - link).abs() < 1e-13 * (1.0 + link));
                }
                Err(Fold) => prop_assert_eq!(judged, None),
            }
        }
    }
}
