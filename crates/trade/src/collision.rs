//! The cost of collision search of a dragon: per frame, the live clearance and all pairs; per show, the exact search and
//! sampled searches.

use std::time::Instant;

use super::{CollisionMeasurement, Subject};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::clearance::least_clearance_all_pairs;
use bench_dragon_motion::ensemble::Ensemble;
use bench_dragon_motion::event::unreported;
use bench_dragon_motion::solve::Chain;
use bench_dragon_motion::timeline::Timeline;

/// Sampling intervals of the sampled contact searches, in seconds.
const SAMPLING_INTERVALS: [f64; 3] = [1.0, 0.1, 0.01];

/// Measures all pairs against the live clearance, and sampled searches against the exact search. `exact_error` is the
/// error of the contact in `timeline`, `solve_ns` the time per frame of the first solver measured.
pub(super) fn measure(
    subject: &Subject,
    timeline: &Timeline,
    exact_error: Option<f64>,
    solve_ns: f64,
) -> Vec<CollisionMeasurement> {
    if subject.motion.team().benches < 3 {
        return Vec::new();
    }
    let end = timeline.end().time;
    let frame_cost = |method: &str, ns: f64| CollisionMeasurement {
        method: method.to_owned(),
        frame_ns: Some(ns),
        search_s: None,
        contact_time_error: None,
    };
    let live = live_clearance_ns(subject, end);
    let all_pairs = all_pairs_ns(subject, end);
    let mut measurements = vec![frame_cost("live clearance", live), frame_cost("all pairs", all_pairs)];
    let began = Instant::now();
    let _ = Ensemble::alone(subject.motion.clone()).timeline(&mut unreported);
    measurements.push(CollisionMeasurement {
        method: "exact search".to_owned(),
        frame_ns: None,
        search_s: Some(began.elapsed().as_secs_f64()),
        contact_time_error: exact_error,
    });
    let Some(contact) = timeline.find(EventKind::Contact) else { return measurements };
    for interval in SAMPLING_INTERVALS {
        let found = first_overlapping_sample(subject, contact.time, end, interval);
        measurements.push(CollisionMeasurement {
            method: format!("all pairs every {interval} s"),
            frame_ns: None,
            search_s: Some(1e-9 * (all_pairs + solve_ns) * (found.unwrap_or(end) / interval)),
            contact_time_error: found.map(|time| time - contact.time),
        });
    }
    measurements
}

/// Returns the first sample at or after `contact` at which boards overlap, in simulated seconds.
fn first_overlapping_sample(subject: &Subject, contact: f64, end: f64, interval: f64) -> Option<f64> {
    let mut solver = subject.motion.in_own_frame().solver(subject.velocities).solver;
    let mut chain = Chain::new(subject.motion.team().handles());
    let first = (contact / interval).ceil() as u64;
    (first..first + 1000).map(|sample| sample as f64 * interval).take_while(|time| *time < end).find(|time| {
        solver.solve(*time, &mut chain).is_ok()
            && least_clearance_all_pairs(&chain, subject.motion.team()).is_some_and(|least| least.value <= 0.0)
    })
}

/// Returns the nanoseconds of the live clearance: the median over runs of frames, evenly over the show.
fn live_clearance_ns(subject: &Subject, end: f64) -> f64 {
    const RUNS: usize = 20;
    const RUN: usize = 40;
    let motion = subject.motion.in_own_frame();
    let mut choice = motion.solver(subject.velocities);
    let mut chain = Chain::new(motion.team().handles());
    let mut monitor = motion.clearance_monitor(&choice);
    let mut times = Vec::with_capacity(RUNS * RUN);
    for run in 0..RUNS {
        for frame in 0..RUN {
            let time = 0.99 * end * run as f64 / RUNS as f64 + frame as f64 / subject.rate;
            if time >= end || choice.solver.solve(time, &mut chain).is_err() {
                break;
            }
            let began = Instant::now();
            let _ = std::hint::black_box(monitor.nearest(&chain, time, f64::INFINITY, choice.solver.as_mut()));
            // The first frame of a run follows a jump.
            if frame > 0 {
                times.push(began.elapsed().as_nanos() as u64);
            }
        }
    }
    median(times)
}

/// Returns the nanoseconds of all pairs: the median over a few frames of the show.
fn all_pairs_ns(subject: &Subject, end: f64) -> f64 {
    let mut solver = subject.motion.solver(subject.velocities).solver;
    let mut chain = Chain::new(subject.motion.team().handles());
    let mut times = Vec::new();
    for share in [0.1, 0.3, 0.5, 0.7, 0.9] {
        if solver.solve(share * end, &mut chain).is_ok() {
            let began = Instant::now();
            let _ = std::hint::black_box(least_clearance_all_pairs(&chain, subject.motion.team()));
            times.push(began.elapsed().as_nanos() as u64);
        }
    }
    median(times)
}

fn median(mut times: Vec<u64>) -> f64 {
    times.sort_unstable();
    times.get(times.len() / 2).map_or(f64::NAN, |nanoseconds| *nanoseconds as f64)
}
