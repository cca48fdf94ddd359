//! The checker accepts every certificate that is written of events, of the least clearance and of the greatest speed.
//! The scenes are tight routes, full turns, S-bends near a lock, and the random scenes of the oracle.
//!
//! `BENCH_DRAGON_ALL=1` makes 200 scenes in place of 12, `BENCH_DRAGON_LONG=1` 100,000.
//! `BENCH_DRAGON_SCENES=FROM-TO` makes those with these numbers.

use std::collections::BTreeMap;
use std::io;
use std::ops::Range;
use std::panic;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use bench_dragon::certify::plan::{certify_greatest_speed, certify_least_pitch};
use bench_dragon::certify::{CertificateLine, ClearanceEnclosure, ClearanceHints, certify, certify_clearances};
use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::event::unreported;
use bench_dragon::proof::{Proved, ProvedClearance, Status, Until, verify};
use bench_dragon::show::scene::Scene;
use fastrand::Rng;

use crate::harness;

mod routes;

use routes::{scene, tight_route};

/// Most steps of a search: scenes that need more are given up, and the certificate states the time up to which it
/// proves.
const MOST_STEPS: u64 = 2000;

/// Most lines of a certificate that are left out, one at a time.
const MOST_LEFT_OUT: usize = 30;

/// One scene of this many is tried for its clearance and its greatest speed too, which cost three times as much.
const STRIDE: usize = 2;
/// The same number in the long run. This number is prime to the number of families.
const LONG_STRIDE: usize = 9;

/// Writes a certificate and has it checked. Returns the status of each result; `None` for a scene that is refused.
///
/// # Panics
/// The checker refuses the certificate.
fn certified(text: &str) -> Option<Vec<Status>> {
    certified_in(text, MOST_STEPS)
}

/// The same with another limit of steps.
fn certified_in(text: &str, most_steps: u64) -> Option<Vec<Status>> {
    let scene = Scene::parse(text, "tight", "tight").ok()?;
    let timeline = scene.ensemble.timeline(&mut unreported);
    let proved = accepted(text, |write| {
        certify(&scene.ensemble, &timeline, text, most_steps, write, &mut unreported).unwrap();
    });
    Some(proved.results.into_iter().map(|outcome| outcome.status).collect())
}

/// Has the checker read the lines that a search writes.
///
/// # Panics
/// The checker refuses them.
fn accepted(text: &str, search: impl FnOnce(&mut dyn FnMut(&CertificateLine) -> io::Result<()>)) -> Proved {
    verify(written(search).as_slice(), &mut |_| ()).unwrap_or_else(|refused| panic!("{refused}\n{text}"))
}

/// Returns the lines that a search writes.
fn written(search: impl FnOnce(&mut dyn FnMut(&CertificateLine) -> io::Result<()>)) -> Vec<u8> {
    let mut lines = Vec::new();
    search(&mut |line| line.write(&mut lines));
    lines
}

/// Writes the certificate of a show's least clearance and has it checked. Returns the end of the stretch that is
/// proved; `None` for a scene without a clearance.
fn clearance_certified(text: &str) -> Option<Until> {
    let (claim, enclosed) = clearance_of(text)?;
    if let (Some(lo), Some(hi), Some(enclosed)) = (claim.lo, claim.hi, enclosed) {
        assert!(hi - lo <= 1e-9 && lo >= enclosed.lo && (hi - enclosed.hi).abs() < 1e-9, "{claim:?} {enclosed:?}");
    }
    Some(claim.until)
}

/// Returns a show's least clearance as the checker proves it, and as the search encloses it.
fn clearance_of(text: &str) -> Option<(ProvedClearance, Option<ClearanceEnclosure>)> {
    let scene = Scene::parse(text, "tight", "tight").ok()?;
    let timeline = scene.ensemble.timeline(&mut unreported);
    let show_end = timeline.show_end(scene.stops_at_contact());
    let hint = scene.ensemble.least_clearances(&timeline, show_end, &mut unreported).own?.least;
    let mut enclosed = None;
    let hints = ClearanceHints { boards: Some(&hint), obstacles: &[] };
    let proved = accepted(text, |write| {
        let most = MOST_STEPS / 4;
        enclosed =
            certify_clearances(&scene.ensemble, show_end, hints, text, most, write, &mut unreported).unwrap().own[0]
                .boards;
    });
    Some((proved.least_clearance.unwrap(), enclosed))
}

/// Boards that come nearest at the very lock that ends the show. Over the last nanometre before a lock they move by
/// the root of that, so a certificate has an upper bound only where its steps come nearer to the lock.
#[test]
#[ignore = "computes for long: tests/run --all"]
fn a_clearance_that_is_least_at_a_lock_claims_no_more_than_its_steps() {
    let (mut at_lock, mut index) = (0, 0);
    while at_lock < 8 {
        assert!(index < 2000, "{at_lock} scenes of {index}");
        let text = tight_route(&mut Rng::with_seed(0x10c6 + index));
        index += 1;
        let Ok(scene) = Scene::parse(&text, "tight", "tight") else { continue };
        let timeline = scene.ensemble.timeline(&mut unreported);
        let show_end = timeline.show_end(scene.stops_at_contact());
        let found = scene.ensemble.least_clearances(&timeline, show_end, &mut unreported).own;
        let lock = show_end.event.travelled;
        let is_at_lock = found.is_some_and(|found| found.least.travelled > lock - 1e-9);
        if show_end.event.kind != EventKind::Lock || !is_at_lock {
            continue;
        }
        at_lock += 1;
        let (claim, enclosed) = clearance_of(&text).unwrap();
        let enclosed = enclosed.unwrap();
        assert_eq!(claim.until, Until::Time, "{text}");
        if let (Some(lo), Some(hi)) = (claim.lo, claim.hi) {
            assert!(hi - lo <= 1e-9 && enclosed.travelled > lock - 1e-8, "{claim:?} {enclosed:?}\n{text}");
        } else {
            let is_short = enclosed.until.is_some_and(|until| until < enclosed.travelled);
            assert!(is_short, "{claim:?} {enclosed:?}\n{text}");
        }
    }
}

/// Writes the certificate of the greatest speed and has it checked. Returns false for a show without such a speed, or
/// one that is not decided.
fn speed_certified(text: &str) -> bool {
    let Ok(scene) = Scene::parse(text, "tight", "tight") else { return false };
    let timeline = scene.ensemble.timeline(&mut unreported);
    let mut found = None;
    let mut lines = Vec::new();
    let mut write = |line: &CertificateLine| line.write(&mut lines);
    if let Ok(Ok(speed)) = certify_greatest_speed(&scene, &timeline, 2.0, text, 50_000, &mut write, &mut unreported) {
        found = Some(speed);
    }
    let Some(speed) = found else { return false };
    let proved = verify(lines.as_slice(), &mut |_| ()).unwrap_or_else(|refused| panic!("{refused}\n{text}"));
    let claim = proved.greatest_speed.unwrap();
    assert_eq!((claim.value_lo, claim.value_hi), (speed.value_lo, speed.value_hi), "{text}");
    assert!(claim.value_hi - claim.value_lo <= 1e-9, "{claim:?}\n{text}");
    true
}

/// Certificates of the least pitch: of a team like the paper's, and of one whose head locks.
#[test]
#[ignore = "tests/run --all"]
fn certificates_of_the_least_pitch_are_accepted() {
    for (head, body, width, inset, radius) in
        [(3.41, 2.2, 0.3, 0.275, 4.5), (2.0, 2.0, 0.2, 0.1, 3.0), (3.0, 1.2, 0.4, 0.1, 1.6), (5.0, 1.0, 0.1, 0.1, 1.5)]
    {
        let text = format!(
            "[team]\nbenches = 40\nhead_length = {head}\nbody_length = {body}\nwidth = {width}\nhole_inset = {inset}\n\
             [path]\nkind = \"spiral\"\npitch = 0.6\nstart_turn = 12.0\n[motion]\nhead_speed = 1.0\n"
        );
        let scene = Scene::parse(&text, "pitch", "pitch").unwrap();
        let (team, mut found) = (scene.ensemble.only().unwrap().team(), None);
        let proved = accepted(&text, |write| {
            found = Some(certify_least_pitch(team, radius, &text, write, &mut unreported).unwrap().unwrap());
        });
        let (claim, found) = (proved.least_pitch.unwrap(), found.unwrap());
        println!("{claim:?} {found:?} {} steps", proved.steps);
        assert_eq!((claim.radius, claim.from, claim.value_hi), (radius, found.from, found.value_hi), "{text}");
        assert_eq!(claim.value_lo, (found.intervals > 0).then_some(found.value_lo), "{text}");
    }
}

/// Returns the numbers of the requested scenes.
fn numbers() -> Option<Range<usize>> {
    let asked = std::env::var("BENCH_DRAGON_SCENES").ok()?;
    let (from, to) = asked.split_once('-').unwrap_or_else(|| panic!("BENCH_DRAGON_SCENES is {asked}"));
    Some(from.parse().unwrap()..to.parse().unwrap())
}

/// Certifies a scene, and if `all` also its least clearance and its greatest speed. Returns the status of each result,
/// the end of the clearance's stretch, and true if the speed was decided.
///
/// # Panics
/// The checker refuses a certificate.
fn tried(index: usize, all: bool) -> (Vec<Status>, Option<Until>, bool) {
    let text = scene(index, &mut Rng::with_seed(0x7163 + index as u64));
    let results = certified(&text).unwrap_or_default();
    let until = if all { clearance_certified(&text) } else { None };
    (results, until, all && speed_certified(&text))
}

#[test]
fn every_certificate_of_a_tight_route_is_accepted() {
    let numbers = numbers().unwrap_or(0..harness::cases(12, 200, 100_000));
    let count = numbers.len();
    let stride = if harness::long() { LONG_STRIDE } else { STRIDE };
    let next = AtomicUsize::new(numbers.start);
    let statuses: Mutex<BTreeMap<String, usize>> = Mutex::default();
    let failed: Mutex<Vec<usize>> = Mutex::default();
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= numbers.end {
                        return;
                    }
                    let tried = panic::catch_unwind(|| tried(index, index.is_multiple_of(stride)));
                    let Ok((results, until, has_speed)) = tried else {
                        // The panic's own sentence names no scene.
                        println!("scene {index} failed");
                        failed.lock().unwrap().push(index);
                        continue;
                    };
                    if harness::long() && index.is_multiple_of(1000) {
                        println!("scene {index}");
                    }
                    let mut statuses = statuses.lock().unwrap();
                    *statuses.entry("speeds".to_owned()).or_default() += usize::from(has_speed);
                    if let Some(until) = until {
                        *statuses.entry(format!("clearance to {until:?}")).or_default() += 1;
                    }
                    for status in results {
                        *statuses.entry(format!("{status:?}")).or_default() += 1;
                    }
                }
            });
        }
    });
    let (statuses, failed) = (statuses.into_inner().unwrap(), failed.into_inner().unwrap());
    println!("{count} scenes: {statuses:?}");
    assert!(failed.is_empty(), "scenes {failed:?} failed");
    let [proved, none, undecided] =
        ["Proved", "None", "Undecided"].map(|status| statuses.get(status).copied().unwrap_or(0));
    // Most scenes are legal, and most of those are decided.
    let to_end = statuses.get("clearance to PathEnd").copied().unwrap_or(0);
    let tried = count / stride;
    assert!(to_end * 10 > tried && statuses["speeds"] * 10 > tried, "{statuses:?}");
    assert!(proved > count && none > count / 2 && undecided * 10 < proved + none, "{statuses:?}");
}

/// Places beside a contact have a second double. Spans that are hardly wider than a unit in the last place are read as
/// they were written.
#[test]
#[ignore = "tests/run --all"]
fn certificates_of_slow_contacts_are_accepted() {
    let paper = std::fs::read_to_string("config/paper.toml").unwrap();
    for pitch in &["0.412", "0.43", "0.431"][..harness::cases(1, 3, 3)] {
        let text = paper.replace("pitch = 0.55", &format!("pitch = {pitch}"));
        assert_ne!(text, paper);
        let results = certified_in(&text, 20_000).unwrap();
        assert!(!results.contains(&Status::Undecided), "{pitch}: {results:?}");
    }
}

/// Certificates that an earlier checker refused:
///
/// - places beside a junction at coordinate 0,
/// - boards that are apart only along the line between their middles,
/// - a lock whose window has to be wider than the last step,
/// - steps that are shorter than the distance of two doubles.
#[test]
fn certificates_that_were_refused_are_accepted() {
    for name in ["beside_a_junction", "apart_between_middles", "wide_lock_window", "short_steps_at_a_lock"] {
        let text = std::fs::read_to_string(format!("tests/scenes/{name}.toml")).unwrap();
        let results = certified(&text).unwrap();
        assert!(!results.contains(&Status::Undecided), "{name}: {results:?}");
    }
}

/// A nearer place comes to the distance of the head's link on this way, and a follower that jumped to it would touch a
/// board. The handle continues, and all events are decided: no contact, a stall, no lock, the path's end.
#[test]
fn a_certificate_of_a_follower_that_passes_a_nearer_place_is_accepted() {
    let text = std::fs::read_to_string("tests/scenes/passes_a_nearer_place.toml").unwrap();
    let results = certified(&text).unwrap();
    assert_eq!(results, [Status::None, Status::Proved, Status::None, Status::Proved]);
}

/// The turns of a piece whose length is given are known to more digits than a double has. Rounded, they end this spiral
/// eleven units of the last place beyond its end.
#[test]
fn certificates_of_pieces_with_a_length_are_accepted() {
    let of = |side| {
        format!(
            "[team]\nbenches = 4\nhead_length = 2.0\nbody_length = 1.7\nwidth = 0.3\nhole_inset = 0.2\n\
             [motion]\nhead_speed = 1.0\n[path]\nkind = \"pieces\"\npieces = [\
             {{ kind = \"spiral\", pitch = 1.3352237204161512, radius = 9.44798345608685, direction = \"in\", \
             side = \"left\", length = 192.57 }}, {{ kind = \"line\", length = 0.3 }}, \
             {{ kind = \"arc\", radius = 2.3, side = \"{side}\", length = 3.1 }}, \
             {{ kind = \"line\", length = 1.0 }}]\n"
        )
    };
    for side in ["left", "right"] {
        let results = certified(&of(side)).unwrap();
        assert!(!results.contains(&Status::Undecided), "{side}: {results:?}");
        assert!(clearance_certified(&of(side)).is_some(), "{side}");
    }
}

/// A certificate of the least clearance, the greatest speed or the least pitch is refused without any one of its lines.
/// It is also refused with a result that claims a little more.
#[test]
#[ignore = "computes for long: tests/run --all"]
fn changed_certificates_of_other_questions_are_refused() {
    let team = "[team]\nbenches = 5\nhead_length = 2.2\nbody_length = 1.6\nwidth = 0.3\nhole_inset = 0.2\n\
                [motion]\nhead_speed = 1.0\n";
    let route = format!(
        "{team}[path]\nkind = \"pieces\"\npieces = [{{ kind = \"line\", length = 2.0 }}, \
         {{ kind = \"arc\", radius = 2.5, side = \"left\", turns = 0.6 }}, {{ kind = \"line\", length = 1.0 }}]\n"
    );
    let spiral = "[team]\nbenches = 40\nhead_length = 5.0\nbody_length = 1.0\nwidth = 0.1\nhole_inset = 0.1\n\
                  [path]\nkind = \"spiral\"\npitch = 0.6\nstart_turn = 12.0\n[motion]\nhead_speed = 1.0\n";
    let scene = Scene::parse(&route, "route", "route").unwrap();
    let timeline = scene.ensemble.timeline(&mut unreported);
    let show_end = timeline.show_end(scene.stops_at_contact());
    let hint = scene.ensemble.least_clearances(&timeline, show_end, &mut unreported).own.unwrap().least;
    let clearance = written(|write| {
        let hints = ClearanceHints { boards: Some(&hint), obstacles: &[] };
        let found =
            certify_clearances(&scene.ensemble, show_end, hints, &route, MOST_STEPS, write, &mut unreported).unwrap();
        found.own[0].boards.unwrap();
    });
    let speed = written(|write| {
        certify_greatest_speed(&scene, &timeline, 2.0, &route, 50_000, write, &mut unreported).unwrap().unwrap();
    });
    let on_spiral = Scene::parse(spiral, "spiral", "spiral").unwrap();
    let pitch = written(|write| {
        certify_least_pitch(on_spiral.ensemble.only().unwrap().team(), 1.5, spiral, write, &mut unreported)
            .unwrap()
            .unwrap();
    });
    // Each field of a result with the change that makes the claim stronger.
    let fields: [(_, &[(&str, f64)]); 3] = [
        (clearance, &[("lo", 1e-6), ("hi", -1e-6)]),
        (
            speed,
            &[("value_lo", 1e-6), ("value_hi", -1e-6), ("ratio_lo", 1e-6), ("ratio_hi", -1e-6), ("time_until", 1.0)],
        ),
        (pitch, &[("value_lo", 1e-6), ("value_hi", -1e-6), ("radius", -0.1), ("from", -1e-3)]),
    ];
    for (lines, fields) in fields {
        let lines = String::from_utf8(lines).unwrap();
        verify(lines.as_bytes(), &mut |_| ()).unwrap();
        let lines: Vec<&str> = lines.lines().collect();
        let is_refused = |lines: &[&str]| verify(lines.join("\n").as_bytes(), &mut |_| ()).is_err();
        for left_out in (0..lines.len()).rev().step_by(1 + lines.len() / MOST_LEFT_OUT) {
            let rest = [&lines[..left_out], &lines[left_out + 1..]].concat();
            assert!(is_refused(&rest), "without line {}: {}", left_out + 1, lines[left_out]);
        }
        let (result, before) = lines.split_last().unwrap();
        for (field, more) in fields {
            let mut changed: serde_json::Value = serde_json::from_str(result).unwrap();
            changed[*field] = (changed[*field].as_f64().unwrap() + more).into();
            let changed = changed.to_string();
            assert!(is_refused(&[before, &[changed.as_str()]].concat()), "{field}: {changed}");
        }
    }
}

/// A handle's speed beyond the path's end is no speed of the scene: the last segment continues along its curve.
#[test]
fn a_speed_beyond_the_end_of_the_path_is_refused() {
    let text = "[team]\nbenches = 3\nhead_length = 2.2\nbody_length = 1.6\nwidth = 0.3\nhole_inset = 0.2\n\
                [motion]\nhead_speed = 1.0\n[path]\nkind = \"pieces\"\npieces = [\
                { kind = \"arc\", radius = 1.5, side = \"left\", turns = 0.3 }, { kind = \"line\", length = 2.0 }]\n";
    let scene = Scene::parse(text, "route", "route").unwrap();
    let timeline = scene.ensemble.timeline(&mut unreported);
    let lines = written(|write| {
        certify_greatest_speed(&scene, &timeline, 2.0, text, 50_000, write, &mut unreported).unwrap().unwrap();
    });
    let lines = String::from_utf8(lines).unwrap();
    verify(lines.as_bytes(), &mut |_| ()).unwrap();
    let shorter = lines.replace("length = 2.0", "length = 0.01");
    assert_ne!(shorter, lines);
    let until: serde_json::Value = serde_json::from_str(lines.lines().last().unwrap()).unwrap();
    let shorter = shorter.replace(&format!("\"time_until\":{}", until["time_until"]), "\"time_until\":2.0");
    let refused = verify(shorter.as_bytes(), &mut |_| ()).unwrap_err().to_string();
    assert!(refused.contains("beyond the end of the path"), "{refused}");
    // Nor is one after the time up to which the claim holds.
    let sooner = lines.replace(&format!("\"time_until\":{}", until["time_until"]), "\"time_until\":3.0");
    let refused = verify(sooner.as_bytes(), &mut |_| ()).unwrap_err().to_string();
    assert!(refused.contains("ratio_lo of this handle does not follow"), "{refused}");
}

/// A link that is nearly as long as its circle is wide. Over a long step, the enclosure of its rear product has zero in
/// it. The checker divides by the product though the link is rigid.
#[test]
fn a_speed_on_a_circle_hardly_wider_than_the_link_is_accepted() {
    let text = "[team]\nbenches = 3\nhead_length = 0.898\nbody_length = 1.695\nwidth = 0.066\nhole_inset = 0.1\n\
                [motion]\nhead_speed = 1.0\n[path]\nkind = \"pieces\"\npieces = [\
                { kind = \"arc\", radius = 0.3490297751698467, side = \"left\", turns = 0.5 }, \
                { kind = \"arc\", radius = 0.3612451762601705, side = \"right\", turns = 0.75 }]\n";
    let scene = Scene::parse(text, "route", "route").unwrap();
    let timeline = scene.ensemble.timeline(&mut unreported);
    let lines = written(|write| {
        certify_greatest_speed(&scene, &timeline, 2.0, text, 50_000, write, &mut unreported).unwrap().unwrap();
    });
    verify(lines.as_slice(), &mut |_| ()).unwrap();
}
