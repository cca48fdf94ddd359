//! Boards that stay further than a number of metres from obstacles over a step: Lemmas 9 and 11 of docs/proofs.md.

use super::boards::Board;
use super::capsule::Capsule;
use super::chain::Chain;
use super::first_order::FirstOrder;
use super::interval::Interval;
use super::lines::Links;
use super::problem::{Checked, ensure};
use super::scene::Scene;
use super::team::Size;
use super::unlisted::straight_run;

/// Checks the claims of a step about obstacles: by number, the metres that the clearance of each board is more than.
/// `step` has the first-order enclosures of the chain; without it, the metres are 0.
///
/// # Errors
/// The obstacle that does not follow.
pub(super) fn check(
    scene: &Scene,
    links: Links,
    chain: &Chain,
    claims: &[Option<f64>],
    step: Option<&FirstOrder>,
) -> Checked {
    if claims.iter().all(Option::is_none) {
        return Ok(());
    }
    let runs = runs(scene, links, chain);
    let boards = boards(scene, links, chain, &runs);
    let first_order = |step: &FirstOrder, bench: usize| {
        let is_listed = bench < chain.last();
        if is_listed { step.board(bench, &scene.team) } else { step.straight_run(bench, &scene.team) }
    };
    let boards: Vec<_> =
        boards.into_iter().map(|(bench, board)| (bench, board, step.map(|step| first_order(step, bench)))).collect();
    for (number, (obstacle, metres)) in scene.obstacles.iter().zip(claims).enumerate() {
        let Some(metres) = metres.map(Interval::new) else { continue };
        for (bench, board, first_order) in &boards {
            let (is_further, wrong, lemma) = match first_order {
                Some(first) => (obstacle.is_further_than(&metres, board, first), "nearer than it says to", 11),
                None => (obstacle.is_avoided_by(board), "at", 9),
            };
            ensure!(is_further, "bench {bench}, or one behind it, may be {wrong} obstacle {number} (Lemma {lemma})");
        }
    }
    Ok(())
}

/// The first of some boards on the line without end, the first and the last handle, and their size.
type Run = (usize, Capsule, Capsule, Size);

/// Returns the boards on the line without end that a step does not list: all, or of a step of the front links a tail
/// with a size of its own.
fn runs(scene: &Scene, links: Links, chain: &Chain) -> Vec<Run> {
    let last = chain.last();
    let first = if links == Links::All { Some(last) } else { scene.team.own_tail() };
    let first = first.filter(|first| (last..scene.team.benches).contains(first));
    let run = |first: usize| {
        let (front, rear, size) = straight_run(scene, chain, first);
        (first, front, rear, size)
    };
    first.into_iter().flat_map(|first| scene.team.runs(first)).map(run).collect()
}

/// Returns the boards that obstacles concern, with their benches: all, those on the line as one, or boards 0 and 1 and
/// a tail with a size of its own.
fn boards<'c>(scene: &Scene, links: Links, chain: &'c Chain, runs: &'c [Run]) -> Vec<(usize, Board<'c>)> {
    let team = &scene.team;
    let concerns = |bench: &usize| links == Links::All || *bench < 2 || team.own_tail() == Some(*bench);
    let mut boards: Vec<(usize, Board)> = (chain.capsules.windows(2).enumerate())
        .filter(|(bench, _)| concerns(bench))
        .map(|(bench, pair)| (bench, Board::new(&pair[0], &pair[1], team.size(bench))))
        .collect();
    boards.extend(runs.iter().map(|(first, front, rear, size)| (*first, Board::new(front, rear, *size))));
    boards
}
