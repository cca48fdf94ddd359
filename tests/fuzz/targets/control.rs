//! Control requests as the bytes that a client writes, through the command queues to the clock of a show.
//!
//! The first byte selects how the show is played. Requests follow (a `ControlRequest`, 24 bytes), each with a byte for
//! the number of periods until the request arrives.

use std::sync::OnceLock;

use bench_dragon::messages::control::{Code, Command};
use bench_dragon::messages::state::PlaybackState;
use bench_dragon::messages::{ControlRequest, ControlResponse};
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::publisher::live::control::{Answer, CommandQueues, command_queue};
use bench_dragon::publisher::live::show_source::ShowSource;
use bench_dragon::ros2::mappings_of;
use bench_dragon::show::convert::control_response;
use bench_dragon::show::scene::{AtEnd, OnContact, Scene};
use bench_dragon::show::{Outcome, Playback, Show};
use fastrand::Rng;

use super::Target;
use super::bytes::{NUMBERS, changed, one};

pub const TARGET: Target = Target { name: "control", run, seeds, mutate, cases: 20_000 };

/// Bytes of a request, and of a request with its periods.
const REQUEST: usize = size_of::<ControlRequest>();
const STEP: usize = REQUEST + 1;
/// Most requests of a case.
const MOST_REQUESTS: usize = 200;

/// Returns the scene, with or without a cue at which it pauses.
fn scene(pauses: bool) -> &'static (Scene, Timeline) {
    static SCENES: [OnceLock<(Scene, Timeline)>; 2] = [OnceLock::new(), OnceLock::new()];
    SCENES[usize::from(pauses)].get_or_init(|| {
        let text = "[team]\nbenches = 4\nhead_length = 3.41\nbody_length = 2.20\nwidth = 0.30\nhole_inset = 0.275\n\
                    [path]\nkind = \"pieces\"\n[[path.pieces]]\nkind = \"line\"\nlength = 20.0\n\
                    [motion]\nhead_speed = 1.0\nsolver = \"newton\"\n\
                    [[cues]]\nname = \"mark\"\nat = 4.0\n[[cues]]\nname = \"wait\"\nat = 9.0\nthen = \"pause\"\n\
                    [[cues]]\nname = \"end\"\nat = 20.0\n";
        let text = if pauses { text.to_owned() } else { text.replace("then = \"pause\"\n", "") };
        let scene = Scene::parse(&text, "control.toml", "control").expect("a scene");
        let timeline = scene.ensemble.timeline_without_contact(&mut unreported);
        (scene, timeline)
    })
}

fn run(data: &[u8]) -> bool {
    let Some((options, requests)) = data.split_first() else { return false };
    let bit = |bit: u8| options >> bit & 1 == 1;
    let (scene, timeline) = scene(!bit(6));
    let playback = Playback {
        rate: if bit(0) { 50.0 } else { 0.1 },
        time_scale: if bit(1) { 1.0 } else { 1e6 },
        on_contact: OnContact::Stop,
        at_end: if bit(2) { AtEnd::Loop } else { AtEnd::Hold },
        end_hold: if bit(3) { 0.0 } else { 2.0 },
        paused: bit(4),
        start: if bit(5) { 3.0 } else { 0.0 },
    };
    let show = Show::new(scene, timeline.clone(), playback).expect("a start before the end");
    let mut show = ShowSource::new(show);
    let (port, mut sender) = command_queue();
    let mut queues = CommandQueues::new(vec![port]);
    let (mut tick, mut epoch, mut held_at) = (0u64, 0u32, None);
    // Unanswered commands, by their tickets.
    let mut sent: Vec<(u64, u64, Command, Option<Code>)> = Vec::new();
    for step in requests.chunks_exact(STEP).take(MOST_REQUESTS) {
        let request = request(&step[..REQUEST]);
        check_mappings(&step[..REQUEST]);
        // As the command queue over shared memory passes it on: the answer to an unknown command is the state of the
        // show.
        let (command, instead) = match Command::of_number(request.command, request.value) {
            Ok(command) => (command, None),
            Err(code) => (Command::State, Some(code)),
        };
        if let Ok(ticket) = sender.send(command) {
            sent.push((ticket, request.id, command, instead));
        }
        let periods = u64::from(step[REQUEST]);
        let before = tick;
        tick = tick.saturating_add(if periods < 200 { periods + 1 } else { 1 << (periods - 200).min(40) });
        queues.take_one(&mut show, tick);
        let frame = show.show.frame(tick);
        assert!((0.0..=20.0).contains(&frame.sim_time), "{} s at tick {tick}", frame.sim_time);
        assert!(frame.chain.x.iter().chain(&frame.chain.y).all(|number| number.is_finite()));
        // After more periods the epoch may have wrapped around.
        let is_short = tick - before < 1 << 30;
        assert!(!is_short || frame.epoch.wrapping_sub(epoch) < u32::MAX / 2, "the epoch goes back");
        assert!(frame.time_scale == 0.0 || (1e-6..=1e6).contains(&frame.time_scale), "{} x", frame.time_scale);
        let is_moving = frame.playback == PlaybackState::Playing;
        assert!(is_moving || frame.chain.vx.iter().all(|speed| *speed == 0.0), "{:?} moves", frame.playback);
        epoch = frame.epoch;
        if frame.playback == PlaybackState::Held {
            // A held show does not move.
            assert_eq!(*held_at.get_or_insert(frame.sim_time), frame.sim_time, "tick {tick}: {command:?}");
            assert_eq!(frame.time_scale, 0.0);
        } else {
            assert!(held_at.take().is_none() || command == Command::Release, "{command:?} ends a hold");
        }
        queues.finish_step(&mut show, tick);
        while let Some(Answer { ticket, outcome }) = sender.answer() {
            let of_ticket =
                sent.iter().position(|(sent, ..)| *sent == ticket).expect("one answer to a command that was sent");
            let (_, id, command, instead) = sent.remove(of_ticket);
            let code = instead.unwrap_or(outcome.code);
            let response: ControlResponse = control_response(id, &Outcome { code, ..outcome });
            assert_eq!((response.id, response.result()), (id, Some(code)));
            assert!(response.playback_state().is_some() && (0.0..=20.0).contains(&response.sim_time), "{response:?}");
            assert!(outcome.tick <= tick && (1e-6..=1e6).contains(&outcome.playing_rate), "{outcome:?}");
            if let (Command::Seek(time), Code::Done) = (command, outcome.code) {
                assert_eq!(outcome.sim_time, time, "a seek");
            }
        }
        // A step is answered once it is complete.
        let is_step = |(.., command, _): &(u64, u64, Command, Option<Code>)| matches!(command, Command::Step(_));
        assert!(sent.len() <= 1 && sent.iter().all(is_step), "no answer to {sent:?}");
    }
    true
}

/// Checks the same bytes as a request over ROS 2: no service that conducts the show reads bytes in both mappings.
fn check_mappings(bytes: &[u8]) {
    for length in 0..=bytes.len() {
        for (service, mappings) in mappings_of(&bytes[..length]) {
            let is_both = mappings == [true; 2];
            assert!(!is_both || service.contains("parameter"), "{service}: {length} bytes are of both mappings");
        }
    }
}

fn request(bytes: &[u8]) -> ControlRequest {
    let word = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"));
    let command = word(16);
    ControlRequest {
        id: word(0),
        value: f64::from_bits(word(8)),
        command: command as u32,
        reserved: (command >> 32) as u32,
    }
}

fn step(id: u64, (command, value): (u32, f64), periods: u8) -> Vec<u8> {
    let numbers = [id, value.to_bits(), u64::from(command)];
    numbers.iter().flat_map(|number| number.to_le_bytes()).chain([periods]).collect()
}

fn seeds() -> Vec<Vec<u8>> {
    let commands = [
        Command::State,
        Command::Pause,
        Command::Step(3),
        Command::Step(1),
        Command::Rate(2.0),
        Command::Resume,
        Command::Seek(8.5),
        Command::Go,
        Command::Hold,
        Command::Seek(1.0),
        Command::Release,
        Command::Restart,
        Command::Go,
    ];
    let steps = |periods: u8| {
        let steps = commands.iter().zip(1..).map(|(command, id)| step(id, command.number_and_value(), periods));
        steps.flatten().collect::<Vec<u8>>()
    };
    [0b111, 0b10001, 0b100100, 0, 0b100_0101]
        .iter()
        .flat_map(|options| [0, 7].map(|p| [&[*options][..], &steps(p)].concat()))
        .collect()
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    if random.u8(..6) == 0 {
        return changed(data, random);
    }
    let (options, rest) = data.split_first().unwrap_or((&0, &[]));
    let mut steps: Vec<Vec<u8>> = rest.chunks(STEP).map(<[u8]>::to_vec).collect();
    let options = if random.u8(..8) == 0 { random.u8(..) } else { *options };
    for _ in 0..1 + random.usize(..4) {
        let value = match random.u8(..4) {
            0 => one(&NUMBERS, random).parse().unwrap_or(0.0),
            1 => f64::from(random.u8(..10)),
            2 => 20.0 * random.f64(),
            _ => 10f64.powf(14.0 * random.f64() - 7.0),
        };
        let periods = if random.bool() { random.u8(..4) } else { random.u8(..) };
        let made = step(random.u64(..), (random.u32(..11), value), periods);
        let at = random.usize(..=steps.len());
        match random.u8(..4) {
            0 if at < steps.len() => drop(steps.remove(at)),
            1 if at < steps.len() => steps[at] = made,
            _ => steps.insert(at, made),
        }
    }
    [&[options][..], &steps.concat()].concat()
}
