//! A board in doubles, by which [`super::first_order`] chooses directions and points. No proof depends on the choice.

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

    /// Returns the gap between this board and the ends of segments along a unit vector.
    pub fn gap_to(&self, segments: &[[[f64; 2]; 2]], n: [f64; 2]) -> f64 {
        let least = segments.iter().flatten().map(|end| dot(n, *end)).fold(f64::INFINITY, f64::min);
        let most = self.corners().into_iter().map(|corner| dot(n, corner)).fold(f64::NEG_INFINITY, f64::max);
        least - most
    }

    /// Returns the point of the board nearest to another point, by its parts along the board and to the left. The parts
    /// are shares of half its length and half its width, from -1 to 1.
    pub fn shares_of(&self, point: [f64; 2]) -> [f64; 2] {
        let [along, aside] = self.seen(minus(point, self.centre));
        [(along / self.half_length).clamp(-1.0, 1.0), (aside / self.half_width).clamp(-1.0, 1.0)]
    }

    /// Returns the nearest point of a segment to the board, as a share of the way along the segment. Returns also the
    /// vector from the board to that point.
    pub fn nearest_of([from, to]: [[f64; 2]; 2], board: &Self) -> (f64, [f64; 2]) {
        let along = minus(to, from);
        let at = |share: f64| [0, 1].map(|part| from[part] + share * along[part]);
        let of_corner = |corner: [f64; 2]| {
            let share = (dot(minus(corner, from), along) / dot(along, along)).clamp(0.0, 1.0);
            // A segment of one point.
            let share = if share.is_nan() { 0.0 } else { share };
            (share, minus(at(share), corner))
        };
        let of_end = |share: f64| {
            let ([x, y], [ahead, left]) = (board.axis, board.shares_of(at(share)));
            let (along, aside) = (ahead * board.half_length, left * board.half_width);
            let on_board = [board.centre[0] + along * x - aside * y, board.centre[1] + along * y + aside * x];
            (share, minus(at(share), on_board))
        };
        let all = board.corners().into_iter().map(of_corner).chain([0.0, 1.0].map(of_end));
        let square = |(_, by): &(f64, [f64; 2])| dot(*by, *by);
        all.min_by(|one, other| square(one).total_cmp(&square(other))).unwrap_or((0.0, [0.0; 2]))
    }

    /// Returns unit vectors along which segments may be apart from the board. The vectors lead to the nearest point of
    /// each segment, or are normals of each segment or of the board's sides.
    pub fn directions_to(&self, segments: &[[[f64; 2]; 2]]) -> Vec<[f64; 2]> {
        let [x, y] = self.axis;
        let mut directions = vec![[x, y], [-y, x], [-x, -y], [y, -x]];
        for [from, to] in segments {
            let [along_x, along_y] = minus(*to, *from);
            directions.extend([[-along_y, along_x], [along_y, -along_x], Self::nearest_of([*from, *to], self).1]);
        }
        let unit = |[x, y]: [f64; 2]| [x / x.hypot(y), y / x.hypot(y)];
        directions.into_iter().map(unit).filter(|n| n[0].is_finite() && n[1].is_finite()).collect()
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

    /// Returns the corner of this board and the side of another that are nearest to each other, by number. Returns also
    /// the share of the way along the side, from its first corner to the next, at which its nearest point is.
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
