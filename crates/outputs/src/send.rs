//! Outputs to other machines: trackers for lighting desks ([`psn_sender`]) and OSC messages ([`osc_sender`]).
//!
//! Each is a subscriber of each publisher, in a separate process. This file has their common part: it decides which
//! frames are due, and when frames have stopped. In: the events of a feed. Out: UDP datagrams.

pub mod axes;
pub mod network;
pub mod osc;
pub mod osc_map;
pub mod osc_sender;
pub mod psn;
pub mod psn_sender;
mod psn_source;
pub mod trackers;

use std::time::{Duration, Instant};

use bench_dragon_client::feed::FeedEvent;
use bench_dragon_messages::FrameHeader;

/// Time without frames after which receivers get the message that frames have stopped. A publisher that is restarted at
/// once sends again before that.
pub const STOPPED_AFTER: Duration = Duration::from_secs(2);

/// Selects the frames that are due, at a limited rate: the first frame of each interval, by the frames' deadlines. A
/// publisher of at most that rate has every frame sent, even late ones. The frames of a faster publisher are evenly
/// spread.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    rate: f64,
    /// The run, the deadline of its first frame, and the interval of its latest frame that was due.
    latest: Option<(u64, u64, u64)>,
}

impl Pace {
    /// Creates a selection of at most `rate` frames per second.
    pub fn new(rate: f64) -> Self {
        Self { rate, latest: None }
    }

    /// Returns true if a frame is due. Call it with the frames of a run in their order.
    pub fn is_due(&mut self, header: &FrameHeader) -> bool {
        let Some((_, first_ns, latest)) = self.latest.as_mut().filter(|(run_id, ..)| *run_id == header.run_id) else {
            self.latest = Some((header.run_id, header.deadline_ns, 0));
            return true;
        };
        // Deadlines are rounded to nanoseconds: a deadline at the beginning of an interval must not fall before it.
        let interval = (header.deadline_ns.saturating_sub(*first_ns) as f64 * 1e-9 * self.rate + 0.01) as u64;
        let due = interval > *latest;
        *latest = interval.max(*latest);
        due
    }
}

/// The arrivals of frames. The feed reports at once that they have stopped; receivers get that message after
/// [`STOPPED_AFTER`].
#[derive(Debug, Clone, Copy, Default)]
pub struct Arrivals {
    last_frame: Option<Instant>,
    reported: bool,
}

impl Arrivals {
    /// Handles an event.
    pub fn handle(&mut self, event: &FeedEvent<'_>, now: Instant) {
        match event {
            FeedEvent::Frame { .. } => *self = Self { last_frame: Some(now), reported: false },
            FeedEvent::Silent | FeedEvent::Gone => self.reported = true,
            _ => (),
        }
    }

    /// Returns the moment at which frames stopped; `None` while they come, and before the first one.
    pub fn stopped_since(&self, now: Instant) -> Option<Instant> {
        let since = self.last_frame? + STOPPED_AFTER;
        (self.reported && now >= since).then_some(since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn due(publisher: f64, rate: f64, seconds: f64) -> Vec<u64> {
        let mut pace = Pace::new(rate);
        let frames = (0..(publisher * seconds) as u64).map(|tick| FrameHeader {
            run_id: 7,
            sequence: tick,
            deadline_ns: 123_456_789 + (tick as f64 * 1e9 / publisher) as u64,
            ..FrameHeader::default()
        });
        frames.filter(|header| pace.is_due(header)).map(|header| header.sequence).collect()
    }

    #[test]
    fn a_publisher_of_that_rate_or_a_lower_one_has_every_frame_sent() {
        for publisher in [60.0, 59.94, 50.0, 30.0, 1.0, 0.2] {
            let frames = (publisher * 100.0) as u64;
            assert_eq!(due(publisher, 60.0, 100.0), Vec::from_iter(0..frames), "{publisher} Hz");
        }
    }

    #[test]
    fn a_faster_one_has_evenly_spread_frames_sent_and_no_more() {
        for publisher in [61.0, 90.0, 100.0, 120.0, 1000.0] {
            let sent = due(publisher, 60.0, 100.0);
            assert!((5999..=6001).contains(&sent.len()), "{publisher} Hz: {}", sent.len());
            let gaps: Vec<_> = sent.windows(2).map(|pair| (pair[1] - pair[0]) as f64).collect();
            let even = publisher / 60.0;
            assert!(gaps.iter().all(|gap| (gap - even).abs() <= 1.0), "{publisher} Hz: {gaps:?}");
        }
        assert_eq!(due(60.0, 1.0, 10.0), Vec::from_iter((0..10).map(|second| 60 * second)));
    }

    #[test]
    fn a_new_run_begins_anew() {
        let mut pace = Pace::new(60.0);
        let header = |run_id, deadline_ns| FrameHeader { run_id, deadline_ns, ..FrameHeader::default() };
        assert!(pace.is_due(&header(1, 5_000_000_000)) && !pace.is_due(&header(1, 5_001_000_000)));
        assert!(pace.is_due(&header(2, 1_000_000_000)) && !pace.is_due(&header(2, 1_001_000_000)));
    }

    #[test]
    fn frames_have_stopped_two_seconds_after_the_last_where_the_feed_says_so() {
        let (began, mut arrivals) = (Instant::now(), Arrivals::default());
        let at = |seconds| began + Duration::from_secs(seconds);
        let header = FrameHeader::default();
        let frame = FeedEvent::Frame { header: &header, handles: &[], missed: 0 };
        arrivals.handle(&FeedEvent::Gone, at(0));
        assert_eq!(arrivals.stopped_since(at(9)), None, "none has ever come");
        arrivals.handle(&frame, at(10));
        assert_eq!(arrivals.stopped_since(at(30)), None, "a slow publisher");
        arrivals.handle(&FeedEvent::Silent, at(11));
        assert_eq!((arrivals.stopped_since(at(11)), arrivals.stopped_since(at(13))), (None, Some(at(12))));
        arrivals.handle(&frame, at(14));
        assert_eq!(arrivals.stopped_since(at(30)), None);
    }
}
