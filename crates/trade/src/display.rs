//! The error at the time of display against bytes per second: the gain of a higher publishing rate, for readers that
//! hold, and for readers with linear or Hermite interpolation.
//!
//! In: a dragon, its timeline, a display. Out: one [`DisplayMeasurement`] per reader, rate and precision. The stream is
//! simulated: every frame arrives at its deadline, so transport adds neither delay nor jitter. No clock is read, so the
//! same dragon gives the same errors.

use serde::Serialize;

use super::{Subject, TradeError, pareto_front, worse};
use bench_dragon_client::hermite::HermiteReader;
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_messages::{FrameHeader, HandlePose};
use bench_dragon_motion::Method;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::solve::{Chain, Solver, Velocities};
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_show::convert::handle_pose;
use bench_dragon_show::solve_at_or_just_before;

/// The publishing rates, hertz.
pub const RATES: [f64; 9] = [1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 120.0, 240.0, 1000.0];
/// The length of the window of display samples, in seconds. The window ends at the last whole second before the end of
/// the show.
pub const WINDOW: f64 = 2.0;
/// The number of further display samples, spread evenly over the show.
pub const SPREAD_SAMPLES: usize = 20;
/// The least and the greatest number of display samples in the window, for any display rate.
const WINDOW_SAMPLES: [usize; 2] = [120, 2000];
/// The greatest rounding error of a clock of whole nanoseconds, in seconds: two roundings.
const CLOCK_ROUNDING: f64 = 2e-9;

/// The interpolation between two frames. No reader extrapolates: without the next frame, each holds the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Reader {
    /// The last frame.
    Hold,
    /// Straight lines between positions.
    Linear,
    /// [`HermiteReader`].
    Hermite,
}

impl Reader {
    /// All readers.
    pub const ALL: [Self; 3] = [Self::Hold, Self::Linear, Self::Hermite];

    /// Returns the name in tables and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Linear => "linear",
            Self::Hermite => "hermite",
        }
    }
}

/// The precision of a frame's poses. Headers are always double.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// 64 bits per number, as published: 40 bytes per handle.
    Double,
    /// 32 bits per number: 20 bytes per handle. `precision = "f32"` publishes it.
    Single,
}

impl Precision {
    /// Both precisions.
    pub const ALL: [Self; 2] = [Self::Double, Self::Single];

    /// Returns the bytes of one frame's message.
    fn frame_bytes(self, handles: usize) -> f64 {
        let pose = match self {
            Self::Double => size_of::<HandlePose>(),
            Self::Single => size_of::<HandlePose>() / 2,
        };
        (size_of::<FrameHeader>() + pose * handles) as f64
    }
}

/// A display, and the cost of publishing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Display {
    /// Display rate, pictures per second.
    pub rate: f64,
    /// Delay of every reader's display behind the stream, in seconds. `None` means 0 for [`Reader::Hold`] and one
    /// publishing period for the others.
    pub delay: Option<f64>,
    /// The time of the publisher to compute a frame, in nanoseconds.
    pub frame_ns: f64,
}

/// The error of a reader of a stream, and the cost of the stream.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DisplayMeasurement {
    /// Always `display`, which distinguishes this line from the lines of the solvers.
    pub r#type: &'static str,
    /// The reader.
    pub reader: Reader,
    /// The publishing rate, in frames per second.
    pub rate_hz: f64,
    /// Display rate, pictures per second.
    pub display_rate_hz: f64,
    /// Delay of the display behind the stream, in seconds.
    pub delay_s: f64,
    /// The greatest distance of a displayed handle from its true position at the simulated time of the display, in
    /// metres.
    pub max_position_error: f64,
    /// The bytes of headers and poses per second, without the overhead of a transport.
    pub bytes_per_second: f64,
    /// The precision of the poses.
    pub precision: Precision,
    /// The share of a core for computing the frames, without transport.
    pub cpu_share: f64,
    /// True if no other measurement has both fewer bytes per second and a smaller error. Errors below the noise are
    /// equal.
    pub on_front: bool,
}

/// Measures every reader at every rate on `subject`. `progress` receives the share of the work that is done, from 0 to 1.
///
/// # Errors
/// The dragon has no solution at a sample before its end, or `progress` has stopped the measurement.
pub fn measure(
    subject: &Subject,
    timeline: &Timeline,
    display: Display,
    progress: Progress<'_>,
) -> Result<Vec<DisplayMeasurement>, TradeError> {
    let end = last_frame_time(timeline.show_end(subject.stops_at_contact).time);
    let truth = truth(subject, &display_times(end, display.rate))?;
    let noise = noise(subject, &truth);
    let mut measurements = Vec::new();
    for (index, rate) in RATES.into_iter().enumerate() {
        let mut stream = Stream::new(subject, rate, end);
        for reader in Reader::ALL {
            let period = 1.0 / rate;
            let delay = display.delay.unwrap_or(if reader == Reader::Hold { 0.0 } else { period });
            let errors = stream.errors(reader, delay, &truth)?;
            measurements.extend(Precision::ALL.into_iter().zip(errors).map(|(precision, error)| DisplayMeasurement {
                r#type: "display",
                reader,
                rate_hz: rate,
                display_rate_hz: display.rate,
                delay_s: delay,
                max_position_error: error,
                bytes_per_second: precision.frame_bytes(subject.motion.team().handles()) * rate,
                precision,
                cpu_share: 1e-9 * display.frame_ns * rate,
                on_front: false,
            }));
        }
        super::go_on(progress((index + 1) as f64 / RATES.len() as f64))?;
    }
    let points: Vec<(f64, f64)> =
        measurements.iter().map(|m| (m.bytes_per_second, m.max_position_error.max(noise))).collect();
    for (measurement, on_front) in measurements.iter_mut().zip(pareto_front(&points)) {
        measurement.on_front = on_front;
    }
    Ok(measurements)
}

/// Returns the last whole second before the end of the show, or the end of a show shorter than a second. All rates have
/// a frame there: so no rate is charged for the last frame, which has another phase at each rate.
fn last_frame_time(end: f64) -> f64 {
    if end >= 1.0 { end.floor() } else { end }
}

/// Returns the simulated times of the display samples, in order. Display and stream have separate clocks, so their
/// phase drifts. Multiples of the golden ratio spread the samples evenly over the display's period, and so over the
/// period of any stream.
fn display_times(end: f64, display_rate: f64) -> Vec<f64> {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let window = WINDOW.min(end);
    let pictures = (window * display_rate).ceil().max(1.0);
    let count = (pictures as usize).clamp(WINDOW_SAMPLES[0], WINDOW_SAMPLES[1]);
    let in_window = (0..count).map(|k| {
        // A fast display skips some pictures; a slow one passes the window several times.
        let picture = (k as f64 * (pictures / count as f64).max(1.0)).floor() % pictures;
        let phase = (k as f64 * golden).fract();
        end - window + window * (picture + phase) / pictures
    });
    let spread = (0..SPREAD_SAMPLES).map(|k| end * (k as f64 + golden) / SPREAD_SAMPLES as f64);
    let mut samples: Vec<f64> = in_window.chain(spread).collect();
    samples.sort_unstable_by(f64::total_cmp);
    samples
}

/// The true positions of the handles at one time.
struct DisplaySample {
    time: f64,
    chain: Chain,
}

/// Returns the safe solver's chains. The chains always have velocities, which correct for the rounding of the clock.
fn truth(subject: &Subject, times: &[f64]) -> Result<Vec<DisplaySample>, TradeError> {
    let exact = subject.motion.with_method(Method::Newton)?;
    let mut solver = exact.solver(Velocities::Computed).solver;
    let solved = times.iter().map(|&time| {
        let mut chain = Chain::new(subject.motion.team().handles());
        solve(solver.as_mut(), time, &mut chain)?;
        Ok(DisplaySample { time, chain })
    });
    solved.collect()
}

fn solve(solver: &mut dyn Solver, time: f64, chain: &mut Chain) -> Result<(), TradeError> {
    solve_at_or_just_before(solver, time, chain).map(|_| ()).map_err(|none| TradeError::NoChain(time, none))
}

/// Returns the metres below which errors are rounding, as [`super::Measurement::noise`].
fn noise(subject: &Subject, truth: &[DisplaySample]) -> f64 {
    let head_speed = subject.motion.head_speed();
    let of_sample = |DisplaySample { time, chain }: &DisplaySample| {
        let of_handle = |handle: usize| {
            let reach = chain.x[handle].hypot(chain.y[handle]) + head_speed * time;
            8.0 * f64::EPSILON * reach * (chain.speed[handle] / head_speed).abs().max(1.0)
        };
        (0..chain.handles()).map(of_handle).fold(0.0, f64::max)
    };
    truth.iter().map(of_sample).fold(0.0, f64::max)
}

/// A published frame, in both precisions.
#[derive(Clone)]
struct Published {
    tick: u64,
    header: FrameHeader,
    poses: [Vec<HandlePose>; 2],
}

/// A stream of frames at one rate, computed on demand.
struct Stream {
    solver: Box<dyn Solver>,
    rate: f64,
    end: f64,
    chain: Chain,
    /// The last two frames computed: samples come in order, and each needs the frames on both sides.
    latest: [Option<Published>; 2],
}

impl Stream {
    fn new(subject: &Subject, rate: f64, end: f64) -> Self {
        let solver = subject.motion.solver(subject.velocities).solver;
        Self { solver, rate, end, chain: Chain::new(subject.motion.team().handles()), latest: [None, None] }
    }

    /// Returns the greatest error of a reader over all samples, in both precisions, in metres.
    fn errors(&mut self, reader: Reader, delay: f64, truth: &[DisplaySample]) -> Result<[f64; 2], TradeError> {
        let mut worst = [0.0; 2];
        let mut shown = Vec::new();
        for sample in truth {
            let tick = (sample.time * self.rate).floor() as u64;
            let before = self.frame(tick)?;
            let has_arrived = (tick + 1) as f64 <= (sample.time + delay) * self.rate * (1.0 + 4.0 * f64::EPSILON);
            let is_published = (tick + 1) as f64 <= self.end * self.rate;
            let next =
                if reader != Reader::Hold && has_arrived && is_published { Some(self.frame(tick + 1)?) } else { None };
            for (precision, worst) in worst.iter_mut().enumerate() {
                let time = show(reader, &before, next.as_ref(), precision, sample.time, &mut shown);
                *worst = worse(*worst, distance(&sample.chain, time - sample.time, &shown));
            }
        }
        Ok(worst)
    }

    /// Returns the frame of a tick.
    fn frame(&mut self, tick: u64) -> Result<Published, TradeError> {
        if let Some(frame) = self.latest.iter().flatten().find(|frame| frame.tick == tick) {
            return Ok(frame.clone());
        }
        let sim_time = tick as f64 / self.rate;
        solve(self.solver.as_mut(), sim_time, &mut self.chain)?;
        let header = FrameHeader {
            tick,
            deadline_ns: nanoseconds(sim_time),
            sim_time,
            time_scale: 1.0,
            playback: PlaybackState::Playing as u32,
            handles: self.chain.handles() as u32,
            ..Default::default()
        };
        let poses: Vec<HandlePose> = (0..self.chain.handles()).map(|handle| handle_pose(&self.chain, handle)).collect();
        let rounded = poses.iter().map(single).collect();
        let frame = Published { tick, header, poses: [poses, rounded] };
        self.latest.rotate_left(1);
        self.latest[1] = Some(frame.clone());
        Ok(frame)
    }
}

/// Returns CLOCK_MONOTONIC at a simulated time, for a show that began at 0.
fn nanoseconds(sim_time: f64) -> u64 {
    (1e9 * sim_time).round() as u64
}

/// Returns a pose rounded to 32 bits.
fn single(pose: &HandlePose) -> HandlePose {
    let round = |value: f64| f64::from(value as f32);
    let HandlePose { x, y, heading, vx, vy } = *pose;
    HandlePose { x: round(x), y: round(y), heading: round(heading), vx: round(vx), vy: round(vy) }
}

/// Fills `shown` with the reader's picture at a simulated time between two frames. Returns the simulated time of the
/// picture: `time`, or its rounding to whole nanoseconds by the reader's clock.
fn show(
    reader: Reader,
    before: &Published,
    next: Option<&Published>,
    precision: usize,
    time: f64,
    shown: &mut Vec<HandlePose>,
) -> f64 {
    let poses = &before.poses[precision];
    shown.clear();
    match (reader, next) {
        (Reader::Hold, _) | (Reader::Linear, None) => shown.extend_from_slice(poses),
        (Reader::Linear, Some(next)) => {
            let (from, to) = (before.header.sim_time, next.header.sim_time);
            let u = (time - from) / (to - from);
            shown.extend(poses.iter().zip(&next.poses[precision]).map(|(a, b)| HandlePose {
                x: a.x + (b.x - a.x) * u,
                y: a.y + (b.y - a.y) * u,
                ..*a
            }));
        }
        (Reader::Hermite, _) => {
            let mut hermite = HermiteReader::new(2);
            for frame in [Some(before), next].into_iter().flatten() {
                hermite.push(&frame.header, &frame.poses[precision]);
            }
            let shown_time = hermite.at(nanoseconds(time), shown);
            return shown_time.filter(|shown| (shown - time).abs() <= CLOCK_ROUNDING).unwrap_or(time);
        }
    }
    time
}

/// Returns the greatest distance of a handle from its position `later` seconds after the chain's time, in metres.
/// Within the rounding of the clock, a linear motion is exact to 1e-17 m.
fn distance(chain: &Chain, later: f64, shown: &[HandlePose]) -> f64 {
    let of_handle = |(handle, pose): (usize, &HandlePose)| {
        let x = chain.x[handle] + later * chain.vx[handle];
        let y = chain.y[handle] + later * chain.vy[handle];
        (pose.x - x).hypot(pose.y - y)
    };
    shown.iter().enumerate().map(of_handle).fold(0.0, worse)
}
