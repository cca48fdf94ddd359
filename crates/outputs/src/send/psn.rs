//! The packets of PosiStageNet 2.03 (VYV and MA Lighting, "PosiStageNet protocol description v2.03", 2019). In:
//! trackers, names, timestamps. Out: the bytes of UDP packets. Pure.
//!
//! All is little-endian. A chunk is a header of 32 bits and its content. Bits 0 to 15 of the header are its id, and
//! bits 16 to 30 the length of the content. Bit 31 is set if the content is chunks. A frame is split into packets that
//! all have its number and their count. They are sent back to back, because a receiver puts them together.

/// The greatest size of a packet: an Ethernet frame of 1,500 bytes without the headers of IP and UDP. The protocol
/// allows 1,500 bytes, which would be fragmented.
pub const MOST_BYTES: usize = 1472;
/// The most packets of a frame: their count is a byte.
pub const MOST_PACKETS: usize = 255;

const VERSION_HIGH: u8 = 2;
const VERSION_LOW: u8 = 3;

const INFO_PACKET: u16 = 0x6756;
const DATA_PACKET: u16 = 0x6755;
const PACKET_HEADER: u16 = 0x0000;
const INFO_SYSTEM_NAME: u16 = 0x0001;
const INFO_TRACKER_LIST: u16 = 0x0002;
const INFO_TRACKER_NAME: u16 = 0x0000;
const DATA_TRACKER_LIST: u16 = 0x0001;
const DATA_TRACKER_POSITION: u16 = 0x0000;
const DATA_TRACKER_SPEED: u16 = 0x0001;
const DATA_TRACKER_ORIENTATION: u16 = 0x0002;
const DATA_TRACKER_STATUS: u16 = 0x0003;
const DATA_TRACKER_TIMESTAMP: u16 = 0x0006;

/// The place of the count of packets in a packet: the last byte of its header.
const PACKET_COUNT_AT: usize = 4 + 4 + 11;

/// The data of a tracker, in the receiver's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracker {
    /// Its number.
    pub id: u16,
    /// The position, in metres.
    pub position: [f32; 3],
    /// The speed, in metres per second; left out of the packet if it is not known.
    pub speed: Option<[f32; 3]>,
    /// The axis of its rotation; the length of the vector is the angle in radians.
    pub orientation: [f32; 3],
    /// 1 if the position is valid, 0 if it is not known any more.
    pub status: f32,
    /// The time from the sender's start to the moment of the position, in microseconds.
    pub timestamp_us: u64,
}

/// A tracker's number and name. The name is not empty: some receivers cannot read an empty one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TrackerName {
    /// Its number.
    pub id: u16,
    /// Its name.
    pub name: String,
}

/// The packets of one frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PacketFrame {
    /// The packets, at most [`MOST_PACKETS`] of at most [`MOST_BYTES`].
    pub packets: Vec<Vec<u8>>,
    /// The number of trackers in them: all, unless they are too many for a frame.
    pub trackers: usize,
}

/// Returns positions: a frame of DATA packets with the number `frame_id`, sent `timestamp_us` after the sender's start.
pub fn data_frame(timestamp_us: u64, frame_id: u8, trackers: &[Tracker]) -> PacketFrame {
    let opening = [];
    split(
        Kind { root: DATA_PACKET, list: DATA_TRACKER_LIST },
        timestamp_us,
        frame_id,
        &opening,
        trackers,
        |tracker, out| {
            nested(out, tracker.id, |out| {
                vector(out, DATA_TRACKER_POSITION, tracker.position);
                if let Some(speed) = tracker.speed {
                    vector(out, DATA_TRACKER_SPEED, speed);
                }
                vector(out, DATA_TRACKER_ORIENTATION, tracker.orientation);
                leaf(out, DATA_TRACKER_STATUS, &tracker.status.to_le_bytes());
                leaf(out, DATA_TRACKER_TIMESTAMP, &tracker.timestamp_us.to_le_bytes());
            });
        },
    )
}

/// Returns names: a frame of INFO packets, each of which begins with the system's name.
pub fn info_frame(timestamp_us: u64, frame_id: u8, system_name: &str, trackers: &[TrackerName]) -> PacketFrame {
    let mut opening = Vec::new();
    leaf(&mut opening, INFO_SYSTEM_NAME, system_name.as_bytes());
    let kind = Kind { root: INFO_PACKET, list: INFO_TRACKER_LIST };
    split(kind, timestamp_us, frame_id, &opening, trackers, |tracker, out| {
        nested(out, tracker.id, |out| leaf(out, INFO_TRACKER_NAME, tracker.name.as_bytes()));
    })
}

/// The ids of a kind of packet: of its outermost chunk, and of its list of trackers.
#[derive(Clone, Copy)]
struct Kind {
    root: u16,
    list: u16,
}

/// Returns a frame in the fewest packets, its trackers in their order.
fn split<Item>(
    kind: Kind,
    timestamp_us: u64,
    frame_id: u8,
    opening: &[u8],
    items: &[Item],
    encode: impl Fn(&Item, &mut Vec<u8>),
) -> PacketFrame {
    let mut before = Vec::new();
    nested(&mut before, kind.root, |out| {
        let mut header = timestamp_us.to_le_bytes().to_vec();
        header.extend([VERSION_HIGH, VERSION_LOW, frame_id, 0]);
        leaf(out, PACKET_HEADER, &header);
        out.extend(opening);
    });
    let begin = || {
        let mut packet = Vec::with_capacity(MOST_BYTES);
        packet.extend(&before);
        chunk_header(&mut packet, kind.list, 0, true);
        packet
    };
    let (mut packets, mut trackers, mut packet, mut chunk) = (Vec::new(), 0, begin(), Vec::new());
    for item in items {
        chunk.clear();
        encode(item, &mut chunk);
        if packet.len() + chunk.len() > MOST_BYTES {
            if packets.len() + 1 == MOST_PACKETS {
                break;
            }
            packets.push(std::mem::replace(&mut packet, begin()));
        }
        packet.extend(&chunk);
        trackers += 1;
    }
    packets.push(packet);
    let count = packets.len() as u8;
    for packet in &mut packets {
        set_length(packet, 0);
        set_length(packet, before.len());
        packet[PACKET_COUNT_AT] = count;
    }
    PacketFrame { packets, trackers }
}

fn chunk_header(out: &mut Vec<u8>, id: u16, length: usize, has_subchunks: bool) {
    let header = u32::from(id) | (length as u32) << 16 | u32::from(has_subchunks) << 31;
    out.extend(header.to_le_bytes());
}

/// Writes the length of the chunk of chunks that begins at `at` and reaches to the end.
fn set_length(packet: &mut [u8], at: usize) {
    let length = (packet.len() - at - 4) as u16 | 0x8000;
    packet[at + 2..at + 4].copy_from_slice(&length.to_le_bytes());
}

/// Appends a chunk of chunks.
fn nested(out: &mut Vec<u8>, id: u16, content: impl FnOnce(&mut Vec<u8>)) {
    let at = out.len();
    chunk_header(out, id, 0, true);
    content(out);
    set_length(out, at);
}

/// Appends a chunk of data.
fn leaf(out: &mut Vec<u8>, id: u16, content: &[u8]) {
    chunk_header(out, id, content.len(), false);
    out.extend(content);
}

fn vector(out: &mut Vec<u8>, id: u16, value: [f32; 3]) {
    chunk_header(out, id, 12, false);
    value.iter().for_each(|number| out.extend(number.to_le_bytes()));
}

#[cfg(test)]
#[path = "psn/tests.rs"]
mod tests;
