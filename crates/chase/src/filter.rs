//! The delay-locked loop: from readings with jitter to the position and the rate of a source. Pure.
//!
//! The loop is of second order: each reading corrects position and rate by a part of its error. The parts are those of
//! a Kalman filter of constant rate (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
//! Navigation, 6.2). They begin large and fall to a constant, which for timecode makes a loop of about 0.1 rad/s.

/// The standard deviations of a source. Units of the position are free: seconds of timecode, metres of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// The deviation of a reading: its jitter.
    pub jitter: f64,
    /// The deviation of the rate at the beginning, per second.
    pub spread: f64,
    /// Growth of the variance of the rate, per second.
    pub drift: f64,
}

impl Noise {
    /// Timecode: jitter of 5 ms, and the clocks of two machines.
    pub const TIMECODE: Self = Self { jitter: 0.005, spread: 3e-4, drift: 1e-10 };
    /// Timecode that has left its rate: a player with another speed.
    pub const TIMECODE_OF_ANOTHER_SPEED: Self = Self { spread: 0.03, ..Self::TIMECODE };
    /// A tracked performer in metres of the path: 15 cm, and a walk that changes within a second.
    pub const TRACKER: Self = Self { jitter: 0.15, spread: 0.5, drift: 1.5e-4 };
}

/// An estimate of a source: its position runs at a rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayLockedLoop {
    noise: Noise,
    at_ns: u64,
    position: f64,
    rate: f64,
    /// The covariance of position and rate.
    position_variance: f64,
    covariance: f64,
    rate_variance: f64,
    /// The mean error of the latest readings.
    bias: f64,
}

/// The part of a reading in the mean error: the mean is of about eight readings.
const BIAS_PART: f64 = 0.125;
/// The mean error, in standard deviations of a reading, that jitter alone does not reach: its own deviation is 0.26.
const MOST_BIAS: f64 = 1.5;

impl DelayLockedLoop {
    /// Creates a loop from a first reading: a position at a moment of CLOCK_MONOTONIC, of a source at about `rate`
    /// units per second.
    pub fn new(at_ns: u64, position: f64, rate: f64, noise: Noise) -> Self {
        Self {
            noise,
            at_ns,
            position,
            rate,
            position_variance: noise.jitter * noise.jitter,
            covariance: 0.0,
            rate_variance: noise.spread * noise.spread,
            bias: 0.0,
        }
    }

    /// Returns the position at a moment.
    pub fn position(&self, at_ns: u64) -> f64 {
        self.position + self.rate * seconds_between(self.at_ns, at_ns)
    }

    /// Returns the rate, units per second.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Corrects the estimate by a reading.
    ///
    /// If the latest readings are off in one direction, the first readings were late or the source has moved. Then the
    /// position counts as less certain, so that the next readings correct it at once.
    pub fn correct(&mut self, at_ns: u64, position: f64) {
        let Noise { jitter, drift, .. } = self.noise;
        let step = seconds_between(self.at_ns, at_ns).max(0.0);
        let error = position - self.position(at_ns);
        self.bias += BIAS_PART * (error - self.bias);
        if self.bias.abs() > MOST_BIAS * jitter {
            self.position_variance += self.bias * self.bias;
            self.bias = 0.0;
        }
        // The variances at the moment of the reading, then the gains.
        let rate_variance = self.rate_variance + drift * step;
        let covariance = self.covariance + self.rate_variance * step + drift * step * step / 2.0;
        let position_variance = self.position_variance
            + 2.0 * self.covariance * step
            + self.rate_variance * step * step
            + drift * step * step * step / 3.0;
        let total = position_variance + jitter * jitter;
        let (position_gain, rate_gain) = (position_variance / total, covariance / total);
        *self = Self {
            noise: self.noise,
            at_ns: self.at_ns.max(at_ns),
            position: self.position(self.at_ns.max(at_ns)) + position_gain * error,
            rate: self.rate + rate_gain * error,
            position_variance: (1.0 - position_gain) * position_variance,
            covariance: (1.0 - position_gain) * covariance,
            rate_variance: rate_variance - rate_gain * covariance,
            bias: self.bias,
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

    const JITTER: f64 = 0.005;

    #[test]
    fn jitter_is_taken_out_and_skew_is_followed() {
        let mut random = fastrand::Rng::with_seed(7);
        let mut normal = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
        let (mut worst, mut worst_rate) = (0.0f64, 0.0f64);
        for _ in 0..200 {
            let rate = 1.0 + 1e-4 * normal();
            let begin = 5.0 + JITTER * normal();
            let mut estimate = DelayLockedLoop::new(1_000_000_000, begin, 1.0, Noise::TIMECODE);
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

    #[test]
    fn late_first_readings_are_forgotten() {
        let mut random = fastrand::Rng::with_seed(8);
        let mut normal = || JITTER * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
        let mut estimate = DelayLockedLoop::new(0, -0.035, 1.0, Noise::TIMECODE);
        for k in 1..100u64 {
            let late = if k < 25 { 0.035 } else { 0.0 };
            estimate.correct(40_000_000 * k, 0.04 * k as f64 - late + normal());
        }
        let error = estimate.position(3_960_000_000) - 3.96;
        assert!(error.abs() < 0.004, "{error}");
    }
}
