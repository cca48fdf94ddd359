//! The origin of a message, and the selected publisher. A service admits two publishers, one of which can be the end of
//! a tunnel to other machines. The tunnel is told from the show by the origin of its samples.

use iceoryx2::identifiers::{UniqueNodeId, UniquePublisherId};
use iceoryx2::prelude::*;
use iceoryx2::service::Service;
use iceoryx2::service::dynamic_config::publish_subscribe::DynamicConfig;
use iceoryx2::service::header::payload_header::PayloadHeader;
use iceoryx2::service::header::publish_subscribe::Header;
use iceoryx2::service::port_factory::PortFactory;

use bench_dragon_messages::{ChaseStatus, CollisionAlert, Cue, LoopStatus, SceneHeader, Stage};

/// The ports of a service.
type Ports = DynamicConfig<<ipc::Service as Service>::Bag>;

/// A publisher's port of a service, and the node it belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Origin {
    pub(super) publisher: UniquePublisherId,
    pub(super) node: UniqueNodeId,
}

impl Origin {
    /// Returns the origin of a sample.
    pub(super) fn of(header: &Header) -> Self {
        Self { publisher: header.publisher_id(), node: header.node_id() }
    }
}

/// The publisher whose frames are handed over, and the run of its latest frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Selected {
    pub(super) origin: Origin,
    pub(super) run_id: u64,
}

/// Returns the publishers of a service.
pub(super) fn publishers(service: &impl PortFactory<DynamicConfig = Ports>) -> Vec<Origin> {
    let mut all = Vec::new();
    service.dynamic_config().list_publishers(|of| {
        all.push(Origin { publisher: of.publisher_id, node: of.node_id });
        CallbackProgression::Continue
    });
    all
}

/// A message that belongs to a run.
pub(super) trait OfRun {
    fn run_id(&self) -> u64;
}

macro_rules! of_run {
    ($($message:ty),*) => {
        $(impl OfRun for $message {
            fn run_id(&self) -> u64 {
                self.run_id
            }
        })*
    };
}

of_run!(ChaseStatus, CollisionAlert, Cue, LoopStatus, SceneHeader, Stage);
