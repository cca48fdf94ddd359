//! First-order enclosures of the listed handles over a step of the head: Lemma 6 of docs/proofs.md.
//!
//! tau is the head's distance in metres from the place m_0, at most `half_step`.

use super::chain::{Chain, span_is_one};
use super::first_order_board::FirstOrderBoard;
use super::handle::Handle;
use super::interval::Interval;
use super::path::{Place, Span};
use super::placement::Mapping;
use super::problem::{Checked, ensure, problem};
use super::scene::Scene;
use super::team::Team;

/// The listed handles over a step.
pub(super) struct FirstOrder {
    pub handles: Vec<Handle>,
    /// An upper bound of |tau|.
    pub half_step: Interval,
}

impl FirstOrder {
    /// Encloses the listed handles of a chain. `at` has a place of each handle's span, the head's first.
    ///
    /// # Errors
    /// A place that is missing or not in its span.
    pub fn new(scene: &Scene, chain: &Chain, at: &[Place]) -> Checked<Self> {
        check_places(scene, chain, at)?;
        let Span(from, to) = chain.capsules[0].span;
        let half_step = scene.path.metres_bound(from, at[0]).max(&scene.path.metres_bound(at[0], to));
        Ok(Self::behind(scene, chain, at, Interval::new(1.0), Interval::new(0.0), half_step))
    }

    /// Encloses the listed handles of a chain from one time of the show to another (Lemma 12, *Further apart*). Here
    /// tau is the time from the middle of the two, in seconds.
    ///
    /// # Errors
    /// A place that is missing or not in its span.
    pub fn in_time(scene: &Scene, chain: &Chain, at: &[Place], from: &Interval, to: &Interval) -> Checked<Self> {
        check_places(scene, chain, at)?;
        let middle = (from + to) * Interval::new(0.5);
        let half_step = (middle - from).max(&(to - middle)).upper();
        let offset = (scene.path.travelled(at[0]) - scene.travelled_at(&middle)).abs().upper();
        Ok(Self::behind(scene, chain, at, scene.speed_between(from, to), offset, half_step))
    }

    /// Encloses the handles behind a head that has the rate P_0 and is at most d_0 from its place at tau = 0.
    fn behind(
        scene: &Scene,
        chain: &Chain,
        at: &[Place],
        rate: Interval,
        offset: Interval,
        half_step: Interval,
    ) -> Self {
        let path = &scene.path;
        let mut handles = vec![Handle::new(path.at(at[0]), &chain.capsules[0], rate, offset, &half_step)];
        for (index, pair) in chain.capsules.windows(2).enumerate() {
            let point = path.at(at[index + 1]);
            let front = &handles[index];
            handles.push(front.follower(point, (&pair[0], &pair[1]), scene.team.link(index), &half_step));
        }
        Self { handles, half_step }
    }

    /// Returns the same handles on the stage.
    pub fn placed(&self, frame: &Mapping) -> Self {
        Self { handles: self.handles.iter().map(|handle| handle.placed(frame)).collect(), half_step: self.half_step }
    }

    /// Returns the board of a bench.
    pub fn board(&self, bench: usize, team: &Team) -> FirstOrderBoard {
        let (front, rear) = (&self.handles[bench], &self.handles[bench + 1]);
        FirstOrderBoard::new(front.clone(), rear.clone(), self.half_step, team.size(bench))
    }

    /// Returns the boards from `first` to the last as one, where the last listed handle is on segment 0, a line.
    pub fn straight_run(&self, first: usize, team: &Team) -> FirstOrderBoard {
        let last = self.handles.len() - 1;
        let front = if first == last {
            self.handles[last].clone()
        } else {
            self.handles[last].behind(&team.links(last, first - 1))
        };
        let size = team.run(first);
        FirstOrderBoard::new(front.clone(), front.behind(&size.link), self.half_step, size)
    }
}

/// Checks that there is a place in the span of each listed handle.
fn check_places(scene: &Scene, chain: &Chain, at: &[Place]) -> Checked {
    let path = &scene.path;
    ensure!(at.len() == chain.capsules.len(), "{} places in `at`, expected {}", at.len(), chain.capsules.len());
    for (handle, (place, capsule)) in at.iter().zip(&chain.capsules).enumerate() {
        span_is_one(scene, Span(*place, *place)).map_err(|problem| problem!("`at` of handle {handle}: {problem}"))?;
        let Span(lo, hi) = capsule.span;
        ensure!(
            path.in_order(lo, *place) && path.in_order(*place, hi),
            "`at` of handle {handle} is not in the handle's span"
        );
    }
    Ok(())
}
