//! One subscriber of a soak test: its role, its present process, and the observations of all its starts.

use std::process::{Child, ExitStatus};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::observation::{Latencies, Observation};
use bench_dragon_publisher::live::statistics::RunSummary;

/// The role of a subscriber.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Reads every frame, and must miss none.
    Steady,
    /// Sleeps longer than its queue lasts.
    Slow,
    /// Is killed with SIGKILL every few seconds and started again.
    Flaky,
}

impl Role {
    /// Returns its name in labels.
    pub fn name(self) -> &'static str {
        match self {
            Self::Steady => "steady",
            Self::Slow => "slow",
            Self::Flaky => "flaky",
        }
    }
}

/// The state of a subscriber's present process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProcessState {
    /// The process runs.
    Running,
    /// The process was sent SIGTERM and has not ended yet.
    Ending,
    /// The process has ended after SIGTERM.
    Ended,
    /// The process has ended without a signal from the soak test.
    EndedByItself,
}

/// A subscriber over all its starts.
#[derive(Debug)]
pub struct Member {
    /// Its name in the report.
    pub label: String,
    /// Its role.
    pub role: Role,
    /// The number of its processes so far, from 1.
    pub starts: u64,
    /// The state of the present process.
    pub state: ProcessState,
    /// Former processes that had ended by themselves.
    lost: u64,
    /// The moment of the end of the present process.
    ended: Option<Instant>,
    /// Its exit status, once the fleet has finished.
    pub(super) exit: Option<ExitStatus>,
    pub(super) child: Child,
    pub(super) spawned: Instant,
    /// The observation of its former processes.
    past: Observation,
    /// The observation of the present process.
    present: Observation,
    /// The latencies since the last row of figures.
    fresh: Option<Latencies>,
}

impl Member {
    /// Creates a subscriber whose first process has just been started.
    pub fn new(label: String, role: Role, child: Child) -> Self {
        Self {
            label,
            role,
            starts: 1,
            state: ProcessState::Running,
            lost: 0,
            ended: None,
            exit: None,
            child,
            spawned: Instant::now(),
            past: Observation::default(),
            present: Observation::default(),
            fresh: None,
        }
    }

    /// Replaces a process that was killed, or had ended before, by the next one.
    pub fn replace(&mut self, child: Child, had_ended: bool) {
        self.lost += u64::from(had_ended);
        self.past = self.seen();
        self.present = Observation::default();
        self.starts += 1;
        self.state = ProcessState::Running;
        (self.ended, self.exit) = (None, None);
        self.spawned = Instant::now();
        self.child = child;
    }

    /// Stores the observation of a start. The rest in the pipe of a former process is ignored.
    pub fn observed(&mut self, start: u64, observation: Observation) {
        if start == self.starts {
            self.fresh = Latencies::worst(self.fresh, observation.second);
            self.present = observation;
        }
    }

    /// Records the end of the process of a start.
    pub fn ended(&mut self, start: u64) {
        if start == self.starts {
            self.state = match self.state {
                ProcessState::Ending => ProcessState::Ended,
                _ => ProcessState::EndedByItself,
            };
            self.ended.get_or_insert_with(Instant::now);
        }
    }

    /// Returns the observation of all its processes.
    pub fn seen(&self) -> Observation {
        self.past.joined(&self.present)
    }

    /// Returns the observation of its present process.
    pub fn present(&self) -> &Observation {
        &self.present
    }

    /// Returns the latencies since the last call.
    pub fn take_fresh(&mut self) -> Option<Latencies> {
        self.fresh.take()
    }

    /// Returns the time from `began` to the end of the present process, if it has ended.
    pub(super) fn ended_after(&self, began: Instant) -> Option<Duration> {
        self.ended.map(|ended| ended.saturating_duration_since(began))
    }

    /// Returns the number of its former processes that ended by themselves.
    pub(super) fn lost(&self) -> u64 {
        self.lost
    }

    /// Returns the number of frames of the publisher after the last one that this subscriber received; 0 for a
    /// subscriber that need not keep up.
    pub fn missed_after_last(&self, summary: Option<&RunSummary>) -> u64 {
        let frames = summary.filter(|_| self.role == Role::Steady).map_or(0, |summary| summary.frames);
        frames.saturating_sub(self.seen().last_sequence + 1)
    }

    /// Returns the number of its processes that ended without a signal from the soak test, or did not end after one.
    /// Call it after the fleet has finished.
    pub fn failed(&self) -> u64 {
        self.lost + u64::from(self.state != ProcessState::Ended)
    }
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    fn process() -> Child {
        let mut child = Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        child
    }

    fn member() -> Member {
        Member::new("flaky 1".to_owned(), Role::Flaky, process())
    }

    #[test]
    fn only_a_process_that_ends_after_a_signal_has_not_failed() {
        let [mut right, mut early, mut hung] = [(); 3].map(|()| member());
        early.ended(1);
        right.state = ProcessState::Ending;
        hung.state = ProcessState::Ending;
        right.ended(1);
        assert_eq!([&right, &early, &hung].map(Member::failed), [0, 1, 1]);
        assert_eq!(early.state, ProcessState::EndedByItself);
    }

    #[test]
    fn starts_add_up_and_a_former_one_is_not_heard_any_more() {
        let mut member = member();
        let seen = |received| Observation { received, ..Observation::default() };
        member.observed(1, seen(10));
        member.replace(process(), false);
        member.observed(1, seen(500));
        member.ended(1);
        member.observed(2, seen(7));
        assert_eq!((member.seen().received, member.present().received), (17, 7));
        assert_eq!((member.state, member.starts), (ProcessState::Running, 2));
        member.replace(process(), true);
        member.state = ProcessState::Ended;
        assert_eq!(member.failed(), 1, "one ended by itself and was started again");
    }
}
