//! Branches: stretches of the front handle in which a follower is not the first place at its distance ("Follower" of
//! `docs/proofs.md`).
//!
//! In: a path with the branches that the ordinary search has found. Out: the same branches as places and as lines of a
//! certificate. They are suggestions: if one is wrong or missing, the steps there cannot be shown.

use super::grid::place;
use super::lines::CertificateLine;
use super::path::ExactPath;
use super::place::{Place, Span};
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::team::Team;

/// The length, in metres, by which the last branch reaches beyond the path's end.
const BEYOND_END: f64 = 1e-3;

/// A stretch of the front handle of a link in which the follower is the first place at its distance back from `behind`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Branch {
    /// The [kind of the link](link_kind).
    link: usize,
    front: Span,
    behind: Place,
}

/// Returns the branches of a team's links on a path.
pub(super) fn branches(path: &Path, exact: &ExactPath, team: &Team) -> Vec<Branch> {
    let inside = |place: Place, metres: f64| {
        if exact.is_inside(place) { place } else { exact.moved(place, metres, false) }
    };
    let end = path.length();
    let tiny = 1e-14 * (1.0 + end);
    let at = |travelled: f64| {
        let place = place(path.param_at(travelled));
        if travelled >= end { exact.moved(place, BEYOND_END, false) } else { inside(place, tiny) }
    };
    let links = (0..team.benches.min(2)).chain(team.own_tail().map(|_| 2));
    let of_link = |link: usize| {
        let length = team.link(team.kinds()[link]);
        // On parallel lines the place moves, which a certificate cannot state.
        let of_link = path.branches().iter().filter(move |branch| branch.link == length && branch.drift == 0.0);
        of_link.map(move |branch| {
            let front = Span(at(branch.begin), at(branch.end));
            Branch { link, front, behind: inside(place(branch.behind), -tiny) }
        })
    };
    links.flat_map(of_link).filter(|branch| exact.is_before(branch.front.0, branch.front.1)).collect()
}

impl Branch {
    /// Returns the line of a certificate.
    pub fn line(&self) -> CertificateLine<'static> {
        let Self { link, front: Span(from, to), behind } = *self;
        CertificateLine::Branch { link, from, to, behind }
    }
}

/// Returns the kind of a bench's link: 0 for the head's, 2 for that of a tail with a size of its own, 1 for all others.
pub(super) fn link_kind(team: &Team, bench: usize) -> usize {
    if team.own_tail() == Some(bench) { 2 } else { bench.min(1) }
}

/// Cuts a span of the front handle of a link of some kind into the stretches with one rule. A rule is the place from
/// which the follower is the first one back, or `None` for the front handle itself. A place at which two stretches meet
/// is in both.
pub(super) fn rules(
    branches: &[Branch],
    exact: &ExactPath,
    link: usize,
    span: Span,
) -> impl Iterator<Item = (Span, Option<Place>)> {
    let of_link: Vec<&Branch> = branches.iter().filter(|branch| branch.link == link).collect();
    let mut stretches = Vec::with_capacity(2 * of_link.len() + 1);
    let mut end = None;
    for Branch { front: Span(from, to), behind, .. } in of_link {
        if end != Some(*from) {
            stretches.push((end, Some(*from), None));
        }
        stretches.push((Some(*from), Some(*to), Some(*behind)));
        end = Some(*to);
    }
    stretches.push((end, None, None));
    stretches.into_iter().filter_map(move |(from, to, behind)| {
        let from = from.filter(|from| exact.in_order(span.0, *from)).unwrap_or(span.0);
        let to = to.filter(|to| exact.in_order(*to, span.1)).unwrap_or(span.1);
        exact.in_order(from, to).then_some((Span(from, to), behind))
    })
}
