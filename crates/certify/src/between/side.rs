//! One of two dragons as a function of the show's time: the places of its handles and boards from one time to another.
//! Lemma 12 of `docs/proofs.md`.

use crate::boards::MovingBoard;
use crate::capsule::{Frame, Spanned};
use crate::first_order::{FirstOrderBoard, Pace};
use crate::first_order_step::{FirstOrderStep, step_points};
use crate::grid::GridPoint;
use crate::interval::Interval;
use crate::lines::Links;
use crate::path::ExactPath;
use crate::place::{Place, Span};
use crate::search::{LEAST, Section, path_end};
use crate::step::{Chain, Claim, Listed};
use bench_dragon_motion::ensemble::Dragon;
use bench_dragon_motion::event::Event;

/// Rounding of the time at which a dragon comes to its path's end, as a share.
const END_SLACK: f64 = 1e-13;

/// One of two dragons, as a function of time.
pub(super) struct Side<'a> {
    pub chain: Chain<'a>,
    frame: Frame,
    pub delay: f64,
    pub head_speed: f64,
    /// The time at which its motion ends, in seconds.
    pub end: f64,
    /// True if it ends with a lock.
    pub locks: bool,
    /// The results of the section of its events.
    pub section: Option<&'a Section>,
}

/// A dragon's handles and boards on the stage over a stretch of time.
pub(super) struct Stretch {
    pub head: Span,
    pub spans: Vec<Span>,
    pub boards: Vec<MovingBoard>,
    /// A place of each span, the head's first, and the boards to the first order. There tau is the time from the middle
    /// of the stretch. Both are empty unless they are requested.
    pub at: Vec<Place>,
    pub first_order: Vec<FirstOrderBoard>,
}

/// The reason why a stretch of time is not shown.
pub(super) enum Refused {
    Link(usize),
    /// A board of each dragon.
    Pair([usize; 2]),
}

/// The handles of a dragon that a stretch must have.
#[derive(Debug, Clone, Copy)]
pub(super) enum Extent {
    /// All handles, or all but those on a line without a beginning, whose boards are taken as one.
    Whole,
    /// The handles of the benches up to this one.
    UpTo(usize),
}

impl<'a> Side<'a> {
    /// Creates a dragon whose own motion ends with an event.
    pub fn new(dragon: &'a Dragon, end: Event, locks: bool, section: Option<&'a Section>) -> Self {
        let Dragon { delay, motion, .. } = dragon;
        let chain = Chain::new(motion.path(), ExactPath::new(motion.description()), motion.team());
        let head_speed = motion.head_speed();
        // A little later: beyond the path's end the dragon stands.
        let slack = if locks { 0.0 } else { END_SLACK };
        let end = (delay + end.travelled / head_speed) * (1.0 + slack) + slack;
        Self { chain, frame: Frame::new(motion.placement()), delay: *delay, head_speed, end, locks, section }
    }

    /// Returns the metres that the head has travelled at a time.
    fn travelled(&self, time: Interval) -> Interval {
        let metres = (time - Interval::point(self.delay)) * self.head_speed;
        metres.max(Interval::ZERO).min(Interval::point(self.chain.path.length()))
    }

    /// Returns grid points that the head is surely between from one time to another.
    fn ends(&self, from: f64, to: f64) -> Option<[GridPoint; 2]> {
        let Chain { path, exact, .. } = &self.chain;
        let [first, last] = [from, to].map(|time| self.travelled(Interval::point(time)));
        let before = GridPoint::beside(path, exact, first.lo, -1.0, |at| at.hi <= first.lo)?;
        let is_at_end = last.hi >= path.length() * (1.0 - LEAST) - LEAST;
        let after = if is_at_end {
            Some(path_end(exact, path))
        } else {
            GridPoint::beside(path, exact, last.hi, 1.0, |at| at.lo >= last.hi)
        };
        Some([before, after?])
    }

    /// Encloses the handles from one time to another.
    pub fn stretch(&self, from: f64, to: f64, extent: Extent) -> Result<Stretch, Refused> {
        let [mut first, mut last] = self.ends(from, to).ok_or(Refused::Link(0))?;
        let head = Span(first.head, last.head);
        let claim = Claim { links: Links::All, moving: false, clear: false };
        let mut listed = Listed::new(&self.chain, head, last.travelled - first.travelled);
        while !self.is_enough(&listed, extent) {
            let link = listed.handles.len() - 1;
            listed.extend(&mut first, &mut last, claim).map_err(|_| Refused::Link(link))?;
        }
        Ok(self.stretch_of(&listed, extent))
    }

    /// Encloses the handles from one time to another to the first order.
    pub fn first_order(&self, from: f64, to: f64, extent: Extent) -> Result<Stretch, Refused> {
        let Chain { path, exact, .. } = &self.chain;
        let [mut first, mut last] = self.ends(from, to).ok_or(Refused::Link(0))?;
        let [begin, end] = [from, to].map(Interval::point);
        let middle_time = (begin + end) * 0.5;
        let travelled = self.travelled(middle_time);
        let mut middle = GridPoint::new(path, exact, travelled.middle());
        if !(exact.in_order(first.head, middle.head) && exact.in_order(middle.head, last.head)) {
            middle = GridPoint::at(first.head, first.travelled);
        }
        let half_step = (middle_time - begin).max(end - middle_time).hi;
        let pace = |at| {
            let offset = (exact.travelled(at) - travelled).magnitude();
            Pace { rate: self.speed_between(from, to), offset, half_step }
        };
        let mut step = FirstOrderStep::with_pace(&self.chain, &step_points(&mut first, &mut middle, &mut last), pace);
        while !self.is_enough(&step.listed, extent) {
            let link = step.listed.handles.len() - 1;
            let points = step_points(&mut first, &mut middle, &mut last);
            step.extend(points, Links::All).map_err(|_| Refused::Link(link))?;
        }
        let stretch = self.stretch_of(&step.listed, extent);
        let listed = step.listed.handles.len() - 1;
        let board = |bench: usize| if bench < listed { step.board(bench) } else { step.straight_run(bench) };
        let all = self.chain.runs(listed).filter(|first| *first < self.chain.team.benches);
        let benches = (0..listed).chain(all).take(stretch.boards.len());
        let first_order = benches.map(|bench| board(bench).placed(&self.frame)).collect();
        Ok(Stretch { at: step.places, first_order, ..stretch })
    }

    fn is_enough(&self, listed: &Listed, extent: Extent) -> bool {
        let handles = listed.handles.len();
        handles > 1
            && match extent {
                Extent::UpTo(bench) => handles > bench + 1,
                Extent::Whole => handles > self.chain.team.benches || listed.is_on_line(handles - 1),
            }
    }

    fn stretch_of(&self, listed: &Listed, extent: Extent) -> Stretch {
        let boards: Vec<MovingBoard> = match extent {
            Extent::UpTo(bench) => (0..=bench).map(|bench| self.chain.board(&listed.handles, bench)).collect(),
            Extent::Whole => listed.boards_on_ground(Links::All).into_iter().map(|(_, board)| board).collect(),
        };
        let boards = boards.iter().map(|board| board.placed(self.chain.shape(0).inset, &self.frame)).collect();
        let spans = listed.handles[1..].iter().map(|handle: &Spanned| handle.span).collect();
        Stretch { head: listed.handles[0].span, spans, boards, at: Vec::new(), first_order: Vec::new() }
    }

    /// Returns the times at which the head begins to move and comes to the path's end: the second is between two.
    pub fn breaks(&self) -> [f64; 3] {
        let end = self.delay + self.chain.path.length() / self.head_speed;
        let slack = END_SLACK * (1.0 + end);
        [self.delay, end - slack, end + slack]
    }

    /// Returns the head's speed from one time to another.
    fn speed_between(&self, from: f64, to: f64) -> Interval {
        let [begin, last, end] = self.breaks();
        if to <= begin || from >= end {
            Interval::ZERO
        } else if from >= begin && to <= last {
            Interval::point(self.head_speed)
        } else {
            Interval { lo: 0.0, hi: self.head_speed }
        }
    }

    /// Returns true if the section of the dragon's events proves that the motion continues up to a place of the head.
    /// Returns true without a section, too.
    pub fn has_come(&self, Span(_, to): Span) -> bool {
        self.section.is_none_or(|section| section.ends_with_path || self.chain.exact.in_order(to, section.end))
    }

    pub fn is_moving(&self, time: f64) -> bool {
        time >= self.delay && time < self.end
    }

    /// Returns the seconds in which the head travels some metres.
    pub fn seconds(&self, metres: f64) -> f64 {
        metres / self.head_speed
    }
}

/// Returns the reason for people why a stretch is not shown.
pub(super) fn sentence(refused: &Refused) -> String {
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
