//! A link over spans: Lemma 1 of docs/proofs.md.

use super::capsule::{Capsule, Pair};
use super::elementary;
use super::interval::{Interval, Vector};
use super::path::{Path, Place, Span};
use super::problem::{Checked, ensure, problem};

/// Limit of stretches of the path that are tested for one link: some seconds. A certificate that the search has written
/// needs a few.
const MOST_STRETCHES: usize = 100_000;

/// Limit of stretches of a front's span.
const MOST_FRONT_STRETCHES: usize = 2_000;

/// Checks Lemma 1: for each place of `front`, the follower lies in `rear` and is continuous. Each capsule comes with
/// the points at both ends of its span. In each stretch of `rules`, which cover the front's span, the follower is the
/// first place at the distance back from a place, or from the front. Returns the front product.
///
/// # Errors
/// The condition that is not proved.
pub(super) fn check(
    path: &Path,
    (front, [u1, u2]): (&Capsule, [Vector; 2]),
    (rear, [x1, x2]): (&Capsule, [Vector; 2]),
    link: &Interval,
    rules: &[(Span, Option<Place>)],
) -> Checked<Interval> {
    ensure!(path.in_order(rear.span.1, front.span.0), "the rear's span is not behind the front's");
    let pair = Pair::new(front, rear);
    let falls = |stretch: Span| falls(path, &Pair::new(front, &Capsule::new(path, stretch)));
    if !pair.rear_product().is_positive() && !all_stretches(path, rear.span, falls) {
        return Err(problem!("the rear product may be 0"));
    }
    let product = front_product(path, &pair);
    let squared = link.square();
    let distance = |u: &Vector, x: &Vector| u.minus(x).norm_squared();
    let (longest, shortest) = if product.is_positive() {
        (distance(&u1, &x1), distance(&u2, &x2))
    } else if product.is_negative() {
        (distance(&u2, &x1), distance(&u1, &x2))
    } else {
        (over_front(front, &x1), over_front(front, &x2))
    };
    ensure!(squared.is_below(&longest), "the earliest place of the rear may be too near");
    ensure!(shortest.is_below(&squared), "the latest place of the rear may be too far");
    for (stretch, behind) in rules {
        let part = (*stretch != front.span).then(|| Capsule::new(path, *stretch));
        ensure!(
            is_first(path, part.as_ref().unwrap_or(front), rear.span, *behind, &squared),
            "a place between the handles may be at the link's length"
        );
    }
    Ok(product)
}

/// Returns true if the place at the distance in `rear` is the first one back from `behind`, or from the front.
fn is_first(path: &Path, front: &Capsule, rear: Span, behind: Option<Place>, squared: &Interval) -> bool {
    match behind {
        None => is_nearer(path, front, Span(rear.1, front.span.1), squared),
        Some(behind) if path.in_order(behind, rear.1) => {
            path.in_order(rear.0, behind) && is_nearer_at(path, front, behind, squared)
        }
        Some(behind) => path.in_order(behind, front.span.0) && is_nearer(path, front, Span(rear.1, behind), squared),
    }
}

/// Returns the front product over two spans. If the capsules do not decide its sign, the front's span is cut into
/// stretches, until one of them may have another sign than positive.
fn front_product(path: &Path, pair: &Pair) -> Interval {
    let whole = pair.front_product();
    if whole.is_positive() || whole.is_negative() {
        return whole;
    }
    let mut waiting = vec![pair.front.span];
    let mut hull: Option<Interval> = None;
    for _ in 0..MOST_FRONT_STRETCHES {
        let Some(stretch) = waiting.pop() else { return hull.unwrap_or(whole) };
        let capsule = Capsule::new(path, stretch);
        // The way back from the front, along the tangent there: minus the front product.
        let back = Pair::new(pair.rear, &capsule);
        let products = [-back.rear_product(), -back.second_order_rear_product(path)];
        if let Some(product) = products.into_iter().find(Interval::is_positive) {
            hull = Some(hull.map_or(product, |hull| hull.hull(&product)));
            continue;
        }
        let at_middle = capsule.tangent.dot(&capsule.point.minus(&pair.rear.point));
        let Some([first, last]) = halves(path, stretch).filter(|_| at_middle.is_positive()) else { return whole };
        waiting.extend([last, first]);
    }
    whole
}

/// Returns true if the rear product is positive for all places of the two spans.
fn falls(path: &Path, pair: &Pair) -> bool {
    pair.rear_product().is_positive() || pair.second_order_rear_product(path).is_positive()
}

/// Returns D(u, x) for all u of the span, by Taylor's formula about m_u.
fn over_front(front: &Capsule, x: &Vector) -> Interval {
    let from = front.point.minus(x);
    let distance = from.norm() + front.half;
    let slope = front.tangent.dot(&from).abs();
    from.norm_squared() + slack(front, &slope, &distance).around_zero()
}

/// Returns true if D(u, x) > l^2 for all u of the front.
pub(super) fn is_farther(path: &Path, front: &Capsule, x: Place, squared: &Interval) -> bool {
    squared.is_below(&over_front(front, &path.at(x).point))
}

/// Returns true if D(u, x) < l^2 for all u of the front.
pub(super) fn is_nearer_at(path: &Path, front: &Capsule, x: Place, squared: &Interval) -> bool {
    over_front(front, &path.at(x).point).is_below(squared)
}

/// Returns 2 |slope| h + (1 + K |d|) h^2.
fn slack(capsule: &Capsule, slope: &Interval, distance: &Interval) -> Interval {
    let Capsule { half, curvature, .. } = capsule;
    (Interval::new(2.0) * slope + (Interval::new(1.0) + curvature * distance) * half) * half
}

/// Returns true if D(u, x) < l^2 for all u of the front and all x of a stretch. Taylor's formula about the middles of
/// both shows it.
fn is_stretch_nearer(pair: &Pair, squared: &Interval) -> bool {
    (over_front(pair.front, &pair.rear.point) + along_rear(pair)).is_below(squared)
}

/// Returns a bound of |D(u, x) - D(u, m_x)| for all u of the front and all x of the rear.
fn along_rear(pair: &Pair) -> Interval {
    let Pair { front, rear, distance, .. } = pair;
    // An upper bound of |g(u, m_x)| for all u of the front.
    let slope = rear.tangent.dot(&front.point.minus(&rear.point)).abs() + front.half * pair.along + front.sag;
    slack(rear, &slope, distance)
}

/// Returns true if D > l^2 for all places of the front and of the span.
pub(super) fn is_all_further(path: &Path, front: &Capsule, span: Span, squared: &Interval) -> bool {
    all_stretches(path, span, |stretch| {
        let capsule = Capsule::new(path, stretch);
        let pair = Pair::new(front, &capsule);
        squared.is_below(&(over_front(front, &capsule.point) - along_rear(&pair)))
    })
}

/// Returns true if D < l^2 for all places of the front and of the span.
pub(super) fn is_all_nearer(path: &Path, front: &Capsule, span: Span, squared: &Interval) -> bool {
    all_stretches(path, span, |stretch| is_stretch_nearer(&Pair::new(front, &Capsule::new(path, stretch)), squared))
}

/// Returns true if *Nearer* holds: D < l^2 for all u of the front and all places of the span up to u. Precondition: it
/// holds at the span's beginning.
fn is_nearer(path: &Path, front: &Capsule, span: Span, squared: &Interval) -> bool {
    all_stretches(path, span, |stretch| {
        // Kind (a), for the whole rest at once.
        if path.turning_bound(stretch.0, front.span.1).is_below(elementary::quarter_turn()) {
            return true;
        }
        let capsule = Capsule::new(path, stretch);
        let pair = Pair::new(front, &capsule);
        // Kind (b), or kind (a).
        is_stretch_nearer(&pair, squared) || falls(path, &pair)
    })
}

/// Returns true if a condition holds for all stretches of a span, which is halved where the condition does not hold. No
/// more than [`MOST_STRETCHES`] are tested.
fn all_stretches(path: &Path, span: Span, holds: impl Fn(Span) -> bool) -> bool {
    // Each halving adds one, and two neighbouring doubles have no middle: at most some 2,100 a segment wait.
    let mut waiting = vec![span];
    for _ in 0..MOST_STRETCHES {
        let Some(stretch) = waiting.pop() else { return true };
        if !holds(stretch) {
            let Some([first, last]) = halves(path, stretch) else { return false };
            waiting.extend([last, first]);
        }
    }
    waiting.is_empty()
}

/// Returns the two halves of a span. Neither is the whole.
fn halves(path: &Path, Span(from, to): Span) -> Option<[Span; 2]> {
    let middle = path.middle(from, to);
    let is_inside = middle != from && middle != to && path.has(middle);
    let is_between = is_inside && path.in_order(from, middle) && path.in_order(middle, to);
    is_between.then_some([Span(from, middle), Span(middle, to)])
}
