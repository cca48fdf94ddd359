//! One MCAP file: its channels, its chunks, and its end.
//!
//! The channels are before the first chunk and again in it, so that one damaged copy does no harm. A chunk is half a
//! second of messages, or 4 MB of them. Once it is finished, a chunk can be read whatever happens to the rest.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Seek, Write};
use std::ops::Range;
use std::time::{Duration, Instant};

use byteorder::LittleEndian;
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use serde::Serialize;

use super::disk::Disk;
use bench_dragon_ros2_messages::MessageType;
use bench_dragon_ros2_messages::settings::{Durability, Qos, Reliability, Topic};

/// The longest wait of messages for the end of their chunk. A kill may cost at most a second; the rest is a margin for
/// a busy machine.
const CHUNK_INTERVAL: Duration = Duration::from_millis(500);
/// The bytes of messages after which a chunk ends early: readers hold whole chunks in memory.
const CHUNK_BYTES: u64 = 4 << 20;
/// The interval at which the file is synchronised to the disk.
const SYNC_INTERVAL: Duration = Duration::from_secs(10);
/// An upper bound of a message's bytes besides its own: its header and its entries in two indexes.
const MESSAGE_OVERHEAD: u64 = 80;
/// An upper bound of the bytes of a chunk's index.
const CHUNK_INDEX_BYTES: u64 = 512;
/// An upper bound of the bytes of a file's end besides channels and indexes, and of an attachment.
const END_BYTES: u64 = 64 << 10;
/// zstd's default: handles are nearly random, so higher levels take much longer and save nothing.
const COMPRESSION_LEVEL: u32 = 3;
/// The metadata from which `ros2 bag info` takes the distribution, as rosbag2 writes it at the start of a bag. Its
/// other values come from the file's statistics. Since version 9 the quality of service is in words.
const ROSBAG2_METADATA: &str = "\
version: 8
storage_identifier: mcap
duration:
  nanoseconds: 0
starting_time:
  nanoseconds_since_epoch: 0
message_count: 0
topics_with_message_count: []
compression_format: \"\"
compression_mode: \"\"
relative_file_paths: []
files: []
custom_data: ~
ros_distro: jazzy
";
/// CDR, little-endian.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Encoded messages that go into one file together.
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
    /// Empties the batch and keeps its memory.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.messages.clear();
    }

    /// Adds a message of the time `stamp_ns`.
    pub fn push(&mut self, topic: Topic, stamp_ns: u64, sequence: u32, message: &impl Serialize) {
        let start = self.bytes.len();
        self.bytes.extend(ENCAPSULATION);
        // Fails for a list with more than 2^32 entries, which no message has.
        if cdr_encoding::to_writer::<_, LittleEndian, _>(&mut self.bytes, message).is_err() {
            self.bytes.truncate(start);
            return;
        }
        self.messages.push(Encoded { topic, sequence, stamp_ns, bytes: start..self.bytes.len() });
    }

    /// Returns an upper bound of the messages' bytes in a file, uncompressed.
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
    /// An upper bound of the open chunk's bytes, and the time of its start.
    pending: u64,
    chunk_began: Instant,
    chunks: u64,
    end_bytes: u64,
    synced: Instant,
}

impl McapFile {
    /// Starts a file with a channel for each topic of the publisher `name`.
    ///
    /// # Errors
    /// A failed write.
    pub fn new(file: File, name: &str, topics: &[Topic], limit: Option<u64>) -> Result<Self, io::Error> {
        let disk = Disk::new(file);
        // The check of all data would lack the bytes written below. Chunks and attachments have their own checks.
        let options = options().calculate_data_section_crc(false);
        let mut bare = options.clone().use_chunks(false).create(NoSeek::new(Vec::new())).map_err(io_error)?;
        add_channels(&mut bare, name, topics)?;
        let bare = bare.into_inner().into_inner();
        let mut writer = options.create(disk.clone()).map_err(io_error)?;
        // The bytes in `bare` and the bytes in `disk` begin with the same header.
        let channel_bytes = bare.get(disk.position() as usize..).unwrap_or_default();
        disk.clone().write_all(channel_bytes)?;
        let metadata = BTreeMap::from([("serialized_metadata".to_owned(), ROSBAG2_METADATA.to_owned())]);
        writer.write_metadata(&Metadata { name: "rosbag2".to_owned(), metadata }).map_err(io_error)?;
        let channels = add_channels(&mut writer, name, topics)?;
        // A recorder that is killed within its first second leaves an empty recording in place of an empty file.
        disk.clone().flush()?;
        // The channels are in the first chunk and in the end.
        let end_bytes = END_BYTES + channel_bytes.len() as u64;
        let (now, pending) = (Instant::now(), end_bytes);
        let (chunk_began, synced) = (now, now);
        Ok(Self { writer, disk, channels, limit, pending, chunk_began, chunks: 0, end_bytes, synced })
    }

    /// Returns true if the messages fit into the file's limit. An empty file can be too small as well.
    ///
    /// # Errors
    /// A failed write.
    pub fn has_room(&mut self, batch: &Batch) -> io::Result<bool> {
        let Some(limit) = self.limit else { return Ok(true) };
        if self.bytes_with(batch.bound()) > limit {
            // A finished chunk is smaller, since compressed.
            self.end_chunk()?;
        }
        Ok(self.bytes_with(batch.bound()) <= limit)
    }

    /// Writes messages, all of them or none, with their own log times or `log_time`. Returns the number of messages of
    /// this file's topics.
    ///
    /// # Errors
    /// A failed write.
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

    /// Writes an attachment between two chunks.
    ///
    /// # Errors
    /// A failed write.
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

    /// Ends the chunk and synchronises the file, each if it is due.
    ///
    /// # Errors
    /// A failed write.
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

    /// Writes the index and ends the file. Returns its size.
    ///
    /// # Errors
    /// A failed write. The file then has every finished chunk and no end.
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

    /// Returns the bytes so far.
    pub fn bytes(&self) -> u64 {
        self.disk.position()
    }

    /// Returns an upper bound of the finished file's size if `more` bytes of messages are added.
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

/// Adds a channel for each topic of the publisher `name`. Returns the channels' numbers.
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

/// Returns the options of every file of this program.
pub(super) fn options() -> WriteOptions {
    WriteOptions::library(WriteOptions::new(), concat!("bench-dragon ", env!("CARGO_PKG_VERSION")))
        .profile("ros2")
        .compression(Some(Compression::Zstd))
        .compression_level(COMPRESSION_LEVEL)
        .compression_threads(0)
        .chunk_size(None)
        .disable_seeking(true)
}

/// Converts an error of the library to an I/O error.
pub(super) fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

/// Returns a quality of service in the format of rosbag2, with the numbers of rmw, which every version reads.
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
