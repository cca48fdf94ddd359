//! Keeps a slow transport off the loop by a queue, a thread and a separate rate.
//!
//! [`BackgroundPublisher`] is the loop's end. It copies a frame into reserved memory without a lock, an allocation or a
//! system call. The thread owns the transport's [`Sink`] and takes frames from the queue. If the thread falls behind,
//! it continues with the newest frame and counts the skipped ones. Called by the ROS 2 transport.

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
/// The length of the queue of alerts. One alert a second is usual.
const QUEUED_ALERTS: usize = 256;
/// The length of the queue of cues, in cues of the scene: one frame can reach each cue twice.
const QUEUED_SHOWS: usize = 8;
/// Nanoseconds after a frame's deadline at which the queue is polled for it, and between two polls from then on.
const FIRST_POLL_NS: u64 = 300_000;
const POLL_INTERVAL_NS: u64 = 500_000;
/// The longest sleep, and so the longest wait of an event-driven message.
const LONGEST_SLEEP_NS: u64 = 50_000_000;

/// The transport's part on the thread. Created and dropped there.
pub trait Sink {
    /// Does the transport's periodic work. Called before each frame, and at least every 50 ms.
    fn service(&mut self) {}

    /// Sends a frame.
    fn frame(&mut self, header: &FrameHeader, handles: &[HandlePose]);

    /// Sends an alert.
    fn alert(&mut self, alert: CollisionAlert);

    /// Sends a cue.
    fn cue(&mut self, cue: Cue);

    /// Sends the loop's status.
    fn status(&mut self, status: &LoopStatus);

    /// Returns the number of messages that did not fit into the transport's queues.
    fn discarded(&self) -> u64;

    /// Returns the time for which the sink is kept after the last messages, for its receivers.
    fn linger(&self) -> Duration;
}

/// The settings of the queue and its thread.
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

/// A frame in the queue.
struct Snapshot {
    header: FrameHeader,
    handles: Vec<HandlePose>,
}

/// The state that the ends share besides the queues.
#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    /// Frames for which the queue was full.
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

/// The thread without its waiting, for a simulated scheduler.
pub struct Worker<S> {
    sink: S,
    inbox: Inbox,
    period_ns: u64,
    /// The value of `rejected` when the latest frame was taken.
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

/// The reason why there is no thread with a sink.
#[derive(Debug, thiserror::Error)]
pub enum BackgroundError<E> {
    /// The sink could not be created.
    #[error(transparent)]
    Open(#[from] E),
    /// The system refused a thread, or the thread ended early.
    #[error("its thread could not be started: {0}")]
    Thread(String),
}

/// Starts a thread that creates its sink by `open`. Returns when the sink exists.
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
        // The thread panicked and has printed that.
        Err(_) => return Err(BackgroundError::Thread("it ended early".to_owned())),
    }
    Ok((publisher, status, thread))
}

/// Creates the queues: the loop's end, the statistics thread's end, and the thread's ends.
pub fn queues(config: BackgroundConfig) -> (BackgroundPublisher, BackgroundStatus, Inbox) {
    let depth = queue_depth(config.handles, config.rate);
    // Besides the frames in the queue, one is being filled and one is being sent.
    let (mut free_producer, free) = RingBuffer::new(depth + 2);
    for _ in 0..depth + 2 {
        let snapshot =
            Snapshot { header: FrameHeader::default(), handles: vec![HandlePose::default(); config.handles] };
        // The ring has room for all of them.
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
    /// Creates a worker that sends at most `rate` frames per second.
    pub fn new(sink: S, inbox: Inbox, rate: f64) -> Self {
        Self { sink, inbox, period_ns: (1e9 / rate) as u64, rejected_before: 0 }
    }

    /// Sends the contents of the queues until the thread must stop.
    fn serve(mut self, clock: &impl Clock) {
        let mut poll_at = 0;
        loop {
            // Read before the queues are emptied, so that everything queued before it was set is sent.
            let ending = self.inbox.shared.stop.load(Ordering::Acquire);
            clock.sleep_until(poll_at);
            poll_at = self.send(clock);
            if ending {
                std::thread::sleep(self.sink.linger());
                return;
            }
        }
    }

    /// Sends the contents of the queues. Returns the time of the next poll, CLOCK_MONOTONIC in nanoseconds. If the sink
    /// is slower than the frame rate, this loop never returns, so event-driven messages are sent before each frame.
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

    /// Does the periodic work and sends the event-driven messages.
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

    /// Sends the next frame in the queue, or the newest if the queue was full since the last call. Returns the frame's
    /// deadline, CLOCK_MONOTONIC in nanoseconds, or `None` without a frame.
    fn send_frame(&mut self) -> Option<u64> {
        let Self { sink, inbox, rejected_before, .. } = self;
        let Shared { rejected, frames, skipped, .. } = &*inbox.shared;
        let rejected_now = rejected.load(Ordering::Relaxed);
        let newest_only = std::mem::replace(rejected_before, rejected_now) < rejected_now;
        let mut snapshot = inbox.filled.pop().ok()?;
        while newest_only && let Ok(newer) = inbox.filled.pop() {
            skipped.fetch_add(1, Ordering::Relaxed);
            // The ring has room for every snapshot.
            let _ = inbox.free.push(std::mem::replace(&mut snapshot, newer));
        }
        sink.frame(&snapshot.header, &snapshot.handles);
        frames.fetch_add(1, Ordering::Relaxed);
        let deadline_ns = snapshot.header.deadline_ns;
        let _ = inbox.free.push(snapshot);
        Some(deadline_ns)
    }

    /// Returns the counters so far.
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
    /// Returns true if the frame of this tick must be sent. Such frames are evenly spaced.
    fn due(&mut self, tick: u64) -> bool {
        // At 20,000 ticks a second, 2^53 ticks last 14,000 years.
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
        // Only this end fills the queue, so there is still room below.
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
    /// Sends the contents of the queues and ends the thread. Returns its counters.
    pub fn finish(mut self) -> TransportCounters {
        self.join();
        self.shared.counters()
    }

    fn join(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        if let Some(handle) = self.handle.take() {
            // The thread has printed its panic.
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
