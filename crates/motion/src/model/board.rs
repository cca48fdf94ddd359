//! The rectangle of a board, independent of team and path.

use super::{Point, Vector};

/// The rectangle of a board, as an oriented box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// The middle of the board.
    pub centre: Point,
    /// Unit direction along the board, from its rear handle to its front one.
    pub axis: Vector,
    /// Half the whole board's length, in metres.
    pub half_length: f64,
    /// Half the board's width, in metres.
    pub half_width: f64,
}

impl Board {
    /// Creates the board whose handles are at `front` and `rear`, two different points, with `hole_inset` metres of
    /// board beyond each and `width` metres across.
    pub fn from_handles(front: Point, rear: Point, hole_inset: f64, width: f64) -> Self {
        let along = front - rear;
        let link = along.dot(&along).sqrt();
        Self {
            centre: rear + 0.5 * along,
            axis: along / link,
            half_length: 0.5 * link + hole_inset,
            half_width: 0.5 * width,
        }
    }

    /// Creates the board whose front handle is at `front` and whose rear handle is `link` metres behind it against the
    /// unit `direction`. Far from the origin this keeps the direction's digits, which two handle points have lost.
    pub fn from_front(front: Point, direction: Vector, link: f64, hole_inset: f64, width: f64) -> Self {
        Self {
            centre: front - 0.5 * link * direction,
            axis: direction,
            half_length: 0.5 * link + hole_inset,
            half_width: 0.5 * width,
        }
    }

    /// Returns the board with `metres` more to each side: it holds the board wherever its points move by no more.
    pub fn grown(&self, metres: f64) -> Self {
        Self { half_length: self.half_length + metres, half_width: self.half_width + metres, ..*self }
    }

    /// Returns the unit direction across the board, a quarter turn counter-clockwise from its axis.
    pub fn across(&self) -> Vector {
        Vector::new(-self.axis.y, self.axis.x)
    }

    /// Returns the four corners counter-clockwise: front left, rear left, rear right, front right.
    pub fn corners(&self) -> [Point; 4] {
        self.corners_from_centre().map(|corner| self.centre + corner)
    }

    /// Returns the four corners as displacements from the centre, in the order of [`corners`](Self::corners).
    pub fn corners_from_centre(&self) -> [Vector; 4] {
        let along = self.half_length * self.axis;
        let across = self.half_width * self.across();
        [along + across, across - along, -along - across, along - across]
    }

    /// Returns the metres from the centre to a corner: the radius of the circle about the board.
    pub fn circle_radius(&self) -> f64 {
        (self.half_length * self.half_length + self.half_width * self.half_width).sqrt()
    }

    /// Returns the greatest displacement of a board's points per metre of displacement of its two handles.
    ///
    /// A point of the board is p = rear + s (front - rear) + w n with the unit normal n of the link. Here s is in
    /// [-inset / link, 1 + inset / link] and |w| <= width / 2. Let the handles' displacements u and v be at most D.
    /// They move the first two terms by |(1 - s) u + s v|. This is at most (|1 - s| + |s|) D <= (1 + 2 inset / link) D.
    /// The link keeps its length and its vector changes by at most 2 D. So its unit normal changes by at most 2 D /
    /// link, and the last term by at most (width / link) D.
    pub fn displacement_factor(link: f64, hole_inset: f64, width: f64) -> f64 {
        1.0 + 2.0 * hole_inset / link + width / link
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_board_of_a_three_four_five_triangle() {
        // Handles (4, 3) and (0, 0), half a link beyond each, 2 wide: corners computed by hand.
        let board = Board::from_handles(Point::new(4.0, 3.0), Point::origin(), 2.5, 2.0);
        let by_hand = [(5.4, 5.3), (-2.6, -0.7), (-1.4, -2.3), (6.6, 3.7)];
        for (corner, (x, y)) in board.corners().iter().zip(by_hand) {
            assert!((corner - Point::new(x, y)).norm() < 1e-14, "{corner}");
        }
        let same = Board::from_front(Point::new(4.0, 3.0), Vector::new(0.8, 0.6), 5.0, 2.5, 2.0);
        for (one, other) in board.corners().iter().zip(same.corners()) {
            assert!((one - other).norm() < 1e-14);
        }
    }

    proptest! {
        #[test]
        fn no_corner_moves_further_than_the_displacement_factor(
            link in 0.01..10.0f64, inset in 0.0..3.0f64, width in 0.01..3.0f64,
            heading in 0.0..6.3f64, turn in -3.2..3.2f64, x in -1.0..1.0f64, y in -1.0..1.0f64,
        ) {
            let board = |rear: Point, heading: f64| {
                let front = rear + link * Vector::new(heading.cos(), heading.sin());
                (front, rear, Board::from_handles(front, rear, inset, width))
            };
            let (front, rear, before) = board(Point::origin(), heading);
            let (moved_front, moved_rear, after) = board(Point::new(x, y), heading + turn);
            let most = (moved_front - front).norm().max((moved_rear - rear).norm());
            for (one, other) in before.corners().iter().zip(after.corners()) {
                prop_assert!((other - one).norm() <= Board::displacement_factor(link, inset, width) * most + 1e-12);
            }
        }
    }
}
