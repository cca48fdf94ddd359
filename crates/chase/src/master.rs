//! A show as the master of timecode. In: the events of a feed. Out: Art-Net timecode, MIDI timecode or the sound of
//! LTC, whose labels are current at the moments that the frames of the show state.
//!
//! A [`course`] extrapolates the latest frame, and a [`signal`] turns it into bytes with their moments. Both are pure.
//! The bytes are written at their moments, not when a frame comes: [`MasterClock`] sleeps until then.

pub mod course;
pub mod signal;

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use bench_dragon_client::clock::{monotonic_ns, sleep_until};
use bench_dragon_client::feed::FeedEvent;
use bench_dragon_client::polling::Handler;
use bench_dragon_messages::FrameHeader;

use self::course::Course;
use self::signal::Signal;
use crate::schedule::Schedule;
use crate::timecode::FrameRate;

/// The span after a poll whose bytes are written before the next poll, in nanoseconds: the interval of polls.
const AHEAD_NS: u64 = 2_000_000;

/// The receiver of the bytes.
pub trait Sink {
    /// Returns false while a write would wait for the reader.
    fn is_ready(&mut self) -> bool;
    /// Writes a message, or a piece of sound.
    ///
    /// # Errors
    /// The system's error, with which the timecode ends.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;
    /// Returns true if the bytes go to standard output, which then has nothing else.
    fn is_standard_output(&self) -> bool {
        false
    }
}

/// Counts of the timecode that was sent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct MasterSummary {
    /// Frames of the show that were received.
    pub frames: u64,
    /// Messages of timecode, or frames of sound.
    pub sent: u64,
    /// Jumps: starts, seeks, loops.
    pub jumps: u64,
    /// Milliseconds of sound that were left out, because they were late.
    pub lost_ms: u64,
}

/// The clock of one show, written to a sink as timecode.
pub struct MasterClock<'a, S> {
    schedule: Schedule,
    rate: FrameRate,
    signal: Box<dyn Signal>,
    sink: S,
    stop: &'a AtomicBool,
    course: Option<Course>,
    shares_clock: bool,
    has_warned: bool,
    result: io::Result<()>,
    summary: MasterSummary,
}

impl<'a, S: Sink> MasterClock<'a, S> {
    /// Creates the clock of a show, which sets `stop` when the sink fails.
    pub fn new(schedule: Schedule, rate: FrameRate, signal: Box<dyn Signal>, sink: S, stop: &'a AtomicBool) -> Self {
        Self {
            schedule,
            rate,
            signal,
            sink,
            stop,
            course: None,
            shares_clock: true,
            has_warned: false,
            result: Ok(()),
            summary: MasterSummary::default(),
        }
    }

    /// Returns the sink and the counts.
    ///
    /// # Errors
    /// The error of the sink that has ended the timecode.
    pub fn finish(self) -> io::Result<(S, MasterSummary)> {
        let lost_ms = self.signal.lost_ms();
        self.result.map(|()| (self.sink, MasterSummary { lost_ms, ..self.summary }))
    }

    fn frame(&mut self, header: &FrameHeader) {
        // A frame of another machine counts as made now.
        let made_ns = if self.shares_clock { header.deadline_ns } else { monotonic_ns() };
        let next = Course::of(header, made_ns, &self.schedule, self.rate);
        let is_jitter = |before: &Course| !self.shares_clock && before.is_jitter_of(&next);
        self.summary.frames += 1;
        let jumps = !self.course.is_some_and(|before| next.continues(&before));
        self.summary.jumps += u64::from(jumps);
        if jumps {
            self.signal.jump();
        }
        if !self.course.as_ref().is_some_and(is_jitter) {
            self.course = Some(next);
        }
        if next.is_too_fast_or_slow() && !std::mem::replace(&mut self.has_warned, true) {
            log::warn!("at this rate of the show timecode does not run: its labels are sent one by one (see --speed)");
        }
    }

    /// Writes the bytes that are due before the next poll, each at its moment.
    fn write_due(&mut self) -> io::Result<()> {
        let until_ns = monotonic_ns() + AHEAD_NS;
        while self.sink.is_ready() && !self.stop.load(Ordering::Relaxed) {
            let Some(due) = self.signal.next(self.course.as_ref(), monotonic_ns(), until_ns) else { break };
            sleep_until(due.at_ns);
            self.sink.write(&due.bytes)?;
            self.summary.sent += due.counts;
        }
        Ok(())
    }
}

impl<S: Sink> Handler for MasterClock<'_, S> {
    fn handle(&mut self, _publisher: usize, event: FeedEvent<'_>) {
        match event {
            FeedEvent::Frame { header, .. } => self.frame(header),
            FeedEvent::Silent | FeedEvent::Gone => self.course = None,
            _ => (),
        }
    }

    fn clock(&mut self, _publisher: usize, shares_clock: bool) {
        self.shares_clock = shares_clock;
    }

    fn polled(&mut self, _now: Instant) {
        if self.result.is_ok() {
            self.result = self.write_due();
            self.stop.fetch_or(self.result.is_err(), Ordering::Relaxed);
        }
    }
}
