//! The ROS 2 node and its topics, for one run of a show.
//!
//! The bridge creates all objects of ros2-client on its thread, and drops the node and the topics there. The control
//! thread drops the subscriptions of the services.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ros2_client::{Context, Node, NodeName, NodeOptions};

use super::matching::Matches;
use super::rosout::Rosout;
use super::topic_writer::{EVENT_BYTES, Serviced, Stream, TopicWriter, WriterFactory};
use super::{Ros2Config, Ros2Error};
use bench_dragon_messages::sentence::{Figures, alert_sentence, cue_sentence};
use bench_dragon_messages::state::Severity;
use bench_dragon_messages::{ChaseStatus, CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, StageMessage};
use bench_dragon_ros2_messages::diagnostics::{DiagnosticArray, LoopSecond};
use bench_dragon_ros2_messages::markers::MarkerArray;
use bench_dragon_ros2_messages::path::Path;
use bench_dragon_ros2_messages::settings::{DiagnosticLimits, StampClock, Topic};
use bench_dragon_ros2_messages::transforms::TfMessage;
use bench_dragon_ros2_messages::{Clock, HandlePoses, HasStamp, PoseArray, Stamped, Time};

/// An upper bound of the bytes of a point of the path.
const PATH_POSE_BYTES: usize = 88;
/// An upper bound of the bytes of the transforms of head and tail, for any name.
const TRANSFORMS_BYTES: usize = 1000;
/// The time for reliable subscribers to get the last messages. RustDDS notices the loss of a writer's last message with
/// its next heartbeat, up to a second later.
const LINGER: Duration = Duration::from_millis(1500);

/// The writers that the scene requests, and their messages, whose memory is reused.
pub(super) struct Topics {
    name: String,
    stage: StageMessage,
    handles: Option<Stream<HandlePoses>>,
    poses: Option<Stream<PoseArray>>,
    markers: Option<Stream<MarkerArray>>,
    alerts: Option<TopicWriter<Stamped<CollisionAlert>>>,
    stages: Option<TopicWriter<Stamped<StageMessage>>>,
    status: Option<TopicWriter<Stamped<LoopStatus>>>,
    diagnostics: Option<TopicWriter<DiagnosticArray>>,
    cues: Option<TopicWriter<Stamped<Cue>>>,
    clock: Option<TopicWriter<Clock>>,
    transforms: Option<Stream<TfMessage>>,
    path: Option<TopicWriter<Path>>,
    rosout: Rosout,
    stamps: StampClock,
    /// The stamp of the latest transforms.
    transformed: Option<Time>,
    latest_alert: Option<CollisionAlert>,
    latest_chase: Option<ChaseStatus>,
    /// Simulated seconds per second, of the latest frame.
    time_scale: f64,
    /// The latest status, and the messages discarded up to it.
    diagnosed: (LoopStatus, u64),
    limits: DiagnosticLimits,
    /// Messages that did not fit into a queue of RustDDS because a reliable subscriber was slow or dead.
    discarded: u64,
    matches: Matches,
    // Dropped after the writers, which belong to the node.
    node: Node,
}

/// Creates the node `/<name>`: its topics and services are below it.
///
/// # Errors
/// [`Ros2Error`]
pub(super) fn open(context: &Context, name: &str) -> Result<Node, Ros2Error> {
    let failed = |error: &dyn std::fmt::Display| Ros2Error::Failed(error.to_string());
    let (namespace, base) = name.rsplit_once('/').unwrap_or(("", name));
    let node_name = NodeName::new(&format!("/{namespace}"), base).map_err(|error| failed(&error))?;
    // ros2-client's parameter services speak one mapping of service calls, and its log keeps one line.
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    context.new_node(node_name, options).map_err(|error| failed(&error))
}

impl Topics {
    pub(super) fn open(context: Context, node: Node, matches: Matches, config: Ros2Config) -> Result<Self, Ros2Error> {
        let Ros2Config { ref stage, handles, .. } = config;
        let mut maker = WriterFactory { context, node, config: &config, matches: matches.clone() };
        let rosout = Rosout::open(&maker.context, &mut maker.node, &config.name)?;
        // Stage and path hold at any simulated time.
        let stamps = config.settings.stamps;
        let unchanging = stamps.at(stage.stage.stamp_ns, 0.0);
        let path = Arc::new(Path::of(stage).at(unchanging));
        let path_bytes = EVENT_BYTES + path.poses.len() * PATH_POSE_BYTES;
        let stage_bytes = EVENT_BYTES + size_of_val(&stage.segments[..]);
        let mut topics = Self {
            name: config.name.clone(),
            stage: stage.clone(),
            handles: maker.stream(Topic::Handles, 40, || HandlePoses::of(handles))?,
            poses: maker.stream(Topic::Poses, 56, || PoseArray::of(handles))?,
            markers: maker.stream(Topic::Markers, 300, || MarkerArray::of(stage))?,
            alerts: if config.alerts { maker.port(Topic::Alerts, EVENT_BYTES)? } else { None },
            stages: maker.port(Topic::Stage, stage_bytes)?,
            status: maker.port(Topic::Status, EVENT_BYTES)?,
            diagnostics: maker.port(Topic::Diagnostics, EVENT_BYTES)?,
            cues: if config.cues > 0 { maker.port(Topic::Cues, EVENT_BYTES)? } else { None },
            clock: maker.port(Topic::Clock, EVENT_BYTES)?,
            transforms: maker
                .port(Topic::Tf, TRANSFORMS_BYTES * stage.stage.dragons.len().max(1))?
                .map(|port| port.stream(TfMessage::of(&config.name, &stage.stage))),
            path: maker.port(Topic::Path, path_bytes)?,
            rosout,
            stamps,
            transformed: None,
            latest_alert: None,
            latest_chase: None,
            time_scale: 1.0,
            diagnosed: (LoopStatus::default(), 0),
            limits: config.settings.diagnostics,
            discarded: 0,
            matches,
            node: maker.node,
        };
        // The messages that do not change.
        if let Some(port) = &mut topics.stages {
            port.send(Arc::new(Stamped::stage(stage.clone()).at(unchanging)), &mut topics.discarded);
        }
        if let Some(port) = &mut topics.path {
            port.send(path, &mut topics.discarded);
        }
        Ok(topics)
    }
}

impl Topics {
    /// Does the periodic work of the writers. Must be called often.
    pub(super) fn service(&mut self) {
        self.matches.update();
        self.rosout.service(&self.matches);
        self.for_each_writer(|writer, matches, node| writer.service(matches, node));
    }

    fn for_each_writer(&mut self, mut act: impl FnMut(&mut dyn Serviced, &Matches, &mut Node)) {
        fn end<T: Serviced>(end: &mut Option<T>) -> Option<&mut dyn Serviced> {
            end.as_mut().map(|end| end as &mut dyn Serviced)
        }
        let streams = [end(&mut self.handles), end(&mut self.poses), end(&mut self.markers), end(&mut self.transforms)];
        let events = [end(&mut self.alerts), end(&mut self.cues), end(&mut self.stages), end(&mut self.path)];
        let others = [end(&mut self.status), end(&mut self.diagnostics), end(&mut self.clock)];
        for end in streams.into_iter().chain(events).chain(others).flatten() {
            act(end, &self.matches, &mut self.node);
        }
    }

    /// Sends a frame.
    pub(super) fn frame(&mut self, header: &FrameHeader, handles: &[HandlePose]) {
        self.time_scale = header.time_scale;
        let stamp = self.stamps.at(header.stamp_ns, header.sim_time);
        let discarded = &mut self.discarded;
        // First: a node with use_sim_time would take the frame for one of its future.
        if let Some(port) = &mut self.clock {
            port.send(Arc::new(Clock::of(header)), discarded);
        }
        if let Some(stream) = &mut self.handles {
            stream.publish(discarded, stamp, |message| message.update(header, handles));
        }
        if let Some(stream) = &mut self.poses {
            stream.publish(discarded, stamp, |message| message.update(header, handles));
        }
        // tf2 reports a transform with the stamp of the one before as an error, or keeps both.
        if let Some(stream) = self.transforms.as_mut().filter(|_| self.transformed != Some(stamp)) {
            stream.publish(discarded, stamp, |message| message.update(header, handles));
            self.transformed = Some(stamp);
        }
        if let Some(stream) = &mut self.markers {
            let (stage, alert) = (&self.stage, self.latest_alert.as_ref());
            stream.publish(discarded, stamp, |message| message.update(header, handles, &stage.stage, alert));
        }
    }

    /// Sends an alert.
    pub(super) fn alert(&mut self, alert: CollisionAlert) {
        self.latest_alert = Some(alert);
        if let Some(level) = alert.alert_level() {
            let figures = Figures::Shown { time_scale: self.time_scale };
            let sentence = alert_sentence(&alert, &self.stage.stage, figures);
            self.rosout.tell(level.severity(), format!("{}: {sentence}", level.name()));
        }
        if let Some(port) = &mut self.alerts {
            let stamp = self.stamps.at(alert.stamp_ns, alert.sim_time);
            port.send(Arc::new(Stamped::alert(alert).at(stamp)), &mut self.discarded);
        }
    }

    /// Sends a cue.
    pub(super) fn cue(&mut self, cue: Cue) {
        self.rosout.tell(Severity::Ok, cue_sentence(&cue));
        if let Some(port) = &mut self.cues {
            let stamp = self.stamps.at(cue.stamp_ns, cue.sim_time);
            port.send(Arc::new(Stamped::cue(cue).at(stamp)), &mut self.discarded);
        }
    }

    /// Keeps the status of a chase for the diagnostics.
    pub(super) fn chase(&mut self, status: ChaseStatus) {
        self.latest_chase = Some(status);
    }

    /// Sends the loop's status, and the diagnostics that follow from it.
    pub(super) fn status(&mut self, status: &LoopStatus) {
        let stamp = self.stamps.at(status.stamp_ns, status.sim_time);
        if let Some(port) = &mut self.status {
            port.send(Arc::new(Stamped::status(*status).at(stamp)), &mut self.discarded);
        }
        if let Some(port) = &mut self.diagnostics {
            let (before, discarded_before) = std::mem::replace(&mut self.diagnosed, (*status, self.discarded));
            let (discarded, limits) = (self.discarded, self.limits);
            let second = LoopSecond { before: &before, discarded, discarded_before, limits };
            let (stage, alert) = (&self.stage.stage, self.latest_alert.as_ref());
            let message = DiagnosticArray::of(&self.name, status, stage, alert, &second);
            let message = match &self.latest_chase {
                Some(chase) => message.with_chase(&self.name, status, chase),
                None => message,
            };
            port.send(Arc::new(message.at(stamp)), &mut self.discarded);
        }
    }

    /// Returns the number of messages that did not fit into the queues of RustDDS.
    pub(super) fn discarded(&self) -> u64 {
        self.discarded
    }

    /// Ends the sending. Returns the topics if they have subscribers, which may still request the last messages.
    pub(super) fn finish(mut self) -> Option<EndedTopics> {
        self.service();
        let mut is_read = false;
        self.for_each_writer(|writer, matches, _| is_read |= writer.is_read(matches));
        is_read.then(|| EndedTopics { _topics: self, until: Instant::now() + LINGER })
    }
}

/// The topics of a run that has ended. The topics leave the network when this value is dropped.
pub(super) struct EndedTopics {
    _topics: Topics,
    /// The time until which subscribers may request the last messages.
    pub until: Instant,
}

#[cfg(test)]
mod tests {
    use rustdds::CDRSerializerAdapter;
    use rustdds::no_key::SerializerAdapter;
    use serde::Serialize;

    use super::*;
    use crate::topic_writer::HEADER_BYTES;
    use bench_dragon_messages::{
        List, SEGMENT_ARC, SceneName, Stage, StageCue, StageDragon, StageEvent, StageObstacle, StageSegment,
    };

    fn bytes<Message: Serialize>(message: &Message) -> usize {
        CDRSerializerAdapter::<Message>::to_bytes(message).unwrap().len()
    }

    #[test]
    fn no_message_is_larger_than_its_bound() {
        let status = LoopStatus { scene: SceneName::new(&"n".repeat(100)), ..LoopStatus::default() };
        let alert = CollisionAlert { level: 1, event: 2, ..CollisionAlert::default() };
        let worst = LoopStatus {
            skipped: u64::MAX,
            unforeseen_contacts: u64::MAX,
            unsolved_frames: u64::MAX,
            lateness_p99_second: u64::MAX,
            ..status
        };
        let limits = DiagnosticLimits { lateness_warn: 0.0, ..DiagnosticLimits::default() };
        let second = LoopSecond { before: &status, discarded: u64::MAX, discarded_before: 0, limits };
        let name = SceneName::new(&"n".repeat(100));
        let stage = Stage {
            dragons: List::of([StageDragon { name, ..StageDragon::default() }; 100]),
            obstacles: List::of([StageObstacle { name, ..StageObstacle::default() }; 100]),
            events: List::of([StageEvent::default(); 1000]),
            cue_list: List::of([StageCue { name, ..StageCue::default() }; 100]),
            ..Stage::default()
        };
        let stage = StageMessage { stage, segments: Vec::new() };
        // iceoryx2 takes names of at most 255 bytes.
        let name = "n".repeat(255);
        let diagnostics = DiagnosticArray::of(&name, &worst, &stage.stage, Some(&alert), &second);
        let diagnostics =
            diagnostics.with_chase(&name, &worst, &ChaseStatus { frame_rate: 2, ..ChaseStatus::default() });
        let events = [
            bytes(&Stamped::stage(stage)),
            bytes(&Stamped::status(status)),
            bytes(&Stamped::alert(alert)),
            bytes(&diagnostics),
            bytes(&Stamped::cue(Cue { name: SceneName::new(&"n".repeat(100)), ..Cue::default() })),
            bytes(&Clock::of(&FrameHeader::default())),
        ];
        assert!(events.iter().all(|bytes| *bytes < EVENT_BYTES), "{events:?} bytes of {EVENT_BYTES}");
        let arc = StageSegment { length: 10.0, curvature: 10.0, kind: SEGMENT_ARC, ..StageSegment::default() };
        let name = SceneName::new(&"n".repeat(100));
        let dragons = List::of([StageDragon { segments: 1, name, ..StageDragon::default() }]);
        let path = Path::of(&StageMessage { stage: Stage { dragons, ..Stage::default() }, segments: vec![arc] });
        assert!(path.poses.len() > 1000 && bytes(&path) < EVENT_BYTES + path.poses.len() * PATH_POSE_BYTES);
        let transforms = bytes(&TfMessage::of(&"n".repeat(255), &Stage { dragons, ..Stage::default() }));
        assert!(transforms < TRANSFORMS_BYTES, "{transforms}");
        assert!(bytes(&HandlePoses::of(224)) < HEADER_BYTES + 224 * size_of::<HandlePose>());
    }
}
