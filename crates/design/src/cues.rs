//! Cues that are dragged along the time line.
//!
//! In: a scene with its text, and a time. Out: the text with the cue at that time, stated as before: as a time, as
//! seconds before an event, or as metres of the head.

use crate::edit::{self, Change};
use crate::request::Drag;
use crate::scene::{DesignedScene, Fault};
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_show::scene::cue::CueMoment;

/// The time to whose multiples a cue snaps, in seconds.
const SNAP: f64 = 0.1;
/// The rounding of a time, in seconds, and of a travel, in metres.
const ROUNDING: f64 = 1e-3;

/// Returns the number of the cue that a handle is.
pub fn dragged(handle: &str) -> Option<usize> {
    handle.strip_prefix("cues[")?.strip_suffix(']')?.parse().ok()
}

/// Drags a cue to a time, the first number of the place. `timeline` has the events, where they are known.
///
/// # Errors
/// [`Fault`] for a cue that the scene does not have, and for one before an event that is not known.
pub fn drag(scene: &DesignedScene, cue: usize, drag: &Drag, timeline: Option<&Timeline>) -> Result<String, Fault> {
    let given = scene.scene.cues.get(cue).ok_or_else(|| format!("the scene has no cue {cue}"))?;
    let [time, _] = drag.to;
    let time = if drag.free { time } else { (time / SNAP).round() / SNAP.recip() };
    let (field, value) = match given.moment {
        CueMoment::At(_) => ("at", time),
        CueMoment::Before { event, .. } => {
            let found = timeline.and_then(|timeline| timeline.find(event));
            let found = found.ok_or_else(|| format!("there is no {}, or it is not known yet", event.name()))?;
            ("seconds", found.time - time)
        }
        CueMoment::Travelled(_) => {
            let only = scene.scene.ensemble.only();
            ("travelled", only.map_or(time, |motion| motion.travelled_at(time)))
        }
    };
    edit::apply(scene, &[Change::number(&format!("cues[{cue}].{field}"), value.max(0.0), ROUNDING)])
}
