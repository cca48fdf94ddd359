//! The service `<name>/scene`: the text of the scene, sent once and kept for late subscribers.
//!
//! In: a configuration with the text. Out: one sample of bytes. Called by
//! [`SharedMemoryPublisher`](super::SharedMemoryPublisher), on the loop's thread.

use std::time::Instant;

use ::iceoryx2::port::update_connections::UpdateConnections;
use ::iceoryx2::prelude::*;

use bench_dragon_client::shared_memory::{MOST_PUBLISHERS, OpenError, failed, port_error, service_error, service_name};
use bench_dragon_messages::{SceneHeader, Stage};

use super::{PublisherConfig, REPEAT_INTERVAL, SPARE_NODES, Sender, Service};

/// The scenes that a subscriber may fall behind: that of this run, and that of the next.
const QUEUE: usize = 2;

/// Sends the text of one scene.
pub(super) struct SceneSender {
    header: SceneHeader,
    text: String,
    port: Sender<[u8], SceneHeader>,
    service: Service<[u8], SceneHeader>,
    sent: Instant,
}

impl SceneSender {
    /// Opens the service and sends the text.
    pub(super) fn open(node: &Node<ipc::Service>, config: &PublisherConfig) -> Result<Self, OpenError> {
        let PublisherConfig { name, subscribers, scene: text, stage, .. } = config;
        let full_name = service_name(name, "scene")?;
        let service = node
            .service_builder(&full_name)
            .publish_subscribe::<[u8]>()
            .user_header::<SceneHeader>()
            .max_publishers(MOST_PUBLISHERS)
            .max_subscribers(*subscribers)
            .max_nodes(subscribers + SPARE_NODES)
            .subscriber_max_buffer_size(QUEUE)
            .history_size(1)
            .enable_safe_overflow(true)
            .open_or_create()
            .map_err(|error| service_error(&full_name, error))?;
        let port = service
            .publisher_builder()
            // An empty text has room too.
            .initial_max_slice_len(text.len().max(1))
            .allocation_strategy(AllocationStrategy::Static)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| port_error(name, "scene", error))?;
        let Stage { run_id, scene_hash, .. } = *stage;
        let header = SceneHeader { run_id, hash: scene_hash };
        let mut sender = Self { header, text: text.clone(), port, service, sent: Instant::now() };
        sender.send().map_err(|reason| failed(name, "scene", reason))?;
        Ok(sender)
    }

    fn send(&mut self) -> Result<(), String> {
        self.sent = Instant::now();
        let sample = self.port.loan_slice_uninit(self.text.len()).map_err(|error| error.to_string())?;
        let mut sample = sample.write_from_slice(self.text.as_bytes());
        *sample.user_header_mut() = self.header;
        sample.send().map(|_| ()).map_err(|error| error.to_string())
    }

    /// Delivers the text to late subscribers, on this machine and, through a tunnel, on others.
    pub(super) fn maintain(&mut self) {
        let _ = self.port.update_connections();
        let has_tunnel = self.service.dynamic_config().number_of_publishers() > 1;
        if has_tunnel && self.sent.elapsed() >= REPEAT_INTERVAL {
            let _ = self.send();
        }
    }
}
