//! The frames of a show that go to ROS 2 at a lower rate than the loop's. Pure.

use bench_dragon_messages::FrameHeader;

/// Chooses evenly spaced frames.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RateDivider {
    /// The greatest number of frames per second.
    rate: f64,
    /// The rate of the loop, when known: first from the deadlines of two frames, then from a status.
    loop_rate: Option<f64>,
    /// Tick and deadline of the first frame.
    first: Option<(u64, u64)>,
    latest_slot: Option<u64>,
}

/// The choice for one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Choice {
    /// True if the frame must be sent.
    pub is_due: bool,
    /// Frames before it that had to be sent and were lost.
    pub skipped: u64,
}

impl RateDivider {
    /// Creates a divider to at most `rate` frames per second.
    pub(super) fn new(rate: f64) -> Self {
        Self { rate, loop_rate: None, first: None, latest_slot: None }
    }

    /// Sets the rate of the loop. An invalid rate changes nothing.
    pub(super) fn set_loop_rate(&mut self, rate: f64) {
        if rate.is_finite() && rate > 0.0 {
            self.loop_rate = Some(rate);
        }
    }

    /// Chooses a frame, before which `missed` frames were lost. All frames are due until the rate of the loop is known.
    pub(super) fn choose(&mut self, header: &FrameHeader, missed: u64) -> Choice {
        let (tick, deadline_ns) = (header.tick, header.deadline_ns);
        let (first_tick, first_ns) = *self.first.get_or_insert((tick, deadline_ns));
        if self.loop_rate.is_none() && tick > first_tick && deadline_ns > first_ns {
            self.loop_rate = Some((tick - first_tick) as f64 * 1e9 / (deadline_ns - first_ns) as f64);
        }
        // Deadlines are whole nanoseconds: an estimated rate can be a little above the requested one.
        let share = self.loop_rate.map_or(1.0, |of_loop| self.rate / of_loop);
        let share = if share > 0.999 { 1.0 } else { share };
        // At 20,000 ticks a second, 2^53 ticks last 14,000 years.
        let slot = (tick as f64 * share) as u64;
        let before = self.latest_slot.replace(slot);
        // The loop itself can skip periods: their slots are not lost here.
        let passed = before.map_or(0, |before| slot.saturating_sub(before + 1));
        Choice { is_due: before != Some(slot), skipped: passed.min(missed) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The ticks that are sent at `loop_rate`, and the number of skipped frames. Every frame comes except the ticks of
    /// `lost`.
    fn sent(rate: f64, loop_rate: f64, ticks: std::ops::Range<u64>, lost: std::ops::Range<u64>) -> (Vec<u64>, u64) {
        let mut divider = RateDivider::new(rate);
        let (mut sent, mut skipped, mut missed) = (Vec::new(), 0, 0);
        for tick in ticks {
            if lost.contains(&tick) {
                missed += 1;
                continue;
            }
            let deadline_ns = 5_000_000_000 + (tick as f64 * 1e9 / loop_rate) as u64;
            let choice = divider.choose(&FrameHeader { tick, deadline_ns, ..FrameHeader::default() }, missed);
            missed = 0;
            skipped += choice.skipped;
            if choice.is_due {
                sent.push(tick);
            }
            if tick % 100 == 99 {
                divider.set_loop_rate(loop_rate);
            }
        }
        (sent, skipped)
    }

    #[test]
    fn a_loop_that_is_not_faster_loses_nothing() {
        for (rate, loop_rate) in [(60.0, 60.0), (60.0, 59.94), (60.0, 0.1), (20_000.0, 20_000.0), (1000.0 / 3.0, 333.3)]
        {
            let (sent, skipped) = sent(rate, loop_rate, 7..2007, 0..0);
            assert_eq!((sent.len(), skipped), (2000, 0), "{rate} of {loop_rate}");
        }
    }

    #[test]
    fn frames_of_a_faster_loop_are_evenly_spaced() {
        for (rate, loop_rate) in [(30.0, 60.0), (60.0, 1000.0), (2.0, 60.0), (59.0, 60.0), (7.0, 20_000.0)] {
            let (sent, skipped) = sent(rate, loop_rate, 1_000_000..1_100_000, 0..0);
            // The rate of the loop is known from the second frame on.
            let apart: Vec<u64> = sent.windows(2).skip(2).map(|pair| pair[1] - pair[0]).collect();
            let period = loop_rate / rate;
            assert!(apart.iter().all(|ticks| (*ticks as f64 - period).abs() < 1.0), "{rate} of {loop_rate}: {apart:?}");
            let expected = 100_000.0 * rate / loop_rate;
            assert!((sent.len() as f64 - expected).abs() <= 3.0, "{} of {expected}", sent.len());
            assert_eq!(skipped, 0);
        }
    }

    #[test]
    fn lost_frames_count_if_they_were_due() {
        let (all, none) = sent(60.0, 60.0, 0..1000, 0..0);
        assert_eq!((all.len(), none), (1000, 0));
        assert_eq!(sent(60.0, 60.0, 0..1000, 500..520).1, 20);
        let (few, skipped) = sent(30.0, 60.0, 0..1000, 500..520);
        assert!((few.len() as u64 + skipped).abs_diff(500) <= 2 && (9..=10).contains(&skipped), "{skipped}");
    }
}
