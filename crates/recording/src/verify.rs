//! Compares the frames of a recording with its scene.
//!
//! In: a [`Recording`] and the [`Scene`] that it holds. Out: a [`RecordingVerdict`]. A second solver computes the
//! handles of each frame at the frame's own simulated time. Because a recording has no commands, only a log proves that
//! simulated time advanced as commanded.

use serde::Serialize;

use crate::mcap::ReadError;
use crate::mcap::reader::{Item, Recording, frame_of};
use bench_dragon_show::scene::Scene;
use bench_dragon_show::second_solver::SecondSolver;

/// The result of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordingVerdict {
    /// `close`: every pose within the tolerance. `differs`.
    pub verdict: &'static str,
    /// The frames compared, the different one included.
    pub frames: u64,
    /// The first difference.
    pub difference: Option<FrameDifference>,
    /// The greatest distance of a handle so far, in metres.
    pub max_difference: Option<f64>,
    /// The tolerance of that handle, in metres.
    pub tolerance: Option<f64>,
}

/// A frame with another pose than its scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameDifference {
    /// Its sequence.
    pub sequence: u64,
    /// Its tick.
    pub tick: u64,
    /// Its simulated seconds.
    pub sim_time: f64,
    /// The difference, in words.
    pub what: String,
}

/// Compares position and heading of every handle of every frame, up to the first difference. Velocities are not
/// compared. Calls `progress` with the number of chunks read.
///
/// # Errors
/// [`ReadError`] for a damaged recording.
pub fn compare(
    recording: &mut Recording,
    scene: &Scene,
    progress: &mut dyn FnMut(u64),
) -> Result<RecordingVerdict, ReadError> {
    let mut reference = SecondSolver::of(scene);
    let (mut frames, mut difference) = (0, None);
    for chunk in 0..recording.chunks() {
        let mut read = Vec::new();
        recording.read_chunk(chunk, &mut |item| {
            if let Item::Frame(bytes) = item {
                read.push(bytes);
            }
        })?;
        for bytes in read {
            let of = frame_of(&bytes)?;
            frames += 1;
            if let Err(error) = reference.compare_frame(of.frame.sim_time, &of.poses) {
                let what = error.to_string();
                let (sequence, tick, sim_time) = (of.frame.sequence, of.frame.tick, of.frame.sim_time);
                difference = Some(FrameDifference { sequence, tick, sim_time, what });
                break;
            }
        }
        progress(chunk as u64 + 1);
        if difference.is_some() {
            break;
        }
    }
    let verdict = if difference.is_some() { "differs" } else { "close" };
    let (max_difference, tolerance) = reference.worst().unzip();
    Ok(RecordingVerdict { verdict, frames, difference, max_difference, tolerance })
}
