//! The conductor: a thread that sends the commands and checks their answers, and one that reads the frames beside it.
//!
//! Steps are sent by a client of their own, since they are answered when they are over and other commands come between.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use super::Conducted;
use super::commands::RandomCommands;
use super::model::{Model, ShowFacts};
use super::record::{Answered, Record};
use bench_dragon_client::clock::monotonic_ns;
use bench_dragon_client::connection::Wake;
use bench_dragon_client::control::{ControlError, Controller};
use bench_dragon_client::feed::{Feed, FeedEvent, FeedOptions, Frames};
use bench_dragon_client::shared_memory::OpenError;
use bench_dragon_messages::ControlResponse;
use bench_dragon_messages::control::{Code, Command};

/// How long the publisher may take to answer.
const TIMEOUT: Duration = Duration::from_secs(10);
/// How long the control service may take to appear.
const START_TIMEOUT: Duration = Duration::from_secs(30);
/// Between two readings of the frames.
const READ_INTERVAL: Duration = Duration::from_millis(1);
/// Between two questions whether a step has begun.
const STEP_INTERVAL: Duration = Duration::from_millis(1);
/// How long the last frames may take to come.
const END_TIMEOUT: Duration = Duration::from_secs(1);

/// Conducts the publisher of `name` until `stop` is set; hands over what has been counted at the beginning, once a second,
/// and at the end.
///
/// # Errors
/// [`OpenError`] where its frames cannot be read, and what `report` returns.
pub fn conduct<Failed: From<OpenError>>(
    name: &str,
    facts: &ShowFacts,
    seed: u64,
    stop: &AtomicBool,
    report: &mut dyn FnMut(Conducted) -> Result<(), Failed>,
) -> Result<(), Failed> {
    let mut feed = Feed::new(name, FeedOptions { wake: Wake::Never, frames: Frames::All })?;
    let mut record = Record::new(seed, facts.rate);
    report(record.conducted())?;
    let (events, answers) = channel();
    std::thread::scope(|scope| {
        let commands = RandomCommands::new(seed, facts.rate, facts.end);
        let ended = scope.spawn(move || Conductor::run(name, Model::new(facts.clone()), commands, stop, &events));
        let mut next = Instant::now() + Duration::from_secs(1);
        let mut end = None;
        loop {
            feed.poll(READ_INTERVAL, &mut |event| {
                if let FeedEvent::Frame { header, .. } = event {
                    record.frame(header);
                }
            })?;
            answers.try_iter().for_each(|answered| record.answered(answered));
            record.compare();
            if ended.is_finished() {
                let end = *end.get_or_insert_with(|| Instant::now() + END_TIMEOUT);
                answers.try_iter().for_each(|answered| record.answered(answered));
                if !record.is_waiting() || Instant::now() > end {
                    return report(record.conducted());
                }
            }
            if Instant::now() >= next {
                report(record.conducted())?;
                next += Duration::from_secs(1);
            }
        }
    })
}

/// A command, when it was sent and answered, and the answer.
struct Reply {
    command: Command,
    sent_ns: u64,
    answered_ns: u64,
    answer: Result<ControlResponse, ControlError>,
}

fn send(controller: &mut Controller, command: Command) -> Reply {
    let sent_ns = monotonic_ns();
    let answer = controller.send(command, TIMEOUT);
    Reply { command, sent_ns, answered_ns: monotonic_ns(), answer }
}

/// Connects as soon as there is a publisher; `None` where none comes in time.
pub fn connect(name: &str, stop: &AtomicBool) -> Option<Controller> {
    let began = Instant::now();
    while began.elapsed() < START_TIMEOUT && !stop.load(Ordering::Relaxed) {
        if let Ok(controller) = Controller::new(name) {
            return Some(controller);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    None
}

/// The thread that sends.
struct Conductor<'a> {
    controller: Controller,
    model: Model,
    /// Whether the model knows nothing of the show, because an answer was lost.
    lost: bool,
    steps: Sender<u64>,
    step_replies: Receiver<Reply>,
    /// Whether a step has no answer yet.
    stepping: bool,
    events: &'a Sender<Answered>,
}

impl Conductor<'_> {
    fn run(name: &str, model: Model, commands: RandomCommands, stop: &AtomicBool, events: &Sender<Answered>) {
        let Some(controller) = connect(name, stop) else { return };
        let (steps, requests) = channel();
        let (replies, step_replies) = channel();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                let Some(mut controller) = connect(name, stop) else { return };
                for periods in requests {
                    // Nobody receives any more where the test has ended.
                    let _ = replies.send(send(&mut controller, Command::Step(periods)));
                }
            });
            let mut conductor =
                Conductor { controller, model, lost: false, steps, step_replies, stepping: false, events };
            let mut due = Instant::now();
            for (gap, command) in commands {
                due += gap;
                conductor.wait_until(due, stop);
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                conductor.command(command);
            }
            conductor.wait_for_step();
        });
    }

    fn wait_until(&mut self, due: Instant, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let left = due.saturating_duration_since(Instant::now()).min(Duration::from_millis(50));
            if left.is_zero() {
                return;
            }
            if self.stepping { self.take_step_reply(left) } else { std::thread::sleep(left) }
        }
    }

    fn command(&mut self, command: Command) {
        match command {
            Command::Step(periods) if !self.stepping => self.begin_step(periods),
            Command::Step(periods) => self.second_step(periods),
            command => self.obey(command),
        }
        if self.stepping {
            self.take_step_reply(Duration::ZERO);
        }
    }

    fn obey(&mut self, command: Command) {
        let reply = send(&mut self.controller, command);
        self.answered(reply);
    }

    /// Hands a step to the other client, and waits until it has certainly begun, or is over.
    fn begin_step(&mut self, periods: u64) {
        self.model.step_sent(periods);
        self.stepping = self.steps.send(periods).is_ok();
        while self.stepping && !self.model.step_has_begun() {
            self.obey(Command::State);
            self.take_step_reply(STEP_INTERVAL);
        }
    }

    /// A step while another runs. It is refused, unless that one is over meanwhile.
    fn second_step(&mut self, periods: u64) {
        let reply = send(&mut self.controller, Command::Step(periods));
        if reply.answer.as_ref().is_ok_and(|answer| answer.result() == Some(Code::Refused)) {
            return self.answered(reply);
        }
        self.wait_for_step();
        self.model.step_sent(periods);
        self.step_answered(reply);
    }

    fn wait_for_step(&mut self) {
        let began = Instant::now();
        while self.stepping && began.elapsed() < 2 * TIMEOUT {
            self.take_step_reply(Duration::from_millis(50));
        }
    }

    fn take_step_reply(&mut self, timeout: Duration) {
        match self.step_replies.recv_timeout(timeout) {
            Ok(reply) => {
                self.stepping = false;
                self.step_answered(reply);
            }
            Err(RecvTimeoutError::Timeout) => (),
            Err(RecvTimeoutError::Disconnected) => self.stepping = false,
        }
    }

    fn answered(&mut self, reply: Reply) {
        let command = reply.command;
        self.check(reply, |model, answer| model.answered(command, answer), false);
    }

    fn step_answered(&mut self, reply: Reply) {
        self.check(reply, Model::step_answered, true);
    }

    fn check(
        &mut self,
        reply: Reply,
        check: impl FnOnce(&mut Model, &ControlResponse) -> Result<(), String>,
        is_step_that_ran: bool,
    ) {
        let Reply { command, sent_ns, answered_ns, answer } = reply;
        let answer = match answer {
            Ok(answer) if self.lost => {
                self.model.adopt(&answer);
                self.lost = false;
                Ok((answer, Ok(())))
            }
            Ok(answer) => Ok((answer, check(&mut self.model, &answer))),
            Err(error) => {
                self.lost = true;
                Err(error.to_string())
            }
        };
        // Nobody receives any more where the test has ended.
        let _ = self.events.send(Answered { command, sent_ns, answered_ns, answer, is_step_that_ran });
    }
}
