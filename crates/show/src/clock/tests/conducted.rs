//! The clock under random commands, against a second one that counts tick by tick in whole numbers.

use proptest::prelude::*;

use super::super::*;
use crate::scene::OnContact;

/// Units in a simulated second: every time, rate and scale below is a whole number of them, and exact as a double.
const UNITS: i64 = 1 << 14;
/// Frames per second.
const RATE: i64 = 64;

/// A show in whole numbers, moved on by one tick at a time.
#[derive(Debug, Clone)]
struct Counted {
    start: i64,
    freeze: i64,
    end_hold: Option<i64>,
    cues: Vec<(i64, bool)>,
    time: i64,
    /// Units per tick.
    scale: i64,
    mode: Mode,
    /// Ticks left of a step.
    step: Option<u64>,
    waits: bool,
    /// Ticks for which the end has been shown.
    at_end: i64,
    epoch: u32,
    passed: usize,
    reached: Vec<usize>,
    finished: Option<Code>,
}

impl Counted {
    fn advances(&self) -> bool {
        self.mode == Mode::Playing || self.step.is_some()
    }

    fn before(&self, time: i64) -> usize {
        self.cues.iter().filter(|cue| cue.0 < time).count()
    }

    fn break_step(&mut self, code: Code) {
        if self.step.take().is_some() {
            self.finished = Some(code);
        }
    }

    /// The next period begins.
    fn tick(&mut self) {
        if !self.advances() {
            return;
        }
        if self.time >= self.freeze {
            self.at_end += 1;
            if self.end_hold.is_some_and(|ticks| self.at_end > ticks) {
                (self.time, self.at_end, self.passed) = (self.start, 0, self.before(self.start));
                self.epoch += 1;
            }
        } else {
            self.time = (self.time + self.scale).min(self.freeze);
        }
        self.step.iter_mut().for_each(|left| *left -= 1);
        self.pass();
        if self.step == Some(0) {
            self.mode = Mode::Paused;
            self.break_step(Code::Done);
        }
    }

    /// Passes cues; waits at the first that pauses.
    fn pass(&mut self) {
        while self.advances() && self.cues.get(self.passed).is_some_and(|cue| cue.0 <= self.time) {
            self.reached.push(self.passed);
            let (time, pauses) = self.cues[self.passed];
            self.passed += 1;
            if pauses {
                (self.time, self.mode, self.waits) = (time, Mode::Paused, true);
                self.break_step(Code::Done);
            }
        }
    }

    fn jump(&mut self, time: i64) -> Code {
        self.break_step(Code::Refused);
        (self.time, self.at_end, self.passed) = (time, 0, self.before(time));
        self.epoch += 1;
        self.pass();
        Code::Done
    }

    fn command(&mut self, command: Command) -> Option<Code> {
        use Command::*;
        let held = self.mode == Mode::Held;
        Some(match command {
            State => Code::Done,
            Hold if held => Code::Already,
            Release if held => {
                self.mode = Mode::Paused;
                Code::Done
            }
            Hold => {
                self.break_step(Code::Refused);
                self.mode = Mode::Held;
                Code::Done
            }
            _ if held => Code::Refused,
            Release => Code::Refused,
            Pause if self.advances() => {
                self.break_step(Code::Refused);
                self.mode = Mode::Paused;
                Code::Done
            }
            Pause => Code::Already,
            Resume if self.mode == Mode::Playing => Code::Already,
            Go if !self.waits => Code::Refused,
            Resume | Go => {
                self.break_step(Code::Refused);
                (self.mode, self.waits, self.at_end) = (Mode::Playing, false, 0);
                self.pass();
                Code::Done
            }
            Rate(rate) if rate <= 0.0 => Code::OutOfRange,
            Rate(rate) if rate * UNITS as f64 == (self.scale * RATE) as f64 => Code::Already,
            Rate(rate) => {
                (self.scale, self.at_end) = ((rate * UNITS as f64) as i64 / RATE, 0);
                Code::Done
            }
            Seek(time) => {
                let time = (time * UNITS as f64) as i64;
                if time < 0 || time > self.freeze { Code::OutOfRange } else { self.jump(time) }
            }
            Restart => self.jump(self.start),
            Step(_) if self.advances() => Code::Refused,
            Step(periods) => {
                (self.step, self.at_end) = (Some(periods), 0);
                self.pass();
                return None;
            }
        })
    }

    fn playback(&self) -> PlaybackState {
        match self.mode {
            Mode::Held => PlaybackState::Held,
            Mode::Paused if self.step.is_none() => PlaybackState::Paused,
            _ if self.time >= self.freeze => PlaybackState::Ended,
            _ => PlaybackState::Playing,
        }
    }
}

fn commands() -> impl Strategy<Value = Command> {
    prop_oneof![
        Just(Command::State),
        Just(Command::Pause),
        Just(Command::Pause),
        Just(Command::Resume),
        Just(Command::Resume),
        (0i64..64).prop_map(|sixteenths| Command::Rate(sixteenths as f64 / 16.0)),
        (-8i64..264).prop_map(|eighths| Command::Seek(eighths as f64 / 8.0)),
        (1u64..200).prop_map(Command::Step),
        Just(Command::Restart),
        Just(Command::Hold),
        Just(Command::Release),
        Just(Command::Release),
        Just(Command::Go),
    ]
}

/// A command of any size; a seek by the share of the show.
fn any_command() -> impl Strategy<Value = Command> {
    let magnitude = || (-8.0f64..8.0).prop_map(|exponent| 10f64.powf(exponent));
    prop_oneof![
        3 => commands(),
        1 => magnitude().prop_map(Command::Rate),
        1 => prop_oneof![-0.1f64..1.1, Just(1.0), Just(f64::NAN), Just(f64::INFINITY)].prop_map(Command::Seek),
        1 => any::<u64>().prop_map(|periods| Command::Step(periods.max(1))),
    ]
}

/// Start and end of a show in seconds, ticks at the end before it begins again, and whether it waits at the start.
fn shows() -> impl Strategy<Value = (i64, i64, Option<i64>, bool)> {
    (0i64..4, 5i64..32, prop::option::of(0i64..40), any::<bool>())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

    #[test]
    fn commands_agree_with_counting_tick_by_tick(
        (start, freeze, end_hold, paused) in shows(),
        cues in prop::collection::vec((0i64..40 * 8, any::<bool>()), 0..4),
        list in prop::collection::vec((0u64..150, commands()), 0..30),
    ) {
        let mut cues: Vec<(i64, bool)> = cues.into_iter().map(|(eighths, pauses)| (eighths * UNITS / 8, pauses)).collect();
        cues.sort_unstable();
        let times = cues.iter().map(|cue| CueTime { time: cue.0 as f64 / UNITS as f64, pauses: cue.1 }).collect();
        let at_end = if end_hold.is_some() { AtEnd::Loop } else { AtEnd::Hold };
        let playback = Playback {
            start: start as f64,
            time_scale: 1.0,
            rate: RATE as f64,
            on_contact: OnContact::Stop,
            at_end,
            end_hold: end_hold.unwrap_or(0) as f64 / RATE as f64,
            paused,
        };
        let clock = ShowClock::new(&playback, freeze as f64, times);
        let mut counted = Counted {
            start: start * UNITS,
            freeze: freeze * UNITS,
            end_hold,
            time: start * UNITS,
            scale: UNITS / RATE,
            mode: if paused { Mode::Paused } else { Mode::Playing },
            step: None,
            waits: paused,
            at_end: 0,
            epoch: 0,
            passed: 0,
            reached: Vec::new(),
            finished: None,
            cues,
        };
        counted.passed = counted.before(counted.start);
        counted.pass();
        // One that is read at every tick, and one at the commands alone.
        let (mut every, mut seldom) = (clock.clone(), clock);
        let mut tick = 0;
        for (gap, command) in list {
            for next in tick..tick + gap {
                if next > tick {
                    counted.tick();
                }
                let time = every.advance(next);
                prop_assert_eq!(time.sim_time, counted.time as f64 / UNITS as f64, "at {}", next);
                prop_assert_eq!((time.playback, time.epoch, time.cues_passed), (counted.playback(), counted.epoch, counted.passed));
                prop_assert_eq!(time.time_scale > 0.0, counted.advances());
                prop_assert_eq!(every.reached(), &counted.reached[..]);
                prop_assert_eq!(every.take_step_outcome(), counted.finished.take());
                every.clear_reached();
                counted.reached.clear();
            }
            tick += gap;
            if gap > 0 {
                counted.tick();
            }
            prop_assert_eq!(seldom.advance(tick), every.advance(tick));
            seldom.take_step_outcome();
            prop_assert_eq!(every.take_step_outcome(), counted.finished.take());
            let code = every.apply(tick, command);
            prop_assert_eq!(code, counted.command(command), "{:?} at {}", command, tick);
            prop_assert_eq!(seldom.apply(tick, command), code);
            prop_assert_eq!(seldom.advance(tick), every.advance(tick));
            prop_assert_eq!(every.take_step_outcome(), counted.finished.take());
            seldom.take_step_outcome();
        }
    }

    /// Whatever is commanded, of whatever size: time stays within the show, jumps are counted and nothing else is, and the
    /// same list gives the same bits.
    #[test]
    fn time_stays_within_the_show_and_two_plays_are_alike(
        (time_scale, rate, start, freeze) in super::shows(),
        looping in any::<bool>(),
        list in prop::collection::vec((1u64..100_000, any_command()), 1..60),
    ) {
        let at_end = if looping { AtEnd::Loop } else { AtEnd::Hold };
        let [mut clock, mut again] = [(); 2].map(|()| super::clock(start, time_scale, rate, freeze, at_end));
        let (mut tick, mut jumps, mut before) = (0, 0u64, clock.advance(0));
        for (gap, command) in list {
            tick += gap;
            // A seek goes to a share of the show.
            let command = if let Command::Seek(share) = command { Command::Seek(share * freeze) } else { command };
            let code = clock.apply(tick, command);
            prop_assert_eq!(again.apply(tick, command), code);
            let is_jump = matches!(command, Command::Seek(_) | Command::Restart) && code == Some(Code::Done);
            jumps += u64::from(is_jump);
            let (time, other) = (clock.advance(tick), again.advance(tick));
            prop_assert_eq!(time.sim_time.to_bits(), other.sim_time.to_bits());
            prop_assert_eq!(time, other);
            prop_assert!((0.0..=freeze).contains(&time.sim_time), "{} of {freeze}", time.sim_time);
            prop_assert_eq!(u64::from(time.epoch), (jumps + time.shows_played) & 0xffff_ffff);
            if time.epoch == before.epoch {
                prop_assert!(time.sim_time >= before.sim_time);
            }
            let stands = matches!(time.playback, PlaybackState::Paused | PlaybackState::Held);
            prop_assert_eq!(time.time_scale == 0.0, stands);
            before = time;
        }
    }

    /// However long the show has run, its time is that of the present stretch: nothing adds up.
    #[test]
    fn a_billion_ticks_and_a_thousand_commands_add_no_error(pauses in prop::collection::vec(1u64..2_000_000, 1000)) {
        let playback = Playback {
            start: 0.0,
            time_scale: 1.0,
            rate: 1000.0,
            on_contact: OnContact::Stop,
            at_end: AtEnd::Hold,
            end_hold: 0.0,
            paused: false,
        };
        let mut clock = ShowClock::new(&playback, 1e12, Vec::new());
        let (mut tick, mut played) = (0u64, 0u64);
        for (index, ticks) in pauses.iter().enumerate() {
            tick += ticks;
            let command = if index % 2 == 0 { Command::Pause } else { Command::Resume };
            played += if index % 2 == 0 { *ticks } else { 0 };
            prop_assert_eq!(clock.apply(tick, command), Some(Code::Done));
        }
        let time = clock.advance(tick).sim_time;
        let exact = played as f64 / 1000.0;
        // Each stretch begins at a rounded time: half a unit in the last place for each of 1,000.
        prop_assert!((time - exact).abs() <= 1000.0 * f64::EPSILON * exact, "{time} for {exact}");
    }
}

#[test]
fn what_each_command_does_in_each_state() {
    use Code::{Already, Done, Refused};
    let states = ["playing", "paused", "waiting", "stepping", "held", "ended"];
    let table: [(Command, [Option<Code>; 6]); 9] = [
        (Command::State, [Done; 6].map(Some)),
        (Command::Pause, [Done, Already, Already, Done, Refused, Done].map(Some)),
        (Command::Resume, [Already, Done, Done, Done, Refused, Already].map(Some)),
        (Command::Rate(2.0), [Done, Done, Done, Done, Refused, Done].map(Some)),
        (Command::Seek(5.0), [Done, Done, Done, Done, Refused, Done].map(Some)),
        (Command::Restart, [Done, Done, Done, Done, Refused, Done].map(Some)),
        (Command::Hold, [Done, Done, Done, Done, Already, Done].map(Some)),
        (Command::Release, [Refused, Refused, Refused, Refused, Done, Refused].map(Some)),
        (Command::Go, [Refused, Refused, Done, Refused, Refused, Refused].map(Some)),
    ];
    for (column, state) in states.iter().enumerate() {
        let mut clock = super::clock(0.0, 1.0, 60.0, 100.0, AtEnd::Hold);
        match *state {
            "paused" => drop(clock.apply(10, Command::Pause)),
            "waiting" => (clock.mode, clock.waits) = (Mode::Paused, true),
            "stepping" => {
                clock.apply(10, Command::Pause);
                clock.apply(11, Command::Step(500));
            }
            "held" => drop(clock.apply(10, Command::Hold)),
            "ended" => clock.freeze_time = 8.0,
            _ => {}
        }
        for (command, expected) in &table {
            let tick = if *state == "stepping" { 20 } else { 1000 };
            let before = clock.clone().advance(tick);
            let mut clock = clock.clone();
            assert_eq!(clock.apply(tick, *command), expected[column], "{command:?} while {state}");
            if expected[column] == Some(Refused) || expected[column] == Some(Already) {
                assert_eq!(clock.advance(tick), before, "{command:?} while {state}");
            }
        }
        let step = clock.clone().apply(1000, Command::Step(3));
        let stepping = *state == "paused" || *state == "waiting";
        // 500 ticks after 11 the step is over, and the show paused.
        let stepping = stepping || *state == "stepping";
        assert_eq!(step, if stepping { None } else { Some(Refused) }, "step while {state}");
    }
}
