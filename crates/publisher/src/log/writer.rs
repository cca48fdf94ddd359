//! Converts the contents of the queue, in the order of ticks, to the lines of a log.
//!
//! It runs on the log's thread. Each line is one write, so that a killed process leaves whole lines.

use std::io::{self, Write};

use super::hash::{FrameHasher, HANDLE_WORDS, HEADER_WORDS};
use super::lines::{HashChain, Line, SecondLine, ShowLine};
use crate::live::LoopCounts;
use bench_dragon_messages::control::CommandRecord;

/// The number of handles in the line of a second: evenly spread, with head and tail.
const SAMPLED_HANDLES: usize = 5;

/// Writes a log. After a failed write it writes nothing more.
pub(super) struct LogWriter<W> {
    file: W,
    chain: HashChain,
    failure: Option<io::Error>,
    /// True after a failed write.
    failed: bool,
    rate: f64,
    /// The next tick.
    expected: u64,
    second: Option<OpenSecond>,
    hasher: FrameHasher,
    /// The range of lost frames that is not written yet.
    lost_range: Option<(u64, u64)>,
    counts: LogCounts,
}

/// The counts of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct LogCounts {
    pub frames: u64,
    pub skipped: u64,
    pub lost: u64,
}

struct OpenSecond {
    from: u64,
    to: u64,
    frames: u64,
    sim_time: f64,
    handles: Vec<(u32, f64, f64)>,
}

/// Returns the second of a tick.
pub(super) fn second_of(tick: u64, rate: f64) -> u64 {
    (tick as f64 / rate) as u64
}

/// Returns the handles of a team in the line of a second.
pub(super) fn sampled(handles: usize) -> impl Iterator<Item = usize> {
    let last = handles - 1;
    let count = SAMPLED_HANDLES.min(handles);
    (0..count).map(move |k| k * last / (count - 1).max(1))
}

impl<W: Write> LogWriter<W> {
    /// Starts a log with its first line.
    pub fn new(file: W, show: ShowLine) -> Self {
        let mut writer = Self {
            file,
            chain: HashChain::default(),
            failure: None,
            failed: false,
            rate: show.rate,
            expected: 0,
            second: None,
            hasher: FrameHasher::default(),
            lost_range: None,
            counts: LogCounts::default(),
        };
        writer.write(&Line::Show(Box::new(show)));
        writer
    }

    /// Returns the error of the failed write, once.
    pub fn take_failure(&mut self) -> Option<io::Error> {
        self.failure.take()
    }

    /// Returns the counts so far.
    pub fn counts(&self) -> LogCounts {
        self.counts
    }

    /// Adds a command or the end of a step, before the frame of its tick.
    pub fn command(&mut self, tick: u64, record: CommandRecord) {
        self.arrive(tick);
        self.close_lost_range();
        self.write(&Line::of(tick, record));
    }

    /// Adds a frame: the words of its header and its columns.
    pub fn frame(&mut self, header: &[u64; HEADER_WORDS], columns: [&[f64]; HANDLE_WORDS]) {
        let (tick, sim_time) = (header[1], f64::from_bits(header[2]));
        self.arrive(tick);
        self.close_lost_range();
        self.hasher.frame(header, columns);
        self.counts.frames += 1;
        self.expected = tick + 1;
        let second = self.second.get_or_insert_with(|| OpenSecond {
            from: tick,
            to: tick,
            frames: 0,
            sim_time,
            handles: Vec::with_capacity(SAMPLED_HANDLES),
        });
        (second.to, second.sim_time) = (tick, sim_time);
        second.frames += 1;
        let [x, y, ..] = columns;
        second.handles.clear();
        second.handles.extend(sampled(x.len()).map(|handle| (handle as u32, x[handle], y[handle])));
    }

    /// Adds a published frame that the log has lost.
    pub fn lost(&mut self, tick: u64) {
        self.arrive(tick);
        self.counts.lost += 1;
        self.expected = tick + 1;
        self.lost_range = Some(self.lost_range.map_or((tick, tick), |(from, _)| (from, tick)));
    }

    /// Ends the log: from this tick on, the queue had no room.
    pub fn stopped(&mut self, tick: u64) {
        self.close_second();
        self.write(&Line::Stopped { tick });
    }

    /// Ends the log of a run with these counts.
    pub fn end(&mut self, run: &LoopCounts) {
        // Periods may have passed between the last frame and the end.
        self.arrive(run.frames + run.skipped);
        self.close_second();
        let LogCounts { frames, skipped, lost } = self.counts;
        self.write(&Line::End { frames, skipped, lost, reason: run.end });
    }

    /// Ends the log of a run without counts: it has no last line.
    pub fn break_off(&mut self) {
        self.close_second();
    }

    /// Completes the lines before a tick.
    fn arrive(&mut self, tick: u64) {
        let earlier = self.expected.saturating_sub(1);
        if second_of(tick, self.rate) > second_of(earlier, self.rate) {
            self.close_second();
        }
        if tick > self.expected {
            self.close_lost_range();
            self.counts.skipped += tick - self.expected;
            self.write(&Line::Skipped { from: self.expected, to: tick - 1 });
            self.expected = tick;
        }
    }

    fn close_lost_range(&mut self) {
        if let Some((from, to)) = self.lost_range.take() {
            self.write(&Line::Lost { from, to });
        }
    }

    fn close_second(&mut self) {
        self.close_lost_range();
        if let Some(OpenSecond { from, to, frames, sim_time, handles }) = self.second.take() {
            let (second, hash) = (second_of(from, self.rate), self.hasher.take());
            self.write(&Line::Second(SecondLine { second, from, to, frames, hash, sim_time, handles }));
        }
    }

    fn write(&mut self, line: &Line) {
        if self.failed {
            return;
        }
        let text = self.chain.line(line);
        if let Err(error) = self.file.write_all(text.as_bytes()) {
            (self.failed, self.failure) = (true, Some(error));
        }
    }
}
