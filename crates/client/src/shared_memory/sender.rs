//! Senders of single messages: the alerts, cues and status of a publisher, and the status of a chase.
//!
//! In: a node, the name of a service and its limits. Out: a port to send with.

use ::iceoryx2::port::publisher::Publisher;
use ::iceoryx2::prelude::*;
use ::iceoryx2::service::builder::publish_subscribe::{PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError};
use ::iceoryx2::service::port_factory::publish_subscribe;

use super::{MOST_PUBLISHERS, OpenError, port_error, service_error, service_name};

/// The nodes that may have a service open besides one for each subscriber: the publisher's, and dead nodes that are not
/// removed yet.
pub const SPARE_NODES: usize = 32;
/// Alerts and statuses that a subscriber may fall behind.
pub const SMALL_QUEUE: usize = 16;

/// A service of messages.
pub type Service<Payload, Header> = publish_subscribe::PortFactory<ipc::Service, Payload, Header>;
/// A port to send messages with.
pub type Sender<Payload, Header> = Publisher<ipc::Service, Payload, Header>;
/// A port, and its service.
type Opened<Message> = (Sender<Message, ()>, Service<Message, ()>);

/// Opens a service of single messages, and a port to it. The last message is kept for late subscribers.
///
/// # Errors
/// [`OpenError`]
pub fn sender<Message: ZeroCopySend + std::fmt::Debug + Copy>(
    node: &Node<ipc::Service>,
    name: &str,
    service: &str,
    subscribers: usize,
    queue: usize,
) -> Result<Opened<Message>, OpenError> {
    let full_name = service_name(name, service)?;
    let open = |queue| {
        node.service_builder(&full_name)
            .publish_subscribe::<Message>()
            .max_publishers(MOST_PUBLISHERS)
            .max_subscribers(subscribers)
            .max_nodes(subscribers + SPARE_NODES)
            .subscriber_max_buffer_size(queue)
            .history_size(1)
            .enable_safe_overflow(true)
            .open_or_create()
    };
    let opened = match open(queue) {
        // A subscriber of a scene with fewer cues keeps its service open.
        Err(PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(
            PublishSubscribeOpenError::DoesNotSupportRequestedMinBufferSize,
        )) if queue > SMALL_QUEUE => {
            log::warn!("a subscriber keeps \"{full_name}\" open with shorter queues than {queue}: those are used");
            open(SMALL_QUEUE)
        }
        made => made,
    };
    let opened = opened.map_err(|error| service_error(&full_name, error))?;
    let port = opened
        .publisher_builder()
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
        .map_err(|error| port_error(name, service, error))?;
    Ok((port, opened))
}
