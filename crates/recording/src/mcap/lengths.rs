//! The lengths within records: a record whose lengths do not agree is damaged. The parser of mcap 0.26.0 relies on the
//! lengths of an attachment and panics where they do not agree.

use mcap::read::parse_record;
use mcap::records::{Record, op};

/// The number of bytes of each message in the record that lists the messages of a chunk and a channel.
const MESSAGE_INDEX_ENTRY_BYTES: usize = 16;
/// The number of bytes of a chunk's record besides the name of its compression and its records.
pub(super) const CHUNK_BYTES: usize = 40;
/// The number of bytes of an attachment's record besides its two names and its data.
pub(super) const ATTACHMENT_BYTES: usize = 36;

/// Returns true for a record whose length agrees with the lengths in it.
pub(super) fn has_right_length(opcode: u8, body: &[u8]) -> bool {
    match opcode {
        op::CHUNK => is_chunk(body),
        op::MESSAGE_INDEX => message_index_entries(body).is_some(),
        op::ATTACHMENT => is_attachment(body),
        _ => false,
    }
}

/// Returns true if the lengths in a chunk's record agree, as they do not after damage of an opcode.
pub(super) fn is_chunk(body: &[u8]) -> bool {
    match parse_record(op::CHUNK, body) {
        Ok(Record::Chunk { header, data }) => CHUNK_BYTES + header.compression.len() + data.len() == body.len(),
        _ => false,
    }
}

/// Returns the number of messages in a message index, or `None` for another record.
pub(super) fn message_index_entries(body: &[u8]) -> Option<usize> {
    let (_, list) = body.split_at_checked(2)?;
    let (length, entries) = list.split_first_chunk()?;
    let count = entries.len() / MESSAGE_INDEX_ENTRY_BYTES;
    let agrees =
        u32::from_le_bytes(*length) as usize == entries.len() && count * MESSAGE_INDEX_ENTRY_BYTES == entries.len();
    agrees.then_some(count)
}

/// Returns true if the lengths in an attachment's record agree: the parser relies on them.
pub(super) fn is_attachment(body: &[u8]) -> bool {
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
