//! Random commands of a soak test, from a seed. Each answer is checked against the table of commands and the frames.
//!
//! The hidden command `soak-load-generator` runs a [`load_generator`] in its own process, a client of the publisher.
//! The process prints [`Conducted`] once a second, which the [`fleet`](super::fleet) reads.

mod answers;
pub mod commands;
pub mod load_generator;
mod record;

pub use answers::ShowFacts;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use bench_dragon_publisher::live::statistics::Percentiles;

/// The counts of a load generator.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Conducted {
    /// The seed of its commands.
    pub seed: u64,
    /// The period of the publisher, in nanoseconds.
    pub period_ns: f64,
    /// Commands sent.
    pub sent: u64,
    /// Answers of each command, by the names of the command and of the code.
    pub answers: BTreeMap<String, BTreeMap<String, u64>>,
    /// Answers that refused a command or its value, as the command table does.
    pub refused_as_expected: u64,
    /// Answers that the command table does not allow.
    pub wrong: u64,
    /// Commands that were not answered.
    pub lost: u64,
    /// Answers that were compared with the frame of their tick.
    pub compared: u64,
    /// Answers that the frame of their tick contradicts.
    pub contradicted: u64,
    /// Jumps of simulated time that were commanded and done.
    pub jumps: u64,
    /// The first faults, in words.
    pub faults: Vec<String>,
    /// From sending a command to sending the frame of the period that executed it, ns. Without steps that ran.
    pub applied_ns: Option<Percentiles>,
    /// From sending a command to receiving its answer, ns. Without steps that ran.
    pub answered_ns: Option<Percentiles>,
}

impl Conducted {
    /// Returns the counts as sentences.
    pub fn lines(&self) -> Vec<String> {
        let kinds: Vec<_> =
            self.answers.iter().map(|(name, codes)| format!("{name} {}", codes.values().sum::<u64>())).collect();
        let mut lines = vec![
            format!("conducted with seed {}: {} commands ({})", self.seed, self.sent, kinds.join(", ")),
            format!(
                "{} refused as expected, {} wrong answers, {} lost answers; {} compared with the frame of their tick, \
                 {} of which contradict it",
                self.refused_as_expected, self.wrong, self.lost, self.compared, self.contradicted
            ),
        ];
        for (what, percentiles) in [("executed", self.applied_ns), ("answered", self.answered_ns)] {
            let Some(Percentiles { p50, p99, max, .. }) = percentiles else { continue };
            let figures = [("p50", p50), ("p99", p99), ("max", max)].map(|(name, ns)| {
                format!("{name} {:.2} ms ({:.1} periods)", ns as f64 / 1e6, ns as f64 / self.period_ns)
            });
            lines.push(format!("commands were {what} after {}", figures.join(", ")));
        }
        lines.extend(self.faults.iter().map(|fault| format!("fault: {fault}")));
        lines
    }
}
