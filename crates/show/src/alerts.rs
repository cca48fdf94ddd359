//! The alert rules: from the timeline and the clearance to a level with hysteresis, and to alerts.
//!
//! In: a frame's tick, time and nearest pair, and the events. Out: the level, and the alerts of that frame.

#[cfg(test)]
mod tests;

use crate::scene::AlertRules;
use bench_dragon_motion::clearance::PairClearance;
use bench_dragon_motion::timeline::{TimedEvent, Timeline};

use bench_dragon_messages::state::Level;

/// The most alerts of one frame with one dragon: contact, stall and lock, all passed in one step, and obstacles
/// before, between and behind them. Approaching and clear are alone. Several dragons can have more.
pub const MOST_PER_FRAME: usize = 7;

/// The clearance at which the level may be released, as a multiple of the clearance that raised it. Without this
/// hysteresis, a clearance that oscillates about the threshold would make the level flicker.
const HYSTERESIS_RATIO: f64 = 1.5;

/// The time for which the clearance must stay that wide, as a share of the approach time. The ratio alone is not
/// enough. The paper's head passes from one bench to the next: its clearance rises from 0.050 m to 0.082 m and falls
/// back within 4 s. The clearance is above 0.075 m for 0.6 s.
const RELEASE_HOLD: f64 = 0.1;

/// A change of the alert level or a step of the countdown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alert {
    /// The level.
    pub level: Level,
    /// The event of the alert. While the level is clear or approaching: the next contact, obstacle, stall or lock, if
    /// any. Otherwise: the event that has happened and raised the level.
    pub event: Option<TimedEvent>,
    /// The nearest two boards in the frame, or a board and an obstacle; `None` with neither.
    pub nearest: Option<PairClearance>,
}

/// The state of the alert level.
#[derive(Debug, Clone)]
pub struct LevelTracker {
    rules: AlertRules,
    rate: f64,
    /// The level that was announced last; `None` before the first frame.
    announced: Option<Level>,
    /// The tick of that announcement.
    announced_tick: u64,
    /// Whole seconds of wall time counted down since then.
    seconds_counted: u64,
    /// The time of the previous frame of this showing; `None` before the first.
    previous_time: Option<f64>,
    /// Time since which the clearance is wide enough to release the level.
    open_since: Option<f64>,
}

impl LevelTracker {
    /// Creates the state before the first frame of a run at `rate` frames per second.
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

    /// Returns the current level.
    pub fn current(&self) -> Level {
        self.announced.unwrap_or(Level::Clear)
    }

    /// Prepares for a new showing: the next frame decides the level again, and announces it if it has changed.
    ///
    /// The countdown is in wall time and continues.
    pub fn restart(&mut self) {
        self.previous_time = None;
        self.open_since = None;
    }

    /// Makes the next frame announce its level, changed or not.
    pub fn forget(&mut self) {
        self.restart();
        self.announced = None;
    }

    /// Decides the level of a frame and adds the frame's alerts. `tick` grows from call to call, also across restarts.
    /// `sim_time` falls only at a restart.
    ///
    /// Every event since the previous frame is announced, even if one step passes several: so the alerts do not depend
    /// on the rate. An event that does not change the level is not announced, such as an obstacle after an obstacle.
    /// The first frame of a showing announces only the latest event passed. The countdown stops while the show stands
    /// still (`moves` is false).
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

    /// Sets the level. Returns true if it differs from the level announced last.
    fn announce_if_changed(&mut self, level: Level, tick: u64) -> bool {
        let changed = self.announced != Some(level);
        if changed {
            self.announced = Some(level);
            self.announced_tick = tick;
            self.seconds_counted = 0;
        }
        changed
    }

    /// Returns `Approaching` or `Clear`, before the first event.
    fn level_before_events(
        &mut self,
        sim_time: f64,
        nearest: Option<PairClearance>,
        next: Option<&TimedEvent>,
    ) -> Level {
        let AlertRules { approach_time, approach_clearance } = self.rules;
        let event_is_near = next.is_some_and(|timed| timed.time - sim_time <= approach_time);
        // Without a pair no boards are near.
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
