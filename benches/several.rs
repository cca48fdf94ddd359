//! Cost of a frame of several dragons beside as many frames of one, with and without the clearance. All shows are
//! measured in turn, some frames of each, in one run; the figures are medians.
//!
//! `cargo bench --bench several`, or with some of the cases: `cargo bench --bench several -- coil`

use std::hint::black_box;
use std::time::Instant;

use bench_dragon::motion::event::unreported;
use bench_dragon::show::scene::Scene;
use bench_dragon::show::{Playback, Show};

/// Start of the shows, simulated seconds; the shows play at 60 Hz from there.
const START: f64 = 100.0;
/// Frames of a show before the turn of the next show.
const BATCH: u64 = 4;
/// Rounds of all shows, and those before the first that counts.
const ROUNDS: u64 = 2_500;
const WARM_UP: u64 = 50;
/// Cases: name, dragons, and whether they coil in pairs or are all far from each other.
const CASES: [(&str, usize, bool); 5] = [
    ("two far apart", 2, false),
    ("two that coil", 2, true),
    ("four that coil", 4, true),
    ("16 far apart", 16, false),
    ("16 that coil", 16, true),
];

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).collect();
    println!(
        "Of a dragon with 223 benches, us.\n\n\
         | dragons | frame | as many of one | ratio | with clearance | as many of one | between dragons |\n\
         |---|---|---|---|---|---|---|"
    );
    for (name, dragons, coil) in CASES {
        if wanted.is_empty() || wanted.iter().any(|word| name.contains(word)) {
            measure(name, dragons, coil);
        }
    }
}

/// Returns the tables of a dragon: in pairs that coil, or alone.
fn dragon(number: usize, coil: bool, table: &str) -> String {
    let place = if coil { number / 2 } else { number };
    let turns = if coil && number % 2 == 1 { 0.5 } else { 0.0 };
    let origin = [300.0 * (place % 4) as f64, 300.0 * (place / 4) as f64];
    format!(
        "placement = {{ origin = {origin:?}, rotation_turns = {turns:?} }}\n\
         [{table}team]\nbenches = 223\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n\
         [{table}path]\nkind = \"spiral\"\npitch = 1.7\nstart_turn = 8\n[{table}motion]\nhead_speed = 1.0\n"
    )
}

fn several(dragons: usize, coil: bool) -> Scene {
    let named = |number: usize| format!("[[dragons]]\nname = \"d{number}\"\n{}", dragon(number, coil, "dragons."));
    let text = format!("[alerts]\n{}", (0..dragons).map(named).collect::<String>());
    Scene::parse(&text, "several.toml", "several").expect("a scene of several")
}

fn one(number: usize, coil: bool) -> Scene {
    let tables = dragon(number, coil, "");
    let (placement, tables) = tables.split_once('\n').expect("several lines");
    let placement =
        placement.trim_start_matches("placement = {").trim_end_matches('}').replace(", rotation", "\nrotation");
    let text = format!("[alerts]\n[placement]\n{placement}\n{tables}");
    Scene::parse(&text, "one.toml", "one").expect("a scene of one")
}

fn show(scene: &Scene, alerts: bool) -> Show {
    let scene = Scene { alerts: scene.alerts.filter(|_| alerts), ..scene.clone() };
    // A search for contacts would take long, and there is none before the end.
    let playback = Playback { start: START, ..Playback::of(&scene) };
    Show::new(&scene, scene.ensemble.timeline_without_contact(&mut unreported), playback)
        .expect("100 s is before the end")
}

fn measure(name: &str, dragons: usize, coil: bool) {
    let (all, each) = (several(dragons, coil), Vec::from_iter((0..dragons).map(|number| one(number, coil))));
    let mut of_all = [false, true].map(|alerts| vec![show(&all, alerts)]);
    let mut of_each = [false, true].map(|alerts| Vec::from_iter(each.iter().map(|scene| show(scene, alerts))));
    let mut times: [Vec<f64>; 4] = Default::default();
    for round in 0..ROUNDS {
        let [bare_all, with_all] = &mut of_all;
        let [bare_each, with_each] = &mut of_each;
        for (times, shows) in times.iter_mut().zip([bare_all, bare_each, with_all, with_each]) {
            let begun = Instant::now();
            for show in shows {
                for tick in round * BATCH..(round + 1) * BATCH {
                    black_box(show.frame(tick));
                }
            }
            if round >= WARM_UP {
                times.push(1e6 * begun.elapsed().as_secs_f64() / BATCH as f64);
            }
        }
    }
    let [frame, frames, with, withs] = times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    println!(
        "| {name} | {frame:.2} | {frames:.2} | {:.2} | {with:.2} | {withs:.2} | {:.2} |",
        frame / frames,
        with - withs
    );
}
