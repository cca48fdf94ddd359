//! The path of a certificate, in intervals: its segments, its places and their order, and bounds of length, curvature
//! and turning between two places (docs/proofs.md, "Definitions" and "Capsules").

use std::cmp::Ordering;

use serde::Deserialize;

use super::curve::{At, Curve};
use super::interval::Interval;

/// A place: the segment, and the coordinate on it, the sum of two doubles. The second, which a file may leave out, is
/// at most half a unit in the last place of the first.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub(super) struct Place(pub usize, pub f64, #[serde(default)] pub f64);

impl Place {
    /// Returns the coordinate.
    pub fn coordinate(self) -> Interval {
        let coordinate = Interval::new(self.1);
        if self.2 == 0.0 { coordinate } else { coordinate + Interval::new(self.2) }
    }

    /// Returns true if the coordinate is a number.
    fn is_number(self) -> bool {
        // The sum is rounded to the first double where the second is small enough.
        self.1.is_finite() && self.1 + self.2 == self.1
    }
}

/// A span, the earlier end first.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub(super) struct Span(pub Place, pub Place);

/// A curve with its first coordinate (none for the first segment) and its last (none without an end).
pub(super) struct Segment {
    pub curve: Curve,
    pub begin: Option<Interval>,
    pub end: Option<Interval>,
}

/// The end of a path.
pub(super) enum PathEnd {
    /// A coordinate of its last segment.
    Coordinate(Interval),
    /// The path's length, travelled.
    Travelled,
}

/// The whole path.
pub(super) struct Path {
    segments: Vec<Segment>,
    /// The travel from the start to each segment's start, in metres; for the first segment, to its end.
    travelled: Vec<Interval>,
    path_end: PathEnd,
    /// The travel from the start to the path's end, in metres.
    pub length: Interval,
}

impl Path {
    /// Creates the path of these segments. The first segment ends `ahead` metres after the start.
    pub fn new(segments: Vec<Segment>, ahead: Interval, path_end: PathEnd, length: Interval) -> Self {
        let mut travelled = vec![ahead];
        let mut so_far = ahead;
        for segment in &segments[1..] {
            travelled.push(so_far);
            if let (Some(begin), Some(end)) = (&segment.begin, &segment.end) {
                so_far = so_far + segment.curve.metres(begin, end);
            }
        }
        Self { segments, travelled, path_end, length }
    }

    /// Returns point and tangent of a place.
    pub fn at(&self, place: Place) -> At {
        self.segments[place.0].curve.at(&place.coordinate())
    }

    /// Returns the metres from the start, negative before it.
    pub fn travelled(&self, place: Place) -> Interval {
        let segment = &self.segments[place.0];
        // The first segment is measured from its end, the other segments from their beginning.
        let anchor = if place.0 == 0 { &segment.end } else { &segment.begin };
        match anchor {
            Some(anchor) => self.travelled[place.0] + segment.curve.metres(anchor, &place.coordinate()),
            // A path has more than one segment, or its first one has an end.
            None => Interval::new(0.0) / Interval::new(0.0),
        }
    }

    /// Returns true if the place is certainly at the end of the path or beyond it.
    pub fn is_at_end(&self, place: Place) -> bool {
        match &self.path_end {
            PathEnd::Coordinate(end) if place.0 + 1 == self.segments.len() => {
                let at = place.coordinate();
                if self.falls(place.0) { at.is_at_most(end) } else { end.is_at_most(&at) }
            }
            PathEnd::Coordinate(_) => false,
            PathEnd::Travelled => self.length.is_at_most(&self.travelled(place)),
        }
    }

    /// Returns true if the place is certainly not beyond the end of the path.
    pub fn is_within(&self, place: Place) -> bool {
        match &self.path_end {
            PathEnd::Coordinate(end) if place.0 + 1 == self.segments.len() => {
                let at = place.coordinate();
                if self.falls(place.0) { end.is_at_most(&at) } else { at.is_at_most(end) }
            }
            PathEnd::Coordinate(_) => true,
            PathEnd::Travelled => self.travelled(place).is_at_most(&self.length),
        }
    }

    fn falls(&self, segment: usize) -> bool {
        self.segments[segment].curve.falls()
    }

    /// Returns true if the place is valid: a number strictly inside a segment. The centre of a spiral that is the whole
    /// path is valid too, since it is no junction.
    pub fn has(&self, place: Place) -> bool {
        let Some(segment) = self.segments.get(place.0).filter(|_| place.is_number()) else { return false };
        let at = place.coordinate();
        if self.segments.len() == 1 {
            return at.is_not_negative();
        }
        let before = |a: &Interval, b: &Interval| if self.falls(place.0) { b.is_below(a) } else { a.is_below(b) };
        // The last segment continues beyond the path's end, but not through the centre of a spiral.
        (!self.falls(place.0) || at.is_not_negative())
            && segment.begin.as_ref().is_none_or(|begin| before(begin, &at))
            && segment.end.as_ref().is_none_or(|end| before(&at, end))
    }

    /// Returns the order of two places on the path.
    pub fn order(&self, a: Place, b: Place) -> Ordering {
        // Both are strictly inside their segments, and numbers.
        let along = if a.2 == 0.0 && b.2 == 0.0 {
            a.1.partial_cmp(&b.1).unwrap_or(Ordering::Equal)
        } else {
            // One of the two differences is exact, or it is greater than any of the other.
            let by = (Interval::new(a.1) - Interval::new(b.1)) + (Interval::new(a.2) - Interval::new(b.2));
            if by.is_positive() {
                Ordering::Greater
            } else if by.is_negative() {
                Ordering::Less
            } else {
                Ordering::Equal
            }
        };
        a.0.cmp(&b.0).then(if self.falls(a.0) { along.reverse() } else { along })
    }

    /// Returns true if a is before b, or equal.
    pub fn in_order(&self, a: Place, b: Place) -> bool {
        self.order(a, b) != Ordering::Greater
    }

    /// Returns true if the segment is a line.
    pub fn is_line(&self, segment: usize) -> bool {
        self.segments[segment].curve.is_line()
    }

    /// Returns true if the segment is an arc.
    pub fn is_arc(&self, segment: usize) -> bool {
        self.segments[segment].curve.is_arc()
    }

    /// Returns the metres from the centre at a place of an inward spiral.
    pub fn spiral_radius(&self, place: Place) -> Option<Interval> {
        self.segments[place.0].curve.spiral_radius(place.coordinate())
    }

    /// Returns the parts of a span in each segment: its curve, and the coordinates at the ends.
    fn parts(&self, from: Place, to: Place) -> impl Iterator<Item = (usize, Interval, Interval)> {
        (from.0..=to.0).map(move |index| {
            let nothing = || Interval::new(0.0) / Interval::new(0.0);
            let segment = &self.segments[index];
            let begin = if index == from.0 { from.coordinate() } else { segment.begin.unwrap_or_else(nothing) };
            let end = if index == to.0 { to.coordinate() } else { segment.end.unwrap_or_else(nothing) };
            (index, begin, end)
        })
    }

    /// Returns an upper bound of the metres from one place to a later one.
    pub fn metres_bound(&self, from: Place, to: Place) -> Interval {
        let parts = self.parts(from, to);
        parts
            .map(|(index, begin, end)| self.segments[index].curve.metres_bound(&begin, &end))
            .fold(Interval::new(0.0), |sum, part| sum + part)
            .upper()
    }

    /// Returns an upper bound of the curvature from one place to a later one, 1/m.
    pub fn curvature_bound(&self, from: Place, to: Place) -> Interval {
        let parts = self.parts(from, to);
        parts
            .map(|(index, begin, end)| self.segments[index].curve.curvature_bound(&begin, &end))
            .fold(Interval::new(0.0), |most, part| most.max(&part))
            .upper()
    }

    /// Returns the curvature anywhere in a span, positive to the left, 1/m.
    pub fn bend(&self, Span(from, to): Span) -> Interval {
        let parts = self.parts(from, to).map(|(index, begin, end)| self.segments[index].curve.bend(&begin, &end));
        parts.reduce(|all, part| all.hull(&part)).unwrap_or_else(|| Interval::new(0.0))
    }

    /// Returns the change of that curvature per metre, 1/m^2; `None` for a span with a junction.
    pub fn bend_rate(&self, Span(from, to): Span) -> Option<Interval> {
        let (begin, end) = (from.coordinate(), to.coordinate());
        (from.0 == to.0).then(|| self.segments[from.0].curve.bend_rate(&begin, &end))
    }

    /// Returns an upper bound of the radians by which the path turns from one place to a later one.
    pub fn turning_bound(&self, from: Place, to: Place) -> Interval {
        let parts = self.parts(from, to);
        parts
            .map(|(index, begin, end)| self.segments[index].curve.turning_bound(&begin, &end))
            .fold(Interval::new(0.0), |sum, part| sum + part)
            .upper()
    }

    /// Returns the place of a span about which its capsule is: near the middle.
    pub fn middle_of(&self, Span(from, to): Span) -> Place {
        let between = |place: &Place| self.has(*place) && self.in_order(from, *place) && self.in_order(*place, to);
        Some(self.middle(from, to)).filter(between).unwrap_or(from)
    }

    /// Returns a place near the middle of two others. No proof depends on the choice: callers check that the place is
    /// between.
    pub fn middle(&self, from: Place, to: Place) -> Place {
        if from.0 == to.0 {
            let high = from.1 + (to.1 - from.1) / 2.0;
            if from.2 == 0.0 && to.2 == 0.0 {
                return Place(from.0, high, 0.0);
            }
            let low = (from.2 + to.2) / 2.0 + ((from.1 - high) + (to.1 - high)) / 2.0;
            let sum = high + low;
            return Place(from.0, sum, low - (sum - high));
        }
        let rough: Vec<(usize, f64, f64, f64)> = self
            .parts(from, to)
            .map(|(index, begin, end)| {
                let (begin, end) = (begin.rough(), end.rough());
                let speed = self.segments[index].curve.rough_speed(begin + (end - begin) / 2.0);
                (index, begin, speed, speed * (end - begin))
            })
            .collect();
        let mut rest = rough.iter().map(|part| part.3).sum::<f64>() / 2.0;
        for (index, begin, speed, metres) in rough {
            let place = Place(index, begin + rest / speed, 0.0);
            if rest <= metres && self.has(place) && self.in_order(from, place) && self.in_order(place, to) {
                return place;
            }
            rest = (rest - metres).max(0.0);
        }
        let between = |place: &Place| {
            self.has(*place)
                && *place != from
                && *place != to
                && self.in_order(from, *place)
                && self.in_order(*place, to)
        };
        self.beside_junction(from.0).into_iter().flatten().find(between).unwrap_or(from)
    }

    /// Returns places near the junction behind a segment, one on each side.
    fn beside_junction(&self, segment: usize) -> [Option<Place>; 2] {
        const ASIDE: f64 = 1e-15;
        // The ends may be wide: the lower end for a coordinate that grows towards the junction, the upper for one that
        // falls.
        let at = |index: usize, end: Option<&Interval>, is_lower: bool| {
            let end = end?;
            let at = if is_lower { -(-end).upper() } else { end.upper() }.rough();
            let aside = ASIDE * (1.0 + at.abs());
            Some(Place(index, if is_lower { at - aside } else { at + aside }, 0.0))
        };
        let next = segment + 1;
        let before = self.segments.get(segment).and_then(|this| at(segment, this.end.as_ref(), !self.falls(segment)));
        let after = self.segments.get(next).and_then(|next_one| at(next, next_one.begin.as_ref(), self.falls(next)));
        [before, after]
    }
}
