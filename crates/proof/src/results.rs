//! Checks that a result follows from the steps and the events.

use super::events::{Events, Finish, Near};
use super::interval::Interval;
use super::lines::{EventKind, ProvedClearance, ProvedEvent, ProvedObstacleClearance, Status, Until};
use super::path::Place;
use super::scene::Scene;
use super::steps::Steps;

/// The order of the results.
const ORDER: [EventKind; 4] = [EventKind::Contact, EventKind::Stall, EventKind::Lock, EventKind::PathEnd];

/// The state of knowledge of an event.
struct Known {
    /// The time, in seconds, before which the event does not happen.
    not_before: Interval,
    /// The time, in seconds, by which the event has happened, and its benches.
    by: Option<(Interval, Option<usize>, Option<usize>)>,
    /// True if the event does not happen before the motion ends.
    never: bool,
}

/// Checks a result. `earlier` are the results before it.
///
/// # Errors
/// The condition that does not follow.
pub(super) fn check(
    scene: &Scene,
    steps: &Steps,
    events: &Events,
    outcome: &ProvedEvent,
    earlier: &[ProvedEvent],
) -> Result<(), String> {
    let obstacle = earlier.len().checked_sub(ORDER.len());
    let expected = ORDER.get(earlier.len()).copied().unwrap_or(EventKind::Obstacle);
    if obstacle.is_some_and(|number| number >= scene.obstacles.len()) {
        return Err("a result too many, expected four and one for each obstacle".to_owned());
    }
    if outcome.event != expected || outcome.obstacle != obstacle {
        return Err("the results are not contact, stall, lock, path_end and the obstacles in this order".to_owned());
    }
    let known = known(scene, steps, events, (expected, obstacle.unwrap_or(0)));
    let ProvedEvent { time_lo, time_hi, bench_a, bench_b, .. } = outcome;
    let begins = |lo: f64| lo.is_finite() && lo >= 0.0 && Interval::new(lo).is_at_most(&known.not_before);
    match (outcome.status, time_lo, time_hi) {
        (Status::None, lo, None) if known.never && bench_a.is_none() && bench_b.is_none() => {
            // Between the last step and the lock nothing is known, so a claim must state up to when it holds.
            let up_to_a_lock = matches!(events.finish, Some(Finish::Lock(..))) && expected != EventKind::PathEnd;
            match lo {
                Some(lo) if up_to_a_lock && begins(*lo) => Ok(()),
                None if !up_to_a_lock => Ok(()),
                _ => Err("the time_lo of status none does not follow".to_owned()),
            }
        }
        (Status::None, ..) => Err("the status none does not follow".to_owned()),
        (Status::Undecided, Some(lo), None) if begins(*lo) && bench_a.is_none() && bench_b.is_none() => Ok(()),
        (Status::Undecided, ..) => Err("the status undecided with this time_lo does not follow".to_owned()),
        (Status::Proved, Some(lo), Some(hi)) => {
            let Some((by, a, b)) = known.by else { return Err("the status proved does not follow".to_owned()) };
            if (a, b) != (*bench_a, *bench_b) {
                return Err("the benches are not those of the event".to_owned());
            }
            if begins(*lo) && hi.is_finite() && by.is_at_most(&Interval::new(*hi)) {
                Ok(())
            } else {
                Err("the interval from time_lo to time_hi does not follow".to_owned())
            }
        }
        (Status::Proved, ..) => Err("a time is missing".to_owned()),
    }
}

/// Checks the result of a certificate of the least clearance.
///
/// # Errors
/// The condition that does not follow.
pub(super) fn check_clearance(
    scene: &Scene,
    steps: &Steps,
    events: &Events,
    outcome: &ProvedClearance,
) -> Result<(), String> {
    let ProvedClearance { lo, hi, until, time_until, bench_a, bench_b, .. } = *outcome;
    let zero = Interval::new(0.0);
    let comes_to = |metres: &Interval| steps.apart_end.is_some_and(|end| metres.is_at_most(&scene.path.travelled(end)));
    if lo.is_some_and(|lo| !(lo.is_finite() && lo <= steps.apart && comes_to(&zero))) {
        return Err("the clearance lo does not follow".to_owned());
    }
    let of = |near: &Near| (near.benches, near.most);
    let near = match until {
        Until::PathEnd if steps.all_apart && matches!(events.finish, Some(Finish::PathEnd)) => {
            events.near.as_ref().map(of)
        }
        Until::PathEnd => return Err("the steps that say how far boards are apart end before the path".to_owned()),
        Until::Contact => {
            // Boards are apart at the start, and two overlap later.
            let begins = steps.apart >= 0.0 && lo.is_none_or(|lo| lo <= 0.0) && comes_to(&zero);
            let contact = events.contact.filter(|_| begins);
            Some(contact.map(|(benches, _)| (benches, zero)).ok_or("a first contact does not follow")?)
        }
        Until::Time => {
            let is_reached = |time: f64| lo.is_none() || comes_to(&scene.travelled_by(&Interval::new(time)));
            let Some(time) = time_until.filter(|time| *time >= 0.0 && is_reached(*time)) else {
                return Err("time_until does not follow".to_owned());
            };
            events.near.as_ref().filter(|near| is_by(scene, &near.travelled, time)).map(of)
        }
    };
    if (until == Until::Time) != time_until.is_some() {
        return Err("time_until is of another end".to_owned());
    }
    match (hi, near) {
        (None, _) if bench_a.is_none() && bench_b.is_none() => Ok(()),
        (Some(hi), Some(([a, b], most))) if (Some(a), Some(b)) == (bench_a, bench_b) => {
            if most.is_at_most(&Interval::new(hi)) {
                Ok(())
            } else {
                Err("the clearance hi does not follow".to_owned())
            }
        }
        _ => Err("the clearance hi, or its benches, do not follow".to_owned()),
    }
}

/// Returns true if the head has surely travelled so far by a time of the show.
fn is_by(scene: &Scene, travelled: &Interval, time: f64) -> bool {
    travelled.is_at_most(&scene.travelled_by(&Interval::new(time)))
}

/// Checks the result for an obstacle in a certificate of the least clearance.
///
/// # Errors
/// The condition that does not follow.
pub(super) fn check_obstacle_clearance(
    scene: &Scene,
    steps: &Steps,
    events: &Events,
    outcome: &ProvedObstacleClearance,
    earlier: usize,
) -> Result<(), String> {
    let ProvedObstacleClearance { obstacle, lo, hi, until, time_until, bench, .. } = *outcome;
    if obstacle != earlier || obstacle >= scene.obstacles.len() {
        return Err("the obstacles are not all named in their order".to_owned());
    }
    let beside = steps.beside(obstacle);
    let comes_to = |metres: &Interval| beside.end.is_some_and(|end| metres.is_at_most(&scene.path.travelled(end)));
    if lo.is_some_and(|lo| !(lo.is_finite() && lo <= beside.least && comes_to(&Interval::new(0.0)))) {
        return Err("the clearance lo does not follow".to_owned());
    }
    let is_reached = match (until, time_until) {
        (Until::PathEnd, None) => beside.all && matches!(events.finish, Some(Finish::PathEnd)),
        (Until::Time, Some(time)) => {
            time >= 0.0 && (lo.is_none() || comes_to(&scene.travelled_by(&Interval::new(time))))
        }
        _ => false,
    };
    if !is_reached {
        return Err("the end of the stretch does not follow".to_owned());
    }
    let near = events.near_obstacles.iter().find(|near| near.obstacle == obstacle);
    let is_before = |travelled: &Interval| time_until.is_none_or(|time| is_by(scene, travelled, time));
    let follows = match (hi, bench, near) {
        (None, None, _) => true,
        (Some(hi), Some(bench), Some(near)) => {
            bench == near.bench && near.most.is_at_most(&Interval::new(hi)) && is_before(&near.travelled)
        }
        _ => false,
    };
    if follows { Ok(()) } else { Err("the clearance hi, or its bench, does not follow".to_owned()) }
}

fn known(scene: &Scene, steps: &Steps, events: &Events, (event, obstacle): (EventKind, usize)) -> Known {
    let zero = Interval::new(0.0);
    let seconds = |place: Place| scene.time(&scene.path.travelled(place));
    let after = |place: Option<Place>| place.map_or_else(|| zero, seconds);
    let finished = events.finish.is_some();
    match event {
        EventKind::Contact => Known {
            not_before: after(steps.clear_end),
            by: events.contact.map(|([a, b], to)| (seconds(to), Some(a), Some(b))),
            never: finished && steps.all_clear,
        },
        EventKind::Stall => Known {
            not_before: after(steps.moving_end),
            by: events.stall.map(|(link, to)| (seconds(to), Some(link), None)),
            never: finished && steps.all_moving,
        },
        EventKind::Lock => Known {
            not_before: after(steps.end),
            by: match events.finish {
                Some(Finish::Lock(link, to)) => Some((seconds(to), Some(link), None)),
                _ => None,
            },
            never: matches!(events.finish, Some(Finish::PathEnd)),
        },
        EventKind::Obstacle => {
            let (end, all_free) = steps.free(obstacle);
            let reached = events.reached.iter().find(|(number, ..)| *number == obstacle);
            Known {
                not_before: after(end),
                by: reached.map(|(_, bench, at)| (seconds(*at), Some(*bench), None)),
                never: finished && all_free,
            }
        }
        EventKind::PathEnd => {
            let seconds = scene.time(&scene.path.length);
            let reached = matches!(events.finish, Some(Finish::PathEnd));
            Known {
                not_before: seconds,
                by: reached.then_some((seconds, None, None)),
                never: matches!(events.finish, Some(Finish::Lock(..))),
            }
        }
    }
}
