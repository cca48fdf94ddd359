//! Proofs for all turnarounds whose turn radius is in an interval, that a link stalls or locks, or that two boards
//! overlap; and for one turnaround, that none of these happens. Lemma 10 in `docs/proofs.md`.

use std::cell::Cell;

use super::Given;
use super::boards::Shape;
use super::capsule::{Capsule, Spanned};
use super::clearance::Descent;
use super::elementary::pi;
use super::first_order::{FirstOrderBoard, FirstOrderHandle, When};
use super::grid::GridPoint;
use super::interval::{Interval, Vector, dot, minus, norm, norm_squared, plus, scaled};
use super::lines::{CertificateLine, CertifiedEvent, Links, Status};
use super::path::ExactPath;
use super::pitch::clear_beyond;
use super::place::{Place, Span};
use super::search::{CertificateSearch, MOST_SPANS, path_end};
use super::spaced::Spaced;
use super::step::{Chain, Claim, Listed, link_of};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::event::{Event, Progress};
use bench_dragon_motion::linkage::follower;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::team::Team;

/// Limit of stretches that are tested for one fold, and of halvings of one stretch.
const MOST_STRETCHES: u32 = 2_000;
const MOST_HALVINGS: u32 = 48;

/// The uncertainty of places over the uncertainty of the points, with room for terms of the second order. Two points
/// count, each with half of its width.
const BLUR: f64 = 1.1;

/// All turnarounds of a team whose turn radius is in an interval.
pub(crate) struct Turns<'a> {
    team: &'a Team,
    /// The required clearance of boards, in metres.
    clearance: f64,
    /// a = pitch / 2 pi, metres per radian.
    a: Interval,
    radius: Interval,
    exact: ExactPath,
    /// The turnaround with the middle radius.
    middle: ExactPath,
    /// The same turnaround in doubles, only for the starting guess of the handles.
    path: Path,
}

impl<'a> Turns<'a> {
    /// Creates the turnarounds of this pitch and arc ratio with turn radii between two. `path` is the turnaround with
    /// the middle radius. Places of an arc are places of `path`. A place of a spiral is the place of `path` at the same
    /// polar angle behind A or beyond -A.
    pub fn new(asked: Spaced<'a>, pitch: f64, arc_ratio: f64, radii: [f64; 2], path: Path) -> Self {
        let Spaced { team, clearance } = asked;
        let radius = Interval { lo: radii[0], hi: radii[1] };
        let a = Interval::point(pitch).over(pi() * 2.0);
        let middle = Interval::point(radius.middle());
        let turned = polar_angle(pitch, radius.middle());
        let turnarounds = |radius: Interval| ExactPath::turnaround(pitch, radius, arc_ratio, Some(turned), 0.0);
        Self { team, clearance, a, radius, exact: turnarounds(radius), middle: turnarounds(middle), path }
    }

    /// Returns true if, with every radius, a link that passes over `pivot` with one handle is certain to stall or lock.
    /// The other handle is between `pivot` and `end`. For a lock `end` is ahead of `pivot`, for a stall behind it.
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
            square: link_of(self.team, link).square(),
            left: Cell::new(MOST_STRETCHES),
        };
        let stretch = if ahead { Span(pivot, end) } else { Span(end, pivot) };
        fold.square.is_below(norm_squared(minus(exact.point(end), point))) && fold.holds(stretch, MOST_HALVINGS)
    }

    /// Returns the greatest radius to which a fold that [`Self::fold`] shows extends because all its places are on the
    /// inward spiral: that part of the path is the same for all radii up to there.
    pub fn fold_on_spiral(&self, link: usize, pivot: Place, end: Place) -> Option<f64> {
        if pivot.0 > 0 || end.0 > 0 || !self.fold(link, pivot, end) {
            return None;
        }
        let innermost = if self.exact.in_order(pivot, end) { end } else { pivot };
        Some(self.exact.curve(innermost).distance_from_centre(innermost.1))
    }

    /// Returns true if, with every radius, two boards are proved to overlap or to be too near while the head is at a
    /// place. The proof holds if the head comes there without a lock. The place is `head` with the middle radius, and
    /// its coordinate grows by `rate` per metre of the radius.
    pub fn overlap(&self, head: Place, rate: f64, [a, b]: [usize; 2]) -> bool {
        if a + 2 > b || b >= self.team.benches {
            return false;
        }
        let half = self.half_width();
        let Some(heads) = self.exact.around(head, (Interval::point(rate.abs()) * half).hi) else { return false };
        // A step of no metres has the narrowest spans.
        let handles = |exact: &ExactPath, Span(first, last): Span, (metres, slack): (f64, f64)| {
            let chain = Chain::new(&self.path, exact.clone(), self.team);
            let claim = Claim { links: Links::All, moving: false, clear: false };
            let mut listed = Listed::new(&chain, Span(first, last), metres).with_slack(slack);
            let [mut first, mut last] = [first, last].map(|head| GridPoint::at(head, 0.0));
            while listed.handles.len() <= b + 1 {
                listed.extend(&mut first, &mut last, claim).ok()?;
            }
            Some(listed.handles)
        };
        let still = handles(&self.middle, Span(head, head), (0.0, 0.0));
        let all = handles(&self.exact, heads, (f64::INFINITY, self.blur()));
        let (Some(still), Some(all)) = (still, all) else { return false };
        let Some(velocities) = self.velocities(&all, rate) else { return false };
        let handle = |number: usize| FirstOrderHandle::moving(&still[number].capsule, velocities[number], half);
        let board = |bench: usize| {
            let (link, shape) = (link_of(self.team, bench), Shape::new(self.team, bench));
            FirstOrderBoard::new(&shape, handle(bench), handle(bench + 1), link, half)
        };
        board(a).at_most(&board(b), When::Always) < self.clearance
    }

    /// Returns the velocities of handles in metres per metre of the radius: "Velocities" in Lemma 10. `handles` are
    /// spans for all radii. The coordinate of the head grows by `rate` per metre of the radius.
    fn velocities(&self, handles: &[Spanned], rate: f64) -> Option<Vec<Vector>> {
        let moved = |handle: &Spanned, along: Interval| {
            let turned = Interval::within(handle.capsule.turned().hi);
            Some(plus(self.drift(handle)?, scaled(handle.capsule.tangent.map(|part| part + turned), along)))
        };
        let Span(first, last) = handles[0].span;
        let mut velocities = vec![moved(&handles[0], self.exact.travel_per_unit(first, last) * rate)?];
        for pair in handles.windows(2) {
            let [front, rear] = [&pair[0].capsule, &pair[1].capsule];
            let slack = Interval::within(front.slack(rear).hi);
            let link = minus(front.point, rear.point).map(|part| part + slack);
            let along = dot(link, minus(*velocities.last()?, self.drift(&pair[1])?)).over(front.product(rear, true));
            velocities.push(moved(&pair[1], along)?);
        }
        velocities.iter().flatten().all(|part| part.magnitude().is_finite()).then_some(velocities)
    }

    /// Returns the velocities of the places of a span, each with its coordinate, in metres per metre of the radius:
    /// "Velocities" in Lemma 10.
    fn drift(&self, handle: &Spanned) -> Option<Vector> {
        let Span(first, last) = handle.span;
        let around = |place: Place, reach: f64| {
            let point = self.exact.point(place);
            let (velocity, rate) = match self.exact.curve(place).arc_origin() {
                Some(origin) => {
                    let square = self.radius.square() + self.a.square();
                    let a = if place.0 == 1 { self.a } else { -self.a };
                    let [x, y] = minus(point, origin);
                    let turned = [self.radius * x - a * y, self.radius * y + a * x].map(|part| part.over(square));
                    let own = origin.map(|part| part.over(self.radius));
                    (plus(own, turned), Interval::ONE.over(square.sqrt()))
                }
                None => {
                    let distance = norm(point);
                    let nearest = distance - Interval::point(reach);
                    if !nearest.is_positive() {
                        return None;
                    }
                    (point.map(|part| part.over(distance)), Interval::ONE.over(nearest))
                }
            };
            let off = Interval::within((rate * reach).hi);
            Some(velocity.map(|part| part + off))
        };
        let half = handle.capsule.half;
        if first.0 == last.0 {
            return around(handle.capsule.middle, half);
        }
        let [one, other] = [around(first, 2.0 * half)?, around(last, 2.0 * half)?];
        let hull =
            |axis: usize| Interval { lo: one[axis].lo.min(other[axis].lo), hi: one[axis].hi.max(other[axis].hi) };
        (first.0 + 1 == last.0).then(|| [hull(0), hull(1)])
    }

    /// Returns an upper bound of the distance of a radius from the middle one, in metres.
    fn half_width(&self) -> f64 {
        (self.radius - Interval::point(self.radius.middle())).magnitude()
    }

    /// Returns the metres by which a point of the path is uncertain, as the radius is.
    fn blur(&self) -> f64 {
        let segments = &self.exact.segments;
        let ends = [1, 2].map(|segment| Place(segment, segments[segment].end.lo, 0.0));
        let places = [ends[0], ends[1], Place(3, segments[3].begin.hi, 0.0)];
        let widths = places.map(|place| {
            let [x, y] = self.exact.point(place);
            (x.hi - x.lo).hypot(y.hi - y.lo)
        });
        BLUR * widths.into_iter().fold(0.0, f64::max)
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
    /// The number of stretches that may still be tested.
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

/// Returns the polar angle of A, the beginning of the S, rounded. The pitch and the turn radius are in metres.
fn polar_angle(pitch: f64, turn_radius: f64) -> f64 {
    Interval::point(turn_radius).over(Interval::point(pitch).over(pi() * 2.0)).middle()
}

/// A turnaround of a team that comes in from far outside and goes out until the last handle is behind the turn.
#[derive(Debug, Clone)]
pub(crate) struct Passage {
    /// The path.
    pub path: Path,
    /// The path in intervals. It is turned about the centre so that the polar angle of A is a double, because the
    /// sines and cosines of a large angle that is uncertain would make all points uncertain.
    exact: ExactPath,
    /// The length of path before the turn, in metres. Lemma 8 holds further out.
    pub lead_in: f64,
    /// The length of path after it, in metres.
    pub lead_out: f64,
    description: PathDescription,
}

/// The factor by which the way out grows until the whole team has turned.
const LONGER: f64 = 1.1;

/// Limit of the steps of a proof.
const MOST_STEPS: u64 = 100_000;

impl Passage {
    /// Creates the passage. Returns `None` if Lemma 8 holds at no sensible distance.
    pub fn new(asked: Spaced<'_>, pitch: f64, arc_ratio: f64, turn_radius: f64) -> Option<Self> {
        let team = asked.team;
        // Further out than a = pitch / 2 pi a link that is shorter than its distance from the centre does not stall.
        let far = clear_beyond(asked, pitch, turn_radius.max(pitch))?;
        let length = |radius: f64| Path::spiral(pitch, radius / pitch).length();
        let lead_in = 1.0 + length(far) - length(turn_radius);
        let mut lead_out = team.length();
        let (radius, turned) = (Interval::point(turn_radius), polar_angle(pitch, turn_radius));
        let exact = ExactPath::turnaround(pitch, radius, arc_ratio, Some(turned), lead_in);
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
                return Some(Self { path, exact, lead_in, lead_out, description });
            }
            lead_out *= LONGER;
        }
    }

    /// Returns true if the passage is proved to be free of stall and lock, with boards further apart than the clearance,
    /// and the last bench to have turned at its end. Boards are bounded to the first order if `closely` is true, which
    /// passes boards that are all but too near.
    pub fn is_free(&self, Spaced { team, clearance }: Spaced<'_>, closely: bool, progress: Progress<'_>) -> bool {
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
            most_spans: MOST_SPANS,
            dragon: None,
        };
        let is_none = |event: &CertifiedEvent| match event.event {
            EventKind::PathEnd => true,
            EventKind::Contact if closely => true,
            _ => matches!(event.status, Status::None { time_lo: None }),
        };
        let mut last = None;
        let mut keep = |line: &CertificateLine| {
            if let CertificateLine::Step(step) = line {
                last = Some(step.to);
            }
            Ok(())
        };
        let search =
            CertificateSearch::new(given, Vec::new(), &mut keep).on_path(self.exact.clone()).with_clearance(clearance);
        let search = if closely { search.without_boards() } else { search };
        let found = search.run(progress);
        if !found.is_ok_and(|events| events.iter().all(is_none)) {
            return false;
        }
        let Some(mut at) = last.map(|head| GridPoint::at(head, travelled)) else { return false };
        let chain = || Chain::new(&self.path, self.exact.clone(), team);
        let descent = || Descent::new(chain(), travelled, MOST_STEPS, None);
        if closely && !descent().stays_apart_to(&path_end(&self.exact, &self.path), clearance, progress) {
            return false;
        }
        let chain = chain();
        let handles = chain.spans(&mut at.clone(), &mut at, team.benches);
        handles.is_some_and(|handles| handles.last().is_some_and(|last| last.span.0.0 + 1 == self.path.segments()))
    }
}

#[cfg(test)]
mod tests;
