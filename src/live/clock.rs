//! The clocks, and the deadlines of the periods. Called by the loop and by the transports' time stamps.

use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

/// CLOCK_MONOTONIC in nanoseconds: all pacing and all latencies.
pub fn monotonic_ns() -> u64 {
    now(ClockId::CLOCK_MONOTONIC)
}

/// CLOCK_REALTIME in nanoseconds: for people and ROS only, since it can be stepped.
pub fn realtime_ns() -> u64 {
    now(ClockId::CLOCK_REALTIME)
}

fn now(clock: ClockId) -> u64 {
    // Linux has both clocks, and neither call has another way to fail.
    clock_gettime(clock).map_or(0, |time| time.tv_sec() as u64 * 1_000_000_000 + time.tv_nsec() as u64)
}

/// Sleeps until a moment of CLOCK_MONOTONIC, or until a signal comes.
pub fn sleep_until(deadline_ns: u64) {
    let time =
        nix::sys::time::TimeSpec::new((deadline_ns / 1_000_000_000) as i64, (deadline_ns % 1_000_000_000) as i64);
    // An interruption by a signal is no fault: the caller looks at the clock and at its stop flag again.
    let _ = clock_nanosleep(ClockId::CLOCK_MONOTONIC, ClockNanosleepFlags::TIMER_ABSTIME, &time);
}

/// The moments at which periods begin: start + tick / rate, each from the integer tick, so that nothing drifts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deadlines {
    start_ns: u64,
    period_ns: f64,
}

impl Deadlines {
    /// Periods of 1 / `rate` seconds, the first of which begins now.
    pub fn starting_now(rate: f64) -> Self {
        Self { start_ns: monotonic_ns(), period_ns: 1e9 / rate }
    }

    /// When a period begins, CLOCK_MONOTONIC in nanoseconds.
    pub fn of(&self, tick: u64) -> u64 {
        self.start_ns + (tick as f64 * self.period_ns) as u64
    }

    /// The period that a moment lies in.
    pub fn latest_at(&self, now_ns: u64) -> u64 {
        let estimate = (now_ns.saturating_sub(self.start_ns) as f64 / self.period_ns) as u64;
        // The division rounds; the deadlines themselves decide.
        let later = estimate + u64::from(self.of(estimate + 1) <= now_ns);
        later - u64::from(later > 0 && self.of(later) > now_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_moment_lies_in_the_period_that_holds_it(rate in 0.1f64..20_000.0, tick in 0u64..1_000_000_000, part in 0.0f64..0.99) {
            let deadlines = Deadlines { start_ns: 5_000_000_000, period_ns: 1e9 / rate };
            let now = deadlines.of(tick) + (part * deadlines.period_ns) as u64;
            let period = deadlines.latest_at(now);
            prop_assert!(deadlines.of(period) <= now && now < deadlines.of(period + 1));
        }
    }

    #[test]
    fn a_billion_ticks_later_the_phase_is_kept() {
        let deadlines = Deadlines { start_ns: 0, period_ns: 1e9 / 1000.0 };
        assert_eq!(deadlines.of(1_000_000_000), 1_000_000_000_000_000);
    }
}
