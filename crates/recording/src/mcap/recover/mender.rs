//! Writes the kept records of a damaged file.
//!
//! In: complete records, in the order of the file. Out: a complete file with the messages of the readable chunks, and
//! the counts.

use std::collections::BTreeMap;
use std::io::Write;

use mcap::read::parse_record;
use mcap::records::{self, Record, op};
use mcap::write::NoSeek;
use mcap::{Attachment, McapError, Schema, Writer};

use super::super::chunk::records_of_chunk;
use super::super::lengths::{is_attachment, is_chunk, message_index_entries};
use super::{DATA_END_BYTES, FOOTER_BYTES, RecoverError, Recovered};

/// The number of bytes of a record with the place of a part of the index.
const SUMMARY_OFFSET_BYTES: usize = 17;
/// Opcodes from here on are private to programs.
const FIRST_PRIVATE: u8 = 0x80;

/// Writes the kept records.
pub(super) struct Mender<Output: Write> {
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
    pub recovered: Recovered,
}

/// A channel of the file.
struct Known {
    channel: records::Channel,
    /// Its number in the repaired file.
    id: Option<u16>,
}

impl<Output: Write> Mender<Output> {
    /// Creates a mender that has kept nothing.
    pub fn new(writer: Writer<NoSeek<Output>>) -> Self {
        let (schemas, channels) = (BTreeMap::new(), BTreeMap::new());
        let (has_chunks, held, lost_chunk) = (false, None, false);
        Self { writer, schemas, channels, has_chunks, held, lost_chunk, recovered: Recovered::default() }
    }

    /// Keeps a chunk or an attachment that a search has found. Drops the held message: that record may have been no
    /// message, since the bytes behind it were damaged.
    pub fn keep_found(&mut self, opcode: u8, body: &[u8]) -> Result<(), RecoverError> {
        self.held = None;
        self.keep(opcode, body).map(drop)
    }

    /// Keeps a complete record of the file. Returns false for a damaged record.
    pub fn keep(&mut self, opcode: u8, body: &[u8]) -> Result<bool, RecoverError> {
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
    pub fn keep_record(&mut self, record: Record<'_>) -> Result<(), RecoverError> {
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
    pub fn finish(mut self) -> Result<Recovered, RecoverError> {
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
