//! The checker's own paths: lines, arcs and spirals by metres of travel, and the follower on them.
//!
//! A path has no beginning: a route starts with an endless straight line behind its start, a spiral comes in from
//! infinity. So every handle has a follower everywhere.

use std::f64::consts::TAU;

pub type Vector = nalgebra::Vector2<f64>;

/// A place on a path.
#[derive(Clone, Copy, Debug)]
pub struct Param {
    /// Metres of travel: the head starts at 0, and the team stands behind it.
    pub s: f64,
    piece: usize,
    /// Metres since the start of a line, radians since the start of an arc, the polar angle on a spiral.
    q: f64,
}

#[derive(Clone, Copy, Debug)]
enum Curve {
    Line {
        start: Vector,
        tangent: Vector,
    },
    /// `turn` is 1 to the left, -1 to the right; `phase` is the polar angle of the start.
    Arc {
        centre: Vector,
        radius: f64,
        phase: f64,
        turn: f64,
    },
    /// `outward` is -1 on r = a theta inward, 1 on the same spiral turned by half a turn, outward. The polar angle
    /// about `centre` is `phase` + `turn` theta.
    Spiral {
        radius_per_radian: f64,
        outward: f64,
        centre: Vector,
        phase: f64,
        turn: f64,
    },
}

#[derive(Clone, Copy, Debug)]
struct Piece {
    curve: Curve,
    /// Metres of travel at its start; -infinity for the first curve.
    begin: f64,
    /// Coordinates of its start and end.
    first: f64,
    last: f64,
    /// Metres of travel, and radians that the path has turned in either direction, at coordinate `anchor`.
    anchor: f64,
    anchor_s: f64,
    anchor_turned: f64,
}

/// Returns the length of r = a theta from the centre.
fn spiral_length(radius_per_radian: f64, theta: f64) -> f64 {
    0.5 * radius_per_radian * (theta * 1f64.hypot(theta) + theta.asinh())
}

/// Returns the polar angle at `length` metres from the centre. The length is convex and at least a theta^2 / 2, so
/// Newton's steps come down from that guess and never pass the root.
fn spiral_angle(radius_per_radian: f64, length: f64) -> f64 {
    let length = length.max(0.0);
    let mut theta = (2.0 * length / radius_per_radian).sqrt();
    for _ in 0..100 {
        let step = (spiral_length(radius_per_radian, theta) - length) / (radius_per_radian * 1f64.hypot(theta));
        theta -= step;
        if step.abs() <= 1e-16 * theta {
            break;
        }
    }
    theta.max(0.0)
}

fn unit(angle: f64) -> Vector {
    Vector::new(angle.cos(), angle.sin())
}

pub fn left_of(vector: Vector) -> Vector {
    Vector::new(-vector.y, vector.x)
}

impl Curve {
    fn point_and_tangent(&self, q: f64) -> (Vector, Vector) {
        match *self {
            Self::Line { start, tangent } => (start + q * tangent, tangent),
            Self::Arc { centre, radius, phase, turn } => {
                let spoke = unit(phase + turn * q);
                (centre + radius * spoke, turn * left_of(spoke))
            }
            Self::Spiral { radius_per_radian, outward, centre, phase, turn } => {
                let spoke = unit(phase + turn * q);
                // Half a turn and the other way of travel cancel: both spirals have one tangent at one angle.
                let tangent = -(spoke + turn * q * left_of(spoke)) / 1f64.hypot(q);
                (centre - outward * radius_per_radian * q * spoke, tangent)
            }
        }
    }

    /// Returns the metres from coordinate `from` to `to`.
    fn metres(&self, from: f64, to: f64) -> f64 {
        match *self {
            Self::Line { .. } => to - from,
            Self::Arc { radius, .. } => radius * (to - from),
            Self::Spiral { radius_per_radian, outward, .. } => {
                outward * (spiral_length(radius_per_radian, to) - spiral_length(radius_per_radian, from))
            }
        }
    }

    fn after(&self, from: f64, metres: f64) -> f64 {
        match *self {
            Self::Line { .. } => from + metres,
            Self::Arc { radius, .. } => from + metres / radius,
            Self::Spiral { radius_per_radian, outward, .. } => {
                spiral_angle(radius_per_radian, spiral_length(radius_per_radian, from) + outward * metres)
            }
        }
    }

    /// Returns the radians by which the direction turns from coordinate `from` to `to`; the tangent of a spiral has the
    /// polar angle theta + atan(theta) + constant.
    fn turned(&self, from: f64, to: f64) -> f64 {
        match *self {
            Self::Line { .. } => 0.0,
            Self::Arc { .. } => to - from,
            Self::Spiral { outward, .. } => outward * (to + to.atan() - from - from.atan()),
        }
    }

    /// Returns the first coordinate from `q` back to `first` that is not nearer to `centre` than `reach`.
    fn leaves(&self, q: f64, first: f64, centre: Vector, reach: f64) -> Option<f64> {
        let by = match *self {
            Self::Line { tangent, .. } => {
                let offset = self.point_and_tangent(q).0 - centre;
                let (along, across) = (offset.dot(&tangent), offset.perp(&tangent).abs());
                let half_chord = ((reach - across) * (reach + across)).max(0.0).sqrt();
                along + half_chord
            }
            Self::Arc { centre: own, radius, phase, turn } => {
                let spoke = centre - own;
                let away = spoke.norm();
                if radius + away <= reach {
                    return None;
                }
                // Seen from the arc's centre the points at `reach` are `opening` to either side of `centre`.
                let opening = 2.0
                    * ((reach - (radius - away)) * (reach + (radius - away)))
                        .max(0.0)
                        .sqrt()
                        .atan2(((radius + away - reach) * (radius + away + reach)).sqrt());
                let here = unit(phase + turn * q);
                let angle = -turn * spoke.perp(&here).atan2(spoke.dot(&here));
                opening - angle
            }
            Self::Spiral { radius_per_radian, outward, .. } => {
                return leaves_spiral(self, radius_per_radian, outward, q, first, centre, reach);
            }
        };
        let by = by.max(0.0);
        (by <= q - first).then_some(q - by)
    }
}

/// As [`Curve::leaves`], by sphere tracing. Over x metres back the square of the distance grows by at most 2 (rate) x +
/// (1 + reach curvature) x^2. So the first place at `reach` is never passed.
fn leaves_spiral(
    curve: &Curve,
    radius_per_radian: f64,
    outward: f64,
    q: f64,
    first: f64,
    centre: Vector,
    reach: f64,
) -> Option<f64> {
    let mut theta = q;
    // Far more steps than any path needs: near a fold steps shrink as the square root of the remaining distance.
    for _ in 0..1_000_000 {
        let (point, tangent) = curve.point_and_tangent(theta);
        let offset = point - centre;
        let distance = offset.norm();
        if distance >= reach {
            break;
        }
        let lacking = (reach - distance) * (reach + distance);
        let rate = -offset.dot(&tangent);
        // Curvature falls outward; on the way out the steps back go inward, by a quarter of a radian at most.
        let sharpest = if outward < 0.0 { theta } else { (theta - 0.25).max(first) };
        let square = sharpest * sharpest;
        let second_derivative_bound = 1.0 + reach * (2.0 + square) / (radius_per_radian * (1.0 + square).powf(1.5));
        let root = (rate * rate + second_derivative_bound * lacking).sqrt();
        let metres = if rate > 0.0 { lacking / (rate + root) } else { (root - rate) / second_derivative_bound };
        let radians = metres / (radius_per_radian * 1f64.hypot(theta));
        // Metres per radian grow outward: with the metres per radian at the step's outer end no step is too long.
        let radians =
            if outward < 0.0 { metres / (radius_per_radian * 1f64.hypot(theta + radians)) } else { radians.min(0.25) };
        let next = theta - outward * radians;
        if outward * (next - first) <= 0.0 {
            let end = (curve.point_and_tangent(first).0 - centre).norm();
            return (end >= reach).then_some(first);
        }
        if next == theta {
            break;
        }
        theta = next;
    }
    Some(theta)
}

#[derive(Clone, Debug)]
pub struct Path {
    pieces: Vec<Piece>,
    pub end: f64,
}

/// One segment of a route.
#[derive(Clone, Copy, Debug)]
pub enum RouteSegment {
    Line { length: f64 },
    Arc { radius: f64, turns: f64, left: bool },
    Spiral { pitch: f64, radius: f64, turns: f64, outward: bool, left: bool },
}

/// Returns the spiral of a path that has its centre at the origin.
fn about_origin(radius_per_radian: f64, outward: f64) -> Curve {
    Curve::Spiral { radius_per_radian, outward, centre: Vector::zeros(), phase: 0.0, turn: 1.0 }
}

impl Path {
    pub fn spiral(pitch: f64, start_turn: f64) -> Self {
        let (radius_per_radian, start) = (pitch / TAU, TAU * start_turn);
        let mut path = Self { pieces: Vec::new(), end: 0.0 };
        path.begin_with(about_origin(radius_per_radian, -1.0), start, 0.0);
        path.end = spiral_length(radius_per_radian, start);
        path
    }

    /// Returns a turnaround whose head starts `lead_in` metres before the turn.
    pub fn turnaround(pitch: f64, turn_radius: f64, arc_ratio: f64, lead_in: f64, lead_out: f64) -> Self {
        let radius_per_radian = pitch / TAU;
        let theta = turn_radius / radius_per_radian;
        let both = turn_radius.hypot(radius_per_radian);
        let angle = 2.0 * theta.atan();
        let mut path = Self { pieces: Vec::new(), end: 0.0 };
        path.begin_with(about_origin(radius_per_radian, -1.0), theta, lead_in);
        path.push_arc(both * arc_ratio / (1.0 + arc_ratio), angle, false);
        path.push_arc(both / (1.0 + arc_ratio), angle, true);
        let out = about_origin(radius_per_radian, 1.0);
        path.push(out, theta, spiral_angle(radius_per_radian, spiral_length(radius_per_radian, theta) + lead_out));
        path
    }

    pub fn route(start: Vector, heading_turns: f64, segments: &[RouteSegment]) -> Self {
        let mut path = Self { pieces: Vec::new(), end: 0.0 };
        path.begin_with(Curve::Line { start, tangent: unit(TAU * heading_turns) }, 0.0, 0.0);
        for segment in segments {
            match *segment {
                RouteSegment::Line { length } => {
                    let (start, tangent) = path.last_point_and_tangent();
                    path.push(Curve::Line { start, tangent }, 0.0, length);
                }
                RouteSegment::Arc { radius, turns, left } => path.push_arc(radius, TAU * turns, left),
                RouteSegment::Spiral { pitch, radius, turns, outward, left } => {
                    let outward = if outward { 1.0 } else { -1.0 };
                    path.push_spiral(pitch / TAU, radius, outward, TAU * turns, left);
                }
            }
        }
        path
    }

    /// Adds a first curve without beginning, whose length is counted from its end at coordinate `last`.
    fn begin_with(&mut self, curve: Curve, last: f64, anchor_s: f64) {
        let first = if let Curve::Line { .. } = curve { f64::NEG_INFINITY } else { f64::INFINITY };
        let begin = f64::NEG_INFINITY;
        self.pieces.push(Piece { curve, begin, first, last, anchor: last, anchor_s, anchor_turned: 0.0 });
        self.end = anchor_s;
    }

    fn push(&mut self, curve: Curve, first: f64, last: f64) {
        let before = self.pieces[self.pieces.len() - 1];
        let anchor_turned = before.anchor_turned + before.curve.turned(before.anchor, before.last);
        let begin = self.end;
        self.end = begin + curve.metres(first, last);
        self.pieces.push(Piece { curve, begin, first, last, anchor: first, anchor_s: begin, anchor_turned });
    }

    fn push_arc(&mut self, radius: f64, angle: f64, left: bool) {
        let (point, tangent) = self.last_point_and_tangent();
        let turn = if left { 1.0 } else { -1.0 };
        let spoke = -turn * left_of(tangent);
        let curve = Curve::Arc { centre: point - radius * spoke, radius, phase: spoke.y.atan2(spoke.x), turn };
        self.push(curve, 0.0, angle);
    }

    /// The centre is `radius` metres from the last point, along the tangent's normal turned by the lean. The tangent
    /// leans by atan(1 / theta) against the circle about the centre, towards the centre or away from it.
    fn push_spiral(&mut self, radius_per_radian: f64, radius: f64, outward: f64, angle: f64, left: bool) {
        let (point, tangent) = self.last_point_and_tangent();
        let side = if left { 1.0 } else { -1.0 };
        let first = radius / radius_per_radian;
        // From the centre to the point: right of a travel about the centre to the left, turned on by the lean.
        let lean = outward * side * (1.0 / first).atan();
        let spoke = nalgebra::Rotation2::new(lean) * (-side * left_of(tangent));
        let centre = point - radius * spoke;
        // Along the spiral, the polar angle about the centre grows to the left; theta grows outward.
        let turn = side * outward;
        let phase = (-outward * spoke).y.atan2((-outward * spoke).x) - turn * first;
        let curve = Curve::Spiral { radius_per_radian, outward, centre, phase, turn };
        self.push(curve, first, first + outward * angle);
    }

    fn last_point_and_tangent(&self) -> (Vector, Vector) {
        let piece = self.pieces[self.pieces.len() - 1];
        piece.curve.point_and_tangent(piece.last)
    }

    pub fn place_at(&self, s: f64) -> Param {
        let index = self.pieces.partition_point(|piece| piece.begin <= s).max(1) - 1;
        let piece = &self.pieces[index];
        Param { s, piece: index, q: piece.curve.after(piece.anchor, s - piece.anchor_s) }
    }

    pub fn point_and_tangent(&self, place: Param) -> (Vector, Vector) {
        self.pieces[place.piece].curve.point_and_tangent(place.q)
    }

    pub fn point(&self, place: Param) -> Vector {
        self.point_and_tangent(place).0
    }

    /// Returns the radians by which the path turns, in either direction, from one place to another further on.
    pub fn turned(&self, behind: Param, ahead: Param) -> f64 {
        let at = |place: Param| {
            let piece = &self.pieces[place.piece];
            piece.anchor_turned + piece.curve.turned(piece.anchor, place.q)
        };
        (at(ahead) - at(behind)).abs()
    }

    /// Returns the first place backward from `from` that is not nearer to `front` than `reach`.
    pub fn first_back(&self, from: Param, front: Param, reach: f64) -> Param {
        let centre = self.point(front);
        let (mut index, mut q) = (from.piece, from.q);
        loop {
            let piece = &self.pieces[index];
            if let Some(q) = piece.curve.leaves(q, piece.first, centre, reach) {
                let s = piece.anchor_s + piece.curve.metres(piece.anchor, q);
                return Param { s, piece: index, q };
            }
            // The first curve has no beginning, so the search always leaves its circle there.
            index -= 1;
            q = self.pieces[index].last;
        }
    }

    /// Returns true if all four places are on one line or one circle, where a team moves as one rigid body.
    pub fn is_even(&self, places: [Param; 4]) -> bool {
        let piece = places[0].piece;
        places.iter().all(|place| place.piece == piece) && !matches!(self.pieces[piece].curve, Curve::Spiral { .. })
    }

    /// Returns the largest coordinate of the path from a place on: of the ends of its curves, and a circle's whole
    /// width.
    pub fn extent(&self, from: Param) -> f64 {
        let ends = self.pieces.iter().map(|piece| {
            let wide = if let Curve::Arc { radius, .. } = piece.curve { 2.0 * radius } else { 0.0 };
            piece.curve.point_and_tangent(piece.last).0.norm() + wide
        });
        ends.fold(self.point(from).norm(), f64::max)
    }
}
