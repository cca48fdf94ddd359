//! The transports.
//!
//! In: a [`TransportConfig`]. Out: for each transport, a [`Publisher`] for the loop's thread and a [`StatusPublisher`]
//! for the statistics thread. Transports know messages, but no solver and not each other.

pub mod iceoryx2;

use crate::live::{Publisher, StatusPublisher, TransportCounters};
use bench_dragon_client::shared_memory::OpenError;
use bench_dragon_messages::StageMessage;
use bench_dragon_show::scene::{Scene, SinglePrecision};

/// The settings of a run for every transport.
#[derive(Debug, Clone, Copy)]
pub struct TransportConfig<'a> {
    /// The name under which services and topics appear.
    pub name: &'a str,
    /// Handles in a frame.
    pub handles: usize,
    /// True if there are alerts.
    pub alerts: bool,
    /// Cues of the show.
    pub cues: usize,
    /// The service of poses in single precision, if requested.
    pub single_precision: Option<SinglePrecision>,
    /// Frames a subscriber may fall behind; `None` to choose by their size.
    pub queue: Option<usize>,
    /// Subscribers that each iceoryx2 service admits at once.
    pub subscribers: usize,
    /// The text of the scene, whose hash is in the stage; empty if it is not known.
    pub scene: &'a str,
    /// The stage.
    pub stage: &'a StageMessage,
}

impl<'a> TransportConfig<'a> {
    /// Returns the settings of a scene, published under `name` without its text.
    pub fn of(name: &'a str, scene: &'a Scene, stage: &'a StageMessage) -> Self {
        Self {
            name,
            handles: scene.ensemble.handles(),
            alerts: scene.alerts.is_some(),
            cues: scene.cues.len(),
            single_precision: scene.single_precision,
            queue: scene.queue,
            subscribers: scene.subscribers,
            scene: "",
            stage,
        }
    }
}

/// The reason why a transport cannot be used: one sentence that names the change to make.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// The user's request cannot be fulfilled.
    #[error("{0}")]
    BadInput(String),
    /// The name is illegal for the transport.
    #[error("{0}")]
    IllegalName(String),
    /// Another publisher uses this name.
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
            | OpenError::OtherLayout { .. }
            | OpenError::OtherAttributes(_)
            | OpenError::OtherLimits(_) => Self::NameInUse(sentence),
            _ => Self::Failed(sentence),
        }
    }
}

/// A transport.
///
/// It is created before the loop's thread gets its priority, so that the transport's threads do not inherit it. The
/// threads that use its ends open them: ports of iceoryx2 stay on the thread that made them.
pub trait Transport: Send {
    /// Returns a description for people, in one line.
    fn describe(&self) -> String;

    /// Opens the end of the loop, on the loop's thread. Called once.
    ///
    /// # Errors
    /// [`TransportError`]
    fn publisher(&mut self) -> Result<Box<dyn Publisher>, TransportError>;

    /// Opens the end of the statistics, on the statistics thread, after [`publisher`](Self::publisher). Called once.
    /// Returns `None` if the transport does not publish the status.
    ///
    /// # Errors
    /// [`TransportError`]
    fn status(&mut self) -> Result<Option<Box<dyn StatusPublisher>>, TransportError> {
        Ok(None)
    }

    /// Shuts down after both ends are dropped. Returns its name and its counters, if it has a queue.
    fn finish(self: Box<Self>) -> Option<(&'static str, TransportCounters)>;
}
