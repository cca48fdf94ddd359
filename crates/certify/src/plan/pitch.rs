//! The least pitch between two numbers, proved: with every pitch up to the one boards overlap, with the other none
//! touch.
//!
//! In: a team, a radius. Out: the two numbers. "The least pitch" in `docs/proofs.md` says why it holds; the ordinary
//! search ([`super::trial`]) only tells where to look.

use std::f64::consts::TAU;

use super::PlanError;
use super::trial::{Obstacle, deepest, free_from, obstacle};
use crate::pitch::{Pitches, head_locks, reaches};
use bench_dragon_motion::model::team::Team;
use bench_dragon_show::scene::Accepted;

/// The least pitch of an inward spiral with which the front handle of a team's head comes to a radius: from however far
/// outside it comes in, before it is there no two boards touch that share no handle, and no link locks. Of pitches
/// above `value_hi` nothing is said: with some of them boards may overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastPitch {
    /// Metres per turn: with every pitch from `from` up to this, two boards overlap or a link locks before the radius
    /// is reached. `from` itself where that is shown of none.
    pub value_lo: f64,
    /// Metres per turn: with this pitch the radius is reached. `None` where that is shown of none.
    pub value_hi: Option<f64>,
    /// Metres per turn: the least pitch that is looked at, half of the boards' width or, where that is more, a
    /// millimetre.
    pub from: f64,
    /// Two boards that overlap with pitches up to `value_lo`; `None` where a link locks, or nothing is shown.
    pub overlap: Option<Overlap>,
    /// True if `value_lo` and `value_hi` are within a nanometre; otherwise the search was given up.
    pub proved: bool,
    /// Intervals of pitches into which those from `from` to `value_lo` are divided.
    pub intervals: u64,
}

/// Two boards that overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// The one nearer the head, counted from 0.
    pub bench_a: u32,
    /// The other.
    pub bench_b: u32,
    /// Metres from the centre to the head's front handle when they do.
    pub head_radius: f64,
}

/// Metres between the two numbers, with room for rounding, and on both sides of a pitch that the search has found.
const WIDTH: f64 = 0.95e-9;
const BESIDE: f64 = 0.45e-9;

/// Intervals of pitches after which the proof is given up.
const MOST_INTERVALS: u64 = 200_000;

/// Steps of the head after which the proof of a pitch that will do is given up.
const MOST_STEPS: u64 = 100_000;

/// Pitches that the search may propose.
const MOST_PROPOSALS: u32 = 8;

/// The least share of a pitch that an interval is, the share at first, and what an interval that is shown does to the
/// next.
const LEAST_SHARE: f64 = 1e-14;
const FIRST_SHARE: f64 = 1e-4;
const GROWTH: f64 = 1.1;

/// How much shallower than when they were chosen two boards may overlap until others are looked for.
const SHALLOW: f64 = 0.5;

/// The least pitch with which the head of a team comes in to `radius` metres from the centre, within a nanometre.
/// `progress` is given the share of the work done, from 0 to 1.
///
/// # Errors
/// A radius that every pitch from the first on reaches, or none.
pub fn least_pitch(team: &Team, radius: f64, progress: &mut dyn FnMut(f64)) -> Result<LeastPitch, PlanError> {
    let mut propose = |from: f64, to: f64, progress: &mut dyn FnMut(f64)| free_from(team, (from, to), radius, progress);
    decided(team, radius, &mut propose, progress)
}

/// What proposes the least pitch between two with which the radius might be reached.
type Propose<'p> = &'p mut dyn FnMut(f64, f64, &mut dyn FnMut(f64)) -> Option<f64>;

/// The least pitch, with anything that proposes pitches: nothing rests on them but how soon it is found.
fn decided(
    team: &Team,
    radius: f64,
    propose: Propose<'_>,
    progress: &mut dyn FnMut(f64),
) -> Result<LeastPitch, PlanError> {
    let Accepted { least, greatest, .. } = Accepted::LENGTH;
    let from = least.max(0.5 * team.width);
    if team.benches >= 3 && 2.0 * team.hole_inset >= team.link(1) {
        return Err(PlanError(format!(
            "the team reaches {radius} m with no pitch: a bench is as long as two insets or shorter ({} m between its \
             holes), so that the boards before and after it overlap even on a straight line",
            team.link(1)
        )));
    }
    let mut blocked = Blocked { team, radius, pitch: from, locks: false, deepest: None, shown: None, intervals: 0 };
    let reaches = |pitch: f64, progress: &mut dyn FnMut(f64)| reaches(team, pitch, radius, MOST_STEPS, progress);
    let mut value_hi = None;
    let mut next = from;
    for _ in 0..MOST_PROPOSALS {
        // The more turns fit into the radius, the further there is to go.
        let proposed = propose(next, greatest, &mut |pitch| progress(0.3 * (1.0 - (-0.3 * pitch / from).exp())));
        if proposed == Some(from) && reaches(from, progress) {
            return Err(PlanError(format!(
                "the team reaches {radius} m with a pitch of {from} m already, the least that is looked at: it is too \
                 short to meet itself before"
            )));
        }
        let target = proposed.map_or(greatest, |pitch| pitch - BESIDE);
        blocked.extend_to(target, &mut |share| progress(0.3 + 0.5 * share));
        let done = blocked.pitch >= target;
        if done && proposed.is_none() {
            return Err(PlanError(format!(
                "the team reaches {radius} m with no pitch from {from:.9} m to {greatest:.3} m: with every one two boards \
                 overlap, or a link locks, before"
            )));
        }
        // Where boards come free before the proposed pitch is reached, that may be the answer.
        let upper = proposed.filter(|_| done).map_or(blocked.pitch + WIDTH, |pitch| pitch + BESIDE);
        if reaches(upper, &mut |share| progress(0.8 + 0.2 * share)) {
            value_hi = Some(upper);
            break;
        }
        if !done {
            // A pitch that will do, further from the other than is asked for.
            value_hi = proposed.map(|pitch| pitch + BESIDE).filter(|pitch| reaches(*pitch, progress));
            break;
        }
        next = upper;
    }
    let Blocked { pitch: value_lo, intervals, shown: overlap, .. } = blocked;
    let proved = intervals > 0 && value_hi.is_some_and(|value_hi| value_hi - value_lo <= 1e-9);
    Ok(LeastPitch { value_lo, value_hi, from, overlap, proved, intervals })
}

/// Two boards that overlap at a pitch, how deeply, and metres from the centre to the head's front handle then.
#[derive(Debug, Clone, Copy)]
struct Deepest {
    pair: (u32, u32),
    depth: f64,
    head_radius: f64,
}

/// Pitches with which boards are proved to overlap.
struct Blocked<'a> {
    team: &'a Team,
    radius: f64,
    /// All from the first up to this one.
    pitch: f64,
    /// True if the head's link locks with the last of them.
    locks: bool,
    /// The boards last found.
    deepest: Option<Deepest>,
    /// Those that were shown to overlap with the last pitch, where it was not a lock.
    shown: Option<Overlap>,
    intervals: u64,
}

impl Blocked<'_> {
    /// Goes on up to a pitch, or as far as can be shown. `progress` gets the share of that.
    fn extend_to(&mut self, to: f64, progress: &mut dyn FnMut(f64)) {
        let from = self.pitch;
        let mut width = FIRST_SHARE * from;
        while self.pitch < to && self.intervals < MOST_INTERVALS {
            width = width.min(to - self.pitch);
            if !self.holds(width) {
                if !self.follow() {
                    break;
                }
                while width > LEAST_SHARE * self.pitch && !self.holds(width) {
                    width *= 0.5;
                }
                if width <= LEAST_SHARE * self.pitch {
                    break;
                }
            }
            let next = (self.pitch + width).min(to);
            self.shown = self.deepest.filter(|_| !self.locks).map(|Deepest { pair, head_radius, .. }| {
                // The polar angle is that for all pitches of the interval.
                Overlap { bench_a: pair.0, bench_b: pair.1, head_radius: head_radius * next / self.pitch }
            });
            self.pitch = next;
            width *= GROWTH;
            self.intervals += 1;
            progress(((self.pitch - from) / (to - from)).clamp(0.0, 1.0));
        }
    }

    /// Returns true if the two boards are proved to overlap, or the head's link to lock, with all pitches so much
    /// further on.
    fn holds(&self, width: f64) -> bool {
        let (from, to) = (self.pitch, self.pitch + width);
        if self.locks {
            return head_locks(self.team, (from, to), self.radius);
        }
        let Some(deepest) = self.deepest else { return false };
        let theta = deepest.head_radius * TAU / from;
        let benches = [deepest.pair.0 as usize, deepest.pair.1 as usize];
        let pitches = Pitches { team: self.team, from, to, theta, benches };
        pitches.are_outside(self.radius) && pitches.all_overlap()
    }

    /// Looks for the same two boards where they overlap most deeply at this pitch, or for others, or a lock, where they
    /// have come too nearly free. Whether there is anything.
    fn follow(&mut self) -> bool {
        if let Some(Deepest { pair, depth, head_radius }) = self.deepest
            && !self.locks
        {
            let (clearance, head_radius) = deepest(self.team, self.pitch, self.radius, pair, head_radius);
            if clearance < -SHALLOW * depth {
                self.deepest = Some(Deepest { pair, depth, head_radius });
                return true;
            }
        }
        let found = obstacle(self.team, self.pitch, self.radius);
        self.locks = matches!(found, Some(Obstacle::Lock));
        let Some(Obstacle::Touch { pair, head_radius }) = found else { return self.locks };
        let (clearance, head_radius) = deepest(self.team, self.pitch, self.radius, pair, head_radius);
        self.deepest = (clearance < 0.0).then_some(Deepest { pair, depth: -clearance, head_radius });
        self.deepest.is_some()
    }
}

#[cfg(test)]
mod tests;
