//! `verify`: plays the show of a log again and compares every bit, checks a certificate of events, or computes the
//! poses of a recording again.

pub mod certificate;
mod recording;

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::PathBuf;

use bench_dragon::proof;
use bench_dragon::publisher::log::verify::{self, Verdict, VerifyError};

use super::{CommandError, Common, Output, progress_bar};

/// Arguments of `verify`.
#[derive(Debug, clap::Args)]
pub struct VerifyArguments {
    /// A log of `run --log`, a certificate of `events --certify`, or a recording of `record`
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// The first bytes of a recording.
const MCAP_MAGIC: &[u8] = b"\x89MCAP";

/// Verifies a log, a certificate or a recording. Exit code 0: the log or the recording has the same show, within its
/// accuracy; or the certificate is valid. Exit code 1: the show differs, nothing can be compared, or a line of the
/// certificate does not follow. Exit code 2: the file cannot be read as one of these.
pub fn verify(common: &Common, arguments: &VerifyArguments) -> Result<(), CommandError> {
    let shown = arguments.file.display().to_string();
    let unread = |error: io::Error| {
        CommandError::BadInput(format!("{shown}: {error}, expected a log, a certificate or a recording to read"))
    };
    let file = File::open(&arguments.file).map_err(unread)?;
    let bar = progress_bar(file.metadata().map_or(0, |data| data.len()), common);
    let mut file = BufReader::new(file);
    let mut first = Vec::new();
    file.by_ref().take(proof::LONGEST_LINE).read_until(b'\n', &mut first).map_err(unread)?;
    if first.starts_with(MCAP_MAGIC) {
        bar.finish_and_clear();
        return recording::verify(common, &arguments.file);
    }
    let is_certificate = is_certificate(&first);
    let lines = Cursor::new(first).chain(file);
    let mut progress = |bytes| bar.set_position(bytes);
    if is_certificate {
        bar.set_message("checking");
        let checked = proof::verify(lines, &mut progress);
        bar.finish_and_clear();
        return certificate::print(common, &shown, checked);
    }
    bar.set_message("playing again");
    let verdict = verify::verify(lines, &shown, &mut progress);
    bar.finish_and_clear();
    let verdict = verdict.map_err(|error| match error {
        VerifyError::Line { line, problem } => CommandError::BadInput(format!("{shown}, line {line}: {problem}")),
        VerifyError::Scene(error) => error.into(),
        VerifyError::Read(error) => unread(error),
    })?;
    print(common, &verdict)?;
    match verdict.difference {
        None if verdict.seconds == 0 => {
            Err(CommandError::Failed(format!("{shown}: nothing could be compared: the log has no hash of any second")))
        }
        None => Ok(()),
        Some(of) => {
            let from_another = if verdict.version == env!("CARGO_PKG_VERSION") {
                String::new()
            } else {
                format!(" (the log is of version {}, this is {})", verdict.version, env!("CARGO_PKG_VERSION"))
            };
            Err(CommandError::Failed(format!(
                "{shown}, line {}: second {}, ticks {} to {}, differs{from_another}: {}",
                of.line, of.second, of.from, of.to, of.what
            )))
        }
    }
}

/// Returns true if the first line of a file is that of a certificate.
fn is_certificate(line: &[u8]) -> bool {
    let value: Option<serde_json::Value> = serde_json::from_slice(line).ok();
    value.is_some_and(|value| value["type"] == "certificate")
}

fn print(common: &Common, verdict: &Verdict) -> Result<(), CommandError> {
    let mut output = Output::standard();
    if common.json {
        output.json(verdict)?;
        return output.finish();
    }
    let Verdict { seconds, same_seconds, frames, commands, skipped, lost, .. } = *verdict;
    if verdict.version != env!("CARGO_PKG_VERSION") {
        let (theirs, ours) = (&verdict.version, env!("CARGO_PKG_VERSION"));
        output.line(&format!("The log is of version {theirs}, this is {ours}: played again anyway."))?;
    }
    if !verdict.same_arithmetic {
        output.line(&format!(
            "The log was computed with other instructions ({}) or elementary functions than this machine has: where bits \
             differ, the handles that it has of each second are compared with newton's.",
            verdict.instructions
        ))?;
    }
    if verdict.difference.is_none() && seconds > 0 {
        output.line(&format!(
            "{} of {seconds} seconds have the same bits: {frames} frames, {commands} commands, {skipped} periods skipped.",
            same_seconds
        ))?;
    }
    if let (Some(metres), Some(tolerance)) = (verdict.max_difference, verdict.tolerance) {
        output
            .line(&format!("Handles are up to {metres:.1e} m from newton's, where {tolerance:.1e} m are allowed."))?;
    }
    if lost > 0 {
        output.line(&format!("{lost} frames are in no hash: the log was behind."))?;
    }
    if verdict.difference.is_none() && !verdict.complete {
        let cut = if verdict.cut { ", its last line is cut" } else { "" };
        let until =
            verdict.last_tick.map_or("nothing is proved".to_owned(), |tick| format!("proved up to tick {}", tick));
        output.line(&format!("The log has no end{cut}: {until}."))?;
    }
    output.finish()
}
