//! Proofs for teams that come in on inward spirals from any distance: that boards overlap with every pitch of an
//! interval, or that no boards touch with one pitch. "The least pitch" and Lemma 8 in `docs/proofs.md`.
//!
//! All spirals are equal if the spiral's a = pitch / 2 pi is the unit of length; then the team's lengths are intervals.

mod far;

use super::boards::Shape;
use super::clearance::Descent;
use super::elementary::{pi, sin_cos};
use super::grid::GridPoint;
use super::interval::Interval;
use super::lines::{CertificateLine, Links, Step};
use super::path::ExactPath;
use super::place::{Place, Span};
use super::spaced::Spaced;
use super::step::{Chain, Claim, Listed, link_of};
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::team::Team;

/// An interval of pitches, and a position of a team on such a spiral.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pitches<'a> {
    /// The team, and the clearance that boards must keep.
    pub asked: Spaced<'a>,
    /// The least pitch, metres per turn.
    pub from: f64,
    /// The greatest pitch, metres per turn.
    pub to: f64,
    /// Polar angle of the head's front handle, in radians.
    pub theta: f64,
    /// Two benches that share no handle, counted from 0, the one nearer the head first.
    pub benches: [usize; 2],
}

impl Pitches<'_> {
    /// Returns a = pitch / 2 pi of all pitches, metres per radian.
    fn radius_per_radian(&self) -> Interval {
        Interval { lo: self.from, hi: self.to }.over(pi() * 2.0)
    }

    /// Returns true if, with every pitch, the head is further than `radius` metres from the centre.
    pub fn are_outside(&self, radius: f64) -> bool {
        Interval::point(radius).over(self.radius_per_radian()).is_below(Interval::point(self.theta))
    }

    /// Returns the spans of the handles from 1 on, and a point of each of the two boards with every pitch. The points
    /// are one, or nearer than the clearance. Returns `None` without a proof. Lengths are in units of a.
    pub fn overlap(&self) -> Option<(Vec<Span>, [[f64; 2]; 2])> {
        let Self { asked: Spaced { team, clearance }, from, to, theta, benches } = *self;
        if benches[0] + 2 > benches[1] || benches[1] >= team.benches {
            return None;
        }
        let a = self.radius_per_radian();
        // The path and the team only give the starting guess of the handles.
        let [wide, narrow] = [from, to].map(|pitch| Path::spiral(pitch, theta / std::f64::consts::TAU));
        let handle = benches[1] + 1;
        let mut ends = [GridPoint::at(Place(0, theta, 0.0), 0.0), GridPoint::at(Place(0, theta, 0.0), 0.0)];
        let [first, last] = &mut ends;
        first.extend_to(handle, &wide, team).ok()?;
        last.extend_to(handle, &narrow, team).ok()?;
        let mut chain = Chain::new(&wide, ExactPath::inward(Interval::ONE, Interval::ZERO), team);
        chain.links = chain.links.map(|link| link.over(a));
        chain.shapes = chain
            .shapes
            .map(|Shape { inset, half_width }| Shape { inset: inset.over(a), half_width: half_width.over(a) });
        let claim = Claim { links: Links::All, moving: false, clear: false };
        let mut listed = Listed::new(&chain, Span(Place(0, theta, 0.0), Place(0, theta, 0.0)), f64::INFINITY);
        while listed.handles.len() <= handle {
            listed.extend(first, last, claim).ok()?;
        }
        let points = chain.near_points(&listed.handles, benches, Interval::point(clearance).over(a))?;
        Some((listed.handles[1..].iter().map(|handle| handle.span).collect(), points))
    }
}

/// Limit of pieces, three quarters of a turn at first, that are searched for a lock.
const MOST_PIECES: u32 = 10_000;

/// Returns true if the head's link is proved to lock with every pitch of an interval. The head comes in from far
/// outside, and the lock is before the head is at `radius`, metres from the centre.
pub(crate) fn head_locks(team: &Team, (from, to): (f64, f64), radius: f64) -> bool {
    let radians = |metres: Interval, pitch: f64| metres.over(Interval::point(pitch).over(pi() * 2.0));
    let theta = Interval::point(radians(Interval::point(radius), from).hi);
    let square = radians(link_of(team, 0), to).square();
    // D = theta^2 + (theta + delta)^2 - 2 theta (theta + delta) cos delta is bounded over pieces by Taylor's formula.
    let mut pieces = vec![(0.0, 1.5 * pi().hi)];
    let mut looked_at = 0;
    while let Some((first, last)) = pieces.pop() {
        looked_at += 1;
        let middle = 0.5 * first + 0.5 * last;
        if looked_at > MOST_PIECES || middle <= first || middle >= last {
            return false;
        }
        let (sine, cosine) = sin_cos(middle);
        let rear = theta + Interval::point(middle);
        let both = theta * rear * 2.0;
        let at = theta.square() + rear.square() - both * cosine;
        let slope = (rear - theta * cosine) * 2.0 + both * sine;
        // D'' = 2 + 4 theta sin delta + 2 theta (theta + delta) cos delta.
        let most = Interval::point(2.0) + theta * 4.0 + theta * (theta + Interval::point(last)) * 2.0;
        let half =
            (Interval::point(last) - Interval::point(middle)).max(Interval::point(middle) - Interval::point(first));
        let above = slope.abs() * half + most * half.square() * 0.5;
        if !(at + above).is_below(square) {
            if !at.is_below(square) {
                return false;
            }
            pieces.extend([(first, middle), (middle, last)]);
        }
    }
    Interval::ONE.is_below(theta)
}

/// Returns a distance from the centre, at least `radius` and little more than the least. By Lemma 8 no two boards are as
/// near as `clearance` and no link locks while the head is further out. Returns `None` if the lemma shows it for no
/// sensible distance.
pub(crate) fn clear_beyond(asked: Spaced<'_>, pitch: f64, radius: f64) -> Option<f64> {
    far::least_radius(asked, pitch, radius)
}

/// Limit of turns of a scene: no steps are tried beyond.
const MOST_TURNS: f64 = 1e7;

/// The proof that a team reaches a radius with one pitch.
#[derive(Debug, Clone)]
pub(crate) struct Reached {
    /// The distance from the centre, in metres, from which on Lemma 8 holds.
    pub far: f64,
    /// The steps from there to the radius, if requested.
    pub steps: Vec<Step>,
}

/// Returns the proof, if there is one, that a team reaches `radius`, metres from the centre, on a spiral of this pitch
/// from any distance. Until the head's front handle is there, no two boards are as near as `clearance` and no link
/// locks. `keeps` requests the steps. `progress` receives the share of the way that is done.
pub(crate) fn reaches(
    asked: Spaced<'_>,
    pitch: f64,
    radius: f64,
    most_steps: u64,
    keeps: bool,
    progress: Progress<'_>,
) -> Option<Reached> {
    let Spaced { team, clearance } = asked;
    let far = clear_beyond(asked, pitch, radius)?;
    let mut steps = Vec::new();
    if far <= radius {
        return Some(Reached { far, steps });
    }
    // The head begins a little further out. Rounding may take that back, which is checked below.
    let start_turn = far * (1.0 + 1e-9) / pitch;
    if start_turn > MOST_TURNS {
        return None;
    }
    let description = PathDescription::Spiral { pitch, start_turn };
    let path = Path::spiral(pitch, start_turn);
    let exact = ExactPath::new(&description);
    let a = Interval::point(pitch).over(pi() * 2.0);
    let theta = Interval::point(radius).over(a).lo;
    let end = GridPoint::at(Place(0, theta, 0.0), exact.travelled(Place(0, theta, 0.0)).middle());
    let travelled = end.travelled;
    let mut keep = |line: &CertificateLine| {
        if let CertificateLine::Step(step) = line {
            steps.push(step.clone());
        }
        Ok(())
    };
    let chain = Chain::new(&path, exact, team);
    let descent =
        Descent::new(chain, travelled, most_steps, if keeps { Some(&mut keep) } else { None }).after_all_further_out();
    let holds = far <= (a * descent.head().1).lo && descent.stays_apart_to(&end, clearance, progress);
    holds.then_some(Reached { far, steps })
}
