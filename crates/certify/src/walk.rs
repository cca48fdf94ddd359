//! Parts that the searches by steps share: the length of the next step, and the links that it shows.

use super::lines::Links;
use super::place::Span;
use super::step::Chain;

/// The share of the way to a target from which on a step goes to the target: a short step is not left over.
const NEARLY: f64 = 0.9;

/// The length of the next step to try: metres of travel, or seconds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stride {
    length: f64,
    /// The factor of the length after a step that is shown.
    growth: f64,
}

impl Stride {
    pub fn new(length: f64, growth: f64) -> Self {
        Self { length, growth }
    }

    /// Makes the next step no longer than a length.
    pub fn limit(&mut self, longest: f64) {
        self.length = self.length.min(longest);
    }

    /// Returns the length of the next step, which is not beyond a target that is `remaining` further on.
    pub fn within(&self, remaining: f64) -> f64 {
        self.length.min(remaining)
    }

    /// Returns true if the next step goes to a target that is `remaining` further on.
    pub fn is_to_target(&self, remaining: f64) -> bool {
        self.length >= NEARLY * remaining
    }

    /// Lengthens the step after one that is shown.
    pub fn grow(&mut self, longest: f64) {
        self.length = (self.length * self.growth).min(longest);
    }

    /// Shortens the step by a factor after one that is not shown.
    pub fn shrink(&mut self, factor: f64, remaining: f64) {
        self.length = factor * self.within(remaining);
    }
}

/// The links that steps show: all, or the front ones while Lemma 4 gives the others.
#[derive(Debug, Clone, Copy)]
pub(super) struct Covered {
    pub links: Links,
    /// True if Lemma 4 may still be used.
    is_possible: bool,
}

impl Covered {
    pub fn new() -> Self {
        Self { links: Links::All, is_possible: true }
    }

    /// Adds a step that is shown: the spans of the handles from 1 on, and true if every link behind the head's goes
    /// forward in it. Once handle 2 has come to the start of handle 1, the front links suffice.
    pub fn add(&mut self, chain: &mut Chain, spans: &[Span], body_forward: bool) {
        chain.start = chain.start.or(spans.first().map(|span| span.1));
        self.is_possible &= body_forward;
        if !self.is_possible {
            self.links = Links::All;
        } else if let (Some(start), Some(second)) = (chain.start, spans.get(1))
            && chain.exact.in_order(start, second.0)
        {
            self.links = Links::Front;
        }
    }

    /// Gives up Lemma 4. Returns true if steps have used it.
    pub fn give_up(&mut self) -> bool {
        let is_used = self.links == Links::Front;
        if is_used {
            *self = Self { links: Links::All, is_possible: false };
        }
        is_used
    }
}
