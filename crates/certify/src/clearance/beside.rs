//! The clearance of obstacles over the steps of a show. Lemma 11 of `docs/proofs.md`.

use super::{Descent, LOWER, Nearer, ObstacleEnclosure, Refused, WIDTH};
use crate::first_order::When;
use crate::first_order_step::{FirstOrderStep, step_points};
use crate::grid::GridPoint;
use crate::ground::BoardOverStep;
use crate::lines::{Links, Step};
use crate::place::Place;
use crate::step::{Listed, Obstacle};
use bench_dragon_motion::timeline::TimedObstacleClearance;

/// The bounds of the clearance of an obstacle so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Beside {
    pub upper: Option<UpperBeside>,
    /// True from the step on for which nothing can be shown.
    pub is_lost: bool,
    /// The least threshold of the steps that were shown, and the end of the last of them.
    pub shown: Option<(f64, Place)>,
}

/// An upper bound of the clearance of a board and an obstacle, and its place.
#[derive(Debug, Clone, Copy)]
pub(super) struct UpperBeside {
    pub value: f64,
    pub travelled: f64,
    /// The first and the last place of the head.
    pub head: [Place; 2],
    pub bench: usize,
}

impl Beside {
    /// Returns the clearance in metres that boards must exceed.
    fn threshold(&self) -> Option<f64> {
        self.upper.filter(|_| !self.is_lost).map(|upper| upper.value - WIDTH)
    }
}

impl Descent<'_, '_> {
    /// Takes the places of the ordinary search, or the start if the show ends there.
    pub(super) fn begin_beside(&mut self, hints: &[TimedObstacleClearance], is_at_start: bool) {
        for TimedObstacleClearance { obstacle, least, .. } in hints {
            // Skipped, because it cannot succeed and its steps would use up the limit.
            if !self.chain.barriers.get(*obstacle).is_some_and(|barrier| barrier.is_decidable(least.value)) {
                continue;
            }
            let places = match is_at_start {
                true => self.after_start().map(|after| [self.at.clone(), after]),
                false => self.inside(least.travelled).map(|point| [point.clone(), point]),
            };
            let upper = places.and_then(|[from, to]| self.upper_beside(*obstacle, least.bench as usize, from, to));
            if let Some(beside) = self.beside.get_mut(*obstacle) {
                beside.upper = upper;
            }
        }
    }

    /// Returns an upper bound of the clearance of a board with the head anywhere between two places.
    fn upper_beside(
        &self,
        obstacle: usize,
        bench: usize,
        mut from: GridPoint,
        mut to: GridPoint,
    ) -> Option<UpperBeside> {
        let (mut middle, head) = (from.clone(), [from.head, to.head]);
        let mut first_order = FirstOrderStep::new(&self.chain, &step_points(&mut from, &mut middle, &mut to));
        while first_order.listed.handles.len() <= bench + 1 {
            first_order.extend(step_points(&mut from, &mut middle, &mut to), Links::All).ok()?;
        }
        let value = self.chain.barriers.get(obstacle)?.at_most(&first_order.board(bench), When::Always);
        Some(UpperBeside { value, travelled: to.travelled, head, bench }).filter(|upper| upper.value.is_finite())
    }

    /// Shows that no board is as near to an obstacle as its threshold. Returns the thresholds; an empty list if there
    /// are none.
    pub(super) fn boards_are_beside(
        &self,
        first_order: &FirstOrderStep,
        travelled: f64,
    ) -> Result<Vec<Option<f64>>, Refused> {
        let thresholds: Vec<Option<f64>> = self.beside.iter().map(Beside::threshold).collect();
        if thresholds.iter().all(Option::is_none) {
            return Ok(Vec::new());
        }
        let listed = first_order.listed.handles.len() - 1;
        for (bench, moving) in first_order.listed.boards_on_ground(self.covered.links) {
            let first = if bench < listed { first_order.board(bench) } else { first_order.straight_run(bench) };
            let board = BoardOverStep { moving, first_order: Some((&first, When::Always)) };
            for (number, (barrier, threshold)) in self.chain.barriers.iter().zip(&thresholds).enumerate() {
                if threshold.is_none_or(|threshold| barrier.is_further_than(threshold, &board)) {
                    continue;
                }
                let at = self.chain.exact.travelled(first_order.at);
                let is_inside = at.lo >= 0.0 && at.hi <= self.latest && bench < listed;
                let upper = || UpperBeside {
                    value: barrier.at_most(&first, When::Middle),
                    travelled,
                    head: [first_order.at; 2],
                    bench,
                };
                let lower = |upper: &UpperBeside| threshold.is_some_and(|of| upper.value < of + WIDTH - LOWER);
                let nearer = is_inside.then(upper).filter(lower).map(|upper| Nearer::Obstacle(number, upper));
                return Err(Refused { obstacle: Obstacle::Stage(number), nearer });
            }
        }
        Ok(thresholds)
    }

    /// Returns true if no board is as near to an obstacle as its threshold, by capsules alone.
    pub(super) fn stays_beside(&self, listed: &Listed, links: Links) -> bool {
        let boards = listed.boards_on_ground(links);
        boards.into_iter().all(|(_, moving)| {
            let board = BoardOverStep { moving, first_order: None };
            let mut of_each = self.chain.barriers.iter().zip(&self.beside);
            of_each.all(|(barrier, beside)| beside.threshold().is_none_or(|of| barrier.is_further_than(of, &board)))
        })
    }

    /// Adds the claims of a step that is shown.
    pub(super) fn add_beside(&mut self, step: &Step) {
        for (beside, metres) in self.beside.iter_mut().zip(&step.beside) {
            if let Some(metres) = *metres {
                let least = beside.shown.map_or(metres, |(least, _)| least.min(metres));
                beside.shown = Some((least, step.to));
            }
        }
    }

    /// Returns the enclosure of each obstacle's clearance; `None` if nothing is shown.
    pub(super) fn enclosed_beside(&self) -> Vec<Option<ObstacleEnclosure>> {
        let of = |(obstacle, beside): (usize, &Beside)| {
            let (UpperBeside { value: hi, travelled, bench, .. }, (lo, end)) = (beside.upper?, beside.shown?);
            let is_whole = self.is_complete && !beside.is_lost;
            let until = (!is_whole).then(|| self.chain.exact.travelled(end).lo.max(0.0));
            Some(ObstacleEnclosure { obstacle, lo, hi, travelled, bench, until })
        };
        self.beside.iter().enumerate().map(of).collect()
    }
}
