//! Mends a recording that was cut: by a kill, a full disk or a loss of power.
//!
//! In: the bytes that are there. Out: a whole file with every message of every finished chunk, in order, and none besides. Called by the command `record --recover`.

use std::collections::HashMap;
use std::io::{self, Read, Write};

use mcap::read::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::write::NoSeek;
use mcap::{Attachment, MAGIC, McapError, Writer};
use serde::Serialize;

use super::file::{io_error, options};

/// A longer record is taken for damage: a chunk is to fit into memory.
const MOST_RECORD_BYTES: u64 = 1 << 30;
/// Bytes of an attachment's record besides its two names and its data.
const ATTACHMENT_BYTES: usize = 36;

/// What was kept of a recording, and what not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Recovered {
    /// Finished chunks.
    pub chunks: u64,
    /// Messages.
    pub messages: u64,
    /// Attachments.
    pub attachments: u64,
    /// Chunks and attachments whose content does not agree with its check.
    pub damaged: u64,
    /// Messages whose channel was in a damaged chunk.
    pub unknown: u64,
    /// Bytes after the last whole record.
    pub lost_bytes: u64,
    /// Whether the data were whole: nothing had been cut off.
    pub whole: bool,
}

/// Why a recording was not mended.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// It is no MCAP.
    #[error("it does not begin as MCAP does, expected a recording")]
    NotMcap,
    /// Its chunks cannot be read.
    #[error("its chunks are compressed by {0}, expected zstd or none")]
    Compression(String),
    /// It cannot be read.
    #[error("{0}, expected a recording to read")]
    Read(io::Error),
    /// The mended one cannot be written.
    #[error("{0}")]
    Write(io::Error),
}

impl From<McapError> for RecoverError {
    fn from(error: McapError) -> Self {
        Self::Write(io_error(error))
    }
}

/// Reads the first bytes of a recording.
///
/// # Errors
/// [`RecoverError::NotMcap`], [`RecoverError::Read`]
pub fn check_magic(mut input: impl Read) -> Result<(), RecoverError> {
    let mut magic = Vec::new();
    input.by_ref().take(MAGIC.len() as u64).read_to_end(&mut magic).map_err(RecoverError::Read)?;
    if magic == MAGIC { Ok(()) } else { Err(RecoverError::NotMcap) }
}

/// Writes what is whole of a recording of `length` bytes, and an end. `input` is what follows [`check_magic`].
///
/// # Errors
/// [`RecoverError`]
pub fn recover(input: impl Read, length: u64, output: impl Write) -> Result<Recovered, RecoverError> {
    let mut input = Records { input, left: length.saturating_sub(MAGIC.len() as u64), body: Vec::new() };
    let mut first = input.next()?;
    let mut made = options();
    if let Some((op::HEADER, body)) = first
        && let Ok(Record::Header(header)) = parse_record(op::HEADER, body)
    {
        made = made.profile(header.profile).library(header.library);
        first = None;
    }
    let writer = made.create(NoSeek::new(output))?;
    let mut mender =
        Mender { writer, schemas: HashMap::new(), channels: HashMap::new(), recovered: Recovered::default() };
    if let Some((opcode, body)) = first {
        mender.keep(opcode, body)?;
    }
    while let Some((opcode, body)) = input.next()? {
        // What follows is an index of what has been kept.
        if matches!(opcode, op::DATA_END | op::FOOTER) {
            mender.recovered.whole = true;
            break;
        }
        mender.keep(opcode, body)?;
    }
    let Mender { mut writer, mut recovered, .. } = mender;
    if !recovered.whole {
        recovered.lost_bytes = input.left;
    }
    writer.finish()?;
    Ok(recovered)
}

/// The records of a file, as far as they are whole.
struct Records<Input> {
    input: Input,
    /// Bytes that follow.
    left: u64,
    body: Vec<u8>,
}

impl<Input: Read> Records<Input> {
    /// The next record's opcode and content; `None` where what follows is no whole record.
    fn next(&mut self) -> Result<Option<(u8, &[u8])>, RecoverError> {
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
        // Zeros are what a loss of power leaves of a file that was about to grow.
        if opcode == 0 || length > (self.left - HEAD).min(MOST_RECORD_BYTES) || !self.fill(length)? {
            return Ok(None);
        }
        self.left -= HEAD + length;
        Ok(Some((opcode, &self.body)))
    }

    /// Reads so many bytes, or fewer at the end of the file; whether they were there.
    fn fill(&mut self, length: u64) -> Result<bool, RecoverError> {
        self.body.clear();
        let read = self.input.by_ref().take(length).read_to_end(&mut self.body).map_err(RecoverError::Read)?;
        Ok(read as u64 == length)
    }
}

/// Writes what is kept.
struct Mender<Output: Write> {
    writer: Writer<NoSeek<Output>>,
    /// From the file's numbers to those of the mended one.
    schemas: HashMap<u16, u16>,
    channels: HashMap<u16, u16>,
    recovered: Recovered,
}

impl<Output: Write> Mender<Output> {
    /// Keeps a whole record of the file.
    fn keep(&mut self, opcode: u8, body: &[u8]) -> Result<(), RecoverError> {
        if opcode == op::ATTACHMENT && !is_attachment(body) {
            self.recovered.damaged += 1;
            return Ok(());
        }
        if opcode != op::CHUNK {
            return match parse_record(opcode, body) {
                Ok(record) => self.keep_record(record),
                Err(_) => {
                    self.recovered.damaged += 1;
                    Ok(())
                }
            };
        }
        // All of it is read before any of it is kept: its check comes last.
        match records_of_chunk(body) {
            Ok(records) => {
                self.recovered.chunks += 1;
                records.into_iter().try_for_each(|record| self.keep_record(record))?;
                Ok(self.writer.flush()?)
            }
            Err(McapError::UnsupportedCompression(name)) => Err(RecoverError::Compression(name)),
            Err(_) => {
                self.recovered.damaged += 1;
                Ok(())
            }
        }
    }

    /// Keeps what is no chunk.
    fn keep_record(&mut self, record: Record<'_>) -> Result<(), RecoverError> {
        match record {
            Record::Schema { header, data } => {
                let id = self.writer.add_schema(&header.name, &header.encoding, &data)?;
                self.schemas.insert(header.id, id);
            }
            Record::Channel(channel) => {
                // Number 0 is that of no schema.
                let schema =
                    if channel.schema_id == 0 { Some(0) } else { self.schemas.get(&channel.schema_id).copied() };
                if let Some(schema) = schema {
                    let (topic, encoding) = (&channel.topic, &channel.message_encoding);
                    let id = self.writer.add_channel(schema, topic, encoding, &channel.metadata)?;
                    self.channels.insert(channel.id, id);
                }
            }
            Record::Message { mut header, data } => match self.channels.get(&header.channel_id) {
                Some(channel) => {
                    header.channel_id = *channel;
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
            // Indexes are made anew.
            _ => (),
        }
        Ok(())
    }
}

/// The schemas, channels and messages of a chunk.
pub(super) fn records_of_chunk(body: &[u8]) -> Result<Vec<Record<'static>>, McapError> {
    let mut head = vec![op::CHUNK];
    head.extend((body.len() as u64).to_le_bytes());
    let mut chunk = head.as_slice().chain(body);
    let options = LinearReaderOptions::default().with_skip_start_magic(true).with_skip_end_magic(true);
    let options = options.with_validate_chunk_crcs(true).with_record_length_limit(MOST_RECORD_BYTES as usize);
    let mut reader = LinearReader::new_with_options(options);
    let mut records = Vec::new();
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(need) => {
                let read = chunk.read(reader.insert(need))?;
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

/// Whether the lengths in an attachment's record can be true, on which the parser relies.
fn is_attachment(body: &[u8]) -> bool {
    let text_at = |at: usize| {
        let length = body.get(at..at + 4)?;
        Some(u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize)
    };
    let names = text_at(16).and_then(|name| Some(name + text_at(20usize.checked_add(name)?)?));
    names.is_some_and(|names| names + ATTACHMENT_BYTES <= body.len())
}
