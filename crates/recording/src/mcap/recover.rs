//! Repairs a recording that was cut by a kill, a full disk or a loss of power, or has damaged bytes.
//!
//! In: the bytes of the file. Out: a complete file with the messages of the finished chunks, in order, the attachments
//! and the metadata. A file without chunks keeps its messages. Records are read one after another. Behind a damaged
//! length the next record is the next chunk or attachment whose own lengths and check agree, so the repair needs no
//! readable summary.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom, Write};

use mcap::read::parse_record;
use mcap::records::{self, Header, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::write::NoSeek;
use mcap::{Attachment, MAGIC, McapError, Schema, WriteOptions, Writer};
use serde::Serialize;

use super::file::{io_error, options};

/// A longer record counts as damaged: a chunk must fit into memory.
const MOST_RECORD_BYTES: u64 = 1 << 30;
/// The number of bytes of a record before its content: its opcode and its length.
const HEAD_BYTES: usize = 9;
/// The number of bytes of the footer, and of the record that ends the messages.
const FOOTER_BYTES: usize = 20;
const DATA_END_BYTES: usize = 4;
/// The number of bytes of a record with the place of a part of the index.
const SUMMARY_OFFSET_BYTES: usize = 17;
/// The number of bytes of each message in the record that lists the messages of a chunk and a channel.
const MESSAGE_INDEX_ENTRY_BYTES: usize = 16;
/// Opcodes from here on are private to programs.
const FIRST_PRIVATE: u8 = 0x80;
/// The number of bytes of a chunk's record besides the name of its compression and its records.
const CHUNK_BYTES: usize = 40;
/// The number of bytes of a chunk's record before the name of its compression.
const CHUNK_NAME_AT: usize = 28;
/// The number of bytes of an attachment's record besides its two names and its data.
const ATTACHMENT_BYTES: usize = 36;
/// The number of bytes that are needed to know the length of a chunk: its head, and its content up to its records.
const CHUNK_HEAD_BYTES: usize = HEAD_BYTES + CHUNK_BYTES + "zstd".len();
/// The number of bytes that are searched at a time for the beginning of a chunk.
const BLOCK_BYTES: usize = 1 << 20;

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
    /// The number of bytes skipped after an invalid length, up to the next readable record or the end.
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

/// Writes the readable records of a recording of `length` bytes, and an end.
///
/// # Errors
/// [`RecoverError`]
pub fn recover(input: impl Read + Seek, length: u64, output: impl Write) -> Result<Recovered, RecoverError> {
    const FIRST: u64 = MAGIC.len() as u64;
    let mut input = Records { input, length, at: FIRST, body: Vec::new(), searched: FIRST, allowed: length };
    let ends = input.ends()?;
    let mut made = options();
    if input.seek(FIRST)?.next()? == Some(op::HEADER)
        && let Ok(Record::Header(Header { profile, library })) = parse_record(op::HEADER, &input.body)
    {
        made = WriteOptions::library(made.profile(profile), library);
    }
    let writer = made.create(NoSeek::new(output))?;
    let (schemas, channels) = (BTreeMap::new(), BTreeMap::new());
    let recovered = Recovered::default();
    let (has_chunks, held, lost_chunk) = (false, None, false);
    let mut mender = Mender { writer, schemas, channels, has_chunks, held, lost_chunk, recovered };
    if let Some([summary, footer]) = ends {
        input.seek(summary)?;
        while input.at < footer
            && let Some(opcode) = input.next()?
        {
            // The summary repeats the definitions: the first ones may be lost.
            if let (op::SCHEMA | op::CHANNEL, Ok(record)) = (opcode, parse_record(opcode, &input.body)) {
                mender.keep_record(record)?;
            }
        }
    }
    input.seek(FIRST)?;
    let mut in_index = false;
    loop {
        let begin = input.at;
        let read = input.next()?;
        let is_kept = match (read, input.body.len()) {
            (Some(op::FOOTER), FOOTER_BYTES) if input.at + MAGIC.len() as u64 == length => {
                mender.recovered.whole = input.fill(MAGIC.len() as u64)? && input.body == MAGIC;
                break;
            }
            // The index follows, which is rebuilt.
            (Some(op::DATA_END), DATA_END_BYTES) => {
                in_index = true;
                true
            }
            (Some(opcode), _) => in_index || mender.keep(opcode, &input.body)?,
            (None, _) => false,
        };
        let search_end = match read {
            Some(opcode) if has_right_length(opcode, &input.body) => {
                input.searched = input.at;
                mender.recovered.damaged += u64::from(!is_kept);
                continue;
            }
            Some(_) if is_kept => continue,
            Some(_) => input.at,
            None => length,
        };
        // The length may be wrong: then the next chunk or attachment is in this record or behind it.
        let found = if in_index { None } else { input.find(search_end)? };
        if let Some((at, opcode)) = found {
            mender.recovered.damaged += u64::from(at != begin);
            mender.recovered.lost_bytes += if read.is_none() { at.saturating_sub(begin) } else { 0 };
            mender.keep_found(opcode, &input.body)?;
        } else if read.is_some() {
            mender.recovered.damaged += 1;
        } else if let Some(at) = ends.into_iter().flatten().find(|at| *at > begin) {
            mender.recovered.damaged += 1;
            mender.recovered.lost_bytes += at - begin;
            in_index = true;
            input.seek(at)?;
        } else {
            mender.recovered.lost_bytes += length.saturating_sub(begin);
            break;
        }
    }
    mender.finish()
}

/// The records of a file.
struct Records<Input> {
    input: Input,
    /// The number of bytes of the file.
    length: u64,
    /// The byte after the last record read.
    at: u64,
    /// The content of the record.
    body: Vec<u8>,
    /// No chunk that is still to be found begins before this byte.
    searched: u64,
    /// The number of bytes of possible chunks that may still be read without success, so that a search costs no more
    /// than another reading of the file.
    allowed: u64,
}

impl<Input: Read + Seek> Records<Input> {
    /// Reads the next record. Returns its opcode, or `None` without a complete record.
    fn next(&mut self) -> Result<Option<u8>, RecoverError> {
        self.body.clear();
        let left = self.length.saturating_sub(self.at);
        let begin = self.at;
        if left >= HEAD_BYTES as u64 && self.fill(HEAD_BYTES as u64)? {
            let opcode = self.body.first().copied().unwrap_or_default();
            let length = self.body.last_chunk().map_or(0, |length| u64::from_le_bytes(*length));
            // A loss of power can leave zeros at the end of a growing file.
            if opcode != 0 && length <= (left - HEAD_BYTES as u64).min(MOST_RECORD_BYTES) && self.fill(length)? {
                return Ok(Some(opcode));
            }
        }
        self.seek(begin)?;
        Ok(None)
    }

    /// Fills the buffer with `length` bytes. Returns false at the end of the file.
    fn fill(&mut self, length: u64) -> Result<bool, RecoverError> {
        self.body.clear();
        let read = self.input.by_ref().take(length).read_to_end(&mut self.body).map_err(RecoverError::Read)?;
        self.at += read as u64;
        Ok(read as u64 == length)
    }

    /// Goes to a byte of the file.
    fn seek(&mut self, at: u64) -> Result<&mut Self, RecoverError> {
        self.input.seek(SeekFrom::Start(at)).map_err(RecoverError::Read)?;
        self.at = at;
        Ok(self)
    }

    /// Returns the bytes at which the index and the footer begin, or `None` for a file without its end.
    fn ends(&mut self) -> Result<Option<[u64; 2]>, RecoverError> {
        let Some(footer) = self.length.checked_sub((HEAD_BYTES + FOOTER_BYTES + MAGIC.len()) as u64) else {
            return Ok(None);
        };
        let is_footer = self.seek(footer)?.next()? == Some(op::FOOTER) && self.body.len() == FOOTER_BYTES;
        let summary = self.body.first_chunk().map_or(0, |summary| u64::from_le_bytes(*summary));
        let summary = if (1..footer).contains(&summary) { summary } else { footer };
        Ok((is_footer && self.fill(MAGIC.len() as u64)? && self.body == MAGIC).then_some([summary, footer]))
    }

    /// Reads the next chunk or attachment that begins before the byte `end`, from the last byte searched. Returns its
    /// beginning and its opcode. Without one, the next record stays the same.
    fn find(&mut self, end: u64) -> Result<Option<(u64, u8)>, RecoverError> {
        let (next, mut block) = (self.at, Vec::new());
        while self.searched < end {
            let start = self.searched;
            self.seek(start)?.fill((BLOCK_BYTES + CHUNK_HEAD_BYTES) as u64)?;
            std::mem::swap(&mut block, &mut self.body);
            for (at, head) in (start..end).zip(block.windows(CHUNK_HEAD_BYTES)).take(BLOCK_BYTES) {
                let left = self.length.saturating_sub(at + HEAD_BYTES as u64).min(self.allowed);
                let Some(length) = checked_length(head).filter(|length| *length <= left) else { continue };
                self.seek(at + HEAD_BYTES as u64)?.fill(length)?;
                if has_right_check(head[0], &self.body)? {
                    // If the two lengths of this record differ, the next chunk may begin before the record's end.
                    self.searched = if head[1..HEAD_BYTES] == length.to_le_bytes() { self.at } else { at + 1 };
                    return Ok(Some((at, head[0])));
                }
                self.allowed -= length;
            }
            self.searched = (start + BLOCK_BYTES as u64).min(end);
        }
        self.seek(next)?;
        Ok(None)
    }
}

/// Returns the length of a chunk or an attachment that may begin with these bytes. The length of a chunk follows from
/// the lengths in the chunk, since the length before it may be damaged.
fn checked_length(head: &[u8]) -> Option<u64> {
    let number = |at: usize| head.get(at..)?.first_chunk().map(|bytes| u64::from_le_bytes(*bytes));
    let length = match *head.first()? {
        op::CHUNK => {
            let name = head.get(HEAD_BYTES + CHUNK_NAME_AT..)?;
            let (size, name) =
                name.split_first_chunk().map(|(size, name)| (u32::from_le_bytes(*size) as usize, name))?;
            let is_known = [&b"zstd"[..], b"lz4", b""].iter().any(|known| name.get(..size) == Some(known));
            let records = number(HEAD_BYTES + CHUNK_BYTES - size_of::<u64>() + size).filter(|_| is_known)?;
            records.checked_add((CHUNK_BYTES + size) as u64).filter(|_| records > 0)?
        }
        op::ATTACHMENT => number(1).filter(|length| *length >= ATTACHMENT_BYTES as u64)?,
        _ => return None,
    };
    (length <= MOST_RECORD_BYTES).then_some(length)
}

/// Returns true for a chunk that can be read, or an attachment with a check that agrees.
fn has_right_check(opcode: u8, body: &[u8]) -> Result<bool, RecoverError> {
    match opcode {
        op::CHUNK => match records_of_chunk(body) {
            Err(McapError::UnsupportedCompression(name)) if name == "lz4" => Err(RecoverError::Compression(name)),
            records => Ok(records.is_ok_and(|records| !records.is_empty())),
        },
        _ => Ok(is_attachment(body) && !body.ends_with(&[0; 4]) && parse_record(opcode, body).is_ok()),
    }
}

/// Writes the kept records.
struct Mender<Output: Write> {
    writer: Writer<NoSeek<Output>>,
    /// By the file's numbers; the latest definition holds. Definitions before the first chunk have no check and are
    /// repeated in that chunk.
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
    /// Keeps a chunk or an attachment that a search has found. Drops the held message: that record may have been no
    /// message, since the bytes behind it were damaged.
    fn keep_found(&mut self, opcode: u8, body: &[u8]) -> Result<(), RecoverError> {
        self.held = None;
        self.keep(opcode, body).map(drop)
    }

    /// Keeps a complete record of the file. Returns false for a damaged record.
    fn keep(&mut self, opcode: u8, body: &[u8]) -> Result<bool, RecoverError> {
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
            op::CHUNK if !is_chunk(body) => false,
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
        match opcode {
            op::MESSAGE_INDEX if kept && self.lost_chunk => {
                self.recovered.lost_messages += message_index_entries(body).unwrap_or_default() as u64;
            }
            op::MESSAGE_INDEX => (),
            _ => self.lost_chunk = !kept,
        }
        Ok(kept)
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

/// Returns true for a record whose length agrees with the lengths in it.
fn has_right_length(opcode: u8, body: &[u8]) -> bool {
    match opcode {
        op::CHUNK => is_chunk(body),
        op::MESSAGE_INDEX => message_index_entries(body).is_some(),
        op::ATTACHMENT => is_attachment(body),
        _ => false,
    }
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
    let data = names.and_then(|names| Some((names + ATTACHMENT_BYTES, body.get(names + 24..)?.first_chunk()?)));
    data.is_some_and(|(rest, size)| {
        body.len().checked_sub(rest).map(|size| size as u64) == Some(u64::from_le_bytes(*size))
    })
}
