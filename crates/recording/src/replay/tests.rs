//! The loop's end of a replay on a simulated clock: each frame is sent once, whatever is late, and gaps stay gaps.

use std::cell::RefCell;
use std::rc::Rc;

use proptest::prelude::*;

use super::*;
use bench_dragon_publisher::live::control::CommandQueues;
use bench_dragon_publisher::live::{End, LoopCounts, LoopOptions, PublishError, Publisher, Reports, run_loop};
use bench_dragon_testing::simulated::{SimulatedClock, Wake};

const START_NS: u64 = 5_000_000_000;
const PERIOD_NS: u64 = 10_000_000;

#[derive(Clone, Default)]
struct Collected(Rc<RefCell<Vec<FrameHeader>>>);

impl Publisher for Collected {
    fn publish(&mut self, outgoing: Outgoing<'_>) -> Result<(), PublishError> {
        self.0.borrow_mut().push(*outgoing.header);
        Ok(())
    }

    fn maintain(&mut self) {}

    fn subscribers(&self) -> u32 {
        0
    }
}

/// Plays frames that are due in these periods; the simulated time of each is its number.
fn play(due: &[u64], wakes: Vec<Wake>) -> (LoopCounts, Vec<FrameHeader>) {
    let (mut filled, loop_filled) = RingBuffer::new(due.len());
    let (free, _reader) = RingBuffer::new(due.len());
    for (number, due) in due.iter().enumerate() {
        let header = FrameHeader { sim_time: number as f64, ..FrameHeader::default() };
        filled.push(Box::new(QueuedFrame { due: *due, header, ..QueuedFrame::new(1) })).ok().unwrap();
    }
    drop(filled);
    let shared = Arc::default();
    let mut replay = Replay { filled: loop_filled, free, sent: None, next: None, behind: 0, shared };
    let clock = SimulatedClock::new(START_NS, wakes);
    let collected = Collected::default();
    let (samples, _samples) = RingBuffer::new(1);
    let (announcements, _announcements) = RingBuffer::new(1);
    let counts = run_loop(
        &clock,
        &mut replay,
        &mut CommandQueues::default(),
        &mut [Box::new(collected.clone())],
        LoopOptions { run_id: 3, rate: 1e9 / PERIOD_NS as f64, periods: None },
        Reports::new(samples, announcements),
        &clock.stop,
    );
    (counts.ok().unwrap(), collected.0.take())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn whatever_is_late_each_frame_goes_out_once_and_gaps_stay(
        gaps in prop::collection::vec(prop_oneof![4 => Just(1u64), 1 => 2u64..9], 1..40),
        wakes in prop::collection::vec(
            prop_oneof![3 => Just(Wake::Late(0)), 1 => (0..4 * PERIOD_NS).prop_map(Wake::Late)], 0..80),
    ) {
        let due: Vec<u64> = gaps.iter().scan(0, |at, gap| Some(std::mem::replace(at, *at + gap))).collect();
        let (counts, headers) = play(&due, wakes);
        prop_assert_eq!(counts.end, End::Recording);
        prop_assert_eq!(counts.frames as usize, due.len());
        let mut behind = 0;
        for (number, (header, due)) in headers.iter().zip(&due).enumerate() {
            prop_assert_eq!((header.sequence, header.sim_time), (number as u64, number as f64));
            prop_assert_eq!(header.deadline_ns, START_NS + header.tick * PERIOD_NS);
            // No frame is earlier than recorded, and lost time is not made up for.
            let later = header.tick.checked_sub(*due).unwrap();
            prop_assert!(later >= behind, "{later} periods later, {behind} before");
            behind = later;
        }
        prop_assert!(behind <= counts.skipped);
        if counts.skipped == 0 {
            prop_assert_eq!(headers.iter().map(|header| header.tick).collect::<Vec<_>>(), due);
        }
    }
}
