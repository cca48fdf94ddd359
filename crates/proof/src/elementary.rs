//! Sine, cosine, logarithm and arctangent of intervals, by series with the remainder of Taylor's formula or of a
//! geometric series.

use std::sync::LazyLock;

use super::interval::Interval;

/// Terms of the series of sine and of cosine for [`NEAR`], at most 0.8: the remainder is at most 0.8^33 / 33! < 1e-40.
const TERMS: usize = 16;
/// Terms of the same series for an angle of at most 0.02: the remainder is at most 0.02^16 / 16! < 1e-40.
const NEAR_TERMS: usize = 8;
/// The number of angles in a radian whose sine and cosine are kept.
const PER_RADIAN: f64 = 32.0;
/// Terms of the series of arctangent and of its hyperbolic twin: for |z| <= 0.34 the remainder is below 1e-42.
const SLOW_TERMS: usize = 45;

/// Pi / 2.
static QUARTER: LazyLock<Interval> = LazyLock::new(|| atan(&Interval::new(1.0)) * Interval::new(2.0));
/// 1 / n! for n up to 2 `TERMS` + 1.
static INVERSE_FACTORIALS: LazyLock<Vec<Interval>> = LazyLock::new(|| {
    let first = std::iter::once(Interval::new(1.0));
    let rest = (1..=2 * TERMS + 1).scan(Interval::new(1.0), |last, n| {
        *last = *last / Interval::new(n as f64);
        Some(*last)
    });
    first.chain(rest).collect()
});
/// Sine and cosine of k / [`PER_RADIAN`] for k from 0 to 26.
static NEAR: LazyLock<Vec<(Interval, Interval)>> = LazyLock::new(|| {
    (0..=26).map(|k| series(&(Interval::new(f64::from(k)) / Interval::new(PER_RADIAN)), TERMS)).collect()
});
static LN_2: LazyLock<Interval> = LazyLock::new(|| {
    let third = Interval::new(1.0) / Interval::new(3.0);
    odd_series(&third, 1.0) * Interval::new(2.0)
});

/// Returns `turns` full turns in radians.
pub(super) fn turns(turns: f64) -> Interval {
    *QUARTER * Interval::new(4.0) * Interval::new(turns)
}

/// Returns a quarter of a turn in radians.
pub(super) fn quarter_turn() -> &'static Interval {
    &QUARTER
}

/// Returns sine and cosine.
pub(super) fn sin_cos(angle: &Interval) -> (Interval, Interval) {
    let quarters = (angle.rough() / std::f64::consts::FRAC_PI_2).round();
    let rest = angle - *QUARTER * Interval::new(quarters);
    // After too many quarter turns the rest is unknown, and so are the values.
    if !(quarters.abs() < 1e15 && rest.abs().is_below(&Interval::new(0.8))) {
        let anything = Interval::new(1.0).around_zero();
        return (anything, anything);
    }
    let (sine, cosine) = near_zero(&rest);
    match (quarters as i64).rem_euclid(4) {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

/// Returns sine and cosine of an angle of at most 0.8: those of the nearest angle that is kept, turned by the rest.
fn near_zero(angle: &Interval) -> (Interval, Interval) {
    let k = (angle.rough() * PER_RADIAN).round();
    // At most 26, as the angle is at most 0.8.
    let (kept_sine, kept_cosine) = &NEAR[k.abs() as usize];
    let kept_sine = if k < 0.0 { -kept_sine } else { *kept_sine };
    let rest = angle - Interval::new(k) / Interval::new(PER_RADIAN);
    if !rest.abs().is_below(&Interval::new(0.02)) {
        // A wide interval.
        return series(angle, TERMS);
    }
    let (sine, cosine) = series(&rest, NEAR_TERMS);
    (kept_sine * cosine + kept_cosine * sine, kept_cosine * cosine - kept_sine * sine)
}

/// Returns sine and cosine of an angle of at most 0.8. The remainder after the power n of Taylor's formula is at most
/// |angle|^(n + 1) / (n + 1)!, since no derivative is greater than 1.
fn series(angle: &Interval, terms: usize) -> (Interval, Interval) {
    let square = -angle.square();
    // Horner's scheme in -angle^2 from the last term. Its coefficient includes the remainder, since |angle| <= 1.
    let sum = |first: usize| {
        let last = first + 2 * terms;
        (0..terms).rev().fold(INVERSE_FACTORIALS[last].around_zero(), |sum, term| {
            sum * square + INVERSE_FACTORIALS[first + 2 * term]
        })
    };
    (sum(1) * angle, sum(0))
}

/// Returns z + s z^3 / 3 + z^5 / 5 + s z^7 / 7 + ..., with s = `sign`. The sum is the arctangent for -1, its hyperbolic
/// twin for 1. The remainder after n terms is at most |z|^(2 n + 1) / (1 - z^2).
fn odd_series(z: &Interval, sign: f64) -> Interval {
    if !z.abs().is_below(&Interval::new(0.34)) {
        return Interval::new(0.0) / Interval::new(0.0);
    }
    let square = z.square() * Interval::new(sign);
    // 1 / (1 - 0.34^2) < 2.
    let rest = Interval::new(2.0).around_zero();
    let sum = (0..SLOW_TERMS)
        .rev()
        .fold(rest, |sum, term| sum * square + Interval::new(1.0) / Interval::new((2 * term + 1) as f64));
    sum * z
}

/// Returns the arctangent of a number of at least 0. The arctangent grows, so that the arctangents of the ends are
/// enough.
pub(super) fn atan(tangent: &Interval) -> Interval {
    let lower = -(-tangent).upper();
    atan_at(&lower).hull(&atan_at(&tangent.upper()))
}

/// Returns the arctangent of a number of at least 0. Four halvings bring its angle to at most pi / 32.
fn atan_at(tangent: &Interval) -> Interval {
    let one = Interval::new(1.0);
    // tan(a / 2) = tan(a) / (1 + sqrt(1 + tan(a)^2)).
    let halved = |t: Interval| t / (one + (one + t.square()).sqrt());
    let small = (0..4).fold(*tangent, |t, _| halved(t));
    odd_series(&small, -1.0) * Interval::new(16.0)
}

/// Returns the natural logarithm of a positive number: ln(2^k y) = k ln 2 + 2 artanh((y - 1) / (y + 1)).
pub(super) fn ln(number: &Interval) -> Interval {
    let exponent = number.rough().log2().round().clamp(-1000.0, 1000.0);
    // Two to the power of `-exponent`, bit by bit.
    let y = number * Interval::new(f64::from_bits(((1023.0 - exponent) as u64) << 52));
    let one = Interval::new(1.0);
    let z = (y - one) / (y + one);
    *LN_2 * Interval::new(exponent) + odd_series(&z, 1.0) * Interval::new(2.0)
}
