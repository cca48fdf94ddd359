//! The least pitch with wrong proposals.

use super::{LeastPitch, Proposal, decided, least_pitch};
use bench_dragon_motion::model::team::Team;

const TEAM: Team = Team { benches: 20, head_length: 0.52, body_length: 0.57, width: 0.054, hole_inset: 0.135 };
const RADIUS: f64 = 0.18;

/// Returns the result for a sequence of proposals, followed by none.
fn with_proposals(proposals: &[f64]) -> LeastPitch {
    let mut proposals = proposals.iter().copied();
    let mut propose = |_, _, _: &mut dyn FnMut(f64)| Proposal { pitch: proposals.next(), ..Proposal::default() };
    decided(&TEAM, RADIUS, &mut propose, false, &mut |_| ()).unwrap().0
}

#[test]
fn a_wrong_proposal_leads_to_the_right_pitch() {
    let known = least_pitch(&TEAM, RADIUS, &mut |_| ()).unwrap();
    println!("{known:?}");
    let (lo, hi) = (known.value_lo, known.value_hi.unwrap());
    assert!(known.proved && hi - lo <= 1e-9 && lo > 3.0 * known.from, "{known:?}");
    // Proposals that are too great, none at all, and too small ones before the right one.
    let free = 0.5 * lo + 0.5 * hi;
    for proposals in [&[1.001 * free][..], &[1.3 * free], &[], &[0.9 * free, free], &[known.from, free]] {
        let found = with_proposals(proposals);
        println!("{proposals:?}: {found:?}");
        let found_hi = found.value_hi.unwrap();
        assert!(found.proved && found_hi - found.value_lo <= 1e-9, "{proposals:?}: {found:?}");
        // Both results enclose the least pitch.
        assert!(found.value_lo <= hi && found_hi >= lo, "{proposals:?}: {found:?} {known:?}");
    }
}
