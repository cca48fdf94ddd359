//! The path that the handles ride: segments one after the other without a gap or a corner, travelled by arc length. A
//! spiral is a path of one segment.
//!
//! The head starts at distance 0. A path reaches as far behind its start as any team needs, and ends at
//! [`Path::length`].

use std::f64::consts::TAU;

use super::arc::Arc;
use super::curve::{Coordinate, Curve, Side};
use super::curve_bounds::CurveBounds;
use super::double_double::DoubleDouble;
use super::elementary::{atan, atan2, hypot};
use super::line::Line;
use super::segment::{Segment, SegmentOutline};
use super::spiral::{Direction, Spiral};
use super::{Point, Vector};

/// A place on a path: the segment, counted from 0, and the place on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Param {
    pub(crate) segment: usize,
    pub(crate) at: Coordinate,
}

impl Param {
    /// Creates the place with this coordinate on a segment, counted from 0.
    pub fn new(segment: usize, coordinate: Coordinate) -> Self {
        Self { segment, at: coordinate }
    }

    /// Returns the segment, counted from 0.
    pub fn segment(&self) -> usize {
        self.segment
    }

    /// Returns the place in the segment's own coordinate: metres on a line, radians on an arc or a spiral.
    pub fn coordinate(&self) -> Coordinate {
        self.at
    }
}

/// Two segments that do not join: the path would have a gap or a corner.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("segment {segment} does not join the one before it: a gap of {gap:e} m, a corner of {corner:e} rad")]
pub struct Disjoint {
    /// The later of the two segments, counted from 0.
    pub segment: usize,
    /// The distance between the end of one and the start of the other, in metres.
    pub gap: f64,
    /// The angle between their directions, in radians.
    pub corner: f64,
}

/// A segment on the path.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Placed {
    segment: Segment,
    /// The travel at which it begins, in metres; minus infinity for the first.
    begin: f64,
    /// The travel at which it ends, in metres.
    end: f64,
    /// The coordinate of its beginning and the travel there, in metres. For the first segment this is the head's start
    /// or the segment's end, whichever is earlier.
    anchor: Coordinate,
    anchor_travelled: f64,
    /// The coordinate of its end.
    last: Coordinate,
}

impl Placed {
    fn at(&self, travelled: f64) -> Coordinate {
        self.segment.advance(self.anchor, travelled - self.anchor_travelled)
    }

    /// Returns the centre and the radius, metres, of a circle that holds the segment: no point is farther from the
    /// middle than half the length. The first segment has no end behind.
    fn circle(&self) -> (Point, f64) {
        if self.begin == f64::NEG_INFINITY {
            return (Point::origin(), f64::INFINITY);
        }
        let half = 0.5 * (self.end - self.begin);
        let middle = self.segment.point(self.segment.advance(self.anchor, half));
        // Coordinates have a relative error of 4 eps at most.
        (middle, half + 1e-9 * (1.0 + half + middle.coords.norm()))
    }
}

/// A stretch in which the follower of a link is not the first place at the link's distance, because nearer places have
/// come to that distance since the motion began. There the follower is the first such place back from `behind`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Branch {
    /// The length of the link, in metres.
    pub link: f64,
    /// The travel of the front handle at which the stretch begins, in metres.
    pub begin: f64,
    /// The travel of the front handle at which it ends; infinite where the link locks.
    pub end: f64,
    /// A place between the follower and all nearer places at the link's distance, with the front handle at `begin`.
    pub behind: Param,
    /// The metres by which that place moves per metre of the front handle: 0, or 1 or -1 on parallel lines.
    pub drift: f64,
}

/// A smooth path.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    segments: Vec<Placed>,
    /// By segment: the centre and the radius of a circle that holds it; none for a path of one segment.
    circles: Vec<(Point, f64)>,
    /// In order of the link, then of the beginning; nearly always empty.
    branches: Vec<Branch>,
}

impl Path {
    /// Creates the path inward along the spiral r = a theta (a = `pitch` / 2 pi) from theta = 2 pi `start_turn` to the
    /// centre.
    pub fn spiral(pitch: f64, start_turn: f64) -> Self {
        let spiral = Spiral::new(pitch, Direction::Inward);
        let anchor = DoubleDouble::from_turns(start_turn);
        let end = spiral.arc_length(anchor, Coordinate::ZERO);
        Self {
            segments: vec![Placed {
                segment: Segment::Spiral(spiral),
                begin: f64::NEG_INFINITY,
                end,
                anchor,
                anchor_travelled: 0.0,
                last: Coordinate::ZERO,
            }],
            circles: Vec::new(),
            branches: Vec::new(),
        }
    }

    /// Creates the path inward along the spiral r = a theta (a = `pitch` / 2 pi) up to `turn_radius`. The path
    /// continues through an S of two arcs to the opposite point. From there it leads outward along the same spiral
    /// turned by half a turn. Travel starts `lead_in` metres before the turn and ends `lead_out` metres after it.
    ///
    /// With R = `turn_radius` the chords of both arcs lie on the diameter through the two ends. They make the same
    /// angle atan(R/a) with the tangents there, so both arcs turn by twice that angle. Their radii sum to sqrt(R^2 +
    /// a^2), and their lengths to 2 sqrt(R^2 + a^2) atan(R/a), for any `arc_ratio`, which is the first radius over the
    /// second.
    ///
    /// # Errors
    /// [`Disjoint`] if the numbers are so extreme that rounding leaves a gap.
    pub fn turnaround(
        pitch: f64,
        turn_radius: f64,
        arc_ratio: f64,
        lead_in: f64,
        lead_out: f64,
    ) -> Result<Self, Disjoint> {
        let inward = Spiral::new(pitch, Direction::Inward);
        let a = inward.radius_per_radian();
        let both = hypot(turn_radius, a);
        let second_radius = both / (1.0 + arc_ratio);
        let first_radius = arc_ratio * second_radius;
        let angle = 2.0 * atan(turn_radius / a);
        // Far out a rounded number of turns would be a place well beside the turn's own.
        let DoubleDouble { high, low } = DoubleDouble::quotient(turn_radius, pitch);
        let anchor = DoubleDouble::from_turns(high).plus(TAU * low);
        let (start, tangent) = (inward.point(anchor), inward.tangent(anchor));
        let first = Arc::new(start, tangent, Side::Right, first_radius);
        let middle = start + (-2.0 * first_radius / both) * start.coords;
        let last = Coordinate { high: angle, low: 0.0 };
        let second = Arc::new(middle, first.tangent(last), Side::Left, second_radius);
        let approach = Placed {
            segment: Segment::Spiral(inward),
            begin: f64::NEG_INFINITY,
            end: lead_in,
            anchor,
            anchor_travelled: lead_in,
            last: anchor,
        };
        let mut path = Self { segments: vec![approach], circles: Vec::new(), branches: Vec::new() };
        path.push(Segment::Arc(first), Coordinate::ZERO, last, first_radius * angle);
        path.push(Segment::Arc(second), Coordinate::ZERO, last, second_radius * angle);
        let outward = Spiral::new(pitch, Direction::Outward);
        path.push(Segment::Spiral(outward), anchor, outward.advance(anchor, lead_out), lead_out);
        path.joined()
    }

    /// Creates a route that begins at the origin in the direction `heading_turns` turns counter-clockwise from x, with
    /// an infinite straight line behind it. Lines, arcs and spirals are added one by one.
    pub fn route(heading_turns: f64) -> Route {
        let start = Point::origin();
        let (sine, cosine) = DoubleDouble::from_turns(heading_turns).sine_and_cosine();
        let segment = Segment::Line(Line { origin: start, direction: Vector::new(cosine, sine) });
        let zero = Coordinate::ZERO;
        let behind =
            Placed { segment, begin: f64::NEG_INFINITY, end: 0.0, anchor: zero, anchor_travelled: 0.0, last: zero };
        let path = Self { segments: vec![behind], circles: Vec::new(), branches: Vec::new() };
        Route { path, end: start, heading_turns, remainders: None }
    }

    fn push(&mut self, segment: Segment, anchor: Coordinate, last: Coordinate, length: f64) {
        let begin = self.length();
        self.segments.push(Placed { segment, begin, end: begin + length, anchor, anchor_travelled: begin, last });
    }

    /// Returns the path if every segment continues the one before it.
    fn joined(mut self) -> Result<Self, Disjoint> {
        for (index, pair) in self.segments.windows(2).enumerate() {
            let (before, after) = (&pair[0].segment, &pair[1].segment);
            let (last, first) = (self.last(index), pair[1].anchor);
            let (end, start) = (before.point(last), after.point(first));
            let (old, new) = (before.tangent(last), after.tangent(first));
            let gap = (end - start).norm();
            let corner = atan2(old.perp(&new), old.dot(&new)).abs();
            let sharpest = before.curvature(last).max(after.curvature(first));
            let size = end.coords.norm() + 1.0 / sharpest.max(1.0);
            // NaN is no join either.
            if !(gap <= 1e-12 * size && corner <= 1e-12) {
                return Err(Disjoint { segment: index + 1, gap, corner });
            }
        }
        self.circles = self.segments.iter().map(Placed::circle).collect();
        Ok(self)
    }

    /// Returns the same path with the stretches in which followers are not the first places at their distances. The
    /// stretches of a link do not overlap, and none begins on the first segment.
    pub fn with_branches(self, mut branches: Vec<Branch>) -> Self {
        branches.sort_by(|one, other| one.link.total_cmp(&other.link).then(one.begin.total_cmp(&other.begin)));
        Self { branches, ..self }
    }

    /// Returns the stretches in which followers are not the first places at their distances.
    pub fn branches(&self) -> &[Branch] {
        &self.branches
    }

    /// Returns the place from which the follower of a link is the first one back; `None` for the front handle itself.
    #[inline]
    pub fn branch(&self, front: Param, link: f64) -> Option<Param> {
        if front.segment == 0 || self.branches.is_empty() {
            return None;
        }
        let travelled = self.travelled(front);
        let next = self.branches.partition_point(|branch| (branch.link, branch.begin) <= (link, travelled));
        let branch = self.branches.get(next.checked_sub(1)?)?;
        (branch.link == link && travelled <= branch.end).then(|| self.place_behind(branch, travelled))
    }

    /// Returns the place from which the follower is the first one back, with the front handle on a branch.
    pub(crate) fn place_behind(&self, branch: &Branch, front: f64) -> Param {
        if branch.drift == 0.0 {
            return branch.behind;
        }
        self.param_at(self.travelled(branch.behind) + branch.drift * (front - branch.begin))
    }

    /// Returns the metres that the head can travel.
    pub fn length(&self) -> f64 {
        self.segments[self.segments.len() - 1].end
    }

    /// Returns the number of segments, with the one that reaches behind the start.
    pub fn segments(&self) -> usize {
        self.segments.len()
    }

    /// Returns the metres of travel at which each segment after the first begins.
    pub fn junctions(&self) -> impl Iterator<Item = f64> + '_ {
        self.segments[1..].iter().map(|placed| placed.begin)
    }

    /// Returns the place `travelled` metres of arc length past the start, at most the path's end.
    ///
    /// The error is at most 4 eps (r + |travelled|) along the curve, r being the distance from the origin.
    pub fn param_at(&self, travelled: f64) -> Param {
        let travelled = travelled.min(self.length());
        let segment = self.segments.partition_point(|placed| placed.begin <= travelled).max(1) - 1;
        Param { segment, at: self.segments[segment].at(travelled) }
    }

    /// Returns the metres of travel at a place.
    pub fn travelled(&self, param: Param) -> f64 {
        let Placed { segment, anchor, anchor_travelled, .. } = &self.segments[param.segment];
        anchor_travelled + segment.arc_length(*anchor, param.at)
    }

    /// Returns the point of a place.
    pub fn point(&self, param: Param) -> Point {
        self.segment(param).point(param.at)
    }

    /// Returns the unit tangent of a place, in the direction of travel.
    pub fn tangent(&self, param: Param) -> Vector {
        self.segment(param).tangent(param.at)
    }

    /// Returns the metres of arc length from one place to another, negative against the direction of travel.
    pub fn arc_length(&self, from: Param, to: Param) -> f64 {
        if from.segment == to.segment {
            return self.segment(from).arc_length(from.at, to.at);
        }
        if from.segment > to.segment {
            return -self.arc_length(to, from);
        }
        let between = self.segments[to.segment].begin - self.segments[from.segment].end;
        let rest = self.segment(from).arc_length(from.at, self.last(from.segment));
        rest + between + self.segment(to).arc_length(self.segments[to.segment].anchor, to.at)
    }

    /// Returns the largest summand of the points of a route's curves, metres, for handles up to `behind` metres behind
    /// the start. Points nearer to the origin of coordinates are rounded as this number is.
    pub fn largest_summand(&self, behind: f64) -> f64 {
        let of = |placed: &Placed| {
            let length = placed.end - placed.begin.max(-behind);
            placed.segment.largest_summand(placed.anchor, placed.last, length)
        };
        self.segments.iter().map(of).fold(0.0, f64::max)
    }

    /// Returns the greatest curvature between two distances of travel, 1/m: the tangent turns by at most this per
    /// metre.
    pub fn max_curvature_between(&self, from: f64, to: f64) -> f64 {
        let first = self.segments.partition_point(|placed| placed.end < from);
        let met = self.segments[first..].iter().take_while(|placed| placed.begin <= to);
        met.map(|placed| {
            let tightest = if placed.segment.tightens() { to } else { from.max(placed.begin) }.min(placed.end);
            placed.segment.curvature(placed.at(tightest))
        })
        .fold(0.0, f64::max)
    }

    /// Returns the spiral of a path that consists of one spiral only, and its coordinate at the start of travel.
    pub fn as_spiral(&self) -> Option<(&Spiral, Coordinate)> {
        match self.segments.as_slice() {
            [Placed { segment: Segment::Spiral(spiral), anchor, .. }] => Some((spiral, *anchor)),
            _ => None,
        }
    }

    /// Returns the outline of each segment, in order, from the head's start.
    pub fn outline(&self) -> Vec<SegmentOutline> {
        let ahead = self.segments.iter().filter(|placed| placed.end > 0.0);
        ahead
            .map(|placed| {
                let begin = placed.begin.max(0.0);
                placed.segment.outline(placed.at(begin), placed.last, placed.end - begin)
            })
            .collect()
    }

    pub(crate) fn segment(&self, param: Param) -> &Segment {
        &self.segments[param.segment].segment
    }

    pub(crate) fn segment_at(&self, index: usize) -> &Segment {
        &self.segments[index].segment
    }

    /// Returns false only if no point of a segment is within `radius` metres of `centre`.
    pub(crate) fn can_meet(&self, segment: usize, centre: Point, radius: f64) -> bool {
        let Some((middle, half)) = self.circles.get(segment) else { return true };
        let is_apart = (*middle - centre).norm_squared() > (half + radius) * (half + radius);
        // NaN is not apart.
        !is_apart
    }

    /// Returns the coordinate with which a segment begins; for the first segment, of the place from which it is
    /// measured.
    pub(crate) fn first(&self, segment: usize) -> Coordinate {
        self.segments[segment].anchor
    }

    /// Returns the coordinate with which a segment ends.
    pub(crate) fn last(&self, segment: usize) -> Coordinate {
        self.segments[segment].last
    }

    /// Returns the metres of travel at which a segment ends.
    pub(crate) fn end_of(&self, segment: usize) -> f64 {
        self.segments[segment].end
    }
}

/// A route under construction. Its pieces are in [`description`](super::description).
#[derive(Debug, Clone)]
pub struct Route {
    path: Path,
    pub(super) end: Point,
    heading_turns: f64,
    remainders: Option<Remainders>,
}

/// The rounding errors of the end, the heading and the length of a route so far.
#[derive(Debug, Clone, Copy, Default)]
struct Remainders {
    end: Vector,
    heading_turns: f64,
    length: f64,
}

impl Route {
    /// Returns the route with sums of twice the digits from here on, for a route of many pieces: their rounding errors
    /// would add up. Short routes have plain sums.
    pub fn of_many_pieces(self) -> Self {
        Self { remainders: Some(Remainders::default()), ..self }
    }

    /// Returns the unit direction at the route's end.
    pub fn direction(&self) -> Vector {
        let rest = self.remainders.map_or(0.0, |remainders| remainders.heading_turns);
        let heading = DoubleDouble::from_turns(self.heading_turns);
        let heading = if rest == 0.0 { heading } else { heading.plus(TAU * rest) };
        let (sine, cosine) = heading.sine_and_cosine();
        Vector::new(cosine, sine)
    }

    /// Adds the `length` metres of a curve from one place to another. The piece begins at the route's end in the
    /// route's direction there, and turns by `turned` turns to the left.
    pub(super) fn piece(
        mut self,
        segment: Segment,
        first: Coordinate,
        last: Coordinate,
        length: f64,
        turned: f64,
    ) -> Self {
        let before = self.path.length();
        self.path.push(segment, first, last, length);
        let Some(rest) = &mut self.remainders else {
            self.end = segment.point(last);
            self.heading_turns += turned;
            return self;
        };
        let add = |sum: &mut f64, rest: &mut f64, by: f64| {
            DoubleDouble { high: *sum, low: *rest } = DoubleDouble { high: *sum, low: *rest }.plus(by);
        };
        let by = segment.displacement(first, last);
        add(&mut self.end.x, &mut rest.end.x, by.x);
        add(&mut self.end.y, &mut rest.end.y, by.y);
        add(&mut self.heading_turns, &mut rest.heading_turns, turned);
        let mut end = before;
        add(&mut end, &mut rest.length, length);
        if let Some(pushed) = self.path.segments.last_mut() {
            pushed.end = end;
        }
        self
    }

    /// Returns the path.
    ///
    /// # Errors
    /// [`Disjoint`] if the numbers are so extreme that rounding leaves a gap.
    pub fn build(self) -> Result<Path, Disjoint> {
        self.path.joined()
    }
}

#[cfg(test)]
pub(crate) mod tests;
