//! Answers for the choreographer: the least pitch with which a team still reaches a radius, and the greatest speed at
//! which no handle is too fast.
//!
//! In: a team or a scene. Out: one number with where it is decided. The `plan` command prints them.

use crate::chain::newton::Newton;
use crate::chain::{Chain, Team, Velocities};
use crate::events::stall_and_end;
use crate::events::sweep::Sweep;
use crate::geometry::path::Path;
use crate::geometry::root::{first_true, least_between};
use crate::geometry::spiral::{Angle, Spiral};
use crate::messages::State;
use crate::scene::path::ScenePath;
use crate::scene::{Accepted, Scene};
use crate::show::timeline::Timeline;

/// A question that has no answer, in one sentence.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct PlanError(String);

/// The least pitch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastPitch {
    /// Metres per turn: with any less two boards overlap before the radius is reached.
    pub value: f64,
    /// The two benches that touch at this pitch, the one nearer the head first.
    pub bench_a: u32,
    /// The second of them.
    pub bench_b: u32,
    /// Metres from the centre to the head's front handle when they touch.
    pub head_radius: f64,
}

/// Turns outside the radius at which a trial begins. The turns of a team only get narrower for its boards further in,
/// so what touches further out touches again within these.
const TURNS_BEFORE: f64 = 3.0;

/// How much the pitch grows at a time while the same two boards are in the way.
const GROWTH: f64 = 1.005;

/// What is added to a pitch at which boards just touch, metres: more than rounding, less than anyone asks for.
const FREE: f64 = 1e-13;

/// How far about a touch, in links, the same two boards are followed as the pitch grows.
const WINDOW: f64 = 0.3;

/// The least pitch of an inward spiral at which the front handle of the head comes within `radius` metres of the centre
/// and no two boards touch before. `progress` is told which share of the work is done, from 0 to 1.
///
/// The pitch grows from one that cannot do. Each time the trial fails, the two boards that overlap most deeply are
/// followed near that place, in steps of half a percent, until they come free, and the next trial is made there. So pitches
/// that will do are only passed over where the two come free and meet again within one step.
///
/// # Errors
/// A radius that every pitch reaches, or none.
pub fn least_pitch(team: &Team, radius: f64, progress: &mut dyn FnMut(f64)) -> Result<LeastPitch, PlanError> {
    let Accepted { least, greatest, .. } = Accepted::LENGTH;
    // Turns narrower than half a board overlap, where there are two.
    let lowest = least.max(0.5 * team.width);
    let mut pitch = lowest;
    let mut decided = None;
    while let Some(obstacle) = Trial::new(team, pitch, radius).obstacle() {
        if pitch > greatest {
            return Err(PlanError(format!("the team reaches {radius} m with no pitch up to {greatest} m")));
        }
        let free = |pitch: f64| !Trial::new(team, pitch, radius).is_blocked_by(&obstacle);
        while !free(pitch * GROWTH) && pitch <= greatest {
            pitch *= GROWTH;
        }
        pitch = first_true(free, pitch, pitch * GROWTH) + FREE;
        decided = Some(obstacle);
        // The more turns fit into the radius, the further there is to go.
        progress(1.0 - (-0.3 * pitch / lowest).exp());
    }
    let Some(obstacle) = decided else {
        return Err(PlanError(format!(
            "the team reaches {radius} m with every pitch from {lowest} m on: it is too short to meet itself"
        )));
    };
    let Obstacle::Touch { pair: (bench_a, bench_b), .. } = obstacle else {
        return Err(PlanError(format!(
            "no two boards touch before {radius} m, but with any pitch below {pitch} m a bench folds back on itself"
        )));
    };
    let trial = Trial::new(team, pitch, radius);
    let (_, travelled) = trial.nearest(&obstacle);
    let head_radius = trial.spiral.radius(trial.spiral.place_at(travelled));
    Ok(LeastPitch { value: pitch, bench_a, bench_b, head_radius })
}

/// What keeps a head from its radius.
enum Obstacle {
    /// A link locks before.
    Lock,
    /// Two boards overlap, most deeply this many metres of travel before the radius.
    Touch { pair: (u32, u32), before: f64 },
}

/// The foremost part of a team that comes in on a spiral of one pitch to a radius.
struct Trial {
    team: Team,
    spiral: Spiral,
    /// Metres of travel at which the radius is reached.
    limit: f64,
}

impl Trial {
    fn new(team: &Team, pitch: f64, radius: f64) -> Self {
        let start = radius.max(team.link(0)).max(team.link(1)) / pitch + TURNS_BEFORE;
        let spiral = Spiral::new(pitch, start);
        let limit = spiral.distance_between(spiral.start(), Angle::from_turns(radius / pitch));
        // No board can touch one of the first two from more than two turns away without touching one before it.
        let within = Spiral::new(pitch, start + 2.0);
        let behind = within.distance_between(within.start(), spiral.start());
        let benches = (behind / team.link(1)).ceil() as usize + 3;
        Self { team: Team { benches: benches.min(team.benches), ..*team }, spiral, limit }
    }

    fn sweep(&self) -> Sweep<'_, Spiral> {
        let stall = stall_and_end(&self.spiral, &self.team).into_iter().find(|event| event.kind == State::Stall);
        Sweep::new(&self.spiral, &self.team, stall.map(|event| event.travelled))
    }

    fn locks(&self) -> bool {
        let events = stall_and_end(&self.spiral, &self.team);
        events.iter().any(|event| event.kind == State::Lock && event.travelled < self.limit)
    }

    /// What keeps the head from the radius, if anything does.
    fn obstacle(&self) -> Option<Obstacle> {
        if self.locks() {
            return Some(Obstacle::Lock);
        }
        let touch = self.sweep().least_clearance(0.0, self.limit, &mut |_| ()).filter(|touch| touch.value <= 0.0)?;
        Some(Obstacle::Touch { pair: (touch.bench_a, touch.bench_b), before: self.limit - touch.travelled })
    }

    /// Whether an obstacle of another pitch is one of this pitch too.
    fn is_blocked_by(&self, obstacle: &Obstacle) -> bool {
        match obstacle {
            Obstacle::Lock => self.locks(),
            Obstacle::Touch { .. } => self.nearest(obstacle).0 <= 0.0,
        }
    }

    /// The least clearance of the pair of a touch, near where it touched, and the head's travel there.
    fn nearest(&self, obstacle: &Obstacle) -> (f64, f64) {
        let Obstacle::Touch { pair, before } = *obstacle else { return (f64::INFINITY, self.limit) };
        let around = WINDOW * self.team.link(0).min(self.team.link(1));
        let (sweep, at) = (self.sweep(), (self.limit - before).max(0.0));
        let parts = [((at - around).max(0.0), at), (at, (at + around).min(self.limit))];
        let nearest = parts.map(|(from, to)| sweep.minimum_of(pair, from, to));
        if nearest[0].0 <= nearest[1].0 { nearest[0] } else { nearest[1] }
    }
}

/// The greatest speed of the head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GreatestSpeed {
    /// Metres per second.
    pub value: f64,
    /// Simulated seconds of the scene as it is written at which the fastest handle is fastest.
    pub time: f64,
    /// That handle, counted from 0.
    pub handle: u32,
    /// Its speed over the head's.
    pub ratio: f64,
}

/// How densely the show is looked at for its fastest handle, as a share of the shortest link.
const SPEED_STEP: f64 = 0.01;

/// Peaks of the looks this much below the highest are still refined.
const PEAK_MARGIN: f64 = 0.02;

/// The greatest constant speed of the head at which no handle ever goes faster than `limit` metres per second, from the
/// scene's start until its show freezes. `progress` is told which share of the work is done, from 0 to 1.
///
/// A handle's speed over the head's depends on the head's place alone. It is looked at every hundredth of a link, and
/// every peak that comes near the highest is followed to its top. That a handle has one peak between two looks is taken for
/// granted, not proven.
///
/// # Errors
/// A show that runs into a lock, near which speeds have no bound.
pub fn greatest_speed(
    scene: &Scene,
    timeline: &Timeline,
    limit: f64,
    progress: &mut dyn FnMut(f64),
) -> Result<GreatestSpeed, PlanError> {
    let freeze = timeline.freeze(scene.on_contact);
    if freeze.event.kind == State::Lock {
        return Err(PlanError(format!(
            "the show runs into a lock at {} s, and near it a handle goes faster than any limit",
            freeze.time
        )));
    }
    let to = freeze.event.travelled;
    let (ratio, travelled, handle) = match &scene.path {
        ScenePath::Spiral(spiral) => fastest(spiral, &scene.team, to, progress),
        ScenePath::Pieces(path) => fastest(path, &scene.team, to, progress),
    };
    Ok(GreatestSpeed { value: limit / ratio, time: scene.time_of(travelled), handle: handle as u32, ratio })
}

/// The greatest ratio of a handle's speed to the head's up to a distance of travel, with the distance and the handle.
fn fastest<P: Path + Clone>(path: &P, team: &Team, to: f64, progress: &mut dyn FnMut(f64)) -> (f64, f64, usize) {
    let solver = Newton::new(path.clone(), *team, 1.0, Velocities::Computed);
    let mut search = Fastest { path, solver, chain: Chain::new(team.handles()) };
    let step = SPEED_STEP * team.link(0).min(team.link(1));
    let steps = (to / step).ceil().max(1.0) as usize;
    let at = |k: usize| (k as f64 * step).min(to);
    let looks: Vec<(f64, usize)> = (0..=steps)
        .map(|k| {
            progress(0.9 * k as f64 / steps as f64);
            search.look(at(k))
        })
        .collect();
    let mut best = (0.0, 0.0, 0);
    for (k, &(ratio, handle)) in looks.iter().enumerate() {
        if ratio > best.0 {
            best = (ratio, at(k), handle);
        }
    }
    let worth = best.0 * (1.0 - PEAK_MARGIN);
    for k in 0..=steps {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(steps));
        let peak = looks[k].0 >= looks[before].0 && looks[k].0 >= looks[after].0;
        // Where nothing is faster than the head, there is no peak to follow.
        if peak && looks[k].0 > worth.max(1.0) {
            let mut handles = [looks[before].1, looks[k].1, looks[after].1].to_vec();
            handles.dedup();
            for handle in handles {
                let (ratio, travelled) = search.peak(handle, at(before), at(after));
                if ratio > best.0 {
                    best = (ratio, travelled, handle);
                }
            }
        }
        progress(0.9 + 0.1 * k as f64 / steps as f64);
    }
    best
}

/// Speeds over the head's, anywhere on a path.
struct Fastest<'a, P: Path> {
    path: &'a P,
    solver: Newton<P>,
    chain: Chain,
}

impl<P: Path> Fastest<'_, P> {
    /// The fastest handle with the head at one place, and its speed over the head's; a place without a solution, which
    /// only the last digit before a lock can be, has none.
    fn look(&mut self, travelled: f64) -> (f64, usize) {
        if self.solver.solve_from(self.path.place_at(travelled), &mut self.chain).is_err() {
            return (0.0, 0);
        }
        let speeds = self.chain.speed.iter().map(|speed| speed.abs()).zip(0..);
        speeds.fold((0.0, 0), |best, next| if next.0 > best.0 { next } else { best })
    }

    fn speed(&mut self, handle: usize, travelled: f64) -> f64 {
        let solved = self.solver.solve_from(self.path.place_at(travelled), &mut self.chain);
        solved.map_or(0.0, |()| self.chain.speed[handle].abs())
    }

    /// A handle's greatest speed between two places of the head that hold one peak of it, and where it is.
    fn peak(&mut self, handle: usize, from: f64, to: f64) -> (f64, f64) {
        let (least, travelled) = least_between(|at| -self.speed(handle, at), from, to);
        (-least, travelled)
    }
}
