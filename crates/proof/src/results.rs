//! Checks that a result follows from the steps and the events.

use super::events::{Events, Finish};
use super::interval::Interval;
use super::lines::{EventKind, ProvedEvent, Status};
use super::path::Place;
use super::scene::Scene;
use super::steps::Steps;

/// The order of the results.
const ORDER: [EventKind; 4] = [EventKind::Contact, EventKind::Stall, EventKind::Lock, EventKind::PathEnd];

/// The state of knowledge of an event.
struct Known {
    /// Seconds before which the event does not happen.
    not_before: Interval,
    /// Seconds by which the event has happened, and its benches.
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
    let Some(expected) = ORDER.get(earlier.len()) else { return Err("a result too many, expected four".to_owned()) };
    if outcome.event != *expected {
        return Err("the results are not contact, stall, lock and path_end in this order".to_owned());
    }
    let known = known(scene, steps, events, *expected);
    let ProvedEvent { time_lo, time_hi, bench_a, bench_b, .. } = outcome;
    let begins = |lo: f64| lo.is_finite() && lo >= 0.0 && Interval::new(lo).is_at_most(&known.not_before);
    match (outcome.status, time_lo, time_hi) {
        (Status::None, lo, None) if known.never && bench_a.is_none() && bench_b.is_none() => {
            // Between the last step and the lock nothing is known, so a claim must state up to when it holds.
            let up_to_a_lock = matches!(events.finish, Some(Finish::Lock(..))) && *expected != EventKind::PathEnd;
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

fn known(scene: &Scene, steps: &Steps, events: &Events, event: EventKind) -> Known {
    let zero = Interval::new(0.0);
    let seconds = |place: Place| (scene.path.travelled(place) / scene.head_speed).max(&zero);
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
        EventKind::PathEnd => {
            let seconds = (scene.path.length / scene.head_speed).max(&zero);
            let reached = matches!(events.finish, Some(Finish::PathEnd));
            Known {
                not_before: seconds,
                by: reached.then_some((seconds, None, None)),
                never: matches!(events.finish, Some(Finish::Lock(..))),
            }
        }
    }
}
