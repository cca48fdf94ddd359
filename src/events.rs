//! When, exactly, something ends the show: contact, stall, lock and path end, each as a root of a continuous function
//! of the head's place on the path, never by sampling the motion.
//!
//! In: a path and a team. Out: at most one event of each kind, as a distance the head has travelled. The show and the
//! `events` command call it once, before anything moves. [`contact`] holds the search for the first touch
//! on a spiral, [`course`] stall and lock on a path of pieces, [`sweep`] contact and least clearance on any path.

pub mod contact;
pub mod course;
pub mod sweep;

use crate::chain::Team;
use crate::geometry::Point;
use crate::geometry::path::Path;
use crate::geometry::root::first_true;
use crate::geometry::spiral::{Angle, Spiral};
use crate::messages::State;

/// Something that happens at one place of the head on the path, and so at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// What happens: `Contact`, `Stall`, `Lock` or `PathEnd`.
    pub kind: State,
    /// Metres that the head has travelled along the path since the scene's start.
    pub travelled: f64,
    /// The first bench concerned: of the two that touch the one nearer the head, or the one that stalls or locks.
    pub bench_a: Option<u32>,
    /// The second of two benches that touch.
    pub bench_b: Option<u32>,
    /// Where: the touching point; the rear handle of a stall or lock. `None` for the path's end.
    pub place: Option<Point>,
}

/// The first stall on a spiral, and the lock or path end after which nothing follows. In order along the path.
///
/// A contact costs a search and is asked for separately: [`contact::first_contact`].
pub fn stall_and_end(spiral: &Spiral, team: &Team) -> Vec<Event> {
    let motion = Motion { spiral, team };
    let end = motion.end();
    let stall = motion.stall().filter(|stall| stall.travelled < end.travelled);
    stall.into_iter().chain([end]).collect()
}

/// The motion of the first two links: no other can stall or lock first, since every handle behind the second rides
/// where the second has been, on links of the second's length.
struct Motion<'a> {
    spiral: &'a Spiral,
    team: &'a Team,
}

impl Motion<'_> {
    /// Metres travelled when the head is at polar angle `theta`.
    fn travelled_at(&self, theta: f64) -> f64 {
        self.spiral.distance_between(self.spiral.start(), self.spiral.place_of_theta(theta)).max(0.0)
    }

    /// Polar angle of the second handle; infinite past the lock of the first link.
    fn second(&self, travelled: f64) -> f64 {
        let head = self.spiral.place_at(travelled);
        self.spiral.follower(head, self.team.link(0)).map_or(f64::INFINITY, Angle::radians)
    }

    fn event(&self, kind: State, travelled: f64, bench: u32) -> Event {
        let head = self.spiral.place_at(travelled);
        let rear = (0..=bench as usize).try_fold(head, |front, i| self.spiral.follower(front, self.team.link(i)));
        let place = rear.ok().map(|rear| self.spiral.point(rear));
        Event { kind, travelled, bench_a: Some(bench), bench_b: None, place }
    }

    /// The lock, or the path's end where no link locks.
    fn end(&self) -> Event {
        let length = self.spiral.length();
        let head_lock = self.spiral.fold(self.team.link(0)).map(|theta| self.last_before_fold(theta));
        let limit = head_lock.unwrap_or(length);
        let body_lock = self.body_fold().and_then(|fold| self.second_reaches(fold, limit));
        match (body_lock, head_lock) {
            (Some(travelled), _) => self.event(State::Lock, travelled, 1),
            (None, Some(travelled)) => self.event(State::Lock, travelled, 0),
            (None, None) => {
                Event { kind: State::PathEnd, travelled: length, bench_a: None, bench_b: None, place: None }
            }
        }
    }

    /// The last distance at which the first link still has a follower: the fold itself, as far as doubles tell.
    fn last_before_fold(&self, theta: f64) -> f64 {
        let nominal = self.travelled_at(theta);
        let locked = |travelled: f64| self.second(travelled).is_infinite();
        // What the rounding of distance and angle can make of the fold's place.
        let margin = 64.0 * f64::EPSILON * (nominal + self.spiral.radius(self.spiral.start()));
        let (low, high) = ((nominal - margin).max(0.0), (nominal + margin).min(self.spiral.length()));
        match (locked(low), locked(high)) {
            (true, _) => low,
            (false, true) => first_true(locked, low, high).next_down().max(0.0),
            (false, false) => nominal,
        }
    }

    fn body_fold(&self) -> Option<f64> {
        if self.team.benches < 2 { None } else { self.spiral.fold(self.team.link(1)) }
    }

    /// The first distance up to `limit` at which the second handle has come in to `theta`.
    ///
    /// Between two turning points of the second handle, which are the stalls of the first link, its angle is monotone:
    /// so each such stretch is asked at its end, and bisected.
    fn second_reaches(&self, theta: f64, limit: f64) -> Option<f64> {
        let reached = |travelled: f64| self.second(travelled) <= theta;
        let mut from = 0.0;
        for to in self.second_turns(limit).into_iter().chain([limit]) {
            if reached(to) {
                return Some(first_true(reached, from, to));
            }
            from = to;
        }
        None
    }

    /// Where the first link's front cosine changes sign, up to `limit`: there the second handle turns round.
    ///
    /// The cosine depends on the head's angle alone and is positive wherever tan(d/2) < theta, so everywhere beyond
    /// theta = max(1, link/a): only the last turns are searched, in steps of a thousandth of them. It changes sign at
    /// most twice there: once where the link comes to stand square to the path, and, if the link is too short to lock,
    /// once more as the curve straightens out towards the centre.
    fn second_turns(&self, limit: f64) -> Vec<f64> {
        let link = self.team.link(0);
        let least = self.spiral.place_at(limit).radians();
        let most = self.spiral.start().radians().min((link / self.spiral.growth()).max(1.0));
        let stalled = |theta: f64| stall_margin(self.spiral, theta, link) <= 0.0;
        let steps = 1000;
        let at = |step: i32| most + (least - most) * f64::from(step) / f64::from(steps);
        (0..steps)
            .filter(|&step| stalled(at(step)) != stalled(at(step + 1)))
            .map(|step| {
                let before = stalled(at(step));
                // Bisected in the inward direction, in which theta decreases.
                self.travelled_at(-first_true(|negative| stalled(-negative) != before, -at(step), -at(step + 1)))
            })
            .collect()
    }

    /// The first stall: of the first link, or of the second while the first has not stalled.
    fn stall(&self) -> Option<Event> {
        let end = self.end().travelled;
        let head_stall = self.outermost_stall(0).map(|theta| self.travelled_at(theta));
        let limit = head_stall.unwrap_or(end).min(end);
        let body_stall = (self.team.benches >= 2).then(|| self.outermost_stall(1)).flatten().and_then(|theta| {
            // Up to the first link's stall the second handle only comes in.
            let reached = |travelled: f64| self.second(travelled) <= theta;
            if reached(0.0) { Some(0.0) } else { reached(limit).then(|| first_true(reached, 0.0, limit)) }
        });
        let body = body_stall.map(|travelled| self.event(State::Stall, travelled, 1));
        body.or_else(|| head_stall.map(|travelled| self.event(State::Stall, travelled, 0)))
    }

    /// The outermost polar angle of a front handle at which this bench stands square to the path there.
    ///
    /// Searched inward from where no stall can be, in steps short enough to hold none: from theta to theta' the
    /// tangent turns by at most 2 (theta - theta'), the bench by at most (D + D')/link, where D and D' are the
    /// distances its two handles travel (before the first stall both only come in, so the ends of a step tell them),
    /// and the cosine, being that of the angle between the two, changes by no more than both together.
    fn outermost_stall(&self, bench: usize) -> Option<f64> {
        let link = self.team.link(bench);
        let ratio = link / self.spiral.growth();
        let inner = self.spiral.fold(link).map_or(0.0, |fold| fold * (1.0 + 1e-12));
        let look = |theta: f64| -> Option<Look> {
            let front = self.spiral.place_of_theta(theta);
            let rear = self.spiral.follower(front, link).ok()?;
            Some(Look { theta, front, rear, cosine: self.spiral.bench(front, rear, link).front_cosine })
        };
        let certain = |outer: &Look, inner: &Look| {
            let travelled = self.spiral.distance_between(outer.front, inner.front).abs()
                + self.spiral.distance_between(outer.rear, inner.rear).abs();
            let turned = 2.0 * (outer.theta - inner.theta) + travelled / link;
            outer.cosine > 0.0 && inner.cosine > 0.0 && outer.cosine + inner.cosine > turned
        };
        let mut outer = look(ratio.max(1.0).max(inner))?;
        let mut step = 0.05 * outer.theta;
        while outer.theta > inner {
            let Some(next) = look((outer.theta - step).max(inner)) else {
                step *= 0.5;
                if step < 1e-15 * outer.theta {
                    return None;
                }
                continue;
            };
            if certain(&outer, &next) {
                outer = next;
                step *= 1.5;
            } else if step > 1e-14 * outer.theta {
                step *= 0.5;
            } else if next.cosine <= 0.0 {
                return Some(next.theta);
            } else {
                outer = next;
            }
        }
        None
    }
}

/// One front handle looked at in the search for a stall.
struct Look {
    theta: f64,
    front: Angle,
    rear: Angle,
    cosine: f64,
}

/// The last place of the head, from `from` to `to`, at which the team stands: `to` itself or, where that is a lock and its
/// own last digits are past it, the last one before. Without this the search's whole last step would be lost.
fn last_place(stands: impl Fn(f64) -> bool, from: f64, to: f64) -> f64 {
    if stands(to) || !stands(from) { to } else { first_true(|travelled| !stands(travelled), from, to).next_down() }
}

/// t . b at a front handle at `theta`; past the fold, where there is no follower, -1: the bench has been stalled.
fn stall_margin(spiral: &Spiral, theta: f64, link: f64) -> f64 {
    let front = spiral.place_of_theta(theta);
    spiral.follower(front, link).map_or(-1.0, |rear| spiral.bench(front, rear, link).front_cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn team(head_length: f64, body_length: f64) -> Team {
        Team { benches: 223, head_length, body_length, width: 0.30, hole_inset: 0.275 }
    }

    #[test]
    fn the_paper_scene_stalls_and_locks_when_50_digits_say() {
        let events = stall_and_end(&Spiral::new(0.55, 16.0), &team(3.41, 2.20));
        let kinds: Vec<_> = events.iter().map(|event| (event.kind, event.bench_a)).collect();
        assert_eq!(kinds, [(State::Stall, Some(0)), (State::Lock, Some(0))]);
        assert!((events[0].travelled - 432.758134083656).abs() < 1e-10, "{}", events[0].travelled);
        assert!((events[1].travelled - 432.917924228383).abs() < 1e-10, "{}", events[1].travelled);
        let place = events[1].place.unwrap();
        assert!(place.x.is_finite() && place.y.is_finite());
    }

    #[test]
    fn the_paper_scene_would_end_at_the_centre() {
        let spiral = Spiral::new(0.55, 16.0);
        assert!((spiral.length() - 442.590256432).abs() < 5e-10, "{}", spiral.length());
    }

    #[test]
    fn short_links_neither_stall_nor_lock() {
        // Link to pitch 0.2: below a quarter neither happens.
        let events = stall_and_end(&Spiral::new(1.0, 8.0), &team(0.75, 0.75));
        assert_eq!(events.iter().map(|event| event.kind).collect::<Vec<_>>(), [State::PathEnd]);
    }

    #[test]
    fn middling_links_stall_without_a_lock() {
        // Link to pitch 0.5.
        let events = stall_and_end(&Spiral::new(1.0, 8.0), &team(1.05, 1.05));
        assert_eq!(events.iter().map(|event| event.kind).collect::<Vec<_>>(), [State::Stall, State::PathEnd]);
    }
}
