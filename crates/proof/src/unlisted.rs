//! The boards behind the last listed handle: Lemma 3 of docs/proofs.md.

use std::ops::Range;

use super::boards::is_inside_ring;
use super::capsule::Capsule;
use super::chain::Chain;
use super::interval::Interval;
use super::lines::Links;
use super::path::Span;
use super::problem::{Checked, problem};
use super::scene::Scene;
use super::team::Size;

/// Returns the first and the last handle of the run of equal boards from `first` on, and its size as one board.
/// Precondition: the last listed handle is on segment 0, a line.
pub(super) fn straight_run(scene: &Scene, chain: &Chain, first: usize) -> (Capsule, Capsule, Size) {
    let (team, last) = (&scene.team, chain.last());
    let size = team.run(first);
    let front: Capsule = if first == last {
        chain.capsules[last].clone()
    } else {
        chain.capsules[last].behind(&team.links(last, first - 1))
    };
    let rear = front.behind(&size.link);
    (front, rear, size)
}

/// Returns the first bench behind a bench from which on a step must show the pairs of both to be apart, if there is one.
/// A step of the front links leaves out the pairs that Lemma 4 shows: those without boards 0 and 1, and without a tail
/// that has a size of its own. That tail is the last bench.
pub(super) fn first_partner(scene: &Scene, links: Links, bench: usize) -> Option<usize> {
    let first = if links == Links::All || bench < 2 { Some(bench + 2) } else { scene.team.own_tail() };
    first.filter(|first| bench + 2 <= *first && *first < scene.team.benches)
}

/// Checks Lemma 3, *Ring*: some boards are more than `metres` apart from all boards from a handle on, which is not
/// the head's.
pub(super) fn check_ring(
    scene: &Scene,
    chain: &Chain,
    boards: Range<usize>,
    from_handle: usize,
    metres: &Interval,
) -> Checked {
    let Span(_, latest) = chain.capsules[from_handle].span;
    let ring = scene.path.spiral_radius(latest).filter(|_| latest.0 == 0);
    let ring = ring.ok_or_else(|| {
        problem!(
            "boards may touch those that are not listed: the last handle listed is not on segment 0, an inward spiral"
        )
    })?;
    let of_boards = |bench| scene.team.size(bench).width;
    let width = boards.clone().map(of_boards).fold(Interval::new(0.0), |most, width| most.max(&width));
    let reach = (chain.capsules[boards.start..=boards.end].iter())
        .map(|capsule| capsule.point.norm() + capsule.half)
        .fold(Interval::new(0.0), |most, metres| most.max(&metres));
    if is_inside_ring(&scene.team, &reach, &width, &ring, metres) {
        Ok(())
    } else {
        Err(problem!("benches 0 and 1 may touch one that is not listed, or be nearer than it says (Lemma 3)"))
    }
}
