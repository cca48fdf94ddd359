//! Events of a motion and the budget of a search. The searches return events; the timeline gives them times.

use bench_dragon_messages::state::EventKind;

use crate::model::Point;

/// An event at one place of the head on the path, and so at one time.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::state::EventKind;
/// use bench_dragon_show::scene::Scene;
///
/// let timeline = Scene::paper().ensemble.timeline_without_contact();
/// for timed in timeline.events() {
///     println!("{}: {} s, after {} m", timed.event.kind.name(), timed.time, timed.event.travelled);
/// }
/// let kinds: Vec<_> = timeline.events().iter().map(|timed| timed.event.kind).collect();
/// assert_eq!(kinds, [EventKind::Stall, EventKind::Lock]);
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

/// The budget of a search is spent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spent;

/// Work that a search may still do, and the receiver of its progress. One unit of work is one link solved or one pair
/// of boards tested.
pub struct Budget<'a> {
    left: u64,
    progress: &'a mut dyn FnMut(f64),
}

impl<'a> Budget<'a> {
    /// Creates a budget of `limit` units of work. `progress` is called at times with the share of the search that is
    /// done, from 0 to 1.
    pub fn new(limit: u64, progress: &'a mut dyn FnMut(f64)) -> Self {
        Self { left: limit, progress }
    }

    /// Subtracts `work` units.
    ///
    /// # Errors
    /// [`Spent`] if fewer are left; the budget is then empty.
    pub fn spend(&mut self, work: u64) -> Result<(), Spent> {
        let enough = work <= self.left;
        self.left = self.left.saturating_sub(work);
        if enough { Ok(()) } else { Err(Spent) }
    }

    /// Reports the share of the search that is done.
    pub fn report(&mut self, share: f64) {
        (self.progress)(share.clamp(0.0, 1.0));
    }
}
