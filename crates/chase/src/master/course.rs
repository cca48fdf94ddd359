//! The place of timecode at each moment, from the latest frame of a show. Pure.

use bench_dragon_messages::FrameHeader;
use bench_dragon_messages::state::PlaybackState;

use crate::schedule::Schedule;
use crate::timecode::{FrameRate, Label};

/// The speeds of timecode, as a part of its own, at which receivers follow it. Outside, labels are sent one by one.
const RUNNING: std::ops::RangeInclusive<f64> = 0.5..=2.0;
/// The distance at which a frame of the show is a jump, in seconds: later frames state the same course exactly.
const JUMP: f64 = 0.1;
/// The jitter of arrivals of another machine's frames, in seconds.
const JITTER: f64 = 0.01;
/// A place that is so near below a frame is in the frame: places are rounded.
const ROUNDING: f64 = 1e-6;

/// A straight line of places over time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Course {
    run_id: u64,
    epoch: u32,
    rate: FrameRate,
    /// A moment, CLOCK_MONOTONIC in nanoseconds, and the place there, in frames since 00:00:00:00.
    at_ns: u64,
    place: f64,
    /// Frames per second of wall time; 0 while the show stands.
    pace: f64,
}

impl Course {
    /// Returns the course of a frame of the show that was made at a moment.
    pub fn of(header: &FrameHeader, at_ns: u64, schedule: &Schedule, rate: FrameRate) -> Self {
        let plays = header.playback_state() == Some(PlaybackState::Playing);
        let pace = if plays { schedule.pace(header.time_scale, rate) } else { 0.0 };
        let place = schedule.place(header.sim_time, rate);
        Self { run_id: header.run_id, epoch: header.epoch, rate, at_ns, place, pace }
    }

    /// Returns the place at a moment, in frames.
    pub fn at(&self, moment_ns: u64) -> f64 {
        let since_ns = moment_ns as i64 - self.at_ns as i64;
        self.place + self.pace * since_ns as f64 * 1e-9
    }

    /// Returns the moment of a place, in nanoseconds. The course [runs](Self::runs).
    pub fn moment(&self, place: f64) -> u64 {
        let since_ns = (place - self.place) / self.pace * 1e9;
        self.at_ns.saturating_add_signed(since_ns.round() as i64)
    }

    /// Returns the label of a place.
    pub fn label(&self, place: f64) -> Label {
        let frame = (place + ROUNDING).floor() as i64;
        // The remainder is below the frames of a day.
        self.rate.label(frame.rem_euclid(self.rate.frames_per_day().into()) as u32)
    }

    /// Returns the frames per second of timecode at its own speed.
    pub fn nominal(&self) -> f64 {
        self.rate.per_second()
    }

    /// Returns the frames per second of wall time.
    pub fn pace(&self) -> f64 {
        self.pace
    }

    /// Returns true if receivers can follow the speed.
    pub fn runs(&self) -> bool {
        RUNNING.contains(&(self.pace / self.nominal()))
    }

    /// Returns true if the show plays at a speed that receivers cannot follow.
    pub fn is_too_fast_or_slow(&self) -> bool {
        self.pace > 0.0 && !self.runs()
    }

    /// Returns true if this course begins where an earlier one has come to.
    pub fn continues(&self, before: &Self) -> bool {
        let same = (self.run_id, self.epoch) == (before.run_id, before.epoch);
        // Between two frames the pace may have changed: the place lies between those of both paces.
        let expected = [before.at(self.at_ns), before.place];
        let (least, most) = (expected[0].min(expected[1]), expected[0].max(expected[1]));
        let jump = JUMP * self.nominal();
        same && self.place > least - jump && self.place < most + jump || same && self.is_too_fast_or_slow()
    }

    /// Returns true if another course differs by the jitter of arrivals only.
    pub fn is_jitter_of(&self, next: &Self) -> bool {
        next.continues(self)
            && self.pace == next.pace
            && (self.at(next.at_ns) - next.place).abs() < JITTER * self.nominal()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(tick: u64, sim_time: f64, time_scale: f64, playback: PlaybackState, epoch: u32) -> FrameHeader {
        let deadline_ns = 5_000_000_000 + tick * 20_000_000;
        FrameHeader { tick, deadline_ns, sim_time, time_scale, playback: playback as u32, epoch, ..Default::default() }
    }

    fn course(header: &FrameHeader, offset: &str, speed: f64, rate: FrameRate) -> Course {
        Course::of(header, header.deadline_ns, &Schedule { offset: offset.parse().unwrap(), speed }, rate)
    }

    #[test]
    fn a_label_is_current_from_the_moment_of_the_show_on() {
        let playing = header(0, 100.0, 1.0, PlaybackState::Playing, 0);
        let drop = course(&playing, "01:00:00:00", 1.0, FrameRate::Drop2997);
        // 01:01:40;02 is the 3,000th frame after the hour: 1,800 in the first minute, two labels left out.
        assert_eq!(drop.label(drop.at(drop.moment(107_892.0 + 3000.0))), "01:01:40:02".parse().unwrap());
        assert_eq!(drop.moment(107_892.0 + 3000.0), 5_000_000_000 + 100_000_000, "3,000 frames are 100.1 s");
        let twice = course(&header(0, 100.0, 2.0, PlaybackState::Playing, 0), "0:0:0:0", 2.0, FrameRate::Ebu25);
        assert!(twice.runs() && (twice.pace() - 25.0).abs() < 1e-9);
        assert_eq!(twice.label(twice.at(6_000_000_000)), "00:00:51:00".parse().unwrap());
        let late = course(&playing, "23:59:00:00", 1.0, FrameRate::Smpte30);
        assert_eq!(late.label(late.at(5_000_000_000)), "00:00:40:00".parse().unwrap(), "past midnight");
    }

    #[test]
    fn a_seek_is_a_jump_and_a_change_of_the_rate_is_none() {
        use PlaybackState::{Paused, Playing};
        let of = |header: FrameHeader| course(&header, "0:0:0:0", 1.0, FrameRate::Ebu25);
        let before = of(header(0, 100.0, 1.0, Playing, 0));
        for (next, continues) in [
            (header(50, 101.0, 1.0, Playing, 0), true),
            (header(50, 100.6, 0.5, Playing, 0), true),
            (header(50, 100.3, 0.0, Paused, 0), true),
            (header(50, 101.0, 1.0, Playing, 1), false),
            (header(50, 105.0, 1.0, Playing, 0), false),
            (header(50, 99.0, 1.0, Playing, 0), false),
        ] {
            assert_eq!(of(next).continues(&before), continues, "{next:?}");
        }
        let other_run = FrameHeader { run_id: 7, ..header(50, 101.0, 1.0, Playing, 0) };
        assert!(!of(other_run).continues(&before));
        assert!(before.is_jitter_of(&of(header(50, 101.005, 1.0, Playing, 0))));
        assert!(!before.is_jitter_of(&of(header(50, 101.05, 1.0, Playing, 0))));
    }
}
