//! visualization_msgs: the benches as cubes for RViz and Foxglove.

use serde::Serialize;

use super::{Header, Pose, Time, Xyz, level_of};
use crate::model::Point;
use crate::model::board::Board;
use crate::show::state::Severity;
use crate::wire::{CollisionAlert, FrameHeader, HandlePose, Stage};

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

/// The colour of a severity.
fn colour(severity: Severity) -> Color {
    match severity {
        Severity::Ok => Color { r: 0.2, g: 0.6, b: 0.3, a: 1.0 },
        Severity::Warning => Color { r: 1.0, g: 0.75, b: 0.0, a: 1.0 },
        Severity::Error => Color { r: 0.9, g: 0.1, b: 0.1, a: 1.0 },
    }
}
