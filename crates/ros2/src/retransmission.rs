//! Retransmission of requests that Fast DDS clients sent before RustDDS had matched them.
//!
//! A Fast DDS client matches a service at once and sends its first request within a millisecond. RustDDS drops the
//! request if its discovery thread has not matched the client's writer by then. RustDDS then sends an ACKNACK without
//! requests, which Fast DDS answers after its heartbeat period of 3 s. RustDDS has no call for anything else. So this
//! file sends datagrams after each match: a NACK_FRAG submessage (RTPS 2.5, section 9.4.5.14) for each of the first
//! messages of the writer.
//!
//! This workaround is needed until RustDDS offers retransmission requests. Without it half of all first calls take 3 s,
//! and a `hold` must not. The workaround is harmless: a writer retransmits the messages that it has and that are not
//! acknowledged. RustDDS drops a message that comes twice. NACK_FRAG and the ACKNACKs of RustDDS have separate
//! counters. If the workaround fails, the request comes after the heartbeat period of Fast DDS.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use rustdds::{DomainParticipant, GUID};

/// The first two bytes of the GUIDs of Fast DDS: its vendor id (RTPS 2.5, sections 9.3.1.5 and 9.4.4).
const FAST_DDS: [u8; 2] = [1, 15];
/// The vendor id of RustDDS.
const RUSTDDS: [u8; 2] = [1, 18];
/// The protocol version of RustDDS.
const VERSION: [u8; 2] = [2, 4];
/// The prefix of the topics of requests.
const REQUEST_PREFIX: &str = "rq/";
/// The messages requested from a new writer: as many calls as clients make before the first answer.
const FIRST_MESSAGES: u32 = 4;
/// Kinds of submessages.
const INFO_DST: u8 = 0x0e;
const NACK_FRAG: u8 = 0x12;
/// The flag of a submessage in little endian.
pub(super) const LITTLE_ENDIAN: u8 = 1;

/// The times after a match at which the messages are requested. The first one usually suffices; a datagram can be lost,
/// and discovery can report the writer's address late.
const TIMES: [Duration; 4] =
    [Duration::ZERO, Duration::from_millis(50), Duration::from_millis(250), Duration::from_millis(1000)];

/// A request for the first messages of a Fast DDS writer.
pub(super) struct FirstMessages {
    reader: GUID,
    writer: GUID,
    matched: Instant,
    /// The number of [`TIMES`] that are over.
    rounds: usize,
}

impl FirstMessages {
    /// Creates the request for the local `reader` if `writer` is one of Fast DDS.
    pub(super) fn of(reader: GUID, writer: GUID) -> Option<Self> {
        let is_fast_dds = writer.to_bytes().starts_with(&FAST_DDS);
        is_fast_dds.then(|| Self { reader, writer, matched: Instant::now(), rounds: 0 })
    }

    /// Returns the writer.
    pub(super) fn writer(&self) -> GUID {
        self.writer
    }

    /// Sends the request if it is due. Returns true if it must be sent again later.
    pub(super) fn serve(&mut self, participant: &DomainParticipant) -> bool {
        if self.matched.elapsed() >= TIMES[self.rounds] {
            let mut writers = participant.discovered_writers().into_iter();
            if let Some(data) = writers.find(|data| data.writer_proxy.remote_writer_guid == self.writer) {
                if !data.publication_topic_data.topic_name.starts_with(REQUEST_PREFIX) {
                    return false;
                }
                let locators = data.writer_proxy.unicast_locator_list.into_iter().filter(|locator| locator.is_udp());
                let datagram = datagram(self.reader.to_bytes(), self.writer.to_bytes(), self.rounds as u32);
                send(&datagram, locators.map(SocketAddr::from));
            }
            self.rounds += 1;
        }
        self.rounds < TIMES.len()
    }
}

/// Returns the addresses of a remote reader.
pub(super) fn reader_addresses(participant: &DomainParticipant, reader: GUID) -> Option<Vec<SocketAddr>> {
    let mut readers = participant.discovered_readers().into_iter();
    let data = readers.find(|data| data.reader_proxy.remote_reader_guid == reader)?;
    let locators = data.reader_proxy.unicast_locator_list.into_iter().filter(|locator| locator.is_udp());
    Some(locators.map(SocketAddr::from).collect())
}

/// Sends a datagram to these addresses. A failure is logged only: the network may lose any datagram.
pub(super) fn send(datagram: &[u8], addresses: impl Iterator<Item = SocketAddr>) {
    for address in addresses {
        let any = if address.is_ipv4() { IpAddr::from(Ipv4Addr::UNSPECIFIED) } else { Ipv6Addr::UNSPECIFIED.into() };
        let sent = UdpSocket::bind((any, 0)).and_then(|socket| socket.send_to(datagram, address));
        if let Err(error) = sent {
            log::debug!("ROS 2: no datagram can be sent to {address}: {error}");
        }
    }
}

/// Returns the start of a message from a local endpoint to a remote one: the header, and the remote participant as the
/// destination. Also returns the numbers of both endpoints in their participants.
pub(super) fn addressed(from: [u8; 16], to: [u8; 16]) -> (Vec<u8>, [[u8; 4]; 2]) {
    let [from, to] = [from, to].map(|guid| {
        let [a, b, c, d, e, f, g, h, i, j, k, l, entity @ ..] = guid;
        ([a, b, c, d, e, f, g, h, i, j, k, l], entity)
    });
    let mut bytes = [b"RTPS".as_slice(), &VERSION, &RUSTDDS, &from.0].concat();
    bytes.extend([INFO_DST, LITTLE_ENDIAN, 12, 0]);
    bytes.extend(to.0);
    (bytes, [from.1, to.1])
}

/// Returns a submessage about the messages of a writer: its header, the numbers of reader and writer, and `words`.
pub(super) fn submessage(kind: u8, flags: u8, [reader, writer]: [[u8; 4]; 2], words: &[u32]) -> Vec<u8> {
    let words: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let [low, high] = ((8 + words.len()) as u16).to_le_bytes();
    [[kind, flags, low, high].as_slice(), &reader, &writer, &words].concat()
}

/// Returns the message of `reader` to `writer`. `round` counts the messages of this kind from 0.
fn datagram(reader: [u8; 16], writer: [u8; 16], round: u32) -> Vec<u8> {
    let (mut bytes, ends) = addressed(reader, writer);
    for sequence in 1..=FIRST_MESSAGES {
        // The sequence number (high, low), the set of the first fragment alone (base, bits, bitmap), and the counter.
        let words = [0, sequence, 1, 1, 1 << 31, round * FIRST_MESSAGES + sequence];
        bytes.extend(submessage(NACK_FRAG, LITTLE_ENDIAN, ends, &words));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes as RTPS 2.5 lays them out, written down by hand for the first message.
    #[test]
    fn the_datagram_is_that_of_the_standard() {
        let reader = [1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 21, 4];
        let writer = [1, 15, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 0, 0, 22, 3];
        #[rustfmt::skip]
        let expected = [
            b'R', b'T', b'P', b'S', 2, 4, 1, 18, 1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12,
            0x0e, 1, 12, 0, 1, 15, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42,
            0x12, 1, 32, 0, 0, 0, 21, 4, 0, 0, 22, 3, 0, 0, 0, 0, 1, 0, 0, 0,
            1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 128, 1, 0, 0, 0,
        ];
        let bytes = datagram(reader, writer, 0);
        assert_eq!(bytes[..expected.len()], expected);
        assert_eq!(bytes.len(), expected.len() + 3 * 36);
        // A writer ignores a counter that does not grow. The counter is the last word of each submessage.
        let counters = |round| datagram(reader, writer, round)[36..].chunks(36).map(|of| of[32]).collect::<Vec<u8>>();
        assert_eq!([counters(0), counters(1)], [[1, 2, 3, 4], [5, 6, 7, 8]]);
    }
}
