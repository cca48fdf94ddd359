//! The board of a bench: a rectangle anywhere on the stage, in any direction.
//!
//! The events and the clearance construct it from a handle's point and a bench's direction.

use super::{Point, Vector};

/// A rectangle: its centre, the unit direction of its long axis, and half its length and width. Metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// The middle of the board.
    pub centre: Point,
    /// The unit direction of the axis through both handles.
    pub axis: Vector,
    /// Half the length along the axis.
    pub half_length: f64,
    /// Half the width across it.
    pub half_width: f64,
}

impl Board {
    /// The board whose front handle is at `front` and whose unit direction, from the rear handle to the front one, is
    /// `direction`: `link` metres between the handles and `hole_inset` more beyond each, `width` across.
    pub fn from_front(front: Point, direction: Vector, link: f64, hole_inset: f64, width: f64) -> Self {
        Self {
            centre: front - direction * (0.5 * link),
            axis: direction,
            half_length: 0.5 * link + hole_inset,
            half_width: 0.5 * width,
        }
    }

    /// The unit direction across the board, a quarter turn to the left of its axis.
    pub fn normal(&self) -> Vector {
        Vector::new(-self.axis.y, self.axis.x)
    }

    /// The radius of the circle about the centre that the board just fits in.
    pub fn radius(&self) -> f64 {
        self.half_length.hypot(self.half_width)
    }

    /// The four corners, counter-clockwise, the front left one first.
    pub fn corners(&self) -> [Point; 4] {
        let (along, across) = (self.axis * self.half_length, self.normal() * self.half_width);
        [
            self.centre + along + across,
            self.centre - along + across,
            self.centre - along - across,
            self.centre + along - across,
        ]
    }

    /// A bound from below on the clearance of two boards, from the circles they fit in. Cheap.
    pub fn least_distance(&self, other: &Self) -> f64 {
        (self.centre - other.centre).norm() - self.radius() - other.radius()
    }

    /// How many metres any point of a board can move at most for each metre that its handles do.
    ///
    /// A point at p = h + u (h' - h) + w n, h and h' being the handles, moves by (1 - u) dh + u dh' + w dn. With both
    /// handles moving at most D: |(1 - u) dh + u dh'| <= (|1 - u| + |u|) D <= (1 + 2 inset/link) D, for u from
    /// -inset/link to 1 + inset/link; and |w dn| <= width/2 * 2 D/link, n being a quarter turn from (h - h')/link.
    pub fn reach(link: f64, hole_inset: f64, width: f64) -> f64 {
        1.0 + (2.0 * hole_inset + width) / link
    }
}
