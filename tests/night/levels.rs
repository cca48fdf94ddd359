//! A model of the promised alerts, from a subscriber's view of each frame and the list of events.

use bench_dragon::messages::FrameHeader;
use bench_dragon::messages::state::{Level, PlaybackState};

/// The settings of a scene's alerts.
#[derive(Clone)]
pub struct Rules {
    pub approach_time: f64,
    pub approach_clearance: f64,
    /// Every contact, stall and lock, in order.
    pub events: Vec<(f64, Level)>,
}

pub struct Levels {
    rules: Rules,
    rate: f64,
    /// The level that subscribers were sent last, and the period of the change.
    announced: Option<(Level, u64)>,
    /// Seconds of the countdown since then.
    counted: u64,
    /// The time of the last frame of this epoch.
    before: Option<f64>,
    /// Time since which boards have been far apart.
    apart_since: Option<f64>,
}

impl Levels {
    pub fn new(rules: Rules, rate: f64) -> Self {
        Self { rules, rate, announced: None, counted: 0, before: None, apart_since: None }
    }

    /// Returns the level that a late subscriber must get.
    pub fn current(&self) -> Option<Level> {
        self.announced.map(|(level, _)| level)
    }

    /// Returns the levels of the alerts that must go with a frame. `new_epoch`: time has jumped; `by_command`: a
    /// command caused the jump.
    pub fn expected(&mut self, header: &FrameHeader, new_epoch: bool, by_command: bool) -> Vec<Level> {
        if by_command {
            self.announced = None;
        }
        if new_epoch || by_command {
            (self.before, self.apart_since) = (None, None);
        }
        let now = header.sim_time;
        let happened: Vec<Level> =
            self.rules.events.iter().filter(|(time, _)| *time <= now).map(|(_, level)| *level).collect();
        let known = match self.before {
            Some(before) => self.rules.events.iter().filter(|(time, _)| *time <= before).count(),
            // The first frame of an epoch announces its level, not earlier events.
            None => happened.len().saturating_sub(1),
        };
        let mut alerts = Vec::new();
        for level in &happened[known..] {
            if self.change(*level, header.tick) {
                alerts.push(*level);
            }
        }
        if happened.is_empty() {
            let level = self.level_before_events(header);
            let playing = header.playback_state() == Some(PlaybackState::Playing);
            if self.change(level, header.tick) || (level == Level::Approaching && self.counts_down(header) && playing) {
                alerts.push(level);
            }
        }
        self.before = Some(now);
        alerts
    }

    fn change(&mut self, level: Level, tick: u64) -> bool {
        let changed = self.current() != Some(level);
        if changed {
            (self.announced, self.counted) = (Some((level, tick)), 0);
        }
        changed
    }

    fn level_before_events(&mut self, header: &FrameHeader) -> Level {
        let Rules { approach_time, approach_clearance, events } = &self.rules;
        let now = header.sim_time;
        let coming = events.first().is_some_and(|(time, _)| time - now <= *approach_time);
        // NaN means that there is no pair.
        let apart = header.min_clearance.is_nan() || header.min_clearance > 1.5 * approach_clearance;
        self.apart_since = if apart { self.apart_since.or(Some(now)) } else { None };
        let was_near = self.before.is_some() && self.current() == Some(Level::Approaching);
        let near = match self.apart_since {
            _ if !was_near => header.min_clearance < *approach_clearance,
            None => true,
            Some(since) => now - since < 0.1 * approach_time,
        };
        if coming || near { Level::Approaching } else { Level::Clear }
    }

    /// Returns true if another second of wall time has passed since the level changed.
    fn counts_down(&mut self, header: &FrameHeader) -> bool {
        let since = self.announced.map_or(0, |(_, tick)| header.tick - tick);
        let seconds = (since as f64 / self.rate).floor() as u64;
        std::mem::replace(&mut self.counted, seconds) < seconds
    }
}
