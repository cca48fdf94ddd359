//! The soak test: a publisher and its subscribers as processes, observed for hours, and a verdict.
//!
//! The command `soak` starts a [`fleet`] of processes; each subscriber process runs an [`observer`] and prints its
//! [`observation`]; where the show is conducted, a [conductor](conduct) sends commands; [`figures`] go into a [`history`] of bounded size; a [`verdict`] checks [`limits`]; a [`report`] shows
//! them. What is checked is what subscribers received, what the publisher's status stream and summary contain, and what
//! /proc reports of its process.

pub mod conduct;
pub mod conducting;
mod conformance;
pub mod figures;
pub mod fleet;
pub mod histograms;
pub mod history;
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
