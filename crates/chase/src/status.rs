//! `<name>/chase`: the status of a chase, and the right to be the only chase of a show.
//!
//! The status is a service of messages, which a tunnel to other machines may join with a publisher of its own. So it
//! cannot show that there is only one chase. The right is therefore a second service of the same name, which serves
//! requests, admits one server, and never gets a request.

use ::iceoryx2::port::server::Server;
use ::iceoryx2::prelude::*;
use ::iceoryx2::service::port_factory::server::ServerCreateError;

use bench_dragon_client::shared_memory::sender::{SMALL_QUEUE, SPARE_NODES, Sender, sender};
use bench_dragon_client::shared_memory::{OpenError, failed, node, service_name};
use bench_dragon_messages::{ChaseStatus, ControlRequest, ControlResponse};

/// Subscribers that the service of the status admits. The scene's `publish.subscribers` has no effect on this number.
const MOST_SUBSCRIBERS: usize = 64;

/// The reason why a chase cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum ChaseStatusError {
    /// Another chase steers the show.
    #[error("another chase steers the show \"{0}\": end it first")]
    AlreadyChased(String),
    /// The service cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
}

/// Publishes the status.
pub struct ChaseStatusSender {
    status: Sender<ChaseStatus, ()>,
    _right: Server<ipc::Service, ControlRequest, (), ControlResponse, ()>,
    // Dropped last: the ports above belong to it.
    _node: Node<ipc::Service>,
}

impl ChaseStatusSender {
    /// Opens the service of a name.
    ///
    /// # Errors
    /// [`ChaseStatusError`]
    pub fn open(name: &str) -> Result<Self, ChaseStatusError> {
        let node = node()?;
        // A chase that was killed keeps no right.
        let _ = node.try_cleanup_dead_nodes();
        let right = node
            .service_builder(&service_name(name, "chase")?)
            .request_response::<ControlRequest, ControlResponse>()
            .max_servers(1)
            .max_nodes(SPARE_NODES)
            .open_or_create()
            .map_err(|error| failed(name, "chase", error))?;
        let right = right.server_builder().create().map_err(|error| match error {
            ServerCreateError::ExceedsMaxSupportedServers => ChaseStatusError::AlreadyChased(name.to_owned()),
            other => failed(name, "chase", other).into(),
        })?;
        let (status, _) = sender(&node, name, "chase", MOST_SUBSCRIBERS, SMALL_QUEUE)?;
        Ok(Self { status, _right: right, _node: node })
    }

    /// Sends a status.
    pub fn send(&self, status: &ChaseStatus) {
        if let Err(error) = self.status.send_copy(*status) {
            log::warn!("the status of the chase could not be sent: {error}");
        }
    }
}
