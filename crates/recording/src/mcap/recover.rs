//! Repairs a recording that was cut by a kill, a full disk or a loss of power.
//!
//! In: the bytes of the file. Out: a complete file with exactly the messages of the finished chunks, in order. Called
//! by the command `record --recover`.

use std::collections::BTreeMap;
use std::io::{self, Read, Write};

use mcap::read::parse_record;
use mcap::records::{self, Header, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::write::NoSeek;
use mcap::{Attachment, MAGIC, McapError, Schema, WriteOptions, Writer};
use serde::Serialize;

use super::file::{io_error, options};

/// A longer record counts as damaged: a chunk must fit into memory.
const MOST_RECORD_BYTES: u64 = 1 << 30;
/// Bytes of the footer, and of the record that ends the messages.
const FOOTER_BYTES: usize = 20;
const DATA_END_BYTES: usize = 4;
/// Bytes of a record with the place of a part of the index.
const SUMMARY_OFFSET_BYTES: usize = 17;
/// Bytes of each message in the record that lists those of a chunk and a channel.
const MESSAGE_INDEX_ENTRY_BYTES: usize = 16;
/// Opcodes from here on are private to programs.
const FIRST_PRIVATE: u8 = 0x80;
/// Bytes of a chunk's record besides the name of its compression and its records.
const CHUNK_BYTES: usize = 40;
/// Bytes of an attachment's record besides its two names and its data.
const ATTACHMENT_BYTES: usize = 36;

/// The counts of a repair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Recovered {
    /// Finished chunks.
    pub chunks: u64,
    /// Messages.
    pub messages: u64,
    /// Attachments.
    pub attachments: u64,
    /// Records that cannot be of their type, or that fail their check.
    pub damaged: u64,
    /// Messages of damaged chunks, as far as their indexes count them.
    pub lost_messages: u64,
    /// Messages whose channel cannot be read.
    pub unknown: u64,
    /// Bytes from the first unreadable record to the end.
    pub lost_bytes: u64,
    /// True if the file has its end.
    pub whole: bool,
}

/// The reason why a recording was not repaired.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// The file is no MCAP.
    #[error("it does not begin as MCAP does, expected a recording")]
    NotMcap,
    /// The compression of its chunks is unknown.
    #[error("its chunks are compressed by {0}, expected zstd or none")]
    Compression(String),
    /// The file cannot be read.
    #[error("{0}, expected a recording to read")]
    Read(io::Error),
    /// The repaired file cannot be written.
    #[error("{0}")]
    Write(io::Error),
}

impl From<McapError> for RecoverError {
    fn from(error: McapError) -> Self {
        Self::Write(io_error(error))
    }
}

/// Checks the first bytes of a recording.
///
/// # Errors
/// [`RecoverError::NotMcap`], [`RecoverError::Read`]
pub fn check_magic(mut input: impl Read) -> Result<(), RecoverError> {
    let mut magic = Vec::new();
    input.by_ref().take(MAGIC.len() as u64).read_to_end(&mut magic).map_err(RecoverError::Read)?;
    if magic == MAGIC { Ok(()) } else { Err(RecoverError::NotMcap) }
}

/// Writes the complete records of a recording of `length` bytes, and an end. `input` starts after [`check_magic`].
///
/// # Errors
/// [`RecoverError`]
pub fn recover(input: impl Read, length: u64, output: impl Write) -> Result<Recovered, RecoverError> {
    let mut input = Records { input, left: length.saturating_sub(MAGIC.len() as u64), body: Vec::new() };
    let mut opcode = input.next()?;
    let mut made = options();
    if opcode == Some(op::HEADER)
        && let Ok(Record::Header(Header { profile, library })) = parse_record(op::HEADER, &input.body)
    {
        made = WriteOptions::library(made.profile(profile), library);
        opcode = input.next()?;
    }
    let writer = made.create(NoSeek::new(output))?;
    let (schemas, channels) = (BTreeMap::new(), BTreeMap::new());
    let recovered = Recovered::default();
    let (has_chunks, held, lost_chunk) = (false, None, false);
    let mut mender = Mender { writer, schemas, channels, has_chunks, held, lost_chunk, recovered };
    let mut in_index = false;
    while let Some(found) = opcode {
        match (found, input.body.len()) {
            (op::FOOTER, FOOTER_BYTES) if input.left == MAGIC.len() as u64 => {
                mender.recovered.whole = input.fill(MAGIC.len() as u64)? && input.body == MAGIC;
                break;
            }
            // The index follows, which is rebuilt.
            (op::DATA_END, DATA_END_BYTES) => in_index = true,
            _ if in_index => (),
            _ => mender.keep(found, &input.body)?,
        }
        opcode = input.next()?;
    }
    mender.recovered.lost_bytes = if mender.recovered.whole { 0 } else { input.left };
    mender.finish()
}

/// The complete records of a file.
struct Records<Input> {
    input: Input,
    /// The remaining bytes.
    left: u64,
    /// The content of the record.
    body: Vec<u8>,
}

impl<Input: Read> Records<Input> {
    /// Reads the next record. Returns its opcode, or `None` without a complete record.
    fn next(&mut self) -> Result<Option<u8>, RecoverError> {
        const HEAD: u64 = 9;
        if self.left < HEAD {
            return Ok(None);
        }
        let mut head = [0; HEAD as usize];
        if !self.fill(HEAD)? {
            return Ok(None);
        }
        head.copy_from_slice(&self.body);
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        // A loss of power can leave zeros at the end of a growing file.
        if opcode == 0 || length > (self.left - HEAD).min(MOST_RECORD_BYTES) || !self.fill(length)? {
            return Ok(None);
        }
        self.left -= HEAD + length;
        Ok(Some(opcode))
    }

    /// Fills the buffer with `length` bytes. Returns false at the end of the file.
    fn fill(&mut self, length: u64) -> Result<bool, RecoverError> {
        self.body.clear();
        let read = self.input.by_ref().take(length).read_to_end(&mut self.body).map_err(RecoverError::Read)?;
        Ok(read as u64 == length)
    }
}

/// Writes the kept records.
struct Mender<Output: Write> {
    writer: Writer<NoSeek<Output>>,
    /// By the file's numbers; the latest definition holds. Those before the first chunk have no check and are repeated
    /// in it.
    schemas: BTreeMap<u16, Schema<'static>>,
    channels: BTreeMap<u16, Known>,
    /// True after the first chunk, even a damaged one: messages are then in chunks.
    has_chunks: bool,
    /// The last message outside of chunks, kept only if no index follows.
    held: Option<Record<'static>>,
    /// True if the next indexes are of a damaged chunk.
    lost_chunk: bool,
    recovered: Recovered,
}

/// A channel of the file.
struct Known {
    channel: records::Channel,
    /// Its number in the repaired file.
    id: Option<u16>,
}

impl<Output: Write> Mender<Output> {
    /// Keeps a complete record of the file.
    fn keep(&mut self, opcode: u8, body: &[u8]) -> Result<(), RecoverError> {
        // An index belongs to a chunk, even a damaged one.
        let is_index = opcode == op::MESSAGE_INDEX && message_index_entries(body).is_some();
        self.has_chunks |= is_index || opcode == op::CHUNK && is_chunk(body);
        match self.held.take() {
            // The message was a chunk with a damaged opcode.
            Some(_) if is_index => {
                self.recovered.damaged += 1;
                self.lost_chunk = true;
            }
            Some(message) => self.keep_record(message)?,
            None => (),
        }
        let kept = match opcode {
            // The whole chunk is read before any record is kept: its check comes last.
            op::CHUNK => match records_of_chunk(body) {
                Ok(records) => {
                    self.has_chunks = true;
                    self.recovered.chunks += 1;
                    records.into_iter().try_for_each(|record| self.keep_record(record))?;
                    self.writer.flush()?;
                    true
                }
                Err(McapError::UnsupportedCompression(name)) if name == "lz4" => {
                    return Err(RecoverError::Compression(name));
                }
                Err(_) => false,
            },
            FIRST_PRIVATE.. => {
                self.writer.write_private_record(opcode, body, Default::default())?;
                true
            }
            _ if !self.is_possible(opcode, body) => false,
            _ => match parse_record(opcode, body) {
                Ok(message @ Record::Message { .. }) => {
                    self.held = Some(message.into_owned());
                    true
                }
                Ok(record) => {
                    self.keep_record(record)?;
                    true
                }
                Err(_) => false,
            },
        };
        self.recovered.damaged += u64::from(!kept);
        match opcode {
            op::MESSAGE_INDEX if kept && self.lost_chunk => {
                self.recovered.lost_messages += message_index_entries(body).unwrap_or_default() as u64;
            }
            op::MESSAGE_INDEX => (),
            _ => self.lost_chunk = !kept,
        }
        Ok(())
    }

    /// Returns true if a record outside of chunks can be of its type. The parser may accept a record with a damaged
    /// opcode.
    fn is_possible(&self, opcode: u8, body: &[u8]) -> bool {
        match opcode {
            // A file has all its messages in chunks, or none.
            op::MESSAGE => !self.has_chunks,
            op::MESSAGE_INDEX => message_index_entries(body).is_some(),
            op::ATTACHMENT => is_attachment(body),
            op::SUMMARY_OFFSET => body.len() == SUMMARY_OFFSET_BYTES,
            op::DATA_END => body.len() == DATA_END_BYTES,
            op::FOOTER => body.len() == FOOTER_BYTES,
            op::HEADER..=op::DATA_END => true,
            _ => false,
        }
    }

    /// Keeps a record that is no chunk.
    fn keep_record(&mut self, record: Record<'_>) -> Result<(), RecoverError> {
        match record {
            Record::Schema { header, data } => {
                let (id, name, encoding) = (header.id, header.name, header.encoding);
                let schema = Schema { id, name, encoding, data: data.into_owned().into() };
                if self.schemas.get(&id) != Some(&schema) {
                    self.schemas.insert(id, schema);
                    self.channels.values_mut().for_each(|known| known.id = None);
                }
            }
            Record::Channel(channel) => {
                let is_known = self.channels.get(&channel.id).is_some_and(|known| known.channel == channel);
                if !is_known {
                    self.channels.insert(channel.id, Known { channel, id: None });
                }
            }
            Record::Message { mut header, data } => match self.channel(header.channel_id)? {
                Some(channel) => {
                    header.channel_id = channel;
                    self.writer.write_to_known_channel(&header, &data)?;
                    self.recovered.messages += 1;
                }
                None => self.recovered.unknown += 1,
            },
            Record::Attachment { header, data, .. } => {
                let (log_time, create_time) = (header.log_time, header.create_time);
                let (name, media_type) = (header.name, header.media_type);
                self.writer.attach(&Attachment { log_time, create_time, name, media_type, data })?;
                self.recovered.attachments += 1;
            }
            Record::Metadata(metadata) => self.writer.write_metadata(&metadata)?,
            // Indexes are rebuilt.
            _ => (),
        }
        Ok(())
    }

    /// Returns the number in the repaired file of the file's channel `id`. The channel is added with its first message,
    /// when its definition is complete.
    fn channel(&mut self, id: u16) -> Result<Option<u16>, RecoverError> {
        let Some(Known { channel, id }) = self.channels.get_mut(&id) else { return Ok(None) };
        if id.is_some() {
            return Ok(*id);
        }
        // Number 0 means no schema.
        let schema = match self.schemas.get(&channel.schema_id) {
            Some(schema) => self.writer.add_schema(&schema.name, &schema.encoding, &schema.data)?,
            None if channel.schema_id == 0 => 0,
            None => return Ok(None),
        };
        *id = Some(self.writer.add_channel(schema, &channel.topic, &channel.message_encoding, &channel.metadata)?);
        Ok(*id)
    }

    /// Adds the channels without messages and ends the repaired file.
    fn finish(mut self) -> Result<Recovered, RecoverError> {
        if let Some(message) = self.held.take() {
            self.keep_record(message)?;
        }
        let ids: Vec<u16> = self.channels.keys().copied().collect();
        for id in ids {
            self.channel(id)?;
        }
        self.writer.finish()?;
        Ok(self.recovered)
    }
}

/// Returns the schemas, channels and messages of a chunk.
pub(super) fn records_of_chunk(body: &[u8]) -> Result<Vec<Record<'static>>, McapError> {
    if !is_filled(body)? {
        return Err(McapError::UnexpectedEoc);
    }
    let mut head = vec![op::CHUNK];
    head.extend((body.len() as u64).to_le_bytes());
    let mut left = head.len() + body.len();
    let mut chunk = head.as_slice().chain(body);
    let options = LinearReaderOptions::default().with_skip_start_magic(true).with_skip_end_magic(true);
    let options = options.with_validate_chunk_crcs(true).with_record_length_limit(MOST_RECORD_BYTES as usize);
    let mut reader = LinearReader::new_with_options(options);
    let mut records = Vec::new();
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(need) => {
                // The reader requests 128 kB at a time and clears that much memory.
                let read = chunk.read(reader.insert(need.min(left)))?;
                left -= read;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { data, opcode: opcode @ (op::SCHEMA | op::CHANNEL | op::MESSAGE) } => {
                records.push(parse_record(opcode, data)?.into_owned());
            }
            LinearReadEvent::Record { .. } => (),
        }
    }
    Ok(records)
}

/// Returns true if the last record of an uncompressed chunk ends with the chunk: mcap 0.26.0 subtracts the records'
/// lengths unchecked. A decompressor finds the end of any other chunk.
fn is_filled(body: &[u8]) -> Result<bool, McapError> {
    let Record::Chunk { header, data } = parse_record(op::CHUNK, body)? else { return Ok(false) };
    let mut left = if header.compression.is_empty() { &*data } else { &[] };
    while let Some(([_, length @ ..], rest)) = left.split_first_chunk::<9>() {
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
        let Some((_, rest)) = rest.split_at_checked(length) else { return Ok(false) };
        left = rest;
    }
    Ok(left.is_empty())
}

/// Returns true if the lengths in a chunk's record agree, as they do not after damage of an opcode.
fn is_chunk(body: &[u8]) -> bool {
    match parse_record(op::CHUNK, body) {
        Ok(Record::Chunk { header, data }) => CHUNK_BYTES + header.compression.len() + data.len() == body.len(),
        _ => false,
    }
}

/// Returns the number of messages in a message index, or `None` for another record.
fn message_index_entries(body: &[u8]) -> Option<usize> {
    let (_, list) = body.split_at_checked(2)?;
    let (length, entries) = list.split_first_chunk()?;
    let count = entries.len() / MESSAGE_INDEX_ENTRY_BYTES;
    let agrees =
        u32::from_le_bytes(*length) as usize == entries.len() && count * MESSAGE_INDEX_ENTRY_BYTES == entries.len();
    agrees.then_some(count)
}

/// Returns true if the lengths in an attachment's record agree: the parser relies on them.
fn is_attachment(body: &[u8]) -> bool {
    let text_at = |at: usize| {
        let length = body.get(at..at + 4)?;
        Some(u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize)
    };
    let names = text_at(16).and_then(|name| Some(name + text_at(20usize.checked_add(name)?)?));
    names.is_some_and(|names| names + ATTACHMENT_BYTES <= body.len())
}
