//! The settings for playing a scene. Commands that play a scene make a [`Playback`]; a recording keeps it.

use crate::scene::{AtEnd, OnContact, Scene};
use bench_dragon_messages::sentence::number;
use bench_dragon_messages::state::EventKind;

/// The settings for playing a scene that the command line may override.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Playback {
    /// Start of the show, in simulated seconds.
    pub start: f64,
    /// Simulated seconds per second of wall time.
    pub time_scale: f64,
    /// The rate, in frames per second.
    pub rate: f64,
    /// The reaction to a contact.
    pub on_contact: OnContact,
    /// The behaviour at the end of the show.
    pub at_end: AtEnd,
    /// The wall time for which a looping show stands at its end, in seconds.
    pub end_hold: f64,
    /// True if the show waits at its start for [`Command::Go`](bench_dragon_messages::control::Command::Go).
    pub paused: bool,
}

impl Playback {
    /// Returns the settings of a scene, from its start.
    pub fn of(scene: &Scene) -> Self {
        let Scene { rate, on_contact, at_end, end_hold, .. } = *scene;
        Self { start: 0.0, time_scale: 1.0, rate, on_contact, at_end, end_hold, paused: false }
    }
}

/// The start is outside the motion: before 0, or not before the motion's end.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "{} s is outside the motion, expected at least 0 and less than {end:.9} s, at which it ends ({})",
    number(*.start),
    kind.name()
)]
pub struct StartError {
    /// The requested start, in simulated seconds.
    pub start: f64,
    /// The end of the motion, in simulated seconds.
    pub end: f64,
    /// The event that ends the motion.
    pub kind: EventKind,
}
