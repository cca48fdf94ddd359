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
    /// r = a theta from a radius on, turned by half a turn if `sign` is -1.
    Spiral { radius_per_radian: f64, sign: f64, least_radius: f64 },
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
        Self {
            segments: vec![Segment::Spiral { radius_per_radian, sign: 1.0, least_radius: 0.0 }],
            known: [0, 1, 10, 20].map(place).into(),
        }
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
        let spiral = |sign: f64| Segment::Spiral { radius_per_radian, sign, least_radius: turn_radius };
        let joint = arc_end(&arc(a, first, -1.0, heading), angle);
        Self {
            segments: vec![
                spiral(1.0),
                arc(a, first, -1.0, heading),
                arc(joint, second, 1.0, heading - angle),
                spiral(-1.0),
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
            Self::Spiral { radius_per_radian, sign, least_radius } => {
                let (x, y) = (sign * point[0], sign * point[1]);
                let (radius, polar) = (x.hypot(y), y.atan2(x));
                let turns = ((radius / radius_per_radian - polar) / TAU).round();
                let theta = polar + TAU * turns;
                let nearest = radius_per_radian * theta;
                // A junction belongs to both of its segments, and rounding may put a handle on either side of it.
                if nearest < least_radius - 1e-9 { f64::INFINITY } else { (radius - nearest).abs() }
            }
        }
    }
}
