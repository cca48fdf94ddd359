//! Datagrams that this process sends beside RustDDS, because RustDDS 0.15.1 has no call for them. The files that send
//! them give the reasons: places in RustDDS are `file:line` below `src` of that version.
//!
//! In: endpoints, message numbers, addresses. Out: RTPS messages (RTPS 2.5, chapter 9.4) of one or a few submessages,
//! from one endpoint to one other. An endpoint is named by its GUID, or by the number of its entity in a participant.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::ops::{Range, RangeInclusive};

use rustdds::{DomainParticipant, GUID};

use super::ports;

/// The name of a participant: the first bytes of the GUIDs of its endpoints.
pub(super) type Prefix = [u8; 12];

/// Vendor ids, the first two bytes of GUIDs (RTPS 2.5, sections 9.3.1.5 and 9.4.4).
const RUSTDDS: [u8; 2] = [1, 18];
const FAST_DDS: [u8; 2] = [1, 15];
const CYCLONE_DDS: [u8; 2] = [1, 16];
/// The protocol version of RustDDS.
const VERSION: [u8; 2] = [2, 4];
/// Kinds of submessages.
const ACKNACK: u8 = 0x06;
const HEARTBEAT: u8 = 0x07;
const GAP: u8 = 0x08;
const INFO_DST: u8 = 0x0e;
const NACK_FRAG: u8 = 0x12;
const DATA: u8 = 0x15;
const DATA_FRAG: u8 = 0x16;
/// Flags of submessages: little endian; no answer is requested; parameters precede the payload; the payload is a key.
const LITTLE_ENDIAN: u8 = 1;
const FINAL: u8 = 2;
const INLINE_QOS: u8 = 2;
const KEY: u8 = 8;
/// The entities of the participants' discovery (RTPS 2.5, section 9.3.1.3).
const PARTICIPANT_READER: [u8; 4] = [0, 1, 0, 0xc7];
const PARTICIPANT_WRITER: [u8; 4] = [0, 1, 0, 0xc2];
/// The number of a participant's last message: more than any participant sends.
const LAST_MESSAGE: u32 = 1 << 30;
/// The bytes of a fragment: RustDDS's `FRAGMENT_SIZE` (`rtps/constant.rs:110`). A reader takes fragments of one size.
pub(super) const FRAGMENT_BYTES: usize = 256;
/// The bytes before a payload: its encoding, little-endian CDR, and no options.
const CDR_LE: [u8; 4] = [0, 1, 0, 0];
/// The first counter of acknowledgements: RustDDS ignores an ACKNACK that has the counter of the one before
/// (`Writer::handle_ack_nack`, `rtps/writer.rs:1137`), and subscribers count from 1.
const FIRST_COUNTER: u32 = 1 << 30;

/// Returns the participant of an endpoint.
pub(super) fn prefix(guid: GUID) -> Prefix {
    split(guid).0
}

/// Returns true for an endpoint of Fast DDS.
pub(super) fn is_fast_dds(guid: GUID) -> bool {
    guid.to_bytes().starts_with(&FAST_DDS)
}

/// Returns true for two participants of Cyclone DDS whose names begin alike, as those of one process do: after the
/// vendor follow two bytes of a hash that is drawn for the process (`ddsi_generate_participant_guid`). All participants
/// of a process have one socket. Those of other implementations have sockets of their own.
pub(super) fn are_of_one_process(one: Prefix, other: Prefix) -> bool {
    one.starts_with(&CYCLONE_DDS) && one[..4] == other[..4]
}

/// Returns the participant of an endpoint, and the number of the endpoint in it.
fn split(guid: GUID) -> (Prefix, [u8; 4]) {
    let [a, b, c, d, e, f, g, h, i, j, k, l, entity @ ..] = guid.to_bytes();
    ([a, b, c, d, e, f, g, h, i, j, k, l], entity)
}

/// Returns the acknowledgement of `reader` to `writer`: the reader has the first `last` messages and requests none.
/// `round` counts the acknowledgements.
pub(super) fn acknowledgement(reader: GUID, writer: GUID, last: u64, round: u32) -> Vec<u8> {
    let first_missing = last + 1;
    // The first missing message (high, low), an empty set from there on, and the counter.
    let words = [(first_missing >> 32) as u32, first_missing as u32, 0, FIRST_COUNTER.wrapping_add(round)];
    between(reader, writer, |reader, writer| submessage(ACKNACK, FINAL, [reader, writer], &words))
}

/// Returns the message of `writer` to `reader` that these messages are not for the reader.
///
/// No message may be named of which the reader can have a part: Fast DDS 2.14 then frees the part and keeps a reference
/// to it (`StatefulReader::processGapMsg` calls `History::remove_change_nts`), and the next `take` never returns.
pub(super) fn gap(writer: GUID, reader: GUID, numbers: RangeInclusive<u32>) -> Vec<u8> {
    let (first, last) = numbers.into_inner();
    // The start (high, low), the first number after the end, and an empty set from there on. Fast DDS 2.14 ignores a
    // GAP whose set begins at the start.
    let words = [0, first, 0, last + 1, 0];
    between(writer, reader, |writer, reader| submessage(GAP, 0, [reader, writer], &words))
}

/// Returns the message of `writer` to `reader` that the writer has messages 1 to `written`.
pub(super) fn heartbeat(writer: GUID, reader: GUID, written: u32) -> Vec<u8> {
    // The first number (high, low), the last, and the counter. RustDDS counts its own heartbeats from 1: a reader that
    // has seen one of them ignores this one.
    let words = [0, 1, 0, written, 0];
    between(writer, reader, |writer, reader| submessage(HEARTBEAT, FINAL, [reader, writer], &words))
}

/// Returns the message of `reader` to `writer` that the first fragments of these messages are missing. A writer ignores
/// counters that do not grow, so `round` counts the messages of this kind from 0.
pub(super) fn request(reader: GUID, writer: GUID, numbers: RangeInclusive<u32>, round: u32) -> Vec<u8> {
    let count = numbers.end() - numbers.start() + 1;
    between(reader, writer, |reader, writer| {
        let of = |number: u32| {
            // The number (high, low), the set of the first fragment alone (base, bits, bitmap), and the counter.
            let words = [0, number, 1, 1, 1 << 31, round * count + number];
            submessage(NACK_FRAG, 0, [reader, writer], &words)
        };
        numbers.flat_map(of).collect()
    })
}

/// Returns these fragments, counted from 0, of the message `sequence` of `writer` to `reader`. `body` is the message in
/// CDR.
pub(super) fn fragments(writer: GUID, reader: GUID, sequence: u64, body: &[u8], numbers: Range<usize>) -> Vec<u8> {
    let payload = |byte: usize| byte.checked_sub(CDR_LE.len()).map_or(CDR_LE[byte.min(3)], |byte| body[byte]);
    let bytes = CDR_LE.len() + body.len();
    let (first, end) = (numbers.start * FRAGMENT_BYTES, (numbers.end * FRAGMENT_BYTES).min(bytes));
    let count = end.saturating_sub(first).div_ceil(FRAGMENT_BYTES);
    between(writer, reader, |writer, reader| {
        let mut words = vec![0, 0, 28, 0];
        words.extend([reader, writer].concat());
        words.extend(((sequence >> 32) as u32).to_le_bytes());
        words.extend((sequence as u32).to_le_bytes());
        words.extend((numbers.start as u32 + 1).to_le_bytes());
        words.extend((count as u16).to_le_bytes());
        words.extend((FRAGMENT_BYTES as u16).to_le_bytes());
        words.extend((bytes as u32).to_le_bytes());
        words.extend((first..end).map(payload));
        let [low, high] = (words.len() as u16).to_le_bytes();
        [[DATA_FRAG, LITTLE_ENDIAN, low, high].as_slice(), &words].concat()
    })
}

/// Returns the message of a participant to all that it has left the network. `round` counts farewells.
pub(super) fn farewell(participant: Prefix, round: u16) -> Vec<u8> {
    let mut bytes = header(participant);
    // No flags beyond the header's, the distance to the parameters, and the message's number. RustDDS ignores a number
    // that it has received (`TopicCache::add_change`, `structure/dds_cache.rs:303`).
    let number = (LAST_MESSAGE + u32::from(round)).to_le_bytes();
    let mut body = [[0, 0, 16, 0], PARTICIPANT_READER, PARTICIPANT_WRITER, [0; 4], number].concat();
    // PID_STATUS_INFO: disposed and unregistered; the end of the parameters.
    body.extend([0x71, 0, 4, 0, 0, 0, 0, 3, 1, 0, 0, 0]);
    // The key, as a list of parameters in little endian: PID_PARTICIPANT_GUID, and the end.
    body.extend([0, 3, 0, 0, 0x50, 0, 16, 0]);
    body.extend(participant);
    body.extend([0, 0, 1, 0xc1, 1, 0, 0, 0]);
    bytes.extend([DATA, LITTLE_ENDIAN | INLINE_QOS | KEY]);
    bytes.extend((body.len() as u16).to_le_bytes());
    bytes.extend(body);
    bytes
}

/// Returns a message of a participant from which RustDDS concludes that it lives: its announcement without contents, which
/// RustDDS drops (`Reader::data_to_dds_data`, `rtps/reader.rs:805`).
pub(super) fn life_sign(participant: Prefix) -> Vec<u8> {
    // No flags beyond the header's, the distance to the payload, and the message's number.
    let body = [[0, 0, 16, 0], PARTICIPANT_READER, PARTICIPANT_WRITER, [0; 4], [1, 0, 0, 0]].concat();
    [header(participant), vec![DATA, LITTLE_ENDIAN, body.len() as u8, 0], body].concat()
}

/// Returns a message from one endpoint to another: the header, the participant of the latter, and what `body` makes of
/// the numbers of both.
fn between(from: GUID, to: GUID, body: impl FnOnce([u8; 4], [u8; 4]) -> Vec<u8>) -> Vec<u8> {
    let ((from, sender), (to, receiver)) = (split(from), split(to));
    let mut bytes = header(from);
    bytes.extend([INFO_DST, LITTLE_ENDIAN, 12, 0]);
    bytes.extend(to);
    bytes.extend(body(sender, receiver));
    bytes
}

fn header(participant: Prefix) -> Vec<u8> {
    [b"RTPS".as_slice(), &VERSION, &RUSTDDS, &participant].concat()
}

/// Returns a submessage about the messages of a writer: its header, the numbers of reader and writer, and `words`.
fn submessage(kind: u8, flags: u8, [reader, writer]: [[u8; 4]; 2], words: &[u32]) -> Vec<u8> {
    let words: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let [low, high] = ((8 + words.len()) as u16).to_le_bytes();
    [[kind, LITTLE_ENDIAN | flags, low, high].as_slice(), &reader, &writer, &words].concat()
}

/// Sends a datagram to these addresses. A failure is logged only: the network may lose any datagram.
pub(super) fn send(datagram: &[u8], addresses: impl IntoIterator<Item = SocketAddr>) {
    for address in addresses {
        let any = if address.is_ipv4() { IpAddr::from(Ipv4Addr::UNSPECIFIED) } else { Ipv6Addr::UNSPECIFIED.into() };
        let sent = UdpSocket::bind((any, 0)).and_then(|socket| socket.send_to(datagram, address));
        if let Err(error) = sent {
            log::debug!("ROS 2: no datagram can be sent to {address}: {error}");
        }
    }
}

/// Sends a datagram to the participant itself.
pub(super) fn send_to_own(participant: &DomainParticipant, datagram: &[u8]) {
    if let Some(port) = ports::user_port(participant.domain_id(), participant.participant_id()) {
        send(datagram, [SocketAddr::from((Ipv4Addr::LOCALHOST, port))]);
    }
}

/// The bytes as RTPS 2.5 lays them out, written down by hand.
#[cfg(test)]
mod tests {
    use super::*;

    const READER: [u8; 16] = [1, 15, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 0, 0, 22, 4];
    const WRITER: [u8; 16] = [1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 21, 3];

    fn ends() -> (GUID, GUID) {
        (GUID::from_bytes(READER), GUID::from_bytes(WRITER))
    }

    /// Returns a message from `from` to `to`, with these submessages.
    fn message(from: [u8; 16], to: [u8; 16], submessages: &[u8]) -> Vec<u8> {
        [b"RTPS", &[2, 4, 1, 18][..], &from[..12], &[0x0e, 1, 12, 0], &to[..12], submessages].concat()
    }

    #[test]
    fn an_acknowledgement_names_the_first_missing_message() {
        #[rustfmt::skip]
        let expected = [
            0x06, 3, 24, 0, 0, 0, 22, 4, 0, 0, 21, 3, 1, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 64,
        ];
        let (reader, writer) = ends();
        assert_eq!(acknowledgement(reader, writer, (1 << 32) + 7, 3), message(READER, WRITER, &expected));
    }

    #[test]
    fn a_gap_names_a_range() {
        #[rustfmt::skip]
        let expected = [
            0x08, 1, 28, 0, 0, 0, 22, 4, 0, 0, 21, 3, 0, 0, 0, 0, 1, 0, 0, 0,
            0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0,
        ];
        let (reader, writer) = ends();
        assert_eq!(gap(writer, reader, 1..=7), message(WRITER, READER, &expected));
    }

    #[test]
    fn a_heartbeat_names_all_messages() {
        #[rustfmt::skip]
        let expected = [
            0x07, 3, 28, 0, 0, 0, 22, 4, 0, 0, 21, 3, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0,
        ];
        let (reader, writer) = ends();
        assert_eq!(heartbeat(writer, reader, 7), message(WRITER, READER, &expected));
    }

    #[test]
    fn a_request_names_first_fragments_and_counts() {
        #[rustfmt::skip]
        let expected = [
            0x12, 1, 32, 0, 0, 0, 22, 4, 0, 0, 21, 3, 0, 0, 0, 0, 1, 0, 0, 0,
            1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 128, 1, 0, 0, 0,
        ];
        let (reader, writer) = ends();
        assert_eq!(request(reader, writer, 1..=1, 0), message(READER, WRITER, &expected));
        // The counter is the last word of each submessage of 36 bytes.
        let counters =
            |round| request(reader, writer, 1..=4, round)[36..].chunks(36).map(|of| of[32]).collect::<Vec<u8>>();
        assert_eq!([counters(0), counters(1)], [[1, 2, 3, 4], [5, 6, 7, 8]]);
    }

    #[test]
    fn fragments_have_their_place_in_the_message() {
        let (reader, writer) = ends();
        let body: Vec<u8> = (0..600).map(|byte| (byte % 251) as u8).collect();
        let of = |numbers| fragments(writer, reader, (1 << 32) + 9, &body, numbers);
        #[rustfmt::skip]
        let head = |first: u8, count: u8, bytes: u16| {
            let [low, high] = bytes.to_le_bytes();
            let head = [
                0x16, 1, low, high, 0, 0, 28, 0, 0, 0, 22, 4, 0, 0, 21, 3, 1, 0, 0, 0, 9, 0, 0, 0,
                first, 0, 0, 0, count, 0, 0, 1, 0x5c, 2, 0, 0,
            ];
            message(WRITER, READER, &head)
        };
        let payload = [&[0, 1, 0, 0][..], &body].concat();
        assert_eq!(of(0..2), [head(1, 2, 32 + 512), payload[..512].to_vec()].concat());
        assert_eq!(of(2..9), [head(3, 1, 32 + 92), payload[512..].to_vec()].concat());
    }

    #[test]
    fn a_life_sign_is_an_announcement_without_contents() {
        let expected = [0x15, 1, 20, 0, 0, 0, 16, 0, 0, 1, 0, 0xc7, 0, 1, 0, 0xc2, 0, 0, 0, 0, 1, 0, 0, 0];
        let expected = [b"RTPS", &[2, 4, 1, 18][..], &READER[..12], &expected].concat();
        assert_eq!(life_sign(prefix(GUID::from_bytes(READER))), expected);
    }

    #[test]
    fn a_farewell_names_the_participant() {
        #[rustfmt::skip]
        let expected = [
            0x15, 11, 60, 0, 0, 0, 16, 0, 0, 1, 0, 0xc7, 0, 1, 0, 0xc2, 0, 0, 0, 0, 5, 0, 0, 64,
            0x71, 0, 4, 0, 0, 0, 0, 3, 1, 0, 0, 0,
            0, 3, 0, 0, 0x50, 0, 16, 0, 1, 15, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 0, 0, 1, 0xc1, 1, 0, 0, 0,
        ];
        let expected = [b"RTPS", &[2, 4, 1, 18][..], &READER[..12], &expected].concat();
        assert_eq!(farewell(prefix(GUID::from_bytes(READER)), 5), expected);
    }
}
