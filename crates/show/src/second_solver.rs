//! A second solver that judges handles computed elsewhere: by a machine with other bits, or before they were recorded.
//!
//! In: a time and handles. Out: the first [`Disagreement`].

use std::f64::consts::PI;

use crate::scene::Scene;
use crate::solve_at_or_just_before;
use bench_dragon_messages::HandlePose;
use bench_dragon_motion::ensemble::Dragon;
use bench_dragon_motion::model::Vector;
use bench_dragon_motion::solve::{Chain, Solver, Velocities};
use bench_dragon_motion::{Method, Motion};

/// The time, in seconds, by which two arithmetics may differ in the times of events, at which a show ends or pauses.
const EVENT_TIME: f64 = 1e-9;
/// The greatest growth of a position error along the chain. The error grows with the speed of the handles, without
/// bound at a lock. Near a lock the error itself is about sqrt(eps).
const MOST_GROWTH: f64 = 1e6;

/// The error of an angle in (-pi, pi] from arctangents and sums, in radians.
const ROUNDING_OF_ANGLES: f64 = 1e-14;

/// A frame that the second solver refuses: its first difference outside of the tolerance.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Disagreement {
    /// The frame has another simulated time.
    #[error("its simulated time is {time} s, computed {shown} s")]
    Time {
        /// The time of the frame, in seconds.
        time: f64,
        /// The time of the show, in seconds.
        shown: f64,
    },
    /// The chain has no solution at this simulated time, in seconds.
    #[error("there is no solution at its simulated time of {0} s")]
    NoSolution(f64),
    /// The frame has another number of handles.
    #[error("it has {found} handles, the scene {expected}")]
    Handles {
        /// The handles of the frame.
        found: usize,
        /// The handles of the scene.
        expected: usize,
    },
    /// A handle has another heading.
    #[error(
        "the heading of handle {}, counted from 1, is {radians:.1e} rad from newton's, more than {allowed:.1e} rad",
        handle + 1
    )]
    Heading {
        /// The handle, counted from 0.
        handle: usize,
        /// The difference.
        radians: f64,
        /// The tolerance.
        allowed: f64,
    },
    /// A handle is at another place.
    #[error(
        "handle {}, counted from 1, is {metres:.1e} m from newton's place, more than {allowed:.1e} m",
        handle + 1
    )]
    Place {
        /// The handle, counted from 0.
        handle: usize,
        /// The distance.
        metres: f64,
        /// The tolerance.
        allowed: f64,
    },
}

/// The second solver of a scene: one for each dragon.
pub struct SecondSolver {
    /// By dragon: its first handle, and its solver.
    parts: Vec<(usize, OneSolver)>,
}

/// The second solver of a dragon, and the greatest distance from it so far.
struct OneSolver {
    dragon: Dragon,
    solver: Box<dyn Solver>,
    chain: Chain,
    head_speed: f64,
    /// The distance from the stage's origin to the origin of the path's own coordinates, in metres.
    placed: f64,
    accuracy: f64,
    /// The greatest distance so far, and its tolerance, in metres.
    worst: Option<(f64, f64)>,
}

impl SecondSolver {
    /// Makes the second solver of a scene: `newton`, or the paper's rules for a scene that requests them.
    pub fn of(scene: &Scene) -> Self {
        let ensemble = &scene.ensemble;
        let part = |(k, dragon): (usize, &Dragon)| (ensemble.handles_of(k).start, OneSolver::new(dragon.clone()));
        Self { parts: ensemble.dragons().iter().enumerate().map(part).collect() }
    }

    /// Compares a simulated time with that of the show, `shown`, and the places of some handles with those of that
    /// time. A handle is its number with x and y.
    ///
    /// # Errors
    /// The first difference outside of the tolerance.
    pub fn compare(&mut self, time: f64, shown: f64, handles: &[(u32, f64, f64)]) -> Result<(), Disagreement> {
        let apart = (time - shown).abs();
        let allowed = self.parts.iter().map(|(_, part)| part.accuracy / part.head_speed).fold(0.0, f64::max);
        if apart.is_nan() || apart > EVENT_TIME + allowed + 8.0 * f64::EPSILON * shown {
            return Err(Disagreement::Time { time, shown });
        }
        if handles.is_empty() {
            return Err(Disagreement::NoSolution(time));
        }
        for (first, part) in &mut self.parts {
            let own_time = part.solve(time)?;
            let own = *first..*first + part.chain.handles();
            for (handle, x, y) in handles.iter().filter(|of| own.contains(&(of.0 as usize))) {
                part.compare_place(*first, *handle as usize - *first, own_time, *x, *y)?;
            }
        }
        Ok(())
    }

    /// Compares the position and the heading of every handle of a frame with those of the time `time`.
    ///
    /// # Errors
    /// The first difference outside of the tolerance.
    pub fn compare_frame(&mut self, time: f64, poses: &[HandlePose]) -> Result<(), Disagreement> {
        let (found, expected) = (poses.len(), self.parts.iter().map(|(_, part)| part.chain.handles()).sum());
        if found != expected {
            return Err(Disagreement::Handles { found, expected });
        }
        for (first, part) in &mut self.parts {
            part.compare_frame(*first, time, &poses[*first..*first + part.chain.handles()])?;
        }
        Ok(())
    }

    /// Returns the greatest distance so far and its tolerance, in metres; `None` before the first comparison.
    pub fn worst(&self) -> Option<(f64, f64)> {
        let worst = self.parts.iter().filter_map(|(_, part)| part.worst);
        worst.max_by(|one, other| one.0.total_cmp(&other.0))
    }
}

impl OneSolver {
    fn new(dragon: Dragon) -> Self {
        let motion = dragon.motion.clone();
        let accuracy = accuracy_of(&motion);
        let other = match motion.method() {
            Method::Paper(_) => motion,
            _ => motion.with_method(Method::Newton).unwrap_or(motion),
        };
        Self {
            dragon,
            solver: other.solver(Velocities::Computed).solver,
            chain: Chain::new(other.team().handles()),
            head_speed: other.head_speed(),
            placed: other.placement().origin().coords.norm(),
            accuracy,
            worst: None,
        }
    }

    /// Compares this dragon's handles in a frame; `first` is the number of the first one.
    fn compare_frame(&mut self, first: usize, time: f64, poses: &[HandlePose]) -> Result<(), Disagreement> {
        let own_time = self.solve(time)?;
        let places = poses.iter().enumerate();
        let places = places.map(|(handle, pose)| self.compare_place(first, handle, own_time, pose.x, pose.y));
        let tolerances: Vec<f64> = places.collect::<Result<_, _>>()?;
        for (handle, HandlePose { heading, .. }) in poses.iter().enumerate() {
            // The last handle has the last bench's heading.
            let bench = handle.min(poses.len().saturating_sub(2));
            // A bench turns by the distances of both its handles over its length.
            let allowed = (tolerances[bench] + tolerances[bench + 1]) / self.link(bench) + ROUNDING_OF_ANGLES;
            let radians = (heading - self.chain.heading[handle] + PI).rem_euclid(2.0 * PI) - PI;
            if radians.is_nan() || radians.abs() > allowed {
                return Err(Disagreement::Heading { handle: first + handle, radians, allowed });
            }
        }
        Ok(())
    }

    /// Solves the dragon for a time of the show, and returns the time of its own motion.
    fn solve(&mut self, time: f64) -> Result<f64, Disagreement> {
        let own_time = self.dragon.own_time(time).0;
        let solved = time.is_finite()
            && time >= 0.0
            && solve_at_or_just_before(self.solver.as_mut(), own_time, &mut self.chain).is_ok();
        if solved { Ok(own_time) } else { Err(Disagreement::NoSolution(time)) }
    }

    /// Returns the metres between the holes of a bench.
    fn link(&self, bench: usize) -> f64 {
        let Chain { x, y, .. } = &self.chain;
        Vector::new(x[bench] - x[bench + 1], y[bench] - y[bench + 1]).norm()
    }

    /// Compares the place of a handle with the solution. Returns the tolerance in metres.
    fn compare_place(&mut self, first: usize, handle: usize, time: f64, x: f64, y: f64) -> Result<f64, Disagreement> {
        let own = self.chain.x.get(handle).zip(self.chain.y.get(handle)).map(|(x, y)| Vector::new(*x, *y));
        let metres = own.map_or(f64::INFINITY, |own| (Vector::new(x, y) - own).norm());
        // Both solutions have rounding errors. A place that is judged does not widen what is allowed.
        let far = own.map_or(0.0, |own| own.norm());
        let rounding = 8.0 * f64::EPSILON * (far + self.head_speed * time + self.placed);
        let allowed = self.accuracy + 2.0 * rounding * growth(&self.chain.speed, handle);
        if metres.is_nan() || metres > allowed {
            return Err(Disagreement::Place { handle: first + handle, metres, allowed });
        }
        if self.worst.is_none_or(|(worst, _)| metres > worst) {
            self.worst = Some((metres, allowed));
        }
        Ok(allowed)
    }
}

/// Returns the distance in metres that two exact solutions may have besides their rounding.
fn accuracy_of(motion: &Motion) -> f64 {
    /// The least tolerance.
    const LEAST: f64 = 1e-12;
    /// The error that rounding causes in the bisection of the paper's rules.
    const PAPER: f64 = 1e-9;
    match motion.method() {
        Method::Accuracy(accuracy) => accuracy.max(LEAST),
        Method::Paper(_) => PAPER,
        Method::Newton | Method::FollowerTable => LEAST,
    }
}

/// Returns the growth of a position error up to a handle, from the speeds of the handles.
fn growth(speeds: &[f64], handle: usize) -> f64 {
    let least = speeds.iter().take(handle + 1).map(|speed| speed.abs()).fold(f64::INFINITY, f64::min);
    let growth = speeds.get(handle).map_or(f64::NAN, |speed| speed.abs()) / least;
    // NaN if this handle and one before it stand still.
    if growth.is_nan() { MOST_GROWTH } else { growth.clamp(1.0, MOST_GROWTH) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SceneText;

    #[test]
    fn a_place_beyond_all_bounds_is_not_close() {
        let scene = SceneText::paper().parse().unwrap();
        let mut solver = SecondSolver::of(&scene);
        let [x, y] = {
            let mut chain = Chain::new(224);
            scene.ensemble.only().unwrap().solver(Velocities::Computed).solver.solve(1.0, &mut chain).unwrap();
            [chain.x[7], chain.y[7]]
        };
        solver.compare(1.0, 1.0, &[(7, x, y)]).unwrap();
        for beyond in [x + 1e-6, 1e9, 1e200, f64::MAX, f64::INFINITY, f64::NAN] {
            assert!(solver.compare(1.0, 1.0, &[(7, beyond, y)]).is_err(), "{beyond}");
        }
    }
}
