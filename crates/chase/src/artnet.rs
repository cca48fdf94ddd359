//! ArtTimeCode of Art-Net 4 (Artistic Licence, "Art-Net 4 Protocol Release", ArtTimeCode): from datagrams to labels, and
//! back. Pure.

use crate::timecode::{FrameRate, Label};

/// The port of Art-Net.
pub const PORT: u16 = 6454;

const ID: &[u8] = b"Art-Net\0";
const OP_TIME_CODE: u16 = 0x9700;
const LEAST_VERSION: u16 = 14;
const BYTES: usize = 19;

/// The content of an ArtTimeCode packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeCode {
    /// The stream; 0 is the master.
    pub stream: u8,
    /// The label.
    pub label: Label,
    /// The rate by the packet's type.
    pub rate: FrameRate,
}

/// The reason why a datagram is no timecode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotTimeCode {
    /// A packet of Art-Net of another kind, such as dimmer values.
    #[error("the datagram is another packet of Art-Net")]
    Other,
    /// No packet of Art-Net, a shortened one, or a label that names no frame.
    #[error("the datagram is malformed")]
    Malformed,
}

/// Returns the timecode of a datagram.
///
/// # Errors
/// [`NotTimeCode`]
pub fn decode(datagram: &[u8]) -> Result<TimeCode, NotTimeCode> {
    let rest = datagram.strip_prefix(ID).ok_or(NotTimeCode::Malformed)?;
    let [op_low, op_high, rest @ ..] = rest else { return Err(NotTimeCode::Malformed) };
    if u16::from_le_bytes([*op_low, *op_high]) != OP_TIME_CODE {
        return Err(NotTimeCode::Other);
    }
    // Later versions may append fields.
    let &[version_high, version_low, _filler, stream, frames, seconds, minutes, hours, kind, ..] = rest else {
        return Err(NotTimeCode::Malformed);
    };
    let label = Label { hours, minutes, seconds, frames };
    let is_valid = |rate: &FrameRate| {
        u16::from_be_bytes([version_high, version_low]) >= LEAST_VERSION && rate.frame(label).is_some()
    };
    let rate = FrameRate::of_type(kind).filter(is_valid).ok_or(NotTimeCode::Malformed)?;
    Ok(TimeCode { stream, label, rate })
}

/// Returns the packet of a label.
pub fn encode(timecode: &TimeCode) -> [u8; BYTES] {
    let TimeCode { stream, label, rate } = *timecode;
    let Label { hours, minutes, seconds, frames } = label;
    let mut packet = [0; BYTES];
    packet[..8].copy_from_slice(ID);
    packet[8..10].copy_from_slice(&OP_TIME_CODE.to_le_bytes());
    packet[10..12].copy_from_slice(&LEAST_VERSION.to_be_bytes());
    packet[13..].copy_from_slice(&[stream, frames, seconds, minutes, hours, rate.type_code()]);
    packet
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 01:02:03:04 at 25, as other programs write the packet.
    const KNOWN: [u8; 19] = *b"Art-Net\0\x00\x97\x00\x0e\x00\x00\x04\x03\x02\x01\x01";

    fn known() -> TimeCode {
        TimeCode { stream: 0, label: "01:02:03:04".parse().unwrap(), rate: FrameRate::Ebu25 }
    }

    #[test]
    fn a_packet_of_other_programs_is_decoded_and_encoded() {
        assert_eq!(decode(&KNOWN), Ok(known()));
        assert_eq!(encode(&known()), KNOWN);
        let longer: Vec<u8> = KNOWN.into_iter().chain([0; 9]).collect();
        assert_eq!(decode(&longer), Ok(known()));
    }

    #[test]
    fn malformed_packets_are_refused_and_other_packets_named() {
        for length in 0..KNOWN.len() {
            assert_eq!(decode(&KNOWN[..length]), Err(NotTimeCode::Malformed), "{length} bytes");
        }
        let changed = |at: usize, to: u8| {
            let mut packet = KNOWN;
            packet[at] = to;
            decode(&packet)
        };
        // Frames, seconds, minutes, hours, type, version, identifier.
        for (at, to) in [(14, 25), (15, 60), (16, 60), (17, 24), (18, 4), (11, 13), (0, b'a')] {
            assert_eq!(changed(at, to), Err(NotTimeCode::Malformed), "byte {at}");
        }
        assert_eq!(changed(9, 0x50), Err(NotTimeCode::Other));
        assert_eq!(changed(12, 0xff), Ok(known()), "the filler is not tested");
        assert_eq!(changed(13, 7).unwrap().stream, 7);
        // 00:01:00;00 does not exist in drop frame.
        let mut dropped = KNOWN;
        dropped[14..].copy_from_slice(&[0, 0, 1, 0, 2]);
        assert_eq!(decode(&dropped), Err(NotTimeCode::Malformed));
    }
}
