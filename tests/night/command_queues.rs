//! Commands: one a period, in turn of the queues and in order within each; every command answered once; commands beyond
//! the limit refused.

use std::collections::VecDeque;

use bench_dragon::messages::control::{Code, Command};
use bench_dragon::publisher::live::control::Answer;
use bench_dragon::show::Outcome;

use crate::world::same;

/// Most commands of one queue without an answer: the promise of the queue.
const MOST_WAITING: usize = 64;

/// State of one command queue.
#[derive(Default)]
struct QueueState {
    sent: u64,
    waiting: VecDeque<(u64, Command)>,
    /// Answers that the loop has given, in order, and that no client has taken yet.
    given: VecDeque<(u64, Outcome)>,
    taken: u64,
    refused: u64,
}

impl QueueState {
    /// Returns the number of accepted commands whose answer was not taken.
    fn open(&self) -> usize {
        (self.sent - self.taken) as usize
    }
}

/// All command queues, as the loop must see them.
pub struct QueueCheck {
    queues: Vec<QueueState>,
    next: usize,
    /// The period in which the last command was executed.
    executed: Option<u64>,
    /// The command that is executed now, with its queue.
    present: Option<(usize, u64)>,
    /// The step in progress, with its queue.
    step: Option<(usize, u64)>,
    answer: Option<(usize, u64, Outcome)>,
}

impl QueueCheck {
    pub fn new(queues: usize) -> Self {
        let queues = (0..queues).map(|_| QueueState::default()).collect();
        Self { queues, next: 0, executed: None, present: None, step: None, answer: None }
    }

    /// Records a command that was sent to a queue.
    pub fn sent(&mut self, queue: usize, command: Command, result: Result<u64, Code>) {
        let at = &mut self.queues[queue];
        if at.open() >= MOST_WAITING {
            same("a command too many", result, Err(Code::TooMany));
            at.refused += 1;
        } else {
            at.sent += 1;
            same("the number of a command", result, Ok(at.sent));
            at.waiting.push_back((at.sent, command));
        }
    }

    /// Checks a command that is executed at the beginning of the period `tick`.
    pub fn executed(&mut self, tick: u64, command: Command) {
        assert!(self.executed < Some(tick), "a second command in the period {tick}");
        self.executed = Some(tick);
        let queues = self.queues.len();
        let turn =
            (0..queues).map(|turn| (self.next + turn) % queues).find(|queue| !self.queues[*queue].waiting.is_empty());
        let queue = turn.expect("a command that no client has sent");
        let (ticket, expected) = self.queues[queue].waiting.pop_front().expect("one waits");
        // A value of NaN does not equal itself.
        same("the command", format!("{command:?}"), format!("{expected:?}"));
        self.next = (queue + 1) % queues;
        self.present = Some((queue, ticket));
    }

    /// Records the show's answer to the command; `None` for a step that has begun.
    pub fn answered(&mut self, outcome: Option<Outcome>) {
        let (queue, ticket) = self.present.take().expect("a command");
        match outcome {
            Some(outcome) => self.answer = Some((queue, ticket, outcome)),
            None => {
                assert!(self.step.is_none(), "the step before was never answered");
                self.step = Some((queue, ticket));
            }
        }
    }

    /// Records the answer to a step that is complete, or was cancelled.
    pub fn step_is_over(&mut self, outcome: Outcome) {
        let (queue, ticket) = self.step.take().expect("a step");
        self.queues[queue].given.push_back((ticket, outcome));
    }

    /// Records the answer of the executed command, after the answer to the step that it cancelled.
    pub fn settle(&mut self) {
        if let Some((queue, ticket, outcome)) = self.answer.take() {
            self.queues[queue].given.push_back((ticket, outcome));
        }
    }

    /// Checks before the frame of the period `tick` that no command waits without reason.
    pub fn frame_begins(&mut self, tick: u64) {
        self.settle();
        let in_vain = self.executed != Some(tick) && self.queues.iter().any(|queue| !queue.waiting.is_empty());
        assert!(!in_vain, "a command waits and none is executed in the period {tick}");
    }

    /// Checks an answer that a client has taken from a queue.
    pub fn taken(&mut self, queue: usize, answer: &Answer) {
        let at = &mut self.queues[queue];
        at.taken += 1;
        same("the answer", Some((answer.ticket, answer.outcome)), at.given.pop_front());
    }

    /// Checks the number of unanswered commands, after the end of the loop and the last answer.
    pub fn ended(&self) {
        let open: usize = self.queues.iter().map(QueueState::open).sum();
        let waiting: usize = self.queues.iter().map(|queue| queue.waiting.len()).sum();
        let step = usize::from(self.step.is_some());
        same("commands without an answer", open, waiting + step);
    }

    /// Returns the number of accepted commands, and of those for which there was no room.
    pub fn totals(&self) -> (u64, u64) {
        (self.queues.iter().map(|queue| queue.sent).sum(), self.queues.iter().map(|queue| queue.refused).sum())
    }
}
