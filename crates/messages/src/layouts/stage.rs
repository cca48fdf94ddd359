//! The layout of the stage: the dragons, their paths, the obstacles, the time line.

use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::SceneName;
use crate::List;

/// Straight on.
pub const SEGMENT_LINE: u32 = 0;
/// Part of a circle.
pub const SEGMENT_ARC: u32 = 1;
/// Inward along r = pitch theta / 2 pi.
pub const SEGMENT_INWARD_SPIRAL: u32 = 2;
/// Outward along that spiral, turned by half a turn about the centre.
pub const SEGMENT_OUTWARD_SPIRAL: u32 = 3;

/// One segment of a path, or of an obstacle's outline. A circle is an arc of a full turn; a polygon's last line ends
/// where the first begins.
///
/// Over iceoryx2 the payload of `<name>/stage` is a slice of these. Layout 6 added the pitch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/StageSegment/6")]
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
    /// The curvature of an arc, 1/m, positive if the arc turns left; 0 for a line. NaN for a spiral whose centre is the
    /// stage's origin and whose turns begin on the x axis. For a spiral that the scene places elsewhere, the curvature
    /// at its beginning: beginning, heading and the side of the curvature give its place.
    pub curvature: f64,
    /// The polar angle at the beginning of a spiral, radians; else NaN. For an outward spiral this is the angle before
    /// the spiral is turned, for a placed spiral the angle before the spiral is placed.
    pub theta_first: f64,
    /// The polar angle at the end of a spiral, radians; else NaN.
    pub theta_last: f64,
    /// Metres per turn of a spiral; else NaN.
    pub pitch: f64,
    /// The kind of curve: one of [`SEGMENT_*`](SEGMENT_LINE).
    pub kind: u32,
    /// Always 0.
    pub reserved: u32,
}

impl StageSegment {
    /// Returns the name of its kind: `line`, `arc`, `inward_spiral`, `outward_spiral`, or `unknown` for a kind of a
    /// later layout.
    pub fn kind_name(&self) -> &'static str {
        match self.kind {
            SEGMENT_LINE => "line",
            SEGMENT_ARC => "arc",
            SEGMENT_INWARD_SPIRAL => "inward_spiral",
            SEGMENT_OUTWARD_SPIRAL => "outward_spiral",
            _ => "unknown",
        }
    }

    /// Returns the radians by which the segment turns; for a spiral, the radians about its centre.
    pub fn turn(&self) -> f64 {
        match self.kind {
            SEGMENT_ARC => (self.curvature * self.length).abs(),
            SEGMENT_INWARD_SPIRAL | SEGMENT_OUTWARD_SPIRAL => (self.theta_last - self.theta_first).abs(),
            _ => 0.0,
        }
    }

    /// Returns the point, in metres, and the direction of travel, in radians, at a share of the length or of a spiral's
    /// polar angle. The share is from 0 to 1.
    pub fn pose_at(&self, share: f64) -> (f64, f64, f64) {
        let Self { x, y, heading, length, curvature, theta_first, theta_last, .. } = *self;
        match self.kind {
            SEGMENT_ARC => {
                let here = heading + share * curvature * length;
                let right = x + (here.sin() - heading.sin()) / curvature;
                (right, y - (here.cos() - heading.cos()) / curvature, here)
            }
            SEGMENT_INWARD_SPIRAL | SEGMENT_OUTWARD_SPIRAL => {
                let theta = theta_first + share * (theta_last - theta_first);
                if curvature.is_nan() { self.about_origin(theta) } else { self.placed(theta) }
            }
            _ => {
                let (sine, cosine) = heading.sin_cos();
                (x + share * length * cosine, y + share * length * sine, heading)
            }
        }
    }

    /// Returns the pose at a polar angle of its spiral about the origin.
    fn about_origin(&self, theta: f64) -> (f64, f64, f64) {
        let per_radian = self.pitch / std::f64::consts::TAU;
        let (sine, cosine) = theta.sin_cos();
        let radius = per_radian * theta;
        // Opposite to the derivative by theta: inward because theta decreases, outward because of the half turn.
        let (along_x, along_y) = (radius * sine - per_radian * cosine, -radius * cosine - per_radian * sine);
        let side = if self.kind == SEGMENT_INWARD_SPIRAL { 1.0 } else { -1.0 };
        (side * radius * cosine, side * radius * sine, along_y.atan2(along_x))
    }

    /// Returns the pose at a polar angle of a spiral that is placed elsewhere, from the pose on the spiral about the
    /// origin. Beginning and heading give the place of the spiral. Without a mirror an inward spiral bends to the
    /// right, an outward one to the left.
    fn placed(&self, theta: f64) -> (f64, f64, f64) {
        let (x, y, heading) = self.about_origin(theta);
        let (first_x, first_y, first_heading) = self.about_origin(self.theta_first);
        // This rounding keeps the bits of the poses that earlier versions published.
        let (half_sine, half_cosine) = (0.5 * first_heading).sin_cos();
        let first_heading = 2.0 * half_sine.atan2(half_cosine);
        let bend = if self.kind == SEGMENT_INWARD_SPIRAL { -1.0 } else { 1.0 };
        let side = bend * self.curvature.signum();
        let turned = self.heading - side * first_heading;
        let (sine, cosine) = turned.sin_cos();
        let (right, up) = (x - first_x, side * (y - first_y));
        let place = (self.x + cosine * right - sine * up, self.y + sine * right + cosine * up);
        (place.0, place.1, side * heading + turned)
    }
}

/// The most dragons of a show.
pub const MOST_DRAGONS: usize = 16;
/// The most obstacles of a show, the boundary included.
pub const MOST_OBSTACLES: usize = 65;
/// The most events that a [`Stage`] has room for: the first of each kind of each dragon and of each obstacle.
pub const MOST_EVENTS: usize = 160;
/// The most cues that a [`Stage`] has room for.
pub const MOST_CUES: usize = 32;

/// Bytes of the hash of a scene's text.
pub const SCENE_HASH_BYTES: usize = 32;

/// The header of a scene's text.
///
/// Over iceoryx2 the user header of `<name>/scene`, whose payload is the text (UTF-8, TOML) as a slice of bytes. Sent
/// at the start and kept for late subscribers. The text is empty if it is not known, as in the replay of a recording
/// without it.
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

/// A disc.
pub const OBSTACLE_CIRCLE: u32 = 0;
/// A polygon with its interior.
pub const OBSTACLE_POLYGON: u32 = 1;
/// An open line: a barrier.
pub const OBSTACLE_LINE: u32 = 2;
/// The boundary: boards stay inside.
pub const OBSTACLE_BOUNDARY: u32 = 3;

/// A dragon of the show in a [`Stage`].
///
/// The boards of the head, of the tail and of all benches between can differ in size. The tail is the last of two or
/// more benches. The team may stand further back than the first segment begins, on the same spiral or line. Layout 7
/// added the sizes of head and tail.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/StageDragon/7")]
#[repr(C)]
pub struct StageDragon {
    /// Metres along the head's board.
    pub head_length: f64,
    /// Metres along every board between head and tail.
    pub body_length: f64,
    /// Metres along the tail's board.
    pub tail_length: f64,
    /// Metres across the head's board.
    pub head_width: f64,
    /// Metres across every board between head and tail.
    pub width: f64,
    /// Metres across the tail's board.
    pub tail_width: f64,
    /// Metres from the centre of a handle's hole to the nearest end of the board.
    pub hole_inset: f64,
    /// Metres per turn of the spiral on which the head starts, or else of the first one; NaN if the path has none.
    pub pitch: f64,
    /// The turn on which the head starts (theta = 2 pi start_turn); NaN if it does not start on a spiral.
    pub start_turn: f64,
    /// The number of its first handle. Bench i joins handles i and i + 1, so this is the head's number too.
    pub first_handle: u32,
    /// The number of its benches; one less than the number of its handles.
    pub benches: u32,
    /// The index of the first segment of its path in the list of segments. The segments are in the order of travel.
    pub first_segment: u32,
    /// The number of segments of its path.
    pub segments: u32,
    /// Its name; empty if it is the only dragon of the show.
    pub name: SceneName,
}

/// An obstacle of the show in a [`Stage`], or its boundary.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/StageObstacle/6")]
#[repr(C)]
pub struct StageObstacle {
    /// Metres that every board has to stay away.
    pub keep_out: f64,
    /// The kind of shape: one of [`OBSTACLE_*`](OBSTACLE_CIRCLE).
    pub kind: u32,
    /// The index of the first segment of its outline in the list of segments.
    pub first_segment: u32,
    /// The number of segments of its outline.
    pub segments: u32,
    /// Always 0.
    pub reserved: u32,
    /// Its name.
    pub name: SceneName,
}

impl StageObstacle {
    /// Returns the name of its kind: `circle`, `polygon`, `line`, `boundary`, or `unknown` for a kind of a later
    /// layout.
    pub fn kind_name(&self) -> &'static str {
        match self.kind {
            OBSTACLE_CIRCLE => "circle",
            OBSTACLE_POLYGON => "polygon",
            OBSTACLE_LINE => "line",
            OBSTACLE_BOUNDARY => "boundary",
            _ => "unknown",
        }
    }
}

/// An event of the show in a [`Stage`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/StageEvent/6")]
#[repr(C)]
pub struct StageEvent {
    /// Simulated seconds at which it happens.
    pub time: f64,
    /// The event, as the state that it leads to: one of [`FrameState`](crate::state::FrameState).
    pub state: u32,
    /// The first bench of the event, from 0; 4294967295 if it has none.
    pub bench_a: u32,
    /// The second bench, or the number of an obstacle; 4294967295 if it has none.
    pub bench_b: u32,
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
/// The segments of all paths and outlines stand in one list: first those of the dragons, then those of the obstacles.
/// Handles are numbered through all dragons. In the bench fields of alerts and events the number of handles plus j is
/// the obstacle j, from 0.
///
/// Over iceoryx2 the user header of `<name>/stage`, whose payload is the list of segments. Layout 2 added the segments
/// of the path, layout 3 gave them their name. Layout 4 added the time line: the end of the show, the events and the
/// cues. Layout 5 added the hash of the scene's text. Layout 6 added the dragons, the obstacles and a path of any
/// length.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/Stage/7")]
#[repr(C)]
pub struct Stage {
    /// The run, as [`FrameHeader::run_id`](super::FrameHeader::run_id).
    pub run_id: u64,
    /// CLOCK_REALTIME in nanoseconds when this was written.
    pub stamp_ns: u64,
    /// Simulated seconds at which the show ends: a seek reaches no later time.
    pub freeze_time: f64,
    /// The number of cues in the show; the first 32 of them are listed.
    pub cues: u32,
    /// Always 0.
    pub reserved: u32,
    /// BLAKE3 of the scene's text, as `verify` prints it of a certificate: the proofs of that text hold for this show.
    /// All zero if it is not known.
    pub scene_hash: [u8; SCENE_HASH_BYTES],
    /// The dragons in the order of their handles.
    pub dragons: List<StageDragon, MOST_DRAGONS>,
    /// The obstacles in the order of the scene; the boundary, if there is one, stands last.
    pub obstacles: List<StageObstacle, MOST_OBSTACLES>,
    /// The events in order of time: the first of each kind of each dragon and of each obstacle. Events after the end of
    /// the show are not reached. A scene without `[alerts]` has its last event only.
    pub events: List<StageEvent, MOST_EVENTS>,
    /// The cues in order of time.
    pub cue_list: List<StageCue, MOST_CUES>,
}

impl Stage {
    /// Returns the hash of the scene's text in hexadecimal digits; `None` if it is not known.
    pub fn scene_hash_digits(&self) -> Option<String> {
        let is_known = self.scene_hash.iter().any(|byte| *byte != 0);
        is_known.then(|| hexadecimal(&self.scene_hash))
    }

    /// Returns the first dragon; a dragon without benches if none is listed.
    pub fn first_dragon(&self) -> &StageDragon {
        const NONE: &StageDragon = &StageDragon {
            head_length: 0.0,
            body_length: 0.0,
            tail_length: 0.0,
            head_width: 0.0,
            width: 0.0,
            tail_width: 0.0,
            hole_inset: 0.0,
            pitch: f64::NAN,
            start_turn: f64::NAN,
            first_handle: 0,
            benches: 0,
            first_segment: 0,
            segments: 0,
            name: SceneName::EMPTY,
        };
        self.dragons.first().unwrap_or(NONE)
    }
}
