//! What the loop has done: lateness and step cost as histograms, the status once a second, the summary at the end.
//!
//! Runs on a thread of its own, which takes samples from a queue, so that no percentile is computed, no file read and
//! no line printed on the loop's thread.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};

use super::clock::realtime_ns;
use super::{Counts, End, StatusPublisher};
use crate::wire::{CollisionAlert, LoopStatus, SceneName};

/// Samples that their queue holds: three seconds of the highest rate.
const QUEUED_SAMPLES: usize = 1 << 16;
/// Alerts that their queue holds.
const QUEUED_ALERTS: usize = 1 << 10;
/// The longest lateness and step cost that is told apart: an hour.
const LONGEST_NS: u64 = 3_600_000_000_000;

/// One frame, as the loop saw it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The frame's tick.
    pub tick: u64,
    /// The frame's simulated seconds.
    pub sim_time: f64,
    /// Shows played so far.
    pub shows_played: u64,
    /// Unforeseen contacts so far.
    pub unforeseen_contacts: u64,
    /// Unsolved frames so far.
    pub unsolved_frames: u64,
    /// What was counted so far, this frame included.
    pub counts: Counts,
    /// How late the thread woke after the intended deadline.
    pub lateness_ns: u64,
    /// From waking to the frame's being published everywhere.
    pub step_ns: u64,
    /// Subscribers connected.
    pub subscribers: u32,
}

/// The queues between the loop and this thread.
pub fn queues() -> (super::Reports, Inbox) {
    let (samples, sample_inbox) = rtrb::RingBuffer::new(QUEUED_SAMPLES);
    let (alerts, alert_inbox) = rtrb::RingBuffer::new(QUEUED_ALERTS);
    let reports = super::Reports { samples, alerts };
    (reports, Inbox { samples: sample_inbox, alerts: alert_inbox })
}

/// This thread's ends of the queues.
pub struct Inbox {
    samples: rtrb::Consumer<Sample>,
    alerts: rtrb::Consumer<CollisionAlert>,
}

/// Percentiles of a duration, nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Percentiles {
    /// Half are at most this.
    pub p50: u64,
    /// 99 % are at most this.
    pub p99: u64,
    /// 99.9 % are at most this.
    pub p999: u64,
    /// All are at most this.
    pub max: u64,
}

impl Percentiles {
    /// The percentiles of what a histogram holds; zeros where it holds nothing.
    pub fn of(histogram: &Histogram<u64>) -> Self {
        let at = |quantile| histogram.value_at_quantile(quantile);
        Self { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: histogram.max() }
    }
}

/// What is known of a run at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// Wake-up lateness against the intended deadlines; skipped periods count with the lateness they would have had.
    pub wakeup_ns: Percentiles,
    /// Cost of a step: frame, publishing and waking subscribers.
    pub step_ns: Percentiles,
    /// Samples that the queue could not hold, which the percentiles do not know of.
    pub lost_samples: u64,
}

/// The summary of a run: what `run --json` prints at its end, and a soak test reads.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunSummary {
    /// Frames published.
    pub frames: u64,
    /// Incidents in which at least one period was skipped.
    pub overruns: u64,
    /// Periods skipped.
    pub skipped: u64,
    /// Wake-up lateness against the intended deadlines.
    pub wakeup_ns: Percentiles,
    /// Cost of a step.
    pub step_ns: Percentiles,
    /// Why the loop ended.
    pub end: End,
    /// What went out over ROS 2, where it was open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ros2: Option<TransportCounts>,
}

/// What a transport with a queue and a thread of its own has done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TransportCounts {
    /// Frames published.
    pub frames: u64,
    /// Frames left out because the transport's thread was behind.
    pub skipped: u64,
    /// Messages that a full queue of the transport did not take, because a reliable subscriber was slow or dead.
    pub discarded: u64,
}

/// The distributions of the two durations over some time.
struct Histograms {
    lateness: Histogram<u64>,
    step: Histogram<u64>,
}

impl Histograms {
    fn new() -> Self {
        // 1 ns to an hour with three digits are bounds the constructor accepts.
        let histogram = || Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("valid bounds");
        Self { lateness: histogram(), step: histogram() }
    }

    /// Counts a sample. A late wake-up delays every period it covers: those are counted with what was left of it
    /// (HdrHistogram's correction for coordinated omission).
    fn record(&mut self, sample: &Sample, period_ns: u64) {
        let interval = if sample.lateness_ns / period_ns < 100_000 { period_ns } else { 0 };
        let late = sample.lateness_ns.min(LONGEST_NS);
        // Both are within the histograms' bounds.
        let _ = self.lateness.record_correct(late, interval);
        self.step.saturating_record(sample.step_ns);
    }

    fn clear(&mut self) {
        self.lateness.reset();
        self.step.reset();
    }
}

/// What the statistics thread is told of the run.
pub struct Run<'a> {
    /// The run's number.
    pub run_id: u64,
    /// Frames per second asked for.
    pub rate: f64,
    /// The scene's name.
    pub scene: &'a str,
    /// Where the status goes.
    pub sinks: Vec<Box<dyn StatusPublisher>>,
    /// What is done with each alert.
    pub announce: Box<dyn FnMut(&CollisionAlert) + 'a>,
}

/// Collects until `done` is set and the queues are empty.
pub fn collect(mut inbox: Inbox, mut run: Run, done: &AtomicBool) -> Summary {
    let (mut total, mut second) = (Histograms::new(), Histograms::new());
    let period_ns = (1e9 / run.rate) as u64;
    let mut frames_before = 0;
    let mut latest: Option<Sample> = None;
    let mut received = 0;
    let mut second_began = Instant::now();
    loop {
        // Read before the queues are emptied: what was pushed before it was set is then still seen.
        let ending = done.load(Ordering::Acquire);
        while let Ok(alert) = inbox.alerts.pop() {
            (run.announce)(&alert);
        }
        while let Ok(sample) = inbox.samples.pop() {
            total.record(&sample, period_ns);
            second.record(&sample, period_ns);
            received += 1;
            latest = Some(sample);
        }
        let elapsed = second_began.elapsed();
        if let Some(sample) = latest.filter(|_| elapsed >= Duration::from_secs(1) || ending) {
            let frames = sample.counts.frames - frames_before;
            let status = status(&run, &sample, frames as f64 / elapsed.as_secs_f64(), &second, &total);
            run.sinks.iter_mut().for_each(|sink| sink.publish_status(&status));
            frames_before = sample.counts.frames;
            second.clear();
            second_began = Instant::now();
        }
        if ending {
            let lost_samples = latest.map_or(0, |sample| sample.counts.frames) - received;
            let (wakeup_ns, step_ns) = (Percentiles::of(&total.lateness), Percentiles::of(&total.step));
            return Summary { wakeup_ns, step_ns, lost_samples };
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn status(run: &Run, sample: &Sample, measured_rate: f64, second: &Histograms, total: &Histograms) -> LoopStatus {
    let [late, late_total] = [second, total].map(|histograms| Percentiles::of(&histograms.lateness));
    let [step, step_total] = [second, total].map(|histograms| Percentiles::of(&histograms.step));
    LoopStatus {
        run_id: run.run_id,
        tick: sample.tick,
        sequence: sample.counts.frames - 1,
        stamp_ns: realtime_ns(),
        sim_time: sample.sim_time,
        rate: run.rate,
        measured_rate,
        overruns: sample.counts.overruns,
        skipped: sample.counts.skipped,
        shows_played: sample.shows_played,
        unforeseen_contacts: sample.unforeseen_contacts,
        unsolved_frames: sample.unsolved_frames,
        lateness_p50_second: late.p50,
        lateness_p99_second: late.p99,
        lateness_max_second: late.max,
        lateness_p50_total: late_total.p50,
        lateness_p99_total: late_total.p99,
        lateness_p999_total: late_total.p999,
        lateness_max_total: late_total.max,
        step_p50_second: step.p50,
        step_p99_second: step.p99,
        step_max_second: step.max,
        step_p50_total: step_total.p50,
        step_p99_total: step_total.p99,
        step_p999_total: step_total.p999,
        step_max_total: step_total.max,
        resident_bytes: resident_bytes(),
        subscribers: sample.subscribers,
        file_descriptors: file_descriptors(),
        scene: SceneName::new(run.scene),
    }
}

/// Resident memory of this process, bytes; 0 where /proc does not tell.
fn resident_bytes() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    let resident = pages.and_then(|text| text.split_whitespace().nth(1)?.parse::<u64>().ok()).unwrap_or(0);
    let page = nix::unistd::sysconf(nix::unistd::SysconfVar::PAGE_SIZE).ok().flatten();
    resident * page.unwrap_or(4096) as u64
}

/// Open file descriptors of this process; 0 where /proc does not tell.
fn file_descriptors() -> u32 {
    std::fs::read_dir("/proc/self/fd").map_or(0, |entries| entries.count() as u32)
}
