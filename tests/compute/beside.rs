//! The proved enclosures of the least clearance of obstacles. They are compared with the brute force of
//! `tests/compute/oracle`, with distances by parry2d, and with the ordinary search. The checker accepts the
//! certificates, and refuses changed certificates.
//!
//! `BENCH_DRAGON_ALL=1` makes 120 scenes in place of 8, `BENCH_DRAGON_LONG=1` 3,000.

use bench_dragon::certify::{
    CertificateLine, ClearanceEnclosures, ClearanceHints, ObstacleEnclosure, certify_clearances,
};
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::ground::Obstacle;
use bench_dragon::motion::model::shape::ShapeKind;
use bench_dragon::motion::timeline::TimedObstacleClearance;
use bench_dragon::proof::{Proved, Refused, Until, verify};
use bench_dragon::show::scene::Scene;
use fastrand::Rng;
use parry2d_f64::math::Pose as At;
use parry2d_f64::query;
use parry2d_f64::shape::{Ball, Cuboid, Segment};

use crate::harness;
use crate::oracle::{chain, scenes};
use crate::staged::random_scene;

const MOST_STEPS: u64 = 4000;

/// Greatest error of the brute force, metres.
const ROUNDING: f64 = 1e-10;

/// The enclosures of a scene, the results of the ordinary search, and the certificate.
struct Enclosed {
    scene: Scene,
    found: Vec<TimedObstacleClearance>,
    enclosures: ClearanceEnclosures,
    end: f64,
    lines: String,
}

fn enclosed(text: &str) -> Enclosed {
    let scene = Scene::parse(text, "beside", "beside").unwrap_or_else(|error| panic!("{error}\n{text}"));
    let timeline = scene.ensemble.timeline(&mut unreported);
    let show_end = *timeline.show_end(scene.stops_at_contact());
    let boards = scene.ensemble.least_clearances(&timeline, &show_end, &mut unreported).own.map(|found| found.least);
    let found = scene.ensemble.obstacle_clearances(&show_end, &mut unreported);
    let hints = ClearanceHints { boards: boards.as_ref(), obstacles: &found };
    let mut lines = Vec::new();
    let mut write = |line: &CertificateLine| line.write(&mut lines);
    let enclosures =
        certify_clearances(&scene.ensemble, &show_end, hints, text, MOST_STEPS, &mut write, &mut unreported)
            .unwrap()
            .own
            .remove(0);
    let lines = String::from_utf8(lines).unwrap();
    Enclosed { found, enclosures, end: show_end.event.travelled, lines, scene }
}

fn check(lines: &str) -> Result<Proved, Refused> {
    verify(lines.as_bytes(), &mut |_| ())
}

/// Returns the clearance of a bench from an obstacle by parry; where they overlap, minus the keep-out.
fn clearance(scene: &Scene, team: &chain::Team, pose: &chain::Pose, bench: usize, obstacle: &Obstacle) -> f64 {
    let placement = scene.ensemble.only().unwrap().placement();
    let turn = std::f64::consts::TAU * placement.rotation_turns();
    let placed = |handle: usize| {
        let point = pose.handles[handle].point;
        let y = if placement.is_mirrored() { -point.y } else { point.y };
        let (sine, cosine) = turn.sin_cos();
        let origin = placement.origin();
        [origin.x + cosine * point.x - sine * y, origin.y + sine * point.x + cosine * y]
    };
    let (front, rear) = (placed(bench), placed(bench + 1));
    let middle = [0.5 * (front[0] + rear[0]), 0.5 * (front[1] + rear[1])];
    let at = At::new(middle.into(), (front[1] - rear[1]).atan2(front[0] - rear[0]));
    let board = Cuboid::new([0.5 * team.link(bench) + team.hole_inset, 0.5 * team.width(bench)].into());
    let shape = &obstacle.shape;
    let distance = if shape.kind() == ShapeKind::Circle {
        let centre = shape.points()[0];
        let ball = Ball::new(shape.radius());
        query::distance(&at, &board, &At::new([centre.x, centre.y].into(), 0.0), &ball).unwrap().distance
    } else {
        let of_side = |(from, to): (bench_dragon::motion::model::Point, bench_dragon::motion::model::Point)| {
            let side = Segment::new([from.x, from.y].into(), [to.x, to.y].into());
            query::distance(&at, &board, &At::new([0.0, 0.0].into(), 0.0), &side).unwrap().distance
        };
        shape.sides().map(of_side).fold(f64::INFINITY, f64::min)
    };
    distance - obstacle.keep_out
}

/// Compares the enclosures of a scene with a brute force at `samples` places, and has the certificate checked. Returns
/// the number of obstacles that can be decided, and the number of obstacles enclosed over the whole show.
fn compared(text: &str, samples: u32) -> (usize, usize) {
    let Enclosed { scene, found, enclosures, end, lines } = enclosed(text);
    let proved = check(&lines).unwrap_or_else(|refused| panic!("{refused}\n{text}"));
    let obstacles = scene.ensemble.ground().obstacles();
    assert_eq!(proved.obstacle_clearances.len(), obstacles.len());
    // The placement has the start of a route.
    let without_start = text.lines().filter(|line| !line.starts_with("start = [")).collect::<Vec<_>>().join("\n");
    let (team, path) = scenes::read(&without_start);
    let chain = chain::Chain::new(&path, &team);
    let poses: Vec<(f64, chain::Pose)> = (0..=samples)
        .map(|k| end * f64::from(k) / f64::from(samples) * (1.0 - 1e-12))
        .map(|travelled| (travelled, chain.pose(travelled)))
        .collect();
    let (mut whole, mut decidable) = (0, 0);
    for (number, obstacle) in obstacles.iter().enumerate() {
        let claim = &proved.obstacle_clearances[number];
        let ordinary = found.iter().find(|found| found.obstacle == number).map_or(f64::NAN, |found| found.least.value);
        let is_decidable = obstacle.shape.kind() == ShapeKind::Circle || ordinary > -obstacle.keep_out;
        decidable += usize::from(is_decidable);
        let Some(ObstacleEnclosure { lo, hi, travelled, bench, until, .. }) = enclosures.obstacles[number] else {
            assert_eq!((claim.lo, claim.hi), (None, None), "{claim:?}\n{text}");
            if is_decidable {
                println!("nothing of {}: {ordinary}\n{text}", obstacle.name);
            }
            continue;
        };
        whole += usize::from(until.is_none());
        // If the proof stops before the end, a place beyond may be nearer.
        assert!(hi - lo <= 1e-9 && (lo <= hi || until.is_some()), "{lo} {hi}\n{text}");
        if let Some(until) = until {
            println!("{} up to {until} of {end} m: {lo} {hi} at {travelled}, {ordinary}\n{text}", obstacle.name);
        }
        // A place beyond the last step that is shown proves nothing.
        assert!(claim.hi.is_some() || until.is_some(), "{claim:?}\n{text}");
        let is_claimed = claim.hi.is_none_or(|claimed| (claimed - hi).abs() < 1e-10);
        assert!(claim.lo == Some(lo) && is_claimed, "{claim:?} {lo} {hi}\n{text}");
        let there = clearance(&scene, &team, &chain.pose(travelled), bench, obstacle);
        assert!(there <= hi.max(-obstacle.keep_out) + ROUNDING, "{there} {hi}\n{text}");
        for (at, pose) in poses.iter().filter(|(at, _)| until.is_none_or(|until| *at <= until)) {
            let least = (0..team.benches).map(|bench| clearance(&scene, &team, pose, bench, obstacle));
            let least = least.fold(f64::INFINITY, f64::min);
            assert!(least >= lo - ROUNDING, "{}: {least} after {at} m, {lo}\n{text}", obstacle.name);
        }
        if until.is_none() {
            assert!(lo - 1e-11 <= ordinary && ordinary <= hi + 1e-11, "{lo} {ordinary} {hi}\n{text}");
        }
    }
    (decidable, whole)
}

#[test]
fn the_least_clearances_of_the_square_are_enclosed_to_a_nanometre() {
    let text = std::fs::read_to_string("tests/compute/ground.toml").unwrap();
    assert_eq!(compared(&text, 400), (5, 5));
    // Shows that end at an obstacle, also at one that is no further than its outline.
    let blocked = text.replace("center = [4.0, 3.5]", "center = [4.0, 2.9]");
    assert_eq!(compared(&blocked, 400), (5, 5));
    let grazed = blocked.replace("keep_out = 0.5", "keep_out = 0.0");
    assert_eq!(compared(&grazed, 400), (5, 5));
    let house =
        text.replace("[2.0, 8.0], [6.0, 8.0]", "[2.0, 1.0], [6.0, 1.0]").replace("keep_out = 1.0", "keep_out = 0.0");
    assert_ne!(house, text);
    println!("{:?}", compared(&house, 400));
    // A row of spectators beside a straight way, at a distance that stays the same.
    let beside = text.replace("[[-26.0, -17.0], [16.0, -17.0], [20.0, -14.0]]", "[[-20.0, -16.0], [20.0, -16.0]]");
    assert_ne!(beside, text);
    assert_eq!(compared(&beside, 400), (5, 5));
}

#[test]
fn the_least_clearances_of_random_scenes_are_enclosed() {
    let count = harness::cases(8, 120, 3000);
    let (mut obstacles, mut whole) = (0, 0);
    for index in 0..count {
        let (of_scene, enclosed) = compared(&random_scene(&mut Rng::with_seed(0xbe51de + index)), 60);
        (obstacles, whole) = (obstacles + of_scene, whole + enclosed);
    }
    println!("{whole} of {obstacles} obstacles");
    assert!(whole * 20 >= obstacles * 19, "{whole} of {obstacles}");
}

/// A certificate is refused without any one of its lines, of another scene, and with a stronger claim.
#[test]
#[ignore = "tests/run --all"]
fn changed_certificates_of_clearances_are_refused() {
    let text = "[team]\nbenches = 4\nhead_length = 2.2\nbody_length = 1.6\nwidth = 0.3\nhole_inset = 0.2\n\
                [motion]\nhead_speed = 1.0\n[path]\nkind = \"pieces\"\npieces = [{ kind = \"line\", length = 4.0 }, \
                { kind = \"arc\", radius = 4.0, side = \"left\", turns = 0.3 }]\n[stage]\n\
                boundary = { polygon = [[-12, -4], [9, -4], [9, 9], [-12, 9]] }\n[[stage.obstacles]]\n\
                name = \"lamp\"\ncircle = { center = [6.0, 2.5], radius = 0.25 }\nkeep_out = 0.5\n\
                [[stage.obstacles]]\nname = \"house\"\npolygon = [[0.0, 1.25], [3.0, 1.25], [1.0, 2.0], [0.0, 4.0]]\n";
    let Enclosed { enclosures, lines, .. } = enclosed(text);
    assert!(enclosures.obstacles.iter().all(|of| of.is_some_and(|of| of.until.is_none())), "{enclosures:?}");
    let proved = check(&lines).unwrap();
    assert!(proved.obstacle_clearances.iter().all(|claim| claim.until == Until::PathEnd));
    let changes = [
        ("radius = 0.25", "radius = 0.2500001"),
        ("center = [6.0, 2.5]", "center = [5.9999, 2.5]"),
        ("[3.0, 1.25]", "[3.0000001, 1.2499999]"),
        ("[9, 9], [-12, 9]", "[7, 9], [-12, 9]"),
        ("keep_out = 0.5", "keep_out = 0.5000001"),
        ("[stage]", "[placement]\\norigin = [1e-6, 1e-6]\\n[stage]"),
        ("\"witness\",\"obstacle\":0", "\"witness\",\"obstacle\":1"),
        ("\"of\":\"obstacle_clearance\",\"obstacle\":0", "\"of\":\"obstacle_clearance\",\"obstacle\":1"),
    ];
    for (from, to) in changes {
        let changed = lines.replacen(from, to, 1);
        assert_ne!(changed, lines, "{from}");
        assert!(check(&changed).is_err(), "{from} -> {to}");
    }
    let all: Vec<&str> = lines.lines().collect();
    for left_out in (0..all.len()).rev().step_by(1 + all.len() / 40) {
        let rest = [&all[..left_out], &all[left_out + 1..]].concat();
        assert!(check(&rest.join("\n")).is_err(), "without line {}: {}", left_out + 1, all[left_out]);
    }
    for line in all.iter().rev().take(3) {
        for (field, more) in [("lo", 1e-6), ("hi", -1e-6)] {
            let mut changed: serde_json::Value = serde_json::from_str(line).unwrap();
            changed[field] = (changed[field].as_f64().unwrap() + more).into();
            let changed = lines.replacen(line, &changed.to_string(), 1);
            assert!(check(&changed).is_err(), "{field} of {line}");
        }
    }
}

/// Boards that overlap a wall by 20 mm all the way. A claim of a little more overlap follows from Lemma 11 with m < 0,
/// a claim of less is false. No translation of 0.3 m frees boards between two walls, or boards within a polygon.
#[test]
fn claims_of_overlaps_are_checked() {
    let scene = "[team]\nbenches = 3\nhead_length = 2.2\nbody_length = 1.6\nwidth = 0.3\nhole_inset = 0.2\n\
                 [motion]\nhead_speed = 1.0\n[path]\nkind = \"pieces\"\npieces = [{ kind = \"line\", length = 4.0 }]\n";
    let lines = enclosed(scene).lines;
    let claimed = |stage: &str, metres: f64| {
        let mut changed = String::new();
        for line in lines.lines() {
            let mut line: serde_json::Value = serde_json::from_str(line).unwrap();
            match line["type"].as_str().unwrap() {
                "certificate" => line["scene"] = format!("{scene}[stage]\n{stage}\n").into(),
                "step" => line["beside"] = vec![metres].into(),
                _ => (),
            }
            changed += &format!("{line}\n");
        }
        changed += &format!(
            "{{\"type\":\"result\",\"of\":\"obstacle_clearance\",\"obstacle\":0,\"lo\":{metres:?},\"hi\":null,\
             \"until\":\"path_end\",\"time_until\":null,\"bench\":null}}\n"
        );
        check(&changed).map(|proved| proved.obstacle_clearances[0].lo)
    };
    let is_refused = |stage: &str, metres: f64| {
        let said = claimed(stage, metres).map_err(|refused| refused.to_string());
        assert!(said.as_ref().is_err_and(|said| said.contains("Lemma 11")), "{stage} {metres}: {said:?}");
    };
    // Half of the width is 0.15 m.
    let wall = |y: f64, far: f64| {
        format!(
            "[[stage.obstacles]]\nname = \"wall\"\npolygon = [[-50.0, {y}], [50.0, {y}], [50.0, {far}], [-50.0, {far}]]"
        )
    };
    let fence = "[[stage.obstacles]]\nname = \"fence\"\nline = [[-50.0, 0.13], [50.0, 0.13]]";
    for stage in [wall(0.13, 9.0), wall(-0.13, -9.0), fence.to_owned()] {
        for (metres, more) in [(-0.0201, -0.0199), (-0.1, 0.0)] {
            assert_eq!(claimed(&stage, metres).unwrap(), Some(metres), "{stage}");
            is_refused(&stage, more);
        }
    }
    let boundary = |half: f64| {
        format!("boundary = {{ polygon = [[-50.0, -{half}], [50.0, -{half}], [50.0, {half}], [-50.0, {half}]] }}")
    };
    // With walls 2.8 m apart the boundary frees boards, with walls 0.26 m apart it does not.
    assert_eq!(claimed(&boundary(1.4), -0.1).unwrap(), Some(-0.1));
    for metres in [-0.0201, -0.1, -0.14, -0.27, -0.29] {
        is_refused(&boundary(0.13), metres);
        is_refused(&wall(-1.4, 1.4), metres);
    }
}

/// A polygon without a keep-out ends this show: boards touch it, and the lower bound of the clearance is below 0.
#[test]
fn a_show_that_ends_at_a_wall_is_enclosed_about_zero() {
    let text = "[team]\nbenches = 3\nhead_length = 2.2\nbody_length = 1.6\nwidth = 0.3\nhole_inset = 0.2\n\
                [motion]\nhead_speed = 1.0\non_contact = \"stop\"\n[path]\nkind = \"pieces\"\n\
                pieces = [{ kind = \"line\", length = 2.0 }, \
                { kind = \"arc\", radius = 4.0, side = \"left\", turns = 0.3 }]\n[alerts]\n[[stage.obstacles]]\n\
                name = \"house\"\npolygon = [[5.0, -3.0], [9.0, -3.0], [9.0, 9.0], [5.0, 9.0], [6.0, 4.0]]\n";
    let Enclosed { enclosures, lines, .. } = enclosed(text);
    let ObstacleEnclosure { lo, hi, until, .. } = enclosures.obstacles[0].unwrap();
    assert!(lo < 0.0 && lo > -1e-9 && hi - lo <= 1e-9 && until.is_none(), "{lo} {hi} {until:?}");
    let claim = &check(&lines).unwrap().obstacle_clearances[0];
    assert_eq!(claim.lo, Some(lo), "{claim:?}");
    // Enclosed over the whole show, and true by the brute force.
    assert_eq!(compared(text, 400).1, 1);
}
