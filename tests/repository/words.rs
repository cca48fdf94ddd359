//! No private word is in sources, tests, examples or documents if the field has a standard word, and no phrase that
//! must be read twice.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Each private word, and the word to write instead. Private words that are ordinary English as well are left out.
const PRIVATE: [(&str, &str); 40] = [
    // Geometry and paths.
    ("motion_beside", "relative_motion_bound"),
    ("StagePiece", "StageSegment"),
    ("calm_until", "stall_free_until"),
    ("is_calm_from", "stall_free_from"),
    ("sharpest_between", "max_curvature_between"),
    ("end_of_even_piece", "end_of_constant_curvature"),
    ("chord_excess", "chord_residual"),
    ("first_true", "bisect_predicate"),
    ("least_between", "golden_section_min"),
    ("Leg", "Segment"),
    // Events and clearance.
    ("quiet_until", "contact_free_until"),
    ("loud_radius", "contact_possible_radius"),
    ("last_place", "last_solvable"),
    ("excluded_from", "cull_from"),
    ("Mover", "MovingBoard"),
    // Solvers.
    ("Stencil", "LagrangeWeights"),
    ("read_off", "interpolate"),
    ("STRAND", "LANE_SEGMENT"),
    ("Strand", "NodeChain"),
    ("strand", "node_chain"),
    ("strands", "node chains"),
    ("steepening", "slope_change"),
    ("wrapped_up_from", "wrap_lower_bound"),
    ("or_if_odd", "select_if_odd"),
    ("negated_multiply_add", "fnmadd"),
    ("to_quarter", "round_to_quarter"),
    ("short_arc_tangent_in_turns", "atan_small_turns"),
    // Show, live, transports.
    ("RELEASE", "HYSTERESIS_RATIO"),
    ("CALM", "RELEASE_HOLD"),
    ("next_danger", "next_alertable"),
    ("mark_front", "mark_pareto_front"),
    ("Punctuality", "Real-time scheduling"),
    ("rub_out", "clear_previous"),
    ("keep_removing", "spawn_reaper"),
    ("HalfMade", "Incomplete"),
    ("turned_away", "rejected"),
    // Subscribers and page.
    ("is_welcome", "origin_allowed"),
    ("GLANCE", "POLL_INTERVAL"),
    ("LOOK", "LIVENESS_INTERVAL"),
    ("UNDER_WAY", "MAX_IN_FLIGHT"),
];

/// Phrases that a newcomer must read twice, and the remedy.
const PHRASES: [(&str, &str); 14] = [
    ("so many", "name the parameter"),
    ("Takes in", "handles, buffers, processes: the standard verb"),
    ("takes in", "handles, buffers, processes: the standard verb"),
    ("whoever", "name the actor"),
    ("Whoever", "name the actor"),
    ("what is not", "name the thing"),
    (" anew", "again"),
    (" amid", "among, during"),
    (" for ever", "without end"),
    ("seldom", "rarely, event-driven"),
    ("astray", "say what fails"),
    ("can be had", "is available"),
    ("akes leave", "shuts down"),
    ("has it that", "states"),
];

/// Returns all files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// Returns true for a text file that people write: code and documents, not pictures and records of measurements.
fn is_written(path: &Path) -> bool {
    let written = ["rs", "py", "js", "css", "md", "toml"];
    path.extension().is_some_and(|extension| written.iter().any(|written| extension == *written))
}

/// Returns every written file of the repository except this one, which lists the words.
fn written() -> Vec<PathBuf> {
    let folders = ["src", "crates", "tests", "benches", "examples", "docs", "config", "fuzz/fuzz_targets"];
    let all = folders.into_iter().flat_map(|folder| files(Path::new(folder)));
    let pages = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md"].map(PathBuf::from);
    let all = all.chain(pages).filter(|file| is_written(file) && !file.ends_with("repository/words.rs"));
    let all = Vec::from_iter(all);
    assert!(all.len() > 300, "{} files", all.len());
    all
}

#[test]
fn no_private_word_is_left() {
    let replacements = HashMap::from(PRIVATE);
    let mut found = Vec::new();
    for file in written() {
        for (number, line) in std::fs::read_to_string(&file).unwrap().lines().enumerate() {
            for word in line.split(|c: char| !c.is_alphanumeric() && c != '_') {
                if let Some(replacement) = replacements.get(word) {
                    found.push(format!("{}:{}: {word}: write {replacement}", file.display(), number + 1));
                }
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// Returns true if the phrase stands in the line as words of its own.
fn has(line: &str, phrase: &str) -> bool {
    let ends = |at: usize| !line[at + phrase.len()..].starts_with(|next: char| next.is_alphanumeric() || next == '_');
    line.match_indices(phrase).any(|(at, _)| ends(at))
}

#[test]
fn no_phrase_that_must_be_read_twice_is_left() {
    let mut found = Vec::new();
    for file in written() {
        for (number, line) in std::fs::read_to_string(&file).unwrap().lines().enumerate() {
            for (phrase, remedy) in PHRASES.iter().filter(|(phrase, _)| has(line, phrase)) {
                found.push(format!("{}:{}: \"{phrase}\": {remedy}", file.display(), number + 1));
            }
        }
    }
    assert!(found.is_empty(), "{} places:\n{}", found.len(), found.join("\n"));
}
