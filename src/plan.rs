//! Answers for the choreographer: the least pitch with which a team still reaches a radius, and the greatest speed at
//! which no handle is too fast.
//!
//! In: a team or a scene. Out: one number with where it is decided. The `plan` command prints them.

use crate::chain::newton::Newton;
use crate::chain::{Chain, Team, Velocities};
use crate::events::contact::first_contact;
use crate::events::stall_and_end;
use crate::events::sweep::Sweep;
use crate::geometry::path::Path;
use crate::geometry::root::least_between;
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

/// How near to the infimum the pitch is found, metres.
const PITCH_RESOLUTION: f64 = 1e-11;

/// Steps in which pitches are tried from below: a coarse search for one that will do, and a fine one of what lies just
/// below it, since the pitches that will do need not be one interval.
const COARSE: f64 = 1.01;
const FINE: f64 = 1.0001;

/// The least pitch of an inward spiral at which the front handle of the head comes within `radius` metres of the centre
/// and no two boards touch before. `progress` is told which share of the work is done, from 0 to 1.
///
/// # Errors
/// A radius that every pitch reaches, or none.
pub fn least_pitch(team: &Team, radius: f64, progress: &mut dyn FnMut(f64)) -> Result<LeastPitch, PlanError> {
    let Accepted { least, greatest, .. } = Accepted::LENGTH;
    // Two turns that are narrower than half a board overlap, where there are two.
    let lowest = least.max(0.5 * team.width);
    let fails = |pitch: f64| Trial::new(team, pitch, radius).fails();
    if !fails(lowest) {
        return Err(PlanError(format!(
            "the team reaches {radius} m with every pitch from {lowest} m on: it is too short to meet itself"
        )));
    }
    let mut coarse = lowest;
    while fails(coarse) {
        coarse *= COARSE;
        if coarse > greatest {
            return Err(PlanError(format!("the team reaches {radius} m with no pitch up to {greatest} m")));
        }
        progress(0.3 * (1.0 - (radius - coarse).abs() / (radius + coarse)));
    }
    let (mut low, mut high) = (lowest.max(coarse / COARSE.powi(3)), coarse);
    while low * FINE < coarse {
        if !fails(low * FINE) {
            high = low * FINE;
            break;
        }
        low *= FINE;
        progress(0.3 + 0.3 * (low / coarse - 1.0 / COARSE.powi(3)) / (1.0 - 1.0 / COARSE.powi(3)));
    }
    let halvings = ((high - low) / PITCH_RESOLUTION).log2();
    while high - low > PITCH_RESOLUTION.max(4.0 * f64::EPSILON * high) {
        let middle = 0.5 * (low + high);
        if fails(middle) {
            low = middle
        } else {
            high = middle
        }
        progress(1.0 - 0.4 * ((high - low) / PITCH_RESOLUTION).log2().max(0.0) / halvings);
    }
    let Some((bench_a, bench_b, travelled)) = Trial::new(team, low, radius).touch() else {
        return Err(PlanError(format!("with any pitch below {high} m a bench folds before the head is at {radius} m")));
    };
    let trial = Trial::new(team, high, radius);
    let around = 0.1 * team.link(0).min(team.link(1));
    let sweep = Sweep::new(&trial.spiral, team, None);
    let (_, travelled) =
        sweep.minimum_of((bench_a, bench_b), (travelled - around).max(0.0), (travelled + around).min(trial.limit));
    let head_radius = trial.spiral.radius(trial.spiral.place_at(travelled));
    Ok(LeastPitch { value: high, bench_a, bench_b, head_radius })
}

/// A team that comes in on a spiral of one pitch to a radius.
struct Trial<'a> {
    team: &'a Team,
    spiral: Spiral,
    /// Metres of travel at which the radius is reached.
    limit: f64,
}

impl<'a> Trial<'a> {
    fn new(team: &'a Team, pitch: f64, radius: f64) -> Self {
        let start = radius.max(team.link(0)).max(team.link(1)) / pitch + TURNS_BEFORE;
        let spiral = Spiral::new(pitch, start);
        let limit = spiral.distance_between(spiral.start(), Angle::from_turns(radius / pitch));
        Self { team, spiral, limit }
    }

    /// Whether something keeps the head from the radius.
    fn fails(&self) -> bool {
        let events = stall_and_end(&self.spiral, self.team);
        let locked = events.iter().any(|event| event.kind == State::Lock && event.travelled < self.limit);
        locked || self.touch().is_some()
    }

    /// The first two benches that touch before the radius is reached, and the head's travel.
    fn touch(&self) -> Option<(u32, u32, f64)> {
        let stall = stall_and_end(&self.spiral, self.team).into_iter().find(|event| event.kind == State::Stall);
        let stall = stall.map(|event| event.travelled).filter(|at| *at < self.limit);
        let contact = first_contact(&self.spiral, self.team, stall, self.limit, &mut |_| ())?;
        Some((contact.bench_a?, contact.bench_b?, contact.travelled))
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
/// every peak that comes near the highest is followed to its top: between two looks a handle has one peak.
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
