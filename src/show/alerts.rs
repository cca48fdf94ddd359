//! The alert rules: from the timeline and the clearance to a level that does not flicker, and the alerts that go out.
//!
//! Called by the show, once a frame.

use crate::motion::clearance::PairClearance;
use crate::motion::timeline::{TimedEvent, Timeline};
use crate::scene::AlertRules;

use super::state::Level;

/// More alerts than this cannot go with one frame: each event once, and one for approaching or clear.
pub const MOST_PER_FRAME: usize = 8;

/// How far clearance must have opened again, as a multiple of the clearance that raised the level: without a gap
/// between the two, a clearance that swings about the threshold would make the level flicker.
const HYSTERESIS_RATIO: f64 = 1.5;

/// How long it must have stayed that open, as a share of the approach time. The gap alone does not do: as the paper's
/// head passes from one bench to the next its clearance swings from 0.050 m up to 0.082 m and back within 4 s, and
/// stays above 0.075 m for 0.6 s of them.
const RELEASE_HOLD: f64 = 0.1;

/// A change of the alert level or a step of the countdown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alert {
    /// The level.
    pub level: Level,
    /// What the alert is about: the next contact, stall or lock while the level is clear or approaching, if there is
    /// one; else the one that has happened.
    pub event: Option<TimedEvent>,
    /// The nearest two boards in the frame; `None` under three benches.
    pub nearest: Option<PairClearance>,
}

/// The level now, and what is needed to decide the next.
#[derive(Debug, Clone)]
pub struct LevelTracker {
    rules: AlertRules,
    rate: f64,
    level: Level,
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

impl LevelTracker {
    /// The level before the first frame of a show at `rate` frames per second.
    pub fn new(rules: AlertRules, rate: f64) -> Self {
        Self { rules, rate, level: Level::Clear, fresh: true, since: 0, counted: 0, previous: None, open_since: None }
    }

    /// The level now.
    pub fn current(&self) -> Level {
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
        let alertable = timeline.events().iter().filter_map(|timed| Some((timed, Level::of(timed.event.kind)?)));
        let passed = alertable.filter(|(timed, _)| timed.time <= sim_time);
        let announced = match self.previous {
            Some(previous) => passed.clone().filter(|(timed, _)| timed.time > previous).count(),
            None => passed.clone().count().min(1),
        };
        let happened = passed.clone().count();
        for (timed, level) in passed.skip(happened - announced) {
            if self.fresh || self.level != level {
                self.announce(level, tick_of_show);
                alerts.push(Alert { level, event: Some(*timed), nearest: closest });
            }
        }
        if happened == 0 {
            let next = timeline.next_alertable(sim_time);
            let level = self.level_ahead(sim_time, clearance, next);
            let changed = self.fresh || level != self.level;
            if changed {
                self.announce(level, tick_of_show);
            }
            if changed || (level == Level::Approaching && self.counts_down(tick_of_show)) {
                alerts.push(Alert { level, event: next.copied(), nearest: closest });
            }
        }
        self.previous = Some(sim_time);
    }

    fn announce(&mut self, level: Level, tick_of_show: u64) {
        self.level = level;
        self.fresh = false;
        self.since = tick_of_show;
        self.counted = 0;
    }

    /// `Approaching` or `Clear`, where no event has passed.
    fn level_ahead(&mut self, sim_time: f64, clearance: f64, next: Option<&TimedEvent>) -> Level {
        let soon = next.is_some_and(|timed| timed.time - sim_time <= self.rules.approach_time);
        let standing = self.level == Level::Approaching && self.previous.is_some();
        let threshold = self.rules.approach_clearance;
        // NaN, where there are no two boards to compare, is never near.
        let closed = clearance <= HYSTERESIS_RATIO * threshold;
        self.open_since = if closed { None } else { self.open_since.or(Some(sim_time)) };
        let calm = self.open_since.is_some_and(|since| sim_time - since >= RELEASE_HOLD * self.rules.approach_time);
        let near = if standing { !calm } else { clearance < threshold };
        if soon || near { Level::Approaching } else { Level::Clear }
    }

    /// Whether another second of wall time has passed since the level was announced.
    fn counts_down(&mut self, tick_of_show: u64) -> bool {
        let seconds = ((tick_of_show - self.since) as f64 / self.rate) as u64;
        let due = seconds > self.counted;
        self.counted = seconds;
        due
    }
}
