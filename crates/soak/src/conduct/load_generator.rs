//! The load generator: a thread that sends the commands and checks their answers, and a thread that reads the frames.
//!
//! A second client sends the steps, because a step is answered only when it is over, and other commands come between.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use super::Conducted;
use super::answers::{AnswerCheck, ShowFacts, WrongAnswer};
use super::commands::RandomCommands;
use super::record::{Answered, Record};
use bench_dragon_client::clock::monotonic_ns;
use bench_dragon_client::connection::Wake;
use bench_dragon_client::control::{ControlError, Controller};
use bench_dragon_client::feed::{Delivery, Feed, FeedEvent, FeedOptions};
use bench_dragon_client::shared_memory::OpenError;
use bench_dragon_messages::ControlResponse;
use bench_dragon_messages::control::{Code, Command};

/// The time limit of an answer.
const TIMEOUT: Duration = Duration::from_secs(30);
/// The time limit of the publisher's start.
const START_TIMEOUT: Duration = Duration::from_secs(60);
/// The interval at which frames are read.
const READ_INTERVAL: Duration = Duration::from_millis(1);
/// The interval at which the state is requested until a step has begun.
const STEP_INTERVAL: Duration = Duration::from_millis(1);
/// The time limit of the last frames.
const END_TIMEOUT: Duration = Duration::from_secs(1);

/// Sends commands to the publisher of `name`, of `rate` frames per second, until `stop` is set. Reports its counts at
/// the beginning, once a second, and at the end.
///
/// # Errors
/// [`OpenError`] if its frames cannot be read, and the errors of `report`.
pub fn conduct<Failed: From<OpenError>>(
    name: &str,
    rate: f64,
    seed: u64,
    facts: ShowFacts,
    stop: &AtomicBool,
    report: &mut dyn FnMut(Conducted) -> Result<(), Failed>,
) -> Result<(), Failed> {
    let mut feed = Feed::new(name, FeedOptions { wake: Wake::Never, frames: Delivery::All })?;
    let mut record = Record::new(seed, rate);
    report(record.conducted())?;
    record.show_is(&facts);
    if !wait_for_stage(&mut feed, &mut record, &facts, stop)? {
        return report(record.conducted());
    }
    let (events, answers) = channel();
    std::thread::scope(|scope| {
        let commands = RandomCommands::new(seed, rate, facts.end);
        let ended =
            scope.spawn(move || LoadGenerator::run(name, AnswerCheck::new(facts, rate), commands, stop, &events));
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

/// Reads until the stage has come, and compares it with the facts of the scene. Returns false if it does not come in
/// time.
fn wait_for_stage(
    feed: &mut Feed,
    record: &mut Record,
    facts: &ShowFacts,
    stop: &AtomicBool,
) -> Result<bool, OpenError> {
    let began = Instant::now();
    let mut agrees = None;
    while agrees.is_none() && began.elapsed() < START_TIMEOUT && !stop.load(Ordering::Relaxed) {
        feed.poll(READ_INTERVAL, &mut |event| match event {
            FeedEvent::Stage { stage, .. } => agrees = Some(facts.agree_with(stage)),
            FeedEvent::Frame { header, .. } => record.frame(header),
            _ => (),
        })?;
    }
    if agrees == Some(false) {
        record.contradict("the stage has another end or other cues than the scene".to_owned());
    }
    Ok(agrees.is_some())
}

/// A command and its answer, with the moments of both.
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

/// Connects as soon as a publisher runs. Returns `None` if none starts in time.
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
struct LoadGenerator<'a> {
    controller: Controller,
    check: AnswerCheck,
    /// True if the state of the show is unknown, because an answer was lost.
    lost: bool,
    steps: Sender<u64>,
    step_replies: Receiver<Reply>,
    /// True if a step has no answer yet.
    stepping: bool,
    events: &'a Sender<Answered>,
}

impl LoadGenerator<'_> {
    fn run(name: &str, check: AnswerCheck, commands: RandomCommands, stop: &AtomicBool, events: &Sender<Answered>) {
        let Some(controller) = connect(name, stop) else { return };
        let (steps, requests) = channel();
        let (replies, step_replies) = channel();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                let Some(mut controller) = connect(name, stop) else { return };
                for periods in requests {
                    // The receiver is gone if the test has ended.
                    let _ = replies.send(send(&mut controller, Command::Step(periods)));
                }
            });
            let mut generator =
                LoadGenerator { controller, check, lost: false, steps, step_replies, stepping: false, events };
            let mut due = Instant::now();
            for (gap, command) in commands {
                due += gap;
                generator.wait_until(due, stop);
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                generator.command(command);
            }
            generator.wait_for_step();
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
            command => self.send(command),
        }
        if self.stepping {
            self.take_step_reply(Duration::ZERO);
        }
    }

    fn send(&mut self, command: Command) {
        let reply = send(&mut self.controller, command);
        self.answered(reply);
    }

    /// Hands a step to the other client, and waits until the step has certainly begun, or is over.
    fn begin_step(&mut self, periods: u64) {
        self.check.step_sent();
        self.stepping = self.steps.send(periods).is_ok();
        while self.stepping && !self.check.step_has_begun() {
            self.send(Command::State);
            self.take_step_reply(STEP_INTERVAL);
        }
    }

    /// Sends a step while another runs. The publisher refuses the step, unless the other step is over meanwhile.
    fn second_step(&mut self, periods: u64) {
        let reply = send(&mut self.controller, Command::Step(periods));
        if reply.answer.as_ref().is_ok_and(|answer| answer.result() == Some(Code::Refused)) {
            return self.answered(reply);
        }
        self.wait_for_step();
        self.check.step_sent();
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
        self.check_reply(reply, |check, answer| check.answered(command, answer), false);
    }

    fn step_answered(&mut self, reply: Reply) {
        self.check_reply(reply, AnswerCheck::step_answered, true);
    }

    fn check_reply(
        &mut self,
        reply: Reply,
        check: impl FnOnce(&mut AnswerCheck, &ControlResponse) -> Result<(), WrongAnswer>,
        is_step_that_ran: bool,
    ) {
        let Reply { command, sent_ns, answered_ns, answer } = reply;
        let answer = match answer {
            Ok(answer) if self.lost => {
                self.check.adopt(&answer);
                self.lost = false;
                Ok((answer, Ok(())))
            }
            Ok(answer) => Ok((answer, check(&mut self.check, &answer))),
            Err(error) => {
                self.lost = true;
                Err(Arc::new(error))
            }
        };
        // The receiver is gone if the test has ended.
        let _ = self.events.send(Answered { command, sent_ns, answered_ns, answer, is_step_that_ran });
    }
}
