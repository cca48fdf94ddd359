//! The few functions of which the fast solvers consist, on four numbers at once: no branch, no call, no table. Called by
//! the solvers only.

use std::f64::consts::{PI, TAU};

use super::lanes::{Bits, Lanes};

/// The value of a polynomial of 6 coefficients, given from the lowest power up, with `square` = x^2: in pairs (Estrin's
/// scheme), since a vector waits far longer for a result than it takes to work out another beside it.
#[inline(always)]
fn polynomial<L: Lanes>(x: L, square: L, [a, b, c, d, e, f]: [f64; 6]) -> L {
    let pair = |low: f64, high: f64| L::all(high).multiply_add(x, L::all(low));
    pair(e, f).multiply_add(square, pair(c, d)).multiply_add(square, pair(a, b))
}

/// Sine and cosine of an angle of at most pi / 4 either way, to about 1 unit in the last place.
///
/// Minimax coefficients of fdlibm's `__kernel_sin` and `__kernel_cos` (Sun Microsystems, 1993).
#[inline(always)]
#[allow(clippy::excessive_precision, reason = "the digits as published")]
pub(super) fn sine_cosine<L: Lanes>(angle: L) -> (L, L) {
    let square = angle * angle;
    let fourth = square * square;
    let sine = polynomial(
        square,
        fourth,
        [
            -1.66666666666666324348e-01,
            8.33333333332248946124e-03,
            -1.98412698298579493134e-04,
            2.75573137070700676789e-06,
            -2.50507602534068634195e-08,
            1.58969099521155010221e-10,
        ],
    );
    let cosine = polynomial(
        square,
        fourth,
        [
            4.16666666666666019037e-02,
            -1.38888888888741095749e-03,
            2.48015872894767294178e-05,
            -2.75573143513906633035e-07,
            2.08757232129817482790e-09,
            -1.13596475577881948265e-11,
        ],
    );
    let one = L::all(1.0);
    let half = L::all(0.5) * square;
    let one_less_half = one - half;
    let lost = (one - one_less_half) - half;
    ((angle * square).multiply_add(sine, angle), one_less_half + fourth.multiply_add(cosine, lost))
}

/// The largest angle of [`small_sine_cosine`], radians.
pub(super) const SMALL_ANGLE: f64 = 0.2;

/// Sine and cosine of an angle of at most [`SMALL_ANGLE`] either way, to 1e-15: their series up to x^9 and x^10, the next
/// terms being 5e-16 and 9e-18 at most.
#[inline(always)]
pub(super) fn small_sine_cosine<L: Lanes>(angle: L) -> (L, L) {
    let square = angle * angle;
    let series = |terms: &[f64]| {
        let (last, others) = terms.split_last().map_or((0.0, terms), |(last, others)| (*last, others));
        others.iter().rev().fold(L::all(last), |sum, term| sum.multiply_add(square, L::all(*term)))
    };
    let sine = series(&[-1.0 / 6.0, 1.0 / 120.0, -1.0 / 5_040.0, 1.0 / 362_880.0]);
    let cosine = series(&[1.0, -1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0, -1.0 / 3_628_800.0]);
    ((angle * square).multiply_add(sine, angle), cosine)
}

/// Sine and cosine of a small angle turned by so many quarter turns (modulo 4).
#[inline(always)]
pub(super) fn turned_by_quarters<L: Lanes>(quadrant: L::Bits, (sine, cosine): (L, L)) -> (L, L) {
    // Bit 1 of the quadrant, as a sign.
    let sign = |quadrant: L::Bits| quadrant.up::<62>().and(L::Bits::all(1 << 63));
    let s = sine.or_if_odd(cosine, quadrant);
    let c = cosine.or_if_odd(sine, quadrant);
    let next = quadrant.plus(L::Bits::all(1));
    (L::from_bits(s.bits().xor(sign(quadrant))), L::from_bits(c.bits().xor(sign(next))))
}

/// 1.5 * 2^52: adding it rounds to a whole number, which then stands in the lowest bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Sine and cosine of half of `turns` turns, `turns` from 0 to 1.
#[inline(always)]
pub(super) fn sine_cosine_of_half<L: Lanes>(turns: L) -> (L, L) {
    let shifted = L::all(2.0).multiply_add(turns, L::all(ROUNDER));
    let quarters = shifted - L::all(ROUNDER);
    let part = turns - L::all(0.5) * quarters;
    turned_by_quarters(shifted.bits().and(L::Bits::all(3)), sine_cosine(L::all(PI) * part))
}

/// A fraction of a turn as quarter turns and what is left.
pub(super) struct Quarters<L: Lanes> {
    /// 0 to 3: the quarters modulo 4.
    pub quadrant: L::Bits,
    /// The same as numbers.
    pub quarters: L,
    /// What is left, from -1/8 to 1/8 turns, to the nearest 2^-54.
    pub part: L,
    /// What is left beyond `part`, to the last bit.
    pub rest: L,
}

/// A fraction of a turn in units of 2^-64 as quarter turns and what is left.
#[inline(always)]
pub(super) fn quarters<L: Lanes>(fraction: L::Bits) -> Quarters<L> {
    // 2^52 as bits: with a number below 2^52 in the lowest bits, the double is 2^52 plus that number. AVX2 has no
    // conversion of 64-bit numbers.
    const TWO_TO_52: u64 = 0x4330_0000_0000_0000;
    const HALF_OF_2_TO_MINUS_54: u64 = 1 << 9;
    let base = L::Bits::all(TWO_TO_52);
    let raised = fraction.plus(L::Bits::all((1 << 61) + HALF_OF_2_TO_MINUS_54));
    let quadrant = raised.down::<62>();
    let left = raised.up::<2>();
    // The upper bits count 2^-54 turns, from -1/8 turn; the lower twelve 2^-66 turns, from -2^-55 turns.
    let upper = L::from_bits(left.down::<12>().or(base));
    let upper_zero = L::all(4_503_599_627_370_496.0 + 2_251_799_813_685_248.0);
    let lower = L::from_bits(left.and(L::Bits::all(0xfff)).or(base));
    let lower_zero = L::all(4_503_599_627_370_496.0 + 2048.0);
    Quarters {
        quadrant,
        quarters: L::from_bits(quadrant.or(base)) - L::all(4_503_599_627_370_496.0),
        part: (upper - upper_zero) * L::all(1.0 / 18_014_398_509_481_984.0),
        rest: (lower - lower_zero) * L::all(1.0 / 73_786_976_294_838_206_464.0),
    }
}

/// The multiple of 1/4 nearest to a number below 2^49.
#[inline(always)]
pub(super) fn to_quarter<L: Lanes>(number: L) -> L {
    // 1.5 * 2^50, whose last bit counts 1/4.
    let rounder = L::all(1_688_849_860_263_936.0);
    (number + rounder) - rounder
}

/// A number of turns below 2^51 brought into (-1/2, 1/2].
#[inline(always)]
pub(super) fn within_half_turn<L: Lanes>(turns: L) -> L {
    (turns - ((turns + L::all(ROUNDER)) - L::all(ROUNDER))).wrapped_up_from(-0.5)
}

/// A number of turns from 0 to 1 as a whole number of 2^-64 turns, to the nearest.
#[inline(always)]
pub(super) fn fixed_point<L: Lanes>(turns: L) -> L::Bits {
    // Each sum leaves a whole number of 2^-32, then of 2^-64, in the lowest bits.
    const TO_32_BITS: f64 = 1_048_576.0;
    const TO_64_BITS: f64 = 1.5 / 4096.0;
    let shifted = turns + L::all(TO_32_BITS);
    let rest = (turns - (shifted - L::all(TO_32_BITS))) + L::all(TO_64_BITS);
    let lower = rest.bits().minus(L::Bits::all(TO_64_BITS.to_bits()));
    // Moved up, the bits of 2^20 itself are gone.
    shifted.bits().up::<32>().plus(lower)
}

/// The largest argument of [`short_arc_tangent_in_turns`].
pub(super) const SHORT_ARC_TANGENT: f64 = 0.09;

/// The arc tangent of a number of at most [`SHORT_ARC_TANGENT`] either way, in turns: its series up to x^13, the next
/// term being below 1.6e-16 / 10 times x.
#[inline(always)]
pub(super) fn short_arc_tangent_in_turns<L: Lanes>(x: L) -> L {
    let square = x * x;
    let fourth = square * square;
    let series = polynomial(square, fourth, [-1.0 / 3.0, 1.0 / 5.0, -1.0 / 7.0, 1.0 / 9.0, -1.0 / 11.0, 1.0 / 13.0]);
    (x * square).multiply_add(series, x) * L::all(1.0 / TAU)
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Portable, PortableBits, Row};
    use super::*;
    use crate::geometry::spiral::Angle;

    fn one(lanes: Portable) -> f64 {
        lanes.row().0[0]
    }

    fn four(number: f64) -> Portable {
        Portable::all(number)
    }

    #[test]
    fn sines_and_cosines_are_true_to_the_last_digit() {
        for k in 0..100_000u64 {
            let fraction = k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let found = quarters::<Portable>(PortableBits::all(fraction));
            let angle = four(TAU).multiply_add(found.part, four(TAU) * found.rest);
            let (sine, cosine) = turned_by_quarters(found.quadrant, sine_cosine(angle));
            let (quarters, part) = (one(found.quarters), one(found.part));
            let turns = fraction as f64 / 2f64.powi(64);
            // A single double has lost the fraction's last bits.
            let (upper, lower) = ((fraction >> 32) as f64 / 2f64.powi(32), fraction as u32 as f64 / 2f64.powi(64));
            let (true_sine, true_cosine) = Angle::from_turns(upper).plus(TAU * lower).sin_cos();
            assert!((one(sine) - true_sine).abs() < 3e-16 && (one(cosine) - true_cosine).abs() < 3e-16, "{turns}");
            let error = (0.25 * quarters + part - turns).rem_euclid(1.0);
            assert!(error.min(1.0 - error) < 2e-16 && part.abs() <= 0.125, "{turns}");
            let (sine, cosine) = sine_cosine_of_half(four(turns.min(0.999)));
            let (true_sine, true_cosine) = (PI * turns.min(0.999)).sin_cos();
            assert!((one(sine) - true_sine).abs() < 6e-16 && (one(cosine) - true_cosine).abs() < 6e-16, "{turns}");
        }
    }

    #[test]
    fn sines_and_cosines_of_small_angles_are_true() {
        for k in -1000..=1000 {
            let angle = SMALL_ANGLE * f64::from(k) / 1000.0;
            let (sine, cosine) = small_sine_cosine(four(angle));
            assert!((one(sine) - angle.sin()).abs() < 6e-16 && (one(cosine) - angle.cos()).abs() < 3e-16, "{angle}");
        }
    }

    #[test]
    fn fixed_point_turns_are_exact_to_their_last_bit() {
        for turns in [0.0, 1e-18, 0.25, 1.0 / 3.0, 0.5, 0.987_654_321, 1.0 - f64::EPSILON] {
            let truth = turns * 2f64.powi(64);
            let fixed = one(Portable::from_bits(fixed_point(four(turns)))).to_bits();
            assert!((fixed as f64 - truth).abs() <= 1.0 + truth * f64::EPSILON, "{turns}");
        }
    }

    #[test]
    fn turns_are_brought_within_half_a_turn() {
        for (turns, within) in [(0.5, 0.5), (-0.5, 0.5), (1.5, 0.5), (0.75, -0.25), (1.25, 0.25), (-1.0, 0.0)] {
            assert_eq!(one(within_half_turn(four(turns))), within);
        }
        assert_eq!((one(to_quarter(four(1e9 + 0.26))), one(to_quarter(four(0.1)))), (1e9 + 0.25, 0.0));
    }

    #[test]
    fn the_short_arc_tangent_is_true_over_its_range() {
        for k in -90..=90 {
            let x = f64::from(k) * 1e-3;
            let turns = one(short_arc_tangent_in_turns(four(x)));
            assert!((TAU * turns - x.atan()).abs() <= 3.0 * f64::EPSILON * x.abs());
        }
    }

    #[test]
    fn rows_become_columns() {
        let rows = [0.0, 10.0, 20.0, 30.0].map(|ten| Portable::load(&Row([ten, ten + 1.0, ten + 2.0, ten + 3.0])));
        assert_eq!(Portable::transposed(rows)[1].row().0, [1.0, 11.0, 21.0, 31.0]);
    }
}
