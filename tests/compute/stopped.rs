//! Searches that the receiver of their progress stops: their results are a part of the whole result, and say that they
//! are a part.

use std::cell::Cell;
use std::ops::ControlFlow;
use std::path::Path;

use bench_dragon::certify::plan::{greatest_speed, least_pitch, least_turn};
use bench_dragon::certify::{MOST_STEPS, Status, certify};
use bench_dragon::motion::event::{Progress, unreported};
use bench_dragon::motion::model::team::Team;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::motion::timeline::{TimedClearance, TimedEvent};
use bench_dragon::proof::verify;
use bench_dragon::show::scene::SceneText;

/// The shares of all calls of a search after which it is stopped.
const SHARES: [f64; 6] = [0.0, 0.02, 0.2, 0.5, 0.8, 0.99];

/// Runs a search to its end, and returns its result. Then calls `check` with the results of the search stopped after
/// some calls of its progress.
fn stopped<T>(mut search: impl FnMut(Progress<'_>) -> T, mut check: impl FnMut(&T, T)) -> T {
    let mut calls = 0u32;
    let whole = search(&mut |share| {
        calls += 1;
        assert!((0.0..=1.0).contains(&share), "{share}");
        ControlFlow::Continue(())
    });
    assert!(calls > 20, "{calls} calls");
    for share in SHARES {
        let (most, mut done) = ((share * f64::from(calls)) as u32, 0);
        let mut progress = |_| {
            done += 1;
            if done > most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        check(&whole, search(&mut progress));
        // The searches of a part end at their first answers; a golden section ends its few steps.
        assert!(done <= most + 2_000, "{done} calls, stopped after {most}");
        assert!(share > 0.2 || done < calls, "{done} of {calls} calls, stopped after {most}");
    }
    whole
}

fn scenes() -> Vec<SceneText> {
    ["paper", "coil", "square", "turnaround"]
        .map(|name| SceneText::load(&Path::new("config").join(format!("{name}.toml"))).unwrap())
        .into()
}

fn up_to(events: &[TimedEvent], until: f64) -> Vec<TimedEvent> {
    events.iter().filter(|timed| timed.time <= until).copied().collect()
}

#[test]
fn events_are_complete_up_to_where_the_search_came() {
    for text in scenes() {
        let ensemble = text.parse().unwrap().ensemble;
        let whole = stopped(
            |progress| ensemble.timeline(progress),
            |whole, part| {
                assert!(part.is_stopped());
                let until = part.searched_until().unwrap();
                assert!(until < whole.end().time, "{until}");
                assert_eq!(up_to(&part.all(), until), up_to(&whole.all(), until), "{} up to {until}", text.text);
            },
        );
        assert!(!whole.is_stopped() && whole.searched_until().is_none());
        // Read again, because an ensemble keeps what it has found of its singularities.
        stopped_without_contact(&text.parse().unwrap().ensemble);
    }
}

fn stopped_without_contact(ensemble: &bench_dragon::motion::ensemble::Ensemble) {
    let part = ensemble.timeline_without_contact(&mut |_| ControlFlow::Break(()));
    let whole = ensemble.timeline_without_contact(&mut unreported);
    let until = part.searched_until().unwrap();
    assert!(part.is_stopped());
    assert_eq!(up_to(&part.all(), until), up_to(&whole.all(), until));
}

#[test]
fn a_least_clearance_is_the_least_up_to_where_the_search_came_or_none() {
    for text in scenes() {
        let ensemble = text.parse().unwrap().ensemble;
        let timeline = ensemble.timeline(&mut unreported);
        let known = Cell::new(0);
        let check = |whole: Option<TimedClearance>, part: Option<TimedClearance>| {
            let (Some(part), Some(whole)) = (part, whole) else { return };
            known.set(known.get() + 1);
            assert!(part == whole || part.searched_until.is_some_and(|until| until < timeline.end().time), "{part:?}");
            assert!(part.least.value >= whole.least.value, "{part:?} {whole:?}");
            // The place of the whole show's least clearance is left out only by a search that has not come to it.
            assert!(part.least.value == whole.least.value || part.searched_until < Some(whole.time), "{part:?}");
        };
        stopped(
            |progress| ensemble.least_clearances(&timeline, timeline.end(), progress),
            |whole, part| {
                assert!(!part.is_complete && whole.is_complete);
                check(whole.own, part.own);
                check(whole.between, part.between);
                check(whole.of_show, part.of_show);
            },
        );
        assert!(known.get() > 0, "{}", text.text);
        if !ensemble.ground().is_empty() {
            stopped(
                |progress| ensemble.obstacle_clearances(timeline.end(), progress),
                |whole, part| {
                    for part in part {
                        let whole = whole.iter().find(|whole| whole.obstacle == part.obstacle).unwrap();
                        let least = part.least.value == whole.least.value;
                        assert!(least || part.searched_until < Some(whole.time), "{part:?} {whole:?}");
                        assert!(part.searched_until.is_some());
                    }
                },
            );
        }
    }
}

#[test]
fn a_certificate_holds_and_says_what_is_not_decided() {
    for text in ["config/coil.toml", "config/square.toml"].map(|file| SceneText::load(Path::new(file)).unwrap()) {
        let ensemble = text.parse().unwrap().ensemble;
        let timeline = ensemble.timeline(&mut unreported);
        stopped(
            |progress| {
                let mut lines = Vec::new();
                let write = &mut |line: &bench_dragon::certify::CertificateLine| line.write(&mut lines);
                let events = certify(&ensemble, &timeline, &text.text, MOST_STEPS, write, progress).unwrap();
                verify(lines.as_slice(), &mut |_| ()).unwrap_or_else(|refused| panic!("{refused}"));
                events
            },
            |whole, part| {
                let because = |because: &str| because == "the search was stopped there";
                let is_stopped =
                    |status: &Status| matches!(status, Status::Undecided { because: of, .. } if because(of));
                for (part, whole) in part.iter().zip(whole) {
                    assert!((part.event, &part.dragons) == (whole.event, &whole.dragons));
                    // Just before a contact, the steps to it may be left out.
                    let is_wider = match (&part.status, &whole.status) {
                        (Status::Proved { time_lo, .. }, Status::Proved { time_lo: lo, .. }) => time_lo <= lo,
                        _ => false,
                    };
                    assert!(part == whole || is_wider || is_stopped(&part.status), "{part:?} {whole:?}");
                }
            },
        );
    }
}

#[test]
#[ignore = "computes for long: tests/run --all"]
fn plans_enclose_no_more_than_they_have_proved() {
    let scene = SceneText::paper().parse().unwrap();
    let team = *scene.ensemble.only().unwrap().team();
    let few = Team { benches: 12, ..team };
    stopped(
        |progress| least_pitch(&team, 4.5, progress).unwrap(),
        |whole, part| {
            assert!(whole.proved && !part.proved);
            assert!(part.value_lo <= whole.value_lo && part.value_hi.is_none_or(|hi| hi >= whole.value_lo));
        },
    );
    for arc_ratio in [Some(2.0), None] {
        stopped(
            |progress| least_turn(&few, 1.7, arc_ratio, progress).unwrap(),
            |whole, part| {
                assert!(whole.proved && !part.proved);
                // With another ratio of the arcs the least radius is another.
                if part.arc_ratio == whole.arc_ratio {
                    assert!(part.value_lo <= whole.value_lo, "{part:?} {whole:?}");
                    let above = |radius: f64| radius >= whole.value_lo;
                    assert!(part.value_hi.is_none_or(above) && part.value.is_none_or(above), "{part:?} {whole:?}");
                }
            },
        );
    }
    // One step suffices for the paper's scene.
    let scene = SceneText::load(Path::new("config/turnaround.toml")).unwrap().parse().unwrap();
    let timeline = scene.ensemble.timeline(&mut unreported);
    stopped(
        |progress| greatest_speed(&scene, &timeline, 2.0, progress).unwrap(),
        |whole, part| {
            assert!(whole.proved && !part.proved);
            assert!(part.value_lo <= whole.value_lo && part.value_hi >= whole.value_hi);
        },
    );
}

#[test]
fn a_solver_is_made_whole_or_not_at_all() {
    for name in ["long", "turnaround"] {
        let text = SceneText::load(&Path::new("config").join(format!("{name}.toml"))).unwrap();
        let made = |most: u32| {
            let mut calls = 0;
            let mut progress = |_| {
                calls += 1;
                if calls > most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            // Read again, because a motion keeps the branches that it has found.
            let ensemble = text.parse().unwrap().ensemble;
            let solver = ensemble.solver_unless_stopped(Velocities::Computed, &mut progress);
            (solver, calls)
        };
        let (whole, calls) = made(u32::MAX);
        assert!(calls > 50, "{name}: {calls} calls");
        // Not shares of the calls: a thread that waits for another one asks, too.
        for most in [0, 1, 5, 20] {
            let (part, asked) = made(most);
            assert!(part.is_none() && asked <= most + 2, "{name}: {asked} of {calls} calls, stopped after {most}");
        }
        let ensemble = text.parse().unwrap().ensemble;
        let [mut of_one, mut of_other] = [0, 1].map(|_| Chain::new(ensemble.handles()));
        let (mut one, mut other) = (whole.unwrap(), ensemble.solver(Velocities::Computed));
        for time in [0.0, 12.25, 100.0] {
            one.solve(time, &mut of_one).unwrap();
            other.solve(time, &mut of_other).unwrap();
            assert_eq!(of_one, of_other, "{name} at {time} s");
        }
    }
}
