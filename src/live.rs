//! The live loop: wait for the deadline, compute the frame, hand it to the publishers, count.
//!
//! Knows [`Frame`](crate::show::Frame) and [`Publisher`]; knows no transport and no solver. The `run` command calls it.

use crate::messages::{FrameHeader, LoopStatus};
use crate::show::Frame;

/// Where frames go. Called on the real-time thread: an implementation must not allocate, lock, log or make a system
/// call besides its transport's own.
pub trait Publisher {
    /// Sends one frame with its alerts. `header` is complete but for `sent_ns`, which the publisher sets just before
    /// sending.
    ///
    /// # Errors
    /// A sentence for people where the transport failed in a way that ends the run; a slow or dead subscriber is no
    /// error.
    fn publish(&mut self, header: &FrameHeader, frame: &Frame) -> Result<(), PublishError>;

    /// Sends the status of the loop; called once a second.
    ///
    /// # Errors
    /// As [`Publisher::publish`].
    fn publish_status(&mut self, status: &LoopStatus) -> Result<(), PublishError>;
}

/// A transport failed in a way that ends the run.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct PublishError(pub String);
