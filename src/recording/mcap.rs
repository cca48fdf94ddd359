//! Recordings of a show in MCAP: what every ROS 2 tool reads, with the topics, types and bytes that `run --ros2` sends.
//!
//! In: the messages of a publisher, as subscribers get them. Out: files. [`recorder`] decides what goes into which file,
//! [`file`] is one file with its channels and chunks, [`disk`] is where its bytes go; [`reader`] reads one.
//! Nothing here knows a transport. Called by the subscriber that records.

mod disk;
pub mod file;
pub mod reader;
pub mod recorder;
