//! The proved enclosures of a show's least clearance and of the least pitch. They are compared with poses of the brute
//! force in `tests/compute/oracle`, with distances by parry2d.

use bench_dragon::certify::plan::{LeastPitch, Overlap, least_pitch};
use bench_dragon::certify::{CertificateLine, ClearanceEnclosure, ClearanceHints, certify_clearances};
use bench_dragon::motion::event::unreported;
use bench_dragon::show::scene::Scene;

use crate::oracle::{chain, scenes};
use bench_dragon::motion::model::team::{Ends, Team};
use parry2d_f64::math::Pose as At;
use parry2d_f64::query;
use parry2d_f64::shape::Cuboid;

/// The least pitch of the paper's team to 4.5 m, from computations with 50 digits.
const LEAST_PITCH: f64 = 0.450_337_393_027_195_5;

/// Greatest error of the brute force, metres.
const ROUNDING: f64 = 1e-10;

/// Returns the distance of two boards by parry, 0 if they overlap.
fn distance(team: &chain::Team, pose: &chain::Pose, [a, b]: [usize; 2]) -> f64 {
    let placed = |bench: usize| {
        let [front, rear] = [bench, bench + 1].map(|handle| pose.handles[handle].point);
        let (middle, along) = (0.5 * (front + rear), front - rear);
        let shape = Cuboid::new([0.5 * team.link(bench) + team.hole_inset, 0.5 * team.width(bench)].into());
        (At::new([middle.x, middle.y].into(), along.y.atan2(along.x)), shape)
    };
    let ((at_a, shape_a), (at_b, shape_b)) = (placed(a), placed(b));
    query::distance(&at_a, &shape_a, &at_b, &shape_b).unwrap().distance
}

/// Returns the least distance of any two boards that share no handle. Boards whose middles are further apart than
/// `limit` are not tested.
fn least_distance(team: &chain::Team, pose: &chain::Pose, limit: f64) -> f64 {
    let middle = |bench: usize| 0.5 * (pose.handles[bench].point + pose.handles[bench + 1].point);
    let reach = |bench: usize| (0.5 * team.link(bench) + team.hole_inset).hypot(0.5 * team.width(bench));
    let pairs = (0..team.benches).flat_map(|a| (a + 2..team.benches).map(move |b| [a, b]));
    let near = pairs.filter(|[a, b]| (middle(*a) - middle(*b)).norm() < reach(*a) + reach(*b) + limit);
    near.map(|pair| distance(team, pose, pair)).fold(f64::INFINITY, f64::min)
}

/// Compares the enclosure of a scene's show with `samples` times of the show. Returns `None` if there is no enclosure.
fn compared(text: &str, samples: u32, most_steps: u64) -> Option<ClearanceEnclosure> {
    let scene = Scene::parse(text, "test", "test").ok()?;
    let timeline = scene.ensemble.timeline(&mut unreported);
    let show_end = timeline.show_end(scene.stops_at_contact());
    let hint = scene.ensemble.least_clearances(&timeline, show_end, &mut unreported).own?.least;
    let hints = ClearanceHints { boards: Some(&hint), obstacles: &[] };
    let mut write = |_: &CertificateLine| Ok(());
    let enclosure = certify_clearances(&scene.ensemble, show_end, hints, "", most_steps, &mut write, &mut unreported);
    let enclosure = enclosure.unwrap().own[0].boards?;
    let ClearanceEnclosure { lo, hi, travelled, bench_a, bench_b, until, .. } = enclosure;
    println!("{:?} {enclosure:?}", show_end.event.kind);
    assert!(lo <= hi && hi - lo <= 1e-9, "{enclosure:?}");
    let (team, path) = scenes::read(text);
    let chain = chain::Chain::new(&path, &team);
    // Parry computes no depths, but only reports that boards overlap.
    let there = distance(&team, &chain.pose(travelled), [bench_a, bench_b]);
    assert!(there <= hi.max(0.0) + ROUNDING, "{there} {enclosure:?}");
    if until.is_none_or(|until| travelled <= until) {
        assert!(lo <= there + ROUNDING, "{there} {enclosure:?}");
    }
    let end = until.unwrap_or(show_end.event.travelled);
    // Samples lie near the end too, since a lock comes suddenly.
    let moments = (0..samples).map(|k| end * f64::from(k) / f64::from(samples));
    let last = (4..12).map(|power| (end - 10f64.powi(-power)).max(0.0));
    for at in moments.chain(last) {
        let least = least_distance(&team, &chain.pose(at), hi.max(0.0) + 0.1);
        assert!(least >= lo - ROUNDING, "{least} after {at} m: {enclosure:?}");
    }
    Some(enclosure)
}

fn config(name: &str) -> String {
    std::fs::read_to_string(format!("config/{name}.toml")).unwrap()
}

#[test]
#[ignore = "computes for long: tests/run --all"]
fn a_show_that_stops_at_a_touch_has_the_least_clearance_0() {
    for name in ["paper", "school", "tight"] {
        let enclosure = compared(&config(name), 40, 10_000).unwrap();
        assert_eq!((enclosure.lo, enclosure.hi, enclosure.until), (0.0, 0.0, None), "{name}");
    }
}

#[test]
fn the_least_clearance_of_the_procession_is_enclosed_to_a_nanometre() {
    let enclosure = compared(&config("procession"), 200, 20_000).unwrap();
    assert_eq!((enclosure.until, enclosure.bench_a, enclosure.bench_b), (None, 0, 2));
}

#[test]
#[ignore = "computes for long: tests/run --all"]
fn shows_that_end_with_a_lock_are_enclosed_up_to_it() {
    // Boards that overlap without ending the show; a lock in a spiral; locks at which a nearer place takes the handle.
    for file in ["scenes/noalerts", "../config/wide", "scenes/tailoff", "scenes/stall_missed", "scenes/pieces_59"] {
        let text = std::fs::read_to_string(format!("tests/{file}.toml")).unwrap();
        let enclosure = compared(&text, 40, 20_000).unwrap();
        assert_eq!(enclosure.until, None, "{file}: {enclosure:?}");
    }
}

#[test]
#[ignore = "tests/run --all"]
fn random_shows_are_no_nearer_than_is_proved() {
    let (mut proved, mut tried) = (0, 0);
    for index in 0..24 {
        let text = scenes::random_scene(index % 3, &mut scenes::Random(11 << 32 | index as u64));
        let Some(enclosure) = compared(&text, 60, 2_000) else { continue };
        tried += 1;
        proved += usize::from(enclosure.until.is_none());
    }
    println!("{proved} of {tried} proved to the end");
    assert!(tried >= 20 && proved >= 14, "{proved} of {tried}");
}

/// Compares the least pitch of a scene's team with the brute force. The two boards overlap with `value_lo`. With
/// `value_hi`, all boards near the head are apart, sampled densely on the last turns.
fn least_pitch_compared(text: &str, radius: f64) -> LeastPitch {
    let scene = Scene::parse(text, "test", "test").unwrap();
    let plan = least_pitch(scene.ensemble.only().unwrap().team(), radius, &mut unreported).unwrap();
    println!("{plan:?}");
    let (lo, hi) = (plan.value_lo, plan.value_hi.unwrap());
    assert!(
        plan.proved && plan.from == 0.5 * scene.ensemble.only().unwrap().team().width && hi - lo <= 1e-9,
        "{plan:?}"
    );
    let Overlap { bench_a, bench_b, head_radius } = plan.overlap.unwrap();
    let longest = scene.ensemble.only().unwrap().team().longest_link();
    let least = |pitch: f64, sampled: bool| {
        let turns = radius.max(longest) / pitch + 3.0;
        let mut scene: toml::Table = text.parse().unwrap();
        let path = scene["path"].as_table_mut().unwrap();
        path.insert("pitch".into(), pitch.into());
        path.insert("start_turn".into(), turns.into());
        let benches =
            scene["team"]["benches"].as_integer().unwrap().min(if sampled { 60 } else { i64::from(bench_b) + 1 });
        scene["team"].as_table_mut().unwrap().insert("benches".into(), benches.into());
        let text = toml::to_string(&scene).unwrap();
        let (team, path) = scenes::read(&text);
        let along = bench_dragon::motion::model::path::Path::spiral(pitch, turns);
        let travelled = |radius: f64| {
            along.length() - bench_dragon::motion::model::path::Path::spiral(pitch, radius / pitch).length()
        };
        let chain = chain::Chain::new(&path, &team);
        if sampled {
            let end = travelled(radius);
            let moments = (0..=600).map(|k| end * f64::from(k) / 600.0);
            return moments.map(|at| least_distance(&team, &chain.pose(at), 0.0)).fold(f64::INFINITY, f64::min);
        }
        let (touch, end) = (travelled(head_radius), travelled(radius));
        let moments = (-400..=400).map(|k| (touch + 1e-5 * f64::from(k)).min(end));
        let pair = [bench_a as usize, bench_b as usize];
        moments.map(|at| distance(&team, &chain.pose(at), pair)).fold(f64::INFINITY, f64::min)
    };
    let (below, above, all) = (least(lo - 1e-6, false), least(hi + 1e-8, false), least(hi + 1e-8, true));
    println!("{below} {above} {all}");
    assert!(below == 0.0 && above > 0.0 && all > 0.0, "{below} {above} {all} {plan:?}");
    plan
}

#[test]
fn the_least_pitch_to_4_5_m_is_enclosed_to_a_nanometre() {
    let plan = least_pitch_compared(&config("paper"), 4.5);
    assert!(plan.value_lo <= LEAST_PITCH && LEAST_PITCH <= plan.value_hi.unwrap(), "{plan:?}");
}

#[test]
#[ignore = "tests/run --all"]
fn least_pitches_of_other_teams_and_radii_are_those_of_the_brute_force() {
    // Benches, lengths of the boards, width, inset, radius. Some boards touch a turn apart, at the radius and outside,
    // as pairs (0, k) and (1, k). Wide boards touch the next but one. One radius is below half a link.
    let teams = [
        (20, 0.52, 0.57, 0.054, 0.135, 0.18),
        (20, 0.67, 0.4, 0.15, 0.05, 0.9),
        (300, 2.2, 2.2, 1.98, 0.275, 1.65),
        (60, 1.1, 1.1, 0.5, 0.05, 1.0),
        (5000, 1.8, 1.1, 0.5, 0.05, 3.0),
        (5000, 0.25, 0.4, 0.36, 0.05, 0.09),
    ];
    for (benches, head, body, width, inset, radius) in teams {
        let text = format!(
            "[team]\nbenches = {benches}\nhead_length = {head}\nbody_length = {body}\nwidth = {width}\n\
             hole_inset = {inset}\n[path]\nkind = \"spiral\"\npitch = 1.0\nstart_turn = 12\n[motion]\nhead_speed = 1.0\n"
        );
        least_pitch_compared(&text, radius);
    }
}

#[test]
fn a_link_that_locks_with_any_less_is_proved_too() {
    // The head's link is longer than twice the radius.
    let team =
        Team { benches: 8, head_length: 0.542, body_length: 0.33, width: 0.15, hole_inset: 0.015, ends: Ends::NONE };
    let plan = least_pitch(&team, 0.18, &mut unreported).unwrap();
    println!("{plan:?}");
    let (lo, hi) = (plan.value_lo, plan.value_hi.unwrap());
    assert!(plan.proved && plan.overlap.is_none() && hi - lo <= 1e-9, "{plan:?}");
    // Possible places of the head's rear handle on the spiral: the first peak of the distance from the radius.
    let peak = |pitch: f64| {
        let (a, link) = (pitch / std::f64::consts::TAU, 0.512);
        let theta = 0.18 / a;
        let distance = |delta: f64| {
            let (one, other) = (a * theta, a * (theta + delta));
            (one * one + other * other - 2.0 * one * other * delta.cos()).sqrt()
        };
        (0..=470_000).map(|k| distance(1e-5 * f64::from(k))).fold(0.0, f64::max) - link
    };
    assert!(peak(lo - 1e-6) < 0.0 && peak(hi + 1e-6) > 0.0, "{} {}", peak(lo - 1e-6), peak(hi + 1e-6));
}
