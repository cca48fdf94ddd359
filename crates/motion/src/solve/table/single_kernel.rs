//! A frame from a packed table: polynomials in single precision, eight handles at a time.

use std::f64::consts::TAU;

use super::kernel::{Blocks, FrameInput, Local, Outputs, write_band};
use super::packed::{PackedBand, PackedRows, Precision, Singles};
use super::rows::{Alpha, LANES, Lanes};
use crate::solve::ChainMut;

/// Writes all handles but the head from a packed table, as [`super::kernel::write`].
#[inline(always)]
pub(super) fn write<const FUSED: bool, const VELOCITIES: bool>(
    rows: &PackedRows,
    input: &FrameInput,
    chain: &mut ChainMut,
) {
    // The formats of `PackedRows::FORMATS`.
    match (rows.format.precision, rows.format.lengths.coordinate) {
        (Precision::Single, _) => write_bands::<Single<3, 2>, FUSED, VELOCITIES>(rows, input, chain),
        (Precision::Mixed, 3) => write_bands::<Mixed<3, 2>, FUSED, VELOCITIES>(rows, input, chain),
        (Precision::Mixed, _) => write_bands::<Mixed<4, 3>, FUSED, VELOCITIES>(rows, input, chain),
    }
}

#[inline(always)]
fn write_bands<'a, B: PackedBlocks<'a>, const FUSED: bool, const VELOCITIES: bool>(
    rows: &'a PackedRows,
    input: &FrameInput,
    chain: &mut ChainMut,
) {
    let Alpha { row, phase } = input.alpha;
    let end = row + chain.handles() - 1;
    let mut next = row;
    for band in &rows.bands[rows.band_of(row)..] {
        let piece = band.piece_at(phase);
        let local = Local::new(&band.pieces[piece], input);
        let handled = next..end.min(band.first_row + band.rows);
        next = handled.end;
        write_band::<_, FUSED, VELOCITIES>(B::new(band, piece), band.first_row, &local, handled, row, chain);
        if next == end {
            break;
        }
    }
}

/// Blocks of a packed band.
trait PackedBlocks<'a>: Blocks {
    fn new(band: &'a PackedBand, piece: usize) -> Self;
}

/// Single precision throughout.
#[derive(Clone, Copy)]
struct Single<'a, const K: usize, const H: usize> {
    coefficients: &'a [Singles],
}

impl<'a, const K: usize, const H: usize> PackedBlocks<'a> for Single<'a, K, H> {
    #[inline(always)]
    fn new(band: &'a PackedBand, piece: usize) -> Self {
        let length = band.rows / LANES * (2 * K + H);
        Self { coefficients: &band.coefficients[piece * length..][..length] }
    }
}

impl<'a, const K: usize, const H: usize> Blocks for Single<'a, K, H> {
    type Block = &'a [Singles];

    #[inline(always)]
    fn blocks(self, first: usize) -> impl Iterator<Item = &'a [Singles]> {
        self.coefficients[first * (2 * K + H)..].chunks_exact(2 * K + H)
    }

    #[inline(always)]
    fn outputs<const FUSED: bool, const VELOCITIES: bool>(block: &'a [Singles], local: &Local) -> Outputs {
        let block = &block[..2 * K + H];
        let (coordinates, headings) = block.split_at(2 * K);
        let (xs, ys) = coordinates.split_at(K);
        let beta = local.beta as f32;
        let (x, vx) = value_and_slope::<K, FUSED>(xs, beta);
        let (y, vy) = value_and_slope::<K, FUSED>(ys, beta);
        let [speed, vx, vy] = velocities::<FUSED, VELOCITIES>(vx, vy, local);
        [widened(&x), widened(&y), heading_of::<H, FUSED>(headings, beta), speed, vx, vy]
    }
}

/// Constants of coordinates as doubles, the rest in single precision.
#[derive(Clone, Copy)]
struct Mixed<'a, const K: usize, const H: usize> {
    constants: &'a [Lanes],
    coefficients: &'a [Singles],
}

impl<'a, const K: usize, const H: usize> PackedBlocks<'a> for Mixed<'a, K, H> {
    #[inline(always)]
    fn new(band: &'a PackedBand, piece: usize) -> Self {
        let blocks = band.rows / LANES;
        let length = blocks * (2 * (K - 1) + H);
        Self {
            constants: &band.constants[piece * 2 * blocks..][..2 * blocks],
            coefficients: &band.coefficients[piece * length..][..length],
        }
    }
}

impl<'a, const K: usize, const H: usize> Blocks for Mixed<'a, K, H> {
    type Block = (&'a [Lanes], &'a [Singles]);

    #[inline(always)]
    fn blocks(self, first: usize) -> impl Iterator<Item = (&'a [Lanes], &'a [Singles])> {
        let per_block = 2 * (K - 1) + H;
        let constants = self.constants[2 * first..].chunks_exact(2);
        constants.zip(self.coefficients[first * per_block..].chunks_exact(per_block))
    }

    #[inline(always)]
    fn outputs<const FUSED: bool, const VELOCITIES: bool>(
        (constants, block): (&'a [Lanes], &'a [Singles]),
        local: &Local,
    ) -> Outputs {
        let (constants, block) = (&constants[..2], &block[..2 * (K - 1) + H]);
        let (coordinates, headings) = block.split_at(2 * (K - 1));
        let (xs, ys) = coordinates.split_at(K - 1);
        let beta = local.beta as f32;
        let (x, vx) = offset_and_slope::<FUSED>(xs, beta);
        let (y, vy) = offset_and_slope::<FUSED>(ys, beta);
        let [speed, vx, vy] = velocities::<FUSED, VELOCITIES>(vx, vy, local);
        let (mut x, mut y) = (widened(&x), widened(&y));
        for lane in 0..LANES {
            x[lane] += constants[0].0[lane];
            y[lane] += constants[1].0[lane];
        }
        [x, y, heading_of::<H, FUSED>(headings, beta), speed, vx, vy]
    }
}

type Lanes32 = [f32; LANES];

/// Returns a polynomial and its slope by beta, from its coefficients by power.
#[inline(always)]
fn value_and_slope<const K: usize, const FUSED: bool>(coefficients: &[Singles], beta: f32) -> (Lanes32, Lanes32) {
    let mut value = coefficients[K - 1].0;
    let mut slope = value;
    for coefficient in coefficients[1..K - 1].iter().rev() {
        value = times_plus::<FUSED>(&value, beta, &coefficient.0);
        slope = times_plus::<FUSED>(&slope, beta, &value);
    }
    (times_plus::<FUSED>(&value, beta, &coefficients[0].0), slope)
}

/// Returns a polynomial without its constant, and its slope, from its coefficients by power from the first on.
#[inline(always)]
fn offset_and_slope<const FUSED: bool>(coefficients: &[Singles], beta: f32) -> (Lanes32, Lanes32) {
    let mut value = coefficients[coefficients.len() - 1].0;
    let mut slope = value;
    for coefficient in coefficients[..coefficients.len() - 1].iter().rev() {
        value = times_plus::<FUSED>(&value, beta, &coefficient.0);
        slope = times_plus::<FUSED>(&slope, beta, &value);
    }
    for lane in &mut value {
        *lane *= beta;
    }
    (value, slope)
}

/// Returns a heading in (-pi, pi] from its coefficients by power.
#[inline(always)]
fn heading_of<const H: usize, const FUSED: bool>(coefficients: &[Singles], beta: f32) -> [f64; LANES] {
    let mut heading = coefficients[H - 1].0;
    for coefficient in coefficients[..H - 1].iter().rev() {
        heading = times_plus::<FUSED>(&heading, beta, &coefficient.0);
    }
    for heading in &mut heading {
        let down = if *heading > SINGLE_PI { TAU as f32 } else { 0.0 };
        let up = if *heading < -SINGLE_PI { TAU as f32 } else { 0.0 };
        *heading = (*heading - down + up).clamp(-SINGLE_PI, SINGLE_PI);
    }
    widened(&heading)
}

/// The greatest number of single precision not above pi.
const SINGLE_PI: f32 = std::f32::consts::PI.next_down();

/// Returns speed, vx and vy from the slopes by beta.
#[inline(always)]
fn velocities<const FUSED: bool, const VELOCITIES: bool>(
    mut vx: Lanes32,
    mut vy: Lanes32,
    local: &Local,
) -> [[f64; LANES]; 3] {
    let mut speed = [0.0; LANES];
    if VELOCITIES {
        let (rate, sign) = (local.beta_per_second as f32, local.sign as f32);
        for lane in 0..LANES {
            vx[lane] *= rate;
            vy[lane] *= rate;
        }
        for lane in 0..LANES {
            let square = vy[lane] * vy[lane];
            let square = if FUSED { vx[lane].mul_add(vx[lane], square) } else { vx[lane] * vx[lane] + square };
            speed[lane] = sign * square.sqrt();
        }
    }
    [widened(&speed), widened(&vx), widened(&vy)]
}

#[inline(always)]
fn times_plus<const FUSED: bool>(value: &Lanes32, beta: f32, next: &Lanes32) -> Lanes32 {
    let mut sum = [0.0; LANES];
    for lane in 0..LANES {
        sum[lane] = if FUSED { value[lane].mul_add(beta, next[lane]) } else { value[lane] * beta + next[lane] };
    }
    sum
}

#[inline(always)]
fn widened(lanes: &Lanes32) -> [f64; LANES] {
    let mut wide = [0.0; LANES];
    for lane in 0..LANES {
        wide[lane] = f64::from(lanes[lane]);
    }
    wide
}
