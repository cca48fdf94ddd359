//! `record --recover`: files that are cut at any byte, files with a wrong byte, and files with a wrong length.

use std::io::Cursor;
use std::path::Path;

use bench_dragon::recording::mcap::recover::{RecoverError, Recovered, check_magic, recover};
use serde_json::Value;

use super::harness::{can_run, json_lines, program, python, python_modules, summary, text};
use super::{Entry, entries, small_recording};

/// Returns the chunks of a file by the reference implementation: the byte after each, and its messages.
fn chunks(file: &Path) -> Vec<(usize, Vec<Entry>)> {
    let output = python().args(["tests/python/record_chunks.py", file.to_str().unwrap()]).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let entry = |entry: &Value| {
        let text = |at: usize| entry[at].as_str().unwrap().to_owned();
        (text(0), entry[1].as_u64().unwrap(), entry[2].as_u64().unwrap(), text(3))
    };
    let chunk = |line: &Value| {
        let messages = line["messages"].as_array().unwrap().iter().map(entry).collect();
        (line["end"].as_u64().unwrap() as usize, messages)
    };
    json_lines(&output).iter().map(chunk).collect()
}

/// Returns the bytes at which the records of a file begin.
pub fn record_starts(bytes: &[u8]) -> Vec<usize> {
    let next = |at: &usize| {
        let length = u64::from_le_bytes(bytes.get(at + 1..at + 9)?.try_into().unwrap());
        Some(at + 9 + length as usize).filter(|next| *next + 8 < bytes.len())
    };
    std::iter::successors((bytes.len() > 16).then_some(8), next).collect()
}

fn recovered(bytes: &[u8]) -> Result<(Recovered, Vec<u8>), RecoverError> {
    let (mut input, mut output) = (Cursor::new(bytes), Vec::new());
    check_magic(&mut input)?;
    Ok((recover(input, bytes.len() as u64, &mut output)?, output))
}

#[test]
fn a_file_that_is_cut_anywhere_keeps_every_finished_chunk() {
    if !can_run(python_modules(&["mcap", "blake3"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = small_recording("record_cut", folder.path());
    let (chunks, bytes) = (chunks(&file), std::fs::read(&file).unwrap());
    assert!(chunks.len() >= 5 && chunks.iter().map(|chunk| chunk.1.len()).sum::<usize>() > 300, "{}", chunks.len());
    let (whole, _) = recovered(&bytes).unwrap();
    assert!(whole.whole && whole.chunks as usize == chunks.len() && whole.lost_bytes == 0, "{whole:?}");
    assert_eq!(whole.attachments, 2, "the scene and the description of the run");
    let mut random = fastrand::Rng::with_seed(17);
    let random_cuts: Vec<_> = (0..1000).map(|_| random.usize(8..bytes.len())).collect();
    // And at the exact bytes at which a chunk ends.
    let edges = chunks.iter().flat_map(|(end, _)| [end - 1, *end, end + 1]);
    for cut in random_cuts.into_iter().chain(edges) {
        let finished = chunks.iter().take_while(|(end, _)| *end <= cut);
        let expected: Vec<_> = finished.flat_map(|(_, messages)| messages.clone()).collect();
        let (counts, output) = recovered(&bytes[..cut]).unwrap();
        assert!(entries(&output) == expected, "cut at {cut} of {}: {counts:?}", bytes.len());
        assert_eq!((counts.messages, counts.whole, counts.damaged), (expected.len() as u64, false, 0), "cut at {cut}");
        let last_end = chunks.iter().map(|(end, _)| *end).take_while(|end| *end <= cut).last().unwrap_or(8);
        assert!(counts.lost_bytes as usize <= cut - last_end, "{counts:?} of {cut} bytes");
    }
    for cut in 0..8 {
        assert!(matches!(recovered(&bytes[..cut]), Err(RecoverError::NotMcap)), "{cut} bytes");
    }
}

#[test]
fn a_byte_that_is_wrong_costs_messages_and_invents_none() {
    if !can_run(python_modules(&["mcap", "blake3"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = small_recording("record_flip", folder.path());
    let bytes = std::fs::read(&file).unwrap();
    let (all, chunks, starts) = (entries(&bytes), chunks(&file), record_starts(&bytes));
    let record_of = |at: usize| starts[starts.partition_point(|start| *start <= at) - 1];
    let (first_end, last_end) = (chunks[0].0, chunks[chunks.len() - 1].0);
    let mut random = fastrand::Rng::with_seed(18);
    let mut damaged = 0;
    for round in 0..400 {
        // Every second file was cut before its end, and every fourth byte is in the first chunk.
        let length = if round % 2 == 0 { bytes.len() } else { last_end };
        let first = record_of(first_end - 1);
        // First each byte before the messages of the first chunk, which contain its lengths and its check.
        let at = match round {
            0..40 => first + 9 + round,
            _ if round % 4 < 2 => random.usize(first..first_end),
            _ => random.usize(8..length),
        };
        let mut wrong = bytes[..length].to_vec();
        wrong[at] ^= 1 << random.u32(0..8);
        let (counts, output) = recovered(&wrong).unwrap();
        let kept = entries(&output);
        let mut rest = all.iter();
        for entry in &kept {
            assert!(rest.any(|known| known == entry), "{entry:?} is in no place of the recording");
        }
        let record = record_of(at);
        let others = |chunk: &&(usize, Vec<Entry>)| record_of(chunk.0 - 1) != record;
        let others: Vec<_> = chunks.iter().filter(others).flat_map(|(_, messages)| messages.clone()).collect();
        if (1..9).contains(&(at - record)) {
            assert!(kept == all, "the length at {at}, {} of {} messages: {counts:?}", kept.len(), all.len());
        } else {
            assert!(kept == all || kept == others, "byte {at}, in the record at {record}: {counts:?}");
            assert!(kept == all || counts.damaged == 1, "byte {at}, in the record at {record}: {counts:?}");
        }
        damaged += u64::from(counts.damaged > 0);
    }
    assert!(damaged > 200, "{damaged} of 400 were noticed in a chunk");
    // An invalid opcode in place of the second chunk; a message in place of the first.
    for (chunk, opcode) in [(1, 0x16), (0, 0x05)] {
        let mut wrong = bytes.clone();
        wrong[record_of(chunks[chunk].0 - 1)] = opcode;
        let (counts, _) = recovered(&wrong).unwrap();
        let lost = chunks[chunk].1.len() as u64;
        let expected = (1, lost, 0, all.len() as u64 - lost);
        assert_eq!((counts.damaged, counts.lost_messages, counts.unknown, counts.messages), expected, "{opcode}");
    }
}

/// A length beyond the file does not locate the next record; the chunks' own lengths and checks do.
#[test]
fn a_damaged_length_costs_no_message() {
    if !can_run(python_modules(&["mcap", "blake3"])) {
        return;
    }
    let (name, folder) = ("record_length", tempfile::tempdir().unwrap());
    let file = small_recording(name, folder.path());
    let (bytes, chunks) = (std::fs::read(&file).unwrap(), chunks(&file));
    let all: Vec<Entry> = chunks.iter().flat_map(|(_, messages)| messages.clone()).collect();
    let starts = record_starts(&bytes);
    let data_end = starts.iter().copied().find(|at| bytes[*at] == 15).unwrap();
    let in_data: Vec<usize> = starts.iter().copied().filter(|at| *at <= data_end).collect();
    let damaged = |at: usize, length: u64, end: usize| {
        let mut damaged = bytes[..end].to_vec();
        damaged[at + 1..at + 9].copy_from_slice(&length.to_le_bytes());
        damaged
    };
    // Every record, with lengths that are too great and too small, in a whole file and in one without its end.
    let ends = [bytes.len(), data_end];
    for (at, end) in in_data.iter().flat_map(|at| ends.map(|end| (*at, end))).filter(|(at, end)| at < end) {
        let right = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap());
        for length in [1 << 63, 0, right + 5000, right.saturating_sub(3)] {
            let (counts, output) = recovered(&damaged(at, length, end)).unwrap();
            let kept = entries(&output);
            let place = format!("length {length} for {right} at {at}, opcode {}: {counts:?}", bytes[at]);
            assert!(kept == all, "{} of {} messages, {place}", kept.len(), all.len());
            assert_eq!((counts.messages as usize, counts.whole), (all.len(), end == bytes.len()), "{place}");
            let is_attachment_lost = bytes[at] == 9 || at < chunks[0].0;
            assert!(counts.attachments == 2 || is_attachment_lost, "{place}");
        }
    }
    // The other length of a chunk, of its compressed records: a greater one hides the next chunk.
    for at in in_data.iter().copied().filter(|at| bytes[*at] == 6) {
        let mut wrong = bytes.clone();
        let size = at + 45..at + 53;
        let right = u64::from_le_bytes(wrong[size.clone()].try_into().unwrap());
        for greater in [1, 300, 5000] {
            wrong[size.clone()].copy_from_slice(&(right + greater).to_le_bytes());
            let (counts, output) = recovered(&wrong).unwrap();
            let kept = entries(&output);
            let least = all.len() - chunks.iter().find(|(end, _)| *end > at).unwrap().1.len();
            assert!(kept.len() >= least, "{} messages, {greater} more at {at}: {counts:?}", kept.len());
            assert!(kept.iter().all(|entry| all.contains(entry)) && kept.len() <= all.len(), "{counts:?}");
        }
    }
    // As a program, and read by the reference implementation: the first record, a chunk and a message index.
    let middle = starts.iter().copied().filter(|at| *at > bytes.len() / 2);
    let of = |opcode: u8| middle.clone().find(|at| bytes[*at] == opcode).unwrap();
    for (at, end) in [starts[0], of(6), of(7)].into_iter().flat_map(|at| ends.map(|end| (at, end))) {
        let (wrong, mended) = (folder.path().join("wrong.mcap"), folder.path().join("mended.mcap"));
        std::fs::write(&wrong, damaged(at, 1 << 63, end)).unwrap();
        let mut mend = program(name);
        mend.args(["--json", "record", "--force", "--recover"]).arg(&wrong).arg("--output").arg(&mended);
        let counts = summary(&mend.output().unwrap());
        assert_eq!((&counts["messages"], &counts["whole"]), (&all.len().into(), &(end == bytes.len()).into()));
        let read: Vec<Entry> = self::chunks(&mended).into_iter().flat_map(|(_, messages)| messages).collect();
        assert!(read == all, "{} of {} messages after byte {at}", read.len(), all.len());
    }
    // Nothing is left of a file whose chunks have a wrong check.
    let mut empty = bytes[..chunks[0].0].to_vec();
    empty[chunks[0].0 - 20] ^= 1;
    let wrong = folder.path().join("empty.mcap");
    std::fs::write(&wrong, empty).unwrap();
    let output = program(name).args(["record", "--recover", wrong.to_str().unwrap()]).output().unwrap();
    let sentence = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{sentence}");
    assert!(sentence.contains("no message of") && sentence.contains("empty.mcap could be read"), "{sentence}");
}
