//! A service of frames, and the publisher's port to it: a header, and a slice of poses of one kind.
//!
//! In: a header and poses. Out: a sample, written where subscribers read it. Called by
//! [`SharedMemoryPublisher`](super::SharedMemoryPublisher), on the loop's thread.

use std::fmt::Debug;

use ::iceoryx2::port::update_connections::UpdateConnections;
use ::iceoryx2::prelude::*;
use ::iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use ::iceoryx2::service::builder::publish_subscribe::{PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError};

use bench_dragon_client::shared_memory::{
    CLOCK, MOST_PUBLISHERS, OpenError, failed, port_error, service_error, service_name,
};

use super::{PublisherConfig, SPARE_NODES, Sender, Service};
use bench_dragon_client::clock::{monotonic_clock_name, monotonic_ns};
use bench_dragon_messages::FrameHeader;

/// The attribute of a decimated service that states one handle in how many it has.
const EVERY: &str = "every";

/// What distinguishes a service of frames from another.
pub(super) struct FrameService {
    /// The last part of its name.
    pub(super) service: &'static str,
    /// Poses in a frame.
    pub(super) poses: usize,
    /// One handle in how many has a pose, where a subscriber cannot know: it becomes the service's attribute
    /// [`EVERY`]. A service that others keep open has to have the same one.
    pub(super) every: Option<usize>,
}

/// Sends frames.
pub(super) struct FrameSender<Pose: ZeroCopySend + Debug + 'static> {
    port: Sender<[Pose], FrameHeader>,
    service: Service<[Pose], FrameHeader>,
}

impl<Pose: ZeroCopySend + Debug + Default + 'static> FrameSender<Pose> {
    /// Opens the service, and the port on this thread.
    pub(super) fn open(
        node: &Node<ipc::Service>,
        config: &PublisherConfig,
        described: &FrameService,
    ) -> Result<Self, OpenError> {
        let FrameService { service: suffix, poses, .. } = *described;
        let service = open_service(node, config, described)?;
        let port = service
            .publisher_builder()
            .initial_max_slice_len(poses)
            .allocation_strategy(AllocationStrategy::Static)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| port_error(&config.name, suffix, error))?;
        Ok(Self { port, service })
    }

    /// Sends a frame: `header` completed, and the poses.
    pub(super) fn send(
        &self,
        header: &FrameHeader,
        mut poses: impl ExactSizeIterator<Item = Pose>,
    ) -> Result<(), String> {
        let handles = poses.len();
        let sample = self.port.loan_slice_uninit(handles).map_err(|error| error.to_string())?;
        // There are as many as it states: the default is never used.
        let mut sample = sample.write_from_fn(|_| poses.next().unwrap_or_default());
        let handles = handles as u32;
        *sample.user_header_mut() = FrameHeader { handles, sent_ns: monotonic_ns(), ..*header };
        sample.send().map(|_| ()).map_err(|error| error.to_string())
    }

    /// Lets late subscribers in.
    pub(super) fn update_connections(&self) {
        let _ = self.port.update_connections();
    }

    /// The subscribers that are connected.
    pub(super) fn subscribers(&self) -> u32 {
        self.service.dynamic_config().number_of_subscribers() as u32
    }
}

/// One left by a watcher can have shorter queues than this publisher would make: it is used as it is.
fn open_service<Pose: ZeroCopySend + Debug + 'static>(
    node: &Node<ipc::Service>,
    config: &PublisherConfig,
    described: &FrameService,
) -> Result<Service<[Pose], FrameHeader>, OpenError> {
    let full_name = service_name(&config.name, described.service)?;
    let attributes = attributes(described).map_err(|reason| failed(&config.name, described.service, reason))?;
    let builder = || {
        node.service_builder(&full_name)
            .publish_subscribe::<[Pose]>()
            .user_header::<FrameHeader>()
            .max_publishers(MOST_PUBLISHERS)
            .enable_safe_overflow(true)
    };
    let made = builder()
        .max_subscribers(config.subscribers)
        .max_nodes(config.subscribers + SPARE_NODES)
        .subscriber_max_buffer_size(config.queue)
        .open_or_create_with_attributes(&attributes);
    match made {
        Err(PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(
            PublishSubscribeOpenError::DoesNotSupportRequestedMinBufferSize,
        )) => {
            log::warn!(
                "a subscriber keeps \"{full_name}\" open with shorter queues than {} frames: those are used",
                config.queue
            );
            builder()
                .open_with_attributes(&attributes)
                .map_err(|error| service_error(&full_name, PublishSubscribeOpenOrCreateError::from(error)))
        }
        other => other.map_err(|error| service_error(&full_name, error)),
    }
}

/// What a service has to have, as its attributes; where it is made, it gets them.
fn attributes(described: &FrameService) -> Result<AttributeVerifier, String> {
    let with = |attributes: AttributeVerifier, key: &str, value: String| {
        let key = AttributeKey::try_from(key).map_err(|error| format!("{error:?}"))?;
        let value = AttributeValue::try_from(value.as_str()).map_err(|error| format!("{error:?}"))?;
        attributes.require(&key, &value).map_err(|error| error.to_string())
    };
    let attributes = with(AttributeVerifier::new(), CLOCK, monotonic_clock_name())?;
    match described.every {
        Some(every) => with(attributes, EVERY, every.to_string()),
        None => Ok(attributes),
    }
}
