//! The reference against tables of 50 digits, against itself, and against the safe solver in doubles.

#[path = "../../../../../tests/truth/tables.rs"]
mod tables;

use proptest::prelude::*;
use tables::{Row, table};

use super::curve::Curve;
use super::real::{Functions, RealVector};
use super::*;
use crate::event::{Budget, unreported};
use crate::model::Point;
use crate::model::curve::Side;
use crate::model::description::RouteStep;
use crate::model::path::tests::any_spiral;
use crate::model::path::{Param, Path};
use crate::model::spiral::Direction;
use crate::model::team::Ends;
use crate::singularities::Singularities;
use crate::solve::newton::Newton;
use crate::solve::{Chain, Velocities};

const PAPER: PathDescription = PathDescription::Spiral { pitch: 0.55, start_turn: 16.0 };
const TURNAROUND: PathDescription =
    PathDescription::Turnaround { pitch: 1.7, turn_radius: 4.5, arc_ratio: 2.0, lead_in: 100.0, lead_out: 369.16 };

fn team(benches: usize) -> Team {
    Team { benches, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275, ends: Ends::NONE }
}

/// The path of config/procession.toml.
fn procession() -> PathDescription {
    let line = |length| RouteStep::Line { length };
    let arc = |side, radius: f64, turns: f64| RouteStep::Arc { side, radius: radius.into(), turns: turns.into() };
    let steps = vec![
        line(40.0),
        arc(Side::Left, 6.0, 0.25),
        line(12.0),
        arc(Side::Right, 5.0, 0.5),
        line(10.0),
        arc(Side::Left, 5.0, 0.5),
        line(120.0),
    ];
    PathDescription::Route { heading_turns: 0.0, steps }
}

fn length(vector: &RealVector) -> Real {
    vector.dot(vector).sqrt()
}

/// Returns the largest errors at each time of a table whose clock begins `before` seconds after the motion. The error
/// of a position is divided by the handle's speed if the speed is above 1. The error of a speed is relative.
fn errors(reference: &mut Reference, rows: &[Row], before: f64) -> Vec<(f64, f64, f64)> {
    let frames = rows.chunk_by(|a, b| a.time == b.time);
    let errors = frames.map(|rows| {
        let handles = reference.handles(rows[0].time + before).unwrap();
        rows.iter().fold((rows[0].time, 0f64, 0f64), |(time, position, speed), row| {
            let handle = &handles[row.handle];
            let error = handle.x.error_of(row.x).hypot(handle.y.error_of(row.y)) / row.speed.abs().max(1.0);
            (time, position.max(error), speed.max((handle.speed / row.speed - 1.0).abs()))
        })
    });
    errors.collect()
}

#[test]
fn it_agrees_with_50_digits_on_the_papers_scene() {
    let rows = table(include_str!("../../../../../tests/truth/paper_scene_exact.csv"));
    let mut reference = Reference::new(team(223), &PAPER, 1.0).unwrap();
    let errors = errors(&mut reference, &rows, 0.0);
    assert_eq!(errors.len(), 11);
    for (time, position, speed) in errors {
        println!("t = {time} s: {position:e} m, {speed:e}");
        // The table was made from decimal lengths and times. The doubles nearest to them move a handle by this, in
        // proportion to its speed.
        assert!(
            position < 6e-14 && speed < if time < 430.0 { 1e-14 } else { 1e-11 },
            "{time} s: {position:e} {speed:e}"
        );
    }
}

#[test]
fn it_agrees_with_50_digits_on_the_turnaround() {
    let rows = table(include_str!("../../../../../tests/truth/turnaround_table.csv"));
    let mut reference = Reference::new(team(223), &TURNAROUND, 1.0).unwrap();
    let errors = errors(&mut reference, &rows, 100.0);
    assert_eq!(errors.len(), 6);
    for (time, position, speed) in errors {
        println!("t = {time} s: {position:e} m, {speed:e}");
        assert!(position < 1e-13 && speed < 1e-13, "{time} s: {position:e} m, {speed:e}");
    }
}

/// The route of tests/truth/spiral_route.py: spirals inward and outward, to the left and to the right.
fn spiral_route() -> PathDescription {
    use Direction::{Inward, Outward};
    use Side::{Left, Right};
    let spiral = |side, direction, pitch, radius: f64, turns: f64| {
        let turns = turns.into();
        RouteStep::Spiral { side, direction, pitch, radius: radius.into(), turns }
    };
    let steps = vec![
        RouteStep::Line { length: 15.0 },
        spiral(Left, Inward, 1.7, 12.0, 4.0),
        RouteStep::Arc { side: Right, radius: 2.6.into(), turns: 0.45.into() },
        spiral(Left, Outward, 1.3, 5.0, 1.5),
        spiral(Right, Inward, 0.9, 4.5, 2.0),
        RouteStep::Line { length: 6.0 },
        spiral(Right, Outward, 2.1, 3.0, 1.25),
        RouteStep::Line { length: 20.0 },
    ];
    PathDescription::Route { heading_turns: 0.0, steps }
}

#[test]
fn it_agrees_with_50_digits_on_a_route_of_spirals() {
    let rows = table(include_str!("../../../../../tests/truth/spiral_route.csv"));
    let mut reference = Reference::new(team(25), &spiral_route(), 1.0).unwrap();
    let errors = errors(&mut reference, &rows, 0.0);
    assert_eq!(errors.len(), 10);
    for (time, position, speed) in errors {
        println!("t = {time} s: {position:e} m, {speed:e}");
        assert!(position < 1e-14 && speed < 1e-14, "{time} s: {position:e} m, {speed:e}");
    }
}

/// Thousands of roundings do not add up: the last points of a long route keep the promise.
#[test]
fn a_route_of_4096_pieces_keeps_its_digits() {
    // Lengths and turns of 52 bits from a linear congruence.
    let mut state = 1u64;
    let mut share = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let sides = [Side::Left, Side::Right];
    let mut step = |k: usize| match k % 8 {
        0 => RouteStep::Line { length: 1.0 + 9.0 * share() },
        7 => {
            let (pitch, radius) = (0.5 + share(), 4.0 + 3.0 * share());
            let direction = if k % 16 == 7 { Direction::Inward } else { Direction::Outward };
            RouteStep::Spiral {
                side: sides[k / 16 % 2],
                direction,
                pitch,
                radius: radius.into(),
                turns: (0.1 + 0.2 * share()).into(),
            }
        }
        _ => RouteStep::Arc {
            side: sides[k % 2],
            radius: (3.0 + 5.0 * share()).into(),
            turns: (0.05 + 0.2 * share()).into(),
        },
    };
    let steps = (0..4096).map(&mut step).collect();
    let description = PathDescription::Route { heading_turns: 0.3, steps };
    let path = description.path().unwrap();
    let mut exact = path::RealPath::new(&description).unwrap();
    let mut worst = 0f64;
    for share in 1..=64 {
        let travelled = path.length() * f64::from(share) / 64.0;
        let point = path.point(path.param_at(travelled));
        let truth = exact.place_at(&Real::from(travelled)).1.point;
        let error = truth.x.split().error_of(point.x).hypot(truth.y.split().error_of(point.y));
        worst = worst.max(error / (8.0 * f64::EPSILON * (point.coords.norm() + travelled)));
    }
    println!("{} m, {worst} of the promise", path.length());
    assert!(path.length() > 15_000.0 && worst < 1.0, "{worst} of the promise");
}

/// Returns a decimal without rounding to a double: at most 20 significant digits.
fn decimal(text: &str) -> Real {
    let (mantissa, exponent) = text.split_once('e').unwrap_or((text, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len() as i32);
    let digits: i128 = mantissa.replace('.', "").parse().unwrap();
    let half = |digits: i128| Real::from(digits as f64);
    let whole = half(digits / 10_000_000_000) * Real::from(1e10) + half(digits % 10_000_000_000);
    // Powers up to 22 are doubles; smaller numbers count as zero here.
    whole * Real::from(10f64.powi(exponent.parse().unwrap())) / Real::from(10f64.powi(decimals))
}

/// In centimetres, every number of both scenes is a double: the digits of the tables can be compared.
const CENTIMETRES: Team =
    Team { benches: 223, head_length: 341.0, body_length: 220.0, width: 30.0, hole_inset: 27.5, ends: Ends::NONE };

/// Returns the largest error of a reference in centimetres at whole seconds of a table, metres, and the number of rows.
/// The table has x in a column; its clock begins `before` seconds after the motion.
fn error_in_centimetres(description: &PathDescription, text: &str, column: usize, before: f64) -> (f64, usize) {
    let mut reference = Reference::new(CENTIMETRES, description, 100.0).unwrap();
    let (mut now, mut seats, mut worst, mut rows) = (f64::NAN, Vec::new(), 0f64, 0);
    for fields in text.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>()) {
        let time: f64 = fields[0].parse().unwrap();
        if time.fract() != 0.0 {
            continue;
        }
        if time != now {
            (now, seats) = (time, reference.seats(time + before).unwrap());
        }
        let point = &seats[fields[1].parse::<usize>().unwrap()].place.point;
        let hundred = Real::from(100.0);
        let x = &point.x / &hundred - decimal(fields[column]);
        let y = &point.y / &hundred - decimal(fields[column + 1]);
        worst = worst.max(length(&RealVector { x, y }).rounded());
        rows += 1;
    }
    (worst, rows)
}

#[test]
fn in_centimetres_it_agrees_with_all_digits_that_are_printed() {
    let paper = PathDescription::Spiral { pitch: 55.0, start_turn: 16.0 };
    let text = include_str!("../../../../../tests/truth/paper_scene_exact.csv");
    let (error, rows) = error_in_centimetres(&paper, text, 3, 0.0);
    assert!(rows == 9 * 224 && error < 1e-18, "{rows} rows: {error:e} m");

    let turnaround = PathDescription::Turnaround {
        pitch: 170.0,
        turn_radius: 450.0,
        arc_ratio: 2.0,
        lead_in: 10_000.0,
        lead_out: 36_916.0,
    };
    let text = include_str!("../../../../../tests/truth/turnaround_table.csv");
    let (error, rows) = error_in_centimetres(&turnaround, text, 2, 100.0);
    assert!(rows == 48 && error < 1e-16, "{rows} rows: {error:e} m");

    // The length of the S and the first radius, from DESIGN.md.
    let path = RealPath::new(&turnaround).unwrap();
    let turn = &path.segment(3).begin - &path.segment(1).begin - decimal("1362.12449068211225");
    assert!(turn.rounded().abs() < 6e-15, "{:e}", turn.rounded());
    let Curve::Arc { radius, .. } = &path.segment(1).curve else { panic!("not an arc") };
    let radius = (radius - decimal("300.541766778903528")).rounded();
    assert!(radius.abs() < 6e-16, "{radius:e}");
}

#[test]
fn from_the_lock_on_there_is_no_follower() {
    let mut reference = Reference::new(team(1), &PAPER, 1.0).unwrap();
    // The lock is at 432.917924228383 s.
    assert!(reference.handles(432.917924228382).is_ok());
    for time in [432.917924228384, 432.917925, 432.92] {
        assert_eq!(reference.handles(time), Err(NoFollower), "{time} s");
    }
    // Very near the centre there is a follower again.
    for k in 0..=96 {
        assert_newton_agrees(team(1), &PAPER, 433.0 + 0.1 * f64::from(k));
    }
}

#[test]
fn segments_join() {
    for description in [TURNAROUND, procession()] {
        let path = RealPath::new(&description).unwrap();
        for index in 1..path.segments() {
            let (before, after) = (path.segment(index - 1), path.segment(index));
            let gap = length(&(&before.last.point - &after.first.point)).rounded();
            let tangent = |curve: &Curve, place: &RealParam| {
                place.slope.scaled(&(Real::from(curve.forward()) / curve.rate(&place.at)))
            };
            let corner = &tangent(&before.curve, &before.last) - &tangent(&after.curve, &after.first);
            assert!(gap < 1e-35 && length(&corner).rounded() < 1e-36, "{index}: {gap:e}");
            assert_eq!(before.end, after.begin);
        }
    }
    // The S leads to the opposite point.
    let path = RealPath::new(&TURNAROUND).unwrap();
    let (a, b) = (&path.segment(0).last.point, &path.segment(3).first.point);
    assert!(length(&(a + b)).rounded() < 1e-35);
}

#[test]
fn a_vector_turned_slightly_is_that_of_sine_and_cosine() {
    let mut functions = Functions::new().unwrap();
    for (angle, by) in [(87.3, 9e-9), (1e7, -3e-9), (0.0, 1e-17)] {
        let (angle, by) = (Real::from(angle), Real::from(by));
        let turned = functions.unit_vector(&angle).turned_slightly(&by);
        let error = &turned - &functions.unit_vector(&(angle + by));
        // The sum of the two angles is itself rounded.
        assert!(length(&error).rounded() < 4e-32);
    }
}

/// Returns the path with the branches of the followers, and the head's place at the end of the motion.
fn followed(team: &Team, path: &Path) -> (Path, f64) {
    let mut unreported = unreported;
    let singular = Singularities::search(path, team, &mut Budget::new(20_000_000, &mut unreported));
    let end = singular.end.map_or(f64::INFINITY, |end| end.travelled);
    (path.clone().with_branches(singular.branches), end)
}

/// Checks the properties of every chain on any path without nearer places. Each handle is on its segment, and each link
/// has its length and keeps it. No place between a handle and its follower is further away.
fn assert_sound(team: Team, description: &PathDescription, time: f64) -> Vec<Seat> {
    let mut reference = Reference::new(team, description, 1.0).unwrap();
    let path = description.path().unwrap();
    let seats = reference.seats(time).unwrap_or_else(|_| panic!("{time} s: {description:?}"));
    let param = |seat: &Seat| Param { segment: seat.segment, at: seat.place.at.split() };
    // By the tangents of the path in doubles: the slopes of the reference are not taken for granted.
    let velocity = |seat: &Seat| path.tangent(param(seat)) * reference.handle(seat).speed;
    assert!((reference.handle(&seats[0]).speed - 1.0).abs() < 1e-15);
    for (bench, pair) in seats.windows(2).enumerate() {
        let link = Real::from(team.link(bench));
        let error = (length(&(&pair[0].place.point - &pair[1].place.point)) - &link).rounded() / link.rounded();
        assert!(error.abs() < 1e-34, "{time} s, link {bench}: {error:e}");
        let [front, rear] = [0, 1].map(|end| Point::from(pair[end].place.point.rounded()));
        let velocities = [0, 1].map(|end| velocity(&pair[end]));
        let lengthening = (front - rear).dot(&(velocities[0] - velocities[1])) / team.link(bench);
        let error = lengthening / velocities[0].norm().max(velocities[1].norm());
        assert!(error.abs() < 1e-13, "{time} s, link {bench} lengthens by {lengthening:e} m/s: {error:e}");
        let (front, rear) = (path.travelled(param(&pair[0])), path.travelled(param(&pair[1])));
        assert!(front > rear);
        let place = path.point(param(&pair[0]));
        for k in 1..400 {
            let between = path.point(path.param_at(rear + (front - rear) * f64::from(k) / 400.0));
            let nearer = (between - place).norm() < team.link(bench) * (1.0 + 1e-12);
            assert!(nearer, "{time} s, link {bench}, {k}: {description:?}");
        }
    }
    for seat in &seats {
        let on = reference.path.segment(seat.segment);
        let forward = on.curve.forward();
        let behind_end = forward * (&on.last.at - &seat.place.at).rounded();
        let after_start = forward * (&seat.place.at - &on.first.at).rounded();
        assert!(behind_end > -1e-30 && (seat.segment == 0 || after_start > -1e-30), "{behind_end:e} {after_start:e}");
        let error = (path.point(param(seat)) - Point::from(seat.place.point.rounded())).norm();
        assert!(error < 1e-13, "{time} s: {error:e} m off the path in doubles");
    }
    seats
}

#[test]
fn chains_are_sound_and_the_head_has_travelled_its_way() {
    for (team, description) in [(team(60), procession()), (team(80), TURNAROUND), (team(30), PAPER)] {
        for time in [0.0, 3.7, 44.2, 63.0, 79.123, 100.0, 104.0, 111.0, 120.5, 148.0] {
            let seats = assert_sound(team, &description, time);
            let mut path = RealPath::new(&description).unwrap();
            let Seat { segment, place, .. } = &seats[0];
            let on = path.segment(*segment);
            let metres = match &on.curve {
                Curve::Spiral { .. } => integrated(&mut path, *segment, &place.at),
                curve => (&place.at - &on.first.at) * curve.rate(&place.at),
            };
            let error = (&path.segment(*segment).begin + metres - Real::from(time)).rounded();
            assert!(error.abs() < 1e-20, "{time} s: {error:e} m");
        }
    }
}

/// Returns the metres of travel from the beginning of a spiral to a place on it, by Romberg's rule on ds / dtheta.
fn integrated(path: &mut RealPath, segment: usize, to: &Real) -> Real {
    let on = path.segment(segment);
    let span = to - &on.first.at;
    let rate = |share: f64| on.curve.rate(&(&on.first.at + &span * Real::from(share)));
    let mut rows = vec![(rate(0.0) + rate(1.0)) / Real::from(2.0)];
    for level in 1..=9 {
        let parts = 1u32 << level;
        let odd = (1..parts).step_by(2).map(|k| rate(f64::from(k) / f64::from(parts)));
        let middle = odd.reduce(|a, b| a + b).unwrap() / Real::from(f64::from(parts / 2));
        let mut next = vec![(&rows[0] + middle) / Real::from(2.0)];
        for (power, coarse) in rows.iter().enumerate() {
            let fine = next[power].clone();
            let weight = Real::from(4f64.powi(power as i32 + 1) - 1.0);
            next.push(&fine + (&fine - coarse) / weight);
        }
        rows = next;
    }
    rows[rows.len() - 1].clone() * span * Real::from(on.curve.forward())
}

/// Computes the chain at `time` by the safe solver, and checks it against the reference. Each position agrees within
/// 1e-12 m, times the growth of small errors along the chain.
fn assert_newton_agrees(team: Team, description: &PathDescription, time: f64) {
    let (path, end) = followed(&team, &description.path().unwrap());
    if time > end - 1e-9 {
        return;
    }
    let newton = Newton::new(path, team, 1.0, Velocities::Computed);
    let mut chain = Chain::new(team.handles());
    let solved = newton.solve_at(time, &mut chain);
    let handles = Reference::new(team, description, 1.0).unwrap().handles(time);
    assert_eq!(solved.is_ok(), handles.is_ok(), "{time} s: {description:?}");
    let (mut slowest, mut growth) = (1f64, 1f64);
    for (i, handle) in handles.unwrap_or_default().iter().enumerate() {
        slowest = slowest.min(handle.speed.abs());
        growth = growth.max(handle.speed.abs() / slowest);
        if growth > 1e3 {
            return;
        }
        let error = handle.x.error_of(chain.x[i]).hypot(handle.y.error_of(chain.y[i]));
        assert!(error <= 1e-12 * growth, "{time} s, handle {i}: {error:e} m, {growth}: {description:?}");
        let error = (chain.speed[i] - handle.speed).abs();
        assert!(error <= 1e-12 * growth * growth, "{time} s, speed {i}: {error:e}: {description:?}");
    }
}

#[test]
fn newton_agrees_on_the_procession_and_the_turnaround() {
    // Here the distance from a handle on the S shrinks several times along the spiral behind.
    let (pitch, turn_radius, lead_in) = (0.5, 0.1, 100.0);
    let tight = PathDescription::Turnaround { pitch, turn_radius, arc_ratio: 1.0, lead_in, lead_out: 100.0 };
    for (team, description) in [(team(60), procession()), (team(60), TURNAROUND), (team(1), tight)] {
        let path = description.path().unwrap();
        for time in (0..9).map(|k| 25.1 * f64::from(k)).chain(path.junctions()).filter(|&time| time <= path.length()) {
            assert_newton_agrees(team, &description, time);
        }
    }
}

#[test]
fn handles_on_a_junction_are_found() {
    let mut team = team(3);
    // Doubles without rounding: links of 2.5 and 1.5 m.
    (team.head_length, team.body_length, team.hole_inset) = (3.0, 2.0, 0.25);
    let steps = vec![
        RouteStep::Line { length: 1.5 },
        RouteStep::Line { length: 2.5 },
        RouteStep::Arc { side: Side::Right, radius: 3.0.into(), turns: 0.25.into() },
    ];
    let description = PathDescription::Route { heading_turns: 0.125, steps };
    for (time, expected) in [(4.0, [3, 2, 1, 0]), (2.5, [2, 1, 0, 0]), (1.5, [2, 0, 0, 0])] {
        for off in [0.0, 1e-15, -1e-15, 1e-7, -1e-7] {
            let seats = assert_sound(team, &description, time + off);
            if off == 0.0 {
                let junctions = seats.iter().filter(|seat| seat.place.at.rounded().abs() < 1e-30).count();
                assert!(junctions >= 1, "{time} s: {:?}", seats.iter().map(|seat| seat.segment).collect::<Vec<_>>());
            }
            assert!(seats.iter().zip(expected).all(|(seat, expected)| seat.segment.abs_diff(expected) <= 1));
        }
    }
}

#[test]
fn followers_are_on_the_right_side_of_a_junction() {
    let mut sides = [0, 0];
    for k in 0..40 {
        let radius = 3.0 + 0.1 * f64::from(k);
        let steps = vec![
            RouteStep::Line { length: 1.0 },
            RouteStep::Arc { side: Side::Left, radius: radius.into(), turns: 0.25.into() },
        ];
        let description = PathDescription::Route { heading_turns: 0.1, steps };
        let time = 1.0 + 2.0 * radius * (0.5 * team(1).link(0) / radius).asin();
        // The root is at the junction for a time between two doubles: nearer than the error of a guess in doubles.
        for bits in time.to_bits() - 3..=time.to_bits() + 3 {
            let seats = assert_sound(team(1), &description, f64::from_bits(bits));
            sides[seats[1].segment - 1] += 1;
        }
    }
    assert!(sides.iter().all(|&times| times > 40), "{sides:?}");
}

fn any_step() -> impl Strategy<Value = RouteStep> {
    let side = prop_oneof![Just(Side::Left), Just(Side::Right)];
    prop_oneof![
        (0.01..12.0).prop_map(|length| RouteStep::Line { length }),
        (side, 0.7..8.0, 0.01..0.6).prop_map(|(side, radius, turns): (Side, f64, f64)| RouteStep::Arc {
            side,
            radius: radius.into(),
            turns: turns.into()
        }),
        any_spiral(),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(30) })]

    #[test]
    fn random_routes_are_sound_and_newton_agrees(
        steps in prop::collection::vec(any_step(), 1..8),
        heading_turns in -2.0..2.0,
        share in 0.0..1.0,
    ) {
        let description = PathDescription::Route { heading_turns, steps };
        let time = share * description.path().unwrap().length();
        let (path, end) = followed(&team(12), &description.path().unwrap());
        if time < end - 1e-9 && path.branches().is_empty() {
            assert_sound(team(12), &description, time);
        }
        assert_newton_agrees(team(12), &description, time);
    }
}
