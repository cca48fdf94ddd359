//! Root finding in one unknown: a bracketed Newton iteration, and bisection for functions without a derivative.

/// Returns the root of an increasing function within `low..=high`. Newton's method is kept inside a shrinking bracket
/// (rtsafe; Press et al., Numerical Recipes, 3rd ed., section 9.4).
///
/// `function` returns the value and the derivative. The result is as exact as the function's rounding allows.
pub fn increasing_root(function: impl Fn(f64) -> (f64, f64), low: f64, high: f64, guess: f64) -> f64 {
    let (mut low, mut high) = (low, high);
    let mut x = guess.clamp(low, high);
    let mut last_step = f64::INFINITY;
    for _ in 0..200 {
        let (value, slope) = function(x);
        if value == 0.0 {
            return x;
        }
        if value < 0.0 {
            low = x;
        } else {
            high = x;
        }
        let newton = x - value / slope;
        let is_within = newton >= low && newton <= high;
        let next = if is_within { newton } else { 0.5 * (low + high) };
        let step = (next - x).abs();
        // The second test ends the jitter of the last digits where the function is nearly flat. Halvings are no jitter:
        // if the root is the bracket's end up to rounding, every step is a halving.
        if step <= f64::EPSILON * x.abs() || (is_within && step < 1e-10 * x.abs() && step > 0.5 * last_step) {
            return next;
        }
        last_step = step;
        x = next;
    }
    x
}

/// Returns the place within `low..=high` where `holds` changes from false to true, to the last bit: the least number
/// known to hold. `holds(low)` must be false, and `holds(high)` true.
pub fn bisect_predicate(mut holds: impl FnMut(f64) -> bool, low: f64, high: f64) -> f64 {
    let (mut low, mut high) = (low, high);
    // 1,100 halvings exhaust the doubles between any two finite numbers.
    for _ in 0..1100 {
        let middle = low + 0.5 * (high - low);
        if middle <= low || middle >= high {
            break;
        }
        if holds(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// Returns the least value of a function that has one minimum within `low..=high`, and its place. The method is golden
/// section search (Kiefer, Sequential minimax search for a maximum, 1953).
///
/// The value is as exact as the function; the place of a smooth minimum only to half the digits.
pub fn golden_section_min(mut function: impl FnMut(f64) -> f64, low: f64, high: f64) -> (f64, f64) {
    let share = 0.5 * (5f64.sqrt() - 1.0);
    let ends = [(function(low), low), (function(high), high)];
    let (mut low, mut high) = (low, high);
    let (mut left, mut right) = (high - share * (high - low), low + share * (high - low));
    let (mut at_left, mut at_right) = (function(left), function(right));
    // Each step keeps 0.618 of the bracket, so that 200 exhaust the doubles between any two places of a show.
    for _ in 0..200 {
        if right - left <= 2.0 * f64::EPSILON * high.abs() {
            break;
        }
        if at_left <= at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - share * (high - low);
            at_left = function(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + share * (high - low);
            at_right = function(right);
        }
    }
    let found = [(at_left, left), (at_right, right)];
    let least = |best: (f64, f64), next: (f64, f64)| if next.0 < best.0 { next } else { best };
    found.into_iter().chain(ends).fold((f64::INFINITY, low), least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn increasing_root_survives_a_guess_from_which_newton_diverges() {
        // Newton alone, started at 3, diverges.
        let root = increasing_root(|x| ((x - 0.5).atan(), 1.0 / (1.0 + (x - 0.5).powi(2))), -10.0, 10.0, 3.0);
        assert!((root - 0.5).abs() < 1e-15);
    }

    #[test]
    fn increasing_root_ends_on_a_flat_root() {
        let root = increasing_root(|x| ((x - 1.0).powi(3), 3.0 * (x - 1.0).powi(2)), 0.0, 5.0, 4.0);
        assert!((root - 1.0).abs() < 1e-5);
    }

    #[test]
    fn increasing_root_finds_one_that_rounds_to_the_end_of_its_bracket() {
        // The last link of a spiral whose head is at the centre: (a d)^2 = link^2.
        let (link, pitch) = (2.86f64, 5.482_192_864_127_96);
        let a = pitch / std::f64::consts::TAU;
        for high in [link / a, (link / a).next_down(), (link / a).next_up()] {
            let root = increasing_root(|d| ((a * d) * (a * d) - link * link, 2.0 * a * a * d), 0.0, high, 2.0);
            assert!((root * a / link - 1.0).abs() < 1e-15, "{root} of {high}");
        }
    }

    #[test]
    fn bisect_predicate_finds_the_last_bit() {
        let found = bisect_predicate(|x| x * x >= 2.0, 0.0, 2.0);
        assert!(found * found >= 2.0 && found.next_down() * found.next_down() < 2.0);
    }

    #[test]
    fn golden_section_min_finds_smooth_minima_kinks_and_ends() {
        let (value, at) = golden_section_min(|x| (x - 0.3).powi(2) + 1.0, 0.0, 2.0);
        assert!(value == 1.0 && (at - 0.3).abs() < 1e-7);
        let (value, at) = golden_section_min(|x| (x - 0.3).abs(), 0.0, 2.0);
        assert!(value < 1e-14 && (at - 0.3).abs() < 1e-14);
        assert_eq!(golden_section_min(|x| x, 0.5, 2.0), (0.5, 0.5));
    }
}
