//! Events, compared with figures computed with 50 digits. `tests/compute/oracle` compares them with brute force on
//! random scenes.

use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::clearance::least_clearance_all_pairs;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::solve::newton::Newton;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::show::scene::Scene;

fn scene(text: &str) -> Scene {
    Scene::parse(text, "test", "test").unwrap()
}

#[test]
fn the_paper_scene_has_its_events_as_with_50_digits() {
    let started = std::time::Instant::now();
    let timeline = Scene::paper().ensemble.timeline(&mut unreported);
    println!("found in {:?}", started.elapsed());
    let found: Vec<_> =
        timeline.events().iter().map(|timed| (timed.event.kind, timed.event.bench_a, timed.event.bench_b)).collect();
    assert_eq!(
        found,
        [(EventKind::Contact, Some(0), Some(8)), (EventKind::Stall, Some(0), None), (EventKind::Lock, Some(0), None)]
    );
    for (timed, truth) in timeline.events().iter().zip([412.473837682115, 432.758134083656, 432.917924228383]) {
        println!("{:?} {:.12} off by {:e}", timed.event.kind, timed.time, timed.time - truth);
        assert!((timed.time - truth).abs() < 1e-10);
    }
}

#[test]
fn the_papers_own_motion_touches_earlier() {
    let text = include_str!("../../config/paper.toml").replace("accuracy = 1e-9", "solver = \"paper\"");
    let timeline = scene(&text).ensemble.timeline(&mut unreported);
    let contact = timeline.find(EventKind::Contact).unwrap();
    // The paper prints 412.5 s; this is the exact contact of its own model.
    assert!((contact.time - 412.414901).abs() < 1e-6, "{}", contact.time);
}

/// The boards meet in the last quarter of a second before the lock. No team can stand at the last digits of the lock.
#[test]
fn a_contact_just_before_the_lock_is_found() {
    let text = "[team]\nbenches = 3\nhead_length = 2.1117711923317812\nbody_length = 3.555706400138558\nwidth = 0.02\n\
                hole_inset = 0.17921771164504968\n[path]\nkind = \"spiral\"\npitch = 0.7961849666936323\n\
                start_turn = 5.774603178083499\n[motion]\nhead_speed = 1.0\n[alerts]\n";
    let scene = Scene::parse(text, "random", "random").unwrap();
    let timeline = scene.ensemble.timeline(&mut unreported);
    let contact = timeline.find(EventKind::Contact).expect("sampling sees them overlap at 77.6728 m").event;
    assert!(contact.travelled > 77.585 && contact.travelled < 77.6728, "{contact:?}");
    let mut chain = Chain::new(scene.ensemble.handles());
    let newton = Newton::new(
        scene.ensemble.only().unwrap().path().clone(),
        *scene.ensemble.only().unwrap().team(),
        1.0,
        Velocities::Omitted,
    );
    newton.solve_at(contact.travelled, &mut chain).unwrap();
    let clearance = least_clearance_all_pairs(&chain, scene.ensemble.only().unwrap().team()).unwrap().value;
    assert!(clearance.abs() < 1e-12, "{clearance:e}");
    let least = scene.ensemble.least_clearances(&timeline, timeline.end(), &mut unreported).own.unwrap();
    assert!(least.least.value < 1e-12, "{least:?}");
}
