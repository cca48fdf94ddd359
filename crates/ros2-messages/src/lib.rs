//! The ROS 2 messages on the wire, field for field as `msgs/` and the standard packages define them.
//!
//! A message of a header and one of the program's layouts nests the layout, because on the wire a nested struct is its
//! fields in order. The ROS 2 transport and the recorder share these messages, so that a recording has the same
//! messages as a ROS 2 subscriber.

pub mod diagnostics;
pub mod markers;
pub mod path;
pub mod settings;
pub mod transforms;
mod types;

use serde::{Deserialize, Serialize};

use bench_dragon_messages::state::Level;
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, StageMessage};
pub use types::{MessageType, fields};

/// The frame of all coordinates: metres, x to the right, y up, origin at the centre.
pub const FRAME_ID: &str = "stage";

/// builtin_interfaces/Time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
pub struct Time {
    /// The whole seconds since 1970, or the simulated seconds.
    pub sec: i32,
    /// The nanoseconds of that second.
    pub nanosec: u32,
}

impl Time {
    /// Converts a stamp in nanoseconds.
    pub fn of(stamp_ns: u64) -> Self {
        let (seconds, nanoseconds) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
        Self { sec: i32::try_from(seconds).unwrap_or(i32::MAX), nanosec: nanoseconds as u32 }
    }

    /// Converts simulated seconds, not negative, to the nearest nanosecond.
    pub fn of_seconds(seconds: f64) -> Self {
        let whole = seconds.floor();
        // The fraction is exact; rounding may complete the second.
        Self::of((whole as u64).saturating_mul(1_000_000_000).saturating_add(((seconds - whole) * 1e9).round() as u64))
    }
}

/// std_msgs/Header.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
pub struct Header {
    /// The time of the message.
    pub stamp: Time,
    /// The frame of its coordinates.
    pub frame_id: String,
}

impl Header {
    /// Creates the header of a message with the stamp `stamp_ns`.
    pub fn of(stamp_ns: u64) -> Self {
        Self { stamp: Time::of(stamp_ns), frame_id: FRAME_ID.to_owned() }
    }
}

/// bench_dragon_msgs/CollisionAlert, LoopStatus, Stage or Cue: a header and the layout's fields.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct Stamped<Layout> {
    /// The stamp of the layout.
    pub header: Header,
    /// The layout's fields.
    pub layout: Layout,
}

impl Stamped<CollisionAlert> {
    /// Creates the message of an alert.
    pub fn alert(alert: CollisionAlert) -> Self {
        Self { header: Header::of(alert.stamp_ns), layout: alert }
    }
}

impl Stamped<LoopStatus> {
    /// Creates the message of a status.
    pub fn status(status: LoopStatus) -> Self {
        Self { header: Header::of(status.stamp_ns), layout: status }
    }
}

impl Stamped<StageMessage> {
    /// Creates the message of a stage.
    pub fn stage(message: StageMessage) -> Self {
        Self { header: Header::of(message.stage.stamp_ns), layout: message }
    }
}

impl Stamped<Cue> {
    /// Creates the message of a cue.
    pub fn cue(cue: Cue) -> Self {
        Self { header: Header::of(cue.stamp_ns), layout: cue }
    }
}

/// A message whose headers have one stamp.
pub trait HasStamp: Sized {
    /// Sets the stamp of all headers.
    fn set_stamp(&mut self, stamp: Time);

    /// Returns the message with another stamp.
    fn at(mut self, stamp: Time) -> Self {
        self.set_stamp(stamp);
        self
    }
}

impl<Layout> HasStamp for Stamped<Layout> {
    fn set_stamp(&mut self, stamp: Time) {
        self.header.stamp = stamp;
    }
}

/// rosgraph_msgs/Clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Clock {
    /// Simulated time.
    pub clock: Time,
}

impl Clock {
    /// Returns the simulated time of a frame.
    pub fn of(frame: &FrameHeader) -> Self {
        Self { clock: Time::of_seconds(frame.sim_time) }
    }
}

/// bench_dragon_msgs/HandlePoses.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct HandlePoses {
    /// The frame's stamp.
    pub header: Header,
    /// The header of the frame.
    pub frame: FrameHeader,
    /// The handles, head first.
    pub poses: Vec<HandlePose>,
}

impl HandlePoses {
    /// Creates an empty message of `handles` handles.
    pub fn of(handles: usize) -> Self {
        Self { header: Header::of(0), frame: FrameHeader::default(), poses: vec![HandlePose::default(); handles] }
    }

    /// Fills the message of a frame.
    pub fn update(&mut self, frame: &FrameHeader, handles: &[HandlePose]) {
        self.header.stamp = Time::of(frame.stamp_ns);
        self.frame = *frame;
        self.poses.clear();
        self.poses.extend_from_slice(handles);
    }
}

impl HasStamp for HandlePoses {
    fn set_stamp(&mut self, stamp: Time) {
        self.header.stamp = stamp;
    }
}

/// geometry_msgs/Point and Vector3.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Xyz {
    /// The x coordinate, in metres.
    pub x: f64,
    /// The y coordinate, in metres.
    pub y: f64,
    /// The z coordinate, in metres.
    pub z: f64,
}

/// geometry_msgs/Quaternion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quaternion {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
    /// The real part.
    pub w: f64,
}

impl Quaternion {
    /// Returns a rotation about the vertical by `heading` radians: (0, 0, sin(heading / 2), cos(heading / 2)).
    pub fn of_heading(heading: f64) -> Self {
        let (sine, cosine) = (0.5 * heading).sin_cos();
        Self { x: 0.0, y: 0.0, z: sine, w: cosine }
    }
}

/// geometry_msgs/Pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pose {
    /// The position.
    pub position: Xyz,
    /// The direction.
    pub orientation: Quaternion,
}

impl Pose {
    fn flat(x: f64, y: f64, heading: f64) -> Self {
        Self { position: Xyz { x, y, z: 0.0 }, orientation: Quaternion::of_heading(heading) }
    }

    /// Returns a handle's pose.
    pub fn of(handle: &HandlePose) -> Self {
        // A pose has no velocity.
        let HandlePose { x, y, heading, vx: _, vy: _ } = *handle;
        Self::flat(x, y, heading)
    }
}

/// geometry_msgs/PoseArray.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseArray {
    /// The frame's stamp.
    pub header: Header,
    /// The handles, head first.
    pub poses: Vec<Pose>,
}

impl PoseArray {
    /// Creates an empty message of `handles` handles.
    pub fn of(handles: usize) -> Self {
        Self { header: Header::of(0), poses: vec![Pose::flat(0.0, 0.0, 0.0); handles] }
    }

    /// Fills the message of a frame.
    pub fn update(&mut self, frame: &FrameHeader, handles: &[HandlePose]) {
        self.header.stamp = Time::of(frame.stamp_ns);
        self.poses.clear();
        self.poses.extend(handles.iter().map(Pose::of));
    }
}

impl HasStamp for PoseArray {
    fn set_stamp(&mut self, stamp: Time) {
        self.header.stamp = stamp;
    }
}

/// Returns the level of the latest alert, `Clear` before the first.
fn level_of(alert: Option<&CollisionAlert>) -> Level {
    alert.and_then(CollisionAlert::alert_level).unwrap_or(Level::Clear)
}
