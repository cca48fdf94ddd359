//! Bytes from outside that a chase decodes: datagrams of Art-Net and PosiStageNet, bytes of a MIDI device, sound. Also
//! OSC: datagrams that conduct, and the file of a user's own messages. The first byte selects the decoder.

use bench_dragon::chase::timecode::{FrameRate, Label};
use bench_dragon::chase::{artnet, ltc, mtc, psn};
use bench_dragon::outputs::osc_control::{MOST_BYTES, received};
use bench_dragon::outputs::send::osc_map::OscMap;
use fastrand::Rng;

use super::Target;
use super::bytes::changed;

pub const TARGET: Target = Target { name: "timecode", run, seeds, mutate, cases: 20_000 };

fn run(data: &[u8]) -> bool {
    let Some((kind, bytes)) = data.split_first() else { return false };
    match kind {
        4 => conducts(bytes),
        5 => std::str::from_utf8(bytes).is_ok_and(|text| match OscMap::parse(text, "map.toml") {
            Ok(_) => true,
            Err(error) => {
                let sentence = error.to_string();
                assert!(sentence.starts_with("map.toml") && !sentence.contains('\n'), "{sentence}");
                false
            }
        }),
        _ => decodes(kind % 4, bytes),
    }
}

/// Reads a datagram of OSC.
fn conducts(bytes: &[u8]) -> bool {
    // A longer one is not read.
    let Some(Ok(messages)) = bytes.get(..bytes.len().min(MOST_BYTES)).map(received) else { return false };
    assert!(messages.len() <= bytes.len(), "{} messages in {} bytes", messages.len(), bytes.len());
    assert!(messages.iter().all(|message| !message.address.contains(char::is_control)));
    true
}

fn decodes(kind: u8, bytes: &[u8]) -> bool {
    match kind {
        0 => artnet::decode(bytes).is_ok_and(|timecode| {
            assert_eq!(artnet::decode(&artnet::encode(&timecode)), Ok(timecode));
            names_a_frame(timecode.label, timecode.rate);
            true
        }),
        1 => psn::decode(bytes).is_ok_and(|trackers| {
            let most = bytes.len() / 20;
            assert!(trackers.len() <= most, "{} trackers in {} bytes", trackers.len(), bytes.len());
            assert!(trackers.iter().all(|tracker| tracker.position.iter().all(|part| part.is_finite())));
            true
        }),
        2 => {
            let mut decoder = mtc::Decoder::default();
            let events: Vec<_> = bytes.iter().filter_map(|byte| decoder.push(*byte)).collect();
            // A label takes sixteen bytes, a full frame ten.
            assert!(events.len() <= bytes.len(), "{} events", events.len());
            for event in &events {
                if let mtc::Event::Running { label, rate } | mtc::Event::Located { label, rate } = *event {
                    names_a_frame(label, rate);
                }
            }
            !events.is_empty()
        }
        _ => sound(bytes),
    }
}

/// Decodes sound with a header.
fn sound(mut bytes: &[u8]) -> bool {
    let Ok(format) = ltc::wave::Format::read(&mut bytes) else { return false };
    assert!(format.block_bytes > 0 && format.sample_rate >= 8000);
    let mut decoder = ltc::Decoder::new(f64::from(format.sample_rate));
    let samples = bytes.len() / format.block_bytes;
    for block in bytes.chunks_exact(format.block_bytes) {
        let sample = format.sample(block, format.channels() - 1);
        assert!(sample.abs() <= 4.0, "{sample}");
        if let Some(ltc::Event::Frame { label, rate, end }) = decoder.push(sample) {
            names_a_frame(label, rate);
            assert!((0.0..=samples as f64).contains(&end), "{end} of {samples}");
        }
    }
    true
}

fn names_a_frame(label: Label, rate: FrameRate) {
    let frame = rate.frame(label).unwrap();
    assert!(frame < rate.frames_per_day() && rate.label(frame) == label, "{label} at {rate}");
}

fn seeds() -> Vec<Vec<u8>> {
    let packet = b"\0Art-Net\0\x00\x97\x00\x0e\x00\x00\x04\x03\x02\x01\x01".to_vec();
    let position = [&[0, 0, 12, 0][..], &[0; 12]].concat();
    let tracker = [&[1, 0, 16, 0x80][..], &position].concat();
    let list = [&[1, 0, 20, 0x80][..], &tracker].concat();
    let trackers = [&[1, 0x55, 0x67, 24, 0x80][..], &list].concat();
    let mut quarters = vec![2];
    quarters.extend([0x04, 0x11, 0x23, 0x32, 0x4e, 0x51, 0x61, 0x76].iter().flat_map(|nibble| [0xf1, *nibble]));
    let full = vec![2, 0xf0, 0x7f, 0x7f, 0x01, 0x01, 0x61, 0x1e, 0x23, 0x14, 0xf7];
    let mut wave =
        b"\x03RIFF\0\0\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0\x40\x1f\0\0\x40\x1f\0\0\x01\0\x08\0data\0\0\0\0".to_vec();
    // Two frames of zeros with their sync pattern, at 8,000 samples and 2,000 bits per second.
    let mut high = false;
    for bit in (0..160).map(|bit| matches!(bit % 80, 66..=77 | 79)) {
        high = !high;
        let second = high != bit;
        wave.extend([high, high, second, second].map(|high| if high { 200 } else { 56 }));
        high = second;
    }
    let seek = b"\x04#bundle\0\0\0\0\0\0\0\0\x01\0\0\0\x10/seek\0\0\0,f\0\0\x43\xc8\0\0".to_vec();
    let map = b"\x05[[messages]]\ncue = \"go\"\naddress = \"/cue/1/start\"\narguments = [1, 0.5]\n".to_vec();
    vec![packet, trackers, quarters, full, wave, seek, map]
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    let mut made = changed(data, random);
    // Most changes keep the decoder.
    if let (Some(kind), Some(first), true) = (data.first(), made.first_mut(), random.u8(..8) > 0) {
        *first = *kind;
    }
    made
}
