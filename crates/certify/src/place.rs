//! Places on a path and spans of it, as certificates write them.

use serde::{Serialize, Serializer};

use super::interval::Interval;

/// A place on the path: a segment, counted from 0, and a coordinate on it. The coordinate is the exact sum of two
/// doubles. The second is at most half a unit in the last place of the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place(pub usize, pub f64, pub f64);

impl Place {
    /// Creates the place whose coordinate is the sum of two doubles, the second much the smaller one.
    pub(super) fn sum(segment: usize, high: f64, low: f64) -> Self {
        // Dekker's fast two-sum: no error if |high| >= |low|.
        let sum = high + low;
        Self(segment, sum, low - (sum - high))
    }

    /// Returns the place `by` further in the coordinate, and the nearest double to it if `fine` is false.
    pub(super) fn plus(self, by: f64, fine: bool) -> Self {
        let Self(segment, at, rest) = self;
        if !fine {
            return Self(segment, at + by, 0.0);
        }
        let (high, low) = two_sum(at, by);
        Self::sum(segment, high, low + rest)
    }

    /// Returns an enclosure of the coordinate less another place's.
    pub(super) fn minus(self, other: Self) -> Interval {
        (Interval::point(self.1) - Interval::point(other.1)) + (Interval::point(self.2) - Interval::point(other.2))
    }

    /// Returns an enclosure of the coordinate.
    pub(super) fn coordinate(self) -> Interval {
        if self.2 == 0.0 { Interval::point(self.1) } else { Interval::point(self.1) + Interval::point(self.2) }
    }

    /// Returns a place in the middle of two on one segment, as a double if there is one between.
    pub(super) fn middle(self, other: Self) -> Self {
        let middle = Self(self.0, 0.5 * self.1 + 0.5 * other.1, 0.0);
        if self.2 == 0.0 && other.2 == 0.0 {
            return middle;
        }
        let (high, low) = two_sum(0.5 * self.1, 0.5 * other.1);
        Self::sum(self.0, high, low + (0.5 * self.2 + 0.5 * other.2))
    }
}

/// Returns the sum of two doubles, rounded and its error (Knuth).
fn two_sum(one: f64, other: f64) -> (f64, f64) {
    let sum = one + other;
    let of_other = sum - one;
    (sum, (one - (sum - of_other)) + (other - of_other))
}

impl Serialize for Place {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(segment, at, rest) = self;
        if *rest == 0.0 { (segment, at).serialize(serializer) } else { (segment, at, rest).serialize(serializer) }
    }
}

/// All places from the first to the second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Span(pub Place, pub Place);
