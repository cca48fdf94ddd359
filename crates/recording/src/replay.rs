//! A recording as the loop's frame source.
//!
//! In: a [`Recording`] and [`ReplayOptions`]. Out: a [`Replay`], the loop's [`FrameSource`], and a thread that reads
//! ahead into a queue of bounded size. With [`Pace::Recorded`] a frame is due as many periods after the first as in the
//! recording; with [`Pace::Even`] each period has a frame. If the loop skips periods, or the disk is late, all later
//! frames shift, so that no frame is skipped and none is sent in a burst.

mod pass;
#[cfg(test)]
mod tests;

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::mcap::ReadError;
use super::mcap::reader::{Contents, Recording};
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, HandlePose, QUEUE_BYTES};
use bench_dragon_motion::solve::Chain;
use bench_dragon_publisher::live::{FrameSource, Outgoing, Period, ShowCounts};
use bench_dragon_ros2_messages::HandlePoses;
use bench_dragon_show::Outcome;
use bench_dragon_show::convert::Stamps;
use pass::{Pass, Recorded, Start};

/// The time, in seconds of frames, that is read ahead.
const QUEUED_SECONDS: f64 = 2.0;
/// The least number of frames in that queue.
const QUEUED_FRAMES: usize = 4;
/// The interval at which the thread polls for room in the queue.
const ROOM_INTERVAL: Duration = Duration::from_millis(2);
/// The interval of the polls for the first frame, once a replay.
const FIRST_INTERVAL: Duration = Duration::from_micros(100);

/// The timing of the frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pace {
    /// As recorded, faster by this factor. Missing frames are a gap.
    Recorded(f64),
    /// At this rate per second, without gaps.
    Even(f64),
}

/// The settings of a replay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReplayOptions {
    /// The timing of the frames.
    pub pace: Pace,
    /// Simulated seconds at which the replay begins; `None` for the first frame.
    pub start: Option<f64>,
    /// True to begin again at the end.
    pub looping: bool,
}

/// A recorded frame with its alerts and cues.
struct QueuedFrame {
    /// The period, counted from the start of the replay.
    due: u64,
    header: FrameHeader,
    playback: PlaybackState,
    chain: Chain,
    alerts: Vec<CollisionAlert>,
    cues: Vec<Cue>,
    shows_played: u64,
}

/// The state that both ends share besides the queue.
#[derive(Default)]
struct ReplayState {
    stop: AtomicBool,
    /// Periods in which the due frame had not been read.
    waited: AtomicU64,
    failure: Mutex<Option<ReadError>>,
}

/// The loop's end: the frame source.
pub struct Replay {
    filled: Consumer<Box<QueuedFrame>>,
    free: Producer<Box<QueuedFrame>>,
    /// The latest frame sent, and the next one.
    sent: Option<Box<QueuedFrame>>,
    next: Option<Box<QueuedFrame>>,
    /// Periods by which all frames are later than recorded.
    behind: u64,
    shared: Arc<ReplayState>,
}

/// The thread that reads. Dropping this value ends the thread.
pub struct ReplayThread {
    shared: Arc<ReplayState>,
    handle: Option<JoinHandle<()>>,
}

/// An opened recording, before its replay.
pub struct Prepared {
    recording: Recording,
    options: ReplayOptions,
    start: Start,
    rate: f64,
}

impl Prepared {
    /// Opens a file, or the directory of a bag, and finds the first frame.
    ///
    /// # Errors
    /// [`ReadError`]
    pub fn open(file: &Path, options: ReplayOptions) -> Result<Self, ReadError> {
        let mut recording = Recording::open(file)?;
        let start = Start::find(&mut recording, options.start)?;
        let rate = match options.pace {
            Pace::Recorded(times) => recording.contents().rate * times,
            Pace::Even(rate) => rate,
        };
        Ok(Self { recording, options, start, rate })
    }

    /// Returns the contents of the recording.
    pub fn contents(&self) -> &Contents {
        self.recording.contents()
    }

    /// Returns the periods per second of the loop.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Returns the simulated seconds of the first frame.
    pub fn start(&self) -> f64 {
        self.start.sim_time
    }

    /// Starts the thread and waits for the first frame.
    ///
    /// # Errors
    /// The system refuses a thread.
    pub fn begin(self) -> std::io::Result<(Replay, ReplayThread)> {
        let handles = self.contents().ends[0].handles as usize;
        let frames = self.frames_ahead(handles);
        let (filled, loop_filled) = RingBuffer::new(frames);
        // Besides the frames in the queue, one is being filled, one is next and one was sent last.
        let (mut loop_free, free) = RingBuffer::new(frames + 3);
        for _ in 0..frames + 3 {
            // The ring has room for all of them.
            let _ = loop_free.push(Box::new(QueuedFrame::new(handles)));
        }
        let shared = Arc::new(ReplayState::default());
        let reading = Arc::clone(&shared);
        let thread = move || {
            let mut queue = Queue { filled, free, shared: &reading };
            if let Err(error) = self.read(&mut queue) {
                *reading.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            }
        };
        let handle = Some(std::thread::Builder::new().name("read ahead".to_owned()).spawn(thread)?);
        let mut replay = Replay {
            filled: loop_filled,
            free: loop_free,
            sent: None,
            next: None,
            behind: 0,
            shared: Arc::clone(&shared),
        };
        while replay.next.is_none() && !replay.filled.is_abandoned() {
            std::thread::sleep(FIRST_INTERVAL);
            replay.next = replay.filled.pop().ok();
        }
        Ok((replay, ReplayThread { shared, handle }))
    }

    fn frames_ahead(&self, handles: usize) -> usize {
        let affordable = QUEUE_BYTES / (handles.max(1) * size_of::<HandlePose>());
        ((self.rate * QUEUED_SECONDS) as usize).min(affordable).max(QUEUED_FRAMES)
    }

    /// Reads until the recording is over or the loop has ended.
    fn read(mut self, queue: &mut Queue<'_>) -> Result<(), ReadError> {
        let speed = self.rate / self.contents().rate;
        let handles = self.contents().ends[0].handles as usize;
        let (mut shows, mut began, mut epochs) = (0, 0_u64, 0_u32);
        loop {
            let mut pass = Pass::new(&self.start);
            let mut span: Option<[FrameHeader; 2]> = None;
            let mut due = began;
            while let Some(recorded) = pass.next(&mut self.recording)? {
                check(&recorded, handles, span)?;
                let header = recorded.frame.frame;
                let first = span.map_or(header, |[first, _]| first);
                due = match (self.options.pace, span) {
                    (Pace::Recorded(_), _) => began.saturating_add(header.tick - first.tick),
                    (Pace::Even(_), None) => began,
                    (Pace::Even(_), Some(_)) => due.saturating_add(1),
                };
                span = Some([first, header]);
                let Some(mut frame) = queue.room() else { return Ok(()) };
                frame.fill(recorded, due)?;
                frame.shows_played = shows;
                frame.header.epoch = frame.header.epoch.wrapping_add(epochs);
                // Keeps the recorded bits at the recorded speed.
                if speed != 1.0 {
                    frame.header.time_scale *= speed;
                }
                queue.push(frame);
            }
            let Some([first, last]) = span.filter(|_| self.options.looping) else { return Ok(()) };
            shows += 1;
            began = due.saturating_add(1);
            epochs = epochs.wrapping_add(last.epoch.wrapping_sub(first.epoch)).wrapping_add(1);
        }
    }
}

/// The thread's ends of the queues.
struct Queue<'a> {
    filled: Producer<Box<QueuedFrame>>,
    free: Consumer<Box<QueuedFrame>>,
    shared: &'a ReplayState,
}

impl Queue<'_> {
    /// Waits for a frame to fill. Returns `None` once the loop or the command has ended.
    fn room(&mut self) -> Option<Box<QueuedFrame>> {
        loop {
            if self.shared.stop.load(Ordering::Acquire) || self.filled.is_abandoned() {
                return None;
            }
            if !self.filled.is_full()
                && let Ok(frame) = self.free.pop()
            {
                return Some(frame);
            }
            std::thread::sleep(ROOM_INTERVAL);
        }
    }

    fn push(&mut self, frame: Box<QueuedFrame>) {
        // Only this end fills the queue, and there was room.
        let _ = self.filled.push(frame);
    }
}

/// Checks that a frame can follow the frames before it.
fn check(recorded: &Recorded, handles: usize, span: Option<[FrameHeader; 2]>) -> Result<(), ReadError> {
    let HandlePoses { frame: header, poses, .. } = &recorded.frame;
    let reason = match span {
        _ if poses.len() != handles => {
            format!("of {} handles after those of {handles}, expected the same number", poses.len())
        }
        Some([first, _]) if header.run_id != first.run_id => {
            "of another run than the first, expected those of one".to_owned()
        }
        Some([_, last]) if header.tick <= last.tick => {
            format!("of period {} after that of {}, expected a later one", header.tick, last.tick)
        }
        _ => return Ok(()),
    };
    Err(ReadError::Frame(reason))
}

impl QueuedFrame {
    fn new(handles: usize) -> Self {
        Self {
            due: 0,
            header: FrameHeader::default(),
            playback: PlaybackState::Playing,
            chain: Chain::new(handles),
            alerts: Vec::new(),
            cues: Vec::new(),
            shows_played: 0,
        }
    }

    /// Takes the contents of a recorded frame that is due in the period `due`.
    fn fill(&mut self, recorded: Recorded, due: u64) -> Result<(), ReadError> {
        let Recorded { frame: HandlePoses { header: _, frame: header, poses }, alerts, cues } = recorded;
        let unknown = |field| ReadError::Frame(format!("whose {field} this version does not know"));
        header.frame_state().ok_or_else(|| unknown("state"))?;
        self.playback = header.playback_state().ok_or_else(|| unknown("playback"))?;
        (self.due, self.alerts, self.cues) = (due, alerts, cues);
        self.header = FrameHeader { handles: poses.len() as u32, reserved: 0, ..header };
        // A recording holds no signed speeds: they keep their zeros.
        let Chain { x, y, heading, speed: _, vx, vy } = &mut self.chain;
        for numbers in [&mut *x, &mut *y, &mut *heading, &mut *vx, &mut *vy] {
            numbers.clear();
        }
        for pose in poses {
            let HandlePose { x: pose_x, y: pose_y, heading: pose_heading, vx: pose_vx, vy: pose_vy } = pose;
            x.push(pose_x);
            y.push(pose_y);
            heading.push(pose_heading);
            vx.push(pose_vx);
            vy.push(pose_vy);
        }
        // A message older than the replay gets the tick of its first period.
        let period = |tick: u64| due.saturating_sub(header.tick.saturating_sub(tick));
        self.alerts.iter_mut().for_each(|alert| alert.tick = period(alert.tick));
        self.cues.iter_mut().for_each(|cue| cue.tick = period(cue.tick));
        Ok(())
    }

    /// Gives the messages the stamps of this run, in the period `tick`.
    fn stamp(&mut self, tick: u64, stamps: Stamps, behind: u64) {
        let Stamps { run_id, sequence, stamp_ns, deadline_ns } = stamps;
        let header = &mut self.header;
        (header.run_id, header.sequence, header.tick) = (run_id, sequence, tick);
        (header.stamp_ns, header.sent_ns, header.deadline_ns) = (stamp_ns, 0, deadline_ns);
        for alert in &mut self.alerts {
            (alert.run_id, alert.stamp_ns) = (run_id, stamp_ns);
            alert.tick = alert.tick.saturating_add(behind);
        }
        for cue in &mut self.cues {
            (cue.run_id, cue.stamp_ns) = (run_id, stamp_ns);
            cue.tick = cue.tick.saturating_add(behind);
        }
    }
}

impl FrameSource for Replay {
    fn frame(&mut self, tick: u64, stamps: Stamps) -> Period<'_> {
        if self.next.is_none() {
            // Read before the queue, so that everything queued before its end is sent.
            let over = self.filled.is_abandoned();
            self.next = self.filled.pop().ok();
            if self.next.is_none() && over {
                return Period::Over;
            }
        }
        let Some(next) = &self.next else {
            self.shared.waited.fetch_add(1, Ordering::Relaxed);
            return Period::Empty;
        };
        let due = next.due.saturating_add(self.behind);
        if due > tick {
            return Period::Empty;
        }
        self.behind += tick - due;
        if let Some(used) = std::mem::replace(&mut self.sent, self.next.take()) {
            // The ring has room for every frame.
            let _ = self.free.push(used);
        }
        let Some(sent) = self.sent.as_deref_mut() else { return Period::Empty };
        sent.stamp(tick, stamps, self.behind);
        let QueuedFrame { due: _, header, playback: _, chain, alerts, cues, shows_played } = sent;
        let counts = ShowCounts { shows_played: *shows_played, ..ShowCounts::default() };
        Period::Frame(Outgoing { header, chain, alerts, cues, commands: &[], counts })
    }

    /// Answers `State` with the state of the recorded show. Refuses every other command.
    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome> {
        let code = if command == Command::State { Code::Done } else { Code::Refused };
        // Before the first frame, the next frame has the state.
        let frame = self.sent.as_deref().or(self.next.as_deref())?;
        let (playback, header) = (frame.playback, &frame.header);
        let (sim_time, time_scale, cue) = (header.sim_time, header.time_scale, header.cue);
        Some(Outcome { code, tick, sim_time, time_scale, playing_rate: time_scale, playback, cue })
    }

    fn finished_step(&mut self, _: u64) -> Option<Outcome> {
        None
    }
}

impl ReplayThread {
    /// Ends the thread. Returns the periods in which the loop waited for it, and the error that ended it early.
    pub fn finish(mut self) -> (u64, Option<ReadError>) {
        self.join();
        let failure = self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
        (self.shared.waited.load(Ordering::Relaxed), failure)
    }

    fn join(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        if self.handle.take().is_some_and(|handle| handle.join().is_err()) {
            // The thread has printed its panic.
            let error = std::io::Error::other("the thread that reads has panicked");
            *self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error.into());
        }
    }
}

impl Drop for ReplayThread {
    fn drop(&mut self) {
        self.join();
    }
}
