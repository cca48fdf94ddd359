//! The fast solver: all handles at once, by one Newton correction of a prediction from the frame before.
//!
//! In: the time. Out: the chain, as exact as the safe solver's. It knows when one correction was not enough (at the
//! first frame, after a jump in time, near a lock) and then corrects again or asks the path for each follower anew;
//! [`WholeChain::restarts`] counts the latter. The show calls it through [`Solver`].

mod kernel;

use std::f64::consts::TAU;

use kernel::{State, Step};

use super::newton::Newton;
use super::{Chain, Instructions, Solver, Team, Velocities};
use crate::geometry::path::{Fold, Path};
use crate::geometry::spiral::Spiral;

/// Corrections tried before the chain is found anew.
const CORRECTIONS: usize = 3;

/// The error that a correction may leave, against the shortest link: a tenth of what links are promised to hold.
const LEFT_OVER_OF_LINK: f64 = 1e-13;

/// The same as a distance, metres: far below the rounding of the coordinates of a team of usual size.
const LEFT_OVER: f64 = 1e-13;

/// Newton's method on the whole chain, warm from frame to frame.
///
/// The same sequence of times gives the same bits on the same [`Instructions`].
#[derive(Debug, Clone)]
pub struct WholeChain {
    path: Spiral,
    team: Team,
    head_speed: f64,
    velocities: Velocities,
    instructions: Instructions,
    safe: Newton<Spiral>,
    state: State,
    history: History,
    head_span: f64,
    restarts: u64,
    repeats: u64,
}

/// What is known of the frames before.
#[derive(Debug, Clone, Copy, PartialEq)]
enum History {
    /// Nothing that helps.
    None,
    /// One frame, when the head had travelled `at` metres.
    One { at: f64 },
    /// Two frames, `step` metres of the head apart.
    Two { at: f64, step: f64 },
}

impl History {
    /// Whether the frames before were of a later moment.
    fn is_after(self, travelled: f64) -> bool {
        match self {
            Self::None => false,
            Self::One { at } | Self::Two { at, .. } => travelled < at,
        }
    }
}

impl WholeChain {
    /// A solver for `team` on `path`, the head moving at `head_speed` metres per second along the curve, with the
    /// fastest instructions this processor has.
    pub fn new(path: Spiral, team: Team, head_speed: f64, velocities: Velocities) -> Self {
        let link_term = |bench: usize| (team.link(bench.min(team.benches - 1)) / (2.0 * path.pitch())).powi(2);
        let state = State::new(team.handles(), link_term);
        Self {
            path,
            team,
            head_speed,
            velocities,
            // The list ends with the portable path, so it has a first.
            instructions: Instructions::available()[0],
            safe: Newton::new(path, team, head_speed, velocities),
            state,
            history: History::None,
            head_span: 0.0,
            restarts: 0,
            repeats: 0,
        }
    }

    /// The same solver with other instructions, or `None` where this processor lacks them.
    pub fn with_instructions(self, instructions: Instructions) -> Option<Self> {
        Instructions::available().contains(&instructions).then_some(Self { instructions, ..self })
    }

    /// The instructions it uses.
    pub fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// Bytes this solver holds.
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>() + self.state.memory_bytes()
    }

    /// How often the chain had to be found anew, handle by handle; once for the first frame.
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// How often one correction was not enough and another was made.
    pub fn repeats(&self) -> u64 {
        self.repeats
    }

    /// Tries `corrections` corrections; true if the last one left no more than rounding.
    fn corrected(&mut self, step: &mut Step, corrections: usize, chain: &mut Chain) -> bool {
        let link = self.team.link(0).min(self.team.link(self.team.benches - 1));
        let rounding = 0.5 * f64::EPSILON * step.pitch * step.head_turns();
        let left_over = LEFT_OVER.min(LEFT_OVER_OF_LINK * link).max(rounding);
        for _ in 0..corrections {
            let bound = kernel::correct(self.instructions, &mut self.state, step, chain);
            if bound <= left_over {
                return true;
            }
            if !bound.is_finite() {
                return false;
            }
            self.repeats += 1;
            (step.ahead, step.ahead_before) = (0.0, 0.0);
        }
        false
    }

    /// Takes the rates just computed as the newest.
    fn remember(&mut self, travelled: f64) {
        self.state.remember();
        self.history = match self.history {
            History::None => History::One { at: travelled },
            History::One { at } | History::Two { at, .. } if travelled == at => History::One { at },
            History::One { at } | History::Two { at, .. } => History::Two { at: travelled, step: travelled - at },
        };
    }

    /// Finds every increment from scratch, as the safe solver does.
    fn restart(&mut self, head: <Spiral as Path>::Place) -> Result<(), Fold> {
        self.restarts += 1;
        let mut front = head;
        for bench in 0..self.state.benches() {
            let link = self.team.link(bench.min(self.team.benches - 1));
            let rear = self.path.follower(front, link)?;
            self.state.set(bench, front.in_turns(), rear.minus(front) / TAU);
            front = rear;
        }
        Ok(())
    }
}

impl Solver for WholeChain {
    fn name(&self) -> &'static str {
        "whole_chain"
    }

    fn solve(&mut self, time: f64, chain: &mut Chain) -> Result<(), Fold> {
        let travelled = self.head_speed * time;
        if self.history.is_after(travelled) {
            // A show that begins again gives the same bits as the first time.
            self.history = History::None;
        }
        let (guess, ahead, ahead_before) = match self.history {
            History::None => (0.0, 0.0, 0.0),
            History::One { at } => (self.head_ahead(travelled - at), travelled - at, 0.0),
            History::Two { at, step } => {
                // The method of Adams and Bashforth of second order, for unequal steps.
                let now = travelled - at;
                let second = 0.5 * now * (now / step);
                (self.head_ahead(now), now + second, -second)
            }
        };
        let (head, span) = self.path.place_near(travelled, guess);
        self.head_span = span;
        let pitch = self.path.pitch();
        let mut step = Step {
            head: head.in_fixed_point_turns().max(0) as u128,
            head_rate: -1.0 / (pitch * 1f64.hypot(head.radians())),
            pitch,
            head_speed: self.head_speed,
            ahead,
            ahead_before,
            velocities: self.velocities,
        };
        if self.history != History::None && self.corrected(&mut step, CORRECTIONS, chain) {
            self.remember(travelled);
            return Ok(());
        }
        self.history = History::None;
        self.restart(head)?;
        (step.ahead, step.ahead_before) = (0.0, 0.0);
        if self.corrected(&mut step, 1, chain) {
            self.remember(travelled);
            return Ok(());
        }
        self.safe.solve_from(head, chain)
    }
}

impl WholeChain {
    /// The head's angle travelled, predicted to second order `ahead` metres beyond the last frame, radians.
    fn head_ahead(&self, ahead: f64) -> f64 {
        let theta = self.path.start().radians() - self.head_span;
        let slope = self.path.growth() * 1f64.hypot(theta);
        let turned = ahead / slope;
        self.head_span + turned + 0.5 * turned * turned * theta / (1.0 + theta * theta)
    }
}
