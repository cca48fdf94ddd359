//! First-order enclosures of boards over a step: Lemma 6 of docs/proofs.md.
//!
//! Doubles choose the directions in which two boards may be apart; intervals prove it.

use super::handle::{Handle, When};
use super::interval::{Interval, Vector};
use super::sides::Sides;
use super::team::Size;

/// Limit of directions tried for a pair, the best first.
const MOST_TRIES: usize = 4;

/// A vector `at` + tau `by`, and an error.
struct Linear {
    at: Vector,
    by: Vector,
    error: Interval,
}

/// A direction fixed to a board: its parts along the board and to the left.
type Direction = [f64; 2];

const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
const SIDES: [Direction; 4] = [[0.0, 1.0], [0.0, -1.0], [1.0, 0.0], [-1.0, 0.0]];

/// A board, or a run of boards on one straight line, over a step.
pub(super) struct FirstOrderBoard {
    front: Handle,
    rear: Handle,
    link: Interval,
    half_length: Interval,
    half_width: Interval,
    half_step: Interval,
    sides: Sides,
}

impl FirstOrderBoard {
    pub fn new(front: Handle, rear: Handle, half_step: Interval, size: Size) -> Self {
        let half = Interval::new(0.5);
        let link = size.link;
        let (half_length, half_width) = (link * half + size.hole_inset, size.width * half);
        let rough = |handle: &Handle| [handle.point.x.rough(), handle.point.y.rough()];
        let sides = Sides::new(rough(&front), rough(&rear), half_length.rough(), half_width.rough());
        Self { front, rear, link, half_length, half_width, half_step, sides }
    }

    /// Returns u, the vector from the rear to the front handle.
    fn along(&self, when: When) -> Linear {
        let (front, rear) = (&self.front, &self.rear);
        let error = front.error(when) + rear.error(when);
        Linear { at: front.point.minus(&rear.point), by: front.velocity.minus(&rear.velocity), error }
    }

    /// Returns w, the vector to a corner from the middle between the handles of another board.
    fn corner(&self, corner: [f64; 2], seen_from: &Self, when: When) -> Linear {
        seen_from.seen(self.point(corner, when), when)
    }

    /// Returns a point relative to the middle between the handles.
    fn seen(&self, Linear { at, by, error }: Linear, when: When) -> Linear {
        let half = Interval::new(0.5);
        let middle = |front: &Vector, rear: &Vector| front.plus(rear).scaled(&half);
        let (front, rear) = (&self.front, &self.rear);
        Linear {
            at: at.minus(&middle(&front.point, &rear.point)),
            by: by.minus(&middle(&front.velocity, &rear.velocity)),
            error: error + half * (front.error(when) + rear.error(when)),
        }
    }

    /// Returns a point of the board, by its parts along the board and to the left. The parts are shares of half its
    /// length and half its width.
    fn point(&self, [ahead, left]: [f64; 2], when: When) -> Linear {
        let along = self.along(when);
        let share = self.half_length / self.link * Interval::new(ahead);
        let aside = self.half_width / self.link * Interval::new(left);
        let half = Interval::new(0.5);
        let of = |front: &Vector, rear: &Vector, along: &Vector| {
            let middle = front.plus(rear).scaled(&half);
            middle.plus(&along.scaled(&share)).plus(&along.turned_left().scaled(&aside))
        };
        let (front, rear) = (&self.front, &self.rear);
        let error = (half + share).abs() * front.error(when)
            + (half - share).abs() * rear.error(when)
            + aside.abs() * along.error;
        Linear {
            at: of(&front.point, &rear.point, &along.at),
            by: of(&front.velocity, &rear.velocity, &along.by),
            error,
        }
    }

    /// Returns the gap between this board and another along a direction fixed to this board.
    fn gap(&self, other: &Self, direction: Direction, when: When) -> Interval {
        self.gap_along(direction, CORNERS.map(|corner| other.corner(corner, self, when)), when)
    }

    /// Returns the gap between this board and the convex hull of fixed points along a direction fixed to this board.
    fn gap_to(&self, points: &[Vector], direction: Direction, when: When) -> Interval {
        let zero = Interval::new(0.0);
        let still = |at: &Vector| Linear { at: *at, by: Vector { x: zero, y: zero }, error: zero };
        self.gap_along(direction, points.iter().map(|at| self.seen(still(at), when)), when)
    }

    /// Returns the gap between this board and points relative to the middle between its handles.
    fn gap_along(&self, direction: Direction, points: impl IntoIterator<Item = Linear>, when: When) -> Interval {
        let [ahead, left] = direction.map(Interval::new);
        let size = Vector { x: ahead, y: left }.norm();
        let Linear { at, by, error } = self.along(when);
        let turned = |along: Vector| along.scaled(&ahead).plus(&along.turned_left().scaled(&left));
        let normal = Linear { at: turned(at), by: turned(by), error: error * size };
        let half_step = if when == When::Middle { Interval::new(0.0) } else { self.half_step };
        let tau = half_step.around_zero();
        let tau_squared = Interval::new(0.0).hull(&half_step.square());
        let reach = |Linear { at, by, error }: Linear| {
            let far = at.norm() + by.norm() * half_step + error;
            let slack = normal.error * far + (self.link * size + normal.error) * error;
            normal.at.dot(&at)
                + (normal.at.dot(&by) + normal.by.dot(&at)) * tau
                + normal.by.dot(&by) * tau_squared
                + slack.around_zero()
        };
        let least = points.into_iter().map(reach).reduce(|least, next| least.min(&next)).unwrap_or(size);
        let support = self.half_length * ahead.abs() + self.half_width * left.abs();
        (least / self.link - support) / size
    }

    /// Returns true if the gap between two boards is shown to be more than `metres`.
    pub fn is_apart_by(&self, metres: &Interval, other: &Self, when: When) -> bool {
        let mut tries: Vec<(f64, bool, Direction)> = Vec::with_capacity(10);
        let mut add = |is_own: bool, direction: Direction| {
            let (own, its) = if is_own { (&self.sides, &other.sides) } else { (&other.sides, &self.sides) };
            tries.push((own.gap(its, direction), is_own, direction));
        };
        for is_own in [true, false] {
            SIDES.iter().for_each(|direction| add(is_own, *direction));
        }
        // A direction that is fixed to the one board may serve where the same direction, fixed to the other, does not.
        let between = self.sides.to_nearest(&other.sides);
        add(true, self.sides.seen(between));
        add(false, other.sides.seen(between.map(std::ops::Neg::neg)));
        tries.sort_by(|a, b| b.0.total_cmp(&a.0));
        tries.iter().take(MOST_TRIES).any(|(_, is_own, direction)| {
            let (own, its) = if *is_own { (self, other) } else { (other, self) };
            metres.is_below(&own.gap(its, *direction, when))
        })
    }

    /// Returns the gap between this board and the convex hull of fixed points along a fixed direction.
    fn fixed_gap(&self, points: &[Vector], [x, y]: [f64; 2], when: When) -> Interval {
        let n = Vector::new(x, y);
        let size = n.norm();
        let tau = if when == When::Middle { Interval::new(0.0) } else { self.half_step.around_zero() };
        let reach = |corner: [f64; 2]| {
            let Linear { at, by, error } = self.point(corner, when);
            n.dot(&at) + n.dot(&by) * tau + (size * error).around_zero()
        };
        let most = CORNERS.map(reach).into_iter().reduce(|most, next| most.max(&next)).unwrap_or(size);
        let least = points.iter().map(|point| n.dot(point)).reduce(|least, next| least.min(&next)).unwrap_or(most);
        (least - most) / size
    }

    /// Returns true if the gap between the board and the convex hull of some segments is shown to exceed `metres`
    /// throughout the step (Lemma 11).
    pub fn is_clear_of(&self, segments: &[[Vector; 2]], metres: &Interval) -> bool {
        let rough: Vec<_> = segments.iter().map(|ends| ends.map(|end| [end.x.rough(), end.y.rough()])).collect();
        let points: Vec<Vector> = segments.iter().flatten().copied().collect();
        let directions = self.sides.directions_to(&rough).into_iter();
        let mut tries: Vec<_> = directions.map(|n| (self.sides.gap_to(&rough, n), n)).collect();
        tries.retain(|(gap, _)| *gap >= metres.rough());
        tries.sort_by(|a, b| b.0.total_cmp(&a.0));
        tries.iter().take(MOST_TRIES).any(|(_, n)| {
            metres.is_below(&self.fixed_gap(&points, *n, When::Always))
                || metres.is_below(&self.gap_to(&points, self.sides.seen(*n), When::Always))
        })
    }

    /// Returns the point p(m) of the front handle, or `None`. The point is returned only if it is shown to be in the
    /// board at tau = 0, also with the board moved by `metres`.
    pub fn inner_point(&self, metres: &Interval) -> Option<&Vector> {
        let inset = self.half_length - self.link * Interval::new(0.5);
        let off = self.front.error(When::Middle) + metres;
        off.is_below(&inset.min(&self.half_width)).then_some(&self.front.point)
    }

    /// Returns an upper bound of the signed distance of the board from the point of a segment that is nearest.
    pub fn at_most_to(&self, [from, to]: &[Vector; 2]) -> Interval {
        let rough = |at: &Vector| [at.x.rough(), at.y.rough()];
        let (share, _) = Sides::nearest_of([rough(from), rough(to)], &self.sides);
        let target = from.plus(&to.minus(from).scaled(&Interval::new(share)));
        let gaps = SIDES.map(|direction| self.gap_to(&[target], direction, When::Always));
        let greatest =
            gaps.into_iter().reduce(|most, next| most.max(&next)).unwrap_or_else(|| Interval::new(0.0)).upper();
        if !greatest.is_positive() {
            return greatest;
        }
        let Linear { at, by, error } = self.point(self.sides.shares_of(rough(&target)), When::Always);
        (at.minus(&target).norm() + by.norm() * self.half_step + error).upper()
    }

    /// Returns an upper bound of the clearance of two boards throughout the step (Lemma 6, *From above*).
    pub fn at_most(&self, other: &Self) -> Interval {
        let of_sides = |own: &Self, its: &Self| SIDES.map(|direction| own.gap(its, direction, When::Always));
        let gaps = of_sides(self, other).into_iter().chain(of_sides(other, self));
        let greatest = gaps.reduce(|most, next| most.max(&next)).unwrap_or_else(|| Interval::new(0.0)).upper();
        if !greatest.is_positive() {
            return greatest;
        }
        let distance = |own: &Self, its: &Self| {
            // The corner and the point of a side that are nearest by doubles.
            let (corner, side, share) = own.sides.nearest_point(&its.sides);
            let point = own.point(CORNERS[corner], When::Always);
            let [one, next] = [side, (side + 1) % 4].map(|end| its.point(CORNERS[end], When::Always));
            let share = Interval::new(share);
            let by =
                |one: Vector, next: Vector, point: Vector| one.plus(&next.minus(&one).scaled(&share)).minus(&point);
            let (at, moved) = (by(one.at, next.at, point.at), by(one.by, next.by, point.by));
            (at.norm() + moved.norm() * self.half_step + one.error.max(&next.error) + point.error).upper()
        };
        distance(self, other).min(&distance(other, self))
    }
}
