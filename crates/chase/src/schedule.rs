//! From a position of timecode to the simulated time of a show, and back. Pure.

use crate::steering::{Goal, Limits};
use crate::synchronizer::{Motion, wrapped};
use crate::timecode::{FrameRate, Label};

/// The greatest error that is taken up by the rate, and the greatest change of the rate, for timecode at speed 1.
const SEEK_ABOVE: f64 = 0.5;
const TAKE_UP: f64 = 0.1;
/// Span before the label of simulated time 0 in which a label is before the show and not late in it, in seconds.
const BEFORE: f64 = 6.0 * 3600.0;

/// The label at which a show begins, and its speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// The label of simulated time 0.
    pub offset: Label,
    /// Simulated seconds per second of timecode.
    pub speed: f64,
}

impl Schedule {
    /// Returns the limits of the corrections at this speed.
    pub fn limits(&self) -> Limits {
        Limits { take_up: TAKE_UP * self.speed, seek_above: SEEK_ABOVE * self.speed, seeks_back: true }
    }

    /// Returns the simulated time of a position of timecode, both in seconds: from six hours before the offset to
    /// eighteen hours after.
    pub fn time(&self, position: f64, rate: FrameRate) -> f64 {
        let day = rate.seconds(f64::from(rate.frames_per_day()));
        let middle = 0.5 * day - BEFORE;
        let since = wrapped(position - rate.seconds(f64::from(self.first_frame(rate))) - middle, day) + middle;
        self.speed * since
    }

    /// Returns the frame of simulated time 0.
    fn first_frame(&self, rate: FrameRate) -> u32 {
        // A label that this rate leaves out counts as the next one.
        let next = Label { frames: 2, ..self.offset };
        rate.frame(self.offset).or(rate.frame(next)).unwrap_or(0)
    }

    /// Returns the place of a simulated time in frames since 00:00:00:00. It may be past the end of a day.
    pub fn place(&self, time: f64, rate: FrameRate) -> f64 {
        f64::from(self.first_frame(rate)) + self.pace(1.0, rate) * time
    }

    /// Returns the frames per second of a show with this rate in simulated seconds per second.
    pub fn pace(&self, show: f64, rate: FrameRate) -> f64 {
        show / self.speed * rate.per_second()
    }

    /// Returns the goal of a show while its timecode has this motion. `was_locked` is true once the source has been
    /// locked.
    pub fn goal(&self, motion: Motion, rate: FrameRate, was_locked: bool) -> Goal {
        match motion {
            Motion::Silent => Goal::None,
            Motion::Locking if !was_locked => Goal::None,
            Motion::Locked { position, rate: pace } | Motion::Freewheeling { position, rate: pace } => {
                Goal::Follow { time: self.time(position, rate), rate: self.speed * pace }
            }
            Motion::Standing(position) => Goal::Stand(Some(self.time(position, rate))),
            Motion::Locking | Motion::Backward | Motion::Lost => Goal::Stand(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_before_the_offset_are_before_the_show_and_midnight_is_no_border() {
        let time = |offset: &str, speed: f64, label: &str| {
            let schedule = Schedule { offset: offset.parse().unwrap(), speed };
            let rate = FrameRate::Ebu25;
            schedule.time(rate.seconds(f64::from(rate.frame(label.parse().unwrap()).unwrap())), rate)
        };
        for (offset, speed, label, expected) in [
            ("00:00:00:00", 1.0, "00:01:00:05", 60.2),
            ("01:00:00:00", 1.0, "00:59:50:00", -10.0),
            ("01:00:00:00", 2.0, "01:00:10:00", 20.0),
            ("23:50:00:00", 1.0, "00:10:00:00", 1200.0),
            ("00:00:00:00", 1.0, "23:59:50:00", -10.0),
            ("00:00:00:00", 1.0, "17:00:00:00", 61_200.0),
        ] {
            assert!((time(offset, speed, label) - expected).abs() < 1e-6, "{offset} {label}");
        }
    }
}
