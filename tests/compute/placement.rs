//! A motion has the same times and digits anywhere on the stage. It is solved and proved in its path's own coordinates,
//! and its results are placed.

use bench_dragon::certify::{CertificateLine, MOST_STEPS, certify};
use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::proof;
use bench_dragon::show::convert::{Stamps, frame_header, stage};
use bench_dragon::show::scene::Scene;
use bench_dragon::show::{Playback, Show};

/// A U-turn that is 6e-7 m narrower than half the head's link: its stall loses eight digits in rounded coordinates.
const U_TURN: &str = r#"
[team]
benches = 3
head_length = 3.41
body_length = 2.2
width = 0.3
hole_inset = 0.275
[path]
kind = "pieces"
start = [0.0, 0.0]
pieces = [
    { kind = "line", length = 5.0 },
    { kind = "arc", radius = 1.429999, side = "left", turns = 0.5 },
    { kind = "line", length = 20.0 },
]
[motion]
head_speed = 1.0
[alerts]
"#;

/// A loop on which the head runs into its own team.
const LOOP: &str = r#"
[team]
benches = 12
head_length = 3.41
body_length = 2.2
width = 0.3
hole_inset = 0.275
[path]
kind = "pieces"
start = [0.0, 0.0]
heading_turns = 0.17
pieces = [
    { kind = "line", length = 5.0 },
    { kind = "arc", radius = 2.5, side = "left", turns = 1.2 },
    { kind = "line", length = 20.0 },
]
[motion]
head_speed = 1.5
on_contact = "continue"
[alerts]
"#;

const PLACEMENT: &str = "[placement]\norigin = [20.5, -3.0]\nrotation_turns = 0.3\nmirror = true\n";

const STARTS: [[f64; 2]; 4] = [[1e6, 1e6], [1e9, 1e9], [-3e8, 0.7], [1e-3, -7.0]];

fn scene(text: &str) -> Scene {
    Scene::parse(text, "test.toml", "test").unwrap()
}

fn moved(text: &str, [x, y]: [f64; 2]) -> String {
    let text = text.replace("start = [0.0, 0.0]", &format!("start = [{x:?}, {y:?}]"));
    assert!(text.contains(&format!("{x:?}")));
    text
}

/// Returns the lines of a certificate as JSON, without the scene's text, after the checker has accepted it.
fn certificate(text: &str) -> Vec<String> {
    let scene = scene(text);
    let timeline = scene.ensemble.timeline(&mut unreported);
    let (mut file, mut lines) = (String::new(), Vec::new());
    let mut write = |line: &CertificateLine| {
        let json = serde_json::to_string(line).unwrap();
        file += &format!("{json}\n");
        lines.extend((!matches!(line, CertificateLine::Certificate { .. })).then_some(json));
        Ok(())
    };
    certify(&scene.ensemble, &timeline, text, MOST_STEPS, &mut write, &mut unreported).unwrap();
    proof::verify(file.as_bytes(), &mut |_| ()).unwrap_or_else(|refused| panic!("{refused}"));
    lines
}

#[test]
fn a_route_has_the_same_events_and_proofs_wherever_it_starts() {
    for (text, kind) in [(U_TURN, EventKind::Stall), (LOOP, EventKind::Contact)] {
        let home = scene(text).ensemble.timeline(&mut unreported);
        let proofs = certificate(text);
        assert!(home.find(kind).is_some() && proofs.iter().any(|line| line.contains("\"proved\"")), "{proofs:?}");
        for start in STARTS {
            let away = scene(&moved(text, start)).ensemble.timeline(&mut unreported);
            assert_eq!(away.events().len(), home.events().len());
            for (away, home) in away.events().iter().zip(home.events()) {
                assert_eq!((away.time, away.event.kind), (home.time, home.event.kind), "{start:?}");
                let place = home.event.place.map(|place| (place.x + start[0], place.y + start[1]));
                assert_eq!(away.event.place.map(|place| (place.x, place.y)), place, "{start:?}");
            }
            assert_eq!(certificate(&moved(text, start)), proofs, "{start:?}");
        }
    }
}

#[test]
fn frames_of_a_route_are_those_at_the_origin_moved_by_the_start() {
    for text in [U_TURN, LOOP] {
        let home = scene(text);
        let handles = home.ensemble.handles();
        let timeline = home.ensemble.timeline(&mut unreported);
        let mut home_solver = home.ensemble.only().unwrap().solver(Velocities::Computed).solver;
        for start in STARTS {
            let away = scene(&moved(text, start));
            let moved_timeline = away.ensemble.timeline(&mut unreported);
            let mut away_solver = away.ensemble.only().unwrap().solver(Velocities::Computed).solver;
            let mut shows = [(&home, &timeline), (&away, &moved_timeline)]
                .map(|(scene, timeline)| Show::new(scene, timeline.clone(), Playback::of(scene)).unwrap());
            let (mut chain, mut placed) = (Chain::new(handles), Chain::new(handles));
            let place = |chain: &Chain| Chain {
                x: chain.x.iter().map(|x| x + start[0]).collect(),
                y: chain.y.iter().map(|y| y + start[1]).collect(),
                ..chain.clone()
            };
            for tick in 0..600 {
                home_solver.solve(tick as f64 / 60.0, &mut chain).unwrap();
                away_solver.solve(tick as f64 / 60.0, &mut placed).unwrap();
                assert_eq!(place(&chain), placed, "{start:?} at tick {tick}");
                let [home, away] = shows.each_mut().map(|show| show.frame(tick));
                assert_eq!(place(&home.chain), away.chain, "{start:?} at tick {tick}");
                let stamps = Stamps { run_id: 0, sequence: tick, stamp_ns: 0, deadline_ns: 0 };
                assert_eq!(frame_header(home, stamps), frame_header(away, stamps), "{start:?} at tick {tick}");
                assert_eq!(home.alerts.len(), away.alerts.len());
                for (home, away) in home.alerts.iter().zip(&away.alerts) {
                    let [home, away] = [home, away].map(|alert| alert.nearest.unwrap());
                    assert_eq!((home.value, home.bench_a, home.bench_b), (away.value, away.bench_a, away.bench_b));
                    let moved = (home.point_a.x + start[0], home.point_a.y + start[1]);
                    assert_eq!((away.point_a.x, away.point_a.y), moved);
                }
            }
            let [home_stage, away_stage] = [(&home, &shows[0]), (&away, &shows[1])]
                .map(|(scene, show)| stage(0, 0, [0; 32], &scene.ensemble, show));
            for (home, away) in home_stage.segments.iter().zip(&away_stage.segments) {
                let moved = (home.x + start[0], home.y + start[1], home.heading, home.curvature.to_bits());
                assert_eq!((away.x, away.y, away.heading, away.curvature.to_bits()), moved);
            }
        }
    }
}

/// Frames, alerts and the stage of a show with `[placement]` are those without it, mirrored, turned and moved. The
/// clearance and the certificate are the same.
#[test]
fn a_placed_show_is_the_show_transformed() {
    let turnaround = include_str!("../../config/turnaround.toml").replace("benches = 223", "benches = 30");
    for text in [LOOP, &turnaround] {
        let home = scene(text);
        let away = scene(&format!("{text}\n{PLACEMENT}"));
        let (sine, cosine) = (0.3 * std::f64::consts::TAU).sin_cos();
        let turned = |x: f64, y: f64| (cosine * x + sine * y, sine * x - cosine * y);
        let near = |(x, y): (f64, f64), (a, b): (f64, f64), most: f64| (x - a).hypot(y - b) <= most;
        let timelines = [&home, &away].map(|scene| scene.ensemble.timeline(&mut unreported));
        let times =
            timelines.each_ref().map(|timeline| timeline.events().iter().map(|timed| timed.time).collect::<Vec<_>>());
        assert_eq!(times[0], times[1]);
        let [mut home_show, mut away_show] = [(&home, &timelines[0]), (&away, &timelines[1])]
            .map(|(scene, timeline)| Show::new(scene, timeline.clone(), Playback::of(scene)).unwrap());
        let mut alerts = 0;
        for tick in (0..6000).step_by(7) {
            let (home, away) = (home_show.frame(tick), away_show.frame(tick));
            let stamps = Stamps { run_id: 0, sequence: tick, stamp_ns: 0, deadline_ns: 0 };
            assert_eq!(frame_header(home, stamps), frame_header(away, stamps), "tick {tick}");
            let (one, other) = (&home.chain, &away.chain);
            assert_eq!(one.speed, other.speed);
            for k in 0..one.handles() {
                let (x, y) = turned(one.x[k], one.y[k]);
                assert!(near((x + 20.5, y - 3.0), (other.x[k], other.y[k]), 1e-13), "handle {k} at tick {tick}");
                assert!(near(turned(one.vx[k], one.vy[k]), (other.vx[k], other.vy[k]), 1e-14), "handle {k}");
                let heading = 0.3 * std::f64::consts::TAU - one.heading[k] - other.heading[k];
                assert!((heading.cos() - 1.0).abs() < 1e-15 && other.heading[k].abs() <= std::f64::consts::PI);
            }
            for (one, other) in home.alerts.iter().zip(&away.alerts) {
                let [one, other] = [one, other].map(|alert| alert.nearest.unwrap().point_a);
                let (x, y) = turned(one.x, one.y);
                assert!(near((x + 20.5, y - 3.0), (other.x, other.y), 1e-13));
                alerts += 1;
            }
        }
        assert!(alerts > 0);
        let [one, other] =
            [(&home, &home_show), (&away, &away_show)].map(|(scene, show)| stage(0, 0, [0; 32], &scene.ensemble, show));
        for (one, other) in one.segments.iter().zip(&other.segments) {
            let (x, y) = turned(one.x, one.y);
            assert!(near((x + 20.5, y - 3.0), (other.x, other.y), 1e-13));
            assert_eq!((one.kind, one.length), (other.kind, other.length));
            match one.kind_name() {
                "arc" => assert_eq!(one.curvature, -other.curvature),
                "line" => assert_eq!(one.curvature, other.curvature),
                _ => assert!(one.curvature.is_nan() && (other.curvature > 0.0) == (one.kind_name() == "inward_spiral")),
            }
        }
    }
    assert_eq!(certificate(&format!("{U_TURN}\n{PLACEMENT}")), certificate(U_TURN));
}
