//! How near boards can come to those behind them, for every place on a spiral: worked out before the show, so that a
//! frame need only ask the few benches that can be the nearest.
//!
//! All links but the head's are equal: where one handle behind the head stands, all further ones follow. So how near a
//! bench is to those behind it depends on nothing but its own place. The table divides the path into cells,
//! [`PHASES`] to a link, such that when a handle is in one, the next handle is in the cell a link further out. For each
//! it has a lower bound of the clearance, proven at [`Pair`]; where nothing is proven, a bound that excludes nobody.
//! Called by the clearance only.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};
use std::ops::Range;

use super::circle_radius;
use crate::chain::newton::Newton;
use crate::chain::{Chain, Team, Velocities};
use crate::geometry::Point;
use crate::geometry::path::Path;
use crate::geometry::rectangle::Board;
use crate::geometry::root::increasing_root;
use crate::geometry::separation::{separation_board_board, signed_distance_board_board};
use crate::geometry::spiral::{Angle, Spiral};

/// Cells to a link.
const PHASES: usize = 16;

/// The most benches of a table: 11 MB.
const MOST_BENCHES: f64 = 16_384.0;

/// The most work to make a table, in pairs looked at: about half a second. Where boards are long against their links or
/// the turns against the boards, every board has hundreds about it.
const MOST_WORK: usize = 1 << 29;

/// The work of bounding a pair, in pairs looked at.
const WORK_OF_BOUND: usize = 128;

/// Beyond so many benches the ones that can be the nearest are on different turns.
const MOST_NEAREST: usize = 8;

/// How near a bench can be to those behind it while a handle of it is in a certain cell: a body bench's front handle,
/// the head's rear one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near {
    /// No bench behind is nearer, metres.
    pub bound: f32,
    /// The nearest ones: the first, counted from the one whose front handle is in the cell, and how many.
    pub first: u32,
    /// See `first`.
    pub count: u32,
    /// No other bench behind is nearer, metres.
    pub others: f32,
}

impl Near {
    const UNKNOWN: Self = Self { bound: f32::NEG_INFINITY, first: 0, count: 0, others: f32::NEG_INFINITY };

    /// The benches' numbers, given that of the one whose front handle is in the cell.
    pub(super) fn benches(&self, front: usize) -> Range<usize> {
        let first = front + self.first as usize;
        first..first + self.count as usize
    }
}

/// The table.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    /// How many benches have cells, from the inside out.
    benches: usize,
    /// The most that a bound says, metres.
    farthest: f64,
    /// The squared distance from the origin beyond which a head is told by its rear handle.
    head_from_squared: f64,
    /// Squared distances from the origin at which the cells begin, from the inside out.
    begins: Vec<f64>,
    /// For body benches.
    body: Vec<Near>,
    /// For the head.
    head: Vec<Near>,
    /// The bounds of `body`, but phase by phase, so that those of a whole chain lie side by side.
    bounds: Vec<f32>,
}

/// The handles of a frame against the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Located {
    link: usize,
    phase: usize,
}

impl Cells {
    /// The table for a team whose head starts where `spiral` does. `None` where the way is too long for one, or too short
    /// to need one.
    pub(super) fn new(spiral: &Spiral, team: &Team) -> Option<Self> {
        let link = team.link(1);
        let innermost = spiral.place_of_theta(link / spiral.growth());
        if team.benches < 3 || team.width >= spiral.pitch() || spiral.radius(spiral.start()) <= link {
            return None;
        }
        // A link's arc is longer than its chord; the head's, by less than pi / 2 times.
        let way = (spiral.distance_between(spiral.start(), innermost) + 2.0 * team.link(0)) / link;
        if way + team.benches as f64 > MOST_BENCHES {
            return None;
        }
        let heads = way as usize + 1;
        let benches = heads + team.benches;
        let span = spiral.follower(innermost, link).ok()?.minus(innermost);
        let stand = |phase: usize| {
            Stand::new(spiral, team, benches, heads, innermost.plus(span * phase as f64 / PHASES as f64))
        };
        let mut table = Self {
            benches,
            farthest: (spiral.pitch() - team.width).min(link),
            head_from_squared: HeadBoard::least_radius(spiral, team).powi(2),
            begins: vec![0.0; (benches + 1) * PHASES],
            body: vec![Near::UNKNOWN; benches * PHASES],
            head: vec![Near::UNKNOWN; heads * PHASES],
            bounds: vec![f32::NEG_INFINITY; benches * PHASES],
        };
        let innermost_stand = stand(0)?;
        let mut before = innermost_stand.clone();
        let mut work = 0;
        for phase in 0..PHASES {
            let after = if phase + 1 < PHASES { Some(stand(phase + 1)?) } else { None };
            // After the last phase a handle is where the next one was at the first.
            let (after_it, shift) = after.as_ref().map_or((&innermost_stand, 1), |after| (after, 0));
            let farthest = table.farthest;
            let step = PhaseStep { spiral, team, farthest, before: &before, after: after_it, shift };
            table.fill(phase, &step, &mut work)?;
            before = after.unwrap_or(before);
        }
        Some(table)
    }

    /// Fills the cells of one phase; `None` where that is too much work.
    fn fill(&mut self, phase: usize, step: &PhaseStep, work: &mut usize) -> Option<()> {
        let (mut body_end, mut head_end) = (0, 0);
        for (begin, radius) in self.begins.iter_mut().skip(phase).step_by(PHASES).zip(&step.before.radii) {
            *begin = radius * radius;
        }
        for link in 0..self.benches {
            let cell = link * PHASES + phase;
            self.body[cell] = step.near(&step.body(link, link), link, link + 2, &mut body_end, work);
            self.bounds[phase * self.benches + link] = self.body[cell].bound;
            if let (Some(near), Some(head)) = (self.head.get_mut(cell), step.head(link)) {
                *near = step.near(&head, link, link + 1, &mut head_end, work);
            }
            if *work > MOST_WORK {
                return None;
            }
        }
        Some(())
    }

    /// The most that a bound says, metres: where no boards are nearer, the table excludes nobody.
    pub(super) fn farthest(&self) -> f64 {
        self.farthest
    }

    /// Where the handle at this squared distance from the origin is, if the benches from it on, `behind` of them, are in the
    /// table; `guess` is where it was.
    pub(super) fn locate(&self, squared: f64, behind: usize, guess: Option<Located>) -> Option<Located> {
        let is_in =
            |cell: usize| self.begins[cell] <= squared && self.begins.get(cell + 1).is_some_and(|end| squared < *end);
        let guess = guess.map_or(0, |guess| guess.link * PHASES + guess.phase);
        let cell = if is_in(guess) {
            guess
        } else if guess > 0 && is_in(guess - 1) {
            guess - 1
        } else {
            self.begins.partition_point(|begin| *begin <= squared).checked_sub(1)?
        };
        let (link, phase) = (cell / PHASES, cell % PHASES);
        (link + behind <= self.benches).then_some(Located { link, phase })
    }

    /// What is known of the head at this squared distance from the origin, its rear handle being `located`.
    pub(super) fn of_head(&self, squared: f64, located: Located) -> &Near {
        let near = self.head.get(located.link * PHASES + located.phase);
        near.filter(|_| squared > self.head_from_squared).unwrap_or(&Near::UNKNOWN)
    }

    /// What is known of the bench so many links behind the handle `located`.
    pub(super) fn of_body(&self, located: Located, behind: usize) -> &Near {
        &self.body[(located.link + behind) * PHASES + located.phase]
    }

    /// The bounds of that many benches, the first one's front handle being `located`.
    pub(super) fn bounds(&self, located: Located, benches: usize) -> &[f32] {
        let first = located.phase * self.benches + located.link;
        &self.bounds[first..first + benches]
    }
}

/// A chain of equal links from a place outward, and a head's board before each of the first handles.
#[derive(Clone)]
struct Stand {
    radii: Vec<f64>,
    boards: Vec<Board>,
    heads: Vec<Option<HeadBoard>>,
}

#[derive(Clone, Copy)]
struct HeadBoard {
    board: Board,
    /// The front handle's distance from the origin, and its angle from the rear one.
    radius: f64,
    increment: f64,
}

impl Stand {
    /// One bench more than `benches`: after the last phase a bench is where the next one was.
    fn new(spiral: &Spiral, team: &Team, benches: usize, heads: usize, innermost: Angle) -> Option<Self> {
        let equal = Team { benches: benches + 1, head_length: team.body_length, ..*team };
        let mut chain = Chain::new(equal.handles());
        Newton::new(*spiral, equal, 1.0, Velocities::Omitted).solve_from(innermost, &mut chain).ok()?;
        let handles = || chain.x.iter().zip(&chain.y).map(|(x, y)| Point::new(*x, *y));
        Some(Self {
            radii: handles().map(|handle| handle.coords.norm()).collect(),
            boards: (0..=benches).map(|bench| super::board(&chain, &equal, bench)).collect(),
            heads: handles().take(heads + 1).map(|rear| HeadBoard::before(spiral, team, rear)).collect(),
        })
    }
}

impl HeadBoard {
    /// The distance from the origin beyond which a head is told by its rear handle.
    ///
    /// The rear handle at R, an increment d outward of the front one at r = R - a d: the square of the link is
    /// (a d)^2 + 4 R r sin^2(d/2), and grows with d by 2 a^2 d + 4 R sin(d/2) (r cos(d/2) - a sin(d/2)). Where r > a and
    /// d <= pi / 2 that is positive, for all smaller d too; and d <= 2 asin(link / 2 r) <= pi / 2 where r >= link / sqrt 2.
    /// So there is one such head. Further in there can be two: past its stall the head goes on while the handle behind it
    /// is pushed out again, to where it was.
    fn least_radius(spiral: &Spiral, team: &Team) -> f64 {
        (team.link(0) * FRAC_1_SQRT_2).max(spiral.growth())
    }

    /// The head whose rear handle is at `rear`; `None` where it is not told by that.
    fn before(spiral: &Spiral, team: &Team, rear: Point) -> Option<Self> {
        let (link, outer) = (team.link(0), rear.coords.norm());
        // The law of cosines the other way round: a handle inward is one at a negative increment.
        let excess = spiral.chord_excess(outer, link);
        let inward = |increment: f64| {
            let (value, slope) = excess(-increment);
            (value, -slope)
        };
        let increment = increasing_root(inward, 0.0, FRAC_PI_2, link / outer);
        let radius = outer - spiral.growth() * increment;
        if radius <= Self::least_radius(spiral, team) || inward(increment).0.abs() > 1e-12 * link * link {
            return None;
        }
        let (sine, cosine) = increment.sin_cos();
        let turned = Point::new(cosine * rear.x + sine * rear.y, cosine * rear.y - sine * rear.x);
        let board = Board::from_handles(turned * (radius / outer), rear, team.hole_inset, team.width);
        Some(Self { board, radius, increment })
    }
}

/// The cells of one phase: from where the handles stand in `before` to where they stand in `after`, a handle of number n
/// in the one being n + `shift` in the other.
struct PhaseStep<'a> {
    spiral: &'a Spiral,
    team: &'a Team,
    /// See [`Cells::farthest`].
    farthest: f64,
    before: &'a Stand,
    after: &'a Stand,
    shift: usize,
}

/// A board on its way through a cell.
///
/// Its movement is told by the polar angle phi of the handle in the cell. An increment d from a handle at r to its
/// follower has, with a = pitch / 2 pi, r' = r + a d and d <= pi / 2,
/// d' = -4 a (r + r') sin^2(d/2) / (2 a^2 d + 4 a r sin^2(d/2) + 2 r r' sin d), from the derivative of the law of cosines.
/// So 0 >= d' >= -(2 a / r) tan(d/2). Summing the logarithmic derivatives of its factors, |d''| <= 6 (a / r) |d'|, at most
/// twist = 12 (a / r)^2 tan(d/2). And 1 + d' has the sign of 2 a^2 d + 4 r' sin(d/2) (r cos(d/2) - a sin(d/2)). That is
/// positive where r is a link or more: then d <= 2 asin(1/2) and d <= link / a <= r / a, so tan(d/2) < r / a.
///
/// A follower turns by theta' (1 + d') where its front handle turns by theta': so of all handles from the one in the cell
/// on, 0 < theta' <= 1, and |theta''| <= n twist for the n-th. The head's front handle has theta' = 1 / (1 + d') and
/// |theta''| <= twist theta'^3, with its own link's d.
///
/// A handle at (r, theta) has the velocity (a, r) theta' along and across its ray, at most (r + a) theta', and an
/// acceleration of at most (r + 2 a) (theta'^2 + |theta''|). Points of the board are fixed linear functions of its two
/// handles, and move by [`Board::reach`] times as much at most.
struct Mover {
    before: Board,
    after: Board,
    reach: f64,
    /// The most that a point's velocity changes by, over the cell: its acceleration times the square of phi's growth.
    bend: f64,
    /// The radius of the circle about the board.
    circle: f64,
    /// The greatest theta'.
    rate: f64,
}

impl PhaseStep<'_> {
    /// The growth of phi while the handle `link` is in its cell.
    fn growth_of_angle(&self, link: usize) -> f64 {
        (self.after.radii[link + self.shift] - self.before.radii[link]) / self.spiral.growth()
    }

    fn twist(&self, radius: f64, half_increment_tangent: f64) -> f64 {
        12.0 * (self.spiral.growth() / radius).powi(2) * half_increment_tangent
    }

    fn mover(&self, cell: usize, boards: (Board, Board), bench: usize, acceleration: f64, rate: f64) -> Mover {
        let reach = Board::reach(self.team.link(bench), self.team.hole_inset, self.team.width);
        let bend = reach * acceleration * self.growth_of_angle(cell).powi(2);
        Mover { before: boards.0, after: boards.1, reach, bend, circle: circle_radius(self.team, bench), rate }
    }

    /// The board behind handle `bench` while handle `cell` is in its cell.
    fn body(&self, cell: usize, bench: usize) -> Mover {
        let (radius, half_link) = (self.before.radii[cell], 0.5 * self.team.link(1));
        // d <= 2 asin(link / 2 r), as the follower is further out.
        let twist = self.twist(radius, half_link / (radius * radius - half_link * half_link).sqrt());
        let outer = self.after.radii[bench + 1 + self.shift] + 2.0 * self.spiral.growth();
        let acceleration = outer * (1.0 + (bench + 1 - cell) as f64 * twist);
        self.mover(cell, (self.before.boards[bench], self.after.boards[bench + self.shift]), 1, acceleration, 1.0)
    }

    /// The head whose rear handle is `cell`.
    fn head(&self, cell: usize) -> Option<Mover> {
        let (before, after) = ((*self.before.heads.get(cell)?)?, (*self.after.heads.get(cell + self.shift)?)?);
        let tangent = (0.5 * before.increment).tan();
        let slowed = 1.0 - 2.0 * self.spiral.growth() / before.radius * tangent;
        if slowed < 0.5 {
            return None;
        }
        let outer = self.after.radii[cell + self.shift] + 2.0 * self.spiral.growth();
        let acceleration = outer * (slowed.powi(-2) + self.twist(before.radius, tangent) * slowed.powi(-3));
        Some(self.mover(cell, (before.board, after.board), 0, acceleration, slowed.recip()))
    }

    /// How near `mover` can be to the benches from `from` on. `candidates_end` is a bench beyond which all are too far out,
    /// for this and every cell further in; it is moved on. What was looked at is added to `work`.
    fn near(&self, mover: &Mover, cell: usize, from: usize, candidates_end: &mut usize, work: &mut usize) -> Near {
        let (link, circle, corner) =
            (self.team.link(1), circle_radius(self.team, 1), self.team.hole_inset.hypot(0.5 * self.team.width));
        // A board's points are within its corner of the segment between the handles, and that is at most so far inward of
        // the front handle as the foot of the origin on it.
        let reached = self.after.radii[cell + 1 + self.shift] + 2.0 * corner + self.farthest;
        let last = self.before.boards.len() - 1;
        while *candidates_end < last
            && self.before.radii[*candidates_end].powi(2) - 0.25 * link * link <= reached * reached
        {
            *candidates_end += 1;
        }
        // Half a link further out is the outermost candidate's front handle, a link further its rear one, and the cell ends
        // some sixteenth of a link further still.
        let outermost = reached + 2.0 * link;
        let handle_travel = (outermost + self.spiral.growth()) * mover.rate * self.growth_of_angle(cell);
        let apart = mover.circle + circle + self.farthest + 2.0 * handle_travel;
        let reach = mover.reach + Board::reach(link, self.team.hole_inset, self.team.width);
        // The handles are on the spiral up to the solver's accuracy and the last digits of their coordinates.
        let rounding = (1e-9 + 64.0 * f64::EPSILON * outermost) * reach;
        let centre = mover.before.centre;
        let (mut pairs, mut most) = (Vec::new(), f64::INFINITY);
        for bench in from..*candidates_end {
            let board = &self.before.boards[bench];
            if (board.centre - centre).norm_squared() <= apart * apart
                && separation_board_board(&mover.before, board) <= self.farthest + reach * handle_travel
            {
                let pair = Pair { front: mover, rear: &self.body(cell, bench) };
                let (bound, at_ends) = pair.bound();
                most = most.min(at_ends);
                pairs.push((bench, bound));
            }
        }
        *work += candidates_end.saturating_sub(from) + WORK_OF_BOUND * pairs.len();
        let can_be_nearest = || pairs.iter().filter(|(_, bound)| *bound <= most).map(|(bench, _)| *bench);
        let first = can_be_nearest().next().unwrap_or(cell);
        let end =
            can_be_nearest().take_while(|bench| *bench < first + MOST_NEAREST).last().map_or(first, |last| last + 1);
        // The benches left out are farther than `farthest`.
        let least = |pairs: &mut dyn Iterator<Item = &(usize, f64)>| {
            let least = pairs.fold(self.farthest, |least, (_, bound)| least.min(*bound));
            ((least - rounding) as f32).next_down()
        };
        Near {
            bound: least(&mut pairs.iter()),
            first: (first - cell) as u32,
            count: (end - first) as u32,
            others: least(&mut pairs.iter().filter(|(bench, _)| !(first..end).contains(bench))),
        }
    }
}

/// Two boards on their ways through a cell.
///
/// Take the moment at which they are nearest and the two points p, q that are nearest then; let f = |p - q| through the
/// whole cell, whose length is 1. At both ends f is at least v, the lesser clearance there. With travel >= |p' - q'| and
/// bend >= |p'' - q''|, f'' <= bend + travel^2 / f; f is nowhere below its value at that moment, which is at least
/// v - travel / 2 =: least. A function with f'' <= c falls at most c / 8 below the lesser of its values at the ends. So
/// the clearance is nowhere below v - (bend + travel^2 / least) / 8.
///
/// Let M be the movement of the rear board through the cell. p' - q' has the mean (p1 - M p0) + (M p0 - M q0 - (p0 - q0)).
/// The first part is greatest at a corner of the front board; the second is the chord of M's turn times |p0 - q0|,
/// which is v + travel at most unless there is nothing to prove. And p' - q' is off its mean by half the bend at most.
struct Pair<'a> {
    front: &'a Mover,
    rear: &'a Mover,
}

impl Pair<'_> {
    /// The clearance is not below the first number. The second is the greater of those at the ends, from which nothing
    /// follows but whom to expect as the nearest.
    fn bound(&self) -> (f64, f64) {
        let Self { front, rear } = self;
        let ends = [(&front.before, &rear.before), (&front.after, &rear.after)];
        let [begin, end] = ends.map(|(front, rear)| signed_distance_board_board(front, rear));
        let (least, most) = (begin.min(end), begin.max(end));
        let [before, after] = ends.map(|(front, rear)| {
            front.corners().map(|corner| {
                let offset = corner - rear.centre;
                (offset.dot(&rear.axis), offset.dot(&rear.across()))
            })
        });
        let moved_squared =
            before.iter().zip(&after).map(|(p, q)| (p.0 - q.0).powi(2) + (p.1 - q.1).powi(2)).fold(0.0, f64::max);
        let turn = (rear.after.axis - rear.before.axis).norm();
        let bend = front.bend + rear.bend;
        let travel = (moved_squared.sqrt() + turn * least.max(0.0) + 0.5 * bend) / (1.0 - turn);
        let nearest = least - 0.5 * travel;
        if turn < 0.5 && nearest > 0.0 {
            (least - 0.125 * (bend + travel * travel / nearest), most)
        } else {
            (f64::NEG_INFINITY, most)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clearance::board;
    use proptest::prelude::*;

    /// Judges every bound that the table has for a chain with the head at `travelled`; `None` where it has none. Returns by
    /// how much the least bound is below the least clearance.
    fn judge(cells: &Cells, spiral: &Spiral, team: &Team, travelled: f64) -> Option<f64> {
        let mut chain = Chain::new(team.handles());
        let newton = Newton::new(*spiral, *team, 1.0, Velocities::Omitted);
        newton.solve_from(spiral.place_at(travelled), &mut chain).ok()?;
        let located = cells.locate(chain.x[1].powi(2) + chain.y[1].powi(2), team.benches - 1, None)?;
        let boards: Vec<Board> = (0..team.benches).map(|bench| board(&chain, team, bench)).collect();
        let (mut least_bound, mut least) = (f64::INFINITY, f64::INFINITY);
        for a in 0..team.benches - 2 {
            let (near, front) = if a == 0 {
                (cells.of_head(chain.x[0].powi(2) + chain.y[0].powi(2), located), 1)
            } else {
                (cells.of_body(located, a - 1), a)
            };
            assert!(a == 0 || cells.bounds(located, a)[a - 1] == near.bound);
            least_bound = least_bound.min(f64::from(near.bound));
            for b in a + 2..team.benches {
                let clearance = signed_distance_board_board(&boards[a], &boards[b]);
                least = least.min(clearance);
                let bound = if near.benches(front).contains(&b) { near.bound } else { near.others };
                assert!(
                    f64::from(bound) <= clearance,
                    "{a} and {b} at {travelled} m: {clearance}, {near:?}, {spiral:?}, {team:?}"
                );
            }
        }
        Some(least - least_bound)
    }

    #[test]
    fn bounds_of_the_paper_scene_are_close() {
        let team = Team { benches: 223, head_length: 3.41, body_length: 2.2, width: 0.3, hole_inset: 0.275 };
        let spiral = Spiral::new(0.55, 16.0);
        let cells = Cells::new(&spiral, &team).unwrap();
        for k in 0..390 {
            let slack = judge(&cells, &spiral, &team, 1.001 * f64::from(k)).unwrap();
            assert!(slack < 0.01, "{slack} m after {k} m");
        }
    }

    #[test]
    fn there_is_a_table_only_where_it_is_of_use() {
        let team = Team { benches: 223, head_length: 3.41, body_length: 2.2, width: 0.3, hole_inset: 0.275 };
        let table = |turns: f64, team: Team| Cells::new(&Spiral::new(0.55, turns), &team);
        assert!(table(16.0, Team { benches: 2, ..team }).is_none(), "no pair counts");
        assert!(table(16.0, Team { width: 0.55, ..team }).is_none(), "boards on two turns always overlap");
        assert!(table(1e6, team).is_none() && table(16.0, Team { benches: 20_000, ..team }).is_none(), "too long");
        let crowded = Team { benches: 15_000, body_length: 1.0, hole_inset: 0.475, ..team };
        assert!(Cells::new(&Spiral::new(0.31, 16.0), &crowded).is_none(), "hundreds of boards about every one");
        let (cells, short) = (table(16.0, team).unwrap(), table(16.0, Team { benches: 20, ..team }).unwrap());
        assert!(cells.locate(1.0, 222, None).is_none() && cells.locate(f64::NAN, 222, None).is_none());
        assert!(cells.locate(64.0, 222, None).is_some());
        assert!(short.locate(64.0, 222, None).is_none(), "a longer team than the table is for");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]

        #[test]
        fn no_boards_are_nearer_than_the_bounds(
            benches in 3..90usize, pitch in 0.05..3.0f64, turns in 2.0..25.0f64, width in 0.01..0.99f64,
            inset in 0.0..0.6f64, head in 0.3..5.0f64, body in 0.3..3.0f64,
            places in prop::collection::vec(0.0..1.0f64, 12),
        ) {
            let (head_length, body_length) = (head + 2.0 * inset, body + 2.0 * inset);
            let team = Team { benches, head_length, body_length, width: width * pitch, hole_inset: inset };
            let spiral = Spiral::new(pitch, turns);
            if let Some(cells) = Cells::new(&spiral, &team) {
                for place in places {
                    judge(&cells, &spiral, &team, place * spiral.length());
                }
            }
        }
    }
}
