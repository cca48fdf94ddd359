//! Cost of a frame:
//!
//! - each solver at 60 Hz and 1 kHz, with and without velocities, for teams of 10 to 100,000;
//! - the floor below which no solver can go;
//! - the safe solver beside it in the same run;
//! - whole shows with and without alerts;
//! - the events;
//! - a frame's way into shared memory.
//!
//! `cargo bench --bench frame`

use std::f64::consts::TAU;

use bench_dragon::messages::FrameHeader;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::model::path::Path;
use bench_dragon::motion::model::team::{Ends, Team};
use bench_dragon::motion::solve::newton::Newton;
use bench_dragon::motion::solve::paper::{Paper, PaperRules};
use bench_dragon::motion::solve::selection;
use bench_dragon::motion::solve::table::{FollowerTable, Instructions};
use bench_dragon::motion::solve::{Chain, Solver, Velocities};
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::publisher::live::{Outgoing, Publisher};
use bench_dragon::publisher::transports::iceoryx2::{PublisherConfig, SharedMemoryPublisher};
use bench_dragon::show::convert::stage;
use bench_dragon::show::scene::{AtEnd, Scene};
use bench_dragon::show::{Playback, Show};
use divan::Bencher;
use divan::counter::ItemsCount;

fn main() {
    divan::main();
}

fn team(benches: usize) -> Team {
    Team { benches, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275, ends: Ends::NONE }
}

fn spiral() -> Path {
    Path::spiral(0.55, 16.0)
}

/// Plays the paper scene from 200 s on repeatedly, a frame per call.
fn play(bencher: Bencher, solver: &mut dyn Solver, handles: usize, rate: f64) {
    let mut chain = Chain::new(handles);
    let mut tick = 0.0;
    bencher.counter(ItemsCount::new(handles)).bench_local(|| {
        let time = 200.0 + tick / rate;
        tick = if time < 400.0 { tick + 1.0 } else { 0.0 };
        solver.solve(time, &mut chain).unwrap();
        divan::black_box(&chain);
    });
}

#[divan::bench(args = [60.0, 1000.0], sample_count = 500, sample_size = 20)]
fn newton_cold(bencher: Bencher, rate: f64) {
    play(bencher, &mut Newton::new(spiral(), team(223), 1.0, Velocities::Computed), 224, rate);
}

/// A spiral scene as the show plays it, including the cost of distinguishing the path's kind.
#[divan::bench(args = [60.0, 1000.0], sample_count = 500, sample_size = 20)]
fn scene_on_a_spiral(bencher: Bencher, rate: f64) {
    let scene = bench_dragon::show::scene::Scene::paper();
    play(bencher, scene.ensemble.only().unwrap().solver(scene.velocities).solver.as_mut(), 224, rate);
}

/// The turnaround, with the head from 20 m before its turn on: the team is on spiral, arcs and spiral.
#[divan::bench(args = [60.0, 1000.0], sample_count = 500, sample_size = 20)]
fn newton_on_a_turnaround(bencher: Bencher, rate: f64) {
    let path = Path::turnaround(1.7, 4.5, 2.0, 220.0, 369.16).unwrap();
    play(bencher, &mut Newton::new(path, team(223), 1.0, Velocities::Computed), 224, rate);
}

/// Newton's method with no guess except the link's length over the radius. It works on theta in one double, with the
/// system's sine and cosine: a careful first implementation.
#[divan::bench(sample_count = 500, sample_size = 20)]
fn newton_cold_without_care(bencher: Bencher) {
    let (radius_per_radian, team) = (0.55 / TAU, team(223));
    let mut chain = Chain::new(224);
    let mut tick = 0u32;
    bencher.counter(ItemsCount::new(224usize)).bench_local(|| {
        tick = (tick + 1) % 12_000;
        let mut theta = (32.0 * TAU * 8.0 * TAU - 2.0 * f64::from(tick) / 60.0 / radius_per_radian).sqrt();
        let mut speed = 1.0;
        for bench in 0..223 {
            let link = team.link(bench);
            let mut rear = theta + link / (radius_per_radian * theta);
            let (sine, cosine) = theta.sin_cos();
            let (x, y) = (radius_per_radian * theta * cosine, radius_per_radian * theta * sine);
            let mut across = (0.0, 0.0, 0.0, 0.0);
            for _ in 0..20 {
                let (sine, cosine) = rear.sin_cos();
                let (dx, dy) = (x - radius_per_radian * rear * cosine, y - radius_per_radian * rear * sine);
                let excess = dx * dx + dy * dy - link * link;
                let (tx, ty) = (radius_per_radian * (cosine - rear * sine), radius_per_radian * (sine + rear * cosine));
                across = (dx, dy, tx, ty);
                let step = excess / (-2.0 * (dx * tx + dy * ty));
                rear -= step;
                if step.abs() < 1e-14 * rear {
                    break;
                }
            }
            let (dx, dy, tx, ty) = across;
            let (fx, fy) = (radius_per_radian * (cosine - theta * sine), radius_per_radian * (sine + theta * cosine));
            chain.x[bench] = x;
            chain.y[bench] = y;
            chain.heading[bench] = dy.atan2(dx);
            chain.speed[bench] = speed;
            let length = fx.hypot(fy);
            chain.vx[bench] = -speed * fx / length;
            chain.vy[bench] = -speed * fy / length;
            speed *= (fx * dx + fy * dy) / length / ((tx * dx + ty * dy) / tx.hypot(ty));
            theta = rear;
        }
        divan::black_box(&chain);
    });
}

fn follower_table(benches: usize, velocities: Velocities) -> FollowerTable {
    FollowerTable::new(&spiral(), team(benches), 1.0, velocities, &mut unreported)
        .expect("the paper's spiral has a table")
}

#[divan::bench(args = [60.0, 1000.0], sample_count = 500, sample_size = 20)]
fn table(bencher: Bencher, rate: f64) {
    play(bencher, &mut follower_table(223, Velocities::Computed), 224, rate);
}

#[divan::bench(sample_count = 500, sample_size = 20)]
fn table_without_velocities(bencher: Bencher) {
    play(bencher, &mut follower_table(223, Velocities::Omitted), 224, 60.0);
}

#[divan::bench(sample_count = 500, sample_size = 20)]
fn table_portable(bencher: Bencher) {
    let solver = follower_table(223, Velocities::Computed).with_instructions(Instructions::Portable);
    play(bencher, &mut solver.expect("every processor has it"), 224, 60.0);
}

/// Makes the table, once before the show.
#[divan::bench(args = [223, 5_000, 100_000], sample_count = 5, sample_size = 1)]
fn make_table(benches: usize) -> FollowerTable {
    follower_table(benches, Velocities::Computed)
}

#[divan::bench(args = [10, 100, 223, 1_000, 5_000, 10_000, 20_000, 100_000], sample_count = 200, sample_size = 4)]
fn table_by_benches(bencher: Bencher, benches: usize) {
    play(bencher, &mut follower_table(benches, Velocities::Computed), benches + 1, 60.0);
}

/// Benches and the requested accuracy, metres.
const SIZES: [(usize, f64); 15] = [
    (223, 1e-12),
    (223, 1e-9),
    (223, 1e-4),
    (5_000, 1e-12),
    (5_000, 1e-9),
    (5_000, 1e-4),
    (20_000, 1e-12),
    (20_000, 1e-9),
    (20_000, 1e-4),
    (100_000, 1e-12),
    (100_000, 1e-9),
    (100_000, 1e-4),
    (1_000_000, 1e-12),
    (1_000_000, 1e-9),
    (1_000_000, 1e-4),
];

/// Frames of the table selected for an accuracy; prints the bytes that a frame reads for a handle, and the time for
/// making the table.
#[divan::bench(args = SIZES, sample_count = 100, sample_size = 4)]
fn accuracy_by_benches(bencher: Bencher, (benches, accuracy): (usize, f64)) {
    let selected = selection::cheapest(&spiral(), team(benches), 1.0, Velocities::Computed, accuracy, &mut unreported);
    let Some(selected) = selected else { return eprintln!("{benches} benches at {accuracy:e} m: no table fits") };
    eprintln!(
        "{benches} benches at {accuracy:e} m: {}, {:.0} bytes a handle, {:.1} MB, made in {:.0} ms",
        selected.table.format(),
        selected.table.bytes_per_handle(),
        1e-6 * selected.table.memory_bytes() as f64,
        1e3 * selected.made_in.as_secs_f64()
    );
    play(bencher, &mut selected.table.for_frames(), benches + 1, 60.0);
}

#[divan::bench(args = [10, 100, 223, 1_000, 5_000, 10_000, 20_000, 100_000], sample_count = 20, sample_size = 1)]
fn newton_by_benches(bencher: Bencher, benches: usize) {
    play(bencher, &mut Newton::new(spiral(), team(benches), 1.0, Velocities::Computed), benches + 1, 60.0);
}

/// Whole frames of the paper scene's show as the live loop makes them, with and without the optional parts of a scene.
#[divan::bench(args = ["bare", "velocities", "alerts", "alerts and velocities"], sample_count = 500, sample_size = 20)]
fn show(bencher: Bencher, with: &str) {
    let mut scene = Scene::paper();
    if !with.contains("alerts") {
        scene.alerts = None;
    }
    scene.velocities = if with.contains("velocities") { Velocities::Computed } else { Velocities::Omitted };
    let timeline = scene.ensemble.timeline(&mut unreported);
    let playback = Playback { start: 200.0, at_end: AtEnd::Loop, end_hold: 0.0, ..Playback::of(&scene) };
    let mut show = Show::new(&scene, timeline, playback).expect("200 s is before the contact");
    let mut tick = 0;
    bencher.bench_local(|| {
        tick += 1;
        divan::black_box(show.frame(tick));
    });
}

/// The same at the greatest cost of the clearance. The nearest boards are about as near as every pair on two turns, so
/// no bench can be left out.
#[divan::bench(sample_count = 500, sample_size = 4)]
fn show_where_every_turn_is_as_near(bencher: Bencher) {
    let scene = Scene::paper();
    let timeline = scene.ensemble.timeline(&mut unreported);
    let playback = Playback { start: 156.0, rate: 1000.0, ..Playback::of(&scene) };
    let mut show = Show::new(&scene, timeline, playback).expect("156 s is before the contact");
    let mut tick = 0;
    bencher.bench_local(|| {
        tick += 1;
        show.frame(tick).state
    });
}

/// The events of the paper scene, contact, stall and lock: found once, before the show.
#[divan::bench(sample_count = 20, sample_size = 1)]
fn events() -> Timeline {
    Scene::paper().ensemble.timeline(&mut unreported)
}

/// A frame into iceoryx2's shared memory, without solving.
#[divan::bench(sample_count = 500, sample_size = 20)]
fn publish_over_iceoryx2(bencher: Bencher) {
    let scene = Scene::paper();
    let playback = Playback { start: 200.0, ..Playback::of(&scene) };
    let mut show =
        Show::new(&scene, scene.ensemble.timeline(&mut unreported), playback).expect("200 s is before the contact");
    let config = PublisherConfig {
        name: format!("bench_{}_frame", std::process::id()),
        handles: scene.ensemble.handles(),
        single_precision: None,
        queue: 64,
        subscribers: 8,
        alerts: true,
        cues: 0,
        scene: String::new(),
        stage: stage(1, 0, [0; 32], &scene.ensemble, &show),
    };
    let mut publisher = SharedMemoryPublisher::open(&config).expect("the name holds this process's number");
    let frame = show.frame(0);
    let header = FrameHeader { handles: 224, ..FrameHeader::default() };
    bencher
        .bench_local(|| publisher.publish(Outgoing::new(&header, frame)).expect("no other process uses this service"));
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn paper(bencher: Bencher) {
    let path = spiral();
    let (spiral, start) = path.as_spiral().expect("the paper's path is a spiral");
    let mut solver = Paper::new(*spiral, start.high, team(223), 1.0, Velocities::Computed, PaperRules::default());
    play(bencher, &mut solver, 224, 60.0);
}

/// The floor: the sine and cosine of 224 angles, vectorised, and writing the bytes of a frame.
#[divan::bench(sample_count = 500, sample_size = 20)]
fn floor(bencher: Bencher) {
    let angles: Vec<f64> = (0..224).map(|k| f64::from(k) * 0.19).collect();
    let mut chain = Chain::new(224);
    bencher.counter(ItemsCount::new(224usize)).bench_local(|| {
        floor::frame(divan::black_box(&angles), &mut chain);
        divan::black_box(&chain);
    });
}

mod floor {
    //! The least work of any frame, with the same instructions as the measured solver.

    use super::Chain;

    pub fn frame(angles: &[f64], chain: &mut Chain) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the processor has just been found to have both.
            return unsafe { frame_with_avx2(angles, chain) };
        }
        written(angles, chain);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn frame_with_avx2(angles: &[f64], chain: &mut Chain) {
        written(angles, chain);
    }

    #[inline(always)]
    fn written(angles: &[f64], chain: &mut Chain) {
        let count = angles.len();
        let (x, y, heading) = (&mut chain.x[..count], &mut chain.y[..count], &mut chain.heading[..count]);
        let (speed, vx, vy) = (&mut chain.speed[..count], &mut chain.vx[..count], &mut chain.vy[..count]);
        for k in 0..count {
            let (sine, cosine) = sine_cosine(angles[k]);
            x[k] = cosine;
            y[k] = sine;
            heading[k] = angles[k];
            speed[k] = 1.0;
            vx[k] = -sine;
            vy[k] = cosine;
        }
    }

    /// Returns sine and cosine by Cody and Waite's reduction and the polynomials of fdlibm.
    #[inline(always)]
    #[allow(clippy::excessive_precision, reason = "the digits as published")]
    fn sine_cosine(angle: f64) -> (f64, f64) {
        const ROUNDER: f64 = 6_755_399_441_055_744.0;
        let shifted = angle.mul_add(std::f64::consts::FRAC_2_PI, ROUNDER);
        let quadrant = shifted.to_bits();
        let whole = shifted - ROUNDER;
        let z = whole.mul_add(-6.123_233_995_736_766e-17, whole.mul_add(-std::f64::consts::FRAC_PI_2, angle));
        let square = z * z;
        let sine = [2.75573137070700676789e-06, -1.98412698298579493134e-04, 8.33333333332248946124e-03]
            .into_iter()
            .fold(1.58969099521155010221e-10f64.mul_add(square, -2.50507602534068634195e-08), |value, next| {
                value.mul_add(square, next)
            })
            .mul_add(square, -1.66666666666666324348e-01);
        let cosine = [-2.75573143513906633035e-07, 2.48015872894767294178e-05, -1.38888888888741095749e-03]
            .into_iter()
            .fold((-1.13596475577881948265e-11f64).mul_add(square, 2.08757232129817482790e-09), |value, next| {
                value.mul_add(square, next)
            })
            .mul_add(square, 4.16666666666666019037e-02);
        let sine = (z * square).mul_add(sine, z);
        let cosine = (square * square).mul_add(cosine, 1.0 - 0.5 * square);
        let (s, c) = if quadrant & 1 == 1 { (cosine, sine) } else { (sine, cosine) };
        let negate = |number: f64, quadrant: u64| f64::from_bits(number.to_bits() ^ ((quadrant & 2) << 62));
        (negate(s, quadrant), negate(c, quadrant.wrapping_add(1)))
    }
}
