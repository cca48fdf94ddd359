//! Places of the head and the handle behind it, by the metres that the head has travelled.
//!
//! The head's link differs from the others, so its map is not the table's, and both places are tabulated over the
//! head's travel instead.

use super::polynomial::SlopeFit;
use super::rows::{Alpha, Rows};
use super::track::Track;
use crate::event::Budget;
use crate::model::Vector;
use crate::model::elementary::{hypot, pow};
use crate::model::path::Param;
use crate::model::root::increasing_root;
use crate::model::team::Team;

/// Nodes of the Gauss-Lobatto formula: their slopes give a polynomial and their values prove it.
const NODES: [f64; 7] =
    [-1.0, -0.830_223_896_278_567, -0.468_848_793_470_714_2, 0.0, 0.468_848_793_470_714_2, 0.830_223_896_278_567, 1.0];

/// Coefficients of a polynomial over the head's travel.
const COEFFICIENTS: usize = NODES.len() + 1;

/// The largest error of a slope, as a part of its first neglected coefficient.
const LARGEST_NODAL: f64 = 0.04;

/// x, y, heading and alpha.
const QUANTITIES: usize = 4;

/// The greatest number of pieces, 20 MB. For a longer path the table covers its beginning.
const MOST_PIECES: usize = 1 << 16;

/// The greatest length of a piece, in links of travel.
const LONGEST: f64 = 1.0;

/// The greatest length of a piece at the start, metres of travel: places have the rounding of the piece's extent.
const LONGEST_METRES: f64 = 100.0;

/// The least length of a piece, in links of travel: at shorter ones the table ends.
const SHORTEST: f64 = 1e-7;

/// Promised error in metres for a short travel, and promised relative error of speeds.
const MOST_ERROR: f64 = 1e-13;
const SPEED_ERROR: f64 = 1e-12;

/// Units of work of a piece: two links for each node, and as many again to find where the piece ends.
const WORK_OF_PIECE: u64 = 4 * NODES.len() as u64;

/// A kink this near the end of a piece, in links, does not cut the piece.
const AT_END: f64 = 1e-11;

/// A stretch of travel, metres, on which all quantities are polynomials.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// The travel where beta is 0, in metres, and beta per metre.
    middle: f64,
    scale: f64,
    /// Alpha is `row` plus the polynomial's value.
    row: usize,
    /// By power: x, y, heading, alpha.
    coefficients: [[f64; QUANTITIES]; COEFFICIENTS],
}

/// The table over the head's travel.
#[derive(Debug, Clone, Default)]
pub(super) struct HeadTable {
    pieces: Vec<Piece>,
    /// The travel at which each piece begins, and at which the last ends, in metres.
    begins: Vec<f64>,
    /// The piece in which each of equal shares of the travel begins.
    piece_of_share: Vec<u32>,
    shares_per_metre: f64,
}

/// The table's values for one travel.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeadSample {
    /// The place, in metres, and the heading, in radians, not yet within half a turn.
    pub x: f64,
    pub y: f64,
    pub heading: f64,
    /// The head's unit tangent.
    pub tangent: [f64; 2],
    /// The place of the second handle, and its change per metre of travel; negative while it goes forward.
    pub alpha: Alpha,
    pub alpha_per_metre: f64,
}

/// The head and the second handle from the linkage.
#[derive(Debug, Clone, Copy)]
struct Exact {
    head: Param,
    tangent: Vector,
    heading: f64,
    heading_rate: f64,
    alpha: Alpha,
    alpha_rate: f64,
}

impl HeadTable {
    /// Returns the sample at `travelled` metres, from 0 to [`HeadTable::valid_until`].
    #[inline(always)]
    pub(super) fn at(&self, travelled: f64) -> HeadSample {
        let share = ((travelled * self.shares_per_metre) as usize).min(self.piece_of_share.len() - 2);
        let (low, high) = (self.piece_of_share[share] as usize, self.piece_of_share[share + 1] as usize);
        let index = low + self.begins[low + 1..=high].partition_point(|begin| *begin <= travelled);
        self.pieces[index.min(self.pieces.len() - 1)].at(travelled)
    }

    /// Returns the metres of travel at which the table ends.
    pub(super) fn valid_until(&self) -> f64 {
        self.begins.last().copied().unwrap_or(0.0)
    }

    /// Returns the foremost row in which the second handle can stand.
    pub(super) fn foremost_row(&self) -> usize {
        // Alpha is within a link of the middle of its piece.
        self.pieces.iter().map(|piece| piece.row).min().map_or(0, |row| row.saturating_sub(1))
    }

    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(self.pieces.as_slice())
            + size_of_val(self.begins.as_slice())
            + size_of_val(self.piece_of_share.as_slice())
    }

    fn index(&mut self) {
        let shares = 2 * self.pieces.len();
        self.shares_per_metre = shares as f64 / self.valid_until();
        let piece_at = |travelled: f64| self.begins.partition_point(|begin| *begin <= travelled).max(1) - 1;
        let begin = |share: usize| share as f64 / self.shares_per_metre;
        // With a margin around each share, so that rounding cannot select a wrong piece.
        self.piece_of_share =
            (0..=shares).map(|share| piece_at(begin(share)).min(self.pieces.len() - 1) as u32).collect();
    }
}

impl Piece {
    #[inline(always)]
    fn at(&self, travelled: f64) -> HeadSample {
        self.at_beta((travelled - self.middle) * self.scale)
    }

    #[inline(always)]
    fn at_beta(&self, beta: f64) -> HeadSample {
        let (mut value, mut slope) = (self.coefficients[COEFFICIENTS - 1], [0.0; QUANTITIES]);
        for coefficients in self.coefficients.iter().rev().skip(1) {
            for quantity in 0..QUANTITIES {
                slope[quantity] = slope[quantity] * beta + value[quantity];
                value[quantity] = value[quantity] * beta + coefficients[quantity];
            }
        }
        let [x, y, heading, alpha] = value;
        HeadSample {
            x,
            y,
            heading,
            tangent: [slope[0] * self.scale, slope[1] * self.scale],
            alpha: Alpha { row: self.row, phase: 0.0 }.plus(alpha),
            alpha_per_metre: slope[3] * self.scale,
        }
    }
}

/// Input to make a [`HeadTable`].
pub(super) struct HeadBuilder<'a> {
    pub track: &'a Track<'a>,
    pub team: &'a Team,
    pub rows: &'a Rows,
    fit: SlopeFit<{ NODES.len() }>,
}

impl<'a> HeadBuilder<'a> {
    pub(super) fn new(track: &'a Track<'a>, team: &'a Team, rows: &'a Rows) -> Self {
        Self { track, team, rows, fit: SlopeFit::new(&NODES) }
    }

    /// Makes the table from the start on as far as it is exact; `None` if it is not exact at the start, or the budget is
    /// spent.
    pub(super) fn build(&self, budget: &mut Budget) -> Option<HeadTable> {
        let link = self.team.link(1);
        let mut table = HeadTable { begins: vec![0.0], ..HeadTable::default() };
        let mut reached = self.start()?;
        if reached.alpha.row + self.team.benches > self.rows.rows() {
            return None;
        }
        let mut travelled = 0.0;
        let mut length = LONGEST * link;
        while table.pieces.len() < MOST_PIECES {
            budget.spend(WORK_OF_PIECE).ok()?;
            let short = length.min(LONGEST_METRES + 4.0 * travelled);
            let end = self.end_before_junction(travelled, travelled + short);
            if end <= travelled {
                break;
            }
            let cut =
                self.exact_from(reached, end - travelled).map(|exact| self.cut_at_kink(reached, travelled, end, exact));
            let made = cut.and_then(|(end, exact)| Some((end, exact, self.piece(reached, travelled, end)?)));
            match made {
                Some((end, exact, (piece, error))) if error <= 1.0 => {
                    table.pieces.push(piece);
                    table.begins.push(end);
                    // The error goes with the eighth power of the length.
                    length = ((end - travelled) * pow(0.5 / error.max(1e-6), 0.125)).clamp(0.5 * length, 2.0 * length);
                    length = length.min(LONGEST * link);
                    (travelled, reached) = (end, self.past_junction(exact, end));
                }
                _ => {
                    length = 0.5 * length.min(end - travelled);
                    if length < SHORTEST * link || travelled + length <= travelled {
                        break;
                    }
                }
            }
        }
        if table.pieces.is_empty() {
            return None;
        }
        table.index();
        Some(table)
    }

    /// Returns the first two handles at the start.
    fn start(&self) -> Option<Exact> {
        let head = self.track.path.param_at(0.0);
        let second = self.track.follower(head, self.team.link(0))?;
        // The row is found by bisection: T is monotone.
        let (mut ahead, mut behind) = (self.rows.valid_from.ceil() as usize, self.rows.rows());
        while behind - ahead > 1 {
            let row = ahead.midpoint(behind);
            let (centre, _) = self.rows.local(Alpha { row, phase: 0.5 }).unzip();
            match centre {
                Some(centre) if self.track.path.arc_length(centre, second) <= 0.0 => ahead = row,
                _ => behind = row,
            }
        }
        self.exact(head, Alpha { row: ahead, phase: 0.5 })
    }

    fn exact(&self, head: Param, guess: Alpha) -> Option<Exact> {
        let (track, link) = (self.track, self.team.link(0));
        let second = track.follower(head, link)?;
        let (tangent, second_tangent) = (track.path.tangent(head), track.path.tangent(second));
        let pose = track.pose((head, tangent), (second, second_tangent), link)?;
        let (alpha, rate) = self.rows.locate(track, second, guess)?;
        let alpha_rate = -pose.speed_ratio / rate.norm();
        Some(Exact { head, tangent, heading: pose.heading, heading_rate: pose.heading_per_metre, alpha, alpha_rate })
    }

    /// Returns the exact handles a short distance after exact ones; the head stays on its segment.
    fn exact_from(&self, from: Exact, metres: f64) -> Option<Exact> {
        let guess = from.alpha.plus((metres * from.alpha_rate).clamp(-1.0, 1.0));
        self.exact(self.track.advanced(from.head, metres), guess)
    }

    /// Does the same with the head moved to the next segment if it is at the end of its own.
    fn past_junction(&self, exact: Exact, travelled: f64) -> Exact {
        let (path, segment) = (self.track.path, exact.head.segment + 1);
        if segment == path.segments() || path.end_of(segment - 1) > travelled {
            return exact;
        }
        Exact { head: Param { segment, at: path.first(segment) }, ..exact }
    }

    fn end_before_junction(&self, travelled: f64, end: f64) -> f64 {
        let path = self.track.path;
        let next = path.junctions().find(|junction| *junction > travelled);
        end.min(next.unwrap_or(f64::INFINITY)).min(path.length())
    }

    /// Returns the end of a piece, cut where the second handle first meets a kink of T, and the exact handles there.
    fn cut_at_kink(&self, from: Exact, travelled: f64, end: f64, to: Exact) -> (f64, Exact) {
        let moved = to.alpha.minus(from.alpha);
        let nearest = self.rows.kinks.iter().filter_map(|kink| {
            // Links from the beginning of the piece to the kink in the direction of alpha.
            let ahead = if moved < 0.0 {
                (from.alpha.phase - kink).rem_euclid(1.0)
            } else {
                (kink - from.alpha.phase).rem_euclid(1.0)
            };
            let ahead = if ahead < AT_END { ahead + 1.0 } else { ahead };
            (ahead < moved.abs() - AT_END && ahead < 1.0 - AT_END).then_some(ahead)
        });
        let Some(wanted) = nearest.reduce(f64::min) else { return (end, to) };
        let sign = moved.signum();
        let excess = |metres: f64| match self.exact_from(from, metres) {
            Some(exact) => (sign * exact.alpha.minus(from.alpha) - wanted, sign * exact.alpha_rate),
            None => (1.0, f64::NAN),
        };
        let span = end - travelled;
        let cut = travelled + increasing_root(excess, 0.0, span, span * wanted / moved.abs());
        match self.exact_from(from, cut - travelled) {
            Some(exact) if cut > travelled && cut < end => (cut, exact),
            _ => (end, to),
        }
    }

    /// Returns the polynomials from one travel to another, and their error as a part of the allowed error.
    fn piece(&self, from: Exact, travelled: f64, end: f64) -> Option<(Piece, f64)> {
        let half = 0.5 * (end - travelled);
        let middle = travelled + half;
        let at = |beta: f64| self.exact_from(from, half * (1.0 + beta));
        let mut exact = [from; NODES.len()];
        for (exact, beta) in exact.iter_mut().zip(NODES).skip(1) {
            *exact = at(beta)?;
        }
        if !self.has_rows(&exact) {
            return None;
        }
        let centre = exact[NODES.len() / 2];
        let data = exact.map(|exact| self.data(exact, centre));
        let mut coefficients = [[0.0; QUANTITIES]; COEFFICIENTS];
        for quantity in 0..QUANTITIES {
            let polynomial = self.fit.coefficients(std::array::from_fn(|node| half * data[node].1[quantity]));
            for (coefficients, coefficient) in coefficients[1..].iter_mut().zip(polynomial) {
                coefficients[quantity] = coefficient;
            }
        }
        let relative = Piece { middle, scale: half.recip(), row: centre.alpha.row, coefficients };
        let errors = NODES.into_iter().zip(&data).map(|(beta, data)| self.error(&relative, beta, data));
        let error = errors.fold(self.harm_of_rounding(&relative), f64::max);
        let point = self.track.path.point(centre.head);
        let mut piece = relative;
        for (coefficient, value) in
            piece.coefficients[0].iter_mut().zip([point.x, point.y, centre.heading, centre.alpha.phase])
        {
            *coefficient += value;
        }
        Some((piece, error))
    }

    /// Returns true if there are rows for the last handle all along a piece. A stall pushes the team back, also past
    /// its first place.
    fn has_rows(&self, exact: &[Exact; NODES.len()]) -> bool {
        let (first, last) = (exact[0], exact[NODES.len() - 1]);
        let moved = exact.map(|exact| exact.alpha.minus(first.alpha));
        let (least, most) = (moved.into_iter().fold(0.0, f64::min), moved.into_iter().fold(0.0, f64::max));
        // Where alpha turns round, the greatest is between two nodes.
        let turns = most > last.alpha.minus(first.alpha).max(0.0);
        let furthest = first.alpha.plus(if turns { most + 0.1 * (most - least) } else { most });
        furthest.row + self.team.benches <= self.rows.rows()
    }

    /// Returns the change of places and speeds by the rounding of the travel alone, as a part of the promised accuracy.
    /// Near a lock, where the handles behind move much faster than the head, no table and no solver keeps the promise.
    fn harm_of_rounding(&self, piece: &Piece) -> f64 {
        let (link, travelled) = (self.team.link(1), piece.middle);
        let rounding = f64::EPSILON * travelled;
        let ends = [-1.0, 1.0].map(|beta| {
            let alpha = |power: usize| piece.coefficients[power][3];
            let power_of = |power: usize| f64::powi(beta, power as i32);
            let slope: f64 = (1..COEFFICIENTS).map(|k| k as f64 * alpha(k) * power_of(k - 1)).sum();
            let change: f64 = (2..COEFFICIENTS).map(|k| (k * (k - 1)) as f64 * alpha(k) * power_of(k - 2)).sum();
            let ratio = (slope * piece.scale * link).abs();
            let place = rounding * ratio / MOST_ERROR.max(self.rows.tolerance.place).max(8.0 * rounding);
            let speed = rounding * (change * piece.scale.powi(2) * link).abs() / ratio.max(1.0);
            place.max(speed / SPEED_ERROR.max(self.rows.tolerance.speed))
        });
        ends[0].max(ends[1])
    }

    /// Returns x, y, heading and alpha relative to the centre of a piece, and their derivatives by travel.
    fn data(&self, exact: Exact, centre: Exact) -> ([f64; QUANTITIES], [f64; QUANTITIES]) {
        let offset = self.track.displacement(centre.head, exact.head);
        let turn = super::band::within_half_turn(exact.heading - centre.heading);
        let values = [offset.x, offset.y, turn, exact.alpha.minus(centre.alpha)];
        (values, [exact.tangent.x, exact.tangent.y, exact.heading_rate, exact.alpha_rate])
    }

    fn error(&self, piece: &Piece, beta: f64, exact: &([f64; QUANTITIES], [f64; QUANTITIES])) -> f64 {
        let tolerance = &self.rows.tolerance;
        let link = self.team.link(1);
        let (values, rates) = exact;
        let found = piece.at_beta(beta);
        let alpha = found.alpha.minus(Alpha { row: piece.row, phase: 0.0 });
        // From one piece of T to the next, alpha jumps by the rounding accumulated along the rows.
        let walk = 2.0 * (self.rows.rows() as f64).sqrt() * f64::EPSILON * link;
        let allowed = tolerance.metres(self.team.shortest_link()) + walk;
        let place = hypot(found.x - values[0], found.y - values[1]).max(link * (alpha - values[3]).abs());
        // The size of a slope's next power, if it falls as the last one did.
        let neglected = |quantities: &[usize]| {
            let power = |power: usize| {
                let sum: f64 = quantities.iter().map(|quantity| piece.coefficients[power][*quantity].powi(2)).sum();
                power as f64 * sum.sqrt()
            };
            let (last, before) = (power(COEFFICIENTS - 1), power(COEFFICIENTS - 2));
            LARGEST_NODAL * piece.scale * last * (last / before).min(1.0)
        };
        // The second handle's speed may also have an error relative to the head's.
        let speed = neglected(&[3]) / rates[3].abs().max(1.0 / link);
        (place / allowed)
            .max((found.heading - values[2]).abs() / (10.0 * allowed / link + 2.0 * f64::EPSILON))
            .max(neglected(&[0, 1]).max(speed) / tolerance.speed)
    }
}
