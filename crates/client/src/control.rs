//! Commands to a publisher from another process: requests over `<name>/control`, and their responses.
//!
//! A [`Controller`] waits for the response, as the command `control` does. A [`command_client`] has its own thread, for
//! programs that have other work meanwhile, such as `watch` and the stage picture's server.

pub mod command_client;

use std::time::{Duration, Instant};

use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client;
use iceoryx2::prelude::*;
use iceoryx2::service::builder::request_response::RequestResponseOpenError as Open;
use iceoryx2::service::port_factory::request_response;

use crate::layouts;
use crate::shared_memory::{OpenError, check_room_to_subscribe, node, service_name};
use crate::shows;
use bench_dragon_messages::control::{Code, Command, PLAYING_RATE, RATES};
use bench_dragon_messages::sentence::number;
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_messages::{ControlRequest, ControlResponse};

/// The interval of polls for a response.
const POLL_INTERVAL: Duration = Duration::from_micros(500);
/// The time limit of an answer, and of a step without progress.
pub const PATIENCE: Duration = Duration::from_secs(30);
/// The interval of tests that a publisher which has not answered is alive, and of tests that a step makes progress.
const LIVENESS_INTERVAL: Duration = Duration::from_millis(200);
const PROGRESS_INTERVAL: Duration = Duration::from_secs(1);
/// A century: an instant farther off cannot be represented everywhere.
const LONGEST_TIMEOUT: Duration = Duration::from_secs(100 * 365 * 86_400);

/// The reason why there is no response.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// The service cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// There is no publisher.
    #[error("no publisher has the name \"{0}\" ({instead})", instead = shows::instead(.0, &shows::running()))]
    NoPublisher(String),
    /// Frames come, and no show on this machine takes commands.
    #[error(
        "no show runs under the name \"{0}\" on this machine, and a tunnel that brings its frames from another machine \
         carries no commands: send them there"
    )]
    Elsewhere(String),
    /// The publisher has ended or was killed before it answered.
    #[error("the publisher of \"{0}\" has ended without an answer")]
    Ended(String),
    /// The command was dropped, because a hold came before it was sent.
    #[error("a hold overtook this command, which was not sent")]
    Overtaken,
    /// The publisher did not answer.
    #[error("the publisher of \"{name}\" has not answered within {} s", timeout.as_secs_f64())]
    NoAnswer {
        /// Its name.
        name: String,
        /// The time limit.
        timeout: Duration,
    },
}

/// A controller of one publisher.
pub struct Controller {
    name: String,
    client: Client<ipc::Service, ControlRequest, (), ControlResponse, ()>,
    sent: u64,
    service: request_response::PortFactory<ipc::Service, ControlRequest, (), ControlResponse, ()>,
    // Dropped last: the ports above belong to it.
    node: Node<ipc::Service>,
}

impl Controller {
    /// Creates a controller of the publisher of `name`, which runs already.
    ///
    /// # Errors
    /// [`ControlError::NoPublisher`] or [`ControlError::Elsewhere`], or [`ControlError::Open`] if the service cannot be
    /// used.
    pub fn new(name: &str) -> Result<Self, ControlError> {
        let service = service_name(name, "control")?;
        check_room_to_subscribe()?;
        let node = node()?;
        let no_publisher = || match shows::frames(&node, name)
            .is_some_and(|service| service.dynamic_config().number_of_publishers() > 0)
        {
            true => ControlError::Elsewhere(name.to_owned()),
            false => ControlError::NoPublisher(name.to_owned()),
        };
        let opened = node.service_builder(&service).request_response::<ControlRequest, ControlResponse>().open();
        let opened = opened.map_err(|error| match error {
            Open::DoesNotExist | Open::HangsInCreation | Open::IsMarkedForDestruction => no_publisher(),
            Open::IncompatibleRequestOrResponseType | Open::VersionMismatch => {
                let own = [layouts::name::<ControlRequest>(), layouts::name::<ControlResponse>()];
                layouts::another(&service, MessagingPattern::RequestResponse, &own).into()
            }
            error => failed(name, format!("{error:?}")).into(),
        })?;
        if opened.dynamic_config().number_of_servers() == 0 {
            return Err(no_publisher());
        }
        let client = opened.client_builder().backpressure_strategy(BackpressureStrategy::DiscardData).create();
        let client = client.map_err(|error| failed(name, format!("{error:?}")))?;
        Ok(Self { name: name.to_owned(), client, sent: 0, service: opened, node })
    }

    /// Sends a command and waits for its response, at most `timeout`.
    ///
    /// # Errors
    /// [`ControlError::NoPublisher`], [`ControlError::Ended`] or [`ControlError::NoAnswer`].
    pub fn send(&mut self, command: Command, timeout: Duration) -> Result<ControlResponse, ControlError> {
        let deadline = Instant::now() + timeout.min(LONGEST_TIMEOUT);
        self.await_response(command, timeout, |_| deadline)
    }

    /// Sends a command and waits for its response: [`PATIENCE`], and for a step as long as it makes progress.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub fn send_patiently(&mut self, command: Command) -> Result<ControlResponse, ControlError> {
        let began = Instant::now();
        self.await_response(command, PATIENCE, |vigil| vigil.deadline(command, began))
    }

    fn await_response(
        &mut self,
        command: Command,
        timeout: Duration,
        deadline: impl Fn(&Vigil) -> Instant,
    ) -> Result<ControlResponse, ControlError> {
        let pending = self.request(command)?;
        let mut vigil = Vigil::new();
        loop {
            if let Some(response) = pending.poll()? {
                return Ok(response);
            }
            if let Err(error) = vigil.check(self) {
                // The publisher may have answered just before its end.
                return pending.poll()?.ok_or(error);
            }
            if Instant::now() >= deadline(&vigil) {
                return Err(ControlError::NoAnswer { name: self.name.clone(), timeout });
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    /// Returns true if a live publisher exists. Cleans up after a killed publisher.
    fn publisher_is_alive(&self) -> bool {
        let _ = self.node.try_cleanup_dead_nodes();
        self.service.dynamic_config().number_of_servers() > 0
    }

    /// Sends a command. Dropping the returned value abandons the response, not the command.
    ///
    /// # Errors
    /// [`ControlError::Open`] if the service fails.
    pub fn request(&mut self, command: Command) -> Result<PendingCommand, ControlError> {
        let (number, value) = command.number_and_value();
        self.request_with_value(number, value)
    }

    /// Requests the state of the show. The response's `time_scale` is the rate of the show when it plays.
    ///
    /// # Errors
    /// As [`Self::request`].
    pub fn request_playing_rate(&mut self) -> Result<PendingCommand, ControlError> {
        let (number, _) = Command::State.number_and_value();
        self.request_with_value(number, PLAYING_RATE)
    }

    fn request_with_value(&mut self, number: u32, value: f64) -> Result<PendingCommand, ControlError> {
        self.sent += 1;
        let request = ControlRequest { id: self.sent, value, command: number, reserved: 0 };
        let sent = self.client.send_copy(request);
        let pending = sent.map_err(|error| failed(&self.name, format!("{error:?}")))?;
        Ok(PendingCommand { name: self.name.clone(), pending })
    }
}

/// A command whose response has not come.
pub struct PendingCommand {
    name: String,
    pending: PendingResponse<ipc::Service, ControlRequest, (), ControlResponse, ()>,
}

impl PendingCommand {
    /// Returns the response, if it has come.
    ///
    /// # Errors
    /// [`ControlError::NoPublisher`] if no publisher received the request, [`ControlError::Ended`] if the publisher has
    /// ended.
    pub fn poll(&self) -> Result<Option<ControlResponse>, ControlError> {
        // Read before the response, which may have been the publisher's last action.
        let awaited = self.pending.is_connected();
        match self.pending.receive().map_err(|error| failed(&self.name, format!("{error:?}")))? {
            Some(response) => Ok(Some(*response)),
            None if self.pending.number_of_server_connections() == 0 => {
                Err(ControlError::NoPublisher(self.name.clone()))
            }
            None if !awaited => Err(ControlError::Ended(self.name.clone())),
            None => Ok(None),
        }
    }
}

/// Tests a publisher whose answer is awaited.
///
/// Requests to a killed publisher stay pending without end. A step may last for hours: requests for the state show its
/// progress.
struct Vigil {
    tested: Instant,
    probed: Instant,
    /// The time of the last progress of the show, and its tick.
    progressed: Instant,
    tick: u64,
    probe: Option<PendingCommand>,
}

impl Vigil {
    fn new() -> Self {
        let now = Instant::now();
        Self { tested: now, probed: now, progressed: now, tick: 0, probe: None }
    }

    /// Returns the deadline of the answer to a command that was sent at `sent`.
    fn deadline(&self, command: Command, sent: Instant) -> Instant {
        match command {
            Command::Step(_) => self.progressed.max(sent) + PATIENCE,
            _ => sent + PATIENCE,
        }
    }

    /// Makes the tests that are due.
    ///
    /// # Errors
    /// [`ControlError::Ended`] if the publisher has ended.
    fn check(&mut self, controller: &mut Controller) -> Result<(), ControlError> {
        let now = Instant::now();
        if now.duration_since(self.tested) >= LIVENESS_INTERVAL {
            self.tested = now;
            if !controller.publisher_is_alive() {
                return Err(ControlError::Ended(controller.name.clone()));
            }
        }
        if now.duration_since(self.probed) >= PROGRESS_INTERVAL {
            self.probed = now;
            // One request at a time: each takes a period of the loop, and others wait behind it.
            match self.probe.as_ref().map(PendingCommand::poll) {
                Some(Ok(None)) => return Ok(()),
                // At the end of the show, a step continues until its periods are over.
                Some(Ok(Some(state)))
                    if matches!(state.playback_state(), Some(PlaybackState::Playing | PlaybackState::Ended))
                        && state.tick > self.tick =>
                {
                    (self.tick, self.progressed) = (state.tick, now);
                }
                _ => {}
            }
            self.probe = controller.request(Command::State).ok();
        }
        Ok(())
    }
}

fn failed(name: &str, reason: String) -> OpenError {
    OpenError::Failed { service: format!("{name}/control"), reason }
}

/// Returns the state of the show after a command, as a sentence.
pub fn standing(response: &ControlResponse) -> String {
    let playback = response.playback_state().map_or("unknown", PlaybackState::name);
    let rate = if response.time_scale > 0.0 { format!(" at {} x", response.time_scale) } else { String::new() };
    format!("{playback}{rate}, t = {:.3} s, tick {}", response.sim_time, response.tick)
}

/// Returns the reason why a command was refused, as a sentence; `None` if it was done.
pub fn refusal(response: &ControlResponse, command: Command) -> Option<String> {
    let (name, value) = (command.name(), command.number_and_value().1);
    let playback = response.playback_state().map_or("in an unknown state", PlaybackState::name);
    match response.result() {
        Some(Code::Done | Code::Already) => None,
        Some(Code::Refused) if command == Command::Go => {
            Some(format!("go is refused: the show waits for nothing ({playback})"))
        }
        Some(Code::Refused) => Some(format!("{name} is refused: the show is {playback}")),
        Some(Code::OutOfRange) => {
            let expected = match command {
                Command::Rate(_) => format!("{} to {}", number(*RATES.start()), number(*RATES.end())),
                _ => "seconds from 0 to the end of the show".to_owned(),
            };
            Some(format!("{name} is refused: {} is out of range, expected {expected}", number(value)))
        }
        Some(Code::TooMany) => Some(format!("{name} is refused: too many commands are waiting")),
        Some(Code::NotUnderstood) | None => Some(format!("{name} is not understood by this publisher")),
    }
}
