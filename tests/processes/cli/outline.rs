//! The path that a scene's numbers describe, in closed form: the distance of a point from it, and the places of its
//! junctions. Shares no code with the program.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::cli::scenes::{SceneFile, float};

type Point = [f64; 2];

enum Segment {
    /// From a point in a direction; the first line of a route has no beginning.
    Line { start: Point, heading: f64, from: f64, to: f64 },
    /// Turns left if `turn` is 1 and right if it is -1.
    Arc { centre: Point, radius: f64, phase: f64, turn: f64, angle: f64 },
    /// r = a theta about a centre between two radii, at the polar angle `phase` + `sense` theta.
    Spiral { radius_per_radian: f64, centre: Point, phase: f64, sense: f64, radii: [f64; 2] },
}

/// A path.
pub struct Outline {
    segments: Vec<Segment>,
    /// Metres that the head has travelled and its place then, at places that are known in closed form.
    pub known: Vec<(f64, Point)>,
}

fn ahead(from: Point, heading: f64, metres: f64) -> Point {
    [from[0] + metres * heading.cos(), from[1] + metres * heading.sin()]
}

fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Returns the metres along r = a theta from the centre.
pub fn spiral_length(radius_per_radian: f64, theta: f64) -> f64 {
    0.5 * radius_per_radian * (theta * 1f64.hypot(theta) + theta.asinh())
}

impl Outline {
    pub fn of(scene: &SceneFile) -> Self {
        match scene.content["path"]["kind"].as_str().unwrap() {
            "spiral" => Self::spiral(scene),
            "turnaround" => Self::turnaround(scene),
            "pieces" => Self::route(scene),
            other => panic!("this test knows no outline of a {other}"),
        }
    }

    fn spiral(scene: &SceneFile) -> Self {
        let radius_per_radian = scene.number("path", "pitch") / TAU;
        let start = TAU * scene.number("path", "start_turn");
        let place = |k: u32| {
            let theta = start - f64::from(k);
            let travelled = spiral_length(radius_per_radian, start) - spiral_length(radius_per_radian, theta);
            (travelled, ahead([0.0, 0.0], theta, radius_per_radian * theta))
        };
        Self { segments: vec![about_origin(radius_per_radian, 0.0, 0.0)], known: [0, 1, 10, 20].map(place).into() }
    }

    /// Returns the path inward along a spiral to A at the turn's radius, right along one arc, left along another, and
    /// from B = -A outward.
    fn turnaround(scene: &SceneFile) -> Self {
        let [pitch, turn_radius, ratio, lead_in] =
            ["pitch", "turn_radius", "arc_ratio", "lead_in"].map(|key| scene.number("path", key));
        let radius_per_radian = pitch / TAU;
        let theta = turn_radius / radius_per_radian;
        let a = ahead([0.0, 0.0], theta, turn_radius);
        let b = [-a[0], -a[1]];
        // Towards the centre the polar angle falls: the tangent lies atan(theta) clockwise of the direction to the
        // centre.
        let heading = theta + PI + theta.atan();
        let whole = turn_radius.hypot(radius_per_radian);
        let [first, second] = [whole * ratio / (1.0 + ratio), whole / (1.0 + ratio)];
        let angle = 2.0 * (turn_radius / radius_per_radian).atan();
        let arc = |from: Point, radius: f64, turn: f64, heading: f64| {
            let centre = ahead(from, heading + turn * FRAC_PI_2, radius);
            Segment::Arc { centre, radius, phase: heading - turn * FRAC_PI_2, turn, angle }
        };
        let spiral = |phase: f64| about_origin(radius_per_radian, phase, turn_radius);
        let joint = arc_end(&arc(a, first, -1.0, heading), angle);
        Self {
            segments: vec![
                spiral(0.0),
                arc(a, first, -1.0, heading),
                arc(joint, second, 1.0, heading - angle),
                spiral(PI),
            ],
            known: vec![(lead_in, a), (lead_in + first * angle, joint), (lead_in + whole * angle, b)],
        }
    }

    fn route(scene: &SceneFile) -> Self {
        let path = scene.content["path"].as_table().unwrap();
        let start = path["start"].as_array().unwrap();
        let mut at = [float(&start[0]), float(&start[1])];
        let mut heading = TAU * float(&path["heading_turns"]);
        let mut travelled = 0.0;
        let (mut segments, mut known) = (Vec::new(), vec![(0.0, at)]);
        segments.push(Segment::Line { start: at, heading, from: f64::NEG_INFINITY, to: 0.0 });
        for piece in path["pieces"].as_array().unwrap() {
            if piece["kind"].as_str() == Some("line") {
                let to = float(&piece["length"]);
                segments.push(Segment::Line { start: at, heading, from: 0.0, to });
                (at, travelled) = (ahead(at, heading, to), travelled + to);
            } else if piece["kind"].as_str() == Some("spiral") {
                let spiral = Piece::of(piece, at, heading);
                segments.push(spiral.segment);
                (at, heading, travelled) = (spiral.end, heading + spiral.turned, travelled + spiral.length);
            } else {
                let turn = if piece["side"].as_str() == Some("left") { 1.0 } else { -1.0 };
                let (radius, angle) = (float(&piece["radius"]), TAU * float(&piece["turns"]));
                let centre = ahead(at, heading + turn * FRAC_PI_2, radius);
                let arc = Segment::Arc { centre, radius, phase: heading - turn * FRAC_PI_2, turn, angle };
                at = arc_end(&arc, angle);
                segments.push(arc);
                (heading, travelled) = (heading + turn * angle, travelled + radius * angle);
            }
            known.push((travelled, at));
        }
        Self { segments, known }
    }

    /// Returns the metres from a point to the path.
    pub fn distance(&self, point: Point) -> f64 {
        self.segments.iter().map(|segment| segment.distance(point)).fold(f64::INFINITY, f64::min)
    }
}

/// Returns a spiral about the origin, from a radius on.
fn about_origin(radius_per_radian: f64, phase: f64, least_radius: f64) -> Segment {
    Segment::Spiral { radius_per_radian, centre: [0.0, 0.0], phase, sense: 1.0, radii: [least_radius, f64::INFINITY] }
}

/// A spiral of a route, with its end, the radians by which it turns to the left, and its metres.
struct Piece {
    segment: Segment,
    end: Point,
    turned: f64,
    length: f64,
}

impl Piece {
    /// The tangent lies atan(theta) from the direction away from the centre, or towards it.
    fn of(piece: &toml::Value, begin: Point, heading: f64) -> Self {
        let number = |key: &str| float(&piece[key]);
        let side = if piece["side"].as_str() == Some("left") { 1.0 } else { -1.0 };
        let outward = if piece["direction"].as_str() == Some("out") { 1.0 } else { -1.0 };
        let (radius_per_radian, radius) = (number("pitch") / TAU, number("radius"));
        let first = radius / radius_per_radian;
        let last = first + outward * TAU * number("turns");
        let from_tangent = if outward > 0.0 { first.atan() } else { PI - first.atan() };
        let polar = heading - side * from_tangent;
        let (centre, sense) = (ahead(begin, polar, -radius), side * outward);
        let phase = polar - sense * first;
        let radii = [radius_per_radian * first.min(last), radius_per_radian * first.max(last)];
        Self {
            segment: Segment::Spiral { radius_per_radian, centre, phase, sense, radii },
            end: ahead(centre, phase + sense * last, radius_per_radian * last),
            turned: side * ((last - first).abs() + (last.atan() - first.atan()).abs()),
            length: (spiral_length(radius_per_radian, last) - spiral_length(radius_per_radian, first)).abs(),
        }
    }
}

fn arc_end(arc: &Segment, after: f64) -> Point {
    let Segment::Arc { centre, radius, phase, turn, .. } = *arc else { panic!("no arc") };
    ahead(centre, phase + turn * after, radius)
}

impl Segment {
    fn distance(&self, point: Point) -> f64 {
        match *self {
            Self::Line { start, heading, from, to } => {
                let along = (point[0] - start[0]) * heading.cos() + (point[1] - start[1]) * heading.sin();
                distance(point, ahead(start, heading, along.clamp(from, to)))
            }
            Self::Arc { centre, radius, phase, turn, angle } => {
                let polar = (point[1] - centre[1]).atan2(point[0] - centre[0]);
                let turned = (turn * (polar - phase)).rem_euclid(TAU);
                if turned <= angle {
                    (distance(point, centre) - radius).abs()
                } else {
                    [0.0, angle]
                        .map(|end| distance(point, arc_end(self, end)))
                        .into_iter()
                        .fold(f64::INFINITY, f64::min)
                }
            }
            Self::Spiral { radius_per_radian, centre, phase, sense, radii: [least, greatest] } => {
                let (x, y) = (point[0] - centre[0], point[1] - centre[1]);
                let (radius, polar) = (x.hypot(y), sense * (y.atan2(x) - phase));
                let turns = ((radius / radius_per_radian - polar) / TAU).round();
                let nearest = radius_per_radian * (polar + TAU * turns);
                // A junction belongs to both of its segments, and rounding may put a handle on either side of it.
                let is_on = nearest > least - 1e-9 && nearest < greatest + 1e-9;
                if is_on { (radius - nearest).abs() } else { f64::INFINITY }
            }
        }
    }
}
