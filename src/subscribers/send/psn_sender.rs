//! Trackers for lighting desks: which, when, and what they say while no frames come. In: the events of a feed. Out:
//! datagrams by [`psn`](super::psn). Called by `send psn`.

use std::time::{Duration, Instant};

use super::axes::Axes;
use super::network::Outlet;
use super::psn::{MOST_PACKETS, Tracker, TrackerName, data_frame, info_frame};
use super::trackers::{Selection, numbered};
use super::{Arrivals, Pace};
use crate::live::clock::monotonic_ns;
use crate::subscribers::feed::FeedEvent;
use crate::subscribers::polling::Handler;
use crate::wire::{FrameHeader, HandlePose};

/// The multicast group and the port of the protocol.
pub const USUAL_ADDRESS: &str = "236.10.10.10";
/// See [`USUAL_ADDRESS`].
pub const USUAL_PORT: u16 = 56565;
/// The protocol's usual rate of positions, per second.
pub const USUAL_RATE: f64 = 60.0;
/// How often names are sent.
const INFO_INTERVAL: Duration = Duration::from_secs(1);
/// How long desks are told at the full rate that frames have stopped, and how often from then on.
const STOPPED_FULL_RATE: Duration = Duration::from_secs(10);
/// See [`STOPPED_FULL_RATE`].
const STOPPED_INTERVAL: Duration = Duration::from_secs(1);
/// A frame that seems older than this was made on a machine with another clock.
const OLDEST_NS: u64 = 10_000_000_000;

/// What is sent.
#[derive(Debug, Clone, PartialEq)]
pub struct PsnOptions {
    /// Which handles.
    pub trackers: Selection,
    /// In which axes.
    pub axes: Axes,
    /// At most so many frames per second.
    pub rate: f64,
    /// The number of the first handle's tracker.
    pub first_id: u16,
    /// The name under which desks list this sender.
    pub system_name: String,
}

/// What a person who runs a sender wants to know at once.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// Frames of a team come whose trackers were not known.
    Team {
        /// The number of handles.
        handles: u32,
        /// The trackers, in the order of their numbers.
        trackers: Vec<TrackerName>,
        /// Packets of positions a frame.
        packets: usize,
        /// Packets of names a second.
        name_packets: usize,
    },
    /// Some that were chosen cannot be sent; one sentence.
    LeftOut(String),
    /// Frames have stopped: the trackers have status 0.
    Stopped,
    /// They come again.
    Resumed,
}

/// What has been sent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct PsnSummary {
    /// Frames of the publisher that were sent.
    pub frames: u64,
    /// Frames of the publisher that came too soon after one that was sent, or were overtaken before they were read.
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

/// The sender of one team.
pub struct PsnSender<'a> {
    options: PsnOptions,
    outlet: Outlet,
    notify: &'a mut dyn FnMut(Notice),
    started_ns: u64,
    pace: Pace,
    arrivals: Arrivals,
    /// The handles of the present team that are sent, and their trackers.
    team: Option<Team>,
    /// The latest frame that was due.
    trackers: Vec<Tracker>,
    due: bool,
    next_info: Instant,
    /// When desks are told again that frames have stopped.
    next_stopped: Option<Instant>,
    data_frame_id: u8,
    info_frame_id: u8,
    summary: PsnSummary,
}

struct Team {
    handles: u32,
    chosen: Vec<u32>,
    names: Vec<TrackerName>,
    announced: bool,
}

impl<'a> PsnSender<'a> {
    /// A sender by `outlet`, which calls `notify` with what a person wants to know.
    pub fn new(options: PsnOptions, outlet: Outlet, notify: &'a mut dyn FnMut(Notice)) -> Self {
        Self {
            pace: Pace::new(options.rate),
            options,
            outlet,
            notify,
            started_ns: monotonic_ns(),
            arrivals: Arrivals::default(),
            team: None,
            trackers: Vec::new(),
            due: false,
            next_info: Instant::now(),
            next_stopped: None,
            data_frame_id: 0,
            info_frame_id: 0,
            summary: PsnSummary::default(),
        }
    }

    /// Tells desks that nothing holds any more, and returns what has been sent.
    pub fn finish(mut self) -> PsnSummary {
        if self.team.is_some() {
            self.send_stopped();
        }
        PsnSummary { packets: self.outlet.sent(), unsent_packets: self.outlet.unsent(), ..self.summary }
    }

    fn elapsed_us(&self) -> u64 {
        monotonic_ns().saturating_sub(self.started_ns) / 1000
    }

    fn take_frame(&mut self, header: &FrameHeader, handles: &[HandlePose]) {
        if self.next_stopped.take().is_some() {
            (self.notify)(Notice::Resumed);
        }
        if self.team.as_ref().is_none_or(|team| team.handles != header.handles) {
            self.meet(header.handles);
        }
        let Some(team) = &self.team else { return };
        let now_ns = monotonic_ns();
        let known = now_ns.checked_sub(header.deadline_ns).is_some_and(|age| age < OLDEST_NS);
        let made_ns = if known { header.deadline_ns } else { now_ns };
        let timestamp_us = made_ns.saturating_sub(self.started_ns) / 1000;
        let axes = self.options.axes;
        let vector = |x, y| axes.vector([x, y, 0.0]).map(|part| part as f32);
        let tracker = |(handle, name): (&u32, &TrackerName)| {
            let pose = handles.get(*handle as usize)?;
            // Desks count seconds of wall time.
            let (vx, vy) = (pose.vx * header.time_scale, pose.vy * header.time_scale);
            Some(Tracker {
                id: name.id,
                position: vector(pose.x, pose.y),
                speed: (!vx.is_nan() && !vy.is_nan()).then(|| vector(vx, vy)),
                orientation: axes.rotation(pose.heading).map(|part| part as f32),
                status: 1.0,
                timestamp_us,
            })
        };
        self.trackers.clear();
        self.trackers.extend(team.chosen.iter().zip(&team.names).filter_map(tracker));
        self.due = true;
    }

    /// Chooses the trackers of a team of another size.
    fn meet(&mut self, handles: u32) {
        let mut chosen = self.options.trackers.of(handles);
        let names = numbered(&chosen, handles, self.options.first_id);
        if let Some(beyond) = self.options.trackers.beyond(handles) {
            self.leave_out(format!("there is no handle {beyond}: the team has {handles}"));
        }
        if names.len() < chosen.len() {
            let (sent, chosen) = (names.len(), chosen.len());
            self.leave_out(format!("only {sent} of {chosen} handles are sent: trackers' numbers end at 65535"));
        }
        chosen.truncate(names.len());
        // At once, after the frame at hand.
        self.next_info = Instant::now();
        self.team = Some(Team { handles, chosen, names, announced: false });
    }

    fn leave_out(&mut self, sentence: String) {
        (self.notify)(Notice::LeftOut(sentence));
    }

    /// Sends the trackers as they are, all packets back to back. Returns the number of packets.
    fn send_trackers(&mut self) -> usize {
        if self.trackers.is_empty() {
            return 0;
        }
        self.data_frame_id = next_frame_id(self.data_frame_id);
        let frame = data_frame(self.elapsed_us(), self.data_frame_id, &self.trackers);
        frame.packets.iter().for_each(|packet| self.outlet.send(packet));
        if frame.trackers < self.trackers.len() {
            let (sent, chosen) = (frame.trackers, self.trackers.len());
            // From the next frame on there is nothing to leave out.
            self.team.iter_mut().for_each(|team| {
                team.chosen.truncate(sent);
                team.names.truncate(sent);
            });
            self.leave_out(format!(
                "only {sent} of {chosen} handles are sent: a frame has {MOST_PACKETS} packets at most; --trackers chooses others"
            ));
        }
        frame.packets.len()
    }

    /// Sends the names. Returns the number of packets.
    fn send_names(&mut self) -> usize {
        let Some(team) = &self.team else { return 0 };
        self.info_frame_id = next_frame_id(self.info_frame_id);
        let frame = info_frame(self.elapsed_us(), self.info_frame_id, &self.options.system_name, &team.names);
        frame.packets.iter().for_each(|packet| self.outlet.send(packet));
        self.summary.name_frames += 1;
        frame.packets.len()
    }

    /// Sends the trackers where they last were, standing still, with status 0.
    fn send_stopped(&mut self) {
        for tracker in &mut self.trackers {
            tracker.status = 0.0;
            tracker.speed = tracker.speed.map(|_| [0.0; 3]);
        }
        self.send_trackers();
        self.summary.stopped_frames += 1;
    }
}

/// The number of the next frame: 1 to 255, and again. A receiver exists that takes 0 for none.
fn next_frame_id(latest: u8) -> u8 {
    latest % u8::MAX + 1
}

impl Handler for PsnSender<'_> {
    fn handle(&mut self, event: FeedEvent<'_>) {
        self.arrivals.handle(&event, Instant::now());
        if let FeedEvent::Frame { header, handles, missed } = event {
            self.summary.passed_over += missed;
            if self.pace.is_due(header) {
                // One that a newer one overtakes before it is sent.
                self.summary.passed_over += u64::from(self.due);
                self.take_frame(header, handles);
            } else {
                self.summary.passed_over += 1;
            }
        }
    }

    fn polled(&mut self, now: Instant) {
        let mut packets = 0;
        if std::mem::take(&mut self.due) {
            self.summary.frames += 1;
            packets = self.send_trackers();
        }
        if let Some(since) = self.arrivals.stopped_since(now).filter(|_| self.team.is_some()) {
            if self.next_stopped.is_none() {
                (self.notify)(Notice::Stopped);
            }
            let next = self.next_stopped.unwrap_or(now);
            if now >= next {
                self.send_stopped();
                let full_rate = now < since + STOPPED_FULL_RATE;
                let interval =
                    if full_rate { Duration::from_secs_f64(1.0 / self.options.rate) } else { STOPPED_INTERVAL };
                self.next_stopped = Some((next + interval).max(now));
            }
        }
        if self.team.is_some() && now >= self.next_info {
            self.next_info = now + INFO_INTERVAL;
            let name_packets = self.send_names();
            if let Some(team) = self.team.as_mut().filter(|team| !team.announced) {
                team.announced = true;
                let (handles, trackers) = (team.handles, team.names.clone());
                (self.notify)(Notice::Team { handles, trackers, packets, name_packets });
            }
        }
    }
}
