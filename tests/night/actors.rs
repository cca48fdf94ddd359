//! The actors beside the loop: the statistics thread, control clients, subscribers, and the actors that set the wall
//! clock or stop the show.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use bench_dragon::client::feed::liveness::{Change, Liveness};
use bench_dragon::client::feed::sequence::SequenceTracker;
use bench_dragon::messages::LoopStatus;
use bench_dragon::messages::control::Command;
use bench_dragon::publisher::live::StatusPublisher;
use bench_dragon::publisher::live::control::{CommandSender, MOST_WAITING};
use bench_dragon::publisher::live::statistics::Collector;

use crate::collected::Collected;
use crate::oracle::Oracle;
use crate::port::{Receiver, Receivers};
use crate::world::{Actor, SECOND_NS, World, same};

/// The due time of an actor that never acts again.
const NEVER: u64 = u64::MAX;

/// The statistics thread.
pub struct Statistics {
    pub collector: Rc<RefCell<Collector<'static>>>,
    pub collected: Rc<RefCell<Collected>>,
    pub every_ns: u64,
}

impl Actor for Statistics {
    fn step(&mut self, world: &World) -> u64 {
        let mut collector = self.collector.borrow_mut();
        collector.take();
        self.collected.borrow().emptied();
        collector.report(world.now_ns(), false, |status| LoopStatus { stamp_ns: world.now_ns(), ..status });
        self.collected.borrow().reported(world.now_ns());
        let mut random = world.random.borrow_mut();
        // Sometimes the thread does not run for long: then samples are lost.
        let late_ns =
            if random.once_in(50) { random.below(200 * self.every_ns) } else { random.below(self.every_ns / 4) };
        world.now_ns() + self.every_ns + late_ns
    }
}

/// Receiver of the thread's statuses; the stamp is the time at which a status was made.
pub struct Statuses(pub Rc<RefCell<Collected>>);

impl StatusPublisher for Statuses {
    fn publish_status(&mut self, status: &LoopStatus) {
        self.0.borrow_mut().status(status, status.stamp_ns);
    }
}

/// A client that sends commands through one queue: one at a time, several in one period, or a flood.
pub struct Controller {
    pub number: usize,
    pub sender: Rc<RefCell<CommandSender>>,
    pub oracle: Rc<RefCell<Oracle>>,
    /// Mean time between two commands.
    pub pause_ns: f64,
    /// The end of the show, simulated seconds.
    pub end: f64,
    /// True if the client never takes an answer again.
    pub is_dead: bool,
}

impl Controller {
    pub fn take_answers(&self) {
        let mut sender = self.sender.borrow_mut();
        while let Some(answer) = sender.answer() {
            self.oracle.borrow_mut().queue_check.taken(self.number, &answer);
        }
    }

    fn command(&self, world: &World) -> Command {
        let mut random = world.random.borrow_mut();
        match random.below(20) {
            0 | 1 => Command::State,
            2 => Command::Pause,
            3..=5 => Command::Resume,
            6 => {
                Command::Rate(random.pick(&[1.0, 1.0, 0.5, 2.0, 0.25, 3.7, 1e-6, 60.0, 1e6, 0.0, -1.0, 2e6, f64::NAN]))
            }
            7 => Command::Rate(random.magnitude(0.01, 100.0)),
            8 | 9 => Command::Seek(random.share() * self.end),
            10 => Command::Seek(random.pick(&[0.0, self.end, self.end.next_up(), -1e-9, f64::NAN, f64::INFINITY])),
            11 | 12 => Command::Step(1 + random.below(4)),
            13 => Command::Step(random.magnitude(1.0, 1e15) as u64),
            14 => Command::Restart,
            15 => Command::Hold,
            16 | 17 => Command::Release,
            _ => Command::Go,
        }
    }
}

impl Actor for Controller {
    fn step(&mut self, world: &World) -> u64 {
        let (takes, count) = {
            let mut random = world.random.borrow_mut();
            self.is_dead |= random.once_in(2000);
            let count = match random.below(40) {
                0 => 100 + random.below(100),
                1..=4 => random.below(6),
                _ => 1,
            };
            (!self.is_dead && !random.once_in(4), count)
        };
        if takes {
            self.take_answers();
        }
        for _ in 0..count {
            let command = self.command(world);
            let result = self.sender.borrow_mut().send(command);
            self.oracle.borrow_mut().queue_check.sent(self.number, command, result);
        }
        if self.is_dead && self.sender.borrow().waiting() >= MOST_WAITING {
            return NEVER;
        }
        world.now_ns() + 1 + (2.0 * self.pause_ns * world.random.borrow_mut().share()) as u64
    }
}

/// A process that subscribes: at its own pace, with stalls, until it dies; then another process starts.
pub struct Subscriber {
    pub receivers: Rc<Receivers>,
    pub receiver: Rc<RefCell<Receiver>>,
    pub tracker: SequenceTracker,
    pub liveness: Liveness,
    /// The start of simulated time.
    pub origin: Instant,
    pub depth: usize,
    pub rate: f64,
    pub every_ns: u64,
    pub first: Option<u64>,
    pub received: u64,
    pub missed: u64,
    pub latest_ns: u64,
    /// The subscriber dies once in this many steps, on average.
    pub lives: u64,
}

impl Subscriber {
    pub fn new(receivers: &Rc<Receivers>, origin: Instant, depth: usize, rate: f64, every_ns: u64, lives: u64) -> Self {
        let receiver = receivers.add(Receiver::new(depth));
        let mut liveness = Liveness::connected_at(origin);
        liveness.rate(rate);
        Self {
            receivers: Rc::clone(receivers),
            receiver,
            tracker: SequenceTracker::default(),
            liveness,
            origin,
            depth,
            rate,
            every_ns,
            first: None,
            received: 0,
            missed: 0,
            latest_ns: 0,
            lives,
        }
    }

    fn instant(&self, world: &World) -> Instant {
        self.origin + Duration::from_nanos(world.now_ns())
    }

    /// Reads all waiting frames, and counts the missed frames exactly.
    pub fn read(&mut self, world: &World) {
        let now = self.instant(world);
        let mut receiver = self.receiver.borrow_mut();
        let before = self.received;
        for header in receiver.frames.drain(..) {
            self.first.get_or_insert(header.sequence);
            self.missed += self.tracker.advance(header.run_id, header.sequence).unwrap_or(0);
            self.received += 1;
        }
        if self.received > before {
            self.liveness.frame_at(now);
            self.latest_ns = world.now_ns();
        }
        same("frames received and lost", self.received + receiver.lost, receiver.offered);
        // Frames lost before the first received one are no gap.
        let not_seen = self.first.zip(receiver.first).map_or(0, |(seen, put)| seen - put);
        same("frames missed", self.missed, receiver.lost - not_seen);
    }

    /// Asserts that the liveness test finds the publisher.
    fn test(&mut self, world: &World) {
        let now = self.instant(world);
        match self.liveness.test(now, || true) {
            Some(Change::Gone) => panic!("a live publisher is reported dead"),
            Some(Change::Silent) => {
                let quiet_s = (world.now_ns() - self.latest_ns) as f64 / 1e9;
                assert!(quiet_s >= f64::max(0.5, 3.0 / self.rate) - 1e-6, "silent after {quiet_s} s");
            }
            None => (),
        }
    }

    /// Asserts that the end of the publisher is noticed.
    pub fn outlive(&mut self, world: &World) {
        self.read(world);
        let later = self.instant(world) + Duration::from_secs(1);
        same("a publisher that has ended", self.liveness.test(later, || false), Some(Change::Gone));
    }
}

impl Actor for Rc<RefCell<Subscriber>> {
    fn step(&mut self, world: &World) -> u64 {
        let mut this = self.borrow_mut();
        if world.random.borrow_mut().once_in(this.lives) {
            let lost = this.receiver.borrow().lost;
            world.note("a subscriber dies", [0.0; 2]);
            let mut tally = world.tally.borrow_mut();
            (tally.deaths, tally.subscribers, tally.frames_lost) =
                (tally.deaths + 1, tally.subscribers + 1, tally.frames_lost + lost);
            this.receiver.borrow_mut().is_dead = true;
            let Subscriber { depth, rate, every_ns, lives, .. } = *this;
            let next = Subscriber::new(&this.receivers, this.origin, depth, rate, every_ns, lives);
            *this = next;
        } else {
            this.read(world);
            this.test(world);
        }
        let mut random = world.random.borrow_mut();
        let stall_ns = if random.once_in(100) { random.below(200 * this.every_ns) } else { 0 };
        world.now_ns() + this.every_ns / 2 + 1 + random.below(this.every_ns) + stall_ns
    }
}

/// An actor that sets the wall clock: by a leap second, or by days.
pub struct WallClock {
    pub every_ns: f64,
}

impl Actor for WallClock {
    fn step(&mut self, world: &World) -> u64 {
        let mut random = world.random.borrow_mut();
        let seconds = random.pick(&[1i64, -1, 3600, -3600, 86_400, -86_400, 7, -7]);
        let wait = 1 + (self.every_ns * 2.0 * random.share()) as u64;
        drop(random);
        world.step_realtime(seconds * SECOND_NS as i64);
        world.now_ns() + wait
    }
}

/// A signal that stops the show.
pub struct Stopper;

impl Actor for Stopper {
    fn step(&mut self, world: &World) -> u64 {
        world.set_stop();
        NEVER
    }
}
