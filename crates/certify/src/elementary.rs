//! Enclosures of pi, sine and cosine, arctangent and logarithm, from their series.

use std::sync::LazyLock;

use super::interval::Interval;

/// Pi / 2 as a sum of three doubles of at most 26 bits each: their products with a whole number below 2^27 are exact.
const HALF_PI: [f64; 3] = [1.5707963109016418, 1.5893254712295857e-8, 6.123233932053594e-17];

/// An upper bound of pi / 2 minus the sum of [`HALF_PI`].
const HALF_PI_REST: f64 = 6.4e-25;

/// The greatest argument of [`sin_cos`]. Beyond it the result is the whole range.
const GREATEST_ARGUMENT: f64 = 2e8;

/// Returns pi.
pub(super) fn pi() -> Interval {
    let [high, middle, low] = HALF_PI.map(Interval::point);
    (high + (middle + (low + Interval { lo: 0.0, hi: HALF_PI_REST }))) * 2.0
}

/// Returns sine and cosine of a double.
///
/// x = q pi / 2 + y with |y| <= 0.79, y = k / 128 + z with |z| <= 0.0040, and with the kept s and c of k / 128
///
/// sin y = s + (c sin z - s (1 - cos z)),   cos y = c - (s sin z + c (1 - cos z)).
///
/// The brackets are below 0.0041, so that they are computed in doubles. Every operation is off by at most u = 2^-52 of
/// its result, in any rounding mode. Errors by underflow are below the last places that are added at the end.
pub(super) fn sin_cos(x: f64) -> (Interval, Interval) {
    if x.is_nan() || x.abs() > GREATEST_ARGUMENT {
        let any = Interval::within(1.0);
        return (any, any);
    }
    let quarters = rounded(x * std::f64::consts::FRAC_2_PI);
    let [high, middle, low] = HALF_PI.map(|part| part * quarters);
    // The difference is exact: `high` is 0, or both are within a factor of 2 of each other (Sterbenz). The factor holds
    // since q = 1 begins at x = pi / 4, just above `high` / 2.
    let first = x - high;
    let rest = middle + low;
    // y = about + lost, by Knuth's two-sum.
    let about = first - rest;
    let back = about - first;
    let lost = (first - (about - back)) - (rest + back);
    let k = rounded(about * PER_RADIAN);
    let z = (about - k / PER_RADIAN) + lost;
    let Kept { sine, cosine, error } = NEAR[k.abs() as usize];
    let sine = sine.copysign(k);
    let square = z * z;
    // The remainders are below z 2^-60 and 2^-79.
    let sine_of_rest = z - z * square * (1.0 / 6.0 - square * (1.0 / 120.0));
    let versine_of_rest = square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0)));
    // In units of u z, the error is 2 from z, 1 from its sine and 1 from the product with it. The bracket's sum adds 1,
    // and the remainders and all that has the factor z or u add less than 1. In units of u, the sum `rest` adds its
    // own size. `lost`, below u, is off by u^2, and q pi / 2 by q HALF_PI_REST: together below 7e-25 q.
    let error = error + f64::EPSILON * (6.0 * z.abs() + rest.abs()) + 7e-25 * quarters.abs();
    let around = |kept: f64, bracket: f64| {
        let sum = kept + bracket;
        // One place for each of the sums; 1.02 is for the rounding of the error, and for the brackets' kept numbers.
        let (lo, hi) = (sum.next_down() - 1.02 * error, sum.next_up() + 1.02 * error);
        Interval { lo: lo.next_down().max(-1.0), hi: hi.next_up().min(1.0) }
    };
    let sine_of_y = around(sine, cosine * sine_of_rest - sine * versine_of_rest);
    let cosine_of_y = around(cosine, -(sine * sine_of_rest + cosine * versine_of_rest));
    // A whole number below 2^27 is exact in both types.
    match (quarters as i64).rem_euclid(4) {
        0 => (sine_of_y, cosine_of_y),
        1 => (cosine_of_y, -sine_of_y),
        2 => (-sine_of_y, -cosine_of_y),
        _ => (-cosine_of_y, sine_of_y),
    }
}

/// Returns a whole number within 0.5 of a number below 2^52, and a little more in case of rounding.
fn rounded(x: f64) -> f64 {
    ((x.abs() + 0.5) as i64 as f64).copysign(x)
}

/// The number of angles in a radian whose sine and cosine are kept.
const PER_RADIAN: f64 = 128.0;

/// Sine and cosine of an angle, both off by at most `error`.
#[derive(Debug, Clone, Copy)]
struct Kept {
    sine: f64,
    cosine: f64,
    error: f64,
}

/// Sine and cosine of k / [`PER_RADIAN`] for k from 0 to 101. Their series end with y^19 and y^20. Terms alternate and
/// fall, so the remainders are below the next terms, for the sine's factor (101 / 128)^20 / 21! < 2e-22.
static NEAR: LazyLock<[Kept; 102]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        if k == 0 {
            return Kept { sine: 0.0, cosine: 1.0, error: 0.0 };
        }
        let y = Interval::point(k as f64 / PER_RADIAN);
        let (square, remainder) = (y.square(), Interval::within(2e-22));
        let sine = y * (alternating(square, &ODD) + remainder);
        let cosine = alternating(square, &EVEN) + remainder;
        let error = (sine - Interval::point(sine.middle())).magnitude();
        let error = error.max((cosine - Interval::point(cosine.middle())).magnitude());
        Kept { sine: sine.middle(), cosine: cosine.middle(), error }
    })
});

/// Enclosures of the reciprocals of the divisors n (n - 1) of the terms of the sine. Each term is the term before it
/// times -y^2 over its divisor.
const ODD: [Interval; 9] = reciprocals([6.0, 20.0, 42.0, 72.0, 110.0, 156.0, 210.0, 272.0, 342.0]);

/// The same for the cosine.
const EVEN: [Interval; 10] = reciprocals([2.0, 12.0, 30.0, 56.0, 90.0, 132.0, 182.0, 240.0, 306.0, 380.0]);

/// Returns enclosures of the reciprocals of whole numbers below 2^53: they have one rounding.
const fn reciprocals<const N: usize>(divisors: [f64; N]) -> [Interval; N] {
    let mut reciprocals = [Interval::ONE; N];
    let mut n = 0;
    while n < N {
        let reciprocal = 1.0 / divisors[n];
        reciprocals[n] = Interval { lo: reciprocal.next_down(), hi: reciprocal.next_up() };
        n += 1;
    }
    reciprocals
}

/// Returns 1 - s q1 (1 - s q2 (1 - ...)) for s from 0 to 1, the sum of a series. The terms of this series have the
/// factors -s q1, -s q2 and so on. All partial sums are from 0 to 1, so that the ends of products are the products of
/// ends.
fn alternating(s: Interval, factors: &[Interval]) -> Interval {
    factors.iter().rev().fold(Interval::ONE, |sum, factor| {
        let least = ((s.lo.max(0.0) * factor.lo).next_down() * sum.lo).next_down();
        let most = ((s.hi * factor.hi).next_up() * sum.hi).next_up();
        Interval { lo: (1.0 - most).next_down().max(0.0), hi: (1.0 - least).next_up() }
    })
}

/// Returns the arctangent of a number of at least 0, which grows with the number.
pub(super) fn atan(x: Interval) -> Interval {
    let Interval { lo, hi } = x;
    Interval { lo: atan_of(lo).lo, hi: atan_of(hi).hi }
}

/// The identity atan x = 2 atan(x / (1 + sqrt(1 + x^2))) is applied four times. Then x < 0.0985, and the series to x^17
/// leaves less than x 0.0985^18 / 19 < 5e-20 x.
fn atan_of(x: f64) -> Interval {
    let mut reduced = Interval::point(x);
    for _ in 0..4 {
        reduced = reduced.over(Interval::ONE + (Interval::ONE + reduced.square()).sqrt());
        // The quotient grows with x to 1: values outside come from rounding.
        reduced = Interval { lo: reduced.lo.max(0.0), hi: reduced.hi.min(1.0) };
    }
    let square = reduced.square();
    let series = (0..9).rev().fold(Interval::ZERO, |sum, n| {
        let reciprocal = 1.0 / f64::from(2 * n + 1);
        Interval::outward(reciprocal, reciprocal) - square * sum
    });
    reduced * (series + Interval::within(5e-20)) * 16.0
}

/// Returns the natural logarithm of a positive number.
///
/// x = 2^k m with m from sqrt(1/2) to sqrt(2). ln m = 2 atanh z with z = (m - 1) / (m + 1), |z| < 0.172. The series to
/// z^21 leaves less than z^23 / 23 / (1 - z^2) < 1e-18 z.
pub(super) fn ln(x: Interval) -> Interval {
    let Interval { lo, hi } = x;
    Interval { lo: ln_of(lo).lo, hi: ln_of(hi).hi }
}

fn ln_of(x: f64) -> Interval {
    if !(f64::MIN_POSITIVE..f64::INFINITY).contains(&x) {
        return Interval { lo: f64::NEG_INFINITY, hi: f64::INFINITY };
    }
    let (exponent, mantissa) = split(x);
    let m = Interval::point(mantissa);
    let z = (m - Interval::ONE).over(m + Interval::ONE);
    let square = z.square();
    let series = (0..11).rev().fold(Interval::ZERO, |sum, n| {
        let reciprocal = 1.0 / f64::from(2 * n + 1);
        Interval::outward(reciprocal, reciprocal) + square * sum
    });
    let logarithm = z * (series + Interval::within(1e-18)) * 2.0;
    logarithm + LN_2 * f64::from(exponent)
}

/// ln 2 = 0.693147180559945309417...
const LN_2: Interval = Interval { lo: 0.693_147_180_559_945_2, hi: 0.693_147_180_559_945_4 };

/// Splits x = 2^exponent mantissa exactly, with a mantissa from 0.7 to 1.42.
fn split(x: f64) -> (i32, f64) {
    let bits = x.to_bits();
    // Eleven bits fit.
    let exponent = (bits >> 52) as i32 - 1023;
    let mantissa = f64::from_bits((bits & ((1 << 52) - 1)) | (1023 << 52));
    if mantissa > std::f64::consts::SQRT_2 { (exponent + 1, 0.5 * mantissa) } else { (exponent, mantissa) }
}
