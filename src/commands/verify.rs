//! `verify`: plays the show of a log again and compares every bit.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::PathBuf;

use bench_dragon::recording::verify::{self, Verdict, VerifyError};

use super::{CommandError, Common, Output, progress_bar};

/// Arguments of `verify`.
#[derive(Debug, clap::Args)]
pub struct VerifyArguments {
    /// A log, as `run --log` writes it
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// Verifies a log: same or close is exit code 0, a difference or nothing to compare 1, a file that is no log 2.
pub fn verify(common: &Common, arguments: &VerifyArguments) -> Result<(), CommandError> {
    let shown = arguments.file.display().to_string();
    let unread = |error: io::Error| CommandError::BadInput(format!("{shown}: {error}, expected a log to read"));
    let file = File::open(&arguments.file).map_err(unread)?;
    let bar = progress_bar(file.metadata().map_or(0, |data| data.len()), common).with_message("playing again");
    let verdict = verify::verify(BufReader::new(file), &shown, &mut |bytes| bar.set_position(bytes));
    bar.finish_and_clear();
    let verdict = verdict.map_err(|error| match error {
        VerifyError::Line { line, problem } => CommandError::BadInput(format!("{shown}, line {line}: {problem}")),
        VerifyError::Scene(sentence) => CommandError::BadInput(sentence),
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

fn print(common: &Common, verdict: &Verdict) -> Result<(), CommandError> {
    let mut output = Output::standard();
    if common.json {
        output.json(verdict)?;
        return output.finish();
    }
    let Verdict { seconds, same_seconds, frames, commands, skipped, lost, .. } = *verdict;
    if verdict.version != env!("CARGO_PKG_VERSION") {
        let (theirs, ours) = (&verdict.version, env!("CARGO_PKG_VERSION"));
        output.line(&format!("The log is of version {theirs}, this is {ours}: played again all the same."))?;
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
