//! The chase of a running show: it reads a source, follows the frames of the show, sends commands and reports. In: the
//! events of a feed, and the inputs of a source. Out: commands, the status of the chase.

use std::net::IpAddr;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use bench_dragon_client::clock::{monotonic_ns, realtime_ns};
use bench_dragon_client::control::command_client::{Action, ActionResult, CommandClient};
use bench_dragon_client::feed::FeedEvent;
use bench_dragon_client::polling::Handler;
use bench_dragon_messages::chase::{ChaseSource, ChaseState};
use bench_dragon_messages::control::Command;
use bench_dragon_messages::{ChaseStatus, FrameHeader};
use bench_dragon_motion::model::Point;

use crate::schedule::Schedule;
use crate::sources::Input;
use crate::status::{ChaseStatusError, ChaseStatusSender};
use crate::steering::{Goal, Limits, Steering, Waiting};
use crate::synchronizer::{Motion, Options, Reading, Synchronizer};
use crate::timecode::{FrameRate, Label};
use crate::track::{Following, Track};

/// The interval of the status.
const STATUS_INTERVAL: Duration = Duration::from_millis(200);
/// The time limit of the answer to the last command of a chase that ends: a show on a busy machine may take a second.
const LAST_COMMAND: Duration = Duration::from_secs(3);

/// The source of a chase.
#[expect(clippy::large_enum_variant, reason = "there is one for each process")]
pub enum Leader {
    /// Timecode.
    Timecode(TimecodeLeader),
    /// A tracked performer.
    Tracker(TrackerLeader),
}

/// Timecode as the leader.
pub struct TimecodeLeader {
    schedule: Schedule,
    /// The rate that the user has given; `None` for the rate of the source.
    given_rate: Option<FrameRate>,
    freewheel: f64,
    synchronizer: Synchronizer,
    options: Options,
    rate: FrameRate,
    was_locked: bool,
    /// The sender and the stream that are followed.
    sender: Option<(IpAddr, u8)>,
    /// The only stream that may be followed, if the user has given it.
    stream: Option<u8>,
}

impl TimecodeLeader {
    /// Creates the leader of a show with this schedule. `given_rate` replaces the source's own account of its rate;
    /// `freewheel` is in seconds.
    pub fn new(source: ChaseSource, schedule: Schedule, given_rate: Option<FrameRate>, freewheel: f64) -> Self {
        // Readings of MIDI timecode take two frames, and eight messages agree in each.
        let readings_to_lock = if source == ChaseSource::Mtc { 2 } else { 3 };
        let options = Options { freewheel, readings_to_lock };
        Self {
            schedule,
            given_rate,
            freewheel,
            synchronizer: Synchronizer::new(options),
            options,
            rate: given_rate.unwrap_or(FrameRate::Ebu25),
            was_locked: false,
            sender: None,
            stream: None,
        }
    }

    /// Returns the same leader, which follows this stream of a sender alone.
    pub fn of_stream(self, stream: Option<u8>) -> Self {
        Self { stream, ..self }
    }

    /// Handles a frame of a sender. Returns false if the frame is ignored.
    fn frame(&mut self, label: Label, rate: FrameRate, age: f64, at_ns: u64, sender: Option<(IpAddr, u8)>) -> bool {
        let stream = sender.map(|(_, stream)| stream);
        if self.stream.is_some() && stream != self.stream {
            return false;
        }
        // Stream 0 is the master, and followed before any other.
        let is_master = stream == Some(0) && self.sender.is_some_and(|(_, followed)| followed != 0);
        let is_other = self.sender.is_some() && sender != self.sender;
        if is_other && !is_master && self.synchronizer.quiet_for(at_ns) <= self.freewheel {
            return false;
        }
        if is_other && is_master {
            self.synchronizer = Synchronizer::new(self.options);
        }
        let Some(reading) = self.reading(label, rate, age, at_ns) else { return false };
        self.sender = sender;
        self.synchronizer.read(reading);
        true
    }

    /// Returns the reading of a label. Another rate than before is another source.
    fn reading(&mut self, label: Label, rate: FrameRate, age: f64, at_ns: u64) -> Option<Reading> {
        let rate = self.given_rate.unwrap_or(rate);
        let frame = rate.frame(label)?;
        if rate != self.rate {
            self.rate = rate;
            self.synchronizer = Synchronizer::new(self.options);
        }
        let day = rate.seconds(f64::from(rate.frames_per_day()));
        Some(Reading { position: rate.seconds(f64::from(frame) + age), at_ns, day })
    }
}

/// A tracked performer as the leader.
pub struct TrackerLeader {
    /// The number of the tracker.
    pub tracker: u16,
    /// The path and the filter.
    pub track: Track,
    /// From the sender's axes to the stage, in metres.
    pub to_stage: Box<dyn Fn([f64; 3]) -> [f64; 2]>,
    /// BLAKE3 of the text of the scene whose path this is.
    pub scene_hash: [u8; 32],
}

/// A message to the user.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// The state of the chase has changed.
    Changed(ChaseStatus),
    /// The show has another scene than the chase: no place on the path can be known.
    OtherScene,
    /// The stream of the source has ended.
    End,
}

/// The chase of one show.
pub struct Chase<'a> {
    leader: Leader,
    inputs: Receiver<Input>,
    steering: Steering,
    /// The moment at which a command was sent identifies the command.
    commands: CommandClient<u64>,
    answers: Receiver<(u64, ActionResult)>,
    port: ChaseStatusSender,
    shares_clock: bool,
    status: ChaseStatus,
    next_status: Instant,
    /// True once the stream of the source has ended.
    has_ended: bool,
    notify: &'a mut dyn FnMut(Notice),
}

/// The reason why a chase cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum ChaseError {
    /// The status cannot be published, or another chase runs.
    #[error(transparent)]
    Status(#[from] ChaseStatusError),
    /// The system has no thread left.
    #[error("no thread can be started: {0}")]
    Thread(#[from] std::io::Error),
}

impl<'a> Chase<'a> {
    /// Creates the chase of the show `name` by a source, whose `inputs` come from a thread of
    /// [`sources`](crate::sources).
    ///
    /// # Errors
    /// [`ChaseError`]: another chase runs, for example.
    pub fn new(
        name: &str,
        source: ChaseSource,
        leader: Leader,
        inputs: Receiver<Input>,
        notify: &'a mut dyn FnMut(Notice),
    ) -> Result<Self, ChaseError> {
        let port = ChaseStatusSender::open(name)?;
        let (sender, answers) = channel();
        let commands = CommandClient::start(name, move |sent_ns, result| drop(sender.send((sent_ns, result))))?;
        let (limits, tracker): (Limits, u32) = match &leader {
            Leader::Timecode(timecode) => (timecode.schedule.limits(), 0),
            Leader::Tracker(tracker) => (tracker.track.limits(), tracker.tracker.into()),
        };
        let status = ChaseStatus { source: source as u32, tracker, ..ChaseStatus::default() };
        Ok(Self {
            leader,
            inputs,
            steering: Steering::new(limits),
            commands,
            answers,
            port,
            shares_clock: true,
            status,
            next_status: Instant::now(),
            has_ended: false,
            notify,
        })
    }

    /// Ends the chase: the show continues at the rate of its source, without a correction, or is paused after the end
    /// of the source. Returns the last status.
    pub fn finish(mut self) -> ChaseStatus {
        let last = match self.status.chase_state() {
            Some(ChaseState::Locked) if self.status.rate > 0.0 => Some(Command::Rate(self.status.rate)),
            // The pause that `steer` has sent may still be on its way.
            Some(ChaseState::Lost) if self.has_ended => Some(Command::Pause),
            _ => None,
        };
        let sent_ns = monotonic_ns();
        if let Some(last) = last
            && self.commands.request(sent_ns, Action::Send(last)).is_ok()
        {
            let end = Instant::now() + LAST_COMMAND;
            let left = || end.saturating_duration_since(Instant::now());
            while self.answers.recv_timeout(left()).is_ok_and(|(of, _)| of != sent_ns) {}
        }
        self.status.state = ChaseState::Ended as u32;
        self.status.stamp_ns = realtime_ns();
        self.port.send(&self.status);
        self.status
    }

    fn frame(&mut self, header: &FrameHeader) {
        // A frame of another machine counts as made now.
        let frame_ns = if self.shares_clock { header.deadline_ns } else { monotonic_ns() };
        self.steering.frame_came(header, frame_ns);
        self.status.run_id = header.run_id;
    }

    fn input(&mut self, input: Input) {
        let show_time = self.steering.show_time(monotonic_ns());
        let is_used = match (&mut self.leader, input) {
            (_, Input::End) => {
                self.has_ended = true;
                (self.notify)(Notice::End);
                return;
            }
            (Leader::Timecode(timecode), Input::Frame { label, rate, age, at_ns, sender }) => {
                timecode.frame(label, rate, age, at_ns, sender)
            }
            (Leader::Timecode(timecode), Input::Located { label, rate, at_ns }) => {
                let reading = timecode.reading(label, rate, 0.0, at_ns);
                reading.map(|reading| timecode.synchronizer.located(reading)).is_some()
            }
            (Leader::Timecode(timecode), Input::Backward(at_ns)) => {
                timecode.synchronizer.backward(at_ns);
                true
            }
            (Leader::Tracker(tracker), Input::Position { position, at_ns }) => {
                let [x, y] = (tracker.to_stage)(position.map(f64::from));
                // Without a show there is no place to begin at.
                show_time.map(|time| tracker.track.read(Point::new(x, y), at_ns, time)).is_some()
            }
            _ => false,
        };
        *(if is_used { &mut self.status.readings } else { &mut self.status.ignored }) += 1;
    }

    /// Returns the goal of the show and the state of the source.
    fn goal(&mut self, now_ns: u64) -> (Goal, ChaseState) {
        match &mut self.leader {
            Leader::Timecode(leader) => {
                let motion = leader.synchronizer.motion(now_ns);
                leader.was_locked |= matches!(motion, Motion::Locked { .. });
                self.status.jumps = leader.synchronizer.jumps();
                let (state, position) = match motion {
                    Motion::Silent => (ChaseState::Silent, None),
                    Motion::Locking => (ChaseState::Locking, None),
                    Motion::Locked { position, .. } => (ChaseState::Locked, Some(position)),
                    Motion::Freewheeling { position, .. } => (ChaseState::Freewheeling, Some(position)),
                    Motion::Standing(position) => (ChaseState::Standing, Some(position)),
                    Motion::Backward => (ChaseState::Backward, None),
                    Motion::Lost => (ChaseState::Lost, None),
                };
                if let Some(position) = position {
                    self.status.set_label(leader.rate, position);
                }
                (leader.schedule.goal(motion, leader.rate, leader.was_locked), state)
            }
            Leader::Tracker(leader) => {
                self.status.distance = leader.track.distance();
                let state = match leader.track.following(now_ns) {
                    Following::Silent => ChaseState::Silent,
                    Following::Locking => ChaseState::Locking,
                    Following::Locked => ChaseState::Locked,
                    Following::Freewheeling => ChaseState::Freewheeling,
                    Following::Lost => ChaseState::Lost,
                };
                (leader.track.goal(now_ns), state)
            }
        }
    }

    fn steer(&mut self) {
        let now_ns = monotonic_ns();
        let (goal, state) = self.goal(now_ns);
        if let Some(command) = self.steering.command(goal, now_ns)
            && self.commands.request(now_ns, Action::Send(command)).is_err()
        {
            self.steering.answered(now_ns, None);
        }
        let state = match self.steering.waiting() {
            Some(Waiting::Held) => ChaseState::Held,
            Some(Waiting::Paused) => ChaseState::Paused,
            Some(Waiting::Sought) => ChaseState::Sought,
            None => state,
        };
        (self.status.rate, self.status.error) = match (goal, self.steering.show_time(now_ns)) {
            (Goal::Follow { time, rate }, Some(show)) if !self.steering.begins() => (rate, show - time),
            (Goal::Follow { rate, .. }, Some(_)) => (rate, f64::NAN),
            (Goal::Follow { rate, .. }, None) => (rate, f64::NAN),
            _ => (f64::NAN, f64::NAN),
        };
        self.status.stamp_ns = realtime_ns();
        if std::mem::replace(&mut self.status.state, state as u32) != state as u32 {
            (self.notify)(Notice::Changed(self.status));
        }
    }
}

impl Handler for Chase<'_> {
    fn handle(&mut self, _publisher: usize, event: FeedEvent<'_>) {
        match event {
            FeedEvent::Frame { header, .. } => self.frame(header),
            FeedEvent::Stage { stage, .. } => {
                self.steering.set_end(stage.freeze_time);
                if let Leader::Tracker(tracker) = &self.leader
                    && stage.scene_hash != tracker.scene_hash
                {
                    (self.notify)(Notice::OtherScene);
                }
            }
            FeedEvent::Gone => {
                self.steering.gone();
                self.status.run_id = 0;
            }
            FeedEvent::Started { .. }
            | FeedEvent::Scene { .. }
            | FeedEvent::Alert(_)
            | FeedEvent::Cue(_)
            | FeedEvent::Status(_)
            | FeedEvent::Chase(_)
            | FeedEvent::Silent => (),
        }
    }

    fn clock(&mut self, _publisher: usize, shares_clock: bool) {
        self.shares_clock = shares_clock;
    }

    fn polled(&mut self, now: Instant) {
        while let Ok((sent_ns, result)) = self.answers.try_recv() {
            let answer = result.ok().and_then(|(_, response)| Some((response.result()?, response.tick)));
            self.steering.answered(sent_ns, answer);
        }
        while let Ok(input) = self.inputs.try_recv() {
            self.input(input);
        }
        self.steer();
        if now >= self.next_status {
            self.next_status = now + STATUS_INTERVAL;
            self.port.send(&self.status);
        }
    }
}

/// The label of a status.
trait SetLabel {
    fn set_label(&mut self, rate: FrameRate, position: f64);
}

impl SetLabel for ChaseStatus {
    fn set_label(&mut self, rate: FrameRate, position: f64) {
        let day = f64::from(rate.frames_per_day());
        let frame = (position / rate.seconds(1.0) + 1e-6).rem_euclid(day);
        let Label { hours, minutes, seconds, frames } = rate.label(frame as u32);
        [self.hours, self.minutes, self.seconds, self.frames] = [hours, minutes, seconds, frames].map(u32::from);
        // The layout's numbers are in the order of `FrameRate::ALL`, from 1.
        self.frame_rate = rate as u32 + 1;
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use super::*;

    /// Handles a frame of a stream of one sender, one frame after the one before. Returns true if it is used.
    fn frame(leader: &mut TimecodeLeader, count: u32, stream: u8) -> bool {
        let (label, sender) = (FrameRate::Ebu25.label(count), (IpAddr::V4(Ipv4Addr::LOCALHOST), stream));
        leader.frame(label, FrameRate::Ebu25, 0.0, u64::from(count) * 40_000_000, Some(sender))
    }

    fn leader() -> TimecodeLeader {
        let offset = Label { hours: 0, minutes: 0, seconds: 0, frames: 0 };
        TimecodeLeader::new(ChaseSource::ArtNet, Schedule { offset, speed: 1.0 }, None, 2.0)
    }

    #[test]
    fn the_master_stream_or_the_given_one_is_followed() {
        let mut only = leader();
        assert!((0..10).all(|count| frame(&mut only, count, 3)));
        assert!(!frame(&mut only, 10, 4), "another stream while one is followed");
        assert!(frame(&mut only, 11, 0) && !frame(&mut only, 12, 3), "stream 0 takes over");
        let mut given = leader().of_stream(Some(4));
        assert_eq!([3, 0, 4, 0, 4].map(|stream| frame(&mut given, 20, stream)), [false, false, true, false, true]);
    }
}
