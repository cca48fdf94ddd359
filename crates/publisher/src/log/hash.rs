//! The hash of frames: BLAKE3 over the bytes that are equal whenever the same show is played.
//!
//! A frame contributes bytes of its message: of [`FrameHeader`] the fields `sequence` and `tick` (bytes 8 to 23) and
//! all from `sim_time` on (bytes 48 to 95), followed by every [`HandlePose`](bench_dragon_messages::HandlePose). The
//! run's number and its stamps are left out, because they differ between runs.

use bench_dragon_messages::FrameHeader;
use bench_dragon_motion::solve::Chain;

/// Words of eight bytes that a header contributes.
pub(super) const HEADER_WORDS: usize = 8;
/// Words of a handle.
pub(super) const HANDLE_WORDS: usize = 5;

/// Returns the contribution of a header, in the order of its bytes.
pub(super) fn header_words(header: &FrameHeader) -> [u64; HEADER_WORDS] {
    let FrameHeader {
        run_id: _,
        sequence,
        tick,
        stamp_ns: _,
        sent_ns: _,
        deadline_ns: _,
        sim_time,
        time_scale,
        min_clearance,
        handles,
        state,
        playback,
        cue,
        epoch,
        reserved,
    } = *header;
    let pair = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
    [
        sequence,
        tick,
        sim_time.to_bits(),
        time_scale.to_bits(),
        min_clearance.to_bits(),
        pair(handles, state),
        pair(playback, cue),
        pair(epoch, reserved),
    ]
}

/// Returns the arrays of a chain's poses, in the order of a pose's fields.
pub(super) fn columns(chain: &Chain) -> [&[f64]; HANDLE_WORDS] {
    let Chain { x, y, heading, speed: _, vx, vy } = chain;
    [x, y, heading, vx, vy]
}

/// Hashes frames.
#[derive(Default)]
pub(super) struct FrameHasher {
    hasher: blake3::Hasher,
    bytes: Vec<u8>,
}

impl FrameHasher {
    /// Adds a frame: its [`header_words`] and its [`columns`].
    pub fn frame(&mut self, header: &[u64; HEADER_WORDS], columns: [&[f64]; HANDLE_WORDS]) {
        self.bytes.clear();
        self.bytes.extend(header.iter().flat_map(|word| word.to_le_bytes()));
        let [x, y, heading, vx, vy] = columns;
        let poses = x.iter().zip(y).zip(heading).zip(vx.iter().zip(vy));
        for (((x, y), heading), (vx, vy)) in poses {
            [x, y, heading, vx, vy].iter().for_each(|number| self.bytes.extend(number.to_bits().to_le_bytes()));
        }
        self.hasher.update(&self.bytes);
    }

    /// Returns the hash in hexadecimal digits and starts the next.
    pub fn take(&mut self) -> String {
        let hash = self.hasher.finalize().to_hex().to_string();
        self.hasher.reset();
        hash
    }
}
