//! Certificates of the least clearances of several dragons. The checker accepts them, and refuses changed certificates.
//! A brute force over the show's time finds nothing nearer, and the stated boards as near.
//!
//! `BENCH_DRAGON_ALL=1` makes 24 pairs in place of 6, `BENCH_DRAGON_LONG=1` 600.

use bench_dragon::certify::{
    BetweenEnclosure, CertificateLine, ClearanceHints, EnsembleClearances, certify_clearances,
};
use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::ensemble::Ensemble;
use bench_dragon::motion::event::unreported;
use bench_dragon::proof::{Proved, ProvedClearance, Refused, Until, verify};
use bench_dragon::show::scene::Scene;
use fastrand::Rng;

use crate::harness;
use crate::several::{Corners, all_boards, any_dragon, dragon, gap, line};

const MOST_STEPS: u64 = 20_000;

/// Greatest error of the brute force, metres.
const ROUNDING: f64 = 1e-10;

fn certificate(text: &str, scene: &Scene) -> (EnsembleClearances, String) {
    let mut lines = Vec::new();
    let mut write = |line: &CertificateLine| line.write(&mut lines);
    let (ensemble, timeline) = (&scene.ensemble, scene.ensemble.timeline(&mut unreported));
    let show_end = timeline.show_end(scene.stops_at_contact());
    let hints = ClearanceHints { boards: None, obstacles: &[] };
    let found = certify_clearances(ensemble, show_end, hints, text, MOST_STEPS, &mut write, &mut unreported).unwrap();
    (found, String::from_utf8(lines).unwrap())
}

fn check(lines: &str) -> Result<Proved, Refused> {
    verify(lines.as_bytes(), &mut |_| ())
}

/// Distance of two rectangles; where they overlap, minus the least translation that separates them.
fn distance(a: &Corners, b: &Corners) -> f64 {
    let depth = gap(a, b);
    if depth <= 0.0 {
        return depth;
    }
    let to_edge = |p: [f64; 2], from: [f64; 2], to: [f64; 2]| {
        let (x, y) = (to[0] - from[0], to[1] - from[1]);
        let share = (((p[0] - from[0]) * x + (p[1] - from[1]) * y) / (x * x + y * y)).clamp(0.0, 1.0);
        (p[0] - from[0] - share * x).hypot(p[1] - from[1] - share * y)
    };
    let mut least = f64::INFINITY;
    for (one, other) in [(a, b), (b, a)] {
        for corner in one {
            for k in 0..4 {
                least = least.min(to_edge(*corner, other[k], other[(k + 1) % 4]));
            }
        }
    }
    least
}

/// The least distance at a time of two boards that share no handle, of the given dragons: one, or two.
fn least_at(ensemble: &Ensemble, dragons: &[usize], time: f64) -> Option<f64> {
    let boards = all_boards(ensemble, time)?;
    let owner = |number: usize| ensemble.owner(number).unwrap().0;
    let mut least = f64::INFINITY;
    for (k, (a, one)) in boards.iter().enumerate() {
        for (b, other) in boards[k + 1..].iter().filter(|(b, _)| *b > a + 1) {
            let is_asked = match dragons {
                [dragon] => owner(*a) == *dragon && owner(*b) == *dragon,
                [first, second] => owner(*a) == *first && owner(*b) == *second,
                _ => false,
            };
            if is_asked {
                least = least.min(distance(one, other));
            }
        }
    }
    Some(least)
}

/// Compares a claim with a brute force at times up to its end, and at the stated time of the least. More of the times
/// are where the boards are nearest.
fn compare(ensemble: &Ensemble, claim: &ProvedClearance, (end, stated): (f64, Option<f64>), text: &str) {
    let until = if claim.until == Until::Time { claim.time_until.unwrap() } else { end };
    let stands = claim.dragons.iter().map(|dragon| &ensemble.dragons()[*dragon]);
    let stands = stands.map(|dragon| dragon.delay + dragon.motion.time_at(dragon.motion.path().length()));
    let until = until.min(stands.fold(0.0, f64::max));
    let at = |time: f64| least_at(ensemble, &claim.dragons, time).unwrap_or(f64::INFINITY);
    let (mut from, mut to) = (0.0, until);
    let mut nearest = f64::INFINITY;
    for count in [if harness::long() { 3000 } else { 600 }, 60, 60, 60] {
        let spacing = (to - from) / f64::from(count);
        let times = (0..=count).map(|k| (from + spacing * f64::from(k)).min(until));
        let (value, time) = times.map(|time| (at(time), time)).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        nearest = nearest.min(value);
        (from, to) = ((time - spacing).max(0.0), (time + spacing).min(until));
    }
    // A contact's time is in the last digits.
    let slack = if claim.until == Until::Contact { 1e-8 } else { ROUNDING };
    assert!(claim.lo.is_none_or(|lo| nearest >= lo - slack), "{nearest} {claim:?}\n{text}");
    if let (Some(hi), Some(stated)) = (claim.hi, stated) {
        let there = at(stated);
        assert!(there <= hi + slack, "{there} at {stated} {claim:?}\n{text}");
    }
}

fn ends_with_a_contact_of_two(scene: &Scene) -> bool {
    let end = scene.ensemble.timeline(&mut unreported).show_end(true).event;
    let dragon = |bench: Option<u32>| Some(scene.ensemble.owner(bench? as usize)?.0);
    end.kind == EventKind::Contact && dragon(end.bench_a) != dragon(end.bench_b)
}

#[test]
fn least_clearances_of_random_pairs_are_proved() {
    let count = harness::cases(6, 24, 600);
    let mut rng = Rng::with_seed(3904);
    let (mut whole, mut apart, mut touched, mut cases) = (0, 0, 0, 0);
    while cases < count {
        // Every third show ends with a contact of the two dragons.
        let must_touch = cases % 3 == 2;
        let stop = if must_touch || rng.bool() { "stop" } else { "continue" };
        let text = format!("[motion]\non_contact = \"{stop}\"\n[alerts]\n")
            + &any_dragon(&mut rng, "gold")
            + &any_dragon(&mut rng, "jade");
        let Ok(scene) = Scene::parse(&text, "pair.toml", "pair") else { continue };
        if must_touch && !ends_with_a_contact_of_two(&scene) {
            continue;
        }
        cases += 1;
        let (found, lines) = certificate(&text, &scene);
        let proved = check(&lines).unwrap_or_else(|refused| panic!("{cases}: {refused}\n{text}"));
        assert_eq!(proved.least_clearances.len(), 3, "{text}");
        let (ensemble, timeline) = (&scene.ensemble, scene.ensemble.timeline(&mut unreported));
        let end = timeline.show_end(scene.stops_at_contact()).time;
        let own_time = |dragon: usize| {
            let (boards, dragon) = (found.own[dragon].boards?, &ensemble.dragons()[dragon]);
            Some(dragon.delay + dragon.motion.time_at(boards.travelled.max(0.0)))
        };
        let stated = [own_time(0), own_time(1), Some(found.between[0].time)];
        for (claim, stated) in proved.least_clearances.iter().zip(stated) {
            compare(ensemble, claim, (end, stated), &text);
        }
        let BetweenEnclosure { lo, hi, until, .. } = found.between[0];
        let claim = &proved.least_clearances[2];
        assert_eq!(claim.lo.zip(claim.hi), lo.zip(hi), "{claim:?}");
        if until.is_some() {
            println!("{cases}: {:?} {end}\n{text}", found.between[0]);
            continue;
        }
        let (lo, hi) = (lo.unwrap(), hi.unwrap());
        assert!(lo <= hi && hi - lo <= 1e-9, "{claim:?}\n{text}");
        whole += 1;
        touched += usize::from(claim.until == Until::Contact);
        apart += usize::from(lo > 0.0);
    }
    println!("{whole} proved to the end ({apart} apart, {touched} up to a contact) of {cases}");
    assert!(whole * 10 >= count * 9 && apart * 8 >= count && touched * 4 >= count);
}

/// Both stand before their delay and at their paths' ends; the nearest moment is while one stands, or both.
#[test]
fn clearances_of_standing_dragons_are_proved() {
    let gold = dragon("gold", 3, "{ origin = [0.0, 0.0] }", 1.0, 0.0, &line(10.0));
    // Jade stands 5 m beside gold's way, and leaves at 30 s: gold stands with its front at 10.275 m.
    let ahead = dragon("jade", 3, "{ origin = [30.0, 5.0] }", 1.5, 30.0, &line(20.0));
    let text = gold.clone() + &ahead;
    let scene = Scene::parse(&text, "pair.toml", "pair").unwrap();
    let (found, lines) = certificate(&text, &scene);
    let proved = check(&lines).unwrap();
    let BetweenEnclosure { lo, hi, until, benches, .. } = found.between[0];
    // Jade's rear end is 2.86 + 2 * 1.65 + 0.275 m behind its head; both boards are 0.3 m wide.
    let truth = (30.0f64 - 6.435 - 10.275).hypot(5.0 - 0.3);
    assert!(lo.unwrap() <= truth && truth <= hi.unwrap() && until.is_none(), "{:?} {truth}", found.between[0]);
    assert_eq!((benches, proved.least_clearances[2].until), ([0, 2], Until::PathEnd));
    // Side by side at one speed, the distance is constant: 1.2 m - 0.3 m, and jade stops earlier.
    let beside = dragon("jade", 3, "{ origin = [0.0, 1.2] }", 1.0, 0.0, &line(8.0));
    let text = gold + &beside;
    let scene = Scene::parse(&text, "pair.toml", "pair").unwrap();
    let (found, lines) = certificate(&text, &scene);
    check(&lines).unwrap();
    let BetweenEnclosure { lo, hi, until, .. } = found.between[0];
    assert!(lo.unwrap() <= 0.9 && 0.9 <= hi.unwrap() + 1e-15 && until.is_none(), "{:?}", found.between[0]);
}

/// A certificate is refused without any one of its lines, of another scene, and with a stronger claim.
#[test]
#[ignore = "tests/run --all"]
fn changed_certificates_of_clearances_are_refused() {
    let east = dragon("gold", 3, "{ origin = [-20.0, 0.0] }", 1.0, 0.0, &line(60.0));
    let arc = "kind = \"pieces\"\npieces = [{ kind = \"line\", length = 10.0 }, \
               { kind = \"arc\", radius = 8.0, side = \"right\", turns = 0.4 }]";
    let west = dragon("jade", 3, "{ origin = [15.0, 4.2], rotation_turns = 0.5 }", 1.5, 2.0, arc);
    let text = east + &west;
    let scene = Scene::parse(&text, "pair.toml", "pair").unwrap();
    let (found, lines) = certificate(&text, &scene);
    let proved = check(&lines).unwrap();
    let BetweenEnclosure { lo, hi, benches, .. } = found.between[0];
    assert!(lo.unwrap() > 0.0 && hi.unwrap() - lo.unwrap() < 1e-9, "{:?}", found.between[0]);
    assert_eq!(proved.least_clearances[2].dragons, [0, 1]);
    // Only the witness of two dragons has a time.
    let near = format!("\"benches\":{},\"time\"", serde_json::to_string(&benches).unwrap());
    let other = format!("\"benches\":[{},{}],\"time\"", (benches[0] + 1) % 3, benches[1]);
    let changes = [
        ("origin = [15.0, 4.2]", "origin = [15.0, 4.1999]"),
        ("delay = 2.0", "delay = 1.999"),
        ("delay = 2.0", "delay = 2.001"),
        ("head_speed = 1.5", "head_speed = 1.501"),
        ("rotation_turns = 0.5", "rotation_turns = 0.501"),
        ("width = 0.3", "width = 0.301"),
        ("\"type\":\"section\",\"dragons\":[0,1]", "\"type\":\"section\",\"dragons\":[1,0]"),
        (near.as_str(), other.as_str()),
        ("\"of\":\"least_clearance\"", "\"of\":\"event\",\"event\":\"contact\",\"status\":\"none\""),
    ];
    for (from, to) in changes {
        let changed = lines.replacen(from, to, 1);
        assert_ne!(changed, lines, "{from}");
        assert!(check(&changed).is_err(), "{from} -> {to}");
    }
    let all: Vec<&str> = lines.lines().collect();
    for left_out in (0..all.len()).rev().step_by(1 + all.len() / 60) {
        let rest = [&all[..left_out], &all[left_out + 1..]].concat();
        assert!(check(&rest.join("\n")).is_err(), "without line {}: {}", left_out + 1, all[left_out]);
    }
    let last = all.len() - 1;
    let with = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut changed: serde_json::Value = serde_json::from_str(all[last]).unwrap();
        change(&mut changed);
        check(&[&all[..last], &[changed.to_string().as_str()]].concat().join("\n"))
    };
    with(&|_| ()).unwrap();
    assert!(with(&|claim| claim["lo"] = (lo.unwrap() + 1e-9).into()).is_err());
    assert!(with(&|claim| claim["hi"] = (hi.unwrap() - 1e-9).into()).is_err());
    assert!(with(&|claim| claim["dragons"] = vec![0].into()).is_err());
    // A claim up to a contact that no line shows, and one about a time after the last stretch.
    assert!(with(&|claim| claim["until"] = "contact".into()).is_err());
    let late = |claim: &mut serde_json::Value| (claim["until"], claim["time_until"]) = ("time".into(), 1e4.into());
    assert!(with(&late).is_err());
    // Every stretch has a number `apart`.
    let both = all.iter().rposition(|line| line.contains("\"type\":\"both\"")).unwrap();
    let mut without: serde_json::Value = serde_json::from_str(all[both]).unwrap();
    without.as_object_mut().unwrap().remove("apart");
    let without = without.to_string();
    let rest = [&all[..both], &[without.as_str()], &all[both + 1..]].concat();
    assert!(check(&rest.join("\n")).is_err(), "a stretch without a distance");
}

#[test]
#[ignore = "tests/run --all"]
fn the_example_scenes_of_several_dragons_have_proved_clearances() {
    for name in ["coil", "crossing"] {
        let text = std::fs::read_to_string(format!("config/{name}.toml")).unwrap();
        let scene = Scene::parse(&text, "scene.toml", name).unwrap();
        let (found, lines) = certificate(&text, &scene);
        let proved = check(&lines).unwrap();
        println!("{name}: {} bytes, {:?}", lines.len(), proved.least_clearances);
        let ensemble = &scene.ensemble;
        let timeline = scene.ensemble.timeline(&mut unreported);
        let show_end = timeline.show_end(scene.stops_at_contact());
        let least = ensemble.least_clearances(&timeline, show_end, &mut unreported);
        assert!(found.own.iter().all(|own| own.boards.is_some_and(|own| own.until.is_none())), "{:?}", found.own);
        let BetweenEnclosure { lo, hi, until, .. } = found.between[0];
        let (value, room) = (least.between.unwrap().least.value, 1e-9);
        assert!(until.is_none() && lo.unwrap() <= value + room && value - room <= hi.unwrap(), "{:?}", found.between);
    }
}
