//! The search for a certificate: steps of the head from the start to the end of the motion. A step is halved if its
//! claims cannot be shown. At each event of the ordinary search, the search writes the line that proves the event.

mod events;

use std::io;
use std::ops::ControlFlow;

use super::branch::Branch;
use super::grid::{GridPoint, place};
use super::ground::Barrier;
use super::interval::Interval;
use super::lines::{CertificateLine, CertifiedEvent, CertifiedResult, Links, Status, WIDE};
use super::path::ExactPath;
use super::place::{Place, Span};
use super::step::{Chain, Claim, Obstacle, Shown};
use super::walk::{Covered, Next, Walk, Walker, Way};
use super::{CertifyError, Given};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::event::{Event, Progress};
use bench_dragon_motion::model::path::Path;

/// The half width of the proved interval of an event, in seconds.
pub(super) const AROUND: f64 = 1e-10;

/// The distance that doubles can resolve, as a share of the path length in metres.
pub(super) const LEAST: f64 = 1e-14;

/// Rounding of a time, as a share of one second and the time.
const OF_TIMES: f64 = 1e-14;

/// The shortest step, as a share of the path length in metres.
pub(super) const LEAST_STEP: f64 = 2e-15;

/// Limit of the spans in the steps about one dragon: some 400 MB.
pub(super) const MOST_SPANS: usize = 10_000_000;

/// The distance from an event, in links, within which a failed step is explained by the event.
pub(super) const NEAR: f64 = 1e-3;

pub(super) struct CertificateSearch<'a, 'w> {
    given: Given<'a>,
    chain: Chain<'a>,
    write: &'w mut dyn FnMut(&CertificateLine) -> io::Result<()>,
    /// The end of the last step.
    at: GridPoint,
    /// The spans of the last step, from handle 1 on.
    spans: Vec<Span>,
    covered: Covered,
    /// The claims that steps still make.
    moving: bool,
    clear: bool,
    proofs: [Option<Status>; 4],
    /// True if the path's end is shown.
    ends_with_path: bool,
    /// The obstacles that steps still claim to avoid, and the result of each obstacle.
    free: Vec<usize>,
    of_obstacles: Vec<Option<Status>>,
    walk: Walk,
    /// Spans that were written.
    written: usize,
}

/// The proved results of the lines about one dragon.
pub(super) struct Section {
    pub events: Vec<CertifiedEvent>,
    /// The place of the head at the end of the last step.
    pub end: Place,
    pub ends_with_path: bool,
    pub locks: bool,
}

/// Writes the first line of a certificate of events.
pub(super) fn first_line(
    write: &mut dyn FnMut(&CertificateLine) -> io::Result<()>,
    scene: &str,
) -> Result<(), CertifyError> {
    let (version, format) = (env!("CARGO_PKG_VERSION"), super::FORMAT);
    Ok(write(&CertificateLine::Certificate { format, version, about: None, scene })?)
}

/// The reason for the end of a search.
enum Halt {
    Error(CertifyError),
    /// No step from the current place can be shown.
    Stuck(String),
}

impl From<io::Error> for Halt {
    fn from(error: io::Error) -> Self {
        Self::Error(CertifyError::Write(error))
    }
}

const KINDS: [EventKind; 4] = [EventKind::Contact, EventKind::Stall, EventKind::Lock, EventKind::PathEnd];

impl<'a, 'w> CertificateSearch<'a, 'w> {
    pub fn new(
        given: Given<'a>,
        barriers: Vec<Barrier>,
        write: &'w mut dyn FnMut(&CertificateLine) -> io::Result<()>,
    ) -> Self {
        let exact = ExactPath::new(given.description);
        let mut chain = Chain::new(given.path, exact, given.team);
        chain.barriers = barriers;
        // The steps begin a little before the start: a motion that begins earlier includes this one.
        let before = -LEAST * (1.0 + given.path.length());
        let at = GridPoint::new(given.path, &chain.exact, before);
        let proofs = [const { None }; 4];
        let (free, of_obstacles) = ((0..chain.barriers.len()).collect(), chain.barriers.iter().map(|_| None).collect());
        Self {
            given,
            chain,
            write,
            at,
            spans: Vec::new(),
            covered: Covered::new(),
            moving: true,
            clear: true,
            proofs,
            ends_with_path: false,
            free,
            of_obstacles,
            walk: Walk::new(given.team.shortest_link(), given.most_steps),
            written: 0,
        }
    }

    /// Takes another enclosure of the same path, which may be turned about the path's origin.
    pub fn on_path(mut self, exact: ExactPath) -> Self {
        self.at = GridPoint::new(self.given.path, &exact, self.at.travelled);
        self.chain.exact = exact;
        self
    }

    /// Lets boards that are not further apart than some metres count as touching.
    pub fn with_clearance(mut self, metres: f64) -> Self {
        self.chain.clearance = metres;
        self
    }

    /// Leaves boards out: nothing is claimed of a contact.
    pub fn without_boards(mut self) -> Self {
        self.clear = false;
        let because = "boards are left out".to_owned();
        self.proofs[EventKind::Contact as usize] = Some(Status::Undecided { time_lo: 0.0, because });
        self
    }

    /// Writes the certificate and returns the results for its events.
    pub fn run(self, progress: Progress<'_>) -> Result<Vec<CertifiedEvent>, CertifyError> {
        first_line(&mut *self.write, self.given.scene)?;
        Ok(self.section(progress)?.events)
    }

    /// Writes the lines after the first, and returns their results.
    pub fn section(mut self, progress: Progress<'_>) -> Result<Section, CertifyError> {
        let lines: Vec<_> = self.chain.branches.iter().map(Branch::line).collect();
        lines.iter().try_for_each(&mut *self.write).map_err(CertifyError::Write)?;
        let stuck = match self.motion(progress) {
            Ok(()) => None,
            Err(Halt::Error(error)) => return Err(error),
            Err(Halt::Stuck(why)) => Some(why),
        };
        let until = self.time(self.at.head).lo;
        let lock = match self.proofs[EventKind::Lock as usize] {
            Some(Status::Proved { time_lo, .. }) => Some(time_lo),
            _ => None,
        };
        let found = std::mem::take(&mut self.of_obstacles).into_iter().enumerate();
        let found = found.map(|(number, found)| (EventKind::Obstacle, Some(number), found));
        let kinds = KINDS.map(|event| (event, None, self.proofs[event as usize].take()));
        let events: Vec<_> = (kinds.into_iter().chain(found))
            .map(|(event, obstacle, found)| {
                let status = found.unwrap_or_else(|| match (&stuck, event) {
                    (Some(because), _) => Status::Undecided { time_lo: until, because: because.clone() },
                    (None, EventKind::PathEnd) => Status::None { time_lo: None },
                    (None, _) => Status::None { time_lo: lock },
                });
                let dragons = self.given.dragon.iter().map(|(dragon, _)| *dragon).collect();
                CertifiedEvent { event, obstacle, dragons, status }
            })
            .collect();
        for event in &events {
            (self.write)(&CertificateLine::Result(CertifiedResult::Event(event.clone())))
                .map_err(CertifyError::Write)?;
        }
        Ok(Section { events, end: self.at.head, ends_with_path: self.ends_with_path, locks: lock.is_some() })
    }

    /// Proves the whole motion, event by event.
    fn motion(&mut self, progress: Progress<'_>) -> Result<(), Halt> {
        let end = self.given.events.last().map_or(self.given.path.length(), |event| event.travelled);
        // A search of a long path, or of a long team, may end with its limits long before the path does.
        let mut progress = |at: f64, used: f64| progress((at / end).max(used).clamp(0.0, 1.0));
        for event in self.given.events {
            match event.kind {
                EventKind::Contact | EventKind::Obstacle if event.travelled == 0.0 => self.touch_at_start(event)?,
                EventKind::PathEnd => {
                    let beyond = path_end(&self.chain.exact, self.given.path);
                    self.go_to(event.travelled - self.around(), None, &mut progress)?;
                    self.go_to_point(&beyond, None, &mut progress)?;
                    (self.write)(&CertificateLine::PathEnd)?;
                    self.ends_with_path = true;
                    self.proofs[EventKind::PathEnd as usize] = Some(self.at_path_end());
                }
                kind => {
                    self.go_to(event.travelled - self.around(), Some(event), &mut progress)?;
                    match kind {
                        EventKind::Contact | EventKind::Obstacle => self.touch(event, &mut progress)?,
                        EventKind::Stall => self.stall(event, &mut progress)?,
                        _ => self.lock(event)?,
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns the metres on each side of an event.
    fn around(&self) -> f64 {
        (AROUND * self.given.head_speed).min(1e-8).max(LEAST * (1.0 + self.given.path.length()))
    }

    /// Returns an enclosure of the time at a place of the head, at least 0.
    fn time(&self, place: Place) -> Interval {
        let time = self.chain.exact.travelled(place).over(Interval::point(self.given.head_speed));
        // Covers the rounding of a `lead_in` that the scene gives in other digits.
        let slack = OF_TIMES * (1.0 + time.magnitude());
        let (lo, hi) = (time.lo - slack, time.hi + slack);
        match self.given.dragon {
            // At its start it is from 0 on.
            Some((_, delay)) if delay > 0.0 => {
                let later = |seconds: f64| Interval::point(seconds) + Interval::point(delay);
                Interval {
                    lo: if lo > 0.0 { later(lo).lo } else { 0.0 },
                    hi: if hi > 0.0 { later(hi).hi } else { 0.0 },
                }
            }
            _ => Interval { lo: lo.max(0.0), hi: hi.max(0.0) },
        }
    }

    fn grid_point(&self, travelled: f64) -> GridPoint {
        GridPoint::new(self.chain.path, &self.chain.exact, travelled)
    }

    fn at_path_end(&self) -> Status {
        let length = self.given.path.length();
        let end = place(self.given.path.param_at(length));
        let (before, after) = (self.chain.exact.moved(end, -LEAST * (1.0 + length), false), self.at.head);
        self.proved(EventKind::PathEnd, before, after, [None; 2])
    }

    /// Goes to a travel: see [`CertificateSearch::go_to_point`].
    fn go_to(
        &mut self,
        travelled: f64,
        event: Option<&Event>,
        progress: &mut dyn FnMut(f64, f64) -> ControlFlow<()>,
    ) -> Result<(), Halt> {
        if travelled <= self.at.travelled {
            return Ok(());
        }
        let target = self.grid_point(travelled);
        self.go_to_point(&target, event, progress)
    }

    /// Goes in steps to a grid point, or so near to an event that the event prevents a step. A claim that cannot be
    /// shown with any step length is given up. `progress` receives the travel and the share of the limits.
    fn go_to_point(
        &mut self,
        target: &GridPoint,
        event: Option<&Event>,
        progress: &mut dyn FnMut(f64, f64) -> ControlFlow<()>,
    ) -> Result<(), Halt> {
        let walked = self.walk_to((target, event), |search| progress(search.at.travelled, search.used()))?;
        walked.map_or(Ok(()), |because| Err(Halt::Stuck(because)))
    }

    /// Returns the share of its limits that the search has used.
    fn used(&self) -> f64 {
        let of_steps = self.walk.steps as f64 / self.given.most_steps as f64;
        of_steps.max(self.written as f64 / self.given.most_spans as f64)
    }

    /// Writes and counts a step that is shown, and takes its end as the place of the search.
    fn accept(&mut self, to: GridPoint, shown: Shown) -> io::Result<Next> {
        let Shown { step, body_forward } = shown;
        self.covered.add(&mut self.chain, &step.spans, body_forward);
        let line = CertificateLine::Step(step);
        (self.write)(&line)?;
        if let CertificateLine::Step(step) = line {
            self.written += step.spans.len();
            self.spans = step.spans;
        }
        self.at = to;
        self.walk.steps += 1;
        // The limit of the steps goes first.
        if self.written <= self.given.most_spans || self.walk.steps > self.given.most_steps {
            return Ok(Next::Longer);
        }
        Ok(Next::End(Some(format!(
            "the search was given up after {} steps: its certificate has more than {:e} places of handles",
            self.walk.steps,
            2 * self.given.most_spans
        ))))
    }

    /// Gives up a claim that cannot be shown here, or the whole search.
    fn give_up(&mut self, obstacle: Obstacle) -> Next {
        let time_lo = self.time(self.at.head).lo;
        match obstacle {
            Obstacle::Pair(a, b) if self.clear => {
                let because = format!(
                    "benches {} and {} (counting from 1) come so near that doubles cannot tell whether they touch",
                    a + 1,
                    b + 1
                );
                self.proofs[EventKind::Contact as usize] = Some(Status::Undecided { time_lo, because });
                self.clear = false;
            }
            Obstacle::Stall(link) if self.moving => {
                let because = format!(
                    "bench {} (counting from 1) comes so near a stall that doubles cannot tell whether it does",
                    link + 1
                );
                self.proofs[EventKind::Stall as usize] = Some(Status::Undecided { time_lo, because });
                self.moving = false;
            }
            Obstacle::Stage(number) => {
                let because =
                    "a board comes so near the obstacle that doubles cannot tell whether it meets it".to_owned();
                self.of_obstacles[number] = Some(Status::Undecided { time_lo, because });
                self.free.retain(|other| *other != number);
            }
            Obstacle::Stall(_) | Obstacle::Behind if self.covered.give_up() => {}
            Obstacle::Link(link) => {
                let why = format!("the rear handle of bench {} (counting from 1) cannot be enclosed there", link + 1);
                return Next::End(Some(why));
            }
            Obstacle::Stall(_) | Obstacle::Behind | Obstacle::Pair(..) => {
                return Next::End(Some(format!("a step cannot be shown there: {obstacle:?}")));
            }
        }
        Next::Same
    }

    fn proved(&self, event: EventKind, from: Place, to: Place, benches: [Option<u32>; 2]) -> Status {
        let [bench_a, bench_b] = benches.map(|bench| bench.map(|bench| bench as usize));
        let (time_lo, time_hi) = (self.time(from).lo, self.time(to).hi);
        let because = (time_hi - time_lo > WIDE).then(|| {
            let around = LEAST * (1.0 + self.given.path.length()) / self.given.head_speed;
            // Handles and boards have the rounding of several operations on each side of an event.
            let resolved = 10.0 * around + 2.0 * OF_TIMES * (1.0 + time_hi);
            match event {
                _ if time_hi - time_lo <= resolved => {
                    let metres = self.given.path.length();
                    format!("doubles resolve a path of {metres:.3e} m at this speed to no less than {resolved:.1e} s")
                }
                EventKind::Contact => {
                    "the boards meet so slowly that rounding hides the contact for so long".to_owned()
                }
                _ => "rounding of the handles' places hides the event for so long".to_owned(),
            }
        });
        Status::Proved { time_lo, time_hi, bench_a, bench_b, because }
    }
}

/// The target of a walk, and the event there that may prevent the last steps.
type Target<'t> = (&'t GridPoint, Option<&'t Event>);

impl<'t> Walker<Target<'t>> for CertificateSearch<'_, '_> {
    fn walk(&mut self) -> &mut Walk {
        &mut self.walk
    }

    fn way(&self, to @ (target, event): Target<'t>) -> Option<Way<Target<'t>>> {
        let least = LEAST_STEP * (1.0 + self.given.path.length());
        // The window of a lock must be around the spans of the last step.
        let lock = event.filter(|event| event.kind == EventKind::Lock);
        let before_lock = lock.map(|lock| (0.5 * (lock.travelled - self.at.travelled)).max(least));
        let longest = self.given.team.shortest_link().min(before_lock.unwrap_or(f64::INFINITY));
        let remaining = target.travelled - self.at.travelled;
        self.chain.exact.is_before(self.at.head, target.head).then_some(Way { to, remaining, longest, least })
    }

    fn step(&mut self, (target, event): Target<'t>, length: Option<f64>, is_least: bool) -> io::Result<Next> {
        let mut to = self.at.towards(target, length, self.chain.path, &self.chain.exact);
        let claim = Claim { links: self.covered.links, moving: self.moving, clear: self.clear };
        let near = event.filter(|event| event.travelled - self.at.travelled < NEAR * self.given.team.shortest_link());
        match self.chain.show(&mut self.at, &mut to, claim, &self.free) {
            Ok(shown) => self.accept(to, shown),
            Err(obstacle) if !is_least => {
                // The links of boards 0 and 1 do not show turns of the handles behind.
                if obstacle == Obstacle::Stall(1) && !self.moving {
                    self.covered.links = Links::All;
                }
                Ok(Next::Shorter)
            }
            Err(obstacle) if near.is_some_and(|event| obstacle.is_of(event.kind)) => Ok(Next::End(None)),
            Err(obstacle) => Ok(self.give_up(obstacle)),
        }
    }
}

/// Returns a grid point at the path's end or beyond it.
pub(super) fn path_end(exact: &ExactPath, path: &Path) -> GridPoint {
    let length = path.length();
    let end = place(path.param_at(length));
    let beyond = exact.moved(end, LEAST * (1.0 + length), false);
    // An inward spiral that is the whole path ends at its centre.
    let head = if exact.segments.len() == 1 { Place(0, 0.0, 0.0) } else { beyond };
    GridPoint::at(head, length)
}
