//! The ranges of numbers that a scene, or the command line, may request.

use bench_dragon_messages::sentence;

/// A closed range of accepted numbers and their unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accepted {
    /// The least number accepted.
    pub least: f64,
    /// The greatest number accepted.
    pub greatest: f64,
    /// The unit, as in "metres".
    pub unit: &'static str,
}

/// A number outside of its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "{field} is {}, expected a number from {} to {} {}",
    sentence::number(*.number), short(.accepted.least), short(.accepted.greatest), .accepted.unit
)]
pub struct RangeError {
    /// The name of the field.
    pub field: String,
    /// The number.
    pub number: f64,
    /// The range.
    pub accepted: Accepted,
}

impl Accepted {
    /// The pitch and lengths of boards.
    pub const LENGTH: Self = Self { least: 1e-3, greatest: 1e4, unit: "metres" };
    /// The turn on which the head starts.
    pub const START_TURN: Self = Self { least: 1e-9, greatest: 1e7, unit: "turns" };
    /// The first radius of a turnaround divided by the second.
    pub const ARC_RATIO: Self = Self { least: 1e-3, greatest: 1e3, unit: "metres per metre" };
    /// The length of path before or after a turnaround, in metres.
    pub const ROUTE: Self = Self { least: 0.0, greatest: 1e9, unit: "metres" };
    /// A line or arc of a route.
    pub const LEG: Self = Self { least: 1e-3, greatest: 1e9, unit: "metres" };
    /// The turns of an arc of a route.
    pub const ARC_TURNS: Self = Self { least: 1e-6, greatest: 1e3, unit: "turns" };
    /// The direction at the start of a route.
    pub const HEADING: Self = Self { least: -1.0, greatest: 1.0, unit: "turns" };
    /// A coordinate on the stage.
    pub const PLACE: Self = Self { least: -1e9, greatest: 1e9, unit: "metres" };
    /// The radius of an obstacle.
    pub const RADIUS: Self = Self { least: 1e-3, greatest: 1e9, unit: "metres" };
    /// The distance that boards keep from an obstacle.
    pub const KEEP_OUT: Self = Self { least: 0.0, greatest: 1e6, unit: "metres" };
    /// The rotation of a path on the stage.
    pub const ROTATION: Self = Self { least: -1e3, greatest: 1e3, unit: "turns" };
    /// The speed of the head.
    pub const SPEED: Self = Self { least: 1e-9, greatest: 1e6, unit: "metres per second" };
    /// The rate, in frames per second.
    pub const RATE: Self = Self { least: 0.1, greatest: 20_000.0, unit: "frames per second" };
    /// Simulated seconds per second of wall time.
    pub const TIME_SCALE: Self = Self { least: 1e-6, greatest: 1e6, unit: "simulated seconds per second" };
    /// Requested position error.
    pub const ACCURACY: Self = Self { least: 1e-18, greatest: 1e3, unit: "metres" };
    /// The times and clearances of a warning.
    pub const WARNING: Self = Self { least: 0.0, greatest: 1e9, unit: "seconds or metres" };
    /// Simulated seconds of a cue.
    pub const CUE: Self = Self { least: 0.0, greatest: 1e20, unit: "seconds" };
    /// The wall time at the end of a show before it starts again.
    pub const END_HOLD: Self = Self { least: 0.0, greatest: 1e6, unit: "seconds" };
    /// The paper's time step and difference interval, in seconds, and its tolerance, in radians.
    pub const PAPER_RULE: Self = Self { least: 1e-15, greatest: 1e3, unit: "seconds or radians" };
    /// The number of benches.
    pub const BENCHES: Self = Self { least: 1.0, greatest: 1e6, unit: "benches" };
    /// Frames that a subscriber may fall behind.
    pub const QUEUE: Self = Self { least: 1.0, greatest: 1e6, unit: "frames" };
    /// The stride of the handles that are published.
    pub const EVERY: Self = Self { least: 1.0, greatest: 1e6, unit: "handles" };
    /// Subscribers of a service.
    pub const SUBSCRIBERS: Self = Self { least: 1.0, greatest: 256.0, unit: "subscribers" };
    /// Periods skipped in a second.
    pub const SKIPPED: Self = Self { least: 1.0, greatest: 1e6, unit: "periods" };
    /// Wake-up lateness.
    pub const LATENESS: Self = Self { least: 1e-9, greatest: 1e3, unit: "seconds" };
    /// Messages that a ROS 2 topic keeps.
    pub const DEPTH: Self = Self { least: 1.0, greatest: 1e3, unit: "messages" };

    /// Returns the number if it is in the range.
    ///
    /// # Errors
    /// [`RangeError`]
    pub fn check(self, field: &str, number: f64) -> Result<f64, RangeError> {
        // A comparison with NaN is false, so NaN is refused too.
        if number >= self.least && number <= self.greatest {
            Ok(number)
        } else {
            Err(RangeError { field: field.to_owned(), number, accepted: self })
        }
    }
}

/// Returns a number in short form: 256, 20000, 1e6.
fn short(number: f64) -> String {
    let plain = number.to_string();
    if plain.len() <= 6 { plain } else { format!("{number:e}") }
}
