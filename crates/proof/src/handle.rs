//! A first-order enclosure of a handle over a step: Lemma 6 of docs/proofs.md.

use super::capsule::{Capsule, Pair};
use super::curve::At;
use super::interval::{Interval, Vector};
use super::placement::Mapping;

/// The number of times that the products of a link are enclosed again from the enclosure of its rear handle.
const ROUNDS: usize = 3;

/// A handle: `point` + tau `velocity`, and an error. For two dragons tau is a time, so rates are in metres per second.
#[derive(Debug, Clone)]
pub(super) struct Handle {
    /// p(m), t(m).
    pub point: Vector,
    pub tangent: Vector,
    /// K of the handle's span.
    curvature: Interval,
    /// P: metres of the handle per metre of the head, anywhere in the step.
    pub rate: Interval,
    pub velocity: Vector,
    /// d: an upper bound of the metres from m to the handle at tau = 0.
    pub offset: Interval,
    /// Upper bounds of the error at tau = 0 and anywhere in the step.
    still: Interval,
    error: Interval,
}

/// The moments of a step for which a statement holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum When {
    /// tau = 0.
    Middle,
    Always,
}

impl Handle {
    pub fn new(
        At { point, tangent }: At,
        capsule: &Capsule,
        rate: Interval,
        offset: Interval,
        half_step: &Interval,
    ) -> Self {
        let curvature = capsule.curvature;
        let zero = Interval::new(0.0);
        let handle = Self { point, tangent, curvature, rate, velocity: tangent, offset, still: zero, error: zero };
        handle.with_rate(rate, half_step)
    }

    /// Returns the handle with another enclosure of P.
    fn with_rate(self, rate: Interval, half_step: &Interval) -> Self {
        let middle = Interval::new(rate.rough());
        let uneven = (rate - middle).abs();
        let bend = |metres: Interval| self.curvature * metres.square() * Interval::new(0.5);
        let still = (self.offset + bend(self.offset)).upper();
        let error = (self.offset + half_step * uneven + bend(self.offset + half_step * rate.abs())).upper();
        Self { rate, velocity: self.tangent.scaled(&middle), still, error, ..self }
    }

    /// Returns the next handle, near the place with this point and tangent at tau = 0.
    pub fn follower(&self, at: At, (front, rear): (&Capsule, &Capsule), link: &Interval, half_step: &Interval) -> Self {
        let pair = Pair::new(front, rear);
        let (mut f, mut g) = (pair.front_product(), pair.rear_product());
        let miss = (self.point.minus(&at.point).norm_squared() - link.square()).abs() * Interval::new(0.5);
        let offset = ((miss + f.abs() * self.offset) / g).upper();
        let mut rear = Self::new(at, rear, self.rate * (f / g), offset, half_step);
        for _ in 0..ROUNDS {
            f = f.meet(&self.product(self, &rear, link, half_step));
            g = g.meet(&rear.product(self, &rear, link, half_step));
            rear = rear.with_rate(self.rate * (f / g), half_step);
        }
        rear
    }

    /// Returns t . (front - rear) over the step, t the tangent at this handle, which is one of the two.
    fn product(&self, front: &Self, rear: &Self, link: &Interval, half_step: &Interval) -> Interval {
        let (at, by) = (front.point.minus(&rear.point), front.velocity.minus(&rear.velocity));
        let error = front.error + rear.error;
        let tau = half_step.around_zero();
        let turn = self.turn(half_step);
        let aside = (self.tangent.cross(&at) + self.tangent.cross(&by) * tau).abs() + error;
        let slack = error + turn * aside + turn.square() * link * Interval::new(0.5);
        self.tangent.dot(&at) + self.tangent.dot(&by) * tau + slack.around_zero()
    }

    /// Returns b: an upper bound of the angle between the handle's tangent and t(m).
    pub fn turn(&self, half_step: &Interval) -> Interval {
        self.curvature * (self.offset + half_step * self.rate.abs())
    }

    /// Returns the handle moved back on its straight line.
    pub fn behind(&self, metres: &Interval) -> Self {
        Self { point: self.point.minus(&self.tangent.scaled(metres)), ..self.clone() }
    }

    pub fn error(&self, when: When) -> Interval {
        if when == When::Middle { self.still } else { self.error }
    }

    /// Returns the handle on the stage.
    pub fn placed(&self, frame: &Mapping) -> Self {
        let Self { point, tangent, velocity, .. } = self;
        let (tangent, velocity) = (frame.turned(tangent), frame.turned(velocity));
        Self { point: frame.on_stage(point), tangent, velocity, ..self.clone() }
    }
}
