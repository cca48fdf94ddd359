//! Branches: stretches of the front handle in which a follower is not the first place at its distance ("Follower" of
//! docs/proofs.md).

use super::interval::Interval;
use super::path::{Path, Place, Span};
use super::problem::{Checked, ensure, problem};
use super::team::Team;

/// A stretch of the front handle of a link in which the follower is the first place at its distance back from `behind`.
pub(super) struct Branch {
    /// The [kind of the link](Team::link_kind).
    link: usize,
    front: Span,
    behind: Place,
}

/// The branches that a certificate has stated for a dragon, in order for each link.
#[derive(Default)]
pub(super) struct Branches(Vec<Branch>);

impl Branches {
    /// Adds a branch of the links of a [kind](Team::link_kind).
    ///
    /// # Errors
    /// The condition that is violated.
    pub fn add(&mut self, path: &Path, team: &Team, link: usize, front: Span, behind: Place) -> Checked {
        if link > 1 && (link > 2 || team.own_tail().is_none()) {
            return Err(problem!("a branch of link {link}, expected 0, 1, or 2 for a tail with a size of its own"));
        }
        ensure!(
            [front.0, front.1, behind].into_iter().all(|place| path.has(place)),
            "a place of the branch is not inside a segment of the path"
        );
        if front.0 == front.1 || !path.in_order(front.0, front.1) {
            return Err(problem!("the branch is empty, or its ends are not in order"));
        }
        if !Interval::new(0.0).is_below(&path.travelled(front.0)) || front.0.0 == 0 {
            return Err(problem!("the branch begins on the first segment, or not beyond the start"));
        }
        ensure!(path.in_order(behind, front.0), "the place of the branch is not behind the front handle");
        let last = self.0.iter().rfind(|branch| branch.link == link);
        ensure!(
            last.is_none_or(|before| path.in_order(before.front.1, front.0)),
            "the branch begins before the end of the one before it"
        );
        self.0.push(Branch { link, front, behind });
        Ok(())
    }

    /// Cuts a span of the front handle of a link of some kind into the stretches with one rule. A rule is the place from
    /// which the follower is the first one back, or `None` for the front handle itself. A place at which two stretches
    /// meet is in both. Returns `None` if no link has a branch.
    pub fn rules(&self, path: &Path, link: usize, span: Span) -> Option<Vec<(Span, Option<Place>)>> {
        if self.0.is_empty() {
            return None;
        }
        let mut rules = Vec::new();
        let mut add = |from: Option<Place>, to: Option<Place>, behind: Option<Place>| {
            let from = from.filter(|from| path.in_order(span.0, *from)).unwrap_or(span.0);
            let to = to.filter(|to| path.in_order(*to, span.1)).unwrap_or(span.1);
            if path.in_order(from, to) {
                rules.push((Span(from, to), behind));
            }
        };
        let mut end = None;
        for branch in self.0.iter().filter(|branch| branch.link == link) {
            if end != Some(branch.front.0) {
                add(end, Some(branch.front.0), None);
            }
            add(Some(branch.front.0), Some(branch.front.1), Some(branch.behind));
            end = Some(branch.front.1);
        }
        add(end, None, None);
        Some(rules)
    }
}
