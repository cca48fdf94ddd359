//! Speeds over one step of the head: enclosures of the ratio of every handle's speed to the head's. See "Lemma 7" in
//! `docs/proofs.md`. In: two places of the head. Out: bounds.

use super::super::capsule::{Capsule, Spanned};
use super::super::grid::{GridPoint, param, span};
use super::super::interval::{Interval, cross, dot, minus, norm, scaled};
use super::super::link::follower_within;
use super::super::place::{Place, Span};
use super::super::step::Chain;
use bench_dragon_motion::linkage::follower;

/// Pads of the span of the follower of one place, in units in the last place, tried in this order.
const PADS: [f64; 4] = [4.0, 64.0, 1024.0, 16384.0];

/// The number of times that the bounds of a link's ratio are narrowed by the bounds of its rate.
const ROUNDS: usize = 2;

/// The ratio of a handle's speed to the head's.
#[derive(Debug, Clone, Copy)]
pub(super) struct Speed {
    /// The ratio with the head anywhere in the step.
    pub ratio: Interval,
    /// The rate of the ratio, per metre of the head.
    rate: Interval,
}

/// A handle's speed with the head at one place.
#[derive(Debug, Clone, Copy)]
struct SpeedSample {
    speed: Interval,
    /// The ratio of the next handle's speed to this handle's.
    link: Interval,
    /// The rate of that ratio, per metre of this handle.
    link_rate: Interval,
}

/// The bounds that are proved for a step.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    /// An upper bound of the ratio of every handle anywhere in the step.
    pub upper: f64,
    /// The fastest handle with the head at the middle, and its ratio there.
    pub fastest: usize,
    pub speed: Interval,
    /// The number of handles that were enclosed.
    pub handles: u64,
}

/// Speeds of a team on a path.
pub(super) struct Speeds<'a> {
    pub chain: Chain<'a>,
}

impl Speeds<'_> {
    /// Returns the bounds over a step between two grid points, or `None` if they cannot be enclosed.
    pub fn over(&self, from: &mut GridPoint, middle: &mut GridPoint, to: &mut GridPoint) -> Option<Bounds> {
        let exact = &self.chain.exact;
        if !(exact.in_order(from.head, middle.head) && exact.in_order(middle.head, to.head)) {
            return None;
        }
        let wide = self.chain.spans_until(from, to, |handles| self.is_enough(handles))?;
        let mut same = middle.clone();
        let thin = self.chain.spans_until(middle, &mut same, |handles| handles.len() >= wide.len())?;
        let samples = self.samples(&thin)?;
        let greatest =
            |one: (usize, Interval), other: (usize, Interval)| if other.1.lo > one.1.lo { other } else { one };
        let speeds = samples.iter().map(|sample| sample.speed.abs()).enumerate();
        let (fastest, speed) = speeds.reduce(greatest)?;
        let half = exact.length(from.head, middle.head).max(exact.length(middle.head, to.head));
        let upper = self.greatest(&wide, &samples, half).unwrap_or(f64::INFINITY);
        let handles = (thin.len() + wide.len()) as u64;
        Some(Bounds { upper, fastest, speed, handles })
    }

    /// Returns true if no handle behind the last one can be faster than it.
    pub fn is_enough(&self, handles: &[Spanned]) -> bool {
        let (last, benches) = (handles.len() - 1, self.chain.team.benches);
        let Place(segment, at, _) = handles[last].span.1;
        if last == benches {
            return true;
        }
        if segment > 0 {
            return false;
        }
        let [head, body, tail] = self.chain.links;
        let behind = body.max(tail);
        let longest = if last == 0 { head.max(behind) } else { behind };
        self.chain.exact.segments[0].curve.slows_followers(at, longest)
    }

    /// Returns the handles' speeds with the head at one place, from spans as narrow as rounding allows.
    fn samples(&self, thin: &[Spanned]) -> Option<Vec<SpeedSample>> {
        let mut speed = Interval::ONE;
        let mut samples = Vec::with_capacity(thin.len());
        for (link, pair) in thin.windows(2).enumerate() {
            let [front, rear] = pair else { return None };
            if self.is_rigid(front, rear) {
                samples.push(SpeedSample { speed, link: Interval::ONE, link_rate: Interval::ZERO });
                continue;
            }
            let rear_cosine = front.capsule.product(&rear.capsule, true).lo / self.chain.link(link).hi;
            let ratio = self.ratio_at(front.capsule.middle, link, rear_cosine)?;
            let crude = product_ratio(&front.capsule, &rear.capsule);
            let rate = self.rate(front, rear, crude);
            let ratio = ratio + Interval::within(front.capsule.half) * rate;
            samples.push(SpeedSample { speed, link: ratio, link_rate: rate });
            speed = speed * ratio;
        }
        samples.push(SpeedSample { speed, link: Interval::ONE, link_rate: Interval::ZERO });
        Some(samples)
    }

    /// Returns the ratio of the rear handle's speed to the front's, with the front at one place. An approximate rear
    /// cosine suffices.
    fn ratio_at(&self, front: Place, link: usize, rear_cosine: f64) -> Option<Interval> {
        let Chain { path, exact, team, .. } = &self.chain;
        let rear = follower(path, param(front), team.link(link)).ok()?;
        let front = Spanned::new(exact, Span(front, front));
        let turned = exact.curve(front.span.0).polar_angle(front.span.0.1);
        let length = self.chain.link(link);
        let size = length.hi + (front.first[0].magnitude() + front.first[1].magnitude()) * (1.0 + 0.1 * turned);
        PADS.iter().find_map(|pad| {
            let rear =
                Spanned::new(exact, span(exact, rear, rear, pad * f64::EPSILON * size / rear_cosine.max(1e-12), false));
            follower_within(exact, &front, &rear, length, self.chain.branches_of(link))?;
            Some(product_ratio(&front.capsule, &rear.capsule))
        })
    }

    /// Returns true if two handles are on one line or one circle throughout the step.
    fn is_rigid(&self, front: &Spanned, rear: &Spanned) -> bool {
        let segment = rear.span.0.0;
        let curve = &self.chain.exact.segments[segment].curve;
        segment == front.span.1.0 && curve.has_constant_curvature()
    }

    /// Returns the rate of the ratio of the rear handle's speed to the front's, per metre of the front.
    fn rate(&self, front: &Spanned, rear: &Spanned, ratio: Interval) -> Interval {
        let (u, x) = (&front.capsule, &rear.capsule);
        let bend = |span: Span| self.chain.exact.bend(span.0, span.1);
        let middle = Interval::point(ratio.middle());
        let apart = norm(minus(u.tangent, scaled(x.tangent, middle)));
        let off = u.turned() + x.turned() * middle.magnitude() + (ratio - middle).abs();
        let apart = apart + Interval::within(off.hi);
        let bends = bend(front.span) * u.across(x, false) - ratio.square() * bend(rear.span) * u.across(x, true);
        (apart.square() + bends).over(u.product(x, true))
    }

    /// Returns the rate of that rate, per metre of the front; `None` if a handle passes from one segment to another.
    fn rate_of_rate(&self, front: &Spanned, rear: &Spanned, ratio: Interval, rate: Interval) -> Option<Interval> {
        let (u, x) = (&front.capsule, &rear.capsule);
        let exact = &self.chain.exact;
        let bend = |span: Span| exact.bend(span.0, span.1);
        let bend_rate = |span: Span| exact.bend_rate(span.0, span.1);
        let (front_rate, rear_rate) = (bend_rate(front.span)?, bend_rate(rear.span)?);
        let (front_bend, rear_bend) = (bend(front.span), ratio * bend(rear.span));
        let (front_across, rear_across) = (u.across(x, false), u.across(x, true));
        let turned = Interval::within((u.turned() + x.turned()).hi);
        let (sine, cosine) = (cross(x.tangent, u.tangent) + turned, dot(x.tangent, u.tangent) + turned);
        let change = rate * 3.0 * (ratio - cosine - rear_bend * rear_across)
            + (front_bend - rear_bend) * (ratio * 3.0 * sine - u.product(x, false) * (front_bend + rear_bend))
            + front_rate * front_across
            - ratio * ratio.square() * rear_rate * rear_across;
        Some(change.over(u.product(x, true)))
    }

    /// Returns an upper bound of the greatest ratio of any handle over the step.
    fn greatest(&self, wide: &[Spanned], samples: &[SpeedSample], half: f64) -> Option<f64> {
        let mut front = Speed { ratio: Interval::ONE, rate: Interval::ZERO };
        let mut greatest = 1.0f64;
        for (link, pair) in wide.windows(2).enumerate() {
            let [ahead, behind] = pair else { return None };
            if self.is_rigid(ahead, behind) {
                // The checker divides by the rear product of a rigid link too.
                if ahead.capsule.product(&behind.capsule, true).lo <= 0.0 {
                    return None;
                }
                continue;
            }
            let (sample, rear) = (samples[link], samples[link + 1]);
            let moved = (Interval::point(half) * front.ratio.magnitude()).hi.min(2.0 * ahead.capsule.half);
            let mut ratio = product_ratio(&ahead.capsule, &behind.capsule);
            let mut rate = Interval::ZERO;
            for _ in 0..ROUNDS {
                rate = self.rate(ahead, behind, ratio);
                if let Some(change) = self.rate_of_rate(ahead, behind, ratio, rate) {
                    rate = intersection(rate, sample.link_rate + Interval::within(moved) * change)?;
                }
                ratio = intersection(ratio, sample.link + Interval::within(moved) * rate)?;
            }
            let rate = front.rate * ratio + front.ratio.square() * rate;
            let ratio = intersection(front.ratio * ratio, rear.speed + Interval::within(half) * rate)?;
            front = Speed { ratio, rate };
            // Also true for NaN.
            if !ratio.magnitude().is_finite() {
                return None;
            }
            greatest = greatest.max(ratio.magnitude());
        }
        Some(greatest)
    }
}

/// Returns the front product divided by the rear product, over two spans.
fn product_ratio(front: &Capsule, rear: &Capsule) -> Interval {
    front.product(rear, false).over(front.product(rear, true))
}

/// Returns the intersection of two enclosures of one number; `None` if it is empty.
fn intersection(one: Interval, other: Interval) -> Option<Interval> {
    let (lo, hi) = (one.lo.max(other.lo), one.hi.min(other.hi));
    (lo <= hi).then_some(Interval { lo, hi })
}
