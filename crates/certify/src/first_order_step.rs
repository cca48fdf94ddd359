//! Handles and boards over a step of the head: spans by Lemma 1, and first-order enclosures by Lemma 6 of
//! `docs/proofs.md`.

use super::first_order::{FirstOrderBoard, FirstOrderHandle, Pace, When};
use super::grid::{GridPoint, fine_place, place};
use super::interval::Interval;
use super::lines::Links;
use super::place::{Place, Span};
use super::step::{Chain, Claim, Listed, Obstacle};

/// The grid points of a step.
pub(super) struct StepPoints<'k> {
    pub from: &'k mut GridPoint,
    pub middle: &'k mut GridPoint,
    pub to: &'k mut GridPoint,
}

/// Reborrows the grid points of a step.
pub(super) fn step_points<'k>(
    from: &'k mut GridPoint,
    middle: &'k mut GridPoint,
    to: &'k mut GridPoint,
) -> StepPoints<'k> {
    StepPoints { from, middle, to }
}

/// The handles of a step, as spans and as first-order enclosures.
pub(super) struct FirstOrderStep<'c, 'a> {
    chain: &'c Chain<'a>,
    pub listed: Listed<'c, 'a>,
    handles: Vec<FirstOrderHandle>,
    /// The place of each handle near which it is in the middle of the step.
    pub places: Vec<Place>,
    /// The place of the head in the middle of the step.
    pub at: Place,
    /// Greatest |tau|.
    half_step: f64,
}

impl<'c, 'a> FirstOrderStep<'c, 'a> {
    pub fn new(chain: &'c Chain<'a>, points: &StepPoints) -> Self {
        let exact = &chain.exact;
        let pace = |at| Pace::in_metres(exact.length(points.from.head, at).max(exact.length(at, points.to.head)));
        Self::with_pace(chain, points, pace)
    }

    /// Lists the head, whose motion follows from its place in the middle of the step.
    pub fn with_pace(
        chain: &'c Chain<'a>,
        StepPoints { from, middle, to }: &StepPoints,
        pace: impl FnOnce(Place) -> Pace,
    ) -> Self {
        let exact = &chain.exact;
        let listed = Listed::new(chain, Span(from.head, to.head), to.travelled - from.travelled);
        // Rounding may put the middle outside; every place between the two is valid.
        let inside = exact.in_order(from.head, middle.head) && exact.in_order(middle.head, to.head);
        let at = if inside { middle.head } else { from.head };
        let pace = pace(at);
        let half_step = pace.half_step;
        let handles = vec![FirstOrderHandle::head(exact, &listed.handles[0], at, pace)];
        Self { chain, listed, handles, places: vec![at], at, half_step }
    }

    /// Encloses one more handle.
    pub fn extend(&mut self, StepPoints { from, middle, to }: StepPoints, links: Links) -> Result<(), Obstacle> {
        let Chain { path, exact, team, .. } = self.chain;
        let link = self.listed.handles.len() - 1;
        self.listed.extend(from, to, Claim { links, moving: false, clear: false })?;
        middle.extend_to(link + 1, path, team).map_err(|_| Obstacle::Link(link))?;
        let solved = middle.handles[link + 1].param;
        let spans = (&self.listed.handles[link], &self.listed.handles[link + 1]);
        let Span(first, last) = spans.1.span;
        let is_inside = |at: Place| exact.in_order(first, at) && exact.in_order(at, last);
        // A span may be narrower than a unit in the last place.
        let solved = [place(solved), fine_place(solved)].into_iter().find(|at| is_inside(*at));
        let at = solved.unwrap_or(spans.1.capsule.middle);
        let length = self.chain.link(link);
        let follower = self.handles[link].follower(exact, spans, at, length, self.half_step);
        self.handles.push(follower.ok_or(Obstacle::Link(link))?);
        self.places.push(at);
        Ok(())
    }

    /// Returns the board of a bench.
    pub fn board(&self, bench: usize) -> FirstOrderBoard {
        let (front, rear, link) = (self.handles[bench], self.handles[bench + 1], self.chain.link(bench));
        FirstOrderBoard::new(&self.chain.shape(bench), front, rear, link, self.half_step)
    }

    /// Returns true if two boards stay further apart than `threshold`.
    pub fn are_apart(&self, [a, b]: [usize; 2], threshold: f64) -> bool {
        let when = if self.are_on_one_circle(a, b) { When::Middle } else { When::Always };
        self.board(a).is_further_than(threshold, &self.board(b), when)
    }

    /// Returns true if all handles of two boards, and the handles between, stay on one arc: then the boards keep their
    /// distance.
    fn are_on_one_circle(&self, a: usize, b: usize) -> bool {
        let handles = &self.listed.handles;
        let (first, last) = (handles[a].span, handles[b + 1].span);
        let segment = first.0.0;
        let same = [first.0, first.1, last.0, last.1].iter().all(|place| place.0 == segment);
        same && self.chain.exact.segments[segment].curve.arc_origin().is_some()
    }

    /// Returns the run of equal boards from `first` on as one board, on the line of the last listed handle.
    pub fn straight_run(&self, first: usize) -> FirstOrderBoard {
        let last = self.handles.len() - 1;
        let back = |metres: Interval| self.handles[last].moved_back(metres);
        let (links, length) = self.chain.run(first);
        let front = self.chain.links[1] * (first - last) as f64;
        let is_own_tail = self.chain.team.own_tail() == Some(first);
        let rear = if is_own_tail { front + length } else { self.chain.links[1] * (first + links - last) as f64 };
        FirstOrderBoard::new(&self.chain.shape(first), back(front), back(rear), length, self.half_step)
    }
}
