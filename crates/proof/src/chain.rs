//! The chain over the spans of its handles: Lemma 1 for each listed link.

use super::capsule::Capsule;
use super::interval::{Interval, Vector};
use super::link;
use super::path::{Place, Span};
use super::problem::{Checked, problem};
use super::scene::Scene;

/// The listed handles, from handle 0 (the head) on. Each is in its span while the head is in the head's span.
pub(super) struct Chain {
    /// The capsule of each handle.
    pub capsules: Vec<Capsule>,
    /// The front product at its follower, for each link.
    pub products: Vec<Interval>,
}

impl Chain {
    /// Checks Lemma 1 for all links over the spans of the head and of the handles 1, 2, ...
    ///
    /// # Errors
    /// The link that does not follow.
    pub fn check(scene: &Scene, head: Span, spans: &[Span]) -> Checked<Self> {
        let (path, team) = (&scene.path, &scene.team);
        if spans.len() > team.benches {
            return Err(problem!("{} spans, but there are only {} benches", spans.len(), team.benches));
        }
        let mut capsules: Vec<Capsule> = Vec::with_capacity(spans.len() + 1);
        let mut products = Vec::with_capacity(spans.len());
        let mut front_ends: Option<[Vector; 2]> = None;
        for (handle, span) in std::iter::once(&head).chain(spans).enumerate() {
            span_is_one(scene, *span).map_err(|problem| problem!("handle {handle}: {problem}"))?;
            let (capsule, ends) = (Capsule::new(path, *span), [span.0, span.1].map(|place| path.at(place).point));
            if let (Some(front), Some(front_ends)) = (capsules.last(), front_ends) {
                let index = handle - 1;
                let (one, several) =
                    ([(front.span, None)], scene.branches.rules(path, team.link_kind(index), front.span));
                let rules = several.as_deref().unwrap_or(&one);
                let product = link::check(path, (front, front_ends), (&capsule, ends), team.link(index), rules)
                    .map_err(|problem| problem!("link {index}: {problem} (Lemma 1)"))?;
                products.push(product);
            }
            capsules.push(capsule);
            front_ends = Some(ends);
        }
        Ok(Self { capsules, products })
    }

    /// Returns the last listed handle.
    pub fn last(&self) -> usize {
        self.capsules.len() - 1
    }

    /// Returns true if the last handle is on segment 0, a line: then all handles behind it are too (Lemma 3, *Line*).
    pub fn ends_on_line(&self, scene: &Scene) -> bool {
        let Span(_, latest) = self.capsules[self.last()].span;
        latest.0 == 0 && scene.path.is_line(0)
    }
}

/// Checks that a span is valid: two places strictly inside segments, in order.
pub(super) fn span_is_one(scene: &Scene, Span(lo, hi): Span) -> Checked {
    for place in [lo, hi] {
        if !scene.path.has(place) {
            let Place(segment, coordinate, _) = place;
            return Err(problem!("[{segment}, {coordinate:?}] is not inside a segment of the path"));
        }
    }
    if scene.path.in_order(lo, hi) { Ok(()) } else { Err(problem!("the span's ends are not in order")) }
}
