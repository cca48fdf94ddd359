//! The margin of a scene: by how much a show keeps each distance that it must keep.
//!
//! In: a scene, the distances. Out: the margin, exactly, by the searches of `check` over the whole route, or at
//! samples, which costs a tenth. A margin at samples is never less than the exact one, because a least value over some
//! times is not below that over all.

use std::ops::ControlFlow;

use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::clearance::board;
use bench_dragon_motion::ensemble::Ensemble;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::ground::Obstacle;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::separation::{circle_bound_board_board, signed_distance_board_board};
use bench_dragon_motion::model::shape::ShapeKind;
use bench_dragon_motion::solve::{Chain, Positions, Velocities};
use bench_dragon_motion::{Method, MotionError};
use bench_dragon_show::scene::Scene;
use bench_dragon_show::solve_at_or_just_before;

/// The metres that the fastest head goes between two samples, if the show is not too long.
const STEP: f64 = 0.5;
/// The greatest number of samples.
const MOST_SAMPLES: f64 = 20_000.0;
/// The margin of a motion that locks before its end, less the share of the way that is left.
const LOCKED: f64 = -10.0;

/// The distances that a show must keep.
#[derive(Debug, Clone, Copy)]
pub struct Rules {
    /// Between any two boards that share no handle, in metres.
    pub clearance: f64,
    /// True if the boundary counts.
    pub with_boundary: bool,
}

/// One distance that a show must keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum What {
    /// Between boards.
    Boards,
    /// To an obstacle, by its number on the ground.
    Obstacle(usize),
    /// The motion has to reach the end of its path.
    PathEnd,
}

/// By how much a show keeps a distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// The distance.
    pub what: What,
    /// The metres beyond the required ones; negative where it is not kept.
    pub margin: f64,
    /// The simulated seconds at which it is least.
    pub time: f64,
    /// The bench, and the other one of boards, by their numbers in the show.
    pub benches: (u32, Option<u32>),
}

/// The margins of a show.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// The distances.
    pub parts: Vec<Part>,
}

impl Judgement {
    /// Returns the least margin in metres.
    pub fn margin(&self) -> f64 {
        self.parts.iter().map(|part| part.margin).fold(f64::INFINITY, f64::min)
    }
}

impl Rules {
    /// Creates the rules of a search that begins with a scene. A boundary outside which a board stands at the start does
    /// not count: a shortfall that hardly depends on the numbers would hide all other distances. It counts if `progress`
    /// stops the search for the start.
    pub fn new(scene: &Scene, clearance: f64, progress: Progress<'_>) -> Self {
        let rules = Self { clearance, with_boundary: true };
        let with_boundary = Sampler::new(scene, rules).is_none_or(|mut sampler| sampler.is_inside_at_start(progress));
        Self { with_boundary, ..rules }
    }

    fn applies_to(&self, obstacle: &Obstacle) -> bool {
        self.with_boundary || obstacle.shape.kind() != ShapeKind::Boundary
    }

    /// Returns the exact margins of a scene; `None` if the search was stopped or could not decide.
    pub fn exact(&self, scene: &Scene, progress: Progress<'_>) -> Option<Judgement> {
        let ensemble = &scene.ensemble;
        let timeline = ensemble.timeline_without_contact(&mut |share| progress(0.1 * share));
        let end = timeline.end();
        if progress(0.1).is_break() || timeline.searched_until().is_some() {
            return None;
        }
        let mut parts = Vec::new();
        if end.event.kind == EventKind::Lock {
            let benches = (end.event.bench_a.unwrap_or_default(), None);
            parts.push(Part {
                what: What::PathEnd,
                margin: LOCKED - left(ensemble, end.time),
                time: end.time,
                benches,
            });
        }
        let found = ensemble.least_clearances(&timeline, end, &mut |share| progress(0.1 + 0.5 * share));
        if !found.is_complete {
            return None;
        }
        if let Some(found) = found.of_show {
            let benches = (found.least.bench_a, Some(found.least.bench_b));
            let margin = found.least.value - self.clearance;
            parts.push(Part { what: What::Boards, margin, time: found.time, benches });
        }
        let mut stopped = false;
        let beside = ensemble.obstacle_clearances(end, &mut |share| {
            let flow = progress(0.6 + 0.4 * share);
            stopped |= flow == ControlFlow::Break(());
            flow
        });
        if beside.len() < ensemble.ground().obstacles().len() {
            return None;
        }
        let kept = |number: usize| self.applies_to(&ensemble.ground().obstacles()[number]);
        for found in beside.iter().filter(|found| kept(found.obstacle)) {
            found.searched_until.is_none().then_some(())?;
            let (what, benches) = (What::Obstacle(found.obstacle), (found.least.bench, None));
            parts.push(Part { what, margin: found.least.value, time: found.time, benches });
        }
        (!stopped && !parts.is_empty()).then_some(Judgement { parts })
    }

    /// Returns the margins at samples. Ends early with what it has once the least margin is not above `floor`: more
    /// samples do not raise it. `None` for a scene whose motion cannot be computed.
    pub fn sampled(&self, scene: &Scene, floor: f64, is_stopped: &mut dyn FnMut() -> bool) -> Option<Judgement> {
        Sampler::new(scene, *self)?.judgement(floor, is_stopped)
    }
}

/// Returns the share of the show that is left at a time.
fn left(ensemble: &Ensemble, time: f64) -> f64 {
    1.0 - (time / duration(ensemble)).clamp(0.0, 1.0)
}

/// Returns the seconds until the last head reaches the end of its path.
fn duration(ensemble: &Ensemble) -> f64 {
    let ends = ensemble
        .dragons()
        .iter()
        .map(|dragon| dragon.delay + dragon.motion.time_at(dragon.motion.bare_path().length()));
    ends.fold(0.0, f64::max)
}

/// A show at samples.
struct Sampler {
    ensemble: Ensemble,
    rules: Rules,
    chain: Chain,
}

impl Sampler {
    fn new(scene: &Scene, rules: Rules) -> Option<Self> {
        // A table costs more than the samples.
        let exact = |motion: &bench_dragon_motion::Motion| motion.with_method(Method::Newton);
        let ensemble = scene.ensemble.try_map::<MotionError>(exact).ok()?;
        let chain = Chain::new(ensemble.handles());
        Some(Self { ensemble, rules, chain })
    }

    fn boards(&self) -> Vec<(u32, usize, Board)> {
        let chain = &self.chain;
        let of = |k: usize| {
            let (first, team) = (self.ensemble.handles_of(k).start, self.ensemble.dragons()[k].motion.team());
            let own = move || Positions { x: &chain.x[first..], y: &chain.y[first..] };
            (0..team.benches).map(move |bench| ((first + bench) as u32, k, board(own(), team, bench)))
        };
        (0..self.ensemble.dragons().len()).flat_map(of).collect()
    }

    fn is_inside_at_start(&mut self, progress: Progress<'_>) -> bool {
        let solver = self.ensemble.solver_unless_stopped(Velocities::Omitted, progress);
        let Some(mut solver) = solver else { return true };
        let solved = solver.solve(0.0, &mut self.chain).is_ok();
        let boards = self.boards();
        let boundary =
            self.ensemble.ground().obstacles().last().filter(|last| last.shape.kind() == ShapeKind::Boundary);
        !solved || boundary.is_none_or(|boundary| boards.iter().all(|(_, _, board)| boundary.clearance(board) >= 0.0))
    }

    fn judgement(mut self, floor: f64, is_stopped: &mut dyn FnMut() -> bool) -> Option<Judgement> {
        let end = duration(&self.ensemble);
        let fastest = self.ensemble.dragons().iter().map(|dragon| dragon.motion.head_speed()).fold(0.0, f64::max);
        let samples = (end * fastest / STEP).clamp(1.0, MOST_SAMPLES).ceil();
        let mut ask = |_| if is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let mut solver = self.ensemble.solver_unless_stopped(Velocities::Omitted, &mut ask)?;
        let mut parts: Vec<Part> = Vec::new();
        for sample in 0..=samples as usize {
            let time = end * sample as f64 / samples;
            if is_stopped() {
                return None;
            }
            // The last sample is the end of the path, which rounding may put past it.
            if solve_at_or_just_before(solver.as_mut(), time, &mut self.chain).is_err() {
                let margin = LOCKED - left(&self.ensemble, time);
                parts.push(Part { what: What::PathEnd, margin, time, benches: (0, None) });
                break;
            }
            self.include(time, &mut parts);
            if parts.iter().any(|part| part.margin <= floor) {
                break;
            }
        }
        (!parts.is_empty()).then_some(Judgement { parts })
    }

    /// Adds the distances of a sample.
    fn include(&self, time: f64, parts: &mut Vec<Part>) {
        let boards = self.boards();
        let mut least = least_of(parts, What::Boards) + self.rules.clearance;
        for (index, (a, of_a, one)) in boards.iter().enumerate() {
            for (b, of_b, other) in &boards[index + 1..] {
                let shares_handle = of_a == of_b && b - a < 2;
                if shares_handle || circle_bound_board_board(one, other) >= least {
                    continue;
                }
                let distance = signed_distance_board_board(one, other);
                if distance < least {
                    least = distance;
                    let margin = distance - self.rules.clearance;
                    note(parts, Part { what: What::Boards, margin, time, benches: (*a, Some(*b)) });
                }
            }
        }
        for (number, obstacle) in self.ensemble.ground().obstacles().iter().enumerate() {
            if !self.rules.applies_to(obstacle) {
                continue;
            }
            let what = What::Obstacle(number);
            for (bench, _, board) in &boards {
                let least = least_of(parts, what);
                if obstacle.coarse_clearance(board) < least {
                    let margin = finite(obstacle, board, obstacle.clearance_below(board, least));
                    if margin < least {
                        note(parts, Part { what, margin, time, benches: (*bench, None) });
                    }
                }
            }
        }
    }
}

/// Returns a clearance; of a board outside the boundary how far outside, so that a search knows where to go.
fn finite(obstacle: &Obstacle, board: &Board, clearance: f64) -> f64 {
    if clearance > f64::NEG_INFINITY {
        return clearance;
    }
    let (on_board, on_side) = obstacle.shape.nearest_points(board);
    -1.0 - (on_board - on_side).norm() - obstacle.keep_out
}

fn least_of(parts: &[Part], what: What) -> f64 {
    parts.iter().find(|part| part.what == what).map_or(f64::INFINITY, |part| part.margin)
}

fn note(parts: &mut Vec<Part>, part: Part) {
    match parts.iter_mut().find(|other| other.what == part.what) {
        Some(other) => *other = part,
        None => parts.push(part),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_motion::event::unreported;

    #[test]
    fn samples_bound_every_exact_margin_from_above() {
        for text in [include_str!("../../../config/village.toml"), include_str!("../../../config/square.toml")] {
            let scene = Scene::parse(text, "scene.toml", "scene").unwrap();
            let rules = Rules::new(&scene, 0.2, &mut unreported);
            let (exact, sampled) =
                (rules.exact(&scene, &mut unreported), rules.sampled(&scene, f64::NEG_INFINITY, &mut || false));
            let (exact, sampled) = (exact.unwrap(), sampled.unwrap());
            assert_eq!(exact.parts.len(), sampled.parts.len(), "{exact:?} {sampled:?}");
            for part in &exact.parts {
                let at_samples = sampled.parts.iter().find(|other| other.what == part.what).unwrap();
                let over = at_samples.margin - part.margin;
                assert!((-1e-6..0.2).contains(&over), "{part:?} {at_samples:?}");
            }
        }
    }
}
