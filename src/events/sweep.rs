//! First contact and least clearance of a motion along any path, found by steps that are certain to hold none better.
//!
//! **Why nothing is skipped.** Between two places of the head each handle goes one way along the path, so the path
//! between the places at which a look finds it is as far as it can have moved; no point of a board moves further than
//! [`Board::reach`] times what its handles do. A pair whose clearances at both ends of a step sum to more than what its
//! two boards can move together, M, was never nearer than half of what is left over. Where all four handles are on one
//! spiral, they are watched from a frame that turns with one of them: turning changes no clearance, and leaves little
//! motion ([`Path::motion_beside`]). A step that cannot be excluded so
//! is halved, the earlier half first. Past the first stall, where handles may turn round once more, M is doubled.
//!
//! **Which pairs.** Every link behind the first has one length, so a pair (i, i+k), i >= 2, is wherever the pair
//! (i-1, i-1+k) was when the handle before was there. Once the third handle has come to where the second one started,
//! only pairs with the first two boards can be nearest for the first time.

use crate::chain::Team;
use crate::geometry::path::Path;
use crate::geometry::rectangle::Board;
use crate::geometry::root::{first_true, least_between};
use crate::geometry::separation::{
    circle_bound_board_board, closest_points_board_board, overlap_centre, signed_distance_board_board,
};
use crate::messages::State;

use super::contact::near_pairs;
use super::{Event, last_place};

/// The least clearance of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastClearance {
    /// Metres between the two boards; negative where they overlap.
    pub value: f64,
    /// Metres that the head has travelled.
    pub travelled: f64,
    /// The lower bench, counted from 0.
    pub bench_a: u32,
    /// The higher bench.
    pub bench_b: u32,
}

/// A team on a path.
pub struct Sweep<'a, P: Path> {
    path: &'a P,
    team: &'a Team,
    /// Metres of travel at the first stall; infinite where there is none.
    stall: f64,
    /// Metres of travel after which only pairs with the first two boards need be asked.
    all_pairs_until: f64,
}

/// The whole team at one place of the head.
struct Look<P: Path> {
    travelled: f64,
    places: Vec<P::Place>,
    boards: Vec<Board>,
}

/// Two benches that share no handle.
type Pair = (usize, usize);

/// How finely the least clearance is bracketed before its place is refined, as a share of the shortest link: within
/// that, the clearance of one pair has one minimum.
const LEAF: f64 = 1e-2;

impl<'a, P: Path> Sweep<'a, P> {
    /// The motion of `team` on `path`, whose first stall is at `stall`.
    pub fn new(path: &'a P, team: &'a Team, stall: Option<f64>) -> Self {
        let mut sweep = Self { path, team, stall: stall.unwrap_or(f64::INFINITY), all_pairs_until: f64::INFINITY };
        sweep.all_pairs_until = sweep.third_handle_at_second();
        sweep
    }

    /// The first contact from one place of the head to another. `progress` is told which share of the search is done.
    ///
    /// Boards that overlap at `from` are a contact there: the deepest pair, at the centre of its overlap.
    pub fn first_contact(&self, from: f64, to: f64, progress: &mut dyn FnMut(f64)) -> Option<Event> {
        if self.team.benches < 3 {
            return None;
        }
        let mut before = self.look(from)?;
        if let Some((value, (a, b))) = deepest(&before, &near_pairs(&before.boards, 0.0))
            && value <= 0.0
        {
            let place = overlap_centre(&before.boards[a], &before.boards[b]);
            return Some(contact(&before, (a, b), place));
        }
        let to = self.last_place(from, to);
        for next in self.steps(from, to) {
            progress((next - from) / (to - from));
            let after = self.look(next)?;
            let pairs = self.pairs(&before, &after, 0.0);
            if let Some(event) = self.contact_within(&before, &after, pairs) {
                return Some(event);
            }
            before = after;
        }
        None
    }

    /// The least clearance from one place of the head to another; `None` under three benches. `progress` is told which
    /// share of the search is done.
    pub fn least_clearance(&self, from: f64, to: f64, progress: &mut dyn FnMut(f64)) -> Option<LeastClearance> {
        if self.team.benches < 3 {
            return None;
        }
        let to = self.last_place(from, to);
        let mut least = LeastClearance { value: f64::INFINITY, travelled: from, bench_a: 0, bench_b: 0 };
        // First a fair guess, then the proof that nothing is below it, or what is.
        for at in std::iter::once(from).chain(self.steps(from, to)) {
            progress(0.5 * (at - from) / (to - from));
            let Some(look) = self.look(at) else { break };
            let near = near_pairs(&look.boards, least.value.min(self.widest()));
            self.offer(&look, &near, &mut least);
        }
        let mut before = self.look(from)?;
        for next in self.steps(from, to) {
            progress(0.5 + 0.5 * (next - from) / (to - from));
            let Some(after) = self.look(next) else { break };
            let pairs = self.pairs(&before, &after, least.value);
            self.least_within(&before, &after, pairs, &mut least);
            before = after;
        }
        least.value.is_finite().then_some(least)
    }

    /// The clearance of one pair, and where the head is, at its least within a bracket that holds one minimum.
    pub fn minimum_of(&self, pair: (u32, u32), from: f64, to: f64) -> (f64, f64) {
        let pair = (pair.0 as usize, pair.1 as usize);
        let clearance = |at: f64| {
            let look = self.look_at_most(at, pair.1 + 1);
            look.map_or(f64::INFINITY, |look| clearance(&look, pair))
        };
        least_between(clearance, from, to)
    }

    /// How many places of the head a search begins with.
    pub fn looks(&self, from: f64, to: f64) -> f64 {
        ((to - from) / self.step()).ceil().max(0.0)
    }

    fn step(&self) -> f64 {
        0.25 * self.team.link(0).min(self.team.link(1))
    }

    /// The places of the head at which a search looks, after the first: none further than a quarter of a link from the
    /// next, and one at the stall.
    fn steps(&self, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let step = self.step();
        let count = self.looks(from, to) as usize;
        let stall = self.stall;
        let regular = (1..=count).map(move |k| (from + k as f64 * step).min(to));
        let mut before = from;
        regular.flat_map(move |at| {
            let passed = (stall > before && stall < at).then_some(stall);
            before = at;
            passed.into_iter().chain([at])
        })
    }

    /// Metres of travel after which the third handle is where the second one started; infinite where it never is
    /// before the first stall.
    fn third_handle_at_second(&self) -> f64 {
        let handle = |travelled: f64, last: usize| {
            let head = self.path.place_at(travelled);
            (0..last).try_fold(head, |front, bench| self.path.follower(front, self.team.link(bench))).ok()
        };
        let Some(start) = handle(0.0, 1) else { return f64::INFINITY };
        let arrived =
            |travelled: f64| handle(travelled, 2).is_some_and(|third| self.path.distance_between(start, third) >= 0.0);
        let latest = self.stall.min(self.path.length());
        if arrived(latest) { first_true(arrived, 0.0, latest) } else { f64::INFINITY }
    }

    fn widest(&self) -> f64 {
        2.0 * self.team.link(0).max(self.team.link(1)) + self.team.width
    }

    fn look(&self, travelled: f64) -> Option<Look<P>> {
        self.look_at_most(travelled, self.team.benches)
    }

    fn last_place(&self, from: f64, to: f64) -> f64 {
        last_place(|travelled| self.look(travelled).is_some(), from, to)
    }

    /// The foremost `benches` boards.
    fn look_at_most(&self, travelled: f64, benches: usize) -> Option<Look<P>> {
        let Team { hole_inset, width, .. } = *self.team;
        let mut front = self.path.place_at(travelled);
        let mut look = Look { travelled, places: Vec::with_capacity(benches + 1), boards: Vec::with_capacity(benches) };
        look.places.push(front);
        for bench in 0..benches {
            let link = self.team.link(bench);
            let rear = self.path.follower(front, link).ok()?;
            let direction = self.path.bench(front, rear, link).direction;
            look.boards.push(Board::from_front(self.path.point(front), direction, link, hole_inset, width));
            look.places.push(rear);
            front = rear;
        }
        Some(look)
    }

    /// How far any point of a board can have moved between two looks.
    fn moved(&self, before: &Look<P>, after: &Look<P>, bench: usize) -> f64 {
        let handle = |k: usize| self.path.distance_between(before.places[k], after.places[k]).abs();
        self.reach(before, bench) * handle(bench).max(handle(bench + 1))
    }

    fn reach(&self, before: &Look<P>, bench: usize) -> f64 {
        let Team { hole_inset, width, .. } = *self.team;
        let slack = if before.travelled < self.stall { 1.0 } else { 2.0 };
        slack * Board::reach(self.team.link(bench), hole_inset, width)
    }

    /// How much nearer to each other two boards can have come between two looks: what both have moved, or what they
    /// have moved as seen from a frame that turns with the first one's front handle.
    fn approached(&self, before: &Look<P>, after: &Look<P>, (a, b): Pair) -> f64 {
        let on_stage = self.moved(before, after, a) + self.moved(before, after, b);
        let companion = (before.places[a], after.places[a]);
        let handle = |k: usize| self.path.motion_beside(before.places[k], after.places[k], companion);
        let board = |bench: usize| Some(self.reach(before, bench) * handle(bench)?.max(handle(bench + 1)?));
        let turning = board(a).zip(board(b)).map_or(f64::INFINITY, |(a, b)| a + b);
        on_stage.min(turning)
    }

    /// The pairs that may be nearer than `limit` somewhere between two looks.
    fn pairs(&self, before: &Look<P>, after: &Look<P>, limit: f64) -> Vec<Pair> {
        let mut pairs: Vec<Pair> = if before.travelled < self.all_pairs_until {
            let most = (0..before.boards.len()).map(|bench| self.moved(before, after, bench)).fold(0.0, f64::max);
            near_pairs(&before.boards, 2.0 * most + limit.max(0.0))
        } else {
            let count = before.boards.len();
            (0..2).flat_map(|a| (a + 2..count).map(move |b| (a, b))).collect()
        };
        self.retain_uncertain(before, after, limit, &mut pairs);
        pairs
    }

    /// Keeps the pairs that may be at or below `limit` somewhere between two looks.
    fn retain_uncertain(&self, before: &Look<P>, after: &Look<P>, limit: f64, pairs: &mut Vec<Pair>) {
        pairs.retain(|&(a, b)| {
            let motion = self.approached(before, after, (a, b));
            let circles = |look: &Look<P>| circle_bound_board_board(&look.boards[a], &look.boards[b]);
            if circles(before) + circles(after) > 2.0 * limit + motion {
                return false;
            }
            clearance(before, (a, b)) + clearance(after, (a, b)) <= 2.0 * limit + motion
        });
    }

    /// The first contact of one of `pairs` between two looks, by halving.
    fn contact_within(&self, before: &Look<P>, after: &Look<P>, pairs: Vec<Pair>) -> Option<Event> {
        let last = pairs.iter().map(|&(_, b)| b + 1).max()?;
        let middle = 0.5 * (before.travelled + after.travelled);
        if middle <= before.travelled || middle >= after.travelled {
            let (value, (a, b)) = deepest(after, &pairs)?;
            let (on_a, on_b) = closest_points_board_board(&after.boards[a], &after.boards[b]);
            return (value <= 0.0).then(|| contact(after, (a, b), nalgebra::center(&on_a, &on_b)));
        }
        let middle = self.look_at_most(middle, last)?;
        [(before, &middle), (&middle, after)].into_iter().find_map(|(one, other)| {
            let mut uncertain = pairs.clone();
            self.retain_uncertain(one, other, 0.0, &mut uncertain);
            self.contact_within(one, other, uncertain)
        })
    }

    /// Whether two looks are so near that a pair's clearance has one minimum between them.
    fn is_leaf(&self, before: &Look<P>, after: &Look<P>) -> bool {
        after.travelled - before.travelled <= LEAF * self.team.link(0).min(self.team.link(1))
    }

    fn nearest_between(&self, (a, b): Pair, before: &Look<P>, after: &Look<P>) -> LeastClearance {
        let (bench_a, bench_b) = (a as u32, b as u32);
        let (value, travelled) = self.minimum_of((bench_a, bench_b), before.travelled, after.travelled);
        LeastClearance { value, travelled, bench_a, bench_b }
    }

    /// Lowers `least` to what the pairs reach between two looks.
    fn least_within(&self, before: &Look<P>, after: &Look<P>, pairs: Vec<Pair>, least: &mut LeastClearance) {
        let Some(last) = pairs.iter().map(|&(_, b)| b + 1).max() else { return };
        if self.is_leaf(before, after) {
            for pair in pairs {
                let nearest = self.nearest_between(pair, before, after);
                if nearest.value < least.value {
                    *least = nearest;
                }
            }
            return;
        }
        let Some(middle) = self.look_at_most(0.5 * (before.travelled + after.travelled), last) else { return };
        self.offer(&middle, &pairs, least);
        for (one, other) in [(before, &middle), (&middle, after)] {
            let mut uncertain = pairs.clone();
            self.retain_uncertain(one, other, least.value, &mut uncertain);
            self.least_within(one, other, uncertain, least);
        }
    }

    fn offer(&self, look: &Look<P>, pairs: &[Pair], least: &mut LeastClearance) {
        if let Some((value, (a, b))) = deepest(look, pairs)
            && value < least.value
        {
            *least = LeastClearance { value, travelled: look.travelled, bench_a: a as u32, bench_b: b as u32 };
        }
    }
}

fn clearance<P: Path>(look: &Look<P>, (a, b): Pair) -> f64 {
    signed_distance_board_board(&look.boards[a], &look.boards[b])
}

/// The nearest of `pairs` and its clearance.
fn deepest<P: Path>(look: &Look<P>, pairs: &[Pair]) -> Option<(f64, Pair)> {
    pairs.iter().map(|pair| (clearance(look, *pair), *pair)).min_by(|one, other| one.0.total_cmp(&other.0))
}

fn contact<P: Path>(look: &Look<P>, (a, b): Pair, place: crate::geometry::Point) -> Event {
    Event {
        kind: State::Contact,
        travelled: look.travelled,
        bench_a: Some(a as u32),
        bench_b: Some(b as u32),
        place: Some(place),
    }
}
