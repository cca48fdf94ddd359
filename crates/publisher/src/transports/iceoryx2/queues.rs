//! The memory of the queues of frames, and the check for it.

use bench_dragon_client::shared_memory::{OpenError, free_bytes};
use bench_dragon_messages::{FrameHeader, HandlePose, HandlePose32, QUEUE_BYTES, Stage};

use super::{PublisherConfig, held_slice};

/// Returns the default number of frames that a subscriber may fall behind: 2 to 64. More than 2 frames take at most
/// 64 MB for all subscribers together.
pub(super) fn default_queue(config: &PublisherConfig) -> usize {
    (QUEUE_BYTES / frame_bytes(config) / config.subscribers).clamp(2, 64)
}

/// Returns the bytes of a frame in all services of frames together.
fn frame_bytes(config: &PublisherConfig) -> usize {
    let whole = size_of::<FrameHeader>() + config.handles * size_of::<HandlePose>();
    let single =
        config.decimation().map(|it| size_of::<FrameHeader>() + it.handles().len() * size_of::<HandlePose32>());
    whole + single.unwrap_or(0)
}

/// Returns the bytes of a stage.
fn stage_bytes(config: &PublisherConfig) -> usize {
    size_of::<Stage>() + size_of_val(&config.stage.segments[..])
}

/// Checks that the shared memory has room for the queues.
pub(super) fn check_room(config: &PublisherConfig) -> Result<(), OpenError> {
    let PublisherConfig { queue, subscribers, .. } = *config;
    // Two frames that a subscriber may hold, two loans, the history, and bookkeeping.
    let frames = subscribers * (queue + 2) + 4;
    let stages = (subscribers * (held_slice::QUEUE + 2) + 4) * stage_bytes(config);
    let needed = (frames * frame_bytes(config) + stages) as u64 + 2_000_000;
    match free_bytes() {
        Some(free) if free < needed => Err(OpenError::NoRoom { queue, subscribers, needed, free }),
        _ => Ok(()),
    }
}
