//! The delay-locked loop: from readings with jitter to the position and the rate of a source. Pure.
//!
//! A loop of second order: each reading corrects position and rate by a part of its error. The parts are those of a
//! Kalman filter of constant rate (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
//! Navigation, 6.2). They begin large and fall to a constant, which is a loop of about 0.1 rad/s.

/// Standard deviation of the jitter of a reading, seconds.
const JITTER: f64 = 0.005;
/// Standard deviation of the rate of a source that has just begun: the clocks of two machines.
const CLOCK_SPREAD: f64 = 3e-4;
/// The same of a source that has left its rate: a player with another speed.
pub const SPEED_SPREAD: f64 = 0.03;
/// Growth of the variance of the rate, 1/s.
const DRIFT: f64 = 1e-10;

/// An estimate of a source: its position runs at a rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayLockedLoop {
    at_ns: u64,
    position: f64,
    rate: f64,
    /// The covariance of position and rate.
    position_variance: f64,
    covariance: f64,
    rate_variance: f64,
}

impl DelayLockedLoop {
    /// Creates a loop from a first reading: a position in seconds at a moment of CLOCK_MONOTONIC, for a source at about
    /// `rate` seconds per second. `spread` is the standard deviation of that rate; `None` is that of a clock.
    pub fn new(at_ns: u64, position: f64, rate: f64, spread: Option<f64>) -> Self {
        let spread = spread.unwrap_or(CLOCK_SPREAD);
        Self {
            at_ns,
            position,
            rate,
            position_variance: JITTER * JITTER,
            covariance: 0.0,
            rate_variance: spread * spread,
        }
    }

    /// Returns the position at a moment, seconds.
    pub fn position(&self, at_ns: u64) -> f64 {
        self.position + self.rate * seconds_between(self.at_ns, at_ns)
    }

    /// Returns the rate, seconds per second.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Corrects the estimate by a reading.
    pub fn correct(&mut self, at_ns: u64, position: f64) {
        let step = seconds_between(self.at_ns, at_ns).max(0.0);
        let error = position - self.position(at_ns);
        // The variances at the moment of the reading, then the gains.
        let rate_variance = self.rate_variance + DRIFT * step;
        let covariance = self.covariance + self.rate_variance * step + DRIFT * step * step / 2.0;
        let position_variance = self.position_variance
            + 2.0 * self.covariance * step
            + self.rate_variance * step * step
            + DRIFT * step * step * step / 3.0;
        let total = position_variance + JITTER * JITTER;
        let (position_gain, rate_gain) = (position_variance / total, covariance / total);
        *self = Self {
            at_ns: self.at_ns.max(at_ns),
            position: self.position(self.at_ns.max(at_ns)) + position_gain * error,
            rate: self.rate + rate_gain * error,
            position_variance: (1.0 - position_gain) * position_variance,
            covariance: (1.0 - position_gain) * covariance,
            rate_variance: rate_variance - rate_gain * covariance,
        };
    }
}

/// Returns the seconds from one moment to another, negative if that is earlier.
pub fn seconds_between(from_ns: u64, to_ns: u64) -> f64 {
    (to_ns as i64).wrapping_sub(from_ns as i64) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jitter_is_taken_out_and_skew_is_followed() {
        let mut random = fastrand::Rng::with_seed(7);
        let mut normal = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
        let (mut worst, mut worst_rate) = (0.0f64, 0.0f64);
        for _ in 0..200 {
            let rate = 1.0 + 1e-4 * normal();
            let begin = 5.0 + JITTER * normal();
            let mut estimate = DelayLockedLoop::new(1_000_000_000, begin, 1.0, None);
            for k in 1..2_000u64 {
                let at_ns = 1_000_000_000 + 40_000_000 * k;
                let place = 5.0 + rate * 0.04 * k as f64;
                estimate.correct(at_ns, place + JITTER * normal());
                if k > 75 {
                    worst = worst.max((estimate.position(at_ns) - place).abs());
                    worst_rate = worst_rate.max((estimate.rate() - rate).abs());
                }
            }
        }
        // 400,000 readings of 5 ms, the greatest of which is 22 ms off.
        assert!(worst < 0.004 && worst_rate < 8e-4, "{worst} s, {worst_rate}");
    }
}
