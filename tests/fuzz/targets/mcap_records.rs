//! The records of an MCAP file, parsed by its specification and written again with correct lengths, checks and indexes.
//! Written without the library that the program reads with.

use std::collections::BTreeMap;

pub const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// Opcodes of records.
pub const FOOTER: u8 = 2;
pub const SCHEMA: u8 = 3;
pub const CHANNEL: u8 = 4;
pub const MESSAGE: u8 = 5;
pub const CHUNK: u8 = 6;
pub const MESSAGE_INDEX: u8 = 7;
const CHUNK_INDEX: u8 = 8;
pub const ATTACHMENT: u8 = 9;
const STATISTICS: u8 = 11;
const METADATA: u8 = 12;
const DATA_END: u8 = 15;
const DATA_END_BYTES: usize = 4;

/// Bytes of a message before its data: channel, sequence, two times.
const MESSAGE_HEAD: usize = 22;

/// A record and its content.
#[derive(Clone, PartialEq)]
pub struct Record {
    pub opcode: u8,
    pub body: Vec<u8>,
    /// The records of an uncompressed chunk.
    pub inner: Option<Vec<Record>>,
}

/// The identity of a message.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    pub sequence: u32,
    pub times: [u64; 2],
    pub data: Vec<u8>,
}

/// The one error in an otherwise correct file.
#[derive(Clone, Copy, PartialEq)]
pub enum Wrong {
    Nothing,
    /// A chunk's check.
    Check,
    /// The offset of a chunk in the index.
    Offset(u64),
    /// The length of a chunk in the index.
    Length(u64),
    /// The number of messages in the statistics.
    Counts(u64),
    /// There is no index.
    NoIndex,
    /// There is no end.
    NoEnd,
}

fn number<const BYTES: usize>(bytes: &[u8], at: usize) -> Option<u64> {
    let mut number = [0; 8];
    number[..BYTES].copy_from_slice(bytes.get(at..at.checked_add(BYTES)?)?);
    Some(u64::from_le_bytes(number))
}

/// Returns the records in some bytes, and true if the bytes end with the last record.
fn records(mut bytes: &[u8]) -> (Vec<Record>, bool) {
    let mut records = Vec::new();
    while let Some((head, rest)) = bytes.split_at_checked(9) {
        let length = number::<8>(head, 1).and_then(|length| usize::try_from(length).ok());
        let Some((body, rest)) = length.and_then(|length| rest.split_at_checked(length)) else { break };
        let inner = if head[0] == CHUNK { inner(body) } else { None };
        records.push(Record { opcode: head[0], body: body.to_vec(), inner });
        bytes = rest;
    }
    (records, bytes.is_empty())
}

/// Returns the records of an uncompressed chunk.
fn inner(body: &[u8]) -> Option<Vec<Record>> {
    let compression = number::<4>(body, 28)?;
    let length = number::<8>(body, 32)?;
    let (inner, whole) = records(body.get(40..)?);
    (compression == 0 && length == body.len() as u64 - 40 && whole).then_some(inner)
}

/// Returns the records of a file before its index; `None` if it does not begin as an MCAP file.
pub fn parsed(data: &[u8]) -> Option<Vec<Record>> {
    let (mut records, _) = records(data.strip_prefix(MAGIC)?);
    // A record of another length is damaged, and does not end the data.
    if let Some(end) =
        records.iter().position(|record| record.opcode == DATA_END && record.body.len() == DATA_END_BYTES)
    {
        records.truncate(end);
    }
    Some(records)
}

/// Returns the messages in chunks, and those before the first chunk, of a file whose every chunk is whole, readable and
/// complete. Behind a length beyond the file, all chunks that begin at any byte contribute their messages. Returns
/// `None` for any other file.
pub fn messages(data: &[u8]) -> Option<Vec<Known>> {
    let mut records = parsed(data)?;
    let bytes = |records: &[Record]| records.iter().map(|record| 9 + record.body.len()).sum::<usize>();
    let mut rest = data.get(MAGIC.len() + bytes(&records)..)?;
    if rest.first() != Some(&DATA_END) || number::<8>(rest, 1) != Some(DATA_END_BYTES as u64) {
        let chunk = records.iter().rposition(|record| record.opcode == CHUNK).map_or(0, |chunk| chunk + 1);
        rest = data.get(MAGIC.len() + bytes(&records[..chunk])..)?;
        if rest.windows(4).any(|name| name == b"zstd") {
            return None;
        }
        while let Some((opcode, body)) = rest.split_first() {
            rest = body;
            let length = number::<8>(body, 40).and_then(|length| usize::try_from(length).ok());
            let found = length.and_then(|length| body.get(8..)?.get(..length.checked_add(40)?));
            if let (CHUNK, Some(body), Some(inner)) = (*opcode, found, found.and_then(inner))
                && !inner.is_empty()
                && is_right(body)
            {
                rest = &rest[8 + body.len()..];
                records.push(Record { opcode: CHUNK, body: body.to_vec(), inner: Some(inner) });
            }
        }
    }
    // No record has this opcode.
    if records.iter().any(|record| record.opcode == 0) {
        return None;
    }
    let mut messages = Vec::new();
    let mut in_chunks = false;
    for record in &records {
        let of = match record.opcode {
            CHUNK => {
                in_chunks = true;
                if !is_right(&record.body) {
                    return None;
                }
                record.inner.as_deref()?
            }
            MESSAGE if !in_chunks => std::slice::from_ref(record),
            _ => &[],
        };
        for message in of.iter().filter(|record| record.opcode == MESSAGE) {
            messages.push(known(&message.body)?);
        }
    }
    Some(messages)
}

/// Returns true if the size and the check of an uncompressed chunk agree with its records.
fn is_right(body: &[u8]) -> bool {
    let (size, check) = (number::<8>(body, 16), number::<4>(body, 24));
    let Some(inner) = body.get(40..) else { return false };
    size == Some(inner.len() as u64) && (check == Some(0) || check == Some(crc32(inner).into()))
}

fn known(body: &[u8]) -> Option<Known> {
    let (sequence, data) = (number::<4>(body, 2)? as u32, body.get(MESSAGE_HEAD..)?.to_vec());
    Some(Known { sequence, times: [number::<8>(body, 6)?, number::<8>(body, 14)?], data })
}

/// Returns the check of MCAP, computed byte by byte.
fn crc32(bytes: &[u8]) -> u32 {
    const BYTES: [u32; 256] = {
        let mut table = [0; 256];
        let mut byte = 0;
        while byte < 256 {
            let (mut crc, mut bit) = (byte as u32, 0);
            while bit < 8 {
                crc = (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
                bit += 1;
            }
            table[byte] = crc;
            byte += 1;
        }
        table
    };
    !bytes.iter().fold(!0, |crc, byte| (crc >> 8) ^ BYTES[usize::from(crc as u8 ^ byte)])
}

fn put(out: &mut Vec<u8>, opcode: u8, body: &[u8]) {
    out.push(opcode);
    out.extend((body.len() as u64).to_le_bytes());
    out.extend(body);
}

/// Returns a chunk of these records, and the places of each channel's messages in it.
#[expect(clippy::type_complexity, reason = "channel, then time and place, as the format has them")]
fn chunk(inner: &[Record], wrong: Wrong) -> (Vec<u8>, [u64; 2], BTreeMap<u16, Vec<(u64, u64)>>) {
    let (mut bytes, mut index) = (Vec::new(), BTreeMap::<u16, Vec<(u64, u64)>>::new());
    let mut span = [u64::MAX, 0];
    for record in inner {
        if record.opcode == MESSAGE
            && let (Some(channel), Some(time)) = (number::<2>(&record.body, 0), number::<8>(&record.body, 6))
        {
            index.entry(channel as u16).or_default().push((time, bytes.len() as u64));
            span = [span[0].min(time), span[1].max(time)];
        }
        put(&mut bytes, record.opcode, &record.body);
    }
    span[0] = span[0].min(span[1]);
    let check = if wrong == Wrong::Check { 1 } else { 0 };
    let mut body: Vec<u8> = span.iter().flat_map(|time| time.to_le_bytes()).collect();
    body.extend((bytes.len() as u64).to_le_bytes());
    body.extend((crc32(&bytes) ^ check).to_le_bytes());
    body.extend(0u32.to_le_bytes());
    body.extend((bytes.len() as u64).to_le_bytes());
    body.extend(bytes);
    (body, span, index)
}

/// Returns the file of these records, with an index of its content.
pub fn written(records: &[Record], wrong: Wrong) -> Vec<u8> {
    let mut file = MAGIC.to_vec();
    let (mut kinds, mut indexes) = (BTreeMap::new(), Vec::new());
    let (mut counts, mut span) = (BTreeMap::<u16, u64>::new(), [u64::MAX, 0]);
    let mut count = |channel: u16, messages: u64| *counts.entry(channel).or_default() += messages;
    for record in records.iter().filter(|record| record.opcode != MESSAGE_INDEX || record.body.len() < 6) {
        let inner = record.inner.as_deref().unwrap_or_default();
        for kind in inner.iter().chain([record]).filter(|record| [SCHEMA, CHANNEL].contains(&record.opcode)) {
            kinds.entry((kind.opcode, number::<2>(&kind.body, 0))).or_insert(&kind.body);
        }
        let at = file.len() as u64;
        let Some(inner) = &record.inner else {
            put(&mut file, record.opcode, &record.body);
            if let (MESSAGE, Some(channel)) = (record.opcode, number::<2>(&record.body, 0)) {
                count(channel as u16, 1);
            }
            continue;
        };
        let (body, times, index) = chunk(inner, wrong);
        put(&mut file, CHUNK, &body);
        let (length, begin) = (file.len() as u64 - at, file.len());
        let mut places = Vec::new();
        for (channel, entries) in &index {
            count(*channel, entries.len() as u64);
            places.extend([&channel.to_le_bytes()[..], &(file.len() as u64).to_le_bytes()].concat());
            let entries: Vec<u8> =
                entries.iter().flat_map(|(time, place)| [time.to_le_bytes(), place.to_le_bytes()].concat()).collect();
            let head = [&channel.to_le_bytes()[..], &(entries.len() as u32).to_le_bytes()].concat();
            put(&mut file, MESSAGE_INDEX, &[head, entries].concat());
        }
        span = [span[0].min(times[0]), span[1].max(times[1])];
        let offset = if let Wrong::Offset(by) = wrong { at.wrapping_add(by) } else { at };
        let claimed = if let Wrong::Length(length) = wrong { length } else { length };
        let records = body.len() as u64 - 40;
        let mut of: Vec<u8> =
            [times[0], times[1], offset, claimed].iter().flat_map(|number| number.to_le_bytes()).collect();
        of.extend((places.len() as u32).to_le_bytes());
        of.extend(places);
        of.extend(((file.len() - begin) as u64).to_le_bytes());
        of.extend(0u32.to_le_bytes());
        of.extend([records, records].iter().flat_map(|number| number.to_le_bytes()));
        indexes.push(of);
    }
    if wrong == Wrong::NoEnd {
        return file;
    }
    put(&mut file, DATA_END, &[0; DATA_END_BYTES]);
    let summary = file.len() as u64;
    for ((opcode, _), body) in &kinds {
        put(&mut file, *opcode, body);
    }
    let of = |opcode: u8| records.iter().filter(|record| record.opcode == opcode).count() as u32;
    let by = if let Wrong::Counts(by) = wrong { by } else { 0 };
    let mut statistics = counts.values().sum::<u64>().wrapping_add(by).to_le_bytes().to_vec();
    statistics.extend((kinds.keys().filter(|(opcode, _)| *opcode == SCHEMA).count() as u16).to_le_bytes());
    let channels = kinds.keys().filter(|(opcode, _)| *opcode == CHANNEL).count() as u32;
    let numbers = [channels, of(ATTACHMENT), of(METADATA), indexes.len() as u32];
    statistics.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    statistics.extend(span.iter().flat_map(|time| time.to_le_bytes()));
    statistics.extend((counts.len() as u32 * 10).to_le_bytes());
    for (channel, messages) in &counts {
        statistics.extend(channel.to_le_bytes());
        statistics.extend(messages.wrapping_add(by).to_le_bytes());
    }
    put(&mut file, STATISTICS, &statistics);
    for index in &indexes {
        put(&mut file, CHUNK_INDEX, index);
    }
    let begins = if wrong == Wrong::NoIndex { 0 } else { summary };
    put(&mut file, FOOTER, &[&begins.to_le_bytes()[..], &[0; 12]].concat());
    file.extend(MAGIC);
    file
}
