//! The placement of a path on the stage.

use serde::Deserialize;

use super::elementary;
use super::interval::{Interval, Vector};
use super::problem::{Checked, ensure};

/// The table `[placement]`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct PlacementText {
    #[serde(default)]
    origin: [f64; 2],
    #[serde(default)]
    rotation_turns: f64,
    #[serde(default)]
    mirror: bool,
}

/// The mapping from the stage's coordinates to the coordinates of a path, in which the path starts at `start`.
pub(super) struct Mapping {
    origin: Vector,
    sine: Interval,
    cosine: Interval,
    mirror: bool,
    start: Vector,
}

impl Mapping {
    /// Creates the way of a route that starts at `start`.
    ///
    /// # Errors
    /// A sentence about a number that is out of range.
    pub fn new(placement: &PlacementText, start: [f64; 2]) -> Checked<Self> {
        let numbers = [placement.origin[0], placement.origin[1], placement.rotation_turns, start[0], start[1]];
        ensure!(numbers.iter().all(|number| number.is_finite()), "the placement is out of range");
        let (sine, cosine) = elementary::sin_cos(&elementary::turns(placement.rotation_turns));
        let [origin, start] = [placement.origin, start].map(|[x, y]| Vector::new(x, y));
        Ok(Self { origin, sine, cosine, mirror: placement.mirror, start })
    }

    /// Returns the mapping of a path whose own coordinates are the stage's.
    pub fn unmoved() -> Self {
        let zero = Vector::new(0.0, 0.0);
        Self { origin: zero, sine: Interval::new(0.0), cosine: Interval::new(1.0), mirror: false, start: zero }
    }

    /// Returns a vector of the path on the stage.
    pub fn turned(&self, vector: &Vector) -> Vector {
        let Vector { x, y } = *vector;
        let y = if self.mirror { -y } else { y };
        Vector { x: self.cosine * x - self.sine * y, y: self.sine * x + self.cosine * y }
    }

    /// Returns a point of the path on the stage.
    pub fn on_stage(&self, point: &Vector) -> Vector {
        self.turned(&point.plus(&self.start)).plus(&self.origin)
    }

    /// Returns a point of the stage in the coordinates of the path.
    pub fn on_path(&self, [x, y]: [f64; 2]) -> Vector {
        let Vector { x, y } = Vector::new(x, y).minus(&self.origin);
        let turned = Vector { x: self.cosine * x + self.sine * y, y: self.cosine * y - self.sine * x };
        let own = if self.mirror { Vector { y: -turned.y, ..turned } } else { turned };
        own.minus(&self.start)
    }
}
