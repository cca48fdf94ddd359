//! Where a chain of equal links stands for every place along itself: the table proper, and how it is made.
//!
//! All links but the head's are equal, so that one map F takes every handle's place to its follower's. The table holds a
//! smooth function T with T(alpha + 1) = F(T(alpha)): a chain whose second handle stands at T(alpha) has its others at
//! T(alpha + 1), T(alpha + 2) and so on, each found without the ones before. (T is the inverse of an Abel function of
//! F; Kuczma, Choczewski and Ger, Iterative Functional Equations, 1990.) Any start of T over one link gives
//! such a function; the smooth one is fitted far outside, where the spiral is nearly straight, and followed inward.
//!
//! Called by the follower table only. Angles are in turns, places in fixed-point turns of 2^-64.

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, DVector};

use super::kernel::BLOCK;
use super::stencil::{DIFFERENCES, REACH, Stencil};
use crate::chain::Team;
use crate::chain::arithmetic::SMALL_ANGLE;
use crate::geometry::path::Path;
use crate::geometry::root::increasing_root;
use crate::geometry::spiral::Spiral;

/// Knots per link.
pub(super) const PHASES: usize = 4;

/// Links beyond the tail at which the table begins to be made: so far out that it is smooth.
const LEAD: usize = 64;

/// Links over which its beginning is fitted.
const FITTED_LINKS: usize = 4;

/// The degree of the polynomial that is fitted, and at how many places.
const FITTED_DEGREE: usize = 8;
const FITTED_PLACES: usize = 32;

/// The most links that a table spans: 34 MB.
const MOST_COLUMNS: usize = 1 << 17;

/// Increments above this end the table: half way between two knots, a handle is then [`SMALL_ANGLE`] from either.
const LARGEST_INCREMENT: f64 = SMALL_ANGLE * 2.0 * PHASES as f64 / TAU;

/// The knots of one phase, one per link, from the innermost outward.
#[derive(Debug, Clone, Default)]
pub(super) struct Phase {
    /// Turns of a handle at the knot.
    pub turns: Vec<f64>,
    /// Cosine and sine of its angle.
    pub cosine: Vec<f64>,
    /// See `cosine`.
    pub sine: Vec<f64>,
    /// Its fraction of a turn plus the tilt, which is the angle of a bench less that of its front handle, in turns.
    pub bearing: Vec<f64>,
    /// Turns to the next knot, which is one of the next phase.
    pub to_next: Vec<f64>,
    /// What the tilt grows to the next knot.
    pub tilt_to_next: Vec<f64>,
}

/// One handle between two knots.
pub(super) struct Single {
    /// Turns beyond the nearest knot.
    pub turns: f64,
    /// Turns per knot there.
    pub turns_per_knot: f64,
    /// The angle of its bench less its own, turns.
    pub tilt: f64,
}

/// The table.
#[derive(Debug, Clone)]
pub(super) struct Columns {
    phases: [Phase; PHASES],
    /// Every knot, the phases in turn, from the innermost outward.
    knots: Vec<i128>,
}

impl Columns {
    /// The table for `team` on `path` from the start inward as far as it goes; `None` where it would be too large or
    /// the chain cannot stand at the start.
    pub(super) fn new(path: &Spiral, team: &Team) -> Option<Self> {
        let link = team.link(1);
        if path.length() / link + (team.benches + 2 * LEAD) as f64 > MOST_COLUMNS as f64 {
            return None;
        }
        let (base, ahead) = beginning(path, team)?;
        let mut columns = vec![ahead.map(|turns| base + fixed(turns))];
        let term = (link / (2.0 * path.pitch())).powi(2);
        // Far out a leader is as near as a follower.
        let mut increments = [0.0; PHASES];
        for (increment, rear) in increments.iter_mut().zip(columns[0]) {
            *increment = path.increment(path.pitch() * turns(rear), link).ok()? / TAU;
        }
        // A handle stands on every place of the path at most once, so this ends before the centre.
        while let Some(rear) = columns.last().copied() {
            let Some(next) = leaders(rear, increments, term) else { break };
            increments = next;
            columns.push(std::array::from_fn(|phase| rear[phase] - fixed(increments[phase])));
        }
        let knots: Vec<i128> = columns.into_iter().rev().flatten().collect();
        Some(Self { phases: tabulated(&knots), knots })
    }

    pub(super) fn phases(&self) -> &[Phase; PHASES] {
        &self.phases
    }

    /// How many knots the table has lists for.
    pub(super) fn len(&self) -> usize {
        self.phases[0].turns.len() * PHASES
    }

    /// Bytes it holds.
    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(self.knots.as_slice()) + PHASES * 6 * size_of_val(self.phases[0].turns.as_slice())
    }

    /// One handle, `between` knots beyond `knot`.
    pub(super) fn around(&self, knot: usize, between: f64, stencil: &Stencil) -> Single {
        let weights = stencil.at(between);
        let of_stencil = |number: fn(&Phase) -> &[f64]| -> [f64; DIFFERENCES] {
            std::array::from_fn(|j| {
                let at = knot - REACH + j;
                number(&self.phases[at % PHASES])[at / PHASES]
            })
        };
        let (turns, turns_per_knot) = weights.of(&of_stencil(|phase| &phase.to_next));
        let (tilt, _) = weights.of(&of_stencil(|phase| &phase.tilt_to_next));
        let phase = &self.phases[knot % PHASES];
        let tilt_of_knot = phase.bearing[knot / PHASES] - fraction_of_turn(fraction(self.knots[knot]));
        Single { turns, turns_per_knot, tilt: tilt_of_knot + tilt }
    }

    /// Turns from a knot to a place.
    pub(super) fn turns_from(&self, knot: usize, place: i128) -> f64 {
        turns(place - self.knots[knot])
    }

    /// The knot nearest to a place and how many knots beyond it the place lies, -1/2 to 1/2; `None` where the table does
    /// not go as far, or not as far beyond as a team of `benches` with its second handle there.
    pub(super) fn locate(&self, place: i128, benches: usize, stencil: &Stencil) -> Option<(usize, f64)> {
        let above = self.knots.partition_point(|knot| *knot <= place);
        // Room for the stencil, and for a place between two others that rounds to the knot beyond both.
        let last_column = above / PHASES + benches.next_multiple_of(BLOCK) + 3;
        if above < REACH + 2 || last_column >= self.len() / PHASES {
            return None;
        }
        let share = self.turns_from(above - 1, place) / turns(self.knots[above] - self.knots[above - 1]);
        let (knot, mut between) = if share > 0.5 { (above, share - 1.0) } else { (above - 1, share) };
        let beyond = self.turns_from(knot, place);
        // The table is so smooth that Newton's method doubles its digits each time from the third or so it begins with.
        for _ in 0..5 {
            let found = self.around(knot, between, stencil);
            between -= (found.turns - beyond) / found.turns_per_knot;
        }
        (between.abs() <= 0.75).then_some((knot, between))
    }
}

/// The place far outside from which the table is made, and the turns from there of the knots of one link.
fn beginning(path: &Spiral, team: &Team) -> Option<(i128, [f64; PHASES])> {
    let link = team.link(1);
    let mut place = path.follower(path.start(), team.link(0)).ok()?;
    for _ in 1..team.benches + LEAD {
        place = path.follower(place, link).ok()?;
    }
    let base = place.in_fixed_point_turns();
    let base_turns = place.in_turns();
    let mut ends = [0.0; FITTED_LINKS];
    for end in &mut ends {
        place = path.follower(place, link).ok()?;
        *end = turns(place.in_fixed_point_turns() - base);
    }
    let [.., before_last, span] = ends;
    // With A(turns) = sum of c_k y^k, y from -1 to 1 over the fitted links: A of a follower less A of its front is 1.
    let scaled = |ahead: f64| 2.0 * ahead / span - 1.0;
    let increment = |ahead: f64| path.increment(path.pitch() * (base_turns + ahead), link).map(|radians| radians / TAU);
    let mut equations = DMatrix::zeros(FITTED_PLACES, FITTED_DEGREE);
    for row in 0..FITTED_PLACES {
        let ahead = before_last * row as f64 / (FITTED_PLACES - 1) as f64;
        let (front, rear) = (scaled(ahead), scaled(ahead + increment(ahead).ok()?));
        for column in 0..FITTED_DEGREE {
            equations[(row, column)] = rear.powi(column as i32 + 1) - front.powi(column as i32 + 1);
        }
    }
    let ones = DVector::from_element(FITTED_PLACES, 1.0);
    let fitted = equations.svd(true, true).solve(&ones, 1e-15).ok()?;
    let links_and_slope = |y: f64| {
        let (mut value, mut slope, mut power) = (0.0, 0.0, 1.0);
        for (column, coefficient) in fitted.iter().enumerate() {
            slope += coefficient * (column + 1) as f64 * power;
            power *= y;
            value += coefficient * (power - (-1f64).powi(column as i32 + 1));
        }
        (value, slope)
    };
    let ahead = std::array::from_fn(|phase| {
        let wanted = phase as f64 / PHASES as f64;
        let excess = |y: f64| {
            let (links, slope) = links_and_slope(y);
            (links - wanted, slope)
        };
        let y = increasing_root(excess, -1.0, 1.0, 2.0 * wanted / FITTED_LINKS as f64 - 1.0);
        0.5 * (y + 1.0) * span
    });
    Some((base, ahead))
}

/// Turns from the leaders to handles at `rear`, from guesses; `None` where there is none, or none for this table.
fn leaders(rear: [i128; PHASES], guesses: [f64; PHASES], term: f64) -> Option<[f64; PHASES]> {
    let mut increments = guesses;
    for (increment, rear) in increments.iter_mut().zip(rear) {
        *increment = leader(turns(rear), *increment, term)?;
    }
    Some(increments)
}

/// The root u of (u/2)^2 + (tau - u) tau sin^2(pi u) - `term` near `guess`: the law of cosines over 4 pitch^2.
fn leader(tau: f64, guess: f64, term: f64) -> Option<f64> {
    let mut u = guess;
    for _ in 0..8 {
        let (sine, cosine) = (PI * u).sin_cos();
        let front = tau - u;
        let excess = (0.5 * u).mul_add(0.5 * u, front * tau * sine * sine - term);
        let slope = 0.5 * u - tau * sine * sine + TAU * tau * front * sine * cosine;
        let step = excess / slope;
        u -= step;
        if !(slope > 0.0 && u > 0.0 && u < LARGEST_INCREMENT && u < tau) {
            return None;
        }
        // The next step would be below the last digit.
        if step.abs() < 1e-9 * u {
            return Some(u);
        }
    }
    None
}

fn tabulated(knots: &[i128]) -> [Phase; PHASES] {
    let tilts: Vec<f64> =
        knots.windows(PHASES + 1).map(|link| tilt(turns(link[0]), turns(link[PHASES] - link[0]))).collect();
    let mut phases: [Phase; PHASES] = Default::default();
    // The last ones have no next tilt; left out as a whole link, so that all lists are of one length.
    for knot in 0..tilts.len().saturating_sub(PHASES) {
        let phase = &mut phases[knot % PHASES];
        let (sine, cosine) = sine_cosine(fraction(knots[knot]));
        phase.turns.push(turns(knots[knot]));
        phase.cosine.push(cosine);
        phase.sine.push(sine);
        phase.bearing.push(fraction_of_turn(fraction(knots[knot])) + tilts[knot]);
        phase.to_next.push(turns(knots[knot + 1] - knots[knot]));
        phase.tilt_to_next.push(tilts[knot + 1] - tilts[knot]);
    }
    phases
}

/// The angle of a bench less that of its front handle, in turns: the front handle at `tau`, the rear one `u` behind.
///
/// The bench against the perpendicular of the middle angle: u cos(pi u) against (2 tau + u) sin(pi u).
pub(super) fn tilt(tau: f64, u: f64) -> f64 {
    let (sine, cosine) = (PI * u).sin_cos();
    0.5 * u - 0.25 - (u * cosine).atan2((tau + tau + u) * sine) / TAU
}

/// Fixed-point turns as a number.
pub(super) fn turns(fixed: i128) -> f64 {
    fixed as f64 / 2f64.powi(64)
}

/// The fraction of a turn of fixed-point turns, -2^63 to 2^63 of 2^-64 turns.
pub(super) fn fraction(fixed: i128) -> i64 {
    fixed as i64
}

/// A fixed-point fraction as a number, -1/2 to 1/2 turns.
pub(super) fn fraction_of_turn(fixed: i64) -> f64 {
    fixed as f64 / 2f64.powi(64)
}

/// Sine and cosine of a fixed-point fraction: of what is left of it beside whole quarters, which a double holds better.
pub(super) fn sine_cosine(fraction: i64) -> (f64, f64) {
    let quarters = fraction.wrapping_add(1 << 61) >> 62;
    let (sine, cosine) = (TAU * fraction_of_turn(fraction.wrapping_sub(quarters << 62))).sin_cos();
    match quarters & 3 {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

/// A number of turns in fixed point.
fn fixed(turns: f64) -> i128 {
    (turns * 2f64.powi(64)) as i128
}
