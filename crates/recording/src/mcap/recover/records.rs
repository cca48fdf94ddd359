//! The records of a damaged file, one after another.
//!
//! In: the bytes of the file. Out: the next complete record; or, behind a damaged length, the next chunk or attachment
//! whose own lengths and check agree.

use std::io::{Read, Seek, SeekFrom};

use mcap::read::parse_record;
use mcap::records::op;
use mcap::{MAGIC, McapError};

use super::super::chunk::{MOST_RECORD_BYTES, records_of_chunk};
use super::super::lengths::{ATTACHMENT_BYTES, CHUNK_BYTES, is_attachment};
use super::{FOOTER_BYTES, RecoverError};

/// The number of bytes of a record before its content: its opcode and its length.
const HEAD_BYTES: usize = 9;
/// The number of bytes of a chunk's record before the name of its compression.
const CHUNK_NAME_AT: usize = 28;
/// The number of bytes that are needed to know the length of a chunk: its head, and its content up to its records.
const CHUNK_HEAD_BYTES: usize = HEAD_BYTES + CHUNK_BYTES + "zstd".len();
/// The number of bytes that are searched at a time for the beginning of a chunk.
const BLOCK_BYTES: usize = 1 << 20;

/// The first byte of the first record.
pub(super) const FIRST: u64 = MAGIC.len() as u64;

/// The records of a file.
pub(super) struct Records<Input> {
    input: Input,
    /// The number of bytes of the file.
    pub length: u64,
    /// The byte after the last record read.
    pub at: u64,
    /// The content of the record.
    pub body: Vec<u8>,
    /// No chunk that is still to be found begins before this byte.
    pub searched: u64,
    /// The number of bytes of possible chunks that may still be read without success, so that a search costs no more
    /// than another reading of the file.
    allowed: u64,
}

impl<Input: Read + Seek> Records<Input> {
    /// Creates the records of a file of `length` bytes. The first one is next.
    pub fn new(input: Input, length: u64) -> Self {
        Self { input, length, at: FIRST, body: Vec::new(), searched: FIRST, allowed: length }
    }

    /// Reads the next record. Returns its opcode, or `None` without a complete record.
    pub fn next(&mut self) -> Result<Option<u8>, RecoverError> {
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
    pub fn fill(&mut self, length: u64) -> Result<bool, RecoverError> {
        self.body.clear();
        let read = self.input.by_ref().take(length).read_to_end(&mut self.body).map_err(RecoverError::Read)?;
        self.at += read as u64;
        Ok(read as u64 == length)
    }

    /// Goes to a byte of the file.
    pub fn seek(&mut self, at: u64) -> Result<&mut Self, RecoverError> {
        self.input.seek(SeekFrom::Start(at)).map_err(RecoverError::Read)?;
        self.at = at;
        Ok(self)
    }

    /// Returns the bytes at which the index and the footer begin, or `None` for a file without its end.
    pub fn ends(&mut self) -> Result<Option<[u64; 2]>, RecoverError> {
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
    pub fn find(&mut self, end: u64) -> Result<Option<(u64, u8)>, RecoverError> {
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
