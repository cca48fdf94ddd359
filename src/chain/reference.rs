//! The chain to more than 30 digits, by a method of its own: what the solvers are measured against.
//!
//! In: the model and a time. Out: every handle as sums of two doubles. Points are Cartesian, the condition on a
//! follower is the plain distance of two points, nothing is rearranged to save digits: there are enough of them. It
//! takes some milliseconds per frame. `trade` and tests call it.

use std::f64::consts::TAU;

use astro_float::{BigFloat, Consts, RoundingMode};

use super::Team;
use crate::geometry::path::Fold;

/// Bits of every number: 38 digits.
const BITS: usize = 128;
const ROUNDING: RoundingMode = RoundingMode::ToEven;

/// A number as the sum of a double and a far smaller one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Precise {
    /// The number, rounded towards zero.
    pub high: f64,
    /// What is missing.
    pub low: f64,
}

impl Precise {
    /// How far a double is from this number.
    pub fn error_of(self, number: f64) -> f64 {
        (number - self.high) - self.low
    }
}

/// One handle of the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceHandle {
    /// Metres to the right of the centre.
    pub x: Precise,
    /// Metres up from the centre.
    pub y: Precise,
    /// Signed speed along the path, metres per second.
    pub speed: f64,
}

/// The exact motion of one team on one spiral.
pub struct Reference {
    team: Team,
    start: BigFloat,
    growth: BigFloat,
    growth_rounded: f64,
    head_speed: f64,
    constants: Consts,
}

/// A point with the derivatives of its coordinates by theta.
struct OnSpiral {
    theta: BigFloat,
    x: BigFloat,
    y: BigFloat,
    dx: BigFloat,
    dy: BigFloat,
}

fn precise(number: f64) -> BigFloat {
    BigFloat::from_f64(number, BITS)
}

fn sum(a: &BigFloat, b: &BigFloat) -> BigFloat {
    a.add(b, BITS, ROUNDING)
}

fn difference(a: &BigFloat, b: &BigFloat) -> BigFloat {
    a.sub(b, BITS, ROUNDING)
}

fn product(a: &BigFloat, b: &BigFloat) -> BigFloat {
    a.mul(b, BITS, ROUNDING)
}

fn quotient(a: &BigFloat, b: &BigFloat) -> BigFloat {
    a.div(b, BITS, ROUNDING)
}

fn root(a: &BigFloat) -> BigFloat {
    a.sqrt(BITS, ROUNDING)
}

/// The double towards zero from a number.
fn rounded(number: &BigFloat) -> f64 {
    let Some((words, _, sign, exponent, _)) = number.as_raw_parts() else { return f64::NAN };
    let leading = words.last().copied().unwrap_or(0) >> 11;
    // The number is 0.leading... times 2^exponent; two factors, since one alone may overflow.
    let exponent = exponent - 53;
    let half = exponent / 2;
    let size = leading as f64 * 2f64.powi(half) * 2f64.powi(exponent - half);
    if sign == astro_float::Sign::Neg { -size } else { size }
}

fn split(number: &BigFloat) -> Precise {
    let high = rounded(number);
    Precise { high, low: rounded(&difference(number, &precise(high))) }
}

impl Reference {
    /// The reference for `team` on the spiral of `pitch` metres per turn, from theta = 2 pi `start_turn` inward, the
    /// head moving at `head_speed` metres per second along the curve.
    ///
    /// # Errors
    /// A sentence where there is no memory for the constant pi.
    pub fn new(team: Team, pitch: f64, start_turn: f64, head_speed: f64) -> Result<Self, String> {
        let mut constants = Consts::new().map_err(|error| format!("the high-precision reference: {error:?}"))?;
        let turn = product(&precise(2.0), &constants.pi(BITS, ROUNDING));
        let growth = quotient(&precise(pitch), &turn);
        let start = product(&turn, &precise(start_turn));
        Ok(Self { team, start, growth, growth_rounded: pitch / TAU, head_speed, constants })
    }

    /// All handles at `time` simulated seconds, the head first.
    ///
    /// # Errors
    /// [`Fold`] where a link has no follower on the first rise of the chord.
    pub fn handles(&mut self, time: f64) -> Result<Vec<ReferenceHandle>, Fold> {
        let head = self.head(time);
        let mut front = self.point(head);
        // d theta / dt of the head, inward.
        let slope = self.arc_slope(&front.theta);
        let mut rate = quotient(&precise(-self.head_speed), &slope);
        let mut handles = vec![self.handle(&front, &rate)];
        for bench in 0..self.team.benches {
            let rear = self.follower(&front, self.team.link(bench))?;
            let (bx, by) = (difference(&front.x, &rear.x), difference(&front.y, &rear.y));
            let along = |on: &OnSpiral| sum(&product(&on.dx, &bx), &product(&on.dy, &by));
            rate = quotient(&product(&rate, &along(&front)), &along(&rear));
            handles.push(self.handle(&rear, &rate));
            front = rear;
        }
        Ok(handles)
    }

    fn handle(&self, on: &OnSpiral, rate: &BigFloat) -> ReferenceHandle {
        let speed = product(&self.arc_slope(&on.theta), rate).neg();
        ReferenceHandle { x: split(&on.x), y: split(&on.y), speed: rounded(&speed) }
    }

    /// ds / dtheta = a sqrt(1 + theta^2).
    fn arc_slope(&self, theta: &BigFloat) -> BigFloat {
        product(&self.growth, &root(&sum(&precise(1.0), &product(theta, theta))))
    }

    /// s = a/2 (theta sqrt(1 + theta^2) + ln(theta + sqrt(1 + theta^2))).
    fn arc_length(&mut self, theta: &BigFloat) -> BigFloat {
        let w = root(&sum(&precise(1.0), &product(theta, theta)));
        let logarithm = sum(theta, &w).ln(BITS, ROUNDING, &mut self.constants);
        product(&product(&precise(0.5), &self.growth), &sum(&product(theta, &w), &logarithm))
    }

    fn head(&mut self, time: f64) -> BigFloat {
        let start = self.start.clone();
        let target = difference(&self.arc_length(&start), &product(&precise(self.head_speed), &precise(time)));
        // The arc length is convex: from the outer side Newton's method cannot overshoot.
        let mut theta = start;
        for _ in 0..200 {
            let excess = difference(&self.arc_length(&theta), &target);
            let step = quotient(&excess, &self.arc_slope(&theta));
            theta = difference(&theta, &step);
            if rounded(&step).abs() <= 1e-33 * rounded(&theta).abs() {
                break;
            }
        }
        theta
    }

    fn point(&mut self, theta: BigFloat) -> OnSpiral {
        let sine = theta.sin(BITS, ROUNDING, &mut self.constants);
        let cosine = theta.cos(BITS, ROUNDING, &mut self.constants);
        let r = product(&self.growth, &theta);
        let (x, y) = (product(&r, &cosine), product(&r, &sine));
        let dx = difference(&product(&self.growth, &cosine), &y);
        let dy = sum(&product(&self.growth, &sine), &x);
        OnSpiral { theta, x, y, dx, dy }
    }

    /// The first point outward at the link's distance: a guess by walking outward in doubles, then Newton's method on
    /// the distance of the two points.
    fn follower(&mut self, front: &OnSpiral, link: f64) -> Result<OnSpiral, Fold> {
        let guess = self.walk(rounded(&front.theta), link).ok_or(Fold)?;
        let mut theta = sum(&front.theta, &precise(guess));
        let square = product(&precise(link), &precise(link));
        for _ in 0..60 {
            let rear = self.point(theta.clone());
            let (bx, by) = (difference(&rear.x, &front.x), difference(&rear.y, &front.y));
            let excess = difference(&sum(&product(&bx, &bx), &product(&by, &by)), &square);
            let along = sum(&product(&rear.dx, &bx), &product(&rear.dy, &by));
            if rounded(&along) <= 0.0 {
                return Err(Fold);
            }
            let step = quotient(&excess, &product(&precise(2.0), &along));
            theta = difference(&rear.theta, &step);
            // The next point is better still by as many digits again.
            if rounded(&step).abs() <= 1e-18 * rounded(&difference(&theta, &front.theta)).abs() {
                return Ok(self.point(theta));
            }
        }
        Err(Fold)
    }

    /// The increment at which the distance first exceeds the link, walking outward in steps of a sixteenth of the
    /// link, then halving; `None` where the distance begins to shrink first.
    fn walk(&self, theta: f64, link: f64) -> Option<f64> {
        let a = self.growth_rounded;
        // The law of cosines: with plain coordinates, far out, doubles could not tell the points apart.
        let distance = |d: f64| (a * d).hypot(2.0 * a * (theta * (theta + d)).sqrt() * (0.5 * d).sin());
        let pace = (link / (16.0 * a * 1f64.hypot(theta))).min(0.05);
        let (mut low, mut high) = (0.0, pace);
        while distance(high) < link {
            if distance(high) <= distance(low) {
                return None;
            }
            (low, high) = (high, high + pace);
        }
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            *(if distance(middle) < link { &mut low } else { &mut high }) = middle;
        }
        Some(high)
    }
}
