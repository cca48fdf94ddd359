//! The events of a scene with their times.
//!
//! The scene and its path give the places; this room turns them into simulated seconds. The show, `events`, `solve`
//! and `draw` use it.

use crate::chain::Team;
use crate::events::contact::first_contact;
use crate::events::sweep::{LeastClearance, Sweep};
use crate::events::{self, Event};
use crate::geometry::path::Path;
use crate::geometry::pieces::PiecePath;
use crate::messages::State;
use crate::scene::path::ScenePath;
use crate::scene::{OnContact, Scene};

/// An event and when it happens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedEvent {
    /// What happens and where.
    pub event: Event,
    /// Simulated seconds since the start of the scene.
    pub time: f64,
}

/// The least clearance of a show and when it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedClearance {
    /// How near, which two, and where the head is then.
    pub least: LeastClearance,
    /// Simulated seconds since the start of the scene.
    pub time: f64,
}

/// The first event of each kind that happens, in order of time; the last one ends the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    events: Vec<TimedEvent>,
}

impl Timeline {
    /// All events of a scene, contact included. `progress` is told which share of the search is done, from 0 to 1.
    pub fn of(scene: &Scene, progress: &mut dyn FnMut(f64)) -> Self {
        let mut events = stall_and_end(scene);
        // The motion always has an end: that is the last of these.
        let end = events[events.len() - 1].travelled;
        let stall = events.iter().find(|event| event.kind == State::Stall).map(|event| event.travelled);
        events.extend(match &scene.path {
            ScenePath::Spiral(spiral) => first_contact(spiral, &scene.team, stall, end, progress),
            ScenePath::Pieces(path) => contact_on_pieces(path, &scene.team, stall, end, progress),
        });
        Self::timed(scene, events)
    }

    /// The events of a scene but for the contact, which costs a search.
    pub fn without_contact(scene: &Scene) -> Self {
        Self::timed(scene, stall_and_end(scene))
    }

    fn timed(scene: &Scene, events: Vec<Event>) -> Self {
        let timed = |event: Event| TimedEvent { event, time: scene.time_of(event.travelled) };
        let mut events: Vec<_> = events.into_iter().map(timed).collect();
        // At one time, the order of the states.
        events.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.event.kind.cmp(&b.event.kind)));
        Self { events }
    }

    /// Without all but the last event.
    pub fn end_only(mut self) -> Self {
        self.events.drain(..self.events.len() - 1);
        self
    }

    /// The events in order of time.
    pub fn events(&self) -> &[TimedEvent] {
        &self.events
    }

    /// The event of a kind, if it happens.
    pub fn find(&self, kind: State) -> Option<&TimedEvent> {
        self.events.iter().find(|timed| timed.event.kind == kind)
    }

    /// The lock or path end with which the motion ends.
    pub fn end(&self) -> &TimedEvent {
        // Every constructor leaves the end in place.
        &self.events[self.events.len() - 1]
    }

    /// The event at which a show freezes.
    pub fn freeze(&self, on_contact: OnContact) -> &TimedEvent {
        match (on_contact, self.find(State::Contact)) {
            (OnContact::Stop, Some(contact)) => contact,
            _ => self.end(),
        }
    }

    /// Simulated seconds at which a show freezes.
    pub fn freeze_time(&self, on_contact: OnContact) -> f64 {
        self.freeze(on_contact).time
    }

    /// The least clearance of the whole show, up to where it freezes. `None` under three benches, and where it would
    /// take too long: see [`MOST_LOOKS`]. `progress` is told which share of the search is done, from 0 to 1.
    pub fn least_clearance(&self, scene: &Scene, progress: &mut dyn FnMut(f64)) -> Option<TimedClearance> {
        let freeze = self.freeze(scene.on_contact).event;
        // Until boards touch for the first time their clearance is above what it is then.
        let from = self.find(State::Contact).map_or(0.0, |contact| contact.event.travelled);
        let stall = self.find(State::Stall).map(|stall| stall.event.travelled);
        let least = match &scene.path {
            ScenePath::Spiral(spiral) => least_from(spiral, &scene.team, stall, from, freeze.travelled, progress),
            ScenePath::Pieces(path) => least_from(path, &scene.team, stall, from, freeze.travelled, progress),
        }?;
        Some(TimedClearance { least, time: scene.time_of(least.travelled) })
    }

    /// The latest event at or before a time.
    pub fn latest_passed(&self, sim_time: f64) -> Option<&TimedEvent> {
        self.events.iter().rev().find(|timed| timed.time <= sim_time)
    }

    /// The next contact, stall or lock after a time.
    pub fn next_danger(&self, sim_time: f64) -> Option<&TimedEvent> {
        self.events.iter().find(|timed| timed.time > sim_time && timed.event.kind != State::PathEnd)
    }
}

/// Boards looked at, times places of the head, beyond which the least clearance of a show is not searched for: about
/// half a minute.
pub const MOST_LOOKS: f64 = 2e8;

fn least_from<P: Path>(
    path: &P,
    team: &Team,
    stall: Option<f64>,
    from: f64,
    to: f64,
    progress: &mut dyn FnMut(f64),
) -> Option<LeastClearance> {
    let sweep = Sweep::new(path, team, stall);
    if sweep.looks(from, to) * team.benches as f64 > MOST_LOOKS {
        return None;
    }
    sweep.least_clearance(from, to, progress)
}

fn stall_and_end(scene: &Scene) -> Vec<Event> {
    match &scene.path {
        ScenePath::Spiral(spiral) => events::stall_and_end(spiral, &scene.team),
        ScenePath::Pieces(path) => events::course::stall_and_end(path, &scene.team),
    }
}

/// The first contact on a path of pieces. As long as the head comes in on a spiral, all of the team is on it, and the
/// spiral's own search is the faster one.
fn contact_on_pieces(
    path: &PiecePath,
    team: &Team,
    stall: Option<f64>,
    end: f64,
    progress: &mut dyn FnMut(f64),
) -> Option<Event> {
    let approach = path.approach().filter(|(_, until)| *until > 0.0);
    let (from, found) = match approach {
        Some((spiral, until)) => {
            let until = until.min(end);
            let stall = stall.filter(|stall| *stall < until);
            (until, first_contact(&spiral, team, stall, until, &mut |share| progress(share * until / end)))
        }
        None => (0.0, None),
    };
    found.or_else(|| {
        let sweep = Sweep::new(path, team, stall);
        sweep.first_contact(from, end, &mut |share| progress((from + share * (end - from)) / end))
    })
}
