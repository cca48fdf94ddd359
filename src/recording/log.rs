//! `run --log`: a transport whose receiver is a file.
//!
//! [`LogPublisher`] is the loop's end: it copies what a frame holds into a queue and returns, without a lock, an allocation
//! or a system call. A thread hashes and writes. Unlike `transports::background` it leaves no frame out while there is
//! room for it; where there is none, the frame's tick is still recorded, as that of a lost frame.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer, RingBuffer};

use super::hash::{HEADER_SLOTS, Slot, header_slots, pose_slot};
use super::lines::ShowLine;
use super::writer::LogWriter;
use crate::live::{Deliveries, Outgoing, PublishError, Publisher, StatusPublisher};
use crate::show::control::{Code, Command, CommandRecord};
use crate::transports::{Transport, TransportError};
use crate::wire::LoopStatus;
use crate::wire::convert::handle_poses;

/// Seconds of frames that the thread may fall behind before frames are lost, and the memory that these may take.
const QUEUED_SECONDS: f64 = 5.0;
const QUEUED_BYTES: usize = 64_000_000;
/// Frames that the queue holds at least.
const LEAST_FRAMES: usize = 4;
/// Slots that frames leave free: for commands, and for the ticks of lost frames.
const RESERVED_SLOTS: usize = 1 << 16;
/// How often the thread empties the queue.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// How long the file is given to take the last lines: one on a dead network drive never does.
const LONGEST_END: Duration = Duration::from_secs(10);

/// What a record in the queue is: the first word of its first slot.
const FRAME: u64 = 0;
const LOST: u64 = 1;
const COMMAND: u64 = 2;
const STEP_FINISHED: u64 = 3;
/// In place of a code: the step has begun.
const NO_CODE: u64 = u64::MAX;
/// In place of a tick: nothing is missing.
const NEVER: u64 = u64::MAX;

/// What the ends share besides the queue.
struct Shared {
    stop: AtomicBool,
    /// The first tick of which the queue took nothing, from which on it gets nothing.
    missing_from: AtomicU64,
    frames: AtomicU64,
    lost: AtomicU64,
    failure: Mutex<Option<String>>,
}

/// The loop's end.
pub struct LogPublisher {
    queue: Producer<Slot>,
    reserved: usize,
    shared: Arc<Shared>,
}

/// How a log fared, once its run is over.
#[derive(Clone)]
pub struct LogOutcome(Arc<Shared>);

/// The log of a run.
struct Log {
    file: PathBuf,
    publisher: Option<LogPublisher>,
    shared: Arc<Shared>,
    thread: JoinHandle<()>,
}

/// The status is no part of a log.
struct NoStatus;

/// Makes the file and starts its thread.
///
/// # Errors
/// [`TransportError::BadInput`] where the file cannot be made, [`TransportError::Failed`] where there is no thread.
pub fn open(file: &Path, show: ShowLine, handles: usize) -> Result<(Box<dyn Transport>, LogOutcome), TransportError> {
    let shown = file.display().to_string();
    let refused = |error| TransportError::BadInput(format!("--log: {shown}: {error}, expected a file to write"));
    let opened = File::create(file).map_err(refused)?;
    let (publisher, queue) = queue(handles, show.rate);
    let shared = Arc::clone(&publisher.shared);
    let serving = Arc::clone(&shared);
    let thread = move || serve(queue, LogWriter::new(opened, show), &serving, &shown);
    let thread = std::thread::Builder::new().name("log".to_owned()).spawn(thread);
    let thread = thread.map_err(|error| TransportError::Failed(format!("the log's thread: {error}")))?;
    let outcome = LogOutcome(Arc::clone(&shared));
    Ok((Box::new(Log { file: file.to_owned(), publisher: Some(publisher), shared, thread }), outcome))
}

impl LogOutcome {
    /// Why the log is not whole, in one sentence; `None` where it is.
    pub fn failure(&self) -> Option<String> {
        self.0.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// The queue for frames of so many handles, all of its memory in place.
pub(super) fn queue(handles: usize, rate: f64) -> (LogPublisher, Consumer<Slot>) {
    let frame = handles + HEADER_SLOTS;
    let affordable = QUEUED_BYTES / (frame * size_of::<Slot>());
    let frames = ((rate * QUEUED_SECONDS) as usize).min(affordable).max(LEAST_FRAMES);
    queue_of(frames * frame, RESERVED_SLOTS)
}

/// The queue with room for so many slots of frames, and for so many besides.
pub(super) fn queue_of(slots: usize, reserved: usize) -> (LogPublisher, Consumer<Slot>) {
    let (mut queue, mut consumer) = RingBuffer::new(slots + reserved);
    // The loop's thread is not to be the first that touches a page.
    while queue.push(Slot::default()).is_ok() {}
    while consumer.pop().is_ok() {}
    let shared = Arc::new(Shared {
        stop: AtomicBool::new(false),
        missing_from: AtomicU64::new(NEVER),
        frames: AtomicU64::new(0),
        lost: AtomicU64::new(0),
        failure: Mutex::new(None),
    });
    (LogPublisher { queue, reserved, shared }, consumer)
}

impl LogPublisher {
    /// Pushes a record of one slot.
    fn push(&mut self, tick: u64, record: Slot) {
        if self.queue.push(record).is_err() {
            self.shared.missing_from.store(tick, Ordering::Release);
        }
    }

    /// Whether a frame of so many handles has room.
    pub(super) fn has_room(&self, handles: usize) -> bool {
        self.queue.slots() >= handles + HEADER_SLOTS + self.reserved
    }
}

impl Publisher for LogPublisher {
    fn publish(&mut self, outgoing: Outgoing<'_>) -> Result<(), PublishError> {
        let Outgoing { header, frame, .. } = outgoing;
        let tick = header.tick;
        if self.shared.missing_from.load(Ordering::Relaxed) != NEVER {
            return Ok(());
        }
        for record in &frame.commands {
            let code = |code: Code| code as u64;
            self.push(
                tick,
                match *record {
                    CommandRecord::Given { command, code: answered } => {
                        let (number, value) = command.number_and_value();
                        [COMMAND, tick, u64::from(number), value.to_bits(), answered.map_or(NO_CODE, code)]
                    }
                    CommandRecord::StepFinished { code: answered } => [STEP_FINISHED, tick, code(answered), 0, 0],
                },
            );
        }
        let handles = frame.chain.handles();
        let room =
            if self.has_room(handles) { self.queue.write_chunk_uninit(handles + HEADER_SLOTS).ok() } else { None };
        match room {
            Some(chunk) => {
                let header = header_slots(header, [FRAME, handles as u64]);
                chunk.fill_from_iter(header.into_iter().chain(handle_poses(&frame.chain).map(pose_slot)));
            }
            None => self.push(tick, [LOST, tick, 0, 0, 0]),
        }
        Ok(())
    }

    fn maintain(&mut self) {}

    fn subscribers(&self) -> u32 {
        0
    }
}

impl StatusPublisher for NoStatus {
    fn publish_status(&mut self, _: &LoopStatus) {}
}

impl Transport for Log {
    fn describe(&self) -> String {
        format!("Log of commands and of a hash a second: {}", self.file.display())
    }

    fn publisher(&mut self) -> Result<Box<dyn Publisher>, TransportError> {
        match self.publisher.take() {
            Some(publisher) => Ok(Box::new(publisher)),
            None => Err(TransportError::Failed("the log's publisher is taken".to_owned())),
        }
    }

    fn status(&mut self) -> Result<Box<dyn StatusPublisher>, TransportError> {
        Ok(Box::new(NoStatus))
    }

    fn finish(self: Box<Self>) -> Option<(&'static str, Deliveries)> {
        self.shared.stop.store(true, Ordering::Release);
        let began = Instant::now();
        while !self.thread.is_finished() && began.elapsed() < LONGEST_END {
            std::thread::sleep(Duration::from_millis(1));
        }
        if !self.thread.is_finished() {
            let sentence = format!("--log: {}: it takes no more, the log is cut", self.file.display());
            fail(&self.shared, sentence);
        }
        let [frames, skipped] = [&self.shared.frames, &self.shared.lost].map(|count| count.load(Ordering::Acquire));
        Some(("log", Deliveries { frames, skipped, discarded: 0 }))
    }
}

/// Keeps the first failure.
fn fail(shared: &Shared, sentence: String) {
    shared.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(sentence);
}

/// Writes what the queue brings until the run is over.
fn serve(mut queue: Consumer<Slot>, mut writer: LogWriter<impl io::Write>, shared: &Shared, file: &str) {
    loop {
        // Read before the queue is emptied: what was put there before it was set is then still written.
        let ending = shared.stop.load(Ordering::Acquire);
        let missing_from = shared.missing_from.load(Ordering::Acquire);
        empty(&mut queue, &mut writer);
        let counts = writer.counts();
        if missing_from != NEVER {
            writer.stopped(missing_from);
            let sentence = format!("--log: {file}: the log was too far behind at tick {missing_from} and ends there");
            log::error!("{sentence}; the show goes on");
            fail(shared, sentence);
        } else if ending {
            writer.end();
        }
        if let Some(error) = writer.take_failure() {
            let sentence = format!("--log: {file}: {error}: the log is cut");
            log::error!("{sentence}; the show goes on");
            fail(shared, sentence);
        }
        shared.frames.store(counts.frames, Ordering::Release);
        shared.lost.store(counts.lost, Ordering::Release);
        if ending || missing_from != NEVER {
            return;
        }
        std::thread::sleep(POLL_INTERVAL);
    }
}

/// Writes all that is in the queue.
pub(super) fn empty(queue: &mut Consumer<Slot>, writer: &mut LogWriter<impl io::Write>) {
    while let Ok(&[kind, tick, third, fourth, fifth]) = queue.peek() {
        if kind == FRAME {
            // The loop's end hands over whole records only.
            let Ok(header) = queue.read_chunk(HEADER_SLOTS) else { return };
            let (first, second) = header.as_slices();
            let mut slots = first.iter().chain(second).copied();
            let header_of_frame = [slots.next().unwrap_or_default(), slots.next().unwrap_or_default()];
            let handles = header_of_frame[1][4] as usize;
            header.commit_all();
            let Ok(poses) = queue.read_chunk(handles) else { return };
            let (first, second) = poses.as_slices();
            writer.frame(&header_of_frame, [first, second]);
            poses.commit_all();
            continue;
        }
        let code = |number: u64| Code::ALL.get(number as usize).copied();
        match kind {
            LOST => writer.lost(tick),
            STEP_FINISHED => code(third).into_iter().for_each(|code| {
                writer.command(tick, CommandRecord::StepFinished { code });
            }),
            // Numbers that this end has written are numbers of commands; only a value can be out of range.
            _ => Command::of_number(third as u32, f64::from_bits(fourth)).into_iter().for_each(|command| {
                writer.command(tick, CommandRecord::Given { command, code: code(fifth) });
            }),
        }
        let _ = queue.pop();
    }
}
