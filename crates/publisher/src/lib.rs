//! The publisher: a fixed-rate loop whose frames go into shared memory and to any other transport.
//!
//! [`live`] is the loop, its statistics and its command queue. [`transports`] carry frames to other processes.
//! [`log`](mod@log) writes commands and hashes, from which a run can be computed again. [`run`] starts and stops all of
//! them for the commands `run` and `replay`. The command `verify` reads logs.

pub mod live;
pub mod log;
pub mod run;
pub mod transports;
