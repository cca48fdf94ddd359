//! Several dragons in one show:
//!
//! - first contacts against a brute force that shares no code with the search,
//! - cases by hand,
//! - frames against the solvers of each dragon,
//! - bad input.

use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::clearance::{least_clearance_all_pairs, nearest_between_all_pairs};
use bench_dragon::motion::ensemble::{Dragon, Ensemble};
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::model::team::Team;
use bench_dragon::motion::solve::newton::Newton;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::motion::timeline::{TimedEvent, Timeline};
use bench_dragon::show::scene::{AtEnd, Scene, SceneText};
use bench_dragon::show::{Playback, Show};
use fastrand::Rng;

/// A dragon of `benches` benches with head and body boards of 2.2 m.
pub fn dragon(name: &str, benches: usize, placement: &str, speed: f64, delay: f64, path: &str) -> String {
    format!(
        "[[dragons]]\nname = \"{name}\"\nplacement = {placement}\ndelay = {delay:?}\n[dragons.team]\n\
         benches = {benches}\n\
         head_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n[dragons.path]\n{path}\n\
         [dragons.motion]\nhead_speed = {speed:?}\n"
    )
}

pub fn line(length: f64) -> String {
    format!("kind = \"pieces\"\npieces = [{{ kind = \"line\", length = {length:?} }}]")
}

fn scene(text: &str) -> Scene {
    Scene::parse(text, "several.toml", "several").unwrap()
}

fn timeline(text: &str) -> Timeline {
    scene(text).ensemble.timeline(&mut unreported)
}

fn contact(text: &str) -> Option<TimedEvent> {
    timeline(text).find(EventKind::Contact).copied()
}

/// Corners of a board, from its two handles.
pub type Corners = [[f64; 2]; 4];

fn corners(front: [f64; 2], rear: [f64; 2], team: &Team) -> Corners {
    let (dx, dy) = (front[0] - rear[0], front[1] - rear[1]);
    let link = dx.hypot(dy);
    let (ux, uy) = (dx / link, dy / link);
    let (inset, half) = (team.hole_inset, 0.5 * team.width);
    let corner =
        |at: [f64; 2], along: f64, across: f64| [at[0] + along * ux - across * uy, at[1] + along * uy + across * ux];
    [corner(front, inset, half), corner(rear, -inset, half), corner(rear, -inset, -half), corner(front, inset, -half)]
}

/// The largest gap along the normals of two rectangles: below 0 where they overlap, and never more than their distance.
pub fn gap(a: &Corners, b: &Corners) -> f64 {
    let along = |corners: &Corners, x: f64, y: f64| {
        let places = corners.map(|corner| corner[0] * x + corner[1] * y);
        (places.iter().copied().fold(f64::INFINITY, f64::min), places.iter().copied().fold(f64::NEG_INFINITY, f64::max))
    };
    let mut most = f64::NEG_INFINITY;
    for side in [a, b].into_iter().flat_map(|of| [(of[0], of[1]), (of[1], of[2])]) {
        let (x, y) = (side.1[0] - side.0[0], side.1[1] - side.0[1]);
        let length = x.hypot(y);
        let ((a_low, a_high), (b_low, b_high)) = (along(a, x / length, y / length), along(b, x / length, y / length));
        most = most.max(b_low - a_high).max(a_low - b_high);
    }
    most
}

/// The boards of all dragons at a time of the show, by exact motion, with their numbers.
pub fn all_boards(ensemble: &Ensemble, time: f64) -> Option<Vec<(usize, Corners)>> {
    let mut boards = Vec::new();
    let mut first = 0;
    for Dragon { motion, delay, .. } in ensemble.dragons() {
        let team = *motion.team();
        let own = (time - delay).clamp(0.0, motion.path().length() / motion.head_speed());
        let newton = Newton::new(motion.path().clone(), team, motion.head_speed(), Velocities::Omitted);
        let mut chain = Chain::new(team.handles());
        newton.solve_at(motion.head_speed() * own, &mut chain).ok()?;
        motion.placement().chain(&mut chain.all_mut());
        let handle = |k: usize| [chain.x[k], chain.y[k]];
        boards.extend((0..team.benches).map(|k| (first + k, corners(handle(k), handle(k + 1), &team))));
        first += team.handles();
    }
    Some(boards)
}

/// Returns the least gap of all pairs without a common handle, and the pair.
fn least_gap(boards: &[(usize, Corners)]) -> (f64, (usize, usize)) {
    let mut least = (f64::INFINITY, (0, 0));
    for (k, (a, one)) in boards.iter().enumerate() {
        for (b, other) in boards[k + 1..].iter().filter(|(b, _)| *b > a + 1) {
            let value = gap(one, other);
            if value < least.0 {
                least = (value, (*a, *b));
            }
        }
    }
    least
}

/// The first contact up to a time by small steps. No step is longer than the gap over a speed that no board reaches, or
/// than 20 microseconds if that is longer.
pub fn brute_force(ensemble: &Ensemble, until: f64) -> Option<(f64, (usize, usize))> {
    let fastest: f64 = 5.0 * ensemble.dragons().iter().map(|dragon| dragon.motion.head_speed()).sum::<f64>();
    let (mut time, mut before) = (0.0, 0.0);
    while time < until {
        let (value, pair) = least_gap(&all_boards(ensemble, time)?);
        if value <= 0.0 {
            let (mut apart, mut touching) = (before, time);
            while touching - apart > 1e-12 {
                let middle = 0.5 * (apart + touching);
                if least_gap(&all_boards(ensemble, middle)?).0 <= 0.0 { touching = middle } else { apart = middle }
            }
            return Some((touching, if time == 0.0 { pair } else { least_gap(&all_boards(ensemble, touching)?).1 }));
        }
        before = time;
        time += (value / fastest).max(2e-5);
    }
    None
}

fn between(rng: &mut Rng, least: f64, most: f64) -> f64 {
    least + rng.f64() * (most - least)
}

fn any_path(rng: &mut Rng) -> String {
    if rng.f64() < 0.3 {
        let pitch = between(rng, 1.2, 3.0);
        return format!("kind = \"spiral\"\npitch = {pitch:?}\nstart_turn = {:?}", between(rng, 4.0, 7.0));
    }
    let mut pieces = Vec::new();
    for _ in 0..rng.usize(2..5) {
        pieces.push(if rng.bool() {
            format!("{{ kind = \"line\", length = {:?} }}", between(rng, 2.0, 15.0))
        } else {
            let side = if rng.bool() { "left" } else { "right" };
            let (radius, turns) = (between(rng, 4.0, 9.0), between(rng, 0.1, 0.4));
            format!("{{ kind = \"arc\", radius = {radius:?}, turns = {turns:?}, side = \"{side}\" }}")
        });
    }
    format!("kind = \"pieces\"\npieces = [{}]", pieces.join(", "))
}

pub fn any_dragon(rng: &mut Rng, name: &str) -> String {
    let (x, y) = (between(rng, -12.0, 12.0), between(rng, -12.0, 12.0));
    let (turns, mirror) = (between(rng, -0.5, 0.5), rng.bool());
    let placement = format!("{{ origin = [{x:?}, {y:?}], rotation_turns = {turns:?}, mirror = {mirror} }}");
    let delay = if rng.bool() { 0.0 } else { between(rng, 0.0, 8.0) };
    dragon(name, rng.usize(2..9), &placement, between(rng, 0.5, 2.0), delay, &any_path(rng))
}

#[test]
fn first_contacts_are_those_of_a_brute_force_over_random_pairs() {
    let mut rng = Rng::with_seed(39);
    let (mut contacts, mut between, mut without) = (0, 0, 0);
    for case in 0..240 {
        let text = any_dragon(&mut rng, "gold") + &any_dragon(&mut rng, "jade");
        let Ok(scene) = Scene::parse(&text, "pair.toml", "pair") else { continue };
        let ensemble = &scene.ensemble;
        let timeline = scene.ensemble.timeline(&mut unreported);
        assert_eq!(timeline.searched_until(), None, "{case}: {text}");
        let found = timeline.find(EventKind::Contact);
        // In the last digits before a lock there may be no solution.
        let truth = brute_force(ensemble, timeline.end().time * (1.0 - 1e-9));
        match (found, truth) {
            (None, None) => without += 1,
            (Some(found), Some((time, (a, b)))) => {
                assert!((found.time - time).abs() < 2e-9, "{case}: {} instead of {time}\n{text}", found.time);
                // On a straight line two benches with a common handle have one edge, and are touched at once.
                let pair = [found.event.bench_a, found.event.bench_b].map(|bench| bench.unwrap() as usize);
                let of = all_boards(ensemble, time).unwrap();
                let corners = pair.map(|bench| of.iter().find(|(number, _)| *number == bench).unwrap().1);
                let same = pair == [a, b] || (time > 0.0 && gap(&corners[0], &corners[1]).abs() < 1e-9);
                assert!(same, "{case}: {pair:?} instead of {:?} at {time}\n{text}", (a, b));
                contacts += 1;
                let owner = |bench: usize| ensemble.owner(bench).unwrap().0;
                between += usize::from(owner(a) != owner(b));
            }
            (found, truth) => panic!("{case}: {found:?} instead of {truth:?}\n{text}"),
        }
    }
    println!("{contacts} contacts, {between} of two dragons, {without} shows without");
    assert!(between >= 80 && without >= 20, "{contacts} contacts, {between} between, {without} without");
}

#[test]
fn heads_that_meet_on_parallel_lines() {
    // The fronts of the boards are 0.275 m ahead of the heads' handles, 40 m apart; 1 and 1.5 m/s.
    let east = dragon("gold", 3, "{ origin = [-20.0, 0.0] }", 1.0, 0.0, &line(100.0));
    let west = dragon("jade", 3, "{ origin = [20.0, 0.2], rotation_turns = 0.5 }", 1.5, 0.0, &line(100.0));
    let found = contact(&(east.clone() + &west)).unwrap();
    assert!((found.time - (40.0 - 0.55) / 2.5).abs() < 1e-12, "{}", found.time);
    assert_eq!((found.event.bench_a, found.event.bench_b), (Some(0), Some(4)));
    // 0.31 m beside each other they pass.
    let beside = dragon("jade", 3, "{ origin = [20.0, 0.31], rotation_turns = 0.5 }", 1.5, 0.0, &line(100.0));
    assert!(contact(&(east.clone() + &beside)).is_none());
    let scene = scene(&(east + &beside));
    let timeline = scene.ensemble.timeline(&mut unreported);
    let least = scene.ensemble.least_clearances(&timeline, timeline.end(), &mut unreported).of_show.unwrap();
    assert!((least.least.value - 0.01).abs() < 1e-12, "{}", least.least.value);
}

#[test]
fn a_faster_one_catches_a_tail_at_some_millimetres_a_second() {
    for excess in [0.5, 0.004] {
        // gold's tail handle is 2.86 + 1.65 m behind its head; its board ends 0.275 m further back.
        let gold = dragon("gold", 2, "{ origin = [30.0, 0.0] }", 1.0, 0.0, &line(9000.0));
        let jade = dragon("jade", 2, "{ origin = [20.0, 0.0] }", 1.0 + excess, 0.0, &line(9000.0));
        let found = contact(&(gold + &jade)).unwrap();
        let gap = 10.0 - (2.86 + 1.65) - 0.55;
        assert!((found.time - gap / excess).abs() < 1e-9 * (1.0 + 1e-3 / excess), "{}: {}", excess, found.time);
        assert_eq!((found.event.bench_a, found.event.bench_b), (Some(1), Some(3)));
    }
}

#[test]
fn a_dragon_that_waits_and_one_that_stands_are_touched() {
    // jade stands 30 m ahead during its delay: gold's front is there after 30 - 0.55 - 2.86 - 1.65 m.
    let gold = dragon("gold", 2, "{ origin = [0.0, 0.0] }", 1.0, 0.0, &line(200.0));
    let jade = dragon("jade", 2, "{ origin = [30.0, 0.0] }", 1.0, 100.0, &line(10.0));
    let waiting = 30.0 - 0.55 - 2.86 - 1.65;
    assert!((contact(&(gold.clone() + &jade)).unwrap().time - waiting).abs() < 1e-12);
    // Jade goes 10 m and stands at its path's end.
    let jade = dragon("jade", 2, "{ origin = [30.0, 0.0] }", 2.0, 0.0, &line(10.0));
    let text = gold + &jade;
    let timeline = timeline(&text);
    assert!((timeline.find(EventKind::Contact).unwrap().time - waiting - 10.0).abs() < 1e-12);
    let ends: Vec<f64> =
        timeline.all().iter().filter(|of| of.event.kind == EventKind::PathEnd).map(|of| of.time).collect();
    assert_eq!(ends, [5.0, 200.0]);
    assert_eq!(timeline.end().time, 200.0);
}

#[test]
fn a_dragon_that_starts_on_another_is_a_contact_at_time_0() {
    let gold = dragon("gold", 2, "{ origin = [0.0, 0.0] }", 1.0, 0.0, &line(50.0));
    let jade = dragon("jade", 2, "{ origin = [-1.0, 0.1], rotation_turns = 0.25 }", 1.0, 0.0, &line(50.0));
    assert_eq!(contact(&(gold + &jade)).unwrap().time, 0.0);
}

#[test]
fn the_first_lock_of_any_ends_the_show_and_a_path_end_does_not() {
    let spiral = "kind = \"spiral\"\npitch = 0.55\nstart_turn = 4";
    let gold = dragon("gold", 3, "{ origin = [0.0, 0.0] }", 1.0, 7.0, spiral);
    let jade = dragon("jade", 3, "{ origin = [100.0, 0.0] }", 1.0, 0.0, &line(3.0));
    let both = scene(&(gold.clone() + &jade));
    let timeline = both.ensemble.timeline(&mut unreported);
    let alone = gold.replace("[[dragons]]\nname = \"gold\"\nplacement = { origin = [0.0, 0.0] }\ndelay = 7.0\n", "");
    let alone = Scene::parse(&alone.replace("[dragons.", "["), "one.toml", "one").unwrap();
    let own = alone.ensemble.timeline(&mut unreported);
    assert_eq!(own.end().event.kind, EventKind::Lock);
    assert_eq!((timeline.end().event.kind, timeline.end().time), (EventKind::Lock, own.end().time + 7.0));
    let path_ends = timeline.all().into_iter().filter(|of| of.event.kind == EventKind::PathEnd);
    assert_eq!(path_ends.map(|of| (of.time, of.event.bench_a)).collect::<Vec<_>>(), [(3.0, Some(4))]);
    assert_eq!(timeline.latest_passed(5.0), None, "a dragon that stands changes no state");
}

#[test]
fn a_frame_has_the_handles_of_all_and_the_least_clearance_of_any_two() {
    let spiral = "kind = \"spiral\"\npitch = 1.7\nstart_turn = 6";
    let gold = dragon("gold", 30, "{ origin = [0.0, 0.0] }", 1.0, 0.0, spiral);
    let jade = dragon("jade", 25, "{ rotation_turns = 0.5 }", 0.9, 4.0, spiral);
    let rose = dragon("rose", 4, "{ origin = [18.0, -10.0], rotation_turns = 0.3 }", 1.0, 0.0, &line(20.0));
    let text = format!("[motion]\non_contact = \"continue\"\n[alerts]\n{gold}{jade}{rose}");
    let scene = scene(&text);
    let ensemble = &scene.ensemble;
    let mut show = Show::new(&scene, scene.ensemble.timeline(&mut unreported), Playback::of(&scene)).unwrap();
    let of = |Dragon { motion, .. }: &Dragon| {
        (motion.solver(Velocities::Computed).solver, Chain::new(motion.team().handles()))
    };
    let mut own: Vec<_> = ensemble.dragons().iter().map(of).collect();
    for tick in (0..6000).step_by(7) {
        let frame = show.frame(tick);
        assert_eq!((frame.chain.handles(), frame.unsolved_frames), (62, 0));
        for (k, (Dragon { motion, delay, .. }, (solver, chain))) in ensemble.dragons().iter().zip(&mut own).enumerate()
        {
            let end = motion.path().length() / motion.head_speed();
            let time = frame.sim_time - delay;
            let stands = time < 0.0 || time >= end;
            solver.solve(time.clamp(0.0, end), chain).unwrap();
            let handles = ensemble.handles_of(k);
            assert_eq!(frame.chain.x[handles.clone()], chain.x, "{tick}");
            assert_eq!(frame.chain.heading[handles.clone()], chain.heading, "{tick}");
            let still = frame.chain.vx[handles.clone()].iter().all(|vx| *vx == 0.0);
            assert_eq!(still, stands, "{tick}");
        }
        let expected = least_by_all_pairs(ensemble, &frame.chain);
        assert!((frame.min_clearance - expected).abs() < 1e-12, "{tick}: {} {expected}", frame.min_clearance);
    }
    assert_eq!(show.frame(6000).unforeseen_contacts, 0);
}

/// Returns the least clearance of a chain of all dragons, by all pairs.
fn least_by_all_pairs(ensemble: &Ensemble, chain: &Chain) -> f64 {
    let teams: Vec<Team> = ensemble.dragons().iter().map(|dragon| *dragon.motion.team()).collect();
    let own = teams.iter().enumerate().filter_map(|(k, team)| {
        let mut own = Chain::new(team.handles());
        own.x.copy_from_slice(&chain.x[ensemble.handles_of(k)]);
        own.y.copy_from_slice(&chain.y[ensemble.handles_of(k)]);
        least_clearance_all_pairs(&own, team)
    });
    let all = own.chain(nearest_between_all_pairs(chain, &teams));
    all.map(|pair| pair.value).fold(f64::INFINITY, f64::min)
}

/// Shows of two or three dragons, played for a while, then with jumps to any time.
#[test]
fn the_least_clearance_of_a_frame_is_that_of_all_pairs_after_any_jump() {
    let mut rng = Rng::with_seed(41);
    let mut compared = 0;
    for case in 0..60 {
        let accuracy = ["", "accuracy = 1e-3\n", "accuracy = 1e-6\n"][case % 3];
        let names = &["gold", "jade", "rose"][..rng.usize(2..4)];
        let dragons: String = names.iter().map(|name| any_dragon(&mut rng, name)).collect();
        let dragons = dragons.replace("[dragons.motion]\n", &format!("[dragons.motion]\n{accuracy}"));
        let text = format!("[motion]\non_contact = \"continue\"\n[alerts]\n{dragons}");
        let Ok(scene) = Scene::parse(&text, "jumps.toml", "jumps") else { continue };
        let ensemble = &scene.ensemble;
        let timeline = scene.ensemble.timeline_without_contact(&mut unreported);
        let ticks = (60.0 * timeline.end().time) as u64;
        // The show loops, so that later ticks are at any time of a showing, before or after the last.
        let playback = Playback { at_end: AtEnd::Loop, ..Playback::of(&scene) };
        let mut show = Show::new(&scene, timeline, playback).unwrap();
        let jumps = Vec::from_iter((1..=60).map(|showing| showing * ticks + rng.u64(0..ticks)));
        for tick in (0..60.min(ticks)).chain(jumps) {
            let frame = show.frame(tick);
            let least = least_by_all_pairs(ensemble, &frame.chain);
            let difference = (frame.min_clearance - least).abs();
            assert!(difference < 1e-12, "{case}, {tick}: {} {least}\n{text}", frame.min_clearance);
            compared += 1;
        }
    }
    assert!(compared > 5000, "{compared}");
}

#[test]
fn of_dragons_that_coil_few_boards_are_tested() {
    let scene = scene(&std::fs::read_to_string("config/coil.toml").unwrap());
    let playback = Playback { start: 150.0, ..Playback::of(&scene) };
    let mut show = Show::new(&scene, scene.ensemble.timeline_without_contact(&mut unreported), playback).unwrap();
    (0..600).for_each(|tick| _ = show.frame(tick));
    // A search from frame to frame tests more than 20.
    assert!(show.pairs_tested() < 600 * 8, "{} of 600 frames", show.pairs_tested());
}

#[test]
fn what_cannot_be_is_refused_in_one_sentence() {
    let gold = dragon("gold", 3, "{ origin = [0.0, 0.0] }", 1.0, 0.0, &line(5.0));
    let jade = gold.replace("gold", "jade");
    let many: String = (0..17).map(|k| gold.replace("gold", &format!("d{k}"))).collect();
    let team = "[team]\nbenches = 3\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n";
    let cue = "[[cues]]\nname = \"half\"\ntravelled = 3.0\n";
    for (text, expected) in [
        (gold.clone() + &gold, "x.toml, line 17: dragons.name \"gold\" is given twice, expected each name once"),
        (team.to_owned() + &gold, "x.toml, line 1: [team] stands beside [[dragons]]"),
        (many, "x.toml, line 242: there are 17 dragons, expected at most 16"),
        (gold.replace("\"gold\"", "\"Gold\""), "x.toml, line 2: dragons.name is \"Gold\", expected 1 to 32 of"),
        (gold.replace("\"gold\"", "\"\""), "dragons.name is \"\", expected 1 to 32 of"),
        (gold.replace("benches = 3", "benches = 0"), "x.toml, line 6: dragon \"gold\": team.benches is 0, expected"),
        (gold.replace("delay = 0.0", "delay = -1.0"), "x.toml, line 4: dragon \"gold\": delay is -1, expected"),
        (
            gold.replace("head_speed", "solver = \"paper\"\nhead_speed"),
            "motion.solver is \"paper\", which a show of several",
        ),
        (gold.replace("head_speed", "at_end = \"loop\"\nhead_speed"), "motion.at_end belongs to the whole show"),
        (format!("dragons = []\n{team}"), "[team] stands beside [[dragons]]"),
        ("dragons = []\n".to_owned(), "dragons is empty, expected 1 to 16 dragons"),
        (format!("{cue}{gold}{jade}"), "x.toml, line 3: cues.travelled names no dragon"),
        (gold.replace("[dragons.motion]\nhead_speed = 1.0\n", ""), "missing field `motion`"),
        (
            format!("[motion]\nhead_speed = 1.0\n{gold}"),
            "motion.head_speed: unknown field here, head_speed stands in [dragons.motion]",
        ),
    ] {
        let error = Scene::parse(&text, "x.toml", "x").unwrap_err().to_string();
        assert!(error.contains(expected), "{error}\ninstead of: {expected}");
        assert!(!error.contains('\n'), "{error}");
    }
    let gold = SceneText { text: gold, file: "x.toml".to_owned(), stem: "x".to_owned() };
    let error = gold.parse_only().unwrap_err().to_string();
    assert!(error.starts_with("x.toml, line 1: the scene has several dragons"), "{error}");
}
