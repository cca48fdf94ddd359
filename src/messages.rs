//! What goes over the wire: the fixed memory layouts that publishers write and subscribers in any language read.
//!
//! This room depends on nothing else in the crate. Transports write these types, subscribers read them, and
//! `examples/python/bench_dragon_messages.py` and `msgs/` describe the same bytes for other languages. Everything is
//! little-endian, `#[repr(C)]` and without implicit padding. A type's name ends in the version of its layout, so that
//! a subscriber built for another layout is refused instead of reading nonsense.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Serialize, Serializer};

/// The bench number that means "no bench".
pub const NO_BENCH: u32 = u32::MAX;

/// What the dragon is doing: the `state` of a [`FrameHeader`] and, up to [`State::Lock`], the `level` of a
/// [`CollisionAlert`] (where 0 is called `clear`).
///
/// A state is the latest event passed and stays until the show ends or loops.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum State {
    /// Nothing has happened and nothing is near.
    Moving = 0,
    /// An event is near in time, or two boards are near each other.
    Approaching = 1,
    /// Two boards that share no handle have touched.
    Contact = 2,
    /// A link stands square to the path at its front handle: what follows is pushed backwards.
    Stall = 3,
    /// A link stands square to the path at its rear handle: the motion cannot go on.
    Lock = 4,
    /// The head has reached the end of the path.
    PathEnd = 5,
}

impl State {
    /// The state of a number on the wire, or `None` for a number this layout does not know.
    pub fn from_wire(number: u32) -> Option<Self> {
        [Self::Moving, Self::Approaching, Self::Contact, Self::Stall, Self::Lock, Self::PathEnd]
            .into_iter()
            .find(|state| *state as u32 == number)
    }

    /// The name used in JSON and on the terminal for a frame's state: `moving`, `approaching`, ...
    pub fn name(self) -> &'static str {
        match self {
            Self::Moving => "moving",
            Self::Approaching => "approaching",
            Self::Contact => "contact",
            Self::Stall => "stall",
            Self::Lock => "lock",
            Self::PathEnd => "path_end",
        }
    }

    /// The name used for an alert's level: as [`State::name`], but 0 is `clear`.
    pub fn level_name(self) -> &'static str {
        match self {
            Self::Moving => "clear",
            other => other.name(),
        }
    }
}

/// Where one handle is and how it moves. Payload of `<name>/poses` is a slice of these, head first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/HandlePose/1")]
#[repr(C)]
pub struct HandlePose {
    /// Metres to the right of the spiral's centre, frame `stage`.
    pub x: f64,
    /// Metres up from the spiral's centre, frame `stage`.
    pub y: f64,
    /// Radians in (-pi, pi]: the direction of the bench this handle leads (from handle i+1 to handle i); the last
    /// handle takes the last bench's.
    pub heading: f64,
    /// Velocity along x in simulation, metres per simulated second; NaN where the scene asks for no velocities.
    pub vx: f64,
    /// Velocity along y in simulation, metres per simulated second; NaN where the scene asks for no velocities.
    pub vy: f64,
}

/// What is true of a whole frame. User header of `<name>/poses`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/FrameHeader/1")]
#[repr(C)]
pub struct FrameHeader {
    /// New for every start of a publisher: a change means that it was started again.
    pub run_id: u64,
    /// Counts the frames published in this run from 0, without gaps: a gap means that frames were missed.
    pub sequence: u64,
    /// The number of the period; jumps over periods that were skipped.
    pub tick: u64,
    /// CLOCK_REALTIME in nanoseconds when the frame was begun: for people and for ROS.
    pub stamp_ns: u64,
    /// CLOCK_MONOTONIC in nanoseconds just before the frame was sent: for latencies.
    pub sent_ns: u64,
    /// CLOCK_MONOTONIC in nanoseconds at which this period should have begun: for lateness.
    pub deadline_ns: u64,
    /// Simulated seconds since the start of the scene.
    pub sim_time: f64,
    /// Simulated seconds per second of wall time.
    pub time_scale: f64,
    /// Metres between the nearest two boards that share no handle, negative when they overlap; NaN where the scene
    /// has no `[alerts]` or fewer than three benches.
    pub min_clearance: f64,
    /// The number of handles in the payload.
    pub handles: u32,
    /// A [`State`] as its number.
    pub state: u32,
}

/// A change of the alert level, or the countdown towards one. Payload of `<name>/alerts`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/CollisionAlert/1")]
#[repr(C)]
pub struct CollisionAlert {
    /// The run this alert belongs to, as in [`FrameHeader::run_id`].
    pub run_id: u64,
    /// The tick of the frame this alert goes with.
    pub tick: u64,
    /// CLOCK_REALTIME in nanoseconds of that frame.
    pub stamp_ns: u64,
    /// Simulated seconds of that frame.
    pub sim_time: f64,
    /// Simulated seconds at which the event happens or happened; NaN where there is none.
    pub event_time: f64,
    /// `event_time - sim_time`, simulated seconds; negative once it has passed; NaN where there is no event.
    pub time_to_event: f64,
    /// Metres between the nearest two boards in that frame, as [`FrameHeader::min_clearance`].
    pub clearance: f64,
    /// Where it happens, metres right of the centre; NaN where there is no place.
    pub x: f64,
    /// Where it happens, metres up from the centre; NaN where there is no place.
    pub y: f64,
    /// A [`State`] up to `Lock` as its number; 0 is called clear.
    pub level: u32,
    /// The first bench concerned, or [`NO_BENCH`].
    pub bench_a: u32,
    /// The second bench concerned, or [`NO_BENCH`].
    pub bench_b: u32,
    /// Always 0.
    pub reserved: u32,
}

/// Bytes kept for a scene's name in [`LoopStatus`].
pub const SCENE_NAME_BYTES: usize = 64;

/// How the loop is doing, once a second. Payload of `<name>/status`.
///
/// Layout 2 added the unforeseen contacts and the unsolved frames. `_second` figures are of the last second alone, `_total` figures since the start of the run; all durations are in
/// nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/LoopStatus/2")]
#[repr(C)]
pub struct LoopStatus {
    /// The run, as in [`FrameHeader::run_id`].
    pub run_id: u64,
    /// The tick of the latest frame.
    pub tick: u64,
    /// The sequence of the latest frame.
    pub sequence: u64,
    /// CLOCK_REALTIME in nanoseconds when this was written.
    pub stamp_ns: u64,
    /// Simulated seconds of the latest frame.
    pub sim_time: f64,
    /// The rate asked for, frames per second.
    pub rate: f64,
    /// Frames published in the last second, divided by its true length.
    pub measured_rate: f64,
    /// Incidents in which at least one period was skipped, since the start.
    pub overruns: u64,
    /// Periods skipped, since the start.
    pub skipped: u64,
    /// Times the show has been played to its end and begun again.
    pub shows_played: u64,
    /// Contacts that no search had found before the show, since the start: 0 unless a search is wrong or gave up.
    pub unforeseen_contacts: u64,
    /// Frames for whose time there was no solution, so that the one before was shown again, since the start.
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
    /// Subscribers of `<name>/poses` that are connected.
    pub subscribers: u32,
    /// Open file descriptors of the publisher.
    pub file_descriptors: u32,
    /// The scene's name as UTF-8, cut at a character's end and padded with zeros. In JSON and ROS 2 a plain string.
    #[serde(serialize_with = "as_text")]
    pub scene: [u8; SCENE_NAME_BYTES],
}

impl Default for LoopStatus {
    /// All zeros, and no name: arrays this long have no default of their own that could be derived from.
    fn default() -> Self {
        Self {
            run_id: 0,
            tick: 0,
            sequence: 0,
            stamp_ns: 0,
            sim_time: 0.0,
            rate: 0.0,
            measured_rate: 0.0,
            overruns: 0,
            skipped: 0,
            shows_played: 0,
            unforeseen_contacts: 0,
            unsolved_frames: 0,
            lateness_p50_second: 0,
            lateness_p99_second: 0,
            lateness_max_second: 0,
            lateness_p50_total: 0,
            lateness_p99_total: 0,
            lateness_p999_total: 0,
            lateness_max_total: 0,
            step_p50_second: 0,
            step_p99_second: 0,
            step_max_second: 0,
            step_p50_total: 0,
            step_p99_total: 0,
            step_p999_total: 0,
            step_max_total: 0,
            resident_bytes: 0,
            subscribers: 0,
            file_descriptors: 0,
            scene: [0; SCENE_NAME_BYTES],
        }
    }
}

impl LoopStatus {
    /// The scene's name.
    pub fn scene_name(&self) -> &str {
        text(&self.scene)
    }
}

/// What stands before the zeros.
fn text(bytes: &[u8; SCENE_NAME_BYTES]) -> &str {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(SCENE_NAME_BYTES);
    std::str::from_utf8(&bytes[..end]).unwrap_or_default()
}

fn as_text<S: Serializer>(bytes: &[u8; SCENE_NAME_BYTES], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(text(bytes))
}

/// The most pieces of a path that a [`Stage`] has room for.
pub const MOST_PIECES: usize = 32;

/// The `kind` of a [`StagePiece`]: straight on.
pub const PIECE_LINE: u32 = 0;
/// The `kind` of a [`StagePiece`]: part of a circle.
pub const PIECE_ARC: u32 = 1;
/// The `kind` of a [`StagePiece`]: inward along r = pitch theta / 2 pi.
pub const PIECE_INWARD_SPIRAL: u32 = 2;
/// The `kind` of a [`StagePiece`]: outward along that spiral, turned by half a turn about the centre.
pub const PIECE_OUTWARD_SPIRAL: u32 = 3;

/// One piece of the path in a [`Stage`].
#[derive(Debug, Clone, Copy, Default, PartialEq, ZeroCopySend, Serialize)]
#[type_name("bench_dragon/StagePiece/2")]
#[repr(C)]
pub struct StagePiece {
    /// Where it begins, metres right of the centre.
    pub x: f64,
    /// Where it begins, metres up from the centre.
    pub y: f64,
    /// Direction of travel there, radians counter-clockwise from x.
    pub heading: f64,
    /// Metres along it.
    pub length: f64,
    /// Of an arc, 1/m, positive where it turns left; of a line 0; of a spiral NaN.
    pub curvature: f64,
    /// Of a spiral, the polar angle at which it begins, radians (for an outward one: before it is turned); else NaN.
    pub theta_first: f64,
    /// Of a spiral, the polar angle at which it ends, radians; else NaN.
    pub theta_last: f64,
    /// [`PIECE_LINE`], [`PIECE_ARC`], [`PIECE_INWARD_SPIRAL`] or [`PIECE_OUTWARD_SPIRAL`].
    pub kind: u32,
    /// Always 0.
    pub reserved: u32,
}

impl StagePiece {
    /// The name of its kind: `line`, `arc`, `inward_spiral`, `outward_spiral`, or `unknown` for a later layout's.
    pub fn kind_name(&self) -> &'static str {
        match self.kind {
            PIECE_LINE => "line",
            PIECE_ARC => "arc",
            PIECE_INWARD_SPIRAL => "inward_spiral",
            PIECE_OUTWARD_SPIRAL => "outward_spiral",
            _ => "unknown",
        }
    }
}

/// What a subscriber needs to draw the stage. Payload of `<name>/stage`, sent at the start and kept for late joiners.
///
/// The head's board has a length of its own; all that follow have one length. Layout 2 added the pieces of the path;
/// the team may stand further back than the first piece begins, on the same spiral or line.
#[derive(Debug, Clone, Copy, Default, PartialEq, ZeroCopySend, Serialize)]
#[type_name("bench_dragon/Stage/2")]
#[repr(C)]
pub struct Stage {
    /// The run, as in [`FrameHeader::run_id`].
    pub run_id: u64,
    /// CLOCK_REALTIME in nanoseconds when this was written.
    pub stamp_ns: u64,
    /// Metres per turn of the spiral or spirals; NaN where the path has none.
    pub pitch: f64,
    /// The turn on which the head starts (theta = 2 pi start_turn); NaN where it does not start on a spiral.
    pub start_turn: f64,
    /// Metres from the centre of a handle's hole to the nearest end of the board.
    pub hole_inset: f64,
    /// Metres along the head's board.
    pub head_length: f64,
    /// Metres along every other board.
    pub body_length: f64,
    /// Metres across every board.
    pub width: f64,
    /// The number of benches; one less than the number of handles.
    pub benches: u32,
    /// The number of pieces in use, at most [`MOST_PIECES`].
    pub pieces: u32,
    /// The pieces of the path in the order of travel; those not in use are zero.
    pub path: [StagePiece; MOST_PIECES],
}

impl Stage {
    /// The pieces of the path that are in use.
    pub fn path_in_use(&self) -> &[StagePiece] {
        &self.path[..(self.pieces as usize).min(MOST_PIECES)]
    }
}
