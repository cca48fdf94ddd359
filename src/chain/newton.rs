//! The safe solver: exact motion along the arc, each follower found by a bracketed Newton iteration.
//!
//! It is right wherever there is an answer, and every faster solver falls back to it. Works on any [`Path`].

use super::{Chain, Solver, Team, Velocities};
use crate::geometry::path::{Fold, Path};

/// One handle after another along the path, each from scratch.
#[derive(Debug, Clone)]
pub struct Newton<P: Path> {
    path: P,
    team: Team,
    head_speed: f64,
    velocities: Velocities,
}

impl<P: Path> Newton<P> {
    /// A solver for `team` on `path`, the head moving at `head_speed` metres per second along the curve.
    pub fn new(path: P, team: Team, head_speed: f64, velocities: Velocities) -> Self {
        Self { path, team, head_speed, velocities }
    }

    /// Fills `chain` with the state when the head is at `head`, whatever the time.
    ///
    /// Speeds come from rigidity: both ends of a link have the same velocity along it,
    /// v_{i+1} (t_{i+1} . b_i) = v_i (t_i . b_i).
    ///
    /// # Errors
    /// [`Fold`] where a link is locked; `chain` is then unspecified.
    pub fn solve_from(&self, head: P::Place, chain: &mut Chain) -> Result<(), Fold> {
        let mut front = head;
        let mut speed = self.head_speed;
        let last = self.team.benches;
        for bench in 0..last {
            let link = self.team.link(bench);
            let rear = self.path.follower(front, link)?;
            let across = self.path.bench(front, rear, link);
            self.write(chain, bench, front, across.direction, speed);
            speed *= across.front_cosine / across.rear_cosine;
            if bench + 1 == last {
                self.write(chain, last, rear, across.direction, speed);
            }
            front = rear;
        }
        Ok(())
    }

    fn write(&self, chain: &mut Chain, handle: usize, place: P::Place, bench: crate::geometry::Vector, speed: f64) {
        let point = self.path.point(place);
        chain.x[handle] = point.x;
        chain.y[handle] = point.y;
        chain.heading[handle] = heading(bench);
        if self.velocities == Velocities::Computed {
            let velocity = self.path.tangent(place) * speed;
            chain.speed[handle] = speed;
            chain.vx[handle] = velocity.x;
            chain.vy[handle] = velocity.y;
        }
    }
}

/// The angle of a direction in (-pi, pi]: minus pi, which atan2 gives for a negative zero, is turned to pi.
fn heading(direction: crate::geometry::Vector) -> f64 {
    let angle = direction.y.atan2(direction.x);
    if angle == -std::f64::consts::PI { std::f64::consts::PI } else { angle }
}

impl<P: Path + Send> Solver for Newton<P>
where
    P::Place: Send,
{
    fn name(&self) -> &'static str {
        "newton"
    }

    fn solve(&mut self, time: f64, chain: &mut Chain) -> Result<(), Fold> {
        self.solve_from(self.path.place_at(self.head_speed * time), chain)
    }
}
