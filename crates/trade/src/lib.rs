//! Accuracy against cost: measures every solver on one dragon and this machine, against the high-precision reference.
//!
//! In: a dragon and its timeline. Out: one [`Measurement`] per solver. The `trade` command prints and draws them, with
//! the results of [`display`]: the error at the time of display against bytes per second.

mod candidates;
mod collision;
pub mod display;

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use serde::Serialize;

use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::linkage::NoFollower;
use bench_dragon_motion::model::Point;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::separation::separation_board_board;
use bench_dragon_motion::solve::paper::PaperRules;
use bench_dragon_motion::solve::reference::{Reference, ReferenceError, ReferenceHandle};
use bench_dragon_motion::solve::{Chain, Solver, Velocities};
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_motion::{Method, Motion, MotionError};

/// The number of samples of the error, spread evenly over the motion before its last second.
pub const SPREAD_SAMPLES: usize = 200;
/// The number of further samples, spread evenly over the last second of the motion.
pub const LAST_SECOND_SAMPLES: usize = 10;
/// Warm-up frames before each sample, as in a running show.
const WARM_UP_FRAMES: usize = 4;
/// Limit of timed frames per solver, for slow solvers and long shows.
const TIMED_FRAMES: usize = 26_000;
/// Limit of the time to measure one solver, in seconds.
const TIMING_LIMIT: f64 = 0.7;

/// The reason for a missing measurement.
#[derive(Debug, thiserror::Error)]
pub enum TradeError {
    /// There is no reference.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// The reference has no solution at this simulated time, in seconds.
    #[error("the reference at {0} s: {1}")]
    NoReference(f64, NoFollower),
    /// The second thread of the reference has panicked.
    #[error("the reference's second thread panicked")]
    Panicked,
    /// The exact motion is impossible.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// A solver has no solution at this simulated time, in seconds.
    #[error("the chain at {0} s: {1}")]
    NoChain(f64, NoFollower),
    /// The receiver of the progress has stopped it.
    #[error("the measurement was stopped")]
    Stopped,
}

/// The cost and the error of one solver.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measurement {
    /// The solver and its settings.
    pub solver: String,
    /// The requested accuracy, in metres; `None` for a solver that is not selected by accuracy.
    pub accuracy: Option<f64>,
    /// True if the requested accuracy is met, except where the motion itself amplifies rounding: see
    /// [`Measurement::noise`].
    pub meets: Option<bool>,
    /// The time of a frame, in nanoseconds: the median over the motion, without the time of reading the clock.
    pub frame_ns: f64,
    /// The time of a frame, in nanoseconds: the 99th percentile.
    pub frame_ns_p99: f64,
    /// The number of timed frames, in runs evenly over the motion.
    pub frames_timed: usize,
    /// The greatest distance of a handle from its true position, in metres.
    pub max_position_error: f64,
    /// The error, in metres, below which errors are rounding: the greatest 8 eps (r + distance travelled) max(1, ratio
    /// of the handle's speed to the head's) at any sample. It is the same for all solvers.
    pub noise: f64,
    /// The greatest relative error of a handle's speed; `None` without velocities.
    pub max_speed_error: Option<f64>,
    /// The error of this solver's contact time, in seconds; `None` without a contact.
    pub contact_time_error: Option<f64>,
    /// The greatest error of a link's length, in metres.
    pub max_link_error: f64,
    /// Memory of the solver, in bytes.
    pub memory_bytes: usize,
    /// Table bytes that a frame reads per handle; `None` for a solver without a table.
    pub bytes_per_handle: Option<f64>,
    /// The time to make the solver, once, including its measurements, in seconds.
    pub make_s: f64,
    /// The cost of collision search; only with the first solver.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub collision: Vec<CollisionMeasurement>,
    /// True if no other solver is both faster and more exact. Errors below the noise are equal.
    pub on_front: bool,
}

/// The cost of one method of collision search, and its error of the contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CollisionMeasurement {
    /// The method.
    pub method: String,
    /// The time of a frame for the least clearance, in nanoseconds; `None` for a search.
    pub frame_ns: Option<f64>,
    /// The time to find the contact from the start of the scene, in seconds.
    pub search_s: Option<f64>,
    /// Delay of the contact that it finds, in seconds; `None` without a contact, and for a method per frame.
    pub contact_time_error: Option<f64>,
}

/// A solver to measure.
struct Candidate {
    name: String,
    /// Frames played before a measured one.
    warm_up_frames: usize,
    solver: Box<dyn Solver>,
    contact_time_error: Option<f64>,
    accuracy: Option<f64>,
    memory_bytes: usize,
    bytes_per_handle: Option<f64>,
    make_s: f64,
}

/// A dragon, measured alone in its own time.
#[derive(Debug, Clone)]
pub struct Subject {
    /// Its motion.
    pub motion: Motion,
    /// The velocities: computed or not.
    pub velocities: Velocities,
    /// The rate, in frames per second.
    pub rate: f64,
    /// True if its show stops at a contact.
    pub stops_at_contact: bool,
}

/// The true positions at one time.
struct ReferenceSample {
    time: f64,
    handles: Vec<ReferenceHandle>,
}

/// Measures every solver on `subject`. `progress` receives the share of the work that is done, from 0 to 1.
///
/// # Errors
/// The reference has no solution, or `progress` has stopped the measurement.
pub fn measure(subject: &Subject, timeline: &Timeline, progress: Progress<'_>) -> Result<Vec<Measurement>, TradeError> {
    let end = timeline.end().time;
    let samples = truth(subject, end, &mut |share| progress(0.5 * share))?;
    let contact = contact_errors(subject, timeline)?;
    let noise = noise(subject, &samples);
    let candidates = candidates::candidates(subject, contact, &mut |_| progress(0.5));
    go_on(progress(0.5))?;
    let count = candidates.len() as f64;
    let mut measurements = Vec::new();
    for (index, candidate) in candidates.into_iter().enumerate() {
        measurements.push(measured(subject, candidate, &samples, noise, end));
        go_on(progress(0.5 + 0.5 * (index + 1) as f64 / count))?;
    }
    mark_pareto_front(&mut measurements);
    if let Some(first) = measurements.first_mut() {
        first.collision = collision::measure(subject, timeline, first.contact_time_error, first.frame_ns);
    }
    Ok(measurements)
}

/// Converts the answer of a progress's receiver.
fn go_on(answer: ControlFlow<()>) -> Result<(), TradeError> {
    if answer.is_break() { Err(TradeError::Stopped) } else { Ok(()) }
}

/// Returns the high-precision reference of a dragon.
fn reference(subject: &Subject) -> Result<Reference, TradeError> {
    let motion = &subject.motion;
    Ok(Reference::new(*motion.team(), motion.description(), motion.head_speed())?)
}

/// Returns the reference at all samples. At the lock itself the solution is lost in rounding, so the last sample is a
/// thousandth of a second earlier.
fn truth(subject: &Subject, end: f64, progress: Progress<'_>) -> Result<Vec<ReferenceSample>, TradeError> {
    let last_second = 1f64.min(0.5 * end);
    let spread = (0..SPREAD_SAMPLES).map(|k| (end - last_second) * k as f64 / SPREAD_SAMPLES as f64);
    let last = (0..LAST_SECOND_SAMPLES)
        .map(|k| end - last_second + (last_second * 0.999) * k as f64 / (LAST_SECOND_SAMPLES - 1) as f64);
    let times: Vec<f64> = spread.chain(last).collect();
    let (first, second) = times.split_at(times.len() / 2);
    let is_stopped = AtomicBool::new(false);
    let stopped = || match is_stopped.load(Ordering::Relaxed) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    std::thread::scope(|scope| {
        let second = scope.spawn(|| samples(subject, second, &mut |_| stopped()));
        let first = samples(subject, first, progress);
        is_stopped.store(first.is_err(), Ordering::Relaxed);
        let mut all = first?;
        all.extend(second.join().map_err(|_| TradeError::Panicked)??);
        Ok(all)
    })
}

fn samples(subject: &Subject, times: &[f64], progress: Progress<'_>) -> Result<Vec<ReferenceSample>, TradeError> {
    let mut reference = reference(subject)?;
    let mut samples = Vec::with_capacity(times.len());
    for &time in times {
        let handles = reference.handles(time).map_err(|none| TradeError::NoReference(time, none))?;
        samples.push(ReferenceSample { time, handles });
        go_on(progress(samples.len() as f64 / times.len() as f64))?;
    }
    Ok(samples)
}

/// Returns an upper bound of the rounding of a pose: see [`Measurement::noise`].
fn noise(subject: &Subject, samples: &[ReferenceSample]) -> f64 {
    let speed = subject.motion.head_speed();
    let of_handle = |time: f64, handle: &ReferenceHandle| {
        let reach = handle.x.high.hypot(handle.y.high) + speed * time;
        8.0 * f64::EPSILON * reach * (handle.speed / speed).abs().max(1.0)
    };
    let all = samples.iter().flat_map(|sample| sample.handles.iter().map(|handle| of_handle(sample.time, handle)));
    all.fold(0.0, f64::max)
}

/// Errors of the contact times of the exact motion and of the paper's rule, in seconds.
#[derive(Debug, Clone, Copy)]
struct ContactErrors {
    exact: f64,
    paper: f64,
}

/// Returns the errors of the contact's time. The exact motion's error is the gap of the two boards in the reference at
/// that time, divided by the closing speed. Returns `None` without a contact, or if the contact is at the very start.
fn contact_errors(subject: &Subject, timeline: &Timeline) -> Result<Option<ContactErrors>, TradeError> {
    let Some(contact) = timeline.find(EventKind::Contact) else { return Ok(None) };
    let (Some(a), Some(b)) = (contact.event.bench_a, contact.event.bench_b) else { return Ok(None) };
    let time = contact.event.travelled / subject.motion.head_speed();
    if time == 0.0 {
        return Ok(None);
    }
    let mut reference = reference(subject)?;
    let mut gap = |time: f64| {
        let handles = reference.handles(time).map_err(|none| TradeError::NoReference(time, none))?;
        let board = |bench: u32| {
            let point = |handle: usize| Point::new(handles[handle].x.high, handles[handle].y.high);
            let (front, rear) = (point(bench as usize), point(bench as usize + 1));
            Board::from_handles(
                front,
                rear,
                subject.motion.team().hole_inset,
                subject.motion.team().board_width(bench as usize),
            )
        };
        Ok::<f64, TradeError>(separation_board_board(&board(a), &board(b)))
    };
    let interval = 1e-7 * time;
    let closing = (gap(time - interval)? - gap(time)?) / interval;
    let exact = (gap(time)? / closing).abs();
    let of_paper = subject.motion.with_method(Method::Paper(PaperRules::default()));
    let paper = of_paper.map_or(f64::NAN, |motion| (motion.time_at(contact.event.travelled) - time).abs());
    Ok(Some(ContactErrors { exact, paper }))
}

fn measured(
    subject: &Subject,
    mut candidate: Candidate,
    samples: &[ReferenceSample],
    noise: f64,
    end: f64,
) -> Measurement {
    let errors = errors(subject, &mut candidate, samples);
    let mut times = frame_times(subject, candidate.solver.as_mut(), end);
    times.sort_unstable();
    let quantile = |share| quantile(&times, share);
    Measurement {
        solver: candidate.name,
        accuracy: candidate.accuracy,
        meets: candidate.accuracy.map(|accuracy| errors.position <= accuracy.max(noise)),
        frame_ns: quantile(0.5),
        frame_ns_p99: quantile(0.99),
        frames_timed: times.len(),
        max_position_error: errors.position,
        noise,
        max_speed_error: (subject.velocities == Velocities::Computed).then_some(errors.speed),
        contact_time_error: candidate.contact_time_error,
        max_link_error: errors.link,
        memory_bytes: candidate.memory_bytes,
        bytes_per_handle: candidate.bytes_per_handle,
        make_s: candidate.make_s,
        collision: Vec::new(),
        on_front: false,
    }
}

/// Returns the time below which a share of sorted times lies, in nanoseconds; NaN without times.
fn quantile(times: &[u64], share: f64) -> f64 {
    times.get((share * times.len() as f64) as usize).map_or(f64::NAN, |ns| *ns as f64)
}

/// Returns the nanoseconds per frame of the solver chosen for `subject`, the median over the show, as
/// [`Measurement::frame_ns`].
pub fn publisher_frame_ns(subject: &Subject, timeline: &Timeline) -> f64 {
    let mut solver = subject.motion.solver(subject.velocities).solver;
    let mut times = frame_times(subject, solver.as_mut(), timeline.end().time);
    times.sort_unstable();
    quantile(&times, 0.5)
}

#[derive(Default)]
struct Errors {
    position: f64,
    speed: f64,
    link: f64,
}

fn errors(subject: &Subject, candidate: &mut Candidate, samples: &[ReferenceSample]) -> Errors {
    let mut chain = Chain::new(subject.motion.team().handles());
    let mut worst = Errors::default();
    for sample in samples {
        for frame in (0..=candidate.warm_up_frames).rev() {
            let time = (sample.time - frame as f64 / subject.rate).max(0.0);
            // The paper's solver is ahead of the truth, so it locks a little earlier. All samples from there on are
            // left out.
            if candidate.solver.solve(time, &mut chain).is_err() {
                return worst;
            }
        }
        for (i, truth) in sample.handles.iter().enumerate() {
            let error = truth.x.error_of(chain.x[i]).hypot(truth.y.error_of(chain.y[i]));
            worst.position = worse(worst.position, error);
            worst.speed = worse(worst.speed, ((chain.speed[i] - truth.speed) / truth.speed).abs());
        }
        for bench in 0..subject.motion.team().benches {
            let (dx, dy) = (chain.x[bench + 1] - chain.x[bench], chain.y[bench + 1] - chain.y[bench]);
            worst.link = worse(worst.link, (dx.hypot(dy) - subject.motion.team().link(bench)).abs());
        }
    }
    worst
}

/// Returns the greater of two errors. NaN is the worst.
fn worse(one: f64, other: f64) -> f64 {
    if one >= other || one.is_nan() { one } else { other }
}

/// Returns the nanoseconds of each frame. If there are too many frames, or the solver is too slow for all, runs of
/// frames evenly over the show are timed.
fn frame_times(subject: &Subject, solver: &mut dyn Solver, end: f64) -> Vec<u64> {
    const RUN: usize = 50;
    let mut chain = Chain::new(subject.motion.team().handles());
    let frames = (end * subject.rate) as usize;
    let began = Instant::now();
    let _ = solver.solve(0.0, &mut chain);
    for frame in 1..=20 {
        let _ = solver.solve(frame as f64 / subject.rate, &mut chain);
    }
    let each = began.elapsed().as_secs_f64() / 21.0;
    let wanted = TIMED_FRAMES.min((TIMING_LIMIT / each) as usize).clamp(RUN, frames.max(RUN));
    let runs = wanted.div_ceil(RUN);
    let clock = clock_ns();
    let mut times = Vec::with_capacity(runs * RUN);
    for run in 0..runs {
        let first = frames.saturating_sub(RUN) * run / runs.max(2).saturating_sub(1);
        for k in 0..RUN + 3 {
            let time = (first + k) as f64 / subject.rate;
            let begun = Instant::now();
            let solved = time <= end && solver.solve(time, &mut chain).is_ok();
            let nanoseconds = (begun.elapsed().as_nanos() as u64).saturating_sub(clock);
            // The first frames of a run follow a jump.
            if solved && (k >= 3 || run == 0) {
                times.push(nanoseconds);
            }
        }
        if run > 0 && began.elapsed().as_secs_f64() > 2.0 * TIMING_LIMIT {
            break;
        }
    }
    times
}

/// Returns the nanoseconds that reading the clock adds to a measured time, the median of many.
fn clock_ns() -> u64 {
    let mut times: Vec<u64> = (0..1001).map(|_| Instant::now().elapsed().as_nanos() as u64).collect();
    times.sort_unstable();
    times[times.len() / 2]
}

fn mark_pareto_front(measurements: &mut [Measurement]) {
    let points: Vec<(f64, f64)> =
        measurements.iter().map(|m| (m.frame_ns, m.max_position_error.max(m.noise))).collect();
    for (measurement, on_front) in measurements.iter_mut().zip(pareto_front(&points)) {
        measurement.on_front = on_front;
    }
}

/// Returns the points on the Pareto front of cost and error: no other point is less in one and not greater in the
/// other.
fn pareto_front(points: &[(f64, f64)]) -> Vec<bool> {
    let is_beaten =
        |(cost, error): &(f64, f64)| points.iter().any(|(c, e)| c <= cost && e <= error && (c < cost || e < error));
    points.iter().map(|point| !is_beaten(point)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_solvers_below_the_noise_only_the_cheaper_is_optimal() {
        let measurement = |frame_ns, max_position_error| Measurement {
            solver: String::new(),
            accuracy: None,
            meets: None,
            frame_ns,
            frame_ns_p99: frame_ns,
            frames_timed: 1,
            max_position_error,
            noise: 1e-12,
            max_speed_error: None,
            contact_time_error: None,
            max_link_error: 0.0,
            memory_bytes: 0,
            bytes_per_handle: None,
            make_s: 0.0,
            collision: Vec::new(),
            on_front: false,
        };
        let mut measurements = [(100.0, 8e-13), (200.0, 3e-13), (50.0, 1e-4), (70.0, 1e-3), (300.0, f64::NAN)]
            .map(|(frame_ns, error)| measurement(frame_ns, error));
        mark_pareto_front(&mut measurements);
        assert_eq!(measurements.map(|m| m.on_front), [true, false, true, false, false]);
    }
}
