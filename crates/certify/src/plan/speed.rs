//! The greatest speed of the head at which no handle is too fast.
//!
//! In: a scene, its events, a limit. Out: two speeds that enclose the greatest one, proved. See "Lemma 7" in
//! `docs/proofs.md`.

use std::io;

use super::PlanError;
use crate::clearance::Write;
use crate::speed::{GreatestRatio, certify_greatest_ratio, greatest_ratio};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::Motion;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_show::scene::Scene;

/// The greatest speed of the head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GreatestSpeed {
    /// The lower bound, in metres per second: with the head no faster than this, no handle exceeds the limit. 0 if
    /// nothing is proved.
    pub value_lo: f64,
    /// The upper bound, in metres per second: with the head any faster, the handle exceeds the limit.
    pub value_hi: f64,
    /// Simulated seconds of the scene, at its own speed, at which the handle has the speed `ratio`.
    pub time: f64,
    /// The fastest handle, counted from 0. Another handle may be faster only within the gap between the two speeds.
    pub handle: u32,
    /// Ratio of its speed to the head's at that time.
    pub ratio: f64,
    /// True if the two speeds are within the tolerance. Otherwise the search was given up.
    pub proved: bool,
    /// The number of steps of the head that were enclosed.
    pub steps: u64,
}

/// The greatest distance of the two speeds, in metres per second. For limits above [`LARGE`] it grows as the limit over
/// [`LARGE`].
const TOLERANCE: f64 = 1e-9;

/// The limit from which on the tolerance grows, in metres per second.
const LARGE: f64 = 4.0;

/// Encloses the greatest constant speed of the head at which no handle exceeds `limit` metres per second, from the
/// scene's start until its show ends. `progress` receives the share of the work that is done, from 0 to 1.
///
/// The ratio of a handle's speed to the head's depends only on the head's place. Branch and bound with intervals
/// encloses its greatest value ([`greatest_ratio`]). The show ends at the event that `timeline` gives.
///
/// # Errors
/// The show runs into a lock: near a lock speeds have no bound. The scene has `[[dragons]]`.
pub fn greatest_speed(
    scene: &Scene,
    timeline: &Timeline,
    limit: f64,
    progress: Progress<'_>,
) -> Result<GreatestSpeed, PlanError> {
    let (motion, end, tolerance) = asked(scene, timeline, limit)?;
    Ok(answer(motion, limit, greatest_ratio(motion, end, tolerance, progress)))
}

/// Encloses the greatest speed as [`greatest_speed`] does, and writes a certificate. `text` is the scene's text. The
/// search gives up after `most_handles`.
///
/// # Errors
/// As [`greatest_speed`]; a line cannot be written, or the speed is not decided.
pub fn certify_greatest_speed(
    scene: &Scene,
    timeline: &Timeline,
    limit: f64,
    text: &str,
    most_handles: u64,
    write: Write<'_>,
    progress: Progress<'_>,
) -> Result<io::Result<GreatestSpeed>, PlanError> {
    let (motion, end, tolerance) = asked(scene, timeline, limit)?;
    let found = certify_greatest_ratio(motion, end, (tolerance, limit), text, most_handles, write, progress);
    Ok(found.map(|found| answer(motion, limit, found)))
}

/// Returns the motion, the metres that its head travels in the show, and the tolerance of the ratio.
fn asked<'s>(scene: &'s Scene, timeline: &Timeline, limit: f64) -> Result<(&'s Motion, f64, f64), PlanError> {
    let motion = scene.ensemble.only();
    let motion = motion.ok_or_else(|| PlanError("the scene has [[dragons]], expected [team]".to_owned()))?;
    let show_end = timeline.show_end(scene.stops_at_contact());
    if show_end.event.kind == EventKind::Lock {
        return Err(PlanError(format!(
            "the show runs into a lock at {:.9} s: near it a handle goes faster than any limit, or jumps",
            show_end.time
        )));
    }
    // A little less, since the two speeds are rounded away from each other.
    Ok((motion, show_end.event.travelled, 0.99 * TOLERANCE / limit.clamp(1.0, LARGE)))
}

fn answer(motion: &Motion, limit: f64, found: GreatestRatio) -> GreatestSpeed {
    let (value_lo, value_hi) = found.divide(limit);
    let GreatestRatio { handle, travelled, ratio, proved, steps, .. } = found;
    let time = motion.time_at(travelled);
    GreatestSpeed { value_lo, value_hi, time, handle: handle as u32, ratio, proved, steps }
}
