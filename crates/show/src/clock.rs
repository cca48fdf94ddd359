//! The show clock: from ticks and commands to simulated time.
//!
//! The time is computed from the integer tick: sim0 + time_scale * (tick - tick0) / rate. Each loop, and each command
//! that changes the time or the rate, sets a new (sim0, tick0, time_scale), which can round sim0 once. Between these
//! changes no error accumulates, so the same ticks with the same commands give the same bits. Pure.

#[cfg(test)]
mod tests;

use crate::scene::AtEnd;

use super::Playback;
use bench_dragon_messages::control::{Code, Command, RATES};
use bench_dragon_messages::state::PlaybackState;

/// The state of the clock at a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShowTime {
    /// Simulated seconds since the start of the scene.
    pub sim_time: f64,
    /// Simulated seconds per second of wall time in force: 0 while paused or held, unchanged after the end of the show.
    pub time_scale: f64,
    /// The playback state: simulated time advances or stands still.
    pub playback: PlaybackState,
    /// Jumps of simulated time so far: loops, seeks, restarts.
    pub epoch: u32,
    /// The number of times that the show has ended and started again.
    pub shows_played: u64,
    /// The number of cues passed, in the order of their times.
    pub cues_passed: usize,
}

/// The time of a cue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CueTime {
    /// Simulated seconds.
    pub time: f64,
    /// True if the show pauses at the cue and waits for [`Command::Go`].
    pub pauses: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mode {
    Playing,
    Paused,
    Held,
}

/// The clock of a show with a known end.
#[derive(Debug, Clone)]
pub struct ShowClock {
    rate: f64,
    start: f64,
    freeze_time: f64,
    /// Periods for which a looping show stands at its end; `None` if it does not loop.
    end_hold: Option<u64>,
    /// The cues in the order of their times.
    cues: Vec<CueTime>,
    /// The simulated time at the beginning of the current stretch, with its tick; the current time while time stands
    /// still.
    sim0: f64,
    tick0: u64,
    time_scale: f64,
    /// The first tick of this stretch at or past the end of the show.
    ended_tick: u64,
    mode: Mode,
    /// The tick at which a step ends.
    step_end: Option<u64>,
    step_outcome: Option<Code>,
    /// True if [`Command::Go`] ends the pause.
    waits: bool,
    epoch: u32,
    shows_played: u64,
    cues_passed: usize,
    /// Cues reached since [`ShowClock::clear_reached`]. Its capacity is reserved in advance.
    reached: Vec<usize>,
}

impl ShowClock {
    /// Creates the clock of a show that ends at `freeze_time`, in simulated seconds. `cues` are in the order of their
    /// times.
    pub fn new(playback: &Playback, freeze_time: f64, cues: Vec<CueTime>) -> Self {
        let Playback { start, time_scale, rate, at_end, end_hold, paused, .. } = *playback;
        let end_hold = match at_end {
            AtEnd::Hold => None,
            AtEnd::Loop => Some((end_hold * rate).round() as u64),
        };
        let mut clock = Self {
            rate,
            start,
            freeze_time,
            end_hold,
            sim0: start,
            tick0: 0,
            time_scale,
            ended_tick: 0,
            mode: if paused { Mode::Paused } else { Mode::Playing },
            step_end: None,
            step_outcome: None,
            waits: paused,
            epoch: 0,
            shows_played: 0,
            cues_passed: 0,
            reached: Vec::with_capacity(2 * cues.len()),
            cues,
        };
        clock.begin(0, start);
        clock.cues_passed = clock.cues_before(start);
        clock
    }

    /// Returns the simulated time at which the show ends, in seconds.
    pub fn freeze_time(&self) -> f64 {
        self.freeze_time
    }

    /// Returns the simulated seconds per second of wall time while the show plays.
    pub fn playing_rate(&self) -> f64 {
        self.time_scale
    }

    /// Returns the cues reached since the last [`clear_reached`](Self::clear_reached), as indices in the order of
    /// times.
    pub fn reached(&self) -> &[usize] {
        &self.reached
    }

    /// Clears the list of cues reached.
    pub fn clear_reached(&mut self) {
        self.reached.clear();
    }

    /// Returns the result of the last step, if [`take_step_outcome`](Self::take_step_outcome) has not returned it yet.
    pub fn step_outcome(&self) -> Option<Code> {
        self.step_outcome
    }

    /// Returns the result of the last step, once.
    pub fn take_step_outcome(&mut self) -> Option<Code> {
        self.step_outcome.take()
    }

    /// Advances to a tick, which must not decrease, and returns the state there.
    pub fn advance(&mut self, tick: u64) -> ShowTime {
        while self.advances() {
            // A step ends before anything later.
            let until = self.step_end.map_or(tick, |end| end.min(tick));
            let time = self.sim_time(until);
            let ahead = &self.cues[self.cues_passed..];
            if let Some(next) = ahead.iter().position(|cue| cue.pauses && cue.time <= time) {
                let cue = self.cues_passed + next;
                self.reach(cue + 1);
                self.stand_at(self.cues[cue].time, Mode::Paused);
                self.waits = true;
                self.finish_step(Code::Done);
                break;
            }
            self.reach(self.cues_passed + ahead.iter().take_while(|cue| cue.time <= time).count());
            let begins_again = self.end_hold.map(|ticks| self.ended_tick.saturating_add(1).saturating_add(ticks));
            if let Some(first) = begins_again.filter(|first| *first <= until) {
                self.begin_again(first, until);
            } else if self.step_end.is_some_and(|end| end <= tick) {
                self.stand_at(time, Mode::Paused);
                self.finish_step(Code::Done);
            } else {
                break;
            }
        }
        self.at(tick)
    }

    /// Executes a command at the beginning of the period `tick`. Returns `None` for a step:
    /// [`take_step_outcome`](Self::take_step_outcome) returns its result later.
    pub fn apply(&mut self, tick: u64, command: Command) -> Option<Code> {
        let now = self.advance(tick).sim_time;
        if self.mode == Mode::Held && !matches!(command, Command::State | Command::Hold | Command::Release) {
            return Some(Code::Refused);
        }
        Some(match command {
            Command::State => Code::Done,
            Command::Pause if !self.advances() => Code::Already,
            Command::Pause => {
                self.stand_at(now, Mode::Paused);
                self.finish_step(Code::Refused);
                Code::Done
            }
            Command::Resume if self.mode == Mode::Playing => Code::Already,
            Command::Go if !self.waits => Code::Refused,
            Command::Resume | Command::Go => {
                self.finish_step(Code::Refused);
                self.mode = Mode::Playing;
                self.waits = false;
                self.begin(tick, now);
                Code::Done
            }
            Command::Rate(rate) if !RATES.contains(&rate) => Code::OutOfRange,
            Command::Rate(rate) if rate == self.time_scale => Code::Already,
            Command::Rate(rate) => {
                self.time_scale = rate;
                self.begin(tick, now);
                Code::Done
            }
            Command::Seek(time) if !(0.0..=self.freeze_time).contains(&time) => Code::OutOfRange,
            Command::Seek(time) => self.jump(tick, time),
            Command::Restart => self.jump(tick, self.start),
            Command::Step(_) if self.advances() => Code::Refused,
            Command::Step(periods) => {
                self.begin(tick, now);
                self.step_outcome = None;
                self.step_end = Some(tick.saturating_add(periods));
                return None;
            }
            Command::Hold if self.mode == Mode::Held => Code::Already,
            Command::Hold => {
                self.stand_at(now, Mode::Held);
                self.finish_step(Code::Refused);
                Code::Done
            }
            Command::Release if self.mode != Mode::Held => Code::Refused,
            Command::Release => {
                self.mode = Mode::Paused;
                Code::Done
            }
        })
    }

    /// Returns the state at a tick of the current stretch.
    fn at(&self, tick: u64) -> ShowTime {
        let advances = self.advances();
        let sim_time = if advances { self.sim_time(tick) } else { self.sim0.min(self.freeze_time) };
        ShowTime {
            sim_time,
            time_scale: if advances { self.time_scale } else { 0.0 },
            playback: match self.mode {
                Mode::Held => PlaybackState::Held,
                Mode::Paused if !advances => PlaybackState::Paused,
                _ if sim_time >= self.freeze_time => PlaybackState::Ended,
                _ => PlaybackState::Playing,
            },
            epoch: self.epoch,
            shows_played: self.shows_played,
            cues_passed: self.cues_passed,
        }
    }

    fn advances(&self) -> bool {
        self.mode == Mode::Playing || self.step_end.is_some()
    }

    fn sim_time(&self, tick: u64) -> f64 {
        self.unclamped(tick - self.tick0).min(self.freeze_time)
    }

    /// Returns the simulated time `ticks` ticks after the beginning of the stretch, as if the show had no end.
    fn unclamped(&self, ticks: u64) -> f64 {
        self.sim0 + self.time_scale * ticks as f64 / self.rate
    }

    /// Starts a stretch.
    fn begin(&mut self, tick: u64, time: f64) {
        (self.tick0, self.sim0) = (tick, time);
        self.ended_tick = tick.saturating_add(self.ticks_to_end());
    }

    /// Returns the ticks from the beginning of this stretch to the first tick at or past the end. Bisection is exact:
    /// the rounded time of a tick never falls.
    fn ticks_to_end(&self) -> u64 {
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

    fn stand_at(&mut self, time: f64, mode: Mode) {
        self.sim0 = time;
        self.mode = mode;
    }

    /// Jumps to another time: a new epoch, in which the cues jumped over are not reached.
    fn jump(&mut self, tick: u64, time: f64) -> Code {
        self.finish_step(Code::Refused);
        self.epoch = self.epoch.wrapping_add(1);
        self.cues_passed = self.cues_before(time);
        self.begin(tick, time);
        Code::Done
    }

    /// Starts the show again at the tick `first`, and again for each showing that ends before `until`.
    fn begin_again(&mut self, first: u64, until: u64) {
        self.begin(first, self.start);
        self.cues_passed = self.cues_before(self.start);
        let length = (self.ended_tick - first).saturating_add(1).saturating_add(self.end_hold.unwrap_or(0));
        let pauses = self.cues[self.cues_passed..].iter().any(|cue| cue.pauses);
        let further = if pauses { 0 } else { (until - first) / length };
        self.begin(first + further * length, self.start);
        self.shows_played += 1 + further;
        self.epoch = self.epoch.wrapping_add(1).wrapping_add(further as u32);
    }

    fn cues_before(&self, time: f64) -> usize {
        self.cues.partition_point(|cue| cue.time < time)
    }

    /// Passes cues up to an index in their order.
    fn reach(&mut self, passed: usize) {
        for cue in self.cues_passed..passed {
            if self.reached.len() < 2 * self.cues.len() {
                self.reached.push(cue);
            }
        }
        self.cues_passed = passed;
    }

    fn finish_step(&mut self, code: Code) {
        if self.step_end.take().is_some() {
            self.step_outcome = Some(code);
        }
    }
}
