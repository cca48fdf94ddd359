//! The figures of a publisher: rate, gaps, latency, state, alert. In: the events of a
//! [`feed`](bench_dragon_client::feed). Out: an [`IntervalReport`] on request.

use std::time::{Duration, Instant};

use hdrhistogram::Histogram;

use bench_dragon_client::feed::FeedEvent;
use bench_dragon_messages::chase::ChaseState;
use bench_dragon_messages::state::FrameState;
use bench_dragon_messages::{ChaseStatus, CollisionAlert, FrameHeader, HandlePose, LoopStatus, Stage};

/// Time without a status after which a chase counts as dead. A chase sends five statuses a second.
const CHASE_SILENCE: Duration = Duration::from_secs(2);

/// The presence of a publisher.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presence {
    /// There is no publisher.
    Waiting,
    /// Frames come.
    Publishing,
    /// The publisher exists but sends nothing: it is stopped or hangs.
    Silent,
}

/// The latency from sending to receiving over an interval, in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Latency {
    /// Half are at most this.
    pub p50: u64,
    /// 99 % are at most this.
    pub p99: u64,
    /// All are at most this.
    pub max: u64,
}

/// The messages received since the last report, and the latest of each kind.
#[derive(Debug, Clone, PartialEq)]
pub struct IntervalReport {
    /// The presence of the publisher.
    pub presence: Presence,
    /// The latest frame's header, if any frame has come.
    pub header: Option<FrameHeader>,
    /// The latest frame's head; of several dragons the first one's.
    pub head: HandlePose,
    /// The latest frame's heads, in the order of the stage's dragons; empty before the stage.
    pub heads: Vec<HandlePose>,
    /// The stage of the present publisher, which has the names.
    pub stage: Option<Box<Stage>>,
    /// Frames received in this interval, per second.
    pub rate: f64,
    /// Frames received since the monitor started.
    pub received: u64,
    /// Gaps in the sequence since the monitor started.
    pub missed: u64,
    /// The latency in this interval; `None` if no frame came, or if the frames have another machine's clock.
    pub latency: Option<Latency>,
    /// True if the publisher's clock is that of this process.
    pub shares_clock: bool,
    /// The latest alert.
    pub alert: Option<CollisionAlert>,
    /// The latest status of the loop.
    pub status: Option<LoopStatus>,
    /// The latest status of a chase that has not ended, and true if the chase has died without ending.
    pub chase: Option<(ChaseStatus, bool)>,
}

impl IntervalReport {
    /// Returns the latest frame's header while there is a publisher.
    pub fn present_header(&self) -> Option<FrameHeader> {
        self.header.filter(|_| self.presence != Presence::Waiting)
    }

    /// Returns the state of the latest frame, or `None` while waiting.
    pub fn state(&self) -> Option<FrameState> {
        self.present_header()?.frame_state()
    }
}

/// Collects the figures of one publisher's name.
pub struct Monitor {
    presence: Presence,
    header: Option<FrameHeader>,
    head: HandlePose,
    heads: Vec<HandlePose>,
    stage: Option<Box<Stage>>,
    received: u64,
    missed: u64,
    received_in_interval: u64,
    latency: Histogram<u64>,
    interval_began: Instant,
    shares_clock: bool,
    alert: Option<CollisionAlert>,
    status: Option<LoopStatus>,
    chase: Option<(ChaseStatus, Instant)>,
}

impl Default for Monitor {
    fn default() -> Self {
        Self {
            presence: Presence::Waiting,
            header: None,
            head: HandlePose::default(),
            heads: Vec::new(),
            stage: None,
            received: 0,
            missed: 0,
            received_in_interval: 0,
            // 1 ns to an hour with three digits are bounds the constructor accepts.
            latency: Histogram::new_with_bounds(1, 3_600_000_000_000, 3).expect("valid bounds"),
            interval_began: Instant::now(),
            shares_clock: true,
            alert: None,
            status: None,
            chase: None,
        }
    }
}

impl Monitor {
    /// Handles an event that was received at `received_ns` of CLOCK_MONOTONIC.
    pub fn handle(&mut self, event: &FeedEvent<'_>, received_ns: u64) {
        match *event {
            FeedEvent::Frame { header, handles, missed } => {
                self.presence = Presence::Publishing;
                self.latency.saturating_record(received_ns.saturating_sub(header.sent_ns));
                self.received += 1;
                self.received_in_interval += 1;
                self.missed += missed;
                self.header = Some(*header);
                self.head = handles.first().copied().unwrap_or_default();
                let dragons = self.stage.iter().flat_map(|stage| stage.dragons.iter());
                self.heads.clear();
                self.heads.extend(dragons.filter_map(|dragon| handles.get(dragon.first_handle as usize)));
            }
            FeedEvent::Alert(alert) => self.alert = Some(*alert),
            FeedEvent::Status(status) => self.status = Some(*status),
            FeedEvent::Chase(status) => {
                let has_ended = status.chase_state() == Some(ChaseState::Ended);
                self.chase = (!has_ended).then(|| (*status, Instant::now()));
            }
            FeedEvent::Silent => self.presence = Presence::Silent,
            FeedEvent::Gone => {
                self.presence = Presence::Waiting;
                self.status = None;
                self.alert = None;
                self.chase = None;
                self.stage = None;
                self.heads.clear();
            }
            FeedEvent::Stage { stage, .. } => self.stage = Some(Box::new(*stage)),
            FeedEvent::Started { .. } | FeedEvent::Scene { .. } | FeedEvent::Cue(_) => (),
        }
    }

    /// Sets `shares_clock`, as [`Feed::shares_clock`](bench_dragon_client::feed::Feed::shares_clock) returns it; `None`
    /// changes nothing.
    pub fn clock(&mut self, shares_clock: Option<bool>) {
        self.shares_clock = shares_clock.unwrap_or(self.shares_clock);
    }

    /// Returns the figures since the last report, and begins a new interval.
    pub fn report(&mut self) -> IntervalReport {
        let elapsed = self.interval_began.elapsed().as_secs_f64();
        let at = |quantile| self.latency.value_at_quantile(quantile);
        let latency = (self.shares_clock && !self.latency.is_empty()).then(|| Latency {
            p50: at(0.5),
            p99: at(0.99),
            max: self.latency.max(),
        });
        let report = IntervalReport {
            presence: self.presence,
            header: self.header,
            head: self.head,
            heads: self.heads.clone(),
            stage: self.stage.clone(),
            rate: self.received_in_interval as f64 / elapsed,
            received: self.received,
            missed: self.missed,
            latency,
            shares_clock: self.shares_clock,
            alert: self.alert,
            status: self.status,
            chase: self.chase.map(|(status, at)| (status, at.elapsed() >= CHASE_SILENCE)),
        };
        self.latency.reset();
        self.received_in_interval = 0;
        self.interval_began = Instant::now();
        report
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_counts_its_interval_and_all_that_came_before() {
        let mut monitor = Monitor::default();
        let handles = [HandlePose { x: 3.0, ..HandlePose::default() }];
        for (sequence, missed) in [(0, 0), (5, 4)] {
            let header = FrameHeader { sequence, sent_ns: 1000, ..FrameHeader::default() };
            monitor.handle(&FeedEvent::Frame { header: &header, handles: &handles, missed }, 3000);
        }
        let first = monitor.report();
        assert_eq!((first.presence, first.received, first.missed), (Presence::Publishing, 2, 4));
        assert_eq!((first.latency.unwrap().max, first.head.x), (2000, 3.0));
        assert!(first.rate > 0.0);
        let second = monitor.report();
        assert_eq!((second.received, second.missed, second.rate, second.latency), (2, 4, 0.0, None));
    }

    #[test]
    fn moments_of_another_machines_clock_make_no_latency() {
        let mut monitor = Monitor::default();
        let header = FrameHeader { sent_ns: 1000, ..FrameHeader::default() };
        for (clock, has_latency) in [(None, true), (Some(false), false), (None, false), (Some(true), true)] {
            monitor.clock(clock);
            monitor.handle(&FeedEvent::Frame { header: &header, handles: &[], missed: 0 }, 3000);
            let report = monitor.report();
            assert_eq!((report.latency.is_some(), report.shares_clock), (has_latency, has_latency), "{clock:?}");
        }
    }

    #[test]
    fn nothing_of_a_publisher_that_is_gone_is_shown_as_present() {
        let mut monitor = Monitor::default();
        let header = FrameHeader::default();
        let events = [
            FeedEvent::Frame { header: &header, handles: &[], missed: 0 },
            FeedEvent::Alert(&CollisionAlert::default()),
            FeedEvent::Status(&LoopStatus::default()),
        ];
        events.iter().for_each(|event| monitor.handle(event, 0));
        let present = monitor.report();
        assert!(present.state().is_some() && present.alert.is_some() && present.status.is_some());
        monitor.handle(&FeedEvent::Silent, 0);
        assert_eq!(monitor.report().presence, Presence::Silent);
        monitor.handle(&FeedEvent::Gone, 0);
        let gone = monitor.report();
        assert_eq!((gone.presence, gone.state(), gone.alert, gone.status), (Presence::Waiting, None, None, None));
        assert!(gone.header.is_some(), "what was last received is still known");
    }
}
