//! Boards that are further apart than a number of metres over a step: Lemmas 2, 3 and 6 of docs/proofs.md.

use super::boards::Board;
use super::chain::Chain;
use super::first_order::FirstOrder;
use super::first_order_board::FirstOrderBoard;
use super::handle::When;
use super::interval::Interval;
use super::lines::Links;
use super::path::Span;
use super::problem::{Checked, ensure};
use super::scene::Scene;
use super::unlisted::{check_ring, first_partner, straight_run};

/// Returns true if two boards are certainly further apart than `metres`. Without their first-order enclosures this is
/// tested for 0 m only: the boards do not touch.
pub(super) fn are_apart(
    metres: &Interval,
    [one, other]: [&Board; 2],
    first_order: Option<[&FirstOrderBoard; 2]>,
    when: When,
) -> bool {
    let Some([first, second]) = first_order else { return one.is_apart_from(other) };
    one.is_clearly_apart_by(metres, other)
        || one.is_apart_by(metres, other)
        || first.is_apart_by(metres, second, when)
        || one.is_apart_somehow(metres, other)
}

/// Checks that no two boards that share no handle are as near as `metres`. A step of the front links concerns only the
/// pairs of Lemma 4. `step` has the first-order enclosures of the chain; without it, the metres are 0. Returns the
/// number of pairs.
///
/// # Errors
/// The pair that does not follow.
pub(super) fn check(
    scene: &Scene,
    links: Links,
    chain: &Chain,
    metres: f64,
    step: Option<&FirstOrder>,
) -> Checked<u64> {
    let team = &scene.team;
    let metres = Interval::new(metres);
    let boards: Vec<Board> = (chain.capsules.windows(2).enumerate())
        .map(|(index, pair)| Board::new(&pair[0], &pair[1], team.size(index)))
        .collect();
    let first_order = step.map(|step| Vec::from_iter((0..boards.len()).map(|bench| step.board(bench, team))));
    let first_order = first_order.as_ref();
    let far = metres.max(&Interval::new(0.0));
    let mut pairs = 0;
    for a in 0..boards.len() {
        let Some(first) = first_partner(scene, links, a) else { break };
        for b in first..boards.len() {
            let both = first_order.map(|all| [&all[a], &all[b]]);
            let is_rigid = both.is_some() && are_on_one_circle(scene, chain, a, b);
            let when = if is_rigid { When::Middle } else { When::Always };
            let is_apart = are_apart(&metres, [&boards[a], &boards[b]], both, when)
                || check_ring(scene, chain, a..a + 1, b, &far).is_ok();
            ensure!(is_apart, "benches {a} and {b} may touch, or be nearer than it says (Lemmas 2 and 6)");
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
        let is_apart = |first: usize| {
            let (front, rear, size) = straight_run(scene, chain, first);
            let run = step.map(|step| step.straight_run(first, team));
            let both = first_order.zip(run.as_ref()).map(|(all, run)| [&all[a], run]);
            are_apart(&metres, [&boards[a], &Board::new(&front, &rear, size)], both, When::Always)
        };
        ensure!(
            team.runs(chain.last().max(first)).all(is_apart),
            "bench {a} may touch one on the line, or be nearer than it says (Lemmas 2, 3 and 6)"
        );
        pairs += 1;
    }
    // Boards on the line among themselves.
    ensure!(
        metres.is_below(&(team.link(1) - team.hole_inset - team.hole_inset)),
        "benches on a line may touch, or be nearer than it says (Lemma 3)"
    );
    Ok(pairs)
}

/// Returns true if all handles of two boards, and the handles between, stay on one arc (Lemma 6, *Rigid*).
fn are_on_one_circle(scene: &Scene, chain: &Chain, a: usize, b: usize) -> bool {
    let (Span(_, latest), Span(earliest, _)) = (chain.capsules[a].span, chain.capsules[b + 1].span);
    latest.0 == earliest.0 && scene.path.is_arc(latest.0)
}
