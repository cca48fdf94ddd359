//! The live loop: wait for the deadline, compute the frame, hand it to the publishers, count.
//!
//! Knows [`Frame`] and [`Publisher`]; knows no transport and no solver. The `run` command calls [`run_loop`] on a
//! thread of its own, and [`statistics`] on another, which takes what the loop counts from a queue that never blocks.

pub mod clock;
pub mod realtime;
pub mod statistics;

use std::sync::atomic::{AtomicBool, Ordering};

use crate::show::{Frame, Show};
use crate::wire::convert::{Stamps, collision_alert, frame_header};
use crate::wire::{CollisionAlert, FrameHeader, LoopStatus};

use clock::{Deadlines, monotonic_ns, realtime_ns, sleep_until};
use statistics::Sample;

/// Nanoseconds between two calls of [`Publisher::maintain`].
const MAINTENANCE_NS: u64 = 100_000_000;

/// Where frames go. Called on the real-time thread: an implementation must not allocate, lock, log or make a system
/// call besides its transport's own.
pub trait Publisher {
    /// Sends one frame with its alerts. `header` is complete but for `sent_ns`, which the publisher sets just before
    /// sending.
    ///
    /// # Errors
    /// A sentence for people where the transport failed in a way that ends the run; a slow or dead subscriber is no
    /// error.
    fn publish(&mut self, header: &FrameHeader, frame: &Frame) -> Result<(), PublishError>;

    /// Lets late subscribers in; called about ten times a second.
    fn maintain(&mut self);

    /// The subscribers of the frames that are connected.
    fn subscribers(&self) -> u32;
}

/// Where the loop's status goes, once a second, on the statistics thread.
pub trait StatusPublisher {
    /// Sends a status.
    fn publish_status(&mut self, status: &LoopStatus);
}

/// A transport failed in a way that ends the run.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct PublishError(pub String);

/// Where frames come from, by tick.
pub trait Frames {
    /// The frame of a tick; ticks are asked in increasing order.
    fn frame(&mut self, tick: u64) -> &Frame;
}

impl Frames for Show {
    fn frame(&mut self, tick: u64) -> &Frame {
        Show::frame(self, tick)
    }
}

/// How the loop runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopOptions {
    /// The run's number, in every header.
    pub run_id: u64,
    /// Frames per second.
    pub rate: f64,
    /// The number of periods after which the loop ends; `None` to go on until it is told to stop.
    pub periods: Option<u64>,
}

impl LoopOptions {
    /// The periods of `seconds` of wall time at `rate`: ticks 0 .. ceil(seconds * rate) - 1.
    pub fn periods_of(seconds: f64, rate: f64) -> u64 {
        let periods = seconds * rate;
        // A product that rounding has pushed past a whole number is that number.
        let whole = periods.round();
        if (periods - whole).abs() <= 4.0 * f64::EPSILON * whole { whole as u64 } else { periods.ceil() as u64 }
    }
}

/// Why the loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// Its periods were over.
    Duration,
    /// It was told to stop.
    Signal,
    /// A publisher failed.
    Error,
}

/// What the loop counted. `frames + skipped` is the number of periods elapsed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counts {
    /// Frames published.
    pub frames: u64,
    /// Incidents in which at least one period was skipped.
    pub overruns: u64,
    /// Periods skipped.
    pub skipped: u64,
    /// Why it ended.
    pub end: End,
}

/// The queues from the loop to the statistics thread, allocated beforehand.
pub struct Reports {
    /// One sample a frame.
    pub samples: rtrb::Producer<Sample>,
    /// Every alert.
    pub alerts: rtrb::Producer<CollisionAlert>,
}

/// Publishes a frame a period until `stop` is set or the periods are over.
///
/// A frame is computed in its own period, however late: if one or more whole periods have passed meanwhile, they are
/// skipped and counted, and the loop goes on in phase with its first deadline. Nothing is caught up.
///
/// # Errors
/// The first [`PublishError`], with what was counted until then.
pub fn run_loop(
    frames: &mut dyn Frames,
    publishers: &mut [Box<dyn Publisher>],
    options: LoopOptions,
    mut reports: Reports,
    stop: &AtomicBool,
) -> Result<Counts, (Counts, PublishError)> {
    let mut counts = Counts { frames: 0, overruns: 0, skipped: 0, end: End::Signal };
    let deadlines = Deadlines::starting_now(options.rate);
    let mut maintained = 0;
    let mut tick = 0;
    loop {
        let deadline_ns = deadlines.of(tick);
        if !wait(deadline_ns, stop, publishers, &mut maintained) {
            return Ok(counts);
        }
        let woke_ns = monotonic_ns();
        let lateness_ns = woke_ns.saturating_sub(deadline_ns);
        let present = deadlines.latest_at(woke_ns).max(tick).min(options.periods.unwrap_or(u64::MAX));
        if present > tick {
            counts.overruns += 1;
            counts.skipped += present - tick;
            tick = present;
        }
        if options.periods.is_some_and(|periods| tick >= periods) {
            counts.end = End::Duration;
            return Ok(counts);
        }
        let frame = frames.frame(tick);
        let stamps = Stamps {
            run_id: options.run_id,
            sequence: counts.frames,
            stamp_ns: realtime_ns(),
            deadline_ns: deadlines.of(tick),
        };
        let header = frame_header(frame, stamps);
        for publisher in publishers.iter_mut() {
            if let Err(error) = publisher.publish(&header, frame) {
                counts.end = End::Error;
                return Err((counts, error));
            }
        }
        counts.frames += 1;
        report(&mut reports, &header, frame, &counts, lateness_ns, woke_ns, publishers);
        tick += 1;
    }
}

/// Waits for a deadline; false if the loop is to stop. Long waits are cut up, so that late subscribers are let in and
/// a stop is heeded in time.
fn wait(deadline_ns: u64, stop: &AtomicBool, publishers: &mut [Box<dyn Publisher>], maintained: &mut u64) -> bool {
    loop {
        if stop.load(Ordering::Relaxed) {
            return false;
        }
        let now = monotonic_ns();
        if now >= *maintained + MAINTENANCE_NS {
            publishers.iter_mut().for_each(|publisher| publisher.maintain());
            *maintained = now;
        }
        if now >= deadline_ns {
            return true;
        }
        sleep_until(deadline_ns.min(*maintained + MAINTENANCE_NS));
    }
}

/// Hands the statistics thread what it counts. Where that thread is behind by the whole queue, the sample is lost and
/// the thread sees so by its sequence.
fn report(
    reports: &mut Reports,
    header: &FrameHeader,
    frame: &Frame,
    counts: &Counts,
    lateness_ns: u64,
    woke_ns: u64,
    publishers: &[Box<dyn Publisher>],
) {
    for alert in &frame.alerts {
        // A full queue loses the line on the terminal, never the alert that was published.
        let _ = reports.alerts.push(collision_alert(header, alert));
    }
    let sample = Sample {
        tick: frame.tick,
        sim_time: frame.sim_time,
        shows_played: frame.shows_played,
        unforeseen_contacts: frame.unforeseen_contacts,
        unsolved_frames: frame.unsolved_frames,
        counts: *counts,
        lateness_ns,
        step_ns: monotonic_ns().saturating_sub(woke_ns),
        subscribers: publishers.first().map_or(0, |publisher| publisher.subscribers()),
    };
    let _ = reports.samples.push(sample);
}
