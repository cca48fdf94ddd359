//! `run --log`: a transport that writes a file.
//!
//! [`LogPublisher`] is the loop's end. It copies the arrays of a frame into a queue without a lock, an allocation or a
//! system call. A thread puts them in the order of the message, hashes them and writes. While its queue has room, the
//! log skips no frame. Without room it records the frame's tick as lost, after the commands of the frame; without room
//! even for these records, the log ends.

pub mod arithmetic;
pub mod hash;
pub mod lines;
#[cfg(test)]
mod tests;
pub mod verify;
mod writer;

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer, RingBuffer};

use crate::live::{LoopCounts, Outgoing, PublishError, Publisher, TransportCounters};
use crate::transports::{Transport, TransportError};
use bench_dragon_messages::QUEUE_BYTES;
use bench_dragon_messages::control::{Code, Command, CommandRecord};
use bench_dragon_messages::sentence::not_writable;
use hash::{HANDLE_WORDS, HEADER_WORDS, columns, header_words};
use lines::ShowLine;
use writer::LogWriter;

/// The time, in seconds of frames, by which the thread may fall behind before frames are lost.
const QUEUED_SECONDS: f64 = 5.0;
/// Frames that the queue holds at least.
const LEAST_FRAMES: usize = 4;
/// Words that frames leave free for commands and for the ticks of lost frames.
const RESERVED_WORDS: usize = RECORD_WORDS << 16;
/// The most words that are touched beforehand for the next frame: the size of a processor's cache.
const MOST_PREPARED: usize = 1 << 15;
/// The interval at which the thread empties the queue.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// The longest wait for the last lines: a file on a dead network drive never accepts them.
const LONGEST_END: Duration = Duration::from_secs(10);

/// Words of a record, and words of a frame before its columns: kind, tick, handles, header.
const RECORD_WORDS: usize = 5;
const FRAME_WORDS: usize = 3 + HEADER_WORDS;

/// The kinds of a record: its first word.
const FRAME: u64 = 0;
const LOST: u64 = 1;
const COMMAND: u64 = 2;
const STEP_FINISHED: u64 = 3;
/// In place of a code: the step has begun.
const NO_CODE: u64 = u64::MAX;
/// In place of a tick: no frame is missing.
const NEVER: u64 = u64::MAX;

/// The state that the ends share besides the queue.
struct LogState {
    stop: AtomicBool,
    /// The first tick for which the queue had no room at all. Nothing is queued from there on.
    missing_from: AtomicU64,
    frames: AtomicU64,
    lost: AtomicU64,
    /// The loop's counts, after its end.
    ended: Mutex<Option<LoopCounts>>,
    failure: Mutex<Option<String>>,
}

/// The loop's end. The queue holds the numbers of a chain, and the bits of integers in place of numbers.
pub struct LogPublisher {
    queue: Producer<f64>,
    reserved: usize,
    /// Words of the latest frame.
    frame_words: usize,
    shared: Arc<LogState>,
}

/// The thread's end.
pub(super) struct LogReader {
    pub queue: Consumer<f64>,
    columns: Vec<f64>,
}

/// The result of a log.
#[derive(Clone)]
pub struct LogOutcome(Arc<LogState>);

/// The log of a run.
struct Log {
    file: PathBuf,
    publisher: Option<LogPublisher>,
    shared: Arc<LogState>,
    thread: JoinHandle<()>,
}

/// Creates the file and starts its thread.
///
/// # Errors
/// [`TransportError::BadInput`] if the file cannot be created, [`TransportError::Failed`] if the thread cannot be
/// started.
pub fn open(file: &Path, show: ShowLine, handles: usize) -> Result<(Box<dyn Transport>, LogOutcome), TransportError> {
    let shown = file.display().to_string();
    let refused = |error: io::Error| TransportError::BadInput(format!("--log: {}", not_writable(&shown, &error)));
    let opened = File::create(file).map_err(refused)?;
    let (publisher, reader) = queue(handles, show.rate);
    let shared = Arc::clone(&publisher.shared);
    let serving = Arc::clone(&shared);
    let thread = move || serve(reader, LogWriter::new(opened, show), &serving, &shown);
    let thread = std::thread::Builder::new().name("log".to_owned()).spawn(thread);
    let thread = thread.map_err(|error| TransportError::Failed(format!("the log's thread: {error}")))?;
    let outcome = LogOutcome(Arc::clone(&shared));
    Ok((Box::new(Log { file: file.to_owned(), publisher: Some(publisher), shared, thread }), outcome))
}

impl LogOutcome {
    /// Sets the loop's counts, for the log's last line. Must be called before the transports are finished.
    pub fn ended(&self, counts: LoopCounts) {
        *self.0.ended.lock().unwrap_or_else(PoisonError::into_inner) = Some(counts);
    }

    /// Returns the reason why the log is incomplete, in one sentence; `None` for a complete log.
    pub fn failure(&self) -> Option<String> {
        self.0.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Creates the queue for frames of `handles` handles. All of its memory is touched.
pub(super) fn queue(handles: usize, rate: f64) -> (LogPublisher, LogReader) {
    let frame = words_of(handles);
    let affordable = QUEUE_BYTES / (frame * size_of::<f64>());
    let frames = ((rate * QUEUED_SECONDS) as usize).min(affordable).max(LEAST_FRAMES);
    queue_of(frames * frame, RESERVED_WORDS)
}

/// Creates a queue with room for `words` words of frames and `reserved` further words.
pub(super) fn queue_of(words: usize, reserved: usize) -> (LogPublisher, LogReader) {
    let (mut queue, mut consumer) = RingBuffer::new(words + reserved);
    // Touches each page, so that the loop's thread has no page fault.
    while queue.push(0.0).is_ok() {}
    while consumer.pop().is_ok() {}
    let shared = Arc::new(LogState {
        stop: AtomicBool::new(false),
        missing_from: AtomicU64::new(NEVER),
        frames: AtomicU64::new(0),
        lost: AtomicU64::new(0),
        ended: Mutex::new(None),
        failure: Mutex::new(None),
    });
    let reader = LogReader { queue: consumer, columns: Vec::new() };
    (LogPublisher { queue, reserved, frame_words: 0, shared }, reader)
}

/// Returns the words of a frame.
fn words_of(handles: usize) -> usize {
    FRAME_WORDS + HANDLE_WORDS * handles
}

impl LogPublisher {
    /// Pushes words. The caller has checked that there is room.
    pub(super) fn push(&mut self, words: &[f64]) {
        let pushed = self.queue.push_entire_slice(words);
        debug_assert!(pushed.is_ok(), "{pushed:?}");
    }

    fn push_record(&mut self, record: [u64; RECORD_WORDS]) {
        self.push(&record.map(f64::from_bits));
    }
}

impl Publisher for LogPublisher {
    fn publish(&mut self, outgoing: Outgoing<'_>) -> Result<(), PublishError> {
        // Alerts, cues and counts follow from the scene and the commands.
        let Outgoing { header, chain, alerts: _, cues: _, commands, counts: _ } = outgoing;
        let tick = header.tick;
        if self.shared.missing_from.load(Ordering::Relaxed) != NEVER {
            return Ok(());
        }
        let handles = chain.handles();
        self.frame_words = words_of(handles);
        let (room, of_commands) = (self.queue.slots(), commands.len() * RECORD_WORDS);
        if room < of_commands + RECORD_WORDS {
            self.shared.missing_from.store(tick, Ordering::Release);
            return Ok(());
        }
        for record in commands {
            let code = |code: Code| code as u64;
            self.push_record(match *record {
                CommandRecord::Given { command, code: answered } => {
                    let (number, value) = command.number_and_value();
                    [COMMAND, tick, u64::from(number), value.to_bits(), answered.map_or(NO_CODE, code)]
                }
                CommandRecord::StepFinished { code: answered } => [STEP_FINISHED, tick, code(answered), 0, 0],
            });
        }
        if room < of_commands + self.frame_words + self.reserved {
            self.push_record([LOST, tick, 0, 0, 0]);
            return Ok(());
        }
        let mut words = [FRAME, tick, handles as u64, 0, 0, 0, 0, 0, 0, 0, 0];
        words[FRAME_WORDS - HEADER_WORDS..].copy_from_slice(&header_words(header));
        self.push(&words.map(f64::from_bits));
        columns(chain).iter().for_each(|column| self.push(column));
        Ok(())
    }

    /// Writes zeros to the memory of the next frame. The log's thread has read that memory on another processor; now it
    /// is in this processor's cache.
    fn prepare(&mut self) {
        drop(self.queue.write_chunk(self.frame_words.min(MOST_PREPARED)));
    }

    fn maintain(&mut self) {}

    fn subscribers(&self) -> u32 {
        0
    }
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

    fn finish(self: Box<Self>) -> Option<(&'static str, TransportCounters)> {
        self.shared.stop.store(true, Ordering::Release);
        let began = Instant::now();
        while !self.thread.is_finished() && began.elapsed() < LONGEST_END {
            std::thread::sleep(Duration::from_millis(1));
        }
        if !self.thread.is_finished() {
            let sentence =
                format!("--log: {}: the file accepts no more data, the log is incomplete", self.file.display());
            fail(&self.shared, sentence);
        }
        let [frames, skipped] = [&self.shared.frames, &self.shared.lost].map(|count| count.load(Ordering::Acquire));
        Some(("log", TransportCounters { frames, skipped, discarded: 0 }))
    }
}

/// Keeps the first failure.
fn fail(shared: &LogState, sentence: String) {
    shared.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(sentence);
}

/// Writes the contents of the queue until the run is over.
fn serve(mut reader: LogReader, mut writer: LogWriter<impl io::Write>, shared: &LogState, file: &str) {
    loop {
        // `stop` and `missing_from` are read before the queue is emptied: everything queued before they were set is
        // written.
        let ending = shared.stop.load(Ordering::Acquire);
        let missing_from = shared.missing_from.load(Ordering::Acquire);
        reader.empty(&mut writer);
        if missing_from != NEVER {
            writer.stopped(missing_from);
            let sentence = format!("--log: {file}: the log was too far behind at tick {missing_from} and ends there");
            log::error!("{sentence}; the show continues");
            fail(shared, sentence);
        } else if ending {
            match *shared.ended.lock().unwrap_or_else(PoisonError::into_inner) {
                Some(counts) => writer.end(&counts),
                None => writer.break_off(),
            }
        }
        let counts = writer.counts();
        if let Some(error) = writer.take_failure() {
            let sentence = format!("--log: {file}: {error}: the log is incomplete");
            log::error!("{sentence}; the show continues");
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

impl LogReader {
    /// Writes the contents of the queue.
    fn empty(&mut self, writer: &mut LogWriter<impl io::Write>) {
        // The first words of the queue are a whole record, or the beginning of a frame, which is longer.
        while let Ok(record) = self.queue.read_chunk(RECORD_WORDS) {
            let mut words = [0; RECORD_WORDS];
            let (first, second) = record.as_slices();
            words.iter_mut().zip(first.iter().chain(second)).for_each(|(word, number)| *word = number.to_bits());
            let [kind, tick, third, fourth, fifth] = words;
            if kind == FRAME {
                if !self.frame(third as usize, writer) {
                    return;
                }
                continue;
            }
            record.commit_all();
            let code = |number: u64| u32::try_from(number).ok().and_then(Code::of_number);
            match kind {
                LOST => writer.lost(tick),
                STEP_FINISHED => code(third).into_iter().for_each(|code| {
                    writer.command(tick, CommandRecord::StepFinished { code });
                }),
                // A command of the loop has a known number and a valid value: no record is dropped here.
                _ => Command::of_number(third as u32, f64::from_bits(fourth)).into_iter().for_each(|command| {
                    writer.command(tick, CommandRecord::Given { command, code: code(fifth) });
                }),
            }
        }
    }

    /// Writes a frame of `handles` handles. Returns false if the loop has not pushed all of it yet.
    fn frame(&mut self, handles: usize, writer: &mut LogWriter<impl io::Write>) -> bool {
        if self.queue.slots() < words_of(handles) {
            return false;
        }
        let mut words = [0.0; FRAME_WORDS];
        self.columns.resize(HANDLE_WORDS * handles, 0.0);
        // The check above ensures that there are enough.
        let _ = self.queue.pop_entire_slice(&mut words);
        let _ = self.queue.pop_entire_slice(&mut self.columns);
        let header: [u64; HEADER_WORDS] = std::array::from_fn(|k| words[FRAME_WORDS - HEADER_WORDS + k].to_bits());
        writer.frame(&header, std::array::from_fn(|k| &self.columns[k * handles..(k + 1) * handles]));
        true
    }
}
