//! What keeps a team from a radius on a spiral of one pitch, by the ordinary search, which samples: it tells the proofs
//! of [`super::pitch`] where to look.

use crate::pitch::clear_beyond;
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::contact::{ConservativeAdvancement, LeastClearance};
use bench_dragon_motion::event::Budget;
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::root::bisect_predicate;
use bench_dragon_motion::model::team::Team;
use bench_dragon_motion::singularities::Singularities;

/// Turns outside the radius, or the longest link, within which most teams touch if they ever do.
const TURNS_BEFORE: f64 = 3.0;

/// Turns that a trial begins outside a touch that it follows.
const TURNS_ABOUT: f64 = 1.0;

/// How much the pitch grows at a time while the same two boards are in the way.
const GROWTH: f64 = 1.005;

/// How far about a touch, in links, the same two boards are followed as the pitch grows.
const WINDOW: f64 = 0.3;

/// Units of work for one trial of a pitch: some seconds.
const TRIAL_BUDGET: u64 = 20_000_000;

/// What keeps a head from its radius.
#[derive(Debug, Clone, Copy)]
pub(super) enum Obstacle {
    /// A link locks before.
    Lock,
    /// Two boards overlap, most deeply with the head so many metres from the centre.
    Touch { pair: (u32, u32), head_radius: f64 },
}

/// What keeps a head from its radius with a pitch, if the search finds anything.
pub(super) fn obstacle(team: &Team, pitch: f64, radius: f64) -> Option<Obstacle> {
    let near = Trial::near(team, pitch, radius);
    near.obstacle().or_else(|| {
        // Boards with next to no room between them and the next but one touch in a bend that may be anywhere.
        let outer = clear_beyond(team, pitch, radius)?;
        let far = Trial::new(team, pitch, radius, outer);
        (far.limit > near.limit).then(|| far.obstacle())?
    })
}

/// The least pitch from one on, up to another, with which the search finds nothing in the way; `None` if there is none.
///
/// Each time something is, the two boards that overlap most deeply are followed near that place, in steps of half a
/// percent of the pitch, until they come free: so pitches that will do are passed over where the two come free and meet
/// again within one step. `progress` is called now and then.
pub(super) fn free_from(
    team: &Team,
    (from, to): (f64, f64),
    radius: f64,
    progress: &mut dyn FnMut(f64),
) -> Option<f64> {
    let mut pitch = from;
    while let Some(obstacle) = obstacle(team, pitch, radius) {
        let free = |pitch: f64| !obstacle.blocks(team, pitch, radius);
        while !free(pitch * GROWTH) {
            pitch *= GROWTH;
            if pitch > to {
                return None;
            }
        }
        // Beyond the rounding of a touch.
        pitch = bisect_predicate(free, pitch, pitch * GROWTH) * (1.0 + 1e-13);
        progress(pitch);
    }
    (pitch <= to).then_some(pitch)
}

impl Obstacle {
    /// Returns true if an obstacle of another pitch is one of this pitch too.
    fn blocks(&self, team: &Team, pitch: f64, radius: f64) -> bool {
        match *self {
            Self::Lock => Trial::near(team, pitch, radius).locks(),
            Self::Touch { pair, head_radius } => deepest(team, pitch, radius, pair, head_radius).0 <= 0.0,
        }
    }
}

/// The least clearance of two boards while the head is near a radius, and the head's radius then.
pub(super) fn deepest(team: &Team, pitch: f64, radius: f64, pair: (u32, u32), head_radius: f64) -> (f64, f64) {
    let trial = Trial::new(team, pitch, radius, head_radius.max(radius) + TURNS_ABOUT * pitch);
    let around = WINDOW * trial.team.shortest_link();
    let at = trial.path.length() - Path::spiral(pitch, head_radius / pitch).length();
    let (advancement, at) = (trial.advancement(), at.clamp(0.0, trial.limit));
    let parts = [((at - around).max(0.0), at), (at, (at + around).min(trial.limit))];
    let nearest = parts.map(|(from, to)| advancement.minimum_of(pair, from, to));
    let (clearance, travelled) = if nearest[0].0 <= nearest[1].0 { nearest[0] } else { nearest[1] };
    // Never by rounding inside the radius.
    (clearance, trial.head_radius(travelled).max(radius * (1.0 + 1e-12)))
}

/// The foremost part of a team that comes in on a spiral of one pitch to a radius.
struct Trial {
    team: Team,
    path: Path,
    singularities: Singularities,
    /// Metres of travel at which the radius is reached.
    limit: f64,
}

impl Trial {
    fn near(team: &Team, pitch: f64, radius: f64) -> Self {
        Self::new(team, pitch, radius, radius.max(team.longest_link()) + TURNS_BEFORE * pitch)
    }

    /// A head that comes in from `outer` metres to `radius` metres.
    fn new(team: &Team, pitch: f64, radius: f64, outer: f64) -> Self {
        let start = outer / pitch;
        let path = Path::spiral(pitch, start);
        let length = |turns: f64| Path::spiral(pitch, turns).length();
        let limit = path.length() - length(radius / pitch);
        // No board can touch one of the first two from more than two turns away without touching one before it.
        let benches = ((length(start + 2.0) - path.length()) / team.link(1)).ceil() as usize + 3;
        let team = Team { benches: benches.min(team.benches), ..*team };
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

    fn head_radius(&self, travelled: f64) -> f64 {
        self.path.point(self.path.param_at(travelled)).coords.norm()
    }

    /// What keeps the head from the radius, if the search finds anything.
    fn obstacle(&self) -> Option<Obstacle> {
        if self.locks() {
            return Some(Obstacle::Lock);
        }
        let least =
            self.advancement().least_clearance(0.0, self.limit, &mut Budget::new(TRIAL_BUDGET, &mut |_| ())).ok()?;
        let touch = least.value.filter(|touch: &LeastClearance| touch.value <= 0.0)?;
        let head_radius = self.head_radius(touch.travelled);
        Some(Obstacle::Touch { pair: (touch.bench_a, touch.bench_b), head_radius })
    }
}
