//! Real numbers of 38 digits and vectors of two of them, on astro-float, with arithmetic operators that make the
//! reference's formulas readable.

use std::borrow::Borrow;
use std::ops::{Add, Div, Mul, Neg, Sub};

use astro_float::{BigFloat, Consts, RoundingMode, Sign};

use super::ReferenceError;
use crate::model::Vector;
use crate::model::double_double::DoubleDouble;

/// Bits of every number: 38 digits.
const BITS: usize = 128;
const ROUNDING: RoundingMode = RoundingMode::ToEven;

/// A real number.
#[derive(Debug, Clone, PartialEq, PartialOrd)]
pub(super) struct Real(BigFloat);

impl Real {
    pub fn sqrt(&self) -> Self {
        Self(self.0.sqrt(BITS, ROUNDING))
    }

    pub fn square(&self) -> Self {
        self * self
    }

    /// Returns the number rounded towards zero to a double.
    pub fn rounded(&self) -> f64 {
        let Some((words, _, sign, exponent, _)) = self.0.as_raw_parts() else { return f64::NAN };
        let leading = words.last().copied().unwrap_or(0) >> 11;
        // The number is 0.leading... times 2^exponent; two factors, because one alone may overflow.
        let exponent = exponent - 53;
        let half = exponent / 2;
        let size = leading as f64 * 2f64.powi(half) * 2f64.powi(exponent - half);
        if sign == Sign::Neg { -size } else { size }
    }

    /// Returns the number that is a sum of two doubles.
    pub fn of_sum(DoubleDouble { high, low }: DoubleDouble) -> Self {
        Self::from(high) + Self::from(low)
    }

    /// Returns the number to 106 bits.
    pub fn split(&self) -> DoubleDouble {
        let high = self.rounded();
        // After rounding towards zero, the rest may be more than half a unit of the last place.
        DoubleDouble::sum(high, (self - Self::from(high)).rounded())
    }
}

impl From<f64> for Real {
    fn from(number: f64) -> Self {
        Self(BigFloat::from_f64(number, BITS))
    }
}

/// The operator between any two of `Real` and `&Real`.
macro_rules! operator {
    ($operator:ident, $method:ident, $computed:ident) => {
        impl<R: Borrow<Real>> $operator<R> for &Real {
            type Output = Real;
            fn $method(self, other: R) -> Real {
                Real(self.0.$computed(&other.borrow().0, BITS, ROUNDING))
            }
        }

        impl<R: Borrow<Real>> $operator<R> for Real {
            type Output = Real;
            fn $method(self, other: R) -> Real {
                (&self).$method(other)
            }
        }
    };
}

operator!(Add, add, add);
operator!(Sub, sub, sub);
operator!(Mul, mul, mul);
operator!(Div, div, div);

impl Neg for Real {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.neg())
    }
}

/// A point or a vector of the plane.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RealVector {
    pub x: Real,
    pub y: Real,
}

impl RealVector {
    pub fn dot(&self, other: &Self) -> Real {
        &self.x * &other.x + &self.y * &other.y
    }

    pub fn scaled(&self, by: &Real) -> Self {
        Self { x: &self.x * by, y: &self.y * by }
    }

    /// Returns the vector turned by a quarter turn, counter-clockwise.
    pub fn left(&self) -> Self {
        Self { x: -self.y.clone(), y: self.x.clone() }
    }

    /// Returns the vector turned by an angle below 1e-8, from the Taylor series of sine and cosine: the omitted terms
    /// are below 1e-42.
    pub fn turned_slightly(&self, angle: &Real) -> Self {
        let square = angle.square();
        let sine = angle * (Real::from(1.0) - &square / Real::from(6.0));
        let versine = &square / Real::from(2.0) * (Real::from(1.0) - &square / Real::from(12.0));
        let across = self.left().scaled(&sine);
        &(self - &self.scaled(&versine)) + &across
    }

    pub fn rounded(&self) -> Vector {
        Vector::new(self.x.rounded(), self.y.rounded())
    }
}

impl Add for &RealVector {
    type Output = RealVector;
    fn add(self, other: Self) -> RealVector {
        RealVector { x: &self.x + &other.x, y: &self.y + &other.y }
    }
}

impl Sub for &RealVector {
    type Output = RealVector;
    fn sub(self, other: Self) -> RealVector {
        RealVector { x: &self.x - &other.x, y: &self.y - &other.y }
    }
}

/// The transcendental functions, and the digits of pi and ln 2 found so far.
pub(super) struct Functions {
    constants: Consts,
}

impl Functions {
    /// # Errors
    /// [`ReferenceError::NoMemory`]
    pub fn new() -> Result<Self, ReferenceError> {
        Ok(Self { constants: Consts::new().map_err(ReferenceError::NoMemory)? })
    }

    /// Returns 2 pi.
    pub fn turn(&mut self) -> Real {
        Real::from(2.0) * Real(self.constants.pi(BITS, ROUNDING))
    }

    /// Returns the unit vector at an angle from x: cosine and sine.
    pub fn unit_vector(&mut self, angle: &Real) -> RealVector {
        let x = Real(angle.0.cos(BITS, ROUNDING, &mut self.constants));
        RealVector { x, y: Real(angle.0.sin(BITS, ROUNDING, &mut self.constants)) }
    }

    pub fn atan(&mut self, tangent: &Real) -> Real {
        Real(tangent.0.atan(BITS, ROUNDING, &mut self.constants))
    }

    pub fn ln(&mut self, number: &Real) -> Real {
        Real(number.0.ln(BITS, ROUNDING, &mut self.constants))
    }
}
