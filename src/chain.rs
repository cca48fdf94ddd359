//! The chain of handles: where every handle is and how fast it goes, given how far the head has travelled.
//!
//! Solvers differ in cost and accuracy and stand behind [`Solver`]; the show and the offline commands call them.
//! [`Team`] is the model's description of the benches, without any of the scene file's syntax.

mod arithmetic;
pub mod follower_table;
mod lanes;
pub mod newton;
pub mod paper;
pub mod reference;
pub mod whole_chain;

pub use lanes::Instructions;

use crate::geometry::path::Fold;
use crate::messages::HandlePose;

/// The benches of a dragon. Constructed by the scene, which has checked that every length is positive and that each
/// board is longer than twice its hole inset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Team {
    /// The number of benches, at least 1; one less than the number of handles.
    pub benches: usize,
    /// Metres along the head's board.
    pub head_length: f64,
    /// Metres along every other board.
    pub body_length: f64,
    /// Metres across every board.
    pub width: f64,
    /// Metres from the centre of a handle's hole to the nearest end of the board.
    pub hole_inset: f64,
}

impl Team {
    /// The number of handles.
    pub fn handles(&self) -> usize {
        self.benches + 1
    }

    /// Metres between the two handles of a bench (0 = head).
    pub fn link(&self, bench: usize) -> f64 {
        let board = if bench == 0 { self.head_length } else { self.body_length };
        board - 2.0 * self.hole_inset
    }
}

/// The state of all handles at one moment, as flat arrays by handle, the head first.
///
/// All arrays have one length, the number of handles. Without velocities, `speed`, `vx` and `vy` hold NaN.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chain {
    /// Metres to the right of the centre.
    pub x: Vec<f64>,
    /// Metres up from the centre.
    pub y: Vec<f64>,
    /// Radians in (-pi, pi], the direction of the bench this handle leads; the last handle takes the last bench's.
    pub heading: Vec<f64>,
    /// Signed speed along the path, metres per second, positive in the direction of travel.
    pub speed: Vec<f64>,
    /// Velocity along x, metres per second.
    pub vx: Vec<f64>,
    /// Velocity along y, metres per second.
    pub vy: Vec<f64>,
}

impl Chain {
    /// A chain of `handles` handles, all at the origin and without velocity.
    pub fn new(handles: usize) -> Self {
        let numbers = |value| vec![value; handles];
        Self {
            x: numbers(0.0),
            y: numbers(0.0),
            heading: numbers(0.0),
            speed: numbers(f64::NAN),
            vx: numbers(f64::NAN),
            vy: numbers(f64::NAN),
        }
    }

    /// The number of handles.
    pub fn handles(&self) -> usize {
        self.x.len()
    }

    /// One handle as it goes over the wire. Panics if there is no such handle.
    pub fn pose(&self, handle: usize) -> HandlePose {
        HandlePose {
            x: self.x[handle],
            y: self.y[handle],
            heading: self.heading[handle],
            vx: self.vx[handle],
            vy: self.vy[handle],
        }
    }
}

/// Whether a solver is to compute speeds and velocities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Velocities {
    /// Compute them.
    Computed,
    /// Leave them NaN, at no cost.
    Omitted,
}

/// A way to find the chain. Implementations own their scratch memory, so that solving allocates nothing.
pub trait Solver: Send {
    /// The name by which a scene asks for this solver.
    fn name(&self) -> &'static str;

    /// Fills `chain` with the state at `time` simulated seconds after the scene's start.
    ///
    /// # Errors
    /// [`Fold`] where the motion has ended in a lock before `time`; `chain` is then unspecified.
    fn solve(&mut self, time: f64, chain: &mut Chain) -> Result<(), Fold>;
}
