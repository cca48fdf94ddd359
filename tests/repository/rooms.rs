//! The crates depend on each other as the table of ARCHITECTURE.md states, and boundaries that the compiler does not
//! check are kept.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use toml::Table;

/// Returns the crates of the workspace, by their folder.
pub(crate) fn crates() -> Vec<String> {
    let folders = std::fs::read_dir("crates").unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = folders.filter(|name| Path::new(&format!("crates/{name}/Cargo.toml")).exists()).collect();
    names.sort();
    names
}

/// Returns the crates of this workspace that a manifest names among its dependencies.
pub(crate) fn dependencies(name: &str) -> BTreeSet<String> {
    listed(name, "dependencies")
}

/// Returns the crates of this workspace that a table of a manifest names.
pub(crate) fn listed(name: &str, table: &str) -> BTreeSet<String> {
    let manifest: Table = std::fs::read_to_string(format!("crates/{name}/Cargo.toml")).unwrap().parse().unwrap();
    let listed = manifest.get(table).and_then(|table| table.as_table()).cloned().unwrap_or_default();
    listed.keys().filter_map(|key| key.strip_prefix("bench-dragon-")).map(str::to_owned).collect()
}

/// Returns all Rust files below a folder.
pub(crate) fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let below = |path: PathBuf| match path.is_dir() {
        true => sources(&path),
        false => Vec::from_iter((path.extension().is_some_and(|ext| ext == "rs")).then_some(path)),
    };
    entries.flat_map(below).collect()
}

#[test]
fn the_architecture_page_lists_every_crate_with_its_dependencies() {
    let page = include_str!("../../ARCHITECTURE.md");
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `")?.strip_suffix(" |")?.split_once("` | "));
    let listed: BTreeMap<String, BTreeSet<String>> = rows
        .filter_map(|(name, rest)| {
            let (_, depends) = rest.rsplit_once(" | ")?;
            let names = depends.split('`').skip(1).step_by(2).map(str::to_owned).collect();
            Some((name.to_owned(), names))
        })
        .filter(|(name, _)| Path::new(&format!("crates/{name}")).exists())
        .collect();
    let found: BTreeMap<_, _> = crates().into_iter().map(|name| (name.clone(), dependencies(&name))).collect();
    assert!(found.len() >= 12, "{found:?}");
    assert_eq!(listed, found);
}

/// The checker of certificates shares no code with the search that writes them. Its manifest names no crate of this
/// workspace, so the compiler rejects shared code.
#[test]
fn the_checker_stands_alone() {
    assert_eq!(dependencies("proof"), BTreeSet::new());
}

/// No program depends on the crate `testing`.
#[test]
fn no_crate_depends_on_the_testing_crate() {
    assert!(crates().iter().all(|name| !dependencies(name).contains("testing")));
}

/// The files that know the kinds of a curve: what a new kind touches, with a file of its own and its line in
/// `crates/motion/src/model.rs`. Beyond these, tests name kinds.
const KNOW_KINDS: [&str; 11] = [
    "crates/certify/src/path.rs",
    "crates/design/src/handles/pieces.rs",
    "crates/drawing/src/route.rs",
    "crates/messages/src/layouts/stage.rs",
    "crates/motion/src/model/description.rs",
    "crates/motion/src/model/segment.rs",
    "crates/motion/src/solve/reference/curve.rs",
    "crates/outputs/src/view/drawing.js",
    "crates/proof/src/pieces.rs",
    "crates/show/src/convert.rs",
    "crates/show/src/scene/piece.rs",
];

/// Returns the hand-written product code of all crates: the text of each file before its unit tests.
fn product_code() -> Vec<(PathBuf, String)> {
    let folders = crates().into_iter().map(|name| PathBuf::from(format!("crates/{name}/src")));
    let files = folders.chain([PathBuf::from("src")]).flat_map(|folder| sources(&folder));
    let pages = std::fs::read_dir("crates/outputs/src/view").unwrap().map(|entry| entry.unwrap().path());
    let files = files.chain(pages.filter(|path| path.extension().is_some_and(|extension| extension == "js")));
    let is_test = |path: &PathBuf| path.iter().any(|part| part == "tests" || part == "tests.rs");
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap();
        (path, text.split("#[cfg(test)]\nmod tests {").next().unwrap().to_owned())
    };
    files.filter(|path| !is_test(path)).map(read).collect()
}

/// Only some files distinguish the kinds of a curve, and outside the model none distinguishes the kinds of a segment.
#[test]
fn only_the_listed_files_know_the_kinds_of_a_curve() {
    // Each is followed by a kind or, in the page, is a kind itself.
    let names = ["RouteStep::", "PieceText::", "OutlineKind::", "Curve::", "SEGMENT_", "\"inward_spiral"];
    let code = product_code();
    let knows = |text: &str| {
        let is_kind = |end: usize| text[end..].starts_with(|next: char| next.is_ascii_uppercase() || next == '"');
        names.iter().any(|name| text.match_indices(name).any(|(at, _)| is_kind(at + name.len())))
    };
    let found = code.iter().filter(|(_, text)| knows(text)).map(|(path, _)| path.to_str().unwrap());
    assert_eq!(found.collect::<BTreeSet<_>>(), BTreeSet::from(KNOW_KINDS));
    let mut seen = 0;
    for (file, text) in &code {
        // `StageSegment::` and similar names are other types.
        let is_own = |at: usize| !text[..at].ends_with(|before: char| before.is_alphanumeric());
        let matches = text.match_indices("Segment::").filter(|(at, _)| is_own(*at)).count();
        if file.starts_with("crates/motion/src/model") || file.starts_with("crates/proof") {
            seen += matches;
        } else {
            assert_eq!(matches, 0, "{}", file.display());
        }
    }
    assert!(seen > 5, "{seen} matches in the model");
    // The checker has its own model; all other files use properties of a curve.
    for (file, text) in code.iter().filter(|(file, _)| !file.starts_with("crates/proof")) {
        let asks = [".is_line(", ".is_arc(", ".is_spiral("].iter().find(|kind| text.contains(**kind));
        assert_eq!(asks, None, "{}", file.display());
    }
    // The paper's solver and its words are for a spiral alone, whose followers have no branches, and a placement turns a
    // spiral's angles.
    let asks = code.iter().filter(|(_, text)| text.contains(".as_spiral()") || text.contains(".kind.spiral()"));
    let asks: BTreeSet<_> = asks.map(|(file, _)| file.to_str().unwrap()).collect();
    let motion = ["followed.rs", "lib.rs", "placement.rs"].map(|file| format!("crates/motion/src/{file}"));
    let others = ["crates/trade/src/candidates.rs", "src/commands/check/description.rs"];
    assert_eq!(asks, motion.iter().map(String::as_str).chain(others).collect());
}

/// A conversion that names every field does not compile until a new field has its place in it.
#[test]
fn a_pattern_of_a_layout_names_every_field() {
    let mut files = sources(Path::new("crates/messages/src/layouts"));
    files.push(PathBuf::from("crates/messages/src/layouts.rs"));
    let layouts: Vec<String> = files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
    let names = layouts.iter().flat_map(|text| text.split("\npub struct ").skip(1));
    let names = names.map(|rest| rest.split(|c: char| !c.is_alphanumeric()).next().unwrap());
    let own = ["Outgoing", "QueuedFrame", "Recorded"];
    let code = product_code();
    let mut seen = 0;
    for name in names.chain(own).collect::<BTreeSet<_>>() {
        let begin = format!("let {name} {{");
        let mut patterns = 0;
        for (file, text) in &code {
            for rest in text.split(&begin).skip(1) {
                let mut depth = 1;
                let end = rest.find(|c| {
                    depth += i32::from(c == '{') - i32::from(c == '}');
                    depth == 0
                });
                let pattern = &rest[..end.unwrap()];
                assert!(!pattern.contains(".."), "{}: {begin}{pattern}}}", file.display());
                patterns += 1;
            }
        }
        assert!(patterns > 0 || !own.contains(&name), "no pattern of {name}");
        seen += patterns;
    }
    assert!(seen > 10, "{seen} patterns");
}

/// `tests/run` names the test programs. A program that it does not name would never run, and neither would tests of a
/// crate that are no unit tests.
#[test]
fn tests_run_runs_every_test_program() {
    let run = include_str!("../run");
    let words = run.split(|c: char| c.is_whitespace() || c == '(' || c == ')');
    let named: BTreeSet<&str> = words.filter_map(|word| word.strip_prefix("--test=")).collect();
    let mut programs = 0;
    for entry in std::fs::read_dir("tests").unwrap().map(|entry| entry.unwrap().path()) {
        if entry.join("main.rs").exists() || entry.extension().is_some_and(|extension| extension == "rs") {
            let name = entry.file_stem().unwrap().to_str().unwrap();
            assert!(named.contains(name), "tests/run does not run {name}");
            programs += 1;
        }
    }
    assert!((8..=10).contains(&programs), "{programs} test programs");
    assert!(crates().iter().all(|name| !Path::new(&format!("crates/{name}/tests")).exists()));
}
