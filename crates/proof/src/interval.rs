//! Interval arithmetic of the checker, with ends of 128 bits.
//!
//! Every operation returns an interval that holds the result for all numbers of its operands, because lower ends are
//! rounded down and upper ends up. It relies only on the operations and the comparisons of [`Number`]. An operation
//! without a value is NaN: a division by an interval that holds 0, or a root of a number that may be negative. NaN
//! propagates, and every comparison with it is false.

use std::borrow::Borrow;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::number::Number;
use super::number::Round::{Down, Up};
use super::problem::{Checked, problem};

/// All real numbers from `lo` to `hi`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interval {
    lo: Number,
    hi: Number,
}

/// The sign of an interval's numbers.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    NotNegative,
    NotPositive,
    Across,
}

impl Interval {
    /// Creates the interval of a single number, exactly.
    pub const fn new(number: f64) -> Self {
        let end = Number::new(number);
        Self { lo: end, hi: end }
    }

    /// Creates the interval of a finite number of a text.
    ///
    /// # Errors
    /// A sentence about the field, for another number.
    pub fn finite(field: &str, number: f64) -> Checked<Self> {
        if number.is_finite() {
            Ok(Self::new(number))
        } else {
            Err(problem!("{field} is {number:?}, expected a number"))
        }
    }

    /// Creates the interval of a positive number of a text.
    ///
    /// # Errors
    /// A sentence about the field, for another number.
    pub fn positive(field: &str, number: f64) -> Checked<Self> {
        if number.is_finite() && number > 0.0 {
            Ok(Self::new(number))
        } else {
            Err(problem!("{field} is {number:?}, expected a positive number"))
        }
    }

    /// Creates the interval between two numbers.
    #[cfg(test)]
    pub fn between(lo: Number, hi: Number) -> Self {
        Self { lo, hi }
    }

    /// Returns both ends.
    #[cfg(test)]
    pub fn ends(&self) -> (Number, Number) {
        (self.lo, self.hi)
    }

    fn not_a_number() -> Self {
        Self { lo: Number::NAN, hi: Number::NAN }
    }

    fn side(&self) -> Side {
        if !self.lo.is_negative() {
            Side::NotNegative
        } else if !self.hi.is_positive() {
            Side::NotPositive
        } else {
            Side::Across
        }
    }

    fn is_not_a_number(&self) -> bool {
        self.lo.is_nan() || self.hi.is_nan()
    }

    /// Returns true if every number of `self` is less than every number of `other`.
    pub fn is_below(&self, other: &Self) -> bool {
        self.hi < other.lo
    }

    /// Returns true if no number of `self` is greater than any number of `other`.
    pub fn is_at_most(&self, other: &Self) -> bool {
        self.hi <= other.lo
    }

    /// Returns true if every number is greater than 0.
    pub fn is_positive(&self) -> bool {
        !self.is_not_a_number() && self.lo.is_positive()
    }

    /// Returns true if every number is less than 0.
    pub fn is_negative(&self) -> bool {
        !self.is_not_a_number() && self.hi.is_negative()
    }

    /// Returns true if no number is less than 0.
    pub fn is_not_negative(&self) -> bool {
        !self.is_not_a_number() && self.side() == Side::NotNegative
    }

    /// Returns the upper end alone.
    pub fn upper(&self) -> Self {
        Self { lo: self.hi, hi: self.hi }
    }

    /// Returns all numbers from the negative of the upper end to the upper end.
    pub fn around_zero(&self) -> Self {
        Self { lo: self.hi.negative(), hi: self.hi }
    }

    /// Returns the greater of the two.
    pub fn max(&self, other: &Self) -> Self {
        Self { lo: greater(self.lo, other.lo), hi: greater(self.hi, other.hi) }
    }

    /// Returns the smaller of the two.
    pub fn min(&self, other: &Self) -> Self {
        Self { lo: smaller(self.lo, other.lo), hi: smaller(self.hi, other.hi) }
    }

    /// Returns all numbers of both intervals and between them.
    pub fn hull(&self, other: &Self) -> Self {
        Self { lo: smaller(self.lo, other.lo), hi: greater(self.hi, other.hi) }
    }

    /// Returns the numbers that both intervals have. Two enclosures of one number have a common number: without one the
    /// result is NaN.
    pub fn meet(&self, other: &Self) -> Self {
        let both = Self { lo: greater(self.lo, other.lo), hi: smaller(self.hi, other.hi) };
        if both.hi < both.lo { Self::not_a_number() } else { both }
    }

    /// Returns the absolute value.
    pub fn abs(&self) -> Self {
        match self.side() {
            _ if self.is_not_a_number() => Self::not_a_number(),
            Side::NotNegative => *self,
            Side::NotPositive => -self,
            Side::Across => Self { lo: Number::ZERO, hi: greater(self.lo.negative(), self.hi) },
        }
    }

    /// Returns the square.
    pub fn square(&self) -> Self {
        let size = self.abs();
        Self { lo: size.lo.times(size.lo, Down), hi: size.hi.times(size.hi, Up) }
    }

    /// Returns the square root.
    pub fn sqrt(&self) -> Self {
        if !self.is_not_negative() {
            return Self::not_a_number();
        }
        Self { lo: root(self.lo).0, hi: root(self.hi).1 }
    }

    /// Returns a double near the middle, for choices and never for proofs.
    pub fn rough(&self) -> f64 {
        let lo = self.lo.rough();
        lo + (self.hi.rough() - lo) / 2.0
    }
}

fn greater(a: Number, b: Number) -> Number {
    if a.is_nan() || b.is_nan() {
        return Number::NAN;
    }
    if a < b { b } else { a }
}

fn smaller(a: Number, b: Number) -> Number {
    if a.is_nan() || b.is_nan() {
        return Number::NAN;
    }
    if b < a { b } else { a }
}

/// Returns numbers below and above the root of a number of at least 0. For every s > 0, the root lies between s and x /
/// s. Near the root, one step of Newton's method brings the two together.
fn root(x: Number) -> (Number, Number) {
    if !x.is_positive() {
        return (x, x);
    }
    let guess = x.rough_root();
    let s = x.over(guess, Down).plus(guess, Down).times(Number::new(0.5), Down);
    (smaller(s, x.over(s, Down)), greater(s, x.over(s, Up)))
}

impl Neg for &Interval {
    type Output = Interval;
    fn neg(self) -> Interval {
        Interval { lo: self.hi.negative(), hi: self.lo.negative() }
    }
}

impl Neg for Interval {
    type Output = Interval;
    fn neg(self) -> Interval {
        -&self
    }
}

fn sum(a: &Interval, b: &Interval) -> Interval {
    Interval { lo: a.lo.plus(b.lo, Down), hi: a.hi.plus(b.hi, Up) }
}

fn difference(a: &Interval, b: &Interval) -> Interval {
    Interval { lo: a.lo.minus(b.hi, Down), hi: a.hi.minus(b.lo, Up) }
}

/// Returns the product. The signs decide which ends make the least and the greatest product.
fn product(a: &Interval, b: &Interval) -> Interval {
    use Side::{Across, NotNegative, NotPositive};
    let of = |x: Number, y: Number, z: Number, w: Number| Interval { lo: x.times(y, Down), hi: z.times(w, Up) };
    match (a.side(), b.side()) {
        (NotNegative, NotNegative) => of(a.lo, b.lo, a.hi, b.hi),
        (NotPositive, NotPositive) => of(a.hi, b.hi, a.lo, b.lo),
        (NotNegative, NotPositive) => of(a.hi, b.lo, a.lo, b.hi),
        (NotPositive, NotNegative) => of(a.lo, b.hi, a.hi, b.lo),
        (NotNegative, Across) => of(a.hi, b.lo, a.hi, b.hi),
        (Across, NotNegative) => of(a.lo, b.hi, a.hi, b.hi),
        (NotPositive, Across) => of(a.lo, b.hi, a.lo, b.lo),
        (Across, NotPositive) => of(a.hi, b.lo, a.lo, b.lo),
        (Across, Across) => {
            let (one, other) = (of(a.lo, b.hi, a.lo, b.lo), of(a.hi, b.lo, a.hi, b.hi));
            Interval { lo: smaller(one.lo, other.lo), hi: greater(one.hi, other.hi) }
        }
    }
}

fn quotient(a: &Interval, b: &Interval) -> Interval {
    if b.is_negative() {
        return quotient(&-a, &-b);
    }
    if !b.is_positive() || a.is_not_a_number() {
        return Interval::not_a_number();
    }
    // The least quotient has the greatest divisor if the dividend is positive, else the least.
    let least_by = if a.lo.is_negative() { b.lo } else { b.hi };
    let greatest_by = if a.hi.is_negative() { b.hi } else { b.lo };
    Interval { lo: a.lo.over(least_by, Down), hi: a.hi.over(greatest_by, Up) }
}

/// Implements an operator between any two of `Interval` and `&Interval`.
macro_rules! operator {
    ($operator:ident, $method:ident, $computed:ident) => {
        impl<I: Borrow<Interval>> $operator<I> for &Interval {
            type Output = Interval;
            fn $method(self, other: I) -> Interval {
                $computed(self, other.borrow())
            }
        }
        impl<I: Borrow<Interval>> $operator<I> for Interval {
            type Output = Interval;
            fn $method(self, other: I) -> Interval {
                $computed(&self, other.borrow())
            }
        }
    };
}

operator!(Add, add, sum);
operator!(Sub, sub, difference);
operator!(Mul, mul, product);
operator!(Div, div, quotient);

/// A vector of two intervals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vector {
    pub x: Interval,
    pub y: Interval,
}

impl Vector {
    /// Creates the vector of two numbers, exactly.
    pub fn new(x: f64, y: f64) -> Self {
        Self { x: Interval::new(x), y: Interval::new(y) }
    }

    /// Returns the scalar product.
    pub fn dot(&self, other: &Self) -> Interval {
        self.x * other.x + self.y * other.y
    }

    /// Returns the determinant of the two vectors as columns.
    pub fn cross(&self, other: &Self) -> Interval {
        self.x * other.y - self.y * other.x
    }

    /// Returns the squared length.
    pub fn norm_squared(&self) -> Interval {
        self.x.square() + self.y.square()
    }

    /// Returns the length.
    pub fn norm(&self) -> Interval {
        self.norm_squared().sqrt()
    }

    /// Returns the vector `factor` times as long.
    pub fn scaled(&self, factor: &Interval) -> Self {
        Self { x: self.x * factor, y: self.y * factor }
    }

    /// Returns the vector turned by a quarter to the left.
    pub fn turned_left(&self) -> Self {
        Self { x: -self.y, y: self.x }
    }

    /// Returns the sum.
    pub fn plus(&self, other: &Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y }
    }

    /// Returns the difference.
    pub fn minus(&self, other: &Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y }
    }
}
