//! The steps of the head: one at a time, each shown completely or refused. A refused step may show a lower upper bound.

use std::io;

use super::super::first_order::When;
use super::super::first_order_step::{FirstOrderStep, StepPoints, step_points};
use super::super::grid::GridPoint;
use super::super::lines::{CertificateLine, Links, Step};
use super::super::place::Span;
use super::super::step::Obstacle;
use super::super::walk::{Next, Walk, Walker, Way};
use super::{Descent, LOWER, Nearer, Refused, Upper};
use bench_dragon_motion::event::Progress;

/// The factors of the step length: the growth after a step that is shown, the first shrink after one that is not, and
/// later shrinks. Steps close to the longest need more attempts, but make the certificate shorter.
pub(super) const GROWTH: f64 = 1.1;
pub(super) const SHRINKS: [f64; 2] = [0.8, 0.5];

/// The shortest step, as a share of the path length in metres.
const LEAST_STEP: f64 = 1e-14;

impl Descent<'_, '_> {
    /// Goes to `target`. Returns the travel that it reached if a step before cannot be shown.
    pub(super) fn go_to(&mut self, target: &GridPoint, progress: Progress<'_>) -> Option<f64> {
        let walked = self.walk_to(target, |search| {
            let steps = search.walk.steps as f64 / search.walk.most_steps as f64;
            progress((search.at.travelled / search.end).max(steps).clamp(0.0, 1.0))
        });
        if let Ok(None) = walked { None } else { Some(self.travelled()) }
    }

    /// Shows a step from the current place, and prepares the next.
    fn show(&mut self, mut to: GridPoint) -> Result<(), Refused> {
        let mut middle = self.grid_point(0.5 * self.at.travelled + 0.5 * to.travelled);
        let mut from = std::mem::replace(&mut self.at, to.clone());
        let shown = self.show_between(&mut StepPoints { from: &mut from, middle: &mut middle, to: &mut to });
        self.at = from;
        let ShownStep { step, body_forward } = shown?;
        self.covered.add(&mut self.chain, &step.spans, body_forward);
        self.add_beside(&step);
        if let Some(metres) = step.apart {
            let least = self.shown.map_or(metres, |(least, _)| least.min(metres));
            self.shown = Some((least, step.to));
        }
        self.write(&CertificateLine::Step(step));
        self.at = to;
        Ok(())
    }

    /// Shows a step.
    fn show_between(&self, points: &mut StepPoints) -> Result<ShownStep, Refused> {
        let mut first_order = FirstOrderStep::new(&self.chain, points);
        while first_order.listed.handles.len() <= self.chain.team.benches
            && !self.is_enough(&first_order.listed, self.covered.links)
        {
            let points = step_points(points.from, points.middle, points.to);
            first_order.extend(points, self.covered.links).map_err(|obstacle| Refused { obstacle, nearer: None })?;
        }
        if self.looks_at_boards() {
            self.boards_are_apart(&first_order.listed, Some(&first_order), self.covered.links).map_err(|benches| {
                let [one, other] =
                    benches.map(|bench| first_order.board(bench.min(first_order.listed.handles.len() - 2)));
                let travelled = self.chain.exact.travelled(first_order.at);
                let inside = travelled.lo >= 0.0
                    && travelled.hi <= self.latest
                    && benches[1] + 1 < first_order.listed.handles.len();
                let nearer = inside
                    .then(|| Upper {
                        value: one.at_most(&other, When::Middle),
                        travelled: points.middle.travelled,
                        head: [first_order.at; 2],
                        benches,
                    })
                    .filter(|nearer| self.upper.is_some_and(|upper| nearer.value < upper.value - LOWER));
                Refused { obstacle: Obstacle::Pair(benches[0], benches[1]), nearer: nearer.map(Nearer::Boards) }
            })?;
        }
        let beside = self.boards_are_beside(&first_order, points.middle.travelled)?;
        let looks = self.looks_at_boards();
        let FirstOrderStep { listed, places, .. } = first_order;
        let spans: Vec<Span> = listed.handles[1..].iter().map(|handle| handle.span).collect();
        let Span(from, to) = listed.handles[0].span;
        let apart = looks.then(|| self.threshold());
        let at = if looks || !beside.is_empty() { places } else { Vec::new() };
        let (links, free) = (self.covered.links, Vec::new());
        let step = Step { links, from, to, moving: false, clear: false, spans, free, apart, beside, at };
        Ok(ShownStep { step, body_forward: listed.body_forward })
    }
}

impl<'t> Walker<&'t GridPoint> for Descent<'_, '_> {
    fn walk(&mut self) -> &mut Walk {
        &mut self.walk
    }

    fn way(&self, to: &'t GridPoint) -> Option<Way<&'t GridPoint>> {
        let (remaining, longest) = (to.travelled - self.at.travelled, self.chain.team.shortest_link());
        let least = LEAST_STEP * (1.0 + self.chain.path.length());
        self.chain.exact.is_before(self.at.head, to.head).then_some(Way { to, remaining, longest, least })
    }

    fn step(&mut self, target: &'t GridPoint, length: Option<f64>, is_least: bool) -> io::Result<Next> {
        self.walk.steps += 1;
        let tried = self.show(self.at.towards(target, length, self.chain.path, &self.chain.exact));
        if self.failed.is_some() {
            return Ok(Next::End(Some("its line cannot be written".to_owned())));
        }
        let Err(Refused { obstacle, nearer }) = tried else { return Ok(Next::Longer) };
        match (nearer, obstacle) {
            (Some(Nearer::Boards(nearer)), _) => self.upper = Some(nearer),
            (Some(Nearer::Obstacle(number, nearer)), _) => self.beside[number].upper = Some(nearer),
            _ if !is_least => {
                if obstacle == Obstacle::Stall(1) {
                    self.covered.links = Links::All;
                }
                return Ok(Next::Shorter);
            }
            (_, Obstacle::Stall(_) | Obstacle::Behind) if self.covered.give_up() => {}
            (_, Obstacle::Stage(number)) => self.beside[number].is_lost = true,
            _ => return Ok(Next::End(Some(format!("a step cannot be shown there: {obstacle:?}")))),
        }
        Ok(Next::Same)
    }
}

/// A step that was shown.
struct ShownStep {
    step: Step,
    /// True if every link behind the head's goes forward.
    body_forward: bool,
}
