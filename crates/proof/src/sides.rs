//! A board in doubles. [`super::first_order`] chooses directions and points with it; no proof depends on the choice.

/// A board at one moment.
pub(super) struct Sides {
    centre: [f64; 2],
    /// The unit vector along the board.
    axis: [f64; 2],
    half_length: f64,
    half_width: f64,
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

impl Sides {
    /// Creates a board between its handles.
    pub fn new(front: [f64; 2], rear: [f64; 2], half_length: f64, half_width: f64) -> Self {
        let along = minus(front, rear);
        let length = along[0].hypot(along[1]);
        let centre = [0, 1].map(|part| (front[part] + rear[part]) / 2.0);
        Self { centre, axis: along.map(|part| part / length), half_length, half_width }
    }

    /// Returns a vector's parts along the board and to the left.
    pub fn seen(&self, vector: [f64; 2]) -> [f64; 2] {
        [dot(self.axis, vector), self.axis[0] * vector[1] - self.axis[1] * vector[0]]
    }

    /// Returns the corners, each beside the next.
    fn corners(&self) -> [[f64; 2]; 4] {
        let ([x, y], [along, aside]) = (self.axis, [self.half_length, self.half_width]);
        [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]].map(|[ahead, left]| {
            let (along, aside) = (along * ahead, aside * left);
            [self.centre[0] + along * x - aside * y, self.centre[1] + along * y + aside * x]
        })
    }

    /// Returns the gap between this board and another along a direction fixed to this board.
    pub fn gap(&self, other: &Self, [ahead, left]: [f64; 2]) -> f64 {
        let reach = |corner: [f64; 2]| dot([ahead, left], self.seen(minus(corner, self.centre)));
        let least = other.corners().map(reach).into_iter().fold(f64::INFINITY, f64::min);
        (least - self.half_length * ahead.abs() - self.half_width * left.abs()) / ahead.hypot(left)
    }

    /// Returns the vector between the nearest points of both boards, which are apart.
    pub fn to_nearest(&self, other: &Self) -> [f64; 2] {
        let between = |own: &Self, its: &Self| {
            let (corner, side, share) = own.nearest_point(its);
            let (from, to) = (its.corners()[side], its.corners()[(side + 1) % 4]);
            let point = [0, 1].map(|part| from[part] + share * (to[part] - from[part]));
            minus(point, own.corners()[corner])
        };
        let (there, back) = (between(self, other), between(other, self));
        if dot(there, there) <= dot(back, back) { there } else { back.map(std::ops::Neg::neg) }
    }

    /// Returns the corner of this board and the side of another that are nearest to each other, by number, and the
    /// nearest point of the side: its share of the way from the side's first corner to the next, from 0 to 1.
    pub fn nearest_point(&self, other: &Self) -> (usize, usize, f64) {
        let (own, its) = (self.corners(), other.corners());
        let pairs = (0..4).flat_map(|corner| (0..4).map(move |side| (corner, side)));
        let nearest = pairs.map(|(corner, side)| {
            let (from, along) = (its[side], minus(its[(side + 1) % 4], its[side]));
            let share = (dot(minus(own[corner], from), along) / dot(along, along)).clamp(0.0, 1.0);
            let apart = minus(own[corner], [0, 1].map(|part| from[part] + share * along[part]));
            (dot(apart, apart), (corner, side, share))
        });
        nearest.min_by(|a, b| a.0.total_cmp(&b.0)).map_or((0, 0, 0.0), |(_, nearest)| nearest)
    }
}
