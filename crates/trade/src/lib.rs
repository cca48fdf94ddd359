//! Accuracy against cost, measured: every solver on one scene and this machine, against the high-precision reference.
//!
//! In: a scene and its timeline. Out: one [`Measurement`] per solver. The `trade` command prints and draws them, and
//! what [`display`] measures: the error at the moment of display against bytes per second.

mod candidates;
mod collision;
pub mod display;

use std::time::Instant;

use serde::Serialize;

use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::Method;
use bench_dragon_motion::model::Point;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::separation::separation_board_board;
use bench_dragon_motion::solve::paper::PaperRules;
use bench_dragon_motion::solve::reference::{Reference, ReferenceHandle};
use bench_dragon_motion::solve::{Chain, Solver, Velocities};
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_show::scene::Scene;

/// Moments at which the error is taken, spread evenly over the show.
pub const SPREAD_MOMENTS: usize = 200;
/// Further moments, spread evenly over its last second.
pub const LAST_SECOND_MOMENTS: usize = 10;
/// Frames of warming up before each moment: it is a running show that is measured.
const WARM_UP_FRAMES: usize = 4;
/// The most frames that are timed, so that slow solvers and long shows end too.
const TIMED_FRAMES: usize = 26_000;
/// The longest time spent timing one solver, seconds.
const TIMING_LIMIT: f64 = 0.7;

/// What one solver costs and how far it is off.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measurement {
    /// The solver and its settings.
    pub solver: String,
    /// The requested accuracy, metres; `None` for a solver that is not chosen by its accuracy.
    pub accuracy: Option<f64>,
    /// True if the wish is met wherever the motion itself does not multiply roundings by more; see
    /// [`Measurement::noise`].
    pub meets: Option<bool>,
    /// Nanoseconds per frame, the median over the show, without what reading the clock costs.
    pub frame_ns: f64,
    /// Nanoseconds per frame that 99 of 100 frames stay below.
    pub frame_ns_p99: f64,
    /// Frames that were timed, evenly over the show in runs.
    pub frames_timed: usize,
    /// The largest distance of a handle from the truth, metres.
    pub max_position_error: f64,
    /// Metres below which errors are rounding: the most that 8 eps (r + distance travelled) is at any moment, times the
    /// speed of the handle over that of the head where that is more. The same for all solvers.
    pub noise: f64,
    /// The largest relative error of a handle's speed; `None` without velocities.
    pub max_speed_error: Option<f64>,
    /// Seconds by which this solver's contact is off; `None` where there is no contact.
    pub contact_time_error: Option<f64>,
    /// The largest error of a link's length, metres.
    pub max_link_error: f64,
    /// Bytes that the solver holds.
    pub memory_bytes: usize,
    /// Bytes of a table that a frame reads for a handle; `None` for a solver without one.
    pub bytes_per_handle: Option<f64>,
    /// Seconds that making the solver takes, once, measuring included.
    pub make_s: f64,
    /// What collisions cost on this scene; stands with the first solver only.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub collision: Vec<CollisionMeasurement>,
    /// True if no other solver is both faster and more exact; errors below the noise are equal.
    pub on_front: bool,
}

/// What one way to look for collisions costs and by how much it misses the contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CollisionMeasurement {
    /// The way.
    pub method: String,
    /// Nanoseconds per frame for the least clearance; `None` for a search.
    pub frame_ns: Option<f64>,
    /// Seconds that finding the contact takes from the start of the scene.
    pub search_s: Option<f64>,
    /// Seconds by which it finds the contact too late; `None` where there is none, and for a way that looks at frames.
    pub contact_time_error: Option<f64>,
}

/// A solver to be measured.
struct Candidate {
    name: String,
    /// Frames played before one that is measured.
    warm_up_frames: usize,
    solver: Box<dyn Solver>,
    contact_time_error: Option<f64>,
    accuracy: Option<f64>,
    memory_bytes: usize,
    bytes_per_handle: Option<f64>,
    make_s: f64,
}

/// The truth at one moment.
struct ReferenceSample {
    time: f64,
    handles: Vec<ReferenceHandle>,
}

/// Measures every solver on `scene`. `progress` is called with the share of the work that is done, from 0 to 1.
///
/// # Errors
/// A sentence where the reference cannot be had.
pub fn measure(scene: &Scene, timeline: &Timeline, progress: &mut dyn FnMut(f64)) -> Result<Vec<Measurement>, String> {
    let end = timeline.end().time;
    let moments = truth(scene, end, &mut |share| progress(0.5 * share))?;
    let contact = contact_errors(scene, timeline)?;
    let noise = noise(scene, &moments);
    let candidates = candidates::candidates(scene, contact);
    let count = candidates.len() as f64;
    let mut measurements = Vec::new();
    for (index, candidate) in candidates.into_iter().enumerate() {
        measurements.push(measured(scene, candidate, &moments, noise, end));
        progress(0.5 + 0.5 * (index + 1) as f64 / count);
    }
    mark_pareto_front(&mut measurements);
    if let Some(first) = measurements.first_mut() {
        first.collision = collision::measure(scene, timeline, first.contact_time_error, first.frame_ns);
    }
    Ok(measurements)
}

/// The high-precision reference of a scene.
fn reference(scene: &Scene) -> Result<Reference, String> {
    let motion = &scene.motion;
    Reference::new(*motion.team(), motion.description(), motion.head_speed())
}

/// The reference at all moments. At the lock itself there is a solution only up to rounding, so the last moment is a
/// thousandth of a second earlier.
fn truth(scene: &Scene, end: f64, progress: &mut dyn FnMut(f64)) -> Result<Vec<ReferenceSample>, String> {
    let last_second = 1f64.min(0.5 * end);
    let spread = (0..SPREAD_MOMENTS).map(|k| (end - last_second) * k as f64 / SPREAD_MOMENTS as f64);
    let last = (0..LAST_SECOND_MOMENTS)
        .map(|k| end - last_second + (last_second * 0.999) * k as f64 / (LAST_SECOND_MOMENTS - 1) as f64);
    let times: Vec<f64> = spread.chain(last).collect();
    let (first, second) = times.split_at(times.len() / 2);
    std::thread::scope(|scope| {
        let second = scope.spawn(|| moments(scene, second, &mut |_| ()));
        let mut all = moments(scene, first, progress)?;
        all.extend(second.join().map_err(|_| "the reference's second thread panicked".to_owned())??);
        Ok(all)
    })
}

fn moments(scene: &Scene, times: &[f64], progress: &mut dyn FnMut(f64)) -> Result<Vec<ReferenceSample>, String> {
    let mut reference = reference(scene)?;
    let mut moments = Vec::with_capacity(times.len());
    for &time in times {
        let handles = reference.handles(time).map_err(|none| format!("the reference at {time} s: {none}"))?;
        moments.push(ReferenceSample { time, handles });
        progress(moments.len() as f64 / times.len() as f64);
    }
    Ok(moments)
}

/// What rounding does to a pose by itself, at most: see [`Measurement::noise`].
fn noise(scene: &Scene, moments: &[ReferenceSample]) -> f64 {
    let speed = scene.motion.head_speed();
    let of_handle = |time: f64, handle: &ReferenceHandle| {
        let reach = handle.x.high.hypot(handle.y.high) + speed * time;
        8.0 * f64::EPSILON * reach * (handle.speed / speed).abs().max(1.0)
    };
    let all = moments.iter().flat_map(|moment| moment.handles.iter().map(|handle| of_handle(moment.time, handle)));
    all.fold(0.0, f64::max)
}

/// By how much the contact times of the exact motion and of the paper's rule are off, seconds.
#[derive(Debug, Clone, Copy)]
struct ContactErrors {
    exact: f64,
    paper: f64,
}

/// The gap of the two boards in the reference, at the time found for the contact, over the speed at which it closes.
/// `None` without a contact or with one at the very start.
fn contact_errors(scene: &Scene, timeline: &Timeline) -> Result<Option<ContactErrors>, String> {
    let Some(contact) = timeline.find(EventKind::Contact) else { return Ok(None) };
    let (Some(a), Some(b)) = (contact.event.bench_a, contact.event.bench_b) else { return Ok(None) };
    let time = contact.event.travelled / scene.motion.head_speed();
    if time == 0.0 {
        return Ok(None);
    }
    let mut reference = reference(scene)?;
    let mut gap = |time: f64| {
        let handles = reference.handles(time).map_err(|none| format!("the reference at {time} s: {none}"))?;
        let board = |bench: u32| {
            let point = |handle: usize| Point::new(handles[handle].x.high, handles[handle].y.high);
            let (front, rear) = (point(bench as usize), point(bench as usize + 1));
            Board::from_handles(front, rear, scene.team().hole_inset, scene.team().width)
        };
        Ok::<f64, String>(separation_board_board(&board(a), &board(b)))
    };
    let interval = 1e-7 * time;
    let closing = (gap(time - interval)? - gap(time)?) / interval;
    let exact = (gap(time)? / closing).abs();
    let of_paper = scene.motion.with_method(Method::Paper(PaperRules::default()));
    let paper = of_paper.map_or(f64::NAN, |motion| (motion.time_at(contact.event.travelled) - time).abs());
    Ok(Some(ContactErrors { exact, paper }))
}

fn measured(scene: &Scene, mut candidate: Candidate, moments: &[ReferenceSample], noise: f64, end: f64) -> Measurement {
    let errors = errors(scene, &mut candidate, moments);
    let mut times = frame_times(scene, candidate.solver.as_mut(), end);
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
        max_speed_error: (scene.velocities == Velocities::Computed).then_some(errors.speed),
        contact_time_error: candidate.contact_time_error,
        max_link_error: errors.link,
        memory_bytes: candidate.memory_bytes,
        bytes_per_handle: candidate.bytes_per_handle,
        make_s: candidate.make_s,
        collision: Vec::new(),
        on_front: false,
    }
}

/// The time below which a share of sorted times lies, nanoseconds; not a number where there are none.
fn quantile(times: &[u64], share: f64) -> f64 {
    times.get((share * times.len() as f64) as usize).map_or(f64::NAN, |ns| *ns as f64)
}

/// Nanoseconds that the solver chosen for `scene` takes for a frame, the median over the show, as
/// [`Measurement::frame_ns`].
pub fn publisher_frame_ns(scene: &Scene, timeline: &Timeline) -> f64 {
    let mut solver = scene.motion.solver(scene.velocities).solver;
    let mut times = frame_times(scene, solver.as_mut(), timeline.end().time);
    times.sort_unstable();
    quantile(&times, 0.5)
}

#[derive(Default)]
struct Errors {
    position: f64,
    speed: f64,
    link: f64,
}

fn errors(scene: &Scene, candidate: &mut Candidate, moments: &[ReferenceSample]) -> Errors {
    let mut chain = Chain::new(scene.team().handles());
    let mut worst = Errors::default();
    for moment in moments {
        for frame in (0..=candidate.warm_up_frames).rev() {
            let time = (moment.time - frame as f64 / scene.rate).max(0.0);
            // The paper's solver runs ahead of the truth and so locks a little earlier; that moment is left out.
            if candidate.solver.solve(time, &mut chain).is_err() {
                return worst;
            }
        }
        for (i, truth) in moment.handles.iter().enumerate() {
            let error = truth.x.error_of(chain.x[i]).hypot(truth.y.error_of(chain.y[i]));
            worst.position = worse(worst.position, error);
            worst.speed = worse(worst.speed, ((chain.speed[i] - truth.speed) / truth.speed).abs());
        }
        for bench in 0..scene.team().benches {
            let (dx, dy) = (chain.x[bench + 1] - chain.x[bench], chain.y[bench + 1] - chain.y[bench]);
            worst.link = worse(worst.link, (dx.hypot(dy) - scene.team().link(bench)).abs());
        }
    }
    worst
}

/// The greater of two errors; what is not a number is worst.
fn worse(one: f64, other: f64) -> f64 {
    if one >= other || one.is_nan() { one } else { other }
}

/// Nanoseconds of each frame. Where the show has too many frames, or the solver is too slow for all, runs of frames
/// evenly over the show are timed.
fn frame_times(scene: &Scene, solver: &mut dyn Solver, end: f64) -> Vec<u64> {
    const RUN: usize = 50;
    let mut chain = Chain::new(scene.team().handles());
    let frames = (end * scene.rate) as usize;
    let began = Instant::now();
    let _ = solver.solve(0.0, &mut chain);
    for frame in 1..=20 {
        let _ = solver.solve(frame as f64 / scene.rate, &mut chain);
    }
    let each = began.elapsed().as_secs_f64() / 21.0;
    let wanted = TIMED_FRAMES.min((TIMING_LIMIT / each) as usize).clamp(RUN, frames.max(RUN));
    let runs = wanted.div_ceil(RUN);
    let clock = clock_ns();
    let mut times = Vec::with_capacity(runs * RUN);
    for run in 0..runs {
        let first = frames.saturating_sub(RUN) * run / runs.max(2).saturating_sub(1);
        for k in 0..RUN + 3 {
            let time = (first + k) as f64 / scene.rate;
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

/// Nanoseconds that reading the clock adds to what is timed, the median of many.
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

/// Which points of cost and error no other is below in one and not above in the other.
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
