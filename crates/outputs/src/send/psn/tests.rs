//! The packets, by their bytes and through a small decoder that shares nothing with the encoder.

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;

/// The tables of the protocol description (pages 4 and 6), written out by hand.
#[test]
fn the_bytes_are_those_of_the_protocol_description() {
    let tracker = Tracker {
        id: 0x0201,
        position: [1.0, -2.0, 0.5],
        speed: Some([0.0, 1.5, -0.25]),
        orientation: [0.0, 3.0, 0.0],
        status: 1.0,
        timestamp_us: 0x0807_0605_0403_0201,
    };
    #[rustfmt::skip]
    let data = [
        0x55, 0x67, 92, 0x80,                               // PSN_DATA_PACKET, 92 bytes of chunks
        0x00, 0x00, 12, 0x00,                               //   PSN_DATA_PACKET_HEADER, 12 bytes
        0x18, 0x17, 0x16, 0x15, 0x14, 0x13, 0x12, 0x11,     //     packet_timestamp
        2, 3, 0xfe, 1,                                      //     version, frame_id, frame_packet_count
        0x01, 0x00, 72, 0x80,                               //   PSN_DATA_TRACKER_LIST
        0x01, 0x02, 68, 0x80,                               //     tracker 0x0201
        0x00, 0x00, 12, 0x00,                               //       PSN_DATA_TRACKER_POS
        0, 0, 0x80, 0x3f,  0, 0, 0, 0xc0,  0, 0, 0, 0x3f,
        0x01, 0x00, 12, 0x00,                               //       PSN_DATA_TRACKER_SPEED
        0, 0, 0, 0,  0, 0, 0xc0, 0x3f,  0, 0, 0x80, 0xbe,
        0x02, 0x00, 12, 0x00,                               //       PSN_DATA_TRACKER_ORI
        0, 0, 0, 0,  0, 0, 0x40, 0x40,  0, 0, 0, 0,
        0x03, 0x00, 4, 0x00,                                //       PSN_DATA_TRACKER_STATUS
        0, 0, 0x80, 0x3f,
        0x06, 0x00, 8, 0x00,                                //       PSN_DATA_TRACKER_TIMESTAMP
        1, 2, 3, 4, 5, 6, 7, 8,
    ];
    let frame = data_frame(0x1112_1314_1516_1718, 0xfe, &[tracker]);
    assert_eq!(frame, PacketFrame { packets: vec![data.to_vec()], trackers: 1 });

    #[rustfmt::skip]
    let info = [
        0x56, 0x67, 42, 0x80,                               // PSN_INFO_PACKET
        0x00, 0x00, 12, 0x00,                               //   PSN_INFO_PACKET_HEADER
        7, 0, 0, 0, 0, 0, 0, 0,  2, 3, 9, 1,
        0x01, 0x00, 6, 0x00,                                //   PSN_INFO_SYSTEM_NAME
        b'd', b'r', b'a', b'g', b'o', b'n',
        0x02, 0x00, 12, 0x80,                               //   PSN_INFO_TRACKER_LIST
        0x01, 0x00, 8, 0x80,                                //     tracker 1
        0x00, 0x00, 4, 0x00,                                //       PSN_INFO_TRACKER_NAME
        b'h', b'e', b'a', b'd',
    ];
    let names = [TrackerName { id: 1, name: "head".to_owned() }];
    assert_eq!(info_frame(7, 9, "dragon", &names).packets, [info.to_vec()]);
}

/// A chunk as the description defines it: its id, true if it has chunks in it, its content; and the bytes after it.
fn take_chunk(bytes: &[u8]) -> (u16, bool, &[u8], &[u8]) {
    let id = u16::from_le_bytes([bytes[0], bytes[1]]);
    let field = u16::from_le_bytes([bytes[2], bytes[3]]);
    let end = 4 + usize::from(field & 0x7fff);
    (id, field >> 15 == 1, &bytes[4..end], &bytes[end..])
}

fn chunks(mut bytes: &[u8]) -> Vec<(u16, bool, &[u8])> {
    let mut all = Vec::new();
    while !bytes.is_empty() {
        let (id, nested, content, rest) = take_chunk(bytes);
        all.push((id, nested, content));
        bytes = rest;
    }
    all
}

/// The fields of each tracker by their ids, in the order in which the trackers come.
type Decoded = Vec<(u16, BTreeMap<u16, Vec<u8>>)>;

/// Returns the content of a frame's packets; fails if they are not of one frame of the given kind.
fn decode(frame: &PacketFrame, root: u16, list: u16, timestamp_us: u64, frame_id: u8) -> (Option<Vec<u8>>, Decoded) {
    assert!(frame.packets.len() <= 255);
    let (mut system, mut trackers) = (None, Vec::new());
    for packet in &frame.packets {
        assert!(packet.len() <= 1472, "{} bytes", packet.len());
        let (id, nested, content, rest) = take_chunk(packet);
        assert!(id == root && nested && rest.is_empty());
        for (id, nested, content) in chunks(content) {
            if id == 0 {
                assert!(!nested && content[..8] == timestamp_us.to_le_bytes());
                assert_eq!(content[8..], [2, 3, frame_id, frame.packets.len() as u8]);
            } else if id == list {
                assert!(nested);
                for (id, nested, fields) in chunks(content) {
                    let fields = chunks(fields).into_iter().map(|(id, nested, content)| {
                        assert!(!nested);
                        (id, content.to_vec())
                    });
                    assert!(nested);
                    trackers.push((id, fields.collect()));
                }
            } else {
                assert!(id == 1 && !nested);
                system = Some(content.to_vec());
            }
        }
    }
    (system, trackers)
}

fn floats(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks(4).map(|four| u32::from_le_bytes(four.try_into().unwrap())).collect()
}

fn any_tracker() -> impl Strategy<Value = Tracker> {
    let vector = || prop::array::uniform3(any::<f32>());
    (any::<u16>(), vector(), prop::option::of(vector()), vector(), any::<f32>(), any::<u64>()).prop_map(
        |(id, position, speed, orientation, status, timestamp_us)| Tracker {
            id,
            position,
            speed,
            orientation,
            status,
            timestamp_us,
        },
    )
}

proptest! {
    #[test]
    fn every_tracker_comes_back_in_order_and_to_the_bit(
        trackers in prop::collection::vec(any_tracker(), 0..200), timestamp_us: u64, frame_id: u8
    ) {
        let frame = data_frame(timestamp_us, frame_id, &trackers);
        prop_assert_eq!(frame.trackers, trackers.len());
        let (system, decoded) = decode(&frame, 0x6755, 1, timestamp_us, frame_id);
        prop_assert_eq!(system, None);
        prop_assert_eq!(decoded.len(), trackers.len());
        for (tracker, (id, fields)) in trackers.iter().zip(&decoded) {
            prop_assert_eq!(*id, tracker.id);
            let bits = |vector: [f32; 3]| vector.map(f32::to_bits).to_vec();
            prop_assert_eq!(floats(&fields[&0]), bits(tracker.position));
            prop_assert_eq!(fields.get(&1).map(|speed| floats(speed)), tracker.speed.map(bits));
            prop_assert_eq!(floats(&fields[&2]), bits(tracker.orientation));
            prop_assert_eq!(floats(&fields[&3]), vec![tracker.status.to_bits()]);
            prop_assert_eq!(&fields[&6], &tracker.timestamp_us.to_le_bytes());
            prop_assert_eq!(fields.len(), 4 + usize::from(tracker.speed.is_some()));
        }
    }

    #[test]
    fn every_name_comes_back_in_order(
        names in prop::collection::vec((any::<u16>(), "[a-zä龙 0-9]{1,40}"), 0..300), system in "[a-z ]{1,64}", frame_id: u8
    ) {
        let names: Vec<_> = names.into_iter().map(|(id, name)| TrackerName { id, name }).collect();
        let frame = info_frame(5, frame_id, &system, &names);
        let (decoded_system, decoded) = decode(&frame, 0x6756, 2, 5, frame_id);
        prop_assert_eq!(decoded_system, Some(system.into_bytes()));
        let expected: Vec<_> =
            names.iter().map(|it| (it.id, BTreeMap::from([(0, it.name.clone().into_bytes())]))).collect();
        prop_assert_eq!(decoded, expected);
    }
}

/// As many as a team of 5,000 benches has, and more than a frame holds.
#[test]
fn thousands_of_trackers_are_one_frame_of_packets_that_fit_the_network() {
    let tracker = |id: usize, speed| Tracker {
        id: id as u16,
        position: [id as f32; 3],
        speed,
        orientation: [0.0; 3],
        status: 1.0,
        timestamp_us: 1,
    };
    let frame = |count: usize, speed| data_frame(0, 0, &Vec::from_iter((1..=count).map(|id| tracker(id, speed))));
    let known = Some([0.0; 3]);
    for (count, speed, packets) in [(224, known, 12), (5001, known, 251), (5100, known, 255), (6375, None, 255)] {
        let frame = frame(count, speed);
        assert_eq!((frame.trackers, frame.packets.len()), (count, packets));
        let (_, decoded) = decode(&frame, 0x6755, 1, 0, 0);
        assert!(decoded.iter().map(|(id, _)| usize::from(*id)).eq(1..=count));
    }
    let (_, decoded) = decode(&frame(60_000, known), 0x6755, 1, 0, 0);
    assert_eq!((decoded.len(), frame(60_000, known).trackers), (5100, 5100), "the number of trackers left out");
    let names = (1..=5001).map(|id| TrackerName { id, name: format!("handle {id}") }).collect::<Vec<_>>();
    let (_, decoded) = decode(&info_frame(0, 0, "dragon", &names), 0x6756, 2, 0, 0);
    assert_eq!(decoded.len(), 5001);
}
