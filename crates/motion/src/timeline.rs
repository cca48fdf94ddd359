//! The events of a motion with their times.

use super::contact::{LeastClearance, ObstacleClearance};
use super::event::Event;
use bench_dragon_messages::state::EventKind;

/// An event and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedEvent {
    /// Kind and place of the event.
    pub event: Event,
    /// Simulated seconds since the start of the scene.
    pub time: f64,
}

/// The least clearance of a show and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedClearance {
    /// The clearance, its two benches, and the place of the head.
    pub least: LeastClearance,
    /// Simulated seconds since the start of the scene.
    pub time: f64,
    /// Simulated seconds up to which the search is complete, if it gave up before its end.
    pub searched_until: Option<f64>,
}

/// The least clearance of an obstacle over a show, and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedObstacleClearance {
    /// The obstacle's number on its ground.
    pub obstacle: usize,
    /// The clearance, its bench, and the place of the head.
    pub least: ObstacleClearance,
    /// Simulated seconds since the start of the scene.
    pub time: f64,
    /// Simulated seconds up to which the search is complete, if it gave up before its end.
    pub searched_until: Option<f64>,
}

/// The first event of each kind that happens, and of each obstacle, in order of time; the last one ends the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    events: Vec<TimedEvent>,
    /// The path ends of dragons that stand while others continue, in order of time.
    standing: Vec<TimedEvent>,
    searched_until: Option<f64>,
    is_stopped: bool,
}

impl Timeline {
    /// Creates the timeline of events in any order, one of them a lock or path end. `searched_until` is the simulated
    /// time at which a search gave up before the motion's end.
    pub fn new(mut events: Vec<TimedEvent>, searched_until: Option<f64>) -> Self {
        // At one time, in the order of the kinds.
        let ends = |timed: &TimedEvent| matches!(timed.event.kind, EventKind::Lock | EventKind::PathEnd);
        events.sort_by(|a, b| {
            let by_time = a.time.total_cmp(&b.time).then(a.event.kind.cmp(&b.event.kind));
            ends(a).cmp(&ends(b)).then(by_time).then(a.event.bench_b.cmp(&b.event.bench_b))
        });
        Self { events, standing: Vec::new(), searched_until, is_stopped: false }
    }

    /// Returns the timeline with the path ends of dragons that stand while others continue. These path ends change no
    /// state.
    pub fn with_standing(mut self, mut standing: Vec<TimedEvent>) -> Self {
        standing.sort_by(|a, b| a.time.total_cmp(&b.time));
        self.standing = standing;
        self
    }

    /// Returns all events in order of time: also the path ends of dragons that stand while others continue.
    pub fn all(&self) -> Vec<TimedEvent> {
        let mut all = self.events.clone();
        for end in &self.standing {
            let at = all.partition_point(|timed| timed.time <= end.time).min(all.len() - 1);
            all.insert(at, *end);
        }
        all
    }

    /// Returns the timeline with the last event only.
    pub fn end_only(mut self) -> Self {
        self.events.drain(..self.events.len() - 1);
        self.standing.clear();
        self
    }

    /// Returns the events in order of time.
    pub fn events(&self) -> &[TimedEvent] {
        &self.events
    }

    /// Returns the simulated seconds up to which the searches are complete, if one gave up: later events may be
    /// missing.
    pub fn searched_until(&self) -> Option<f64> {
        self.searched_until
    }

    /// Returns the timeline of a search that was stopped, if `is_stopped` is true. Where the search came no further,
    /// nothing is known.
    pub fn stopped(mut self, is_stopped: bool) -> Self {
        self.is_stopped = is_stopped;
        if is_stopped {
            self.searched_until.get_or_insert(0.0);
        }
        self
    }

    /// Returns true if the search was stopped by the receiver of its progress. Then `searched_until` is a time.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped
    }

    /// Returns the first event of a kind, if there is one.
    pub fn find(&self, kind: EventKind) -> Option<&TimedEvent> {
        self.events.iter().find(|timed| timed.event.kind == kind)
    }

    /// Returns the lock or path end with which the motion ends.
    pub fn end(&self) -> &TimedEvent {
        // Every constructor leaves the end in place.
        &self.events[self.events.len() - 1]
    }

    /// Returns the event at which a show ends: the first contact or obstacle if it stops there, else the motion's end.
    pub fn show_end(&self, stops_at_contact: bool) -> &TimedEvent {
        let touches = |timed: &&TimedEvent| matches!(timed.event.kind, EventKind::Contact | EventKind::Obstacle);
        self.events.iter().find(touches).filter(|_| stops_at_contact).unwrap_or(self.end())
    }

    /// Makes room for one more event, so that [`Timeline::record_touch`] does not allocate.
    pub fn reserve_touch(&mut self) {
        self.events.reserve(1);
    }

    /// Replaces the predicted contact, or the predicted touch of the same obstacle, by a measured one.
    pub fn record_touch(&mut self, touch: TimedEvent) {
        let (kind, obstacle) = (touch.event.kind, touch.event.bench_b);
        let is_other = |of: &Event| of.kind != kind || (kind == EventKind::Obstacle && of.bench_b != obstacle);
        self.events.retain(|timed| is_other(&timed.event));
        let at = self.events.partition_point(|timed| timed.time <= touch.time).min(self.events.len() - 1);
        self.events.insert(at, touch);
    }

    /// Returns the latest event at or before a time.
    pub fn latest_passed(&self, sim_time: f64) -> Option<&TimedEvent> {
        self.events.iter().rev().find(|timed| timed.time <= sim_time)
    }

    /// Returns the next contact, obstacle, stall or lock after a time.
    pub fn next_alertable(&self, sim_time: f64) -> Option<&TimedEvent> {
        self.events.iter().find(|timed| timed.time > sim_time && timed.event.kind != EventKind::PathEnd)
    }
}
