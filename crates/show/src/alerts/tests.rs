//! The alert rules on made-up timelines and clearances.

use proptest::prelude::*;

use super::*;
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::event::Event;
use bench_dragon_motion::model::Point;

const RULES: AlertRules = AlertRules { approach_time: 10.0, approach_clearance: 0.05 };
/// A clearance that neither raises the level nor keeps it.
const WIDE: f64 = 1.0;

fn pair(value: f64) -> Option<PairClearance> {
    let (point_a, point_b) = (Point::new(0.0, 0.0), Point::new(value, 0.0));
    Some(PairClearance { value, bench_a: 3, bench_b: 17, point_a, point_b })
}

fn timed(kind: EventKind, time: f64) -> TimedEvent {
    TimedEvent { event: Event { kind, travelled: time, bench_a: Some(0), bench_b: None, place: None }, time }
}

/// Returns the timeline of these events. Without a lock the path's end follows much later.
fn timeline(events: &[(EventKind, f64)]) -> Timeline {
    let mut all: Vec<_> = events.iter().map(|(kind, time)| timed(*kind, *time)).collect();
    if all.iter().all(|timed| timed.event.kind != EventKind::Lock) {
        all.push(timed(EventKind::PathEnd, 1e9));
    }
    Timeline::new(all, None)
}

/// A tracker, and its alerts frame by frame.
struct Run {
    tracker: LevelTracker,
    timeline: Timeline,
    alerts: Vec<Alert>,
}

impl Run {
    fn new(rate: f64, events: &[(EventKind, f64)]) -> Self {
        let alerts = Vec::with_capacity(MOST_PER_FRAME);
        Self { tracker: LevelTracker::new(RULES, rate), timeline: timeline(events), alerts }
    }

    fn frame(&mut self, tick: u64, sim_time: f64, clearance: f64) -> &[Alert] {
        self.alerts.clear();
        self.tracker.update(tick, sim_time, true, &self.timeline, pair(clearance), &mut self.alerts);
        assert!(self.alerts.len() <= MOST_PER_FRAME && self.alerts.capacity() == MOST_PER_FRAME, "it allocates");
        &self.alerts
    }

    fn levels(&mut self, tick: u64, sim_time: f64, clearance: f64) -> Vec<Level> {
        self.frame(tick, sim_time, clearance).iter().map(|alert| alert.level).collect()
    }
}

/// Contact, stall and lock, each optional, in any order, on eighths of a second: so sums are exact.
fn events() -> impl Strategy<Value = Vec<(EventKind, f64)>> {
    let time = || prop::option::of((0u32..800).prop_map(|eighths| f64::from(eighths) / 8.0));
    (time(), time(), time()).prop_map(|(contact, stall, lock)| {
        let kinds = [(EventKind::Contact, contact), (EventKind::Stall, stall), (EventKind::Lock, lock)];
        let mut events: Vec<_> = kinds.into_iter().filter_map(|(kind, time)| Some((kind, time?))).collect();
        // A lock ends the motion.
        let end = lock.unwrap_or(f64::INFINITY);
        events.retain(|(_, time)| *time <= end);
        events.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        events
    })
}

/// Times with steps of zero, of one, of some, or of very many eighths of a second.
fn times() -> impl Strategy<Value = Vec<f64>> {
    let step = prop_oneof![1 => Just(0u32), 8 => 1u32..4, 2 => 1u32..40, 1 => 1u32..800];
    (0u32..100, prop::collection::vec(step, 0..60)).prop_map(|(first, steps)| {
        let mut eighths = first;
        let rest = steps.into_iter().map(move |step| {
            eighths += step;
            eighths
        });
        std::iter::once(first).chain(rest).map(|eighths| f64::from(eighths) / 8.0).collect()
    })
}

/// Clearances below the threshold, between threshold and release, above the release, and on each border.
fn clearances() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.04), Just(0.05), Just(0.06), Just(0.074), Just(1.5 * 0.05), Just(0.076), Just(WIDE)]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    /// For steps of any size: the events before the first frame are one alert, every other event is one each.
    #[test]
    fn every_event_passed_is_announced_once_in_order_and_at_once(events in events(), times in times()) {
        let mut run = Run::new(8.0, &events);
        let first = times[0];
        let latest_before = events.iter().rposition(|(_, time)| *time <= first).unwrap_or(0);
        let mut due = &events[latest_before..];
        for (tick, time) in times.into_iter().enumerate() {
            let announced: Vec<_> =
                run.frame(tick as u64, time, WIDE).iter().filter(|alert| alert.level.has_happened()).copied().collect();
            let (now, later) = due.split_at(due.iter().filter(|(_, at)| *at <= time).count());
            let expected: Vec<_> = now.iter().map(|(kind, at)| (Level::of(*kind).unwrap(), *at)).collect();
            let announced: Vec<_> = announced.iter().map(|alert| (alert.level, alert.event.unwrap().time)).collect();
            prop_assert_eq!(announced, expected);
            due = later;
        }
    }

    /// A change is one alert, no change is none but the countdown, and the first frame is one at any level.
    #[test]
    fn an_alert_is_a_change_of_level_or_the_countdown(
        events in events(),
        times in times(),
        clearances in prop::collection::vec(clearances(), 61),
    ) {
        let mut run = Run::new(0.1, &events);
        let mut before = None;
        for (tick, (time, clearance)) in times.iter().zip(clearances).enumerate() {
            let levels = run.levels(tick as u64, *time, clearance);
            prop_assert!(before.is_some() || levels.len() == 1, "the first frame: {levels:?}");
            for level in levels {
                prop_assert!(before != Some(level) || level == Level::Approaching, "{level:?} twice");
                before = Some(level);
            }
            prop_assert_eq!(Some(run.tracker.current()), before, "a change that was not announced");
            let passed = events.iter().rfind(|(_, at)| at <= time).and_then(|(kind, _)| Level::of(*kind));
            prop_assert_eq!(passed, before.filter(|level| level.has_happened()));
        }
    }

    /// The rule of `approaching` and `clear`, word by word, over all frames so far.
    #[test]
    fn clear_comes_only_after_a_tenth_of_the_approach_time(
        contact in 0u32..800,
        times in times(),
        clearances in prop::collection::vec(clearances(), 61),
    ) {
        let contact = f64::from(contact) / 8.0;
        let mut run = Run::new(8.0, &[(EventKind::Contact, contact)]);
        let mut frames: Vec<(f64, f64)> = Vec::new();
        let mut level = Level::Clear;
        for (time, clearance) in times.into_iter().zip(clearances).take_while(|(time, _)| *time < contact) {
            run.frame(frames.len() as u64, time, clearance);
            frames.push((time, clearance));
            let event_is_near = contact - time <= 10.0;
            // "Above 1.5 approach_clearance for a tenth of approach_time": of the unbroken frames up to this one, the
            // first is at least that old.
            let break_at = frames.iter().rposition(|(_, clearance)| *clearance <= 1.5 * 0.05);
            let opened = frames.get(break_at.map_or(0, |at| at + 1));
            let open_for_a_tenth = opened.is_some_and(|(opened, _)| time - opened >= 1.0);
            let stays = level == Level::Approaching && !open_for_a_tenth;
            let approaching = event_is_near || clearance < 0.05 || stays;
            level = if approaching { Level::Approaching } else { Level::Clear };
            prop_assert_eq!(run.tracker.current(), level, "{:?}", frames);
        }
    }

    /// One alert for every second of wall time, in its first frame, for any rate, time scale and tick.
    #[test]
    fn the_countdown_is_of_wall_time(
        rate in prop_oneof![1u64..20, 1u64..20_000],
        scale in -6.0f64..6.0,
        first in 0u64..1_000_000_000_000_000,
        steps in prop::collection::vec(1u64..5, 1..400),
    ) {
        let mut run = Run::new(rate as f64, &[]);
        let sim_time = |tick: u64| 10f64.powf(scale) * tick as f64 / rate as f64;
        prop_assert_eq!(run.levels(first, sim_time(first), 0.01), [Level::Approaching]);
        // Steps of one to four ninths of a second or of a tick each.
        let (mut tick, mut seconds) = (first, 0);
        for step in steps {
            tick += (step * rate / 9).max(step);
            let announced = run.frame(tick, sim_time(tick), 0.01).len();
            let elapsed = (tick - first) / rate;
            prop_assert_eq!(announced, usize::from(elapsed > seconds), "{} s after {} s", elapsed, seconds);
            seconds = elapsed;
        }
    }
}

#[test]
fn three_events_in_one_step_are_three_alerts_each_about_its_own() {
    let mut run = Run::new(60.0, &[(EventKind::Contact, 20.0), (EventKind::Stall, 21.0), (EventKind::Lock, 21.0)]);
    assert_eq!(run.levels(0, 0.0, WIDE), [Level::Clear]);
    let alerts = run.frame(1, 21.0, -0.5);
    let expected =
        [(Level::Contact, EventKind::Contact), (Level::Stall, EventKind::Stall), (Level::Lock, EventKind::Lock)];
    assert_eq!(alerts.iter().map(|alert| (alert.level, alert.event.unwrap().event.kind)).collect::<Vec<_>>(), expected);
    assert!(alerts.iter().all(|alert| alert.nearest == pair(-0.5)));
    assert_eq!(run.levels(1_000_000, 21.0, WIDE), [], "what has happened stays, without a countdown");
}

#[test]
fn clear_and_approaching_are_about_the_event_ahead() {
    let mut run = Run::new(1.0, &[(EventKind::Stall, 20.0), (EventKind::Lock, 30.0)]);
    let stall = Some(timed(EventKind::Stall, 20.0));
    for (tick, level) in [(0, Level::Clear), (10, Level::Approaching), (11, Level::Approaching)] {
        assert_eq!(run.frame(tick, tick as f64, WIDE), [Alert { level, event: stall, nearest: pair(WIDE) }]);
    }
    // The path's end is no danger.
    let mut run = Run::new(1.0, &[]);
    assert_eq!(run.frame(0, 1e9 - 1.0, WIDE), [Alert { level: Level::Clear, event: None, nearest: pair(WIDE) }]);
    assert_eq!(run.frame(1, 1e9, WIDE), []);
}

#[test]
fn without_pairs_only_events_raise_the_level() {
    let mut tracker = LevelTracker::new(RULES, 60.0);
    let timeline = timeline(&[(EventKind::Stall, 20.0)]);
    let mut alerts = Vec::new();
    [0.0, 9.0, 10.0].into_iter().enumerate().for_each(|(tick, time)| {
        tracker.update(tick as u64, time, true, &timeline, None, &mut alerts);
    });
    assert_eq!(alerts.iter().map(|alert| alert.level).collect::<Vec<_>>(), [Level::Clear, Level::Approaching]);
}

#[test]
fn a_contact_recorded_while_the_show_plays_is_announced_in_that_frame() {
    let mut run = Run::new(60.0, &[(EventKind::Contact, 500.0)]);
    assert_eq!(run.levels(0, 100.0, 0.01), [Level::Approaching]);
    run.timeline.record_touch(timed(EventKind::Contact, 100.5));
    assert_eq!(run.levels(30, 100.5, -0.1), [Level::Contact]);
    assert_eq!(run.levels(31, 100.6, WIDE), []);
}

#[test]
fn a_show_that_ends_and_begins_approaching_counts_down_through_the_loop() {
    let mut run = Run::new(10.0, &[]);
    assert_eq!(run.levels(0, 0.0, WIDE), [Level::Clear]);
    // Announced late in a showing of 1.5 s, and repeatedly in showings of half a second.
    let mut announced = Vec::new();
    for tick in 14..50 {
        if tick % 5 == 0 {
            run.tracker.restart();
        }
        announced.extend(run.levels(tick, (tick % 5) as f64 / 10.0, 0.01).into_iter().map(|level| (tick, level)));
    }
    assert_eq!(announced, [14, 24, 34, 44].map(|tick| (tick, Level::Approaching)), "once, and each second");
}

#[test]
fn a_restart_decides_the_level_again() {
    let contact = [(EventKind::Contact, 20.0), (EventKind::Stall, 30.0)];
    let mut run = Run::new(10.0, &contact);
    assert_eq!(run.levels(0, 25.0, WIDE), [Level::Contact]);
    assert_eq!(run.levels(1, 30.0, WIDE), [Level::Stall]);
    run.tracker.restart();
    assert_eq!(run.levels(2, 25.0, WIDE), [Level::Contact], "the latest that has passed");
    run.tracker.restart();
    assert_eq!(run.levels(3, 26.0, WIDE), [], "the same level");
    run.tracker.restart();
    assert_eq!(run.levels(4, 12.0, WIDE), [Level::Approaching]);
    run.tracker.restart();
    // Open by less than the release needs, and briefly: the level of the showing before is not held.
    assert_eq!(run.levels(5, 0.0, 0.06), [Level::Clear]);
}
