//! Where frames go: publishers of the loop. They know messages and frames, never the solver, and not each other.

pub mod iceoryx2;
#[cfg(feature = "ros2")]
pub mod ros2;

use crate::chain::Team;
use crate::messages::{CollisionAlert, FrameHeader, NO_BENCH, Stage};
use crate::show::alerts::Alert;

/// The stage of a team on a spiral.
pub fn stage(run_id: u64, stamp_ns: u64, team: &Team, pitch: f64, start_turn: f64) -> Stage {
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
        reserved: 0,
    }
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
