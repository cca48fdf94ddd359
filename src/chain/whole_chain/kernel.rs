//! One correction of the whole chain and what follows from it, over flat arrays, in blocks that keep vector units busy.
//!
//! Called by the whole-chain solver only, through [`correct`]. Everything is in turns, tau = theta / 2 pi, so that the
//! pitch p leaves the equations. With u_i = tau_{i+1} - tau_i the link between handles i and i+1 has its length where
//!
//! g(tau, u) = (u/2)^2 + tau (tau + u) sin^2(pi u) - (link / 2p)^2 = 0,
//!
//! the law of cosines divided by 4 p^2, without a difference of near numbers. Newton's correction of all unknowns is
//! one bidiagonal substitution, d tau_{i+1} = m_i d tau_i - g_i / g_u with m = 1 - g_tau / g_u, the slopes taken from the frame
//! before (the error bound counts how much they have changed); the same m at the
//! solution gives the rates, tau'_{i+1} = m_i tau'_i. The angles are summed as fixed-point numbers, so that nothing is
//! lost along the chain and whole turns come off by themselves.

use std::f64::consts::{PI, TAU};

use super::arithmetic::{
    Arithmetic, Fused, SHORT_ARC_TANGENT, Separate, fixed_point, from_small, short_arc_tangent, signed_fraction,
    sine_cosine, sine_cosine_of_fraction, sine_cosine_of_half,
};
use crate::chain::{Chain, Velocities};

/// Handles per block. Long enough that the processor overlaps one block's recurrences with the next one's sines.
pub(super) const BLOCK: usize = 16;

type Numbers = [f64; BLOCK];

/// The unknowns of all benches and what is known of their motion. All arrays but `rate*` have one length, a multiple
/// of [`BLOCK`] that is greater than the number of benches: the chain is solved a little further than it is long.
/// The `rate*` arrays have one more.
#[derive(Debug, Clone, Default)]
pub(super) struct State {
    /// (link / 2 pitch)^2 of each bench.
    pub link_term: Vec<f64>,
    /// u: turns from a bench's front handle to its rear one.
    pub increment: Vec<f64>,
    /// tau: turns of a bench's front handle.
    pub turns: Vec<f64>,
    /// g_tau of each bench at the last solution.
    pub by_turns: Vec<f64>,
    /// g_u of each bench at the last solution.
    pub by_increment: Vec<f64>,
    /// 1 / g_u of each bench at the last solution.
    pub reciprocal: Vec<f64>,
    /// tau' of each handle, turns per metre of the head's travel.
    pub rate: Vec<f64>,
    /// `rate` of the frame before.
    pub rate_before: Vec<f64>,
    /// `rate` of the frame being computed.
    pub rate_next: Vec<f64>,
}

impl State {
    /// Sets the slopes of all benches to those at the present unknowns.
    pub(super) fn renew_slopes(&mut self) {
        for bench in 0..self.increment.len() {
            let (tau, u) = (self.turns[bench], self.increment[bench]);
            let (sine, cosine) = (PI * u).sin_cos();
            let slopes = Slopes::at::<Separate>(tau, u, sine, cosine);
            self.by_turns[bench] = slopes.by_turns;
            self.by_increment[bench] = slopes.by_increment;
            self.reciprocal[bench] = 1.0 / slopes.by_increment;
        }
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

/// The instructions that a code path may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instructions {
    /// 512-bit vectors with fused multiply-add.
    Avx512,
    /// 256-bit vectors with fused multiply-add.
    Avx2,
    /// What every processor of the architecture has.
    Portable,
}

impl Instructions {
    /// All code paths that this processor can run, the fastest first.
    pub fn available() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        {
            let mut available = Vec::new();
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("fma")
            {
                available.push(Self::Avx512);
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                available.push(Self::Avx2);
            }
            available.push(Self::Portable);
            available
        }
        #[cfg(not(target_arch = "x86_64"))]
        vec![Self::Portable]
    }

    /// The name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "AVX-512",
            Self::Avx2 => "AVX2 and FMA",
            Self::Portable => "portable",
        }
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
        _ => correct_with::<Separate>(state, step, chain),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
fn correct_with_avx512(state: &mut State, step: &Step, chain: &mut Chain) -> f64 {
    correct_with::<Fused>(state, step, chain)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn correct_with_avx2(state: &mut State, step: &Step, chain: &mut Chain) -> f64 {
    correct_with::<Fused>(state, step, chain)
}

/// What runs along the chain from block to block.
struct Running {
    /// The correction of tau at the next handle.
    correction: f64,
    /// tau' of the next handle.
    rate: f64,
    /// tau of the next handle, in units of 2^-64 turns.
    turns: u128,
    /// The error bound so far, by lane.
    bound: Numbers,
}

#[inline(always)]
fn correct_with<A: Arithmetic>(state: &mut State, step: &Step, chain: &mut Chain) -> f64 {
    let fraction = (step.head as u64) as f64 / 18_446_744_073_709_551_616.0;
    let head = (step.head >> 64) as f64 + fraction;
    let predicted = state.turns[0] + step.ahead * state.rate[0] + step.ahead_before * state.rate_before[0];
    let mut running =
        Running { correction: head - predicted, rate: step.head_rate, turns: step.head, bound: [0.0; BLOCK] };
    let blocks = state.increment.len() / BLOCK;
    // Three blocks are under way at once: what runs along the chain one number at a time (substitute, sum) is then
    // overlapped by the processor with the vector work of the others, and its results are read only when they have
    // left the store buffer.
    let mut ring = [const { Block::EMPTY }; 3];
    for turn in 0..blocks + 2 {
        let (newest, middle, oldest) = (turn % 3, (turn + 2) % 3, (turn + 1) % 3);
        if turn < blocks {
            ring[newest].predict::<A>(state, step, turn * BLOCK);
        }
        if turn >= 1 && turn <= blocks {
            ring[middle].refine::<A>(state, step, (turn - 1) * BLOCK, &mut running);
        }
        if turn >= 2 {
            ring[oldest].write::<A>(step, chain, (turn - 2) * BLOCK);
        }
        if turn < blocks {
            ring[newest].substitute::<A>(&mut running);
        }
        if turn >= 1 && turn <= blocks {
            ring[middle].sum(state, (turn - 1) * BLOCK, &mut running);
        }
    }
    state.rate_next[blocks * BLOCK] = running.rate;
    let last = chain.handles() - 1;
    chain.heading[last] = chain.heading[last - 1];
    running.bound.iter().sum()
}

/// The benches of one block and their front handles, while they are being solved.
struct Block {
    increment: Numbers,
    turns: Numbers,
    half_sine: Numbers,
    half_cosine: Numbers,
    /// -g_tau / g_u, then m.
    ratio: Numbers,
    /// -g / g_u.
    shift: Numbers,
    /// The correction of the front handle's tau.
    correction: Numbers,
    rate: Numbers,
    /// Whole turns of the front handle.
    whole: [u64; BLOCK],
    /// Its fraction of a turn, in units of 2^-64.
    fraction: [u64; BLOCK],
    /// The increment in the same units.
    fixed: [u64; BLOCK],
}

impl Block {
    const EMPTY: Self = Self {
        increment: [0.0; BLOCK],
        turns: [0.0; BLOCK],
        half_sine: [0.0; BLOCK],
        half_cosine: [0.0; BLOCK],
        ratio: [0.0; BLOCK],
        shift: [0.0; BLOCK],
        correction: [0.0; BLOCK],
        rate: [0.0; BLOCK],
        whole: [0; BLOCK],
        fraction: [0; BLOCK],
        fixed: [0; BLOCK],
    };

    /// Predicts the unknowns and evaluates g and its slopes there.
    #[inline(always)]
    fn predict<A: Arithmetic>(&mut self, state: &State, step: &Step, first: usize) {
        let (rate_front, rate_rear) = neighbours(&state.rate, first);
        let (before_front, before_rear) = neighbours(&state.rate_before, first);
        let link_term = window(&state.link_term, first);
        let by_turns = window(&state.by_turns, first);
        let reciprocal = window(&state.reciprocal, first);
        let increment = window(&state.increment, first);
        let turns = window(&state.turns, first);
        let mut wide = 0;
        for k in 0..BLOCK {
            let front_ahead = A::multiply_add(step.ahead, rate_front[k], step.ahead_before * before_front[k]);
            let rear_ahead = A::multiply_add(step.ahead, rate_rear[k], step.ahead_before * before_rear[k]);
            let u = increment[k] + (rear_ahead - front_ahead);
            wide += u64::from(u > 0.25);
            self.increment[k] = u;
            self.turns[k] = turns[k] + front_ahead;
        }
        // Far from the centre no bench spans a quarter of a turn.
        if wide == 0 {
            for k in 0..BLOCK {
                (self.half_sine[k], self.half_cosine[k]) = sine_cosine::<A>(PI * self.increment[k]);
            }
        } else {
            for k in 0..BLOCK {
                (self.half_sine[k], self.half_cosine[k]) = sine_cosine_of_half::<A>(self.increment[k]);
            }
        }
        for k in 0..BLOCK {
            let (u, tau, s) = (self.increment[k], self.turns[k], self.half_sine[k]);
            let half = 0.5 * u;
            let g = A::multiply_add(tau * (tau + u), s * s, A::multiply_add(half, half, -link_term[k]));
            self.ratio[k] = -by_turns[k] * reciprocal[k];
            self.shift[k] = -g * reciprocal[k];
        }
    }

    /// The bidiagonal substitution.
    #[inline(always)]
    fn substitute<A: Arithmetic>(&mut self, running: &mut Running) {
        let mut delta = running.correction;
        for k in 0..BLOCK {
            self.correction[k] = delta;
            delta = A::multiply_add(1.0 + self.ratio[k], delta, self.shift[k]);
        }
        running.correction = delta;
    }

    /// Corrects the unknowns and evaluates m there.
    #[inline(always)]
    fn refine<A: Arithmetic>(&mut self, state: &mut State, step: &Step, first: usize, running: &mut Running) {
        // Copies, since a loop over slices that might overlap is not vectorised.
        let by_turns = *window(&state.by_turns, first);
        let by_increment = *window(&state.by_increment, first);
        let mut next = [[0.0; BLOCK]; 4];
        let mut bound = running.bound;
        for k in 0..BLOCK {
            let correction = self.correction[k];
            let change = A::multiply_add(self.ratio[k], correction, self.shift[k]);
            let u = self.increment[k] + change;
            let tau = self.turns[k] + correction;
            // Sine and cosine turned by the small angle pi times the change.
            let angle = PI * change;
            let shrink = -0.5 * angle * angle;
            let (s, c) = (self.half_sine[k], self.half_cosine[k]);
            let sine = s + A::multiply_add(angle, c, shrink * s);
            let cosine = c + A::multiply_add(-angle, s, shrink * c);
            let slopes = Slopes::at::<A>(tau, u, sine, cosine);
            let reciprocal = 1.0 / slopes.by_increment;
            let by_old_slopes = A::multiply_add(
                (slopes.by_increment - by_increment[k]).abs(),
                change.abs(),
                (slopes.by_turns - by_turns[k]).abs() * correction.abs(),
            );
            let left = by_old_slopes + second_order::<A>(tau + u, sine, change, correction);
            let sound = (slopes.by_increment > 0.0) & (u > 0.0) & (u < LARGEST_INCREMENT);
            let metres = left * reciprocal * (TAU * step.pitch * (tau + u));
            bound[k] += if sound { metres } else { f64::INFINITY };
            self.ratio[k] = A::multiply_add(-slopes.by_turns, reciprocal, 1.0);
            self.increment[k] = u;
            self.half_sine[k] = sine;
            self.half_cosine[k] = cosine;
            self.fixed[k] = fixed_point(u);
            next[0][k] = tau;
            next[1][k] = slopes.by_turns;
            next[2][k] = slopes.by_increment;
            next[3][k] = reciprocal;
        }
        running.bound = bound;
        *window_mut(&mut state.increment, first) = self.increment;
        *window_mut(&mut state.turns, first) = next[0];
        *window_mut(&mut state.by_turns, first) = next[1];
        *window_mut(&mut state.by_increment, first) = next[2];
        *window_mut(&mut state.reciprocal, first) = next[3];
    }

    /// Sums the increments to angles and multiplies the ratios to rates.
    #[inline(always)]
    fn sum(&mut self, state: &mut State, first: usize, running: &mut Running) {
        for k in 0..BLOCK {
            self.rate[k] = running.rate;
            running.rate *= self.ratio[k];
            self.whole[k] = (running.turns >> 64) as u64;
            self.fraction[k] = running.turns as u64;
            running.turns += u128::from(self.fixed[k]);
        }
        *window_mut(&mut state.rate_next, first) = self.rate;
    }

    /// Writes the handles that the chain has. The heading of its last handle is not its own.
    #[inline(always)]
    fn write<A: Arithmetic>(&self, step: &Step, chain: &mut Chain, first: usize) {
        let count = BLOCK.min(chain.handles() - first);
        let poses = self.evaluate::<A>(step);
        copy(&poses.x, &mut chain.x, first, count);
        copy(&poses.y, &mut chain.y, first, count);
        copy(&poses.heading, &mut chain.heading, first, count);
        if step.velocities == Velocities::Computed {
            copy(&poses.speed, &mut chain.speed, first, count);
            copy(&poses.vx, &mut chain.vx, first, count);
            copy(&poses.vy, &mut chain.vy, first, count);
        }
    }

    #[inline(always)]
    #[allow(clippy::needless_range_loop, reason = "one index for several arrays, as in the loops beside it")]
    fn evaluate<A: Arithmetic>(&self, step: &Step) -> Poses {
        let mut poses = Poses::EMPTY;
        let mut tangent = [0.0; BLOCK];
        let mut turns = [0.0; BLOCK];
        let mut sines = [0.0; BLOCK];
        let mut cosines = [0.0; BLOCK];
        let mut short = 0;
        // Several short loops, so that the processor has many of their steps under way at once.
        for k in 0..BLOCK {
            let (sine, cosine, part) = sine_cosine_of_fraction::<A>(self.fraction[k]);
            let tau = from_small(self.whole[k]) + part;
            (turns[k], sines[k], cosines[k]) = (tau, sine, cosine);
            poses.x[k] = step.pitch * tau * cosine;
            poses.y[k] = step.pitch * tau * sine;
        }
        for k in 0..BLOCK {
            // The bench against the perpendicular of the middle angle: p u cos(pi u) against p (2 tau + u) sin(pi u).
            let u = self.increment[k];
            let aside = u * self.half_cosine[k] / (A::multiply_add(2.0, turns[k], u) * self.half_sine[k]);
            short += u64::from(aside.abs() <= SHORT_ARC_TANGENT);
            tangent[k] = aside;
        }
        for k in 0..BLOCK {
            let middle = self.fraction[k].wrapping_add(self.fixed[k] >> 1).wrapping_sub(1 << 62);
            let middle = TAU * signed_fraction(middle);
            poses.heading[k] = within_half_turn(middle - short_arc_tangent::<A>(tangent[k]));
        }
        if short < BLOCK as u64 {
            for k in 0..BLOCK {
                let middle = self.fraction[k].wrapping_add(self.fixed[k] >> 1).wrapping_sub(1 << 62);
                poses.heading[k] = within_half_turn(TAU * signed_fraction(middle) - tangent[k].atan());
            }
        }
        if step.velocities == Velocities::Omitted {
            return poses;
        }
        let growth = step.pitch * step.head_speed;
        for k in 0..BLOCK {
            // d/dt of r (cos theta, sin theta).
            let outward = growth * self.rate[k];
            let theta = TAU * turns[k];
            poses.vx[k] = outward * A::multiply_add(-theta, sines[k], cosines[k]);
            poses.vy[k] = outward * A::multiply_add(theta, cosines[k], sines[k]);
            poses.speed[k] = -outward * A::multiply_add(theta, theta, 1.0).sqrt();
        }
        poses
    }
}

/// The handles of a block as they go into the chain.
struct Poses {
    x: Numbers,
    y: Numbers,
    heading: Numbers,
    speed: Numbers,
    vx: Numbers,
    vy: Numbers,
}

impl Poses {
    const EMPTY: Self = Self {
        x: [0.0; BLOCK],
        y: [0.0; BLOCK],
        heading: [0.0; BLOCK],
        speed: [0.0; BLOCK],
        vx: [0.0; BLOCK],
        vy: [0.0; BLOCK],
    };
}

/// An increment above which a link spans so much of a turn that the kernel's fixed-point sum would overflow.
const LARGEST_INCREMENT: f64 = 0.99;

/// The derivatives of g by the front handle's turns and by the increment.
struct Slopes {
    by_turns: f64,
    by_increment: f64,
}

impl Slopes {
    #[inline(always)]
    fn at<A: Arithmetic>(tau: f64, u: f64, sine: f64, cosine: f64) -> Self {
        let outer = tau + u;
        let square = sine * sine;
        let radial = A::multiply_add(tau, square, 0.5 * u);
        Self {
            by_turns: (tau + outer) * square,
            by_increment: A::multiply_add(TAU * tau * outer, sine * cosine, radial),
        }
    }
}

/// A bound of the second order of g over a correction.
///
/// Its three derivatives are at most 2 pi^2 tau tau' + 4 pi tau' s + 1/2 by u twice, 4 pi tau' s + s^2 mixed and 2 s^2
/// by tau twice, with tau' = tau + u, which the sum below exceeds.
#[inline(always)]
fn second_order<A: Arithmetic>(outer: f64, sine: f64, change: f64, correction: f64) -> f64 {
    let around = PI * outer * change.abs();
    let along = sine * correction.abs();
    let both = A::multiply_add(2.0, along, around);
    let square = A::multiply_add(both, both, along * along);
    A::multiply_add(A::multiply_add(8.0, outer, 2.0), change * change, square)
}

/// An angle from -3 pi to 3 pi brought into (-pi, pi].
#[inline(always)]
fn within_half_turn(angle: f64) -> f64 {
    let raised = if angle <= -PI { angle + TAU } else { angle };
    if raised > PI { raised - TAU } else { raised }
}

/// `rate` at the front and the rear handles of a block.
#[inline(always)]
fn neighbours(rate: &[f64], first: usize) -> (&Numbers, &Numbers) {
    (window(rate, first), window(rate, first + 1))
}

/// The numbers of the block that begins at `first`.
#[inline(always)]
fn window(numbers: &[f64], first: usize) -> &Numbers {
    // The slice has just that length.
    numbers[first..first + BLOCK].try_into().expect("a block")
}

#[inline(always)]
fn window_mut(numbers: &mut [f64], first: usize) -> &mut Numbers {
    // The slice has just that length.
    (&mut numbers[first..first + BLOCK]).try_into().expect("a block")
}

#[inline(always)]
fn copy(from: &Numbers, to: &mut [f64], first: usize, count: usize) {
    if count == BLOCK {
        *window_mut(to, first) = *from;
    } else {
        to[first..first + count].copy_from_slice(&from[..count]);
    }
}
