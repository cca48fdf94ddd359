//! Interpolation in a table of equally spaced knots, by a polynomial through the nine nearest.
//!
//! Called by the follower table only.

/// Knots on either side of the nearest one.
pub(super) const REACH: usize = 4;

/// First differences between the knots of a stencil.
pub(super) const DIFFERENCES: usize = 2 * REACH;

const KNOTS: usize = DIFFERENCES + 1;

/// What every first difference counts for in an interpolated value, as polynomials of the place between the knots.
///
/// In terms of differences no digits are lost however large the value: with L_m the Lagrange polynomials of the knots
/// -4..4, f(x) - f(0) = sum over j of W_j(x) (f(j + 1) - f(j)), where W_j is the sum of all L_m with m > j for j >= 0 and
/// minus the sum of those with m <= j for j < 0.
#[derive(Debug, Clone)]
pub(super) struct Stencil {
    /// By power, then by difference.
    coefficients: [[f64; DIFFERENCES]; KNOTS],
}

/// The weights of the differences at one place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weights {
    /// For the value less that of the nearest knot.
    pub value: [f64; DIFFERENCES],
    /// For its derivative by the place, in knots.
    pub slope: [f64; DIFFERENCES],
}

impl Stencil {
    pub(super) fn new() -> Self {
        let mut coefficients = [[0.0; DIFFERENCES]; KNOTS];
        for node in 0..KNOTS {
            let lagrange = lagrange(node);
            for (difference, before_the_nearest) in (0..DIFFERENCES).map(|j| (j, j < REACH)) {
                let sign = match (before_the_nearest, node > difference) {
                    (true, false) => -1.0,
                    (false, true) => 1.0,
                    _ => continue,
                };
                for (coefficients, part) in coefficients.iter_mut().zip(lagrange) {
                    coefficients[difference] += sign * part;
                }
            }
        }
        Self { coefficients }
    }

    /// The weights `place` knots from the nearest one, from -1/2 to 1/2.
    #[inline(always)]
    pub(super) fn at(&self, place: f64) -> Weights {
        let mut value = self.coefficients[KNOTS - 1];
        let mut slope = [0.0; DIFFERENCES];
        for coefficients in self.coefficients.iter().rev().skip(1) {
            for j in 0..DIFFERENCES {
                slope[j] = slope[j] * place + value[j];
                value[j] = value[j] * place + coefficients[j];
            }
        }
        Weights { value, slope }
    }
}

/// The polynomial, by power, that is 1 at knot `node` - 4 and 0 at the other knots.
fn lagrange(node: usize) -> [f64; KNOTS] {
    let mut product = [0.0; KNOTS];
    product[0] = 1.0;
    for other in (0..KNOTS).filter(|other| *other != node) {
        let (root, gap) = (other as f64 - REACH as f64, node as f64 - other as f64);
        for power in (0..KNOTS).rev() {
            let lower = if power > 0 { product[power - 1] } else { 0.0 };
            product[power] = (lower - root * product[power]) / gap;
        }
    }
    product
}

impl Weights {
    /// The weighted sum of the differences, and of their slopes.
    #[inline(always)]
    pub(super) fn of(&self, differences: &[f64]) -> (f64, f64) {
        let sum = |weights: &[f64; DIFFERENCES]| weights.iter().zip(differences).map(|(w, d)| w * d).sum::<f64>();
        (sum(&self.value), sum(&self.slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_up_to_the_eighth_degree_are_met() {
        let stencil = Stencil::new();
        for degree in 1..=8 {
            let power = |x: f64| (0.1 * x + 1.0).powi(degree);
            let differences: Vec<f64> = (-4..4).map(|j| power(f64::from(j + 1)) - power(f64::from(j))).collect();
            for k in -10..=10 {
                let place = 0.05 * f64::from(k);
                let (value, slope) = stencil.at(place).of(&differences);
                let truth = power(place) - 1.0;
                let true_slope = 0.1 * f64::from(degree) * (0.1 * place + 1.0).powi(degree - 1);
                assert!((value - truth).abs() < 1e-14, "degree {degree} at {place}: {:e}", value - truth);
                assert!((slope - true_slope).abs() < 4e-14, "degree {degree} at {place}: {:e}", slope - true_slope);
            }
        }
    }
}
