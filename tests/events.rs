//! Events against figures computed with 50 digits, and against dense sampling of all pairs.

use bench_dragon::chain::newton::Newton;
use bench_dragon::chain::{Chain, Velocities};
use bench_dragon::geometry::Point;
use bench_dragon::geometry::path::Path;
use bench_dragon::geometry::rectangle::Board;
use bench_dragon::geometry::separation::separation_board_board;
use bench_dragon::messages::State;
use bench_dragon::scene::Scene;
use bench_dragon::show::timeline::Timeline;
use proptest::prelude::*;

fn scene(text: &str) -> Scene {
    Scene::parse(text, "test", "test").unwrap()
}

#[test]
fn the_paper_scene_has_its_events_when_50_digits_say() {
    let started = std::time::Instant::now();
    let timeline = Timeline::of(&Scene::paper(), &mut |_| ());
    println!("found in {:?}", started.elapsed());
    let found: Vec<_> =
        timeline.events().iter().map(|timed| (timed.event.kind, timed.event.bench_a, timed.event.bench_b)).collect();
    assert_eq!(
        found,
        [(State::Contact, Some(0), Some(8)), (State::Stall, Some(0), None), (State::Lock, Some(0), None)]
    );
    for (timed, truth) in timeline.events().iter().zip([412.473837682115, 432.758134083656, 432.917924228383]) {
        println!("{:?} {:.12} off by {:e}", timed.event.kind, timed.time, timed.time - truth);
        assert!((timed.time - truth).abs() < 1e-10);
    }
}

#[test]
fn the_papers_own_motion_touches_earlier() {
    let text = include_str!("../config/paper.toml").replace("accuracy = 1e-9", "solver = \"paper\"");
    let timeline = Timeline::of(&scene(&text), &mut |_| ());
    let contact = timeline.find(State::Contact).unwrap();
    // Where the paper prints 412.5 s: the exact contact of its own model.
    assert!((contact.time - 412.414901).abs() < 1e-6, "{}", contact.time);
}

/// The chain with the head `travelled` metres along, and the least clearance over all pairs that share no handle, by
/// asking every one.
fn least_clearance(scene: &Scene, travelled: f64, chain: &mut Chain) -> Option<f64> {
    let newton = Newton::new(*scene.path.spiral().unwrap(), scene.team, 1.0, Velocities::Omitted);
    newton.solve_from(scene.path.spiral().unwrap().place_at(travelled), chain).ok()?;
    let team = &scene.team;
    let boards: Vec<Board> = (0..team.benches)
        .map(|bench| {
            let front = Point::new(chain.x[bench], chain.y[bench]);
            let rear = Point::new(chain.x[bench + 1], chain.y[bench + 1]);
            Board::from_front(front, (front - rear).normalize(), team.link(bench), team.hole_inset, team.width)
        })
        .collect();
    let pairs = (0..boards.len()).flat_map(|a| (a + 2..boards.len()).map(move |b| (a, b)));
    pairs.map(|(a, b)| separation_board_board(&boards[a], &boards[b])).reduce(f64::min)
}

/// Scenes of all proportions, most of them small enough to be sampled densely.
fn any_scene() -> impl Strategy<Value = Scene> {
    (3usize..60, 0.3f64..4.0, 0.3f64..4.0, 0.02f64..0.6, 0.02f64..0.3, 0.2f64..1.2, 2.0f64..7.0).prop_filter_map(
        "an illegal start",
        |(benches, head_link, body_link, width, inset, pitch, start_turn)| {
            let text = format!(
                "[team]\nbenches = {benches}\nhead_length = {}\nbody_length = {}\nwidth = {width}\nhole_inset = {inset}\n\
                 [path]\nkind = \"spiral\"\npitch = {pitch}\nstart_turn = {start_turn}\n[motion]\nhead_speed = 1.0\n",
                head_link + 2.0 * inset,
                body_link + 2.0 * inset
            );
            Scene::parse(&text, "random", "random").ok()
        },
    )
}

/// Cases of a property: more when the long run is asked for.
fn cases(usual: u32) -> ProptestConfig {
    let long = std::env::var_os("BENCH_DRAGON_LONG").is_some();
    ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(if long { 50 * usual } else { usual }) }
}

/// The boards meet in the last quarter of a second before the lock, whose own last digits no team can stand on.
#[test]
fn a_contact_just_before_the_lock_is_found() {
    let text = "[team]\nbenches = 3\nhead_length = 2.1117711923317812\nbody_length = 3.555706400138558\nwidth = 0.02\n\
                hole_inset = 0.17921771164504968\n[path]\nkind = \"spiral\"\npitch = 0.7961849666936323\n\
                start_turn = 5.774603178083499\n[motion]\nhead_speed = 1.0\n[alerts]\n";
    let scene = Scene::parse(text, "random", "random").unwrap();
    let timeline = Timeline::of(&scene, &mut |_| ());
    let contact = timeline.find(State::Contact).expect("sampling sees them overlap at 77.6728 m").event;
    assert!(contact.travelled > 77.585 && contact.travelled < 77.6728, "{contact:?}");
    let mut chain = Chain::new(scene.team.handles());
    let clearance = least_clearance(&scene, contact.travelled, &mut chain).unwrap();
    assert!(clearance.abs() < 1e-12, "{clearance:e}");
    let least = timeline.least_clearance(&scene, &mut |_| ()).unwrap();
    assert!(least.least.value < 1e-12, "{least:?}");
}

proptest! {
    #![proptest_config(cases(200))]

    /// Dense sampling of all pairs sees no overlap before the contact, and sees one right after it.
    #[test]
    fn contact_is_where_dense_sampling_sees_the_first_overlap(scene in any_scene()) {
        let timeline = Timeline::of(&scene, &mut |_| ());
        let end = timeline.end().event.travelled;
        let contact = timeline.find(State::Contact).map(|contact| contact.event.travelled);
        let mut chain = Chain::new(scene.team.handles());
        let step = 0.02 * scene.team.link(0).min(scene.team.link(1));
        let until = contact.unwrap_or(end);
        let mut travelled = 0.0;
        while travelled < until {
            if let Some(clearance) = least_clearance(&scene, travelled, &mut chain) {
                prop_assert!(clearance > -1e-12, "overlap of {clearance:e} at {travelled}, contact at {contact:?}, end {end}");
            }
            travelled += step;
        }
        if let Some(contact) = contact {
            let clearance = least_clearance(&scene, contact, &mut chain).unwrap();
            prop_assert!(clearance <= 1e-12, "clearance of {clearance:e} at the contact at {contact}");
            prop_assert!(contact == 0.0 || clearance > -1e-9, "the contact at {contact} comes late: {clearance:e}");
        }
    }

    /// Stall and lock are where dense sampling of every link's own cosines sees the first change of sign.
    #[test]
    fn stall_and_lock_are_where_dense_sampling_sees_them(scene in any_scene()) {
        let timeline = Timeline::of(&scene, &mut |_| ());
        let end = timeline.end().event;
        let stall = timeline.find(State::Stall).map(|stall| stall.event.travelled);
        let mut chain = Chain::new(scene.team.handles());
        let newton = Newton::new(*scene.path.spiral().unwrap(), scene.team, 1.0, Velocities::Computed);
        let steps = 4000;
        for step in 1..steps {
            let travelled = end.travelled * f64::from(step) / f64::from(steps);
            prop_assert!(newton.solve_from(scene.path.spiral().unwrap().place_at(travelled), &mut chain).is_ok(), "a fold before the end");
            let backwards = chain.speed.iter().any(|speed| *speed < -1e-9);
            if stall.is_none_or(|stall| travelled < stall) {
                prop_assert!(!backwards, "pushed backwards at {travelled}, stall at {stall:?}");
            }
        }
        if let Some(stall) = stall.filter(|stall| *stall > 0.0) {
            // The handle behind the stalled link stands still there.
            newton.solve_from(scene.path.spiral().unwrap().place_at(stall), &mut chain).unwrap();
            let slowest = chain.speed.iter().fold(f64::INFINITY, |least, speed| least.min(speed.abs()));
            prop_assert!(slowest < 1e-6, "slowest handle at the stall: {slowest:e}");
        }
        if end.kind == State::Lock {
            let bench = end.bench_a.unwrap() as usize;
            newton.solve_from(scene.path.spiral().unwrap().place_at(end.travelled * (1.0 - 1e-12)), &mut chain).unwrap();
            // Unbounded at the lock itself: the bench's rear handle is far faster than its front one.
            prop_assert!(chain.speed[bench + 1].abs() > 100.0 * chain.speed[bench].abs());
        } else {
            prop_assert_eq!(end.kind, State::PathEnd);
        }
    }
}
