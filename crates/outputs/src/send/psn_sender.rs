//! Trackers for lighting desks: their choice, their times, and their state while no frames come. In: the events of the
//! feeds of one publisher or several. Out: datagrams by [`psn`](super::psn).
//!
//! A receiver counts as present only the trackers of the latest frame, so each frame has the trackers of all
//! publishers, each with the time of its position. There is one count of frames, because a desk would mix up the counts
//! of two senders.

use std::time::{Duration, Instant};

use super::Pace;
use super::axes::Axes;
use super::network::Outlet;
use super::psn::{MOST_PACKETS, TrackerName, data_frame, info_frame};
use super::psn_source::Source;
use super::trackers::{Numbers, Selection};
use bench_dragon_client::clock::monotonic_ns;
use bench_dragon_client::feed::FeedEvent;
use bench_dragon_client::polling::Handler;
use bench_dragon_messages::{FrameHeader, HandlePose};

/// The multicast group and the port of the protocol.
pub const USUAL_ADDRESS: &str = "236.10.10.10";
/// See [`USUAL_ADDRESS`].
pub const USUAL_PORT: u16 = 56565;
/// The protocol's usual rate of positions, per second.
pub const USUAL_RATE: f64 = 60.0;
/// The interval of names.
const INFO_INTERVAL: Duration = Duration::from_secs(1);
/// The time for which status 0 is sent at the full rate after frames have stopped, and its interval after that time.
const STOPPED_FULL_RATE: Duration = Duration::from_secs(10);
/// See [`STOPPED_FULL_RATE`].
const STOPPED_INTERVAL: Duration = Duration::from_secs(1);

/// The options of a sender.
#[derive(Debug, Clone, PartialEq)]
pub struct PsnOptions {
    /// The handles of each publisher.
    pub trackers: Selection,
    /// The axes.
    pub axes: Axes,
    /// The most frames per second.
    pub rate: f64,
    /// The trackers' numbers, for each publisher in the order in which they are polled.
    pub numbers: Vec<Numbers>,
    /// The name under which desks list this sender.
    pub system_name: String,
}

/// A notice for the user who runs a sender.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// The first frames of a team.
    Team {
        /// The number of handles.
        handles: u32,
        /// The trackers, in the order of their numbers.
        trackers: Vec<TrackerName>,
        /// Packets of positions a frame, of all publishers together.
        packets: usize,
        /// Packets of names a second.
        name_packets: usize,
    },
    /// Some chosen handles cannot be sent; one sentence.
    LeftOut(String),
    /// Frames have stopped: the publisher's trackers have status 0.
    Stopped,
    /// Frames come again.
    Resumed,
}

/// Counts of sent messages.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct PsnSummary {
    /// Frames that were sent, each with the newest of every publisher.
    pub frames: u64,
    /// Frames of publishers that came too soon after a sent frame, or were replaced by newer ones before they were
    /// sent.
    pub passed_over: u64,
    /// Frames sent with status 0 while none came.
    pub stopped_frames: u64,
    /// Frames of names.
    pub name_frames: u64,
    /// Datagrams sent.
    pub packets: u64,
    /// Datagrams that could not be sent.
    pub unsent_packets: u64,
}

/// The sender of all publishers' trackers.
pub struct PsnSender<'a> {
    options: PsnOptions,
    outlet: Outlet,
    /// Called with the place of a publisher and a notice about it.
    notify: &'a mut dyn FnMut(usize, Notice),
    started_ns: u64,
    pace: Pace,
    /// One for each publisher, in the order of their trackers' numbers.
    sources: Vec<Source>,
    due: bool,
    next_info: Instant,
    /// The next moment at which status 0 is sent for all publishers.
    next_stopped: Option<Instant>,
    data_frame_id: u8,
    info_frame_id: u8,
    summary: PsnSummary,
}

impl<'a> PsnSender<'a> {
    /// Creates a sender by `outlet`, which calls `notify` with the place of a publisher and a notice about it.
    pub fn new(options: PsnOptions, outlet: Outlet, notify: &'a mut dyn FnMut(usize, Notice)) -> Self {
        Self {
            pace: Pace::new(options.rate),
            sources: options.numbers.iter().cloned().map(Source::new).collect(),
            options,
            outlet,
            notify,
            started_ns: monotonic_ns(),
            due: false,
            next_info: Instant::now(),
            next_stopped: None,
            data_frame_id: 0,
            info_frame_id: 0,
            summary: PsnSummary::default(),
        }
    }

    /// Sends status 0 for all trackers, and returns the counts.
    pub fn finish(mut self) -> PsnSummary {
        if self.sources.iter().any(Source::is_known) {
            self.sources.iter_mut().for_each(Source::stop);
            self.send_stopped();
        }
        PsnSummary { packets: self.outlet.sent(), unsent_packets: self.outlet.unsent(), ..self.summary }
    }

    fn elapsed_us(&self) -> u64 {
        monotonic_ns().saturating_sub(self.started_ns) / 1000
    }

    /// Returns true if this frame is due. Several publishers share one count of intervals, on the common clock of their
    /// deadlines; the count of a single publisher begins with its run.
    fn is_due(&mut self, header: &FrameHeader, made_ns: u64) -> bool {
        match &self.sources[..] {
            [_] => self.pace.is_due(header),
            _ => self.pace.is_due(&FrameHeader { run_id: 0, deadline_ns: made_ns, ..*header }),
        }
    }

    fn take_frame(&mut self, publisher: usize, header: &FrameHeader, handles: &[HandlePose]) {
        let Some(made_ns) = self.sources.get(publisher).map(|source| source.made_ns(header)) else { return };
        let is_due = self.is_due(header, made_ns);
        let alone = self.sources.len() == 1;
        let Some(source) = self.sources.get_mut(publisher) else { return };
        // The frames of several publishers are sent together, with the next due frame of any of them.
        if alone && !is_due {
            self.summary.passed_over += 1;
            return;
        }
        if !source.knows_dragons() {
            return;
        }
        if std::mem::take(&mut source.stopped) {
            (self.notify)(publisher, Notice::Resumed);
        }
        self.next_stopped = None;
        if let Some(left_out) = source.meet(header.handles, &self.options.trackers) {
            // At once, after the present frame.
            self.next_info = Instant::now();
            left_out.into_iter().for_each(|sentence| (self.notify)(publisher, Notice::LeftOut(sentence)));
        }
        let timestamp_us = made_ns.saturating_sub(self.started_ns) / 1000;
        let overtakes = source.take(header, handles, self.options.axes, timestamp_us);
        self.summary.passed_over += u64::from(overtakes);
        self.due |= is_due;
    }

    /// Sends all trackers, all packets back to back, if there are any. Returns the number of packets.
    fn send_trackers(&mut self) -> usize {
        let mut trackers = Vec::with_capacity(self.sources.iter().map(|source| source.trackers.len()).sum());
        for source in &mut self.sources {
            source.unsent = false;
            trackers.extend_from_slice(&source.trackers);
        }
        if trackers.is_empty() {
            return 0;
        }
        self.data_frame_id = next_frame_id(self.data_frame_id);
        let frame = data_frame(self.elapsed_us(), self.data_frame_id, &trackers);
        frame.packets.iter().for_each(|packet| self.outlet.send(packet));
        let mut room = frame.trackers;
        for (publisher, source) in self.sources.iter_mut().enumerate() {
            let (remaining, left_out) = source.fit(room);
            room = remaining;
            if let Some(left_out) = left_out {
                let (chosen, of) = (source.trackers.len(), source.of());
                let sent = chosen - left_out;
                let sentence = format!(
                    "only {sent} of {chosen} handles{of} are sent: a frame has {MOST_PACKETS} packets at most; \
                     --trackers chooses others"
                );
                (self.notify)(publisher, Notice::LeftOut(sentence));
            }
        }
        frame.packets.len()
    }

    /// Sends the names. Returns the number of packets.
    fn send_names(&mut self) -> usize {
        self.info_frame_id = next_frame_id(self.info_frame_id);
        let names: Vec<TrackerName> = self.sources.iter().flat_map(Source::names).cloned().collect();
        let frame = info_frame(self.elapsed_us(), self.info_frame_id, &self.options.system_name, &names);
        frame.packets.iter().for_each(|packet| self.outlet.send(packet));
        self.summary.name_frames += 1;
        frame.packets.len()
    }

    /// Sends the trackers of publishers that have all stopped.
    fn send_stopped(&mut self) {
        self.send_trackers();
        self.summary.stopped_frames += 1;
    }

    /// Stops the trackers of publishers whose frames have stopped. Returns the moment since when no publisher sends.
    fn stop_silent(&mut self, now: Instant) -> Option<Instant> {
        let mut since = None;
        let mut all = true;
        for (publisher, source) in self.sources.iter_mut().enumerate().filter(|(_, source)| source.is_known()) {
            let stopped = source.stopped_since(now);
            if stopped.is_some() && !source.stopped {
                source.stop();
                (self.notify)(publisher, Notice::Stopped);
            }
            all &= stopped.is_some();
            since = since.max(stopped);
        }
        since.filter(|_| all)
    }
}

/// Returns the number of the next frame: 1 to 255, then 1 again. One known receiver takes 0 for no frame.
fn next_frame_id(latest: u8) -> u8 {
    latest % u8::MAX + 1
}

impl Handler for PsnSender<'_> {
    fn handle(&mut self, publisher: usize, event: FeedEvent<'_>) {
        if let Some(source) = self.sources.get_mut(publisher) {
            source.arrived(&event, Instant::now());
        }
        if let FeedEvent::Frame { header, handles, missed } = event {
            self.summary.passed_over += missed;
            self.take_frame(publisher, header, handles);
        }
    }

    fn clock(&mut self, publisher: usize, shares_clock: bool) {
        if let Some(source) = self.sources.get_mut(publisher) {
            source.shares_clock = shares_clock;
        }
    }

    fn polled(&mut self, now: Instant) {
        let mut packets = 0;
        if std::mem::take(&mut self.due) {
            self.summary.frames += 1;
            packets = self.send_trackers();
        }
        if let Some(since) = self.stop_silent(now) {
            let next = self.next_stopped.unwrap_or(now);
            if now >= next {
                self.send_stopped();
                let full_rate = now < since + STOPPED_FULL_RATE;
                let interval =
                    if full_rate { Duration::from_secs_f64(1.0 / self.options.rate) } else { STOPPED_INTERVAL };
                self.next_stopped = Some((next + interval).max(now));
            }
        }
        // No names between a place and the frame that it waits for.
        let is_sent = self.sources.iter().any(Source::is_known) && self.sources.iter().all(|source| !source.unsent);
        if is_sent && now >= self.next_info {
            self.next_info = now + INFO_INTERVAL;
            let name_packets = self.send_names();
            for (publisher, source) in self.sources.iter_mut().enumerate() {
                if let Some((handles, trackers)) = source.announce() {
                    (self.notify)(publisher, Notice::Team { handles, trackers, packets, name_packets });
                }
            }
        }
    }
}
