//! A run while it is recorded: its open file, and what is known of it. Called by the [`recorder`](super::recorder).

use std::cmp::Ordering;
use std::io;

use serde_json::json;

use super::file::McapFile;
use bench_dragon_messages::json::{Exact, StageObject};
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, LoopStatus, Stage};

/// The name of the attachment.
const ATTACHMENT: &str = "bench_dragon.json";

/// A message that is not sent with every frame.
#[derive(Debug, Clone)]
pub(super) enum Event {
    Stage(Box<Stage>),
    Alert(CollisionAlert),
    Cue(Cue),
    Status(LoopStatus),
}

impl Event {
    /// The run that it belongs to.
    pub fn run_id(&self) -> u64 {
        match self {
            Self::Stage(stage) => stage.run_id,
            Self::Alert(alert) => alert.run_id,
            Self::Cue(cue) => cue.run_id,
            Self::Status(status) => status.run_id,
        }
    }

    /// Its time, and the tick of the frame that it goes with; a stage goes with the first of the run.
    fn stamp(&self) -> (u64, u64) {
        match self {
            Self::Stage(stage) => (stage.stamp_ns, 0),
            Self::Alert(alert) => (alert.stamp_ns, alert.tick),
            Self::Cue(cue) => (cue.stamp_ns, cue.tick),
            Self::Status(status) => (status.stamp_ns, status.tick),
        }
    }
}

/// A run, and the file that its frames go to.
pub(super) struct Run {
    pub run_id: u64,
    pub file: McapFile,
    /// The file's first frame: its tick, and the time at which it is logged.
    pub file_began_tick: u64,
    pub file_began_stamp_ns: u64,
    /// Of the file's first frame and of the run's latest.
    pub file_began_ns: u64,
    pub latest_deadline_ns: u64,
    pub attached: bool,
    /// What a subscriber that joins now would get besides frames.
    pub stage: Option<Box<Stage>>,
    pub alert: Option<CollisionAlert>,
    pub cue: Option<Cue>,
    pub status: Option<LoopStatus>,
    /// The latest status that the run's diagnostics are of, one without a skip before the first; `None` where it is not
    /// known what was before.
    pub diagnosed: Option<LoopStatus>,
    /// Messages so far of what is not sent with every frame.
    pub events: u32,
}

impl Run {
    /// A run of which nothing is known but a frame, the first of its file.
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
            alert: None,
            cue: None,
            status: None,
            diagnosed: (frame.sequence == 0).then(LoopStatus::default),
            events: 0,
        }
    }

    /// When a message is logged: at its own time, but not before the file's first frame where it goes with that or an
    /// earlier one. What a late subscriber got was true before, and would leave a gap. Ticks tell, since a clock can be set
    /// back.
    pub fn log_time(&self, message: &Event) -> u64 {
        let ((stamp_ns, tick), began) = (message.stamp(), self.file_began_stamp_ns);
        match tick.cmp(&self.file_began_tick) {
            Ordering::Less => began,
            Ordering::Equal => stamp_ns.max(began),
            Ordering::Greater => stamp_ns,
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
