//! The first touch of two boards that share no handle, found by steps that are certain to hold none.
//!
//! **Why no touch is skipped.** Watch the stage from a frame that turns about the centre with the front handle of
//! board i; turning changes no clearance. Handle k then moves by at most M_k = a |delta theta_k| + r_k |delta theta_k -
//! delta theta_i| while the head goes from one place to another: outward and around. The ends of the step tell both:
//! between stalls each handle only goes one way, and its angle behind handle i only ever grows, since on a spiral
//! d theta_{i+1}/d theta_i = (t_i . b_i) w_i / ((t_{i+1} . b_i) w_{i+1}) < 1 (w = sqrt(a^2 + r^2); the difference of the
//! two products is 2 a (r + r') sin^2(d/2) / link > 0). No point of board j then moves further than C_j =
//! reach_j * max(M_j, M_{j+1}), reach being [`Board::reach`]. If the clearances of a pair at the two ends of the step
//! sum to more than C_i + C_j, it was positive all along: when the boards have used up x of that motion it is at least
//! max(c_start - x, c_end - (C_i + C_j - x)) > 0. A step that cannot be proved so is halved, the earlier half first,
//! down to the last digits of the distance. Steps end at the first stall; past it, where handles may turn round
//! once more, the bound is doubled.
//!
//! **Which pairs.** Every link behind the first has one length, so the place of handle i >= 1 decides where all behind
//! it are, and a pair (i, i+k), i >= 2, is wherever the pair (1, 1+k) was when the second handle was there. So once
//! the third handle has come to where the second one started, only pairs with the first two boards can touch for the
//! first time; before that, all can.
//!
//! **How far out.** Two boards on neighbouring turns keep clear while pitch exceeds the width and what chords and ends
//! stick out of the curve; that bound shrinks with the radius, so the search begins where it first fails.

use crate::chain::Team;
use crate::geometry::path::Path;
use crate::geometry::rectangle::Board;
use crate::geometry::root::first_true;
use crate::geometry::separation::{circle_bound_board_board, clearance_board_board, overlap_centre};
use crate::geometry::spiral::{Angle, Spiral};
use crate::messages::State;

use super::{Event, last_place};

/// The first contact at or before `limit` metres of travel, `stall` being where a link first stalls.
///
/// `progress` is told now and then which share of the search is done, from 0 to 1.
///
/// Boards that overlap at the start are a contact at 0: the deepest pair, at the centre of its overlap.
pub fn first_contact(
    spiral: &Spiral,
    team: &Team,
    stall: Option<f64>,
    limit: f64,
    progress: &mut dyn FnMut(f64),
) -> Option<Event> {
    if team.benches < 3 {
        return None;
    }
    let mut search = Search { spiral, team, stall: stall.unwrap_or(limit), loud_radius: f64::INFINITY };
    // No team reaches further out than if it were stretched along a radius.
    let reach = team.link(0) + team.link(1) * (team.benches - 1) as f64;
    search.loud_radius = search.loud_radius(spiral.radius(spiral.start()) + reach);
    let start = search.quiet_until(limit);
    if start == 0.0
        && let Some(event) = search.overlap_at_start()
    {
        return Some(event);
    }
    let all_until = if start > 0.0 { start } else { search.third_handle_at_second(limit) };
    let phases = [(start, all_until, Pairs::All), (all_until, limit, Pairs::WithFirstTwo)];
    phases.into_iter().find_map(|(from, to, pairs)| search.between(from, to, pairs, progress))
}

/// Which pairs can touch for the first time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pairs {
    All,
    WithFirstTwo,
}

struct Search<'a> {
    spiral: &'a Spiral,
    team: &'a Team,
    stall: f64,
    /// No two boards whose handles lie beyond this can touch.
    loud_radius: f64,
}

/// The foremost part of the team at one place of the head: every board that can touch one of those asked for.
struct Look {
    travelled: f64,
    places: Vec<Angle>,
    boards: Vec<Board>,
}

impl Search<'_> {
    /// Metres of travel before which no two boards can touch; 0 where that cannot be said of the start.
    fn quiet_until(&self, limit: f64) -> f64 {
        let noisy = |travelled: f64| !self.is_quiet(self.spiral.radius(self.spiral.place_at(travelled)));
        if noisy(0.0) {
            0.0
        } else if !noisy(limit) {
            limit
        } else {
            first_true(noisy, 0.0, limit).next_down()
        }
    }

    /// Whether no two boards can touch while the head is at radius `r` or further out: a bound that holds for every
    /// larger radius if it holds for one.
    fn is_quiet(&self, r: f64) -> bool {
        // Each arc is at most a twentieth longer than its chord.
        let length = 1.05 * (self.team.link(0) + self.team.link(1) * (self.team.benches - 1) as f64);
        let theta = r / self.spiral.growth();
        let last = (theta * theta + 2.0 * length / self.spiral.growth()).sqrt();
        let within_a_turn = last - theta < std::f64::consts::PI;
        let bulge = self.bulge(r);
        self.keeps_apart_along(r, bulge) && (within_a_turn || self.keeps_apart_across(bulge))
    }

    /// How far boards on a turn of radius `r` stick out of the curve, inward and outward together.
    ///
    /// A chord of length l on a curve of curvature 1/r lies within l^2/8r of it, and a board's end, its inset e beyond
    /// the handle, within e (l + e)/2r; a quarter is added for the spiral's own curvature. Only for radii of at least
    /// five boards; infinite within.
    fn bulge(&self, r: f64) -> f64 {
        let Team { hole_inset, width, .. } = *self.team;
        let longest = self.team.link(0).max(self.team.link(1));
        if r < 5.0 * (longest + hole_inset + width).max(self.spiral.pitch()) {
            return f64::INFINITY;
        }
        1.25 * (longest * longest / 8.0 + hole_inset * (longest + hole_inset)) / r
    }

    /// Whether two boards on one turn have room between them: a whole bench, less two insets and the lean of their ends.
    fn keeps_apart_along(&self, r: f64, bulge: f64) -> bool {
        let Team { hole_inset, width, .. } = *self.team;
        let longest = self.team.link(0).max(self.team.link(1));
        let lean = 2.0 * (width + bulge) * (longest + hole_inset) / r;
        self.team.link(1) - 2.0 * hole_inset - lean > 1e-3 * longest
    }

    /// Whether two boards on neighbouring turns have room between them: the pitch, less the width, which leans by at
    /// most a tenth, and what sticks out.
    fn keeps_apart_across(&self, bulge: f64) -> bool {
        self.spiral.pitch() - 1.01 * self.team.width - bulge > 0.0
    }

    /// The radius beyond which no two boards can ever touch; infinite where the turns are too narrow for the boards.
    fn loud_radius(&self, tail: f64) -> f64 {
        let clear = |r: f64| {
            let bulge = self.bulge(r);
            self.keeps_apart_along(r, bulge) && self.keeps_apart_across(bulge)
        };
        if clear(tail) { first_true(clear, 0.0, tail) } else { f64::INFINITY }
    }

    /// Metres of travel after which the third handle is where the second one started; at most `limit`.
    fn third_handle_at_second(&self, limit: f64) -> f64 {
        let second = |travelled: f64| {
            self.spiral.follower(self.spiral.place_at(travelled), self.team.link(0)).map_or(0.0, Angle::radians)
        };
        let third = |travelled: f64| {
            let front = self.spiral.follower(self.spiral.place_at(travelled), self.team.link(0)).ok()?;
            Some(self.spiral.follower(front, self.team.link(1)).ok()?.radians())
        };
        let start = second(0.0);
        let arrived = |travelled: f64| third(travelled).is_some_and(|theta| theta <= start);
        let latest = self.stall.min(limit);
        if arrived(latest) { first_true(arrived, 0.0, latest) } else { limit }
    }

    fn overlap_at_start(&self) -> Option<Event> {
        let look = self.look(0.0, Pairs::All)?;
        let deepest = self
            .candidates(&look, Pairs::All)
            .into_iter()
            .map(|(a, b)| (clearance_board_board(&look.boards[a], &look.boards[b]).value, a, b))
            .min_by(|one, other| one.0.total_cmp(&other.0))
            .filter(|(clearance, ..)| *clearance <= 0.0)?;
        let (_, a, b) = deepest;
        Some(Event {
            kind: State::Contact,
            travelled: 0.0,
            bench_a: Some(a as u32),
            bench_b: Some(b as u32),
            place: Some(overlap_centre(&look.boards[a], &look.boards[b])),
        })
    }

    /// The chain as far back as a board could touch one of those asked for.
    fn look(&self, travelled: f64, pairs: Pairs) -> Option<Look> {
        let mut places = vec![self.spiral.place_at(travelled)];
        let mut boards = Vec::new();
        let mut least_needed = match pairs {
            Pairs::WithFirstTwo => f64::INFINITY,
            Pairs::All => self.out_of_reach(self.loud_radius),
        };
        for bench in 0..self.team.benches {
            let (front, link) = (places[bench], self.team.link(bench));
            if bench > 2 && self.spiral.radius(front) > least_needed {
                break;
            }
            let rear = self.spiral.follower(front, link).ok()?;
            let direction = self.spiral.bench(front, rear, link).direction;
            let Team { hole_inset, width, .. } = *self.team;
            boards.push(Board::from_front(self.spiral.point(front), direction, link, hole_inset, width));
            places.push(rear);
            if bench == 1 && pairs == Pairs::WithFirstTwo {
                least_needed = self.out_of_reach(self.spiral.radius(rear));
            }
        }
        Some(Look { travelled, places, boards })
    }

    /// The radius beyond which no front handle's board can touch a board whose handles lie within `outermost`.
    ///
    /// That board lies within outermost + inset + width/2. A board whose handles lie beyond r has its axis beyond
    /// sqrt(r^2 - (link/2)^2) - inset and all of it within half a width of the axis.
    fn out_of_reach(&self, outermost: f64) -> f64 {
        let Team { hole_inset, width, .. } = *self.team;
        let half = 0.5 * self.team.link(0).max(self.team.link(1));
        // Room for the motion within a step: half a link.
        (outermost + 2.0 * hole_inset + width + half).hypot(half)
    }

    /// What the choice of candidates leaves each handle to move within a step.
    fn room(&self) -> f64 {
        0.25 * self.team.link(0).min(self.team.link(1))
    }

    /// The pairs of this look that share no handle and whose boards could be near each other.
    fn candidates(&self, look: &Look, pairs: Pairs) -> Vec<(usize, usize)> {
        let count = look.boards.len();
        match pairs {
            Pairs::WithFirstTwo => (0..2).flat_map(|a| (a + 2..count).map(move |b| (a, b))).collect(),
            Pairs::All => {
                let Team { hole_inset, width, .. } = *self.team;
                let shortest = self.team.link(0).min(self.team.link(1));
                // Both boards of a pair move, each by what its handles make of their room.
                near_pairs(&look.boards, 2.0 * Board::reach(shortest, hole_inset, width) * self.room())
            }
        }
    }

    /// The first contact between two places of the head.
    fn between(&self, from: f64, to: f64, pairs: Pairs, progress: &mut dyn FnMut(f64)) -> Option<Event> {
        let mut step = 0.1 * self.team.link(0).min(self.team.link(1));
        let room = self.room();
        let to = last_place(|travelled| self.look(travelled, pairs).is_some(), from, to);
        let mut before = (from < to).then(|| self.look(from, pairs)).flatten()?;
        while before.travelled < to {
            progress(before.travelled / to);
            let mut next = (before.travelled + step).min(to);
            if before.travelled < self.stall {
                next = next.min(self.stall);
            }
            let after = self.look(next, pairs)?;
            if step > 1e-9 * room && self.widest_motion(&before, &after, pairs) > room {
                step *= 0.5;
                continue;
            }
            let mut candidates = self.candidates(&before, pairs);
            self.retain_uncertain(&before, &after, &mut candidates);
            if candidates.is_empty() {
                step *= 1.5;
            } else {
                if let Some(event) = self.within(&before, &after, candidates) {
                    return Some(event);
                }
                step *= 0.6;
            }
            before = after;
        }
        None
    }

    /// How far any handle goes between two looks, in the direction in which candidates were chosen: from the centre
    /// where their radii decided, anywhere where their places did.
    fn widest_motion(&self, before: &Look, after: &Look, pairs: Pairs) -> f64 {
        let per_radian = |handle: usize| match pairs {
            Pairs::WithFirstTwo => self.spiral.growth(),
            Pairs::All => self.spiral.radius(before.places[handle]) + self.spiral.growth(),
        };
        let count = before.places.len().min(after.places.len());
        (0..count).map(|handle| per_radian(handle) * turned(before, after, handle).abs()).fold(0.0, f64::max)
    }

    /// How much closer boards a and b can get than they are, between two looks: C_a + C_b of the argument above.
    fn relative_motion(&self, before: &Look, after: &Look, a: usize, b: usize) -> f64 {
        let Team { hole_inset, width, .. } = *self.team;
        let reference = turned(before, after, a);
        let moved = |handle: usize| {
            let own = turned(before, after, handle);
            let radius = self.spiral.radius(before.places[handle]).max(self.spiral.radius(after.places[handle]));
            self.spiral.growth() * own.abs() + radius * (own - reference).abs()
        };
        let board =
            |bench: usize| Board::reach(self.team.link(bench), hole_inset, width) * moved(bench).max(moved(bench + 1));
        let slack = if before.travelled < self.stall { 1.0 } else { 2.0 };
        slack * (board(a) + board(b))
    }

    /// Keeps of `pairs` those that are not certain to stay apart between two looks.
    fn retain_uncertain(&self, before: &Look, after: &Look, pairs: &mut Vec<(usize, usize)>) {
        let count = before.boards.len().min(after.boards.len());
        pairs.retain(|&(a, b)| {
            if b >= count {
                // One look ends before this board: it was out of reach there, with more room than a step takes.
                return false;
            }
            let apart = |look: &Look| circle_bound_board_board(&look.boards[a], &look.boards[b]);
            let nearest = apart(before) + apart(after);
            if nearest > 0.0 && nearest > self.relative_motion(before, after, a, b) {
                return false;
            }
            let clearance = |look: &Look| clearance_board_board(&look.boards[a], &look.boards[b]).value;
            clearance(before) + clearance(after) <= self.relative_motion(before, after, a, b)
        });
    }

    /// The first contact of one of `pairs` between two looks, by halving.
    fn within(&self, before: &Look, after: &Look, pairs: Vec<(usize, usize)>) -> Option<Event> {
        let middle = 0.5 * (before.travelled + after.travelled);
        if middle <= before.travelled || middle >= after.travelled {
            return touching(after, &pairs);
        }
        let boards = pairs.iter().map(|&(_, b)| b + 1).max()?;
        let middle = self.look_at_most(middle, boards)?;
        for (one, other) in [(before, &middle), (&middle, after)] {
            let mut uncertain = pairs.clone();
            self.retain_uncertain(one, other, &mut uncertain);
            if !uncertain.is_empty()
                && let Some(event) = self.within(one, other, uncertain)
            {
                return Some(event);
            }
        }
        None
    }

    /// The foremost `boards` boards and no more.
    fn look_at_most(&self, travelled: f64, boards: usize) -> Option<Look> {
        let foremost = Team { benches: boards, ..*self.team };
        Search { team: &foremost, ..*self }.look(travelled, Pairs::All)
    }
}

/// Radians by which a handle turned between two looks.
fn turned(before: &Look, after: &Look, handle: usize) -> f64 {
    before.places[handle].minus(after.places[handle])
}

/// The contact of the deepest of `pairs`, if one touches or overlaps.
fn touching(look: &Look, pairs: &[(usize, usize)]) -> Option<Event> {
    let (a, b, clearance) = pairs
        .iter()
        .map(|&(a, b)| (a, b, clearance_board_board(&look.boards[a], &look.boards[b])))
        .min_by(|one, other| one.2.value.total_cmp(&other.2.value))
        .filter(|(_, _, clearance)| clearance.value <= 0.0)?;
    Some(Event {
        kind: State::Contact,
        travelled: look.travelled,
        bench_a: Some(a as u32),
        bench_b: Some(b as u32),
        place: Some(nalgebra::center(&clearance.point_a, &clearance.point_b)),
    })
}

/// All pairs that share no handle and are not certain to stay apart while both together move by at most `motion`.
///
/// Found with a grid whose cells are no narrower than the longest board and that motion.
pub(super) fn near_pairs(boards: &[Board], motion: f64) -> Vec<(usize, usize)> {
    let widest = boards.iter().map(|board| 2.0 * board.circle_radius()).fold(0.0, f64::max);
    let cell = widest + motion;
    let key = |board: &Board| ((board.centre.x / cell).floor() as i64, (board.centre.y / cell).floor() as i64);
    let mut cells: Vec<((i64, i64), usize)> = boards.iter().map(key).zip(0..).collect();
    cells.sort_unstable();
    let row_of = |wanted: (i64, i64)| {
        // Three neighbouring cells of a column lie side by side in the sorted list.
        let from = cells.partition_point(|(key, _)| *key < (wanted.0, wanted.1 - 1));
        cells[from..].iter().take_while(move |(key, _)| *key <= (wanted.0, wanted.1 + 1)).map(|(_, bench)| *bench)
    };
    let mut pairs = Vec::new();
    for (a, board) in boards.iter().enumerate() {
        let (column, row) = key(board);
        for neighbour in column - 1..=column + 1 {
            let others = row_of((neighbour, row)).filter(|b| *b >= a + 2);
            pairs.extend(others.filter(|b| circle_bound_board_board(board, &boards[*b]) <= motion).map(|b| (a, b)));
        }
    }
    pairs
}
