//! The memory layouts that publishers write and subscribers in any language read.
//!
//! It depends only on serde and iceoryx2's [`ZeroCopySend`]. States, levels and kinds are plain numbers here: `convert`
//! of the crate `show` fills them in, and the accessors of this crate give them their types. Everything is
//! little-endian, `#[repr(C)]` and without implicit padding. A type's name ends in the version of its layout, so that a
//! subscriber built for another layout is refused instead of reading nonsense.
//!
//! `msgs/msg` and `packaging/python/bench_dragon/layouts.py` are generated from this file, doc comments included, by
//! `BENCH_DRAGON_WRITE=1 cargo test --test repository msgs::`. The comments are therefore for readers of all three
//! languages. Facts of iceoryx2 alone stand in a paragraph that begins with "Over iceoryx2", which `msgs/msg` leaves
//! out. A link to a constant or to an enum of [`state`](crate::state) gives the ROS 2 message those constants.

mod chase;
mod control;
mod stage;

use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub use chase::*;
pub use control::*;
pub use stage::*;

/// The bench number that means "no bench".
pub const NO_BENCH: u32 = u32::MAX;

/// The position and velocity of one handle.
///
/// Over iceoryx2 the payload of `<name>/poses` is a slice of these, the head first.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::HandlePose;
///
/// let head = HandlePose { x: 8.8, y: 0.0, heading: 1.58, vx: -0.01, vy: 1.0 };
/// assert_eq!(size_of::<HandlePose>(), 40);
/// let speed = head.vx.hypot(head.vy);
/// assert!((speed - 1.0).abs() < 1e-4, "{speed} m/s");
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/HandlePose/1")]
#[repr(C)]
pub struct HandlePose {
    /// Metres to the right of the centre, frame `stage`.
    pub x: f64,
    /// Metres up from the centre, frame `stage`.
    pub y: f64,
    /// Radians in (-pi, pi]: the direction of the bench this handle leads (from handle i+1 to handle i); the last
    /// handle takes the last bench's.
    pub heading: f64,
    /// Velocity along x in simulation, metres per simulated second; NaN if the scene requests no velocities.
    pub vx: f64,
    /// Velocity along y in simulation, metres per simulated second; NaN if the scene requests no velocities.
    pub vy: f64,
}

/// The position and velocity of one handle, in half the bytes: the numbers of [`HandlePose`], each rounded to the
/// nearest single-precision float. The error along each axis is at most 6e-8 of the distance from the centre (0.5 um at
/// 8 m, 0.06 mm at 1 km).
///
/// Over iceoryx2 the payload of `<name>/poses32` is a slice of these, the head first: one handle in `every`, and the
/// tail. A scene can request this service. The service's attribute `every` holds that number: the pose with the index
/// `i` is of the handle `i * every`, the last pose of the last handle. Several dragons follow one another, each with
/// its own head and tail.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/HandlePose32/1")]
#[repr(C)]
pub struct HandlePose32 {
    /// Metres to the right of the centre, frame `stage`.
    pub x: f32,
    /// Metres up from the centre, frame `stage`.
    pub y: f32,
    /// Radians from -pi to pi, both rounded: the direction of the bench this handle leads, as [`HandlePose::heading`].
    pub heading: f32,
    /// Velocity along x in simulation, metres per simulated second; NaN if the scene requests no velocities.
    pub vx: f32,
    /// Velocity along y in simulation, metres per simulated second; NaN if the scene requests no velocities.
    pub vy: f32,
}

/// The facts of a whole frame.
///
/// Over iceoryx2 the user header of `<name>/poses` and `<name>/poses32`.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::state::{FrameState, PlaybackState};
/// use bench_dragon_messages::FrameHeader;
///
/// let header = FrameHeader { state: 2, playback: 3, sent_ns: 5_000, ..FrameHeader::default() };
/// assert_eq!(header.frame_state(), Some(FrameState::Contact));
/// assert_eq!(header.playback_state(), Some(PlaybackState::Ended));
/// // A number that a later layout may have.
/// assert_eq!(FrameHeader { state: 99, ..header }.frame_state(), None);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/FrameHeader/2")]
#[repr(C)]
pub struct FrameHeader {
    /// New for every start of a publisher: a change means that it was started again.
    pub run_id: u64,
    /// Counts the frames published in this run from 0, without gaps: over iceoryx2 a gap means that frames were missed.
    /// A topic with a lower rate leaves some out.
    pub sequence: u64,
    /// The number of the period; jumps over periods that were skipped.
    pub tick: u64,
    /// CLOCK_REALTIME in nanoseconds when the frame was begun: for people and for ROS.
    pub stamp_ns: u64,
    /// CLOCK_MONOTONIC of the publisher's machine in nanoseconds just before the frame was sent: for latencies.
    pub sent_ns: u64,
    /// CLOCK_MONOTONIC of the publisher's machine in nanoseconds at which this period should have begun: for lateness.
    pub deadline_ns: u64,
    /// Simulated seconds since the start of the scene.
    pub sim_time: f64,
    /// Simulated seconds per second of wall time, as in force; 0 while paused or held, unchanged after the end of the
    /// show.
    pub time_scale: f64,
    /// Metres between the nearest two boards that share no handle, negative when they overlap. In a scene with
    /// obstacles it is the least clearance of boards and obstacles. NaN if the scene has no `[alerts]`, or fewer than
    /// three benches and no obstacles.
    pub min_clearance: f64,
    /// The number of handles in this message.
    pub handles: u32,
    /// The state of the dragon: one of [`FrameState`](crate::state::FrameState).
    pub state: u32,
    /// The playback state: one of [`PlaybackState`](crate::state::PlaybackState).
    pub playback: u32,
    /// The latest cue passed, counted from 1; 0 before the first cue.
    pub cue: u32,
    /// Grows by one at every jump of simulated time, such as the beginning of the next loop. No interpolation crosses a
    /// jump.
    pub epoch: u32,
    /// Always 0.
    pub reserved: u32,
}

/// A change of the alert level, or a step of the countdown towards an event.
///
/// `bench_a`, `bench_b`, `clearance`, `x` and `y` are the nearest two boards of the frame, or a nearer board and
/// obstacle, at every level. The fields that begin with `event` are the event that the alert is about. While the level
/// is clear or approaching, this is the next contact, obstacle, stall or lock, else the event that has happened. For an
/// obstacle, the field of the second bench has the number of the obstacle. This is the number of handles plus the
/// obstacle's place in the scene, the boundary last.
///
/// Over iceoryx2 the payload of `<name>/alerts`.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::state::EventKind;
/// use bench_dragon_messages::CollisionAlert;
///
/// let alert = CollisionAlert {
///     level: 1,
///     event: 2,
///     event_bench_a: 0,
///     event_bench_b: 8,
///     time_to_event: 5.5,
///     ..CollisionAlert::default()
/// };
/// assert_eq!(alert.event_kind(), Some(EventKind::Contact));
/// assert_eq!(alert.event_benches().collect::<Vec<_>>(), [0, 8]);
/// assert_eq!(alert.nearest_benches().count(), 0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/CollisionAlert/2")]
#[repr(C)]
pub struct CollisionAlert {
    /// The run this alert belongs to, as [`FrameHeader::run_id`].
    pub run_id: u64,
    /// The tick of the frame this alert goes with.
    pub tick: u64,
    /// CLOCK_REALTIME in nanoseconds of that frame.
    pub stamp_ns: u64,
    /// Simulated seconds of that frame.
    pub sim_time: f64,
    /// Simulated seconds at which the event happens or happened; NaN if there is no event.
    pub event_time: f64,
    /// `event_time - sim_time`, simulated seconds; negative once it has passed; NaN if there is no event.
    pub time_to_event: f64,
    /// Metres between the nearest two boards in that frame, or between a board and the keep-out of an obstacle.
    /// Negative when they overlap; NaN if there are neither.
    pub clearance: f64,
    /// The midpoint between the nearest two boards, metres right of the centre; NaN if there are fewer than three
    /// benches.
    pub x: f64,
    /// The midpoint between the nearest two boards, metres up from the centre; NaN if there are fewer than three
    /// benches.
    pub y: f64,
    /// The place of the event, metres right of the centre; NaN if there is no event. It is the touching point of a
    /// contact, or the point of a board nearest to an obstacle. For a bench that stalls or locks, it is the rear
    /// handle.
    pub event_x: f64,
    /// The place of the event, metres up from the centre; NaN if there is no event.
    pub event_y: f64,
    /// The severity of the alert: one of [`Level`](crate::state::Level).
    pub level: u32,
    /// The first of the nearest two benches, from 0, or [`NO_BENCH`].
    pub bench_a: u32,
    /// The second of the nearest two benches, or an obstacle's number, or [`NO_BENCH`].
    pub bench_b: u32,
    /// The kind of the event: one of [`EventKind`](crate::state::EventKind), with the number of the frame's state that
    /// it leads to; 0 if there is no event.
    pub event: u32,
    /// The bench that stalls, locks or reaches an obstacle, or the first of two that touch, or [`NO_BENCH`].
    pub event_bench_a: u32,
    /// The second of two benches that touch, or an obstacle's number, or [`NO_BENCH`].
    pub event_bench_b: u32,
}

impl Default for CollisionAlert {
    /// Clear, with no event, no benches and no numbers.
    fn default() -> Self {
        const NONE: f64 = f64::NAN;
        Self {
            run_id: 0,
            tick: 0,
            stamp_ns: 0,
            sim_time: 0.0,
            event_time: NONE,
            time_to_event: NONE,
            clearance: NONE,
            x: NONE,
            y: NONE,
            event_x: NONE,
            event_y: NONE,
            level: 0,
            bench_a: NO_BENCH,
            bench_b: NO_BENCH,
            event: 0,
            event_bench_a: NO_BENCH,
            event_bench_b: NO_BENCH,
        }
    }
}

/// Bytes kept for a name.
const SCENE_NAME_BYTES: usize = 64;

/// A name as UTF-8, cut at a character's end and padded with zeros. In JSON and ROS 2 a plain string.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::SceneName;
///
/// assert_eq!(SceneName::new("龙").as_str(), "龙");
/// // At most 64 bytes, and no half letters.
/// assert_eq!(SceneName::new(&"龙".repeat(30)).as_str().chars().count(), 21);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct SceneName([u8; SCENE_NAME_BYTES]);

impl SceneName {
    /// The greatest length of a name, bytes in UTF-8.
    pub const CAPACITY: usize = SCENE_NAME_BYTES;

    /// The name without a letter.
    pub(crate) const EMPTY: Self = Self([0; SCENE_NAME_BYTES]);

    /// Creates a name, cut to the bytes that there is room for.
    pub fn new(name: &str) -> Self {
        let mut bytes = [0; SCENE_NAME_BYTES];
        let end = (0..=name.len().min(SCENE_NAME_BYTES)).rev().find(|end| name.is_char_boundary(*end)).unwrap_or(0);
        bytes[..end].copy_from_slice(&name.as_bytes()[..end]);
        Self(bytes)
    }

    /// Returns the text before the zeros.
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|byte| *byte == 0).unwrap_or(SCENE_NAME_BYTES);
        std::str::from_utf8(&self.0[..end]).unwrap_or_default()
    }
}

impl Default for SceneName {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Serialize for SceneName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for SceneName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self::new(&String::deserialize(deserializer)?))
    }
}

/// The status of the loop, once a second.
///
/// Figures that end in `_second` are of the last second alone. Figures that end in `_total` are since the start of the
/// run. All durations are in nanoseconds.
///
/// Over iceoryx2 the payload of `<name>/status`. Layout 2 added the unforeseen contacts and the unsolved frames,
/// layout 3 the lost files.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::{LoopStatus, SceneName};
///
/// let status = LoopStatus { rate: 60.0, measured_rate: 59.9, scene: SceneName::new("paper"), ..LoopStatus::default() };
/// let keeps_up = status.measured_rate > 0.99 * status.rate && status.skipped == 0;
/// assert!(keeps_up, "{}", status.scene.as_str());
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/LoopStatus/3")]
#[repr(C)]
pub struct LoopStatus {
    /// The run, as [`FrameHeader::run_id`].
    pub run_id: u64,
    /// The tick of the latest frame.
    pub tick: u64,
    /// The sequence of the latest frame.
    pub sequence: u64,
    /// CLOCK_REALTIME in nanoseconds when this was written.
    pub stamp_ns: u64,
    /// Simulated seconds of the latest frame.
    pub sim_time: f64,
    /// The requested rate, frames per second.
    pub rate: f64,
    /// Frames published in the last second, divided by its true length.
    pub measured_rate: f64,
    /// Incidents in which at least one period was skipped, since the start.
    pub overruns: u64,
    /// Periods skipped, since the start.
    pub skipped: u64,
    /// Times the show has been played to its end and begun again.
    pub shows_played: u64,
    /// Contacts that no search had found before the show, since the start: 0 unless a search is wrong or stopped early.
    pub unforeseen_contacts: u64,
    /// Frames without a solution at their time, which repeated the frame before, since the start.
    pub unsolved_frames: u64,
    /// Wake-up lateness of the last second: median, ns.
    pub lateness_p50_second: u64,
    /// Wake-up lateness of the last second: 99th percentile, ns.
    pub lateness_p99_second: u64,
    /// Wake-up lateness of the last second: maximum, ns.
    pub lateness_max_second: u64,
    /// Wake-up lateness since the start: median, ns.
    pub lateness_p50_total: u64,
    /// Wake-up lateness since the start: 99th percentile, ns.
    pub lateness_p99_total: u64,
    /// Wake-up lateness since the start: 99.9th percentile, ns.
    pub lateness_p999_total: u64,
    /// Wake-up lateness since the start: maximum, ns.
    pub lateness_max_total: u64,
    /// Step cost of the last second: median, ns.
    pub step_p50_second: u64,
    /// Step cost of the last second: 99th percentile, ns.
    pub step_p99_second: u64,
    /// Step cost of the last second: maximum, ns.
    pub step_max_second: u64,
    /// Step cost since the start: median, ns.
    pub step_p50_total: u64,
    /// Step cost since the start: 99th percentile, ns.
    pub step_p99_total: u64,
    /// Step cost since the start: 99.9th percentile, ns.
    pub step_p999_total: u64,
    /// Step cost since the start: maximum, ns.
    pub step_max_total: u64,
    /// Resident memory of the publisher, bytes.
    pub resident_bytes: u64,
    /// Files of the publisher in shared memory that another program has removed; subscribers that come later do not find
    /// the show then.
    pub lost_files: u64,
    /// Subscribers of the frames that are connected over iceoryx2.
    pub subscribers: u32,
    /// Open file descriptors of the publisher.
    pub file_descriptors: u32,
    /// The scene's name.
    pub scene: SceneName,
}
