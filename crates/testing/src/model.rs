//! The show as the contract of `control` describes it: periods counted one by one, commands executed as the table
//! states.
//!
//! It shares nothing with the show clock, which computes each period from the beginning of its stretch.

use bench_dragon_messages::control::{Code, Command};
use bench_dragon_messages::state::PlaybackState;

/// The simulated time of a model within a stretch of constant rate.
pub trait Time {
    /// Begins a stretch at `seconds`, played at `scale` simulated seconds per second.
    fn begin(&mut self, seconds: f64, scale: f64);
    /// Moves on by one period.
    fn next_period(&mut self);
    /// Returns the simulated seconds.
    fn seconds(&self) -> f64;
}

/// The formula of the contract: sim0 + scale * periods / rate.
#[derive(Debug, Clone)]
pub struct Formula {
    rate: f64,
    sim0: f64,
    scale: f64,
    periods: u64,
}

impl Formula {
    /// Creates the time of a show of `rate` frames per second.
    pub fn new(rate: f64) -> Self {
        Self { rate, sim0: 0.0, scale: 1.0, periods: 0 }
    }
}

impl Time for Formula {
    fn begin(&mut self, seconds: f64, scale: f64) {
        (self.sim0, self.scale, self.periods) = (seconds, scale, 0);
    }

    fn next_period(&mut self) {
        self.periods += 1;
    }

    fn seconds(&self) -> f64 {
        self.sim0 + self.scale * self.periods as f64 / self.rate
    }
}

/// A sum in whole numbers, for times and steps that are multiples of 1 / [`Sum::UNITS`] s: exact, without the formula.
#[derive(Debug, Clone)]
pub struct Sum {
    rate: i64,
    units: i64,
    per_period: i64,
}

impl Sum {
    /// Units in a simulated second.
    pub const UNITS: i64 = 1 << 14;

    /// Creates the time of a show of `rate` frames per second.
    pub fn new(rate: i64) -> Self {
        Self { rate, units: 0, per_period: 0 }
    }
}

impl Time for Sum {
    fn begin(&mut self, seconds: f64, scale: f64) {
        self.units = (seconds * Self::UNITS as f64) as i64;
        self.per_period = (scale * Self::UNITS as f64) as i64 / self.rate;
    }

    fn next_period(&mut self) {
        self.units += self.per_period;
    }

    fn seconds(&self) -> f64 {
        self.units as f64 / Self::UNITS as f64
    }
}

/// A cue of a model.
#[derive(Debug, Clone, Copy)]
pub struct ModelCue {
    /// Simulated seconds.
    pub time: f64,
    /// True if the show waits there.
    pub pauses: bool,
}

/// The properties of a show that its commands do not change.
#[derive(Debug, Clone)]
pub struct ModelShow {
    /// Simulated seconds at the start.
    pub start: f64,
    /// Simulated seconds at the end.
    pub end: f64,
    /// Periods at the end before the show begins again; `None` if it does not.
    pub end_hold: Option<u64>,
    /// In the order of their times.
    pub cues: Vec<ModelCue>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    Playing,
    Paused,
    Held,
}

/// A show that counts its periods.
#[derive(Debug, Clone)]
pub struct Model<T> {
    show: ModelShow,
    time: T,
    tick: u64,
    scale: f64,
    mode: Mode,
    /// Periods that a step has left.
    step: Option<u64>,
    waits: bool,
    periods_at_end: u64,
    /// Jumps of simulated time.
    pub epoch: u32,
    /// The number of times that the show has begun again.
    pub shows_played: u64,
    /// Cues passed, in the order of their times.
    pub passed: usize,
    /// Cues reached, each with the value of `shows_played` at that moment. The caller empties it.
    pub reached: Vec<(u64, usize)>,
    /// The result of a step that is over. The caller takes it.
    pub step_outcome: Option<Code>,
    /// Set by a jump that was commanded. The caller resets it.
    pub jumped_by_command: bool,
}

impl<T: Time> Model<T> {
    /// Creates a model that is played at `scale`. `waits`: it is paused at its start until `go` or `resume`.
    pub fn new(show: ModelShow, time: T, scale: f64, waits: bool) -> Self {
        let mut model = Self {
            time,
            tick: 0,
            scale,
            mode: if waits { Mode::Paused } else { Mode::Playing },
            step: None,
            waits,
            periods_at_end: 0,
            epoch: 0,
            shows_played: 0,
            passed: show.cues.iter().filter(|cue| cue.time < show.start).count(),
            reached: Vec::new(),
            step_outcome: None,
            jumped_by_command: false,
            show,
        };
        model.begin(model.show.start);
        model.pass_cues();
        model
    }

    /// Returns true if simulated time advances.
    pub fn advances(&self) -> bool {
        self.mode == Mode::Playing || self.step.is_some()
    }

    /// Returns the simulated seconds.
    pub fn sim_time(&self) -> f64 {
        self.time.seconds().min(self.show.end)
    }

    /// Returns the simulated seconds per second, as in force.
    pub fn time_scale(&self) -> f64 {
        if self.advances() { self.scale } else { 0.0 }
    }

    /// Returns the simulated seconds per second while the show plays.
    pub fn playing_rate(&self) -> f64 {
        self.scale
    }

    /// Returns the playback state.
    pub fn playback(&self) -> PlaybackState {
        match self.mode {
            Mode::Held => PlaybackState::Held,
            Mode::Paused if !self.advances() => PlaybackState::Paused,
            _ if self.is_at_end() => PlaybackState::Ended,
            _ => PlaybackState::Playing,
        }
    }

    fn is_at_end(&self) -> bool {
        self.sim_time() >= self.show.end
    }

    /// Counts on to the period `tick`.
    pub fn count_to(&mut self, tick: u64) {
        while self.tick < tick {
            let stays = self.is_at_end() && self.show.end_hold.is_none() && self.step.is_none();
            if !self.advances() || stays {
                self.tick = tick;
            } else {
                self.tick += 1;
                self.next_period();
            }
        }
    }

    fn next_period(&mut self) {
        if self.is_at_end() {
            self.periods_at_end += 1;
            if self.show.end_hold.is_some_and(|periods| self.periods_at_end > periods) {
                self.shows_played += 1;
                self.jump(self.show.start);
            }
        } else {
            self.time.next_period();
        }
        self.step.iter_mut().for_each(|left| *left -= 1);
        self.pass_cues();
        if self.step == Some(0) {
            self.stand(self.sim_time(), Mode::Paused);
            self.end_step(Code::Done);
        }
    }

    fn pass_cues(&mut self) {
        while self.advances() && self.show.cues.get(self.passed).is_some_and(|cue| cue.time <= self.sim_time()) {
            self.reached.push((self.shows_played, self.passed));
            let ModelCue { time, pauses } = self.show.cues[self.passed];
            self.passed += 1;
            if pauses {
                self.stand(time, Mode::Paused);
                self.waits = true;
                self.end_step(Code::Done);
            }
        }
    }

    fn begin(&mut self, time: f64) {
        self.time.begin(time, self.scale);
        self.periods_at_end = 0;
    }

    fn stand(&mut self, time: f64, mode: Mode) {
        self.time.begin(time, self.scale);
        self.mode = mode;
    }

    fn end_step(&mut self, code: Code) {
        if self.step.take().is_some() {
            self.step_outcome = Some(code);
        }
    }

    fn jump(&mut self, time: f64) {
        self.epoch += 1;
        self.passed = self.show.cues.iter().filter(|cue| cue.time < time).count();
        self.begin(time);
    }

    fn jump_by_command(&mut self, time: f64) -> Code {
        self.end_step(Code::Refused);
        self.jump(time);
        self.pass_cues();
        self.jumped_by_command = true;
        Code::Done
    }

    fn stop(&mut self, now: f64, mode: Mode) -> Code {
        self.stand(now, mode);
        self.end_step(Code::Refused);
        Code::Done
    }

    fn play(&mut self, now: f64) -> Code {
        self.end_step(Code::Refused);
        (self.mode, self.waits) = (Mode::Playing, false);
        self.begin(now);
        self.pass_cues();
        Code::Done
    }

    /// Executes a command at the beginning of the present period. Returns `None` for a step that has begun.
    pub fn execute(&mut self, command: Command) -> Option<Code> {
        let (now, held) = (self.sim_time(), self.mode == Mode::Held);
        let code = match command {
            Command::State => Code::Done,
            Command::Hold if held => Code::Already,
            Command::Hold => self.stop(now, Mode::Held),
            Command::Release if held => {
                self.mode = Mode::Paused;
                Code::Done
            }
            _ if held => Code::Refused,
            Command::Release => Code::Refused,
            Command::Pause if self.advances() => self.stop(now, Mode::Paused),
            Command::Pause => Code::Already,
            Command::Resume if self.mode == Mode::Playing => Code::Already,
            Command::Go if !self.waits => Code::Refused,
            Command::Resume | Command::Go => self.play(now),
            Command::Rate(rate) if !(1e-6..=1e6).contains(&rate) => Code::OutOfRange,
            Command::Rate(rate) if rate == self.scale => Code::Already,
            Command::Rate(rate) => {
                self.scale = rate;
                self.begin(now);
                Code::Done
            }
            Command::Seek(time) if !(0.0..=self.show.end).contains(&time) => Code::OutOfRange,
            Command::Seek(time) => self.jump_by_command(time),
            Command::Restart => self.jump_by_command(self.show.start),
            Command::Step(_) if self.advances() => Code::Refused,
            Command::Step(periods) => {
                self.begin(now);
                (self.step, self.step_outcome) = (Some(periods), None);
                self.pass_cues();
                return None;
            }
        };
        Some(code)
    }
}
