//! A publisher of one topic: its quality of service, what it keeps for late and slow subscribers, and what it discards.
//!
//! A transient-local topic holds one message here: the latest. RustDDS keeps more, whatever the depth: what a subscriber has
//! not acknowledged, and the rest until it tidies up every six seconds; a late subscriber would get all of that first. So
//! what nobody subscribes to is not written, but held until somebody asks for it, and a publisher that has kept more than
//! the latest is replaced once the last subscriber has left. Whoever comes while others are there still gets what RustDDS
//! keeps; the current message is the last.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ros2_client::{Context, Node, Publisher};
use rustdds::policy::{self, ResourceLimits};
use rustdds::{QosPolicies, QosPolicyBuilder, TopicKind};
use serde::Serialize;

use super::matching::Matches;
use super::{Ros2Config, Ros2Error};
use bench_dragon_messages::{QUEUE_BYTES, Stage};
use bench_dragon_ros2_messages::MessageType;
use bench_dragon_ros2_messages::settings::{Durability, Qos, Reliability, Topic};

/// How long a subscriber that has died counts as slow: its lease.
const LEASE_SECONDS: f64 = 12.0;
/// RustDDS's own limit.
const UNACKNOWLEDGED_MESSAGES: f64 = 8192.0;
/// How long a subscriber that has just been matched is given to match in turn. Now and then RustDDS does not deliver what it
/// sends meanwhile, although it keeps it.
const SETTLING_TIME: Duration = Duration::from_millis(200);
/// When the first message is sent once more, for a subscriber that took longer.
const REPETITION_TIME: Duration = Duration::from_millis(1500);
/// More bytes than a message has besides its handles.
pub(super) const HEADER_BYTES: usize = 200;
/// More bytes than any message has that is not of every frame; the largest of them is the stage.
pub(super) const EVENT_BYTES: usize = HEADER_BYTES + size_of::<Stage>();

/// A publisher of one topic.
pub(super) struct TopicWriter<Message: Serialize> {
    publisher: Publisher<Arc<Message>>,
    dds: rustdds::Topic,
    topic: String,
    reported: bool,
    /// Only where late subscribers get what was sent before.
    latched: Option<Latched<Message>>,
}

/// What a transient-local topic holds.
struct Latched<Message> {
    latest: Option<Arc<Message>>,
    /// Whether the latest has been written.
    is_written: bool,
    /// Messages that the publisher has written, one that was written twice counted once.
    written: u64,
    /// Whether the one message has been written a second time.
    is_repeated: bool,
    /// Since when somebody has been there without a break.
    reader_since: Option<Instant>,
    /// Whether those who are there have come just now.
    is_settling: bool,
}

impl<Message> Latched<Message> {
    const NOTHING: Self = Self {
        latest: None,
        is_written: false,
        written: 0,
        is_repeated: false,
        reader_since: None,
        is_settling: false,
    };
}

impl<Message: Serialize> TopicWriter<Message> {
    /// A publisher of this message, which is changed before each time it is sent.
    pub(super) fn stream(self, message: Message) -> Stream<Message> {
        Stream { port: self, message: Arc::new(message) }
    }

    /// Sends a message, or holds it until somebody subscribes. What a full queue does not take is counted, and reported once.
    pub(super) fn send(&mut self, message: Arc<Message>, discarded: &mut u64) {
        if let Some(latched) = &mut self.latched {
            latched.latest = Some(Arc::clone(&message));
            latched.is_written = false;
            if latched.reader_since.is_none() || latched.is_settling {
                return;
            }
        }
        if self.write(message) {
            return;
        }
        *discarded += 1;
        if !self.reported {
            self.reported = true;
            log::warn!(
                "ROS 2 topic {}: a reliable subscriber is so slow, or dead, that messages are discarded until it is \
                 back or its lease ends (reported once)",
                self.topic
            );
        }
    }

    fn write(&mut self, message: Arc<Message>) -> bool {
        let is_written = self.publisher.publish(message).is_ok();
        if let Some(latched) = &mut self.latched
            && is_written
        {
            latched.written += u64::from(!latched.is_written);
            latched.is_written = true;
        }
        is_written
    }

    /// Begins anew with a publisher that has written nothing.
    fn replace(&mut self, node: &mut Node) {
        match node.create_publisher(&self.dds, None) {
            Ok(publisher) => self.publisher = publisher,
            Err(error) => log::warn!("ROS 2 topic {}: late subscribers get old messages first: {error}", self.topic),
        }
        if let Some(latched) = &mut self.latched {
            (latched.written, latched.is_written, latched.is_repeated) = (0, false, false);
        }
    }
}

/// A publisher that knows what late subscribers are to get.
pub(super) trait Serviced {
    /// Sends what is held where somebody asks for it, and forgets what was sent when the last subscriber has left. To be
    /// called often.
    fn service(&mut self, matches: &Matches, node: &mut Node);
}

impl<Message: Serialize> Serviced for TopicWriter<Message> {
    fn service(&mut self, matches: &Matches, node: &mut Node) {
        let Some(latched) = &mut self.latched else { return };
        let readers = matches.readers(self.publisher.guid());
        if !readers.any() {
            (latched.reader_since, latched.is_settling) = (None, false);
            let keeps_latest_alone = latched.written == 1 && latched.is_written;
            if latched.written > 0 && !keeps_latest_alone {
                self.replace(node);
            }
            return;
        }
        let present = latched.reader_since.get_or_insert_with(Instant::now).elapsed();
        // Who has not asked for what was sent before awaits what is sent from now on, at once.
        latched.is_settling = readers.volatile == 0 && present < SETTLING_TIME;
        let Some(latest) = latched.latest.clone().filter(|_| readers.transient_local > 0) else { return };
        if !latched.is_written && !latched.is_settling {
            // For those who have not asked for it, it would be news. Of a new publisher they get what comes from now on.
            if readers.volatile > 0 {
                self.replace(node);
            }
            self.write(latest);
        } else if latched.written == 1 && readers.volatile == 0 && !latched.is_repeated && present >= REPETITION_TIME {
            latched.is_repeated = true;
            self.write(latest);
        }
    }
}

impl<Message: Serialize> Serviced for Stream<Message> {
    fn service(&mut self, matches: &Matches, node: &mut Node) {
        self.port.service(matches, node);
    }
}

/// A publisher whose message is changed from frame to frame, so that its memory is used again.
pub(super) struct Stream<Message: Serialize> {
    port: TopicWriter<Message>,
    message: Arc<Message>,
}

impl<Message: Serialize + Clone> Stream<Message> {
    pub(super) fn publish(&mut self, discarded: &mut u64, change: impl FnOnce(&mut Message)) {
        change(Arc::make_mut(&mut self.message));
        self.port.send(Arc::clone(&self.message), discarded);
    }
}

/// Makes the publishers of one node.
pub(super) struct WriterFactory<'a> {
    pub(super) context: Context,
    pub(super) node: Node,
    pub(super) config: &'a Ros2Config,
}

impl WriterFactory<'_> {
    /// As [`WriterFactory::port`], for what is sent with every frame: `each` bytes a handle, `message` being filled later.
    pub(super) fn stream<Message: Serialize>(
        &mut self,
        topic: Topic,
        each: usize,
        message: impl FnOnce() -> Message,
    ) -> Result<Option<Stream<Message>>, Ros2Error> {
        let bytes = HEADER_BYTES + self.config.handles * each;
        let port = self.port(topic, bytes, self.config.rate)?;
        Ok(port.map(|port| port.stream(message())))
    }

    /// A publisher for `topic` if the scene requests it. `bytes` is the message's size, for a bound of the memory.
    pub(super) fn port<Message: Serialize>(
        &mut self,
        topic: Topic,
        bytes: usize,
        rate: f64,
    ) -> Result<Option<TopicWriter<Message>>, Ros2Error> {
        let Some(qos) = self.config.settings.topics.get(&topic) else { return Ok(None) };
        let name = topic.path(&self.config.name);
        let failed = |error: &dyn std::fmt::Display| Ros2Error::Failed(format!("topic {name}: {error}"));
        let (participant, type_name) = (self.context.domain_participant(), MessageType::of(topic).dds_name());
        // Made here and not through the node, whose quality of service knows no limit of memory.
        let dds = participant
            .create_topic(format!("rt{name}"), type_name, &policies(*qos, bytes, rate), TopicKind::NoKey)
            .map_err(|error| failed(&error))?;
        let publisher = self.node.create_publisher(&dds, None).map_err(|error| failed(&error))?;
        let latched = (qos.durability == Durability::TransientLocal).then_some(Latched::NOTHING);
        Ok(Some(TopicWriter { publisher, dds, topic: name, reported: false, latched }))
    }
}

/// The quality of service on the wire. A full queue refuses at once instead of blocking; it holds what a dead subscriber
/// leaves unacknowledged during its lease, as far as memory allows.
fn policies(qos: Qos, bytes: usize, rate: f64) -> QosPolicies {
    let reliability = match qos.reliability {
        Reliability::Reliable => policy::Reliability::Reliable { max_blocking_time: rustdds::Duration::ZERO },
        Reliability::BestEffort => policy::Reliability::BestEffort,
    };
    let durability = match qos.durability {
        Durability::Volatile => policy::Durability::Volatile,
        Durability::TransientLocal => policy::Durability::TransientLocal,
    };
    let depth = qos.depth as i32;
    let affordable = (QUEUE_BYTES as f64 / bytes as f64).min(UNACKNOWLEDGED_MESSAGES);
    let max_samples = ((LEASE_SECONDS * rate).min(affordable) as i32).max(depth);
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(durability)
        .history(policy::History::KeepLast { depth })
        .resource_limits(ResourceLimits { max_samples, max_instances: 1, max_samples_per_instance: max_samples })
        .build()
}
