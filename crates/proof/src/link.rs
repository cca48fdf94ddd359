//! A link over spans: Lemma 1 of docs/proofs.md.

use super::capsule::{Capsule, Pair};
use super::elementary;
use super::interval::{Interval, Vector};
use super::path::{Path, Place, Span};

/// Limit of stretches of the path that are tested for one link: some seconds. A certificate that the search has written
/// needs a few.
pub(super) const MOST_STRETCHES: usize = 100_000;

/// Checks Lemma 1: for each place of `front`, the follower lies in `rear` and is continuous. Returns the front product.
///
/// # Errors
/// The condition that is not proved.
pub(super) fn check(path: &Path, front: &Capsule, rear: &Capsule, link: &Interval) -> Result<Interval, String> {
    let (Span(u1, u2), Span(x1, x2)) = (front.span, rear.span);
    if !path.in_order(x2, u1) {
        return Err("the rear's span is not behind the front's".to_owned());
    }
    let pair = Pair::new(front, rear);
    if !pair.rear_product().is_positive() {
        return Err("the rear product may be 0".to_owned());
    }
    let product = pair.front_product();
    let squared = link.square();
    let distance = |u: Place, x: Place| path.at(u).point.minus(&path.at(x).point).norm_squared();
    let (longest, shortest) = if product.is_positive() {
        (distance(u1, x1), distance(u2, x2))
    } else if product.is_negative() {
        (distance(u2, x1), distance(u1, x2))
    } else {
        (over_front(front, &path.at(x1).point), over_front(front, &path.at(x2).point))
    };
    if !squared.is_below(&longest) {
        return Err("the earliest place of the rear may be too near".to_owned());
    }
    if !shortest.is_below(&squared) {
        return Err("the latest place of the rear may be too far".to_owned());
    }
    let mut stretches = MOST_STRETCHES;
    if is_nearer(path, front, Span(x2, u2), &squared, &mut stretches) {
        Ok(product)
    } else {
        Err("a place between the handles may be at the link's length".to_owned())
    }
}

/// Returns D(u, x) for all u of the span, by Taylor's formula about m_u.
fn over_front(front: &Capsule, x: &Vector) -> Interval {
    let from = front.point.minus(x);
    let distance = from.norm() + &front.half;
    let slope = front.tangent.dot(&from).abs();
    from.norm_squared() + slack(front, &slope, &distance).around_zero()
}

/// Returns true if D(u, x) > l^2 for all u of the front.
pub(super) fn is_farther(path: &Path, front: &Capsule, x: Place, squared: &Interval) -> bool {
    squared.is_below(&over_front(front, &path.at(x).point))
}

/// Returns 2 |slope| h + (1 + K |d|) h^2.
fn slack(capsule: &Capsule, slope: &Interval, distance: &Interval) -> Interval {
    let Capsule { half, curvature, .. } = capsule;
    (Interval::new(2.0) * slope + (Interval::new(1.0) + curvature * distance) * half) * half
}

/// Returns true if D(u, x) < l^2 for all u of the front and all x of a stretch, by Taylor's formula about the middles
/// of both.
fn is_stretch_nearer(pair: &Pair, squared: &Interval) -> bool {
    let Pair { front, rear, distance, .. } = pair;
    // An upper bound of |g(u, m_x)| for all u of the front.
    let slope = rear.tangent.dot(&front.point.minus(&rear.point)).abs() + &front.half * &pair.along + &front.sag;
    (over_front(front, &rear.point) + slack(rear, &slope, distance)).is_below(squared)
}

/// Returns true if D < l^2 for all places of the front and of the span, which is halved while stretches are `left`.
pub(super) fn is_all_nearer(path: &Path, front: &Capsule, span: Span, squared: &Interval, left: &mut usize) -> bool {
    if !is_one_left(left) {
        return false;
    }
    let stretch = Capsule::new(path, span);
    is_stretch_nearer(&Pair::new(front, &stretch), squared)
        || halves(path, span)
            .is_some_and(|halves| halves.into_iter().all(|half| is_all_nearer(path, front, half, squared, left)))
}

/// Returns true if *Nearer* holds: D < l^2 for all u of the front and all places of the span up to u. Precondition: it
/// holds at the span's beginning.
fn is_nearer(path: &Path, front: &Capsule, span: Span, squared: &Interval, left: &mut usize) -> bool {
    if !is_one_left(left) {
        return false;
    }
    // Kind (a), for the whole rest at once.
    if path.turning_bound(span.0, front.span.1).is_below(elementary::quarter_turn()) {
        return true;
    }
    let stretch = Capsule::new(path, span);
    let pair = Pair::new(front, &stretch);
    // Kind (b), or kind (a).
    is_stretch_nearer(&pair, squared)
        || pair.rear_product().is_positive()
        || halves(path, span)
            .is_some_and(|halves| halves.into_iter().all(|half| is_nearer(path, front, half, squared, left)))
}

/// Takes one of the stretches that are left. Returns false if there is none.
fn is_one_left(left: &mut usize) -> bool {
    let is_one = *left > 0;
    *left = left.saturating_sub(1);
    is_one
}

/// Returns the two halves of a span.
fn halves(path: &Path, Span(from, to): Span) -> Option<[Span; 2]> {
    let middle = path.middle(from, to);
    let is_between = path.has(middle) && path.in_order(from, middle) && path.in_order(middle, to);
    is_between.then_some([Span(from, middle), Span(middle, to)])
}
