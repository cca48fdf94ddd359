//! visualization_msgs for RViz and Foxglove: the benches as cubes, the place of a contact, the place of the coming
//! event, and a sentence.

use serde::Serialize;

use super::path::poses;
use super::{HasStamp, Header, Pose, Time, Xyz, level_of};
use bench_dragon_messages::sentence::{Figures, alert_sentence, name_in, state_sentence};
use bench_dragon_messages::state::{FrameState, Severity};
use bench_dragon_messages::{CollisionAlert, FrameHeader, HandlePose, Stage, StageDragon, StageMessage};
use bench_dragon_motion::model::Point;
use bench_dragon_motion::model::board::Board;

/// builtin_interfaces/Duration.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Duration {
    /// The whole seconds.
    pub sec: i32,
    /// The nanoseconds of that second.
    pub nanosec: u32,
}

impl Duration {
    /// Converts seconds, not negative.
    fn of_seconds(seconds: f64) -> Self {
        let Time { sec, nanosec } = Time::of_seconds(seconds);
        Self { sec, nanosec }
    }
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
    /// `benches`, `contact`, `coming`, `sentence`, `numbers`, `obstacles`, `keep_out` or `obstacle_names`.
    pub ns: String,
    /// The number of the bench or of the obstacle, from 0; for `numbers` the index among them.
    pub id: i32,
    /// The shape.
    pub r#type: i32,
    /// Add or delete.
    pub action: i32,
    /// The pose.
    pub pose: Pose,
    /// The lengths along, across and up, in metres.
    pub scale: Xyz,
    /// The colour.
    pub color: Color,
    /// The time after which the marker disappears without a further message; zero, for never, in the first message.
    pub lifetime: Duration,
    /// False.
    pub frame_locked: bool,
    /// For `coming` the ends of the ring's dashes, for `obstacles` and `keep_out` the outline; otherwise empty.
    pub points: Vec<Xyz>,
    /// Empty.
    pub colors: Vec<Color>,
    /// Empty.
    pub texture_resource: String,
    /// Empty.
    pub texture: CompressedImage,
    /// Empty.
    pub uv_coordinates: Vec<UvCoordinate>,
    /// For `sentence`, `numbers` and `obstacle_names` the text; otherwise empty.
    pub text: String,
    /// Empty.
    pub mesh_resource: String,
    /// Empty.
    pub mesh_file: MeshFile,
    /// False.
    pub mesh_use_embedded_materials: bool,
}

/// Marker.CUBE, Marker.SPHERE, Marker.LINE_STRIP, Marker.LINE_LIST and Marker.TEXT_VIEW_FACING.
const CUBE: i32 = 1;
const SPHERE: i32 = 2;
const LINE_STRIP: i32 = 4;
const LINE_LIST: i32 = 5;
const TEXT: i32 = 9;
/// Marker.ADD and Marker.DELETE.
const ADD: i32 = 0;
const DELETE: i32 = 2;
/// The height of a bench in metres.
const BENCH_HEIGHT: f64 = 0.1;
/// The dashes of the ring around the coming event, and its radius in widths of a board.
const DASHES: usize = 16;
const RING_RADIUS: f64 = 2.5;
/// The lifetime of a marker: this number of periods, and at least this number of seconds.
const LIFETIME_PERIODS: f64 = 5.0;
const LEAST_LIFETIME: f64 = 1.0;
/// The width of the line of an obstacle's outline, in metres.
const OUTLINE_WIDTH: f64 = 0.08;
/// The height of an obstacle's name, in metres.
const NAME_HEIGHT: f64 = 0.5;
/// The most benches named at once: two of the event, and the two nearest.
const MOST_NAMED: usize = 4;

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

/// visualization_msgs/MarkerArray: a cube for each bench, a sphere at a contact, and a dashed ring at the coming event.
/// One text is the sentence of `run`, `watch` and the stage picture, and others are the names of the benches in it.
/// Each obstacle has its outline, its keep-out as a wide faint line about the outline, and its name.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MarkerArray {
    /// The benches from the head on, then `contact`, `coming`, `sentence`, the `numbers` and the ground.
    pub markers: Vec<Marker>,
    /// The deadline of the latest frame, in nanoseconds; 0 before the first.
    #[serde(skip)]
    latest_deadline_ns: u64,
}

impl MarkerArray {
    /// Creates the markers of a stage, without positions.
    pub fn of(message: &StageMessage) -> Self {
        let stage = &message.stage;
        let width = greatest_width(stage);
        let bench = |of: &StageDragon, bench: u32| {
            let [x, y] = of.board(bench);
            let number = (of.first_handle + bench) as i32;
            Marker { scale: Xyz { x, y, z: BENCH_HEIGHT }, ..Marker::new("benches", number, CUBE) }
        };
        let sign = |ns, shape, scale| Marker { scale, color: colour(Severity::Error), ..Marker::new(ns, 0, shape) };
        // Text has only a height.
        let words = |ns, id| Marker { scale: Xyz { x: 0.0, y: 0.0, z: width }, ..Marker::new(ns, id, TEXT) };
        let contact = sign("contact", SPHERE, Xyz { x: width, y: width, z: width });
        let coming =
            Marker { points: ring(width), ..sign("coming", LINE_LIST, Xyz { x: 0.3 * width, y: 0.0, z: 0.0 }) };
        let of_all = stage.dragons.iter().flat_map(|of| (0..of.benches).map(move |own| bench(of, own)));
        let mut markers: Vec<Marker> = of_all.collect();
        markers.extend([contact, coming, words("sentence", 0)]);
        markers.extend((0..MOST_NAMED as i32).map(|id| words("numbers", id)));
        markers.extend(ground(message));
        Self { markers, latest_deadline_ns: 0 }
    }

    /// Returns the lifetime of the markers of a frame, from the time since the frame before. RViz counts simulated time
    /// on `/clock` and else wall time, so the longer of both counts.
    fn lifetime(&mut self, frame: &FrameHeader) -> Duration {
        let before = std::mem::replace(&mut self.latest_deadline_ns, frame.deadline_ns);
        if before == 0 {
            return Duration::default();
        }
        let period = frame.deadline_ns.saturating_sub(before) as f64 * 1e-9;
        Duration::of_seconds((LIFETIME_PERIODS * period).max(LEAST_LIFETIME) * frame.time_scale.max(1.0))
    }

    /// Updates every marker for a frame. `alert` is the latest alert.
    pub fn update(
        &mut self,
        frame: &FrameHeader,
        handles: &[HandlePose],
        stage: &Stage,
        alert: Option<&CollisionAlert>,
    ) {
        let width = greatest_width(stage);
        let stamp = Time::of(frame.stamp_ns);
        let lifetime = self.lifetime(frame);
        for marker in &mut self.markers {
            (marker.lifetime, marker.header.stamp) = (lifetime, stamp);
        }
        let level = level_of(alert);
        let alert = alert.filter(|_| level.severity() > Severity::Ok);
        let named = alert.map_or_else(Vec::new, |alert| named(alert, level.has_happened()));
        let benches: usize = stage.dragons.iter().map(|of| of.benches as usize).sum();
        let split = benches.min(self.markers.len());
        let (benches, signs) = self.markers.split_at_mut(split);
        let numbers = stage.dragons.iter().flat_map(|of| (0..of.benches).map(move |own| (of, own)));
        for (marker, (of, own)) in benches.iter_mut().zip(numbers) {
            let number = of.first_handle + own;
            let Some([front, rear]) = handles.get(number as usize..).and_then(|rest| rest.first_chunk()) else { break };
            let points = [Point::new(front.x, front.y), Point::new(rear.x, rear.y)];
            let centre = Board::from_handles(points[0], points[1], of.hole_inset, of.width).centre;
            marker.header.stamp = stamp;
            marker.pose = Pose::flat(centre.x, centre.y, front.heading);
            marker.color = match (named.iter().find(|(one, _)| *one == number), own) {
                (Some((_, severity)), _) => colour(*severity),
                (None, 0) => Color { r: 0.85, g: 0.65, b: 0.13, a: 1.0 },
                _ => Color { r: 0.55, g: 0.35, b: 0.2, a: 1.0 },
            };
        }
        let [contact, coming, sentence, rest @ ..] = signs else { return };
        let numbers = &mut rest[..MOST_NAMED];
        let place = alert.filter(|alert| alert.event_x.is_finite()).map(|alert| (alert.event_x, alert.event_y));
        put(contact, stamp, place.filter(|_| level.has_happened()));
        put(coming, stamp, place.filter(|_| !level.has_happened()));
        sentence.text = words(frame, stage, alert).unwrap_or_default();
        // Above the ring; without one, above the head.
        let head = handles.first().map(|head| (head.x, head.y));
        let above = place.or(head).map(|(x, y)| (x, y + (RING_RADIUS + 2.0) * width));
        put(sentence, stamp, above.filter(|_| !sentence.text.is_empty()));
        for (k, marker) in numbers.iter_mut().enumerate() {
            let bench = named.get(k);
            marker.text = bench.map_or_else(String::new, |(bench, _)| name_in(stage, *bench));
            let of = |(bench, _): &(u32, Severity)| benches.iter().find(|marker| marker.id as u32 == *bench);
            let at = bench.and_then(of).map(|marker| &marker.pose.position);
            put(marker, stamp, at.map(|place| (place.x, place.y)));
        }
    }
}

impl HasStamp for MarkerArray {
    fn set_stamp(&mut self, stamp: Time) {
        self.markers.iter_mut().for_each(|marker| marker.header.stamp = stamp);
    }
}

/// Returns the width of the widest board, in metres: signs and words have its size.
fn greatest_width(stage: &Stage) -> f64 {
    stage.dragons.iter().flat_map(|dragon| [dragon.head_width, dragon.width, dragon.tail_width]).fold(0.0, f64::max)
}

/// Returns the markers of the obstacles: the outlines, the keep-outs and the names.
fn ground(message: &StageMessage) -> Vec<Marker> {
    let mut markers = Vec::new();
    for (id, obstacle) in (0..).zip(message.stage.obstacles.iter()) {
        let poses = poses(message.outline(obstacle));
        let points: Vec<Xyz> = poses.iter().map(|pose| pose.position).collect();
        let line = |ns, width, alpha| Marker {
            points: points.clone(),
            scale: Xyz { x: width, y: 0.0, z: 0.0 },
            color: Color { r: 0.5, g: 0.5, b: 0.5, a: alpha },
            ..Marker::new(ns, id, LINE_STRIP)
        };
        markers.push(line("obstacles", OUTLINE_WIDTH, 1.0));
        if obstacle.keep_out > 0.0 {
            markers.push(line("keep_out", 2.0 * obstacle.keep_out, 0.2));
        }
        let Some(first) = points.first() else { continue };
        let mut pose = Pose::flat(first.x, first.y, 0.0);
        pose.position.z = 2.0 * BENCH_HEIGHT;
        let scale = Xyz { x: 0.0, y: 0.0, z: NAME_HEIGHT };
        let text = obstacle.name.as_str().to_owned();
        markers.push(Marker { pose, scale, text, ..Marker::new("obstacle_names", id, TEXT) });
    }
    markers
}

/// Shows a marker at a place, or deletes it.
fn put(marker: &mut Marker, stamp: Time, place: Option<(f64, f64)>) {
    marker.header.stamp = stamp;
    marker.action = if place.is_some() { ADD } else { DELETE };
    if let Some((x, y)) = place {
        marker.pose = Pose::flat(x, y, 0.0);
        if marker.r#type == TEXT {
            // Text is above the boards.
            marker.pose.position.z = 2.0 * BENCH_HEIGHT;
        }
    }
}

/// Returns the benches of an alert with their severities: the benches of the event and, before the event, also the
/// nearest two.
fn named(alert: &CollisionAlert, happened: bool) -> Vec<(u32, Severity)> {
    let mut named: Vec<_> = alert.event_benches().map(|bench| (bench, Severity::Error)).collect();
    if !happened {
        for bench in alert.nearest_benches() {
            if named.iter().all(|(other, _)| *other != bench) {
                named.push((bench, Severity::Warning));
            }
        }
    }
    named
}

/// Returns the sentence about an alert at the time of a frame, or about a state without an alert.
fn words(frame: &FrameHeader, stage: &Stage, alert: Option<&CollisionAlert>) -> Option<String> {
    let state = FrameState::ALL.get(frame.state as usize).and_then(|state| state_sentence(*state, stage));
    let of = |alert: &CollisionAlert| {
        // Alerts come once a second, frames more often.
        let now = CollisionAlert { time_to_event: alert.event_time - frame.sim_time, ..*alert };
        alert_sentence(&now, stage, Figures::Shown { time_scale: frame.time_scale })
    };
    state.map(str::to_owned).or_else(|| alert.map(of))
}

/// Returns the ends of a ring's dashes, metres from its centre.
fn ring(width: f64) -> Vec<Xyz> {
    let at = |step: usize| {
        let (sin, cos) = (step as f64 * std::f64::consts::PI / DASHES as f64).sin_cos();
        Xyz { x: RING_RADIUS * width * cos, y: RING_RADIUS * width * sin, z: BENCH_HEIGHT }
    };
    (0..2 * DASHES).map(at).collect()
}

/// Returns the colour of a severity.
fn colour(severity: Severity) -> Color {
    match severity {
        Severity::Ok => Color { r: 0.2, g: 0.6, b: 0.3, a: 1.0 },
        Severity::Warning => Color { r: 1.0, g: 0.75, b: 0.0, a: 1.0 },
        Severity::Error => Color { r: 0.9, g: 0.1, b: 0.1, a: 1.0 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_messages::List;

    #[test]
    fn a_marker_lives_some_periods_and_at_least_a_second_of_either_clock() {
        let dragons = List::of([StageDragon { benches: 3, ..StageDragon::default() }]);
        let stage = Stage { dragons, ..Stage::default() };
        let mut markers = MarkerArray::of(&StageMessage { stage, segments: Vec::new() });
        let mut lifetime = |seconds: f64, time_scale: f64| {
            let frame = FrameHeader { deadline_ns: (seconds * 1e9) as u64, time_scale, ..FrameHeader::default() };
            markers.update(&frame, &[HandlePose::default(); 4], &stage, None);
            let [first, rest @ ..] = &markers.markers[..] else { panic!("no markers") };
            assert!(rest.iter().all(|marker| marker.lifetime == first.lifetime));
            f64::from(first.lifetime.sec) + f64::from(first.lifetime.nanosec) * 1e-9
        };
        // The period is unknown.
        assert_eq!(lifetime(100.0, 1.0), 0.0);
        assert_eq!(lifetime(100.125, 1.0), 1.0);
        assert_eq!(lifetime(100.25, 0.0), 1.0);
        assert_eq!(lifetime(100.375, 8.0), 8.0);
        assert_eq!(lifetime(102.375, 1.0), 10.0);
        assert_eq!(lifetime(102.5, 1e10), f64::from(i32::MAX));
    }
}
