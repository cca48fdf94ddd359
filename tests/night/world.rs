//! Simulated time and the scheduler. The loop runs until it sleeps or spends time. Then all due actors run, in order of
//! time, each with the delay that the seed gives.
//!
//! [`World`] is the loop's [`Clock`]. Each program beside the loop is an [`Actor`]: one step of a thread or of a
//! process.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::fmt::Debug;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};

use bench_dragon::client::clock::Clock;

use crate::plan::Plan;
use crate::random::Random;
use crate::tally::Tally;

pub const SECOND_NS: u64 = 1_000_000_000;
const MILLISECOND_NS: u64 = 1_000_000;
/// Events that are shown if a night fails.
const TRACED: usize = 60;
/// Mean number of clock reads between two preemptions of the loop's thread.
const READS_PER_PREEMPTION: f64 = 300.0;
/// The longest delay of the loop, in periods: the model of the show counts them one by one.
const LONGEST_STALL_PERIODS: u64 = 1_000_000;

/// A thread or process beside the loop.
pub trait Actor {
    /// Does one step at the present time and returns the time of the next.
    fn step(&mut self, world: &World) -> u64;
}

/// The last events of a night.
#[derive(Default)]
pub struct Trace(RefCell<VecDeque<(u64, &'static str, [f64; 2])>>);

impl Trace {
    pub fn note(&self, now_ns: u64, what: &'static str, of: [f64; 2]) {
        let mut events = self.0.borrow_mut();
        if events.len() == TRACED {
            events.pop_front();
        }
        events.push_back((now_ns, what, of));
    }

    pub fn print(&self) {
        for (now_ns, what, [first, second]) in &*self.0.borrow() {
            eprintln!("  {:.9} s  {what} {first} {second}", *now_ns as f64 / 1e9);
        }
    }
}

pub struct World {
    now_ns: Cell<u64>,
    /// CLOCK_REALTIME less CLOCK_MONOTONIC.
    offset_ns: Cell<u64>,
    pub random: RefCell<Random>,
    pub tally: RefCell<Tally>,
    actors: RefCell<Vec<Box<dyn Actor>>>,
    due_ns: RefCell<Vec<u64>>,
    next_due_ns: Cell<u64>,
    period_ns: u64,
    faults_every: f64,
    /// Operations without a fault before the next fault: reads of the clocks, sleeps.
    reads_left: Cell<u64>,
    sleeps_left: Cell<u64>,
    /// Total delay of the loop, nanoseconds.
    pub delayed_ns: Cell<u64>,
    /// The time at which the loop was last known to be awake: no later than its present work.
    pub awake_ns: Cell<u64>,
    pub stop: AtomicBool,
    /// The time at which the stop flag was set, and the delay of the loop up to then.
    pub stopped: Cell<Option<(u64, u64)>>,
    /// The first value of CLOCK_MONOTONIC, and the last of CLOCK_REALTIME.
    pub first_read_ns: Cell<Option<u64>>,
    pub stamp_ns: Cell<u64>,
    pub trace: Rc<Trace>,
}

impl World {
    pub fn new(plan: &Plan, mut random: Random, trace: Rc<Trace>) -> Self {
        Self {
            now_ns: Cell::new(plan.begin_ns),
            offset_ns: Cell::new(1_700_000_000 * SECOND_NS),
            reads_left: Cell::new(random.gap(READS_PER_PREEMPTION)),
            sleeps_left: Cell::new(0),
            random: RefCell::new(random),
            tally: RefCell::default(),
            actors: RefCell::default(),
            due_ns: RefCell::default(),
            next_due_ns: Cell::new(u64::MAX),
            period_ns: (1e9 / plan.rate) as u64,
            faults_every: plan.faults_every,
            delayed_ns: Cell::new(0),
            awake_ns: Cell::new(plan.begin_ns),
            stop: AtomicBool::new(false),
            stopped: Cell::new(None),
            first_read_ns: Cell::new(None),
            stamp_ns: Cell::new(0),
            trace,
        }
    }

    pub fn now_ns(&self) -> u64 {
        self.now_ns.get()
    }

    pub fn realtime(&self) -> u64 {
        self.now_ns().wrapping_add(self.offset_ns.get())
    }

    /// Sets CLOCK_REALTIME to another time.
    pub fn step_realtime(&self, by_ns: i64) {
        self.offset_ns.set(self.offset_ns.get().wrapping_add_signed(by_ns));
        self.note("the wall clock is set by, s", [by_ns as f64 / 1e9, 0.0]);
        self.tally.borrow_mut().clock_steps += 1;
    }

    pub fn note(&self, what: &'static str, of: [f64; 2]) {
        self.trace.note(self.now_ns(), what, of);
    }

    /// Sets the stop flag, as by a signal.
    pub fn set_stop(&self) {
        self.note("stop", [0.0; 2]);
        self.stop.store(true, Ordering::Release);
        self.stopped.set(Some((self.now_ns(), self.delayed_ns.get())));
    }

    /// Adds an actor, due first at `due_ns`.
    pub fn add(&self, actor: Box<dyn Actor>, due_ns: u64) {
        self.actors.borrow_mut().push(actor);
        self.due_ns.borrow_mut().push(due_ns);
        self.next_due_ns.set(self.next_due_ns.get().min(due_ns));
    }

    /// Advances the loop's time; the actors run meanwhile.
    fn advance_to(&self, until_ns: u64) {
        while self.next_due_ns.get() <= until_ns {
            let (index, due_ns) = {
                let due = self.due_ns.borrow();
                let earliest = due.iter().enumerate().min_by_key(|(_, due)| **due).expect("an actor is due");
                (earliest.0, *earliest.1)
            };
            self.now_ns.set(self.now_ns().max(due_ns));
            let next = self.actors.borrow_mut()[index].step(self);
            assert!(next > due_ns, "an actor that does not let time pass");
            let mut due = self.due_ns.borrow_mut();
            due[index] = next;
            self.next_due_ns.set(due.iter().copied().min().unwrap_or(u64::MAX));
        }
        self.now_ns.set(self.now_ns().max(until_ns));
    }

    /// Delays the loop's thread.
    pub fn spend(&self, ns: u64) {
        if ns > 0 {
            self.advance_to(self.now_ns() + ns);
            // Counted at its end: a stop within the delay comes before the count.
            self.delayed_ns.set(self.delayed_ns.get() + ns);
        }
    }

    /// Records that the loop is awake.
    pub fn is_awake(&self) {
        self.awake_ns.set(self.now_ns());
    }

    /// Returns a random duration: mostly a small part of a period, sometimes whole periods or seconds.
    pub fn delay_ns(&self) -> u64 {
        let mut random = self.random.borrow_mut();
        let ns = match random.below(16) {
            0..=7 => random.below(self.period_ns / 8 + 2),
            8..=10 => random.below(4 * self.period_ns),
            11 => self.period_ns * random.below(5),
            12 => random.below(30 * self.period_ns),
            13 => random.below(200 * MILLISECOND_NS),
            14 => random.below(10 * SECOND_NS),
            _ => random.magnitude(1e9, 4e12) as u64,
        };
        ns.min(self.period_ns.saturating_mul(LONGEST_STALL_PERIODS))
    }

    /// As [`delay_ns`](Self::delay_ns), but rarely more than a part of a period. Used for each frame.
    pub fn cost_ns(&self) -> u64 {
        let usual = {
            let mut random = self.random.borrow_mut();
            if random.once_in(self.faults_every as u64 + 1) {
                None
            } else {
                Some(random.below(self.period_ns / 16 + 2))
            }
        };
        usual.unwrap_or_else(|| {
            let ns = self.delay_ns();
            self.fault("the loop is delayed, s", ns);
            ns
        })
    }

    fn fault(&self, what: &'static str, ns: u64) {
        let mut tally = self.tally.borrow_mut();
        tally.delays += 1;
        tally.stalls += u64::from(ns >= SECOND_NS);
        tally.stalled_ns += u128::from(if ns >= SECOND_NS { ns } else { 0 });
        drop(tally);
        self.note(what, [ns as f64 / 1e9, 0.0]);
    }

    /// Sometimes preempts the thread just before a clock is read, or just after.
    fn preempted(&self) -> bool {
        let left = self.reads_left.get();
        self.reads_left.set(left.wrapping_sub(1));
        if left > 0 {
            return false;
        }
        self.reads_left.set(self.random.borrow_mut().gap(READS_PER_PREEMPTION + 100.0 * self.faults_every));
        true
    }

    fn read(&self, clock: impl Fn() -> u64) -> u64 {
        if !self.preempted() {
            return clock();
        }
        let (ns, before) = (self.delay_ns(), self.random.borrow_mut().once_in(2));
        self.fault("preempted at a clock, s", ns);
        if before {
            self.spend(ns);
            return clock();
        }
        let value = clock();
        self.spend(ns);
        value
    }
}

impl Clock for World {
    fn monotonic_ns(&self) -> u64 {
        let value = self.read(|| self.now_ns());
        if self.first_read_ns.get().is_none() {
            self.first_read_ns.set(Some(value));
        }
        value
    }

    fn realtime_ns(&self) -> u64 {
        let value = self.read(|| self.realtime());
        self.stamp_ns.set(value);
        value
    }

    fn sleep_until(&self, deadline_ns: u64) {
        let left = self.sleeps_left.get();
        self.sleeps_left.set(left.wrapping_sub(1));
        if left > 0 {
            self.advance_to(deadline_ns);
        } else {
            let gap = self.random.borrow_mut().gap(self.faults_every);
            self.sleeps_left.set(gap);
            let early = self.random.borrow_mut().once_in(4);
            if early {
                // A signal.
                let slept = deadline_ns.saturating_sub(self.now_ns());
                let slept = self.random.borrow_mut().below(slept + 1);
                self.advance_to(self.now_ns() + slept);
            } else {
                self.advance_to(deadline_ns);
                let ns = self.delay_ns();
                self.fault("woken late, s", ns);
                self.spend(ns);
            }
        }
        self.is_awake();
    }
}

/// Asserts that two values are equal, with a sentence for the trace.
pub fn same<T: PartialEq + Debug>(what: &str, seen: T, expected: T) {
    assert!(seen == expected, "{what}: {seen:?}, expected {expected:?}");
}
