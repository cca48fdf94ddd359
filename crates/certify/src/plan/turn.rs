//! The least turn radius, enclosed: with every radius up to the lower number a link stalls or locks, or boards overlap;
//! with the upper number none of these happens.
//!
//! In: a team, a pitch, the ratio of the arcs. Out: the two numbers. "The least turn" in `docs/proofs.md` has the
//! proof. The ordinary search ([`super::turn_trial`]) only suggests where to search.

use std::cell::{Cell, RefCell};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

use super::PlanError;
use super::turn_trial::{Family, Witness};
use crate::place::Place;
use crate::spaced::Spaced;
use crate::turn::{Passage, Turns};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::event::Progress;
use bench_dragon_show::scene::Accepted;

/// The least radius of a turnaround with which a team turns round. The head comes in from any distance, and until the
/// last handle has left the turn, no two boards that share no handle touch, and no link stalls or locks. Radii above
/// `value_hi` are not covered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastTurn {
    /// The lower bound, in metres: with every radius from `from` up to this, a link stalls or locks or two boards
    /// overlap. Equal to `from` if this is shown for no radius.
    pub value_lo: f64,
    /// The upper bound, in metres: with this radius the team turns round. `None` if this is shown for no radius.
    pub value_hi: Option<f64>,
    /// The least radius with which the ordinary search finds no event, in metres. It is within 1e-9 m of `value_lo`,
    /// and equal to `value_hi` if that is within a nanometre too. `None` if the search was given up before.
    pub value: Option<f64>,
    /// The length of the S with the radius `value`, in metres.
    pub length: Option<f64>,
    /// The least radius that is tested, in metres.
    pub from: f64,
    /// The radius of the first arc over the radius of the second.
    pub arc_ratio: f64,
    /// The event with the radius `value_lo`; `None` if nothing is shown.
    pub limit: Option<TurnLimit>,
    /// True if `value_lo` and `value_hi` are within 1e-8 m. Otherwise the search was given up.
    pub proved: bool,
    /// The number of intervals into which the radii from `from` to `value_lo` are divided.
    pub intervals: u64,
    /// The lengths of path before and after the S that the proof for `value_hi` covers, in metres.
    pub leads: Option<[f64; 2]>,
}

impl LeastTurn {
    /// Returns the answer with another radius on a spiral of a pitch, in metres, which is not proved to be the least one.
    /// Without a radius the upper bound remains.
    pub fn with_radius(&self, radius: Option<f64>, pitch: f64) -> Self {
        let a = pitch / TAU;
        let length = radius.map(|radius| 2.0 * radius.hypot(a) * (radius / a).atan());
        Self { value: radius, value_hi: radius.or(self.value_hi), length, proved: false, ..*self }
    }
}

/// The event that keeps the turn from being smaller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurnLimit {
    /// A contact, a stall or a lock.
    pub kind: EventKind,
    /// The bench that stalls or locks, or the one of two that is nearer the head, counted from 0.
    pub bench_a: u32,
    /// The other of two benches that touch.
    pub bench_b: Option<u32>,
    /// The place of the rear handle of a lock, of the front handle of a stall, or of the head at a contact, in metres
    /// of path past the beginning of the S. It is negative before the S.
    pub past: f64,
}

/// The distance of the two numbers in metres, with room for rounding.
const WIDTH: f64 = 0.95e-9;

/// Multiples of [`WIDTH`] that are tried. Next to a lock the follower is so fast that doubles cannot resolve its way,
/// and the proof needs a greater distance from the lock.
const FURTHER: [f64; 7] = [1.0, 4.0, 10.0, 40.0, 160.0, 640.0, 4096.0];

/// The number of benches with which a radius is tried first.
const FEW: usize = 4;

/// Limit of intervals of radii.
const MOST_INTERVALS: u64 = 200_000;

/// Limits of work, in all and for the ratio, in microseconds on a usual machine.
const MOST_WORK: u64 = 40_000_000;
const MOST_WORK_ON_RATIO: u64 = 15_000_000;

/// Work on an interval of radii or on a step of the head, and for each bench of a step of the whole team, in
/// microseconds.
const STEP_WORK: u64 = 1_000;
const BENCH_WORK: u64 = 20;

/// The length of an interval in metres, at least and at first; the factors after an interval that is shown and one that
/// is not.
const LEAST_INTERVAL: f64 = 1e-12;
const FIRST_INTERVAL: f64 = 1e-3;
const GROWTH: f64 = 1.5;
const SHRINK: f64 = 0.5;

/// The greatest width below which other events are tried beside the same event. After such a trial, they are tried
/// again below a share of the width that the trial has left.
const OTHERS_BELOW: f64 = 1e-4;
const OTHERS_AGAIN: f64 = 0.1;

/// The share of a radius within which a better ratio must be better, and the steps of the ratio's logarithm.
const BETTER: f64 = 1e-7;
const FIRST_RATIO_STEP: f64 = 0.7;
const LEAST_RATIO_STEP: f64 = 2e-3;

/// Encloses the least turn radius of a team on spirals of a pitch. The arcs have the ratio `arc_ratio`, or the best
/// ratio that the search finds if there is none. `progress` receives the share of the work that is done, from 0 to 1.
///
/// # Errors
/// The team turns round with the least radius that is tested, or its boards overlap on a straight line.
pub fn least_turn<'a>(
    asked: impl Into<Spaced<'a>>,
    pitch: f64,
    arc_ratio: Option<f64>,
    progress: Progress<'_>,
) -> Result<LeastTurn, PlanError> {
    let asked @ Spaced { team, clearance } = asked.into();
    if let Some(reason) = asked.too_near_on_a_line() {
        return Err(PlanError(format!("the team turns round with no radius: {reason}")));
    }
    let (share, progress) = (Cell::new(0.0_f64), RefCell::new(progress));
    let (work, most) = (Cell::new(0_u64), Cell::new(MOST_WORK_ON_RATIO));
    let ask = |microseconds| {
        work.set(work.get() + microseconds);
        let of_work = work.get() as f64 / MOST_WORK as f64;
        let go_on = progress.borrow_mut()(share.get().max(of_work.min(1.0)));
        if work.get() > most.get() { ControlFlow::Break(()) } else { go_on }
    };
    let family = Family { team, clearance, pitch, arc_ratio: arc_ratio.unwrap_or(1.0), ask: &ask };
    let family = if arc_ratio.is_none() { best(family) } else { family };
    most.set(MOST_WORK);
    let from = Accepted::LENGTH.least;
    let first = family.event(from);
    if family.is_stopped() {
        return Ok(nothing(from, family.arc_ratio));
    }
    let Some(witness) = first else {
        return Err(PlanError(format!(
            "the team turns round with a turn radius of {from} m already, the least that is tested"
        )));
    };
    let mut blocked = Blocked { family, radius: from, witness, intervals: 0, shown: None };
    blocked.extend(&mut |done| {
        share.set(0.5 * done);
        ask(STEP_WORK)
    });
    let Blocked { radius: value_lo, intervals, shown, .. } = blocked;
    let upper = value_lo + WIDTH;
    let limit = shown.map(|witness| limit(&family, value_lo, &witness));
    let mut found = LeastTurn { value_lo, limit, intervals, ..nothing(from, family.arc_ratio) };
    let may_be_free = intervals > 0 && upper <= Accepted::LENGTH.greatest && family.event(upper).is_none();
    // A stopped search finds no event.
    if !may_be_free || family.is_stopped() {
        return Ok(found);
    }
    (found.value, found.length) = (Some(upper), Some(family.length(upper)));
    let closely = shown.is_some_and(|witness| matches!(witness, Witness::Overlap { .. }));
    let mut of_passage = |done| {
        share.set(0.5 + 0.5 * done);
        ask(STEP_WORK + BENCH_WORK * team.benches as u64)
    };
    for further in FURTHER {
        let upper = value_lo + further * WIDTH;
        let passage = |asked: Spaced<'_>| Passage::new(asked, pitch, family.arc_ratio, upper);
        // The first benches fail as soon as the whole team does, at less cost.
        let few = team.foremost(FEW);
        let few = Spaced { team: &few, clearance };
        if !passage(few).is_some_and(|passage| passage.is_free(few, closely, &mut |_| ask(STEP_WORK))) {
            continue;
        }
        let Some(passage) = passage(asked) else { break };
        if passage.is_free(asked, closely, &mut of_passage) {
            found.value_hi = Some(upper);
            found.leads = Some([passage.lead_in, passage.lead_out]);
            found.proved = upper - value_lo <= 1e-8;
            break;
        }
    }
    Ok(found)
}

/// Returns the result of a search that has proved nothing.
fn nothing(from: f64, arc_ratio: f64) -> LeastTurn {
    LeastTurn {
        value_lo: from,
        value_hi: None,
        value: None,
        length: None,
        from,
        arc_ratio,
        limit: None,
        proved: false,
        intervals: 0,
        leads: None,
    }
}

/// Returns the family with the best ratio that the ordinary search finds.
fn best(family: Family<'_>) -> Family<'_> {
    let (mut best, mut step) = (family, FIRST_RATIO_STEP);
    let mut radius = best.radius();
    while step > LEAST_RATIO_STEP && !family.is_stopped() {
        let better = [step, -step].into_iter().find_map(|by| {
            let arc_ratio = (1e3 * best.arc_ratio * by.exp()).round() / 1e3;
            let Accepted { least, greatest, .. } = Accepted::ARC_RATIO;
            let other = Family { arc_ratio: arc_ratio.clamp(least, greatest), ..best };
            other.event(radius * (1.0 - BETTER)).is_none().then_some(other)
        });
        // A stopped search finds no event.
        if family.is_stopped() {
            break;
        }
        match better {
            Some(other) => (best, radius) = (other, other.radius().min(radius)),
            None => step *= 0.5,
        }
    }
    best
}

fn limit(family: &Family<'_>, radius: f64, witness: &Witness) -> TurnLimit {
    let past = family.past(radius, witness.place());
    match *witness {
        Witness::Fold { kind, link, .. } => TurnLimit { kind, bench_a: link as u32, bench_b: None, past },
        Witness::Overlap { pair, .. } => {
            TurnLimit { kind: EventKind::Contact, bench_a: pair.0, bench_b: Some(pair.1), past }
        }
    }
}

/// An interval of radii with which the team is proved not to turn round.
struct Blocked<'a> {
    family: Family<'a>,
    /// The greatest radius that is proved.
    radius: f64,
    witness: Witness,
    intervals: u64,
    /// The witness of the last interval.
    shown: Option<Witness>,
}

impl Blocked<'_> {
    /// Extends the interval as far as can be shown. `progress` receives the share that is done.
    fn extend(&mut self, progress: Progress<'_>) {
        let longest = self.family.team.longest_link();
        let mut width = FIRST_INTERVAL;
        let mut others_below = OTHERS_BELOW;
        while self.intervals < MOST_INTERVALS && self.radius < Accepted::LENGTH.greatest {
            if let Some(next) = self.on_spiral() {
                (self.radius, self.shown) = (next, Some(self.witness));
                self.intervals += 1;
                continue;
            }
            if !self.holds(width) {
                let (family, witness) = (self.family, self.witness);
                let same = family.follow(self.radius, &witness);
                let mut next = self.widest(same, width, LEAST_INTERVAL);
                if next.is_none_or(|next| next < others_below) {
                    // The event may have gone or be about to go, and another one remain further on.
                    let others = self.family.events(self.radius + WIDTH);
                    next = self.widest(others, FIRST_INTERVAL, next.unwrap_or(0.0).max(WIDTH)).or(next);
                    others_below = OTHERS_BELOW.min(OTHERS_AGAIN * next.unwrap_or(0.0));
                }
                let Some(next) = next else { break };
                width = next;
            }
            self.radius += width;
            self.shown = Some(self.witness);
            self.intervals += 1;
            width *= GROWTH;
            if progress(self.radius / (self.radius + longest)).is_break() {
                break;
            }
        }
    }

    /// Takes the witness with the widest interval of at most `width` and at least `least` metres, and returns its
    /// width.
    fn widest(&mut self, witnesses: impl IntoIterator<Item = Witness>, width: f64, least: f64) -> Option<f64> {
        let (before, mut best) = (self.witness, None);
        let mut widest = least;
        for witness in witnesses {
            self.witness = witness;
            let mut next = width;
            while next > widest && !self.holds(next) {
                next *= SHRINK;
            }
            if next > widest {
                (best, widest) = (Some(witness), next);
            }
            if widest == width {
                break;
            }
        }
        self.witness = best.unwrap_or(before);
        best.map(|_| widest)
    }

    /// Returns the radius to which the interval extends because the event is a fold on the inward spiral alone.
    fn on_spiral(&self) -> Option<f64> {
        let Witness::Fold { link, pivot, end, .. } = self.witness else { return None };
        let (turns, middle) = self.turns(0.0).filter(|_| pivot.0 == 0 && end.0 == 0)?;
        let [pivot, end] = [pivot, end].map(|place| self.family.on_path(middle, place));
        turns.fold_on_spiral(link, pivot, end).filter(|radius| *radius > self.radius)
    }

    /// Returns the turnarounds with all radii up to `width` further on, and the middle radius.
    fn turns(&self, width: f64) -> Option<(Turns<'_>, f64)> {
        let Family { team, clearance, pitch, arc_ratio, .. } = self.family;
        let radii = [self.radius, self.radius + width];
        let middle = 0.5 * radii[0] + 0.5 * radii[1];
        let path = self.family.path(middle)?;
        Some((Turns::new(Spaced { team, clearance }, pitch, arc_ratio, radii, path), middle))
    }

    /// Returns true if the event is proved for all radii up to `width` further on.
    fn holds(&self, width: f64) -> bool {
        let Some((turns, middle)) = self.turns(width) else { return false };
        let at = |place| self.family.on_path(middle, place);
        match &self.witness {
            Witness::Fold { link, pivot, end, .. } => turns.fold(*link, at(*pivot), at(*end)),
            Witness::Overlap { pair, head: Place(segment, place, _), radius, rate } => {
                let head = Place(*segment, place + rate * (middle - radius), 0.0);
                turns.overlap(at(head), *rate, [pair.0 as usize, pair.1 as usize])
            }
        }
    }
}

#[cfg(test)]
mod tests;
