//! `<name>/chase`: the status of a chase, and the right to be the only chase of a show.
//!
//! The status is a service of messages, which a tunnel to other machines may join with a publisher of its own. So the
//! right is a second service of the same name: one that serves requests, admits one server, and never gets a request.

use bench_dragon_client::shared_memory::{
    MOST_PUBLISHERS, OpenError, failed, node, port_error, service_error, service_name,
};
use bench_dragon_messages::{ChaseStatus, ControlRequest, ControlResponse};
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::server::ServerCreateError;

/// Subscribers of the status, as of any publisher's messages.
const MOST_SUBSCRIBERS: usize = 64;
/// Nodes that may have the service open besides.
const SPARE_NODES: usize = 32;
const QUEUE: usize = 16;

/// The reason why a chase cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum StatusError {
    /// Another chase steers the show.
    #[error("another chase steers the show \"{0}\": end it first")]
    AlreadyChased(String),
    /// The service cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
}

/// The publisher of the status.
pub struct StatusPort {
    publisher: Publisher<ipc::Service, ChaseStatus, ()>,
    _right: Server<ipc::Service, ControlRequest, (), ControlResponse, ()>,
    // Dropped last: the ports above belong to it.
    _node: Node<ipc::Service>,
}

impl StatusPort {
    /// Opens the service of a name.
    ///
    /// # Errors
    /// [`StatusError`]
    pub fn open(name: &str) -> Result<Self, StatusError> {
        let full_name = service_name(name, "chase")?;
        let node = node()?;
        // A chase that was killed keeps no right.
        let _ = node.try_cleanup_dead_nodes();
        let right = node
            .service_builder(&full_name)
            .request_response::<ControlRequest, ControlResponse>()
            .max_servers(1)
            .max_nodes(SPARE_NODES)
            .open_or_create()
            .map_err(|error| failed(name, "chase", error))?;
        let right = right.server_builder().create().map_err(|error| match error {
            ServerCreateError::ExceedsMaxSupportedServers => StatusError::AlreadyChased(name.to_owned()),
            other => failed(name, "chase", other).into(),
        })?;
        let service = node
            .service_builder(&full_name)
            .publish_subscribe::<ChaseStatus>()
            .max_publishers(MOST_PUBLISHERS)
            .max_subscribers(MOST_SUBSCRIBERS)
            .max_nodes(MOST_SUBSCRIBERS + SPARE_NODES)
            .subscriber_max_buffer_size(QUEUE)
            .history_size(1)
            .enable_safe_overflow(true)
            .open_or_create()
            .map_err(|error| service_error(&full_name, error))?;
        let publisher = service
            .publisher_builder()
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| port_error(name, "chase", error))?;
        Ok(Self { publisher, _right: right, _node: node })
    }

    /// Sends a status.
    pub fn send(&self, status: &ChaseStatus) {
        if let Err(error) = self.publisher.send_copy(*status) {
            log::warn!("the status of the chase could not be sent: {error}");
        }
    }
}
