//! A frame from the table: every handle behind the head by itself, four at a time.
//!
//! Called by the follower table only, through [`write`]. Angles are in turns.

use std::f64::consts::TAU;

use super::columns::{Columns, PHASES, Phase};
use super::stencil::{DIFFERENCES, REACH, Stencil};
use crate::chain::arithmetic::{sine_cosine, within_half_turn};
#[cfg(target_arch = "x86_64")]
use crate::chain::lanes::avx2::Avx2;
use crate::chain::lanes::{Instructions, LANES, Lanes, Portable, Row};
use crate::chain::{Chain, Velocities};

/// What a frame needs to know besides the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    /// The knot nearest to the second handle.
    pub knot: usize,
    /// How far beyond it the handle is, -1/2 to 1/2 knots.
    pub between: f64,
    /// Metres per turn.
    pub pitch: f64,
    /// Knots per second; negative, since the way goes inward.
    pub knots_per_second: f64,
    /// Whether velocities are wanted.
    pub velocities: Velocities,
}

/// Writes all handles but the head. The heading of the last is not its own.
///
/// `instructions` must be among [`Instructions::available`].
pub(super) fn write(
    instructions: Instructions,
    columns: &Columns,
    stencil: &Stencil,
    moment: &Moment,
    chain: &mut Chain,
) {
    match instructions {
        // SAFETY: a solver is only made with instructions that this processor was found to have.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512 => unsafe { write_with_avx512(columns, stencil, moment, chain) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 => unsafe { write_with_avx2(columns, stencil, moment, chain) },
        _ => write_with::<Portable>(columns, stencil, moment, chain),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
fn write_with_avx512(columns: &Columns, stencil: &Stencil, moment: &Moment, chain: &mut Chain) {
    write_with::<Avx2>(columns, stencil, moment, chain);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn write_with_avx2(columns: &Columns, stencil: &Stencil, moment: &Moment, chain: &mut Chain) {
    write_with::<Avx2>(columns, stencil, moment, chain);
}

/// A phase from the column on that a frame begins with.
#[derive(Clone, Copy)]
struct Part<'a> {
    to_next: &'a [f64],
    tilt_to_next: &'a [f64],
}

#[inline(always)]
fn write_with<L: Lanes>(columns: &Columns, stencil: &Stencil, moment: &Moment, chain: &mut Chain) {
    let phases = columns.phases();
    let handles = chain.handles() - 1;
    // Differences j = 0, 4, 8 of a stencil are of one phase, 1, 5, 9 of the next, and so on.
    let first = moment.knot - REACH;
    let parts: [Part; PHASES] = std::array::from_fn(|part| {
        let knot = first + part;
        let (phase, column) = (&phases[knot % PHASES], knot / PHASES);
        Part { to_next: &phase.to_next[column..], tilt_to_next: &phase.tilt_to_next[column..] }
    });
    let nearest = &phases[moment.knot % PHASES];
    let column = moment.knot / PHASES;
    let weights = stencil.at(moment.between);
    let splat = |weights: [f64; DIFFERENCES]| weights.map(|weight| Row([weight; LANES]));
    let frame = Frame { parts, value: splat(weights.value), slope: splat(weights.slope), moment };
    let Chain { x, y, heading, speed, vx, vy } = chain;
    let mut outputs = [x, y, heading, speed, vx, vy].map(|output| output[1..].as_chunks_mut::<LANES>());
    let wanted = if moment.velocities == Velocities::Computed { 6 } else { 3 };
    for four in 0..handles / LANES {
        let numbers = frame.four::<L>(nearest, column, four * LANES);
        for ((whole, _), numbers) in outputs.iter_mut().zip(numbers).take(wanted) {
            whole[four] = numbers.row().0;
        }
    }
    let left = handles % LANES;
    if left > 0 {
        let numbers = frame.four::<L>(nearest, column, handles - left);
        for ((_, rest), numbers) in outputs.iter_mut().zip(numbers).take(wanted) {
            rest.copy_from_slice(&numbers.row().0[..left]);
        }
    }
}

/// Four neighbours in a list.
#[inline(always)]
fn load<L: Lanes>(numbers: &[f64], at: usize) -> L {
    let mut row = Row::ZERO;
    row.0.copy_from_slice(&numbers[at..at + LANES]);
    L::load(&row)
}

struct Frame<'a> {
    parts: [Part<'a>; PHASES],
    value: [Row; DIFFERENCES],
    slope: [Row; DIFFERENCES],
    moment: &'a Moment,
}

impl Frame<'_> {
    /// x, y, heading, speed, vx and vy of the four handles from the one `at` behind the second; without velocities the
    /// last three are unspecified.
    #[inline(always)]
    fn four<L: Lanes>(&self, nearest: &Phase, column: usize, at: usize) -> [L; 6] {
        // Two sums each, since a vector waits longer for a sum than it takes to begin another.
        let mut ahead = [L::all(0.0); 2];
        let mut tilt = [L::all(0.0); 2];
        let mut slope = [L::all(0.0); 2];
        for j in 0..DIFFERENCES {
            let part = &self.parts[j % PHASES];
            let to_next: L = load(part.to_next, at + j / PHASES);
            let tilt_to_next: L = load(part.tilt_to_next, at + j / PHASES);
            let weight = L::load(&self.value[j]);
            ahead[j % 2] = weight.multiply_add(to_next, ahead[j % 2]);
            tilt[j % 2] = weight.multiply_add(tilt_to_next, tilt[j % 2]);
            slope[j % 2] = L::load(&self.slope[j]).multiply_add(to_next, slope[j % 2]);
        }
        let [ahead, tilt, slope] = [ahead, tilt, slope].map(|[even, odd]| even + odd);
        let at = column + at;
        let tau = load::<L>(&nearest.turns, at) + ahead;
        let (sine_ahead, cosine_ahead) = sine_cosine(L::all(TAU) * ahead);
        let (sine_there, cosine_there): (L, L) = (load(&nearest.sine, at), load(&nearest.cosine, at));
        let cosine = sine_there.negated_multiply_add(sine_ahead, cosine_there * cosine_ahead);
        let sine = cosine_there.multiply_add(sine_ahead, sine_there * cosine_ahead);
        let r = L::all(self.moment.pitch) * tau;
        let heading = L::all(TAU) * within_half_turn(load::<L>(&nearest.bearing, at) + (ahead + tilt));
        // d/dt of r (cos theta, sin theta).
        let outward = L::all(self.moment.pitch * self.moment.knots_per_second) * slope;
        let theta = L::all(TAU) * tau;
        let vx = outward * theta.negated_multiply_add(sine, cosine);
        let vy = outward * theta.multiply_add(cosine, sine);
        let speed = (L::all(0.0) - outward) * theta.multiply_add(theta, L::all(1.0)).sqrt();
        [r * cosine, r * sine, heading, speed, vx, vy]
    }
}
