//! Certified contacts of several dragons: the events of each alone, and then, of each two, stretches of time in which
//! their boards are apart, up to their first contact. Lemma 12 of `docs/proofs.md`.

use std::io;

use super::boards::MovingBoard;
use super::capsule::{Frame, Span, Spanned};
use super::grid::GridPoint;
use super::interval::Interval;
use super::lines::{CertificateLine, CertifiedEvent, Links, Status, WIDE};
use super::path::ExactPath;
use super::search::{
    AROUND, BESIDE, CertificateSearch, GROWTH, LEAST, LEAST_STEP, NEAR, SHRINK, Section, first_line, path_end,
};
use super::step::{Chain, Claim, Listed};
use super::{CertifyError, Given, ground};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::ensemble::{Dragon, Ensemble, pairs};
use bench_dragon_motion::event::Event;
use bench_dragon_motion::model::separation::overlap_centre;
use bench_dragon_motion::timeline::Timeline;

/// A function that receives each line of a certificate.
type Write<'w> = &'w mut dyn FnMut(&CertificateLine) -> io::Result<()>;

/// Certifies the events of each dragon of a show, and the first contact of each two. `scene` is the text of the scene.
/// Each dragon and each pair is certified to the end of its own motion. Each search gives up after `most_steps`.
/// `progress` receives the share that is done, from 0 to 1.
///
/// # Errors
/// [`CertifyError::Write`]
pub fn certify_several(
    ensemble: &Ensemble,
    scene: &str,
    most_steps: u64,
    write: Write<'_>,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<CertifiedEvent>, CertifyError> {
    first_line(&mut *write, scene)?;
    let dragons = ensemble.dragons();
    let parts = (dragons.len() * (dragons.len() + 1) / 2) as f64;
    let (mut proved, mut sections, mut done) = (Vec::new(), Vec::new(), 0.0);
    for (number, dragon) in dragons.iter().enumerate() {
        write(&CertificateLine::Dragon { dragon: number })?;
        let timeline = dragon.motion.timeline(&mut |_| ());
        let section = alone((number, dragon), &timeline, (scene, most_steps), &mut *write, &mut |share| {
            progress((done + share) / parts);
        })?;
        proved.extend(section.events.iter().cloned());
        sections.push((timeline, section));
        done += 1.0;
    }
    for pair in pairs(dragons.len()) {
        write(&CertificateLine::Pair { dragons: pair })?;
        let ends = pair.map(|k| Side::new(&dragons[k], &sections[k].1, sections[k].0.end().event));
        let to = ends.iter().map(|side| side.end).fold(0.0, f64::max);
        let to = ends.iter().filter(|side| side.section.locks).map(|side| side.end).fold(to, f64::min);
        let hint = ensemble.first_contact_of(pair, to, &mut |_| ());
        let mut search = PairSearch { sides: ends, time: 0.0, step: 0.0, steps: 0, most_steps, write: &mut *write };
        let status = search.run(hint, to, &mut |share| progress((done + share) / parts))?;
        let event = CertifiedEvent { event: EventKind::Contact, obstacle: None, dragons: pair.to_vec(), status };
        write(&CertificateLine::Result(event.clone()))?;
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
    progress: &mut dyn FnMut(f64),
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
        dragon: Some((number, *delay)),
    };
    CertificateSearch::new(given, ground::barriers(motion), write).section(progress)
}

/// One of two dragons, as a function of time.
struct Side<'a> {
    chain: Chain<'a>,
    frame: Frame,
    delay: f64,
    head_speed: f64,
    /// Seconds at which its motion ends.
    end: f64,
    section: &'a Section,
}

/// A dragon's handles and boards on the stage over a stretch of time.
struct Stretch {
    head: Span,
    spans: Vec<Span>,
    boards: Vec<MovingBoard>,
}

/// The reason why a stretch of time is not shown.
enum Refused {
    Link(usize),
    Pair([usize; 2]),
}

impl<'a> Side<'a> {
    fn new(Dragon { delay, motion, .. }: &'a Dragon, section: &'a Section, end: Event) -> Self {
        let chain = Chain::new(motion.path(), ExactPath::new(motion.description()), motion.team());
        let head_speed = motion.head_speed();
        // A little later: beyond the path's end the dragon stands.
        let slack = if section.locks { 0.0 } else { 1e-13 };
        let end = (delay + end.travelled / head_speed) * (1.0 + slack) + slack;
        Self { chain, frame: Frame::new(motion.placement()), delay: *delay, head_speed, end, section }
    }

    /// Returns the metres that the head has travelled at a time.
    fn travelled(&self, time: f64) -> Interval {
        let metres = (Interval::point(time) - Interval::point(self.delay)) * self.head_speed;
        metres.max(Interval::ZERO).min(Interval::point(self.chain.path.length()))
    }

    /// Returns grid points that the head is surely between from one time to another.
    fn ends(&self, from: f64, to: f64) -> Option<[GridPoint; 2]> {
        let Chain { path, exact, .. } = &self.chain;
        let least = f64::EPSILON * (1.0 + path.length());
        let beside = |travelled: f64, side: f64, holds: &dyn Fn(Interval) -> bool| {
            let mut points =
                (0..40).map(|power| GridPoint::new(path, exact, travelled + side * least * 2f64.powi(power)));
            points.find(|point| holds(exact.travelled(point.head)))
        };
        let (first, last) = (self.travelled(from), self.travelled(to));
        let before = beside(first.lo, -1.0, &|at| at.hi <= first.lo)?;
        let is_at_end = last.hi >= path.length() * (1.0 - LEAST) - LEAST;
        let after = if is_at_end { Some(path_end(exact, path)) } else { beside(last.hi, 1.0, &|at| at.lo >= last.hi) };
        Some([before, after?])
    }

    /// Encloses the handles from one time to another, all or those up to `handle`.
    fn stretch(&self, from: f64, to: f64, handle: Option<usize>) -> Result<Stretch, Refused> {
        let [mut first, mut last] = self.ends(from, to).ok_or(Refused::Link(0))?;
        let (benches, head) = (self.chain.team.benches, Span(first.head, last.head));
        let claim = Claim { links: Links::All, moving: false, clear: false };
        let mut listed = Listed::new(&self.chain, head, last.travelled - first.travelled);
        let is_enough = |listed: &Listed| match handle {
            Some(handle) => listed.handles.len() > handle,
            None => listed.handles.len() > benches || listed.is_on_line(listed.handles.len() - 1),
        };
        while listed.handles.len() < 2 || !is_enough(&listed) {
            let link = listed.handles.len() - 1;
            listed.extend(&mut first, &mut last, claim).map_err(|_| Refused::Link(link))?;
        }
        let boards: Vec<MovingBoard> = match handle {
            Some(handle) => (0..handle).map(|bench| self.chain.board(&listed.handles, bench)).collect(),
            None => listed.boards_on_ground(Links::All),
        };
        let boards = boards.iter().map(|board| board.placed(&self.chain.shape, &self.frame)).collect();
        let spans = listed.handles[1..].iter().map(|handle: &Spanned| handle.span).collect();
        Ok(Stretch { head, spans, boards })
    }

    /// Returns true if the motion is proved to go on up to a place of the head.
    fn has_come(&self, Span(_, to): Span) -> bool {
        self.section.ends_with_path || self.chain.exact.in_order(to, self.section.end)
    }

    fn is_moving(&self, time: f64) -> bool {
        time >= self.delay && time < self.end
    }

    /// Returns the seconds in which the head travels some metres.
    fn seconds(&self, metres: f64) -> f64 {
        metres / self.head_speed
    }
}

/// The search for the first contact of two dragons.
struct PairSearch<'a, 'w> {
    sides: [Side<'a>; 2],
    /// Seconds up to which the boards are apart.
    time: f64,
    /// Seconds of the next step to try.
    step: f64,
    steps: u64,
    most_steps: u64,
    write: Write<'w>,
}

impl PairSearch<'_, '_> {
    /// Writes the lines up to `to`, given the contact that the ordinary search has found, and returns what they prove.
    fn run(
        &mut self,
        hint: Option<(f64, [usize; 2])>,
        to: f64,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Status, CertifyError> {
        let Some((contact, benches)) = hint else {
            let refused = self.go_to(to, progress)?;
            // Nearer to a lock no step can be shown.
            let before_lock = self.before_lock();
            return Ok(match refused {
                None if !self.sides.iter().any(|side| side.section.locks) => Status::None { time_lo: None },
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
        self.sides.iter().filter(|side| side.section.locks).find_map(|side| {
            let metres = side.chain.exact.travelled(side.section.end);
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
    fn go_to(&mut self, to: f64, progress: &mut dyn FnMut(f64)) -> Result<Option<String>, CertifyError> {
        while self.time < to {
            let moving = || self.sides.iter().filter(|side| side.is_moving(self.time));
            let of_link = |side: &Side| side.seconds(side.chain.team.shortest_link());
            let longest = moving().map(of_link).fold(f64::INFINITY, f64::min);
            let least = moving().map(|side| side.seconds(LEAST_STEP * (1.0 + side.chain.path.length())));
            let least = least.fold(4.0 * f64::EPSILON * self.time, f64::max);
            if self.step == 0.0 {
                self.step = 0.25 * longest;
            }
            // No step goes on where a dragon begins to move: until then it may be as long as one likes.
            let starts = self.sides.iter().map(|side| side.delay).filter(|start| *start > self.time);
            let until = if longest.is_finite() { to } else { starts.fold(to, f64::min) };
            let length = self.step.min(longest).min(until - self.time);
            let next = if length >= 0.9 * (until - self.time) { until } else { self.time + length };
            match self.clear_until(next) {
                Ok(line) => {
                    (self.write)(&line)?;
                    (self.time, self.step) = (next, GROWTH * length);
                    progress((next / to).clamp(0.0, 1.0));
                }
                Err(refused) if length <= least => return Ok(Some(sentence(&refused))),
                Err(_) => self.step = SHRINK * length,
            }
            self.steps += 1;
            if self.steps > self.most_steps {
                return Ok(Some(format!("the search was given up after {} steps", self.steps)));
            }
        }
        Ok(None)
    }

    /// Returns the line that no boards of the two touch from here until a time.
    fn clear_until(&self, to: f64) -> Result<CertificateLine<'static>, Refused> {
        let [one, other] = &self.sides;
        let (one, other) = (one.stretch(self.time, to, None)?, other.stretch(self.time, to, None)?);
        for (a, board) in one.boards.iter().enumerate() {
            if let Some(b) = other.boards.iter().position(|other| !board.is_apart_from(other)) {
                return Err(Refused::Pair([a, b]));
            }
        }
        let (heads, spans) = ([one.head, other.head], [one.spans, other.spans]);
        Ok(CertificateLine::Both { from: self.time, to, heads, spans })
    }

    /// Returns the line that two boards have a point in common at a time.
    fn touch(&self, time: f64, benches: [usize; 2]) -> Option<CertificateLine<'static>> {
        let [one, other] = [0, 1].map(|k| self.sides[k].stretch(time, time, Some(benches[k] + 1)).ok());
        let (one, other) = (one?, other?);
        let boards = [one.boards[benches[0]], other.boards[benches[1]]];
        let [a, b] = boards.map(|board| board.in_doubles());
        let point: [f64; 2] = overlap_centre(&a, &b).into();
        let heads = [one.head, other.head];
        let holds = boards.iter().all(|board| board.holds(point.map(Interval::point)))
            && (0..2).all(|k| self.sides[k].has_come(heads[k]));
        holds.then_some(CertificateLine::Meeting { benches, time, heads, spans: [one.spans, other.spans], point })
    }

    /// Writes the line of a contact at the nearest time after `contact` at which it is found, and returns the status.
    fn meeting(&mut self, contact: f64, benches: [usize; 2]) -> Result<Status, CertifyError> {
        let (around, most) = (self.around(), self.near().max(self.around()));
        let at_start = (contact == 0.0).then(|| self.touch(0.0, benches)).flatten().map(|line| (0.0, line));
        let mut found = at_start.or_else(|| {
            let mut far = (0..).map(|power| around * 2f64.powi(power)).take_while(|far| *far <= most);
            far.find_map(|far| self.touch(contact + far, benches).map(|line| (far, line)))
        });
        if let Some((far, _)) = &found {
            let (mut not_shown, mut far) = (if *far > around { 0.5 * far } else { *far }, *far);
            while far - not_shown > BESIDE * far {
                let middle = 0.5 * (not_shown + far);
                match self.touch(contact + middle, benches) {
                    Some(line) => (found, far) = (Some((middle, line)), middle),
                    None => not_shown = middle,
                }
            }
        }
        let Some((far, line)) = found else {
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

fn sentence(refused: &Refused) -> String {
    match refused {
        Refused::Link(link) => {
            format!("the rear handle of bench {} (counting from 1) cannot be enclosed there", link + 1)
        }
        Refused::Pair([a, b]) => format!(
            "bench {} of the first and bench {} of the second (counting from 1) come so near that doubles cannot tell \
             whether they touch",
            a + 1,
            b + 1
        ),
    }
}
