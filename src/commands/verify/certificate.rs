//! What `verify` says of a certificate of events.

use bench_dragon::proof::{EventKind, Outcome, Proved, Refused, Status};
use serde::Serialize;
use serde_json::json;

use super::super::{CommandError, Common, Output};

/// What `--json` prints of a certificate that proves what it says.
#[derive(Serialize)]
struct Verdict<'a> {
    verdict: &'static str,
    #[serde(flatten)]
    proved: &'a Proved,
}

/// Prints what a certificate proves, or why it proves nothing; `shown` is how sentences call the file.
pub(super) fn print(common: &Common, shown: &str, checked: Result<Proved, Refused>) -> Result<(), CommandError> {
    let proved = match checked {
        Ok(proved) => proved,
        Err(Refused::DoesNotFollow { line, problem }) => {
            if common.json {
                let mut output = Output::standard();
                output.json(&json!({"verdict": "refused", "line": line, "problem": problem}))?;
                output.finish()?;
            }
            return Err(CommandError::Failed(format!("{shown}, line {line}: it does not follow: {problem}")));
        }
        Err(Refused::Form { line, problem }) => {
            return Err(CommandError::BadInput(format!("{shown}, line {line}: {problem}")));
        }
        Err(Refused::Unreadable(error)) => {
            return Err(CommandError::BadInput(format!("{shown}: {error}, expected a certificate to read")));
        }
    };
    let mut output = Output::standard();
    if common.json {
        output.json(&Verdict { verdict: "proved", proved: &proved })?;
        return output.finish();
    }
    for outcome in &proved.results {
        output.line(&sentence(outcome))?;
    }
    let Proved { steps, links, pairs, .. } = proved;
    output.line(&format!("{steps} steps, {links} links over spans and {pairs} pairs of boards were checked."))?;
    output.finish()
}

/// What is proved of an event, in a sentence.
fn sentence(outcome: &Outcome) -> String {
    let event = match outcome.event {
        EventKind::Contact => "contact",
        EventKind::Stall => "stall",
        EventKind::Lock => "lock",
        EventKind::PathEnd => "path end",
    };
    let seconds = |time: Option<f64>| time.map_or("?".to_owned(), |time| format!("{time} s"));
    let (lo, hi) = (seconds(outcome.time_lo), seconds(outcome.time_hi));
    match (outcome.status, outcome.bench_a, outcome.bench_b) {
        (Status::Proved, Some(a), Some(b)) => {
            format!("{event}: proved between {lo} and {hi}, when benches {a} and {b} overlap")
        }
        (Status::Proved, Some(a), None) => format!("{event}: proved between {lo} and {hi}, at bench {a}"),
        (Status::Proved, ..) => format!("{event}: proved between {lo} and {hi}"),
        (Status::None, ..) => format!("{event}: proved that there is none"),
        (Status::Undecided, ..) => {
            let because = outcome.because.as_deref().map_or(String::new(), |because| format!(": {because}"));
            format!("{event}: undecided, but not before {lo}{because}")
        }
    }
}
