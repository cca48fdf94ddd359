//! Teams of any length far out on an inward spiral, where no two boards can touch: Lemma 8 of docs/proofs.md.

use super::elementary;
use super::interval::Interval;
use super::team::Team;

/// Returns true if Lemma 8 holds for a pitch while all handles are `radius` metres from the centre or further out.
pub(super) fn holds(team: &Team, pitch: f64, radius: &Interval) -> bool {
    let number = Interval::new;
    let pi = elementary::turns(0.5);
    let a = number(pitch) / (pi * number(2.0));
    let [[head, of_head], [body, of_body], [tail, of_tail]] = team.kinds();
    let longest = head.max(&body).max(&tail);
    if !longest.is_below(radius) {
        return false;
    }
    // Fewer than three benches: all share a handle.
    if team.benches < 3 {
        return true;
    }
    let (inset, width) = (team.hole_inset, of_head.max(&of_body).max(&of_tail));
    let half_width = width * number(0.5);
    let d = |link: &Interval| pi * a * link / (number(3.0) * radius);
    let lean_of =
        |link: &Interval| (link.square() + d(link) * (number(2.0) * radius + d(link))) / (number(2.0) * link * radius);
    let lean = lean_of(&head).max(&lean_of(&body)).max(&lean_of(&tail));
    let left = radius - inset * lean - half_width;
    let most_turned = (a.square() + radius.square() + radius * d(&body)).sqrt();
    // 1. Less than a turn apart.
    if !(left.is_positive() && ((number(2.0) * inset + width * lean) * most_turned).is_below(&(body * left))) {
        return false;
    }
    // 2. The team is too short to be a turn apart.
    let length = team.links(0, team.benches - 1);
    if (pi * length / number(3.0) + body).is_below(&(number(2.0) * pi * radius)) {
        return true;
    }
    // 3. A turn apart, or more.
    let rho = (radius.square() - longest.square() * number(0.25)).sqrt().min(&(radius - inset)) - half_width;
    if !rho.is_positive() {
        return false;
    }
    let slope = (a / rho).square();
    let steep = number(1.0) + slope;
    let thick = |width: &Interval| width * steep.sqrt();
    let beyond = |link: &Interval| inset * (link + inset);
    let between = |link: &Interval| link.square() * number(0.25);
    let out = |link: &Interval, width: &Interval| {
        (thick(width) + (steep * beyond(link)).max(&(slope * between(link))) / rho) * number(0.5)
    };
    let inside = |link: &Interval, width: &Interval| {
        (thick(width) + (steep * between(link)).max(&(slope * beyond(link))) / rho) * number(0.5)
    };
    // The board nearer the head is not the tail's, the other one not the head's.
    let nearer = out(&head, &of_head).max(&out(&body, &of_body));
    let other = inside(&body, &of_body).max(&inside(&tail, &of_tail));
    (nearer + other).is_below(&number(pitch))
}
