//! Repairs a recording that was cut by a kill, a full disk or a loss of power, or has damaged bytes.
//!
//! In: the bytes of the file. Out: a complete file with the messages of the finished chunks, in order, the attachments
//! and the metadata. A file without chunks keeps its messages.
//!
//! The crate mcap reads records up to the first damaged one, and checks chunks and attachments. Beyond that, `records`
//! finds the next record behind a damaged length without a readable summary: the next chunk or attachment whose own
//! lengths and check agree. `mender` keeps only complete records that can be of their type, and writes them with an
//! index of their own.

mod mender;
mod records;

use std::io::{self, Read, Seek, Write};

use mcap::read::parse_record;
use mcap::records::{Header, Record, op};
use mcap::write::NoSeek;
use mcap::{MAGIC, McapError, WriteOptions};
use serde::Serialize;

use super::file::{io_error, options};
use super::lengths::has_right_length;
use mender::Mender;
use records::{FIRST, Records};

/// The number of bytes of the footer, and of the record that ends the messages.
const FOOTER_BYTES: usize = 20;
const DATA_END_BYTES: usize = 4;

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
    let mut input = Records::new(input, length);
    let ends = input.ends()?;
    let mut made = options();
    if input.seek(FIRST)?.next()? == Some(op::HEADER)
        && let Ok(Record::Header(Header { profile, library })) = parse_record(op::HEADER, &input.body)
    {
        made = WriteOptions::library(made.profile(profile), library);
    }
    let mut mender = Mender::new(made.create(NoSeek::new(output))?);
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
