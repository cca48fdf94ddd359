//! The alert rules: from the timeline and the clearance to a level that does not flicker, and the alerts that go out.
//!
//! Called by the show, once a frame.

use crate::messages::State;
use crate::motion::clearance::PairClearance;
use crate::motion::event::EventKind;
use crate::motion::timeline::{TimedEvent, Timeline};
use crate::scene::AlertRules;

use super::state_of;

/// More alerts than this cannot go with one frame: each event once, and one for approaching or clear.
pub const MOST_PER_FRAME: usize = 8;

/// How far clearance must have opened again, as a multiple of the clearance that raised the level: without a gap
/// between the two, a clearance that swings about the threshold would make the level flicker.
const HYSTERESIS_RATIO: f64 = 1.5;

/// How long it must have stayed that open, as a share of the approach time. The gap alone does not do: as the paper's
/// head passes from one bench to the next its clearance swings from 0.050 m up to 0.082 m and back within 4 s, and
/// stays above 0.075 m for 0.6 s of them.
const RELEASE_HOLD: f64 = 0.1;

/// A change of the alert level or a step of the countdown: what of a
/// [`CollisionAlert`](crate::messages::CollisionAlert) does not depend on clocks and runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alert {
    /// The level, up to `Lock`; `Moving` is called clear.
    pub level: State,
    /// Simulated seconds of the event, NaN where there is none.
    pub event_time: f64,
    /// `event_time` minus the frame's time.
    pub time_to_event: f64,
    /// Metres between the nearest two boards.
    pub clearance: f64,
    /// The place, metres; NaN where there is none.
    pub x: f64,
    /// The place, metres; NaN where there is none.
    pub y: f64,
    /// The first bench concerned.
    pub bench_a: Option<u32>,
    /// The second bench concerned.
    pub bench_b: Option<u32>,
}

/// The level now, and what is needed to decide the next.
#[derive(Debug, Clone)]
pub struct AlertLevel {
    rules: AlertRules,
    rate: f64,
    level: State,
    /// Nothing has been sent yet: the current level goes out whatever it is.
    fresh: bool,
    /// The tick of the show at which the level was last announced as new.
    since: u64,
    /// Whole seconds of wall time since then that have been counted down.
    counted: u64,
    /// Time of the last frame of this show; before the first, none.
    previous: Option<f64>,
    /// Since when the clearance has been open enough to release the level.
    open_since: Option<f64>,
}

impl AlertLevel {
    /// The level before the first frame of a show at `rate` frames per second.
    pub fn new(rules: AlertRules, rate: f64) -> Self {
        Self { rules, rate, level: State::Moving, fresh: true, since: 0, counted: 0, previous: None, open_since: None }
    }

    /// The level now.
    pub fn current(&self) -> State {
        self.level
    }

    /// The show begins again: the next frame decides the level anew.
    pub fn restart(&mut self) {
        self.previous = None;
        self.open_since = None;
        self.since = 0;
        self.counted = 0;
    }

    /// Decides the level of a frame and adds the alerts that go with it.
    ///
    /// Every event since the last frame is announced, however many a step has passed, so that what a subscriber hears
    /// does not depend on the rate; the first frame of a show announces only where it stands.
    pub fn update(
        &mut self,
        tick_of_show: u64,
        sim_time: f64,
        timeline: &Timeline,
        closest: Option<PairClearance>,
        alerts: &mut Vec<Alert>,
    ) {
        let clearance = closest.map_or(f64::NAN, |closest| closest.value);
        let dangers = timeline.events().iter().filter(|timed| timed.event.kind != EventKind::PathEnd);
        let passed = dangers.filter(|timed| timed.time <= sim_time);
        let announced = match self.previous {
            Some(previous) => passed.clone().filter(|timed| timed.time > previous).count(),
            None => passed.clone().count().min(1),
        };
        let happened = passed.clone().count();
        for timed in passed.skip(happened - announced) {
            let level = state_of(timed.event.kind);
            if self.fresh || self.level != level {
                self.announce(level, tick_of_show);
                alerts.push(of_event(timed, sim_time, clearance));
            }
        }
        if happened == 0 {
            let next = timeline.next_alertable(sim_time);
            let level = self.level_ahead(sim_time, clearance, next);
            let changed = self.fresh || level != self.level;
            if changed {
                self.announce(level, tick_of_show);
            }
            if changed || (level == State::Approaching && self.counts_down(tick_of_show)) {
                alerts.push(of_approach(level, sim_time, next, closest));
            }
        }
        self.previous = Some(sim_time);
    }

    fn announce(&mut self, level: State, tick_of_show: u64) {
        self.level = level;
        self.fresh = false;
        self.since = tick_of_show;
        self.counted = 0;
    }

    /// `Approaching` or `Moving`, where no event has passed.
    fn level_ahead(&mut self, sim_time: f64, clearance: f64, next: Option<&TimedEvent>) -> State {
        let soon = next.is_some_and(|timed| timed.time - sim_time <= self.rules.approach_time);
        let standing = self.level == State::Approaching && self.previous.is_some();
        let threshold = self.rules.approach_clearance;
        // NaN, where there are no two boards to compare, is never near.
        let closed = clearance <= HYSTERESIS_RATIO * threshold;
        self.open_since = if closed { None } else { self.open_since.or(Some(sim_time)) };
        let calm = self.open_since.is_some_and(|since| sim_time - since >= RELEASE_HOLD * self.rules.approach_time);
        let near = if standing { !calm } else { clearance < threshold };
        if soon || near { State::Approaching } else { State::Moving }
    }

    /// Whether another second of wall time has passed since the level was announced.
    fn counts_down(&mut self, tick_of_show: u64) -> bool {
        let seconds = ((tick_of_show - self.since) as f64 / self.rate) as u64;
        let due = seconds > self.counted;
        self.counted = seconds;
        due
    }
}

fn of_event(timed: &TimedEvent, sim_time: f64, clearance: f64) -> Alert {
    let TimedEvent { event, time } = *timed;
    Alert {
        level: state_of(event.kind),
        event_time: time,
        time_to_event: time - sim_time,
        clearance,
        x: event.place.map_or(f64::NAN, |place| place.x),
        y: event.place.map_or(f64::NAN, |place| place.y),
        bench_a: event.bench_a,
        bench_b: event.bench_b,
    }
}

fn of_approach(level: State, sim_time: f64, next: Option<&TimedEvent>, closest: Option<PairClearance>) -> Alert {
    let event_time = next.map_or(f64::NAN, |timed| timed.time);
    let place = closest.map(|closest| nalgebra::center(&closest.point_a, &closest.point_b));
    Alert {
        level,
        event_time,
        time_to_event: event_time - sim_time,
        clearance: closest.map_or(f64::NAN, |closest| closest.value),
        x: place.map_or(f64::NAN, |place| place.x),
        y: place.map_or(f64::NAN, |place| place.y),
        bench_a: closest.map(|closest| closest.bench_a as u32),
        bench_b: closest.map(|closest| closest.bench_b as u32),
    }
}
