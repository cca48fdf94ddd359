//! The arithmetic of the statistics: samples and times in, a [`LoopStatus`] a second and a [`Summary`] out.
//!
//! Pure: the statistics thread adds the figures of the process.

use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};

use crate::live::{End, LoopCounts};
use bench_dragon_messages::{LoopStatus, SceneName};

/// The longest lateness and step cost that a histogram records: an hour.
const LONGEST_NS: u64 = 3_600_000_000_000;
/// The most entries that one late wake-up makes in a histogram: the periods of a second at the highest rate.
const MOST_ENTRIES: u64 = 20_000;
const SECOND_NS: u64 = 1_000_000_000;

/// The measurements of one frame.
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
    /// The loop's counts, this frame included.
    pub counts: LoopCounts,
    /// The time from the intended deadline to the wake-up, in nanoseconds.
    pub lateness_ns: u64,
    /// The time from the wake-up until all publishers had the frame, in nanoseconds.
    pub step_ns: u64,
    /// Connected subscribers.
    pub subscribers: u32,
}

impl Sample {
    /// Before the first frame.
    pub(super) const NOTHING: Self = Self {
        tick: 0,
        sim_time: 0.0,
        shows_played: 0,
        unforeseen_contacts: 0,
        unsolved_frames: 0,
        counts: LoopCounts { frames: 0, overruns: 0, skipped: 0, end: End::Signal },
        lateness_ns: 0,
        step_ns: 0,
        subscribers: 0,
    };
}

/// Percentiles of a duration, in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Percentiles {
    /// The median.
    pub p50: u64,
    /// The 99th percentile.
    pub p99: u64,
    /// The 99.9th percentile.
    pub p999: u64,
    /// The maximum.
    pub max: u64,
}

impl Percentiles {
    /// Returns the percentiles of a histogram, zeros for an empty one.
    pub fn of(histogram: &Histogram<u64>) -> Self {
        let at = |quantile| histogram.value_at_quantile(quantile);
        Self { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: histogram.max() }
    }
}

/// The figures of a run at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// Wake-up lateness against the intended deadlines; skipped periods count with the lateness they would have had.
    pub wakeup_ns: Percentiles,
    /// The cost of a step: frame, publishing and waking subscribers.
    pub step_ns: Percentiles,
    /// The number of samples received. The percentiles leave out the frames whose samples were not received.
    pub samples: u64,
}

/// The distributions of lateness and step cost, in nanoseconds.
pub struct Durations {
    /// Wake-up lateness; skipped periods count with the lateness they would have had.
    pub lateness: Histogram<u64>,
    /// The cost of a step.
    pub step: Histogram<u64>,
}

impl Default for Durations {
    fn default() -> Self {
        Self::new()
    }
}

impl Durations {
    /// Creates empty distributions.
    pub fn new() -> Self {
        // 1 ns to an hour with three digits are bounds the constructor accepts.
        let histogram = || Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("valid bounds");
        Self { lateness: histogram(), step: histogram() }
    }

    /// Records a sample. A late wake-up counts for each period that it covers, with the lateness that remains there,
    /// which is HdrHistogram's correction for coordinated omission. In a very late wake-up neighbouring periods share
    /// an entry, so that a stop of an hour costs little time here.
    pub fn record(&mut self, sample: &Sample, period_ns: u64) {
        let values = (sample.lateness_ns / period_ns).max(1);
        let stride = values.div_ceil(MOST_ENTRIES);
        for first in (0..values).step_by(stride as usize) {
            let shared = stride.min(values - first);
            self.lateness.saturating_record_n(sample.lateness_ns - first * period_ns, shared);
        }
        self.step.saturating_record(sample.step_ns);
    }

    /// Empties the distributions.
    pub fn clear(&mut self) {
        self.lateness.reset();
        self.step.reset();
    }
}

/// The statistics of a run so far.
pub struct Accumulator {
    run_id: u64,
    rate: f64,
    scene: SceneName,
    total: Durations,
    /// Since the latest status.
    second: Durations,
    latest: Option<Sample>,
    samples: u64,
    /// The time of the latest status, or of the start, and the frames published until then.
    second_began_ns: u64,
    frames_before: u64,
    status_due_ns: u64,
}

impl Accumulator {
    /// Starts at `now_ns` of CLOCK_MONOTONIC.
    pub fn new(run_id: u64, rate: f64, scene: &str, now_ns: u64) -> Self {
        Self {
            run_id,
            rate,
            scene: SceneName::new(scene),
            total: Durations::new(),
            second: Durations::new(),
            latest: None,
            samples: 0,
            second_began_ns: now_ns,
            frames_before: 0,
            status_due_ns: now_ns + SECOND_NS,
        }
    }

    /// Records a sample.
    pub fn record(&mut self, sample: &Sample) {
        let period_ns = (1e9 / self.rate) as u64;
        self.total.record(sample, period_ns);
        self.second.record(sample, period_ns);
        self.samples += 1;
        self.latest = Some(*sample);
    }

    /// Returns the status once a second, with or without new frames. Returns `None` before the first frame.
    ///
    /// `stamp_ns`, `resident_bytes`, `lost_files` and `file_descriptors` are 0.
    pub fn status_if_due(&mut self, now_ns: u64) -> Option<LoopStatus> {
        if now_ns < self.status_due_ns {
            return None;
        }
        let status = self.status(now_ns)?;
        // The next whole second since the start, so that late calls do not add up.
        self.status_due_ns += SECOND_NS * ((now_ns - self.status_due_ns) / SECOND_NS + 1);
        Some(status)
    }

    /// Returns the status of the time since the latest one. Returns `None` if no time has passed, and before the first
    /// frame. The same fields are 0 as in [`Accumulator::status_if_due`].
    pub fn status(&mut self, now_ns: u64) -> Option<LoopStatus> {
        let Sample {
            tick,
            sim_time,
            shows_played,
            unforeseen_contacts,
            unsolved_frames,
            counts,
            lateness_ns: _,
            step_ns: _,
            subscribers,
        } = self.latest?;
        let elapsed_ns = now_ns.saturating_sub(self.second_began_ns);
        if elapsed_ns == 0 {
            return None;
        }
        let frames = counts.frames - self.frames_before;
        let [late, late_total] = [&self.second, &self.total].map(|over| Percentiles::of(&over.lateness));
        let [step, step_total] = [&self.second, &self.total].map(|over| Percentiles::of(&over.step));
        self.frames_before = counts.frames;
        self.second_began_ns = now_ns;
        self.second.clear();
        Some(LoopStatus {
            run_id: self.run_id,
            tick,
            sequence: counts.frames - 1,
            stamp_ns: 0,
            sim_time,
            rate: self.rate,
            measured_rate: frames as f64 * 1e9 / elapsed_ns as f64,
            overruns: counts.overruns,
            skipped: counts.skipped,
            shows_played,
            unforeseen_contacts,
            unsolved_frames,
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
            resident_bytes: 0,
            lost_files: 0,
            subscribers,
            file_descriptors: 0,
            scene: self.scene,
        })
    }

    /// Returns the summary of the run so far.
    pub fn summary(&self) -> Summary {
        let (wakeup_ns, step_ns) = (Percentiles::of(&self.total.lateness), Percentiles::of(&self.total.step));
        Summary { wakeup_ns, step_ns, samples: self.samples }
    }
}
