//! Interval arithmetic in doubles, rounded outward.
//!
//! Every operation moves both ends outward by one unit in the last place more than the greatest rounding error in any
//! IEEE 754 rounding mode. So the result does not depend on the mode in force. Ends may be infinite. An operation
//! without a meaning, such as a division by an interval that holds 0, returns the whole line.

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
        if lo.is_nan() || hi.is_nan() { Self::LINE } else { Self { lo: lo.next_down(), hi: hi.next_up() } }
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
