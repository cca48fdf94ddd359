//! Lemma 8 of `docs/proofs.md`: teams of any length far out on an inward spiral, where no two boards can touch.

use crate::boards::Shape;
use crate::elementary::pi;
use crate::interval::Interval;
use crate::spaced::Spaced;
use crate::step::link_of;
use bench_dragon_motion::model::team::Ends;

/// Limit of doublings of the longest link or the radius, the greater of the two, to find a radius for which
/// the lemma holds.
const MOST_DOUBLINGS: u32 = 30;

/// Excess of the radius found over the least one, as a share of the radius.
const SLACK: f64 = 1e-3;

/// Returns a radius for which the lemma holds with a clearance, at least `radius` and little more than the least.
pub(super) fn least_radius(asked: Spaced<'_>, pitch: f64, radius: f64) -> Option<f64> {
    let holds = |radius: f64| holds(asked, pitch, radius);
    if holds(radius) {
        return Some(radius);
    }
    let mut outside = 2.0 * radius.max(asked.team.longest_link());
    let mut doublings = 0;
    while !holds(outside) {
        outside *= 2.0;
        doublings += 1;
        if doublings > MOST_DOUBLINGS {
            return None;
        }
    }
    let mut inside = radius;
    while outside - inside > SLACK * inside {
        let middle = 0.5 * (inside + outside);
        if holds(middle) { outside = middle } else { inside = middle }
    }
    Some(outside)
}

/// Returns true if the lemma holds with a clearance for all handles at least `radius` metres from the centre.
fn holds(asked: Spaced<'_>, pitch: f64, radius: f64) -> bool {
    let Spaced { team, clearance } = asked;
    let a = Interval::point(pitch).over(pi() * 2.0);
    let r = Interval::point(radius);
    let [head, body, tail] = team.kinds().map(|bench| link_of(team, bench));
    let longest = head.max(body).max(tail);
    if !longest.is_below(r) {
        return false;
    }
    if team.benches < 3 {
        return true;
    }
    let half = Interval::point(clearance) * 0.5;
    let shapes = team.kinds().map(|bench| Shape::new(team, bench));
    let inset = shapes[1].inset + half;
    let [of_head, of_body, of_tail] = shapes.map(|shape| shape.half_width + half);
    let half_width = of_head.max(of_body).max(of_tail);
    // 1. Boards less than a turn apart.
    let growth = |link: Interval| a * pi() * link.over(r * 3.0);
    let lean = |link: Interval| {
        let growth = growth(link);
        (link.square() + growth * (r * 2.0 + growth)).over(link * r * 2.0)
    };
    let lean = lean(head).max(lean(body)).max(lean(tail));
    let (aside, left) = (inset + half_width * lean, r - inset * lean - half_width);
    let most_turned = (a.square() + r.square() + r * growth(body)).sqrt();
    if !left.is_positive() || !(aside * 2.0 * most_turned).is_below(body * left) {
        return false;
    }
    // 2. No boards a turn apart: the team is too short.
    // A number of benches below 2^53 is exact in a double.
    let length = match team.own_tail() {
        Some(_) => head + body * (team.benches - 2) as f64 + tail,
        None => head + body * (team.benches - 1) as f64,
    };
    if (pi() * length + body * 3.0).is_below(pi() * r * 6.0) {
        return true;
    }
    // 3. Boards a turn apart, or more.
    let nearest = (r.square() - longest.square() * 0.25).sqrt().min(r - inset) - half_width;
    if !nearest.is_positive() {
        return false;
    }
    let slope = a.over(nearest).square();
    let (bent_out, bent_in) = ((Interval::ONE + slope).over(nearest), slope.over(nearest));
    let steep = (Interval::ONE + slope).sqrt();
    let (between, beyond) = (|link: Interval| link.square() * 0.25, |link: Interval| inset * (link + inset));
    let outside = |link: Interval| (bent_out * beyond(link)).max(bent_in * between(link)) * 0.5;
    let inside = |link: Interval| (bent_out * between(link)).max(bent_in * beyond(link)) * 0.5;
    let pitch = Interval::point(pitch);
    if team.ends == Ends::NONE {
        let thick = half_width * steep * 2.0;
        return (thick + outside(head).max(outside(body)) + inside(body)).is_below(pitch);
    }
    // The board nearer the head is not the tail's, the other one not the head's.
    let nearer = (of_head * steep + outside(head)).max(of_body * steep + outside(body));
    let other = (of_body * steep + inside(body)).max(of_tail * steep + inside(tail));
    (nearer + other).is_below(pitch)
}

#[cfg(test)]
mod tests;
