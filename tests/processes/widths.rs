//! Lines for people fit a terminal: those of a run and of a soak test, of every scene of config/.

use std::path::PathBuf;
use std::process::Output;

use crate::harness::{Process, program, text};

/// The greatest width of a line.
const COLUMNS: usize = 120;

/// Asserts that no line of an output is wider, and returns its lines.
fn narrow(output: &Output, scene: &str) -> String {
    let printed = text(&output.stderr) + &text(&output.stdout);
    // A record of the log is one line where it is no terminal that reads it.
    let wide = printed.lines().filter(|line| line.chars().count() > COLUMNS && !line.starts_with('['));
    assert_eq!(wide.collect::<Vec<_>>(), Vec::<&str>::new(), "{scene}");
    printed
}

/// The scenes with the program, by their names.
fn scenes() -> Vec<(String, PathBuf)> {
    let folder = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/config")).unwrap();
    let scene = |file: PathBuf| (file.file_stem().unwrap().to_string_lossy().into_owned(), file);
    folder.map(|entry| scene(entry.unwrap().path())).collect()
}

#[test]
fn the_start_the_alerts_and_the_summary_of_every_show_fit_a_hundred_and_twenty_columns() {
    let scenes = scenes();
    assert!(scenes.len() >= 13);
    let mut folded = 0;
    for (scene, file) in scenes {
        let mut run = program("widths");
        // The whole show within two seconds.
        run.arg("run").arg(&file).args(["--duration", "2", "--rate", "100", "--time-scale", "600"]);
        let output = Process::start(&mut run).output();
        assert!(output.status.success(), "{scene}: {}", text(&output.stderr));
        let printed = narrow(&output, &scene);
        for expected in ["Scene \"", "Ahead, in simulated time", "frames published"] {
            assert!(printed.contains(expected), "{scene}: {printed}");
        }
        assert!(printed.lines().any(|line| line.contains(" s  ")), "{scene} has no line of an alert: {printed}");
        folded += printed.lines().filter(|line| line.starts_with("              ")).count();
    }
    assert!(folded > 0, "no line of an alert was folded");
}

#[test]
fn the_verdict_and_the_hints_of_a_soak_test_fit_a_hundred_and_twenty_columns() {
    let mut soak = program("widths_of_soak");
    // A limit that no machine keeps.
    soak.args(["soak", "--duration", "3", "--subscribers", "1", "--max-lateness-p999", "1ns"]);
    let output = Process::start(&mut soak).output();
    assert_eq!(output.status.code(), Some(1));
    let printed = text(&output.stdout);
    assert!(printed.starts_with("FAIL after ") && printed.contains("hint: "), "{printed}");
    narrow(&Output { stderr: Vec::new(), ..output }, "soak");
}
