//! From frames, chains, alerts and motions to the layouts, and from a layout's numbers back to states, levels and events.
//!
//! Each conversion stands here and nowhere else. Called by the loop and the transports, and by every subscriber that
//! wants more than a number.

use crate::alerts::Alert;
use crate::{Frame, Outcome, ReachedCue, Show};
use bench_dragon_messages::state::FrameState;
use bench_dragon_motion::Motion;
use bench_dragon_motion::model::path::{OutlineKind, SegmentOutline};
use bench_dragon_motion::model::spiral::Direction;
use bench_dragon_motion::solve::Chain;

use bench_dragon_messages::{
    CollisionAlert, ControlResponse, Cue, FrameHeader, HandlePose, HandlePose32, MOST_CUES, MOST_EVENTS, MOST_SEGMENTS,
    NO_BENCH, SCENE_HASH_BYTES, SEGMENT_ARC, SEGMENT_INWARD_SPIRAL, SEGMENT_LINE, SEGMENT_OUTWARD_SPIRAL, SceneName,
    Stage, StageCue, StageEvent, StageSegment,
};

/// A route of the most steps, and the line on which its team stands, fit into a stage.
const _: () = assert!(crate::scene::path::MOST_STEPS < MOST_SEGMENTS);

/// What of a header is not the frame's own but the run's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamps {
    /// The run.
    pub run_id: u64,
    /// Frames published before this one.
    pub sequence: u64,
    /// CLOCK_REALTIME now, ns.
    pub stamp_ns: u64,
    /// CLOCK_MONOTONIC at which the period should have begun, ns.
    pub deadline_ns: u64,
}

/// The header of a frame, complete but for `sent_ns`, which a publisher sets just before sending.
pub fn frame_header(frame: &Frame, stamps: Stamps) -> FrameHeader {
    let Stamps { run_id, sequence, stamp_ns, deadline_ns } = stamps;
    FrameHeader {
        run_id,
        sequence,
        tick: frame.tick,
        stamp_ns,
        sent_ns: 0,
        deadline_ns,
        sim_time: frame.sim_time,
        time_scale: frame.time_scale,
        min_clearance: frame.min_clearance,
        handles: frame.chain.handles() as u32,
        state: frame.state as u32,
        playback: frame.playback as u32,
        cue: frame.cue,
        epoch: frame.epoch,
        reserved: 0,
    }
}

/// One handle of a chain. Panics if there is no such handle.
pub fn handle_pose(chain: &Chain, handle: usize) -> HandlePose {
    HandlePose {
        x: chain.x[handle],
        y: chain.y[handle],
        heading: chain.heading[handle],
        vx: chain.vx[handle],
        vy: chain.vy[handle],
    }
}

/// All handles of a chain, the head first. Walking the arrays side by side leaves out the checks that asking for one handle
/// after the other costs: a frame is written in a third to a sixth of the time.
pub fn handle_poses(chain: &Chain) -> impl ExactSizeIterator<Item = HandlePose> {
    let places = chain.x.iter().zip(&chain.y).zip(&chain.heading);
    places.zip(chain.vx.iter().zip(&chain.vy)).map(|(((x, y), heading), (vx, vy))| HandlePose {
        x: *x,
        y: *y,
        heading: *heading,
        vx: *vx,
        vy: *vy,
    })
}

/// One handle in single precision, each number rounded to the nearest.
pub fn handle_pose_32(pose: HandlePose) -> HandlePose32 {
    let HandlePose { x, y, heading, vx, vy } = pose;
    HandlePose32 { x: x as f32, y: y as f32, heading: heading as f32, vx: vx as f32, vy: vy as f32 }
}

/// Which handles a decimated frame has: the head, each `every`-th handle from there on, and always the tail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decimation {
    /// Handles of the team, at least 2.
    pub handles: usize,
    /// One handle in how many, at least 1.
    pub every: usize,
}

impl Decimation {
    /// The number of handles in a decimated frame.
    pub fn poses(self) -> usize {
        (self.handles - 1).div_ceil(self.every) + 1
    }

    /// The handle at an index of a decimated frame.
    pub fn handle(self, index: usize) -> usize {
        (index * self.every).min(self.handles - 1)
    }
}

/// The message of an alert that goes with a frame.
pub fn collision_alert(header: &FrameHeader, alert: &Alert) -> CollisionAlert {
    let FrameHeader { run_id, tick, stamp_ns, sim_time, .. } = *header;
    let mut message =
        CollisionAlert { run_id, tick, stamp_ns, sim_time, level: alert.level as u32, ..Default::default() };
    if let Some(nearest) = alert.nearest {
        let midpoint = nalgebra::center(&nearest.point_a, &nearest.point_b);
        message.clearance = nearest.value;
        (message.x, message.y) = (midpoint.x, midpoint.y);
        (message.bench_a, message.bench_b) = (nearest.bench_a as u32, nearest.bench_b as u32);
    }
    if let Some(timed) = alert.event {
        message.event_time = timed.time;
        message.time_to_event = timed.time - sim_time;
        message.event = FrameState::from(timed.event.kind) as u32;
        message.event_bench_a = timed.event.bench_a.unwrap_or(NO_BENCH);
        message.event_bench_b = timed.event.bench_b.unwrap_or(NO_BENCH);
        if let Some(place) = timed.event.place {
            (message.event_x, message.event_y) = (place.x, place.y);
        }
    }
    message
}

/// The message of a cue that a frame has reached.
pub fn cue(header: &FrameHeader, reached: &ReachedCue) -> Cue {
    let FrameHeader { run_id, tick, stamp_ns, sim_time, .. } = *header;
    let ReachedCue { number, time, pauses, ref name } = *reached;
    let (pauses, name) = (u32::from(pauses), SceneName::new(name));
    Cue { run_id, tick, stamp_ns, sim_time, cue_time: time, number, pauses, name }
}

/// The response to a request with this id.
pub fn control_response(id: u64, outcome: &Outcome) -> ControlResponse {
    let Outcome { code, tick, sim_time, time_scale, playback, cue, .. } = *outcome;
    let (code, playback) = (code as u32, playback as u32);
    ControlResponse { id, tick, sim_time, time_scale, code, playback, cue, reserved: 0 }
}

/// The stage of a motion, and the time line of the show that plays it. `scene_hash` is BLAKE3 of the scene's text, zeros
/// where there is none.
pub fn stage(run_id: u64, stamp_ns: u64, scene_hash: [u8; SCENE_HASH_BYTES], motion: &Motion, show: &Show) -> Stage {
    let team = motion.team();
    let mut path = [StageSegment::default(); MOST_SEGMENTS];
    let (mut segments, mut pitch, mut start_turn) = (0, f64::NAN, f64::NAN);
    for (slot, outline) in path.iter_mut().zip(motion.outline()) {
        *slot = stage_segment(&outline);
        if let OutlineKind::Spiral { direction: Direction::Inward, pitch: metres, first, .. } = outline.kind {
            (pitch, start_turn) = (metres, first / std::f64::consts::TAU);
        }
        segments += 1;
    }
    let mut timeline = [StageEvent::default(); MOST_EVENTS];
    let events = show.timeline().events();
    for (slot, timed) in timeline.iter_mut().zip(events) {
        *slot = StageEvent { time: timed.time, state: FrameState::from(timed.event.kind) as u32, reserved: 0 };
    }
    let mut cue_list = [StageCue::default(); MOST_CUES];
    for (slot, cue) in cue_list.iter_mut().zip(show.cues()) {
        let ReachedCue { number, time, pauses, ref name } = *cue;
        *slot = StageCue { time, number, pauses: u32::from(pauses), name: SceneName::new(name) };
    }
    Stage {
        run_id,
        stamp_ns,
        pitch,
        start_turn,
        hole_inset: team.hole_inset,
        head_length: team.head_length,
        body_length: team.body_length,
        width: team.width,
        freeze_time: show.freeze_time(),
        benches: team.benches as u32,
        segments,
        events: events.len().min(MOST_EVENTS) as u32,
        cues: show.cues().len() as u32,
        scene_hash,
        path,
        timeline,
        cue_list,
    }
}

/// The segment of a stage.
pub fn stage_segment(outline: &SegmentOutline) -> StageSegment {
    let (kind, curvature, theta_first, theta_last) = match outline.kind {
        OutlineKind::Line => (SEGMENT_LINE, 0.0, f64::NAN, f64::NAN),
        OutlineKind::Arc { curvature } => (SEGMENT_ARC, curvature, f64::NAN, f64::NAN),
        OutlineKind::Spiral { direction: Direction::Inward, first, last, .. } => {
            (SEGMENT_INWARD_SPIRAL, f64::NAN, first, last)
        }
        OutlineKind::Spiral { direction: Direction::Outward, first, last, .. } => {
            (SEGMENT_OUTWARD_SPIRAL, f64::NAN, first, last)
        }
    };
    let SegmentOutline { start, heading, length, .. } = *outline;
    StageSegment { x: start.x, y: start.y, heading, length, curvature, theta_first, theta_last, kind, reserved: 0 }
}

#[cfg(test)]
mod tests {
    use bench_dragon_messages::state::{EventKind, Level};

    use super::*;
    use bench_dragon_motion::clearance::PairClearance;
    use bench_dragon_motion::event::Event;
    use bench_dragon_motion::model::Point;
    use bench_dragon_motion::timeline::TimedEvent;

    const NEAREST: PairClearance = PairClearance {
        value: 0.25,
        bench_a: 3,
        bench_b: 17,
        point_a: Point::new(1.0, 2.0),
        point_b: Point::new(2.0, 6.0),
    };

    #[test]
    fn a_decimated_frame_has_head_and_tail_and_each_handle_once() {
        for (handles, every, expected) in [
            (224, 100, vec![0, 100, 200, 223]),
            (224, 223, vec![0, 223]),
            (224, 222, vec![0, 222, 223]),
            (224, 1_000_000, vec![0, 223]),
            (15, 7, vec![0, 7, 14]),
            (2, 1, vec![0, 1]),
            (4, 1, vec![0, 1, 2, 3]),
        ] {
            let decimation = Decimation { handles, every };
            let found: Vec<_> = (0..decimation.poses()).map(|index| decimation.handle(index)).collect();
            assert_eq!(found, expected, "{decimation:?}");
        }
    }

    fn timed(kind: EventKind, bench_b: Option<u32>) -> TimedEvent {
        let event = Event { kind, travelled: 412.0, bench_a: Some(0), bench_b, place: Some(Point::new(-1.0, -2.0)) };
        TimedEvent { event, time: 412.5 }
    }

    #[test]
    fn an_alert_has_the_nearest_pair_and_the_event_each_in_its_place() {
        let header = FrameHeader { run_id: 7, tick: 9, stamp_ns: 11, sim_time: 402.5, ..Default::default() };
        let event = Some(timed(EventKind::Contact, Some(8)));
        let message = collision_alert(&header, &Alert { level: Level::Approaching, event, nearest: Some(NEAREST) });
        assert_eq!((message.run_id, message.tick, message.stamp_ns, message.sim_time), (7, 9, 11, 402.5));
        assert_eq!((message.level, message.event), (1, 2));
        assert_eq!((message.event_time, message.time_to_event), (412.5, 10.0));
        assert_eq!((message.bench_a, message.bench_b, message.clearance), (3, 17, 0.25));
        assert_eq!((message.x, message.y), (1.5, 4.0));
        assert_eq!((message.event_bench_a, message.event_bench_b), (0, 8));
        assert_eq!((message.event_x, message.event_y), (-1.0, -2.0));
    }

    #[test]
    fn a_stall_has_one_bench_and_nothing_at_all_has_none() {
        let header = FrameHeader { sim_time: 420.0, ..Default::default() };
        let stall = Some(timed(EventKind::Stall, None));
        let message = collision_alert(&header, &Alert { level: Level::Stall, event: stall, nearest: None });
        assert_eq!((message.level, message.event, message.event_bench_b), (3, 3, NO_BENCH));
        assert_eq!(message.event_benches().collect::<Vec<_>>(), [0]);
        assert!(message.clearance.is_nan() && message.x.is_nan() && message.y.is_nan());
        let message = collision_alert(&header, &Alert { level: Level::Clear, event: None, nearest: None });
        assert_eq!((message.event, message.bench_a, message.event_bench_a), (0, NO_BENCH, NO_BENCH));
        assert!(
            [message.event_time, message.time_to_event, message.event_x, message.event_y].iter().all(|n| n.is_nan())
        );
        assert_eq!(message.nearest_benches().chain(message.event_benches()).count(), 0);
    }
}
