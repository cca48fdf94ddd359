//! Velocities of handles as the radius grows, against differences of handles that the ordinary solver places.

use super::Turns;
use crate::capsule::Spanned;
use crate::grid::{param, place};
use crate::path::ExactPath;
use crate::place::{Place, Span};
use bench_dragon_motion::linkage::follower;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::team::{Ends, Team};

const TEAM: Team =
    Team { benches: 16, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275, ends: Ends::NONE };
const PITCH: f64 = 1.7;
const RADIUS: f64 = 4.5;
const RATIO: f64 = 2.0;

/// Returns the places of all handles and their points, turned so that A has the polar angle of A with `RADIUS`. The
/// head's coordinate is that of a place with `RADIUS`, and grows by `rate` per metre.
fn handles(radius: f64, head: Place, rate: f64) -> Vec<(Place, [f64; 2])> {
    let path = Path::turnaround(PITCH, radius, RATIO, 0.0, 100.0).unwrap();
    let turned = (radius - RADIUS) * std::f64::consts::TAU / PITCH;
    let Place(segment, at, _) = head;
    let at = at + rate * (radius - RADIUS) + if segment == 0 || segment == 3 { turned } else { 0.0 };
    let mut handle = param(Place(segment, at, 0.0));
    let mut found = Vec::new();
    for bench in 0..=TEAM.benches {
        let (point, (sine, cosine)) = (path.point(handle), (-turned).sin_cos());
        found.push((place(handle), [cosine * point.x - sine * point.y, sine * point.x + cosine * point.y]));
        if bench < TEAM.benches {
            handle = follower(&path, handle, TEAM.link(bench)).unwrap();
        }
    }
    found
}

#[test]
fn velocities_hold_differences_of_the_ordinary_solver() {
    const STEP: f64 = 1e-6;
    let path = Path::turnaround(PITCH, RADIUS, RATIO, 0.0, 100.0).unwrap();
    let radii = [RADIUS - 1e-12, RADIUS + 1e-12];
    let turns = Turns::new((&TEAM).into(), PITCH, RATIO, radii, path);
    let mut on_segment = [0; 4];
    for (head, rate) in
        [(Place(0, 20.0, 0.0), 0.0), (Place(1, 1.5, 0.0), -2.0), (Place(2, 2.0, 0.0), 1.0), (Place(3, 20.5, 0.0), 0.7)]
    {
        let spanned = |at: Place| Spanned::new(&turns.exact, Span(at, at));
        let found = handles(RADIUS, head, rate);
        let spans: Vec<_> = found.iter().map(|(at, _)| spanned(*at)).collect();
        let velocities = turns.velocities(&spans, rate).unwrap();
        let [before, after] = [RADIUS - STEP, RADIUS + STEP].map(|radius| handles(radius, head, rate));
        for (number, velocity) in velocities.iter().enumerate() {
            on_segment[found[number].0.0] += 1;
            for axis in 0..2 {
                let difference = (after[number].1[axis] - before[number].1[axis]) / (2.0 * STEP);
                let width = velocity[axis].hi - velocity[axis].lo;
                let off = (difference - velocity[axis].middle()).abs();
                assert!(width < 1e-8 && off < 1e-7, "handle {number} of {head:?}: {difference}, {velocity:?}");
            }
        }
    }
    assert!(on_segment.iter().all(|handles| *handles > 3), "{on_segment:?}");
}

#[test]
fn a_place_that_is_moved_past_a_junction_goes_on() {
    let path = Path::turnaround(PITCH, RADIUS, RATIO, 100.0, 100.0).unwrap();
    let description = PathDescription::Turnaround {
        pitch: PITCH,
        turn_radius: RADIUS,
        arc_ratio: RATIO,
        lead_in: 100.0,
        lead_out: 100.0,
    };
    let exact = ExactPath::new(&description);
    for junction in 0..3 {
        let end = exact.travelled(Place(junction + 1, exact.segments[junction + 1].begin.hi, 0.0)).middle();
        for (from, metres) in [(end - 0.01, 0.03), (end + 0.01, -0.03), (end - 0.02, 4.7), (end + 1e-9, -3e-9)] {
            let moved = exact.moved(place(path.param_at(from)), metres, false);
            let went = exact.travelled(moved).middle() - exact.travelled(place(path.param_at(from))).middle();
            let least = metres.abs() - 1e-13 * (1.0 + end);
            let is_far_enough = went.abs() >= least && went.abs() <= 1.05 * metres.abs() + 1e-12;
            assert!(exact.is_inside(moved) && went.signum() == metres.signum() && is_far_enough, "{junction}: {went}");
        }
    }
}
