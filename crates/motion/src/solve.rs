//! Solvers: from the head's travel to the state of every handle.
//!
//! The solvers differ in cost and accuracy and implement [`Solver`]; [`crate`] chooses one. Except for the paper's
//! solver and the reference, each lies on the measured Pareto front of error against time.

pub mod newton;
pub mod paper;
pub mod reference;
pub mod selection;
pub mod table;

use std::ops::Range;

use crate::linkage::NoFollower;

/// The state of all handles at one moment, as flat arrays by handle, the head first.
///
/// All arrays have one length, the number of handles. Without velocities, `speed`, `vx` and `vy` hold NaN.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chain {
    /// The coordinate to the right of the centre, in metres.
    pub x: Vec<f64>,
    /// The coordinate up from the centre, in metres.
    pub y: Vec<f64>,
    /// The direction of the bench this handle leads, in radians in (-pi, pi]; the last handle has the last bench's.
    pub heading: Vec<f64>,
    /// Signed speed along the path, metres per second, positive in the direction of travel.
    pub speed: Vec<f64>,
    /// Velocity along x, in metres per second.
    pub vx: Vec<f64>,
    /// Velocity along y, in metres per second.
    pub vy: Vec<f64>,
}

impl Chain {
    /// Creates a chain of `handles` handles, all at the origin and without velocity.
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

    /// Returns the number of handles.
    pub fn handles(&self) -> usize {
        self.x.len()
    }

    /// Returns all handles, to write to.
    #[inline]
    pub fn all_mut(&mut self) -> ChainMut<'_> {
        let Self { x, y, heading, speed, vx, vy } = self;
        ChainMut { x, y, heading, speed, vx, vy }
    }
}

/// The handles of a chain, or some of a longer chain's, to write to. The arrays are those of [`Chain`].
#[derive(Debug)]
pub struct ChainMut<'a> {
    /// The coordinate to the right of the centre, in metres.
    pub x: &'a mut [f64],
    /// The coordinate up from the centre, in metres.
    pub y: &'a mut [f64],
    /// The heading, in radians in (-pi, pi].
    pub heading: &'a mut [f64],
    /// The speed along the path, in metres per second.
    pub speed: &'a mut [f64],
    /// The velocity along x, in metres per second.
    pub vx: &'a mut [f64],
    /// The velocity along y, in metres per second.
    pub vy: &'a mut [f64],
}

impl ChainMut<'_> {
    /// Returns the number of handles.
    #[inline]
    pub fn handles(&self) -> usize {
        self.x.len()
    }

    /// Returns some of the handles: those of one of several dragons.
    ///
    /// # Panics
    /// If there are fewer handles.
    pub fn range_mut(&mut self, handles: Range<usize>) -> ChainMut<'_> {
        let ChainMut { x, y, heading, speed, vx, vy } = self;
        let [x, y, heading, speed, vx, vy] =
            [x, y, heading, speed, vx, vy].map(|numbers| &mut numbers[handles.clone()]);
        ChainMut { x, y, heading, speed, vx, vy }
    }

    /// Returns the positions of the handles.
    #[inline]
    pub fn positions(&self) -> Positions<'_> {
        Positions { x: self.x, y: self.y }
    }

    /// Sets all velocities to 0; those that are not computed stay NaN.
    pub fn stand(&mut self) {
        for number in self.speed.iter_mut().chain(&mut *self.vx).chain(&mut *self.vy) {
            *number = if number.is_nan() { *number } else { 0.0 };
        }
    }
}

/// The positions of the handles of a chain, in metres.
#[derive(Debug, Clone, Copy)]
pub struct Positions<'a> {
    /// The coordinate to the right of the centre, in metres.
    pub x: &'a [f64],
    /// The coordinate up from the centre, in metres.
    pub y: &'a [f64],
}

impl<'a> From<&'a Chain> for Positions<'a> {
    #[inline]
    fn from(chain: &'a Chain) -> Self {
        Self { x: &chain.x, y: &chain.y }
    }
}

/// A request to compute speeds and velocities, or to omit them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Velocities {
    /// Compute them.
    Computed,
    /// Leave them NaN, at no cost.
    Omitted,
}

/// A way to find the chain. Implementations own their scratch memory, so that solving allocates nothing.
///
/// # Examples
///
/// ```
/// use bench_dragon_motion::model::description::PathDescription;
/// use bench_dragon_motion::model::team::{Ends, Team};
/// use bench_dragon_motion::solve::{Chain, Velocities};
/// use bench_dragon_motion::{Method, Motion};
///
/// let (head_length, body_length) = (3.41, 2.20);
/// let team = Team { benches: 223, head_length, body_length, width: 0.30, hole_inset: 0.275, ends: Ends::NONE };
/// let path = PathDescription::Spiral { pitch: 0.55, start_turn: 16.0 };
/// let motion = Motion::new(path, team, 1.0, Method::Accuracy(1e-9))?;
/// let mut solver = motion.solver(Velocities::Computed).solver;
/// let mut chain = Chain::new(team.handles());
/// solver.solve(300.0, &mut chain)?;
/// // The head of the paper's dragon after 300 s of true motion, and its speed.
/// assert!((chain.x[0] - 4.420_274_064_106).abs() < 1e-9 && (chain.y[0] - 2.320_428_674_331).abs() < 1e-9);
/// assert!((chain.speed[0] - 1.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Solver: Send {
    /// Returns the name by which a scene selects this solver.
    fn name(&self) -> &'static str;

    /// Fills `chain` with the state at `time` simulated seconds after the scene's start.
    ///
    /// # Errors
    /// [`NoFollower`] if the motion has ended in a lock before `time`; `chain` is then unspecified.
    fn solve(&mut self, time: f64, chain: &mut Chain) -> Result<(), NoFollower> {
        self.solve_in(time, &mut chain.all_mut())
    }

    /// Does the same for the handles of one dragon in a longer chain.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    fn solve_in(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower>;

    /// Fills the positions with those of a time that is not the next one, by a prediction if that is cheaper. Frames that
    /// are solved afterwards have the same bits and the same cost.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    fn solve_ahead(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        self.solve_in(time, chain)
    }
}
