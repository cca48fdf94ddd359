//! Answers for the choreographer: the least pitch with which a team still reaches a radius, and the greatest speed at
//! which no handle is too fast.
//!
//! In: a team or a scene. Out: one number with where it is decided. The `plan` command prints them.

use std::f64::consts::TAU;

use crate::model::Point;
use crate::model::board::Board;
use crate::model::curve::Curve;
use crate::model::double_double::DoubleDouble;
use crate::model::path::Path;
use crate::model::root::{bisect_predicate, golden_section_min};
use crate::model::separation::signed_distance_board_board;
use crate::model::spiral::{Direction, Spiral};
use crate::model::team::Team;
use crate::motion::contact::{ConservativeAdvancement, LeastClearance};
use crate::motion::event::{Budget, EventKind};
use crate::motion::singularities::Singularities;
use crate::motion::timeline::Timeline;
use crate::scene::{Accepted, Scene};
use crate::solve::newton::Newton;
use crate::solve::{Chain, Velocities};

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

/// What is added to a pitch at which boards just touch, metres: more than rounding, less than any plan needs.
const FREE: f64 = 1e-13;

/// How far about a touch, in links, the same two boards are followed as the pitch grows.
const WINDOW: f64 = 0.3;

/// The least pitch of an inward spiral at which the front handle of the head comes within `radius` metres of the centre
/// and no two boards touch before. `progress` is given the share of the work done, from 0 to 1.
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
    if team.benches >= 3 && 2.0 * team.hole_inset >= team.link(1) {
        return Err(PlanError(format!(
            "the team reaches {radius} m with no pitch: a bench is as long as two insets or shorter ({} m between its \
             holes), so that the boards before and after it overlap even on a straight line",
            team.link(1)
        )));
    }
    if let Some((bench, bend)) = neighbours_touch(team, radius) {
        return Err(PlanError(format!(
            "the team reaches {radius} m with no pitch: benches {} and {} (counting from 1) touch wherever the path bends \
             with a radius of about {bend:.3} m, as it does with every pitch on the way in",
            bench + 1,
            bench + 3
        )));
    }
    while let Some(obstacle) = Trial::new(team, pitch, radius).obstacle()? {
        if pitch > greatest {
            return Err(PlanError(format!("the team reaches {radius} m with no pitch up to {greatest:.3} m")));
        }
        let free = |pitch: f64| !Trial::new(team, pitch, radius).is_blocked_by(&obstacle);
        while !free(pitch * GROWTH) && pitch <= greatest {
            pitch *= GROWTH;
        }
        pitch = bisect_predicate(free, pitch, pitch * GROWTH) + FREE;
        decided = Some(obstacle);
        // The more turns fit into the radius, the further there is to go.
        progress(1.0 - (-0.3 * pitch / lowest).exp());
    }
    let Some(obstacle) = decided else {
        return Err(PlanError(format!(
            "the team reaches {radius} m with every pitch from {lowest:.9} m on: it is too short to meet itself"
        )));
    };
    let Obstacle::Touch { pair: (bench_a, bench_b), .. } = obstacle else {
        return Err(PlanError(format!(
            "no two boards touch before {radius} m, but with any pitch below {pitch:.9} m a bench folds back on itself"
        )));
    };
    let trial = Trial::new(team, pitch, radius);
    let (_, travelled) = trial.nearest(&obstacle);
    let head_radius = trial.path.point(trial.path.param_at(travelled)).coords.norm();
    Ok(LeastPitch { value: pitch, bench_a, bench_b, head_radius })
}

/// Radii of bends, evenly by their inverse, at which neighbours are tested.
const BENDS: usize = 2000;

/// Whether a bench and the next but one overlap on some bend no sharper than a circle of `radius` metres, taken as an arc:
/// the first of the two and the radius of the bend. What touches there touches with every pitch, since every spiral
/// bends so somewhere outside.
fn neighbours_touch(team: &Team, radius: f64) -> Option<(usize, f64)> {
    let sharpest = radius.max(0.51 * team.longest_link());
    let firsts = 0..team.benches.saturating_sub(2).min(2);
    let clearance = |bench: usize, bend: f64| {
        // Clockwise about the centre: each handle is behind the one before by the angle of its chord.
        let mut angle = 0.0f64;
        let mut at = |link: f64| {
            angle += 2.0 * (0.5 * link / bend).asin();
            Point::new(bend * angle.cos(), bend * angle.sin())
        };
        let handles = [Point::new(bend, 0.0), at(team.link(bench)), at(team.link(bench + 1)), at(team.link(bench + 2))];
        let board = |front: usize| Board::from_handles(handles[front], handles[front + 1], team.hole_inset, team.width);
        signed_distance_board_board(&board(0), &board(2))
    };
    firsts
        .flat_map(|bench| (1..=BENDS).map(move |k| (bench, sharpest * BENDS as f64 / k as f64)))
        .map(|(bench, bend)| (clearance(bench, bend), bench, bend))
        .filter(|(clearance, ..)| *clearance < 0.0)
        .min_by(|one, other| one.0.total_cmp(&other.0))
        .map(|(_, bench, bend)| (bench, bend))
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
    path: Path,
    singularities: Singularities,
    /// Metres of travel at which the radius is reached.
    limit: f64,
}

/// Units of work for one trial of a pitch: some seconds.
const TRIAL_BUDGET: u64 = 20_000_000;

impl Trial {
    fn new(team: &Team, pitch: f64, radius: f64) -> Self {
        let start = radius.max(team.longest_link()) / pitch + TURNS_BEFORE;
        let spiral = Spiral::new(pitch, Direction::Inward);
        let travel =
            |from: f64, to: f64| spiral.arc_length(DoubleDouble::from_turns(from), DoubleDouble::from_turns(to));
        let limit = travel(start, radius / pitch);
        // No board can touch one of the first two from more than two turns away without touching one before it.
        let benches = (travel(start + 2.0, start) / team.link(1)).ceil() as usize + 3;
        let team = Team { benches: benches.min(team.benches), ..*team };
        let path = Path::spiral(pitch, start);
        let singularities = Singularities::search(&path, &team, &mut Budget::new(TRIAL_BUDGET, &mut |_| ()));
        Self { team, path, singularities, limit }
    }

    fn advancement(&self) -> ConservativeAdvancement<'_> {
        let Singularities { head_turns, body_turns, .. } = &self.singularities;
        ConservativeAdvancement::new(&self.path, &self.team, head_turns, body_turns)
    }

    fn locks(&self) -> bool {
        let end = self.singularities.end;
        end.is_some_and(|end| end.kind == EventKind::Lock && end.travelled < self.limit)
    }

    /// What keeps the head from the radius, if anything does.
    fn obstacle(&self) -> Result<Option<Obstacle>, PlanError> {
        if self.locks() {
            return Ok(Some(Obstacle::Lock));
        }
        let pitch = TAU * self.radius_per_radian();
        let given_up = || PlanError(format!("at a pitch of {pitch:.9} m the search for overlapping boards gave up"));
        let least = self
            .advancement()
            .least_clearance(0.0, self.limit, &mut Budget::new(TRIAL_BUDGET, &mut |_| ()))
            .map_err(|_| given_up())?;
        if least.searched_until < self.limit {
            return Err(given_up());
        }
        let touch = least.value.filter(|touch: &LeastClearance| touch.value <= 0.0);
        Ok(touch.map(|touch| Obstacle::Touch {
            pair: (touch.bench_a, touch.bench_b),
            before: self.limit - touch.travelled,
        }))
    }

    fn radius_per_radian(&self) -> f64 {
        self.path.as_spiral().map_or(f64::NAN, |(spiral, _)| spiral.radius_per_radian())
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
        let around = WINDOW * self.team.shortest_link();
        let (advancement, at) = (self.advancement(), (self.limit - before).max(0.0));
        let parts = [((at - around).max(0.0), at), (at, (at + around).min(self.limit))];
        let nearest = parts.map(|(from, to)| advancement.minimum_of(pair, from, to));
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

/// How densely the show is sampled for its fastest handle at most, as a share of the shortest link.
const SPEED_STEP: f64 = 0.01;

/// How much of a rear cosine a step may take: near its singular configuration, where that is 0, a link's rear handle is
/// nearly as fast as the inverse of what is left.
const SINGULAR_SHARE: f64 = 0.1;

/// Peaks of the samples down to this share of the highest are refined: between two samples a speed grows by less.
const PEAK_SHARE: f64 = 0.5;

/// Links solved before the search for the fastest handle gives up: some ten seconds.
const SPEED_BUDGET: u64 = 20_000_000;

/// The greatest constant speed of the head at which no handle ever goes faster than `limit` metres per second, from the
/// scene's start until its show freezes. `progress` is called now and then with the share of the work that is done, from
/// 0 to 1.
///
/// A handle's speed over the head's depends on the head's place alone. It is sampled every hundredth of a link, and more
/// densely where a link comes near its singular configuration, so that no speed can double between two samples; every
/// peak that comes within half of the highest is followed to its top. That a handle has one peak between two samples is
/// taken for granted, not proven.
///
/// # Errors
/// A show that runs into a lock, near which speeds have no bound, and one that is too long to be searched.
pub fn greatest_speed(
    scene: &Scene,
    timeline: &Timeline,
    limit: f64,
    progress: &mut dyn FnMut(f64),
) -> Result<GreatestSpeed, PlanError> {
    let freeze = timeline.freeze(scene.stops_at_contact());
    if freeze.event.kind == EventKind::Lock {
        return Err(PlanError(format!(
            "the show runs into a lock at {:.9} s, and near it a handle goes faster than any limit",
            freeze.time
        )));
    }
    let motion = &scene.motion;
    let newton = Newton::new(motion.path().clone(), *motion.team(), 1.0, Velocities::Computed);
    let chain = Chain::new(motion.team().handles());
    let to = freeze.event.travelled;
    let mut search = Fastest {
        newton,
        chain,
        team: *motion.team(),
        max_curvature: motion.path().max_curvature_between(-motion.team().length(), to),
    };
    let Peak { ratio, travelled, handle } = search.highest(to, progress).map_err(|reached| {
        let until = motion.time_at(reached.travelled);
        PlanError(format!(
            "the show is too long to be searched for its fastest handle: up to {until:.3} s of {:.3} s it was {:.6} times as fast \
             as the head",
            freeze.time, reached.ratio
        ))
    })?;
    Ok(GreatestSpeed { value: limit / ratio, time: motion.time_at(travelled), handle: handle as u32, ratio })
}

/// A handle's speed over the head's, and where the head is.
#[derive(Debug, Clone, Copy)]
struct Peak {
    ratio: f64,
    travelled: f64,
    handle: usize,
}

/// Speeds over the head's, anywhere on a path.
struct Fastest {
    newton: Newton,
    chain: Chain,
    team: Team,
    /// The greatest curvature of the path where the team goes, 1/m.
    max_curvature: f64,
}

impl Fastest {
    /// The highest speed up to a distance of travel.
    ///
    /// # Errors
    /// The highest so far where the budget is spent; its travel is how far the search came.
    fn highest(&mut self, to: f64, progress: &mut dyn FnMut(f64)) -> Result<Peak, Peak> {
        let mut samples = [self.sample(0.0); 3];
        let mut best = samples[2];
        let mut solved = 0;
        while samples[2].travelled < to {
            let next = (samples[2].travelled + self.step()).max(samples[2].travelled.next_up());
            samples = [samples[1], samples[2], self.sample(next.min(to))];
            let [before, middle, after] = samples;
            if after.ratio > best.ratio {
                best = after;
            }
            // Where nothing is faster than the head, there is no peak to follow.
            let peak = middle.ratio >= before.ratio && middle.ratio >= after.ratio;
            if peak && middle.ratio > (PEAK_SHARE * best.ratio).max(1.0) {
                best = self.refined(samples, best);
            }
            solved += self.chain.handles() as u64;
            if solved > SPEED_BUDGET {
                return Err(Peak { travelled: after.travelled, ..best });
            }
            progress(after.travelled / to);
        }
        Ok(best)
    }

    /// How far the head may go from the latest sample to the next.
    ///
    /// A link of length L whose handles go at v and v' turns by at most (v + v') / L, the tangent at its rear handle by k
    /// v', k being the greatest curvature; so the rear cosine changes by no more than both together.
    fn step(&self) -> f64 {
        let Chain { heading, speed, vx, vy, .. } = &self.chain;
        let steps = (0..self.team.benches).map(|bench| {
            let (sine, cosine) = heading[bench].sin_cos();
            let (front, rear) = (speed[bench].abs(), speed[bench + 1].abs());
            let rear_cosine = ((cosine * vx[bench + 1] + sine * vy[bench + 1]) / rear).abs();
            SINGULAR_SHARE * rear_cosine / ((front + rear) / self.team.link(bench) + self.max_curvature * rear)
        });
        // A handle that stands still has no direction: the minimum passes over what is not a number.
        steps.fold(SPEED_STEP * self.team.shortest_link(), f64::min)
    }

    /// The higher of `best` and the peaks of the handles that are fastest at three successive samples.
    fn refined(&mut self, samples: [Peak; 3], best: Peak) -> Peak {
        let [before, _, after] = samples.map(|sample| sample.travelled);
        let mut handles = samples.map(|sample| sample.handle).to_vec();
        handles.dedup();
        handles.into_iter().fold(best, |best, handle| {
            let (least, travelled) = golden_section_min(|at| -self.speed(handle, at), before, after);
            if -least > best.ratio { Peak { ratio: -least, travelled, handle } } else { best }
        })
    }

    /// The fastest handle with the head at one place; a place without a solution, which only the last digit before a lock
    /// can be, has none.
    fn sample(&mut self, travelled: f64) -> Peak {
        let none = Peak { ratio: 0.0, travelled, handle: 0 };
        if self.newton.solve_at(travelled, &mut self.chain).is_err() {
            return none;
        }
        let speeds = self.chain.speed.iter().map(|speed| speed.abs()).zip(0..);
        speeds.fold(
            none,
            |best, (ratio, handle)| if ratio > best.ratio { Peak { ratio, travelled, handle } } else { best },
        )
    }

    fn speed(&mut self, handle: usize, travelled: f64) -> f64 {
        let solved = self.newton.solve_at(travelled, &mut self.chain);
        solved.map_or(0.0, |()| self.chain.speed[handle].abs())
    }
}
