//! The live loop: wait for the deadline, get the frame, pass it to the publishers, count.
//!
//! In: a [`FrameSource`] and a [`Clock`]. Out: frames to every [`Publisher`], and samples, alerts and cues to two
//! queues that never block. The loop knows no transport and no solver. [`run`](crate::run) calls [`run_loop`] on one
//! thread and [`statistics`], which empties both queues, on another.

pub mod control;
pub mod realtime;
pub mod show_source;
pub mod statistics;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use bench_dragon_messages::control::{Command, CommandRecord};
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, LoopStatus};
use bench_dragon_motion::solve::Chain;
use bench_dragon_show::convert::Stamps;
use bench_dragon_show::{Frame, Outcome};

use bench_dragon_client::clock::{Clock, Deadlines};
use control::CommandQueues;
use statistics::Sample;

/// The time between two calls of [`Publisher::maintain`], in nanoseconds.
const MAINTENANCE_NS: u64 = 100_000_000;

/// Counts of a show since its start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ShowCounts {
    /// The number of times that the show began again after its end.
    pub shows_played: u64,
    /// Contacts that no search had found.
    pub unforeseen_contacts: u64,
    /// Frames without a solution, which have the handles of the latest solution.
    pub unsolved_frames: u64,
}

/// A frame as every publisher gets it.
#[derive(Debug, Clone, Copy)]
pub struct Outgoing<'a> {
    /// The frame's header, complete but for `sent_ns`, which the publisher sets just before sending.
    pub header: &'a FrameHeader,
    /// The positions of the handles.
    pub chain: &'a Chain,
    /// The alerts of this frame, in order.
    pub alerts: &'a [CollisionAlert],
    /// The cues of this frame, in order.
    pub cues: &'a [Cue],
    /// The commands applied before this frame, in order.
    pub commands: &'a [CommandRecord],
    /// The counts up to this frame.
    pub counts: ShowCounts,
}

impl<'a> Outgoing<'a> {
    /// Creates a frame without alerts and cues.
    pub fn new(header: &'a FrameHeader, frame: &'a Frame) -> Self {
        let Frame {
            // These are in the header.
            tick: _,
            sim_time: _,
            time_scale: _,
            state: _,
            playback: _,
            min_clearance: _,
            epoch: _,
            cue: _,
            // These become messages first: `show_source`.
            alerts: _,
            cues: _,
            chain,
            commands,
            shows_played,
            unforeseen_contacts,
            unsolved_frames,
        } = frame;
        let counts = ShowCounts {
            shows_played: *shows_played,
            unforeseen_contacts: *unforeseen_contacts,
            unsolved_frames: *unsolved_frames,
        };
        Self { header, chain, alerts: &[], cues: &[], commands, counts }
    }
}

/// A destination of frames. Called on the real-time thread: an implementation must not allocate, lock, log or make a
/// system call besides its transport's.
pub trait Publisher {
    /// Sends one frame with its alerts and cues.
    ///
    /// # Errors
    /// A failure of the transport that ends the run. A slow or dead subscriber is no error.
    fn publish(&mut self, outgoing: Outgoing<'_>) -> Result<(), PublishError>;

    /// Does work that makes the next frame cheaper. Called after the measured step.
    fn prepare(&mut self) {}

    /// Delivers the history to newly connected subscribers. Called about ten times a second.
    fn maintain(&mut self);

    /// Returns the number of connected subscribers of frames.
    fn subscribers(&self) -> u32;
}

/// A destination of the loop's status, once a second, on the statistics thread.
pub trait StatusPublisher {
    /// Sends a status.
    fn publish_status(&mut self, status: &LoopStatus);
}

/// A transport failed in a way that ends the run.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct PublishError(pub String);

/// The result of a period.
#[derive(Debug, Clone, Copy)]
pub enum Period<'a> {
    /// A frame.
    Frame(Outgoing<'a>),
    /// No frame is due.
    Empty,
    /// The frames are over: the loop ends.
    Over,
}

/// The source of the loop's frames, by tick.
pub trait FrameSource {
    /// Returns the result of the period `tick`. Each call's tick is greater than the one before. The stamps go into the
    /// header, the alerts and the cues.
    fn frame(&mut self, tick: u64, stamps: Stamps) -> Period<'_>;

    /// Executes a command at the beginning of the period `tick`, before its frame. Returns `None` for a step, which
    /// [`finished_step`](Self::finished_step) answers.
    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome>;

    /// Returns the answer to the step that ended at `tick`, or was broken off.
    fn finished_step(&mut self, tick: u64) -> Option<Outcome>;
}

/// The settings of the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopOptions {
    /// The run's number, in every header.
    pub run_id: u64,
    /// The rate, in frames per second.
    pub rate: f64,
    /// The number of periods after which the loop ends; `None` for a loop without limit.
    pub periods: Option<u64>,
}

impl LoopOptions {
    /// Returns the number of periods in `seconds` of wall time at `rate`: ceil(seconds * rate).
    pub fn periods_of(seconds: f64, rate: f64) -> u64 {
        let periods = seconds * rate;
        // Rounding can push the product of a whole number of periods past that number.
        let whole = periods.round();
        if (periods - whole).abs() <= 4.0 * f64::EPSILON * whole { whole as u64 } else { periods.ceil() as u64 }
    }
}

/// The reason for the end of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// All its periods had passed.
    Duration,
    /// Its stop flag was set.
    Signal,
    /// The recording was over.
    Recording,
    /// A publisher failed.
    Error,
}

/// The counts of the loop. `frames + skipped` is the number of elapsed periods without the empty ones of a recording.
/// After a failure of a publisher, the failed period is not counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LoopCounts {
    /// Frames published.
    pub frames: u64,
    /// Incidents in which at least one period was skipped.
    pub overruns: u64,
    /// Periods skipped.
    pub skipped: u64,
    /// The reason for its end.
    pub end: End,
}

/// The counters of a transport that has a queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct TransportCounters {
    /// Frames sent.
    pub frames: u64,
    /// Frames skipped because the transport was behind.
    pub skipped: u64,
    /// Messages that did not fit into the transport's queues because a receiver was slow or dead.
    pub discarded: u64,
}

/// An alert or a cue that was published, for the terminal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Announcement {
    /// An alert.
    Alert {
        /// The message.
        alert: CollisionAlert,
        /// Simulated seconds per second of wall time at the alert.
        time_scale: f64,
    },
    /// A cue.
    Cue(Cue),
}

/// The queues from the loop to the statistics thread. Their memory is reserved beforehand.
pub struct Reports {
    /// One sample a frame.
    pub samples: rtrb::Producer<Sample>,
    /// Every alert and every cue.
    pub announcements: rtrb::Producer<Announcement>,
    /// The number of turns of the loop's wait so far, a sign of life also between two frames.
    turns: Arc<AtomicU64>,
}

impl Reports {
    /// Creates the loop's ends of these queues.
    pub fn new(samples: rtrb::Producer<Sample>, announcements: rtrb::Producer<Announcement>) -> Self {
        Self { samples, announcements, turns: Arc::default() }
    }

    /// Reports that the loop lives. The loop's thread alone writes the count.
    fn turn(&self) {
        self.turns.store(self.turns.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
    }
}

/// Publishes one frame in each period until `stop` is set or the periods are over.
///
/// A frame is computed in its period, however late. A period that has wholly passed is skipped and counted, and later
/// deadlines do not shift.
///
/// # Errors
/// The first [`PublishError`], with the counts up to the failure.
pub fn run_loop<C: Clock>(
    clock: &C,
    source: &mut dyn FrameSource,
    queues: &mut CommandQueues,
    publishers: &mut [Box<dyn Publisher>],
    options: LoopOptions,
    mut reports: Reports,
    stop: &AtomicBool,
) -> Result<LoopCounts, (LoopCounts, PublishError)> {
    let mut counts = LoopCounts { frames: 0, overruns: 0, skipped: 0, end: End::Signal };
    let periods = options.periods.unwrap_or(u64::MAX);
    let deadlines = Deadlines::starting_at(clock.monotonic_ns(), options.rate);
    let mut maintenance_due_ns = 0;
    let mut tick = 0;
    loop {
        let deadline_ns = deadlines.of(tick);
        let reached = wait(clock, deadline_ns, stop, publishers, &mut maintenance_due_ns, &reports);
        let woke_ns = clock.monotonic_ns();
        let counts_before = counts;
        // The first period that has not wholly passed. After a stop, too, the periods before it count as skipped.
        let current = deadlines.latest_at(woke_ns).max(tick).min(periods);
        if current > tick {
            counts.overruns += 1;
            counts.skipped += current - tick;
            tick = current;
        }
        if tick >= periods {
            counts.end = End::Duration;
            return Ok(counts);
        }
        if !reached {
            return Ok(counts);
        }
        let stamps = Stamps {
            run_id: options.run_id,
            sequence: counts.frames,
            stamp_ns: clock.realtime_ns(),
            deadline_ns: deadlines.of(tick),
        };
        queues.take_one(source, tick);
        let outgoing = match source.frame(tick, stamps) {
            Period::Frame(outgoing) => outgoing,
            Period::Empty => {
                queues.finish_step(source, tick);
                tick += 1;
                continue;
            }
            // No period after the last frame counts as skipped.
            Period::Over => return Ok(LoopCounts { end: End::Recording, ..counts_before }),
        };
        for publisher in publishers.iter_mut() {
            if let Err(error) = publisher.publish(outgoing) {
                counts.end = End::Error;
                return Err((counts, error));
            }
        }
        counts.frames += 1;
        let ShowCounts { shows_played, unforeseen_contacts, unsolved_frames } = outgoing.counts;
        let sample = Sample {
            tick,
            sim_time: outgoing.header.sim_time,
            shows_played,
            unforeseen_contacts,
            unsolved_frames,
            counts,
            lateness_ns: woke_ns.saturating_sub(deadline_ns),
            step_ns: clock.monotonic_ns().saturating_sub(woke_ns),
            subscribers: publishers.iter().map(|publisher| publisher.subscribers()).sum(),
        };
        report(&mut reports, outgoing, sample);
        queues.finish_step(source, tick);
        publishers.iter_mut().for_each(|publisher| publisher.prepare());
        tick += 1;
    }
}

/// Waits for a deadline. Returns false if `stop` was set first. Long waits are divided, for maintenance and for `stop`.
fn wait<C: Clock>(
    clock: &C,
    deadline_ns: u64,
    stop: &AtomicBool,
    publishers: &mut [Box<dyn Publisher>],
    maintenance_due_ns: &mut u64,
    reports: &Reports,
) -> bool {
    loop {
        reports.turn();
        if stop.load(Ordering::Relaxed) {
            return false;
        }
        let now = clock.monotonic_ns();
        if now >= *maintenance_due_ns {
            publishers.iter_mut().for_each(|publisher| publisher.maintain());
            *maintenance_due_ns = now + MAINTENANCE_NS;
        }
        if now >= deadline_ns {
            return true;
        }
        clock.sleep_until(deadline_ns.min(*maintenance_due_ns));
    }
}

/// Passes the sample, the alerts and the cues to the statistics thread. If a queue is full, the percentiles miss the
/// sample or the terminal misses the line. The published frame, alert and cue are not affected.
fn report(reports: &mut Reports, outgoing: Outgoing<'_>, sample: Sample) {
    for alert in outgoing.alerts {
        let announcement = Announcement::Alert { alert: *alert, time_scale: outgoing.header.time_scale };
        let _ = reports.announcements.push(announcement);
    }
    for cue in outgoing.cues {
        let _ = reports.announcements.push(Announcement::Cue(*cue));
    }
    let _ = reports.samples.push(sample);
}
