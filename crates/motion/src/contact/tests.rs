use std::f64::consts::TAU;
use std::ops::ControlFlow;

use proptest::prelude::*;

use super::*;
use crate::cases::cases;
use crate::event::unreported;
use crate::model::curve::Side;
use crate::model::team::Ends;
use crate::model::team::tests::{Factors, any_ends};
use crate::model::{Point, Vector};
use crate::placement::Placement;
use crate::singularities::Singularities;

mod ground;

const PAPER: Team =
    Team { benches: 223, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275, ends: Ends::NONE };

/// Returns the path with the branches of the followers, and the singular configurations.
fn followed(path: &Path, team: &Team) -> (Path, Singularities) {
    let mut unreported = unreported;
    let singular = Singularities::search(path, team, &mut Budget::new(20_000_000, &mut unreported));
    (path.clone().with_branches(singular.branches.clone()), singular)
}

/// Returns the results of the searches for a whole motion: the contact, the least clearance up to `show_end`, the
/// motion's end.
fn search(path: &Path, team: &Team, show_end: Option<f64>) -> (Option<Event>, Option<LeastClearance>, f64) {
    let mut unreported = unreported;
    let mut budget = Budget::new(200_000_000, &mut unreported);
    let (path, singular) = followed(path, team);
    let end = singular.end.map_or(singular.searched_until, |end| end.travelled);
    let searches = ConservativeAdvancement::new(&path, team, &singular.head_turns, &singular.body_turns)
        .with_tail_turns(&singular.tail_turns);
    let contact = searches.first_contact(0.0, end, &mut budget).unwrap();
    let least = searches.least_clearance(0.0, show_end.unwrap_or(end), &mut budget).unwrap();
    assert!(contact.searched_until >= end && least.searched_until >= show_end.unwrap_or(end));
    (contact.value, least.value, end)
}

/// The least clearance of all pairs at one place of the head.
fn all_pairs(path: &Path, team: &Team, travelled: f64) -> f64 {
    let mut unreported = unreported;
    let mut budget = Budget::new(u64::MAX, &mut unreported);
    let at = Configuration::at_lock(path, team, travelled, team.benches, &mut budget).unwrap();
    let pairs = (0..team.benches).flat_map(|a| (a + 2..team.benches).map(move |b| (a, b)));
    at.deepest(&pairs.collect::<Vec<_>>()).unwrap().0
}

/// The lock and the clearance there with 40 digits: the fold of the chord, and the boards with the head's link
/// perpendicular to the spiral. The clearance falls with the root of the travel before it.
#[test]
fn the_least_clearance_at_a_lock_has_its_digits() {
    let (head_length, body_length) = (1.911_232_195_148_669_5, 1.776_465_820_425_115);
    let (width, hole_inset) = (0.265_173_696_612_851, 0.269_790_637_091_093_7);
    let team = Team { benches: 3, head_length, body_length, width, hole_inset, ends: Ends::NONE };
    let (_, least, end) = search(&Path::spiral(0.789_491_157_773_502_9, 4.955_663_058_729_437), &team, None);
    let LeastClearance { value, travelled, .. } = least.unwrap();
    assert!((value - 0.348_674_460_158_572_3).abs() < 1e-12, "{value}");
    assert!((travelled - 2.082_175_601_857_538_4 * 28.884_510_050_333_898).abs() < 1e-12 && travelled == end);
}

/// The same with 50 digits for boards of three widths: the head's link locks, and its board is not as wide as the body.
#[test]
fn the_least_clearance_at_a_lock_is_that_of_boards_of_their_own_size() {
    let ends = Ends {
        head_width: Some(0.158_966_245_735_522_4),
        tail_width: Some(1.778_867_732_431_596_5),
        tail_length: Some(0.108),
    };
    let (width, hole_inset) = (0.529_887_485_785_074_7, 0.005);
    let team = Team { benches: 3, head_length: 1.753_705_563_082_050_2, body_length: 0.5, width, hole_inset, ends };
    let (contact, least, end) = search(&Path::spiral(1.501_138_711_251_048, 2.0), &team, None);
    let LeastClearance { value, travelled, .. } = least.unwrap();
    assert!((value - 0.063_119_201_761_604_89).abs() < 1e-12 && contact.is_none(), "{value}");
    assert!((travelled - 18.654_484_663_820_426).abs() < 1e-12 && travelled == end, "{travelled}");
}

/// Checks that equally spaced configurations do not contradict the searches.
fn check(path: &Path, team: &Team, samples: usize) -> Result<(), TestCaseError> {
    let (contact, least, end) = search(path, team, None);
    let (path, least) = (&followed(path, team).0, least.unwrap());
    let close = |one: f64, other: f64| (one - other).abs() <= 1e-11 * (1.0 + team.longest_link());
    if let Some(contact) = contact {
        let there = all_pairs(path, team, contact.travelled);
        prop_assert!(close(there, 0.0) || (contact.travelled == 0.0 && there < 0.0), "{contact:?} {there}");
        prop_assert!(least.value <= 0.0, "{contact:?} {least:?}");
    } else {
        prop_assert!(least.value > 0.0, "{least:?}");
    }
    prop_assert!(close(all_pairs(path, team, least.travelled), least.value), "{least:?}");
    for k in 0..samples {
        let travelled = end * k as f64 / samples as f64;
        let sampled = all_pairs(path, team, travelled);
        prop_assert!(sampled >= least.value - 1e-12, "{least:?}, but {sampled} at {travelled}");
        let before = contact.is_none_or(|contact| travelled < contact.travelled);
        prop_assert!(!before || sampled > 0.0, "{contact:?}, but {sampled} at {travelled}");
    }
    Ok(())
}

fn assert_contact(path: &Path, team: &Team, travelled: f64, benches: (u32, u32)) -> Point {
    let (contact, ..) = search(path, team, Some(1.0));
    let contact = contact.unwrap();
    assert!((contact.travelled - travelled).abs() < 2e-12 * travelled, "{}", contact.travelled);
    assert_eq!((contact.bench_a, contact.bench_b), (Some(benches.0), Some(benches.1)));
    contact.place.unwrap()
}

#[test]
fn spirals_touch_where_the_earlier_searches_did() {
    let place = assert_contact(&Path::spiral(0.55, 16.0), &PAPER, 412.473_837_682_114_8, (0, 8));
    assert!((place - Point::new(1.474_394_671_647_727_4, 2.110_664_876_932_433)).norm() < 1e-11, "{place}");
    assert_contact(&Path::spiral(0.45, 16.0), &PAPER, 215.337_252_953_147_58, (0, 19));
    assert_contact(&Path::spiral(0.55, 6.0), &Team { benches: 20, ..PAPER }, 32.298_201_353_636_706, (0, 8));
    let all_but_touching =
        Team { benches: 3, head_length: 1.996, body_length: 1.996, width: 0.1, hole_inset: 0.498, ends: Ends::NONE };
    assert_contact(&Path::spiral(2.4, 12.0), &all_but_touching, 657.988_566_973_9, (0, 2));
}

#[test]
fn a_touch_within_a_step_in_which_handles_turn_is_found() {
    let team = Team { benches: 12, head_length: 1.7, body_length: 3.7, width: 0.05, hole_inset: 0.6, ends: Ends::NONE };
    let lane = Path::route(0.25).line(19.994_074_807_700_006).arc(Side::Right, 3.0, 0.75).line(2.1);
    let bend = lane.arc(Side::Left, 0.3, 0.25).line(0.36).arc(Side::Left, 0.01, 1.0);
    let path = bend.arc(Side::Left, 0.039_788_735_772_973_836, 4.0).build().unwrap();
    assert_contact(&path, &team, 37.145_313_188_924, (1, 8));
}

#[test]
fn the_least_clearance_of_a_turnaround() {
    let path = Path::turnaround(1.7, 4.5, 2.0, 100.0, 369.16).unwrap();
    let (contact, least, _) = search(&path, &PAPER, None);
    let least = least.unwrap();
    assert!(contact.is_none() && (least.bench_a, least.bench_b) == (0, 16), "{least:?}");
    assert!((least.value - 0.279_042_939_008_634).abs() < 1e-13 && (least.travelled - 130.159_928_5).abs() < 1e-5);
}

#[test]
fn a_straight_procession_is_one_step() {
    let path = Path::route(0.1).line(1e6).build().unwrap();
    for team in [PAPER, Team { benches: 3, ..PAPER }] {
        let searches = ConservativeAdvancement::new(&path, &team, &[], &[]);
        let mut unreported = unreported;
        let mut budget = Budget::new(20_000, &mut unreported);
        let contact = searches.first_contact(0.0, 1e6, &mut budget).unwrap();
        let least = searches.least_clearance(0.0, 1e6, &mut budget).unwrap();
        assert!(contact == Found { value: None, searched_until: 1e6 } && least.searched_until == 1e6);
        assert!((least.value.unwrap().value - 1.1).abs() < 1e-10);
    }
}

/// Dragons that wait and then go side by side, and dragons that part: the guess is the least clearance.
#[test]
fn two_dragons_that_are_nearest_at_the_start_take_few_steps() {
    let (path, team) = (Path::route(0.0).line(1e4).build().unwrap(), Team { benches: 20, ..PAPER });
    let behind = 2.0 * (team.length() + team.hole_inset) + 1.5;
    for (delay, origin, turns) in [(50.0, Vector::new(0.3, 1.8), 0.0), (0.0, Vector::new(-behind, 0.0), 0.5)] {
        let moving = [(Vector::zeros(), 0.0), (origin, turns)].map(|(origin, turns)| {
            let chain = ConservativeAdvancement::new(&path, &team, &[], &[]);
            let placement = Placement::new(origin, turns, false);
            let mut unreported = unreported;
            let mut budget = Budget::new(u64::MAX, &mut unreported);
            between::MovingDragon::new(chain, placement, delay, 1.0, 1e4, &mut budget).unwrap()
        });
        let (moving, mut unreported) = ([&moving[0], &moving[1]], unreported);
        let mut budget = Budget::new(1_000_000, &mut unreported);
        let guess = between::guess_least_clearance(moving, (0.0, 1e3), &mut budget).unwrap();
        assert!((guess.unwrap().value - 1.5).abs() < 1e-12, "{guess:?}");
        let mut budget = Budget::new(100_000, &mut unreported);
        let found = between::least_clearance(moving, (0.0, 1e3), guess, &mut budget).unwrap();
        assert_eq!(found, Found { value: None, searched_until: 1e3 }, "{origin}");
    }
}

#[test]
fn what_overlaps_at_the_start_is_the_deepest_pair() {
    let path = Path::spiral(0.2, 16.0);
    let (contact, ..) = search(&path, &PAPER, Some(0.1));
    let contact = contact.unwrap();
    let mut unreported = unreported;
    let mut start = Configuration::new(&path, 0.0);
    start.solve_to(223, &path, &PAPER, &mut Budget::new(u64::MAX, &mut unreported)).unwrap();
    let pair = (contact.bench_a.unwrap() as usize, contact.bench_b.unwrap() as usize);
    assert_eq!((contact.travelled, start.clearance(pair)), (0.0, all_pairs(&path, &PAPER, 0.0)));
}

#[test]
fn rounding_in_the_last_digits_before_a_lock_is_no_error() {
    let hole_inset = 0.028413322610933628;
    let team = Team {
        benches: 3,
        head_length: 3.350262415408828,
        body_length: 1.3837549674849094,
        width: 0.02,
        hole_inset,
        ends: Ends::NONE,
    };
    let pitch = 3.4942913904095154;
    let fold = Path::spiral(pitch, 1.0).as_spiral().and_then(|(spiral, _)| spiral.fold(team.link(0))).unwrap();
    let (contact, least, _) = search(&Path::spiral(pitch, 7.063442453912254 + fold / TAU), &team, None);
    assert!(contact.is_none() && least.is_some());
}

#[test]
fn a_spent_budget_tells_how_far_the_search_came() {
    let path = Path::spiral(0.55, 16.0);
    let searches = ConservativeAdvancement::new(&path, &PAPER, &[], &[]);
    let mut shares = Vec::new();
    let mut report = |share| {
        shares.push(share);
        ControlFlow::Continue(())
    };
    let found = searches.first_contact(0.0, 430.0, &mut Budget::new(20_000, &mut report)).unwrap();
    assert!(found.value.is_none() && found.searched_until > 10.0 && found.searched_until < 412.0, "{found:?}");
    assert!(shares.is_sorted() && shares.len() > 10);
}

fn any_team() -> impl Strategy<Value = Team> {
    let ends = prop_oneof![any_ends(), Just(Factors::default())];
    (3..25usize, 0.5..4.0f64, 0.5..4.0f64, 0.02..0.8f64, 0.01..0.48f64, ends).prop_map(
        |(benches, head, body, width, inset, ends)| {
            let hole_inset = inset * f64::min(head, body);
            ends.ends_of(Team { benches, head_length: head, body_length: body, width, hole_inset, ends: Ends::NONE })
        },
    )
}

fn any_route() -> impl Strategy<Value = Path> {
    let piece = (0..3, 0.05..2.5f64, 0.05..0.9f64, 0.0..6.0f64);
    proptest::collection::vec(piece, 1..7).prop_map(|pieces| {
        let add = |route: crate::model::path::Route, (kind, radius, turns, length)| match kind {
            0 => route.line(length),
            1 => route.arc(Side::Left, radius, turns),
            _ => route.arc(Side::Right, radius, turns),
        };
        pieces.into_iter().fold(Path::route(0.0), add).build().unwrap()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(cases(24)) })]

    #[test]
    fn sampling_a_spiral_shows_nothing_better(team in any_team(), pitch in 0.3..4.0f64, turns in 2.0..9.0f64) {
        let fold = Path::spiral(pitch, 1.0).as_spiral().and_then(|(spiral, _)| spiral.fold(team.longest_link()));
        let turns = turns + fold.unwrap_or(0.0) / TAU;
        check(&Path::spiral(pitch, turns), &team, SAMPLES)?;
    }

    #[test]
    fn sampling_a_turnaround_shows_nothing_better(
        team in any_team(), pitch in 0.5..3.0f64, radius in 1.0..6.0f64, ratio in 0.4..2.5f64, lead in 0.0..20.0f64,
    ) {
        // With arcs that tight against the links, the approach itself may lock.
        prop_assume!(radius > 0.8 * team.longest_link());
        if let Ok(path) = Path::turnaround(pitch, radius, ratio, lead, team.length()) {
            check(&path, &team, SAMPLES)?;
        }
    }

    #[test]
    fn sampling_a_tight_route_shows_nothing_better(team in any_team(), path in any_route()) {
        check(&path, &team, SAMPLES)?;
    }

    #[test]
    fn a_tail_as_wide_as_the_body_changes_nothing(team in any_team(), path in any_route()) {
        let plain = Team { ends: Ends::NONE, ..team };
        let with_tail = Team { ends: Ends { tail_width: Some(team.width), ..Ends::NONE }, ..team };
        let [(contact, least, end), (other_contact, other_least, other_end)] =
            [plain, with_tail].map(|team| search(&path, &team, None));
        prop_assert_eq!(end, other_end);
        let travels = [contact, other_contact].map(|contact| contact.map_or(f64::MAX, |event| event.travelled));
        prop_assert!((travels[0] - travels[1]).abs() < 1e-9, "{:?}", travels);
        let values = [least, other_least].map(|least| least.map_or(f64::MAX, |least| least.value));
        prop_assert!((values[0] - values[1]).abs() < 1e-9, "{:?}", values);
    }
}

const SAMPLES: usize = 300;
