//! Second copies of large messages, for readers of Fast DDS on this machine.
//!
//! RustDDS 0.15.1 sends a message in a burst of datagrams of up to 65 kB (`FragmentationIter`, `rtps/writer.rs:2304`).
//! A socket of Fast DDS has room for 212,992 bytes, the default of Linux, so for three of them. What does not fit is
//! lost, and RustDDS repairs eight fragments of 256 bytes each 10 ms (`Writer::handle_repair_frags_send_worker`,
//! `rtps/writer.rs:1580`): of 5,000 benches a reader got a third of all messages. So the fragments of such a message
//! come again here, in datagrams at intervals, within the period of the messages. A reader takes only what is missing.
//! Held by `a_reliable_subscriber_gets_the_messages_of_a_large_team`.
//!
//! In: a message as RustDDS has numbered it. Out: datagrams, sent by a thread. A message that comes before the
//! datagrams of the one before are sent replaces them.

use std::net::SocketAddr;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustdds::GUID;

use super::wire::{self, FRAGMENT_BYTES};

/// The bytes of a message up to which its burst fits into a socket: those of two datagrams.
const BURST_BYTES: usize = 130_000;
/// The fragments of a datagram: 64,000 bytes, nearly the most of UDP.
const FRAGMENTS: usize = 250;
/// The time after a message until its copy begins: RustDDS has sent its burst then, and readers have taken it.
const DELAY: Duration = Duration::from_millis(3);
/// The interval of the datagrams.
const INTERVAL: Duration = Duration::from_millis(1);
/// Messages that wait for the thread. A later one is not copied.
const QUEUE: usize = 4;

/// A message with its readers.
struct Message {
    written: Instant,
    writer: GUID,
    sequence: u64,
    payload: Vec<u8>,
    readers: Vec<(GUID, SocketAddr)>,
}

/// The copies of one topic. Dropping this value ends its thread.
pub(super) struct Copies {
    queue: Option<SyncSender<Message>>,
    thread: Option<JoinHandle<()>>,
}

impl Copies {
    /// Begins the copies of a topic, if its messages of this many `bytes` need any. Without a thread there are none.
    pub(super) fn of(bytes: usize) -> Option<Self> {
        if bytes <= BURST_BYTES {
            return None;
        }
        let (queue, messages) = mpsc::sync_channel(QUEUE);
        let thread = std::thread::Builder::new().name("ros2 copies".to_owned()).spawn(move || send_all(&messages));
        let thread = thread.inspect_err(|error| log::warn!("ROS 2: large messages may be lost: {error}")).ok()?;
        Some(Self { queue: Some(queue), thread: Some(thread) })
    }

    /// Copies the message `sequence` of `writer`, a payload in CDR without its header, to these readers.
    pub(super) fn send(&self, writer: GUID, sequence: u64, payload: Vec<u8>, readers: Vec<(GUID, SocketAddr)>) {
        let message = Message { written: Instant::now(), writer, sequence, payload, readers };
        // A full queue: the thread is behind, and the message is too old soon.
        let _ = self.queue.as_ref().map(|queue| queue.try_send(message));
    }
}

impl Drop for Copies {
    fn drop(&mut self) {
        self.queue = None;
        // The thread has printed its panic.
        self.thread.take().into_iter().for_each(|thread| drop(thread.join()));
    }
}

fn send_all(messages: &Receiver<Message>) {
    let mut next = messages.recv().ok();
    while let Some(message) = next.take() {
        next = match send_one(&message, messages) {
            Some(newer) => Some(newer),
            None => messages.recv().ok(),
        };
    }
}

/// Sends the datagrams of a message. Returns the newer message that ended this early.
fn send_one(message: &Message, messages: &Receiver<Message>) -> Option<Message> {
    let Message { written, writer, sequence, payload, readers } = message;
    let parts = payload.len().div_ceil(FRAGMENTS * FRAGMENT_BYTES);
    for part in 0..parts {
        let due = *written + DELAY + INTERVAL * part as u32;
        match messages.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok(newer) => return Some(newer),
            Err(RecvTimeoutError::Timeout) => (),
            Err(RecvTimeoutError::Disconnected) => return None,
        }
        for (reader, address) in readers {
            let first = part * FRAGMENTS;
            wire::send(&wire::fragments(*writer, *reader, *sequence, payload, first..first + FRAGMENTS), [*address]);
        }
    }
    None
}
