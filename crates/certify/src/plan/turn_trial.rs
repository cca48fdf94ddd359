//! Events of a team on turnarounds of one pitch and arc ratio, found by the ordinary search, which samples. They
//! suggest to the proofs of [`crate::turn`] where to search.

use std::ops::ControlFlow;

use crate::grid::{param, place};
use crate::place::Place;
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::contact::ConservativeAdvancement;
use bench_dragon_motion::event::{Budget, Event};
use bench_dragon_motion::linkage::follower;
use bench_dragon_motion::model::curve::Coordinate;
use bench_dragon_motion::model::path::{Param, Path};
use bench_dragon_motion::model::root::{bisect_predicate, golden_section_min};
use bench_dragon_motion::model::team::Team;
use bench_dragon_motion::singularities::Singularities;
use bench_dragon_show::scene::Accepted;

/// The number of turns outside the turn or the longest link at which a trial of the links starts. The trial ends a
/// number of lengths of the longest link after the turn.
const TURNS_BEFORE: f64 = 2.0;
const LINKS_AFTER: f64 = 6.0;

/// The number of turns outside the turn at which a trial of the boards starts.
const BOARDS_BEFORE: f64 = 3.0;

/// Work for one trial, in units of [`Budget`]: some seconds.
const TRIAL_BUDGET: u64 = 20_000_000;

/// The coordinate of a pivot just behind a junction, in radians.
const BESIDE_JUNCTION: f64 = 1e-13;

/// Work between two calls of a search for folds, for a pivot, and for each bench between two calls of a search for
/// boards, in microseconds.
const FOLD_WORK: u64 = 1_000;
const PIVOT_WORK: u64 = 3_000;
const BOARD_WORK: u64 = 2;

/// The distances from an event, in links, within which a pivot is searched for. For each distance, a number of offsets
/// is tried. A pivot keeps a share of a fold's depth off the ends of the S.
const REACHES: [f64; 4] = [0.5, 0.1, 0.01, 1e-3];
const OFFSETS: i32 = 48;
const ASIDE: f64 = 0.05;

/// The steps between two handles in which the distance is followed.
const STEPS: u32 = 64;

/// The distance from the last contact, in links, within which the same two boards are followed.
const WINDOW: f64 = 0.3;

/// The difference of two radii from which the rate of the deepest place is taken, in metres.
const RATE_STEP: f64 = 1e-6;

/// The greatest multiple of a fold's depth by which the end of the fold's stretch is beyond the other handle. The
/// multiple is halved in a number of trials. A share of the depth must remain at the end.
const BEYOND: f64 = 2.0;
const BEYOND_TRIALS: i32 = 8;
const REMAINS: f64 = 0.5;

/// The greatest depth of a fold, in multiples of the metres by which its end is further than the link.
const ROOM: f64 = 4.0;

/// The turnarounds of a team with one pitch and one ratio of the arcs.
#[derive(Clone, Copy)]
pub(super) struct Family<'a> {
    pub team: &'a Team,
    /// The required clearance of boards, in metres.
    pub clearance: f64,
    pub pitch: f64,
    pub arc_ratio: f64,
    /// Asks whether the search is to stop. Then events may be missing.
    /// In: the work since the last call, about microseconds.
    pub ask: &'a dyn Fn(u64) -> ControlFlow<()>,
}

/// An event, as a proof needs it. On a spiral, the coordinate of its places is the polar angle minus the polar angle at
/// the S. Such a place moves little as the radius grows.
#[derive(Debug, Clone, Copy)]
pub(super) enum Witness {
    /// One handle of a link at a pivot, the other one before `end` and on the wrong side of the pivot's normal.
    Fold { kind: EventKind, link: usize, pivot: Place, end: Place },
    /// Two boards that overlap or are too near with the head at a place with this radius. The place's coordinate grows
    /// by `rate` per metre of the radius.
    Overlap { pair: (u32, u32), head: Place, radius: f64, rate: f64 },
}

impl Witness {
    /// Returns the place of the pivot or of the head.
    pub fn place(&self) -> Place {
        match *self {
            Self::Fold { pivot, .. } => pivot,
            Self::Overlap { head, .. } => head,
        }
    }
}

impl Family<'_> {
    /// Returns the turnaround with a radius. The head is at distance 0 where the S begins; both spirals are endless.
    pub fn path(&self, radius: f64) -> Option<Path> {
        self.path_between(radius, 0.0, 1e3 * self.team.longest_link())
    }

    fn path_between(&self, radius: f64, lead_in: f64, lead_out: f64) -> Option<Path> {
        Path::turnaround(self.pitch, radius, self.arc_ratio, lead_in, lead_out).ok()
    }

    /// Returns true if the search is to stop.
    pub fn is_stopped(&self) -> bool {
        (self.ask)(0).is_break()
    }

    /// Returns the metres of the S.
    pub fn length(&self, radius: f64) -> f64 {
        let a = self.pitch / std::f64::consts::TAU;
        2.0 * radius.hypot(a) * (radius / a).atan()
    }

    /// Returns the metres of path from the beginning of the S to a place of an event.
    pub fn past(&self, radius: f64, at: Place) -> f64 {
        self.path(radius).map_or(f64::NAN, |path| path.travelled(param(self.on_path(radius, at))))
    }

    /// Returns the place of the turnaround with a radius that is a place of an event.
    pub fn on_path(&self, radius: f64, at: Place) -> Place {
        self.moved(at, radius)
    }

    /// Returns the place of an event that is a place of the turnaround with a radius.
    fn event_place(&self, radius: f64, at: Param) -> Place {
        self.moved(place(at), -radius)
    }

    /// Returns a place with the polar angle of a radius added to its coordinate, if it is on a spiral.
    fn moved(&self, Place(segment, at, low): Place, radius: f64) -> Place {
        let is_arc = segment == 1 || segment == 2;
        Place(segment, if is_arc { at } else { at + radius * std::f64::consts::TAU / self.pitch }, low)
    }

    /// Returns an event with this radius, if the search finds one.
    pub fn event(&self, radius: f64) -> Option<Witness> {
        self.folds(radius).first().copied().or_else(|| self.touch(radius))
    }

    /// Returns the events with this radius that the search finds: the folds, or else boards that overlap.
    pub fn events(&self, radius: f64) -> Vec<Witness> {
        let folds = self.folds(radius);
        if folds.is_empty() { self.touch(radius).into_iter().collect() } else { folds }
    }

    /// Returns the least radius that the search finds, to some digits, if that radius is near the first free one.
    pub fn radius(&self) -> f64 {
        let free = |blocked: &dyn Fn(f64) -> bool, from: f64| {
            let mut to = from.max(self.team.longest_link());
            while blocked(to) && to < Accepted::LENGTH.greatest {
                to *= 2.0;
            }
            bisect(|radius| !blocked(radius), from, to)
        };
        let without_fold = free(&|radius| !self.folds(radius).is_empty(), Accepted::LENGTH.least);
        let beyond = without_fold * (1.0 + 1e-7);
        if self.touch(beyond).is_none() { without_fold } else { free(&|radius| self.event(radius).is_some(), beyond) }
    }

    /// Returns the metres of the spiral between two distances from the centre.
    fn spiral_between(&self, inner: f64, outer: f64) -> f64 {
        let length = |radius: f64| Path::spiral(self.pitch, radius / self.pitch).length();
        length(outer) - length(inner)
    }

    /// Returns the first stall and the lock with this radius, with several pivots each.
    pub fn folds(&self, radius: f64) -> Vec<Witness> {
        let mut folds = self.folds_of(radius, &self.team.foremost(2), 0);
        // The link of a tail that differs passes over the same path.
        if let Some(tail) = self.team.own_tail_link() {
            let alone = Team { benches: 1, head_length: self.team.board_length(tail), ..*self.team };
            folds.extend(self.folds_of(radius, &alone, tail));
        }
        folds
    }

    /// Returns the folds of a team, whose first bench has the number `first` in this family's team.
    fn folds_of(&self, radius: f64, team: &Team, first: usize) -> Vec<Witness> {
        if (self.ask)(FOLD_WORK).is_break() {
            return Vec::new();
        }
        let longest = team.longest_link();
        let lead_in = self.spiral_between(radius, radius.max(longest) + TURNS_BEFORE * self.pitch);
        let Some(path) = self.path_between(radius, lead_in, team.length() + LINKS_AFTER * longest) else {
            return Vec::new();
        };
        let found = Singularities::search(&path, team, &mut Budget::new(TRIAL_BUDGET, &mut |_| (self.ask)(FOLD_WORK)));
        let path = path.with_branches(found.branches.clone());
        let lock = found.end.filter(|end| end.kind == EventKind::Lock);
        let witness = |event: Event| {
            let link = event.bench_a? as usize;
            // Rounding may leave no follower in the last digits before a lock.
            let pivot = (0..40).find_map(|power| {
                let mut handle = path.param_at(event.travelled - 1e-14 * (1.0 + event.travelled) * 2f64.powi(power));
                let handles = if event.kind == EventKind::Lock { link + 1 } else { link };
                for bench in 0..handles {
                    handle = follower(&path, handle, team.link(bench)).ok()?;
                }
                Some(handle)
            })?;
            let near = path.travelled(pivot) - lead_in;
            let of_family = first + link;
            Some(REACHES.map(|reach| self.pivoted(radius, event.kind, of_family, near, reach * team.link(link))))
        };
        let witnesses = found.stall.into_iter().chain(lock).filter_map(witness);
        witnesses.flatten().flatten().collect()
    }

    /// Returns the fold with the deepest pivot within the distance `reach` of the place `near`. Both are metres along
    /// the path, and the place is counted from the beginning of the S.
    fn pivoted(&self, radius: f64, kind: EventKind, link: usize, near: f64, reach: f64) -> Option<Witness> {
        if (self.ask)(PIVOT_WORK).is_break() {
            return None;
        }
        let path = self.path(radius)?;
        let length = self.team.link(link);
        let folded = |pivot: Param| Folded::new(&path, kind, length, pivot);
        let depth = |pivot: Param| folded(pivot).map_or(f64::INFINITY, |folded| folded.merit);
        let better = |one: (f64, Param), other: Param| {
            let merit = depth(other);
            if merit < one.0 { (merit, other) } else { one }
        };
        let at = |travelled: f64| path.param_at(travelled);
        let offsets = (0..OFFSETS).map(|power| reach * 10f64.powf(-0.25 * f64::from(power)));
        let first = (depth(at(near)), at(near));
        let coarse = offsets.flat_map(|by| [at(near + by), at(near - by)]).fold(first, better);
        let (from, by) = (path.travelled(coarse.1), 0.5 * (path.travelled(coarse.1) - near).abs());
        let (_, finer) = golden_section_min(|travelled| depth(at(travelled)), from - by, from + by);
        let junctions = [1, 2].map(|segment| Param::new(segment, Coordinate { high: BESIDE_JUNCTION, low: 0.0 }));
        let near_junctions = junctions.into_iter().filter(|junction| (path.travelled(*junction) - near).abs() < reach);
        let (merit, pivot) = near_junctions.chain([at(finer)]).fold(coarse, better);
        // The ends of the S and of its first arc move as the radius grows: a pivot keeps off them.
        let aside = ASIDE * merit.abs();
        let is_beside = |place: f64| (path.travelled(pivot) - place).abs() < aside;
        let (merit, pivot) = if is_beside(path.travelled(junctions[1])) {
            (depth(junctions[1]), junctions[1])
        } else if let Some(end) = [0.0, self.length(radius)].into_iter().find(|end| is_beside(*end)) {
            let [before, after] = [at(end - aside), at(end + aside)];
            better((depth(before), before), after)
        } else {
            (merit, pivot)
        };
        let end = folded(pivot)?.end;
        (merit < 0.0).then(|| Witness::Fold {
            kind,
            link,
            pivot: self.event_place(radius, pivot),
            end: self.event_place(radius, end),
        })
    }

    /// Returns the two boards that overlap with this radius or are too near, at their nearest.
    fn touch(&self, radius: f64) -> Option<Witness> {
        if self.is_stopped() {
            return None;
        }
        let team = self.team;
        let outer = radius.max(team.longest_link()) + BOARDS_BEFORE * self.pitch;
        let lead_in = self.spiral_between(radius, outer);
        let path = self.path_between(radius, lead_in, team.length())?;
        let advancement = ConservativeAdvancement::new(&path, team, &[], &[]);
        let mut ask = |_| (self.ask)(BOARD_WORK * self.team.benches as u64);
        let mut budget = Budget::new(TRIAL_BUDGET, &mut ask);
        let least = advancement.least_clearance(0.0, path.length(), &mut budget).ok()?.value?;
        let head = self.event_place(radius, path.param_at(least.travelled));
        let pair = (least.bench_a, least.bench_b);
        (least.value <= self.clearance).then_some(Witness::Overlap { pair, head, radius, rate: 0.0 })
    }

    /// Returns the same event with another radius, with several pivots, each found on request.
    pub fn follow(&self, radius: f64, witness: &Witness) -> Box<dyn Iterator<Item = Witness> + '_> {
        let past = self.past(radius, witness.place());
        match *witness {
            Witness::Fold { kind, link, .. } => {
                let pivoted = move |reach| self.pivoted(radius, kind, link, past, reach * self.team.link(link));
                Box::new(REACHES.into_iter().filter_map(pivoted))
            }
            Witness::Overlap { pair, .. } => Box::new(self.overlaps(radius, pair, past).into_iter()),
        }
    }

    /// Returns the deepest overlap of two boards, or of others near them, with the head near a place. `past` is the
    /// place in metres past the beginning of the S. The first overlap has a head that stays at the deepest as the
    /// radius grows.
    fn overlaps(&self, radius: f64, (a, b): (u32, u32), past: f64) -> Vec<Witness> {
        let others = [(a, b), (a, b + 1), (a, b.saturating_sub(1).max(a + 2)), (a + 1, b + 1)];
        let Some((pair, head)) = self.deepest(radius, &others, past) else { return Vec::new() };
        let before = self.deepest(radius - RATE_STEP, &[pair], past).filter(|(_, before)| before.0 == head.0);
        let rate = before.map(|(_, before)| (head.1 - before.1) / RATE_STEP);
        rate.into_iter().chain([0.0]).map(|rate| Witness::Overlap { pair, head, radius, rate }).collect()
    }

    /// Returns the pair of boards that overlap most deeply with the head near a place, and the head's place then.
    /// `past` is the near place in metres past the beginning of the S.
    fn deepest(&self, radius: f64, pairs: &[(u32, u32)], past: f64) -> Option<((u32, u32), Place)> {
        if self.is_stopped() {
            return None;
        }
        let window = WINDOW * self.team.shortest_link();
        let lead_in = self.spiral_between(radius, radius.max(self.team.longest_link()) + BOARDS_BEFORE * self.pitch);
        let path = self.path_between(radius, lead_in, self.team.length())?;
        let advancement = ConservativeAdvancement::new(&path, self.team, &[], &[]);
        let at = (lead_in + past).clamp(0.0, path.length());
        let parts = [((at - window).max(0.0), at), (at, (at + window).min(path.length()))];
        let pairs = pairs.iter().filter(|pair| (pair.1 as usize) < self.team.benches);
        let mut ask = |_| (self.ask)(BOARD_WORK * self.team.benches as u64);
        let mut budget = Budget::new(u64::MAX, &mut ask);
        let parts = pairs.flat_map(|pair| parts.map(|part| (*pair, part)));
        let found = parts.map(|(pair, part)| (pair, advancement.minimum_of(pair, part, &mut budget)));
        let (pair, (clearance, travelled)) = found.min_by(|one, other| one.1.0.total_cmp(&other.1.0))?;
        (clearance < self.clearance).then(|| (pair, self.event_place(radius, path.param_at(travelled))))
    }
}

/// Relative precision of the radii that the search compares.
const SEARCH_PRECISION: f64 = 1e-6;

/// Returns the least number within `low..=high` where a predicate holds, to some digits.
fn bisect(holds: impl Fn(f64) -> bool, low: f64, high: f64) -> f64 {
    let (mut inside, mut outside) = (low, high);
    while outside - inside > SEARCH_PRECISION * outside {
        let middle = 0.5 * (inside + outside);
        if holds(middle) { outside = middle } else { inside = middle }
    }
    outside
}

/// A link with one handle at a pivot.
struct Folded {
    /// A place beyond the other handle, but not so far that the product changes its sign.
    end: Param,
    /// Product of the pivot's tangent and the link, in metres. If it is negative, the link has stalled or locked. The
    /// number is then at least minus a multiple of the metres by which `end` is further than the link from the pivot.
    merit: f64,
}

impl Folded {
    /// Creates the link with its rear handle (of a lock) or its front handle (of a stall) at a pivot.
    fn new(path: &Path, kind: EventKind, link: f64, pivot: Param) -> Option<Self> {
        let (point, tangent) = (path.point(pivot), path.tangent(pivot));
        let distance = |travelled: f64| (path.point(path.param_at(travelled)) - point).norm();
        let (other, forward) = if kind == EventKind::Lock {
            let from = path.travelled(pivot);
            let reached = |metres: f64| distance(from + metres) >= link;
            let step = link / f64::from(STEPS);
            // No chord is longer than its path.
            let first = (STEPS..64 * STEPS).map(|k| step * f64::from(k)).find(|metres| reached(*metres))?;
            (from + bisect_predicate(reached, first - step, first), 1.0)
        } else {
            (path.travelled(follower(path, pivot, link).ok()?), -1.0)
        };
        let product_at = |travelled: f64| forward * tangent.dot(&(path.point(path.param_at(travelled)) - point));
        let product = product_at(other);
        // The distance may fall again beyond.
        let places = (0..BEYOND_TRIALS).map(|power| other + forward * BEYOND * product.abs() * 0.5f64.powi(power));
        let places = places.filter(|place| product >= 0.0 || product_at(*place) < REMAINS * product);
        let distances = places.map(|place| (place, distance(place)));
        let (end, furthest) = distances.max_by(|one, other| one.1.total_cmp(&other.1))?;
        let room = ROOM * (furthest - link);
        let merit = if product < 0.0 { product.max(-room) } else { product };
        Some(Self { end: path.param_at(end), merit })
    }
}
