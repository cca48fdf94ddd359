//! T: the places of all handles of a chain of equal links, as polynomials.
//!
//! All links but the head's are equal, so one map F takes every handle's place to its follower's. T satisfies
//! T(alpha + 1) = F(T(alpha)). If the second handle stands at T(alpha), the handles behind it therefore stand at
//! T(alpha + 1), T(alpha + 2) and so on, and each place is found independently of the others. (T is the inverse of an
//! Abel function of F; Kuczma, Choczewski and Ger, Iterative Functional Equations, 1990.)
//!
//! The whole part of alpha is a *row*, counted from the front of the table backward; its fraction is a *phase*. The
//! rows are grouped into bands, and the phases of each band are cut into pieces. Every piece holds polynomials of
//! beta, -1 to 1 over the piece, for every row of the band. The polynomials give the handle's coordinates and the
//! direction of the link that the handle leads. Where a handle or its follower crosses a junction of the path, T has a
//! kink in its second derivative. Because T takes whole links to followers, all kinks of one junction have one phase,
//! and pieces end there.
//!
//! [`super::band`] makes the rows; the frame and the clearance read them.

use super::polynomial::horner;
use super::track::Track;
use crate::model::Vector;
use crate::model::path::Param;

/// Rows that are computed together.
pub(crate) const LANES: usize = 8;

/// One coefficient of [`LANES`] neighbouring rows.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Lanes(pub [f64; LANES]);

/// Tolerance of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// The greatest error of a polynomial, metres, besides rounding.
    pub place: f64,
    /// The same error as a part of a link.
    pub relative: f64,
    /// The greatest relative error of a speed.
    pub speed: f64,
}

impl Tolerance {
    /// As exact as doubles allow.
    pub const EXACT: Self = Self { place: 5e-15, relative: 1e-13, speed: 3e-13 };

    /// Returns the greatest error of a polynomial, metres, for links of `link` metres.
    pub(super) fn metres(&self, link: f64) -> f64 {
        self.place.min(self.relative * link)
    }
}

/// The largest gap between two pieces, as a multiple of a piece's error: twice the error of each.
const LARGEST_GAP: f64 = 4.0;

/// Numbers of coefficients of the polynomials of a band.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Lengths {
    /// Coefficients of each coordinate.
    pub coordinate: usize,
    /// Coefficients of the heading.
    pub heading: usize,
}

impl Lengths {
    /// For rows at the front.
    pub(super) const NEAR: Self = Self { coordinate: 6, heading: 5 };
    /// For rows so far behind that shorter polynomials and more pieces make a frame faster.
    pub(super) const FAR: Self = Self { coordinate: 5, heading: 4 };

    /// Returns the number of coefficients of a row in a piece.
    pub(super) fn per_row(self) -> usize {
        2 * self.coordinate + self.heading
    }
}

/// Phases on which T has one set of polynomials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    /// The phase at which it begins, where beta is -1.
    pub begin: f64,
    /// The phase at which it ends, where beta is 1.
    pub end: f64,
}

impl Piece {
    /// Returns beta of a phase.
    #[inline(always)]
    pub fn beta(&self, phase: f64) -> f64 {
        ((phase - self.begin) - (self.end - phase)) / (self.end - self.begin)
    }

    /// Returns beta per unit of alpha.
    #[inline(always)]
    pub fn beta_per_alpha(&self) -> f64 {
        2.0 / (self.end - self.begin)
    }
}

/// Neighbouring rows whose phases are cut in the same way.
#[derive(Debug, Clone)]
pub(crate) struct Band {
    /// The band's first row and the number of its rows: multiples of [`LANES`].
    pub first_row: usize,
    pub rows: usize,
    /// Numbers of coefficients of its polynomials.
    pub(super) lengths: Lengths,
    /// In order of phase, from 0 to 1 without a gap.
    pub pieces: Vec<Piece>,
    /// By piece, then by block of [`LANES`] rows, then x, y and heading by power: see [`Band::block`].
    pub(super) coefficients: Vec<Lanes>,
    /// The place with beta 0 by piece, then by row, where the second handle can be. Needed only while the table is
    /// made.
    pub(super) centres: Vec<Option<Param>>,
    /// The piece in which each of equal shares of the phases begins.
    pub(super) piece_of_share: Vec<u32>,
}

/// T at one alpha, relative to the piece's centre.
#[derive(Debug, Clone, Copy)]
pub(super) struct Local {
    pub offset: Vector,
    /// Derivative of the place by alpha, in metres.
    pub rate: Vector,
}

impl Band {
    /// Creates a band without pieces.
    pub(super) fn new(first_row: usize, rows: usize, lengths: Lengths) -> Self {
        let (pieces, coefficients, centres, piece_of_share) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { first_row, rows, lengths, pieces, coefficients, centres, piece_of_share }
    }

    /// Returns the number of the piece that holds a phase from 0 to 1.
    #[inline(always)]
    pub(crate) fn piece_at(&self, phase: f64) -> usize {
        piece_at(&self.pieces, &self.piece_of_share, phase)
    }

    /// Returns the coefficients of the `LANES` rows from `first_row + LANES * block` on: those of x by power, then of
    /// y, then of the heading, metres and radians.
    pub(crate) fn block(&self, piece: usize, block: usize) -> &[Lanes] {
        let (blocks, per_row) = (self.rows / LANES, self.lengths.per_row());
        &self.coefficients[(piece * blocks + block) * per_row..][..per_row]
    }

    /// Returns the coefficients of x and y of one row, by power, in metres; beyond the band's lengths they are zero.
    pub(crate) fn coordinates(&self, piece: usize, row: usize) -> [[f64; 6]; 2] {
        let length = self.lengths.coordinate;
        [0, length].map(|begin| self.polynomial(piece, row, begin, length))
    }

    /// Returns the coefficients of the heading of one row, by power, in radians.
    pub(super) fn heading(&self, piece: usize, row: usize) -> [f64; 6] {
        self.polynomial(piece, row, 2 * self.lengths.coordinate, self.lengths.heading)
    }

    fn polynomial(&self, piece: usize, row: usize, begin: usize, length: usize) -> [f64; 6] {
        let local = row - self.first_row;
        let block = &self.block(piece, local / LANES)[begin..][..length];
        std::array::from_fn(|power| block.get(power).map_or(0.0, |coefficient| coefficient.0[local % LANES]))
    }

    /// Fills `piece_of_share` after the last piece.
    pub(super) fn index(&mut self) {
        self.piece_of_share = piece_of_share(&self.pieces);
    }

    fn memory_bytes(&self) -> usize {
        size_of_val(self.coefficients.as_slice())
            + size_of_val(self.pieces.as_slice())
            + size_of_val(self.piece_of_share.as_slice())
    }
}

/// Returns the piece in which each of equal shares of the phases begins.
pub(super) fn piece_of_share(pieces: &[Piece]) -> Vec<u32> {
    let shares = (4 * pieces.len()).next_power_of_two();
    let begin = |share: usize| share as f64 / shares as f64;
    let piece_at = |phase: f64| pieces.partition_point(|piece| piece.end <= phase).min(pieces.len() - 1);
    (0..shares).map(|share| piece_at(begin(share)) as u32).collect()
}

/// Returns the number of the piece that holds a phase from 0 to 1.
#[inline(always)]
pub(super) fn piece_at(pieces: &[Piece], piece_of_share: &[u32], phase: f64) -> usize {
    let share = (phase * piece_of_share.len() as f64) as usize;
    let mut piece = piece_of_share[share.min(piece_of_share.len() - 1)] as usize;
    while piece + 1 < pieces.len() && pieces[piece].end <= phase {
        piece += 1;
    }
    piece
}

/// The table of T.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    pub tolerance: Tolerance,
    /// The bands, from the front of the table backward.
    pub bands: Vec<Band>,
    /// The phases of the kinks, in order.
    pub(super) kinks: Vec<f64>,
    /// The least alpha from which every piece is exact.
    pub valid_from: f64,
}

/// A place of the table: alpha as whole part and fraction, so that it keeps its digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Alpha {
    pub row: usize,
    /// 0 to 1.
    pub phase: f64,
}

impl Alpha {
    /// Returns alpha moved by less than its whole part.
    #[inline(always)]
    pub(crate) fn plus(self, by: f64) -> Self {
        let phase = self.phase + by;
        let whole = phase.floor();
        Self { row: self.row.wrapping_add_signed(whole as isize), phase: phase - whole }
    }

    /// Returns the distance by which this alpha is further back than another.
    pub(super) fn minus(self, other: Self) -> f64 {
        (self.row as f64 - other.row as f64) + (self.phase - other.phase)
    }

    pub(super) fn number(self) -> f64 {
        self.row as f64 + self.phase
    }
}

impl Rows {
    /// Creates a table without rows.
    pub(super) fn empty() -> Self {
        Self { tolerance: Tolerance::EXACT, bands: Vec::new(), kinks: Vec::new(), valid_from: 0.0 }
    }

    /// Returns the number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.bands.last().map_or(0, |band| band.first_row + band.rows)
    }

    /// Returns the number of the band that holds a row.
    #[inline(always)]
    pub(crate) fn band_of(&self, row: usize) -> usize {
        self.bands.iter().position(|band| row < band.first_row + band.rows).unwrap_or(self.bands.len())
    }

    /// Returns the bytes of one piece for a row, on average over the last `rows` rows.
    pub(super) fn bytes_per_row(&self, rows: usize) -> f64 {
        let first = self.rows().saturating_sub(rows);
        let of_band = |band: &Band| {
            let rows = (band.first_row + band.rows).saturating_sub(first.max(band.first_row));
            rows * band.lengths.per_row() * size_of::<f64>()
        };
        self.bands.iter().map(of_band).sum::<usize>() as f64 / (self.rows() - first) as f64
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.bands.iter().map(Band::memory_bytes).sum()
    }

    /// Returns T relative to the centre of the piece at `alpha`, and that centre. Used only while the table is made.
    pub(super) fn local(&self, alpha: Alpha) -> Option<(Param, Local)> {
        let band = self.bands.get(self.band_of(alpha.row))?;
        let piece = band.piece_at(alpha.phase);
        let centre = (*band.centres.get(piece * band.rows + alpha.row.checked_sub(band.first_row)?)?)?;
        let (beta, per_alpha) = (band.pieces[piece].beta(alpha.phase), band.pieces[piece].beta_per_alpha());
        let [x, y] = band.coordinates(piece, alpha.row).map(|mut coefficients| {
            coefficients[0] = 0.0;
            horner(&coefficients, beta)
        });
        Some((centre, Local { offset: Vector::new(x.0, y.0), rate: per_alpha * Vector::new(x.1, y.1) }))
    }

    /// Returns alpha of a place near `guess` (Newton's method), and the derivative of T there. Used only while the
    /// table is made.
    ///
    /// At the meeting of two pieces, T jumps by up to the error of each. A place in that gap is on neither piece, and
    /// the iteration bounces between both to the end. Both are within the table's error of the place.
    pub(super) fn locate(&self, track: &Track, place: Param, guess: Alpha) -> Option<(Alpha, Vector)> {
        let mut alpha = guess;
        let mut bounce = None;
        for _ in 0..30 {
            let (centre, local) = self.local(alpha)?;
            let miss = track.displacement(centre, place) - local.offset;
            let step = miss.dot(&local.rate) / local.rate.norm_squared();
            // The rate is the one before the step; the step has to be short enough for that.
            let settled = step.abs() < 1e-13;
            alpha = alpha.plus(step.clamp(-0.5, 0.5));
            let found = (alpha.number() >= self.valid_from).then_some((alpha, local.rate));
            if settled {
                return found;
            }
            bounce = found.filter(|_| step.abs() * local.rate.norm() <= LARGEST_GAP * self.tolerance.place);
        }
        bounce
    }
}
