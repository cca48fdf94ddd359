//! The frames of a recording from a start to its end, each with its alerts and cues.
//!
//! A recorder may receive an alert a little before or after its frame, so the frames of a chunk are returned after the
//! next chunk has been read. A later file of a bag may begin with the alert and the cue that hold; they are not sent
//! twice.

use std::collections::VecDeque;

use crate::mcap::ReadError;
use crate::mcap::reader::{Item, Recording, frame_of, header_of};
use bench_dragon_messages::{CollisionAlert, Cue};
use bench_dragon_ros2_messages::HandlePoses;

/// The start of a replay.
#[derive(Debug, Clone)]
pub(super) struct Start {
    /// The first chunk to read: one before the chunk of the first frame.
    chunk: usize,
    /// Frames of earlier periods are skipped.
    tick: u64,
    /// Simulated seconds of the first frame.
    pub sim_time: f64,
    /// The latest messages at that time, as a subscriber that joins gets them.
    alert: Option<CollisionAlert>,
    cue: Option<Cue>,
}

/// A frame with its alerts and cues.
#[derive(Debug)]
pub(super) struct Recorded {
    pub frame: HandlePoses,
    pub alerts: Vec<CollisionAlert>,
    pub cues: Vec<Cue>,
}

/// One playback of the recording.
pub(super) struct Pass {
    next_chunk: usize,
    /// The frames to return, and the frames of the chunk after them.
    frames: VecDeque<Vec<u8>>,
    ahead: VecDeque<Vec<u8>>,
    /// The chunks of `frames` and of `ahead`.
    chunk: usize,
    ahead_chunk: usize,
    /// The messages that belong to no returned frame.
    alerts: VecDeque<CollisionAlert>,
    cues: VecDeque<Cue>,
    /// The latest alert and cue that were read: tick, stamp, and kind or number.
    latest_alert: Option<(u64, u64, [u32; 2])>,
    latest_cue: Option<(u64, u64, u32)>,
    /// As in [`Start`].
    from_tick: u64,
    /// True before the first frame.
    first: bool,
    /// The error of the next chunk, returned after the frames before it.
    failure: Option<ReadError>,
}

impl Start {
    /// Finds the first frame at or after `seconds` simulated seconds, or the first frame of the file for `None`.
    pub fn find(recording: &mut Recording, seconds: Option<f64>) -> Result<Self, ReadError> {
        let [first, _] = recording.contents().ends;
        // Not the tick of the first frame: with a wrong index, there can be a frame before it.
        let mut start = Self { chunk: 0, tick: 0, sim_time: first.sim_time, alert: None, cue: None };
        let Some(seconds) = seconds else { return Ok(start) };
        let mut pass = Pass::new(&start);
        let mut end = f64::NEG_INFINITY;
        while let Some(bytes) = pass.next_frame(recording)? {
            let header = header_of(&bytes)?;
            if header.sim_time >= seconds {
                (start.chunk, start.tick) = (pass.chunk.saturating_sub(1), header.tick);
                start.sim_time = header.sim_time;
                return Ok(start);
            }
            let (alerts, cues) = pass.take_messages(header.tick);
            start.alert = alerts.last().copied().or(start.alert);
            start.cue = cues.last().copied().or(start.cue);
            end = end.max(header.sim_time);
        }
        Err(ReadError::Start { start: seconds, end })
    }
}

impl Pass {
    pub fn new(start: &Start) -> Self {
        Self {
            next_chunk: start.chunk,
            frames: VecDeque::new(),
            ahead: VecDeque::new(),
            chunk: start.chunk,
            ahead_chunk: start.chunk,
            alerts: start.alert.into_iter().collect(),
            cues: start.cue.into_iter().collect(),
            latest_alert: None,
            latest_cue: None,
            from_tick: start.tick,
            first: true,
            failure: None,
        }
    }

    /// Returns the next frame, or `None` at the end of the recording.
    pub fn next(&mut self, recording: &mut Recording) -> Result<Option<Recorded>, ReadError> {
        while let Some(bytes) = self.next_frame(recording)? {
            let tick = header_of(&bytes)?.tick;
            if self.first && tick < self.from_tick {
                continue;
            }
            let frame = frame_of(&bytes)?;
            // Messages of frames that are missing at the end go with the last frame.
            let is_last = self.frames.is_empty() && self.ahead.is_empty();
            let (mut alerts, mut cues) = self.take_messages(if is_last { u64::MAX } else { tick });
            if std::mem::take(&mut self.first) {
                keep_latest_before(&mut alerts, |alert| alert.tick < tick);
                keep_latest_before(&mut cues, |cue| cue.tick < tick);
            }
            return Ok(Some(Recorded { frame, alerts, cues }));
        }
        Ok(None)
    }

    /// Returns the bytes of the next frame.
    fn next_frame(&mut self, recording: &mut Recording) -> Result<Option<Vec<u8>>, ReadError> {
        while self.frames.is_empty() {
            self.frames = std::mem::take(&mut self.ahead);
            self.chunk = self.ahead_chunk;
            while self.ahead.is_empty() && self.next_chunk < recording.chunks() && self.failure.is_none() {
                self.read_chunk(recording);
            }
            if self.frames.is_empty() && self.ahead.is_empty() {
                return self.failure.take().map_or(Ok(None), Err);
            }
        }
        Ok(self.frames.pop_front())
    }

    /// Reads a chunk. If the chunk is damaged, nothing of it is kept.
    fn read_chunk(&mut self, recording: &mut Recording) {
        let (mut frames, mut alerts, mut cues) = (VecDeque::new(), Vec::new(), Vec::new());
        let read = recording.read_chunk(self.next_chunk, &mut |item| match item {
            Item::Frame(bytes) => frames.push_back(bytes),
            Item::Alert(alert) => alerts.push(alert),
            Item::Cue(cue) => cues.push(cue),
            Item::Status(_) | Item::Stage(_) => (),
        });
        self.ahead_chunk = self.next_chunk;
        self.next_chunk += 1;
        match read {
            Ok(()) => {
                self.ahead = frames;
                let of_alert = |of: &CollisionAlert| (of.tick, of.stamp_ns, [of.level, of.event]);
                self.alerts.extend(alerts.into_iter().filter(|of| is_new(&mut self.latest_alert, of_alert(of))));
                let of_cue = |of: &Cue| (of.tick, of.stamp_ns, of.number);
                self.cues.extend(cues.into_iter().filter(|of| is_new(&mut self.latest_cue, of_cue(of))));
            }
            Err(error) => self.failure = Some(error),
        }
    }

    /// Returns the messages of periods up to `tick`.
    fn take_messages(&mut self, tick: u64) -> (Vec<CollisionAlert>, Vec<Cue>) {
        let alerts = self.alerts.partition_point(|alert| alert.tick <= tick);
        let cues = self.cues.partition_point(|cue| cue.tick <= tick);
        (self.alerts.drain(..alerts).collect(), self.cues.drain(..cues).collect())
    }
}

/// Keeps the key of a message as the latest. Returns false if the message before it had the same.
fn is_new<Key: PartialEq + Copy>(latest: &mut Option<Key>, key: Key) -> bool {
    latest.replace(key) != Some(key)
}

/// Keeps only the last of the messages that are older than the first frame.
fn keep_latest_before<T>(messages: &mut Vec<T>, is_before: impl Fn(&T) -> bool) {
    let before = messages.iter().take_while(|message| is_before(message)).count();
    messages.drain(..before.saturating_sub(1));
}
