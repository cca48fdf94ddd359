//! Lock, jump, drift, freewheel: the motion of a source of timecode, from its readings alone. Pure; called with
//! simulated time by tests.
//!
//! A reading is a position and the moment of its arrival. An arrival can only be late, by jitter or by a stall of the
//! network, after which the waiting packets come at once. Positions that run evenly at another place are a jump.

use std::collections::VecDeque;

use crate::filter::{DelayLockedLoop, Noise, seconds_between};

/// The greatest error of a reading that corrects the loop, in seconds.
const GATE: f64 = 0.040;
/// The greatest difference between the steps of position and of time in readings that run evenly, in seconds.
const EVEN: f64 = 0.025;
/// The greatest step of position and of time between two readings of one run, in seconds.
const MOST_STEP: f64 = 1.5;
/// The duration for which evenly late readings count as a stall, in seconds.
const LATE: f64 = 0.5;
/// The time up to which a repeated label is a sender's repetition, seconds, and the least repetitions of a standing
/// source.
const STANDING: f64 = 0.15;
const STANDING_READINGS: u32 = 3;
/// The errors below which a loop keeps its rate when its source jumps, in seconds.
const SAME_RUN: f64 = 0.5;
/// The time without a reading that is shown as freewheeling, in seconds.
const QUIET: f64 = 0.3;

/// A reading of a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The position at the arrival, in seconds.
    pub position: f64,
    /// Arrival, CLOCK_MONOTONIC in nanoseconds.
    pub at_ns: u64,
    /// The time, in seconds, after which positions begin again at 0.
    pub day: f64,
}

/// The motion of a source at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// No reading has come.
    Silent,
    /// Readings come, too few of them in order.
    Locking,
    /// The source runs.
    Locked {
        /// Position, in seconds.
        position: f64,
        /// The rate, in seconds per second.
        rate: f64,
    },
    /// Readings have stopped; the position continues.
    Freewheeling {
        /// Position, in seconds.
        position: f64,
        /// The rate, in seconds per second.
        rate: f64,
    },
    /// The source stands at a position, in seconds.
    Standing(f64),
    /// The source runs backward.
    Backward,
    /// Readings have stopped for longer than the freewheel time.
    Lost,
}

/// The options of a synchronizer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The time for which a source without readings continues, in seconds.
    pub freewheel: f64,
    /// Readings in order that lock: 3 for frames, 2 for readings that take several frames.
    pub readings_to_lock: usize,
}

/// The state of a source.
#[derive(Debug, Clone)]
pub struct Synchronizer {
    options: Options,
    state: State,
    /// The latest readings that run evenly and do not fit the loop.
    run: VecDeque<Reading>,
    /// The latest reading, with its first arrival, and the number of its repetitions.
    latest: Option<(Reading, u32)>,
    latest_ns: u64,
    /// Readings in a row that ran backward.
    backward: usize,
    /// Jumps since the start.
    jumps: u64,
}

#[derive(Debug, Clone, Copy)]
enum State {
    Silent,
    Locking,
    Running { estimate: DelayLockedLoop, fitting_ns: u64, reached: f64 },
    Standing(f64),
    Backward,
    Lost,
}

impl Synchronizer {
    /// Creates the state of a source that has not been heard.
    pub fn new(options: Options) -> Self {
        Self { options, state: State::Silent, run: VecDeque::new(), latest: None, latest_ns: 0, backward: 0, jumps: 0 }
    }

    /// Returns the number of jumps so far.
    pub fn jumps(&self) -> u64 {
        self.jumps
    }

    /// Returns the time since the latest reading, in seconds; infinite before the first.
    pub fn quiet_for(&self, now_ns: u64) -> f64 {
        self.latest.map_or(f64::INFINITY, |_| seconds_between(self.latest_ns, now_ns))
    }

    /// Handles a reading of a source that stands: a label that locates.
    pub fn located(&mut self, reading: Reading) {
        self.latest_ns = reading.at_ns;
        self.latest = Some((reading, 0));
        self.run.clear();
        self.state = State::Standing(reading.position);
    }

    /// Handles a source that runs backward by its own account.
    pub fn backward(&mut self, at_ns: u64) {
        self.latest_ns = at_ns;
        self.backward += 1;
        if self.backward >= self.options.readings_to_lock {
            self.run.clear();
            self.state = State::Backward;
        }
    }

    /// Handles a reading.
    pub fn read(&mut self, reading: Reading) {
        self.latest_ns = reading.at_ns;
        if let Some((latest, repeated)) = &mut self.latest
            && (latest.position - reading.position).abs() < 1e-6
        {
            *repeated += 1;
            let stands = *repeated >= STANDING_READINGS && seconds_between(latest.at_ns, reading.at_ns) > STANDING;
            if stands && !matches!(self.state, State::Standing(_)) {
                self.run.clear();
                self.state = State::Standing(reading.position);
            }
            return;
        }
        let before = self.latest.replace((reading, 0)).map(|(before, _)| before);
        let step = before.map_or(0.0, |before| wrapped(reading.position - before.position, reading.day));
        let is_backward = before.is_some_and(|before| {
            (-MOST_STEP..0.0).contains(&step) && seconds_between(before.at_ns, reading.at_ns) > 0.0
        });
        self.backward = if is_backward { self.backward + 1 } else { 0 };
        if self.backward >= self.options.readings_to_lock.max(3) {
            self.run.clear();
            self.state = State::Backward;
            return;
        }
        if let State::Running { estimate, fitting_ns, reached } = &mut self.state {
            let expected = estimate.position(reading.at_ns);
            let position = expected + wrapped(reading.position - expected, reading.day);
            if (position - expected).abs() <= GATE {
                estimate.correct(reading.at_ns, position);
                (*fitting_ns, *reached) = (reading.at_ns, reached.max(position));
                self.run.clear();
                return;
            }
        } else if matches!(self.state, State::Silent | State::Lost) {
            self.state = State::Locking;
        }
        self.extend_run(reading);
    }

    /// Adds a reading that does not fit to the run of such readings, or begins another run with it.
    fn extend_run(&mut self, reading: Reading) {
        let follows = self.run.back().is_some_and(|last| {
            let position = wrapped(reading.position - last.position, reading.day);
            let time = seconds_between(last.at_ns, reading.at_ns);
            let is_even = (position - time).abs() <= EVEN.max(0.2 * time);
            position > 0.0 && time > 0.0 && position.max(time) < MOST_STEP && is_even
        });
        if !follows {
            self.run.clear();
        }
        self.run.push_back(reading);
        if self.run.len() < self.options.readings_to_lock {
            return;
        }
        let [Some(first), Some(last)] = [self.run.front().copied(), self.run.back().copied()] else { return };
        let (mut rate, mut noise) = (1.0, Noise::TIMECODE);
        if let State::Running { estimate, reached, .. } = self.state {
            let expected = estimate.position(last.at_ns);
            let error = wrapped(last.position - expected, last.day);
            // A label that has been before cannot be late.
            let may_be_late = error < 0.0 && expected + error > reached;
            if may_be_late && seconds_between(first.at_ns, last.at_ns) < LATE {
                return;
            }
            if error.abs() < SAME_RUN {
                (rate, noise) = (estimate.rate(), Noise::TIMECODE_OF_ANOTHER_SPEED);
            }
            self.jumps += 1;
        }
        let mut estimate = DelayLockedLoop::new(first.at_ns, first.position, rate, noise);
        for reading in self.run.drain(..).skip(1) {
            let expected = estimate.position(reading.at_ns);
            estimate.correct(reading.at_ns, expected + wrapped(reading.position - expected, reading.day));
        }
        let reached = estimate.position(last.at_ns);
        self.state = State::Running { estimate, fitting_ns: last.at_ns, reached };
    }

    /// Returns the motion of the source now.
    pub fn motion(&mut self, now_ns: u64) -> Motion {
        let quiet = self.quiet_for(now_ns);
        match self.state {
            State::Silent => Motion::Silent,
            State::Lost => Motion::Lost,
            State::Running { fitting_ns, .. } if seconds_between(fitting_ns, now_ns) > self.options.freewheel => {
                // Readings that do not fit, and do not lock either, are no signal.
                self.state = if quiet > self.options.freewheel { State::Lost } else { State::Locking };
                self.motion(now_ns)
            }
            State::Locking | State::Standing(_) | State::Backward if quiet > self.options.freewheel => {
                self.state = State::Lost;
                self.run.clear();
                Motion::Lost
            }
            State::Locking => Motion::Locking,
            State::Standing(position) => Motion::Standing(position),
            State::Backward => Motion::Backward,
            State::Running { estimate, .. } => {
                let (position, rate) = (estimate.position(now_ns), estimate.rate());
                match quiet > QUIET {
                    true => Motion::Freewheeling { position, rate },
                    false => Motion::Locked { position, rate },
                }
            }
        }
    }
}

/// Returns a difference of positions without whole days: from minus half a day to half a day.
pub fn wrapped(difference: f64, day: f64) -> f64 {
    difference - day * (difference / day).round()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME_NS: u64 = 40_000_000;

    fn reading(position: f64, at_ns: u64) -> Reading {
        Reading { position, at_ns, day: 86_400.0 }
    }

    /// A source at 25 frames per second that has run for some frames from 100 s on.
    fn locked(frames: u64) -> Synchronizer {
        let mut synchronizer = Synchronizer::new(Options { freewheel: 2.0, readings_to_lock: 3 });
        (0..frames).for_each(|k| synchronizer.read(reading(100.0 + 0.04 * k as f64, FRAME_NS * k)));
        synchronizer
    }

    fn position(synchronizer: &mut Synchronizer, now_ns: u64) -> f64 {
        match synchronizer.motion(now_ns) {
            Motion::Locked { position, .. } | Motion::Freewheeling { position, .. } => position,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn three_readings_in_order_lock() {
        for (frames, expected) in [(0, Motion::Silent), (1, Motion::Locking), (2, Motion::Locking)] {
            assert_eq!(locked(frames).motion(FRAME_NS * 2), expected);
        }
        assert!(matches!(locked(3).motion(FRAME_NS * 2), Motion::Locked { .. }));
        // Labels in the reverse order, or at one moment, do not.
        let mut reverse = Synchronizer::new(Options { freewheel: 2.0, readings_to_lock: 3 });
        (0..3).for_each(|k| reverse.read(reading(100.0 - 0.04 * k as f64, FRAME_NS * k)));
        assert!(!matches!(reverse.motion(FRAME_NS * 2), Motion::Locked { .. }));
        let mut burst = Synchronizer::new(Options { freewheel: 2.0, readings_to_lock: 3 });
        (0..9).for_each(|k| burst.read(reading(100.0 + 0.04 * k as f64, FRAME_NS)));
        assert_eq!(burst.motion(FRAME_NS), Motion::Locking);
    }

    #[test]
    fn stray_repeated_and_late_labels_change_nothing() {
        let mut synchronizer = locked(50);
        let stray = [(7.0, 0), (102.0, 1), (102.0, 2), (101.5, 3), (80_000.0, 4), (102.08, 5)];
        for (label, milliseconds) in stray {
            synchronizer.read(reading(label, 50 * FRAME_NS + milliseconds * 1_000_000));
        }
        // The last of these is 3 ms early by its label, which a single reading corrects by little.
        assert!((position(&mut synchronizer, 52 * FRAME_NS) - 102.08).abs() < 0.01);
        assert_eq!(synchronizer.jumps(), 0);
    }

    #[test]
    fn a_label_that_is_repeated_stands() {
        let mut synchronizer = locked(50);
        (0..10).for_each(|k| synchronizer.read(reading(101.96, (50 + k) * FRAME_NS)));
        assert_eq!(synchronizer.motion(60 * FRAME_NS), Motion::Standing(101.96));
    }

    #[test]
    fn a_player_of_another_speed_is_followed() {
        let mut synchronizer = locked(100);
        let mut worst = 0.0f64;
        for k in 0..500u64 {
            let (at_ns, place) = (100 * FRAME_NS + k * 38_095_238, 104.0 + 0.04 * k as f64);
            synchronizer.read(reading(place, at_ns));
            if k > 150 {
                worst = worst.max((position(&mut synchronizer, at_ns) - place).abs());
            }
        }
        assert!(worst < 0.02, "5 % faster: {worst} s");
    }

    #[test]
    fn positions_go_on_over_midnight() {
        let mut synchronizer = Synchronizer::new(Options { freewheel: 2.0, readings_to_lock: 3 });
        for k in 0..100u64 {
            synchronizer.read(reading((86_398.0 + 0.04 * k as f64) % 86_400.0, FRAME_NS * k));
        }
        assert!((wrapped(position(&mut synchronizer, 100 * FRAME_NS) - 2.0, 86_400.0)).abs() < 0.001);
        assert_eq!(synchronizer.jumps(), 0);
    }
}
