//! Where the head and the handle behind it are, by the metres the head has travelled.
//!
//! The head's link differs from the others, so its map is not the table's; both places are tabulated over the head's
//! way instead. Called by the follower table only.

use std::f64::consts::TAU;

use super::columns::{Columns, fraction, fraction_of_turn, tilt, turns};
use super::stencil::{DIFFERENCES, REACH, Stencil};
use crate::chain::Team;
use crate::geometry::path::Path;
use crate::geometry::spiral::{Angle, Spiral};

/// The most knots: a second of making.
const MOST_KNOTS: usize = 1 << 18;

/// The error of a place that is let pass, against the length of a link: a fifth of what links are promised to hold.
const ERROR_OF_LINK: f64 = 2e-13;

/// The most that is let pass, metres, where links are long.
const MOST_ERROR: f64 = 3e-13;

/// But the rounding of numbers as great as the distance from the centre is always let pass.
const ERROR_OF_RADIUS: f64 = 2.0 * f64::EPSILON;

/// The error of a speed that is let pass, relative to it or to the head's, whichever is greater.
const ERROR_OF_SPEED: f64 = 2e-12;

/// The table over the head's way. Every knot's numbers and, but for the last, the differences to the next.
#[derive(Debug, Clone)]
pub(super) struct Heads {
    /// Metres between two knots, a power of two.
    spacing: f64,
    knots: Vec<Knot>,
    /// Turns of the head to the next knot.
    turns: Vec<f64>,
    /// Knots of the columns from the second handle to where it is at the next knot.
    columns: Vec<f64>,
    /// What the tilt of the first bench grows to the next knot, turns.
    tilt: Vec<f64>,
    /// Metres up to which the table is exact.
    valid: f64,
}

#[derive(Debug, Clone, Copy)]
struct Knot {
    /// Turns of the head, and their fraction in fixed point, whose last digits a number would round away.
    turns: f64,
    fraction: i64,
    /// The angle of the first bench less that of the head, turns.
    tilt: f64,
    /// The knot of the columns nearest to the second handle and how far beyond it that is.
    column_knot: usize,
    between: f64,
}

/// What the table says of a moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lead {
    /// Turns of the head.
    pub turns: f64,
    /// Their fraction, in units of 2^-64 turns.
    pub fraction: i64,
    /// The angle of the first bench less that of the head, turns.
    pub tilt: f64,
    /// The knot of the columns nearest to the second handle.
    pub knot: usize,
    /// How far beyond it the handle is, -1/2 to 1/2 knots.
    pub between: f64,
    /// Knots per metre of the head's travel; negative, since the way goes inward.
    pub knots_per_metre: f64,
}

/// A knot while the table is made.
struct Making {
    head: Angle,
    second: Angle,
    tilt: f64,
}

/// Metres between two knots.
fn spacing(team: &Team) -> f64 {
    (0.25 * team.link(1)).log2().floor().exp2()
}

/// Whether the head's way is short enough for a table.
pub(super) fn fits(path: &Spiral, team: &Team) -> bool {
    path.length() / spacing(team) <= MOST_KNOTS as f64
}

impl Heads {
    /// The table from the start inward as far as it is exact; `None` where it is not at the start.
    pub(super) fn new(path: &Spiral, team: &Team, columns: &Columns, stencil: &Stencil) -> Option<Self> {
        let spacing = spacing(team);
        let outermost = (0..REACH).try_fold(path.start(), |place, _| path.ahead(place, -spacing))?;
        let mut made: Vec<Making> = Vec::new();
        let mut knots = Vec::new();
        for head in std::iter::successors(Some(outermost), |place| path.ahead(*place, spacing)) {
            let Some(knot) = Making::of(path, team, head) else { break };
            let second = knot.second.in_fixed_point_turns();
            let Some((column_knot, between)) = columns.locate(second, team.benches, stencil) else { break };
            let fixed = head.in_fixed_point_turns();
            knots.push(Knot { turns: turns(fixed), fraction: fraction(fixed), tilt: knot.tilt, column_knot, between });
            made.push(knot);
        }
        let of_pairs = |difference: &dyn Fn(usize) -> f64| (1..made.len()).map(difference).collect();
        let heads = Self {
            spacing,
            turns: of_pairs(&|next| turns_between(made[next - 1].head, made[next].head)),
            columns: of_pairs(&|next| {
                let (before, after) = (&knots[next - 1], &knots[next]);
                (after.column_knot as f64 - before.column_knot as f64) + (after.between - before.between)
            }),
            tilt: of_pairs(&|next| made[next].tilt - made[next - 1].tilt),
            knots,
            valid: 0.0,
        };
        heads.checked(path, team, columns, stencil, &made)
    }

    /// The table, valid up to two knots before the first between which it is not right, a quarter of the way and half way:
    /// half way the head's own interpolation is worst, while the columns' depends on where their knots lie meanwhile.
    fn checked(
        mut self,
        path: &Spiral,
        team: &Team,
        columns: &Columns,
        stencil: &Stencil,
        made: &[Making],
    ) -> Option<Self> {
        let mut knot = REACH;
        // The next knot needs its stencil too: half way may round up to it.
        while knot + REACH + 1 < made.len() {
            let right_at = |share: f64| {
                let head = path.ahead(made[knot].head, share * self.spacing);
                let right = head.and_then(|head| Making::of(path, team, head));
                let lead = self.around(knot, share, stencil);
                right.is_some_and(|right| is_right(&lead, &right, path, team, columns, stencil))
            };
            if !(right_at(0.25) && right_at(0.5)) {
                break;
            }
            knot += 1;
        }
        self.valid = (knot as f64 - REACH as f64 - 2.0) * self.spacing;
        (self.valid > 0.0).then_some(self)
    }

    /// Metres of travel up to which [`Heads::at`] may be asked.
    pub(super) fn valid(&self) -> f64 {
        self.valid
    }

    /// Bytes it holds.
    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(self.knots.as_slice()) + 3 * size_of_val(self.turns.as_slice())
    }

    /// The moment at which the head has travelled so many metres, from 0 to [`Heads::valid`].
    #[inline(always)]
    pub(super) fn at(&self, travelled: f64, stencil: &Stencil) -> Lead {
        let knots = travelled / self.spacing;
        let nearest = knots.round_ties_even();
        self.around(nearest as usize + REACH, knots - nearest, stencil)
    }

    #[inline(always)]
    fn around(&self, nearest: usize, beyond: f64, stencil: &Stencil) -> Lead {
        let weights = stencil.at(beyond);
        let differences = nearest - REACH..nearest - REACH + DIFFERENCES;
        let knot = &self.knots[nearest];
        let (ahead, _) = weights.of(&self.turns[differences.clone()]);
        let (columns, columns_slope) = weights.of(&self.columns[differences.clone()]);
        let (tilt, _) = weights.of(&self.tilt[differences]);
        let beyond_knot = knot.between + columns;
        let whole = beyond_knot.round_ties_even();
        Lead {
            turns: knot.turns + ahead,
            fraction: knot.fraction.wrapping_add((ahead * 2f64.powi(64)) as i64),
            tilt: knot.tilt + tilt,
            knot: knot.column_knot.wrapping_add_signed(whole as isize),
            between: beyond_knot - whole,
            knots_per_metre: columns_slope / self.spacing,
        }
    }
}

impl Making {
    fn of(path: &Spiral, team: &Team, head: Angle) -> Option<Self> {
        let second = path.follower(head, team.link(0)).ok()?;
        Some(Self { head, second, tilt: tilt(head.in_turns(), turns_between(head, second)) })
    }
}

/// Turns from one place to another, negative if that is further in.
fn turns_between(from: Angle, to: Angle) -> f64 {
    turns(to.in_fixed_point_turns() - from.in_fixed_point_turns())
}

/// Whether the places of the first two handles, the angles of their benches and the second one's speed are right.
fn is_right(lead: &Lead, right: &Making, path: &Spiral, team: &Team, columns: &Columns, stencil: &Stencil) -> bool {
    let (head, second) = (right.head.in_fixed_point_turns(), right.second.in_fixed_point_turns());
    let radius = path.radius(right.second);
    let metres = TAU * radius.hypot(path.growth());
    let allowed = (ERROR_OF_LINK * team.link(0).min(team.link(1))).min(MOST_ERROR).max(ERROR_OF_RADIUS * radius);
    let Some(third) = path.increment(radius, team.link(1)).ok() else { return false };
    let bench = path.bench(right.head, right.second, team.link(0));
    let speed = bench.front_cosine / bench.rear_cosine;
    let found = columns.around(lead.knot, lead.between, stencil);
    let found_speed = found.turns_per_knot * -lead.knots_per_metre * metres;
    let error_of_turns = |error: f64| error.abs() * metres <= allowed;
    error_of_turns(fraction_of_turn(fraction(head).wrapping_sub(lead.fraction)))
        && error_of_turns(columns.turns_from(lead.knot, second) - found.turns)
        && error_of_turns(right.tilt - lead.tilt)
        && error_of_turns(tilt(right.second.in_turns(), third / TAU) - found.tilt)
        && (found_speed - speed).abs() <= ERROR_OF_SPEED * speed.abs().max(1.0)
}
