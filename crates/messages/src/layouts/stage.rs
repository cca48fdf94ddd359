//! The layout of the stage: the team, the path, the time line.

use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::SceneName;

/// The most segments of a path that a [`Stage`] has room for.
pub const MOST_SEGMENTS: usize = 32;

/// Straight on.
pub const SEGMENT_LINE: u32 = 0;
/// Part of a circle.
pub const SEGMENT_ARC: u32 = 1;
/// Inward along r = pitch theta / 2 pi.
pub const SEGMENT_INWARD_SPIRAL: u32 = 2;
/// Outward along that spiral, turned by half a turn about the centre.
pub const SEGMENT_OUTWARD_SPIRAL: u32 = 3;

/// One segment of the path in a [`Stage`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/StageSegment/3")]
#[repr(C)]
pub struct StageSegment {
    /// Its beginning, metres right of the centre.
    pub x: f64,
    /// Its beginning, metres up from the centre.
    pub y: f64,
    /// Direction of travel at its beginning, radians counter-clockwise from x.
    pub heading: f64,
    /// Metres along it.
    pub length: f64,
    /// Of an arc, 1/m, positive if it turns left; of a line 0; of a spiral NaN, if its centre is the stage's origin and
    /// its turns begin on the x axis. Of a spiral that the scene places elsewhere, the curvature at its beginning:
    /// beginning, heading and the side of the curvature say where it lies.
    pub curvature: f64,
    /// Of a spiral, the polar angle at which it begins, radians (for an outward one: before it is turned; of a placed
    /// one: before it is placed); else NaN.
    pub theta_first: f64,
    /// Of a spiral, the polar angle at which it ends, radians; else NaN.
    pub theta_last: f64,
    /// The kind of curve: one of [`SEGMENT_*`](SEGMENT_LINE).
    pub kind: u32,
    /// Always 0.
    pub reserved: u32,
}

impl StageSegment {
    /// Returns the name of its kind: `line`, `arc`, `inward_spiral`, `outward_spiral`, or `unknown` for a later
    /// layout's.
    pub fn kind_name(&self) -> &'static str {
        match self.kind {
            SEGMENT_LINE => "line",
            SEGMENT_ARC => "arc",
            SEGMENT_INWARD_SPIRAL => "inward_spiral",
            SEGMENT_OUTWARD_SPIRAL => "outward_spiral",
            _ => "unknown",
        }
    }
}

/// The most events of a motion: the first of each kind.
pub const MOST_EVENTS: usize = 4;
/// The most cues that a [`Stage`] has room for.
pub const MOST_CUES: usize = 32;

/// Bytes of the hash of a scene's text.
pub const SCENE_HASH_BYTES: usize = 32;

/// The header of a scene's text.
///
/// Over iceoryx2 the user header of `<name>/scene`, whose payload is the text (UTF-8, TOML) as a slice of bytes. Sent at
/// the start and kept for late subscribers. The text is empty if it is not known, as in the replay of a recording without
/// it.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::SceneHeader;
///
/// assert_eq!(size_of::<SceneHeader>(), 40);
/// assert_eq!(SceneHeader::default().hash, [0; 32]);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/SceneHeader/1")]
#[repr(C)]
pub struct SceneHeader {
    /// The run, as [`FrameHeader::run_id`](super::FrameHeader::run_id).
    pub run_id: u64,
    /// BLAKE3 of the text of the show, as [`Stage::scene_hash`].
    pub hash: [u8; SCENE_HASH_BYTES],
}

/// Returns the digits of a hash as `b3sum` prints them.
pub fn hexadecimal(hash: &[u8]) -> String {
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// An event of the show in a [`Stage`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/StageEvent/4")]
#[repr(C)]
pub struct StageEvent {
    /// Simulated seconds at which it happens.
    pub time: f64,
    /// The event, as the state that it leads to: one of [`FrameState`](crate::state::FrameState).
    pub state: u32,
    /// Always 0.
    pub reserved: u32,
}

/// A cue of the show in a [`Stage`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/StageCue/4")]
#[repr(C)]
pub struct StageCue {
    /// Simulated seconds of the cue.
    pub time: f64,
    /// Its number, from 1 in the order of the cues' times.
    pub number: u32,
    /// 1 if the show waits there until the command `go`, else 0.
    pub pauses: u32,
    /// Its name.
    pub name: SceneName,
}

/// The geometry and the time line of a show, for drawing them. Sent at the start and kept for late joiners.
///
/// The head's board and the other boards can differ in length. The team may stand further back than the first segment
/// begins, on the same spiral or line.
///
/// Over iceoryx2 the payload of `<name>/stage`. Layout 2 added the segments of the path, layout 3 gave them their name,
/// layout 4 added the time line: the freeze time, the events and the cues, layout 5 the hash of the scene's text.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::state::EventKind;
/// use bench_dragon_show::scene::Scene;
/// use bench_dragon_show::{Playback, Show};
/// use bench_dragon_show::convert::stage;
///
/// let scene = Scene::paper();
/// let show = Show::new(&scene, scene.motion.timeline(&mut |_| ()), Playback::of(&scene)).unwrap();
/// let stage = stage(1, 0, [0; 32], &scene.motion, &show);
/// assert_eq!((stage.benches, stage.path_in_use()[0].kind_name()), (223, "inward_spiral"));
/// assert_eq!(stage.events_in_use()[0].kind(), Some(EventKind::Contact));
/// assert!((stage.freeze_time - 412.473_837_682).abs() < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/Stage/5")]
#[repr(C)]
pub struct Stage {
    /// The run, as [`FrameHeader::run_id`](super::FrameHeader::run_id).
    pub run_id: u64,
    /// CLOCK_REALTIME in nanoseconds when this was written.
    pub stamp_ns: u64,
    /// Metres per turn of the spiral or spirals; NaN if the path has none.
    pub pitch: f64,
    /// The turn on which the head starts (theta = 2 pi start_turn); NaN if it does not start on a spiral.
    pub start_turn: f64,
    /// Metres from the centre of a handle's hole to the nearest end of the board.
    pub hole_inset: f64,
    /// Metres along the head's board.
    pub head_length: f64,
    /// Metres along every other board.
    pub body_length: f64,
    /// Metres across every board.
    pub width: f64,
    /// Simulated seconds at which the show freezes: a seek reaches no later time.
    pub freeze_time: f64,
    /// The number of benches; one less than the number of handles.
    pub benches: u32,
    /// The number of segments in use, at most [`MOST_SEGMENTS`].
    pub segments: u32,
    /// The number of events in use, at most [`MOST_EVENTS`]; a scene without `[alerts]` has its last one only.
    pub events: u32,
    /// The number of cues in the show; the first [`MOST_CUES`] of them are listed.
    pub cues: u32,
    /// BLAKE3 of the scene's text, as `verify` prints it of a certificate: the proofs of that text hold for this show.
    /// All zero if it is not known.
    pub scene_hash: [u8; SCENE_HASH_BYTES],
    /// The segments of the path in the order of travel; those not in use are zero.
    pub path: [StageSegment; MOST_SEGMENTS],
    /// The events in order of time; those not in use are zero. Those after the freeze time are not reached.
    pub timeline: [StageEvent; MOST_EVENTS],
    /// The cues in order of time; those not in use are zero.
    pub cue_list: [StageCue; MOST_CUES],
}

impl Stage {
    /// Returns the segments of the path that are in use.
    pub fn path_in_use(&self) -> &[StageSegment] {
        &self.path[..(self.segments as usize).min(MOST_SEGMENTS)]
    }

    /// Returns the hash of the scene's text in hexadecimal digits; `None` if it is not known.
    pub fn scene_hash_digits(&self) -> Option<String> {
        let is_known = self.scene_hash.iter().any(|byte| *byte != 0);
        is_known.then(|| hexadecimal(&self.scene_hash))
    }

    /// Returns the events that are in use.
    pub fn events_in_use(&self) -> &[StageEvent] {
        &self.timeline[..(self.events as usize).min(MOST_EVENTS)]
    }

    /// Returns the cues that are listed.
    pub fn cues_in_use(&self) -> &[StageCue] {
        &self.cue_list[..(self.cues as usize).min(MOST_CUES)]
    }
}
