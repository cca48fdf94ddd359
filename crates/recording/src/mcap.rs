//! Recordings of a show in MCAP, for every ROS 2 tool, with the topics, types and bytes of `run --ros2`.
//!
//! In: the messages of a publisher. Out: files. [`recorder`] chooses the file of each message, and `run` keeps the
//! state of the run. `messages` fills the messages of each topic. `file` is one file with its channels and chunks, and
//! `disk` writes its bytes. [`recover`](mod@recover) repairs a file that was cut. For a replay, [`reader`] reads a
//! file, or the files of a `bag`, by the `index` at the end of each. Both take the messages of a `chunk`, and test the
//! `lengths` within a record first. Nothing here knows a transport.

mod bag;
mod chunk;
mod disk;
mod error;
mod file;
mod index;
mod layout_history;
mod lengths;
mod messages;
pub mod reader;
pub mod recorder;
pub mod recover;
mod run;

pub use error::ReadError;
