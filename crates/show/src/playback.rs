//! How a scene is played. The commands that play one make a [`Playback`]; a recording keeps it.

use crate::scene::{AtEnd, OnContact, Scene};
use bench_dragon_messages::state::EventKind;

/// How a scene is played: what the command line may override.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Playback {
    /// Simulated seconds at which the show begins.
    pub start: f64,
    /// Simulated seconds per second of wall time.
    pub time_scale: f64,
    /// Frames per second.
    pub rate: f64,
    /// What happens at a contact.
    pub on_contact: OnContact,
    /// What happens once the show has frozen.
    pub at_end: AtEnd,
    /// Seconds of wall time for which a looping show stands at its end.
    pub end_hold: f64,
    /// True if the show waits at its start for [`Command::Go`](super::control::Command::Go).
    pub paused: bool,
}

impl Playback {
    /// The playback that a scene states: from its start, in real time.
    pub fn of(scene: &Scene) -> Self {
        let Scene { rate, on_contact, at_end, end_hold, .. } = *scene;
        Self { start: 0.0, time_scale: 1.0, rate, on_contact, at_end, end_hold, paused: false }
    }
}

/// A start that is not before the motion's end.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "{start} s is outside the motion, expected at least 0 and less than {end:.9} s, at which it ends ({})",
    kind.name()
)]
pub struct StartError {
    /// Simulated seconds at which the show was to begin.
    pub start: f64,
    /// Simulated seconds at which the motion ends.
    pub end: f64,
    /// What ends it.
    pub kind: EventKind,
}
