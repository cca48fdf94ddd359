//! The show: deterministic, without drift, ended and looped as the scene states, and with levels that do not depend on
//! the number of frames.

use bench_dragon::messages::state::EventKind;
use bench_dragon::messages::state::{FrameState, Level, PlaybackState};
use bench_dragon::motion::clearance::least_clearance_all_pairs;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::show::alerts::Alert;
use bench_dragon::show::convert::{Stamps, frame_header};
use bench_dragon::show::scene::{AtEnd, OnContact, Scene};
use bench_dragon::show::{Playback, Show};
use proptest::prelude::*;

fn paper_timeline() -> Timeline {
    Scene::paper().ensemble.timeline(&mut unreported)
}

fn show(playback: Playback) -> Show {
    Show::new(&Scene::paper(), paper_timeline(), playback).unwrap()
}

fn playback() -> Playback {
    Playback { end_hold: 0.0, ..Playback::of(&Scene::paper()) }
}

/// The frames of a loop equal those of a separate solver at times counted in whole ticks, whichever frames were
/// computed before. A skipped period or another run changes no bit.
#[test]
fn a_frame_is_that_of_its_tick_whatever_came_before() {
    let (start, rate) = (400.0, 60.0);
    let scene = Scene::paper();
    let contact = paper_timeline().find(EventKind::Contact).unwrap().time;
    assert!((contact - 412.473837682115).abs() < 1e-10);
    // 12.47 s are 748.4 ticks; the next is the contact, and the one after that the start again.
    let period = 750;
    let mut solver = scene.ensemble.only().unwrap().solver(Velocities::Computed).solver;
    let mut chain = Chain::new(scene.ensemble.handles());
    for step in [1, 3, 41] {
        let mut show = show(Playback { start, rate, at_end: AtEnd::Loop, ..playback() });
        for tick in (0..2000).step_by(step) {
            let within = tick % period;
            let time = if within == period - 1 { contact } else { start + within as f64 / rate };
            solver.solve(time, &mut chain).unwrap();
            if within == period - 1 {
                [&mut chain.speed, &mut chain.vx, &mut chain.vy].into_iter().for_each(|column| column.fill(0.0));
            }
            let frame = show.frame(tick);
            assert_eq!((frame.tick, frame.sim_time, u64::from(frame.epoch)), (tick, time, tick / period));
            assert_eq!(frame.chain, chain, "tick {tick} of every {step}");
            if tick % 7 == 0 {
                let least = least_clearance_all_pairs(&chain, scene.ensemble.only().unwrap().team()).unwrap();
                assert_eq!(frame.min_clearance, least.value, "tick {tick} of every {step}");
            }
        }
    }
}

#[test]
fn time_does_not_drift_in_a_billion_ticks() {
    let playback = Playback { rate: 1000.0, time_scale: 1e-6, ..playback() };
    let mut show = show(playback);
    for tick in [1u64, 999, 1_000_000_000, 10_000_000_000] {
        let frame = show.frame(tick);
        // A thousandth of a microsecond a tick, from exact integers.
        assert_eq!(frame.sim_time, 1e-6 * tick as f64 / 1000.0);
    }
}

#[test]
fn the_show_freezes_exactly_at_the_contact() {
    let mut show = show(Playback { start: 412.0, ..playback() });
    let moving = show.frame(28).clone();
    assert_eq!((moving.playback, moving.time_scale), (PlaybackState::Playing, 1.0));
    assert_eq!(moving.state, FrameState::Approaching);
    for tick in [29, 30, 1_000_000] {
        let frame = show.frame(tick);
        assert_eq!((frame.state, frame.playback, frame.time_scale), (FrameState::Contact, PlaybackState::Ended, 1.0));
        assert!((frame.sim_time - 412.473837682115).abs() < 1e-10);
        assert!(frame.min_clearance.abs() < 1e-9, "{}", frame.min_clearance);
        assert!(frame.chain.vx.iter().chain(&frame.chain.vy).all(|velocity| *velocity == 0.0));
    }
}

#[test]
fn a_loop_begins_again_where_it_began() {
    let mut show = show(Playback { start: 412.0, at_end: AtEnd::Loop, ..playback() });
    let first = show.frame(0).clone();
    assert_eq!(show.frame(29).state, FrameState::Contact);
    let again = show.frame(30);
    assert_eq!((again.sim_time, again.shows_played), (412.0, 1));
    assert_eq!(again.chain, first.chain);
    assert_eq!((again.state, again.playback), (FrameState::Approaching, PlaybackState::Playing));
    let stamps = Stamps { run_id: 1, sequence: 30, stamp_ns: 2, deadline_ns: 3 };
    let [before, after] = [&first, again].map(|frame| frame_header(frame, stamps));
    assert_eq!((before.epoch, after.epoch), (0, 1), "the epoch tells readers to restart their interpolation");
    assert_eq!((after.tick, after.sequence, after.handles, after.time_scale), (30, 30, 224, 1.0));
}

/// The nearest two boards are those of the frame at every level; the event is the next one, then the one that happened.
#[test]
fn an_alert_knows_what_it_is_about_and_who_is_nearest_now() {
    let mut show = show(Playback { start: 380.0, rate: 10.0, ..playback() });
    let contact = *show.timeline().find(EventKind::Contact).unwrap();
    let mut levels = Vec::new();
    for tick in 0..330 {
        let frame = show.frame(tick).clone();
        for alert in &frame.alerts {
            assert_eq!(alert.event, Some(contact), "at {} s", frame.sim_time);
            let all = least_clearance_all_pairs(&frame.chain, Scene::paper().ensemble.only().unwrap().team()).unwrap();
            let nearest = alert.nearest.unwrap();
            assert_eq!((nearest.bench_a, nearest.bench_b, nearest.value), (all.bench_a, all.bench_b, all.value));
            assert_eq!(nearest.value, frame.min_clearance);
            levels.push(alert.level);
        }
    }
    levels.dedup();
    assert_eq!(levels, [Level::Clear, Level::Approaching, Level::Contact]);
}

#[test]
fn a_start_after_the_contact_is_in_contact_at_once() {
    let mut stopped = show(Playback { start: 420.0, ..playback() });
    assert_eq!(stopped.frame(0).state, FrameState::Contact);
    assert!((stopped.frame(1).sim_time - 412.473837682115).abs() < 1e-10);
    let mut going_on = show(Playback { start: 420.0, on_contact: OnContact::Continue, ..playback() });
    let frame = going_on.frame(0);
    assert_eq!((frame.state, frame.sim_time), (FrameState::Contact, 420.0));
    assert_eq!(frame.alerts.iter().map(|alert| alert.level).collect::<Vec<_>>(), [Level::Contact]);
}

#[test]
fn without_alerts_and_velocities_neither_is_computed() {
    let text = include_str!("../../config/paper.toml").replace("[alerts]", "").replace("approach_", "# approach_");
    let scene = Scene::parse(&text.replace("velocities = true", "velocities = false"), "test", "test").unwrap();
    let timeline = scene.ensemble.timeline_without_contact(&mut unreported);
    let mut show = Show::new(&scene, timeline, Playback { start: 412.0, ..Playback::of(&scene) }).unwrap();
    for tick in 0..100 {
        let frame = show.frame(tick);
        assert!(frame.min_clearance.is_nan() && frame.alerts.is_empty());
        assert_eq!(frame.state, FrameState::Moving);
        let chain = &frame.chain;
        assert!(chain.vx.iter().chain(&chain.vy).chain(&chain.speed).all(|velocity| velocity.is_nan()));
    }
    assert_eq!(show.pairs_tested(), 0, "a pair was tested for its clearance");
}

#[test]
fn a_tick_past_the_lock_freezes_the_show_at_it() {
    // The largest time scale, and the lowest rate at a large one: the second frame is far past the lock.
    let lock = paper_timeline().end().time;
    for (rate, time_scale) in [(60.0, 1e6), (0.1, 1e6), (0.1, 50.0)] {
        let mut show = show(Playback { rate, time_scale, on_contact: OnContact::Continue, ..playback() });
        assert_eq!(show.frame(0).sim_time, 0.0);
        for tick in [1, 2, 10_000_000_000] {
            let frame = show.frame(tick);
            assert_eq!((frame.sim_time, frame.state), (lock, FrameState::Lock));
            assert!(frame.chain.vx.iter().chain(&frame.chain.speed).all(|speed| *speed == 0.0));
            assert!(frame.chain.x.iter().chain(&frame.chain.heading).all(|number| number.is_finite()));
        }
    }
}

/// A show whose events were not found, as after a search that gave up: the frames themselves show the contact.
#[test]
fn boards_that_overlap_unforeseen_are_a_contact_at_once() {
    let scene = Scene::paper();
    let unsearched = scene.ensemble.timeline_without_contact(&mut unreported);
    let playback = Playback { start: 412.0, rate: 1000.0, ..playback() };
    let mut show = Show::new(&scene, unsearched, playback).unwrap();
    let mut alerts = Vec::new();
    for tick in 0..600 {
        let frame = show.frame(tick);
        alerts.extend(frame.alerts.iter().copied().filter(|alert| alert.level == Level::Contact));
        let overlapping = frame.sim_time > 412.473837682115;
        assert_eq!(
            (frame.state == FrameState::Contact, frame.unforeseen_contacts),
            (overlapping, u64::from(overlapping))
        );
        assert_eq!(frame.unsolved_frames, 0);
    }
    let [Alert { event: Some(contact), .. }] = alerts[..] else { panic!("{alerts:?}") };
    assert_eq!((contact.event.bench_a, contact.event.bench_b), (Some(0), Some(8)));
    assert!((contact.time - 412.474).abs() < 1e-9, "{contact:?}");
}

/// Returns the levels announced over a whole show, without repeats, and the times of the events as announced.
fn levels(rate: f64, time_scale: f64, start: f64, on_contact: OnContact) -> (Vec<Level>, Vec<(Level, f64)>) {
    let mut show = show(Playback { rate, time_scale, start, on_contact, ..playback() });
    let ticks = ((show.freeze_time() - start) * rate / time_scale).ceil() as u64 + 2;
    let (mut levels, mut events) = (Vec::new(), Vec::new());
    for tick in 0..ticks {
        for alert in &show.frame(tick).alerts {
            if levels.last() != Some(&alert.level) {
                levels.push(alert.level);
            }
            if alert.level >= Level::Contact {
                events.push((alert.level, alert.event.unwrap().time));
            }
        }
    }
    (levels, events)
}

#[test]
fn the_paper_scene_never_flickers() {
    use Level::{Approaching, Clear, Contact, Lock, Stall};
    assert_eq!(levels(60.0, 1.0, 0.0, OnContact::Stop).0, [Clear, Approaching, Contact]);
    assert_eq!(levels(60.0, 1.0, 0.0, OnContact::Continue).0, [Clear, Approaching, Contact, Stall, Lock]);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(12) })]

    /// The announcements depend neither on the rate nor on the time scale.
    #[test]
    fn events_do_not_depend_on_the_rate(exponent in -0.3f64..3.7, time_scale in 0.5f64..2.0) {
        use Level::{Approaching, Clear, Contact, Lock, Stall};
        let (levels, events) = levels(10f64.powf(exponent), time_scale, 380.0, OnContact::Continue);
        prop_assert_eq!(levels, [Clear, Approaching, Contact, Stall, Lock]);
        for ((_, time), truth) in events.iter().zip([412.473837682115, 432.758134083656, 432.917924228383]) {
            prop_assert!((time - truth).abs() < 1e-10);
        }
    }
}
