//! The show: from a scene and a tick to one [`Frame`], the same bits every time.
//!
//! Knows the solver, the events and the alert rules; knows no clock and no transport. The live loop and the offline
//! commands call it.

use crate::chain::Chain;
use crate::messages::State;

/// One moment of the show.
#[derive(Debug, Clone)]
pub struct Frame {
    /// The number of the period.
    pub tick: u64,
    /// Simulated seconds since the start of the scene.
    pub sim_time: f64,
    /// The latest event passed, or `Approaching`, or `Moving`.
    pub state: State,
    /// Where every handle is.
    pub chain: Chain,
    /// Metres between the nearest two boards that share no handle; NaN where none is computed.
    pub min_clearance: f64,
    /// The alerts that go with this frame, in order. Its memory is reserved once.
    pub alerts: Vec<Alert>,
    /// Times the show has been played to its end and begun again.
    pub shows_played: u64,
}

/// A change of the alert level or a step of the countdown: what of a
/// [`CollisionAlert`](crate::messages::CollisionAlert) does not depend on clocks and runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alert {
    /// The level, up to `Lock`; `Moving` is called clear.
    pub level: State,
    /// Simulated seconds of the event, NaN where there is none.
    pub event_time: f64,
    /// `event_time` minus the frame's time.
    pub time_to_event: f64,
    /// Metres between the nearest two boards.
    pub clearance: f64,
    /// The place, metres; NaN where there is none.
    pub x: f64,
    /// The place, metres; NaN where there is none.
    pub y: f64,
    /// The first bench concerned.
    pub bench_a: Option<u32>,
    /// The second bench concerned.
    pub bench_b: Option<u32>,
}
