//! Commands sent by a separate thread, so that the caller never waits for an answer or for a publisher that hangs.
//!
//! In: an [`Action`] with a tag. Out: the tag and the result, passed to a function on that thread.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::{ControlError, Controller, PATIENCE, PendingCommand, Vigil};
use bench_dragon_messages::ControlResponse;
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_messages::state::PlaybackState;

/// The interval of polls for pending responses.
const POLL_INTERVAL: Duration = Duration::from_micros(500);
/// Time without a command after which the service is closed, so that another publisher can create it again.
const IDLE: Duration = Duration::from_secs(1);
/// The most pending commands, and the most pending holds besides them. The service admits 8 requests of one client, one
/// of which requests the state during a step.
const MOST_PENDING: usize = 4;
const MOST_HOLDS: usize = 3;
/// Commands that may be unanswered, sent or not.
pub const MOST_WAITING: usize = 64;
/// The action that drops all waiting actions: no action requested before a hold is done after it.
const HOLD: Action = Action::Send(Command::Hold);

/// An action that a user requests: a command, or a command that depends on the state of the show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// This command.
    Send(Command),
    /// Request the state, with the rate of the show when it plays as the response's `time_scale`.
    PlayingRate,
    /// Pause a show that plays, resume one that is paused or waits.
    Toggle,
    /// Seek forward or back, within 0 and the end.
    SeekBy {
        /// Simulated seconds, negative for back.
        seconds: f64,
        /// Simulated seconds at the end of the show; infinite if unknown.
        end: f64,
    },
}

impl Action {
    /// Returns true if the command is known only after a response with the state.
    fn depends_on_the_state(self) -> bool {
        matches!(self, Self::Toggle | Self::SeekBy { .. })
    }

    /// Returns the command in the state that a response reports.
    pub fn command(self, state: &ControlResponse) -> Command {
        match self {
            Self::Send(command) => command,
            Self::PlayingRate => Command::State,
            // A resume also ends the waiting at a cue or at the start. While held it is refused, with a sentence.
            Self::Toggle => match state.playback_state() {
                Some(PlaybackState::Paused | PlaybackState::Held) => Command::Resume,
                _ => Command::Pause,
            },
            Self::SeekBy { seconds, end } => Command::Seek((state.sim_time + seconds).min(end).max(0.0)),
        }
    }
}

/// The result of an action: its command and the response.
pub type ActionResult = Result<(Command, ControlResponse), ControlError>;

/// Too many commands wait already: the publisher does not keep up, or does not answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("too many commands are waiting")]
pub struct TooMany;

/// A thread that sends commands to the publisher of one name, through any number of publishers. Dropping it ends the
/// thread; pending actions get no result.
pub struct CommandClient<Tag> {
    requests: Option<Sender<(Tag, Action)>>,
    unanswered: Arc<AtomicUsize>,
    thread: Option<JoinHandle<()>>,
}

impl<Tag: Send + 'static> CommandClient<Tag> {
    /// Starts the thread, which calls `handle` with the tag and the result of each action.
    ///
    /// # Errors
    /// The system's error, if it has no thread left.
    pub fn start(name: &str, handle: impl FnMut(Tag, ActionResult) + Send + 'static) -> std::io::Result<Self> {
        let (sender, receiver) = channel();
        let unanswered = Arc::new(AtomicUsize::new(0));
        let (name, counter) = (name.to_owned(), Arc::clone(&unanswered));
        let thread = std::thread::Builder::new().name("commands".to_owned()).spawn(move || {
            let (waiting, pending) = (VecDeque::new(), Vec::new());
            let (controller, vigil) = (None, Vigil::new());
            CommandThread { name, controller, unanswered: counter, waiting, pending, vigil, handle }.run(&receiver);
        });
        let thread = Some(thread?);
        Ok(Self { requests: Some(sender), unanswered, thread })
    }

    /// Requests an action. A hold drops all waiting actions, which get [`ControlError::Overtaken`].
    ///
    /// # Errors
    /// [`TooMany`]: the action is not sent and gets no result.
    pub fn request(&self, tag: Tag, action: Action) -> Result<(), TooMany> {
        let most = if action == HOLD { MOST_WAITING + MOST_HOLDS } else { MOST_WAITING };
        if self.unanswered.fetch_add(1, Ordering::Relaxed) < most
            && let Some(requests) = &self.requests
            && requests.send((tag, action)).is_ok()
        {
            return Ok(());
        }
        self.unanswered.fetch_sub(1, Ordering::Relaxed);
        Err(TooMany)
    }
}

impl<Tag> Drop for CommandClient<Tag> {
    fn drop(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            // A panic has been printed by then.
            let _ = thread.join();
        }
    }
}

/// An action that has been sent.
struct Pending<Tag> {
    tag: Tag,
    action: Action,
    /// The action's command, or the request for the state on which the command depends.
    command: Command,
    /// True if the command was sent before, to a publisher that had gone.
    repeated: bool,
    /// True if a hold has come since: nothing more is sent for this action.
    overtaken: bool,
    sent: Instant,
    response: PendingCommand,
}

/// The data of the thread, created there, since ports stay on the thread that created them.
struct CommandThread<Tag, Handle> {
    name: String,
    controller: Option<Controller>,
    unanswered: Arc<AtomicUsize>,
    waiting: VecDeque<(Tag, Action)>,
    pending: Vec<Pending<Tag>>,
    vigil: Vigil,
    handle: Handle,
}

impl<Tag, Handle: FnMut(Tag, ActionResult)> CommandThread<Tag, Handle> {
    fn run(&mut self, requests: &Receiver<(Tag, Action)>) {
        loop {
            let patience = if self.pending.is_empty() { IDLE } else { POLL_INTERVAL };
            match requests.recv_timeout(patience) {
                Ok((tag, action)) if action == HOLD => self.hold(tag),
                Ok(request) => self.waiting.push_back(request),
                Err(RecvTimeoutError::Timeout) if self.pending.is_empty() => self.controller = None,
                Err(RecvTimeoutError::Timeout) => (),
                Err(RecvTimeoutError::Disconnected) => return,
            }
            while let Some((tag, action)) = self.next_waiting() {
                self.begin(tag, action, false);
            }
            self.poll();
        }
    }

    /// Drops all waiting actions except holds, and queues the hold.
    fn hold(&mut self, tag: Tag) {
        let (holds, overtaken) = self.waiting.drain(..).partition(|(_, action)| *action == HOLD);
        self.waiting = holds;
        self.waiting.push_back((tag, HOLD));
        let overtaken: VecDeque<_> = overtaken;
        overtaken.into_iter().for_each(|(tag, _)| self.answer(tag, Err(ControlError::Overtaken)));
        self.pending.iter_mut().for_each(|pending| pending.overtaken = pending.action != HOLD);
    }

    /// Returns the next action that may be sent now. An action that depends on the state delays all later actions
    /// except a hold.
    fn next_waiting(&mut self) -> Option<(Tag, Action)> {
        let is_hold = self.waiting.front()?.1 == HOLD;
        if !is_hold && self.pending.iter().any(|pending| pending.action.depends_on_the_state()) {
            return None;
        }
        let most = if is_hold { MOST_PENDING + MOST_HOLDS } else { MOST_PENDING };
        if self.pending.len() < most { self.waiting.pop_front() } else { None }
    }

    fn begin(&mut self, tag: Tag, action: Action, repeated: bool) {
        let command = if let Action::Send(command) = action { command } else { Command::State };
        self.send(tag, action, command, repeated);
    }

    fn send(&mut self, tag: Tag, action: Action, command: Command, repeated: bool) {
        match self.request(action, command) {
            Ok(response) => {
                if self.pending.is_empty() {
                    self.vigil = Vigil::new();
                }
                let sent = Instant::now();
                self.pending.push(Pending { tag, action, command, repeated, overtaken: false, sent, response });
            }
            Err(error) => self.answer(tag, Err(error)),
        }
    }

    fn request(&mut self, action: Action, command: Command) -> Result<PendingCommand, ControlError> {
        let controller = match &mut self.controller {
            Some(controller) => controller,
            none => none.insert(Controller::new(&self.name)?),
        };
        match action {
            Action::PlayingRate => controller.request_playing_rate(),
            _ => controller.request(command),
        }
    }

    /// Polls the pending responses, in the order in which the requests were sent.
    fn poll(&mut self) {
        let alive = match &mut self.controller {
            _ if self.pending.is_empty() => return,
            Some(controller) => self.vigil.check(controller),
            None => Err(ControlError::Ended(self.name.clone())),
        };
        let now = Instant::now();
        let mut repeats = Vec::new();
        for pending in std::mem::take(&mut self.pending) {
            let Pending { action, command, repeated, overtaken, sent, .. } = pending;
            let polled = match pending.response.poll() {
                Ok(None) if alive.is_err() => Err(ControlError::Ended(self.name.clone())),
                Ok(None) if now < self.vigil.deadline(command, sent) => {
                    self.pending.push(pending);
                    continue;
                }
                Ok(None) => Err(ControlError::NoAnswer { name: self.name.clone(), timeout: PATIENCE }),
                Ok(Some(response)) => Ok(response),
                Err(error) => Err(error),
            };
            let tag = pending.tag;
            let is_question = command == Command::State && action.depends_on_the_state();
            match polled {
                // A refused request for the state has no information.
                Ok(state) if is_question && matches!(state.result(), Some(Code::Done | Code::Already)) => {
                    if overtaken {
                        self.answer(tag, Err(ControlError::Overtaken));
                    } else {
                        self.send(tag, action, action.command(&state), repeated);
                    }
                }
                // The publisher may have been started again since the service was opened.
                Err(ControlError::NoPublisher(_) | ControlError::Ended(_)) if !repeated && !overtaken => {
                    repeats.push((tag, action));
                }
                polled => self.answer(tag, polled.map(|response| (command, response))),
            }
        }
        if !repeats.is_empty() || alive.is_err() {
            self.controller = None;
        }
        repeats.into_iter().for_each(|(tag, action)| self.begin(tag, action, true));
    }

    fn answer(&mut self, tag: Tag, result: ActionResult) {
        self.unanswered.fetch_sub(1, Ordering::Relaxed);
        (self.handle)(tag, result);
    }
}
