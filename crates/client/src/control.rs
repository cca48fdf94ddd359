//! Conducting a publisher from another process: requests over `<name>/control`, and their responses.
//!
//! [`Controller`] is for the thread that waits, as the `control` command does; a [`conductor`] has a thread of its own,
//! for whoever has something else to do meanwhile, as `watch` and the stage picture's server have.

pub mod conductor;

use std::time::{Duration, Instant};

use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client;
use iceoryx2::prelude::*;
use iceoryx2::service::builder::request_response::RequestResponseOpenError as Open;
use iceoryx2::service::port_factory::request_response;

use crate::shared_memory::{OpenError, check_room_to_subscribe, node, service_name};
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_messages::{ControlRequest, ControlResponse, FrameHeader, HandlePose};

/// How often a response is looked for.
const POLL_INTERVAL: Duration = Duration::from_micros(500);
/// How long a publisher is given to answer, and a step to make progress.
pub const PATIENCE: Duration = Duration::from_secs(30);
/// How often it is tested whether a publisher that has not answered lives, and whether a step makes progress.
const LIVENESS_INTERVAL: Duration = Duration::from_millis(200);
const PROGRESS_INTERVAL: Duration = Duration::from_secs(1);
/// A century: an instant farther off cannot be represented everywhere.
const LONGEST_TIMEOUT: Duration = Duration::from_secs(100 * 365 * 86_400);

/// Why there is no response.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// The service cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// There is no publisher to conduct.
    #[error("nobody publishes under the name \"{0}\"")]
    NoPublisher(String),
    /// Frames come, and no show is here that would take commands.
    #[error(
        "no show runs under the name \"{0}\" on this machine, and a tunnel that brings its frames from another carries no \
         commands: conduct it there"
    )]
    Elsewhere(String),
    /// The publisher has ended or was killed before it answered.
    #[error("the publisher of \"{0}\" has ended without an answer")]
    Ended(String),
    /// A hold came while the command waited to be sent, and it was dropped.
    #[error("a hold overtook this command, which was not sent")]
    Overtaken,
    /// The publisher did not answer.
    #[error("the publisher of \"{name}\" has not answered within {} s", timeout.as_secs_f64())]
    NoAnswer {
        /// Its name.
        name: String,
        /// How long it was given.
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
    /// A controller of the publisher of `name`, which is there already.
    ///
    /// # Errors
    /// [`ControlError::NoPublisher`] or [`ControlError::Elsewhere`], or [`ControlError::Open`] where the service cannot be used.
    pub fn new(name: &str) -> Result<Self, ControlError> {
        let service = service_name(name, "control")?;
        check_room_to_subscribe()?;
        let node = node()?;
        let no_publisher = || match has_frames(&node, name) {
            true => ControlError::Elsewhere(name.to_owned()),
            false => ControlError::NoPublisher(name.to_owned()),
        };
        let opened = node.service_builder(&service).request_response::<ControlRequest, ControlResponse>().open();
        let opened = opened.map_err(|error| match error {
            Open::DoesNotExist | Open::HangsInCreation | Open::IsMarkedForDestruction => no_publisher(),
            Open::IncompatibleRequestOrResponseType | Open::VersionMismatch => {
                OpenError::Incompatible(service.to_string()).into()
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

    /// Sends a command and waits for what became of it, at most `timeout`.
    ///
    /// # Errors
    /// [`ControlError::NoPublisher`], [`ControlError::Ended`] or [`ControlError::NoAnswer`].
    pub fn send(&mut self, command: Command, timeout: Duration) -> Result<ControlResponse, ControlError> {
        let deadline = Instant::now() + timeout.min(LONGEST_TIMEOUT);
        self.await_response(command, timeout, |_| deadline)
    }

    /// Sends a command and waits for what became of it: [`PATIENCE`], and for a step as long as it makes progress.
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
                // It may have answered just before its end.
                return pending.poll()?.ok_or(error);
            }
            if Instant::now() >= deadline(&vigil) {
                return Err(ControlError::NoAnswer { name: self.name.clone(), timeout });
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    /// Whether a publisher is there and alive. Cleans up after one that was killed.
    fn publisher_is_alive(&self) -> bool {
        let _ = self.node.try_cleanup_dead_nodes();
        self.service.dynamic_config().number_of_servers() > 0
    }

    /// Sends a command. Dropping what is returned gives up the response, not the command.
    ///
    /// # Errors
    /// [`ControlError::Open`] where the service fails.
    pub fn request(&mut self, command: Command) -> Result<PendingCommand, ControlError> {
        self.sent += 1;
        let (number, value) = command.number_and_value();
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
    /// The response, if it has come.
    ///
    /// # Errors
    /// [`ControlError::NoPublisher`] where nobody was there who could answer, [`ControlError::Ended`] where nobody is any
    /// more.
    pub fn poll(&self) -> Result<Option<ControlResponse>, ControlError> {
        // Looked at before the response, which may have been the last that the publisher did.
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

/// Watches over a publisher whose answer is awaited.
///
/// One that was killed leaves requests that seem to wait for ever. A step may last for hours: whether it makes progress is
/// seen by asking how the show stands.
struct Vigil {
    tested: Instant,
    probed: Instant,
    /// When the show was last seen to have played on, and the tick then.
    progressed: Instant,
    tick: u64,
    probe: Option<PendingCommand>,
}

impl Vigil {
    fn new() -> Self {
        let now = Instant::now();
        Self { tested: now, probed: now, progressed: now, tick: 0, probe: None }
    }

    /// Until when the answer to a command that was sent at `sent` is awaited.
    fn deadline(&self, command: Command, sent: Instant) -> Instant {
        match command {
            Command::Step(_) => self.progressed.max(sent) + PATIENCE,
            _ => sent + PATIENCE,
        }
    }

    /// Tests what is due by now.
    ///
    /// # Errors
    /// [`ControlError::Ended`]
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
            // One question at a time: each takes a period of the loop, and others wait behind it.
            match self.probe.as_ref().map(PendingCommand::poll) {
                Some(Ok(None)) => return Ok(()),
                // A step that has come to the end of the show is over when its periods are.
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

/// Whether somebody can send frames under a name.
fn has_frames(node: &Node<ipc::Service>, name: &str) -> bool {
    let Ok(poses) = service_name(name, "poses") else { return false };
    let builder = node.service_builder(&poses).publish_subscribe::<[HandlePose]>().user_header::<FrameHeader>();
    builder.open().is_ok_and(|service| service.dynamic_config().number_of_publishers() > 0)
}

fn failed(name: &str, reason: String) -> OpenError {
    OpenError::Failed { service: format!("{name}/control"), reason }
}

/// How the show stands after a command, for people.
pub fn standing(response: &ControlResponse) -> String {
    let playback = response.playback_state().map_or("unknown", PlaybackState::name);
    let ControlResponse { tick, sim_time, time_scale, .. } = *response;
    let rate = if time_scale > 0.0 { format!(" at {time_scale} x") } else { String::new() };
    format!("{playback}{rate}, t = {sim_time:.3} s, tick {tick}")
}

/// Why a command was not obeyed, in a sentence; `None` where it was.
pub fn refusal(response: &ControlResponse, command: Command) -> Option<String> {
    let (name, value) = (command.name(), command.number_and_value().1);
    let playback = response.playback_state().map_or("in an unknown state", PlaybackState::name);
    match response.result() {
        Some(Code::Done | Code::Already) => None,
        Some(Code::Refused) if command == Command::Go => {
            Some(format!("go is refused: the show waits for nothing ({playback})"))
        }
        Some(Code::Refused) => Some(format!("{name} is refused: the show is {playback}")),
        Some(Code::OutOfRange) => Some(format!("{name} is refused: {value:?} is out of range")),
        Some(Code::TooMany) => Some(format!("{name} is refused: too many commands are waiting")),
        Some(Code::NotUnderstood) | None => Some(format!("{name} is not understood by this publisher")),
    }
}
