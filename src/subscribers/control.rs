//! Conducting a publisher from another process: one request over `<name>/control`, and its response.
//!
//! Called by the `control` command; for controllers written in Rust.

use std::time::{Duration, Instant};

use iceoryx2::port::client::Client;
use iceoryx2::prelude::*;
use iceoryx2::service::builder::request_response::RequestResponseOpenError as Open;

use crate::show::control::Command;
use crate::transports::iceoryx2::{OpenError, check_room_to_subscribe, node, service_name};
use crate::wire::{ControlRequest, ControlResponse};

/// How often a response is looked for.
const POLL_INTERVAL: Duration = Duration::from_micros(500);

/// Why there is no response.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// The service cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// There is no publisher to conduct.
    #[error("nobody publishes under the name \"{0}\"")]
    NoPublisher(String),
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
    // Dropped last: the port above belongs to it.
    _node: Node<ipc::Service>,
}

impl Controller {
    /// A controller of the publisher of `name`, which is there already.
    ///
    /// # Errors
    /// [`ControlError::NoPublisher`], or [`ControlError::Open`] where the service cannot be used.
    pub fn new(name: &str) -> Result<Self, ControlError> {
        let service = service_name(name, "control")?;
        check_room_to_subscribe()?;
        let node = node()?;
        let no_publisher = || ControlError::NoPublisher(name.to_owned());
        let failed = |reason: String| OpenError::Failed { service: service.to_string(), reason };
        let opened = node.service_builder(&service).request_response::<ControlRequest, ControlResponse>().open();
        let opened = opened.map_err(|error| match error {
            Open::DoesNotExist | Open::HangsInCreation | Open::IsMarkedForDestruction => no_publisher(),
            Open::IncompatibleRequestOrResponseType | Open::VersionMismatch => {
                OpenError::Incompatible(service.to_string()).into()
            }
            error => failed(format!("{error:?}")).into(),
        })?;
        if opened.dynamic_config().number_of_servers() == 0 {
            return Err(no_publisher());
        }
        let client = opened.client_builder().backpressure_strategy(BackpressureStrategy::DiscardData).create();
        let client = client.map_err(|error| failed(format!("{error:?}")))?;
        Ok(Self { name: name.to_owned(), client, sent: 0, _node: node })
    }

    /// Sends a command and waits for what became of it, at most `timeout`.
    ///
    /// # Errors
    /// [`ControlError::NoPublisher`] or [`ControlError::NoAnswer`].
    pub fn send(&mut self, command: Command, timeout: Duration) -> Result<ControlResponse, ControlError> {
        self.sent += 1;
        let (number, value) = command.number_and_value();
        let request = ControlRequest { id: self.sent, value, command: number, reserved: 0 };
        let failed = |reason: String| OpenError::Failed { service: format!("{}/control", self.name), reason };
        let pending = self.client.send_copy(request).map_err(|error| failed(format!("{error:?}")))?;
        let began = Instant::now();
        while began.elapsed() < timeout {
            match pending.receive().map_err(|error| failed(format!("{error:?}")))? {
                Some(response) => return Ok(*response),
                None if pending.number_of_server_connections() == 0 => {
                    return Err(ControlError::NoPublisher(self.name.clone()));
                }
                None => std::thread::sleep(POLL_INTERVAL),
            }
        }
        Err(ControlError::NoAnswer { name: self.name.clone(), timeout })
    }
}
