//! The frames of a scene with several dragons: one chain of all, and the nearest boards of any two.
//!
//! In: the scene and a time of the show. Out: the chain on the stage, the handles of all dragons one after the other,
//! and its clearance. The show calls it in place of its one solver.

use std::ops::Range;

use crate::placed;
use crate::scene::Scene;
use crate::solve_at_or_just_before;
use bench_dragon_motion::clearance::{BetweenMonitor, ClearanceMonitor, ObstacleMonitor, PairClearance};
use bench_dragon_motion::ensemble::{Dragon, Ensemble};
use bench_dragon_motion::linkage::NoFollower;
use bench_dragon_motion::model::team::Team;
use bench_dragon_motion::solve::{Chain, Solver};

/// One dragon in play.
struct Dancer {
    dragon: Dragon,
    /// Solves in the path's own coordinates, where the clearance has more digits.
    solver: Box<dyn Solver>,
    clearance: Option<ClearanceMonitor>,
    obstacles: Option<ObstacleMonitor>,
    handles: Range<usize>,
    chain: Chain,
    /// The own time solved, and true if it moved then.
    solved: Option<(f64, bool)>,
    /// The nearest two of its boards, and a board that is nearer to an obstacle, on the stage.
    boards: Option<PairClearance>,
    obstacle: Option<PairClearance>,
}

/// All dragons of a show in play.
pub(crate) struct Several {
    dancers: Vec<Dancer>,
    between: Option<BetweenMonitor>,
    /// The names of the solvers and the reasons for their choice.
    pub reason: String,
    /// Greatest error of a clearance that is no contact, metres.
    pub clearance_error: f64,
}

/// The nearest boards of a frame.
pub(crate) struct Closest {
    /// The nearest two boards that share no handle.
    pub boards: Option<PairClearance>,
    /// The same, or a board that is nearer to an obstacle.
    pub any: Option<PairClearance>,
}

impl Several {
    pub(crate) fn new(scene: &Scene, ensemble: &Ensemble) -> Self {
        let (mut reasons, mut clearance_error) = (Vec::new(), 0.0f64);
        let mut dancers = Vec::with_capacity(ensemble.dragons().len());
        for (k, dragon) in ensemble.dragons().iter().enumerate() {
            let own = dragon.motion.in_own_frame();
            let choice = own.solver(scene.velocities);
            clearance_error = clearance_error.max(choice.clearance_error(own.team()));
            reasons.push(format!("of {}: {}", dragon.name, choice.reason));
            dancers.push(Dancer {
                clearance: scene.alerts.map(|_| own.clearance_monitor(&choice)),
                obstacles: scene.alerts.and_then(|_| own.obstacle_monitor(&choice)),
                handles: ensemble.handles_of(k),
                chain: Chain::new(own.team().handles()),
                solved: None,
                boards: None,
                obstacle: None,
                solver: choice.solver,
                dragon: dragon.clone(),
            });
        }
        let teams: Vec<Team> = ensemble.dragons().iter().map(|dragon| *dragon.motion.team()).collect();
        let tolerance = ensemble.dragons().iter().map(|dragon| dragon.motion.link_tolerance()).fold(1e-9, f64::max);
        let between = scene.alerts.map(|_| BetweenMonitor::new(&teams, tolerance));
        Self { dancers, between, reason: reasons.join("; "), clearance_error }
    }

    /// Returns the pairs of boards tested so far.
    pub(crate) fn pairs_tested(&self) -> u64 {
        let own = self.dancers.iter().filter_map(|dancer| dancer.clearance.as_ref());
        let between = self.between.as_ref().map_or(0, BetweenMonitor::pairs_tested);
        own.map(|monitor| monitor.counters().pairs).sum::<u64>() + between
    }

    /// Fills `chain` with all dragons at a time of the show. `moves` is false while the show stands still.
    pub(crate) fn solve(&mut self, show_time: f64, moves: bool, chain: &mut Chain) -> Result<Closest, NoFollower> {
        let all_handles = chain.handles();
        for dancer in &mut self.dancers {
            dancer.solve(show_time, moves, all_handles, chain)?;
        }
        let nearer = |one: Option<PairClearance>, other: Option<PairClearance>| match (one, other) {
            (Some(one), Some(other)) if other.value < one.value => Some(other),
            (one, other) => one.or(other),
        };
        let own = self.dancers.iter().map(|dancer| dancer.boards).fold(None, nearer);
        let between = self
            .between
            .as_mut()
            .and_then(|monitor| monitor.nearest(chain, own.map_or(f64::INFINITY, |own| own.value)));
        let boards = nearer(own, between);
        let any = self.dancers.iter().map(|dancer| dancer.obstacle).fold(boards, nearer);
        Ok(Closest { boards, any })
    }
}

impl Dancer {
    /// Solves the dragon and puts it in its place of the chain of all. One that stands is solved once.
    fn solve(&mut self, show_time: f64, moves: bool, all_handles: usize, chain: &mut Chain) -> Result<(), NoFollower> {
        let (own_time, dances) = self.dragon.own_time(show_time);
        let state = (own_time, dances && moves);
        if self.solved == Some(state) {
            return Ok(());
        }
        self.solved = None;
        let solved_at = solve_at_or_just_before(self.solver.as_mut(), own_time, &mut self.chain)?;
        self.measure(solved_at, all_handles);
        self.dragon.motion.placement().chain(&mut self.chain);
        if !state.1 {
            self.chain.stand();
        }
        chain.put(self.handles.start, &self.chain);
        self.solved = Some(state);
        Ok(())
    }

    fn measure(&mut self, solved_at: f64, all_handles: usize) {
        let motion = &self.dragon.motion;
        let travelled = motion.travelled_at(solved_at);
        let Some(clearance) = &mut self.clearance else { return };
        let (first, own_handles) = (self.handles.start, self.handles.len());
        let boards = clearance.least_clearance(&self.chain, travelled);
        let limit = boards.map_or(f64::INFINITY, |boards| boards.value);
        let numbered = |pair: PairClearance| {
            let PairClearance { bench_a, bench_b, .. } = pair;
            let bench_b = if bench_b < own_handles { bench_b + first } else { bench_b - own_handles + all_handles };
            PairClearance { bench_a: bench_a + first, bench_b, ..placed(motion.placement(), pair) }
        };
        self.boards = boards.map(numbered);
        let obstacles = self.obstacles.as_mut();
        self.obstacle = obstacles.and_then(|monitor| monitor.nearest(&self.chain, travelled, limit)).map(numbered);
    }
}
