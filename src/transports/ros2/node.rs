//! The ROS 2 node and its topics: the sink of the background thread.
//!
//! Everything of ros2-client but the participant is created and dropped on that thread.

use std::sync::Arc;
use std::time::Duration;

use ros2_client::{Context, Node, NodeName, NodeOptions};

use super::port::{Maker, Port, SELDOM_BYTES, Stream};
use super::{Ros2Config, Ros2Error};
use crate::ros2_messages::diagnostics::DiagnosticArray;
use crate::ros2_messages::markers::MarkerArray;
use crate::ros2_messages::path::Path;
use crate::ros2_messages::transforms::TfMessage;
use crate::ros2_messages::{Clock, HandlePoses, PoseArray, Stamped};
use crate::scene::ros2::Topic;
use crate::transports::background::Sink;
use crate::wire::{CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, Stage};

/// More bytes than a point of the path has.
const PATH_POSE_BYTES: usize = 88;
/// More bytes than the transforms of head and tail have, whatever the name.
const TRANSFORMS_BYTES: usize = 1000;
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
    cues: Option<Port<Stamped<Cue>>>,
    clock: Option<Port<Clock>>,
    transforms: Option<Stream<TfMessage>>,
    /// The path, and when it was published.
    path: Option<(Port<Path>, Arc<Path>)>,
    latest_alert: Option<CollisionAlert>,
    /// Alerts so far.
    alerts_sent: u64,
    skipped_periods: u64,
    /// Whether what is sent seldom has been sent a second time.
    repeated: bool,
    /// Messages that a full queue of RustDDS did not take, because a reliable subscriber was slow or dead.
    discarded: u64,
    // Dropped after the publishers: they belong to it.
    _node: Node,
}

impl Topics {
    pub(super) fn open(context: Context, config: Ros2Config) -> Result<Self, Ros2Error> {
        let Ros2Config { stage, handles, .. } = config;
        let failed = |error: &dyn std::fmt::Display| Ros2Error::Failed(error.to_string());
        let node_name = NodeName::new(&format!("/{}", config.name), "publisher").map_err(|error| failed(&error))?;
        // Fewer endpoints, fewer complaints of subscribers that look for what RustDDS cannot send.
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let node = context.new_node(node_name, options).map_err(|error| failed(&error))?;
        let mut maker = Maker { context, node, config: &config };
        let path = Arc::new(Path::of(&stage));
        let path_bytes = SELDOM_BYTES + path.poses.len() * PATH_POSE_BYTES;
        let mut topics = Self {
            name: config.name.clone(),
            stage,
            handles: maker.stream(Topic::Handles, 40, || HandlePoses::of(handles))?,
            poses: maker.stream(Topic::Poses, 56, || PoseArray::of(handles))?,
            markers: maker.stream(Topic::Markers, 300, || MarkerArray::of(&stage))?,
            alerts: if config.alerts { maker.port(Topic::Alerts, SELDOM_BYTES, 1.0)? } else { None },
            stages: maker.port(Topic::Stage, SELDOM_BYTES, 1.0)?,
            status: maker.port(Topic::Status, SELDOM_BYTES, 1.0)?,
            diagnostics: maker.port(Topic::Diagnostics, SELDOM_BYTES, 1.0)?,
            cues: if config.cues > 0 { maker.port(Topic::Cues, SELDOM_BYTES, 1.0)? } else { None },
            clock: maker.port(Topic::Clock, SELDOM_BYTES, config.rate)?,
            transforms: maker
                .port(Topic::Tf, TRANSFORMS_BYTES, config.rate)?
                .map(|port| port.stream(TfMessage::of(&config.name))),
            path: maker.port(Topic::Path, path_bytes, 1.0)?.map(|port| (port, path)),
            latest_alert: None,
            alerts_sent: 0,
            skipped_periods: 0,
            repeated: false,
            discarded: 0,
            _node: maker.node,
        };
        topics.publish_surroundings();
        Ok(topics)
    }

    /// Sends what does not change: the stage and the path.
    fn publish_surroundings(&mut self) {
        if let Some(port) = &mut self.stages {
            port.send(Arc::new(Stamped::stage(self.stage)), &mut self.discarded);
        }
        if let Some((port, path)) = &mut self.path {
            port.send(Arc::clone(path), &mut self.discarded);
        }
    }

    fn publish_alert(&mut self, alert: CollisionAlert) {
        if let Some(port) = &mut self.alerts {
            port.send(Arc::new(Stamped::alert(alert)), &mut self.discarded);
        }
    }

    /// Sends once more what a transient-local topic holds. Now and then RustDDS does not deliver what was sent while it was
    /// still discovering a subscriber, although it keeps it: a second later they have found each other. What has been
    /// followed by something newer since is not sent again.
    fn repeat(&mut self) {
        self.publish_surroundings();
        if let Some(alert) = self.latest_alert.filter(|_| self.alerts_sent == 1) {
            self.publish_alert(alert);
        }
    }
}

impl Sink for Topics {
    fn frame(&mut self, header: &FrameHeader, handles: &[HandlePose]) {
        let discarded = &mut self.discarded;
        if let Some(stream) = &mut self.handles {
            stream.publish(discarded, |message| message.update(header, handles));
        }
        if let Some(stream) = &mut self.poses {
            stream.publish(discarded, |message| message.update(header, handles));
        }
        if let Some(port) = &mut self.clock {
            port.send(Arc::new(Clock::of(header)), discarded);
        }
        if let Some(stream) = &mut self.transforms {
            stream.publish(discarded, |message| message.update(header, handles));
        }
        if let Some(stream) = &mut self.markers {
            let (stage, alert) = (&self.stage, self.latest_alert.as_ref());
            stream.publish(discarded, |message| message.update(header, handles, stage, alert));
        }
    }

    fn alert(&mut self, alert: CollisionAlert) {
        self.latest_alert = Some(alert);
        self.alerts_sent += 1;
        self.publish_alert(alert);
    }

    fn cue(&mut self, cue: Cue) {
        if let Some(port) = &mut self.cues {
            port.send(Arc::new(Stamped::cue(cue)), &mut self.discarded);
        }
    }

    fn status(&mut self, status: &LoopStatus) {
        if !std::mem::replace(&mut self.repeated, true) {
            self.repeat();
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
    use serde::Serialize;

    use super::*;
    use crate::transports::ros2::port::HEADER_BYTES;
    use crate::wire::{SEGMENT_ARC, SceneName, StageSegment};

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
            bytes(&Stamped::cue(Cue { name: SceneName::new(&"n".repeat(100)), ..Cue::default() })),
            bytes(&Clock::of(&FrameHeader::default())),
        ];
        assert!(seldom.iter().all(|bytes| *bytes < SELDOM_BYTES), "{seldom:?} bytes of {SELDOM_BYTES}");
        let mut stage = Stage { segments: 1, ..Stage::default() };
        stage.path[0] = StageSegment { length: 10.0, curvature: 10.0, kind: SEGMENT_ARC, ..StageSegment::default() };
        let path = Path::of(&stage);
        assert!(path.poses.len() > 1000 && bytes(&path) < SELDOM_BYTES + path.poses.len() * PATH_POSE_BYTES);
        let transforms = bytes(&TfMessage::of(&"n".repeat(255)));
        assert!(transforms < TRANSFORMS_BYTES, "{transforms}");
        assert!(bytes(&HandlePoses::of(224)) < HEADER_BYTES + 224 * size_of::<HandlePose>());
    }
}
