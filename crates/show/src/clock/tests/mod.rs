//! The show clock for every rate, time scale, start and end that a scene may have.

mod conducted;

use proptest::prelude::*;

use super::*;
use crate::scene::OnContact;

fn clock(start: f64, time_scale: f64, rate: f64, freeze_time: f64, at_end: AtEnd) -> ShowClock {
    let on_contact = OnContact::Stop;
    let playback = Playback { start, time_scale, rate, on_contact, at_end, end_hold: 0.0, paused: false };
    ShowClock::new(&playback, freeze_time, Vec::new())
}

/// The state at a tick of a clock without commands.
#[derive(Debug, PartialEq)]
struct At {
    sim_time: f64,
    shows_played: u64,
    ended: bool,
}

fn at(clock: &ShowClock, tick: u64) -> At {
    let ShowTime { sim_time, shows_played, playback, .. } = clock.clone().advance(tick);
    At { sim_time, shows_played, ended: playback == PlaybackState::Ended }
}

/// Numbers of every magnitude, with equal shares.
fn magnitude(least: f64, greatest: f64) -> impl Strategy<Value = f64> {
    (least..greatest).prop_map(|exponent| 10f64.powf(exponent))
}

/// Time scale, rate, start and end: a show of a billionth of a second to one of a billion billion years.
fn shows() -> impl Strategy<Value = (f64, f64, f64, f64)> {
    let start = prop_oneof![Just(0.0), magnitude(-6.0, 20.0)];
    (magnitude(-6.0, 6.0), magnitude(-1.0, 4.3), start, magnitude(-9.0, 27.0))
        .prop_map(|(time_scale, rate, start, length)| (time_scale, rate, start, start + length))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

    /// Compares with integers: a start and a scale of whole 1/1024, over a whole rate.
    #[test]
    fn time_is_that_of_the_integer_tick(
        start in 0u64..1 << 30,
        scale in 1u64..1 << 20,
        rate in 1u64..20_000,
        tick in 0u64..=1_000_000_000,
    ) {
        let clock = clock(start as f64 / 1024.0, scale as f64 / 1024.0, rate as f64, f64::MAX, AtEnd::Hold);
        for tick in [tick, 1_000_000_000] {
            // Times are in units of 1 / (1024 * rate).
            let exact = u128::from(start) * u128::from(rate) + u128::from(scale) * u128::from(tick);
            let exact = exact as f64 / (1024.0 * rate as f64);
            prop_assert!((at(&clock, tick).sim_time - exact).abs() <= 2.0 * f64::EPSILON * exact);
        }
    }

    #[test]
    fn time_never_falls_and_stays_between_start_and_end(
        (time_scale, rate, start, show_end) in shows(),
        mut ticks in prop::collection::vec(any::<u64>().prop_flat_map(|limit| 0..=limit >> (limit % 60)), 2..50),
    ) {
        let clock = clock(start, time_scale, rate, show_end, AtEnd::Hold);
        prop_assert_eq!(at(&clock, 0).sim_time, start);
        ticks.sort_unstable();
        let mut before = start;
        for tick in ticks {
            let At { sim_time, shows_played, ended } = at(&clock, tick);
            prop_assert!(before <= sim_time && sim_time <= show_end, "{before} {sim_time} {show_end}");
            prop_assert_eq!((shows_played, ended), (0, sim_time == show_end));
            before = sim_time;
        }
    }

    /// The last tick of a showing is the first at its end. Then time starts again and ticks continue.
    #[test]
    fn a_loop_ends_each_showing_at_its_first_tick_past_the_end((time_scale, rate, start, show_end) in shows()) {
        let looping = clock(start, time_scale, rate, show_end, AtEnd::Loop);
        let holding = clock(start, time_scale, rate, show_end, AtEnd::Hold);
        let seconds_per_tick = time_scale / rate;
        // Finds the first tick at the end by doubling and halving the step.
        let mut tick: u64 = 0;
        for step in (0..62).rev().map(|power| 1u64 << power) {
            tick += if at(&holding, tick + step - 1).ended { 0 } else { step };
        }
        prop_assume!(tick < 1 << 60);
        prop_assert!(at(&holding, tick).ended && (tick == 0 || !at(&holding, tick - 1).ended));
        // The expected number, to a tick, and to the resolution of doubles there.
        let fit = (show_end - start) / seconds_per_tick;
        prop_assert!((tick as f64 - fit).abs() <= 1.0 + 4.0 * f64::EPSILON * (show_end / seconds_per_tick));
        for shows_played in [0, 1, 7] {
            let first = shows_played * (tick + 1);
            let begins = At { sim_time: start, shows_played, ended: start >= show_end };
            prop_assert_eq!(at(&looping, first), begins);
            prop_assert_eq!(at(&looping, first + tick), At { sim_time: show_end, shows_played, ended: true });
            let middle = at(&looping, first + tick / 2);
            prop_assert_eq!(middle, At { shows_played, ..at(&holding, tick / 2) });
        }
    }
}

#[test]
fn a_start_past_the_end_has_ended_at_once() {
    for tick in [0, 1, u64::MAX] {
        let expected = At { sim_time: 412.5, shows_played: 0, ended: true };
        assert_eq!(at(&clock(420.0, 1.0, 60.0, 412.5, AtEnd::Hold), tick), expected);
    }
    let again = at(&clock(420.0, 1.0, 60.0, 412.5, AtEnd::Loop), 3);
    assert_eq!(again, At { sim_time: 412.5, shows_played: 3, ended: true }, "each frame is a showing");
}

#[test]
fn where_a_double_is_coarser_than_a_tick_the_first_of_equal_times_ends_the_show() {
    // Doubles are 2 s apart here: every tick from 9 s on rounds to the end, and a tick is 50 ps.
    let looping = clock(1e16 - 10.0, 1e-6, 20_000.0, 1e16, AtEnd::Loop);
    let ends = 9 * 20_000_000_000;
    assert!(at(&looping, ends).ended && !at(&looping, ends - 1).ended);
    assert_eq!(at(&looping, ends + 1).shows_played, 1);
}

#[test]
fn a_show_without_an_end_in_any_tick_never_begins_again() {
    let endless = clock(0.0, 1e-6, 20_000.0, 1e28, AtEnd::Loop);
    assert_eq!(at(&endless, u64::MAX - 1).shows_played, 0);
    assert!(!at(&endless, u64::MAX - 1).ended);
}
