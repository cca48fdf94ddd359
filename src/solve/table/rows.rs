//! T itself: where every handle of a chain of equal links stands, as polynomials.
//!
//! All links but the head's are equal, so that one map F takes every handle's place to its follower's. T satisfies
//! T(alpha + 1) = F(T(alpha)): where the second handle stands at T(alpha), the ones behind it stand at T(alpha + 1),
//! T(alpha + 2) and so on, each found without the ones before. (T is the inverse of an Abel function of F; Kuczma,
//! Choczewski and Ger, Iterative Functional Equations, 1990.)
//!
//! The whole part of alpha is a *row*, counted from the front of the table backward; its fraction is a *phase*. The
//! rows are grouped into bands, and the phases of each band are cut into pieces. Every piece holds, for every row of
//! the band, the coordinates of the handle and the direction of the link it leads as polynomials of beta, -1 to 1 over
//! the piece. Where a handle or its follower crosses a junction of the path, T has a kink in its second derivative;
//! since T takes whole links to followers, all kinks of one junction have one phase, and pieces end there.
//!
//! Made by [`super::band`]; read by the frame and by the clearance.

use super::polynomial::horner;
use super::track::Track;
use crate::model::Vector;
use crate::model::path::Param;

/// Rows that are worked out together.
pub(crate) const LANES: usize = 8;

/// One coefficient of as many neighbouring rows.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Lanes(pub [f64; LANES]);

/// How exact a table is, and how short its polynomials are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
    /// Coefficients of each coordinate's polynomial: 6 or 4.
    pub coefficients: usize,
    /// Coefficients of the heading's polynomial: 5 with 6, 3 with 4.
    pub heading_coefficients: usize,
    /// Metres that a polynomial may be off, besides rounding.
    pub tolerance: f64,
    /// What a speed may be off, relative to itself.
    pub speed_tolerance: f64,
}

impl Order {
    /// As exact as doubles allow.
    pub const EXACT: Self = Self { coefficients: 6, heading_coefficients: 5, tolerance: 5e-15, speed_tolerance: 3e-13 };

    /// The order for rows far behind.
    pub(super) fn of_far_rows(self) -> Self {
        if self.coefficients == 6 { Self { coefficients: 5, heading_coefficients: 4, ..self } } else { self }
    }

    /// Coefficients of a row in a piece.
    pub(super) fn per_row(&self) -> usize {
        2 * self.coefficients + self.heading_coefficients
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
    /// Beta of a phase.
    #[inline(always)]
    pub fn beta(&self, phase: f64) -> f64 {
        ((phase - self.begin) - (self.end - phase)) / (self.end - self.begin)
    }

    /// Beta per unit of alpha.
    #[inline(always)]
    pub fn beta_per_alpha(&self) -> f64 {
        2.0 / (self.end - self.begin)
    }
}

/// Neighbouring rows whose phases are cut in the same way.
#[derive(Debug, Clone)]
pub(crate) struct Band {
    /// The band's first row and how many it has: multiples of [`LANES`].
    pub first_row: usize,
    pub rows: usize,
    /// How long its polynomials are.
    pub(super) order: Order,
    /// In order of phase, from 0 to 1 without a gap.
    pub pieces: Vec<Piece>,
    /// By piece, then by block of [`LANES`] rows, then x, y and heading by power: see [`Band::block`].
    pub(super) coefficients: Vec<Lanes>,
    /// The place with beta 0 by piece, then by row, where the second handle can come; made with the table, then
    /// dropped.
    pub(super) centres: Vec<Option<Param>>,
    /// The piece in which each of equal shares of the phases begins.
    pub(super) piece_of_share: Vec<u32>,
}

/// What T has at one alpha, relative to the piece's centre.
#[derive(Debug, Clone, Copy)]
pub(super) struct Local {
    pub offset: Vector,
    /// Derivative of the place by alpha, metres.
    pub rate: Vector,
}

impl Band {
    /// A band without pieces.
    pub(super) fn new(first_row: usize, rows: usize, order: Order) -> Self {
        let (pieces, coefficients, centres, piece_of_share) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { first_row, rows, order, pieces, coefficients, centres, piece_of_share }
    }

    /// The number of the piece that holds a phase from 0 to 1.
    #[inline(always)]
    pub(crate) fn piece_at(&self, phase: f64) -> usize {
        let share = (phase * self.piece_of_share.len() as f64) as usize;
        let mut piece = self.piece_of_share[share.min(self.piece_of_share.len() - 1)] as usize;
        while piece + 1 < self.pieces.len() && self.pieces[piece].end <= phase {
            piece += 1;
        }
        piece
    }

    /// The coefficients of the `LANES` rows from `first_row + LANES * block` on: those of x by power, then of y, then
    /// of the heading, metres and radians.
    pub(crate) fn block(&self, piece: usize, block: usize) -> &[Lanes] {
        let (blocks, per_row) = (self.rows / LANES, self.order.per_row());
        &self.coefficients[(piece * blocks + block) * per_row..][..per_row]
    }

    /// The coefficients of x and y of one row, by power, metres; those beyond the band's order are zero.
    pub(crate) fn coordinates(&self, piece: usize, row: usize) -> [[f64; 6]; 2] {
        let (local, order) = (row - self.first_row, &self.order);
        let block = self.block(piece, local / LANES);
        std::array::from_fn(|quantity| {
            std::array::from_fn(|power| {
                if power < order.coefficients {
                    block[quantity * order.coefficients + power].0[local % LANES]
                } else {
                    0.0
                }
            })
        })
    }

    /// Fills `piece_of_share`, when all pieces are there.
    pub(super) fn index(&mut self) {
        let shares = (4 * self.pieces.len()).next_power_of_two();
        let begin = |share: usize| share as f64 / shares as f64;
        let piece_at = |phase: f64| self.pieces.partition_point(|piece| piece.end <= phase).min(self.pieces.len() - 1);
        self.piece_of_share = (0..shares).map(|share| piece_at(begin(share)) as u32).collect();
    }

    fn memory_bytes(&self) -> usize {
        size_of_val(self.coefficients.as_slice())
            + size_of_val(self.pieces.as_slice())
            + size_of_val(self.piece_of_share.as_slice())
    }
}

/// The table of T.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    pub order: Order,
    /// From the front of the table backward.
    pub bands: Vec<Band>,
    /// The phases of the kinks, in order.
    pub(super) kinks: Vec<f64>,
    /// The least alpha from which on every piece was found exact.
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
    /// Alpha moved by less than its whole part.
    #[inline(always)]
    pub(crate) fn plus(self, by: f64) -> Self {
        let phase = self.phase + by;
        let whole = phase.floor();
        Self { row: self.row.wrapping_add_signed(whole as isize), phase: phase - whole }
    }

    /// How much further back this alpha is than another.
    pub(super) fn minus(self, other: Self) -> f64 {
        (self.row as f64 - other.row as f64) + (self.phase - other.phase)
    }

    pub(super) fn number(self) -> f64 {
        self.row as f64 + self.phase
    }
}

impl Rows {
    /// The number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.bands.last().map_or(0, |band| band.first_row + band.rows)
    }

    /// The number of the band that holds a row.
    #[inline(always)]
    pub(crate) fn band_of(&self, row: usize) -> usize {
        self.bands.iter().position(|band| row < band.first_row + band.rows).unwrap_or(self.bands.len())
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.bands.iter().map(Band::memory_bytes).sum()
    }

    /// T relative to the centre of the piece at `alpha`, and that centre; while the table is made.
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

    /// Alpha of a place near `guess` (Newton's method), and the derivative of T there; while the table is made.
    pub(super) fn locate(&self, track: &Track, place: Param, guess: Alpha) -> Option<(Alpha, Vector)> {
        let mut alpha = guess;
        for _ in 0..30 {
            let (centre, local) = self.local(alpha)?;
            let miss = track.displacement(centre, place) - local.offset;
            let step = miss.dot(&local.rate) / local.rate.norm_squared();
            // The rate is that before the step, which has to be so short that it does not matter.
            let settled = step.abs() < 1e-13;
            alpha = alpha.plus(step.clamp(-0.5, 0.5));
            if settled {
                return (alpha.number() >= self.valid_from).then_some((alpha, local.rate));
            }
        }
        None
    }
}
