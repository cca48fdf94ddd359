//! Stall and lock on a path of pieces: how far each of the two kinds of links can go, by steps that are certain to hold
//! neither.
//!
//! **Why none is skipped.** Let a link of length L stand with cosines f at its front handle and c at its rear one, on a
//! path whose curvature nearby is at most k. While the rear cosine stays above c/2 the rear handle goes at most 2/c as
//! far as the front one, so over h metres of the front handle the bench turns by at most (1 + 2/c) h / L and the
//! tangents by k h and 2 k h / c. The rear cosine therefore does stay above c/2 for h = (c/2) / (2k/c + (1 + 2/c)/L), and
//! the front cosine keeps its sign for h = |f| / (k + (1 + 2/c)/L).
//!
//! The first place backward could also come to lie nearer: where the path bulges away from the front handle before it
//! reaches the follower. Let v be the follower at the distance L - d instead of L. Before v everything is nearer than
//! L - d, and stays nearer than L for h < d; and where v is within 2d/c of the follower, with d <= c^2 / 4 (k + 2/L), the
//! distance only grows between the two, now and for h < c L / 8. Such a change would make the handle jump, at a place
//! where the rear cosine is 0: it is a lock.
//!
//! Every step is a fixed share of the way to the next such place, so that the steps close in on it.

use crate::chain::Team;
use crate::geometry::path::Path;
use crate::geometry::pieces::{PiecePath, PiecePlace};
use crate::geometry::root::first_true;
use crate::messages::State;

use super::Event;

/// The first stall, and the lock or path end after which nothing follows. In order along the path.
pub fn stall_and_end(path: &PiecePath, team: &Team) -> Vec<Event> {
    let motion = Motion::new(path, team);
    let end = motion.end();
    let stall = motion.stall().filter(|stall| stall.travelled < end.travelled);
    stall.into_iter().chain([end]).collect()
}

/// A link of one length anywhere on the path.
struct Link<'a> {
    path: &'a PiecePath,
    length: f64,
}

/// The link with its front handle at one place.
#[derive(Clone, Copy)]
struct Look {
    front_at: f64,
    front: PiecePlace,
    rear_at: f64,
    rear: PiecePlace,
    front_cosine: f64,
    rear_cosine: f64,
}

/// What happens to a link as its front handle goes on, in metres of travel of that handle.
struct Course {
    /// Where the front cosine is zero or below for the first time.
    stall: Option<f64>,
    /// Where the rear handle turns round.
    turns: Vec<f64>,
    /// The last place at which there is a follower.
    lock: Option<f64>,
}

impl Link<'_> {
    fn look(&self, front_at: f64) -> Option<Look> {
        let front = self.path.place_at(front_at);
        let rear = self.path.follower(front, self.length).ok()?;
        let bench = self.path.bench(front, rear, self.length);
        Some(Look {
            front_at,
            front,
            rear_at: front_at - self.path.distance_between(rear, front),
            rear,
            front_cosine: bench.front_cosine,
            rear_cosine: bench.rear_cosine,
        })
    }

    /// Metres by which the front handle can go on without a lock, and without a stall.
    fn certain(&self, look: &Look) -> (f64, f64) {
        if look.front.piece() == look.rear.piece()
            && let Some(end) = self.path.end_of_even_piece(look.front)
            && end > look.front_at
        {
            // On one line or circle nothing changes.
            return (end - look.front_at, f64::INFINITY);
        }
        let (link, c) = (self.length, look.rear_cosine);
        let curvature = self.path.sharpest_between(look.rear_at - link, look.front_at + link);
        let turning = (1.0 + 2.0 / c) / link;
        let kept = (0.5 * c / (2.0 * curvature / c + turning)).min(0.125 * c * link);
        let stall = look.front_cosine.abs() / (curvature + turning);
        (kept.min(self.margin(look, curvature)), stall)
    }

    /// Metres by which the front handle can go on before a nearer place can be as far away as the link is long.
    fn margin(&self, look: &Look, curvature: f64) -> f64 {
        let (link, c) = (self.length, look.rear_cosine);
        let mut margin = (0.25 * c * c / (curvature + 2.0 / link)).min(0.5 * link);
        while margin > f64::EPSILON * link {
            let within = |nearer| self.path.distance_between(look.rear, nearer) <= 2.0 * margin / c;
            if self.path.follower(look.front, link - margin).is_ok_and(within) {
                return 0.9 * margin;
            }
            margin *= 0.5;
        }
        0.0
    }

    /// The course of the link while its front handle goes from one place to another.
    fn course(&self, from: f64, to: f64) -> Course {
        let mut course = Course { stall: None, turns: Vec::new(), lock: None };
        let from = self.path.calm_until(self.length).min(to).max(from);
        let Some(mut look) = self.look(from) else {
            course.lock = Some(from);
            return course;
        };
        if look.front_cosine <= 0.0 {
            course.stall = Some(from);
        }
        while look.front_at < to && !self.path.is_calm_from(look.rear, self.length) {
            let resolution = 4.0 * f64::EPSILON * (look.front_at.abs() + self.length);
            let (lock, stall) = self.certain(&look);
            let step = lock.min(stall);
            if step > resolution
                && let Some(next) = self.look((look.front_at + step).min(to))
            {
                look = next;
                continue;
            }
            look = match self.beyond(&look, to, resolution) {
                Beyond::Nothing(next) => next,
                Beyond::Turn(at, next) => {
                    course.stall = course.stall.or(Some(at));
                    course.turns.push(at);
                    next
                }
                Beyond::Lock(at) => {
                    course.lock = Some(at);
                    return course;
                }
            };
        }
        course
    }

    /// What is just ahead of a look from which no step is certain.
    fn beyond(&self, look: &Look, to: f64, resolution: f64) -> Beyond {
        let locked = |at: f64| {
            let jumps = |next: Look| (next.rear_at - look.rear_at).abs() > 1e-3 * self.length;
            self.look(at).is_none_or(jumps)
        };
        let turned = |at: f64| self.look(at).is_some_and(|next| (next.front_cosine > 0.0) != (look.front_cosine > 0.0));
        let mut reach = resolution;
        loop {
            let at = (look.front_at + reach).min(to);
            if locked(at) {
                return Beyond::Lock(first_true(locked, look.front_at, at).next_down().max(look.front_at));
            }
            // Not locked, so there is a look.
            let Some(next) = self.look(at) else { return Beyond::Lock(look.front_at) };
            if turned(at) {
                return Beyond::Turn(first_true(turned, look.front_at, at), next);
            }
            if reach > 1e-7 * self.length || at >= to {
                return Beyond::Nothing(next);
            }
            reach *= 2.0;
        }
    }
}

/// What a search finds just ahead.
enum Beyond {
    /// A graze: neither cosine has changed its sign.
    Nothing(Look),
    /// The rear handle turns round.
    Turn(f64, Look),
    /// There is no follower any more, or another one.
    Lock(f64),
}

/// The motion of the first two links: no other can stall or lock first, since every handle behind the second rides
/// where the second has been, or further out on the spiral or line on which the team starts.
struct Motion<'a> {
    path: &'a PiecePath,
    team: &'a Team,
    head: Course,
    /// In metres of travel of the second handle; `None` for one bench.
    body: Option<Course>,
}

impl<'a> Motion<'a> {
    fn new(path: &'a PiecePath, team: &'a Team) -> Self {
        let link = |bench: usize| Link { path, length: team.link(bench) };
        let head = link(0).course(0.0, path.length());
        let mut motion = Self { path, team, head, body: None };
        let limit = motion.head_limit();
        if team.benches >= 2
            && let Some(start) = motion.second(0.0)
        {
            let turns = motion.head.turns.iter().copied().chain([limit]);
            let furthest = turns.filter_map(|at| motion.second(at)).fold(start, f64::max);
            motion.body = Some(link(1).course(start, furthest));
        }
        motion
    }

    fn head_limit(&self) -> f64 {
        self.head.lock.unwrap_or(self.path.length())
    }

    /// Metres of travel of the second handle; `None` past the lock of the first link.
    fn second(&self, travelled: f64) -> Option<f64> {
        let head = self.path.place_at(travelled);
        let rear = self.path.follower(head, self.team.link(0)).ok()?;
        Some(travelled - self.path.distance_between(rear, head))
    }

    /// The first distance up to `limit` at which the second handle has come to `place`: between two of its turning
    /// points it goes one way.
    fn second_reaches(&self, place: f64, limit: f64) -> Option<f64> {
        let reached = |travelled: f64| self.second(travelled).is_none_or(|at| at >= place);
        if reached(0.0) {
            return Some(0.0);
        }
        let mut from = 0.0;
        for to in self.head.turns.iter().copied().filter(|at| *at < limit).chain([limit]) {
            if reached(to) {
                return Some(first_true(reached, from, to));
            }
            from = to;
        }
        None
    }

    fn end(&self) -> Event {
        let limit = self.head_limit();
        let body_lock = self.body.as_ref().and_then(|body| body.lock);
        match (body_lock.and_then(|place| self.second_reaches(place, limit)), self.head.lock) {
            (Some(travelled), _) => self.event(State::Lock, travelled, 1),
            (None, Some(travelled)) => self.event(State::Lock, travelled, 0),
            (None, None) => Event { kind: State::PathEnd, travelled: limit, bench_a: None, bench_b: None, place: None },
        }
    }

    fn stall(&self) -> Option<Event> {
        let limit = self.head.stall.unwrap_or(self.head_limit());
        let body_stall = self.body.as_ref().and_then(|body| body.stall);
        let body = body_stall.and_then(|place| self.second_reaches(place, limit));
        body.map(|travelled| self.event(State::Stall, travelled, 1))
            .or_else(|| self.head.stall.map(|travelled| self.event(State::Stall, travelled, 0)))
    }

    fn event(&self, kind: State, travelled: f64, bench: u32) -> Event {
        let head = self.path.place_at(travelled);
        let rear = (0..=bench as usize).try_fold(head, |front, i| self.path.follower(front, self.team.link(i)));
        let place = rear.ok().map(|rear| self.path.point(rear));
        Event { kind, travelled, bench_a: Some(bench), bench_b: None, place }
    }
}
