//! A frame from the table: every handle behind the head independently, eight at a time.
//!
//! The loops over [`LANES`] have a fixed length, so that the compiler vectorises them.

use std::f64::consts::{PI, TAU};

use super::rows::{Alpha, Band, LANES, Lanes, Lengths, Piece, Rows};
use crate::solve::ChainMut;

/// The input of a frame besides the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameInput {
    /// The place of the second handle in the table.
    pub alpha: Alpha,
    /// Its derivative by time, 1/s; negative while the handle goes forward.
    pub alpha_per_second: f64,
}

/// x, y, heading, speed, vx and vy of neighbouring handles.
pub(super) type Outputs = [[f64; LANES]; 6];

/// One piece of a band for one frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Local {
    pub beta: f64,
    pub beta_per_second: f64,
    /// 1 or -1: the sign of all speeds.
    pub sign: f64,
}

impl Local {
    #[inline(always)]
    pub(super) fn new(piece: &Piece, input: &FrameInput) -> Self {
        Self {
            beta: piece.beta(input.alpha.phase),
            beta_per_second: piece.beta_per_alpha() * input.alpha_per_second,
            sign: -input.alpha_per_second.signum(),
        }
    }
}

/// The polynomials of one piece for the rows of a band, block by block.
pub(super) trait Blocks: Copy {
    /// The coefficients of one block.
    type Block;

    /// Returns the blocks from block `first` on.
    fn blocks(self, first: usize) -> impl Iterator<Item = Self::Block>;

    /// Returns the polynomials of one block, values and slopes by Horner's scheme. Without velocities the last three
    /// are unspecified.
    fn outputs<const FUSED: bool, const VELOCITIES: bool>(block: Self::Block, local: &Local) -> Outputs;
}

/// Writes all handles but the head from a table in double precision. With `FUSED` the processor multiplies and adds in
/// one instruction.
///
/// The heading of the last handle is invalid and written by the caller.
#[inline(always)]
pub(super) fn write<const FUSED: bool, const VELOCITIES: bool>(rows: &Rows, input: &FrameInput, chain: &mut ChainMut) {
    let Alpha { row, phase } = input.alpha;
    let end = row + chain.handles() - 1;
    let mut next = row;
    for band in &rows.bands[rows.band_of(row)..] {
        let piece = band.piece_at(phase);
        let local = Local::new(&band.pieces[piece], input);
        let handled = next..end.min(band.first_row + band.rows);
        next = handled.end;
        if band.lengths == Lengths::NEAR {
            let blocks = Doubles::<6, 5>::new(band, piece);
            write_band::<_, FUSED, VELOCITIES>(blocks, band.first_row, &local, handled, row, chain);
        } else {
            let blocks = Doubles::<5, 4>::new(band, piece);
            write_band::<_, FUSED, VELOCITIES>(blocks, band.first_row, &local, handled, row, chain);
        }
        if next == end {
            break;
        }
    }
}

/// Writes the handles of the given rows of a band; the second handle is in row `second`.
#[inline(always)]
pub(super) fn write_band<B: Blocks, const FUSED: bool, const VELOCITIES: bool>(
    source: B,
    band_row: usize,
    local: &Local,
    rows: std::ops::Range<usize>,
    second: usize,
    chain: &mut ChainMut,
) {
    let first_block = (rows.start - band_row) / LANES;
    let blocks = (rows.end - band_row).div_ceil(LANES) - first_block;
    let first_row = band_row + first_block * LANES;
    let whole = usize::from(first_row < rows.start)..(rows.end - first_row) / LANES;
    // No closure here: a closure that is not inlined lacks the caller's instruction set.
    let last = (whole.end < blocks && whole.end >= whole.start).then_some(whole.end);
    for partial in (whole.start > 0).then_some(0).into_iter().chain(last) {
        let row = first_row + partial * LANES;
        let lanes = rows.start.max(row) - row..rows.end.min(row + LANES) - row;
        let Some(block) = source.blocks(first_block + partial).next() else { return };
        let outputs = B::outputs::<FUSED, VELOCITIES>(block, local);
        store_some::<VELOCITIES>(&outputs, lanes, chain, row + 1, second);
    }
    // Whole blocks are stored directly from registers.
    if whole.start < whole.end {
        let handle = first_row + whole.start * LANES + 1 - second;
        let ChainMut { x, y, heading, speed, vx, vy } = &mut *chain;
        let number = whole.end - whole.start;
        let [x, y, heading, speed, vx, vy] =
            [x, y, heading, speed, vx, vy].map(|list| &mut list[handle..].as_chunks_mut::<LANES>().0[..number]);
        for (index, block) in source.blocks(first_block + whole.start).enumerate().take(number) {
            // With short polynomials LLVM would vectorise over blocks, with gathers and scatters: four times as slow.
            std::hint::black_box(());
            let outputs = B::outputs::<FUSED, VELOCITIES>(block, local);
            x[index] = outputs[0];
            y[index] = outputs[1];
            heading[index] = outputs[2];
            if VELOCITIES {
                speed[index] = outputs[3];
                vx[index] = outputs[4];
                vy[index] = outputs[5];
            }
        }
    }
}

/// Writes some of the lanes.
#[inline(always)]
fn store_some<const VELOCITIES: bool>(
    outputs: &Outputs,
    lanes: std::ops::Range<usize>,
    chain: &mut ChainMut,
    after_row: usize,
    second: usize,
) {
    let [x, y, heading, speed, vx, vy] = outputs;
    for lane in lanes {
        let handle = after_row + lane - second;
        chain.x[handle] = x[lane];
        chain.y[handle] = y[lane];
        chain.heading[handle] = heading[lane];
        if VELOCITIES {
            chain.speed[handle] = speed[lane];
            chain.vx[handle] = vx[lane];
            chain.vy[handle] = vy[lane];
        }
    }
}

/// Doubles throughout; `K` and `H` are the coefficients of a coordinate and of a heading.
#[derive(Clone, Copy)]
struct Doubles<'a, const K: usize, const H: usize> {
    coefficients: &'a [Lanes],
}

impl<'a, const K: usize, const H: usize> Doubles<'a, K, H> {
    #[inline(always)]
    fn new(band: &'a Band, piece: usize) -> Self {
        let length = band.rows / LANES * (2 * K + H);
        Self { coefficients: &band.coefficients[piece * length..][..length] }
    }
}

impl<'a, const K: usize, const H: usize> Blocks for Doubles<'a, K, H> {
    type Block = &'a [Lanes];

    #[inline(always)]
    fn blocks(self, first: usize) -> impl Iterator<Item = &'a [Lanes]> {
        self.coefficients[first * (2 * K + H)..].chunks_exact(2 * K + H)
    }

    #[inline(always)]
    fn outputs<const FUSED: bool, const VELOCITIES: bool>(block: &'a [Lanes], local: &Local) -> Outputs {
        let block = &block[..2 * K + H];
        let [mut x, mut y] = [block[K - 1].0, block[2 * K - 1].0];
        let [mut vx, mut vy] = [[0.0; LANES]; 2];
        let mut heading = block[2 * K + H - 1].0;
        for power in (0..K - 1).rev() {
            for lane in 0..LANES {
                if VELOCITIES {
                    vx[lane] = multiply_add::<FUSED>(vx[lane], local.beta, x[lane]);
                    vy[lane] = multiply_add::<FUSED>(vy[lane], local.beta, y[lane]);
                }
                x[lane] = multiply_add::<FUSED>(x[lane], local.beta, block[power].0[lane]);
                y[lane] = multiply_add::<FUSED>(y[lane], local.beta, block[K + power].0[lane]);
            }
        }
        for power in (0..H - 1).rev() {
            for (heading, coefficient) in heading.iter_mut().zip(&block[2 * K + power].0) {
                *heading = multiply_add::<FUSED>(*heading, local.beta, *coefficient);
            }
        }
        let mut speed = [0.0; LANES];
        for lane in 0..LANES {
            heading[lane] = within_half_turn(heading[lane]);
            if VELOCITIES {
                vx[lane] *= local.beta_per_second;
                vy[lane] *= local.beta_per_second;
                speed[lane] = local.sign * multiply_add::<FUSED>(vx[lane], vx[lane], vy[lane] * vy[lane]).sqrt();
            }
        }
        [x, y, heading, speed, vx, vy]
    }
}

/// Returns `x * y + z`: one rounding if the processor has the instruction, two if it would be a library call.
#[inline(always)]
fn multiply_add<const FUSED: bool>(x: f64, y: f64, z: f64) -> f64 {
    if FUSED { x.mul_add(y, z) } else { x * y + z }
}

/// Returns an angle less than a turn outside of (-pi, pi], reduced to that interval.
#[inline(always)]
pub(super) fn within_half_turn(angle: f64) -> f64 {
    let down = if angle > PI { TAU } else { 0.0 };
    let up = if angle <= -PI { TAU } else { 0.0 };
    angle - down + up
}
