//! `examples/python/contest.py`: the answers to the contest's questions, and its tables.

use std::path::Path;

use crate::harness::{Process, can_run, python, python_modules, text};

/// Returns the number that follows some words.
fn number_after(printed: &str, words: &str) -> f64 {
    let (_, rest) = printed.split_once(words).unwrap_or_else(|| panic!("no {words:?} in {printed}"));
    let number: String = rest.chars().take_while(|letter| letter.is_ascii_digit() || *letter == '.').collect();
    number.parse().unwrap_or_else(|_| panic!("no number after {words:?} in {printed}"))
}

/// The numbers are of others: 50 digits for the contact; the published pitch, length and speed that an independent
/// computation confirmed; the least turn by its formula.
#[test]
#[ignore = "computes for long: tests/run --all"]
fn the_example_answers_the_contest() {
    if !can_run(python_modules(&["openpyxl", "numpy"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut example = python();
    example.env("BENCH_DRAGON_PROGRAM", env!("CARGO_BIN_EXE_bench-dragon"));
    let output = Process::start(example.arg("examples/python/contest.py").arg("--folder").arg(folder.path())).output();
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let near = |words: &str, truth: f64, within: f64| {
        let found = number_after(&printed, words);
        assert!((found - truth).abs() <= within, "{words} {found}, not {truth}");
    };
    near("touch at ", 412.473837682115, 1e-9);
    near("pitch is between ", 0.450337393027, 1e-9);
    near("the S is ", 13.621244907, 2e-9);
    near("a radius of ", 4.26999721, 1e-8);
    near("head may go at ", 1.246266358157, 1e-9);
    assert!(printed.contains("benches 1 and 9 touch") && printed.contains("handle 3 ("), "{printed}");
    let truth = |file: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/truth").join(file);
    let mut judge = python();
    judge.arg("tests/python/contest_tables.py").arg(folder.path());
    judge.args([truth("paper_scene_exact.csv"), truth("turnaround_table.csv")]);
    let output = Process::start(&mut judge).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    // Six decimals, and all of the truth: every handle at 0, 60, ... 300 s; eight at -100, -50, 0, 14, 50, 100 s.
    for (table, numbers) in [("result1", 6 * 224 * 3), ("result4", 6 * 8 * 3)] {
        let [error, compared] = [0, 1].map(|k| found[table][k].as_f64().unwrap());
        assert!(error <= 5.1e-7 && compared == f64::from(numbers), "{table}: {found}");
    }
    assert!(found["result2"].as_f64().unwrap() <= 5.1e-7, "{found}");
}
