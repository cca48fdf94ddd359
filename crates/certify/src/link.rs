//! Lemma 1 of `docs/proofs.md`: the follower of a span is in another span.

use std::f64::consts::FRAC_PI_2;

use super::branch::{Branch, rules};
use super::capsule::{Capsule, Spanned};
use super::interval::{Interval, dot, minus, norm_squared};
use super::path::ExactPath;
use super::place::{Place, Span};

/// Limit of halvings of a stretch whose places must be nearer than the link.
const MOST_HALVINGS: u32 = 44;

/// Limit of the stretches into which the span of a handle is cut. Next to a lock or a stall, some twenty are enough.
const MOST_STRETCHES: u32 = 300;

/// A number below pi / 2.
const QUARTER: f64 = FRAC_PI_2 - 1e-12;

/// The sign of the front product, by Lemma 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Front {
    /// The rear handle moves forward when the front handle does.
    Forward,
    /// The rear handle moves backward when the front handle moves forward.
    Backward,
    /// The rear handle may turn round.
    Unknown,
}

/// Returns the sign of the front product if the follower of a link of some kind is proved to be in `rear` for every
/// place of `front`.
pub(super) fn follower_within(
    path: &ExactPath,
    front: &Spanned,
    rear: &Spanned,
    link: Interval,
    (branches, kind): (&[Branch], usize),
) -> Option<Front> {
    let sign = one_place_within(path, front, rear, link)?;
    if branches.is_empty() {
        return is_first(path, front, rear, None, link).then_some(sign);
    }
    let mut rules = rules(branches, path, kind, front.span);
    rules.all(|(part, behind)| is_first(path, &Spanned::new(path, part), rear, behind, link)).then_some(sign)
}

/// Returns true if the place of `rear` at the distance is proved to be the first one back from `behind`, or from the
/// front.
fn is_first(path: &ExactPath, front: &Spanned, rear: &Spanned, behind: Option<Place>, link: Interval) -> bool {
    let Span(earliest, latest) = rear.span;
    let is_nearer = |to: Place| {
        path.turning(earliest, front.span.1) < QUARTER || nearer(path, front, Span(latest, to), link, MOST_HALVINGS)
    };
    match behind {
        None => is_nearer(front.span.1),
        Some(behind) if path.in_order(behind, latest) => {
            let square = front.capsule.distance_squared(path.point(behind));
            path.in_order(earliest, behind) && square.is_below(link.square())
        }
        Some(behind) => path.in_order(behind, front.span.0) && is_nearer(behind),
    }
}

/// Returns the sign of the front product if, for every place of `front`, exactly one inner place of `rear` is at the
/// link's distance. Returns `None` without a proof.
fn one_place_within(path: &ExactPath, front: &Spanned, rear: &Spanned, link: Interval) -> Option<Front> {
    let (u, x) = (&front.capsule, &rear.capsule);
    let behind = path.in_order(rear.span.1, front.span.0);
    if !behind || !u.product(x, true).is_positive() && !has_sign(path, u, rear.span, 1.0) {
        return None;
    }
    let product = u.product(x, false);
    let backward = product.is_negative();
    // The way from the front to the rear, along the tangent at the front.
    let forward = product.is_positive() || !backward && has_sign(path, x, front.span, -1.0);
    let square = link.square();
    let beyond = |distance: Interval| square.is_below(distance);
    let within = |distance: Interval| distance.is_below(square);
    let apart = |one, other| norm_squared(minus(one, other));
    let (sign, holds) = if forward {
        (Front::Forward, beyond(apart(front.first, rear.first)) && within(apart(front.last, rear.last)))
    } else if backward {
        (Front::Backward, beyond(apart(front.last, rear.first)) && within(apart(front.first, rear.last)))
    } else {
        let first = beyond(front.capsule.distance_squared(rear.first));
        (Front::Unknown, first && within(front.capsule.distance_squared(rear.last)))
    };
    holds.then_some(sign)
}

/// Returns true if a product is proved to have the sign of `sign` for all places of a span and of `other`. Its factors
/// are the tangent at the span's place and the way from there to the place of `other`. The span is cut into stretches.
fn has_sign(path: &ExactPath, other: &Capsule, span: Span, sign: f64) -> bool {
    let mut waiting = vec![span];
    for _ in 0..MOST_STRETCHES {
        let Some(stretch) = waiting.pop() else { return true };
        let capsule = Capsule::new(path, stretch);
        let is_right = |product: Interval| (product * sign).is_positive();
        if is_right(other.product(&capsule, true)) || is_right(other.second_order_product(path, &capsule, stretch)) {
            continue;
        }
        let at_middle = dot(capsule.tangent, minus(other.point, capsule.point));
        let Some(middle) = path.between(stretch.0, stretch.1).filter(|_| is_right(at_middle)) else { return false };
        waiting.extend([Span(middle, stretch.1), Span(stretch.0, middle)]);
    }
    false
}

/// Returns true if every place of a stretch is proved to be of kind (a) or (b).
pub(super) fn nearer(path: &ExactPath, front: &Spanned, stretch: Span, link: Interval, halvings: u32) -> bool {
    let Span(first, last) = stretch;
    if path.turning(first, front.span.1) < QUARTER {
        return true;
    }
    let y = Capsule::new(path, stretch);
    let is_behind = path.in_order(last, front.span.0);
    let growing = is_behind && front.capsule.product(&y, true).is_positive();
    if growing || front.capsule.distances_squared(&y).is_below(link.square()) {
        return true;
    }
    if is_behind && front.capsule.second_order_product(path, &y, stretch).is_positive() {
        return true;
    }
    let Some(middle) = path.between(first, last).filter(|_| halvings > 0) else { return false };
    nearer(path, front, Span(first, middle), link, halvings - 1)
        && nearer(path, front, Span(middle, last), link, halvings - 1)
}

/// Returns true if the squared distances of all places of a stretch from all of `front` are proved to satisfy a
/// condition.
pub(super) fn all_distances(
    path: &ExactPath,
    front: &Spanned,
    stretch: Span,
    holds: &dyn Fn(Interval) -> bool,
    halvings: u32,
) -> bool {
    if holds(front.capsule.distances_squared(&Capsule::new(path, stretch))) {
        return true;
    }
    let Some(middle) = path.between(stretch.0, stretch.1).filter(|_| halvings > 0) else { return false };
    all_distances(path, front, Span(stretch.0, middle), holds, halvings - 1)
        && all_distances(path, front, Span(middle, stretch.1), holds, halvings - 1)
}
