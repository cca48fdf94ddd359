//! The times at which OSC messages are sent. In: the events of a feed. Out: datagrams by [`osc`](super::osc).

use std::time::{Duration, Instant};

use rosc::OscMessage;

use super::network::Outlet;
use super::osc::{Addresses, Packing, State, datagrams, next_event};
use super::osc_map::OscMap;
use super::{Arrivals, Pace};
use bench_dragon_client::clock::realtime_ns;
use bench_dragon_client::feed::FeedEvent;
use bench_dragon_client::polling::Handler;
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, HandlePose, Stage, StageDragon};

/// The most bundles of frames per second.
pub const MOST_RATE: u32 = 60;
/// The least time between two countdowns.
const COUNTDOWN_INTERVAL: Duration = Duration::from_millis(100);
/// Resend interval of an unchanged state, for late receivers.
const STATE_INTERVAL: Duration = Duration::from_secs(1);
/// The time before the first received frame within which a cue is sent: connecting takes a moment, and a show can begin
/// with a cue.
const CUE_GRACE_NS: u64 = 1_000_000_000;

/// Counts of sent messages.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct OscSummary {
    /// Frames of the publisher that were sent.
    pub frames: u64,
    /// Alerts sent; of the user's messages, levels.
    pub alerts: u64,
    /// Cues sent.
    pub cues: u64,
    /// Datagrams sent, to all destinations together.
    pub packets: u64,
    /// Datagrams that could not be sent.
    pub unsent_packets: u64,
}

impl OscSummary {
    /// Returns the sum of two counts.
    fn plus(self, other: Self) -> Self {
        Self {
            frames: self.frames + other.frames,
            alerts: self.alerts + other.alerts,
            cues: self.cues + other.cues,
            packets: self.packets + other.packets,
            unsent_packets: self.unsent_packets + other.unsent_packets,
        }
    }
}

/// The options of a sender.
#[derive(Debug, Clone)]
pub struct OscOptions {
    /// The most frames per second that are sent.
    pub rate: f64,
    /// The content of a datagram.
    pub packing: Packing,
    /// The user's messages, which are sent in place of all others.
    pub map: Option<OscMap>,
}

/// The sender of one publisher's messages.
pub struct OscSender {
    addresses: Addresses,
    packing: Packing,
    map: Option<OscMap>,
    outlet: Outlet,
    pace: Pace,
    arrivals: Arrivals,
    /// The stage, with the dragons; frames wait for it.
    stage: Option<Box<Stage>>,
    /// The latest frame of the run, the heads in it, and the period and the time of the first frame that came.
    latest: Option<FrameHeader>,
    heads: Vec<HandlePose>,
    first_tick: u64,
    first_stamp_ns: u64,
    due: bool,
    /// Alerts and cues in their order.
    pending: Vec<OscMessage>,
    last_alert: Option<CollisionAlert>,
    last_cue: Option<Cue>,
    told_state: Option<State>,
    told_countdown: bool,
    next_state: Instant,
    next_countdown: Instant,
    summary: OscSummary,
}

impl OscSender {
    /// Creates a sender by `outlet`.
    pub fn new(addresses: Addresses, options: OscOptions, outlet: Outlet) -> Self {
        let OscOptions { rate, packing, map } = options;
        Self {
            addresses,
            packing,
            map,
            outlet,
            pace: Pace::new(rate),
            arrivals: Arrivals::default(),
            stage: None,
            latest: None,
            heads: Vec::new(),
            first_tick: 0,
            first_stamp_ns: 0,
            due: false,
            pending: Vec::new(),
            last_alert: None,
            last_cue: None,
            told_state: None,
            told_countdown: false,
            next_state: Instant::now(),
            next_countdown: Instant::now(),
            summary: OscSummary::default(),
        }
    }

    /// Sends receivers the state `stopped`, and returns the counts.
    pub fn finish(mut self) -> OscSummary {
        let mut messages = std::mem::take(&mut self.pending);
        if self.latest.is_some() && self.map.is_none() {
            messages.push(self.addresses.state(State::Stopped));
        }
        self.send_all(messages);
        OscSummary { packets: self.outlet.sent(), unsent_packets: self.outlet.unsent(), ..self.summary }
    }

    fn send_all(&mut self, messages: Vec<OscMessage>) {
        datagrams(messages, self.packing).iter().for_each(|datagram| self.outlet.send(datagram));
    }

    /// Sends an alert once: a new connection begins with the current alert again.
    fn take_alert(&mut self, alert: &CollisionAlert) {
        let of = |alert: &CollisionAlert| (alert.run_id, alert.tick, alert.level, alert.event);
        if self.last_alert.as_ref().is_some_and(|last| of(last) == of(alert)) {
            return;
        }
        let before = self.last_alert.replace(*alert).filter(|before| before.run_id == alert.run_id);
        if let Some(map) = &self.map {
            let is_old = before.is_none() && alert.stamp_ns.saturating_add(CUE_GRACE_NS) < realtime_ns();
            let level = alert.alert_level().filter(|_| !is_old);
            let level = level.filter(|level| before.is_none_or(|before| before.alert_level() != Some(*level)));
            let messages = Vec::from_iter(level.iter().flat_map(|level| map.of_level(*level)));
            self.summary.alerts += u64::from(!messages.is_empty());
            self.pending.extend(messages);
            return;
        }
        let header = self.latest.filter(|header| header.run_id == alert.run_id);
        let stage = self.stage.as_deref().filter(|stage| stage.run_id == alert.run_id);
        self.pending.push(self.addresses.alert(alert, stage, header.map_or(0, |header| header.cue)));
        let on_ground = stage.filter(|stage| !stage.obstacles.is_empty());
        self.pending.extend(on_ground.map(|stage| self.addresses.obstacle(stage, alert)));
        let of_several = stage.filter(|stage| stage.dragons.len() > 1);
        self.pending.extend(of_several.map(|stage| self.addresses.dragons(stage, alert)));
        self.summary.alerts += 1;
    }

    /// Sends a cue once, and no cue that the show passed long before this sender connected.
    fn take_cue(&mut self, cue: &Cue) {
        let of = |cue: &Cue| (cue.run_id, cue.tick, cue.number);
        let is_known = self.last_cue.as_ref().is_some_and(|last| of(last) == of(cue));
        let of_this_run = self.latest.is_some_and(|header| header.run_id == cue.run_id);
        // Stamps alone do not suffice: the clock may have been set back since the first frame.
        let is_old = cue.tick < self.first_tick && cue.stamp_ns.saturating_add(CUE_GRACE_NS) < self.first_stamp_ns;
        if is_known || !of_this_run || is_old {
            return;
        }
        self.last_cue = Some(*cue);
        match &self.map {
            None => self.pending.push(self.addresses.cue(cue)),
            Some(map) => {
                let before = self.pending.len();
                self.pending.extend(map.of_cue(cue));
                if self.pending.len() == before {
                    return;
                }
            }
        }
        self.summary.cues += 1;
    }

    /// Sends the user's messages of the events between the latest frame and this one.
    fn take_events(&mut self, header: &FrameHeader) {
        let (Some(map), Some(stage), Some(latest)) = (&self.map, &self.stage, &self.latest) else { return };
        // After a jump nothing has happened in between.
        if (latest.run_id, latest.epoch) != (header.run_id, header.epoch) || stage.run_id != header.run_id {
            return;
        }
        let has_come = |time: f64| latest.sim_time < time && time <= header.sim_time;
        let happened = stage.events.iter().filter(|event| has_come(event.time));
        self.pending.extend(happened.flat_map(|event| map.of_event(event.state)));
    }
}

impl OscSender {
    /// Handles an event.
    fn take(&mut self, event: FeedEvent<'_>) {
        self.arrivals.handle(&event, Instant::now());
        match event {
            FeedEvent::Frame { header, handles, .. } => {
                let Some(stage) = &self.stage else { return };
                let head =
                    |dragon: &StageDragon| handles.get(dragon.first_handle as usize).copied().unwrap_or_default();
                self.heads.clear();
                self.heads.extend(stage.dragons.iter().map(head));
                if self.latest.is_none_or(|latest| latest.run_id != header.run_id) {
                    (self.first_tick, self.first_stamp_ns) = (header.tick, header.stamp_ns);
                }
                self.take_events(header);
                self.latest = Some(*header);
                self.due |= self.pace.is_due(header);
            }
            FeedEvent::Stage { stage, .. } => self.stage = Some(Box::new(*stage)),
            FeedEvent::Alert(alert) => self.take_alert(alert),
            FeedEvent::Cue(cue) => self.take_cue(cue),
            FeedEvent::Gone => self.stage = None,
            FeedEvent::Started { .. } | FeedEvent::Scene { .. } => (),
            FeedEvent::Status(_) | FeedEvent::Chase(_) | FeedEvent::Silent => (),
        }
    }

    /// Sends the messages that are due.
    fn send_due(&mut self, now: Instant) {
        let mut messages = std::mem::take(&mut self.pending);
        let due = std::mem::take(&mut self.due);
        if let Some(header) = self.latest.filter(|_| self.map.is_none()) {
            let header = &header;
            let stopped = self.arrivals.stopped_since(now).is_some();
            let state = if stopped { Some(State::Stopped) } else { State::of(header) };
            // A change is sent at once, and so is the end of a countdown.
            if let Some(state) = state.filter(|state| self.told_state != Some(*state) || now >= self.next_state) {
                messages.push(self.addresses.state(state));
                (self.told_state, self.next_state) = (Some(state), now + STATE_INTERVAL);
            }
            let stage = self.stage.as_deref().filter(|stage| stage.run_id == header.run_id && !stopped);
            let coming = stage.and_then(|stage| next_event(stage, header));
            let is_due = if coming.is_some() { due && now >= self.next_countdown } else { self.told_countdown };
            if is_due {
                messages.push(self.addresses.countdown(coming));
                (self.told_countdown, self.next_countdown) = (coming.is_some(), now + COUNTDOWN_INTERVAL);
            }
            if due {
                self.summary.frames += 1;
                messages.push(self.addresses.sim_time(header));
                let dragons = self.stage.iter().flat_map(|stage| stage.dragons.iter());
                let head = |(dragon, head): (&StageDragon, &HandlePose)| {
                    self.addresses.head(dragon.name.as_str(), header, head)
                };
                messages.extend(dragons.zip(&self.heads).map(head));
            }
        }
        self.send_all(messages);
    }
}

/// The senders of several publishers, each with its own addresses.
pub struct OscSenders(Vec<OscSender>);

impl OscSenders {
    /// One for each publisher, in the order in which they are polled.
    pub fn new(senders: Vec<OscSender>) -> Self {
        Self(senders)
    }

    /// Sends receivers the state `stopped`, and returns the counts of all senders together.
    pub fn finish(self) -> OscSummary {
        self.0.into_iter().map(OscSender::finish).fold(OscSummary::default(), OscSummary::plus)
    }
}

impl Handler for OscSenders {
    fn handle(&mut self, publisher: usize, event: FeedEvent<'_>) {
        if let Some(sender) = self.0.get_mut(publisher) {
            sender.take(event);
        }
    }

    fn polled(&mut self, now: Instant) {
        self.0.iter_mut().for_each(|sender| sender.send_due(now));
    }
}

#[cfg(test)]
mod tests {
    use std::net::{Ipv4Addr, SocketAddrV4};

    use bench_dragon_messages::state::FrameState;
    use bench_dragon_messages::{List, StageEvent};

    use super::super::network::Route;
    use super::*;

    const HOUR_NS: u64 = 3_600_000_000_000;

    /// A sender to no receiver.
    fn sender(map: Option<OscMap>) -> OscSender {
        let discard = SocketAddrV4::new(Ipv4Addr::LOCALHOST, 9);
        let outlet = Outlet::open(&[discard], Route { interface: None, multicast_ttl: 1 }).unwrap();
        let options = OscOptions { rate: 10.0, packing: Packing::Bundles, map };
        OscSender::new(Addresses::new("show"), options, outlet)
    }

    #[test]
    fn an_event_has_its_messages_once_and_none_after_a_jump() {
        let text = "[[messages]]\nevent = \"stall\"\naddress = \"/stalls\"\n\
                    [[messages]]\nevent = \"contact\"\naddress = \"/meets\"\n";
        let mut sender = sender(Some(OscMap::parse(text, "").unwrap()));
        let event = |time, state: FrameState| StageEvent { time, state: state as u32, ..StageEvent::default() };
        let events = List::of([event(10.0, FrameState::Contact), event(20.0, FrameState::Stall)]);
        let stage = Stage { run_id: 1, freeze_time: 30.0, events, ..Stage::default() };
        sender.take(FeedEvent::Stage { stage: &stage, segments: &[] });
        let mut sent = |sim_time, epoch| {
            let header = FrameHeader { run_id: 1, sim_time, epoch, ..FrameHeader::default() };
            sender.take(FeedEvent::Frame { header: &header, handles: &[], missed: 0 });
            Vec::from_iter(sender.pending.drain(..).map(|message| message.addr))
        };
        assert_eq!(sent(9.0, 0), [""; 0]);
        assert_eq!(sent(10.0, 0), ["/meets"]);
        assert_eq!(sent(10.1, 0), [""; 0]);
        assert_eq!(sent(25.0, 0), ["/stalls"]);
        assert_eq!(sent(5.0, 1), [""; 0], "a seek back");
        assert_eq!(sent(21.0, 1), ["/meets", "/stalls"], "a fast show");
        assert_eq!(sent(5.0, 2), [""; 0]);
        assert_eq!(sent(21.0, 3), [""; 0], "a seek forward");
    }

    #[test]
    fn cues_come_where_the_clock_was_set_back_and_old_ones_do_not() {
        let mut sender = sender(None);
        sender.take(FeedEvent::Stage { stage: &Stage::default(), segments: &[] });
        let header = FrameHeader { run_id: 1, tick: 1000, stamp_ns: 100 * HOUR_NS, ..FrameHeader::default() };
        sender.take(FeedEvent::Frame { header: &header, handles: &[], missed: 0 });
        let cue = |number, tick, stamp_ns| Cue { run_id: 1, number, tick, stamp_ns, ..Cue::default() };
        for (cue, sent) in [
            // A cue of before the connection; a later cue, on a clock that has been set back; another later cue.
            (cue(1, 10, 99 * HOUR_NS), 0),
            (cue(2, 1100, 92 * HOUR_NS), 1),
            (cue(3, 1200, 101 * HOUR_NS), 2),
            // A cue during the connection.
            (cue(4, 990, 100 * HOUR_NS - CUE_GRACE_NS / 2), 3),
        ] {
            sender.take(FeedEvent::Cue(&cue));
            assert_eq!(sender.summary.cues, sent, "{cue:?}");
        }
    }
}
