//! Bounds of the relative motion of two boards while the head goes from one place to another. The search rests on these
//! bounds, which are proved in the header of [`super`].

use crate::event::Budget;
use crate::linkage::follower;
use crate::model::board::Board;
use crate::model::curve::Curve;
use crate::model::curve_bounds::CurveBounds;
use crate::model::path::{Param, Path};
use crate::model::team::Team;
use crate::model::{Point, Vector};

use super::ConservativeAdvancement;
use super::configuration::{Configuration, Pair};
use super::reach::Reach;
use super::stepped_search::Halt;

/// The motion of one handle in a step.
#[derive(Debug, Clone, Copy)]
struct HandleMotion {
    /// The length of path that it passed over, back and forth, in metres: an upper bound of its total variation.
    length: f64,
    /// Handles with one number, and all handles between them, went one way.
    run: u32,
}

/// The motions of the handles in one step of the head, from the first handle on.
#[derive(Debug, Default)]
pub(super) struct Displacements {
    handles: Vec<HandleMotion>,
    /// The places at which the last handle turned round in the step, in order.
    turned_at: Vec<Param>,
    forward: Option<bool>,
    /// A turning place has no handle behind: from here on nothing is known.
    unbounded: bool,
}

impl Displacements {
    /// Returns the metres by which the handle added last may have left the stretch between its first and last place.
    pub fn excursion(&self) -> f64 {
        match self.handles.last() {
            Some(last) if self.unbounded || !self.turned_at.is_empty() => last.length,
            _ => 0.0,
        }
    }

    /// Adds handles, which both configurations have, until there are `count`.
    pub fn extend_to(
        &mut self,
        count: usize,
        chain: &ConservativeAdvancement,
        ends: (&Configuration, &Configuration),
        budget: &mut Budget,
    ) -> Result<(), Halt> {
        while self.handles.len() < count {
            self.push(chain, ends, budget)?;
        }
        Ok(())
    }

    fn push(
        &mut self,
        chain: &ConservativeAdvancement,
        (before, after): (&Configuration, &Configuration),
        budget: &mut Budget,
    ) -> Result<(), Halt> {
        let handle = self.handles.len();
        let front_turned = !self.turned_at.is_empty();
        if handle > 0 {
            self.turned_at = self.followers_of_turns(chain, (before, after), handle - 1, budget)?;
        }
        let (first, last) = (before.places[handle], after.places[handle]);
        let mut length = 0.0;
        let mut from = first;
        for to in self.turned_at.iter().copied().chain([last]) {
            length += length_bound(chain.path, from, to);
            from = to;
        }
        let ahead = progress(chain.path, first, last);
        let one_way = !self.unbounded && !front_turned && self.turned_at.is_empty();
        let same_way = ahead == 0.0 || self.forward.is_none_or(|forward| forward == (ahead > 0.0));
        let run = self.handles.last().map_or(0, |motion| motion.run) + u32::from(!(one_way && same_way));
        if ahead != 0.0 {
            self.forward = Some(ahead > 0.0);
        }
        self.handles.push(HandleMotion { length: if self.unbounded { f64::INFINITY } else { length }, run });
        Ok(())
    }

    /// Returns the places at which the follower of `handle` turned round. These places are behind each turning place of
    /// the handle, and behind each place it passed over at which a follower turns.
    fn followers_of_turns(
        &mut self,
        chain: &ConservativeAdvancement,
        (before, after): (&Configuration, &Configuration),
        handle: usize,
        budget: &mut Budget,
    ) -> Result<Vec<Param>, Halt> {
        let turns = match chain.team.own_tail_link() {
            _ if handle == 0 => &chain.head_turns,
            // A tail that differs in width alone turns where a body link does.
            Some(tail) if handle == tail => &chain.tail_turns,
            _ => &chain.body_turns,
        };
        if self.turned_at.is_empty() && turns.is_empty() {
            return Ok(Vec::new());
        }
        let mut fronts = Vec::new();
        let mut from = before.places[handle];
        for to in self.turned_at.iter().copied().chain([after.places[handle]]) {
            let backward = progress(chain.path, from, to) < 0.0;
            let (low, high) = if backward { (to, from) } else { (from, to) };
            let begin = turns.partition_point(|turn| progress(chain.path, low, *turn) <= 0.0);
            let end = turns.partition_point(|turn| progress(chain.path, *turn, high) > 0.0).max(begin);
            if backward {
                fronts.extend(turns[begin..end].iter().rev());
            } else {
                fronts.extend(&turns[begin..end]);
            }
            fronts.push(to);
            from = to;
        }
        fronts.pop();
        budget.spend(fronts.len() as u64)?;
        let link = chain.team.link(handle);
        let rears: Option<Vec<Param>> =
            fronts.into_iter().map(|front| follower(chain.path, front, link).ok()).collect();
        // Rounding may take a turning place past a lock; the step is then halved.
        self.unbounded |= rears.is_none();
        Ok(rears.unwrap_or_default())
    }

    /// Returns B of the proof: an upper bound of the metres by which two boards came nearer each other and moved apart
    /// again. `weights` belong to the sign of the clearance that is to be excluded.
    pub fn relative_motion_bound(
        &self,
        chain: &ConservativeAdvancement,
        ends: (&Configuration, &Configuration),
        (a, b): Pair,
        weights: Weights,
    ) -> f64 {
        let stage = self.on_stage(chain, a, weights) + self.on_stage(chain, b, weights);
        if self.handles[a].run != self.handles[b + 1].run {
            return stage;
        }
        let (before, after) = ends;
        let segments =
            [before.places[a], before.places[b + 1], after.places[a], after.places[b + 1]].map(|place| place.segment);
        let curve = chain.curves[segments[0]];
        let keeps_shape = chain.path.segment(before.places[a]).constant_curvature().is_some();
        if keeps_shape && segments.iter().all(|segment| chain.curves[*segment] == curve) {
            return 0.0;
        }
        if segments.iter().any(|segment| *segment != segments[0]) {
            return stage;
        }
        let seen = |bench| seen_from_frame(chain, ends, bench, a, weights);
        seen(a).zip(seen(b)).map_or(stage, |(one, other)| stage.min(one + other))
    }

    /// Returns an upper bound of the relative motion of any two of the foremost boards, in metres.
    pub fn most_relative_motion(&self, chain: &ConservativeAdvancement, benches: usize) -> f64 {
        2.0 * (0..benches).map(|bench| self.on_stage(chain, bench, Weights::Additive)).fold(0.0, f64::max)
    }

    /// Returns the circles that the foremost boards do not leave in the step.
    pub fn reach(
        &self,
        chain: &ConservativeAdvancement,
        ends: (&Configuration, &Configuration),
        benches: usize,
    ) -> Reach {
        let (before, after) = (&ends.0.boards[..benches], &ends.1.boards[..benches]);
        let sum: Vector = before.iter().map(|board| board.centre.coords).sum();
        let centre = Point::from(sum / benches as f64);
        let (mut radius, mut outermost) = (0.0, 0.0);
        for (bench, (first, last)) in before.iter().zip(after).enumerate() {
            let stage = self.on_stage(chain, bench, Weights::OnePoint);
            let seen = self.stays_on_segment(ends, bench).then(|| {
                let frame_travel = chain.path.segment(ends.0.places[bench]).frame_travel(turned(ends, bench));
                seen_from_frame(chain, ends, bench, bench, Weights::OnePoint).map(|seen| seen + frame_travel)
            });
            let outward = seen.flatten().map_or(stage, |seen| stage.min(seen));
            let far = |board: &Board| (board.centre - centre).norm() + board.circle_radius();
            let out =
                |board: &Board| board.corners().map(|corner| corner.coords.norm()).into_iter().fold(0.0, f64::max);
            // A point of a board goes out no further than half its path between its two ends.
            radius = f64::max(radius, 0.5 * (far(first) + far(last) + stage));
            outermost = f64::max(outermost, 0.5 * (out(first) + out(last) + outward));
        }
        Reach { centre, radius, outermost }
    }

    fn stays_on_segment(&self, (before, after): (&Configuration, &Configuration), bench: usize) -> bool {
        let segment = before.places[bench].segment;
        let places = [before.places[bench + 1], after.places[bench], after.places[bench + 1]];
        self.handles[bench].run == self.handles[bench + 1].run && places.iter().all(|place| place.segment == segment)
    }

    /// Returns the signed curvature of the line or circle on which a board stays while it goes one way. Returns `None`
    /// for any other motion.
    pub fn one_curve(
        &self,
        chain: &ConservativeAdvancement,
        (before, after): (&Configuration, &Configuration),
        bench: usize,
    ) -> Option<f64> {
        let curvature = chain.path.segment(before.places[bench]).constant_curvature()?;
        let places = [before.places[bench], before.places[bench + 1], after.places[bench], after.places[bench + 1]];
        let curve = chain.curves[places[0].segment];
        let stays = places.iter().all(|place| chain.curves[place.segment] == curve);
        (stays && self.handles[bench].run == self.handles[bench + 1].run).then_some(curvature)
    }

    /// Returns an upper bound of the displacement of a board's points on the stage, in metres.
    pub fn on_stage(&self, chain: &ConservativeAdvancement, bench: usize, weights: Weights) -> f64 {
        weights.board(chain.team, bench, self.handles[bench].length, self.handles[bench + 1].length)
    }
}

/// Returns an upper bound of the displacement of a board's points, metres, seen from the frame of handle `reference` on
/// the same segment. `None` if the segment has no such bound.
fn seen_from_frame(
    chain: &ConservativeAdvancement,
    ends: (&Configuration, &Configuration),
    bench: usize,
    reference: usize,
    weights: Weights,
) -> Option<f64> {
    let (segment, frame) = (chain.path.segment(ends.0.places[reference]), turned(ends, reference));
    let behind = ends.0.places[reference + 1].at;
    let moved =
        |handle: usize| segment.seen_from_frame((ends.0.places[handle].at, ends.1.places[handle].at), frame, behind);
    Some(weights.board(chain.team, bench, moved(bench)?, moved(bench + 1)?))
}

/// Returns the change of a handle's coordinate in a step within one segment.
fn turned((before, after): (&Configuration, &Configuration), handle: usize) -> f64 {
    after.places[handle].at.minus(before.places[handle].at)
}

/// The way in which the displacements of a board's two handles bound the displacements of its points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Weights {
    /// The upper bound for one point of the board: sufficient to exclude a clearance above zero.
    OnePoint,
    /// A bound that is additive over sub-steps, for overlaps.
    Additive,
}

impl Weights {
    /// Returns the weights for a search of clearances at or below `limit`.
    pub fn for_limit(limit: f64) -> Self {
        if limit < 0.0 { Self::Additive } else { Self::OnePoint }
    }

    fn board(self, team: &Team, bench: usize, front: f64, rear: f64) -> f64 {
        let both = front + rear;
        let link_part = match self {
            Self::OnePoint => front.max(rear),
            Self::Additive => both,
        };
        link_part + (team.hole_inset + 0.5 * team.board_width(bench)) / team.link(bench) * both
    }
}

/// Returns the units of a segment's coordinate from one place to another, positive in the direction of travel; infinite
/// from one segment to another.
pub(super) fn progress(path: &Path, from: Param, to: Param) -> f64 {
    match from.segment.cmp(&to.segment) {
        std::cmp::Ordering::Less => f64::INFINITY,
        std::cmp::Ordering::Greater => f64::NEG_INFINITY,
        std::cmp::Ordering::Equal => path.segment(from).progress(from.at, to.at),
    }
}

/// Returns an upper bound of the metres of path between two places.
fn length_bound(path: &Path, from: Param, to: Param) -> f64 {
    if from.segment != to.segment {
        return path.arc_length(from, to).abs();
    }
    path.segment(from).length_bound(from.at, to.at)
}
