//! Where frames go: publishers of the loop. They know messages and frames, never the solver, and not each other.

pub mod iceoryx2;
#[cfg(feature = "ros2")]
pub mod ros2;

use crate::messages::{
    CollisionAlert, FrameHeader, HandlePose, MOST_PIECES, NO_BENCH, PIECE_ARC, PIECE_INWARD_SPIRAL, PIECE_LINE,
    PIECE_OUTWARD_SPIRAL, Stage, StagePiece,
};
use crate::model::path::{OutlineKind, SegmentOutline};
use crate::model::spiral::Direction;
use crate::motion::Motion;
use crate::show::alerts::Alert;
use crate::solve::Chain;

/// One handle of a chain as it goes over the wire. Panics if there is no such handle.
pub fn handle_pose(chain: &Chain, handle: usize) -> HandlePose {
    HandlePose {
        x: chain.x[handle],
        y: chain.y[handle],
        heading: chain.heading[handle],
        vx: chain.vx[handle],
        vy: chain.vy[handle],
    }
}

/// The stage of a motion.
pub fn stage(run_id: u64, stamp_ns: u64, motion: &Motion) -> Stage {
    let team = motion.team();
    let mut path = [StagePiece::default(); MOST_PIECES];
    let (mut pieces, mut pitch, mut start_turn) = (0, f64::NAN, f64::NAN);
    for (place, outline) in path.iter_mut().zip(motion.outline()) {
        *place = stage_piece(&outline);
        if let OutlineKind::Spiral { direction: Direction::Inward, pitch: metres, first, .. } = outline.kind {
            (pitch, start_turn) = (metres, first / std::f64::consts::TAU);
        }
        pieces += 1;
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
        benches: team.benches as u32,
        pieces,
        path,
    }
}

fn stage_piece(outline: &SegmentOutline) -> StagePiece {
    let (kind, curvature, theta_first, theta_last) = match outline.kind {
        OutlineKind::Line => (PIECE_LINE, 0.0, f64::NAN, f64::NAN),
        OutlineKind::Arc { curvature } => (PIECE_ARC, curvature, f64::NAN, f64::NAN),
        OutlineKind::Spiral { direction: Direction::Inward, first, last, .. } => {
            (PIECE_INWARD_SPIRAL, f64::NAN, first, last)
        }
        OutlineKind::Spiral { direction: Direction::Outward, first, last, .. } => {
            (PIECE_OUTWARD_SPIRAL, f64::NAN, first, last)
        }
    };
    let SegmentOutline { start, heading, length, .. } = *outline;
    StagePiece { x: start.x, y: start.y, heading, length, curvature, theta_first, theta_last, kind, reserved: 0 }
}

/// The message of an alert that goes with a frame.
pub(crate) fn alert_message(header: &FrameHeader, alert: &Alert) -> CollisionAlert {
    CollisionAlert {
        run_id: header.run_id,
        tick: header.tick,
        stamp_ns: header.stamp_ns,
        sim_time: header.sim_time,
        event_time: alert.event_time,
        time_to_event: alert.time_to_event,
        clearance: alert.clearance,
        x: alert.x,
        y: alert.y,
        level: alert.level as u32,
        bench_a: alert.bench_a.unwrap_or(NO_BENCH),
        bench_b: alert.bench_b.unwrap_or(NO_BENCH),
        reserved: 0,
    }
}
