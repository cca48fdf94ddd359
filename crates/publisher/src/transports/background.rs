//! What keeps a slow transport off the loop: a queue, a thread, and a rate of its own.
//!
//! [`BackgroundPublisher`] is the loop's end: it copies a frame into memory that was set aside and returns, without a
//! lock, an allocation or a system call. The thread owns the transport's [`Sink`] and takes frames from the queue; where
//! it falls behind it continues with the newest and counts what it left out. Called by the transports that need it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use crate::live::{Outgoing, PublishError, Publisher, StatusPublisher, TransportCounters};
use bench_dragon_client::clock::{Clock, SystemClock, monotonic_ns};
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, QUEUE_BYTES};
use bench_dragon_show::convert::handle_poses;

/// Seconds of frames that the thread may fall behind before it continues with the newest.
const QUEUED_SECONDS: f64 = 0.25;
/// The least and the most frames in that queue.
const QUEUED_FRAMES: (usize, usize) = (4, 256);
/// Alerts in their queue; one a second is usual.
const QUEUED_ALERTS: usize = 256;
/// Times that all cues of the scene fit into their queue: one frame can reach every one of them twice.
const QUEUED_SHOWS: usize = 8;
/// Nanoseconds after a frame's deadline at which the queue is polled for it, and between two polls from then on.
const FIRST_POLL_NS: u64 = 300_000;
const POLL_INTERVAL_NS: u64 = 500_000;
/// The longest sleep: messages that are sent seldom wait no longer.
const LONGEST_SLEEP_NS: u64 = 50_000_000;

/// What a transport does with what comes, on the thread. It is made there and dropped there.
pub trait Sink {
    /// Does what is due besides sending: before each frame, and every 50 ms at least.
    fn service(&mut self) {}

    /// Sends a frame.
    fn frame(&mut self, header: &FrameHeader, handles: &[HandlePose]);

    /// Sends an alert.
    fn alert(&mut self, alert: CollisionAlert);

    /// Sends a cue.
    fn cue(&mut self, cue: Cue);

    /// Sends the loop's status.
    fn status(&mut self, status: &LoopStatus);

    /// Messages so far that a full queue of the transport's own did not take.
    fn discarded(&self) -> u64;

    /// How long receivers are given for the last messages before the sink is dropped.
    fn linger(&self) -> Duration;
}

/// What the queue is made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackgroundConfig {
    /// The thread's name.
    pub name: &'static str,
    /// Handles in a frame.
    pub handles: usize,
    /// Cues of the scene.
    pub cues: usize,
    /// Frames per second of the loop.
    pub loop_rate: f64,
    /// Frames per second to send, at most those of the loop.
    pub rate: f64,
}

/// One frame on its way to the thread.
struct Snapshot {
    header: FrameHeader,
    handles: Vec<HandlePose>,
}

/// What the ends share besides the queues.
#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    /// Frames that found the queue full.
    rejected: AtomicU64,
    frames: AtomicU64,
    skipped: AtomicU64,
    discarded: AtomicU64,
}

/// The loop's end.
pub struct BackgroundPublisher {
    /// Frames per frame of the loop, at most 1.
    share: f64,
    latest_slot: Option<u64>,
    free: Consumer<Box<Snapshot>>,
    filled: Producer<Box<Snapshot>>,
    alerts: Producer<CollisionAlert>,
    cues: Producer<Cue>,
    shared: Arc<Shared>,
}

/// The statistics thread's end.
pub struct BackgroundStatus(mpsc::Sender<LoopStatus>);

/// The thread. Dropping it sends what is queued, ends the thread and drops the sink.
pub struct BackgroundThread {
    shared: Arc<Shared>,
    handle: Option<JoinHandle<()>>,
}

/// What the thread does, without its waiting: a simulated scheduler can call it in the thread's place.
pub struct Worker<S> {
    sink: S,
    inbox: Inbox,
    period_ns: u64,
    /// Frames that had found the queue full when the last frame was taken from it.
    rejected_before: u64,
}

/// The thread's ends of the queues.
pub struct Inbox {
    free: Producer<Box<Snapshot>>,
    filled: Consumer<Box<Snapshot>>,
    alerts: Consumer<CollisionAlert>,
    cues: Consumer<Cue>,
    status: mpsc::Receiver<LoopStatus>,
    shared: Arc<Shared>,
}

/// Why there is no thread with a sink.
#[derive(Debug, thiserror::Error)]
pub enum BackgroundError<E> {
    /// The sink could not be made.
    #[error(transparent)]
    Open(#[from] E),
    /// The system gave no thread, or it ended early.
    #[error("its thread could not be started: {0}")]
    Thread(String),
}

/// Starts a thread, has it make its sink with `open`, and returns when that exists.
///
/// # Errors
/// [`BackgroundError`]
pub fn start<S: Sink, E: Send + 'static>(
    config: BackgroundConfig,
    open: impl FnOnce() -> Result<S, E> + Send + 'static,
) -> Result<(BackgroundPublisher, BackgroundStatus, BackgroundThread), BackgroundError<E>> {
    let (publisher, status, inbox) = queues(config);
    let shared = Arc::clone(&inbox.shared);
    let (opened, opening) = mpsc::channel();
    let thread = move || match open() {
        Ok(sink) => {
            let _ = opened.send(Ok(()));
            Worker::new(sink, inbox, config.rate).serve(&SystemClock);
        }
        Err(error) => drop(opened.send(Err(error))),
    };
    let handle = std::thread::Builder::new().name(config.name.to_owned()).spawn(thread);
    let handle = handle.map_err(|error| BackgroundError::Thread(error.to_string()))?;
    let thread = BackgroundThread { shared, handle: Some(handle) };
    match opening.recv() {
        Ok(opened) => opened?,
        // It panicked, which it has printed.
        Err(_) => return Err(BackgroundError::Thread("it ended early".to_owned())),
    }
    Ok((publisher, status, thread))
}

/// The loop's end, the statistics thread's, and the thread's ends of the queues between them.
pub fn queues(config: BackgroundConfig) -> (BackgroundPublisher, BackgroundStatus, Inbox) {
    let depth = queue_depth(config.handles, config.rate);
    // Besides those in the queue one is being filled and one is being sent.
    let (mut free_producer, free) = RingBuffer::new(depth + 2);
    for _ in 0..depth + 2 {
        let snapshot =
            Snapshot { header: FrameHeader::default(), handles: vec![HandlePose::default(); config.handles] };
        // The ring has just as many places.
        let _ = free_producer.push(Box::new(snapshot));
    }
    let (filled, filled_consumer) = RingBuffer::new(depth);
    let (alerts, alerts_consumer) = RingBuffer::new(QUEUED_ALERTS);
    let (cues, cues_consumer) = RingBuffer::new(QUEUED_SHOWS * config.cues);
    let (status, status_receiver) = mpsc::channel();
    let shared = Arc::new(Shared::default());
    let inbox = Inbox {
        free: free_producer,
        filled: filled_consumer,
        alerts: alerts_consumer,
        cues: cues_consumer,
        status: status_receiver,
        shared: Arc::clone(&shared),
    };
    let share = config.rate / config.loop_rate;
    let publisher = BackgroundPublisher { share, latest_slot: None, free, filled, alerts, cues, shared };
    (publisher, BackgroundStatus(status), inbox)
}

fn queue_depth(handles: usize, rate: f64) -> usize {
    let (least, most) = QUEUED_FRAMES;
    let affordable = QUEUE_BYTES / (handles * size_of::<HandlePose>());
    ((rate * QUEUED_SECONDS) as usize).clamp(least, most).min(affordable.max(least))
}

impl<S: Sink> Worker<S> {
    /// What sends `rate` frames per second, at most, with this sink.
    pub fn new(sink: S, inbox: Inbox, rate: f64) -> Self {
        Self { sink, inbox, period_ns: (1e9 / rate) as u64, rejected_before: 0 }
    }

    /// Sends what the queues bring until the thread is to stop.
    fn serve(mut self, clock: &impl Clock) {
        let mut poll_at = 0;
        loop {
            // Read before the queues are emptied: what was put there before it was set is then still sent.
            let ending = self.inbox.shared.stop.load(Ordering::Acquire);
            clock.sleep_until(poll_at);
            poll_at = self.send(clock);
            if ending {
                std::thread::sleep(self.sink.linger());
                return;
            }
        }
    }

    /// Sends what the queues have brought; when there will be something next, CLOCK_MONOTONIC in nanoseconds. A sink that
    /// takes longer over a frame than the next one takes to come is here for ever: all else is looked after between two frames.
    pub fn send(&mut self, clock: &impl Clock) -> u64 {
        let mut deadline_ns = None;
        loop {
            self.send_events();
            let Some(sent_ns) = self.send_frame() else { break };
            deadline_ns = Some(sent_ns);
        }
        let period_ns = self.period_ns;
        let now = clock.monotonic_ns();
        let poll_at = match deadline_ns {
            Some(deadline_ns) => (deadline_ns + period_ns + FIRST_POLL_NS).max(now),
            None => now + POLL_INTERVAL_NS,
        };
        poll_at.min(now + LONGEST_SLEEP_NS)
    }

    /// Does what is due besides frames, and sends what comes seldom.
    fn send_events(&mut self) {
        let Self { sink, inbox, .. } = self;
        sink.service();
        while let Ok(alert) = inbox.alerts.pop() {
            sink.alert(alert);
        }
        while let Ok(cue) = inbox.cues.pop() {
            sink.cue(cue);
        }
        while let Ok(status) = inbox.status.try_recv() {
            sink.status(&status);
        }
        inbox.shared.discarded.store(sink.discarded(), Ordering::Relaxed);
    }

    /// Sends the next frame in the queue, or the newest where one has found the queue full since the last; its deadline,
    /// CLOCK_MONOTONIC in nanoseconds, or nothing where there is none.
    fn send_frame(&mut self) -> Option<u64> {
        let Self { sink, inbox, rejected_before, .. } = self;
        let Shared { rejected, frames, skipped, .. } = &*inbox.shared;
        let rejected_now = rejected.load(Ordering::Relaxed);
        let newest_only = std::mem::replace(rejected_before, rejected_now) < rejected_now;
        let mut snapshot = inbox.filled.pop().ok()?;
        while newest_only && let Ok(newer) = inbox.filled.pop() {
            skipped.fetch_add(1, Ordering::Relaxed);
            // The ring has a place for every snapshot there is.
            let _ = inbox.free.push(std::mem::replace(&mut snapshot, newer));
        }
        sink.frame(&snapshot.header, &snapshot.handles);
        frames.fetch_add(1, Ordering::Relaxed);
        let deadline_ns = snapshot.header.deadline_ns;
        let _ = inbox.free.push(snapshot);
        Some(deadline_ns)
    }

    /// What has been done with the frames of the loop so far.
    pub fn counters(&self) -> TransportCounters {
        self.inbox.shared.counters()
    }
}

impl Shared {
    fn counters(&self) -> TransportCounters {
        let [rejected, frames, skipped, discarded] =
            [&self.rejected, &self.frames, &self.skipped, &self.discarded].map(|count| count.load(Ordering::Relaxed));
        TransportCounters { frames, skipped: skipped + rejected, discarded }
    }
}

impl BackgroundPublisher {
    /// Whether a frame of this tick is to be sent: the rate's number per second, evenly spaced.
    fn due(&mut self, tick: u64) -> bool {
        // At most 20,000 ticks a second: beyond 2^53 they would have run for 14,000 years.
        let slot = (tick as f64 * self.share) as u64;
        self.latest_slot.replace(slot) != Some(slot)
    }
}

impl Publisher for BackgroundPublisher {
    fn publish(&mut self, outgoing: Outgoing<'_>) -> Result<(), PublishError> {
        let Outgoing { header, chain, alerts, cues, .. } = outgoing;
        for alert in alerts {
            // Dropped if the thread is 256 alerts behind.
            let _ = self.alerts.push(*alert);
        }
        for cue in cues {
            let _ = self.cues.push(*cue);
        }
        if !self.due(header.tick) {
            return Ok(());
        }
        // Only this end fills the queue, so that it still has room below.
        let free = if self.filled.is_full() { None } else { self.free.pop().ok() };
        let Some(mut snapshot) = free else {
            self.shared.rejected.fetch_add(1, Ordering::Relaxed);
            return Ok(());
        };
        snapshot.header = FrameHeader { sent_ns: monotonic_ns(), ..*header };
        for (slot, pose) in snapshot.handles.iter_mut().zip(handle_poses(chain)) {
            *slot = pose;
        }
        let _ = self.filled.push(snapshot);
        Ok(())
    }

    fn maintain(&mut self) {}

    fn subscribers(&self) -> u32 {
        0
    }
}

impl StatusPublisher for BackgroundStatus {
    fn publish_status(&mut self, status: &LoopStatus) {
        // The thread may have ended: the last status then has no receiver.
        let _ = self.0.send(*status);
    }
}

impl BackgroundThread {
    /// Ends the thread once it has sent what is queued; what it has done.
    pub fn finish(mut self) -> TransportCounters {
        self.join();
        self.shared.counters()
    }

    fn join(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        if let Some(handle) = self.handle.take() {
            // A panic has been printed by then.
            let _ = handle.join();
        }
    }
}

impl Drop for BackgroundThread {
    fn drop(&mut self) {
        self.join();
    }
}

#[cfg(test)]
mod tests;
