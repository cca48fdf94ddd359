use proptest::prelude::*;

use super::*;
use crate::cases::cases;
use crate::event::unreported;
use crate::model::curve::Side;
use crate::model::path::Route;
use crate::model::team::Ends;

fn team(benches: usize, head_length: f64, body_length: f64) -> Team {
    Team { benches, head_length, body_length, width: 0.30, hole_inset: 0.275, ends: Ends::NONE }
}

fn search(path: &Path, team: &Team) -> Singularities {
    Singularities::search(path, team, &mut Budget::new(50_000_000, &mut unreported))
}

/// The whole trace of one link.
fn trace(path: &Path, length: f64) -> LinkTrace<'_> {
    let mut trace = LinkTrace::new(Link { path, length }, Some(0.0)).unwrap();
    let mut none = unreported;
    let mut budget = Budget::new(3_000_000, &mut none);
    while trace.end().is_none() {
        assert!(trace.advance(&mut budget), "the budget was spent at {}", trace.at().front);
    }
    trace
}

fn point(path: &Path, travelled: f64) -> Point {
    path.point(path.param_at(travelled))
}

/// The follower by sphere tracing: the distance grows by at most 1 per metre back.
fn traced_follower(path: &Path, front: f64, link: f64) -> f64 {
    let from = point(path, front);
    let mut rear = front - link;
    for _ in 0..1_000_000 {
        let lacking = link - (point(path, rear) - from).norm();
        if lacking <= 1e-13 * link {
            break;
        }
        rear -= lacking;
    }
    rear
}

/// The follower of a link by small steps of its front handle, each with one place between brackets at the distance: a
/// second definition of what the trace finds.
struct Continued<'a> {
    path: &'a Path,
    link: f64,
    /// Front and rear handles, metres of travel.
    places: Vec<(f64, f64)>,
    /// The place of the front handle at which the follower vanishes.
    lost: Option<f64>,
}

impl<'a> Continued<'a> {
    fn new(path: &'a Path, link: f64, from: f64) -> Self {
        let places = vec![(from, traced_follower(path, from, link))];
        let mut continued = Self { path, link, places, lost: None };
        let (mut place, mut step) = (continued.places[0], 0.002 * link);
        while place.0 < path.length() && continued.lost.is_none() {
            let front = (place.0 + step).min(path.length());
            match continued.step(place, front) {
                Some(rear) => {
                    place = (front, rear);
                    continued.places.push(place);
                    step = (2.0 * step).min(0.002 * link);
                }
                None if step > 1e-12 * (link + front.abs()) => step *= 0.5,
                None => continued.lost = Some(place.0),
            }
        }
        continued
    }

    /// Returns the rear handle after a short step, if it is certainly the same one.
    fn step(&self, (before, rear): (f64, f64), front: f64) -> Option<f64> {
        let origin = point(self.path, front);
        let offset = |at: f64| origin - point(self.path, at);
        let cosine = |at: f64| offset(at).dot(&self.path.tangent(self.path.param_at(at))) / self.link;
        let reach = 4.0 * (front - before).abs() / cosine(rear) + 1e-13 * (self.link + rear.abs());
        // Per metre, the cosine changes by no more.
        let curvature = self.path.max_curvature_between(rear - reach, rear + reach);
        let change = (1.0 + 1.1 * curvature * self.link) / self.link;
        let holds = reach > 0.0
            && reach < 0.05 * self.link
            && (-8..=8).all(|k| cosine(rear + reach * f64::from(k) / 8.0) > change * reach / 16.0)
            && offset(rear - reach).norm() > self.link
            && offset(rear + reach).norm() < self.link;
        let is_near = |at: f64| offset(at).norm() < self.link;
        holds.then(|| bisect_predicate(is_near, rear - reach, rear + reach))
    }

    /// Returns the rear handle and the front cosine.
    fn at(&self, front: f64) -> Option<(f64, f64)> {
        let index = self.places.partition_point(|place| place.0 <= front).checked_sub(1)?;
        let rear = self.step(self.places[index], front)?;
        let chord = point(self.path, front) - point(self.path, rear);
        Some((rear, chord.dot(&self.path.tangent(self.path.param_at(front))) / self.link))
    }
}

/// Compares a trace with small steps.
fn check(path: &Path, link: f64) {
    let trace = trace(path, link);
    let end = trace.at().front;
    let continued = Continued::new(path, link, -link);
    match continued.lost {
        Some(lost) => assert!(
            trace.end() == Some(TraceEnd::Lock) && (end - lost).abs() < 1e-8 * (1.0 + link),
            "lost at {lost}, {:?} at {end}, link {link} {path:?}",
            trace.end()
        ),
        None => {
            assert!(trace.end() == Some(TraceEnd::PathEnd) && end == path.length(), "{:?} {end} {path:?}", trace.end())
        }
    }
    let samples = 1000;
    for sample in 0..samples {
        let front = end * (sample as f64 + 0.5) / samples as f64;
        let Some((rear, cosine)) = continued.at(front) else { continue };
        let found = trace.configuration(front).unwrap();
        let slack = 1e-9 * (1.0 + link) / found.rear_cosine.max(1e-3);
        assert!((found.rear - rear).abs() < slack, "{} instead of {rear} at {front}, link {link} {path:?}", found.rear);
        let turns = trace.turns().iter().filter(|turn| **turn <= front).count();
        assert!(
            (cosine <= 0.0) == (turns % 2 == 1) || cosine.abs() < 1e-6,
            "{cosine} at {front}: {:?} to {end}, link {link} {path:?}",
            trace.turns()
        );
    }
}

fn route() -> Route {
    Path::route(0.0)
}

/// Asserts the first stall and the end, as metres of travel and link, to `tolerance` metres.
fn assert_events(path: &Path, team: &Team, stall: Option<(f64, u32)>, end: (f64, Option<u32>), tolerance: f64) {
    let found = search(path, team);
    let at = |event: &Event| (event.travelled, event.bench_a);
    let expected = stall.map(|(travelled, link)| (travelled, Some(link)));
    for (found, expected) in [(found.stall.as_ref().map(at), expected), (found.end.as_ref().map(at), Some(end))] {
        let agrees = match (found, expected) {
            (Some(found), Some(expected)) => (found.0 - expected.0).abs() <= tolerance && found.1 == expected.1,
            (found, expected) => found == expected,
        };
        assert!(agrees, "{found:?} instead of {expected:?}");
    }
    assert_eq!(Some(found.searched_until), found.end.map(|end| end.travelled));
    let places = [found.stall, found.end].into_iter().flatten().filter(|event| event.bench_a.is_some());
    assert!(places.into_iter().all(|event| event.place.is_some_and(|place| place.coords.norm().is_finite())));
}

#[test]
fn spirals_stall_and_lock_as_with_50_digits() {
    let paper = team(223, 3.41, 2.20);
    let events = [
        (Path::spiral(0.55, 16.0), 432.758134083656, 432.917924228383),
        (Path::spiral(1.7, 6.0), 190.39942112376414, 190.8187293052253),
        (Path::spiral(0.45, 16.0), 349.75443037967284, 349.8872674183089),
    ];
    for (path, stall, lock) in events {
        assert_events(&path, &paper, Some((stall, 0)), (lock, Some(0)), 1e-10);
    }
}

#[test]
fn short_links_neither_stall_nor_lock_and_middling_ones_only_stall() {
    let path = Path::spiral(1.0, 8.0);
    assert_events(&path, &team(223, 0.75, 0.75), None, (path.length(), None), 0.0);
    let found = search(&path, &team(223, 1.05, 1.05));
    assert_eq!((found.stall.unwrap().bench_a, found.end.unwrap().kind), (Some(0), EventKind::PathEnd));
}

#[test]
fn wide_bends_hold_nothing() {
    let turnaround = Path::turnaround(1.7, 4.5, 2.0, 100.0, 369.16).unwrap();
    let procession = route().line(40.0).arc(Side::Left, 6.0, 0.25).line(12.0).arc(Side::Right, 5.0, 0.5).line(10.0);
    let procession = procession.arc(Side::Left, 5.0, 0.5).line(120.0).build().unwrap();
    let long = route().line(1.0).arc(Side::Left, 5.0, 1000.0).line(1e9).arc(Side::Right, 1e8, 1.0).build().unwrap();
    for path in [turnaround, procession, long] {
        assert_events(&path, &team(223, 3.41, 2.20), None, (path.length(), None), 0.0);
    }
}

#[test]
fn tight_bends_stall_at_once() {
    let path = route().line(5.0).arc(Side::Left, 0.03, 0.5).line(20.0).build().unwrap();
    assert!((search(&path, &team(20, 3.41, 2.20)).stall.unwrap().travelled - 5.047441916962).abs() < 1e-11);
    let team =
        Team { benches: 14, head_length: 2.63, body_length: 1.9, width: 0.4, hole_inset: 0.45, ends: Ends::NONE };
    let path = route().line(20.73).arc(Side::Right, 0.021277099139995617, 0.2415370362213321);
    let path = path.arc(Side::Left, 0.02770720113482116, 0.11516399630650424);
    let path = path.arc(Side::Right, 0.010232884755659723, 0.3446585013052239).line(0.06698729339347953);
    let path = path.arc(Side::Left, 1.4814300271320127, 0.3).build().unwrap();
    let found = search(&path, &team);
    assert!((found.stall.unwrap().travelled - 20.79056).abs() < 1e-5);
    assert!((found.head_turns[1] - 22.19615).abs() < 1e-5);
    let path = route().line(15.73).arc(Side::Right, 0.010077025143215441, 0.25955572291751955);
    let path = path.arc(Side::Left, 0.507347784935104, 0.4493062280894443).line(0.038008853957396976).build().unwrap();
    assert!((search(&path, &team).stall.unwrap().travelled - 15.74589).abs() < 1e-5);
}

#[test]
fn a_nearer_place_is_no_lock() {
    let path = route().line(10.0).arc(Side::Left, 1.42999, 0.5).line(5.0).build().unwrap();
    // Past the stall a nearer place comes to the distance, and the team is pushed back to the path's end.
    let end = (path.length(), None);
    assert_events(&path, &team(20, 3.41, 2.20), Some((14.484883081064398, 0)), end, 1e-9);
    for radius in [0.4140430, 0.4141, 0.4142] {
        let path = route().line(2.0).arc(Side::Left, radius, 0.375).arc(Side::Right, radius, 0.375).line(3.0);
        let path = path.build().unwrap();
        check(&path, 1.0);
    }
}

#[test]
fn u_turns_as_wide_as_the_link_end_with_the_path() {
    for link in [1e-3, 0.1, 1.65, 2.86, 10.0] {
        for power in [-2, -3, -5, -7, -9, -11, -12, -13, -14, -15, -99] {
            for excess in [-10f64.powi(power), 10f64.powi(power)] {
                let path = u_turn(link, 0.5 * link * (1.0 + excess));
                let mut none = unreported;
                let mut budget = Budget::new(20_000, &mut none);
                let team = Team {
                    benches: 9,
                    head_length: link,
                    body_length: link,
                    width: 1e-4,
                    hole_inset: 0.0,
                    ends: Ends::NONE,
                };
                let found = Singularities::search(&path, &team, &mut budget);
                // As the team is pushed back, the two places at the distance are near each other, and steps as short.
                let is_narrow = excess < 0.0 && (-13..=-3).contains(&power);
                let is_path_end = |end: Option<Event>| end.is_some_and(|end| end.kind == EventKind::PathEnd);
                assert!(is_path_end(found.end) || is_narrow && found.end.is_none(), "{link} {excess} {found:?}");
                // Nearer than about 1e-14 the stall is below the resolution of doubles.
                assert_eq!(found.stall.is_some(), excess < -5e-15, "{link} {excess} {found:?}");
            }
        }
    }
}

#[test]
fn extremes_are_searched_to_the_last_place() {
    let extreme = |benches, head_length, body_length| Team {
        benches,
        head_length,
        body_length,
        width: 1e-3,
        hole_inset: 1e-3,
        ends: Ends::NONE,
    };
    for (path, team) in [
        (Path::spiral(1e-3, 1e7), extreme(1_000_000, 0.003, 0.003)),
        (Path::spiral(1e-3, 1e7), extreme(3, 1e4, 0.003)),
        (Path::spiral(1e4, 1e3), extreme(100_000, 0.003, 1e4)),
    ] {
        let found = search(&path, &team);
        assert!(found.stall.unwrap().travelled < found.end.unwrap().travelled);
        assert!(found.stall.unwrap().place.is_some() && found.end.unwrap().place.is_some(), "{found:?}");
    }
}

#[test]
fn a_spent_budget_says_how_far_it_came() {
    let path = route().line(1.0).arc(Side::Left, 0.2, 10.0).line(5.0).build().unwrap();
    let team = team(4, 3.41, 2.20);
    let whole = search(&path, &team);
    let mut last = 0.0;
    for limit in [20, 100, 400, 800] {
        let found = Singularities::search(&path, &team, &mut Budget::new(limit, &mut unreported));
        assert!(found.end.is_none() && found.searched_until > last, "{limit}: {found:?}");
        assert_eq!(found.head_turns, whole.head_turns[..found.head_turns.len()]);
        last = found.searched_until;
    }
    assert!(last < whole.searched_until);
}

fn u_turn(link: f64, radius: f64) -> Path {
    Path::route(0.0).line(4.0 * link).arc(Side::Left, radius, 0.5).line(2.0 * link).build().unwrap()
}

/// A narrow lobe to the left of the path, then most of a circle.
fn lobe(height: f64, apart: f64, radius: f64) -> Path {
    let small = 0.025002979881674117;
    let path = route().line(2.0).arc(Side::Left, small, 0.25).line(height).arc(Side::Right, small, 0.5).line(height);
    path.arc(Side::Left, small, 0.25).line(apart).arc(Side::Right, radius, 0.95).line(2.0).build().unwrap()
}

#[test]
fn a_point_out_of_reach_for_a_moment_is_no_lock() {
    let path = lobe(0.48967371252936887, 0.2340087363064477, 0.20334920134437337);
    assert!(!trace(&path, 1.0).branches().is_empty());
    check(&path, 1.0);
}

fn routes() -> impl Strategy<Value = Path> {
    let radius = prop_oneof![0.003f64..0.1, 0.1f64..1.0, 0.4f64..0.6, 1.0f64..5.0];
    let leg = (radius, 0.02f64..1.1, 0..3, 0.01f64..3.0);
    prop::collection::vec(leg, 1..12).prop_map(|legs| {
        let mut route = Path::route(0.1).line(2.0);
        for (radius, turns, kind, length) in legs {
            route = match kind {
                0 => route.line(length),
                1 => route.arc(Side::Left, radius, turns),
                _ => route.arc(Side::Right, radius, turns),
            };
        }
        route.line(3.0).build().unwrap()
    })
}

/// Compares the events with all links by small steps.
fn check_chain(path: &Path, team: &Team) {
    let found = search(path, team);
    let end = found.end.unwrap();
    let stall = found.stall.map_or(end.travelled, |stall| stall.travelled);
    let behind = -4.0 * (team.length() + team.longest_link());
    let mut lengths = team.kinds().map(|bench| team.link(bench)).to_vec();
    lengths.sort_by(f64::total_cmp);
    lengths.dedup();
    let links: Vec<_> = lengths.into_iter().map(|length| Continued::new(path, length, behind)).collect();
    // The front handles' travels and front cosines.
    let chain = |head: f64| {
        let mut front = head;
        let one = |bench: usize| {
            let (rear, cosine) = links.iter().find(|of| of.link == team.link(bench))?.at(front)?;
            Some((std::mem::replace(&mut front, rear), cosine))
        };
        (0..team.benches).map_while(one).collect::<Vec<_>>()
    };
    let followed = path.clone().with_branches(found.branches.clone());
    let samples = 400;
    for sample in 0..=samples {
        let head = end.travelled * f64::from(sample) / f64::from(samples);
        if head > end.travelled - 1e-6 {
            break;
        }
        let links = chain(head);
        assert_eq!(links.len(), team.benches, "lost at {head} before {end:?} {path:?} {team:?}");
        if head < stall {
            assert!(
                links.iter().all(|(_, cosine)| *cosine > -1e-6),
                "{head} before {stall} {links:?} {found:?} {path:?} {team:?}"
            );
        }
        let turns = |turns: &[f64], at: f64| turns.iter().filter(|turn| **turn <= at).count();
        for (index, (front, cosine)) in links.iter().enumerate() {
            let of_link = match index {
                0 => &found.head_turns,
                _ if team.ends.tail_length.is_some() && index + 1 == team.benches => &found.tail_turns,
                _ => &found.body_turns,
            };
            let turns = turns(of_link, *front);
            if index > 0 || stall > 0.0 {
                assert!(
                    cosine.abs() < 1e-6 || (*cosine < 0.0) == (turns % 2 == 1),
                    "{head} {index} {front} {cosine} {found:?} {path:?} {team:?}"
                );
            }
        }
        let mut front = followed.param_at(head);
        for (index, (at, _)) in links.iter().enumerate() {
            assert!((path.travelled(front) - at).abs() < 1e-6, "{head} {index} {at} {found:?} {path:?} {team:?}");
            front = crate::linkage::follower(&followed, front, team.link(index)).unwrap();
        }
    }
    if end.kind == EventKind::Lock && end.travelled + 1e-6 < path.length() {
        assert!(chain(end.travelled + 1e-6).len() < team.benches, "{found:?} {path:?} {team:?}");
    }
    if let Some(link) = found.stall.and_then(|stall| stall.bench_a)
        && stall > 0.0
        && stall + 1e-6 < end.travelled
    {
        let after = chain(stall + 1e-7)[link as usize].1;
        let before = chain((stall - 1e-7).max(0.0))[link as usize].1;
        assert!(after < 0.0 && before > 0.0, "{before} {after} {found:?} {path:?} {team:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases(24)))]

    #[test]
    fn chains_on_routes(path in routes(), head in 0.3f64..2.0, body in 0.3f64..2.0) {
        check_chain(&path, &team(5, head + 0.55, body + 0.55));
    }

    #[test]
    fn chains_with_a_tail_of_its_own(
        path in prop_oneof![routes(), (0.2f64..3.0, 0.01f64..2.0).prop_map(|(pitch, start)| Path::spiral(pitch, start))],
        benches in 3..6usize, head in 0.3f64..2.0, body in 0.3f64..2.0, tail in 0.3f64..3.0,
    ) {
        let ends = Ends { tail_length: Some(tail + 0.55), ..Ends::NONE };
        let team = Team { ends, ..team(benches, head + 0.55, body + 0.55) };
        if search(&path, &team).end.unwrap().travelled > 0.0 {
            check_chain(&path, &team);
        }
    }

    #[test]
    fn chains_on_spirals(pitch in 0.2f64..3.0, start in 0.01f64..2.0, head in 0.3f64..2.0, body in 0.3f64..2.0) {
        let path = Path::spiral(pitch, start);
        let team = team(6, head + 0.55, body + 0.55);
        let first = search(&path, &team);
        if first.end.unwrap().travelled > 0.0 {
            check_chain(&path, &team);
        }
    }

    #[test]
    fn chains_on_turnarounds(
        pitch in 0.2f64..3.0, radius in 0.1f64..4.0, ratio in 0.3f64..3.0, lead in 0.0f64..5.0,
        head in 0.3f64..2.0, body in 0.3f64..2.0,
    ) {
        let path = Path::turnaround(pitch, radius, ratio, lead, 10.0).unwrap();
        let team = team(6, head + 0.55, body + 0.55);
        if search(&path, &team).end.unwrap().travelled > 0.0 {
            check_chain(&path, &team);
        }
    }

    #[test]
    fn routes_agree_with_sampling(path in routes(), link in 0.3f64..2.0) {
        check(&path, link);
    }

    #[test]
    fn turnarounds_agree_with_sampling(
        pitch in 0.1f64..3.0, radius in 0.3f64..4.0, ratio in 0.3f64..3.0, link in 0.3f64..2.0,
    ) {
        let path = Path::turnaround(pitch, radius, ratio, 5.0, 10.0).unwrap();
        if LinkTrace::new(Link { path: &path, length: link }, Some(0.0)).unwrap().at().front >= 0.0 {
            check(&path, link);
        }
    }

    #[test]
    fn lobes_agree_with_sampling(height in 0.05f64..0.9, apart in 0.01f64..0.9, radius in 0.1f64..0.49) {
        check(&lobe(height, apart, radius), 1.0);
    }
}
