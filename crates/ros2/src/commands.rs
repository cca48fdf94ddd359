//! Commands to the show from the ROS 2 services: tickets, and the answers of `<name>/control`.
//!
//! In: a [`Command`]. Out: an [`Answer`] with the ticket of the command.

use std::sync::mpsc::{Receiver, channel};

use bench_dragon_client::control::ControlError;
use bench_dragon_client::control::command_client::{Action, ActionResult, CommandClient};
use bench_dragon_messages::ControlResponse;
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_show::Outcome;

use crate::Ros2Error;

/// The answer to a command.
pub(super) struct Answer {
    /// As [`ShowCommands::send`] returned it.
    pub ticket: u64,
    /// The result of the command, or the reason why the show did not answer.
    pub result: Result<Outcome, ControlError>,
}

/// The commands to the show of one name.
pub(super) struct ShowCommands {
    client: CommandClient<u64>,
    results: Receiver<(u64, ActionResult)>,
    ticket: u64,
}

impl ShowCommands {
    /// Starts the client of the service `<name>/control`.
    ///
    /// # Errors
    /// [`Ros2Error::Failed`] if the system refuses a thread.
    pub(super) fn start(name: &str) -> Result<Self, Ros2Error> {
        let (sender, results) = channel();
        // The receiver is gone at the end.
        let client = CommandClient::start(name, move |ticket, result| drop(sender.send((ticket, result))));
        let client = client.map_err(|error| Ros2Error::Failed(error.to_string()))?;
        Ok(Self { client, results, ticket: 0 })
    }

    /// Sends a command. Returns the ticket of its answer.
    ///
    /// # Errors
    /// [`Code::TooMany`] if too many commands have no answer yet.
    pub(super) fn send(&mut self, command: Command) -> Result<u64, Code> {
        let action = if command == Command::State { Action::PlayingRate } else { Action::Send(command) };
        self.client.request(self.ticket + 1, action).map_err(|_| Code::TooMany)?;
        self.ticket += 1;
        Ok(self.ticket)
    }

    /// Returns the next answer, if there is one.
    pub(super) fn answer(&mut self) -> Option<Answer> {
        let (ticket, result) = self.results.try_recv().ok()?;
        Some(Answer { ticket, result: result.map(|(_, response)| outcome(&response)) })
    }
}

/// Returns the result that a response reports. Its playing rate is valid for the command state only.
fn outcome(response: &ControlResponse) -> Outcome {
    let ControlResponse { id: _, tick, sim_time, time_scale, code: _, playback: _, cue, reserved: _ } = *response;
    Outcome {
        // Numbers of a later layout.
        code: response.result().unwrap_or(Code::NotUnderstood),
        playback: response.playback_state().unwrap_or(PlaybackState::Playing),
        tick,
        sim_time,
        time_scale,
        playing_rate: time_scale,
        cue,
    }
}
