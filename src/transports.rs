//! Where frames go: publishers of the loop. They know messages and frames, never the solver, and not each other.

pub mod iceoryx2;
#[cfg(feature = "ros2")]
pub mod ros2;

use crate::chain::Team;
use crate::geometry::pieces::{Shape, ShapeKind};
use crate::geometry::spiral::Spiral;
use crate::messages::{
    CollisionAlert, FrameHeader, MOST_PIECES, NO_BENCH, PIECE_ARC, PIECE_INWARD_SPIRAL, PIECE_LINE,
    PIECE_OUTWARD_SPIRAL, Stage, StagePiece,
};
use crate::scene::path::ScenePath;
use crate::show::alerts::Alert;

/// The stage of a team on a scene's path.
pub fn stage(run_id: u64, stamp_ns: u64, team: &Team, scene_path: &ScenePath) -> Stage {
    let mut path = [StagePiece::default(); MOST_PIECES];
    let (mut pieces, mut pitch, mut start_turn) = (0, f64::NAN, f64::NAN);
    for (place, shape) in path.iter_mut().zip(scene_path.shapes()) {
        *place = stage_piece(&shape);
        if let ShapeKind::Inward { pitch: metres, first, .. } = shape.kind {
            pitch = metres;
            start_turn = scene_path.spiral().map_or(first / std::f64::consts::TAU, Spiral::start_turn);
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

fn stage_piece(shape: &Shape) -> StagePiece {
    let (kind, curvature, theta_first, theta_last) = match shape.kind {
        ShapeKind::Line => (PIECE_LINE, 0.0, f64::NAN, f64::NAN),
        ShapeKind::Arc { curvature } => (PIECE_ARC, curvature, f64::NAN, f64::NAN),
        ShapeKind::Inward { first, last, .. } => (PIECE_INWARD_SPIRAL, f64::NAN, first, last),
        ShapeKind::Outward { first, last, .. } => (PIECE_OUTWARD_SPIRAL, f64::NAN, first, last),
    };
    let Shape { start, heading, length, .. } = *shape;
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
