//! The show clock: from a tick to simulated time, and whether the show has ended or begun again.
//!
//! Pure, and from integers: sim0 + time_scale * (tick - tick0) / rate, never accumulated, so that nothing drifts and
//! any tick can be evaluated alone. Called by the show, once a frame.

#[cfg(test)]
mod tests;

use crate::scene::AtEnd;

use super::Playback;

/// Where a show is at a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShowTime {
    /// Simulated seconds since the start of the scene.
    pub sim_time: f64,
    /// Times the show has been played to its end and begun again.
    pub shows_played: u64,
    /// Whether the show has frozen.
    pub ended: bool,
}

/// The clock of a show whose end is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShowClock {
    start: f64,
    time_scale: f64,
    rate: f64,
    freeze_time: f64,
    /// Ticks after which the show begins again; `None` where it does not.
    ticks_per_show: Option<u64>,
}

impl ShowClock {
    /// The clock of a show that freezes at `freeze_time`, in simulated seconds.
    pub fn new(playback: &Playback, freeze_time: f64) -> Self {
        let Playback { start, time_scale, rate, at_end, .. } = *playback;
        let holding = Self { start, time_scale, rate, freeze_time, ticks_per_show: None };
        let ticks_per_show = match at_end {
            AtEnd::Hold => None,
            AtEnd::Loop => Some(holding.first_ended_tick().saturating_add(1)),
        };
        Self { ticks_per_show, ..holding }
    }

    /// Simulated seconds at which the show freezes.
    pub fn freeze_time(&self) -> f64 {
        self.freeze_time
    }

    /// Where the show is at a tick.
    pub fn at(&self, tick: u64) -> ShowTime {
        let shows_played = self.ticks_per_show.map_or(0, |ticks| tick / ticks);
        let first_tick = shows_played * self.ticks_per_show.unwrap_or(0);
        let unclamped = self.unclamped(tick - first_tick);
        ShowTime { sim_time: unclamped.min(self.freeze_time), shows_played, ended: unclamped >= self.freeze_time }
    }

    /// Simulated seconds so many ticks after the beginning, if the show never froze.
    fn unclamped(&self, ticks: u64) -> f64 {
        self.start + self.time_scale * ticks as f64 / self.rate
    }

    /// The first tick at or past the freeze, or the last tick there is. By bisection: a tick's time is rounded, but it
    /// never falls.
    fn first_ended_tick(&self) -> u64 {
        let (mut low, mut high) = (0, u64::MAX);
        while low < high {
            let middle = low + (high - low) / 2;
            if self.unclamped(middle) >= self.freeze_time {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        low
    }
}
