//! Enclosures of the least clearance of two boards in a show, and of the least clearance of each obstacle. Steps of the
//! head prove the lower bound of each enclosure, and one place proves its upper bound. Lemmas 6 and 11 of
//! `docs/proofs.md`.

mod apart;
mod beside;
mod certificate;
mod enclosures;
mod steps;

use std::io;

use super::CertifyError;
use super::branch::Branch;
use super::first_order::When;
use super::first_order_step::{FirstOrderStep, step_points};
use super::grid::GridPoint;
use super::ground;
use super::interval::Interval;
use super::lines::{CertificateLine, Links};
use super::path::ExactPath;
use super::place::Place;
use super::search::{LEAST, path_end};
use super::step::{Chain, Obstacle};
use super::walk::{Covered, Walk};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::Motion;
use bench_dragon_motion::contact::LeastClearance;
use bench_dragon_motion::event::{Event, Progress};
use bench_dragon_motion::timeline::TimedEvent;
use beside::{Beside, UpperBeside};
pub(super) use certificate::first_line as clearance_first_line;
pub use enclosures::{ClearanceEnclosure, ClearanceEnclosures, ClearanceHints, ObstacleEnclosure};

/// The width of the enclosure in metres, with room for the rounding of both ends.
const WIDTH: f64 = 0.9e-9;

/// The difference, in metres, by which a new upper bound must be lower than the one before.
const LOWER: f64 = 1e-3 * WIDTH;

/// Rounding error of the show's end, as a share of the path length in metres.
const END_SLACK: f64 = 1e-13;

/// The margin of an upper bound before the end of a show, unless the show ends with the path. The margin is the sum of
/// a share of the travel and a number of distances of grid points.
const BEFORE_TIME: f64 = 4e-14;
const GRID: f64 = 8.0;

/// The distances in metres before a lock at which the search may stop, tried in this order. The nearer the stop, the
/// less the lost handle can still move.
const BEFORE_LOCK: [f64; 3] = [1e-9, 3e-11, 1e-12];

/// The distance behind a contact, in links, at which boards are expected to overlap surely.
const TOUCH: f64 = 1e-3;

/// The default limit of steps.
pub const MOST_CLEARANCE_STEPS: u64 = 100_000;

/// Encloses the least clearances of a dragon, and writes its section of the certificate, without its first line.
///
/// # Errors
/// [`CertifyError::Write`]
pub(super) fn certify_part(
    motion: &Motion,
    part: Part,
    show_end: &TimedEvent,
    hints: ClearanceHints<'_>,
    most_steps: u64,
    write: Write<'_>,
    progress: Progress<'_>,
) -> Result<ClearanceEnclosures, CertifyError> {
    let descent = Descent::new(chain_of(motion), show_end.event.travelled, most_steps, Some(write));
    let mut descent = Descent { part, ..descent };
    let lines: Vec<_> = descent.chain.branches.iter().map(Branch::line).collect();
    lines.iter().for_each(|line| descent.write(line));
    let nothing = ClearanceEnclosures { boards: None, obstacles: vec![None; motion.ground().obstacles().len()] };
    let has_hints = hints.boards.is_some() || !hints.obstacles.is_empty();
    let enclosures = if has_hints { descent.run(motion, show_end, hints, progress) } else { nothing };
    descent.write_result(motion.head_speed())?;
    Ok(enclosures)
}

/// A function that receives each line of a certificate.
pub type Write<'w> = &'w mut dyn FnMut(&CertificateLine) -> io::Result<()>;

/// Returns true if all boards of a motion are proved to stay outside the keep-outs of its stage, and no link to lock,
/// from the start until the head has travelled `to` metres.
pub(super) fn stays_outside(motion: &Motion, to: f64, progress: Progress<'_>) -> bool {
    if !motion.search_branches(progress) {
        return false;
    }
    let mut descent = Descent::new(chain_of(motion), to, MOST_CLEARANCE_STEPS, None);
    let length = motion.path().length();
    let target = if to < length {
        descent.beside(to, 1.0, |travelled| travelled.lo >= to)
    } else {
        Some(path_end(&descent.chain.exact, motion.path()))
    };
    // A clearance of more than 0 is to be shown.
    let outside = UpperBeside { value: WIDTH, travelled: 0.0, head: [descent.at.head; 2], bench: 0 };
    descent.beside.iter_mut().for_each(|beside| beside.upper = Some(outside));
    let is_at_end = target.is_some_and(|target| descent.go_to(&target, progress).is_none());
    let is_shown = |beside: &Beside| !beside.is_lost && beside.shown.is_some_and(|(least, _)| least >= 0.0);
    is_at_end && descent.beside.iter().all(is_shown)
}

fn chain_of(motion: &Motion) -> Chain<'_> {
    let chain = Chain::new(motion.path(), ExactPath::new(motion.description()), motion.team());
    Chain { barriers: ground::barriers(motion), ..chain }
}

/// A step that was not shown completely.
struct Refused {
    obstacle: Obstacle,
    nearer: Option<Nearer>,
}

/// A lower upper bound, found where a step is refused.
enum Nearer {
    Boards(Upper),
    Obstacle(usize, UpperBeside),
}

/// An upper bound of the clearance of two boards, and its place.
#[derive(Debug, Clone, Copy)]
struct Upper {
    value: f64,
    travelled: f64,
    /// The first and the last place of the head.
    head: [Place; 2],
    benches: [usize; 2],
}

/// The state of one search.
pub(super) struct Descent<'a, 'w> {
    chain: Chain<'a>,
    write: Option<Write<'w>>,
    /// The error that ended the writing.
    failed: Option<io::Error>,
    /// The least threshold of the steps that were shown, and the end of the last of them.
    shown: Option<(f64, Place)>,
    /// The end of the certified stretch.
    finish: Option<Finish>,
    at: GridPoint,
    covered: Covered,
    walk: Walk,
    /// The travel at the end of the show, in metres.
    end: f64,
    /// The travel up to which a place may show an upper bound, in metres.
    latest: f64,
    /// The upper bound that is known. Boards are tested only if this or `floor` is set.
    upper: Option<Upper>,
    /// A fixed lower bound to prove, in metres.
    floor: Option<f64>,
    /// The bounds of the clearance of each obstacle so far.
    beside: Vec<Beside>,
    /// True if the steps have come to the end of the show.
    is_complete: bool,
    /// The place of the motion in the show.
    part: Part,
}

/// The place of a motion in a show of dragons with names.
#[derive(Debug, Clone, Default)]
pub(super) struct Part {
    /// The dragon; empty without a name.
    pub dragons: Vec<usize>,
    /// The time of the show, in seconds, during which it stands at its start.
    pub delay: f64,
    /// The time at which the show ends, in seconds, if the dragon does not end it itself.
    pub show_end: Option<f64>,
}

/// The end of the show, as a certificate states it.
#[derive(Debug, Clone, Copy)]
enum Finish {
    PathEnd,
    /// The benches of the first contact.
    Contact([usize; 2]),
}

impl<'a, 'w> Descent<'a, 'w> {
    /// Creates a search from the start to `end`, metres of travel. `write` receives each step that is shown.
    pub fn new(chain: Chain<'a>, end: f64, most_steps: u64, write: Option<Write<'w>>) -> Self {
        let at = GridPoint::at(Place(0, 0.0, 0.0), 0.0);
        let beside = vec![Beside::default(); chain.barriers.len()];
        let walk = Walk::new(chain.team.shortest_link(), most_steps);
        let mut descent = Self {
            chain,
            write,
            failed: None,
            shown: None,
            finish: None,
            at,
            covered: Covered::new(),
            walk: Walk { growth: steps::GROWTH, shrinks: steps::SHRINKS, ..walk },
            end,
            latest: end,
            upper: None,
            floor: None,
            beside,
            is_complete: false,
            part: Part::default(),
        };
        let before = -LEAST * (1.0 + descent.chain.path.length());
        descent.at =
            descent.beside(0.0, -1.0, |travelled| travelled.hi <= 0.0).unwrap_or_else(|| descent.grid_point(before));
        descent
    }

    /// Encloses the least clearances of a show.
    fn run(
        &mut self,
        motion: &Motion,
        show_end: &TimedEvent,
        ClearanceHints { boards: hint, obstacles }: ClearanceHints<'_>,
        progress: Progress<'_>,
    ) -> ClearanceEnclosures {
        let (path, event) = (motion.path(), &show_end.event);
        let slack = END_SLACK * (1.0 + path.length());
        self.end = match event.kind {
            EventKind::Contact | EventKind::Obstacle | EventKind::PathEnd => (event.travelled - slack).max(0.0),
            EventKind::Stall | EventKind::Lock => event.travelled - slack.max(BEFORE_LOCK[0]),
        };
        self.latest = match event.kind {
            EventKind::PathEnd => self.end,
            // The certificate ends by a time that is rounded down, so a place after that time would show nothing.
            _ => {
                let last = self.chain.exact.travelled(self.grid_point(self.end).head).lo.min(self.end);
                let delayed = self.part.delay * motion.head_speed();
                last - BEFORE_TIME * (last + delayed) - GRID * f64::EPSILON * (1.0 + path.length())
            }
        };
        let is_at_start = event.travelled == 0.0;
        self.begin_beside(obstacles, is_at_start);
        let boards = match event.kind {
            EventKind::Contact | EventKind::Obstacle if is_at_start => self.at_start(hint, progress),
            EventKind::Contact => self.touch(event, progress),
            // The end is taken as found, so the steps go beyond it.
            EventKind::Obstacle => {
                let (path, end) = (path.length(), event.travelled);
                let target = self.beside(end, 1.0, |travelled| travelled.lo >= end && travelled.hi <= path);
                target.and_then(|target| self.least(hint, &target, progress))
            }
            EventKind::PathEnd => {
                let target = path_end(&self.chain.exact, path);
                let enclosed = self.least(hint, &target, progress);
                self.finish = self.is_complete.then_some(Finish::PathEnd);
                enclosed
            }
            EventKind::Stall | EventKind::Lock => {
                if self.end > 0.0 {
                    self.least_until_lock(event, hint, progress)
                } else {
                    None
                }
            }
        };
        ClearanceEnclosures { boards, obstacles: self.enclosed_beside() }
    }

    /// Returns the nearest grid point on one side of a place for which `holds` is proved.
    fn beside(&self, travelled: f64, side: f64, holds: impl Fn(Interval) -> bool) -> Option<GridPoint> {
        GridPoint::beside(self.chain.path, &self.chain.exact, travelled, side, holds)
    }

    /// Encloses the least clearance from the start to `target`.
    fn least(
        &mut self,
        hint: Option<&LeastClearance>,
        target: &GridPoint,
        progress: Progress<'_>,
    ) -> Option<ClearanceEnclosure> {
        let until = self.descend(hint, target, progress)?;
        self.is_complete = until.is_none();
        Some(self.enclosed(self.upper?, until))
    }

    /// Encloses the least clearance of a show that ends with a lock.
    fn least_until_lock(
        &mut self,
        lock: &Event,
        hint: Option<&LeastClearance>,
        progress: Progress<'_>,
    ) -> Option<ClearanceEnclosure> {
        let target = self.grid_point(self.end);
        if let Some(until) = self.descend(hint, &target, progress)? {
            return Some(self.enclosed(self.upper?, Some(until)));
        }
        let is_shown = BEFORE_LOCK.iter().any(|before| {
            let target = self.grid_point(lock.travelled - before);
            // An incomplete approach is no error: the lock is tried from there.
            let _ = self.at.travelled < target.travelled && self.go_to(&target, progress).is_some();
            self.stays_to_lock(lock)
        });
        self.is_complete = is_shown;
        let until = (!is_shown).then(|| self.travelled());
        Some(self.enclosed(self.upper?, until))
    }

    /// Goes to `target`. Returns the travel that it reached if it stopped before; `None` if the hint cannot be shown.
    fn descend(
        &mut self,
        hint: Option<&LeastClearance>,
        target: &GridPoint,
        progress: Progress<'_>,
    ) -> Option<Option<f64>> {
        if let Some(hint) = hint {
            let point = self.inside(hint.travelled)?;
            let benches = [hint.bench_a, hint.bench_b].map(|bench| bench as usize);
            self.upper = Some(self.upper_between(point.clone(), point, benches)?);
        }
        Some(self.go_to(target, progress))
    }

    /// Returns the nearest grid point that is surely inside the show.
    fn inside(&self, travelled: f64) -> Option<GridPoint> {
        let end = self.latest.max(0.0);
        let side = if travelled < 0.5 * end { 1.0 } else { -1.0 };
        self.beside(travelled.clamp(0.0, end), side, |travelled| travelled.lo >= 0.0 && travelled.hi <= end)
    }

    /// Returns the metres of travel up to which the search has come.
    fn travelled(&self) -> f64 {
        self.chain.exact.travelled(self.at.head).lo.max(0.0)
    }

    /// Restricts the steps to the first two links, for an inward spiral. Precondition: while the head or any link's
    /// front handle is at the first place or further out, no two boards touch and no link locks. See "The least pitch"
    /// in `docs/proofs.md`.
    pub fn after_all_further_out(mut self) -> Self {
        self.covered.links = Links::Front;
        self.chain.start = Some(Place(0, f64::INFINITY, 0.0));
        self
    }

    /// Returns the place of the head.
    pub fn head(&self) -> Place {
        self.at.head
    }

    /// Returns true if boards are further apart than `metres`, and no link locks, from the start to `target`.
    pub fn stays_apart_to(mut self, target: &GridPoint, metres: f64, progress: Progress<'_>) -> bool {
        self.floor = Some(metres);
        self.go_to(target, progress).is_none()
    }

    /// Encloses the least clearance of a show that ends at its start.
    fn at_start(&mut self, hint: Option<&LeastClearance>, progress: Progress<'_>) -> Option<ClearanceEnclosure> {
        let after = self.after_start()?;
        if let Some(hint) = hint {
            let benches = [hint.bench_a, hint.bench_b].map(|bench| bench as usize);
            self.upper = Some(self.upper_between(self.at.clone(), after.clone(), benches)?);
        }
        let until = self.go_to(&after, progress);
        self.is_complete = until.is_none();
        Some(self.enclosed(self.upper?, until))
    }

    /// Returns the first grid point that is surely not before the start.
    fn after_start(&self) -> Option<GridPoint> {
        self.beside(0.0, 1.0, |travelled| travelled.lo >= 0.0)
    }

    /// Encloses the least clearance of a show that ends at its first contact. This clearance is 0 if boards are apart
    /// at the start, overlap shortly after the contact, and handles move continuously between the two.
    fn touch(&mut self, event: &Event, progress: Progress<'_>) -> Option<ClearanceEnclosure> {
        let benches = [event.bench_a?, event.bench_b?].map(|bench| bench as usize);
        let after = self.after_start()?;
        self.floor = Some(0.0);
        let mut until = self.go_to(&after, progress);
        self.floor = None;
        let far = TOUCH * self.chain.team.shortest_link();
        let (overlapping, contact) =
            (0..40).map(|power| 1e-12 * 2f64.powi(power)).take_while(|beyond| *beyond < far).find_map(|beyond| {
                let point = self.grid_point(event.travelled + beyond);
                let contact = self.is_before_path_end(&point).then(|| self.overlap(&point, benches))??;
                let upper = self.upper_between(point.clone(), point.clone(), benches)?;
                (upper.value < 0.0).then_some((point, contact))
            })?;
        // Without the steps to it, this place shows no upper bound: no step that tests boards comes so far.
        let touch = Upper { value: 0.0, travelled: event.travelled, head: [overlapping.head; 2], benches };
        until = until.or_else(|| self.go_to(&overlapping, progress));
        self.is_complete = until.is_none();
        if until.is_none() {
            self.write(&contact);
            self.finish = Some(Finish::Contact(benches));
        }
        self.upper = Some(touch);
        until.is_none().then(|| ClearanceEnclosure { lo: 0.0, ..self.enclosed(touch, None) })
    }

    /// Returns true if a place is surely not beyond the path's end.
    fn is_before_path_end(&self, point: &GridPoint) -> bool {
        let length = self.chain.path.length();
        self.chain.exact.travelled(point.head).hi <= length - END_SLACK * (1.0 + length)
    }

    fn enclosed(&self, upper: Upper, until: Option<f64>) -> ClearanceEnclosure {
        let Upper { value: hi, travelled, benches: [bench_a, bench_b], .. } = upper;
        ClearanceEnclosure { lo: self.threshold(), hi, travelled, bench_a, bench_b, until, steps: self.walk.steps }
    }

    /// Returns an upper bound of the clearance of two boards with the head anywhere between two places.
    fn upper_between(&self, mut from: GridPoint, mut to: GridPoint, benches: [usize; 2]) -> Option<Upper> {
        let (mut middle, head) = (from.clone(), [from.head, to.head]);
        let mut first_order = FirstOrderStep::new(&self.chain, &step_points(&mut from, &mut middle, &mut to));
        while first_order.listed.handles.len() <= benches[1] + 1 {
            first_order.extend(step_points(&mut from, &mut middle, &mut to), Links::All).ok()?;
        }
        let [one, other] = benches.map(|bench| first_order.board(bench));
        Some(Upper { value: one.at_most(&other, When::Always), travelled: to.travelled, head, benches })
    }

    fn looks_at_boards(&self) -> bool {
        self.floor.is_some() || self.upper.is_some()
    }

    /// Returns the clearance in metres that pairs of boards must exceed.
    fn threshold(&self) -> f64 {
        self.floor.or(self.upper.map(|upper| upper.value - WIDTH)).unwrap_or(f64::NEG_INFINITY)
    }

    pub fn grid_point(&self, travelled: f64) -> GridPoint {
        GridPoint::new(self.chain.path, &self.chain.exact, travelled)
    }
}
