//! Statistics of the loop: percentiles of lateness and step cost, the status once a second, the summary at the end.
//!
//! In: samples, alerts and cues from queues. Out: [`LoopStatus`] to every [`StatusPublisher`], alerts and cues to the
//! caller, a [`Summary`]. All this runs on a thread of its own, so that the loop's thread computes no percentile, reads
//! no file and prints no line. [`accumulator`] does the arithmetic, [`histogram_log`] writes the distributions to a
//! file.

pub mod accumulator;
pub mod histogram_log;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

use super::{Announcement, End, StatusPublisher, TransportCounters};
use bench_dragon_client::clock::Clock;
use bench_dragon_client::shared_memory::stale_files::lost_files;
use bench_dragon_messages::LoopStatus;
use bench_dragon_messages::sentence::lost_files_sentence;

pub use accumulator::{Accumulator, Durations, Percentiles, Sample, Summary};

/// Samples that their queue holds: three seconds of the highest rate.
const QUEUED_SAMPLES: usize = 1 << 16;
/// Alerts and cues that their queue holds.
const QUEUED_ANNOUNCEMENTS: usize = 1 << 10;
/// The time between two polls of the queues, in nanoseconds.
const POLL_INTERVAL_NS: u64 = 20_000_000;

/// The interval of the log's lines about lost files, in nanoseconds.
const WARNING_INTERVAL_NS: u64 = 60_000_000_000;

/// Creates the queues between the loop and this thread.
pub fn queues() -> (super::Reports, Inbox) {
    queues_of(QUEUED_SAMPLES, QUEUED_ANNOUNCEMENTS)
}

/// Creates queues for `samples` samples and `announcements` alerts and cues.
pub fn queues_of(samples: usize, announcements: usize) -> (super::Reports, Inbox) {
    let (mut samples, mut sample_inbox) = rtrb::RingBuffer::new(samples);
    // Touches each page here. Otherwise the loop's thread would be the first to touch it, and a soak test would report
    // growing memory for minutes.
    while samples.push(Sample::NOTHING).is_ok() {}
    while sample_inbox.pop().is_ok() {}
    let (announcements, announcement_inbox) = rtrb::RingBuffer::new(announcements);
    let reports = super::Reports::new(samples, announcements);
    let turns = Arc::clone(&reports.turns);
    (reports, Inbox { samples: sample_inbox, announcements: announcement_inbox, turns, seen_turns: 0 })
}

/// This thread's ends of the queues.
pub struct Inbox {
    samples: rtrb::Consumer<Sample>,
    announcements: rtrb::Consumer<Announcement>,
    turns: Arc<AtomicU64>,
    seen_turns: u64,
}

/// The summary of a run. `run --json` prints it, and a soak test reads it.
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
    /// The cost of a step.
    pub step_ns: Percentiles,
    /// The reason for the end of the loop.
    pub end: End,
    /// The counters of each transport with a queue, by the transport's name.
    #[serde(flatten)]
    pub transport_counters: BTreeMap<String, TransportCounters>,
}

/// The run, and the destinations of its statistics.
pub struct Run<'a> {
    /// The run's number.
    pub run_id: u64,
    /// Requested frames per second.
    pub rate: f64,
    /// The scene's name.
    pub scene: &'a str,
    /// The destinations of the status.
    pub sinks: Vec<Box<dyn StatusPublisher>>,
    /// Called with each alert and cue.
    pub announce: Box<dyn FnMut(&Announcement) + 'a>,
    /// Called with each sample.
    pub record: Box<dyn FnMut(&Sample) + 'a>,
    /// Called if the loop has turned since the last poll of the queues: 10 to 50 times a second, also between two
    /// frames.
    pub alive: Box<dyn FnMut() + 'a>,
}

/// The statistics thread without its waiting and its system calls, for a simulated scheduler.
pub struct Collector<'a> {
    inbox: Inbox,
    run: Run<'a>,
    accumulator: Accumulator,
}

impl<'a> Collector<'a> {
    /// Starts at `now_ns` of CLOCK_MONOTONIC.
    pub fn new(inbox: Inbox, run: Run<'a>, now_ns: u64) -> Self {
        let accumulator = Accumulator::new(run.run_id, run.rate, run.scene, now_ns);
        Self { inbox, run, accumulator }
    }

    /// Empties the queues.
    pub fn take(&mut self) {
        while let Ok(announcement) = self.inbox.announcements.pop() {
            (self.run.announce)(&announcement);
        }
        while let Ok(sample) = self.inbox.samples.pop() {
            self.accumulator.record(&sample);
            (self.run.record)(&sample);
        }
        let turns = self.inbox.turns.load(Ordering::Relaxed);
        if turns != self.inbox.seen_turns {
            self.inbox.seen_turns = turns;
            (self.run.alive)();
        }
    }

    /// Sends the status if one is due or the run is `ending`. `complete` adds the stamp and the figures of the process.
    pub fn report(&mut self, now_ns: u64, ending: bool, complete: impl FnOnce(LoopStatus) -> LoopStatus) {
        let Self { accumulator, run, .. } = self;
        let status = if ending { accumulator.status(now_ns) } else { accumulator.status_if_due(now_ns) };
        if let Some(status) = status.map(complete) {
            run.sinks.iter_mut().for_each(|sink| sink.publish_status(&status));
        }
    }

    /// Returns the summary of the run so far.
    pub fn summary(&self) -> Summary {
        self.accumulator.summary()
    }
}

/// Collects until `done` is set and the queues are empty.
pub fn collect<C: Clock>(clock: &C, inbox: Inbox, run: Run, done: &AtomicBool) -> Summary {
    let mut collector = Collector::new(inbox, run, clock.monotonic_ns());
    let mut warned_ns = None;
    loop {
        // `done` is read before the queues are emptied: everything pushed before `done` was set is collected.
        let ending = done.load(Ordering::Acquire);
        collector.take();
        let now_ns = clock.monotonic_ns();
        collector.report(now_ns, ending, |status| {
            let lost_files = lost_files();
            if lost_files > 0 && warned_ns.is_none_or(|warned_ns| now_ns - warned_ns >= WARNING_INTERVAL_NS) {
                log::error!("{}", lost_files_sentence(lost_files));
                warned_ns = Some(now_ns);
            }
            LoopStatus {
                stamp_ns: clock.realtime_ns(),
                resident_bytes: resident_bytes(),
                lost_files,
                file_descriptors: file_descriptors(),
                ..status
            }
        });
        if ending {
            return collector.summary();
        }
        clock.sleep_until(now_ns + POLL_INTERVAL_NS);
    }
}

/// Returns the resident memory of this process in bytes, or 0 without /proc.
fn resident_bytes() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    let resident = pages.and_then(|text| text.split_whitespace().nth(1)?.parse::<u64>().ok()).unwrap_or(0);
    let page = nix::unistd::sysconf(nix::unistd::SysconfVar::PAGE_SIZE).ok().flatten();
    resident * page.unwrap_or(4096) as u64
}

/// Returns the number of open file descriptors of this process, or 0 without /proc.
fn file_descriptors() -> u32 {
    std::fs::read_dir("/proc/self/fd").map_or(0, |entries| entries.count() as u32)
}
