//! Frames of the show clock under random commands, with skipped periods, and frames with a fault.

use proptest::prelude::*;

use super::*;
use crate::strategies::commands;
use bench_dragon_messages::control::Command;
use bench_dragon_show::Playback;
use bench_dragon_show::clock::ShowClock;
use bench_dragon_show::scene::{AtEnd, OnContact};

const RATE: f64 = 50.0;

/// Returns the frames of a show under these commands: (frames after the command, periods after each frame, command).
fn frames(list: &[(u64, u64, Command)]) -> Vec<(FrameHeader, Vec<HandlePose>)> {
    let playback = Playback {
        start: 0.0,
        time_scale: 1.0,
        rate: RATE,
        on_contact: OnContact::Stop,
        at_end: AtEnd::Loop,
        end_hold: 0.0,
        paused: false,
    };
    let mut clock = ShowClock::new(&playback, 7.0, Vec::new());
    let (mut tick, mut frames) = (0, Vec::new());
    for (count, periods, command) in list {
        clock.apply(tick, *command);
        for _ in 0..*count {
            let time = clock.advance(tick);
            let header = FrameHeader {
                run_id: 1,
                sequence: frames.len() as u64,
                tick,
                sim_time: time.sim_time,
                time_scale: time.time_scale,
                playback: time.playback as u32,
                epoch: time.epoch,
                handles: 2,
                ..FrameHeader::default()
            };
            let speed = if time.playback == PlaybackState::Playing { 1.0 } else { 0.0 };
            let pose = HandlePose { x: time.sim_time, vx: speed, ..HandlePose::default() };
            frames.push((header, vec![pose; 2]));
            tick += periods;
        }
    }
    frames
}

fn faults(frames: &[(FrameHeader, Vec<HandlePose>)]) -> Vec<String> {
    let mut conformance = ConformanceCheck::default();
    frames
        .iter()
        .filter_map(|(header, handles)| Some(conformance.check(header, handles, RATE).err()?.to_string()))
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

    #[test]
    fn frames_of_the_show_clock_conform_under_any_commands(
        list in prop::collection::vec((1u64..60, prop_oneof![8 => Just(1u64), 1 => 2u64..20], commands()), 1..40),
    ) {
        prop_assert_eq!(faults(&frames(&list)), Vec::<String>::new());
    }

    #[test]
    fn frames_that_were_not_received_are_no_fault(
        list in prop::collection::vec((1u64..60, Just(1u64), commands()), 1..40),
        kept in prop::collection::vec(any::<bool>(), 3000),
    ) {
        let mut kept = kept.into_iter().cycle();
        let received: Vec<_> = frames(&list).into_iter().filter(|_| kept.next() == Some(true)).collect();
        prop_assert_eq!(faults(&received), Vec::<String>::new());
    }
}

#[test]
fn each_fault_is_noticed() {
    // Plays for 30 frames, is paused for 30, plays at double rate for 30, is held for 30.
    let list = [
        (30, 1, Command::State),
        (30, 1, Command::Pause),
        (1, 1, Command::Rate(2.0)),
        (30, 1, Command::Resume),
        (30, 1, Command::Hold),
    ];
    let right = frames(&list);
    assert_eq!(faults(&right), Vec::<String>::new());
    type Change = fn(&mut (FrameHeader, Vec<HandlePose>));
    let changes: [(usize, &str, Change); 9] = [
        (10, "the time is not that of the rate", |frame| frame.0.sim_time += 1e-9),
        (10, "the time is not that of the rate", |frame| frame.0.sim_time -= 1.0 / RATE),
        (80, "the time is not that of the rate", |frame| frame.0.sim_time -= 1.0 / RATE),
        (40, "the time is not that of the rate", |frame| frame.0.sim_time += 1.0 / RATE),
        (40, "the time scale is not that", |frame| frame.0.time_scale = 1.0),
        (100, "has velocities", |frame| frame.1[1].vy = 1e-300),
        (100, "in another pose", |frame| frame.1[1].heading = 1e-16),
        (40, "no such playback", |frame| frame.0.playback = 4),
        (10, "outside the show", |frame| (frame.0.epoch, frame.0.sim_time) = (1, -1.0)),
    ];
    for (place, words, change) in changes {
        let mut wrong = right.clone();
        change(&mut wrong[place]);
        let faults = faults(&wrong);
        assert!(
            faults.first().is_some_and(|fault| fault.starts_with(words) || fault.contains(words)),
            "{words}: {faults:?}"
        );
    }
}

#[test]
fn the_end_begins_again_in_a_new_epoch() {
    let right = frames(&[(400, 1, Command::Seek(6.9))]);
    assert!(right.iter().any(|(header, _)| header.playback_state() == Some(PlaybackState::Ended)));
    assert_eq!(faults(&right), Vec::<String>::new());
    let mut stuck = right.clone();
    stuck.iter_mut().for_each(|(header, _)| header.epoch = 1);
    assert!(faults(&stuck)[0].starts_with("the show has ended and does not begin again"), "{:?}", faults(&stuck));
    let mut twice = right;
    twice.iter_mut().skip(2).for_each(|(header, _)| header.epoch += 2);
    assert!(faults(&twice)[0].starts_with("more jumps than a period can have"), "{:?}", faults(&twice));
}
