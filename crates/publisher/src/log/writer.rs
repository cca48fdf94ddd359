//! From what the queue brings, in the order of ticks, to the lines of a log.
//!
//! [`super::log`] calls it on the log's thread. Each line is one write, so that a killed process leaves whole lines.

use std::io::{self, Write};

use super::hash::{FrameHasher, HANDLE_WORDS, HEADER_WORDS};
use super::lines::{HashChain, Line, SecondLine, ShowLine};
use crate::live::LoopCounts;
use bench_dragon_messages::control::CommandRecord;

/// Handles whose places stand in the line of a second: evenly spread, head and tail among them.
const SAMPLED_HANDLES: usize = 5;

/// Writes a log. After a write has failed it writes nothing more.
pub(super) struct LogWriter<W> {
    file: W,
    chain: HashChain,
    failure: Option<io::Error>,
    /// Whether a write has failed.
    failed: bool,
    rate: f64,
    /// The first tick of which nothing is known yet.
    expected: u64,
    second: Option<OpenSecond>,
    hasher: FrameHasher,
    /// The range of lost frames that is not written yet.
    lost_range: Option<(u64, u64)>,
    counts: LogCounts,
}

/// What a log holds.
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

/// The second that a tick lies in.
pub(super) fn second_of(tick: u64, rate: f64) -> u64 {
    (tick as f64 / rate) as u64
}

/// The handles of a team that stand in the line of a second.
pub(super) fn sampled(handles: usize) -> impl Iterator<Item = usize> {
    let last = handles - 1;
    let count = SAMPLED_HANDLES.min(handles);
    (0..count).map(move |k| k * last / (count - 1).max(1))
}

impl<W: Write> LogWriter<W> {
    /// A log with its first line.
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

    /// Why nothing is written any more, once.
    pub fn take_failure(&mut self) -> Option<io::Error> {
        self.failure.take()
    }

    /// What the log holds so far.
    pub fn counts(&self) -> LogCounts {
        self.counts
    }

    /// A command or the end of a step, before the frame of its tick.
    pub fn command(&mut self, tick: u64, record: CommandRecord) {
        self.arrive(tick);
        self.close_lost_range();
        self.write(&Line::of(tick, record));
    }

    /// A frame: what its header contributes to the hash, and its columns.
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

    /// A frame that was published and is not here.
    pub fn lost(&mut self, tick: u64) {
        self.arrive(tick);
        self.counts.lost += 1;
        self.expected = tick + 1;
        self.lost_range = Some(self.lost_range.map_or((tick, tick), |(from, _)| (from, tick)));
    }

    /// The queue could not even take what is lost from this tick on.
    pub fn stopped(&mut self, tick: u64) {
        self.close_second();
        self.write(&Line::Stopped { tick });
    }

    /// The end of a run of which the loop has counted this.
    pub fn end(&mut self, run: &LoopCounts) {
        // Periods may have passed between the last frame and the end.
        self.arrive(run.frames + run.skipped);
        self.close_second();
        let LogCounts { frames, skipped, lost } = self.counts;
        self.write(&Line::End { frames, skipped, lost, reason: run.end });
    }

    /// The end of a run of which nothing is known: the log has no last line.
    pub fn break_off(&mut self) {
        self.close_second();
    }

    /// Something of this tick follows: what comes before it is complete.
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
