//! One dragon in play: from its own time to its chain on the stage, with the nearest of its boards.
//!
//! In: a motion and its own time. Out: the chain and its clearance.

use crate::scene::Scene;
use bench_dragon_motion::clearance::{ClearanceMonitor, FrameClearance, PairClearance};
use bench_dragon_motion::linkage::NoFollower;
use bench_dragon_motion::placement::Placement;
use bench_dragon_motion::solve::{Chain, ChainMut, Positions, Solver, Velocities};
use bench_dragon_motion::{Choice, Motion};

/// One dragon in play.
pub(crate) struct Dancer {
    /// Solves in the path's own coordinates, where the clearance has more digits.
    solver: Box<dyn Solver>,
    velocities: Velocities,
    clearance: Option<ClearanceMonitor>,
    placement: Placement,
    /// The own time of the latest solution, and true if the dragon moved then.
    pub solved: Option<(f64, bool)>,
    /// The name of the solver and the reason for its choice.
    pub reason: String,
    /// The greatest error of a clearance, in metres.
    pub clearance_error: f64,
}

/// The nearest boards of a frame.
#[derive(Clone, Copy)]
pub(crate) struct Closest {
    /// The nearest two boards that share no handle.
    pub boards: Option<PairClearance>,
    /// The nearest two boards that share no handle, or a board and an obstacle that are nearer.
    pub any: Option<PairClearance>,
}

impl Dancer {
    /// Returns the solver of a motion's frames.
    pub(crate) fn choice(scene: &Scene, motion: &Motion) -> Choice {
        motion.in_own_frame().solver(scene.velocities)
    }

    /// Creates the dragon of `motion`, with velocities and clearances if the scene requests them.
    pub(crate) fn new(scene: &Scene, motion: &Motion, choice: Choice) -> Self {
        let own = motion.in_own_frame();
        Self {
            velocities: scene.velocities,
            clearance: scene.alerts.map(|_| own.clearance_monitor(&choice)),
            placement: *motion.placement(),
            solved: None,
            clearance_error: choice.clearance_error(own.team()),
            reason: choice.reason,
            solver: choice.solver,
        }
    }

    /// Returns the pairs of boards tested so far.
    pub(crate) fn pairs_tested(&self) -> u64 {
        self.clearance.as_ref().map_or(0, |monitor| monitor.counters().pairs)
    }

    /// Fills `chain` with the dragon on the stage at `time`, its own time, and measures its clearance. `moves` is false
    /// while the dragon stands: its velocities are then 0. Without a solution `chain` has the latest solution.
    pub(crate) fn solve(&mut self, time: f64, moves: bool, chain: &mut ChainMut) -> Result<Closest, NoFollower> {
        let closest = self.solve_once(time, moves, chain);
        if closest.is_ok() {
            self.solved = Some((time, moves));
        } else if let Some((time, moves)) = self.solved {
            // A failed solution leaves the chain unspecified.
            let _ = self.solve_once(time, moves, chain);
        }
        closest
    }

    fn solve_once(&mut self, time: f64, moves: bool, chain: &mut ChainMut) -> Result<Closest, NoFollower> {
        let solved_at = solve_in_at_or_just_before(self.solver.as_mut(), time, chain);
        let closest = solved_at.map(|solved_at| self.measure(solved_at, chain.positions()));
        if closest.is_ok() {
            self.placement.chain(chain);
        }
        if !moves && self.velocities == Velocities::Computed {
            let ChainMut { speed, vx, vy, .. } = chain;
            [speed, vx, vy].into_iter().for_each(|numbers| numbers.fill(0.0));
        }
        closest
    }

    fn measure(&mut self, solved_at: f64, chain: Positions) -> Closest {
        let Some(clearance) = &mut self.clearance else { return Closest { boards: None, any: None } };
        let placed = |PairClearance { value, bench_a, bench_b, point_a, point_b }| {
            let [point_a, point_b] = [point_a, point_b].map(|point| self.placement.point(point));
            PairClearance { value, bench_a, bench_b, point_a, point_b }
        };
        let FrameClearance { boards, obstacle } =
            clearance.nearest(chain, solved_at, f64::INFINITY, self.solver.as_mut());
        let boards = boards.map(placed);
        Closest { boards, any: obstacle.map(placed).or(boards) }
    }

    /// Fills `chain` with the positions on the stage at a later time, its own time. Later solutions stay the same.
    pub(crate) fn solve_ahead(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        self.solver.solve_ahead(time, chain)?;
        self.placement.chain(chain);
        Ok(())
    }
}

/// Solves at `time`, or at the latest earlier time with a solution. Returns that time.
///
/// Two cases need an earlier time, by at most 1e-4 of the time. The time of a lock multiplied by the speed can lie past
/// the lock by the last digit. The paper's solver is ahead by one of its own time steps.
///
/// # Errors
/// [`NoFollower`] if there is none so near. `chain` is then unspecified.
pub fn solve_at_or_just_before(solver: &mut dyn Solver, time: f64, chain: &mut Chain) -> Result<f64, NoFollower> {
    solve_in_at_or_just_before(solver, time, &mut chain.all_mut())
}

fn solve_in_at_or_just_before(solver: &mut dyn Solver, time: f64, chain: &mut ChainMut) -> Result<f64, NoFollower> {
    let mut back = f64::EPSILON * time;
    let mut at = time;
    while let Err(none) = solver.solve_in(at, chain) {
        at = time - back;
        back *= 2.0;
        // Also ends for NaN and for a time of 0.
        if !(back > 0.0 && back <= 1e-4 * time) {
            return Err(none);
        }
    }
    Ok(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A solver that writes the time into every handle, and has no solution after 10 s.
    struct EndsAtTen;

    impl Solver for EndsAtTen {
        fn name(&self) -> &'static str {
            "ends_at_ten"
        }

        fn solve_in(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
            chain.x.fill(time);
            if time > 10.0 { Err(NoFollower) } else { Ok(()) }
        }
    }

    #[test]
    fn a_frame_without_a_solution_has_the_latest_solution() {
        let scene = Scene::paper();
        let motion = scene.ensemble.only().unwrap();
        let whole = Dancer::new(&scene, motion, Dancer::choice(&scene, motion));
        let mut dancer = Dancer { solver: Box::new(EndsAtTen), clearance: None, ..whole };
        let mut chain = Chain::new(scene.ensemble.handles());
        assert!(dancer.solve(3.0, true, &mut chain.all_mut()).is_ok());
        for time in [20.0, 21.0] {
            assert!(dancer.solve(time, true, &mut chain.all_mut()).is_err());
            assert!(chain.x.iter().all(|x| *x == 3.0), "{:?}", chain.x);
        }
    }
}
