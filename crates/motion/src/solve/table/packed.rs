//! The table in fewer bytes: shorter polynomials over shorter pieces, in single precision where that suffices.
//!
//! In: the rows of T and the allowed loss. Out: the same bands with other pieces, and a proven bound of the loss over
//! all phases and all rows that a frame can read. Only frames read it; the clearance reads the rows.
//!
//! Every polynomial of a piece is rewritten exactly for a part of it, and then shortened by Chebyshev polynomials,
//! which bounds the change. The rounding of single precision is added. If the sum is too large, the part is halved.

use super::polynomial::{economise, on_part};
use super::rows::{Band, LANES, Lanes, Lengths, Piece, Rows, piece_at, piece_of_share};
use crate::event::Budget;
use crate::model::elementary::hypot;

/// One coefficient of neighbouring rows in single precision.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(super) struct Singles(pub [f32; LANES]);

/// Precision of the coefficients of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Precision {
    /// Constants of coordinates in double precision, the rest in single precision.
    Mixed,
    /// All in single precision.
    Single,
}

/// Format of a packed table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Format {
    pub precision: Precision,
    pub lengths: Lengths,
}

impl Format {
    /// Returns the bytes that a frame reads per handle.
    pub(crate) fn bytes_per_handle(self) -> usize {
        let singles = self.lengths.per_row() * size_of::<f32>();
        match self.precision {
            Precision::Single => singles,
            Precision::Mixed => singles + 2 * (size_of::<f64>() - size_of::<f32>()),
        }
    }
}

impl std::fmt::Display for Format {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        let precision = match self.precision {
            Precision::Mixed => "mixed precision",
            Precision::Single => "single precision",
        };
        write!(formatter, "{precision}, order {}", self.lengths.coordinate)
    }
}

/// Allowed changes by the packing, besides the errors of the rows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Allowed {
    /// The change of the places, in metres.
    pub place: f64,
    /// The change of the headings, in radians.
    pub heading: f64,
    /// Relative to a handle's own speed; infinite if velocities are omitted.
    pub speed: f64,
}

/// A band of [`Rows`] in another format.
#[derive(Debug, Clone)]
pub(super) struct PackedBand {
    pub first_row: usize,
    pub rows: usize,
    /// In order of phase, from 0 to 1 without a gap.
    pub pieces: Vec<Piece>,
    /// Constants of x and y if they are doubles, by piece, then by block.
    pub constants: Vec<Lanes>,
    /// By piece, then by block: x, y and heading by power, with the constants that are not doubles.
    pub coefficients: Vec<Singles>,
    piece_of_share: Vec<u32>,
}

/// The table of T in another format.
#[derive(Debug, Clone)]
pub(super) struct PackedRows {
    pub format: Format,
    pub bands: Vec<PackedBand>,
}

/// The greatest number of halvings of a piece of the rows.
const MOST_HALVINGS: usize = 7;

/// The greatest size of a packed table: a multiple of the rows' bytes, plus a number of bytes that stay in the
/// processor's cache.
const MOST_GROWTH: usize = 2;
const SMALL: usize = 1 << 18;

/// The relative rounding of single precision.
const ROUNDING: f64 = 0.5 * f32::EPSILON as f64;

impl PackedRows {
    /// All formats, the fewest bytes first.
    pub(super) const FORMATS: [Format; 3] = {
        let [three, four] = [(3, 2), (4, 3)];
        const fn format(precision: Precision, (coordinate, heading): (usize, usize)) -> Format {
            Format { precision, lengths: Lengths { coordinate, heading } }
        }
        [format(Precision::Single, three), format(Precision::Mixed, three), format(Precision::Mixed, four)]
    };

    /// Packs the rows from `foremost` on. Returns `None` if that would lose more than is allowed, or save nothing, and if
    /// the budget is spent.
    pub(super) fn new(
        rows: &Rows,
        foremost: usize,
        format: Format,
        allowed: Allowed,
        budget: &mut Budget,
    ) -> Option<Self> {
        let mut bytes_left = MOST_GROWTH * rows.memory_bytes() + SMALL;
        let mut bands = Vec::with_capacity(rows.bands.len());
        for band in &rows.bands {
            let first = foremost.max(rows.valid_from as usize).clamp(band.first_row, band.first_row + band.rows);
            let mut builder = Builder {
                band,
                first,
                valid_from: rows.valid_from,
                format,
                allowed,
                bytes_left,
                packed: PackedBand::of(band),
            };
            for (index, piece) in band.pieces.iter().enumerate() {
                builder.refine(index, *piece, *piece, MOST_HALVINGS, budget)?;
            }
            bytes_left = builder.bytes_left;
            let mut packed = builder.packed;
            packed.piece_of_share = piece_of_share(&packed.pieces);
            bands.push(packed);
        }
        Some(Self { format, bands })
    }

    /// Returns the number of the band that holds a row.
    #[inline(always)]
    pub(super) fn band_of(&self, row: usize) -> usize {
        self.bands.iter().position(|band| row < band.first_row + band.rows).unwrap_or(self.bands.len())
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.bands.iter().map(PackedBand::memory_bytes).sum()
    }
}

impl PackedBand {
    fn of(band: &Band) -> Self {
        Self {
            first_row: band.first_row,
            rows: band.rows,
            pieces: Vec::new(),
            constants: Vec::new(),
            coefficients: Vec::new(),
            piece_of_share: Vec::new(),
        }
    }

    /// Returns the number of the piece that holds a phase from 0 to 1.
    #[inline(always)]
    pub(super) fn piece_at(&self, phase: f64) -> usize {
        piece_at(&self.pieces, &self.piece_of_share, phase)
    }

    fn memory_bytes(&self) -> usize {
        size_of_val(self.pieces.as_slice())
            + size_of_val(self.constants.as_slice())
            + size_of_val(self.coefficients.as_slice())
            + size_of_val(self.piece_of_share.as_slice())
    }
}

/// A band during packing.
struct Builder<'a> {
    band: &'a Band,
    /// The first row that a frame can read.
    first: usize,
    /// Alpha from which the rows are exact.
    valid_from: f64,
    format: Format,
    allowed: Allowed,
    bytes_left: usize,
    packed: PackedBand,
}

/// The polynomials of x, y and heading.
type Polynomials = [[f64; 6]; 3];

impl Builder<'_> {
    /// Adds `part` of a piece of the band, halved until the loss is within the allowed loss.
    fn refine(&mut self, index: usize, piece: Piece, part: Piece, halvings: usize, budget: &mut Budget) -> Option<()> {
        let first = self.first.max((self.valid_from - part.end).ceil().max(0.0) as usize);
        let end = self.band.first_row + self.band.rows;
        let mut is_kept =
            |row: usize| budget.spend(1).is_ok() && self.loss(&mut self.polynomials(index, piece, part, row)) <= 1.0;
        if (first..end).all(&mut is_kept) {
            return self.add(index, piece, part, budget);
        }
        let halvings = halvings.checked_sub(1)?;
        let middle = 0.5 * (part.begin + part.end);
        self.refine(index, piece, Piece { end: middle, ..part }, halvings, budget)?;
        self.refine(index, piece, Piece { begin: middle, ..part }, halvings, budget)
    }

    /// Returns the band's polynomials over a part of a piece.
    fn polynomials(&self, index: usize, piece: Piece, part: Piece, row: usize) -> Polynomials {
        let (begin, end) = (piece.beta(part.begin), piece.beta(part.end));
        let [x, y] = self.band.coordinates(index, row);
        let heading = self.band.heading(index, row);
        [x, y, heading].map(|polynomial| on_part(&polynomial, 0.5 * (begin + end), 0.5 * (end - begin)))
    }

    /// Shortens the polynomials of a row. Returns an upper bound of the change by this and by rounding, as a part of
    /// the allowed change.
    fn loss(&self, polynomials: &mut Polynomials) -> f64 {
        let Lengths { coordinate, heading } = self.format.lengths;
        let [x, y, angle] = polynomials;
        let [dropped_x, dropped_y] = [&mut *x, &mut *y].map(|axis| economise(axis, coordinate));
        let dropped_heading = economise(angle, heading);
        let mixed = self.format.precision == Precision::Mixed;
        // Two roundings for the coefficients and beta, and one for every step of Horner's scheme.
        let rounding = |coefficients: &[f64; 6], constant: bool, length: usize| {
            let (constant_part, others) =
                (coefficients[0].abs(), coefficients[1..].iter().map(|c| c.abs()).sum::<f64>());
            ROUNDING * (if constant { 2.0 * constant_part } else { 0.0 } + 2.0 * (length + 1) as f64 * others)
        };
        let place =
            hypot(dropped_x.value + rounding(x, !mixed, coordinate), dropped_y.value + rounding(y, !mixed, coordinate));
        let turn = dropped_heading.value + rounding(angle, true, heading);
        let slopes = |axis: &[f64; 6]| (1..6).map(|power| power as f64 * axis[power].abs()).sum::<f64>();
        let least_slope = 2.0 * hypot(x[1], y[1]) - hypot(slopes(x), slopes(y));
        let speed =
            hypot(dropped_x.slope, dropped_y.slope) / least_slope.max(0.0) + (2 * coordinate + 6) as f64 * ROUNDING;
        let speed = if self.allowed.speed == f64::INFINITY { 0.0 } else { speed / self.allowed.speed };
        (place / self.allowed.place).max(turn / self.allowed.heading).max(speed)
    }

    /// Adds the polynomials of a part. Returns `None` if the table becomes too large, or the budget is spent.
    fn add(&mut self, index: usize, piece: Piece, part: Piece, budget: &mut Budget) -> Option<()> {
        let Lengths { coordinate, heading } = self.format.lengths;
        let mixed = self.format.precision == Precision::Mixed;
        let skipped = usize::from(mixed);
        let per_block = 2 * (coordinate - skipped) + heading;
        let blocks = self.band.rows / LANES;
        let bytes = self.band.rows * self.format.bytes_per_handle();
        self.bytes_left = self.bytes_left.checked_sub(bytes)?;
        let (begin, begin_constants) = (self.packed.coefficients.len(), self.packed.constants.len());
        self.packed.coefficients.resize(begin + blocks * per_block, Singles([0.0; LANES]));
        self.packed.constants.resize(begin_constants + if mixed { 2 * blocks } else { 0 }, Lanes([0.0; LANES]));
        for row in 0..self.band.rows {
            budget.spend(1).ok()?;
            let mut polynomials = self.polynomials(index, piece, part, self.band.first_row + row);
            self.loss(&mut polynomials);
            let (block, lane) = (row / LANES, row % LANES);
            let [x, y, angle] = &polynomials;
            let kept = x[skipped..coordinate].iter().chain(&y[skipped..coordinate]).chain(&angle[..heading]);
            let singles = &mut self.packed.coefficients[begin + block * per_block..][..per_block];
            for (single, coefficient) in singles.iter_mut().zip(kept) {
                single.0[lane] = *coefficient as f32;
            }
            if mixed {
                let constants = &mut self.packed.constants[begin_constants + 2 * block..][..2];
                (constants[0].0[lane], constants[1].0[lane]) = (x[0], y[0]);
            }
        }
        self.packed.pieces.push(part);
        Some(())
    }
}
