//! A service of frames, and the publisher's port to it: a header, and a slice of poses of one kind.
//!
//! In: a header and poses. Out: a sample, written where subscribers read it, on the loop's thread.

use std::fmt::Debug;

use ::iceoryx2::port::update_connections::UpdateConnections;
use ::iceoryx2::prelude::*;
use ::iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use ::iceoryx2::service::builder::publish_subscribe::{PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError};

use bench_dragon_client::shared_memory::{
    CLOCK, MOST_PUBLISHERS, OpenError, failed, port_error, service_error, service_name,
};

use super::{PublisherConfig, SPARE_NODES, Sender, Service, UnsentError};
use bench_dragon_client::clock::{monotonic_clock_name, monotonic_ns};
use bench_dragon_messages::FrameHeader;

/// The attribute of a decimated service that states the decimation.
const EVERY: &str = "every";

/// The properties of a service of frames.
pub(super) struct FrameService {
    /// The last part of its name.
    pub(super) service: &'static str,
    /// Poses in a frame.
    pub(super) poses: usize,
    /// The decimation of the handles, which becomes the service's attribute [`EVERY`], or `None` for all handles. A
    /// service that others keep open must have the same attribute.
    pub(super) every: Option<usize>,
}

/// Sends frames.
pub(super) struct FrameSender<Pose: ZeroCopySend + Debug + 'static> {
    port: Sender<[Pose], FrameHeader>,
    service: Service<[Pose], FrameHeader>,
}

impl<Pose: ZeroCopySend + Debug + Default + 'static> FrameSender<Pose> {
    /// Opens the service, and the port on the calling thread.
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

    /// Completes `header` and sends it with the poses.
    pub(super) fn send(
        &self,
        header: &FrameHeader,
        mut poses: impl ExactSizeIterator<Item = Pose>,
    ) -> Result<(), UnsentError> {
        let handles = poses.len();
        let sample = self.port.loan_slice_uninit(handles)?;
        // The iterator has exactly `handles` items: the default is never used.
        let mut sample = sample.write_from_fn(|_| poses.next().unwrap_or_default());
        let handles = handles as u32;
        *sample.user_header_mut() = FrameHeader { handles, sent_ns: monotonic_ns(), ..*header };
        sample.send()?;
        Ok(())
    }

    /// Delivers the history to newly connected subscribers.
    pub(super) fn update_connections(&self) {
        let _ = self.port.update_connections();
    }

    /// Returns the number of connected subscribers.
    pub(super) fn subscribers(&self) -> u32 {
        self.service.dynamic_config().number_of_subscribers() as u32
    }
}

/// Opens or creates the service. A service that a subscriber keeps open can have shorter queues, and is used.
fn open_service<Pose: ZeroCopySend + Debug + 'static>(
    node: &Node<ipc::Service>,
    config: &PublisherConfig,
    described: &FrameService,
) -> Result<Service<[Pose], FrameHeader>, OpenError> {
    let full_name = service_name(&config.name, described.service)?;
    let attributes = attributes(&config.name, described)?;
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

/// Returns the attributes that a service must have. A new service gets them.
fn attributes(name: &str, described: &FrameService) -> Result<AttributeVerifier, OpenError> {
    let illegal = |error| failed(name, described.service, format!("{error:?}"));
    let with = |attributes: AttributeVerifier, key: &str, value: String| {
        let key = AttributeKey::try_from(key).map_err(illegal)?;
        let value = AttributeValue::try_from(value.as_str()).map_err(illegal)?;
        let required = attributes.require(&key, &value);
        required.map_err(|error| failed(name, described.service, error.to_string()))
    };
    let attributes = with(AttributeVerifier::new(), CLOCK, monotonic_clock_name())?;
    match described.every {
        Some(every) => with(attributes, EVERY, every.to_string()),
        None => Ok(attributes),
    }
}
