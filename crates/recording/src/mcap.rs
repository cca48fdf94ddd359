//! Recordings of a show in MCAP: what every ROS 2 tool reads, with the topics, types and bytes that `run --ros2` sends.
//!
//! In: the messages of a publisher, as subscribers get them. Out: files. [`recorder`] decides what goes into which file,
//! `run` is what is known of the run, `messages` fills the messages of each topic, `file` is one file with its channels and
//! chunks, `disk` is where its bytes go, [`recover`](mod@recover) mends one that was cut; [`reader`] reads what is to be played
//! again, from the `index` at its end. Nothing here knows a transport. Called by the subscriber that records, by its command,
//! and by the replay.

mod disk;
mod file;
mod index;
mod messages;
pub mod reader;
pub mod recorder;
pub mod recover;
mod run;
