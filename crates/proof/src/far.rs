//! Teams of any length far out on an inward spiral, where no two boards can touch: Lemma 8 of docs/proofs.md.

use super::elementary;
use super::interval::Interval;
use super::team::Team;

/// Returns true if Lemma 8 holds for a pitch while all handles are `radius` metres from the centre or further out.
pub(super) fn holds(team: &Team, pitch: f64, radius: &Interval) -> bool {
    let number = Interval::new;
    let pi = elementary::turns(0.5);
    let a = number(pitch) / (pi * number(2.0));
    let (head, body) = (*team.link(0), *team.link(1));
    let longest = head.max(&body);
    if !longest.is_below(radius) {
        return false;
    }
    // Fewer than three benches: all share a handle.
    if team.benches < 3 {
        return true;
    }
    let (inset, width) = (team.hole_inset, team.width);
    let half_width = width * number(0.5);
    let d = |link: &Interval| pi * a * link / (number(3.0) * radius);
    let lean_of =
        |link: &Interval| (link.square() + d(link) * (number(2.0) * radius + d(link))) / (number(2.0) * link * radius);
    let lean = lean_of(&head).max(&lean_of(&body));
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
    let thick = width * steep.sqrt();
    let beyond = |link: &Interval| inset * (link + inset);
    let between = |link: &Interval| link.square() * number(0.25);
    let out = |link: &Interval| (thick + (steep * beyond(link)).max(&(slope * between(link))) / rho) * number(0.5);
    let inside = (thick + (steep * between(&body)).max(&(slope * beyond(&body))) / rho) * number(0.5);
    (out(&head).max(&out(&body)) + inside).is_below(&number(pitch))
}
