//! The soak test: a publisher and its subscribers as processes, watched for hours, and a verdict.
//!
//! The command `soak` starts a [`fleet`]; each subscriber process runs an [`observer`]; figures go into a [`history`] of
//! bounded size; a [`verdict`] holds them against limits; a [`report`] shows them. What is judged is what subscribers
//! received, what the publisher's status stream and summary say, and what /proc knows of its process.

pub mod fleet;
pub mod history;
pub mod observer;
mod plots;
pub mod report;
pub mod resources;
pub mod verdict;
