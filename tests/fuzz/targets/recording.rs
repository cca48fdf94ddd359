//! MCAP files: what `record --recover` mends can be read, and what `replay` takes is played to its end.

use std::borrow::Cow;
use std::io::Cursor;

use bench_dragon::live::{Frames, Period};
use bench_dragon::recording::mcap::reader::Recording;
use bench_dragon::recording::mcap::recover::{RecoverError, Recovered, check_magic, recover};
use bench_dragon::recording::replay::{Pace, Prepared, ReplayOptions};
use bench_dragon::scene::Accepted;
use fastrand::Rng;
use mcap::records::MessageHeader;
use mcap::{Message, MessageStream, WriteOptions, Writer};

use super::Target;
use super::bytes::{changed, one};

pub const TARGET: Target = Target { name: "recording", run, seeds: Vec::new, mutate, cases: 400 };

/// Periods of a replay that are waited for: in each the thread that reads has a while.
const MOST_PERIODS: u64 = 5000;

fn run(data: &[u8]) {
    if let Ok((recovered, mended)) = mend(data) {
        // Mending is done once: the second time there is nothing to mend.
        let (again, _) = mend(&mended).expect("what was mended is a recording");
        assert!(again.whole && again.damaged == 0 && again.lost_bytes == 0, "{again:?} after {recovered:?}");
        assert_eq!((again.messages, again.attachments), (recovered.messages, recovered.attachments), "{recovered:?}");
        let messages = MessageStream::new(&mended).expect("what was mended has an end");
        let read = messages.filter(Result::is_ok).count();
        assert_eq!(read as u64, recovered.messages);
    }
    let folder = tempfile::tempdir().expect("a folder for a file");
    let file = folder.path().join("fuzz.mcap");
    std::fs::write(&file, data).expect("a file");
    match Recording::open(&file) {
        Err(error) => assert!(!error.to_string().contains(char::is_control), "{error:?}"),
        Ok(mut recording) => {
            for chunk in 0..recording.chunks() {
                if let Err(error) = recording.read_chunk(chunk, &mut |_| ()) {
                    assert!(!error.to_string().contains(char::is_control), "{error:?}");
                }
            }
            play(&file);
        }
    }
}

fn mend(data: &[u8]) -> Result<(Recovered, Vec<u8>), RecoverError> {
    let mut input = Cursor::new(data);
    check_magic(&mut input)?;
    let mut mended = Vec::new();
    let recovered = recover(input, data.len() as u64, &mut mended)?;
    Ok((recovered, mended))
}

/// Plays a file as the command does, as fast as it is read.
fn play(file: &std::path::Path) {
    let options = ReplayOptions { pace: Pace::Even(100.0), start: None, looping: false };
    let recorded = ReplayOptions { pace: Pace::Recorded(1.0), start: Some(1e-3), looping: false };
    if let Ok(prepared) = Prepared::open(file, recorded) {
        // The command refuses any other rate.
        let _ = Accepted::RATE.check("rate", prepared.rate());
    }
    let Ok(prepared) = Prepared::open(file, options) else { return };
    let handles = prepared.contents().ends[0].handles as usize;
    assert!(handles > 0);
    let (mut replay, reading) = prepared.begin().expect("a thread");
    let mut last = None;
    for tick in 0..MOST_PERIODS {
        match replay.frame(tick) {
            Period::Frame(frame, _) => {
                assert_eq!((frame.tick, frame.chain.handles()), (tick, handles));
                assert!(last.replace(tick).is_none_or(|last| last < tick));
            }
            Period::Empty => std::thread::sleep(std::time::Duration::from_micros(50)),
            Period::Over => break,
        }
    }
    drop(replay);
    let (_, failure) = reading.finish();
    assert!(failure.is_none_or(|error| !error.to_string().contains("panicked")));
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    if random.u8(..3) == 0 {
        return changed(data, random);
    }
    rewritten(data, random).unwrap_or_else(|| changed(data, random))
}

/// The file written again with other messages: its checks and its index are right.
fn rewritten(data: &[u8], random: &mut Rng) -> Option<Vec<u8>> {
    // The stream panics where lengths are damaged ("capacity overflow"); what is mended has right ones.
    let (_, mended) = mend(data).ok()?;
    let mut messages = Vec::new();
    for message in MessageStream::new(&mended).ok()? {
        messages.push(message.ok()?);
    }
    if messages.is_empty() {
        return None;
    }
    for _ in 0..1 + random.usize(..4) {
        let (at, other) = (random.usize(..messages.len()), random.usize(..messages.len()));
        match random.u8(..8) {
            0 if messages.len() > 1 => drop(messages.remove(at)),
            1 => messages.insert(at, messages[other].clone()),
            2 => messages.swap(at, other),
            3 => messages[at].log_time = random.u64(..),
            4 => {
                let channel = messages[other].channel.clone();
                messages[at].channel = channel;
            }
            _ => messages[at].data = Cow::Owned(changed(&messages[at].data.clone(), random)),
        }
    }
    let chunk = *one(&[Some(200), Some(4000), Some(1 << 20), None], random);
    let options = WriteOptions::new().profile("ros2").chunk_size(chunk);
    let mut writer: Writer<Cursor<Vec<u8>>> = options.create(Cursor::new(Vec::new())).ok()?;
    for Message { channel, sequence, log_time, publish_time, data } in messages {
        let schema = channel.schema.as_ref()?;
        let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).ok()?;
        let id = writer.add_channel(schema, &channel.topic, &channel.message_encoding, &channel.metadata).ok()?;
        let header = MessageHeader { channel_id: id, sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, &data).ok()?;
    }
    writer.finish().ok()?;
    Some(writer.into_inner().into_inner())
}
