//! `[require]`: the verdicts of a show as sentences or as lines of JSON, and the exit code.

use bench_dragon::show::requirements::{Outcome, Verdict};

use super::super::{CommandError, Output};

/// Prints each verdict as a line of JSON.
pub(super) fn print_lines(verdicts: &[Verdict], output: &mut Output) -> Result<(), CommandError> {
    verdicts.iter().try_for_each(|verdict| output.json(verdict))
}

/// Prints each verdict as a sentence.
pub(super) fn print(verdicts: &[Verdict], output: &mut Output) -> Result<(), CommandError> {
    verdicts.iter().try_for_each(|verdict| output.line(&format!("  {}", verdict.sentence())))
}

/// Returns an error unless every requirement is met.
pub(super) fn result(verdicts: &[Verdict]) -> Result<(), CommandError> {
    if verdicts.iter().all(|verdict| verdict.verdict == Outcome::Pass) {
        return Ok(());
    }
    Err(CommandError::Failed("the show does not keep what [require] states".to_owned()))
}
