//! Commands that arrive while the loop runs: each is obeyed in the first period that begins after it and is free, one a
//! period, in turn of the doors, however late the loop is.

use super::*;
use crate::live::control::{Answer, CommandSender, command_queue};
use bench_dragon_messages::control::Code;
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_show::scene::Scene;
use bench_dragon_show::{Playback, Show};

/// A command that waits: its door, and the frame during which it arrived.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    door: usize,
    arrived: u64,
}

/// A command that was obeyed.
#[derive(Debug)]
struct Obeyed {
    door: usize,
    /// The number of the frame that followed.
    frame: u64,
    tick: u64,
    /// Every command that waited then, this one included.
    waiting: Vec<Waiting>,
}

/// Frames during which commands arrive, and which note when each is obeyed.
struct Arrivals {
    clock: Rc<SimulatedClock>,
    doors: Vec<CommandSender>,
    /// For each frame, the doors at which a command arrives while it is computed.
    arrivals: VecDeque<Vec<usize>>,
    cost_ns: VecDeque<u64>,
    computed: u64,
    waiting: Vec<Waiting>,
    obeyed: Vec<Obeyed>,
    frame: Frame,
    messages: FrameMessages,
}

impl FrameSource for Arrivals {
    fn frame(&mut self, tick: u64, stamps: Stamps) -> Period<'_> {
        for door in self.arrivals.pop_front().unwrap_or_default() {
            // Its number names the door: this show plays no steps.
            self.doors[door].send(Command::Step(door as u64)).unwrap();
            self.waiting.push(Waiting { door, arrived: self.computed });
        }
        self.clock.advance(self.cost_ns.pop_front().unwrap_or(0));
        self.computed += 1;
        self.frame.tick = tick;
        Period::Frame(self.messages.of(&self.frame, stamps))
    }

    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome> {
        let Command::Step(door) = command else { panic!("{command:?} was never sent") };
        let door = door as usize;
        let waiting = self.waiting.clone();
        self.waiting.remove(waiting.iter().position(|waiting| waiting.door == door).unwrap());
        self.obeyed.push(Obeyed { door, frame: self.computed, tick, waiting });
        let playback = PlaybackState::Playing;
        Some(Outcome { code: Code::Done, tick, sim_time: 0.0, time_scale: 1.0, playing_rate: 1.0, playback, cue: 0 })
    }

    fn finished_step(&mut self, _: u64) -> Option<Outcome> {
        None
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn a_command_is_obeyed_in_the_first_free_period_after_it(
        rate in rates(),
        doors in 1usize..4,
        arrivals in prop::collection::vec(prop::collection::vec(any::<prop::sample::Index>(), 0..3), 1..30),
        costs in prop::collection::vec(prop_oneof![3 => Just(0u64), 1 => 0u64..4_000], 0..30),
    ) {
        let clock = Rc::new(SimulatedClock::new(START_NS, []));
        let arrivals: VecDeque<Vec<usize>> =
            arrivals.iter().map(|at| at.iter().map(|index| index.index(doors)).collect()).collect();
        let sent: usize = arrivals.iter().map(Vec::len).sum();
        let (ports, outer): (Vec<_>, Vec<_>) = (0..doors).map(|_| command_queue()).unzip();
        let mut frames = Arrivals {
            clock: clock.clone(),
            doors: outer,
            arrivals,
            cost_ns: costs.iter().map(|thousandths| thousandths * rate.period_ns() / 1000).collect(),
            computed: 0,
            waiting: Vec::new(),
            obeyed: Vec::new(),
            frame: Frame::new(1),
            messages: FrameMessages::default(),
        };
        let options = LoopOptions { run_id: 1, rate: rate.hertz(), periods: Some(400) };
        let (samples, _received) = rtrb::RingBuffer::new(1024);
        let (announcements, _announced) = rtrb::RingBuffer::new(1);
        let reports = Reports { samples, announcements };
        run_loop(&*clock, &mut frames, &mut CommandQueues::new(ports), &mut [], options, reports, &clock.stop).unwrap();

        prop_assert_eq!((frames.obeyed.len(), frames.waiting.len()), (sent, 0));
        let mut before: Option<&Obeyed> = None;
        for obeyed in &frames.obeyed {
            // The frame after that during which the oldest arrived, unless that one's period has obeyed another.
            let oldest = obeyed.waiting.iter().map(|waiting| waiting.arrived).min().unwrap();
            let free = before.map_or(0, |before| before.frame + 1);
            prop_assert_eq!(obeyed.frame, free.max(oldest + 1), "{:?}", obeyed);
            // No door has a second turn while another waits.
            if before.is_some_and(|before| before.door == obeyed.door) {
                prop_assert!(obeyed.waiting.iter().all(|waiting| waiting.door == obeyed.door), "{:?}", obeyed);
            }
            before = Some(obeyed);
        }
        // Each door has its answers in order, with the ticks at which its commands were obeyed.
        for (door, outer) in frames.doors.iter_mut().enumerate() {
            let answers: Vec<Answer> = std::iter::from_fn(|| outer.answer()).collect();
            let tickets: Vec<u64> = answers.iter().map(|answer| answer.ticket).collect();
            prop_assert_eq!(tickets, (1..=answers.len() as u64).collect::<Vec<_>>());
            let ticks: Vec<u64> = answers.iter().map(|answer| answer.outcome.tick).collect();
            let obeyed = frames.obeyed.iter().filter(|obeyed| obeyed.door == door);
            prop_assert_eq!(ticks, obeyed.map(|obeyed| obeyed.tick).collect::<Vec<_>>());
        }
    }
}

/// A step that is over in the period in which the next one begins has its answer too, and its door its place again.
#[test]
fn steps_on_each_others_heels_are_all_answered() {
    let team = "[team]\nbenches = 12\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n";
    let path = "[path]\nkind = \"spiral\"\npitch = 0.55\nstart_turn = 16\n";
    let text = format!("{team}{path}[motion]\nhead_speed = 1.0\nsolver = \"newton\"\n");
    let scene = Scene::parse(&text, "small.toml", "small").unwrap();
    let playback = Playback { paused: true, ..Playback::of(&scene) };
    let show = Show::new(&scene, scene.motion.timeline(&mut |_| ()), playback).unwrap();
    let mut show = ShowSource::new(show);
    let (port, mut door) = command_queue();
    let mut doors = CommandQueues::new(vec![port]);
    for periods in [1, 1, 2, 1] {
        door.send(Command::Step(periods)).unwrap();
    }
    for tick in 0..9 {
        doors.take_one(&mut show, tick);
        show.show.frame(tick);
        doors.finish_step(&mut show, tick);
    }
    let answers: Vec<_> = std::iter::from_fn(|| door.answer()).map(|answer| answer.outcome).collect();
    // The third is not over when the fourth comes, which is refused.
    let expected = [(1, Code::Done), (2, Code::Done), (3, Code::Refused), (4, Code::Done)];
    assert_eq!(answers.iter().map(|answer| (answer.tick, answer.code)).collect::<Vec<_>>(), expected);
    assert_eq!(door.waiting(), 0);
}
