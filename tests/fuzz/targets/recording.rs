//! MCAP files: output of `record --recover` can be read, and files that `replay` accepts are played to their end.

use std::fs::File;
use std::io::{Cursor, Write};
use std::ops::RangeInclusive;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bench_dragon::publisher::live::{FrameSource, Outgoing, Period};
use bench_dragon::recording::mcap::reader::{Item, Recording, frame_of};
use bench_dragon::recording::mcap::recover::{RecoverError, Recovered, check_magic, recover};
use bench_dragon::recording::replay::{Pace, Prepared, ReplayOptions};
use bench_dragon::show::convert::Stamps;
use bench_dragon::show::scene::Accepted;
use fastrand::Rng;
use mcap::records::MessageHeader;
use mcap::{Message, MessageStream, WriteOptions, Writer};
use nix::sys::memfd::{MFdFlags, memfd_create};

use super::Target;
use super::bytes::{changed, one};
use super::mcap_records::{
    ATTACHMENT, CHANNEL, CHUNK, Known, MESSAGE, MESSAGE_INDEX, Record, SCHEMA, Wrong, messages, parsed, written,
};

pub const TARGET: Target = Target { name: "recording", run, seeds, mutate, cases: 3000 };

/// The recording from which the smaller ones are made.
const RECORDED: &[u8] = include_bytes!("../corpus/recording/small.mcap");
/// Most periods of a replay that the test waits for: each gives the reading thread some time.
const MOST_PERIODS: u64 = 5000;
/// Frames per second of the replay: two seconds of frames are read ahead.
const RATE: f64 = 10.0;

fn run(data: &[u8]) -> bool {
    let whole = messages(data);
    if let Ok((recovered, mended)) = mend(data) {
        check_mended(&recovered, &mended, whole.as_deref());
    }
    let (_file, path) = in_memory(data);
    match Recording::open(&path) {
        Err(error) => {
            assert!(!error.to_string().contains(char::is_control), "{error:?}");
            false
        }
        Ok(mut recording) => {
            let mut sent = Sent::default();
            let mut damaged = false;
            for chunk in 0..recording.chunks() {
                let mut found = 0;
                if let Err(error) = recording.read_chunk(chunk, &mut |item| {
                    found += 1;
                    sent.add(item);
                }) {
                    assert!(!error.to_string().contains(char::is_control), "{error:?}");
                    damaged = true;
                }
                assert!(found <= data.len(), "{found} messages of {} bytes", data.len());
            }
            play(&path, (!damaged).then_some(&sent));
            true
        }
    }
}

/// Asserts that mending a mended file changes nothing, and that mending keeps exactly the messages of whole chunks.
fn check_mended(recovered: &Recovered, mended: &[u8], whole: Option<&[Known]>) {
    let (again, _) = mend(mended).expect("a mended file is a recording");
    assert!(again.whole && again.damaged == 0 && again.lost_bytes == 0, "{again:?} after {recovered:?}");
    assert_eq!((again.messages, again.attachments), (recovered.messages, recovered.attachments), "{recovered:?}");
    let read = MessageStream::new(mended).expect("a mended file has an end");
    let kept: Vec<Known> = (read.filter_map(Result::ok))
        .map(|Message { sequence, log_time, publish_time, data, .. }| {
            let data = data.into_owned();
            Known { sequence, times: [log_time, publish_time], data }
        })
        .collect();
    assert_eq!(kept.len() as u64, recovered.messages);
    let Some(whole) = whole else { return };
    let mut left = whole.iter();
    assert!(kept.iter().all(|kept| left.any(|message| message == kept)), "kept a message of no chunk: {recovered:?}");
    let of_known_channels = whole.len() as u64 - recovered.unknown.min(whole.len() as u64);
    assert!(recovered.damaged > 0 || recovered.messages == of_known_channels, "{recovered:?} of {}", whole.len());
}

fn mend(data: &[u8]) -> Result<(Recovered, Vec<u8>), RecoverError> {
    let mut input = Cursor::new(data);
    check_magic(&mut input)?;
    let mut mended = Vec::new();
    let recovered = recover(input, data.len() as u64, &mut mended)?;
    Ok((recovered, mended))
}

/// Returns a file of these bytes in memory, which exists while it is open, and its path.
fn in_memory(data: &[u8]) -> (File, PathBuf) {
    let mut file = File::from(memfd_create("fuzz.mcap", MFdFlags::MFD_CLOEXEC).expect("a file"));
    file.write_all(data).expect("memory");
    let path = format!("/proc/self/fd/{}", file.as_raw_fd()).into();
    (file, path)
}

/// The messages of a recording that a replay must send, from its chunks.
#[derive(Default)]
struct Sent {
    /// Simulated time and tick of the readable frames.
    frames: Vec<(u64, u64)>,
    unreadable: bool,
    alerts: Vec<u64>,
    cues: Vec<u64>,
}

impl Sent {
    fn add(&mut self, item: Item) {
        match item {
            Item::Frame(bytes) => match frame_of(&bytes) {
                Ok(read) => self.frames.push((read.frame.sim_time.to_bits(), read.frame.tick)),
                Err(_) => self.unreadable = true,
            },
            Item::Alert(alert) => self.alerts.push(alert.tick),
            Item::Cue(cue) => self.cues.push(cue.tick),
            Item::Status(_) | Item::Stage(_) => (),
        }
    }

    /// Returns the number of these messages that a replay sends. A replay sends only the latest of the messages before
    /// the first frame if they have been read by then.
    fn outgoing(&self, ticks: &[u64]) -> RangeInclusive<usize> {
        let first = self.frames.first().map_or(0, |(_, tick)| *tick);
        ticks.len() - ticks.iter().filter(|tick| **tick < first).count().saturating_sub(1)..=ticks.len()
    }
}

/// The stamps of every frame.
const STAMPS: Stamps = Stamps { run_id: 0, sequence: 0, stamp_ns: 0, deadline_ns: 0 };

/// Plays a file as the command does, at the speed of reading.
fn play(file: &Path, sent: Option<&Sent>) {
    let options = ReplayOptions { pace: Pace::Even(RATE), start: None, looping: false };
    let recorded = ReplayOptions { pace: Pace::Recorded(1.0), start: Some(1e-3), looping: false };
    if let Ok(prepared) = Prepared::open(file, recorded) {
        // The command refuses any other rate.
        let _ = Accepted::RATE.check("rate", prepared.rate());
        assert!(prepared.start() >= 1e-3, "begins at {} s", prepared.start());
    }
    let Ok(prepared) = Prepared::open(file, options) else { return };
    let handles = prepared.contents().ends[0].handles as usize;
    assert!(handles > 0);
    let (mut replay, reading) = prepared.begin().expect("a thread");
    let mut last = None;
    let (mut frames, mut alerts, mut cues, mut over) = (Vec::new(), 0, 0, false);
    for tick in 0..MOST_PERIODS {
        match replay.frame(tick, STAMPS) {
            Period::Frame(Outgoing { header, chain, alerts: some_alerts, cues: some_cues, .. }) => {
                assert_eq!((header.tick, chain.handles()), (tick, handles));
                assert!(last.replace(tick).is_none_or(|last| last < tick));
                frames.push(header.sim_time.to_bits());
                alerts += some_alerts.len();
                cues += some_cues.len();
            }
            Period::Empty => std::thread::sleep(Duration::from_micros(20)),
            Period::Over => {
                over = true;
                break;
            }
        }
    }
    drop(replay);
    let (_, failure) = reading.finish();
    if let Some(error) = &failure {
        let sentence = error.to_string();
        assert!(!sentence.contains("panicked") && !sentence.contains(char::is_control), "{sentence:?}");
    }
    let Some(sent) = sent.filter(|sent| over && failure.is_none() && !sent.unreadable) else { return };
    assert!(frames.iter().eq(sent.frames.iter().map(|(time, _)| time)), "{} frames", frames.len());
    assert!(sent.frames.is_sorted_by(|one, next| one.1 < next.1), "periods out of order are played");
    // Messages out of order may count as older than the first frame.
    if sent.alerts.is_sorted() && sent.cues.is_sorted() {
        let (of_alerts, of_cues) = (sent.outgoing(&sent.alerts), sent.outgoing(&sent.cues));
        assert!(of_alerts.contains(&alerts), "{alerts} alerts, expected {of_alerts:?}");
        assert!(of_cues.contains(&cues), "{cues} cues, expected {of_cues:?}");
    }
}

/// Returns recordings of few messages: of all topics, of frames and the stage alone, in many chunks and in one.
fn seeds() -> Vec<Vec<u8>> {
    let all: Vec<Message> =
        MessageStream::new(RECORDED).expect("a recording").map(|read| read.expect("whole")).collect();
    let of = |topics: &[&str], most: usize| {
        let mut left: Vec<usize> = vec![most + 1; topics.len()];
        let mut few = all.clone();
        few.retain(|message| {
            let topic = topics.iter().position(|topic| message.channel.topic.ends_with(topic));
            topic.is_some_and(|topic| {
                left[topic] = left[topic].saturating_sub(1);
                left[topic] > 0
            })
        });
        few
    };
    let frames = ["/handles", "/stage"];
    let topics = ["/handles", "/stage", "/alerts", "/cues", "/status"];
    let chosen = [(&frames[..], 2, 1 << 20), (&frames, 5, 500), (&topics, 3, 400), (&topics, 6, 2000), (&topics, 4, 1)];
    chosen.map(|(topics, most, chunk)| packed(of(topics, most), Some(chunk), false).expect("a recording")).to_vec()
}

/// Returns a recording of these messages; the definitions of their types contain only fields.
fn packed(messages: Vec<Message>, chunk: Option<u64>, compressed: bool) -> Option<Vec<u8>> {
    let options = WriteOptions::new().profile("ros2").chunk_size(chunk).use_chunks(chunk.is_some());
    let options = options.compression(compressed.then_some(mcap::Compression::Zstd)).compression_threads(0);
    let mut writer: Writer<Cursor<Vec<u8>>> = options.create(Cursor::new(Vec::new())).ok()?;
    for Message { channel, sequence, log_time, publish_time, data } in messages {
        let schema = channel.schema.as_ref()?;
        let text = String::from_utf8_lossy(&schema.data);
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
        let fields: String =
            lines.filter(|line| !line.is_empty() && !line.contains('=')).map(|line| format!("{line}\n")).collect();
        let schema = writer.add_schema(&schema.name, &schema.encoding, fields.as_bytes()).ok()?;
        let id = writer.add_channel(schema, &channel.topic, &channel.message_encoding, &Default::default()).ok()?;
        let header = MessageHeader { channel_id: id, sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, &data).ok()?;
    }
    writer.finish().ok()?;
    Some(writer.into_inner().into_inner())
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    match random.u8(..8) {
        0 => changed(data, random),
        1 => repacked(data, random).unwrap_or_else(|| changed(data, random)),
        _ => rearranged(data, random).unwrap_or_else(|| changed(data, random)),
    }
}

/// Returns the messages in other chunks, compressed or not.
fn repacked(data: &[u8], random: &mut Rng) -> Option<Vec<u8>> {
    // The stream panics on damaged lengths ("capacity overflow"); a mended file has correct lengths.
    let (_, mended) = mend(data).ok()?;
    let messages: Option<Vec<Message>> = MessageStream::new(&mended).ok()?.map(Result::ok).collect();
    packed(
        messages.filter(|messages| !messages.is_empty())?,
        *one(&[Some(1), Some(300), Some(4000), None], random),
        random.bool(),
    )
}

/// Returns the records reordered, doubled, removed, in other chunks, in none, or with other content; the rest is
/// correct, except for at most one error.
fn rearranged(data: &[u8], random: &mut Rng) -> Option<Vec<u8>> {
    let mut records = parsed(data)?;
    records.retain(|record| record.opcode != MESSAGE_INDEX);
    for _ in 0..1 + random.usize(..3) {
        let chunks: Vec<usize> = (0..records.len()).filter(|at| records[*at].inner.is_some()).collect();
        let at = random.usize(..records.len().max(1));
        match random.u8(..5) {
            0 if !records.is_empty() => edit(&mut records, at, random),
            1 if !chunks.is_empty() => {
                // A record moves from a chunk to any place between the others.
                let inner = records[*one(&chunks, random)].inner.as_mut()?;
                if !inner.is_empty() {
                    let record = inner.remove(random.usize(..inner.len()));
                    let to = random.usize(..=records.len());
                    records.insert(to, record);
                }
            }
            2 if !chunks.is_empty() && records[at].inner.is_none() => {
                let record = records[at].clone();
                let inner = records[*one(&chunks, random)].inner.as_mut()?;
                let to = random.usize(..=inner.len());
                inner.insert(to, record);
            }
            _ if !chunks.is_empty() => {
                let inner = records[*one(&chunks, random)].inner.as_mut()?;
                if !inner.is_empty() {
                    let at = random.usize(..inner.len());
                    edit(inner, at, random);
                }
            }
            _ => (),
        }
    }
    let by = *one(&[1, 9, u64::MAX, u64::MAX - 8, 1 << 40, 1 << 63], random);
    let wrongs = [Wrong::Check, Wrong::Offset(by), Wrong::Length(by), Wrong::Counts(by), Wrong::NoIndex, Wrong::NoEnd];
    Some(written(&records, if random.u8(..4) == 0 { *one(&wrongs, random) } else { Wrong::Nothing }))
}

/// Changes a record among others.
fn edit(records: &mut Vec<Record>, at: usize, random: &mut Rng) {
    let other = random.usize(..records.len());
    match random.u8(..10) {
        0 => drop(records.remove(at)),
        1 => records.insert(at, records[other].clone()),
        2 => records.swap(at, other),
        3 => records[at].body.clear(),
        4 => records[at].opcode = *one(&[MESSAGE, CHANNEL, SCHEMA, CHUNK, MESSAGE_INDEX, ATTACHMENT, 13, 0x80], random),
        5 | 6 => {
            // A number of eight or four bytes: a field of a message or of a frame's header.
            const NUMBERS: [(usize, usize); 18] = [
                (2, 4),
                (6, 8),
                (14, 8),
                (50, 8),
                (58, 8),
                (66, 8),
                (74, 8),
                (90, 8),
                (98, 8),
                (106, 8),
                (114, 8),
                (122, 4),
                (126, 4),
                (130, 4),
                (134, 4),
                (138, 4),
                (146, 4),
                (150, 8),
            ];
            let Record { opcode, body, .. } = &mut records[at];
            let anywhere = (4 * random.usize(..body.len() / 4 + 1), *one(&[4, 8], random));
            let (from, length) = if *opcode == MESSAGE { *one(&NUMBERS, random) } else { anywhere };
            let number = match random.u8(..6) {
                0 => f64::NAN.to_bits(),
                1 => f64::INFINITY.to_bits(),
                2 => random.u64(..10),
                3 => u64::MAX - random.u64(..3),
                4 => (100.0 * random.f64()).to_bits(),
                _ => random.u64(..),
            };
            let end = (from + length).min(body.len());
            if from < end {
                body[from..end].copy_from_slice(&number.to_le_bytes()[..end - from]);
            }
        }
        7 if records[at].opcode == MESSAGE && records[other].opcode == MESSAGE => {
            // The message moves to another channel.
            let channel: Vec<u8> = records[other].body.iter().take(2).copied().collect();
            let body = &mut records[at].body;
            body.splice(..channel.len().min(body.len()), channel);
        }
        _ => records[at].body = changed(&records[at].body, random),
    }
}
