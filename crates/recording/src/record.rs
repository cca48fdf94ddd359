//! A subscriber that records: from the feed through a queue to a thread that compresses and writes.
//!
//! The feed's end copies each frame, so that a slow disk does not delay it. If the thread is 64 MB behind, the feed's
//! end waits with the next frame. Frames then stay in the shared memory until the oldest are overwritten, which is a
//! gap in the recording. The publisher and this process's memory are not affected. Event-driven messages are small and
//! never wait. The thread holds the first frames of a run until the scene has come, which has the clock of their stamps.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::mcap::recorder::{RecordError, Recorded, Recorder};
use bench_dragon_client::feed::FeedEvent;
use bench_dragon_messages::{
    CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, QUEUE_BYTES, Stage, StageMessage,
};

/// The interval of the thread's periodic work.
const MAINTAIN_INTERVAL: Duration = Duration::from_millis(50);
/// The interval at which the feed's end polls for room.
const ROOM_INTERVAL: Duration = Duration::from_millis(1);
/// The longest wait for the scene of a run. A publisher detects a new subscriber within a second, unless a busy machine
/// stops it. Only other programs publish without a scene.
const SCENE_TIMEOUT: Duration = Duration::from_secs(10);
/// Seconds after which a disk that accepts nothing is given up at the end. A slow disk needs seconds for its buffers.
const STUCK_SECONDS: u64 = 30;
/// The interval at which the end of a recording polls the thread.
const FINISH_INTERVAL: Duration = Duration::from_millis(10);

/// An item of the queue.
enum Item {
    Frame { header: FrameHeader, handles: Vec<HandlePose>, missed: u64 },
    Stage(Box<StageMessage>),
    Scene { run_id: u64, text: String },
    Alert(CollisionAlert),
    Cue(Cue),
    Status(Box<LoopStatus>),
    Gone,
}

/// The state that both ends share.
#[derive(Default)]
struct RecordState {
    queued_bytes: AtomicUsize,
    ended: AtomicBool,
    recorded: Mutex<Recorded>,
}

/// The feed's end.
pub struct RecordQueue {
    items: Sender<Item>,
    /// The memory of written frames, for reuse.
    free: Receiver<Vec<HandlePose>>,
    shared: Arc<RecordState>,
}

/// The thread.
pub struct RecordThread {
    shared: Arc<RecordState>,
    handle: JoinHandle<(Recorded, Option<RecordError>)>,
}

/// The reason for an incomplete recording, in one sentence.
#[derive(Debug, thiserror::Error)]
pub enum UnfinishedError {
    /// A write failed.
    #[error(transparent)]
    Record(RecordError),
    /// The disk neither accepts nor refuses the data.
    #[error(
        "nothing could be written for {STUCK_SECONDS} s: the recording ends there, a file without an end is mended by \
         record --recover"
    )]
    Stuck,
}

/// Starts the thread of a recorder.
///
/// # Errors
/// The system refuses a thread.
pub fn start(recorder: Recorder) -> std::io::Result<(RecordQueue, RecordThread)> {
    let (items, inbox) = channel();
    let (used, free) = channel();
    let shared = Arc::new(RecordState::default());
    let serving = Arc::clone(&shared);
    let thread = move || {
        let done = serve(recorder, &inbox, &used, &serving);
        serving.ended.store(true, Ordering::Release);
        done
    };
    let handle = std::thread::Builder::new().name("record".to_owned()).spawn(thread)?;
    Ok((RecordQueue { items, free, shared: Arc::clone(&shared) }, RecordThread { shared, handle }))
}

impl RecordQueue {
    /// Queues an event. A frame waits for room until `over` returns true, and is then dropped.
    pub fn handle(&self, event: &FeedEvent<'_>, over: impl Fn() -> bool) {
        let item = match event {
            FeedEvent::Frame { header, handles, missed } => {
                while self.shared.queued_bytes.load(Ordering::Acquire) > QUEUE_BYTES {
                    if over() {
                        return;
                    }
                    std::thread::sleep(ROOM_INTERVAL);
                }
                let mut copy = self.free.try_recv().unwrap_or_default();
                copy.clear();
                copy.extend_from_slice(handles);
                Item::Frame { header: **header, handles: copy, missed: *missed }
            }
            FeedEvent::Stage { stage, segments } => {
                Item::Stage(Box::new(StageMessage { stage: **stage, segments: segments.to_vec() }))
            }
            FeedEvent::Scene { header, text } => Item::Scene { run_id: header.run_id, text: (*text).to_owned() },
            FeedEvent::Alert(alert) => Item::Alert(**alert),
            FeedEvent::Cue(cue) => Item::Cue(**cue),
            FeedEvent::Status(status) => Item::Status(Box::new(**status)),
            FeedEvent::Gone => Item::Gone,
            FeedEvent::Started { .. } | FeedEvent::Chase(_) | FeedEvent::Silent => return,
        };
        self.shared.queued_bytes.fetch_add(bytes(&item), Ordering::AcqRel);
        // After a failure nothing is queued; the error is reported when the thread is joined.
        let _ = self.items.send(item);
    }
}

impl RecordThread {
    /// Returns true if the thread has ended because a write failed.
    pub fn has_ended(&self) -> bool {
        self.shared.ended.load(Ordering::Acquire) || self.handle.is_finished()
    }

    /// Returns the recording so far.
    pub fn recorded(&self) -> Recorded {
        self.shared.recorded.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Ends the thread after it has written the contents of `queue`. Returns the recording, and the reason if it is
    /// incomplete. A thread without progress is abandoned.
    pub fn finish(self, queue: RecordQueue) -> (Recorded, Option<UnfinishedError>) {
        drop(queue);
        let (mut left, mut since) = (usize::MAX, Instant::now());
        while !self.handle.is_finished() {
            let queued = self.shared.queued_bytes.load(Ordering::Acquire);
            if queued != left {
                (left, since) = (queued, Instant::now());
            } else if since.elapsed() >= Duration::from_secs(STUCK_SECONDS) {
                return (self.recorded(), Some(UnfinishedError::Stuck));
            }
            std::thread::sleep(FINISH_INTERVAL);
        }
        let recorded = self.recorded();
        // The thread has printed its panic.
        let (recorded, error) = self.handle.join().unwrap_or((recorded, None));
        (recorded, error.map(UnfinishedError::Record))
    }
}

/// Returns the memory of an item, with its share of the queue.
fn bytes(item: &Item) -> usize {
    match item {
        Item::Frame { handles, .. } => size_of::<Item>() + size_of_val(&handles[..]),
        Item::Scene { text, .. } => size_of::<Item>() + text.len(),
        Item::Stage(message) => size_of::<Item>() + size_of::<Stage>() + size_of_val(&message.segments[..]),
        _ => size_of::<Item>() + size_of::<LoopStatus>(),
    }
}

/// The items of a run whose scene has not come.
#[derive(Default)]
struct Held {
    items: Vec<Item>,
    /// The time of the first one.
    since: Option<Instant>,
    /// The run that waits no longer: its scene has come, or the time is over.
    released: Option<u64>,
}

impl Held {
    /// Adds an item. Returns the items to record now, in their order. `None` is the passing of time; a full queue waits
    /// no longer.
    fn pass(&mut self, item: Option<Item>, is_full: bool) -> Vec<Item> {
        let released = match &item {
            Some(Item::Scene { run_id, .. }) => Some(*run_id),
            Some(Item::Frame { header, .. }) if self.released != Some(header.run_id) => {
                self.since.get_or_insert_with(Instant::now);
                None
            }
            _ => None,
        };
        let is_late = self.since.is_some_and(|since| since.elapsed() > SCENE_TIMEOUT);
        let is_over = is_late || is_full || matches!(item, Some(Item::Gone));
        self.items.extend(item);
        if self.since.is_some() && released.is_none() && !is_over {
            return Vec::new();
        }
        self.since = None;
        let run_of = |item: &Item| match item {
            Item::Frame { header, .. } => Some(header.run_id),
            _ => None,
        };
        self.released = released.or_else(|| self.items.iter().rev().find_map(run_of)).or(self.released);
        std::mem::take(&mut self.items)
    }
}

/// Records the items until the other end of the queue is dropped or a write fails.
fn serve(
    mut recorder: Recorder,
    inbox: &Receiver<Item>,
    used: &Sender<Vec<HandlePose>>,
    shared: &RecordState,
) -> (Recorded, Option<RecordError>) {
    let mut held = Held::default();
    let done = loop {
        let received = inbox.recv_timeout(MAINTAIN_INTERVAL);
        let is_full = shared.queued_bytes.load(Ordering::Acquire) > QUEUE_BYTES / 2;
        let items = match received {
            Ok(item) => held.pass(Some(item), is_full),
            Err(RecvTimeoutError::Timeout) => held.pass(None, is_full),
            Err(RecvTimeoutError::Disconnected) => {
                let mut rest = std::mem::take(&mut held.items).into_iter();
                let done = rest.try_for_each(|item| record(&mut recorder, item, used, shared));
                break done.and_then(|()| recorder.finish());
            }
        };
        // The frames before the scene have the clock of the scene too.
        for item in &items {
            if let Item::Scene { run_id, text } = item {
                recorder.set_clock(*run_id, text);
            }
        }
        let done = items.into_iter().try_for_each(|item| record(&mut recorder, item, used, shared));
        if let Err(error) = done.and_then(|()| recorder.maintain()) {
            break Err(error);
        }
        let (mut shown, recorded) =
            (shared.recorded.lock().unwrap_or_else(PoisonError::into_inner), recorder.recorded());
        shown.counts = recorded.counts;
        if shown.files.len() != recorded.files.len() {
            shown.files.clone_from(&recorded.files);
        }
    };
    (recorder.recorded().clone(), done.err())
}

/// Records an item, and returns the memory of a frame.
fn record(
    recorder: &mut Recorder,
    item: Item,
    used: &Sender<Vec<HandlePose>>,
    shared: &RecordState,
) -> Result<(), RecordError> {
    shared.queued_bytes.fetch_sub(bytes(&item), Ordering::AcqRel);
    match item {
        Item::Frame { header, handles, missed } => {
            let done = recorder.frame(&header, &handles, missed);
            // At the end of the recording the other end is gone.
            let _ = used.send(handles);
            done
        }
        Item::Stage(stage) => recorder.stage(&stage),
        Item::Scene { run_id, text } => recorder.scene(run_id, &text),
        Item::Alert(alert) => recorder.alert(&alert),
        Item::Cue(cue) => recorder.cue(&cue),
        Item::Status(status) => recorder.status(&status),
        Item::Gone => recorder.finish_run(),
    }
}
