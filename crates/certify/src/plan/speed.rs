//! The greatest speed of the head at which no handle is too fast.
//!
//! In: a scene, its events, a limit. Out: two speeds between which it is, proved. See "Lemma 7" in `docs/proofs.md`.

use super::PlanError;
use crate::speed::{GreatestRatio, greatest_ratio};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_show::scene::Scene;

/// The greatest speed of the head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GreatestSpeed {
    /// Metres per second: with the head no faster than this, no handle exceeds the limit; 0 where nothing is proved.
    pub value_lo: f64,
    /// Metres per second: with the head any faster, the handle exceeds the limit.
    pub value_hi: f64,
    /// Simulated seconds of the scene as it is written at which the handle is as fast as `ratio`.
    pub time: f64,
    /// The handle, counted from 0: none is faster by more than the two speeds of the head leave open.
    pub handle: u32,
    /// Its speed over the head's then.
    pub ratio: f64,
    /// True if the two speeds are as near to each other as was to be; otherwise the search was given up.
    pub proved: bool,
    /// Steps of the head that were enclosed.
    pub steps: u64,
}

/// How far the two speeds may be apart, metres per second; for limits above [`LARGE`] as a share of the limit over
/// that.
const TOLERANCE: f64 = 1e-9;

/// Metres per second from which on the tolerance grows with the limit.
const LARGE: f64 = 4.0;

/// The greatest constant speed of the head at which no handle ever goes faster than `limit` metres per second, from the
/// scene's start until its show freezes. `progress` is called now and then with the share of the work that is done,
/// from 0 to 1.
///
/// A handle's speed over the head's depends on the head's place alone. Its greatest value is enclosed by branch and
/// bound with intervals ([`greatest_ratio`]); the event at which the show freezes is taken as `timeline` has it.
///
/// # Errors
/// A show that runs into a lock, near which speeds have no bound.
pub fn greatest_speed(
    scene: &Scene,
    timeline: &Timeline,
    limit: f64,
    progress: &mut dyn FnMut(f64),
) -> Result<GreatestSpeed, PlanError> {
    let freeze = timeline.freeze(scene.stops_at_contact());
    if freeze.event.kind == EventKind::Lock {
        return Err(PlanError(format!(
            "the show runs into a lock at {:.9} s: near it a handle goes faster than any limit, or jumps",
            freeze.time
        )));
    }
    // A little less: the two speeds are rounded away from each other.
    let tolerance = 0.999 * TOLERANCE / limit.clamp(1.0, LARGE);
    let found = greatest_ratio(&scene.motion, freeze.event.travelled, tolerance, progress);
    let GreatestRatio { handle, travelled, ratio, proved, steps, .. } = found;
    let (value_lo, value_hi) = found.divide(limit);
    let time = scene.motion.time_at(travelled);
    Ok(GreatestSpeed { value_lo, value_hi, time, handle: handle as u32, ratio, proved, steps })
}
