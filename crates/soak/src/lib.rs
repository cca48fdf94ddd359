//! The soak test: a publisher and its subscribers as processes, observed for hours, and a verdict.
//!
//! The command `soak` starts a [`fleet`] of processes. Each subscriber process runs an [`observer`] and prints its
//! [`observation`]. With `--conduct` a [load generator](conduct) sends commands. [`figures`] go into a [`history`] of
//! bounded size, a [`verdict`] checks [`limits`], and a [`report`] shows them. The checks use the frames that
//! subscribers received, the publisher's status stream and summary, and /proc.

pub mod causes;
pub mod conduct;
pub mod conducting;
mod conformance;
pub mod figures;
pub mod fleet;
pub mod history;
mod junit;
pub mod limits;
pub mod member;
pub mod observation;
pub mod observer;
mod plots;
pub mod processes;
pub mod report;
pub mod resources;
#[cfg(test)]
mod strategies;
pub mod verdict;
