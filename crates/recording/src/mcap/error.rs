//! The reasons why a recording cannot be played.

use std::io;

use bench_dragon_messages::sentence::number;
use bench_dragon_show::scene::printable;

/// The reason why a file cannot be played: one sentence without the file's name.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read.
    #[error("{0}, expected a recording (MCAP)")]
    File(#[from] io::Error),
    /// The file is no MCAP.
    #[error("this is no MCAP file, expected a recording of bench-dragon record")]
    NotMcap,
    /// The file was cut.
    #[error("it has no end, as when its recorder was killed: mend it with bench-dragon record --recover")]
    NoEnd,
    /// The file has no index of its chunks.
    #[error("it has no index of its chunks: write one with bench-dragon record --recover")]
    NoIndex,
    /// A required topic is missing.
    #[error("it has no topic {0}, expected a recording with the topics handles and stage")]
    NoTopic(&'static str),
    /// Frames of several publishers.
    #[error("it has frames of several publishers ({}), expected those of one", printable(.0))]
    Publishers(String),
    /// The messages of a topic are of another type, or in another encoding.
    #[error("its topic {} has {}, expected {expected}", printable(.topic), printable(.found))]
    Type {
        /// The topic.
        topic: String,
        /// Its type and encoding.
        found: String,
        /// The expected type and encoding.
        expected: String,
    },
    /// The type has other fields than in this version.
    #[error(
        "its topic {} has {}, this program reads {own}: play it with the version of bench-dragon that recorded it \
         (--version prints its layouts)",
        printable(.topic), found.unwrap_or("a layout that this version does not know")
    )]
    Fields {
        /// The topic.
        topic: String,
        /// The layout of the recording, if an earlier version had it.
        found: Option<&'static str>,
        /// The layout of this version.
        own: &'static str,
    },
    /// There are no frames.
    #[error("it has no frames")]
    NoFrames,
    /// The index, a chunk, an attachment or a message cannot be read.
    #[error("it is damaged at byte {at} ({}): mend it with bench-dragon record --recover", printable(.reason))]
    Damaged {
        /// The start of the chunk, of the attachment or of the footer, in bytes.
        at: u64,
        /// The problem.
        reason: String,
    },
    /// A frame cannot be read, or cannot be played.
    #[error("it has a frame {0}")]
    Frame(String),
    /// A directory is no bag.
    #[error("{}, expected a directory with recordings (.mcap), or a recording", printable(.0))]
    Bag(String),
    /// One of the files of a bag cannot be played.
    #[error("{}: {error}", printable(.file))]
    InFile {
        /// The name of the file.
        file: String,
        /// The reason.
        error: Box<ReadError>,
    },
    /// The recording ends before the start.
    #[error("--start is {} and the recording reaches {end} s of the show, expected an earlier start", number(*.start))]
    Start {
        /// The requested simulated seconds.
        start: f64,
        /// The greatest simulated seconds in the recording.
        end: f64,
    },
}
