//! Polynomials on -1..1 with given slopes, and how to shorten them.

use nalgebra::SMatrix;

/// Returns the polynomial of degree `N` with given slopes at `N` nodes; its constant is zero.
///
/// The fit uses no values, because half of their rounding would return in the slopes between them, and more in shorter
/// pieces. The proof uses values. If the slope's error comes from the first neglected power, so that it is zero at the
/// nodes, then the value's error is greatest at nodes.
#[derive(Debug, Clone)]
pub(super) struct SlopeFit<const N: usize> {
    from_slopes: SMatrix<f64, N, N>,
}

impl<const N: usize> SlopeFit<N> {
    /// For `N` different nodes.
    pub(super) fn new(nodes: &[f64; N]) -> Self {
        let slopes = SMatrix::<f64, N, N>::from_fn(|row, power| whole_power(nodes[row], power));
        Self { from_slopes: slopes.try_inverse().expect("different nodes determine the polynomial") }
    }

    /// Returns the coefficients from the first power on.
    pub(super) fn coefficients(&self, slopes: [f64; N]) -> [f64; N] {
        let slope: [f64; N] = (self.from_slopes * SMatrix::<f64, N, 1>::from(slopes)).into();
        std::array::from_fn(|power| slope[power] / (power + 1) as f64)
    }
}

/// Returns a power, always with the same rounding: the result of `powi` depends on whether the compiler knows the
/// number.
fn whole_power(number: f64, exponent: usize) -> f64 {
    let (mut power, mut square, mut left) = (1.0, number, exponent);
    loop {
        if left % 2 == 1 {
            power *= square;
        }
        left /= 2;
        if left == 0 {
            return power;
        }
        square *= square;
    }
}

/// Returns the polynomial of the fifth degree that is zero in the middle and has given slopes at -1, -1/2, 0, 1/2 and
/// 1. See [`SlopeFit`].
pub(super) fn from_slopes([a, b, c, d, e]: [f64; 5]) -> [f64; 6] {
    // Newton's divided differences of five equidistant numbers, by power.
    let (near, far) = (0.5 * (d - b), 0.5 * (e - a));
    let (near_bend, far_bend) = (0.5 * ((d - c) - (c - b)), 0.5 * ((e - c) - (c - a)));
    let linear = (8.0 * near - far) / 3.0;
    let cubic = far - linear;
    let square = (16.0 * near_bend - far_bend) / 3.0;
    let fourth = far_bend - square;
    [0.0, c, linear / 2.0, square / 3.0, cubic / 4.0, fourth / 5.0]
}

/// Returns value and slope at `beta`.
#[inline(always)]
pub(super) fn horner<const N: usize>(coefficients: &[f64; N], beta: f64) -> (f64, f64) {
    coefficients.iter().rev().fold((0.0, 0.0), |(value, slope), c| (value * beta + c, slope * beta + value))
}

/// Bounds of the change of a polynomial's value and slope in -1..1.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Change {
    pub value: f64,
    pub slope: f64,
}

/// Removes the powers from `keep` on from a polynomial of at most the fifth degree, and bounds the change. Each power
/// is replaced by the polynomial next to it (Lanczos' economisation; Press et al., Numerical Recipes, 3rd ed., section
/// 5.11). The difference is a Chebyshev polynomial, whose slope is at most the square of its degree.
pub(super) fn economise(coefficients: &mut [f64; 6], keep: usize) -> Change {
    /// The power less the Chebyshev polynomial of its degree, scaled: coefficients of the lower powers.
    const REPLACEMENTS: [[f64; 5]; 6] = [
        [0.0; 5],
        [0.0; 5],
        [0.5, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.75, 0.0, 0.0, 0.0],
        [-0.125, 0.0, 1.0, 0.0, 0.0],
        [0.0, -0.3125, 0.0, 1.25, 0.0],
    ];
    let mut bound = Change::default();
    for power in (keep..6).rev() {
        let taken = std::mem::take(&mut coefficients[power]);
        for (coefficient, share) in coefficients.iter_mut().zip(REPLACEMENTS[power]) {
            *coefficient += taken * share;
        }
        let size = taken.abs() / 2f64.powi(power as i32 - 1);
        bound.value += size;
        bound.slope += size * (power * power) as f64;
    }
    bound
}

/// Returns the same polynomial on a part of -1..1, given by its middle and half its length, again over -1..1.
pub(super) fn on_part(coefficients: &[f64; 6], middle: f64, half: f64) -> [f64; 6] {
    let mut part = *coefficients;
    for low in 0..5 {
        for power in (low..5).rev() {
            part[power] += middle * part[power + 1];
        }
    }
    let mut scale = 1.0;
    for coefficient in &mut part {
        *coefficient *= scale;
        scale *= half;
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_found_again_from_its_slopes() {
        let wanted = [0.0, -1.0, 0.5, 2.0, -0.7, 0.1];
        let found = from_slopes([-1.0, -0.5, 0.0, 0.5, 1.0].map(|beta| horner(&wanted, beta).1));
        let nodes = [-1.0, -0.6, 0.0, 0.7, 1.0];
        let fitted = SlopeFit::new(&nodes).coefficients(nodes.map(|beta| horner(&wanted, beta).1));
        for ((found, fitted), wanted) in found.into_iter().skip(1).zip(fitted).zip(wanted.into_iter().skip(1)) {
            assert!((found - wanted).abs() < 1e-14 && (fitted - wanted).abs() < 1e-14);
        }
    }

    #[test]
    fn a_shortened_polynomial_is_as_near_as_promised() {
        let whole = [0.3, -1.0, 0.5, 2.0, -0.7, 0.1];
        for keep in 2..6 {
            let mut shortened = whole;
            let bound = economise(&mut shortened, keep);
            assert!(shortened[keep..].iter().all(|c| *c == 0.0));
            let at = |coefficients, k: i32| horner(coefficients, 0.05 * f64::from(k));
            let value = |k: i32| (at(&whole, k).0 - at(&shortened, k).0).abs();
            let slope = |k: i32| (at(&whole, k).1 - at(&shortened, k).1).abs();
            for (worst, bound) in [
                ((-20..=20).map(value).fold(0.0, f64::max), bound.value),
                ((-20..=20).map(slope).fold(0.0, f64::max), bound.slope),
            ] {
                assert!(worst <= bound + 1e-14 && worst > 0.3 * bound, "{keep}: {worst} of {bound}");
            }
        }
    }

    #[test]
    fn a_part_of_a_polynomial_has_its_values() {
        let whole = [0.3, -1.0, 0.5, 2.0, -0.7, 0.1];
        let part = on_part(&whole, 0.4, 0.25);
        for k in -4..=4 {
            let beta = 0.25 * f64::from(k);
            let (value, slope) = (horner(&part, beta), horner(&whole, 0.4 + 0.25 * beta));
            assert!((value.0 - slope.0).abs() < 1e-15 && (value.1 - 0.25 * slope.1).abs() < 1e-15);
        }
    }
}
