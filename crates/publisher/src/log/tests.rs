//! Logs of the loop on a simulated clock: with commands, delays and cuts, and of another machine.

mod setup;
mod wrong_lines;

use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRng;

use super::arithmetic::Arithmetic;
use super::lines::{HashChain, Line, ShowLine};
use super::queue_of;
use super::writer::LogWriter;
use crate::live::{End, LoopCounts, Outgoing, Publisher};
use bench_dragon_messages::FrameHeader;
use bench_dragon_messages::control::{Code, Command, CommandRecord};
use bench_dragon_motion::event::unreported;
use bench_dragon_motion::solve::table::Instructions;
use bench_dragon_show::scene::AtEnd;
use bench_dragon_show::{Playback, Show};
use bench_dragon_testing::simulated::Wake;
use setup::{File, NEWTON, RATE, Setup, SharedFile, conducted, forged, scene_text, verified};

/// Every command, with values that are in range and some that are not.
fn commands() -> impl Strategy<Value = Command> {
    prop_oneof![
        1 => Just(Command::State),
        1 => Just(Command::Pause),
        3 => Just(Command::Resume),
        1 => (-2.0f64..2.0).prop_map(|exponent| Command::Rate(10f64.powf(exponent))),
        1 => Just(Command::Rate(f64::NAN)),
        1 => (-1.0f64..60.0).prop_map(Command::Seek),
        1 => Just(Command::Seek(f64::INFINITY)),
        2 => (1u64..9).prop_map(Command::Step),
        1 => Just(Command::Restart),
        1 => Just(Command::Hold),
        2 => Just(Command::Release),
        1 => Just(Command::Go),
    ]
}

fn wakes() -> impl Strategy<Value = Wake> {
    prop_oneof![20 => Just(Wake::Late(0)), 1 => (0u64..80_000_000).prop_map(Wake::Late)]
}

/// Values from a strategy, the same in each run of the tests.
fn some<T: std::fmt::Debug>(strategy: impl Strategy<Value = T>) -> T {
    let rng = TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha);
    let mut runner = proptest::test_runner::TestRunner::new_with_rng(ProptestConfig::default(), rng);
    strategy.new_tree(&mut runner).unwrap().current()
}

#[test]
fn ten_thousand_commands_with_skipped_periods_play_again_bit_for_bit() {
    let wanted = 10_000;
    let (commands, wakes) = some((prop::collection::vec(commands(), wanted), prop::collection::vec(wakes(), 40_000)));
    let playback = |playback: &mut Playback| (playback.at_end, playback.end_hold) = (AtEnd::Loop, 0.1);
    let run =
        Setup { text: scene_text(NEWTON, true), commands: commands.clone(), wakes, playback, ..Setup::new(16_000) }
            .run();
    assert!(run.counts.skipped > 500, "{:?}", run.counts);
    let lines = run.lines();
    let logged: Vec<_> = lines.iter().filter(|line| matches!(line, Line::Command { .. })).collect();
    assert_eq!(logged.len(), wanted);
    // Each has its name, in the order in which it was sent; each answer has its line, at its tick.
    for (line, command) in logged.iter().zip(&commands) {
        let Line::Command { command: name, value, .. } = line else { unreachable!() };
        let (_, given) = command.number_and_value();
        assert_eq!(name, command.name());
        assert!(value.is_none_or(|value| value.to_bits() == given.to_bits()), "{value:?} {given}");
    }
    let answered = lines.iter().filter_map(|line| match line {
        Line::Command { tick, code: Some(code), .. } | Line::StepFinished { tick, code } => Some((*tick, code.clone())),
        _ => None,
    });
    let answered: Vec<(u64, String)> = answered.collect();
    let answers: Vec<_> = run.answers.iter().map(|outcome| (outcome.tick, outcome.code.name().to_owned())).collect();
    assert_eq!(answered[..answers.len()], answers);
    assert!(answered.len() - answers.len() <= 2, "the last ones found the loop over");
    for code in [Code::Done, Code::Already, Code::Refused, Code::OutOfRange] {
        assert!(answers.iter().any(|(_, found)| found == code.name()), "no command is {}", code.name());
    }
    let verdict = verified(&run.log).unwrap();
    assert_eq!((verdict.verdict, verdict.complete, verdict.commands), ("same", true, wanted as u64), "{verdict:?}");
    assert_eq!((verdict.frames, verdict.lost), (run.counts.frames, 0));
    assert_eq!(verdict.skipped, run.counts.skipped);
    assert!(verdict.same_seconds >= 16_000 / 50 - 1 && verdict.seconds == verdict.same_seconds, "{verdict:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(24) })]

    #[test]
    fn any_show_plays_again_whatever_was_late_and_commanded(
        commands in prop::collection::vec(commands(), 0..40),
        wakes in prop::collection::vec(wakes(), 0..200),
        periods in 1u64..220,
        paused: bool,
        looping: bool,
    ) {
        let playback: fn(&mut Playback) = match (paused, looping) {
            (true, _) => |playback| (playback.paused, playback.start, playback.rate) = (true, 1.0 / 3.0, 59.94),
            (_, true) => |playback| (playback.at_end, playback.end_hold, playback.time_scale) = (AtEnd::Loop, 0.1, 30.0),
            _ => |playback| (playback.time_scale, playback.rate) = (0.7, 0.7),
        };
        let run = Setup { commands, wakes, playback, ..Setup::new(periods) }.run();
        let verdict = verified(&run.log).unwrap();
        let expected = if run.counts.frames > 0 { "same" } else { "nothing" };
        prop_assert_eq!(verdict.verdict, expected, "{:?}", verdict);
        // Also those that were skipped after the last frame.
        prop_assert_eq!((verdict.frames, verdict.skipped), (run.counts.frames, run.counts.skipped));
        prop_assert!(verdict.complete && verdict.last_tick < Some(verdict.frames + verdict.skipped), "{:?}", verdict);
    }

    #[test]
    fn numbers_in_a_line_read_back_bit_for_bit(bits: u64, tick: u64) {
        let value = f64::from_bits(bits);
        let line = Line::of(tick, CommandRecord::Given { command: Command::Seek(value), code: Some(Code::Done) });
        let read = HashChain::default().read(&HashChain::default().line(&line)).unwrap();
        let Line::Command { value: found, .. } = &read else { panic!("{read:?}") };
        prop_assert_eq!(found.map(f64::to_bits), value.is_finite().then_some(bits));
    }
}

#[test]
fn a_log_that_was_cut_proves_what_it_holds() {
    let run = conducted();
    let text = String::from_utf8(run.log.clone()).unwrap();
    let ends: Vec<usize> = text.match_indices('\n').map(|(at, _)| at + 1).collect();
    let seconds = |until: usize| text[..until].matches("\"type\":\"second\"").count() as u64;
    for end in &ends[..ends.len() - 1] {
        for (until, cut) in [(*end, false), (end + 20, true)] {
            let verdict = verified(&run.log[..until]).unwrap();
            let expected = if seconds(*end) == 0 { "nothing" } else { "same" };
            assert_eq!((verdict.verdict, verdict.complete, verdict.cut), (expected, false, cut), "{until} bytes");
            assert_eq!(verdict.seconds, seconds(*end), "{until} bytes");
        }
    }
    assert!(verified(&run.log[..30]).is_err() && verified(b"").is_err() && verified(b"\n").is_err());
}

#[test]
fn frames_that_the_log_lost_are_named_and_the_others_proved() {
    // Nine frames fit. The thread sleeps over thirty frames, and again over commands.
    let held_up: fn(u64) -> bool = |tick| (20..50).contains(&tick) || (60..80).contains(&tick);
    let commands = vec![Command::Seek(20.0); 70];
    let run = Setup { held_up, words: 750, commands, ..Setup::new(120) }.run();
    let verdict = verified(&run.log).unwrap();
    assert_eq!((verdict.verdict, verdict.frames + verdict.lost), ("same", 120), "{verdict:?}");
    assert!(verdict.lost >= 20 && verdict.commands >= 68, "{verdict:?}");
    let lost: u64 =
        run.lines().iter().map(|line| if let Line::Lost { from, to } = line { to - from + 1 } else { 0 }).sum();
    assert_eq!(lost, verdict.lost);
}

#[test]
fn a_log_that_is_too_far_behind_says_where_it_ends() {
    // Frames of 76 words, room for four of them and for ten records.
    let (mut publisher, mut reader) = queue_of(4 * 76, 50);
    let scene = scene_text(NEWTON, false).parse().unwrap();
    let playback = Playback { rate: RATE, ..Playback::of(&scene) };
    let mut show = Show::new(&scene, scene.ensemble.timeline_without_contact(&mut unreported), playback).unwrap();
    for tick in 0..40 {
        // Three commands come in each period. The records of the first of these periods fit exactly.
        if tick >= 10 {
            for _ in 0..3 {
                let _ = show.command(tick, Command::State);
            }
        }
        let header = FrameHeader { tick, ..Default::default() };
        publisher.publish(Outgoing::new(&header, show.frame(tick))).unwrap();
    }
    let file = File::default();
    let line = ShowLine::new(&scene_text(NEWTON, false), &playback, Arithmetic::of(&scene), "", 1, 2);
    let mut writer = LogWriter::new(SharedFile(file.clone()), line);
    reader.empty(&mut writer);
    let counts = writer.counts();
    // Four frames, the ticks of six lost frames, and the tick of the next one with its three commands. The whole record
    // of the frame after that has no room.
    assert_eq!((counts.frames, counts.lost), (4, 7));
    let text = String::from_utf8(file.borrow().clone()).unwrap();
    assert_eq!(text.matches("\"command\":\"state\"").count(), 3, "{text}");
    // The queue takes nothing more, though it has room again: the missing records would not show.
    publisher.publish(Outgoing::new(&FrameHeader { tick: 40, ..Default::default() }, show.frame(40))).unwrap();
    assert!(reader.queue.is_empty());
}

#[test]
fn a_frame_is_read_when_all_of_it_has_come() {
    let (mut publisher, mut reader) = queue_of(1000, 50);
    let text = scene_text(NEWTON, false);
    let scene = text.parse().unwrap();
    let playback = Playback { rate: RATE, ..Playback::of(&scene) };
    let mut show = Show::new(&scene, scene.ensemble.timeline_without_contact(&mut unreported), playback).unwrap();
    let line = ShowLine::new(&text, &playback, Arithmetic::of(&scene), "", 1, 2);
    let mut writer = LogWriter::new(SharedFile(File::default()), line);
    publisher.publish(Outgoing::new(&FrameHeader::default(), show.frame(0))).unwrap();
    let mut whole = vec![0.0; reader.queue.slots()];
    reader.queue.pop_entire_slice(&mut whole).unwrap();
    for word in whole {
        assert_eq!(writer.counts().frames, 0);
        publisher.push(&[word]);
        reader.empty(&mut writer);
    }
    assert_eq!((writer.counts().frames, reader.queue.slots()), (1, 0));
}

#[test]
fn the_last_line_says_why_the_run_ended_and_holds_the_periods_after_the_last_frame() {
    // Every period after tick 77 passes before the loop wakes again.
    let mut wakes = vec![Wake::Late(0); 79];
    wakes[78] = Wake::Late(10_000_000_000);
    for (fails_at, wakes, reason) in
        [(None, vec![], End::Duration), (None, wakes, End::Duration), (Some(40), vec![], End::Error)]
    {
        let late = !wakes.is_empty();
        let run = Setup { fails_at, wakes, ..Setup::new(100) }.run();
        assert_eq!((run.counts.end, run.counts.skipped > 0), (reason, late), "{:?}", run.counts);
        let Some(Line::End { frames, skipped, reason: found, .. }) = run.lines().pop() else { panic!("no end") };
        assert_eq!((frames, skipped, found), (run.counts.frames, run.counts.skipped, reason));
        let verdict = verified(&run.log).unwrap();
        assert_eq!((verdict.verdict, verdict.complete, verdict.skipped), ("same", true, skipped), "{verdict:?}");
    }
}

/// A file that is full after some bytes.
struct Full(usize);

impl std::io::Write for Full {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0 = self.0.checked_sub(bytes.len()).ok_or(std::io::ErrorKind::StorageFull)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_reported_once_and_nothing_more_is_written() {
    let scene = scene_text(NEWTON, false).parse().unwrap();
    let line = ShowLine::new(&scene_text(NEWTON, false), &Playback::of(&scene), Arithmetic::of(&scene), "", 1, 2);
    let mut writer = LogWriter::new(Full(5000), line);
    assert!(writer.take_failure().is_none());
    let record = CommandRecord::Given { command: Command::State, code: Some(Code::Done) };
    (0..200).for_each(|tick| writer.command(tick, record));
    assert_eq!(writer.take_failure().unwrap().kind(), std::io::ErrorKind::StorageFull);
    writer.end(&LoopCounts { frames: 200, overruns: 0, skipped: 0, end: End::Duration });
    assert!(writer.take_failure().is_none());
}

/// The log of a machine whose tables are read with other instructions: `close`, by a second solver.
#[test]
fn a_log_of_another_arithmetic_is_compared_with_a_second_solver() {
    for (method, most) in [("accuracy = 1e-9", 1e-12), ("accuracy = 1e-4", 1e-4)] {
        let text = scene_text(method, false);
        let run = Setup { text, instructions: Instructions::Portable, ..Setup::new(150) }.run();
        assert_eq!(verified(&run.log).unwrap().verdict, "same", "this machine has those instructions too");
        // As from another machine, with other last digits.
        let foreign = |line: &mut Line| {
            match line {
                Line::Show(show) => show.arithmetic.instructions = "SVE".to_owned(),
                Line::Second(second) => second.hash = second.hash.replace('0', "1"),
                _ => {}
            }
            true
        };
        let verdict = forged(&run, foreign).unwrap();
        assert_eq!((verdict.verdict, verdict.same_arithmetic, verdict.seconds), ("close", false, 3), "{verdict:?}");
        assert!(verdict.max_difference.unwrap() <= most, "{verdict:?}");
        assert!(verdict.tolerance.unwrap() < 2.0 * most.max(1e-9), "{verdict:?}");
        // A handle that is elsewhere, and a time that is another, are found all the same.
        let moved = |by: f64, of_time: bool| {
            forged(&run, |line| {
                foreign(line);
                if let Line::Second(second) = line
                    && second.second == 1
                {
                    let number = if of_time { &mut second.sim_time } else { &mut second.handles[2].1 };
                    *number += by;
                }
                true
            })
        };
        for of_time in [false, true] {
            let found = moved(10.0 * most.max(1e-9), of_time).unwrap();
            assert_eq!((found.verdict, found.difference.unwrap().second), ("differs", 1));
        }
    }
}
