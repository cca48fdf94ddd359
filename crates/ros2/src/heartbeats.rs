//! A heartbeat that a client of Cyclone DDS must get before the first answer.
//!
//! Cyclone takes the messages that the first heartbeat of a writer names for old ones, and acknowledges them without
//! delivery to a volatile reader. RustDDS sends a heartbeat when it matches a reader, but the reader may not know the
//! writer yet. The next heartbeat of RustDDS may name an answer that RustDDS has not sent. RustDDS counts a message
//! from the call that writes it, and answers an ACKNACK before it sends. The client would then wait without end. So
//! this file sends a HEARTBEAT submessage (RTPS 2.5, section 9.4.5.7) just before the answer is written: this heartbeat
//! names the earlier answers.

use rustdds::{DomainParticipant, GUID};

use super::retransmission::{LITTLE_ENDIAN, addressed, reader_addresses, send, submessage};

/// The kind of the submessage, and the flag that no acknowledgement is requested.
const HEARTBEAT: u8 = 0x07;
const FINAL: u8 = 2;

/// Sends the heartbeat of `writer`, which has written `written` messages, to `reader`.
pub(super) fn send_heartbeat(participant: &DomainParticipant, writer: GUID, reader: GUID, written: u32) {
    if let Some(addresses) = reader_addresses(participant, reader) {
        send(&datagram(writer.to_bytes(), reader.to_bytes(), written), addresses.into_iter());
    }
}

/// Returns the message of `writer` to `reader`: the writer has messages 1 to `written`, and an acknowledgement is not
/// needed.
fn datagram(writer: [u8; 16], reader: [u8; 16], written: u32) -> Vec<u8> {
    let (mut bytes, [writer, reader]) = addressed(writer, reader);
    // The first number (high, low), the last, and the counter. RustDDS counts its own heartbeats from 1: a reader that
    // has seen one of them ignores this one.
    bytes.extend(submessage(HEARTBEAT, LITTLE_ENDIAN | FINAL, [reader, writer], &[0, 1, 0, written, 0]));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes as RTPS 2.5 lays them out, written down by hand.
    #[test]
    fn the_datagram_is_that_of_the_standard() {
        let writer = [1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 21, 3];
        let reader = [1, 16, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 0, 0, 22, 4];
        #[rustfmt::skip]
        let expected = [
            b'R', b'T', b'P', b'S', 2, 4, 1, 18, 1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12,
            0x0e, 1, 12, 0, 1, 16, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42,
            0x07, 3, 28, 0, 0, 0, 22, 4, 0, 0, 21, 3, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0,
        ];
        assert_eq!(datagram(writer, reader, 7), expected);
    }
}
