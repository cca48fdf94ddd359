//! The paper's solver, with its rules and its errors, to reproduce its tables and measure its cost.
//!
//! Three rules differ from exact motion:
//! - The head's polar angle advances by Euler steps of v dt / r, without the radial part: the head really moves at v
//!   sqrt(1 + 1/theta^2). A printed time t is the state after t/dt + 1 steps.
//! - Each follower is found by bisection on the polar angle (section 3.1, step 3).
//! - Speeds are the displacement over an interval of 0.2 s, divided by it (equation 4). Backward differences fit the
//!   printed Table 2, and explain its column of zeros at t = 0.

use std::f64::consts::PI;

use super::{Chain, ChainMut, Solver, Velocities};
use crate::linkage::NoFollower;
use crate::model::elementary::{atan2, cos, hypot, sin};
use crate::model::spiral::Spiral;
use crate::model::team::Team;

/// The parameters of the paper, which a scene may change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaperRules {
    /// The time of one Euler step of the head, in seconds.
    pub time_step: f64,
    /// The interval over which a speed is a difference of positions, in seconds.
    pub difference_interval: f64,
    /// The angle at which the bisection for a follower stops, in radians.
    pub bisection_tolerance: f64,
}

impl Default for PaperRules {
    fn default() -> Self {
        Self { time_step: 1e-5, difference_interval: 0.2, bisection_tolerance: 1e-12 }
    }
}

/// The paper's method for one scene.
#[derive(Debug, Clone)]
pub struct Paper {
    spiral: Spiral,
    team: Team,
    rules: PaperRules,
    velocities: Velocities,
    head: EulerHead,
    earlier_head: EulerHead,
    earlier: Chain,
}

impl Paper {
    /// Creates a solver for `team` on the inward `spiral`, starting at the polar angle `start`, the head moving at a
    /// nominal `head_speed` metres per second.
    pub fn new(
        spiral: Spiral,
        start: f64,
        team: Team,
        head_speed: f64,
        velocities: Velocities,
        rules: PaperRules,
    ) -> Self {
        let head = EulerHead::new(&spiral, start, head_speed, rules.time_step);
        let earlier = Chain::new(team.handles());
        Self { spiral, team, rules, velocities, earlier_head: head.clone(), head, earlier }
    }
}

/// The head's polar angle by Euler steps. The last angle is stored, so that a running show computes only the steps
/// since. The angle after n steps does not depend on earlier calls.
#[derive(Debug, Clone)]
struct EulerHead {
    start: f64,
    time_step: f64,
    /// v dt / a: radians times radians per step.
    advance: f64,
    steps: u64,
    theta: f64,
}

impl EulerHead {
    fn new(spiral: &Spiral, start: f64, head_speed: f64, time_step: f64) -> Self {
        Self { start, time_step, advance: head_speed * time_step / spiral.radius_per_radian(), steps: 0, theta: start }
    }

    /// Returns the angle at a printed time, in radians; 0 once the centre is reached.
    fn theta_at(&mut self, time: f64) -> f64 {
        let steps = (time / self.time_step).round() as u64 + 1;
        if steps < self.steps {
            self.steps = 0;
            self.theta = self.start;
        }
        for _ in self.steps..steps {
            self.theta -= self.advance / self.theta;
            if self.theta.is_nan() || self.theta <= 0.0 {
                self.theta = 0.0;
                break;
            }
        }
        self.steps = steps;
        self.theta
    }

    /// Returns nearly the same angle without the steps: each lessens the angle's square by 2 v dt / a, and next to
    /// nothing more.
    fn predicted(&self, time: f64) -> f64 {
        let steps = (time / self.time_step).round() + 1.0 - self.steps as f64;
        (self.theta * self.theta - 2.0 * self.advance * steps).max(0.0).sqrt()
    }
}

/// Returns the seconds after which the paper's head comes from the polar angle `start` to `theta`, as dt goes to 0.
/// From d theta/dt = -v / (a theta) follows t = a (theta_0^2 - theta^2) / 2 v.
pub fn time_of_theta(spiral: &Spiral, start: f64, head_speed: f64, theta: f64) -> f64 {
    0.5 * spiral.radius_per_radian() * (start - theta) * (start + theta) / head_speed
}

/// Finds the angle to the follower of a handle at `theta` by bisection to `tolerance`, in radians.
fn bisected_follower_angle(spiral: &Spiral, theta: f64, link: f64, tolerance: f64) -> Result<f64, NoFollower> {
    let residual = spiral.chord_residual(spiral.radius_per_radian() * theta, link);
    let (mut low, mut high) = (0.0, PI);
    if residual(high).0 < 0.0 {
        // Beyond half a turn the paper's search has no bracket: the safe search applies.
        return spiral.follower_angle(spiral.radius_per_radian() * theta, link);
    }
    while high - low > tolerance {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if residual(middle).0 < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(0.5 * (low + high))
}

/// Writes positions and headings of the chain whose head is at `theta`.
fn place_chain(
    spiral: &Spiral,
    team: &Team,
    tolerance: f64,
    theta: f64,
    chain: &mut ChainMut,
) -> Result<(), NoFollower> {
    let a = spiral.radius_per_radian();
    let mut angle = theta;
    for handle in 0..team.handles() {
        chain.x[handle] = a * angle * cos(angle);
        chain.y[handle] = a * angle * sin(angle);
        if handle < team.benches {
            angle += bisected_follower_angle(spiral, angle, team.link(handle), tolerance)?;
        }
    }
    for handle in 0..team.benches {
        let (dx, dy) = (chain.x[handle] - chain.x[handle + 1], chain.y[handle] - chain.y[handle + 1]);
        chain.heading[handle] = atan2(dy, dx);
    }
    chain.heading[team.benches] = chain.heading[team.benches - 1];
    Ok(())
}

impl Solver for Paper {
    fn name(&self) -> &'static str {
        "paper"
    }

    fn solve_in(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        let Self { spiral, team, rules, velocities, head, earlier_head, earlier } = self;
        place_chain(spiral, team, rules.bisection_tolerance, head.theta_at(time), chain)?;
        if *velocities == Velocities::Omitted {
            return Ok(());
        }
        let before = earlier_head.theta_at((time - rules.difference_interval).max(0.0));
        place_chain(spiral, team, rules.bisection_tolerance, before, &mut earlier.all_mut())?;
        for handle in 0..team.handles() {
            let vx = (chain.x[handle] - earlier.x[handle]) / rules.difference_interval;
            let vy = (chain.y[handle] - earlier.y[handle]) / rules.difference_interval;
            chain.vx[handle] = vx;
            chain.vy[handle] = vy;
            // The paper has no direction; travel is clockwise, so the sign is that of r x v, reversed.
            let turning = chain.y[handle] * vx - chain.x[handle] * vy;
            chain.speed[handle] = if turning < 0.0 { -hypot(vx, vy) } else { hypot(vx, vy) };
        }
        Ok(())
    }

    fn solve_ahead(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        place_chain(&self.spiral, &self.team, self.rules.bisection_tolerance, self.head.predicted(time), chain)
    }
}
