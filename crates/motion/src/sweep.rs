//! [`sweep`]: the positions that boards take one after the other while the head goes from one place to another. The
//! positions are near enough to each other for an outline of the ground that the boards cover.
//!
//! In: a motion, a stretch of its path, some benches. Out: pairs of positions of one board.

use std::ops::Range;

use crate::Motion;
use crate::event::Progress;
use crate::linkage::{NoFollower, follower, link_pose};
use crate::model::Point;
use crate::model::board::Board;

/// The corners of a board on the stage, at the beginning and at the end of a step of the head. They are in the order of
/// [`Board::corners`].
pub type Moved = [[Point; 4]; 2];

/// The reason for an incomplete sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SweepError {
    /// A handle has no place before the end of the stretch.
    #[error(transparent)]
    NoFollower(#[from] NoFollower),
    /// The receiver of the progress has stopped it.
    #[error("stopped")]
    Stopped,
}

/// Shares of a step at which the corners are compared with the straight lines between its ends.
const SHARES: [f64; 3] = [0.25, 0.5, 0.75];

/// The first step, as a share of the shortest link, and the growth of steps after a step that holds.
const FIRST_SHARE: f64 = 0.01;
const GROWTH: f64 = 1.5;

/// The shortest step, as a share of the shortest link. Within such a step, corners count as straight: near a lock a
/// handle moves by a root of the step.
const LEAST_SHARE: f64 = 1e-9;

/// Gives `moved` every position of the boards of `benches`, counted from 0, while the head travels `from` to `to`
/// metres. The head travels in steps so short that each corner stays within `tolerance` metres of the straight line
/// between its two ends. This is tested at a quarter, a half and three quarters of the step. `progress` receives the
/// share that is done, from 0 to 1.
///
/// All benches of one size lie in the same position when their front handles are at the same place of the path. So a
/// board is left out from the place on where the board before it, of the same size, began.
///
/// # Errors
/// A handle has no place before the end of the stretch, or `progress` has stopped the search.
pub fn sweep(
    motion: &Motion,
    (from, to): (f64, f64),
    benches: Range<usize>,
    tolerance: f64,
    progress: Progress<'_>,
    moved: &mut dyn FnMut(&Moved),
) -> Result<(), SweepError> {
    let mut boards = Boards { motion, benches, begun: Vec::new(), turn_back: false };
    // A handle that goes backward may leave the places that a board before it has covered.
    boards.turn_back = motion.singularities(&mut |_| progress(0.0)).stall.is_some_and(|stall| stall.travelled < to);
    let mut at = boards.positions(from, usize::MAX)?;
    boards.begun = at.iter().map(|board| board.front).collect();
    // Boards that stand cover their place.
    if from >= to {
        boards.report(&at, &at, moved);
    }
    let shortest = motion.team().shortest_link();
    let mut travelled = from;
    let mut step = FIRST_SHARE * shortest;
    while travelled < to {
        if progress((travelled - from) / (to - from)).is_break() {
            return Err(SweepError::Stopped);
        }
        let next = (travelled + step).min(to);
        let least = LEAST_SHARE * shortest;
        match boards.straight_to(&at, (travelled, next), tolerance) {
            Some(positions) => {
                boards.report(&at, &positions, moved);
                (at, travelled) = (positions, next);
                step *= GROWTH;
            }
            None if next - travelled > least => step = 0.5 * (next - travelled),
            None => match boards.positions(next, boards.alone(&at)) {
                Ok(positions) => {
                    boards.report(&at, &positions, moved);
                    (at, travelled) = (positions, next);
                }
                // The end may be a lock, at which rounding leaves no follower.
                Err(_) if to - travelled <= 1e3 * least => break,
                Err(none) => return Err(none.into()),
            },
        }
    }
    Ok(())
}

/// A board in its position.
struct Position {
    /// The length of path to its front handle, in metres.
    front: f64,
    corners: [Point; 4],
}

/// The boards that are swept.
struct Boards<'a> {
    motion: &'a Motion,
    benches: Range<usize>,
    /// The length of path to each front handle at the beginning, in metres.
    begun: Vec<f64>,
    /// True if handles may go backward.
    turn_back: bool,
}

impl Boards<'_> {
    /// Returns true if a board, counted from the first one swept, has a position that no board before it has taken.
    fn is_alone(&self, index: usize, front: f64) -> bool {
        let (team, bench) = (self.motion.team(), self.benches.start + index);
        index == 0
            || team.link(bench) != team.link(bench - 1)
            || team.board_width(bench) != team.board_width(bench - 1)
            || self.begun.get(index - 1).is_none_or(|begun| front < *begun)
    }

    /// Returns the number of boards up to the last one that is alone.
    fn alone(&self, positions: &[Position]) -> usize {
        positions
            .iter()
            .enumerate()
            .rposition(|(index, board)| self.is_alone(index, board.front))
            .map_or(0, |last| last + 1)
    }

    /// Returns the positions of the first `least` boards, if there are as many. Returns also the positions of the
    /// boards behind them up to the last board that is alone.
    fn positions(&self, travelled: f64, least: usize) -> Result<Vec<Position>, NoFollower> {
        let (path, team) = (self.motion.path(), self.motion.team());
        let mut front = path.param_at(travelled);
        let mut positions = Vec::new();
        let mut metres = travelled;
        let has_tail = team.own_tail().is_some_and(|tail| self.benches.contains(&tail));
        for bench in 0..self.benches.end {
            let link = team.link(bench);
            let is_swept = bench >= self.benches.start;
            let index = bench.saturating_sub(self.benches.start);
            // All boards further back are in places that others have taken, too.
            let may_end = is_swept && !self.turn_back && !has_tail && index > 1 && positions.len() >= least;
            if may_end && !self.is_alone(index, metres) {
                break;
            }
            let rear = follower(path, front, link)?;
            if is_swept {
                let direction = link_pose(path, front, rear, link).direction;
                let width = team.board_width(bench);
                let board = Board::from_front(path.point(front), direction, link, team.hole_inset, width);
                let corners = board.corners().map(|corner| self.motion.placement().point(corner));
                positions.push(Position { front: metres, corners });
            }
            front = rear;
            metres = path.travelled(rear);
        }
        Ok(positions)
    }

    /// Returns the positions at the end of a step if the corners go straight during the step.
    fn straight_to(&self, before: &[Position], (from, to): (f64, f64), tolerance: f64) -> Option<Vec<Position>> {
        let least = self.alone(before);
        let after = self.positions(to, least).ok()?;
        for share in SHARES {
            let between = self.positions(from + share * (to - from), least).ok()?;
            let boards = before.iter().zip(&between).zip(&after).enumerate();
            for (index, ((before, between), after)) in boards {
                if !self.is_alone(index, before.front) && !self.is_alone(index, after.front) {
                    continue;
                }
                for corner in 0..4 {
                    let straight = before.corners[corner] + share * (after.corners[corner] - before.corners[corner]);
                    if (between.corners[corner] - straight).norm() > tolerance {
                        return None;
                    }
                }
            }
        }
        Some(after)
    }

    fn report(&self, before: &[Position], after: &[Position], moved: &mut dyn FnMut(&Moved)) {
        for (index, (before, after)) in before.iter().zip(after).enumerate() {
            if self.is_alone(index, before.front) || self.is_alone(index, after.front) {
                moved(&[before.corners, after.corners]);
            }
        }
    }
}
