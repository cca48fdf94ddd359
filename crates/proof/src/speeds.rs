//! Speeds of the handles over a step of the head: Lemma 7 of docs/proofs.md.

use super::capsule::{Capsule, Pair};
use super::chain::Chain;
use super::first_order::FirstOrder;
use super::handle::Handle;
use super::interval::Interval;
use super::path::{Place, Span};
use super::problem::{Checked, problem};
use super::scene::Scene;

/// The number of times that the bounds of a link's ratio are narrowed by the bounds of its rate.
const ROUNDS: usize = 2;

/// Ratios of speeds to the head's.
pub(super) struct Speeds {
    /// A number that no handle's ratio exceeds anywhere in the step.
    pub most: Interval,
    /// The ratio of each listed handle with the head at its place in `at`.
    pub at_place: Vec<Interval>,
}

impl Speeds {
    /// Encloses the speeds of all handles. `at` has a place of each listed handle's span, the head's first. Returns the
    /// number of links too.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn new(scene: &Scene, head: Span, spans: &[Span], at: &[Place]) -> Checked<(Self, u64)> {
        let chain = Chain::check(scene, head, spans)?;
        check_tail(scene, &chain)?;
        let FirstOrder { handles, half_step } = FirstOrder::new(scene, &chain, at)?;
        let one = Interval::new(1.0);
        let (mut most, mut at_place) = (one, vec![one]);
        // The ratio of the front handle over the step and its change per metre of the head.
        let (mut ratio, mut rate) = (one, Interval::new(0.0));
        for (index, pair) in chain.capsules.windows(2).enumerate() {
            let at_front = at_place[index];
            if is_rigid(scene, &pair[0], &pair[1]) {
                at_place.push(at_front);
                continue;
            }
            let reach = (half_step * ratio.abs()).min(&(pair[0].half * Interval::new(2.0))).upper();
            let places = [(at[index], &handles[index]), (at[index + 1], &handles[index + 1])];
            let of_link = Link::new(scene, (&pair[0], &pair[1]), places, index);
            let (link, link_rate, link_at_place) = of_link.over(scene, &reach);
            let at_rear = at_front * link_at_place;
            rate = rate * link + ratio.square() * link_rate;
            ratio = (ratio * link).meet(&(at_rear + (half_step * rate.abs()).around_zero()));
            most = most.max(&ratio.abs());
            at_place.push(at_rear);
        }
        Ok((Self { most: most.upper(), at_place }, chain.products.len() as u64))
    }
}

/// Checks that no handle behind the last listed one can be faster (Lemma 7, *Tail*).
fn check_tail(scene: &Scene, chain: &Chain) -> Checked {
    let team = &scene.team;
    if chain.last() == team.benches || chain.ends_on_line(scene) {
        return Ok(());
    }
    let Span(_, latest) = chain.capsules[chain.last()].span;
    let [behind, _] = team.behind_head();
    let longest = if chain.last() == 0 { team.link(0).max(&behind) } else { behind };
    let is_slower = latest.0 == 0
        && scene.path.spiral_radius(latest).is_some_and(|radius| {
            let square = latest.coordinate().square();
            let turned = longest * (square + Interval::new(2.0));
            turned.is_at_most(&(Interval::new(2.0) * radius * (square + Interval::new(1.0))))
        });
    if is_slower { Ok(()) } else { Err(problem!("a handle behind the last one listed may be faster (Lemma 7)")) }
}

/// Returns true if both handles are on one line or one circle throughout (Lemma 7, *Rigid*).
fn is_rigid(scene: &Scene, front: &Capsule, rear: &Capsule) -> bool {
    let segment = rear.span.0.0;
    segment == front.span.1.0 && (scene.path.is_line(segment) || scene.path.is_arc(segment))
}

/// A link over the spans of its handles, and at the place of its front handle.
struct Link<'a> {
    front: &'a Capsule,
    rear: &'a Capsule,
    /// f, g, A / k_u and B / k_x over both spans.
    f: Interval,
    g: Interval,
    front_across: Interval,
    rear_across: Interval,
    /// The signed curvatures.
    front_bend: Interval,
    rear_bend: Interval,
    /// r and r' with the front handle at its place, r' only where neither span has a junction.
    at_place: Interval,
    rate_at_place: Interval,
    /// The travel of the front handle from its place at tau = 0, in metres.
    offset: Interval,
}

impl<'a> Link<'a> {
    fn new(
        scene: &Scene,
        (front, rear): (&'a Capsule, &'a Capsule),
        [(u_place, u), (x_place, x)]: [(Place, &Handle); 2],
        index: usize,
    ) -> Self {
        let (pair, link) = (Pair::new(front, rear), scene.team.link(index));
        let (f, g) = (pair.front_product(), pair.rear_product());
        let (front_bend, rear_bend) = (scene.path.bend(front.span), scene.path.bend(rear.span));
        // The follower of the place u is within `off` metres of the place x, and its tangent within `turn`.
        let between = u.point.minus(&x.point);
        let off = ((between.norm_squared() - link.square()).abs() / (g * Interval::new(2.0))).upper();
        let turn = rear.curvature * off;
        let near = |product: Interval| product + (off + turn * (link + off)).around_zero();
        let (f_there, g_there) = (near(u.tangent.dot(&between)), near(x.tangent.dot(&between)));
        let at_place = f_there / g_there;
        let (u_normal, x_normal) = (u.tangent.turned_left(), x.tangent.turned_left());
        let (u_across, x_across) = (near(u_normal.dot(&between)), near(x_normal.dot(&between)));
        let apart = u.tangent.minus(&x.tangent.scaled(&at_place)).norm() + (at_place.abs() * turn).around_zero();
        let u_bend = scene.path.bend(Span(u_place, u_place));
        // The curvature where the follower of u is, beside x: anywhere in the span.
        let x_bend = scene
            .path
            .bend_rate(rear.span)
            .map_or(rear_bend, |rate| scene.path.bend(Span(x_place, x_place)) + (rate.abs() * off).around_zero());
        let bends = u_bend * u_across - at_place.square() * x_bend * x_across;
        Self {
            front,
            rear,
            f,
            g,
            front_across: pair.front_across(),
            rear_across: pair.rear_across(),
            front_bend,
            rear_bend,
            at_place,
            rate_at_place: (apart.square() + bends) / g_there,
            offset: u.offset,
        }
    }

    /// Returns r and r' over the step, and r at tau = 0. The front handle is at most `reach` metres from where it is at
    /// tau = 0.
    fn over(&self, scene: &Scene, reach: &Interval) -> (Interval, Interval, Interval) {
        let mut ratio = self.f / self.g;
        let mut rate = ratio;
        let reach = reach + self.offset;
        for _ in 0..ROUNDS {
            rate = self.rate(&ratio);
            if let Some(change) = self.change(scene, &ratio, &rate) {
                rate = rate.meet(&(self.rate_at_place + (reach * change.abs()).around_zero()));
            }
            ratio = ratio.meet(&(self.at_place + (reach * rate.abs()).around_zero()));
        }
        let at_middle = ratio.meet(&(self.at_place + (self.offset * rate.abs()).around_zero()));
        (ratio, rate, at_middle)
    }

    /// Returns r' over both spans.
    fn rate(&self, ratio: &Interval) -> Interval {
        let (u, x) = (self.front, self.rear);
        let middle = Interval::new(ratio.rough());
        let off = u.turn + x.turn * middle.abs() + (ratio - middle).abs();
        let apart = u.tangent.minus(&x.tangent.scaled(&middle)).norm() + off.around_zero();
        let bends = self.front_bend * self.front_across - ratio.square() * self.rear_bend * self.rear_across;
        (apart.square() + bends) / self.g
    }

    /// Returns r'' over both spans; `None` if one of them has a junction.
    fn change(&self, scene: &Scene, ratio: &Interval, rate: &Interval) -> Option<Interval> {
        let (u, x) = (self.front, self.rear);
        let (front_rate, rear_rate) = (scene.path.bend_rate(u.span)?, scene.path.bend_rate(x.span)?);
        let three = Interval::new(3.0);
        let turned = (u.turn + x.turn).around_zero();
        let (sine, cosine) = (x.tangent.cross(&u.tangent) + turned, x.tangent.dot(&u.tangent) + turned);
        let (front_bend, rear_bend) = (self.front_bend, ratio * self.rear_bend);
        let change = rate * three * (ratio - cosine - rear_bend * self.rear_across)
            + (front_bend - rear_bend) * (ratio * three * sine - self.f * (front_bend + rear_bend))
            + front_rate * self.front_across
            - ratio * ratio.square() * rear_rate * self.rear_across;
        Some(change / self.g)
    }
}
