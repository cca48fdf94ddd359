//! The command table once more, for checking answers: which answers the show may give, by those it has given.
//!
//! Independent of the show's own clock: it counts tick by tick. Where it is not known when a step began, the model holds
//! every show that the answers allow, and each answer leaves out those that would have answered otherwise.

use bench_dragon_messages::ControlResponse;
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_show::scene::cue::CueAction;
use bench_dragon_show::scene::{OnContact, Scene};

/// Rates that a show can be played at.
const RATES: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// What of a show decides the answers. It begins at 0 s and, at its end, begins again with the next period.
#[derive(Debug, Clone, PartialEq)]
pub struct ShowFacts {
    /// Frames per second.
    pub rate: f64,
    /// Simulated seconds at which it ends.
    pub end: f64,
    /// The times of its cues in their order, and whether the show waits there.
    pub cues: Vec<(f64, bool)>,
}

impl ShowFacts {
    /// Those of a scene played at `rate`. Searches for its events.
    pub fn of(scene: &Scene, rate: f64) -> Self {
        let timeline: Timeline = scene.motion.timeline(&mut |_| ());
        let timeline = if scene.alerts.is_some() { timeline } else { timeline.end_only() };
        let stops = scene.alerts.is_some() && scene.on_contact == OnContact::Stop;
        let cue = |cue: &bench_dragon_show::scene::cue::Cue| {
            Some((cue.time(&scene.motion, &timeline)?, cue.then == CueAction::Pause))
        };
        let mut cues: Vec<_> = scene.cues.iter().filter_map(cue).collect();
        cues.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { rate, end: timeline.freeze(stops).time, cues }
    }

    fn cues_before(&self, time: f64) -> usize {
        self.cues.iter().filter(|cue| cue.0 < time).count()
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mode {
    Playing,
    Paused,
    Held,
}

/// What has become of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    /// There is none.
    None,
    /// It was sent; this many periods.
    Sent(u64),
    /// It runs until this tick.
    Until(u64),
    /// It was answered at this tick, with this time of the show.
    Over(u64, Code, f64),
}

/// A show that the answers so far allow.
#[derive(Debug, Clone, PartialEq)]
struct Possible {
    mode: Mode,
    time: f64,
    /// Where the present stretch began.
    tick0: u64,
    time0: f64,
    scale: f64,
    waits: bool,
    cues_passed: usize,
    step: Step,
}

impl Possible {
    fn advances(&self) -> bool {
        self.mode == Mode::Playing || matches!(self.step, Step::Until(_))
    }

    fn begin(&mut self, tick: u64, time: f64) {
        (self.tick0, self.time0, self.time) = (tick, time, time);
    }

    /// The next period, `tick`, begins.
    fn tick(&mut self, facts: &ShowFacts, tick: u64) {
        if !self.advances() {
            return;
        }
        if self.time >= facts.end {
            self.begin(tick, 0.0);
            self.cues_passed = 0;
        } else {
            self.time = (self.time0 + self.scale * (tick - self.tick0) as f64 / facts.rate).min(facts.end);
        }
        self.pass_cues(facts, tick);
        if self.step == Step::Until(tick) {
            self.end_step(tick, Code::Done);
            self.mode = Mode::Paused;
        }
    }

    /// Passes the cues that lie behind; waits at the first that pauses.
    fn pass_cues(&mut self, facts: &ShowFacts, tick: u64) {
        while self.advances() && facts.cues.get(self.cues_passed).is_some_and(|cue| cue.0 <= self.time) {
            let (time, pauses) = facts.cues[self.cues_passed];
            self.cues_passed += 1;
            if pauses {
                (self.time, self.mode, self.waits) = (time, Mode::Paused, true);
                self.end_step(tick, Code::Done);
            }
        }
    }

    fn end_step(&mut self, tick: u64, code: Code) {
        if matches!(self.step, Step::Until(_)) {
            self.step = Step::Over(tick, code, self.time);
        }
    }

    fn jump(&mut self, facts: &ShowFacts, tick: u64, time: f64) -> Code {
        self.begin(tick, time);
        self.cues_passed = facts.cues_before(time);
        self.end_step(tick, Code::Refused);
        Code::Done
    }

    fn play(&mut self, tick: u64) -> Code {
        self.end_step(tick, Code::Refused);
        (self.mode, self.waits) = (Mode::Playing, false);
        self.begin(tick, self.time);
        Code::Done
    }

    /// Obeys a command at `tick`, or does not. A step that is obeyed has no answer yet.
    fn obey(&mut self, facts: &ShowFacts, tick: u64, command: Command) -> Option<Code> {
        let code = match (command, self.mode) {
            (Command::State, _) => Code::Done,
            (Command::Hold | Command::Pause, _) if self.stands_as(command) => Code::Already,
            (Command::Hold, _) => {
                self.end_step(tick, Code::Refused);
                self.mode = Mode::Held;
                Code::Done
            }
            (Command::Release, Mode::Held) => {
                self.mode = Mode::Paused;
                Code::Done
            }
            (_, Mode::Held) | (Command::Release, _) => Code::Refused,
            (Command::Pause, _) => {
                self.end_step(tick, Code::Refused);
                self.mode = Mode::Paused;
                Code::Done
            }
            (Command::Resume, Mode::Playing) => Code::Already,
            (Command::Resume, _) => self.play(tick),
            (Command::Go, _) if self.waits => self.play(tick),
            (Command::Go, _) => Code::Refused,
            (Command::Rate(rate), _) if !RATES.contains(&rate) => Code::OutOfRange,
            (Command::Rate(rate), _) if rate == self.scale => Code::Already,
            (Command::Rate(rate), _) => {
                self.begin(tick, self.time);
                self.scale = rate;
                Code::Done
            }
            (Command::Seek(time), _) if time >= 0.0 && time <= facts.end => self.jump(facts, tick, time),
            (Command::Seek(_), _) => Code::OutOfRange,
            (Command::Restart, _) => self.jump(facts, tick, 0.0),
            (Command::Step(_), _) if self.advances() => Code::Refused,
            (Command::Step(periods), _) => {
                self.begin(tick, self.time);
                self.step = Step::Until(tick + periods);
                return None;
            }
        };
        self.pass_cues(facts, tick);
        if let Step::Over(over, code, _) = self.step
            && over == tick
        {
            // A step that was over in this period is answered with the show as it stands after the command.
            self.step = Step::Over(tick, code, self.time);
        }
        Some(code)
    }

    /// Whether a pause or a hold finds the show so already.
    fn stands_as(&self, command: Command) -> bool {
        match command {
            Command::Hold => self.mode == Mode::Held,
            _ => self.mode == Mode::Paused && !self.advances(),
        }
    }

    fn playback(&self, facts: &ShowFacts) -> PlaybackState {
        match self.mode {
            Mode::Held => PlaybackState::Held,
            Mode::Paused if !self.advances() => PlaybackState::Paused,
            _ if self.time >= facts.end => PlaybackState::Ended,
            _ => PlaybackState::Playing,
        }
    }

    /// Why an answer is not that of this show; `None` where it is.
    fn contradiction(&self, facts: &ShowFacts, code: Code, answer: &ControlResponse) -> Option<String> {
        let playback = self.playback(facts);
        let scale = if self.advances() { self.scale } else { 0.0 };
        let right = answer.result() == Some(code)
            && answer.playback_state() == Some(playback)
            && answer.time_scale == scale
            && answer.cue as usize == self.cues_passed
            && is_same_time(answer.sim_time, self.time);
        (!right).then(|| {
            format!(
                "expected {}, {} at {scale} x, t = {} s, cue {}",
                code.name(),
                playback.name(),
                self.time,
                self.cues_passed
            )
        })
    }
}

fn is_same_time(a: f64, b: f64) -> bool {
    (a - b).abs() <= 4.0 * f64::EPSILON * b.abs()
}

/// Every show that the answers so far allow.
#[derive(Debug, Clone)]
pub struct Model {
    facts: ShowFacts,
    possible: Vec<Possible>,
    /// One of those that the latest answer allowed.
    latest: Possible,
    /// The tick that they all stand at.
    tick: u64,
}

impl Model {
    /// The model of a show that waits at its start.
    pub fn new(facts: ShowFacts) -> Self {
        let waiting = Possible {
            mode: Mode::Paused,
            time: 0.0,
            tick0: 0,
            time0: 0.0,
            scale: 1.0,
            waits: true,
            cues_passed: 0,
            step: Step::None,
        };
        Self { facts, latest: waiting.clone(), possible: vec![waiting], tick: 0 }
    }

    /// A step was sent, whose answer comes later: [`step_answered`](Self::step_answered).
    pub fn step_sent(&mut self, periods: u64) {
        self.possible.iter_mut().for_each(|show| show.step = Step::Sent(periods));
    }

    /// Whether a step that was sent has certainly been taken in, or broken off.
    pub fn step_has_begun(&self) -> bool {
        !self.possible.iter().any(|show| matches!(show.step, Step::Sent(_)))
    }

    /// Takes in the answer to a command which is no step that ran.
    ///
    /// # Errors
    /// What was expected, where the answer is wrong; the model then takes the answer for the truth.
    pub fn answered(&mut self, command: Command, answer: &ControlResponse) -> Result<(), String> {
        if answer.tick <= self.tick && self.tick > 0 {
            let expected = format!("expected a tick after {}", self.tick);
            self.adopt(answer);
            return Err(expected);
        }
        // A period takes one command, so that a step which is on its way is taken in another.
        self.advance(answer.tick, answer.tick.saturating_sub(1));
        let mut first = None;
        let facts = &self.facts;
        self.possible.retain_mut(|show| {
            let code = show.obey(facts, answer.tick, command);
            // A step that would have begun here has no answer at this tick.
            let code = code.unwrap_or(Code::TooMany);
            let contradiction = show.contradiction(facts, code, answer);
            let keeps = contradiction.is_none();
            first = first.take().or(contradiction);
            keeps
        });
        self.unless_impossible(first, answer)
    }

    /// Takes in the answer to the step that was sent. It may be older than answers to other commands.
    ///
    /// # Errors
    /// As [`answered`](Self::answered).
    pub fn step_answered(&mut self, answer: &ControlResponse) -> Result<(), String> {
        self.advance(answer.tick, answer.tick);
        let mut first = None;
        self.possible.retain(|show| {
            let right = match show.step {
                // Where periods are skipped the answer comes with the first frame after them.
                Step::Over(tick, code, time) => {
                    answer.result() == Some(code)
                        && (answer.tick > tick || answer.tick == tick && is_same_time(answer.sim_time, time))
                }
                _ => false,
            };
            if !right {
                first.get_or_insert_with(|| format!("expected {:?}", show.step));
            }
            right
        });
        let done = self.unless_impossible(first, answer);
        self.possible.iter_mut().for_each(|show| show.step = Step::None);
        self.possible.dedup();
        done
    }

    /// Moves all shows on, a step that was sent being taken at any tick until `last_begin`, or not at all.
    fn advance(&mut self, tick: u64, last_begin: u64) {
        for now in self.tick + 1..=tick {
            let mut begun = Vec::new();
            for show in &mut self.possible {
                show.tick(&self.facts, now);
                if let Step::Sent(periods) = show.step
                    && now <= last_begin
                {
                    let mut taken = show.clone();
                    if let Some(code) = taken.obey(&self.facts, now, Command::Step(periods)) {
                        taken.step = Step::Over(now, code, taken.time);
                    }
                    begun.push(taken);
                }
            }
            self.possible.append(&mut begun);
        }
        self.tick = self.tick.max(tick);
    }

    fn unless_impossible(&mut self, expected: Option<String>, answer: &ControlResponse) -> Result<(), String> {
        if let Some(show) = self.possible.first() {
            self.latest = show.clone();
            return Ok(());
        }
        self.adopt(answer);
        Err(expected.unwrap_or_default())
    }

    /// Takes an answer for the truth: after a wrong one, or a lost one.
    pub fn adopt(&mut self, answer: &ControlResponse) {
        let mode = match answer.playback_state() {
            Some(PlaybackState::Paused) => Mode::Paused,
            Some(PlaybackState::Held) => Mode::Held,
            _ => Mode::Playing,
        };
        self.latest = Possible {
            mode,
            time: answer.sim_time,
            tick0: answer.tick,
            time0: answer.sim_time,
            scale: if answer.time_scale > 0.0 { answer.time_scale } else { self.latest.scale },
            waits: self.latest.waits,
            cues_passed: answer.cue as usize,
            step: Step::None,
        };
        self.possible = vec![self.latest.clone()];
        self.tick = self.tick.max(answer.tick);
    }
}

#[cfg(test)]
mod tests;
