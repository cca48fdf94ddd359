//! The walk of a search to a goal in steps, and the links that steps show.

use std::io;
use std::ops::ControlFlow;

use super::lines::Links;
use super::place::Span;
use super::step::Chain;

/// The share of the way from which on a step goes to its end: a short step is not left over.
const NEARLY: f64 = 0.9;

/// The share of the longest step with which a walk begins.
const FIRST: f64 = 0.25;

/// The factors of the length of a step after one that is shown, and after one that is refused.
const GROWTH: f64 = 1.3;
const SHRINK: f64 = 0.5;

/// The state of a walk. Lengths are metres of travel, or seconds.
pub(super) struct Walk {
    /// The length of the next step to try.
    pub length: f64,
    /// The factor of the length after a step that is shown.
    pub growth: f64,
    /// The factors after a step that is refused: the first one after a step that is shown, and each further one.
    pub shrinks: [f64; 2],
    /// The steps that the search has counted: those that are shown, or all that were tried.
    pub steps: u64,
    /// The steps after which the search is given up.
    pub most_steps: u64,
}

impl Walk {
    /// Creates the state of a walk whose longest step, at first, is `longest`.
    pub fn new(longest: f64, most_steps: u64) -> Self {
        Self { length: FIRST * longest, growth: GROWTH, shrinks: [SHRINK; 2], steps: 0, most_steps }
    }
}

/// The way that lies before a search.
pub(super) struct Way<To> {
    /// The place up to which the next step may go: the goal, or a place before it.
    pub to: To,
    /// The length up to there.
    pub remaining: f64,
    /// The longest step from here.
    pub longest: f64,
    /// The length from which on a step is not shortened any more.
    pub least: f64,
}

/// The next step after one that was tried.
pub(super) enum Next {
    /// A longer step, because this one is shown.
    Longer,
    /// A step of the same length, because the search claims less now.
    Same,
    /// A shorter step, because this one is refused.
    Shorter,
    /// No step, with the reason if that is an end before the goal.
    End(Option<String>),
}

/// A search that walks to a goal in steps.
pub(super) trait Walker<To: Copy> {
    /// Returns the state of the walk.
    fn walk(&mut self) -> &mut Walk;

    /// Returns the way to a goal; `None` if the search is there.
    fn way(&self, goal: To) -> Option<Way<To>>;

    /// Tries and counts a step of a length, or without one up to `to`. Nothing shorter follows a step that `is_least`.
    fn step(&mut self, to: To, length: Option<f64>, is_least: bool) -> io::Result<Next>;

    /// Walks to a goal. Returns the reason if the walk ends before it. `progress` is asked before each step.
    fn walk_to(&mut self, goal: To, mut progress: impl FnMut(&Self) -> ControlFlow<()>) -> io::Result<Option<String>> {
        let mut refused = 0;
        while let Some(Way { to, remaining, longest, least }) = self.way(goal) {
            if progress(self).is_break() {
                return Ok(Some("the search was stopped there".to_owned()));
            }
            let walk = self.walk();
            walk.length = walk.length.min(longest);
            let (length, is_short) = (walk.length.min(remaining), walk.length < NEARLY * remaining);
            let next = self.step(to, is_short.then_some(length), length <= least)?;
            let walk = self.walk();
            match next {
                Next::Longer => (walk.length, refused) = (walk.length * walk.growth, 0),
                Next::Same => {}
                Next::Shorter => (walk.length, refused) = (length * walk.shrinks[refused], 1),
                Next::End(because) => return Ok(because),
            }
            if walk.steps > walk.most_steps {
                return Ok(Some(format!("the search was given up after {} steps", walk.steps)));
            }
        }
        Ok(None)
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
