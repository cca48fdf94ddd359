//! The proved enclosure of a show's least clearance against poses of the brute force that `tests/judge` has, with distances
//! by parry2d.

#[path = "judge/chain.rs"]
#[allow(dead_code, reason = "only poses are used")]
mod chain;
#[path = "judge/geometry.rs"]
#[allow(dead_code, reason = "only poses are used")]
mod geometry;
#[path = "judge/links.rs"]
#[allow(dead_code, reason = "only poses are used")]
mod links;
#[path = "judge/scenes.rs"]
#[allow(dead_code, reason = "some families are enough")]
mod scenes;

use bench_dragon::certify::{ClearanceEnclosure, enclose_least_clearance};
use bench_dragon::plan::{PitchEnclosure, enclose_least_pitch, least_pitch};
use bench_dragon::scene::Scene;
use parry2d_f64::math::Pose as At;
use parry2d_f64::query;
use parry2d_f64::shape::Cuboid;

/// The least pitch of the paper's team to 4.5 m, from computations with 50 digits.
const LEAST_PITCH: f64 = 0.450_337_393_027_195_5;

/// Metres by which the brute force may be off.
const ROUNDING: f64 = 1e-10;

/// The distance of two boards by parry, 0 where they overlap.
fn distance(team: &chain::Team, pose: &chain::Pose, [a, b]: [usize; 2]) -> f64 {
    let placed = |bench: usize| {
        let [front, rear] = [bench, bench + 1].map(|handle| pose.handles[handle].point);
        let (middle, along) = (0.5 * (front + rear), front - rear);
        let shape = Cuboid::new([0.5 * team.link(bench) + team.hole_inset, 0.5 * team.width].into());
        (At::new([middle.x, middle.y].into(), along.y.atan2(along.x)), shape)
    };
    let ((at_a, shape_a), (at_b, shape_b)) = (placed(a), placed(b));
    query::distance(&at_a, &shape_a, &at_b, &shape_b).unwrap().distance
}

/// The least distance of any two boards that share no handle; those further apart than `limit` by their middles are not
/// looked at.
fn least_distance(team: &chain::Team, pose: &chain::Pose, limit: f64) -> f64 {
    let middle = |bench: usize| 0.5 * (pose.handles[bench].point + pose.handles[bench + 1].point);
    let reach = |bench: usize| (0.5 * team.link(bench) + team.hole_inset).hypot(0.5 * team.width);
    let pairs = (0..team.benches).flat_map(|a| (a + 2..team.benches).map(move |b| [a, b]));
    let near = pairs.filter(|[a, b]| (middle(*a) - middle(*b)).norm() < reach(*a) + reach(*b) + limit);
    near.map(|pair| distance(team, pose, pair)).fold(f64::INFINITY, f64::min)
}

/// The enclosure of a scene's show, held against `samples` moments of it. `None` where there is none to be had.
fn compared(text: &str, samples: u32, most_steps: u64) -> Option<ClearanceEnclosure> {
    let scene = Scene::parse(text, "test", "test").ok()?;
    let timeline = scene.motion.timeline(&mut |_| ());
    let freeze = timeline.freeze(scene.stops_at_contact());
    let hint = scene.motion.least_clearance(&timeline, freeze, &mut |_| ())?.least;
    let enclosure = enclose_least_clearance(&scene.motion, freeze, &hint, most_steps, &mut |_| ())?;
    let ClearanceEnclosure { lo, hi, travelled, bench_a, bench_b, until, .. } = enclosure;
    println!("{:?} {enclosure:?}", freeze.event.kind);
    assert!(lo <= hi && hi - lo <= 1e-9, "{enclosure:?}");
    let (team, path) = scenes::read(text);
    let chain = chain::Chain::new(&path, &team);
    // Parry has no depths: of boards that overlap it is only certain that they do.
    let there = distance(&team, &chain.pose(travelled), [bench_a, bench_b]);
    assert!(there <= hi.max(0.0) + ROUNDING, "{there} {enclosure:?}");
    if until.is_none_or(|until| travelled <= until) {
        assert!(lo <= there + ROUNDING, "{there} {enclosure:?}");
    }
    let end = until.unwrap_or(freeze.event.travelled);
    // Near the end too, where a lock comes suddenly.
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
fn shows_that_end_with_a_lock_are_enclosed_up_to_it() {
    // Boards that overlap and do not freeze the show; a lock in a spiral; locks where a nearer place takes the handle.
    for file in ["scenes/noalerts", "../config/wide", "scenes/tailoff", "scenes/stall_missed", "scenes/pieces_59"] {
        let text = std::fs::read_to_string(format!("tests/{file}.toml")).unwrap();
        let enclosure = compared(&text, 40, 20_000).unwrap();
        assert_eq!(enclosure.until, None, "{file}: {enclosure:?}");
    }
}

#[test]
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

#[test]
fn the_least_pitch_to_4_5_m_is_enclosed_to_a_nanometre() {
    let scene = Scene::parse(&config("paper"), "test", "test").unwrap();
    let found = least_pitch(scene.team(), 4.5, &mut |_| ()).unwrap();
    let enclosure = enclose_least_pitch(scene.team(), 4.5, &found, &mut |_| ());
    println!("{enclosure:?}");
    let PitchEnclosure { lo, hi, from, .. } = enclosure;
    let (lo, hi) = lo.zip(hi).unwrap();
    assert!(from == 0.15 && lo <= LEAST_PITCH && LEAST_PITCH <= hi && hi - lo <= 1e-9, "{enclosure:?}");
    // The brute force, where the two boards touch: apart with the upper pitch, overlapping with the lower one.
    let least = |pitch: f64| {
        let text = config("paper").replace("pitch = 0.55", &format!("pitch = {pitch}")).replace("= 223", "= 21");
        let (team, path) = scenes::read(&text);
        let scene = Scene::parse(&text, "test", "test").unwrap();
        let along = scene.motion.path();
        let chain = chain::Chain::new(&path, &team);
        let radius = |at: f64| along.point(along.param_at(at)).coords.norm();
        let (mut outside, mut inside) = (0.0, along.length());
        for _ in 0..80 {
            let middle = 0.5 * (outside + inside);
            if radius(middle) > found.head_radius { outside = middle } else { inside = middle }
        }
        let moments = (-400..=400).map(|k| outside + 1e-5 * f64::from(k));
        let gaps = moments.map(|at| distance(&team, &chain.pose(at), [found.bench_a as usize, found.bench_b as usize]));
        gaps.fold(f64::INFINITY, f64::min)
    };
    assert!(least(hi + 1e-8) > 0.0 && least(lo - 1e-8) == 0.0);
}
