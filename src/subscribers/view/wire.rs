//! What a browser receives: binary frames and JSON for what changes seldom. Called by the server only.
//!
//! A frame, little-endian: byte 0 the layout's version (1), byte 1 the state, bytes 2 and 3 zero, 4 handles (u32),
//! 8 simulated time (f64), 16 time scale (f64), 24 sequence (u64), 32 clearance (f32), 36 zero (u32); then for each
//! handle x, y, heading, speed (f32 each, metres, radians, metres per simulated second without sign).

use serde_json::json;

use crate::messages::{CollisionAlert, FrameHeader, HandlePose, NO_BENCH, Stage, State};

const VERSION: u8 = 1;
const HEADER_BYTES: usize = 40;
const HANDLE_BYTES: usize = 16;

pub(super) fn frame(header: &FrameHeader, handles: &[HandlePose]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER_BYTES + HANDLE_BYTES * handles.len());
    bytes.extend([VERSION, header.state as u8, 0, 0]);
    bytes.extend((handles.len() as u32).to_le_bytes());
    bytes.extend(header.sim_time.to_le_bytes());
    bytes.extend(header.time_scale.to_le_bytes());
    bytes.extend(header.sequence.to_le_bytes());
    bytes.extend((header.min_clearance as f32).to_le_bytes());
    bytes.extend([0; 4]);
    for pose in handles {
        for number in [pose.x, pose.y, pose.heading, pose.vx.hypot(pose.vy)] {
            bytes.extend((number as f32).to_le_bytes());
        }
    }
    bytes
}

pub(super) fn stage(stage: &Stage) -> String {
    let Stage { pitch, start_turn, hole_inset, head_length, body_length, width, benches, .. } = *stage;
    json!({"type": "stage", "pitch": pitch, "start_turn": start_turn, "hole_inset": hole_inset,
        "head_length": head_length, "body_length": body_length, "width": width, "benches": benches})
    .to_string()
}

pub(super) fn alert(alert: &CollisionAlert) -> String {
    let bench = |bench: u32| (bench != NO_BENCH).then_some(bench);
    json!({"type": "alert", "level": State::from_wire(alert.level).unwrap_or(State::Moving).level_name(),
        "sim_time": alert.sim_time, "event_time": alert.event_time, "clearance": alert.clearance,
        "x": alert.x, "y": alert.y, "bench_a": bench(alert.bench_a), "bench_b": bench(alert.bench_b)})
    .to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_has_the_documented_layout() {
        let header = FrameHeader {
            sim_time: 405.5,
            time_scale: 2.0,
            sequence: 7,
            min_clearance: 0.25,
            state: 2,
            ..FrameHeader::default()
        };
        let pose = HandlePose { x: 8.8, y: -1.5, heading: 0.5, vx: 3.0, vy: -4.0 };
        let bytes = frame(&header, &[pose, pose]);
        assert_eq!(bytes.len(), 72);
        assert_eq!(bytes[..8], [1, 2, 0, 0, 2, 0, 0, 0]);
        assert_eq!(bytes[8..16], 405.5_f64.to_le_bytes());
        assert_eq!(bytes[32..36], 0.25_f32.to_le_bytes());
        assert_eq!(bytes[68..72], 5.0_f32.to_le_bytes());
    }
}
