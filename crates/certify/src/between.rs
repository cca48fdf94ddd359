//! Certified contacts of several dragons. The certificate has the events of each dragon alone, and for each two dragons
//! stretches of time in which their boards are apart, up to their first contact. Lemma 12 of `docs/proofs.md`.

mod clearance;
mod side;

use std::io;

use super::bracket::nearest_shown;
use super::first_order::When;
use super::interval::Interval;
use super::lines::{CertificateLine, CertifiedEvent, CertifiedResult, Status, WIDE, Witness};
use super::search::{AROUND, CertificateSearch, LEAST, LEAST_STEP, MOST_SPANS, NEAR, Section, first_line};
use super::walk::{Next, Walk, Walker, Way};
use super::{CertifyError, Given, certify_alone, ground};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::ensemble::{Dragon, Ensemble, pairs};
use bench_dragon_motion::event::{Event, Progress};
use bench_dragon_motion::model::separation::overlap_centre;
use bench_dragon_motion::timeline::Timeline;
use clearance::UpperBetween;
pub use clearance::{BetweenEnclosure, EnsembleClearances, certify_clearances};
use side::{Extent, Refused, Side, sentence};

/// A function that receives each line of a certificate.
type Write<'w> = &'w mut dyn FnMut(&CertificateLine) -> io::Result<()>;

/// Certifies the events of each dragon of a show, and the first contact of each two. `timeline` has the events of the
/// show, `scene` is the text of the scene. Each dragon and each pair is certified to the end of its own motion. Each
/// search gives up after `most_steps`. `progress` receives the share that is done, from 0 to 1.
///
/// # Errors
/// [`CertifyError::Write`]
pub fn certify(
    ensemble: &Ensemble,
    timeline: &Timeline,
    scene: &str,
    most_steps: u64,
    write: Write<'_>,
    progress: Progress<'_>,
) -> Result<Vec<CertifiedEvent>, CertifyError> {
    // The format has no line for a dragon without a name.
    if let Some(motion) = ensemble.only() {
        return certify_alone(motion, timeline, scene, most_steps, write, progress);
    }
    first_line(&mut *write, scene)?;
    let dragons = ensemble.dragons();
    let parts = (dragons.len() * (dragons.len() + 1) / 2) as f64;
    let (mut proved, mut sections, mut done) = (Vec::new(), Vec::new(), 0.0);
    for (number, dragon) in dragons.iter().enumerate() {
        write(&CertificateLine::Section { dragons: vec![number] })?;
        let timeline = Ensemble::alone(dragon.motion.clone()).timeline(&mut |_| progress(done / parts));
        let section = alone((number, dragon), &timeline, (scene, most_steps), &mut *write, &mut |share| {
            progress((done + share) / parts)
        })?;
        proved.extend(section.events.iter().cloned());
        sections.push((timeline, section));
        done += 1.0;
    }
    for pair in pairs(dragons.len()) {
        write(&CertificateLine::Section { dragons: pair.to_vec() })?;
        let ends = pair.map(|k| {
            let (timeline, section) = &sections[k];
            Side::new(&dragons[k], timeline.end().event, section.locks, Some(section))
        });
        let to = ends.iter().map(|side| side.end).fold(0.0, f64::max);
        let to = ends.iter().filter(|side| side.locks).map(|side| side.end).fold(to, f64::min);
        let hint = ensemble.first_contact_of(pair, to, &mut |_| progress(done / parts));
        let mut search = PairSearch::new(ends, Aim::Clear, most_steps, &mut *write);
        let status = search.run(hint, to, &mut |share| progress((done + share) / parts))?;
        let event = CertifiedEvent { event: EventKind::Contact, obstacle: None, dragons: pair.to_vec(), status };
        write(&CertificateLine::Result(CertifiedResult::Event(event.clone())))?;
        proved.push(event);
        done += 1.0;
    }
    Ok(proved)
}

/// Certifies the events of one dragon.
fn alone(
    (number, Dragon { delay, motion, .. }): (usize, &Dragon),
    timeline: &Timeline,
    (scene, most_steps): (&str, u64),
    write: Write<'_>,
    progress: Progress<'_>,
) -> Result<Section, CertifyError> {
    let events: Vec<Event> = timeline.events().iter().map(|timed| timed.event).collect();
    let given = Given {
        scene,
        description: motion.description(),
        path: motion.path(),
        team: motion.team(),
        head_speed: motion.head_speed(),
        events: &events,
        most_steps,
        most_spans: MOST_SPANS,
        dragon: Some((number, *delay)),
    };
    CertificateSearch::new(given, ground::barriers(motion), write).section(progress)
}

/// The claim about two dragons that stretches of time are to show.
#[derive(Debug, Clone, Copy)]
enum Aim {
    /// No boards of the two touch.
    Clear,
    /// No link locks; no claim about boards.
    Links,
    /// Boards of the two are more than some metres apart.
    Apart(f64),
}

/// The search for the proofs about two dragons, by stretches of time.
struct PairSearch<'a, 'w> {
    sides: [Side<'a>; 2],
    aim: Aim,
    /// The least clearance so far, if it is sought. The aim follows it.
    upper: Option<UpperBetween>,
    /// The least of the metres that the stretches have shown boards to be apart.
    shown: Option<f64>,
    /// The time up to which stretches have come, in seconds.
    time: f64,
    /// The state of the walk; its lengths are seconds.
    walk: Walk,
    write: Write<'w>,
}

impl<'a, 'w> PairSearch<'a, 'w> {
    fn new(sides: [Side<'a>; 2], aim: Aim, most_steps: u64, write: Write<'w>) -> Self {
        let walk = Walk::new(longest_step(&sides, 0.0), most_steps);
        Self { sides, aim, upper: None, shown: None, time: 0.0, walk, write }
    }
}

impl PairSearch<'_, '_> {
    /// Writes the lines up to `to`, given the contact that the ordinary search has found, and returns their result.
    fn run(
        &mut self,
        hint: Option<(f64, [usize; 2])>,
        to: f64,
        progress: Progress<'_>,
    ) -> Result<Status, CertifyError> {
        let Some((contact, benches)) = hint else {
            let refused = self.go_to(to, progress)?;
            // Nearer to a lock no step can be shown.
            let before_lock = self.before_lock();
            return Ok(match refused {
                None if !self.sides.iter().any(|side| side.locks) => Status::None { time_lo: None },
                _ if before_lock.is_some() => Status::None { time_lo: before_lock },
                None => Status::Undecided { time_lo: self.time, because: "the motion ends there".to_owned() },
                Some(because) => Status::Undecided { time_lo: self.time, because },
            });
        };
        if contact > 0.0
            && let Some(because) = self.go_to(contact - self.around(), progress)?
            && contact - self.time > self.near()
        {
            return Ok(Status::Undecided { time_lo: self.time, because });
        }
        self.meeting(contact, benches)
    }

    /// Returns a time up to which the boards are apart, if it is just before the end of the steps of a dragon that
    /// locks.
    fn before_lock(&self) -> Option<f64> {
        // The checker's bound, less its rounding.
        let near = 0.999 * self.near();
        self.sides.iter().filter(|side| side.locks).find_map(|side| {
            let metres = side.chain.exact.travelled(side.section?.end);
            let end = metres.over(Interval::point(side.head_speed)) + Interval::point(side.delay);
            let time = self.time.min(end.lo);
            (time >= 0.0 && end.hi - time < near).then_some(time)
        })
    }

    /// Returns the seconds on each side of a contact.
    fn around(&self) -> f64 {
        let least = self.sides.each_ref().map(|side| side.seconds(LEAST * (1.0 + side.chain.path.length())));
        AROUND.max(least[0].max(least[1]))
    }

    /// Returns the seconds from an event within which the event explains a step that is not shown.
    fn near(&self) -> f64 {
        let seconds = self.sides.each_ref().map(|side| side.seconds(NEAR * side.chain.team.shortest_link()));
        seconds[0].min(seconds[1])
    }

    /// Goes to a time in steps. Returns the reason if it stopped before.
    fn go_to(&mut self, to: f64, progress: Progress<'_>) -> Result<Option<String>, CertifyError> {
        Ok(self.walk_to(to, |search| progress((search.time / to).clamp(0.0, 1.0)))?)
    }

    /// Returns the certificate line of both dragons from `self.time` to `to`.
    fn show_until(&self, to: f64) -> Result<CertificateLine<'static>, Refused> {
        let stretch = |side: &Side| match self.aim {
            Aim::Apart(_) => side.first_order(self.time, to, Extent::Whole),
            Aim::Clear | Aim::Links => side.stretch(self.time, to, Extent::Whole),
        };
        let [one, other] = &self.sides;
        let (one, other) = (stretch(one)?, stretch(other)?);
        let are_apart = |[a, b]: [usize; 2]| match self.aim {
            Aim::Links => true,
            Aim::Clear => one.boards[a].is_apart_from(&other.boards[b]),
            Aim::Apart(metres) => {
                one.boards[a].is_further_than(metres.max(0.0), &other.boards[b])
                    || one.first_order[a].is_further_than(metres, &other.first_order[b], When::Always)
            }
        };
        for a in 0..one.boards.len() {
            if let Some(b) = (0..other.boards.len()).find(|b| !are_apart([a, *b])) {
                return Err(Refused::Pair([a, b]));
            }
        }
        let (heads, spans) = ([one.head, other.head], [one.spans, other.spans]);
        let apart = if let Aim::Apart(metres) = self.aim { Some(metres) } else { None };
        Ok(CertificateLine::Both { from: self.time, to, heads, spans, apart, at: [one.at, other.at] })
    }

    /// Returns the line that two boards have a point in common at a time.
    fn touch(&self, time: f64, benches: [usize; 2]) -> Option<CertificateLine<'static>> {
        let [one, other] = [0, 1].map(|k| self.sides[k].stretch(time, time, Extent::UpTo(benches[k])).ok());
        let (one, other) = (one?, other?);
        let boards = [one.boards[benches[0]], other.boards[benches[1]]];
        let [a, b] = boards.map(|board| board.in_doubles());
        let point: [f64; 2] = overlap_centre(&a, &b).into();
        let heads = vec![one.head, other.head];
        let holds = boards.iter().all(|board| board.holds(point.map(Interval::point)))
            && (0..2).all(|k| self.sides[k].has_come(heads[k]));
        let (benches, spans, point) = (benches.to_vec(), vec![one.spans, other.spans], Some(point));
        let (obstacle, time, at, most) = (None, Some(time), Vec::new(), None);
        holds.then_some(CertificateLine::Witness(Witness { obstacle, benches, time, heads, spans, at, point, most }))
    }

    /// Returns the nearest time after `contact` at which it is found, as seconds after it, and the line.
    fn found_meeting(&self, contact: f64, benches: [usize; 2]) -> Option<(f64, CertificateLine<'static>)> {
        let (around, most) = (self.around(), self.near().max(self.around()));
        let at_start = (contact == 0.0).then(|| self.touch(0.0, benches)).flatten().map(|line| (0.0, line));
        at_start.or_else(|| nearest_shown(around, most, |far| self.touch(contact + far, benches)))
    }

    /// Writes the line of a contact at the nearest time after `contact` at which it is found, and returns the status.
    fn meeting(&mut self, contact: f64, benches: [usize; 2]) -> Result<Status, CertifyError> {
        let Some((far, line)) = self.found_meeting(contact, benches) else {
            let because = "doubles cannot tell whether the boards touch that come so near".to_owned();
            return Ok(Status::Undecided { time_lo: self.time, because });
        };
        (self.write)(&line)?;
        let (time_lo, time_hi) = (self.time, contact + far);
        let because = (time_hi - time_lo > WIDE)
            .then(|| "the boards meet so slowly that rounding hides the contact for so long".to_owned());
        let [bench_a, bench_b] = benches.map(Some);
        Ok(Status::Proved { time_lo, time_hi, bench_a, bench_b, because })
    }
}

/// Returns the least seconds in which a head that moves travels its shortest link; infinity while none moves.
fn longest_step(sides: &[Side; 2], time: f64) -> f64 {
    let moving = sides.iter().filter(|side| side.is_moving(time));
    moving.map(|side| side.seconds(side.chain.team.shortest_link())).fold(f64::INFINITY, f64::min)
}

impl Walker<f64> for PairSearch<'_, '_> {
    fn walk(&mut self) -> &mut Walk {
        &mut self.walk
    }

    fn way(&self, to: f64) -> Option<Way<f64>> {
        let longest = longest_step(&self.sides, self.time);
        let moving = self.sides.iter().filter(|side| side.is_moving(self.time));
        let least = moving.map(|side| side.seconds(LEAST_STEP * (1.0 + side.chain.path.length())));
        let least = least.fold(4.0 * f64::EPSILON * self.time, f64::max);
        // While no dragon moves, a step must not cross the next start, but any length up to there is valid.
        let starts = self.sides.iter().map(|side| side.delay).filter(|start| *start > self.time);
        let until = if longest.is_finite() { to } else { starts.fold(to, f64::min) };
        // To the first order, a dragon that begins or ends to move would cost a factor of accuracy.
        let is_close = matches!(self.aim, Aim::Apart(_));
        let breaks = self.sides.iter().flat_map(Side::breaks).filter(|time| is_close && *time > self.time);
        let until = breaks.fold(until, f64::min);
        let remaining = until - self.time;
        (self.time < to).then_some(Way { to: until, remaining, longest: longest.min(remaining), least })
    }

    fn step(&mut self, until: f64, length: Option<f64>, is_least: bool) -> io::Result<Next> {
        let to = length.map_or(until, |length| self.time + length);
        self.walk.steps += 1;
        Ok(match self.show_until(to) {
            Ok(line) => {
                (self.write)(&line)?;
                if let Aim::Apart(metres) = self.aim {
                    self.shown = Some(self.shown.map_or(metres, |least| least.min(metres)));
                }
                self.time = to;
                Next::Longer
            }
            Err(Refused::Pair(benches)) if self.lower(0.5 * (self.time + to), benches) => Next::Same,
            Err(refused) if is_least => Next::End(Some(sentence(&refused))),
            Err(_) => Next::Shorter,
        })
    }
}
