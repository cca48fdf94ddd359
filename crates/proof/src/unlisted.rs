//! The boards behind the last listed handle: Lemma 3 of docs/proofs.md.

use std::ops::Range;

use super::boards::is_inside_ring;
use super::capsule::Capsule;
use super::chain::Chain;
use super::interval::Interval;
use super::path::Span;
use super::scene::Scene;

/// Returns the first and the last handle of the boards from `first` on, and the metres between the two. Precondition:
/// the last listed handle is on segment 0, a line.
pub(super) fn straight_run(scene: &Scene, chain: &Chain, first: usize) -> (Capsule, Capsule, Interval) {
    let (team, last) = (&scene.team, chain.last());
    let length = team.links(first, team.benches - 1);
    let front: Capsule = if first == last {
        chain.capsules[last].clone()
    } else {
        chain.capsules[last].behind(&team.links(last, first - 1))
    };
    let rear = front.behind(&length);
    (front, rear, length)
}

/// Checks Lemma 3, *Ring*: some boards are more than `metres` apart from all body boards from a handle on.
pub(super) fn check_ring(
    scene: &Scene,
    chain: &Chain,
    boards: Range<usize>,
    from_handle: usize,
    metres: &Interval,
) -> Result<(), String> {
    let Span(_, latest) = chain.capsules[from_handle].span;
    let ring = scene.path.spiral_radius(latest).filter(|_| latest.0 == 0);
    let ring = ring.ok_or("it claims to be clear, but the last handle listed is not on segment 0, an inward spiral")?;
    let reach = (chain.capsules[boards.start..=boards.end].iter())
        .map(|capsule| capsule.point.norm() + capsule.half)
        .fold(Interval::new(0.0), |most, metres| most.max(&metres));
    if is_inside_ring(&scene.team, &reach, &ring, metres) {
        Ok(())
    } else {
        Err("it claims to be clear, but benches 0 and 1 may touch one that is not listed (Lemma 3)".to_owned())
    }
}
