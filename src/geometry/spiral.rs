//! The inward spiral r = a theta, travelled with theta decreasing (clockwise), and its places as exact angles.
//!
//! The chain rides it through [`Path`]; scenes construct it. All formulas were derived in the polar frame of a handle,
//! so that none subtracts two positions that are nearly the same.

use std::f64::consts::{PI, TAU};

use super::path::{BenchOnPath, Fold, Path};
use super::root::{first_true, increasing_root};
use super::{Point, Vector};

/// 2 pi minus its nearest double: with it, turns come off an angle without losing digits.
const TAU_LOW: f64 = 2.449_293_598_294_706_4e-16;

/// An angle as whole turns and a remainder in two parts: 2 pi `turns` + `remainder` + `low`.
///
/// With one double for all, the tail of a long team is missed by a random walk of the angle's last bit times the
/// radius (about 1.2e-12 m at 223 benches). Invariant: `turns` is whole, |`remainder`| <= pi, `low` is below the last
/// bit of `remainder`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Angle {
    turns: f64,
    remainder: f64,
    low: f64,
}

impl Angle {
    /// The angle of a number of turns, whole or not.
    pub fn from_turns(turns: f64) -> Self {
        let whole = turns.round();
        let part = turns - whole;
        let remainder = TAU * part;
        let low = TAU.mul_add(part, -remainder) + TAU_LOW * part;
        Self { turns: whole, remainder, low }
    }

    /// The angle of a number of radians.
    pub fn from_radians(radians: f64) -> Self {
        Self { turns: 0.0, remainder: 0.0, low: 0.0 }.plus(radians)
    }

    /// This angle and `radians` more.
    pub fn plus(self, radians: f64) -> Self {
        let turns = (radians / TAU).round();
        let product = turns * TAU;
        let product_low = TAU.mul_add(turns, -product) + TAU_LOW * turns;
        // Exact: radians and the nearest multiple of TAU agree in their leading bits.
        let part = radians - product;
        let (sum, error) = two_sum(self.remainder, part);
        Self { turns: self.turns + turns, remainder: sum, low: self.low + error - product_low }.normalized()
    }

    fn normalized(self) -> Self {
        let extra = if self.remainder > PI {
            1.0
        } else if self.remainder < -PI {
            -1.0
        } else {
            0.0
        };
        let (remainder, error) = two_sum(self.remainder, -extra * TAU);
        let (remainder, low) = two_sum(remainder, self.low + error - extra * TAU_LOW);
        Self { turns: self.turns + extra, remainder, low }
    }

    /// This angle minus `other`, radians; exact to a few units in the last place of the difference.
    pub fn minus(self, other: Self) -> f64 {
        let turns = self.turns - other.turns;
        let (difference, error) = two_sum(self.remainder, -other.remainder);
        let (sum, sum_error) = two_sum(turns * TAU, difference);
        sum + (sum_error + error + (self.low - other.low) + turns * TAU_LOW)
    }

    /// The angle as one double, in radians.
    pub fn radians(self) -> f64 {
        TAU.mul_add(self.turns, self.remainder)
    }

    /// The angle in turns.
    pub fn in_turns(self) -> f64 {
        self.turns + (self.remainder + self.low) / TAU
    }

    /// The angle in turns as a fixed-point number with 64 bits below the point; what is less is rounded away.
    pub(crate) fn in_fixed_point_turns(self) -> i128 {
        let scale = 2f64.powi(64);
        let part = self.remainder / TAU;
        let part_low = (TAU.mul_add(-part, self.remainder) - TAU_LOW * part + self.low) / TAU;
        ((self.turns as i128) << 64) + (part * scale) as i128 + (part_low * scale).round() as i128
    }

    /// Sine and cosine.
    pub fn sin_cos(self) -> (f64, f64) {
        let (sine, cosine) = self.remainder.sin_cos();
        (self.low.mul_add(cosine, sine), (-self.low).mul_add(sine, cosine))
    }
}

/// The rounded sum and its rounding error (Knuth, The Art of Computer Programming, vol. 2, section 4.2.2).
pub(super) fn two_sum(x: f64, y: f64) -> (f64, f64) {
    let sum = x + y;
    let y_part = sum - x;
    (sum, (x - (sum - y_part)) + (y - y_part))
}

/// The Archimedean spiral r = a theta with a = pitch / 2 pi, from `start_turn` turns inward to the centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spiral {
    pitch: f64,
    start_turn: f64,
    start: Angle,
    start_theta: f64,
    length: f64,
}

impl Spiral {
    /// A spiral of `pitch` metres per turn whose travel starts at theta = 2 pi `start_turn`. Both must be positive and
    /// finite; the scene, which knows the user's file and line, refuses others.
    pub fn new(pitch: f64, start_turn: f64) -> Self {
        debug_assert!(pitch > 0.0 && start_turn > 0.0);
        let start = Angle::from_turns(start_turn);
        let start_theta = TAU * start_turn;
        let mut spiral = Self { pitch, start_turn, start, start_theta, length: 0.0 };
        spiral.length = spiral.arc_length(start_theta, start_theta);
        spiral
    }

    /// Metres per turn.
    pub fn pitch(&self) -> f64 {
        self.pitch
    }

    /// Metres of radius per radian: a = pitch / 2 pi.
    pub fn growth(&self) -> f64 {
        self.pitch / TAU
    }

    /// The number of turns at which travel starts.
    pub fn start_turn(&self) -> f64 {
        self.start_turn
    }

    /// Where travel starts.
    pub fn start(&self) -> Angle {
        self.start
    }

    /// Distance of a place from the centre, metres.
    pub fn radius(&self, place: Angle) -> f64 {
        self.pitch * place.in_turns()
    }

    /// Arc length between `theta` and `theta - span`, metres.
    ///
    /// From s = a/2 (theta w + asinh theta), w = sqrt(1 + theta^2), with both differences written as products of the
    /// span, so that short spans far out keep all digits:
    /// theta w - theta' w' = span (w + theta' (theta + theta') / (w + w')) and
    /// asinh theta - asinh theta' = asinh(span (theta + theta') / (theta w' + theta' w)).
    fn arc_length(&self, theta: f64, span: f64) -> f64 {
        if span == 0.0 {
            return 0.0;
        }
        let inner = theta - span;
        let (w, w_inner) = (1f64.hypot(theta), 1f64.hypot(inner));
        let algebraic = span * (w + inner * (theta + inner) / (w + w_inner));
        let logarithmic = (span * (theta + inner) / (theta * w_inner + inner * w)).asinh();
        0.5 * self.growth() * (algebraic + logarithmic)
    }

    /// The place of [`Path::place_at`] and how far the angle has turned by then, radians, from a guess of the latter.
    ///
    /// One Newton step from a guess that is right to half the digits; from a poor one as many as it takes.
    pub(crate) fn place_near(&self, travelled: f64, guess: f64) -> (Angle, f64) {
        let mut span = guess;
        for _ in 0..4 {
            let theta = self.start_theta - span;
            if !(theta > 0.0 && span > 0.0 && travelled < self.length) {
                break;
            }
            let slope = self.growth() * 1f64.hypot(theta);
            let step = (travelled - self.arc_length(self.start_theta, span)) / slope;
            span += step;
            // The step leaves step^2 / 2 times the relative change of the slope, which is at most 1 / theta.
            if step * step < f64::EPSILON * span * theta {
                return (self.start.plus(-span), span);
            }
        }
        let place = self.place_at(travelled);
        (place, self.start.minus(place))
    }

    /// The place `metres` further along the path than `from`, or back where negative; `None` past the centre.
    ///
    /// Exact to the last digits of `metres`, however far along `from` is.
    pub(crate) fn ahead(&self, from: Angle, metres: f64) -> Option<Angle> {
        let theta = from.radians();
        let mut span = metres / (self.growth() * 1f64.hypot(theta));
        for _ in 0..8 {
            let inner = theta - span;
            if inner <= 0.0 {
                return None;
            }
            let step = (metres - self.arc_length(theta, span)) / (self.growth() * 1f64.hypot(inner));
            span += step;
            if step.abs() < 1e-9 * span.abs() {
                return (span < theta).then(|| from.plus(-span));
            }
        }
        None
    }

    /// Where the square of the chord to the point `increment` radians behind a handle at radius `r` stands against
    /// the square of the link, and its derivative by the increment d:
    /// G = (a d)^2 + 4 r (r + a d) sin^2(d/2) - link^2 (law of cosines).
    pub(crate) fn chord_excess(&self, r: f64, link: f64) -> impl Fn(f64) -> (f64, f64) {
        let a = self.growth();
        move |increment| {
            let (sine, cosine) = (0.5 * increment).sin_cos();
            let rise = a * increment;
            let outer = r + rise;
            let value = rise.mul_add(rise, (2.0 * r * sine) * (2.0 * outer * sine)) - link * link;
            let slope = 2.0 * a * rise + 4.0 * r * a * sine * sine + 4.0 * r * outer * sine * cosine;
            (value, slope)
        }
    }

    /// The increment from a handle at radius `r` to its follower, radians.
    pub(crate) fn increment(&self, r: f64, link: f64) -> Result<f64, Fold> {
        let a = self.growth();
        let excess = self.chord_excess(r, link);
        // Up to half a turn every term of the slope is positive: the root there is single.
        let high = if excess(PI).0 >= 0.0 {
            PI
        } else {
            match first_chord_maximum(r / a) {
                // The chord grows for ever and is at least the radial rise.
                None => (link / a).max(PI),
                Some(maximum) => {
                    let value = excess(maximum).0;
                    if value < -8.0 * f64::EPSILON * link * link {
                        return Err(Fold);
                    }
                    if value <= 0.0 {
                        return Ok(maximum);
                    }
                    maximum
                }
            }
        };
        let first = link / r.hypot(a);
        let second = link / (r + 0.5 * a * first.min(PI)).hypot(a);
        Ok(increasing_root(excess, 0.0, high, second))
    }

    /// The outermost fold for links of `link` metres: the place at which a front handle's link locks, or `None` where
    /// the link is so short against the pitch that it never does.
    ///
    /// The first maximum of the chord grows with theta (d(chord^2)/d theta = 4 a^2 (2 theta + d) sin^2(d/2) > 0), so
    /// at most one theta has it equal to the link.
    pub fn fold(&self, link: f64) -> Option<f64> {
        let ratio = link / self.growth();
        let chord = |theta: f64, d: f64| d.hypot(2.0 * (theta * (theta + d)).sqrt() * (0.5 * d).sin());
        let reaches = |theta: f64| first_chord_maximum(theta).is_some_and(|d| chord(theta, d) >= ratio);
        // Below theta = 1/4 the chord never shrinks; at theta = 1 it does.
        let least = first_true(|theta| first_chord_maximum(theta).is_some(), 0.25, 1.0);
        if reaches(least) {
            return None;
        }
        // At radius link / 2 the chord of half a turn is longer than the link.
        Some(first_true(reaches, least, (0.5 * ratio).max(1.0)))
    }

    /// The place with polar angle `theta`.
    pub fn place_of_theta(&self, theta: f64) -> Angle {
        Angle::from_radians(theta)
    }
}

/// The increment d at which the chord from theta to theta + d first stops growing, in (pi, 2 pi), or `None` where it
/// grows for ever. Depends on theta alone.
///
/// Half the slope of the squared chord over a^2 is H(d) = d + 2 theta sin^2(d/2) + theta (theta + d) sin d, positive up
/// to pi. Where H' >= 0 at pi it stays so. Where not, H has one minimum before 2 pi, and a zero exactly when that
/// minimum is not above zero. Should the first turn have none, no later turn has one: at sin d = -1,
/// H = (1 - theta)(d + theta), and the part of the dip below that shrinks with d.
fn first_chord_maximum(theta: f64) -> Option<f64> {
    let half_slope = |d: f64| {
        let sine = (0.5 * d).sin();
        d + 2.0 * theta * sine * sine + theta * (theta + d) * d.sin()
    };
    let curvature = |d: f64| 1.0 + 2.0 * theta * d.sin() + theta * (theta + d) * d.cos();
    if curvature(PI) >= 0.0 {
        return None;
    }
    let lowest = first_true(|d| curvature(d) >= 0.0, PI, TAU);
    if half_slope(lowest) > 0.0 {
        return None;
    }
    Some(first_true(|d| half_slope(d) <= 0.0, PI, lowest))
}

impl Path for Spiral {
    type Place = Angle;

    fn length(&self) -> f64 {
        self.length
    }

    fn place_at(&self, travelled: f64) -> Angle {
        let (theta, a) = (self.start_theta, self.growth());
        if travelled >= self.length {
            return Angle::from_radians(0.0);
        }
        if travelled == 0.0 {
            return self.start;
        }
        // Without the logarithm the arc length is (theta^2 - theta'^2) a / 2.
        let twice = 2.0 * travelled / a;
        let guess = twice / (theta + (theta * theta - twice).max(0.0).sqrt());
        let span = increasing_root(
            |span| (self.arc_length(theta, span) - travelled, a * 1f64.hypot(theta - span)),
            if travelled < 0.0 { 2.0 * guess } else { 0.0 },
            theta,
            guess,
        );
        self.start.plus(-span)
    }

    fn point(&self, place: Angle) -> Point {
        let r = self.radius(place);
        let (sine, cosine) = place.sin_cos();
        Point::new(r * cosine, r * sine)
    }

    fn tangent(&self, place: Angle) -> Vector {
        let (r, a) = (self.radius(place), self.growth());
        let (sine, cosine) = place.sin_cos();
        // dp/dtheta = a e_r + r e_phi, and theta decreases.
        Vector::new(r * sine - a * cosine, -a * sine - r * cosine) / r.hypot(a)
    }

    fn distance_between(&self, behind: Angle, ahead: Angle) -> f64 {
        self.arc_length(behind.radians(), behind.minus(ahead))
    }

    fn follower(&self, front: Angle, link: f64) -> Result<Angle, Fold> {
        Ok(front.plus(self.increment(self.radius(front), link)?))
    }

    /// Outward and around: a |delta theta| + r |delta theta - delta theta of the companion|. Both only go one way: between
    /// stalls the angle between two handles only grows inward and only shrinks outward, since
    /// d theta_{i+1}/d theta_i = (t_i . b_i) w_i / ((t_{i+1} . b_i) w_{i+1}) < 1 (w = sqrt(a^2 + r^2); the difference of
    /// the two products is 2 a (r + r') sin^2(d/2) / link > 0).
    fn motion_beside(&self, from: Angle, to: Angle, companion: (Angle, Angle)) -> Option<f64> {
        let own = from.minus(to);
        let around = (own - companion.0.minus(companion.1)).abs();
        Some(self.growth() * own.abs() + self.radius(from).max(self.radius(to)) * around)
    }

    fn bench(&self, front: Angle, rear: Angle, link: f64) -> BenchOnPath {
        let a = self.growth();
        let d = rear.minus(front);
        let r = self.radius(front);
        let outer = r + a * d;
        let (half_sine, half_cosine) = (0.5 * d).sin_cos();
        let (square, sine) = (2.0 * half_sine * half_sine, 2.0 * half_sine * half_cosine);
        // Front minus rear in the front handle's polar frame: (r - r' cos d) e_r - r' sin d e_phi.
        let radial = (outer * square - a * d) / link;
        let around = -outer * sine / link;
        let (front_sine, front_cosine) = front.sin_cos();
        let direction =
            Vector::new(radial * front_cosine - around * front_sine, radial * front_sine + around * front_cosine);
        // Both cosines from t = -(a e_r + r e_phi) / sqrt(a^2 + r^2) in the frame of the handle concerned.
        let common = a * a * d + r * outer * sine;
        BenchOnPath {
            direction,
            front_cosine: (common - a * outer * square) / (link * r.hypot(a)),
            rear_cosine: (common + a * r * square) / (link * outer.hypot(a)),
        }
    }
}
