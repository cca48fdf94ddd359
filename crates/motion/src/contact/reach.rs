//! How far back along the path anything can come near the foremost boards, and from where on nothing can come near
//! anything: what a search need not solve.

use std::f64::consts::TAU;

use crate::model::curve::{Arc, Coordinate, Line, Segment};
use crate::model::path::{Param, Path};
use crate::model::root::bisect_predicate;
use crate::model::spiral::{Direction, Spiral};
use crate::model::team::Team;
use crate::model::{Point, Vector};

/// A circle about some boards, and the one about the origin, the centre of every spiral, that holds them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    pub centre: Point,
    pub radius: f64,
    /// Metres from the origin to the outermost of them.
    pub outermost: f64,
}

impl Reach {
    /// The rearmost place of the path from which a board can come within `limit`, 0 or more, of the boards: one whose
    /// front handle is behind it cannot.
    ///
    /// No point of a board is further than hypot(max(link / 2, inset), width / 2) from the nearer one of its handles.
    /// On an inward spiral, where a board's handles are both at least r from the origin, its axis is at least
    /// min(sqrt(r^2 - link^2 / 4), r - inset) from it and its points half a width less.
    pub fn rearmost(&self, path: &Path, team: &Team, limit: f64) -> Option<Param> {
        let half = 0.5 * team.longest_link();
        let disc = self.radius + limit + half.max(team.hole_inset).hypot(0.5 * team.width);
        (0..path.segments()).find_map(|segment| {
            let begin = if segment == 0 { f64::NEG_INFINITY } else { 0.0 };
            let first = Param { segment, at: path.first(segment) };
            let within = match path.segment(first) {
                Segment::Line(line) => on_line(line, self.centre, disc).map(|metres| metres.max(begin)),
                Segment::Arc(arc) => on_arc(arc, self.centre, disc),
                Segment::Spiral(spiral) => {
                    let to_origin = self.centre.coords.norm();
                    return match spiral.direction() {
                        Direction::Inward => {
                            let ring = self.outermost + limit + 0.5 * team.width;
                            let reached = ring.hypot(half).max(ring + team.hole_inset);
                            inward(path, segment, spiral, reached, to_origin + disc)
                        }
                        Direction::Outward => {
                            let theta = (to_origin - disc) / spiral.radius_per_radian();
                            let at =
                                if theta > first.at.high { Coordinate { high: theta, low: 0.0 } } else { first.at };
                            (at.minus(path.last(segment)) <= 0.0).then_some(Param { segment, at })
                        }
                    };
                }
            };
            let at = Coordinate { high: within?, low: 0.0 };
            (at.minus(path.last(segment)) <= 0.0).then_some(Param { segment, at })
        })
    }
}

/// The first coordinate of a line within a circle.
fn on_line(line: &Line, centre: Point, radius: f64) -> Option<f64> {
    let offset = centre - line.origin;
    let across = line.direction.perp(&offset);
    let square = radius * radius - across * across;
    (square >= 0.0).then(|| line.direction.dot(&offset) - square.sqrt())
}

/// The first coordinate, 0 or more, of an arc within a circle.
fn on_arc(arc: &Arc, centre: Point, radius: f64) -> Option<f64> {
    let offset: Vector = centre - (arc.origin + arc.radius * arc.inward);
    let distance = offset.norm();
    if (distance - arc.radius).abs() > radius {
        return None;
    }
    // Half the angle that the circle covers, by the law of cosines.
    let cosine = (distance * distance + arc.radius * arc.radius - radius * radius) / (2.0 * distance * arc.radius);
    let half = if cosine.is_finite() { cosine.clamp(-1.0, 1.0).acos() } else { TAU };
    let towards = offset.dot(&arc.direction).atan2(-offset.dot(&arc.inward));
    Some(if towards.abs() <= half { 0.0 } else { (towards - half).rem_euclid(TAU) })
}

/// The place of the first segment, an inward spiral, at `radius` from the origin. Where the segment ends further out
/// but not beyond `disc`, a board may still lie across its end.
fn inward(path: &Path, segment: usize, spiral: &Spiral, radius: f64, disc: f64) -> Option<Param> {
    let end = path.last(segment);
    let theta = radius / spiral.radius_per_radian();
    if theta >= end.high {
        return Some(Param { segment, at: Coordinate { high: theta, low: 0.0 } });
    }
    (disc >= spiral.radius(end)).then_some(Param { segment, at: end })
}

/// The place of the first segment behind which no two boards that share no handle ever come to within `limit`, if there
/// is one: the end of a straight line, or on an inward spiral that of the least radius whose [`spiral_bound`] is above
/// the limit.
pub(super) fn quiet_place(path: &Path, team: &Team, limit: f64) -> Option<Param> {
    let place = |at| Some(Param { segment: 0, at });
    match path.segment(Param { segment: 0, at: path.first(0) }) {
        Segment::Line(_) => (team.link(1) - 2.0 * team.hole_inset > limit).then(|| place(path.last(0)))?,
        Segment::Arc(_) => None,
        Segment::Spiral(spiral) => {
            let quiet = |radius: f64| spiral_bound(spiral, team, radius) > limit;
            let least = 5.0 * (team.longest_link() + team.hole_inset + team.width).max(spiral.pitch());
            // Beyond that the bound grows no more.
            let most = 1e16 * least;
            if !quiet(most) {
                return None;
            }
            let radius = if quiet(least) { least } else { bisect_predicate(quiet, least, most) };
            let high = (radius / spiral.radius_per_radian()).max(path.last(0).high);
            place(Coordinate { high, low: 0.0 })
        }
    }
}

/// A lower bound of the clearance of two boards that share no handle, with all handles at least `r` from the centre of
/// an inward spiral, r >= 5 max(link + inset + width, pitch); it grows with r.
///
/// There theta > 31, so that the curvature is at most 1.002 / r, and chord and arc differ by less than 1 %: the tangent
/// turns by at most tau = 1.03 link / r <= 0.21 along one link, and a chord leans by at most half of that against the
/// tangent at its end. Let the path between the outermost handles of benches i and i + k turn by phi.
///
/// - k = 2: both links lean by psi <= tau against the one between them. Along that one the gap is body_link - 2 (inset
///   cos psi + width / 2 sin psi) or more; the bracket is greatest at psi = tau or atan(width / 2 inset).
/// - k > 2, phi <= 2 pi / 3: along the tangent half way, each link leans by at most phi / 2, so the gap is at least
///   (k - 1) body_link cos(phi / 2) - 2 inset - width sin(phi / 2). With width <= body_link and phi <= (k + 1) tau that
///   is more than body_link - 2 inset at k = 3 and grows with k up to phi = 1.6. Where phi is more, k >= 7, and it is
///   more than 2 body_link - 2 inset.
/// - phi more than that: every point of a board is within width / 2 + 1.05 max(link^2 / 8, inset (link + inset) / 2) /
///   r of the path between or just beyond its handles. Two places of the path p apart in polar angle, less whole
///   turns, are apart by more than 0.49 r where |p| > 1/2, and otherwise by pitch r / hypot(r, 1.02 a) >= 0.999 pitch.
///   This case is impossible where the whole team turns by less.
fn spiral_bound(spiral: &Spiral, team: &Team, r: f64) -> f64 {
    let Team { hole_inset, width, .. } = *team;
    let (longest, body) = (team.longest_link(), team.link(1));
    if width > body {
        return f64::NEG_INFINITY;
    }
    let lean = (1.03 * longest / r).min((0.5 * width).atan2(hole_inset));
    let along = body - 2.0 * hole_inset * lean.cos() - width * lean.sin();
    if 1.03 * team.length() / r < TAU / 3.0 {
        return along;
    }
    let bulge = 1.05 * (longest * longest / 8.0).max(0.5 * hole_inset * (longest + hole_inset)) / r;
    let across = (0.999 * spiral.pitch()).min(0.49 * r) - width - 2.0 * bulge;
    along.min(across)
}
