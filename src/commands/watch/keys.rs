//! The keys of `watch`, as of a media player, applied to the show.
//!
//! In: keys, and the answers of a [`CommandClient`]. Out: lines for the screen. Nothing is sent without a key, and no
//! call waits for an answer.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use super::key_bytes::Key;
use bench_dragon::client::control::command_client::{Action, ActionResult, CommandClient};
use bench_dragon::client::control::{refusal, standing};
use bench_dragon::client::feed::FeedEvent;
use bench_dragon::messages::control::Command;
use nix::sys::signal::{SigSet, Signal};
use signal_hook::consts::{SIGCONT, SIGQUIT, SIGTSTP};

use super::super::CommandError;
use super::terminal::KeyMode;

/// The text of `?`.
const HELP: &str = "Keys: space pauses and resumes; left and right seek 5 s; [ and ] halve and double the rate; \
                    . steps one period; h holds; r releases; ? lists the keys; q ends.";
/// The interval at which keys are polled.
pub const KEY_INTERVAL: Duration = Duration::from_millis(20);
/// Simulated seconds of one seek.
const SEEK: f64 = 5.0;
/// The greatest number of keys waiting for answers to earlier keys.
const MOST_WAITING: usize = 16;

/// The result of a key.
#[derive(Debug, Clone, PartialEq)]
pub enum KeyOutcome {
    /// A line that stays.
    Line(String),
    /// The playback state after a command.
    Done(String),
    /// The monitor ends.
    Quit,
}

/// A keyboard that commands the publisher of one name.
pub struct Keyboard {
    mode: Option<KeyMode>,
    terminal_is_gone: bool,
    client: CommandClient<()>,
    answers: Receiver<ActionResult>,
    waiting: VecDeque<Action>,
    /// The number of commands without an answer, holds included. At most one pending command is other than a hold, so
    /// that each key acts on the state that the key before left.
    unanswered: usize,
    /// Simulated seconds per second while the show plays, if known.
    rate: Option<f64>,
    /// End of the show, simulated seconds; infinite while unknown.
    end: f64,
    suspend: Arc<AtomicBool>,
    resumed: Arc<AtomicBool>,
}

impl Keyboard {
    /// Reads keys from standard input; SIGQUIT, which would leave the terminal without an echo, also sets `stop`.
    ///
    /// # Errors
    /// The system's, if no thread or signal handler is left.
    pub fn new(name: &str, stop: &Arc<AtomicBool>) -> Result<Self, CommandError> {
        let [suspend, resumed] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        for (signal, flag) in [(SIGQUIT, stop), (SIGTSTP, &suspend), (SIGCONT, &resumed)] {
            signal_hook::flag::register(signal, Arc::clone(flag))?;
        }
        // The thread of `stop_on_signals` receives them too.
        SigSet::from_iter([Signal::SIGQUIT, Signal::SIGTSTP, Signal::SIGCONT])
            .thread_block()
            .map_err(io::Error::from)?;
        let (sender, answers) = channel();
        // Sending fails once the keyboard is dropped: no one needs the answer.
        let client = CommandClient::start(name, move |(), conducted| drop(sender.send(conducted)))?;
        let (waiting, unanswered, end) = (VecDeque::new(), 0, f64::INFINITY);
        let mode = KeyMode::enter();
        Ok(Self {
            mode,
            terminal_is_gone: false,
            client,
            answers,
            waiting,
            unanswered,
            rate: None,
            end,
            suspend,
            resumed,
        })
    }

    /// Applies an event on which the keys' commands depend.
    pub fn handle(&mut self, event: &FeedEvent<'_>) {
        match event {
            FeedEvent::Frame { header, .. } if header.time_scale > 0.0 && self.unanswered == 0 => {
                self.rate = Some(header.time_scale);
            }
            FeedEvent::Stage { stage, .. } => self.end = stage.freeze_time,
            FeedEvent::Gone => (self.rate, self.end) = (None, f64::INFINITY),
            _ => (),
        }
    }

    /// Reads the pressed keys. Returns the results since the last call.
    pub fn poll(&mut self) -> Vec<KeyOutcome> {
        let mut outcomes = Vec::new();
        self.follow_job_control();
        match self.mode.as_mut().map(KeyMode::keys) {
            Some(Ok(keys)) => keys.into_iter().for_each(|key| outcomes.extend(self.press(key))),
            Some(Err(_)) => (self.mode, self.terminal_is_gone) = (None, true),
            // In the background of its terminal: a shell sends no signal when it brings the program to the front.
            None if !self.terminal_is_gone => self.mode = KeyMode::enter(),
            None => (),
        }
        while let Ok(conducted) = self.answers.try_recv() {
            outcomes.push(self.answered(conducted));
        }
        outcomes
    }

    /// Restores the terminal while this program is stopped (Ctrl-Z) or in the background.
    fn follow_job_control(&mut self) {
        if self.suspend.swap(false, Ordering::Relaxed) {
            self.mode = None;
            // Otherwise the key would do nothing.
            let _ = signal_hook::low_level::emulate_default_handler(SIGTSTP);
        }
        if self.resumed.swap(false, Ordering::Relaxed) {
            // The shell may have changed the settings: set them again.
            self.mode = None;
        }
    }

    fn press(&mut self, key: Key) -> Option<KeyOutcome> {
        let seek = |seconds| Action::SeekBy { seconds, end: self.end };
        let action = match key {
            Key::Char(' ') => Action::Toggle,
            Key::Left => seek(-SEEK),
            Key::Right => seek(SEEK),
            Key::Char('[') => return self.change_rate(0.5),
            Key::Char(']') => return self.change_rate(2.0),
            Key::Char('.') => Action::Send(Command::Step(1)),
            Key::Char('h') => Action::Send(Command::Hold),
            Key::Char('r') => Action::Send(Command::Release),
            Key::Char('?') => return Some(KeyOutcome::Line(HELP.to_owned())),
            Key::Char('q') => return Some(KeyOutcome::Quit),
            _ => return None,
        };
        self.request(action)
    }

    fn change_rate(&mut self, factor: f64) -> Option<KeyOutcome> {
        let Some(rate) = self.rate else {
            return Some(KeyOutcome::Line("The rate is not known until the show plays.".to_owned()));
        };
        // Consecutive keys add up, answered or not.
        self.rate = Some(rate * factor);
        self.request(Action::Send(Command::Rate(rate * factor)))
    }

    fn request(&mut self, action: Action) -> Option<KeyOutcome> {
        let is_hold = action == Action::Send(Command::Hold);
        if is_hold {
            // No earlier key may be executed after the hold.
            let dropped = self.waiting.drain(..).count();
            let line = match dropped {
                0 => None,
                1 => Some("The hold overtook a key, which is dropped.".to_owned()),
                more => Some(format!("The hold overtook {more} keys, which are dropped.")),
            };
            return self.send(action).or(line.map(KeyOutcome::Line));
        }
        if self.waiting.len() >= MOST_WAITING {
            return Some(KeyOutcome::Line("The publisher has not answered the keys before this one.".to_owned()));
        }
        if self.unanswered == 0 {
            self.send(action)
        } else {
            self.waiting.push_back(action);
            None
        }
    }

    fn send(&mut self, action: Action) -> Option<KeyOutcome> {
        match self.client.request((), action) {
            Ok(()) => {
                self.unanswered += 1;
                None
            }
            Err(error) => Some(KeyOutcome::Line(error.to_string())),
        }
    }

    fn answered(&mut self, conducted: ActionResult) -> KeyOutcome {
        self.unanswered -= 1;
        let outcome = match conducted {
            Ok((command, response)) => match refusal(&response, command) {
                None => KeyOutcome::Done(standing(&response)),
                Some(sentence) => {
                    if matches!(command, Command::Rate(_)) {
                        // The requested rate is not in force; the next frame has the current one.
                        self.rate = None;
                    }
                    KeyOutcome::Line(sentence)
                }
            },
            Err(error) => KeyOutcome::Line(error.to_string()),
        };
        if self.unanswered == 0
            && let Some(action) = self.waiting.pop_front()
        {
            // A command client without pending requests has room.
            let _ = self.send(action);
        }
        outcome
    }
}
