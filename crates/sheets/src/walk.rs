//! [`Walk`]: every bench followed through a show.
//!
//! In: a scene, its events and the least clearances that the search has found. Out: when each bench comes to each piece
//! of its path, how fast it goes there, and who is nearest to it, and when. A bench comes to a place when its front
//! handle does.

mod near;

use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::ensemble::Ensemble;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::linkage::follower;
use bench_dragon_motion::model::Point;
use bench_dragon_motion::solve::{Chain, Solver, Velocities};
use bench_dragon_motion::timeline::{TimedClearance, TimedObstacleClearance, Timeline};
use bench_dragon_show::scene::Scene;
use bench_dragon_show::{ReachedCue, solve_at_or_just_before, timed_cues};

use near::Nearest;
pub use near::{Near, Side};

use crate::piece::{Piece, pieces};

/// The greatest number of benches of a show that has sheets.
pub const MOST_BENCHES: usize = 5000;

/// The metres that the fastest head goes between two samples, if the show is not too long.
const STEP: f64 = 0.1;
/// The greatest number of samples of a show.
const MOST_SAMPLES: f64 = 20_000.0;
/// The seconds between two marks of a trail, and the number of marks above which they are doubled.
const MARK: f64 = 15.0;
const MOST_MARKS: f64 = 40.0;

/// The least clearances that the search of `check` has found, over the whole route.
pub struct Searched<'a> {
    /// Of boards.
    pub boards: Option<TimedClearance>,
    /// Of obstacles.
    pub obstacles: &'a [TimedObstacleClearance],
}

/// An event of the show.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Happening {
    pub time: f64,
    pub kind: EventKind,
    pub bench_a: Option<u32>,
    pub bench_b: Option<u32>,
}

/// A show as its benches walk it.
pub struct Walk<'a> {
    pub(crate) scene: &'a Scene,
    /// The time at which the show ends.
    pub(crate) end: f64,
    /// The seconds between two marks of a trail.
    pub(crate) mark: f64,
    pub(crate) dragons: Vec<DragonWalk>,
    pub(crate) events: Vec<Happening>,
    pub(crate) cues: Vec<ReachedCue>,
}

/// A dragon of the show.
pub(crate) struct DragonWalk {
    pub pieces: Vec<Piece>,
    pub benches: Vec<BenchWalk>,
}

/// A bench of the show.
#[derive(Debug, Clone, Default)]
pub(crate) struct BenchWalk {
    /// The metres of travel of its front handle at the start.
    pub start: f64,
    /// The metres of travel of its front handle at the end.
    pub end: f64,
    /// The pieces that it walks, in order.
    pub stretches: Vec<Stretch>,
    /// The middle of the bench at each sample, for the benches that are drawn.
    pub trail: Vec<(f64, Point)>,
    /// The nearest board that shares no handle, if one comes near.
    pub board: Option<Near>,
    /// The nearest obstacle.
    pub obstacle: Option<Near>,
}

/// A bench's walk on one piece.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stretch {
    /// The number of the piece.
    pub piece: usize,
    /// The time at which the front handle comes to it; 0 for the piece on which the bench stands at the start.
    pub time: f64,
    /// The least and the greatest speed on it.
    pub speeds: (f64, f64),
}

impl<'a> Walk<'a> {
    /// Follows all benches of a scene until the show ends. The benches that `is_drawn`, by their number in the show,
    /// keep their trail. A walk that `progress` stops is of no use.
    pub fn new(
        scene: &'a Scene,
        timeline: &Timeline,
        searched: &Searched<'_>,
        is_drawn: impl Fn(usize) -> bool,
        progress: Progress<'_>,
    ) -> Self {
        let ensemble = &scene.ensemble;
        let end = timeline.show_end(scene.stops_at_contact()).time;
        let happening = |timed: &bench_dragon_motion::timeline::TimedEvent| {
            let event = timed.event;
            Happening { time: timed.time, kind: event.kind, bench_a: event.bench_a, bench_b: event.bench_b }
        };
        let events = timeline.all().iter().map(happening).filter(|event| event.time <= end).collect();
        let (cues, _) = timed_cues(scene, timeline);
        let dragon = |k: usize| DragonWalk {
            pieces: pieces(&ensemble.dragons()[k].motion),
            benches: vec![BenchWalk::default(); ensemble.dragons()[k].motion.team().benches],
        };
        let dragons = (0..ensemble.dragons().len()).map(dragon).collect();
        let mut mark = MARK;
        while end / mark > MOST_MARKS {
            mark *= 2.0;
        }
        let cues = cues.into_iter().filter(|cue| cue.time <= end).collect();
        let mut walk = Self { scene, end, mark, dragons, events, cues };
        walk.follow(searched, &is_drawn, progress);
        walk
    }

    fn follow(&mut self, searched: &Searched<'_>, is_drawn: &dyn Fn(usize) -> bool, progress: Progress<'_>) {
        let ensemble = &self.scene.ensemble;
        // Speeds stand on the sheets, even if the scene publishes none.
        let Some(mut solver) = self.solver(&mut |_| progress(0.0)) else { return };
        let mut chain = Chain::new(ensemble.handles());
        let mut nearest = Nearest::new(ensemble);
        let fastest = ensemble.dragons().iter().map(|dragon| dragon.motion.head_speed()).fold(0.0, f64::max);
        // Marks are samples, so that a trail has its places.
        let step = (STEP / fastest).max(self.end / MOST_SAMPLES).min(self.mark);
        let step = self.mark / (self.mark / step).ceil();
        let samples = (self.end / step).ceil() as usize;
        for sample in 0..=samples {
            let time = (sample as f64 * step).min(self.end);
            let share = 0.7 * sample as f64 / (samples + 1) as f64;
            if progress(share).is_break() || solve_at_or_just_before(solver.as_mut(), time, &mut chain).is_err() {
                break;
            }
            nearest.include(&chain, time);
            for k in 0..self.dragons.len() {
                let first = ensemble.handles_of(k).start;
                self.dragons[k].step(ensemble, k, time, step, &chain);
                for (bench, walk) in self.dragons[k].benches.iter_mut().enumerate().filter(|(i, _)| is_drawn(first + i))
                {
                    walk.trail.push((time, middle(&chain, first + bench)));
                }
            }
        }
        let found =
            nearest.refined(step, self.end, solver.as_mut(), searched, &mut |share| progress(0.7 + 0.3 * share));
        for (k, dragon) in self.dragons.iter_mut().enumerate() {
            let first = ensemble.handles_of(k).start;
            for (bench, walk) in dragon.benches.iter_mut().enumerate() {
                (walk.board, walk.obstacle) = found[first + bench];
            }
        }
    }

    /// Returns the ensemble.
    pub(crate) fn ensemble(&self) -> &'a Ensemble {
        &self.scene.ensemble
    }

    /// Returns the solver of the show, with speeds; `None` if `progress` stops the making of its tables.
    pub(crate) fn solver(&self, progress: Progress<'_>) -> Option<Box<dyn Solver>> {
        self.ensemble().solver_unless_stopped(Velocities::Computed, progress)
    }
}

impl DragonWalk {
    /// Adds a sample: the pieces to which benches have come since the sample before, `step` seconds earlier, and the
    /// speeds.
    fn step(&mut self, ensemble: &Ensemble, dragon: usize, time: f64, step: f64, chain: &Chain) {
        let (first, dragon) = (ensemble.handles_of(dragon).start, &ensemble.dragons()[dragon]);
        let motion = &dragon.motion;
        let (path, team) = (motion.path(), motion.team());
        let mut front = path.param_at(dragon.travelled_at(time));
        for bench in 0..team.benches {
            let travelled = path.travelled(front);
            let walk = &mut self.benches[bench];
            let speed = chain.speed[first + bench];
            if walk.stretches.is_empty() {
                walk.start = travelled;
                let piece = self.pieces.iter().rposition(|piece| travelled >= piece.begin).unwrap_or(0);
                walk.stretches.push(Stretch { piece, time: 0.0, speeds: (f64::INFINITY, f64::NEG_INFINITY) });
            }
            let before = walk.end;
            while let Some(Stretch { piece, .. }) = walk.stretches.last().copied()
                && let Some(next) = self.pieces.get(piece + 1).filter(|next| travelled >= next.begin)
            {
                let share = if travelled > before { (travelled - next.begin) / (travelled - before) } else { 0.0 };
                let time = (time - share * step).max(0.0);
                walk.stretches.push(Stretch { piece: piece + 1, time, speeds: (f64::INFINITY, f64::NEG_INFINITY) });
            }
            if let Some(Stretch { speeds, .. }) = walk.stretches.last_mut() {
                *speeds = (speeds.0.min(speed), speeds.1.max(speed));
            }
            walk.end = travelled;
            let Ok(rear) = follower(path, front, team.link(bench)) else { return };
            front = rear;
        }
    }
}

/// Returns the middle of a bench: the midpoint of its handles.
pub(crate) fn middle(chain: &Chain, bench: usize) -> Point {
    Point::new(0.5 * (chain.x[bench] + chain.x[bench + 1]), 0.5 * (chain.y[bench] + chain.y[bench + 1]))
}
