//! The writer of one topic: its quality of service, its messages for late and slow subscribers, its discarded messages.
//!
//! A transient-local topic holds one message here: the latest. RustDDS keeps more, whatever the depth: unacknowledged
//! messages, and all others until its cleanup every six seconds. A late subscriber would get all of them first. With
//! Fast DDS so would a volatile subscriber, since RustDDS does not read the durability of a subscriber. So a message
//! without subscribers is held here and not written, and a writer that keeps outdated messages is replaced after its
//! last subscriber has left. A GAP of our own ([`readers`](super::readers)) withholds older messages from a subscriber
//! that joins others, and the latest one from a volatile subscriber.
//! RustDDS sends a GAP only if the writer is volatile (`Writer::matched_reader_update`, `rtps/writer.rs:2074`). A
//! second, volatile writer is no remedy: a volatile subscriber matches both, and a transient-local one would report
//! the second as incompatible. Messages to single readers are no remedy either: RustDDS repairs them for every later
//! subscriber.
//!
//! A reliable subscriber that has acknowledged nothing, since it is new or was killed, makes RustDDS refuse messages
//! for all subscribers of the topic (`WriterSendBuffer::admit_blocking`, `rtps/writer_send_buffer.rs:199`). So a
//! refused message is held and written again, and a writer that refuses for longer than a new subscriber takes is
//! replaced.
//!
//! A volatile writer is relieved by a second one before it has written many messages ([`relief`](super::relief)), and
//! keeps the messages of some seconds only ([`readers`](super::readers)).

use std::sync::Arc;
use std::time::{Duration, Instant};

use ros2_client::{Context, Node, Publisher};
use rustdds::no_key::SerializerAdapter;
use rustdds::policy::{self, ResourceLimits};
use rustdds::{CDRSerializerAdapter, QosPolicies, QosPolicyBuilder, TopicKind};
use serde::Serialize;

use super::copies::Copies;
use super::matching::Matches;
use super::readers::{Kind, Readers};
use super::relief::Relief;
use super::{Ros2Config, Ros2Error, UNACKNOWLEDGED_MESSAGES};
use bench_dragon_messages::{MOST_CUES, MOST_DRAGONS, MOST_OBSTACLES, QUEUE_BYTES, Stage};
use bench_dragon_ros2_messages::settings::{Durability, Qos, Reliability, Topic};
use bench_dragon_ros2_messages::{HasStamp, MessageType, Time};

/// The longest time for which a writer may refuse: a new subscriber takes milliseconds to acknowledge.
const REFUSAL_PATIENCE: Duration = Duration::from_millis(500);
/// The interval at which the subscribers of a volatile topic are read.
const READ_INTERVAL: Duration = Duration::from_millis(50);
/// The time in which RustDDS matches a new publisher with the subscribers that it knows.
const MATCHING_TIME: Duration = Duration::from_millis(100);
/// An upper bound of a message's bytes besides its handles.
pub(super) const HEADER_BYTES: usize = 200;
/// An upper bound of an event-driven message's bytes; the largest is the stage.
pub(super) const EVENT_BYTES: usize =
    HEADER_BYTES + size_of::<Stage>() + NAME_BYTES * (MOST_DRAGONS + MOST_OBSTACLES + MOST_CUES);
/// CDR adds the length and the end of a name.
const NAME_BYTES: usize = 8;

/// The writer of one topic.
pub(super) struct TopicWriter<Message: Serialize> {
    publisher: Publisher<Arc<Message>>,
    dds: rustdds::Topic,
    topic: String,
    reported: bool,
    /// The message that RustDDS has refused.
    refused: Option<Refused<Message>>,
    /// The time at which the publisher was replaced.
    replaced: Option<Instant>,
    /// The held message of a transient-local topic.
    latched: Option<Latched<Message>>,
    relief: Relief<Publisher<Arc<Message>>>,
    readers: Readers,
    /// The time at which the subscribers were read.
    read: Option<Instant>,
    /// The second copies of large messages.
    copies: Option<Copies>,
    matches: Matches,
}

/// A message that RustDDS has refused, with the time of the first refusal.
struct Refused<Message> {
    message: Arc<Message>,
    since: Instant,
}

/// The state of a transient-local topic.
struct Latched<Message> {
    latest: Option<Arc<Message>>,
    /// True if the latest message has been written.
    is_written: bool,
}

impl<Message: Serialize> TopicWriter<Message> {
    /// Creates a stream of this message, which is changed before each sending.
    pub(super) fn stream(self, message: Message) -> Stream<Message> {
        Stream { port: self, message: Arc::new(message) }
    }

    /// Sends a message, or holds the message until there is a subscriber or RustDDS takes the message. While RustDDS
    /// refuses a message, the next message replaces the refused message. Such a loss is counted, and reported once.
    pub(super) fn send(&mut self, message: Arc<Message>, discarded: &mut u64) {
        if let Some(latched) = &mut self.latched {
            latched.latest = Some(Arc::clone(&message));
            latched.is_written = false;
            if self.readers.is_empty() {
                return;
            }
        }
        self.write_refused();
        if let Some(refused) = &mut self.refused {
            refused.message = message;
            *discarded += 1;
            if !std::mem::replace(&mut self.reported, true) {
                log::warn!(
                    "ROS 2 topic {}: a reliable subscriber is so slow, or dead, that messages are discarded (reported \
                     once)",
                    self.topic
                );
            }
        } else if !self.write(Arc::clone(&message)) {
            self.refused = Some(Refused { message, since: Instant::now() });
        }
    }

    /// Writes the message that was refused.
    fn write_refused(&mut self) {
        let Some(message) = self.refused.as_ref().map(|refused| Arc::clone(&refused.message)) else { return };
        if self.write(message) {
            self.refused = None;
        }
    }

    /// Writes the message that was refused, if need be by a new publisher, which does not wait for acknowledgements.
    fn end_refusal(&mut self, node: &mut Node) {
        self.write_refused();
        if self.refused.as_ref().is_some_and(|refused| refused.since.elapsed() >= REFUSAL_PATIENCE) {
            self.replace(node);
            self.write_refused();
        }
    }

    fn write(&mut self, message: Arc<Message>) -> bool {
        let is_written = self.publisher.publish(Arc::clone(&message)).is_ok();
        if is_written {
            self.relief.count();
            self.readers.count(Instant::now());
            self.copy(&message);
            self.latched.iter_mut().for_each(|latched| latched.is_written = true);
        }
        is_written
    }

    /// Sends a second copy of a large message that has been written.
    fn copy(&self, message: &Message) {
        let Some(copies) = &self.copies else { return };
        let writer = self.publisher.guid();
        let readers = self.matches.neighbours(writer);
        if readers.is_empty() {
            return;
        }
        if let Ok(payload) = CDRSerializerAdapter::<Message>::to_bytes(message) {
            copies.send(writer, self.readers.written(), payload.to_vec(), readers);
        }
    }

    /// Replaces the publisher by one without history.
    fn replace(&mut self, node: &mut Node) {
        self.replaced = Some(Instant::now());
        match node.create_publisher(&self.dds, None) {
            Ok(publisher) => self.publisher = publisher,
            Err(error) => log::warn!("ROS 2 topic {}: late subscribers get old messages first: {error}", self.topic),
        }
        self.latched.iter_mut().for_each(|latched| latched.is_written = false);
        self.relief = Relief::default();
        self.readers.restart();
    }

    /// Relieves a volatile publisher when it is due, and acknowledges its old messages.
    fn relieve(&mut self, matches: &Matches, node: &mut Node) {
        let (dds, topic) = (&self.dds, &self.topic);
        let create = || match node.create_publisher(dds, None) {
            Ok(publisher) => Some(publisher),
            Err(error) => {
                log::debug!("ROS 2 topic {topic}: {error}");
                None
            }
        };
        let is_matched = |first: &Publisher<_>, second: &Publisher<_>| {
            let matched = matches.subscribers(second.guid());
            matches.subscribers(first.guid()).keys().all(|reader| matched.contains_key(reader))
        };
        let now = Instant::now();
        if self.read.is_some_and(|read| now.duration_since(read) < READ_INTERVAL) {
            return;
        }
        self.read = Some(now);
        let writer = self.publisher.guid();
        if let Some(ended) = self.relief.serve(&mut self.publisher, now, create, is_matched) {
            matches.forget(ended.guid());
        }
        if self.publisher.guid() != writer {
            self.readers.restart();
        }
        let writer = self.publisher.guid();
        matches.settle(writer, self.readers.update(&matches.subscribers(writer), now));
    }
}

/// A writer that serves late subscribers.
pub(super) trait Serviced {
    /// Sends held messages, to new subscribers too, and drops the history after the last subscriber has left. Must be
    /// called often.
    fn service(&mut self, matches: &Matches, node: &mut Node);
    /// Returns true if there is a subscriber.
    fn is_read(&self, matches: &Matches) -> bool;
}

impl<Message: Serialize> Serviced for TopicWriter<Message> {
    fn service(&mut self, matches: &Matches, node: &mut Node) {
        self.end_refusal(node);
        let Some(latched) = &mut self.latched else { return self.relieve(matches, node) };
        let writer = self.publisher.guid();
        let subscribers = matches.subscribers(writer);
        if subscribers.is_empty() && self.replaced.is_some_and(|replaced| replaced.elapsed() < MATCHING_TIME) {
            return;
        }
        matches.settle(writer, self.readers.update(&subscribers, Instant::now()));
        if subscribers.is_empty() {
            // The messages that RustDDS keeps are out of date for the next subscriber, unless the latest is the only
            // one. The memory of a replaced publisher is never free again: it stays in tables of discovery.
            let is_current = latched.is_written && self.readers.written() == 1;
            if self.readers.written() > 0 && !is_current {
                self.replace(node);
            }
            return;
        }
        let (one_requests_history, all_request_history) = self.readers.request_history();
        if latched.is_written || !one_requests_history {
            return;
        }
        let Some(latest) = latched.latest.clone() else { return };
        // A volatile subscriber would take the held message for a new one. As a message of a new publisher, it is
        // withheld from that subscriber.
        if !all_request_history {
            self.replace(node);
        }
        // A subscriber that matches this publisher later requests the message then.
        self.write(latest);
    }

    fn is_read(&self, matches: &Matches) -> bool {
        !matches.subscribers(self.publisher.guid()).is_empty()
    }
}

impl<Message: Serialize> Serviced for Stream<Message> {
    fn service(&mut self, matches: &Matches, node: &mut Node) {
        self.port.service(matches, node);
    }

    fn is_read(&self, matches: &Matches) -> bool {
        self.port.is_read(matches)
    }
}

/// A writer whose message is changed from frame to frame, so that its memory is reused.
pub(super) struct Stream<Message: Serialize> {
    port: TopicWriter<Message>,
    message: Arc<Message>,
}

impl<Message: Serialize + Clone + HasStamp> Stream<Message> {
    pub(super) fn publish(&mut self, discarded: &mut u64, stamp: Time, change: impl FnOnce(&mut Message)) {
        let message = Arc::make_mut(&mut self.message);
        change(message);
        message.set_stamp(stamp);
        self.port.send(Arc::clone(&self.message), discarded);
    }
}

/// Creates the writers of one node.
pub(super) struct WriterFactory<'a> {
    pub(super) context: Context,
    pub(super) node: Node,
    pub(super) config: &'a Ros2Config,
    pub(super) matches: Matches,
}

impl WriterFactory<'_> {
    /// As [`WriterFactory::port`], for a message of every frame with `each` bytes a handle. `message` is filled later.
    pub(super) fn stream<Message: Serialize>(
        &mut self,
        topic: Topic,
        each: usize,
        message: impl FnOnce() -> Message,
    ) -> Result<Option<Stream<Message>>, Ros2Error> {
        let bytes = HEADER_BYTES + self.config.handles * each;
        let port = self.port(topic, bytes)?;
        Ok(port.map(|port| port.stream(message())))
    }

    /// Creates the writer of `topic` if the scene requests it. `bytes` is the message's size, for a bound of the
    /// memory.
    pub(super) fn port<Message: Serialize>(
        &mut self,
        topic: Topic,
        bytes: usize,
    ) -> Result<Option<TopicWriter<Message>>, Ros2Error> {
        let Some(qos) = self.config.settings.topics.get(&topic) else { return Ok(None) };
        let name = topic.path(&self.config.name);
        let failed = |error: &dyn std::fmt::Display| Ros2Error::Failed(format!("topic {name}: {error}"));
        let (participant, type_name) = (self.context.domain_participant(), MessageType::of(topic).dds_name());
        // Not created through the node, whose quality of service has no limit of memory.
        let dds = participant
            .create_topic(format!("rt{name}"), type_name, &policies(*qos, bytes), TopicKind::NoKey)
            .map_err(|error| failed(&error))?;
        let publisher = self.node.create_publisher(&dds, None).map_err(|error| failed(&error))?;
        let nothing = Latched { latest: None, is_written: false };
        let (kind, latched) = match qos.durability {
            Durability::TransientLocal => (Kind::Latest, Some(nothing)),
            Durability::Volatile => (Kind::Volatile(qos.depth.into()), None),
        };
        Ok(Some(TopicWriter {
            publisher,
            dds,
            topic: name,
            reported: false,
            refused: None,
            replaced: None,
            latched,
            relief: Relief::default(),
            readers: Readers::new(kind),
            read: None,
            copies: Copies::of(bytes),
            matches: self.matches.clone(),
        }))
    }
}

/// Returns the quality of service on the wire. A full queue refuses at once instead of blocking. The queue holds the
/// messages that a dead subscriber leaves unacknowledged, as far as memory allows.
pub(super) fn policies(qos: Qos, bytes: usize) -> QosPolicies {
    let reliability = match qos.reliability {
        Reliability::Reliable => policy::Reliability::Reliable { max_blocking_time: rustdds::Duration::ZERO },
        Reliability::BestEffort => policy::Reliability::BestEffort,
    };
    let durability = match qos.durability {
        Durability::Volatile => policy::Durability::Volatile,
        Durability::TransientLocal => policy::Durability::TransientLocal,
    };
    let depth = qos.depth as i32;
    let affordable = (QUEUE_BYTES / bytes).min(UNACKNOWLEDGED_MESSAGES as usize);
    let max_samples = (affordable as i32).max(depth);
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(durability)
        .history(policy::History::KeepLast { depth })
        .resource_limits(ResourceLimits { max_samples, max_instances: 1, max_samples_per_instance: max_samples })
        .build()
}
