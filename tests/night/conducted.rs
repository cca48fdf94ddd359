//! A model of the promised show: periods counted one by one, commands executed by the table of commands.
//!
//! The model shares with the show's own clock, which computes each period from the beginning of its stretch, only the
//! formula of the contract: sim0 + rate * (tick - tick0) / frame rate, a new (sim0, tick0, rate) at each command.

use bench_dragon::messages::control::{Code, Command};
use bench_dragon::messages::state::PlaybackState;

/// A cue, by its time.
#[derive(Clone, Copy)]
pub struct CueAt {
    pub time: f64,
    pub pauses: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Mode {
    Playing,
    Paused,
    Held,
}

/// A show that counts periods.
pub struct Conducted {
    pub rate: f64,
    pub start: f64,
    pub freeze: f64,
    /// Periods at the end before the show begins again.
    pub end_hold: Option<u64>,
    pub cues: Vec<CueAt>,
    tick: u64,
    sim0: f64,
    tick0: u64,
    scale: f64,
    mode: Mode,
    /// Remaining periods of a step.
    step: Option<u64>,
    waits: bool,
    periods_at_end: u64,
    pub epoch: u32,
    pub shows_played: u64,
    pub passed: usize,
    /// Cues reached, each with the number of the show that reached it.
    reached: Vec<(u64, usize)>,
    pub step_outcome: Option<Code>,
    /// True if a command has restarted the alerts.
    pub jumped_by_command: bool,
}

impl Conducted {
    pub fn new(rate: f64, start: f64, freeze: f64, end_hold: Option<u64>, cues: Vec<CueAt>, waits: bool) -> Self {
        let passed = cues.iter().filter(|cue| cue.time < start).count();
        let mut show = Self {
            rate,
            start,
            freeze,
            end_hold,
            cues,
            tick: 0,
            sim0: start,
            tick0: 0,
            scale: 1.0,
            mode: if waits { Mode::Paused } else { Mode::Playing },
            step: None,
            waits,
            periods_at_end: 0,
            epoch: 0,
            shows_played: 0,
            passed,
            reached: Vec::new(),
            step_outcome: None,
            jumped_by_command: false,
        };
        show.pass_cues();
        show
    }

    /// Returns the same show, played at another rate from its beginning.
    pub fn at_rate(mut self, scale: f64) -> Self {
        self.scale = scale;
        self
    }

    fn moves(&self) -> bool {
        self.mode == Mode::Playing || self.step.is_some()
    }

    pub fn sim_time(&self) -> f64 {
        let elapsed = if self.moves() { self.tick - self.tick0 } else { 0 };
        (self.sim0 + self.scale * elapsed as f64 / self.rate).min(self.freeze)
    }

    pub fn time_scale(&self) -> f64 {
        if self.moves() { self.scale } else { 0.0 }
    }

    pub fn playing_rate(&self) -> f64 {
        self.scale
    }

    pub fn playback(&self) -> PlaybackState {
        match self.mode {
            Mode::Held => PlaybackState::Held,
            Mode::Paused if !self.moves() => PlaybackState::Paused,
            _ if self.sim_time() >= self.freeze => PlaybackState::Ended,
            _ => PlaybackState::Playing,
        }
    }

    /// Returns the cues reached since the last call; cues of shows passed entirely in between are not announced.
    pub fn take_reached(&mut self, first_show: u64) -> Vec<usize> {
        let last_show = self.shows_played;
        let shown = self.reached.drain(..).filter(|(show, _)| *show == first_show || *show == last_show);
        shown.map(|(_, cue)| cue).collect()
    }

    /// Counts up to the period `tick`.
    pub fn count_to(&mut self, tick: u64) {
        while self.tick < tick {
            let at_end = self.sim_time() >= self.freeze && self.end_hold.is_none() && self.step.is_none();
            if !self.moves() || at_end {
                self.tick = tick;
            } else {
                self.next_period();
            }
        }
    }

    fn next_period(&mut self) {
        let was_at_end = self.sim_time() >= self.freeze;
        self.tick += 1;
        if was_at_end {
            self.periods_at_end += 1;
            if self.end_hold.is_some_and(|periods| self.periods_at_end > periods) {
                self.shows_played += 1;
                self.jump(self.start);
            }
        }
        self.step.iter_mut().for_each(|left| *left -= 1);
        self.pass_cues();
        if self.step == Some(0) {
            self.stand(self.sim_time(), Mode::Paused);
            self.end_step(Code::Done);
        }
    }

    fn pass_cues(&mut self) {
        while self.moves() && self.cues.get(self.passed).is_some_and(|cue| cue.time <= self.sim_time()) {
            self.reached.push((self.shows_played, self.passed));
            let CueAt { time, pauses } = self.cues[self.passed];
            self.passed += 1;
            if pauses {
                self.stand(time, Mode::Paused);
                self.waits = true;
                self.end_step(Code::Done);
            }
        }
    }

    fn stand(&mut self, time: f64, mode: Mode) {
        (self.sim0, self.tick0, self.mode) = (time, self.tick, mode);
    }

    fn end_step(&mut self, code: Code) {
        if self.step.take().is_some() {
            self.step_outcome = Some(code);
        }
    }

    /// Begins a new stretch.
    fn begin(&mut self, time: f64) {
        (self.sim0, self.tick0, self.periods_at_end) = (time, self.tick, 0);
    }

    fn jump(&mut self, time: f64) {
        self.epoch += 1;
        self.passed = self.cues.iter().filter(|cue| cue.time < time).count();
        self.begin(time);
    }

    fn jump_by_command(&mut self, time: f64) -> Code {
        self.end_step(Code::Refused);
        self.jump(time);
        self.pass_cues();
        self.jumped_by_command = true;
        Code::Done
    }

    /// Executes a command at the beginning of the present period; returns `None` for a step that has begun.
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
            Command::Pause if self.moves() => self.stop(now, Mode::Paused),
            Command::Pause => Code::Already,
            Command::Resume if self.mode == Mode::Playing => Code::Already,
            Command::Go if !self.waits => Code::Refused,
            Command::Resume | Command::Go => self.go_on(now),
            Command::Rate(rate) if !(1e-6..=1e6).contains(&rate) => Code::OutOfRange,
            Command::Rate(rate) if rate == self.scale => Code::Already,
            Command::Rate(rate) => {
                self.scale = rate;
                self.begin(now);
                Code::Done
            }
            Command::Seek(time) if !(0.0..=self.freeze).contains(&time) => Code::OutOfRange,
            Command::Seek(time) => self.jump_by_command(time),
            Command::Restart => self.jump_by_command(self.start),
            Command::Step(_) if self.moves() => Code::Refused,
            Command::Step(periods) => {
                self.begin(now);
                (self.step, self.step_outcome) = (Some(periods), None);
                self.pass_cues();
                return None;
            }
        };
        Some(code)
    }

    fn stop(&mut self, now: f64, mode: Mode) -> Code {
        self.stand(now, mode);
        self.end_step(Code::Refused);
        Code::Done
    }

    fn go_on(&mut self, now: f64) -> Code {
        self.end_step(Code::Refused);
        (self.mode, self.waits) = (Mode::Playing, false);
        self.begin(now);
        self.pass_cues();
        Code::Done
    }
}
