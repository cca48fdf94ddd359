//! The problems of a line of a log.

use super::super::lines::{FORMAT, LineError};
use bench_dragon_show::StartError;
use bench_dragon_show::scene::RangeError;

/// The problem of a line that no run can have written.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The file has no line.
    #[error("the file is empty, expected a log")]
    Empty,
    /// The line of the show is cut.
    #[error("it is cut, expected the line of the show")]
    CutShow,
    /// The line is longer than this number of bytes.
    #[error("it is longer than {0} bytes, expected a line of a log")]
    TooLong(u64),
    /// The line is not text.
    #[error("it is not UTF-8 text, expected a line of a log")]
    NotText,
    /// The line is damaged.
    #[error(transparent)]
    Damaged(#[from] LineError),
    /// The first line is of another kind.
    #[error("expected the line of the show, {{\"type\":\"show\",...}}")]
    NoShow,
    /// A later line is of a show.
    #[error("a second show, expected one a log")]
    SecondShow,
    /// The line is after the last line of a log.
    #[error("it stands behind the end of the log")]
    AfterEnd,
    /// The log has this other format.
    #[error("the format is {0}, expected {FORMAT}")]
    Format(u32),
    /// The behaviour at a contact or at the end has an unknown name.
    #[error("on_contact and at_end are not understood, expected \"stop\" or \"continue\", \"hold\" or \"loop\"")]
    Playback,
    /// A number of the playback is outside of its range.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// The start is outside of the motion.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The command or its result has an unknown name.
    #[error("the command is not understood, expected one of those of docs/conducting.md")]
    UnknownCommand,
    /// The tick is less than the next one.
    #[error("tick {tick} is out of order, expected {next} or a later one")]
    Tick {
        /// The tick of the line.
        tick: u64,
        /// The next tick.
        next: u64,
    },
    /// The range does not begin at the next tick.
    #[error("ticks {from} to {to} are out of order, expected to begin at tick {next}")]
    Ticks {
        /// The first tick of the line.
        from: u64,
        /// The last tick of the line.
        to: u64,
        /// The next tick.
        next: u64,
    },
    /// The range is longer than the rest of its second.
    #[error("ticks {from} to {to} are of several seconds, expected a line for each")]
    SeveralSeconds {
        /// The first tick of the line.
        from: u64,
        /// The last tick of the line.
        to: u64,
    },
    /// The line of a second is missing.
    #[error("ticks {from} to {to} are of several seconds without their hash, expected the line of second {second}")]
    NoHash {
        /// The first tick without a hash.
        from: u64,
        /// The last tick before the line.
        to: u64,
        /// The second without its line.
        second: u64,
    },
    /// Commands of a period have no frame, because the period is skipped.
    #[error("the period {tick} is skipped, expected its frame after line {line}")]
    SkippedCommands {
        /// The period.
        tick: u64,
        /// The line of the skipped period, from 1.
        line: u64,
    },
    /// The last tick of a second is the greatest number.
    #[error("the tick is too large")]
    LastTick,
    /// The line of a second follows no frame.
    #[error("there is no frame for its hash")]
    NoFrame,
    /// The line of a second is of other frames than those before it.
    #[error(
        "second {} with {} frames of ticks {} to {}, expected second {} with {} frames of ticks {} to {}",
        found.second, found.frames, found.from, found.to, expected.second, expected.frames, expected.from, expected.to
    )]
    Second {
        /// The frames of the line.
        found: FramesOfSecond,
        /// The frames before it.
        expected: FramesOfSecond,
    },
    /// The log ends before the frame of commands.
    #[error("the commands of tick {tick} in line {line} have no frame")]
    UnplayedCommands {
        /// The tick of the frame.
        tick: u64,
        /// The line of the latest command, from 1.
        line: u64,
    },
    /// The log ends before the hash of the frames from this tick on.
    #[error("the frames from tick {0} on have no hash")]
    Unhashed(u64),
    /// The last line has other totals than the lines before it.
    #[error(
        "{} frames, {} periods skipped, {} frames lost, expected {}, {}, {} from the lines before",
        found[0], found[1], found[2], expected[0], expected[1], expected[2]
    )]
    Totals {
        /// Frames, skipped periods and lost frames of the last line.
        found: [u64; 3],
        /// The same totals, of the lines before it.
        expected: [u64; 3],
    },
}

/// The frames of a second that have a hash.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FramesOfSecond {
    /// The second, from 0.
    pub second: u64,
    /// The first tick.
    pub from: u64,
    /// The last tick.
    pub to: u64,
    /// The number of frames.
    pub frames: u64,
}
