//! The clocks, and the deadlines of the periods.
//!
//! The loop and its statistics have a [`Clock`] as a parameter, so that a test can replace it. Transports and
//! subscribers only stamp and measure, so they call the functions.

use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

/// The time of the loop: two clocks and a sleep.
pub trait Clock {
    /// Returns CLOCK_MONOTONIC in nanoseconds: for all pacing and all latencies.
    fn monotonic_ns(&self) -> u64;

    /// Returns CLOCK_REALTIME in nanoseconds: for people and ROS only, since it can be stepped.
    fn realtime_ns(&self) -> u64;

    /// Sleeps until a moment of CLOCK_MONOTONIC; may return early (a signal) or late.
    fn sleep_until(&self, deadline_ns: u64);
}

/// The clocks of the operating system.
#[derive(Debug, Clone, Copy, Default)]
pub struct SystemClock;

impl Clock for SystemClock {
    #[inline]
    fn monotonic_ns(&self) -> u64 {
        monotonic_ns()
    }

    #[inline]
    fn realtime_ns(&self) -> u64 {
        realtime_ns()
    }

    #[inline]
    fn sleep_until(&self, deadline_ns: u64) {
        sleep_until(deadline_ns);
    }
}

/// Returns CLOCK_MONOTONIC in nanoseconds: for all pacing and all latencies.
pub fn monotonic_ns() -> u64 {
    now(ClockId::CLOCK_MONOTONIC)
}

/// Returns CLOCK_REALTIME in nanoseconds: for people and ROS only, since it can be stepped.
pub fn realtime_ns() -> u64 {
    now(ClockId::CLOCK_REALTIME)
}

/// Returns the name of this process's CLOCK_MONOTONIC: the start of the machine and the time namespace. Moments of
/// clocks with different names cannot be compared.
pub fn monotonic_clock_name() -> String {
    // Both parts are the same in every container of a machine, unless the container has its own time namespace. In a
    // sandbox that has neither file, processes cannot be told apart.
    let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    let namespace = std::fs::read_link("/proc/self/ns/time").unwrap_or_default();
    format!("{} {}", boot.trim(), namespace.display())
}

fn now(clock: ClockId) -> u64 {
    // Linux has both clocks, and the call cannot fail otherwise.
    clock_gettime(clock).map_or(0, |time| time.tv_sec() as u64 * 1_000_000_000 + time.tv_nsec() as u64)
}

/// Sleeps until a moment of CLOCK_MONOTONIC, or until a signal comes.
pub fn sleep_until(deadline_ns: u64) {
    let time =
        nix::sys::time::TimeSpec::new((deadline_ns / 1_000_000_000) as i64, (deadline_ns % 1_000_000_000) as i64);
    // An interruption by a signal is no error: the caller reads the clock and its stop flag again.
    let _ = clock_nanosleep(ClockId::CLOCK_MONOTONIC, ClockNanosleepFlags::TIMER_ABSTIME, &time);
}

/// The deadlines of the periods: start + tick / rate, each from the integer tick, so that nothing drifts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deadlines {
    start_ns: u64,
    period_ns: f64,
}

impl Deadlines {
    /// Creates periods of 1 / `rate` seconds, the first of which begins at `start_ns`.
    pub fn starting_at(start_ns: u64, rate: f64) -> Self {
        Self { start_ns, period_ns: 1e9 / rate }
    }

    /// Returns the beginning of a period, CLOCK_MONOTONIC in nanoseconds.
    pub fn of(&self, tick: u64) -> u64 {
        self.start_ns + (tick as f64 * self.period_ns) as u64
    }

    /// Returns the period that contains a moment.
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

    /// start + tick / rate, rounded down, in integers.
    fn exact_deadline(start_ns: u64, tick: u64, rate: u64) -> u64 {
        start_ns + (u128::from(tick) * 1_000_000_000 / u128::from(rate)) as u64
    }

    proptest! {
        #[test]
        fn a_moment_lies_in_the_period_that_holds_it(
            rate in 0.1f64..20_000.0,
            tick in 0u64..1_000_000_000,
            part in 0.0f64..0.99,
        ) {
            let deadlines = Deadlines::starting_at(5_000_000_000, rate);
            let now = deadlines.of(tick) + (part * deadlines.period_ns) as u64;
            let period = deadlines.latest_at(now);
            prop_assert!(deadlines.of(period) <= now && now < deadlines.of(period + 1));
        }

        #[test]
        fn deadlines_do_not_drift_in_a_billion_ticks(rate in 1u64..=20_000, tick in 0u64..=1_000_000_000) {
            let deadlines = Deadlines::starting_at(7, rate as f64);
            for tick in [tick, 1_000_000_000] {
                let exact = exact_deadline(7, tick, rate);
                // Two roundings of a double: at 1 Hz after 32 years 222 ns, at 1 kHz after 12 days less than one.
                let tolerance = 2 + (exact as f64 * f64::EPSILON) as u64;
                prop_assert!(deadlines.of(tick).abs_diff(exact) <= tolerance, "{} {exact}", deadlines.of(tick));
            }
        }
    }

    #[test]
    fn before_the_start_the_period_is_the_first() {
        assert_eq!(Deadlines::starting_at(1_000, 60.0).latest_at(0), 0);
    }

    #[test]
    fn the_system_clock_sleeps_until_the_deadline() {
        let clock = SystemClock;
        let deadline = clock.monotonic_ns() + 2_000_000;
        clock.sleep_until(deadline);
        assert!(clock.monotonic_ns() >= deadline);
        // A deadline that has passed does not block.
        clock.sleep_until(0);
        assert!(clock.realtime_ns() > 1_700_000_000_000_000_000, "nanoseconds since 1970");
    }
}
