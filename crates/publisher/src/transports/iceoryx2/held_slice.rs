//! A service of one message with a list: `<name>/stage` and `<name>/scene`. The message is sent at the beginning and
//! kept for late subscribers. While there is a tunnel, it is sent again once a second.
//!
//! In: a header and the elements. Out: one sample.

use std::fmt::Debug;
use std::time::Instant;

use ::iceoryx2::port::update_connections::UpdateConnections;
use ::iceoryx2::prelude::*;

use bench_dragon_client::shared_memory::{MOST_PUBLISHERS, OpenError, failed, port_error, service_error, service_name};

use super::{PublisherConfig, REPEAT_INTERVAL, SPARE_NODES, Sender, Service, UnsentError};

/// The messages that a subscriber may fall behind: that of this run, and that of the next.
pub(super) const QUEUE: usize = 2;

/// The parts of such a message.
pub(super) trait Sent: ZeroCopySend + Debug + Copy + Default + 'static {}

impl<Part: ZeroCopySend + Debug + Copy + Default + 'static> Sent for Part {}

/// Sends one message.
pub(super) struct HeldSlice<Element: Sent, Header: Sent> {
    header: Header,
    elements: Vec<Element>,
    port: Sender<[Element], Header>,
    service: Service<[Element], Header>,
    sent: Instant,
}

impl<Element: Sent, Header: Sent> HeldSlice<Element, Header> {
    /// Opens the service and sends the message.
    pub(super) fn open(
        node: &Node<ipc::Service>,
        config: &PublisherConfig,
        service: &str,
        header: Header,
        elements: &[Element],
    ) -> Result<Self, OpenError> {
        let PublisherConfig { name, subscribers, .. } = config;
        let full_name = service_name(name, service)?;
        let opened = node
            .service_builder(&full_name)
            .publish_subscribe::<[Element]>()
            .user_header::<Header>()
            .max_publishers(MOST_PUBLISHERS)
            .max_subscribers(*subscribers)
            .max_nodes(subscribers + SPARE_NODES)
            .subscriber_max_buffer_size(QUEUE)
            .history_size(1)
            .enable_safe_overflow(true)
            .open_or_create()
            .map_err(|error| service_error(&full_name, error))?;
        let port = opened
            .publisher_builder()
            // An empty list has room too.
            .initial_max_slice_len(elements.len().max(1))
            .allocation_strategy(AllocationStrategy::Static)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| port_error(name, service, error))?;
        let mut held = Self { header, elements: elements.to_vec(), port, service: opened, sent: Instant::now() };
        held.send().map_err(|error| failed(name, service, error.to_string()))?;
        Ok(held)
    }

    fn send(&mut self) -> Result<(), UnsentError> {
        self.sent = Instant::now();
        let sample = self.port.loan_slice_uninit(self.elements.len())?;
        let mut sample = sample.write_from_slice(&self.elements);
        *sample.user_header_mut() = self.header;
        sample.send()?;
        Ok(())
    }

    /// Delivers the message to late subscribers, on this machine and, through a tunnel, on others.
    pub(super) fn maintain(&mut self) {
        let _ = self.port.update_connections();
        let has_tunnel = self.service.dynamic_config().number_of_publishers() > 1;
        if has_tunnel && self.sent.elapsed() >= REPEAT_INTERVAL {
            let _ = self.send();
        }
    }
}
