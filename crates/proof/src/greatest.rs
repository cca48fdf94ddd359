//! The rules of a certificate of the greatest speed: the file's lines for Lemma 7 of docs/proofs.md.

use super::chain::span_is_one;
use super::interval::Interval;
use super::lines::ProvedSpeed;
use super::path::{Place, Span};
use super::problem::{Checked, ensure, problem};
use super::scene::Scene;
use super::speeds::Speeds;

/// The consequences of the lines so far.
#[derive(Default)]
pub(super) struct Greatest {
    /// The end of the last step, and a number that no ratio exceeds up to there.
    pub so_far: Option<(Place, Interval)>,
    /// A handle, its ratio at a place of the motion, and the metres of the head there from the start.
    fast: Option<(usize, Interval, Interval)>,
    /// Counts for the report.
    pub steps: u64,
    pub links: u64,
}

impl Greatest {
    /// Checks and adds a step of the head.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_step(&mut self, scene: &Scene, head: Span, spans: &[Span], at: &[Place]) -> Checked {
        let Span(from, to) = head;
        span_is_one(scene, head).map_err(|problem| problem!("the head: {problem}"))?;
        match self.so_far {
            Some((end, _)) if end != from => return Err(problem!("it does not begin where the step before it ended")),
            None if !scene.path.travelled(from).is_at_most(&Interval::new(0.0)) => {
                return Err(problem!("the first step begins beyond the start"));
            }
            _ => {}
        }
        let (Speeds { most, .. }, links) = Speeds::new(scene, head, spans, at)?;
        let most = self.so_far.map_or(most, |(_, before)| before.max(&most));
        self.so_far = Some((to, most));
        self.steps += 1;
        self.links += links;
        Ok(())
    }

    /// Checks and adds the ratio of a handle with the head at a place.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_fast(&mut self, scene: &Scene, handle: usize, spans: &[Span], at: &[Place]) -> Checked {
        let Some(&head) = at.first() else { return Err(problem!("no place is listed")) };
        span_is_one(scene, Span(head, head)).map_err(|problem| problem!("the head: {problem}"))?;
        let travelled = scene.path.travelled(head);
        if !Interval::new(0.0).is_at_most(&travelled) || !scene.path.is_within(head) {
            return Err(problem!("the head is before the start or beyond the end of the path"));
        }
        ensure!(self.so_far.is_some_and(|(end, _)| scene.path.in_order(head, end)), "no step has come there");
        let (Speeds { at_place, .. }, _) = Speeds::new(scene, Span(head, head), spans, at)?;
        let ratio = at_place.get(handle).ok_or_else(|| problem!("handle {handle} is not listed"))?;
        self.fast = Some((handle, ratio.abs(), travelled));
        Ok(())
    }

    /// Checks the result.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn check(&self, scene: &Scene, outcome: &ProvedSpeed) -> Checked {
        let ProvedSpeed { limit, value_lo, value_hi, ratio_lo, ratio_hi, handle, time_until } = *outcome;
        let [limit, value_lo, value_hi, ratio_lo, ratio_hi, until] =
            [limit, value_lo, value_hi, ratio_lo, ratio_hi, time_until].map(Interval::new);
        let zero = Interval::new(0.0);
        let Some((end, most)) = self.so_far else { return Err(problem!("no step precedes it")) };
        ensure!(
            zero.is_at_most(&until) && (until * scene.head_speed).is_at_most(&scene.path.travelled(end)),
            "time_until does not follow"
        );
        ensure!(most.is_at_most(&ratio_hi), "ratio_hi does not follow");
        let fastest = if handle == 0 { Some((0, Interval::new(1.0), zero)) } else { self.fast };
        let is_before = |travelled: &Interval| travelled.is_at_most(&(until * scene.head_speed));
        ensure!(
            fastest
                .is_some_and(|(fastest, ratio, at)| fastest == handle && ratio_lo.is_at_most(&ratio) && is_before(&at)),
            "ratio_lo of this handle does not follow"
        );
        ensure!(
            zero.is_at_most(&value_lo) && (value_lo * ratio_hi).is_at_most(&limit),
            "value_lo does not follow from limit and ratio_hi"
        );
        ensure!(
            ratio_lo.is_positive() && limit.is_at_most(&(value_hi * ratio_lo)),
            "value_hi does not follow from limit and ratio_lo"
        );
        Ok(())
    }
}
