//! One suite that every solver runs, on every kind of path:
//!
//! - the figures of 50 digits and the table of them in docs/speed-and-accuracy.md,
//! - the promise against the reference of 38 digits,
//! - the consequences of rigidity,
//! - the same bits every time.
//!
//! The promise is for the pose at the given double `time`. The error is at most max(accuracy, 8 eps (r + distance
//! travelled)). Links hold to 1e-12 link + 4 ulp(r) and the rounding of the numbers that a segment is made of.
//! `BENCH_DRAGON_LONG=1` runs 10,000 random scenes of each kind.

mod bits;
mod random;
use crate::tables;

use std::cell::Cell;
use std::f64::consts::{PI, TAU};

use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::ensemble::Ensemble;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::model::curve::Side;
use bench_dragon::motion::model::description::{PathDescription, RouteStep};
use bench_dragon::motion::model::spiral::Direction;
use bench_dragon::motion::model::team::{Ends, Team};
use bench_dragon::motion::solve::newton::Newton;
use bench_dragon::motion::solve::reference::Reference;
use bench_dragon::motion::solve::selection::{self, Selection};
use bench_dragon::motion::solve::table::{FollowerTable, Instructions};
use bench_dragon::motion::solve::{Chain, Solver, Velocities};
use bench_dragon::motion::{Method, Motion};
use bench_dragon::show::scene::Scene;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use tables::{Row, table};

const ACCURACY: f64 = 1e-9;

/// A motion and the time up to which it is solved.
struct Subject {
    motion: Motion,
    /// Seconds up to which the motion is tested: the lock or path end, or a named event.
    end: f64,
}

impl std::fmt::Debug for Subject {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Self { motion, end } = self;
        write!(formatter, "{:?} {:?} at {} m/s to {end} s", motion.description(), motion.team(), motion.head_speed())
    }
}

impl Subject {
    fn new(description: PathDescription, team: Team, head_speed: f64) -> Self {
        let motion = Motion::new(description, team, head_speed, Method::Accuracy(ACCURACY)).unwrap();
        let end = Ensemble::alone(motion.clone()).timeline_without_contact(&mut unreported).end().time;
        Self { motion, end }
    }

    /// Returns a scene of `config/`, up to its contact if it has one.
    fn scene(name: &str) -> Self {
        let scene = Scene::load(&std::path::Path::new("config").join(format!("{name}.toml"))).unwrap();
        let timeline = scene.ensemble.timeline(&mut unreported);
        let end = timeline.find(EventKind::Contact).unwrap_or(timeline.end()).time;
        Self { motion: scene.ensemble.only().unwrap().clone(), end }
    }

    fn table(&self) -> Option<FollowerTable> {
        FollowerTable::new(
            self.motion.path(),
            *self.motion.team(),
            self.motion.head_speed(),
            Velocities::Computed,
            &mut unreported,
        )
    }

    fn newton(&self) -> Newton {
        Newton::new(self.motion.path().clone(), *self.motion.team(), self.motion.head_speed(), Velocities::Computed)
    }

    /// Returns the solvers that an accuracy of 1e-9 m selects, on every code path, by name.
    fn selected(&self) -> Vec<(String, Box<dyn Solver>)> {
        let (motion, velocities) = (&self.motion, Velocities::Computed);
        let selection = selection::cheapest(
            motion.path(),
            *motion.team(),
            motion.head_speed(),
            velocities,
            ACCURACY,
            &mut unreported,
        );
        let Some(Selection { table, .. }) = selection else { return Vec::new() };
        let selected = Instructions::available().into_iter().filter_map(|instructions| {
            let table = table.clone().with_instructions(instructions)?;
            Some((format!("1e-9 m ({})", instructions.name()), Box::new(table) as Box<dyn Solver>))
        });
        selected.collect()
    }

    /// Returns every solver that follows exact motion, on every code path, by name.
    fn solvers(&self) -> Vec<(String, Box<dyn Solver>)> {
        let newton: (String, Box<dyn Solver>) = ("newton".to_owned(), Box::new(self.newton()));
        let tables = Instructions::available().into_iter().filter_map(|instructions| {
            let table = self.table()?.with_instructions(instructions)?;
            Some((format!("follower_table ({})", instructions.name()), Box::new(table) as Box<dyn Solver>))
        });
        std::iter::once(newton).chain(tables).collect()
    }

    /// Asserts the properties of a chain alone. The chain is finite, its links are as long as promised, and its
    /// headings fit the positions. Its velocities are along the path, and equal at both ends of a link along the link.
    fn assert_sound(&self, chain: &Chain, time: f64, who: &str) {
        let team = self.motion.team();
        let at = || format!("{who} at {time} s: {:?} {team:?}", self.motion.description());
        let numbers = [&chain.x, &chain.y, &chain.heading, &chain.speed, &chain.vx, &chain.vy];
        assert!(numbers.into_iter().flatten().all(|number| number.is_finite()), "{}", at());
        for bench in 0..team.benches {
            let (dx, dy) = (chain.x[bench] - chain.x[bench + 1], chain.y[bench] - chain.y[bench + 1]);
            let link = team.link(bench);
            let r = radius(chain, bench).max(radius(chain, bench + 1));
            let (error, rounding) =
                ((dx.hypot(dy) - link).abs(), 4.0 * (r.next_up() - r) + self.motion.link_tolerance());
            assert!(error <= 1e-12 * link + rounding, "link {bench}: {error:e} m of {link}: {}", at());
            let heading = chain.heading[bench];
            assert!(heading > -PI && heading <= PI, "heading {bench}: {heading}: {}", at());
            let off = (heading - dy.atan2(dx) + PI).rem_euclid(TAU) - PI;
            assert!(off.abs() <= 1e-11 + 2.0 * rounding / link, "heading {bench}: {off:e}: {}", at());
            // Rigidity: both handles of a link are equally fast along it.
            let along = |handle: usize| (chain.vx[handle] * dx + chain.vy[handle] * dy) / link;
            let fastest = chain.speed[bench].abs().max(chain.speed[bench + 1].abs()).max(self.motion.head_speed());
            let slip = (along(bench) - along(bench + 1)).abs();
            assert!(slip <= fastest * (1e-10 + 4.0 * rounding / link), "link {bench} slips by {slip:e} m/s: {}", at());
        }
        for handle in 0..chain.handles() {
            let size = chain.vx[handle].hypot(chain.vy[handle]);
            // The selected solver is as smooth as links of 1e-12 require.
            let apart = if who.starts_with("1e-9 m") { 2e-11 } else { 1e-12 };
            assert!((size - chain.speed[handle].abs()).abs() <= apart * size.max(1e-300), "speed {handle}: {}", at());
        }
        assert_eq!(chain.heading[team.benches], chain.heading[team.benches - 1], "{}", at());
    }

    /// Compares a chain with the reference. Near a lock, where conditioning multiplies errors, the allowance grows by
    /// the handle's movement within the rounding of the time: its speed over the head's.
    fn assert_true(&self, reference: &mut Reference, chain: &Chain, time: f64, who: &str) {
        let truth = reference.handles(time).unwrap_or_else(|_| panic!("no truth at {time} s"));
        let speed = self.motion.head_speed();
        for (i, handle) in truth.iter().enumerate() {
            let at = || format!("{who} at {time} s, handle {i}: {:?}", self.motion.description());
            let error = handle.x.error_of(chain.x[i]).hypot(handle.y.error_of(chain.y[i]));
            let haste = (handle.speed / speed).abs().max(1.0);
            let bound = ACCURACY.max(8.0 * f64::EPSILON * (radius(chain, i) + speed * time)) * haste;
            assert!(error <= bound, "{error:e} m of {bound:e}: {}", at());
            let speed_error = (chain.speed[i] - handle.speed).abs() / (speed * haste);
            assert!(speed_error <= 1e-7 * haste, "speed {speed_error:e}: {}", at());
        }
    }

    fn reference(&self) -> Reference {
        Reference::new(*self.motion.team(), self.motion.description(), self.motion.head_speed()).unwrap()
    }

    /// Tests every solver at each of `times`.
    fn assert_promise(&self, times: &[f64]) {
        let mut chain = Chain::new(self.motion.team().handles());
        let mut reference = self.reference();
        for (who, mut solver) in self.solvers().into_iter().chain(self.selected()) {
            for &time in times {
                solver.solve(time, &mut chain).unwrap_or_else(|none| panic!("{who} at {time} s: {none}"));
                self.assert_sound(&chain, time, &who);
                self.assert_true(&mut reference, &chain, time, &who);
            }
        }
    }
}

fn radius(chain: &Chain, handle: usize) -> f64 {
    chain.x[handle].hypot(chain.y[handle])
}

fn spiral(benches: usize, head_link: f64, link: f64, pitch: f64, start_turn: f64, speed: f64) -> Subject {
    let hole_inset = 0.1 * link.min(head_link);
    let (head_length, body_length) = (head_link + 2.0 * hole_inset, link + 2.0 * hole_inset);
    let team = Team { benches, head_length, body_length, width: hole_inset, hole_inset, ends: Ends::NONE };
    Subject::new(PathDescription::Spiral { pitch, start_turn }, team, speed)
}

fn paper_team() -> Team {
    Team { benches: 223, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275, ends: Ends::NONE }
}

/// Returns the paper's scene and the turnaround with their tables of 50 digits.
fn tables() -> [(&'static str, Subject, Vec<Row>); 2] {
    let paper = PathDescription::Spiral { pitch: 0.55, start_turn: 16.0 };
    // The table's clock is 0 with the head at the start of the turn, 100 s into the scene.
    let turnaround =
        PathDescription::Turnaround { pitch: 1.7, turn_radius: 4.5, arc_ratio: 2.0, lead_in: 100.0, lead_out: 369.16 };
    let since_start = |row: Row| Row { time: row.time + 100.0, ..row };
    let turning = table(include_str!("../truth/turnaround_table.csv")).into_iter().map(since_start);
    [
        ("paper", Subject::new(paper, paper_team(), 1.0), table(include_str!("../truth/paper_scene_exact.csv"))),
        ("turnaround", Subject::new(turnaround, paper_team(), 1.0), turning.collect()),
    ]
}

/// Returns the largest position error in metres and the largest relative speed error of a solver over rows.
fn errors<'a>(solver: &mut dyn Solver, rows: impl Iterator<Item = &'a Row>) -> (f64, f64) {
    let mut chain = Chain::new(224);
    let (mut solved, mut position, mut speed) = (f64::NAN, 0f64, 0f64);
    for row in rows {
        if solved != row.time {
            solver.solve(row.time, &mut chain).unwrap();
            solved = row.time;
        }
        let i = row.handle;
        position = position.max((chain.x[i] - row.x).hypot(chain.y[i] - row.y));
        speed = speed.max((chain.speed[i] / row.speed - 1.0).abs());
    }
    (position, speed)
}

/// The page's table of errors against 50 digits, as this test measures it: no error may be more than twice the printed
/// one. The README states the largest position error of the table.
#[test]
fn the_page_says_how_exact_every_solver_is() {
    let page = include_str!("../../docs/speed-and-accuracy.md");
    let (mut compared, mut worst) = (0, 0f64);
    for (scene, subject, rows) in tables() {
        for (who, mut solver) in subject.solvers() {
            // Past the contact of the paper's scene the lock multiplies every rounding.
            let (position, speed) =
                errors(solver.as_mut(), rows.iter().filter(|row| scene != "paper" || row.time < 412.5));
            println!("| `{who}` | {scene} | {position:.1e} m | {speed:.1e} |");
            let name = solver.name();
            let line = page.lines().find(|line| line.starts_with(&format!("| `{name}` | {scene} |")));
            let cells: Vec<&str> = line.unwrap_or_else(|| panic!("no row of {name} on {scene}")).split('|').collect();
            let printed: Vec<f64> =
                cells[3..5].iter().map(|cell| cell.trim().trim_end_matches(" m").parse().unwrap()).collect();
            worst = worst.max(printed[0]);
            for (measured, printed) in [position, speed].into_iter().zip(printed) {
                assert!(measured <= 2.0 * printed, "{who} on {scene}: {measured:e}, the page: {printed:e}");
            }
            compared += 1;
        }
    }
    assert!(compared >= 6, "a table and the safe solver on two scenes");
    let claim = format!("within {worst:e} m of 50 digits");
    assert!(include_str!("../../README.md").contains(&claim), "the README does not state: {claim}");
}

/// Past the contact, up to 17.9 ms before the lock, where the motion itself multiplies roundings.
#[test]
fn solvers_agree_with_50_digits_up_to_the_lock() {
    let [(_, subject, rows), _] = tables();
    for (who, mut solver) in subject.solvers() {
        let late = rows.iter().filter(|row| row.time > 412.5);
        assert!(late.clone().count() >= 224);
        let (position, speed) = errors(solver.as_mut(), late);
        println!("{who}: position {position:.1e} m, speed {speed:.1e}");
        assert!(position < 1e-9 && speed < 1e-9, "{who}: {position:e} m, {speed:e}");
    }
}

/// A route with spirals of all four kinds: tests/truth/spiral_route.py has its numbers.
fn spiral_route() -> Subject {
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
    Subject::new(PathDescription::Route { heading_turns: 0.0, steps }, Team { benches: 25, ..paper_team() }, 1.0)
}

#[test]
fn solvers_agree_with_50_digits_on_a_route_of_spirals() {
    let (subject, rows) = (spiral_route(), table(include_str!("../truth/spiral_route.csv")));
    let mut solvers = subject.solvers();
    assert!(solvers.len() >= 3, "newton and tables");
    for (who, solver) in &mut solvers {
        let (position, speed) = errors(solver.as_mut(), rows.iter());
        println!("{who}: position {position:.1e} m, speed {speed:.1e}");
        assert!(position < 4e-13 && speed < 4e-13, "{who}: {position:e} m, {speed:e}");
    }
}

#[test]
fn every_scene_of_the_configuration_keeps_the_promise() {
    for name in ["paper", "school", "tight", "wide", "turnaround", "procession"] {
        let subject = Subject::scene(name);
        let speed = subject.motion.head_speed();
        let mut times: Vec<f64> = [0.0, 0.13, 0.5, 0.77, 0.999].map(|share| share * subject.end).to_vec();
        // Just before and after the head and the handles behind it cross a junction.
        for junction in subject.motion.path().junctions() {
            let crossing = [-1e-9, 1e-9, 2.86 - 1e-7, 2.87, 33.0].map(|metres| (junction + metres) / speed);
            times.extend(crossing.into_iter().filter(|time| (0.0..subject.end).contains(time)));
        }
        subject.assert_promise(&times);
    }
}

#[test]
#[ignore = "tests/run --all"]
fn corners_of_the_ranges() {
    // Benches, links of head and body, pitch, start turn, speed. Each comment states the reason for its line.
    let corners = [
        // The closest start for a team that fits: all of it within two turns.
        spiral(1, 0.3, 0.3, 0.55, 1.0, 1.0),
        // So far out that the digits of a double do not resolve a bench.
        spiral(3, 2.86, 1.65, 0.55, 1e7, 1.0),
        spiral(3, 1e3, 1e3, 1e4, 1e7, 1e6),
        // A fine spiral under long boards, and a coarse one under short boards.
        spiral(5, 1e3, 1e3, 1e-3, 3e6, 1.0),
        spiral(5, 0.01, 0.01, 1e4, 2.0, 1.0),
        spiral(5, 0.01, 0.01, 1e-3, 300.0, 1.0),
        spiral(5, 1e3, 1e3, 1e4, 16.0, 1.0),
        // The slowest and the fastest head: time and distance differ by 15 powers of ten.
        spiral(20, 2.86, 1.65, 0.55, 16.0, 1e-9),
        spiral(20, 2.86, 1.65, 0.55, 16.0, 1e6),
        // A head link far longer and far shorter than the rest.
        spiral(8, 20.0, 0.2, 0.55, 60.0, 1.0),
        spiral(8, 0.2, 20.0, 0.55, 60.0, 1.0),
        // Links so long that a table which is right to their last digits is not right to a nanometre.
        spiral(9, 9406.914221731744, 9000.0, 6292.008334889938, 3.019746065123493, 29878.041797247908),
        // Links a tenth of the pitch neither stall nor lock: the head reaches the centre.
        spiral(6, 0.055, 0.055, 0.55, 3.0, 1.0),
        // Past the stall of a long head's link the short team behind it is pushed far out again.
        spiral(9, 1.0, 0.007, 1.7, 0.12, 1.0),
        // The head's link is promised relative to its own length, which is a two hundredth of the others'.
        spiral(8, 0.01, 2.0, 0.55, 8.0, 1.0),
    ];
    for subject in corners {
        println!("{subject:?}");
        subject.assert_promise(&[0.0, 0.3, 0.7, 0.99, 1.0 - 1e-6].map(|share| share * subject.end));
    }
    // Ten years into a show: no error may have accumulated.
    let subject = spiral(12, 2.86, 1.65, 0.55, 2e4, 1.0);
    let times = [10_000_000_000u64 - 2, 10_000_000_000].map(|tick| tick as f64 / 30.0);
    assert!(subject.end > times[1]);
    subject.assert_promise(&times);
}

/// Links hold to the last digits of x and y themselves; the digits of the angle must not cost any.
#[test]
fn short_links_far_from_the_centre() {
    let subject = spiral(20, 0.0156, 0.006126810246871752, 0.08501015264165514, 1627.284520913776, 1.0);
    let mut chain = Chain::new(21);
    for (who, mut solver) in subject.solvers() {
        for k in 0..500 {
            let time = 145_193.0 + 1.48 * f64::from(k);
            solver.solve(time, &mut chain).unwrap();
            subject.assert_sound(&chain, time, &who);
        }
    }
}

#[test]
fn a_hundred_thousand_benches_hold_their_links() {
    // The reference would take minutes; the safe solver, which is tested above, replaces it.
    let team = Team { benches: 100_000, ..paper_team() };
    let subject = Subject::new(PathDescription::Spiral { pitch: 0.55, start_turn: 16.0 }, team, 1.0);
    let (mut chain, mut safe) = (Chain::new(100_001), Chain::new(100_001));
    let mut table = subject.table().expect("a hundred thousand benches have a table");
    for time in [0.0, 300.0, 412.0] {
        subject.newton().solve(time, &mut safe).unwrap();
        table.solve(time, &mut chain).unwrap();
        subject.assert_sound(&chain, time, "follower_table");
        for i in 0..chain.handles() {
            let error = (chain.x[i] - safe.x[i]).hypot(chain.y[i] - safe.y[i]);
            // The last digit of a link adds up, a hundred thousand times in one direction.
            assert!(error <= 1e5 * f64::EPSILON * 1.65, "handle {i}: {error:e} m");
        }
    }
    assert_eq!(table.fallbacks(), 0);
}

#[test]
fn a_time_past_the_lock_is_an_error_and_no_jump() {
    let subject = spiral(223, 2.86, 1.65, 0.55, 16.0, 1.0);
    let mut chain = Chain::new(224);
    for (who, mut solver) in subject.solvers() {
        // Beyond 432.9179 s there is no follower on the first rise of the chord.
        assert!(solver.solve(433.0, &mut chain).is_err(), "{who}");
        assert!(solver.solve(440.0, &mut chain).is_err(), "{who}");
        solver.solve(430.0, &mut chain).unwrap();
        subject.assert_true(&mut subject.reference(), &chain, 430.0, &who);
    }
}

/// Frames do not depend on earlier frames, even past the table's end and back in it.
#[test]
fn a_frame_of_the_table_does_not_depend_on_the_ones_before() {
    for name in ["paper", "turnaround", "procession"] {
        let subject = Subject::scene(name);
        let handles = subject.motion.team().handles();
        let (mut chain, mut again) = (Chain::new(handles), Chain::new(handles));
        let mut solver = subject.table().unwrap();
        for share in [0.99, 0.0, 0.25, 0.250001, 0.8] {
            let time = share * subject.end;
            solver.solve(time, &mut chain).unwrap();
            subject.table().unwrap().solve(time, &mut again).unwrap();
            assert_eq!(chain, again, "{name} at {time} s");
        }
        assert_eq!(solver.fallbacks(), 0, "{name}: the table ends at {} s", solver.valid_until());
    }
}

/// The table reaches its own end without a jump, and hands over without a jump.
#[test]
fn no_handle_jumps_from_piece_to_piece() {
    for name in ["paper", "turnaround", "procession"] {
        let subject = Subject::scene(name);
        let handles = subject.motion.team().handles();
        let (mut chain, mut before) = (Chain::new(handles), Chain::new(handles));
        let mut solver = subject.table().unwrap();
        let (valid, end) = (
            solver.valid_until(),
            Ensemble::alone(subject.motion.clone()).timeline_without_contact(&mut unreported).end().time,
        );
        let junctions = subject.motion.path().junctions().flat_map(|at| [at, at + 2.86, at + 3.6]);
        let edges = (1..400).map(|k| 0.997 * subject.end * f64::from(k) / 400.0).chain(junctions).chain([valid]);
        let edges: Vec<f64> = edges.filter(|edge| (1e-6..end - 1e-6).contains(edge)).collect();
        assert!(edges.len() >= 399, "{name}: {} edges", edges.len());
        for &edge in &edges {
            solver.solve(edge - 1e-9, &mut before).unwrap_or_else(|none| panic!("{name} before {edge} s: {none}"));
            solver.solve(edge + 1e-9, &mut chain).unwrap_or_else(|none| panic!("{name} after {edge} s: {none}"));
            for i in 0..handles {
                let moved = (chain.x[i] - before.x[i]).hypot(chain.y[i] - before.y[i]);
                assert!(
                    moved <= 2e-9 * chain.speed[i].abs() * 1.001 + 5e-13,
                    "{name}, handle {i} at {edge} s: {moved:e} m"
                );
                let faster = (chain.speed[i] - before.speed[i]).abs();
                assert!(faster <= 1e-7, "{name}, handle {i} at {edge} s: {faster:e} m/s");
            }
        }
        // Only the paper's motion continues where its table ends: near the lock.
        assert_eq!(solver.fallbacks(), u64::from(name == "paper"), "{name}: the table ends at {valid} s of {end} s");
    }
}
