//! Obstacles of a team on a spiral of one pitch, found by the ordinary search, which samples. They suggest to the
//! proofs of [`super::pitch`] where to search.

use crate::pitch::clear_beyond;
use crate::spaced::Spaced;
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::contact::{ConservativeAdvancement, LeastClearance};
use bench_dragon_motion::event::{Budget, Progress};
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::root::bisect_predicate;
use bench_dragon_motion::model::team::Team;
use bench_dragon_motion::singularities::Singularities;

/// The number of turns outside the radius, or outside the longest link, within which most teams touch if they ever do.
const TURNS_BEFORE: f64 = 3.0;

/// The number of turns outside a touch at which the trial that follows it starts.
const TURNS_ABOUT: f64 = 1.0;

/// The factor of the pitch from one trial to the next while the same two boards touch.
const GROWTH: f64 = 1.005;

/// The distance from a touch, in links, within which the same two boards are followed.
const WINDOW: f64 = 0.3;

/// Work for one trial of a pitch, in units of [`Budget`]: some seconds.
const TRIAL_BUDGET: u64 = 20_000_000;

/// The reason why a head does not reach its radius.
#[derive(Debug, Clone, Copy)]
pub(super) enum Obstacle {
    /// A link locks before.
    Lock,
    /// Two boards overlap or are too near, most with the head `head_radius` metres from the centre.
    Touch { pair: (u32, u32), head_radius: f64 },
}

/// Returns the obstacle for a head with this pitch and radius, if the search finds one.
pub(super) fn obstacle(asked: Spaced<'_>, pitch: f64, radius: f64, progress: Progress<'_>) -> Option<Obstacle> {
    let near = Trial::near(asked, pitch, radius, progress);
    near.obstacle(progress).or_else(|| {
        if progress(pitch).is_break() {
            return None;
        }
        // Boards with almost no room between them and the next but one touch in a bend that may be anywhere.
        let outer = clear_beyond(asked, pitch, radius)?;
        let far = Trial::new(asked, pitch, radius, outer, progress);
        (far.limit > near.limit).then(|| far.obstacle(progress))?
    })
}

/// The least pitch that the search proposes, and obstacles of lesser pitches.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Proposal {
    /// The least pitch of the range with which the search finds no obstacle, metres per turn; `None` if there is none.
    pub pitch: Option<f64>,
    /// The obstacle of the least pitch of the range.
    pub first: Option<Obstacle>,
    /// The obstacle that ends at `pitch`.
    pub last: Option<Obstacle>,
}

/// Returns the least pitch between two with which the search finds no obstacle.
///
/// At an obstacle, the two boards that overlap most deeply are followed near that place until they come free. Because
/// the pitch grows in steps of half a percent, a pitch is missed if the two boards come free and meet again within one
/// step. `progress` receives each pitch.
pub(super) fn free_from(asked: Spaced<'_>, (from, to): (f64, f64), radius: f64, progress: Progress<'_>) -> Proposal {
    let (mut pitch, mut proposal) = (from, Proposal::default());
    while let Some(mut found) = obstacle(asked, pitch, radius, &mut |_| progress(pitch)) {
        proposal.first.get_or_insert(found);
        while let Some(next) = found.at_pitch(asked, pitch * GROWTH, radius, &mut |_| progress(pitch)) {
            (found, pitch) = (next, pitch * GROWTH);
            if pitch > to {
                return Proposal { last: None, ..proposal };
            }
        }
        if progress(pitch).is_break() {
            break;
        }
        proposal.last = Some(found);
        let free_at = match found {
            Obstacle::Lock => {
                let mut is_free = |pitch| found.at_pitch(asked, pitch, radius, &mut |_| progress(pitch)).is_none();
                bisect_predicate(&mut is_free, pitch, pitch * GROWTH)
            }
            Obstacle::Touch { pair, head_radius } => {
                let clearance = |pitch: f64| {
                    deepest(asked, pitch, radius, &[pair], head_radius, &mut |_| progress(pitch)).clearance
                };
                sign_change(clearance, pitch, pitch * GROWTH)
            }
        };
        // Beyond the rounding of a touch.
        pitch = free_at * (1.0 + 1e-13);
        if progress(pitch).is_break() {
            break;
        }
    }
    Proposal { pitch: (pitch <= to).then_some(pitch), ..proposal }
}

/// Returns the place within `low..=high` where a function becomes positive, to the last bits: the least place known to
/// have a positive value. The function must be at most 0 at `low` and positive at `high`. Illinois method (Dowell and
/// Jarratt, 1971).
fn sign_change(mut function: impl FnMut(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let (mut below, mut above) = (function(low), function(high));
    let mut last_side = 0;
    while high - low > 4.0 * f64::EPSILON * high {
        let secant = high - above * (high - low) / (above - below);
        // Rounding must not leave the bracket.
        let at = if secant > low && secant < high { secant } else { 0.5 * low + 0.5 * high };
        let value = function(at);
        let side = if value > 0.0 { 1 } else { -1 };
        if side > 0 {
            (high, above) = (at, value);
            below *= if last_side == side { 0.5 } else { 1.0 };
        } else {
            (low, below) = (at, value);
            above *= if last_side == side { 0.5 } else { 1.0 };
        }
        if value == 0.0 {
            break;
        }
        last_side = side;
    }
    high
}

impl Obstacle {
    /// Returns the obstacle near the same place at another pitch, if there still is one.
    fn at_pitch(self, asked: Spaced<'_>, pitch: f64, radius: f64, progress: Progress<'_>) -> Option<Self> {
        match self {
            Self::Lock => Trial::near(asked, pitch, radius, progress).locks().then_some(self),
            Self::Touch { pair, head_radius } => {
                let Nearest { clearance, head_radius, .. } =
                    deepest(asked, pitch, radius, &[pair], head_radius, progress);
                (clearance <= 0.0).then_some(Self::Touch { pair, head_radius })
            }
        }
    }
}

/// The least clearance of two boards while the head is near a radius.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest {
    /// The metres by which the clearance is more than required, negative for boards that are too near.
    pub clearance: f64,
    /// The two benches, counted from 0.
    pub pair: (u32, u32),
    /// The distance of the head from the centre at that moment, in metres.
    pub head_radius: f64,
}

/// Returns the least clearance of several pairs of boards, at least one, while the head is near a radius.
pub(super) fn deepest(
    asked: Spaced<'_>,
    pitch: f64,
    radius: f64,
    pairs: &[(u32, u32)],
    head_radius: f64,
    progress: Progress<'_>,
) -> Nearest {
    let trial = Trial::new(asked, pitch, radius, head_radius.max(radius) + TURNS_ABOUT * pitch, progress);
    let mut budget = Budget::new(u64::MAX, progress);
    let around = WINDOW * trial.team.shortest_link();
    let at = trial.path.length() - Path::spiral(pitch, head_radius / pitch).length();
    let (advancement, at) = (trial.advancement(), at.clamp(0.0, trial.limit));
    let parts = [((at - around).max(0.0), at), (at, (at + around).min(trial.limit))];
    let mut least = Nearest { clearance: f64::INFINITY, pair: pairs[0], head_radius };
    for pair in pairs.iter().filter(|pair| pair.1 < trial.team.benches as u32) {
        for (from, to) in parts {
            let (clearance, travelled) = advancement.minimum_of(*pair, (from, to), &mut budget);
            let clearance = clearance - asked.clearance;
            if clearance < least.clearance {
                // Rounding must not move the head inside the radius.
                let head_radius = trial.head_radius(travelled).max(radius * (1.0 + 1e-12));
                least = Nearest { clearance, pair: *pair, head_radius };
            }
        }
    }
    least
}

/// The foremost part of a team that comes in to a radius on a spiral of one pitch.
struct Trial {
    team: Team,
    /// The required clearance, in metres.
    clearance: f64,
    path: Path,
    singularities: Singularities,
    /// The travel at which the radius is reached, in metres.
    limit: f64,
}

impl Trial {
    fn near(asked: Spaced<'_>, pitch: f64, radius: f64, progress: Progress<'_>) -> Self {
        let outer = radius.max(asked.team.longest_link()) + TURNS_BEFORE * pitch;
        Self::new(asked, pitch, radius, outer, progress)
    }

    /// Creates the trial of a head that comes in from `outer` metres to `radius` metres.
    fn new(asked: Spaced<'_>, pitch: f64, radius: f64, outer: f64, progress: Progress<'_>) -> Self {
        let Spaced { team, clearance } = asked;
        let start = outer / pitch;
        let path = Path::spiral(pitch, start);
        let length = |turns: f64| Path::spiral(pitch, turns).length();
        let limit = path.length() - length(radius / pitch);
        // A board that touches one of the first two from more than two turns away also touches a board before it.
        let benches = ((length(start + 2.0) - path.length()) / team.link(1)).ceil() as usize + 3;
        // No other board touches where only a tail with a size of its own does.
        let team = if team.own_tail().is_some() { *team } else { team.foremost(benches) };
        // A link turns round or locks only where the spiral is narrower than the link is long.
        let singularities = if radius > team.longest_link() {
            Singularities::none(limit)
        } else {
            Singularities::search(&path, &team, &mut Budget::new(TRIAL_BUDGET, progress))
        };
        Self { team, clearance, path, singularities, limit }
    }

    fn advancement(&self) -> ConservativeAdvancement<'_> {
        let Singularities { head_turns, body_turns, tail_turns, .. } = &self.singularities;
        ConservativeAdvancement::new(&self.path, &self.team, head_turns, body_turns).with_tail_turns(tail_turns)
    }

    fn locks(&self) -> bool {
        let end = self.singularities.end;
        end.is_some_and(|end| end.kind == EventKind::Lock && end.travelled < self.limit)
    }

    fn head_radius(&self, travelled: f64) -> f64 {
        self.path.point(self.path.param_at(travelled)).coords.norm()
    }

    /// Returns the obstacle that the search finds, if any.
    fn obstacle(&self, progress: Progress<'_>) -> Option<Obstacle> {
        if self.locks() {
            return Some(Obstacle::Lock);
        }
        let mut budget = Budget::new(TRIAL_BUDGET, progress);
        let least = self.advancement().least_clearance(0.0, self.limit, &mut budget).ok()?;
        let touch = least.value.filter(|touch: &LeastClearance| touch.value <= self.clearance)?;
        let head_radius = self.head_radius(touch.travelled);
        Some(Obstacle::Touch { pair: (touch.bench_a, touch.bench_b), head_radius })
    }
}
