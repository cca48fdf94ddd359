//! The observation of a subscriber process, which the process prints once a second and the soak test reads.
//!
//! In: counts and percentiles from the [`observer`](super::observer). Out: JSON through a pipe; sums over the processes
//! of a subscriber.

use serde::{Deserialize, Serialize};

use bench_dragon_messages::LoopStatus;
use bench_dragon_publisher::live::statistics::Percentiles;

/// The observation of a subscriber so far; counts are since its process started.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Observation {
    /// Frames received.
    pub received: u64,
    /// Frames that never came: gaps in `sequence`.
    pub missed: u64,
    /// Periods in which nothing was sent: gaps in `tick` that `sequence` does not share.
    pub skipped: u64,
    /// Frames whose sequence, tick or times contradict those of the frame before, or each other.
    pub disordered: u64,
    /// Frames whose link lengths were compared with the stage's.
    pub links_checked: u64,
    /// Frames with a link of another length than the stage's.
    pub wrong_links: u64,
    /// The largest difference of a link from its length, in metres.
    pub worst_link_error: f64,
    /// Frames that do not follow from the frame before by the rules of playing, pausing and jumping.
    pub disobedient: u64,
    /// The fault of the first such frame.
    pub disobedience: Option<String>,
    /// Frames whose time was compared with the time of the frames before.
    pub times_checked: u64,
    /// `epoch` of the latest frame.
    pub epoch: u32,
    /// The largest distance of a deadline from first deadline + tick / rate, in nanoseconds.
    pub phase_error_ns: f64,
    /// Runs of the publishers of the frames.
    pub runs: u64,
    /// Alerts received.
    pub alerts: u64,
    /// `sequence` of the latest frame.
    pub last_sequence: u64,
    /// `tick` of the latest frame.
    pub last_tick: u64,
    /// Latencies since the last observation; `None` if nothing came.
    pub second: Option<Latencies>,
    /// Latencies since the process started; `None` if nothing ever came.
    pub total: Option<Latencies>,
    /// The latest status of the publisher.
    pub status: Option<Status>,
}

impl Observation {
    /// Returns the observation of two processes of a subscriber together, `self` the former one. Latencies are the
    /// worse of the two.
    pub fn joined(&self, later: &Self) -> Self {
        Self {
            received: self.received + later.received,
            missed: self.missed + later.missed,
            skipped: self.skipped + later.skipped,
            disordered: self.disordered + later.disordered,
            links_checked: self.links_checked + later.links_checked,
            wrong_links: self.wrong_links + later.wrong_links,
            worst_link_error: self.worst_link_error.max(later.worst_link_error),
            disobedient: self.disobedient + later.disobedient,
            disobedience: self.disobedience.clone().or_else(|| later.disobedience.clone()),
            times_checked: self.times_checked + later.times_checked,
            epoch: self.epoch.max(later.epoch),
            phase_error_ns: self.phase_error_ns.max(later.phase_error_ns),
            runs: self.runs.max(later.runs),
            alerts: self.alerts + later.alerts,
            last_sequence: self.last_sequence.max(later.last_sequence),
            last_tick: self.last_tick.max(later.last_tick),
            second: later.second,
            total: Latencies::worst(self.total, later.total),
            status: later.status.or(self.status),
        }
    }
}

/// Latencies of frames, nanoseconds of CLOCK_MONOTONIC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Latencies {
    /// From `sent_ns` to receiving: the cost of the transport and of waking this process.
    pub since_sent: Percentiles,
    /// From `deadline_ns` to receiving. Skipped periods are included with the latency they would have had. This is the
    /// latency at the nominal rate, a late wake-up of the publisher included.
    pub since_deadline: Percentiles,
}

impl Latencies {
    /// Returns the worse of two, percentile by percentile.
    pub fn worst(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        let (Some(a), Some(b)) = (a, b) else { return a.or(b) };
        let worse = |a: Percentiles, b: Percentiles| Percentiles {
            p50: a.p50.max(b.p50),
            p99: a.p99.max(b.p99),
            p999: a.p999.max(b.p999),
            max: a.max.max(b.max),
        };
        Some(Self {
            since_sent: worse(a.since_sent, b.since_sent),
            since_deadline: worse(a.since_deadline, b.since_deadline),
        })
    }
}

/// The fields of a [`LoopStatus`] that a soak test records.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// The nominal rate, in frames per second.
    pub rate: f64,
    /// Frames published in the last second, divided by its true length.
    pub measured_rate: f64,
    /// Incidents in which at least one period was skipped, since the start.
    pub overruns: u64,
    /// Periods skipped, since the start.
    pub skipped: u64,
    /// Frames published since the start.
    pub frames: u64,
    /// The number of times that the show has been played to its end.
    pub shows_played: u64,
    /// Wake-up lateness of the last second: median, 99th percentile and maximum, ns.
    pub lateness_second: [u64; 3],
    /// Wake-up lateness since the start: 99.9th percentile, ns.
    pub lateness_p999_total: u64,
    /// The step cost of the last second: median, 99th percentile and maximum, ns.
    pub step_second: [u64; 3],
}

impl From<&LoopStatus> for Status {
    fn from(status: &LoopStatus) -> Self {
        let s = status;
        Self {
            rate: s.rate,
            measured_rate: s.measured_rate,
            overruns: s.overruns,
            skipped: s.skipped,
            frames: s.sequence + 1,
            shows_played: s.shows_played,
            lateness_second: [s.lateness_p50_second, s.lateness_p99_second, s.lateness_max_second],
            lateness_p999_total: s.lateness_p999_total,
            step_second: [s.step_p50_second, s.step_p99_second, s.step_max_second],
        }
    }
}
