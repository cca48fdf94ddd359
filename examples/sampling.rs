//! Cost and error of sampling, beside the exact search, in one run. The paper finds the contact by sampling: every pair
//! at every hundredth of a second.
//!
//! `cargo run --release --example sampling`

use std::time::Instant;

use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::clearance::least_clearance_all_pairs;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::solve::Chain;
use bench_dragon::show::scene::Scene;

fn main() {
    let scene = Scene::paper();
    let began = Instant::now();
    let timeline = scene.ensemble.timeline(&mut unreported);
    let exact = began.elapsed();
    let contact = timeline.find(EventKind::Contact).map_or(f64::NAN, |contact| contact.time);

    let mut solver = scene.ensemble.solver(scene.velocities);
    let mut chain = Chain::new(scene.ensemble.handles());
    let began = Instant::now();
    let mut samples = 0u32;
    let overlap = (41_000..).map(|hundredths| f64::from(hundredths) / 100.0).find(|time| {
        samples += 1;
        // The motion continues well past the contact.
        solver.solve(*time, &mut chain).is_ok()
            && least_clearance_all_pairs(&chain, scene.ensemble.dragons()[0].motion.team())
                .is_some_and(|least| least.value <= 0.0)
    });
    let a_sample = began.elapsed() / samples;
    let overlap = overlap.unwrap_or(f64::NAN);
    // From the start of the scene on: the samples before 410 s cost as much as those after it.
    let whole = a_sample * (overlap * 100.0) as u32;
    println!("exact: contact at {contact:.12} s, with stall and lock, in {exact:.1?}");
    println!("sampled: first overlap seen at {overlap} s, {:.1} ms late", 1000.0 * (overlap - contact));
    println!(
        "sampling from the start takes {whole:.1?}: {:.0} times as long",
        whole.as_secs_f64() / exact.as_secs_f64()
    );
}
