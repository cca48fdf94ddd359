//! One MCAP file: its channels, its chunks, and its end.
//!
//! The channels stand before the first chunk and again in it: whichever is damaged, the others are of use. A chunk is half a
//! second of messages, or 4 MB of them: what is in a finished chunk can be read whatever happens to the rest. Called by the
//! [`recorder`](super::recorder).

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Seek, Write};
use std::ops::Range;
use std::time::{Duration, Instant};

use byteorder::LittleEndian;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use serde::Serialize;

use super::disk::Disk;
use bench_dragon_ros2_messages::MessageType;
use bench_dragon_ros2_messages::settings::{Durability, Qos, Reliability, Topic};

/// How long messages wait for the end of their chunk: less than the second that a kill may cost, by what a busy machine may keep
/// the processor from this one.
const CHUNK_INTERVAL: Duration = Duration::from_millis(500);
/// The bytes of messages after which a chunk ends early: readers hold whole chunks in memory.
const CHUNK_BYTES: u64 = 4 << 20;
/// How often what was written is forced to the disk.
const SYNC_INTERVAL: Duration = Duration::from_secs(10);
/// More bytes than a message has in a file besides its own: its header and its places in two indexes.
const MESSAGE_OVERHEAD: u64 = 80;
/// More bytes than the index of a chunk has.
const CHUNK_INDEX_BYTES: u64 = 512;
/// More bytes than the end of a file has besides channels and indexes, and than an attachment has.
const END_BYTES: u64 = 64 << 10;
/// zstd's own default: handles are nearly random to it, and higher levels take much longer and save nothing.
const COMPRESSION_LEVEL: u32 = 3;
/// CDR, little-endian.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Messages as bytes, which go into one file together.
#[derive(Debug, Default)]
pub struct Batch {
    bytes: Vec<u8>,
    messages: Vec<Encoded>,
}

/// A message of a batch.
#[derive(Debug)]
struct Encoded {
    topic: Topic,
    sequence: u32,
    stamp_ns: u64,
    bytes: Range<usize>,
}

impl Batch {
    /// Empties it; its memory is used again.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.messages.clear();
    }

    /// Adds a message of the time `stamp_ns`.
    pub fn push(&mut self, topic: Topic, stamp_ns: u64, sequence: u32, message: &impl Serialize) {
        let start = self.bytes.len();
        self.bytes.extend(ENCAPSULATION);
        // It fails where a list has more than 2^32 entries, which no message of the wire has.
        if cdr_encoding::to_writer::<_, LittleEndian, _>(&mut self.bytes, message).is_err() {
            self.bytes.truncate(start);
            return;
        }
        self.messages.push(Encoded { topic, sequence, stamp_ns, bytes: start..self.bytes.len() });
    }

    /// More bytes than the messages take in a file, uncompressed.
    fn bound(&self) -> u64 {
        self.bytes.len() as u64 + MESSAGE_OVERHEAD * self.messages.len() as u64
    }
}

/// An open file.
pub struct McapFile {
    writer: Writer<Disk>,
    disk: Disk,
    channels: BTreeMap<Topic, u16>,
    /// The size that the file must not exceed.
    limit: Option<u64>,
    /// A bound of the bytes of the open chunk, and when it was begun.
    pending: u64,
    chunk_began: Instant,
    chunks: u64,
    end_bytes: u64,
    synced: Instant,
}

impl McapFile {
    /// A file with a channel for each topic of the publisher `name`.
    ///
    /// # Errors
    /// What the disk says.
    pub fn new(file: File, name: &str, topics: &[Topic], limit: Option<u64>) -> Result<Self, io::Error> {
        let disk = Disk::new(file);
        // What it has not written itself would not be in its check of all data. Chunks and attachments have their own.
        let options = options().calculate_data_section_crc(false);
        let mut bare = options.clone().use_chunks(false).create(NoSeek::new(Vec::new())).map_err(io_error)?;
        add_channels(&mut bare, name, topics)?;
        let bare = bare.into_inner().into_inner();
        let mut writer = options.create(disk.clone()).map_err(io_error)?;
        // Both begin with the same header.
        let channel_bytes = bare.get(disk.position() as usize..).unwrap_or_default();
        disk.clone().write_all(channel_bytes)?;
        let channels = add_channels(&mut writer, name, topics)?;
        // A recorder that is killed within its first second leaves an empty recording, and no empty file.
        disk.clone().flush()?;
        // The channels are in the first chunk and in the end.
        let end_bytes = END_BYTES + channel_bytes.len() as u64;
        let (now, pending) = (Instant::now(), end_bytes);
        let (chunk_began, synced) = (now, now);
        Ok(Self { writer, disk, channels, limit, pending, chunk_began, chunks: 0, end_bytes, synced })
    }

    /// Whether these messages fit into a file of the size that it may have. An empty file takes any.
    ///
    /// # Errors
    /// What the disk says.
    pub fn has_room(&mut self, batch: &Batch) -> io::Result<bool> {
        let Some(limit) = self.limit else { return Ok(true) };
        if self.bytes_with(batch.bound()) > limit {
            // Compressed it is smaller.
            self.end_chunk()?;
        }
        Ok(self.bytes_with(batch.bound()) <= limit)
    }

    /// Writes messages: all of them, or none; how many are of this file's topics. They are logged at their own times or at
    /// `log_time`.
    ///
    /// # Errors
    /// What the disk says.
    pub fn append(&mut self, batch: &Batch, log_time: Option<u64>) -> io::Result<u64> {
        let more = batch.bound();
        self.disk.reserve(self.bytes_with(more))?;
        let mut written = 0;
        for Encoded { topic, sequence, stamp_ns, bytes } in &batch.messages {
            let Some(channel) = self.channels.get(topic) else { continue };
            let header = MessageHeader {
                channel_id: *channel,
                sequence: *sequence,
                log_time: log_time.unwrap_or(*stamp_ns),
                publish_time: *stamp_ns,
            };
            self.writer.write_to_known_channel(&header, &batch.bytes[bytes.clone()]).map_err(io_error)?;
            written += 1;
        }
        if self.pending == 0 {
            self.chunk_began = Instant::now();
        }
        self.pending += more;
        if self.pending >= CHUNK_BYTES {
            self.end_chunk()?;
        }
        Ok(written)
    }

    /// Writes what goes with the recording and is no message, between two chunks.
    ///
    /// # Errors
    /// What the disk says.
    pub fn attach(&mut self, name: &str, media_type: &str, time_ns: u64, data: &[u8]) -> io::Result<()> {
        self.end_chunk()?;
        let attached = self.writer.attach(&Attachment {
            log_time: time_ns,
            create_time: time_ns,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: data.into(),
        });
        attached.and_then(|()| self.writer.flush()).map_err(io_error)
    }

    /// Ends the chunk where that is due, and forces it to the disk where that is.
    ///
    /// # Errors
    /// What the disk says.
    pub fn maintain(&mut self) -> io::Result<()> {
        if self.pending > 0 && self.chunk_began.elapsed() >= CHUNK_INTERVAL {
            self.end_chunk()?;
        }
        if self.synced.elapsed() >= SYNC_INTERVAL {
            self.synced = Instant::now();
            self.disk.sync()?;
        }
        Ok(())
    }

    /// Ends the file with what readers need to find their way in it. Its size.
    ///
    /// # Errors
    /// What the disk says. Then the file has every chunk that was finished, and no end.
    pub fn finish(mut self) -> Result<u64, (u64, io::Error)> {
        let mut end = || -> Result<(), McapError> {
            self.writer.flush()?;
            self.writer.finish()?;
            Ok(self.disk.sync()?)
        };
        let ended = end();
        self.disk.release();
        match ended {
            Ok(()) => Ok(self.disk.position()),
            Err(error) => Err((self.disk.position(), io_error(error))),
        }
    }

    /// Bytes so far.
    pub fn bytes(&self) -> u64 {
        self.disk.position()
    }

    /// A bound of the size that the finished file has with so many more bytes of messages.
    fn bytes_with(&self, more: u64) -> u64 {
        self.disk.position() + self.pending + more + self.end_bytes + CHUNK_INDEX_BYTES * (self.chunks + 1)
    }

    fn end_chunk(&mut self) -> io::Result<()> {
        if self.pending > 0 {
            self.writer.flush().map_err(io_error)?;
            self.pending = 0;
            self.chunks += 1;
        }
        Ok(())
    }
}

/// Adds a channel for each topic of the publisher `name`; their numbers.
fn add_channels<Output: Write + Seek>(
    writer: &mut Writer<Output>,
    name: &str,
    topics: &[Topic],
) -> io::Result<BTreeMap<Topic, u16>> {
    let add = |topic: &Topic| {
        let of = MessageType::of(*topic);
        let schema = writer.add_schema(&of.ros_name(), "ros2msg", of.schema().as_bytes())?;
        let qos = BTreeMap::from([("offered_qos_profiles".to_owned(), qos_profile(topic.default_qos()))]);
        Ok((*topic, writer.add_channel(schema, &topic.path(name), "cdr", &qos)?))
    };
    topics.iter().map(add).collect::<Result<_, McapError>>().map_err(io_error)
}

/// What every file of this program is written with.
pub(super) fn options() -> WriteOptions {
    WriteOptions::library(WriteOptions::new(), concat!("bench-dragon ", env!("CARGO_PKG_VERSION")))
        .profile("ros2")
        .compression(Some(Compression::Zstd))
        .compression_level(COMPRESSION_LEVEL)
        .compression_threads(0)
        .chunk_size(None)
        .disable_seeking(true)
}

/// What the disk said, or what is wrong with the bytes.
pub(super) fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

/// A quality of service as rosbag2 keeps it, in the numbers of rmw, which every version of it reads.
fn qos_profile(qos: Qos) -> String {
    let reliability = match qos.reliability {
        Reliability::Reliable => 1,
        Reliability::BestEffort => 2,
    };
    let durability = match qos.durability {
        Durability::TransientLocal => 1,
        Durability::Volatile => 2,
    };
    let depth = qos.depth;
    let unlimited = |name: &str| format!("  {name}:\n    sec: 9223372036\n    nsec: 854775807\n");
    format!(
        "- history: 1\n  depth: {depth}\n  reliability: {reliability}\n  durability: {durability}\n{}{}  liveliness: 1\n{}  \
         avoid_ros_namespace_conventions: false\n",
        unlimited("deadline"),
        unlimited("lifespan"),
        unlimited("liveliness_lease_duration"),
    )
}
