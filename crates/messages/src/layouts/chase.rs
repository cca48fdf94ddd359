//! The layout of the status of a chase.

use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use serde::{Deserialize, Serialize};

/// The status of the process that makes a show follow an outside time, five times a second. Payload of `<name>/chase`.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::chase::{ChaseSource, ChaseState};
/// use bench_dragon_messages::ChaseStatus;
/// use bench_dragon_messages::sentence::chase_sentence;
///
/// let status = ChaseStatus { source: 2, state: 2, frame_rate: 2, hours: 1, error: 0.0008, ..ChaseStatus::default() };
/// assert_eq!(status.chase_state(), Some(ChaseState::Locked));
/// assert_eq!(status.chase_source(), Some(ChaseSource::Ltc));
/// assert_eq!(chase_sentence(&status), "LTC 01:00:00:00 locked, 0.8 ms");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/ChaseStatus/1")]
#[repr(C)]
pub struct ChaseStatus {
    /// The run that is chased, as [`FrameHeader::run_id`](super::FrameHeader::run_id).
    pub run_id: u64,
    /// CLOCK_REALTIME in nanoseconds when this was written.
    pub stamp_ns: u64,
    /// Readings of the source so far: frames of timecode, or positions of the tracker.
    pub readings: u64,
    /// Messages from outside that were malformed, or of another sender or stream, so far.
    pub ignored: u64,
    /// Jumps of the source so far.
    pub jumps: u64,
    /// Published simulated time minus the time that the source requests, simulated seconds; NaN if either is not known.
    pub error: f64,
    /// Simulated seconds per second that the source requests; NaN if not known.
    pub rate: f64,
    /// Metres from the tracker to the path; NaN without a tracker.
    pub distance: f64,
    /// 0 ArtTimeCode, 1 MIDI timecode, 2 LTC, 3 PosiStageNet.
    pub source: u32,
    /// 0 silent, 1 locking, 2 locked, 3 freewheeling, 4 standing, 5 backward, 6 lost, 7 held, 8 paused, 9 sought, 10 ended.
    /// 7 to 9: the chase waits, because the show is held, or another client has paused it or sent it to another time.
    pub state: u32,
    /// The label of timecode now: hours. 0 without a label.
    pub hours: u32,
    /// The label: minutes.
    pub minutes: u32,
    /// The label: seconds.
    pub seconds: u32,
    /// The label: frames.
    pub frames: u32,
    /// The rate of the labels: 0 none, 1 24, 2 25, 3 29.97, 4 29.97 drop frame, 5 30, 6 23.976.
    pub frame_rate: u32,
    /// The number of the tracker; 0 without a tracker.
    pub tracker: u32,
}

impl Default for ChaseStatus {
    /// A silent source, with no numbers.
    fn default() -> Self {
        Self {
            run_id: 0,
            stamp_ns: 0,
            readings: 0,
            ignored: 0,
            jumps: 0,
            error: f64::NAN,
            rate: f64::NAN,
            distance: f64::NAN,
            source: 0,
            state: 0,
            hours: 0,
            minutes: 0,
            seconds: 0,
            frames: 0,
            frame_rate: 0,
            tracker: 0,
        }
    }
}
