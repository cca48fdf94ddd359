//! A replacement for the shared memory: queues that drop the oldest frame for a slow subscriber, as iceoryx2's do with
//! safe overflow. The replacement has a history of one alert, maintenance that connects new subscribers, and a memory
//! that can be full.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;

use bench_dragon::messages::FrameHeader;
use bench_dragon::publisher::live::{Outgoing, PublishError, Publisher};

use crate::oracle::Oracle;
use crate::world::{SECOND_NS, World};

/// One subscriber's queue.
pub struct Receiver {
    pub frames: VecDeque<FrameHeader>,
    depth: usize,
    /// The sequence of the first frame that was put here, and the numbers of frames put here and dropped.
    pub first: Option<u64>,
    pub offered: u64,
    pub lost: u64,
    pub is_connected: bool,
    /// True if its process has died: the queue exists until maintenance removes it.
    pub is_dead: bool,
}

impl Receiver {
    pub fn new(depth: usize) -> Self {
        let frames = VecDeque::with_capacity(depth);
        Self { frames, depth, first: None, offered: 0, lost: 0, is_connected: false, is_dead: false }
    }

    fn put(&mut self, header: &FrameHeader) {
        if self.frames.len() == self.depth {
            self.frames.pop_front();
            self.lost += 1;
        }
        self.first.get_or_insert(header.sequence);
        self.frames.push_back(*header);
        self.offered += 1;
    }
}

/// The subscribers.
#[derive(Default)]
pub struct Receivers {
    list: RefCell<Vec<Rc<RefCell<Receiver>>>>,
    /// True if maintenance has work to do.
    has_changed: Cell<bool>,
}

impl Receivers {
    pub fn add(&self, receiver: Receiver) -> Rc<RefCell<Receiver>> {
        let receiver = Rc::new(RefCell::new(receiver));
        self.list.borrow_mut().push(Rc::clone(&receiver));
        self.has_changed.set(true);
        receiver
    }
}

pub struct SharedMemory {
    pub world: Rc<World>,
    pub oracle: Rc<RefCell<Oracle>>,
    pub receivers: Rc<Receivers>,
    /// Frames until the memory is full.
    pub room: u64,
    /// The level of the latest alert, which the service keeps.
    pub level: Option<u32>,
    pub quiet_maintenance: u64,
    /// The time of the last maintenance, and the delay of the loop up to then.
    pub maintained: Option<(u64, u64)>,
}

/// Late subscribers are connected about ten times a second.
const LEAST_OFTEN_NS: u64 = SECOND_NS / 5;

pub const FULL: &str = "the shared memory is full";

impl SharedMemory {
    /// Connects new subscribers, which get the kept alert, and removes the queues of dead ones.
    fn let_in(&mut self) {
        self.receivers.list.borrow_mut().retain(|receiver| {
            let mut receiver = receiver.borrow_mut();
            if !receiver.is_connected {
                receiver.is_connected = true;
                self.oracle.borrow().late_subscriber(self.level);
            }
            !receiver.is_dead
        });
    }
}

impl Publisher for SharedMemory {
    fn publish(&mut self, outgoing: Outgoing<'_>) -> Result<(), PublishError> {
        let Self { world, oracle, room, .. } = self;
        if *room == 0 {
            world.note("the shared memory is full", [0.0; 2]);
            world.tally.borrow_mut().failed_publishers += 1;
            return Err(PublishError(FULL.to_owned()));
        }
        *room -= 1;
        oracle.borrow_mut().frame_goes_out(world, outgoing);
        self.level = outgoing.alerts.last().map(|alert| alert.level).or(self.level);
        world.spend(world.cost_ns());
        let header = FrameHeader { sent_ns: world.now_ns(), ..*outgoing.header };
        for receiver in self.receivers.list.borrow().iter() {
            let mut receiver = receiver.borrow_mut();
            if receiver.is_connected {
                receiver.put(&header);
            }
        }
        oracle.borrow_mut().frame_was_sent(world);
        Ok(())
    }

    fn prepare(&mut self) {
        self.world.is_awake();
    }

    fn maintain(&mut self) {
        let now = (self.world.now_ns(), self.world.delayed_ns.get());
        if let Some((then_ns, delayed_ns)) = self.maintained.replace(now) {
            let allowed_ns = LEAST_OFTEN_NS + now.1 - delayed_ns;
            assert!(now.0 - then_ns <= allowed_ns, "no maintenance for {} ns", now.0 - then_ns);
        }
        if self.receivers.has_changed.take() {
            self.let_in();
        }
        self.quiet_maintenance = self.quiet_maintenance.wrapping_sub(1);
        if self.quiet_maintenance == u64::MAX {
            self.quiet_maintenance = self.world.random.borrow_mut().gap(20_000.0);
            self.world.spend(self.world.delay_ns());
        }
        self.world.is_awake();
    }

    fn subscribers(&self) -> u32 {
        let count =
            self.receivers.list.borrow().iter().filter(|receiver| receiver.borrow().is_connected).count() as u32;
        self.oracle.borrow_mut().frame_is_out(&self.world, count);
        count
    }
}
