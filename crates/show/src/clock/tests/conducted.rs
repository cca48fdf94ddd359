//! The clock under random commands, against the model that counts tick by tick in whole numbers.

use proptest::prelude::*;

use super::super::*;
use crate::scene::OnContact;
use bench_dragon_testing::model::{Model, ModelCue, ModelShow, Sum};

/// The rate, in frames per second. Every time, rate and scale below is a whole number of [`Sum::UNITS`], and exact as a
/// double.
const RATE: i64 = 64;

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
        (start, show_end, end_hold, paused) in shows(),
        cues in prop::collection::vec((0i64..40 * 8, any::<bool>()), 0..4),
        list in prop::collection::vec((0u64..150, commands()), 0..30),
    ) {
        let mut cues: Vec<_> = cues
            .into_iter()
            .map(|(eighths, pauses)| ModelCue { time: eighths as f64 / 8.0, pauses })
            .collect();
        cues.sort_unstable_by(|a, b| a.time.total_cmp(&b.time));
        let times = cues.iter().map(|cue| CueTime { time: cue.time, pauses: cue.pauses }).collect();
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
        let clock = ShowClock::new(&playback, show_end as f64, times);
        let show = ModelShow {
            start: start as f64,
            end: show_end as f64,
            end_hold: end_hold.map(|periods| periods as u64),
            cues,
        };
        let mut counted = Model::new(show, Sum::new(RATE), 1.0, paused);
        // One clock is read at every tick, the other clock at the commands alone.
        let (mut every, mut rarely) = (clock.clone(), clock);
        let mut tick = 0;
        for (gap, command) in list {
            for next in tick..tick + gap {
                counted.count_to(next);
                let time = every.advance(next);
                prop_assert_eq!(time.sim_time, counted.sim_time(), "at {}", next);
                prop_assert_eq!((time.playback, time.epoch, time.cues_passed), (counted.playback(), counted.epoch, counted.passed));
                prop_assert_eq!(time.time_scale, counted.time_scale());
                prop_assert_eq!(time.shows_played, counted.shows_played);
                let reached: Vec<_> = counted.reached.drain(..).map(|(_, cue)| cue).collect();
                prop_assert_eq!(every.reached(), &reached[..]);
                prop_assert_eq!(every.take_step_outcome(), counted.step_outcome.take());
                every.clear_reached();
            }
            tick += gap;
            counted.count_to(tick);
            prop_assert_eq!(rarely.advance(tick), every.advance(tick));
            rarely.take_step_outcome();
            prop_assert_eq!(every.take_step_outcome(), counted.step_outcome.take());
            let code = every.apply(tick, command);
            prop_assert_eq!(code, counted.execute(command), "{:?} at {}", command, tick);
            prop_assert_eq!(rarely.apply(tick, command), code);
            prop_assert_eq!(rarely.advance(tick), every.advance(tick));
            prop_assert_eq!(every.take_step_outcome(), counted.step_outcome.take());
            rarely.take_step_outcome();
        }
    }

    /// With any commands, of any size, time stays within the show, and only jumps are counted. The same list gives the
    /// same bits.
    #[test]
    fn time_stays_within_the_show_and_two_plays_are_alike(
        (time_scale, rate, start, show_end) in super::shows(),
        looping in any::<bool>(),
        list in prop::collection::vec((1u64..100_000, any_command()), 1..60),
    ) {
        let at_end = if looping { AtEnd::Loop } else { AtEnd::Hold };
        let [mut clock, mut again] = [(); 2].map(|()| super::clock(start, time_scale, rate, show_end, at_end));
        let (mut tick, mut jumps, mut before) = (0, 0u64, clock.advance(0));
        for (gap, command) in list {
            tick += gap;
            // A seek goes to a share of the show.
            let command = if let Command::Seek(share) = command { Command::Seek(share * show_end) } else { command };
            let code = clock.apply(tick, command);
            prop_assert_eq!(again.apply(tick, command), code);
            let is_jump = matches!(command, Command::Seek(_) | Command::Restart) && code == Some(Code::Done);
            jumps += u64::from(is_jump);
            let (time, other) = (clock.advance(tick), again.advance(tick));
            prop_assert_eq!(time.sim_time.to_bits(), other.sim_time.to_bits());
            prop_assert_eq!(time, other);
            prop_assert!((0.0..=show_end).contains(&time.sim_time), "{} of {show_end}", time.sim_time);
            prop_assert_eq!(u64::from(time.epoch), (jumps + time.shows_played) & 0xffff_ffff);
            if time.epoch == before.epoch {
                prop_assert!(time.sim_time >= before.sim_time);
            }
            let stands = matches!(time.playback, PlaybackState::Paused | PlaybackState::Held);
            prop_assert_eq!(time.time_scale == 0.0, stands);
            before = time;
        }
    }

    /// The time of a show, however long it has run, follows from the present stretch. Only a command can add an error:
    /// the command rounds the time once.
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
