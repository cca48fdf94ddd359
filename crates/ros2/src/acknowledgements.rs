//! Acknowledgement of old messages in the name of subscribers that do not acknowledge.
//!
//! A writer of RustDDS 0.15.1 keeps all messages that one of its subscribers has not acknowledged, up to its limit. A
//! best-effort subscriber acknowledges nothing. A killed reliable subscriber acknowledges nothing until its lease ends.
//! RustDDS waits for both (`Writer::remove_all_acked_changes_but_keep_depth`), without end. So this file sends the
//! writer, in our own process, an ACKNACK submessage (RTPS 2.5, section 9.4.5.2). For a best-effort subscriber the
//! ACKNACK acknowledges all messages. For a reliable subscriber it acknowledges the messages that are older than
//! [`AGE`] and not among the last `depth`. A reliable subscriber gets a GAP for these messages. RustDDS ignores the
//! ACKNACK if the subscriber has acknowledged more.

use std::collections::{BTreeMap, VecDeque};
use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};

use rustdds::{DomainParticipant, GUID};

use super::matching::{Matches, Requests};
use super::retransmission::{LITTLE_ENDIAN, addressed, send, submessage};

/// The age from which messages are acknowledged. A new subscriber takes milliseconds, on a busy machine a second.
const AGE: Duration = Duration::from_secs(2);
/// The interval of the acknowledgements of a writer. RustDDS removes old messages every six seconds.
const INTERVAL: Duration = Duration::from_millis(500);
/// The interval at which the subscribers are read.
const READ_INTERVAL: Duration = Duration::from_millis(50);
/// The kind of the submessage, and the flag that no heartbeat is requested.
const ACKNACK: u8 = 0x06;
const FINAL: u8 = 2;
/// The first counter: RustDDS ignores an ACKNACK that has the counter of the one before, and subscribers count from 1.
const FIRST_COUNTER: u32 = 1 << 30;

/// The acknowledgements of one writer.
#[derive(Default)]
pub(super) struct Acknowledgements {
    /// The last messages that a subscriber may request.
    depth: u64,
    /// Messages of the writer until now.
    written: u64,
    /// Some of the last states, the oldest first.
    states: VecDeque<WriterState>,
    /// The current subscribers.
    known: BTreeMap<GUID, Requests>,
    /// The time at which they were read.
    read_at: Option<Instant>,
    /// Datagrams that have been sent.
    sent: u32,
}

/// The state of a writer at one time.
struct WriterState {
    at: Instant,
    /// Messages until then.
    written: u64,
    /// The reliable subscribers.
    readers: Vec<GUID>,
}

impl Acknowledgements {
    /// Creates the acknowledgements of a writer whose history has `depth` messages.
    pub(super) fn new(depth: u64) -> Self {
        Self { depth, ..Self::default() }
    }

    /// Begins again, for a new writer.
    pub(super) fn restart(&mut self) {
        *self = Self::new(self.depth);
    }

    /// Counts a message of the writer.
    pub(super) fn count(&mut self) {
        self.written += 1;
    }

    /// Acknowledges what is due.
    pub(super) fn serve(&mut self, matches: &Matches, writer: GUID, now: Instant) {
        if self.read_at.is_some_and(|read_at| now.duration_since(read_at) < READ_INTERVAL) {
            return;
        }
        self.read_at = Some(now);
        let before = std::mem::replace(&mut self.known, matches.subscribers(writer));
        let is_due = self.states.back().is_none_or(|last| now.duration_since(last.at) >= INTERVAL);
        let (reliable, best_effort): (Vec<_>, Vec<_>) = self.known.iter().partition(|(_, requests)| requests.reliable);
        let best_effort = best_effort.into_iter().filter(|(reader, _)| is_due || !before.contains_key(reader));
        let mut due: Vec<(GUID, u64)> = best_effort.map(|(reader, _)| (*reader, self.written)).collect();
        if is_due {
            let readers = reliable.into_iter().map(|(reader, _)| *reader).collect();
            self.states.push_back(WriterState { at: now, written: self.written, readers });
            while let Some(old) = self.states.pop_front_if(|first| now.duration_since(first.at) >= AGE) {
                let readers = old.readers.into_iter().filter(|reader| self.known.contains_key(reader));
                let written = old.written.min(self.written.saturating_sub(self.depth));
                due.extend(readers.map(|reader| (reader, written)));
            }
        }
        for (reader, written) in due {
            self.sent = self.sent.wrapping_add(1);
            matches.acknowledge(&datagram(reader.to_bytes(), writer.to_bytes(), written, self.sent));
            if self.known[&reader].reliable {
                matches.send_gap(writer, reader, written);
            }
        }
    }
}

/// Sends a datagram to the participant itself.
pub(super) fn send_to_own(participant: &DomainParticipant, datagram: &[u8]) {
    // The port for unicast user traffic (RTPS 2.5, section 9.6.2.3). If another program has it, RustDDS keeps messages
    // up to its limit.
    let port = 7411 + 250 * u32::from(participant.domain_id()) + 2 * u32::from(participant.participant_id());
    if let Ok(port) = u16::try_from(port) {
        send(datagram, std::iter::once(SocketAddr::from((Ipv4Addr::LOCALHOST, port))));
    }
}

/// Returns the message of `reader` to `writer`: the reader has the first `last` messages and requests none.
fn datagram(reader: [u8; 16], writer: [u8; 16], last: u64, number: u32) -> Vec<u8> {
    let (mut bytes, ends) = addressed(reader, writer);
    let first_missing = last + 1;
    // The first missing message (high, low), an empty set from there on, and the counter.
    let words = [(first_missing >> 32) as u32, first_missing as u32, 0, FIRST_COUNTER.wrapping_add(number)];
    bytes.extend(submessage(ACKNACK, LITTLE_ENDIAN | FINAL, ends, &words));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes as RTPS 2.5 lays them out, written down by hand.
    #[test]
    fn the_datagram_is_that_of_the_standard() {
        let reader = [1, 16, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 0, 0, 22, 4];
        let writer = [1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 21, 3];
        #[rustfmt::skip]
        let expected = [
            b'R', b'T', b'P', b'S', 2, 4, 1, 18, 1, 16, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42,
            0x0e, 1, 12, 0, 1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12,
            0x06, 3, 24, 0, 0, 0, 22, 4, 0, 0, 21, 3, 1, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 64,
        ];
        assert_eq!(datagram(reader, writer, (1 << 32) + 7, 3), expected);
    }
}
