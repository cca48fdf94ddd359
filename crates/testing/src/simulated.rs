//! A clock for tests: a sleep advances it at once, and a script sets how late or how early each sleep ends.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

use bench_dragon_client::clock::Clock;

/// CLOCK_REALTIME minus CLOCK_MONOTONIC of a simulated clock.
pub const REALTIME_OFFSET_NS: u64 = 1_700_000_000_000_000_000;

/// The number of sleeps after which a test fails.
const MOST_SLEEPS: u64 = 10_000_000;

/// The end of a sleep.
#[derive(Debug, Clone, Copy)]
pub enum Wake {
    /// This number of nanoseconds after its deadline.
    Late(u64),
    /// Before its deadline, as by a signal, after this number of thousandths of the time until then.
    Early(u64),
}

/// A time in nanoseconds that only sleeping and [`SimulatedClock::advance`] move.
#[derive(Debug)]
pub struct SimulatedClock {
    now_ns: Cell<u64>,
    /// The ends of the next sleeps; later sleeps end on time.
    wakes: RefCell<VecDeque<Wake>>,
    sleeps: Cell<u64>,
    stop_at_ns: u64,
    /// Set when the clock reaches the moment given to [`SimulatedClock::stopping_at`].
    pub stop: AtomicBool,
}

impl SimulatedClock {
    /// Creates a clock at `now_ns`, whose sleeps end as `wakes` lists.
    pub fn new(now_ns: u64, wakes: impl IntoIterator<Item = Wake>) -> Self {
        Self {
            now_ns: Cell::new(now_ns),
            wakes: RefCell::new(wakes.into_iter().collect()),
            sleeps: Cell::new(0),
            stop_at_ns: u64::MAX,
            stop: AtomicBool::new(false),
        }
    }

    /// Returns the same clock, which sets its stop flag at a moment.
    pub fn stopping_at(self, stop_at_ns: u64) -> Self {
        Self { stop_at_ns, ..self }
    }

    /// Advances the time, as work does.
    pub fn advance(&self, ns: u64) {
        self.now_ns.set(self.now_ns.get() + ns);
        if self.now_ns.get() >= self.stop_at_ns {
            self.stop.store(true, Ordering::Release);
        }
    }
}

impl Clock for SimulatedClock {
    fn monotonic_ns(&self) -> u64 {
        self.now_ns.get()
    }

    fn realtime_ns(&self) -> u64 {
        self.now_ns.get() + REALTIME_OFFSET_NS
    }

    fn sleep_until(&self, deadline_ns: u64) {
        self.sleeps.set(self.sleeps.get() + 1);
        assert!(self.sleeps.get() < MOST_SLEEPS, "the loop under test does not end");
        let left = deadline_ns.saturating_sub(self.now_ns.get());
        match self.wakes.borrow_mut().pop_front().unwrap_or(Wake::Late(0)) {
            Wake::Late(ns) => self.advance(left + ns),
            Wake::Early(thousandths) => self.advance((u128::from(left) * u128::from(thousandths) / 1000) as u64),
        }
    }
}
