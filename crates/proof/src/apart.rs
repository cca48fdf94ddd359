//! Boards that are further apart than a number of metres over a step: Lemma 6 of docs/proofs.md.

use super::boards::Board;
use super::chain::Chain;
use super::first_order::FirstOrder;
use super::first_order_board::FirstOrderBoard;
use super::handle::When;
use super::interval::Interval;
use super::lines::Links;
use super::path::Span;
use super::problem::{Checked, ensure, problem};
use super::scene::Scene;
use super::unlisted::{check_ring, first_partner, straight_run};

/// Checks that no two boards that share no handle are as near as `metres`. A step of the front links concerns only the
/// pairs of Lemma 4. `step` has the first-order enclosures of the chain. Returns the number of pairs.
///
/// # Errors
/// The pair that does not follow.
pub(super) fn check(scene: &Scene, links: Links, chain: &Chain, step: &FirstOrder, metres: f64) -> Checked<u64> {
    let team = &scene.team;
    let metres = Interval::new(metres);
    let boards: Vec<Board> = (chain.capsules.windows(2).enumerate())
        .map(|(index, pair)| Board::new(&pair[0], &pair[1], team.size(index)))
        .collect();
    let first_order: Vec<FirstOrderBoard> = (0..boards.len()).map(|bench| step.board(bench, team)).collect();
    let far = metres.max(&Interval::new(0.0));
    let mut pairs = 0;
    for a in 0..boards.len() {
        let Some(first) = first_partner(scene, links, a) else { break };
        for b in first..boards.len() {
            let when = if are_on_one_circle(scene, chain, a, b) { When::Middle } else { When::Always };
            let is_apart = boards[a].is_clearly_apart_by(&metres, &boards[b])
                || boards[a].is_apart_by(&metres, &boards[b])
                || first_order[a].is_apart_by(&metres, &first_order[b], when)
                || boards[a].is_apart_somehow(&metres, &boards[b])
                || check_ring(scene, chain, a..a + 1, b, &far).is_ok();
            ensure!(is_apart, "benches {a} and {b} may be nearer than it says (Lemma 6)");
            pairs += 1;
        }
    }
    if chain.last() == team.benches {
        return Ok(pairs);
    }
    if !chain.ends_on_line(scene) {
        // Only a step of the front links gets here.
        check_ring(scene, chain, 0..2, chain.last(), &far)?;
        return Ok(pairs + 2);
    }
    for a in 0..boards.len() {
        let Some(first) = first_partner(scene, links, a) else { break };
        let first = chain.last().max(first);
        let is_apart = |first: usize| {
            let (front, rear, size) = straight_run(scene, chain, first);
            let run = Board::new(&front, &rear, size);
            boards[a].is_clearly_apart_by(&metres, &run)
                || boards[a].is_apart_by(&metres, &run)
                || first_order[a].is_apart_by(&metres, &step.straight_run(first, team), When::Always)
                || boards[a].is_apart_somehow(&metres, &run)
        };
        ensure!(
            team.runs(first).all(is_apart),
            "bench {a} may be nearer to one on the line than it says (Lemmas 3 and 6)"
        );
        pairs += 1;
    }
    // Boards on the line among themselves.
    if links == Links::All && !metres.is_below(&(team.link(1) - team.hole_inset - team.hole_inset)) {
        return Err(problem!("benches on a line may be nearer than it says (Lemma 3)"));
    }
    Ok(pairs)
}

/// Returns true if all handles of two boards, and the handles between, stay on one arc (Lemma 6, *Rigid*).
fn are_on_one_circle(scene: &Scene, chain: &Chain, a: usize, b: usize) -> bool {
    let (Span(_, latest), Span(earliest, _)) = (chain.capsules[a].span, chain.capsules[b + 1].span);
    latest.0 == earliest.0 && scene.path.is_arc(latest.0)
}
