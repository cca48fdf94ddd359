//! The counts of a load generator: answers by kind, faults, latencies, and the comparison of each answer with the frame
//! of its tick.

use std::collections::VecDeque;
use std::sync::Arc;

use hdrhistogram::Histogram;

use super::Conducted;
use super::answers::{ShowFacts, WrongAnswer};
use bench_dragon_client::control::ControlError;
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_messages::{ControlResponse, FrameHeader};
use bench_dragon_publisher::live::statistics::Percentiles;

/// The longest latency that is resolved: an hour.
const LONGEST_NS: u64 = 3_600_000_000_000;
/// Faults that are kept in words.
const MOST_FAULTS: usize = 10;
/// The time for which frames are kept for comparison, in seconds.
const KEPT_SECONDS: f64 = 2.0;

/// A command and its answer.
#[derive(Clone)]
pub(super) struct Answered {
    pub command: Command,
    /// CLOCK_MONOTONIC at which it was sent, ns.
    pub sent_ns: u64,
    /// CLOCK_MONOTONIC at which the answer was received, ns.
    pub answered_ns: u64,
    /// The answer, and the result of its check by the command table. `Err` if no answer came.
    pub answer: Result<(ControlResponse, Result<(), WrongAnswer>), Arc<ControlError>>,
    /// True for a step that ran, whose answer comes when it is over.
    pub is_step_that_ran: bool,
}

/// The counts so far, and the answers that wait for their frames.
#[derive(Clone)]
pub(super) struct Record {
    conducted: Conducted,
    facts: Option<ShowFacts>,
    frames: VecDeque<FrameHeader>,
    most_frames: usize,
    /// Answers whose frame has not come yet.
    waiting: Vec<Answered>,
    /// The ticks of the latest seeks and restarts that were executed.
    jumps_at: VecDeque<u64>,
    /// The ticks at which the latest steps ended.
    steps_end_at: VecDeque<u64>,
    applied: Histogram<u64>,
    answered: Histogram<u64>,
}

impl Record {
    pub fn new(seed: u64, rate: f64) -> Self {
        // 1 ns to an hour with three digits are bounds the constructor accepts.
        let histogram = || Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("valid bounds");
        Self {
            conducted: Conducted { seed, period_ns: 1e9 / rate, ..Conducted::default() },
            facts: None,
            frames: VecDeque::new(),
            most_frames: 100 + (rate * KEPT_SECONDS) as usize,
            waiting: Vec::new(),
            jumps_at: VecDeque::new(),
            steps_end_at: VecDeque::new(),
            applied: histogram(),
            answered: histogram(),
        }
    }

    /// Sets the facts of the show.
    pub fn show_is(&mut self, facts: &ShowFacts) {
        self.facts = Some(facts.clone());
    }

    /// Checks the header of a frame against the one before, and keeps it.
    pub fn frame(&mut self, header: &FrameHeader) {
        if let Some(fault) = self.frames.back().and_then(|before| self.fault_of_frame(before, header)) {
            self.contradict(format!("{fault}: {header:?}"));
        }
        if self.frames.len() == self.most_frames
            && let Some(gone) = self.frames.pop_front()
            && let Some(next) = self.frames.front()
            && self.begins_again_unasked(&gone, next)
        {
            self.contradict(format!("the show begins again before its end, without a command: {next:?}"));
        }
        self.frames.push_back(*header);
    }

    /// Counts a frame or a stage that contradicts the commands or the scene.
    pub fn contradict(&mut self, fault: String) {
        self.conducted.contradicted += 1;
        self.fault(fault);
    }

    /// Returns true if simulated time jumps between two frames without a seek, a restart or the end of the show. To be
    /// called once every answer of these periods has come.
    fn begins_again_unasked(&self, before: &FrameHeader, frame: &FrameHeader) -> bool {
        before.run_id == frame.run_id
            && before.tick + 1 == frame.tick
            && before.epoch != frame.epoch
            && before.playback_state() != Some(PlaybackState::Ended)
            && !self.jumps_at.contains(&frame.tick)
    }

    /// Returns the fault of a frame that passes a cue which pauses. Also returns the fault of an end, or of a new
    /// beginning, at a wrong time.
    fn fault_of_frame(&self, before: &FrameHeader, frame: &FrameHeader) -> Option<&'static str> {
        let ShowFacts { end, cues } = self.facts.as_ref()?;
        let passed = cues.get(before.cue as usize..cues.len().min(frame.cue as usize)).unwrap_or_default();
        let waits = passed.iter().find(|cue| cue.1);
        // If a frame between was missed, the show may have waited in that frame.
        let is_next = before.run_id == frame.run_id && before.sequence + 1 == frame.sequence;
        let begins_again = before.playback_state() == Some(PlaybackState::Ended) && before.epoch + 1 == frame.epoch;
        if frame.playback_state() == Some(PlaybackState::Ended) && frame.sim_time != *end {
            Some("the show ends at another time than its scene")
        } else if is_next && before.epoch == frame.epoch && waits.is_some_and(|cue| cue.0 != frame.sim_time) {
            Some("the show does not wait at its cue")
        } else if before.tick + 1 == frame.tick && begins_again && frame.sim_time != 0.0 {
            Some("the show does not begin again at its start")
        } else {
            None
        }
    }

    /// Returns the periods of the step that ended with the frame at `place`. Returns `None` if a frame of the step is
    /// missing. Also returns `None` if the step may have begun in the period of a cue that pauses, without a frame that
    /// stands still.
    fn length_of_step(&self, place: usize) -> Option<u64> {
        let mut place = place;
        let mut periods = 0;
        loop {
            let (before, frame) = (self.frames.get(place.checked_sub(1)?)?, self.frames.get(place)?);
            let waits = self.facts.as_ref().is_none_or(|facts| facts.waits_at(frame.sim_time));
            if before.tick + 1 != frame.tick || periods > 0 && waits {
                return None;
            }
            let follows_a_step = periods > 0 && self.steps_end_at.contains(&frame.tick);
            if before.time_scale == 0.0 || follows_a_step {
                return Some(periods);
            }
            (periods, place) = (periods + 1, place - 1);
        }
    }

    /// Returns true if the frames before the end of a step do not have its length, and no cue has ended it.
    fn has_wrong_length(&self, answered: &Answered, answer: &ControlResponse, place: usize) -> bool {
        let Command::Step(periods) = answered.command else { return false };
        if !answered.is_step_that_ran || answer.result() != Some(Code::Done) {
            return false;
        }
        let waits = self.facts.as_ref().is_none_or(|facts| facts.waits_at(self.frames[place].sim_time));
        let jumped = place.checked_sub(1).is_none_or(|before| self.frames[before].epoch != self.frames[place].epoch);
        let is_wrong = |length: u64| length > periods || length < periods && !waits && !jumped;
        self.length_of_step(place).is_some_and(is_wrong)
    }

    /// Counts the result of a command.
    pub fn answered(&mut self, answered: Answered) {
        let conducted = &mut self.conducted;
        conducted.sent += 1;
        let (answer, allowed) = match &answered.answer {
            Ok((answer, allowed)) => (*answer, allowed),
            Err(reason) => {
                conducted.lost += 1;
                let fault = format!("{}: no answer: {reason}", description(answered.command));
                return self.fault(fault);
            }
        };
        let name = answered.command.name();
        let code = answer.result().map_or("unknown", Code::name);
        *conducted.answers.entry(name.to_owned()).or_default().entry(code.to_owned()).or_default() += 1;
        if let Err(expected) = allowed {
            conducted.wrong += 1;
            let fault = format!("{}: {}, {expected}", description(answered.command), answer_in_words(&answer));
            self.fault(fault);
        } else {
            let refused = matches!(answer.result(), Some(Code::Refused | Code::OutOfRange));
            conducted.refused_as_expected += u64::from(refused);
        }
        if is_jump(&answered, &answer) {
            self.conducted.jumps += 1;
            keep(&mut self.jumps_at, answer.tick);
        }
        if answered.is_step_that_ran {
            keep(&mut self.steps_end_at, answer.tick);
        }
        if !answered.is_step_that_ran {
            self.answered.saturating_record(answered.answered_ns.saturating_sub(answered.sent_ns));
        }
        self.waiting.push(answered);
    }

    /// Compares the answers whose frames have come.
    pub fn compare(&mut self) {
        let Some(newest) = self.frames.back().map(|frame| frame.tick) else { return };
        for answered in std::mem::take(&mut self.waiting) {
            let Ok((answer, _)) = &answered.answer else { continue };
            if answer.tick > newest {
                self.waiting.push(answered);
                continue;
            }
            // This subscriber may miss frames; the steady subscribers must not.
            let Ok(place) = self.frames.binary_search_by_key(&answer.tick, |frame| frame.tick) else { continue };
            let frame = self.frames[place];
            self.conducted.compared += 1;
            if !answered.is_step_that_ran {
                self.applied.saturating_record(frame.sent_ns.saturating_sub(answered.sent_ns));
            }
            let before = place.checked_sub(1).map(|before| self.frames[before]);
            // At the tick of a step's answer another command may have been executed.
            let before = before.filter(|before| before.tick + 1 == frame.tick && !answered.is_step_that_ran);
            let jumps = before.map(|before| (frame.epoch.wrapping_sub(before.epoch), jumps_due(&answered, &before)));
            let agrees = frame.sim_time.to_bits() == answer.sim_time.to_bits()
                && frame.time_scale == answer.time_scale
                && (frame.playback, frame.cue) == (answer.playback, answer.cue)
                && jumps.is_none_or(|(jumps, due)| jumps == due)
                && !self.has_wrong_length(&answered, answer, place);
            if !agrees {
                self.conducted.contradicted += 1;
                let (described, words) = (description(answered.command), answer_in_words(answer));
                self.fault(format!("{described}: {words}, and the frame is {frame:?}; jumps and those due {jumps:?}"));
            }
        }
    }

    fn fault(&mut self, sentence: String) {
        if self.conducted.faults.len() < MOST_FAULTS {
            self.conducted.faults.push(sentence);
        }
    }

    /// Returns true if answers wait for their frames.
    pub fn is_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Returns the counts.
    pub fn conducted(&self) -> Conducted {
        let of = |histogram: &Histogram<u64>| (!histogram.is_empty()).then(|| Percentiles::of(histogram));
        Conducted { applied_ns: of(&self.applied), answered_ns: of(&self.answered), ..self.conducted.clone() }
    }
}

/// The ticks that are kept of each kind: enough for all commands that are sent while their frames are kept.
const MOST_TICKS: usize = 10_000;

fn keep(ticks: &mut VecDeque<u64>, tick: u64) {
    if ticks.len() == MOST_TICKS {
        ticks.pop_front();
    }
    ticks.push_back(tick);
}

fn is_jump(answered: &Answered, answer: &ControlResponse) -> bool {
    matches!(answered.command, Command::Seek(_) | Command::Restart) && answer.result() == Some(Code::Done)
}

/// Returns the expected growth of `epoch` after the frame before: by a seek, by a restart, and after the end of the
/// show.
fn jumps_due(answered: &Answered, before: &FrameHeader) -> u32 {
    let commanded = answered.answer.as_ref().is_ok_and(|(answer, _)| is_jump(answered, answer));
    let begins_again = before.playback_state() == Some(PlaybackState::Ended);
    u32::from(commanded) + u32::from(begins_again)
}

fn description(command: Command) -> String {
    format!("{} {}", command.name(), command.number_and_value().1)
}

fn answer_in_words(answer: &ControlResponse) -> String {
    let ControlResponse { id: _, tick, sim_time, time_scale, code: _, playback: _, cue, reserved: _ } = answer;
    let code = answer.result().map_or("unknown", Code::name);
    let playback = answer.playback_state().map_or("unknown", PlaybackState::name);
    format!("answered {code}, {playback} at {time_scale} x, t = {sim_time} s, cue {cue}, tick {tick}")
}
