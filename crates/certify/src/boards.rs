//! Lemmas 2, 3 and 5 of `docs/proofs.md`: boards that are apart over a step, and boards that have a point in common.

use super::capsule::{Capsule, Frame};
use super::interval::{Interval, Vector, cross, dot, minus, norm, plus};
use bench_dragon_motion::model::Point;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::separation::closest_points_board_board;
use bench_dragon_motion::model::team::Team;

/// The size of a board, in intervals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    pub inset: Interval,
    pub half_width: Interval,
}

/// A board, or several on a straight line, over a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingBoard {
    front: Capsule,
    rear: Capsule,
    link: Interval,
    /// The length of the board beyond each handle, as a share of the link.
    share: Interval,
    half_width: Interval,
    /// A point near the middle, in doubles. The disc of `radius` metres about it holds the board at every moment.
    centre: [f64; 2],
    radius: f64,
    /// Unit direction, and half the length in metres, both approximate.
    direction: [f64; 2],
    half_length: f64,
}

impl Shape {
    /// Returns the shape of the board of a bench.
    pub fn new(team: &Team, bench: usize) -> Self {
        let half_width = Interval::point(team.board_width(bench)) * 0.5;
        Self { inset: Interval::point(team.hole_inset), half_width }
    }

    pub fn board(&self, front: Capsule, rear: Capsule, link: Interval) -> MovingBoard {
        let middle = [0, 1].map(|axis| (front.point[axis] + rear.point[axis]) * 0.5);
        let centre = middle.map(Interval::middle);
        let along = minus(front.point, rear.point).map(Interval::middle);
        let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
        let share = self.inset.over(link);
        // "Discs" in Lemma 2: half as much again as both handles move.
        let slack = [front, rear]
            .iter()
            .fold(Interval::ZERO, |sum, capsule| sum + Interval::point(capsule.half) + Interval::point(capsule.radius));
        let [x, y] = [0, 1].map(|axis| (middle[axis] - Interval::point(centre[axis])).magnitude());
        let off = Interval::point(x) + Interval::point(y);
        let radius = (link * 0.5 + self.inset + self.half_width + slack * 1.5 + off).hi;
        let direction = along.map(|part| part / length);
        let half_length = (link * 0.5 + self.inset).middle();
        MovingBoard { front, rear, link, share, half_width: self.half_width, centre, radius, direction, half_length }
    }

    /// Returns the greatest distance from the origin of a point of the board.
    pub fn outermost(&self, board: &MovingBoard) -> f64 {
        let furthest =
            |capsule: &Capsule| norm(capsule.point) + Interval::point(capsule.half) + Interval::point(capsule.radius);
        let corner = (self.inset.square() + board.half_width.square()).sqrt();
        (furthest(&board.front).max(furthest(&board.rear)) + corner).hi
    }

    /// Returns the least distance from the origin of a point of a board whose two handles are at least `radius` from
    /// the origin.
    pub fn innermost(&self, radius: f64, link: Interval) -> f64 {
        let radius = Interval::point(radius);
        let quarter = link.square() * 0.25;
        if !quarter.is_below(radius.square()) {
            return f64::NEG_INFINITY;
        }
        let chord = (radius.square() - quarter).sqrt();
        (chord.min(radius - self.inset) - self.half_width).lo
    }
}

impl MovingBoard {
    /// Returns true if the circles about two boards prove a distance of more than `metres`, which is at least 0.
    pub fn is_further_than(&self, metres: f64, other: &Self) -> bool {
        let [x, y] = [0, 1].map(|axis| self.centre[axis] - other.centre[axis]);
        let reach = self.radius + other.radius + metres;
        // At most ten roundings, each by at most 2^-52 of its result: `reach` is no subnormal number.
        reach * reach * (1.0 + 16.0 * f64::EPSILON) < x * x + y * y
    }

    /// Returns true if two boards are proved to be apart.
    pub fn is_apart_from(&self, other: &Self) -> bool {
        self.is_apart_by(0.0, other)
    }

    /// Returns true if two boards are proved to be further apart than `metres`. A negative number means an overlap less
    /// deep.
    pub fn is_apart_by(&self, metres: f64, other: &Self) -> bool {
        if self.is_further_than(metres.max(0.0), other) {
            return true;
        }
        let [x, y] = [0, 1].map(|axis| other.centre[axis] - self.centre[axis]);
        let distance = (x * x + y * y).sqrt();
        let normal = |[x, y]: [f64; 2]| [-y, x];
        let axes = [[x / distance, y / distance], normal(self.direction), normal(other.direction)];
        let mut axes = [axes[0], axes[1], axes[2], self.direction, other.direction].map(|axis| {
            let apart = (axis[0] * x + axis[1] * y).abs() - self.extent(axis) - other.extent(axis);
            (axis, apart)
        });
        // A direction that does not part the boards at rest parts no moving ones. The greatest distance is tried first.
        axes.sort_unstable_by(|one, other| other.1.total_cmp(&one.1));
        let is_separated = |axis: [f64; 2]| self.is_separated(metres, other, axis.map(Interval::point));
        axes.into_iter().filter(|(_, apart)| *apart > metres).any(|(axis, _)| is_separated(axis))
            || metres > 0.0 && is_separated(self.towards(other))
    }

    /// Returns about half the extent of the board along a unit vector, in metres.
    fn extent(&self, [x, y]: [f64; 2]) -> f64 {
        let [along, across] =
            [x * self.direction[0] + y * self.direction[1], x * self.direction[1] - y * self.direction[0]];
        self.half_length * along.abs() + self.half_width.hi * across.abs()
    }

    /// Returns the disc that holds the board at every moment of the step: its middle and its radius.
    pub fn disc(&self) -> ([f64; 2], f64) {
        (self.centre, self.radius)
    }

    /// Returns the board on the stage.
    pub fn placed(&self, inset: Interval, frame: &Frame) -> Self {
        Shape { inset, half_width: self.half_width }.board(
            frame.capsule(&self.front),
            frame.capsule(&self.rear),
            self.link,
        )
    }

    /// Returns the middle of the front handle's capsule.
    pub fn front_point(&self) -> [f64; 2] {
        self.front.point.map(Interval::middle)
    }

    /// Returns the board between the middles of its capsules.
    pub fn in_doubles(&self) -> Board {
        let [front, rear] = [self.front, self.rear].map(|capsule| Point::from(capsule.point.map(Interval::middle)));
        Board::from_handles(front, rear, (self.share * self.link).middle(), 2.0 * self.half_width.middle())
    }

    /// Returns true if the board is proved to be further than `metres` from the convex hull of some points, along a
    /// direction towards them.
    pub fn is_clear_along(&self, direction: [f64; 2], points: &[Point], metres: f64) -> bool {
        let axis = direction.map(Interval::point);
        let length = norm(axis);
        let most = self.support(axis, length.hi) + length * metres;
        points.iter().all(|point| most.is_below(dot(axis, [point.x, point.y].map(Interval::point))))
    }

    /// Returns the vector from this board to the nearest point of the other, by the middles of their capsules.
    fn towards(&self, other: &Self) -> [f64; 2] {
        let (from, to) = closest_points_board_board(&self.in_doubles(), &other.in_doubles());
        (to - from).into()
    }

    fn is_separated(&self, metres: f64, other: &Self, axis: Vector) -> bool {
        let towards = if dot(axis, minus(other.front.point, self.front.point)).middle()
            + dot(axis, minus(other.rear.point, self.rear.point)).middle()
            >= 0.0
        {
            axis
        } else {
            axis.map(std::ops::Neg::neg)
        };
        let back = towards.map(std::ops::Neg::neg);
        let size = norm(towards);
        let (length, gap) = (size.hi, size * metres);
        (self.support(towards, length) + other.support(back, length) + gap).is_negative()
    }

    /// Returns an upper bound of n . x over the board.
    fn support(&self, n: Vector, length: f64) -> Interval {
        let Self { front, rear, share, .. } = self;
        let ends = |capsule: &Capsule| {
            let (at, reach) = (dot(n, capsule.point), capsule.reach(n, length).hi);
            (at - Interval::point(reach), at + Interval::point(reach))
        };
        let ((front_least, front_most), (rear_least, rear_most)) = (ends(front), ends(rear));
        let beyond = Interval::ONE + *share;
        let axis = (beyond * front_most - *share * rear_least).max(beyond * rear_most - *share * front_least);
        let aside = |capsule: &Capsule| cross(n, capsule.tangent).abs() * capsule.half;
        let across = cross(n, minus(front.point, rear.point)).abs()
            + aside(front)
            + aside(rear)
            + Interval::point(length) * (Interval::point(front.radius) + Interval::point(rear.radius)).hi;
        axis + self.half_width * across.over(self.link).min(Interval::point(length))
    }

    /// Returns true if a point is proved to be in the board at every moment of the step: "Contact" in Lemma 5.
    pub fn holds(&self, point: Vector) -> bool {
        let Self { front, rear, .. } = self;
        let (from_rear, from_front) = (minus(point, rear.point), minus(point, front.point));
        let link = minus(front.point, rear.point);
        // Bounds of the product of a vector with the handle's distance from the middle of its capsule.
        let moved = |capsule: &Capsule, along: Interval, vector: Vector| {
            (along.abs() * capsule.half + norm(vector) * capsule.radius).hi
        };
        let slack = |capsule: &Capsule| Interval::point(capsule.half) + Interval::point(capsule.radius);
        let (of_front, of_rear) = (slack(front), slack(rear));
        let both = plus(from_rear, link);
        let off = Interval::point(moved(front, dot(from_rear, front.tangent), from_rear))
            + Interval::point(moved(rear, dot(both, rear.tangent), both))
            + of_rear * (of_rear + of_front).hi;
        let reach = dot(from_rear, link) + Interval::within(off.hi);
        let aside = Interval::point(moved(front, cross(from_rear, front.tangent), from_rear))
            + Interval::point(moved(rear, cross(from_front, rear.tangent), from_front))
            + of_rear * of_front.hi;
        let across = cross(from_rear, link) + Interval::within(aside.hi);
        let square = self.link.square();
        let (least, most) = (-(self.share * square), (Interval::ONE + self.share) * square);
        least.is_below(reach) && reach.is_below(most) && across.abs().is_below(self.link * self.half_width)
    }
}
