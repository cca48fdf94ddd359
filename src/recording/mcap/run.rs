//! A run while it is recorded: its open file, and what is known of it. Called by the [`recorder`](super::recorder).

use std::io;

use serde_json::json;

use super::file::McapFile;
use crate::wire::json::{Exact, StageObject};
use crate::wire::{CollisionAlert, Cue, FrameHeader, LoopStatus, Stage};

/// The name of the attachment.
const ATTACHMENT: &str = "bench_dragon.json";

/// A message that is not sent with every frame.
#[derive(Debug, Clone)]
pub(super) enum Seldom {
    Stage(Box<Stage>),
    Alert(CollisionAlert),
    Cue(Cue),
    Status(LoopStatus),
}

impl Seldom {
    /// The run that it belongs to.
    pub fn run_id(&self) -> u64 {
        match self {
            Self::Stage(stage) => stage.run_id,
            Self::Alert(alert) => alert.run_id,
            Self::Cue(cue) => cue.run_id,
            Self::Status(status) => status.run_id,
        }
    }
}

/// A run, and the file that its frames go to.
pub(super) struct Run {
    pub run_id: u64,
    pub file: McapFile,
    /// Of the file's first frame and of the run's latest.
    pub file_began_ns: u64,
    pub latest_deadline_ns: u64,
    pub attached: bool,
    /// What a subscriber that joins now would get besides frames.
    pub stage: Option<Box<Stage>>,
    pub alert: Option<CollisionAlert>,
    pub cue: Option<Cue>,
    pub status: Option<LoopStatus>,
    /// The latest status that the run's diagnostics have judged, one without a skip before the first; `None` where it is not
    /// known what was before.
    pub diagnosed: Option<LoopStatus>,
    /// Messages so far of what is not sent with every frame.
    pub seldom: u32,
}

impl Run {
    /// A run of which nothing is known but a frame, the first of its file.
    pub fn new(file: McapFile, frame: &FrameHeader) -> Self {
        Self {
            run_id: frame.run_id,
            file,
            file_began_ns: frame.deadline_ns,
            latest_deadline_ns: frame.deadline_ns,
            attached: false,
            stage: None,
            alert: None,
            cue: None,
            status: None,
            diagnosed: (frame.sequence == 0).then(LoopStatus::default),
            seldom: 0,
        }
    }

    /// Attaches to the file what is known of the run and is no message, unless that has been done.
    ///
    /// # Errors
    /// What the disk says.
    pub fn attach(&mut self, name: &str) -> io::Result<()> {
        if std::mem::replace(&mut self.attached, true) {
            return Ok(());
        }
        let scene = self.status.as_ref().map(|status| status.scene.as_str().to_owned());
        let object = json!({
            "run_id": Exact(self.run_id), "name": name, "scene": scene, "stage": self.stage.as_deref().map(StageObject::from),
        });
        let time_ns = self.stage.as_ref().map_or(0, |stage| stage.stamp_ns);
        self.file.attach(ATTACHMENT, "application/json", time_ns, object.to_string().as_bytes())
    }
}
