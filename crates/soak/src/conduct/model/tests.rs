//! The model against the show's own clock under random commands, with a step that is taken at a moment unknown to it.

use proptest::prelude::*;

use super::*;
use crate::strategies::commands;
use bench_dragon_show::clock::{CueTime, ShowClock};
use bench_dragon_show::convert::control_response;
use bench_dragon_show::scene::AtEnd;
use bench_dragon_show::{Outcome, Playback};

const RATE: f64 = 50.0;

/// A show whose answers the model checks, as the conductor hands them over.
struct Checked {
    clock: ShowClock,
    model: Model,
    tick: u64,
    /// A step on its way, and the tick that takes it.
    sent: Option<(u64, u64)>,
    stepping: bool,
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
        Self {
            clock: ShowClock::new(&playback, 7.0, times),
            model: Model::new(ShowFacts { rate: RATE, end: 7.0, cues }),
            tick: 0,
            sent: None,
            stepping: false,
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

    /// The answer to a command that is obeyed so many ticks later.
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
        }
        self.tick = last;
        answer
    }

    /// Sends a command, and has the model check what comes of it.
    fn check(&mut self, gap: u64, command: Command) -> Result<(), String> {
        if let (Command::Step(periods), false) = (command, self.stepping) {
            self.sent = Some((periods, self.tick + gap));
            self.stepping = true;
            self.model.step_sent(periods);
            return Ok(());
        }
        let command = if matches!(command, Command::Step(_)) { Command::State } else { command };
        let answer = self.command(gap, command);
        self.model.answered(command, &answer)?;
        if let Some(answer) = self.step_answer.take() {
            self.stepping = false;
            self.model.step_answered(&answer)?;
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
        prop_assert!(checked.model.clone().answered(command, &wrong).is_err(), "{:?}: {:?}", command, wrong);
        prop_assert_eq!(checked.model.answered(command, &right), Ok(()));
    }
}

#[test]
fn a_step_of_another_length_and_a_tick_that_was_before_are_noticed() {
    let mut checked = Checked::new(Vec::new());
    checked.check(1, Command::Step(10)).unwrap();
    // The step is taken, and answered ten periods later.
    checked.command(2, Command::State);
    let state = checked.command(20, Command::State);
    let mut model = Model::new(ShowFacts { rate: RATE, end: 7.0, cues: Vec::new() });
    model.step_sent(9);
    assert!(model.clone().answered(Command::State, &state).is_err());
    checked.model.answered(Command::State, &state).unwrap();
    let again = checked.model.answered(Command::State, &state);
    assert!(again.unwrap_err().contains("expected a tick after 22"));
}

#[test]
fn after_a_lost_answer_the_next_one_is_the_truth() {
    let mut checked = Checked::new(Vec::new());
    checked.command(5, Command::Resume);
    let state = checked.command(5, Command::State);
    assert!(checked.model.clone().answered(Command::State, &state).is_err());
    checked.model.adopt(&state);
    for gap in [3, 400] {
        checked.check(gap, Command::State).unwrap();
    }
}
