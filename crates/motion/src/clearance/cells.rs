//! The places of the handles and of the head while the second handle is in a cell of the table, as quadratic
//! polynomials of the cell's time with error bounds. Except for [`CELLS`], they are used only while the table is made.

use super::moving::Quadratic;
use crate::model::Vector;
use crate::model::elementary::hypot;
use crate::model::path::Path;
use crate::solve::table::FollowerTable;
use crate::solve::table::rows::{Alpha, Band, Rows};

/// Cells to a row.
pub(super) const CELLS: usize = 8;

/// The head at the boundary of a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeadGridPoint {
    place: Vector,
    /// Its derivative by the cell's time.
    slope: Vector,
    /// The error bound of the place, in metres.
    error: f64,
}

/// The error bound of the head's place at the end of the first cell, in links: the path's start is within the cell.
const ERROR_BEHIND_START: f64 = 1e-3;

/// Returns the first row for which T is known while the phase goes from `begin` to `end`. Returns also the handles from
/// this row up to `end_row`.
pub(super) fn handles(rows: &Rows, (begin, end): (f64, f64), end_row: usize) -> (usize, Vec<Quadratic>) {
    let front = rows.bands.first().map_or(0, |band| band.first_row);
    let first = ((rows.valid_from - begin).ceil() as usize).max(front);
    let mut handles = Vec::with_capacity(end_row.saturating_sub(first));
    for band in &rows.bands {
        let pieces = band.piece_at(begin)..=band.piece_at(end);
        for row in first.max(band.first_row)..end_row.min(band.first_row + band.rows) {
            handles.push(handle(band, pieces.clone(), row, (begin, end)));
        }
    }
    (first, handles)
}

/// Returns the row behind all rows that can have a handle within `distance` metres of one of the given rows, at any
/// phases.
///
/// At any phase a handle is within a link of its place at phase 0: its follower is the first place at that distance.
pub(super) fn end_of_near(rows: &Rows, of: impl Fn(usize) -> bool, link: f64, distance: f64) -> usize {
    let valid = |band: &Band| (rows.valid_from.ceil() as usize).max(band.first_row)..band.first_row + band.rows;
    let place = |band: &Band, row: usize| {
        let piece = band.piece_at(0.0);
        let beta = band.pieces[piece].beta(0.0);
        band.coordinates(piece, row).map(|c| c.iter().rev().fold(0.0, |value, c| value * beta + c))
    };
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for band in &rows.bands {
        for row in valid(band).filter(|row| of(*row)) {
            let place = place(band, row);
            low = std::array::from_fn(|axis| low[axis].min(place[axis]));
            high = std::array::from_fn(|axis| high[axis].max(place[axis]));
        }
    }
    // Two links for either handle: the first of the given rows may be known at later phases only.
    let within = distance + 4.0 * link;
    let is_near =
        |place: [f64; 2]| (0..2).all(|axis| (low[axis] - within..=high[axis] + within).contains(&place[axis]));
    let last = |band: &Band| valid(band).rev().find(|row| is_near(place(band, *row)));
    rows.bands.iter().rev().find_map(last).map_or(0, |row| row + 1)
}

/// Returns a handle while its phase goes from `begin` to `end`, which are in these pieces.
fn handle(band: &Band, pieces: std::ops::RangeInclusive<usize>, row: usize, (begin, end): (f64, f64)) -> Quadratic {
    let middle = 0.5 * (begin + end);
    let at = |piece: usize, phase: f64| place(band, piece, row, phase);
    let mut quadratic =
        Quadratic::through(at(*pieces.start(), begin), at(band.piece_at(middle), middle), at(*pieces.end(), end));
    let time = |phase: f64| (2.0 * phase - begin - end) / (end - begin);
    quadratic.error = greatest_miss(band, pieces, row, (begin, end), &quadratic, time);
    quadratic
}

/// Returns a handle while alpha goes from a row and phase on by `width`, less than 1; `None` beyond the table.
pub(super) fn track(rows: &Rows, row: usize, phase: f64, width: f64) -> Option<Quadratic> {
    let band = |row: usize| rows.bands.get(rows.band_of(row)).filter(|band| row >= band.first_row);
    let at = |by: f64| {
        let Alpha { row, phase } = Alpha { row, phase }.plus(by);
        band(row).map(|band| place(band, band.piece_at(phase), row, phase))
    };
    let mut quadratic = Quadratic::through(at(0.0)?, at(0.5 * width)?, at(width)?);
    let end = phase + width;
    for (row, begin, end, offset) in [(row, phase, end.min(1.0), 0.0), (row + 1, 0.0, end - 1.0, 1.0)] {
        if width > 0.0 && end > begin {
            let band = band(row)?;
            let pieces = band.piece_at(begin)..=band.piece_at(end);
            let time = |of: f64| 2.0 * (offset + of - phase) / width - 1.0;
            let miss = greatest_miss(band, pieces, row, (begin, end), &quadratic, time);
            quadratic.error = quadratic.error.max(miss);
        }
    }
    Some(quadratic)
}

/// Returns T at a phase in a piece.
fn place(band: &Band, piece: usize, row: usize, phase: f64) -> Vector {
    let beta = band.pieces[piece].beta(phase);
    let [x, y] = band.coordinates(piece, row);
    let value = |c: [f64; 6]| c.iter().rev().fold(0.0, |value, c| value * beta + c);
    Vector::new(value(x), value(y))
}

/// Returns a bound of the distance of T and a quadratic polynomial of the time from phase `begin` to `end`, which are
/// in these pieces.
fn greatest_miss(
    band: &Band,
    pieces: std::ops::RangeInclusive<usize>,
    row: usize,
    (begin, end): (f64, f64),
    quadratic: &Quadratic,
    time: impl Fn(f64) -> f64,
) -> f64 {
    let miss = |piece: usize| {
        let part = (band.pieces[piece].begin.max(begin), band.pieces[piece].end.min(end));
        let local = |low: f64, high: f64| (0.5 * (low + high), 0.5 * (high - low));
        let betas = local(band.pieces[piece].beta(part.0), band.pieces[piece].beta(part.1));
        let times = local(time(part.0), time(part.1));
        let miss: [f64; 2] = std::array::from_fn(|axis| {
            let coefficients = band.coordinates(piece, row)[axis];
            largest_difference(coefficients, betas, quadratic.terms.map(|term| term[axis]), times)
        });
        hypot(miss[0], miss[1])
    };
    pieces.map(miss).fold(0.0, f64::max)
}

/// Returns a bound of the difference of two polynomials, each on an interval given by its middle and half its length.
fn largest_difference(a: [f64; 6], (middle, half): (f64, f64), b: [f64; 3], (time, half_time): (f64, f64)) -> f64 {
    let mut shifted = a;
    for low in 0..5 {
        for power in (low..5).rev() {
            shifted[power] += middle * shifted[power + 1];
        }
    }
    let mut scale = 1.0;
    for coefficient in &mut shifted {
        *coefficient *= scale;
        scale *= half;
    }
    shifted[0] -= b[0] + time * (b[1] + time * b[2]);
    shifted[1] -= half_time * (b[1] + 2.0 * time * b[2]);
    shifted[2] -= half_time * half_time * b[2];
    shifted.iter().map(|coefficient| coefficient.abs()).sum()
}

/// Returns the head for each cell, with alpha of the second handle at the beginning of the cell. The index is the
/// number of the cell over all rows. The first of several places is returned. The places need not be exact.
pub(super) fn head_grid_points(path: &Path, follower: &FollowerTable, link: f64) -> Option<Vec<Option<HeadGridPoint>>> {
    let cells = |travelled: f64| {
        let (alpha, rate) = follower.second_handle(travelled)?;
        Some(((alpha.row as f64 + alpha.phase) * CELLS as f64, rate * CELLS as f64))
    };
    let (start, rate) = cells(0.0)?;
    let mut grid_points = vec![None; start as usize + 2];
    let longest = link / CELLS as f64;
    let grid_point = |travelled: f64, rate: f64, error: f64| {
        let param = path.param_at(travelled);
        HeadGridPoint { place: path.point(param).coords, slope: path.tangent(param) * (0.5 / rate), error }
    };
    let behind = (start.floor() + 1.0 - start) / rate;
    grid_points[start as usize + 1] =
        Some(grid_point(behind.clamp(-longest, longest), rate, ERROR_BEHIND_START * link));
    let mut travelled = 0.0;
    for wanted in (0..=start as usize).rev() {
        while let Some((reached, rate)) = cells(travelled)
            && reached > wanted as f64 + 1e-9
        {
            let step = (wanted as f64 - reached) / rate;
            travelled += if rate < 0.0 { step.clamp(1e-6 * link, longest) } else { longest };
        }
        let Some((reached, rate)) = cells(travelled) else { break };
        travelled += ((wanted as f64 - reached) / rate).clamp(-longest, longest);
        grid_points[wanted] = Some(grid_point(travelled, rate, 0.0));
    }
    Some(grid_points)
}

/// Returns the head between two grid points: the quadratic next to the cubic of their places and slopes. A frame's head
/// may be `handle_error` metres from the path.
pub(super) fn head_track(grid_points: &[Option<HeadGridPoint>], handle_error: f64) -> Option<Quadratic> {
    let [Some(begin), Some(end)] = grid_points else { return None };
    let middle = 0.5 * (begin.place + end.place) + 0.25 * (begin.slope - end.slope);
    let mut track = Quadratic::through(begin.place, middle, end.place);
    let cubic = 0.25 * (begin.slope + end.slope - (end.place - begin.place));
    track.error = cubic.norm() + begin.error.max(end.error) + 1e-6 + handle_error;
    Some(track)
}
