//! The handles of the pieces of a route. A piece that is dragged moves what follows it, except that the lines on both
//! sides of an arc take up its change.

use std::f64::consts::TAU;

use super::paths::{add_arc_ratio, turns_at};
use super::{Found, Pull, ROUNDING, Ray, Track};
use crate::edit::Change;
use bench_dragon_motion::Motion;
use bench_dragon_motion::model::curve::{Curve, Side};
use bench_dragon_motion::model::double_double::DoubleDouble;
use bench_dragon_motion::model::placed_spiral::PlacedSpiral;
use bench_dragon_motion::model::segment::{OutlineKind, SegmentOutline};
use bench_dragon_motion::model::spiral::{Direction, Spiral};
use bench_dragon_motion::model::{Point, Vector};
use bench_dragon_motion::placement::Placement;

/// The greatest radius of an arc, and the least length of a piece, in metres: those that a scene accepts.
const MOST_RADIUS: f64 = 1e4;
const LEAST_LENGTH: f64 = 1e-3;

/// The beginning of a piece on the stage, and its length.
#[derive(Debug, Clone, Copy)]
struct Begin {
    start: Point,
    /// The direction at the start, of length 1.
    along: Vector,
    length: f64,
}

impl Begin {
    fn new(outline: &SegmentOutline) -> Self {
        let (sine, cosine) = outline.heading.sin_cos();
        Self { start: outline.start, along: Vector::new(cosine, sine), length: outline.length }
    }

    /// Returns the direction to the left of the start.
    fn left(&self) -> Vector {
        Vector::new(-self.along.y, self.along.x)
    }

    fn ray(&self) -> Ray {
        Ray { origin: self.start, direction: self.along }
    }
}

/// Adds the handles of the pieces of a dragon's route.
pub(super) fn add(found: &mut Found<'_>, prefix: &str, motion: &Motion) {
    let outlines = motion.outline();
    let path = motion.bare_path();
    let last = motion.placement().point(path.point(path.param_at(path.length())));
    let route = format!("{prefix}path.pieces");
    let mut rest = outlines.as_slice();
    for k in 0..found.scene.values.count(&route) {
        let name = format!("{route}[{k}]");
        let is_turn = found.scene.values.words(&format!("{name}.kind")) == Some("turn");
        let Some((own, after)) = rest.split_at_checked(if is_turn { 2 } else { 1 }) else { return };
        let end = after.first().map_or(last, |next| next.start);
        let begin = Begin::new(&own[0]);
        match own[0].kind {
            _ if is_turn => {
                let across = Ray::towards(begin.start, end);
                add_arc_ratio(found, format!("{name}.arc_ratio"), across, (end - begin.start).norm(), ratio(own));
            }
            OutlineKind::Line => add_line(found, &name, &begin),
            OutlineKind::Arc { curvature } => add_arc(found, &route, k, &begin, curvature),
            OutlineKind::Spiral { direction, pitch, first, last, curvature } => {
                let side = if curvature > 0.0 { Side::Left } else { Side::Right };
                let bend = Bend { begin, side, direction, pitch, first, last };
                bend.add(found, &name, &own[0], end);
            }
        }
        rest = after;
    }
}

/// Returns the radius of the first arc of a turn over that of the second. Both turn by the same angle.
fn ratio(arcs: &[SegmentOutline]) -> f64 {
    arcs[0].length / arcs[1].length
}

fn add_line(found: &mut Found<'_>, name: &str, begin: &Begin) {
    let (ray, field) = (begin.ray(), format!("{name}.length"));
    let end = Track { ray, at: begin.length, step: 1.0 };
    found.add_on_track(format!("{name}.end"), "end", field.clone(), end, positive);
    let middle = Track { ray, at: 0.5 * begin.length, step: 2.0 };
    found.add_on_track(format!("{name}.middle"), "middle", field, middle, |metres| positive(2.0 * metres));
}

fn positive(metres: f64) -> f64 {
    metres.max(LEAST_LENGTH)
}

/// Returns the radius and the angle, radians, of the arc that begins as another piece does and leads through a place. `towards`
/// is the direction to the centre. A place on the other side becomes the nearest one that such an arc reaches.
pub(crate) fn arc_through(start: Point, along: Vector, towards: Vector, to: Point) -> (f64, f64) {
    let by = to - start;
    let (ahead, aside) = (by.dot(&along), by.dot(&towards));
    let aside = aside.max(ahead * ahead / (2.0 * MOST_RADIUS)).max(LEAST_LENGTH);
    let radius = (ahead * ahead + aside * aside) / (2.0 * aside);
    (radius.clamp(LEAST_LENGTH, MOST_RADIUS), 2.0 * aside.atan2(ahead))
}

fn add_arc(found: &mut Found<'_>, route: &str, k: usize, begin: &Begin, curvature: f64) {
    let name = format!("{route}[{k}]");
    let radius = 1.0 / curvature.abs();
    let angle = begin.length / radius;
    let towards = curvature.signum() * begin.left();
    let values = &found.scene.values;
    let is_turns = values.number(&format!("{name}.turns")).is_some();
    let extent = format!("{name}.{}", if is_turns { "turns" } else { "length" });
    let number = move |extent: &str, radius: f64, angle: f64| match is_turns {
        true => Change::number(extent, angle / TAU, ROUNDING / (TAU * radius)),
        false => Change::number(extent, radius * angle, ROUNDING),
    };
    let side = values.words(&format!("{name}.side")).unwrap_or_default();
    let other_side = if side == "left" { "right" } else { "left" };
    let fields = vec![format!("{name}.radius"), extent.clone()];
    let (begin_of, of, extent_of) = (*begin, name.clone(), extent.clone());
    let end = on_arc(begin, towards, radius, angle);
    found.add(format!("{name}.end"), "end", end, fields, move |pull| {
        let to = pull.place();
        let is_other = pull.alt && (to - begin_of.start).dot(&towards) < 0.0;
        let towards = if is_other { -towards } else { towards };
        let (radius, bent) = arc_through(begin_of.start, begin_of.along, towards, to);
        // Whole turns remain.
        let bent = bent + TAU * ((angle - bent) / TAU).round().max(0.0);
        let mut changes =
            vec![Change::number(&format!("{of}.radius"), radius, ROUNDING), number(&extent_of, radius, bent)];
        if is_other {
            changes.push(Change::word(&format!("{of}.side"), other_side));
        }
        changes
    });
    let neighbours = [k.checked_sub(1), Some(k + 1)].map(|k| k.and_then(|k| line_length(found, route, k)));
    let middle = on_arc(begin, towards, radius, 0.5 * angle);
    let mut fields = vec![format!("{name}.radius")];
    if let ([Some(before), Some(after)], true) = (neighbours, angle < 3.0) {
        let half = (0.5 * angle).tan();
        let corner = begin.start + radius * half * begin.along;
        let ray = Ray::towards(corner, middle);
        let per_metre = 1.0 / (0.5 * angle).cos() - 1.0;
        let most = (radius + (before.1.min(after.1) - LEAST_LENGTH) / half).max(LEAST_LENGTH);
        fields.extend([before.0.clone(), after.0.clone()]);
        found.add(format!("{name}.middle"), "middle", middle, fields, move |pull| {
            let new = (pull.along(&ray) / per_metre).clamp(LEAST_LENGTH, most);
            let Change::Number { value: new, .. } = Change::number("", new, ROUNDING) else { return Vec::new() };
            let by = (radius - new) * half;
            let line = |(name, length): &(String, f64)| Change::number(name, positive(length + by), 0.01 * ROUNDING);
            let extent = (!is_turns).then(|| number(&extent, new, angle));
            let radius = Change::number(&format!("{name}.radius"), new, ROUNDING);
            [radius, line(&before), line(&after)].into_iter().chain(extent).collect()
        });
        return;
    }
    let ray = Ray::towards(begin.start, middle);
    let chord = 2.0 * (0.25 * angle).sin();
    if chord.abs() > 1e-6 {
        found.add(format!("{name}.middle"), "middle", middle, fields, move |pull| {
            let radius = (pull.along(&ray) / chord.abs()).clamp(LEAST_LENGTH, MOST_RADIUS);
            let extent = (!is_turns).then(|| number(&extent, radius, angle));
            let radius = Change::number(&format!("{name}.radius"), radius, ROUNDING);
            [radius].into_iter().chain(extent).collect()
        });
    }
}

/// Returns the field and the length of a piece that is a line.
fn line_length(found: &Found<'_>, route: &str, k: usize) -> Option<(String, f64)> {
    let values = &found.scene.values;
    let is_line = values.words(&format!("{route}[{k}].kind"))? == "line";
    let field = format!("{route}[{k}].length");
    let length = values.number(&field).filter(|_| is_line)?;
    Some((field, length))
}

/// Returns the place of an arc after an angle.
fn on_arc(begin: &Begin, towards: Vector, radius: f64, angle: f64) -> Point {
    let (sine, cosine) = angle.sin_cos();
    begin.start + radius * (sine * begin.along + (1.0 - cosine) * towards)
}

/// A spiral piece.
#[derive(Debug, Clone, Copy)]
struct Bend {
    begin: Begin,
    side: Side,
    direction: Direction,
    pitch: f64,
    /// The polar angles of its beginning and its end on the unturned spiral.
    first: f64,
    last: f64,
}

/// The way in which the text states where a spiral piece ends.
#[derive(Debug, Clone, Copy)]
enum Extent {
    Turns,
    Length,
    ToRadius,
}

impl Bend {
    fn add(self, found: &mut Found<'_>, name: &str, outline: &SegmentOutline, end: Point) {
        let values = &found.scene.values;
        let extents = [(Extent::Turns, "turns"), (Extent::Length, "length"), (Extent::ToRadius, "to_radius")];
        let given = extents.into_iter().find(|(_, field)| values.number(&format!("{name}.{field}")).is_some());
        let (Some((extent, field)), Some(placement)) = (given, Placement::of_spiral(outline)) else { return };
        let (is_own, field) = (values.number(&format!("{name}.pitch")).is_some(), format!("{name}.{field}"));
        let of = field.clone();
        found.add(format!("{name}.end"), "end", end, vec![field], move |pull| {
            let last = self.last_at(placement.own_point(pull.place()));
            let radius = self.pitch * last / TAU;
            let (value, step) = match extent {
                Extent::Turns => ((last - self.first).abs() / TAU, 1.0 / (TAU * radius.max(self.pitch))),
                Extent::Length => {
                    let ends = [self.first, last].map(|angle| DoubleDouble { high: angle, low: 0.0 });
                    (self.spiral(self.pitch).arc_length(ends[0], ends[1]), 1.0)
                }
                Extent::ToRadius => (radius, self.pitch / (TAU * radius.max(self.pitch))),
            };
            vec![Change::number(&of, value, ROUNDING * step)]
        });
        if is_own {
            self.add_own(found, name, extent);
        }
    }

    /// Adds the handles of a spiral that does not follow from a turn: of its pitch, at its middle, and of its first
    /// radius, at its centre.
    fn add_own(self, found: &mut Found<'_>, name: &str, extent: Extent) {
        let radius = self.pitch * self.first / TAU;
        let (field, of) = (format!("{name}.pitch"), format!("{name}.pitch"));
        let middle = move |pitch: f64| self.middle(pitch, radius, extent);
        let turns = (self.last - self.first).abs() / TAU;
        let most = match (extent, self.direction) {
            (Extent::Turns, Direction::Inward) => (radius - LEAST_LENGTH) / turns,
            _ => MOST_RADIUS,
        };
        found.add(field.clone(), "pitch", middle(self.pitch), vec![field], move |pull| {
            let pitch = nearest(middle, self.pitch, most, pull);
            vec![Change::number(&of, pitch, 0.01 * ROUNDING)]
        });
        let (field, of) = (format!("{name}.radius"), format!("{name}.radius"));
        let centre = move |radius: f64| self.placed(self.pitch, radius).centre();
        found.add(field.clone(), "radius", centre(radius), vec![field], move |pull| {
            vec![Change::number(&of, nearest(centre, radius, MOST_RADIUS, pull), ROUNDING)]
        });
    }

    fn spiral(&self, pitch: f64) -> Spiral {
        Spiral::new(pitch, self.direction)
    }

    /// Returns the angle of the end at which the spiral has a polar direction and is nearest to a place, in own
    /// coordinates.
    fn last_at(&self, own: Point) -> f64 {
        let polar = own.y.atan2(own.x) / TAU;
        // The outward spiral is the inward one turned by half a turn.
        let (polar, distance) = if self.direction == Direction::Outward { (polar + 0.5, own) } else { (polar, own) };
        let distance = distance.coords.norm();
        let (first, least) = (self.first / TAU, LEAST_LENGTH / self.pitch);
        let turns = match self.direction {
            Direction::Outward => turns_at(polar, distance, self.pitch, first + LEAST_LENGTH),
            Direction::Inward => {
                let turns = turns_at(polar, distance, self.pitch, least);
                let beyond = (turns - first + LEAST_LENGTH).max(0.0).ceil();
                if turns - beyond < least { (first - LEAST_LENGTH).max(least) } else { turns - beyond }
            }
        };
        TAU * turns
    }

    fn placed(&self, pitch: f64, radius: f64) -> PlacedSpiral {
        let first = DoubleDouble::from_turns(radius / pitch);
        PlacedSpiral::new(self.begin.start, self.begin.along, self.side, self.spiral(pitch), first)
    }

    /// Returns the middle of the angles of the spiral with another pitch.
    fn middle(&self, pitch: f64, radius: f64, extent: Extent) -> Point {
        let first = TAU * radius / pitch;
        let (begin, spiral) = (DoubleDouble { high: first, low: 0.0 }, self.spiral(pitch));
        let last = match extent {
            Extent::Turns => first + (self.last - self.first),
            Extent::Length => spiral.advance(begin, self.begin.length).high,
            Extent::ToRadius => self.pitch * self.last / pitch,
        };
        self.placed(pitch, radius).point(DoubleDouble { high: 0.5 * (first + last), low: 0.0 })
    }
}

/// Returns the number, at most `most`, whose place is nearest to that of a pull, near the number `from`: Gauss-Newton
/// steps, since pitch and radius turn a spiral about its beginning.
fn nearest(place: impl Fn(f64) -> Point, from: f64, most: f64, pull: &Pull) -> f64 {
    let (to, mut number) = (pull.place(), from);
    for _ in 0..50 {
        let by = 1e-6 * number;
        let slope = (place(number + by) - place(number - by)) / (2.0 * by);
        let step = (to - place(number)).dot(&slope) / slope.norm_squared();
        if !step.is_finite() {
            break;
        }
        number = (number + step).clamp(0.5 * number, 2.0 * number).clamp(LEAST_LENGTH, most.max(LEAST_LENGTH));
        if step.abs() < 1e-9 * number {
            break;
        }
    }
    number
}
