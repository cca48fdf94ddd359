//! The statistics on simulated time, against sorted lists.

use std::cell::RefCell;
use std::rc::Rc;

use proptest::prelude::*;

use super::*;
use crate::live::{End, LoopCounts};
use bench_dragon_messages::CollisionAlert;
use bench_dragon_testing::simulated::{REALTIME_OFFSET_NS, SimulatedClock};

const SECOND_NS: u64 = 1_000_000_000;
const START_NS: u64 = 77 * SECOND_NS + 5;

fn sample(sequence: u64, lateness_ns: u64, step_ns: u64) -> Sample {
    Sample {
        tick: sequence + 100,
        sim_time: sequence as f64 / 8.0,
        shows_played: 2,
        unforeseen_contacts: 3,
        unsolved_frames: 4,
        counts: LoopCounts { frames: sequence + 1, overruns: 5, skipped: 6, end: End::Signal },
        lateness_ns,
        step_ns,
        subscribers: 7,
    }
}

fn accumulator(rate: f64) -> Accumulator {
    Accumulator::new(11, rate, "paper", START_NS)
}

/// The least number that a share of `sorted` does not exceed: the nearest rank.
fn quantile(sorted: &[u64], share: f64) -> u64 {
    // A product that rounding has pushed past a whole number is that number.
    sorted[(share * sorted.len() as f64 - 1e-9).ceil() as usize - 1]
}

/// Three digits: a thousandth, or a nanosecond.
fn assert_near(histogram: u64, truth: u64) {
    assert!(histogram.abs_diff(truth) <= 1 + truth / 1000, "{histogram}, expected {truth}");
}

fn assert_percentiles_of(mut values: Vec<u64>, percentiles: Percentiles) {
    values.sort_unstable();
    let Percentiles { p50, p99, p999, max } = percentiles;
    for (histogram, share) in [(p50, 0.5), (p99, 0.99), (p999, 0.999), (max, 1.0)] {
        assert_near(histogram, quantile(&values, share));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    /// No lateness of a whole period here: every sample is one value.
    #[test]
    fn percentiles_are_those_of_a_sorted_list(
        durations in prop::collection::vec((0u64..100_000_000, 0u64..10_000_000_000), 1..400),
    ) {
        let mut accumulator = accumulator(10.0);
        for (sequence, (lateness_ns, step_ns)) in durations.iter().enumerate() {
            accumulator.record(&sample(sequence as u64, *lateness_ns, *step_ns));
        }
        let (late, steps): (Vec<_>, Vec<_>) = durations.into_iter().unzip();
        let summary = accumulator.summary();
        assert_percentiles_of(late, summary.wakeup_ns);
        assert_percentiles_of(steps, summary.step_ns);
    }

    /// Every period that a late wake-up covers counts with the lateness that remains there, however many periods there
    /// are.
    #[test]
    fn a_late_wake_up_counts_once_for_every_period_it_covers(exponent in 0.0f64..5.3, on_time in 0usize..50) {
        const PERIOD_NS: u64 = 50_000;
        let mut accumulator = accumulator(20_000.0);
        let lateness_ns = (10f64.powf(exponent) * PERIOD_NS as f64) as u64;
        accumulator.record(&sample(0, lateness_ns, 0));
        (0..on_time).for_each(|sequence| accumulator.record(&sample(sequence as u64 + 1, 0, 0)));
        let covered = (0..lateness_ns / PERIOD_NS).map(|period| lateness_ns - period * PERIOD_NS);
        let mut values: Vec<_> = covered.chain(std::iter::repeat_n(0, on_time)).collect();
        values.sort_unstable();
        let Percentiles { p50, p99, p999, max } = accumulator.summary().wakeup_ns;
        assert_near(max, lateness_ns);
        for (histogram, share) in [(p50, 0.5), (p99, 0.99), (p999, 0.999)] {
            let truth = quantile(&values, share);
            // Two neighbours: where entries are shared, the list is that much coarser.
            let slack = 2 * PERIOD_NS * (1 + lateness_ns / PERIOD_NS / 20_000);
            prop_assert!(histogram.abs_diff(truth) <= slack + truth / 1000, "{histogram}, expected {truth}");
        }
    }
}

#[test]
fn a_wake_up_of_ten_periods_late_is_ten_values() {
    for periods in 1..=10 {
        let mut accumulator = accumulator(100.0);
        accumulator.record(&sample(0, periods * 10_000_000 + 3_000_000, 0));
        let values = (1..=periods).map(|period| period * 10_000_000 + 3_000_000).collect();
        assert_percentiles_of(values, accumulator.summary().wakeup_ns);
    }
}

#[test]
fn a_lateness_beyond_an_hour_counts_as_an_hour() {
    let mut accumulator = accumulator(20_000.0);
    accumulator.record(&sample(0, u64::MAX, u64::MAX));
    let summary = accumulator.summary();
    assert_near(summary.wakeup_ns.max, 3600 * SECOND_NS);
    assert_near(summary.step_ns.max, 3600 * SECOND_NS);
}

#[test]
fn a_status_has_the_last_second_and_the_total_apart() {
    let mut accumulator = accumulator(50.0);
    (0..50).for_each(|sequence| accumulator.record(&sample(sequence, 1_000, 40)));
    assert_eq!(accumulator.status_if_due(START_NS + SECOND_NS - 1), None, "the second is not over");
    let first = accumulator.status_if_due(START_NS + SECOND_NS).unwrap();
    assert_eq!((first.run_id, first.rate, first.scene.as_str()), (11, 50.0, "paper"));
    assert_eq!((first.tick, first.sequence, first.sim_time), (149, 49, 49.0 / 8.0));
    assert_eq!((first.overruns, first.skipped, first.subscribers), (5, 6, 7));
    assert_eq!((first.shows_played, first.unforeseen_contacts, first.unsolved_frames), (2, 3, 4));
    assert_eq!(first.measured_rate, 50.0);
    assert_eq!((first.lateness_p50_second, first.lateness_max_total), (1_000, 1_000));

    (50..60).for_each(|sequence| accumulator.record(&sample(sequence, 500, 90)));
    let second = accumulator.status_if_due(START_NS + 2 * SECOND_NS).unwrap();
    assert_eq!(second.measured_rate, 10.0);
    assert_eq!([second.lateness_p50_second, second.lateness_p99_second, second.lateness_max_second], [500; 3]);
    assert_eq!([second.lateness_p50_total, second.lateness_p999_total, second.lateness_max_total], [1_000; 3]);
    assert_eq!([second.step_p50_second, second.step_p99_second, second.step_max_second], [90; 3]);
    assert_eq!([second.step_p50_total, second.step_p99_total, second.step_max_total], [40, 90, 90]);
    assert_eq!(accumulator.summary().samples, 60);
}

#[test]
fn a_second_without_a_frame_has_a_status_too() {
    let mut accumulator = accumulator(0.1);
    assert_eq!(accumulator.status_if_due(START_NS + 3 * SECOND_NS), None, "there is no frame to report");
    accumulator.record(&sample(0, 9, 9));
    let first = accumulator.status_if_due(START_NS + 4 * SECOND_NS).unwrap();
    assert_eq!(first.measured_rate, 0.25, "over its true length");
    let quiet = accumulator.status_if_due(START_NS + 5 * SECOND_NS).unwrap();
    assert_eq!((quiet.measured_rate, quiet.sequence, quiet.tick), (0.0, 0, 100));
    assert_eq!((quiet.lateness_max_second, quiet.step_max_second), (0, 0));
    assert_eq!((quiet.lateness_max_total, quiet.step_max_total), (9, 9));
}

#[test]
fn late_calls_do_not_add_up() {
    let mut accumulator = accumulator(1000.0);
    accumulator.record(&sample(0, 0, 0));
    // Two minutes of calls, each 20 ms after the one before and a little more.
    let statuses =
        (0u64..).map(|call| START_NS + call * 20_400_000).take_while(|now| *now <= START_NS + 120 * SECOND_NS);
    assert_eq!(statuses.filter(|now| accumulator.status_if_due(*now).is_some()).count(), 120 - 1);
    // A call that comes five seconds late is one status.
    assert!(accumulator.status_if_due(START_NS + 126 * SECOND_NS).is_some());
    assert!(accumulator.status_if_due(START_NS + 126 * SECOND_NS + SECOND_NS / 2).is_none());
    assert!(accumulator.status_if_due(START_NS + 127 * SECOND_NS).is_some());
}

#[test]
fn frames_whose_samples_were_lost_count_in_the_rate_and_miss_in_the_summary() {
    let mut accumulator = accumulator(100.0);
    [0, 1, 99].into_iter().for_each(|sequence| accumulator.record(&sample(sequence, 0, 0)));
    let status = accumulator.status_if_due(START_NS + SECOND_NS).unwrap();
    assert_eq!((status.measured_rate, status.sequence), (100.0, 99));
    assert_eq!(accumulator.summary().samples, 3);
}

#[test]
fn the_last_status_is_of_the_time_since_the_one_before() {
    let mut accumulator = accumulator(100.0);
    assert_eq!(accumulator.status(START_NS + SECOND_NS), None, "there is no frame to report");
    (0..100).for_each(|sequence| accumulator.record(&sample(sequence, 0, 0)));
    accumulator.status_if_due(START_NS + SECOND_NS).unwrap();
    assert_eq!(accumulator.status(START_NS + SECOND_NS), None, "it has just been given");
    (100..120).for_each(|sequence| accumulator.record(&sample(sequence, 0, 0)));
    let last = accumulator.status(START_NS + SECOND_NS + SECOND_NS / 4).unwrap();
    assert_eq!((last.measured_rate, last.sequence), (80.0, 119));
}

struct Statuses(Rc<RefCell<Vec<LoopStatus>>>);

impl StatusPublisher for Statuses {
    fn publish_status(&mut self, status: &LoopStatus) {
        self.0.borrow_mut().push(*status);
    }
}

#[test]
fn the_thread_gives_each_sink_a_status_a_second_and_every_alert_in_order() {
    let (mut reports, inbox) = queues();
    (0..30).for_each(|sequence| reports.samples.push(sample(sequence, 0, 0)).unwrap());
    let alert =
        |tick| Announcement::Alert { alert: CollisionAlert { tick, ..CollisionAlert::default() }, time_scale: 1.0 };
    (0..3).for_each(|tick| reports.announcements.push(alert(tick)).unwrap());
    let clock = SimulatedClock::new(START_NS, []).stopping_at(START_NS + 5 * SECOND_NS + SECOND_NS / 2);
    let (first, second) = (Rc::default(), Rc::default());
    let sinks = [&first, &second].map(|list| Box::new(Statuses(Rc::clone(list))) as Box<dyn StatusPublisher>);
    let mut announced = Vec::new();
    let announce = Box::new(|announcement: &Announcement| {
        let Announcement::Alert { alert, .. } = announcement else { panic!("{announcement:?}") };
        announced.push(alert.tick);
    });
    let run = Run {
        run_id: 11,
        rate: 30.0,
        scene: "paper",
        sinks: sinks.into(),
        announce,
        record: Box::new(|_| ()),
        alive: Box::new(|| ()),
    };
    let summary = collect(&clock, inbox, run, &clock.stop);

    assert_eq!(summary.samples, 30);
    assert_eq!(announced, [0, 1, 2]);
    let statuses = first.borrow();
    assert_eq!(*statuses, *second.borrow());
    let ages: Vec<_> = statuses.iter().map(|status| status.stamp_ns - REALTIME_OFFSET_NS - START_NS).collect();
    assert_eq!(
        ages,
        [1, 2, 3, 4, 5].map(|s| s * SECOND_NS).into_iter().chain([11 * SECOND_NS / 2]).collect::<Vec<_>>()
    );
    assert_eq!(statuses[0].measured_rate, 30.0);
    assert!(statuses[1..].iter().all(|status| status.measured_rate == 0.0 && status.sequence == 29));
    assert!(statuses[0].resident_bytes > 100_000 && statuses[0].file_descriptors > 2);
}

/// A run that ends while its status is being sent: the last sample comes in between.
struct LastMoment {
    reports: crate::live::Reports,
    done: Rc<AtomicBool>,
}

impl StatusPublisher for LastMoment {
    fn publish_status(&mut self, _status: &LoopStatus) {
        if !self.done.swap(true, Ordering::Release) {
            self.reports.samples.push(sample(1, 0, 0)).unwrap();
        }
    }
}

#[test]
fn what_was_pushed_before_the_end_is_collected() {
    let (mut reports, inbox) = queues();
    let clock = SimulatedClock::new(START_NS, []);
    reports.samples.push(sample(0, 0, 0)).unwrap();
    let done = Rc::new(AtomicBool::new(false));
    let sinks: Vec<Box<dyn StatusPublisher>> = vec![Box::new(LastMoment { reports, done: Rc::clone(&done) })];
    let run = Run {
        run_id: 11,
        rate: 30.0,
        scene: "paper",
        sinks,
        announce: Box::new(|_| ()),
        record: Box::new(|_| ()),
        alive: Box::new(|| ()),
    };
    assert_eq!(collect(&clock, inbox, run, &done).samples, 2);
}
