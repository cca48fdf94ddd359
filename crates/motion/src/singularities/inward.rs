//! A link on the inward spiral: its lock in closed form, its turns by bisection, for any number of turns of the spiral.
//!
//! In: a link whose path begins with an inward spiral. Out: the lock and the turns on that segment.
//!
//! **Lock.** For fixed d the chord grows with theta, and up to its first maximum it grows with d. So no nearer point
//! ever reaches the link's distance, and the follower vanishes only at the fold (`Spiral::fold`).
//!
//! **Turns.** Let theta be the front handle's angle, d the angle from there to the follower, and t = tan(d/2). The
//! front cosine has the sign of N = d + (theta + d) sin d (theta - t). This is the sign of sin d times g = theta^2 - (t
//! - d) theta + d cot d.
//! - d <= pi/2: cot d >= 0 and t < d, so g > 0: the link is not stalled.
//! - pi/2 < d < pi: d cot d < 0, so g has one positive zero theta(d). There g_theta > 0 and
//!   g_d = (1 - t^2)/2 theta + cot d - d / sin^2 d < 0, so theta(d) grows. Inward d grows as theta falls, so the link
//!   comes to the curve once: the stall.
//! - pi <= d <= 3 pi/2: g > 0 and sin d < 0, the link is stalled.
//! - 3 pi/2 < d < 2 pi: again g has one positive zero, at most sqrt(d |cot d|). So (1 - t^2)/2 theta < d / sin^2 d, and
//!   the zero too grows with d. The link comes to that curve at most once, where the stall ends.
//!
//! Before a fold d < 2 pi. Without a fold the link is shorter than the pitch, so d, which is link / a at the centre, is
//! less than 2 pi, too. From theta = max(1, link / a) outward sin(d/2) <= link / (2 r) <= 1/2, so there are neither
//! stalls nor locks.

use std::f64::consts::PI;

use crate::model::curve_bounds::CurveBounds;
use crate::model::path::Param;
use crate::model::root::bisect_predicate;

use super::certificate::{Configuration, Link};

/// The singular configurations of a link while its front handle is on the inward spiral.
#[derive(Debug, Default)]
pub(super) struct InwardSingularities {
    /// The places of the front handle, in metres of travel, at which the rear one turns round.
    pub turns: Vec<f64>,
    /// The last place of the front handle with a follower.
    pub lock: Option<f64>,
}

/// Returns the metres of travel of the front handle up to which no link of this length has a singular configuration.
pub(super) fn stall_free_until(link: &Link) -> f64 {
    let end = link.path.end_of(0);
    let free = link.path.segment_at(0).stall_free_until(link.length);
    free.map_or(end, |at| link.path.travelled(Param { segment: 0, at }).min(end))
}

/// Returns the lock and the turns on the first segment of a link's path.
pub(super) fn singularities(link: &Link) -> InwardSingularities {
    let (from, end) = (stall_free_until(link), link.path.end_of(0));
    if from >= end {
        return InwardSingularities::default();
    }
    let inward = Inward { link, end, fold: link.path.segment_at(0).fold(link.length) };
    let lock = inward.last_solvable(from);
    let to = lock.unwrap_or(end);
    // Past the curve of the stall; past the curve on which the stall ends.
    let stalled = |travelled: f64| inward.configuration(travelled).is_none_or(|(at, d)| at.is_stalled() || d >= PI);
    let recovered = |travelled: f64| inward.configuration(travelled).is_some_and(|(at, d)| !at.is_stalled() && d >= PI);
    let mut turns = Vec::new();
    if stalled(to) {
        turns.push(bisect_predicate(stalled, from, to));
        if recovered(to) {
            turns.push(bisect_predicate(recovered, turns[0], to));
        }
    }
    InwardSingularities { turns, lock }
}

struct Inward<'a> {
    link: &'a Link<'a>,
    /// The travel at which the segment ends, in metres.
    end: f64,
    /// The polar angle of the front handle at which the follower vanishes.
    fold: Option<f64>,
}

impl Inward<'_> {
    fn param(&self, travelled: f64) -> Param {
        if travelled < self.end {
            self.link.path.param_at(travelled)
        } else {
            Param { segment: 0, at: self.link.path.last(0) }
        }
    }

    /// Returns the configuration and the angle between its handles; `None` at and inside the fold.
    fn configuration(&self, travelled: f64) -> Option<(Configuration, f64)> {
        let front = self.param(travelled);
        if self.fold.is_some_and(|fold| front.at.high <= fold) {
            return None;
        }
        let configuration = self.link.configuration_at(travelled, front, None).ok()?;
        Some((configuration, configuration.rear_param.at.minus(front.at)))
    }

    /// Returns the last place with a follower: the fold, as far as doubles resolve it.
    fn last_solvable(&self, from: f64) -> Option<f64> {
        let locked = |travelled: f64| self.configuration(travelled).is_none();
        locked(self.end).then(|| bisect_predicate(locked, from, self.end).next_down().max(from))
    }
}
