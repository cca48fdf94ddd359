//! Commands during the loop: each is executed in the first free period after its arrival, one in each period. The
//! queues take turns, however late the loop is.

use super::*;
use crate::live::control::{Answer, CommandSender, command_queue};
use bench_dragon_messages::control::Code;
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_motion::event::unreported;
use bench_dragon_show::scene::Scene;
use bench_dragon_show::{Playback, Show};

/// A waiting command: its queue, and the frame during which it arrived.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    queue: usize,
    arrived: u64,
}

/// An executed command.
#[derive(Debug)]
struct Executed {
    queue: usize,
    /// The number of the frame that followed.
    frame: u64,
    tick: u64,
    /// Every command that waited then, this one included.
    waiting: Vec<Waiting>,
}

/// Frames during which commands arrive. Records when each is executed.
struct Arrivals {
    clock: Rc<SimulatedClock>,
    queues: Vec<CommandSender>,
    /// For each frame, the queues at which a command arrives while it is computed.
    arrivals: VecDeque<Vec<usize>>,
    cost_ns: VecDeque<u64>,
    computed: u64,
    waiting: Vec<Waiting>,
    executed: Vec<Executed>,
    frame: Frame,
    messages: FrameMessages,
}

impl FrameSource for Arrivals {
    fn frame(&mut self, tick: u64, stamps: Stamps) -> Period<'_> {
        for queue in self.arrivals.pop_front().unwrap_or_default() {
            // The number is that of the queue: this show plays no steps.
            self.queues[queue].send(Command::Step(queue as u64)).unwrap();
            self.waiting.push(Waiting { queue, arrived: self.computed });
        }
        self.clock.advance(self.cost_ns.pop_front().unwrap_or(0));
        self.computed += 1;
        self.frame.tick = tick;
        Period::Frame(self.messages.of(&self.frame, stamps))
    }

    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome> {
        let Command::Step(queue) = command else { panic!("{command:?} was never sent") };
        let queue = queue as usize;
        let waiting = self.waiting.clone();
        self.waiting.remove(waiting.iter().position(|waiting| waiting.queue == queue).unwrap());
        self.executed.push(Executed { queue, frame: self.computed, tick, waiting });
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
    fn a_command_is_executed_in_the_first_free_period_after_it(
        rate in rates(),
        queues in 1usize..4,
        arrivals in prop::collection::vec(prop::collection::vec(any::<prop::sample::Index>(), 0..3), 1..30),
        costs in prop::collection::vec(prop_oneof![3 => Just(0u64), 1 => 0u64..4_000], 0..30),
    ) {
        let clock = Rc::new(SimulatedClock::new(START_NS, []));
        let arrivals: VecDeque<Vec<usize>> =
            arrivals.iter().map(|at| at.iter().map(|index| index.index(queues)).collect()).collect();
        let sent: usize = arrivals.iter().map(Vec::len).sum();
        let (ports, outer): (Vec<_>, Vec<_>) = (0..queues).map(|_| command_queue()).unzip();
        let mut frames = Arrivals {
            clock: clock.clone(),
            queues: outer,
            arrivals,
            cost_ns: costs.iter().map(|thousandths| thousandths * rate.period_ns() / 1000).collect(),
            computed: 0,
            waiting: Vec::new(),
            executed: Vec::new(),
            frame: Frame::new(1),
            messages: FrameMessages::default(),
        };
        let options = LoopOptions { run_id: 1, rate: rate.hertz(), periods: Some(400) };
        let (samples, _received) = rtrb::RingBuffer::new(1024);
        let (announcements, _announced) = rtrb::RingBuffer::new(1);
        let reports = Reports::new(samples, announcements);
        run_loop(&*clock, &mut frames, &mut CommandQueues::new(ports), &mut [], options, reports, &clock.stop).unwrap();

        prop_assert_eq!((frames.executed.len(), frames.waiting.len()), (sent, 0));
        let mut before: Option<&Executed> = None;
        for executed in &frames.executed {
            // The frame after the arrival of the oldest, unless that period has executed another command.
            let oldest = executed.waiting.iter().map(|waiting| waiting.arrived).min().unwrap();
            let free = before.map_or(0, |before| before.frame + 1);
            prop_assert_eq!(executed.frame, free.max(oldest + 1), "{:?}", executed);
            // No queue has two turns while another queue waits.
            if before.is_some_and(|before| before.queue == executed.queue) {
                prop_assert!(executed.waiting.iter().all(|waiting| waiting.queue == executed.queue), "{:?}", executed);
            }
            before = Some(executed);
        }
        // Each queue has its answers in order, with the ticks at which its commands were executed.
        for (queue, outer) in frames.queues.iter_mut().enumerate() {
            let answers: Vec<Answer> = std::iter::from_fn(|| outer.answer()).collect();
            let tickets: Vec<u64> = answers.iter().map(|answer| answer.ticket).collect();
            prop_assert_eq!(tickets, (1..=answers.len() as u64).collect::<Vec<_>>());
            let ticks: Vec<u64> = answers.iter().map(|answer| answer.outcome.tick).collect();
            let executed = frames.executed.iter().filter(|executed| executed.queue == queue);
            prop_assert_eq!(ticks, executed.map(|executed| executed.tick).collect::<Vec<_>>());
        }
    }
}

/// A step that ends in the period in which the next one begins is answered too.
#[test]
fn steps_on_each_others_heels_are_all_answered() {
    let team = "[team]\nbenches = 12\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n";
    let path = "[path]\nkind = \"spiral\"\npitch = 0.55\nstart_turn = 16\n";
    let text = format!("{team}{path}[motion]\nhead_speed = 1.0\nsolver = \"newton\"\n");
    let scene = Scene::parse(&text, "small.toml", "small").unwrap();
    let playback = Playback { paused: true, ..Playback::of(&scene) };
    let show = Show::new(&scene, scene.ensemble.timeline(&mut unreported), playback).unwrap();
    let mut show = ShowSource::new(show);
    let (port, mut queue) = command_queue();
    let mut queues = CommandQueues::new(vec![port]);
    for periods in [1, 1, 2, 1] {
        queue.send(Command::Step(periods)).unwrap();
    }
    for tick in 0..9 {
        queues.take_one(&mut show, tick);
        show.show.frame(tick);
        queues.finish_step(&mut show, tick);
    }
    let answers: Vec<_> = std::iter::from_fn(|| queue.answer()).map(|answer| answer.outcome).collect();
    // The third has not ended when the fourth comes, and is refused.
    let expected = [(1, Code::Done), (2, Code::Done), (3, Code::Refused), (4, Code::Done)];
    assert_eq!(answers.iter().map(|answer| (answer.tick, answer.code)).collect::<Vec<_>>(), expected);
    assert_eq!(queue.waiting(), 0);
}
