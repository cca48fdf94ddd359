//! A recording as frames of the live loop.
//!
//! In: a [`Recording`] and how to play it. Out: a [`Replay`], which the loop asks for the frame of each period, and a thread
//! that reads ahead of it into a queue of bounded size. A frame is due as many periods after the first as it was when it was
//! recorded; where the loop has skipped periods, or the disk was late, all that follow are as much later, so that no frame is
//! left out and none is sent in a burst. Called by the command `replay`.

mod pass;
#[cfg(test)]
mod tests;

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::mcap::reader::{Contents, ReadError, Recording};
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_messages::{FrameHeader, HandlePose};
use bench_dragon_publisher::live::{Frames, Messages, Period};
use bench_dragon_ros2_messages::HandlePoses;
use bench_dragon_show::convert::read_frame;
use bench_dragon_show::{Frame, Outcome};
use pass::{Pass, Recorded, Start};

/// Seconds of frames that are read ahead.
const QUEUED_SECONDS: f64 = 2.0;
/// The least of frames in that queue, and the memory that more may take.
const QUEUED_FRAMES: usize = 4;
const QUEUED_BYTES: usize = 64_000_000;
/// How often the thread looks for room in the queue.
const ROOM_INTERVAL: Duration = Duration::from_millis(2);
/// How often it is looked for the first frame: once a replay.
const FIRST_INTERVAL: Duration = Duration::from_micros(100);

/// When the frames go out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pace {
    /// As recorded, so many times as fast: where frames are missing there is a gap.
    Recorded(f64),
    /// One in each period of so many a second: gaps are closed.
    Even(f64),
}

/// How a recording is played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReplayOptions {
    /// When the frames go out.
    pub pace: Pace,
    /// The replay begins with the first frame at or after these simulated seconds; `None` for the first of the file.
    pub start: Option<f64>,
    /// Whether it begins again once it is over.
    pub looping: bool,
}

/// A frame with what goes out beside it.
struct Moment {
    /// The period since the beginning of the replay.
    due: u64,
    frame: Frame,
    messages: Messages,
}

/// What both ends of the queue know.
#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    /// Periods in which a frame was due that had not been read.
    waited: AtomicU64,
    failure: Mutex<Option<ReadError>>,
}

/// The loop's end: the frames.
pub struct Replay {
    filled: Consumer<Box<Moment>>,
    free: Producer<Box<Moment>>,
    /// The one that was sent last, and the one that is next.
    sent: Option<Box<Moment>>,
    next: Option<Box<Moment>>,
    /// Periods by which everything is later.
    behind: u64,
    shared: Arc<Shared>,
}

/// The thread that reads. Dropping it ends it.
pub struct ReplayThread {
    shared: Arc<Shared>,
    handle: Option<JoinHandle<()>>,
}

/// A recording that is about to be played.
pub struct Prepared {
    recording: Recording,
    options: ReplayOptions,
    start: Start,
    rate: f64,
}

impl Prepared {
    /// Opens a file and finds where to begin.
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

    /// What the recording holds.
    pub fn contents(&self) -> &Contents {
        self.recording.contents()
    }

    /// Periods per second of the loop that plays it.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Simulated seconds of the first frame.
    pub fn start(&self) -> f64 {
        self.start.sim_time
    }

    /// Starts to read. At most once the frames are waited for: the first is there when this returns.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn begin(self) -> std::io::Result<(Replay, ReplayThread)> {
        let handles = self.contents().ends[0].handles as usize;
        let frames = self.frames_ahead(handles);
        let (filled, loop_filled) = RingBuffer::new(frames);
        // Besides those in the queue one is being filled, one is next and one was sent last.
        let (mut loop_free, free) = RingBuffer::new(frames + 3);
        for _ in 0..frames + 3 {
            let messages = Messages::default();
            // The ring has just as many places.
            let _ = loop_free.push(Box::new(Moment { due: 0, frame: Frame::new(handles), messages }));
        }
        let shared = Arc::new(Shared::default());
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
        let affordable = QUEUED_BYTES / (handles.max(1) * size_of::<HandlePose>());
        ((self.rate * QUEUED_SECONDS) as usize).min(affordable).max(QUEUED_FRAMES)
    }

    /// Reads until the recording is over or nobody wants more of it.
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
                let Some(mut moment) = queue.room() else { return Ok(()) };
                fill(&mut moment, recorded, due)?;
                let frame = &mut moment.frame;
                frame.shows_played = shows;
                frame.epoch = frame.epoch.wrapping_add(epochs);
                // A product with 1 would be the same bits; this is plain to see.
                if speed != 1.0 {
                    frame.time_scale *= speed;
                }
                queue.push(moment);
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
    filled: Producer<Box<Moment>>,
    free: Consumer<Box<Moment>>,
    shared: &'a Shared,
}

impl Queue<'_> {
    /// A moment to fill, once there is one; `None` where no more are wanted.
    fn room(&mut self) -> Option<Box<Moment>> {
        loop {
            if self.shared.stop.load(Ordering::Acquire) || self.filled.is_abandoned() {
                return None;
            }
            if !self.filled.is_full()
                && let Ok(moment) = self.free.pop()
            {
                return Some(moment);
            }
            std::thread::sleep(ROOM_INTERVAL);
        }
    }

    fn push(&mut self, moment: Box<Moment>) {
        // Only this end fills the queue, and there was room.
        let _ = self.filled.push(moment);
    }
}

/// Fails unless a frame can follow those before it.
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

/// Makes a moment that of a frame which is due in a period.
fn fill(moment: &mut Moment, recorded: Recorded, due: u64) -> Result<(), ReadError> {
    let Recorded { frame: message, alerts, cues } = recorded;
    let header = message.frame;
    moment.due = due;
    let unknown = |field| ReadError::Frame(format!("whose {field} this version does not know"));
    read_frame(&header, &message.poses, &mut moment.frame).map_err(unknown)?;
    // What is older than the replay is of its first period.
    let period = |tick: u64| due.saturating_sub(header.tick.saturating_sub(tick));
    let Messages { alerts: outgoing_alerts, cues: outgoing_cues } = &mut moment.messages;
    outgoing_alerts.clear();
    outgoing_alerts.extend(alerts.into_iter().map(|mut alert| {
        alert.tick = period(alert.tick);
        alert
    }));
    outgoing_cues.clear();
    outgoing_cues.extend(cues.into_iter().map(|mut cue| {
        cue.tick = period(cue.tick);
        cue
    }));
    Ok(())
}

impl Frames for Replay {
    fn frame(&mut self, tick: u64) -> Period<'_> {
        if self.next.is_none() {
            // Read before the queue: what was put there before it was left is then still sent.
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
            // The ring has a place for every moment there is.
            let _ = self.free.push(used);
        }
        let Some(Moment { frame, messages, .. }) = self.sent.as_deref_mut() else { return Period::Empty };
        frame.tick = tick;
        let behind = self.behind;
        messages.alerts.iter_mut().for_each(|alert| alert.tick = alert.tick.saturating_add(behind));
        messages.cues.iter_mut().for_each(|cue| cue.tick = cue.tick.saturating_add(behind));
        Period::Frame(frame, messages)
    }

    /// Tells how the recorded show stands, and refuses everything else.
    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome> {
        let code = if command == Command::State { Code::Done } else { Code::Refused };
        // A command that comes before the first frame is answered with it.
        let Moment { frame, .. } = self.sent.as_deref().or(self.next.as_deref())?;
        let Frame { sim_time, time_scale, playback, cue, .. } = *frame;
        Some(Outcome { code, tick, sim_time, time_scale, playing_rate: time_scale, playback, cue })
    }

    fn finished_step(&mut self, _: u64) -> Option<Outcome> {
        None
    }
}

impl ReplayThread {
    /// Ends the thread: the periods in which the loop waited for it, and why it ended before the recording did.
    pub fn finish(mut self) -> (u64, Option<ReadError>) {
        self.join();
        let failure = self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
        (self.shared.waited.load(Ordering::Relaxed), failure)
    }

    fn join(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        if self.handle.take().is_some_and(|handle| handle.join().is_err()) {
            // It has been printed by then.
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
