//! Binary numbers of 128 bits, without a heap.
//!
//! `+`, `-`, `*` and `/` return the exact result rounded to the next number in a given direction. A result without a
//! value, or with an exponent beyond any that a certificate can need, is NaN. NaN propagates.

use std::cmp::Ordering;

/// Limit of the size of an exponent: the greatest double has 971, the least -1074.
const MOST_EXPONENT: i32 = 1 << 24;

/// The exponent of NaN.
const NOT_A_NUMBER: i32 = i32::MAX;

/// The top bit of a mantissa. Every number but 0 and NaN has it.
const TOP: u128 = 1 << 127;

/// The direction of rounding.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Round {
    /// To the greatest number that is not greater.
    Down,
    /// To the least number that is not less.
    Up,
}

/// The number `mantissa` 2^`exponent`, or its negative.
#[derive(Debug, Clone, Copy)]
pub(super) struct Number {
    is_negative: bool,
    exponent: i32,
    mantissa: u128,
}

impl Number {
    pub const ZERO: Self = Self { is_negative: false, exponent: 0, mantissa: 0 };
    pub const NAN: Self = Self { is_negative: false, exponent: NOT_A_NUMBER, mantissa: 0 };

    /// Converts a double exactly. Infinite numbers become NaN.
    pub const fn new(number: f64) -> Self {
        let bits = number.to_bits();
        let (biased, fraction) = ((bits >> 52) as i32 & 0x7ff, bits & ((1 << 52) - 1));
        let (integer, exponent) = match biased {
            0x7ff => return Self::NAN,
            0 => (fraction, -1074),
            _ => (fraction | 1 << 52, biased - 1075),
        };
        if integer == 0 {
            return Self::ZERO;
        }
        let wide = integer as u128;
        let shift = wide.leading_zeros();
        Self { is_negative: bits >> 63 == 1, exponent: exponent - shift as i32, mantissa: wide << shift }
    }

    /// Returns the mantissa and its exponent.
    #[cfg(test)]
    pub fn parts(self) -> (bool, u128, i32) {
        (self.is_negative, self.mantissa, self.exponent)
    }

    pub fn is_nan(self) -> bool {
        self.exponent == NOT_A_NUMBER
    }

    pub fn is_positive(self) -> bool {
        self.mantissa != 0 && !self.is_negative
    }

    pub fn is_negative(self) -> bool {
        self.mantissa != 0 && self.is_negative
    }

    pub fn negative(self) -> Self {
        Self { is_negative: self.mantissa != 0 && !self.is_negative, ..self }
    }

    /// Returns the nearest double towards zero, for choices and never for proofs.
    pub fn rough(self) -> f64 {
        if self.is_nan() {
            return f64::NAN;
        }
        // 53 bits are exact in a double. There are two factors, because one alone may overflow.
        let (leading, exponent) = ((self.mantissa >> 75) as f64, self.exponent + 75);
        let half = exponent / 2;
        let size = leading * 2f64.powi(half) * 2f64.powi(exponent - half);
        if self.is_negative { -size } else { size }
    }

    /// Returns the number of this sign whose size is `high` 2^`exponent` and a rest less than one unit of `high`.
    fn rounded(is_negative: bool, exponent: i32, high: u128, has_rest: bool, round: Round) -> Self {
        let is_outward = has_rest && (round == Round::Up) != is_negative;
        let (mantissa, exponent) = match high.checked_add(u128::from(is_outward)) {
            Some(mantissa) => (mantissa, exponent),
            None => (TOP, exponent + 1),
        };
        if exponent.abs() > MOST_EXPONENT {
            return Self::NAN;
        }
        Self { is_negative, exponent, mantissa }
    }

    pub fn plus(self, other: Self, round: Round) -> Self {
        let (more, less) = if self.exponent < other.exponent { (other, self) } else { (self, other) };
        if more.is_nan() || less.mantissa == 0 {
            return more;
        }
        if more.mantissa == 0 {
            return less;
        }
        let shift = more.exponent.abs_diff(less.exponent);
        // 256 bits of the lesser number, in units of the greater one's mantissa, and a rest.
        let (high, low, has_rest) = match shift {
            0 => (less.mantissa, 0, false),
            1..128 => (less.mantissa >> shift, less.mantissa << (128 - shift), false),
            128 => (0, less.mantissa, false),
            129..256 => (0, less.mantissa >> (shift - 128), less.mantissa << (256 - shift) != 0),
            _ => (0, 0, true),
        };
        let is_negative = more.is_negative;
        if more.is_negative == less.is_negative {
            let (sum, carries) = more.mantissa.overflowing_add(high);
            if !carries {
                return Self::rounded(is_negative, more.exponent, sum, low != 0 || has_rest, round);
            }
            let has_rest = sum & 1 == 1 || low != 0 || has_rest;
            return Self::rounded(is_negative, more.exponent + 1, sum >> 1 | TOP, has_rest, round);
        }
        // The difference of 256 bits. A rest makes it less by a part of its last unit.
        let (low, borrows) = 0u128.overflowing_sub(low);
        let (high, flips) = more.mantissa.overflowing_sub(high);
        let (high, flips) = match high.overflowing_sub(u128::from(borrows)) {
            (high, true) => (high, !flips),
            (high, false) => (high, flips),
        };
        // Only with equal exponents can the lesser one be the greater in size.
        let (high, low, is_negative) =
            if flips { (high.wrapping_neg(), low, !is_negative) } else { (high, low, is_negative) };
        let (high, low) = if has_rest {
            let (low, borrows) = low.overflowing_sub(1);
            (high - u128::from(borrows), low)
        } else {
            (high, low)
        };
        if high == 0 && low == 0 {
            return Self::ZERO;
        }
        let shift = if high == 0 { 128 + low.leading_zeros() } else { high.leading_zeros() };
        let (high, low) = match shift {
            0 => (high, low),
            1..128 => (high << shift | low >> (128 - shift), low << shift),
            _ => (low << (shift - 128), 0),
        };
        Self::rounded(is_negative, more.exponent - shift as i32, high, low != 0 || has_rest, round)
    }

    pub fn minus(self, other: Self, round: Round) -> Self {
        self.plus(other.negative(), round)
    }

    pub fn times(self, other: Self, round: Round) -> Self {
        if self.is_nan() || other.is_nan() {
            return Self::NAN;
        }
        if self.mantissa == 0 || other.mantissa == 0 {
            return Self::ZERO;
        }
        let (high, low) = product(self.mantissa, other.mantissa);
        let exponent = self.exponent + other.exponent + 128;
        let is_negative = self.is_negative != other.is_negative;
        if high >= TOP {
            Self::rounded(is_negative, exponent, high, low != 0, round)
        } else {
            Self::rounded(is_negative, exponent - 1, high << 1 | low >> 127, low << 1 != 0, round)
        }
    }

    pub fn over(self, divisor: Self, round: Round) -> Self {
        if self.is_nan() || divisor.mantissa == 0 {
            return Self::NAN;
        }
        if self.mantissa == 0 {
            return Self::ZERO;
        }
        // The quotient has 128 bits if the dividend's mantissa is the less of the two, else one more.
        let is_less = self.mantissa < divisor.mantissa;
        let (dividend, bit) = if is_less { (self.mantissa, 0) } else { (self.mantissa >> 1, self.mantissa << 127) };
        let exponent = self.exponent - divisor.exponent - if is_less { 128 } else { 127 };
        let (quotient, has_rest) = quotient(dividend, bit, divisor.mantissa);
        Self::rounded(self.is_negative != divisor.is_negative, exponent, quotient, has_rest, round)
    }

    /// Returns a number near the root of a positive number, to about 52 bits.
    pub fn rough_root(self) -> Self {
        // The size is `near` 4^`power`, with `near` from 2^63 to 2^65.
        let power = (self.exponent + 64).div_euclid(2);
        let near = (self.mantissa >> 64) as f64 * 2f64.powi((self.exponent + 64).rem_euclid(2));
        let root = Self::new(near.sqrt());
        Self { exponent: root.exponent + power, ..root }
    }
}

impl PartialEq for Number {
    fn eq(&self, other: &Self) -> bool {
        self.partial_cmp(other) == Some(Ordering::Equal)
    }
}

impl PartialOrd for Number {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        if self.is_nan() || other.is_nan() {
            return None;
        }
        let sign = |number: &Self| i32::from(number.is_positive()) - i32::from(number.is_negative());
        let sizes = (self.exponent, self.mantissa).cmp(&(other.exponent, other.mantissa));
        Some(sign(self).cmp(&sign(other)).then(match sign(self) {
            0 => Ordering::Equal,
            1 => sizes,
            _ => sizes.reverse(),
        }))
    }
}

/// Returns the product of two numbers of 128 bits, the upper half first.
fn product(a: u128, b: u128) -> (u128, u128) {
    const HALF: u128 = u64::MAX as u128;
    let ((a1, a0), (b1, b0)) = ((a >> 64, a & HALF), (b >> 64, b & HALF));
    let (low, one, other) = (a0 * b0, a1 * b0, a0 * b1);
    let middle = (low >> 64) + (one & HALF) + (other & HALF);
    (a1 * b1 + (one >> 64) + (other >> 64) + (middle >> 64), middle << 64 | low & HALF)
}

/// Divides `high` 2^128 + `low` by a divisor with its top bit set. Returns the quotient, and true if there is a
/// rest. Precondition: `high` is less than the divisor.
fn quotient(high: u128, low: u128, divisor: u128) -> (u128, bool) {
    let (first, rest) = digit(high, (low >> 64) as u64, divisor);
    let (second, rest) = digit(rest, low as u64, divisor);
    (u128::from(first) << 64 | u128::from(second), rest != 0)
}

/// Divides `high` 2^64 + `next` by a divisor with its top bit set: one digit of 64 bits, and the rest. Knuth, "The Art
/// of Computer Programming", volume 2, algorithm 4.3.1 D: the estimate by the divisor's first half is at most 2 too
/// great.
fn digit(high: u128, next: u64, divisor: u128) -> (u64, u128) {
    let (upper, lower) = (divisor >> 64, divisor & u128::from(u64::MAX));
    let mut digit = (high / upper).min(u128::from(u64::MAX));
    // The rest of the division by the upper half alone, and the part that the lower half takes from it.
    let mut rest = high - digit * upper;
    while rest >> 64 == 0 && digit * lower > (rest << 64 | u128::from(next)) {
        digit -= 1;
        rest += upper;
    }
    // The true rest is less than the divisor: it fits, whatever the difference overflows.
    let rest = (rest << 64 | u128::from(next)).wrapping_sub(digit * lower);
    (digit as u64, rest)
}
