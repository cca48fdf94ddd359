//! The prose of sources, tests, examples and documents. It has no private word where the field has a standard word, and
//! no phrase that must be read twice. Its comments begin with a noun, and no sentence runs away.

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

/// Phrases that a newcomer must read twice, in lower case, and the remedy.
const PHRASES: [(&str, &str); 17] = [
    ("so many", "name the parameter"),
    ("takes in", "handles, buffers, processes: the standard verb"),
    ("whoever", "name the actor"),
    ("nobody", "name the actor"),
    ("somebody", "name the actor"),
    ("everybody", "name the actor"),
    ("what is not", "name the thing"),
    (" anew", "again"),
    (" amid", "among, during"),
    (" for ever", "without end"),
    ("seldom", "rarely, event-driven"),
    ("astray", "say what fails"),
    ("can be had", "is available"),
    ("akes leave", "shuts down"),
    ("has it that", "states"),
    ("go on", "continue"),
    ("goes on", "continues"),
];

/// Words that stand in the place of a noun at the beginning of a paragraph.
const NOT_NOUNS: [&str; 7] = ["What", "Whatever", "Those", "How", "Which", "Whose", "Who"];

/// The most words of a sentence. A code span is one word. Shorter is no aim: a reason keeps its "because", and a
/// consequence its "so". The limit only finds sentences that have run away.
const MOST_WORDS: usize = 35;

/// Returns all files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// Returns true for a text file that people write: code and documents, not pictures and records of measurements.
fn is_written(path: &Path) -> bool {
    let written = ["rs", "py", "js", "mjs", "css", "cpp", "md", "toml", "sh", "msg", "srv"];
    path.extension().is_some_and(|extension| written.iter().any(|written| extension == *written))
}

/// Returns every written file of the repository except this one, which lists the words.
fn written() -> Vec<PathBuf> {
    let folders = ["src", "crates", "tests", "benches", "examples", "docs", "config", "packaging", "msgs", "fuzz"];
    let all = folders.into_iter().flat_map(|folder| files(Path::new(folder)));
    let pages = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md"].map(PathBuf::from);
    let is_ours = |file: &PathBuf| is_written(file) && !file.iter().any(|part| part == "target" || part == "corpus");
    let all = all.chain(pages).filter(|file| is_ours(file) && !file.ends_with("repository/words.rs"));
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
            let line = line.to_lowercase();
            for (phrase, remedy) in PHRASES.iter().filter(|(phrase, _)| has(&line, phrase)) {
                found.push(format!("{}:{}: \"{phrase}\": {remedy}", file.display(), number + 1));
            }
        }
    }
    assert!(found.is_empty(), "{} places:\n{}", found.len(), found.join("\n"));
}

/// Returns the text of the comment that a line is, and its mark; `None` for a line without a comment of its own.
fn comment<'l>(line: &'l str, marks: &[&'static str]) -> Option<(&'l str, &'static str)> {
    let line = line.trim_start();
    let mark = marks.iter().find(|mark| line == mark.trim_end() || line.starts_with(**mark))?;
    Some((line.get(mark.len()..).unwrap_or_default().trim_end_matches("*/"), mark))
}

/// Returns the lines of prose in a file. A line of anything else is empty.
fn prose(file: &Path, text: &str) -> Vec<String> {
    let extension = file.extension().unwrap_or_default().to_str().unwrap();
    let marks: &[&str] = match extension {
        "md" => return text.lines().map(str::to_owned).collect(),
        "rs" | "js" | "mjs" | "css" | "cpp" => &["/// ", "//! ", "// ", "/** ", "/* ", "* "],
        _ => &["# "],
    };
    let is_python = extension == "py" || text.starts_with("#!/usr/bin/env python3");
    let (mut lines, mut last, mut code_before, mut is_string) = (Vec::new(), "", ":", false);
    // The indentation of a docstring.
    let mut docstring = None;
    for line in text.lines() {
        let is_odd = is_python && line.matches("\"\"\"").count() % 2 == 1;
        let indentation = line.len() - line.trim_start().len();
        let opens = is_python && !is_string && line.trim_start().starts_with("\"\"\"") && code_before.ends_with(':');
        if let Some(indented) = docstring.or(opens.then_some(indentation)) {
            let begins = if docstring.is_some() { "" } else { "- " };
            lines.push(format!("{begins}{}", line.get(indented..).unwrap_or_default().replace("\"\"\"", "")));
            docstring = if docstring.is_some() ^ is_odd { Some(indented) } else { None };
            code_before = "";
            continue;
        }
        is_string ^= is_odd;
        let (found, mark) = comment(line, marks).unwrap_or(("", ""));
        if mark.is_empty() && !line.trim().is_empty() {
            code_before = line;
        }
        // Neighbours of different marks are different texts. A block comment has two marks.
        let is_same = last.is_empty() || mark.is_empty() || mark == last || mark == "* " && last.starts_with("/*");
        lines.push(if is_same { found.to_owned() } else { format!("- {found}") });
        last = mark;
    }
    lines
}

/// Returns true for a line that begins an item of a list.
fn is_item(line: &str) -> bool {
    let number = line.trim_start_matches(|c: char| c.is_ascii_digit());
    ["- ", "* ", "+ ", "@"].iter().any(|mark| line.starts_with(mark)) || number != line && number.starts_with(". ")
}

/// Returns the paragraphs of lines of prose, each with the number of its first line. Code, tables, headings and HTML are
/// left out.
fn paragraphs(lines: &[String]) -> Vec<(usize, String)> {
    let (mut found, mut is_code) = (vec![(0, String::new())], false);
    for (number, line) in (1..).zip(lines) {
        let text = line.trim();
        let is_fence = text.starts_with("```");
        is_code ^= is_fence;
        let is_html =
            text.strip_prefix('<').is_some_and(|rest| rest.starts_with(|c: char| !c.is_whitespace() && c != '='));
        let begins = found.last().is_none_or(|(_, text)| text.is_empty());
        let is_formula = begins && line.starts_with("    ");
        let is_row = text.len() > 1 && text.starts_with('|') && text.ends_with('|');
        let is_heading = text.trim_start_matches('#').starts_with(' ');
        if text.is_empty() || is_code || is_fence || is_html || is_formula || is_row || is_heading {
            found.push((0, String::new()));
            continue;
        }
        if begins || is_item(text) {
            found.push((number, String::new()));
        }
        let (_, paragraph) = found.last_mut().unwrap();
        paragraph.push_str(text);
        paragraph.push(' ');
    }
    found
}

/// Returns the sentences of a paragraph, as words. A code span is one word.
fn sentences(paragraph: &str) -> Vec<Vec<&str>> {
    let is_end = |word: &str| {
        let word = word.trim_end_matches(['"', '\'', ')', ']', '*', '_', '`']);
        word.len() > 1 && word.ends_with(['.', '!', '?'])
    };
    let (mut found, mut is_span) = (vec![Vec::new()], false);
    let words: Vec<&str> = paragraph.split_whitespace().collect();
    for (at, word) in words.iter().enumerate() {
        let begins_in_span = is_span;
        is_span ^= word.matches('`').count() % 2 == 1;
        if !begins_in_span && word.contains(char::is_alphanumeric) {
            found.last_mut().unwrap().push(*word);
        }
        let next = words.get(at + 1).and_then(|next| next.chars().next());
        if !is_span && is_end(word) && next.is_none_or(|next| !next.is_lowercase()) {
            found.push(Vec::new());
        }
    }
    found
}

/// Returns each paragraph of the repository's prose, with its file and line.
fn all_paragraphs() -> Vec<(String, String)> {
    let scripts = ["tests/run", "tests/timings", "tests/checked", "packaging/build"];
    let others = ["CHANGELOG.md", "Cargo.toml", "deny.toml", "tests/repository/words.rs"];
    let files = written().into_iter().chain(others.into_iter().chain(scripts).map(PathBuf::from));
    let of_file = |file: PathBuf| {
        let lines = prose(&file, &std::fs::read_to_string(&file).unwrap());
        paragraphs(&lines).into_iter().map(move |(number, text)| (format!("{}:{number}", file.display()), text))
    };
    files.flat_map(of_file).collect()
}

#[test]
fn no_comment_begins_with_a_word_in_the_place_of_a_noun() {
    let pages = |place: &str| place.contains(".md:");
    let mut found = all_paragraphs();
    found.retain(|(place, text)| {
        !pages(place) && NOT_NOUNS.contains(&text.split_whitespace().next().unwrap_or_default())
    });
    let found: Vec<_> = found.iter().map(|(place, text)| format!("{place}: {text}")).collect();
    assert!(found.is_empty(), "{} comments:\n{}", found.len(), found.join("\n"));
}

#[test]
fn no_sentence_runs_away() {
    let (mut found, mut count) = (Vec::new(), 0);
    for (place, paragraph) in all_paragraphs() {
        for sentence in sentences(&paragraph) {
            count += usize::from(!sentence.is_empty());
            if sentence.len() > MOST_WORDS {
                found.push(format!("{place}: {} words: {}", sentence.len(), sentence.join(" ")));
            }
        }
    }
    assert!(count > 10_000, "{count} sentences");
    assert!(found.is_empty(), "{} of {count} sentences:\n{}", found.len(), found.join("\n"));
}

#[test]
fn a_sentence_ends_at_a_full_stop_and_a_code_span_is_a_word() {
    let counts = |file: &str, lines: &[&str]| {
        let paragraphs = paragraphs(&prose(Path::new(file), &lines.join("\n")));
        let counts = paragraphs.iter().flat_map(|(_, text)| sentences(text)).map(|words| words.len());
        counts.filter(|count| *count > 0).collect::<Vec<_>>()
    };
    let rust = ["/// One two", "/// `three three three` [four](address). Five: a . b", "", "// - six", "// - seven."];
    assert_eq!(counts("file.rs", &rust), [4, 3, 1, 1]);
    let rust =
        ["/// One", "/// |x| two.", "//! ```", "//! no prose", "//! ```", "//! |no|prose|", "code(); // no prose"];
    assert_eq!(counts("file.rs", &rust), [3]);
    let script = ["/** One two,", " * three. Four. */", "// Five.", "function six() {}"];
    assert_eq!(counts("file.js", &script), [3, 1, 1]);
    let python = [
        "def no_prose():",
        "    \"\"\"One two.",
        "",
        "    Three",
        "    four.",
        "    \"\"\"",
        "    x = f(",
        "\"\"\"no\"\"\")",
    ];
    assert_eq!(counts("file.py", &python), [2, 2]);
    assert_eq!(counts("file.md", &["# No prose", "", "| no | prose |", "", "One <= two."]), [2]);
}
