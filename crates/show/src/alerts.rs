//! The alert rules: from the timeline and the clearance to a level that does not flicker, and the alerts that go out.
//!
//! In: a frame's tick, time and nearest pair, and the events. Out: the level, and the alerts of that frame. Called by
//! the show, once a frame.

#[cfg(test)]
mod tests;

use crate::scene::AlertRules;
use bench_dragon_motion::clearance::PairClearance;
use bench_dragon_motion::timeline::{TimedEvent, Timeline};

use bench_dragon_messages::state::Level;

/// More alerts than this cannot go with one frame: contact, stall and lock, all passed in one step. Approaching and
/// clear go alone.
pub const MOST_PER_FRAME: usize = 3;

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
    /// The level announced last; `None` before the first frame.
    announced: Option<Level>,
    /// The tick at which it was announced.
    announced_tick: u64,
    /// Whole seconds of wall time since then that have been counted down.
    seconds_counted: u64,
    /// Time of the last frame of this show; before the first, none.
    previous_time: Option<f64>,
    /// Since when the clearance has been wide enough to release the level.
    open_since: Option<f64>,
}

impl LevelTracker {
    /// The level before the first frame of a run at `rate` frames per second.
    pub fn new(rules: AlertRules, rate: f64) -> Self {
        Self {
            rules,
            rate,
            announced: None,
            announced_tick: 0,
            seconds_counted: 0,
            previous_time: None,
            open_since: None,
        }
    }

    /// The level now.
    pub fn current(&self) -> Level {
        self.announced.unwrap_or(Level::Clear)
    }

    /// The show begins again: the next frame decides the level anew, and announces it if it is another one.
    ///
    /// The countdown is of wall time and runs on.
    pub fn restart(&mut self) {
        self.previous_time = None;
        self.open_since = None;
    }

    /// The next frame announces its level, whatever that is.
    pub fn forget(&mut self) {
        self.restart();
        self.announced = None;
    }

    /// Decides the level of a frame and adds the alerts that go with it. `tick` grows from call to call, through every
    /// restart; `sim_time` does not fall but at a restart.
    ///
    /// Every event since the last frame is announced, however many a step has passed, so that what a subscriber
    /// receives of them does not depend on the rate. The first frame of a show announces the latest event passed alone.
    /// Nothing is counted down while the show stands still (`moves` is false).
    pub fn update(
        &mut self,
        tick: u64,
        sim_time: f64,
        moves: bool,
        timeline: &Timeline,
        nearest: Option<PairClearance>,
        alerts: &mut Vec<Alert>,
    ) {
        let alertable = timeline.events().iter().filter_map(|timed| Some((timed, Level::of(timed.event.kind)?)));
        let passed = alertable.filter(|(timed, _)| timed.time <= sim_time);
        let count = passed.clone().count();
        let new = match self.previous_time {
            Some(previous) => passed.clone().filter(|(timed, _)| timed.time > previous).count(),
            None => count.min(1),
        };
        for (timed, level) in passed.skip(count - new) {
            if self.announce_if_changed(level, tick) {
                alerts.push(Alert { level, event: Some(*timed), nearest });
            }
        }
        if count == 0 {
            let next = timeline.next_alertable(sim_time);
            let level = self.level_before_events(sim_time, nearest, next);
            let changed = self.announce_if_changed(level, tick);
            if changed || (level == Level::Approaching && self.second_is_over(tick) && moves) {
                alerts.push(Alert { level, event: next.copied(), nearest });
            }
        }
        self.previous_time = Some(sim_time);
    }

    /// Takes a level on; whether it is another one than that announced last.
    fn announce_if_changed(&mut self, level: Level, tick: u64) -> bool {
        let changed = self.announced != Some(level);
        if changed {
            self.announced = Some(level);
            self.announced_tick = tick;
            self.seconds_counted = 0;
        }
        changed
    }

    /// `Approaching` or `Clear`, where no event has passed.
    fn level_before_events(
        &mut self,
        sim_time: f64,
        nearest: Option<PairClearance>,
        next: Option<&TimedEvent>,
    ) -> Level {
        let AlertRules { approach_time, approach_clearance } = self.rules;
        let event_is_near = next.is_some_and(|timed| timed.time - sim_time <= approach_time);
        // Without a pair there is nothing to be near.
        let clearance = nearest.map_or(f64::INFINITY, |nearest| nearest.value);
        let open = clearance > HYSTERESIS_RATIO * approach_clearance;
        self.open_since = if open { self.open_since.or(Some(sim_time)) } else { None };
        let held = self.announced == Some(Level::Approaching) && self.previous_time.is_some();
        let boards_are_near = if held {
            self.open_since.is_none_or(|since| sim_time - since < RELEASE_HOLD * approach_time)
        } else {
            clearance < approach_clearance
        };
        if event_is_near || boards_are_near { Level::Approaching } else { Level::Clear }
    }

    /// Returns true if another second of wall time has passed since the level was announced.
    fn second_is_over(&mut self, tick: u64) -> bool {
        let seconds = ((tick - self.announced_tick) as f64 / self.rate) as u64;
        let over = seconds > self.seconds_counted;
        self.seconds_counted = seconds;
        over
    }
}
