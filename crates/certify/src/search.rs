//! The search for a certificate: steps of the head from the start to the end of the motion. A step whose claims cannot
//! be shown is halved. At each event of the ordinary search, the search writes the line that proves the event.

use std::io;

use super::capsule::Spanned;
use super::grid::{GridPoint, place};
use super::interval::Interval;
use super::lines::{CertificateLine, CertifiedEvent, Links, Status};
use super::path::{ExactPath, Place};
use super::step::{Chain, Claim, Obstacle, Shown};
use super::{CertifyError, Given};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::event::Event;
use bench_dragon_motion::model::path::Path;

/// Half width of the proved interval of an event, seconds.
const AROUND: f64 = 3e-10;

/// Distance that doubles can resolve, as a share of the path length in metres.
pub(super) const LEAST: f64 = 7e-13;

/// Factors of the step length after a step that is shown, and after a step that is not.
const GROWTH: f64 = 1.3;
const SHRINK: f64 = 0.5;

/// Distance from an event, in links, within which a failed step is explained by the event.
const NEAR: f64 = 1e-3;

pub(super) struct CertificateSearch<'a, 'w> {
    given: Given<'a>,
    chain: Chain<'a>,
    write: &'w mut dyn FnMut(&CertificateLine) -> io::Result<()>,
    /// The end of the last step.
    at: GridPoint,
    links: Links,
    /// The claims that steps still make.
    moving: bool,
    clear: bool,
    /// True if Lemma 4 may still be used.
    covered: bool,
    proofs: [Option<Status>; 4],
    /// Length of the next step to try, metres.
    step: f64,
    steps: u64,
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
    pub fn new(given: Given<'a>, write: &'w mut dyn FnMut(&CertificateLine) -> io::Result<()>) -> Self {
        let exact = ExactPath::new(given.description);
        let chain = Chain::new(given.path, exact, given.team);
        // The steps begin a little before the start: a motion that begins earlier includes this one.
        let before = -LEAST * (1.0 + given.path.length());
        let at = GridPoint::new(given.path, &chain.exact, before);
        let step = 0.25 * given.team.shortest_link();
        let (links, proofs) = (Links::All, [const { None }; 4]);
        Self { given, chain, write, at, links, moving: true, clear: true, covered: true, proofs, step, steps: 0 }
    }

    /// Writes the certificate and returns what it proves.
    pub fn run(mut self, progress: &mut dyn FnMut(f64)) -> Result<Vec<CertifiedEvent>, CertifyError> {
        let (version, scene) = (env!("CARGO_PKG_VERSION"), self.given.scene);
        (self.write)(&CertificateLine::Certificate { format: super::FORMAT, version, scene })
            .map_err(CertifyError::Write)?;
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
        let events = KINDS.map(|event| {
            let found = self.proofs[event as usize].take();
            let status = found.unwrap_or_else(|| match (&stuck, event) {
                (Some(because), _) => Status::Undecided { time_lo: until, because: because.clone() },
                (None, EventKind::PathEnd) => Status::None { time_lo: None },
                (None, _) => Status::None { time_lo: lock },
            });
            CertifiedEvent { event, status }
        });
        for event in &events {
            (self.write)(&CertificateLine::Result(event.clone())).map_err(CertifyError::Write)?;
        }
        Ok(events.into())
    }

    /// Proves the whole motion, event by event.
    fn motion(&mut self, progress: &mut dyn FnMut(f64)) -> Result<(), Halt> {
        let end = self.given.events.last().map_or(self.given.path.length(), |event| event.travelled);
        let mut progress = |at: f64| progress((at / end).clamp(0.0, 1.0));
        for event in self.given.events {
            match event.kind {
                EventKind::Contact if event.travelled == 0.0 => self.overlap_at_start(event)?,
                EventKind::PathEnd => {
                    let beyond = path_end(&self.chain.exact, self.given.path);
                    self.go_to(event.travelled - self.around(), None, &mut progress)?;
                    self.go_to_point(&beyond, None, &mut progress)?;
                    (self.write)(&CertificateLine::PathEnd)?;
                    self.proofs[EventKind::PathEnd as usize] = Some(self.at_path_end());
                }
                kind => {
                    self.go_to(event.travelled - self.around(), Some(event), &mut progress)?;
                    match kind {
                        EventKind::Contact => self.contact(event, &mut progress)?,
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
        let slack = 1e-14 * (1.0 + time.magnitude());
        Interval { lo: (time.lo - slack).max(0.0), hi: (time.hi + slack).max(0.0) }
    }

    fn grid_point(&self, travelled: f64) -> GridPoint {
        GridPoint::new(self.chain.path, &self.chain.exact, travelled)
    }

    fn at_path_end(&self) -> Status {
        let length = self.given.path.length();
        let end = place(self.given.path.param_at(length));
        let (before, after) = (self.chain.exact.moved(end, -LEAST * (1.0 + length)), self.at.head);
        Status::Proved { time_lo: self.time(before).lo, time_hi: self.time(after).hi, bench_a: None, bench_b: None }
    }

    /// Returns travels beyond an event, from near to far, at which the search tries to show it.
    fn beyond(&self, event: &Event) -> impl Iterator<Item = f64> + use<> {
        let around = self.around().max(2.0 * (event.travelled - self.at.travelled));
        let (at, most) = (event.travelled, NEAR * self.given.team.shortest_link());
        (0..24)
            .map(move |power| around * 2f64.powi(power))
            .take_while(move |far| *far <= most.max(around))
            .map(move |far| at + far)
    }

    /// Goes to a travel: see [`CertificateSearch::go_to_point`].
    fn go_to(&mut self, travelled: f64, event: Option<&Event>, progress: &mut dyn FnMut(f64)) -> Result<(), Halt> {
        if travelled <= self.at.travelled {
            return Ok(());
        }
        let target = self.grid_point(travelled);
        self.go_to_point(&target, event, progress)
    }

    /// Goes in steps to a grid point, or so near to an event that the event prevents a step. A claim that cannot be
    /// shown with any step length is given up.
    fn go_to_point(
        &mut self,
        target: &GridPoint,
        event: Option<&Event>,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(), Halt> {
        let least = 0.01 * LEAST * (1.0 + self.given.path.length());
        let longest = self.given.team.shortest_link();
        while self.at.head != target.head {
            let remaining = target.travelled - self.at.travelled;
            let mut to = if self.step >= 0.9 * remaining {
                target.clone()
            } else {
                self.grid_point(self.at.travelled + self.step)
            };
            let claim = Claim { links: self.links, moving: self.moving, clear: self.clear };
            match self.chain.show(&mut self.at, &mut to, claim) {
                Ok(shown) => {
                    self.accept(to, shown)?;
                    self.step = (self.step * GROWTH).min(longest);
                    progress(self.at.travelled);
                }
                Err(obstacle) if self.step.min(remaining) > least => {
                    self.step = SHRINK * self.step.min(remaining);
                    // The links of boards 0 and 1 do not show turns of the handles behind.
                    if self.links == Links::Front && obstacle == Obstacle::Stall(1) && !self.moving {
                        self.links = Links::All;
                    }
                }
                Err(obstacle) => {
                    let near = |event: &&Event| event.travelled - self.at.travelled < NEAR * longest;
                    if event.filter(near).is_some_and(|event| obstacle.is_of(event.kind)) {
                        return Ok(());
                    }
                    self.give_up(obstacle)?;
                }
            }
        }
        Ok(())
    }

    fn accept(&mut self, to: GridPoint, shown: Shown) -> Result<(), Halt> {
        let Shown { step, body_forward } = shown;
        let exact = &self.chain.exact;
        if self.chain.start.is_none() {
            self.chain.start = step.spans.first().map(|span| span.1);
        }
        self.covered &= body_forward;
        if !self.covered {
            self.links = Links::All;
        } else if let (Links::All, Some(start), Some(second)) = (step.links, self.chain.start, step.spans.get(1))
            && exact.in_order(start, second.0)
        {
            self.links = Links::Front;
        }
        (self.write)(&CertificateLine::Step(step))?;
        self.at = to;
        self.steps += 1;
        if self.steps > self.given.most_steps {
            return Err(Halt::Stuck(format!("the search was given up after {} steps", self.steps)));
        }
        Ok(())
    }

    /// Gives up a claim that cannot be shown here, or the whole search.
    fn give_up(&mut self, obstacle: Obstacle) -> Result<(), Halt> {
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
                Ok(())
            }
            Obstacle::Stall(link) if self.moving => {
                let because = format!(
                    "bench {} (counting from 1) comes so near a stall that doubles cannot tell whether it does",
                    link + 1
                );
                self.proofs[EventKind::Stall as usize] = Some(Status::Undecided { time_lo, because });
                self.moving = false;
                Ok(())
            }
            Obstacle::Stall(_) | Obstacle::Behind if self.links == Links::Front => {
                self.links = Links::All;
                self.covered = false;
                Ok(())
            }
            Obstacle::Link(link) => Err(Halt::Stuck(format!(
                "the rear handle of bench {} (counting from 1) cannot be enclosed there",
                link + 1
            ))),
            Obstacle::Stall(_) | Obstacle::Behind | Obstacle::Pair(..) => {
                Err(Halt::Stuck(format!("a step cannot be shown there: {obstacle:?}")))
            }
        }
    }

    fn proved(&self, from: Place, to: Place, bench_a: Option<u32>, bench_b: Option<u32>) -> Status {
        let [bench_a, bench_b] = [bench_a, bench_b].map(|bench| bench.map(|bench| bench as usize));
        Status::Proved { time_lo: self.time(from).lo, time_hi: self.time(to).hi, bench_a, bench_b }
    }

    /// Handles boards that overlap at the start.
    fn overlap_at_start(&mut self, event: &Event) -> Result<(), Halt> {
        let (from, mut to) = (self.at.clone(), self.grid_point(LEAST * (1.0 + self.given.path.length())));
        self.clear = false;
        let status = if self.touch(event, from, &mut to)? {
            let [bench_a, bench_b] = [event.bench_a, event.bench_b].map(|bench| bench.map(|bench| bench as usize));
            Status::Proved { time_lo: 0.0, time_hi: 0.0, bench_a, bench_b }
        } else {
            let because = "the boards that overlap from the start overlap too little for doubles".to_owned();
            Status::Undecided { time_lo: 0.0, because }
        };
        self.proofs[EventKind::Contact as usize] = Some(status);
        Ok(())
    }

    /// Writes the contact line if two boards are proved to have a common point while the head is between two grid
    /// points. Returns true if so.
    fn touch(&mut self, event: &Event, mut from: GridPoint, to: &mut GridPoint) -> Result<bool, Halt> {
        let benches = [event.bench_a, event.bench_b].map(|bench| bench.unwrap_or(0) as usize);
        let Some(handles) = self.chain.spans(&mut from, to, benches[1] + 1) else { return Ok(false) };
        let Some(point) = self.chain.common_point(&handles, benches) else { return Ok(false) };
        let spans = handles[1..].iter().map(|handle| handle.span).collect();
        (self.write)(&CertificateLine::Contact { benches, from: from.head, to: to.head, spans, point })?;
        Ok(true)
    }

    fn contact(&mut self, event: &Event, progress: &mut dyn FnMut(f64)) -> Result<(), Halt> {
        if !self.clear {
            return Ok(());
        }
        let earliest = self.at.head;
        self.clear = false;
        for travelled in self.beyond(event) {
            self.go_to(travelled, None, progress)?;
            let (from, mut to) = (self.at.clone(), self.at.clone());
            if self.touch(event, from, &mut to)? {
                let status = self.proved(earliest, self.at.head, event.bench_a, event.bench_b);
                self.proofs[EventKind::Contact as usize] = Some(status);
                return Ok(());
            }
        }
        let because = "doubles cannot tell whether the boards touch that come so near".to_owned();
        let status = Status::Undecided { time_lo: self.time(earliest).lo, because };
        self.proofs[EventKind::Contact as usize] = Some(status);
        Ok(())
    }

    fn stall(&mut self, event: &Event, progress: &mut dyn FnMut(f64)) -> Result<(), Halt> {
        if !self.moving {
            return Ok(());
        }
        let earliest = self.at.head;
        let link = event.bench_a.unwrap_or(0) as usize;
        self.moving = false;
        if link > 0 {
            self.links = Links::All;
        }
        for travelled in self.beyond(event) {
            self.go_to(travelled, None, progress)?;
            let (mut from, mut to) = (self.at.clone(), self.at.clone());
            let handles = self.chain.spans(&mut from, &mut to, link + 1);
            let stalled =
                |handles: &Vec<Spanned>| handles[link].capsule.product(&handles[link + 1].capsule, false).is_negative();
            if let Some(handles) = handles.filter(stalled) {
                let (head, spans) = (self.at.head, handles[1..].iter().map(|handle| handle.span).collect());
                (self.write)(&CertificateLine::Stall { link, from: head, to: head, spans })?;
                self.proofs[EventKind::Stall as usize] = Some(self.proved(earliest, head, event.bench_a, None));
                return Ok(());
            }
        }
        let because = "doubles cannot tell whether the link stalls that comes so near a stall".to_owned();
        self.proofs[EventKind::Stall as usize] = Some(Status::Undecided { time_lo: self.time(earliest).lo, because });
        Ok(())
    }

    fn lock(&mut self, event: &Event) -> Result<(), Halt> {
        let link = event.bench_a.unwrap_or(0) as usize;
        for travelled in self.beyond(event) {
            let mut to = self.grid_point(travelled);
            let Some(handles) = self.chain.spans(&mut self.at, &mut to, link) else { continue };
            let mut end = to.clone();
            let Some(last) = self.chain.spans(&mut to, &mut end, link) else { continue };
            let (window, jump) = match self.chain.lock_window(&mut self.at, link, &handles[link], &last[link]) {
                Some(window) => (Some(window), None),
                None => (None, self.chain.lock_jump(&mut self.at, link, &handles[link], &last[link])),
            };
            if window.is_none() && jump.is_none() {
                continue;
            }
            let spans = |handles: &[Spanned]| handles[1..].iter().map(|handle| handle.span).collect();
            let line =
                CertificateLine::Lock { link, to: to.head, spans: spans(&handles), last: spans(&last), window, jump };
            (self.write)(&line)?;
            self.proofs[EventKind::Lock as usize] = Some(self.proved(self.at.head, to.head, event.bench_a, None));
            return Ok(());
        }
        Err(Halt::Stuck(format!("doubles cannot tell whether bench {} (counting from 1) locks there", link + 1)))
    }
}

/// Returns a grid point at the path's end or beyond it.
pub(super) fn path_end(exact: &ExactPath, path: &Path) -> GridPoint {
    let length = path.length();
    let end = place(path.param_at(length));
    let beyond = exact.moved(end, LEAST * (1.0 + length));
    let inward = matches!(exact.segments[beyond.0].curve, super::path::Curve::Inward { .. });
    let head = if inward { Place(beyond.0, 0.0) } else { beyond };
    GridPoint::at(head, length)
}
