//! The index at the end of a recording: its channels and chunks.
//!
//! The `SummaryReader` of mcap 0.26.0 reads the same records. It does not compare them with their check, so that a
//! recording would be played without a chunk that a damaged index does not list. It also reads chunks and attachments
//! here, whose parsers panic where damaged lengths do not agree.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Arc;

use mcap::read::ChannelAccumulator;
use mcap::records::{AttachmentIndex, ChunkIndex, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{Channel, MAGIC, McapError, parse_record};

use super::error::ReadError;

/// The number of bytes of the footer with the final magic, and of the record before the index.
const FOOTER_BYTES: usize = 37;
const DATA_END_BYTES: usize = 13;

/// The contents of the index.
#[derive(Default)]
pub(super) struct Index {
    pub channels: HashMap<u16, Arc<Channel<'static>>>,
    pub chunks: Vec<ChunkIndex>,
    pub attachments: Vec<AttachmentIndex>,
    /// Messages by channel, if the file counts them.
    pub counts: Option<BTreeMap<u16, u64>>,
}

/// Reads the index of a file and checks its bytes.
pub(super) fn index(file: &mut File, length: u64) -> Result<Index, ReadError> {
    let mut magic = [0; MAGIC.len()];
    file.seek(SeekFrom::Start(0))?;
    match file.read_exact(&mut magic) {
        Err(error) if error.kind() != io::ErrorKind::UnexpectedEof => return Err(error.into()),
        _ if magic != *MAGIC => return Err(ReadError::NotMcap),
        _ => (),
    }
    let at = length.checked_sub(FOOTER_BYTES as u64).ok_or(ReadError::NoEnd)?;
    let mut footer = [0; FOOTER_BYTES];
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(&mut footer)?;
    let begins = match footer.split_at(FOOTER_BYTES - MAGIC.len()) {
        ([op::FOOTER, _, _, _, _, _, _, _, _, begins @ ..], MAGIC) => begins.first_chunk(),
        _ => return Err(ReadError::NoEnd),
    };
    let begins = begins.map_or(0, |begins| u64::from_le_bytes(*begins));
    if begins == 0 {
        return Err(ReadError::NoIndex);
    }
    let damaged = |reason: &dyn Display| ReadError::Damaged { at, reason: reason.to_string() };
    let begins = begins.checked_sub(DATA_END_BYTES as u64).filter(|begins| *begins <= at);
    let begins = begins.ok_or_else(|| damaged(&"its index is elsewhere"))?;
    let mut bytes = vec![0; DATA_END_BYTES];
    file.seek(SeekFrom::Start(begins))?;
    file.read_exact(&mut bytes)?;
    // Behind another record the reader would not compare the index with its check.
    if !matches!(bytes[..], [op::DATA_END, 4, 0, 0, 0, 0, 0, 0, 0, ..]) {
        return Err(damaged(&"its index is elsewhere"));
    }
    file.read_to_end(&mut bytes)?;
    // A chunk is not expected here and is not read.
    let options = LinearReaderOptions::default().with_skip_start_magic(true).with_emit_chunks(true);
    let options = options.with_validate_summary_section_crc(true).with_record_length_limit(bytes.len());
    let (mut reader, mut left) = (LinearReader::new_with_options(options), bytes.as_slice());
    let (mut index, mut known, mut ids) = (Index::default(), ChannelAccumulator::default(), Vec::new());
    while let Some(event) = reader.next_event() {
        let record = match event.map_err(|error| damaged(&told(&error)))? {
            LinearReadEvent::ReadRequest(need) => {
                // The request is limited to the remaining bytes.
                let read = left.read(reader.insert(need.min(left.len())))?;
                reader.notify_read(read);
                continue;
            }
            LinearReadEvent::Record { opcode: op::ATTACHMENT, .. } => continue,
            LinearReadEvent::Record { data, opcode } => parse_record(opcode, data),
        };
        let added = record.map(Record::into_owned).and_then(|record| match record {
            Record::Schema { header, data } => known.add_schema(header, data),
            Record::Channel(channel) => {
                ids.push(channel.id);
                known.add_channel(channel)
            }
            Record::ChunkIndex(chunk) => {
                index.chunks.push(chunk);
                Ok(())
            }
            Record::AttachmentIndex(attachment) => {
                index.attachments.push(attachment);
                Ok(())
            }
            Record::Statistics(statistics) => {
                index.counts = Some(statistics.channel_message_counts);
                Ok(())
            }
            _ => Ok(()),
        });
        added.map_err(|error| damaged(&told(&error)))?;
    }
    index.channels = ids.into_iter().filter_map(|id| Some((id, known.get(id)?))).collect();
    let has_messages = index.counts.as_ref().is_some_and(|counts| counts.values().any(|count| *count > 0));
    if index.chunks.is_empty() && has_messages { Err(ReadError::NoIndex) } else { Ok(index) }
}

/// Returns the sentence of a reader's error, without names of the library.
pub(super) fn told(error: &McapError) -> String {
    match error {
        McapError::UnsupportedCompression(name) => format!("its chunks are compressed by {name}, expected zstd"),
        // binrw's sentences name its own types, over several lines.
        McapError::Parse(_) => "a record cannot be read".to_owned(),
        McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}
