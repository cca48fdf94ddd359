//! ROS 2 topics, by ros2-client on RustDDS: on a thread of their own, at a rate of their own.
//!
//! [`Ros2Publisher`] is the loop's end: it copies a frame into memory that was set aside and goes on, without a lock,
//! an allocation or a system call. [`Ros2Thread`] is the other end: it owns everything of ROS and takes frames from a
//! queue; where it falls behind it goes on with the newest and counts what it left out. The `run` command opens both.

pub mod environment;
pub mod messages;
mod node;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;

use rtrb::{Consumer, Producer, RingBuffer};

use crate::live::statistics::TransportCounts;
use crate::live::{PublishError, Publisher, StatusPublisher};
use crate::scene::ros2::Ros2Settings;
use crate::show::Frame;
use crate::wire::convert::{collision_alert, handle_pose};
use crate::wire::{CollisionAlert, FrameHeader, HandlePose, LoopStatus, Stage};

use environment::{Network, check_name};

/// Seconds of frames that the ROS 2 thread may fall behind before it goes on with the newest.
const QUEUED_SECONDS: f64 = 0.25;
/// The least and the most frames in that queue.
const QUEUED_FRAMES: (usize, usize) = (4, 256);
/// The memory that queue may take.
const QUEUED_BYTES: usize = 64_000_000;
/// Alerts in their queue; one a second is usual.
const QUEUED_ALERTS: usize = 256;

/// Why there are no ROS 2 topics.
#[derive(Debug, thiserror::Error)]
pub enum Ros2Error {
    /// ROS 2 takes no such name.
    #[error(
        "--name is \"{0}\", which ROS 2 cannot take: expected words of letters, digits and single underscores, not \
         beginning with a digit, joined by slashes"
    )]
    Name(String),
    /// An environment variable cannot be honoured.
    #[error("{0}")]
    Environment(String),
    /// RustDDS or ros2-client refused.
    #[error("ROS 2 could not be started: {0}")]
    Failed(String),
}

/// What is offered on ROS 2.
#[derive(Debug, Clone)]
pub struct Ros2Config {
    /// The namespace of the topics.
    pub name: String,
    /// Handles in a frame.
    pub handles: usize,
    /// Frames per second of the loop.
    pub loop_rate: f64,
    /// What the scene says.
    pub settings: Ros2Settings,
    /// Whether there are alerts.
    pub alerts: bool,
    /// The stage.
    pub stage: Stage,
}

/// One frame on its way to the ROS 2 thread.
struct Snapshot {
    header: FrameHeader,
    handles: Vec<HandlePose>,
}

/// What the two ends tell each other besides the queues.
#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    /// Frames that found the queue full.
    rejected: AtomicU64,
    counts: Counters,
}

/// See [`TransportCounts`].
#[derive(Default)]
struct Counters {
    frames: AtomicU64,
    skipped: AtomicU64,
    discarded: AtomicU64,
}

/// The loop's end.
pub struct Ros2Publisher {
    /// Frames per frame of the loop, at most 1.
    share: f64,
    latest_slot: Option<u64>,
    free: Consumer<Box<Snapshot>>,
    filled: Producer<Box<Snapshot>>,
    alerts: Producer<CollisionAlert>,
    shared: Arc<Shared>,
}

/// The statistics thread's end.
pub struct Ros2Status(mpsc::Sender<LoopStatus>);

/// The ROS 2 thread. Dropping it ends the thread and takes the node off the graph.
pub struct Ros2Thread {
    shared: Arc<Shared>,
    handle: Option<JoinHandle<()>>,
}

/// The ROS 2 thread's ends of the queues.
struct Inbox {
    free: Producer<Box<Snapshot>>,
    filled: Consumer<Box<Snapshot>>,
    alerts: Consumer<CollisionAlert>,
    status: mpsc::Receiver<LoopStatus>,
    shared: Arc<Shared>,
}

/// Starts the ROS 2 thread and returns when its topics exist.
///
/// # Errors
/// [`Ros2Error`]: each says what to change.
pub fn start(config: Ros2Config, network: Network) -> Result<(Ros2Publisher, Ros2Status, Ros2Thread), Ros2Error> {
    check_name(&config.name)?;
    let rate = config.settings.rate_of(config.loop_rate);
    let depth = queue_depth(config.handles, rate);
    // One more than the queue holds is under way: being filled, or being published.
    let (mut free_producer, free) = RingBuffer::new(depth + 2);
    for _ in 0..depth + 2 {
        let snapshot =
            Snapshot { header: FrameHeader::default(), handles: vec![HandlePose::default(); config.handles] };
        // The ring has just as many places.
        let _ = free_producer.push(Box::new(snapshot));
    }
    let (filled, filled_consumer) = RingBuffer::new(depth);
    let (alerts, alerts_consumer) = RingBuffer::new(QUEUED_ALERTS);
    let (status, status_receiver) = mpsc::channel();
    let shared = Arc::new(Shared::default());
    let inbox = Inbox {
        free: free_producer,
        filled: filled_consumer,
        alerts: alerts_consumer,
        status: status_receiver,
        shared: Arc::clone(&shared),
    };
    let (opened, opening) = mpsc::channel();
    let share = rate / config.loop_rate;
    let handle = std::thread::Builder::new()
        .name("ros2".to_owned())
        .spawn(move || node::serve(&config, rate, network, inbox, &opened))
        .map_err(|error| Ros2Error::Failed(error.to_string()))?;
    let thread = Ros2Thread { shared: Arc::clone(&shared), handle: Some(handle) };
    opening.recv().unwrap_or_else(|_| Err(Ros2Error::Failed("its thread ended early".to_owned())))?;
    let publisher = Ros2Publisher { share, latest_slot: None, free, filled, alerts, shared };
    Ok((publisher, Ros2Status(status), thread))
}

fn queue_depth(handles: usize, rate: f64) -> usize {
    let (least, most) = QUEUED_FRAMES;
    let affordable = QUEUED_BYTES / (handles * size_of::<HandlePose>());
    ((rate * QUEUED_SECONDS) as usize).clamp(least, most).min(affordable.max(least))
}

impl Ros2Publisher {
    /// Whether a frame of this tick is one for ROS 2: as many per second as its rate says, spread evenly.
    fn due(&mut self, tick: u64) -> bool {
        // At most 20,000 ticks a second: beyond 2^53 they would have run for 14,000 years.
        let slot = (tick as f64 * self.share) as u64;
        self.latest_slot.replace(slot) != Some(slot)
    }
}

impl Publisher for Ros2Publisher {
    fn publish(&mut self, header: &FrameHeader, frame: &Frame) -> Result<(), PublishError> {
        for alert in &frame.alerts {
            // A thread that is 256 alerts behind has other troubles than this one.
            let _ = self.alerts.push(collision_alert(header, alert));
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
        snapshot.header = FrameHeader { sent_ns: crate::live::clock::monotonic_ns(), ..*header };
        for (handle, pose) in snapshot.handles.iter_mut().enumerate() {
            *pose = handle_pose(&frame.chain, handle);
        }
        let _ = self.filled.push(snapshot);
        Ok(())
    }

    fn maintain(&mut self) {}

    fn subscribers(&self) -> u32 {
        0
    }
}

impl StatusPublisher for Ros2Status {
    fn publish_status(&mut self, status: &LoopStatus) {
        // The thread ends before the statistics do: the last status then has no receiver.
        let _ = self.0.send(*status);
    }
}

impl Ros2Thread {
    /// What it has done so far.
    pub fn counts(&self) -> TransportCounts {
        let Counters { frames, skipped, discarded } = &self.shared.counts;
        let [frames, skipped, discarded] = [frames, skipped, discarded].map(|count| count.load(Ordering::Relaxed));
        TransportCounts { frames, skipped: skipped + self.shared.rejected.load(Ordering::Relaxed), discarded }
    }

    /// Ends the thread once it has published what is queued; the node has then left the graph.
    pub fn end(mut self) -> TransportCounts {
        self.join();
        self.counts()
    }

    fn join(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        if let Some(handle) = self.handle.take() {
            // A panic has been printed by then.
            let _ = handle.join();
        }
    }
}

impl Drop for Ros2Thread {
    fn drop(&mut self) {
        self.join();
    }
}
