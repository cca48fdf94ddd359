//! The ROS 2 messages as they go on the wire: field for field what `msgs/` and the standard packages define.
//!
//! A message that is a header followed by one of the program's own layouts nests that layout: on the wire a nested
//! struct is its fields in order. Called by the ROS 2 transport only.

use serde::Serialize;

use crate::model::Point;
use crate::model::board::Board;
use crate::motion::event::EventKind;
use crate::show::state::{Level, Severity};
use crate::wire::{CollisionAlert, FrameHeader, HandlePose, LoopStatus, Stage};

/// The frame of all coordinates: metres, x to the right, y up, origin at the centre.
pub const FRAME_ID: &str = "stage";

/// Type names on the wire.
pub mod type_name {
    /// bench_dragon_msgs/HandlePoses.
    pub const HANDLE_POSES: &str = "bench_dragon_msgs::msg::dds_::HandlePoses_";
    /// bench_dragon_msgs/CollisionAlert.
    pub const COLLISION_ALERT: &str = "bench_dragon_msgs::msg::dds_::CollisionAlert_";
    /// bench_dragon_msgs/LoopStatus.
    pub const LOOP_STATUS: &str = "bench_dragon_msgs::msg::dds_::LoopStatus_";
    /// bench_dragon_msgs/Stage.
    pub const STAGE: &str = "bench_dragon_msgs::msg::dds_::Stage_";
    /// geometry_msgs/PoseArray.
    pub const POSE_ARRAY: &str = "geometry_msgs::msg::dds_::PoseArray_";
    /// visualization_msgs/MarkerArray.
    pub const MARKER_ARRAY: &str = "visualization_msgs::msg::dds_::MarkerArray_";
    /// diagnostic_msgs/DiagnosticArray.
    pub const DIAGNOSTIC_ARRAY: &str = "diagnostic_msgs::msg::dds_::DiagnosticArray_";
}

/// builtin_interfaces/Time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Time {
    /// Seconds since 1970.
    pub sec: i32,
    /// Nanoseconds of that second.
    pub nanosec: u32,
}

impl Time {
    /// The time of a stamp in nanoseconds.
    pub fn of(stamp_ns: u64) -> Self {
        let (seconds, nanoseconds) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
        Self { sec: i32::try_from(seconds).unwrap_or(i32::MAX), nanosec: nanoseconds as u32 }
    }
}

/// std_msgs/Header.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Header {
    /// When what follows was true.
    pub stamp: Time,
    /// The frame of its coordinates.
    pub frame_id: String,
}

impl Header {
    /// The header of what was true at `stamp_ns`.
    pub fn of(stamp_ns: u64) -> Self {
        Self { stamp: Time::of(stamp_ns), frame_id: FRAME_ID.to_owned() }
    }
}

/// bench_dragon_msgs/CollisionAlert, LoopStatus or Stage: a header and the layout's fields.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stamped<Layout> {
    /// The stamp of the layout.
    pub header: Header,
    /// The layout's fields.
    pub layout: Layout,
}

impl Stamped<CollisionAlert> {
    /// The message of an alert.
    pub fn alert(alert: CollisionAlert) -> Self {
        Self { header: Header::of(alert.stamp_ns), layout: alert }
    }
}

impl Stamped<LoopStatus> {
    /// The message of a status.
    pub fn status(status: LoopStatus) -> Self {
        Self { header: Header::of(status.stamp_ns), layout: status }
    }
}

impl Stamped<Stage> {
    /// The message of a stage.
    pub fn stage(stage: Stage) -> Self {
        Self { header: Header::of(stage.stamp_ns), layout: stage }
    }
}

/// bench_dragon_msgs/HandlePoses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HandlePoses {
    /// The frame's stamp.
    pub header: Header,
    /// What is true of the whole frame.
    pub frame: FrameHeader,
    /// The handles, head first.
    pub poses: Vec<HandlePose>,
}

/// geometry_msgs/Point and Vector3.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Xyz {
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Metres.
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
    /// A turn about the vertical by `heading` radians: (0, 0, sin(heading / 2), cos(heading / 2)).
    pub fn of_heading(heading: f64) -> Self {
        let (sine, cosine) = (0.5 * heading).sin_cos();
        Self { x: 0.0, y: 0.0, z: sine, w: cosine }
    }
}

/// geometry_msgs/Pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pose {
    /// Where it is.
    pub position: Xyz,
    /// Where it points.
    pub orientation: Quaternion,
}

impl Pose {
    fn flat(x: f64, y: f64, heading: f64) -> Self {
        Self { position: Xyz { x, y, z: 0.0 }, orientation: Quaternion::of_heading(heading) }
    }

    /// A handle's pose.
    pub fn of(handle: &HandlePose) -> Self {
        Self::flat(handle.x, handle.y, handle.heading)
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

/// builtin_interfaces/Duration.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Duration {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds.
    pub nanosec: u32,
}

/// std_msgs/ColorRGBA.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Color {
    /// Red, 0 to 1.
    pub r: f32,
    /// Green, 0 to 1.
    pub g: f32,
    /// Blue, 0 to 1.
    pub b: f32,
    /// Opacity, 0 to 1.
    pub a: f32,
}

/// sensor_msgs/CompressedImage, always empty here.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CompressedImage {
    /// Empty.
    pub header: Header,
    /// Empty.
    pub format: String,
    /// Empty.
    pub data: Vec<u8>,
}

/// visualization_msgs/UVCoordinate, never sent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UvCoordinate {
    /// Never sent.
    pub u: f32,
    /// Never sent.
    pub v: f32,
}

/// visualization_msgs/MeshFile, always empty here.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MeshFile {
    /// Empty.
    pub filename: String,
    /// Empty.
    pub data: Vec<u8>,
}

/// visualization_msgs/Marker.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Marker {
    /// The frame's stamp.
    pub header: Header,
    /// `benches` or `contact`.
    pub ns: String,
    /// The bench, from 0.
    pub id: i32,
    /// The shape.
    pub r#type: i32,
    /// Add or delete.
    pub action: i32,
    /// Where it is.
    pub pose: Pose,
    /// Metres along, across and up.
    pub scale: Xyz,
    /// Its colour.
    pub color: Color,
    /// Zero: until it is replaced.
    pub lifetime: Duration,
    /// False.
    pub frame_locked: bool,
    /// Empty.
    pub points: Vec<Xyz>,
    /// Empty.
    pub colors: Vec<Color>,
    /// Empty.
    pub texture_resource: String,
    /// Empty.
    pub texture: CompressedImage,
    /// Empty.
    pub uv_coordinates: Vec<UvCoordinate>,
    /// Empty.
    pub text: String,
    /// Empty.
    pub mesh_resource: String,
    /// Empty.
    pub mesh_file: MeshFile,
    /// False.
    pub mesh_use_embedded_materials: bool,
}

/// Marker.CUBE and Marker.SPHERE.
const CUBE: i32 = 1;
const SPHERE: i32 = 2;
/// Marker.ADD and Marker.DELETE.
const ADD: i32 = 0;
const DELETE: i32 = 2;
/// Metres up that a bench is drawn: the width of a hand above the board's own thickness.
const BENCH_HEIGHT: f64 = 0.1;

impl Marker {
    fn new(ns: &str, id: i32, shape: i32) -> Self {
        Self {
            header: Header::of(0),
            ns: ns.to_owned(),
            id,
            r#type: shape,
            action: ADD,
            pose: Pose::flat(0.0, 0.0, 0.0),
            scale: Xyz::default(),
            color: Color { r: 1.0, g: 1.0, b: 1.0, a: 1.0 },
            lifetime: Duration::default(),
            frame_locked: false,
            points: Vec::new(),
            colors: Vec::new(),
            texture_resource: String::new(),
            texture: CompressedImage {
                header: Header { stamp: Time::default(), frame_id: String::new() },
                format: String::new(),
                data: Vec::new(),
            },
            uv_coordinates: Vec::new(),
            text: String::new(),
            mesh_resource: String::new(),
            mesh_file: MeshFile { filename: String::new(), data: Vec::new() },
            mesh_use_embedded_materials: false,
        }
    }
}

/// visualization_msgs/MarkerArray: a cube for each bench, and a sphere where two benches touch.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MarkerArray {
    /// The benches from the head on, then the contact.
    pub markers: Vec<Marker>,
}

impl MarkerArray {
    /// The markers of a stage, not yet in any place.
    pub fn of(stage: &Stage) -> Self {
        let mut markers: Vec<Marker> =
            (0..stage.benches).map(|bench| Marker::new("benches", bench as i32, CUBE)).collect();
        for (bench, marker) in markers.iter_mut().enumerate() {
            let length = if bench == 0 { stage.head_length } else { stage.body_length };
            marker.scale = Xyz { x: length, y: stage.width, z: BENCH_HEIGHT };
        }
        let mut contact = Marker::new("contact", 0, SPHERE);
        contact.scale = Xyz { x: stage.width, y: stage.width, z: stage.width };
        contact.color = colour(Severity::Error);
        markers.push(contact);
        Self { markers }
    }

    /// Puts every marker where it is in a frame. `alert` is the latest alert.
    pub fn update(
        &mut self,
        frame: &FrameHeader,
        handles: &[HandlePose],
        stage: &Stage,
        alert: Option<&CollisionAlert>,
    ) {
        let stamp = Time::of(frame.stamp_ns);
        let level = level_of(alert);
        // Those that it has happened to, or else those nearest to each other.
        let marked: Vec<_> = match alert.filter(|_| level.severity() > Severity::Ok) {
            None => Vec::new(),
            Some(alert) if level.has_happened() => alert.event_benches().collect(),
            Some(alert) => alert.nearest_benches().collect(),
        };
        let benches = self.markers.len() - 1;
        for (bench, (marker, pair)) in self.markers[..benches].iter_mut().zip(handles.windows(2)).enumerate() {
            let points = [Point::new(pair[0].x, pair[0].y), Point::new(pair[1].x, pair[1].y)];
            let centre = Board::from_handles(points[0], points[1], stage.hole_inset, stage.width).centre;
            marker.header.stamp = stamp;
            marker.pose = Pose::flat(centre.x, centre.y, pair[0].heading);
            marker.color = match (marked.contains(&(bench as u32)), bench) {
                (true, _) => colour(level.severity()),
                (false, 0) => Color { r: 0.85, g: 0.65, b: 0.13, a: 1.0 },
                _ => Color { r: 0.55, g: 0.35, b: 0.2, a: 1.0 },
            };
        }
        let contact = &mut self.markers[benches];
        contact.header.stamp = stamp;
        let place = alert.filter(|alert| level.has_happened() && alert.event_x.is_finite());
        contact.action = if place.is_some() { ADD } else { DELETE };
        if let Some(alert) = place {
            contact.pose = Pose::flat(alert.event_x, alert.event_y, 0.0);
        }
    }
}

/// The level of the latest alert; clear before the first.
fn level_of(alert: Option<&CollisionAlert>) -> Level {
    alert.and_then(CollisionAlert::alert_level).unwrap_or(Level::Clear)
}

/// The colour of a severity.
fn colour(severity: Severity) -> Color {
    match severity {
        Severity::Ok => Color { r: 0.2, g: 0.6, b: 0.3, a: 1.0 },
        Severity::Warning => Color { r: 1.0, g: 0.75, b: 0.0, a: 1.0 },
        Severity::Error => Color { r: 0.9, g: 0.1, b: 0.1, a: 1.0 },
    }
}

/// diagnostic_msgs/KeyValue.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct KeyValue {
    /// What.
    pub key: String,
    /// How much.
    pub value: String,
}

/// diagnostic_msgs/DiagnosticStatus.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DiagnosticStatus {
    /// 0 OK, 1 WARN, 2 ERROR.
    pub level: u8,
    /// What is diagnosed.
    pub name: String,
    /// In a few words.
    pub message: String,
    /// The publisher's name.
    pub hardware_id: String,
    /// The figures.
    pub values: Vec<KeyValue>,
}

/// diagnostic_msgs/DiagnosticArray.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DiagnosticArray {
    /// When this was so.
    pub header: Header,
    /// The loop and the dragon.
    pub status: Vec<DiagnosticStatus>,
}

/// DiagnosticStatus.OK, WARN and ERROR.
const OK: u8 = 0;
const WARN: u8 = 1;
const ERROR: u8 = 2;

impl DiagnosticArray {
    /// The loop's health and the dragon's, of the last second. `skipped_since` is how many periods have been skipped
    /// since the last message, `discarded` how many messages no ROS 2 queue would take since the start.
    pub fn of(
        name: &str,
        status: &LoopStatus,
        alert: Option<&CollisionAlert>,
        skipped_since: u64,
        discarded: u64,
    ) -> Self {
        let value = |key: &str, value: String| KeyValue { key: key.to_owned(), value };
        let level = level_of(alert);
        let the_loop = DiagnosticStatus {
            level: if skipped_since > 0 { WARN } else { OK },
            name: format!("{name}: loop"),
            message: if skipped_since > 0 { format!("{skipped_since} periods skipped") } else { "on time".to_owned() },
            hardware_id: name.to_owned(),
            values: vec![
                value("rate", format!("{:.3}", status.measured_rate)),
                value("requested rate", status.rate.to_string()),
                value("overruns", status.overruns.to_string()),
                value("skipped periods", status.skipped.to_string()),
                value("wake-up lateness p99 (us)", format!("{:.1}", status.lateness_p99_second as f64 / 1e3)),
                value("step cost p99 (us)", format!("{:.1}", status.step_p99_second as f64 / 1e3)),
                value("messages discarded", discarded.to_string()),
            ],
        };
        let mut values = vec![
            value("level", level.name().to_owned()),
            value("sim_time (s)", format!("{:.3}", status.sim_time)),
            value("scene", status.scene.as_str().to_owned()),
        ];
        if let Some(alert) = alert {
            values.push(value("clearance (m)", format!("{:.4}", alert.clearance)));
            values.push(value("time to event (s)", format!("{:.3}", alert.event_time - status.sim_time)));
            values.push(value("nearest benches (from 0)", listed(alert.nearest_benches())));
            values.push(value("event", alert.event_kind().map_or("none", EventKind::name).to_owned()));
            values.push(value("event benches (from 0)", listed(alert.event_benches())));
        }
        let dragon = DiagnosticStatus {
            level: match level.severity() {
                Severity::Ok => OK,
                Severity::Warning => WARN,
                Severity::Error => ERROR,
            },
            name: format!("{name}: dragon"),
            message: level.name().to_owned(),
            hardware_id: name.to_owned(),
            values,
        };
        Self { header: Header::of(status.stamp_ns), status: vec![the_loop, dragon] }
    }
}

/// Benches in a row, or "none".
fn listed(benches: impl Iterator<Item = u32>) -> String {
    let names: Vec<_> = benches.map(|bench| bench.to_string()).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
