//! The live loop: wait for the deadline, compute the frame, hand it to the publishers, count.
//!
//! In: [`Frames`] and a [`Clock`]. Out: frames to every [`Publisher`], samples and alerts to a queue that never blocks.
//! Knows no transport and no solver. The `run` command calls [`run_loop`] on a thread of its own, and [`statistics`] on
//! another, which empties that queue.

pub mod control;
pub mod realtime;
pub mod statistics;
#[cfg(test)]
mod tests;

use std::sync::atomic::{AtomicBool, Ordering};

use bench_dragon_messages::control::Command;
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, LoopStatus};
use bench_dragon_show::convert::{Stamps, collision_alert, cue, frame_header};
use bench_dragon_show::{Frame, Outcome, Show};

use bench_dragon_client::clock::{Clock, Deadlines};
use control::Doors;
use statistics::Sample;

/// Nanoseconds between two calls of [`Publisher::maintain`].
const MAINTENANCE_NS: u64 = 100_000_000;

/// Alerts and cues that are messages already, since they come from a recording. Their run and stamp are not used.
#[derive(Debug, Default)]
pub struct Messages {
    /// The alerts, in order.
    pub alerts: Vec<CollisionAlert>,
    /// The cues, in order.
    pub cues: Vec<Cue>,
}

impl Messages {
    /// None.
    pub const NONE: &'static Self = &Self { alerts: Vec::new(), cues: Vec::new() };
}

/// A frame on its way out, with what goes out beside it.
#[derive(Debug, Clone, Copy)]
pub struct Outgoing<'a> {
    /// The frame's header, complete but for `sent_ns`, which the publisher sets just before sending.
    pub header: &'a FrameHeader,
    /// The frame.
    pub frame: &'a Frame,
    /// What goes out beside it and is not of the frame.
    pub messages: &'a Messages,
}

impl<'a> Outgoing<'a> {
    /// A frame with its own alerts and cues.
    pub fn new(header: &'a FrameHeader, frame: &'a Frame) -> Self {
        Self { header, frame, messages: Messages::NONE }
    }

    /// The alerts that go with the frame.
    pub fn alerts(self) -> impl Iterator<Item = CollisionAlert> {
        let FrameHeader { run_id, stamp_ns, .. } = *self.header;
        let own = self.frame.alerts.iter().map(move |alert| collision_alert(self.header, alert));
        own.chain(self.messages.alerts.iter().map(move |alert| CollisionAlert { run_id, stamp_ns, ..*alert }))
    }

    /// The cues that go with the frame.
    pub fn cues(self) -> impl Iterator<Item = Cue> {
        let FrameHeader { run_id, stamp_ns, .. } = *self.header;
        let own = self.frame.cues.iter().map(move |reached| cue(self.header, reached));
        own.chain(self.messages.cues.iter().map(move |cue| Cue { run_id, stamp_ns, ..*cue }))
    }
}

/// Where frames go. Called on the real-time thread: an implementation must not allocate, lock, log or make a system
/// call besides its transport's own.
pub trait Publisher {
    /// Sends one frame with its alerts and cues.
    ///
    /// # Errors
    /// A sentence for people where the transport failed in a way that ends the run; a slow or dead subscriber is no
    /// error.
    fn publish(&mut self, outgoing: Outgoing<'_>) -> Result<(), PublishError>;

    /// What makes the next frame cheaper. Called when a step is over and has been measured.
    fn prepare(&mut self) {}

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

/// What a period brings.
#[derive(Debug, Clone, Copy)]
pub enum Period<'a> {
    /// A frame, and what goes out beside it.
    Frame(&'a Frame, &'a Messages),
    /// Nothing.
    Empty,
    /// Nothing, as all that follow: the loop ends.
    Over,
}

impl<'a> From<&'a Frame> for Period<'a> {
    fn from(frame: &'a Frame) -> Self {
        Self::Frame(frame, Messages::NONE)
    }
}

/// Where frames come from, by tick.
pub trait Frames {
    /// What the period `tick` brings. Each call's tick is greater than the one before.
    fn frame(&mut self, tick: u64) -> Period<'_>;

    /// Obeys a command at the beginning of the period `tick`, before its frame. `None` for one that is answered by
    /// [`finished_step`](Self::finished_step).
    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome>;

    /// The answer to the step that was over, or broken off, at `tick`.
    fn finished_step(&mut self, tick: u64) -> Option<Outcome>;
}

impl Frames for Show {
    fn frame(&mut self, tick: u64) -> Period<'_> {
        Show::frame(self, tick).into()
    }

    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome> {
        Show::command(self, tick, command)
    }

    fn finished_step(&mut self, tick: u64) -> Option<Outcome> {
        Show::finished_step(self, tick)
    }
}

/// How the loop runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopOptions {
    /// The run's number, in every header.
    pub run_id: u64,
    /// Frames per second.
    pub rate: f64,
    /// The number of periods after which the loop ends; `None` for a loop that only its stop flag ends.
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
    /// Its stop flag was set.
    Signal,
    /// Its frames were over, as those of a recording are.
    Recording,
    /// A publisher failed.
    Error,
}

/// What the loop counted. `frames + skipped` is the number of periods elapsed, but for those that brought nothing; where a
/// publisher failed, those before the period in which it did.
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

/// What a transport with a queue of its own has done with the frames of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct Deliveries {
    /// Frames sent.
    pub frames: u64,
    /// Frames left out because the transport was behind.
    pub skipped: u64,
    /// Messages that the transport's own queues did not take, because a receiver was slow or dead.
    pub discarded: u64,
}

/// What went out besides a frame, for the terminal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Announcement {
    /// An alert.
    Alert {
        /// As it was published.
        alert: CollisionAlert,
        /// Simulated seconds per second of wall time, as in force then.
        time_scale: f64,
    },
    /// A cue that the show has reached.
    Cue(Cue),
}

/// The queues from the loop to the statistics thread, allocated beforehand.
pub struct Reports {
    /// One sample a frame.
    pub samples: rtrb::Producer<Sample>,
    /// Every alert and every cue.
    pub announcements: rtrb::Producer<Announcement>,
}

/// Publishes a frame a period until `stop` is set or the periods are over.
///
/// A frame is computed in its own period, however late. Periods that have wholly passed meanwhile are skipped and
/// counted, never caught up; later deadlines do not shift.
///
/// # Errors
/// The first [`PublishError`], with what was counted until then.
pub fn run_loop<C: Clock>(
    clock: &C,
    frames: &mut dyn Frames,
    doors: &mut Doors,
    publishers: &mut [Box<dyn Publisher>],
    options: LoopOptions,
    mut reports: Reports,
    stop: &AtomicBool,
) -> Result<Counts, (Counts, PublishError)> {
    let mut counts = Counts { frames: 0, overruns: 0, skipped: 0, end: End::Signal };
    let periods = options.periods.unwrap_or(u64::MAX);
    let deadlines = Deadlines::starting_at(clock.monotonic_ns(), options.rate);
    let mut maintenance_due_ns = 0;
    let mut tick = 0;
    loop {
        let deadline_ns = deadlines.of(tick);
        let reached = wait(clock, deadline_ns, stop, publishers, &mut maintenance_due_ns);
        let woke_ns = clock.monotonic_ns();
        // The first period that has not wholly passed. A stop counts those before it too.
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
        doors.take_one(frames, tick);
        let (frame, messages) = match frames.frame(tick) {
            Period::Frame(frame, messages) => (frame, messages),
            Period::Empty => {
                doors.finish_step(frames, tick);
                tick += 1;
                continue;
            }
            Period::Over => {
                counts.end = End::Recording;
                return Ok(counts);
            }
        };
        let header = frame_header(frame, stamps);
        let outgoing = Outgoing { header: &header, frame, messages };
        for publisher in publishers.iter_mut() {
            if let Err(error) = publisher.publish(outgoing) {
                counts.end = End::Error;
                return Err((counts, error));
            }
        }
        counts.frames += 1;
        let sample = Sample {
            tick,
            sim_time: frame.sim_time,
            shows_played: frame.shows_played,
            unforeseen_contacts: frame.unforeseen_contacts,
            unsolved_frames: frame.unsolved_frames,
            counts,
            lateness_ns: woke_ns.saturating_sub(deadline_ns),
            step_ns: clock.monotonic_ns().saturating_sub(woke_ns),
            subscribers: publishers.iter().map(|publisher| publisher.subscribers()).sum(),
        };
        report(&mut reports, outgoing, sample);
        doors.finish_step(frames, tick);
        publishers.iter_mut().for_each(|publisher| publisher.prepare());
        tick += 1;
    }
}

/// Waits for a deadline; false where `stop` was set first. Long waits are cut up, so that late subscribers are let in
/// and a stop is heeded in time.
fn wait<C: Clock>(
    clock: &C,
    deadline_ns: u64,
    stop: &AtomicBool,
    publishers: &mut [Box<dyn Publisher>],
    maintenance_due_ns: &mut u64,
) -> bool {
    loop {
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

/// Hands the statistics thread what it counts, and the alerts. Where that thread is behind by the whole queue, the
/// sample or the line on the terminal is lost, never the frame or the alert that was published.
fn report(reports: &mut Reports, outgoing: Outgoing<'_>, sample: Sample) {
    for alert in outgoing.alerts() {
        let announcement = Announcement::Alert { alert, time_scale: outgoing.header.time_scale };
        let _ = reports.announcements.push(announcement);
    }
    for cue in outgoing.cues() {
        let _ = reports.announcements.push(Announcement::Cue(cue));
    }
    let _ = reports.samples.push(sample);
}
