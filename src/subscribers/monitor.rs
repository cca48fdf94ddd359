//! What a monitor knows of a publisher: rate, gaps, latency, state, alerts. Called by `watch`.

use std::time::{Duration, Instant};

use hdrhistogram::Histogram;

use crate::live::clock::monotonic_ns;
use crate::show::state::FrameState;
use crate::transports::iceoryx2::OpenError;
use crate::wire::{CollisionAlert, FrameHeader, HandlePose, LoopStatus};

use super::connection::{Connection, Subscription};

/// How long a publisher may be silent before it is looked for: at least this, and three periods.
const SILENCE: Duration = Duration::from_millis(500);
/// How often services are looked for that were not there yet.
const COMPLETION: Duration = Duration::from_millis(100);

/// Whether there is a publisher.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presence {
    /// None yet, or none any more.
    Waiting,
    /// Frames come.
    Publishing,
    /// The publisher is there but sends nothing: it is stopped or hangs.
    Silent,
}

/// Something to tell at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum News {
    /// Frames come from a run not seen before.
    Started {
        /// The new run.
        run_id: u64,
    },
    /// The publisher has ended or died.
    Gone,
    /// The publisher is there but has stopped sending.
    FellSilent,
    /// An alert.
    Alert(CollisionAlert),
}

/// Latency from sending to receiving over a second, nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Latency {
    /// Half are at most this.
    pub p50: u64,
    /// 99 % are at most this.
    pub p99: u64,
    /// All are at most this.
    pub max: u64,
}

/// A second in figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Second {
    /// Whether there is a publisher.
    pub presence: Presence,
    /// The latest frame's header, if there was ever one.
    pub header: Option<FrameHeader>,
    /// The latest frame's head.
    pub head: HandlePose,
    /// Frames received in this second, per second.
    pub rate: f64,
    /// Frames received since the monitor started.
    pub received: u64,
    /// Gaps in the sequence since the monitor started.
    pub missed: u64,
    /// Latency in this second; `None` if nothing came.
    pub latency: Option<Latency>,
    /// The latest alert.
    pub alert: Option<CollisionAlert>,
    /// The latest status of the loop.
    pub status: Option<LoopStatus>,
}

impl Second {
    /// The state of the latest frame, or `None` while waiting.
    pub fn state(&self) -> Option<FrameState> {
        self.header.filter(|_| self.presence != Presence::Waiting)?.frame_state()
    }
}

/// Watches one publisher's name.
pub struct Monitor {
    subscription: Subscription,
    connection: Option<Connection>,
    presence: Presence,
    header: Option<FrameHeader>,
    head: HandlePose,
    received: u64,
    missed: u64,
    received_this_second: u64,
    latency: Histogram<u64>,
    second_began: Instant,
    last_frame: Instant,
    last_look: Instant,
    last_completion: Instant,
    alert: Option<CollisionAlert>,
    status: Option<LoopStatus>,
}

impl Monitor {
    /// A monitor of the services of `name`.
    ///
    /// # Errors
    /// [`OpenError`] for a name that iceoryx2 cannot take.
    pub fn new(name: &str) -> Result<Self, OpenError> {
        let now = Instant::now();
        Ok(Self {
            subscription: Subscription::new(name)?,
            connection: None,
            presence: Presence::Waiting,
            header: None,
            head: HandlePose::default(),
            received: 0,
            missed: 0,
            received_this_second: 0,
            // 1 ns to an hour with three digits are bounds the constructor accepts.
            latency: Histogram::new_with_bounds(1, 3_600_000_000_000, 3).expect("valid bounds"),
            second_began: now,
            last_frame: now,
            last_look: now,
            last_completion: now,
            alert: None,
            status: None,
        })
    }

    /// Waits for what comes, at most `timeout`, takes it in and tells `tell` the news.
    ///
    /// # Errors
    /// [`OpenError`] where the publisher's services exist and cannot be used.
    pub fn step(&mut self, timeout: Duration, mut tell: impl FnMut(News)) -> Result<(), OpenError> {
        let Some(connection) = &self.connection else {
            self.connection = self.subscription.connect()?;
            if self.connection.is_none() {
                std::thread::sleep(timeout.min(Duration::from_millis(100)));
            }
            return Ok(());
        };
        connection.wait(timeout);
        self.take_frames(&mut tell);
        self.take_messages(&mut tell);
        self.complete()?;
        self.look_for_publisher(&mut tell);
        Ok(())
    }

    fn take_frames(&mut self, tell: &mut impl FnMut(News)) {
        let Some(connection) = self.connection.take() else { return };
        let count = connection.frames(|header, handles| {
            self.latency.saturating_record(monotonic_ns().saturating_sub(header.sent_ns));
            let previous = self.header.filter(|previous| previous.run_id == header.run_id);
            match previous {
                Some(previous) => self.missed += header.sequence.saturating_sub(previous.sequence + 1),
                None => tell(News::Started { run_id: header.run_id }),
            }
            self.header = Some(*header);
            self.head = handles.first().copied().unwrap_or_default();
        });
        self.received += count as u64;
        self.received_this_second += count as u64;
        if count > 0 {
            self.last_frame = Instant::now();
            self.presence = Presence::Publishing;
        }
        self.connection = Some(connection);
    }

    fn take_messages(&mut self, tell: &mut impl FnMut(News)) {
        let Some(connection) = &self.connection else { return };
        while let Some(alert) = connection.alert() {
            self.alert = Some(alert);
            tell(News::Alert(alert));
        }
        while let Some(status) = connection.status() {
            self.status = Some(status);
        }
    }

    fn complete(&mut self) -> Result<(), OpenError> {
        if let Some(connection) = &mut self.connection
            && self.last_completion.elapsed() >= COMPLETION
        {
            self.subscription.complete(connection)?;
            self.last_completion = Instant::now();
        }
        Ok(())
    }

    /// After a silence: is the publisher gone, or does it only say nothing?
    fn look_for_publisher(&mut self, tell: &mut impl FnMut(News)) {
        let Some(connection) = &mut self.connection else { return };
        let period = self.status.map_or(Duration::ZERO, |status| Duration::from_secs_f64(3.0 / status.rate));
        let due = self.last_look.elapsed() >= Duration::from_millis(200);
        if self.last_frame.elapsed() < SILENCE.max(period) || !due {
            return;
        }
        self.last_look = Instant::now();
        if self.subscription.publisher_is_alive(connection) {
            if self.presence == Presence::Publishing {
                self.presence = Presence::Silent;
                tell(News::FellSilent);
            }
        } else {
            // Let go of the services, so that the next publisher can make them anew.
            self.connection = None;
            self.status = None;
            self.alert = None;
            if self.presence != Presence::Waiting {
                self.presence = Presence::Waiting;
                tell(News::Gone);
            }
        }
    }

    /// The latest frame's header, if there was ever one.
    pub fn header(&self) -> Option<FrameHeader> {
        self.header
    }

    /// The figures since the last call, which a caller asks for about once a second.
    pub fn second(&mut self) -> Second {
        let elapsed = self.second_began.elapsed().as_secs_f64();
        let at = |quantile| self.latency.value_at_quantile(quantile);
        let latency =
            (!self.latency.is_empty()).then(|| Latency { p50: at(0.5), p99: at(0.99), max: self.latency.max() });
        let second = Second {
            presence: self.presence,
            header: self.header,
            head: self.head,
            rate: self.received_this_second as f64 / elapsed,
            received: self.received,
            missed: self.missed,
            latency,
            alert: self.alert,
            status: self.status,
        };
        self.latency.reset();
        self.received_this_second = 0;
        self.second_began = Instant::now();
        second
    }
}
