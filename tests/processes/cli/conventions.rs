//! Conventions of all commands: options before and after the subcommand, exit codes, closed pipes.

use std::fs::OpenOptions;
use std::process::{Command, Output, Stdio};

use crate::cli::scenes::{program, scene, scenes};
use crate::harness::{Place, Process, text};

/// Every command that ends by itself, with the options that make it short.
const COMMANDS: [&[&str]; 9] = [
    &["events"],
    &["events", "--json"],
    &["check"],
    &["solve", "--at", "0,1"],
    &["solve", "--at", "0,1", "--json"],
    &["draw"],
    &["plan", "pitch", "--reach-radius", "1"],
    &["plan", "speed", "--max-handle-speed", "2"],
    &["run", "--json", "--duration", "0.5"],
];

#[test]
fn options_stand_before_or_after_the_subcommand() {
    let scene = scene("procession");
    let path = scene.path.to_str().unwrap();
    for command in COMMANDS.iter().filter(|command| command[0] != "run" && !command.contains(&"--json")) {
        let answer = |arguments: &[&str]| {
            let output = Process::start(program().args(arguments)).output();
            assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
            // The time for making a table is measured again in each run.
            let made = |line: &str| line.split(", made in ").next().unwrap_or_default().to_owned();
            text(&output.stdout).lines().map(made).collect::<Vec<_>>()
        };
        let before = answer(&[&["--scene", path, "--name", "n", "--json"], *command].concat());
        let after = answer(&[*command, &["--json", "--name", "n", "--scene", path]].concat());
        assert!(!before.is_empty() && before == after, "{command:?}");
        // --json changes the output of a command that has JSON to print.
        if command[0] != "check" {
            assert_ne!(before.join("\n"), scene.answer(command).trim_end(), "{command:?}");
        }
    }
}

#[test]
fn every_command_refuses_a_bad_scene_in_the_same_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let bad = folder.path().join("bad.toml");
    let content = std::fs::read_to_string(&scene("school").path).unwrap();
    std::fs::write(&bad, content.replace("pitch = 0.55", "pitch = -0.55")).unwrap();
    let line = content.lines().position(|line| line.starts_with("pitch")).unwrap() + 1;
    let also: [&[&str]; 3] = [&["trade"], &["run"], &["soak", "--duration", "1s"]];
    for command in COMMANDS.iter().chain(&also) {
        let output = Process::start(program().arg("--scene").arg(&bad).args(*command)).output();
        let printed = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{command:?}: {printed}");
        assert!(output.stdout.is_empty() && printed.lines().count() == 1, "{command:?}: {printed}");
        for part in [bad.to_str().unwrap(), &format!("line {line}"), "path.pitch", "-0.55", "expected"] {
            assert!(printed.contains(part), "{command:?} names no {part}: {printed}");
        }
    }
}

#[test]
fn what_is_neither_done_nor_bad_input_is_exit_code_1_and_a_sentence() {
    let scene = scene("school");
    for command in COMMANDS {
        let place = Place::new("full");
        let mut full = place.program();
        full.arg("--scene").arg(&scene.path).args(command);
        full.stdin(Stdio::null()).stderr(Stdio::piped());
        full.stdout(OpenOptions::new().write(true).open("/dev/full").unwrap());
        let output = full.spawn().unwrap().wait_with_output().unwrap();
        let printed = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{command:?}: {printed}");
        assert!(printed.contains("No space left") && printed.lines().count() == 1, "{command:?}: {printed}");
    }
    let printed = scene.run(&["solve", "--at", "0", "-o", "/dev/full"]);
    assert_eq!(printed.status.code(), Some(1), "{}", text(&printed.stderr));
}

/// Runs a command whose readers go away before it prints anything.
fn end_unread(command: &mut Command, stdout: bool, stderr: bool) -> Output {
    let mut process = Process::start(command);
    if stdout {
        process.close_stdout();
    }
    if stderr {
        process.close_stderr();
    }
    process.output()
}

/// `| head` and `2>&1 | head`: the reader has closed the pipe.
#[test]
fn a_closed_pipe_ends_quietly() {
    let scene = scene("school");
    let short = ["run", "--duration", "0.5"];
    let rows = ["solve", "--every", "0.01", "--until", "1"];
    // This command reports on standard error.
    let past_the_end = ["solve", "--every", "10", "--until", "1000"];
    for command in COMMANDS.iter().chain(&[&short[..], &rows, &past_the_end]) {
        let place = Place::new("unread");
        for (stdout, stderr) in [(true, false), (false, true), (true, true)] {
            let mut whole = place.program();
            whole.arg("--scene").arg(&scene.path).args(*command);
            let output = end_unread(&mut whole, stdout, stderr);
            let printed = text(&output.stderr);
            assert_eq!(output.status.code(), Some(0), "{command:?}, {stdout} {stderr}: {printed}");
            assert!(!printed.contains("panicked") && !printed.contains("pipe"), "{command:?}: {printed}");
        }
    }
}

#[test]
fn a_refusal_that_nobody_reads_has_its_exit_code() {
    for arguments in [&["solve", "--at", "500"][..], &["run", "--rate", "0"], &["dance"]] {
        let output = end_unread(program().args(arguments), true, true);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn help_and_version_are_on_standard_output() {
    for (arguments, word) in
        [(&["--help"][..], "Usage"), (&["--version"], "bench-dragon "), (&["solve", "--help"], "--at")]
    {
        let output = Process::start(program().args(arguments)).output();
        assert!(output.status.success() && text(&output.stdout).contains(word), "{arguments:?}");
        assert!(output.stderr.is_empty(), "{arguments:?}");
    }
}

/// `-v` and `--quiet` change the log on standard error, and nothing on standard output.
#[test]
fn the_amount_of_logging_does_not_change_the_result() {
    for scene in scenes().into_iter().filter(|scene| scene.benches() <= 60) {
        let expected = scene.answer(&["events", "--json"]);
        for option in ["-v", "-vv", "--quiet"] {
            let output = scene.run(&["events", "--json", option]);
            assert_eq!((output.status.code(), text(&output.stdout)), (Some(0), expected.clone()), "{option}");
        }
    }
}
