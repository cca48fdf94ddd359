//! Certificates of several dragons: the checker accepts them, first contacts are those of the brute force of `several`,
//! and changed certificates are refused.
//!
//! `BENCH_DRAGON_ALL=1` makes 60 pairs in place of 15, `BENCH_DRAGON_LONG=1` 1,000.

use bench_dragon::certify::{CertificateLine, certify};
use bench_dragon::messages::state::EventKind as Kind;
use bench_dragon::motion::event::unreported;
use bench_dragon::proof::{EventKind, Proved, ProvedEvent, Refused, Status, verify};
use bench_dragon::show::scene::Scene;
use fastrand::Rng;

use crate::harness;
use crate::several::{any_dragon, brute_force, dragon, line};

const MOST_STEPS: u64 = 20_000;

fn certificate(text: &str, scene: &Scene) -> String {
    let mut lines = Vec::new();
    let mut write = |line: &CertificateLine| line.write(&mut lines);
    let timeline = scene.ensemble.timeline(&mut unreported);
    certify(&scene.ensemble, &timeline, text, MOST_STEPS, &mut write, &mut unreported).unwrap();
    String::from_utf8(lines).unwrap()
}

fn check(lines: &str) -> Result<Proved, Refused> {
    verify(lines.as_bytes(), &mut |_| ())
}

fn proved(text: &str) -> (Scene, Proved) {
    let scene = Scene::parse(text, "pair.toml", "pair").unwrap_or_else(|error| panic!("{error}\n{text}"));
    let proved = check(&certificate(text, &scene)).unwrap_or_else(|refused| panic!("{refused}\n{text}"));
    (scene, proved)
}

fn contacts(proved: &Proved) -> impl Iterator<Item = &ProvedEvent> {
    proved.results.iter().filter(|result| result.event == EventKind::Contact)
}

/// Returns the first proved contact; `None` if an undecided one may come before.
fn first_contact(proved: &Proved) -> Option<&ProvedEvent> {
    let is_proved = |result: &&ProvedEvent| result.status == Status::Proved;
    let first = contacts(proved).filter(is_proved).min_by(|a, b| a.time_lo.partial_cmp(&b.time_lo).unwrap())?;
    let is_later = |other: &ProvedEvent| other.status != Status::Undecided || other.time_lo >= first.time_hi;
    contacts(proved).all(is_later).then_some(first)
}

#[test]
fn first_contacts_of_random_pairs_are_proved() {
    let count = harness::cases(15, 60, 1000);
    let mut rng = Rng::with_seed(3903);
    let (mut between, mut without, mut undecided, mut cases) = (0, 0, 0, 0);
    while cases < count {
        let text = any_dragon(&mut rng, "gold") + &any_dragon(&mut rng, "jade");
        if Scene::parse(&text, "pair.toml", "pair").is_err() {
            continue;
        }
        cases += 1;
        let (scene, proved) = proved(&text);
        assert_eq!((proved.dragons.len(), proved.results.len()), (2, 9), "{text}");
        let timeline = scene.ensemble.timeline(&mut unreported);
        let found = timeline.find(Kind::Contact).map(|timed| timed.time);
        let Some(first) = first_contact(&proved) else {
            if contacts(&proved).any(|result| result.status == Status::Undecided) {
                println!("{cases}: {:?}", contacts(&proved).collect::<Vec<_>>());
                undecided += 1;
                continue;
            }
            assert_eq!(found, None, "{cases}: {text}");
            let truth = brute_force(&scene.ensemble, timeline.end().time * (1.0 - 1e-9));
            assert_eq!(truth, None, "{cases}: {text}");
            without += 1;
            continue;
        };
        let (lo, hi) = (first.time_lo.unwrap(), first.time_hi.unwrap());
        assert!(hi - lo <= 1e-9 || first.because.is_some(), "{cases}: {first:?}\n{text}");
        // A lock of the other dragon may end the show before.
        if lo > timeline.end().time {
            continue;
        }
        let (truth, _) = brute_force(&scene.ensemble, hi + 0.1).unwrap();
        assert!(lo - 1e-10 <= truth && truth <= hi + 1e-10, "{cases}: {truth} {first:?}\n{text}");
        assert!((truth - found.unwrap()).abs() < 2e-9, "{cases}: {found:?} {truth}\n{text}");
        between += usize::from(first.dragons.len() == 2);
    }
    println!("{between} contacts between, {without} without, {undecided} undecided of {cases}");
    assert!(between * 5 >= count && without * 20 >= count && undecided * 10 <= count);
}

/// Both dragons stand before their delay has passed and at their path's end, and one catches the other.
#[test]
fn standing_dragons_are_proved() {
    let east = dragon("gold", 3, "{ origin = [-20.0, 0.0] }", 1.0, 0.0, &line(10.0));
    let west = dragon("jade", 3, "{ origin = [20.0, 0.2], rotation_turns = 0.5 }", 1.5, 2.0, &line(100.0));
    let (_, shown) = proved(&(east.clone() + &west));
    // Gold stands with its front 9.725 m before the origin; jade's is 19.725 m behind it, and begins 2 s later.
    let first = first_contact(&shown).unwrap();
    let truth = 2.0 + (20.0 - 0.275 + 10.0 - 0.275) / 1.5;
    assert!(first.time_lo.unwrap() <= truth && truth <= first.time_hi.unwrap(), "{first:?} {truth}");
    assert!(first.time_hi.unwrap() - first.time_lo.unwrap() < 1e-9, "{first:?}");
    assert_eq!((first.dragons.as_slice(), first.bench_a, first.bench_b), (&[0, 1][..], Some(0), Some(0)));
    // Path ends at 10 s and at 2 + 100 / 1.5 s.
    let ends = shown.results.iter().filter(|result| result.event == EventKind::PathEnd);
    let ends: Vec<f64> = ends.map(|result| result.time_lo.unwrap()).collect();
    assert!((ends[0] - 10.0).abs() < 1e-9 && (ends[1] - (2.0 + 100.0 / 1.5)).abs() < 1e-9, "{ends:?}");
    // Beside each other they pass; both stand for a long time before.
    let wait = dragon("gold", 3, "{ origin = [-20.0, 0.0] }", 1.0, 500.0, &line(60.0));
    let beside = dragon("jade", 3, "{ origin = [20.0, 0.31], rotation_turns = 0.5 }", 1.5, 400.0, &line(100.0));
    let (_, shown) = proved(&(wait + &beside));
    assert!(contacts(&shown).all(|result| result.status == Status::None && result.time_lo.is_none()), "{shown:?}");
    // Overlapping from the start, which both leave later.
    let on = dragon("jade", 3, "{ origin = [-20.5, 0.1], rotation_turns = 0.25 }", 1.5, 2.0, &line(20.0));
    let (_, shown) = proved(&(dragon("gold", 3, "{ origin = [-20.0, 0.0] }", 1.0, 3.0, &line(10.0)) + &on));
    let first = first_contact(&shown).unwrap();
    assert_eq!((first.time_lo, first.time_hi), (Some(0.0), Some(0.0)), "{first:?}");
}

#[test]
fn obstacles_of_each_dragon_are_proved() {
    let east = dragon("gold", 3, "{ origin = [0.0, 0.0] }", 1.0, 0.0, &line(30.0));
    let west = dragon("jade", 3, "{ origin = [0.0, 9.0], mirror = true }", 1.5, 2.0, &line(30.0));
    let stage = "[stage]\n[[stage.obstacles]]\nname = \"lamp\"\ncircle = { center = [20.0, 9.0], radius = 0.5 }\n";
    let (_, shown) = proved(&(stage.to_owned() + &east + &west));
    let lamps: Vec<_> = shown.results.iter().filter(|result| result.event == EventKind::Obstacle).collect();
    assert_eq!((lamps[0].status, lamps[1].status), (Status::None, Status::Proved), "{lamps:?}");
    let truth = 2.0 + (20.0 - 0.5 - 0.275) / 1.5;
    assert!(lamps[1].time_lo.unwrap() <= truth && truth <= lamps[1].time_hi.unwrap(), "{lamps:?} {truth}");
}

/// A certificate is refused without any one of its lines, of another scene, and with a stronger claim.
#[test]
fn changed_certificates_of_pairs_are_refused() {
    let east = dragon("gold", 3, "{ origin = [-20.0, 0.0] }", 1.0, 0.0, &line(100.0));
    let west = dragon("jade", 3, "{ origin = [20.0, 0.2], rotation_turns = 0.5 }", 1.5, 2.0, &line(100.0));
    let text = east + &west;
    let scene = Scene::parse(&text, "pair.toml", "pair").unwrap();
    let lines = certificate(&text, &scene);
    let proved = check(&lines).unwrap();
    let first = first_contact(&proved).unwrap();
    let changes = [
        ("origin = [20.0, 0.2]", "origin = [19.9999, 0.2]"),
        ("origin = [20.0, 0.2]", "origin = [20.0001, 0.2]"),
        ("delay = 2.0", "delay = 1.999"),
        ("delay = 2.0", "delay = 2.001"),
        ("head_speed = 1.5", "head_speed = 1.501"),
        ("rotation_turns = 0.5", "rotation_turns = 0.501"),
        ("hole_inset = 0.275", "hole_inset = 0.3"),
        ("\"type\":\"section\",\"dragons\":[0,1]", "\"type\":\"section\",\"dragons\":[1,0]"),
        ("\"type\":\"section\",\"dragons\":[1]", "\"type\":\"section\",\"dragons\":[0]"),
        ("\"dragons\":[0,1],\"status\":\"proved\"", "\"dragons\":[0],\"status\":\"proved\""),
        ("\"type\":\"witness\",\"benches\":[0,0]", "\"type\":\"witness\",\"benches\":[0,1]"),
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
    for (field, time, more) in [("time_lo", first.time_lo, 1e-8), ("time_hi", first.time_hi, -1e-8)] {
        let mut changed: serde_json::Value = serde_json::from_str(all[all.len() - 1]).unwrap();
        changed[field] = (time.unwrap() + more).into();
        let changed = [&all[..all.len() - 1], &[changed.to_string().as_str()]].concat().join("\n");
        assert!(check(&changed).is_err(), "{field}");
    }
}

#[test]
#[ignore = "tests/run --all"]
fn the_example_scenes_of_several_dragons_are_proved() {
    for name in ["coil", "crossing"] {
        let text = std::fs::read_to_string(format!("config/{name}.toml")).unwrap();
        let (scene, shown) = proved(&text);
        for result in contacts(&shown) {
            println!("{name}: {result:?}");
            assert_ne!(result.status, Status::Undecided, "{name}: {result:?}");
        }
        let found = scene.ensemble.timeline(&mut unreported).find(Kind::Contact).map(|timed| timed.time);
        match (found, first_contact(&shown)) {
            (Some(time), Some(first)) => {
                assert!(first.time_lo.unwrap() <= time + 1e-9 && time - 1e-9 <= first.time_hi.unwrap(), "{first:?}");
            }
            (None, None) => {}
            (found, first) => panic!("{name}: {found:?} {first:?}"),
        }
    }
}

/// A certificate of two dragons that never meet: nothing follows their result, and a claim up to a lock needs steps up
/// to that lock.
#[test]
fn a_claim_that_two_dragons_do_not_meet_needs_its_steps() {
    let wide = "kind = \"spiral\"\npitch = 1.7\nstart_turn = 3.0";
    let coil = dragon("gold", 3, "{ origin = [0.0, 0.0] }", 1.0, 0.5, wide);
    let far = dragon("jade", 3, "{ origin = [500.0, 0.0] }", 1.5, 0.0, &line(400.0));
    let text = coil + &far;
    let scene = Scene::parse(&text, "pair.toml", "pair").unwrap();
    let lines = certificate(&text, &scene);
    let shown = check(&lines).unwrap();
    let lock = shown.results.iter().find(|result| result.event == EventKind::Lock).unwrap();
    let last = shown.results.last().unwrap();
    let (end, time) = (lock.time_lo.unwrap(), last.time_lo.unwrap());
    assert_eq!((lock.status, last.status), (Status::Proved, Status::None), "{lock:?} {last:?}");
    assert!((end - time).abs() < 1e-3 * 2.0, "{lock:?} {last:?}");
    let all: Vec<&str> = lines.lines().collect();
    let result: serde_json::Value = serde_json::from_str(all[all.len() - 1]).unwrap();
    let with_time = |time: f64| {
        let mut changed = result.clone();
        changed["time_lo"] = time.into();
        changed.to_string()
    };
    let is_both = |line: &&&str| line.contains("\"type\":\"both\"");
    let without: Vec<&str> = all[..all.len() - 1].iter().filter(|line| !is_both(line)).copied().collect();
    let (at_start, early) = (with_time(0.0), with_time(end - 0.01));
    assert!(check(&[without.as_slice(), &[at_start.as_str()]].concat().join("\n")).is_err(), "without steps");
    for claim in [&at_start, &early] {
        assert!(check(&[&all[..all.len() - 1], &[claim.as_str()]].concat().join("\n")).is_err(), "{claim}");
    }
    // Undecided, any time follows.
    let undecided = early.replace("\"none\"", "\"undecided\"");
    check(&[&all[..all.len() - 1], &[undecided.as_str()]].concat().join("\n")).unwrap();
    let step = *all.iter().rfind(is_both).unwrap();
    let refused = check(&[all.as_slice(), &[step]].concat().join("\n")).unwrap_err().to_string();
    assert!(refused.contains("nothing of two dragons can follow their result"), "{refused}");
}
