//! The few functions of one number of which the kernel consists, written so that a compiler turns a loop over them
//! into vector instructions: no branch, no call, no table. Called by the kernel only.

use std::f64::consts::{PI, TAU};

/// How a product and a sum are rounded: what differs between the code paths.
pub(super) trait Arithmetic {
    /// `x * y + z`.
    fn multiply_add(x: f64, y: f64, z: f64) -> f64;
}

/// One rounding, for processors that have the instruction.
pub(super) struct Fused;

impl Arithmetic for Fused {
    #[inline(always)]
    fn multiply_add(x: f64, y: f64, z: f64) -> f64 {
        x.mul_add(y, z)
    }
}

/// Two roundings: without the instruction, one rounding is a slow library call.
pub(super) struct Separate;

impl Arithmetic for Separate {
    #[inline(always)]
    fn multiply_add(x: f64, y: f64, z: f64) -> f64 {
        x * y + z
    }
}

/// The value of a polynomial with the coefficients given from the highest power down.
#[inline(always)]
fn polynomial<A: Arithmetic, const N: usize>(x: f64, coefficients: [f64; N]) -> f64 {
    let mut value = coefficients[0];
    for coefficient in &coefficients[1..] {
        value = A::multiply_add(value, x, *coefficient);
    }
    value
}

/// Sine and cosine of an angle of at most pi / 4 either way, to about 1 unit in the last place.
///
/// Minimax coefficients of fdlibm's `__kernel_sin` and `__kernel_cos` (Sun Microsystems, 1993).
#[inline(always)]
#[allow(clippy::excessive_precision, reason = "the digits as published")]
pub(super) fn sine_cosine<A: Arithmetic>(angle: f64) -> (f64, f64) {
    let square = angle * angle;
    let sine = polynomial::<A, 6>(
        square,
        [
            1.58969099521155010221e-10,
            -2.50507602534068634195e-08,
            2.75573137070700676789e-06,
            -1.98412698298579493134e-04,
            8.33333333332248946124e-03,
            -1.66666666666666324348e-01,
        ],
    );
    let cosine = polynomial::<A, 6>(
        square,
        [
            -1.13596475577881948265e-11,
            2.08757232129817482790e-09,
            -2.75573143513906633035e-07,
            2.48015872894767294178e-05,
            -1.38888888888741095749e-03,
            4.16666666666666019037e-02,
        ],
    );
    let half = 0.5 * square;
    let one_less_half = 1.0 - half;
    let lost = (1.0 - one_less_half) - half;
    (A::multiply_add(angle * square, sine, angle), one_less_half + A::multiply_add(square * square, cosine, lost))
}

/// The number with its sign turned round where bit 1 of `quadrant` is set.
#[inline(always)]
fn negated_by(quadrant: u64, number: f64) -> f64 {
    f64::from_bits(number.to_bits() ^ ((quadrant & 2) << 62))
}

/// Sine and cosine of a small angle turned by so many quarter turns (modulo 4).
#[inline(always)]
fn turned_by_quarters(quadrant: u64, (sine, cosine): (f64, f64)) -> (f64, f64) {
    let swapped = quadrant & 1 == 1;
    let (s, c) = if swapped { (cosine, sine) } else { (sine, cosine) };
    (negated_by(quadrant, s), negated_by(quadrant.wrapping_add(1), c))
}

/// Sine and cosine of half of `turns` turns, `turns` from 0 to 1.
#[inline(always)]
pub(super) fn sine_cosine_of_half<A: Arithmetic>(turns: f64) -> (f64, f64) {
    // Adding 1.5 * 2^52 rounds to a whole number, which then stands in the lowest bits.
    const ROUNDER: f64 = 6_755_399_441_055_744.0;
    let shifted = 2.0 * turns + ROUNDER;
    let quarters = shifted - ROUNDER;
    let part = turns - 0.5 * quarters;
    turned_by_quarters(shifted.to_bits() & 3, sine_cosine::<A>(PI * part))
}

/// Sine and cosine of an angle given as a fraction of a turn in units of 2^-64, and the fraction itself as a number.
#[inline(always)]
pub(super) fn sine_cosine_of_fraction<A: Arithmetic>(fraction: u64) -> (f64, f64, f64) {
    // From 0 to 4: a fraction just below a whole turn belongs to the next one.
    let quadrant = ((fraction >> 61) + 1) >> 1;
    let part = signed_fraction(fraction.wrapping_sub(quadrant << 62));
    let (sine, cosine) = turned_by_quarters(quadrant, sine_cosine::<A>(TAU * part));
    let whole = A::multiply_add(0.25, from_small(quadrant), part);
    (sine, cosine, whole)
}

/// 2^52 as bits: with a number below 2^52 in the lowest bits, the double is 2^52 plus that number.
const TWO_TO_52: u64 = 0x4330_0000_0000_0000;

/// A whole number below 2^52 as a double. AVX2 has no such instruction for 64-bit numbers.
#[inline(always)]
pub(super) fn from_small(number: u64) -> f64 {
    f64::from_bits(number | TWO_TO_52) - f64::from_bits(TWO_TO_52)
}

/// A fraction of a turn in units of 2^-64, taken as signed, as a double from -1/2 to 1/2, rounded once.
#[inline(always)]
pub(super) fn signed_fraction(fraction: u64) -> f64 {
    // The upper half is put where it counts 2^32 each, beside 2^84; 2^63 is added to it to make it positive.
    const TWO_TO_84: u64 = 0x4530_0000_0000_0000;
    const TWO_TO_84_AND_63: f64 = 19_342_813_113_834_066_795_298_816.0 + 9_223_372_036_854_775_808.0;
    let upper = f64::from_bits(((fraction >> 32) ^ 0x8000_0000) | TWO_TO_84) - TWO_TO_84_AND_63;
    (upper + from_small(fraction & 0xffff_ffff)) * (1.0 / 18_446_744_073_709_551_616.0)
}

/// A number of turns from 0 to 1 as a whole number of 2^-64 turns, to the nearest.
#[inline(always)]
pub(super) fn fixed_point(turns: f64) -> u64 {
    // Each sum leaves a whole number of 2^-32, then of 2^-64, in the lowest bits.
    const TO_32_BITS: f64 = 1_048_576.0;
    const TO_64_BITS: f64 = 1.5 / 4096.0;
    let shifted = turns + TO_32_BITS;
    let rest = (turns - (shifted - TO_32_BITS)) + TO_64_BITS;
    let upper = shifted.to_bits().wrapping_sub(TO_32_BITS.to_bits());
    let lower = rest.to_bits().wrapping_sub(TO_64_BITS.to_bits());
    (upper << 32).wrapping_add(lower)
}

/// The largest argument of [`short_arc_tangent`].
pub(super) const SHORT_ARC_TANGENT: f64 = 0.12;

/// The arc tangent of a number of at most [`SHORT_ARC_TANGENT`] either way: its series up to x^15, the next term being
/// below 1.3e-17 times x.
#[inline(always)]
pub(super) fn short_arc_tangent<A: Arithmetic>(x: f64) -> f64 {
    let square = x * x;
    let series = polynomial::<A, 7>(
        square,
        [-1.0 / 15.0, 1.0 / 13.0, -1.0 / 11.0, 1.0 / 9.0, -1.0 / 7.0, 1.0 / 5.0, -1.0 / 3.0],
    );
    A::multiply_add(x * square, series, x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_and_cosines_are_true_to_the_last_digit() {
        for k in 0..100_000u64 {
            let fraction = k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let (sine, cosine, whole) = sine_cosine_of_fraction::<Fused>(fraction);
            let turns = fraction as f64 / 2f64.powi(64);
            // Near whole quarters the system's function, given one double, is the less exact one.
            let (true_sine, true_cosine) = (TAU * turns).sin_cos();
            assert!((sine - true_sine).abs() < 1.2e-15 && (cosine - true_cosine).abs() < 1.2e-15, "{turns}");
            assert!((whole - turns).abs() < 2e-16, "{turns}");
            let (sine, cosine) = sine_cosine_of_half::<Fused>(turns.min(0.999));
            let (true_sine, true_cosine) = (PI * turns.min(0.999)).sin_cos();
            assert!((sine - true_sine).abs() < 6e-16 && (cosine - true_cosine).abs() < 6e-16, "{turns}");
        }
    }

    #[test]
    fn fixed_point_turns_are_exact_to_their_last_bit() {
        for turns in [0.0, 1e-18, 0.25, 1.0 / 3.0, 0.5, 0.987_654_321, 1.0 - f64::EPSILON] {
            let truth = turns * 2f64.powi(64);
            assert!((fixed_point(turns) as f64 - truth).abs() <= 1.0 + truth * f64::EPSILON, "{turns}");
        }
        assert_eq!(signed_fraction(1 << 62), 0.25);
        assert_eq!(signed_fraction(3 << 62), -0.25);
    }

    #[test]
    fn the_short_arc_tangent_is_true_over_its_range() {
        for k in -120..=120 {
            let x = f64::from(k) * 1e-3;
            assert!((short_arc_tangent::<Separate>(x) - x.atan()).abs() <= 2.0 * f64::EPSILON * x.abs());
        }
    }
}
