//! The checks of one subscriber process of a soak test: sequence, order, phase, link lengths, latencies.
//!
//! In: the events of a [`feed`](bench_dragon_client::feed). Out: an [`Observation`]. The hidden command
//! `soak-subscriber` prints one a second, which the soak test reads.

use std::ops::Range;

use hdrhistogram::Histogram;

use super::conformance::ConformanceCheck;
use super::observation::{Latencies, Observation};
use bench_dragon_client::feed::FeedEvent;
use bench_dragon_messages::{FrameHeader, HandlePose, LoopStatus, Stage, StageDragon};
use bench_dragon_publisher::live::statistics::Percentiles;

/// The longest latency that is resolved: an hour.
const LONGEST_NS: u64 = 3_600_000_000_000;
/// Skipped periods of one gap that are counted as late frames; beyond it the gap itself is the finding.
const MOST_LATE_PERIODS: u64 = 100_000;

/// The distributions of both latencies over a time.
struct Histograms {
    since_sent: Histogram<u64>,
    since_deadline: Histogram<u64>,
}

impl Histograms {
    fn new() -> Self {
        // 1 ns to an hour with three digits are bounds the constructor accepts.
        let histogram = || Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("valid bounds");
        Self { since_sent: histogram(), since_deadline: histogram() }
    }

    fn latencies(&self) -> Option<Latencies> {
        let [since_sent, since_deadline] = [&self.since_sent, &self.since_deadline].map(Percentiles::of);
        (!self.since_sent.is_empty()).then_some(Latencies { since_sent, since_deadline })
    }

    fn clear(&mut self) {
        self.since_sent.reset();
        self.since_deadline.reset();
    }
}

/// The links of one dragon.
struct Links {
    handles: Range<usize>,
    /// By kind of bench (head, body, tail): the length of its link, in metres.
    lengths: [f64; 3],
}

impl Links {
    fn of(dragon: &StageDragon) -> Self {
        let first = dragon.first_handle as usize;
        let lengths = [dragon.head_length, dragon.body_length, dragon.tail_length];
        let lengths = lengths.map(|length| length - 2.0 * dragon.hole_inset);
        Self { handles: first..first + dragon.benches as usize + 1, lengths }
    }
}

/// Checks the messages that one subscriber receives.
pub struct Observer {
    seen: Observation,
    /// The links of each dragon.
    links: Vec<Links>,
    /// The tolerance of links besides rounding, in metres.
    link_tolerance: f64,
    /// The first frame of the present run.
    first: FrameHeader,
    previous: Option<FrameHeader>,
    conformance: ConformanceCheck,
    second: Histograms,
    total: Histograms,
}

impl Default for Observer {
    /// Creates an observer of a scene whose links are exact.
    fn default() -> Self {
        Self::new(0.0)
    }
}

impl Observer {
    /// Creates an observer of a scene whose links have a tolerance of `link_tolerance` metres besides rounding.
    pub fn new(link_tolerance: f64) -> Self {
        Self {
            seen: Observation::default(),
            links: Vec::new(),
            link_tolerance,
            first: FrameHeader::default(),
            previous: None,
            conformance: ConformanceCheck::default(),
            second: Histograms::new(),
            total: Histograms::new(),
        }
    }

    /// Handles an event that was received at `received_ns` of CLOCK_MONOTONIC.
    pub fn handle(&mut self, event: &FeedEvent<'_>, received_ns: u64) {
        match *event {
            FeedEvent::Started { .. } => self.seen.runs += 1,
            FeedEvent::Stage { stage, .. } => self.stage(stage),
            FeedEvent::Frame { header, handles, missed } => {
                self.seen.missed += missed;
                self.frame(header, handles, received_ns);
                self.check_conformance(header, handles);
            }
            FeedEvent::Alert(_) => self.seen.alerts += 1,
            FeedEvent::Status(status) => self.status(status),
            FeedEvent::Scene { .. } | FeedEvent::Cue(_) | FeedEvent::Chase(_) | FeedEvent::Silent | FeedEvent::Gone => {
            }
        }
    }

    /// Takes the lengths of the links from the stage.
    fn stage(&mut self, stage: &Stage) {
        self.links = stage.dragons.iter().map(Links::of).collect();
    }

    /// Stores a status, whose rate determines the phase.
    fn status(&mut self, status: &LoopStatus) {
        self.seen.status = Some(status.into());
    }

    fn frame(&mut self, header: &FrameHeader, handles: &[HandlePose], received_ns: u64) {
        let timely = header.deadline_ns <= header.sent_ns && header.sent_ns <= received_ns;
        let whole = header.handles as usize == handles.len();
        let previous = self.previous.replace(*header).filter(|previous| previous.run_id == header.run_id);
        let followed = match &previous {
            Some(previous) => self.follow(previous, header, received_ns),
            None => {
                self.first = *header;
                true
            }
        };
        self.seen.disordered += u64::from(!(timely && whole && followed));
        self.seen.received += 1;
        self.seen.last_sequence = header.sequence;
        self.seen.last_tick = header.tick;
        for histograms in [&mut self.second, &mut self.total] {
            histograms.since_sent.saturating_record(received_ns.saturating_sub(header.sent_ns));
            histograms.since_deadline.saturating_record(received_ns.saturating_sub(header.deadline_ns));
        }
        self.check_phase(header);
        self.check_links(handles);
    }

    /// Counts the skipped periods between two frames of a run. Returns false if the second frame cannot follow the
    /// first.
    fn follow(&mut self, previous: &FrameHeader, header: &FrameHeader, received_ns: u64) -> bool {
        let advance = |of: fn(&FrameHeader) -> u64| of(header).checked_sub(of(previous)).filter(|step| *step > 0);
        let steps = (
            advance(|header| header.sequence),
            advance(|header| header.tick),
            advance(|header| header.sent_ns),
            advance(|header| header.deadline_ns),
        );
        let (Some(frames), Some(periods), Some(_), Some(span_ns)) = steps else { return false };
        let Some(skipped) = periods.checked_sub(frames) else { return false };
        self.seen.skipped += skipped;
        if frames == 1 {
            // The skipped periods count as late frames that came with this one: otherwise the wait would count only
            // once.
            let period_ns = span_ns / periods;
            for period in 1..=skipped.min(MOST_LATE_PERIODS) {
                let latency_ns = received_ns.saturating_sub(header.deadline_ns - period * period_ns);
                self.second.since_deadline.saturating_record(latency_ns);
                self.total.since_deadline.saturating_record(latency_ns);
            }
        }
        true
    }

    fn check_phase(&mut self, header: &FrameHeader) {
        let Some(status) = &self.seen.status else { return };
        let periods = header.tick.saturating_sub(self.first.tick);
        let elapsed = header.deadline_ns.saturating_sub(self.first.deadline_ns);
        let error = (elapsed as f64 - periods as f64 * 1e9 / status.rate).abs();
        self.seen.phase_error_ns = self.seen.phase_error_ns.max(error);
    }

    fn check_conformance(&mut self, header: &FrameHeader, handles: &[HandlePose]) {
        self.seen.epoch = header.epoch;
        // Times cannot be checked without the rate.
        let Some(status) = self.seen.status else { return };
        self.seen.times_checked += 1;
        if let Err(fault) = self.conformance.check(header, handles, status.rate) {
            self.seen.disobedient += 1;
            self.seen.disobedience.get_or_insert_with(|| fault.to_string());
        }
    }

    fn check_links(&mut self, handles: &[HandlePose]) {
        if self.links.is_empty() {
            return;
        }
        let mut right = true;
        for Links { handles: own, lengths: [head, body, tail] } in &self.links {
            let Some(own) = handles.get(own.clone()) else {
                right = false;
                continue;
            };
            for (link, pair) in own.windows(2).enumerate() {
                let length = (pair[1].x - pair[0].x).hypot(pair[1].y - pair[0].y);
                let expected = match link {
                    0 => head,
                    _ if link + 2 == own.len() => tail,
                    _ => body,
                };
                let radius = pair[1].x.hypot(pair[1].y);
                let promised = self.link_tolerance + 1e-12 * expected + 4.0 * (radius.next_up() - radius);
                let error = (length - expected).abs();
                // NaN is a wrong length too.
                right &= error <= promised;
                self.seen.worst_link_error = self.seen.worst_link_error.max(error);
            }
        }
        self.seen.links_checked += 1;
        self.seen.wrong_links += u64::from(!right);
    }

    /// Returns the observation, and begins a new second.
    pub fn observation(&mut self) -> Observation {
        let observation =
            Observation { second: self.second.latencies(), total: self.total.latencies(), ..self.seen.clone() };
        self.second.clear();
        observation
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_client::feed::sequence::SequenceTracker;
    use bench_dragon_messages::List;

    const PERIOD_NS: u64 = 1_000_000;

    fn header(sequence: u64, tick: u64) -> FrameHeader {
        let deadline_ns = 7_000_000_000 + tick * PERIOD_NS;
        FrameHeader {
            run_id: 5,
            sequence,
            tick,
            deadline_ns,
            sent_ns: deadline_ns + 40_000,
            handles: 3,
            ..FrameHeader::default()
        }
    }

    /// Two links of 3 and 1 m, the second turned by a right angle.
    fn handles() -> [HandlePose; 3] {
        [(10.0, 0.0), (13.0, 0.0), (13.0, 1.0)].map(|(x, y)| HandlePose { x, y, ..HandlePose::default() })
    }

    /// An observer after the feed's tracker of the sequence.
    #[derive(Default)]
    struct Received {
        observer: Observer,
        sequence: SequenceTracker,
    }

    impl Received {
        fn new() -> Self {
            let mut received = Self::default();
            let dragon = StageDragon {
                benches: 2,
                head_length: 3.5,
                tail_length: 1.5,
                hole_inset: 0.25,
                ..StageDragon::default()
            };
            let stage = Stage { dragons: List::of([dragon]), ..Stage::default() };
            received.observer.handle(&FeedEvent::Stage { stage: &stage, segments: &[] }, 0);
            received
        }

        fn frame(&mut self, header: FrameHeader, handles: &[HandlePose]) {
            let missed = self.sequence.advance(header.run_id, header.sequence);
            if missed.is_none() {
                self.observer.handle(&FeedEvent::Started { run_id: header.run_id }, 0);
            }
            let event = FeedEvent::Frame { header: &header, handles, missed: missed.unwrap_or(0) };
            self.observer.handle(&event, header.sent_ns + 10_000);
        }

        /// An observer that has received these frames.
        fn of(headers: impl IntoIterator<Item = FrameHeader>) -> Observation {
            let mut received = Self::new();
            headers.into_iter().for_each(|header| received.frame(header, &handles()));
            received.observer.observation()
        }
    }

    #[test]
    fn a_faultless_stream_has_no_faults() {
        let seen = Received::of((0..100).map(|frame| header(frame, frame)));
        assert_eq!((seen.received, seen.missed, seen.skipped, seen.disordered, seen.runs), (100, 0, 0, 0, 1));
        assert_eq!((seen.links_checked, seen.wrong_links), (100, 0));
        let latencies = seen.total.unwrap();
        assert!(latencies.since_sent.p50.abs_diff(10_000) < 20, "{latencies:?}");
        assert!(latencies.since_deadline.p50.abs_diff(50_000) < 100, "{latencies:?}");
    }

    #[test]
    fn missed_frames_and_skipped_periods_are_distinguished() {
        // Three periods skipped by the publisher, then two frames that were sent and did not arrive.
        let seen = Received::of([(0, 0), (1, 4), (4, 7)].map(|(sequence, tick)| header(sequence, tick)));
        assert_eq!((seen.missed, seen.skipped, seen.disordered), (2, 3, 0));
        // The skipped periods count with 1, 2 and 3 periods of waiting more.
        let longest = seen.total.unwrap().since_deadline.max;
        assert!(longest.abs_diff(3 * PERIOD_NS + 50_000) < 5_000, "{longest}");
    }

    #[test]
    fn what_cannot_follow_is_disorder() {
        let late = FrameHeader { sent_ns: 0, ..header(1, 1) };
        let repeated = header(0, 0);
        let backwards = FrameHeader { sequence: 3, ..header(0, 1) };
        for second in [late, repeated, backwards] {
            assert_eq!(Received::of([header(0, 0), second]).disordered, 1, "{second:?}");
        }
    }

    #[test]
    fn a_link_of_another_length_is_seen() {
        for wrong in [1e-11, f64::NAN] {
            let mut received = Received::new();
            let mut handles = handles();
            handles[2].y += wrong;
            received.frame(header(0, 0), &handles);
            let seen = received.observer.observation();
            assert_eq!((seen.links_checked, seen.wrong_links), (1, 1));
        }
    }

    #[test]
    fn the_last_handle_of_a_dragon_leads_no_link() {
        let mut received = Received::new();
        let one = StageDragon { benches: 1, head_length: 3.0, body_length: 2.0, ..StageDragon::default() };
        let dragons = List::of([one, StageDragon { first_handle: 2, ..one }]);
        received.observer.handle(&FeedEvent::Stage { stage: &Stage { dragons, ..Stage::default() }, segments: &[] }, 0);
        let at = |x: f64| HandlePose { x, ..HandlePose::default() };
        let mut handles = [at(0.0), at(3.0), at(50.0), at(53.0)];
        let frame = |sequence| FrameHeader { handles: 4, ..header(sequence, sequence) };
        received.frame(frame(0), &handles);
        assert_eq!(received.observer.observation().wrong_links, 0);
        handles[3].x += 1e-9;
        received.frame(frame(1), &handles);
        assert_eq!(received.observer.observation().wrong_links, 1);
    }

    #[test]
    fn a_second_run_is_counted_and_is_no_gap() {
        let next = FrameHeader { run_id: 6, ..header(0, 0) };
        let seen = Received::of([header(7, 7), header(9, 9), next]);
        assert_eq!((seen.runs, seen.missed, seen.disordered), (2, 1, 0));
    }

    #[test]
    fn a_clock_that_drifts_is_seen() {
        let status = |rate| LoopStatus { rate, run_id: 5, ..LoopStatus::default() };
        for (rate, error) in [(1000.0, 0.0), (1000.1, 99_990.0)] {
            let mut received = Received::new();
            received.observer.handle(&FeedEvent::Status(&status(rate)), 0);
            [0, 1000].into_iter().for_each(|frame| received.frame(header(frame, frame), &handles()));
            let seen = received.observer.observation();
            assert!((seen.phase_error_ns - error).abs() < 1.0, "{seen:?}");
        }
    }

    #[test]
    fn observations_survive_the_pipe() {
        let seen = Received::of([header(0, 0)]);
        let text = serde_json::to_string(&seen).unwrap();
        assert_eq!(serde_json::from_str::<Observation>(&text).unwrap(), seen);
    }
}
