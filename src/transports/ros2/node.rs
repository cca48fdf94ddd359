//! The ROS 2 node and its topics: the sink of the background thread.
//!
//! Everything of ros2-client is created and dropped on that thread.

use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;
use std::time::Duration;

use ros2_client::{Context, Node, NodeName, NodeOptions, Publisher};
use rustdds::policy::{self, ResourceLimits};
use rustdds::{DomainParticipantBuilder, QosPolicies, QosPolicyBuilder, TopicKind};
use serde::Serialize;

use super::environment::Range;
use super::messages::{DiagnosticArray, HandlePoses, Header, MarkerArray, Pose, PoseArray, Stamped, Time, type_name};
use super::{Ros2Config, Ros2Error};
use crate::scene::ros2::{Durability, Qos, Reliability, Topic};
use crate::transports::background::Sink;
use crate::wire::{CollisionAlert, FrameHeader, HandlePose, LoopStatus, Stage};

/// How long a subscriber that has died counts as slow: its lease.
const LEASE_SECONDS: f64 = 12.0;
/// The memory that one topic may keep for slow subscribers.
const UNACKNOWLEDGED_BYTES: f64 = 64_000_000.0;
/// RustDDS's own limit.
const UNACKNOWLEDGED_MESSAGES: f64 = 8192.0;
/// More bytes than a message has besides its handles.
const HEADER_BYTES: usize = 200;
/// More bytes than any message has that is not of every frame; the largest of them is the stage.
const SELDOM_BYTES: usize = HEADER_BYTES + size_of::<Stage>();
/// How long a reliable subscriber is given for the last messages.
const LINGER: Duration = Duration::from_millis(100);

/// The publishers that the scene requests, and the messages they send, whose memory is used again.
pub(super) struct Topics {
    name: String,
    stage: Stage,
    handles: Option<Stream<HandlePoses>>,
    poses: Option<Stream<PoseArray>>,
    markers: Option<Stream<MarkerArray>>,
    alerts: Option<Port<Stamped<CollisionAlert>>>,
    stages: Option<Port<Stamped<Stage>>>,
    status: Option<Port<Stamped<LoopStatus>>>,
    diagnostics: Option<Port<DiagnosticArray>>,
    latest_alert: Option<CollisionAlert>,
    skipped_periods: u64,
    /// Whether the stage has been sent a second time.
    stage_repeated: bool,
    /// Messages that a full queue of RustDDS did not take, because a reliable subscriber was slow or dead.
    discarded: u64,
    // Dropped after the publishers: they belong to it.
    _node: Node,
}

/// A publisher of one topic.
struct Port<Message: Serialize> {
    publisher: Publisher<Arc<Message>>,
    topic: String,
    reported: bool,
}

impl<Message: Serialize> Port<Message> {
    /// Sends a message. What a full queue does not take is counted, and reported once.
    fn send(&mut self, message: Arc<Message>, discarded: &mut u64) {
        if self.publisher.publish(message).is_ok() {
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
}

/// A publisher whose message is changed from frame to frame, so that its memory is used again.
struct Stream<Message: Serialize> {
    port: Port<Message>,
    message: Arc<Message>,
}

impl<Message: Serialize + Clone> Stream<Message> {
    fn publish(&mut self, discarded: &mut u64, change: impl FnOnce(&mut Message)) {
        change(Arc::make_mut(&mut self.message));
        self.port.send(Arc::clone(&self.message), discarded);
    }
}

/// Makes the publishers of one node.
struct Maker<'a> {
    context: Context,
    node: Node,
    config: &'a Ros2Config,
}

impl Maker<'_> {
    /// As [`Maker::port`], for what is sent with every frame: `each` bytes a handle, `message` being filled later.
    fn stream<Message: Serialize>(
        &mut self,
        topic: Topic,
        type_name: &str,
        each: usize,
        message: impl FnOnce() -> Message,
    ) -> Result<Option<Stream<Message>>, Ros2Error> {
        let bytes = HEADER_BYTES + self.config.handles * each;
        let port = self.port(topic, type_name, bytes, self.config.rate)?;
        Ok(port.map(|port| Stream { port, message: Arc::new(message()) }))
    }

    /// A publisher for `topic` if the scene requests it. `bytes` is the message's size, for a bound of the memory.
    fn port<Message: Serialize>(
        &mut self,
        topic: Topic,
        type_name: &str,
        bytes: usize,
        rate: f64,
    ) -> Result<Option<Port<Message>>, Ros2Error> {
        let Some(qos) = self.config.settings.topics.get(&topic) else { return Ok(None) };
        let name = topic.path(&self.config.name);
        let failed = |error: &dyn std::fmt::Display| Ros2Error::Failed(format!("topic {name}: {error}"));
        let participant = self.context.domain_participant();
        // Made here and not through the node, whose quality of service knows no limit of memory.
        let dds = participant
            .create_topic(format!("rt{name}"), type_name.to_owned(), &policies(*qos, bytes, rate), TopicKind::NoKey)
            .map_err(|error| failed(&error))?;
        let publisher = self.node.create_publisher(&dds, None).map_err(|error| failed(&error))?;
        Ok(Some(Port { publisher, topic: name, reported: false }))
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
    let affordable = (UNACKNOWLEDGED_BYTES / bytes as f64).min(UNACKNOWLEDGED_MESSAGES);
    let max_samples = ((LEASE_SECONDS * rate).min(affordable) as i32).max(depth);
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(durability)
        .history(policy::History::KeepLast { depth })
        .resource_limits(ResourceLimits { max_samples, max_instances: 1, max_samples_per_instance: max_samples })
        .build()
}

impl Topics {
    pub(super) fn open(config: &Ros2Config) -> Result<Self, Ros2Error> {
        let Ros2Config { network, stage, handles, .. } = *config;
        let failed = |error: &dyn std::fmt::Display| Ros2Error::Failed(error.to_string());
        let mut builder = DomainParticipantBuilder::new(network.domain);
        if network.range == Range::Localhost {
            builder = builder.with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)]);
        }
        let participant = builder.build().map_err(|error| failed(&error))?;
        let context = Context::from_domain_participant(participant).map_err(|error| failed(&error))?;
        let node_name = NodeName::new(&format!("/{}", config.name), "publisher").map_err(|error| failed(&error))?;
        // Fewer endpoints, fewer complaints of subscribers that look for what RustDDS cannot send.
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let node = context.new_node(node_name, options).map_err(|error| failed(&error))?;
        let mut maker = Maker { context, node, config };
        let header = || Header::of(0);
        let mut topics = Self {
            name: config.name.clone(),
            stage,
            handles: maker.stream(Topic::Handles, type_name::HANDLE_POSES, 40, || HandlePoses {
                header: header(),
                frame: FrameHeader::default(),
                poses: vec![HandlePose::default(); handles],
            })?,
            poses: maker.stream(Topic::Poses, type_name::POSE_ARRAY, 56, || PoseArray {
                header: header(),
                poses: vec![Pose::of(&HandlePose::default()); handles],
            })?,
            markers: maker.stream(Topic::Markers, type_name::MARKER_ARRAY, 300, || MarkerArray::of(&stage))?,
            alerts: if config.alerts {
                maker.port(Topic::Alerts, type_name::COLLISION_ALERT, SELDOM_BYTES, 1.0)?
            } else {
                None
            },
            stages: maker.port(Topic::Stage, type_name::STAGE, SELDOM_BYTES, 1.0)?,
            status: maker.port(Topic::Status, type_name::LOOP_STATUS, SELDOM_BYTES, 1.0)?,
            diagnostics: maker.port(Topic::Diagnostics, type_name::DIAGNOSTIC_ARRAY, SELDOM_BYTES, 1.0)?,
            latest_alert: None,
            skipped_periods: 0,
            stage_repeated: false,
            discarded: 0,
            _node: maker.node,
        };
        topics.publish_stage();
        Ok(topics)
    }

    fn publish_stage(&mut self) {
        if let Some(port) = &mut self.stages {
            port.send(Arc::new(Stamped::stage(self.stage)), &mut self.discarded);
        }
    }
}

impl Sink for Topics {
    fn frame(&mut self, header: &FrameHeader, handles: &[HandlePose]) {
        let stamp = Time::of(header.stamp_ns);
        let discarded = &mut self.discarded;
        if let Some(stream) = &mut self.handles {
            stream.publish(discarded, |message| {
                message.header.stamp = stamp;
                message.frame = *header;
                message.poses.copy_from_slice(handles);
            });
        }
        if let Some(stream) = &mut self.poses {
            stream.publish(discarded, |message| {
                message.header.stamp = stamp;
                for (pose, handle) in message.poses.iter_mut().zip(handles) {
                    *pose = Pose::of(handle);
                }
            });
        }
        if let Some(stream) = &mut self.markers {
            let (stage, alert) = (&self.stage, self.latest_alert.as_ref());
            stream.publish(discarded, |message| message.update(header, handles, stage, alert));
        }
    }

    fn alert(&mut self, alert: CollisionAlert) {
        self.latest_alert = Some(alert);
        if let Some(port) = &mut self.alerts {
            port.send(Arc::new(Stamped::alert(alert)), &mut self.discarded);
        }
    }

    fn status(&mut self, status: &LoopStatus) {
        // Now and then RustDDS does not deliver what was sent while it was still discovering a subscriber, although it
        // keeps it: a second later they have found each other.
        if !std::mem::replace(&mut self.stage_repeated, true) {
            self.publish_stage();
        }
        if let Some(port) = &mut self.status {
            port.send(Arc::new(Stamped::status(*status)), &mut self.discarded);
        }
        if let Some(port) = &mut self.diagnostics {
            let skipped_since = status.skipped - self.skipped_periods;
            self.skipped_periods = status.skipped;
            let alert = self.latest_alert.as_ref();
            let message = DiagnosticArray::of(&self.name, status, alert, skipped_since, self.discarded);
            port.send(Arc::new(message), &mut self.discarded);
        }
    }

    fn discarded(&self) -> u64 {
        self.discarded
    }

    fn linger(&self) -> Duration {
        LINGER
    }
}

#[cfg(test)]
mod tests {
    use rustdds::CDRSerializerAdapter;
    use rustdds::no_key::SerializerAdapter;

    use super::*;
    use crate::wire::SceneName;

    fn bytes<Message: Serialize>(message: &Message) -> usize {
        CDRSerializerAdapter::<Message>::to_bytes(message).unwrap().len()
    }

    #[test]
    fn no_message_is_larger_than_its_bound() {
        let status = LoopStatus { scene: SceneName::new(&"n".repeat(100)), ..LoopStatus::default() };
        let alert = CollisionAlert { level: 1, event: 2, ..CollisionAlert::default() };
        // iceoryx2 takes no longer name.
        let diagnostics = DiagnosticArray::of(&"n".repeat(255), &status, Some(&alert), u64::MAX, u64::MAX);
        let seldom = [
            bytes(&Stamped::stage(Stage::default())),
            bytes(&Stamped::status(status)),
            bytes(&Stamped::alert(alert)),
            bytes(&diagnostics),
        ];
        assert!(seldom.iter().all(|bytes| *bytes < SELDOM_BYTES), "{seldom:?} bytes of {SELDOM_BYTES}");
        let poses = vec![HandlePose::default(); 224];
        let frame = HandlePoses { header: Header::of(0), frame: FrameHeader::default(), poses };
        assert!(bytes(&frame) < HEADER_BYTES + 224 * size_of::<HandlePose>());
    }
}
