//! A run while it is recorded: its open file and its state.

use std::cmp::Ordering;
use std::io;
use std::sync::Arc;

use serde_json::json;

use super::file::McapFile;
use bench_dragon_messages::json::{Exact, StageObject};
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, LoopStatus, StageMessage};

/// The name of the attachment with the description of the run.
const ATTACHMENT: &str = "bench_dragon.json";
/// The name of the attachment with the text of the scene.
pub(super) const SCENE_ATTACHMENT: &str = "scene.toml";

/// An event-driven message.
#[derive(Debug, Clone)]
pub(super) enum Event {
    Stage(Box<StageMessage>),
    Scene { run_id: u64, text: Arc<str> },
    Alert(CollisionAlert),
    Cue(Cue),
    Status(LoopStatus),
}

impl Event {
    /// Returns the run of the message.
    pub fn run_id(&self) -> u64 {
        match self {
            Self::Stage(stage) => stage.stage.run_id,
            Self::Scene { run_id, .. } => *run_id,
            Self::Alert(alert) => alert.run_id,
            Self::Cue(cue) => cue.run_id,
            Self::Status(status) => status.run_id,
        }
    }

    /// Returns the message's time and the tick of its frame. A stage belongs to the first frame of the run.
    fn stamp(&self) -> (u64, u64) {
        match self {
            Self::Stage(stage) => (stage.stage.stamp_ns, 0),
            // The text of a scene is no message.
            Self::Scene { .. } => (0, 0),
            Self::Alert(alert) => (alert.stamp_ns, alert.tick),
            Self::Cue(cue) => (cue.stamp_ns, cue.tick),
            Self::Status(status) => (status.stamp_ns, status.tick),
        }
    }
}

/// A run and its open file.
pub(super) struct Run {
    pub run_id: u64,
    pub file: McapFile,
    /// The tick of the file's first frame, and its log time.
    pub file_began_tick: u64,
    pub file_began_stamp_ns: u64,
    /// The deadlines of the file's first frame and of the run's latest.
    pub file_began_ns: u64,
    pub latest_deadline_ns: u64,
    pub attached: bool,
    /// The latest messages, as a subscriber that joins now gets them.
    pub stage: Option<Box<StageMessage>>,
    pub scene: Option<Arc<str>>,
    pub alert: Option<CollisionAlert>,
    pub cue: Option<Cue>,
    pub status: Option<LoopStatus>,
    /// The status before the next one, for the diagnostics: an empty status at the start of a run, `None` if unknown.
    pub diagnosed: Option<LoopStatus>,
    /// The number of event-driven messages so far.
    pub events: u32,
}

impl Run {
    /// Starts a run with the first frame of its file.
    pub fn new(file: McapFile, frame: &FrameHeader) -> Self {
        Self {
            run_id: frame.run_id,
            file,
            file_began_tick: frame.tick,
            file_began_stamp_ns: frame.stamp_ns,
            file_began_ns: frame.deadline_ns,
            latest_deadline_ns: frame.deadline_ns,
            attached: false,
            stage: None,
            scene: None,
            alert: None,
            cue: None,
            status: None,
            diagnosed: (frame.sequence == 0).then(LoopStatus::default),
            events: 0,
        }
    }

    /// Returns the log time of a message: its own time, with a lower bound. The log time of a message of the file's
    /// first frame, or of an earlier frame, is not before that first frame. An older message, as a late subscriber gets
    /// it, would leave a gap. Ticks are compared, since a clock can be set back.
    pub fn log_time(&self, message: &Event) -> u64 {
        let ((stamp_ns, tick), began) = (message.stamp(), self.file_began_stamp_ns);
        match tick.cmp(&self.file_began_tick) {
            Ordering::Less => began,
            Ordering::Equal => stamp_ns.max(began),
            Ordering::Greater => stamp_ns,
        }
    }

    /// Attaches the text of the scene to the file, once.
    ///
    /// # Errors
    /// A failed write.
    pub fn attach_scene(&mut self, text: Arc<str>) -> io::Result<()> {
        if self.scene.is_some() || text.is_empty() {
            return Ok(());
        }
        let attached =
            self.file.attach(SCENE_ATTACHMENT, "application/toml", self.file_began_stamp_ns, text.as_bytes());
        self.scene = Some(text);
        attached
    }

    /// Attaches the description of the run to the file, once.
    ///
    /// # Errors
    /// A failed write.
    pub fn attach(&mut self, name: &str) -> io::Result<()> {
        if std::mem::replace(&mut self.attached, true) {
            return Ok(());
        }
        let scene = self.status.as_ref().map(|status| status.scene.as_str().to_owned());
        let object = json!({
            "run_id": Exact(self.run_id), "name": name, "scene": scene, "stage": self.stage.as_deref().map(StageObject::from),
        });
        let time_ns = self.stage.as_ref().map_or(0, |stage| stage.stage.stamp_ns);
        self.file.attach(ATTACHMENT, "application/json", time_ns, object.to_string().as_bytes())
    }
}
