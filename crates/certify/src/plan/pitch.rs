//! The least pitch, enclosed: with every pitch up to the lower number boards overlap, with the upper number no boards
//! touch.
//!
//! In: a team, a radius. Out: the two numbers. "The least pitch" in `docs/proofs.md` has the proof. The ordinary search
//! ([`super::trial`]) only suggests where to search.

use std::f64::consts::TAU;
use std::io;

use super::PlanError;
use super::trial::{Nearest, Obstacle, Proposal, deepest, free_from, obstacle};
use crate::clearance::Write;
use crate::lines::{About, CertificateLine, CertifiedPitch, CertifiedResult};
use crate::pitch::{Pitches, Reached, head_locks, reaches};
use crate::place::Span;
use crate::spaced::Spaced;
use bench_dragon_motion::event::Progress;
use bench_dragon_show::scene::Accepted;

/// The least pitch of an inward spiral with which a team reaches a radius. The head comes in from any distance. Until
/// the head's front handle is at the radius, no two boards touch that share no handle, and no link locks. Pitches above
/// `value_hi` are not covered: with some of them boards may overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastPitch {
    /// The lower bound, metres per turn: with every pitch from `from` up to this, two boards overlap or a link locks
    /// before the radius is reached. Equal to `from` if this is shown for no pitch.
    pub value_lo: f64,
    /// The upper bound, metres per turn: with this pitch the radius is reached. `None` if this is shown for no pitch.
    pub value_hi: Option<f64>,
    /// The least pitch that is tested, metres per turn: half of the boards' width, or a millimetre if that is more.
    pub from: f64,
    /// Two boards that overlap with pitches up to `value_lo`; `None` if a link locks, or if nothing is shown.
    pub overlap: Option<Overlap>,
    /// True if `value_lo` and `value_hi` are within a nanometre. Otherwise the search was given up.
    pub proved: bool,
    /// The number of intervals into which the pitches from `from` to `value_lo` are divided.
    pub intervals: u64,
}

/// Two boards that overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// The bench nearer the head, counted from 0.
    pub bench_a: u32,
    /// The other bench.
    pub bench_b: u32,
    /// The distance of the head's front handle from the centre at that moment, in metres.
    pub head_radius: f64,
}

/// The distance of the two numbers in metres, with room for rounding. The second distance is kept on both sides of a
/// pitch that the search has found.
const WIDTH: f64 = 0.95e-9;
const BESIDE: f64 = 0.45e-9;

/// Limit of intervals of pitches.
const MOST_INTERVALS: u64 = 200_000;

/// Limit of steps of the head for the proof of one pitch.
const MOST_STEPS: u64 = 100_000;

/// Limit of pitches that the search may propose.
const MOST_PROPOSALS: u32 = 8;

/// The length of an interval as a share of its pitch, at least and at first; and its growth after an interval that is
/// shown.
const LEAST_SHARE: f64 = 1e-14;
const FIRST_SHARE: f64 = 1e-4;
const GROWTH: f64 = 1.1;

/// The share of a pair's first depth. At a smaller depth, another pair of boards is searched for that overlaps more
/// deeply. The share is squared after a search that finds the same pair.
const SHALLOW: f64 = 0.5;

/// Encloses the least pitch with which the head of a team comes in to `radius` metres from the centre, within a
/// nanometre. `progress` receives the share of the work that is done, from 0 to 1.
///
/// # Errors
/// The radius is reached with every pitch from the least one on, or with none.
pub fn least_pitch<'a>(
    asked: impl Into<Spaced<'a>>,
    radius: f64,
    progress: Progress<'_>,
) -> Result<LeastPitch, PlanError> {
    let asked = asked.into();
    let mut propose = |from: f64, to: f64, progress: Progress<'_>| free_from(asked, (from, to), radius, progress);
    Ok(decided(asked, radius, &mut propose, false, progress)?.0)
}

/// Encloses the least pitch as [`least_pitch`] does, and writes a certificate. `scene` is the text of the team's scene.
///
/// # Errors
/// As [`least_pitch`]; a line cannot be written.
pub fn certify_least_pitch<'a>(
    asked: impl Into<Spaced<'a>>,
    radius: f64,
    scene: &str,
    write: Write<'_>,
    progress: Progress<'_>,
) -> Result<io::Result<LeastPitch>, PlanError> {
    let asked = asked.into();
    let mut propose = |from: f64, to: f64, progress: Progress<'_>| free_from(asked, (from, to), radius, progress);
    let (found, proof) = decided(asked, radius, &mut propose, true, progress)?;
    Ok(written(&found, proof, radius, asked.clearance, scene, write).map(|()| found))
}

/// The lines that prove an enclosure.
#[derive(Default)]
struct Proof {
    /// A line for each interval of pitches, if requested.
    intervals: Vec<CertificateLine<'static>>,
    /// The proof for `value_hi`.
    reached: Option<Reached>,
}

fn written(
    found: &LeastPitch,
    proof: Proof,
    radius: f64,
    clearance: f64,
    scene: &str,
    write: Write<'_>,
) -> io::Result<()> {
    let (version, about) = (env!("CARGO_PKG_VERSION"), Some(About::LeastPitch));
    let LeastPitch { from, value_hi, intervals, .. } = *found;
    write(&CertificateLine::Certificate { format: crate::FORMAT, version, about, scene })?;
    write(&CertificateLine::Reach { radius, from, clearance })?;
    proof.intervals.iter().try_for_each(&mut *write)?;
    if let (Some(pitch), Some(Reached { far, steps })) = (value_hi, proof.reached) {
        write(&CertificateLine::Far { pitch, radius: far })?;
        steps.into_iter().try_for_each(|step| write(&CertificateLine::Step(step)))?;
    }
    let value_lo = (intervals > 0).then_some(found.value_lo);
    let result = CertifiedPitch { radius, from, clearance, value_lo, value_hi };
    write(&CertificateLine::Result(CertifiedResult::LeastPitch(result)))
}

/// A function that proposes the least pitch between two with which the radius might be reached.
type Propose<'p> = &'p mut dyn FnMut(f64, f64, Progress<'_>) -> Proposal;

/// Encloses the least pitch with any proposals; wrong proposals only cost time. `keeps` requests the lines of the
/// intervals.
fn decided(
    asked: Spaced<'_>,
    radius: f64,
    propose: Propose<'_>,
    keeps: bool,
    progress: Progress<'_>,
) -> Result<(LeastPitch, Proof), PlanError> {
    let Accepted { least, greatest, .. } = Accepted::LENGTH;
    let Spaced { team, clearance } = asked;
    let from = least.max(0.5 * (team.width + clearance));
    if let Some(reason) = asked.too_near_on_a_line() {
        return Err(PlanError(format!("the team reaches {radius} m with no pitch: {reason}")));
    }
    let mut blocked = Blocked {
        asked,
        radius,
        pitch: from,
        locks: false,
        deepest: None,
        shown: None,
        shallow: SHALLOW,
        proposal: Proposal::default(),
        intervals: 0,
        lines: keeps.then(Vec::new),
    };
    let reaches = |pitch: f64, progress: Progress<'_>| reaches(asked, pitch, radius, MOST_STEPS, keeps, progress);
    let (mut value_hi, mut reached) = (None, None);
    let mut next = from;
    for _ in 0..MOST_PROPOSALS {
        // The more turns fit into the radius, the longer the way.
        let proposal = propose(next, greatest, &mut |pitch| progress(0.3 * (1.0 - (-0.3 * pitch / from).exp())));
        // The searches of a search that is to stop propose anything.
        if progress(0.3).is_break() {
            break;
        }
        let proposed = proposal.pitch;
        if proposed == Some(from) && reaches(from, progress).is_some() {
            return Err(PlanError(format!(
                "the team reaches {radius} m with a pitch of {from} m already, the least that is tested: it is too \
                 short to meet itself before"
            )));
        }
        let target = proposed.map_or(greatest, |pitch| pitch - BESIDE);
        blocked.proposal = proposal;
        blocked.extend_to(target, &mut |share| progress(0.3 + 0.5 * share));
        if progress(0.8).is_break() {
            break;
        }
        let done = blocked.pitch >= target;
        if done && proposed.is_none() {
            return Err(PlanError(format!(
                "the team reaches {radius} m with no pitch from {from:.9} m to {greatest:.3} m: with every one two \
                 boards overlap, or a link locks, before"
            )));
        }
        // Boards that come free before the proposed pitch may be the answer.
        let upper = proposed.filter(|_| done).map_or(blocked.pitch + WIDTH, |pitch| pitch + BESIDE);
        reached = reaches(upper, &mut |share| progress(0.8 + 0.2 * share));
        if reached.is_some() {
            value_hi = Some(upper);
            break;
        }
        if !done {
            // A pitch that reaches the radius, further from the lower number than requested.
            let further = proposed.map(|pitch| pitch + BESIDE);
            reached = further.and_then(|pitch| reaches(pitch, progress));
            value_hi = further.filter(|_| reached.is_some());
            break;
        }
        next = upper;
    }
    let Blocked { pitch: value_lo, intervals, shown: overlap, lines, .. } = blocked;
    let proved = intervals > 0 && value_hi.is_some_and(|value_hi| value_hi - value_lo <= 1e-9);
    let proof = Proof { intervals: lines.unwrap_or_default(), reached };
    Ok((LeastPitch { value_lo, value_hi, from, overlap, proved, intervals }, proof))
}

/// Two boards that overlap at a pitch, their depth, and the head's distance from the centre in metres.
#[derive(Debug, Clone, Copy)]
struct Deepest {
    pair: (u32, u32),
    depth: f64,
    head_radius: f64,
}

/// An interval of pitches with which boards are proved to overlap.
struct Blocked<'a> {
    asked: Spaced<'a>,
    radius: f64,
    /// The greatest pitch that is proved.
    pitch: f64,
    /// True if the head's link locks with that pitch.
    locks: bool,
    /// The boards that were found last.
    deepest: Option<Deepest>,
    /// The boards that were shown to overlap with that pitch; `None` for a lock.
    shown: Option<Overlap>,
    /// The share of its first depth below which the overlap is shallow.
    shallow: f64,
    /// The proposal for the pitches from here on.
    proposal: Proposal,
    intervals: u64,
    /// A line for each interval, if they are kept.
    lines: Option<Vec<CertificateLine<'static>>>,
}

/// The proof for an interval of pitches.
enum Shown {
    Lock,
    Overlap { theta: f64, benches: [usize; 2], spans: Vec<Span>, points: [[f64; 2]; 2] },
}

impl Blocked<'_> {
    /// Extends the interval up to a pitch, or as far as can be shown. `progress` receives the share that is done.
    fn extend_to(&mut self, to: f64, progress: Progress<'_>) {
        let from = self.pitch;
        let mut width = FIRST_SHARE * from;
        while self.pitch < to && self.intervals < MOST_INTERVALS {
            width = width.min(to - self.pitch);
            let proof = self.holds(width).or_else(|| {
                // The proposal may be wrong.
                [true, false].into_iter().find_map(|hinted| self.narrowed(&mut width, hinted, &mut |_| progress(0.0)))
            });
            let Some(proof) = proof else { break };
            let next = (self.pitch + width).min(to);
            self.shown = self.deepest.filter(|_| !self.locks).map(|Deepest { pair, head_radius, .. }| {
                // The polar angle holds for all pitches of the interval.
                Overlap { bench_a: pair.0, bench_b: pair.1, head_radius: head_radius * next / self.pitch }
            });
            if let Some(lines) = &mut self.lines {
                let (from, to) = (self.pitch, next);
                lines.push(match proof {
                    Shown::Lock => CertificateLine::HeadLocks { from, to },
                    Shown::Overlap { theta, benches, spans, points: [point, other] } => {
                        let other = (other != point).then_some(other);
                        CertificateLine::Overlap { from, to, theta, benches, spans, point, other }
                    }
                });
            }
            self.pitch = next;
            width *= GROWTH;
            self.intervals += 1;
            if progress(((self.pitch - from) / (to - from)).clamp(0.0, 1.0)).is_break() {
                break;
            }
        }
    }

    /// Follows the boards, with the hints of the proposal or without. Returns the proof for the greatest width of at
    /// most `width` for which there is one, and sets `width` to that.
    fn narrowed(&mut self, width: &mut f64, hinted: bool, progress: Progress<'_>) -> Option<Shown> {
        if !self.follow(hinted, progress) {
            return None;
        }
        let mut narrower = *width;
        while narrower > LEAST_SHARE * self.pitch {
            let proof = self.holds(narrower);
            if proof.is_some() {
                *width = narrower;
                return proof;
            }
            narrower *= 0.5;
        }
        None
    }

    /// Returns the proof, if there is one, that the two boards overlap or the head's link locks for all pitches up to
    /// `width` further on.
    fn holds(&self, width: f64) -> Option<Shown> {
        let (from, to) = (self.pitch, self.pitch + width);
        if self.locks {
            return head_locks(self.asked.team, (from, to), self.radius).then_some(Shown::Lock);
        }
        let deepest = self.deepest?;
        let theta = deepest.head_radius * TAU / from;
        let benches = [deepest.pair.0 as usize, deepest.pair.1 as usize];
        let pitches = Pitches { asked: self.asked, from, to, theta, benches };
        let (spans, points) = pitches.are_outside(self.radius).then(|| pitches.overlap())??;
        Some(Shown::Overlap { theta, benches, spans, points })
    }

    /// Finds the deepest overlap of the same two boards at this pitch. If they have come too nearly free, it finds
    /// other boards or a lock. Returns true if it finds any. With hints, it begins with the obstacle of the proposal,
    /// and keeps two boards that, by the proposal, overlap up to the proposed pitch.
    fn follow(&mut self, hinted: bool, progress: Progress<'_>) -> bool {
        let Proposal { pitch: proposed, first, last } = self.proposal;
        if let Some(Deepest { pair, depth, head_radius }) = self.deepest
            && !self.locks
        {
            let stays = matches!(last, Some(Obstacle::Touch { pair: last, .. }) if last == pair);
            let kept = if hinted && stays && proposed.is_some() { 0.0 } else { self.shallow };
            // As the pitch grows, the head meets a board a little further back.
            let (a, b) = pair;
            let behind = [(a, b + 1), (a, b + 2), (a, b.saturating_sub(1).max(a + 2))];
            for (pairs, shallow) in [(&[pair][..], kept), (&behind, self.shallow)] {
                let nearest = deepest(self.asked, self.pitch, self.radius, pairs, head_radius, progress);
                if nearest.clearance < -shallow * depth {
                    let depth = if nearest.pair == pair { depth } else { -nearest.clearance };
                    self.deepest = Some(Deepest { pair: nearest.pair, depth, head_radius: nearest.head_radius });
                    return true;
                }
            }
        }
        let first = first.filter(|_| hinted && self.intervals == 0);
        let found = first.or_else(|| obstacle(self.asked, self.pitch, self.radius, progress));
        self.locks = matches!(found, Some(Obstacle::Lock));
        let Some(Obstacle::Touch { pair, head_radius }) = found else { return self.locks };
        let Nearest { clearance, head_radius, .. } =
            deepest(self.asked, self.pitch, self.radius, &[pair], head_radius, progress);
        let is_same = self.deepest.is_some_and(|deepest| deepest.pair == pair);
        self.shallow = if is_same { self.shallow * self.shallow } else { SHALLOW };
        self.deepest = (clearance < 0.0).then_some(Deepest { pair, depth: -clearance, head_radius });
        self.deepest.is_some()
    }
}

#[cfg(test)]
mod tests;
