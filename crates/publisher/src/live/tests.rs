//! The loop on a simulated clock: whatever is late, the counts, the deadlines and the order hold.

mod commands;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use proptest::prelude::*;

use super::show_source::{FrameMessages, ShowSource};
use super::*;
use bench_dragon_testing::simulated::{REALTIME_OFFSET_NS, SimulatedClock, Wake};

const START_NS: u64 = 5_000_000_007;
const SECOND_NS: u64 = 1_000_000_000;
/// A deadline is rounded down to a nanosecond, and so is the test's.
const ROUNDING_NS: u64 = 2;

/// The delays of a run. After the end of a list there is no delay.
#[derive(Debug, Clone, Default)]
struct Script {
    wakes: Vec<Wake>,
    frame_ns: Vec<u64>,
    publish_ns: Vec<u64>,
    maintain_ns: Vec<u64>,
}

impl Script {
    /// All the time by which the loop is held up, at most.
    fn total_ns(&self) -> u64 {
        let late = self.wakes.iter().map(|wake| if let Wake::Late(ns) = wake { *ns } else { 0 });
        late.chain([&self.frame_ns, &self.publish_ns, &self.maintain_ns].into_iter().flatten().copied()).sum()
    }
}

/// The calls of the fakes, with the clock's nanoseconds.
#[derive(Debug, Default)]
struct Log {
    computed: Vec<(u64, u64)>,
    published: Vec<FrameHeader>,
    maintained: Vec<u64>,
}

struct FakeFrames {
    clock: Rc<SimulatedClock>,
    log: Rc<RefCell<Log>>,
    cost_ns: VecDeque<u64>,
    frame: Frame,
    messages: FrameMessages,
    /// The number of its frames.
    most: usize,
}

impl FrameSource for FakeFrames {
    fn frame(&mut self, tick: u64, stamps: Stamps) -> Period<'_> {
        if self.log.borrow().computed.len() >= self.most {
            return Period::Over;
        }
        self.log.borrow_mut().computed.push((tick, self.clock.monotonic_ns()));
        self.clock.advance(self.cost_ns.pop_front().unwrap_or(0));
        self.frame.tick = tick;
        Period::Frame(self.messages.of(&self.frame, stamps))
    }

    fn command(&mut self, _: u64, _: Command) -> Option<Outcome> {
        None
    }

    fn finished_step(&mut self, _: u64) -> Option<Outcome> {
        None
    }
}

struct FakePublisher {
    clock: Rc<SimulatedClock>,
    log: Rc<RefCell<Log>>,
    cost_ns: VecDeque<u64>,
    maintain_ns: VecDeque<u64>,
    /// The number of frames it publishes before it fails.
    lasts: usize,
}

impl Publisher for FakePublisher {
    fn publish(&mut self, Outgoing { header, .. }: Outgoing<'_>) -> Result<(), PublishError> {
        if self.log.borrow().published.len() >= self.lasts {
            return Err(PublishError("the transport is gone".into()));
        }
        self.clock.advance(self.cost_ns.pop_front().unwrap_or(0));
        self.log.borrow_mut().published.push(*header);
        Ok(())
    }

    fn maintain(&mut self) {
        self.log.borrow_mut().maintained.push(self.clock.monotonic_ns());
        self.clock.advance(self.maintain_ns.pop_front().unwrap_or(0));
    }

    fn subscribers(&self) -> u32 {
        3
    }
}

/// A rate in tenths of a hertz, so that deadlines can be computed in integers.
#[derive(Debug, Clone, Copy)]
struct Rate(u64);

impl Rate {
    fn hertz(self) -> f64 {
        self.0 as f64 / 10.0
    }

    /// start + tick / rate, rounded down.
    fn deadline(self, tick: u64) -> u64 {
        START_NS + (u128::from(tick) * 10_000_000_000 / u128::from(self.0)) as u64
    }

    fn period_ns(self) -> u64 {
        self.deadline(1) - START_NS
    }
}

/// 0.1 to 20,000 Hz, every magnitude alike.
fn rates() -> impl Strategy<Value = Rate> {
    (0.0f64..5.302).prop_map(|exponent| Rate((10f64.powf(exponent) as u64).clamp(1, 200_000)))
}

/// Mostly nothing, sometimes a part of a period, sometimes many periods, sometimes whole ones.
fn delays(period_ns: u64) -> impl Strategy<Value = u64> {
    prop_oneof![
        6 => Just(0),
        2 => 0..period_ns,
        1 => 0..30 * period_ns,
        1 => (1u64..10).prop_map(move |periods| periods * period_ns),
    ]
}

fn scripts(rate: Rate) -> impl Strategy<Value = Script> {
    let delays = || delays(rate.period_ns());
    let wakes = prop_oneof![4 => delays().prop_map(Wake::Late), 1 => (0u64..1000).prop_map(Wake::Early)];
    (
        prop::collection::vec(wakes, 0..60),
        prop::collection::vec(delays(), 0..30),
        prop::collection::vec(delays(), 0..30),
        prop::collection::vec(delays(), 0..10),
    )
        .prop_map(|(wakes, frame_ns, publish_ns, maintain_ns)| Script { wakes, frame_ns, publish_ns, maintain_ns })
}

fn runs() -> impl Strategy<Value = (Rate, Script, u64)> {
    rates().prop_flat_map(|rate| (Just(rate), scripts(rate), 0u64..120))
}

/// A run of the loop, and all that can be observed of it.
struct Observed {
    result: Result<LoopCounts, (LoopCounts, PublishError)>,
    log: Log,
    samples: Vec<Sample>,
    ended_ns: u64,
}

struct Setup {
    rate: Rate,
    script: Script,
    periods: Option<u64>,
    stop_at_ns: u64,
    lasts: usize,
    most_frames: usize,
}

impl Setup {
    fn new(rate: Rate, script: Script) -> Self {
        Self { rate, script, periods: None, stop_at_ns: u64::MAX, lasts: usize::MAX, most_frames: usize::MAX }
    }

    fn run(self) -> Observed {
        let Script { wakes, frame_ns, publish_ns, maintain_ns } = self.script;
        let clock = Rc::new(SimulatedClock::new(START_NS, wakes).stopping_at(self.stop_at_ns));
        let log = Rc::new(RefCell::new(Log::default()));
        let frame = Frame { sim_time: 1.5, ..Frame::new(1) };
        let (messages, cost_ns, most) = (FrameMessages::default(), frame_ns.into(), self.most_frames);
        let mut frames = FakeFrames { clock: clock.clone(), log: log.clone(), cost_ns, frame, messages, most };
        let publisher = FakePublisher {
            clock: clock.clone(),
            log: log.clone(),
            cost_ns: publish_ns.into(),
            maintain_ns: maintain_ns.into(),
            lasts: self.lasts,
        };
        let mut publishers: Vec<Box<dyn Publisher>> = vec![Box::new(publisher)];
        let options = LoopOptions { run_id: 9, rate: self.rate.hertz(), periods: self.periods };
        let (samples, mut received) = rtrb::RingBuffer::new(1 << 17);
        let (announcements, _) = rtrb::RingBuffer::new(1);
        let reports = Reports::new(samples, announcements);
        let result = run_loop(
            &*clock,
            &mut frames,
            &mut CommandQueues::default(),
            &mut publishers,
            options,
            reports,
            &clock.stop,
        );
        drop((frames, publishers));
        Observed {
            result,
            log: Rc::into_inner(log).unwrap().into_inner(),
            samples: std::iter::from_fn(|| received.pop().ok()).collect(),
            ended_ns: clock.monotonic_ns(),
        }
    }
}

/// Checks a run of which `periods` elapsed.
fn check(rate: Rate, observed: &Observed, counts: LoopCounts, periods: u64) -> Result<(), TestCaseError> {
    let Log { computed, published, .. } = &observed.log;
    prop_assert_eq!(counts.frames + counts.skipped, periods);
    prop_assert_eq!(counts.frames, published.len() as u64);
    prop_assert_eq!(computed.len(), published.len());
    prop_assert_eq!(observed.samples.len(), published.len());

    let mut incidents = 0;
    let mut expected_tick = 0;
    for (sequence, ((tick, began_ns), header)) in computed.iter().zip(published).enumerate() {
        prop_assert!(*tick >= expected_tick, "tick {} where {} or later is due", tick, expected_tick);
        prop_assert_eq!((header.tick, header.sequence, header.run_id), (*tick, sequence as u64, 9));
        // Every deadline is the first one plus whole periods, whatever was late before.
        prop_assert!(header.deadline_ns.abs_diff(rate.deadline(*tick)) <= ROUNDING_NS);
        // In its own period: not before it, and not once it has passed.
        prop_assert!(*began_ns + ROUNDING_NS >= rate.deadline(*tick));
        prop_assert!(*began_ns < rate.deadline(*tick + 1) + ROUNDING_NS);
        prop_assert_eq!(header.stamp_ns, began_ns + REALTIME_OFFSET_NS);
        let sample = &observed.samples[sequence];
        let intended_ns = rate.deadline(expected_tick);
        prop_assert!(sample.lateness_ns.abs_diff(began_ns.saturating_sub(intended_ns)) <= ROUNDING_NS);
        prop_assert_eq!((sample.tick, sample.counts.frames), (*tick, sequence as u64 + 1));
        incidents += u64::from(*tick > expected_tick);
        expected_tick = tick + 1;
    }
    prop_assert_eq!(counts.overruns, incidents + u64::from(periods > expected_tick));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn whatever_is_late_every_period_is_a_frame_or_skipped((rate, script, periods) in runs()) {
        let held_up_ns = script.total_ns();
        let observed = Setup { periods: Some(periods), ..Setup::new(rate, script) }.run();
        let counts = *observed.result.as_ref().unwrap();
        prop_assert_eq!(counts.end, End::Duration);
        check(rate, &observed, counts, periods)?;
        // A skipped period lies wholly within what held the loop up.
        prop_assert!(counts.skipped * rate.period_ns() <= held_up_ns + ROUNDING_NS);
        prop_assert!(observed.ended_ns + ROUNDING_NS >= rate.deadline(periods), "the last period is over");
        prop_assert!(observed.ended_ns <= rate.deadline(periods) + held_up_ns);
    }

    #[test]
    fn without_delays_nothing_is_skipped_and_the_end_is_exact(rate in rates(), periods in 0u64..120) {
        let observed = Setup { periods: Some(periods), ..Setup::new(rate, Script::default()) }.run();
        let counts = observed.result.unwrap();
        prop_assert_eq!(counts, LoopCounts { frames: periods, overruns: 0, skipped: 0, end: End::Duration });
        prop_assert!(observed.ended_ns.abs_diff(rate.deadline(periods)) <= ROUNDING_NS);
    }

    #[test]
    fn a_stop_is_heeded_within_100_ms((rate, script, periods) in runs(), part in 0u64..1000) {
        let held_up_ns = script.total_ns();
        let stop_at_ns = START_NS + (rate.deadline(periods) - START_NS) / 1000 * part;
        let observed = Setup { stop_at_ns, ..Setup::new(rate, script) }.run();
        let counts = *observed.result.as_ref().unwrap();
        prop_assert_eq!(counts.end, End::Signal);
        prop_assert!(observed.ended_ns >= stop_at_ns && observed.ended_ns <= stop_at_ns + 100_000_000 + held_up_ns);
        // The periods that have wholly passed, and the current one if its frame was published.
        let elapsed = counts.frames + counts.skipped;
        prop_assert!(rate.deadline(elapsed.saturating_sub(1)) <= observed.ended_ns + ROUNDING_NS);
        prop_assert!(observed.ended_ns < rate.deadline(elapsed + 1) + ROUNDING_NS);
        check(rate, &observed, counts, elapsed)?;
    }

    #[test]
    fn a_failing_publisher_ends_the_run_with_the_counts_until_then((rate, script, _) in runs(), lasts in 0usize..40) {
        let mut observed = Setup { lasts, ..Setup::new(rate, script) }.run();
        let (counts, error) = observed.result.as_ref().unwrap_err();
        prop_assert_eq!((counts.end, error.0.as_str()), (End::Error, "the transport is gone"));
        prop_assert_eq!(counts.frames, lasts as u64);
        // The frame that was lost was computed, in the period after those that are counted.
        let counts = *counts;
        let (lost, _) = observed.log.computed.pop().unwrap();
        prop_assert_eq!(lost, counts.frames + counts.skipped);
        check(rate, &observed, counts, lost)?;
    }

    #[test]
    fn no_period_after_the_last_frame_is_skipped((rate, script, _) in runs(), most_frames in 1usize..40) {
        let observed = Setup { most_frames, ..Setup::new(rate, script) }.run();
        let counts = *observed.result.as_ref().unwrap();
        prop_assert_eq!((counts.end, counts.frames), (End::Recording, most_frames as u64));
        let (last, _) = observed.log.computed[most_frames - 1];
        check(rate, &observed, counts, last + 1)?;
    }

    #[test]
    fn publishers_are_maintained_ten_times_a_second_at_any_rate(rate in rates()) {
        let periods = (rate.hertz() * 3.0).ceil() as u64;
        let observed = Setup { periods: Some(periods), ..Setup::new(rate, Script::default()) }.run();
        let maintained = &observed.log.maintained;
        prop_assert_eq!(maintained[0], START_NS, "late subscribers of the first frame");
        for pair in maintained.windows(2) {
            let apart = pair[1] - pair[0];
            prop_assert!((100_000_000..=100_000_000 + 10_000_000).contains(&apart), "{apart} ns apart");
        }
        prop_assert!(observed.ended_ns - maintained[maintained.len() - 1] <= 110_000_000);
    }
}

#[test]
fn a_stop_at_a_tenth_of_a_hertz_ends_the_run_in_the_middle_of_its_period() {
    let stop_at_ns = START_NS + 3 * SECOND_NS + 1;
    let observed = Setup { stop_at_ns, ..Setup::new(Rate(1), Script::default()) }.run();
    assert_eq!(observed.result.unwrap(), LoopCounts { frames: 1, overruns: 0, skipped: 0, end: End::Signal });
    assert!(observed.ended_ns - stop_at_ns <= 100_000_000);
}

#[test]
fn a_stop_during_a_long_frame_counts_the_periods_that_passed() {
    let script = Script { frame_ns: vec![0, 0, SECOND_NS], ..Script::default() };
    let stop_at_ns = START_NS + SECOND_NS / 2;
    let observed = Setup { stop_at_ns, ..Setup::new(Rate(1000), script) }.run();
    // Ticks 0 to 2 were published; the third ended at 1.02 s, so that ticks 3 to 101 had passed.
    assert_eq!(observed.result.unwrap(), LoopCounts { frames: 3, overruns: 1, skipped: 99, end: End::Signal });
}

#[test]
fn after_a_frame_of_a_billion_periods_the_deadlines_have_not_shifted() {
    let script = Script { frame_ns: vec![1_000_000_000 * 1_000_000 + 400_000], ..Script::default() };
    let observed = Setup { periods: Some(1_000_000_010), ..Setup::new(Rate(10_000), script) }.run();
    let counts = observed.result.unwrap();
    assert_eq!(counts, LoopCounts { frames: 11, overruns: 1, skipped: 999_999_999, end: End::Duration });
    for (k, header) in observed.log.published[1..].iter().enumerate() {
        assert_eq!(header.tick, 1_000_000_000 + k as u64);
        assert_eq!(header.deadline_ns, START_NS + header.tick * 1_000_000);
    }
}

#[test]
fn a_sample_holds_the_cost_of_the_frame_and_of_publishing_it() {
    let script = Script { frame_ns: vec![300, 20], publish_ns: vec![50, 4], ..Script::default() };
    let observed = Setup { periods: Some(3), ..Setup::new(Rate(600), script) }.run();
    let steps: Vec<_> = observed.samples.iter().map(|sample| sample.step_ns).collect();
    assert_eq!(steps, [350, 24, 0]);
    assert_eq!((observed.samples[0].subscribers, observed.samples[0].sim_time), (3, 1.5));
}

#[test]
fn a_wall_time_that_is_whole_periods_but_for_rounding_is_whole_periods() {
    assert_eq!(LoopOptions::periods_of(8.0, 60.0), 480);
    // The product is 110.00000000000001, by the last digit of a double too much.
    assert_eq!(LoopOptions::periods_of(1.1, 100.0), 110);
    assert_eq!(LoopOptions::periods_of(0.01, 60.0), 1, "a part of a period is one");
    assert_eq!(LoopOptions::periods_of(10.001, 1000.0), 10_001);
}
