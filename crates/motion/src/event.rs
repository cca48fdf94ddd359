//! Events of a motion and the budget of a search. The searches return events; the timeline gives them times.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use bench_dragon_messages::state::EventKind;

use crate::model::Point;

/// An event at one place of the head on the path, and so at one time.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::state::EventKind;
/// use bench_dragon_motion::ensemble::Ensemble;
/// use bench_dragon_motion::event::unreported;
/// use bench_dragon_motion::model::description::PathDescription;
/// use bench_dragon_motion::model::team::{Ends, Team};
/// use bench_dragon_motion::{Method, Motion};
///
/// let (head_length, body_length) = (3.41, 2.20);
/// let team = Team { benches: 223, head_length, body_length, width: 0.30, hole_inset: 0.275, ends: Ends::NONE };
/// let path = PathDescription::Spiral { pitch: 0.55, start_turn: 16.0 };
/// let motion = Motion::new(path, team, 1.0, Method::Newton)?;
/// let timeline = Ensemble::alone(motion).timeline_without_contact(&mut unreported);
/// for timed in timeline.events() {
///     println!("{}: {} s, after {} m", timed.event.kind.name(), timed.time, timed.event.travelled);
/// }
/// let kinds: Vec<_> = timeline.events().iter().map(|timed| timed.event.kind).collect();
/// assert_eq!(kinds, [EventKind::Stall, EventKind::Lock]);
/// # Ok::<(), bench_dragon_motion::MotionError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// The kind of the event.
    pub kind: EventKind,
    /// The distance that the head has travelled along the path since the scene's start, in metres.
    pub travelled: f64,
    /// The first bench concerned: of two that touch, the bench nearer the head; else the bench that stalls, locks or
    /// reaches an obstacle.
    pub bench_a: Option<u32>,
    /// The second of two benches that touch. An obstacle stands here by its number: the number of handles plus its
    /// place on the ground.
    pub bench_b: Option<u32>,
    /// The touching point, the point of the board nearest to an obstacle, or the rear handle of a stall or lock. `None`
    /// for the path's end.
    pub place: Option<Point>,
}

/// The receiver of a search's progress: the share of the search that is done, from 0 to 1. It is called at least every
/// 50 ms. [`ControlFlow::Break`] stops the search, whose result then says how far it came; a receiver that has stopped
/// a search returns it at each later call, too.
pub type Progress<'a> = &'a mut dyn FnMut(f64) -> ControlFlow<()>;

/// The [`Progress`] of a search that is neither watched nor stopped.
pub fn unreported(_share: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// The budget of a search is spent, or the search was stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spent;

/// Work after which a search asks whether it is to stop: less than 10 ms also on a path of many pieces.
const WORK_BETWEEN_REPORTS: u64 = 2_000;

/// The time after which a thread asks again whether its search is to stop, while it waits for another thread.
const BETWEEN_REPORTS: Duration = Duration::from_millis(10);

/// Work that a search may still do, and the receiver of its progress. One unit of work is one link solved or one pair
/// of boards tested.
pub struct Budget<'a> {
    left: u64,
    progress: Progress<'a>,
    /// The share that was reported last, and the work since then.
    share: f64,
    unreported: u64,
    is_stopped: bool,
}

impl<'a> Budget<'a> {
    /// Creates a budget of `limit` units of work.
    pub fn new(limit: u64, progress: Progress<'a>) -> Self {
        Self { left: limit, progress, share: 0.0, unreported: 0, is_stopped: false }
    }

    /// Subtracts `work` units.
    ///
    /// # Errors
    /// [`Spent`] if fewer are left or the search was stopped; the budget is then empty.
    pub fn spend(&mut self, work: u64) -> Result<(), Spent> {
        self.unreported += work;
        if self.unreported >= WORK_BETWEEN_REPORTS {
            self.report(self.share);
        }
        let enough = work <= self.left && !self.is_stopped;
        self.left = self.left.saturating_sub(work);
        if enough { Ok(()) } else { Err(Spent) }
    }

    /// Reports the share of the search that is done.
    pub fn report(&mut self, share: f64) {
        (self.share, self.unreported) = (share.clamp(0.0, 1.0), 0);
        if !self.is_stopped && (self.progress)(self.share).is_break() {
            (self.left, self.is_stopped) = (0, true);
        }
    }

    /// Does both parts of a work at once, the second on a thread of its own, whose work does not count. If the search is
    /// stopped, the budgets of both parts are empty.
    pub(crate) fn both<A, B: Send>(
        &mut self,
        first: impl FnOnce(&mut Self) -> A,
        second: impl FnOnce(&mut Budget<'_>) -> B + Send,
    ) -> (A, B) {
        let is_stopped = AtomicBool::new(false);
        let (running, ended) = channel::<()>();
        std::thread::scope(|scope| {
            let second = scope.spawn(|| {
                // Dropped where the thread ends, with a panic, too.
                let _running = running;
                let mut told = |_| match is_stopped.load(Ordering::Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                };
                second(&mut Budget::new(u64::MAX, &mut told))
            });
            let first = first(self);
            is_stopped.store(self.is_stopped, Ordering::Relaxed);
            while ended.recv_timeout(BETWEEN_REPORTS) == Err(RecvTimeoutError::Timeout) {
                self.report(self.share);
                is_stopped.store(self.is_stopped, Ordering::Relaxed);
            }
            (first, second.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
        })
    }

    /// Returns true if the receiver of the progress has stopped the search.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped
    }
}
