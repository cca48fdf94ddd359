//! The hash of frames: BLAKE3 over what is the same whenever the same show is played.
//!
//! A frame contributes the bytes of its message as subscribers get it: of [`FrameHeader`] `sequence` and `tick` (bytes 8
//! to 23) and all from `sim_time` on (bytes 48 to 95), then every [`HandlePose`]. What is left out is the run's: its
//! number and its stamps.

use crate::wire::{FrameHeader, HandlePose};

/// Eight bytes in five: a pose, or half of what a header contributes. The queue to the log's thread is made of them.
pub(super) type Slot = [u64; 5];

/// Slots that a header takes.
pub(super) const HEADER_SLOTS: usize = 2;

/// What a header contributes, in the order of its bytes, and room for two words more.
pub(super) fn header_slots(header: &FrameHeader, spare: [u64; 2]) -> [Slot; HEADER_SLOTS] {
    let FrameHeader { sequence, tick, sim_time, time_scale, min_clearance, .. } = *header;
    let FrameHeader { handles, state, playback, cue, epoch, reserved, .. } = *header;
    let pair = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
    [
        [spare[0], sequence, tick, sim_time.to_bits(), time_scale.to_bits()],
        [min_clearance.to_bits(), pair(handles, state), pair(playback, cue), pair(epoch, reserved), spare[1]],
    ]
}

/// What a pose contributes.
pub(super) fn pose_slot(pose: HandlePose) -> Slot {
    [pose.x, pose.y, pose.heading, pose.vx, pose.vy].map(f64::to_bits)
}

/// The hash of some frames.
#[derive(Default)]
pub(super) struct FrameHasher {
    hasher: blake3::Hasher,
    bytes: Vec<u8>,
}

impl FrameHasher {
    /// Adds a frame: its header's slots, then its poses, which may come in two parts.
    pub fn frame(&mut self, header: &[Slot; HEADER_SLOTS], poses: [&[Slot]; 2]) {
        self.bytes.clear();
        let [first, second] = header;
        let words = first[1..].iter().chain(&second[..4]).chain(poses.into_iter().flatten().flatten());
        self.bytes.extend(words.flat_map(|word| word.to_le_bytes()));
        self.hasher.update(&self.bytes);
    }

    /// The hash in hexadecimal digits, after which the next begins.
    pub fn take(&mut self) -> String {
        let hash = self.hasher.finalize().to_hex().to_string();
        self.hasher.reset();
        hash
    }
}
