//! One correction of the whole chain and what follows from it, four benches at a time.
//!
//! Called by the whole-chain solver only, through [`correct`]. Everything is in turns, tau = theta / 2 pi, so that the
//! pitch p leaves the equations. With u_i = tau_{i+1} - tau_i the link between handles i and i+1 has its length where
//!
//! g(tau, u) = (u/2)^2 + tau (tau + u) sin^2(pi u) - (link / 2p)^2 = 0,
//!
//! the law of cosines divided by 4 p^2, without a difference of near numbers. Newton's correction of all unknowns is
//! one bidiagonal substitution, d tau_{i+1} = m_i d tau_i - g_i / g_u with m = 1 - g_tau / g_u, the slopes taken from
//! the frame before (the error bound counts how much they have changed); the same m at the solution gives the rates,
//! tau'_{i+1} = m_i tau'_i. The angles are summed as fixed-point numbers, so that nothing is lost along the chain and
//! whole turns come off by themselves.
//!
//! What runs along the chain is no obstacle to vectors: a chunk of the chain is cut into four strands, one per lane.
//! Each strand is walked as if it began with nothing (a linear map of what it really begins with), and the beginnings
//! are put in afterwards.

use std::f64::consts::{PI, TAU};

use crate::chain::arithmetic::{
    Quarters, SHORT_ARC_TANGENT, fixed_point, quarters, short_arc_tangent_in_turns, sine_cosine, sine_cosine_of_half,
    to_quarter, turned_by_quarters, within_half_turn,
};
#[cfg(target_arch = "x86_64")]
use crate::chain::lanes::avx2::Avx2;
use crate::chain::lanes::{Bits, Instructions, LANES, Lanes, Portable, Row};
use crate::chain::{Chain, Velocities};

/// The most handles of a strand: as many as stay in the first-level cache from pass to pass.
const LONGEST_STRAND: usize = 28;

/// The unknowns of all benches and what is known of their motion.
///
/// The chain is solved a little further than it is long, to fill the last chunk; the benches there are like the last.
#[derive(Debug, Clone)]
pub(super) struct State {
    /// Handles per strand, a multiple of the lanes.
    strand: usize,
    /// Chunk after chunk, each with as many fours as a strand has handles.
    fours: Vec<Four>,
    /// The chunk under way; used again for every chunk, so that it stays in the first-level cache.
    passing: Vec<Passing>,
    /// Which of the rates are those of the last frame; see [`Four::rate`].
    newest: usize,
}

/// Four benches and their front handles, one of each strand: what is kept from frame to frame.
#[derive(Debug, Clone)]
struct Four {
    /// (link / 2 pitch)^2.
    link_term: Row,
    /// u: turns from the front handle to the rear one.
    increment: Row,
    /// tau: turns of the front handle.
    turns: Row,
    /// tau', turns per metre of the head's travel, in the last two frames: at [`State::newest`] in the last one.
    rate: [Row; 2],
    /// u' in the same frames.
    spread: [Row; 2],
    /// -g_tau / g_u at the last solution.
    ratio: Row,
    /// 1 / g_u at the last solution.
    reciprocal: Row,
}

impl Four {
    const ZERO: Self = Self {
        link_term: Row::ZERO,
        increment: Row::ZERO,
        turns: Row::ZERO,
        rate: [Row::ZERO; 2],
        spread: [Row::ZERO; 2],
        ratio: Row::ZERO,
        reciprocal: Row::ZERO,
    };
}

/// What is handed from pass to pass for a [`Four`].
#[derive(Debug, Clone)]
struct Passing {
    /// u, predicted, then corrected.
    increment: Row,
    /// tau, predicted, then corrected.
    turns: Row,
    /// sin(pi u).
    half_sine: Row,
    /// cos(pi u).
    half_cosine: Row,
    /// -g / g_u.
    shift: Row,
    /// The product of all m before, in this strand.
    product: Row,
    /// The sum along this strand: of the corrections, then of the increments in units of 2^-64 turns.
    sum: Row,
}

impl Passing {
    const ZERO: Self = Self {
        increment: Row::ZERO,
        turns: Row::ZERO,
        half_sine: Row::ZERO,
        half_cosine: Row::ZERO,
        shift: Row::ZERO,
        product: Row::ZERO,
        sum: Row::ZERO,
    };
}

impl State {
    /// The state of a chain of `handles`, with `link_term(bench)` = (link / 2 pitch)^2 of each bench.
    pub(super) fn new(handles: usize, link_term: impl Fn(usize) -> f64) -> Self {
        let chunks = handles.div_ceil(LANES * LONGEST_STRAND);
        let strand = handles.div_ceil(LANES * chunks).next_multiple_of(LANES);
        let mut state =
            Self { strand, fours: vec![Four::ZERO; chunks * strand], passing: vec![Passing::ZERO; strand], newest: 0 };
        for bench in 0..state.benches() {
            let (four, lane) = state.place_of(bench);
            state.fours[four].link_term.0[lane] = link_term(bench);
        }
        state
    }

    /// The benches there are, those beyond the chain's end included.
    pub(super) fn benches(&self) -> usize {
        LANES * self.fours.len()
    }

    /// Bytes it holds.
    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(self.fours.as_slice()) + size_of_val(self.passing.as_slice())
    }

    fn place_of(&self, bench: usize) -> (usize, usize) {
        let (chunk, within) = (bench / (LANES * self.strand), bench % (LANES * self.strand));
        (chunk * self.strand + within % self.strand, within / self.strand)
    }

    /// Sets what is known of a bench: the turns of its front handle and its increment. Its rates become zero.
    pub(super) fn set(&mut self, bench: usize, turns: f64, increment: f64) {
        let (four, lane) = self.place_of(bench);
        let four = &mut self.fours[four];
        four.turns.0[lane] = turns;
        four.increment.0[lane] = increment;
        let (sine, cosine) = (PI * increment).sin_cos();
        let slopes =
            Slopes::at(Portable::all(turns), Portable::all(increment), Portable::all(sine), Portable::all(cosine));
        let reciprocal = 1.0 / slopes.by_increment.row().0[0];
        four.reciprocal.0[lane] = reciprocal;
        four.ratio.0[lane] = -slopes.by_turns.row().0[0] * reciprocal;
        for row in four.rate.iter_mut().chain(&mut four.spread) {
            // Multiplied by a step of zero it must give zero, which infinity would not.
            row.0[lane] = 0.0;
        }
    }

    /// Takes the rates of the last correction as those of the last frame.
    pub(super) fn remember(&mut self) {
        self.newest = 1 - self.newest;
    }
}

/// What one correction needs to know besides the state.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    /// Turns of the head, in units of 2^-64.
    pub head: u128,
    /// tau' of the head.
    pub head_rate: f64,
    /// Metres per turn.
    pub pitch: f64,
    /// Metres per second of the head.
    pub head_speed: f64,
    /// The prediction is `ahead` times the rate and `ahead_before` times the rate before, metres.
    pub ahead: f64,
    /// See `ahead`.
    pub ahead_before: f64,
    /// Whether velocities are wanted.
    pub velocities: Velocities,
}

impl Step {
    /// Turns of the head.
    pub(super) fn head_turns(&self) -> f64 {
        // Two halves, since a conversion of all 128 bits is a slow library call.
        (self.head >> 64) as u64 as f64 + (self.head as u64) as f64 / 2f64.powi(64)
    }
}

/// Predicts, corrects once and writes the chain. Returns a bound of the position error left by the correction, metres:
/// the second order of g, summed along the chain; infinite or NaN where the correction cannot be trusted at all.
///
/// `instructions` must be among [`Instructions::available`].
pub(super) fn correct(instructions: Instructions, state: &mut State, step: &Step, chain: &mut Chain) -> f64 {
    match instructions {
        // SAFETY: a solver is only made with instructions that this processor was found to have.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512 => unsafe { correct_with_avx512(state, step, chain) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 => unsafe { correct_with_avx2(state, step, chain) },
        _ => correct_with::<Portable>(state, step, chain),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
fn correct_with_avx512(state: &mut State, step: &Step, chain: &mut Chain) -> f64 {
    correct_with::<Avx2>(state, step, chain)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn correct_with_avx2(state: &mut State, step: &Step, chain: &mut Chain) -> f64 {
    correct_with::<Avx2>(state, step, chain)
}

/// What runs along the chain from chunk to chunk.
struct Running<L> {
    /// The correction of tau at the next handle.
    correction: f64,
    /// tau' of the next handle.
    rate: f64,
    /// The fraction of a turn of the next handle, in units of 2^-64.
    fraction: u64,
    /// The error bound so far, metres / 2 pi pitch, by lane.
    bound: L,
    /// The largest relative change of g_u so far.
    steepening: L,
    /// The smallest and the largest increment so far.
    least: L,
    /// See `least`.
    most: L,
}

/// Beyond such a change of its slope, g is too curved for what the bound assumes.
const LARGEST_STEEPENING: f64 = 0.5;

/// An increment above which a link spans so much of a turn that the fixed-point sum would overflow.
const LARGEST_INCREMENT: f64 = 0.99;

#[inline(always)]
fn correct_with<L: Lanes>(state: &mut State, step: &Step, chain: &mut Chain) -> f64 {
    let head = step.head_turns();
    let now = state.newest;
    // The rates of the frame before are read before the new ones take their place.
    let before = 1 - now;
    let front = &state.fours[0];
    let predicted = front.turns.0[0] + step.ahead * front.rate[now].0[0] + step.ahead_before * front.rate[before].0[0];
    let mut running = Running {
        correction: head - predicted,
        rate: step.head_rate,
        fraction: step.head as u64,
        bound: L::all(0.0),
        steepening: L::all(0.0),
        least: L::all(1.0),
        most: L::all(0.0),
    };
    let mut first = 0;
    for chunk in state.fours.chunks_exact_mut(state.strand) {
        let passing = &mut state.passing;
        let corrections = predict(chunk, passing, step, now, &mut running);
        let beginnings = refine(chunk, passing, corrections, &mut running);
        write(chunk, passing, &beginnings, step, 1 - now, first, chain);
        first += LANES * chunk.len();
    }
    let last = chain.handles() - 1;
    chain.heading[last] = chain.heading[last - 1];
    let Running { bound, steepening, least, most, .. } = running;
    let any = |row: Row, doubtful: fn(f64) -> bool| row.0.into_iter().any(doubtful);
    let doubtful = any(steepening.row(), |change| change > LARGEST_STEEPENING)
        || any(least.row(), |increment| increment <= 0.0)
        || any(most.row(), |increment| increment > LARGEST_INCREMENT);
    if doubtful { f64::INFINITY } else { TAU * step.pitch * bound.row().0.iter().sum::<f64>() }
}

/// Increments up to this need no reduction of the half angle.
const NARROW: f64 = 0.25;

/// Predicts the unknowns, evaluates g there and walks the substitution along the strands. Returns the correction of tau
/// at the beginning of each.
#[inline(always)]
fn predict<L: Lanes>(chunk: &[Four], passing: &mut [Passing], step: &Step, now: usize, running: &mut Running<L>) -> L {
    let before = 1 - now;
    let (ahead, ahead_before) = (L::all(step.ahead), L::all(step.ahead_before));
    let (mut product, mut sum) = (L::all(1.0), L::all(0.0));
    for (four, passing) in chunk.iter().zip(passing) {
        let tau_ahead = ahead.multiply_add(L::load(&four.rate[now]), ahead_before * L::load(&four.rate[before]));
        let u_ahead = ahead.multiply_add(L::load(&four.spread[now]), ahead_before * L::load(&four.spread[before]));
        let u = L::load(&four.increment) + u_ahead;
        let tau = L::load(&four.turns) + tau_ahead;
        let (sine, cosine) = if u.any_above(NARROW) { sine_cosine_of_half(u) } else { sine_cosine(L::all(PI) * u) };
        let half = L::all(0.5) * u;
        let radial = half.multiply_add(half, L::all(0.0) - L::load(&four.link_term));
        let g = (tau * (tau + u)).multiply_add(sine * sine, radial);
        let shift = L::all(0.0) - g * L::load(&four.reciprocal);
        passing.increment = u.row();
        passing.turns = tau.row();
        passing.half_sine = sine.row();
        passing.half_cosine = cosine.row();
        passing.shift = shift.row();
        passing.product = product.row();
        passing.sum = sum.row();
        let m = L::all(1.0) + L::load(&four.ratio);
        product = product * m;
        sum = m.multiply_add(sum, shift);
    }
    let (product, sum) = (product.row().0, sum.row().0);
    let mut beginnings = Row::ZERO;
    for lane in 0..LANES {
        beginnings.0[lane] = running.correction;
        running.correction = product[lane] * running.correction + sum[lane];
    }
    L::load(&beginnings)
}

/// What the strands of a chunk begin with.
struct Beginnings<L: Lanes> {
    /// tau' of the first handles.
    rate: L,
    /// Their fractions of a turn, in units of 2^-64.
    fraction: L::Bits,
}

/// Corrects the unknowns, evaluates m there and walks products and sums along the strands.
#[inline(always)]
fn refine<L: Lanes>(
    chunk: &mut [Four],
    passing: &mut [Passing],
    corrections: L,
    running: &mut Running<L>,
) -> Beginnings<L> {
    let (mut product, mut sum) = (L::all(1.0), L::Bits::all(0));
    let Running { mut bound, mut steepening, mut least, mut most, .. } = *running;
    for (four, passing) in chunk.iter_mut().zip(passing) {
        let (ratio, reciprocal) = (L::load(&four.ratio), L::load(&four.reciprocal));
        let correction = L::load(&passing.product).multiply_add(corrections, L::load(&passing.sum));
        let change = ratio.multiply_add(correction, L::load(&passing.shift));
        let u = L::load(&passing.increment) + change;
        let tau = L::load(&passing.turns) + correction;
        // Sine and cosine turned by the small angle pi times the change.
        let angle = L::all(PI) * change;
        let shrink = L::all(-0.5) * angle * angle;
        let (s, c) = (L::load(&passing.half_sine), L::load(&passing.half_cosine));
        let sine = angle.multiply_add(c, shrink.multiply_add(s, s));
        let cosine = angle.negated_multiply_add(s, shrink.multiply_add(c, c));
        let slopes = Slopes::at(tau, u, sine, cosine);
        // What the old slopes, and the second order of g, have left; in turns.
        let steeper = slopes.by_increment.multiply_add(reciprocal, L::all(-1.0)).abs();
        let other = slopes.by_turns.multiply_add(reciprocal, ratio).abs();
        let (change, correction) = (change.abs(), correction.abs());
        let outer = tau + u;
        let curved = second_order(outer, sine, change, correction) * reciprocal;
        let left = steeper.multiply_add(change, other.multiply_add(correction, curved));
        bound = left.multiply_add(outer + outer, bound);
        steepening = steepening.max(steeper);
        least = least.min(u);
        most = most.max(u);
        let reciprocal = L::all(1.0) / slopes.by_increment;
        let by_turns = slopes.by_turns * reciprocal;
        four.increment = u.row();
        passing.increment = u.row();
        passing.turns = tau.row();
        passing.half_sine = sine.row();
        passing.half_cosine = cosine.row();
        four.ratio = (L::all(0.0) - by_turns).row();
        four.reciprocal = reciprocal.row();
        passing.product = product.row();
        passing.sum = L::from_bits(sum).row();
        product = product * (L::all(1.0) - by_turns);
        sum = sum.plus(fixed_point(u));
    }
    (running.bound, running.steepening, running.least, running.most) = (bound, steepening, least, most);
    let (product, sum) = (product.row().0, L::from_bits(sum).row().0);
    let (mut rates, mut fractions) = (Row::ZERO, Row::ZERO);
    for lane in 0..LANES {
        rates.0[lane] = running.rate;
        fractions.0[lane] = f64::from_bits(running.fraction);
        running.rate *= product[lane];
        running.fraction = running.fraction.wrapping_add(sum[lane].to_bits());
    }
    Beginnings { rate: L::load(&rates), fraction: L::load(&fractions).bits() }
}

/// Evaluates the handles and writes those that the chain has. The heading of its last handle is not its own.
#[inline(always)]
fn write<L: Lanes>(
    chunk: &mut [Four],
    passing: &[Passing],
    beginnings: &Beginnings<L>,
    step: &Step,
    next: usize,
    first: usize,
    chain: &mut Chain,
) {
    let strand = chunk.len();
    let Chain { x, y, heading, speed, vx, vy } = chain;
    let mut outputs = [x, y, heading, speed, vx, vy].map(|output| output.as_chunks_mut::<LANES>());
    let wanted = if step.velocities == Velocities::Computed { 6 } else { 3 };
    // As many steps along the strands as there are strands: a square that can be turned into the chain's order.
    for (square, (fours, passing)) in chunk.chunks_exact_mut(LANES).zip(passing.chunks_exact(LANES)).enumerate() {
        let mut poses = [[L::all(0.0); LANES]; 6];
        for (column, (four, passing)) in fours.iter_mut().zip(passing).enumerate() {
            let numbers = evaluate(four, passing, beginnings, step, next);
            for (row, number) in poses.iter_mut().zip(numbers) {
                row[column] = number;
            }
        }
        for ((whole, rest), rows) in outputs.iter_mut().zip(poses).take(wanted) {
            for (lane, row) in L::transposed(rows).into_iter().enumerate() {
                let at = (first + lane * strand) / LANES + square;
                let row = row.row().0;
                if let Some(place) = whole.get_mut(at) {
                    *place = row;
                } else if at == whole.len() {
                    rest.copy_from_slice(&row[..rest.len()]);
                }
            }
        }
    }
}

/// x, y, heading, speed, vx and vy of four handles; without velocities the last three are unspecified.
#[inline(always)]
fn evaluate<L: Lanes>(
    four: &mut Four,
    passing: &Passing,
    beginnings: &Beginnings<L>,
    step: &Step,
    next: usize,
) -> [L; 6] {
    let fraction = L::load(&passing.sum).bits().plus(beginnings.fraction);
    let rate = L::load(&passing.product) * beginnings.rate;
    four.rate[next] = rate.row();
    four.spread[next] = (rate * L::load(&four.ratio)).row();
    let Quarters { quadrant, quarters, part, rest } = quarters::<L>(fraction);
    let angle = L::all(TAU).multiply_add(part, L::all(TAU) * rest);
    let (sine, cosine) = turned_by_quarters(quadrant, sine_cosine(angle));
    // The corrected turns are right to a few digits of their last; the sum, to the last.
    let tau = to_quarter(L::load(&passing.turns) - part) + part;
    four.turns = tau.row();
    let r = L::all(step.pitch) * tau;
    // The bench against the perpendicular of the middle angle: p u cos(pi u) against p (2 tau + u) sin(pi u).
    let u = L::load(&passing.increment);
    let across = L::all(2.0).multiply_add(tau, u) * L::load(&passing.half_sine);
    let aside = u * L::load(&passing.half_cosine) / across;
    let middle = L::all(0.5).multiply_add(u, L::all(0.25).multiply_add(quarters, part)) - L::all(0.25);
    let aside = if aside.abs().any_above(SHORT_ARC_TANGENT) {
        L::load(&Row(aside.row().0.map(|tangent| tangent.atan() / TAU)))
    } else {
        short_arc_tangent_in_turns(aside)
    };
    let heading = L::all(TAU) * within_half_turn(middle - aside);
    // d/dt of r (cos theta, sin theta).
    let outward = L::all(step.pitch * step.head_speed) * rate;
    let theta = L::all(TAU) * tau;
    let vx = outward * theta.negated_multiply_add(sine, cosine);
    let vy = outward * theta.multiply_add(cosine, sine);
    let speed = (L::all(0.0) - outward) * theta.multiply_add(theta, L::all(1.0)).sqrt();
    [r * cosine, r * sine, heading, speed, vx, vy]
}

/// The derivatives of g by the front handle's turns and by the increment.
struct Slopes<L> {
    by_turns: L,
    by_increment: L,
}

impl<L: Lanes> Slopes<L> {
    #[inline(always)]
    fn at(tau: L, u: L, sine: L, cosine: L) -> Self {
        let outer = tau + u;
        let square = sine * sine;
        let radial = tau.multiply_add(square, L::all(0.5) * u);
        Self {
            by_turns: (tau + outer) * square,
            by_increment: (L::all(TAU) * tau * outer).multiply_add(sine * cosine, radial),
        }
    }
}

/// A bound of the second order of g over a correction.
///
/// Its three derivatives are at most 2 pi^2 tau tau' + 4 pi tau' s + 1/2 by u twice, 4 pi tau' s + s^2 mixed and 2 s^2
/// by tau twice, with tau' = tau + u, which the sum below exceeds.
#[inline(always)]
fn second_order<L: Lanes>(outer: L, sine: L, change: L, correction: L) -> L {
    let around = L::all(PI) * outer * change;
    let along = sine * correction;
    let both = L::all(2.0).multiply_add(along, around);
    let square = both.multiply_add(both, along * along);
    L::all(8.0).multiply_add(outer, L::all(2.0)).multiply_add(change * change, square)
}
