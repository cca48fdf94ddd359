//! What one subscriber process of a soak test sees and checks: sequence, order, phase, link lengths, latencies.
//!
//! The hidden command `soak-subscriber` runs an [`Observer`] and prints an [`Observation`] a second, which the soak test
//! reads.

use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};

use crate::live::clock::monotonic_ns;
use crate::live::statistics::Percentiles;
use crate::subscribers::connection::{Connection, Subscription};
use crate::transports::iceoryx2::OpenError;
use crate::wire::{FrameHeader, HandlePose, LoopStatus, Stage};

/// How often services are looked for that were not there yet.
const COMPLETION: Duration = Duration::from_millis(100);
/// The longest latency that is told apart: an hour.
const LONGEST_NS: u64 = 3_600_000_000_000;
/// Skipped periods of one gap that are counted as late frames; beyond it the gap itself is the finding.
const MOST_LATE_PERIODS: u64 = 100_000;

/// What a subscriber has seen so far; counts are since its process started.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Observation {
    /// Frames received.
    pub received: u64,
    /// Frames that never came: gaps in `sequence`.
    pub missed: u64,
    /// Periods in which nothing was sent: gaps in `tick` that `sequence` does not share.
    pub skipped: u64,
    /// Frames whose sequence, tick or times contradict those of the frame before, or each other.
    pub disordered: u64,
    /// Frames whose link lengths were compared with the stage's.
    pub links_checked: u64,
    /// Frames with a link of another length than promised.
    pub wrong_links: u64,
    /// The largest difference of a link from its length, metres.
    pub worst_link_error: f64,
    /// The largest distance of a deadline from first deadline + tick / rate, nanoseconds.
    pub phase_error_ns: f64,
    /// Runs of a publisher that frames came from.
    pub runs: u64,
    /// Alerts received.
    pub alerts: u64,
    /// `sequence` of the latest frame.
    pub last_sequence: u64,
    /// `tick` of the latest frame.
    pub last_tick: u64,
    /// Latencies since the last observation; `None` if nothing came.
    pub second: Option<Latencies>,
    /// Latencies since the process started; `None` if nothing ever came.
    pub total: Option<Latencies>,
    /// The latest status of the publisher.
    pub status: Option<Status>,
}

/// Latencies of frames, nanoseconds of CLOCK_MONOTONIC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Latencies {
    /// From `sent_ns` to receiving: what the transport and this process's waking cost.
    pub since_sent: Percentiles,
    /// From `deadline_ns` to receiving, skipped periods included with the latency they would have had: what a user of
    /// a fixed rate sees, a late start of the publisher included.
    pub since_deadline: Percentiles,
}

/// What a soak test records of a [`LoopStatus`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// The rate asked for, frames per second.
    pub rate: f64,
    /// Frames published in the last second, divided by its true length.
    pub measured_rate: f64,
    /// Incidents in which at least one period was skipped, since the start.
    pub overruns: u64,
    /// Periods skipped, since the start.
    pub skipped: u64,
    /// Frames published since the start.
    pub frames: u64,
    /// Times the show has been played to its end.
    pub shows_played: u64,
    /// Wake-up lateness of the last second: median, 99th percentile and maximum, ns.
    pub lateness_second: [u64; 3],
    /// Wake-up lateness since the start: 99.9th percentile, ns.
    pub lateness_p999_total: u64,
    /// Step cost of the last second: median, 99th percentile and maximum, ns.
    pub step_second: [u64; 3],
}

impl From<&LoopStatus> for Status {
    fn from(status: &LoopStatus) -> Self {
        let s = status;
        Self {
            rate: s.rate,
            measured_rate: s.measured_rate,
            overruns: s.overruns,
            skipped: s.skipped,
            frames: s.sequence + 1,
            shows_played: s.shows_played,
            lateness_second: [s.lateness_p50_second, s.lateness_p99_second, s.lateness_max_second],
            lateness_p999_total: s.lateness_p999_total,
            step_second: [s.step_p50_second, s.step_p99_second, s.step_max_second],
        }
    }
}

/// Both latencies of some stretch of time.
struct Stretch {
    since_sent: Histogram<u64>,
    since_deadline: Histogram<u64>,
}

impl Stretch {
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

/// The checks of one subscriber, frame by frame.
pub struct Checks {
    seen: Observation,
    /// Lengths of the head's link and of every other, metres.
    links: Option<[f64; 2]>,
    /// The first frame of the present run.
    first: FrameHeader,
    previous: Option<FrameHeader>,
    second: Stretch,
    total: Stretch,
}

impl Default for Checks {
    fn default() -> Self {
        Self {
            seen: Observation::default(),
            links: None,
            first: FrameHeader::default(),
            previous: None,
            second: Stretch::new(),
            total: Stretch::new(),
        }
    }
}

impl Checks {
    /// Takes in the stage, from which link lengths are checked.
    pub fn stage(&mut self, stage: &Stage) {
        self.links = Some([stage.head_length, stage.body_length].map(|length| length - 2.0 * stage.hole_inset));
    }

    /// Takes in a status, from whose rate the phase is checked.
    pub fn status(&mut self, status: &LoopStatus) {
        self.seen.status = Some(status.into());
    }

    /// Takes in a frame that was received at `received_ns` of CLOCK_MONOTONIC.
    pub fn frame(&mut self, header: &FrameHeader, handles: &[HandlePose], received_ns: u64) {
        let timely = header.deadline_ns <= header.sent_ns && header.sent_ns <= received_ns;
        let whole = header.handles as usize == handles.len();
        let previous = self.previous.replace(*header).filter(|previous| previous.run_id == header.run_id);
        let followed = match &previous {
            Some(previous) => self.follow(previous, header, received_ns),
            None => {
                self.seen.runs += 1;
                self.first = *header;
                true
            }
        };
        self.seen.disordered += u64::from(!(timely && whole && followed));
        self.seen.received += 1;
        self.seen.last_sequence = header.sequence;
        self.seen.last_tick = header.tick;
        for stretch in [&mut self.second, &mut self.total] {
            stretch.since_sent.saturating_record(received_ns.saturating_sub(header.sent_ns));
            stretch.since_deadline.saturating_record(received_ns.saturating_sub(header.deadline_ns));
        }
        self.check_phase(header);
        self.check_links(handles);
    }

    /// Counts what lies between two frames of a run; false where the second cannot follow the first.
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
        self.seen.missed += frames - 1;
        self.seen.skipped += skipped;
        if frames == 1 {
            // What was skipped would have come with this frame: without these the wait would count only once.
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

    fn check_links(&mut self, handles: &[HandlePose]) {
        let Some([head, body]) = self.links else { return };
        let mut right = true;
        for (link, pair) in handles.windows(2).enumerate() {
            let length = (pair[1].x - pair[0].x).hypot(pair[1].y - pair[0].y);
            let expected = if link == 0 { head } else { body };
            let radius = pair[1].x.hypot(pair[1].y);
            let promised = 1e-12 * expected + 4.0 * (radius.next_up() - radius);
            let error = (length - expected).abs();
            // A length that is no number is wrong as well.
            right &= error <= promised;
            self.seen.worst_link_error = self.seen.worst_link_error.max(error);
        }
        self.seen.links_checked += 1;
        self.seen.wrong_links += u64::from(!right);
    }

    /// What was seen; begins a new second.
    pub fn observation(&mut self) -> Observation {
        let observation =
            Observation { second: self.second.latencies(), total: self.total.latencies(), ..self.seen.clone() };
        self.second.clear();
        observation
    }
}

/// A subscriber that checks what it receives.
pub struct Observer {
    subscription: Subscription,
    connection: Option<Connection>,
    checks: Checks,
    last_completion: Instant,
}

impl Observer {
    /// An observer of the publisher of `name`, which need not be there yet.
    ///
    /// # Errors
    /// [`OpenError`] for a name that iceoryx2 cannot take.
    pub fn new(name: &str) -> Result<Self, OpenError> {
        let subscription = Subscription::new(name)?;
        Ok(Self { subscription, connection: None, checks: Checks::default(), last_completion: Instant::now() })
    }

    /// Waits for frames, at most `timeout`, and takes in what has come.
    ///
    /// # Errors
    /// [`OpenError`] where the publisher's services exist and cannot be used.
    pub fn step(&mut self, timeout: Duration) -> Result<(), OpenError> {
        let Some(connection) = &mut self.connection else {
            self.connection = self.subscription.connect()?;
            if self.connection.is_none() {
                std::thread::sleep(timeout.min(Duration::from_millis(20)));
            }
            return Ok(());
        };
        connection.wait(timeout);
        while let Some(stage) = connection.stage() {
            self.checks.stage(&stage);
        }
        connection.frames(|header, handles| self.checks.frame(header, handles, monotonic_ns()));
        while let Some(status) = connection.status() {
            self.checks.status(&status);
        }
        while connection.alert().is_some() {
            self.checks.seen.alerts += 1;
        }
        if self.last_completion.elapsed() >= COMPLETION {
            self.subscription.complete(connection)?;
            self.last_completion = Instant::now();
        }
        Ok(())
    }

    /// What was seen so far; begins a new second.
    pub fn observation(&mut self) -> Observation {
        self.checks.observation()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    fn checks() -> Checks {
        let mut checks = Checks::default();
        checks.stage(&Stage { head_length: 3.5, body_length: 1.5, hole_inset: 0.25, ..Stage::default() });
        checks
    }

    fn take(checks: &mut Checks, header: FrameHeader) {
        checks.frame(&header, &handles(), header.sent_ns + 10_000);
    }

    #[test]
    fn a_faultless_stream_has_no_faults() {
        let mut checks = checks();
        (0..100).for_each(|frame| take(&mut checks, header(frame, frame)));
        let seen = checks.observation();
        assert_eq!((seen.received, seen.missed, seen.skipped, seen.disordered, seen.runs), (100, 0, 0, 0, 1));
        assert_eq!((seen.links_checked, seen.wrong_links), (100, 0));
        let latencies = seen.total.unwrap();
        assert!(latencies.since_sent.p50.abs_diff(10_000) < 20, "{latencies:?}");
        assert!(latencies.since_deadline.p50.abs_diff(50_000) < 100, "{latencies:?}");
    }

    #[test]
    fn missed_frames_and_skipped_periods_are_told_apart() {
        let mut checks = checks();
        // Three periods skipped by the publisher, then two frames that were sent and did not arrive.
        for (sequence, tick) in [(0, 0), (1, 4), (4, 7)] {
            take(&mut checks, header(sequence, tick));
        }
        let seen = checks.observation();
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
            let mut checks = checks();
            take(&mut checks, header(0, 0));
            take(&mut checks, second);
            assert_eq!(checks.observation().disordered, 1, "{second:?}");
        }
    }

    #[test]
    fn a_link_of_another_length_is_seen() {
        for wrong in [1e-11, f64::NAN] {
            let mut checks = checks();
            let mut handles = handles();
            handles[2].y += wrong;
            checks.frame(&header(0, 0), &handles, 8_000_000_000);
            let seen = checks.observation();
            assert_eq!((seen.links_checked, seen.wrong_links), (1, 1));
        }
    }

    #[test]
    fn a_clock_that_drifts_is_seen() {
        let status = |rate| LoopStatus { rate, run_id: 5, ..LoopStatus::default() };
        for (rate, error) in [(1000.0, 0.0), (1000.1, 99_990.0)] {
            let mut checks = checks();
            checks.status(&status(rate));
            [0, 1000].into_iter().for_each(|frame| take(&mut checks, header(frame, frame)));
            let seen = checks.observation();
            assert!((seen.phase_error_ns - error).abs() < 1.0, "{seen:?}");
        }
    }

    #[test]
    fn observations_survive_the_pipe() {
        let mut checks = checks();
        take(&mut checks, header(0, 0));
        let seen = checks.observation();
        let text = serde_json::to_string(&seen).unwrap();
        assert_eq!(serde_json::from_str::<Observation>(&text).unwrap(), seen);
    }
}
