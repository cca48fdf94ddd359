//! A sender of timecode, a network, the clock of a real show and the chase, on simulated time from a seed.

use std::collections::VecDeque;

use bench_dragon_messages::FrameHeader;
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_show::Playback;
use bench_dragon_show::clock::ShowClock;
use bench_dragon_show::scene::{AtEnd, OnContact};
use fastrand::Rng;

use crate::schedule::Schedule;
use crate::steering::{Steering, Waiting};
use crate::synchronizer::{Motion, Options, Reading, Synchronizer};
use crate::timecode::FrameRate;

const SECOND: u64 = 1_000_000_000;
const MILLISECOND: u64 = 1_000_000;
/// The moment at which the show of a simulation begins.
const BEGIN_NS: u64 = 1000 * SECOND;
/// The interval of the chase's polls.
const POLL_NS: u64 = 2 * MILLISECOND;

/// A part of a sender's timecode: from a moment after the beginning, the position there and the speed.
#[derive(Debug, Clone, Copy)]
struct Part {
    from: f64,
    position: f64,
    speed: f64,
}

struct Sender {
    rate: FrameRate,
    parts: Vec<Part>,
    /// Standard deviation of the jitter, in seconds; share of lost packets; stalls of the network from a moment, in
    /// seconds.
    jitter: f64,
    loss: f64,
    stalls: Vec<(f64, f64)>,
    end: f64,
}

impl Sender {
    fn part(&self, moment: f64) -> Part {
        *self.parts.iter().rev().find(|part| part.from <= moment).unwrap_or(&self.parts[0])
    }

    fn position(&self, moment: f64) -> f64 {
        let Part { from, position, speed } = self.part(moment);
        position + speed * (moment - from)
    }

    /// Returns the readings in the order of their arrival.
    fn readings(&self, random: &mut Rng) -> VecDeque<Reading> {
        let day = self.rate.seconds(f64::from(self.rate.frames_per_day()));
        let frame = self.rate.seconds(1.0);
        let mut readings = Vec::new();
        for (index, part) in self.parts.iter().enumerate() {
            let end = self.parts.get(index + 1).map_or(self.end, |next| next.from);
            let interval = if part.speed == 0.0 { frame } else { frame / part.speed.abs() };
            for k in 0.. {
                let moment = part.from + k as f64 * interval;
                if moment >= end.min(self.end) {
                    break;
                }
                if random.f64() < self.loss {
                    continue;
                }
                let normal = (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
                let mut arrival = moment + self.jitter * normal;
                for (from, length) in &self.stalls {
                    if (*from..from + length).contains(&arrival) {
                        arrival = from + length + 1e-5 * k as f64;
                    }
                }
                let position = (part.position + part.speed * (moment - part.from)).rem_euclid(day);
                readings.push(Reading { position, at_ns: BEGIN_NS + (arrival.max(0.0) * 1e9) as u64, day });
            }
        }
        readings.sort_by_key(|reading| reading.at_ns);
        readings.into()
    }
}

/// A frame of the show: the moment of its deadline, and its header.
type Published = (f64, FrameHeader);

struct Run {
    frames: Vec<Published>,
    motions: Vec<(f64, Motion)>,
    waits: Vec<(f64, Option<Waiting>)>,
}

/// Plays a chase for some seconds. `others` are the commands of another client, at moments after the beginning.
fn play(sender: &Sender, schedule: Schedule, paused: bool, others: &[(f64, Command)], seconds: f64, seed: u64) -> Run {
    let mut random = Rng::with_seed(seed);
    let mut readings = sender.readings(&mut random);
    let rate = 60.0;
    let playback = Playback {
        start: 0.0,
        time_scale: 1.0,
        rate,
        on_contact: OnContact::Stop,
        at_end: AtEnd::Hold,
        end_hold: 5.0,
        paused,
    };
    let mut clock = ShowClock::new(&playback, 412.0, Vec::new());
    let mut synchronizer = Synchronizer::new(Options { freewheel: 2.0, readings_to_lock: 3 });
    let mut steering = Steering::new(schedule.limits());
    steering.set_end(412.0);
    let mut others: VecDeque<_> = others.iter().copied().collect();
    // Commands on their way to the loop, and answers on their way back, with the moments at which the chase sent them.
    let mut commands: VecDeque<(u64, Command, Option<u64>)> = VecDeque::new();
    let mut answers: VecDeque<(u64, u64, Code, u64)> = VecDeque::new();
    let mut run = Run { frames: Vec::new(), motions: Vec::new(), waits: Vec::new() };
    let (mut now, mut tick, mut newest, mut was_locked) = (BEGIN_NS, 0u64, None, false);
    while now < BEGIN_NS + (seconds * 1e9) as u64 {
        now += POLL_NS;
        while BEGIN_NS + (tick as f64 * 1e9 / rate) as u64 <= now {
            let deadline = BEGIN_NS + (tick as f64 * 1e9 / rate) as u64;
            let moment = tick as f64 / rate;
            if others.front().is_some_and(|(at, _)| *at <= moment) {
                commands.extend(others.pop_front().map(|(_, command)| (deadline, command, None)));
            }
            if let Some((_, command, sent_ns)) = commands.front().copied().filter(|(arrives, ..)| *arrives <= deadline)
            {
                commands.pop_front();
                let code = clock.apply(tick, command).unwrap_or(Code::Done);
                if let Some(sent_ns) = sent_ns {
                    answers.push_back((deadline + random.u64(1..3) * MILLISECOND, sent_ns, code, tick));
                }
            }
            let time = clock.advance(tick);
            let header = FrameHeader {
                run_id: 1,
                tick,
                sequence: tick,
                deadline_ns: deadline,
                sim_time: time.sim_time,
                time_scale: time.time_scale,
                playback: time.playback as u32,
                epoch: time.epoch,
                ..FrameHeader::default()
            };
            newest = Some(header);
            run.frames.push((moment, header));
            tick += 1;
        }
        if let Some(header) = newest.take() {
            steering.frame_came(&header, header.deadline_ns);
        }
        while let Some(reading) = readings.front().copied().filter(|reading| reading.at_ns <= now) {
            readings.pop_front();
            synchronizer.read(reading);
        }
        if let Some((_, sent_ns, code, tick)) = answers.front().copied().filter(|(at, ..)| *at <= now) {
            answers.pop_front();
            steering.answered(sent_ns, Some((code, tick)));
        }
        let motion = synchronizer.motion(now);
        was_locked |= matches!(motion, Motion::Locked { .. });
        let goal = schedule.goal(motion, sender.rate, was_locked);
        if let Some(command) = steering.command(goal, now) {
            commands.push_back((now + random.u64(0..2 * MILLISECOND) + MILLISECOND / 2, command, Some(now)));
        }
        let moment = (now - BEGIN_NS) as f64 * 1e-9;
        run.motions.push((moment, motion));
        run.waits.push((moment, steering.waiting()));
    }
    run
}

fn schedule() -> Schedule {
    Schedule { offset: "01:00:00:00".parse().unwrap(), speed: 1.0 }
}

fn part(from: f64, position: f64, speed: f64) -> Part {
    Part { from, position: 3600.0 + position, speed }
}

fn sender(parts: Vec<Part>) -> Sender {
    Sender { rate: FrameRate::Ebu25, parts, jitter: 0.005, loss: 0.01, stalls: Vec::new(), end: 40.0 }
}

/// Returns the errors of the published time from a moment on, sorted by size, in seconds.
fn errors(run: &Run, sender: &Sender, from: f64, until: f64) -> Vec<f64> {
    let within = run.frames.iter().filter(|(moment, _)| (from..until).contains(moment));
    let error = |(moment, header): &Published| (header.sim_time - (sender.position(*moment) - 3600.0)).abs();
    let mut errors: Vec<_> = within.map(error).collect();
    errors.sort_by(f64::total_cmp);
    errors
}

fn percentile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

#[test]
fn a_show_follows_timecode_with_jitter_skew_loss_and_stalls() {
    let (mut worst, mut worst_rate) = (0.0f64, 0.0f64);
    for seed in 0..60 {
        let skew = if seed % 2 == 0 { 1e-4 } else { -1e-4 };
        let mut sender = sender(vec![part(0.2, 30.0, 1.0 + skew)]);
        sender.stalls = vec![(9.0 + 0.01 * seed as f64, 0.3), (15.0, 0.3), (22.0, 0.28)];
        sender.end = 40.0;
        let run = play(&sender, schedule(), seed % 3 == 0, &[], 40.0, seed);
        let from = 3.2;
        let errors = errors(&run, &sender, from, 40.0);
        worst = worst.max(percentile(&errors, 0.99));
        let late = run.frames.iter().filter(|(moment, _)| *moment >= from);
        let epochs: Vec<_> = late.clone().map(|(_, header)| header.epoch).collect();
        assert!(epochs.iter().all(|epoch| *epoch == epochs[0]), "seed {seed}: a jump of simulated time");
        for (moment, header) in late {
            let off = (header.time_scale - (1.0 + skew)).abs();
            worst_rate = worst_rate.max(off);
            assert!(off <= 0.002, "seed {seed} at {moment}: rate {}", header.time_scale);
        }
        assert!(percentile(&errors, 0.99) <= 0.005, "seed {seed}: p99 {}", percentile(&errors, 0.99));
    }
    println!("worst p99 {:.2} ms, rate {:.3} %", 1e3 * worst, 100.0 * worst_rate);
}

#[test]
fn every_rate_is_followed_and_midnight_is_no_border() {
    for rate in FrameRate::ALL {
        let day = rate.seconds(f64::from(rate.frames_per_day()));
        let offset = rate.label(rate.frames_per_day() - 10 * rate.labels());
        let start = rate.seconds(f64::from(rate.frame(offset).unwrap()));
        let sender = Sender {
            rate,
            parts: vec![Part { from: 0.1, position: start - 2.0, speed: 1.0 }],
            jitter: 0.005,
            loss: 0.01,
            stalls: Vec::new(),
            end: 30.0,
        };
        let run = play(&sender, Schedule { offset, speed: 1.0 }, true, &[], 30.0, 5);
        assert!(start + 28.0 > day, "midnight comes");
        let error = |(moment, header): &Published| (header.sim_time - (moment - 2.1)).abs();
        let errors = run.frames.iter().filter(|(moment, _)| *moment > 5.0).map(error);
        let worst = errors.fold(0.0, f64::max);
        assert!(worst < 0.006, "{rate}: {worst}");
        // Before the offset the show waits at its start.
        assert!(run.frames.iter().filter(|(moment, _)| *moment < 1.9).all(|(_, header)| header.sim_time == 0.0));
    }
}

#[test]
fn a_jump_is_followed_within_five_frames() {
    let mut slowest = 0.0f64;
    for seed in 0..60 {
        let to = [200.0, 20.0, 46.5, 43.2, 31.0][seed as usize % 5];
        let at = 14.0 + 0.003 * seed as f64;
        let mut sender = sender(vec![part(0.2, 30.0, 1.0), part(at, to, 1.0)]);
        sender.loss = 0.0;
        let run = play(&sender, schedule(), false, &[], 20.0, seed);
        let arrived = run.frames.iter().find(|(moment, header)| {
            *moment >= at && (header.sim_time - (sender.position(*moment) - 3600.0)).abs() < 0.02
        });
        let (moment, _) = arrived.unwrap();
        slowest = slowest.max(moment - at);
        let after = errors(&run, &sender, at + 3.0, 20.0);
        assert!(percentile(&after, 0.99) <= 0.005, "seed {seed}: {}", percentile(&after, 0.99));
    }
    println!("slowest {:.1} frames", slowest * 25.0);
    assert!(slowest <= 5.0 * 0.04, "{slowest} s");
}

#[test]
fn timecode_that_stands_ends_or_runs_backward_pauses_the_show() {
    // Standing: at its place.
    let mut standing = sender(vec![part(0.2, 30.0, 1.0), part(8.0, 37.8, 0.0), part(12.0, 37.8, 1.0)]);
    standing.end = 20.0;
    let run = play(&standing, schedule(), false, &[], 20.0, 1);
    let at = |moment: f64| run.frames[(moment * 60.0) as usize].1;
    assert_eq!(at(11.0).playback_state(), Some(PlaybackState::Paused));
    assert!((at(11.0).sim_time - 37.8).abs() < 0.021, "{}", at(11.0).sim_time);
    assert!((at(19.0).sim_time - 44.8).abs() < 0.005, "{}", at(19.0).sim_time);
    // Ending: after the freewheel time, and back again.
    let mut ending = sender(vec![part(0.2, 30.0, 1.0)]);
    ending.end = 8.0;
    let run = play(&ending, schedule(), false, &[], 14.0, 1);
    let at = |moment: f64| run.frames[(moment * 60.0) as usize].1;
    assert_eq!(at(9.7).playback_state(), Some(PlaybackState::Playing), "it freewheels");
    assert_eq!(at(10.5).playback_state(), Some(PlaybackState::Paused));
    assert!((at(10.5).sim_time - 39.8).abs() < 0.1, "{}", at(10.5).sim_time);
    // Backward.
    let backward = sender(vec![part(0.2, 30.0, 1.0), part(8.0, 37.8, -1.0)]);
    let run = play(&backward, schedule(), false, &[], 12.0, 1);
    assert!(run.motions.iter().any(|(moment, motion)| *moment < 8.3 && *motion == Motion::Backward));
    let (_, last) = run.frames[700];
    assert_eq!(last.playback_state(), Some(PlaybackState::Paused));
}

#[test]
fn holds_pauses_and_seeks_of_others_are_obeyed() {
    let sender = sender(vec![part(0.2, 30.0, 1.0)]);
    let waits_at = |run: &Run, moment: f64| run.waits.iter().find(|(at, _)| *at >= moment).unwrap().1;
    let error_at = |run: &Run, moment: f64| {
        let (moment, header) = run.frames[(moment * 60.0) as usize];
        header.sim_time - (sender.position(moment) - 3600.0)
    };
    let hold = [(6.0, Command::Hold), (9.0, Command::Release), (12.0, Command::Resume)];
    let run = play(&sender, schedule(), false, &hold, 20.0, 2);
    assert_eq!([8.0, 11.0, 13.0].map(|at| waits_at(&run, at)), [Some(Waiting::Held), Some(Waiting::Paused), None]);
    assert!((error_at(&run, 11.9) + 5.9).abs() < 0.1 && error_at(&run, 16.0).abs() < 0.005);
    let seek = [(6.0, Command::Seek(100.0)), (10.0, Command::Pause), (12.0, Command::Resume)];
    let run = play(&sender, schedule(), false, &seek, 20.0, 3);
    assert_eq!([9.0, 11.0, 13.0].map(|at| waits_at(&run, at)), [Some(Waiting::Sought), Some(Waiting::Paused), None]);
    assert!(error_at(&run, 9.9) > 60.0 && error_at(&run, 16.0).abs() < 0.005);
    // A rate of another client is corrected.
    let run = play(&sender, schedule(), false, &[(6.0, Command::Rate(3.0))], 12.0, 4);
    assert!(error_at(&run, 11.0).abs() < 0.005 && waits_at(&run, 11.0).is_none());
    // Paused by another client before the chase came: it does not wait at its start.
    let run = play(&sender, schedule(), false, &[(0.05, Command::Pause)], 5.0, 5);
    assert_eq!(waits_at(&run, 4.0), Some(Waiting::Paused));
    assert!(run.frames.last().unwrap().1.sim_time < 1.0);
}
