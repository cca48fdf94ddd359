//! Positions over a span, and the front and rear products of two spans (docs/proofs.md, "Capsules").

use super::curve::At;
use super::interval::{Interval, Vector};
use super::path::{Path, Span};
use super::placement::Mapping;

/// All places of a span: p(x) = p(m) + tau h t(m) + e, |tau| <= 1, |e| <= sag; |t(x) - t(m)| <= turn.
#[derive(Debug, Clone)]
pub(super) struct Capsule {
    pub span: Span,
    /// p(m).
    pub point: Vector,
    /// t(m).
    pub tangent: Vector,
    /// h: an upper bound of the metres from m to either end.
    pub half: Interval,
    /// K: an upper bound of the curvature over the span, 1/m.
    pub curvature: Interval,
    /// K h^2 / 2.
    pub sag: Interval,
    /// K h.
    pub turn: Interval,
}

impl Capsule {
    /// Creates the capsule of a span whose places are in order.
    pub fn new(path: &Path, span: Span) -> Self {
        let Span(lo, hi) = span;
        let middle = path.middle_of(span);
        let half = path.metres_bound(lo, middle).max(&path.metres_bound(middle, hi));
        let curvature = path.curvature_bound(lo, hi);
        let turn = (curvature * half).upper();
        let sag = (turn * half * Interval::new(0.5)).upper();
        let At { point, tangent } = path.at(middle);
        Self { span, point, tangent, half, curvature, sag, turn }
    }

    /// Returns the capsule on the stage.
    pub fn placed(&self, frame: &Mapping) -> Self {
        Self { point: frame.on_stage(&self.point), tangent: frame.turned(&self.tangent), ..self.clone() }
    }

    /// Returns the capsule moved back `metres` on a line.
    pub fn behind(&self, metres: &Interval) -> Self {
        Self { point: self.point.minus(&self.tangent.scaled(metres)), ..self.clone() }
    }
}

/// Two spans, of a front place u and a rear place x, and d = p(u) - p(x).
pub(super) struct Pair<'a> {
    pub front: &'a Capsule,
    pub rear: &'a Capsule,
    /// p(m_u) - p(m_x).
    middle: Vector,
    /// An upper bound of |d|.
    pub distance: Interval,
    /// An upper bound of the distance of d from p(m_u) - p(m_x), without the parts along both directions.
    sag: Interval,
    /// An upper bound of |t(m_u) . t(m_x)|.
    pub along: Interval,
}

impl<'a> Pair<'a> {
    pub fn new(front: &'a Capsule, rear: &'a Capsule) -> Self {
        let middle = front.point.minus(&rear.point);
        let distance = (middle.norm() + front.half + rear.half).upper();
        let along = front.tangent.dot(&rear.tangent).abs();
        Self { front, rear, middle, distance, sag: (front.sag + rear.sag).upper(), along }
    }

    /// Returns t . d for all tangents t of `of`. `of` and `other` are the two spans.
    fn product(&self, of: &Capsule, other: &Capsule) -> Interval {
        // |t(m) . V| is h for the capsule's own V, since t(m) is a unit vector.
        let slack = of.half + other.half * self.along + self.sag + of.turn * self.distance;
        of.tangent.dot(&self.middle) + slack.around_zero()
    }

    /// Returns n . d for all unit normals n to the left of `of`. `of` and `other` are the two spans.
    fn across(&self, of: &Capsule, other: &Capsule) -> Interval {
        let slack = other.half * of.tangent.cross(&other.tangent).abs() + self.sag + of.turn * self.distance;
        of.tangent.cross(&self.middle) + slack.around_zero()
    }

    /// Returns n(u) . d, n being the unit normal to the left.
    pub fn front_across(&self) -> Interval {
        self.across(self.front, self.rear)
    }

    /// Returns n(x) . d.
    pub fn rear_across(&self) -> Interval {
        self.across(self.rear, self.front)
    }

    /// Returns the front product f(u, x) = t(u) . d.
    pub fn front_product(&self) -> Interval {
        self.product(self.front, self.rear)
    }

    /// Returns the rear product g(u, x) = t(x) . d.
    pub fn rear_product(&self) -> Interval {
        self.product(self.rear, self.front)
    }

    /// Returns g(u, x) by Taylor's formula of the second order along the rear's span. With a junction in the span the
    /// result is 0, which proves no product positive.
    pub fn second_order_rear_product(&self, path: &Path) -> Interval {
        let Self { front, rear, middle, distance, .. } = self;
        let place = path.middle_of(rear.span);
        let Some(rate) = path.bend_rate(rear.span) else { return Interval::new(0.0) };
        let bend = path.bend(Span(place, place));
        let across = rear.tangent.cross(&front.tangent).abs() * front.half + front.sag;
        let along = self.along * front.half + front.sag;
        let slope = (bend * rear.tangent.cross(middle) - Interval::new(1.0)).abs() + bend.abs() * across;
        let second = (rate.abs() + rear.curvature.square()) * distance * Interval::new(0.5);
        let slack = along + (slope + second * rear.half) * rear.half;
        rear.tangent.dot(middle) + slack.around_zero()
    }
}
