//! Intervals against numbers of 192 bits, and elementary functions against another library; the limit of places.

use astro_float::{BigFloat, Consts, RoundingMode};

use super::elementary::{atan, ln, pi, sin_cos};
use super::interval::Interval;
use super::search::{CertificateSearch, MOST_SPANS};
use super::{CertificateLine, Given, MOST_STEPS, Status};
use bench_dragon_motion::event::{Event, unreported};
use bench_dragon_show::scene::Scene;

const BITS: usize = 192;
const ROUNDING: RoundingMode = RoundingMode::ToEven;

/// A reproducible sequence of numbers (splitmix64).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    /// Returns a number of either sign, of sizes inside and outside those of a search; sometimes 0 or a power of two.
    fn number(&mut self) -> f64 {
        let bits = self.bits();
        match bits % 16 {
            0 => 0.0,
            1 => 2f64.powi((bits >> 8) as i32 % 40),
            _ => {
                let mantissa = (self.bits() >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
                mantissa * 2f64.powi((bits >> 8) as i32 % 60)
            }
        }
    }

    fn interval(&mut self) -> Interval {
        let (one, other) = (self.number(), self.number());
        if self.bits().is_multiple_of(4) {
            Interval::point(one)
        } else {
            Interval { lo: one.min(other), hi: one.max(other) }
        }
    }
}

fn exact(number: f64) -> BigFloat {
    BigFloat::from_f64(number, BITS)
}

fn assert_holds(interval: Interval, number: &BigFloat, what: &dyn Fn() -> String) {
    let above = interval.lo == f64::NEG_INFINITY || exact(interval.lo) <= *number;
    let below = interval.hi == f64::INFINITY || *number <= exact(interval.hi);
    assert!(above && below, "{}: {number} is not in {interval:?}", what());
}

#[test]
fn a_million_operations_hold_what_192_bits_find() {
    let mut random = Random(1);
    for _ in 0..170_000 {
        let (a, b) = (random.interval(), random.interval());
        // Rounding can only lose something at the ends. Numbers between follow, since the operations are monotone.
        let x = if random.bits().is_multiple_of(2) { a.lo } else { a.hi };
        let y = if random.bits().is_multiple_of(2) { b.lo } else { b.hi };
        let (p, q) = (exact(x), exact(y));
        let what = || format!("{a:?} {b:?}");
        assert_holds(a + b, &p.add(&q, BITS, ROUNDING), &what);
        assert_holds(a - b, &p.sub(&q, BITS, ROUNDING), &what);
        assert_holds(a * b, &p.mul(&q, BITS, ROUNDING), &what);
        assert_holds(a.square(), &p.mul(&p, BITS, ROUNDING), &what);
        assert_holds(a.abs().sqrt(), &p.abs().sqrt(BITS, ROUNDING), &what);
        if y != 0.0 {
            assert_holds(a.over(b), &p.div(&q, BITS, ROUNDING), &what);
        }
    }
}

#[test]
fn every_end_is_within_three_units_of_the_last_place() {
    // The whole line would hold every result: this test refutes it.
    let mut random = Random(2);
    for _ in 0..10_000 {
        let (x, y) = (random.number(), random.number());
        let (a, b) = (Interval::point(x), Interval::point(y));
        for (interval, value) in [(a + b, x + y), (a * b, x * y), (a.square(), x * x)] {
            let unit = value.abs().next_up() - value.abs();
            assert!(interval.hi - interval.lo <= 3.0 * unit, "{interval:?} {value}");
        }
    }
}

#[test]
fn elementary_functions_hold_what_192_bits_find() {
    let (mut random, mut constants) = (Random(3), Consts::new().unwrap());
    assert_holds(pi(), &constants.pi(BITS, ROUNDING), &|| "pi".to_owned());
    let unit = |random: &mut Random| (random.bits() >> 11) as f64 / (1u64 << 53) as f64;
    for _ in 0..20_000 {
        let size = 2f64.powi((random.bits() % 40) as i32 - 12);
        let sign = 2.0 * unit(&mut random) - 1.0;
        let whole = (unit(&mut random) * size).round();
        let beside = |value: f64| f64::from_bits(value.to_bits() + (whole as u64) % 3 - 1);
        // Angles of all sizes, beside multiples of pi / 4 and of 1 / 256, and the least and greatest numbers.
        let angle = match random.bits() % 8 {
            0 => beside((whole + 1.0) * std::f64::consts::FRAC_PI_4).copysign(sign),
            1 => beside((whole + 1.0) / 256.0).copysign(sign),
            2 => sign * f64::from_bits(random.bits() >> (2 + whole as u64 % 60)),
            3 => sign * 2e8,
            _ => sign * size,
        };
        let angle = if angle.abs() < 2e8 { angle } else { sign };
        let (sine, cosine) = sin_cos(angle);
        let what = || format!("{angle}");
        assert_holds(sine, &exact(angle).sin(BITS, ROUNDING, &mut constants), &what);
        assert_holds(cosine, &exact(angle).cos(BITS, ROUNDING, &mut constants), &what);
        assert!(angle.abs() > 1e8 || sine.hi - sine.lo < 2e-14 && cosine.hi - cosine.lo < 2e-14, "{angle}: {sine:?}");
        let positive = unit(&mut random) * size + f64::MIN_POSITIVE;
        let (x, what) = (Interval::point(positive), || format!("{positive}"));
        assert_holds(atan(x), &exact(positive).atan(BITS, ROUNDING, &mut constants), &what);
        assert_holds(ln(x), &exact(positive).ln(BITS, ROUNDING, &mut constants), &what);
        let (atan, ln) = (atan(x), ln(x));
        assert!(atan.hi - atan.lo < 4e-14 && ln.hi - ln.lo < 2e-13, "{positive}: {atan:?} {ln:?}");
    }
}

/// The limit of places ends a search: each result states the time up to which it holds, and the reason why it holds no
/// further.
#[test]
fn a_certificate_with_too_many_places_says_so() {
    let scene = Scene::paper();
    let motion = scene.ensemble.only().unwrap();
    let timeline = scene.ensemble.timeline(&mut unreported);
    let events: Vec<Event> = timeline.events().iter().map(|timed| timed.event).collect();
    let certified = |most_spans: usize| {
        let given = Given {
            scene: "",
            description: motion.description(),
            path: motion.path(),
            team: motion.team(),
            head_speed: motion.head_speed(),
            events: &events,
            most_steps: MOST_STEPS,
            most_spans,
            dragon: None,
        };
        let mut spans = 0;
        let mut count = |line: &CertificateLine| {
            if let CertificateLine::Step(step) = line {
                spans += step.spans.len();
            }
            Ok(())
        };
        let events = CertificateSearch::new(given, Vec::new(), &mut count).run(&mut unreported).unwrap();
        (events, spans)
    };
    let (events, spans) = certified(5000);
    // No step has more spans than the team has benches.
    assert!(spans > 5000 && spans <= 5000 + motion.team().benches, "{spans}");
    assert_eq!(events.len(), 4);
    for event in &events {
        let Status::Undecided { time_lo, because } = &event.status else { panic!("{event:?}") };
        assert!(*time_lo > 1.0 && because.contains("its certificate has more than 1e4 places of handles"), "{event:?}");
    }
    let (events, spans) = certified(MOST_SPANS);
    assert!(spans > 10_000 && !events.iter().any(|event| matches!(event.status, Status::Undecided { .. })), "{spans}");
}
