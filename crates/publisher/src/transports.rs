//! The ways out of this process: one trait, a list, a folder each.
//!
//! In: what is to be offered, the loop's rate, the stage. Out: for each transport that is requested, a [`Publisher`] for the
//! loop's thread and a [`StatusPublisher`] for the statistics thread. Transports know frames and messages, no solver, and
//! not each other. [`background`] is for those that would keep the loop waiting. Called by the commands that publish.

pub mod background;
pub mod iceoryx2;

use crate::live::control::CommandSender;
use crate::live::{Publisher, StatusPublisher, TransportCounters};
use bench_dragon_client::shared_memory::OpenError;
use bench_dragon_messages::Stage;
use bench_dragon_ros2_messages::settings::Ros2Settings;
use bench_dragon_show::scene::{Scene, SinglePrecision};

/// What every transport is given about the run.
#[derive(Debug, Clone, Copy)]
pub struct TransportConfig<'a> {
    /// The name under which services and topics appear.
    pub name: &'a str,
    /// Handles in a frame.
    pub handles: usize,
    /// Whether there are alerts.
    pub alerts: bool,
    /// Cues of the show.
    pub cues: usize,
    /// The service of poses in single precision, where there is one.
    pub single_precision: Option<SinglePrecision>,
    /// Frames a subscriber may fall behind; `None` for as many as suit their size.
    pub queue: Option<usize>,
    /// Subscribers that each iceoryx2 service admits at once.
    pub subscribers: usize,
    /// The ROS 2 topics; `None` for none.
    pub ros2: Option<&'a Ros2Settings>,
    /// Frames per second of the loop.
    pub loop_rate: f64,
    /// The stage.
    pub stage: Stage,
}

impl<'a> TransportConfig<'a> {
    /// What a scene asks for, published under a name.
    pub fn of(name: &'a str, scene: &'a Scene, loop_rate: f64, stage: Stage) -> Self {
        Self {
            name,
            handles: scene.team().handles(),
            alerts: scene.alerts.is_some(),
            cues: scene.cues.len(),
            single_precision: scene.single_precision,
            queue: scene.queue,
            subscribers: scene.subscribers,
            ros2: scene.ros2.as_ref(),
            loop_rate,
            stage,
        }
    }
}

/// Why a transport cannot be used: one sentence, which names what to change.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// What the user asked for cannot be had.
    #[error("{0}")]
    BadInput(String),
    /// The transport cannot take such a name.
    #[error("{0}")]
    IllegalName(String),
    /// Others use this name.
    #[error("{0}")]
    NameInUse(String),
    /// Anything else.
    #[error("{0}")]
    Failed(String),
}

impl From<OpenError> for TransportError {
    fn from(error: OpenError) -> Self {
        let sentence = error.to_string();
        match error {
            OpenError::Name { .. } => Self::IllegalName(sentence),
            OpenError::AlreadyPublished(_)
            | OpenError::TooManyPublishers(_)
            | OpenError::Incomplete(_)
            | OpenError::Incompatible(_)
            | OpenError::OtherAttributes(_)
            | OpenError::OtherLimits(_) => Self::NameInUse(sentence),
            _ => Self::Failed(sentence),
        }
    }
}

/// A way out of this process.
///
/// It is made before the loop's thread has its priority, so that threads of its own do not inherit that. Its ends are
/// opened by the threads that use them: ports of iceoryx2, for one, stay on the thread that made them.
pub trait Transport: Send {
    /// What it offers, in one line for people.
    fn describe(&self) -> String;

    /// Opens the end of the loop, on the loop's thread. Called once.
    ///
    /// # Errors
    /// [`TransportError`]
    fn publisher(&mut self) -> Result<Box<dyn Publisher>, TransportError>;

    /// Opens the end of the statistics, on their thread, after [`publisher`](Self::publisher). Called once.
    ///
    /// # Errors
    /// [`TransportError`]
    fn status(&mut self) -> Result<Box<dyn StatusPublisher>, TransportError>;

    /// Opens a door for commands, on a thread of its own, where this transport has one; gives the door back where it has
    /// none. Called once, before the
    /// loop's thread is started.
    ///
    /// # Errors
    /// [`TransportError`]
    fn control(&mut self, door: CommandSender) -> Result<Option<CommandSender>, TransportError> {
        Ok(Some(door))
    }

    /// Takes leave once both ends are dropped: its name in the summary, and what it delivered, where it has a queue.
    fn finish(self: Box<Self>) -> Option<(&'static str, TransportCounters)>;
}

/// Makes a transport; `None` where the scene does not request it.
pub type Open = fn(&TransportConfig) -> Result<Option<Box<dyn Transport>>, TransportError>;

/// The transports that the scene requests.
///
/// # Errors
/// The first [`TransportError`]
pub fn open(config: &TransportConfig, transports: &[Open]) -> Result<Vec<Box<dyn Transport>>, TransportError> {
    transports.iter().filter_map(|open| open(config).transpose()).collect()
}
