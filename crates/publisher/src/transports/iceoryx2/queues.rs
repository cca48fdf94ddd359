//! The memory that the queues of frames need, and a check that it is there. Called by the publisher before it opens a service.

use bench_dragon_client::shared_memory::{OpenError, free_bytes};
use bench_dragon_messages::{FrameHeader, HandlePose, HandlePose32, QUEUE_BYTES};

use super::PublisherConfig;

/// Frames a subscriber may fall behind, where the scene does not state it: at most 64 MB for all subscribers together.
pub(super) fn default_queue(config: &PublisherConfig) -> usize {
    (QUEUE_BYTES / frame_bytes(config) / config.subscribers).clamp(2, 64)
}

/// The bytes of a frame in all services of frames together.
fn frame_bytes(config: &PublisherConfig) -> usize {
    let whole = size_of::<FrameHeader>() + config.handles * size_of::<HandlePose>();
    let single = config.decimation().map(|it| size_of::<FrameHeader>() + it.poses() * size_of::<HandlePose32>());
    whole + single.unwrap_or(0)
}

/// Refuses queues that the shared memory has no room for.
pub(super) fn check_room(config: &PublisherConfig) -> Result<(), OpenError> {
    let PublisherConfig { queue, subscribers, .. } = *config;
    // Two frames that a subscriber may hold, two loans, the history, and a little for bookkeeping.
    let frames = subscribers * (queue + 2) + 4;
    let needed = (frames * frame_bytes(config)) as u64 + 2_000_000;
    match free_bytes() {
        Some(free) if free < needed => Err(OpenError::NoRoom { queue, subscribers, needed, free }),
        _ => Ok(()),
    }
}
