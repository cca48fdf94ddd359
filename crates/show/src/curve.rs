//! The clearance over a show, as a curve.
//!
//! In: a scene, its events, and the time of its least clearance. Out: points of time and clearance.

use bench_dragon_motion::event::Progress;
use bench_dragon_motion::timeline::Timeline;

use crate::scene::{AlertRules, AtEnd, OnContact, Scene};
use crate::{Playback, Show};

/// Points of the curve at equal distances, and further ones on each side of the least clearance between two of these.
const POINTS: u32 = 600;
/// See [`POINTS`].
const POINTS_AT_LEAST: u32 = 24;

/// Returns times in simulated seconds and clearances in metres, in order of time: up to the time `end`, with the least
/// clearance of `least`. Clearances are of boards, and of boards and obstacles; NaN where nothing can meet. Returns
/// `None` if `progress` stops it.
pub fn clearance_curve(
    scene: &Scene,
    timeline: &Timeline,
    end: f64,
    least: [f64; 2],
    progress: Progress<'_>,
) -> Option<Vec<[f64; 2]>> {
    let mut scene = scene.clone();
    // Frames have a clearance only with alerts, and a cue may let a show wait.
    scene.alerts.get_or_insert(AlertRules { approach_time: 0.0, approach_clearance: 0.0 });
    scene.cues.clear();
    let [least_time, _] = least;
    let (step, fine) = (end / f64::from(POINTS), end / f64::from(POINTS * POINTS_AT_LEAST));
    let mut points = frames(&scene, timeline, 0.0, step, POINTS, &mut |share| progress(0.9 * share))?;
    let from = (least_time - step).max(0.0);
    points.extend(frames(&scene, timeline, from, fine, 2 * POINTS_AT_LEAST, &mut |share| progress(0.9 + 0.1 * share))?);
    points.push(least);
    points.retain(|[time, _]| *time <= end);
    points.sort_by(|one, other| one[0].total_cmp(&other[0]));
    Some(points)
}

/// Returns the times and the clearances of `count` + 1 frames of the show from `start` on, `step` simulated seconds
/// apart.
fn frames(
    scene: &Scene,
    timeline: &Timeline,
    start: f64,
    step: f64,
    count: u32,
    progress: Progress<'_>,
) -> Option<Vec<[f64; 2]>> {
    let rate = 1.0 / step;
    let playback =
        Playback { start, rate, at_end: AtEnd::Hold, on_contact: OnContact::Continue, ..Playback::of(scene) };
    let mut show = Show::new(scene, timeline.clone(), playback).ok()?;
    let mut points = Vec::with_capacity(count as usize + 1);
    for tick in 0..=u64::from(count) {
        let frame = show.frame(tick);
        points.push([frame.sim_time, frame.min_clearance]);
        if progress(tick as f64 / f64::from(count)).is_break() {
            return None;
        }
    }
    Some(points)
}
