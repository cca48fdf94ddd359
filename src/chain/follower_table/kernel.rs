//! A frame from the table: every handle behind the head by itself, four at a time.
//!
//! Called by the follower table only, through [`write`]. Angles are in turns.

use std::f64::consts::TAU;

use super::columns::{Columns, PHASES, Phase};
use super::stencil::{DIFFERENCES, REACH, Stencil};
use crate::chain::arithmetic::{small_sine_cosine, within_half_turn};
use crate::chain::lanes::{LANES, Lanes, Row};
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

/// Handles that are worked out together: two vectors, so that every weight is loaded for both.
pub(super) const BLOCK: usize = 2 * LANES;

/// The lists of a frame, from the column of its second handle on.
struct Frame<'a> {
    /// Differences j = 0 and 4 of a stencil are of the first part, 1 and 5 of the next, and so on.
    to_next: [&'a [f64]; PHASES],
    tilt_to_next: [&'a [f64]; PHASES],
    turns: &'a [f64],
    cosine: &'a [f64],
    sine: &'a [f64],
    bearing: &'a [f64],
    value: [Row; DIFFERENCES],
    slope: [Row; DIFFERENCES],
    /// Metres per turn.
    pitch: f64,
    /// Metres of radius per second for each turn per knot.
    outward: f64,
}

/// Writes all handles but the head. The heading of the last is not its own.
#[inline(always)]
pub(super) fn write<L: Lanes>(columns: &Columns, stencil: &Stencil, moment: &Moment, chain: &mut Chain) {
    match moment.velocities {
        Velocities::Computed => write_all::<L, true>(columns, stencil, moment, chain),
        Velocities::Omitted => write_all::<L, false>(columns, stencil, moment, chain),
    }
}

#[inline(always)]
fn write_all<L: Lanes, const VELOCITIES: bool>(
    columns: &Columns,
    stencil: &Stencil,
    moment: &Moment,
    chain: &mut Chain,
) {
    let handles = chain.handles() - 1;
    let padded = handles.next_multiple_of(BLOCK);
    let phases = columns.phases();
    let part = |list: fn(&Phase) -> &[f64], part: usize| {
        let knot = moment.knot - REACH + part;
        &list(&phases[knot % PHASES])[knot / PHASES..][..padded + (DIFFERENCES - 1) / PHASES]
    };
    let nearest = |list: fn(&Phase) -> &[f64]| &list(&phases[moment.knot % PHASES])[moment.knot / PHASES..][..padded];
    let weights = stencil.at(moment.between);
    let splat = |weights: [f64; DIFFERENCES]| weights.map(|weight| Row([weight; LANES]));
    let frame = Frame {
        to_next: std::array::from_fn(|k| part(|phase| &phase.to_next, k)),
        tilt_to_next: std::array::from_fn(|k| part(|phase| &phase.tilt_to_next, k)),
        turns: nearest(|phase| &phase.turns),
        cosine: nearest(|phase| &phase.cosine),
        sine: nearest(|phase| &phase.sine),
        bearing: nearest(|phase| &phase.bearing),
        value: splat(weights.value),
        slope: splat(weights.slope),
        pitch: moment.pitch,
        outward: moment.pitch * moment.knots_per_second,
    };
    let Chain { x, y, heading, speed, vx, vy } = chain;
    let mut outputs = [x, y, heading, speed, vx, vy].map(|output| output[1..].as_chunks_mut::<BLOCK>());
    let wanted = if VELOCITIES { 6 } else { 3 };
    let whole = handles / BLOCK;
    // Cut here, so that no block has to ask whether it is there.
    let [x, y, heading, speed, vx, vy] = &mut outputs;
    let mut lists = [
        &mut x.0[..whole],
        &mut y.0[..whole],
        &mut heading.0[..whole],
        &mut speed.0[..whole],
        &mut vx.0[..whole],
        &mut vy.0[..whole],
    ];
    for block in 0..whole {
        let numbers = frame.block::<L, VELOCITIES>(block * BLOCK);
        for (list, [first, second]) in lists.iter_mut().zip(numbers).take(wanted) {
            list[block][..LANES].copy_from_slice(&first.row().0);
            list[block][LANES..].copy_from_slice(&second.row().0);
        }
    }
    if whole * BLOCK < handles {
        let numbers = frame.block::<L, VELOCITIES>(whole * BLOCK);
        for ((_, rest), [first, second]) in outputs.iter_mut().zip(numbers).take(wanted) {
            let numbers = first.row().0.into_iter().chain(second.row().0);
            rest.iter_mut().zip(numbers).for_each(|(place, number)| *place = number);
        }
    }
}

/// Four neighbours in a list of a [`Frame`], `at` < its `padded`, a multiple of the lanes, plus at most
/// (DIFFERENCES - 1) / PHASES.
#[inline(always)]
fn load<L: Lanes>(numbers: &[f64], at: usize) -> L {
    debug_assert!(at + LANES <= numbers.len());
    let mut row = Row::ZERO;
    // SAFETY: `write_all` cuts every list to `padded` numbers, those with a stencil to (DIFFERENCES - 1) / PHASES more,
    // and asks only for blocks that end at or before `padded`. Checking each of the loads takes a fifth of the frame's
    // time (`cargo bench --bench frame -- table`), since the lists are too many for the compiler to see through.
    row.0.copy_from_slice(unsafe { numbers.get_unchecked(at..at + LANES) });
    L::load(&row)
}

impl Frame<'_> {
    /// x, y, heading, speed, vx and vy of the handles from the one `at` behind the second; without velocities the last
    /// three are unspecified.
    #[inline(always)]
    fn block<L: Lanes, const VELOCITIES: bool>(&self, at: usize) -> [[L; 2]; 6] {
        let places = [at, at + LANES];
        let [mut ahead, mut tilt, mut slope] = [[L::all(0.0); 2]; 3];
        for j in 0..DIFFERENCES {
            let (to_next, tilt_to_next) = (self.to_next[j % PHASES], self.tilt_to_next[j % PHASES]);
            let (value_weight, slope_weight) = (L::load(&self.value[j]), L::load(&self.slope[j]));
            for (half, place) in places.into_iter().enumerate() {
                let difference: L = load(to_next, place + j / PHASES);
                ahead[half] = value_weight.multiply_add(difference, ahead[half]);
                if VELOCITIES {
                    slope[half] = slope_weight.multiply_add(difference, slope[half]);
                }
                tilt[half] = value_weight.multiply_add(load(tilt_to_next, place + j / PHASES), tilt[half]);
            }
        }
        let four = |half: usize| self.four::<L, VELOCITIES>(places[half], ahead[half], tilt[half], slope[half]);
        let (first, second) = (four(0), four(1));
        std::array::from_fn(|number| [first[number], second[number]])
    }

    #[inline(always)]
    fn four<L: Lanes, const VELOCITIES: bool>(&self, at: usize, ahead: L, tilt: L, slope: L) -> [L; 6] {
        let tau = load::<L>(self.turns, at) + ahead;
        let (sine_ahead, cosine_ahead) = small_sine_cosine(L::all(TAU) * ahead);
        let (sine_there, cosine_there): (L, L) = (load(self.sine, at), load(self.cosine, at));
        let cosine = sine_there.negated_multiply_add(sine_ahead, cosine_there * cosine_ahead);
        let sine = cosine_there.multiply_add(sine_ahead, sine_there * cosine_ahead);
        let r = L::all(self.pitch) * tau;
        let heading = L::all(TAU) * within_half_turn(load::<L>(self.bearing, at) + (ahead + tilt));
        if !VELOCITIES {
            let none = L::all(f64::NAN);
            return [r * cosine, r * sine, heading, none, none, none];
        }
        // d/dt of r (cos theta, sin theta).
        let outward = L::all(self.outward) * slope;
        let theta = L::all(TAU) * tau;
        let vx = outward * theta.negated_multiply_add(sine, cosine);
        let vy = outward * theta.multiply_add(cosine, sine);
        let speed = (L::all(0.0) - outward) * theta.multiply_add(theta, L::all(1.0)).sqrt();
        [r * cosine, r * sine, heading, speed, vx, vy]
    }
}
