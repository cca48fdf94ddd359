//! Singular configurations of the chain: the first stall (dead point) and the lock or path end that ends the motion.
//!
//! In: a path and a team. Out: [`Singularities`], in metres of travel of the head. The search for contacts cuts its
//! steps at the turning points found here.
//!
//! **Two links are enough.** Let F be the follower map of a body link, from its front handle's travel to its rear
//! handle's. It is the continuous map that begins on the first segment, where it leads to the first place behind at the
//! link's distance. All body links begin there, so all have the same F. Handle k + 1 is behind handle k, so no handle
//! after the first is ever further along the path than handle 1 has been. On the first segment, outside the fold, F is
//! continuous arbitrarily far back. So while F exists up to the furthest place of handle 1, no body link locks. Before
//! the first stall all handles go forward, so each place is first reached by the foremost handle that did not start
//! beyond it. The handles that start behind handle 1 are on the first segment, which is a straight line without
//! singularities, or an inward spiral with singularities near its centre only (`inward`). Therefore only a start near
//! the centre makes `SingularitySearch::body_stall` consider more links.
//!
//! So two problems in one variable remain, a `LinkTrace` each: the head's link for all places of the head, and a body
//! link for all places that handle 1 has come to. They are solved in lockstep. Every step is proven to hold nothing
//! unseen (`certificate`) or halved, down to the resolution of doubles (`trace`). Between two turning points of handle
//! 1 its place is monotone in the head's place, so the head's place is found from handle 1's place by bisection.
//!
//! A tail whose link has a length of its own is a third problem, for the places that its front handle comes to (`tail`).

mod certificate;
mod inward;
mod tail;
mod trace;

use crate::model::Point;
use crate::model::path::{Branch, Param, Path};
use crate::model::root::bisect_predicate;
use crate::model::team::Team;

use bench_dragon_messages::state::EventKind;

use super::event::{Budget, Event};
use certificate::{Configuration, Link};
use trace::{LinkTrace, TraceEnd};

/// The singular configurations of a motion, up to the one that ends it.
#[derive(Debug, Clone, PartialEq)]
pub struct Singularities {
    /// The first stall of any link.
    pub stall: Option<Event>,
    /// The lock, or the path's end if no link locks. `None` if the search ended before either.
    pub end: Option<Event>,
    /// The travel of the head up to which the search is complete, in metres: that of `end`, if there is one.
    pub searched_until: f64,
    /// The places of the head, in metres of travel, at which the first link's rear handle turns round, in order.
    pub head_turns: Vec<f64>,
    /// The places of a body link's front handle, in metres of travel, at which its rear handle turns round, in order.
    pub body_turns: Vec<f64>,
    /// The same of the tail's link, if it has a length of its own.
    pub tail_turns: Vec<f64>,
    /// The stretches in which followers are not the first places at their distances, for [`Path::with_branches`].
    pub branches: Vec<Branch>,
}

impl Singularities {
    /// Returns the metres of travel, at most `to`, up to which all turns are known.
    pub fn known_to(&self, to: f64) -> f64 {
        if self.end.is_some() { to } else { to.min(self.searched_until) }
    }

    /// Searches from the start of the motion until it ends or the budget is spent.
    pub fn search(path: &Path, team: &Team, budget: &mut Budget) -> Self {
        let trace = |link: usize, start| LinkTrace::new(Link { path, length: team.link(link) }, start);
        let traces = trace(0, Some(0.0)).and_then(|head| {
            let body = if team.benches > 1 { Some(trace(1, None)?) } else { None };
            let tail = team.own_tail_link().map(|tail| trace(tail, None)).transpose()?;
            Ok((head, body, tail))
        });
        let Ok((head, body, tail)) = traces else {
            return Self::none(0.0);
        };
        let mut search = SingularitySearch { path: path.clone(), team, head, body, tail };
        search.run(budget);
        search.conclude(budget)
    }

    /// Returns the result of a search up to a place without a singular configuration before.
    pub fn none(searched_until: f64) -> Self {
        let (branches, [head_turns, body_turns, tail_turns]) = (Vec::new(), [const { Vec::new() }; 3]);
        Self { stall: None, end: None, searched_until, head_turns, body_turns, tail_turns, branches }
    }
}

struct SingularitySearch<'a> {
    /// In the end with the branches of both links.
    path: Path,
    team: &'a Team,
    /// In metres of travel of the head.
    head: LinkTrace<'a>,
    /// In metres of travel of the body link's front handle; `None` for one bench.
    body: Option<LinkTrace<'a>>,
    /// In metres of travel of the tail's front handle, if its link has a length of its own.
    tail: Option<LinkTrace<'a>>,
}

impl SingularitySearch<'_> {
    /// Traces the head's link, and the body link up to the place of handle 1, until one of them ends the motion. The
    /// tail's link follows.
    fn run(&mut self, budget: &mut Budget) {
        for step in 0u64.. {
            if step % 256 == 0 {
                budget.report(self.head.at().front / self.path.length());
            }
            let body_is_behind = self.body_lags();
            let tail_is_behind = self.tail_lags();
            let spent = match (&mut self.body, &mut self.tail) {
                (Some(body), _) if body_is_behind && body.end().is_none() => !body.advance(budget),
                (_, Some(tail)) if tail_is_behind && tail.end().is_none() => !tail.advance(budget),
                _ if body_is_behind || self.head.end().is_some() => break,
                _ => !self.head.advance(budget),
            };
            if spent {
                break;
            }
        }
    }

    /// Returns true if handle 1 is further than the body link is traced.
    fn body_lags(&self) -> bool {
        self.body.as_ref().is_some_and(|body| body.at().front < self.head.furthest_rear())
    }

    fn conclude(mut self, budget: &mut Budget) -> Singularities {
        let link = |bench: usize| self.team.link(bench);
        let of_body = self.body.as_ref().filter(|_| link(0) != link(1));
        // Links of one length have the same branches, and the head comes furthest.
        let of_tail = self.tail.as_ref().filter(|_| link(0) != link(self.team.benches - 1));
        let traces = [Some(&self.head), of_body, of_tail];
        let branches: Vec<_> = traces.into_iter().flatten().flat_map(LinkTrace::branches).collect();
        self.path = self.path.with_branches(branches.clone());
        let limit = self.head.at().front.max(0.0);
        let body_limit = self.body.as_ref().filter(|_| self.body_lags()).and_then(|body| {
            let reached = self.handle_1_reaches(body.at().front, limit)?;
            Some((body.end(), reached.next_down().max(0.0)))
        });
        let (mut end, mut searched_until) = match (body_limit, self.head.end()) {
            (Some((Some(TraceEnd::Lock), at)), _) => (Some(self.event(EventKind::Lock, at, 1)), at),
            (Some((_, at)), _) => (None, at),
            (None, Some(TraceEnd::Lock)) => (Some(self.event(EventKind::Lock, limit, 0)), limit),
            (None, Some(TraceEnd::PathEnd)) => {
                let kind = EventKind::PathEnd;
                (Some(Event { kind, travelled: limit, bench_a: None, bench_b: None, place: None }), limit)
            }
            (None, Some(TraceEnd::Undecided) | None) => (None, limit),
        };
        let tail = self.of_tail(searched_until, budget);
        if let Some(at) = tail.until.filter(|at| *at < searched_until) {
            let link = self.team.benches - 1;
            end = tail.locks.then(|| self.event(EventKind::Lock, at, link));
            searched_until = at;
        }
        let stall = self.stall(searched_until, tail.stall).filter(|stall| stall.travelled < searched_until);
        let head_turns: Vec<_> = self.head.turns().iter().copied().filter(|at| *at <= searched_until).collect();
        let places = head_turns.iter().chain([&0.0, &searched_until]).filter_map(|at| self.handle_1(*at));
        let furthest = places.fold(f64::NEG_INFINITY, f64::max);
        let body_turns = self.body.as_ref().map_or(&[][..], LinkTrace::turns);
        let body_turns = body_turns.iter().copied().filter(|at| *at <= furthest).collect();
        let tail_turns = self.tail.as_ref().map_or_else(Vec::new, |tail| tail.turns().to_vec());
        Singularities { stall, end, searched_until, head_turns, body_turns, tail_turns, branches }
    }

    /// Returns the metres of travel of handle 1.
    fn handle_1(&self, head: f64) -> Option<f64> {
        self.head.configuration(head).ok().map(|configuration| configuration.rear)
    }

    /// Returns the head's first travel up to `limit` at which handle 1 reaches `place`.
    fn handle_1_reaches(&self, place: f64, limit: f64) -> Option<f64> {
        let reached = |head: f64| self.handle_1(head).is_none_or(|at| at >= place);
        if reached(0.0) {
            return Some(0.0);
        }
        let turns = self.head.turns().iter().copied().filter(|at| *at < limit);
        let mut from = 0.0;
        for to in turns.chain([limit]) {
            if reached(to) {
                return Some(bisect_predicate(reached, from, to));
            }
            from = to;
        }
        None
    }

    /// Returns the first stall up to `limit` metres of travel of the head. `tail` is the first of the tail's link.
    fn stall(&self, limit: f64, tail: Option<f64>) -> Option<Event> {
        let start = self.head.configuration(0.0).ok()?;
        if start.is_stalled() {
            return Some(self.event(EventKind::Stall, 0.0, 0));
        }
        let head = self.head.turns().first().copied().filter(|at| *at <= limit);
        let body = self.body_stall(&start, head.unwrap_or(limit));
        let tail = tail.filter(|at| *at <= limit).map(|at| (at, self.team.benches - 1));
        let body = [body, tail].into_iter().flatten().min_by(|one, other| one.0.total_cmp(&other.0));
        match (head, body) {
            (Some(at), Some((body, _))) if at <= body => Some(self.event(EventKind::Stall, at, 0)),
            (_, Some((at, link))) => Some(self.event(EventKind::Stall, at, link)),
            (head, None) => head.map(|at| self.event(EventKind::Stall, at, 0)),
        }
    }

    /// Returns the first stall of a body link up to `limit`, while handle 1 moves forward only: the head's travel and
    /// the link.
    fn body_stall(&self, head: &Configuration, limit: f64) -> Option<(f64, usize)> {
        let body = self.body.as_ref()?;
        let innermost = *body.turns().first()?;
        let mut first: Option<(f64, usize)> = None;
        let mut front = head.rear;
        for link in 1..self.team.benches - usize::from(self.tail.is_some()) {
            let configuration = body.configuration(front).ok()?;
            if configuration.is_stalled() {
                return Some((0.0, link));
            }
            let turn = body.turns().iter().copied().find(|at| *at > front);
            if let Some(at) = turn.and_then(|turn| self.handle_reaches(link, turn, limit))
                && first.is_none_or(|(earlier, _)| at < earlier)
            {
                first = Some((at, link));
            }
            if front <= innermost {
                break;
            }
            front = configuration.rear;
        }
        first
    }

    /// Returns the head's first travel up to `limit` at which a handle reaches `place`, if no handle turned before.
    fn handle_reaches(&self, handle: usize, place: f64, limit: f64) -> Option<f64> {
        let reached = |head: f64| self.handle(handle, head).is_none_or(|at| at >= place);
        reached(limit).then(|| bisect_predicate(reached, 0.0, limit))
    }

    fn event(&self, kind: EventKind, travelled: f64, link: usize) -> Event {
        let place = self.rear_point(travelled, link);
        Event { kind, travelled, bench_a: Some(link as u32), bench_b: None, place }
    }

    /// Returns the rear handle of a link; if rounding leaves none in the last digits, the handle at the last place
    /// before.
    fn rear_point(&self, travelled: f64, link: usize) -> Option<Point> {
        let digit = f64::EPSILON * (travelled + self.team.link(link));
        let earlier = (0..40).map(|power| travelled - digit * 2f64.powi(power));
        let mut places = [travelled].into_iter().chain(earlier).take_while(|at| *at >= 0.0);
        places.find_map(|at| self.rear(at, link)).map(|rear| self.path.point(rear))
    }

    /// Returns the rear handle of a link as in a frame.
    fn rear(&self, travelled: f64, link: usize) -> Option<Param> {
        let head = self.path.param_at(travelled);
        let follower = |front, link| crate::linkage::follower(&self.path, front, self.team.link(link));
        (0..=link).try_fold(head, follower).ok()
    }
}

#[cfg(test)]
mod tests;
