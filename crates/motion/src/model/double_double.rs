//! Numbers of about 32 digits as the sum of two doubles, for coordinates along a path, because far along a path one
//! double lacks the digits for a link's length.

use std::f64::consts::TAU;

use super::elementary;

/// 2 pi minus its nearest double: with it, whole turns are subtracted from an angle without losing digits.
const TAU_LOW: f64 = 2.449_293_598_294_706_4e-16;

/// A number as `high` + `low`.
///
/// Invariant: `low` is at most half a unit in the last place of `high`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DoubleDouble {
    /// The number, rounded.
    pub high: f64,
    /// The rounding error of `high`.
    pub low: f64,
}

/// Returns the rounded sum and its rounding error (Knuth, The Art of Computer Programming, vol. 2, section 4.2.2).
fn two_sum(x: f64, y: f64) -> (f64, f64) {
    let sum = x + y;
    let y_part = sum - x;
    (sum, (x - (sum - y_part)) + (y - y_part))
}

impl From<f64> for DoubleDouble {
    fn from(number: f64) -> Self {
        Self { high: number, low: 0.0 }
    }
}

impl DoubleDouble {
    /// Zero.
    pub const ZERO: Self = Self { high: 0.0, low: 0.0 };

    /// Returns the sum of two doubles.
    pub fn sum(x: f64, y: f64) -> Self {
        let (high, low) = two_sum(x, y);
        Self { high, low }
    }

    /// Returns the angle of a number of turns, in radians.
    pub fn from_turns(turns: impl Into<Self>) -> Self {
        let Self { high: turns, low } = turns.into();
        let high = TAU * turns;
        Self::sum(high, TAU.mul_add(turns, -high) + (TAU_LOW * turns + TAU * low))
    }

    /// Returns the quotient of two doubles.
    pub fn quotient(dividend: f64, divisor: f64) -> Self {
        let high = dividend / divisor;
        Self { high, low: (-high).mul_add(divisor, dividend) / divisor }
    }

    /// Returns this number over a double, to about 31 digits.
    pub fn over(self, divisor: f64) -> Self {
        let quotient = Self::quotient(self.high, divisor);
        if self.low == 0.0 { quotient } else { quotient.plus(self.low / divisor) }
    }

    /// Returns this number minus a product, to about 31 digits of the greater of the two.
    pub fn minus_product(self, factor: f64, other: Self) -> Self {
        let product = factor * other.high;
        let rest = factor.mul_add(other.high, -product) + factor * other.low;
        self.plus(-product).plus(-rest)
    }

    /// Returns this number plus `by`.
    pub fn plus(self, by: f64) -> Self {
        let (sum, error) = two_sum(self.high, by);
        Self::sum(sum, error + self.low)
    }

    /// Returns this number minus `other`, exact to a few units in the last place of the difference.
    pub fn minus(self, other: Self) -> f64 {
        let (difference, error) = two_sum(self.high, -other.high);
        difference + (error + (self.low - other.low))
    }

    /// Returns the difference of a double and this number.
    pub fn error_of(self, number: f64) -> f64 {
        (number - self.high) - self.low
    }

    /// Returns sine and cosine of this angle in radians, exact to a few units of 1e-16 up to 1e8 radians.
    pub fn sine_and_cosine(self) -> (f64, f64) {
        let turns = (self.high / TAU).round();
        let product = turns * TAU;
        // Exact: the angle and the nearest multiple of TAU agree in their leading bits.
        let remainder = self.high - product;
        let low = self.low - TAU.mul_add(turns, -product) - TAU_LOW * turns;
        let (sine, cosine) = elementary::sin_cos(remainder);
        (low.mul_add(cosine, sine), (-low).mul_add(sine, cosine))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_turns_come_off_an_angle_exactly() {
        for turns in [1e3, 123_456.0, 1e7] {
            for part in [0.0, 0.125, 0.25, -0.375] {
                // The part is a dyadic fraction, so that turns + part is exact.
                let (sine, cosine) = DoubleDouble::from_turns(turns + part).sine_and_cosine();
                let (true_sine, true_cosine) = (TAU * part).sin_cos();
                assert!((sine - true_sine).abs() < 3e-16 && (cosine - true_cosine).abs() < 3e-16, "{turns} {part}");
            }
        }
    }

    #[test]
    fn small_steps_far_along_add_up() {
        let start = DoubleDouble::from_turns(1e7);
        let end = (0..1000).fold(start, |at, _| at.plus(1e-12));
        assert!((end.minus(start) - 1e-9).abs() < 1e-21);
    }
}
