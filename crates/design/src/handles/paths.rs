//! The handles of whole paths, of spirals and of turnarounds.
//!
//! The inward spiral is r = pitch theta / 2 pi in the path's own coordinates. Its start keeps its direction from the
//! centre when only the pitch changes, and its pitch when only the turns change.

use std::f64::consts::{PI, TAU};

use super::{Found, Pull, ROUNDING, Ray, Track};
use crate::edit::Change;
use bench_dragon_motion::Motion;
use bench_dragon_motion::model::curve::Curve;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::double_double::DoubleDouble;
use bench_dragon_motion::model::spiral::{Direction, Spiral};
use bench_dragon_motion::model::{Point, Vector};
use bench_dragon_motion::placement::Placement;

/// The turns by which the handle of the pitch is inside the start of a spiral: on the other side of the centre.
const INSIDE: f64 = 0.5;
/// The distance of the handle of a route's first direction from its start, in metres.
const HEADING_ARM: f64 = 3.0;
/// The turns to whose multiples a first direction snaps.
const HEADING_SNAP: f64 = 0.0025;

/// Adds the handles of a dragon's path.
pub(super) fn add(found: &mut Found<'_>, prefix: &str, motion: &Motion) {
    add_grip(found, prefix, motion);
    let placement = *motion.placement();
    match *motion.description() {
        PathDescription::Spiral { pitch, start_turn } => add_spiral(found, prefix, &placement, pitch, start_turn),
        PathDescription::Turnaround { pitch, turn_radius, arc_ratio, lead_in, lead_out } => {
            let turn = Turnaround { pitch, turn_radius, arc_ratio, lead_in, lead_out };
            turn.add(found, &format!("{prefix}path"), placement);
        }
        PathDescription::Route { heading_turns, .. } => add_heading(found, prefix, &placement, heading_turns),
    }
}

/// Adds the grip of the whole path: its centre, or the start of a route.
fn add_grip(found: &mut Found<'_>, prefix: &str, motion: &Motion) {
    let values = &found.scene.values;
    let grip = motion.placement().origin();
    let is_route = matches!(motion.description(), PathDescription::Route { .. });
    if is_route && values.get(&format!("{prefix}placement")).is_none() {
        return found.add_place(format!("{prefix}path.start"), "placement", grip);
    }
    let name = format!("{prefix}placement.origin");
    let given = [0, 1].map(|k| values.number(&format!("{name}[{k}]")).unwrap_or(0.0));
    let fields = vec![format!("{name}[0]"), format!("{name}[1]")];
    let by = Point::from(given) - grip;
    let of = name.clone();
    found.add(name, "placement", grip, fields, move |pull| vec![Change::place(&of, pull.place() + by)]);
}

fn add_heading(found: &mut Found<'_>, prefix: &str, placement: &Placement, turns: f64) {
    let field = format!("{prefix}path.heading_turns");
    let (sine, cosine) = (TAU * turns).sin_cos();
    let place = placement.point(Point::new(HEADING_ARM * cosine, HEADING_ARM * sine));
    let (of, placement) = (field.clone(), *placement);
    found.add(field.clone(), "heading", place, vec![field], move |pull| {
        let own = placement.own_point(pull.to);
        let turns = own.y.atan2(own.x) / TAU;
        let turns = if pull.free { turns } else { (turns / HEADING_SNAP).round() * HEADING_SNAP };
        vec![Change::number(&of, turns, ROUNDING / (TAU * HEADING_ARM))]
    });
}

/// Returns the polar angle in turns, in (-1/2, 1/2], and the distance from the origin, of a place in own coordinates.
fn polar(own: Point) -> (f64, f64) {
    (own.y.atan2(own.x) / TAU, own.coords.norm())
}

/// Returns the turns of the place of a spiral that is nearest to a distance from the centre, among those at a polar
/// angle, and at least `least`.
pub(super) fn turns_at(polar_turns: f64, distance: f64, pitch: f64, least: f64) -> f64 {
    let turns = polar_turns + (distance / pitch - polar_turns).round();
    if turns < least { turns + (least - turns).ceil() } else { turns }
}

fn add_spiral(found: &mut Found<'_>, prefix: &str, placement: &Placement, pitch: f64, start_turn: f64) {
    let spiral = Spiral::new(pitch, Direction::Inward);
    let at = |turns: f64| placement.point(spiral.point(DoubleDouble::from_turns(turns)));
    let field = format!("{prefix}path.start_turn");
    let (of, of_placement) = (field.clone(), *placement);
    found.add(field.clone(), "turns", at(start_turn), vec![field], move |pull| {
        let (polar_turns, distance) = polar(of_placement.own_point(pull.place()));
        let turns = turns_at(polar_turns, distance, pitch, 0.0);
        vec![Change::number(&of, turns, ROUNDING / (TAU * pitch * turns.max(1.0)))]
    });
    let turns = if start_turn > 2.0 * INSIDE { start_turn - INSIDE } else { 0.5 * start_turn };
    let ray = Ray::towards(placement.origin(), at(turns));
    let field = format!("{prefix}path.pitch");
    let track = Track { ray, at: pitch * turns, step: 1.0 / turns };
    found.add_on_track(field.clone(), "pitch", field, track, move |metres| metres / turns);
}

/// A turnaround.
#[derive(Clone, Copy)]
struct Turnaround {
    pitch: f64,
    turn_radius: f64,
    arc_ratio: f64,
    lead_in: f64,
    lead_out: f64,
}

impl Turnaround {
    fn add(self, found: &mut Found<'_>, path: &str, placement: Placement) {
        let Self { pitch, turn_radius, arc_ratio, lead_in, lead_out } = self;
        let centre = placement.origin();
        // The two rings have handles in one direction, since a place of the path would turn with the numbers.
        let ring = Ray { origin: centre, direction: placement.vector(Vector::x()) };
        let field = format!("{path}.turn_radius");
        let track = Track { ray: ring, at: turn_radius, step: 1.0 };
        found.add_on_track(field.clone(), "radius", field, track, |metres| metres);
        let field = format!("{path}.pitch");
        let track = Track { ray: ring, at: turn_radius + pitch, step: 1.0 };
        found.add_on_track(field.clone(), "pitch", field, track, move |metres| metres - turn_radius);
        let spiral = Spiral::new(pitch, Direction::Inward);
        let begin = DoubleDouble::from_turns(turn_radius / pitch);
        let across = Ray::towards(placement.point(spiral.point(begin)), centre);
        add_arc_ratio(found, format!("{path}.arc_ratio"), across, 2.0 * turn_radius, arc_ratio);
        let turn = turn_radius / pitch;
        let start = spiral.advance(begin, -lead_in);
        let place = placement.point(spiral.point(start));
        let name = ["start_turn", "lead_in"].map(|field| format!("{path}.{field}"));
        let [start_turn, lead] = name;
        let (is_turns, is_metres) =
            (found.scene.values.number(&start_turn).is_some(), found.scene.values.number(&lead).is_some());
        if is_turns || is_metres {
            let field = if is_turns { start_turn } else { lead };
            let of = field.clone();
            found.add(field.clone(), "turns", place, vec![field], move |pull| {
                let (polar_turns, distance) = polar(placement.own_point(pull.place()));
                let turns = turns_at(polar_turns, distance, pitch, turn);
                let (value, step) = match is_turns {
                    true => (turns, 1.0 / (TAU * pitch * turns)),
                    false => (spiral.arc_length(DoubleDouble::from_turns(turns), begin), 1.0),
                };
                vec![Change::number(&of, value, ROUNDING * step)]
            });
        }
        let field = format!("{path}.lead_out");
        if found.scene.values.number(&field).is_some() {
            let outward = Spiral::new(pitch, Direction::Outward);
            let place = placement.point(outward.point(outward.advance(begin, lead_out)));
            let of = field.clone();
            found.add(field.clone(), "end", place, vec![field], move |pull| {
                let (polar_turns, distance) = polar(placement.own_point(pull.place()));
                // The outward spiral is the inward one turned by half a turn.
                let turns = turns_at(polar_turns + PI / TAU, distance, pitch, turn);
                let metres = outward.arc_length(begin, DoubleDouble::from_turns(turns));
                vec![Change::number(&of, metres, ROUNDING)]
            });
        }
    }
}

/// Adds the handle where the two arcs of a turn meet, on the straight line between its ends. The first chord has the
/// share K / (1 + K) of the line, K being the arc ratio.
pub(super) fn add_arc_ratio(found: &mut Found<'_>, field: String, across: Ray, length: f64, arc_ratio: f64) {
    let share = arc_ratio / (1.0 + arc_ratio);
    let least = 1e-3;
    let ratio_at = move |metres: f64| {
        let share = (metres / length).clamp(least / (1.0 + least), 1.0 / (1.0 + least));
        share / (1.0 - share)
    };
    let of = field.clone();
    found.add(field.clone(), "middle", across.at(share * length), vec![field], move |pull: &Pull| {
        let ratio = ratio_at(pull.along(&across));
        vec![Change::number(&of, ratio, ROUNDING * (1.0 + ratio) * (1.0 + ratio) / length)]
    });
}
