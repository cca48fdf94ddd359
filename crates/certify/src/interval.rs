//! Interval arithmetic in doubles, rounded outward.
//!
//! Every operation is rounded to nearest, and then moves both ends outward by at least one unit in the last place. Ends
//! may be infinite. An operation without a meaning, such as a division by an interval that holds 0, returns the whole
//! line.

use std::ops::{Add, Mul, Neg, Sub};

/// All real numbers from `lo` to `hi`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    pub lo: f64,
    pub hi: f64,
}

/// A vector of the plane.
pub(super) type Vector = [Interval; 2];

impl Interval {
    pub const ZERO: Self = Self::point(0.0);
    pub const ONE: Self = Self::point(1.0);
    const LINE: Self = Self { lo: f64::NEG_INFINITY, hi: f64::INFINITY };

    /// Returns the interval of one number.
    pub const fn point(value: f64) -> Self {
        Self { lo: value, hi: value }
    }

    /// Returns the interval from `lo` to `hi`, which are rounded to nearest, with one unit in the last place more at
    /// each end. Returns the whole line if one of them is NaN.
    pub(super) fn outward(lo: f64, hi: f64) -> Self {
        let (lo, hi) = (below(lo), above(hi));
        if lo <= hi { Self { lo, hi } } else { Self::LINE }
    }

    /// Returns all numbers within `radius` of 0.
    pub fn within(radius: f64) -> Self {
        Self { lo: -radius, hi: radius }
    }

    /// Returns the greatest absolute value.
    pub fn magnitude(self) -> f64 {
        self.lo.abs().max(self.hi.abs())
    }

    /// Returns a double near the middle.
    pub fn middle(self) -> f64 {
        0.5 * self.lo + 0.5 * self.hi
    }

    pub fn is_positive(self) -> bool {
        self.lo > 0.0
    }

    pub fn is_negative(self) -> bool {
        self.hi < 0.0
    }

    /// Returns true if every number of `self` is below every number of `other`.
    pub fn is_below(self, other: Self) -> bool {
        self.hi < other.lo
    }

    pub fn square(self) -> Self {
        let (least, most) =
            (if self.lo <= 0.0 && self.hi >= 0.0 { 0.0 } else { self.lo.abs().min(self.hi.abs()) }, self.magnitude());
        let Self { lo, hi } = Self::outward(least * least, most * most);
        Self { lo: lo.max(0.0), hi }
    }

    /// Returns the square root, and 0 for negative numbers.
    pub fn sqrt(self) -> Self {
        let Self { lo, hi } = Self::outward(self.lo.max(0.0).sqrt(), self.hi.max(0.0).sqrt());
        Self { lo: lo.max(0.0), hi }
    }

    /// Returns the quotient, or the whole line if the divisor may be 0.
    pub fn over(self, divisor: Self) -> Self {
        if divisor.lo <= 0.0 && divisor.hi >= 0.0 {
            return Self::LINE;
        }
        let quotients = [self.lo / divisor.lo, self.lo / divisor.hi, self.hi / divisor.lo, self.hi / divisor.hi];
        hull(quotients)
    }

    pub fn abs(self) -> Self {
        if self.lo >= 0.0 {
            self
        } else if self.hi <= 0.0 {
            -self
        } else {
            Self { lo: 0.0, hi: self.magnitude() }
        }
    }

    pub fn max(self, other: Self) -> Self {
        Self { lo: self.lo.max(other.lo), hi: self.hi.max(other.hi) }
    }

    pub fn min(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.min(other.hi) }
    }
}

/// Returns the double before `x`, for numbers near 0 that or the one before; NaN of infinity.
///
/// Without a branch (Rump, Zimmermann, Boldo and Melquiond, Computing predecessor and successor in rounding to nearest,
/// 2009, theorem 2.2).
pub(super) fn below(x: f64) -> f64 {
    x - neighbour(x)
}

/// Returns the double after `x`, for numbers near 0 that or the one after; NaN of minus infinity.
pub(super) fn above(x: f64) -> f64 {
    x + neighbour(x)
}

/// Returns a number that leads from `x` to a neighbour, rounded to nearest.
fn neighbour(x: f64) -> f64 {
    const SHARE: f64 = 0.5 * f64::EPSILON * (1.0 + f64::EPSILON);
    const LEAST: f64 = f64::from_bits(1);
    SHARE * x.abs() + LEAST
}

/// Returns the hull of four numbers that are rounded to nearest, rounded outward.
fn hull([a, b, c, d]: [f64; 4]) -> Interval {
    if a.is_nan() || b.is_nan() || c.is_nan() || d.is_nan() {
        return Interval::LINE;
    }
    // One instruction each, since neither is NaN.
    let least = |one: f64, other: f64| if one < other { one } else { other };
    let most = |one: f64, other: f64| if one > other { one } else { other };
    Interval::outward(least(least(a, b), least(c, d)), most(most(a, b), most(c, d)))
}

impl Add for Interval {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::outward(self.lo + other.lo, self.hi + other.hi)
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::outward(self.lo - other.hi, self.hi - other.lo)
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self { lo: -self.hi, hi: -self.lo }
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        hull([self.lo * other.lo, self.lo * other.hi, self.hi * other.lo, self.hi * other.hi])
    }
}

impl Mul<f64> for Interval {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        self * Self::point(factor)
    }
}

/// a . b
pub(super) fn dot(a: Vector, b: Vector) -> Interval {
    a[0] * b[0] + a[1] * b[1]
}

/// a x b
pub(super) fn cross(a: Vector, b: Vector) -> Interval {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1]]
}

pub(super) fn scaled(a: Vector, factor: Interval) -> Vector {
    [a[0] * factor, a[1] * factor]
}

/// |a|^2
pub(super) fn norm_squared(a: Vector) -> Interval {
    a[0].square() + a[1].square()
}

/// |a|
pub(super) fn norm(a: Vector) -> Interval {
    norm_squared(a).sqrt()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(20_000) })]

        #[test]
        fn neighbours_are_those_of_the_standard_library(x in proptest::num::f64::ANY) {
            if !x.is_finite() {
                prop_assert!(x.is_nan() || below(x).is_nan() || above(x).is_nan());
                return Ok(());
            }
            let (least, most) = (x.next_down(), x.next_up());
            prop_assert!(below(x) <= least && below(x) >= least.next_down(), "{:e}", x);
            prop_assert!(above(x) >= most && above(x) <= most.next_up(), "{:e}", x);
            prop_assert!(x.abs() < 1e-290 || (below(x), above(x)) == (least, most), "{:e}", x);
        }
    }

    #[test]
    fn neighbours_at_powers_of_two_and_at_the_ends() {
        for exponent in -1022..=1023 {
            for x in [2f64.powi(exponent), -(2f64.powi(exponent))] {
                assert!(below(x) <= x.next_down() && above(x) >= x.next_up(), "{x:e}");
                assert!(exponent < -960 || (below(x), above(x)) == (x.next_down(), x.next_up()), "{x:e}");
            }
        }
        assert_eq!([below(0.0), above(-0.0)], [-f64::from_bits(1), f64::from_bits(1)]);
        assert_eq!([below(f64::MIN), above(f64::MAX)], [f64::NEG_INFINITY, f64::INFINITY]);
    }
}
