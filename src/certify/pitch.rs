//! Teams on spirals of all pitches between two: boards that overlap with each of them, and a pitch with which none touch. Only
//! [`super`] uses it; [`crate::plan`] calls what it exports. "The least pitch" in `docs/proofs.md`.
//!
//! With the spiral's a = pitch / 2 pi as the unit of length every spiral is the same, and the team's lengths are intervals.

use super::boards::Shape;
use super::capsule::Span;
use super::clearance::Descent;
use super::elementary::pi;
use super::interval::Interval;
use super::knot::Knot;
use super::lines::Links;
use super::path::{ExactPath, Place};
use super::step::{Chain, Claim, Listed, PADS};
use crate::model::description::PathDescription;
use crate::model::path::Path;
use crate::model::team::Team;

/// Pitches from one to another, metres per turn, and where a team on such a spiral is looked at.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pitches<'a> {
    /// The team.
    pub team: &'a Team,
    /// The least of them.
    pub from: f64,
    /// The greatest of them.
    pub to: f64,
    /// Polar angle of the head's front handle, radians.
    pub theta: f64,
    /// Two benches that share no handle, counted from 0, the one nearer the head first.
    pub benches: [usize; 2],
}

impl Pitches<'_> {
    /// a = pitch / 2 pi of all of them.
    fn radius_per_radian(&self) -> Interval {
        Interval { lo: self.from, hi: self.to }.over(pi() * 2.0)
    }

    /// Whether with each of them the head is further than `radius` metres from the centre, but by less than `turns` turns
    /// further than `outer` metres are.
    pub fn are_between(&self, radius: f64, outer: f64, turns: f64) -> bool {
        let a = self.radius_per_radian();
        let theta = Interval::point(self.theta);
        let begin = Interval::point(outer).over(a) + pi() * 2.0 * turns;
        Interval::point(radius).over(a).is_below(theta) && theta.is_below(begin)
    }

    /// Whether with each of them the two boards are proved to overlap.
    pub fn all_overlap(&self) -> bool {
        let Self { team, from, to, theta, benches } = *self;
        let a = self.radius_per_radian();
        // The path and the team serve to guess where handles are.
        let [wide, narrow] = [from, to].map(|pitch| Path::spiral(pitch, theta / std::f64::consts::TAU));
        let handle = benches[1] + 1;
        let mut ends = [Knot::at(Place(0, theta), 0.0), Knot::at(Place(0, theta), 0.0)];
        let [first, last] = &mut ends;
        if first.extend_to(handle, &wide, team).is_err() || last.extend_to(handle, &narrow, team).is_err() {
            return false;
        }
        let mut chain = Chain::new(&wide, ExactPath::inward(Interval::ONE, Interval::ZERO), team);
        chain.links = chain.links.map(|link| link.over(a));
        let Shape { inset, half_width } = chain.shape;
        chain.shape = Shape { inset: inset.over(a), half_width: half_width.over(a) };
        let claim = Claim { links: Links::All, moving: false, clear: false };
        PADS.iter().any(|pads| {
            let mut listed = Listed::new(&chain, Span(Place(0, theta), Place(0, theta)), *pads);
            while listed.handles.len() <= handle {
                if listed.extend(first, last, claim).is_err() {
                    return false;
                }
            }
            chain.common_point(&listed.handles, benches).is_some()
        })
    }
}

/// Whether it is proved that a team whose head starts on turn `start_turn` of an inward spiral has no two boards that touch
/// and no link that locks until its front handle is `radius` metres from the centre.
pub(crate) fn reaches(team: &Team, pitch: f64, start_turn: f64, radius: f64, most_steps: u64) -> bool {
    let description = PathDescription::Spiral { pitch, start_turn };
    let path = Path::spiral(pitch, start_turn);
    let exact = ExactPath::new(&description);
    let theta = Interval::point(radius).over(Interval::point(pitch).over(pi() * 2.0)).lo;
    let end = Knot::at(Place(0, theta), exact.travelled(Place(0, theta)).middle());
    let travelled = end.travelled;
    Descent::new(Chain::new(&path, exact, team), travelled, most_steps).stays_clear_to(&end)
}
