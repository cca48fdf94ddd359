//! The check of responses against the table of commands: the codes and states that the responses so far allow.
//!
//! The check uses the times of the scene and of the responses; the [`record`](super::record) compares times with
//! frames. Because a step or a cue may change the state between two responses, every possible state is kept, and each
//! response removes the states that would have answered otherwise.
//!
//! The tests' model of a show (`crates/testing/src/model.rs`) cannot check a soak, because it needs the period of each
//! command, which no client knows.

use bench_dragon_messages::control::{Code, Command, RATES, Refusal};
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_messages::{ControlResponse, Stage};

/// The facts of a show that decide its answers: from its scene, not from the publisher under test.
#[derive(Debug, Clone, PartialEq)]
pub struct ShowFacts {
    /// Simulated seconds at which the show ends.
    pub end: f64,
    /// The times of its cues in their order, each with true if the show waits there.
    pub cues: Vec<(f64, bool)>,
}

impl ShowFacts {
    /// Returns true if a stage has the same end and, as far as it lists them, the same cues.
    pub(super) fn agree_with(&self, stage: &Stage) -> bool {
        let listed = stage.cue_list.iter().map(|cue| (cue.time, cue.pauses == 1));
        stage.freeze_time == self.end
            && stage.cues as usize == self.cues.len()
            && self.cues.iter().copied().zip(listed).all(|(a, b)| a == b)
    }

    /// Returns true if the show waits at a cue at this time.
    pub(super) fn waits_at(&self, time: f64) -> bool {
        self.cues.iter().any(|cue| cue.1 && cue.0 == time)
    }

    fn has_pausing_cue(&self) -> bool {
        self.cues.iter().any(|cue| cue.1)
    }

    /// Returns true if this number of cues can be passed at this time. A cue at the time itself may be passed or not.
    fn can_have_passed(&self, cue: u32, time: f64) -> bool {
        let before = self.cues.iter().filter(|cue| cue.0 < time).count();
        let until = self.cues.iter().filter(|cue| cue.0 <= time).count();
        (before..=until).contains(&(cue as usize))
    }
}

/// A response that the show cannot have given, by the responses that it can have given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum WrongAnswer {
    /// The response is of this tick or an earlier one.
    #[error("expected a tick after {0}")]
    Tick(u64),
    /// Another code, playback state or time scale.
    #[error("expected {}", .0.iter().map(in_words).collect::<Vec<_>>().join(", or "))]
    States(Vec<(Code, PlaybackState, f64)>),
    /// A jump to another simulated time than this one, in seconds.
    #[error("expected t = {0} s")]
    Time(f64),
    /// Another number of cues.
    #[error("expected the number of cues until then")]
    Cues,
    /// A result that no step can have had.
    #[error("expected one of {0:?}")]
    Steps(Vec<Step>),
}

fn in_words((code, playback, scale): &(Code, PlaybackState, f64)) -> String {
    format!("{}, {} at {scale} x", code.name(), playback.name())
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mode {
    Playing,
    Paused,
    Held,
}

/// The state of the step that was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    None,
    Sent,
    Running,
    Over(Code),
}

/// A state that the responses so far allow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Possible {
    mode: Mode,
    waits: bool,
    step: Step,
}

impl Possible {
    fn advances(self) -> bool {
        self.mode == Mode::Playing || self.step == Step::Running
    }

    fn over(self, code: Code) -> Step {
        if self.step == Step::Running { Step::Over(code) } else { self.step }
    }

    fn at_cue(self) -> Self {
        Self { mode: Mode::Paused, waits: true, step: self.over(Code::Done) }
    }

    /// Returns the code of the table for a command in this state.
    fn code(self, command: Command, rate: f64, end: f64) -> Code {
        let (entry, held) = (command.entry(), self.mode == Mode::Held);
        if held && !entry.allowed_while_held {
            return Code::Refused;
        }
        match (entry.refusal, command) {
            (Refusal::RateOutOfRange, Command::Rate(rate)) if !RATES.contains(&rate) => Code::OutOfRange,
            (Refusal::TimeOutOfRange, Command::Seek(time)) if !(0.0..=end).contains(&time) => Code::OutOfRange,
            (Refusal::NotPaused, _) if self.advances() => Code::Refused,
            (Refusal::NotHeld, _) if !held => Code::Refused,
            (Refusal::NotWaiting, _) if !self.waits => Code::Refused,
            (_, Command::Rate(wanted)) if wanted == rate => Code::Already,
            (_, Command::Hold) if held => Code::Already,
            (_, Command::Pause) if !self.advances() => Code::Already,
            (_, Command::Resume) if self.mode == Mode::Playing => Code::Already,
            _ => Code::Done,
        }
    }

    /// Returns the state after a command that was done.
    fn after(self, command: Command) -> Self {
        let step = self.over(Code::Refused);
        match command {
            Command::Pause => Self { mode: Mode::Paused, step, ..self },
            Command::Hold => Self { mode: Mode::Held, step, ..self },
            Command::Resume | Command::Go => Self { mode: Mode::Playing, waits: false, step },
            Command::Seek(_) | Command::Restart => Self { step, ..self },
            Command::Release => Self { mode: Mode::Paused, ..self },
            Command::Step(_) => Self { step: Step::Running, ..self },
            Command::State | Command::Rate(_) => self,
        }
    }
}

/// Every state that the responses so far allow.
#[derive(Debug, Clone)]
pub(super) struct AnswerCheck {
    facts: ShowFacts,
    possible: Vec<Possible>,
    /// Simulated seconds per second while the show plays.
    rate: f64,
    /// Tick and simulated time of the latest response.
    tick: u64,
    time: f64,
    /// The rate, in frames per second.
    frame_rate: f64,
}

impl AnswerCheck {
    /// Creates the check of a show that waits at its start.
    pub fn new(facts: ShowFacts, frame_rate: f64) -> Self {
        let waiting = Possible { mode: Mode::Paused, waits: true, step: Step::None };
        Self { facts, possible: vec![waiting], rate: 1.0, tick: 0, time: 0.0, frame_rate }
    }

    /// Returns true if the show can have waited at a cue since the latest response, at the speed it plays at.
    fn can_have_waited(&self, tick: u64) -> bool {
        let reach = (tick.saturating_sub(self.tick) + 1) as f64 / self.frame_rate * self.rate;
        // A looping show may have begun again.
        let ahead = |cue: f64| (cue - self.time).rem_euclid(self.facts.end);
        self.facts.cues.iter().any(|(time, waits)| *waits && ahead(*time) <= reach)
    }

    /// Continues from the latest response.
    fn take_time(&mut self, answer: &ControlResponse) {
        if answer.tick >= self.tick {
            (self.tick, self.time) = (answer.tick, answer.sim_time);
        }
    }

    /// Records that a step was sent, whose response comes later: [`step_answered`](Self::step_answered).
    pub fn step_sent(&mut self) {
        self.possible.iter_mut().for_each(|state| state.step = Step::Sent);
    }

    /// Returns true if a step that was sent has certainly begun, or is over.
    pub fn step_has_begun(&self) -> bool {
        self.possible.iter().all(|state| state.step != Step::Sent)
    }

    /// Adds the states that the show may have reached without a response. `at_cue`: the show may have paused at a cue.
    fn advance(&mut self, at_cue: bool) {
        let mut place = 0;
        while let Some(&state) = self.possible.get(place) {
            place += 1;
            let mut add = |next: Possible| {
                if !self.possible.contains(&next) {
                    self.possible.push(next);
                }
            };
            if at_cue && state.advances() {
                add(state.at_cue());
            }
            match state.step {
                Step::Running => add(Possible { mode: Mode::Paused, step: Step::Over(Code::Done), ..state }),
                Step::Sent if state.advances() || state.mode == Mode::Held => {
                    add(Possible { step: Step::Over(Code::Refused), ..state });
                }
                Step::Sent => add(Possible { step: Step::Running, ..state }),
                Step::None | Step::Over(_) => (),
            }
        }
    }

    /// Checks the response to a command that is no step that ran.
    ///
    /// # Errors
    /// The expected response, if this one is wrong. The check continues from the response.
    pub fn answered(&mut self, command: Command, answer: &ControlResponse) -> Result<(), WrongAnswer> {
        let result = self.allows(command, answer);
        if result.is_err() {
            self.adopt(answer);
        }
        self.take_time(answer);
        result
    }

    fn allows(&mut self, command: Command, answer: &ControlResponse) -> Result<(), WrongAnswer> {
        if answer.tick <= self.tick && self.tick > 0 {
            return Err(WrongAnswer::Tick(self.tick));
        }
        let time = answer.sim_time;
        let has_jumped = |code| code == Some(Code::Done) && matches!(command, Command::Seek(_) | Command::Restart);
        let is_at_cue = self.facts.waits_at(time);
        // A jump leaves the time of the cue, and so does a step that begins there.
        let has_left = has_jumped(answer.result()) || self.possible.iter().any(|state| state.step == Step::Sent);
        self.advance(is_at_cue || has_left && self.can_have_waited(answer.tick));
        let mut allowed: Vec<Possible> = Vec::new();
        let mut expected = Vec::new();
        for state in std::mem::take(&mut self.possible) {
            // A step that begins has no response at this tick.
            let code = state.code(command, self.rate, self.facts.end);
            let done = code == Code::Done;
            if done && matches!(command, Command::Step(_)) {
                continue;
            }
            let after = if done { state.after(command) } else { state };
            let rate = if let (true, Command::Rate(rate)) = (done, command) { rate } else { self.rate };
            let cue_follows = is_at_cue && after.advances();
            for after in [Some(after), cue_follows.then(|| after.at_cue())].into_iter().flatten() {
                let playback = match after.mode {
                    _ if after.advances() && time >= self.facts.end => PlaybackState::Ended,
                    _ if after.advances() => PlaybackState::Playing,
                    Mode::Held => PlaybackState::Held,
                    Mode::Playing | Mode::Paused => PlaybackState::Paused,
                };
                let scale = if after.advances() { rate } else { 0.0 };
                let wanted = (code, playback, scale);
                if (answer.result(), answer.playback_state(), answer.time_scale) != (Some(code), Some(playback), scale)
                {
                    if !expected.contains(&wanted) {
                        expected.push(wanted);
                    }
                } else if !allowed.contains(&after) {
                    allowed.push(after);
                }
            }
        }
        self.possible = allowed;
        if self.possible.is_empty() {
            return Err(WrongAnswer::States(expected));
        }
        let target = match command {
            Command::Seek(time) if has_jumped(answer.result()) => Some(time),
            Command::Restart if has_jumped(answer.result()) => Some(0.0),
            _ => None,
        };
        if let Some(target) = target.filter(|target| *target != time) {
            return Err(WrongAnswer::Time(target));
        }
        if let (Some(Code::Done), Command::Rate(rate)) = (answer.result(), command) {
            self.rate = rate;
        }
        self.check_cue(answer)
    }

    fn check_cue(&self, answer: &ControlResponse) -> Result<(), WrongAnswer> {
        let passed = self.facts.can_have_passed(answer.cue, answer.sim_time);
        if passed { Ok(()) } else { Err(WrongAnswer::Cues) }
    }

    /// Checks the response to the step that was sent. The response may be older than responses to other commands.
    ///
    /// # Errors
    /// As [`answered`](Self::answered).
    pub fn step_answered(&mut self, answer: &ControlResponse) -> Result<(), WrongAnswer> {
        self.advance(self.facts.has_pausing_cue());
        let steps = self.possible.iter().map(|state| state.step).collect();
        self.possible.retain(|state| answer.result().is_some_and(|code| state.step == Step::Over(code)));
        let result = if self.possible.is_empty() { Err(WrongAnswer::Steps(steps)) } else { self.check_cue(answer) };
        if self.possible.is_empty() {
            self.adopt(answer);
        }
        self.possible.iter_mut().for_each(|state| state.step = Step::None);
        self.possible.dedup();
        self.take_time(answer);
        result
    }

    /// Continues from a response, after a wrong or a lost one.
    pub fn adopt(&mut self, answer: &ControlResponse) {
        let mode = match answer.playback_state() {
            Some(PlaybackState::Paused) => Mode::Paused,
            Some(PlaybackState::Held) => Mode::Held,
            _ => Mode::Playing,
        };
        if answer.time_scale > 0.0 {
            self.rate = answer.time_scale;
        }
        self.possible = [true, false].map(|waits| Possible { mode, waits, step: Step::None }).to_vec();
        self.take_time(answer);
    }
}

#[cfg(test)]
mod tests;
