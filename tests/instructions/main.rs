//! Cost of the parts of a step, counted in instructions: none may cost 5 % more than its line in `baseline.toml`.
//!
//! Callgrind counts. It offers a program a processor with AVX2 and without AVX-512, and no load changes its counts. Two
//! runs differ only in the proofs, by less than 0.1 %. Some of the counts are this program's own, which is compiled
//! without optimisation: up to 80 a call. A change with an intended higher cost runs
//!
//! ```text
//! BENCH_DRAGON_WRITE=1 cargo test --release --test instructions
//! ```
//!
//! and commits the baseline. Another compiler or C library changes counts by some percent without a change of the code.
//! With a baseline of other tools a part therefore fails only at 25 %.

#[path = "../harness/mod.rs"]
mod harness;
mod measured;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use harness::{Process, aloud, not_run, text};
use serde::{Deserialize, Serialize};

const BASELINE: &str = "tests/instructions/baseline.toml";
/// Greatest increase of a part over its baseline: with the same tools, and with other tools.
const MOST: f64 = 0.05;
const MOST_OF_OTHER_TOOLS: f64 = 0.25;

/// Counted instructions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Counts {
    /// The compiler, the C library with its elementary functions, and valgrind.
    tools: [String; 3],
    /// The instruction set that reads tables.
    instructions: String,
    /// Instructions per call, by part.
    parts: BTreeMap<String, u64>,
}

/// Returns the first line that a program prints.
fn first_line(program: &str, argument: &str) -> Result<String, String> {
    let output = Command::new(program).arg(argument).output().map_err(|error| format!("no {program} ({error})"))?;
    Ok(text(&output.stdout).lines().next().unwrap_or_default().to_owned())
}

/// Counts under callgrind; returns a sentence if there is no valgrind.
fn count() -> Result<Counts, String> {
    let tools = [
        first_line("rustc", "--version")?,
        first_line("getconf", "GNU_LIBC_VERSION")?,
        first_line("valgrind", "--version")?,
    ];
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("counts");
    let mut callgrind = Command::new("valgrind");
    callgrind.arg("--tool=callgrind").arg(format!("--callgrind-out-file={}", file.display()));
    callgrind.args(["--toggle-collect=*measured::counted", "--dump-after=*measured::part_is_over"]);
    callgrind.arg(std::env::current_exe().unwrap()).args(["--exact", "under_callgrind", "--ignored", "--nocapture"]);
    let output = Process::start(&mut callgrind).output();
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{printed}\n{}", text(&output.stderr));
    let lines = |start: &'static str| printed.lines().filter_map(move |line| line.split_once(start));
    let instructions = lines(measured::WITH).next().unwrap().1.to_owned();
    let mut parts = BTreeMap::new();
    for (number, (_, line)) in (1..).zip(lines(measured::PART)) {
        let (calls, name) = line.split_once(' ').unwrap();
        let total = total(&file.with_extension(number.to_string()));
        assert!(total > 0, "{name}: nothing was counted");
        parts.insert(name.to_owned(), total / calls.parse::<u64>().unwrap());
    }
    assert!(!parts.is_empty(), "{printed}");
    Ok(Counts { tools, instructions, parts })
}

/// Returns the instructions of one of callgrind's files.
fn total(file: &Path) -> u64 {
    let text = std::fs::read_to_string(file).unwrap();
    let total = text.lines().find_map(|line| line.strip_prefix("totals: ")).unwrap();
    total.parse().unwrap()
}

/// Returns a line for each part, and the lines that fail.
fn compare(was: &Counts, is: &Counts) -> (Vec<String>, Vec<String>) {
    let most = if was.tools == is.tools { MOST } else { MOST_OF_OTHER_TOOLS };
    let (mut lines, mut failed) = (Vec::new(), Vec::new());
    for name in was.parts.keys().chain(is.parts.keys().filter(|name| !was.parts.contains_key(*name))) {
        let (line, fails) = match (was.parts.get(name), is.parts.get(name)) {
            (Some(was), Some(is)) => {
                let more = *is as f64 / *was as f64 - 1.0;
                (format!("{name}: was {was}, is {is} instructions a call, {:+.2} %", 100.0 * more), more > most)
            }
            (Some(_), None) => (format!("{name}: is in {BASELINE}, and is not counted any more"), true),
            (None, is) => (format!("{name}: is not in {BASELINE}, is {is:?} instructions a call"), true),
        };
        failed.extend(fails.then(|| line.clone()));
        lines.push(line);
    }
    (lines, failed)
}

#[test]
fn no_part_costs_5_percent_more_instructions_than_its_baseline() {
    if cfg!(debug_assertions) || !cfg!(target_arch = "x86_64") {
        return aloud("NOT RUN: instruction counts: the baseline is of a release build for x86-64");
    }
    let is = match count() {
        Ok(counts) => counts,
        Err(why) => return not_run(&format!("{why}; tests/run installs it")),
    };
    if std::env::var_os("BENCH_DRAGON_WRITE").is_some() {
        return std::fs::write(BASELINE, written(&is)).unwrap();
    }
    let was: Counts = toml::from_str(&std::fs::read_to_string(BASELINE).unwrap()).unwrap();
    if was.instructions != is.instructions {
        let (was, is) = (was.instructions, is.instructions);
        return aloud(&format!("NOT RUN: instruction counts: the baseline is of {was}, this processor offers {is}"));
    }
    let (lines, failed) = compare(&was, &is);
    lines.iter().for_each(|line| aloud(line));
    if was.tools != is.tools {
        aloud(&format!("The baseline is of {}; these are {}.", was.tools.join(", "), is.tools.join(", ")));
    }
    assert!(
        failed.is_empty(),
        "{}\nIf it is intended: BENCH_DRAGON_WRITE=1 cargo test --release --test instructions",
        failed.join("\n")
    );
}

fn written(counts: &Counts) -> String {
    format!(
        "# Written by BENCH_DRAGON_WRITE=1 cargo test --release --test instructions\n{}",
        toml::to_string(counts).unwrap()
    )
}

#[test]
#[ignore = "the test above runs it under callgrind"]
fn under_callgrind() {
    measured::run();
}

#[test]
fn what_fails_is_named() {
    let counts = |parts: &[(&str, u64)], libc: &str| Counts {
        tools: ["rustc 1".to_owned(), libc.to_owned(), "valgrind 3".to_owned()],
        instructions: "portable".to_owned(),
        parts: parts.iter().map(|(name, count)| (name.to_string(), *count)).collect(),
    };
    let was = counts(&[("frame", 1000), ("gone", 1), ("publish", 1000)], "glibc 2");
    let failed = |parts, libc| compare(&was, &counts(parts, libc)).1;
    assert!(failed(&[("frame", 1049), ("gone", 1), ("publish", 1)], "glibc 2").is_empty());
    assert_eq!(
        failed(&[("frame", 1051), ("new", 7), ("publish", 1000)], "glibc 2"),
        [
            "frame: was 1000, is 1051 instructions a call, +5.10 %",
            "gone: is in tests/instructions/baseline.toml, and is not counted any more",
            "new: is not in tests/instructions/baseline.toml, is Some(7) instructions a call",
        ]
    );
    assert!(failed(&[("frame", 1249), ("gone", 1), ("publish", 1)], "glibc 3").is_empty());
    assert_eq!(failed(&[("frame", 1251), ("gone", 1), ("publish", 1)], "glibc 3").len(), 1);
}
