//! The chunks of a recording.
//!
//! In: the record of a chunk. Out: the schemas, channels and messages in it, if all of the chunk can be read.

use std::io::Read;

use mcap::McapError;
use mcap::read::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// A longer record counts as damaged: a chunk must fit into memory.
pub(super) const MOST_RECORD_BYTES: u64 = 1 << 30;

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
