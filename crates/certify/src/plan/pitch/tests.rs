//! The least pitch with wrong proposals.

use super::{LeastPitch, Obstacle, Proposal, decided, least_pitch};
use bench_dragon_motion::event::{Progress, unreported};
use bench_dragon_motion::model::team::{Ends, Team};

const TEAM: Team =
    Team { benches: 20, head_length: 0.52, body_length: 0.57, width: 0.054, hole_inset: 0.135, ends: Ends::NONE };
const RADIUS: f64 = 0.18;

/// Returns the result for a sequence of proposed pitches, followed by none.
fn with_proposals(proposals: &[f64]) -> LeastPitch {
    let mut proposals = proposals.iter().copied();
    let mut propose = |_, _, _: Progress<'_>| Proposal { pitch: proposals.next(), ..Proposal::default() };
    decided((&TEAM).into(), RADIUS, &mut propose, false, &mut unreported).unwrap().0
}

#[test]
fn a_wrong_proposal_leads_to_the_right_pitch() {
    let known = least_pitch(&TEAM, RADIUS, &mut unreported).unwrap();
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

#[test]
fn wrong_obstacles_of_a_proposal_only_cost_time() {
    let known = least_pitch(&TEAM, RADIUS, &mut unreported).unwrap();
    let free = 0.5 * known.value_lo + 0.5 * known.value_hi.unwrap();
    let pair = known.overlap.map(|overlap| (overlap.bench_a, overlap.bench_b)).unwrap();
    let touch = |pair, head_radius| Some(Obstacle::Touch { pair, head_radius });
    for (first, last) in [
        (touch((0, 2), 10.0), touch((0, 2), 10.0)),
        (touch((3, 7), RADIUS), touch(pair, 10.0)),
        (Some(Obstacle::Lock), Some(Obstacle::Lock)),
        (None, touch(pair, RADIUS)),
    ] {
        let mut propose = |_, _, _: Progress<'_>| Proposal { pitch: Some(free), first, last };
        let (found, _) = decided((&TEAM).into(), RADIUS, &mut propose, false, &mut unreported).unwrap();
        assert!(found.proved, "{first:?} {last:?}: {found:?}");
        assert!((found.value_lo - known.value_lo).abs() < 1e-9, "{first:?} {last:?}: {found:?} {known:?}");
    }
}

/// Boards that come free and meet again before the least pitch.
#[test]
fn a_pair_of_boards_that_meets_again_is_no_end() {
    let team = |benches, length, width, hole_inset| Team {
        benches,
        head_length: length,
        body_length: length,
        width,
        hole_inset,
        ends: Ends::NONE,
    };
    for (team, radius) in [
        (team(15, 1.0024901830117714, 0.260087030130667, 0.20572542372242547), 0.295_520),
        (team(18, 0.5405721156603309, 0.11595298473749256, 0.12469722446346694), 0.291_178),
    ] {
        let found = least_pitch(&team, radius, &mut unreported).unwrap();
        assert!(found.proved, "{found:?}");
    }
}
