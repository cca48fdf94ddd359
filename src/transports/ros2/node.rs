//! The ROS 2 thread: its node, its topics, and the loop that publishes what the queues bring.
//!
//! Started by the transport's `start`; everything of ros2-client lives and dies on this thread.

use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc;
use std::time::Duration;

use ros2_client::{Context, Node, NodeName, NodeOptions, Publisher};
use rustdds::policy::{self, ResourceLimits};
use rustdds::{DomainParticipantBuilder, QosPolicies, QosPolicyBuilder, TopicKind};
use serde::Serialize;

use super::environment::{Network, Range};
use super::messages::{DiagnosticArray, HandlePoses, Header, MarkerArray, Pose, PoseArray, Stamped, Time, type_name};
use super::{Inbox, Ros2Config, Ros2Error, Shared, Snapshot};
use crate::live::clock::{monotonic_ns, sleep_until};
use crate::scene::ros2::{Durability, Qos, Reliability, Topic};
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
/// Nanoseconds after a frame's deadline at which it is looked for, and between two looks.
const FIRST_LOOK_NS: u64 = 300_000;
const LOOK_NS: u64 = 500_000;
/// The longest sleep: what is sent seldom waits no longer.
const LONGEST_SLEEP_NS: u64 = 50_000_000;
/// How long a reliable subscriber is given for the last messages.
const LINGER: Duration = Duration::from_millis(100);

/// Opens the topics, tells `opened` how that went, and publishes until told to stop.
pub(super) fn serve(
    config: &Ros2Config,
    rate: f64,
    network: Network,
    mut inbox: Inbox,
    opened: &mpsc::Sender<Result<(), Ros2Error>>,
) {
    let mut topics = match Topics::open(config, rate, network) {
        Ok(topics) => topics,
        Err(error) => {
            let _ = opened.send(Err(error));
            return;
        }
    };
    topics.publish_stage(&inbox.shared);
    let _ = opened.send(Ok(()));
    let period_ns = (1e9 / rate) as u64;
    let mut rejected = 0;
    let mut look_at = 0;
    loop {
        // Read before the queues are emptied: what was put there before it was set is then still published.
        let ending = inbox.shared.stop.load(Ordering::Acquire);
        sleep_until(look_at);
        while let Ok(alert) = inbox.alerts.pop() {
            topics.publish_alert(alert, &inbox.shared);
        }
        let rejected_now = inbox.shared.rejected.load(Ordering::Relaxed);
        let newest_only = rejected_now > rejected;
        rejected = rejected_now;
        let mut deadline_ns = None;
        while let Ok(snapshot) = inbox.filled.pop() {
            if newest_only && !inbox.filled.is_empty() {
                inbox.shared.counts.skipped.fetch_add(1, Ordering::Relaxed);
            } else {
                topics.publish_frame(&snapshot, &inbox.shared);
                inbox.shared.counts.frames.fetch_add(1, Ordering::Relaxed);
            }
            deadline_ns = Some(snapshot.header.deadline_ns);
            // The ring has a place for every snapshot there is.
            let _ = inbox.free.push(snapshot);
        }
        while let Ok(status) = inbox.status.try_recv() {
            topics.publish_status(&status, &inbox.shared);
        }
        if ending {
            std::thread::sleep(LINGER);
            return;
        }
        let now = monotonic_ns();
        look_at = match deadline_ns {
            Some(deadline_ns) => (deadline_ns + period_ns + FIRST_LOOK_NS).max(now),
            None => now + LOOK_NS,
        };
        look_at = look_at.min(now + LONGEST_SLEEP_NS);
    }
}

/// The publishers that the scene asks for, and the messages they send, whose memory is used again.
struct Topics {
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
    // Dropped after the publishers: they belong to it.
    _node: Node,
}

/// A publisher of one topic.
struct Port<Message: Serialize> {
    publisher: Publisher<Arc<Message>>,
    topic: String,
    complained: bool,
}

impl<Message: Serialize> Port<Message> {
    /// Sends a message. What a full queue does not take is counted, and said once.
    fn send(&mut self, message: Arc<Message>, shared: &Shared) {
        if self.publisher.publish(message).is_ok() {
            return;
        }
        shared.counts.discarded.fetch_add(1, Ordering::Relaxed);
        if !self.complained {
            self.complained = true;
            log::warn!(
                "ROS 2 topic {}: a reliable subscriber is so slow, or dead, that messages are discarded until it is \
                 back or its lease ends (said once)",
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
    fn publish(&mut self, shared: &Shared, change: impl FnOnce(&mut Message)) {
        change(Arc::make_mut(&mut self.message));
        self.port.send(Arc::clone(&self.message), shared);
    }
}

/// Makes the publishers of one node.
struct Maker<'a> {
    context: Context,
    node: Node,
    config: &'a Ros2Config,
    rate: f64,
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
        let port = self.port(topic, type_name, bytes, self.rate)?;
        Ok(port.map(|port| Stream { port, message: Arc::new(message()) }))
    }

    /// A publisher for `topic` if the scene asks for it. `bytes` is the message's size, for a bound of the memory.
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
        Ok(Some(Port { publisher, topic: name, complained: false }))
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
    fn open(config: &Ros2Config, rate: f64, network: Network) -> Result<Self, Ros2Error> {
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
        let mut maker = Maker { context, node, config, rate };
        let (stage, handles) = (config.stage, config.handles);
        let header = || Header::of(0);
        Ok(Self {
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
            _node: maker.node,
        })
    }

    fn publish_stage(&mut self, shared: &Shared) {
        if let Some(port) = &mut self.stages {
            port.send(Arc::new(Stamped::stage(self.stage)), shared);
        }
    }

    fn publish_alert(&mut self, alert: CollisionAlert, shared: &Shared) {
        self.latest_alert = Some(alert);
        if let Some(port) = &mut self.alerts {
            port.send(Arc::new(Stamped::alert(alert)), shared);
        }
    }

    fn publish_frame(&mut self, snapshot: &Snapshot, shared: &Shared) {
        let Snapshot { header, handles } = snapshot;
        let stamp = Time::of(header.stamp_ns);
        if let Some(stream) = &mut self.handles {
            stream.publish(shared, |message| {
                message.header.stamp = stamp;
                message.frame = *header;
                message.poses.copy_from_slice(handles);
            });
        }
        if let Some(stream) = &mut self.poses {
            stream.publish(shared, |message| {
                message.header.stamp = stamp;
                for (pose, handle) in message.poses.iter_mut().zip(handles) {
                    *pose = Pose::of(handle);
                }
            });
        }
        if let Some(stream) = &mut self.markers {
            let (stage, alert) = (&self.stage, self.latest_alert.as_ref());
            stream.publish(shared, |message| message.update(header, handles, stage, alert));
        }
    }

    fn publish_status(&mut self, status: &LoopStatus, shared: &Shared) {
        if let Some(port) = &mut self.status {
            port.send(Arc::new(Stamped::status(*status)), shared);
        }
        if let Some(port) = &mut self.diagnostics {
            let skipped_since = status.skipped - self.skipped_periods;
            self.skipped_periods = status.skipped;
            let discarded = shared.counts.discarded.load(Ordering::Relaxed);
            let alert = self.latest_alert.as_ref();
            let message = DiagnosticArray::of(&self.name, status, alert, skipped_since, discarded);
            port.send(Arc::new(message), shared);
        }
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
