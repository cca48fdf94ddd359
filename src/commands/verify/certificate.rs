//! The report of `verify` on a certificate.

use std::io::BufRead;

use bench_dragon::messages::hexadecimal;
use bench_dragon::messages::sentence::number;
use bench_dragon::proof::{
    EventKind, Proved, ProvedClearance, ProvedEvent, ProvedObstacleClearance, ProvedPitch, ProvedSpeed, Refused,
    Status, Until, scene_hash,
};
use bench_dragon::show::scene::printable;
use serde::Serialize;
use serde_json::json;

use super::super::plan::{are_too_near, come_too_near};
use super::super::{CommandError, Common, Output};

/// The line of `--json` for a valid certificate.
#[derive(Serialize)]
struct ProvedLine<'a> {
    verdict: &'static str,
    scene_hash: String,
    #[serde(flatten)]
    proved: &'a Proved,
}

/// Prints the results of a certificate, or the reason of its refusal; `shown` is the file's name in sentences.
pub(super) fn print(common: &Common, shown: &str, checked: Result<Proved, Refused>) -> Result<(), CommandError> {
    let proved = match checked {
        Err(Refused::DoesNotFollow { line, problem }) if common.json => {
            let mut output = Output::standard();
            output.json(&json!({"verdict": "refused", "line": line, "problem": problem}))?;
            output.finish()?;
            return Err(refusal(shown, Refused::DoesNotFollow { line, problem }));
        }
        checked => checked.map_err(|refused| refusal(shown, refused))?,
    };
    let mut output = Output::standard();
    let scene_hash = hexadecimal(&scene_hash(&proved.scene));
    if common.json {
        output.json(&ProvedLine { verdict: "proved", scene_hash, proved: &proved })?;
        return output.finish();
    }
    output.line(&format!("BLAKE3 of the scene's text: {scene_hash}"))?;
    for sentence in sentences(&proved) {
        output.line(&sentence)?;
    }
    let Proved { steps, links, pairs, .. } = proved;
    output.line(&format!("{steps} steps, {links} links over spans and {pairs} pairs of boards were checked."))?;
    output.finish()
}

/// Checks that a certificate is of the scene with this text; `shown` is the file's name in sentences. Returns a
/// sentence for each result.
pub fn proved_of(
    scene: &str,
    shown: &str,
    lines: impl BufRead,
    progress: &mut dyn FnMut(u64),
) -> Result<Vec<String>, CommandError> {
    let proved = bench_dragon::proof::verify(lines, progress).map_err(|refused| refusal(shown, refused))?;
    if proved.scene != scene {
        let sentence = format!("{shown} is the certificate of a scene with another text, expected one of this scene");
        return Err(CommandError::BadInput(sentence));
    }
    Ok(sentences(&proved))
}

/// Returns a sentence for each result.
fn sentences(proved: &Proved) -> Vec<String> {
    let Proved { results, least_clearance, least_clearances, obstacle_clearances, .. } = proved;
    let named = |dragons: &[usize], sentence: String| {
        let names: Vec<&str> =
            dragons.iter().filter_map(|dragon| proved.dragons.get(*dragon)).map(String::as_str).collect();
        if names.is_empty() { sentence } else { format!("{}, {sentence}", printable(&names.join(" and "))) }
    };
    let events = results.iter().map(|outcome| named(&outcome.dragons, sentence(outcome)));
    let clearances = least_clearance.iter().chain(least_clearances);
    let clearances = clearances.map(|outcome| named(&outcome.dragons, clearance_sentence(outcome)));
    let others = [proved.greatest_speed.as_ref().map(speed_sentence), proved.least_pitch.as_ref().map(pitch_sentence)];
    let obstacles = obstacle_clearances.iter().map(|outcome| named(&outcome.dragons, obstacle_sentence(outcome)));
    events.chain(clearances).chain(others.into_iter().flatten()).chain(obstacles).collect()
}

/// Returns the error for a refused certificate.
fn refusal(shown: &str, refused: Refused) -> CommandError {
    let sentence = reason(shown, &refused);
    match refused {
        Refused::DoesNotFollow { .. } => CommandError::Failed(sentence),
        Refused::Form { .. } | Refused::Unreadable(_) => CommandError::BadInput(sentence),
    }
}

/// Returns the sentence for a refused certificate.
pub fn reason(shown: &str, refused: &Refused) -> String {
    match refused {
        Refused::DoesNotFollow { line, problem } => {
            format!("{shown}, line {line}: it does not follow: {}", printable(problem))
        }
        Refused::Form { line, problem } => format!("{shown}, line {line}: {}", printable(problem)),
        Refused::Unreadable(error) => format!("{shown}: {error}, expected a certificate to read"),
    }
}

/// Returns a sentence on what is proved of an event.
fn sentence(outcome: &ProvedEvent) -> String {
    let event = match (outcome.event, outcome.obstacle) {
        (EventKind::Contact, _) => "contact".to_owned(),
        (EventKind::Stall, _) => "stall".to_owned(),
        (EventKind::Lock, _) => "lock".to_owned(),
        (EventKind::PathEnd, _) => "path end".to_owned(),
        (EventKind::Obstacle, number) => {
            format!("touch of obstacle {} (counting from 1, the boundary last)", number.unwrap_or(0) + 1)
        }
    };
    // Without the sign of zero.
    let seconds = |time: Option<f64>| time.map_or("?".to_owned(), |time| format!("{} s", number(time + 0.0)));
    let (lo, hi) = (seconds(outcome.time_lo), seconds(outcome.time_hi));
    match (outcome.status, outcome.bench_a, outcome.bench_b) {
        (Status::Proved, Some(a), Some(b)) => {
            let (a, b) = (a + 1, b + 1);
            format!("{event}: proved between {lo} and {hi}, when benches {a} and {b} (counting from 1) overlap")
        }
        (Status::Proved, Some(a), None) => {
            format!("{event}: proved between {lo} and {hi}, when it occurs at bench {} (counting from 1)", a + 1)
        }
        (Status::Proved, ..) => format!("{event}: proved between {lo} and {hi}"),
        (Status::None, ..) if outcome.time_lo.is_some() => {
            format!("{event}: proved that there is none before {lo}; the lock that ends the motion is later")
        }
        (Status::None, ..) => format!("{event}: proved that there is none"),
        (Status::Undecided, ..) => {
            let because =
                outcome.because.as_deref().map_or(String::new(), |because| format!(": {}", printable(because)));
            format!("{event}: undecided, but not before {lo}{because}")
        }
    }
}

/// Returns a sentence on a proved least clearance.
fn clearance_sentence(outcome: &ProvedClearance) -> String {
    let ProvedClearance { lo, hi, until, time_until, bench_a, bench_b, ref dragons } = *outcome;
    let until = match (until, time_until) {
        (Until::PathEnd, _) => "from the start to the path's end".to_owned(),
        (Until::Contact, _) => "from the start to the first contact".to_owned(),
        (Until::Time, time) => format!("from the start to {} s", time.unwrap_or(0.0)),
    };
    let boards =
        if dragons.len() == 2 { "board of the one and board of the other" } else { "two boards that share no handle" };
    let below = lo.map(|lo| format!("no {boards} are nearer than {lo} m"));
    let above = hi.zip(bench_a.zip(bench_b)).map(|(hi, (a, b))| {
        format!("benches {} and {} (counting from 1) are no further apart than {hi} m at one moment", a + 1, b + 1)
    });
    let claims: Vec<String> = below.into_iter().chain(above).collect();
    match claims.is_empty() {
        true => format!("least clearance {until}: undecided"),
        false => format!("least clearance {until}: proved that {}", claims.join(", and that ")),
    }
}

/// Returns a sentence on the proved least clearance of an obstacle.
fn obstacle_sentence(outcome: &ProvedObstacleClearance) -> String {
    let ProvedObstacleClearance { obstacle, lo, hi, until, time_until, bench, .. } = *outcome;
    let until = match (until, time_until) {
        (Until::Time, Some(time)) => format!("from the start to {time} s"),
        _ => "from the start to the path's end".to_owned(),
    };
    let of = format!("least clearance of obstacle {} (counting from 1, the boundary last) {until}", obstacle + 1);
    let below = lo.map(|lo| format!("no board's is less than {lo} m"));
    let above = hi
        .zip(bench)
        .map(|(hi, bench)| format!("that of bench {} (counting from 1) is at most {hi} m at one moment", bench + 1));
    let claims: Vec<String> = below.into_iter().chain(above).collect();
    match claims.is_empty() {
        true => format!("{of}: undecided"),
        false => format!("{of}: proved that {}", claims.join(", and that ")),
    }
}

/// Returns a sentence on a proved greatest speed.
fn speed_sentence(outcome: &ProvedSpeed) -> String {
    let ProvedSpeed { limit, value_lo, value_hi, ratio_lo, ratio_hi, handle, time_until } = *outcome;
    let handle = handle + 1;
    format!(
        "greatest speed from the start to {time_until} s of the scene: proved that no handle exceeds {limit} m/s with the \
         head at {value_lo} m/s, and that handle {handle} (counting from 1) does with the head faster than {value_hi} \
         m/s; the greatest ratio is between {ratio_lo} and {ratio_hi}"
    )
}

/// Returns a sentence on a proved least pitch.
fn pitch_sentence(outcome: &ProvedPitch) -> String {
    let ProvedPitch { radius, from, clearance, value_lo, value_hi } = *outcome;
    // A certificate may claim nothing: then its number is below the first pitch.
    let blocked = value_lo.filter(|value_lo| *value_lo >= from).map(|value_lo| {
        let too_near = are_too_near(clearance);
        format!(
            "with every pitch from {from} m to {value_lo} m two boards {too_near}, or a link locks, before {radius} m"
        )
    });
    let free = value_hi.map(|value_hi| {
        let too_near = come_too_near(clearance);
        format!(
            "with {value_hi} m the head reaches {radius} m, and no two boards that share no handle {too_near} before"
        )
    });
    let claims: Vec<String> = blocked.into_iter().chain(free).collect();
    match claims.is_empty() {
        true => "least pitch: undecided".to_owned(),
        false => format!("least pitch: proved that {}", claims.join(", and that ")),
    }
}
