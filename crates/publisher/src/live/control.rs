//! The command queues: commands to the loop, answers back, without blocking.
//!
//! [`CommandReceiver`] is the loop's end, [`CommandSender`] the end of a thread that gets commands from clients. The
//! loop executes at most one command at the beginning of a period, so that each has an exact tick. The queues take
//! turns.

use rtrb::{Consumer, Producer, RingBuffer};

use super::FrameSource;
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_show::Outcome;

/// The most commands of one queue without an answer.
pub const MOST_WAITING: usize = 64;

/// A command in its queue, with the ticket of its answer.
#[derive(Debug, Clone, Copy)]
struct Request {
    ticket: u64,
    command: Command,
}

/// The answer to a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// As [`CommandSender::send`] returned it.
    pub ticket: u64,
    /// The result of the command.
    pub outcome: Outcome,
}

/// The loop's end of a command queue.
pub struct CommandReceiver {
    requests: Consumer<Request>,
    answers: Producer<Answer>,
}

/// The sender's end of a command queue.
pub struct CommandSender {
    requests: Producer<Request>,
    answers: Consumer<Answer>,
    ticket: u64,
    waiting: usize,
}

/// Creates the two ends of a command queue.
pub fn command_queue() -> (CommandReceiver, CommandSender) {
    let (requests, request_inbox) = RingBuffer::new(MOST_WAITING);
    // Both queues have one length: a sender that reads no answers cannot send more commands than fit.
    let (answers, answer_inbox) = RingBuffer::new(MOST_WAITING);
    let sender = CommandSender { requests, answers: answer_inbox, ticket: 0, waiting: 0 };
    (CommandReceiver { requests: request_inbox, answers }, sender)
}

impl CommandSender {
    /// Sends a command to the loop. Returns the ticket of its answer.
    ///
    /// # Errors
    /// [`Code::TooMany`] if [`MOST_WAITING`] commands of this queue have no answer yet.
    pub fn send(&mut self, command: Command) -> Result<u64, Code> {
        if self.waiting >= MOST_WAITING {
            return Err(Code::TooMany);
        }
        self.ticket += 1;
        let ticket = self.ticket;
        self.requests.push(Request { ticket, command }).map_err(|_| Code::TooMany)?;
        self.waiting += 1;
        Ok(ticket)
    }

    /// Returns the next answer, if there is one.
    pub fn answer(&mut self) -> Option<Answer> {
        let answer = self.answers.pop().ok()?;
        self.waiting -= 1;
        Some(answer)
    }

    /// Returns the number of commands without an answer.
    pub fn waiting(&self) -> usize {
        self.waiting
    }
}

/// The loop's ends of all command queues.
#[derive(Default)]
pub struct CommandQueues {
    ports: Vec<CommandReceiver>,
    /// The index of the queue that is polled first.
    next: usize,
    /// The queue and the ticket of a step that has not ended.
    step: Option<(usize, u64)>,
}

impl CommandQueues {
    /// Creates the set of these queues.
    pub fn new(ports: Vec<CommandReceiver>) -> Self {
        Self { ports, next: 0, step: None }
    }

    /// Executes the next waiting command, if there is one, at the beginning of the period `tick`.
    pub fn take_one(&mut self, source: &mut dyn FrameSource, tick: u64) {
        for turn in 0..self.ports.len() {
            let queue = (self.next + turn) % self.ports.len();
            let Ok(Request { ticket, command }) = self.ports[queue].requests.pop() else { continue };
            self.next = queue + 1;
            // A step that has ended by now is answered before this command.
            self.finish_step(source, tick);
            match source.command(tick, command) {
                Some(outcome) => {
                    // A step that the command breaks off is answered before the command.
                    self.finish_step(source, tick);
                    self.answer(queue, ticket, outcome);
                }
                None => self.step = Some((queue, ticket)),
            }
            return;
        }
    }

    /// Answers a step that ended with the frame of `tick`.
    pub fn finish_step(&mut self, source: &mut dyn FrameSource, tick: u64) {
        if let Some((queue, ticket)) = self.step
            && let Some(outcome) = source.finished_step(tick)
        {
            self.step = None;
            self.answer(queue, ticket, outcome);
        }
    }

    fn answer(&mut self, queue: usize, ticket: u64, outcome: Outcome) {
        // There is room: a sender has at most as many commands without an answer.
        let _ = self.ports[queue].answers.push(Answer { ticket, outcome });
    }
}
