//! The checks of answers and frames, on answers of the show clock under random commands. A step begins at a moment that
//! the checks do not know.

use proptest::prelude::*;

use super::super::record::{Answered, Record};
use super::*;
use crate::strategies::commands;
use bench_dragon_messages::FrameHeader;
use bench_dragon_show::clock::{CueTime, ShowClock};
use bench_dragon_show::convert::control_response;
use bench_dragon_show::scene::{AtEnd, OnContact};
use bench_dragon_show::{Outcome, Playback};

const RATE: f64 = 50.0;

/// A show whose answers and frames are checked, in the order in which the load generator receives them.
#[derive(Clone)]
struct Checked {
    clock: ShowClock,
    check: AnswerCheck,
    record: Record,
    tick: u64,
    /// A step on its way, and the tick that takes it.
    sent: Option<(u64, u64)>,
    stepping: bool,
    periods: u64,
    step_answer: Option<ControlResponse>,
}

impl Checked {
    fn new(cues: Vec<(f64, bool)>) -> Self {
        let playback = Playback {
            start: 0.0,
            time_scale: 1.0,
            rate: RATE,
            on_contact: OnContact::Stop,
            at_end: AtEnd::Loop,
            end_hold: 0.0,
            paused: true,
        };
        let times = cues.iter().map(|(time, pauses)| CueTime { time: *time, pauses: *pauses }).collect();
        let facts = ShowFacts { end: 7.0, cues };
        let mut record = Record::new(1, RATE);
        record.show_is(&facts);
        Self {
            clock: ShowClock::new(&playback, 7.0, times),
            check: AnswerCheck::new(facts, RATE),
            record,
            tick: 0,
            sent: None,
            stepping: false,
            periods: 0,
            step_answer: None,
        }
    }

    fn answer(&mut self, tick: u64, code: Code) -> ControlResponse {
        let time = self.clock.advance(tick);
        let outcome = Outcome {
            code,
            tick,
            sim_time: time.sim_time,
            time_scale: time.time_scale,
            playing_rate: 1.0,
            playback: time.playback,
            cue: time.cues_passed as u32,
        };
        control_response(1, &outcome)
    }

    /// Returns the answer to a command that is executed `gap` ticks later.
    fn command(&mut self, gap: u64, command: Command) -> ControlResponse {
        let mut answer = ControlResponse::default();
        let last = self.tick + gap;
        for tick in self.tick + 1..=last {
            self.clock.advance(tick);
            if tick == last {
                let code = self.clock.apply(tick, command).expect("no step while one has no answer");
                answer = self.answer(tick, code);
            } else if let Some((periods, _)) = self.sent.filter(|sent| sent.1 <= tick) {
                self.sent = None;
                if let Some(code) = self.clock.apply(tick, Command::Step(periods)) {
                    self.step_answer = Some(self.answer(tick, code));
                }
            }
            if let Some(code) = self.clock.take_step_outcome() {
                self.step_answer = Some(self.answer(tick, code));
            }
            let time = self.clock.advance(tick);
            self.record.frame(&FrameHeader {
                run_id: 1,
                tick,
                sim_time: time.sim_time,
                time_scale: time.time_scale,
                playback: time.playback as u32,
                epoch: time.epoch,
                cue: time.cues_passed as u32,
                ..FrameHeader::default()
            });
        }
        self.tick = last;
        answer
    }

    /// Checks an answer against the table and against its frame. Returns the first fault.
    fn fault(&mut self, command: Command, answer: ControlResponse, is_step_that_ran: bool) -> Result<(), String> {
        let allowed = match is_step_that_ran {
            true => self.check.step_answered(&answer),
            false => self.check.answered(command, &answer),
        };
        let (sent_ns, answered_ns) = (0, 0);
        self.record.answered(Answered {
            command,
            sent_ns,
            answered_ns,
            answer: Ok((answer, allowed)),
            is_step_that_ran,
        });
        self.record.compare();
        assert!(!self.record.is_waiting());
        self.record.conducted().faults.into_iter().next().map_or(Ok(()), Err)
    }

    /// Sends a command, and checks the answer against the table and against its frame.
    fn check(&mut self, gap: u64, command: Command) -> Result<(), String> {
        if let (Command::Step(periods), false) = (command, self.stepping) {
            self.sent = Some((periods, self.tick + gap));
            self.periods = periods;
            self.stepping = true;
            self.check.step_sent();
            return Ok(());
        }
        let command = if matches!(command, Command::Step(_)) { Command::State } else { command };
        let answer = self.command(gap, command);
        self.fault(command, answer, false)?;
        if let Some(answer) = self.step_answer.take() {
            self.stepping = false;
            self.fault(Command::Step(self.periods), answer, true)?;
        }
        Ok(())
    }
}

fn cues() -> impl Strategy<Value = Vec<(f64, bool)>> {
    let cues = prop::collection::vec((0.1f64..6.9, any::<bool>()), 0..3);
    cues.prop_map(|mut cues| {
        cues.sort_by(|a, b| a.0.total_cmp(&b.0));
        cues
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

    #[test]
    fn every_answer_of_the_show_is_allowed_and_no_other(
        cues in cues(),
        list in prop::collection::vec((1u64..30, commands()), 1..60),
        last in (1u64..30, commands()),
        change in 0usize..5,
    ) {
        let mut checked = Checked::new(cues);
        for (gap, command) in list {
            let result = checked.check(gap, command);
            prop_assert_eq!(result, Ok(()), "{:?} after {} ticks", command, gap);
        }
        prop_assume!(!checked.stepping);
        let (gap, command) = last;
        let command = if matches!(command, Command::Step(_)) { Command::Release } else { command };
        let right = checked.command(gap, command);
        let wrong = match change {
            0 => ControlResponse { code: (right.code + 1) % 4, ..right },
            1 => ControlResponse { playback: (right.playback + 1) % 4, ..right },
            2 => ControlResponse { sim_time: right.sim_time + 1e-9, ..right },
            3 => ControlResponse { time_scale: right.time_scale + 1.0, ..right },
            _ => ControlResponse { cue: right.cue + 1, ..right },
        };
        // A pause in the period of a cue that pauses is answered either way.
        prop_assume!(change != 0 || !checked.check.facts.waits_at(right.sim_time));
        let mut other = checked.clone();
        prop_assert!(other.fault(command, wrong, false).is_err(), "{:?}: {:?}", command, wrong);
        prop_assert_eq!(checked.fault(command, right, false), Ok(()));
    }
}

/// A pause is allowed after a seek only if the show can have come to a cue that pauses before.
#[test]
fn a_seek_that_pauses_is_noticed_far_from_a_cue() {
    for (cue, is_near) in [(0.5, false), (3.0, false), (1.1, true)] {
        let mut checked = Checked::new(vec![(cue, true)]);
        for (gap, command) in [(3, Command::Seek(1.0)), (3, Command::Go), (2, Command::State)] {
            checked.check(gap, command).unwrap();
        }
        let right = checked.command(5, Command::Seek(2.0));
        let paused = ControlResponse { playback: PlaybackState::Paused as u32, time_scale: 0.0, ..right };
        let result = checked.check.clone().answered(Command::Seek(2.0), &paused);
        assert_eq!(result.is_ok(), is_near, "cue at {cue} s: {result:?}");
        assert_eq!(checked.check.answered(Command::Seek(2.0), &right), Ok(()), "cue at {cue} s");
    }
}

#[test]
fn a_step_of_another_length_and_a_tick_that_was_before_are_noticed() {
    let mut checked = Checked::new(Vec::new());
    checked.command(3, Command::State);
    checked.check(1, Command::Step(10)).unwrap();
    // The step is taken, and answered ten periods later.
    checked.command(2, Command::State);
    let state = checked.command(20, Command::State);
    let step = checked.step_answer.take().unwrap();
    for periods in [9, 11] {
        let fault = checked.clone().fault(Command::Step(periods), step, true);
        assert!(fault.is_err_and(|fault| fault.contains("and the frame is")), "{periods}");
    }
    checked.fault(Command::State, state, false).unwrap();
    checked.fault(Command::Step(10), step, true).unwrap();
    let again = checked.fault(Command::State, state, false);
    assert!(again.unwrap_err().contains("expected a tick after 25"));
}

#[test]
fn after_a_lost_answer_the_next_one_is_the_truth() {
    let mut checked = Checked::new(Vec::new());
    checked.command(5, Command::Resume);
    let state = checked.command(5, Command::State);
    assert!(checked.check.clone().answered(Command::State, &state).is_err());
    checked.check.adopt(&state);
    for gap in [3, 400] {
        checked.check(gap, Command::State).unwrap();
    }
}

#[test]
fn a_cue_that_is_passed_and_a_beginning_elsewhere_are_noticed() {
    let mut record = Record::new(1, RATE);
    record.show_is(&ShowFacts { end: 7.0, cues: vec![(3.0, true)] });
    let frame = |tick, sim_time, cue, playback: PlaybackState, epoch| FrameHeader {
        run_id: 1,
        tick,
        sequence: tick,
        sim_time,
        time_scale: 1.0,
        cue,
        playback: playback as u32,
        epoch,
        ..FrameHeader::default()
    };
    record.frame(&frame(0, 2.99, 0, PlaybackState::Playing, 0));
    record.frame(&frame(1, 3.01, 1, PlaybackState::Playing, 0));
    record.frame(&frame(2, 7.0, 1, PlaybackState::Ended, 0));
    record.frame(&frame(3, 0.02, 0, PlaybackState::Playing, 1));
    record.frame(&frame(4, 6.0, 0, PlaybackState::Ended, 1));
    record.frame(&frame(5, 0.0, 0, PlaybackState::Playing, 2));
    record.frame(&frame(6, 0.0, 0, PlaybackState::Playing, 3));
    // The frames are kept for a while, since answers may still come.
    (7..100_000).for_each(|tick| record.frame(&frame(tick, 0.01, 0, PlaybackState::Playing, 3)));
    let faults = record.conducted().faults;
    assert!(faults[0].starts_with("the show does not wait at its cue"), "{faults:?}");
    assert!(faults[1].starts_with("the show does not begin again at its start"), "{faults:?}");
    assert!(faults[2].starts_with("the show ends at another time"), "{faults:?}");
    assert!(faults[3].starts_with("the show begins again before its end"), "{faults:?}");
    assert_eq!(record.conducted().contradicted, 4, "{faults:?}");
}
