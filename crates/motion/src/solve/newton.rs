//! The safe solver: exact motion along the arc, in which each follower is found by a bracketed Newton iteration.
//!
//! It is right wherever there is a solution, so every faster solver falls back to it.

use super::{Chain, ChainMut, Solver, Velocities};
use crate::linkage::{NoFollower, follower, link_pose};
use crate::model::Vector;
use crate::model::elementary;
use crate::model::path::{Param, Path};
use crate::model::team::Team;

/// Solves one handle after another along the path, independently of earlier frames.
#[derive(Debug, Clone)]
pub struct Newton {
    path: Path,
    team: Team,
    head_speed: f64,
    velocities: Velocities,
}

impl Newton {
    /// Creates a solver for `team` on `path`, the head moving at `head_speed` metres per second along the curve.
    pub fn new(path: Path, team: Team, head_speed: f64, velocities: Velocities) -> Self {
        Self { path, team, head_speed, velocities }
    }

    /// Fills `chain` with the state when the head has travelled `travelled` metres, independent of the time.
    ///
    /// Speeds come from rigidity: both ends of a link have the same velocity along it,
    /// v_{i+1} (t_{i+1} . b_i) = v_i (t_i . b_i).
    ///
    /// # Errors
    /// [`NoFollower`] if a link is locked; `chain` is then unspecified.
    pub fn solve_at(&self, travelled: f64, chain: &mut Chain) -> Result<(), NoFollower> {
        self.solve_at_in(travelled, &mut chain.all_mut())
    }

    pub(super) fn solve_at_in(&self, travelled: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        let mut front = self.path.param_at(travelled);
        let mut speed = self.head_speed;
        let last = self.team.benches;
        let [head, body, tail] = self.team.kinds().map(|bench| self.team.link(bench));
        for bench in 0..last {
            let link = match bench {
                0 => head,
                _ if bench + 1 == last => tail,
                _ => body,
            };
            let rear = follower(&self.path, front, link)?;
            let pose = link_pose(&self.path, front, rear, link);
            self.write(chain, bench, front, pose.direction, speed);
            speed *= pose.front_cosine / pose.rear_cosine;
            if bench + 1 == last {
                self.write(chain, last, rear, pose.direction, speed);
            }
            front = rear;
        }
        Ok(())
    }

    fn write(&self, chain: &mut ChainMut, handle: usize, param: Param, direction: Vector, speed: f64) {
        let point = self.path.point(param);
        chain.x[handle] = point.x;
        chain.y[handle] = point.y;
        chain.heading[handle] = heading(direction);
        if self.velocities == Velocities::Computed {
            let velocity = self.path.tangent(param) * speed;
            chain.speed[handle] = speed;
            chain.vx[handle] = velocity.x;
            chain.vy[handle] = velocity.y;
        }
    }
}

/// Returns the angle of a direction in (-pi, pi]: minus pi, which atan2 gives for a negative zero, becomes pi.
pub(super) fn heading(direction: Vector) -> f64 {
    let angle = elementary::atan2(direction.y, direction.x);
    if angle == -std::f64::consts::PI { std::f64::consts::PI } else { angle }
}

impl Solver for Newton {
    fn name(&self) -> &'static str {
        "newton"
    }

    fn solve_in(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        self.solve_at_in(self.head_speed * time, chain)
    }
}
