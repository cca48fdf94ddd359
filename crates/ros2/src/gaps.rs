//! Old messages that a new subscriber of a transient-local topic must not get.
//!
//! RustDDS offers a new subscriber all messages that it keeps, whatever durability and depth the subscriber has, and
//! has no call to withhold them. So this file sends a GAP submessage (RTPS 2.5, section 9.4.5.6) to the subscriber:
//! these messages are not for it. RustDDS retransmits 5 ms after the subscriber's request. The subscriber accepts a GAP
//! only when it knows the writer, so the datagram is repeated for some time. If all datagrams come too late, the
//! subscriber gets old messages first.

use std::net::SocketAddr;
use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

use rustdds::{DomainParticipant, GUID};

use super::UNACKNOWLEDGED_MESSAGES;
use super::retransmission::{LITTLE_ENDIAN, addressed, reader_addresses, send, submessage};

/// The time for a new subscriber to discover the writer, and the interval of the datagrams.
const PATIENCE: Duration = Duration::from_secs(1);
const INTERVAL: Duration = Duration::from_millis(1);
/// The kind of the submessage.
const GAP: u8 = 0x08;

/// The messages of a writer that a new reader must not get.
pub(super) struct OldMessages {
    reader: GUID,
    datagram: Vec<u8>,
    addresses: Vec<SocketAddr>,
    since: Instant,
    sent: Option<Instant>,
}

impl OldMessages {
    /// Withholds the first `last` messages of `writer` from `reader`.
    pub(super) fn of(participant: &DomainParticipant, writer: GUID, reader: GUID, last: u32) -> Option<Self> {
        let addresses = reader_addresses(participant, reader)?;
        let datagram = datagram(writer.to_bytes(), reader.to_bytes(), 1..=last);
        (last > 0).then(|| Self { reader, datagram, addresses, since: Instant::now(), sent: None })
    }

    /// Returns the reader.
    pub(super) fn reader(&self) -> GUID {
        self.reader
    }

    /// Sends the datagram if it is due. Returns true if it must be sent again.
    pub(super) fn serve(&mut self) -> bool {
        if self.sent.is_some_and(|sent| sent.elapsed() < INTERVAL) {
            return true;
        }
        self.sent = Some(Instant::now());
        send(&self.datagram, self.addresses.iter().copied());
        self.since.elapsed() < PATIENCE
    }
}

/// Sends `reader` a GAP once: the messages of `writer` up to `last` are not for it.
pub(super) fn send_gap(participant: &DomainParticipant, writer: GUID, reader: GUID, last: u64) {
    // A volatile writer is replaced long before its message numbers exceed 32 bits.
    let last = u32::try_from(last).unwrap_or(u32::MAX);
    // Fast DDS goes through all numbers of a GAP, so this GAP names the last ones only. Heartbeats of the writer
    // withhold the earlier messages.
    let first = last.saturating_sub(UNACKNOWLEDGED_MESSAGES).max(1);
    if let Some(addresses) = reader_addresses(participant, reader).filter(|_| last > 0) {
        send(&datagram(writer.to_bytes(), reader.to_bytes(), first..=last), addresses.into_iter());
    }
}

/// Returns the message of `writer` to `reader`: these messages are not for it.
fn datagram(writer: [u8; 16], reader: [u8; 16], numbers: RangeInclusive<u32>) -> Vec<u8> {
    let (mut bytes, [writer, reader]) = addressed(writer, reader);
    let (first, last) = numbers.into_inner();
    // The start (high, low), the end, and a set of one number: the end.
    bytes.extend(submessage(GAP, LITTLE_ENDIAN, [reader, writer], &[0, first, 0, last, 1, 1 << 31]));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes as RTPS 2.5 lays them out, written down by hand.
    #[test]
    fn the_datagram_is_that_of_the_standard() {
        let writer = [1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 21, 3];
        let reader = [1, 15, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 0, 0, 22, 4];
        #[rustfmt::skip]
        let expected = [
            b'R', b'T', b'P', b'S', 2, 4, 1, 18, 1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12,
            0x0e, 1, 12, 0, 1, 15, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42,
            0x08, 1, 32, 0, 0, 0, 22, 4, 0, 0, 21, 3, 0, 0, 0, 0, 1, 0, 0, 0,
            0, 0, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 128,
        ];
        assert_eq!(datagram(writer, reader, 1..=7), expected);
    }
}
