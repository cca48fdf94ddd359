//! Answers for the choreographer: the least pitch with which a team still reaches a radius, and the greatest speed at
//! which no handle is too fast.
//!
//! In: a team or a scene. Out: one number with where it is decided. The `plan` command prints them.

mod enclosure;

use std::f64::consts::TAU;

pub use enclosure::{PitchEnclosure, enclose_least_pitch};

use crate::model::Point;
use crate::model::board::Board;
use crate::model::curve::Curve;
use crate::model::double_double::DoubleDouble;
use crate::model::path::Path;
use crate::model::root::bisect_predicate;
use crate::model::separation::signed_distance_board_board;
use crate::model::spiral::{Direction, Spiral};
use crate::model::team::Team;
use crate::motion::contact::{ConservativeAdvancement, LeastClearance};
use crate::motion::event::{Budget, EventKind};
use crate::motion::singularities::Singularities;
use crate::scene::Accepted;

mod speed;

pub use speed::{GreatestSpeed, greatest_speed};

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
