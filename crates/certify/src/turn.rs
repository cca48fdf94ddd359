//! Proofs for all turnarounds whose turn radius is in an interval: a link stalls or locks, or two boards overlap. And
//! for one turnaround: none of these happens. [`crate::plan`] calls it. Lemma 10 in `docs/proofs.md`.

use std::cell::Cell;

use super::Given;
use super::capsule::{Capsule, Span};
use super::grid::GridPoint;
use super::interval::{Interval, Vector, dot, minus, norm, norm_squared};
use super::lines::{CertifiedEvent, Links, Status};
use super::path::{ExactPath, Place};
use super::pitch::clear_beyond;
use super::search::CertificateSearch;
use super::step::{Chain, Claim, Listed, links_of};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::event::Event;
use bench_dragon_motion::linkage::follower;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::team::Team;

/// Limit of stretches that are tested for one fold, and of halvings of one stretch.
const MOST_STRETCHES: u32 = 2_000;
const MOST_HALVINGS: u32 = 48;

/// All turnarounds of a team whose turn radius is in an interval.
pub(crate) struct Turns<'a> {
    team: &'a Team,
    exact: ExactPath,
    /// The turnarounds with the least and the greatest radius. They only give the starting guess of the handles.
    ends: [Path; 2],
}

impl<'a> Turns<'a> {
    /// Creates the turnarounds between two paths, of this pitch and arc ratio and with these turn radii.
    pub fn new(team: &'a Team, (pitch, arc_ratio): (f64, f64), radii: [f64; 2], ends: [Path; 2]) -> Self {
        let exact = ExactPath::turnaround(pitch, Interval { lo: radii[0], hi: radii[1] }, arc_ratio, 0.0);
        Self { team, exact, ends }
    }

    /// Returns true if, with every radius, a link surely stalls or locks that passes over `pivot` with one handle, the
    /// other being between `pivot` and `end`: a lock with `end` ahead of `pivot`, a stall with `end` behind it.
    pub fn fold(&self, link: usize, pivot: Place, end: Place) -> bool {
        let exact = &self.exact;
        if !exact.is_inside(pivot) || !exact.is_inside(end) || pivot == end {
            return false;
        }
        let ahead = exact.in_order(pivot, end);
        let (point, tangent) = exact.at(pivot);
        let fold = Fold {
            exact,
            point,
            tangent: if ahead { tangent } else { tangent.map(std::ops::Neg::neg) },
            square: links_of(self.team)[link.min(1)].square(),
            left: Cell::new(MOST_STRETCHES),
        };
        let stretch = if ahead { Span(pivot, end) } else { Span(end, pivot) };
        fold.square.is_below(norm_squared(minus(exact.point(end), point))) && fold.holds(stretch, MOST_HALVINGS)
    }

    /// Returns true if, with every radius, two boards are proved to have a point in common while the head is at a
    /// place, if it comes there without a lock.
    pub fn overlap(&self, head: Place, benches: [usize; 2]) -> bool {
        let handle = benches[1] + 1;
        if benches[0] + 2 > benches[1] || benches[1] >= self.team.benches || !self.exact.is_inside(head) {
            return false;
        }
        let [mut first, mut last] = [GridPoint::at(head, 0.0), GridPoint::at(head, 0.0)];
        let solved = first.extend_to(handle, &self.ends[0], self.team);
        if solved.and_then(|()| last.extend_to(handle, &self.ends[1], self.team)).is_err() {
            return false;
        }
        let chain = Chain::new(&self.ends[0], self.exact.clone(), self.team);
        let claim = Claim { links: Links::All, moving: false, clear: false };
        let mut listed = Listed::new(&chain, Span(head, head), f64::INFINITY).with_slack(self.blur());
        while listed.handles.len() <= handle {
            if listed.extend(&mut first, &mut last, claim).is_err() {
                return false;
            }
        }
        chain.common_point(&listed.handles, benches).is_some()
    }

    /// Returns the metres by which a point of an arc is uncertain, as the radius is.
    fn blur(&self) -> f64 {
        let ends = self.exact.segments.iter().map(|segment| segment.end.lo);
        let widths = ends.enumerate().skip(1).take(2).map(|(segment, angle)| {
            let [x, y] = self.exact.point(Place(segment, 0.5 * angle, 0.0));
            (x.hi - x.lo).hypot(y.hi - y.lo)
        });
        2.0 * widths.fold(0.0, f64::max)
    }
}

/// The handle of a link at a pivot. Every place that the other handle may have is nearer than the link, or on the wrong
/// side of the pivot's normal.
struct Fold<'a> {
    exact: &'a ExactPath,
    point: Vector,
    /// The tangent at the pivot, towards the other handle.
    tangent: Vector,
    square: Interval,
    /// Number of stretches that may still be tested.
    left: Cell<u32>,
}

impl Fold<'_> {
    fn holds(&self, stretch: Span, halvings: u32) -> bool {
        let left = self.left.get();
        if left == 0 {
            return false;
        }
        self.left.set(left - 1);
        let capsule = Capsule::new(self.exact, stretch);
        if capsule.distance_squared(self.point).is_below(self.square) {
            return true;
        }
        let reach = capsule.reach(self.tangent, norm(self.tangent).hi);
        let along = dot(self.tangent, minus(capsule.point, self.point)) + Interval::within(reach.hi);
        if along.is_negative() {
            return true;
        }
        let Some(middle) = self.exact.between(stretch.0, stretch.1).filter(|_| halvings > 0) else { return false };
        self.holds(Span(stretch.0, middle), halvings - 1) && self.holds(Span(middle, stretch.1), halvings - 1)
    }
}

/// A turnaround of a team that comes in from far outside and goes out until the last handle is behind the turn.
#[derive(Debug, Clone)]
pub(crate) struct Passage {
    /// The path.
    pub path: Path,
    /// Metres of path before the turn. Lemma 8 holds further out.
    pub lead_in: f64,
    /// Metres of path after it.
    pub lead_out: f64,
    description: PathDescription,
}

/// Factor by which the way out grows until the whole team has turned.
const LONGER: f64 = 1.1;

/// Limit of the steps of a proof.
const MOST_STEPS: u64 = 100_000;

impl Passage {
    /// Creates the passage. Returns `None` if Lemma 8 holds at no sensible distance.
    pub fn new(team: &Team, (pitch, arc_ratio): (f64, f64), turn_radius: f64) -> Option<Self> {
        // Further out than a = pitch / 2 pi a link that is shorter than its distance from the centre does not stall.
        let far = clear_beyond(team, pitch, turn_radius.max(pitch))?;
        let length = |radius: f64| Path::spiral(pitch, radius / pitch).length();
        let lead_in = 1.0 + length(far) - length(turn_radius);
        let mut lead_out = team.length();
        loop {
            let description = PathDescription::Turnaround { pitch, turn_radius, arc_ratio, lead_in, lead_out };
            let path = description.path().ok()?;
            let mut handle = path.param_at(path.length());
            // A handle without a follower: some link locks, and the proof will not succeed.
            for bench in 0..team.benches {
                let Ok(rear) = follower(&path, handle, team.link(bench)) else { break };
                handle = rear;
            }
            if handle.segment() + 1 == path.segments() || lead_out > 4.0 * team.length() {
                return Some(Self { path, lead_in, lead_out, description });
            }
            lead_out *= LONGER;
        }
    }

    /// Returns true if the passage is proved to be free of contact, stall and lock.
    pub fn is_free(&self, team: &Team, progress: &mut dyn FnMut(f64)) -> bool {
        let travelled = self.path.length();
        let end = Event { kind: EventKind::PathEnd, travelled, bench_a: None, bench_b: None, place: None };
        let given = Given {
            scene: "",
            description: &self.description,
            path: &self.path,
            team,
            head_speed: 1.0,
            events: &[end],
            most_steps: MOST_STEPS,
            dragon: None,
        };
        let is_none = |event: &CertifiedEvent| {
            event.event == EventKind::PathEnd || matches!(event.status, Status::None { time_lo: None })
        };
        let found = CertificateSearch::new(given, Vec::new(), &mut |_| Ok(())).run(progress);
        found.is_ok_and(|events| events.iter().all(is_none))
    }
}
