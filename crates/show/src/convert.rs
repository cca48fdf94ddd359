//! Conversions from frames, chains, alerts and motions to the message layouts. Every type is destructured in full, so
//! that a new field cannot be lost.

use crate::alerts::Alert;
use crate::{Frame, Outcome, ReachedCue, Show};
use bench_dragon_messages::state::FrameState;
use bench_dragon_motion::clearance::PairClearance;
use bench_dragon_motion::ensemble::{Dragon, Ensemble};
use bench_dragon_motion::event::Event;
use bench_dragon_motion::ground::Obstacle;
use bench_dragon_motion::model::Point;
use bench_dragon_motion::model::elementary::atan2;
use bench_dragon_motion::model::segment::{OutlineKind, SegmentOutline};
use bench_dragon_motion::model::shape::{Shape, ShapeKind};
use bench_dragon_motion::model::spiral::Direction;
use bench_dragon_motion::model::team::Team;
use bench_dragon_motion::solve::Chain;
use bench_dragon_motion::timeline::TimedEvent;

use bench_dragon_messages::{
    CollisionAlert, ControlResponse, Cue, FrameHeader, HandlePose, HandlePose32, List, MOST_OBSTACLES, NO_BENCH,
    OBSTACLE_BOUNDARY, OBSTACLE_CIRCLE, OBSTACLE_LINE, OBSTACLE_POLYGON, SCENE_HASH_BYTES, SEGMENT_ARC,
    SEGMENT_INWARD_SPIRAL, SEGMENT_LINE, SEGMENT_OUTWARD_SPIRAL, SceneName, Stage, StageCue, StageDragon, StageEvent,
    StageMessage, StageObstacle, StageSegment,
};

#[cfg(test)]
mod tests;

/// A stage has room for the most obstacles of a scene and its boundary.
const _: () = assert!(crate::scene::stage::MOST_OBSTACLES < MOST_OBSTACLES);

/// The header fields that the loop sets. They do not follow from the frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamps {
    /// The run.
    pub run_id: u64,
    /// Frames published before this one.
    pub sequence: u64,
    /// CLOCK_REALTIME now, ns.
    pub stamp_ns: u64,
    /// CLOCK_MONOTONIC of the period's scheduled start, ns.
    pub deadline_ns: u64,
}

/// Returns the header of a frame. Its `sent_ns` is 0: a publisher sets the field just before sending.
pub fn frame_header(frame: &Frame, stamps: Stamps) -> FrameHeader {
    let Stamps { run_id, sequence, stamp_ns, deadline_ns } = stamps;
    let Frame {
        tick,
        sim_time,
        time_scale,
        state,
        playback,
        ref chain,
        min_clearance,
        epoch,
        cue,
        alerts: _,
        cues: _,
        commands: _,
        shows_played: _,
        unforeseen_contacts: _,
        unsolved_frames: _,
    } = *frame;
    FrameHeader {
        run_id,
        sequence,
        tick,
        stamp_ns,
        sent_ns: 0,
        deadline_ns,
        sim_time,
        time_scale,
        min_clearance,
        handles: chain.handles() as u32,
        state: state as u32,
        playback: playback as u32,
        cue,
        epoch,
        reserved: 0,
    }
}

/// Returns the pose of one handle of a chain.
///
/// # Panics
/// If the chain has no such handle.
pub fn handle_pose(chain: &Chain, handle: usize) -> HandlePose {
    let Chain { x, y, heading, speed: _, vx, vy } = chain;
    HandlePose { x: x[handle], y: y[handle], heading: heading[handle], vx: vx[handle], vy: vy[handle] }
}

/// Returns the poses of all handles of a chain, the head first. The iterator zips the arrays, which saves a bounds
/// check per handle: writing a frame takes a third to a sixth of the time.
pub fn handle_poses(chain: &Chain) -> impl ExactSizeIterator<Item = HandlePose> {
    let Chain { x, y, heading, speed: _, vx, vy } = chain;
    let places = x.iter().zip(y).zip(heading);
    places.zip(vx.iter().zip(vy)).map(|(((x, y), heading), (vx, vy))| HandlePose {
        x: *x,
        y: *y,
        heading: *heading,
        vx: *vx,
        vy: *vy,
    })
}

/// Returns a pose in single precision, each number rounded to nearest.
pub fn handle_pose_32(pose: HandlePose) -> HandlePose32 {
    let HandlePose { x, y, heading, vx, vy } = pose;
    HandlePose32 { x: x as f32, y: y as f32, heading: heading as f32, vx: vx as f32, vy: vy as f32 }
}

/// The choice of handles for a decimated frame: of each dragon the head, every `every`-th handle behind it, and always
/// the tail.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Decimation {
    every: usize,
    handles: Vec<usize>,
}

impl Decimation {
    /// Chooses from dragons with these numbers of handles, at least 2, in the order of the frame. `every` is
    /// at least 1.
    pub fn new(dragons: impl IntoIterator<Item = usize>, every: usize) -> Self {
        let (mut handles, mut first) = (Vec::new(), 0);
        for count in dragons {
            let tail = first + count - 1;
            handles.extend((first..tail).step_by(every).chain([tail]));
            first += count;
        }
        Self { every, handles }
    }

    /// Returns the stride in handles.
    pub fn every(&self) -> usize {
        self.every
    }

    /// Returns the handles of a decimated frame in order.
    pub fn handles(&self) -> &[usize] {
        &self.handles
    }
}

/// The header fields that alerts and cues repeat.
struct FrameStamp {
    run_id: u64,
    tick: u64,
    stamp_ns: u64,
    sim_time: f64,
}

impl From<&FrameHeader> for FrameStamp {
    fn from(header: &FrameHeader) -> Self {
        let FrameHeader {
            run_id,
            sequence: _,
            tick,
            stamp_ns,
            sent_ns: _,
            deadline_ns: _,
            sim_time,
            time_scale: _,
            min_clearance: _,
            handles: _,
            state: _,
            playback: _,
            cue: _,
            epoch: _,
            reserved: _,
        } = *header;
        Self { run_id, tick, stamp_ns, sim_time }
    }
}

/// Returns the message of an alert that goes with a frame.
pub fn collision_alert(header: &FrameHeader, alert: &Alert) -> CollisionAlert {
    let FrameStamp { run_id, tick, stamp_ns, sim_time } = header.into();
    let Alert { level, event, nearest } = *alert;
    let none = (f64::NAN, f64::NAN, f64::NAN, NO_BENCH, NO_BENCH);
    let (clearance, x, y, bench_a, bench_b) = nearest.map_or(none, |pair| {
        let PairClearance { value, bench_a, bench_b, point_a, point_b } = pair;
        let midpoint = nalgebra::center(&point_a, &point_b);
        (value, midpoint.x, midpoint.y, bench_a as u32, bench_b as u32)
    });
    let none = (f64::NAN, f64::NAN, 0, [NO_BENCH; 2], None);
    let (event_time, time_to_event, event, event_benches, place) = event.map_or(none, |timed| {
        let TimedEvent { event: Event { kind, travelled: _, bench_a, bench_b, place }, time } = timed;
        let benches = [bench_a, bench_b].map(|bench| bench.unwrap_or(NO_BENCH));
        (time, time - sim_time, FrameState::from(kind) as u32, benches, place)
    });
    let (event_x, event_y) = place.map_or((f64::NAN, f64::NAN), |place| (place.x, place.y));
    CollisionAlert {
        run_id,
        tick,
        stamp_ns,
        sim_time,
        event_time,
        time_to_event,
        clearance,
        x,
        y,
        event_x,
        event_y,
        level: level as u32,
        bench_a,
        bench_b,
        event,
        event_bench_a: event_benches[0],
        event_bench_b: event_benches[1],
    }
}

/// Returns the message of a cue that a frame has reached.
pub fn cue(header: &FrameHeader, reached: &ReachedCue) -> Cue {
    let FrameStamp { run_id, tick, stamp_ns, sim_time } = header.into();
    let StageCue { time: cue_time, number, pauses, name } = stage_cue(reached);
    Cue { run_id, tick, stamp_ns, sim_time, cue_time, number, pauses, name }
}

fn stage_cue(reached: &ReachedCue) -> StageCue {
    let ReachedCue { number, time, pauses, name } = reached;
    StageCue { time: *time, number: *number, pauses: u32::from(*pauses), name: SceneName::new(name) }
}

/// Returns the response to the request with this id.
pub fn control_response(id: u64, outcome: &Outcome) -> ControlResponse {
    let Outcome { code, tick, sim_time, time_scale, playing_rate: _, playback, cue } = *outcome;
    let (code, playback) = (code as u32, playback as u32);
    ControlResponse { id, tick, sim_time, time_scale, code, playback, cue, reserved: 0 }
}

/// Returns the stage of the dragons, with the events and cues of their show. `scene_hash` is BLAKE3 of the scene's text,
/// or zeros without a text.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::state::EventKind;
/// use bench_dragon_motion::event::unreported;
/// use bench_dragon_show::convert::stage;
/// use bench_dragon_show::scene::Scene;
/// use bench_dragon_show::{Playback, Show};
///
/// let scene = Scene::paper();
/// let show = Show::new(&scene, scene.ensemble.timeline(&mut unreported), Playback::of(&scene)).unwrap();
/// let message = stage(1, 0, [0; 32], &scene.ensemble, &show);
/// let stage = &message.stage;
/// assert_eq!((stage.dragons.len(), stage.first_dragon().benches), (1, 223));
/// assert_eq!(message.path(stage.first_dragon())[0].kind_name(), "inward_spiral");
/// assert_eq!(stage.events[0].kind(), Some(EventKind::Contact));
/// assert!((stage.freeze_time - 412.473_837_682).abs() < 1e-9);
/// ```
pub fn stage(
    run_id: u64,
    stamp_ns: u64,
    scene_hash: [u8; SCENE_HASH_BYTES],
    ensemble: &Ensemble,
    show: &Show,
) -> StageMessage {
    let (end, cues, events) = (show.freeze_time(), show.cues(), show.timeline().all());
    let message = stage_without_show(ensemble, end, cues, &events);
    StageMessage { stage: Stage { run_id, stamp_ns, scene_hash, ..message.stage }, ..message }
}

/// Returns the stage of dragons that are not in a show, of no run, with the events and cues that are known.
pub fn stage_without_show(
    ensemble: &Ensemble,
    freeze_time: f64,
    cues: &[ReachedCue],
    events: &[TimedEvent],
) -> StageMessage {
    let mut segments = Vec::new();
    let of = |(k, dragon): (usize, &Dragon)| stage_dragon(dragon, ensemble.handles_of(k).start as u32, &mut segments);
    let dragons: Vec<StageDragon> = ensemble.dragons().iter().enumerate().map(of).collect();
    let ground = ensemble.ground();
    let obstacles = ground.obstacles().iter().map(|obstacle| stage_obstacle(obstacle, &mut segments));
    let stage = Stage {
        run_id: 0,
        stamp_ns: 0,
        freeze_time,
        cues: cues.len() as u32,
        reserved: 0,
        scene_hash: [0; SCENE_HASH_BYTES],
        dragons: List::of(dragons),
        obstacles: List::of(obstacles),
        events: List::of(events.iter().map(stage_event)),
        cue_list: List::of(cues.iter().map(stage_cue)),
    };
    StageMessage { stage, segments }
}

/// Returns a dragon with the number of its first handle, and appends the segments of its path.
fn stage_dragon(
    Dragon { name, motion, .. }: &Dragon,
    first_handle: u32,
    segments: &mut Vec<StageSegment>,
) -> StageDragon {
    let Team { benches, head_length, body_length, width, hole_inset, ends } = *motion.team();
    let (mut pitch, mut start_turn) = (f64::NAN, f64::NAN);
    let first_segment = segments.len() as u32;
    // A route's team stands on a line.
    let on_spiral = motion.description().pitch().is_some();
    for outline in motion.outline() {
        match outline.kind {
            OutlineKind::Spiral { direction, pitch: metres, first, last: _, curvature: _ } => {
                if on_spiral && direction == Direction::Inward {
                    (pitch, start_turn) = (metres, first / std::f64::consts::TAU);
                } else if !on_spiral && pitch.is_nan() {
                    pitch = metres;
                }
            }
            OutlineKind::Line | OutlineKind::Arc { curvature: _ } => {}
        }
        segments.push(stage_segment(&outline));
    }
    StageDragon {
        head_length,
        body_length,
        tail_length: ends.tail_length.unwrap_or(body_length),
        head_width: ends.head_width.unwrap_or(width),
        width,
        tail_width: ends.tail_width.unwrap_or(width),
        hole_inset,
        pitch,
        start_turn,
        first_handle,
        benches: benches as u32,
        first_segment,
        segments: segments.len() as u32 - first_segment,
        name: SceneName::new(name),
    }
}

/// Returns an obstacle, and appends the segments of its outline.
fn stage_obstacle(obstacle: &Obstacle, segments: &mut Vec<StageSegment>) -> StageObstacle {
    let Obstacle { name, shape, keep_out } = obstacle;
    let kind = match shape.kind() {
        ShapeKind::Circle => OBSTACLE_CIRCLE,
        ShapeKind::Polygon => OBSTACLE_POLYGON,
        ShapeKind::Line => OBSTACLE_LINE,
        ShapeKind::Boundary => OBSTACLE_BOUNDARY,
    };
    let first_segment = segments.len() as u32;
    match shape.kind() {
        ShapeKind::Circle => segments.push(circle(shape)),
        _ => segments.extend(shape.sides().map(|(from, to)| side(from, to))),
    }
    let count = segments.len() as u32 - first_segment;
    StageObstacle { keep_out: *keep_out, kind, first_segment, segments: count, reserved: 0, name: SceneName::new(name) }
}

/// Returns the outline of a circle: an arc of a full turn, to the left, from its rightmost point.
fn circle(shape: &Shape) -> StageSegment {
    let (centre, radius) = (shape.points()[0], shape.radius());
    let (start, heading) = (Point::new(centre.x + radius, centre.y), std::f64::consts::FRAC_PI_2);
    let kind = OutlineKind::Arc { curvature: 1.0 / radius };
    stage_segment(&SegmentOutline { kind, start, heading, length: std::f64::consts::TAU * radius })
}

/// Returns a side of a shape.
fn side(from: Point, to: Point) -> StageSegment {
    let along = to - from;
    let (heading, length) = (atan2(along.y, along.x), along.norm());
    stage_segment(&SegmentOutline { kind: OutlineKind::Line, start: from, heading, length })
}

fn stage_event(timed: &TimedEvent) -> StageEvent {
    let TimedEvent { time, event: Event { kind, travelled: _, bench_a, bench_b, place: _ } } = *timed;
    let [bench_a, bench_b] = [bench_a, bench_b].map(|bench| bench.unwrap_or(NO_BENCH));
    StageEvent { time, state: FrameState::from(kind) as u32, bench_a, bench_b, reserved: 0 }
}

/// Returns the stage segment of a path segment.
fn stage_segment(outline: &SegmentOutline) -> StageSegment {
    let SegmentOutline { kind, start, heading, length } = *outline;
    let (kind, curvature, theta_first, theta_last, pitch) = match kind {
        OutlineKind::Line => (SEGMENT_LINE, 0.0, f64::NAN, f64::NAN, f64::NAN),
        OutlineKind::Arc { curvature } => (SEGMENT_ARC, curvature, f64::NAN, f64::NAN, f64::NAN),
        OutlineKind::Spiral { direction, pitch, first, last, curvature } => {
            let kind = match direction {
                Direction::Inward => SEGMENT_INWARD_SPIRAL,
                Direction::Outward => SEGMENT_OUTWARD_SPIRAL,
            };
            (kind, curvature, first, last, pitch)
        }
    };
    let (x, y) = (start.x, start.y);
    StageSegment { x, y, heading, length, curvature, theta_first, theta_last, pitch, kind, reserved: 0 }
}
