//! The queues by which commands reach the loop and answers come back: one pair for each door, never blocking.
//!
//! [`CommandReceiver`] is the loop's end, [`CommandSender`] that of a thread which takes commands from outside. The loop takes at most
//! one command at the beginning of a period, so that each has an exact tick; the doors take turns.

use rtrb::{Consumer, Producer, RingBuffer};

use super::FrameSource;
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_show::Outcome;

/// Commands that a door may have waiting.
pub const MOST_WAITING: usize = 64;

/// A command on its way, with the number by which the door recognises its answer.
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
    /// What became of the command.
    pub outcome: Outcome,
}

/// The loop's end of a door's queues.
pub struct CommandReceiver {
    requests: Consumer<Request>,
    answers: Producer<Answer>,
}

/// The outer end of a door's queues.
pub struct CommandSender {
    requests: Producer<Request>,
    answers: Consumer<Answer>,
    ticket: u64,
    waiting: usize,
}

/// The queues of a door.
pub fn command_queue() -> (CommandReceiver, CommandSender) {
    let (requests, request_inbox) = RingBuffer::new(MOST_WAITING);
    // A door that takes no answers sends no more commands than there is room for their answers.
    let (answers, answer_inbox) = RingBuffer::new(MOST_WAITING);
    let door = CommandSender { requests, answers: answer_inbox, ticket: 0, waiting: 0 };
    (CommandReceiver { requests: request_inbox, answers }, door)
}

impl CommandSender {
    /// Sends a command to the loop; the number of its answer.
    ///
    /// # Errors
    /// [`Code::TooMany`] where [`MOST_WAITING`] commands of this door have no answer yet.
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

    /// The next answer, if one has come.
    pub fn answer(&mut self) -> Option<Answer> {
        let answer = self.answers.pop().ok()?;
        self.waiting -= 1;
        Some(answer)
    }

    /// Commands without an answer yet.
    pub fn waiting(&self) -> usize {
        self.waiting
    }
}

/// All doors of a loop.
#[derive(Default)]
pub struct CommandQueues {
    ports: Vec<CommandReceiver>,
    /// The door whose turn it is.
    next: usize,
    /// The door and the ticket of a step that is not over.
    step: Option<(usize, u64)>,
}

impl CommandQueues {
    /// The loop's ends of these doors.
    pub fn new(ports: Vec<CommandReceiver>) -> Self {
        Self { ports, next: 0, step: None }
    }

    /// Has the next command obeyed, if one waits, at the beginning of the period `tick`.
    pub fn take_one(&mut self, source: &mut dyn FrameSource, tick: u64) {
        for turn in 0..self.ports.len() {
            let door = (self.next + turn) % self.ports.len();
            let Ok(Request { ticket, command }) = self.ports[door].requests.pop() else { continue };
            self.next = door + 1;
            // Where the command is a step too, the one before it is over by now, and has its answer first.
            self.finish_step(source, tick);
            match source.command(tick, command) {
                Some(outcome) => {
                    // What a command breaks off is answered before it.
                    self.finish_step(source, tick);
                    self.answer(door, ticket, outcome);
                }
                None => self.step = Some((door, ticket)),
            }
            return;
        }
    }

    /// Answers the step that was over with the frame of `tick`.
    pub fn finish_step(&mut self, source: &mut dyn FrameSource, tick: u64) {
        if let Some((door, ticket)) = self.step
            && let Some(outcome) = source.finished_step(tick)
        {
            self.step = None;
            self.answer(door, ticket, outcome);
        }
    }

    fn answer(&mut self, door: usize, ticket: u64, outcome: Outcome) {
        // There is room: a door waits for no more answers than the queue holds.
        let _ = self.ports[door].answers.push(Answer { ticket, outcome });
    }
}
