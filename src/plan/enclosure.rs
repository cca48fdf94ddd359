//! The least pitch between two numbers, with a proof: every pitch up to the one has boards that overlap, the other has none that
//! touch.
//!
//! In: a team, a radius, the least pitch that the ordinary search has found. Out: the two numbers. The `plan` command calls
//! it. "The least pitch" in `docs/proofs.md` says why it holds; the ordinary search only tells where to look.

use std::f64::consts::TAU;

use super::{LeastPitch, Obstacle, TURNS_BEFORE, Trial};
use crate::certify::pitch::{Pitches, reaches};
use crate::model::team::Team;
use crate::scene::Accepted;

/// What is proved of a least pitch. The head is meant to come in from three turns outside the radius (or from three turns
/// outside the longest link, where that is more).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PitchEnclosure {
    /// Metres per turn: with every pitch from `from` up to this two boards overlap, or a link locks, before the radius is
    /// reached; `None` where that cannot be shown of any.
    pub lo: Option<f64>,
    /// Metres per turn: with this pitch no two boards touch and no link locks before; `None` where that cannot be shown.
    pub hi: Option<f64>,
    /// Metres per turn: the least pitch that is looked at, half of the boards' width.
    pub from: f64,
    /// Intervals of pitches into which those from `from` to `lo` are divided.
    pub intervals: u64,
}

impl PitchEnclosure {
    /// Whether every pitch but those within a nanometre is decided.
    pub fn is_complete(&self) -> bool {
        self.lo.zip(self.hi).is_some_and(|(lo, hi)| hi - lo <= 1e-9)
    }
}

/// Metres on both sides of the least pitch at which the proofs are tried.
const BESIDE: f64 = 4.5e-10;

/// Intervals of pitches after which the proof is given up.
const MOST_INTERVALS: u64 = 20_000;

/// Steps of the head after which the proof of a pitch that will do is given up.
const MOST_STEPS: u64 = 100_000;

/// The least share of a pitch that an interval is, the share at first, and what an interval that is shown does to the next.
const LEAST_SHARE: f64 = 1e-14;
const FIRST_SHARE: f64 = 1e-4;
const GROWTH: f64 = 1.1;

/// How much shallower than when they were chosen two boards may overlap until others are looked for.
const SHALLOW: f64 = 0.5;

/// Two boards that overlap at a pitch, how deeply, and metres from the centre to the head's front handle then.
struct Deepest {
    obstacle: Obstacle,
    benches: [usize; 2],
    depth: f64,
    head_radius: f64,
}

/// Encloses the least pitch that [`super::least_pitch`] has found. `progress` gets the share that is done.
pub fn enclose_least_pitch(
    team: &Team,
    radius: f64,
    found: &LeastPitch,
    progress: &mut dyn FnMut(f64),
) -> PitchEnclosure {
    let from = Accepted::LENGTH.least.max(0.5 * team.width);
    let (lo, intervals) = blocked_up_to(team, radius, (from, found.value - BESIDE), progress);
    let hi = found.value + BESIDE;
    let start_turn = radius.max(team.longest_link()) / hi + TURNS_BEFORE;
    let hi = reaches(team, hi, start_turn, radius, MOST_STEPS).then_some(hi);
    PitchEnclosure { lo: (intervals > 0).then_some(lo), hi, from, intervals }
}

/// The pitch up to which boards are proved to overlap with every one, and in how many intervals.
fn blocked_up_to(team: &Team, radius: f64, (from, to): (f64, f64), progress: &mut dyn FnMut(f64)) -> (f64, u64) {
    let (mut pitch, mut width, mut intervals) = (from, FIRST_SHARE * from, 0);
    let Some(mut deepest) = chosen(&Trial::new(team, from, radius)) else { return (from, 0) };
    let outer = radius.max(team.longest_link());
    while pitch < to && intervals < MOST_INTERVALS {
        let holds = |to: f64, deepest: &Deepest| {
            let theta = deepest.head_radius * TAU / pitch;
            let pitches = Pitches { team, from: pitch, to, theta, benches: deepest.benches };
            pitches.are_between(radius, outer, TURNS_BEFORE) && pitches.all_overlap()
        };
        width = width.min(to - pitch);
        if !holds(pitch + width, &deepest) {
            let Some(followed) = followed(deepest, &Trial::new(team, pitch, radius)) else { break };
            deepest = followed;
            while width > LEAST_SHARE * pitch && !holds(pitch + width, &deepest) {
                width *= 0.5;
            }
            if width <= LEAST_SHARE * pitch {
                break;
            }
        }
        pitch = (pitch + width).min(to);
        width *= GROWTH;
        intervals += 1;
        progress(((pitch - from) / (to - from)).clamp(0.0, 1.0));
    }
    (pitch, intervals)
}

/// The same two boards where they overlap most deeply at another pitch, or others where they have come too nearly free.
fn followed(deepest: Deepest, trial: &Trial) -> Option<Deepest> {
    let (clearance, travelled) = trial.nearest(&deepest.obstacle);
    if clearance < -SHALLOW * deepest.depth {
        return Some(Deepest { head_radius: head_radius(trial, travelled), ..deepest });
    }
    chosen(trial)
}

/// The two boards that overlap most deeply before the radius is reached.
fn chosen(trial: &Trial) -> Option<Deepest> {
    let obstacle = trial.obstacle().ok()??;
    let Obstacle::Touch { pair: (a, b), .. } = obstacle else { return None };
    let (clearance, travelled) = trial.nearest(&obstacle);
    let (depth, benches) = (-clearance, [a as usize, b as usize]);
    (depth > 0.0).then(|| Deepest { obstacle, benches, depth, head_radius: head_radius(trial, travelled) })
}

fn head_radius(trial: &Trial, travelled: f64) -> f64 {
    trial.path.point(trial.path.param_at(travelled)).coords.norm()
}
