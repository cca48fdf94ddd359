//! The least clearances of a show, first of each dragon alone, then of each two. For each two, stretches of time show
//! that the boards are further apart than a number of metres, and one more time shows two boards that are no further
//! apart. Lemma 12 of `docs/proofs.md`.

use super::side::{Extent, Side};
use super::{Aim, PairSearch, Write};
use crate::CertifyError;
use crate::clearance::{ClearanceEnclosures, ClearanceHints, Part, certify_part, clearance_first_line};
use crate::first_order::When;
use crate::lines::{CertificateLine, CertifiedClearance, CertifiedResult, Until, Witness};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::ensemble::{Dragon, Ensemble, pairs};
use bench_dragon_motion::event::{Event, Progress};
use bench_dragon_motion::timeline::TimedEvent;

/// The width of an enclosure in metres, with room for the rounding of both ends.
pub(super) const WIDTH: f64 = 0.9e-9;

/// The difference, in metres, by which a new upper bound must be lower than the one before.
const LOWER: f64 = 1e-3 * WIDTH;

/// An allowance for the rounding of the checker, in metres, which is added to an upper bound.
const SPARE: f64 = 1e-12;

/// The travel of the faster head before a lock at which the steps stop, in metres.
const BEFORE_LOCK: f64 = 1e-9;

/// Rounding of the time of a path's end, as a share.
const ENDING: f64 = 1e-12;

/// The length of the first step of a show that ends at its start or at a contact, in seconds.
const FIRST: f64 = 1e-6;

/// An upper bound of the clearance of a board of each of two dragons, and its time.
#[derive(Debug, Clone, Copy)]
pub(super) struct UpperBetween {
    pub value: f64,
    time: f64,
    benches: [usize; 2],
}

/// The enclosures of the dragons of a show.
#[derive(Debug, Clone, PartialEq)]
pub struct EnsembleClearances {
    /// The enclosures of each dragon alone, at its own travel.
    pub own: Vec<ClearanceEnclosures>,
    /// The enclosures of each two, in the order of [`pairs`].
    pub between: Vec<BetweenEnclosure>,
}

/// An enclosure of the least clearance of two dragons, from the start of a show on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BetweenEnclosure {
    /// The dragons.
    pub dragons: [usize; 2],
    /// The lower bound in metres for all boards of the two; `None` if nothing is proved.
    pub lo: Option<f64>,
    /// The upper bound in metres.
    pub hi: Option<f64>,
    /// The time of the show at which two boards are that near, in seconds.
    pub time: f64,
    /// A bench of each, counted from 0.
    pub benches: [usize; 2],
    /// The time of the show up to which `lo` is proved, in seconds, if not up to the show's end. If a lock of one of
    /// the two ends the show, the proof may end a nanometre of travel before it and still counts as complete.
    pub until: Option<f64>,
}

/// Encloses least clearances from the start of a show until the show ends at `show_end`, and writes a certificate. The
/// clearances are those of each dragon, of each obstacle and each dragon, and of each two dragons. `hints` are for a
/// dragon without a name; for others the ordinary search makes them. `scene` is the text of the scene. Each search
/// gives up after `most_steps`. `progress` receives the share that is done, from 0 to 1. The enclosures are a nanometre
/// wide, unless a search gives up. The certificate of a show that ends with a lock ends a nanometre of travel before
/// the lock.
///
/// # Errors
/// [`CertifyError::Write`]
pub fn certify_clearances(
    ensemble: &Ensemble,
    show_end: &TimedEvent,
    hints: ClearanceHints<'_>,
    scene: &str,
    most_steps: u64,
    write: Write<'_>,
    progress: Progress<'_>,
) -> Result<EnsembleClearances, CertifyError> {
    clearance_first_line(&mut *write, scene)?;
    let dragons = ensemble.dragons();
    let parts = (dragons.len() * (dragons.len() + 1) / 2) as f64;
    let (mut own, mut between, mut done) = (Vec::new(), Vec::new(), 0.0);
    for (number, dragon) in dragons.iter().enumerate() {
        let mut progress = |share| progress((done + share) / parts);
        let (write, motion) = (&mut *write, &dragon.motion);
        own.push(if dragon.name.is_empty() {
            // The format has no line for this dragon.
            certify_part(motion, Part::default(), show_end, hints, most_steps, write, &mut progress)?
        } else {
            write(&CertificateLine::Section { dragons: vec![number] })?;
            let end = own_end(ensemble, number, show_end);
            let alone = Ensemble::alone(motion.clone());
            let mut silent = |_| progress(0.0);
            let least = alone.least_clearances(&alone.timeline_without_contact(&mut silent), &end, &mut silent).own;
            let (least, obstacles) = (least.map(|found| found.least), alone.obstacle_clearances(&end, &mut silent));
            let hints = ClearanceHints { boards: least.as_ref(), obstacles: &obstacles };
            let part = Part { dragons: vec![number], delay: dragon.delay, show_end: Some(show_end.time) };
            certify_part(motion, part, &end, hints, most_steps, write, &mut progress)?
        });
        done += 1.0;
    }
    for pair in pairs(dragons.len()) {
        write(&CertificateLine::Section { dragons: pair.to_vec() })?;
        let sides = pair.map(|k| {
            let alone = Ensemble::alone(dragons[k].motion.clone());
            let end = alone.timeline_without_contact(&mut |_| progress(done / parts)).end().event;
            Side::new(&dragons[k], end, end.kind == EventKind::Lock, None)
        });
        let hint = ensemble.nearest_of(pair, show_end.time, &mut |_| progress(done / parts));
        let mut search = PairSearch::new(sides, Aim::Links, most_steps, &mut *write);
        let contact = contact_of(ensemble, pair, show_end);
        let mut of_pair = |share: f64| progress((done + share) / parts);
        let enclosure = match contact.filter(|_| show_end.time > 0.0) {
            Some(benches) => search.until_contact(pair, (show_end.time, benches), &mut of_pair)?,
            None => search.least(pair, hint, show_end, &mut of_pair)?,
        };
        between.push(enclosure);
        done += 1.0;
    }
    Ok(EnsembleClearances { own, between })
}

/// Returns the bench of each of two dragons, counted within it, if the show ends with their contact.
fn contact_of(ensemble: &Ensemble, pair: [usize; 2], show_end: &TimedEvent) -> Option<[usize; 2]> {
    let Event { kind, bench_a, bench_b, .. } = show_end.event;
    let owners = [bench_a?, bench_b?].map(|bench| ensemble.owner(bench as usize));
    let [(one, a), (other, b)] = [owners[0]?, owners[1]?];
    (kind == EventKind::Contact && [one, other] == pair).then_some([a, b])
}

/// Returns the end of a show as an event of one dragon's own motion. The event is the contact or lock of the dragon's
/// own benches, the path's end, or a place. The place is where the dragon is at the show's end, which is taken as
/// found.
fn own_end(ensemble: &Ensemble, dragon: usize, show_end: &TimedEvent) -> TimedEvent {
    let Dragon { motion, .. } = &ensemble.dragons()[dragon];
    let Event { kind, bench_a, bench_b, place, .. } = show_end.event;
    let owned = |bench: Option<u32>| {
        let (owner, own) = ensemble.owner(bench? as usize)?;
        (owner == dragon).then_some(own as u32)
    };
    let (a, b) = (owned(bench_a), owned(bench_b));
    let own_time = ensemble.dragons()[dragon].own_time(show_end.time).0;
    let (travelled, length) = (motion.travelled_at(own_time), motion.path().length());
    let is_own = match kind {
        EventKind::Contact => a.is_some() && b.is_some(),
        EventKind::Lock => a.is_some(),
        _ => false,
    };
    let event = if is_own {
        Event { kind, travelled: show_end.event.travelled, bench_a: a, bench_b: b, place }
    } else if travelled >= length * (1.0 - 1e-12) - 1e-12 {
        Event { kind: EventKind::PathEnd, travelled: length, bench_a: None, bench_b: None, place: None }
    } else {
        Event { kind: EventKind::Obstacle, travelled, bench_a: None, bench_b: None, place: None }
    };
    TimedEvent { event, time: own_time }
}

impl PairSearch<'_, '_> {
    /// Encloses the least clearance of a show that does not end with a contact of the two.
    fn least(
        &mut self,
        dragons: [usize; 2],
        hint: Option<(f64, [usize; 2])>,
        show_end: &TimedEvent,
        progress: Progress<'_>,
    ) -> Result<BetweenEnclosure, CertifyError> {
        let locks = self.sides.iter().filter(|side| side.locks);
        let latest = locks.map(|side| side.end - side.seconds(BEFORE_LOCK)).fold(f64::INFINITY, f64::min);
        let end = show_end.time.min(latest).max(0.0);
        // If the show ends with the last path end, the search continues until both dragons surely stand.
        let stands = self.sides.iter().map(|side| side.end).fold(0.0, f64::max);
        let end = if latest.is_infinite() && end >= stands - ENDING * (1.0 + stands) { end.max(stands) } else { end };
        self.upper = hint.and_then(|(time, benches)| self.upper_at(time.min(end), benches));
        let Some(upper) = self.upper else {
            let nothing =
                BetweenEnclosure { dragons, lo: None, hi: None, time: 0.0, benches: [0, 0], until: Some(0.0) };
            self.write_result(&nothing)?;
            return Ok(nothing);
        };
        self.aim = Aim::Apart(upper.value - WIDTH);
        // A show that ends at its start has a stretch, too.
        let stuck = self.go_to(end.max(1e-3 * FIRST), progress)?;
        let until = if stuck.is_some() { Some(self.time.min(end)) } else { None };
        let upper = self.upper.unwrap_or(upper);
        let hi = if upper.time <= self.time { self.write_near(upper)? } else { None };
        let UpperBetween { time, benches, .. } = upper;
        let enclosure = BetweenEnclosure { dragons, lo: self.shown, hi, time, benches, until };
        let is_whole = stuck.is_none() && self.sides.iter().all(|side| self.time >= side.end);
        self.write_line(&enclosure, if is_whole { Until::PathEnd } else { Until::Time }, self.time.min(end))?;
        Ok(enclosure)
    }

    /// Encloses the least clearance of a show that ends with a contact of the two: it is 0.
    fn until_contact(
        &mut self,
        dragons: [usize; 2],
        (time, benches): (f64, [usize; 2]),
        progress: Progress<'_>,
    ) -> Result<BetweenEnclosure, CertifyError> {
        let touched = BetweenEnclosure { dragons, lo: Some(0.0), hi: Some(0.0), time, benches, until: None };
        self.aim = Aim::Apart(0.0);
        let stuck = self.go_to(FIRST.min(0.5 * time), &mut |_| progress(0.0))?;
        let found = self.found_meeting(time, benches);
        if let (None, Some((far, line))) = (stuck, found) {
            self.aim = Aim::Links;
            if self.go_to(time + far, progress)?.is_none() {
                (self.write)(&line)?;
                self.write_line(&touched, Until::Contact, time)?;
                return Ok(touched);
            }
        }
        let enclosure = BetweenEnclosure { lo: self.shown, hi: None, until: Some(0.0), ..touched };
        self.write_result(&enclosure)?;
        Ok(enclosure)
    }

    /// Returns an upper bound of the clearance of two boards at a time.
    fn upper_at(&self, time: f64, benches: [usize; 2]) -> Option<UpperBetween> {
        let boards = [0, 1].map(|k| self.sides[k].first_order(time, time, Extent::UpTo(benches[k])).ok());
        let [one, other] = boards.map(|stretch| stretch.map(|stretch| stretch.first_order));
        let value = one?[benches[0]].at_most(&other?[benches[1]], When::Always);
        value.is_finite().then_some(UpperBetween { value, time, benches })
    }

    /// Lowers the upper bound to the bound of two boards at a time, if the new bound is lower. A number beyond the
    /// listed boards stands for the boards on a line; the nearest of them is found.
    pub(super) fn lower(&mut self, time: f64, boards: [usize; 2]) -> bool {
        let Some(upper) = self.upper else { return false };
        let Some(benches) = self.nearest_benches(time, boards) else { return false };
        let lower = self.upper_at(time, benches).filter(|lower| lower.value < upper.value - LOWER);
        if let Some(lower) = lower {
            self.upper = Some(lower);
            self.aim = Aim::Apart(lower.value - WIDTH);
        }
        lower.is_some()
    }

    fn nearest_benches(&self, time: f64, boards: [usize; 2]) -> Option<[usize; 2]> {
        let listed = |k: usize, extent: Extent| self.sides[k].stretch(time, time, extent).ok();
        let all = [0, 1].map(|k| {
            let count = listed(k, Extent::Whole)?.spans.len();
            let last = if boards[k] < count { boards[k] } else { self.sides[k].chain.team.benches - 1 };
            Some((boards[k]..=last, listed(k, Extent::UpTo(last))?))
        });
        let [one, other] = all;
        let ((a, one), (b, other)) = (one?, other?);
        let pairs = a.flat_map(|a| b.clone().map(move |b| [a, b]));
        let distance = |[a, b]: [usize; 2]| {
            let [a, b] = [one.boards[a].in_doubles(), other.boards[b].in_doubles()];
            bench_dragon_motion::model::separation::signed_distance_board_board(&a, &b)
        };
        pairs.min_by(|one, other| distance(*one).total_cmp(&distance(*other)))
    }

    /// Writes that two boards are near at a time that the stretches have come to. Returns the upper bound.
    fn write_near(&mut self, UpperBetween { time, benches, .. }: UpperBetween) -> Result<Option<f64>, CertifyError> {
        let stretches = [0, 1].map(|k| self.sides[k].first_order(time, time, Extent::UpTo(benches[k])).ok());
        let [Some(one), Some(other)] = stretches else { return Ok(None) };
        let most = one.first_order[benches[0]].at_most(&other.first_order[benches[1]], When::Always) + SPARE;
        let (heads, spans) = (vec![one.head, other.head], vec![one.spans, other.spans]);
        let (benches, time, at) = (benches.to_vec(), Some(time), vec![one.at, other.at]);
        let (obstacle, point) = (None, None);
        let witness = Witness { obstacle, benches, time, heads, spans, at, point, most: Some(most) };
        (self.write)(&CertificateLine::Witness(witness))?;
        Ok(Some(most))
    }

    /// Writes the result of a search that came to no end.
    fn write_result(&mut self, enclosure: &BetweenEnclosure) -> Result<(), CertifyError> {
        self.write_line(enclosure, Until::Time, enclosure.until.unwrap_or(0.0))
    }

    fn write_line(&mut self, enclosure: &BetweenEnclosure, until: Until, time: f64) -> Result<(), CertifyError> {
        let BetweenEnclosure { dragons, lo, hi, benches, .. } = *enclosure;
        let [bench_a, bench_b] = benches.map(|bench| hi.map(|_| bench));
        let time_until = (until == Until::Time).then_some(time);
        let dragons = dragons.to_vec();
        let result = CertifiedClearance { lo, hi, until, time_until, bench_a, bench_b, dragons };
        Ok((self.write)(&CertificateLine::Result(CertifiedResult::LeastClearance(result)))?)
    }
}
