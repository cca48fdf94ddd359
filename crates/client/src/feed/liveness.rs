//! The liveness of a publisher that sends no frames: silent or gone. The caller passes the time and the test, so that
//! nothing here waits.

use std::time::{Duration, Instant};

/// The time without frames before the first test of the publisher, and the interval of the tests.
const LIVENESS_INTERVAL: Duration = Duration::from_millis(200);
/// The least time without frames after which a live publisher is reported as silent.
const SILENCE: Duration = Duration::from_millis(500);
/// The same in periods of the publisher, if they are longer.
const SILENT_PERIODS: f64 = 3.0;

/// A connected publisher's liveness.
#[derive(Debug, Clone, Copy)]
pub struct Liveness {
    /// The time of the latest frames, or of the connection.
    last_frame: Instant,
    last_test: Instant,
    /// [`SILENCE`], or longer for a publisher of a low rate.
    silence: Duration,
    /// True if frames come, as last reported.
    sending: bool,
}

/// The result of a test of the publisher.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// The publisher is alive and has stopped sending.
    Silent,
    /// The publisher is no longer there.
    Gone,
}

impl Liveness {
    /// Creates the liveness of a publisher that was connected to, alive, at `now`.
    pub fn connected_at(now: Instant) -> Self {
        Self { last_frame: now, last_test: now, silence: SILENCE, sending: false }
    }

    /// Records that frames came.
    pub fn frame_at(&mut self, now: Instant) {
        self.last_frame = now;
        self.sending = true;
    }

    /// Sets the publisher's rate, in frames per second. An invalid rate changes nothing.
    pub fn rate(&mut self, rate: f64) {
        if let Ok(periods) = Duration::try_from_secs_f64(SILENT_PERIODS / rate) {
            self.silence = periods.max(SILENCE);
        }
    }

    /// Tests the publisher with `is_alive` if a test is due, and returns the change. A silence is reported once, until
    /// frames come again.
    pub fn test(&mut self, now: Instant, is_alive: impl FnOnce() -> bool) -> Option<Change> {
        let since = |then| now.saturating_duration_since(then);
        if since(self.last_frame) < LIVENESS_INTERVAL || since(self.last_test) < LIVENESS_INTERVAL {
            return None;
        }
        self.last_test = now;
        if !is_alive() {
            return Some(Change::Gone);
        }
        let fell_silent = self.sending && since(self.last_frame) >= self.silence;
        self.sending &= !fell_silent;
        fell_silent.then_some(Change::Silent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// The changes of a publisher, with the milliseconds at which they are noticed. The publisher is polled every 4 ms,
    /// sends frames at the times in `frames` and dies at `death`.
    fn changes(rate: Option<f64>, frames: &[u64], death: u64, until: u64) -> Vec<(u64, Change)> {
        let start = Instant::now();
        let mut liveness = Liveness::connected_at(start);
        rate.into_iter().for_each(|rate| liveness.rate(rate));
        let mut changes = Vec::new();
        for at in (0..until).step_by(4) {
            let now = start + ms(at);
            if frames.contains(&at) {
                liveness.frame_at(now);
            }
            let change = liveness.test(now, || at < death);
            changes.extend(change.map(|change| (at, change)));
            if change == Some(Change::Gone) {
                break;
            }
        }
        changes
    }

    #[test]
    fn a_publisher_that_sends_is_never_tested() {
        let start = Instant::now();
        let mut liveness = Liveness::connected_at(start);
        for at in 0..10_000 {
            liveness.frame_at(start + ms(at));
            assert_eq!(liveness.test(start + ms(at), || panic!("tested after {at} ms")), None);
        }
    }

    #[test]
    fn a_silent_publisher_is_tested_five_times_a_second() {
        let start = Instant::now();
        let mut liveness = Liveness::connected_at(start);
        let mut tests = 0;
        for at in 0..10_000 {
            liveness.test(start + ms(at), || {
                tests += 1;
                true
            });
        }
        assert_eq!(tests, 49);
    }

    #[test]
    fn a_death_is_noticed_within_two_intervals_of_the_last_frame() {
        for last in (0..1000).step_by(4) {
            let frames: Vec<_> = (0..=last).step_by(4).collect();
            let [(at, Change::Gone)] = changes(Some(250.0), &frames, last + 1, 5000)[..] else {
                panic!("last frame at {last} ms")
            };
            assert!((last + 200..=last + 404).contains(&at), "last frame at {last} ms, noticed at {at} ms");
        }
    }

    #[test]
    fn a_silence_is_reported_once_and_again_after_the_next_frame() {
        let seen = changes(Some(60.0), &[0, 2000], u64::MAX, 4000);
        let [(first, Change::Silent), (second, Change::Silent)] = seen[..] else { panic!("{seen:?}") };
        assert!((500..=700).contains(&first) && (2500..=2700).contains(&second), "{seen:?}");
    }

    #[test]
    fn a_publisher_that_has_sent_nothing_yet_has_not_stopped() {
        assert_eq!(changes(None, &[], u64::MAX, 4000), []);
        assert!(matches!(changes(None, &[], 1000, 4000)[..], [(1000..=1200, Change::Gone)]));
    }

    #[test]
    fn a_slow_publisher_is_silent_after_three_periods_and_dead_as_soon_as_any() {
        let seen = changes(Some(0.5), &[0], 7000, 20_000);
        let [(silent, Change::Silent), (gone, Change::Gone)] = seen[..] else { panic!("{seen:?}") };
        assert!((6000..=6200).contains(&silent) && (7000..=7200).contains(&gone), "{seen:?}");
        assert_eq!(changes(Some(0.5), &[0], 1000, 20_000).len(), 1);
    }

    #[test]
    fn a_rate_that_is_none_changes_nothing() {
        for rate in [0.0, -0.0, -60.0, f64::NAN, f64::INFINITY, 1e-300] {
            let seen = changes(Some(rate), &[0], u64::MAX, 1000);
            assert_eq!(seen, changes(None, &[0], u64::MAX, 1000), "{rate}");
        }
    }
}
