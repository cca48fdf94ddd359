//! Pairs of boards over one step, and from a place to a lock. Lemma 6 of `docs/proofs.md`.

use super::{BEFORE_LOCK, Descent, TOUCH};
use crate::boards::MovingBoard;
use crate::capsule::Spanned;
use crate::first_order::When;
use crate::first_order_step::FirstOrderStep;
use crate::grid::GridPoint;
use crate::lines::Links;
use crate::place::Span;
use crate::step::{Claim, Listed, sum_above};
use bench_dragon_motion::event::Event;

impl Descent<'_, '_> {
    /// Returns true if no two boards are nearer than the threshold from here to a lock. Until then the lost handle
    /// stays between two places that it cannot pass, and the handles behind it follow.
    pub(super) fn stays_to_lock(&mut self, lock: &Event) -> bool {
        let link = lock.bench_a.unwrap_or(0) as usize;
        let most = TOUCH * self.chain.team.shortest_link();
        let least = 2.0 * (lock.travelled - self.at.travelled).max(BEFORE_LOCK[2]);
        (0..40).map(|power| least * 2f64.powi(power)).take_while(|beyond| *beyond < most).any(|beyond| {
            let mut to = self.grid_point(lock.travelled + beyond);
            let (chain, at, mut end) = (&self.chain, &mut self.at, to.clone());
            let Some(mut handles) = chain.spans(at, &mut to, link) else { return false };
            let Some(last) = chain.spans(&mut to, &mut end, link) else { return false };
            let Some(window) = chain.until_lock(at, link, &handles[link], &last[link]) else { return false };
            handles.push(Spanned::new(&chain.exact, window));
            self.are_apart_behind(handles, window)
        })
    }

    /// Returns true if all boards are apart while the last of `handles` is anywhere in the window and the others are in
    /// their spans.
    fn are_apart_behind(&self, handles: Vec<Spanned>, window: Span) -> bool {
        let chain = &self.chain;
        let [mut from, mut to] = [window.0, window.1].map(|place| {
            let mut point = GridPoint::at(place, self.at.travelled);
            point.handles = vec![point.handles[0]; handles.len()];
            point
        });
        // Lemma 4 applies if handle 1 is lost.
        let is_covered = handles.len() == 2 && chain.start.is_some_and(|start| chain.exact.in_order(start, window.0));
        let links = if is_covered { self.covered.links } else { Links::All };
        let mut listed = Listed::behind(chain, handles, f64::INFINITY);
        while listed.handles.len() <= chain.team.benches && !self.is_enough(&listed, links) {
            if listed.extend(&mut from, &mut to, Claim { links, moving: false, clear: false }).is_err() {
                return false;
            }
        }
        let is_apart = self.upper.is_none() || self.boards_are_apart(&listed, None, links).is_ok();
        is_apart && self.stays_beside(&listed, links)
    }

    /// Returns true if the listed handles suffice for a step.
    pub(super) fn is_enough(&self, listed: &Listed, links: Links) -> bool {
        let last = listed.handles.len() - 1;
        if last < 2 {
            return false;
        }
        let chain = &self.chain;
        match links {
            Links::Front if chain.team.own_tail().is_some() => listed.is_on_line(last),
            Links::Front if !self.looks_at_boards() => true,
            Links::Front if chain.exact.begins_inward() => listed.is_beyond_front(self.threshold().max(0.0), last),
            _ => listed.is_on_line(last),
        }
    }

    /// Shows that no two boards come as near as the threshold: all pairs, or the pairs with board 0 or 1.
    ///
    /// # Errors
    /// A pair for which this cannot be shown.
    pub(super) fn boards_are_apart(
        &self,
        listed: &Listed,
        first_order: Option<&FirstOrderStep>,
        links: Links,
    ) -> Result<(), [usize; 2]> {
        let (chain, benches, threshold) = (&self.chain, self.chain.team.benches, self.threshold());
        let count = listed.handles.len() - 1;
        let boards: Vec<_> = (0..count).map(|bench| chain.board(&listed.handles, bench)).collect();
        let is_spiral = chain.exact.begins_inward();
        let far = threshold.max(0.0);
        let are_apart = |[a, b]: [usize; 2]| match first_order {
            Some(first_order) => first_order.are_apart([a, b], threshold),
            None => boards[a].is_apart_by(threshold, &boards[b]),
        };
        let innermost: Vec<f64> = (0..count).map(|handle| listed.innermost(handle)).collect();
        for (a, board) in boards.iter().enumerate() {
            let outermost = sum_above(chain.shape(a).outermost(board), far);
            let mut beyond = false;
            let Some(first) = chain.first_partner(links, a) else { break };
            for (b, other) in boards.iter().enumerate().skip(first) {
                beyond = innermost[b] > outermost;
                if beyond {
                    break;
                }
                if !board.is_further_than(far, other) && !are_apart([a, b]) {
                    return Err([a, b]);
                }
            }
            let next = count.max(first);
            if next < benches && !beyond && !self.is_apart_from_rest(a, board, listed, first_order, next) {
                return Err([a, next]);
            }
        }
        let spare = (chain.links[1] - chain.shape(1).inset * 2.0).lo;
        if links == Links::All && !is_spiral && count < benches && spare <= threshold {
            return Err([count, count + 2]);
        }
        Ok(())
    }

    /// Returns true if a board is apart from the boards from `next` on, which are not listed.
    fn is_apart_from_rest(
        &self,
        a: usize,
        board: &MovingBoard,
        listed: &Listed,
        first_order: Option<&FirstOrderStep>,
        next: usize,
    ) -> bool {
        let threshold = self.threshold();
        if self.chain.exact.begins_inward() {
            let outermost = sum_above(self.chain.shape(a).outermost(board), threshold.max(0.0));
            return listed.innermost(listed.handles.len() - 1) > outermost;
        }
        self.chain.runs(next).all(|run| {
            board.is_further_than(threshold.max(0.0), &listed.straight_run(run))
                || match first_order {
                    Some(first_order) => {
                        first_order.board(a).is_further_than(threshold, &first_order.straight_run(run), When::Always)
                    }
                    None => board.is_apart_by(threshold, &listed.straight_run(run)),
                }
        })
    }
}
