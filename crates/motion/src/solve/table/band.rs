//! The making of T, band after band from the team's rear to the front of the path.
//!
//! A [`NodeChain`] holds the places of one phase in all rows of a band, each found from the place behind it. Five node
//! chains make a piece: their slopes give its polynomials, and their places prove the polynomials. If the proof fails,
//! the piece is halved. The next band starts from the frontmost row of the band before.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use super::beginning::Beginning;
use super::last_row::Row;
use super::layout::{bands, between_kinks, foremost, kinks, longest_reach};
use super::polynomial::{economise, from_slopes, horner};
use super::rows::{Band, LANES, Lanes, Lengths, Piece, Rows, Tolerance};
use super::track::{Node, Track};
use crate::event::Budget;
use crate::linkage;
use crate::model::Vector;
use crate::model::curve_bounds::CurveBounds;
use crate::model::elementary::hypot;
use crate::model::path::Param;
use crate::model::team::Team;

/// The greatest number of halvings between two kinks.
const MOST_HALVINGS: usize = 9;

/// The greatest size of a table, in bytes.
const MOST_BYTES: usize = 150 << 20;

/// The part of these bytes that any range of phases may take.
const LEAST_SHARE: f64 = 0.125;

/// The number of rows from which two threads make a band.
const PARALLEL_ROWS: usize = 128;

/// Halving continues if the halved piece uses less than this part of its parent's error: a smaller gain is rounding,
/// not shape.
const LEAST_GAIN: f64 = 0.75;

/// A piece with an error of this many times its allowance is cut before its other rows are tested.
const HOPELESS: f64 = 100.0;

/// Beta of the five node chains of a piece.
const NODES: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];

/// Max |e|, if the slope's error is e = b (b^2 - 1/4) (b^2 - 1) times its first neglected coefficient.
const LARGEST_NODAL: f64 = 0.12;

/// The nodes of one phase through a band, from its last row forward, as far as the chain can stand.
type NodeChain = Arc<Vec<Node>>;

/// A band during its making.
struct BandBuilder<'a> {
    track: &'a Track<'a>,
    tolerance: Tolerance,
    link: f64,
    behind: Row<'a>,
    first_row: usize,
    rows: usize,
    lengths: Lengths,
    /// The row behind the band; nothing ahead of `needed` has to be exact.
    end_row: usize,
    needed: usize,
    /// True if the second handle can come here.
    with_centres: bool,
    /// The number of bytes that the band may take.
    most_bytes: usize,
}

/// The finished part of a band.
struct Made {
    band: Band,
    front_row: Vec<(Piece, [Node; 5])>,
    valid_from: f64,
}

impl Made {
    /// Adds the part of later phases.
    fn append(&mut self, later: Self) {
        let Self { band, front_row, valid_from } = later;
        self.band.pieces.extend(band.pieces);
        self.band.coefficients.extend(band.coefficients);
        self.band.centres.extend(band.centres);
        self.front_row.extend(front_row);
        self.valid_from = self.valid_from.max(valid_from);
    }
}

/// Five node chains, evenly spaced over a piece.
type Quintet = [NodeChain; 5];

/// The largest errors of a piece over its rows, as parts of the allowed errors.
struct Errors {
    worst: f64,
    /// Alpha from which on the piece is exact.
    valid_from: f64,
    /// True if cutting the piece can help: some node chain reaches each wrong row.
    curable: bool,
}

impl BandBuilder<'_> {
    /// Returns `None` if the budget is spent.
    fn node_chain(&self, phase: f64, budget: &mut Budget) -> Option<NodeChain> {
        let mut nodes = Vec::with_capacity(self.rows);
        let mut gap = self.link;
        let mut rear = self.behind.node(phase);
        while let Some(node) = rear
            && nodes.len() < self.rows
        {
            budget.spend(1).ok()?;
            rear = self.track.ahead(&node, &mut gap, self.link);
            nodes.extend(rear);
        }
        Some(Arc::new(nodes))
    }

    fn quintet(&self, piece: Piece, budget: &mut Budget) -> Option<Quintet> {
        let mut at = |quarter: f64| self.node_chain(piece.begin + 0.25 * quarter * (piece.end - piece.begin), budget);
        Some([at(0.0)?, at(1.0)?, at(2.0)?, at(3.0)?, at(4.0)?])
    }

    /// Cuts a piece until its parts are exact, and adds these to the band. Returns `None` if the table becomes too
    /// large, or the budget is spent.
    fn refine(
        &self,
        made: &mut Made,
        piece: Piece,
        chains: Quintet,
        halvings: usize,
        parent: f64,
        budget: &mut Budget,
    ) -> Option<()> {
        let errors = self.errors(piece, &chains, halvings, budget)?;
        if errors.worst <= 1.0 || !errors.curable || halvings == 0 || errors.worst > LEAST_GAIN * parent {
            if errors.worst > 1.0 {
                made.valid_from = made.valid_from.max(errors.valid_from);
            }
            return self.keep(made, piece, &chains, budget);
        }
        let middle = 0.5 * (piece.begin + piece.end);
        let [a, b, c, d, e] = chains;
        let refine = |made: &mut Made, part: Piece, [front, centre, rear]: [NodeChain; 3], budget: &mut Budget| {
            let quarter = 0.25 * (part.end - part.begin);
            let first = self.node_chain(part.begin + quarter, budget)?;
            let second = self.node_chain(part.end - quarter, budget)?;
            self.refine(made, part, [front, first, centre, second, rear], halvings - 1, errors.worst, budget)
        };
        let (first, second) = (Piece { end: middle, ..piece }, Piece { begin: middle, ..piece });
        let (first_chains, second_chains) = ([a, b, c.clone()], [c, d, e]);
        if halvings < MOST_HALVINGS || self.rows < PARALLEL_ROWS {
            refine(made, first, first_chains, budget)?;
            return refine(made, second, second_chains, budget);
        }
        // One and two threads give the same result.
        let mut later = self.nothing(0.0);
        let (first, second) = budget.both(
            |budget| refine(made, first, first_chains, budget),
            |budget| refine(&mut later, second, second_chains, budget),
        );
        first?;
        second?;
        made.append(later);
        self.is_small_enough(made, piece.end)
    }

    /// Creates a band without pieces.
    fn nothing(&self, valid_from: f64) -> Made {
        let band = Band::new(self.first_row, self.rows, self.lengths);
        Made { band, front_row: Vec::new(), valid_from }
    }

    /// Returns `None` if the first phases take too many bytes: then all phases will. A part of the phases may take more
    /// than its share.
    fn is_small_enough(&self, made: &Made, phases: f64) -> Option<()> {
        let bytes = size_of_val(made.band.coefficients.as_slice()) as f64;
        (bytes <= self.most_bytes as f64 * phases.max(LEAST_SHARE)).then_some(())
    }

    fn keep(&self, made: &mut Made, piece: Piece, chains: &Quintet, budget: &mut Budget) -> Option<()> {
        self.tabulate(&mut made.band.coefficients, piece, chains, budget)?;
        if self.with_centres {
            let middle = &chains[2];
            let missing = std::iter::repeat_n(None, self.rows - middle.len());
            made.band.centres.extend(missing.chain(middle.iter().rev().map(|node| Some(node.at))));
        }
        made.front_row.extend(quintet_at(chains, self.rows - 1).map(|nodes| (piece, nodes.map(|node| *node))));
        made.band.pieces.push(piece);
        self.is_small_enough(made, piece.end)
    }

    /// Adds the polynomials of a piece; `None` if the budget is spent.
    fn tabulate(
        &self,
        coefficients: &mut Vec<Lanes>,
        piece: Piece,
        chains: &Quintet,
        budget: &mut Budget,
    ) -> Option<()> {
        let Lengths { coordinate, heading } = self.lengths;
        let half = 0.5 * (piece.end - piece.begin);
        let (rows, per_row) = (self.rows, self.lengths.per_row());
        let begin = coefficients.len();
        coefficients.resize(begin + rows / LANES * per_row, Lanes([0.0; LANES]));
        for (index, nodes) in (0..rows).map_while(|index| Some((index, quintet_at(chains, index)?))) {
            budget.spend(1).ok()?;
            let row = rows - 1 - index;
            let block = &mut coefficients[begin + row / LANES * per_row..][..per_row];
            let mut polynomials = polynomials(half, nodes);
            let middle = nodes[2];
            let point = self.track.path.point(middle.at);
            for (polynomial, centre) in polynomials.iter_mut().zip([point.x, point.y, middle.heading]) {
                polynomial[0] += centre;
            }
            for (quantity, mut polynomial) in polynomials.into_iter().enumerate() {
                let keep = if quantity < 2 { coordinate } else { heading };
                economise(&mut polynomial, keep);
                for (power, coefficient) in polynomial[..keep].iter().enumerate() {
                    block[quantity * coordinate + power].0[row % LANES] = *coefficient;
                }
            }
        }
        Some(())
    }

    /// Returns the errors of the polynomials of a piece, infinite if the piece is certain to be cut. Returns `None` if
    /// the budget is spent.
    fn errors(&self, piece: Piece, chains: &Quintet, halvings: usize, budget: &mut Budget) -> Option<Errors> {
        let half = 0.5 * (piece.end - piece.begin);
        let mut errors = Errors { worst: 0.0, valid_from: 0.0, curable: false };
        for index in 0..self.end_row - self.needed.max(self.first_row).min(self.end_row) {
            budget.spend(1).ok()?;
            let row = self.end_row - 1 - index;
            let error = match quintet_at(chains, index) {
                Some(nodes) => self.error(half, nodes, index, &chains[1]),
                None => f64::INFINITY,
            };
            errors.curable |= chains.iter().any(|chain| chain.len() > index);
            if error > 1.0 {
                errors.valid_from = errors.valid_from.max(row as f64 + piece.end);
            }
            errors.worst = errors.worst.max(error);
            if error == f64::INFINITY || error > HOPELESS && halvings > 0 {
                errors.worst = f64::INFINITY;
                break;
            }
        }
        Some(errors)
    }

    /// Returns the error of one row of a piece `2 half` long, as a part of the allowed error. This error is the largest
    /// of the errors of place, heading and speed.
    fn error(&self, half: f64, nodes: [&Node; 5], index: usize, chain: &NodeChain) -> f64 {
        let mut polynomials = polynomials(half, nodes);
        // The size of the slope's next power, if it falls as the last one did.
        let power = |power: usize| power as f64 * hypot(polynomials[0][power], polynomials[1][power]);
        let neglected = LARGEST_NODAL * power(5) * (power(5) / power(4)).min(1.0);
        let dropped: [f64; 3] = std::array::from_fn(|quantity| {
            let Lengths { coordinate, heading } = self.lengths;
            let keep = if quantity < 2 { coordinate } else { heading };
            economise(&mut polynomials[quantity], keep).value
        });
        let [x, y, heading] = polynomials;
        let middle = nodes[2];
        // Each step rounds; the node chains of a band differ by the sum.
        let walk = (index as f64 + 8.0).sqrt() * f64::EPSILON * self.link;
        let allowed = self.tolerance.metres(self.link) + 4.0 * walk;
        let allowed_heading = 10.0 * allowed / self.link + 2.0 * f64::EPSILON;
        let (mut miss, mut turn): (f64, f64) = (0.0, 0.0);
        for (node, beta) in nodes.into_iter().zip(NODES) {
            let found = Vector::new(horner(&x, beta).0, horner(&y, beta).0);
            miss = miss.max((self.track.displacement(middle.at, node.at) - found).norm());
            turn = turn.max((within_half_turn(node.heading - middle.heading) - horner(&heading, beta).0).abs());
        }
        let dropped_place = hypot(dropped[0], dropped[1]);
        let truncated = neglected + 25.0 * dropped_place;
        let worst = ((miss + dropped_place) / allowed)
            .max((turn + dropped[2]) / allowed_heading)
            .max(truncated / (half * middle.spacing) / self.tolerance.speed);
        if worst <= 1.0 && !self.is_follower_of_next(chain, index) { f64::INFINITY } else { worst }
    }

    /// Returns true if the previous node of a node chain is the follower that the linkage finds.
    fn is_follower_of_next(&self, chain: &NodeChain, index: usize) -> bool {
        let Some(before) = index.checked_sub(1) else { return true };
        is_follower(self.track, chain[before].at, chain[index].at, self.link)
    }
}

/// Returns true if a place at a link's distance is the follower of `front` that the linkage finds.
fn is_follower(track: &Track, place: Param, front: Param, link: f64) -> bool {
    let may_be_first = place.segment == front.segment && track.path.branch(front, link).is_none();
    if may_be_first && track.path.segment(front).distance_grows(front.at, place.at) {
        return true;
    }
    let Ok(found) = linkage::follower(track.path, front, link) else { return false };
    let size = track.path.point(front).coords.norm();
    track.displacement(found, place).norm() <= 1e-6 * link + 1e-13 * size
}

/// Returns one row's nodes in the five chains, the row counted forward from the band's last; `None` if a chain ends
/// before.
fn quintet_at(chains: &Quintet, index: usize) -> Option<[&Node; 5]> {
    let [a, b, c, d, e] = chains.each_ref().map(|chain| chain.get(index));
    Some([a?, b?, c?, d?, e?])
}

/// Returns the polynomials in beta of x and y relative to the middle node, metres, and of the heading relative to its
/// heading.
fn polynomials(half: f64, nodes: [&Node; 5]) -> [[f64; 6]; 3] {
    [
        from_slopes(nodes.map(|node| -half * node.spacing * node.tangent.x)),
        from_slopes(nodes.map(|node| -half * node.spacing * node.tangent.y)),
        from_slopes(nodes.map(|node| half * node.heading_rate)),
    ]
}

/// Returns a difference of two angles reduced to half a turn.
pub(super) fn within_half_turn(angle: f64) -> f64 {
    if angle > PI {
        angle - TAU
    } else if angle < -PI {
        angle + TAU
    } else {
        angle
    }
}

/// The first row of bands so far behind that shorter polynomials and more pieces make a frame faster. There a frame
/// waits for memory, and each piece of a row needs less.
const FAR_ROW: usize = 512;

/// The number of junctions from which a table that would be too large covers the beginning of the path alone.
const MANY_JUNCTIONS: usize = 16;

/// The number of times by which a table may seem too large before it is made: bands further back have fewer kinks.
const ROUGHLY: f64 = 4.0;

/// Makes the table for `team` on `path`; `None` if there is none, it would be too large, or the budget is spent. On a
/// path of many junctions it covers as much of the beginning as its limit allows.
/// `all_centres`: the places of the pieces' centres are for frames, too, in every row.
pub(super) fn rows(
    track: &Track,
    team: &Team,
    tolerance: Tolerance,
    all_centres: bool,
    budget: &mut Budget,
) -> Option<Rows> {
    let mut rows_up_to = |reach: f64| rows_up_to(track, team, tolerance, all_centres, reach, budget);
    let junctions = |reach: f64| track.path.junctions().take_while(|at| *at <= reach).count();
    // Each junction cuts all rows.
    let bytes = |reach: f64| {
        let rows = team.benches as f64 + reach / team.link(1);
        (1 + junctions(reach)) as f64 * rows * (Lengths::NEAR.per_row() * size_of::<f64>()) as f64
    };
    let mut reach = longest_reach(track, team);
    while junctions(reach) > MANY_JUNCTIONS {
        if bytes(reach) < ROUGHLY * MOST_BYTES as f64
            && let Some(rows) = rows_up_to(reach)
        {
            return Some(rows);
        }
        reach *= 0.5;
    }
    rows_up_to(reach)
}

/// Makes the table for the first `reach` metres of the head's travel.
fn rows_up_to(
    track: &Track,
    team: &Team,
    tolerance: Tolerance,
    all_centres: bool,
    reach: f64,
    budget: &mut Budget,
) -> Option<Rows> {
    let beginning = Beginning::new(track, team)?;
    let link = team.link(1);
    let foremost = foremost(track, team, reach, budget)?;
    let second = track.follower(track.path.param_at(0.0), team.link(0))?;
    // One chain of nodes determines the number of rows, with a margin; it is least if each takes half a turn.
    let mut node = beginning.node(track, 0.0);
    let bytes_per_row = Lengths::NEAR.per_row() * size_of::<f64>();
    let fewest = (track.path.arc_length(node.at, foremost) / (FRAC_PI_2 * link)).max(0.0) as usize;
    if fewest.saturating_mul(bytes_per_row) > MOST_BYTES {
        return None;
    }
    let (mut gap, mut steps, mut behind_second) = (link, 0, 0);
    while track.path.arc_length(foremost, node.at) < 0.0 {
        budget.spend(1).ok()?;
        steps += 1;
        if track.path.arc_length(second, node.at) < 0.0 {
            behind_second = steps;
        }
        let Some(next) = track.ahead(&node, &mut gap, link) else { break };
        node = next;
        if steps * bytes_per_row > MOST_BYTES {
            return None;
        }
    }
    let end = (steps + 2).next_multiple_of(LANES);
    let kinks = kinks(track, &beginning, link, end, foremost, budget);
    let phases = kinks.iter().map(|kink| kink.fract()).collect();
    let mut table = Rows { tolerance, bands: Vec::new(), kinks: phases, valid_from: 0.0 };
    // So far behind, one piece suffices. It is smoother than the beginning computed for each phase.
    let whole = Piece { begin: 0.0, end: 1.0 };
    let nodes = [0.0, 0.25, 0.5, 0.75, 1.0].map(|alpha| beginning.node(track, alpha));
    let mut behind = Row::new(track, &[(whole, nodes)]);
    for (first_row, end_row) in bands(end) {
        let lengths = if first_row >= FAR_ROW { Lengths::FAR } else { Lengths::NEAR };
        let builder = BandBuilder {
            track,
            tolerance,
            link,
            behind,
            first_row,
            rows: end_row - first_row,
            lengths,
            end_row,
            needed: end - steps - 2,
            with_centres: all_centres || first_row <= end - behind_second,
            most_bytes: MOST_BYTES.saturating_sub(table.memory_bytes()),
        };
        let mut made = builder.nothing(table.valid_from);
        for piece in between_kinks(&kinks, first_row) {
            let quintet = builder.quintet(piece, budget)?;
            builder.refine(&mut made, piece, quintet, MOST_HALVINGS, f64::INFINITY, budget)?;
        }
        let Made { mut band, front_row, valid_from } = made;
        band.index();
        table.valid_from = valid_from;
        table.bands.insert(0, band);
        behind = Row::new(track, &front_row);
        if valid_from > first_row as f64 {
            break;
        }
    }
    Some(table)
}
