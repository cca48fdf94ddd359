//! The messages of each recorded topic, as the ROS 2 transport would send them.
//!
//! In: a subscriber's messages. Out: a [`Batch`], whose memory is reused.

use super::file::Batch;
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, Stage, StageMessage};
use bench_dragon_ros2_messages::diagnostics::{DiagnosticArray, LoopSecond};
use bench_dragon_ros2_messages::markers::MarkerArray;
use bench_dragon_ros2_messages::path::Path;
use bench_dragon_ros2_messages::settings::{DiagnosticLimits, StampClock, Topic};
use bench_dragon_ros2_messages::transforms::TfMessage;
use bench_dragon_ros2_messages::{Clock, HandlePoses, HasStamp, PoseArray, Stamped};

/// The messages of one publisher.
pub(super) struct Messages {
    name: String,
    topics: Vec<Topic>,
    /// The clock of the stamps of the run.
    pub stamps: StampClock,
    /// The messages of the latest call.
    pub batch: Batch,
    handles: HandlePoses,
    poses: PoseArray,
    /// Markers and transforms, after the first stage.
    markers: Option<MarkerArray>,
    transforms: Option<TfMessage>,
}

impl Messages {
    /// Creates the messages of the publisher `name` on these topics.
    pub fn new(name: &str, topics: &[Topic]) -> Self {
        Self {
            name: name.to_owned(),
            topics: topics.to_vec(),
            stamps: StampClock::default(),
            batch: Batch::default(),
            handles: HandlePoses::of(0),
            poses: PoseArray::of(0),
            markers: None,
            transforms: None,
        }
    }

    /// Fills the messages of a frame, with the current stage and alert.
    pub fn frame(
        &mut self,
        frame: &FrameHeader,
        handles: &[HandlePose],
        stage: Option<&Stage>,
        alert: Option<&CollisionAlert>,
    ) {
        let batch = &mut self.batch;
        batch.clear();
        let (stamp_ns, sequence) = (frame.stamp_ns, frame.sequence as u32);
        let stamp = self.stamps.at(stamp_ns, frame.sim_time);
        for topic in self.topics.iter().copied() {
            match topic {
                Topic::Handles => {
                    self.handles.update(frame, handles);
                    self.handles.set_stamp(stamp);
                    batch.push(topic, stamp_ns, sequence, &self.handles);
                }
                Topic::Poses => {
                    self.poses.update(frame, handles);
                    self.poses.set_stamp(stamp);
                    batch.push(topic, stamp_ns, sequence, &self.poses);
                }
                Topic::Clock => batch.push(topic, stamp_ns, sequence, &Clock::of(frame)),
                Topic::Tf => {
                    if let (Some(transforms), Some(_)) = (&mut self.transforms, stage) {
                        transforms.update(frame, handles);
                        transforms.set_stamp(stamp);
                        batch.push(topic, stamp_ns, sequence, transforms);
                    }
                }
                Topic::Markers => {
                    if let (Some(markers), Some(stage)) = (&mut self.markers, stage) {
                        markers.update(frame, handles, stage, alert);
                        markers.set_stamp(stamp);
                        batch.push(topic, stamp_ns, sequence, markers);
                    }
                }
                Topic::Alerts | Topic::Stage | Topic::Diagnostics | Topic::Status | Topic::Path | Topic::Cues => (),
            }
        }
    }

    /// Fills the messages of a stage, the path among them.
    pub fn stage(&mut self, sequence: u32, message: &StageMessage) {
        let stage = &message.stage;
        self.batch.clear();
        self.markers = self.topics.contains(&Topic::Markers).then(|| MarkerArray::of(message));
        self.transforms = self.topics.contains(&Topic::Tf).then(|| TfMessage::of(&self.name, stage));
        // Both hold at any simulated time.
        let stamp = self.stamps.at(stage.stamp_ns, 0.0);
        self.batch.push(Topic::Stage, stage.stamp_ns, sequence, &Stamped::stage(message.clone()).at(stamp));
        if self.topics.contains(&Topic::Path) {
            self.batch.push(Topic::Path, stage.stamp_ns, sequence, &Path::of(message).at(stamp));
        }
    }

    /// Fills the message of an alert.
    pub fn alert(&mut self, sequence: u32, alert: CollisionAlert) {
        self.batch.clear();
        let stamp = self.stamps.at(alert.stamp_ns, alert.sim_time);
        self.batch.push(Topic::Alerts, alert.stamp_ns, sequence, &Stamped::alert(alert).at(stamp));
    }

    /// Fills the message of a cue.
    pub fn cue(&mut self, sequence: u32, cue: Cue) {
        self.batch.clear();
        let stamp = self.stamps.at(cue.stamp_ns, cue.sim_time);
        self.batch.push(Topic::Cues, cue.stamp_ns, sequence, &Stamped::cue(cue).at(stamp));
    }

    /// Fills the messages of a status, with the current stage and alert. The diagnostics compare the status with the
    /// status `before`, by the default limits: the limits in the text of the scene are not read here.
    pub fn status(
        &mut self,
        sequence: u32,
        status: &LoopStatus,
        stage: Option<&Stage>,
        alert: Option<&CollisionAlert>,
        before: &LoopStatus,
    ) {
        self.batch.clear();
        let stamp = self.stamps.at(status.stamp_ns, status.sim_time);
        self.batch.push(Topic::Status, status.stamp_ns, sequence, &Stamped::status(*status).at(stamp));
        let limits = DiagnosticLimits::default();
        let second = LoopSecond { before, discarded: 0, discarded_before: 0, limits };
        let unknown = Stage::default();
        let message = DiagnosticArray::of(&self.name, status, stage.unwrap_or(&unknown), alert, &second).at(stamp);
        self.batch.push(Topic::Diagnostics, status.stamp_ns, sequence, &message);
    }
}
