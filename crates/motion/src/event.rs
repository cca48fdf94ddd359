//! What can happen in a motion, and how far a search for it came. The searches return these; the timeline turns them into
//! times.

use bench_dragon_messages::state::EventKind;

use crate::model::Point;

/// Something that happens at one place of the head on the path, and so at one time.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::state::EventKind;
/// use bench_dragon_show::scene::Scene;
///
/// let motion = Scene::paper().motion;
/// let timeline = motion.timeline_without_contact();
/// for timed in timeline.events() {
///     println!("{}: {} s, after {} m", timed.event.kind.name(), timed.time, timed.event.travelled);
/// }
/// let kinds: Vec<_> = timeline.events().iter().map(|timed| timed.event.kind).collect();
/// assert_eq!(kinds, [EventKind::Stall, EventKind::Lock]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// What happens.
    pub kind: EventKind,
    /// Metres that the head has travelled along the path since the scene's start.
    pub travelled: f64,
    /// The first bench concerned: of the two that touch the one nearer the head, or the one that stalls or locks.
    pub bench_a: Option<u32>,
    /// The second of two benches that touch.
    pub bench_b: Option<u32>,
    /// Where: the touching point; the rear handle of a stall or lock. `None` for the path's end.
    pub place: Option<Point>,
}

/// How much a search may still do, and who receives its progress. One unit of work is one link solved, or one pair of
/// boards tested.
pub struct Budget<'a> {
    left: u64,
    progress: &'a mut dyn FnMut(f64),
}

impl<'a> Budget<'a> {
    /// A budget of so many units of work. `progress` is called now and then with the share of the search that is done,
    /// from 0 to 1.
    pub fn new(limit: u64, progress: &'a mut dyn FnMut(f64)) -> Self {
        Self { left: limit, progress }
    }

    /// Takes some work off the budget; false where there is not that much left, and then nothing is left.
    #[must_use]
    pub fn spend(&mut self, work: u64) -> bool {
        let enough = work <= self.left;
        self.left = self.left.saturating_sub(work);
        enough
    }

    /// Reports which share of the search is done.
    pub fn report(&mut self, share: f64) {
        (self.progress)(share.clamp(0.0, 1.0));
    }
}
