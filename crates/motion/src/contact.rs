//! First contact and least clearance of a motion along any path, by conservative advancement. The head advances in
//! steps that are proved to contain no nearer pair, and a step is halved if the proof fails.
//!
//! In: a path, a team, the places where handles turn round ([`Singularities`](super::singularities::Singularities)),
//! two places of the head. Out: an [`Event`] or a [`LeastClearance`], and the place up to which the search came. The
//! search of `stepped_search` serves boards of one team, boards of two dragons ([`between`]), and boards and obstacles
//! (`ground`).
//!
//! **How far handles move.** Handle 1 turns round only where the head is at a head turn. Handle k + 1 turns round only
//! where handle k turns round or is at a body turn. Therefore the motion of every handle in a step is determined by the
//! two configurations at the ends of the step and by the followers of the turns between them. The path that handle k
//! passes over, back and forth, has the length m_k (`displacement`).
//!
//! **How far boards move.** A point of the board from handle i to i + 1 is rear + s (front - rear) + w n. Here n is the
//! link's unit normal, s is in [-e, 1 + e] with e = inset / link, and |w| <= width / 2. If the handles have velocities
//! u and v, then n turns at a rate of at most (|u| + |v|) / link. So in a step the point moves along a path no longer
//! than
//! |s| m_i + |1 - s| m_{i+1} + (width / (2 link)) (m_i + m_{i+1}). For any s this length is at most
//! C = max(m_i, m_{i+1}) + (e + width / (2 link)) (m_i + m_{i+1}).
//!
//! **Why nothing is skipped.** Suppose that at some time of a step the clearance of a pair is x <= `limit`, where
//! limit >= 0. Let P and Q be the nearest points of the two boards at that time, or a common point if the boards
//! overlap, so that P and Q are at most `limit` apart. At both ends of the step the *same* two points of the boards are
//! at least as far apart as the clearances there. Because their paths before and after that time together are their
//! paths in the step, it follows that c_start + c_end <= 2 limit + B, where B = C_a + C_b. A pair that violates this
//! therefore stays above the limit during the whole step. (C need not be additive over sub-steps, because the lengths
//! of the paths of P and Q are.)
//!
//! For a limit below 0 there may be no such common pair of points. There the clearance is the largest gap over all
//! directions, so along the best direction at either end two points bound the clearance, but these points differ
//! between the ends. C must then be additive, and so has the sum m_i + m_{i+1} in place of the maximum. Uncertain steps
//! are halved, the earlier half first, down to the last digits of the distance.
//!
//! **Seen from the chain.** All this holds in any frame of reference that moves rigidly. If all handles from the first
//! to the last of a pair stay on one line or circle, their distances along it stay the same, and B = 0. On one spiral,
//! take the frame that turns about the centre with handle i and also moves outward by a d theta_i, in a fixed direction
//! e of the frame. Let psi_k = theta_k - theta_i. In this frame handle k moves by a d psi_k outward and by r_k d psi_k
//! around. It also moves by a d theta_i times the difference between its outward direction and e, which is at most the
//! angle between the two directions. While the handles from i to k go the same way, psi_k is monotone, and so is the
//! angle of each link, because the outer handle turns less than the inner one. (The product (t . b) sqrt(a^2 + r^2) is
//! larger at the outer handle, by 2 a (r + r') sin^2(d / 2) / link.) Therefore these lengths are determined by the ends
//! of the step.
//!
//! **Which pairs.** Every link between the first and the last has the same length, so the place of handle i >= 1 determines all
//! places behind it. A pair (i, i + k) is therefore where (1, 1 + k) is when handle 1 is at that place. Let S be the
//! first place of handle 1. If handle i is at S or ahead of it, then handle 1, which is further ahead and has come from
//! S without a jump, has been at the place of handle i before. At that time the pair (1, 1 + k) was where (i, i + k) is
//! now. Hence pairs without boards 0 and 1 matter only in steps in which handle 2 is somewhere behind S, in either
//! direction of motion. A pair does not matter if its front handles are both behind the quiet place, because there no
//! two boards ever come within the limit. If the tail has a size of its own, its pairs are never where others have been,
//! and all of them matter; for the tail, m_k follows from turns of its own link. No pair matters while the whole team keeps its shape. Followers are solved
//! only as far back as they can reach the boards that matter (`reach`).

pub mod between;
mod broad_phase;
mod configuration;
mod displacement;
mod ground;
mod reach;
mod search;
mod stepped_search;

use crate::linkage::NoFollower;
use crate::model::curve::Curve;
use crate::model::path::{Param, Path};
use crate::model::root::golden_section_min;
use crate::model::team::Team;

use super::event::{Budget, Event};
use super::ground::Ground;
use configuration::Configuration;
pub use ground::{ObstacleClearance, Touch};

/// The result of a search, and the place up to which the search came.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found<T> {
    /// The result.
    pub value: Option<T>,
    /// The travel of the head up to which that is proved, in metres: the whole request, unless the budget was spent.
    pub searched_until: f64,
}

/// The least clearance of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastClearance {
    /// The distance between the two boards, in metres; negative where they overlap.
    pub value: f64,
    /// The distance that the head has travelled, in metres.
    pub travelled: f64,
    /// The lower bench, counted from 0.
    pub bench_a: u32,
    /// The higher bench.
    pub bench_b: u32,
}

/// The searches for one team on one path.
pub struct ConservativeAdvancement<'a> {
    path: &'a Path,
    team: &'a Team,
    /// The places of the head at which handle 1 turns round.
    head_turns: Vec<Param>,
    /// The places of the front handle of a body link, and of the tail's if it differs, at which its rear handle turns
    /// round.
    body_turns: Vec<Param>,
    tail_turns: Vec<Param>,
    /// The index, for each segment, of the first segment of the run with the same constant curvature.
    curves: Vec<usize>,
}

impl<'a> ConservativeAdvancement<'a> {
    /// Creates the searches for `team` on `path`. `head_turns` are the places of the head, in metres of travel, at
    /// which handle 1 turns round, and `body_turns` the places of a body link's front handle at which its rear handle
    /// does. Both are in order.
    pub fn new(path: &'a Path, team: &'a Team, head_turns: &[f64], body_turns: &[f64]) -> Self {
        let places = |turns: &[f64]| turns.iter().map(|travelled| path.param_at(*travelled)).collect();
        let mut curves = Vec::with_capacity(path.segments());
        for segment in 0..path.segments() {
            let curvature = |segment| path.segment_at(segment).constant_curvature();
            let same = segment > 0 && curvature(segment).is_some() && curvature(segment - 1) == curvature(segment);
            curves.push(if same { curves[segment - 1] } else { segment });
        }
        let tail_turns = Vec::new();
        Self { path, team, head_turns: places(head_turns), body_turns: places(body_turns), tail_turns, curves }
    }

    /// Adds the places of the front handle of the tail's link, in metres of travel, at which its rear handle turns round,
    /// for a tail with a link of its own. They are in order.
    pub fn with_tail_turns(mut self, turns: &[f64]) -> Self {
        self.tail_turns = turns.iter().map(|travelled| self.path.param_at(*travelled)).collect();
        self
    }

    /// Finds the first contact while the head goes from one place to another, metres of travel. The first contact is
    /// the first place, to the last digits, at which a signed distance is 0 or less. The event has the deepest of the
    /// pairs that touch there, and the touching point. Boards that overlap at `from` are a contact there: the deepest
    /// pair, at the centre of its overlap.
    ///
    /// # Errors
    /// [`NoFollower`] if a configuration strictly inside the motion cannot be solved.
    pub fn first_contact(&self, from: f64, to: f64, budget: &mut Budget) -> Result<Found<Event>, NoFollower> {
        search::first_contact(self, from, to, budget)
    }

    /// Finds the least clearance while the head goes from one place to another; `None` for fewer than three benches.
    ///
    /// # Errors
    /// [`NoFollower`] if a configuration strictly inside the motion cannot be solved.
    pub fn least_clearance(
        &self,
        from: f64,
        to: f64,
        budget: &mut Budget,
    ) -> Result<Found<LeastClearance>, NoFollower> {
        search::least_clearance(self, from, to, budget)
    }

    /// Finds the first touch of each obstacle of a ground, in the path's own coordinates, while the head goes from one
    /// place to another. The first touch is the first place, to the last digits, at which the obstacle's clearance is 0
    /// or less. Returns the touches in the order of the obstacles, and the metres of travel up to which they are
    /// proved.
    ///
    /// # Errors
    /// [`NoFollower`] if a configuration strictly inside the motion cannot be solved.
    pub fn first_touches(
        &self,
        ground: &Ground,
        from: f64,
        to: f64,
        budget: &mut Budget,
    ) -> Result<(Vec<Option<Touch>>, f64), NoFollower> {
        ground::first_touches(self, ground, (from, to), budget)
    }

    /// Finds the least clearance of each obstacle of a ground as [`first_touches`](Self::first_touches).
    ///
    /// # Errors
    /// [`NoFollower`] if a configuration strictly inside the motion cannot be solved.
    pub fn obstacle_clearances(
        &self,
        ground: &Ground,
        from: f64,
        to: f64,
        budget: &mut Budget,
    ) -> Result<(Vec<Option<ObstacleClearance>>, f64), NoFollower> {
        ground::least_clearances(self, ground, (from, to), budget)
    }

    /// Returns the least clearance of one pair within a bracket that holds one minimum, and the head's place there.
    /// Infinite if a configuration cannot be solved, or the budget is spent.
    pub fn minimum_of(&self, (a, b): (u32, u32), (from, to): (f64, f64), budget: &mut Budget) -> (f64, f64) {
        let pair = (a as usize, b as usize);
        let clearance = |travelled: f64| {
            let mut configuration = Configuration::new(self.path, travelled);
            let solved = configuration.solve_to(pair.1 + 1, self.path, self.team, budget);
            solved.map_or(f64::INFINITY, |()| configuration.clearance(pair))
        };
        golden_section_min(clearance, from, to)
    }

    /// Returns the metres of travel of the head up to which the whole team stays on its line or circle. Until then the
    /// team keeps its shape. Returns `None` if the team is not on a line or circle.
    fn rigid_until(&self, travelled: f64) -> Option<f64> {
        let head = self.path.param_at(travelled);
        let segment = self.path.segment(head);
        segment.constant_curvature()?;
        let along = |chord: f64| segment.arc_over(chord);
        let body = (self.team.benches - 1) as f64 * along(self.team.link(1))?;
        // With a margin for the rounding of the sum.
        let mut length = (1.0 + 1e-7) * (along(self.team.link(0))? + body);
        if let Some(tail) = self.team.own_tail() {
            length += (1.0 + 1e-7) * along(self.team.link(tail))?;
        }
        let curve = self.curves[head.segment];
        let begin = if curve == 0 { f64::NEG_INFINITY } else { self.path.end_of(curve - 1) };
        let same = self.curves[head.segment..].iter().take_while(|other| **other == curve).count();
        let last = head.segment + same - 1;
        (travelled - length >= begin).then(|| self.path.end_of(last))
    }
}

#[cfg(test)]
mod tests;
