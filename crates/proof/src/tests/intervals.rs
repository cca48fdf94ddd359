//! Every operation on intervals encloses the exact result. Integers show this for `+`, `-`, `*`, `/` and roots, 512
//! bits of `astro-float` for the elementary functions. Single operations on numbers are rounded to the nearest number
//! in their direction.

use astro_float::{BigFloat, Consts, RoundingMode, Sign};
use fastrand::Rng;
use num_bigint::BigInt;

use super::cases;
use crate::elementary;
use crate::interval::{Interval, Vector};
use crate::number::{Number, Round};

/// Returns the number of random operations of each kind.
fn operations() -> usize {
    cases(100_000, 2_000)
}

/// An exact binary number: `integer` times 2^`exponent`.
#[derive(Clone, Debug)]
struct Exact {
    integer: BigInt,
    exponent: i64,
}

impl Exact {
    fn new(number: Number) -> Self {
        let (is_negative, mantissa, exponent) = number.parts();
        assert!(!number.is_nan());
        let integer = BigInt::from(mantissa);
        Self { integer: if is_negative { -integer } else { integer }, exponent: i64::from(exponent) }
    }

    /// Returns the value of a number of 512 bits.
    fn of_reference(number: &BigFloat) -> Self {
        let (words, _, sign, exponent, _) = number.as_raw_parts().expect("a number");
        let bits = 64 * words.len() as i64;
        let integer = words.iter().rev().fold(BigInt::from(0), |sum, word| (sum << 64) + BigInt::from(*word));
        let integer = if sign == Sign::Neg { -integer } else { integer };
        Self { integer, exponent: i64::from(exponent) - bits }
    }

    fn times(&self, other: &Self) -> Self {
        Self { integer: &self.integer * &other.integer, exponent: self.exponent + other.exponent }
    }

    fn plus(&self, other: &Self) -> Self {
        let exponent = self.exponent.min(other.exponent);
        let shifted = |number: &Self| &number.integer << (number.exponent - exponent) as usize;
        Self { integer: shifted(self) + shifted(other), exponent }
    }

    fn minus(&self, other: &Self) -> Self {
        self.plus(&Self { integer: -&other.integer, exponent: other.exponent })
    }

    fn is_at_most(&self, other: &Self) -> bool {
        self.minus(other).integer <= BigInt::from(0)
    }
}

/// Returns a number of 128 bits of either sign, mostly near 1 in size, sometimes far from it, round, or 0.
fn number(random: &mut Rng) -> Number {
    let round = |random: &mut Rng| random.f64() * 2.0 - 1.0;
    let scale = match random.u8(..10) {
        0 => 2f64.powi(random.i32(-300..300)),
        1 => return Number::ZERO,
        2 => return Number::new(f64::from(random.i8(..))),
        3 => return Number::new(f64::from_bits(random.u64(..1 << 60))),
        _ => 2f64.powi(random.i32(-4..4)),
    };
    let [high, middle, low] = [1.0, 2f64.powi(-50), 2f64.powi(-100)].map(|unit| Number::new(round(random) * unit));
    high.plus(middle, Round::Up).plus(low, Round::Down).times(Number::new(scale), Round::Up)
}

/// Returns a narrow or wide interval, and two numbers in it.
fn interval(random: &mut Rng) -> (Interval, Vec<Number>) {
    let a = number(random);
    let b = match random.u8(..4) {
        0 => a,
        1 => a.plus(Number::new(2f64.powi(-90) * random.f64()), Round::Up),
        2 => a.times(Number::new(1.0f64.next_up()), Round::Up),
        _ => number(random),
    };
    let (a, b) = if b < a { (b, a) } else { (a, b) };
    (Interval::between(a, b), vec![a, b])
}

/// Every operation returns the number next to the exact result in its direction: no other number of 128 bits is
/// between.
#[test]
fn operations_are_rounded_to_the_next_number() {
    let mut random = Rng::with_seed(5);
    let compare = |number: Number, divisor: &Exact, exact: &Exact| Exact::new(number).times(divisor).minus(exact);
    let check = |rounded: [Number; 2], exact: &Exact, divisor: &Exact, what: &str| {
        let [down, up] = rounded;
        let zero = BigInt::from(0);
        let sign = if divisor.integer < zero { BigInt::from(-1) } else { BigInt::from(1) };
        let below = compare(down, divisor, exact).integer * &sign;
        let above = compare(up, divisor, exact).integer * &sign;
        assert!(below <= zero && above >= zero, "{what}: {rounded:?} {exact:?}");
        assert!((below == zero) == (above == zero), "{what}: {rounded:?} {exact:?}");
        if below != zero {
            // One unit of the lesser mantissa lies between the two, or they are 0 and the least number.
            let gap = Exact::new(up).minus(&Exact::new(down));
            let unit = down.parts().2.min(up.parts().2);
            assert!(
                gap.integer.magnitude().bits() <= 1 + (i64::from(unit) - gap.exponent) as u64,
                "{what}: {rounded:?}"
            );
        }
    };
    let one = Exact { integer: BigInt::from(1), exponent: 0 };
    for _ in 0..operations() {
        let (a, b) = (number(&mut random), number(&mut random));
        let (x, y) = (Exact::new(a), Exact::new(b));
        let both = |of: &dyn Fn(Round) -> Number| [of(Round::Down), of(Round::Up)];
        check(both(&|round| a.plus(b, round)), &x.plus(&y), &one, "sum");
        check(both(&|round| a.minus(b, round)), &x.minus(&y), &one, "difference");
        check(both(&|round| a.times(b, round)), &x.times(&y), &one, "product");
        if b != Number::ZERO {
            check(both(&|round| a.over(b, round)), &x, &y, "quotient");
        }
        assert_eq!(a < b, !y.is_at_most(&x), "{a:?} {b:?}");
        assert_eq!(a == b, x.is_at_most(&y) && y.is_at_most(&x), "{a:?} {b:?}");
    }
}

fn assert_holds(interval: &Interval, exact: &Exact, what: &str) {
    let (lo, hi) = interval.ends();
    assert!(Exact::new(lo).is_at_most(exact) && exact.is_at_most(&Exact::new(hi)), "{what}: {interval:?}, {exact:?}");
}

#[test]
fn sums_and_products_hold_the_exact_result() {
    let mut random = Rng::with_seed(1);
    for _ in 0..operations() {
        let ((a, of_a), (b, of_b)) = (interval(&mut random), interval(&mut random));
        let (sum, difference, product) = (a + b, a - b, a * b);
        let (square, size, most, least) = (a.square(), a.abs(), a.max(&b), a.min(&b));
        for x in &of_a {
            let exact_x = Exact::new(*x);
            assert_holds(&square, &exact_x.times(&exact_x), "square");
            assert_holds(&size, &Exact::new(if x.is_negative() { x.negative() } else { *x }), "size");
            for y in &of_b {
                let exact_y = Exact::new(*y);
                assert_holds(&sum, &exact_x.plus(&exact_y), "sum");
                assert_holds(&difference, &exact_x.minus(&exact_y), "difference");
                assert_holds(&product, &exact_x.times(&exact_y), "product");
                assert_holds(&most, &Exact::new(if x < y { *y } else { *x }), "greater");
                assert_holds(&least, &Exact::new(if x < y { *x } else { *y }), "smaller");
            }
        }
    }
}

#[test]
fn quotients_and_roots_hold_the_exact_result() {
    let mut random = Rng::with_seed(2);
    let mut quotients = 0;
    for _ in 0..operations() {
        let ((a, of_a), (b, of_b)) = (interval(&mut random), interval(&mut random));
        let quotient = a / b;
        if !(b.is_positive() || b.is_negative()) {
            assert!(quotient.ends().0.is_nan() && quotient.ends().1.is_nan(), "{b:?}");
        } else {
            quotients += 1;
            let (lo, hi) = (Exact::new(quotient.ends().0), Exact::new(quotient.ends().1));
            for (x, y) in of_a.iter().flat_map(|x| of_b.iter().map(move |y| (x, y))) {
                // lo <= x / y <= hi, times y.
                let (x, y) = (Exact::new(*x), Exact::new(*y));
                let (lo, hi) = (lo.times(&y), hi.times(&y));
                let (lo, hi) = if b.is_negative() { (hi, lo) } else { (lo, hi) };
                assert!(lo.is_at_most(&x) && x.is_at_most(&hi), "{a:?} / {b:?}");
            }
        }
        let root = a.abs().sqrt();
        let (lo, hi) = (Exact::new(root.ends().0), Exact::new(root.ends().1));
        let (least, greatest) = (Exact::new(a.abs().ends().0), Exact::new(a.abs().ends().1));
        assert!(lo.times(&lo).is_at_most(&least) && greatest.is_at_most(&hi.times(&hi)), "root of {a:?}");
        // The interval is no wider than needed.
        if a.ends().0 == a.ends().1 && a.ends().0 != Number::ZERO {
            let width = hi.minus(&lo);
            let allowed = Exact { integer: hi.integer.clone(), exponent: hi.exponent - 90 };
            assert!(width.is_at_most(&allowed), "root of {a:?}");
        }
    }
    assert!(quotients > operations() / 4, "{quotients}");
}

/// Doubles are converted exactly.
#[test]
fn doubles_are_exact() {
    let mut random = Rng::with_seed(3);
    let some = [0.0, -0.0, 1.0, 5e-324, f64::MIN_POSITIVE, f64::MAX, f64::MIN, 2f64.powi(-1060) * 3.0];
    let any = std::iter::repeat_with(|| f64::from_bits(random.u64(..))).filter(|number| number.is_finite());
    for number in some.into_iter().chain(any.take(operations())) {
        let interval = Interval::new(number);
        let bits = number.to_bits();
        let exponent = ((bits >> 52) & 0x7ff) as i64;
        let fraction = bits & ((1 << 52) - 1);
        let (integer, exponent) = if exponent == 0 { (fraction, -1074) } else { (fraction | 1 << 52, exponent - 1075) };
        let integer = if number < 0.0 { -BigInt::from(integer) } else { BigInt::from(integer) };
        let exact = Exact { integer, exponent };
        assert_holds(&interval, &exact, &format!("{number:e}"));
        let (lo, hi) = interval.ends();
        assert!(lo == hi, "{number:e}");
        // Towards zero, a double is its own nearest.
        assert_eq!(lo.rough(), number, "{number:e}");
    }
}

/// Comparisons with NaN are never true.
#[test]
fn what_is_not_a_number_proves_nothing() {
    let one = Interval::new(1.0);
    let nothing = one / (one - one);
    for made in [
        nothing + one,
        one - nothing,
        nothing * one,
        one / nothing,
        nothing.square(),
        nothing.abs(),
        nothing.max(&one),
        one.min(&nothing),
        one.max(&nothing),
        nothing.around_zero(),
        nothing.upper(),
        (-&one).sqrt(),
        nothing.sqrt(),
        elementary::ln(&nothing),
        elementary::ln(&-&one),
        elementary::atan(&nothing),
        Interval::new(f64::NAN),
        Interval::new(f64::INFINITY) - Interval::new(f64::INFINITY),
        Vector::new(f64::NAN, 1.0).norm(),
    ] {
        assert!(!made.is_positive() && !made.is_negative() && !made.is_not_negative(), "{made:?}");
        assert!(!made.is_below(&one) && !one.is_below(&made) && !made.is_at_most(&one) && !one.is_at_most(&made));
    }
}

/// Checks a function on random points and narrow intervals against 512 bits.
fn compare(
    name: &str,
    mut argument: impl FnMut(&mut Rng) -> f64,
    computed: impl Fn(&Interval) -> Interval,
    mut reference: impl FnMut(&BigFloat) -> BigFloat,
) {
    let mut random = Rng::with_seed(4);
    for _ in 0..cases(2_000, 50) {
        let x = argument(&mut random);
        let value = Exact::of_reference(&reference(&BigFloat::from_f64(x, 512)));
        let enclosure = computed(&Interval::new(x));
        assert_holds(&enclosure, &value, &format!("{name} of {x:e}"));
        let wide = computed(&Interval::between(Number::new(x), Number::new(x + x.abs() * 1e-12)));
        assert_holds(&wide, &value, &format!("{name} from {x:e}"));
        // 1e-28 of the value or of 1, the greater of the two.
        let width = Exact::new(enclosure.ends().1).minus(&Exact::new(enclosure.ends().0));
        let size = Exact::new(Number::new(1e-28 * x.abs().max(1.0)));
        assert!(width.is_at_most(&size), "{name} of {x:e}: {enclosure:?}");
    }
}

#[test]
fn elementary_functions_hold_their_values() {
    const NEAREST: RoundingMode = RoundingMode::ToEven;
    let mut constants = Consts::new().unwrap();
    let mut angle = |random: &mut Rng| match random.u8(..4) {
        // Not 0, whose next number `astro-float` converts wrongly.
        0 => (f64::from(random.i32(1..200) - 100) * std::f64::consts::FRAC_PI_2 + 1e-300).next_up(),
        1 => random.f64() * 1e-9,
        2 => (random.f64() - 0.5) * 1e7,
        _ => (random.f64() - 0.5) * 300.0,
    };
    compare("sin", &mut angle, |x| elementary::sin_cos(x).0, |x| x.sin(512, NEAREST, &mut constants));
    compare("cos", &mut angle, |x| elementary::sin_cos(x).1, |x| x.cos(512, NEAREST, &mut constants));
    let positive = |random: &mut Rng| 2f64.powf(random.f64() * 60.0 - 10.0);
    compare("atan", positive, elementary::atan, |x| x.atan(512, NEAREST, &mut constants));
    compare("ln", positive, elementary::ln, |x| x.ln(512, NEAREST, &mut constants));
    // An unknown angle gives the whole range.
    for angle in [1e300, f64::MAX, -1e17] {
        let (sine, cosine) = elementary::sin_cos(&Interval::new(angle));
        let one = Interval::new(1.0);
        assert!(one.is_at_most(&sine.upper()) && one.is_at_most(&cosine.upper()), "{angle:e}");
    }
    let quarter =
        Exact::of_reference(&constants.pi(512, NEAREST)).times(&Exact { integer: BigInt::from(1), exponent: -1 });
    assert_holds(elementary::quarter_turn(), &quarter, "a quarter turn");
}
