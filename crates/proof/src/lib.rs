//! The checker of certificates: the rules of docs/proofs.md, and nothing else.
//!
//! In: the lines of a certificate. Out: its proved claims, or the first line that does not follow. This crate depends
//! on no other crate of this workspace, because a fault in shared code would be shared too: it has neither geometry,
//! parsing nor solver in common with the search, only that page.

mod apart;
mod beside;
mod boards;
mod branch;
mod capsule;
mod chain;
mod checker;
mod curve;
mod elementary;
mod events;
mod far;
mod first_order;
mod first_order_board;
mod greatest;
mod ground;
mod handle;
mod interval;
mod lines;
mod link;
mod number;
mod path;
mod pieces;
mod pitch;
mod placement;
mod problem;
mod results;
mod scene;
mod several;
mod shown;
mod sides;
mod speeds;
mod steps;
mod team;
mod unlisted;
mod witness;

#[cfg(test)]
mod tests;

use std::io::{self, BufRead, Read};

use serde::Serialize;

use self::checker::Checker;
use self::lines::{About, ParsedLine};
pub use self::lines::{
    EventKind, ProvedClearance, ProvedEvent, ProvedObstacleClearance, ProvedPitch, ProvedSpeed, Status, Until,
};
use self::problem::{Problem, problem};

/// The most bytes of a line. The first line holds the text of the scene.
pub const LONGEST_LINE: u64 = 1 << 26;

/// The content of a valid certificate.
#[derive(Debug, Clone, Serialize)]
pub struct Proved {
    /// The text of its scene.
    pub scene: String,
    /// The version of the program that wrote the certificate.
    pub version: String,
    /// The names of the dragons in a scene of several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub dragons: Vec<String>,
    /// The results for contact, stall, lock and path end, in this order, and for each obstacle; none in a certificate
    /// of another question. With several dragons, the results of each, and then the contacts of each two.
    pub results: Vec<ProvedEvent>,
    /// The least clearance, in a certificate of that question.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least_clearance: Option<ProvedClearance>,
    /// With several dragons, the least clearance of each, and then of each two.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub least_clearances: Vec<ProvedClearance>,
    /// The least clearance of each obstacle, in a certificate of that question; with several dragons, for each of them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub obstacle_clearances: Vec<ProvedObstacleClearance>,
    /// The greatest speed, in a certificate of that question.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub greatest_speed: Option<ProvedSpeed>,
    /// The least pitch, in a certificate of that question.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least_pitch: Option<ProvedPitch>,
    /// The number of steps checked.
    pub steps: u64,
    /// The number of links checked, in all steps.
    pub links: u64,
    /// The number of pairs of boards checked, in all steps.
    pub pairs: u64,
}

/// The reason to refuse a file.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// The file cannot be read.
    #[error("{0}")]
    Unreadable(io::Error),
    /// The file has not the form of a certificate.
    #[error("line {line}: {problem}")]
    Form {
        /// The line, from 1.
        line: u64,
        /// The problem.
        problem: String,
    },
    /// The form is right, but a line does not follow from the lines before it.
    #[error("line {line}: {problem}")]
    DoesNotFollow {
        /// The line, from 1.
        line: u64,
        /// The condition that does not follow.
        problem: String,
    },
}

/// Returns BLAKE3 of a scene's text. The messages of a show and a certificate identify a scene by it.
pub fn scene_hash(text: &str) -> [u8; 32] {
    *blake3::hash(text.as_bytes()).as_bytes()
}

/// Returns the text of a scene from the first line of the certificate of its events. The rest is not checked.
///
/// # Errors
/// [`Refused::Form`] for a line that is not the first of a certificate of events.
pub fn scene_of(first_line: &[u8]) -> Result<String, Refused> {
    let form = |problem: Problem| Refused::Form { line: 1, problem: problem.into() };
    let parsed = serde_json::from_slice(first_line).map_err(|error| form(problem!("{error}")))?;
    let Checker { about, alone, proved, .. } = Checker::begin(parsed).map_err(form)?;
    if alone.is_some() {
        return Err(form(problem!("it is a certificate of several dragons, expected one of a scene with [team]")));
    }
    if about == About::Events {
        return Ok(proved.scene);
    }
    Err(form(problem!("it is a certificate of another question, expected one of events (events --certify)")))
}

/// Checks a certificate. `progress` receives the number of bytes read.
///
/// # Errors
/// [`Refused`] for the first wrong line.
pub fn verify(mut lines: impl BufRead, progress: &mut dyn FnMut(u64)) -> Result<Proved, Refused> {
    verify_lines(&mut lines, progress)
}

/// Not generic: compiled, and optimised, with this crate.
fn verify_lines(lines: &mut dyn BufRead, progress: &mut dyn FnMut(u64)) -> Result<Proved, Refused> {
    let mut bytes = 0;
    let mut checker: Option<Checker> = None;
    for line in 1.. {
        let form = |problem: Problem| Refused::Form { line, problem: problem.into() };
        let mut text = Vec::new();
        let read = (&mut *lines).take(LONGEST_LINE).read_until(b'\n', &mut text).map_err(Refused::Unreadable)?;
        if read == 0 {
            break;
        }
        bytes += read as u64;
        progress(bytes);
        let parsed: ParsedLine = serde_json::from_slice(&text).map_err(|error| form(problem!("{error}")))?;
        match (&mut checker, parsed) {
            (None, first) => checker = Some(Checker::begin(first).map_err(form)?),
            (Some(checker), parsed) => {
                checker.add(parsed).map_err(|problem| Refused::DoesNotFollow { line, problem: problem.into() })?;
            }
        }
    }
    match checker {
        Some(checker) if checker.is_complete() => Ok(checker.finished()),
        Some(checker) if checker.about == About::Events || checker.alone.is_some() => {
            Err(Refused::Form { line: 1, problem: "the file ends before its results".to_owned() })
        }
        Some(_) => Err(Refused::Form { line: 1, problem: "the file ends before its result".to_owned() }),
        None => Err(Refused::Form { line: 1, problem: "the file is empty".to_owned() }),
    }
}
